"""One burst through the windows of an estimator, for the figure that shows it: the paper's figure 2 shows one.

P4's figures: residuals against the window (figure 2), locks, accuracy, and the maps of where the sequence locks."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from radarsim.bursts import burst
from radarsim.config.experiment import Case, Experiment
from radarsim.engine.results import CaseResult
from radarsim.language import numeral, term, tr
from radarsim.report import panels, tables
from radarsim.report.drawing import GREY, PAGE_MM, Axis, Figure, Heat, Line, Panel, Reference, Style
from radarsim.studies.discriminator.study import estimate, prepare
from radarsim.studies.discriminator.tables import last_locks

if TYPE_CHECKING:
    pass


# ---- map -------------------------------------------------------------------------------------------------------------
BURST = 0  # the realisation that is shown


def one_burst(case: Case, number: int) -> np.ndarray:
    """Absolute errors (K, C) of an estimator at each of its K windows, in the units of the components (rad, Hz, …). The
    burst is the first realisation of the run itself, whether it locks or not."""
    plan = prepare(case)
    errors, _ = estimate(plan, BURST, 1)
    windows, size = len(plan.axes.pulses[number]), len(plan.axes.components)
    return np.abs(errors[0, number, :windows, :size]) / burst.turns_per_parameter(size, plan.axes.burst_s)


# ---- figures ---------------------------------------------------------------------------------------------------------
SYMBOLS = {  # of errors, with the unit
    "phi0": ("$|\\Delta\\varphi_0|$", "rad"),
    "f0": ("$|\\Delta f_0|$", "Hz"),
    "f1": ("$|\\Delta f_1|$", "Hz/s"),
    "f2": ("$|\\Delta f_2|$", "Hz/s²"),
    "f3": ("$|\\Delta f_3|$", "Hz/s³"),
    "f4": ("$|\\Delta f_4|$", "Hz/s⁴"),
}
NAMES = {"phi0": "$\\varphi_0$"} | {f"f{n}": f"$f_{n}$" for n in range(5)}
WHOLE = ("density", "steps")  # keys that take whole numbers
WINDOW = term("window length, s")
MOST_LINES = 10
MOST_TICKS = 8
SURE = 0.99
DRAWN_FROM = {"accuracy": ("curves",), "lock": ("locks",), "residuals": ("residuals", "windows")}


def figures(results: Sequence[CaseResult], made: Mapping, experiment: Experiment) -> dict[str, Figure]:
    """residuals, locks and accuracy of the first case without a sweep; a figure for each family of swept cases."""
    drawn: dict[str, Figure] = {}

    def chosen(name: str, among: Sequence[CaseResult]) -> list[CaseResult]:
        wanted = panels.named(experiment, name)
        return [result for result in among if result.name in wanted]

    plain = [result for result in results if not result.swept]
    cases = {case.name: case for case in experiment.cases}

    def errors(result: CaseResult, made: Mapping) -> Figure:
        return residuals(result, made, cases[result.name])

    for name, draw in (("locks", locks), ("accuracy", accuracy), ("residuals", errors)):
        if shown := chosen(name, plain):
            figure = draw(shown[0], made)
            left_out = panels.cases_left_out(shown, shown[:1])
            drawn[name] = replace(figure, caption=figure.caption + left_out)
    for keys, family in swept_families(results).items():
        name = "_".join(["lock", *(key.split(".")[-1] for key in keys)])
        members = chosen(name, family)
        if not members:
            continue
        if len(keys) == 1:
            drawn[name] = lock_against(name, keys[0], members, made)
        elif len(keys) == 2:
            drawn[name] = lock_map(name, keys, members, made)
    return drawn


def numbers(values: np.ndarray) -> tuple[tuple[float, str], ...]:
    """Ticks at whole numbers, every one or every few."""
    return tuple((v, numeral(f"{v:g}")) for v in values[:: -(-len(values) // MOST_TICKS)])


def swept_families(results: Sequence[CaseResult]) -> dict[tuple[str, ...], list[CaseResult]]:
    """Swept cases by the keys they differ in."""
    found: dict[tuple[str, ...], list[CaseResult]] = {}
    for result in results:
        if result.swept:
            found.setdefault(tuple(key for key, _ in result.swept), []).append(result)
    return found


def residuals(result: CaseResult, made: Mapping, case: Case) -> Figure:
    """The paper's figure 2, of one burst and over all: window lengths, and |error| of each component against them."""
    name = result.axes.filters[0]
    rows = tables.groups(made["residuals"], "case", "filter", "component")
    windows = tables.groups(made["windows"], "case", "filter")[(result.name, name)]
    k, t = windows["k"].to_numpy(float), windows["t_s"].to_numpy(float)
    drawn = [
        Panel(
            Axis(tr("window $k$"), ticks=numbers(k)),
            Axis("$T_k$, s", "log"),
            (Line(k, t, "", Style(0, 0, 0)),),
            "a",
            direct=False,
        )
    ]
    burst = one_burst(case, 0)
    for n, (letter, (component, _)) in enumerate(zip("bcdefg", result.axes.components, strict=False)):
        own = rows[(result.name, name, component)]
        t, middle, low, high, bound = (
            own[column].to_numpy(float) for column in ("t_s", "median", "q05", "q95", "posterior_sigma")
        )
        marks = (
            Line(t, middle, tr("median"), Style(0, 0, 0), low, high),
            Line(t, 3.0 * bound, "3σ", Style(1, 1)),
            Line(t, burst[:, n], tr("one burst"), Style(2, 2, 2, size_pt=2.4)),
        )
        y = Axis(panels.with_unit(*SYMBOLS[component]), "log")
        drawn.append(Panel(Axis(tr(WINDOW), "log"), y, marks, letter, direct=False))
    caption = tr(
        "Windows of the estimator {name!r} and the absolute error of each component against the "
        "window's length: median and the band from 5 to 95 % of {count:,} bursts, locked or not. "
        "Dashed: three times the potential spread of the window, prior included, the paper's limit. Dotted: one "
        "burst, the first of the run, as the paper's figure 2 shows one.",
        name=name,
        count=result.count,
    )
    title = tr("Errors against the window (figure 2)")
    return Figure("residuals", title, caption, tuple(drawn), 3, PAGE_MM, 52.0)


