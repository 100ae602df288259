"""Sonar filters as the arrays that the kernels take: a filter's specification, its design, and banks of filters."""

from dataclasses import dataclass

import numpy as np

from radarsim.physics.motion import transition
from radarsim.studies.sonar import filters
from radarsim.studies.sonar.detectors import AdaptiveRule, DetectorTests, ModelPair, adaptive_rules, model_pairs
from radarsim.studies.sonar.kernels import patterns
from radarsim.studies.sonar.kernels import shared_gains as kernels
from radarsim.studies.sonar.world import step_correlations

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
    """A configured filter: kind, size of the state, plots of a window or of a least-squares start.

    By coordinate the manoeuvre variance (C,) and ρ (C,). A filter that responds to manoeuvres has its rule or models.
    """

    kind: str
    size: int
    length: int
    variance: np.ndarray
    rho: np.ndarray
    response: AdaptiveRule | ModelPair | None = None


def recursive_design(spec: FilterSpec, c: int, plots: filters.Plots) -> filters.Design:
    """The design of a recursive filter in coordinate c."""
    size = spec.size
    match spec.kind:
        case "growing_memory":
            return filters.line(plots) if size == 2 else filters.differenced(plots, size, 0.0)
        case "kalman":
            return filters.kalman(plots, size, spec.variance[c])
        case "fixed_gain":
            return filters.fixed_gain(plots, size, spec.variance[c], spec.length)
        case "kalman_augmented":
            return filters.augmented(plots, size, spec.rho[c], spec.variance[c])
        case "kalman_differenced":
            return filters.differenced(plots, size, spec.rho[c])
    raise ValueError(f"no recursive filter: {spec.kind}")


@dataclass(frozen=True)
class FilterDesign:
    """A filter designed for one coordinate's plots: covariance (M, K, 3, 3), and its recursion or its window rows.

    window_rows are (first scan, weights (M, 3, n)) at every scan.
    """

    spec: FilterSpec
    plots: filters.Plots
    covariance: np.ndarray
    recursion: filters.Design | None = None
    window_rows: tuple = ()

    @property
    def known(self) -> np.ndarray:
        """Number (M, K) of components estimated: plots of a single time determine a value and no rate."""
        return (np.diagonal(self.covariance, axis1=2, axis2=3) > 0).sum(axis=2)


def design_filter(spec: FilterSpec, c: int, plots: filters.Plots) -> FilterDesign:
    """Design a filter for the plots of coordinate c."""
    if spec.kind != "window":
        design = recursive_design(spec, c, plots)
        return FilterDesign(spec, plots, design.covariance, design)
    found = [filters.window_weights(plots, k, spec.length, spec.size) for k in range(len(plots.t))]
    covariance = np.stack([P for _, _, P in found], axis=1)
    return FilterDesign(spec, plots, covariance, window_rows=tuple(row[:2] for row in found))


