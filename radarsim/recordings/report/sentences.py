"""Sentences about tracks over recorded plots: rows, gaps, the best filter, advice."""

import math
from collections.abc import Sequence
from operator import itemgetter
from typing import NamedTuple

from radarsim.language.numerals import power_of_ten
from radarsim.language.translate import join_names, list_filters, plural, quote_name, term, tr
from radarsim.recordings.doppler_scale import doppler_scale_message
from radarsim.recordings.fill_values import fill_notes
from radarsim.recordings.fit import folded_doppler
from radarsim.recordings.fit.advice import Advice, FilterComparison, Finding, UsedRows
from radarsim.recordings.fit.fit import OutlierRow
from radarsim.recordings.fit.likelihood_slice import Rival
from radarsim.recordings.report.innovation_tests import (
    FITS,
    FOLD_LOST,
    MAYBE_TOO_SMALL,
    TOO_LARGE,
    TOO_SMALL,
    InnovationTest,
)
from radarsim.recordings.target_speed import speed_message
from radarsim.recordings.tracking_result import TrackingResult
from radarsim.report.output_labels import labelled_line
from radarsim.report.wording import number, significant_digits
from radarsim.report.wording import unit as unit_of
from radarsim.studies.error_law import BIAS, CORRELATION, MANOEUVRES, OUTLIERS
from radarsim.studies.recording_interface import TurnError

MAX_RATIO_POWER = 6  # a larger power of ten of a ratio of likelihoods says no more than that one model is wrong
EQUAL_FILTERS_GAIN = 1e-6  # difference of the log-likelihood below which two filters are the same
MAX_NAMED_ROWS = 5  # of a column's outliers
CLEAR_GAIN = 3.0  # difference of the log-likelihood, a factor of twenty, from which one filter is clearly the best


class Statement(NamedTuple):
    """A line for the user: its label, '' if it continues the line above, and its text."""

    label: str
    text: str


def _terminal_lines(statements: Sequence[Statement]) -> list[str]:
    return [labelled_line(*statement) for statement in statements]


def answer_lines(followed: TrackingResult, judged: Sequence[InnovationTest], advised: Advice | None) -> list[str]:
    """Lines with the best filter and the changes advised, by the likelihood; without one, the consistent filters."""
    return _terminal_lines(answer_statements(followed, judged, advised))


def answer_statements(
    followed: TrackingResult, tests: Sequence[InnovationTest], advice: Advice | None
) -> list[Statement]:
    """The best filter and the changes advised, by the likelihood; without one, the consistent filters."""
    return consistent_filters(tests) if advice is None else advice_statements(followed, advice)


def plot_lines(followed: TrackingResult) -> list[str]:
    """Lines with the numbers of rows and tracks, the time covered, missing values, and gaps."""
    return _terminal_lines(plot_statements(followed))


def plot_statements(followed: TrackingResult) -> list[Statement]:
    """The numbers of rows and tracks, the time covered, missing values, and gaps."""
    statements = [*_row_statements(followed), *_missing_statements(followed)]
    if names := followed.filters_without_estimate:
        text = tr("{names}: no estimate from these plots", names=list_filters(names, len(names)))
        statements.append(Statement("no rows", text))
    if names := followed.filters_without_test:
        text = tr("{names}: no innovation with a covariance, so no test", names=list_filters(names, len(names)))
        statements.append(Statement("untested", text))
    if followed.gaps:
        text = tr(
            "{count} longer than three times the usual interval of {usual:g} s; the longest {longest:g} s, "
            "after {at:g} s",
            count=followed.gaps,
            usual=followed.median_s,
            longest=followed.longest_gap_s,
            at=followed.longest_gap_at_s,
        )
        statements.append(Statement("gaps", text))
    return statements


def _row_statements(followed: TrackingResult) -> list[Statement]:
    """How many rows there are, of how many tracks, and which were not used."""
    span, first = followed.last_s - followed.first_s, followed.first_s
    row_count = row_count_text(followed.rows)
    text = tr("{rows} over {span:g} s, from {first:g} s", rows=row_count, span=span, first=first)
    statements = [Statement("plots", text)]
    if followed.tracks:
        longest = row_count_text(max(result.rows for result in followed.tracks.values()))
        text = tr("{count}, the longest of {rows}", count=len(followed.tracks), rows=longest)
        statements.append(Statement("tracks", text))
    if followed.trackless_rows:
        text = tr("{rows} outside any track", rows=row_count_text(followed.trackless_rows))
        statements.append(Statement("passed", text))
    if followed.reused_numbers:
        numbers = plural("{count} track number", "{count} track numbers", followed.reused_numbers)
        text = tr("{numbers} used again after a gap: each begins a new track", numbers=numbers)
        statements.append(Statement("again", text))
    if followed.doubles:
        plots = plural("{count} plot", "{count} plots", followed.doubles)
        text = tr("{plots} left out: the same scan has one nearer to the track", plots=plots)
        statements.append(Statement("doubles", text))
    return statements