def locks(result: CaseResult, made: Mapping) -> Figure:
    """Share of locked bursts at each window of every estimator."""
    rows = tables.groups(made["locks"], "case", "filter")
    marks = []
    drawn = result.axes.filters[:MOST_LINES]
    for n, name in enumerate(drawn):
        own = rows[(result.name, name)]
        marks.append(panels.line(own, ("t_s", "lock_rate", "lock_lo", "lock_hi"), name, n))
    caption = tr(
        "A burst is locked if every component is within five potential spreads of the window (without "
        "prior; the phase modulo one turn); of {count:,} bursts. Bands: 95 % intervals.",
        count=result.count,
    )
    panel, said = _shares(Axis(tr(WINDOW), "log"), marks, 0)
    caption += said + panels.left_out(result.axes.filters, drawn)
    lost = panel.y.scale == "log"
    title = tr("Bursts not locked against the window") if lost else tr("Locked bursts against the window")
    figure = Figure(*("locks", title, caption, (panel,)), width_mm=panels.WIDE_MM, panel_height_mm=80.0)
    return figure


def _shares(x: Axis, marks: Sequence[Line], least: float | None = None) -> tuple[Panel, str]:
    """Shares of locked bursts over x, where some lock almost always those that do not; and words for the caption."""
    if not panels.is_rare(marks):
        return Panel(x, Axis(tr("share locked"), limits=(least, 1)), tuple(marks), direct=False), ""
    losses, said = panels.ever_lost(marks)
    return Panel(x, panels.loss_axis(tr("share not locked"), losses), losses, direct=False), said


def accuracy(result: CaseResult, made: Mapping) -> Figure:
    """σ of the locked over the bound with the prior, a panel for each estimator that locks."""
    rows = tables.groups(made["curves"], "case", "filter", "component")
    drawn: list[Panel] = []
    for name in result.axes.filters:
        marks: list = [Reference(1.0)]
        for n, (component, _) in enumerate(result.axes.components):
            own = rows.get((result.name, name, component))
            if own is None or len(own) < 2:
                continue
            over = own.assign(**{name: own[name] / own["posterior_sigma"] for name in panels.SIGMA[1:4]})
            marks.append(panels.line(over, panels.SIGMA[:4], NAMES[component], Style(n, n % 4, n)))
        if len(marks) > 1:
            axis = Axis(tr("$\\sigma$ / bound"), limits=(0.9, 1.3))
            drawn.append(Panel(Axis(tr(WINDOW), "log"), axis, tuple(marks), name, direct=False))
    caption = tr(
        "Root-mean-square error of the locked bursts over the potential spread of the window, prior "
        "included. Bands: 95 % intervals. {count:,} bursts; lock is judged at five spreads without "
        "prior.",
        count=result.count,
    )
    columns = min(3, max(1, len(drawn)))
    figure = Figure("accuracy", tr("Accuracy of the locked bursts"), caption, tuple(drawn), columns, PAGE_MM, 52.0)
    return figure