def apply_filter(spec: FilterSpec, c: int, plots: filters.Plots, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Estimates (n, 3) and covariances (n, 3, 3) over recorded plots z (n,), any number where the weight is zero."""
    found, x = design_filter(spec, c, plots), np.zeros((len(plots.t), 3))
    for k, (first, weights) in enumerate(found.window_rows):
        x[k] = weights[0] @ z[first : k + 1]
    now, e, design = np.zeros(3), 0.0, found.recursion
    for k in range(len(plots.t)) if design is not None else ():
        now, e = transition(plots.t[k] - plots.t[max(k - 1, 0)]) @ now, design.carry[k] * e
        innovation = z[k] - now[0] - e
        now, e = now + design.gain[0, k, :3] * innovation, e + design.gain[0, k, 3] * innovation
        x[k] = now
    return x, found.covariance[0]


def packed_inverse(P: np.ndarray, ready: np.ndarray, size: int) -> np.ndarray:
    """Inverses (K, 6), packed by rows, of P (K, 3, 3) in its leading block, where `ready` (K,); zeros elsewhere."""
    out = np.zeros((len(P), 6))
    block = P[ready][:, :size, :size]
    unit = np.sqrt(np.diagonal(block, axis1=1, axis2=2))  # m, m/s and m/s² brought to one size before inverting
    scale = unit[:, :, None] * unit[:, None, :]
    full = np.zeros((len(block), 3, 3))
    full[:, :size, :size] = np.linalg.inv(block / scale) / scale
    out[ready] = full[:, *np.triu_indices(3)]
    return out


def shared_bank(specs: list[FilterSpec], designs: list[list[FilterDesign]]) -> kernels.SharedBank:
    """The bank of filters whose gains all realisations share; designs[f][c] are for a single pattern of plots."""
    plots = [one.plots for one in designs[0]]
    F, K, C = len(specs), len(plots[0].t), len(plots)
    length = np.array([f.length if f.kind == "window" else 0 for f in specs])
    longest = int(length.max())
    gain, carry = np.zeros((F, K, C, 4)), np.zeros((F, K, C))
    weights, inverse = np.zeros((F, K, C, 3, longest)), np.zeros((F, K, C, 6))
    detected = np.stack([p.weight[0] > 0 for p in plots], axis=1)
    order = np.cumsum(detected, axis=0) - 1
    known = np.stack([np.stack([one.known[0] for one in row], axis=1) for row in designs])
    for f, spec in enumerate(specs):
        for c, one in enumerate(designs[f]):
            if one.recursion is None:
                weights[f, :, c] = ring_weights(one, order[:, c], longest)
            else:
                gain[f, :, c], carry[f, :, c] = one.recursion.gain[0], one.recursion.carry
            inverse[f, :, c] = packed_inverse(one.covariance[0], known[f, :, c] == spec.size, spec.size)
    size = np.array([f.size for f in specs])
    return kernels.SharedBank(
        gain=gain,
        carry=carry,
        carries=gain[..., 3].any(axis=(1, 2)),
        length=length,
        weights=weights,
        slot=np.where(detected, order % max(longest, 1), -1),
        known=known,
        size=size,
        inverse=inverse,
    )


def ring_weights(one: FilterDesign, order: np.ndarray, longest: int) -> np.ndarray:
    """Weights (K, 3, longest) of a window by the places of its plots in the kernel's ring: number modulo its length."""
    out = np.zeros((len(one.window_rows), 3, longest))
    for k, (first, weights) in enumerate(one.window_rows):
        for j in np.flatnonzero(weights[0].any(axis=0)):
            out[k, :, order[first + j] % longest] = weights[0, :, j]
    return out


def per_realisation_bank(
    specs: list[FilterSpec], t: np.ndarray, period: float, nominal: np.ndarray, tests: DetectorTests
) -> patterns.RealisationBank:
    """The bank of filters with gains of each realisation's own; nominal (C,) σ of a plot, tests of all detectors."""
    F, C = len(specs), len(nominal)
    manoeuvre, settled = np.zeros((F, C)), np.zeros((F, C, 3))
    carry = np.zeros((F, len(t), C))
    for f, spec in enumerate(specs):
        for c, sigma in enumerate(nominal):
            manoeuvre[f, c] = spec.variance[c] * period ** (2 * spec.size) / sigma**2
            carry[f, :, c] = step_correlations(spec.rho[c], t, period)
            if spec.kind == "fixed_gain":
                gain = filters.steady_gain(period, sigma, spec.size, spec.variance[c])
                settled[f, c, : spec.size] = gain * period ** np.arange(spec.size)
    return patterns.RealisationBank(
        kind=np.array([KINDS[f.kind] for f in specs]),
        size=np.array([f.size for f in specs]),
        length=np.array([f.length for f in specs]),
        carry=carry,
        manoeuvre=manoeuvre,
        settled=settled,
        memory=max([tests.longest, *(f.length for f in specs if f.kind == "window")]),
        switching=adaptive_rules([f.response for f in specs], [f.length for f in specs], tests, C),
        interacting=model_pairs([f.response for f in specs], [f.size for f in specs], period, nominal),
    )
