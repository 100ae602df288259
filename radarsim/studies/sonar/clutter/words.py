"""What the report of tracks among false plots asks and answers."""

from collections.abc import Mapping, Sequence

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import panels
from radarsim.studies.sonar.clutter.axes import ClutterAxes


def question(specs: Sequence) -> str:
    """What is asked of cases whose filters have to find their plots."""
    return (
        "How surely and how soon is a target's track confirmed among false and missed plots, how long is it kept, and "
        "how many false tracks does that cost?"
    )


def answer(results: Sequence[CaseResult[ClutterAxes]], made: Mapping) -> list[str]:
    """A sentence for each case shown: time to a confirmed track, track life, false tracks an hour, by tracker."""
    sentences = []
    shown, others = panels.told(results, 2)
    for result in shown:
        rows = made["tracking"][made["tracking"]["case"] == result.name]
        trackers = "; ".join(_of_tracker(row) for _, row in rows.iterrows())
        where = panels.plain(panels.swept(result))
        sentences.append(f"{where + ': ' if where else ''}{trackers}.")
    return [*sentences, *others]


def _of_tracker(row) -> str:
    life = "no track lost" if not np.isfinite(row["life_s"]) else f"life {_bounded(row, 'life_s', 'life', ' s')}"
    confirmed = f"{100 * row['confirmed']:.4g} % [{100 * row['confirmed_lo']:.4g}, {100 * row['confirmed_hi']:.4g}]"
    return (
        f"{row['filter']} confirms {confirmed} after {_bounded(row, 'time_to_confirm_s', 'time', ' s')} in the mean, "
        f"{life}, {_bounded(row, 'false_tracks_per_hour', 'false')} false tracks an hour"
    )


def _bounded(row, name: str, stem: str, unit: str = "") -> str:
    """A column's value with its interval, to three figures."""
    value, low, high = (f"{float(f'{row[key]:.3g}'):,.10g}" for key in (name, f"{stem}_lo", f"{stem}_hi"))
    return f"{value}{unit} [{low}, {high}]"
