"""P2's figures: the flight (1-4), σ of height and its rate (5, 6), probabilities (7), families × rules, cost,
consistency."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language import listed, numeral, term, tr
from radarsim.report import panels, seen, tables, wording
from radarsim.report.drawing import PAGE_MM, Axis, Figure, Heat, Line, Note, Panel, Reference, Style
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
SPREAD = 0.5  # of the points of a stage, stages being one apart
ACROSS, ACROSS_NARROW = 60, 28  # letters across a panel of two in a row, and of three
MOST_LOOKS = 8  # filters, each of a colour, dash and marker of its own
DRAWN_FROM = {"families": ("stages",), "cost": ("stages", "operations")}


def figures(
    results: Sequence[CaseResult], made: "Mapping[str, pd.DataFrame]", experiment: Experiment
) -> dict[str, Figure]:
    """All figures that these results can fill, by name; each shows the cases that the config names for it."""

    def chosen(name: str) -> list[CaseResult]:
        return panels.shown(results, panels.named(experiment, name))[0]

    drawn: dict[str, Figure | None] = {}
    for component in SIGMAS:
        drawn[f"sigma_{component}"] = sigma(chosen(f"sigma_{component}"), made["curves"], component)
    drawn["trajectory"] = trajectory(chosen("trajectory"))
    drawn["probabilities"] = probabilities(chosen("probabilities"), made["probabilities"])
    drawn["families"] = families(chosen("families"), made)
    drawn["cost"] = cost(chosen("cost"), made)
    drawn["consistency"] = consistency(chosen("consistency"), made["consistency"])
    return {name: figure for name, figure in drawn.items() if figure is not None}


def _several(name: str, title: str, caption: str, drawn: Sequence[Panel], height: float = 62.0) -> Figure | None:
    """A figure of one panel, or of more in two columns, in three where that fills the page better."""
    if not drawn:
        return None
    width = panels.WIDE_MM if len(drawn) == 1 else PAGE_MM
    columns = 1 if len(drawn) == 1 else 3 if len(drawn) in (3, 5, 6, 9, 12) else 2
    return Figure(name, title, caption, tuple(drawn), columns, width, height)


def _many(result: CaseResult) -> bool:
    """Whether a case has more filters than there are looks."""
    return len(result.axes.filters) > MOST_LOOKS


def _styles(result: CaseResult) -> list[Style]:
    """A look for each filter of a case: its own where there are few, else the rule's colour and the family's marks."""
    options = result.spec.filters
    if not _many(result):
        return [Style(n, n, n) for n in range(len(options))]
    families = list(dict.fromkeys(of.family for of in options))
    marks = [families.index(of.family) for of in options]
    return [Style(RULES.index(of.merge), mark, mark) for of, mark in zip(options, marks, strict=True)]


def _keys(result: CaseResult, **look: Any) -> tuple[tuple[str, Style], ...]:
    """What the looks of many filters say: colours of rules, marks of families; look: how they differ from _styles."""
    styled = list(zip(result.spec.filters, _styles(result), strict=True))
    rules = {of.merge: replace(style, dash=0, marker=None, width_pt=4.0, flat=True) for of, style in styled}
    families = {of.family: replace(style, colour=0) for of, style in styled}
    named = [(rule.replace("_", " "), style) for rule, style in rules.items()]
    named += [(tr(FAMILIES.get(family, family)), style) for family, style in families.items()]
    marked = {tr(FAMILIES.get(family, family)) for family in families}
    return tuple((label, replace(style, **look) if label in marked else style) for label, style in named)


def _beside(drawn: Sequence[Panel], result: CaseResult, **look: Any) -> list[Panel]:
    """Panels with one legend in a cell of its own; look: see `_keys`."""
    made = panels.in_legend(drawn)
    if _many(result):
        made[-1] = replace(made[-1], keys=_keys(result, **look))
    return made


def _title(result: CaseResult, results: Sequence[CaseResult]) -> str:
    """What tells a case from the others shown: the swept values where one config is swept, else its label."""
    if len(results) == 1:
        return ""
    one = len(panels.families(results)) == 1
    if not one:
        return panels.label(result).replace("_", " ")
    return ", ".join(_value(result, key, value) for key, value in result.swept)


def _value(result: CaseResult, key: str, value: object) -> str:
    """A swept value: a number with its symbol and unit, a choice as it is called."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return f"{panels.symbol_of(result, key)} = {panels.with_its_unit(result, key, value)}"
    return panels.with_its_unit(result, key, value)


