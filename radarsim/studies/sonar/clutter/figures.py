"""Figures of tracks among false plots: confirmation, track life and accuracy, false tracks, classes."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.language.translate import join_names, list_filters, term, tr
from radarsim.report import case_selection, figure_lines, key_labels, math_text, panel_layout, tables, wording
from radarsim.report.drawing.model import GREY, PAGE_MM, Axis, Figure, Line, Panel, Style
from radarsim.studies.sonar.clutter.axes import ClutterAxes
from radarsim.studies.sonar.clutter.map_figure import map_figure
from radarsim.studies.sonar.clutter.tables import ENDED_TRACK_EVENT

if TYPE_CHECKING:
    import pandas as pd


SWEPT_KEYS = {  # columns of the table `tracking`, and the keys whose values they hold
    "false_plots_per_km2": "sensor.false_plots_per_km2",
    "detection_probability": "sensor.detection_probability",
    "gate_probability": "gate_probability",
}
LIFE_CAPTION = term("mean time between ends of confirmed tracks (extrapolated)")
ENDS_CAPTION = term("probability (importance sampling) that the target's first track has ended")
CONFIRMATION_PANELS = 3  # in one row: the time to confirmation over the swept key is in `track_life`
ZERO_FACTOR = 3.0  # between zero and the smallest positive value on a logarithmic axis
UPPER_END_STYLE = Style(GREY, None, 4)
MAX_LEVEL_SHARE = 0.02  # of its largest value: a quantity that changes less over a sweep is not drawn, only named
Results = Sequence[CaseResult[ClutterAxes]]
TABLES_OF_FIGURES = {
    "confirmation": ("tracks",),
    "track_life": ("tracking", "curves", "rare"),
    "false_tracks": ("tracking",),
}


def figures(results: Results, tables_by_name: "Mapping[str, pd.DataFrame]") -> dict[str, Figure | None]:
    """The figures of these cases, all of which have trackers."""
    if not results:
        return {}
    figures_by_name = {
        "track_life": life_figure(results, tables_by_name),
        "track_map": map_figure(middle_case(results)),
        "confirmation": confirmation_figure(results, tables_by_name["tracks"]),
        "false_tracks": false_figure(results, tables_by_name["tracking"]),
        "track_classes": classes_figure(results, tables_by_name["track_classes"]),
    }
    return figures_by_name


def middle_case(results: Results) -> CaseResult[ClutterAxes]:
    """The case in the middle, for figures of a single case."""
    return results[(len(results) - 1) // 2]


def axis_over(result: CaseResult[ClutterAxes], column: str, table: "pd.DataFrame") -> "tuple[Axis, pd.DataFrame]":
    """An axis of the swept values of a column of SWEPT_KEYS, and the rows with their positions on it.

    It is logarithmic if the values span more than a factor of twenty; zero then stands left of the smallest one."""
    label, values = key_labels.key_axis_label(result, SWEPT_KEYS[column]), np.unique(table[column].to_numpy(float))
    positive = values[values > 0]
    if not len(positive) or positive[-1] / positive[0] <= panel_layout.LOG_RATIO:
        return Axis(label), table
    if values[0] > 0:
        return Axis(label, "log"), table
    zero = positive[0] / ZERO_FACTOR
    ticks = ((zero, "0"), *((float(value), wording.number(float(value), 4)) for value in positive))
    return Axis(label, "log", ticks=ticks), table.assign(**{column: table[column].replace(0.0, zero)})


def swept_column(tracking: "pd.DataFrame") -> str | None:
    """The column of SWEPT_KEYS that has the most different values; None if all cases have the same ones."""
    counts = {column: tracking[column].nunique() for column in SWEPT_KEYS}
    column = max(SWEPT_KEYS, key=lambda key: counts[key])
    return column if counts[column] > 1 else None


def with_line_names(tracking: "pd.DataFrame", column: str, result: CaseResult[ClutterAxes]) -> "pd.DataFrame":
    """The rows with the label of their line in place of the filter: the tracker and all swept values but the column's.

    result is one of the cases."""
    other_keys = [key for key in SWEPT_KEYS if key != column and tracking[key].nunique() > 1]
    names = tracking["filter"].map(key_labels.escape_dollars).astype(object)
    for key in other_keys:
        symbol = key_labels.key_symbol(result, SWEPT_KEYS[key])
        names = names + [
            f", {symbol} = {key_labels.value_with_unit(result, SWEPT_KEYS[key], v)}" for v in tracking[key]
        ]
    return tracking.assign(filter=names)


def confirmation_figure(results: Results, tracks: "pd.DataFrame") -> Figure | None:
    """Probability of a confirmed track against time: a panel for each case, a line for each tracker."""
    groups = tables.group_by(tracks, "case", "filter")
    confirmed = ("t_s", "confirmed_share", "confirmed_share_lo", "confirmed_share_hi", "exact_confirmed_share")
    figure_panels: list[Panel] = []
    shown_results = case_selection.pick_evenly(results, CONFIRMATION_PANELS)
    for result in shown_results:
        marks = []
        for n, f in enumerate(result.axes.filters):
            if (result.name, f) in groups:
                rows = groups[result.name, f]
                marks.append(figure_lines.line_from_rows(rows, confirmed, key_labels.escape_dollars(f), n))
                marks.append(
                    figure_lines.line_from_rows(
                        rows, ("t_s", "kept_share", "kept_share_lo", "kept_share_hi"), "", Style(n, n, None, 0.7)
                    )
                )
        if marks:
            keys = ((tr("thin: kept at that time"), Style(0, 0, None, 0.7)),) if not figure_panels else ()
            y = Axis(tr("probability"), limits=(0, 1))
            figure_panels.append(
                Panel(panel_layout.time_axis(), y, tuple(marks), _swept_values(result), keys, direct=False)
            )
    if not figure_panels:
        return None
    caption = (
        tr(
            "Probability that the target's track was confirmed by that time, from {realisations}; thin lines: that a "
            "confirmed track is on the target.",
            realisations=case_selection.realisations_text(results),
        )
    ) + case_selection.cases_left_out_remark(results, shown_results)
    title, columns = tr("Probability of a confirmed track"), min(3, len(figure_panels))
    return Figure("confirmation", title, caption, tuple(figure_panels), columns, PAGE_MM, 50.0, share_y=columns > 1)


def _swept_values(result: CaseResult[ClutterAxes]) -> str:
    """The swept keys of a case and their values, at length."""
    pairs = (
        (key_labels.key_label(result, key).text, key_labels.value_with_unit(result, key, v))
        for key, v in result.swept_values
    )
    return ", ".join(f"{name}: {value}" for name, value in pairs)


def life_figure(results: Results, tables_by_name: "Mapping[str, pd.DataFrame]") -> Figure | None:
    """Track life, time to confirmation, wrong plots and accuracy of the tracks kept, over the swept key."""
    tracking = tables_by_name["tracking"]
    column = swept_column(tracking)
    if column is None:
        return None
    x, tracking = axis_over(results[0], column, tracking)
    figure_panels, clauses, level_quantities = [], [], []
    for quantity in _life_quantities(tracking, tables_by_name, results[0].axes.k[-1]):
        lines = _lines(with_line_names(quantity.table, column, results[0]), column, quantity.column)
        line_values = [line.y[np.isfinite(line.y)] for line in lines]
        if all(np.ptp(values) <= MAX_LEVEL_SHARE * values.max() for values in line_values if len(values)):
            level_quantities.append(_level_quantity(quantity.name, quantity.unit, np.concatenate(line_values)))
        else:
            figure_panels.append(Panel(x, quantity.axis, tuple(lines), direct=False))
            clauses.append(quantity.clause)
    if not figure_panels:
        return None
    text = join_names(clauses)
    caption = tr(
        "{panels}, from {realisations}.",
        panels=text[0].upper() + text[1:],
        realisations=case_selection.realisations_text(results),
    )
    if not_drawn := [text for text in level_quantities if text]:
        caption += " " + tr("Constant over the sweep: {quantities}.", quantities=join_names(not_drawn))
    columns = min(2, len(figure_panels))
    width = panel_layout.WIDE_MM if columns == 1 else PAGE_MM
    return Figure("track_life", tr("Track life and accuracy"), caption, tuple(figure_panels), columns, width, 58)


class _LifeQuantity(NamedTuple):
    """A quantity of the figure of track life: column, name, unit, rows, and clause."""

    column: str
    name: str
    unit: str
    is_logarithmic: bool
    table: "pd.DataFrame"
    clause: str

    @property
    def axis(self) -> Axis:
        label = key_labels.label_with_unit(self.name, self.unit)
        return Axis(label, "log") if self.is_logarithmic else Axis(label, limits=(0, None))


def _life_quantities(
    tracking: "pd.DataFrame", tables_by_name: "Mapping[str, pd.DataFrame]", last_scan: int
) -> tuple[_LifeQuantity, ...]:
    """The quantities of the figure of track life; the share of ended tracks replaces the life where it was sampled."""
    cases = tracking[["case", *SWEPT_KEYS]].drop_duplicates("case")
    at_end = tables.select_rows(tables_by_name["curves"], component="r", k=last_scan).merge(
        cases, on="case", how="left"
    )
    life = _LifeQuantity("life_s", tr("track life, extrapolated"), "s", True, tracking, tr(LIFE_CAPTION))
    rare_events = tables_by_name.get("rare")
    if rare_events is not None:
        ended = rare_events[rare_events["sought"] & (rare_events["event"] == ENDED_TRACK_EVENT)]
        if len(ended):
            name, rates = tr("share of tracks ended by the last scan"), ended.merge(cases, on="case", how="left")
            life = _LifeQuantity("event_rate", name, "", True, rates, tr(ENDS_CAPTION))
    time, wrong, sigma = (tr("time to confirmation"), tr("share of wrong plots"), tr("RMS range error of kept tracks"))
    time_clause, wrong_clause = tr("mean time to confirmation"), tr("weight of false plots in the estimates")
    sigma_clause = tr("range error of kept tracks")
    return (
        life,
        _LifeQuantity("time_to_confirm_s", time, "s", False, tracking, time_clause),
        _LifeQuantity("wrong_share", wrong, "", False, tracking, wrong_clause),
        _LifeQuantity("sigma", sigma, "m", False, at_end, sigma_clause),
    )


def _level_quantity(name: str, unit: str, values: np.ndarray) -> str:
    """A quantity that does not change, with the range of its values (n,) over the trackers; empty without values."""
    if not len(values):
        return ""
    bounds = dict.fromkeys(wording.number(float(end), 3) for end in (values.min(), values.max()))
    number = " ".join(filter(None, ("–".join(bounds), key_labels.unit_label(unit))))
    return f"{math_text.plain_text(name)} ({number})"


def _lines(table: "pd.DataFrame", x: str, value: str) -> list[Line]:
    """A line for each filter of a table's values over x, without infinite values and without infinite interval ends."""
    lines = []
    for n, (name, rows) in enumerate(table.groupby("filter", sort=False)):
        rows = rows.sort_values(x).replace(np.inf, np.nan)
        lo, hi = (rows[key].where(np.isfinite(rows[key]), rows[value]) for key in (f"{value}_lo", f"{value}_hi"))
        lines.append(figure_lines.line_from_rows(rows.assign(lo=lo, hi=hi), (x, value, "lo", "hi"), str(name), n))
    return lines


