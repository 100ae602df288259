"""One chart for every radar: what the velocity gains over time and in the long run, and where a radar lies on it."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.language import listed, numeral, term, tr
from radarsim.report import html, panels, tables
from radarsim.report.drawing import COLUMN_MM, PAGE_MM, Axis, Chart, Figure, Line, Mark, Note, Panel, Reference, Style
from radarsim.report.wording import in_a_row, significant_digits
from radarsim.studies.range_doppler import filters
from radarsim.studies.range_doppler.filters import Plots
from radarsim.studies.range_doppler.study import COMPONENTS, RangeDopplerAxes, prepare

if TYPE_CHECKING:
    import pandas as pd

NAMES = (term("range"), term("radial velocity"), term("radial acceleration"))
LINES = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0)  # of c
FINE = 40  # scans in the shorter of τ₁ and τ₂: the limit to a quarter of a point
SETTLED = 12  # of τ₂, after which both filters are steady to a thousandth
EARLIEST, LATEST = 0.1, 30.0  # of t/τ₁ that is shown
LEVELS = (0, 20, 40, 60, 80)  # of the map, per cent
LEVEL_AT, LEVEL_APART = 5e-3, 0.45  # Λ of the lowest level's number, and the factor to that of the next
MAP_C_THETA, MAP_LAMBDA = np.geomspace(1e-2, 1e4, 49), np.geomspace(1e-4, 10.0, 26)


@dataclass(frozen=True)
class Place:
    """Where a case lies: its numbers, its steady gains (3,) exactly and as the period shrinks, its course over time.

    inputs are σ_r (m), σ_V (m/s), Δt (s), D_M ((m/s³)²). t_s (n,) and gain (n, 3), per cent, belong to the scans at
    which both filters have all estimates."""

    name: str
    inputs: tuple[float, float, float, float]
    tau_1_s: float
    tau_2_s: float
    of: filters.Groups
    exact: np.ndarray
    limit: np.ndarray
    t_s: np.ndarray
    gain: np.ndarray


def chart(cases: Sequence[Case], references: Sequence[Case]) -> Chart:
    """The figures, the table, a sentence for each case, and the live page; references are marked as well."""
    known = [place for case in references if (place := placed(case)) is not None]
    of_others = {place.name: place.inputs for place in known}
    found = [(case, placed(case)) for case in cases]
    for i, (case, place) in enumerate(found):
        if place is not None and of_others.get(place.name, place.inputs) != place.inputs:  # an edited radar of theirs
            found[i] = case, replace(place, name=tr("{name}, as set", name=place.name))
    own = [place for _, place in found if place is not None]
    known = [place for place in known if all(place.of != one.of for one in own)]
    drawn = [over_time(own or known), in_the_long_run(own, known), over_groups(own, known)]
    without = tr("not on the chart: it needs one filter of range and one of range and velocity")
    sentences = [
        f"{case.name}: {without}" if place is None else sentence(place) + beyond(place) + aside(case)
        for case, place in found
    ]
    sentences = sentences or [sentence(place) for place in known]
    return Chart({figure.name: figure for figure in drawn}, table([*own, *known]), tuple(sentences), page(own, known))


def placed(case: Case) -> Place | None:
    """Where a case lies, by its first filter of the range and its first of range and velocity; None without both."""
    axes: RangeDopplerAxes = prepare(case).axes
    shipped = np.array([form != "" for form in axes.process_noise])  # not of a package
    kinds = [np.flatnonzero(shipped & (axes.observes == observes)) for observes in (1, 2)]
    if not all(len(kind) for kind in kinds):
        return None
    base, own = (int(kind[0]) for kind in kinds)
    variance = float(axes.manoeuvre_variance[own])
    sigma_r, sigma_V = map(float, axes.sigma)
    inputs = (sigma_r, sigma_V, axes.scan_period_s, variance)
    tau_1, tau_2 = sigma_r / sigma_V, filters.filter_memory(sigma_r, variance)
    of = filters.groups(*inputs)
    both = np.flatnonzero((axes.available[base] & axes.available[own]).all(axis=1))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = axes.exact_sigma[own, both] / axes.exact_sigma[base, both]
    gain = axes.exact_gains[own, both] if base == axes.baseline else 100 * (1 - ratio)
    errors = [
        filters.steady_state(observes, float(axes.manoeuvre_variance[f]), axes.sigma, axes.scan_period_s)[1]
        for observes, f in ((1, base), (2, own))
    ]
    exactly = 100 * (1 - np.sqrt(np.diag(errors[1]) / np.diag(errors[0])))
    limit = filters.steady_gains(of.c)
    return Place(case.name, inputs, tau_1, tau_2, of, exactly, limit, axes.t_s[both], gain)


def sentence(place: Place) -> str:
    """Where a radar lies, and what the velocity does for it in the long run."""
    r, V, a = (round(float(gain), 1) for gain in place.exact)
    c, last = significant_digits(place.of.c, ".2g"), place.gain[-1]
    verbs = [
        tr("takes {size:g} % off the range", size=r) if r >= 0 else tr("adds {size:g} % to the range", size=-r),
        tr("adds {size:g} % to the velocity", size=-V) if V < 0 else tr("{size:g} % off the velocity", size=V),
    ]
    if r < 0 <= V:
        verbs[1] = tr("takes {size:g} % off the velocity", size=V)
    gained = tr("the acceleration gains {size:g} %", size=a)
    acceleration = gained if a >= 0 else tr("the acceleration loses {size:g} %", size=-a)
    away = significant_digits(float(np.abs(place.exact - place.limit).max()), ".2g")
    period = place.inputs[2]
    return tr(
        "{name}: in the long run Doppler {verbs}; {acceleration} (c = {c}, τ₁ = {tau_1:.3g} s, τ₂ = {tau_2:.3g} s). "
        "At its last scan, {t_s:g} s: {gains} %. With Δt/τ₁ = {first:.2g} and Δt/τ₂ = {second:.2g} the curve of short "
        "periods is up to {away} points off.",
        name=place.name,
        c=c,
        tau_1=place.tau_1_s,
        tau_2=place.tau_2_s,
        verbs=listed(verbs),
        acceleration=acceleration,
        t_s=float(place.t_s[-1]),
        gains=in_a_row(significant_digits(float(g), ".3g") for g in last),
        first=period / place.tau_1_s,
        second=period / place.tau_2_s,
        away=away,
    )


def beyond(place: Place) -> str:
    """That the closed form is not promised where a radar lies, as a further sentence; nothing where it is."""
    if place.of.c <= filters.LARGEST:
        return ""
    off = float(np.abs(place.exact - corrected(place)).max())
    away = tr("here it is {away} points off", away=significant_digits(off, ".2g"))
    return tr(
        " Beyond c = 50 000 the closed form may be inaccurate even with the correction for the period: "
        "{how}; the gains above are exact.",
        how=away if np.isfinite(off) else tr("here it has no value"),
    )


def corrected(place: Place) -> np.ndarray:
    """The closed form's steady gains (3,) with the first order of the period."""
    return filters.steady_gains(place.of.c, place.inputs[2] / place.tau_2_s)


