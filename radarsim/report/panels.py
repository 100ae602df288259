"""Figures common to all studies, made from the tables alone: σ against time, gain against time."""

import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.check import Label
from radarsim.config.check import label as label_of
from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language import plural, power_of_ten, term, tr
from radarsim.report import seen, wording
from radarsim.report import tables as common
from radarsim.report.drawing import COLUMN_MM, GREY, PAGE_MM, Axis, Figure, Line, Mark, Panel, Reference, Style
from radarsim.report.quantities import Component
from radarsim.report.statistics import Z95

if TYPE_CHECKING:
    import pandas as pd

WIDE_MM = 120.0  # one panel of many lines
MOST_AT_ENDS = 6  # lines of one panel named at their ends; if more, by colour and dash
MOST = 8  # cases of a panel; the others are named in its caption
MOST_PANELS = 12
NEAR_ONE = 0.999  # probabilities above it differ only in further digits
RARE = 0.1  # of a share's loss: below it the loss is drawn logarithmically
MOST_GONE = 8  # names of what a figure leaves out
WIDE = 20  # ratio of values from which an axis is logarithmic
MOST_LINES = 12  # of a panel that several cases of more than FEW_FILTERS share
FEW_FILTERS = 3  # distinguished by dash, while shades distinguish the cases
LONG = 5  # powers of ten from this one on are written raised
NEAR_ZERO = 1e-5  # of the largest σ: below it a logarithmic axis would show rounding
WIDEST_BAND, LOG_MARGIN, MARGIN = 2.0, 1.12, 0.05  # of a shared axis: how far bands count, and room at its ends
SAME = 0.01  # of a value
LINE = 0.004  # of a panel's height: half the width of a line
LOSS = 100.0  # per cent at which much lower gains are cut
LONGEST_INSIDE = 28  # letters of a name in a legend inside a panel of many lines
GREEK = {"b": "\\beta", "e": "\\varepsilon"}  # bearing and elevation, as the components' names begin or end
DEGREES = 180 / np.pi
FEW_DIGITS = 3  # of an angle that was given in radians
POWERS = ("manoeuvre_variance",)  # swept keys written as powers of ten


SIGMA = ("t_s", "sigma", "sigma_lo", "sigma_hi", "exact_sigma")  # columns of a line of σ against time
GAIN = ("t_s", "gain_percent", "gain_lo", "gain_hi", "exact_percent")


def number(value: object, powers: bool = False) -> str:
    """A number for people: 0.001 as 10⁻³ (with powers, 0.1 as 10⁻¹), others at four digits; text unchanged. Numbers of
    a list one after the other."""
    if isinstance(value, list | tuple) and all(isinstance(one, int | float) for one in value):
        return wording.in_a_row(map(number, value))
    if not isinstance(value, int | float) or isinstance(value, bool):
        return literal(str(value).replace("_", " "))  # of a list of choices, of a scenario
    power = int(f"{value:.0e}".partition("e")[2])
    if (
        value != 0
        and float(f"1e{power}") == value
        and (power >= (2 if powers else LONG) or power < (0 if powers else -1))
    ):
        return power_of_ten(power)
    return wording.number(value, 6 if NEAR_ONE < value < 1 else 4)


def in_short(result: CaseResult, key: str, value: object, among: Sequence[object]) -> object:
    """A mapping of a swept key by its kind and its differences from others of the kind, as words; any other value
    unchanged."""
    if not isinstance(value, Mapping) or "kind" not in value:
        return value
    alike = [one for one in among if isinstance(one, Mapping) and one.get("kind") == value["kind"]]
    own = {name: one for name, one in value.items() if any(other.get(name) != one for other in alike)}
    return in_words(result, key, {"kind": value["kind"], **own})


def in_words(result: CaseResult, key: str, value: Mapping) -> str:
    """A mapping that is a key's value: its kind, and each of its keys by name, with value and unit."""
    kind = [number(value["kind"])] if "kind" in value else []
    own = [f"{key}.{name}" for name in value if name != "kind"]
    named = zip(own, (one for name, one in value.items() if name != "kind"), strict=True)
    return ", ".join(
        [*kind, *(f"{key_label(result, name).text} {with_its_unit(result, name, one)}" for name, one in named)]
    )


def literal(name: str) -> str:
    """A user's text for a figure: a dollar is a dollar."""
    return name.replace("$", r"\$")


def stem(result: CaseResult) -> str:
    """The config of a case: its name without the swept keys."""
    return result.name.split(" ", 1)[0]


def device(result: CaseResult) -> str:
    """The name of a case's sensor: the display name, else the config's stem."""
    return literal(result.spec.device) if result.spec.device else stem(result)


def swept(result: CaseResult, without: Iterable[str] = ()) -> str:
    """The swept keys of a case in short, but for some: "D_M = 10⁻³", "σ_V = 5 m/s"."""
    told = [(key, value) for key, value in result.swept if key not in set(without)]
    return ", ".join(f"{symbol_of(result, key)} = {with_its_unit(result, key, value)}" for key, value in told)


