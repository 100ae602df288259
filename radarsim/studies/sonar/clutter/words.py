"""Question and answer of the report on tracks among false plots."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.language import tr
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
    """Of the case in which tracks end most often: the tracker that keeps them longest, the others, what is rare.

    Of each: the time to a confirmed track, track life, false tracks per hour."""
    tracking, events = made["tracking"], made.get("rare")
    ends = tracking["ends_per_hour"].fillna(np.inf)
    if events is not None:
        sought = events[events["sought"] & (events["event"] == ENDED)]
        rates = tracking.merge(sought[["case", "filter", "rate"]], "left", ["case", "filter"])["rate"]
        ends = ends if rates.isna().any() else rates
    ranked = tracking.assign(ends=ends).sort_values(["ends", "false_tracks_per_hour"], kind="stable")
    name = ranked.groupby("case", sort=False)["ends"].min().idxmax()
    result = next(one for one in results if one.name == name)
    found = None if events is None else events[(events["case"] == name) & events["sought"]]
    first, *others = (_of_tracker(row, found) for _, row in tables.where(ranked, case=name).iterrows())
    case = panels.plain(panels.swept(result)) or panels.plain_label(result)
    words = tr("Longest track life: {tracker}.", tracker=first)
    if len(results) > 1:
        words = tr("Longest track life in the hardest case, {case}: {tracker}.", case=case, tracker=first)
    sentences = [words]
    sentences += [tr("The others there: {trackers}.", trackers="; ".join(others))] if others else []
    for event, said in ((FALSE, _by_importance), (ENDED, _ends_by_importance)):
        if found is not None and (found["event"] == event).any():
            sentences.append(said(found[found["event"] == event]))
    return sentences


def _of_tracker(row: "pd.Series", events: "pd.DataFrame | None") -> str:
    """How surely and how soon a tracker confirms a track, how long it keeps it, and its false tracks."""
    if not row["confirmed"]:
        return tr("{filter} confirms no track", filter=row["filter"])
    return tr(
        "{filter} confirms {confirmed} after {time} on average, {life}, {rate} false tracks per hour",
        filter=row["filter"],
        confirmed=wording.share(*(100 * row[key] for key in ("confirmed", "confirmed_lo", "confirmed_hi"))),
        time=_bounded(row, "time_to_confirm_s", "time", tr("s")),
        life=_life(row, events),
        rate=_bounded(row, "false_tracks_per_hour", "false"),
    )


def _life(row: "pd.Series", events: "pd.DataFrame | None") -> str:
    """How long a tracker keeps a track; where ends were sought, how many tracks have ended by the last scan."""
    own = None if events is None else events[(events["filter"] == row["filter"]) & (events["event"] == ENDED)]
    if own is not None and len(own):
        rates = (100 * own.iloc[0][key] for key in ("rate", "rate_lo", "rate_hi"))
        return tr("of its tracks {share} ended by the last scan", share=wording.estimate(rates, "%", ".2g"))
    return (
        tr("life {life}", life=_bounded(row, "life_s", "life", tr("s")))
        if row["ends_per_hour"]
        else tr("no track lost")
    )


def _bounded(row: "pd.Series", name: str, stem: str, unit: str = "") -> str:
    """The value of a column with its interval, to three digits."""
    values = (float(f"{row[key]:.3g}") for key in (name, f"{stem}_lo", f"{stem}_hi"))
    return wording.estimate(values, unit, ",.10g")


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
