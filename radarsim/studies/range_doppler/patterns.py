"""Exact errors where plots may be missed: the mean over all patterns of plots that came and that did not.

A filter's gains depend on the pattern alone, so each pattern has its covariance and its mean error, and σ² is their
mean, weighted by the patterns' probabilities. Their number doubles at every scan. Up to `WHOLE` each is followed; what
two have in common is computed once, so that the 2²¹ patterns of 21 scans take 2²² steps. Beyond, those whose believed
covariances agree to a small fraction are merged, the less probable ones sooner: these have the same gains from then on,
and what they have been through is kept by the first two moments of their errors, so that the merging errs by about the
square of that fraction. How much it errs is seen by merging to a quarter as many. Where that changes σ by more than
`CLOSE`, more are kept; where it still does with the most of `KEPT`, no exact value is given. The finer one then erred
by at most 0.6 of the change, against all 524 288 patterns of 19 scans: measured, not proved. What follows from
predictions and updates never moving two covariances apart by a greater factor is a bound of first order in the
fraction, not of second.

Exact means of filters that miss plots, over the patterns of plots. Imported where plots are missed: it loads the
compiler."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from radarsim.studies.range_doppler.filters import Plots, defects
from radarsim.studies.range_doppler.kernels import patterns
from radarsim.studies.range_doppler.tuning import Designed

# ---- patterns --------------------------------------------------------------------------------------------------------
KEPT = (512, 2048, 8192, 32768)  # patterns side by side, each compared with the one before
WHOLE = 1 << 21  # patterns that are never merged: 21 scans, a twentieth of a second
AT_ONCE = 1 << 15  # of these side by side; more are followed to the end piece by piece
CLOSE = 1e-4  # of σ, between the two: the finer one is right to that
MOST_WAITING = 1 << 18  # patterns in which a filter has not started, beyond which nothing is known


class Design(NamedTuple):
    """What a filter is made of: 1 (range) or 2 (and velocity) observed, plots in its start, Q of a scan, packed."""

    observes: int
    start: int
    Q: tuple[float, ...]


@dataclass(frozen=True)
class Mixture:
    """Means over the patterns, by scan K and component; not-a-number where no pattern has an estimate."""

    started: np.ndarray  #: (K,) probability that the filter has started
    available: np.ndarray  #: (K, 3) probability that it has an estimate
    bias: np.ndarray  #: (K, 3) over the patterns with an estimate
    moment: np.ndarray  #: (K, 3) mean of e² over them
    believed: np.ndarray  #: (K, 3) of the variance that it believes
    nees: np.ndarray  #: (K,) expectation of eᵀP⁻¹e / 3 over those that have started
    #: (G, K, 3) mean of e² over the patterns in which one of G other filters has an estimate as well
    beside: np.ndarray

    @classmethod
    def of(cls, sums: np.ndarray) -> "Mixture":
        """The mixture of the sums that `kernels.patterns.add_means` has made."""
        started, nees, bias, moment, believed = sums[:, 0], sums[:, 1], sums[:, 2:5], sums[:, 5:8], sums[:, 8:11]
        available = started[:, None] + sums[:, patterns.FIRST : patterns.OWN]
        in_common = sums[:, patterns.OWN :].reshape(len(sums), -1, 2, 3).swapaxes(0, 1)
        with np.errstate(invalid="ignore", divide="ignore"):
            bias, moment, believed = (part / available for part in (bias, moment, believed))
            return cls(
                started, available, bias, moment, believed, nees / started, in_common[:, :, 1] / in_common[:, :, 0]
            )


def mixture(
    design: Design,
    plots: Plots,
    truth: np.ndarray,
    dt: float,
    max_patterns: int = KEPT[-1],
    companions: Sequence[Design] = (),
    random_truth: np.ndarray | None = None,
    from_k: int = 0,
    follow_all: bool = False,
) -> Mixture:
    """Means over all patterns of plots, of a filter on the truth (K, 3) at scans dt (s) apart; and of its companions.

    random_truth: of a truth that is drawn, as `filters.defects` takes it. from_k: nothing is known before this scan,
    counted from 1. follow_all: beyond `max_patterns` none are merged, but followed piece by piece."""
    defect = defects(truth, dt, plots, random_truth)
    scans, _, columns = defect.shape
    companion_designs = [(companion.observes, companion.start) for companion in companions]
    world = patterns.World(
        defect=np.ascontiguousarray(defect),
        Q=np.array(design.Q),
        R=plots.sigma**2,
        inputs=np.ascontiguousarray(plots.inputs),
        of_plot=np.stack([plots.bias, plots.sigma**2 + plots.bias**2 + plots.sigma_bias**2], axis=1),
        others=np.array(companion_designs, dtype=np.int64).reshape(-1, 2),
        detection=float(plots.detection),
        dt=float(dt),
        observes=design.observes,
        start=design.start,
        enough=max(start for _, start in [(design.observes, design.start), *companion_designs]),
        most=max_patterns,
        whole=follow_all,
        from_k=from_k,
    )
    max_waiting = most_waiting(design.start, scans, plots.detection)
    sums = scans, patterns.OWN + patterns.BESIDE * len(companion_designs)
    if max_waiting > MOST_WAITING:
        return Mixture.of(np.full(sums, np.nan))
    pattern_sums = np.zeros(sums)
    patterns.add_means(
        patterns.room(min(max_patterns, 1 << min(scans, 30)), columns, max_waiting, scans), world, pattern_sums
    )
    return Mixture.of(pattern_sums)


def most_waiting(start: int, scans: int, detection: float) -> int:
    """How many patterns that are not negligible can be without the plots of a start, at any of so many scans."""
    misses = math.ceil(math.log(patterns.NEGLIGIBLE_PROBABILITY) / math.log1p(-detection)) if detection < 1 else 0
    return sum(math.comb(min(scans, start + misses), count) for count in range(start))


def settled(fine: Mixture, coarse: Mixture, from_k: int = 0) -> bool:
    """Whether every mean that there is changes by little when merged to a quarter as many patterns.

    from_k: of e² alone, from this scan on, counted from 1; 0: of e² and NEES, at every scan."""
    late = slice(max(from_k - 1, 0), None)
    pairs = [(fine.moment[late], coarse.moment[late]), (fine.beside[:, late], coarse.beside[:, late])]
    if from_k == 0:
        pairs.append((fine.nees, coarse.nees))
    return all(bool((close(fine_mean, coarse_mean) | np.isnan(fine_mean)).all()) for fine_mean, coarse_mean in pairs)


def close(fine: np.ndarray, coarse: np.ndarray) -> np.ndarray:
    """Where means of e² (any shape) are known: merging to a quarter as many patterns changes σ by less than CLOSE."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.abs(np.sqrt(coarse / fine) - 1) < CLOSE


