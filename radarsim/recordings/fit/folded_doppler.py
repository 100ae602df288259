"""Detect folded velocities from the ranges of the same plots.

The ranges of the same plots show whether velocities are folded, whatever errors the config gives them. A velocity that
is ambiguous by a span D lies between -D / 2 and D / 2, and differs from the rate of the range by a whole number of
spans. So if no velocity exceeds A / 2 in size, the span is at least A, and a range that changes faster than A / 2
proves folding. The differences determine the span, if there are enough of them. A common error of all velocities looks
different: it shows in the velocities themselves."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.language.translate import tr
from radarsim.recordings.study_part import recording_interface
from radarsim.report.wording import significant_digits

RATE_ACCURACY = 1 / 8  # of the least span: the standard deviation required of the rate of the range
MIN_ACCURATE_SHARE = 0.6  # of the plots must have it
MAX_EXAMINED_PLOTS = 1000  # examined at most
MAX_WINDOW_LENGTH = 2.0  # times its usual length that a window of plots may last
CLEAR_SIGMAS = 4.0  # standard deviations by which a range changes faster than a velocity can be
MIN_FOLDED_PLOTS, MIN_FOLDED_SHARE = 3, 0.1  # of the plots examined that must do so
# standard deviations that distinguish whole spans from chance: for a known span, for any
KNOWN_SPAN_SCORE = 1.0
ANY_SPAN_SCORE = 3.0
VELOCITY_COLUMN = "velocity_mps"
SPAN_SEARCH_STEPS = 200  # of a search for the span, in which the phase of the largest velocity turns once


@dataclass(frozen=True)
class Folding:
    """Folded velocities: the largest of them and the fastest rate of the ranges, m/s; the span, m/s, known or fitted to
    the plots, None where they do not determine it."""

    velocity_mps: float
    rate_mps: float
    span_mps: float | None
    is_configured: bool


def detect_folding(tracks: Sequence[Mapping[str, np.ndarray]], span_mps: float | None = None) -> Folding | None:
    """Whether the velocities of tracks, columns t_s, range_m and velocity_mps (n,), are folded; None where they are
    not, or where too few plots decide it. span_mps: the span, where known."""
    arrays = [np.stack([columns["t_s"], columns["range_m"], columns["velocity_mps"]]) for columns in tracks]
    arrays = [array[:, np.isfinite(array).all(axis=0)] for array in arrays]
    fastest = max((float(np.abs(array[2]).max()) for array in arrays if array.size), default=0.0)
    fits = _range_rates(arrays, 2 * fastest)
    if fits is None:
        return None
    rates, velocities, sigma = fits
    differences = rates - velocities
    folded_count = int((np.abs(differences) > fastest + CLEAR_SIGMAS * sigma).sum())
    opposite_sign_difference = np.median(np.abs(rates + velocities))  # with the other sign, twice their size
    if folded_count < max(
        MIN_FOLDED_PLOTS, MIN_FOLDED_SHARE * differences.size
    ) or opposite_sign_difference < 0.5 * np.median(np.abs(differences)):
        return None
    span = _fit_span(differences, 2 * fastest)
    is_configured = span_mps is not None and 2 * fastest <= span_mps * (1 + 1e-9)
    is_configured = is_configured and (
        span is None or bool(_whole_span_score(differences, np.array([span_mps]))[0] > KNOWN_SPAN_SCORE)
    )
    rate = float(np.abs(rates[np.abs(differences) > fastest + CLEAR_SIGMAS * sigma]).max())
    return Folding(fastest, rate, span_mps if is_configured else span, is_configured)


def detect_case_folding(case: Case, tracks: Sequence[Mapping[str, np.ndarray]]) -> Folding | None:
    """Detect folded velocities of tracks, columns (n,) each, that a case's study takes as measured."""
    interface = recording_interface(case)
    if VELOCITY_COLUMN not in tracks[0] or interface.unfolds():
        return None
    return detect_folding(tracks, interface.span_mps(case.spec))


