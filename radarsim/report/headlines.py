"""The words over each figure: the sentence of the answer that is about what it draws, else its title."""

import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from radarsim.language.numerals import numeral
from radarsim.language.translate import Term, inflect
from radarsim.report import wording
from radarsim.report.drawing.model import Bars, Figure, Heat, Line, Mark
from radarsim.report.exact_marks import MARK, without_marks
from radarsim.report.math_text import plain_text
from radarsim.report.quantities import Component

DIGITS = r"[−-]?\d[\d\u202f\u00a0]*(?:[.,]\d+)*"
POWER = r"(?:·10(?P<power>[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+))?"
SUPERSCRIPTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
ROUNDING = 1e-9
MAX_LETTERS = 200  # of a headline
COMPONENT_KINDS = "sigma", "gain", "dynamic"  # of figures whose names end with that of their component
FORMS = "", "genitive"  # of a component's words in sentences
QUOTED_NAME = re.compile("“[^”]*”|«[^»]*»")
STRONG_PT, THIN_PT = 2.0, 0.8  # widths of lines that the headline names, and of others


def with_headlines(
    figures_by_name: Mapping[str, Figure],
    answer: Sequence[str],
    sources_of_answer: Sequence[Collection[str]],
    sources_by_figure: Mapping[str, Collection[str]],
    single_cases: Collection[str] = (),
    swept_keys: Mapping[str, Collection[str]] | None = None,
    components: Sequence[Component] = (),
) -> dict[str, Figure]:
    """The figures with a headline each.

    sources_of_answer: tables that each sentence of the answer rests on, or a table's column, "folds.right";
    sources_by_figure: those that are drawn; single_cases: how sentences on one of several cases begin, which none of
    these figures is about; swept_keys: as figures name them, with their values in unswept cases, which a figure that
    lacks the key draws; components: of the study, whose names end those of figures."""

    def headline(name: str, figure: Figure) -> str:
        values = drawn_values(figure)
        words = _words_of(figure)
        foreign_keys = {key: values for key, values in (swept_keys or {}).items() if key not in words}
        titles = {part for panel in figure.panels for part in plain_text(panel.title).split(", ")}
        kind, _, component = name.partition("_")
        is_of_component = kind in COMPONENT_KINDS and any(component == other.name for other in components)
        for sentence, sources in zip(answer, sources_of_answer, strict=True):
            text = first_statement(sentence)
            is_on_one_case = any(case in text.partition(":")[0] for case in single_cases)
            is_elsewhere = is_on_one_case or any(
                _values_of_key(text, key) - titles - set(values) for key, values in foreign_keys.items()
            )
            is_on_other_component = is_of_component and first_component(text, components) != component
            if is_elsewhere or is_on_other_component or len(without_marks(text)) > MAX_LETTERS:
                continue
            if _are_sources(sources, sources_by_figure[name]) and is_drawn(text, values):
                return without_marks(text)
        return plain_text(figure.title)

    return {name: emphasised(figure, headline(name, figure)) for name, figure in figures_by_name.items()}


def _values_of_key(sentence: str, key: str) -> set[str]:
    """The values of a swept key that a sentence gives; titles of panels may have them without the key."""
    return set(re.findall(rf"{re.escape(key)} = ([^,;:()]+?)(?=[,;:()]|\.?$)", without_marks(sentence)))


def emphasised(figure: Figure, headline: str) -> Figure:
    """The figure under its headline, with strong lines for the filters that the headline names, thin ones for others.

    Unchanged but for the headline if that names none of its lines, or all."""
    names = {_line_name(mark) for panel in figure.panels for mark in panel.marks if _is_curve(mark)} - {""}
    strong = _named_lines(headline, names)
    figure = replace(figure, headline=headline)
    if not strong or strong == names:
        return figure

    def weigh(mark: Mark) -> Mark:
        if not (isinstance(mark, Line) and _line_name(mark) in names):
            return mark
        width_pt = STRONG_PT if _line_name(mark) in strong else THIN_PT
        return replace(mark, style=replace(mark.style, width_pt=width_pt))

    panels = (replace(panel, marks=tuple(map(weigh, panel.marks))) for panel in figure.panels)
    return replace(figure, panels=tuple(panels))


def _is_curve(mark: Mark) -> bool:
    """Whether a mark is a curve of one of several filters."""
    return isinstance(mark, Line) and mark.style.dash is not None and isinstance(mark.style.colour, int)


def _line_name(mark: Mark) -> str:
    return plain_text(mark.label or mark.name) if isinstance(mark, Line) and _is_curve(mark) else ""


def _named_lines(headline: str, names: Collection[str]) -> set[str]:
    """The names of lines that a sentence names, joined ones too; a letter alone may be a quantity."""
    lines = {part: name for name in names for part in name.split(" = ") if len(part) > 1}
    found = set()
    for part in sorted(lines, key=len, reverse=True):  # a longer name may hold a shorter one
        headline, count = re.subn(rf"(?<![\w+]){re.escape(part)}(?![\w+])", "", headline)
        if count:
            found.add(lines[part])
    return found


