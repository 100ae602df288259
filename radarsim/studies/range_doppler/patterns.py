"""Exact errors where plots may be missed: the mean over all patterns of plots that came and that did not.

A filter's gains depend on the pattern alone, so each pattern has its covariance and its mean error, and σ² is their
mean, weighted by the patterns' probabilities. Their number doubles at every scan. Past some thousands, patterns whose
believed covariances agree to a small fraction are merged, the less probable ones sooner: these have the same gains from
then on, and what they have been through is kept by the first two moments of their errors, so that the merging errs by
about the square of that fraction. How much it errs is seen by merging to a quarter as many, which errs about five times
as much (tried against 131 072 patterns). Where that changes σ by more than `CLOSE`, more are kept; where it still does
with the most of `KEPT`, no exact value is given.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np

from radarsim.studies.range_doppler.propagation import Errors, Information, Plots, defects

KEPT = (512, 2048, 8192)  # patterns side by side, each compared with the one before; the most: thirteen scans
CLOSE = 4e-4  # of σ, between the two; so the finer one is right to about a ten-thousandth
ALIKE = 1e-4  # fraction by which the covariances of merged patterns may differ, to begin with
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
        errors = Errors(*(getattr(self.errors, f.name)[..., which] for f in fields(Errors)))
        return _Patterns(self.weight[which], self.count[which], self.detected[which], errors)

    def joined(self, other: "_Patterns") -> "_Patterns":
        """Both sets side by side."""
        pairs = [(getattr(self.errors, f.name), getattr(other.errors, f.name)) for f in fields(Errors)]
        return _Patterns(
            np.concatenate([self.weight, other.weight]),
            np.concatenate([self.count, other.count]),
            np.concatenate([self.detected, other.detected]),
            Errors(*(np.concatenate(pair, axis=2) for pair in pairs)),
        )

    def branched(self, plots: Plots, observes: int, most: int) -> "_Patterns":
        """Each pattern with the next scan's plot, and without it."""
        p, count = plots.detection, np.minimum(self.count + 1, most)
        errors = Errors(self.errors.P, self.errors.S, self.errors.E)
        errors.update(plots, observes)
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
    empty, nothing = Errors(*(np.zeros((3, n, 0)) for n in (3, 3, columns))), np.zeros(0, dtype=int)
    started = _Patterns(np.zeros(0), nothing, nothing.astype(bool), empty)
    waiting = _Waiting(np.ones(1), np.zeros(1, dtype=int), np.zeros(1, dtype=bool), Information(columns))
    for k in range(scans):
        started.errors.predict(dt, design.Q[..., None], defect[k])
        waiting.information.predict(dt, defect[k])
        started = started.branched(plots, design.observes, enough)
        waiting = waiting.branched(plots, design.observes)
        begun, waiting = waiting[waiting.count == design.start], waiting[waiting.count < design.start]
        errors = begun.information.errors()
        started = started.joined(_Patterns(begun.weight, begun.count, begun.detected, errors))
        _note(made, k, started, _seen(started, waiting, plots, design.observes), beside)
        if len(started.weight) > most:
            started = _merged(started[started.weight > NEGLIGIBLE], most)
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
        beside(diagonal(errors.second_moments()), plots.sigma**2 + plots.bias**2 + plots.sigma_bias**2),
        beside(diagonal(errors.P), plots.sigma**2),
    )


def diagonal(M: np.ndarray) -> np.ndarray:
    """The diagonals (3, B) of matrices (3, 3, B)."""
    return np.einsum("iib->ib", M)


def _nees(errors: Errors) -> np.ndarray:
    """The expectation (B,) of eᵀP⁻¹e / 3."""
    scale = np.sqrt(diagonal(errors.P))
    unit = scale[:, None] * scale
    P, M = (np.moveaxis(part / unit, 2, 0) for part in (errors.P, errors.second_moments()))
    return np.asarray(np.trace(np.linalg.solve(P, M), axis1=1, axis2=2) / 3)