def shared_keys(results: Sequence[CaseResult]) -> set[str]:
    """The swept keys that have one value in all of several cases."""
    values = [dict(result.swept) for result in results]
    return {key for key in values[0] if all(one.get(key) == values[0][key] for one in values)} if values[1:] else set()


def with_its_unit(result: CaseResult, key: str, value: object) -> str:
    """A value of a key with the key's unit, except a unit that would need brackets."""
    if isinstance(value, Mapping):
        return in_words(result, key, value)
    if isinstance(value, list | tuple):
        return " ".join(filter(None, (number(value), unit_of(key_label(result, key).unit))))
    if not isinstance(value, int | float) or isinstance(value, bool):
        return number(value)
    factor, own = in_degrees(key_label(result, key).unit)
    shown = number(value, is_power(key)) if factor == 1.0 else turned_number(factor * value)
    said = unit_of(own)
    return f"{shown}{said}" if said.startswith("°") else " ".join(filter(None, (shown, said.partition("(")[0])))


def turned_number(degrees: float) -> str:
    """An angle that was given in radians, at few digits: 1° of 0.01745 rad."""
    return wording.number(float(f"{degrees:.{FEW_DIGITS}g}"), FEW_DIGITS)


def key_label(result: CaseResult, key: str) -> Label:
    """The name of a key of a case, in the current language; its unit as in tables."""
    found = label_of(result.spec, key)
    return found._replace(text=tr(found.text))


def unit_of(name: str) -> str:
    """A unit as people write it, in the current language."""
    return tr(wording.unit(name))


def is_power(key: str) -> bool:
    """Whether values of a key are written as powers of ten."""
    return key.rpartition(".")[2] in POWERS


def symbol_of(result: CaseResult, key: str) -> str:
    """The short name of a key of a case in figures: its letter if it has one (mathematical text), else its name."""
    found = key_label(result, key)
    return mathematical(found.symbol) if found.symbol else found.text


def axis_of(result: CaseResult, key: str) -> str:
    """The label of a key's axis: name, letter, unit; values on it are times `axis_factor`."""
    found = key_label(result, key)
    return with_unit(" ".join(filter(None, (found.text, mathematical(found.symbol)))), in_degrees(found.unit)[1])


def axis_factor(result: CaseResult, key: str) -> float:
    """The factor for a key's values on an axis: angles are given in radians and shown in degrees."""
    return in_degrees(key_label(result, key).unit)[0]


def sigma_of(symbol: str, unit: str) -> str:
    """The label of an axis of σ of a component."""
    return with_unit(tr("$\\sigma$ of {symbol}", symbol=symbol), unit)


def mathematical(symbol: str) -> str:
    """A symbol as mathematical text: $D_M$ of D_M."""
    base, _bar, below = symbol.partition("_")
    return f"${base}_{{{below}}}$" if len(below) > 1 else f"${symbol}$" if symbol else ""


def letter(component: str) -> str:
    """A component of the tables on a figure's axis: "vb" as $v_\beta$; a longer name unchanged."""
    found = re.fullmatch(r"([vVa]?)([a-z])", component)
    if not found:
        return literal(component)
    base = GREEK.get(found[2], found[2])
    return f"${found[1]}_{base}$" if found[1] else f"${base}$"


def in_degrees(unit: str) -> tuple[float, str]:
    """The factor by which an angle, or its rate, is shown, and its unit: degrees for radians; others unchanged."""
    return (DEGREES, unit.replace("rad", "°", 1)) if unit == "rad" or unit.startswith("rad/") else (1.0, unit)


def scaled(line: Line, factor: float) -> Line:
    """A line in another unit."""
    if factor == 1.0:
        return line
    parts = {name: getattr(line, name) for name in ("y", "lo", "hi", "exact")}
    return replace(line, **{name: part * factor for name, part in parts.items() if part is not None})


def with_unit(words: str, unit: str) -> str:
    """An axis' words with their unit, where there is one."""
    return ", ".join(filter(None, (words, unit_of(unit))))


def label(result: CaseResult) -> str:
    """Device and swept keys, for a line or a panel."""
    return ", ".join(filter(None, (device(result), swept(result))))


def line(rows: "pd.DataFrame", columns: Sequence[str], label: str, style: Style | int, name: str = "") -> Line:
    """A line of x and y from two columns of rows; further columns give the ends of its band, and exact values. A
    numeric style is that of the filter with this number."""
    x, y, *more = (rows[column].to_numpy(dtype=float) for column in columns)
    lo, hi = more[:2] or (None, None)
    exact = more[2] if more[2:] and np.isfinite(more[2]).any() else None
    look = Style(style, style, style) if isinstance(style, int) else style
    return Line(x, y, label, look, lo, hi, exact, name)


def line_of(x: np.ndarray, rows: Sequence["pd.Series"], columns: Sequence[str], label: str, style: Style) -> Line:
    """`line` over x (n,) of n rows of several tables."""
    return line(
        common.frame({"x": x} | {name: [row[name] for row in rows] for name in columns}), ("x", *columns), label, style
    )


