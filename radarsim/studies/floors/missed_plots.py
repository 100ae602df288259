"""The mean bound over patterns of missed plots.

Where plots may be missed, the bound is averaged over the patterns of plots (enumeration: Farina, Ristic & Timmoneri,
IEEE Trans. SP 50, 2002). Where these are too many, the information of a plot is multiplied by the probability of the
plot (information reduction: Hernandez, Farina & Ristic, IEEE Trans. AES 42, 2006): a bound too, as the inverse is
convex, but a lower one. Patterns that do not determine a component, and the worst, so rare that samples may have none
of them, count as if there were no error: a mean that leaves some out is still a bound."""

from collections.abc import Sequence

import numpy as np

from radarsim.studies.floors.bound import (
    ENUMERATION,
    LAGS,
    REDUCTION,
    Bound,
    decompose_information,
    sigma_from_information,
)

MAX_PATTERNS = 1 << 11  # of plots that came or did not: so many of the likeliest are averaged over
IGNORED_SHARE = 1e-4  # of the realisations with an estimate, those of the worst patterns: counts as no error
MAX_IGNORED_CHANGE = 3e-4  # of variances, relative: what ignoring the worst patterns, and rounding, may cause


def missed_plots_bound(
    prior: np.ndarray,
    gained: np.ndarray,
    maps: np.ndarray,
    chance: np.ndarray,
    counts: np.ndarray,
    needed: Sequence[int],
    settling_scans: int,
    immediate: Sequence[bool] = (),
) -> Bound:
    """As `static_bound`, over the realisations with an estimate; chance (K,): the probability of plots at scan k.

    counts (K, C): whether the plots count for a component, which has an estimate from `needed` plots (C,) on, or, where
    `immediate` (C,), at any scan with a plot. `settling_scans`: those that, counting for all components, determine all
    parameters."""
    shape, needs = maps.shape[:2], np.array(needed)
    is_immediate = np.array(immediate or [False] * shape[1])
    sigma, kinds = np.full(shape, np.nan), []
    J, share, count = prior[None], np.ones(1), np.zeros((1, shape[1]), dtype=int)  # of patterns of plots so far
    mean, enumerating = prior.copy(), True
    count_probabilities = [
        np.eye(1, n + 1)[0] for n in (*needed, settling_scans)
    ]  # probabilities of 0, 1, … and of at least n plots
    for k, (p, information) in enumerate(zip(chance, gained, strict=True)):
        # A plot in this scan, with which there are still too few.
        too_few = np.array([p * probabilities[:-2].sum() for probabilities in count_probabilities[:-1]])
        of_scan = (*counts[k], counts[k].all())
        count_probabilities = [
            _after(probabilities, p) if is_counted else probabilities
            for probabilities, is_counted in zip(count_probabilities, of_scan, strict=True)
        ]
        enough_plots = np.array([probabilities[-1] for probabilities in count_probabilities[:-1]])
        enough_for_all = np.minimum(enough_plots, count_probabilities[-1][-1])
        likely = enough_plots + np.where(is_immediate & (counts[k] > 0), too_few, 0.0)
        mean = mean + p * information
        with np.errstate(divide="ignore", invalid="ignore"):
            enumerated = reduced = (
                enough_for_all**2 / likely * sigma_from_information(decompose_information(mean), maps[k]) ** 2
            )
            if enumerating:
                (pattern, has_plot), share = likeliest_patterns(np.array([p, 1 - p])[:, None] * share)
                J = J[pattern] + has_plot[:, None, None] * information
                count = count[pattern] + has_plot[:, None] * counts[k]
                has_estimate = (count >= needs) | (has_plot[:, None] * counts[k] > 0) & is_immediate
                enumerated = pattern_mean(share, _pattern_variances(J, maps[k], has_estimate), likely)
        sigma[k] = np.sqrt(np.fmax(enumerated, reduced))
        enumerating = (
            enumerating and not (reduced > enumerated * (1 + MAX_IGNORED_CHANGE)).any()
        )  # too many are left out
        kinds.append(ENUMERATION if enumerating else REDUCTION)
    blank = np.full(shape, np.nan)
    return Bound(np.where(sigma > 0, sigma, np.nan), np.stack([blank] * len(LAGS)), blank, tuple(kinds), False)


def _pattern_variances(J: np.ndarray, maps: np.ndarray, has_estimate: np.ndarray) -> np.ndarray:
    """Variances (S, C) by patterns with informations J (S, p, p); zero where there is no estimate."""
    variance, rows = np.zeros(has_estimate.shape), has_estimate.any(axis=1)
    values = np.nan_to_num(sigma_from_information(decompose_information(J[rows]), maps)) ** 2
    variance[rows] = np.where(has_estimate[rows], values, 0.0)
    return variance


def pattern_mean(share: np.ndarray, variance: np.ndarray, likely: np.ndarray | float) -> np.ndarray:
    """Mean (C,) of variances (S, C) over patterns with probabilities (S,), in sum `likely` (C,); see IGNORED_SHARE."""
    worst_first = np.argsort(-variance, axis=0, kind="stable")
    weights = np.clip(np.cumsum(share[worst_first], axis=0) - IGNORED_SHARE * likely, 0, share[worst_first])
    mean: np.ndarray = (weights * np.take_along_axis(variance, worst_first, axis=0)).sum(axis=0) / likely
    return mean


def likeliest_patterns(shares: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """The likeliest of the patterns that go on with a plot and without one, which have the probabilities (2, S).

    Gives for each (n,) the number of the old pattern and whether a plot came (1 or 0), and its probability (n,)."""
    all_shares = shares.ravel()
    chosen = np.flatnonzero(all_shares)
    if len(chosen) > MAX_PATTERNS:
        chosen = np.argsort(-all_shares, kind="stable")[:MAX_PATTERNS]
    without, pattern = np.divmod(chosen, shares.shape[1])
    return (pattern, 1 - without), all_shares[chosen]


def _after(probabilities: np.ndarray, p: float) -> np.ndarray:
    """The probabilities of 0, 1, … and of at least n plots after one more scan, which has a plot with probability p."""
    after = (1 - p) * probabilities
    after[1:] += p * probabilities[:-1]
    after[-1] += p * probabilities[-1]
    return after
