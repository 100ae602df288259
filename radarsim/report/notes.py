"""Where a table's interval rests on too little for its 95 %: a last column `note`, there only where a row has one.

The thresholds and what was measured of the intervals below them stand in `statistics` and docs/trust.md.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report.statistics import FEW, FEW_EVENTS, FEW_HEAVY

if TYPE_CHECKING:
    import pandas as pd

SAME = ["case", "filter", "component", "k"]
# Columns that hold shares of realisations, by table: rare events make their intervals' coverage uneven.
SHARES = {
    "locks": ("lock_rate", "always_rate_3sigma", "always_posterior_rate_3sigma"),
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
    n = _realisations(table, made, results)
    shares = [table[column].to_numpy(dtype=float) for column in SHARES.get(name, ())]
    events = np.min([n * np.minimum(share, 1 - share) for share in shares], axis=0) if shares else np.inf
    notes = notes_on(n, events)
    return table.assign(note=notes) if any(notes) else table


def notes_on(n: np.ndarray, events: np.ndarray | float = np.inf) -> np.ndarray:
    """The notes (rows,) on intervals of n realisations (rows,), for a rate with so many of the rarer outcome."""
    conditions = [n < FEW, events < FEW_EVENTS, n < FEW_HEAVY]
    notes = [f"under {FEW} realisations", f"under {FEW_EVENTS} events", f"under {FEW_HEAVY} realisations: heavy tails?"]
    return np.select(conditions, notes, "").astype(object)


def _realisations(
    table: "pd.DataFrame", made: Mapping[str, "pd.DataFrame"], results: Sequence[CaseResult]
) -> np.ndarray:
    """How many realisations stand behind each row: its own n, that of σ in the same row of curves, or the case's."""
    if "n" in table:
        return table["n"].to_numpy(dtype=float)
    whole = table["case"].map({result.name: float(result.count) for result in results}).to_numpy(dtype=float)
    if not set(SAME) <= set(table) or not len(made["curves"]):
        return whole
    own = table[SAME].merge(made["curves"][[*SAME, "n"]], on=SAME, how="left")["n"].to_numpy(dtype=float)
    return np.where(np.isnan(own), whole, own)
