"""Filters of eight realisations over all scans: gains, filters with one hypothesis, and the one that merges folds.

A plot is taken range first and velocity second: this needs no inverse, and the fold is chosen by a prediction that
includes the range. Letters, each of eight lanes:

    x (3), P (6)   state (range, radial velocity, acceleration) and covariance, packed as in `kernels.algebra`
    F (5), Q (6)   motion over a scan
    S, g (3)       variance of an innovation, and its gains
    D              span of velocity

`design`, `plots`, `gains`, `out` are addresses.

Plots of eight realisations: range and folded velocity, missed plots, and the truth of each realisation.

Hypotheses on the folds of one realisation, kept from scan to scan: the Bayes filter if none is dropped.

With its folds given a filter is linear, so that all hypotheses share gains and covariance; each is three numbers and
the logarithm of a weight. At each scan all are predicted and weighted by the range; each branches over the folds that
the velocity leaves possible; those too far below the best, or beyond the number kept, are dropped. Letters:

    r, v, a, w   columns of the list: state and logarithm of the weight, the best one's 0 (lists are rows of eight)
    e            innovation of the velocity, folded to -D/2 … D/2; e + n D are those of the other folds
    c            1/(2S) of it
"""

import math

from radarsim.kernels import lanes
from radarsim.kernels.algebra import add_outer, add_scaled, predicted, predicted_covariance, take_rate, take_value
from radarsim.kernels.compile import inline, part
from radarsim.kernels.hypotheses import FALL, FARTHEST, INNOVATION, NEAR, NOTHING, branched, column, greatest
from radarsim.kernels.lanes import WIDTH, address, exponential, full, get, nearest, put, put3, row, total, where_greater
from radarsim.kernels.random import fill_normal_strip, fill_uniform_pairs
from radarsim.studies.ambiguous_doppler.kernels import records as rec


# ---- steps -----------------------------------------------------------------------------------------------------------
@inline
def motion(design):
    """F and Q of a design."""
    f, q = design, rec.NOISE
    return (f[0], f[1], f[2], f[3], f[4]), (f[q], f[q + 1], f[q + 2], f[q + 3], f[q + 4], f[q + 5])


@inline
def update_by_range(P, first, detected, variance):
    """Covariance after a range of that variance, its gain, and 1/(2S).

    first, detected (0 or 1): whether it is the track's first, which sets the range; whether a later one is there."""
    zero = full(0.0)
    P, gain, S = take_value(P, variance, detected)
    range_covariances = lanes.choose3(first, zero, (full(variance), zero, zero), (P[0], P[1], P[2]))
    return (*range_covariances, P[3], P[4], P[5]), gain, 0.5 * detected / S


@inline
def prior_covariance(design):
    """Covariance before the first plot, without the range."""
    zero = full(0.0)
    return zero, zero, zero, full(design[rec.PRIOR]), zero, full(design[rec.PRIOR + 1])


@part
def fill_gains(design, sigma, scans, plots, gains):
    """Fill in the gains of a design over all scans, with all folds right: GAINS rows a scan; sigma (2,)."""
    F, Q = motion(design)
    P = prior_covariance(design)
    for k in range(scans):
        plot, output = row(plots, k * rec.PLOT), row(gains, k * rec.GAINS)
        detected, first = get(plot, rec.DETECTED), get(plot, rec.FIRST)
        if k > 0:
            P = predicted_covariance(P, F, Q)
        P, g, weight = update_by_range(P, first, detected - first, sigma[0] * sigma[0])
        put(output, rec.WEIGHT, weight)
        put3(output, rec.RANGE_GAIN, g)
        takes_velocity = (
            get(plot, rec.PAIRED) if design[rec.TAKES_VELOCITY] > 1.0 else detected * design[rec.TAKES_VELOCITY]
        )
        P, g, S = take_rate(P, sigma[1] * sigma[1], takes_velocity)
        put(output, rec.VARIANCE, S)
        put3(output, rec.VELOCITY_GAIN, g)


@inline
def take_range(x, plot, scan):
    """The state after a plot's range; the track's first sets it."""
    z = get(plot, rec.RANGE)
    x = add_scaled(x, z - x[0], lanes.get3(scan, rec.RANGE_GAIN))
    return where_greater(get(plot, rec.FIRST), full(0.0), z, x[0]), x[1], x[2]


@inline
def still_right(right, plot, velocity, D):
    """`right` (0 or 1) where the unfolded `velocity` lies in the fold of the measured one; else 0."""
    deviation = get(plot, rec.UNFOLDED) - velocity
    deviation = where_greater(deviation, full(0.0), deviation, full(0.0) - deviation)
    return where_greater(deviation * get(plot, rec.DETECTED), full(0.5 * D), full(0.0), right)


