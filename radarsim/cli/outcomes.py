"""Terminal output of the commands: answers, tables, verdicts, and files written."""

import math
import os
import shlex
import shutil
import sys
from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from pathlib import Path
from textwrap import shorten
from typing import TYPE_CHECKING, Any, TextIO

from radarsim.app import configs
from radarsim.cli.console import PIPED_WIDTH, broken, command, counted_cases, field, print_warnings, say, show
from radarsim.language import few, listed, numeral, plural, term, tr
from radarsim.report.wording import interval, known, labelled, printable, shown, significant_digits, with_unit
from radarsim.report.wording import unit as unit_of

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.app.clean import RemovedBlocks
    from radarsim.app.compare import Comparison, DopplerChart
    from radarsim.app.configs import Inventory
    from radarsim.app.doctor import Inspection
    from radarsim.app.outlook import CaseOutlook, Need, Outlook
    from radarsim.app.readings import Readings
    from radarsim.app.result import Result
    from radarsim.app.run import Shares
    from radarsim.app.sensitivity import Sensitivity
    from radarsim.app.solve import Answer
    from radarsim.app.tune import Tuned
    from radarsim.config.experiment import Experiment
    from radarsim.recorded.fit import Advice, Fit, Fitted
    from radarsim.recorded.follow import Followed
    from radarsim.recorded.page import Judged
    from radarsim.recorded.register import Registration
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
    if not any(case.outside for case in result.cases):  # the paper's claims are none of such a filter
        print_verdicts(result)
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


# ---- recorded plots --------------------------------------------------------------------------------------------------
def echo(rows: Iterable[Sequence[str]]) -> None:
    """Rows of CSV to the terminal; names with a comma or a quote are quoted as in a file."""
    import csv

    csv.writer(sys.stdout, lineterminator="\n").writerows(rows)


def report(followed: "Followed", judged: "Sequence[Judged]", advised: "Advice | None", stderr: bool = False) -> None:
    """Print the results; to stderr where the track itself goes to stdout. advised: where a likelihood is known."""
    from radarsim.recorded import page

    stream = sys.stderr if stderr else sys.stdout
    for line in page.rows(followed):
        write(stream, line)
    for title, rows in ((page.ERRORS, page.errors(followed)), (page.TESTS, page.tests(judged))):
        if rows:
            forms = [page.NUMBERS.get(name) for name in rows[0]]
            texts = [
                [known(cell, form) if form else cell for cell, form in zip(row.values(), forms, strict=True)]
                for row in rows
            ]
            show(tr(title), list(rows[0]), texts, list(page.NUMBERS), stream=stream)
    for line in (*page.findings(judged), *page.verdict(followed, judged, advised)):
        write(stream, line)


def write(stream: TextIO, line: str) -> None:
    """A line, to a terminal broken between words."""
    for part in broken(printable(line), stream):
        stream.write(part + "\n")


def report_fit(found: "Fit") -> None:
    """Print a fit, and the options that put it into the config."""
    from radarsim.recorded import fit, page

    tracks = plural("{count} track", "{count} tracks", found.tracks)
    told = tr("{rows} of {tracks}; filter {filter}", rows=page.counted(found.rows), tracks=tracks, filter=found.filter)
    lines = [labelled("plots", told)]
    if found.doubles:
        words = plural("{count} plot", "{count} plots", found.doubles)
        words = tr("{plots} left out: the same scan has one nearer to the track", plots=words)
        lines.append(labelled("doubles", words))
    plain = {} if found.plain is None else {one.key: one for one in found.plain.keys}
    for one in found.keys:
        line = f"{one.key}: {_known(one)}"
        if one.key != fit.CORRELATION_TIME:
            line += tr(", stated {stated}", stated=significant_digits(one.stated))
        if one.key in plain:
            line += tr(", plain {value}", value=_known(plain[one.key]))
        if not one.identifiable:
            line += (
                tr("; the plots cannot distinguish it from zero")
                if one.lo == 0
                else tr("; the plots cannot distinguish it from larger values")
            )
        lines.append(line)
    if found.outliers is not None:
        lines.append(tr("outliers: {share} % of the plots", share=significant_digits(100 * found.outliers, "#.2g")))
    settings = " ".join(f"--set {key}={value:g}" for key, value in fit.settings(found).items())
    if found.beside is not None:
        lines.append(labelled("", tr("the intervals are not valid: {what}", what=page.what(*found.beside[:2]))))
    if found.plain is not None:
        words = tr("plain: of errors that are normal and independent")
        if found.plain.beside is not None:
            words = tr("{words}; the plots contradict that, so those intervals are too narrow", words=words)
        lines.append(labelled("", words))
    so = page.times(found.gain)
    words = tr("with these values the plots are {times} times as likely as with the stated ones", times=so)
    lines.append(labelled("", words))
    if settings:
        lines.append(labelled("", tr("to use the fitted values: {settings}", settings=settings)))
    for line in lines:
        write(sys.stdout, line)


