"""What the terminal shows of answers to questions about a design."""

import math
from collections.abc import Hashable, Sequence
from typing import TYPE_CHECKING, Any

from radarsim.cli.console import command, field, say, show
from radarsim.language import term, tr
from radarsim.report.wording import significant_digits

if TYPE_CHECKING:
    from radarsim.app.compare import Drawn
    from radarsim.app.question import Answer
    from radarsim.app.sensitivity import Sensitivity
    from radarsim.report.quantities import Quantity


PLAIN = ".6g"
MOST_DIGITS = 12  # behind the point: beyond, rounding shows
SAME = 1e-9  # of a quantity: how near an exact root comes


def print_answer(answer: "Answer") -> None:
    """A value with what it attains, then a line each: the slope, other values, the confirming run."""
    value, lo, hi = answer.value, answer.lo, answer.hi
    assert value is not None  # what is not attained is no answer
    assert lo is not None
    assert hi is not None
    interval = tr("exact") if answer.exact else f"95 % {_number(lo)} … {_number(hi)}"
    say(f"{answer.key} = {_with_unit(value, answer.unit)}   {interval}")
    attained = math.nan if answer.attained is None else answer.attained
    if abs(attained - answer.equals) < SAME * max(abs(answer.equals), abs(answer.attained_now)):
        attained = answer.equals  # of a root at zero rounding is all that is left
    field("attains", f"{answer.quantity.said}: {_quantity(answer, attained)}{_now(answer)}")
    if answer.slope is not None:
        field("slope", slope(answer))
    if answer.others:
        field("also at", ", ".join(_with_unit(other, answer.unit) for other in answer.others))
    for note in answer.notes:
        field("note", tr(note))
    command("check", answer.command)


def unattained(answer: "Answer") -> list[str]:
    """Why there is no answer: the nearest that was found, and where."""
    limit, at = answer.limit, answer.limit_at
    assert limit is not None
    assert at is not None
    told = {
        **{"quantity": answer.quantity.said, "key": answer.key, "wanted": _quantity(answer, answer.equals)},
        **{"low": _number(answer.low), "high": _with_unit(answer.high, answer.unit)},
        **{"limit": _quantity(answer, limit), "at": _with_unit(at, answer.unit)},
    }
    most = limit < answer.equals
    line = tr(AT_MOST, **told) if most else tr(AT_LEAST, **told)
    return [line, *(tr("note: {words}", words=tr(note)) for note in answer.notes)]


AT_MOST = term("{quantity}: {wanted} is not attainable by {key} from {low} to {high}: at most {limit}, at {at}")
AT_LEAST = term("{quantity}: {wanted} is not attainable by {key} from {low} to {high}: at least {limit}, at {at}")


def print_drawn(drawn: "Drawn") -> None:
    """Where each case lies, a line each, and what was written."""
    for line in drawn.sentences:
        say(line)
    kinds = sorted(name for name in drawn.files if name.endswith((".svg", ".png", ".pdf")))
    if kinds:
        field("figures", f"{drawn.folder} ({', '.join(kinds)})")
    field("table", str(drawn.folder / "chart.csv"))
    field("page", str(drawn.folder / "chart.html"))


def print_sensitivity(found: "Sensitivity", written: "Sequence[str]") -> None:
    """A table of the leading component: key, its values, and the change of each quantity of each filter."""
    rows = [row for row in found.rows if row["component"] == found.leading]
    shown = [
        (of, one)
        for of in found.of
        for one in dict.fromkeys(row["filter"] for row in rows)
        if any(not math.isnan(row[of.changes[0]]) for row in rows if row["filter"] == one)
    ]
    cells = []
    for key in dict.fromkeys(row["key"] for row in rows):
        own = {row["filter"]: row for row in rows if row["key"] == key}
        first = next(iter(own.values()))
        changed = _with_unit(first["changed_value"], found.labels[str(key)].unit)
        line = [key, f"{_number(first['value'])} → {changed}", *(_change(own.get(one), of) for of, one in shown)]
        cells.append(line)
    heads = [(tr("{kind} of {filter}", kind=of.words, filter=one), of.changed_unit) for of, one in shown]
    columns = ["key", "value", *(head if unit == "%" else f"{head}, {tr(unit)}" for head, unit in heads)]
    what = found.of[0].place(found.leading, tr) or tr(found.of[0].words)
    what = " ".join(filter(None, (what, found.at)))
    title = tr("{stem}: change of {component} for +10 %", stem=found.stem, component=what)
    show(title, columns, cells, right=columns[1:], spare=columns[:1:-1])
    if found.without_effect:
        field("no effect", ", ".join(found.without_effect))
    if found.without_estimate:
        field("no estimate", ", ".join(found.without_estimate))
    if found.not_paired:
        what = tr(
            "{keys}: the scans are at other times, so each has noise of its own", keys=", ".join(found.not_paired)
        )
        field("not paired", what)
    for key, reason in found.left_out.items():
        field("left out", f"{key}: {reason}")
    field("files", ", ".join(written))


def _change(row: "dict[Hashable, Any] | None", of: "Quantity") -> str:
    """A change with its sign, and with its interval where it has one."""
    if row is None:
        return ""
    value, lo, hi = (row[name] for name in of.changes)
    text = f"{_number(value, '+.3g')}{' %' * (of.changed_unit == '%')}"
    return text if row["exact"] else f"{text} [{_number(lo, '+.2g')}, {_number(hi, '+.2g')}]"


def slope(answer: "Answer") -> str:
    """What a little more of the key changes: `1 m/s more costs 1.7 points`."""
    value, per_unit = answer.value, answer.slope
    assert value is not None
    assert per_unit is not None
    step = 10.0 ** math.floor(math.log10(abs(value) / 2)) if value else 1.0
    step = max(step, 1.0) if float(value).is_integer() and step >= 0.5 else step
    change = per_unit * step
    better = (change > 0) == answer.quantity.of.more_is_better
    size = _number(abs(change), "#.3g")
    points = tr("{size} points", size=size)
    changed = points if answer.quantity_unit == "%" else f"{size} {tr(answer.quantity_unit)}".rstrip()
    told = {"step": _with_unit(step, answer.unit, PLAIN), "change": changed}
    if answer.quantity.of.more_is_better:
        return tr("{step} more brings {change}", **told) if better else tr("{step} more costs {change}", **told)
    return tr("{step} more takes off {change}", **told) if better else tr("{step} more adds {change}", **told)


def _now(answer: "Answer") -> str:
    if math.isnan(answer.attained_now):
        return ""
    value = _quantity(answer, answer.attained_now)
    if answer.now is None:
        return tr(" (as the config is: {value})", value=value)
    return tr(" (at {at}: {value})", at=_with_unit(answer.now, answer.unit, PLAIN), value=value)


def _quantity(answer: "Answer", value: float) -> str:
    number = _rate(value) if answer.quantity.of.kind == "share" else _number(value, ".4g")
    return f"{number} {tr(answer.quantity_unit)}".rstrip()


def _rate(percent: float) -> str:
    """A share in per cent: of one that is nearly all so many digits that three are of the rest.

    >>> _rate(99.9990021)
    '99.999002'
    """
    rest = 100.0 - percent
    if not 0.0 < rest < 1.0:
        return _number(percent, ".4g")
    return _number(percent, f".{min(2 - math.floor(math.log10(rest)), MOST_DIGITS)}f")


def _with_unit(value: float, unit: str, form: str = PLAIN) -> str:
    return f"{_number(value, form)} {tr(unit)}".rstrip()


def _number(value: float, form: str = PLAIN) -> str:
    return significant_digits(value, form)
