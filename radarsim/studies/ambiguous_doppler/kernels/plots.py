"""Plots of eight realisations: range and folded velocity, missed plots, and the truth of each realisation."""

import math

from radarsim.kernels.compiler import inline, kernel_part
from radarsim.kernels.lanes import WIDTH, address, full, get, nearest, put, row, where_greater
from radarsim.kernels.random import fill_normal_strip, fill_uniform_pairs
from radarsim.studies.ambiguous_doppler.kernels import layout


@inline
def chinese_remainder(z, D, previous_z, previous_D, joint):
    """The velocity in ± joint/2 that folds to z in a span D, and nearest to the previous z in the previous span."""
    solution, min_deviation, u = 0.0, previous_D, z + D * math.ceil((-0.5 * joint - z) / D)
    while u < 0.5 * joint:
        deviation = u - previous_z
        deviation = abs(deviation - previous_D * math.floor(deviation / previous_D + 0.5))
        if deviation < min_deviation:
            solution, min_deviation = u, deviation
        u += D
    return solution


@kernel_part
def solve_remainders(world, plots):
    """Solve each plot and the previous one for the velocity, of one realisation; plots is the address of its lane."""
    previous = -1
    for k in range(world.truth.shape[0]):
        scan = row(plots, k * layout.PLOT)
        scan[layout.SOLVED * WIDTH] = scan[layout.PAIRED * WIDTH] = 0.0
        if scan[layout.DETECTED * WIDTH] > 0.0:
            joint = world.joint_spans[world.rate_index[k], world.rate_index[previous]] if previous >= 0 else 0.0
            if joint > 0.0:
                z = row(plots, previous * layout.PLOT)[layout.VELOCITY * WIDTH]
                spans = world.spans
                scan[layout.SOLVED * WIDTH] = chinese_remainder(
                    scan[layout.VELOCITY * WIDTH], spans[k], z, spans[previous], joint
                )
                scan[layout.PAIRED * WIDTH] = 1.0
            previous = k


@kernel_part
def fill_normals(world, first, normals):
    """Draw unit normals of realisations first … first + 7: rows for the target (2), the ranges (K), the velocities (K).

    The first normal of draw pair k is for the range of scan k, the second for its velocity, whether or not there is a
    plot."""
    size = WIDTH * world.truth.shape[0]
    ranges, velocities = normals[2 * WIDTH : 2 * WIDTH + size], normals[2 * WIDTH + size :]
    fill_normal_strip(world.keys[2], first, 0, normals[:WIDTH], normals[WIDTH : 2 * WIDTH])
    fill_normal_strip(world.keys[0], first, 0, ranges, velocities)


@kernel_part
def put_plots(world, first, normals, plots):
    """Fill in plots and truth from normals, which are overwritten: PLOT rows a scan.

    The first uniform of draw pair k decides whether there is a plot at scan k."""
    scans = world.truth.shape[0]
    zero, unit = full(0.0), full(1.0)
    plot_rows, normal_rows = address(plots), address(normals)
    noise_r, noise_v = row(normal_rows, 2), row(normal_rows, 2 + scans)
    added_velocity, added_acceleration = world.spread[0] * get(normal_rows, 0), world.spread[1] * get(normal_rows, 1)
    for k in range(scans):
        t, scan = world.t[k], row(plot_rows, k * layout.PLOT)
        r = world.truth[k, 0] + added_velocity * t + added_acceleration * (0.5 * t * t)
        v = world.truth[k, 1] + added_velocity + added_acceleration * t
        put(scan, layout.TRUTH, r)
        put(scan, layout.TRUTH + 1, v)
        put(scan, layout.TRUTH + 2, world.truth[k, 2] + added_acceleration)
        z, u, span = r + world.sigma[0] * get(noise_r, k), v + world.sigma[1] * get(noise_v, k), world.spans[k]
        put(scan, layout.RANGE, z)
        put(scan, layout.UNFOLDED, u)
        put(scan, layout.VELOCITY, u - span * nearest(u / span))
    started = zero
    for k in range(scans):
        scan, detected = row(plot_rows, k * layout.PLOT), unit
        if world.detection_probability < 1.0:
            fill_uniform_pairs(world.keys[1], first, k, normals[:WIDTH], normals[WIDTH : 2 * WIDTH])
            detected = where_greater(full(world.detection_probability), get(normal_rows, 0), unit, zero)
        put(scan, layout.DETECTED, detected)
        put(scan, layout.FIRST, detected * (unit - started))
        started = where_greater(detected, started, unit, started)
        put(scan, layout.STARTED, started)
    if world.joint_spans.any():
        for lane in range(WIDTH):
            solve_remainders(world, address(plots[lane:]))
