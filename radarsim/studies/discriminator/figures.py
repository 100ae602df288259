"""P4's figures: residuals against the window (figure 2), locks, accuracy, and the maps of where the sequence locks."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from radarsim.config.experiment import Case, Experiment
from radarsim.engine.results import CaseResult
from radarsim.language.numerals import numeral
from radarsim.language.translate import quote_name, term, tr
from radarsim.report import case_selection, figure_lines, key_labels, panel_layout, tables
from radarsim.report.drawing.model import GREY, PAGE_MM, Axis, Figure, Heat, Line, Panel, Reference, Style
from radarsim.studies.discriminator.one_burst import one_burst
from radarsim.studies.discriminator.tables import last_locks

SYMBOLS = {  # of errors, with the unit
    "phi0": ("$|\\Delta\\varphi_0|$", "rad"),
    "f0": ("$|\\Delta f_0|$", "Hz"),
    "f1": ("$|\\Delta f_1|$", "Hz/s"),
    "f2": ("$|\\Delta f_2|$", "Hz/s²"),
    "f3": ("$|\\Delta f_3|$", "Hz/s³"),
    "f4": ("$|\\Delta f_4|$", "Hz/s⁴"),
}
QUANTITIES = {  # as titles of panels
    **{"phi0": term("initial phase"), "f0": term("frequency"), "f1": term("rate of the frequency")},
    **{"f2": term("its 2nd derivative"), "f3": term("its 3rd derivative"), "f4": term("its 4th derivative")},
}
NAMES = {"phi0": "$\\varphi_0$"} | {f"f{n}": f"$f_{n}$" for n in range(5)}
INTEGER_KEYS = ("density", "steps")  # keys that take whole numbers
WINDOW_LABEL = term("window length, s")
MAX_LINES = 10
MAX_TICKS = 8
CERTAIN_LOCK_RATE = 0.99
DRAWN_FROM = {"accuracy": ("curves",), "lock": ("locks",), "residuals": ("residuals", "windows")}


def figures(results: Sequence[CaseResult], tables_by_name: Mapping, experiment: Experiment) -> dict[str, Figure]:
    """Residuals, locks and accuracy of the first unswept case; a figure for each family of swept cases."""
    figures_by_name: dict[str, Figure] = {}

    def select_cases(name: str, candidates: Sequence[CaseResult]) -> list[CaseResult]:
        case_names = case_selection.cases_for_figure(experiment, name)
        return [result for result in candidates if result.name in case_names]

    unswept = [result for result in results if not result.swept_values]
    cases = {case.name: case for case in experiment.cases}

    def errors(result: CaseResult, tables_by_name: Mapping) -> Figure:
        return residuals(result, tables_by_name, cases[result.name])

    for name, draw in (("locks", locks), ("accuracy", accuracy), ("residuals", errors)):
        if plain_cases := select_cases(name, unswept):
            figure = draw(plain_cases[0], tables_by_name)
            left_out = case_selection.cases_left_out_remark(plain_cases, plain_cases[:1])
            figures_by_name[name] = replace(figure, caption=figure.caption + left_out)
    for keys, family in swept_families(results).items():
        name = "_".join(["lock", *(key.split(".")[-1] for key in keys)])
        members = select_cases(name, family)
        if not members:
            continue
        if len(keys) == 1:
            figures_by_name[name] = lock_against(name, keys[0], members, tables_by_name)
        elif len(keys) == 2:
            figures_by_name[name] = lock_map(name, keys, members, tables_by_name)
    return figures_by_name


def thinned_ticks(values: np.ndarray) -> tuple[tuple[float, str], ...]:
    """Ticks at the values, thinned to a readable number."""
    return tuple((v, numeral(f"{v:g}")) for v in values[:: -(-len(values) // MAX_TICKS)])


def swept_families(results: Sequence[CaseResult]) -> dict[tuple[str, ...], list[CaseResult]]:
    """Swept cases by the keys they differ in."""
    families: dict[tuple[str, ...], list[CaseResult]] = {}
    for result in results:
        if result.swept_values:
            families.setdefault(tuple(key for key, _ in result.swept_values), []).append(result)
    return families


def residuals(result: CaseResult, tables_by_name: Mapping, case: Case) -> Figure:
    """The paper's figure 2, of one burst and over all: window lengths, and |error| of each component against them."""
    name = result.axes.filters[0]
    rows = tables.group_by(tables_by_name["residuals"], "case", "filter", "component")
    windows = tables.group_by(tables_by_name["windows"], "case", "filter")[(result.name, name)]
    k, t = windows["k"].to_numpy(float), windows["t_s"].to_numpy(float)
    panels = [
        Panel(
            Axis(tr("window $k$"), ticks=thinned_ticks(k)),
            Axis("$T_k$, s", "log"),
            (Line(k, t, "", Style(0, 0, 0)),),
            f"a  {tr('windows')}",
            direct=False,
        )
    ]
    burst = one_burst(case, 0)
    for n, (letter, (component, _)) in enumerate(zip("bcdefg", result.axes.components, strict=False)):
        component_rows = rows[(result.name, name, component)]
        t, middle, low, high, bound = (
            component_rows[column].to_numpy(float) for column in ("t_s", "median", "q05", "q95", "posterior_crb")
        )
        marks = (
            Line(t, middle, tr("median, 5 to 95 % of bursts"), Style(0, 0, 0), low, high),
            Line(t, 3.0 * bound, "3σ", Style(1, 1)),
            Line(t, burst[:, n], tr("one burst"), Style(2, 2, 2, size_pt=2.4)),
        )
        y = Axis(key_labels.label_with_unit(*SYMBOLS[component]), "log")
        title = f"{letter}  {tr(QUANTITIES[component])}"
        panels.append(Panel(Axis(tr(WINDOW_LABEL), "log"), y, marks, title, direct=False, has_intervals=False))
    caption = tr(
        "Windows of {name} and absolute error of each component, from {count:,} bursts, locked or not. 3σ: three "
        "times the Cramér–Rao bound, prior included. One burst: the first.",
        name=quote_name(name),
        count=result.count,
    )
    title = tr("Errors versus window (figure 2)")
    return Figure("residuals", title, caption, tuple(panels), 3, PAGE_MM, 52.0)


