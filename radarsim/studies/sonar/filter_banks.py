"""Filters as banks of arrays for the kernels."""

from collections.abc import Sequence

import numpy as np

from radarsim.studies.sonar.detector_arrays import AdaptiveRule, ModelPair
from radarsim.studies.sonar.filter_design import FilterDesign, FilterSpec, steady_gain
from radarsim.studies.sonar.kernels import realisation_gains
from radarsim.studies.sonar.kernels.adaptive import AdaptiveRules
from radarsim.studies.sonar.kernels.detector import Detectors
from radarsim.studies.sonar.kernels.imm import ModelPairs
from radarsim.studies.sonar.kernels.shared_gains import SharedBank
from radarsim.studies.sonar.plot_errors import step_correlations

KINDS = {
    "growing_memory": realisation_gains.INFORMATION,
    "kalman_differenced": realisation_gains.INFORMATION,
    "kalman": realisation_gains.COVARIANCE,
    "kalman_augmented": realisation_gains.COVARIANCE,
    "fixed_gain": realisation_gains.FIXED,
    "window": realisation_gains.WINDOW,
    "adaptive": realisation_gains.ADAPTIVE,
    "imm": realisation_gains.IMM,
}


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
    estimated_sizes = np.stack([np.stack([design.estimated_sizes[0] for design in row], axis=1) for row in designs])
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
        estimated_sizes=estimated_sizes,
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
) -> realisation_gains.RealisationBank:
    """The bank of filters whose gains differ between realisations; nominal (C,) σ of a plot."""
    F, C = len(specs), len(nominal)
    manoeuvre, steady_gains = np.zeros((F, C)), np.zeros((F, C, 3))
    carry = np.zeros((F, len(t), C))
    for f, spec in enumerate(specs):
        for c, sigma in enumerate(nominal):
            manoeuvre[f, c] = spec.variance[c] * period ** (2 * spec.size) / sigma**2
            carry[f, :, c] = step_correlations(spec.rho[c], t, period)
            if spec.kind == "fixed_gain":
                steady_gains[f, c] = steady_gain(period, sigma, spec.size, spec.variance[c])
    return realisation_gains.RealisationBank(
        kind=np.array([KINDS[f.kind] for f in specs]),
        size=np.array([f.size for f in specs]),
        length=np.array([f.length for f in specs]),
        carry=carry,
        manoeuvre=manoeuvre,
        steady_gains=steady_gains,
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
