"""The figures of what Doppler gains: over time, in the long run, and over radars."""

import math
from collections.abc import Sequence
from functools import cache

import numpy as np

from radarsim.language.numerals import numeral
from radarsim.language.translate import term, tr
from radarsim.report import key_labels
from radarsim.report.drawing.model import COLUMN_MM, PAGE_MM, Axis, Figure, Line, Mark, Note, Panel, Reference, Style
from radarsim.report.wording import significant_digits
from radarsim.studies.range_doppler import closed_form, error_recursion, filter_design, steady_state
from radarsim.studies.range_doppler.error_recursion import Plots
from radarsim.studies.range_doppler.radar_on_chart import RadarOnChart

NAMES = (term("range"), term("radial velocity"), term("radial acceleration"))
LINE_C_VALUES = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)  # of c
SCANS_PER_TIME = 40  # scans in the shorter of τ₁ and τ₂: the limit to a quarter of a point
SETTLED_MEMORIES = 12  # of τ₂, after which both filters are steady to a thousandth
EARLIEST, LATEST = 0.1, 30.0  # of t/τ₁ that is shown
LEVELS = (0, 20, 40, 60, 80)  # of the map, per cent
FIRST_LEVEL_LAMBDA, LEVEL_LAMBDA_FACTOR = (
    5e-3,
    0.45,
)  # Λ of the lowest level's number, and the factor to that of the next
MAP_C_THETA, MAP_LAMBDA = np.geomspace(1e-2, 1e4, 49), np.geomspace(1e-4, 10.0, 26)


@cache
def limit_course(c: float) -> tuple[np.ndarray, np.ndarray]:
    """t/τ₁ (n,) and gains (n, 3) by the recursion with scans so dense that the period no longer matters. After SETTLED
    memories the steady values stand."""
    tau_2 = 1 / np.sqrt(c)  # τ₁ = 1, σ_r = 1
    dt = min(1.0, tau_2) / SCANS_PER_TIME
    scans = int(min(SETTLED_MEMORIES * max(tau_2, 1.0), LATEST) / dt) + 2
    sigma, x = np.array([1.0, 1.0]), np.zeros((scans, 3))
    errors = []
    for observes, start in ((1, 3), (2, 2)):
        design = filter_design.design(observes, start, tau_2**-6, sigma, dt, scans)
        _, S = error_recursion.error_recursion(design, Plots(sigma), x, dt)
        errors.append(np.sqrt(np.diagonal(S, axis1=1, axis2=2)))
    t, gain = np.arange(3, scans) * dt, 100 * (1 - errors[1][3:] / errors[0][3:])
    samples = np.unique(np.searchsorted(t, np.geomspace(EARLIEST, t[-1], 120)).clip(0, len(t) - 1))
    t, gain = t[samples], gain[samples]
    return np.append(t, LATEST) if t[-1] < LATEST else t, np.vstack([gain, gain[-1]]) if t[-1] < LATEST else gain


def gain_against_time_figure(places: Sequence[RadarOnChart]) -> Figure:
    """Gains against t/τ₁: a line for each c, the radars' own scans as markers."""
    courses = [limit_course(c) for c in LINE_C_VALUES]
    figure_panels = []
    for i, name in enumerate(NAMES):
        marks: list[Mark] = [Reference(0.0)]
        for n, (c, (t, gain)) in enumerate(zip(LINE_C_VALUES, courses, strict=True)):
            style = Style(n / (len(LINE_C_VALUES) - 1), 0)
            marks.append(Line(t, gain[:, i], numeral(f"{c:g}"), style, name=f"c = {numeral(f'{c:g}')}"))
        for n, place in enumerate(places):
            marks.append(Line(place.t_s / place.tau_1_s, place.gain[:, i], "", Style(n + 1, None, n), name=place.name))
        y = Axis(key_labels.label_with_unit(tr("gain"), "%"), limits=(-30, 100))
        x = Axis("$t/\\tau_1$", "log", (EARLIEST, LATEST))
        keys = tuple(_key(n, place) for n, place in enumerate(places)) if i == 0 else ()
        figure_panels.append(
            Panel(x, y, tuple(marks), tr(name), keys, legend="lower left", remark="$c$ =" if i == 0 else "")
        )
    caption = tr(
        "From c of about 0.7 on, the larger c, the more of the first gain lasts. Gain in the RMS error versus time "
        "in units of τ₁ = σ_r/σ_V, for lines of c = (τ₁/τ₂)², as the scan period becomes short (drawn with {fine} "
        "scans in the shorter of τ₁ and τ₂). Markers: exact gains at the scans of real radars, whose period is not "
        "short.",
        fine=SCANS_PER_TIME,
    )
    return Figure(
        "gain_against_time", tr("What Doppler gains over time"), caption, tuple(figure_panels), 3, PAGE_MM, 66
    )


