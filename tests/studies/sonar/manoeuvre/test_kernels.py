"""Detector, adaptive filter and IMM against textbook twins, realisation by realisation on the same plots."""

import numpy as np
import pytest

from radarsim.api.configs import load
from radarsim.kernels.random import fill_normal_pairs, fill_uniform_pairs
from radarsim.studies.sonar import STUDY
from radarsim.studies.sonar.manoeuvre import detection_laws
from tests.studies.sonar.manoeuvre import naive as naive
from tests.studies.sonar.precision import assert_estimates_rounded, estimate_losses, losses
from tests.tolerances import assert_rounded

T, SCANS = 5.0, 30
SIGMA = np.array([10.0, np.radians(0.2)])
VESSEL = {"kind": "accelerating", "x_m": 6e3, "y_m": 500, "speed_mps": 5, "course_deg": 180}
TARGET = VESSEL | {"acceleration_mps2": 0.6, "start_s": 60, "end_s": 100}
FILTERS = [
    {"name": "growing", "kind": "growing_memory"},
    {"name": "raise", "kind": "adaptive", "detector": {"plots": 5, "threshold_k": 3.0}},
    {"name": "raise joint", "kind": "adaptive", "end_after": 2}
    | {"detector": {"plots": 6, "false_alarm_probability": 0.05, "coordinates": "joint"}},
    {"name": "shorten", "kind": "adaptive", "response": "shorten_memory", "detector": {"plots": 4, "threshold_k": 2.0}},
    {"name": "shorten 2", "kind": "adaptive", "degree": 2, "response": "shorten_memory", "end_after": 3}
    | {"detector": {"plots": 6, "threshold_k": 4.0, "test_every": 2}},
    {"name": "imm", "kind": "imm", "manoeuvre_variances": [0, 0.1], "stay_probabilities": [0.95, 0.9]},
    {
        "name": "imm 2",
        "kind": "imm",
        "degree": 2,
        "manoeuvre_variances": [1e-8, 1e-3],
        "stay_probabilities": [0.9, 0.8],
    },
]
DETECTORS = [
    {"name": "five", "plots": 5, "threshold_k": [1.0, 3.0]},
    {"name": "apart", "plots": 4, "false_alarm_probability": [0.1], "test_every": 4},
]


def config(**changes):
    made = {
        "study": "sonar",
        "sensor": {"sigma_range_m": 10.0, "sigma_bearing_deg": 0.2, "scan_period_s": T},
        "target": TARGET,
        "filters": FILTERS,
        "detectors": DETECTORS,
        "scans": SCANS,
        "realisations": 10,
    }
    for key, value in changes.items():
        made[key] = made[key] | value if isinstance(value, dict) else value
    return made


def plots(plan, realisation, probability):
    """Plots (K, 2) with not-a-number where missed, drawn from the same streams by the plainest code."""
    a, b, z = np.empty(1), np.empty(1), plan.world.truth[:, :2, 0].copy()
    for k in range(SCANS):
        fill_normal_pairs(plan.world.plots, realisation, k, a, b)
        z[k] += SIGMA * np.array([a[0], b[0]])
        fill_uniform_pairs(plan.detections.key, realisation, k, a, b)
        if k and a[0] >= probability:
            z[k] = np.nan
    return z


def statistics(z, plots, every=1):
    """Statistics (K, 3) of both coordinates and jointly, not-a-number where there is no test."""
    t, q = np.arange(SCANS) * T, np.full((SCANS, 3), np.nan)
    for k in range(plots - 1, SCANS, every):
        q[k, :2] = [naive.statistic(t, z[:, c], k, plots, SIGMA[c]) for c in range(2)]
        q[k, 2] = q[k, :2].sum()
    return q


