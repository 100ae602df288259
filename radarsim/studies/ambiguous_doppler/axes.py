"""Labels of the study's sums, and the exact values that go with them."""

from dataclasses import dataclass

import numpy as np

from radarsim.engine.results import Axes


@dataclass(frozen=True, kw_only=True)
class FoldedAxes(Axes):
    """Labels of the sums, F filters over K scans, components r, Vr, ar.

    spans (K,) are those of velocity, m/s. folded (F,) says which filters unfold, remembers (F,) which of them keep
    several hypotheses, combines (F,) which combine orders. exact_right (F, K) is the probability that all folds are
    right; oracle_sigma (F, K, 3) the exact σ of the same filter with unfolded velocity. Of a filter that combines
    members best_order and best_combination (F, K, 3) are the exact σ of the best member at each scan, and of the best
    linear combination, for those who know the truth. Not-a-number where a value is not known.
    """

    spans: np.ndarray
    folded: np.ndarray
    remembers: np.ndarray
    combines: np.ndarray
    exact_right: np.ndarray
    oracle_sigma: np.ndarray
    best_order: np.ndarray
    best_combination: np.ndarray
