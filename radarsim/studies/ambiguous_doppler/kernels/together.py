"""Combine filters of several orders into one estimate: by likelihood, by fixed shares, by intersection of intervals.

Combined by likelihood, the orders interact (IMM: Blom & Bar-Shalom 1988), and each order merges the folds of a scan.
Letters as in `kernels.steps`; for each order j

    mu   its probability after the scan's plot; c before it
    p    probability that one order passes into another; `stay` that it remains

Hypotheses on the folds of one realisation, in each of which the orders interact: an IMM over orders and folds.

With its folds given, a hypothesis is a filter of interacting orders, as above, whose velocity is unfolded. At each scan
the orders of every hypothesis are mixed and predicted; all hypotheses are weighted by the range; each branches over the
folds that any of its orders leaves possible; those too far below the best, or beyond the number kept, are dropped.
Mixing makes covariances depend on the data, so that each hypothesis has its own; the lanes hold eight hypotheses.

    W             weight of a hypothesis, the best one's 1; 0 in a slot without a hypothesis
    mu            probability of an order within it
    u             velocity z + n D of the fold n; the same for all orders
    p             weight of a branch: W times the sum over orders of mu N(u; v, S), up to a common factor
    min_distance  smallest distance of any fold, in variances: taken off every exponent, so that no weight vanishes
"""

import math
from typing import Any, NamedTuple

from radarsim.kernels import lanes
from radarsim.kernels.algebra import add_outer, add_scaled, add_spread, predicted, predicted_covariance, take_rate
from radarsim.kernels.compile import part
from radarsim.kernels.hypotheses import FARTHEST, column, keep_greatest
from radarsim.kernels.lanes import WIDTH, full, get, get3, nearest, put, put3, put6, root, row, total, where_greater
from radarsim.studies.ambiguous_doppler.kernels import records as rec
from radarsim.studies.ambiguous_doppler.kernels.steps import (
    merge_folds,
    motion,
    prior_covariance,
    put_single,
    still_right,
    update_by_range,
)

# ---- orders ----------------------------------------------------------------------------------------------------------
# Rows of one order in memory: state, covariance, its probability after the scan and before it, distance of its plot.
STATE, COVARIANCE, PROBABILITY, PRIOR_PROBABILITY, DISTANCE, ROWS = 0, 3, 9, 10, 11, 12
HUGE = 1e300


class Orders(NamedTuple):
    """The filters that one bank combines."""

    designs: Any  #: address of the designs of all banks
    members: Any  #: address of the numbers of its members: designs, or banks whose output it reads
    orders: Any  #: address of its members' orders
    size: int  #: number of members
    stay: float  #: probability that an order persists over a scan


@part
def mix_orders(old, new, size, stay):
    """Mix the states before a scan: each order's becomes the mean of all, weighted by the probability of passing into
    it."""
    zero, tiny = full(0.0), full(1e-300)
    for i in range(size):
        target = row(new, i * ROWS)
        c = zero
        for j in range(size):
            p = stay if i == j else (1.0 - stay) / (size - 1)
            c = c + p * get(row(old, j * ROWS), PROBABILITY)
        put(target, PRIOR_PROBABILITY, c)
        c = where_greater(c, tiny, c, tiny)
        x, P = (zero, zero, zero), (zero, zero, zero, zero, zero, zero)
        for j in range(size):
            p, source = stay if i == j else (1.0 - stay) / (size - 1), row(old, j * ROWS)
            x = add_scaled(x, p * get(source, PROBABILITY) / c, get3(source, STATE))
        for j in range(size):
            p, source = stay if i == j else (1.0 - stay) / (size - 1), row(old, j * ROWS)
            difference = add_scaled(get3(source, STATE), -1.0, x)
            P = add_spread(P, p * get(source, PROBABILITY) / c, lanes.get6(source, COVARIANCE), difference)
        put3(target, STATE, x)
        put6(target, COVARIANCE, P)


