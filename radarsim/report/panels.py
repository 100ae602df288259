"""Figures that all studies share, and what their figures are made of: names of keys, lines, panels, captions."""

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
MAX_MISSING_NAMES = 8  # names of what a figure leaves out
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
    if isinstance(value, list | tuple) and all(isinstance(item, int | float) for item in value):
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
    same_kind = [item for item in among if isinstance(item, Mapping) and item.get("kind") == value["kind"]]
    differing = {name: item for name, item in value.items() if any(other.get(name) != item for other in same_kind)}
    return in_words(result, key, {"kind": value["kind"], **differing})


def in_words(result: CaseResult, key: str, value: Mapping) -> str:
    """A mapping that is a key's value: its kind, and each of its keys by name, with value and unit."""
    kind = [number(value["kind"])] if "kind" in value else []
    keys = [f"{key}.{name}" for name in value if name != "kind"]
    items = zip(keys, (item for name, item in value.items() if name != "kind"), strict=True)
    return ", ".join(
        [*kind, *(f"{key_label(result, name).text} {with_its_unit(result, name, item)}" for name, item in items)]
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
    pairs = [(key, value) for key, value in result.swept if key not in set(without)]
    return ", ".join(f"{symbol_of(result, key)} = {with_its_unit(result, key, value)}" for key, value in pairs)


def shared_keys(results: Sequence[CaseResult]) -> set[str]:
    """The swept keys that have one value in all of several cases."""
    values = [dict(result.swept) for result in results]
    if len(values) < 2:
        return set()
    return {key for key, value in values[0].items() if all(case_values.get(key) == value for case_values in values)}


def with_its_unit(result: CaseResult, key: str, value: object) -> str:
    """A value of a key with the key's unit, except a unit that would need brackets."""
    if isinstance(value, Mapping):
        return in_words(result, key, value)
    if isinstance(value, list | tuple):
        return " ".join(filter(None, (number(value), unit_of(key_label(result, key).unit))))
    if not isinstance(value, int | float) or isinstance(value, bool):
        return number(value)
    factor, unit_name = in_degrees(key_label(result, key).unit)
    text = number(value, is_power(key)) if factor == 1.0 else turned_number(factor * value)
    unit_text = unit_of(unit_name)
    if unit_text.startswith("°"):
        return f"{text}{unit_text}"
    return " ".join(filter(None, (text, unit_text.partition("(")[0])))


def turned_number(degrees: float) -> str:
    """An angle that was given in radians, at few digits: 1° of 0.01745 rad."""
    return wording.number(float(f"{degrees:.{FEW_DIGITS}g}"), FEW_DIGITS)


def key_label(result: CaseResult, key: str) -> Label:
    """The name of a key of a case, in the current language; its unit as in tables."""
    key_text = label_of(result.spec, key)
    return key_text._replace(text=tr(key_text.text))


def unit_of(name: str) -> str:
    """A unit as people write it, in the current language."""
    return tr(wording.unit(name))


def is_power(key: str) -> bool:
    """Whether values of a key are written as powers of ten."""
    return key.rpartition(".")[2] in POWERS


def symbol_of(result: CaseResult, key: str) -> str:
    """The short name of a key of a case in figures: its letter if it has one (mathematical text), else its name."""
    key_text = key_label(result, key)
    return mathematical(key_text.symbol) if key_text.symbol else key_text.text


def axis_of(result: CaseResult, key: str) -> str:
    """The label of a key's axis: name, letter, unit; values on it are times `axis_factor`."""
    key_text = key_label(result, key)
    return with_unit(
        " ".join(filter(None, (key_text.text, mathematical(key_text.symbol)))), in_degrees(key_text.unit)[1]
    )


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
    match = re.fullmatch(r"([vVa]?)([a-z])", component)
    if not match:
        return literal(component)
    base = GREEK.get(match[2], match[2])
    return f"${match[1]}_{base}$" if match[1] else f"${base}$"


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


def in_legend(panels: Sequence[Panel]) -> list[Panel]:
    """Panels of many lines with one legend in a cell of its own, with names from the lines."""
    keys = {mark.label: mark.style for panel in panels for mark in panel.marks if isinstance(mark, Line) and mark.label}
    blank = [
        replace(
            panel,
            marks=tuple(
                replace(m, label="", name=m.name or m.label) if isinstance(m, Line) else m for m in panel.marks
            ),
        )
        for panel in panels
    ]
    return [*blank, Panel(panels[0].x, panels[0].y, (), keys=tuple(keys.items()))]


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
    groups: dict[str, list[CaseResult]] = {}
    for result in results:
        groups.setdefault(stem(result), []).append(result)
    return groups


def by_panel(results: Sequence[CaseResult], max_lines: float = MOST_LINES) -> dict[str, list[CaseResult]]:
    """Group the cases that share a panel, by the panel's title.

    A panel holds the cases of one config; where several keys are swept, those alike in all but the last. Cases with
    many filters get a panel each if together they would draw more than `max_lines` lines."""
    has_several_families = len(families(results)) > 1
    groups: dict[tuple[str, str, str], list[CaseResult]] = {}
    for result in results:
        swept_text = ", ".join(
            f"{symbol_of(result, key)} = {with_its_unit(result, key, value)}" for key, value in result.swept[:-1]
        )
        device_name = device(result) if has_several_families or not swept_text else ""
        groups.setdefault((stem(result), device_name, swept_text), []).append(result)

    titled: list[tuple[str, list[CaseResult]]] = []
    for (_, *title_parts), members in groups.items():
        line_counts = [len(result.axes.filters) for result in members]
        if sum(line_counts) <= max_lines or max(line_counts) <= FEW_FILTERS or len(members) == 1:
            titled.append((", ".join(filter(None, title_parts)), members))
        else:
            prefix = [device(members[0])] if has_several_families else []
            titled += [(", ".join([*prefix, swept(result) or result.name]), [result]) for result in members]
    titles_and_stems = [(title, stem(members[0])) for title, members in titled]
    return distinct(titles_and_stems, [members for _, members in titled])


def distinct(titles: Sequence[tuple[str, str]], values: Sequence[Any]) -> dict[str, Any]:
    """Values by their titles; by config and title, the second of each pair first, where a title occurs twice."""
    often = Counter(title for title, _ in titles)
    names = [title if often[title] == 1 else ", ".join(filter(None, (config, title))) for title, config in titles]
    return dict(zip(names, values, strict=True))


def spread_out(items: Sequence[Any], max_count: int) -> list[Any]:
    """At most so many of the items, evenly spaced from the first to the last."""
    if len(items) <= max_count:
        return list(items)
    return [items[i] for i in np.linspace(0, len(items) - 1, max_count).round().astype(int)]


def realisations(results: Sequence[CaseResult]) -> str:
    """The number of realisations of a figure: "100,000 to 200,000 realisations" where its cases differ."""
    return _of_realisations([result.count for result in results])


def _of_realisations(counts: Sequence[int]) -> str:
    smallest, largest = min(counts), max(counts)
    if smallest == largest:
        return plural("{count:,} realisation", "{count:,} realisations", largest)
    return plural("{least:,} to {count:,} realisations", "{least:,} to {count:,} realisations", largest, least=smallest)


def left_out(all_names: Sequence[str], shown_names: Sequence[str]) -> str:
    """Words on the omissions of a figure, after its caption: how many of how many it shows, and which are missing."""
    missing = [name for name in all_names if name not in shown_names]
    if not missing:
        return ""
    fields = {
        "count": len(all_names) - len(missing),
        "all": len(all_names),
        "names": seen.join_names(map(plain, missing), MAX_MISSING_NAMES),
    }
    return " " + tr("Shown: {count} of {all}; only in the tables: {names}.", **fields)


def names_of(results: Sequence[CaseResult]) -> list[str]:
    """Distinct names of cases: by swept values, with the device where there are several."""
    has_several_devices = len(families(results)) > 1
    names = [
        plain_label(result) if has_several_devices or not result.swept else plain(swept(result)) for result in results
    ]
    return names if len(set(names)) == len(names) else [result.name for result in results]


def cases_left_out(all_results: Sequence[CaseResult], shown_results: Sequence[CaseResult]) -> str:
    """`left_out` of cases."""
    names = dict(zip((result.name for result in all_results), names_of(all_results), strict=True))
    return left_out(list(names.values()), [names[result.name] for result in shown_results])


def unswept(results: Sequence[CaseResult]) -> list[CaseResult]:
    """The cases without swept keys, if any; else all."""
    return [result for result in results if not result.swept] or list(results)


def named(experiment: Experiment, figure: str) -> list[str]:
    """The cases that a config names for a figure."""
    return [case.name for case in experiment.shown_in(figure)]


def shown(results: Sequence[CaseResult], names: Sequence[str]) -> tuple[list[CaseResult], str]:
    """The results in a figure, of the cases named, at most eight evenly spaced; and words on the others."""
    named_results = [result for result in results if result.name in set(names)]
    visible = spread_out(named_results, MOST)
    return visible, cases_left_out(named_results, visible)


def shown_families(results: Sequence[CaseResult], names: Sequence[str]) -> tuple[list[CaseResult], str]:
    """The results of a figure with a panel for each of `by_panel`: at most twelve panels of at most eight cases. If
    more, evenly spaced ones from the first to the last."""
    named_results = [result for result in results if result.name in set(names)]
    groups = spread_out(list(by_panel(named_results).values()), MOST_PANELS)
    visible = [result for members in groups for result in spread_out(members, MOST)]
    return visible, cases_left_out(named_results, visible)


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
    """The figure with lines that coincide in all its panels drawn once, their names joined by "=".

    Lines that have a name of their own, in a legend or at their ends; not those that dash and shade distinguish."""
    named_lines = [
        {name: mark for mark in panel.marks if (name := _curve_name(mark, figure))} for panel in figure.panels
    ]
    groups: dict[str, list[str]] = {}
    for name in dict.fromkeys(name for lines in named_lines for name in lines):
        first = next((first for first in groups if _coincide(first, name, named_lines, figure)), name)
        groups.setdefault(first, []).append(name)
    duplicates = {name for names in groups.values() for name in names[1:]}
    if not duplicates:
        return figure
    joined_names = {first: _joined_name(names) for first, names in groups.items()}

    def rename(mark: Mark) -> Mark:
        name = _curve_name(mark, figure)
        if not (name and isinstance(mark, Line)):
            return mark
        return replace(mark, label=mark.label and joined_names[name], name=mark.name and joined_names[name])

    panels = tuple(
        replace(
            panel,
            marks=tuple(rename(mark) for mark in panel.marks if _curve_name(mark, figure) not in duplicates),
            keys=tuple((joined_names.get(key, key), style) for key, style in panel.keys if key not in duplicates),
        )
        for panel in figure.panels
    )
    remark = tr("Curves that coincide are drawn once, with both names.")
    return replace(figure, panels=panels, caption=f"{figure.caption} {remark}")


def _joined_name(names: Sequence[str]) -> str:
    """Names of one curve: "nearest = PDA"; a swept value that they share once, at the end."""
    heads, tails = zip(*((head, tail) for head, _, tail in (name.partition(", ") for name in names)), strict=True)
    if len(set(tails)) == 1 and "=" in tails[0]:
        return f"{' = '.join(heads)}, {tails[0]}"
    return " = ".join(names)


def _curve_name(mark: Mark, figure: Figure) -> str:
    """The name of a curve that has one of its own, at its end or in a legend; empty for any other mark."""
    if not isinstance(mark, Line) or mark.style.dash is None or len(mark.x) < 2:
        return ""
    if mark.label:
        return mark.label if mark.name in ("", mark.label) else ""
    return mark.name if any(mark.name == key for panel in figure.panels for key, _ in panel.keys) else ""


def _coincide(name: str, other_name: str, named_lines: Sequence[Mapping[str, Mark]], figure: Figure) -> bool:
    """Whether two curves cannot be distinguished in any panel where they are drawn."""
    is_drawn = False
    for marks, panel in zip(named_lines, figure.panels, strict=True):
        line, other = marks.get(name), marks.get(other_name)
        if line is None and other is None:
            continue
        if not (isinstance(line, Line) and isinstance(other, Line)) or not np.array_equal(line.x, other.x):
            return False
        is_log = panel.y.scale == "log"
        visible = [mark for mark in marks.values() if isinstance(mark, Line) and _has_points(mark, is_log)]
        if not visible:
            continue
        is_drawn |= _has_points(line, is_log)
        low, high = _holding(visible, panel.y)
        height = np.log10(high) - np.log10(low) if is_log else high - low
        pairs = ((line.y, other.y), (line.lo, other.lo), (line.hi, other.hi), (line.exact, other.exact))
        if not all(_values_coincide(*pair, height, is_log) for pair in pairs):
            return False
    return is_drawn


def _has_points(line: Line, is_log: bool) -> bool:
    return bool((line.y > 0 if is_log else np.isfinite(line.y)).any())


def _values_coincide(values: np.ndarray | None, others: np.ndarray | None, height: float, is_log: bool) -> bool:
    """Whether two columns of a curve are nearer to each other than half a line's width, and than a per cent.

    height: of the panel, in units of the axis, or of its logarithm"""
    if values is None or others is None:
        return values is others
    with np.errstate(divide="ignore", invalid="ignore"):
        ours, theirs = (np.log10(column) if is_log else np.asarray(column, float) for column in (values, others))
        tolerance = np.log10(1 + SAME) if is_log else SAME * np.abs(ours) + SAME * LINE * height
        is_near = np.abs(ours - theirs) <= np.minimum(LINE * height, tolerance)
    return bool((is_near | (ours == theirs) | (np.isnan(ours) & np.isnan(theirs))).all())


def ever_lost(lines: Sequence[Line]) -> tuple[tuple[Line, ...], str]:
    """The complements of shares that have a loss, and words on zeros, which a logarithmic axis lacks, for a caption."""
    losses = tuple(map(lost, lines))
    visible = tuple(line for line in losses if (line.y > 0).any())
    names = [plain(line.name or line.label) for line in losses if not (line.y > 0).any()]
    remark = (
        " " + tr("Zero throughout, so not drawn: {names}.", names=seen.join_names(names, MAX_MISSING_NAMES))
        if names
        else ""
    )
    if any((line.y == 0).any() for line in visible):
        remark += " " + tr("A zero has no point on this axis.")
    return visible, remark


def shared(panels: Sequence[Panel]) -> list[Panel]:
    """Panels of lines side by side: those of one quantity share the axis of y that holds all."""
    filled = [panel for panel in panels if panel.marks]
    lines = [mark for panel in filled for mark in panel.marks if isinstance(mark, Line)]
    if len(filled) < 2 or len({panel.y.label for panel in filled}) > 1 or not lines or any(p.y.ticks for p in filled):
        return list(panels)
    limited = [panel.y for panel in filled if None not in panel.y.limits]
    logarithmic = [panel.y for panel in filled if panel.y.scale == "log"]
    first_axis = filled[0].y
    y = (
        limited
        or logarithmic
        or [fitting_axis(first_axis.label, lines) if first_axis.limits == (0, None) else first_axis]
    )[0]
    if not limited:
        y = replace(y, limits=_holding(lines, y))
    return [replace(panel, y=y) for panel in panels]


def _holding(lines: Sequence[Line], y: Axis) -> tuple[float, float]:
    """Limits that hold all lines, and their bands except bounds far beyond them."""
    values = _finite_values(y, [column for line in lines for column in (line.y, line.exact)])
    bands = _finite_values(y, [column for line in lines for column in (line.lo, line.hi)])
    lowest, highest = bands.min(initial=values.min()), bands.max(initial=values.max())
    if y.scale == "log":
        low = float(max(values.min() / WIDEST_BAND, lowest)) / LOG_MARGIN
        high = float(min(values.max() * WIDEST_BAND, highest)) * LOG_MARGIN
        return y.limits[0] or low, high
    span = float(values.max() - values.min()) or 1.0
    low = float(max(values.min() - span, lowest)) - MARGIN * span
    high = float(min(values.max() + span, highest)) + MARGIN * span
    return low if y.limits[0] is None else y.limits[0], high


def _finite_values(y: Axis, columns: Sequence[np.ndarray | None]) -> np.ndarray:
    """The values of the columns that are known and that the axis can show."""
    values = np.concatenate([np.zeros(0), *(np.asarray(column, float) for column in columns if column is not None)])
    return values[np.isfinite(values) & (values > 0 if y.scale == "log" else True)]


def sigma_figure(name: str, results: Sequence[CaseResult], curves: Mapping, component: Component) -> Figure:
    """σ(t) of one component: a panel for each config, a line for each filter and swept value.

    curves is tables.groups(table, "case", "filter", "component")."""
    groups = by_panel(results)
    filters = filters_of(results)
    panels = [_sigma_panel(title, members, curves, component, filters) for title, members in groups.items()]
    panels = [panel for panel in panels if panel.marks]
    caption = tr(
        "Root-mean-square error of the {quantity} about the truth against time, of {realisations}. "
        "Bands: 95 % intervals; a band that is not visible is narrower than the line.",
        quantity=component.words,
        realisations=realisations(results),
    )
    title = tr("σ of the {quantity}", quantity=component.words)
    figure = in_columns(Figure(name, title, caption, tuple(panels)))
    return figure


def floored(figure: Figure, curves: "pd.DataFrame", component: str, factor: float = 1.0) -> Figure:
    """A figure of σ of one case, of few lines, with its floor. Of filters that have other plots it is that of those
    with the most."""
    rows = curves[curves["component"].eq(component) & curves["floor"].notna()] if "floor" in curves else curves[:0]
    if not len(rows) or len(figure.panels) != 1 or len(figure.panels[0].marks) > MOST_AT_ENDS:
        return figure
    lowest = factor * rows.groupby("t_s", sort=True)["floor"].min()
    (panel,) = figure.panels
    line = Line(lowest.index.to_numpy(), lowest.to_numpy(), tr("floor"), GUIDE)
    panel = replace(panel, marks=(*panel.marks, line))
    posterior = rows["floor_kind"].str.startswith("posterior").all()
    remark = tr("Grey: the floor, a posterior Cramér-Rao bound.") if posterior else tr(UNDER_UNBIASED)
    return replace(figure, panels=(panel,), caption=f"{figure.caption} {remark}")


UNDER_UNBIASED = term("Grey: the floor, a Cramér-Rao bound of unbiased estimators.")
GUIDE = Style(GREY, 0, width_pt=0.8)


def in_columns(figure: Figure) -> Figure:
    """A figure with as many columns as its panels fill, at one of the widths of a page."""
    count = len([panel for panel in figure.panels if panel.marks])
    panels = tuple(shared(figure.panels))
    axes = {(panel.y.label, panel.y.scale, panel.y.limits, panel.y.ticks) for panel in panels if panel.marks}
    figure = replace(figure, panels=panels, share_y=count > 1 and len(axes) == 1)
    if count == 1:
        wide = figure.panels[0].legend == "right"
        return replace(figure, columns=1, width_mm=WIDE_MM if wide else COLUMN_MM, panel_height_mm=64.0)
    return replace(figure, columns=2 if count in (2, 4) else 3, width_mm=PAGE_MM, panel_height_mm=56.0)


def _sigma_panel(
    title: str, members: Sequence[CaseResult], curves: Mapping, component: Component, filters: Sequence[str]
) -> Panel:
    marks = lines_of(members, curves, component.name, SIGMA, filters)
    y = fitting_axis(sigma_of(component.symbol, component.unit), marks)
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
            case_rows = rows.get((result.name, f, component))
            if case_rows is None:
                continue
            style = look(filters.index(f), i, len(members))
            if len(members) == 1:
                marks.append(line(case_rows, columns, literal(f), style, literal(f)))
            else:
                key, value = result.swept[-1] if result.swept else ("", device(result))
                values = [dict(one.swept).get(key) for one in members]
                text = _shown_value(result, key, in_short(result, key, value, values)) if key else number(value)
                marks.append(line(case_rows, columns, text, style, f"{literal(f)}, {swept(result)}"))
    return marks


def _shown_value(result: CaseResult, key: str, value: object) -> str:
    """A value of a key without its unit, as on its axis."""
    factor = axis_factor(result, key)
    is_turned = factor != 1.0 and isinstance(value, int | float) and not isinstance(value, bool)
    return turned_number(factor * float(str(value))) if is_turned else number(value, is_power(key))


def family_panel(title: str, members: Sequence[CaseResult], rows: Mapping, label: str, filters: Sequence[str]) -> Panel:
    """A panel of any quantity of the members about one; rows by case, filter and its column, against t_s."""
    column = next(key[2] for key in rows)
    marks = lines_of(members, rows, column, ("t_s", column), filters)
    return keyed(Panel(time_axis(), fitting_axis(label, marks), (Reference(1), *marks), title), members, filters)


NEES = term("NEES per component\n(1 = consistent, below = pessimistic)")


def consistency(results: Sequence[CaseResult], table: "pd.DataFrame", experiment: Experiment) -> dict[str, Figure]:
    """The figure `consistency` of a table with NEES by case, filter and time, a panel for each config."""
    rows = {(*key, "nees"): filter_rows for key, filter_rows in common.groups(table, "case", "filter").items()}
    visible, left_out = shown_families(results, named(experiment, "consistency"))
    return {"consistency": nees_figure(nees_panels(visible, rows), left_out)}


def nees_panels(results: Sequence[CaseResult], rows: Mapping) -> list[Panel]:
    """NEES against time, a panel for each config; rows by case, filter and `nees`."""
    filters = filters_of(results)
    panels = [family_panel(title, members, rows, tr(NEES), filters) for title, members in by_panel(results).items()]
    return [panel for panel in panels if len(panel.marks) > 1]


def nees_figure(panels: Sequence[Panel], left_out: str) -> Figure:
    """The figure `consistency` of such panels; its caption names the panels left out."""
    caption = tr(
        "Mean of the normalised squared error eᵀP⁻¹e per estimated component, with the filter's own "
        "covariance P: one (dotted) for a consistent filter, more for an optimistic one, less for a "
        "pessimistic one."
    )
    title = tr("Consistency of the filters")
    return in_columns(Figure("consistency", title, caption + left_out, tuple(panels)))


def keyed(panel: Panel, members: Sequence[CaseResult], filters: Sequence[str], baseline: bool = True) -> Panel:
    """A panel whose legend explains dashes by filter and colours by swept value; few lines are named at their ends.

    filters as for `lines_of`; baseline: whether to draw the baseline filter."""
    if len(members) == 1:
        return panel
    visible_filters = {
        f for result in members for n, f in enumerate(result.axes.filters) if baseline or n != result.axes.baseline
    }
    dashes = tuple((literal(f), Style(0, n, n)) for n, f in enumerate(filters) if f in visible_filters)
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


def gain_figure(name: str, results: Sequence[CaseResult], gains: Mapping, component: Component) -> Figure:
    """Relative gain of one component against time, a line for each case and filter.

    One panel where no config is swept; else one for each of `by_panel`. gains is tables.groups(table, "case", "filter",
    "component")."""
    caption = tr(
        "Relative gain in σ of the {quantity} against filter {base}, paired on common noise, of {realisations}. "
        "Bands: 95 % intervals. Below zero: a loss.",
        quantity=component.words,
        base=results[0].axes.filters[results[0].axes.baseline],
        realisations=realisations(results),
    )
    y = Axis(tr("gain in $\\sigma$ of {symbol}, %", symbol=component.symbol))
    title = tr("Gain in σ of the {quantity}", quantity=component.words)
    has_several_gains = any(len(result.axes.filters) > 2 for result in results)
    if any(result.swept for result in results) or (has_several_gains and len(results) > 1):
        panels, filters = [], filters_of(results)
        for panel_title, members in by_panel(results).items():
            if lines := lines_of(members, gains, component.name, GAIN, filters):
                panel = Panel(time_axis(), *_cut(y, lines), panel_title)
                panels.append(keyed(panel, members, filters, baseline=False))
        return _with_remark_on_losses(in_columns(Figure(name, title, caption, tuple(panels))))
    marks = _gain_lines(results, gains, component, has_several_gains)
    # Many long names would cover the lines: the legend is beside the panel.
    has_long_names = any(isinstance(mark, Line) and len(mark.label) > LONGEST_INSIDE for mark in marks)
    is_beside = len(marks) > 3 and has_long_names
    panel = Panel(time_axis(), *_cut(y, marks), direct=not is_beside, legend="right" if is_beside else "best")
    width = PAGE_MM if is_beside else COLUMN_MM if len(results) < 3 else WIDE_MM
    return _with_remark_on_losses(Figure(name, title, caption, (panel,), width_mm=width))


def _gain_lines(
    results: Sequence[CaseResult], gains: Mapping, component: Component, has_several_gains: bool
) -> list[Mark]:
    """The lines of a single panel of gains, named by case and filter as far as these differ."""
    marks: list[Mark] = []
    for i, result in enumerate(results):
        for n, filter_name in enumerate(result.axes.filters):
            rows = gains.get((result.name, filter_name, component.name))
            if rows is not None:
                case = label(result) if len(results) > 1 else ""
                own_name = literal(filter_name) if has_several_gains or len(results) == 1 else ""
                text = ", ".join(filter(None, (case, own_name)))
                look_number = n if has_several_gains else i
                style = Style(i if len(results) > 1 else n, look_number, look_number)
                marks.append(line(rows, GAIN, text, style, text))
    return marks


def _with_remark_on_losses(figure: Figure) -> Figure:
    """A figure of gains, with a remark in its caption where losses are cut."""
    if not any(panel.y.limits[0] == -LOSS for panel in figure.panels):
        return figure
    names = seen.lines_below(figure, -LOSS)
    remark = tr("Losses of over {loss:g} % lie below the axis: {names}.", loss=LOSS, names=names)
    return replace(figure, caption=f"{figure.caption} {remark}")


def _cut(y: Axis, lines: Sequence[Mark]) -> tuple[Axis, tuple[Mark, ...]]:
    """The axis of gains and its marks: losses far beyond 100 % would hide everything else, and are cut."""
    values = [mark.y[np.isfinite(mark.y)] for mark in lines if isinstance(mark, Line)]
    lowest = min((float(column.min()) for column in values if column.size), default=0.0)
    return replace(y, limits=(-LOSS, 100.0)) if lowest < -2 * LOSS else y, (Reference(0), *lines)


def per_component(
    results: Sequence[CaseResult],
    tables: "Mapping[str, pd.DataFrame]",
    components: Iterable[Component],
    experiment: Experiment,
) -> dict[str, Figure]:
    """gain_<component> and sigma_<component> of every component; each with the cases that the config names for it."""
    curves, gains = (common.groups(tables[name], "case", "filter", "component") for name in ("curves", "gains"))
    figures = {}
    for component in components:
        for kind, draw, rows in (
            ("gain", gain_figure, gains),
            ("sigma", sigma_figure, curves),
            ("dynamic", dynamic_figure, curves),
        ):
            name = f"{kind}_{component.name}"
            visible, remark = shown_families(results, named(experiment, name))
            figure = draw(name, visible, rows, component) if visible else None
            if figure and any(isinstance(mark, Line) for panel in figure.panels for mark in panel.marks):
                if kind == "sigma" and len(results) == 1:
                    figure = floored(figure, tables["curves"], component.name)
                figures[name] = replace(figure, caption=figure.caption + remark)
    return figures


def dynamic_figure(name: str, results: Sequence[CaseResult], curves: Mapping, component: Component) -> Figure | None:
    """Dynamic error (bias) and fluctuation error (spread) of one component, a panel for each case that has both. None
    where no case's bias exceeds its spread anywhere: then σ suffices."""
    panels: list[Panel] = []
    for result in results:
        filter_rows = [
            (f, curves[(result.name, f, component.name)])
            for f in result.axes.filters
            if (result.name, f, component.name) in curves
        ]
        if any((abs(rows["bias"]) > rows["spread"]).any() for _, rows in filter_rows):
            panel = _dynamic_panel(result, filter_rows, component)
            panels.append(replace(panel, keys=()) if panels else panel)
    if not panels:
        return None
    caption = tr(
        "Errors of the {quantity} in cases with a mean error above the spread at some time: mean error "
        "(dynamic, bias) and standard deviation (fluctuation, spread) of {realisations}; σ² is the sum "
        "of their squares.",
        quantity=component.words,
        realisations=realisations(results),
    )
    titles = [panel.title for panel in panels]
    caption += left_out(titles, spread_out(titles, MOST_PANELS))
    title = tr("Dynamic and fluctuation error of the {quantity}", quantity=component.words)
    figure = in_columns(Figure(name, title, caption, tuple(spread_out(panels, MOST_PANELS))))
    return figure


def _dynamic_panel(result: CaseResult, filter_rows: Sequence[tuple], component: Component) -> Panel:
    marks: list[Mark] = [Reference(0)]
    for n, (f, rows) in enumerate(filter_rows):
        t = rows["t_s"].to_numpy()
        bias, half = rows["bias"].to_numpy(), Z95 * rows["bias_se"].to_numpy()
        name = literal(f)
        marks.append(Line(t, bias, "", Style(n, 0, n), bias - half, bias + half, name=tr("{name}: bias", name=name)))
        marks.append(Line(t, rows["spread"].to_numpy(), "", Style(n, 1, n), name=tr("{name}: spread", name=name)))
    keys = [(literal(f), Style(n, None, n)) for n, (f, _) in enumerate(filter_rows)]
    keys += [(tr("bias"), Style(0, 0)), (tr("spread"), Style(0, 1))]
    title = swept(result) or device(result)
    y = Axis(with_unit(tr("error of {symbol}", symbol=component.symbol), component.unit))
    return Panel(time_axis(), y, tuple(marks), title, tuple(keys))