def lock_against(name: str, key: str, members: Sequence[CaseResult], made: Mapping) -> Figure:
    """Lock at the end of the burst against one swept key, a line for each estimator."""
    designed = key.rpartition(".")[2] == "lock_probability"
    x = np.array([float(member.swept[0][1]) for member in members])
    if designed:
        x = np.array([float(f"{1 - one:.9g}") for one in x])
    order = np.argsort(x)
    marks: list[Line] = []
    for n, estimator in enumerate(members[0].axes.filters):
        ends, columns = [last_locks(made, members[i], estimator) for i in order], ("lock_rate", "lock_lo", "lock_hi")
        marks.append(panels.line_of(x[order], ends, columns, estimator, Style(n, n % 4, n)))
    scale = "log" if x.min() > 0 and x.max() / x.min() > 20 else "linear"
    called = panels.key_label(members[0], key).text
    caption = tr(
        "Lock in the last window against the {called}, of {count:,} bursts each. Bands: 95 % intervals.",
        called=called,
        count=members[0].count,
    )
    ticks = numbers(x[order]) if key in WHOLE else ()
    panel, said = _shares(Axis(_called(key, members[0]), scale, ticks=ticks), marks)
    if designed and panel.y.scale == "log":
        panel = replace(panel, marks=(*panel.marks, Line(x[order], x[order], "", Style(GREY, 2, width_pt=0.7))))
        said += " " + tr("Dotted: designed failure probability of one hand-over.")
    caption += said
    title = tr("Lock against the {called}", called=called)
    figure = Figure(name, title, caption, (panel,), width_mm=panels.WIDE_MM, panel_height_mm=70.0)
    return figure


def _called(key: str, result: CaseResult) -> str:
    """A swept key as an axis names it."""
    return "$1 - P_\\Delta$" if key.rpartition(".")[2] == "lock_probability" else panels.axis_of(result, key)


def lock_map(name: str, keys: tuple[str, ...], members: Sequence[CaseResult], made: Mapping) -> Figure:
    """Lock at the end over two swept keys, a map for each estimator."""
    x, y = (np.array(sorted({float(member.swept[i][1]) for member in members})) for i in (0, 1))
    drawn = []
    for estimator in members[0].axes.filters:
        values = np.full((len(y), len(x)), np.nan)
        for member in members:
            column, row = (np.searchsorted(a, float(member.swept[i][1])) for i, a in ((0, x), (1, y)))
            values[row, column] = last_locks(made, member, estimator)["lock_rate"]
        marks = (Heat(x, y, values, tr("share locked")),)
        across, up = (Axis(_called(key, members[0])) for key in keys)
        drawn.append(Panel(across, up, marks, estimator))
    drawn.append(region(keys, members, made, x, y))
    first, second = (panels.key_label(members[0], key).text for key in keys)
    caption = tr(
        "Share of bursts locked at the end, over the {first} and the {second}, of {count:,} in each "
        "cell. Last: the largest {second} up to which the whole 95 % interval of that share lies above "
        "{sure:g}; an estimator without a line reaches this nowhere.",
        first=first,
        second=second,
        count=members[0].count,
        sure=SURE,
    )
    columns = min(2, len(drawn))
    figure = Figure(name, tr("Where the sequence locks"), caption, tuple(drawn), columns, PAGE_MM, 70.0)
    return figure


def region(keys: tuple[str, ...], members: Sequence[CaseResult], made: Mapping, x: np.ndarray, y: np.ndarray) -> Panel:
    """The border of where lock is sure: for each value of the first key the largest of the second."""
    marks = []
    for n, estimator in enumerate(members[0].axes.filters):
        sure = np.zeros((len(y), len(x)), dtype=bool)
        for member in members:
            column, row = (np.searchsorted(a, float(member.swept[i][1])) for i, a in ((0, x), (1, y)))
            sure[row, column] = last_locks(made, member, estimator)["lock_lo"] >= SURE
        reach = np.minimum.accumulate(sure, axis=0).sum(axis=0)
        border = np.where(reach > 0, y[np.maximum(reach, 1) - 1], np.nan)
        marks.append(Line(x, border, estimator, Style(n, n % 4, n)))
    across, up = (
        Axis(_called(key, members[0]), "log" if a.min() > 0 else "linear") for key, a in zip(keys, (x, y), strict=True)
    )
    return Panel(across, up, tuple(marks), tr("locked in over {sure:g}", sure=SURE), direct=False)