def _note(made: Mixture, k: int, started: _Patterns, seen: _Seen, beside: Sequence[Design]) -> None:
    """Write the means of scan k."""
    made.started[k] = started.weight.sum()
    share = seen.there * seen.weight
    made.available[k] = share.sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        for mean, values in ((made.bias, seen.bias), (made.moment, seen.moment), (made.believed, seen.believed)):
            mean[k] = (share * values).sum(axis=1) / made.available[k]
        made.nees[k] = np.divide(_nees(started.errors) @ started.weight, made.started[k])
        for g, other in enumerate(beside):
            observed = np.arange(3)[:, None] < other.observes
            both = share * ((seen.plots >= other.start) | (observed & seen.detected))
            made.beside[g, k] = (both * seen.moment).sum(axis=1) / both.sum(axis=1)


def _merged(patterns: _Patterns, most: int) -> _Patterns:
    """The patterns, those that are alike made one until there are no more than `most`."""
    alike = ALIKE
    while len(patterns.weight) > most:
        patterns = _grouped(patterns, _cells(patterns, alike))
        alike *= 2
    return patterns


def _cells(patterns: _Patterns, alike: float) -> np.ndarray:
    """A number (B,) for each pattern, the same where believed covariances agree to about the fraction `alike`.

    That is for the most probable pattern; less probable ones may differ more.
    """
    P, weight = patterns.errors.P, patterns.weight
    scale = np.sqrt(diagonal(P))
    correlation = P / (scale[:, None] * scale)
    # Where a correlation is near ±1 it is 1 − |ρ| that must agree.
    inside = 1 - 1e-15
    turned = [np.arctanh(np.clip(correlation[pair], -inside, inside)) for pair in ((0, 1), (0, 2), (1, 2))]
    lighter = np.round(np.log2(weight.max() / weight) / LIGHTER).astype(np.int64)
    values = np.concatenate([2 * np.log(scale), turned]) / (alike * 2.0**lighter)
    parts = np.concatenate([np.floor(values).astype(np.int64), [lighter, patterns.count]])
    return (parts * PRIMES[:, None]).sum(axis=0)


# Any large primes: cells that differ get numbers that differ, but for one pair in 2⁶⁴.
PRIMES = np.array(
    [1000003, 998244353, 1000000007, 754974721, 167772161, 469762049, 104395303, 2147483647], dtype=np.int64
)


def _grouped(patterns: _Patterns, cell: np.ndarray) -> _Patterns:
    """One pattern for each cell (B,), with the mean of its members' P and the first two moments of their errors."""
    order = np.argsort(cell, kind="stable")
    first = np.flatnonzero(np.diff(cell[order], prepend=cell[order[0]] - 1))
    weight, errors = patterns.weight, patterns.errors
    total = np.add.reduceat(weight[order], first)

    def mean(values: np.ndarray) -> np.ndarray:
        return np.add.reduceat((values * weight)[..., order], first, axis=-1) / total

    E = mean(errors.E)
    S = mean(errors.second_moments()) - np.einsum("icb,jcb->ijb", E, E)
    one = order[first]
    return _Patterns(total, patterns.count[one], patterns.detected[one], Errors(mean(errors.P), S, E))


def settled(fine: Mixture, coarse: Mixture) -> bool:
    """Whether every mean that there is changes by little when merged to a quarter as many patterns."""
    pairs = ((fine.moment, coarse.moment), (fine.nees, coarse.nees), (fine.beside, coarse.beside))
    return all(bool((close(one, other) | np.isnan(one)).all()) for one, other in pairs)


def close(fine: np.ndarray, coarse: np.ndarray) -> np.ndarray:
    """Where means of e² (any shape) are known: merging to a quarter as many patterns changes σ by less than CLOSE."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.abs(np.sqrt(coarse / fine) - 1) < CLOSE
