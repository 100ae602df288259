"""Exact errors where plots may be missed: the mean over all patterns of plots that came and that did not.

A filter's gains depend on the pattern alone, so each pattern has its covariance and its mean error, and σ² is their
mean, weighted by the patterns' probabilities. Their number doubles at every scan. Past some thousands, patterns whose
believed covariances agree to a small fraction are merged, the less probable ones sooner: these have the same gains from
then on, and what they have been through is kept by the first two moments of their errors, so that the merging errs by
about the square of that fraction. How much it errs is seen by merging to a quarter as many, which errs at least four
times as much (tried against all 524 288 patterns of 19 scans; not proved). Where that changes σ by more than `CLOSE`,
more are kept; where it still does with the most of `KEPT`, no exact value is given.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from radarsim.studies.range_doppler.propagation import (
    COLUMNS,
    DIAGONAL,
    ROWS,
    Errors,
    Information,
    Plots,
    defects,
    normalised,
    outer,
)

KEPT = (128, 512, 2048, 8192)  # patterns side by side, each compared with the one before
WHOLE = 2048  # patterns that are never merged: eleven scans
CLOSE = 4e-4  # of σ, between the two; so the finer one is right to about a ten-thousandth
ALIKE = 1e-4  # fraction by which the covariances of merged patterns may differ, to begin with
FINER = 1.5  # with which part of the fraction of the scan before a scan begins
LEAST_STEP, STEP = 1.1, 0.5  # the number of patterns falls about as the square of the fraction, and what is missing
LIGHTER = 4  # patterns 2 to this power less probable may differ twice as much
NEGLIGIBLE = 1e-12  # probability of a pattern that is left out


class Design(NamedTuple):
    """What a filter is made of: 1 (range) or 2 (and velocity) observed, plots in its start, Q (3, 3) of a scan."""

    observes: int
    start: int
    Q: np.ndarray


@dataclass(frozen=True)
class Mixture:
    """Means over the patterns, by scan K and component.

    started (K,) is the probability that the filter has started; available (K, 3) that it has an estimate. bias, moment
    (the mean of e²) and believed (of the variance that it believes), all (K, 3), are means over the patterns with an
    estimate, not-a-number where there is none; nees (K,) is the expectation of eᵀP⁻¹e / 3 over those that have started.
    beside (G, K, 3) is the mean of e² over the patterns in which one of G other filters has an estimate as well.
    """

    started: np.ndarray
    available: np.ndarray
    bias: np.ndarray
    moment: np.ndarray
    believed: np.ndarray
    nees: np.ndarray
    beside: np.ndarray

    @classmethod
    def empty(cls, others: int, scans: int) -> "Mixture":
        """One with nothing known."""
        each = (scans, 3)
        bias, moment, believed = np.full((3, *each), np.nan)
        nees, beside = np.full(scans, np.nan), np.full((others, *each), np.nan)
        return cls(np.zeros(scans), np.zeros(each), bias, moment, believed, nees, beside)


@dataclass
class _Patterns:
    """B patterns: their probabilities, plots so far (counted up to where all filters have started), and whether the
    last scan had one; errors of a filter that has started."""

    weight: np.ndarray
    count: np.ndarray
    detected: np.ndarray
    errors: Errors

    def __getitem__(self, which: np.ndarray) -> "_Patterns":
        return _Patterns(
            self.weight[which], self.count[which], self.detected[which], Errors(self.errors.rows[:, which])
        )

    def joined(self, other: "_Patterns") -> "_Patterns":
        """Both sets side by side."""
        return _Patterns(
            np.concatenate([self.weight, other.weight]),
            np.concatenate([self.count, other.count]),
            np.concatenate([self.detected, other.detected]),
            Errors(np.concatenate([self.errors.rows, other.errors.rows], axis=1)),
        )

    def branched(self, plots: Plots, observes: int, most: int) -> "_Patterns":
        """Each pattern with the next scan's plot, and without it."""
        p, count = plots.detection, np.minimum(self.count + 1, most)
        errors = self.errors.updated(plots, observes)
        with_plot = _Patterns(p * self.weight, count, np.ones(len(count), dtype=bool), errors)
        if p == 1:
            return with_plot
        without = _Patterns((1 - p) * self.weight, self.count, np.zeros(len(count), dtype=bool), self.errors)
        return with_plot.joined(without)


