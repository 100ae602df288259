"""Labels of the study's sums, with the exact values."""

from dataclasses import dataclass

import numpy as np

from radarsim.engine.results import Axes


@dataclass(frozen=True, kw_only=True)
class FoldedAxes(Axes):
    """Labels of the sums: F filters, K scans, components r, Vr, ar. Exact values are not-a-number where unknown."""

    spans: np.ndarray  #: (K,) of velocity, m/s
    folded: np.ndarray  #: (F,) whether a filter takes the velocity folded
    remembers: np.ndarray  #: (F,) whether it keeps several hypotheses
    combines: np.ndarray  #: (F,) whether it combines orders
    exact_right: np.ndarray  #: (F, K) probability that all folds are right
    oracle_sigma: np.ndarray  #: (F, K, 3) exact σ of the same filter with unfolded velocity
    best_order: np.ndarray  #: (F, K, 3) exact σ of the best member at each scan, chosen with the truth known
    best_combination: np.ndarray  #: (F, K, 3) exact σ of the best linear combination of the members


COMPONENTS = (("r", "m"), ("Vr", "m/s"), ("ar", "m/s2"))
