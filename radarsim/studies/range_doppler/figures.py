"""P1's figures: 1a to 3b of the paper, steady error against settling, and what the filters believe of themselves."""

import math
from collections.abc import Mapping, Sequence
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.language import tr
from radarsim.report import panels, seen, tables, wording
from radarsim.report.drawing import GREY, Axis, Figure, Line, Note, Panel, Reference, Style
from radarsim.report.quantities import RADIAL
from radarsim.report.scales import Scale
from radarsim.report.wording import spoken
from radarsim.studies.range_doppler.tables import PERIODS, Result

if TYPE_CHECKING:
    import pandas as pd

DRAWN_FROM = {"settling": ("steady",)}


OF_THE_PAPER = "range_doppler"  # the config whose figures show what the paper's show
NUMBERS = {
    **{"sigma_r": "1a", "gain_r": "1b", "sigma_Vr": "2a", "gain_Vr": "2b"},
    **{"sigma_ar": "3a", "gain_ar": "3b"},
}


def figures(results: Sequence[Result], made: "Mapping[str, pd.DataFrame]", experiment: Experiment) -> dict[str, Figure]:
    """sigma_r … gain_ar (the paper's figures 1a … 3b), and `settling` where the manoeuvre variance is swept."""
    drawn = panels.per_component(results, made, RADIAL, experiment)
    if experiment.stem == OF_THE_PAPER:
        drawn |= {name: seen.with_figure_number(drawn[name], NUMBERS[name]) for name in drawn if name in NUMBERS}
    some = [result for result in results if result.name in set(panels.named(experiment, "settling"))]
    figure = settling_figure(some, made["steady"])
    drawn |= {"settling": figure} if figure else {}
    some, left_out = panels.shown_families(panels.unswept(results), panels.named(experiment, "consistency"))
    drawn |= {"consistency": consistency_figure(some, made["consistency"], left_out)} if some else {}
    return {name: one for name, one in drawn.items() if one}


def consistency_figure(results: Sequence[Result], table: "pd.DataFrame", left_out: str) -> Figure:
    """NEES per component against time: a panel for each radar or swept value, of several radars for each filter."""
    rows = tables.groups(table, "case", "filter")
    if len(results) == 1 or any(result.swept for result in results):
        nees = {(*key, "nees"): own for key, own in rows.items()}
        drawn = panels.nees_panels(results, nees)
    else:
        names = list(dict.fromkeys(name for result in results for name in result.axes.filters))
        drawn = [_consistency_panel(results, rows, name) for name in names]
    return panels.nees_figure(drawn, left_out)


BEST = 7  # marker of the best manoeuvre variance
ROOM = 1.5  # above and below all points of a logarithmic axis, as a factor
LETTER, HIGH, TOUCHING = 0.031, 0.09, 0.02  # of a label, as shares of a panel; how near points share one
MOST_NAMED = 2  # cases that are named at the ends of lines in half a page


def _consistency_panel(results: Sequence[Result], rows: dict[Any, Any], name: str) -> Panel:
    marks: list = [Reference(1)]
    for i, result in enumerate(results):
        if (result.name, name) in rows:
            marks.append(panels.line(rows[result.name, name], ("t_s", "nees"), panels.label(result), i))
    y, title = panels.fitting_axis(tr(panels.NEES), marks), panels.literal(name)
    return Panel(panels.time_axis(), y, tuple(marks), title, direct=len(results) <= MOST_NAMED)


def settling_figure(results: Sequence[Result], table: "pd.DataFrame") -> Figure | None:
    """Steady σ of the range against its settling time over D_M, with the ten-period line and the best D_M named."""
    rows = table[table["component"] == "r"]
    drawn: list[Panel] = []
    steady = rows[np.isfinite(rows["settling_s"])]["steady_sigma"]
    up = float(steady.min()) / ROOM, float(steady.max()) * ROOM
    for title, members in panels.by_panel(results, np.inf).items():
        own = rows[rows["case"].isin([r.name for r in members])].drop_duplicates(["filter", "manoeuvre_variance"])
        if own["manoeuvre_variance"].nunique() > 1:
            drawn.append(_settling_panel(title, members[0], own, up))
    titles = [panel.title for panel in drawn]
    drawn = panels.spread_out(drawn, panels.MOST_PANELS)
    if not drawn:
        return None
    caption = _best_settled(drawn) + tr(
        "Steady σ of the range against its settling time, both exact (within 5 % of the steady value, "
        "for good); grey lines join equal manoeuvre variances D_M, labelled in (m/s³)². Dotted: ten scan "
        "periods, the paper's limit; star: the least steady error within it. Filters that do not settle "
        "within the run are named and left out."
    )
    caption += panels.left_out(titles, [panel.title for panel in drawn])
    return panels.in_columns(Figure("settling", tr("Steady error against settling time"), caption, tuple(drawn)))