@dataclass
class _Waiting:
    """B patterns in which the filter has not started: as above, with the starts in the making."""

    weight: np.ndarray
    count: np.ndarray
    detected: np.ndarray
    information: Information

    def __getitem__(self, which: np.ndarray) -> "_Waiting":
        information = Information.of(self.information.L[..., which], self.information.Y[..., which])
        return _Waiting(self.weight[which], self.count[which], self.detected[which], information)

    def branched(self, plots: Plots, observes: int) -> "_Waiting":
        """Each pattern with the next scan's plot, and without it; those that count."""
        p, old = plots.detection, self.information
        hit = Information.of(old.L.copy(), old.Y.copy())
        hit.update(plots, observes)
        both = Information.of(np.concatenate([hit.L, old.L], axis=2), np.concatenate([hit.Y, old.Y], axis=2))
        weight = np.concatenate([p * self.weight, (1 - p) * self.weight])
        count = np.concatenate([self.count + 1, self.count])
        detected = np.repeat([True, False], len(self.count))
        return _Waiting(weight, count, detected, both)[weight > NEGLIGIBLE]


def mixture(
    design: Design,
    plots: Plots,
    truth: np.ndarray,
    dt: float,
    most: int = KEPT[-1],
    beside: Sequence[Design] = (),
    drawn: np.ndarray | None = None,
) -> Mixture:
    """Means over all patterns of plots, of a filter on the truth (K, 3) at scans dt (s) apart; beside it others.

    drawn: of a truth that is drawn, as `propagation.defects` takes it.
    """
    scans, columns = len(truth), plots.inputs.shape[1]
    defect = defects(truth, dt, plots, drawn)
    made = Mixture.empty(len(beside), scans)
    enough = max(one.start for one in (design, *beside))
    nothing, Q, alike = np.zeros(0, dtype=int), design.Q[ROWS, COLUMNS][:, None], ALIKE
    started = _Patterns(np.zeros(0), nothing, nothing.astype(bool), Errors(np.zeros((12 + 3 * columns, 0))))
    waiting = _Waiting(np.ones(1), np.zeros(1, dtype=int), np.zeros(1, dtype=bool), Information(columns))
    for k in range(scans):
        started.errors.predict(dt, Q, defect[k])
        waiting.information.predict(dt, defect[k])
        started = started.branched(plots, design.observes, enough)
        waiting = waiting.branched(plots, design.observes)
        begun, waiting = waiting[waiting.count == design.start], waiting[waiting.count < design.start]
        errors = begun.information.errors()
        started = started.joined(_Patterns(begun.weight, begun.count, begun.detected, errors))
        _note(made, k, started, _seen(started, waiting, plots, design.observes), beside)
        if len(started.weight) > most:
            started, alike = _merged(started[started.weight > NEGLIGIBLE], most, alike)
    return made


class _Seen(NamedTuple):
    """What there is at a scan, B patterns: probabilities, plots so far, whether one came; where there is an estimate
    (3, B); its mean error, e² and believed variance, each (3, B)."""

    weight: np.ndarray
    plots: np.ndarray
    detected: np.ndarray
    there: np.ndarray
    bias: np.ndarray
    moment: np.ndarray
    believed: np.ndarray


def _seen(started: _Patterns, waiting: _Waiting, plots: Plots, observes: int) -> _Seen:
    """The patterns that have started, and those whose estimate is the plot that came."""
    errors, held = started.errors, waiting[waiting.detected]
    n = len(held.weight)
    there = np.ones((3, len(started.weight) + n), dtype=bool)
    there[observes:, len(started.weight) :] = False

    def beside(own: np.ndarray, of_plot: np.ndarray) -> np.ndarray:
        return np.concatenate([own, np.repeat(np.append(of_plot, 0.0)[:, None], n, axis=1)], axis=1)

    return _Seen(
        np.concatenate([started.weight, held.weight]),
        np.concatenate([started.count, held.count]),
        np.concatenate([started.detected, held.detected]),
        there,
        beside(errors.E[:, 0], plots.bias),
        beside(errors.second_moments()[DIAGONAL], plots.sigma**2 + plots.bias**2 + plots.sigma_bias**2),
        beside(errors.P[DIAGONAL], plots.sigma**2),
    )


def _note(made: Mixture, k: int, started: _Patterns, seen: _Seen, beside: Sequence[Design]) -> None:
    """Write the means of scan k."""
    made.started[k] = started.weight.sum()
    share = seen.there * seen.weight
    made.available[k] = share.sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        for mean, values in ((made.bias, seen.bias), (made.moment, seen.moment), (made.believed, seen.believed)):
            mean[k] = np.einsum("cb,cb->c", share, values) / made.available[k]
        of_started = normalised(started.errors.P, started.errors.second_moments())
        made.nees[k] = np.divide(of_started @ started.weight, made.started[k])
        for g, other in enumerate(beside):
            observed = np.arange(3)[:, None] < other.observes
            both = share * ((seen.plots >= other.start) | (observed & seen.detected))
            made.beside[g, k] = np.einsum("cb,cb->c", both, seen.moment) / both.sum(axis=1)