def in_legend(drawn: Sequence[Panel]) -> list[Panel]:
    """Panels of many lines with one legend in a cell of its own, with names from the lines."""
    keys = {mark.label: mark.style for panel in drawn for mark in panel.marks if isinstance(mark, Line) and mark.label}
    blank = [
        replace(
            panel,
            marks=tuple(
                replace(m, label="", name=m.name or m.label) if isinstance(m, Line) else m for m in panel.marks
            ),
        )
        for panel in drawn
    ]
    return [*blank, Panel(drawn[0].x, drawn[0].y, (), keys=tuple(keys.items()))]


def time_axis() -> Axis:
    """The axis of time that figures of all studies share."""
    return Axis(tr("time from the first plot, s"), limits=(0, None))


def counts(label: str, highest: float) -> Axis:
    """An axis of whole numbers from zero, with ticks at whole numbers only."""
    step = next(s * 10**p for p in range(9) for s in (1, 2, 5) if highest / (s * 10**p) <= 8)
    return Axis(label, limits=(0, None), ticks=tuple((float(n), str(n)) for n in range(0, int(highest) + 1, step)))


def plain_label(result: CaseResult) -> str:
    """`label` for text: letters plain."""
    return plain(label(result))


def at_its_place(result: CaseResult, sentence: str) -> str:
    """A sentence on a case, preceded by its swept values where there are several."""
    where = plain(swept(result))
    return f"{where}: {sentence}" if where else sentence


def reported(results: Sequence[CaseResult], most: int = 3) -> tuple[list[CaseResult], list[str]]:
    """The cases that an answer reports: all, or the first and last of more than so many; and words on the others."""
    if len(results) <= most:
        return list(results), []
    left = plural(
        "The case in between is in the report's tables.",
        "The {count} cases in between are in the report's tables.",
        len(results) - 2,
    )
    return [results[0], results[-1]], [left]


def plain(words: str) -> str:
    """A figure's text without mathematical markup."""
    bare = re.sub(r"_\{([^}]*)\}", r"_\1", words.replace(r"\$", "\0"))
    return bare.replace("$", "").replace("\0", "$")


def families(results: Sequence[CaseResult]) -> dict[str, list[CaseResult]]:
    """Cases by config, in order: one panel each."""
    found: dict[str, list[CaseResult]] = {}
    for result in results:
        found.setdefault(stem(result), []).append(result)
    return found


def by_panel(results: Sequence[CaseResult], most: float = MOST_LINES) -> dict[str, list[CaseResult]]:
    """Cases that share a panel, by its title: those of a config; with several swept keys, those alike in all but the
    last.

    Cases of many filters have a panel each where they would make more than so many lines together."""
    found: dict[str, list[CaseResult]] = {}
    several = len(families(results)) > 1
    for result in results:
        outer = result.swept[:-1]
        words = ", ".join(f"{symbol_of(result, key)} = {with_its_unit(result, key, value)}" for key, value in outer)
        of = (device(result) if several or not words else "", words)
        found.setdefault("\0".join((stem(result), *filter(None, of))), []).append(result)
    parted: list[tuple[str, list[CaseResult]]] = []
    for key, members in found.items():
        counts = [len(result.axes.filters) for result in members]
        if sum(counts) <= most or max(counts) <= FEW_FILTERS or len(members) == 1:
            parted.append((key.partition("\0")[2].replace("\0", ", "), members))
        else:
            start = [device(members[0])] if several else []
            parted += [(", ".join([*start, swept(result) or result.name]), [result]) for result in members]
    return distinct([(title, stem(members[0])) for title, members in parted], [members for _, members in parted])


def distinct(titles: Sequence[tuple[str, str]], values: Sequence[Any]) -> dict[str, Any]:
    """Values by their titles; by config and title, the second of each pair first, where a title occurs twice."""
    often = Counter(title for title, _ in titles)
    names = [title if often[title] == 1 else ", ".join(filter(None, (config, title))) for title, config in titles]
    return dict(zip(names, values, strict=True))


def spread_out(items: Sequence[Any], most: int) -> list[Any]:
    """At most so many of the items, evenly spaced from the first to the last."""
    if len(items) <= most:
        return list(items)
    return [items[i] for i in np.linspace(0, len(items) - 1, most).round().astype(int)]


def realisations(results: Sequence[CaseResult]) -> str:
    """The number of realisations of a figure: "100,000 to 200,000 realisations" where its cases differ."""
    return _of_realisations([result.count for result in results])


def _of_realisations(counts: Sequence[int]) -> str:
    least, most = min(counts), max(counts)
    if least == most:
        return plural("{count:,} realisation", "{count:,} realisations", most)
    return plural("{least:,} to {count:,} realisations", "{least:,} to {count:,} realisations", most, least=least)


def left_out(every: Sequence[str], some: Sequence[str]) -> str:
    """Words on the omissions of a figure, after its caption: how many of how many it shows, and which are missing."""
    gone = [name for name in every if name not in some]
    if not gone:
        return ""
    told = {"count": len(every) - len(gone), "all": len(every), "names": seen.join_names(map(plain, gone), MOST_GONE)}
    return " " + tr("Shown: {count} of {all}; only in the tables: {names}.", **told)


