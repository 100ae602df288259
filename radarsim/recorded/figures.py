"""Figures of tracks over recorded plots: plan view and range, estimates, residuals, innovations, probabilities.

Whether the accuracies that a config states fit recorded plots, judged by the filters' own innovations. For a consistent
filter the squares of the innovations, divided by their predicted variance, average 1 for each degree of freedom (NIS).
Larger: the plots are worse than stated, or the target manoeuvres more than the filter assumes; smaller: they are
better.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Track
from radarsim.language import term, tr
from radarsim.recorded.follow import Followed, Tally, recorded_of
from radarsim.recorded.plots import Path
from radarsim.report import panels
from radarsim.report.drawing import COLUMN_MM, GREY, PAGE_MM, Axis, Figure, Line, Note, Panel, Reference, Style
from radarsim.report.statistics import Z95, normalised_bounds

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


def figures(track: Track, paths: Mapping[str, Path]) -> dict[str, Figure]:
    """`plan`, `track`, `residuals`, `nis` and `probabilities`, as far as available, described; by name.

    track: the one to draw; paths: the places of every track's plots, that one first.
    """
    drawn = {
        "plan": plan(track, paths),
        "track": estimates(track),
        "residuals": residuals(track),
        "nis": innovations(track),
        "probabilities": probabilities(track),
    }
    return {name: figure for name, figure in drawn.items() if figure is not None}


def _called(name: object) -> str:
    return tr("track {number}", number=name)


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
def plan(track: Track, paths: Mapping[str, Path]) -> Figure | None:
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
        marks += _ends(own[0], size)
        view = Panel(
            Axis(tr("east, {unit}", unit=unit)),
            Axis(tr("north, {unit}", unit=unit)),
            tuple(marks),
            tr("Plan view"),
            direct=False,
            equal=True,
        )
        made.insert(0, view)
    keys = [(_called(name), style) for name, style in zip(names[:MOST_TRACKS], styles, strict=False)]
    if len(own) > MOST_TRACKS:
        keys.append((tr("{count} more", count=len(own) - MOST_TRACKS), styles[-1]))
    if several:
        made.append(Panel(_time(), _time(), (), keys=((tr("radar"), RADAR), *keys)))
    caption = (
        tr(
            "Positions of the plots. Triangle: the radar; start and end of the longest track with their "
            "times. Where a file has no heights, slant range replaces ground range."
        )
        if len(made) > 1 + several
        else tr("The range of the plots over time; the file does not give their bearing.")
    )
    columns = min(len(made), 2)
    return Figure(
        "plan", tr("Positions"), caption, tuple(made), columns, PAGE_MM if columns > 1 else COLUMN_MM, TALL_MM
    )


def _drawn_paths(track: Track, paths: Mapping[str, Path]) -> list[Path]:
    """The places of the plots; for a single track whose file has angles of an antenna, its own coordinates."""
    names = [name for name, _ in track.components]
    if len(paths) == 1 and {"x", "y", "z"} <= set(names) and track.residual is not None:
        (path,) = paths.values()
        if not np.isfinite(path.places[:, :2]).any():
            at = track.estimate[..., [names.index(axis) for axis in "xyz"]] + track.residual
            f = int(np.isfinite(at).all(axis=2).sum(axis=1).argmax())
            there = np.isfinite(at[f]).all(axis=1)
            x, y, z = at[f, there].T
            return [Path(track.t_s[there], np.stack([x, z, np.sqrt(x**2 + y**2 + z**2)], axis=1))]
    return list(paths.values())


def _ends(path: Path, size: float) -> list:
    """Labels at the first and the last place of a track, on the side away from the track."""
    known = np.flatnonzero(np.isfinite(path.places[:, :2]).all(axis=1))
    if not known.size:
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
    for c, (component, unit) in enumerate(track.components):
        marks: list = []
        d, is_value = divmod(c, every)
        if track.residual is not None and is_value == 0 and d < len(track.measured):
            plots = track.residual[..., d] + track.estimate[..., c]  # the same for every filter that has an estimate
            first, known = np.isfinite(plots).argmax(axis=0), np.isfinite(plots).any(axis=0)
            plots = plots[first, np.arange(plots.shape[1])]
            marks.append(Line(track.t_s[known], plots[known], "", PLOT, name=tr("plots")))
        for f, name in enumerate(track.filters[:MOST_FILTERS]):
            x, half = track.estimate[f, :, c], Z95 * track.sigma[f, :, c]
            if np.isfinite(x).any():
                label = panels.literal(name)
                marks.append(Line(track.t_s, x, "", Style(f, f), x - half, x + half, name=label))
        if marks:
            y = Axis(panels.with_unit(panels.letter(component), unit), limits=_usual(track.estimate[..., c]))
            made.append(Panel(_time(), y, tuple(marks), direct=False))
    caption = tr(
        "Estimates over the recorded plots; bands: twice each filter's own standard deviation (95 % if "
        "the filter is consistent)."
    )
    keys = [(panels.literal(name), Style(f, f)) for f, name in enumerate(track.filters[:MOST_FILTERS])]
    return _several("track", tr("Track"), caption, made, [(tr("plots"), PLOT), *keys])


def residuals(track: Track) -> Figure | None:
    """Plot minus estimate, a panel for each filter and each measured number, between its ± 2 σ bounds."""
    if track.residual is None:
        return None
    made: list[Panel] = []
    fitting = max(MOST_RESIDUALS // len(track.measured), 1)
    for f, filter_name in enumerate(track.filters[:fitting]):
        for d, (name, unit) in enumerate(track.measured):
            known = np.flatnonzero(np.isfinite(track.residual[f, :, d]))
            if not known.size:
                continue
            known = known[:: -(-known.size // MOST_DOTS)]
            t, miss = track.t_s[known], track.residual[f, known, d]
            marks: list = [Reference(0.0), Line(t, miss, "", Style(f, None, 0, size_pt=1.8), name=tr("plots"))]
            if track.residual_sigma is not None and np.isfinite(track.residual_sigma[f, known, d]).any():
                bound = 2 * track.residual_sigma[f, known, d]
                marks += [Line(t, bound, "", BOUND, name="± 2 σ"), Line(t, -bound, "", BOUND, name="± 2 σ")]
            axis = Axis(
                panels.with_unit(tr("residual of {measured}", measured=name.rpartition("_")[0]), unit),
                limits=_usual(miss),
            )
            made.append(Panel(_time(), axis, tuple(marks), panels.literal(filter_name), direct=False))
    caption = tr(
        "Difference of each plot from the estimate after it. Dashed: twice the filter's own standard "
        "deviation of that difference; 95 % of the plots lie between if the filter is consistent."
    )
    if len(track.filters) > fitting:
        caption += tr(
            " The first {fitting} of {filters} filters are drawn.", fitting=fitting, filters=len(track.filters)
        )
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
            made.append(
                Panel(
                    _time(), Axis(tr("mean NIS"), "log", ticks=ticks), tuple(marks), panels.literal(name), direct=False
                )
            )
    caption = tr(
        "Normalised innovation squared, averaged over {window} plots: 1 for a consistent filter, whose "
        "averages lie between the dashed bounds in 95 % of cases. Above: plots worse than stated, or a "
        "manoeuvre.",
        window=WINDOW,
    )
    keys = [(panels.literal(name), Style(f, f)) for f, name in enumerate(track.filters[:MOST_FILTERS])]
    return _several("nis", tr("Innovations"), caption, made, [*keys, (tr("bounds"), BOUND)]) if made else None


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
