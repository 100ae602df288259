"""Filters of eight realisations over all scans: gains, the filters with one hypothesis, the one that merges.

A plot is taken range first, velocity after, which needs no inverse and gives the fold a prediction that knows the
range. Letters, each of eight lanes:

    x (3), P (6)   state (range, radial velocity, acceleration) and covariance, packed as in `kernels.algebra`
    F (5), Q (6)   motion over a scan
    S, g (3)       variance of an innovation, and its gains
    D              span of velocity

`design`, `plots`, `gains`, `out` are addresses.

Plots of eight realisations: range and folded velocity, missed ones, and the truth that each realisation has.

Hypotheses on the folds of one realisation, kept from scan to scan: the Bayes filter where none is dropped.

Given its folds a filter is linear, so that all hypotheses share gains and covariance; each is three numbers and the
logarithm of a weight. A scan moves all, weighs them by the range, branches each over the folds that the velocity
leaves possible, and drops what is too far below the best or beyond the number that is kept. Letters:

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
def range_taken(P, first, taken, variance):
    """Covariance after a range of that variance, its gain, and 1/(2S); `first` (0 or 1) is a track's first, which sets
    it."""
    zero = full(0.0)
    P, gain, S = take_value(P, variance, taken)
    of_range = lanes.choose3(first, zero, (full(variance), zero, zero), (P[0], P[1], P[2]))
    return (*of_range, P[3], P[4], P[5]), gain, 0.5 * taken / S


@inline
def prior(design):
    """Covariance before the first plot; the range is not in it."""
    zero = full(0.0)
    return zero, zero, zero, full(design[rec.PRIOR]), zero, full(design[rec.PRIOR + 1])


@part
def fill_gains(design, sigma, scans, plots, gains):
    """Gains of a design over all scans, of a filter whose folds are right: rows GAINS a scan; sigma (2,)."""
    F, Q = motion(design)
    P = prior(design)
    for k in range(scans):
        plot, to = row(plots, k * rec.PLOT), row(gains, k * rec.GAINS)
        detected, first = get(plot, rec.DETECTED), get(plot, rec.FIRST)
        if k > 0:
            P = predicted_covariance(P, F, Q)
        P, g, weight = range_taken(P, first, detected - first, sigma[0] * sigma[0])
        put(to, rec.WEIGHT, weight)
        put3(to, rec.RANGE_GAIN, g)
        taken = get(plot, rec.PAIRED) if design[rec.TAKES_VELOCITY] > 1.0 else detected * design[rec.TAKES_VELOCITY]
        P, g, S = take_rate(P, sigma[1] * sigma[1], taken)
        put(to, rec.VARIANCE, S)
        put3(to, rec.VELOCITY_GAIN, g)


@inline
def with_range(x, plot, scan):
    """A state after a plot's range; the track's first sets it."""
    z = get(plot, rec.RANGE)
    x = add_scaled(x, z - x[0], lanes.get3(scan, rec.RANGE_GAIN))
    return where_greater(get(plot, rec.FIRST), full(0.0), z, x[0]), x[1], x[2]


@inline
def whether_right(right, plot, taken, D):
    """`right` (0 or 1) where the velocity `taken`, folded back somehow, is the one that was folded; else 0."""
    off = get(plot, rec.UNFOLDED) - taken
    off = where_greater(off, full(0.0), off, full(0.0) - off)
    return where_greater(off * get(plot, rec.DETECTED), full(0.5 * D), full(0.0), right)


@inline
def put_single(to, x, right):
    """Output of a bank with one hypothesis."""
    put3(to, rec.MEAN, x)
    put3(to, rec.BEST, x)
    put(to, rec.RIGHT, right)
    put(to, rec.LISTED, right)
    put(to, rec.COUNT, full(1.0))
    put(to, rec.PROBABILITY, full(1.0))


@part
def run_single(kind, design, spans, plots, gains, out):
    """A bank with one hypothesis over all scans: of range alone, with the true folds, the nearest, or remainders.
    `right` of a remainder is that of its scan alone: it rests on two plots, and not on what was before."""
    F, _ = motion(design)
    zero = full(0.0)
    x, right = (zero, zero, zero), full(1.0)
    for k in range(spans.size):
        plot, scan, D = row(plots, k * rec.PLOT), row(gains, k * rec.GAINS), spans[k]
        x = with_range(predicted(x, F), plot, scan)
        if kind != rec.NONE:
            u = get(plot, rec.UNFOLDED)
            if kind == rec.REMAINDER:
                right = whether_right(get(plot, rec.PAIRED), plot, get(plot, rec.SOLVED), D)
                u = get(plot, rec.SOLVED)
            elif kind != rec.UNFOLDS:
                z = get(plot, rec.VELOCITY)
                u = z + D * nearest((x[1] - z) / D)
                right = whether_right(right, plot, u, D)
            x = add_scaled(x, u - x[1], lanes.get3(scan, rec.VELOCITY_GAIN))
        put_single(row(out, k * rec.OUTPUT), x, right)


@inline
def folds_merged(e, S, D):
    """Mean and variance of the innovation e + n D over all whole n, with weights exp(-(e + n D)²/2S); |e| <= D/2. And
    the sum of the weights over that of e."""
    total, mean, square = full(1.0), e, e * e
    limit, scale = lanes.root(S * FARTHEST), -0.5 / S
    n = 1.0
    while lanes.any_greater(limit + 0.5 * D, full(n * D)):
        for sign in (-1.0, 1.0):
            f = e + sign * n * D
            weight = exponential(scale * (f * f - e * e))
            total, mean, square = total + weight, mean + weight * f, square + weight * f * f
        n += 1.0
    mean = mean / total
    return mean, square / total - mean * mean, total


@part
def run_merged(design, sigma, spans, plots, out):
    """A bank that merges the folds of each scan into one state, over all scans (GPB1); its covariance is its own."""
    F, Q = motion(design)
    zero = full(0.0)
    x, P, right = (zero, zero, zero), prior(design), full(1.0)
    for k in range(spans.size):
        plot, D = row(plots, k * rec.PLOT), spans[k]
        detected, first = get(plot, rec.DETECTED), get(plot, rec.FIRST)
        x = predicted(x, F)
        if k > 0:
            P = predicted_covariance(P, F, Q)
        P, g, _ = range_taken(P, first, detected - first, sigma[0] * sigma[0])
        z = get(plot, rec.RANGE)
        x = add_scaled(x, z - x[0], g)
        x = where_greater(first, zero, z, x[0]), x[1], x[2]
        e = get(plot, rec.VELOCITY) - x[1]
        e = e - D * nearest(e / D)
        right = whether_right(right, plot, x[1] + e, D)
        P, g, S = take_rate(P, sigma[1] * sigma[1], detected)
        mean, variance, _ = folds_merged(e, S, D)
        x = add_scaled(x, mean, g)
        P = add_outer(P, variance, g)
        put_single(row(out, k * rec.OUTPUT), x, right)


# ---- plots -----------------------------------------------------------------------------------------------------------
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
    plot."""
    size = WIDTH * world.truth.shape[0]
    ranges, velocities = normals[2 * WIDTH : 2 * WIDTH + size], normals[2 * WIDTH + size :]
    fill_normal_strip(world.keys[2], first, 0, normals[:WIDTH], normals[WIDTH : 2 * WIDTH])
    fill_normal_strip(world.keys[0], first, 0, ranges, velocities)