def names_of(results: Sequence[CaseResult]) -> list[str]:
    """Distinct names of cases: by swept values, with the device where there are several."""
    several = len(families(results)) > 1
    found = [plain_label(one) if several or not one.swept else plain(swept(one)) for one in results]
    return found if len(set(found)) == len(found) else [one.name for one in results]


def cases_left_out(every: Sequence[CaseResult], some: Sequence[CaseResult]) -> str:
    """`left_out` of cases."""
    names = dict(zip((one.name for one in every), names_of(every), strict=True))
    return left_out(list(names.values()), [names[one.name] for one in some])


def unswept(results: Sequence[CaseResult]) -> list[CaseResult]:
    """The cases without swept keys, if any; else all."""
    return [result for result in results if not result.swept] or list(results)


def named(experiment: Experiment, figure: str) -> list[str]:
    """The cases that a config names for a figure."""
    return [case.name for case in experiment.shown_in(figure)]


def shown(results: Sequence[CaseResult], names: Sequence[str]) -> tuple[list[CaseResult], str]:
    """The results in a figure, of the cases named, at most eight evenly spaced; and words on the others."""
    wanted = [result for result in results if result.name in set(names)]
    some = spread_out(wanted, MOST)
    return some, cases_left_out(wanted, some)


def shown_families(results: Sequence[CaseResult], names: Sequence[str]) -> tuple[list[CaseResult], str]:
    """The results of a figure with a panel for each of `by_panel`: at most twelve panels of at most eight cases. If
    more, evenly spaced ones from the first to the last."""
    wanted = [result for result in results if result.name in set(names)]
    groups = spread_out(list(by_panel(wanted).values()), MOST_PANELS)
    some = [result for members in groups for result in spread_out(members, MOST)]
    return some, cases_left_out(wanted, some)


def fitting_axis(label: str, marks: Sequence[Mark]) -> Axis:
    """An axis of positive values: logarithmic where the least would otherwise lie on zero."""
    values = np.concatenate([np.asarray(mark.y, float) for mark in marks if isinstance(mark, Line)] or [np.ones(1)])
    values = values[np.isfinite(values) & (values > 0)]
    if not values.size or values.max() <= WIDE * values.min():
        return Axis(label, limits=(0, None))
    low = NEAR_ZERO * float(values.max())
    return Axis(label, "log", (float(values[values > low].min()) / 2, None) if values.min() < low else (None, None))


def lost(line: Line) -> Line:
    """A line of the complement of a share."""
    lo, hi, exact = (None if part is None else 1 - part for part in (line.hi, line.lo, line.exact))
    return replace(line, y=1 - line.y, lo=lo, hi=hi, exact=exact)


def is_rare(lines: Sequence[Line]) -> bool:
    """Whether any of some shares is mostly so near one that its losses matter, and has losses to show."""
    return any(float(np.median(line.y)) > 1 - RARE and np.count_nonzero(line.y < 1) > 1 for line in lines)


def loss_axis(label: str, lines: Sequence[Line]) -> Axis:
    """A logarithmic axis of losses, from half the least non-zero one: zero has no point."""
    values = np.concatenate([line.y for line in lines] or [np.ones(1)])
    return Axis(label, "log", (float(values[values > 0].min(initial=1.0)) / 2, None))


def unbanded(figure: Figure) -> Figure:
    """The figure, where a line has a band but not at all of its points, with words on why."""
    lines = (mark for panel in figure.panels for mark in panel.marks if isinstance(mark, Line) and mark.lo is not None)
    if not any((np.isnan(np.asarray(line.lo, float)) & np.isfinite(line.y)).any() for line in lines):
        return figure
    return replace(figure, caption=f"{figure.caption} {tr('No band is drawn where a few large errors dominate.')}")


def joined(figure: Figure) -> Figure:
    """The figure with lines that coincide in all its panels drawn once, their names joined by "=". Lines that are
    named, by themselves or by a legend of their names, not those told apart by dash and shade."""
    every = [{name: one for one in panel.marks if (name := _own_name(one, figure))} for panel in figure.panels]
    alike: dict[str, list[str]] = {}
    for name in dict.fromkeys(name for named in every for name in named):
        first = next((one for one in alike if _coincide(one, name, every, figure)), name)
        alike.setdefault(first, []).append(name)
    renamed = {first: _joined_name(names) for first, names in alike.items()}
    gone = {name for names in alike.values() for name in names[1:]}
    if not gone:
        return figure

    def mark(one: Mark) -> Mark:
        name = _own_name(one, figure)
        if not (name and isinstance(one, Line)):
            return one
        return replace(one, label=one.label and renamed[name], name=one.name and renamed[name])

    panels = tuple(
        replace(
            panel,
            marks=tuple(mark(one) for one in panel.marks if _own_name(one, figure) not in gone),
            keys=tuple((renamed.get(words, words), style) for words, style in panel.keys if words not in gone),
        )
        for panel in figure.panels
    )
    said = tr("Curves that coincide are drawn once, with both names.")
    return replace(figure, panels=panels, caption=f"{figure.caption} {said}")