def _missing_statements(followed: TrackingResult) -> list[Statement]:
    """The missing values of each column, and the filters whose columns the file has not."""
    counts = [tr("{count} of {name}", count=count, name=name) for name, count in followed.missing.items() if count]
    statements = [Statement("missing", ", ".join(counts))] if counts else []
    statements += [Statement("", note) for note in fill_notes(followed.fills, followed.rows)]
    for name, columns in followed.filters_without_plots.items():
        fields = {"name": quote_name(name), "columns": join_names(columns)}
        text = tr("{name} used no plot, because it needs {columns}: predictions only", **fields)
        statements.append(Statement("missing", text))
    return statements


def row_count_text(rows: int) -> str:
    """1 row, 2 rows."""
    return plural("{count} row", "{count} rows", rows)


VERDICT_MEANINGS = {
    TOO_SMALL: term(
        "the plots are less accurate than stated, or the target manoeuvres harder than the filter allows for"
    ),
    TOO_LARGE: term("the plots are more accurate than stated, or the filter allows for harder manoeuvres than occur"),
    FOLD_LOST: term("the velocity is unfolded by the wrong number of intervals; other filters fit the same plots"),
    MAYBE_TOO_SMALL: term("a wrong ambiguity, plots less accurate than stated, or harder manoeuvres than allowed for"),
}


def verdict_meanings(judged: Sequence[InnovationTest]) -> list[str]:
    """The meaning of the verdicts that occur."""
    verdicts = {test.verdict for test in judged if test.tests}
    return [f"{tr(verdict)}: {tr(meaning)}" for verdict, meaning in VERDICT_MEANINGS.items() if verdict in verdicts]


def consistent_filters(tests: Sequence[InnovationTest]) -> list[Statement]:
    """The filters that are consistent in all their tests, unless all are."""
    verdicts: dict[str, set[str]] = {}
    for test in tests:
        verdicts.setdefault(test.filter, set()).add(test.verdict)
    names = [name for name, own_verdicts in verdicts.items() if own_verdicts == {FITS}]
    text = tr("{names}: consistent in all tests", names=list_filters(names, len(names)))
    return [Statement("", text)] if 0 < len(names) < len(verdicts) else []


def advice_statements(followed: TrackingResult, advice: Advice) -> list[Statement]:
    """The filter that predicts the plots best, and errors in the numbers of the one that takes most columns."""
    comparison, statements = advice.comparison, []
    if len(comparison.log_ratios) > 1 and advice.folding is None:
        statements.append(Statement("best", _best_filter_text(comparison)))
    if advice.folding is not None:
        statements.append(Statement("advice", folded_doppler.folding_message(advice.folding, followed.case)))
    elif advice.impossible_speed is not None:
        statements.append(Statement("advice", speed_message(advice.impossible_speed)))
    elif advice.course_fault is not None:
        statements.append(Statement("advice", advice.course_fault.message()))
    elif advice.velocity_faults:
        statements += [Statement("advice", message) for message in advice.velocity_faults]
    elif advice.doppler_scale is not None:
        statements.append(Statement("advice", doppler_scale_message(advice.doppler_scale)))
    elif not advice.findings:
        text = plural(
            "the stated values of {filter} agree with {count} row",
            "the stated values of {filter} agree with {count} rows",
            advice.used_rows.rows,
            filter=quote_name(comparison.most_columns),
        )
        statements.append(Statement("advice", text))
    if advice.start_errors:
        text = tr("outliers, left out at the start of a track: {rows}", rows=outlier_rows_text(advice.start_errors))
        statements.append(Statement("advice", text))
    for finding in advice.findings:
        statements.append(Statement("advice", finding_text(finding, comparison.most_columns)))
    return [*statements, *_used_rows_statement(followed, advice.used_rows)]


def _best_filter_text(comparison: FilterComparison) -> str:
    """The best filters, and how many times less likely the plots are under the others."""
    gaps = comparison.log_ratios
    best = [name for name, gap in gaps.items() if gap < EQUAL_FILTERS_GAIN or name == comparison.best]
    less_likely = sorted(((name, gap) for name, gap in gaps.items() if name not in best), key=itemgetter(1))
    if not less_likely:
        return list_filters(best, len(best))
    names_by_ratio: dict[str, list[str]] = {}
    for name, gap in less_likely:
        names_by_ratio.setdefault(likelihood_ratio_text(gap), []).append(name)
    ratios = ", ".join(
        tr("{times} times under {name}", times=ratio, name=list_filters(names, len(names)))
        for ratio, names in names_by_ratio.items()
    )
    best_names = list_filters(best, len(best))
    if less_likely[0][1] <= CLEAR_GAIN:
        best_names = tr("{name} (not clearly)", name=best_names)
    return tr("{best}; the plots are less likely under the others: {others}", best=best_names, others=ratios)


