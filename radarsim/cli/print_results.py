"""Results on the terminal: of runs, of shares, and comparisons of runs."""

import os
from collections.abc import Iterable, Mapping, Sequence
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.cli.console import print_field, print_line, print_table, print_warnings
from radarsim.extensions import extensions
from radarsim.language.translate import join_names, plural, shorten_names, term, tr
from radarsim.report.wording import format_if_known, significant_digits
from radarsim.report.wording import unit as unit_of

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.api.compare import Comparison
    from radarsim.api.result import Result
    from radarsim.api.simulate_cases import Shares


MAX_ROWS = 36  # of the last scan's table; for a larger experiment the answer and the files suffice
NARROW_INTERVAL_MARKS = {  # behind intervals that are too narrow
    " *": term("heavy tails: the interval is too narrow"),
    " †": term("the interval is too narrow: the column note of curves.csv or gains.csv says why"),
}


def print_result(result: "Result") -> None:
    """The answer of a run, σ at the last scan, the verdicts, and where the files are."""
    assert result.written is not None  # the commands write what they print
    for line in result.written.answer:
        print_line(line)
    print_last_scan(result)
    _print_verdicts_and_files(result)


def print_judgement(result: "Result") -> None:
    """The verdict on a user filter, σ at the last scan, how to see more, and where the files are."""
    written = result.written
    assert written is not None  # the commands write what they print
    for line in written.answer[: written.main_count]:
        print_line(line)
    print_last_scan(result)
    if omitted := len(written.answer) - written.main_count:
        print_field("more", plural("{count} sentence, with --all", "{count} sentences, with --all", omitted))
    _print_verdicts_and_files(result)


def _print_verdicts_and_files(result: "Result") -> None:
    written = result.written
    assert written is not None
    for label, text in (line for extension in extensions() for line in extension.result_lines(result)):
        print_field(label, text)
    figure_files = [Path(name) for name in written.files if name.startswith("figures/") and not name.endswith(".md")]
    other_tables = sum(name.endswith(".csv") for name in written.files) - 1
    print_field(
        "tables", tr("{file} and {count} more there", file=str(written.folder / "curves.csv"), count=other_tables)
    )
    if figure_files:
        kinds = join_names(sorted({path.suffix[1:].upper() for path in figure_files}, reverse=True))
        values = {
            "folder": str(written.folder / "figures"),
            "count": len({path.stem for path in figure_files}),
            "kinds": kinds,
        }
        print_field("figures", tr("{folder} ({count}, each as {kinds})", **values))
    print_field("report", str(written.folder / "report.html"))
    if written.removed:
        removed_names = shorten_names(written.removed, 3)
        words = tr("left by an earlier run, not written by this one: {names}", names=removed_names)
        options = join_names([f"`{option}`" for option in written.remaking_options])
        print_field(
            "removed", tr("{words}; to have them again: {options}", words=words, options=options) if options else words
        )
    print_warnings([line for line in result.warnings if f"{line}." not in written.answer])


def print_last_scan(result: "Result") -> None:
    """σ with interval, exact σ and gain of each case, filter and component at the last scan, unless there are too many.
    A case is named by its swept values."""
    from radarsim.report import case_selection

    last_scan = result.last_scan
    if 0 < len(last_scan) <= MAX_ROWS:
        names = dict(
            zip((case.name for case in result.cases), case_selection.distinct_case_names(result.cases), strict=True)
        )
        print_last_scan_rows(result.experiment.stem, last_scan, names)