@part
def put_plots(world, first, normals, plots):
    """Plots and truth from normals, which are written over, into rows PLOT a scan. The first uniform of draw pair k
    says whether there is a plot at scan k."""
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


# ---- hypotheses ------------------------------------------------------------------------------------------------------
@part
def moved_and_weighed(lists, which, count, F, z, scan):
    """Move `count` hypotheses over a scan and take the range z: columns in place; scan: this lane of the gains."""
    r, v, a, w = column(lists, which, 0), column(lists, which, 1), column(lists, which, 2), column(lists, which, 3)
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
def nearest_folds(lists, which, count, z, D, c):
    """Innovations with the nearest folds and the weights with them, as `branched` reads them; the greatest weight."""
    v, w = column(lists, which, 1), column(lists, which, 3)
    to_e, to_w, to_c = column(lists, 2, INNOVATION), column(lists, 2, NEAR), column(lists, 2, FALL)
    best, fall = full(NOTHING), full(c)
    for i in range((count + WIDTH - 1) // WIDTH):
        e = z - get(v, i)
        e = e - D * nearest(e / D)
        near = get(w, i) - c * (e * e)
        put(to_e, i, e)
        put(to_w, i, near)
        put(to_c, i, fall)
        best = where_greater(near, best, near, best)
    put(to_w, lists.room // WIDTH - 1, best)  # the last row of a column is free
    return greatest(row(to_w, lists.room // WIDTH - 1))


@part
def inherited(lists, which, count, best, scan):
    """Write `count` children into the other list; weights become those above `best`. Gives the number of the best."""
    r, v, a = column(lists, which, 0), column(lists, which, 1), column(lists, which, 2)
    to_r, to_v, to_a = column(lists, 1 - which, 0), column(lists, 1 - which, 1), column(lists, 1 - which, 2)
    to_w = column(lists, 1 - which, 3)
    weights, found, parents = lists.children, row(lists.children, lists.most // WIDTH), lists.parents
    gain = lanes.lane3(scan, rec.VELOCITY_GAIN)
    first, top = 0, NOTHING
    for i in range(count):
        j, f = parents[i], found[i]
        to_r[i], to_v[i], to_a[i] = add_scaled((r[j], v[j], a[j]), f, gain)
        to_w[i] = weights[i] - best
        if weights[i] > top:
            first, top = i, weights[i]
    for i in range(count, (count + WIDTH - 1) // WIDTH * WIDTH):
        to_r[i] = to_v[i] = to_a[i] = 0.0
        to_w[i] = NOTHING
    return first


@part
def put_estimates(lists, which, count, best, right, to):
    """Write this lane of the output: the mean of all by their weights, the best, what is known of the right one."""
    r, v, a, w = column(lists, which, 0), column(lists, which, 1), column(lists, which, 2), column(lists, which, 3)
    zero = full(0.0)
    all_, mean_r, mean_v, mean_a = zero, zero, zero, zero
    for i in range((count + WIDTH - 1) // WIDTH):
        weight = exponential(get(w, i) - w[best])
        all_, mean_r = all_ + weight, mean_r + weight * get(r, i)
        mean_v, mean_a = mean_v + weight * get(v, i), mean_a + weight * get(a, i)
    sum_ = total(all_)
    lanes.put_lane3(to, rec.MEAN, (total(mean_r) / sum_, total(mean_v) / sum_, total(mean_a) / sum_))
    lanes.put_lane3(to, rec.BEST, (r[best], v[best], a[best]))
    to[rec.RIGHT * WIDTH] = 1.0 if best == right else 0.0
    to[rec.LISTED * WIDTH] = 1.0 if right >= 0 else 0.0
    to[rec.COUNT * WIDTH] = count
    to[rec.PROBABILITY * WIDTH] = 1.0 / sum_


@inline
def child_that_is_right(lists, which, count, right, u, D):
    """Which of the children is the right hypothesis `right` with the fold of the true velocity u; -1: none."""
    v, found = column(lists, which, 1), row(lists.children, lists.most // WIDTH)
    if right >= 0:
        for i in range(count):
            if lists.parents[i] == right and abs(v[right] + found[i] - u) < 0.5 * D:
                return i
    return -1


@part
def run_remembering(design, most, deepest, spans, plots, gains, out, lists):
    """A bank that remembers, over all scans of one realisation: plots, gains, out are addresses of its lane."""
    F, _ = motion(design)
    which, count, best, right = 0, 0, 0, -1
    for k in range(spans.size):
        plot, scan, D = row(plots, k * rec.PLOT), row(gains, k * rec.GAINS), spans[k]
        if count > 0:
            moved_and_weighed(lists, which, count, F, plot[rec.RANGE * WIDTH], scan)
        elif plot[rec.FIRST * WIDTH] > 0.0:
            for c in range(4):
                start = column(lists, which, c)
                for i in range(WIDTH):
                    start[i] = 0.0 if c < 3 or i == 0 else NOTHING
            column(lists, which, 0)[0] = plot[rec.RANGE * WIDTH]
            count, right = 1, 0
        if count > 0 and plot[rec.DETECTED * WIDTH] > 0.0:
            c = 0.5 / scan[rec.VARIANCE * WIDTH]
            top = nearest_folds(lists, which, count, plot[rec.VELOCITY * WIDTH], D, c)
            made = branched(lists, which, count, D, top, deepest, most)
            right = child_that_is_right(lists, which, made, right, plot[rec.UNFOLDED * WIDTH], D)
            best = inherited(lists, which, made, top, scan)
            which, count = 1 - which, made
        if count > 0:
            put_estimates(lists, which, count, best, right, row(out, k * rec.OUTPUT))