def folding_message(folding: Folding, case: Case | None = None) -> str:
    """The message that velocities are folded, with the settings that unfold them if the radar's case is known."""
    speeds = {
        "velocity": significant_digits(folding.velocity_mps, "#.3g"),
        "rate": significant_digits(folding.rate_mps, "#.3g"),
    }
    clause = tr(
        "the velocities are folded: none is beyond ±{velocity} m/s, and the ranges change by up to {rate} m/s", **speeds
    )
    span = "" if folding.span_mps is None else significant_digits(folding.span_mps, "#.3g")
    if folding.span_mps is None:
        span_clause = tr("the plots do not determine the span")
    elif folding.is_configured:
        span_clause = tr("the config's span is {span} m/s", span=span)
    elif folding.span_mps >= 4 * folding.velocity_mps:
        span_clause = tr("the plots suggest a span of about {span} m/s, or an integer fraction of it", span=span)
    else:
        span_clause = tr("the plots suggest a span of about {span} m/s", span=span)
    clauses = [clause, span_clause]
    if case is None:
        clauses.append(tr("with a config of the radar, `radarsim track` names the settings that unfold them"))
    elif settings := recording_interface(case).unfolding(
        case.spec, folding.span_mps or float(f"{2 * folding.velocity_mps:.4g}")
    ):
        options = " ".join(f"--set {setting}" for setting in settings)
        clauses.append(tr("for filters that unfold them: the same command with {settings}", settings=options))
    return "; ".join(clauses)


def _range_rates(tracks: Sequence[np.ndarray], min_span: float) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """The rate of the range at plots, the velocities there, and the standard deviations of the rates, (m,) each: from
    parabolas through the smallest number of ranges around each that gives RATE_ACCURACY for most plots.

    None if no number does."""
    half, total = 2, sum(track.shape[1] for track in tracks)
    stride = max(total // MAX_EXAMINED_PLOTS, 1)
    while min_span > 0:
        fits = [_fit_parabolas(track, half, stride) for track in tracks if track.shape[1] > 2 * half]
        rates, velocities, residual_squares, slope_spread = np.concatenate([np.empty((4, 0)), *fits], axis=1)
        if not residual_squares.size:
            return None
        # The median of the residual squares of normal errors is about that of chi-square (Wilson and Hilferty).
        freedom = 2 * half - 2
        sigma = np.sqrt(np.median(residual_squares) / (freedom * (1 - 2 / (9 * freedom)) ** 3))
        is_accurate = sigma * slope_spread <= RATE_ACCURACY * min_span
        if is_accurate.mean() >= MIN_ACCURATE_SHARE:
            return rates[is_accurate], velocities[is_accurate], sigma * slope_spread[is_accurate]
        half += 1 + half // 4
    return None


def _fit_parabolas(track: np.ndarray, half: int, stride: int) -> np.ndarray:
    """Parabolas through the ranges of 2 half + 1 plots around each, at the ends of a track of the nearest ones: (4, m)
    slope there, velocity there, residual sum of squares, standard deviation of the slope for errors of 1 m."""
    count, (t, r, v) = 2 * half + 1, track
    usual_length = np.median(np.diff(t)) * (count - 1)
    rows = []
    for i in range(0, len(t), stride):
        first = min(max(i - half, 0), len(t) - count)
        window = slice(first, first + count)
        scale = t[window][-1] - t[window][0]
        if 0 < scale <= MAX_WINDOW_LENGTH * usual_length:
            powers = ((t[window] - t[i]) / scale)[:, None] ** np.arange(3)
            inverse = np.linalg.pinv(powers)
            coefficients = inverse @ (r[window] - r[i])
            residuals = r[window] - r[i] - powers @ coefficients
            rows.append(
                (coefficients[1] / scale, v[i], residuals @ residuals, np.sqrt(inverse[1] @ inverse[1]) / scale)
            )
    return np.array(rows).T.reshape(4, -1)


def _whole_span_score(differences: np.ndarray, spans: np.ndarray) -> np.ndarray:
    """How clearly the velocities that are off (m,) by more than half a span are off by whole ones, for each span: the
    mean cosine of their phase, in its standard deviations for random phases; zero where there are none."""
    phase = np.abs(differences)[None] / spans[:, None]
    is_folded = phase > 0.5
    count = is_folded.sum(axis=1)
    return np.where(is_folded, np.cos(2 * np.pi * phase), 0.0).sum(axis=1) / np.sqrt(np.maximum(count, 1) / 2)


def _fit_span(differences: np.ndarray, min_span: float) -> float | None:
    """The span, from min_span on, that fits the differences best; None if none does clearly."""
    largest = float(np.abs(differences).max())
    lowest, highest = 1 / (2 * largest), 1 / min_span
    spans = 1 / np.linspace(lowest, highest, 2 + int(SPAN_SEARCH_STEPS * largest * (highest - lowest)))
    scores = _whole_span_score(differences, spans)
    return float(spans[scores.argmax()]) if scores.max() > ANY_SPAN_SCORE else None
