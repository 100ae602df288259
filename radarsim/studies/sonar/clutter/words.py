"""Question and answer of the report on tracks among false plots."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import panels
from radarsim.studies.sonar.clutter.axes import ClutterAxes
from radarsim.studies.sonar.clutter.config import Keys

if TYPE_CHECKING:
    import pandas as pd


def question(specs: Sequence[Keys]) -> str:
    """The question of cases whose filters have to find their plots."""
    return (
        "How surely and how soon is a target's track confirmed among false and missed plots, how long is it kept, and "
        "how many false tracks does that cost?"
    )


def answer(results: Sequence[CaseResult[ClutterAxes]], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """A sentence for each case shown: time to a confirmed track, track life, false tracks per hour, by tracker."""
    sentences = []
    shown, others = panels.told(results, 2)
    for result in shown:
        rows = made["tracking"][made["tracking"]["case"] == result.name]
        trackers = "; ".join(_of_tracker(row) for _, row in rows.iterrows())
        where = panels.plain(panels.swept(result))
        sentences.append(f"{where + ': ' if where else ''}{trackers}.")
    return [*sentences, *others]


def _of_tracker(row: "pd.Series") -> str:
    life = "no track lost" if not np.isfinite(row["life_s"]) else f"life {_bounded(row, 'life_s', 'life', ' s')}"
    confirmed = f"{100 * row['confirmed']:.4g} % [{100 * row['confirmed_lo']:.4g}, {100 * row['confirmed_hi']:.4g}]"
    return (
        f"{row['filter']} confirms {confirmed} after {_bounded(row, 'time_to_confirm_s', 'time', ' s')} on average, "
        f"{life}, {_bounded(row, 'false_tracks_per_hour', 'false')} false tracks per hour"
    )


def _bounded(row: "pd.Series", name: str, stem: str, unit: str = "") -> str:
    """The value of a column with its interval, to three digits."""
    value, low, high = (f"{float(f'{row[key]:.3g}'):,.10g}" for key in (name, f"{stem}_lo", f"{stem}_hi"))
    return f"{value}{unit} [{low}, {high}]"
