"""Keys of trackers among false plots: what they refuse, and that plain filters know nothing of them."""

import pytest

from radarsim.app.configs import load
from radarsim.config.experiment import world
from radarsim.errors import ConfigError

SECTOR = {"range_m": [2e3, 15e3], "bearing_deg": [-40, 80]}


def without(given):
    """A mapping without the keys that are None."""
    return {key: value for key, value in given.items() if value is not None}


def config(sensor=(), first=(), **top):
    return {
        "study": "sonar",
        "sensor": without(
            {"sigma_range_m": 30.0, "sigma_bearing_deg": 1.0, "scan_period_s": 5.0, "sector": SECTOR, **dict(sensor)}
        ),
        "target": "sonar_straight",
        "filters": [without({"name": "a", "kind": "kalman", "association": "nearest", **dict(first)})],
        "scans": 20,
        "realisations": 10,
    } | top


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (config({"sector": None}), "sensor.sector: is needed by filters with an association"),
        (config({"sector": SECTOR | {"range_m": [5, 5]}}), "sensor.sector.range_m: must be a smaller and a larger"),
        (config({"sector": SECTOR | {"bearing_deg": [0, 361]}}), "sensor.sector.bearing_deg: must be a smaller and a"),
        (config({"false_plots_per_km2": -1}), "sensor.false_plots_per_km2: must be >= 0, got -1"),
        (config({"false_plots_per_km2": 1e5}), "sensor.false_plots_per_km2: must be <= 10000"),
        (
            config({"false_plots_per_km2": 1e4, "sector": SECTOR | {"range_m": [0, 1e5]}}),
            "sensor.false_plots_per_km2: must give at most 1e+07 false plots a scan in the sector",
        ),
        (config({"error_correlation": 0.5}), "sensor.error_correlation: must be 0 for filters with an association"),
        (config({"sigma_elevation_rad": 0.01}), "sensor.sigma_elevation_rad: must not be given for filters with an"),
        (
            config({"further": [{"sigma_range_m": 3, "scan_period_s": 3, "first_s": 1}]}),
            "sensor.further: must be empty",
        ),
        (config(first={"gate_probability": 0}), "filters.0.gate_probability: must be > 0, got 0"),
        (config(first={"gate_probability": 1.1}), "filters.0.gate_probability: must be <= 1, got 1.1"),
        (config(first={"initiation": {"m": 4, "n": 3}}), "filters.0.initiation.n: must be >= 4"),
        (config(first={"initiation": {"m": 1, "n": 3}}), "filters.0.initiation.m: must be >= 2"),
        (config(first={"association": "jpda"}), "filters.0.association"),
        (config(first={"degree": 2}), "filters.0.association: needs a filter of kind kalman and degree 1"),
        (config(first={"kind": "growing_memory"}), "filters.0.association: needs a filter of kind kalman and degree 1"),
        (
            config(first={"association": None, "speed_mps": 5}),
            "filters.0.speed_mps: belongs to association: nearest or pda",
        ),
        (
            config({"false_plots_per_km2": 1}, {"association": None}),
            "filters.0.association: is needed among false plots",
        ),
        (config(frame="cartesian"), "frame: must be polar for filters with an association"),
        (
            config(filters=[*config()["filters"], {"name": "b", "kind": "kalman"}]),
            "filters.1.association: is needed where another filter has one",
        ),
    ],
)
def test_refused(given, message):
    with pytest.raises(ConfigError) as error:
        load(given)
    assert any(message in line for line in error.value.lines), error.value.lines


def test_defaults_are_told_and_used():
    (one,) = load(config()).cases[0].spec.filters
    assert (one.rule.m, one.rule.n) == (3, 4)
    assert one.gate_probability == 0.99
    assert one.lost_beyond_sigmas == 10.0


def test_density_and_sector_are_no_part_of_the_world():
    """So cases that differ in them see the same plots of the target, and plain cases keep their noise."""
    one, other = (load(config({"false_plots_per_km2": d})).cases[0].spec for d in (0.0, 2.0))
    assert world(one) == world(other)
    assert "sector" not in world(one)["sensor"]


def test_gate_probability_can_be_swept_by_its_bare_key():
    cases = load(config(sweep={"gate_probability": [0.9, 0.99], "sensor.false_plots_per_km2": [0, 1]})).cases
    assert len(cases) == 4
    assert cases[0].spec.filters[0].gate_probability == 0.9