def _known(one: "Fitted") -> str:
    """A value with its interval."""
    hi = tr("no upper bound") if one.hi == float("inf") else significant_digits(one.hi)
    return f"{significant_digits(one.value)} {interval(significant_digits(one.lo), hi)}"


def report_registration(found: "Registration", other: str) -> None:
    """Print a registration, and the options that correct the radar's plots."""
    from radarsim.recorded import identity, register

    plots = plural("{count} plot", "{count} plots", found.plots)
    by = ", ".join(f"{kind} {count}" for kind, count in found.by.items())
    told = {"plots": plots, "matched": found.matched, "file": other, "by": by}
    lines = [
        labelled("plots", tr("{matched} of {plots} have a position of their aircraft in {file} (by {by})", **told))
    ]
    apart = tr("{distance} from it (median)", distance=identity.distance(*found.apart))
    aircraft = tr("{count} aircraft", count=len(found.aircraft))
    bent = tr("positions in between err by less than {most:.2g} m (95 %)", most=found.bent_m)
    lines += [labelled("", f"{aircraft}; {apart}; {bent}")]
    lines += [labelled("", tr("left out: {what}", what=one)) for one in found.left]
    lines.append(tr("Biases of the plots with 95 % intervals, {file} taken as right", file=other))
    lines += register.lines(found)
    for line in lines:
        write(sys.stdout, line)


# ---- verdicts --------------------------------------------------------------------------------------------------------
SHORT = 12  # words of a claim in a list
MOST_CONFIGS = 6  # from which on it is said what runs them all
NOTHING_OF_ALL = term(
    "nothing is run here: `make reproduce-figures` runs all configs of the four papers; "
    "docs/claims.md, which `make docs` builds, has their results at full size"
)


def print_verdicts(result: "Result") -> None:
    """The claims of a run by their class over all readings, with those that differ here."""
    from radarsim.report.claims import page, rule

    verdicts, shipped = result.verdicts(), result.verdicts("as_shipped")
    for kind, names in verdicts.items():
        field("claims", f"{page.of_class(kind, len(names))}: {page.in_a_row(names)}")
        here = {own: [name for name in every if name in names] for own, every in shipped.items() if own != kind}
        if said := "; ".join(f"{tr(own)}: {page.in_a_row(few)}" for own, few in here.items() if few):
            field("", tr("as shipped {claims}", claims=said))
    for reason, names in result.unjudged().items():
        field("", tr("not judged: {names}: {reason}", names=", ".join(names), reason=rule.said(reason)))
    if alone := result.as_shipped():
        told = {"names": page.in_a_row(alone), "paper": alone[0].partition(".")[0]}
        words = tr(
            "only as shipped: {names}; `radarsim readings {paper}` judges under every reading that the paper allows",
            **told,
        )
        field("", words)
    if verdicts and result.written is not None:
        told = {"command": configs.command(result.experiment, (), result.written.folder.parent, verb="claims")}
        field("", tr("`{command}` describes each of them", **told))


def print_claims(
    rows: Sequence[dict[str, Any]],
    detailed: Collection[str] = (),
    out: str = configs.RESULTS,
    names: Sequence[str] = (),
) -> None:
    """A line for each claim: number, class, first words; for detailed ones all of it with measured values. The commands
    it shows are for the directory `out`, and for the requested names.

    For experiments other than the paper's a line for each reason, with the claims that cannot be judged."""
    from radarsim.report.claims import NOT_JUDGED, NOT_RUN, page, rule

    stated: list[dict[str, Any]] = []
    foreign: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if row["class"] == NOT_JUDGED and not row["what"]:
            foreign.setdefault((row["config"], row["why"]), []).append(row["claim"])
        else:
            stated.append(row)
    every = page.grouped(stated)
    width = max((len(_standing(own)) for own in every if own[0]["claim"] not in detailed), default=0)
    room = (shutil.get_terminal_size().columns if sys.stdout.isatty() else PIPED_WIDTH) - width - 9
    for own in every:
        if own[0]["claim"] in detailed:
            _print_claim(own)
        else:
            words = tr(own[0]["statement"]).split()
            begun = " ".join([*words[:SHORT], *["…"] * (len(words) > SHORT)])
            begun = shorten(begun, room, placeholder=" …", break_on_hyphens=False)
            say(f"{own[0]['claim']:<6} {_standing(own):<{width}}  {begun}")
    for (stem, why), foreigners in foreign.items():
        told = {"stem": stem, "names": page.in_a_row(foreigners), "reason": rule.said(why)}
        say(tr("{stem}: not judged: {names}: {reason}", **told))
    missing: dict[str, dict[str, None]] = {}
    for row in stated:
        if row["class"] == NOT_RUN:
            missing.setdefault(str(row["config"]), {})[row["claim"]] = None
    for stem, lacking in missing.items():
        command = f"radarsim run {shlex.quote(stem)}{configs.into(out)}"
        say(tr("`{command}` judges {names}", command=command, names=page.in_a_row(list(lacking))))
    bracketed = any(page.extension(own) and own[0]["claim"] not in detailed for own in every)
    say((page.counted(stated) or tr("this experiment judges no claims")) + bracketed * tr(" (in brackets)"))
    if len(missing) > MOST_CONFIGS and all(row["class"] == NOT_RUN for row in stated):
        say(tr(NOTHING_OF_ALL))
    elif any(row["class"] != NOT_RUN and row["claim"] not in detailed for row in stated):
        if names:
            command = f"radarsim claims {shlex.join(names)} --parts{configs.into(out)}"
            say(tr("`{command}` shows what was measured", command=command))
        else:
            command = f"radarsim claims {stated[0]['claim']}{configs.into(out)}"
            say(tr("`{command}` shows what was measured; --parts shows it for all of them", command=command))


