"""Steps of Kalman filters for floats, arrays and lanes: plots whose law is a formula, several plots, two models.

A state is (x, P), its covariance packed row by row. A law of a plot is (mean, S, C): its mean, its packed covariance,
and that with the state, a row for each number.

BLK: Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001.
JUD: Julier, Uhlmann & Durrant-Whyte, IEEE Trans. AC 45 (2000), 477: sigma points.
BST: Bar-Shalom & Tse, Automatica 11 (1975), 451: probabilistic data association (PDA)."""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from radarsim.kernels.formula_functions import exp, log
from radarsim.kernels.lane_loops import accumulate, when
from radarsim.kernels.packed_matrices import add, cholesky, invert, outer_square
from radarsim.kernels.small_matrices import congruence, dot, row_of, times
from radarsim.kernels.tracing import maximum, minimum, sqrt, where

CENTRE = 1 / 3  # weight of the central sigma point
LEAST_DENSITY = 1e-290  # of plots: in place of zero, where a filter expects no false plot and has none in its gate
LEAST_PROBABILITY = 1e-9  # of a model

State = tuple[Sequence[Any], Sequence[Any]]
Law = tuple[Sequence[Any], Sequence[Any], Sequence[Sequence[Any]]]


def linearised_law(P: Sequence[Any], mean: Sequence[Any], rows: Sequence[Sequence[Any]]) -> Law:
    """The law of a plot by its derivatives, rows (m, n), at a state with the covariance P; BLK 10.3."""
    C, m = tuple(times(P, row) for row in rows), len(rows)
    return mean, tuple(dot(rows[j], C[k]) for k in range(m) for j in range(k, m)), C


def unscented_law(
    state: State, plot: Callable[[Sequence[Any]], Sequence[Any]], difference: Callable[[Any, Any], Sequence[Any]]
) -> Law:
    """The law of a plot by sigma points, JUD eq. 12. plot: its numbers of a state; difference: of two plots."""
    (x, P), centre = state, plot(state[0])
    n, L = len(x), cholesky(P, len(x))
    scale, weight = math.sqrt(n / (1 - CENTRE)), (1 - CENTRE) / (2 * n)
    columns = [tuple(scale * L[i][j] if i >= j else 0.0 for i in range(n)) for j in range(n)]
    points = [tuple(sign * a for a in column) for column in columns for sign in (1.0, -1.0)]
    apart = [difference(plot(tuple(a + b for a, b in zip(x, point, strict=True))), centre) for point in points]
    m = len(centre)
    mean = tuple(weight * sum(e[k] for e in apart) for k in range(m))
    S = tuple(weight * sum(e[k] * e[j] for e in apart) - mean[k] * mean[j] for k in range(m) for j in range(k, m))
    C = tuple(
        tuple(weight * sum(p[i] * e[k] for p, e in zip(points, apart, strict=True)) for i in range(n)) for k in range(m)
    )
    return tuple(a + b for a, b in zip(centre, mean, strict=True)), S, C


class Association(NamedTuple):
    """What a filter makes of the plots of a scan.

    e (m,): their innovation; S_inverse: packed, of its covariance; weight: the probability that one of them is the
    target's; spread: packed, of its innovation about e, or None; density: the logarithm of their density, times -2 but
    for a constant; has_plot: 1.0 if the gate has one; is_wrong: 1.0 if the likeliest is not the first."""

    e: Sequence[Any]
    S_inverse: Sequence[Any]
    weight: Any
    spread: Sequence[Any] | None
    density: Any
    has_plot: Any
    is_wrong: Any


def take_plot(e: Sequence[Any], S: Sequence[Any]) -> Association:
    """The association of the only plot, which is the target's, with an innovation e of the packed covariance S."""
    S_inverse, determinant = invert(S, len(e))
    density = dot(e, times(S_inverse, e)) + log(determinant)
    return Association(e, S_inverse, 1.0, None, density, 1.0, 0.0)


class WeighedPlots(NamedTuple):
    """What plots in a gate add up to: likelihoods relative to an expected plot, that of the best one; the innovation,
    of PDA the sum of all and of their squares, each times its likelihood."""

    total: Any
    best: Any
    e: Sequence[Any]
    squares: Sequence[Any]


