"""Filters of several orders made into one estimate: by likelihood, by fixed shares, by intersection of intervals.

By likelihood they interact (IMM: Blom & Bar-Shalom 1988), and the folds of each scan are merged in each order. Letters
as in `kernels.steps`, of each order j

    mu   its probability after this scan's plot; c before it
    p    probability to pass from one order to another, `stay` to remain

Hypotheses on the folds of one realisation, in each of which orders interact: an IMM over orders and folds.

Given its folds a hypothesis is a filter of interacting orders, as above, with an unfolded velocity. A scan
mixes and moves the orders of every hypothesis and weighs all by the range, branches each over the folds that any of its
orders leaves possible, and drops what is too far below the best or beyond the number that is kept. Mixing makes
covariances depend on the data, so that each hypothesis has its own; lanes are eight hypotheses.

    W      weight of a hypothesis, the best one's 1; 0 in a place that holds none
    mu     probability of an order within it
    u      velocity z + n D of the fold n; the same for all orders
    p      weight of a branch: W times the sum over orders of mu N(u; v, S), apart from a common factor
    least  distance of the nearest fold of all, in variances: taken off every exponent, so that no weight vanishes
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
    folds_merged,
    motion,
    prior,
    put_single,
    range_taken,
    whether_right,
)

# ---- orders ----------------------------------------------------------------------------------------------------------
# Rows of one order in memory: state, covariance, probability after the scan, and before it, distance of its plot.
STATE, COVARIANCE, PROBABILITY, BEFORE, DISTANCE, ROWS = 0, 3, 9, 10, 11, 12
FAR = 1e300


class Orders(NamedTuple):
    """The filters of one bank that are made into one."""

    designs: Any  #: address of the designs of all banks
    parts: Any  #: address of the numbers of its members' designs, or of the banks that it reads
    orders: Any  #: address of its members' orders
    size: int  #: how many they are
    stay: float  #: probability that an order stays what it is, over a scan


@part
def mixed(old, new, size, stay):
    """States before a scan: of each order the mixture of all by the probabilities to pass into it."""
    zero, tiny = full(0.0), full(1e-300)
    for i in range(size):
        own = row(new, i * ROWS)
        c = zero
        for j in range(size):
            p = stay if i == j else (1.0 - stay) / (size - 1)
            c = c + p * get(row(old, j * ROWS), PROBABILITY)
        put(own, BEFORE, c)
        c = where_greater(c, tiny, c, tiny)
        x, P = (zero, zero, zero), (zero, zero, zero, zero, zero, zero)
        for j in range(size):
            p, other = stay if i == j else (1.0 - stay) / (size - 1), row(old, j * ROWS)
            x = add_scaled(x, p * get(other, PROBABILITY) / c, get3(other, STATE))
        for j in range(size):
            p, other = stay if i == j else (1.0 - stay) / (size - 1), row(old, j * ROWS)
            apart = add_scaled(get3(other, STATE), -1.0, x)
            P = add_spread(P, p * get(other, PROBABILITY) / c, lanes.get6(other, COVARIANCE), apart)
        put3(own, STATE, x)
        put6(own, COVARIANCE, P)


@part
def taken(own, design, sigma, plot, D, unfolding, moves):
    """Predict one order over a scan and take its plot, in place; PROBABILITY becomes a factor of the likelihood. That
    is exp(-DISTANCE/2) times this factor, apart from constants."""
    F, Q = motion(design)
    zero, one = full(0.0), full(1.0)
    x, P = get3(own, STATE), lanes.get6(own, COVARIANCE)
    detected, first = get(plot, rec.DETECTED), get(plot, rec.FIRST)
    if moves:
        x, P = predicted(x, F), predicted_covariance(P, F, Q)
    P, g, weight = range_taken(P, first, detected - first, sigma[0] * sigma[0])
    z = get(plot, rec.RANGE)
    e = z - x[0]
    distance, factor = 2.0 * weight * (e * e), where_greater(weight, zero, root(weight), one)
    x = add_scaled(x, e, g)
    x = where_greater(first, zero, z, x[0]), x[1], x[2]
    if unfolding != rec.NONE:
        e = get(plot, rec.UNFOLDED) - x[1]
        if unfolding != rec.UNFOLDS:
            e = get(plot, rec.VELOCITY) - x[1]
            e = e - D * nearest(e / D)
        P, g, S = take_rate(P, sigma[1] * sigma[1], detected * design[rec.TAKES_VELOCITY])
        mean, variance, total = e, zero, one
        if unfolding != rec.UNFOLDS:
            mean, variance, total = folds_merged(e, S, D)
        distance = distance + detected * (e * e) / S
        factor = factor * where_greater(detected, zero, total / root(S), one)
        x = add_scaled(x, mean, g)
        P = add_outer(P, variance, g)
    put3(own, STATE, x)
    put6(own, COVARIANCE, P)
    put(own, PROBABILITY, factor)
    put(own, DISTANCE, distance)


@part
def weighed(new, size):
    """Probabilities of the orders after a plot, from those before it and the likelihoods. Gives the least distance and
    the plot's likelihood over exp(-least/2), apart from constants."""
    least, total = get(new, DISTANCE), full(0.0)
    for i in range(1, size):
        distance = get(row(new, i * ROWS), DISTANCE)
        least = where_greater(least, distance, distance, least)
    for i in range(size):
        own = row(new, i * ROWS)
        mu = get(own, BEFORE) * get(own, PROBABILITY) * lanes.exponential(0.5 * (least - get(own, DISTANCE)))
        put(own, PROBABILITY, mu)
        total = total + mu
    for i in range(size):
        own = row(new, i * ROWS)
        put(own, PROBABILITY, get(own, PROBABILITY) / total)
    return least, total