@inline
def put_single(output, x, right):
    """Write the output of a bank with one hypothesis."""
    put3(output, rec.MEAN, x)
    put3(output, rec.BEST, x)
    put(output, rec.RIGHT, right)
    put(output, rec.LISTED, right)
    put(output, rec.COUNT, full(1.0))
    put(output, rec.PROBABILITY, full(1.0))


@part
def run_single(kind, design, spans, plots, gains, out):
    """Run a bank with one hypothesis over all scans: range alone, or the true fold, the nearest, or the remainder.

    For a remainder, `right` counts its scan alone: it depends on two plots, not on earlier estimates."""
    F, _ = motion(design)
    zero = full(0.0)
    x, right = (zero, zero, zero), full(1.0)
    for k in range(spans.size):
        plot, scan, D = row(plots, k * rec.PLOT), row(gains, k * rec.GAINS), spans[k]
        x = take_range(predicted(x, F), plot, scan)
        if kind != rec.NONE:
            u = get(plot, rec.UNFOLDED)
            if kind == rec.REMAINDER:
                right = still_right(get(plot, rec.PAIRED), plot, get(plot, rec.SOLVED), D)
                u = get(plot, rec.SOLVED)
            elif kind != rec.UNFOLDS:
                z = get(plot, rec.VELOCITY)
                u = z + D * nearest((x[1] - z) / D)
                right = still_right(right, plot, u, D)
            x = add_scaled(x, u - x[1], lanes.get3(scan, rec.VELOCITY_GAIN))
        put_single(row(out, k * rec.OUTPUT), x, right)


@inline
def merge_folds(e, S, D):
    """Mean and variance of the innovation e + n D over all whole n, and the sum of weights over that of e.

    The weights are exp(-(e + n D)²/2S); |e| <= D/2."""
    weight_sum, mean, square = full(1.0), e, e * e
    limit, scale = lanes.root(S * FARTHEST), -0.5 / S
    n = 1.0
    while lanes.any_greater(limit + 0.5 * D, full(n * D)):
        for sign in (-1.0, 1.0):
            f = e + sign * n * D
            weight = exponential(scale * (f * f - e * e))
            weight_sum, mean, square = weight_sum + weight, mean + weight * f, square + weight * f * f
        n += 1.0
    mean = mean / weight_sum
    return mean, square / weight_sum - mean * mean, weight_sum


@part
def run_merged(design, sigma, spans, plots, out):
    """Run a bank that merges the folds of each scan into one state (GPB1) over all scans; each lane has its own
    covariance."""
    F, Q = motion(design)
    zero = full(0.0)
    x, P, right = (zero, zero, zero), prior_covariance(design), full(1.0)
    for k in range(spans.size):
        plot, D = row(plots, k * rec.PLOT), spans[k]
        detected, first = get(plot, rec.DETECTED), get(plot, rec.FIRST)
        x = predicted(x, F)
        if k > 0:
            P = predicted_covariance(P, F, Q)
        P, g, _ = update_by_range(P, first, detected - first, sigma[0] * sigma[0])
        z = get(plot, rec.RANGE)
        x = add_scaled(x, z - x[0], g)
        x = where_greater(first, zero, z, x[0]), x[1], x[2]
        e = get(plot, rec.VELOCITY) - x[1]
        e = e - D * nearest(e / D)
        right = still_right(right, plot, x[1] + e, D)
        P, g, S = take_rate(P, sigma[1] * sigma[1], detected)
        mean, variance, _ = merge_folds(e, S, D)
        x = add_scaled(x, mean, g)
        P = add_outer(P, variance, g)
        put_single(row(out, k * rec.OUTPUT), x, right)


# ---- plots -----------------------------------------------------------------------------------------------------------
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


@part
def solve_remainders(world, plots):
    """Solve each plot and the previous one for the velocity, of one realisation; plots is the address of its lane."""
    previous = -1
    for k in range(world.truth.shape[0]):
        scan = row(plots, k * rec.PLOT)
        scan[rec.SOLVED * WIDTH] = scan[rec.PAIRED * WIDTH] = 0.0
        if scan[rec.DETECTED * WIDTH] > 0.0:
            joint = world.joint_spans[world.rate_index[k], world.rate_index[previous]] if previous >= 0 else 0.0
            if joint > 0.0:
                z = row(plots, previous * rec.PLOT)[rec.VELOCITY * WIDTH]
                spans = world.spans
                scan[rec.SOLVED * WIDTH] = chinese_remainder(
                    scan[rec.VELOCITY * WIDTH], spans[k], z, spans[previous], joint
                )
                scan[rec.PAIRED * WIDTH] = 1.0
            previous = k


