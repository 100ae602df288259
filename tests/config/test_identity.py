"""Which keys make another case, and which only another label; which make other noise."""

import hashlib
import itertools
import json
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Annotated

import pydantic
import pytest
from pydantic import Field

from radarsim.api.configs import load
from radarsim.config.find_files import SHIPPED
from radarsim.config.identity import identity_keys
from radarsim.config.key_types import key
from radarsim.config.marks import DataFile, DesignMark, LaterKeyMark
from radarsim.config.model import Model
from radarsim.config.study_keys import StudyKeys
from radarsim.studies import registry
from radarsim.studies.identity import identity
from radarsim.studies.noise import noise_key
from tests.config import case_identities

LABELS = ["radar.name=Something", "radar.band=metre", "filters.0.name=range alone"]
SAME = [
    "radar.repetition_rate_hz=1e3",
    "radar.detection_probability=1",
    "radar.bias_range_m=0",
    "filters.0.initial_scans=3",
    "baseline=r",
    "target={kind: polynomial, coefficients: [1e5, -250, 4]}",
]
FILTERS = [
    "manoeuvre_variance=0.5",
    "filters.1.observes=[range]",
    "filters.0.initial_scans=4",
    "baseline=r+Vr",
    "scans=20",
]
WORLDS = [
    "radar.sigma_range_m=300",
    "radar.sigma_velocity_mps=1",
    "radar.scan_period_s=5",
    "radar.wavelength_m=0.2",
    "radar.detection_probability=0.9",
    "target.coefficients.1=-251",
    "target=turn",
]


def spec(*overrides):
    return load("rls2", overrides).cases[0].spec


def made(*overrides, of="rls2"):
    """What tells a case from others, and its noise."""
    case = load(of, overrides).cases[0]
    return identity(case), noise_key(case, "plots").tobytes()


@pytest.mark.parametrize("override", [*LABELS, *SAME, "realisations=7"])
def test_labels_and_spelt_out_defaults_change_nothing(override):
    assert made(override) == made()


@pytest.mark.parametrize("override", FILTERS)
def test_filters_and_scans_change_the_case_but_not_its_noise(override):
    (case, noise), (before, same) = made(override), made()
    assert (case != before, noise == same) == (True, True)


@pytest.mark.parametrize(
    ("of", "known", "world"),
    [
        ("ambiguous_prior", "sweep.prior.sigma_velocity_mps=[77]", "radar.repetition_rate_hz=900"),
        ("discriminator", "estimators.0.lock_probability=0.9", "burst.noise_variance=9"),
        ("multimodel", "start_acceleration_mps2=10", "sensor.scan_period_s=0.7"),
        ("sonar_smoothing", "scans=20", "sensor.sigma_range_m=77"),
    ],
)
def test_what_filters_know_is_no_part_of_the_noise_of_any_study(of, known, world):
    (case, noise), (changed, same), (_, other) = made(of=of), made(known, of=of), made(world, of=of)
    assert (case != changed, noise == same, noise != other) == (True, True, True)


@pytest.mark.parametrize("override", WORLDS)
def test_the_world_changes_both(override):
    assert all(one != other for one, other in zip(made(override), made(), strict=True))


def test_the_baseline_is_a_place_and_no_name():
    renamed = spec("filters.1.name=other", "baseline=other")
    assert identity_keys(renamed)["baseline"] == 1
    assert identity_keys(renamed) == identity_keys(spec("baseline=r+Vr"))


def test_negative_zero_is_zero():
    plus, minus = (json.dumps(identity_keys(spec(f"target.coefficients=[1, {zero}]"))) for zero in ("0", "-0.0"))
    assert plus == minus


def test_a_named_scenario_is_its_content(good):
    good["target"] = "polynomial"
    inline = {"kind": "polynomial", "coefficients": [100e3, -250, 4]}
    assert identity_keys(load(good).cases[0].spec) == identity_keys(load({**good, "target": inline}).cases[0].spec)


@pytest.mark.parametrize("stem", sorted(file.stem for file in (SHIPPED / "configs").glob("*.yaml")))
def test_shipped_configs_go_to_json_and_back(stem):
    experiment = load(stem)
    assert json.loads(json.dumps(experiment.resolved, allow_nan=False)) == experiment.resolved
    for case in experiment.cases:
        told = json.loads(json.dumps(identity_keys(case.spec), allow_nan=False))
        assert told == identity_keys(case.spec)
        kept = {**case.keys, "realisations": case.realisations, "seed": case.seed}
        again = load({"study": case.study, **kept}).cases[0]
        assert (again.spec, again.seed, again.realisations) == (case.spec, case.seed, case.realisations)


