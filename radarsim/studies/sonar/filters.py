"""Manoeuvre detectors as arrays for the kernels, and how filters respond to manoeuvres.

Filters of P3 for one coordinate: the weights that each gives to plots at known times, computed once.

All recursive filters have one form. The innovation corrects the state (value, rate, acceleration) and, in filters that
model correlated errors, the carried error e of the last plot:

    innovation = z - (F x)₀ - c e        x⁺ = F x + g innovation        e⁺ = c e + g₃ innovation

A design is therefore its gains (M, K, 4), for M patterns of missed plots at once; a missed plot has gain zero.
Internally times are in periods T₀ and weights relative to the nominal plot, as in the paper; gains and covariances are
returned in m, s (or rad, s).

Sonar filters as arrays for the kernels: the specification of a filter, its design, and banks of filters."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from radarsim.kernels.algebra import pack, unpack
from radarsim.physics import manoeuvre_covariance, transition
from radarsim.studies.sonar.kernels import patterns, steps
from radarsim.studies.sonar.kernels.detector import AdaptiveRules, Detectors, ModelPairs
from radarsim.studies.sonar.kernels.shared_gains import SharedBank
from radarsim.studies.sonar.world import step_correlations


# ---- detectors -------------------------------------------------------------------------------------------------------
class AdaptiveRule(NamedTuple):
    """How an adaptive filter responds to its detector."""

    threshold: np.ndarray  #: (C,) of the statistic
    every: int  #: scans from one test to the next
    joint: bool  #: one test of all coordinates
    raises: bool  #: an alarm raises the degree, else it keeps the memory short
    quiet: int  #: tests without an alarm that end the manoeuvre


class ModelPair(NamedTuple):
    """Two models that interact: manoeuvre variances (C, 2), probabilities (2,) to last from scan to scan."""

    variance: np.ndarray
    stay: np.ndarray


class DetectorTest(NamedTuple):
    """A test of the last plots every so many scans, with thresholds (G, T); no thresholds if only a filter needs it."""

    plots: int
    every: int
    thresholds: np.ndarray


def detector_arrays(
    measured: Sequence[DetectorTest], needed: Iterable[tuple[int, int]], phase: np.ndarray, coordinates: int
) -> Detectors:
    """The measured detectors, then those that adaptive filters need in addition; phase (K,) of the manoeuvre.

    needed holds plots, and scans from one test to the next."""
    tests, no_thresholds = list(measured), np.zeros((coordinates + 1, 0))
    for plots, every in needed:
        if (plots, every) not in [test[:2] for test in tests]:
            tests.append(DetectorTest(plots, every, no_thresholds))
    count = np.array([test.thresholds.shape[1] for test in tests], dtype=np.int64)
    threshold = np.zeros((len(tests), coordinates + 1, max(count, default=0)))
    for d, test in enumerate(tests):
        threshold[d, :, : count[d]] = test.thresholds
    return Detectors(
        plots=np.array([test.plots for test in tests], dtype=np.int64),
        every=np.array([test.every for test in tests], dtype=np.int64),
        threshold=threshold,
        thresholds=count,
        phase=phase,
    )


# ---- filters ---------------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Plots:
    """Times and weights of the plots of one coordinate, for M patterns of missed plots."""

    t: np.ndarray  #: (K,) in s
    weight: np.ndarray  #: (M, K) (sigma / σ of the plot)², zero where it is missed
    period: float  #: T₀ in s, in which lags of the correlation are counted too
    sigma: float  #: of a nominal plot

    def step(self, k: int) -> float:
        """The interval before scan k, in periods."""
        return (self.t[k] - self.t[k - 1]) / self.period if k else 0.0

    def moments(self) -> np.ndarray:
        """The number (M, K) of distinct times of plots so far: as many coefficients of a polynomial are determined."""
        fresh, last = self.weight > 0, np.full(len(self.weight), -np.inf)
        for k, time in enumerate(self.t):
            last, fresh[:, k] = np.where(fresh[:, k], time, last), fresh[:, k] & (time > last)
        return np.cumsum(fresh, axis=1)

    def scaled(self, manoeuvre_variance: float, size: int) -> float:
        """A manoeuvre variance in units of the variance of a nominal plot and of the period."""
        return manoeuvre_variance * self.period ** (2 * size) / self.sigma**2


@dataclass(frozen=True)
class Design:
    """A recursive filter: gain (M, K, 4), carry (K,), covariance (M, K, 3, 3), times of plots so far (M, K)."""

    size: int
    gain: np.ndarray
    carry: np.ndarray
    covariance: np.ndarray
    plots: np.ndarray


def recursive(
    plots: Plots,
    size: int,
    rho: float = 0.0,
    manoeuvre_variance: float | None = None,
    start: int = 0,
    fixed: tuple[float, float, float] = steps.KALMAN_GAIN,
) -> Design:
    """A recursive filter, by the formulas of the kernels, for all patterns of plots at once.

    Without a manoeuvre variance it is least squares in information form: on the differences u_n - ρ^m u_{n-m} of plots
    (`steps.least_squares`), which for ρ = 0 are the plots and for size 2 the paper's recursion (12)-(14). Else it
    starts so, on the first plots (`size`, or `start` if that is more), and goes on as a Kalman-Bucy filter (11) of the
    state and, for ρ other than 0, of the plot's error, the plot then being exact (`steps.kalman`); with `fixed` gains
    (3,), in periods, if any are given. manoeuvre_variance is that of a random derivative of order `size`, constant
    between scans: (m/s²)² for size 2."""
    patterns, scans = plots.weight.shape
    gain, P = np.zeros((patterns, scans, 4)), np.zeros((patterns, scans, 3, 3))
    carry, times = step_correlations(rho, plots.t, plots.period), plots.moments()
    previous_count = zero = np.zeros(patterns)
    Y, J = (zero,) * 8, (zero,) * 10
    variance = plots.scaled(manoeuvre_variance or 0.0, size)
    with np.errstate(divide="ignore", invalid="ignore"):  # of choices that are not taken
        for k in range(scans):
            w, step = plots.weight[:, k], plots.step(k)
            Y, K, packed = steps.least_squares(Y, times[:, k] - (w > 0), w, step, carry[k], size)
            if manoeuvre_variance is not None:
                model = steps.Model(size, max(size, start), carry[k], variance, fixed)
                J, K, packed = steps.kalman(J, (K, packed), previous_count, w, step, model)
            gain[:, k], P[:, k], previous_count = np.stack(K, axis=1), unpack(packed), times[:, k]
    scale = plots.period ** -np.arange(3.0)
    covariance = P * plots.sigma**2 * np.outer(scale, scale)
    return Design(size, gain * np.append(scale, 1.0), carry, covariance, plots.moments())


def settled_gain(period: float, sigma: float, size: int, manoeuvre_variance: float) -> tuple[float, float, float]:
    """Steady-state gains (3,) of the Kalman filter, α, β and γ (0 for size 2), from the algebraic Riccati equation."""
    from scipy.linalg import solve_discrete_are

    F, H = transition(1.0, size), np.eye(size)[:, :1]
    Q = manoeuvre_covariance(manoeuvre_variance * period ** (2 * size) / sigma**2, 1.0, size)
    P = solve_discrete_are(F.T, H, Q, np.eye(1))
    alpha, beta, *gamma = P[:, 0] / (1 + P[0, 0])
    return alpha, beta, gamma[0] if gamma else 0.0


def window_weights(plots: Plots, k: int, length: int, size: int) -> tuple[int, np.ndarray, np.ndarray]:
    """Least squares on the last `length` plots up to scan k, extrapolated to k where k itself is missed.

    Returns the first scan of the window, the weights (M, 3, n) of the plots from there on, and the covariance (M, 3,
    3)."""
    is_detected = plots.weight[:, : k + 1] > 0
    count = np.cumsum(is_detected, axis=1)
    inside = is_detected & (count > count[:, -1:] - length)
    first = int(np.argmax(inside.any(axis=0))) if inside.any() else k
    w = np.where(inside, plots.weight[:, : k + 1], 0.0)[:, first:]
    since = (plots.t[first : k + 1] - plots.t[k]) / plots.period
    A = np.stack([np.ones_like(since), since, since**2 / 2], axis=1)
    times = Plots(plots.t[first : k + 1], w, plots.period, plots.sigma).moments()[:, -1]
    with np.errstate(divide="ignore", invalid="ignore"):
        P = unpack(steps.leading_inverse(pack(np.einsum("mn,ni,nj->mij", w, A, A)), np.minimum(times, size)))
    P[~np.isfinite(P).all(axis=(1, 2))] = 0.0  # weights so unequal that one plot alone counts: no rate is known
    scale = plots.period ** -np.arange(3.0)
    weights = np.einsum("i,mij,nj,mn->min", scale, P, A, w)
    return first, weights, P * plots.sigma**2 * np.outer(scale, scale)


# ---- banks -----------------------------------------------------------------------------------------------------------
KINDS = {
    "growing_memory": patterns.INFORMATION,
    "kalman_differenced": patterns.INFORMATION,
    "kalman": patterns.COVARIANCE,
    "kalman_augmented": patterns.COVARIANCE,
    "fixed_gain": patterns.FIXED,
    "window": patterns.WINDOW,
    "adaptive": patterns.ADAPTIVE,
    "imm": patterns.IMM,
}


@dataclass(frozen=True)
class FilterSpec:
    """A configured filter."""

    kind: str
    size: int  #: of the state
    length: int  #: in plots of a window, of a least-squares start or of a test
    variance: np.ndarray  #: (C,) of a manoeuvre in each coordinate
    rho: np.ndarray  #: (C,) correlation in each coordinate
    response: AdaptiveRule | ModelPair | None = None  #: the rule or the models of a filter that responds to manoeuvres


def recursive_design(spec: FilterSpec, c: int, plots: Plots) -> Design:
    """The design of a recursive filter for coordinate c."""
    size, variance = spec.size, spec.variance[c]
    match spec.kind:
        case "growing_memory":
            return recursive(plots, size)
        case "kalman_differenced":
            return recursive(plots, size, spec.rho[c])
        case "kalman":
            return recursive(plots, size, 0.0, variance)
        case "kalman_augmented":
            return recursive(plots, size, spec.rho[c], variance)
        case "fixed_gain":
            settled = settled_gain(plots.period, plots.sigma, size, variance)
            return recursive(plots, size, 0.0, variance, spec.length, settled)
    raise ValueError(f"not a recursive filter: {spec.kind}")


@dataclass(frozen=True)
class FilterDesign:
    """A filter designed for the plots of one coordinate."""

    spec: FilterSpec
    plots: Plots
    covariance: np.ndarray  #: (M, K, 3, 3) that it believes for M patterns of plots
    recursion: Design | None = None
    #: of a window, at every scan: the first scan in it and the weights (M, 3, n) of the plots from there on
    window_rows: tuple[tuple[int, np.ndarray], ...] = ()

    @property
    def known(self) -> np.ndarray:
        """The number (M, K) of estimated components: plots at a single time determine a value but no rate."""
        return (np.diagonal(self.covariance, axis1=2, axis2=3) > 0).sum(axis=2)


def design_filter(spec: FilterSpec, c: int, plots: Plots) -> FilterDesign:
    """Design a filter for the plots of coordinate c."""
    if spec.kind != "window":
        design = recursive_design(spec, c, plots)
        return FilterDesign(spec, plots, design.covariance, design)
    rows = [window_weights(plots, k, spec.length, spec.size) for k in range(len(plots.t))]
    covariance = np.stack([P for _, _, P in rows], axis=1)
    return FilterDesign(spec, plots, covariance, window_rows=tuple((first, weights) for first, weights, _ in rows))


def apply_filter(spec: FilterSpec, c: int, plots: Plots, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Estimates (n, 3) and covariances (n, 3, 3) from recorded plots z (n,), arbitrary where the weight is zero."""
    design, x = design_filter(spec, c, plots), np.zeros((len(plots.t), 3))
    for k, (first, weights) in enumerate(design.window_rows):
        x[k] = weights[0] @ z[first : k + 1]
    if design.recursion is not None:
        carry, gain = design.recursion.carry, design.recursion.gain[0]
        state, e = np.zeros(3), 0.0
        for k, dt in enumerate(np.diff(plots.t, prepend=plots.t[0])):
            state, e = transition(dt) @ state, carry[k] * e
            innovation = z[k] - state[0] - e
            state, e = state + gain[k, :3] * innovation, e + gain[k, 3] * innovation
            x[k] = state
    return x, design.covariance[0]


