"""Manoeuvres (P3): detectors and their exact laws, filters that respond to them, and uses of a track.

Sums for D detectors, G groups (each coordinate, then all jointly), T thresholds and K scans: `tested`, `alarms`,
`first` as in kernels.detector.Alarms; `modes` (F, K, C, 3) as in kernels.patterns.BlockSums; and for A times `uses`
(F, A, U, 5): n, Σe, Σe², Σe⁴ and Σ of the first-order variance."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Layout
from radarsim.studies.sonar import filters, study
from radarsim.studies.sonar.config import RESPONDING_KINDS, Accelerating, Detector, Filter, Keys, Target, Turning, Uses
from radarsim.studies.sonar.filters import AdaptiveRule, DetectorTest, FilterSpec, ModelPair, detector_arrays
from radarsim.studies.sonar.kernels.detector import Detectors
from radarsim.studies.sonar.manoeuvre import exact
from radarsim.studies.sonar.manoeuvre.exact import ManoeuvreAxes, UsesAxes
from radarsim.studies.sonar.scene import Scene, build_scene, courses, filter_specs, lateral_scale
from radarsim.studies.sonar.world import error_covariance


@dataclass(frozen=True, kw_only=True)
class Plan(study.RealisationPlan):
    """A plan of a case with detectors, filters that respond to manoeuvres, or uses of a track."""

    axes: ManoeuvreAxes
    spec: Keys
    scene: Scene

    def simulate(self, first: int, count: int) -> np.ndarray:
        """The sums of one block, in the order of the layout."""
        sums = self.block_sums(first, count)
        detector_count = len(self.spec.detectors)
        part_sums = {name: values[:detector_count] for name, values in sums.alarms._asdict().items()} | {
            "modes": sums.modes
        }
        if self.spec.uses and self.axes.uses:
            part_sums["uses"] = use_sums(
                self.spec.uses, self.spec.frame, self.axes.uses, self.scene.t[self.kept], sums.kept_estimates
            )
        return study.packed(self.layout, sums.errors, **part_sums)


def prepare(case: Case) -> Plan:
    """Design the filters and detectors of a case, and compute the exact values of their errors and alarms."""
    spec, scene = case.spec, build_scene(case)
    specs = responding_filters(spec, filter_specs(spec))
    detectors = all_detectors(spec, scene, specs)
    plan = study.realisation_plan(case, scene, specs, detectors)
    use_scans = np.zeros(0, dtype=np.int64)
    if spec.uses:
        use_scans = np.searchsorted(scene.t, np.array(spec.uses.at_s or [scene.t[-1]]) - 1e-9)
    more = shapes(spec, detectors, len(scene.t), len(use_scans))
    fields = vars(plan) | {"kept": use_scans, "layout": Layout(**plan.layout.shapes, **more)}
    return Plan(**fields | {"axes": axes(spec, scene, plan.axes, detectors.phase, use_scans)}, spec=spec, scene=scene)


def manoeuvre_times(target: Target) -> tuple[float, float] | None:
    """Start and end of a target's manoeuvre, s; None if it does not manoeuvre, or moves at random."""
    if isinstance(target, Turning):
        turns = [turn for turn in target.turns if turn.rate_radps]
        return (turns[0].start_s, turns[-1].end_s) if turns else None
    if isinstance(target, Accelerating):
        end = math.inf if target.end_s is None else target.end_s
        return (target.start_s, end) if target.acceleration_mps2 else None
    derivatives = (target.range_m, target.bearing_rad) if target.frame == "polar" else (target.x_m, target.y_m)
    curved = any(any(coefficients[2:]) for coefficients in derivatives if coefficients)
    return (0.0, math.inf) if curved else None


def phases(target: Target, t: np.ndarray) -> np.ndarray:
    """0 before the manoeuvre, 1 during it, 2 after it, at every time (K,); its effects show one scan later."""
    times = manoeuvre_times(target)
    if times is None:
        return np.zeros(len(t), dtype=np.int64)
    return (t > times[0]).astype(np.int64) + (t > times[1])


# ---- from keys to rules and tests ---------------------------------------------------------------------------------
def responding_filters(spec: Keys, specs: Sequence[FilterSpec]) -> list[FilterSpec]:
    """The filters of a case; those that respond to manoeuvres get their rule or their models."""
    scale = lateral_scale(spec, 2)
    return [
        replace(
            filter_spec,
            response=_filter_response(member, scale),
            length=member.detector.plots if member.detector else filter_spec.length,
        )
        for filter_spec, member in zip(specs, spec.filters, strict=True)
    ]


def _filter_response(member: Filter, scale: np.ndarray) -> AdaptiveRule | ModelPair | None:
    """The response of a configured filter to manoeuvres; scale (C,) converts (m/s²)² to each coordinate's units."""
    if member.manoeuvre_variances and member.stay_probabilities:
        return ModelPair(scale[:, None] * np.array(member.manoeuvre_variances), np.array(member.stay_probabilities))
    detector = member.detector
    if detector is None:
        return None
    joint, limit = detector.coordinates == "joint", detector.threshold_k
    if detector.false_alarm_probability is not None:
        limit = float(exact.threshold(detector.false_alarm_probability, len(scale) if joint else 1))
    raises = member.response != "shorten_memory"
    return AdaptiveRule(np.full(len(scale), limit), detector.test_every, joint, raises, member.end_after or 1)


