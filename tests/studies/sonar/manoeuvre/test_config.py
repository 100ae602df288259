"""Keys about manoeuvres: what is taken, what is refused and with which words."""

import numpy as np
import pytest

from radarsim.app.configs import load
from radarsim.errors import ConfigError
from tests.studies.sonar.test_config import config

ADAPTIVE = {"name": "a", "kind": "adaptive", "detector": {"plots": 5, "threshold_k": 4.0}}
IMM = {"name": "i", "kind": "imm", "manoeuvre_variances": [0, 0.1], "stay_probabilities": [0.9, 0.9]}
DETECTOR = {"name": "d", "plots": 5, "threshold_k": [1.0]}
VESSEL = {"kind": "accelerating", "x_m": 9e3, "y_m": 0, "speed_mps": 5, "course_deg": 180, "acceleration_mps2": 0.2}
VESSEL |= {"start_s": 40, "end_s": 60}


def without(one, key):
    return {name: value for name, value in one.items() if name != key}


@pytest.mark.parametrize(
    ("changes", "words"),
    [
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
    ],
)
def test_faults_in_words(changes, words):
    with pytest.raises(ConfigError) as refused:
        load(config(**changes))
    assert words in "\n".join(refused.value.lines)


def test_what_is_taken():
    made = config(target=VESSEL, filters=[ADAPTIVE, IMM], detectors=[DETECTOR], uses={"horizon_s": 60.0})
    spec = load(made).cases[0].spec
    assert spec.parts == ("smoothing", "manoeuvre")
    assert spec.detectors[0].levels() == (1.0,)
    assert spec.target.course_rad == pytest.approx(np.pi)
    assert spec.target.initial_range_m == 9e3
    assert load(config()).cases[0].spec.parts == ("smoothing",)


def test_a_threshold_can_be_swept():
    made = config(filters=[ADAPTIVE]) | {"sweep": {"filters.0.detector.plots": [4, 6]}}
    assert [case.spec.filters[0].detector.plots for case in load(made).cases] == [4, 6]
