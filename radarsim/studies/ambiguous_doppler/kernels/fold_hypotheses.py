"""Hypotheses on the folds of one realisation, kept from scan to scan: the Bayes filter if none is dropped.

With its folds given, a filter is linear, so that all hypotheses share gains and covariance; each is three numbers and
the logarithm of a weight. At each scan all are predicted and weighted by the range; each branches over the folds that
the velocity leaves possible; those too far below the best, or beyond the number kept, are dropped. Letters, each of
eight lanes:

    r, v, a, w   columns of the list: state and logarithm of the weight, the best one's 0 (lists are rows of eight)
    e            innovation of the velocity, folded to -D/2 … D/2; e + n D are those of the other folds
    c            1/(2S) of it"""

from radarsim.kernels import lane_matrices
from radarsim.kernels.compiler import inline, kernel_part
from radarsim.kernels.hypotheses import FALL, INNOVATION, NEAR, NO_HYPOTHESIS, branch, column, largest_lane
from radarsim.kernels.kalman_algebra import add_scaled, predict_state
from radarsim.kernels.lanes import WIDTH, exponential, full, get, nearest, put, row, total, where_greater
from radarsim.studies.ambiguous_doppler.kernels import layout
from radarsim.studies.ambiguous_doppler.kernels.single_fold import motion


@kernel_part
def move_and_weigh(lists, list_index, count, F, z, scan):
    """Predict `count` hypotheses over a scan and update them with the range z, in place; scan: the lane of gains."""
    r, v, a = column(lists, list_index, 0), column(lists, list_index, 1), column(lists, list_index, 2)
    w = column(lists, list_index, 3)
    weight = scan[layout.WEIGHT * WIDTH]
    gain = lane_matrices.lane3(scan, layout.RANGE_GAIN)
    for i in range((count + WIDTH - 1) // WIDTH):
        x = predict_state((get(r, i), get(v, i), get(a, i)), F)
        e = z - x[0]
        x = add_scaled(x, e, gain)
        put(r, i, x[0])
        put(v, i, x[1])
        put(a, i, x[2])
        put(w, i, get(w, i) - weight * (e * e))


@kernel_part
def weigh_nearest_folds(lists, list_index, count, z, D, c):
    """Fill in the innovations with the nearest folds and their weights, as `kernels.hypotheses.branch` reads them.

    Returns the greatest weight."""
    v, w = column(lists, list_index, 1), column(lists, list_index, 3)
    innovations, nearest_weights, falls = column(lists, 2, INNOVATION), column(lists, 2, NEAR), column(lists, 2, FALL)
    best, fall = full(NO_HYPOTHESIS), full(c)
    for i in range((count + WIDTH - 1) // WIDTH):
        e = z - get(v, i)
        e = e - D * nearest(e / D)
        nearest_weight = get(w, i) - c * (e * e)
        put(innovations, i, e)
        put(nearest_weights, i, nearest_weight)
        put(falls, i, fall)
        best = where_greater(nearest_weight, best, nearest_weight, best)
    put(nearest_weights, lists.room // WIDTH - 1, best)  # the last row of a column is free
    return largest_lane(row(nearest_weights, lists.room // WIDTH - 1))


@kernel_part
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
    gain = lane_matrices.lane3(scan, layout.VELOCITY_GAIN)
    best_child, best_weight = 0, NO_HYPOTHESIS
    for i in range(count):
        j, f = parents[i], innovations[i]
        child_r[i], child_v[i], child_a[i] = add_scaled((r[j], v[j], a[j]), f, gain)
        child_w[i] = weights[i] - best
        if weights[i] > best_weight:
            best_child, best_weight = i, weights[i]
    for i in range(count, (count + WIDTH - 1) // WIDTH * WIDTH):
        child_r[i] = child_v[i] = child_a[i] = 0.0
        child_w[i] = NO_HYPOTHESIS
    return best_child


@kernel_part
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
    lane_matrices.put_lane3(
        output, layout.MEAN, (total(mean_r) / weight_sum, total(mean_v) / weight_sum, total(mean_a) / weight_sum)
    )
    lane_matrices.put_lane3(output, layout.BEST, (r[best], v[best], a[best]))
    output[layout.RIGHT * WIDTH] = 1.0 if best == right else 0.0
    output[layout.LISTED * WIDTH] = 1.0 if right >= 0 else 0.0
    output[layout.COUNT * WIDTH] = count
    output[layout.PROBABILITY * WIDTH] = 1.0 / weight_sum


@inline
def right_child(lists, list_index, count, right, u, D):
    """The index of the child of hypothesis `right` that has the true fold, that of the velocity u; -1: none."""
    v, innovations = column(lists, list_index, 1), row(lists.children, lists.most // WIDTH)
    if right >= 0:
        for i in range(count):
            if lists.parents[i] == right and abs(v[right] + innovations[i] - u) < 0.5 * D:
                return i
    return -1


@kernel_part
def run_hypotheses(design, max_hypotheses, max_depth, spans, plots, gains, out, lists):
    """Run a bank that keeps hypotheses over all scans of one realisation; plots, gains, out: addresses of its lane."""
    F, _ = motion(design)
    list_index, count, best, right = 0, 0, 0, -1
    for k in range(spans.size):
        plot, scan, D = row(plots, k * layout.PLOT), row(gains, k * layout.GAINS), spans[k]
        if count > 0:
            move_and_weigh(lists, list_index, count, F, plot[layout.RANGE * WIDTH], scan)
        elif plot[layout.FIRST * WIDTH] > 0.0:
            for c in range(4):
                start = column(lists, list_index, c)
                for i in range(WIDTH):
                    start[i] = 0.0 if c < 3 or i == 0 else NO_HYPOTHESIS
            column(lists, list_index, 0)[0] = plot[layout.RANGE * WIDTH]
            count, right = 1, 0
        if count > 0 and plot[layout.DETECTED * WIDTH] > 0.0:
            c = 0.5 / scan[layout.VARIANCE * WIDTH]
            best_weight = weigh_nearest_folds(lists, list_index, count, plot[layout.VELOCITY * WIDTH], D, c)
            child_count = branch(lists, list_index, count, D, best_weight, max_depth, max_hypotheses)
            right = right_child(lists, list_index, child_count, right, plot[layout.UNFOLDED * WIDTH], D)
            best = put_children(lists, list_index, child_count, best_weight, scan)
            list_index, count = 1 - list_index, child_count
        if count > 0:
            put_estimates(lists, list_index, count, best, right, row(out, k * layout.OUTPUT))
