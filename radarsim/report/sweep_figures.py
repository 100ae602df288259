"""Figures of a sweep, for every study: σ at the last scan against one swept key, or over two as a map."""

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.language.translate import tr
from radarsim.report import case_selection, key_labels, panel_layout, row_panels
from radarsim.report.drawing.model import MAX_PANEL_LINES, PAGE_MM, Axis, Figure, Heat, Line, Panel, Style
from radarsim.report.figure_lines import all_filters

WIDE = 20  # ratio of swept values from which the axis is logarithmic
VALUES = ("m", "rad")  # units of what is measured itself, not of its rates
MOST_PANELS = 6
BROAD = 12  # letters of a name at an axis, from which it is broken between words


def sweep_figures(results: Sequence[CaseResult], curves: Mapping) -> dict[str, Figure]:
    """A figure for each config that is swept over one key or two.

    curves is tables.group_by(table, "case", "filter", "component")."""
    figures_by_name = {}
    for keys, groups in group_by_swept_keys(results).items():
        name = "_".join(["sweep", *(key.rpartition(".")[2] for key in keys)])
        if len(keys) == 1:
            figures_by_name[name] = line_figure(name, keys[0], groups, curves)
        elif len(keys) == 2:
            has_several_configs = len(groups) > 1
            for members in groups:
                map_name = f"{name}_{key_labels.config_stem(members[0])}" if has_several_configs else name
                figures_by_name[map_name] = map_figure(map_name, keys, members, curves)
    return {name: figure for name, figure in figures_by_name.items() if figure}


def group_by_swept_keys(results: Sequence[CaseResult]) -> dict[tuple[str, ...], list[list[CaseResult]]]:
    """Swept cases by the keys that they differ in, those of each config together."""
    groups: dict[tuple[str, ...], list[list[CaseResult]]] = {}
    for (_, keys), members in group_swept_cases(results).items():
        groups.setdefault(keys, []).append(members)
    return groups


def group_swept_cases(results: Sequence[CaseResult]) -> dict[tuple[str, tuple[str, ...]], list[CaseResult]]:
    """Swept cases by their config and the keys that they differ in."""
    groups: dict = {}
    for result in results:
        if result.swept_values:
            groups.setdefault(
                (key_labels.config_stem(result), tuple(key for key, _ in result.swept_values)), []
            ).append(result)
    return {key: members for key, members in groups.items() if len(members) > 1}


def swept_components(result: CaseResult) -> list[tuple[str, str]]:
    """The components shown: the measured ones; for a single one, its rates too."""
    values = [(name, unit) for name, unit in result.axes.components if unit in VALUES]
    return (values if len(values) > 1 else list(result.axes.components))[:MOST_PANELS]


def axis_positions(result: CaseResult, key: str, values: Sequence) -> tuple[np.ndarray, Axis]:
    """Places of a swept key's values on an axis: numbers themselves, anything else one after the other.

    result is one of the swept cases."""
    label = key_labels.key_axis_label(result, key)
    if all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
        x = key_labels.key_axis_factor(result, key) * np.array(values, dtype=float)
        return x, Axis(label, "log" if x.min() > 0 and x.max() / x.min() > WIDE else "linear")
    short_values = [key_labels.shorten_mapping(result, key, v, values) for v in values]
    texts = [key_labels.format_value(v if isinstance(v, str | list | tuple) else str(v)) for v in short_values]
    ticks = tuple((float(i), textwrap.fill(text, BROAD, break_long_words=False)) for i, text in enumerate(texts))
    return np.arange(float(len(values))), Axis(label, ticks=ticks)


def final_sigma(result: CaseResult, filter_name: str, component: str, curves: Mapping) -> tuple[float, ...]:
    """σ at the last scan with its interval and exact value; NaN where the filter has none."""
    rows = curves.get((result.name, filter_name, component))
    if rows is None or not len(rows):
        return (np.nan,) * 4
    row = rows.iloc[-1]
    return tuple(float(row.get(name, np.nan)) for name in ("sigma", "sigma_lo", "sigma_hi", "exact_sigma"))