def locks(result: CaseResult, tables_by_name: Mapping) -> Figure:
    """Share of locked bursts at each window of every estimator."""
    rows = tables.group_by(tables_by_name["locks"], "case", "filter")
    marks = []
    plotted_names = result.axes.filters[:MAX_LINES]
    for n, name in enumerate(plotted_names):
        filter_rows = rows[(result.name, name)]
        marks.append(figure_lines.line_from_rows(filter_rows, ("t_s", "lock_rate", "lock_lo", "lock_hi"), name, n))
    panel, remark = _shares(Axis(tr(WINDOW_LABEL), "log"), marks, 0)
    lost = panel.y.scale == "log"
    caption = (
        tr("Share of bursts with a component beyond five times the Cramér–Rao bound of the window.")
        if lost
        else tr("Share of bursts with every component within five times the Cramér–Rao bound of the window.")
    )
    caption += f" {_sample(result)}{remark}{case_selection.left_out_remark(result.axes.filters, plotted_names)}"
    title = tr("Bursts not locked versus window") if lost else tr("Locked bursts versus window")
    figure = Figure(*("locks", title, caption, (panel,)), width_mm=panel_layout.WIDE_MM, panel_height_mm=80.0)
    return figure


def _shares(x: Axis, marks: Sequence[Line], lower_limit: float | None = None) -> tuple[Panel, str]:
    """The panel of locked bursts over x, or of those not locked where lock is nearly certain; and a remark."""
    if not panel_layout.has_rare_losses(marks):
        return Panel(x, Axis(tr("share locked"), limits=(lower_limit, 1)), tuple(marks), direct=False), ""
    losses, remark = panel_layout.loss_lines(marks)
    axis = panel_layout.loss_axis(tr("share of bursts that fail to lock"), losses)
    return Panel(x, axis, losses, direct=False), remark


