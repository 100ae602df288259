"""Filters of several orders that interact by likelihood (IMM: Blom & Bar-Shalom 1988).

Each order merges the folds of a scan. Letters as in `single_fold`; for each order j

    mu   its probability after the scan's plot; c before it
    p    probability that one order passes into another; `stay` that it remains"""

from typing import Any, NamedTuple

from radarsim.kernels import lane_matrices, lanes
from radarsim.kernels.compiler import kernel_part
from radarsim.kernels.kalman_algebra import (
    add_outer,
    add_scaled,
    add_spread,
    predict_covariance,
    predict_state,
    take_rate,
)
from radarsim.kernels.lane_matrices import get3, put3, put6
from radarsim.kernels.lanes import full, get, nearest, put, row, square_root, where_greater
from radarsim.studies.ambiguous_doppler.kernels import layout
from radarsim.studies.ambiguous_doppler.kernels.single_fold import (
    merge_folds,
    motion,
    prior_covariance,
    put_single,
    still_right,
    update_by_range,
)

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


@kernel_part
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
            P = add_spread(P, p * get(source, PROBABILITY) / c, lane_matrices.get6(source, COVARIANCE), difference)
        put3(target, STATE, x)
        put6(target, COVARIANCE, P)


@kernel_part
def take_plot(order, design, sigma, plot, D, unfolding, moves):
    """Predict one order over a scan and update it with the plot, in place.

    PROBABILITY becomes a factor of the likelihood, which is exp(-DISTANCE/2) times this factor, up to a constant."""
    F, Q = motion(design)
    zero, unit = full(0.0), full(1.0)
    x, P = get3(order, STATE), lane_matrices.get6(order, COVARIANCE)
    detected, first = get(plot, layout.DETECTED), get(plot, layout.FIRST)
    if moves:
        x, P = predict_state(x, F), predict_covariance(P, F, Q)
    P, g, weight = update_by_range(P, first, detected - first, sigma[0] * sigma[0])
    z = get(plot, layout.RANGE)
    e = z - x[0]
    distance, factor = 2.0 * weight * (e * e), where_greater(weight, zero, square_root(weight), unit)
    x = add_scaled(x, e, g)
    x = where_greater(first, zero, z, x[0]), x[1], x[2]
    if unfolding != layout.NONE:
        e = get(plot, layout.UNFOLDED) - x[1]
        if unfolding != layout.UNFOLDS:
            e = get(plot, layout.VELOCITY) - x[1]
            e = e - D * nearest(e / D)
        P, g, S = take_rate(P, sigma[1] * sigma[1], detected * design[layout.TAKES_VELOCITY])
        mean, variance, weight_sum = e, zero, unit
        if unfolding != layout.UNFOLDS:
            mean, variance, weight_sum = merge_folds(e, S, D)
        distance = distance + detected * (e * e) / S
        factor = factor * where_greater(detected, zero, weight_sum / square_root(S), unit)
        x = add_scaled(x, mean, g)
        P = add_outer(P, variance, g)
    put3(order, STATE, x)
    put6(order, COVARIANCE, P)
    put(order, PROBABILITY, factor)
    put(order, DISTANCE, distance)


@kernel_part
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


@kernel_part
def run_interacting(bank, unfolding, sigma, spans, plots, out, memory):
    """Run a bank of interacting orders over all scans; memory has room for two times three orders."""
    designs, members, orders, size, stay = bank
    zero = full(0.0)
    old, new = row(memory, 0), row(memory, 3 * ROWS)
    right = full(1.0)
    for i in range(size):
        order = row(old, i * ROWS)
        put3(order, STATE, (zero, zero, zero))
        put6(order, COVARIANCE, prior_covariance(row(designs, members[i] * (layout.DESIGN // 8))))
        put(order, PROBABILITY, full(1.0 / size))
    for k in range(spans.size):
        plot, D = row(plots, k * layout.PLOT), spans[k]
        mix_orders(old, new, size, stay)
        velocity = zero
        for i in range(size):
            order, design = row(new, i * ROWS), row(designs, members[i] * (layout.DESIGN // 8))
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
        z = get(plot, layout.VELOCITY)
        right = still_right(right, plot, z + D * nearest((velocity - z) / D), D)
        output = row(out, k * layout.OUTPUT)
        put_single(output, x, right)
        put3(output, layout.WEIGHTS, w)
        old, new = new, old