@part
def take_plot(order, design, sigma, plot, D, unfolding, moves):
    """Predict one order over a scan and update it with the plot, in place.

    PROBABILITY becomes a factor of the likelihood, which is exp(-DISTANCE/2) times this factor, up to a constant."""
    F, Q = motion(design)
    zero, unit = full(0.0), full(1.0)
    x, P = get3(order, STATE), lanes.get6(order, COVARIANCE)
    detected, first = get(plot, rec.DETECTED), get(plot, rec.FIRST)
    if moves:
        x, P = predicted(x, F), predicted_covariance(P, F, Q)
    P, g, weight = update_by_range(P, first, detected - first, sigma[0] * sigma[0])
    z = get(plot, rec.RANGE)
    e = z - x[0]
    distance, factor = 2.0 * weight * (e * e), where_greater(weight, zero, root(weight), unit)
    x = add_scaled(x, e, g)
    x = where_greater(first, zero, z, x[0]), x[1], x[2]
    if unfolding != rec.NONE:
        e = get(plot, rec.UNFOLDED) - x[1]
        if unfolding != rec.UNFOLDS:
            e = get(plot, rec.VELOCITY) - x[1]
            e = e - D * nearest(e / D)
        P, g, S = take_rate(P, sigma[1] * sigma[1], detected * design[rec.TAKES_VELOCITY])
        mean, variance, weight_sum = e, zero, unit
        if unfolding != rec.UNFOLDS:
            mean, variance, weight_sum = merge_folds(e, S, D)
        distance = distance + detected * (e * e) / S
        factor = factor * where_greater(detected, zero, weight_sum / root(S), unit)
        x = add_scaled(x, mean, g)
        P = add_outer(P, variance, g)
    put3(order, STATE, x)
    put6(order, COVARIANCE, P)
    put(order, PROBABILITY, factor)
    put(order, DISTANCE, distance)


@part
def weigh_orders(new, size):
    """Compute the probabilities of the orders after a plot from those before it and the likelihoods.

    Returns the smallest distance, and the plot's likelihood over exp(-min_distance/2), up to a constant."""
    min_distance, likelihood = get(new, DISTANCE), full(0.0)
    for i in range(1, size):
        distance = get(row(new, i * ROWS), DISTANCE)
        min_distance = where_greater(min_distance, distance, distance, min_distance)
    for i in range(size):
        order = row(new, i * ROWS)
        mu = (
            get(order, PRIOR_PROBABILITY)
            * get(order, PROBABILITY)
            * lanes.exponential(0.5 * (min_distance - get(order, DISTANCE)))
        )
        put(order, PROBABILITY, mu)
        likelihood = likelihood + mu
    for i in range(size):
        order = row(new, i * ROWS)
        put(order, PROBABILITY, get(order, PROBABILITY) / likelihood)
    return min_distance, likelihood


