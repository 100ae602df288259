"""Hypotheses on the folds of one realisation, in each of which the orders interact: an IMM over orders and folds.

With its folds given, a hypothesis is a filter of interacting orders, as in `orders`, whose velocity is unfolded. At
each scan the orders of every hypothesis are mixed and predicted; all hypotheses are weighted by the range; each
branches over the folds that any of its orders leaves possible; those too far below the best, or beyond the number kept,
are dropped. Mixing makes covariances depend on the data, so that each hypothesis has its own covariance; the lanes hold
eight hypotheses.

Letters as in `single_fold`, and

    w             weight of a hypothesis, the best one's 1; 0 in a slot without a hypothesis
    mu            probability of an order within it
    u             velocity z + n D of the fold n; the same for all orders
    p             weight of a branch: w times the sum over orders of mu N(u; v, S), up to a common factor
    min_distance  smallest distance of any fold, in variances: taken off every exponent, so that no weight vanishes"""

import math

from radarsim.kernels import lane_matrices, lanes
from radarsim.kernels.compiler import kernel_part
from radarsim.kernels.hypotheses import MAX_SQUARED_DEVIATION, column, keep_greatest
from radarsim.kernels.kalman_algebra import add_scaled, take_rate
from radarsim.kernels.lane_matrices import get3, put3, put6
from radarsim.kernels.lanes import WIDTH, full, get, nearest, put, row, square_root, total, where_greater
from radarsim.studies.ambiguous_doppler.kernels import layout
from radarsim.studies.ambiguous_doppler.kernels.orders import (
    COVARIANCE,
    DISTANCE,
    HUGE,
    PRIOR_PROBABILITY,
    PROBABILITY,
    ROWS,
    STATE,
    mix_orders,
    take_plot,
    weigh_orders,
)
from radarsim.studies.ambiguous_doppler.kernels.single_fold import prior_covariance

GROUP_ROWS = 3 * ROWS  # rows of eight hypotheses, each of three orders
MIN_PROBABILITY = 1e-150  # of an order after a range: its product with that of a distant velocity must not vanish
MIN_SHARE = 1e-200  # share of the total weight below which an order's nearest fold does not count
MIN_BRANCH_RATIO = 1e-280  # of a branch's weight to the best one's


@kernel_part
def extreme(values, greatest):
    """The greatest or the smallest of a row's eight numbers."""
    value = values[0]
    for i in range(1, WIDTH):
        value = max(value, values[i]) if greatest else min(value, values[i])
    return value