def _joined_name(names: Sequence[str]) -> str:
    """Names of one curve: "nearest = PDA"; a swept value that they share once, at the end."""
    heads, tails = zip(*((head, tail) for head, _, tail in (name.partition(", ") for name in names)), strict=True)
    if len(set(tails)) == 1 and "=" in tails[0]:
        return f"{' = '.join(heads)}, {tails[0]}"
    return " = ".join(names)


def _own_name(mark: Mark, figure: Figure) -> str:
    """The name of a curve that has one of its own, at its end or in a legend; empty for any other mark."""
    if not isinstance(mark, Line) or mark.style.dash is None or len(mark.x) < 2:
        return ""
    if mark.label:
        return mark.label if mark.name in ("", mark.label) else ""
    return mark.name if any(mark.name == words for panel in figure.panels for words, _ in panel.keys) else ""


def _coincide(one: str, other: str, every: Sequence[Mapping[str, Mark]], figure: Figure) -> bool:
    """Whether two curves cannot be told apart in any panel where they are drawn: values and bands nearer than half a
    line's width, and to a per cent."""
    drawn = False
    for named, panel in zip(every, figure.panels, strict=True):
        a, b = named.get(one), named.get(other)
        if a is None and b is None:
            continue
        if not (isinstance(a, Line) and isinstance(b, Line)) or not np.array_equal(a.x, b.x):
            return False
        log = panel.y.scale == "log"
        lines = [
            line
            for line in named.values()
            if isinstance(line, Line) and (line.y > 0 if log else np.isfinite(line.y)).any()
        ]
        if not lines:
            continue
        low, high = (np.log10(end) if log else end for end in _holding(lines, panel.y))
        drawn |= bool((a.y > 0 if log else np.isfinite(a.y)).any())
        for first, second in ((a.y, b.y), (a.lo, b.lo), (a.hi, b.hi), (a.exact, b.exact)):
            if first is None or second is None:
                if first is not second:
                    return False
                continue
            with np.errstate(divide="ignore", invalid="ignore"):
                ours, theirs = (np.log10(part) if log else np.asarray(part, float) for part in (first, second))
                within = np.log10(1 + SAME) if log else SAME * np.abs(ours) + SAME * LINE * (high - low)
                near = np.abs(ours - theirs) <= np.minimum(LINE * (high - low), within)
            if not (near | (ours == theirs) | (np.isnan(ours) & np.isnan(theirs))).all():
                return False
    return drawn


def ever_lost(lines: Sequence[Line]) -> tuple[tuple[Line, ...], str]:
    """The complements of shares that have a loss, and words on zeros, which a logarithmic axis lacks, for a caption."""
    losses = tuple(map(lost, lines))
    drawn = tuple(line for line in losses if (line.y > 0).any())
    names = [plain(line.name or line.label) for line in losses if not (line.y > 0).any()]
    said = " " + tr("Zero throughout, so not drawn: {names}.", names=seen.join_names(names, MOST_GONE)) if names else ""
    if any((line.y == 0).any() for line in drawn):
        said += " " + tr("A zero has no point on this axis.")
    return drawn, said


def shared(drawn: Sequence[Panel]) -> list[Panel]:
    """Panels of lines side by side: those of one quantity share the axis of y that holds all."""
    shown = [panel for panel in drawn if panel.marks]
    lines = [mark for panel in shown for mark in panel.marks if isinstance(mark, Line)]
    if len(shown) < 2 or len({panel.y.label for panel in shown}) > 1 or not lines or any(p.y.ticks for p in shown):
        return list(drawn)
    given = [panel.y for panel in shown if None not in panel.y.limits]
    log = [panel.y for panel in shown if panel.y.scale == "log"]
    own = shown[0].y
    y = (given or log or [fitting_axis(own.label, lines) if own.limits == (0, None) else own])[0]
    if not given:
        y = replace(y, limits=_holding(lines, y))
    return [replace(panel, y=y) for panel in drawn]


def _holding(lines: Sequence[Line], y: Axis) -> tuple[float, float]:
    """Limits that hold all lines, and their bands except ends far beyond them."""
    values = np.concatenate(
        [np.asarray(part, float) for one in lines for part in (one.y, one.exact) if part is not None]
    )
    bands = np.concatenate(
        [np.asarray(part, float) for one in lines for part in (one.lo, one.hi) if part is not None] or [values]
    )
    log = y.scale == "log"
    values, bands = (one[np.isfinite(one) & (one > 0 if log else True)] for one in (values, bands))
    if log:
        low = float(max(values.min() / WIDEST_BAND, bands.min(initial=values.min()))) / LOG_MARGIN
        high = float(min(values.max() * WIDEST_BAND, bands.max(initial=values.max()))) * LOG_MARGIN
        return y.limits[0] or low, high
    span = float(values.max() - values.min()) or 1.0
    low = float(max(values.min() - span, bands.min(initial=values.min()))) - MARGIN * span
    high = float(min(values.max() + span, bands.max(initial=values.max()))) + MARGIN * span
    return low if y.limits[0] is None else y.limits[0], high


