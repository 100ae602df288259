"""Manoeuvres (P3): detectors and their exact laws, filters that respond to them, and what a track is used for.

Sums by D detectors, G groups (each coordinate, then all jointly), T thresholds and K scans: `tested`, `alarms`, `first`
as in kernels.detector.Alarms; `modes` (F, K, C, 3) and, at A moments, `uses` (F, A, U, 5): n, Σe, Σe², Σe⁴ and Σ of the
first-order variance.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.moments import Layout
from radarsim.studies.sonar import banks, filters
from radarsim.studies.sonar import study as base
from radarsim.studies.sonar import world as models
from radarsim.studies.sonar.banks import FilterSpec
from radarsim.studies.sonar.detectors import (
    AdaptiveRule,
    DetectorTests,
    ModelPair,
    detector_arrays,
    detector_tests,
)
from radarsim.studies.sonar.exact_values import exact_values
from radarsim.studies.sonar.kernels import detector as kernels
from radarsim.studies.sonar.kernels import patterns
from radarsim.studies.sonar.manoeuvre import exact
from radarsim.studies.sonar.manoeuvre import uses as tracks
from radarsim.studies.sonar.manoeuvre.axes import ManoeuvreAxes, UsesAxes
from radarsim.studies.sonar.manoeuvre.config import RESPONDING_KINDS
from radarsim.studies.sonar.scene import Scene, angular, courses, filter_specs, plots_of, scene


@dataclass(frozen=True)
class DetectorPlan:
    """Detector tests of a case, of which the first are measured, the same as kernel arrays, and scans (A,) of uses."""

    spec: Any
    seen: Scene
    tests: DetectorTests
    detectors: kernels.Detectors
    measured: int
    at: np.ndarray


@dataclass(frozen=True, kw_only=True)
class Plan(base.RealisationPlan):
    """A plan with detectors, filters that respond to manoeuvres, or uses of a track."""

    detector_plan: DetectorPlan

    def simulate(self, first: int, count: int) -> np.ndarray:
        """Sums of one block, in the order of the layout."""
        sums = self.added(first, count)
        return base.packed(self.layout, sums.errors, **added_up(self.detector_plan, sums))


def prepare(case: Case) -> Plan:
    """Design the filters and detectors of a case, and compute the exact values of their errors and alarms."""
    spec, seen = case.spec, scene(case.spec)
    specs = with_manoeuvre_response(spec, filter_specs(spec))
    size, (K, C) = max(one.size for one in specs), seen.sigma.shape
    detected, probability = base.detection_patterns(spec, seen)
    plan = detector_plan(spec, seen, specs)
    values = exact_values(seen, base.designs(specs, seen, detected), probability, size)
    return Plan(
        layout=Layout(**base.shapes(len(specs), K, C, size), **shapes(plan, len(specs))),
        axes=axes(plan, base.axes(spec, seen, specs, values, None), detected, probability),
        world=base.world(case, seen),
        bank=banks.per_realisation_bank(specs, seen.t, seen.period, seen.nominal, plan.tests),
        observation=base.observation(case, seen),
        detectors=plan.detectors,
        kept=plan.at,
        detector_plan=plan,
    )


def times_of(target) -> tuple[float, float] | None:
    """When a target begins to manoeuvre and ends, s; none where it does not, or at random."""
    if target.kind == "turning":
        turns = [turn for turn in target.turns if turn.rate_radps]
        return (turns[0].start_s, turns[-1].end_s) if turns else None
    if target.kind == "accelerating":
        end = math.inf if target.end_s is None else target.end_s
        return (target.start_s, end) if target.acceleration_mps2 else None
    keys = ("range_m", "bearing_rad") if target.frame == "polar" else ("x_m", "y_m")
    bent = any(any(getattr(target, key)[2:]) for key in keys)
    return (0.0, math.inf) if bent else None


def phases(target, t: np.ndarray) -> np.ndarray:
    """0 before the manoeuvre, 1 while it lasts, 2 after it, at every time (K,); what has just begun shows next time."""
    times = times_of(target)
    if times is None:
        return np.zeros(len(t), dtype=np.int64)
    return (t > times[0]).astype(np.int64) + (t > times[1])


# ---- from keys to rules and tests ---------------------------------------------------------------------------------
def with_manoeuvre_response(spec, specs: list[FilterSpec]) -> list[FilterSpec]:
    """The filters of a case; those that respond to manoeuvres have their rule or models."""
    found = []
    for filter_spec, one in zip(specs, spec.filters, strict=True):
        length = one.detector.plots if one.detector else filter_spec.length
        found.append(replace(filter_spec, response=_response(spec, one), length=length))
    return found


def _response(spec, one) -> AdaptiveRule | ModelPair | None:
    """What a configured filter does about manoeuvres."""
    scale = angular(spec, 2)
    if one.kind == "imm":
        return ModelPair(scale[:, None] * np.array(one.manoeuvre_variances), np.array(one.stay_probabilities))
    if one.kind != "adaptive":
        return None
    own, joint = one.detector, one.detector.coordinates == "joint"
    limit = own.threshold_k
    if limit is None:
        limit = float(exact.threshold(own.false_alarm_probability, len(scale) if joint else 1))
    raises = one.response != "shorten_memory"
    return AdaptiveRule(np.full(len(scale), limit), own.test_every, joint, raises, one.end_after or 1)


def thresholds_of(one, coordinates: int) -> np.ndarray:
    """Thresholds (G, T) of a configured detector."""
    freedom = np.append(np.ones(coordinates, dtype=int), coordinates)[:, None]
    if one.threshold_k is not None:
        return np.tile(np.array(one.threshold_k), (coordinates + 1, 1))
    return exact.threshold(np.array(one.false_alarm_probability), freedom)


def detector_plan(spec, seen: Scene, specs: list[FilterSpec]) -> DetectorPlan:
    """The detector tests of a case, those of its adaptive filters included."""
    C = seen.truth.shape[1]
    measured = [(one.plots, one.test_every) for one in spec.detectors]
    tests = detector_tests(
        measured, [thresholds_of(one, C) for one in spec.detectors], [(one.response, one.length) for one in specs]
    )
    at = np.zeros(0, dtype=np.int64)
    if spec.uses is not None:
        at = np.searchsorted(seen.t, np.array(spec.uses.at_s or [seen.t[-1]]) - 1e-9)
    return DetectorPlan(spec, seen, tests, detector_arrays(tests, phases(spec.target, seen.t), C), len(measured), at)


# ---- exact laws ---------------------------------------------------------------------------------------------------
def shift_laws(seen: Scene, c: int, detected: np.ndarray, plots: int, k: int) -> tuple[np.ndarray, ...]:
    """Mean of â, true and believed variance (M,) of a coordinate's parabola through the last plots at scan k."""
    own = plots_of(seen, c, detected)
    first, weights, believed = filters.window_weights(own, k, plots, 3)
    row, last = weights[:, 2], k + 1
    t, sigma = seen.t[first:last], seen.sigma[first:last, c]
    C = models.error_covariance(np.where(np.isfinite(sigma), sigma, 0.0), seen.rho[c], t, seen.period)
    steps = np.diff(t)
    after = np.maximum(t[:, None] - t[1:], 0.0)  # since the end of the interval; a push within it moves by dt²/2
    pushes = np.where(t[:, None] >= t[1:], steps**2 / 2 + steps * after, 0.0) * seen.walk[c]
    mean, variance = exact.acceleration_law(row, seen.truth[first:last, c, 0], C, pushes)
    return mean, variance, believed[:, 2, 2]