def _key(n: int, place: RadarOnChart) -> tuple[str, Style]:
    words = f"{key_labels.escape_dollars(place.name)}: $c$ = {significant_digits(place.groups.c, '.2g')}"
    return words, Style(n + 1, None, n)


def steady_gain_figure(user_places: Sequence[RadarOnChart], reference_places: Sequence[RadarOnChart]) -> Figure:
    """Steady gains against c: the closed form as lines, radars as markers at their exact gains."""
    c = np.geomspace(0.03, 300.0, 200)
    marks: list[Mark] = [Reference(0.0)]
    for i, (name, gain) in enumerate(zip(NAMES, closed_form.steady_gains(c), strict=True)):
        marks.append(Line(c, gain, tr(name), Style(i + 1, i)))
    places = [*user_places, *reference_places]
    for n, place in enumerate(places):
        size = 6.0 if n < len(user_places) else 3.4
        for i in range(3):
            style = Style(i + 1, None, n, size_pt=size)
            marks.append(Line(np.array([place.groups.c]), place.exact_gain[i : i + 1], "", style, name=place.name))
    for group in _group_by_c(places):
        top = max(group, key=lambda place: place.exact_gain.max())
        marks.append(Note(top.groups.c, float(top.exact_gain.max()), "\n".join(place.name for place in group), "nw"))
    marks.append(Reference(closed_form.no_acceleration_gain(), "x", f"$c$ = {numeral('0.698')}"))
    caption = tr(
        "Left of c = 0.698 Doppler makes the acceleration estimate of a non-manoeuvring target worse; right of it "
        "everything gains, the more the larger c. Steady gain of the velocity versus c = (τ₁/τ₂)². Lines: closed "
        "form in the limit of a short period. Markers: the exact steady gain of a radar with its own period (large: "
        "yours)."
    )
    x = Axis("$c = (\\tau_1/\\tau_2)^2$", "log", (0.03, 300))
    panel = Panel(x, Axis(tr("steady gain, %"), limits=(-15, 100)), tuple(marks), tr("In the long run"))
    return Figure("steady_gain", tr("What Doppler gains in the long run"), caption, (panel,), 1, 1.6 * COLUMN_MM, 90)


def _group_by_c(places: Sequence[RadarOnChart]) -> list[list[RadarOnChart]]:
    """Radars whose c is the same to a tenth, which are named together."""
    groups: list[list[RadarOnChart]] = []
    for place in sorted(places, key=lambda radar: radar.groups.c):
        if groups and place.groups.c < 1.1 * groups[-1][0].groups.c:
            groups[-1].append(place)
        else:
            groups.append([place])
    return groups


@cache
def map_gains() -> np.ndarray:
    """Exact steady gains (3, Λ, C_θ) over the map."""
    C_theta, Lambda = (part.ravel() for part in np.meshgrid(MAP_C_THETA, MAP_LAMBDA))
    return steady_state.exact_gains(C_theta, Lambda).reshape(3, len(MAP_LAMBDA), len(MAP_C_THETA))