@kernel_part
def put_start(designs, members, size, lists, old):
    """Put one hypothesis into the first group of the list, as it is before the first scan."""
    zero = full(0.0)
    for i in range(size):
        order = row(old, i * ROWS)
        put3(order, STATE, (zero, zero, zero))
        put6(order, COVARIANCE, prior_covariance(row(designs, members[i] * (layout.DESIGN // WIDTH))))
        put(order, PROBABILITY, full(1.0 / size))
    weights = column(lists, 0, 0)
    for i in range(WIDTH):
        weights[i] = 1.0 if i == 0 else 0.0


@kernel_part
def take_range_in_all(bank, sigma, plot, moves, groups, states, lists):
    """Mix and predict the orders of every hypothesis and update them with the range, from one list of states to the
    other."""
    designs, members, size, (old, new) = bank.designs, bank.members, bank.size, states
    zero, min_probability = full(0.0), full(MIN_PROBABILITY)
    weights, distances, min_distance = column(lists, 0, 0), column(lists, 0, 1), full(HUGE)
    for g in range(groups):
        group = row(new, g * GROUP_ROWS)
        mix_orders(row(old, g * GROUP_ROWS), group, size, bank.stay)
        for i in range(size):
            design = row(designs, members[i] * (layout.DESIGN // WIDTH))
            take_plot(row(group, i * ROWS), design, sigma, plot, 1.0, layout.NONE, moves)
        distance, likelihood = weigh_orders(group, size)
        for i in range(size):
            mu = get(row(group, i * ROWS), PROBABILITY)
            put(row(group, i * ROWS), PROBABILITY, where_greater(mu, min_probability, mu, min_probability))
        w = get(weights, g)
        put(distances, g, distance)
        put(weights, g, w * likelihood)
        distance = where_greater(w, zero, distance, full(HUGE))
        min_distance = where_greater(min_distance, distance, distance, min_distance)
    put(column(lists, 0, 2), 0, min_distance)
    nearest_of_all = extreme(column(lists, 0, 2), False)
    for g in range(groups):
        exponent = nearest_of_all - get(distances, g)
        put(weights, g, get(weights, g) * lanes.exponential(0.5 * where_greater(zero, exponent, exponent, zero)))


@kernel_part
def best_branch(size, variance, z, D, groups, new, lists):
    """The distance `min_distance`, and the greatest term of any p: that of an order's nearest fold."""
    zero, far = full(0.0), full(HUGE)
    weights, nearest_distances, branch_terms = column(lists, 0, 0), column(lists, 0, 1), column(lists, 0, 2)
    group_weights = zero
    for g in range(groups):
        group_weights = group_weights + get(weights, g)
    weight_sum, distances = total(group_weights), far
    for g in range(groups):
        for i in range(size):
            order = row(new, g * GROUP_ROWS + i * ROWS)
            e = z - get(order, STATE + 1)
            e = e - D * nearest(e / D)
            share = get(weights, g) * get(order, PROBABILITY)
            distance = e * e / (get(order, COVARIANCE + 3) + variance)
            distance = where_greater(share, full(MIN_SHARE * weight_sum), distance, far)
            distances = where_greater(distances, distance, distance, distances)
    put(nearest_distances, 0, distances)
    min_distance, max_terms = extreme(nearest_distances, False), zero
    for g in range(groups):
        for i in range(size):
            order = row(new, g * GROUP_ROWS + i * ROWS)
            S = get(order, COVARIANCE + 3) + variance
            e = z - get(order, STATE + 1)
            e = e - D * nearest(e / D)
            exponent = 0.5 * (min_distance - e * e / S)
            exponent = where_greater(zero, exponent, exponent, zero)
            p = get(weights, g) * get(order, PROBABILITY) * lanes.exponential(exponent) / square_root(S)
            max_terms = where_greater(p, max_terms, p, max_terms)
    put(branch_terms, 0, max_terms)
    return min_distance, extreme(branch_terms, True)


@kernel_part
def fold_window(c, v, S, z, D, min_distance, min_weight, size):
    """The first and the last fold of an order that can give a branch of weight `min_weight`.

    c is the order's share of p at its own prediction."""
    e = z - v
    e -= D * math.floor(e / D + 0.5)
    reach = 0.0
    if c > 0.0:
        reach = 2.0 * S * (0.5 * min_distance + math.log(size * c / min_weight))
    if reach < e * e:
        return 1.0, 0.0
    reach = math.sqrt(min(reach, e * e + MAX_SQUARED_DEVIATION * S)) * (1.0 + 1e-12)
    return math.ceil((v - reach - z) / D), math.floor((v + reach - z) / D)


@kernel_part
def branch(size, velocity, limits, count, new, plot, lists):
    """Branch `count` hypotheses over their folds; returns the number of branches, and the best weight.

    Weights and velocities u of the branches are left in `lists`. velocity is the plot's variance, z and D; limits are
    the smallest ratio to the best weight, and the number of branches kept."""
    (variance, z, D), (prune, max_count) = velocity, limits
    weights = column(lists, 0, 0)
    child_weights, child_velocities = lists.children, row(lists.children, lists.most // WIDTH)
    groups = (count + WIDTH - 1) // WIDTH
    min_distance, max_term = best_branch(size, variance, z, D, groups, new, lists)
    min_weight, branch_count, lane_numbers = max_term * max(prune, MIN_BRANCH_RATIO), 0, get(plot, layout.PLOT)
    branch_weights, branch_velocities = row(plot, layout.PLOT + 1), row(plot, layout.PLOT + 2)
    for h in range(count):
        lane, hypothesis = h % WIDTH, row(new, (h // WIDTH) * GROUP_ROWS)
        first, last = 1.0, 0.0
        for i in range(size):
            order = row(hypothesis, i * ROWS)
            v, S = order[(STATE + 1) * WIDTH + lane], order[(COVARIANCE + 3) * WIDTH + lane] + variance
            c = weights[h] * order[PROBABILITY * WIDTH + lane] / math.sqrt(S)
            low, high = fold_window(c, v, S, z, D, min_distance, min_weight, size)
            if low <= high:
                first, last = (low, high) if first > last else (min(first, low), max(last, high))
        n = first
        while n <= last:
            u, p = z + D * (n + lane_numbers), full(0.0)
            for i in range(size):
                order = row(hypothesis, i * ROWS)
                v, S = order[(STATE + 1) * WIDTH + lane], order[(COVARIANCE + 3) * WIDTH + lane] + variance
                c, e = weights[h] * order[PROBABILITY * WIDTH + lane] / math.sqrt(S), u - v
                exponent = 0.5 * min_distance - (0.5 / S) * (e * e)
                p = p + c * lanes.exponential(where_greater(full(200.0), exponent, exponent, full(200.0)))
            put(branch_weights, 0, p)
            put(branch_velocities, 0, u)
            for i in range(WIDTH):
                if n + i <= last and branch_weights[i] >= min_weight:
                    if branch_count == lists.most:
                        min_weight = max(min_weight, keep_greatest(lists, branch_count, max_count))
                        branch_count = max_count
                        if branch_weights[i] < min_weight:
                            continue
                    child_weights[branch_count], child_velocities[branch_count] = (
                        branch_weights[i],
                        branch_velocities[i],
                    )
                    lists.parents[branch_count] = h
                    branch_count += 1
            n += WIDTH
    return prune_branches(lists, branch_count, prune, max_count)


@kernel_part
def prune_branches(lists, branch_count, prune, max_count):
    """Drop the branches that weigh too little, and those beyond the number kept; returns the number left, and the best
    weight."""
    child_weights, child_velocities = lists.children, row(lists.children, lists.most // WIDTH)
    best_weight = 0.0
    for i in range(branch_count):
        best_weight = max(best_weight, child_weights[i])
    count = 0
    for i in range(branch_count):
        if child_weights[i] >= best_weight * prune:
            child_weights[count], child_velocities[count] = child_weights[i], child_velocities[i]
            lists.parents[count] = lists.parents[i]
            count += 1
    if count > max_count:
        keep_greatest(lists, count, max_count)
        count = max_count
    return count, best_weight


@kernel_part
def put_children(size, variance, count, best_weight, new, old, lists):
    """Write `count` branches into the list `old`, updated with their velocities, and their weights."""
    weights = column(lists, 0, 0)
    child_weights, child_velocities, unit = lists.children, row(lists.children, lists.most // WIDTH), full(1.0)
    groups = (count + WIDTH - 1) // WIDTH
    for i in range(groups * WIDTH):
        j = lists.parents[i] if i < count else lists.parents[0]
        target, source = row(old, (i // WIDTH) * GROUP_ROWS), row(new, (j // WIDTH) * GROUP_ROWS)
        for r in range(size * ROWS):
            target[r * WIDTH + i % WIDTH] = source[r * WIDTH + j % WIDTH]
        weights[i] = child_weights[i] / best_weight if i < count else 0.0
        if i >= count:
            child_velocities[i] = child_velocities[0]
    for g in range(groups):
        group, u = row(old, g * GROUP_ROWS), get(child_velocities, g)
        for i in range(size):
            order = row(group, i * ROWS)
            x, e = get3(order, STATE), u - get(order, STATE + 1)
            P, gain, S = take_rate(lane_matrices.get6(order, COVARIANCE), variance, 1.0)
            put3(order, STATE, add_scaled(x, e, gain))
            put6(order, COVARIANCE, P)
            put(order, PRIOR_PROBABILITY, get(order, PROBABILITY))
            put(order, PROBABILITY, unit / square_root(S))
            put(order, DISTANCE, e * e / S)
        weigh_orders(group, size)


@kernel_part
def put_estimates(size, orders, count, right, states, lists, output):
    """Write one lane of the output: means over hypotheses and orders, the best hypothesis, whether it is right."""
    weights, zero = column(lists, 0, 0), full(0.0)
    best, group_weights, order_weights = 0, zero, (zero, zero, zero)
    x = zero, zero, zero
    for i in range(count):
        best = i if weights[i] > weights[best] else best
    for g in range((count + WIDTH - 1) // WIDTH):
        w = get(weights, g)
        group_weights = group_weights + w
        for i in range(size):
            order = row(states, g * GROUP_ROWS + i * ROWS)
            share, y = w * get(order, PROBABILITY), get3(order, STATE)
            x = add_scaled(x, share, y)
            order_weights = (
                order_weights[0] + (share if orders[i] == 0 else zero),
                order_weights[1] + (share if orders[i] == 1 else zero),
                order_weights[2] + (share if orders[i] == 2 else zero),
            )
    weight_sum = total(group_weights)
    lane_matrices.put_lane3(
        output, layout.MEAN, (total(x[0]) / weight_sum, total(x[1]) / weight_sum, total(x[2]) / weight_sum)
    )
    shares = (
        total(order_weights[0]) / weight_sum,
        total(order_weights[1]) / weight_sum,
        total(order_weights[2]) / weight_sum,
    )
    lane_matrices.put_lane3(output, layout.WEIGHTS, shares)
    for c in range(3):
        y = 0.0
        for i in range(size):
            order = row(states, (best // WIDTH) * GROUP_ROWS + i * ROWS)
            y += order[PROBABILITY * WIDTH + best % WIDTH] * order[(STATE + c) * WIDTH + best % WIDTH]
        output[(layout.BEST + c) * WIDTH] = y
    output[layout.RIGHT * WIDTH] = 1.0 if best == right else 0.0
    output[layout.LISTED * WIDTH] = 1.0 if right >= 0 else 0.0
    output[layout.COUNT * WIDTH] = count
    output[layout.PROBABILITY * WIDTH] = weights[best] / weight_sum


@kernel_part
def run_interacting_hypotheses(bank, limits, sigma, spans, plots, out, work_arrays):
    """Run a bank of fold hypotheses in which orders interact over all scans of one realisation.

    plots, out are addresses of its lane; work_arrays: two lists of groups, the rows of a plot in all lanes, and the
    lists of `kernels.hypotheses`. limits as in `branch`."""
    (states, plot, lists), size, variance = work_arrays, bank.size, sigma[1] * sigma[1]
    old, new = row(states, 0), row(states, (lists.room // WIDTH) * GROUP_ROWS)
    put_start(bank.designs, bank.members, size, lists, old)
    count, right = 1, 0
    for i in range(WIDTH):
        plot[layout.PLOT * WIDTH + i] = i
    for k in range(spans.size):
        scan, D = row(plots, k * layout.PLOT), spans[k]
        for i in range(layout.PLOT):
            put(plot, i, full(scan[i * WIDTH]))
        groups = (count + WIDTH - 1) // WIDTH
        take_range_in_all(bank, sigma, plot, k > 0, groups, (old, new), lists)
        if scan[layout.DETECTED * WIDTH] > 0.0:
            branch_count, best_weight = branch(
                size, (variance, scan[layout.VELOCITY * WIDTH], D), limits, count, new, plot, lists
            )
            child_velocities, right_child = row(lists.children, lists.most // WIDTH), -1
            for i in range(branch_count):
                if lists.parents[i] == right and abs(child_velocities[i] - scan[layout.UNFOLDED * WIDTH]) < 0.5 * D:
                    right_child = i
            right, count = right_child, branch_count
            put_children(size, variance, count, best_weight, new, old, lists)
        else:
            old, new = new, old
        put_estimates(size, bank.orders, count, right, old, lists, row(out, k * layout.OUTPUT))
