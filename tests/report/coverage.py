"""How often the intervals of a study's tables hold what they are of, over many runs of its own realisations.

`python -m tests.report.coverage` measures every shipped config and prints the table of docs/trust.md.
"""

import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.stats import binom

from radarsim.api import result_content
from radarsim.api.case_work import CaseWork
from radarsim.api.configs import load
from radarsim.config.experiment import Experiment
from radarsim.config.find_files import SHIPPED
from radarsim.engine.results import CaseResult
from radarsim.report import interval_notes
from radarsim.report.row_notes import concerns
from radarsim.report.statistics import Z95
from radarsim.studies import registry

# What tells the rows of a table apart; `plots` and `confirm_plots` are settings where they stand, but in gates.csv.
LABELS = (
    *("case", "filter", "baseline", "component", "model", "order", "k", "stage", "phase", "shift", "event", "delay_s"),
    *(
        "truth",
        "duration_s",
        "threshold_k",
        "threshold",
        "association",
        "confirm_plots",
        "confirm_scans",
        "quantity",
        "degree",
    ),
    *("frame", "range_m"),
    *("bin_lo", "plots", "idealisation", "since_loss"),
)
MEASURED = {("gates", "plots")}
NO_INTERVALS = ("bin_lo", "nees_bound_lo", "nis_bound_lo")
EXACT = {("curves", "sigma"): "exact_sigma", ("gains", "gain_percent"): "exact_percent"}
RUNS, N = 8, 1000  # of every shipped config
BLOCK = 4096
# Beside what is shipped: P1's radars miss no plots there, and their errors have tails where they do.
BESIDE = [("rls2", [f"radar.detection_probability={p}"]) for p in (0.9, 0.7)]
SAME = 1e-9  # of a column's size: an interval as narrow has no chance in it but rounding's
LOW, HIGH = 0.93, 0.97
RARE = 1e-5  # a row that covers just LOW, or HIGH, is called wrong so often


class Kept(NamedTuple):
    """Of the rows (n,) of an interval: runs in which each was unmarked, and of these those that held the truth.

    by_run (runs, 2) has both counts of each run, over its rows.
    """

    unmarked: np.ndarray
    held: np.ndarray
    by_run: np.ndarray

    @property
    def share(self) -> float:
        """Held, of all unmarked."""
        return self.held.sum() / self.unmarked.sum()

    @property
    def error(self) -> float:
        """Standard error of `share` from how it varies between runs: the rows of one run share their noise."""
        unmarked, held = self.by_run.T
        return float(np.sqrt(np.sum(np.square(held - self.share * unmarked))) / unmarked.sum())

    def wrong(self, runs: int, high: float = HIGH) -> np.ndarray:
        """Rows, unmarked in half of the runs or more, whose share is no chance of 93 … 97 %; and all rows of which an
        interval is unmarked and does not hold in so many of the runs that it is no chance of 7 %.
        """
        n, k = self.unmarked, self.held
        few, many = binom.cdf(k, n, LOW) < RARE, binom.sf(k - 1, n, high) < RARE
        return np.flatnonzero((n >= runs / 2) & (few | many) | (binom.sf(n - k - 1, runs, 1 - LOW) < RARE))


class Seen(NamedTuple):
    """Of one run and one column with an interval: the rows (n,) that it has, their marks, and which held the truth."""

    run: int
    table: str
    column: str
    rows: np.ndarray
    note: np.ndarray
    held: np.ndarray


def kept(experiment: Experiment, n: int, runs: int) -> dict[tuple[str, str], Kept]:
    """Of so many runs of n realisations each, by table and column: which rows were unmarked and held the truth.

    The truth is what all runs give together; its own error widens what is seen of an interval's misses by a factor of
    √(1 + 1/runs) at most.
    """
    whole, every = seen(experiment, n, runs)
    found = {}
    for name, table in whole.items():
        for value, *_ in _intervals(name, table):
            zeros = np.zeros((2, len(table)), dtype=int)
            found[name, value] = Kept(zeros[0], zeros[1], np.zeros((runs, 2), dtype=int))
    for one in every:
        free = one.note == ""
        of = found[one.table, one.column]
        of.unmarked[one.rows[free]] += 1
        of.held[one.rows[free]] += one.held[free]
        of.by_run[one.run] += (free.sum(), (free & one.held).sum())
    return {key: one for key, one in found.items() if one.unmarked.any()}


def by_mark(experiment: Experiment, n: int, runs: int, further: int = 0) -> pd.DataFrame:
    """How many intervals of each table and column there were, by what their note says, and how many held the truth.

    The truth is known the better by so many `further` realisations.
    """
    _, every = seen(experiment, n, runs, further)
    parts = [
        pd.DataFrame({"table": one.table, "column": one.column, "note": one.note, "held": one.held}) for one in every
    ]
    counted = pd.concat(parts).groupby(["table", "column", "note"])["held"].agg(["size", "sum"]).reset_index()
    return counted.rename(columns={"size": "intervals", "sum": "held"})