def line_figure(name: str, key: str, groups: Sequence[Sequence[CaseResult]], curves: Mapping) -> Figure | None:
    """σ at the last scan against one key, a line for each filter: a panel for each component; of several configs one
    for each of these, of the first component."""
    members, has_several_configs = [result for group in groups for result in group], len(groups) > 1

    def title_of(result: CaseResult) -> str:
        return key_labels.config_device(result) if has_several_configs else ""

    draw_panel = _row_panel if _has_many_points(key, members) else _line_panel
    panels_drawn = [
        panel
        for group in groups
        for component in swept_components(group[0])[: 1 if has_several_configs else None]
        if (panel := draw_panel(key, group, component, curves, title_of(group[0]))).marks
    ]
    if not panels_drawn:
        return None
    caption = tr(
        "RMS errors at the last scan versus the {key}, from {realisations} each.",
        key=key_labels.key_label(members[0], key).text,
        realisations=case_selection.realisations_text(members),
    )
    title = tr("RMS errors versus {key}", key=key_labels.key_label(members[0], key).text)
    if draw_panel is _row_panel:
        return row_panels.row_figure(name, title, caption, panels_drawn)
    figure = panel_layout.arrange_columns(Figure(name, title, caption, tuple(panels_drawn)))
    if len(panels_drawn[0].x.ticks) > FEW_NAMES:
        figure = replace(figure, columns=min(2, len(panels_drawn)))
    return figure


FEW_NAMES = 3  # on the axis of a panel of three beside each other
APART = 0.12  # between the points of filters beside each other, values being one apart


def _line_panel(
    key: str, members: Sequence[CaseResult], component: tuple[str, str], curves: Mapping, title: str = ""
) -> Panel:
    """Lines over numbers; over anything else points, ordered by the leading σ of the first filter."""
    filters = all_filters(members)
    factor, unit = key_labels.degrees_factor_and_unit(component[1])
    x, axis = _key_positions(key, members)
    if axis.ticks:
        members = _in_order_of_sigma(members, curves)
        _, axis = _key_positions(key, members)
    order = np.argsort(x)
    marks = []
    for i, f in enumerate(filters):
        sigma = factor * np.array([final_sigma(members[j], f, component[0], curves) for j in order])
        if np.isfinite(sigma[:, 0]).any():
            exact = sigma[:, 3] if np.isfinite(sigma[:, 3]).any() else None
            positions = np.arange(len(x)) + APART * (i - (len(filters) - 1) / 2) if axis.ticks else x[order]
            style = Style(i, None if axis.ticks else i, i)
            marks.append(
                Line(positions, sigma[:, 0], key_labels.escape_dollars(f), style, sigma[:, 1], sigma[:, 2], exact)
            )
    return Panel(
        axis, panel_layout.fitting_axis(_end_label(component[0], unit), marks), tuple(marks), title, direct=False
    )


def _key_positions(key: str, members: Sequence[CaseResult]) -> tuple[np.ndarray, Axis]:
    """Places of the cases on the axis of a key."""
    return axis_positions(members[0], key, [dict(result.swept_values)[key] for result in members])


def _in_order_of_sigma(members: Sequence[CaseResult], curves: Mapping) -> list[CaseResult]:
    """The cases by the σ of their first filter in the leading component."""
    first_filter, leading = all_filters(members)[0], members[0].axes.components[0][0]
    return sorted(members, key=lambda result: final_sigma(result, first_filter, leading, curves)[0])


def _end_label(component: str, unit: str) -> str:
    """The label of an axis of σ at the last scan."""
    label = tr("$\\sigma$ of {symbol} at the end", symbol=key_labels.component_symbol(component))
    return key_labels.label_with_unit(label, unit)


def _has_many_points(key: str, members: Sequence[CaseResult]) -> bool:
    """Whether a key has names for values, and more filters than colours are told apart by."""
    return bool(_key_positions(key, members)[1].ticks) and len(all_filters(members)) > MAX_PANEL_LINES


def _row_panel(
    key: str, members: Sequence[CaseResult], component: tuple[str, str], curves: Mapping, title: str = ""
) -> Panel:
    """Rows of filters, with a point for each of the values of a key, which are names."""
    filters, (factor, unit) = all_filters(members), key_labels.degrees_factor_and_unit(component[1])
    members = _in_order_of_sigma(members, curves)
    series = []
    for result, (_, value) in zip(members, _key_positions(key, members)[1].ticks, strict=True):
        sigma = factor * np.array([final_sigma(result, f, component[0], curves) for f in filters])
        series.append(row_panels.RowSeries(value.replace("\n", " "), *sigma.T))
    values = np.concatenate([values_of_case for _, values_of_case, *_ in series])
    axis = panel_layout.fitting_axis(_end_label(component[0], unit), [Line(values, values)])
    names = list(map(key_labels.escape_dollars, filters))
    return row_panels.row_panel(axis, names, series, title, ()) if np.isfinite(values).any() else Panel(axis, axis, ())