def trajectory(results: Sequence["CaseResult[FlightAxes]"]) -> Figure | None:
    """Ground track, height, speed and acceleration (the paper's figures 1 to 4), a line for each different flight."""
    flights: dict[bytes, CaseResult] = {}
    for result in results:
        flights.setdefault(np.ascontiguousarray(result.axes.truth).tobytes(), result)
    lines: list[list[Line]] = [[], [], [], []]
    for n, result in enumerate(flights.values()):
        x, t = result.axes.truth, np.asarray(result.axes.t_s, dtype=float)
        words, style = _title(result, results) if len(flights) > 1 else "", Style(n, n)
        speed, acceleration = (np.linalg.norm(x[:, i::3], axis=1) for i in (1, 2))
        lines[0].append(Line(x[:, 6] / 1e3, x[:, 0] / 1e3, words, style))
        for place, values in ((1, x[:, 3] / 1e3), (2, speed), (3, acceleration)):
            lines[place].append(Line(t, values, words, style))
    ends = _stage_lines(list(flights.values()))
    axes = (
        (Axis(tr("east $z$, km")), Axis(tr("north $x$, km")), tr("1  ground track"), ()),
        (panels.time_axis(), Axis(tr("height $y$, km"), limits=(0, None)), tr("2  height"), ends),
        (panels.time_axis(), Axis(tr("speed, m/s"), limits=(0, None)), tr("3  speed"), ends),
        (panels.time_axis(), Axis(tr("acceleration, m/s²"), limits=(0, None)), tr("4  acceleration"), ends),
    )
    lines[1:] = [_unnamed(own) for own in lines[1:]]
    drawn = [
        Panel(x, y, (*marks, *own), title, direct=False) for (x, y, title, marks), own in zip(axes, lines, strict=True)
    ]
    drawn[0] = replace(drawn[0], marks=(*drawn[0].marks, *_landmarks(lines[0])), equal=True)
    track, (height, *_), (acceleration, *_) = lines[0][0], lines[1], lines[3]
    far = np.hypot(track.x, track.y)
    caption = tr(
        "{name}: ground range from {begin:.0f} to {end:.0f} km, height up to {height:.0f} km, "
        "acceleration up to {acceleration:.0f} m/s². ",
        **{
            "name": track.name or track.label or panels.plain_label(results[0]),
            "begin": float(far[0]),
            "end": float(far[-1]),
        },
        **{"height": float(height.y.max()), "acceleration": float(acceleration.y.max())},
    ) + tr(
        "The true flight: the ground track from its start, at one scale "
        "north and east, with the radar at the origin. Dotted: ends of the stages."
    )
    caption += _stages_said(drawn, results)
    return _of_the_paper(_several("trajectory", tr("Flight"), caption, drawn, 56), results, "1 … 4")


def _landmarks(tracks: Sequence[Line]) -> list[Line | Note]:
    """The radar, and where each track begins and which way it goes."""
    radar = Line(np.zeros(1), np.zeros(1), "", Style(0, None, 1, size_pt=5.0), name=tr("radar"))
    marks: list[Line | Note] = [radar, Note(0.0, 0.0, tr("radar"), "ne")]
    for track in tracks:
        start = Line(
            track.x[:1], track.y[:1], "", replace(track.style, dash=None, marker=0, size_pt=5.0), name=tr("start")
        )
        third = len(track.x) // 3
        marks += [start, Note(float(track.x[third]), float(track.y[third]), _arrow(track, third), "se")]
    marks.append(Note(float(tracks[0].x[0]), float(tracks[0].y[0]), tr("start"), "ne"))
    return marks


