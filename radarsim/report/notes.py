"""Where a table's interval rests on too little for its 95 %: a last column `note`, there only where a row has one.

The thresholds and what was measured of the intervals below them stand in `statistics` and docs/trust.md.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report.statistics import FEW, FEW_EFFECTIVE, FEW_EVENTS, FEW_HEAVY

if TYPE_CHECKING:
    import pandas as pd

THIN = f"under {FEW_EFFECTIVE} effective realisations: heavy tails"
SAME = ["case", "filter", "component", "k"]
# Columns that hold shares of realisations, by table: rare events make their intervals' coverage uneven.
SHARES = {
    "locks": ("lock_rate", "always_rate_3sigma", "always_posterior_rate_3sigma", "wrong_fold"),
    "probabilities": ("probability",),
}


def noted(made: Mapping[str, "pd.DataFrame"], results: Sequence[CaseResult]) -> "dict[str, pd.DataFrame]":
    """The tables by name, those with intervals and with a row to be noted having the column."""
    return {name: _noted(name, table, made, results) for name, table in made.items()}


def _noted(
    name: str, table: "pd.DataFrame", made: Mapping[str, "pd.DataFrame"], results: Sequence[CaseResult]
) -> "pd.DataFrame":
    if not len(table) or "case" not in table or not any(str(column).endswith("_lo") for column in table):
        return table
    n, effective = _realisations(table, made, results)
    shares = [table[column].to_numpy(dtype=float) for column in SHARES.get(name, ()) if column in table]
    events = np.min([n * np.minimum(share, 1 - share) for share in shares], axis=0) if shares else np.inf
    notes = notes_on(n, events, effective)
    return table.assign(note=notes) if any(notes) else table


def notes_on(n: np.ndarray, events: np.ndarray | float = np.inf, effective: np.ndarray | None = None) -> np.ndarray:
    """The notes (rows,) on intervals of n realisations (rows,), for a rate with so many of the rarer outcome.

    effective is how many of them count where a few large errors decide, not-a-number where it is not known.
    """
    known = np.full(n.shape, np.nan) if effective is None else effective
    thin = np.where(np.isnan(known), n < FEW_HEAVY, known < FEW_EFFECTIVE)
    heavy = np.where(np.isnan(known), f"under {FEW_HEAVY} realisations: heavy tails?", THIN).astype(object)
    conditions = [n < FEW, events < FEW_EVENTS, thin]
    words = [f"under {FEW} realisations", f"under {FEW_EVENTS} events", "thin"]
    notes = np.select(conditions, words, "").astype(object)
    return np.where(notes == "thin", heavy, notes)


def thin(curves: "pd.DataFrame") -> np.ndarray:
    """Which rows of curves.csv (rows,) have an interval that rests on too few effective realisations."""
    return curves["n_eff"].to_numpy(dtype=float) < FEW_EFFECTIVE


def _realisations(
    table: "pd.DataFrame", made: Mapping[str, "pd.DataFrame"], results: Sequence[CaseResult]
) -> tuple[np.ndarray, np.ndarray]:
    """How many realisations stand behind each row, and how many effective ones, not-a-number where that is not known.

    A row's own, those of σ in the same row of curves, or the case's. A gain rests on the fewer of both filters.
    """
    if "n_eff" in table:
        return table["n"].to_numpy(dtype=float), table["n_eff"].to_numpy(dtype=float)
    unknown = np.full(len(table), np.nan)
    if "n" in table:
        return table["n"].to_numpy(dtype=float), unknown
    whole = table["case"].map({result.name: float(result.count) for result in results}).to_numpy(dtype=float)
    if not set(SAME) <= set(table) or not len(made["curves"]):
        return whole, unknown
    found = _of_curves(table[SAME], made["curves"])
    n, effective = np.where(np.isnan(found[0]), whole, found[0]), found[1]
    if "baseline" in table:
        other = _of_curves(table[["case", "baseline", "component", "k"]].set_axis(SAME, axis=1), made["curves"])
        effective = np.fmin(effective, other[1])
    return n, effective


def _of_curves(rows: "pd.DataFrame", curves: "pd.DataFrame") -> tuple[np.ndarray, np.ndarray]:
    """n and n_eff of these rows in curves."""
    own = rows.merge(curves[[*SAME, "n", "n_eff"]], on=SAME, how="left")
    return own["n"].to_numpy(dtype=float), own["n_eff"].to_numpy(dtype=float)
