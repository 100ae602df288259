"""Labels of the study's sums, and the exact values that go with them."""

from dataclasses import dataclass

import numpy as np

from radarsim.engine.results import Axes


@dataclass(frozen=True, kw_only=True)
class FoldedAxes(Axes):
    """Labels of the sums, F filters over K scans, components r, Vr, ar.

    spans (K,) are those of velocity, m/s. folded (F,) says which filters unfold, remembers (F,) which of them keep
    several hypotheses. exact_right (F, K) is the probability that all folds are right, not-a-number where it is not
    known; oracle_sigma (F, K, 3) the exact σ of the same filter with unfolded velocity, not-a-number likewise.
    """

    spans: np.ndarray
    folded: np.ndarray
    remembers: np.ndarray
    exact_right: np.ndarray
    oracle_sigma: np.ndarray
