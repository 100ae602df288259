"""Where a table's interval rests on too little for its 95 %: a last column `note`, there only where a row has one.

The thresholds and what was measured of the intervals below them stand in `statistics` and docs/trust.md.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import tables as common
from radarsim.report.statistics import ALIKE as ALIKE_SQUARES
from radarsim.report.statistics import FEW, FEW_EFFECTIVE, FEW_EVENTS, FEW_HEAVY, Z95, Estimate, root_mean_square

if TYPE_CHECKING:
    import pandas as pd

THIN = f"under {FEW_EFFECTIVE} effective realisations: heavy tails"
NEAR = f"under {FEW_EFFECTIVE} effective realisations nearby: heavy tails"
UNSEEN = "larger errors at other scans: a sample may lack them here"
HEAVY = (THIN, NEAR, UNSEEN)
# An error of most bias and little spread hides the few realisations that make its spread: effective ones are counted
# of the errors about their mean too, where the sums tell (n_eff in the table is of the errors themselves).
# What happens in fewer than three of n realisations is missed by one sample in twenty. Where a filter has errors of a
# tail, κ over TAIL, at any scan, one of their size, 3/n of the time, must not move σ or bias by more than half the
# interval. Of `multimodel` and `ambiguous_doppler`, 200 × 1000 realisations, unmarked rows of σ covered 92.1 % without
# both, 94.8 with them; the worst row none at all.
TAIL, MISSED, MOVED = 5.0, 3.0, 0.5
# The few large errors that make a tail are in one sample and not in the next: where they are missing, so is the sign of
# them. They last for some scans, and begin at any: a row is marked too where a scan is so near, in scans of the run.
# Of `multimodel_1hz`, 200 × 1000 realisations, rows that their own scan alone marks cover 16 … 100 % where unmarked;
# with a tenth of the run on either side no row can be told from 95 %; with a twentieth five of `sonar_missed` can.
NEARBY = 0.1
# A paired gain of two filters that err nearly alike depends on the few realisations in which they do not, of which the
# moments of either tell nothing. Of `multimodel_families_1hz`, 200 × 1000 realisations, intervals that are under a
# tenth of what independent filters would have cover 53 … 91 %, to 0.2 of it 92 %, to 0.3 and over 95 %. Gaussian errors
# need no such mark: they are those of filters that are known exactly.
ALIKE = "filters nearly alike: rare differences decide"
INDEPENDENT = 0.3
ROUNDING = 1e-9  # of a σ: filters that differ by no more are the same
PAIRED = {"gain": -1, "above_oracle": 1}  # columns NAME_percent, and the sign with which it adds to the baseline's σ
GAINS = {"gains": "curves", "controlled_gains": "controlled"}  # tables of gains, and those of their σ
SAME = ["case", "filter", "component", "k"]
# Columns that hold shares of realisations, by table: rare events make their intervals' coverage uneven.
SHARES = {
    "locks": ("lock_rate", "always_rate_3sigma", "always_posterior_rate_3sigma", "wrong_fold"),
    "probabilities": ("probability",),
    "orders": ("weight",),
    "folds": (),  # those of rare events alone
}
# Columns that predict a share, where a table has one: rows are marked by these events in place of those that came.
# Where about twenty are to come, a row that is marked by what came is unmarked when chance brought more: such rows of
# `ambiguous_doppler`'s calibration, 200 × 1000 realisations, cover 93.9 %, and 95.0 % when marked by what is predicted.
FORETOLD = {"calibration": ("expected",)}
BOUNDED = {"calibration"}  # tables of yes or no alone, of realisations of their own: no tails


def noted(made: Mapping[str, "pd.DataFrame"], results: Sequence[CaseResult]) -> "dict[str, pd.DataFrame]":
    """The tables by name, those with intervals and with a row to be noted having the column.

    A table may bring notes of its own on rows that have no other.
    """
    curves = made.get("curves")
    if curves is not None and len(curves):
        made = {**made, "curves": _about_their_mean(curves, results)}
    found = {name: _noted(name, table, made, results) for name, table in made.items()}
    if curves is not None and len(curves):
        found["curves"] = found["curves"].drop(columns=["unseen"]).assign(n_eff=curves["n_eff"])
    return found


def _about_their_mean(curves: "pd.DataFrame", results: Sequence[CaseResult]) -> "pd.DataFrame":
    """Curves with effective realisations of the errors about their mean, where these are fewer, and what is `unseen`.

    Only of curves that are made of the sums as `tables.curves` makes them; of others both stay as they are.
    """
    kept = curves.assign(unseen=False)
    if any("error" not in result.sums for result in results):
        return kept
    rows = [_rows(result) for result in results]
    if not rows or sum(len(n) for n, *_ in rows) != len(curves):
        return kept
    n, effective, unseen = (np.concatenate(part) for part in zip(*rows, strict=True))
    if not np.array_equal(n, curves["n"].to_numpy(dtype=float)):
        return kept
    return curves.assign(n_eff=np.fmin(curves["n_eff"].to_numpy(dtype=float), effective), unseen=unseen)


def _rows(result: CaseResult) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Realisations, effective ones of the errors about their mean, and whether larger ones may be missing; (rows,)."""
    at = common.shown(result)
    every = common.realisations(result)
    n, (variance, kurtosis) = every[at], _about_mean(result)
    moments = np.asarray(result.sums["error"], dtype=float)
    largest = _of_tail(result, variance, kurtosis).max(axis=1, keepdims=True)  # over the scans
    with np.errstate(invalid="ignore", divide="ignore"):
        of_sigma = decides_sigma(largest, root_mean_square(moments[..., 1], moments[..., 3], every), every)
        of_bias = MISSED / every * np.sqrt(largest) > MOVED * Z95 * np.sqrt(variance / every)
        effective = every / np.maximum(kurtosis - 1, ALIKE_SQUARES)
    return n, effective[at], ((of_sigma | of_bias) & (largest > 0) & (every > 0))[at]


