"""Plots of eight realisations: range and folded velocity, missed ones, and the truth that each realisation has."""

import math

from radarsim.kernels.compile import inline, part
from radarsim.kernels.lanes import WIDTH, address, full, get, nearest, put, row, where_greater
from radarsim.kernels.random import fill_normal_strip, fill_uniform_pairs
from radarsim.studies.ambiguous_doppler.kernels import records as rec


@inline
def remainder(z, D, z_before, D_before, joint):
    """The velocity in ± joint/2 that folds to z in a span D and, as nearly as any, to z_before in D_before."""
    found, least, u = 0.0, D_before, z + D * math.ceil((-0.5 * joint - z) / D)
    while u < 0.5 * joint:
        off = u - z_before
        off = abs(off - D_before * math.floor(off / D_before + 0.5))
        if off < least:
            found, least = u, off
        u += D
    return found


@part
def solve_remainders(world, plots):
    """The velocities that follow from a plot and the one before it, of one realisation: plots is its lane's address."""
    before = -1
    for k in range(world.truth.shape[0]):
        scan = row(plots, k * rec.PLOT)
        scan[rec.SOLVED * WIDTH] = scan[rec.PAIRED * WIDTH] = 0.0
        if scan[rec.DETECTED * WIDTH] > 0.0:
            joint = world.joint[world.turn[k], world.turn[before]] if before >= 0 else 0.0
            if joint > 0.0:
                z = row(plots, before * rec.PLOT)[rec.VELOCITY * WIDTH]
                spans = world.spans
                scan[rec.SOLVED * WIDTH] = remainder(scan[rec.VELOCITY * WIDTH], spans[k], z, spans[before], joint)
                scan[rec.PAIRED * WIDTH] = 1.0
            before = k


@part
def fill_normals(world, first, normals):
    """Unit normals of realisations first … first + 7: rows of what a target draws (2), of ranges (K), velocities (K).

    The first normal of draw pair k goes to the range of scan k, the second to its velocity, whether or not there is a
    plot.
    """
    size = WIDTH * world.truth.shape[0]
    ranges, velocities = normals[2 * WIDTH : 2 * WIDTH + size], normals[2 * WIDTH + size :]
    fill_normal_strip(world.keys[2], first, 0, normals[:WIDTH], normals[WIDTH : 2 * WIDTH])
    fill_normal_strip(world.keys[0], first, 0, ranges, velocities)


@part
def put_plots(world, first, normals, plots):
    """Plots and truth from normals, which are written over, into rows PLOT a scan.

    The first uniform of draw pair k says whether there is a plot at scan k.
    """
    scans = world.truth.shape[0]
    zero, one = full(0.0), full(1.0)
    to, drawn = address(plots), address(normals)
    noise_r, noise_v = row(drawn, 2), row(drawn, 2 + scans)
    dv, da = world.spread[0] * get(drawn, 0), world.spread[1] * get(drawn, 1)
    for k in range(scans):
        t, scan = world.t[k], row(to, k * rec.PLOT)
        r = world.truth[k, 0] + dv * t + da * (0.5 * t * t)
        v = world.truth[k, 1] + dv + da * t
        put(scan, rec.TRUTH, r)
        put(scan, rec.TRUTH + 1, v)
        put(scan, rec.TRUTH + 2, world.truth[k, 2] + da)
        z, u, span = r + world.sigma[0] * get(noise_r, k), v + world.sigma[1] * get(noise_v, k), world.spans[k]
        put(scan, rec.RANGE, z)
        put(scan, rec.UNFOLDED, u)
        put(scan, rec.VELOCITY, u - span * nearest(u / span))
    started = zero
    for k in range(scans):
        scan, detected = row(to, k * rec.PLOT), one
        if world.detection < 1.0:
            fill_uniform_pairs(world.keys[1], first, k, normals[:WIDTH], normals[WIDTH : 2 * WIDTH])
            detected = where_greater(full(world.detection), get(drawn, 0), one, zero)
        put(scan, rec.DETECTED, detected)
        put(scan, rec.FIRST, detected * (one - started))
        started = where_greater(detected, started, one, started)
        put(scan, rec.STARTED, started)
    if world.joint.any():
        for lane in range(WIDTH):
            solve_remainders(world, address(plots[lane:]))
