"""A drawn figure as part of a page: the SVG that Matplotlib made, compact, with the values of its markers as titles.

A browser shows a title when the pointer rests on the marker; a screen reader reads it."""

import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple
from xml.etree import ElementTree

from markupsafe import Markup

from radarsim.language.translate import tr
from radarsim.report.drawing.model import Axis, Figure, Heat, Panel
from radarsim.report.drawing.scales import tick_text
from radarsim.report.math_text import plain_text
from radarsim.report.wording import interval, number

HEADLINE_ID = "headline"  # of the group in the SVG that holds a figure's headline
FORBIDDEN_IN_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")
NAMESPACE = re.compile(r"^\{[^}]*\}")
LONG_DECIMALS = re.compile(r"(\.\d\d)\d+")  # 0.01 point is below what a screen resolves
ROTATION_BY_ZERO = re.compile(r"^rotate\(-?0(?:\.0*)?(?: [^)]*)?\)$")
REFERENCE = re.compile(r"#([^)\"\s;]+)")
POLYLINE = re.compile(r"[MLz0-9. -]*")
CORNER = re.compile(r"([MLz])(?:(-?[0-9.]+) (-?[0-9.]+))?")
MIN_LONG_PATH = 200  # letters, from which a path is written in steps of tenths of a point
MARKER_RADIUS_PT = 3.5  # within which the pointer meets a value
TICK_REACH = 0.45  # from the tick of a category to its points


class ValueMark(NamedTuple):
    """A value that can be read off a figure: where, in points from the SVG's upper left corner, and its text.

    A mark with a width and a height is a cell about its centre, others are points."""

    x: float
    y: float
    text: str
    width: float = 0.0
    height: float = 0.0


@dataclass(frozen=True)
class DrawnFigure:
    """A figure that is drawn: its files by format, and its SVG for a page with the values of each panel.

    values: the title of a panel with its marks; headline_pt: how much of the top its headline takes."""

    figure: Figure
    files: Mapping[str, bytes]
    svg: bytes
    values: tuple[tuple[str, tuple[ValueMark, ...]], ...] = ()
    headline_pt: float = 0.0


def value_text(
    name: str, panel: Panel, x: float, y: float, lo: float | None, hi: float | None, exact: float | None
) -> str:
    """The title of a point: its curve, and its coordinates under the labels of their axes, y with interval and exact
    value where known."""
    measured = _coordinate(panel.y, y)
    if lo is not None and hi is not None and not (math.isnan(lo) and math.isnan(hi)):
        measured += f" {interval(number(lo) or '−∞', number(hi) or '∞')}"
    if exact is not None and not math.isnan(exact):
        measured += f", {panel.crosses or tr('exact')} {number(exact)}"
    lines = [
        plain_text(name),
        _under_label(panel.x.label, _coordinate(panel.x, x)),
        _under_label(panel.y.label, measured),
    ]
    return "\n".join(filter(None, lines))


def cell_text(panel: Panel, heat: Heat, row: int, column: int) -> str:
    """The title of a map's cell: both coordinates and the value, under their labels."""
    x, y = (tick_text(float(value)) for value in (heat.x[column], heat.y[row]))
    lines = [_under_label(panel.x.label, x), _under_label(panel.y.label, y)]
    value = number(float(heat.values[row, column]))
    if heat.half_widths is not None and not math.isnan(heat.half_widths[row, column]):
        value += f" ± {number(float(heat.half_widths[row, column]), 2)}"
    return "\n".join([*lines, _under_label(heat.label, value)])


def _under_label(label: str, text: str) -> str:
    return ": ".join(filter(None, (plain_text(label), text))) if text else ""


def _coordinate(axis: Axis, value: float) -> str:
    """A value on an axis: the text of its tick where the axis is one of categories, else the number."""
    is_categorical = bool(axis.ticks) and [tick for tick, _ in axis.ticks] == list(range(len(axis.ticks)))
    nearby = [text for tick, text in axis.ticks if abs(tick - value) < TICK_REACH] if is_categorical else []
    return plain_text(nearby[0]) if nearby else number(value)


def embed(drawing: DrawnFigure, prefix: str) -> Markup:
    """The SVG element of a drawn figure for a page. Its ids begin with `prefix`, which is the figure's alone."""
    root = ElementTree.fromstring(FORBIDDEN_IN_XML.sub("�", drawing.svg.decode("utf-8")))
    width, height = (float(value) for value in root.attrib["viewBox"].split()[2:])
    _simplify(root, _new_ids(root, prefix))
    for parent in list(root.iter()):
        for child in [child for child in parent if _is_left_out(child)]:
            parent.remove(child)
    _unwrap_groups(root)
    top = drawing.headline_pt
    root.attrib = {
        "class": "figure",
        "role": "group",
        "aria-label": plain_text(drawing.figure.title),
        "viewBox": f"0 {top:.4g} {width:.5g} {height - top:.5g}",
        "style": f"--width:{width:.0f}",
    }
    root.extend(_value_groups(drawing))
    return Markup(ElementTree.tostring(root, encoding="unicode"))


