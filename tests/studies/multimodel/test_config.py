"""Keys of the multimodel study: what is read, and what is refused with which words."""

import numpy as np
import pytest

from radarsim.api.configs import load
from radarsim.errors import ConfigError
from tests.tolerances import rounding

SENSOR = {"sigma_range_m": 2.5, "sigma_elevation_deg": 0.1, "sigma_azimuth_deg": 0.1, "scan_period_s": 0.05}
MODEL = {"motion": "uniform", "sigma_acceleration_mps2": 1}
KALMAN = {"name": "k", "family": "kalman", "models": [MODEL]}
FLIGHT = {
    "kind": "flight",
    "duration_s": 10,
    "position_m": [1e5, 1e4, 0],
    "velocity_mps": [-100, 0, 0],
    "phases": [{"start_s": 0}],
}


def config(**changes):
    base = {"study": "multimodel", "sensor": SENSOR, "target": FLIGHT, "filters": [KALMAN], "realisations": 10}
    return {**base, **changes}


def imm(transition, models=2, **changes):
    return {"name": "i", "family": "imm", "models": [MODEL] * models, "transition": transition, **changes}


def test_defaults_are_the_papers():
    spec = load(config()).cases[0].spec
    assert spec.sensor.sigma == pytest.approx((2.5, np.radians(0.1), np.radians(0.1)), rel=rounding(operations=2))
    (f,) = spec.filters
    assert (f.merge, f.output, f.transition, f.covariance_at) == ("combined", "best", ((1.0,),), "plot")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"filters": [imm([[0.9, 0.1], [0.2, 0.8]])]}, "its rows do: transpose it"),
        ({"filters": [imm([[0.9, 0.1], [0.2, 0.7]])]}, "columns must sum to one"),
        ({"filters": [imm([[0.9, 0.1]])]}, "2 rows of 2 probabilities"),
        ({"filters": [imm([[1.1, 0.0], [-0.1, 1.0]])]}, "transition"),
        ({"filters": [{**KALMAN, "models": [MODEL] * 2}]}, "kalman has one model"),
        ({"filters": [imm(np.full((6, 6), 1 / 6).tolist(), 6)]}, "models"),
        ({"filters": [{**KALMAN, "merge": "median"}]}, "merge"),
        ({"filters": [{**KALMAN, "models": [{**MODEL, "motion": "falling"}]}]}, "motion"),
        ({"filters": [{**KALMAN, "models": [{**MODEL, "sigma_acceleration_mps2": -1}]}]}, "sigma_acceleration_mps2"),
        ({"filters": [KALMAN, KALMAN]}, "names must differ"),
        ({"baseline": "other"}, "name of a filter"),
        ({"sensor": {**SENSOR, "sigma_x_m": 3}}, "or else sigma_x_m"),
        ({"sensor": {"scan_period_s": 1, "sigma_x_m": 3}}, "or else sigma_x_m"),
        ({"sensor": {**SENSOR, "jitter_s": 0.03}}, "under half the scan period"),
        ({"sensor": {**SENSOR, "detection_probability": 0}}, "detection_probability"),
        ({"sensor": {**SENSOR, "sigma_azimuth_deg": 6}}, "sigma_azimuth"),
        ({"scans": 3}, "scans"),
        ({"report_every": 0}, "report_every"),
        ({"target": {**FLIGHT, "phases": [{"start_s": 1}]}}, "must be 0"),
        ({"target": {**FLIGHT, "phases": [{"start_s": 0}, {"start_s": 0}]}}, "follow one another"),
        ({"target": {**FLIGHT, "velocity_mps": [0, 0, 0]}}, "must not be zero"),
        ({"target": {**FLIGHT, "stages": [{"name": "a"}, {"name": "b"}]}}, "end_s"),
        ({"target": {**FLIGHT, "stages": [{"name": "a", "end_s": 5}]}}, "end_s"),
        ({"target": {"kind": "recorded", "file": "none.csv"}}, "none.csv"),
    ],
)
def test_faults_are_told(changes, words):
    with pytest.raises(ConfigError) as caught:
        load(config(**changes))
    assert words in "\n".join(caught.value.lines)