def aside(case: Case) -> str:
    """What the chart ignores of a case, as a further sentence; nothing where there is nothing."""
    left = [] if case.spec.radar.as_the_papers else [tr("missed plots and biases")]
    left += [] if case.spec.target.kind == "polynomial" else [tr("the target's manoeuvre")]
    usual = {getattr(one, "process_noise", "random_jerk") for one in case.spec.filters} == {"random_jerk"}
    left += [] if usual else [tr("another process noise")]
    return tr(" Not included in the long-run values: {what}.", what=", ".join(left)) if left else ""


def table(places: Sequence[Place]) -> "pd.DataFrame":
    """chart.csv: of each case and component the steady gain, exact and in closed form, and what it depends on."""
    names = [name for name, _ in COMPONENTS]
    count = len(names)
    with_period = [corrected(place) for place in places]
    columns: dict[str, Any] = {
        "case": np.repeat(np.array([p.name for p in places], dtype=object), count),
        "component": names * len(places),
    }
    columns |= {"tau_1_s": np.repeat([p.tau_1_s for p in places], count)}
    columns |= {"tau_2_s": np.repeat([p.tau_2_s for p in places], count)}
    columns |= dict(zip(filters.Groups._fields, np.repeat([p.of for p in places], count, axis=0).T, strict=True))
    return tables.frame(
        columns
        | {
            "steady_gain_percent": np.concatenate([p.exact for p in places]),
            "limit_percent": np.concatenate([p.limit for p in places]),
            "corrected_percent": np.concatenate(with_period),
        }
    )