def _is_left_out(element: ElementTree.Element) -> bool:
    """Whether an element has no use in a page: metadata, the style of a file, the headline, a group without content."""
    if element.tag == "defs":
        return not len(element)
    return element.tag in ("metadata", "style", "title") or element.get("id") == HEADLINE_ID


def _new_ids(root: ElementTree.Element, prefix: str) -> dict[str, str]:
    """New ids for those elements that others refer to."""
    values = [value for element in root.iter() for value in element.attrib.values() if "#" in value]
    references = {name for value in values for name in REFERENCE.findall(value)}
    ids = [name for element in root.iter() if (name := element.get("id", "")) in references]
    return {name: f"{prefix}-{n}" for n, name in enumerate(ids)}


def _simplify(root: ElementTree.Element, new_ids: Mapping[str, str]) -> None:
    """Remove namespaces, white space between elements, unused ids and digits that nobody sees."""
    for element in root.iter():
        element.tag = NAMESPACE.sub("", element.tag)
        element.tail = None
        if element.tag != "tspan" and element.text is not None and not element.text.strip():
            element.text = None
        attributes = {NAMESPACE.sub("", name): value for name, value in element.attrib.items()}
        values = {name: _page_value(name, value, new_ids) for name, value in attributes.items()}
        element.attrib = {name: value for name, value in values.items() if value}


def _page_value(name: str, value: str, new_ids: Mapping[str, str]) -> str:
    """The value of an attribute for a page; empty where the page does not need it."""
    if name == "id":
        return value if value == HEADLINE_ID else new_ids.get(value, "")
    return SHORTENING.get(name, str)(_refer(value, new_ids))


def _refer(value: str, new_ids: Mapping[str, str]) -> str:
    """An attribute with references to the new ids; a colour, which begins as a reference does, is left alone."""
    if "#" not in value:
        return value
    return REFERENCE.sub(lambda match: f"#{new_ids[match[1]]}" if match[1] in new_ids else match[0], value)


def _short_numbers(value: str) -> str:
    return LONG_DECIMALS.sub(r"\1", " ".join(value.split()))


def _short_transform(value: str) -> str:
    """A transformation with fewer digits; nothing where it only turns by zero. A scale keeps its digits."""
    if ROTATION_BY_ZERO.match(value):
        return ""
    return value if "scale" in value or "matrix" in value else _short_numbers(value)


def _short_path(value: str) -> str:
    """A path with fewer digits, without the white space beside its commands; a long polyline in relative steps."""
    path = re.sub(r" ?([A-Za-z]) ?", r"\1", _short_numbers(value))
    return _relative_path(path) if len(path) > MIN_LONG_PATH and POLYLINE.fullmatch(path) else path


def _relative_path(path: str) -> str:
    """A polyline whose corners are rounded to tenths of a point and written as steps from one to the next."""
    commands, x, y = [], 0, 0
    for command, x_text, y_text in CORNER.findall(path):
        if command == "z":
            commands.append("z")
            continue
        new_x, new_y = round(10 * float(x_text)), round(10 * float(y_text))
        step = (new_x, new_y) if command == "M" else (new_x - x, new_y - y)
        commands.append(f"{'M' if command == 'M' else 'l'}{step[0] / 10:g} {step[1] / 10:g}")
        x, y = new_x, new_y
    return "".join(commands)


def _short_style(value: str) -> str:
    return value.replace("; ", ";").replace(": ", ":")


SHORTENING: dict[str, Callable[[str], str]] = {
    **{"d": _short_path, "style": _short_style, "transform": _short_transform},
    **dict.fromkeys(("x", "y", "width", "height", "points"), _short_numbers),
}


def _unwrap_groups(root: ElementTree.Element) -> None:
    """Replace each group without an attribute by what it holds; a style that all markers of a group share becomes the
    group's."""
    children: list[ElementTree.Element] = []
    for child in root:
        _unwrap_groups(child)
        children += list(child) if child.tag == "g" and not child.attrib else [child]
    root[:] = children
    styles = {child.get("style", "") for child in root}
    if root.tag == "g" and len(root) > 1 and len(styles) == 1 and {child.tag for child in root} == {"use"}:
        root.set("style", styles.pop())
        for child in root:
            del child.attrib["style"]


def _value_groups(drawing: DrawnFigure) -> Iterator[ElementTree.Element]:
    """A group for each panel, with an invisible shape over each value, whose title is the value's text."""
    for title, marks in drawing.values:
        label = {"role": "group", "aria-label": title} if title else {}
        group = ElementTree.Element("g", {"class": "values"} | label)
        for mark in marks:
            shape = ElementTree.SubElement(group, *_shape(mark))
            ElementTree.SubElement(shape, "title").text = mark.text
        yield group


def _shape(mark: ValueMark) -> tuple[str, dict[str, str]]:
    if mark.width:
        box = (mark.x - mark.width / 2, mark.y - mark.height / 2, mark.width, mark.height)
        return "rect", {name: f"{value:.1f}" for name, value in zip(("x", "y", "width", "height"), box, strict=True)}
    return "circle", {"cx": f"{mark.x:.1f}", "cy": f"{mark.y:.1f}", "r": f"{MARKER_RADIUS_PT:g}"}
