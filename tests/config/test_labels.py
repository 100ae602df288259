"""What people call a key: every key of every study has a label, found by each way in which a key is named."""

import pytest
from pydantic import Field

from radarsim.api.configs import load
from radarsim.config.key_types import Positive
from radarsim.config.labels import Label, label
from radarsim.config.model import Model
from radarsim.config.study_keys import StudyKeys


@pytest.mark.parametrize(
    ("config", "key", "expected"),
    [
        ("rls2", "radar.sigma_range_m", Label("σ of the measured range", "σ_r", "m")),
        ("rls2", "manoeuvre_variance", Label("manoeuvre variance", "D_M", "(m/s³)²")),
        ("rls2", "filters.1.manoeuvre_variance", Label("manoeuvre variance", "D_M", "(m/s³)²")),
        ("rls2", "filters.r+Vr.manoeuvre_variance", Label("manoeuvre variance", "D_M", "(m/s³)²")),
        ("rls2", "scans", Label("number of scans", "", "")),
        ("rls2", "seed", Label("seed", "", "")),
        ("rls2", "radar.no_such_key_mps2", Label("no such key", "", "m/s²")),
        ("sonar_clutter", "sensor.false_plots_per_km2", Label("clutter density", "", "km⁻²")),
        ("sonar_clutter", "sensor.sigma_bearing_deg", Label("σ of the measured bearing", "σ_β", "°")),
        ("sonar_clutter", "sensor.sigma_bearing_rad", Label("σ of the measured bearing", "σ_β", "rad")),
        ("discriminator", "steps", Label("scoring steps per window", "", "")),
        ("ambiguous", "prior.sigma_velocity_mps", Label("prior σ of the radial velocity", "σ_V0", "m/s")),
    ],
)
def test_a_label_by_path_bare_key_and_twin(config, key, expected):
    assert label(load(config).cases[0].spec, key) == expected
    assert label(type(load(config).cases[0].spec), key) == expected


class Leg(Model):
    """A study's mapping from outside."""

    length_m: Positive = Field(title="length of the leg", json_schema_extra={"symbol": "L"}, description="of a leg, m")
    width_m: Positive = Field(description="of a leg, m")
    slope_hz_per_s: Positive = Field(title="slope", json_schema_extra={"unit": "Hz/s"}, description="of a chirp, Hz/s")
    course_rad: Positive = Field(title="course", json_schema_extra={"unit": "rad"}, description="of a leg, rad")


class Outside(StudyKeys):
    """Keys of a study from outside."""

    bare_keys = "legs"
    legs: tuple[Leg, ...] = Field(title="legs", description="legs")


def test_a_study_from_outside_says_its_own():
    assert label(Outside, "length_m") == label(Outside, "legs.0.length_m") == Label("length of the leg", "L", "m")
    assert label(Outside, "slope_hz_per_s") == Label("slope", "", "Hz/s")
    assert label(Outside, "course_rad").unit == "rad"
    assert label(Outside, "course_deg").unit == "°"


@pytest.mark.parametrize(
    ("key", "unit"),
    [("a.sigma_mps", "m/s"), ("range_m.0", "m"), ("variance", ""), ("b_deg", "°"), ("s", ""), ("slope_hz_per_s", "")],
)
def test_the_end_of_a_key_names_its_unit(key, unit):
    assert label(None, key).unit == unit


def test_a_key_without_a_title_is_called_by_its_name():
    assert label(Outside, "legs.0.width_m") == Label("width", "", "m")
    assert label(None, "burst") == Label("burst", "", "")