def sigma_figure(name: str, results: Sequence[CaseResult], curves: Mapping, of: Component) -> Figure:
    """σ(t) of one component: a panel for each config, a line for each filter and swept value.

    curves is tables.groups(table, "case", "filter", "component")."""
    every = by_panel(results)
    filters = filters_of(results)
    panels = [_sigma_panel(title, members, curves, of, filters) for title, members in every.items()]
    panels = [panel for panel in panels if panel.marks]
    caption = tr(
        "Root-mean-square error of the {quantity} about the truth against time, of {realisations}. "
        "Bands: 95 % intervals; a band that is not visible is narrower than the line.",
        quantity=of.words,
        realisations=realisations(results),
    )
    title = tr("σ of the {quantity}", quantity=of.words)
    figure = in_columns(Figure(name, title, caption, tuple(panels)))
    return figure


def floored(figure: Figure, floor: "pd.DataFrame | None", component: str, factor: float = 1.0) -> Figure:
    """A figure of σ of one case, of few lines, with its floor. Of filters that have other plots it is that of those
    with the most."""
    rows = None if floor is None or not len(floor) else floor[floor["component"] == component]
    if rows is None or not len(rows) or len(figure.panels) != 1 or len(figure.panels[0].marks) > MOST_AT_ENDS:
        return figure
    least = factor * rows.groupby("t_s", sort=True)["floor"].min()
    (panel,) = figure.panels
    line = Line(least.index.to_numpy(), least.to_numpy(), tr("floor"), GUIDE)
    panel = replace(panel, marks=(*panel.marks, line))
    posterior = rows["kind"].str.startswith("posterior").all()
    said = tr("Grey: the floor, a posterior Cramér-Rao bound.") if posterior else tr(UNDER_UNBIASED)
    return replace(figure, panels=(panel,), caption=f"{figure.caption} {said}")


UNDER_UNBIASED = term("Grey: the floor, a Cramér-Rao bound of unbiased estimators.")
GUIDE = Style(GREY, 0, width_pt=0.8)


def in_columns(figure: Figure) -> Figure:
    """A figure with as many columns as its panels fill, at one of the widths of a page."""
    count = len([panel for panel in figure.panels if panel.marks])
    alike = tuple(shared(figure.panels))
    one = {(panel.y.label, panel.y.scale, panel.y.limits, panel.y.ticks) for panel in alike if panel.marks}
    figure = replace(figure, panels=alike, share_y=count > 1 and len(one) == 1)
    if count == 1:
        wide = figure.panels[0].legend == "right"
        return replace(figure, columns=1, width_mm=WIDE_MM if wide else COLUMN_MM, panel_height_mm=64.0)
    return replace(figure, columns=2 if count in (2, 4) else 3, width_mm=PAGE_MM, panel_height_mm=56.0)


def _sigma_panel(
    title: str, members: Sequence[CaseResult], curves: Mapping, of: Component, filters: Sequence[str]
) -> Panel:
    marks = lines_of(members, curves, of.name, SIGMA, filters)
    y = fitting_axis(sigma_of(of.symbol, of.unit), marks)
    return keyed(Panel(time_axis(), y, tuple(marks), title), members, filters)


def filters_of(results: Sequence[CaseResult]) -> list[str]:
    """The filters of all cases of a figure, each once: a filter's place in it decides how its line looks."""
    return list(dict.fromkeys(f for result in results for f in result.axes.filters))


def lines_of(
    members: Sequence[CaseResult], rows: Mapping, component: str, columns: Sequence[str], filters: Sequence[str]
) -> list[Mark]:
    """A line for each filter of each case of a panel: named by the filter if there is one case, else by the swept
    value.

    rows by case, filter and component; columns as for `line`; filters as of `filters_of`: a filter has the same style
    in all panels of a figure."""
    marks: list[Mark] = []
    for i, result in enumerate(members):
        for f in result.axes.filters:
            own = rows.get((result.name, f, component))
            if own is None:
                continue
            style = look(filters.index(f), i, len(members))
            if len(members) == 1:
                marks.append(line(own, columns, literal(f), style, literal(f)))
            else:
                key, value = result.swept[-1] if result.swept else ("", device(result))
                among = [dict(one.swept).get(key) for one in members]
                words = _shown_value(result, key, in_short(result, key, value, among)) if key else number(value)
                marks.append(line(own, columns, words, style, f"{literal(f)}, {swept(result)}"))
    return marks


def _shown_value(result: CaseResult, key: str, value: object) -> str:
    """A value of a key without its unit, as on its axis."""
    factor = axis_factor(result, key)
    is_turned = factor != 1.0 and isinstance(value, int | float) and not isinstance(value, bool)
    return turned_number(factor * float(str(value))) if is_turned else number(value, is_power(key))


def family_panel(title: str, members: Sequence[CaseResult], rows: Mapping, words: str, filters: Sequence[str]) -> Panel:
    """A panel of any quantity of the members about one; rows by case, filter and its column, against t_s."""
    column = next(key[2] for key in rows)
    marks = lines_of(members, rows, column, ("t_s", column), filters)
    return keyed(Panel(time_axis(), fitting_axis(words, marks), (Reference(1), *marks), title), members, filters)