# ---- figures ---------------------------------------------------------------------------------------------------------
@cache
def limit_course(c: float) -> tuple[np.ndarray, np.ndarray]:
    """t/τ₁ (n,) and gains (n, 3) by the recursion with scans so dense that the period no longer matters. After SETTLED
    memories the steady values stand."""
    tau_2 = 1 / np.sqrt(c)  # τ₁ = 1, σ_r = 1
    dt = min(1.0, tau_2) / FINE
    scans = int(min(SETTLED * max(tau_2, 1.0), LATEST) / dt) + 2
    sigma, x = np.array([1.0, 1.0]), np.zeros((scans, 3))
    errors = []
    for observes, start in ((1, 3), (2, 2)):
        design = filters.design(observes, start, tau_2**-6, sigma, dt, scans)
        _, S = filters.error_recursion(design, Plots(sigma), x, dt)
        errors.append(np.sqrt(np.diagonal(S, axis1=1, axis2=2)))
    t, gain = np.arange(3, scans) * dt, 100 * (1 - errors[1][3:] / errors[0][3:])
    shown = np.unique(np.searchsorted(t, np.geomspace(EARLIEST, t[-1], 120)).clip(0, len(t) - 1))
    t, gain = t[shown], gain[shown]
    return np.append(t, LATEST) if t[-1] < LATEST else t, np.vstack([gain, gain[-1]]) if t[-1] < LATEST else gain


def over_time(places: Sequence[Place]) -> Figure:
    """Gains against t/τ₁: a line for each c, the radars' own scans as markers."""
    courses = [limit_course(c) for c in LINES]
    made = []
    for i, name in enumerate(NAMES):
        marks: list[Mark] = [Reference(0.0)]
        for n, (c, (t, gain)) in enumerate(zip(LINES, courses, strict=True)):
            style = Style(n / (len(LINES) - 1), 0)
            marks.append(Line(t, gain[:, i], numeral(f"{c:g}"), style, name=f"c = {numeral(f'{c:g}')}"))
        for n, one in enumerate(places):
            marks.append(Line(one.t_s / one.tau_1_s, one.gain[:, i], "", Style(n + 1, None, n), name=one.name))
        y = Axis(panels.with_unit(tr("gain"), "%"), limits=(-30, 100))
        x = Axis("$t/\\tau_1$", "log", (EARLIEST, LATEST))
        keys = tuple(_key(n, one) for n, one in enumerate(places)) if i == 0 else ()
        made.append(Panel(x, y, tuple(marks), tr(name), keys, legend="lower left", remark="$c$ =" if i == 0 else ""))
    caption = tr(
        "From c of about 0.7 on, the larger c, the more of the first gain lasts. Gain in σ against time in units "
        "of τ₁ = σ_r/σ_V, for lines of c = (τ₁/τ₂)², as the scan period becomes short (drawn with {fine} scans in the "
        "shorter of τ₁ and τ₂). Markers: exact gains at the scans of real radars, whose period is not short.",
        fine=FINE,
    )
    return Figure("gain_against_time", tr("What Doppler gains over time"), caption, tuple(made), 3, PAGE_MM, 66)