def associate(
    places: Sequence[Any],
    difference: Callable[[Any], Sequence[Any]],
    S: Sequence[Any],
    rule: str,
    gate: Any,
    false_to_missed: Any,
) -> Association:
    """The association of the plots of a scan, places as in `accumulate`, whose innovations difference(plot) have the
    packed covariance S.

    rule: `known`, the first is the target's; `nearest` in the gate; `pda`, all of the gate by their probabilities, BST
    eq. 3.4 to 3.11. gate: χ² of its bound. false_to_missed: density of false plots times 1 - P_D P_G over P_D."""
    m = 3 if len(S) == 6 else 2
    S_inverse, determinant = invert(S, m)
    missed = 0.0 if rule == "known" else maximum(false_to_missed, LEAST_DENSITY)
    nothing = missed * math.tau ** (m / 2) * sqrt(determinant)

    def weigh(plots: WeighedPlots, place: Any) -> WeighedPlots:
        there, plot = place
        d, is_near = difference(plot), there > 0.5
        if rule != "known":  # the bounds of the gate in its first two numbers: most plots of a scan are beyond
            is_near = is_near & (d[0] * d[0] < gate * S[0]) & (d[1] * d[1] < gate * S[m])

        def add_near(plots: WeighedPlots) -> WeighedPlots:
            square = dot(d, times(S_inverse, d))
            is_inside = is_near & (rule == "known" or square < gate)
            likelihood = where(is_inside, exp(-maximum(square, 0.0) / 2), 0.0)
            if rule == "pda":
                e = tuple(a + likelihood * b for a, b in zip(plots.e, d, strict=True))
                squares = tuple(a + likelihood * b for a, b in zip(plots.squares, outer_square(d), strict=True))
            else:
                e, squares = where(likelihood > plots.best, tuple(d), tuple(plots.e)), plots.squares
            return WeighedPlots(plots.total + likelihood, maximum(plots.best, likelihood), e, squares)

        return when(is_near, plots, add_near)

    none = WeighedPlots(nothing, 0.0, (0.0,) * m, (0.0,) * (len(S) if rule == "pda" else 0))
    target = accumulate(places[:1], none, weigh)
    total, best, e, squares = target if rule == "known" else accumulate(places[1:], target, weigh)
    has_plot, is_wrong = where(best > 0.0, 1.0, 0.0), where(best > target.best, 1.0, 0.0)
    if rule == "pda":
        e = tuple(a / total for a in e)
        spread = tuple(a / total - b for a, b in zip(squares, outer_square(e), strict=True))
        density = log(determinant) - 2 * log(total)
        return Association(e, S_inverse, (total - nothing) / total, spread, density, has_plot, is_wrong)
    density = log(determinant) - 2 * log(where(total > 0.0, best + nothing, 1.0))
    if rule == "known":  # that it is missed says nothing of the model
        density = where(best > 0.0, density, 0.0)
    return Association(e, S_inverse, has_plot, None, density, has_plot, is_wrong)


def log_densities(e: Sequence[Any], S: Sequence[Any]) -> list[Any]:
    """The logarithm of the density of the first number of a plot, of the first two, and so on, by their innovation."""
    L, solved, total, totals = cholesky(S, len(e)), list[Any](), 0.0, []
    for row, number in zip(L, e, strict=True):
        solved.append((number - sum(a * b for a, b in zip(row, solved, strict=False))) / row[-1])
        total = total - solved[-1] * solved[-1] / 2 - log(row[-1]) - math.log(math.tau) / 2
        totals.append(total)
    return totals


def log_mixture(first: Any, second: Any, p: Any) -> Any:
    """The logarithm of a density that is one of two, by their logarithms, with the probabilities p and 1 - p."""
    greatest = maximum(first, second)
    return greatest + log(p * exp(first - greatest) + (1 - p) * exp(second - greatest))


def take(state: State, law: Law, association: Association) -> State:
    """A state after plots of a law, whose covariance includes that of their errors; BST eq. 3.13 to 3.16."""
    (x, P), (_, _, C) = state, law
    n, m = len(x), len(C)
    columns = tuple(tuple(C[k][i] for k in range(m)) for i in range(n))
    K = tuple(times(association.S_inverse, column) for column in columns)
    after = tuple(
        row_of(P, n, i)[j] - association.weight * dot(K[i], columns[j]) for i in range(n) for j in range(i, n)
    )
    if association.spread is not None:
        after = add(after, congruence(K, association.spread))
    return tuple(a + dot(k, association.e) for a, k in zip(x, K, strict=True)), after


def mix(first: State, second: State, p: Any) -> State:
    """The mean and covariance of two states with the probabilities p and 1 - p; BLK 11.6.6."""
    (a, P), (b, Q) = first, second
    d, q = tuple(i - j for i, j in zip(a, b, strict=True)), 1 - p
    x = tuple(p * i + q * j for i, j in zip(a, b, strict=True))
    return x, tuple(p * i + q * j + p * q * k for i, j, k in zip(P, Q, outer_square(d), strict=True))


def mix_pairs(pair: tuple[State, State, Any], other: tuple[State, State, Any], p: Any) -> tuple[State, State, Any]:
    """The states of two models and the probability of the first, of two such pairs with the probabilities p and 1 - p:
    each model's by their moments."""
    (first, second, q), (other_first, other_second, other_q) = pair, other
    own = p * q + (1 - p) * other_q
    return mix(first, other_first, p * q / own), mix(second, other_second, p * (1 - q) / (1 - own)), own


def share_states(first: State, second: State, p: Any, stay: Any) -> tuple[State, State, Any]:
    """The states with which two models go on that change with the probability 1 - stay, and that of the first."""
    own = stay * p + (1 - stay) * (1 - p)
    return mix(first, second, stay * p / own), mix(first, second, (1 - stay) * p / (1 - own)), own


def probability_after(p: Any, one: Association, other: Association) -> Any:
    """The probability of the first of two models after a scan."""
    least = minimum(one.density, other.density)
    a, b = p * exp((least - one.density) / 2), (1 - p) * exp((least - other.density) / 2)
    return minimum(maximum(a / (a + b), LEAST_PROBABILITY), 1 - LEAST_PROBABILITY)
