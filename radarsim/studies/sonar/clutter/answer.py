"""Question and answer of the report on tracks among false plots."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from radarsim.engine.results import CaseResult
from radarsim.language.translate import quote_name, tr
from radarsim.report import case_selection, key_labels, rare_events, sentences, tables, wording
from radarsim.report.sentences import Sentence
from radarsim.studies.sonar.clutter.axes import ClutterAxes
from radarsim.studies.sonar.clutter.tables import ENDED_TRACK_EVENT, FALSE_TRACK_EVENT
from radarsim.studies.sonar.config import Keys

if TYPE_CHECKING:
    import pandas as pd

MAX_CASES = 3  # each with a sentence on its trackers


def question(specs: Sequence[Keys]) -> str:
    """The question of cases whose filters have to find their plots."""
    return tr(
        "How soon and how surely is a track confirmed among false and missed plots, how long does it live, and how "
        "many false tracks come with it?"
    )


def answer(results: Sequence[CaseResult[ClutterAxes]], tables_by_name: "Mapping[str, pd.DataFrame]") -> list[Sentence]:
    """Of each case, of many of the first and the last: the time to a confirmed track of each tracker, how long it keeps
    it, false tracks per hour; then what is rare.

    Trackers are not ranked, nor cases called hard, by the life of tracks: tracks kept on false plots live long too."""
    events, tracking = tables_by_name.get("rare"), tables_by_name["tracking"]
    reported, remark = case_selection.select_reported(results, MAX_CASES)
    answer = []
    for result in reported:
        sought = None if events is None else events[(events["case"] == result.name) & events["sought"]]
        rows = tables.select_rows(tracking, case=result.name)
        clauses = sentences.join(
            "; ", [_tracker_clause(row, sought, float(result.axes.t_s[-1])) for _, row in rows.iterrows()]
        )
        case = key_labels.without_markup(key_labels.swept_description(result))
        answer.append(clauses.with_text(f"{case}: {clauses.text}." if case else f"{clauses.text}."))
        answer += [
            sentence.with_text(case_selection.after_swept_values(result, sentence.text))
            for sentence in _sentences_on_rare_events(sought)
        ]
    note = tr("Note: the target's track is a confirmed one near the target, whichever plots it uses.")
    return [*answer, Sentence(note), *map(Sentence, remark)]


def _sentences_on_rare_events(sought: "pd.DataFrame | None") -> list[Sentence]:
    """From which events importance sampling has the rates of a case."""
    answer = []
    for event, make_sentence in ((FALSE_TRACK_EVENT, _false_tracks_sought), (ENDED_TRACK_EVENT, _ended_tracks_sought)):
        if sought is not None and (sought["event"] == event).any():
            answer.append(make_sentence(sought[sought["event"] == event]))
    return answer


def _tracker_clause(row: "pd.Series[Any]", sought: "pd.DataFrame | None", run_s: float) -> Sentence:
    """How surely and how soon a tracker confirms a track, how long it keeps it, and its false tracks."""
    if not row["confirmed_share"]:
        return Sentence(tr("{filter} confirms no track", filter=quote_name(row["filter"])))
    life = _life_clause(row, sought, run_s)
    text = tr(
        "{filter} confirms the target's track in {confirmed} of realisations, after {time} on average, {life}; "
        "{filter} makes {rate} false tracks per hour",
        filter=quote_name(row["filter"]),
        confirmed=wording.share(
            *(100 * row[key] for key in ("confirmed_share", "confirmed_share_lo", "confirmed_share_hi"))
        ),
        time=_estimate(row, "time_to_confirm_s", tr("s")),
        life=life.text,
        rate=_estimate(row, "false_tracks_per_hour"),
    )
    names = ("confirmed_share", "time_to_confirm_s", "false_tracks_per_hour")
    intervals = (interval for name in names for interval in _tracking_interval(row, name))
    return Sentence(text, (*intervals, *life.intervals))


def _tracking_interval(row: "pd.Series[Any]", name: str) -> tuple[sentences.MeasuredInterval, ...]:
    return sentences.intervals("tracking", name, row)


def _life_clause(row: "pd.Series[Any]", sought: "pd.DataFrame | None", run_s: float) -> Sentence:
    """How long a tracker keeps a track; where ends were sought, how many tracks have ended by the last scan.

    A mean life over that of the run, run_s, is extrapolated."""
    if sought is not None:
        ended = sought[(sought["filter"] == row["filter"]) & (sought["event"] == ENDED_TRACK_EVENT)]
        if len(ended):
            rates = (100 * ended.iloc[0][key] for key in ("event_rate", "event_rate_lo", "event_rate_hi"))
            share = wording.estimate(rates, "%", ".2g")
            text = tr("loses {share} of these by the last scan", share=share)
            return Sentence(text, sentences.intervals("rare", "event_rate", ended.iloc[0]))
    if not row["ends_per_hour"]:
        return Sentence(tr("loses none"))
    fields = {"life": _estimate(row, "life_s", tr("s"))}
    is_extrapolated = row["life_s"] > run_s
    text = (
        tr("keeps it for {life} (extrapolated from {run_s:g} s)", run_s=run_s, **fields)
        if is_extrapolated
        else tr("keeps it for {life}", **fields)
    )
    return Sentence(text, _tracking_interval(row, "life_s"))


def _estimate(row: "pd.Series[Any]", column: str, unit: str = "") -> str:
    """The value of a column with its interval, to three digits."""
    return wording.estimate((row[key] for key in (column, f"{column}_lo", f"{column}_hi")), unit, ",.3g")


def _false_tracks_sought(rows: "pd.DataFrame") -> Sentence:
    """The events from which importance sampling has the rates of false tracks, by tracker."""
    trackers = (
        tr(
            "{filter} ({events:,} events, effective sample size {n_eff:,.0f})",
            filter=quote_name(row["filter"]),
            events=row["events"],
            n_eff=row["n_eff"],
        )
        for _, row in rows.iterrows()
    )
    return Sentence(tr("Rates of false tracks are from importance sampling: {found}.", found="; ".join(trackers)))


def _ended_tracks_sought(rows: "pd.DataFrame") -> Sentence:
    """How rarely the target's track ends by importance sampling, and from how many events, by tracker."""
    trackers = (
        tr(
            "{filter} {rate} ({events:,} events, effective sample size {n_eff:,.0f})",
            filter=quote_name(row["filter"]),
            **rare_events.rate_fields(row),
        )
        if rare_events.is_estimated(row)
        else tr(
            "{filter}: no estimate (effective sample size {n_eff:,.0f})",
            filter=quote_name(row["filter"]),
            n_eff=row["n_eff"],
        )
        for _, row in rows.iterrows()
    )
    text = tr(
        "Probability that the target's first confirmed track is lost by the last scan (importance sampling): {found}.",
        found="; ".join(trackers),
    )
    return Sentence(text, sentences.intervals("rare", "event_rate", rows))
