"""The report of tracks over recorded plots: one self-contained page, and its figures as files: plan view and range,
estimates, residuals, innovations, probabilities. Its sentences: rows, gaps, errors, stated accuracies, advice.

Whether the stated accuracies fit is judged by the filters' own innovations. For a consistent filter the squares of the
innovations, divided by their predicted variance, average 1 for each degree of freedom (NIS). Larger: the plots are
worse than stated, or the target manoeuvres more than the filter assumes; smaller: they are better."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np

from radarsim.config.document import SHIPPED
from radarsim.config.experiment import Case, Experiment
from radarsim.engine.results import Track
from radarsim.errors import ConfigError
from radarsim.language import few, listed, plural, power_of_ten, term, tr
from radarsim.recorded import fit
from radarsim.recorded.fit import Advice, Asked, Finding
from radarsim.recorded.follow import Followed, Tally, recorded_of
from radarsim.recorded.plots import Places
from radarsim.report import panels
from radarsim.report.drawing import COLUMN_MM, GREY, PAGE_MM, Axis, Figure, Line, Note, Panel, Reference, Style
from radarsim.report.statistics import Z95, normalised_bounds
from radarsim.report.wording import labelled, number, significant_digits
from radarsim.report.wording import unit as unit_of
from radarsim.studies.interface import BIAS, CORRELATION, OUTLIERS

# ---- figures ---------------------------------------------------------------------------------------------------------
PLOT = Style(GREY, None, 0, size_pt=1.6)
BOUND = Style(GREY, 1, width_pt=0.8)
RADAR = Style(0, None, 2, size_pt=5.0)
MOST_FILTERS = 8
MOST_TRACKS = 8  # with a colour of their own; more are grey
MOST_RESIDUALS = 9  # panels of residuals
MOST_DOTS = 300  # of a filter in a panel of residuals
WINDOW = 15  # innovations in a mean over time
TALL_MM, USUAL_MM = 74.0, 52.0  # of a panel: of a plan view, of others
TICKS = (0.01, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 100.0, 1000.0)  # of a mean NIS
FAR_M = 2e4  # distance from which a plan view uses km


def figures(followed: Followed) -> dict[str, Figure]:
    """`track`, `plan`, `residuals`, `nis` and `probabilities`, as far as available, described; by name. Of several
    tracks the plots of all and the estimates of the longest."""
    ways = {name: one.places for name, one in followed.tracks.items()} or {"": followed.places}
    order = sorted(ways, key=lambda name: ways[name] is not followed.places)
    track = followed.drawn
    assert track is not None  # a file without rows is refused
    drawn = {
        "track": estimates(track),
        "plan": plan(track, {name: ways[name] for name in order}),
        "residuals": residuals(track),
        "nis": innovations(track),
        "probabilities": probabilities(track),
    }
    return {name: panels.joined(figure) for name, figure in drawn.items() if figure is not None}


def _called(name: object) -> str:
    return tr("track {number}", number=name)


def _keys(track: Track) -> list[tuple[str, Style]]:
    return [(panels.literal(name), Style(f, f)) for f, name in enumerate(track.filters[:MOST_FILTERS])]


def _time() -> Axis:
    return Axis(tr("time, s"))


def _several(name: str, title: str, caption: str, made: list[Panel], keys: Sequence[tuple[str, Style]] = ()) -> Figure:
    """A figure of panels with their legend, if there are keys, in a cell of its own."""
    made = [*made, *([Panel(_time(), _time(), (), keys=tuple(keys))] if keys else [])]
    columns = min(2 if len(made) == 4 else 3, len(made))
    return Figure(name, title, caption, tuple(made), columns, PAGE_MM if columns > 1 else COLUMN_MM, USUAL_MM)


def _usual(values: np.ndarray) -> tuple[float | None, float | None]:
    """Limits for the usual values: the range of 99 % of them and 30 % more, so that the start does not dominate."""
    known = values[np.isfinite(values)]
    if known.size < 50:
        return None, None
    low, high = np.quantile(known, [0.005, 0.995])
    pad = 0.3 * (high - low)
    return (float(low - pad), float(high + pad)) if pad else (None, None)


# ---- where ----------------------------------------------------------------------------------------------------------
def plan(track: Track, paths: Mapping[str, Places]) -> Figure | None:
    """Plan view with equal units, the radar at the origin, and the range over time; None where no range is known."""
    own = [path for path in _drawn_paths(track, paths) if len(path.t_s)]
    if not own:
        return None
    places = np.concatenate([path.places for path in own])
    far = np.nanmax(np.abs(places)) > FAR_M
    unit, size = ("km", 1e3) if far else ("m", 1.0)
    styles = [Style(i if i < MOST_TRACKS else GREY, None, 0, size_pt=1.6) for i in range(len(own))]
    names = [panels.literal(name) for name in paths]
    several = len(own) > 1
    over_time = [
        Line(path.t_s, path.places[:, 2] / size, "", style, name=_called(name) if several else tr("plots"))
        for path, style, name in zip(own, styles, names, strict=False)
    ]
    made = [Panel(_time(), Axis(tr("range, {unit}", unit=unit)), tuple(over_time), tr("Range"), direct=False)]
    if np.isfinite(places[:, :2]).all(axis=1).any():
        marks: list = [
            Line(path.places[:, 1] / size, path.places[:, 0] / size, "", style, name=line.name)
            for path, style, line in zip(own, styles, over_time, strict=True)
        ]
        marks.append(Line(np.zeros(1), np.zeros(1), "", RADAR, name=tr("radar")))
        marks += (ends := _ends(own[0], size))
        east, north = Axis(tr("east, {unit}", unit=unit)), Axis(tr("north, {unit}", unit=unit))
        made.insert(0, Panel(east, north, tuple(marks), tr("Plan view"), direct=False, equal=True))
    keys = [(_called(name), style) for name, style in zip(names[:MOST_TRACKS], styles, strict=False)]
    if len(own) > MOST_TRACKS:
        keys.append((tr("{count} more", count=len(own) - MOST_TRACKS), styles[-1]))
    if several:
        made.append(Panel(_time(), _time(), (), keys=((tr("radar"), RADAR), *keys)))
    if len(made) > 1 + several:
        caption = tr("Positions of the plots. Triangle: the radar.")
        caption += " " + tr("Start and end of the longest track with their times.") if ends else ""
        caption += " " + tr("Where a file has no heights, slant range replaces ground range.")
    else:
        caption = tr("The range of the plots over time; the file does not give their bearing.")
    columns = min(len(made), 2)
    width = PAGE_MM if columns > 1 else COLUMN_MM
    return Figure("plan", tr("Positions"), caption, tuple(made), columns, width, TALL_MM)


def _drawn_paths(track: Track, paths: Mapping[str, Places]) -> list[Places]:
    """The places of the plots; for a single track whose file has angles of an antenna, its own coordinates."""
    names = [name for name, _ in track.components]
    if len(paths) == 1 and {"x", "y", "z"} <= set(names) and track.residual is not None:
        (path,) = paths.values()
        if not np.isfinite(path.places[:, :2]).any():
            at = track.estimate[..., [names.index(axis) for axis in "xyz"]] + track.residual
            f = int(np.isfinite(at).all(axis=2).sum(axis=1).argmax())
            there = np.isfinite(at[f]).all(axis=1)
            x, y, z = at[f, there].T
            return [Places(track.t_s[there], np.stack([x, z, np.sqrt(x**2 + y**2 + z**2)], axis=1))]
    return list(paths.values())


def _ends(path: Places, size: float) -> list:
    """Labels at the first and the last place of a track, on the side away from the track; none at plots of which
    several have one time, as among false ones: they are no track."""
    known = np.flatnonzero(np.isfinite(path.places[:, :2]).all(axis=1))
    if not known.size or (np.diff(path.t_s[known]) == 0).any():
        return []
    made, third = [], max(len(known) // 3, 1)  # its direction at an end is that of the nearest third
    ends = ((known[0], known[min(third, len(known) - 1)], tr("start")), (known[-1], known[-third], tr("end")))
    for i, inner, what in ends:
        north, east = path.places[i, :2] - path.places[inner, :2]
        place = ("s" if north >= 0 else "n") + ("e" if east >= 0 else "w")
        words = tr("{what}, {t_s:g} s", what=what, t_s=path.t_s[i])
        made.append(Note(path.places[i, 1] / size, path.places[i, 0] / size, words, place))
    return made


# ---- estimates and their errors --------------------------------------------------------------------------------------
def estimates(track: Track) -> Figure:
    """A panel for each component: the filters' estimates with their standard deviations, and the plots."""
    made, every = [], max(1, len(track.components) // max(1, len(track.measured)))
    for c, (component, own_unit) in enumerate(track.components):
        marks: list = []
        factor, unit = panels.in_degrees(own_unit)
        d, is_value = divmod(c, every)
        if track.residual is not None and is_value == 0 and d < len(track.measured):
            plots = track.residual[..., d] + track.estimate[..., c]  # the same for every filter that has an estimate
            first, known = np.isfinite(plots).argmax(axis=0), np.isfinite(plots).any(axis=0)
            plots = plots[first, np.arange(plots.shape[1])]
            marks.append(Line(track.t_s[known], factor * plots[known], "", PLOT, name=tr("plots")))
        for f, name in enumerate(track.filters[:MOST_FILTERS]):
            x, half = factor * track.estimate[f, :, c], factor * Z95 * track.sigma[f, :, c]
            if np.isfinite(x).any():
                label = panels.literal(name)
                marks.append(Line(track.t_s, x, "", Style(f, f), x - half, x + half, name=label))
        if marks:
            y = Axis(panels.with_unit(panels.letter(component), unit), limits=_usual(factor * track.estimate[..., c]))
            made.append(Panel(_time(), y, tuple(marks), direct=False))
    caption = tr(
        "Estimates over the recorded plots; bands: twice each filter's own standard deviation (95 % if "
        "the filter is consistent)."
    )
    return _several("track", tr("Track"), caption, made, [(tr("plots"), PLOT), *_keys(track)])


def residuals(track: Track) -> Figure | None:
    """Plot minus estimate, a panel for each filter and each measured number, between its ± 2 σ bounds."""
    if track.residual is None:
        return None
    made: list[Panel] = []
    fitting = max(MOST_RESIDUALS // len(track.measured), 1)
    for f, filter_name in enumerate(track.filters[:fitting]):
        for d, (name, own_unit) in enumerate(track.measured):
            factor, unit = panels.in_degrees(own_unit)
            known = np.flatnonzero(np.isfinite(track.residual[f, :, d]))
            if not known.size:
                continue
            known = known[:: -(-known.size // MOST_DOTS)]
            t, miss = track.t_s[known], factor * track.residual[f, known, d]
            marks: list = [Reference(0.0), Line(t, miss, "", Style(f, None, 0, size_pt=1.8), name=tr("plots"))]
            if track.residual_sigma is not None and np.isfinite(track.residual_sigma[f, known, d]).any():
                bound = 2 * factor * track.residual_sigma[f, known, d]
                marks += [Line(t, bound, "", BOUND, name="± 2 σ"), Line(t, -bound, "", BOUND, name="± 2 σ")]
            of = tr("residual of {measured}", measured=name.rpartition("_")[0])
            axis = Axis(panels.with_unit(of, unit), limits=_usual(miss))
            made.append(Panel(_time(), axis, tuple(marks), panels.literal(filter_name), direct=False))
    caption = tr(
        "Difference of each plot from the estimate after it. Dashed: twice the filter's own standard "
        "deviation of that difference; 95 % of the plots lie between if the filter is consistent."
    )
    if (filters := len(track.filters)) > fitting:
        caption += tr(" The first {fitting} of {filters} filters are drawn.", fitting=fitting, filters=filters)
    return _several("residuals", tr("Residuals"), caption, made) if made else None


def innovations(track: Track) -> Figure | None:
    """The mean of the normalised innovations squared over the last WINDOW plots, a panel for each test."""
    if track.nis is None:
        return None
    made: list[Panel] = []
    for q, (name, freedom) in enumerate(track.tested):
        marks: list = [Reference(1.0)]
        low, high = normalised_bounds(WINDOW * freedom)
        for f, filter_name in enumerate(track.filters[:MOST_FILTERS]):
            known = np.flatnonzero(np.isfinite(track.nis[f, :, q]))
            if len(known) < WINDOW:
                continue
            sums = np.cumsum(np.append(0.0, track.nis[f, known, q])) / (WINDOW * freedom)
            t, mean = track.t_s[known[WINDOW - 1 :]], sums[WINDOW:] - sums[:-WINDOW]
            marks.append(Line(t, mean, "", Style(f, f), name=panels.literal(filter_name)))
        if len(marks) > 1:
            ends = np.array([marks[1].x[0], max(line.x[-1] for line in marks[1:])])
            marks += [Line(ends, np.full(2, value), "", BOUND, name=tr("bounds")) for value in (low, high)]
            values = np.concatenate([line.y for line in marks[1:]])
            ticks = tuple((at, f"{at:g}") for at in TICKS if values.min() <= at <= values.max())
            y = Axis(tr("mean NIS"), "log", ticks=ticks)
            made.append(Panel(_time(), y, tuple(marks), panels.literal(name), direct=False))
    caption = tr(
        "Normalised innovation squared, averaged over {window} plots: 1 for a consistent filter, whose "
        "averages lie between the dashed bounds in 95 % of cases. Above: plots worse than stated, or a "
        "manoeuvre.",
        window=WINDOW,
    )
    keys = [*_keys(track), (tr("bounds"), BOUND)]
    return _several("nis", tr("Innovations"), caption, made, keys) if made else None


def probabilities(track: Track) -> Figure | None:
    """Probabilities of the models, a panel for each multiple-model filter."""
    if track.probability is None:
        return None
    made = []
    for f, name in enumerate(track.filters):
        known = np.isfinite(track.probability[f]).any(axis=0)
        if known.sum() > 1:
            marks = tuple(
                Line(track.t_s, track.probability[f, :, m], tr("model {number}", number=m + 1), Style(m, m))
                for m in np.flatnonzero(known).tolist()
            )
            y = Axis(tr("probability"), limits=(0, 1))
            made.append(Panel(_time(), y, marks, panels.literal(name), direct=False))
    caption = tr("Probabilities of each filter's models, in the order of the config.")
    return _several("probabilities", tr("Probabilities of the models"), caption, made[: panels.MOST]) if made else None


# ---- accuracy --------------------------------------------------------------------------------------------------------
LEAST_TESTS = 10  # below which there is no verdict
FITS, SMALL, LARGE, UNKNOWN = term("fits"), term("too small"), term("too large"), term("too few plots")
LOST, DOUBT = term("fold lost"), term("too small?")


@dataclass(frozen=True)
class Judged:
    """One test: filter, measured number, mean NIS with its bounds for a consistent filter, verdict."""

    filter: str
    name: str
    tests: int
    nis: float
    lo: float
    hi: float
    verdict: str


def judged(followed: Followed) -> list[Judged]:
    """Every filter's tests."""
    found = [_judge(tally) for tally in followed.tallies.values()]
    return [replace(one, verdict=_of_folds(followed.case, one, found)) for one in found]


def _judge(tally: Tally) -> Judged:
    """The verdict at 95 %."""
    lo, hi = map(float, normalised_bounds(max(tally.count * tally.freedom, 1)))
    verdict = SMALL if tally.mean > hi else LARGE if tally.mean < lo else FITS
    if tally.count < LEAST_TESTS:
        verdict = UNKNOWN
    return Judged(tally.filter, tally.name, tally.count, tally.mean, lo, hi, verdict)


def _of_folds(case: Case, one: Judged, every: Sequence[Judged]) -> str:
    """The verdict of a test, that of a filter that decides the folds by itself in the light of what others say."""
    of = recorded_of(case)
    folds = {member.name for member in case.spec.members if of.unfolds(member)}
    if one.verdict != SMALL or one.filter not in folds:
        return one.verdict
    return LOST if any(other.name == one.name and other.verdict in (FITS, LARGE) for other in every) else DOUBT


# ---- words -----------------------------------------------------------------------------------------------------------
DOUBTLESS = 6  # power of ten from which a ratio of likelihoods says no more than that one model is wrong
EQUAL = 1e-6  # of the log-likelihood: below it two filters are one
CLEAR = 3.0  # of the log-likelihood, twenty times: from there on one filter is clearly the best


def verdict(followed: Followed, judged: Sequence[Judged], advised: Advice | None) -> list[str]:
    """The best filter and the changes advised, by the likelihood; where that is not known, the consistent filters."""
    return consistent(judged) if advised is None else likely(followed, advised)


def rows(followed: Followed) -> list[str]:
    """Numbers of rows and tracks, time covered, missing values, and the gaps."""
    said: list[tuple[str, str]] = []
    span, first = followed.last_s - followed.first_s, followed.first_s
    rows = counted(followed.rows)
    said.append(("plots", tr("{rows} over {span:g} s, from {first:g} s", rows=rows, span=span, first=first)))
    if followed.tracks:
        longest = counted(max(one.rows for one in followed.tracks.values()))
        said.append(("tracks", tr("{count}, the longest of {rows}", count=len(followed.tracks), rows=longest)))
    if followed.passed_over:
        said.append(("passed", tr("{rows} outside any track", rows=counted(followed.passed_over))))
    if followed.again:
        words = plural("{count} track number", "{count} track numbers", followed.again)
        said.append(("again", tr("{numbers} used again after a gap: each begins a new track", numbers=words)))
    if followed.doubles:
        words = plural("{count} plot", "{count} plots", followed.doubles)
        said.append(("doubles", tr("{plots} left out: the same scan has one nearer to the track", plots=words)))
    missing = [tr("{count} of {name}", count=count, name=name) for name, count in followed.missing.items() if count]
    if missing:
        said.append(("missing", ", ".join(missing)))
    for name, columns in followed.without_plots.items():
        told = {"name": name, "columns": listed(columns)}
        said.append(("missing", tr("{name} used no plot, because it needs {columns}: predictions only", **told)))
    if followed.silent:
        said.append(
            ("no rows", tr("{names}: no estimate from these plots", names=few(followed.silent, len(followed.silent))))
        )
    if followed.untested:
        names = few(followed.untested, len(followed.untested))
        said.append(("untested", tr("{names}: no innovation with a covariance, so no test", names=names)))
    if followed.gaps:
        words = tr(
            "{count} longer than three times the usual interval of {usual:g} s; the longest {longest:g} s, "
            "after {at:g} s",
            count=followed.gaps,
            usual=followed.median_s,
            longest=followed.longest_gap_s,
            at=followed.longest_gap_at_s,
        )
        said.append(("gaps", words))
    return [labelled(label, words) for label, words in said]


def counted(rows: int) -> str:
    """1 row, 2 rows."""
    return plural("{count} row", "{count} rows", rows)


def errors(followed: Followed) -> list[dict[str, Any]]:
    """The filters' errors, where the file has the truth: a row each, by column."""
    columns = ("filter", "component", "RMS error", "unit", "of own σ", "estimates")
    every = [one for one in followed.errors.values() if one.count]
    rows = [(one.filter, one.component, one.rms, tr(unit_of(one.unit)), one.ratio, one.count) for one in every]
    return [dict(zip(columns, row, strict=True)) for row in rows]


ERRORS, TESTS = (term("Errors against the truth"), term("Innovations (NIS of a consistent filter: 1)"))
FINDINGS = {
    SMALL: term("the plots are less accurate than stated, or the target manoeuvres harder than the filter allows for"),
    LARGE: term("the plots are more accurate than stated, or the filter allows for harder manoeuvres than occur"),
    LOST: term("the velocity is unfolded by a wrong number of spans; other filters fit the same plots"),
    DOUBT: term("a wrong fold, plots less accurate than stated, or harder manoeuvres than allowed for"),
}


def tests(judged: Sequence[Judged]) -> list[dict[str, Any]]:
    """The tests of the innovations: a row each, by column."""
    columns = ("filter", "number", "plots", "NIS", "95 % from", "95 % to", "stated σ")
    rows = [(one.filter, one.name, one.tests, one.nis, one.lo, one.hi, tr(one.verdict)) for one in judged if one.tests]
    return [dict(zip(columns, row, strict=True)) for row in rows]


NUMBERS = {  # columns of these, and how they are printed
    **{"RMS error": "#.4g", "of own σ": "#.3g", "estimates": ".0f"},
    **{"plots": ".0f", "NIS": ".3g", "95 % from": ".3g", "95 % to": ".3g"},
}


def findings(judged: Sequence[Judged]) -> list[str]:
    """The meaning of the verdicts that occur."""
    there = {one.verdict for one in judged if one.tests}
    return [f"{tr(verdict)}: {tr(words)}" for verdict, words in FINDINGS.items() if verdict in there]


def consistent(judged: Sequence[Judged]) -> list[str]:
    """The filters that are consistent in all their tests, unless all are."""
    verdicts: dict[str, set[str]] = {}
    for one in judged:
        verdicts.setdefault(one.filter, set()).add(one.verdict)
    fitting = [name for name, found in verdicts.items() if found == {FITS}]
    words = tr("{names}: consistent in all tests", names=few(fitting, len(fitting)))
    return [labelled("", words)] if 0 < len(fitting) < len(verdicts) else []


def likely(followed: Followed, advised: Advice) -> list[str]:
    """The filter that predicts the plots best, and errors in the numbers of the one that takes most columns."""
    compared, lines = advised.compared, []
    if len(compared.behind) > 1 and advised.folding is None:
        equal = [name for name, gap in compared.behind.items() if gap < EQUAL or name == compared.best]
        behind = sorted(((n, gap) for n, gap in compared.behind.items() if n not in equal), key=itemgetter(1))
        alike: dict[str, list[str]] = {}
        for name, gap in behind:
            alike.setdefault(times(gap), []).append(name)
        others = ", ".join(
            tr("{times} times under {name}", times=so, name=few(own, len(own))) for so, own in alike.items()
        )
        words = few(equal, len(equal))
        if behind and behind[0][1] <= CLEAR:
            words = tr("{name} (not clearly)", name=words)
        if behind:
            words = tr("{best}; the plots are less likely under the others: {others}", best=words, others=others)
        lines.append(labelled("best", words))
    if advised.folding is not None:
        lines.append(labelled("advice", fit.said(advised.folding, followed.case)))
    elif not advised.findings:
        words = plural(
            "the stated values of {filter} agree with {count} row",
            "the stated values of {filter} agree with {count} rows",
            advised.asked.rows,
            filter=compared.fullest,
        )
        lines.append(labelled("advice", words))
    found = [explained(one, compared.fullest) for one in advised.findings]
    return [*lines, *(labelled("advice", one) for one in found), *_partly(followed, advised.asked)]


def _partly(followed: Followed, asked: Asked) -> list[str]:
    """The rows behind best filter and advice, where not all."""
    if asked.rows >= followed.rows:
        return []
    words = tr(
        "from {rows} of {all}, in {stretches} stretches spread over all tracks and the whole time",
        rows=counted(asked.rows),
        all=followed.rows,
        stretches=asked.stretches,
    )
    return [labelled("", words)]


def times(gain: float) -> str:
    """A likelihood ratio from the difference of the logarithms: 12, 10⁵; beyond doubt, over 10⁶."""
    power = gain / math.log(10)
    if power > DOUBTLESS:
        return tr("over {number}", number=power_of_ten(DOUBTLESS))
    if round(power) >= 4:
        return power_of_ten(round(power))
    return significant_digits(math.exp(gain), "#.2g" if gain < math.log(99) else ".0f")


def explained(one: Finding, filter_name: str) -> str:
    """An error in the numbers, in words, and its weight."""
    told = {"what": what(one.what, one.value), "times": times(one.gain)}
    if not one.from_zero:
        told["key"] = one.what
        words = tr("{key}: the plots cannot distinguish it from zero; that is no reason to lower it", **told)
    else:
        words = tr("{what}; the plots are then {times} times as likely", **told)
    turn = one.turning
    if turn is None:
        return words
    cost = tr(
        "in a turn of {load:g} g without missed plots the largest error of {filter} in {component} would be {changed}, "
        "not {stated} {unit}",
        load=turn.acceleration_g,
        filter=filter_name,
        component=turn.component,
        changed=number(turn.changed, 3),
        stated=number(turn.stated, 3),
        unit=tr(unit_of(turn.unit)),
    )
    if not one.from_zero:
        cost = tr("at {value} {cost}", value=number(one.value, 2), cost=cost)
    return f"{words}; {cost}"


def what(name: str, value: float) -> str:
    """An error in words: a key, or one of EXPLANATIONS, and its value."""
    if name == OUTLIERS:
        share = significant_digits(100 * value, "#.2g")
        return tr("outliers: {share} % of the plots have errors of ten times their σ", share=share)
    if name == BIAS:
        size = significant_digits(value, "#.3g")
        return tr("the measured velocities have a common bias of {size} of their σ", size=size)
    if name == CORRELATION:
        size = significant_digits(value, "#.2g")
        return tr("errors persist from plot to plot: the correlation of neighbours is {size}", size=size)
    return f"--set {name}={value:.3g}"


# ---- page ------------------------------------------------------------------------------------------------------------
NAME = "report.html"


@np.errstate(all="ignore")  # of a filter that diverged
def write(
    followed: Followed,
    experiment: Experiment,
    source: str | os.PathLike,
    judged: Sequence[Judged],
    advised: Advice | None,
    folder: str | os.PathLike,
) -> list[str]:
    """Write the page and `figures/` into a folder; the names of the figures. Raises StoreError, and ConfigError, with
    nothing written, where a file would overwrite the plots or the config."""
    from radarsim.report import files, html
    from radarsim.report.figures import draw

    name = os.path.basename(os.fspath(source))
    drawings = {stem: draw(figure) for stem, figure in figures(followed).items()}
    page = html.track_page(
        experiment.stem,
        name,
        _said(verdict(followed, judged, advised)) or [_unjudged(followed)],
        _said(rows(followed)),
        list(drawings.values()),
        {tr(ERRORS): errors(followed), tr(TESTS): tests(judged), tr("Tracks"): _tracks(followed)},
        html.config_yaml(experiment.resolved),
        f"radarsim track {_typed(experiment)} {name}",
    )
    contents = {NAME: page.encode()}
    for stem, drawing in drawings.items():
        contents |= {f"figures/{stem}.{kind}": data for kind, data in drawing.files.items()}
    for path in (Path(folder, name) for name in contents):
        if any(files.same_file(path, one) for one in (source, experiment.path) if one):
            raise ConfigError(f"{path}: would be overwritten; choose another folder")
    files.replace_all(Path(folder), contents)
    return list(drawings)


def _typed(experiment: Experiment) -> str:
    """A config as it is asked for: a shipped one by its name."""
    path = experiment.path
    return path if path and not Path(path).is_relative_to(SHIPPED) else experiment.stem


def _unjudged(followed: Followed) -> str:
    """Why the plots do not tell which filter is best."""
    if followed.untested:
        return tr("The plots do not tell which filter is best: the filters give no innovation with a covariance.")
    return tr("Too few plots to judge the filters by.")


def _said(lines: Sequence[str]) -> list[str]:
    """Lines of the terminal as sentences: the label of each with a colon, a line without one after that before it."""
    made: list[str] = []
    for line in lines:
        label, _, rest = line.partition("  ")
        if label:
            made.append(f"{label[:1].upper()}{label[1:]}: {rest.strip()}")
        elif made:
            made[-1] += f", {rest.strip()}"
        else:
            made.append(rest.strip())
    return [f"{sentence}." for sentence in made]


def _tracks(followed: Followed) -> list[dict[str, object]]:
    return [
        {"track": name, "rows": one.rows, "from, s": one.first_s, "to, s": one.last_s, "gaps": one.gaps}
        for name, one in followed.tracks.items()
    ]
