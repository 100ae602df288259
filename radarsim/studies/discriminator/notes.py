"""Where σ of the locked bursts may lack a few that are about to be lost.

Locked is who is within five potential σ. While the forecast still tells more than the window, this is many of the
errors' own σ: a burst that is about to be lost counts as locked there, with an error of a size that decides σ. Samples
have it or not. Which lengths of the window have such bursts at all is told by all estimators of a case, since they see
the same noise: a row is marked where three of its n bursts with such an error would move σ by half its interval, the
size of the error told by any estimator at a length between the window before and the one after. What came out stands in
docs/trust.md.
"""

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import notes, statistics

NEXT = 1e-9  # windows of two estimators whose lengths differ by no more, relative, are of one length


def of_curves(result: CaseResult, n: np.ndarray) -> np.ndarray:
    """What is to be said (F, K, C) of σ of n (F, K, C) locked bursts: `notes.UNSEEN` or nothing."""
    moments, bound = np.asarray(result.sums["error"], dtype=float), np.asarray(result.axes.exact_sigma) ** 2
    largest = nearby(
        _tails(moments, n) * bound, np.where(result.axes.available[..., 0], result.axes.duration_s, np.nan)
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        sigma = statistics.root_mean_square(moments[..., 1], moments[..., 3], n)
        missed = notes.decides_sigma(largest / bound, sigma, n) & (largest > 0)
    return np.where(missed, notes.UNSEEN, "").astype(object)


def _tails(moments: np.ndarray, n: np.ndarray) -> np.ndarray:
    """Squared size (F, K, C) of the errors that make a tail."""
    return notes.size_of_tail(*notes.about_mean(moments, n))


def nearby(size: np.ndarray, length: np.ndarray) -> np.ndarray:
    """The largest size (F, K, C) over all windows that are as long as one from the window before to the one after.

    length (F, K) rises along K; not-a-number where there is no window.
    """
    largest = np.zeros(size.shape)
    for f, k in zip(*np.nonzero(np.isfinite(length)), strict=True):
        least, most = length[f, max(k - 1, 0)], np.nanmax(length[f, : k + 2])
        near = (length >= least * (1 - NEXT)) & (length <= most * (1 + NEXT))
        largest[f, k] = np.nanmax(size[near], axis=0, initial=0.0)
    return largest