def exact_alarms(spec, seen: Scene, detected: np.ndarray, probability: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Probability (D, G, T, K) of an alarm at a test, and shift (D, G, K) of its mean; not-a-number where not known.

    Means over the patterns `detected` (M, K') of plots, of these probabilities, in which there is a test. In the
    cartesian frames weights go with the plots, and nothing is known.
    """
    K, C = len(seen.t), seen.truth.shape[1]
    most = max((len(one.wanted()) for one in spec.detectors), default=0)
    alarms, shifts = (
        np.full((len(spec.detectors), C + 1, most, K), np.nan),
        np.full((len(spec.detectors), C + 1, K), np.nan),
    )
    for d, one in enumerate(spec.detectors) if probability.size else ():
        limits = thresholds_of(one, C)
        for k in range(one.plots - 1, detected.shape[1], one.test_every):
            tested = (detected[:, k] > 0) & (detected[:, : k + 1].sum(axis=1) >= one.plots)
            share = probability[tested]
            if not share.sum() > 0:
                continue
            laws = np.array([shift_laws(seen, c, detected[tested], one.plots, k) for c in range(C)])
            mean, true, believed = laws[:, 0], laws[:, 1], laws[:, 2]
            ratio, shift = believed / true, mean / np.sqrt(true)
            weight = share / share.sum()
            for c in range(C):
                found = exact.detection(limits[c][:, None] * ratio[c], shift[c])
                alarms[d, c, : limits.shape[1], k], shifts[d, c, k] = found @ weight, np.abs(shift[c]) @ weight
            together = np.sqrt((shift**2).sum(axis=0))
            shifts[d, C, k] = together @ weight
            if np.allclose(ratio, ratio[0], rtol=1e-9):
                found = exact.detection(limits[C][:, None] * ratio[0], together, C)
                alarms[d, C, : limits.shape[1], k] = found @ weight
    return alarms, shifts


def independent(one, seen: Scene) -> bool:
    """Whether a detector's tests are independent of one another: windows apart, errors white, no random motion."""
    return one.test_every >= one.plots and (seen.certain > 0).all() and not seen.rho.any() and not seen.walk.any()


def axes(
    plan: DetectorPlan, common: base.GivenPlotsAxes, detected: np.ndarray, probability: np.ndarray
) -> ManoeuvreAxes:
    """Labels of a case, and its exact laws over patterns detected (M, K') of plots with these probabilities (M,)."""
    spec, seen = plan.spec, plan.seen
    alarms, shifts = exact_alarms(spec, seen, detected, probability)
    return ManoeuvreAxes(
        **vars(common),
        exact_alarms=alarms,
        shifts=shifts,
        thresholds=plan.tests.thresholds,
        independent=tuple(independent(one, seen) for one in spec.detectors),
        phase=plan.detectors.phase,
        manoeuvre_s=times_of(spec.target),
        uses=_uses_axes(spec, seen, plan.at) if spec.uses else None,
    )


def _uses_axes(spec, seen: Scene, at: np.ndarray) -> UsesAxes:
    apart = tracks.flat(seen.truth[at, :2, :2], spec.frame == "polar") - own_ship(spec, seen.t[at])
    return UsesAxes(at=at, true=true_uses(spec, seen, at), closing_mps=np.hypot(apart[:, 2], apart[:, 3]))


# ---- uses ---------------------------------------------------------------------------------------------------------
def own_ship(spec, t: np.ndarray) -> np.ndarray:
    """The own ship's x, y and rates (n, 4) at times t."""
    own = spec.uses.own_ship
    rate = own.speed_mps * np.array([math.cos(own.course_rad), math.sin(own.course_rad)])
    return np.concatenate([np.array([own.x_m, own.y_m]) + t[:, None] * rate, np.tile(rate, (len(t), 1))], axis=1)


def true_uses(spec, seen: Scene, at: np.ndarray) -> np.ndarray:
    """True values (A, 6): the closest approach if both kept course and speed, the position where the target will be."""
    t, horizon = seen.t[at], spec.uses.horizon_s
    now = tracks.flat(seen.truth[at, :2, :2], spec.frame == "polar")
    found = tracks.uses(now, own_ship(spec, t), horizon)
    _, later = courses(spec.target, t + horizon, None)
    found[:, 2:4] = later[:, :2, 0]
    return found


def uses_of(spec, t: np.ndarray, x: np.ndarray, P: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Uses of tracks and their first-order σ (F, n, 6), not-a-number where a state is not complete.

    t (n,) from the first plot; x (F, n, C, 3), P (F, n, C, 3, 3) and known (F, n, C, 3), of which the first two
    coordinates count.
    """
    state, polar, own = x[:, :, :2, :2], spec.frame == "polar", own_ship(spec, t)
    spread = np.stack([P[:, :, :2, 0, 0], P[:, :, :2, 0, 1], P[:, :, :2, 1, 1]], axis=-1)
    ready = known[:, :, :2, :2].all(axis=(2, 3))[..., None]
    found = tracks.uses(tracks.flat(state, polar), own, spec.uses.horizon_s)
    variance = tracks.variances(state, spread, polar, own, spec.uses.horizon_s)
    return np.where(ready, found, np.nan), np.where(ready, np.sqrt(variance), np.nan)


def use_sums(spec, seen: Scene, at: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """Sums (F, A, 6, 5) from estimates kept (A, F, 2, 6, count), over those whose state is complete."""
    polar, own = spec.frame == "polar", own_ship(spec, seen.t[at])
    true = true_uses(spec, seen, at)
    A, F = kept.shape[:2]
    sums = np.zeros((F, A, len(tracks.QUANTITIES), 5))
    for a, f in np.ndindex(A, F):
        ready = (kept[a, f, :, 5] > 0).all(axis=0)
        one = np.moveaxis(kept[a, f][:, :, ready], -1, 0)
        found = tracks.uses(tracks.flat(one[..., :2], polar), own[a], spec.uses.horizon_s)
        e = tracks.errors(found, true[a])
        spread = tracks.variances(one[..., :2], one[..., 2:5], polar, own[a], spec.uses.horizon_s)
        parts = [np.ones_like(e), e, e**2, e**4, spread]
        sums[f, a] = np.stack([part.sum(axis=0) for part in parts], axis=-1)
    return sums


# ---- sums ---------------------------------------------------------------------------------------------------------
def shapes(plan: DetectorPlan, F: int) -> dict[str, tuple[int, ...]]:
    """Shapes of the sums that a case has beside the common ones."""
    D, G, T = plan.detectors.threshold.shape
    K, D = len(plan.seen.t), plan.measured
    found = {"tested": (D, G, K), "alarms": (D, G, T, K), "first": (D, G, T, K)} if D else {}
    if any(one.kind in RESPONDING_KINDS for one in plan.spec.filters):
        found["modes"] = (F, K, G - 1, 3)
    if plan.spec.uses:
        found["uses"] = (F, len(plan.at), len(tracks.QUANTITIES), 5)
    return found


def added_up(plan: DetectorPlan, sums: patterns.BlockSums) -> dict[str, np.ndarray]:
    """The sums of a block, as `shapes` names them."""
    D = plan.measured
    found = {name: values[:D] for name, values in sums.alarms._asdict().items()} | {"modes": sums.modes}
    if plan.spec.uses:
        found["uses"] = use_sums(plan.spec, plan.seen, plan.at, sums.kept)
    return {name: found[name] for name in shapes(plan, len(sums.modes))}