def _key(n: int, one: Place) -> tuple[str, Style]:
    words = f"{panels.literal(one.name)}: $c$ = {significant_digits(one.of.c, '.2g')}"
    return words, Style(n + 1, None, n)


def in_the_long_run(own: Sequence[Place], known: Sequence[Place]) -> Figure:
    """Steady gains against c: the closed form as lines, radars as markers at their exact gains."""
    c = np.geomspace(0.03, 300.0, 200)
    marks: list[Mark] = [Reference(0.0)]
    for i, (name, gain) in enumerate(zip(NAMES, filters.steady_gains(c), strict=True)):
        marks.append(Line(c, gain, tr(name), Style(i + 1, i)))
    places = [*own, *known]
    for n, one in enumerate(places):
        size = 6.0 if n < len(own) else 3.4
        for i in range(3):
            style = Style(i + 1, None, n, size_pt=size)
            marks.append(Line(np.array([one.of.c]), one.exact[i : i + 1], "", style, name=one.name))
    for group in _together(places):
        top = max(group, key=lambda one: one.exact.max())
        marks.append(Note(top.of.c, float(top.exact.max()), "\n".join(one.name for one in group), "nw"))
    marks.append(Reference(filters.no_acceleration_gain(), "x", f"$c$ = {numeral('0.698')}"))
    caption = tr(
        "Left of c = 0.698 Doppler makes the acceleration estimate of a non-manoeuvring target worse; "
        "right of it everything gains, the more the larger c. Steady gain of the velocity against c = "
        "(τ₁/τ₂)². Lines: closed form in the limit of a short period. Markers: the exact steady gain of "
        "a radar with its own period (large: yours)."
    )
    x = Axis("$c = (\\tau_1/\\tau_2)^2$", "log", (0.03, 300))
    panel = Panel(x, Axis(tr("steady gain, %"), limits=(-15, 100)), tuple(marks), tr("In the long run"))
    return Figure("steady_gain", tr("What Doppler gains in the long run"), caption, (panel,), 1, 1.6 * COLUMN_MM, 90)


def _together(places: Sequence[Place]) -> list[list[Place]]:
    """Radars whose c is the same to a tenth, which are named together."""
    groups: list[list[Place]] = []
    for one in sorted(places, key=lambda place: place.of.c):
        if groups and one.of.c < 1.1 * groups[-1][0].of.c:
            groups[-1].append(one)
        else:
            groups.append([one])
    return groups


@cache
def map_gains() -> np.ndarray:
    """Exact steady gains (3, Λ, C_θ) over the map."""
    C_theta, Lambda = (part.ravel() for part in np.meshgrid(MAP_C_THETA, MAP_LAMBDA))
    return filters.exact_gains(C_theta, Lambda).reshape(3, len(MAP_LAMBDA), len(MAP_C_THETA))