def shipped(config: str, overrides: Sequence[str] = ()) -> pd.DataFrame:
    """`by_mark` of the middle case of a shipped config, of 8 runs of 1000 realisations, or of as many as it has."""
    experiment = load(config, overrides)
    case = experiment.cases[len(experiment.cases) // 2]
    n = min(case.realisations, N)
    found = by_mark(replace(experiment, cases=(case,)), n, RUNS, RUNS * n)
    return found.assign(config=config, study=experiment.study)


def table(found: pd.DataFrame) -> str:
    """Coverage of marked and of unmarked intervals as Markdown: by study, then by what the note says."""
    found = found.assign(marked=~found["note"].isin(("", str(interval_notes.BELIEVED_VARIES))))
    lines = ["| | intervals | marked | of these hold | of the others hold |", "|---|---|---|---|---|"]
    for study, own in [*found.groupby("study"), ("all", found)]:
        count, held = own.groupby("marked")["intervals"].sum(), own.groupby("marked")["held"].sum()
        share = 100 * held / count
        marked = 100 * count.get(True, 0) / count.sum()
        with_mark = f"{share[True]:.1f} %" if True in share else "–"
        name = study.replace("_", " ")
        lines.append(f"| {name} | {count.sum():,} | {marked:.1f} % | {with_mark} | {share[False]:.1f} % |")
    lines += ["", "| note | intervals | hold |", "|---|---|---|"]
    for note, own in sorted(found[found["note"] != ""].groupby("note"), key=lambda one: -one[1]["intervals"].sum()):
        count, held = own["intervals"].sum(), own["held"].sum()
        lines.append(f"| {note} | {count:,} | {100 * held / count:.1f} % |")
    return "\n".join(lines)


def seen(experiment: Experiment, n: int, runs: int, further: int = 0) -> tuple[dict[str, pd.DataFrame], Iterator[Seen]]:
    """The tables of all runs together, and run by run the intervals that have a chance in them."""
    works = [CaseWork(case) for case in experiment.cases]
    sums = [[work.simulate(run * n, n) for work in works] for run in range(runs)]
    pooled = [sum(own) for own in zip(*sums, strict=True)]
    for i, work in enumerate(works):
        for first in range(runs * n, runs * n + further, BLOCK):
            pooled[i] = pooled[i] + work.simulate(first, min(BLOCK, runs * n + further - first))
    whole = _tables(experiment, works, pooled, n * runs + further)
    return whole, (
        one
        for run, own in enumerate(sums)
        for one in _of_run(run, _tables(experiment, works, own, n), whole, experiment.study)
    )


def _of_run(run: int, made: dict[str, pd.DataFrame], whole: dict[str, pd.DataFrame], made_of: str) -> Iterator[Seen]:
    for name, table in made.items():
        if not len(table) or not any(True for _ in _intervals(name, table)):
            continue
        place = _index(name, whole[name]).get_indexer(_index(name, table))
        table, place = table[place >= 0], place[place >= 0]
        note = table["note"].to_numpy(dtype=object) if "note" in table else np.full(len(table), "", dtype=object)
        for value, lo, hi in _intervals(name, table):
            truth = whole[name][value].to_numpy(dtype=float)
            if (name, value) in EXACT and EXACT[name, value] in whole[name]:
                exact = whole[name][EXACT[name, value]].to_numpy(dtype=float)
                truth = np.where(np.isfinite(exact) & registry.study(made_of).exact_errors, exact, truth)
            if np.isnan(truth).all():
                continue
            size = SAME * max(np.nanmedian(abs(truth)), np.finfo(float).tiny)
            truth = truth[place]
            by_chance = (hi > lo + size) & np.isfinite(truth)
            held = (lo <= truth) & (truth <= hi)
            own = note.copy()
            own[[not concerns(one, value) for one in note]] = ""
            yield Seen(run, name, value, place[by_chance], own[by_chance], held[by_chance])


def _tables(experiment: Experiment, works: list[CaseWork], sums: list[np.ndarray], n: int) -> dict[str, pd.DataFrame]:
    """The tables, marked as if no exact value stood in them: it counts what the rule does where none is known."""
    results = [
        CaseResult(case.name, case.study, case.spec, case.swept_values, n, work.plan.layout.unpack(own), work.plan.axes)
        for case, work, own in zip(experiment.cases, works, sums, strict=True)
    ]
    declared = registry.study(experiment.study).quantities()
    return interval_notes.add_notes(result_content.measured_tables(results), results, exact=False, quantities=declared)


def _index(name: str, table: pd.DataFrame) -> pd.MultiIndex:
    labels = [label for label in LABELS if label in table and (name, label) not in MEASURED]
    return pd.MultiIndex.from_frame(table[labels])


def _intervals(name: str, table: pd.DataFrame) -> Iterator[tuple[str, np.ndarray, np.ndarray]]:
    """The columns with an interval, each before the two with its ends, and that of the bias by its standard error."""
    columns = list(table)
    for i, column in enumerate(columns):
        if column in NO_INTERVALS or not (column == "lo" or column.endswith(("_lo", "_lo_s"))):
            continue
        yield columns[i - 1], *(table[columns[at]].to_numpy(dtype=float) for at in (i, i + 1))
    if "bias_se" in columns:
        half = Z95 * table["bias_se"].to_numpy(dtype=float)
        bias = table["bias"].to_numpy(dtype=float)
        yield "bias", bias - half, bias + half


def every() -> pd.DataFrame:
    """`shipped` of every config, and of those beside."""
    configs = [(path.stem, ()) for path in sorted((SHIPPED / "configs").glob("*.yaml"))]
    return pd.concat([shipped(config, overrides) for config, overrides in [*configs, *BESIDE]])


if __name__ == "__main__":
    sys.stdout.write(table(every()) + "\n")