def _used_rows_statement(followed: TrackingResult, used_rows: UsedRows) -> list[Statement]:
    """The rows on which best filter and advice rest, unless these are all with a plot."""
    if used_rows.rows + used_rows.empty >= followed.rows:
        return []
    text = tr(
        "from {rows} of {all}, in {stretches} spread over all tracks and the whole time",
        rows=row_count_text(used_rows.rows),
        all=followed.rows,
        stretches=plural("{count} stretch", "{count} stretches", used_rows.stretches),
    )
    return [Statement("", text)]


def likelihood_ratio_text(gain: float) -> str:
    """The likelihood ratio of a difference of logarithms, as text: 12, 10⁵, or over 10⁶."""
    power = gain / math.log(10)
    if power > MAX_RATIO_POWER:
        return tr("over {number}", number=power_of_ten(MAX_RATIO_POWER))
    if round(power) >= 4:
        return power_of_ten(round(power))
    return significant_digits(math.exp(gain), "#.2g" if gain < math.log(99) else ".0f")


def finding_text(finding: Finding, filter_name: str) -> str:
    """An error in the configured numbers, its weight, and the cost of a smaller manoeuvre variance."""
    if finding.from_zero:
        explanation = rivals_text(finding.name, finding.value, finding.rival)
        if finding.rows:
            explanation = tr("{what}: {rows}", what=explanation, rows=outlier_rows_text(finding.rows))
        fields = {"what": explanation, "times": likelihood_ratio_text(finding.gain)}
        text = tr("{what}; the plots are then {times} times as likely", **fields)
    else:
        text = tr("{key}: the plots cannot distinguish it from zero; that is no reason to lower it", key=finding.name)
    if finding.turning is None:
        return text
    cost = _turn_cost(finding.turning, filter_name)
    if not finding.from_zero:
        cost = tr("at {value} {cost}", value=number(finding.value, 2), cost=cost)
    return f"{text}; {cost}"


def _turn_cost(turn: TurnError, filter_name: str) -> str:
    """The largest error in a turn with a changed value, and that with the configured one."""
    return tr(
        "in a turn of {load:g} g without missed plots the largest error of {filter} in {component} would be {changed}, "
        "not {stated} {unit}",
        load=turn.acceleration_g,
        filter=quote_name(filter_name),
        component=turn.component,
        changed=number(turn.changed, 3),
        stated=number(turn.stated, 3),
        unit=tr(unit_of(turn.unit)),
    )


def rivals_text(name: str, value: float, rival: Rival | None) -> str:
    """The text of an explanation, and of its rival where the plots cannot distinguish the two."""
    text = explanation_text(name, value)
    if rival is None:
        return text
    rival_text = explanation_text(MANOEUVRES, rival.share)
    return tr("{what}, or {other}: the plots cannot distinguish these", what=text, other=rival_text)


def outlier_rows_text(rows: Sequence[OutlierRow]) -> str:
    """Where numbers are outliers: range_m at 120 s, 124 s; velocity_mps at 8 s; with the names of several tracks."""
    places: dict[str, list[str]] = {}
    for row in rows:
        time = f"{row.t_s:g} {tr('s')}"
        place = time if isinstance(row.track, int) else f"{time} ({row.track})"
        places.setdefault(row.column, []).append(place)
    texts = []
    for column, times in places.items():
        more = len(times) - MAX_NAMED_ROWS
        named_times = ", ".join(times[:MAX_NAMED_ROWS])
        if more > 0:
            named_times = tr("{named} and {count} more", named=named_times, count=more)
        texts.append(tr("{column} at {times}", column=column, times=named_times))
    return "; ".join(texts)


def explanation_text(name: str, value: float) -> str:
    """The text of an explanation: a key with its value, or one of EXPLANATIONS."""
    if name == OUTLIERS:
        share = significant_digits(100 * value, "#.2g")
        return tr("outliers: {share} % of the plots have errors of several times their σ, or far more", share=share)
    if name == MANOEUVRES:
        share = significant_digits(100 * value, "#.2g")
        return tr("the target manoeuvres unevenly: far harder in {share} % of the intervals", share=share)
    if name == BIAS:
        size = significant_digits(value, "#.3g")
        return tr("the measured velocities have a common bias of {size} of their σ", size=size)
    if name == CORRELATION:
        size = significant_digits(value, "#.2g")
        return tr("errors persist from plot to plot: the correlation of neighbours is {size}", size=size)
    return f"--set {name}={value:.3g}"