def over_groups(own: Sequence[Place], known: Sequence[Place]) -> Figure:
    """Lines of equal steady gain over C_θ and Λ: exact, and dashed as the period becomes short."""
    made, x = [], np.log(MAP_C_THETA)
    for i, name in enumerate(NAMES):
        marks: list[Mark] = []
        for level in LEVELS:
            exactly = np.array([_last_crossing(x, row, level) for row in map_gains()[i]])
            style = Style(level / LEVELS[-1], 0)
            marks.append(Line(np.exp(exactly), MAP_LAMBDA, "", style, name=f"{level} %"))
            limit = _limit_of(i, level) / MAP_LAMBDA ** (2 / 3)
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
            marks += _level_note(exactly, level)
        keys = []
        for n, one in enumerate([*own, *known]):
            style = Style(0, None, n, size_pt=6.0 if n < len(own) else 3.4)
            marks.append(Line(np.array([one.of.C_theta]), np.array([one.of.Lambda]), "", style, name=one.name))
            keys.append((panels.literal(one.name), style))
        limits = (float(MAP_C_THETA[0]), float(MAP_C_THETA[-1]))
        rows = (float(MAP_LAMBDA[0]), float(MAP_LAMBDA[-1]))
        across = Axis(f"$C_\\theta = (\\tau_1/\\Delta t)^2$\n{tr('velocity coarse ← → fine')}", "log", limits)
        up = Axis(f"{tr('scan period short ← → long')}\n$\\Lambda = (\\Delta t/\\tau_2)^3$", "log", rows)
        made.append(Panel(across, up, tuple(marks), tr(name), tuple(keys) if i == 0 else ()))
    caption = tr(
        "The limit of a short period is valid where Λ is small; above, a long period changes the gain. "
        "Steady gain of the velocity, in per cent along the lines, over C_θ = (τ₁/Δt)² and Λ = (Δt/τ₂)³. "
        "Full lines: exact, with the scan period included. Dotted: the limit of a short period, c = C_θ "
        "Λ^(2/3)."
    )
    return Figure("map", tr("What Doppler gains, by period too"), caption, tuple(made), 3, PAGE_MM, 66, True)


def _level_note(places: np.ndarray, level: int) -> list[Mark]:
    """The level written on its line, lower than the last so that neighbours stand apart; else at a third of it."""
    inside, rows = np.isfinite(places), np.log(MAP_LAMBDA)
    if not inside.any():
        return []
    wanted = math.log(LEVEL_AT) + LEVELS.index(level) * math.log(LEVEL_APART)
    row = wanted if rows[inside][0] < wanted else float(np.quantile(rows[inside], 1 / 3))
    at = float(np.interp(row, rows[inside], places[inside]))
    return [Note(math.exp(at), math.exp(row), f"{level} %", "on")]


def _last_crossing(x: np.ndarray, gain: np.ndarray, level: float) -> float:
    """Where a gain (n,) over x (n,) rises through a level for the last time, linear between; not-a-number: nowhere."""
    rising = np.flatnonzero((gain[:-1] < level) & (gain[1:] >= level))
    if not len(rising):
        return np.nan
    i = rising[-1]
    return float(x[i] + (level - gain[i]) / (gain[i + 1] - gain[i]) * (x[i + 1] - x[i]))


@cache
def _limit_of(component: int, level: float) -> float:
    """The c at which a steady gain in closed form rises through a level."""
    c = np.geomspace(1e-3, 1e7, 4001)
    return float(np.exp(_last_crossing(np.log(c), filters.steady_gains(c)[component], level)))


# ---- the live page ---------------------------------------------------------------------------------------------------
def page(own: Sequence[Place], known: Sequence[Place]) -> str:
    """The live page: one's own radars first, then those that are known, as settings to begin from."""
    data = [dict(zip(("name", "r", "v", "dt", "dm"), (one.name, *one.inputs), strict=True)) for one in [*own, *known]]
    parts = [resources.files(__package__).joinpath("live", name).read_text(encoding="utf-8") for name in LIVE]
    return html.live_page(tr("What Doppler gains for a radar"), parts, json.dumps(data), SAID)


LIVE = ("body.html.j2", "style.css", "script.js")
SAID = (  # by the page's script
    *(term("range"), term("velocity"), term("acceleration"), term("time, s"), term("Scan {k}, {t} s: {values}")),
    *(term("takes {size} % off the range"), term("adds {size} % to the range")),
    *(
        term("{size} % off the velocity"),
        term("takes {size} % off the velocity"),
        term("adds {size} % to the velocity"),
    ),
    *(term("the acceleration gains {size} %"), term("the acceleration loses {size} %"), term("from {low} to {high}")),
    term("At scan {k}, {t} s, Doppler {range} and {velocity}; {acceleration} (c = {c}, τ₁ = {one} s, τ₂ = {two} s)."),
)
