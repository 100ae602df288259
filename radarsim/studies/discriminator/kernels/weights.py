"""Bursts drawn where locks are lost, and their weights (importance sampling).

The unit normals z of a burst are drawn from the mixture α₀ N(0, 1) + Σ α_m N(s_m u_m, 1), u_m unit vectors. The ratio
of the density of N(0, 1) to that of the mixture is

    w(z) = 1 / (α₀ + Σ α_m e^{s_m u_mᵀ z − s_m²/2}),

at most 1/α₀ (Owen & Zhou, Journal of the American Statistical Association 95, 2000, 135)."""

import math
from typing import NamedTuple

import numpy as np

from radarsim.bursts.kernels.scoring import SIZE
from radarsim.bursts.kernels.scoring_lanes import PRIOR, lane
from radarsim.kernels.compiler import kernel, kernel_part
from radarsim.kernels.lanes import WIDTH, address, full, get, put
from radarsim.kernels.mixtures import law_index


class Mixture(NamedTuple):
    """A mixture of M directions beside the plain law, over the normals of the forecast and of B blocks."""

    cumulative: np.ndarray  #: (M + 1,) running sums of the shares α, the plain one first; the last is 1
    shift: np.ndarray  #: (M,) s_m
    forecast: np.ndarray  #: (M, 6) u_m's part in the forecast's normals, times their σ: turns over the burst
    weight: np.ndarray  #: (M, 6) u_m's part over these σ, zero where one is zero
    first: np.ndarray  #: (M, 2B) u_m's part in the first normals of the draws, and
    second: np.ndarray  #: (M, 2B) in the second ones


@kernel
def choose(key, first, cumulative, law_indices):
    """Write into law_indices (n,) from which law of the mixture each of realisations first, first + 1, … is drawn.

    0 is the plain law, m the shift along direction m − 1."""
    for i in range(law_indices.size):
        law_indices[i] = law_index(key, cumulative, first + i)


@kernel
def move(mixture, law_indices, work, a, b):
    """Shift the forecasts in work and the normals a and b (2B rows of eight) of eight bursts by law_indices (8,)."""
    for n in range(WIDTH):
        if law_indices[n] == 0:
            continue
        m = law_indices[n] - 1
        step = mixture.shift[m]
        for j in range(SIZE):
            work[lane(PRIOR + j, n)] += step * mixture.forecast[m, j]
        for r in range(mixture.first.shape[1]):
            a[lane(r, n)] += step * mixture.first[m, r]
            b[lane(r, n)] += step * mixture.second[m, r]


@kernel_part
def project(mixture, m, work, a, b, projections):
    """Write u_mᵀ z of eight bursts into the row projections; all but the mixture are addresses."""
    x = full(0.0)
    for j in range(SIZE):
        x = x + mixture.weight[m, j] * get(work, PRIOR + j)
    for r in range(mixture.first.shape[1]):
        x = x + mixture.first[m, r] * get(a, r) + mixture.second[m, r] * get(b, r)
    put(projections, 0, x)


@kernel
def weigh(mixture, work, a, b, projections, weights):
    """Write weights (n,) of up to eight bursts, from the forecasts in work and the normals a and b.

    projections is a work array of one row."""
    law, shift = mixture.cumulative, mixture.shift
    density = np.full(WIDTH, law[0])
    for m in range(shift.size):
        project(mixture, m, address(work), address(a), address(b), address(projections))
        share, level = law[m + 1] - law[m], 0.5 * shift[m] * shift[m]
        for n in range(WIDTH):
            density[n] += share * math.exp(shift[m] * projections[n] - level)
    for n in range(weights.size):
        weights[n] = 1.0 / density[n]
