"""Terminal output of the commands: answers, tables, verdicts, and files written."""

import math
import os
from collections.abc import Hashable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.cli.console import command, counted_cases, field, print_warnings, say, show
from radarsim.extensions import extensions
from radarsim.language import few, listed, numeral, plural, term, tr
from radarsim.report.wording import known, shown, significant_digits, with_unit
from radarsim.report.wording import unit as unit_of

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.app.clean import RemovedBlocks
    from radarsim.app.compare import Comparison, DopplerChart
    from radarsim.app.configs import Inventory
    from radarsim.app.doctor import Inspection
    from radarsim.app.outlook import CaseOutlook, Need, Outlook
    from radarsim.app.result import Result
    from radarsim.app.run import Shares
    from radarsim.app.sensitivity import Sensitivity
    from radarsim.app.solve import Answer
    from radarsim.app.tune import Tuned
    from radarsim.config.experiment import Experiment
    from radarsim.report.quantities import Quantity


MOST_BEGUN = 4  # cases whose stored part is listed
MOST_ROWS = 36  # of the last scan's table; for a larger experiment the answer and the files suffice
MARKS = {  # behind intervals that are too narrow
    " *": term("heavy tails: the interval is too narrow"),
    " †": term("the interval is too narrow: the column note of curves.csv or gains.csv says why"),
}
DROPPED = term("dropped {files} in {folders} of {path}: {size:.2f} MB")


def print_result(result: "Result") -> None:
    """The answer of a run, σ at the last scan, the verdicts, and where the files are."""

    written = result.written
    assert written is not None  # the commands write what they print
    for line in written.answer:
        say(line)
    show_last_scan(result)
    for label, text in (line for extension in extensions() for line in extension.result_lines(result)):
        field(label, text)
    drawn = [Path(name) for name in written.files if name.startswith("figures/") and not name.endswith(".md")]
    others = sum(name.endswith(".csv") for name in written.files) - 1
    field("tables", tr("{file} and {count} more there", file=str(written.folder / "curves.csv"), count=others))
    if drawn:
        kinds = listed(sorted({path.suffix[1:].upper() for path in drawn}, reverse=True))
        told = {"folder": str(written.folder / "figures"), "count": len({path.stem for path in drawn}), "kinds": kinds}
        field("figures", tr("{folder} ({count}, each as {kinds})", **told))
    field("report", str(written.folder / "report.html"))
    if written.removed:
        gone = few(written.removed, 3)
        field("removed", tr("left by an earlier run, not written by this one: {names}", names=gone))
    print_warnings(result.warnings)


def show_last_scan(result: "Result") -> None:
    """σ with interval, exact σ and gain of each case, filter and component at the last scan, unless there are too many.
    A case is named by its swept values."""
    from radarsim.report import panels

    if 0 < len(result.last_scan) <= MOST_ROWS:
        names = dict(zip((case.name for case in result.cases), panels.names_of(result.cases), strict=True))
        show_rows(result.experiment.stem, result.last_scan, names)


def show_rows(stem: str, last: "pd.DataFrame", names: Mapping[str, str]) -> None:
    """The table of rows of `Result.last_scan`, by names for the cases; common values are in its title."""
    found: Iterable[Any] = last.itertuples()  # named by column, which pandas' stubs do not know
    rows = [
        (
            *(names[row.case], row.filter, row.component, tr("{t_s:g} s", t_s=row.t_s)),
            f"{significant_digits(row.sigma)} {tr(unit_of(row.unit))}",
            f"{significant_digits(row.sigma_lo)} … {significant_digits(row.sigma_hi)}" + too_narrow(row, "note"),
            known(row.exact_sigma),
            known(row.gain_percent, ".2f", " %"),
            known(row.gain_lo, ".2f", " … ") + known(row.gain_hi, ".2f") + too_narrow(row, "gain_note"),
        )
        for row in found
    ]
    columns = ("case", "filter", "component", "at", "sigma", "95 %", "exact", "gain", "95 % of gain")
    show_but_alike(stem, ("case", "at"), columns, rows, columns[3:], ("exact", "95 %"))
    for mark, why in MARKS.items():
        if any(mark in cell for row in rows for cell in row[-4:]):
            field("", f"{mark.strip()} {tr(why)}")