def _arrow(track: Line, at: int) -> str:
    """An arrow of the eight winds along a track at a place, east to the right, north up."""
    ahead = min(at + max(1, len(track.x) // 50), len(track.x) - 1)
    turn = np.arctan2(track.y[ahead] - track.y[at], track.x[ahead] - track.x[at])
    return "→↗↑↖←↙↓↘"[round(float(turn) / (np.pi / 4)) % 8]


def _stage_lines(results: Sequence[CaseResult], letters: int = ACROSS) -> tuple[Reference | Note, ...]:
    """The ends of the stages, and the names of all that are long enough, where all cases have the same."""
    if len({result.spec.target.stages for result in results}) > 1:
        return ()
    stages, last = results[0].spec.target.stages, max(float(result.axes.t_s[-1]) for result in results)
    ends = [float(stage.end_s) for stage in stages[:-1]]
    if not ends:
        return ()
    marks: list[Reference | Note] = [Reference(end, "x") for end in ends]
    for stage, (begin, end) in zip(stages, pairwise([0.0, *ends, last]), strict=True):
        if wording.letters_in(name := tr(stage.name)) <= letters * (end - begin) / last:
            marks.append(Note((begin + end) / 2, np.nan, name, "top"))
    return tuple(marks)


def _stages_said(drawn: Sequence[Panel], results: Sequence[CaseResult]) -> str:
    """The stages in order, for a caption, where a panel has no room for all their names; else empty."""
    stages = {result.spec.target.stages for result in results}
    named = [sum(isinstance(mark, Note) and mark.place == "top" for mark in panel.marks) for panel in drawn]
    (only,) = stages if len(stages) == 1 else ((),)
    if len(only) < 2 or min(filter(None, named), default=0) >= len(only):
        return ""
    return " " + tr("Stages in order: {names}.", names=listed([tr(stage.name) for stage in only]))


def sigma(results: Sequence[CaseResult], curves: "pd.DataFrame", component: str) -> Figure | None:
    """σ of height or climb against time on a logarithmic scale (figures 5 and 6), a panel for each case."""
    rows = tables.groups(curves[curves["component"] == component], "case", "filter")
    quantity, symbol, unit = SIGMAS[component]
    drawn = []
    for result in results:
        marks: list = list(_stage_lines([result], ACROSS if len(results) == 1 else ACROSS_NARROW))
        for f, style in zip(result.axes.filters, _styles(result), strict=True):
            own = rows.get((result.name, f))
            if own is not None:
                marks.append(panels.line(own, panels.SIGMA[:4], panels.literal(f), replace(style, marker=None)))
        y = Axis(panels.sigma_of(symbol, unit), "log")
        drawn.append(Panel(panels.time_axis(), y, tuple(marks), _title(result, results), direct=len(results) == 1))
    if len(drawn) > 1:
        drawn = _beside(drawn, results[0], marker=None)
    elif drawn and _many(results[0]):
        (panel,) = drawn
        keys = _keys(results[0], marker=None)
        drawn = [replace(panel, marks=tuple(_unnamed(panel.marks)), keys=keys, direct=False, legend="right")]
    caption = tr(
        "Root-mean-square error of {quantity} about the truth, of {count:,} realisations; bands: 95 % "
        "intervals. Dotted: ends of the stages.",
        quantity=quantity,
        count=results[0].count if results else 0,
    ) + _stages_said(drawn, results)
    figure = _several(f"sigma_{component}", tr("σ of {quantity}", quantity=quantity), caption, drawn, 76)
    if figure is None:
        return None
    figure = figure
    return _of_the_paper(figure, results, {"y": "5", "vy": "6"}[component])


def _of_the_paper(figure: Figure | None, results: Sequence[CaseResult], number: str) -> Figure | None:
    """The figure with its number in the paper, where it is of the paper's own experiment."""
    own = figure is not None and all(result.name == "multimodel" for result in results)
    return seen.with_figure_number(figure, number) if figure and own else figure


def probabilities(results: Sequence[CaseResult], table: "pd.DataFrame") -> Figure | None:
    """Mean probabilities of the models against time (figure 7), a panel for each filter of two or more models."""
    rows = tables.groups(table, "case", "filter", "model")
    drawn: list[Panel] = []
    for result in results:
        for name, options in zip(result.axes.filters, result.spec.filters, strict=True):
            if len(options.models) < 2:
                continue
            marks: list = list(
                _stage_lines([result], ACROSS if len(result.axes.filters) < MOST_LOOKS else ACROSS_NARROW)
            )
            for m, motion in enumerate(_motions(options.models)):
                columns = ("t_s", "probability", "probability_lo", "probability_hi")
                own = rows[(result.name, name, m + 1)]
                marks.append(panels.line(own, columns, f"{m + 1} {motion}", Style(m, m)))
            title = panels.literal(name) if len(results) == 1 else f"{_title(result, results)}: {panels.literal(name)}"
            drawn.append(
                Panel(
                    panels.time_axis(), Axis(tr("mean probability"), limits=(0, 1)), tuple(marks), title, direct=False
                )
            )
    banks = {tuple(mark.label for mark in panel.marks if isinstance(mark, Line)) for panel in drawn}
    titles = [panel.title for panel in drawn]
    left = panels.left_out(titles, panels.spread_out(titles, panels.MOST_PANELS))
    drawn = panels.spread_out(drawn, panels.MOST_PANELS)
    if len(drawn) > 2 and len(banks) == 1:
        drawn = panels.in_legend(drawn)
    caption = (
        tr(
            "Mean posterior probabilities of the models; the numbers after the motions are the spreads of "
            "the random acceleration, m/s². Dotted: ends of the stages."
        )
        + _stages_said(drawn, results)
        + left
    )
    return _of_the_paper(_several("probabilities", tr("Probabilities of the models"), caption, drawn, 58), results, "7")


def families(results: Sequence[CaseResult], made: Mapping) -> Figure | None:
    """σ of the height by family and merging rule, a map for each stage; needs at least two of each."""
    drawn = []
    rows = tables.groups(tables.where(made["stages"], component="y"), "case", "stage")
    for result in results:
        found = {
            (options.family, options.merge): name
            for name, options in zip(result.axes.filters, result.spec.filters, strict=True)
            if options.family in FAMILIES
        }
        names = [[found.get((family, rule)) for rule in RULES] for family in FAMILIES]
        if sum(any(row) for row in names) < 2 or sum(any(column) for column in zip(*names, strict=True)) < 2:
            continue
        for (case, stage), own in rows.items():
            if case != result.name:
                continue
            value = own.set_index("filter")["sigma"]
            grid = np.array([[value.get(name, np.nan) for name in row] for row in names], dtype=float)
            x = Axis(tr("merging rule"), ticks=tuple((i, rule.replace("_", "\n")) for i, rule in enumerate(RULES)))
            y = Axis(tr("family"), ticks=tuple(enumerate(map(tr, FAMILIES.values()))))
            title = ": ".join(filter(None, (_title(result, results), tr(str(stage)))))
            drawn.append(Panel(x, y, (Heat(np.arange(4), np.arange(3), grid, panels.sigma_of("$y$", "m")),), title))
    caption = tr(
        "σ of the height over each stage, by family and rule of the partial merges; one bank, one set of plots."
    )
    titles = [panel.title for panel in drawn]
    caption += panels.left_out(titles, panels.spread_out(titles, panels.MOST_PANELS))
    drawn = panels.spread_out(drawn, panels.MOST_PANELS)
    return _several("families", tr("Families and merging rules"), caption, drawn, 52)


def cost(results: Sequence[CaseResult], made: Mapping) -> Figure | None:
    """Operations per update against σ of the height, a panel for each stage of the first case shown."""
    if not results:
        return None
    result = results[0]
    operations = tables.groups(made["operations"], "case", "stage", "filter")
    rows = tables.where(made["stages"], case=result.name, component="y")
    drawn = []
    most = made["operations"].loc[made["operations"]["case"] == result.name, "operations"].max()
    styles = dict(zip(result.axes.filters, _styles(result), strict=True))
    for stage, own in rows.groupby("stage", sort=False):
        marks = []
        for _, row in own.iterrows():
            style = replace(styles[row["filter"]], dash=None, size_pt=4.5)
            count = operations[(result.name, stage, row["filter"])]["operations"].to_numpy(float)
            lo, hi, value = (np.array([row[key]]) for key in ("sigma_lo", "sigma_hi", "sigma"))
            marks.append(Line(count, value, panels.literal(row["filter"]), style, lo, hi))
        x = Axis(tr("operations per update"), limits=(0, 1.06 * float(most)))
        y = Axis(panels.sigma_of("$y$", "m"), "log")
        drawn.append(Panel(x, y, tuple(marks), tr(str(stage)), direct=False))
    points = [mark for mark in drawn[-1].marks if isinstance(mark, Line)]
    fewest, good = min(float(one.x[0]) for one in points), min(points, key=lambda one: float(one.y[0]))
    cheap = listed([one.label for one in points if float(one.x[0]) == fewest])
    told = tr(
        "Fewest operations: {cheap} ({count:.0f}); least σ, {stage}: {good} ({sigma} m). ",
        **{"cheap": cheap, "count": fewest, "stage": drawn[-1].title},
        **{"good": good.label, "sigma": wording.number(float(good.y[0]), 3)},
    )
    drawn = _beside(drawn, result, dash=None)
    caption = told + tr(
        "Accuracy against cost: σ of the height over a stage (whiskers: 95 %) and the mean count of "
        "arithmetic operations of one update.{of_case}",
        of_case=_of_case(result, results),
    )
    return _several("cost", tr("Cost and accuracy"), caption, drawn, 62)


def _motions(models: Sequence) -> list[str]:
    """What each model of a bank is, in the language spoken: its motion and the spread in m/s²."""
    return [f"{tr(MOTIONS[model.motion])} {numeral(f'{model.sigma_acceleration_mps2:g}')}" for model in models]


MOTIONS = {"uniform": term("uniform"), "accelerated": term("accelerated"), "still": term("still")}


def _of_case(result: CaseResult, results: Sequence[CaseResult]) -> str:
    """A sentence on which of several cases is shown."""
    return (
        tr(" For {plain_label}; the other cases are only in the tables.", plain_label=panels.plain_label(result))
        if len(results) > 1
        else ""
    )


def _unnamed(lines: Sequence) -> list:
    """The same marks without a legend of their own."""
    return [replace(line, label="", name=line.name or line.label) if isinstance(line, Line) else line for line in lines]


def consistency(results: Sequence[CaseResult], table: "pd.DataFrame") -> Figure | None:
    """NEES and NIS per degree of freedom by stage of the first case shown, a line of points for each filter."""
    if not results:
        return None
    result = results[0]
    rows = tables.groups(table[table["case"] == result.name], "filter")
    drawn = []
    for key, title in (("nees", tr("NEES of the position")), ("nis", tr("NIS of the plot"))):
        marks: list = [Reference(1.0)]
        stages: tuple = ()
        for n, (f, style) in enumerate(zip(result.axes.filters, _styles(result), strict=True)):
            own = rows[(f,)]
            stages = tuple(tr(str(stage)) for stage in own["stage"])
            x = np.arange(len(own)) + SPREAD / len(result.axes.filters) * (n - (len(result.axes.filters) - 1) / 2)
            columns = ("x", key, f"{key}_lo", f"{key}_hi")
            marks.append(panels.line(own.assign(x=x), columns, panels.literal(f), replace(style, dash=None)))
        axis = Axis(tr("stage"), ticks=tuple(enumerate(stages)))
        drawn.append(Panel(axis, Axis(tr("mean per degree of freedom"), "log"), tuple(marks), title, direct=False))
    drawn = _beside(drawn, result, dash=None)
    caption = tr(
        "Normalised squared errors per degree of freedom, by stage: 1 where the filter's own covariance "
        "is correct, more where it is optimistic, less where it is pessimistic.{of_case}",
        of_case=_of_case(result, results),
    )
    return _several("consistency", tr("Consistency of the filters"), caption, drawn, 66)