def gain_map_figure(user_places: Sequence[RadarOnChart], reference_places: Sequence[RadarOnChart]) -> Figure:
    """Lines of equal steady gain over C_θ and Λ: exact, and dashed as the period becomes short."""
    figure_panels, x = [], np.log(MAP_C_THETA)
    for i, name in enumerate(NAMES):
        marks: list[Mark] = []
        for level in LEVELS:
            exact_line = np.array([_last_crossing(x, row, level) for row in map_gains()[i]])
            style = Style(level / LEVELS[-1], 0)
            marks.append(Line(np.exp(exact_line), MAP_LAMBDA, "", style, name=f"{level} %"))
            limit = _closed_form_crossing(i, level) / MAP_LAMBDA ** (2 / 3)
            inside = (limit > MAP_C_THETA[0]) & (limit < MAP_C_THETA[-1])
            faint = Style(level / LEVELS[-1], 2, width_pt=0.6)
            marks.append(
                Line(
                    np.where(inside, limit, np.nan),
                    MAP_LAMBDA,
                    "",
                    faint,
                    name=tr("{level} %, short period", level=level),
                )
            )
            marks += _level_note(exact_line, level)
        keys = []
        for n, place in enumerate([*user_places, *reference_places]):
            style = Style(0, None, n, size_pt=6.0 if n < len(user_places) else 3.4)
            marks.append(
                Line(np.array([place.groups.C_theta]), np.array([place.groups.Lambda]), "", style, name=place.name)
            )
            keys.append((key_labels.escape_dollars(place.name), style))
        limits = (float(MAP_C_THETA[0]), float(MAP_C_THETA[-1]))
        rows = (float(MAP_LAMBDA[0]), float(MAP_LAMBDA[-1]))
        x_axis = Axis(f"$C_\\theta = (\\tau_1/\\Delta t)^2$\n{tr('velocity coarse ← → fine')}", "log", limits)
        y_axis = Axis(f"{tr('scan period short ← → long')}\n$\\Lambda = (\\Delta t/\\tau_2)^3$", "log", rows)
        figure_panels.append(Panel(x_axis, y_axis, tuple(marks), tr(name), tuple(keys) if i == 0 else ()))
    caption = tr(
        "The limit of a short period is valid where Λ is small; above, a long period changes the gain. "
        "Steady gain of the velocity, in per cent along the lines, over C_θ = (τ₁/Δt)² and Λ = (Δt/τ₂)³. "
        "Full lines: exact, with the scan period included. Dotted: the limit of a short period, c = C_θ "
        "Λ^(2/3)."
    )
    return Figure("map", tr("What Doppler gains, by period too"), caption, tuple(figure_panels), 3, PAGE_MM, 66, True)


def _level_note(log_C_thetas: np.ndarray, level: int) -> list[Mark]:
    """The level written on its line, lower than the last so that neighbours stand apart; else at a third of it."""
    inside, rows = np.isfinite(log_C_thetas), np.log(MAP_LAMBDA)
    if not inside.any():
        return []
    preferred_row = math.log(FIRST_LEVEL_LAMBDA) + LEVELS.index(level) * math.log(LEVEL_LAMBDA_FACTOR)
    row = preferred_row if rows[inside][0] < preferred_row else float(np.quantile(rows[inside], 1 / 3))
    log_C_theta = float(np.interp(row, rows[inside], log_C_thetas[inside]))
    return [Note(math.exp(log_C_theta), math.exp(row), f"{level} %", "on")]


def _last_crossing(x: np.ndarray, gain: np.ndarray, level: float) -> float:
    """Where a gain (n,) over x (n,) rises through a level for the last time, linear between; not-a-number: nowhere."""
    rising = np.flatnonzero((gain[:-1] < level) & (gain[1:] >= level))
    if not len(rising):
        return np.nan
    i = rising[-1]
    return float(x[i] + (level - gain[i]) / (gain[i + 1] - gain[i]) * (x[i + 1] - x[i]))


@cache
def _closed_form_crossing(component: int, level: float) -> float:
    """The c at which a steady gain in closed form rises through a level."""
    c = np.geomspace(1e-3, 1e7, 4001)
    return float(np.exp(_last_crossing(np.log(c), closed_form.steady_gains(c)[component], level)))