@part
def fill_normals(world, first, normals):
    """Draw unit normals of realisations first … first + 7: rows for the target (2), the ranges (K), the velocities (K).

    The first normal of draw pair k is for the range of scan k, the second for its velocity, whether or not there is a
    plot."""
    size = WIDTH * world.truth.shape[0]
    ranges, velocities = normals[2 * WIDTH : 2 * WIDTH + size], normals[2 * WIDTH + size :]
    fill_normal_strip(world.keys[2], first, 0, normals[:WIDTH], normals[WIDTH : 2 * WIDTH])
    fill_normal_strip(world.keys[0], first, 0, ranges, velocities)


@part
def put_plots(world, first, normals, plots):
    """Fill in plots and truth from normals, which are overwritten: PLOT rows a scan.

    The first uniform of draw pair k decides whether there is a plot at scan k."""
    scans = world.truth.shape[0]
    zero, unit = full(0.0), full(1.0)
    plot_rows, normal_rows = address(plots), address(normals)
    noise_r, noise_v = row(normal_rows, 2), row(normal_rows, 2 + scans)
    added_velocity, added_acceleration = world.spread[0] * get(normal_rows, 0), world.spread[1] * get(normal_rows, 1)
    for k in range(scans):
        t, scan = world.t[k], row(plot_rows, k * rec.PLOT)
        r = world.truth[k, 0] + added_velocity * t + added_acceleration * (0.5 * t * t)
        v = world.truth[k, 1] + added_velocity + added_acceleration * t
        put(scan, rec.TRUTH, r)
        put(scan, rec.TRUTH + 1, v)
        put(scan, rec.TRUTH + 2, world.truth[k, 2] + added_acceleration)
        z, u, span = r + world.sigma[0] * get(noise_r, k), v + world.sigma[1] * get(noise_v, k), world.spans[k]
        put(scan, rec.RANGE, z)
        put(scan, rec.UNFOLDED, u)
        put(scan, rec.VELOCITY, u - span * nearest(u / span))
    started = zero
    for k in range(scans):
        scan, detected = row(plot_rows, k * rec.PLOT), unit
        if world.detection_probability < 1.0:
            fill_uniform_pairs(world.keys[1], first, k, normals[:WIDTH], normals[WIDTH : 2 * WIDTH])
            detected = where_greater(full(world.detection_probability), get(normal_rows, 0), unit, zero)
        put(scan, rec.DETECTED, detected)
        put(scan, rec.FIRST, detected * (unit - started))
        started = where_greater(detected, started, unit, started)
        put(scan, rec.STARTED, started)
    if world.joint_spans.any():
        for lane in range(WIDTH):
            solve_remainders(world, address(plots[lane:]))