def show_but_alike(
    title: str,
    alike: Sequence[str],
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    right: Sequence[str],
    spare: Sequence[str],
) -> None:
    """Print a table without empty columns, and with columns of `alike` that have one value moved to the title."""
    values = [{row[i] for row in rows} for i in range(len(columns))]
    once = {i: rows[0][i] for i, own in enumerate(values) if own == {""} or (len(own) == 1 and columns[i] in alike)}
    kept = [i for i in range(len(columns)) if i not in once]
    title = ", ".join(filter(None, dict.fromkeys((title, *once.values()))))
    cells = [[row[i] for i in kept] for row in rows]
    show(title, [columns[i] for i in kept], cells, right=right, spare=spare)


def print_comparison(compared: "Comparison") -> None:
    """Differences of stored results at the last common time, and the files."""
    from radarsim.report import compare

    counted = [row for row in compared.last if row["quantity"] in dict(compared.told)]
    against = {row["against_label"] for row in compared.last}
    for quantity, words in compared.told if len(counted) <= MOST_ROWS else ():
        rows = [
            (
                f"{row['label']}, {row['filter']}",
                *(
                    row["component"] or str(row["model"]),
                    "" if row["t_s"] != row["t_s"] else f"{row['t_s']:g} {tr('s')}",
                ),
                *(f"{compare.value(row[key])} {tr(unit_of(row['unit']))}".rstrip() for key in ("value", "against")),
                *compare.changes(row),
            )
            for row in counted
            if row["quantity"] == quantity
        ]
        name = tr("{quantity} of {symbol}", quantity=tr(words), symbol=next(iter(against)))
        other = name if len(against) == 1 else tr("{quantity} against", quantity=tr(words))
        columns = ("", "of", "at", words, other, "change", "exact")
        show_but_alike("", ("at",), columns, rows, (*columns[2:5], "exact"), ("exact", "at"))
    for line in compared.sentences if len(counted) > MOST_ROWS else ():
        say(line)
    for line in compared.notes:
        field("note", line)
    folder = compared.folder
    assert folder is not None  # the command writes what it prints
    field("table", str(folder / "comparison.csv"))
    if drawn := {Path(n).stem for n in compared.files if n.startswith("figures/") and not n.endswith(".md")}:
        field("figures", f"{folder / 'figures'} ({len(drawn)})")
    field("page", str(folder / "compare.html"))
    print_warnings(compared.warnings)


def too_narrow(row: Any, column: str) -> str:
    """A mark on an interval, for a row of `last_scan`, by the column that says why it is too narrow."""
    from radarsim.report import notes

    note = getattr(row, column, "")
    if not isinstance(note, str) or not note:  # not a text: of a gain that a row does not have
        return ""
    tails, other = MARKS
    return tails if note == str(notes.HEAVY) else other


def print_outlook(experiment: "Experiment", outlook: "Outlook") -> None:
    """The cost of a run."""
    say(tr("{config}: valid", config=str(experiment.path or experiment.stem)))
    rows = [
        (case.name, case.filters, str(case.scans), numeral(f"{case.realisations:,}"), _seconds(case))
        for case in outlook.cases
    ]
    columns = ("case", "filters", "scans", "realisations", "one thread")
    show("", columns, rows, right=columns[2:], spare=("scans",))
    from radarsim.app.outlook import missing

    begun = [(case.name, held) for case in outlook.cases if (held := case.stock) and held.stored and held.missing]
    for name, held in begun[:MOST_BEGUN]:
        told = {"stored": held.stored, "asked": held.asked, "missing": missing(held)}
        field(name, tr("{stored:,} of {asked:,} stored; missing: {missing}", **told))
    if len(begun) > MOST_BEGUN:
        say(tr("and {cases} more stored in part", cases=counted_cases(len(begun) - MOST_BEGUN)))
    if outlook.precision is not None:
        print_needs(experiment, outlook)
    if outlook.share is not None:
        number, of = outlook.share
        field("share", tr("{number} of {of}", number=number, of=of))
    field("total", outlook.total)
    print_warnings(outlook.warnings)


def _seconds(case: "CaseOutlook") -> str:
    """Seconds of one thread for a case."""
    if case.timed or not case.seconds:
        return tr("{t_s:.3g} s", t_s=case.seconds)
    return tr("under {t_s:.2g} s", t_s=case.seconds)


