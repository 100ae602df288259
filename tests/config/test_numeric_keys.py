"""The numeric keys of a config: each is found, keeps its value when it is put back, and has the schema's bounds."""

import math

import pytest

from radarsim.api.configs import load
from radarsim.config import numeric_keys
from radarsim.errors import ConfigError
from tests.tolerances import assert_rounded

STEMS = ("rls2", "multimodel", "sonar_clutter", "sonar_manoeuvre", "discriminator")


@pytest.mark.slow_cases("sonar_manoeuvre")
@pytest.mark.parametrize("stem", STEMS)
def test_keys_can_be_set_to_their_own_values(stem):
    """What is found is what `--set` understands; only an item of a list that the config gives in degrees, or not at
    all, has no place there."""
    case = load(stem).cases[0]
    swept = {key for key, _ in case.swept_values}
    given = [key for key in numeric_keys.numeric_keys(case.spec) if key.value is not None and key.path not in swept]
    places, refused = [], []
    for key in given:
        try:
            assert load(stem, [f"{key.path}={key.value!r}"]).cases[0].spec == case.spec
            places.append(key)
        except ConfigError:
            refused.append(key.path)
    assert len(places) > 8
    assert all(path.rpartition(".")[2].isdecimal() for path in refused)
    assert stem != "rls2" or not refused


def test_the_keys_of_a_radar():
    keys = {key.path: key for key in numeric_keys.numeric_keys(load("rls2").cases[0].spec)}
    assert keys["radar.sigma_range_m"] == numeric_keys.NumericKey("radar.sigma_range_m", 250.0, 0, math.inf, False)
    assert keys["target.coefficients.2"].value == 4.0
    assert (keys["filters.1.initial_scans"].low, keys["filters.1.initial_scans"].is_whole) == (2, True)
    assert not any(path.startswith("radar.band") for path in keys)


def test_bounds_of_both_ends_and_optional_keys():
    keys = {key.path: key for key in numeric_keys.numeric_keys(load("sonar_clutter").cases[0].spec)}
    probability = keys["sensor.detection_probability"]
    assert (probability.low, probability.high) == (0, 1)
    assert (keys["filters.0.gate_probability"].value, keys["filters.0.plots"].value) == (0.99, None)
    assert "filters.0.degree" not in keys  # a choice of two


def test_a_bare_filter_key_means_every_filter_and_degrees_are_understood():
    spec = load("rls2").cases[0].spec
    both = numeric_keys.find_numeric_keys(spec, "manoeuvre_variance")
    assert [key.path for key in both] == ["filters.0.manoeuvre_variance", "filters.1.manoeuvre_variance"]
    (one,) = numeric_keys.find_numeric_keys(load("sonar_clutter").cases[0].spec, "sensor.sigma_bearing_deg")
    assert one.path == "sensor.sigma_bearing_deg"
    assert_rounded([one.value, one.high], [1, math.degrees(0.5)], operations=3)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("radar.sigma_velocty_mps", "did you mean radar.sigma_velocity_mps?"),
        ("sigma_range_m", "did you mean radar.sigma_range_m?"),
        ("radar.name", "holds no number"),
        ("filters", "holds no number"),
        ("zzz", "unknown key; there are radar., target., filters., scans, "),
        ("radar.sigma", "did you mean radar.sigma_range_m or radar.sigma_velocity_mps or "),
        ("radar.zzz", "unknown key; radar has wavelength_m, sigma_range_m, "),
        ("filters.7.manoeuvre_variance", "did you mean filters.1.manoeuvre_variance?; filters has 0., 1."),
        ("", "unknown key"),
    ],
)
def test_what_is_no_numeric_key(name, words):
    with pytest.raises(ConfigError) as refused:
        numeric_keys.find_numeric_keys(load("rls2").cases[0].spec, name)
    assert words in str(refused.value)
