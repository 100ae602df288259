"""The sonar's keys: what is taken, what is refused and with which words."""

import math

import pytest

from radarsim.app.configs import load
from radarsim.errors import ConfigError


def config(**changes):
    """A correct config with values put at dotted keys; None takes a key away."""
    made = {
        "study": "sonar",
        "sensor": {"sigma_range_m": 30, "sigma_bearing_deg": 1, "scan_period_s": 5},
        "target": {"kind": "polynomial", "frame": "polar", "range_m": [9e3, -4], "bearing_deg": [20, 0.01]},
        "filters": [{"name": "growing", "kind": "growing_memory"}],
        "scans": 20,
        "realisations": 100,
    }
    for key, value in changes.items():
        *way, last = key.split("__")
        place = made
        for name in way:
            place = place[int(name)] if isinstance(place, list) else place[name]
        if value is None:
            del place[last]
        elif isinstance(place, list):
            place[int(last)] = value
        else:
            place[last] = value
    return made


def fault(**changes):
    with pytest.raises(ConfigError) as refused:
        load(config(**changes))
    return "\n".join(refused.value.lines)


def test_the_example_of_the_contract():
    filters = [
        {"name": "growing", "kind": "growing_memory", "degree": 1},
        {"name": "window 5", "kind": "window", "degree": 1, "plots": 5},
        {"name": "augmented", "kind": "kalman_augmented", "degree": 1, "error_correlation": 0.6},
        {"name": "differenced", "kind": "kalman_differenced", "degree": 1, "error_correlation": 0.6},
        {"name": "naive", "kind": "kalman", "degree": 1},
    ]
    spec = load(config(filters=filters, sensor__error_correlation=0.6, sensor__detection_probability=0.9)).cases[0].spec
    assert spec.sensor.sigma_bearing_rad == pytest.approx(math.radians(1))
    assert spec.target.bearing_rad == pytest.approx((math.radians(20), math.radians(0.01)))
    assert spec.frame == "polar"


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"sensor__sigma_range_m": 0}, "sensor.sigma_range_m: must be > 0, got 0"),
        ({"sensor__sigma_bearing_deg": 40}, "sensor.sigma_bearing_deg: must be <= "),
        ({"sensor__error_correlation": 1}, "sensor.error_correlation"),
        ({"sensor__detection_probability": 0}, "sensor.detection_probability: must be > 0, got 0"),
        ({"sensor__detection_probability": 1.5}, "sensor.detection_probability: must be <= 1, got 1.5"),
        ({"sensor__missed_scans": [1]}, "sensor.missed_scans.0: must be >= 2, got 1"),
        ({"sensor__sigma_depth_m": 5}, "target: needs depth_m, which the sonar measures"),
        ({"target__range_m": None}, "target.range_m: is needed by frame: polar"),
        ({"target__x_m": [1.0]}, "target.x_m: belongs to frame: cartesian, not polar, got [1]"),
        ({"target__range_m": [-5]}, "target.range_m: must begin with a positive range"),
        ({"scans": 2, "filters__0__degree": 2}, "scans: must be >= 3 for a filter of degree 2"),
        ({"filters__0__degree": 3}, "filters.0.degree"),
        ({"filters__0__kind": "window"}, "filters.0.plots: is needed by a window"),
        ({"filters__0__plots": 5}, "filters.0.plots: belongs to kind: window or fixed_gain, not growing_memory, got 5"),
        ({"filters__0__kind": "fixed_gain"}, "filters.0.manoeuvre_variance: must be > 0 for fixed_gain"),
        (
            {"filters__0__manoeuvre_variance": 1.0},
            "filters.0.manoeuvre_variance: belongs to kind: fixed_gain or kalman or kalman_augmented, not gro",
        ),
        ({"filters__0__error_correlation": 0.5}, "filters.0.error_correlation: belongs to kind: kalman_augmented or"),
        ({"frame": "cartesian", "filters__0__kind": "kalman_augmented"}, "filters.0.kind: kalman_augmented works only"),
        ({"frame": "cartesian", "target__fluctuation_mps2": 0.1}, "frame: must be polar for a fluctuating target"),
        ({"frame": "spherical"}, "frame"),
        ({"baseline": "nobody"}, "baseline: must be the name of a filter: growing"),
        (
            {"sensor__error_correlation": 0.5, "sensor__further": [{"scan_period_s": 3.0, "first_s": 0.0}]},
            "sensor.error_correlation: must be 0 where there are further sonars",
        ),
    ],
)
def test_faults_in_words(changes, words):
    assert words in fault(**changes)


def test_a_window_must_hold_its_degree():
    filters = [{"name": "w", "kind": "window", "degree": 2, "plots": 2}]
    assert "filters.0.plots: must be >= 3 for degree 2" in fault(filters=filters)


def test_turns_must_follow_one_another():
    turn = {"kind": "turning", "x_m": 7e3, "y_m": 5e3, "speed_mps": 8, "course_deg": 250}
    bad = [{"start_s": 10, "end_s": 60, "rate_radps": 0.02}, {"start_s": 50, "end_s": 70, "rate_radps": 0.02}]
    assert "target.turns: must follow one another without overlap" in fault(target=turn | {"turns": bad})
    assert "target.turns.0.end_s: must come after start_s" in fault(
        target=turn | {"turns": [{"start_s": 10, "end_s": 10, "rate_radps": 0.02}]}
    )


def test_correlation_by_coordinate():
    spec = load(config(sensor__error_correlation={"range": 0.6, "bearing": -0.2})).cases[0].spec
    assert spec.sensor.error_correlation.of(0) == 0.6
    assert spec.sensor.error_correlation.of(1) == -0.2


def test_a_scan_beyond_the_last_cannot_be_missed():
    with pytest.raises(ConfigError) as caught:
        load("sonar_smoothing", ["scans=10", "sensor.missed_scans=[3, 11]"])
    assert caught.value.lines == ("--set sensor.missed_scans: must be <= 10, the last scan, got [3, 11]",)