def print_needs(experiment: "Experiment", outlook: "Outlook") -> None:
    """How many realisations a precision takes, and whether the run may do so many."""
    asked = {case.name: case.realisations for case in experiment.cases}
    needs = {case.name: need for case in outlook.cases if (need := case.need) is not None}
    rows = [
        (
            case.name,
            numeral(f"{need.realisations:,}") if need.realisations is not None else _unreached(need),
            tr("{t_s:.3g} s", t_s=float(case.seconds)),
            need.known_by,
            need.last,
        )
        for case in outlook.cases
        if (need := case.need) is not None
    ]
    wanted = tr("for ± {percent:g} {unit}", percent=outlook.precision, unit=tr(outlook.of.half_width_unit))
    columns = ("case", wanted, "one thread", "known from", "last to get there")
    show("", columns, rows, right=columns[1:3], spare=columns[4:])
    short = [name for name, need in needs.items() if need.realisations is None or need.realisations > asked[name]]
    if short:
        most = max((need.realisations or math.inf) for need in needs.values())
        cure = tr("; -n {most} would do", most=str(most)) if math.isfinite(most) else ""
        cases = counted_cases(len(short))
        told = {"cases": cases, "names": ", ".join(short[:3]), "cure": cure}
        say(tr("precision not within reach of {cases}: {names}{cure}", **told))


def _unreached(need: "Need") -> str:
    """Why a pilot predicts no number of realisations."""
    return tr("out of reach") if need.below is None else tr("none observed: below {rate:.2g}", rate=need.below)


def print_share(share: "Shares", out: str | os.PathLike[str]) -> None:
    """The result of a share of an experiment, and the next step."""
    done = sum(one.done for one in share.cases.values())
    held = sum(one.from_store for one in share.cases.values())
    told = {"number": share.number, "of": share.of, "config": share.config, "done": done, "held": held}
    field("share", tr("{number} of {of} of {config}: {done:,} realisations, {held:,} were stored before", **told))
    folder = str(Path(out) / ".blocks")
    field("blocks", tr("{folder}; copy all shares into one, and `radarsim run` finds them", folder=folder))
    print_warnings(share.warnings)


def print_inspection(found: "Inspection") -> None:
    """Findings about a result; faults are reported as errors."""
    outputs = plural("{count} output", "{count} outputs", found.outputs)
    pieces = plural("{count} stored piece", "{count} stored pieces", found.pieces)
    say(tr("{folder}: {outputs} and {pieces} checked", folder=str(found.folder), outputs=outputs, pieces=pieces))
    if found.recomputed:
        pieces = plural("{count} piece", "{count} pieces", len(found.recomputed))
        count = plural("{count:,} realisation", "{count:,} realisations", found.realisations)
        say(tr("computed again: {pieces}, {realisations}", pieces=pieces, realisations=count))
    for note in found.notes:
        say(tr("note: {words}", words=note))
    say(
        tr("all intact")
        if not found.faults
        else plural("{count} fault found", "{count} faults found", len(found.faults))
    )


def print_cleaned(cleaned: "RemovedBlocks", dry_run: bool) -> None:
    """The amount dropped, or to be dropped."""
    amount = {
        "files": plural("{count} file", "{count} files", cleaned.files),
        "folders": plural("{count} folder", "{count} folders", cleaned.identities),
        "path": str(cleaned.path),
        "size": cleaned.size / 1e6,
    }
    would = tr("would drop {files} in {folders} of {path}: {size:.2f} MB", **amount)
    say(would if dry_run else tr(DROPPED, **amount))
    if cleaned.not_judged:
        words = tr(
            "blocks of {cases} are left: filters of your own code run only where you name the config: "
            "`radarsim clean CONFIG --other-sources`",
            cases=few(cleaned.not_judged),
        )
        say(tr("note: {words}", words=words))


def print_names(inventory: "Inventory") -> None:
    """The numbers of configs, scenarios, studies and filters, and their names, those of configs by paper."""
    (_, _, configs), (_, _, scenarios), (_, _, studies), (_, _, filters) = inventory
    say(plural("{count} config (radarsim run NAME)", "{count} configs (radarsim run NAME)", len(configs)))
    for paper in dict.fromkeys(paper for _, paper, _ in configs):
        say(f"{paper}  {', '.join(name for name, of, _ in configs if of == paper)}")
    told = (
        plural("{count} scenario (target: NAME)", "{count} scenarios (target: NAME)", len(scenarios)),
        plural("{count} study (study: NAME)", "{count} studies (study: NAME)", len(studies)),
        plural("{count} filter", "{count} filters", len(filters)),
    )
    say(", ".join(told))
    say(tr("A line each: `radarsim list configs`, scenarios, studies, filters, P2, any word"))


def print_inventory(inventory: "Inventory") -> None:
    """Filters, studies, scenarios and configs, with a line on each: the most useful last."""
    for n, (title, columns, rows) in enumerate(reversed(inventory)):
        if n:
            say("")
        show(tr(title), columns, [(*row[:-1], tr(row[-1])) for row in rows])