# ---- hypotheses ------------------------------------------------------------------------------------------------------
@part
def move_and_weigh(lists, list_index, count, F, z, scan):
    """Predict `count` hypotheses over a scan and update them with the range z, in place; scan: the lane of gains."""
    r, v, a = column(lists, list_index, 0), column(lists, list_index, 1), column(lists, list_index, 2)
    w = column(lists, list_index, 3)
    weight = scan[rec.WEIGHT * WIDTH]
    gain = lanes.lane3(scan, rec.RANGE_GAIN)
    for i in range((count + WIDTH - 1) // WIDTH):
        x = predicted((get(r, i), get(v, i), get(a, i)), F)
        e = z - x[0]
        x = add_scaled(x, e, gain)
        put(r, i, x[0])
        put(v, i, x[1])
        put(a, i, x[2])
        put(w, i, get(w, i) - weight * (e * e))


@part
def weigh_nearest_folds(lists, list_index, count, z, D, c):
    """Fill in the innovations with the nearest folds and their weights, as `kernels.hypotheses.branched` reads them.

    Returns the greatest weight."""
    v, w = column(lists, list_index, 1), column(lists, list_index, 3)
    innovations, nearest_weights, falls = column(lists, 2, INNOVATION), column(lists, 2, NEAR), column(lists, 2, FALL)
    best, fall = full(NOTHING), full(c)
    for i in range((count + WIDTH - 1) // WIDTH):
        e = z - get(v, i)
        e = e - D * nearest(e / D)
        nearest_weight = get(w, i) - c * (e * e)
        put(innovations, i, e)
        put(nearest_weights, i, nearest_weight)
        put(falls, i, fall)
        best = where_greater(nearest_weight, best, nearest_weight, best)
    put(nearest_weights, lists.room // WIDTH - 1, best)  # the last row of a column is free
    return greatest(row(nearest_weights, lists.room // WIDTH - 1))


@part
def put_children(lists, list_index, count, best, scan):
    """Write `count` children into the other list, weights relative to `best`; returns the index of the best child."""
    r, v, a = column(lists, list_index, 0), column(lists, list_index, 1), column(lists, list_index, 2)
    child_r, child_v, child_a = (
        column(lists, 1 - list_index, 0),
        column(lists, 1 - list_index, 1),
        column(lists, 1 - list_index, 2),
    )
    child_w = column(lists, 1 - list_index, 3)
    weights, innovations, parents = lists.children, row(lists.children, lists.most // WIDTH), lists.parents
    gain = lanes.lane3(scan, rec.VELOCITY_GAIN)
    best_child, best_weight = 0, NOTHING
    for i in range(count):
        j, f = parents[i], innovations[i]
        child_r[i], child_v[i], child_a[i] = add_scaled((r[j], v[j], a[j]), f, gain)
        child_w[i] = weights[i] - best
        if weights[i] > best_weight:
            best_child, best_weight = i, weights[i]
    for i in range(count, (count + WIDTH - 1) // WIDTH * WIDTH):
        child_r[i] = child_v[i] = child_a[i] = 0.0
        child_w[i] = NOTHING
    return best_child


@part
def put_estimates(lists, list_index, count, best, right, output):
    """Write one lane of the output: the weighted mean, the best hypothesis, and whether the right one is listed."""
    r, v, a, w = (
        column(lists, list_index, 0),
        column(lists, list_index, 1),
        column(lists, list_index, 2),
        column(lists, list_index, 3),
    )
    zero = full(0.0)
    group_weights, mean_r, mean_v, mean_a = zero, zero, zero, zero
    for i in range((count + WIDTH - 1) // WIDTH):
        weight = exponential(get(w, i) - w[best])
        group_weights, mean_r = group_weights + weight, mean_r + weight * get(r, i)
        mean_v, mean_a = mean_v + weight * get(v, i), mean_a + weight * get(a, i)
    weight_sum = total(group_weights)
    lanes.put_lane3(
        output, rec.MEAN, (total(mean_r) / weight_sum, total(mean_v) / weight_sum, total(mean_a) / weight_sum)
    )
    lanes.put_lane3(output, rec.BEST, (r[best], v[best], a[best]))
    output[rec.RIGHT * WIDTH] = 1.0 if best == right else 0.0
    output[rec.LISTED * WIDTH] = 1.0 if right >= 0 else 0.0
    output[rec.COUNT * WIDTH] = count
    output[rec.PROBABILITY * WIDTH] = 1.0 / weight_sum


@inline
def right_child(lists, list_index, count, right, u, D):
    """The index of the child of hypothesis `right` that has the true fold, that of the velocity u; -1: none."""
    v, innovations = column(lists, list_index, 1), row(lists.children, lists.most // WIDTH)
    if right >= 0:
        for i in range(count):
            if lists.parents[i] == right and abs(v[right] + innovations[i] - u) < 0.5 * D:
                return i
    return -1


@part
def run_hypotheses(design, max_hypotheses, max_depth, spans, plots, gains, out, lists):
    """Run a bank that keeps hypotheses over all scans of one realisation; plots, gains, out: addresses of its lane."""
    F, _ = motion(design)
    list_index, count, best, right = 0, 0, 0, -1
    for k in range(spans.size):
        plot, scan, D = row(plots, k * rec.PLOT), row(gains, k * rec.GAINS), spans[k]
        if count > 0:
            move_and_weigh(lists, list_index, count, F, plot[rec.RANGE * WIDTH], scan)
        elif plot[rec.FIRST * WIDTH] > 0.0:
            for c in range(4):
                start = column(lists, list_index, c)
                for i in range(WIDTH):
                    start[i] = 0.0 if c < 3 or i == 0 else NOTHING
            column(lists, list_index, 0)[0] = plot[rec.RANGE * WIDTH]
            count, right = 1, 0
        if count > 0 and plot[rec.DETECTED * WIDTH] > 0.0:
            c = 0.5 / scan[rec.VARIANCE * WIDTH]
            best_weight = weigh_nearest_folds(lists, list_index, count, plot[rec.VELOCITY * WIDTH], D, c)
            child_count = branched(lists, list_index, count, D, best_weight, max_depth, max_hypotheses)
            right = right_child(lists, list_index, child_count, right, plot[rec.UNFOLDED * WIDTH], D)
            best = put_children(lists, list_index, child_count, best_weight, scan)
            list_index, count = 1 - list_index, child_count
        if count > 0:
            put_estimates(lists, list_index, count, best, right, row(out, k * rec.OUTPUT))