def _best_settled(drawn: Sequence[Panel]) -> str:
    """The least steady error within the paper's limit, of all panels."""
    stars = [
        (mark, panel)
        for panel in drawn
        for mark in panel.marks
        if isinstance(mark, Line) and len(mark.y) and mark.style.marker == BEST
    ]
    if not stars:
        return tr("Nothing settles within {periods} scan periods. ", periods=PERIODS)
    star, panel = min(stars, key=lambda pair: float(pair[0].y[0]))
    name = ", ".join(filter(None, (panel.title, star.name)))
    return tr(
        "Least steady σ within {periods} scan periods: {sigma} m ({name}). ",
        **{"periods": PERIODS, "sigma": wording.number(float(star.y[0]), 3), "name": spoken(name)},
    )


def _settling_panel(title: str, result: Result, rows: "pd.DataFrame", up: tuple[float, float]) -> Panel:
    """rows: of one radar and the range, one for each filter and manoeuvre variance; up: limits of the axis of y."""
    settled = rows[np.isfinite(rows["settling_s"])]
    limit = PERIODS * result.axes.scan_period_s
    longest = max([limit, *settled["settling_s"]])
    across = -0.04 * longest, 1.15 * longest
    marks: list = [Reference(limit, "x")]
    points: list[tuple[float, float, str]] = []
    for variance, same in settled.sort_values("steady_sigma").groupby("manoeuvre_variance"):
        t, sigma = same["settling_s"].to_numpy(), same["steady_sigma"].to_numpy()
        marks.append(Line(t, sigma, "", Style(GREY, 0, width_pt=0.5)))
        points.append((float(t[-1]), float(sigma[-1]), panels.number(float(variance), powers=True)))
    marks += _labels(points, limit, Scale(False, *across, 0.0, 1.0), Scale(True, *up, 0.0, 1.0))
    keys = []
    for n, name in enumerate(result.axes.filters):
        own = settled[settled["filter"] == name].sort_values("manoeuvre_variance")
        best, style = own[own["best"]], Style(n, n, n)
        words, star = panels.literal(name), Style(n, None, BEST, size_pt=8)
        marks.append(Line(own["settling_s"].to_numpy(), own["steady_sigma"].to_numpy(), "", style, name=words))
        at = best["settling_s"].to_numpy(), best["steady_sigma"].to_numpy()
        marks.append(Line(*at, "", star, name=tr("{words}: best $D_M$", words=words)))
        keys.append((panels.literal(name), style))
    keys += [
        (tr("best $D_M$"), Style(0, None, BEST, size_pt=8)),
        (tr("{periods} scan periods", periods=PERIODS), Style(GREY, 2, width_pt=0.7)),
    ]
    x = Axis(tr("settling time of $\\sigma$ of $r$, s"), limits=across)
    y, words = Axis(tr("steady $\\sigma$ of $r$, m"), "log", up), tr("at the points: $D_M$, (m/s³)²")
    remark = _not_settled(rows[~np.isfinite(rows["settling_s"])])
    return Panel(x, y, tuple(marks), title, tuple(keys), words, direct=False, remark=remark)


def _labels(points: Sequence[tuple[float, float, str]], limit: float, x: Scale, y: Scale) -> list[Note]:
    """Labels of points (x, y, words), at their right or their left: as few as possible meet a label, curve or limit.
    Points at one place share a label."""
    joined: list[tuple[float, float, str]] = []
    for t, sigma, words in sorted(points):
        if joined and math.dist(*((x.position(u), y.position(v)) for u, v, *_ in ((t, sigma), joined[-1]))) < TOUCHING:
            joined[-1] = (*joined[-1][:2], f"{joined[-1][2]}, {words}")
        else:
            joined.append((t, sigma, words))
    line = (float(x.position(limit)),) * 2 + (0.0, 1.0)  # left, right, lower and upper edge, as shares of the panel
    ways: list[tuple[float, list[Note], tuple[float, ...]]] = [(0.0, [], (-1.0,) * 4)]  # the best, by the last label
    before = 0.0, 0.0
    for t, sigma, words in joined:
        u, v, wide = float(x.position(t)), float(y.position(sigma)), LETTER * len(words)
        steep = (before[1] - v) * wide > TOUCHING * (u - before[0])  # a curve that falls from the left is in the way
        own = ("ne", (u, u + wide, v, v + HIGH), 0.0), ("nw", (u - wide, u, v, v + HIGH), steep + 0.1 + 9 * (u < wide))
        ways = [
            min(
                (
                    (cost + more + _meet(box, line) / 2 + _meet(box, last), [*notes, Note(t, sigma, words, place)], box)
                    for cost, notes, last in ways
                ),
                key=itemgetter(0),
            )
            for place, box, more in own
        ]
        before = u, v
    return min(ways, key=itemgetter(0))[1]


def _meet(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    """Whether two boxes have a place in common."""
    return a[0] <= b[1] and b[0] <= a[1] and a[2] <= b[3] and b[2] <= a[3]


def _not_settled(rows: "pd.DataFrame") -> str:
    """Words on the manoeuvre variances that do not settle within the run: a line for each."""
    found = [
        (panels.number(same["manoeuvre_variance"].iloc[0], powers=True), panels.literal(", ".join(same["filter"])))
        for _, same in rows.groupby("manoeuvre_variance")
    ]
    return "\n".join(
        tr("{variance} ({names}): not settled", variance=variance, names=names) for variance, names in found
    )