def decides_sigma(largest: np.ndarray, sigma: Estimate, n: np.ndarray) -> np.ndarray:
    """Where `MISSED` of n realisations with an error of this squared size would move σ by `MOVED` of its half-width."""
    with np.errstate(invalid="ignore", divide="ignore"):
        moved = MISSED / n * largest / sigma.value**2 / 2
        return np.asarray(moved > MOVED * (sigma.hi - sigma.lo) / 2 / sigma.value)


def _about_mean(result: CaseResult) -> tuple[np.ndarray, np.ndarray]:
    """`about_mean` of a case's errors (F, K, C)."""
    return about_mean(np.asarray(result.sums["error"], dtype=float), common.realisations(result))


def about_mean(moments: np.ndarray, n: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Variance and κ (…) of errors about their mean, from Σe, Σe², Σe³, Σe⁴ (…, 4) of n (…) realisations.

    κ is not-a-number where the mean is all but rounding.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        m1, m2, m3, m4 = np.moveaxis(moments / n[..., None], -1, 0)
        variance = np.maximum(m2 - m1**2, 0.0)
        fourth = np.maximum(m4 - 4 * m1 * m3 + 6 * m1**2 * m2 - 3 * m1**4, 0.0)
        return variance, np.where(variance > ROUNDING * m2, fourth / variance**2, np.nan)


def tails(result: CaseResult) -> np.ndarray:
    """Squared size (F, K, C) of the errors that make a tail at each scan; 0 where there is none."""
    return _of_tail(result, *_about_mean(result))


def _of_tail(result: CaseResult, variance: np.ndarray, kurtosis: np.ndarray) -> np.ndarray:
    """`tails` of known moments about the mean."""
    return np.where(result.axes.available, size_of_tail(variance, kurtosis), 0.0)


def size_of_tail(variance: np.ndarray, kurtosis: np.ndarray) -> np.ndarray:
    """Squared size of the errors that make a tail, of moments about the mean; 0 where there is none."""
    return np.where(kurtosis > TAIL, kurtosis * variance, 0.0)


def _noted(
    name: str, table: "pd.DataFrame", made: Mapping[str, "pd.DataFrame"], results: Sequence[CaseResult]
) -> "pd.DataFrame":
    table = table.copy(deep=False)
    if not len(table) or "case" not in table or not any(str(column).endswith("_lo") for column in table):
        return table
    if name == "rare":
        return table if any(table["note"]) else table.drop(columns="note")
    n, effective, nearby = _realisations(table, made, results)
    columns = [column for column in (*SHARES.get(name, ()), *FORETOLD.get(name, ())) if column in table]
    shares = [table[column].to_numpy(dtype=float) for column in columns]
    events = np.min([n * np.minimum(share, 1 - share) for share in shares], axis=0) if shares else np.inf
    if name in SHARES and "rare" in made:  # their rates are weighted, and have notes of their own
        events = np.where(table["case"].isin(made["rare"]["case"]), np.inf, events)
    if name in BOUNDED:
        effective = np.full(n.shape, np.inf)
    notes = notes_on(n, events, effective, None if name in BOUNDED else nearby)
    if name in GAINS:
        notes = np.where((notes == "") & _alike(table, made[GAINS[name]]), ALIKE, notes)
    if "unseen" in table:
        notes = np.where((notes == "") & table["unseen"].to_numpy(dtype=bool), UNSEEN, notes)
    if "note" in table:
        notes = np.where(notes == "", table.pop("note"), notes)
    return table.assign(note=notes) if any(notes) else table


def heavy(curves: "pd.DataFrame") -> np.ndarray:
    """Which rows of curves.csv (rows,) are marked for heavy tails."""
    return curves["note"].isin(HEAVY).to_numpy() if "note" in curves else thin(curves)


def notes_on(
    n: np.ndarray,
    events: np.ndarray | float = np.inf,
    effective: np.ndarray | None = None,
    nearby: np.ndarray | None = None,
) -> np.ndarray:
    """The notes (rows,) on intervals of n realisations (rows,), for a rate with so many of the rarer outcome.

    effective is how many of them count where a few large errors decide, not-a-number where it is not known; nearby the
    fewest of the scans beside it.
    """
    known = np.full(n.shape, np.nan) if effective is None else effective
    least = known if nearby is None else nearby
    thin = np.where(np.isnan(known), n < FEW_HEAVY, least < FEW_EFFECTIVE)
    own = np.where(known < FEW_EFFECTIVE, THIN, NEAR)
    heavy = np.where(np.isnan(known), f"under {FEW_HEAVY} realisations: heavy tails?", own).astype(object)
    conditions = [n < FEW, events < FEW_EVENTS, thin]
    words = [f"under {FEW} realisations", f"under {FEW_EVENTS} events", "thin"]
    notes = np.select(conditions, words, "").astype(object)
    return np.where(notes == "thin", heavy, notes)


def thin(curves: "pd.DataFrame") -> np.ndarray:
    """Which rows of curves.csv (rows,) have an interval that rests, there or nearby, on too few effective ones."""
    return nearby(curves) < FEW_EFFECTIVE


def nearby(curves: "pd.DataFrame") -> np.ndarray:
    """The fewest effective realisations (rows,) within NEARBY of the scans on either side, of a filter's component."""
    own = curves["n_eff"].to_numpy(dtype=float)
    fewest = own.copy()
    for rows in curves.groupby(SAME[:3], sort=False).indices.values():
        reach = max(1, round(NEARBY * len(rows)))
        for by in range(1, min(reach + 1, len(rows))):
            fewest[rows[by:]] = np.fmin(fewest[rows[by:]], own[rows[:-by]])
            fewest[rows[:-by]] = np.fmin(fewest[rows[:-by]], own[rows[by:]])
    return fewest


def _alike(gains: "pd.DataFrame", curves: "pd.DataFrame") -> np.ndarray:
    """Which rows (rows,) compare filters that err nearly alike and of which not both are known exactly."""
    ends = ["sigma", "sigma_lo", "sigma_hi"]
    own = gains[SAME].merge(curves[[*SAME, *ends]], on=SAME, how="left")
    sigma, low, high = (own[end].to_numpy(dtype=float) for end in ends)
    with np.errstate(invalid="ignore", divide="ignore"):
        independent = np.sqrt(2) * (high - low) / sigma
    found = np.full(len(gains), False)
    for name, sign in PAIRED.items():
        if f"{name}_percent" in gains:
            low, high = (gains[f"{name}_{end}"].to_numpy(dtype=float) for end in ("lo", "hi"))
            share = 100 + sign * gains[f"{name}_percent"].to_numpy(dtype=float)
            with np.errstate(invalid="ignore", divide="ignore"):  # a gain of 100 % leaves nothing to be alike
                width = (high - low) / share
            found |= (width < INDEPENDENT * independent) & (width > ROUNDING)
    return found & (gains["exact_percent"].isna().to_numpy() if "exact_percent" in gains else True)


def _realisations(
    table: "pd.DataFrame", made: Mapping[str, "pd.DataFrame"], results: Sequence[CaseResult]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """How many realisations stand behind each row, how many effective ones, and the fewest of these nearby.

    A row's own, those of σ in the same row of curves, or the case's; not-a-number where effective ones are not known. A
    gain rests on the fewer of both filters.
    """
    if "n_eff" in table:
        return table["n"].to_numpy(dtype=float), table["n_eff"].to_numpy(dtype=float), nearby(table)
    if "n" in table:
        whole = table["n"].to_numpy(dtype=float)
    else:
        whole = table["case"].map({result.name: float(result.count) for result in results}).to_numpy(dtype=float)
    unknown = np.full(len(table), np.nan)
    if not set(SAME) <= set(table) or not len(made["curves"]):
        return whole, unknown, unknown
    curves = made["curves"]
    least = np.where(curves["unseen"], 0.0, nearby(curves)) if "unseen" in curves else nearby(curves)
    curves = curves[[*SAME, "n", "n_eff"]].assign(nearby=least)
    n, effective, least = _of_curves(table[SAME], curves)
    if "baseline" in table:
        _, *other = _of_curves(table[["case", "baseline", "component", "k"]].set_axis(SAME, axis=1), curves)
        effective, least = np.fmin(effective, other[0]), np.fmin(least, other[1])
    return whole if "n" in table else np.where(np.isnan(n), whole, n), effective, least


def _of_curves(rows: "pd.DataFrame", curves: "pd.DataFrame") -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """n, n_eff and nearby of these rows in curves."""
    own = rows.merge(curves, on=SAME, how="left")
    n, effective, least = (own[name].to_numpy(dtype=float) for name in ("n", "n_eff", "nearby"))
    return n, effective, least
