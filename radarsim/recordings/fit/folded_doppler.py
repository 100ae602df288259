"""Detect folded velocities from the ranges of the same plots.

The ranges of the same plots show whether velocities are folded, whatever errors the config gives them. A velocity that
is ambiguous by a span D lies between -D / 2 and D / 2, and differs from the rate of the range by a whole number of
spans. So if no velocity exceeds A / 2 in size, the span is at least A, and a range that changes faster than A / 2
proves folding. The differences determine the span, if there are enough of them. A common error of all velocities looks
different: it shows in the velocities themselves. A speed V of the wrong sign looks like one that is folded by 2 V, but
range and velocity then agree but for their noise, where a fold by D leaves 2 V - D: that is tested."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.language.translate import term, tr
from radarsim.recordings.study_part import recording_interface
from radarsim.report.wording import significant_digits

RATE_ACCURACY = 1 / 8  # of the least span: the standard deviation required of the rate of the range
MIN_ACCURATE_SHARE = 0.6  # of the plots must have it
MAX_MISFIT = 12.0  # of a parabola, in its expected sum of squares: a range that is far off makes no velocity
MAX_EXAMINED_PLOTS = 1000  # examined at most
MAX_WINDOW_LENGTH = 2.0  # times its usual length that a window of plots may last
CLEAR_SIGMAS = 4.0  # standard deviations by which a range changes faster than a velocity can be
MIN_FOLDED_PLOTS, MIN_FOLDED_SHARE = 3, 0.1  # of the plots examined that must do so
# standard deviations that distinguish whole spans from chance: for a known span, for any
KNOWN_SPAN_SCORE = 1.0
ANY_SPAN_SCORE = 3.0
# A residue of the other sign is noise up to so many standard deviations, or up to this share of the differences.
MAX_NOISE_SIGMAS, MAX_RESIDUE_SHARE = 3.5, 0.03
MIN_SEGMENT_PLOTS = 6  # of a stretch of a track over which the residue is taken
COARSEST_STEP_MPS = 1.0  # in which velocities are rounded
MIN_RATE_SHARE = 0.5  # of the largest velocity, of the rate of the range at a folded one
MIN_VELOCITY_SHARE = 0.02  # of the rate of the range, below which velocities may be none
NO_VELOCITIES_CAUSE = term("they are no radial velocities in m/s")
VELOCITY_COLUMN = "velocity_mps"
SPAN_SEARCH_STEPS = 200  # of a search for the span, in which the phase of the largest velocity turns once


@dataclass(frozen=True)
class Folding:
    """Folded velocities: the largest of them and the fastest rate of the ranges, m/s; the span, m/s, stated or fitted,
    None where the plots do not determine it.

    is_configured: whether the span is the stated one; is_clear: whether the plots agree with it beyond chance;
    other_causes: units that would explain a constant speed as well."""

    velocity_mps: float
    rate_mps: float
    span_mps: float | None
    is_configured: bool
    is_clear: bool = False
    other_causes: tuple[str, ...] = ()


def detect_folding(tracks: Sequence[Mapping[str, np.ndarray]], span_mps: float | None = None) -> Folding | None:
    """Whether the velocities of tracks, columns t_s, range_m and velocity_mps (n,), are folded; None where they are
    not, or where too few plots decide it. span_mps: the span, where known."""
    arrays = [np.stack([columns["t_s"], columns["range_m"], columns["velocity_mps"]]) for columns in tracks]
    arrays = [array[:, np.isfinite(array).all(axis=0)] for array in arrays]
    fastest = max((float(np.abs(array[2]).max()) for array in arrays if array.size), default=0.0)
    is_known = span_mps is not None and 2 * fastest <= span_mps * (1 + 1e-9)
    fits = _range_rates(arrays, span_mps if span_mps is not None and is_known else 2 * fastest)
    if fits is None and not is_known:  # velocities far smaller than the rates: near whole spans, which may be as large
        fits = _range_rates(arrays, max(2 * fastest, _typical_rate(arrays)))
    if fits is None:
        return None
    rates, velocities, sigma = fits
    differences = rates - velocities
    least = span_mps / 2 if span_mps is not None and is_known else fastest + COARSEST_STEP_MPS
    is_beyond = np.abs(differences) > np.maximum(fastest + CLEAR_SIGMAS * sigma, least)
    is_beyond &= np.abs(rates) > MIN_RATE_SHARE * fastest  # else velocities are far apart by their noise
    if is_beyond.sum() < max(MIN_FOLDED_PLOTS, MIN_FOLDED_SHARE * differences.size):
        return None
    if _is_sign_turned(arrays, rates, velocities, span_mps if is_known else None):
        return None
    span = _fit_span(differences, max(2 * fastest, float(np.median(sigma)) / RATE_ACCURACY))
    score = float(_whole_span_score(differences, np.array([span_mps]))[0]) if is_known else 0.0
    is_configured = is_known and (span is None or score > KNOWN_SPAN_SCORE)
    rate = float(np.abs(rates[is_beyond]).max())
    causes = (NO_VELOCITIES_CAUSE,) if fastest < MIN_VELOCITY_SHARE * rate else ()
    return Folding(fastest, rate, span_mps if is_configured else span, is_configured, score > ANY_SPAN_SCORE, causes)


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
        span_clause = tr("the plots do not determine the unambiguous interval")
    elif folding.is_configured:
        span_clause = tr("the config's unambiguous interval is {span} m/s", span=span)
    elif folding.span_mps >= 4 * folding.velocity_mps:
        span_clause = tr(
            "the plots suggest an unambiguous interval of about {span} m/s, or an integer fraction of it", span=span
        )
    else:
        span_clause = tr("the plots suggest an unambiguous interval of about {span} m/s", span=span)
    clauses = [clause, span_clause]
    if folding.other_causes:
        clauses.append(tr("or {cause}", cause=tr(" or ").join(map(tr, folding.other_causes))))
    if case is None:
        clauses.append(tr("with a config of the radar, `radarsim track` names the settings that unfold them"))
    elif settings := recording_interface(case).unfolding(
        case.spec, folding.span_mps or float(f"{2 * folding.velocity_mps:.4g}")
    ):
        options = " ".join(f"--set {setting}" for setting in settings)
        clauses.append(tr("for filters that unfold them: the same command with {settings}", settings=options))
    return "; ".join(clauses)


def _typical_rate(tracks: Sequence[np.ndarray]) -> float:
    """The median size of the rate of the range over half of each track (3, n), m/s; 0 of too few rows."""
    rates = [np.empty(0)]
    for t, r, _ in tracks:
        half = t.size // 2
        if half and (dt := t[half:] - t[: t.size - half]).all():
            rates.append(np.abs((r[half:] - r[: t.size - half]) / dt))
    rates_of_all = np.concatenate(rates)
    return float(np.median(rates_of_all)) if rates_of_all.size else 0.0


def _is_sign_turned(
    tracks: Sequence[np.ndarray], rates: np.ndarray, velocities: np.ndarray, span_mps: float | None
) -> bool:
    """Whether velocities have the opposite sign rather than folds: with it they agree with the ranges.

    rates, velocities (m,) at plots of tracks (3, n); span_mps: where it is known, and may hold."""
    opposite, differences = np.median(np.abs(rates + velocities)), rates - velocities
    if opposite >= 0.5 * np.median(np.abs(differences)):
        return False
    if span_mps is not None:
        unfolded = np.median(differences - span_mps * np.rint(differences / span_mps))
        if abs(unfolded) <= abs(np.median(rates + velocities)):
            return False
    limit = MAX_RESIDUE_SHARE * float(np.median(np.abs(differences)))
    stretches = [_opposite_residues(track) for track in tracks if track.shape[1] >= MIN_SEGMENT_PLOTS]
    departs = [np.any(np.abs(drift) > np.maximum(limit, MAX_NOISE_SIGMAS * noise)) for drift, noise in stretches]
    return not departs or float(np.mean(departs)) < 0.5


def _opposite_residues(track: np.ndarray) -> np.ndarray:
    """The rates (2, s) at which the range departs from that which velocities of the opposite sign give, over a track
    (3, n) and its halves, and their standard deviations: of straight lines through the differences."""
    t, r, v = track
    departure = r + np.append(0.0, np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t)))
    rows = []
    for rows_used in (np.arange(t.size), *np.array_split(np.arange(t.size), 2)):
        times, duration = t[rows_used] - t[rows_used].mean(), np.ptp(t[rows_used])
        if rows_used.size >= MIN_SEGMENT_PLOTS and duration > 0:
            slope = times @ departure[rows_used] / (times @ times)
            # Noise of the ranges, and of velocities, whose sum wanders: from differences of neighbours.
            sigma_r, sigma_v = (_noise_sigma(numbers[rows_used]) for numbers in (departure, v))
            wandering = sigma_v * np.hypot(np.sqrt(1.2 / rows_used.size), np.diff(t[rows_used]).max() / duration)
            rows.append((slope, np.hypot(sigma_r / np.sqrt(times @ times), wandering)))
    return np.array(rows).T.reshape(2, -1)


def _noise_sigma(numbers: np.ndarray) -> float:
    """The standard deviation of the noise of numbers (n,) about a smooth course, from their second differences: their
    lower quarter, as noise may fold some velocities the other way."""
    return float(np.quantile(np.abs(np.diff(numbers, n=2)), 0.25)) / (0.3186 * np.sqrt(6))


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
            is_accurate &= residual_squares <= MAX_MISFIT * freedom * sigma**2
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
