"""Bursts whose noise is shifted towards a loss of lock, and the weights that make up for it (importance sampling).

The unit normals z of a burst are drawn from the mixture α₀ N(0, 1) + Σ α_m N(s_m u_m, 1), u_m unit vectors. The ratio
of the law that they should have to the one that they have is

    w(z) = 1 / (α₀ + Σ α_m e^{s_m u_mᵀ z − s_m²/2}),

at most 1/α₀ (Owen & Zhou, Journal of the American Statistical Association 95, 2000, 135).
"""

import math
from typing import NamedTuple

import numpy as np

from radarsim.bursts.kernels.lanes import PRIOR, lane
from radarsim.bursts.kernels.scoring import SIZE
from radarsim.kernels.compile import kernel, part
from radarsim.kernels.lanes import WIDTH, address, full, get, put
from radarsim.kernels.random import uniforms


class Mixture(NamedTuple):
    """A mixture of M directions beside the plain law, over the normals of the forecast and of B blocks.

    cumulative (M + 1,)   running sums of the shares α, the plain one first; the last is 1
    shift (M,)            s_m
    forecast (M, 6)       u_m's part in the forecast's normals, times their σ: turns over the burst
    weight (M, 6)         u_m's part over these σ, zero where one is zero
    first (M, 2B)         u_m's part in the first normals of the draws, and
    second (M, 2B)        in the second ones
    """

    cumulative: np.ndarray
    shift: np.ndarray
    forecast: np.ndarray
    weight: np.ndarray
    first: np.ndarray
    second: np.ndarray


@kernel
def choose(key, first, cumulative, chosen):
    """Which part of the mixture each of realisations first, first + 1, … is drawn from, into chosen (n,).

    0 is the plain law, m the shift along direction m − 1.
    """
    for i in range(chosen.size):
        which, _ = uniforms(key[0], key[1], first + i, 0)
        m = 0
        while which > cumulative[m]:
            m += 1
        chosen[i] = m


@kernel
def move(mixture, chosen, work, a, b):
    """Shifts the forecasts in work and the normals a and b (2B rows of eight) of eight bursts as chosen (8,) says."""
    for n in range(WIDTH):
        if chosen[n] == 0:
            continue
        m = chosen[n] - 1
        step = mixture.shift[m]
        for j in range(SIZE):
            work[lane(PRIOR + j, n)] += step * mixture.forecast[m, j]
        for r in range(mixture.first.shape[1]):
            a[lane(r, n)] += step * mixture.first[m, r]
            b[lane(r, n)] += step * mixture.second[m, r]


@part
def project(mixture, m, work, a, b, along):
    """u_mᵀ z of eight bursts into the row along; all but the mixture are addresses."""
    x = full(0.0)
    for j in range(SIZE):
        x = x + mixture.weight[m, j] * get(work, PRIOR + j)
    for r in range(mixture.first.shape[1]):
        x = x + mixture.first[m, r] * get(a, r) + mixture.second[m, r] * get(b, r)
    put(along, 0, x)


@kernel
def weigh(mixture, work, a, b, along, weights):
    """Weights (n,) of up to eight bursts from the forecasts in work and normals a and b; along has room for a row."""
    law, shift = mixture.cumulative, mixture.shift
    density = np.full(WIDTH, law[0])
    for m in range(shift.size):
        project(mixture, m, address(work), address(a), address(b), address(along))
        share, level = law[m + 1] - law[m], 0.5 * shift[m] * shift[m]
        for n in range(WIDTH):
            density[n] += share * math.exp(shift[m] * along[n] - level)
    for n in range(weights.size):
        weights[n] = 1.0 / density[n]
