"""Question and answer of the report on tracks among false plots."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.language import numeral, tr
from radarsim.report import panels, rare, tables, wording
from radarsim.studies.sonar.clutter.filters import ClutterAxes
from radarsim.studies.sonar.clutter.tables import ENDED, FALSE
from radarsim.studies.sonar.config import Keys

if TYPE_CHECKING:
    import pandas as pd


def question(specs: Sequence[Keys]) -> str:
    """The question of cases whose filters have to find their plots."""
    return tr(
        "How reliably and how soon is a target's track confirmed among false and missed plots, how long "
        "is it kept, and how many false tracks does that cost?"
    )


def answer(results: Sequence[CaseResult[ClutterAxes]], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """A sentence for each case shown: time to a confirmed track, track life, false tracks per hour, by tracker."""
    sentences = []
    shown, others = panels.reported(results, 2)
    for result in shown:
        rows = tables.where(made["tracking"], case=result.name)
        trackers = "; ".join(_of_tracker(row) for _, row in rows.iterrows())
        sentences.append(panels.at_its_place(result, f"{trackers}."))
        if result.spec.rare is not None:
            found = made["rare"][(made["rare"]["case"] == result.name) & made["rare"]["sought"]]
            for event, said in ((FALSE, _by_importance), (ENDED, _ends_by_importance)):
                if (found["event"] == event).any():
                    sentences.append(panels.at_its_place(result, said(found[found["event"] == event])))
    return [*sentences, *others]


def _of_tracker(row: "pd.Series") -> str:
    said = {
        "filter": row["filter"],
        "confirmed": wording.estimate((100 * row[key] for key in ("confirmed", "confirmed_lo", "confirmed_hi")), "%"),
        "time": _bounded(row, "time_to_confirm_s", "time", tr("s")),
        "rate": _bounded(row, "false_tracks_per_hour", "false"),
        "life": _bounded(row, "life_s", "life", tr("s")) if np.isfinite(row["life_s"]) else "",
    }
    if not np.isfinite(row["life_s"]):
        return tr(
            "{filter} confirms {confirmed} after {time} on average, no track lost, {rate} false tracks per hour", **said
        )
    return tr(
        "{filter} confirms {confirmed} after {time} on average, life {life}, {rate} false tracks per hour", **said
    )


def _bounded(row: "pd.Series", name: str, stem: str, unit: str = "") -> str:
    """The value of a column with its interval, to three digits."""
    value, low, high = (numeral(f"{float(f'{row[key]:.3g}'):,.10g}") for key in (name, f"{stem}_lo", f"{stem}_hi"))
    return f"{' '.join(filter(None, (value, unit)))} {wording.interval(low, high)}"


def _by_importance(rows: "pd.DataFrame") -> str:
    """What stands behind rates of false tracks that importance sampling found, by tracker."""
    found = (
        tr(
            "{filter}, {events:,} of them, {n_eff:,.0f} effective",
            filter=row["filter"],
            events=row["events"],
            n_eff=row["n_eff"],
        )
        for _, row in rows.iterrows()
    )
    return tr("False tracks are drawn by importance sampling: {found}.", found="; ".join(found))


def _ends_by_importance(rows: "pd.DataFrame") -> str:
    """How rarely the target's track ends, and what stands behind these rates, by tracker."""
    found = (
        tr(
            "{filter}, {rate:.3g} [{low:.3g}, {high:.3g}] from {events:,} of them, {n_eff:,.0f} effective",
            filter=row["filter"],
            **rare.told(row),
        )
        for _, row in rows.iterrows()
    )
    return tr(
        "The probability that the target's first confirmed track has ended by the last scan, by importance sampling: "
        "{found}.",
        found="; ".join(found),
    )