def packed_inverse(P: np.ndarray, ready: np.ndarray, size: int) -> np.ndarray:
    """Inverses (K, 6), packed by rows, of the leading blocks of P (K, 3, 3) where `ready` (K,); zeros elsewhere."""
    out = np.zeros((len(P), 6))
    block = P[ready][:, :size, :size]
    unit = np.sqrt(np.diagonal(block, axis1=1, axis2=2))  # brings m, m/s and m/s² to one size before inverting
    scale = unit[:, :, None] * unit[:, None, :]
    full = np.zeros((len(block), 3, 3))
    full[:, :size, :size] = np.linalg.inv(block / scale) / scale
    out[ready] = full[:, *np.triu_indices(3)]
    return out


def shared_bank(specs: Sequence[FilterSpec], designs: Sequence[Sequence[FilterDesign]]) -> SharedBank:
    """The bank of filters whose gains all realisations share; designs[f][c] are for a single pattern of plots."""
    plots = [design.plots for design in designs[0]]
    F, K, C = len(specs), len(plots[0].t), len(plots)
    length = np.array([f.length if f.kind == "window" else 0 for f in specs])
    longest = int(length.max())
    gain, carry = np.zeros((F, K, C, 4)), np.zeros((F, K, C))
    weights, inverse = np.zeros((F, K, C, 3, longest)), np.zeros((F, K, C, 6))
    detected = np.stack([p.weight[0] > 0 for p in plots], axis=1)
    order = np.cumsum(detected, axis=0) - 1
    estimated_sizes = np.stack([np.stack([design.known[0] for design in row], axis=1) for row in designs])
    for f, spec in enumerate(specs):
        for c, design in enumerate(designs[f]):
            if design.recursion is None:
                weights[f, :, c] = ring_weights(design, order[:, c], longest)
            else:
                gain[f, :, c], carry[f, :, c] = design.recursion.gain[0], design.recursion.carry
            inverse[f, :, c] = packed_inverse(design.covariance[0], estimated_sizes[f, :, c] == spec.size, spec.size)
    return SharedBank(
        gain=gain,
        carry=carry,
        carries=np.asarray(gain[..., 3].any(axis=(1, 2))),
        length=length,
        weights=weights,
        slot=np.where(detected, order % max(longest, 1), -1),
        known=estimated_sizes,
        size=np.array([f.size for f in specs]),
        inverse=inverse,
    )