def _merged(patterns: _Patterns, most: int, alike: float) -> tuple[_Patterns, float]:
    """The patterns, those that are alike made one, so that there are no more than `most`; how alike they had to be.

    alike: what was enough at the scan before, or ALIKE.
    """
    if len(patterns.weight) <= most:
        return patterns, alike
    places = _places(patterns)
    alike = max(alike / FINER, ALIKE)
    while (count := _number(cell := _cells(places, patterns.count, alike))) > most:
        alike *= max(LEAST_STEP, (count / most) ** STEP)
    return _grouped(patterns, cell), alike


def _number(cell: np.ndarray) -> int:
    """How many cells there are."""
    return int(np.count_nonzero(np.diff(np.sort(cell)))) + 1


def _places(patterns: _Patterns) -> tuple[np.ndarray, np.ndarray]:
    """Where the believed covariances lie, (6, B), in units of a fraction of them, and how much less probable each is
    than the most probable, (B,), in powers of 2 ** LIGHTER."""
    P, weight = patterns.errors.P, patterns.weight
    size = np.log(P[DIAGONAL])
    # Where a correlation is near ±1 it is 1 − |ρ| that must agree.
    inside = 1 - 1e-15
    turned = np.arctanh(np.clip(P[[1, 2, 4]] / np.sqrt(P[[0, 0, 3]] * P[[3, 5, 5]]), -inside, inside))
    lighter = np.round(np.log2(weight.max() / weight) / LIGHTER).astype(np.int64)
    return np.concatenate([size, turned]), lighter


def _cells(places: tuple[np.ndarray, np.ndarray], count: np.ndarray, alike: float) -> np.ndarray:
    """A number (B,) for each pattern, the same where believed covariances agree to about the fraction `alike`.

    That is for the most probable pattern; less probable ones may differ more. count (B,): plots so far.
    """
    values, lighter = places
    cell = lighter * PRIMES[6] + count * PRIMES[7]
    for value, prime in zip(values / (alike * 2.0**lighter), PRIMES[:6], strict=True):
        cell += np.floor(value).astype(np.int64) * prime
    return cell


# Any large primes: cells that differ get numbers that differ, but for one pair in 2⁶⁴.
PRIMES = np.array(
    [1000003, 998244353, 1000000007, 754974721, 167772161, 469762049, 104395303, 2147483647], dtype=np.int64
)


def _grouped(patterns: _Patterns, cell: np.ndarray) -> _Patterns:
    """One pattern for each cell (B,), with the mean of its members' P and the first two moments of their errors."""
    order = np.argsort(cell, kind="stable")
    first = np.flatnonzero(np.diff(cell[order], prepend=cell[order[0]] - 1))
    errors, one = patterns.errors, order[first]
    weight, rows = patterns.weight[order], np.empty((len(errors.rows), len(first)))
    total = np.add.reduceat(weight, first)
    moved = np.concatenate([errors.P, errors.second_moments(), errors.rows[12:]])
    for mean, values in zip(rows, moved, strict=True):  # one row after the other, so that they stay in cache
        mean[:] = np.add.reduceat(values[order] * weight, first) / total
    made = Errors(rows)
    made.rows[6:12] -= outer(made.E)
    return _Patterns(total, patterns.count[one], patterns.detected[one], made)


def settled(fine: Mixture, coarse: Mixture, from_k: int = 0) -> bool:
    """Whether every mean that there is changes by little when merged to a quarter as many patterns.

    from_k: of e² alone, from this scan on, counted from 1; 0: of e² and NEES, at every scan.
    """
    late = slice(max(from_k - 1, 0), None)
    pairs = [(fine.moment[late], coarse.moment[late]), (fine.beside[:, late], coarse.beside[:, late])]
    if from_k == 0:
        pairs.append((fine.nees, coarse.nees))
    return all(bool((close(one, other) | np.isnan(one)).all()) for one, other in pairs)


def close(fine: np.ndarray, coarse: np.ndarray) -> np.ndarray:
    """Where means of e² (any shape) are known: merging to a quarter as many patterns changes σ by less than CLOSE."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.abs(np.sqrt(coarse / fine) - 1) < CLOSE
