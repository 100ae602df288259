"""σ with the baseline as control variate: where its σ is known exactly, its error shows that of the same noise."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import statistics
from radarsim.report import tables as common

if TYPE_CHECKING:
    import pandas as pd

CONTROLLED = (
    *("case", "filter", "control", "component", "unit", "k", "t_s", "n", "sigma", "sigma_lo", "sigma_hi"),
    *("variance_factor", "exact_sigma"),
)


def controlled(results: Sequence[CaseResult]) -> "pd.DataFrame":
    """Rows where the baseline's σ is known exactly and both have an estimate in the same realisations.

    `variance_factor` is how many times more realisations the plain σ would take for the same interval.
    """
    return common.joined([_controlled(result) for result in results], CONTROLLED)


def _controlled(result: CaseResult) -> dict[str, np.ndarray]:
    axes, b = result.axes, result.axes.baseline
    exact, n = np.asarray(axes.exact_sigma, dtype=float), common.realisations(result)
    mask = axes.available[b] & np.isfinite(exact[b]) & (n == n[b]) & (n > 2)
    mask[b] = False
    at = f, k, c = common.shown(result, mask)
    error = np.asarray(result.sums["error"])
    own, base = error[at], error[b, k, c]
    cross = np.asarray(result.sums["paired"])[at] if f.size else np.zeros(0)
    sums = own[:, 1], own[:, 3], base[:, 1], base[:, 3], cross
    of, factor = statistics.controlled(*sums, exact[b, k, c] ** 2, n[at])
    return {
        "case": np.full(f.size, result.name, dtype=object),
        "filter": common.names(axes.filters, f),
        "control": np.full(f.size, axes.filters[b], dtype=object),
        "component": common.names([name for name, _ in axes.components], c),
        "unit": common.names([unit for _, unit in axes.components], c),
        "k": np.asarray(axes.k)[k],
        "t_s": np.asarray(axes.t_s, dtype=float)[k],
        "n": n[at].astype(np.int64),
        "sigma": of.value,
        "sigma_lo": of.lo,
        "sigma_hi": of.hi,
        "variance_factor": factor,
        "exact_sigma": exact[at],
    }
