"""σ with control variates: errors on the same noise whose σ is known exactly.

Of most studies the control is the baseline, where its σ is known exactly. A study of `own_controls` simulates some and
sums what they leave of each squared error, ρ: `controlled` (F, K, C, 5) and `controlled_pairs` (F, K, C), Σ ρ ρ₀ with
the baseline, as `statistics.residual_mean` takes them.
"""

from collections.abc import Callable, Mapping, Sequence
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


def sigma(result: CaseResult) -> statistics.Controlled | None:
    """σ (F, K, C) of a case with controls of its own, its interval and how far it may be trusted; None without them."""
    if "controlled" not in result.sums:
        return None
    error = np.asarray(result.sums["error"])
    return statistics.residual(result.sums["controlled"], error[..., 1], error[..., 3], common.realisations(result))


RESIDUAL = (*CONTROLLED, "n_eff", "apart")


def residuals(results: Sequence[CaseResult], names: Callable[[CaseResult], Sequence[str]]) -> "pd.DataFrame":
    """σ of each filter with the controls that a study simulates; names: of each filter's controls."""
    return common.joined([_residuals(result, names(result)) for result in results], RESIDUAL)


def _residuals(result: CaseResult, names: Sequence[str]) -> dict[str, np.ndarray]:
    of = sigma(result)
    assert of is not None  # asked for of cases with controls alone
    at = f, k, c = common.shown(result)
    return {
        **common.leading(result, f, k, control=common.names(names, f), **common.components(result, c)),
        "n": np.full(f.size, result.count),
        **common.interval("sigma", statistics.Estimate(*(end[at] for end in of.estimate))),
        "variance_factor": of.factor[at],
        "exact_sigma": np.asarray(result.axes.exact_sigma, dtype=float)[at],
        "n_eff": of.effective[at],
        "apart": of.apart[at],
    }


RESIDUAL_GAINS = (
    *("case", "filter", "baseline", "component", "k", "t_s", "n", "gain_percent", "gain_lo", "gain_hi"),
    *("variance_factor", "n_eff", "apart"),
)


def residual_gains(results: Sequence[CaseResult]) -> "pd.DataFrame":
    """Paired gains with the controls that a study simulates; n_eff and apart are those of the worse of both filters."""
    return common.joined([_residual_gains(result) for result in results], RESIDUAL_GAINS)


def _residual_gains(result: CaseResult) -> dict[str, np.ndarray]:
    axes, b, n, of = result.axes, result.axes.baseline, result.count, sigma(result)
    assert of is not None  # asked for of cases with controls alone
    mask = np.array(axes.available)
    mask[b] = False
    at = f, k, c = common.shown(result, mask)
    sums, plain = np.asarray(result.sums["controlled"]), np.asarray(result.sums["error"])
    gain, spread = statistics.residual_gain(sums[at], sums[b, k, c], np.asarray(result.sums["controlled_pairs"])[at], n)
    own, other, cross = plain[at], plain[b, k, c], np.asarray(result.sums["paired"])[at]
    before = statistics.log_variance(own[:, 1], own[:, 3], other[:, 1], other[:, 3], cross, n)
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = before / spread
    return {
        **common.leading(result, f, k, baseline=np.full(f.size, axes.filters[b], dtype=object)),
        "component": common.components(result, c)["component"],
        "n": np.full(f.size, n),
        **common.interval("gain_percent", gain, "gain"),
        "variance_factor": factor,
        "n_eff": np.fmin(of.effective[at], of.effective[b, k, c]),
        "apart": np.fmax(np.abs(of.apart[at]), np.abs(of.apart[b, k, c])),
    }


def narrower_rows(plain: "pd.DataFrame", beside: "pd.DataFrame", ends: Sequence[str]) -> "pd.DataFrame":
    """A table with value, lower and upper end (columns `ends`) of `beside`, row for row, where `narrower` takes them.

    Where `beside` says in `apart` and `n_eff` how far it may be trusted, that counts.
    """
    own, other = (statistics.Estimate(*(table[end].to_numpy() for end in ends)) for table in (plain, beside))
    trust = statistics.trusted(beside["apart"].to_numpy(), beside["n_eff"].to_numpy()) if "apart" in beside else True
    return plain.assign(**dict(zip(ends, statistics.narrower(own, other, trust), strict=True)))


def faults(made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """A line for each table in which plain and controlled values differ beyond chance: a fault of the program.

    Of all rows of a table one lies beyond the bound in 0.27 % of right programs at most: 3 standard errors of one row,
    skewness taken off, which in a few hundred realisations makes five of what would be four.
    """
    found = []
    for name, table in made.items():
        if {"apart", "sigma"} <= set(table) and len(table):
            apart = statistics.unskewed(table["apart"].to_numpy(dtype=float), table["n"].to_numpy(dtype=float))
            worst, bound = table.iloc[int(np.nanargmax(apart))], statistics.furthest(np.isfinite(apart).sum())
            if np.nanmax(apart) > bound:
                where = ", ".join(
                    str(worst[key]) for key in ("case", "filter", "stage", "component", "k") if key in worst
                )
                found.append(
                    f"{name}.csv: {where}: sigma with and without controls differ by {worst['apart']:.3g} standard "
                    f"errors (bound {bound:.3g} over {len(table)} rows): a fault of the program; please report it"
                )
    return found


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
        **common.leading(result, f, k, control=np.full(f.size, axes.filters[b], dtype=object)),
        **common.components(result, c),
        "n": n[at].astype(np.int64),
        **common.interval("sigma", of),
        "variance_factor": factor,
        "exact_sigma": exact[at],
    }