def print_last_scan_rows(stem: str, last_scan: "pd.DataFrame", names: Mapping[str, str]) -> None:
    """The table of rows of `Result.last_scan`, by names for the cases; common values are in its title."""
    known = "bound" if "bound" in last_scan else "exact"
    is_without_value = last_scan["sigma"].isna()
    scan_rows: Iterable[Any] = last_scan[~is_without_value].itertuples()  # named by column, which pandas does not say
    rows = [
        (
            *(names[row.case], row.filter, row.component, tr("{t_s:g} s", t_s=row.t_s)),
            f"{significant_digits(row.sigma)} {tr(unit_of(row.unit))}",
            ("" if isnan(row.sigma_lo) else f"{significant_digits(row.sigma_lo)} … {significant_digits(row.sigma_hi)}")
            + narrow_interval_mark(row, "note"),
            format_if_known(row.bound if known == "bound" else row.exact_sigma),
            format_if_known(row.gain_percent, ".2f", " %"),
            format_if_known(row.gain_lo, ".2f", " … ")
            + format_if_known(row.gain_hi, ".2f")
            + narrow_interval_mark(row, "gain_note"),
        )
        for row in scan_rows
    ]
    columns = ("case", "filter", "component", "at", "sigma", "95 %", known, "gain", "95 % of gain")
    if rows:
        print_varying_columns(stem, ("case", "at"), columns, rows, columns[3:], (known, "95 %"))
    without_value = list(dict.fromkeys(last_scan["filter"][is_without_value]))
    if without_value:
        count = plural("{count} row left out", "{count} rows left out", int(is_without_value.sum()))
        text = tr("{filters} ({rows})", filters=shorten_names(without_value), rows=count)
        print_field("no lock" if known == "bound" else "no estimate", text)
    for mark, reason in NARROW_INTERVAL_MARKS.items():
        if any(mark in cell for row in rows for cell in row[-4:]):
            print_field("", f"{mark.strip()} {tr(reason)}")


def print_varying_columns(
    title: str,
    common_columns: Sequence[str],
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    right: Sequence[str],
    spare: Sequence[str],
) -> None:
    """Print a table without empty columns; columns of `common_columns` that have one value move to the title."""
    values = [{row[i] for row in rows} for i in range(len(columns))]
    title_values = {
        i: rows[0][i]
        for i, distinct_values in enumerate(values)
        if distinct_values == {""} or (len(distinct_values) == 1 and columns[i] in common_columns)
    }
    column_indices = [i for i in range(len(columns)) if i not in title_values]
    title = ", ".join(filter(None, dict.fromkeys((title, *title_values.values()))))
    cells = [[row[i] for i in column_indices] for row in rows]
    print_table(title, [columns[i] for i in column_indices], cells, right=right, spare=spare)


def print_comparison(compared: "Comparison") -> None:
    """For each quantity a sentence and a table of differences at the last common time, and the files."""
    for sentence, table in zip(compared.sentences, compared.summary_tables, strict=True):
        print_line(sentence)
        print_table(table.title, table.columns, table.rows[:MAX_ROWS], table.columns[1:], table.spare)
        if (omitted := len(table.rows) - MAX_ROWS) > 0:
            print_field("", plural("{count} further row", "{count} further rows", omitted))
    if len(compared.components) > 1:
        print_field("more", tr("of one component: --component {names}", names=" | ".join(compared.components)))
    for line in compared.notes:
        print_field("note", line)
    folder = compared.folder
    assert folder is not None  # the command writes what it prints
    print_field("table", str(folder / "comparison.csv"))
    if figure_stems := {Path(n).stem for n in compared.files if n.startswith("figures/") and not n.endswith(".md")}:
        print_field("figures", f"{folder / 'figures'} ({len(figure_stems)})")
    print_field("page", str(folder / "compare.html"))
    print_warnings(compared.warnings)


def narrow_interval_mark(row: Any, column: str) -> str:
    """A mark on an interval, for a row of `last_scan`, by the column that says why it is too narrow."""
    from radarsim.report import interval_notes

    note = getattr(row, column, "")
    if not isinstance(note, str) or not note:  # not a text: of a gain that a row does not have
        return ""
    heavy_tails_mark, other_mark = NARROW_INTERVAL_MARKS
    return heavy_tails_mark if note == str(interval_notes.HEAVY_TAILS) else other_mark


def print_share(share: "Shares", out: str | os.PathLike[str]) -> None:
    """The result of a share of an experiment, and the next step."""
    done = sum(case_share.done for case_share in share.cases.values())
    stored = sum(case_share.from_store for case_share in share.cases.values())
    values = {"number": share.number, "of": share.of, "config": share.config, "done": done, "held": stored}
    print_field(
        "share", tr("{number} of {of} of {config}: {done:,} realisations, {held:,} were stored before", **values)
    )
    folder = str(Path(out) / ".blocks")
    print_field("blocks", tr("{folder}; copy all shares into one, and `radarsim run` finds them", folder=folder))
    print_warnings(share.warnings)