# ---- means -----------------------------------------------------------------------------------------------------------
PATTERN_SCANS = 60  # of a run with missed plots: beyond, the mean over patterns takes minutes


def designs(designed_case: Designed) -> list[Design]:
    """The filters of a case."""
    return [Design(d.observes, d.start, d.noise) for d in designed_case.filters]


@dataclass(frozen=True)
class Means:
    """As `patterns.Mixture`, where known: sigma and bias (K, 3), nees (K,), sigma beside G others (G, K, 3)."""

    sigma: np.ndarray
    bias: np.ndarray
    nees: np.ndarray
    beside: np.ndarray


FOUND: dict[tuple, Means] = {}  # of the last filters and worlds: a filter of the range is the same at any σ_V
MOST_MEANS = 128


def means(design: Design, companions: Sequence[Design], designed_case: Designed) -> Means:
    """The means of one filter over the patterns; the last ones computed are kept."""
    plot_arrays = [part[: design.observes] for part in designed_case.plots[:3]]
    arrays = (*plot_arrays, designed_case.x, designed_case.drawn)
    companion_designs = tuple((companion.observes, companion.start) for companion in companions)
    settings = designed_case.dt, designed_case.asked_from_k, designed_case.roughly, designed_case.plots.detection
    key = (design, companion_designs, *settings, *(array.tobytes() for array in arrays))
    result = FOUND.pop(key) if key in FOUND else over_patterns(design, companions, designed_case)
    if len(FOUND) >= MOST_MEANS:
        del FOUND[next(iter(FOUND))]
    FOUND[key] = result
    return result


def over_patterns(design: Design, companions: Sequence[Design], designed_case: Designed) -> Means:
    """The means of one filter over the patterns, of which as many are kept as it takes."""

    def kept(max_patterns: int, follow_all: bool = False) -> Mixture:
        return mixture(
            design,
            designed_case.plots,
            designed_case.x,
            designed_case.dt,
            max_patterns,
            companions,
            designed_case.drawn,
            designed_case.asked_from_k,
            follow_all,
        )

    if designed_case.roughly or 2 ** len(designed_case.t) <= WHOLE:
        single = kept(KEPT[0]) if designed_case.roughly else kept(AT_ONCE, follow_all=True)
        return Means(np.sqrt(single.moment), single.bias, single.nees, np.sqrt(single.beside))
    mixtures = map(kept, KEPT)
    coarse, fine = next(mixtures), next(mixtures)
    while not settled(fine, coarse, designed_case.asked_from_k) and (finer := next(mixtures, None)) is not None:
        coarse, fine = fine, finer
    is_known = close(fine.moment, coarse.moment)
    whole_state = close(fine.nees, coarse.nees) & is_known.all(axis=1)
    companion_sigma = np.where(close(fine.beside, coarse.beside), np.sqrt(fine.beside), np.nan)
    sigma, bias = (np.where(is_known, values, np.nan) for values in (np.sqrt(fine.moment), fine.bias))
    return Means(sigma, bias, np.where(whole_state, fine.nees, np.nan), companion_sigma)