class SweptGrid:
    """The cells of a map: cases of a config that is swept over two keys."""

    def __init__(self, keys: Sequence[str], members: Sequence[CaseResult]):
        self.keys, self.members = keys, members
        values = [list(dict.fromkeys(_hashable(dict(r.swept_values)[key]) for r in members)) for key in keys]
        self.ranked = [sorted(v, key=lambda value: (isinstance(value, str), value)) for v in values]
        (self.x, _), (self.y, _) = (
            axis_positions(members[0], key, v) for key, v in zip(keys, self.ranked, strict=True)
        )

    def panel(
        self, title: str, label: str, values: Mapping[str, Sequence[float]], is_error: bool = False
    ) -> Panel | None:
        """A map of a value of each case, by its name, with half the width of its interval if that is to be written;
        None if there is no value."""
        cells = np.full((2, len(self.y), len(self.x)), np.nan)
        for result in self.members:
            swept_values = dict(result.swept_values)
            column, row = (self.ranked[i].index(_hashable(swept_values[key])) for i, key in enumerate(self.keys))
            numbers = values[result.name]
            cells[: len(numbers), row, column] = numbers
        if not np.isfinite(cells[0]).any():
            return None
        across, up = (_map_axis(self.members[0], key, v) for key, v in zip(self.keys, self.ranked, strict=True))
        half_widths = cells[1] if np.isfinite(cells[1]).any() else None
        heat = Heat(self.x, self.y, cells[0], label, half_widths=half_widths, is_error=is_error)
        return Panel(across, up, (heat,), title)

    def figure(self, name: str, title: str, caption: str, maps: Sequence[Panel]) -> Figure:
        """A figure of maps."""
        columns = min(2, len(maps))
        width = panel_layout.WIDE_MM if columns == 1 else PAGE_MM
        return Figure(name, title, caption, tuple(maps), columns, width, 62)


def map_figure(name: str, keys: tuple[str, ...], members: Sequence[CaseResult], curves: Mapping) -> Figure | None:
    """σ of the first component at the last scan over two keys: a map for each filter."""
    component, unit = members[0].axes.components[0]
    members = [result for result in members if component in dict(result.axes.components)]
    varying = [key for key in keys if len({_hashable(dict(r.swept_values)[key]) for r in members}) > 1]
    if len(varying) < 2:  # the component is of one value of a key alone
        return line_figure(name, varying[0], [members], curves) if varying else None
    grid, filters = SweptGrid(keys, members), list(dict.fromkeys(f for result in members for f in result.axes.filters))
    label = key_labels.label_with_unit(tr("$\\sigma$ of {symbol}", symbol=key_labels.component_symbol(component)), unit)
    maps = list[Panel]()
    for f in filters[:MOST_PANELS]:
        finals = {result.name: final_sigma(result, f, component, curves)[:1] for result in members}
        panel = grid.panel(key_labels.escape_dollars(f), label, finals, is_error=True)
        maps += [panel] if panel else []
    if not maps:
        return None
    first, second = (key_labels.key_label(members[0], key).text for key in keys)
    caption = tr(
        "RMS error of {component} at the last scan versus the {first} and the {second}, from {realisations} per "
        "cell. Framed: the least of each map.",
        component=component,
        first=first,
        second=second,
        realisations=case_selection.realisations_text(members),
    )
    caption += case_selection.left_out_remark(filters, filters[:MOST_PANELS])
    return grid.figure(name, tr("RMS error versus {first} and {second}", first=first, second=second), caption, maps)


def _map_axis(result: CaseResult, key: str, values: Sequence) -> Axis:
    """The axis of a map, each of its values named."""
    factor = key_labels.key_axis_factor(result, key)
    ticks = (
        (float(i), key_labels.format_value(v) if factor == 1.0 else key_labels.format_degrees(factor * float(v)))
        for i, v in enumerate(values)
    )
    return Axis(key_labels.key_axis_label(result, key), ticks=tuple(ticks))


def _hashable(value: object) -> int | float | str:
    return value if isinstance(value, int | float | str) else str(value)