def false_figure(results: Results, tracking: "pd.DataFrame") -> Figure | None:
    """False tracks per hour over the swept key, on a logarithmic axis.

    Where none occurred, the upper end of the interval. Without false plots there are no false tracks, and no point."""
    column, rate = swept_column(tracking), "false_tracks_per_hour"
    rows = tracking[tracking["false_plots_per_km2"] > 0]
    if column is None or not (rows[rate] > 0).any():
        return None
    rules: dict[str, list[str]] = {}
    for name, count, rule_scans in (
        rows[["filter", "confirm_plots", "confirm_scans"]].drop_duplicates("filter").itertuples(index=False, name=None)
    ):
        rules.setdefault(tr("{count} of {of}", count=int(count), of=int(rule_scans)), []).append(name)
    x, rows = axis_over(results[0], column, with_line_names(rows, column, results[0]))
    without_tracks = rows[rows[rate] == 0]
    upper = Line(without_tracks[column].to_numpy(), without_tracks[f"{rate}_hi"].to_numpy(), "", UPPER_END_STYLE)
    rows = rows.assign(**{name: rows[name].where(rows[rate] > 0) for name in (rate, f"{rate}_lo", f"{rate}_hi")})
    keys = ((tr("none occurred: upper end of the interval"), UPPER_END_STYLE),) if len(without_tracks) else ()
    marks = (*_lines(rows, column, rate), *([upper] if keys else []))
    caption = tr(
        "False tracks confirmed per hour in the whole sector, from {realisations} per case. Plots that confirm a "
        "track: {rules}.",
        rules="; ".join(f"{rule} ({list_filters(names)})" for rule, names in rules.items()),
        realisations=case_selection.realisations_text(results),
    )
    if zero_names := rows.groupby("filter", sort=False)[rate].sum().loc[lambda rates: rates == 0].index.tolist():
        caption += " " + tr("Zero throughout: {names}.", names=list_filters(zero_names))
    panel = Panel(x, Axis(tr("false tracks per hour"), "log"), marks, keys=keys, direct=False)
    return Figure("false_tracks", tr("False tracks"), caption, (panel,), width_mm=panel_layout.WIDE_MM)