def _sample(result: CaseResult) -> str:
    """How many bursts a share is from, for a caption."""
    if result.spec.rare is not None:
        return tr("Importance sampling; weighted bursts per case: {count:,}.", count=result.count)
    return tr("Bursts per case: {count:,}.", count=result.count)


def accuracy(result: CaseResult, tables_by_name: Mapping) -> Figure:
    """σ of the locked over the bound with the prior, a panel for each estimator that locks."""
    rows = tables.group_by(tables_by_name["curves"], "case", "filter", "component")
    panels: list[Panel] = []
    for name in result.axes.filters:
        marks: list = [Reference(1.0)]
        for n, (component, _) in enumerate(result.axes.components):
            component_rows = rows.get((result.name, name, component))
            if component_rows is None or len(component_rows) < 2:
                continue
            ratios = component_rows.assign(
                **{name: component_rows[name] / component_rows["posterior_crb"] for name in figure_lines.SIGMA[1:4]}
            )
            line = figure_lines.line_from_rows(ratios, figure_lines.SIGMA[:4], NAMES[component], Style(n, n % 4, n))
            marks.append(replace(line, has_band=False))
        if len(marks) > 1:
            marks.append(_interval_about_one(marks[1:]))
            axis = Axis(tr("$\\sigma$ / bound"), limits=(0.9, 1.3))
            panels.append(Panel(Axis(tr(WINDOW_LABEL), "log"), axis, tuple(marks), name, direct=False))
    caption = tr(
        "Root-mean-square error of the locked bursts divided by the Cramér–Rao bound of the window (prior included), "
        "from {count:,} bursts. Grey: the 95 % interval of a value of one.",
        count=result.count,
    )
    columns = min(3, max(1, len(panels)))
    figure = Figure("accuracy", tr("Accuracy of the locked bursts"), caption, tuple(panels), columns, PAGE_MM, 52.0)
    return figure


def _interval_about_one(lines: Sequence[Line]) -> Line:
    """The widest interval of the lines at each window, as if their value was one."""
    windows = np.unique(np.concatenate([line.x for line in lines]))
    lo, hi = np.full((2, len(windows)), np.nan)
    for line in lines:
        places = np.searchsorted(windows, line.x)
        lo[places] = np.fmin(lo[places], np.asarray(line.lo) / line.y)
        hi[places] = np.fmax(hi[places], np.asarray(line.hi) / line.y)
    return Line(windows, np.ones(len(windows)), "", Style(GREY, 2, width_pt=0.7), lo, hi)


def lock_against(name: str, key: str, members: Sequence[CaseResult], tables_by_name: Mapping) -> Figure:
    """Lock at the end of the burst against one swept key, a line for each estimator."""
    designed = key.rpartition(".")[2] == "lock_probability"
    x = np.array([float(member.swept_values[0][1]) for member in members])
    if designed:
        x = np.array([float(f"{1 - probability:.9g}") for probability in x])
    order = np.argsort(x)
    marks: list[Line] = []
    for n, estimator in enumerate(members[0].axes.filters):
        ends, columns = (
            [last_locks(tables_by_name, members[i], estimator) for i in order],
            ("lock_rate", "lock_lo", "lock_hi"),
        )
        marks.append(figure_lines.line_from_tables(x[order], ends, columns, estimator, Style(n, n % 4, n)))
    scale = "log" if x.min() > 0 and x.max() / x.min() > 20 else "linear"
    key_name = key_labels.key_label(members[0], key).text
    ticks = thinned_ticks(x[order]) if key in INTEGER_KEYS else ()
    panel, remark = _shares(Axis(_swept_axis(key, members[0]), scale, ticks=ticks), marks)
    lost = panel.y.scale == "log"
    if designed and lost:
        panel = replace(panel, marks=(*panel.marks, Line(x[order], x[order], "", Style(GREY, 2, width_pt=0.7))))
        remark += " " + tr("Dotted: designed failure probability of one hand-over.")
    if lost:
        title = tr("Failures to lock versus {called}", called=key_name)
        caption = tr("Share of bursts that fail to lock in the last window versus the {called}.", called=key_name)
    else:
        title = tr("Lock rate versus {called}", called=key_name)
        caption = tr("Share of bursts locked in the last window versus the {called}.", called=key_name)
    caption += f" {_sample(members[0])}{remark}"
    figure = Figure(name, title, caption, (panel,), width_mm=panel_layout.WIDE_MM, panel_height_mm=70.0)
    return figure