def _words_of(figure: Figure) -> str:
    """The titles of a figure, its axes and the names of its lines: they name the keys that differ within it."""
    texts = [
        text
        for panel in figure.panels
        for text in (
            *(panel.title, panel.x.label, panel.y.label, panel.key_title),
            *(name for name, _ in panel.keys),
            *(text for mark in panel.marks for text in (getattr(mark, "label", ""), getattr(mark, "name", ""))),
        )
    ]
    return plain_text("\n".join([figure.title, *texts]))


def first_component(sentence: str, components: Sequence[Component]) -> str:
    """The name of the component that a sentence names first, outside quoted names; empty if it names none."""
    names = {words.lower(): part.name for part in components if part.words for words in _word_forms(part.words)}
    longest_first = sorted(names, key=len, reverse=True)
    pattern = "|".join(rf"\b{re.escape(words)}\b" for words in longest_first)
    match = re.search(pattern, QUOTED_NAME.sub("", sentence.lower())) if names else None
    return names[match[0]] if match else ""


def _word_forms(words: str) -> list[str]:
    """The forms of a component's words in sentences; a user's have one."""
    return [inflect(words, form) for form in FORMS] if isinstance(words, Term) else [words]


def _are_sources(sources: Collection[str], drawn: Collection[str]) -> bool:
    """Whether a sentence rests on what a figure draws; on every table of a figure that draws several."""
    tables = {source.partition(".")[0] for source in drawn}
    is_complete = len(tables) < 2 or tables <= {source.partition(".")[0] for source in sources}
    return is_complete and all(_is_source(source, drawn) for source in sources)


def _is_source(source: str, drawn: Collection[str]) -> bool:
    """Whether a figure draws a table, or a column of it, unless it is known to draw another one."""
    table = source.partition(".")[0]
    return bool({source, table} & {*drawn}) or (source == table and any(d.startswith(f"{table}.") for d in drawn))


def first_statement(sentence: str) -> str:
    """A sentence up to its first semicolon, unless that separates the items of a list, each after a colon."""
    clause, *others = wording.split_clauses(sentence)
    return sentence if clause.count(": ") > 1 or not others else f"{clause}."


class DrawnColumn(NamedTuple):
    """Finite values (n,) of a figure, the label of their axis, and whether it is one of losses."""

    label: str
    values: np.ndarray
    is_of_losses: bool


def drawn_values(figure: Figure) -> list[DrawnColumn]:
    """All values that a figure draws, exact ones too."""
    columns = [
        (mark.label if isinstance(mark, Heat) else panel.y.label, np.ravel(np.asarray(column, float)), panel)
        for panel in figure.panels
        for mark in panel.marks
        for column in _columns(mark)
    ]
    return [
        DrawnColumn(plain_text(label), values[np.isfinite(values)], panel.y.scale == "log")
        for label, values, panel in columns
    ]


def _columns(mark: Mark) -> Iterable[np.ndarray]:
    if isinstance(mark, Line):
        return [column for column in (mark.y, mark.exact) if column is not None]
    return [mark.values] if isinstance(mark, Bars | Heat) else []


def is_drawn(sentence: str, columns: Sequence[DrawnColumn]) -> bool:
    """Whether a sentence has values, exact or with an interval, and all of them are among those of a figure.

    A loss is drawn as a negative gain, a percentage as a share or its complement. Shares of none and of all tell
    nothing of what they are shares of."""
    quoted = quoted_values(sentence)
    is_telling = any(unit != "%" or number not in (0, 100) for number, _, unit in quoted)
    return is_telling and all(any(_is_among(value, column) for column in columns) for value in quoted)


def _is_among(value: tuple[float, float, str], column: DrawnColumn) -> bool:
    number, step, unit = value
    is_share, has_unit = unit == "%" and ", " not in column.label, ", " in column.label
    if not column.values.size or (not is_share and (has_unit != bool(unit) or not column.label.endswith(unit))):
        return False
    if is_share and np.abs(column.values).max() > 1:
        return False
    scale = 0.01 if is_share else 1.0
    candidates = 1 - column.values if is_share and column.is_of_losses else np.abs(column.values)
    nearest = np.abs(candidates - abs(number) * scale).min()
    return bool(nearest <= scale * step / 2 * (1 + ROUNDING) + ROUNDING * abs(number))


def quoted_values(sentence: str) -> list[tuple[float, float, str]]:
    """The values that a sentence quotes, each with the step of its last digit and its unit."""
    marked = re.compile(
        rf"(?P<digits>{DIGITS}){POWER}(?P<unit>(?:[ \u00a0]|(?=°))[^\s\[({MARK}]+)?(?:[ \u00a0]\[|{MARK})"
    )
    return [(*_parsed(match), (match["unit"] or "").strip()) for match in marked.finditer(sentence)]


def _parsed(match: re.Match[str]) -> tuple[float, float]:
    """A number and the step of its last digit."""
    point, thousands = numeral("."), numeral(",")
    digits = match["digits"].replace(thousands, "").replace(point, ".").replace("−", "-")
    power = int(match["power"].translate(SUPERSCRIPTS)) if match["power"] else 0
    decimals = len(digits.partition(".")[2])
    return float(digits) * 10.0**power, math.pow(10.0, power - decimals)
