"""Filters of several orders made into one estimate: by likelihood, by fixed shares, by intersection of intervals.

By likelihood they interact (IMM: Blom & Bar-Shalom 1988), and the folds of each scan are merged in each order. Letters
as in `kernels.steps`, of each order j

    mu   its probability after this scan's plot; c before it
    p    probability to pass from one order to another, `stay` to remain
"""

from typing import Any, NamedTuple

from radarsim.kernels.algebra import add_outer, add_scaled, add_spread, predicted, predicted_covariance, take_rate
from radarsim.kernels.compile import part
from radarsim.kernels.lanes import (
    exponential,
    full,
    get,
    get3,
    get6,
    nearest,
    put,
    put3,
    put6,
    root,
    row,
    where_greater,
)
from radarsim.studies.ambiguous_doppler.kernels import records as rec
from radarsim.studies.ambiguous_doppler.kernels.steps import (
    folds_merged,
    motion,
    prior,
    put_single,
    range_taken,
    whether_right,
)

# Rows of one order in memory: state, covariance, probability after the scan, and before it, distance of its plot.
STATE, COVARIANCE, PROBABILITY, BEFORE, DISTANCE, ROWS = 0, 3, 9, 10, 11, 12
FAR = 1e300


class Orders(NamedTuple):
    """The filters of one bank that are made into one.

    designs   address of the designs of all banks
    parts     address of the numbers of its members' designs, or of the banks that it reads
    orders    address of its members' orders
    size      how many they are
    stay      probability that an order stays what it is, over a scan
    """

    designs: Any
    parts: Any
    orders: Any
    size: int
    stay: float


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
            P = add_spread(P, p * get(other, PROBABILITY) / c, get6(other, COVARIANCE), apart)
        put3(own, STATE, x)
        put6(own, COVARIANCE, P)


@part
def taken(own, design, sigma, plot, D, unfolding, moves):
    """Predict one order over a scan and take its plot, in place; PROBABILITY becomes a factor of the likelihood.

    That is exp(-DISTANCE/2) times this factor, apart from constants.
    """
    F, Q = motion(design)
    zero, one = full(0.0), full(1.0)
    x, P = get3(own, STATE), get6(own, COVARIANCE)
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
    """Probabilities of the orders after a plot, from those before it and the likelihoods.

    Gives the least distance and the plot's likelihood over exp(-least/2), apart from constants.
    """
    least, total = get(new, DISTANCE), full(0.0)
    for i in range(1, size):
        distance = get(row(new, i * ROWS), DISTANCE)
        least = where_greater(least, distance, distance, least)
    for i in range(size):
        own = row(new, i * ROWS)
        mu = get(own, BEFORE) * get(own, PROBABILITY) * exponential(0.5 * (least - get(own, DISTANCE)))
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
