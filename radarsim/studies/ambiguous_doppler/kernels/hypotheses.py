"""Hypotheses on the folds of one realisation, kept from scan to scan: the Bayes filter where none is dropped.

Given its folds a filter is linear, so that all hypotheses share gains and covariance; each is three numbers and the
logarithm of a weight. A scan moves all, weighs them by the range, branches each over the folds that the velocity
leaves possible, and drops what is too far below the best or beyond the number that is kept. Letters:

    r, v, a, w   columns of the list: state and logarithm of the weight, the best one's 0 (lists are rows of eight)
    e            innovation of the velocity, folded to -D/2 … D/2; e + n D are those of the other folds
    c            1/(2S) of it
"""

from radarsim.kernels.algebra import add_scaled, predicted
from radarsim.kernels.compile import inline, part
from radarsim.kernels.hypotheses import FALL, INNOVATION, NEAR, NOTHING, branched, column, greatest
from radarsim.kernels.lanes import (
    WIDTH,
    exponential,
    full,
    get,
    lane3,
    nearest,
    put,
    put_lane3,
    row,
    total,
    where_greater,
)
from radarsim.studies.ambiguous_doppler.kernels import records as rec
from radarsim.studies.ambiguous_doppler.kernels.steps import motion


@part
def moved_and_weighed(lists, which, count, F, z, scan):
    """Move `count` hypotheses over a scan and take the range z: columns in place; scan: this lane of the gains."""
    r, v, a, w = column(lists, which, 0), column(lists, which, 1), column(lists, which, 2), column(lists, which, 3)
    weight = scan[rec.WEIGHT * WIDTH]
    gain = lane3(scan, rec.RANGE_GAIN)
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
    gain = lane3(scan, rec.VELOCITY_GAIN)
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
    put_lane3(to, rec.MEAN, (total(mean_r) / sum_, total(mean_v) / sum_, total(mean_a) / sum_))
    put_lane3(to, rec.BEST, (r[best], v[best], a[best]))
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