def thresholds(detector: Detector, coordinates: int) -> np.ndarray:
    """Thresholds (G, T) of a configured detector."""
    if detector.threshold_k is not None:
        return np.tile(np.array(detector.threshold_k), (coordinates + 1, 1))
    freedom = np.append(np.ones(coordinates, dtype=int), coordinates)[:, None]
    return exact.threshold(np.array(detector.false_alarm_probability), freedom)


def all_detectors(spec: Keys, scene: Scene, specs: Sequence[FilterSpec]) -> Detectors:
    """The measured detectors of a case, then those of its adaptive filters."""
    C = len(scene.nominal)
    measured = [
        DetectorTest(detector.plots, detector.test_every, thresholds(detector, C)) for detector in spec.detectors
    ]
    return detector_arrays(measured, filters.needed_tests(specs), phases(spec.target, scene.t), C)


# ---- exact laws ---------------------------------------------------------------------------------------------------
def shift_laws(scene: Scene, c: int, detected: np.ndarray, plots: int, k: int) -> tuple[np.ndarray, ...]:
    """Mean, true and believed variance (M,) of the acceleration â of a parabola through the last plots at scan k."""
    first, weights, believed = filters.window_weights(scene.plots(c, detected), k, plots, 3)
    t, sigma = scene.t[first : k + 1], scene.sigma[first : k + 1, c]
    C = error_covariance(np.where(np.isfinite(sigma), sigma, 0.0), scene.rho[c], t, scene.period)
    steps = np.diff(t)
    after = np.maximum(t[:, None] - t[1:], 0.0)  # since the end of the interval; a push within it moves by dt²/2
    pushes = np.where(t[:, None] >= t[1:], steps**2 / 2 + steps * after, 0.0) * scene.walk[c]
    mean, variance = exact.acceleration_law(weights[:, 2], scene.truth[first : k + 1, c, 0], C, pushes)
    return mean, variance, believed[:, 2, 2]