def _named(row: Mapping[str, Any]) -> str:
    """A part of a claim and its case."""
    return ": ".join(filter(None, (str(row["case"]), tr(str(row["what"])))))


def _standing(parts: Sequence[Mapping[str, Any]]) -> str:
    """The class of a claim in a few words; in brackets if it is not counted."""
    from radarsim.report.claims import page, rule

    own = parts[0]["class"]
    kind = tr("depends") if own == rule.DEPENDS else tr(own)
    kind = tr("{own} as shipped", own=kind) if page.alone(parts[0]) else kind
    return f"({kind})" if page.extension(parts) else kind


def _print_claim(parts: Sequence[Mapping[str, Any]]) -> None:
    """A claim with its place, config, original sentence and a line for each part."""
    from radarsim.report.claims import NOT_JUDGED, NOT_RUN, page, rule

    first = parts[0]
    verdict, place = page.verdict_of(parts).replace("*", ""), f"{tr(first['paper'])}, {tr(first['place'])}"
    say(f"{first['claim']:<6} {verdict}: {tr(first['statement'])} [{place}; {first['config']}]")
    if first["original"]:
        say(f"       «{first['original']}»")
    for row in parts if first["class"] != NOT_RUN else ():
        said = [_named(row)]
        if page.number(row["measured"]) is not None:
            said.append(page.measured(row) + tr("; expected {words}", words=page.expected(row["expected"])))
        if (exact := page.number(row["exact"])) is not None:
            said.append(tr("exactly {value}", value=page.plain(exact) if exact == round(exact) else known(exact)))
        if (missed := page.number(row["miss"])) is not None and missed:
            said.append(tr("off by {miss:.3g} margins", miss=missed))
        if row["verdict"] == NOT_JUDGED:
            said.append(rule.said(row["why"]))
        if page.extension([row]) and not page.extension(parts):
            said.append(tr(page.NOT_COUNTED))
        say(f"       {tr(row['verdict']):<20} {'; '.join(said)}")


def print_readings(done: "Readings", detailed: bool) -> None:
    """A line for each claim, for single claims one for each reading too, and the joint search."""
    from radarsim.report.claims import rule

    for read in done.read:
        for over in read.over:
            if detailed:
                outcomes = [tr(one.outcome.kind) if one.outcome else tr("not possible") for one in over.under]
                width = max(map(len, outcomes))
                for one, outcome in zip(over.under, outcomes, strict=True):
                    why = f" ({rule.said(one.why)})" if one.why else ""
                    say(f"       {one.kind}  {outcome:<{width}}  {over.of.said(one.reading)}{why}")
            found = over.outcome
            words = tr(found.kind) if found else tr("not judged")  # on what it depends, the sentence says
            say(f"{over.claim.id:<6} {words:<28} {over.sentence()}")
        if read.counted is not None:
            say(f"{read.paper.readings.paper}: {read.counted.sentence()}")
    if done.files:
        curves = sum(name.endswith(".svg") for name in done.files)
        drawn = plural("{count} curve", "{count} curves", curves)
        file = str(done.folder / "readings.csv")
        field("table", tr("{file}, {curves} beside it", file=file, curves=drawn) if curves else file)
    if done.outdated:
        command = f"radarsim report {shlex.join(done.outdated)}{configs.into(done.folder.parent)}"
        told = {"configs": listed(done.outdated), "command": command}
        words = tr("claims.csv and report.html of {configs} hold older verdicts: `{command}` updates them", **told)
        field("note", words)