@part
def run_interacting(bank, unfolding, sigma, spans, plots, out, memory):
    """Run a bank of interacting orders over all scans; memory has room for two times three orders."""
    designs, members, orders, size, stay = bank
    zero = full(0.0)
    old, new = row(memory, 0), row(memory, 3 * ROWS)
    right = full(1.0)
    for i in range(size):
        order = row(old, i * ROWS)
        put3(order, STATE, (zero, zero, zero))
        put6(order, COVARIANCE, prior_covariance(row(designs, members[i] * (rec.DESIGN // 8))))
        put(order, PROBABILITY, full(1.0 / size))
    for k in range(spans.size):
        plot, D = row(plots, k * rec.PLOT), spans[k]
        mix_orders(old, new, size, stay)
        velocity = zero
        for i in range(size):
            order, design = row(new, i * ROWS), row(designs, members[i] * (rec.DESIGN // 8))
            take_plot(order, design, sigma, plot, D, unfolding, k > 0)
        weigh_orders(new, size)
        x, w = (zero, zero, zero), (zero, zero, zero)
        for i in range(size):
            order = row(new, i * ROWS)
            mu, y = get(order, PROBABILITY), get3(order, STATE)
            x = add_scaled(x, mu, y)
            velocity = velocity + mu * y[1]
            w = (
                w[0] + (mu if orders[i] == 0 else zero),
                w[1] + (mu if orders[i] == 1 else zero),
                w[2] + (mu if orders[i] == 2 else zero),
            )
        z = get(plot, rec.VELOCITY)
        right = still_right(right, plot, z + D * nearest((velocity - z) / D), D)
        output = row(out, k * rec.OUTPUT)
        put_single(output, x, right)
        put3(output, rec.WEIGHTS, w)
        old, new = new, old


@part
def run_fixed_shares(outputs, bank, reads, shares, scans, out):
    """Combine other banks by fixed shares over all scans.

    shares (K, MAX_MEMBERS, 3); outputs are those of all banks, of which MEAN or BEST is read."""
    zero, unit = full(0.0), full(1.0)
    members, orders, size = bank.members, bank.orders, bank.size
    for k in range(scans):
        output = row(out, k * rec.OUTPUT)
        x, w = (zero, zero, zero), (0.0, 0.0, 0.0)
        for i in range(size):
            y, share = get3(row(outputs, (members[i] * scans + k) * rec.OUTPUT), reads), 3 * (k * rec.MAX_MEMBERS + i)
            x = (x[0] + shares[share] * y[0], x[1] + shares[share + 1] * y[1], x[2] + shares[share + 2] * y[2])
            w = (
                w[0] + (shares[share] if orders[i] == 0 else 0.0),
                w[1] + (shares[share] if orders[i] == 1 else 0.0),
                w[2] + (shares[share] if orders[i] == 2 else 0.0),
            )
        put_single(output, x, unit)
        put3(output, rec.WEIGHTS, (full(0.0) + w[0], full(0.0) + w[1], full(0.0) + w[2]))


@part
def smoothest_meeting(outputs, bank, reads, widths, scans, k, c):
    """The estimate of component c at scan k by the smoothest order whose interval meets those of all rougher ones, and
    that order."""
    members, orders, size = bank.members, bank.orders, bank.size
    x, order = full(0.0), full(0.0)
    low, high, meets, used = full(-HUGE), full(HUGE), full(1.0), 0
    for _ in range(size):
        roughest, width = -1, 0.0
        for i in range(size):
            half_width = widths[3 * (k * rec.MAX_MEMBERS + i) + c]
            if (used >> i) & 1 == 0 and half_width > width:
                roughest, width = i, half_width
        if roughest < 0:
            break
        used |= 1 << roughest
        y = get(row(outputs, (members[roughest] * scans + k) * rec.OUTPUT), reads + c)
        low, high = where_greater(y - width, low, y - width, low), where_greater(high, y + width, y + width, high)
        meets = where_greater(low, high, full(0.0), meets)
        x = where_greater(meets, full(0.5), y, x)
        order = where_greater(meets, full(0.5), full(float(orders[roughest])), order)
    return x, order


@part
def run_intersection(outputs, bank, reads, widths, scans, out):
    """Combine other banks by intersecting intervals, component by component, over all scans.

    widths (K, MAX_MEMBERS, 3) are the half widths of the intervals."""
    zero, unit = full(0.0), full(1.0)
    for k in range(scans):
        x0, order = smoothest_meeting(outputs, bank, reads, widths, scans, k, 0)
        x1, _ = smoothest_meeting(outputs, bank, reads, widths, scans, k, 1)
        x2, _ = smoothest_meeting(outputs, bank, reads, widths, scans, k, 2)
        output = row(out, k * rec.OUTPUT)
        put_single(output, (x0, x1, x2), unit)
        zeroth, second = where_greater(full(0.5), order, unit, zero), where_greater(order, full(1.5), unit, zero)
        put3(output, rec.WEIGHTS, (zeroth, unit - zeroth - second, second))


# ---- together --------------------------------------------------------------------------------------------------------
GROUP_ROWS = 3 * ROWS  # rows of eight hypotheses, each of three orders
MIN_PROBABILITY = 1e-150  # of an order after a range: its product with that of a distant velocity must not vanish
MIN_SHARE = 1e-200  # share of the total weight below which an order's nearest fold does not count
MIN_BRANCH_RATIO = 1e-280  # of a branch's weight to the best one's


@part
def extreme(values, greatest):
    """The greatest or the smallest of a row's eight numbers."""
    value = values[0]
    for i in range(1, WIDTH):
        value = max(value, values[i]) if greatest else min(value, values[i])
    return value


@part
def put_start(designs, members, size, lists, old):
    """Put one hypothesis into the first group of the list, as it is before the first scan."""
    zero = full(0.0)
    for i in range(size):
        order = row(old, i * ROWS)
        put3(order, STATE, (zero, zero, zero))
        put6(order, COVARIANCE, prior_covariance(row(designs, members[i] * (rec.DESIGN // WIDTH))))
        put(order, PROBABILITY, full(1.0 / size))
    weights = column(lists, 0, 0)
    for i in range(WIDTH):
        weights[i] = 1.0 if i == 0 else 0.0


@part
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
            design = row(designs, members[i] * (rec.DESIGN // WIDTH))
            take_plot(row(group, i * ROWS), design, sigma, plot, 1.0, rec.NONE, moves)
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


@part
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
            p = get(weights, g) * get(order, PROBABILITY) * lanes.exponential(exponent) / root(S)
            max_terms = where_greater(p, max_terms, p, max_terms)
    put(branch_terms, 0, max_terms)
    return min_distance, extreme(branch_terms, True)


@part
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
    reach = math.sqrt(min(reach, e * e + FARTHEST * S)) * (1.0 + 1e-12)
    return math.ceil((v - reach - z) / D), math.floor((v + reach - z) / D)


@part
def branch(size, velocity, limits, count, new, plot, lists):
    """Branch `count` hypotheses over their folds; returns the number of branches, and the best weight.

    Weights and velocities u of the branches are left in `lists`. velocity is the plot's variance, z and D; limits are
    the smallest ratio to the best weight, and the number of branches kept."""
    (variance, z, D), (prune, max_count) = velocity, limits
    weights = column(lists, 0, 0)
    child_weights, child_velocities = lists.children, row(lists.children, lists.most // WIDTH)
    groups = (count + WIDTH - 1) // WIDTH
    min_distance, max_term = best_branch(size, variance, z, D, groups, new, lists)
    min_weight, branch_count, lane_numbers = max_term * max(prune, MIN_BRANCH_RATIO), 0, get(plot, rec.PLOT)
    branch_weights, branch_velocities = row(plot, rec.PLOT + 1), row(plot, rec.PLOT + 2)
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


@part
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


@part
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
            P, gain, S = take_rate(lanes.get6(order, COVARIANCE), variance, 1.0)
            put3(order, STATE, add_scaled(x, e, gain))
            put6(order, COVARIANCE, P)
            put(order, PRIOR_PROBABILITY, get(order, PROBABILITY))
            put(order, PROBABILITY, unit / root(S))
            put(order, DISTANCE, e * e / S)
        weigh_orders(group, size)


@part
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
    lanes.put_lane3(output, rec.MEAN, (total(x[0]) / weight_sum, total(x[1]) / weight_sum, total(x[2]) / weight_sum))
    shares = (
        total(order_weights[0]) / weight_sum,
        total(order_weights[1]) / weight_sum,
        total(order_weights[2]) / weight_sum,
    )
    lanes.put_lane3(output, rec.WEIGHTS, shares)
    for c in range(3):
        y = 0.0
        for i in range(size):
            order = row(states, (best // WIDTH) * GROUP_ROWS + i * ROWS)
            y += order[PROBABILITY * WIDTH + best % WIDTH] * order[(STATE + c) * WIDTH + best % WIDTH]
        output[(rec.BEST + c) * WIDTH] = y
    output[rec.RIGHT * WIDTH] = 1.0 if best == right else 0.0
    output[rec.LISTED * WIDTH] = 1.0 if right >= 0 else 0.0
    output[rec.COUNT * WIDTH] = count
    output[rec.PROBABILITY * WIDTH] = weights[best] / weight_sum


@part
def run_interacting_hypotheses(bank, limits, sigma, spans, plots, out, work_arrays):
    """Run a bank of fold hypotheses in which orders interact over all scans of one realisation.

    plots, out are addresses of its lane; work_arrays: two lists of groups, the rows of a plot in all lanes, and the
    lists of `kernels.hypotheses`. limits as in `branch`."""
    (states, plot, lists), size, variance = work_arrays, bank.size, sigma[1] * sigma[1]
    old, new = row(states, 0), row(states, (lists.room // WIDTH) * GROUP_ROWS)
    put_start(bank.designs, bank.members, size, lists, old)
    count, right = 1, 0
    for i in range(WIDTH):
        plot[rec.PLOT * WIDTH + i] = i
    for k in range(spans.size):
        scan, D = row(plots, k * rec.PLOT), spans[k]
        for i in range(rec.PLOT):
            put(plot, i, full(scan[i * WIDTH]))
        groups = (count + WIDTH - 1) // WIDTH
        take_range_in_all(bank, sigma, plot, k > 0, groups, (old, new), lists)
        if scan[rec.DETECTED * WIDTH] > 0.0:
            branch_count, best_weight = branch(
                size, (variance, scan[rec.VELOCITY * WIDTH], D), limits, count, new, plot, lists
            )
            child_velocities, right_child = row(lists.children, lists.most // WIDTH), -1
            for i in range(branch_count):
                if lists.parents[i] == right and abs(child_velocities[i] - scan[rec.UNFOLDED * WIDTH]) < 0.5 * D:
                    right_child = i
            right, count = right_child, branch_count
            put_children(size, variance, count, best_weight, new, old, lists)
        else:
            old, new = new, old
        put_estimates(size, bank.orders, count, right, old, lists, row(out, k * rec.OUTPUT))