NEES = term("NEES per component\n(1 = consistent, below = pessimistic)")


def consistency(results: Sequence[CaseResult], table: "pd.DataFrame", experiment: Experiment) -> dict[str, Figure]:
    """The figure `consistency` of a table with NEES by case, filter and time, a panel for each config."""
    rows = {(*key, "nees"): own for key, own in common.groups(table, "case", "filter").items()}
    some, left_out = shown_families(results, named(experiment, "consistency"))
    return {"consistency": nees_figure(nees_panels(some, rows), left_out)}


def nees_panels(results: Sequence[CaseResult], rows: Mapping) -> list[Panel]:
    """NEES against time, a panel for each config; rows by case, filter and `nees`."""
    filters = filters_of(results)
    every = [family_panel(title, members, rows, tr(NEES), filters) for title, members in by_panel(results).items()]
    return [panel for panel in every if len(panel.marks) > 1]


def nees_figure(drawn: Sequence[Panel], left_out: str) -> Figure:
    """The figure `consistency` of such panels; its caption names the panels left out."""
    caption = tr(
        "Mean of the normalised squared error eᵀP⁻¹e per estimated component, with the filter's own "
        "covariance P: one (dotted) for a consistent filter, more for an optimistic one, less for a "
        "pessimistic one."
    )
    title = tr("Consistency of the filters")
    return in_columns(Figure("consistency", title, caption + left_out, tuple(drawn)))


def keyed(panel: Panel, members: Sequence[CaseResult], filters: Sequence[str], baseline: bool = True) -> Panel:
    """A panel whose legend explains dashes by filter and colours by swept value; few lines are named at their ends.

    filters as for `lines_of`; baseline: whether to draw the baseline filter."""
    if len(members) == 1:
        return panel
    shown = {
        f for result in members for n, f in enumerate(result.axes.filters) if baseline or n != result.axes.baseline
    }
    dashes = tuple((literal(f), Style(0, n, n)) for n, f in enumerate(filters) if f in shown)
    dashes = dashes if len(dashes) > 1 else ()
    title = key_title(members[0]) if members[0].swept else ""
    if sum(isinstance(mark, Line) for mark in panel.marks) > MOST_AT_ENDS:
        return _by_colour(panel, dashes, title)
    return replace(panel, keys=dashes, line_title=title)


def key_title(result: CaseResult) -> str:
    """The title of a legend of the last swept key's values: its letter or name, and its unit."""
    key = result.swept[-1][0]
    return with_unit(symbol_of(result, key), in_degrees(key_label(result, key).unit)[1])


def _by_colour(panel: Panel, dashes: tuple, title: str) -> Panel:
    """A panel of many lines: names in a legend beside it, one for each colour and each dash."""
    lines = [mark for mark in panel.marks if isinstance(mark, Line)]
    shades = {line.label: Style(line.style.colour, 0) for line in lines}
    marks = tuple(replace(mark, label="") if isinstance(mark, Line) else mark for mark in panel.marks)
    return replace(panel, marks=marks, keys=(*shades.items(), *dashes), key_title=title, legend="right")


def look(nth_filter: int, nth_case: int, cases: int) -> Style:
    """Filters differ by dash and marker; cases by shade; filters of a single case by colour too."""
    colour = nth_filter if cases == 1 else nth_case / (cases - 1)
    return Style(colour, nth_filter, nth_filter)


def gain_figure(name: str, results: Sequence[CaseResult], gains: Mapping, of: Component) -> Figure:
    """Relative gain of one component against time, a line for each case and filter. One panel where no config is swept;
    else one for each of `by_panel`. gains is tables.groups(table, "case", "filter", "component")."""
    base = results[0].axes.filters[results[0].axes.baseline]
    caption = tr(
        "Relative gain in σ of the {quantity} against filter {base}, paired on common noise, of {realisations}. "
        "Bands: 95 % intervals. Below zero: a loss.",
        quantity=of.words,
        base=base,
        realisations=realisations(results),
    )
    y, title = (
        Axis(tr("gain in $\\sigma$ of {symbol}, %", symbol=of.symbol)),
        tr("Gain in σ of the {quantity}", quantity=of.words),
    )
    several = any(len(result.axes.filters) > 2 for result in results)
    if any(result.swept for result in results) or (several and len(results) > 1):
        drawn, filters = [], filters_of(results)
        for words, members in by_panel(results).items():
            lines = lines_of(members, gains, of.name, GAIN, filters)
            panel = Panel(time_axis(), *_cut(y, lines), words)
            drawn += [keyed(panel, members, filters, baseline=False)] if lines else []
        return _gains_said(in_columns(Figure(name, title, caption, tuple(drawn))))
    marks: list[Mark] = []
    for i, result in enumerate(results):
        for n, f in enumerate(result.axes.filters):
            rows = gains.get((result.name, f, of.name))
            if rows is not None:
                case = label(result) if len(results) > 1 else ""
                words = ", ".join(filter(None, (case, literal(f) if several or len(results) == 1 else "")))
                mark = n if several else i
                marks.append(line(rows, GAIN, words, Style(i if len(results) > 1 else n, mark, mark), words))
    # Many long names would cover the lines: the legend is beside the panel.
    long = len(marks) > 3 and any(isinstance(mark, Line) and len(mark.label) > LONGEST_INSIDE for mark in marks)
    panel = Panel(time_axis(), *_cut(y, marks), direct=not long, legend="right" if long else "best")
    width = PAGE_MM if long else COLUMN_MM if len(results) < 3 else WIDE_MM
    figure = Figure(name, title, caption, (panel,), width_mm=width)
    return _gains_said(figure)


