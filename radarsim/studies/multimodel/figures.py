"""P2's figures: the flight, σ of height and its rate, probabilities, families × rules, cost, consistency.

The flight is figures 1–4 of the paper, σ of height and of its rate figures 5 and 6, the probabilities figure 7."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language.numerals import numeral
from radarsim.language.translate import term, tr
from radarsim.report import caption_remarks, case_selection, figure_lines, key_labels, panel_layout, row_panels, tables
from radarsim.report.drawing.model import (
    MAX_PANEL_LINES,
    PAGE_MM,
    Axis,
    Figure,
    Heat,
    Line,
    Note,
    Panel,
    Reference,
    Style,
)
from radarsim.report.quantities import Component

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.studies.multimodel.study import FlightAxes

COMPONENTS = (
    Component("x", "m", "$x$", term("distance north")),
    Component("vx", "m/s", "$\\dot x$", term("velocity north")),
    Component("ax", "m/s2", "$a_x$", term("acceleration north")),
    Component("y", "m", "$y$", term("height")),
    Component("vy", "m/s", "$\\dot y$", term("rate of climb")),
    Component("ay", "m/s2", "$a_y$", term("vertical acceleration")),
    Component("z", "m", "$z$", term("distance east")),
    Component("vz", "m/s", "$\\dot z$", term("velocity east")),
    Component("az", "m/s2", "$a_z$", term("acceleration east")),
)
SIGMAS = {"y": (term("the height"), "$y$", "m"), "vy": (term("the rate of climb"), "$\\dot y$", "m/s")}
RULES = ("moment", "best", "combined", "modified_combined")
FAMILIES = {"gpb1": term("MMA1"), "imm": term("MMA2"), "gpb2": term("MMA3")}
POINT_SIZES_PT = dict(zip(RULES, (5.8, 7.0, 4.6, 3.4), strict=True))  # of points that may coincide, small ones on top
POINT_PT = 4.6  # of points of few filters
LINE_WIDTHS_PT = {"moment": 1.1, "best": 3.0, "combined": 2.0, "modified_combined": 0.9}  # likewise of lines, by rule
SAME_FRACTION = 0.01  # of a value, or of an axis: points nearer to each other are drawn as one
SAME_FLIGHT = 1e-3  # of its extent: a difference that is less than the width of a line
MAX_LOOKS = 8  # filters with distinct colours, dashes and markers
DRAWN_FROM = {"families": ("stages",), "cost": ("stages", "operations")}


def figures(
    results: Sequence[CaseResult], tables_by_name: "Mapping[str, pd.DataFrame]", experiment: Experiment
) -> dict[str, Figure]:
    """All figures for which there are results, by name; each shows the cases that the config names for it."""

    def visible_results(name: str) -> list[CaseResult]:
        return case_selection.select_cases(results, case_selection.cases_for_figure(experiment, name))[0]

    figures_by_name: dict[str, Figure | None] = {}
    for component in SIGMAS:
        figures_by_name[f"sigma_{component}"] = sigma(
            visible_results(f"sigma_{component}"), tables_by_name["curves"], component
        )
    figures_by_name["trajectory"] = trajectory(visible_results("trajectory"))
    figures_by_name["probabilities"] = probabilities(visible_results("probabilities"), tables_by_name["probabilities"])
    figures_by_name["families"] = families(visible_results("families"), tables_by_name)
    figures_by_name["cost"] = cost(visible_results("cost"), tables_by_name)
    figures_by_name["consistency"] = consistency(visible_results("consistency"), tables_by_name["consistency"])
    return {name: figure for name, figure in figures_by_name.items() if figure is not None}


def _figure_of_panels(
    name: str, title: str, caption: str, figure_panels: Sequence[Panel], height: float = 62.0
) -> Figure | None:
    """A figure of one panel, or of several in two columns, or three if that fills the page better."""
    if not figure_panels:
        return None
    count = sum(bool(panel.marks) for panel in figure_panels)
    width = panel_layout.WIDE_MM if count == 1 else PAGE_MM
    columns = 1 if count == 1 else 3 if count in (3, 5, 6, 9, 12) else 2
    return Figure(name, title, caption, tuple(figure_panels), columns, width, height)


def _has_many_filters(result: CaseResult) -> bool:
    """Whether a case has more filters than distinct looks."""
    return len(result.axes.filters) > MAX_LOOKS


def _styles(result: CaseResult) -> list[Style]:
    """The style of each filter of a case: distinct if there are few, else the rule's colour and the family's mark."""
    options = result.spec.filters
    if not _has_many_filters(result):
        return [Style(n, n, n) for n in range(len(options))]
    families = list(dict.fromkeys(o.family for o in options))
    marks = [families.index(o.family) for o in options]
    return [Style(RULES.index(o.merge), mark, mark) for o, mark in zip(options, marks, strict=True)]


def _legend_keys(result: CaseResult, **changes: Any) -> tuple[tuple[str, Style], ...]:
    """The legend for many filters: colours of rules, marks of families; changes: of the styles of families."""
    styled_filters = list(zip(result.spec.filters, _styles(result), strict=True))
    rules = {o.merge: replace(style, dash=0, marker=None, width_pt=4.0, flat=True) for o, style in styled_filters}
    families = {o.family: replace(style, colour=0) for o, style in styled_filters}
    labelled_styles = [(rule.replace("_", " "), style) for rule, style in rules.items()]
    labelled_styles += [(tr(FAMILIES.get(family, family)), style) for family, style in families.items()]
    family_labels = {tr(FAMILIES.get(family, family)) for family in families}
    return tuple(
        (label, replace(style, **changes) if label in family_labels else style) for label, style in labelled_styles
    )


def _with_legend(panels_without_legend: Sequence[Panel], result: CaseResult, **changes: Any) -> list[Panel]:
    """Panels with a common legend in its own cell; changes: see `_legend_keys`."""
    with_legend = panel_layout.with_legend_cell(panels_without_legend)
    if _has_many_filters(result):
        with_legend[-1] = replace(with_legend[-1], keys=_legend_keys(result, **changes))
    return with_legend


def _title(result: CaseResult, results: Sequence[CaseResult]) -> str:
    """The title that distinguishes a case: its swept values if all cases are of one config, else its label."""
    if len(results) == 1:
        return ""
    if len(case_selection.group_by_config(results)) > 1:
        return key_labels.case_label(result).replace("_", " ")
    return key_labels.swept_title(result)


def trajectory(results: Sequence["CaseResult[FlightAxes]"]) -> Figure | None:
    """Ground track, height, speed and acceleration (the paper's figures 1 to 4), a line for each distinct flight."""
    flights: list[CaseResult[FlightAxes]] = []
    for result in sorted(results, key=lambda result: -len(result.axes.t_s)):
        if not any(_is_same_flight(result.axes, flight.axes) for flight in flights):
            flights.append(result)
    lines: list[list[Line]] = [[], [], [], []]
    for n, result in enumerate(flights):
        x, t = result.axes.truth, np.asarray(result.axes.t_s, dtype=float)
        label, style = _title(result, results) if len(flights) > 1 else "", Style(n, n)
        speed, acceleration = (np.linalg.norm(x[:, i::3], axis=1) for i in (1, 2))
        lines[0].append(Line(x[:, 6] / 1e3, x[:, 0] / 1e3, label, style))
        for panel_index, values in ((1, x[:, 3] / 1e3), (2, speed), (3, acceleration)):
            lines[panel_index].append(Line(t, values, label, style))
    stage_lines = _stage_lines(flights)
    axes = (
        (Axis(tr("east $z$, km")), Axis(tr("north $x$, km")), tr("1  ground track"), ()),
        (panel_layout.time_axis(), Axis(tr("height $y$, km"), limits=(0, None)), tr("2  height"), stage_lines),
        (panel_layout.time_axis(), Axis(tr("speed, m/s"), limits=(0, None)), tr("3  speed"), stage_lines),
        (
            panel_layout.time_axis(),
            Axis(tr("acceleration, m/s²"), limits=(0, None)),
            tr("4  acceleration"),
            stage_lines,
        ),
    )
    lines[1:] = [_without_labels(panel_lines) for panel_lines in lines[1:]]
    flight_panels = [
        Panel(x, y, (*marks, *panel_lines), title, direct=False)
        for (x, y, title, marks), panel_lines in zip(axes, lines, strict=True)
    ]
    flight_panels[0] = replace(flight_panels[0], marks=(*flight_panels[0].marks, *_landmarks(lines[0])), equal=True)
    caption = tr(
        "The true flight, its ground track at one scale north and east with the radar at the origin. Dotted: ends of "
        "the stages."
    )
    return _with_paper_number(_figure_of_panels("trajectory", tr("Flight"), caption, flight_panels, 56), results, "1–4")


def _is_same_flight(axes: "FlightAxes", other_axes: "FlightAxes") -> bool:
    """Whether two cases have one flight, however often a plot comes: positions that no drawing tells apart."""
    (t, positions), (other_t, other_positions) = (
        (np.asarray(a.t_s, dtype=float), a.truth[:, ::3]) for a in (axes, other_axes)
    )
    shared = (t >= other_t[0]) & (t <= other_t[-1])
    if shared.sum() < 2 or abs(t[-1] - other_t[-1]) > np.diff(t).max() + np.diff(other_t).max():
        return False
    between = np.column_stack([np.interp(t[shared], other_t, column) for column in other_positions.T])
    return bool(np.abs(positions[shared] - between).max() < SAME_FLIGHT * np.ptp(positions, axis=0).max())


def _landmarks(tracks: Sequence[Line]) -> list[Line | Note]:
    """Marks for the radar, and for the start and the direction of each track."""
    radar = Line(np.zeros(1), np.zeros(1), "", Style(0, None, 1, size_pt=5.0), name=tr("radar"))
    marks: list[Line | Note] = [radar, Note(0.0, 0.0, tr("radar"), "ne")]
    for track in tracks:
        start = Line(
            track.x[:1], track.y[:1], "", replace(track.style, dash=None, marker=0, size_pt=5.0), name=tr("start")
        )
        third_index = len(track.x) // 3
        marks += [
            start,
            Note(float(track.x[third_index]), float(track.y[third_index]), _arrow(track, third_index), "se"),
        ]
    marks.append(Note(float(tracks[0].x[0]), float(tracks[0].y[0]), tr("start"), "ne"))
    return marks


def _arrow(track: Line, index: int) -> str:
    """An arrow in one of eight directions along a track at an index, east to the right, north up."""
    next_index = min(index + max(1, len(track.x) // 50), len(track.x) - 1)
    turn = np.arctan2(track.y[next_index] - track.y[index], track.x[next_index] - track.x[index])
    return "→↗↑↖←↙↓↘"[round(float(turn) / (np.pi / 4)) % 8]


def _stage_lines(results: Sequence[CaseResult]) -> tuple[Reference | Note, ...]:
    """The ends of the stages, and their names; empty if the cases' stages differ."""
    if len({result.spec.target.stages for result in results}) > 1:
        return ()
    stages, last = results[0].spec.target.stages, max(float(result.axes.t_s[-1]) for result in results)
    ends = [float(stage.end_s) for stage in stages[:-1]]
    if not ends:
        return ()
    marks: list[Reference | Note] = [Reference(end, "x") for end in ends]
    for stage, (begin, end) in zip(stages, pairwise([0.0, *ends, last]), strict=True):
        marks.append(Note((begin + end) / 2, np.nan, tr(stage.name), "top"))
    return tuple(marks)


def sigma(results: Sequence[CaseResult], curves: "pd.DataFrame", component: str) -> Figure | None:
    """σ of height or climb against time on a logarithmic scale (figures 5 and 6), a panel for each case; of many
    filters one for each family too."""
    rows = tables.group_by(curves[curves["component"] == component], "case", "filter")
    quantity = SIGMAS[component][0]
    sigma_panels = [
        panel for result in results for panel in _sigma_panels(result, rows, component, _title(result, results))
    ]
    if len(sigma_panels) > 1 and len(results[0].axes.filters) <= MAX_PANEL_LINES:
        sigma_panels = _with_legend(sigma_panels, results[0], marker=None)
    elif len(sigma_panels) > 1:
        sigma_panels = panel_layout.share_y_axis(sigma_panels)
    caption = tr(
        "Root-mean-square error of {quantity}, from {count:,} realisations. Dotted: ends of the stages.",
        quantity=quantity,
        count=results[0].count if results else 0,
    )
    figure = _figure_of_panels(
        f"sigma_{component}", tr("RMS error of {quantity}", quantity=quantity), caption, sigma_panels, 76
    )
    if figure is None:
        return None
    return _with_paper_number(figure, results, {"y": "5", "vy": "6"}[component])


def _sigma_panels(result: CaseResult, rows: Mapping, component: str, title: str) -> list[Panel]:
    """The panels of σ of one case: one, or one for each family of more filters than a panel can hold."""
    _, symbol, unit = SIGMAS[component]
    lines: dict[str, list[Line]] = {}
    has_families = len(result.axes.filters) > MAX_PANEL_LINES
    kinds = [(options.family, options.merge) for options in result.spec.filters]
    is_named_by_rule = len(set(kinds)) == len(kinds) and _has_many_filters(result)
    for f, options, style in zip(result.axes.filters, result.spec.filters, _styles(result), strict=True):
        if (result.name, f) in rows:
            family = tr(FAMILIES.get(options.family, options.family)) if has_families else ""
            name, label, look = key_labels.escape_dollars(f), "", replace(style, marker=None)
            if family and is_named_by_rule:
                label = options.merge.replace("_", " ")
                look = replace(look, dash=0, width_pt=LINE_WIDTHS_PT.get(options.merge, look.width_pt))
            line = figure_lines.line_from_rows(rows[result.name, f], figure_lines.SIGMA[:4], label or name, look, name)
            lines.setdefault(family, []).append(line)
    y = Axis(key_labels.label_with_unit(tr("full r.m.s. error of {symbol}", symbol=symbol), unit), "log")
    stage_lines = _stage_lines([result])
    return [
        Panel(panel_layout.time_axis(), y, (*stage_lines, *family_lines), ", ".join(filter(None, (title, family))))
        for family, family_lines in lines.items()
    ]


def _with_paper_number(figure: Figure | None, results: Sequence[CaseResult], number: str) -> Figure | None:
    """The figure with its number in the paper, if it is of the paper's experiment."""
    is_of_paper = figure is not None and all(result.name == "multimodel" for result in results)
    return caption_remarks.with_figure_number(figure, number) if figure and is_of_paper else figure


def probabilities(results: Sequence[CaseResult], table: "pd.DataFrame") -> Figure | None:
    """Mean probabilities of the models against time (figure 7), a panel for each filter of two or more models."""
    rows = tables.group_by(table, "case", "filter", "model")
    probability_panels: list[Panel] = []
    for result in results:
        for name, options in zip(result.axes.filters, result.spec.filters, strict=True):
            if len(options.models) < 2:
                continue
            marks: list = list(_stage_lines([result]))
            for m, motion in enumerate(_motions(options.models)):
                columns = ("t_s", "probability", "probability_lo", "probability_hi")
                model_rows = rows[(result.name, name, m + 1)]
                marks.append(figure_lines.line_from_rows(model_rows, columns, f"{m + 1} {motion}", Style(m, m)))
            title = (
                key_labels.escape_dollars(name)
                if len(results) == 1
                else f"{_title(result, results)}: {key_labels.escape_dollars(name)}"
            )
            probability_panels.append(
                Panel(
                    panel_layout.time_axis(),
                    Axis(tr("mean probability"), limits=(0, 1)),
                    tuple(marks),
                    title,
                    direct=False,
                )
            )
    banks = {tuple(mark.label for mark in panel.marks if isinstance(mark, Line)) for panel in probability_panels}
    titles = [panel.title for panel in probability_panels]
    left_out = case_selection.left_out_remark(titles, case_selection.pick_evenly(titles, case_selection.MAX_PANELS))
    probability_panels = case_selection.pick_evenly(probability_panels, case_selection.MAX_PANELS)
    if len(probability_panels) > 2 and len(banks) == 1:
        probability_panels = panel_layout.with_legend_cell(probability_panels)
    caption = (
        tr(
            "Mean posterior probabilities of the models, each with σ of its random acceleration. Dotted: ends of the "
            "stages."
        )
        + left_out
    )
    return _with_paper_number(
        _figure_of_panels("probabilities", tr("Probabilities of the models"), caption, probability_panels, 58),
        results,
        "7",
    )


def families(results: Sequence[CaseResult], tables_by_name: Mapping) -> Figure | None:
    """σ of the height by family and merging rule, a map for each stage; needs at least two of each."""
    heat_panels = []
    rows = tables.group_by(tables.select_rows(tables_by_name["stages"], component="y"), "case", "stage")
    for result in results:
        filter_by_design = {
            (options.family, options.merge): name
            for name, options in zip(result.axes.filters, result.spec.filters, strict=True)
            if options.family in FAMILIES
        }
        names = [[filter_by_design.get((family, rule)) for rule in RULES] for family in FAMILIES]
        if sum(any(row) for row in names) < 2 or sum(any(column) for column in zip(*names, strict=True)) < 2:
            continue
        for (case, stage), stage_rows in rows.items():
            if case != result.name:
                continue
            value = stage_rows.set_index("filter")["sigma"]
            grid = np.array([[value.get(name, np.nan) for name in row] for row in names], dtype=float)
            x = Axis(tr("merging rule"), ticks=tuple((i, rule.replace("_", "\n")) for i, rule in enumerate(RULES)))
            y = Axis(tr("family"), ticks=tuple(enumerate(map(tr, FAMILIES.values()))))
            title = ": ".join(filter(None, (_title(result, results), tr(str(stage)))))
            label = key_labels.sigma_axis_label("$y$", "m")
            heat_panels.append(
                Panel(x, y, (Heat(np.arange(4), np.arange(3), grid, label, f"{case}, {stage}", is_error=True),), title)
            )
    caption = tr(
        "RMS error of the height over each stage, by family and rule of the partial merges; one bank, one set of "
        "plots. Each map has its own scale; its least value is framed."
    )
    titles = [panel.title for panel in heat_panels]
    caption += case_selection.left_out_remark(titles, case_selection.pick_evenly(titles, case_selection.MAX_PANELS))
    heat_panels = case_selection.pick_evenly(heat_panels, case_selection.MAX_PANELS)
    return _figure_of_panels("families", tr("Families and merging rules"), caption, heat_panels, 52)


def cost(results: Sequence[CaseResult], tables_by_name: Mapping) -> Figure | None:
    """Operations per update against σ of the height, a panel for each stage of the first case shown."""
    if not results:
        return None
    result = results[0]
    operations = tables.group_by(tables_by_name["operations"], "case", "stage", "filter")
    rows = tables.select_rows(tables_by_name["stages"], case=result.name, component="y")
    cost_panels = []
    max_operations = (
        tables_by_name["operations"].loc[tables_by_name["operations"]["case"] == result.name, "operations"].max()
    )
    rules = {f: options.merge for f, options in zip(result.axes.filters, result.spec.filters, strict=True)}
    joined_rules = _joined_rules(result, rows, operations, float(max_operations))
    drawn_filters = [f for f, rule in rules.items() if joined_rules.get(rule, True)]
    styles = dict(zip(result.axes.filters, _styles(result), strict=True))
    sizes = POINT_SIZES_PT if _has_many_filters(result) else {}
    for stage, stage_rows in rows.groupby("stage", sort=False):
        marks: list[Line] = []
        for _, row in stage_rows[stage_rows["filter"].isin(drawn_filters)].iterrows():
            style = replace(styles[row["filter"]], dash=None, size_pt=sizes.get(rules[row["filter"]], POINT_PT))
            count = operations[(result.name, stage, row["filter"])]["operations"].to_numpy(float)
            lo, hi, value = (np.array([row[key]]) for key in ("sigma_lo", "sigma_hi", "sigma"))
            marks.append(Line(count, value, key_labels.escape_dollars(row["filter"]), style, lo, hi))
        marks.sort(key=lambda mark: -mark.style.size_pt)
        x = Axis(tr("operations per update"), limits=(0, 1.06 * float(max_operations)))
        y = Axis(key_labels.sigma_axis_label("$y$", "m"), "log")
        cost_panels.append(Panel(x, y, tuple(marks), tr(str(stage)), direct=False))
    cost_panels = _with_legend(cost_panels, result, dash=None)
    keys = [(joined_rules.get(text.replace(" ", "_"), text), style) for text, style in cost_panels[-1].keys]
    cost_panels[-1] = replace(cost_panels[-1], keys=tuple((text, style) for text, style in keys if text))
    caption = tr(
        "RMS error of the height of each stage versus arithmetic operations per update. Coinciding points: small "
        "marks on large ones.{of_case}",
        of_case=_case_sentence(result, results),
    )
    return _figure_of_panels("cost", tr("Cost and accuracy"), caption, cost_panels, 62)


def _joined_rules(
    result: CaseResult, rows: "pd.DataFrame", operations: Mapping, max_operations: float
) -> dict[str, str]:
    """What the legend calls each rule of many filters: "a = b" for the first of rules whose points coincide for all
    families and stages, nothing for the others."""
    if not _has_many_filters(result):
        return {}
    designs = {f: (o.family, o.merge) for f, o in zip(result.axes.filters, result.spec.filters, strict=True)}
    points: dict[str, dict] = {}
    for stage, f, sigma in zip(rows["stage"], rows["filter"], rows["sigma"], strict=True):
        family, rule = designs[f]
        place = float(operations[(result.name, stage, f)]["operations"].iloc[0]) / max_operations, np.log(sigma)
        points.setdefault(rule, {})[stage, family] = place
    groups: list[list[str]] = []
    for rule, places in points.items():
        group = next((group for group in groups if _are_near(points[group[0]], places)), None)
        if group is None:
            groups.append([rule])
        else:
            group.append(rule)
    names = {group[0]: " = ".join(rule.replace("_", " ") for rule in group) for group in groups}
    return {rule: names.get(rule, "") for rule in points}


def _are_near(places: Mapping, other_places: Mapping) -> bool:
    """Whether points of two rules, by stage and family, coincide."""
    if places.keys() != other_places.keys():
        return False
    return all(np.abs(np.subtract(places[key], other_places[key])).max() < SAME_FRACTION for key in places)


def _motions(models: Sequence) -> list[str]:
    """The models of a bank in the language in use: motion and σ of the random acceleration."""
    return [
        f"{tr(MOTIONS[model.motion])}, $\\sigma_a$ = {numeral(f'{model.sigma_acceleration_mps2:g}')} {tr('m/s²')}"
        for model in models
    ]


MOTIONS = {"uniform": term("constant velocity"), "accelerated": term("constant acceleration"), "still": term("still")}


def _case_sentence(result: CaseResult, results: Sequence[CaseResult]) -> str:
    """A sentence that names the case shown, if there are several."""
    return (
        tr(" For {plain_label}; other cases: in the tables.", plain_label=key_labels.plain_case_label(result))
        if len(results) > 1
        else ""
    )


def _without_labels(lines: Sequence) -> list:
    """The marks without labels in the legend."""
    return [replace(line, label="", name=line.name or line.label) if isinstance(line, Line) else line for line in lines]


def consistency(results: Sequence[CaseResult], table: "pd.DataFrame") -> Figure | None:
    """NEES and NIS per degree of freedom of the first case shown: a row for each filter, a point for each stage."""
    if not results:
        return None
    result = results[0]
    rows, filters = table[table["case"] == result.name], result.axes.filters
    names = list(map(key_labels.escape_dollars, filters))
    x = Axis(tr("mean per degree of freedom"), "log")
    consistency_panels = []
    for key, title in (("nees", tr("NEES of the position")), ("nis", tr("NIS of the plot"))):
        series = [
            row_panels.filter_series(tr(str(stage)), stage_rows, key, filters)
            for stage, stage_rows in rows.groupby("stage", sort=False)
        ]
        consistency_panels.append(row_panels.row_panel(x, names, series, title, [Reference(1.0, "x")]))
    caption = tr(
        "Normalised squared errors per degree of freedom, by stage: 1 if the filter's own covariance is correct, more "
        "if it is optimistic.{of_case}",
        of_case=_case_sentence(result, results),
    )
    return row_panels.row_figure("consistency", tr("Consistency of the filters"), caption, consistency_panels)
