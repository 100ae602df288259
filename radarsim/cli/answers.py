"""Terminal output of answers to questions about a design."""

import math
from collections.abc import Hashable
from typing import TYPE_CHECKING, Any

from radarsim.app.question import PLAIN, shown, with_unit
from radarsim.cli.console import command, field, say, show
from radarsim.language import term, tr

if TYPE_CHECKING:
    from radarsim.app.compare import DopplerChart
    from radarsim.app.question import Answer
    from radarsim.app.sensitivity import Sensitivity
    from radarsim.app.tune import Tuned
    from radarsim.report.quantities import Quantity


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


def _ends(lo: float | None, hi: float | None, form: str = PLAIN) -> str:
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
