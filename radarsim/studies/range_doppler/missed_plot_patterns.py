"""Exact errors where plots may be missed: the mean over all patterns of plots.

A filter's gains depend on the pattern alone, so each pattern has its covariance and its mean error, and σ² is their
mean, weighted by the patterns' probabilities. Their number doubles at every scan. Up to FOLLOWED_PATTERNS each is
followed; what two have in common is computed once, so that the 2²¹ patterns of 21 scans take 2²² steps. Beyond, those
whose believed covariances agree to a small fraction are merged, the less probable ones sooner: these have the same
gains from then on, and what they have been through is kept by the first two moments of their errors, so that the
merging errs by about the square of that fraction. How much it errs is seen by merging to a quarter as many. Where that
changes σ by more than MAX_CHANGE, more are kept; where it still does with the most of PATTERN_LIMITS, no exact value is
given. The finer one then erred by at most 0.6 of the change, against all 524 288 patterns of 19 scans: measured, not
proved. What follows from predictions and updates never moving two covariances apart by a greater factor is a bound of
first order in the fraction, not of second."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from radarsim.studies.range_doppler.error_recursion import Plots, defects
from radarsim.studies.range_doppler.kernels import pattern_merging, patterns

PATTERN_LIMITS = (512, 2048, 8192, 32768)  # patterns side by side, each compared with the one before
FOLLOWED_PATTERNS = 1 << 21  # patterns that are never merged: 21 scans, a twentieth of a second
PATTERNS_AT_ONCE = 1 << 15  # of these side by side; more are followed to the end piece by piece
MAX_CHANGE = 1e-4  # of σ, between the two: the finer one is right to that
MAX_WAITING = 1 << 18  # patterns in which a filter has not started, beyond which nothing is known


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
    companion_moment: np.ndarray

    @classmethod
    def from_sums(cls, sums: np.ndarray) -> "Mixture":
        """The mixture of the sums that `kernels.patterns.add_means` has made."""
        started, nees, bias, moment, believed = sums[:, 0], sums[:, 1], sums[:, 2:5], sums[:, 5:8], sums[:, 8:11]
        available = started[:, None] + sums[:, patterns.FIRST_PLOT_PROBABILITY : patterns.FILTER_MEANS]
        in_common = sums[:, patterns.FILTER_MEANS :].reshape(len(sums), -1, 2, 3).swapaxes(0, 1)
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
    max_patterns: int = PATTERN_LIMITS[-1],
    companions: Sequence[Design] = (),
    random_truth: np.ndarray | None = None,
    from_k: int = 0,
    follow_all: bool = False,
) -> Mixture:
    """Means over all patterns of plots, of a filter on the truth (K, 3) at scans dt (s) apart; and of its companions.

    random_truth: of a truth that is drawn, as `error_recursion.defects` takes it. from_k: no mean is computed before
    this scan, counted from 1. follow_all: beyond `max_patterns` patterns are followed piece by piece, none merged."""
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
    max_waiting = waiting_limit(design.start, scans, plots.detection)
    sums = scans, patterns.FILTER_MEANS + patterns.COMPANION_MEANS * len(companion_designs)
    if max_waiting > MAX_WAITING:
        return Mixture.from_sums(np.full(sums, np.nan))
    pattern_sums = np.zeros(sums)
    patterns.add_means(
        pattern_merging.make_workspace(min(max_patterns, 1 << min(scans, 30)), columns, max_waiting, scans),
        world,
        pattern_sums,
    )
    return Mixture.from_sums(pattern_sums)


def waiting_limit(start: int, scans: int, detection: float) -> int:
    """How many patterns that are not negligible can be without the plots of a start, at any of so many scans."""
    misses = math.ceil(math.log(patterns.NEGLIGIBLE_PROBABILITY) / math.log1p(-detection)) if detection < 1 else 0
    return sum(math.comb(min(scans, start + misses), count) for count in range(start))


def means_agree(fine_mixture: Mixture, coarse_mixture: Mixture, from_k: int = 0) -> bool:
    """Whether every mean that there is changes by little when merged to a quarter as many patterns.

    from_k: of e² alone, from this scan on, counted from 1; 0: of e² and NEES, at every scan."""
    late = slice(max(from_k - 1, 0), None)
    pairs = [
        (fine_mixture.moment[late], coarse_mixture.moment[late]),
        (fine_mixture.companion_moment[:, late], coarse_mixture.companion_moment[:, late]),
    ]
    if from_k == 0:
        pairs.append((fine_mixture.nees, coarse_mixture.nees))
    return all(bool((is_close(fine_mean, coarse_mean) | np.isnan(fine_mean)).all()) for fine_mean, coarse_mean in pairs)


def is_close(fine_mean: np.ndarray, coarse_mean: np.ndarray) -> np.ndarray:
    """Where means of e² (any shape) are known: merging to a quarter as many patterns changes σ by less than CLOSE."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.abs(np.sqrt(coarse_mean / fine_mean) - 1) < MAX_CHANGE