def ring_weights(design: FilterDesign, order: np.ndarray, longest: int) -> np.ndarray:
    """Weights (K, 3, longest) of a window by slots of the kernel's ring, which plot n enters at n mod longest."""
    out = np.zeros((len(design.window_rows), 3, longest))
    for k, (first, weights) in enumerate(design.window_rows):
        for j in np.flatnonzero(weights[0].any(axis=0)):
            out[k, :, order[first + j] % longest] = weights[0, :, j]
    return out


def per_realisation_bank(
    specs: Sequence[FilterSpec], t: np.ndarray, period: float, nominal: np.ndarray, detectors: Detectors
) -> patterns.RealisationBank:
    """The bank of filters whose gains differ between realisations; nominal (C,) σ of a plot."""
    F, C = len(specs), len(nominal)
    manoeuvre, settled = np.zeros((F, C)), np.zeros((F, C, 3))
    carry = np.zeros((F, len(t), C))
    for f, spec in enumerate(specs):
        for c, sigma in enumerate(nominal):
            manoeuvre[f, c] = spec.variance[c] * period ** (2 * spec.size) / sigma**2
            carry[f, :, c] = step_correlations(spec.rho[c], t, period)
            if spec.kind == "fixed_gain":
                settled[f, c] = settled_gain(period, sigma, spec.size, spec.variance[c])
    return patterns.RealisationBank(
        kind=np.array([KINDS[f.kind] for f in specs]),
        size=np.array([f.size for f in specs]),
        length=np.array([f.length for f in specs]),
        carry=carry,
        manoeuvre=manoeuvre,
        settled=settled,
        memory=max([*detectors.plots.tolist(), *(f.length for f in specs if f.kind == "window")], default=0),
        period=period,
        sigma=nominal,
        adaptive=adaptive_rules(specs, detectors, C),
        interacting=model_pairs(specs, period, nominal),
    )


