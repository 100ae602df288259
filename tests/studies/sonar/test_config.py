"""The sonar's keys: what is taken, what is refused and with which words."""

import math

import pytest

from radarsim.api.configs import load
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


ADAPTIVE = {"name": "a", "kind": "adaptive", "detector": {"plots": 5, "threshold_k": 4.0}}
IMM = {"name": "i", "kind": "imm", "manoeuvre_variances": [0, 0.1], "stay_probabilities": [0.9, 0.9]}
DETECTOR = {"name": "d", "plots": 5, "threshold_k": [1.0]}
VESSEL = {"kind": "accelerating", "x_m": 9e3, "y_m": 0, "speed_mps": 5, "course_deg": 180, "acceleration_mps2": 0.2}
VESSEL |= {"start_s": 40, "end_s": 60}
SECTOR = {"range_m": [2e3, 15e3], "bearing_deg": [-40, 80]}
NEAREST = {"name": "a", "kind": "kalman", "association": "nearest"}
AMONG = {"sensor__sector": SECTOR, "filters": [NEAREST]}


def among(first=(), **changes):
    """Changes that make a config one of a tracker among false plots, and keys of its filter."""
    return AMONG | {"filters": [NEAREST | dict(first)]} | changes


def without(one, key):
    return {name: value for name, value in one.items() if name != key}


def test_the_example_of_the_contract():
    filters = [
        {"name": "growing", "kind": "growing_memory", "degree": 1},
        {"name": "window 5", "kind": "window", "degree": 1, "plots": 5},
        {"name": "augmented", "kind": "kalman_augmented", "degree": 1, "error_correlation": 0.6},
        {"name": "differenced", "kind": "kalman_differenced", "degree": 1, "error_correlation": 0.6},
        {"name": "naive", "kind": "kalman", "degree": 1},
    ]
    spec = load(config(filters=filters, sensor__error_correlation=0.6, sensor__detection_probability=0.9)).cases[0].spec
    assert spec.sensor.sigma_bearing_rad == math.radians(1)
    assert spec.target.bearing_rad == (math.radians(20), math.radians(0.01))
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
        (
            {"filters": [{"name": "w", "kind": "window", "degree": 2, "plots": 2}]},
            "filters.0.plots: must be >= 3 for degree 2",
        ),
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
        ({"filters": [without(ADAPTIVE, "detector")]}, "filters.0.detector: is needed by kind: adaptive"),
        ({"filters": [ADAPTIVE | {"degree": 2}]}, "filters.0.degree: must be 1 where a manoeuvre raises the degree"),
        ({"filters": [IMM | {"end_after": 2}]}, "filters.0.end_after: belongs to kind: adaptive, not imm"),
        ({"filters": [without(IMM, "stay_probabilities")]}, "filters.0.stay_probabilities: is needed by kind: imm"),
        ({"filters": [IMM | {"manoeuvre_variances": [1, 0]}]}, "filters.0.manoeuvre_variances: must rise"),
        ({"filters": [ADAPTIVE | {"manoeuvre_variances": [0, 1]}]}, "filters.0.manoeuvre_variances: belongs to kind"),
        ({"filters": [ADAPTIVE | {"manoeuvre_variance": 1.0}]}, "manoeuvre_variance: belongs to kind: fixed_gain"),
        (
            {"filters": [ADAPTIVE | {"detector": {"plots": 5}}]},
            "filters.0.detector.threshold_k: give either threshold_k or false_alarm_probability",
        ),
        (
            {"filters": [ADAPTIVE | {"detector": {"plots": 21, "threshold_k": 1.0}}]},
            "filters.0.detector.plots: must be <= 20, the number of scans",
        ),
        ({"detectors": [DETECTOR | {"plots": 2}]}, "detectors.0.plots: must be >= 3, got 2"),
        ({"detectors": [DETECTOR | {"plots": 30}]}, "detectors.0.plots: must be <= 20, the number of scans, got 30"),
        ({"detectors": [DETECTOR | {"threshold_k": [0]}]}, "detectors.0.threshold_k.0: must be > 0, got 0"),
        ({"detectors": [without(DETECTOR, "threshold_k") | {"false_alarm_probability": [1.0]}]}, "must be < 1, got 1"),
        ({"detectors": [DETECTOR | {"false_alarm_probability": [0.1]}]}, "give either threshold_k or false_alarm"),
        ({"detectors": [DETECTOR, DETECTOR]}, "detectors: names must differ: d is there twice"),
        ({"detectors": [DETECTOR | {"threshold_k": [1.0, 2.0, 3.0]}], "scans": 1e5}, "at most 2 thresholds"),
        ({"uses": {"horizon_s": 60, "at_s": [96.0]}}, "uses.at_s: must be <= 95, the time of the last scan"),
        ({"uses": {"horizon_s": 0}}, "uses.horizon_s: must be > 0, got 0"),
        (
            {"uses": {"horizon_s": 9}, "target__fluctuation_mps2": 0.1},
            "uses: needs a target that does not move at random",
        ),
        (
            {"detectors": [DETECTOR], "sensor__further": [{"scan_period_s": 3.0, "first_s": 0.0}]},
            "detectors: does not go with further sonars",
        ),
        ({"target": VESSEL | {"end_s": 30}}, "target.end_s: must come after start_s"),
        ({"filters": [NEAREST]}, "sensor.sector: is needed by filters with an association"),
        (among(sensor__sector=SECTOR | {"range_m": [5, 5]}), "sensor.sector.range_m: must be a smaller and a larger"),
        (among(sensor__sector=SECTOR | {"bearing_deg": [0, 361]}), "sensor.sector.bearing_deg: must be a smaller"),
        (among(sensor__false_plots_per_km2=-1), "sensor.false_plots_per_km2: must be >= 0, got -1"),
        (among(sensor__false_plots_per_km2=1e5), "sensor.false_plots_per_km2: must be <= 10000"),
        (
            among(sensor__false_plots_per_km2=1e4, sensor__sector=SECTOR | {"range_m": [0, 1e5]}),
            "sensor.false_plots_per_km2: must give at most 1e+07 false plots a scan in the sector",
        ),
        (among(sensor__error_correlation=0.5), "sensor.error_correlation: must be 0 for filters with an association"),
        (among(sensor__sigma_elevation_rad=0.01), "sensor.sigma_elevation_rad: must not be given for filters with an"),
        (among(sensor__further=[{"scan_period_s": 3, "first_s": 1}]), "sensor.further: must be empty"),
        (among({"gate_probability": 0}), "filters.0.gate_probability: must be > 0, got 0"),
        (among({"gate_probability": 1.1}), "filters.0.gate_probability: must be <= 1, got 1.1"),
        (among({"initiation": {"m": 4, "n": 3}}), "filters.0.initiation.n: must be >= 4"),
        (among({"initiation": {"m": 1, "n": 3}}), "filters.0.initiation.m: must be >= 2"),
        (among({"association": "jpda"}), "filters.0.association"),
        (among({"degree": 2}), "filters.0.association: needs a filter of kind kalman and degree 1"),
        (among({"kind": "growing_memory"}), "filters.0.association: needs a filter of kind kalman and degree 1"),
        ({"filters__0__speed_mps": 5}, "filters.0.speed_mps: belongs to association: nearest or pda"),
        ({"sensor__false_plots_per_km2": 1}, "filters.0.association: is needed among false plots"),
        (among(frame="cartesian"), "frame: must be polar for filters with an association"),
        (
            among(filters=[NEAREST, {"name": "b", "kind": "kalman"}]),
            "filters.1.association: is needed where another filter has one",
        ),
        (among(detectors=[DETECTOR]), "detectors: does not go with filters that have an association"),
    ],
)
def test_faults_in_words(changes, words):
    assert words in fault(**changes)


