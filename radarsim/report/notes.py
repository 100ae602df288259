"""Where a table's interval covers less than its 95 %: a last column `note`, there only where a row has one.

There is one rule. An interval of σ takes the spread of e² from the sample; where few of the realisations make that
spread, it is too narrow, and more so in the sample that happens to lack them. How many make it is n/(κ − 1), the
effective realisations. They are counted at the row's own scan and at the scans near it, as the few that are missing in
one are seen in another. A gain has a rule more, as both filters may err alike but for a few realisations. Of what a
study knows better of its rare errors (wrong folds, lost bursts) it brings notes of its own.

A row beside which the exact value stands has none: that value is the better one, whatever the interval. What was
measured of marked and of unmarked rows stands in docs/trust.md.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult

if TYPE_CHECKING:
    import pandas as pd

# Of 14 configs, rows whose n/(κ − 1) over all samples together is 100 … 200 cover 93.6 % on the mean, over that 94.4 …
# 95.2, 50 … 100 91, under 10 65 %.
EFFECTIVE = 100
HEAVY = f"under {EFFECTIVE} effective realisations, here or at a scan nearby: heavy tails"
# The few large errors that make a tail are in one sample and not in the next: where they are missing, so is the sign of
# them. They last for some scans, and begin at any: a row is marked too where a scan is so near, in scans of the run.
# Of `multimodel_1hz`, 200 × 1000 realisations, rows that their own scan alone marks cover 16 … 100 % where unmarked;
# with a tenth of the run on either side no row can be told from 95 %; with a twentieth five of `sonar_missed` can.
NEARBY = 0.1
# Of Gaussian errors n/2 count: of few realisations a tail is where much fewer do, κ over 5.
TAIL = 4
# A paired gain of two filters that err nearly alike depends on the few realisations in which they do not, of which the
# moments of either tell nothing. Of `multimodel_families_1hz`, 100 × 1000 realisations, unmarked intervals that are
# under a tenth of what independent filters would have cover 81 %, all others 95 %.
ALIKE = "filters nearly alike: rare differences decide"
INDEPENDENT = 0.1
# Of every row of a table: what its interval is of, not that it rests on too little. What is computed at an estimate has
# a spread of its own: ratios of `sonar_manoeuvre` cover 93 %, one in twenty 31.
VARIES = "interval of sigma alone: the believed one varies from one realisation to the next"
ROUNDING = 1e-9  # of a σ: filters that differ by no more are the same
PAIRED = {"gain": -1, "above_oracle": 1}  # columns NAME_percent, and the sign with which it adds to the baseline's σ
# Tables that bring all their notes, and one whose mean squares are of several components and bounded: unmarked or
# marked by these rules, rows of NEES and NIS cover 95 … 97 %.
OWN = ("rare", "consistency")
SAME = ["case", "filter", "component", "k"]
OF_GAIN = "gain: "  # a note that begins with the name of an interval is of that one alone, here where a row has σ too


def noted(
    made: Mapping[str, "pd.DataFrame"], results: Sequence[CaseResult], exact: bool = True
) -> "dict[str, pd.DataFrame]":
    """The tables by name, those with intervals and with a row to be noted having the column.

    A table may bring notes of its own on rows that have no other. exact: whether the columns `exact_…` hold exact
    values, in place of bounds that the measured ones reach or not (`Study.exact_errors`).
    """
    return {name: _noted(name, table, made, results, exact) for name, table in made.items()}


def _noted(
    name: str, table: "pd.DataFrame", made: Mapping[str, "pd.DataFrame"], results: Sequence[CaseResult], exact: bool
) -> "pd.DataFrame":
    if not len(table) or "case" not in table or not any(str(column).endswith("_lo") for column in table):
        return table
    brought = table["note"].to_numpy(dtype=object) if "note" in table else np.full(len(table), "", dtype=object)
    table = table.drop(columns="note") if "note" in table else table
    notes = brought
    if name not in OWN:
        notes = notes_on(*behind(table, made, results))
        if name == "gains":
            notes = np.where((notes == "") & _alike(table, made["curves"]), ALIKE, notes)
        notes = np.where(notes == "", brought, notes)
        notes = np.where(known(table) & exact, "", notes)
    return table.assign(note=notes) if any(notes) else table


def known(table: "pd.DataFrame") -> np.ndarray:
    """The rows (rows,) beside which exact values stand."""
    columns = [column for column in table if str(column).startswith("exact_") and column != "exact_bias"]
    return table[columns].notna().all(axis=1).to_numpy() & bool(columns)


def heavy(table: "pd.DataFrame") -> np.ndarray:
    """Which rows of a noted table of σ or gains (rows,) are marked."""
    return table["note"].ne("").to_numpy() if "note" in table else np.full(len(table), False)


def concerned(
    made: Mapping[str, "pd.DataFrame"], answer: Callable[[Mapping[str, "pd.DataFrame"]], Sequence[str]]
) -> "dict[str, pd.DataFrame]":
    """By table the marked rows whose intervals the answer gives, or is decided by: with wider ones it reads otherwise.

    answer makes its sentences from the tables.
    """
    said, found = list(answer(made)), {}
    for name, table in made.items():

        def matter(at: np.ndarray, name: str = name, table: "pd.DataFrame" = table) -> bool:
            return list(answer({**made, name: _wider(table, at)})) != said

        marked = heavy(table) & (table["note"] != VARIES) if "note" in table else heavy(table)
        if rows := _least(np.flatnonzero(marked), matter):
            found[name] = table.iloc[rows]
    return found


def _least(rows: np.ndarray, matter: Callable[[np.ndarray], bool]) -> list[int]:
    """Of these rows those that matter, found by halves; all of them where they do together alone."""
    if not len(rows) or not matter(rows):
        return []
    half = len(rows) // 2
    parts = [rows[:half], rows[half:]] if half else []
    return [row for part in parts for row in _least(part, matter)] or rows.tolist()


def _wider(table: "pd.DataFrame", rows: np.ndarray) -> "pd.DataFrame":
    """The table with intervals twice as wide in these rows, of the columns that their notes are of."""
    wider, said = table.copy(), table["note"].to_numpy(dtype=object)[rows]
    lows = [str(column) for column in table if str(column).endswith(("_lo", "_lo_s"))]
    for note in set(said):
        at = table.index[rows[said == note]]
        for low in (one for one in lows if is_of(note, one, lows)):
            ends = [low, low.replace("_lo", "_hi")]
            half = (table.loc[at, ends[1]] - table.loc[at, ends[0]]) / 2
            wider.loc[at, ends] = np.stack([table.loc[at, ends[0]] - half, table.loc[at, ends[1]] + half], axis=1)
    return wider


def is_of(note: str, column: str, columns: Sequence[str]) -> bool:
    """Whether a note is of a column among those with intervals: of those that it begins with the name of, else of all.

    >>> [is_of("gain: heavy tails", one, ["sigma", "gain_percent"]) for one in ("sigma", "gain_percent")]
    [False, True]
    """
    name = note.partition(": ")[0]
    return column.startswith(name) or not any(one.startswith(name) for one in columns)


def needed(rows: "pd.DataFrame", made: Mapping[str, "pd.DataFrame"], results: Sequence[CaseResult]) -> np.ndarray:
    """How many realisations (rows,) marked intervals take, from those that count; not-a-number where not known."""
    n, fewest = behind(rows.drop(columns="n_eff", errors="ignore"), made, results)
    with np.errstate(divide="ignore"):
        return np.where(rows["note"].str.endswith(HEAVY) & (fewest < EFFECTIVE), n * EFFECTIVE / fewest, np.nan)


def notes_on(n: np.ndarray, fewest: np.ndarray) -> np.ndarray:
    """The notes (rows,) on intervals of n realisations (rows,).

    fewest: how many of them count where a few large errors decide, at the scan where they are fewest; not-a-number
    where errors have no tails, or nothing is known of them.
    """
    return np.where(fewest < np.minimum(EFFECTIVE, n / TAIL), HEAVY, "").astype(object)


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
    """Which rows (rows,) compare filters that err nearly alike."""
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
    return found


def behind(
    table: "pd.DataFrame", made: Mapping[str, "pd.DataFrame"], results: Sequence[CaseResult]
) -> tuple[np.ndarray, np.ndarray]:
    """How many realisations stand behind each row (rows,), and the fewest effective ones there and nearby.

    A row's own, those of σ in the same row of curves, or the case's; not-a-number where effective ones are not known. A
    gain rests on the fewer of both filters.
    """
    if "n_eff" in table:
        return table["n"].to_numpy(dtype=float), nearby(table)
    if "n" in table:
        whole = table["n"].to_numpy(dtype=float)
    else:
        whole = table["case"].map({result.name: float(result.count) for result in results}).to_numpy(dtype=float)
    if not set(SAME) <= set(table) or not len(made["curves"]):
        return whole, np.full(len(table), np.nan)
    curves = made["curves"][[*SAME, "n"]].assign(fewest=nearby(made["curves"]))
    n, fewest = _of_curves(table[SAME], curves)
    if "baseline" in table:
        _, other = _of_curves(table[["case", "baseline", "component", "k"]].set_axis(SAME, axis=1), curves)
        fewest = np.fmin(fewest, other)
    return whole if "n" in table else np.where(np.isnan(n), whole, n), fewest


def _of_curves(rows: "pd.DataFrame", curves: "pd.DataFrame") -> tuple[np.ndarray, np.ndarray]:
    """n and the fewest effective realisations of these rows in curves."""
    own = rows.merge(curves, on=SAME, how="left")
    return own["n"].to_numpy(dtype=float), own["fewest"].to_numpy(dtype=float)
