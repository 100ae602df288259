"""One block of realisations, compiled.

Yours: the loop of your study. Three rules keep results the same for any number of threads, workers and shards:
realisation i draws its noise from i alone (`normals`: two unit normals for each draw pair, counted from 0); sums are
added up in a fixed order; nothing is kept from one block to the next. Faster loops, which work on hundreds of
realisations or on eight at a time, are in radarsim.kernels.linear and radarsim.kernels.lanes.
"""

import numpy as np
from radarsim.kernels.compile import inline, kernel
from radarsim.kernels.random import normals


@inline
def add_powers(sums, e):
    """sums (4,) += e, e², e³, e⁴: what mean, rms and their intervals are made of."""
    square = e * e
    sums[0] += e
    sums[1] += square
    sums[2] += e * square
    sums[3] += square * square


@kernel
def simulate_block(key, first, count, sigma, step, gains, baseline, error, paired):
    """Add the errors of realisations first … first + count - 1 to the sums.

    key (2,) of the noise; sigma of a plot and step of the walk, m; gains (F, K) of F filters over K scans; baseline the
    filter that gains are against. error (F, K, 1, 4) takes the sums of e, e², e³, e⁴; paired (F, K, 1) those of e²
    times the baseline's e².
    """
    filters, scans = gains.shape
    estimate, e = np.zeros(filters), np.zeros(filters)
    for i in range(count):
        x = 0.0
        estimate[:] = 0.0
        for k in range(scans):
            v, w = normals(key[0], key[1], first + i, k)
            x += step * w
            z = x + sigma * v
            for f in range(filters):
                estimate[f] += gains[f, k] * (z - estimate[f])
                e[f] = estimate[f] - x
                add_powers(error[f, k, 0], e[f])
            for f in range(filters):
                paired[f, k, 0] += e[f] * e[f] * e[baseline] * e[baseline]


@kernel
def simulate_plots(key, realisation, sigma, step, x, z):
    """The walk x (K,) and the plots z (K,) of one realisation, the very numbers of `simulate_block`."""
    at = 0.0
    for k in range(x.size):
        v, w = normals(key[0], key[1], realisation, k)
        at += step * w
        x[k], z[k] = at, at + sigma * v