def exact_alarms(spec: Keys, scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Probability (D, G, T, K) of an alarm at a test, and shift (D, G, K) of its mean; NaN where not known.

    Both are means over the patterns of plots in which there is a test. In the cartesian frames weights depend on the
    plots, and no law is known."""
    K, C = scene.truth.shape[:2]
    max_thresholds = max((len(detector.levels()) for detector in spec.detectors), default=0)
    alarms = np.full((len(spec.detectors), C + 1, max_thresholds, K), np.nan)
    shifts = np.full((len(spec.detectors), C + 1, K), np.nan)
    if spec.frame != "polar":
        return alarms, shifts
    detected, probability = scene.patterns()
    for d, detector in enumerate(spec.detectors):
        limits = thresholds(detector, C)
        for k in range(detector.plots - 1, detected.shape[1], detector.test_every):
            tested = (detected[:, k] > 0) & (detected[:, : k + 1].sum(axis=1) >= detector.plots)
            share = probability[tested]
            if share.sum() > 0:
                laws = [shift_laws(scene, c, detected[tested], detector.plots, k) for c in range(C)]
                law = _alarm_law(np.array(laws), limits, share / share.sum())
                alarms[d, :, : limits.shape[1], k], shifts[d, :, k] = law
    return alarms, shifts


def _alarm_law(laws: np.ndarray, limits: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Probability (G, T) of an alarm and shift (G,), means with weight (M,) over laws (C, 3, M) as in `shift_laws`."""
    C = len(laws)
    mean, true, believed = laws[:, 0], laws[:, 1], laws[:, 2]
    ratio, shift = believed / true, mean / np.sqrt(true)
    alarms, shifts = np.full(limits.shape, np.nan), np.empty(C + 1)
    for c in range(C):
        alarms[c] = exact.detection(limits[c][:, None] * ratio[c], shift[c]) @ weight
        shifts[c] = np.abs(shift[c]) @ weight
    joint_shift = np.sqrt((shift**2).sum(axis=0))
    shifts[C] = joint_shift @ weight
    if np.allclose(ratio, ratio[0], rtol=1e-9):
        alarms[C] = exact.detection(limits[C][:, None] * ratio[0], joint_shift, C) @ weight
    return alarms, shifts


def independent(detector: Detector, scene: Scene) -> bool:
    """Whether the tests of a detector are independent: windows do not overlap, errors are white, no random motion."""
    are_apart, certain = detector.test_every >= detector.plots, (scene.certain > 0).all()
    return bool(are_apart and certain and not scene.rho.any() and not scene.walk.any())


def axes(
    spec: Keys, scene: Scene, common: study.GivenPlotsAxes, phase: np.ndarray, use_scans: np.ndarray
) -> ManoeuvreAxes:
    """Labels of a case and its exact laws; phase (K,) of the manoeuvre, use_scans (A,)."""
    alarms, shifts = exact_alarms(spec, scene)
    return ManoeuvreAxes(
        **vars(common),
        exact_alarms=alarms,
        shifts=shifts,
        thresholds=tuple(thresholds(detector, len(scene.nominal)) for detector in spec.detectors),
        independent=tuple(independent(detector, scene) for detector in spec.detectors),
        phase=phase,
        manoeuvre_s=manoeuvre_times(spec.target),
        uses=uses_axes(spec.uses, spec, scene, use_scans) if spec.uses else None,
    )


# ---- uses ---------------------------------------------------------------------------------------------------------
def own_ship(uses: Uses, t: np.ndarray) -> np.ndarray:
    """The own ship's x, y and rates (n, 4) at times t."""
    ship = uses.own_ship
    rate = ship.speed_mps * np.array([math.cos(ship.course_rad), math.sin(ship.course_rad)])
    return np.concatenate([np.array([ship.x_m, ship.y_m]) + t[:, None] * rate, np.tile(rate, (len(t), 1))], axis=1)


def uses_axes(uses: Uses, spec: Keys, scene: Scene, use_scans: np.ndarray) -> UsesAxes:
    """True values at use_scans (A,): the closest approach at constant courses, the target's future position."""
    t = scene.t[use_scans]
    track, ship_states = exact.cartesian_track(scene.truth[use_scans, :2, :2], spec.frame == "polar"), own_ship(uses, t)
    true = exact.uses(track, ship_states, uses.horizon_s)
    _, later = courses(spec.target, t + uses.horizon_s, None)
    true[:, 2:4] = later[:, :2, 0]
    relative = track - ship_states
    return UsesAxes(scans=use_scans, true=true, closing_mps=np.hypot(relative[:, 2], relative[:, 3]))


def estimated_uses(
    uses: Uses, frame: str, t: np.ndarray, x: np.ndarray, P: np.ndarray, is_known: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Uses of tracks and their first-order σ (F, n, 6), NaN where a state is not complete.

    t (n,) from the first plot; x (F, n, C, 3), P (F, n, C, 3, 3) and is_known (F, n, C, 3), of which the first two
    coordinates are used."""
    state, polar, ship_states = x[:, :, :2, :2], frame == "polar", own_ship(uses, t)
    spread = np.stack([P[:, :, :2, 0, 0], P[:, :, :2, 0, 1], P[:, :, :2, 1, 1]], axis=-1)
    complete = np.all(is_known[:, :, :2, :2], axis=(2, 3), keepdims=True)[..., 0]
    values = exact.uses(exact.cartesian_track(state, polar), ship_states, uses.horizon_s)
    variance = exact.variances(state, spread, polar, ship_states, uses.horizon_s)
    return np.where(complete, values, np.nan), np.where(complete, np.sqrt(variance), np.nan)


def use_sums(uses: Uses, frame: str, labels: UsesAxes, t: np.ndarray, estimates_of_scans: np.ndarray) -> np.ndarray:
    """Sums (F, A, 6, 5) over the complete states of estimates_of_scans (A, F, 2, 6, count) at times t (A,)."""
    polar, ship_states = frame == "polar", own_ship(uses, t)
    A, F = estimates_of_scans.shape[:2]
    sums = np.zeros((F, A, len(exact.QUANTITIES), 5))
    for a, f in np.ndindex(A, F):
        complete = (estimates_of_scans[a, f, :, 5] > 0).all(axis=0)
        estimates = np.moveaxis(estimates_of_scans[a, f][:, :, complete], -1, 0)
        values = exact.uses(exact.cartesian_track(estimates[..., :2], polar), ship_states[a], uses.horizon_s)
        e = exact.errors(values, labels.true[a])
        spread = exact.variances(estimates[..., :2], estimates[..., 2:5], polar, ship_states[a], uses.horizon_s)
        sums[f, a] = np.stack([part.sum(axis=0) for part in (np.ones_like(e), e, e**2, e**4, spread)], axis=-1)
    return sums


# ---- sums ---------------------------------------------------------------------------------------------------------
def shapes(spec: Keys, detectors: Detectors, K: int, A: int) -> dict[str, tuple[int, ...]]:
    """Shapes of the sums that a case has in addition to the common ones."""
    G, T = detectors.threshold.shape[1:]
    D, F = len(spec.detectors), len(spec.filters)
    sums: dict[str, tuple[int, ...]] = {}
    if D:
        sums |= {"tested": (D, G, K), "alarms": (D, G, T, K), "first": (D, G, T, K)}
    if any(member.kind in RESPONDING_KINDS for member in spec.filters):
        sums["modes"] = (F, K, G - 1, 3)
    if spec.uses:
        sums["uses"] = (F, A, len(exact.QUANTITIES), 5)
    return sums