def classes_figure(results: Results, classes: "pd.DataFrame") -> Figure | None:
    """Error rates of the classification by the score, over its threshold, of one case."""
    case = middle_case(results)
    table = classes[(classes["case"] == case.name) & (classes["n_false"] > 0)]
    if table.empty:
        return None
    table = table.assign(filter=table["filter"].map(key_labels.escape_dollars))
    x = Axis(tr("threshold of the score"))
    false = _lines(table[table["false_called_true_share"] > 0], "threshold", "false_called_true_share")
    true = _lines(table, "threshold", "true_called_false_share")
    figure_panels = []
    if false:
        longest = max(false, key=lambda mark: len(mark.x))
        bound = Line(longest.x, np.exp(-longest.x), tr("bound"), Style(GREY, 1, None))
        y = Axis(tr("share of false tracks declared true"), "log")
        figure_panels.append(Panel(x, y, (*false, bound), direct=False))
    if true:
        y = Axis(tr("share of target's tracks declared false"), limits=(0, None))
        figure_panels.append(Panel(x, y, tuple(true), direct=False))
    caption = tr(
        "Errors if tracks are declared true when their log likelihood ratio reaches a threshold, from {realisations} "
        "of each kind. Left: false tracks (bound: exp(−threshold)). Right: the target's.",
        realisations=case_selection.realisations_text(results),
    ) + (tr(" Case: {swept}.", swept=_swept_values(case)) if case.swept_values else "")
    return (
        Figure("track_classes", tr("True and false tracks by score"), caption, tuple(figure_panels), 2, PAGE_MM)
        if figure_panels
        else None
    )