def _swept_axis(key: str, result: CaseResult) -> str:
    """The label of an axis for a swept key."""
    return "$1 - P_\\Delta$" if key.rpartition(".")[2] == "lock_probability" else key_labels.key_axis_label(result, key)


def lock_map(name: str, keys: tuple[str, ...], members: Sequence[CaseResult], tables_by_name: Mapping) -> Figure:
    """Lock at the end over two swept keys, a map for each estimator."""
    x, y = (np.array(sorted({float(member.swept_values[i][1]) for member in members})) for i in (0, 1))
    panels = []
    for estimator in members[0].axes.filters:
        values = np.full((len(y), len(x)), np.nan)
        for member in members:
            column, row = (np.searchsorted(a, float(member.swept_values[i][1])) for i, a in ((0, x), (1, y)))
            values[row, column] = last_locks(tables_by_name, member, estimator)["lock_rate"]
        marks = (Heat(x, y, values, tr("share locked")),)
        x_axis, y_axis = (Axis(_swept_axis(key, members[0])) for key in keys)
        panels.append(Panel(x_axis, y_axis, marks, estimator))
    panels.append(lock_border_panel(keys, members, tables_by_name, x, y))
    second = key_labels.key_label(members[0], keys[1]).text
    caption = tr(
        "Share of bursts locked at the end, from {count:,} per cell. Last panel: the largest {second} up to which "
        "the interval is above {sure:g}; no line: for none.",
        second=second,
        count=members[0].count,
        sure=CERTAIN_LOCK_RATE,
    )
    columns = min(2, len(panels))
    figure = Figure(name, tr("Where the sequence locks"), caption, tuple(panels), columns, PAGE_MM, 70.0)
    return figure


def lock_border_panel(
    keys: tuple[str, ...], members: Sequence[CaseResult], tables_by_name: Mapping, x: np.ndarray, y: np.ndarray
) -> Panel:
    """The border of certain lock: for each value of the first key, the largest value of the second."""
    marks = []
    for n, estimator in enumerate(members[0].axes.filters):
        sure = np.zeros((len(y), len(x)), dtype=bool)
        for member in members:
            column, row = (np.searchsorted(a, float(member.swept_values[i][1])) for i, a in ((0, x), (1, y)))
            sure[row, column] = last_locks(tables_by_name, member, estimator)["lock_lo"] >= CERTAIN_LOCK_RATE
        reach = np.minimum.accumulate(sure, axis=0).sum(axis=0)
        border = np.where(reach > 0, y[np.maximum(reach, 1) - 1], np.nan)
        marks.append(Line(x, border, estimator, Style(n, n % 4, n)))
    x_axis, y_axis = (
        Axis(_swept_axis(key, members[0]), "log" if a.min() > 0 else "linear")
        for key, a in zip(keys, (x, y), strict=True)
    )
    return Panel(x_axis, y_axis, tuple(marks), tr("locked in over {sure:g}", sure=CERTAIN_LOCK_RATE), direct=False)
