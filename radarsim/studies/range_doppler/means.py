"""Exact means of filters that miss plots, over the patterns of plots. Imported where plots are missed: it loads the
compiler."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from radarsim.studies.range_doppler import patterns
from radarsim.studies.range_doppler.design import Designed

PATTERN_SCANS = 60  # of a run with missed plots: beyond, the mean over patterns takes minutes


def designs(made: Designed) -> list[patterns.Design]:
    """The filters of a case."""
    return [patterns.Design(d.observes, d.start, d.noise) for d in made.filters]


@dataclass(frozen=True)
class Means:
    """As `patterns.Mixture`, where known: sigma and bias (K, 3), nees (K,), sigma beside G others (G, K, 3)."""

    sigma: np.ndarray
    bias: np.ndarray
    nees: np.ndarray
    beside: np.ndarray


FOUND: dict[tuple, Means] = {}  # of the last filters and worlds: a filter of the range is the same at any σ_V
MOST_MEANS = 128


def means(design: patterns.Design, beside: Sequence[patterns.Design], made: Designed) -> Means:
    """The means of one filter over the patterns; those of the last that were asked for are kept."""
    seen = [part[: design.observes] for part in made.plots[:3]]
    arrays = (*seen, made.x, made.drawn)
    others = tuple((one.observes, one.start) for one in beside)
    asked = made.dt, made.asked_from_k, made.roughly, made.plots.detection
    key = (design, others, *asked, *(array.tobytes() for array in arrays))
    found = FOUND.pop(key) if key in FOUND else over_patterns(design, beside, made)
    if len(FOUND) >= MOST_MEANS:
        del FOUND[next(iter(FOUND))]
    FOUND[key] = found
    return found


def over_patterns(design: patterns.Design, beside: Sequence[patterns.Design], made: Designed) -> Means:
    """The means of one filter over the patterns, of which as many are kept as it takes."""

    def kept(most: int, whole: bool = False) -> patterns.Mixture:
        return patterns.mixture(design, made.plots, made.x, made.dt, most, beside, made.drawn, made.asked_from_k, whole)

    if made.roughly or 2 ** len(made.t) <= patterns.WHOLE:
        one = kept(patterns.KEPT[0]) if made.roughly else kept(patterns.AT_ONCE, whole=True)
        return Means(np.sqrt(one.moment), one.bias, one.nees, np.sqrt(one.beside))
    mixtures = map(kept, patterns.KEPT)
    coarse, fine = next(mixtures), next(mixtures)
    while not patterns.settled(fine, coarse, made.asked_from_k) and (finer := next(mixtures, None)) is not None:
        coarse, fine = fine, finer
    known = patterns.close(fine.moment, coarse.moment)
    whole_state = patterns.close(fine.nees, coarse.nees) & known.all(axis=1)
    others = np.where(patterns.close(fine.beside, coarse.beside), np.sqrt(fine.beside), np.nan)
    sigma, bias = (np.where(known, values, np.nan) for values in (np.sqrt(fine.moment), fine.bias))
    return Means(sigma, bias, np.where(whole_state, fine.nees, np.nan), others)
