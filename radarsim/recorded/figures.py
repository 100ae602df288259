"""Figures of a track over recorded plots: estimates and plots, residuals, probabilities of the models."""

from collections.abc import Sequence

import numpy as np

from radarsim.engine.results import Track
from radarsim.report import panels
from radarsim.report.drawing import COLUMN_MM, GREY, PAGE_MM, Axis, Figure, Line, Panel, Reference, Style
from radarsim.report.statistics import Z95

TIME = Axis("time, s")
PLOT = Style(GREY, None, 0, size_pt=1.6)
MOST_FILTERS = 8
MOST_DOTS = 300  # of a filter in a panel of residuals


def figures(track: Track) -> dict[str, Figure]:
    """`track`, and where there are such `residuals` and `probabilities`, described; by name."""
    drawn = {"track": estimates(track), "residuals": residuals(track), "probabilities": probabilities(track)}
    return {name: figure for name, figure in drawn.items() if figure is not None}


def _several(name: str, title: str, caption: str, made: list[Panel], keys: Sequence[tuple[str, Style]] = ()) -> Figure:
    """A figure of panels and, where there are keys, their legend in a cell of its own."""
    made = [*made, *([Panel(TIME, TIME, (), keys=tuple(keys))] if keys else [])]
    columns = min(3 if len(made) > 4 else 2, len(made))
    return Figure(name, title, caption, tuple(made), columns, PAGE_MM if columns > 1 else COLUMN_MM, 52.0)


def _usual(values: np.ndarray) -> tuple[float | None, float | None]:
    """Limits that show the usual values whole: the ends of 99 % of them and 30 % more, so that no start rules all."""
    known = values[np.isfinite(values)]
    if known.size < 50:
        return None, None
    low, high = np.quantile(known, [0.005, 0.995])
    pad = 0.3 * (high - low)
    return (float(low - pad), float(high + pad)) if pad else (None, None)


def estimates(track: Track) -> Figure:
    """A panel for each component: the filters' estimates with what they believe of themselves, and the plots."""
    made, every = [], max(1, len(track.components) // max(1, len(track.measured)))
    for c, (component, unit) in enumerate(track.components):
        marks: list = []
        d, is_value = divmod(c, every)
        if track.residual is not None and is_value == 0 and d < len(track.measured):
            plots = track.residual[..., d] + track.estimate[..., c]  # the same of every filter that has an estimate
            first, known = np.isfinite(plots).argmax(axis=0), np.isfinite(plots).any(axis=0)
            plots = plots[first, np.arange(plots.shape[1])]
            marks.append(Line(track.t_s[known], plots[known], "", PLOT, name="plots"))
        for f, name in enumerate(track.filters[:MOST_FILTERS]):
            x, half = track.estimate[f, :, c], Z95 * track.sigma[f, :, c]
            if np.isfinite(x).any():
                label = panels.literal(name)
                marks.append(Line(track.t_s, x, "", Style(f, f), x - half, x + half, name=label))
        if marks:
            y = Axis(panels.with_unit(panels.letter(component), unit), limits=_usual(track.estimate[..., c]))
            made.append(Panel(TIME, y, tuple(marks), direct=False))
    caption = (
        "Estimates over the recorded plots; bands: twice the standard deviation that each filter believes "
        "(95 % if it is right)."
    )
    keys = [(panels.literal(name), Style(f, f)) for f, name in enumerate(track.filters[:MOST_FILTERS])]
    return _several("track", "Track", caption, made, [("plots", PLOT), *keys])


def residuals(track: Track) -> Figure | None:
    """Plot less estimate of what is measured, a panel each, dots of every filter."""
    if track.residual is None:
        return None
    made = []
    for d, (name, unit) in enumerate(track.measured):
        marks: list = [Reference(0.0)]
        for f, filter_name in enumerate(track.filters[:MOST_FILTERS]):
            known = np.flatnonzero(np.isfinite(track.residual[f, :, d]))
            known = known[:: -(-max(known.size, 1) // MOST_DOTS)]
            label = panels.literal(filter_name)
            style = Style(f, None, f, size_pt=1.8)
            marks.append(Line(track.t_s[known], track.residual[f, known, d], "", style, name=label))
        if len(marks) > 1:
            axis = Axis(panels.with_unit(f"residual of {name.rpartition('_')[0]}", unit))
            made.append(Panel(TIME, axis, tuple(marks), direct=False))
    caption = "What each plot differs from the estimate after it. Around zero without a trend where the filter follows."
    keys = [(panels.literal(one), Style(f, None, f)) for f, one in enumerate(track.filters[:MOST_FILTERS])]
    return _several("residuals", "Residuals", caption, made, keys) if made else None


def probabilities(track: Track) -> Figure | None:
    """Probabilities of the models, a panel for each filter of several."""
    if track.probability is None:
        return None
    made = []
    for f, name in enumerate(track.filters):
        known = np.isfinite(track.probability[f]).any(axis=0)
        if known.sum() > 1:
            marks = tuple(
                Line(track.t_s, track.probability[f, :, m], f"model {m + 1}", Style(m, m))
                for m in np.flatnonzero(known).tolist()
            )
            y = Axis("probability", limits=(0, 1.02))
            made.append(Panel(TIME, y, marks, panels.literal(name), direct=False))
    caption = "Probabilities of each filter's models, in the order of the config."
    return _several("probabilities", "Probabilities of the models", caption, made[: panels.MOST]) if made else None