# ---- answers ---------------------------------------------------------------------------------------------------------
def print_answer(answer: "Answer") -> None:
    """A value with the quantity there, then a line each: the slope, other values, the run that confirms."""
    (_, value), *others = answer.lines
    say(value)
    for label, words in others:
        field(label, words)
    command("check", answer.command)


def print_tuned(found: "Tuned") -> None:
    """What tuning gains, the keys, the gain of each case, notes, and the run that shows it."""
    say(found.answer)
    ends = term("within 0.1 %") if found.exact else "95 %"
    cells = [
        [one.key, with_unit(one.stated, one.unit), with_unit(one.tuned, one.unit), _ends(one.lo, one.hi)]
        for one in found.keys
    ]
    show(found.minimised, ["key", "stated", "tuned", ends], cells, right=["stated", "tuned", ends], spare=())
    if len(found.cases) > 1:
        rows = [
            [one.case, shown(one.stated, ".4g"), shown(one.tuned, ".4g"), f"{shown(one.gain, '.3g')} {found.gain_unit}"]
            + ([] if found.exact else [_ends(one.lo, one.hi, ".3g")])
            for one in found.cases
        ]
        columns = ["case", "stated", "tuned", "gain", *([] if found.exact else ["95 % of gain"])]
        title = f"{found.quantity.said}, {tr(found.unit)}"
        show(title, columns, rows, right=columns[1:], spare=())
    for note in found.notes:
        field("note", note)
    command("check", found.command)


def _ends(lo: float | None, hi: float | None, form: str = ".6g") -> str:
    return "" if lo is None or hi is None else f"{shown(lo, form)} … {shown(hi, form)}"


def print_drawn(drawn: "DopplerChart") -> None:
    """A line on each case's place, and the files written."""
    folder = drawn.folder
    assert folder is not None  # the command writes what it prints
    for line in drawn.sentences:
        say(line)
    kinds = sorted(name for name in drawn.files if name.endswith((".svg", ".png", ".pdf")))
    if kinds:
        field("figures", f"{folder} ({', '.join(kinds)})")
    field("table", str(folder / "chart.csv"))
    field("page", str(folder / "chart.html"))


def print_sensitivity(found: "Sensitivity") -> None:
    """A table of the leading component: key, its values, and the change of each quantity of each filter."""
    from radarsim.app.sensitivity import LESS

    rows = [row for row in found.rows if row["component"] == found.leading]
    columns_of = [
        (of, one)
        for of in reversed(found.of)  # the gain first, which is the question
        for one in dict.fromkeys(row["filter"] for row in rows)
        if any(not math.isnan(row[of.changes[0]]) for row in rows if row["filter"] == one)
    ]
    cells = []
    for key in dict.fromkeys(row["key"] for row in rows):
        own = {row["filter"]: row for row in rows if row["key"] == key}
        first = next(iter(own.values()))
        changed = with_unit(first["changed_value"], found.labels[str(key)].unit)
        line = [
            f"{key}{LESS * (key in found.lowered)}",
            *(_change(own.get(one), of) for of, one in columns_of),
            f"{shown(first['value'])} → {changed}",
        ]
        cells.append(line)
    heads = [(tr("{kind} of {filter}", kind=of.words, filter=one), of.changed_unit) for of, one in columns_of]
    columns = ["key", *(head if unit == "%" else f"{head}, {tr(unit)}" for head, unit in heads), "value"]
    show(found.title, columns, cells, right=columns[1:], spare=columns[:1:-1])
    if found.without_effect:
        field("no effect", ", ".join(found.without_effect))
    if found.without_estimate:
        field("no estimate", ", ".join(found.without_estimate))
    if found.not_paired:
        what = tr("{keys}: the scan times differ, so the noise is not common", keys=", ".join(found.not_paired))
        field("not paired", what)
    for key, reason in found.left_out.items():
        field("left out", f"{key}: {reason}")
    field("files", ", ".join(found.files))


def _change(row: "dict[Hashable, Any] | None", of: "Quantity") -> str:
    """A change with its sign, and with its interval where it has one."""
    if row is None:
        return ""
    value, lo, hi = (row[name] for name in of.changes)
    text = f"{shown(value, '+.3g')}{' %' * (of.changed_unit == '%')}"
    return text if row["exact"] else f"{text} [{shown(lo, '+.2g')}, {shown(hi, '+.2g')}]"
