"""Sonar filters as the arrays that the kernels take: a choice of filter, its design, banks of many."""

from dataclasses import dataclass

import numpy as np

from radarsim.physics.motion import transition
from radarsim.studies.sonar import filters
from radarsim.studies.sonar.kernels import patterns
from radarsim.studies.sonar.kernels import shared_gains as kernels
from radarsim.studies.sonar.manoeuvre.filters import Models, Rule, Trials, interacting, switching
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
class Choice:
    """A filter as chosen: kind, size of the state, length of a window or of a start.

    By coordinate the manoeuvre variance (C,) and ρ (C,). A filter that answers to manoeuvres has its rule or models.
    """

    kind: str
    size: int
    length: int
    variance: np.ndarray
    rho: np.ndarray
    answer: Rule | Models | None = None


def designed(choice: Choice, c: int, plots: filters.Plots) -> filters.Design:
    """The design of a recursive filter in coordinate c."""
    size = choice.size
    match choice.kind:
        case "growing_memory":
            return filters.line(plots) if size == 2 else filters.differenced(plots, size, 0.0)
        case "kalman":
            return filters.kalman(plots, size, choice.variance[c])
        case "fixed_gain":
            return filters.fixed_gain(plots, size, choice.variance[c], choice.length)
        case "kalman_augmented":
            return filters.augmented(plots, size, choice.rho[c], choice.variance[c])
        case "kalman_differenced":
            return filters.differenced(plots, size, choice.rho[c])
    raise ValueError(f"no recursive filter: {choice.kind}")


@dataclass(frozen=True)
class Made:
    """A choice designed for one coordinate's plots: believed (M, K, 3, 3), and its recursion or, of a window, its rows.

    rows are (first scan, weights (M, 3, n)) at every scan.
    """

    choice: Choice
    plots: filters.Plots
    believed: np.ndarray
    design: filters.Design | None = None
    rows: tuple = ()

    @property
    def known(self) -> np.ndarray:
        """How many components (M, K) are estimated: plots of one time, however many, tell a value and no rate."""
        return (np.diagonal(self.believed, axis1=2, axis2=3) > 0).sum(axis=2)


def made(choice: Choice, c: int, plots: filters.Plots) -> Made:
    """Design a choice in coordinate c."""
    if choice.kind != "window":
        design = designed(choice, c, plots)
        return Made(choice, plots, design.believed, design)
    found = [filters.window_weights(plots, k, choice.length, choice.size) for k in range(len(plots.t))]
    return Made(choice, plots, np.stack([P for _, _, P in found], axis=1), rows=tuple(row[:2] for row in found))


def applied(choice: Choice, c: int, plots: filters.Plots, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Estimates (n, 3) and covariances (n, 3, 3) over recorded plots z (n,), any number where the weight is zero."""
    found, x = made(choice, c, plots), np.zeros((len(plots.t), 3))
    for k, (first, weights) in enumerate(found.rows):
        x[k] = weights[0] @ z[first : k + 1]
    now, e, design = np.zeros(3), 0.0, found.design
    for k in range(len(plots.t)) if design is not None else ():
        now, e = transition(plots.t[k] - plots.t[max(k - 1, 0)]) @ now, design.carry[k] * e
        innovation = z[k] - now[0] - e
        now, e = now + design.gain[0, k, :3] * innovation, e + design.gain[0, k, 3] * innovation
        x[k] = now
    return x, found.believed[0]


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


def shared(choices: list[Choice], designs: list[list[Made]]) -> kernels.Shared:
    """Filters whose gains all realisations share: designs of each filter and coordinate, of one pattern of plots."""
    plots = [one.plots for one in designs[0]]
    F, K, C = len(choices), len(plots[0].t), len(plots)
    length = np.array([f.length if f.kind == "window" else 0 for f in choices])
    longest = int(length.max())
    gain, carry = np.zeros((F, K, C, 4)), np.zeros((F, K, C))
    weights, inverse = np.zeros((F, K, C, 3, longest)), np.zeros((F, K, C, 6))
    came = np.stack([p.weight[0] > 0 for p in plots], axis=1)
    order = np.cumsum(came, axis=0) - 1
    known = np.stack([np.stack([one.known[0] for one in row], axis=1) for row in designs])
    for f, choice in enumerate(choices):
        for c, one in enumerate(designs[f]):
            if one.design is None:
                weights[f, :, c] = ring_weights(one, order[:, c], longest)
            else:
                gain[f, :, c], carry[f, :, c] = one.design.gain[0], one.design.carry
            inverse[f, :, c] = packed_inverse(one.believed[0], known[f, :, c] == choice.size, choice.size)
    size = np.array([f.size for f in choices])
    return kernels.Shared(
        gain=gain,
        carry=carry,
        carries=gain[..., 3].any(axis=(1, 2)),
        length=length,
        weights=weights,
        slot=np.where(came, order % max(longest, 1), -1),
        known=known,
        size=size,
        inverse=inverse,
    )


def ring_weights(one: Made, order: np.ndarray, longest: int) -> np.ndarray:
    """Weights (K, 3, longest) of a window by the places of its plots in the kernel's ring: number modulo its length."""
    out = np.zeros((len(one.rows), 3, longest))
    for k, (first, weights) in enumerate(one.rows):
        for j in np.flatnonzero(weights[0].any(axis=0)):
            out[k, :, order[first + j] % longest] = weights[0, :, j]
    return out


def own(choices: list[Choice], t: np.ndarray, period: float, nominal: np.ndarray, trials: Trials) -> patterns.Bank:
    """Filters that go along with each realisation's plots; nominal (C,) σ of a plot, trials all tests there are."""
    F, C = len(choices), len(nominal)
    manoeuvre, settled = np.zeros((F, C)), np.zeros((F, C, 3))
    carry = np.zeros((F, len(t), C))
    for f, choice in enumerate(choices):
        for c, sigma in enumerate(nominal):
            manoeuvre[f, c] = choice.variance[c] * period ** (2 * choice.size) / sigma**2
            carry[f, :, c] = step_correlations(choice.rho[c], t, period)
            if choice.kind == "fixed_gain":
                gain = filters.steady_gain(period, sigma, choice.size, choice.variance[c])
                settled[f, c, : choice.size] = gain * period ** np.arange(choice.size)
    return patterns.Bank(
        kind=np.array([KINDS[f.kind] for f in choices]),
        size=np.array([f.size for f in choices]),
        length=np.array([f.length for f in choices]),
        carry=carry,
        manoeuvre=manoeuvre,
        settled=settled,
        memory=max([trials.longest, *(f.length for f in choices if f.kind == "window")]),
        switching=switching([f.answer for f in choices], [f.length for f in choices], trials, C),
        interacting=interacting([f.answer for f in choices], [f.size for f in choices], period, nominal),
    )