def needed_tests(specs: Sequence[FilterSpec]) -> list[tuple[int, int]]:
    """The tests of adaptive filters: plots, and scans from one test to the next."""
    return [(spec.length, spec.response.every) for spec in specs if isinstance(spec.response, AdaptiveRule)]


def adaptive_rules(specs: Sequence[FilterSpec], detectors: Detectors, coordinates: int) -> AdaptiveRules:
    """The rules of F filters; those of filters without a rule are never read."""
    F = len(specs)
    detector, group = np.zeros(F, dtype=np.int64), np.zeros((F, coordinates), dtype=np.int64)
    threshold, raises, quiet = np.zeros((F, coordinates)), np.zeros(F, dtype=np.bool_), np.ones(F, dtype=np.int64)
    for f, spec in enumerate(specs):
        rule = spec.response
        if isinstance(rule, AdaptiveRule):
            detector[f] = np.flatnonzero((detectors.plots == spec.length) & (detectors.every == rule.every))[0]
            group[f] = coordinates if rule.joint else np.arange(coordinates)
            threshold[f], raises[f], quiet[f] = rule.threshold, rule.raises, rule.quiet
    return AdaptiveRules(detector, group, threshold, raises, quiet)


def model_pairs(specs: Sequence[FilterSpec], period: float, nominal: np.ndarray) -> ModelPairs:
    """The models of F filters, for nominal plots (C,) and periods; those of filters without models are never read."""
    manoeuvre, stay = np.zeros((len(specs), len(nominal), 2)), np.full((len(specs), 2), 0.5)
    for f, spec in enumerate(specs):
        if isinstance(spec.response, ModelPair):
            manoeuvre[f] = spec.response.variance * period ** (2 * spec.size) / nominal[:, None] ** 2
            stay[f] = spec.response.stay
    return ModelPairs(manoeuvre, stay)