@part
def run_interacting(bank, unfolding, sigma, spans, plots, out, memory):
    """Orders that interact, over all scans; memory has room for two times three orders."""
    designs, parts, orders, size, stay = bank
    zero = full(0.0)
    old, new = row(memory, 0), row(memory, 3 * ROWS)
    right = full(1.0)
    for i in range(size):
        own = row(old, i * ROWS)
        put3(own, STATE, (zero, zero, zero))
        put6(own, COVARIANCE, prior(row(designs, parts[i] * (rec.DESIGN // 8))))
        put(own, PROBABILITY, full(1.0 / size))
    for k in range(spans.size):
        plot, D = row(plots, k * rec.PLOT), spans[k]
        mixed(old, new, size, stay)
        velocity = zero
        for i in range(size):
            own, design = row(new, i * ROWS), row(designs, parts[i] * (rec.DESIGN // 8))
            taken(own, design, sigma, plot, D, unfolding, k > 0)
        weighed(new, size)
        x, w = (zero, zero, zero), (zero, zero, zero)
        for i in range(size):
            own = row(new, i * ROWS)
            mu, y = get(own, PROBABILITY), get3(own, STATE)
            x = add_scaled(x, mu, y)
            velocity = velocity + mu * y[1]
            w = (
                w[0] + (mu if orders[i] == 0 else zero),
                w[1] + (mu if orders[i] == 1 else zero),
                w[2] + (mu if orders[i] == 2 else zero),
            )
        z = get(plot, rec.VELOCITY)
        right = whether_right(right, plot, z + D * nearest((velocity - z) / D), D)
        to = row(out, k * rec.OUTPUT)
        put_single(to, x, right)
        put3(to, rec.WEIGHTS, w)
        old, new = new, old


@part
def run_weighing(outputs, bank, reads, shares, scans, out):
    """Fixed shares of other banks, over all scans: shares (K, MEMBERS, 3); outputs of all banks, MEAN or BEST read."""
    zero, one = full(0.0), full(1.0)
    parts, orders, size = bank.parts, bank.orders, bank.size
    for k in range(scans):
        to = row(out, k * rec.OUTPUT)
        x, w = (zero, zero, zero), (0.0, 0.0, 0.0)
        for i in range(size):
            y, share = get3(row(outputs, (parts[i] * scans + k) * rec.OUTPUT), reads), 3 * (k * rec.MEMBERS + i)
            x = (x[0] + shares[share] * y[0], x[1] + shares[share + 1] * y[1], x[2] + shares[share + 2] * y[2])
            w = (
                w[0] + (shares[share] if orders[i] == 0 else 0.0),
                w[1] + (shares[share] if orders[i] == 1 else 0.0),
                w[2] + (shares[share] if orders[i] == 2 else 0.0),
            )
        put_single(to, x, one)
        put3(to, rec.WEIGHTS, (full(0.0) + w[0], full(0.0) + w[1], full(0.0) + w[2]))


@part
def chosen(outputs, bank, reads, widths, scans, k, c):
    """Of component c at scan k: the smoothest whose interval meets those of all rougher ones, and its order."""
    parts, orders, size = bank.parts, bank.orders, bank.size
    x, order = full(0.0), full(0.0)
    low, high, meets, used = full(-FAR), full(FAR), full(1.0), 0
    for _ in range(size):
        pick, width = -1, 0.0
        for i in range(size):
            own = widths[3 * (k * rec.MEMBERS + i) + c]
            if (used >> i) & 1 == 0 and own > width:
                pick, width = i, own
        if pick < 0:
            break
        used |= 1 << pick
        y = get(row(outputs, (parts[pick] * scans + k) * rec.OUTPUT), reads + c)
        low, high = where_greater(y - width, low, y - width, low), where_greater(high, y + width, y + width, high)
        meets = where_greater(low, high, full(0.0), meets)
        x = where_greater(meets, full(0.5), y, x)
        order = where_greater(meets, full(0.5), full(float(orders[pick])), order)
    return x, order


@part
def run_choosing(outputs, bank, reads, widths, scans, out):
    """The intersection of intervals, component by component, over all scans: widths (K, MEMBERS, 3) half ones."""
    zero, one = full(0.0), full(1.0)
    for k in range(scans):
        x0, order = chosen(outputs, bank, reads, widths, scans, k, 0)
        x1, _ = chosen(outputs, bank, reads, widths, scans, k, 1)
        x2, _ = chosen(outputs, bank, reads, widths, scans, k, 2)
        to = row(out, k * rec.OUTPUT)
        put_single(to, (x0, x1, x2), one)
        zeroth, second = where_greater(full(0.5), order, one, zero), where_greater(order, full(1.5), one, zero)
        put3(to, rec.WEIGHTS, (zeroth, one - zeroth - second, second))


# ---- together --------------------------------------------------------------------------------------------------------
GROUP = 3 * ROWS  # rows of eight hypotheses: of three orders
BROAD = rec.PLOT + 3  # rows of a plot in all lanes, then the numbers 0 … 7, and two rows of branches
LEAST_SHARE = 1e-150  # an order's least probability after a range, so that a product with a far velocity's is not zero
NO_WEIGHT = 1e-200  # a share of the whole below which an order's nearest fold does not count
LEAST_WEIGHT = 1e-280  # of a branch beside the best


@part
def extreme(values, greatest):
    """The greatest of a row's eight numbers, or the least."""
    found = values[0]
    for i in range(1, WIDTH):
        found = max(found, values[i]) if greatest else min(found, values[i])
    return found


@part
def begun(designs, parts, size, lists, old):
    """One hypothesis before the first scan, in the first group of the list."""
    zero = full(0.0)
    for i in range(size):
        own = row(old, i * ROWS)
        put3(own, STATE, (zero, zero, zero))
        put6(own, COVARIANCE, prior(row(designs, parts[i] * (rec.DESIGN // WIDTH))))
        put(own, PROBABILITY, full(1.0 / size))
    weights = column(lists, 0, 0)
    for i in range(WIDTH):
        weights[i] = 1.0 if i == 0 else 0.0


@part
def ranged(bank, sigma, plot, moves, groups, states, lists):
    """Mix and move the orders of every hypothesis and take the range, from one list of states to another."""
    designs, parts, size, (old, new) = bank.designs, bank.parts, bank.size, states
    zero, floor = full(0.0), full(LEAST_SHARE)
    weights, distances, least = column(lists, 0, 0), column(lists, 0, 1), full(FAR)
    for g in range(groups):
        own = row(new, g * GROUP)
        mixed(row(old, g * GROUP), own, size, bank.stay)
        for i in range(size):
            design = row(designs, parts[i] * (rec.DESIGN // WIDTH))
            taken(row(own, i * ROWS), design, sigma, plot, 1.0, rec.NONE, moves)
        distance, likelihood = weighed(own, size)
        for i in range(size):
            mu = get(row(own, i * ROWS), PROBABILITY)
            put(row(own, i * ROWS), PROBABILITY, where_greater(mu, floor, mu, floor))
        w = get(weights, g)
        put(distances, g, distance)
        put(weights, g, w * likelihood)
        distance = where_greater(w, zero, distance, full(FAR))
        least = where_greater(least, distance, distance, least)
    put(column(lists, 0, 2), 0, least)
    nearest_of_all = extreme(column(lists, 0, 2), False)
    for g in range(groups):
        off = nearest_of_all - get(distances, g)
        put(weights, g, get(weights, g) * lanes.exponential(0.5 * where_greater(zero, off, off, zero)))


@part
def nearest_branch(size, variance, z, D, groups, new, lists):
    """`least`, and the greatest term of any p: of an order's nearest fold."""
    zero, far = full(0.0), full(FAR)
    weights, best, at = column(lists, 0, 0), column(lists, 0, 1), column(lists, 0, 2)
    all_ = zero
    for g in range(groups):
        all_ = all_ + get(weights, g)
    whole, least = total(all_), far
    for g in range(groups):
        for i in range(size):
            own = row(new, g * GROUP + i * ROWS)
            e = z - get(own, STATE + 1)
            e = e - D * nearest(e / D)
            share = get(weights, g) * get(own, PROBABILITY)
            distance = e * e / (get(own, COVARIANCE + 3) + variance)
            distance = where_greater(share, full(NO_WEIGHT * whole), distance, far)
            least = where_greater(least, distance, distance, least)
    put(best, 0, least)
    of_all, top = extreme(best, False), zero
    for g in range(groups):
        for i in range(size):
            own = row(new, g * GROUP + i * ROWS)
            S = get(own, COVARIANCE + 3) + variance
            e = z - get(own, STATE + 1)
            e = e - D * nearest(e / D)
            off = 0.5 * (of_all - e * e / S)
            off = where_greater(zero, off, off, zero)
            p = get(weights, g) * get(own, PROBABILITY) * lanes.exponential(off) / root(S)
            top = where_greater(p, top, p, top)
    put(at, 0, top)
    return of_all, extreme(at, True)


@part
def window(c, v, S, z, D, least, floor, size):
    """First and last fold of an order that can give a branch of weight `floor`; c its share of p at its prediction."""
    e = z - v
    e -= D * math.floor(e / D + 0.5)
    reach = 0.0
    if c > 0.0:
        reach = 2.0 * S * (0.5 * least + math.log(size * c / floor))
    if reach < e * e:
        return 1.0, 0.0
    reach = math.sqrt(min(reach, e * e + FARTHEST * S)) * (1.0 + 1e-12)
    return math.ceil((v - reach - z) / D), math.floor((v + reach - z) / D)


@part
def branched(size, velocity, limits, count, new, plot, lists):
    """Branch `count` hypotheses over their folds: weights and velocities u of the branches; how many, and the best.

    velocity is the plot's variance, z and D; limits are the least share of the best weight and how many are kept."""
    (variance, z, D), (prune, most) = velocity, limits
    weights = column(lists, 0, 0)
    branch, found = lists.children, row(lists.children, lists.most // WIDTH)
    groups = (count + WIDTH - 1) // WIDTH
    least, top = nearest_branch(size, variance, z, D, groups, new, lists)
    floor, made, steps = top * max(prune, LEAST_WEIGHT), 0, get(plot, rec.PLOT)
    at_p, at_u = row(plot, rec.PLOT + 1), row(plot, rec.PLOT + 2)
    for h in range(count):
        lane, own = h % WIDTH, row(new, (h // WIDTH) * GROUP)
        first, last = 1.0, 0.0
        for i in range(size):
            order = row(own, i * ROWS)
            v, S = order[(STATE + 1) * WIDTH + lane], order[(COVARIANCE + 3) * WIDTH + lane] + variance
            c = weights[h] * order[PROBABILITY * WIDTH + lane] / math.sqrt(S)
            low, high = window(c, v, S, z, D, least, floor, size)
            if low <= high:
                first, last = (low, high) if first > last else (min(first, low), max(last, high))
        n = first
        while n <= last:
            u, p = z + D * (n + steps), full(0.0)
            for i in range(size):
                order = row(own, i * ROWS)
                v, S = order[(STATE + 1) * WIDTH + lane], order[(COVARIANCE + 3) * WIDTH + lane] + variance
                c, e = weights[h] * order[PROBABILITY * WIDTH + lane] / math.sqrt(S), u - v
                off = 0.5 * least - (0.5 / S) * (e * e)
                p = p + c * lanes.exponential(where_greater(full(200.0), off, off, full(200.0)))
            put(at_p, 0, p)
            put(at_u, 0, u)
            for i in range(WIDTH):
                if n + i <= last and at_p[i] >= floor:
                    if made == lists.most:
                        floor, made = max(floor, keep_greatest(lists, made, most)), most
                        if at_p[i] < floor:
                            continue
                    branch[made], found[made], lists.parents[made] = at_p[i], at_u[i], h
                    made += 1
            n += WIDTH
    return kept(lists, made, prune, most)


@part
def kept(lists, made, prune, most):
    """Drop the branches that weigh too little beside the best, and those beyond the number kept: how many, the best."""
    branch, found = lists.children, row(lists.children, lists.most // WIDTH)
    top = 0.0
    for i in range(made):
        top = max(top, branch[i])
    count = 0
    for i in range(made):
        if branch[i] >= top * prune:
            branch[count], found[count], lists.parents[count] = branch[i], found[i], lists.parents[i]
            count += 1
    if count > most:
        keep_greatest(lists, count, most)
        count = most
    return count, top


@part
def inherited(size, variance, count, top, new, old, lists):
    """Write `count` branches into the list `old`, with their velocities taken, and their weights."""
    weights = column(lists, 0, 0)
    branch, found, one = lists.children, row(lists.children, lists.most // WIDTH), full(1.0)
    groups = (count + WIDTH - 1) // WIDTH
    for i in range(groups * WIDTH):
        j = lists.parents[i] if i < count else lists.parents[0]
        to, of = row(old, (i // WIDTH) * GROUP), row(new, (j // WIDTH) * GROUP)
        for r in range(size * ROWS):
            to[r * WIDTH + i % WIDTH] = of[r * WIDTH + j % WIDTH]
        weights[i] = branch[i] / top if i < count else 0.0
        if i >= count:
            found[i] = found[0]
    for g in range(groups):
        own, u = row(old, g * GROUP), get(found, g)
        for i in range(size):
            order = row(own, i * ROWS)
            x, e = get3(order, STATE), u - get(order, STATE + 1)
            P, gain, S = take_rate(lanes.get6(order, COVARIANCE), variance, 1.0)
            put3(order, STATE, add_scaled(x, e, gain))
            put6(order, COVARIANCE, P)
            put(order, BEFORE, get(order, PROBABILITY))
            put(order, PROBABILITY, one / root(S))
            put(order, DISTANCE, e * e / S)
        weighed(own, size)


@part
def put_estimates(size, orders, count, right, states, lists, to):
    """Write this lane of the output: means over hypotheses and orders, the best hypothesis, whether it is right."""
    weights, zero = column(lists, 0, 0), full(0.0)
    best, sum_, of_orders = 0, zero, (zero, zero, zero)
    x = zero, zero, zero
    for i in range(count):
        best = i if weights[i] > weights[best] else best
    for g in range((count + WIDTH - 1) // WIDTH):
        w = get(weights, g)
        sum_ = sum_ + w
        for i in range(size):
            order = row(states, g * GROUP + i * ROWS)
            share, y = w * get(order, PROBABILITY), get3(order, STATE)
            x = add_scaled(x, share, y)
            of_orders = (
                of_orders[0] + (share if orders[i] == 0 else zero),
                of_orders[1] + (share if orders[i] == 1 else zero),
                of_orders[2] + (share if orders[i] == 2 else zero),
            )
    whole = total(sum_)
    lanes.put_lane3(to, rec.MEAN, (total(x[0]) / whole, total(x[1]) / whole, total(x[2]) / whole))
    shares = total(of_orders[0]) / whole, total(of_orders[1]) / whole, total(of_orders[2]) / whole
    lanes.put_lane3(to, rec.WEIGHTS, shares)
    for c in range(3):
        y = 0.0
        for i in range(size):
            order = row(states, (best // WIDTH) * GROUP + i * ROWS)
            y += order[PROBABILITY * WIDTH + best % WIDTH] * order[(STATE + c) * WIDTH + best % WIDTH]
        to[(rec.BEST + c) * WIDTH] = y
    to[rec.RIGHT * WIDTH] = 1.0 if best == right else 0.0
    to[rec.LISTED * WIDTH] = 1.0 if right >= 0 else 0.0
    to[rec.COUNT * WIDTH] = count
    to[rec.PROBABILITY * WIDTH] = weights[best] / whole


@part
def run_together(bank, limits, sigma, spans, plots, out, room):
    """Orders that interact within remembered hypotheses, over all scans of one realisation.

    plots, out are addresses of its lane; room: for two lists of groups, for BROAD rows of a plot, and the lists.
    limits as in `branched`."""
    (memory, plot, lists), size, variance = room, bank.size, sigma[1] * sigma[1]
    old, new = row(memory, 0), row(memory, (lists.room // WIDTH) * GROUP)
    begun(bank.designs, bank.parts, size, lists, old)
    count, right = 1, 0
    for i in range(WIDTH):
        plot[rec.PLOT * WIDTH + i] = i
    for k in range(spans.size):
        here, D = row(plots, k * rec.PLOT), spans[k]
        for i in range(rec.PLOT):
            put(plot, i, full(here[i * WIDTH]))
        groups = (count + WIDTH - 1) // WIDTH
        ranged(bank, sigma, plot, k > 0, groups, (old, new), lists)
        if here[rec.DETECTED * WIDTH] > 0.0:
            made, top = branched(size, (variance, here[rec.VELOCITY * WIDTH], D), limits, count, new, plot, lists)
            found, is_right = row(lists.children, lists.most // WIDTH), -1
            for i in range(made):
                if lists.parents[i] == right and abs(found[i] - here[rec.UNFOLDED * WIDTH]) < 0.5 * D:
                    is_right = i
            right, count = is_right, made
            inherited(size, variance, count, top, new, old, lists)
        else:
            old, new = new, old
        put_estimates(size, bank.orders, count, right, old, lists, row(out, k * rec.OUTPUT))