def twin(spec, z, c):
    """Estimates, covariances, probability of a manoeuvre and plots in memory of one filter in coordinate c."""
    t, size = np.arange(SCANS) * T, spec.get("degree", 1) + 1
    if spec["kind"] == "imm":
        variances = np.array(spec["manoeuvre_variances"]) * (1.0, np.hypot(6e3, 500) ** -2)[c]
        return *naive.imm(t, z[:, c], size, SIGMA[c], variances, spec["stay_probabilities"]), None
    own = spec["detector"]
    joint = own.get("coordinates") == "joint"
    threshold = own.get("threshold_k") or -2 * np.log(own["false_alarm_probability"])  # of two coordinates jointly
    q = statistics(z, own["plots"], own.get("test_every", 1))[:, 2 if joint else c]
    raises = spec.get("response") != "shorten_memory"
    patience = spec.get("end_after", 1)
    return naive.adaptive(t, z[:, c], size, SIGMA[c], own["plots"], q, threshold, raises, patience)


@pytest.mark.parametrize("probability", [1.0, 0.7])
def test_filters_are_their_twins(probability):
    plan = STUDY.prepare(load(config(sensor={"detection_probability": probability})).cases[0])
    truth, switched = plan.world.truth, 0
    for realisation in (0, 7, 4321):
        sums = plan.layout.unpack(STUDY.simulate(plan, realisation, 1))
        z = plots(plan, realisation, probability)
        for (f, spec), c in ((pair, c) for pair in enumerate(FILTERS) for c in (0, 1)):
            if spec["kind"] == "growing_memory":
                continue
            size = spec.get("degree", 1) + 1
            x, P, mode, memory = twin(spec, z, c)
            known = np.cumsum(~np.isnan(z[:, c])) >= size
            x[~known], P[~known] = np.nan, np.nan
            error = sums["error"][f, :, 3 * c : 3 * c + size, 0]
            # What models differ by enters with their weights, which are exponentials of innovations of ten σ at most.
            factor = 10 if spec["kind"] == "imm" else 1
            wanted = x[:, :size] - truth[:, c, :size]
            assert_estimates_rounded(error, wanted, P, z[:, c], SIGMA[c], factor=factor)
            loss = factor * estimate_losses(P, z[:, c], SIGMA[c]) if spec["kind"] == "imm" else losses(P)
            variance, loss = np.diagonal(P, axis1=1, axis2=2)[known, :size], loss[known]
            believed = sums["believed"][f, known, 3 * c : 3 * c + size]
            assert_rounded(believed, variance, loss[:, None] * variance)
            assert_rounded(sums["modes"][f, known, c, 0], mode[known], loss)
            assert_rounded(sums["modes"][f, :, c, 1], sums["modes"][f, :, c, 0] ** 2)
            if memory is not None:
                assert (sums["modes"][f, :, c, 2] == memory).all()
                switched += int(np.abs(np.diff(mode)).sum())
    assert switched > 20


@pytest.mark.parametrize("probability", [1.0, 0.7])
def test_alarms_and_first_events_are_the_twins(probability):
    plan = STUDY.prepare(load(config(sensor={"detection_probability": probability})).cases[0])
    t = np.arange(SCANS) * T
    phase = np.digitize(t, [60, 100], right=True)
    for realisation in (3, 99):
        sums = plan.layout.unpack(STUDY.simulate(plan, realisation, 1))
        z = plots(plan, realisation, probability)
        for d, spec in enumerate(DETECTORS):
            q = statistics(z, spec["plots"], spec.get("test_every", 1)).T
            assert (sums["tested"][d] == ~np.isnan(q)).all()
            limits = (
                [spec["threshold_k"]] * 3 if "threshold_k" in spec else detection_laws.threshold(0.1, [[1], [1], [2]])
            )
            for g, i in np.ndindex(3, len(limits[0])):
                alarm = q[g] > limits[g][i]
                assert (sums["alarms"][d, g, i] == alarm).all()
                event = np.where(phase == 2, ~alarm & ~np.isnan(q[g]), alarm)
                first = [event[k] and not event[:k][phase[:k] == phase[k]].any() for k in range(SCANS)]
                assert (sums["first"][d, g, i] == first).all()