def _gains_said(figure: Figure) -> Figure:
    """A figure of gains with its first sentence, and a note where losses are cut."""
    if any(panel.y.limits[0] == -LOSS for panel in figure.panels):
        names = seen.lines_below(figure, -LOSS)
        words = tr("Losses of over {loss:g} % lie below the axis: {names}.", loss=LOSS, names=names)
        figure = replace(figure, caption=f"{figure.caption} {words}")
    return figure


def _cut(y: Axis, lines: Sequence[Mark]) -> tuple[Axis, tuple[Mark, ...]]:
    """The axis of gains and its marks: losses far beyond 100 % would hide everything else, and are cut."""
    values = [mark.y[np.isfinite(mark.y)] for mark in lines if isinstance(mark, Line)]
    least = min((float(found.min()) for found in values if found.size), default=0.0)
    return replace(y, limits=(-LOSS, 100.0)) if least < -2 * LOSS else y, (Reference(0), *lines)


def per_component(
    results: Sequence[CaseResult],
    tables: "Mapping[str, pd.DataFrame]",
    components: Iterable[Component],
    experiment: Experiment,
) -> dict[str, Figure]:
    """gain_<component> and sigma_<component> of every component; each with the cases that the config names for it."""
    curves, gains = (common.groups(tables[name], "case", "filter", "component") for name in ("curves", "gains"))
    made = {}
    for of in components:
        for kind, draw, rows in (
            ("gain", gain_figure, gains),
            ("sigma", sigma_figure, curves),
            ("dynamic", dynamic_figure, curves),
        ):
            name = f"{kind}_{of.name}"
            some, left = shown_families(results, named(experiment, name))
            figure = draw(name, some, rows, of) if some else None
            if figure and any(isinstance(mark, Line) for panel in figure.panels for mark in panel.marks):
                if kind == "sigma" and len(results) == 1:
                    figure = floored(figure, tables.get("floor"), of.name)
                made[name] = replace(figure, caption=figure.caption + left)
    return made


def dynamic_figure(name: str, results: Sequence[CaseResult], curves: Mapping, of: Component) -> Figure | None:
    """Dynamic error (bias) and fluctuation error (spread) of one component, a panel for each case that has both. None
    where no case's bias exceeds its spread anywhere: then σ suffices."""
    drawn: list[Panel] = []
    for result in results:
        found = [
            (f, curves[(result.name, f, of.name)]) for f in result.axes.filters if (result.name, f, of.name) in curves
        ]
        if any((abs(rows["bias"]) > rows["spread"]).any() for _, rows in found):
            panel = _dynamic_panel(result, found, of)
            drawn.append(replace(panel, keys=()) if drawn else panel)
    if not drawn:
        return None
    caption = tr(
        "Errors of the {quantity} in cases with a mean error above the spread at some time: mean error "
        "(dynamic, bias) and standard deviation (fluctuation, spread) of {realisations}; σ² is the sum "
        "of their squares.",
        quantity=of.words,
        realisations=realisations(results),
    )
    titles = [panel.title for panel in drawn]
    caption += left_out(titles, spread_out(titles, MOST_PANELS))
    title = tr("Dynamic and fluctuation error of the {quantity}", quantity=of.words)
    figure = in_columns(Figure(name, title, caption, tuple(spread_out(drawn, MOST_PANELS))))
    return figure


def _dynamic_panel(result: CaseResult, found: Sequence[tuple], of: Component) -> Panel:
    marks: list[Mark] = [Reference(0)]
    for n, (f, rows) in enumerate(found):
        t = rows["t_s"].to_numpy()
        bias, half = rows["bias"].to_numpy(), Z95 * rows["bias_se"].to_numpy()
        name = literal(f)
        marks.append(Line(t, bias, "", Style(n, 0, n), bias - half, bias + half, name=tr("{name}: bias", name=name)))
        marks.append(Line(t, rows["spread"].to_numpy(), "", Style(n, 1, n), name=tr("{name}: spread", name=name)))
    keys = [(literal(f), Style(n, None, n)) for n, (f, _) in enumerate(found)]
    keys += [(tr("bias"), Style(0, 0)), (tr("spread"), Style(0, 1))]
    title = swept(result) or device(result)
    y = Axis(with_unit(tr("error of {symbol}", symbol=of.symbol), of.unit))
    return Panel(time_axis(), y, tuple(marks), title, tuple(keys))