def test_turns_must_follow_one_another():
    turn = {"kind": "turning", "x_m": 7e3, "y_m": 5e3, "speed_mps": 8, "course_deg": 250}
    bad = [{"start_s": 10, "end_s": 60, "rate_radps": 0.02}, {"start_s": 50, "end_s": 70, "rate_radps": 0.02}]
    assert "target.turns: must follow one another without overlap" in fault(target=turn | {"turns": bad})
    assert "target.turns.0.end_s: must come after start_s" in fault(
        target=turn | {"turns": [{"start_s": 10, "end_s": 10, "rate_radps": 0.02}]}
    )


def test_correlation_by_coordinate():
    spec = load(config(sensor__error_correlation={"range": 0.6, "bearing": -0.2})).cases[0].spec
    assert spec.sensor.error_correlation.coordinate(0) == 0.6
    assert spec.sensor.error_correlation.coordinate(1) == -0.2


def test_a_scan_beyond_the_last_cannot_be_missed():
    with pytest.raises(ConfigError) as caught:
        load("sonar_smoothing", ["scans=10", "sensor.missed_scans=[3, 11]"])
    assert caught.value.lines == ("overrides['sensor.missed_scans']: must be <= 10, the last scan, got [3, 11]",)


def test_what_is_taken():
    made = config(target=VESSEL, filters=[ADAPTIVE, IMM], detectors=[DETECTOR], uses={"horizon_s": 60.0})
    spec = load(made).cases[0].spec
    assert spec.parts == ("smoothing", "manoeuvre")
    assert spec.detectors[0].levels() == (1.0,)
    assert spec.target.course_rad == math.radians(180)
    assert spec.target.initial_range_m == 9e3
    assert load(config()).cases[0].spec.parts == ("smoothing",)


def test_defaults_are_told_and_used():
    (one,) = load(config(**AMONG)).cases[0].spec.filters
    assert (one.rule.m, one.rule.n) == (3, 4)
    assert one.gate_probability == 0.99
    assert one.lost_beyond_sigmas == 10.0
