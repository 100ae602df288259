"""Exact means of a case's filters over the patterns of missed plots. It loads the compiler."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from radarsim.studies.range_doppler.designed_case import DesignedCase
from radarsim.studies.range_doppler.missed_plot_patterns import (
    FOLLOWED_PATTERNS,
    PATTERN_LIMITS,
    PATTERNS_AT_ONCE,
    Design,
    Mixture,
    is_close,
    means_agree,
    mixture,
)

PATTERN_SCANS = 60  # of a run with missed plots: beyond, the mean over patterns takes minutes
ROUGH_PATTERN_SCANS = 2000  # as above, of rough means at the end of a run


def designs(designed_case: DesignedCase) -> list[Design]:
    """The filters of a case."""
    return [Design(d.observes, d.start, d.noise) for d in designed_case.filters]


@dataclass(frozen=True)
class Means:
    """Means over the patterns, not-a-number where they have not settled: sigma and bias (K, 3), nees (K,).

    beside (G, K, 3): sigma over the patterns in which one of G companions has an estimate as well."""

    sigma: np.ndarray
    bias: np.ndarray
    nees: np.ndarray
    companion_sigma: np.ndarray


RECENT_MEANS: dict[tuple, Means] = {}  # of the last filters and worlds: a filter of the range is the same at any σ_V
MAX_RECENT_MEANS = 128


def means(design: Design, companions: Sequence[Design], designed_case: DesignedCase) -> Means:
    """The means of one filter over the patterns; the last ones computed are kept."""
    plot_arrays = [part[: design.observes] for part in designed_case.plots[:3]]
    arrays = (*plot_arrays, designed_case.x, designed_case.random_truth)
    companion_designs = tuple((companion.observes, companion.start) for companion in companions)
    settings = designed_case.dt, designed_case.asked_from_k, designed_case.roughly, designed_case.plots.detection
    key = (design, companion_designs, *settings, *(array.tobytes() for array in arrays))
    result = RECENT_MEANS.pop(key) if key in RECENT_MEANS else compute_means(design, companions, designed_case)
    if len(RECENT_MEANS) >= MAX_RECENT_MEANS:
        del RECENT_MEANS[next(iter(RECENT_MEANS))]
    RECENT_MEANS[key] = result
    return result


def compute_means(design: Design, companions: Sequence[Design], designed_case: DesignedCase) -> Means:
    """The means of one filter over the patterns, with as many patterns side by side as they need to settle."""

    def limited_mixture(max_patterns: int, follow_all: bool = False) -> Mixture:
        return mixture(
            design,
            designed_case.plots,
            designed_case.x,
            designed_case.dt,
            max_patterns,
            companions,
            designed_case.random_truth,
            designed_case.asked_from_k,
            follow_all,
        )

    if designed_case.roughly or 2 ** len(designed_case.t) <= FOLLOWED_PATTERNS:
        limit = PATTERN_LIMITS[0] if designed_case.roughly else PATTERNS_AT_ONCE
        single = limited_mixture(limit, follow_all=not designed_case.roughly)
        return Means(np.sqrt(single.moment), single.bias, single.nees, np.sqrt(single.companion_moment))
    mixtures = map(limited_mixture, PATTERN_LIMITS)
    coarse_mixture, fine_mixture = next(mixtures), next(mixtures)
    while (
        not means_agree(fine_mixture, coarse_mixture, designed_case.asked_from_k)
        and (finer := next(mixtures, None)) is not None
    ):
        coarse_mixture, fine_mixture = fine_mixture, finer
    is_known = is_close(fine_mixture.moment, coarse_mixture.moment)
    whole_state = is_close(fine_mixture.nees, coarse_mixture.nees) & is_known.all(axis=1)
    companion_sigma = np.where(
        is_close(fine_mixture.companion_moment, coarse_mixture.companion_moment),
        np.sqrt(fine_mixture.companion_moment),
        np.nan,
    )
    sigma, bias = (np.where(is_known, values, np.nan) for values in (np.sqrt(fine_mixture.moment), fine_mixture.bias))
    return Means(sigma, bias, np.where(whole_state, fine_mixture.nees, np.nan), companion_sigma)