def test_included_cases_are_the_cases_themselves():
    alone = load("rls2").cases[0]
    included = {case.name: case for case in load("range_doppler").cases}
    assert included["rls2"] == alone
    assert identity_keys(included["rls2 manoeuvre_variance=0.001"].spec) == identity_keys(alone.spec)


def test_cases_travel_to_other_processes():
    case = load("rls2").cases[0]
    assert pickle.loads(pickle.dumps(case)) == case
    assert len(pickle.dumps(case)) < 2000


def test_checked_objects_cannot_be_changed():
    case = load("rls2").cases[0]
    with pytest.raises(Exception, match="frozen"):
        case.spec.scans = 3
    with pytest.raises(Exception, match="cannot assign"):
        case.seed = 3


class Flight(Model):
    """A recorded flight."""

    file: Annotated[str, DataFile()] = Field(description="CSV of the flight")


class Recorded(StudyKeys):
    """A study of recorded flights."""

    flights: tuple[Flight, ...] = Field(description="flights")


@pytest.fixture
def recorded(monkeypatch):
    monkeypatch.setitem(registry.SHIPPED, "recorded", __name__)
    monkeypatch.setattr(registry, "keys", lambda name: Recorded)


def test_a_file_of_data_is_its_content(house, said, recorded):
    text = "study: recorded\nrealisations: 1\nflights: [{file: flight.csv}]\n"
    house("configs/own.yaml", text)
    assert said("own") == ["configs/own.yaml:3:18: flights.0.file: no such file: 'configs/flight.csv'"]
    house("configs/flight.csv", "t_s\n1\n")
    here = load("own").cases[0].spec
    assert here.flights[0].file == "configs/flight.csv"
    assert identity_keys(here)["flights"][0]["file"] == hashlib.sha256(b"t_s\n1\n").hexdigest()
    house("elsewhere.csv", "t_s\n1\n")
    there = load("own", ["flights.0.file=elsewhere.csv"]).cases[0].spec
    assert there.flights[0].file == "elsewhere.csv"
    assert identity_keys(there) == identity_keys(here)
    house("elsewhere.csv", "t_s\n2\n")
    assert identity_keys(there) != identity_keys(here)


def marks(model):
    """The kinds of marks on the key `shared` of a model."""
    return [type(mark) for mark in model.model_fields["shared"].metadata]


def test_a_key_that_several_models_share_has_the_marks_of_each():
    shared = key("key", "a key that several models share", [])
    first = pydantic.create_model("First", __base__=Model, shared=(Annotated[list[int], LaterKeyMark()], shared))
    second = pydantic.create_model("Second", __base__=Model, shared=(Annotated[list[str], DesignMark()], shared))
    third = pydantic.create_model("Third", __base__=Model, shared=(list[str], shared))
    assert [marks(model) for model in (first, second, third)] == [[LaterKeyMark], [DesignMark], []]
    assert (first(shared=[1]).shared, second(shared=["1"]).shared, third().shared) == ([1], ["1"], [])


class KeysOfAPlainClass:
    """Keys that models take from a class that is no model."""

    shared: Annotated[float | None, DesignMark()] = key("key", "a key that several models take", None)


@pytest.mark.filterwarnings("ignore:Field name:UserWarning")  # of pydantic's earlier versions
def test_a_key_that_several_models_take_from_a_plain_class_has_its_marks_once():
    for name in ("First", "Second"):
        model = type(name, (KeysOfAPlainClass, Model), {"__module__": __name__})
        assert marks(model) == [DesignMark]
        assert model(shared=2.0).shared == 2.0


def test_the_identity_of_a_case_does_not_depend_on_the_studies_imported_before():
    cases = {stem: load(stem).cases for stem in case_identities.CONFIGS}
    by_study = itertools.groupby(
        sorted(cases, key=lambda stem: cases[stem][0].study), lambda stem: cases[stem][0].study
    )
    command = [sys.executable, "-m", case_identities.__name__, *(",".join(stems) for _, stems in by_study)]
    alone = subprocess.run(command, cwd=Path(__file__).parents[2], capture_output=True, text=True, check=True)
    here = {f"{stem}: {case.name}": case_identities.case_identity(case) for stem in cases for case in cases[stem]}
    assert json.loads(alone.stdout) == here
