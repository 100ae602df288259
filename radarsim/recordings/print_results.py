"""Terminal output of `radarsim track`, `fit` and `register`."""

import sys
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, TextIO

from radarsim.cli.console import break_lines, print_table
from radarsim.language.translate import plural, tr
from radarsim.report.output_labels import labelled_line
from radarsim.report.wording import format_if_known, interval, printable, significant_digits

if TYPE_CHECKING:
    from radarsim.recordings.fit.advice import Advice
    from radarsim.recordings.fit.fit import Fit
    from radarsim.recordings.fit.profile_intervals import FittedKey
    from radarsim.recordings.registration.result import Registration
    from radarsim.recordings.report.innovation_tests import InnovationTest
    from radarsim.recordings.tracking_result import TrackingResult


def print_rows(rows: Iterable[Sequence[str]]) -> None:
    """Print rows of CSV; names with a comma or a quote are quoted as in a file."""
    import csv

    csv.writer(sys.stdout, lineterminator="\n").writerows(rows)


def print_track(
    followed: "TrackingResult", judged: "Sequence[InnovationTest]", advised: "Advice | None", stderr: bool = False
) -> None:
    """Print what filters found over a recording; to stderr where the track itself goes to stdout.

    advised: None where the study knows no likelihood."""
    from radarsim.recordings.report import sentences, tables

    stream = sys.stderr if stderr else sys.stdout
    for line in sentences.plot_lines(followed):
        print_line(stream, line)
    for title, rows in (
        (tables.ERRORS_TITLE, tables.error_table(followed)),
        (tables.TESTS_TITLE, tables.test_table(judged)),
    ):
        if rows:
            forms = [tables.NUMBER_FORMATS.get(name) for name in rows[0]]
            texts = [
                [format_if_known(cell, form) if form else cell for cell, form in zip(row.values(), forms, strict=True)]
                for row in rows
            ]
            print_table(tr(title), list(rows[0]), texts, list(tables.NUMBER_FORMATS), stream=stream)
    for line in (*sentences.verdict_meanings(judged), *sentences.answer_lines(followed, judged, advised)):
        print_line(stream, line)


def print_line(stream: TextIO, line: str) -> None:
    """Print a line, to a terminal broken between words."""
    for broken_line in break_lines(printable(line), stream):
        stream.write(broken_line + "\n")


def print_fit(fitted: "Fit") -> None:
    """Print a fit, and the options that put it into the config."""
    from radarsim.recordings.fill_values import fill_notes
    from radarsim.recordings.fit import fit
    from radarsim.recordings.report import sentences

    tracks = plural("{count} track", "{count} tracks", fitted.tracks)
    plots_text = tr(
        "{rows} of {tracks}; filter {filter}",
        rows=sentences.row_count_text(fitted.rows),
        tracks=tracks,
        filter=fitted.filter,
    )
    lines = [labelled_line("plots", plots_text)]
    if fitted.doubles:
        words = plural("{count} plot", "{count} plots", fitted.doubles)
        words = tr("{plots} left out: the same scan has one nearer to the track", plots=words)
        lines.append(labelled_line("doubles", words))
    lines += [labelled_line("", note) for note in fill_notes(fitted.fills, fitted.rows)]
    plain = {} if fitted.plain is None else {fitted_key.key: fitted_key for fitted_key in fitted.plain.keys}
    for fitted_key in fitted.keys:
        line = f"{fitted_key.key}: {_value_with_interval(fitted_key)}"
        if fitted_key.key != fit.CORRELATION_TIME_KEY:
            line += tr(", stated {stated}", stated=significant_digits(fitted_key.stated))
        if fitted_key.key in plain:
            line += tr(", plain {value}", value=_value_with_interval(plain[fitted_key.key]))
        if not fitted_key.identifiable:
            line += (
                tr("; the plots cannot distinguish it from zero")
                if fitted_key.lo == 0
                else tr("; the plots cannot distinguish it from larger values")
            )
        lines.append(line)
    for column, law in fitted.outliers.items():
        share = significant_digits(100 * law.share, "#.2g")
        if column:
            lines.append(tr("outliers: {share} % of {column}", share=share, column=column))
        else:
            lines.append(tr("outliers: {share} % of the plots", share=share))
    if not fitted.knows_outliers:
        words = tr("filter {filter} knows no outliers: each plot that is far off makes σ larger", filter=fitted.filter)
        lines.append(labelled_line("", words))
    if fitted.has_overlap:
        width = significant_digits(max(fitted.outliers.values(), key=fit.share_within_sound).near_width, "#.2g")
        words = tr(
            "some, {width} σ wide, look like sound plots: the intervals allow for more and for fewer", width=width
        )
        lines.append(labelled_line("", words))
    if fitted.outlier_rows:
        rows = sentences.outlier_rows_text(fitted.outlier_rows)
        lines.append(labelled_line("", tr("far off: {rows}", rows=rows)))
    settings = " ".join(f"--set {key}={value:g}" for key, value in fit.fitted_settings(fitted).items())
    if fitted.further_explanation is not None:
        lines.append(
            labelled_line(
                "",
                tr(
                    "the intervals are not valid: {what}",
                    what=sentences.rivals_text(*fitted.further_explanation[:2], fitted.further_explanation.rival),
                ),
            )
        )
    if fitted.plain is not None:
        words = tr("plain: of errors that are normal and independent")
        if fitted.plain.further_explanation is not None:
            words = tr("{words}; the plots contradict that, so those intervals are too narrow", words=words)
        lines.append(labelled_line("", words))
    ratio_text = sentences.likelihood_ratio_text(fitted.gain)
    words = tr("with these values the plots are {times} times as likely as with the stated ones", times=ratio_text)
    lines.append(labelled_line("", words))
    if settings:
        lines.append(labelled_line("", tr("to use the fitted values: {settings}", settings=settings)))
    for line in lines:
        print_line(sys.stdout, line)


def _value_with_interval(fitted_key: "FittedKey") -> str:
    """A value with its interval."""
    hi = tr("no upper bound") if fitted_key.hi == float("inf") else significant_digits(fitted_key.hi)
    return f"{significant_digits(fitted_key.value)} {interval(significant_digits(fitted_key.lo), hi)}"


def print_registration(registration: "Registration", positions_file: str) -> None:
    """Print a registration, and the options that correct the radar's plots."""
    from radarsim.recordings import aircraft_match
    from radarsim.recordings.registration import sentences

    plots = plural("{count} plot", "{count} plots", registration.plots)
    match_kinds = ", ".join(f"{kind} {count}" for kind, count in registration.counts_by_kind.items())
    values = {"plots": plots, "matched": registration.matched, "file": positions_file, "by": match_kinds}
    lines = [
        labelled_line(
            "plots", tr("{matched} of {plots} have a position of their aircraft in {file} (by {by})", **values)
        )
    ]
    offset_text = tr("{distance} from it (median)", distance=aircraft_match.distance_text(*registration.median_offsets))
    aircraft = tr("{count} aircraft", count=len(registration.aircraft))
    interpolation_text = tr("positions in between err by less than {most:.2g} m (95 %)", most=registration.bent_m)
    lines += [labelled_line("", f"{aircraft}; {offset_text}; {interpolation_text}")]
    lines += [labelled_line("", tr("left out: {what}", what=reason)) for reason in registration.left_out]
    lines += sentences.finding_lines(registration)
    lines.append(tr("Biases of the plots with 95 % intervals, {file} taken as right", file=positions_file))
    lines += sentences.bias_lines(registration)
    for line in lines:
        print_line(sys.stdout, line)
