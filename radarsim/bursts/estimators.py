"""Estimators of one burst as arrays for the kernels."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from radarsim.bursts.burst import Burst, signal, turns_per_parameter
from radarsim.bursts.fisher import image_bias, phase_prior
from radarsim.bursts.kernels.scoring import SIZE
from radarsim.bursts.kernels.scoring import Z0 as SUM_Z
from radarsim.bursts.kernels.sequence import OPTIONS, WINDOW
from radarsim.bursts.kernels.signal import PHYSICS, block_table
from radarsim.bursts.schedule_design import Designer, handover_directions

Blocks = Callable[[int], tuple[int, int, int]]
# The sum at twice the frequency is left out of the likelihood where it is less of every window's samples than this, and
# where that biases no estimate by more than this in its standard deviations: then no σ is over 2 % too large.
IMAGE_SHARE, IMAGE_BIAS = 0.02, 0.2


@dataclass(frozen=True)
class Design:
    """One estimator: window lengths in pulses, and how it starts, steps and searches; see `sequence.OPTIONS`."""

    windows: tuple[int, ...]
    phases: int = 0
    steps: int = 40
    tolerance: float = 1e-3
    coherent: bool = False
    search: int = 0
    spacing: float = 0.8
    margin: float = 3.0
    from_truth: bool = False
    amplitude: int = 0
    forecast: bool = True  # whether the prior is used


@dataclass(frozen=True)
class World:
    """The burst for the kernels, see `kernels.sequence.estimate_block`."""

    physics: np.void
    edges: np.ndarray
    clean: np.ndarray
    mean: np.ndarray
    factor: np.ndarray

    @property
    def sums(self) -> np.ndarray:
        """Means (blocks, 4) of Z₀ and Z₁, of which factor (blocks, 10) is the covariance root."""
        return np.ascontiguousarray(self.mean[SUM_Z : SUM_Z + 4, : len(self.factor)].T)


def has_image(burst: Burst, sigma: np.ndarray, windows: list[int], truth_turns: np.ndarray) -> bool:
    """Whether the sum at twice the frequency counts in any window, of forecasts of standard deviations sigma (size,).
    Phases (samples per pulse, pulses) are in turns."""
    if burst.complex_samples:
        return False
    ends = np.array(windows)
    doubled = np.cumsum(np.exp(-4j * math.pi * (truth_turns - np.rint(truth_turns))).sum(axis=0))[ends - 1]
    shares = np.abs(doubled) / (burst.samples_per_pulse * ends)
    return bool(shares.max() > IMAGE_SHARE or image_bias(burst, sigma, windows, truth_turns).max() > IMAGE_BIAS)


def world(
    burst: Burst, mode: int, edges: np.ndarray, image: bool, truth_turns: np.ndarray, reference_turns: np.ndarray
) -> World:
    """Arrays of a burst; phases (samples per pulse, pulses) in turns, the same unless the truth is no polynomial."""
    physics = np.zeros(1, PHYSICS)
    physics[0] = (
        mode,
        burst.complex_samples,
        image,
        burst.pulses,
        burst.samples_per_pulse,
        burst.amplitude,
        math.sqrt(burst.noise_variance),
        1.0 / burst.pulses,
        burst.sampling_period_s / burst.duration_s,
    )
    clean = signal(burst, truth_turns)
    mean, factor = block_table(physics[0], edges, reference_turns, clean)
    rows = [clean.real.ravel(), clean.imag.ravel()] if burst.complex_samples else [clean.ravel()]
    return World(physics[0], edges.astype(np.int64), np.stack(rows), mean, factor)


def step_root(data: np.ndarray, precision: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows v (size, size) with Σ v vᵀ = (Φ + P)⁻¹ and vᵀ Φ v = share (size,): Φ the data's, P the prior's information.
    Then (ρΦ + P)⁻¹ = Σ v vᵀ / (1 − (1 − ρ) share) for any coherence ρ."""
    information = data + np.diag(precision)
    scale = 1.0 / np.sqrt(np.diag(information))
    lower = np.linalg.cholesky(information * np.outer(scale, scale))
    white = np.linalg.solve(lower, np.linalg.solve(lower, data * np.outer(scale, scale)).T)
    share, vectors = np.linalg.eigh(0.5 * (white + white.T))
    return (np.linalg.solve(lower.T, vectors) * scale[:, None]).T, np.clip(share, 0.0, 1.0)


def estimators(
    designs: list[Design],
    blocks: Blocks,
    burst: Burst,
    sigma: np.ndarray,
    information: Mapping[int, np.ndarray],
    designer: Designer,
) -> tuple[np.ndarray, np.ndarray]:
    """Records of the windows (F, K) and options (F,) of a case's estimators.

    blocks gives a window's place in the table of blocks, in that of weights, and its number of blocks, see `Tables`;
    information is Φ_θ by window in the units of θ, sigma (size,) is the prior. Unused windows stay zero."""
    size, turns_of_burst = len(sigma), turns_per_parameter(len(sigma), burst.duration_s)
    windows = np.zeros((len(designs), max(len(d.windows) for d in designs)), WINDOW)
    options = np.zeros(len(designs), OPTIONS)
    for e, design in enumerate(designs):
        for name in OPTIONS.names or ():
            options[e][name] = len(design.windows) if name == "windows" else getattr(design, name)
        directions = handover_directions(designer, list(design.windows)) if design.search else None
        for k, pulses in enumerate(design.windows):
            window = windows[e, k]
            window["pulses"] = pulses
            window["table"], window["weights"], window["blocks"] = blocks(pulses)
            window["powers"] = (pulses / burst.pulses) ** np.arange(SIZE)
            turns = turns_of_burst * window["powers"][:size]
            if design.forecast:
                window["precision"][:size] = phase_prior(sigma) / turns**2
            root, share = step_root(information[pulses] / np.outer(turns, turns), window["precision"][:size])
            window["root"][:size, :size], window["share"][:size] = root, share
            if directions is not None:
                window["direction"][:size] = directions[k] * turns_of_burst
    return windows, options
