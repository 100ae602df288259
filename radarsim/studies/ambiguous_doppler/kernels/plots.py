"""Plots of eight realisations: range and folded velocity, missed ones, and the truth that each realisation has."""

from radarsim.kernels.compile import part
from radarsim.kernels.lanes import address, full, get, nearest, put, row, where_greater
from radarsim.kernels.random import fill_normal_strip, fill_uniform_pairs
from radarsim.studies.ambiguous_doppler.kernels.records import (
    CAME,
    FIRST,
    PLOT,
    RANGE,
    STARTED,
    TRUTH,
    UNFOLDED,
    VELOCITY,
)


@part
def fill_plots(world, first, random, plots):
    """Plots and truth of the realisations first … first + 7 into rows PLOT a scan; random (2 K rows) is written over.

    The first normal of draw pair k goes to the range of scan k, the second to its velocity, whether or not there is a
    plot; the first uniform of draw pair k says whether there is.
    """
    scans = world.truth.shape[0]
    half = random.size // 2
    a, b = random[:half], random[half:]
    zero, one = full(0.0), full(1.0)
    fill_normal_strip(world.keys[2], first, 0, a[:8], b[:8])
    dv, da = world.spread[0] * get(address(a), 0), world.spread[1] * get(address(b), 0)
    size = 8 * scans
    fill_normal_strip(world.keys[0], first, 0, a[:size], b[:size])
    to, noise_r, noise_v = address(plots), address(a), address(b)
    for k in range(scans):
        t, scan = world.t[k], row(to, k * PLOT)
        r = world.truth[k, 0] + dv * t + da * (0.5 * t * t)
        v = world.truth[k, 1] + dv + da * t
        put(scan, TRUTH, r)
        put(scan, TRUTH + 1, v)
        put(scan, TRUTH + 2, world.truth[k, 2] + da)
        z, u, span = r + world.sigma[0] * get(noise_r, k), v + world.sigma[1] * get(noise_v, k), world.spans[k]
        put(scan, RANGE, z)
        put(scan, UNFOLDED, u)
        put(scan, VELOCITY, u - span * nearest(u / span))
    started = zero
    for k in range(scans):
        scan, came = row(to, k * PLOT), one
        if world.detection < 1.0:
            fill_uniform_pairs(world.keys[1], first, k, a[8 * k : 8 * k + 8], b[8 * k : 8 * k + 8])
            came = where_greater(full(world.detection), get(noise_r, k), one, zero)
        put(scan, CAME, came)
        put(scan, FIRST, came * (one - started))
        started = where_greater(came, started, one, started)
        put(scan, STARTED, started)
