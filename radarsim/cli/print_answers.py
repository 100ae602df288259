"""Answers of solve, tune, chart and sensitivity on the terminal."""

import math
from collections.abc import Hashable
from typing import TYPE_CHECKING, Any

from radarsim.cli.console import print_command, print_field, print_line, print_table
from radarsim.language.numerals import numeral
from radarsim.language.translate import term, tr
from radarsim.report.wording import format_number, with_unit

if TYPE_CHECKING:
    from radarsim.api.design.sensitivity import Sensitivity
    from radarsim.api.design.solve_answer import Answer
    from radarsim.api.design.tuning_result import TuningResult
    from radarsim.api.doppler_chart import DopplerChart
    from radarsim.report.quantities import Quantity


SLIGHT_CHANGE = 0.01  # per cent or points; keys whose changes are all smaller are named below the table


def print_answer(answer: "Answer") -> None:
    """A value with the quantity there, then a line each: the slope, other values, the run that confirms."""
    (_, value), *details = answer.lines
    print_line(value)
    for label, text in details:
        print_field(label, text)
    print_command("check", answer.command)


def print_tuning(tuning: "TuningResult") -> None:
    """What tuning gains, the keys, the gain of each case, notes, and the run that shows it."""
    print_line(tuning.answer)
    interval_heading = term("within 0.1 %") if tuning.exact else "95 %"
    cells = [
        [key.key, with_unit(key.stated, key.unit), with_unit(key.tuned, key.unit), _interval(key.lo, key.hi)]
        for key in tuning.keys
    ]
    print_table(
        tuning.minimised,
        ["key", "stated", "tuned", interval_heading],
        cells,
        right=["stated", "tuned", interval_heading],
        spare=(),
    )
    if len(tuning.cases) > 1:
        rows = [
            [
                case.case,
                format_number(case.stated, ".4g"),
                format_number(case.tuned, ".4g"),
                f"{format_number(case.gain, '.3g')} {tuning.gain_unit}",
            ]
            + ([] if tuning.exact else [_interval(case.lo, case.hi, ".3g")])
            for case in tuning.cases
        ]
        columns = ["case", "stated", "tuned", "gain", *([] if tuning.exact else ["95 % of gain"])]
        title = f"{tuning.quantity.translated_words}, {tr(tuning.unit)}"
        print_table(title, columns, rows, right=columns[1:], spare=())
    for note in tuning.notes:
        print_field("note", note)
    print_command("check", tuning.command)


def _interval(lo: float | None, hi: float | None, form: str = ".6g") -> str:
    return "" if lo is None or hi is None else f"{format_number(lo, form)} … {format_number(hi, form)}"


def print_doppler_chart(doppler_chart: "DopplerChart") -> None:
    """A line on each case's place, and the files written."""
    folder = doppler_chart.folder
    assert folder is not None  # the command writes what it prints
    for line in doppler_chart.sentences:
        print_line(line)
    kinds = sorted(name for name in doppler_chart.files if name.endswith((".svg", ".png", ".pdf")))
    if kinds:
        print_field("figures", f"{folder} ({', '.join(kinds)})")
    print_field("table", str(folder / "chart.csv"))
    print_field("page", str(folder / "chart.html"))


def print_sensitivity(sensitivity: "Sensitivity") -> None:
    """A table of the leading component: key, its values, and the change of each quantity of each filter."""
    from radarsim.api.design.tornado import LOWERED

    rows = [row for row in sensitivity.rows if row["component"] == sensitivity.leading]
    quantity_columns = [
        (quantity, filter_name)
        for quantity in reversed(sensitivity.of)  # the gain first, which is the question
        for filter_name in dict.fromkeys(row["filter"] for row in rows)
        if any(not math.isnan(row[quantity.changes[0]]) for row in rows if row["filter"] == filter_name)
    ]
    cells, slight_keys = [], []
    for key in dict.fromkeys(row["key"] for row in rows):
        rows_by_filter = {row["filter"]: row for row in rows if row["key"] == key}
        changes = [row[quantity.changes[0]] for row in rows_by_filter.values() for quantity in sensitivity.of]
        if max((abs(change) for change in changes if not math.isnan(change)), default=math.inf) < SLIGHT_CHANGE:
            slight_keys.append(str(key))
            continue
        first_row = next(iter(rows_by_filter.values()))
        changed = with_unit(first_row["changed_value"], sensitivity.labels[str(key)].unit)
        line = [
            f"{key}{LOWERED * (key in sensitivity.lowered)}",
            *(_change(rows_by_filter.get(filter_name), quantity) for quantity, filter_name in quantity_columns),
            f"{format_number(first_row['value'])} → {changed}",
        ]
        cells.append(line)
    headings = [
        (tr("{kind} of {filter}", kind=quantity.words, filter=filter_name), quantity.changed_unit)
        for quantity, filter_name in quantity_columns
    ]
    columns = ["key", *(head if unit == "%" else f"{head}, {tr(unit)}" for head, unit in headings), "value"]
    if cells:
        print_table(sensitivity.title, columns, cells, right=columns[1:], spare=columns[:1:-1])
    if slight_keys:
        limit = numeral(f"{SLIGHT_CHANGE:g}")
        print_field("slight", tr("under {limit}: {keys}", limit=limit, keys=", ".join(slight_keys)))
    if sensitivity.without_effect:
        print_field("no effect", ", ".join(sensitivity.without_effect))
    if sensitivity.without_estimate:
        print_field("no estimate", ", ".join(sensitivity.without_estimate))
    if sensitivity.not_paired:
        sentence = tr(
            "{keys}: the scan times differ, so the noise is not common", keys=", ".join(sensitivity.not_paired)
        )
        print_field("not paired", sentence)
    for key, reason in sensitivity.left_out.items():
        print_field("left out", f"{key}: {reason}")
    print_field("files", ", ".join(sensitivity.files))


def _change(row: "dict[Hashable, Any] | None", quantity: "Quantity") -> str:
    """A change with its sign, and with its interval where it has one."""
    if row is None:
        return ""
    value, lo, hi = (row[name] for name in quantity.changes)
    text = f"{format_number(value, '+.3g')}{' %' * (quantity.changed_unit == '%')}"
    return text if row["exact"] else f"{text} [{format_number(lo, '+.2g')}, {format_number(hi, '+.2g')}]"
