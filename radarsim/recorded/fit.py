"""Fit the numbers of a config to recorded plots by maximum likelihood, and advise on them.

The filter's predictions give each plot a density; their product is the likelihood of the filter's parameters (Schweppe
1965). Estimates maximise it; an interval holds the values of a key at which the largest likelihood over all other keys
is within half the 95 % point of chi-square of the maximum (profile likelihood). Besides the keys, outliers, a bias, or
errors correlated from plot to plot may explain the plots. Clear outliers and clear correlation are fitted too.

The ranges of the same plots show whether velocities are folded, whatever errors the config gives them. A velocity that
is ambiguous by a span D lies between -D / 2 and D / 2, and differs from the rate of the range by a whole number of
spans. So if no velocity exceeds A / 2 in size, the span is at least A, and a range that changes faster than A / 2
proves folding. The differences determine the span, if there are enough of them. A common error of all velocities looks
different: it shows in the velocities themselves.

The likelihood also finds errors in the config's numbers. Each explanation (a σ, the manoeuvre variance, a bias of the
velocity, outliers, errors correlated from plot to plot) is fitted alone. The one that raises the likelihood most is
reported, if it raises it by more than chance does in one recording of twenty, over all explanations; the search then
continues with it included. For a recording with correct numbers nothing is reported.

The advice is about the filter that takes most columns of a plot. A filter that takes fewer says nothing about the
others, and may predict the ranges best just because the velocities are bad."""

import itertools
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from radarsim.config.experiment import Case, Experiment
from radarsim.errors import ConfigError
from radarsim.language import speaking, tr
from radarsim.recorded import plots
from radarsim.recorded.follow import (
    Followed,
    recording_interface,
    refuse_inherited_part,
    single_case,
    split_by_track,
    unknown_inherited_keys,
)
from radarsim.report.wording import significant_digits
from radarsim.studies.interface import BIAS, CORRELATION, EXPLANATIONS, OUTLIERS, Likelihood, Turning

# ---- along -----------------------------------------------------------------------------------------------------------
ROUGH_ACCURACY = 0.01  # relative accuracy, of a key and of the likelihood, to which explanations are compared
MIN_LOG_FACTOR, MAX_LOG_FACTOR = np.log(1e-4), np.log(1e4)  # of a key's factor
MAX_BIAS_SIGMAS = 50.0  # in σ of the velocity
SHARES = {OUTLIERS: (1e-3, 0.4, 3.0), CORRELATION: (1e-3, 0.99, 0.0)}  # least, most, logit at the start of the search
FAR_FROM_ZERO = 1e4  # times the value of a key that counts as zero
IMPOSSIBLE_LOG_LIKELIHOOD = -1e300  # stands for the logarithm of zero likelihood: a search needs a number
# likelihood evaluations of a key to the maximum and to an end; of an explanation
MAXIMUM_EVALUATIONS = 130
END_EVALUATIONS = 15
EXPLANATION_EVALUATIONS = 60
SECOND_FIT_COST = 1.5  # evaluations of a fit that allows for more, in those of the plain one
NO_VALUES: Mapping[str, float] = MappingProxyType({})
SEARCH_STARTS = (-2.0, 0.0, 2.0)  # of a search
Progress = Callable[[int, int | None], None]  # likelihoods computed, and their expected number where known


def no_progress(evaluations: int, expected: int | None = None) -> None:
    """Ignore progress."""


class FitStages:
    """Progress over several fits.

    has_second_fit: whether a second fit, which takes SECOND_FIT_COST times as many likelihoods, will follow."""

    def __init__(self, progress: Progress, has_second_fit: bool):
        self.progress, self.has_second_fit, self.evaluations_before, self.done = progress, has_second_fit, 0, 0

    def report(self, evaluations: int, expected: int | None = None) -> None:
        self.done = self.evaluations_before + evaluations
        total = expected and self.evaluations_before + round(expected * (1 + SECOND_FIT_COST * self.has_second_fit))
        self.progress(self.done, total)

    def next(self) -> Progress:
        """Start the next fit, and return its progress."""
        self.evaluations_before, self.has_second_fit = self.done, False
        return self.report


def starting_values(likelihood: Likelihood) -> np.ndarray:
    """Starting values of the keys: the configured ones; a key that is zero starts far above what counts as zero."""
    is_zero = np.asarray(likelihood.stated) <= likelihood.least
    return np.where(is_zero, FAR_FROM_ZERO * np.asarray(likelihood.least), likelihood.stated)


class CountedLikelihood:
    """A likelihood that counts its evaluations and reports progress."""

    def __init__(self, likelihood: Likelihood, progress: Progress, count: int = 0, expected: int | None = None):
        self.likelihood, self.progress, self.count, self.expected = likelihood, progress, count, expected
        self.keys, self.stated = likelihood.keys, likelihood.stated

    def __call__(self, values: np.ndarray, explanations: Mapping[str, float]) -> float:
        self.count += 1
        self.progress(self.count, self.expected and max(self.expected, self.count))
        return self.likelihood(values, **explanations)


def log_likelihood(likelihood: CountedLikelihood, changes: Mapping[str, float]) -> float:
    """The log-likelihood with some keys changed and some explanations applied."""
    configured = zip(likelihood.keys, likelihood.stated, strict=True)
    values = np.array([changes.get(key, value) for key, value in configured])
    result = likelihood(values, {name: changes[name] for name in EXPLANATIONS if name in changes})
    return result if np.isfinite(result) else IMPOSSIBLE_LOG_LIKELIHOOD


class LikelihoodSlice:
    """A likelihood as a function of some keys and explanations on their search scales; others are fixed."""

    def __init__(self, likelihood: CountedLikelihood, names: Sequence[str], fixed: Mapping[str, float] = NO_VALUES):
        starting = dict(zip(likelihood.keys, starting_values(likelihood.likelihood).tolist(), strict=True))
        self.likelihood, self.fixed = likelihood, fixed
        self.scales = {name: _search_scale(name, starting) for name in names}

    def to_search(self, values: Mapping[str, float]) -> np.ndarray:
        return np.array([to_search(values[name]) for name, (_, to_search) in self.scales.items()])

    def to_values(self, point: np.ndarray) -> dict[str, float]:
        return {name: to_value(x) for (name, (to_value, _)), x in zip(self.scales.items(), point, strict=True)}

    def __call__(self, point: np.ndarray) -> float:
        return log_likelihood(self.likelihood, {**self.fixed, **self.to_values(point)})


def maximise(
    likelihood: CountedLikelihood,
    names: Sequence[str],
    start: Mapping[str, float],
    fixed: Mapping[str, float] = NO_VALUES,
) -> tuple[dict[str, float], float]:
    """The maximum of the likelihood along some explanations, others held, and its logarithm there: roughly, from three
    starts of the last one."""
    slice_, last_name = LikelihoodSlice(likelihood, names, fixed), names[-1]
    maxima = [
        climb(slice_, {**start, last_name: slice_.scales[last_name][0](last_start)}) for last_start in SEARCH_STARTS
    ]
    return max(maxima, key=lambda maximum: maximum[1])


def climb(slice_: LikelihoodSlice, start: Mapping[str, float]) -> tuple[dict[str, float], float]:
    """The maximum reached from a start with rough accuracy, and its log-likelihood."""
    from scipy.optimize import minimize

    def cost(start_point: np.ndarray) -> float:
        return -slice_(start_point)

    point = slice_.to_search(start)
    simplex = np.concatenate([point[None], point + 0.5 * np.eye(len(point))])
    options: Any = {"initial_simplex": simplex, "xatol": ROUGH_ACCURACY, "fatol": ROUGH_ACCURACY, "maxfev": 400}
    result = minimize(cost, point, method="Nelder-Mead", options=options)
    return slice_.to_values(result.x), -float(result.fun)


def _search_scale(name: str, starting: dict[str, float]) -> tuple[Callable[[float], float], Callable[[float], float]]:
    """Functions from the search scale to the value of a key or an explanation, and back.

    starting: the starting value of each key."""
    if name == BIAS:
        return lambda x: float(np.clip(x, -MAX_BIAS_SIGMAS, MAX_BIAS_SIGMAS)), lambda value: value
    if name in SHARES:
        minimum, maximum, offset = SHARES[name]
        return (
            lambda x: float(np.clip(1 / (1 + np.exp(offset - x)), minimum, maximum)),
            lambda value: offset - float(np.log(1 / value - 1)),
        )
    return (
        lambda x: starting[name] * float(np.exp(np.clip(x, MIN_LOG_FACTOR, MAX_LOG_FACTOR))),
        lambda value: float(np.log(value / starting[name])),
    )


# ---- doppler ---------------------------------------------------------------------------------------------------------
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


# ---- fit -------------------------------------------------------------------------------------------------------------
HALF_CHI2_95 = 1.9207294103470  # half the 95 % point of chi-square with one degree of freedom
MIN_TRACK_ROWS = 10  # of a track; shorter ones carry almost no information
# step of a search at its start, and its end before a restart, in the same logarithms
FIRST_STEP = 0.3
ROUGH_TOLERANCE = 1e-4
INTERVAL_REACH = 1e4  # ratio to the estimate up to which an end of an interval is searched
# Accuracy of a maximum and of an interval's end, in the logarithm of a key; of the likelihood a tenth of that. Far
# finer than printed digits, since the path of a search depends on last digits, and these differ between processors.
TOLERANCE = 1e-6
SLOPE_STEP = 1e-3  # difference for a slope, in the logarithm of a key
CURVATURE_STEP = 1e-2  # the same during the search, where curvature is needed too
# curvature that counts as none, and the longest Newton step, in that logarithm
MIN_CURVATURE = 1e-3
MAX_NEWTON_STEP = 1.5
MAX_CORRELATION = 0.999  # of the correlation of two keys
MAX_NEWTON_STEPS = 40
SIMPLEX_EVALUATIONS = (50, 100, 200)  # evaluations of a simplex before Newton steps are tried again
TRIAL_FALLS = np.array([2.0, 4.0, 6.0])  # below these a key that may be zero is clearly not zero, in that logarithm
TRIAL_RISES = np.arange(1.0, 16.0)  # above what counts as zero: where a key at zero is tried
NEAR_ZERO_LOG = 7.0  # above the value that counts as zero, in that logarithm: zero is tried
SMALL_GAIN_FACTOR = 300.0  # times the accuracy: a Newton step that gains no more ends the search
MIN_OUTLIER_SHARE, MAX_OUTLIER_SHARE = 1e-6, 0.5  # of outliers; fewer are none
MAX_PLAUSIBLE_OUTLIERS = 0.3  # of plots that may have ten times their σ; with more, the errors follow another law
CORRELATION_TIME = "correlation_time_s"
ZERO_CORRELATION_TIME = 1e-4  # of the usual interval: a correlation time that counts as zero
PLAIN_GAIN = 5.4138  # gain of the log-likelihood by chance in one recording of 1000: half that point of chi-square
ROUGH_ROWS = 600  # on which the maximum is searched before all rows are used
MAX_STRETCH_ROWS, MIN_STRETCH_ROWS = 100, 25  # rows of a stretch of a track, if not all are used
NEAR_MAXIMUM_EVALUATIONS = 30  # as MAXIMUM_EVALUATIONS, from near the maximum
# factor on the value that counts as zero where the likelihood jumps by more there
ZERO_REFINEMENT = 1e-3
LIKELIHOOD_LEAP = 0.01


@dataclass(frozen=True)
class Fitted:
    """One key: the best value, its 95 % interval, and whether the plots distinguish it from all other values.

    lo is 0 where the key may be zero, hi infinite where it has no upper end."""

    key: str
    stated: float
    value: float
    lo: float
    hi: float
    identifiable: bool


@dataclass(frozen=True)
class Fit:
    """The fit: filter, tracks and plots used, the keys, the share of outliers where allowed for, and the increase of
    the log-likelihood over the stated values; another explanation that the plots have: then the intervals do not hold;
    and the fit without outliers and correlation, where these are allowed for."""

    filter: str
    tracks: int
    rows: int
    keys: tuple[Fitted, ...]
    outliers: float | None
    gain: float
    beside: "FurtherExplanation | None" = None
    plain: "Fit | None" = None
    doubles: int = 0  # further plots of a track in a scan, left out


class FurtherExplanation(NamedTuple):
    """An explanation besides the keys, one of EXPLANATIONS: its value, and the increase of the log-likelihood by it."""

    name: str
    value: float
    gain: float


class CorrelatedLikelihood:
    """A likelihood with the correlation time of the errors as a further key, s: of an error a share exp(-t / it) is
    left after a time t (first-order Gauss-Markov process)."""

    def __init__(self, likelihood: Likelihood):
        self.likelihood = likelihood
        self.filter = likelihood.filter
        self.tracks = likelihood.tracks
        self.rows = likelihood.rows
        self.usual_s = likelihood.usual_s
        self.keys, self.stated = (*likelihood.keys, CORRELATION_TIME), np.append(likelihood.stated, 0.0)
        self.least = np.append(likelihood.least, ZERO_CORRELATION_TIME * likelihood.usual_s)
        self.explains = tuple(name for name in likelihood.explains if name != CORRELATION)

    def __call__(self, values: np.ndarray, outliers: float = 0.0, bias: float = 0.0, correlation: float = 0.0) -> float:
        """The logarithm of the likelihood; `correlation` is that of the last of the values (n,), whatever is given."""
        return self.likelihood(values[:-1], outliers, bias, math.exp(-self.usual_s / values[-1]) if values[-1] else 0.0)

    def by_number(self, values: np.ndarray) -> Mapping[str, float]:
        """The same for the keys alone, without correlation."""
        return self.likelihood.by_number(values[:-1])


def sample_rows(tracks: Sequence[Mapping[str, np.ndarray]], max_rows: int) -> list[Mapping[str, np.ndarray]]:
    """About `most` rows of tracks, columns (n,) each, spread over all tracks and their whole time: stretches of rows
    that follow each other; the tracks themselves where they have no more rows. Of very many tracks only some."""
    row_count = sum(len(track["t_s"]) for track in tracks)
    if row_count <= max_rows:
        return list(tracks)
    length = min(max(max_rows // len(tracks), MIN_STRETCH_ROWS), MAX_STRETCH_ROWS)
    stretches = [
        {name: column[start : start + length] for name, column in track.items()}
        for track in tracks
        for start in _stretch_starts(len(track["t_s"]), length)
    ]
    stretch_count = min(max(round(max_rows / length), 1), len(stretches))
    return [stretches[(2 * i + 1) * len(stretches) // (2 * stretch_count)] for i in range(stretch_count)]


def _stretch_starts(rows: int, length: int) -> list[int]:
    """The first rows of as many stretches of a length as fit into a track, spread evenly."""
    return np.rint(np.linspace(0, max(rows - length, 0), max(rows // length, 1))).astype(int).tolist()


def file_likelihoods(
    experiment: Experiment, source: str | os.PathLike, filter_name: str | None = None
) -> tuple[Likelihood, Likelihood | None, int]:
    """The likelihood of a filter of an experiment's one case over all tracks of a file, and over a sample of its rows;
    without a name, of the filter that takes most columns of a plot. And how many further plots of a track in a scan are
    left out. Raises ConfigError."""
    case = single_case(experiment, "fit", f"radarsim fit {{}} {os.fspath(source)}")
    refuse_inherited_part(case, "likelihood")
    interface = recording_interface(case)
    filter_names = [member.name for member in case.spec.members]
    if filter_name is not None and filter_name not in filter_names:
        user_filters = [user_filter.name for user_filter in case.outside]
        why = ": it is written in Python, and radarsim does not know its keys" if filter_name in user_filters else ""
        raise ConfigError(f"filter: must be one of {', '.join(filter_names)}; got {filter_name}{why}")
    tracks, doubles = _read_tracks(source, interface.columns(case.spec), interface.from_any_origin)
    long_tracks = [columns for columns in tracks if len(columns["t_s"]) >= MIN_TRACK_ROWS]
    if not long_tracks:
        raise ConfigError(f"{source}: must have a track of at least {MIN_TRACK_ROWS} rows")
    if constant_columns := [
        name for name in long_tracks[0] if name != "t_s" and all(np.ptp(columns[name]) == 0 for columns in long_tracks)
    ]:
        raise ConfigError(
            f"{source}: {constant_columns[0]}: must differ between plots, or σ cannot be estimated; all are the same"
        )
    likelihood = interface.likelihood(case, filter_name, long_tracks)
    folding = detect_case_folding(case, long_tracks)
    if folding and likelihood is not None and VELOCITY_COLUMN in likelihood.by_number(np.asarray(likelihood.stated)):
        with speaking("en"):  # as all faults
            raise ConfigError(f"{source}: {folding_message(folding, case)}")
    if likelihood is None:
        raise ConfigError(
            no_likelihood_message(
                case, filter_name, [name for name in filter_names if interface.likelihood(case, name, long_tracks)]
            )
        )
    return (
        likelihood,
        interface.likelihood(case, filter_name, sample_rows(long_tracks, min(ROUGH_ROWS, interface.rows_asked))),
        doubles,
    )


def no_likelihood_message(case: Case, filter_name: str | None, fittable_filters: Sequence[str]) -> str:
    """The fault that no likelihood exists; fittable_filters: those for which the study has one."""
    if filter_name is not None and fittable_filters:
        allowed = ", ".join(fittable_filters)
        return f"filter: {filter_name} does not say how likely plots are, which fit needs; must be one of {allowed}"
    return (
        f"{case.name}: study {case.study} does not say how likely recorded plots are under "
        f"{'these filters' if filter_name is None else filter_name}, which fit needs; track takes them"
    )


def _read_tracks(
    source: str | os.PathLike, choices: Sequence[Sequence[str]], any_origin: bool
) -> tuple[list[dict[str, np.ndarray]], int]:
    """The columns (n,) of each track of a file of plots, and how many further plots of a scan are left out."""
    pieces_by_track, doubles = dict[str | None, list[dict[str, np.ndarray]]](), 0
    for piece in plots.pieces(source, choices, any_origin=any_origin):
        doubles = piece.doubles
        for rows in split_by_track(piece):
            if rows.name != "":
                pieces_by_track.setdefault(rows.name, []).append(rows.columns)
    tracks = [
        {key: np.concatenate([piece[key] for piece in track_pieces]) for key in track_pieces[0]}
        for track_pieces in pieces_by_track.values()
    ]
    return tracks, doubles


def fit(
    experiment: Experiment,
    source: str | os.PathLike,
    filter_name: str | None = None,
    allowing: Sequence[str] | None = None,
    progress: Progress = no_progress,
) -> Fit:
    """Fit the config's numbers to the plots of a file; allowing: for these of OUTLIERS and CORRELATION; None: for those
    that are plain. progress is called with the number of likelihoods computed. Raises ConfigError."""
    likelihood, rough, doubles = file_likelihoods(experiment, source, filter_name)
    return replace(fit_likelihood(likelihood, rough, allowing, progress), doubles=doubles)


def fit_likelihood(
    likelihood: Likelihood,
    rough: Likelihood | None = None,
    allowing: Sequence[str] | None = None,
    progress: Progress = no_progress,
) -> Fit:
    """Fit a likelihood, plainly and with the errors it allows for.

    allowing: which of OUTLIERS and CORRELATION; None: those that the plots show plainly."""
    allowed = tuple(allowing or ())
    check_explanations(likelihood, allowed)
    stages = FitStages(progress, bool(allowed))
    plain = result = fit_keys(likelihood, (), stages.report, rough)
    if allowed:
        result = fit_keys(likelihood, allowed, stages.next(), rough)
    while allowing is None and (explanation := result.beside) and _is_plain_error(explanation):
        allowed = (*allowed, explanation.name)
        try:
            result = fit_keys(likelihood, allowed, stages.next(), rough)
        except ConfigError:  # so many outliers that the errors follow another law: the plain fit reports it
            break
    return result if result is plain else replace(result, plain=plain)


def _is_plain_error(explanation: FurtherExplanation) -> bool:
    """Whether outliers or correlation raise the likelihood by more than chance does in one recording of 1000."""
    return explanation.name in (OUTLIERS, CORRELATION) and explanation.gain > PLAIN_GAIN


def check_explanations(likelihood: Likelihood, allowing: Sequence[str]) -> None:
    """Raise ConfigError unless a likelihood can allow for these explanations."""
    for name in allowing:
        if name not in likelihood.explains:
            description = {OUTLIERS: "outliers", CORRELATION: "errors that last"}[name]
            raise ConfigError(f"the likelihood of filter {likelihood.filter} cannot allow for {description}")


def fit_keys(
    likelihood: Likelihood,
    allowing: Sequence[str] = (),
    progress: Progress = no_progress,
    rough: Likelihood | None = None,
) -> Fit:
    """The keys at the maximum of a likelihood, with profile intervals; allowing: for these of OUTLIERS and CORRELATION;
    rough: the likelihood of fewer rows, for a first search. Raises ConfigError where these cannot be allowed for, or
    the plots are impossible whatever the keys."""
    check_explanations(likelihood, allowing)
    robust = OUTLIERS in allowing
    if CORRELATION in allowing:
        likelihood, rough = CorrelatedLikelihood(likelihood), rough and CorrelatedLikelihood(rough)
    start = LikelihoodSearch(rough, robust, no_progress).best if rough and rough.rows < likelihood.rows else None
    search = LikelihoodSearch(likelihood, robust, progress, start)
    while search.refine_zero():
        search.raise_zero_keys()
    if search.top <= IMPOSSIBLE_LOG_LIKELIHOOD:
        raise ConfigError(f"filter {likelihood.filter} cannot take the plots: `radarsim track` says at which row")
    share = float(search.to_values(search.best)[-1]) if robust else None
    if share is not None and share > MAX_PLAUSIBLE_OUTLIERS:
        raise ConfigError(f"robust: {100 * share:.0f} % of the plots would have to be outliers: their errors follow "
                          "another law (few different values?); fit without it")  # fmt: skip
    keys = tuple(search.interval(i) for i in range(len(likelihood.keys)))
    stated = likelihood(np.array(likelihood.stated), 0.0)
    gain = search.top - stated
    return Fit(
        likelihood.filter,
        likelihood.tracks,
        likelihood.rows,
        keys,
        share,
        gain,
        _find_further_explanation(search, likelihood),
    )


def _find_further_explanation(search: "LikelihoodSearch", likelihood: Likelihood) -> FurtherExplanation | None:
    """The explanation that raises the maximum most in addition to the fitted keys.

    None if it raises it by less than chance does in one recording of twenty."""
    from scipy.stats import chi2

    fitted_values = search.to_values(search.best).tolist()
    fixed = dict(zip((*likelihood.keys, OUTLIERS), fitted_values, strict=False))
    names = [name for name in likelihood.explains if name not in fixed]
    expected = search.evaluations + EXPLANATION_EVALUATIONS * len(names)
    counted_likelihood = CountedLikelihood(likelihood, search.progress, search.evaluations, expected)
    maxima = [maximise(counted_likelihood, [name], {}, fixed) for name in names]
    if OUTLIERS in names and likelihood.rows <= ROUGH_ROWS:
        # Outliers have raised σ, which hides a few of them: so the keys that are not zero are fitted again with them.
        i, free_keys = names.index(OUTLIERS), [key for key in likelihood.keys if fixed[key] > 0]
        slice_ = LikelihoodSlice(
            counted_likelihood,
            [*free_keys, OUTLIERS],
            {key: value for key, value in fixed.items() if key not in free_keys},
        )
        values, maximum = climb(slice_, fixed | maxima[i][0])
        maxima[i] = max(maxima[i], ({OUTLIERS: values[OUTLIERS]}, maximum), key=lambda maximum: maximum[1])
    if not maxima:
        return None
    values, maximum = max(maxima, key=lambda maximum: maximum[1])
    needed_gain = 0.5 * float(chi2.ppf(0.95 ** (1 / len(maxima)), 1))
    return (
        FurtherExplanation(*next(iter(values.items())), maximum - search.top)
        if maximum > search.top + needed_gain
        else None
    )


def polish_maximum(log_likelihood_at: Callable[[np.ndarray], float], point: np.ndarray) -> np.ndarray:
    """The maximum of a likelihood near the result of a search, by two Newton steps.

    A search by comparison stalls at the root of the last digits. They make a difference over SLOPE_STEP wrong by 10⁻⁷,
    and the maximum as well."""
    curvature, start = Curvature(log_likelihood_at), point
    start_value = log_likelihood_at(point)
    if not math.isfinite(curvature.step(point, start_value, np.arange(point.size))[1]):
        return start
    for _ in range(2):
        moves = SLOPE_STEP * np.eye(point.size)
        point = point + curvature.newton_step(
            np.array(
                [
                    (log_likelihood_at(point + move) - log_likelihood_at(point - move)) / (2 * SLOPE_STEP)
                    for move in moves
                ]
            )
        )
    return (
        point
        if log_likelihood_at(point) >= start_value - TOLERANCE and np.abs(point - start).max() < FIRST_STEP
        else start
    )


class Curvature:
    """Curvature of a likelihood near a point, for Newton steps: along each coordinate it is computed anew at each step,
    from the differences that give the slope; cross terms between coordinates, (n, n), are kept from before."""

    def __init__(self, log_likelihood_at: Callable[[np.ndarray], float], correlations: np.ndarray | None = None):
        self.log_likelihood_at, self.correlations = log_likelihood_at, correlations
        self.H = np.zeros((0, 0))  # the curvature at the last step, of the coordinates free then

    def step(self, point: np.ndarray, value: float, free: np.ndarray) -> tuple[np.ndarray, float]:
        """An ascending step from `at`, of the free coordinates alone, and its predicted gain."""
        moves = CURVATURE_STEP * np.eye(point.size)[free]
        above, below = (np.array([self.log_likelihood_at(point + sign * move) for move in moves]) for sign in (1, -1))
        if not (np.isfinite(value) and min(above.min(), below.min(), value) > IMPOSSIBLE_LOG_LIKELIHOOD):
            return np.zeros(point.size), math.nan
        slope, curvature = (above - below) / (2 * CURVATURE_STEP), (above - 2 * value + below) / CURVATURE_STEP**2
        scale = np.sqrt(np.maximum(np.abs(curvature), MIN_CURVATURE))
        if self.correlations is None:
            self.correlations = np.eye(point.size)
            for i, j in itertools.combinations(range(free.size), 2):
                cross = self.log_likelihood_at(point + moves[i] + moves[j]) - above[i] - above[j] + value
                correlation = float(
                    np.clip(cross / CURVATURE_STEP**2 / (scale[i] * scale[j]), -MAX_CORRELATION, MAX_CORRELATION)
                )
                self.correlations[free[i], free[j]] = self.correlations[free[j], free[i]] = correlation
        self.H = H = self.correlations[np.ix_(free, free)] * np.outer(scale, scale)
        np.fill_diagonal(H, np.where(np.abs(curvature) < MIN_CURVATURE, -MIN_CURVATURE, curvature))
        step = np.zeros(point.size)
        step[free] = self.newton_step(slope)
        return step, float(step[free] @ slope)

    def newton_step(self, slope: np.ndarray) -> np.ndarray:
        """The Newton step up a slope (n,), at most MAX_NEWTON_STEP along any axis of the curvature."""
        sizes, axes = np.linalg.eigh(self.H)
        coordinates = axes.T @ slope / np.maximum(np.abs(sizes), MIN_CURVATURE)
        return axes @ np.clip(coordinates, -MAX_NEWTON_STEP, MAX_NEWTON_STEP)


class _ProfilePoint(NamedTuple):
    """A point of a profile: the logarithm of the key held, the largest likelihood there, and its coordinates."""

    log_key: float
    value: float
    point: np.ndarray


class LikelihoodSearch:
    """The maximum of a likelihood, and its profile along each key. Coordinates are logarithms of the keys, and the
    logit of the share of outliers."""

    def __init__(self, likelihood: Likelihood, robust: bool, progress: Progress, start_point: np.ndarray | None = None):
        self.likelihood, self.robust, self.progress, self.evaluations = likelihood, robust, progress, 0
        self.end_count, self.ends_started_at = 0, 0
        start, self.lowest = np.log(starting_values(likelihood)), np.log(likelihood.least)
        self.highest = start + math.log(INTERVAL_REACH)
        if robust:
            start, self.lowest, self.highest = (
                np.append(keys, math.log(share / (1 - share)))
                for keys, share in ((start, 0.05), (self.lowest, MIN_OUTLIER_SHARE), (self.highest, MAX_OUTLIER_SHARE))
            )
        self.maximum_cost = (MAXIMUM_EVALUATIONS if start_point is None else NEAR_MAXIMUM_EVALUATIONS) * start.size
        self.curvature_model = Curvature(self._log_likelihood)
        self.best, self.top = self._climb(start if start_point is None else start_point, None, ROUGH_TOLERANCE)
        # A second start far away: the likelihood of manoeuvre and plot errors may have two maxima.
        for climb_count, factor in enumerate((0.1, 10.0) if start_point is None else (), 1):
            self.maximum_cost = max(self.maximum_cost, self.evaluations * 3 // climb_count)
            shifted = np.where(self.best > self.lowest, self.best, start)
            shifted[: len(likelihood.stated)] += math.log(factor)
            candidate, value = self._climb(shifted, None, ROUGH_ACCURACY, SIMPLEX_EVALUATIONS[:1])
            if value > self.top - ROUGH_ACCURACY and np.abs(candidate - self.best).max() > FIRST_STEP:
                candidate, value = self._climb(candidate, None, ROUGH_TOLERANCE)
            if value > self.top + 1e-6:
                self.best, self.top = candidate, value
        self.top = -math.inf
        self._polish(self.best)
        self.raise_zero_keys()

    def _polish(self, start: np.ndarray) -> bool:
        """Take the maximum near a point as the best if it is higher, and return whether it is."""
        point = polish_maximum(self._log_likelihood, self._climb(start, None, TOLERANCE)[0])
        value = self._log_likelihood(point)
        if is_higher := value > self.top:
            self.best, self.top = point, value
        return is_higher

    def raise_zero_keys(self) -> None:
        """Raise keys from zero where that makes the plots likelier, then compute the curvature at the maximum."""
        while (start := self._raised_point()) is not None and self._polish(start):
            pass
        self.curvature_model = Curvature(self._log_likelihood)
        self.curvature_model.step(self.best, self.top, np.arange(self.best.size))
        self.curvature = self.curvature_model.H
        self.raised_keys = {i: self._raised_log(i) for i in range(self.best.size) if self._may_be_zero(i)}
        self.ends_started_at = self.evaluations

    def _raised_point(self) -> np.ndarray | None:
        """The likeliest point above the maximum with a single key raised from zero; None if there is none."""
        unit_moves = np.eye(self.best.size)
        zero_keys = np.flatnonzero((self.best <= self.lowest)[: len(self.likelihood.keys)])
        trials = [
            self.best + (self.lowest[i] + rise - self.best[i]) * unit_moves[i]
            for i in zero_keys
            for rise in TRIAL_RISES
        ]
        candidates = [(self._log_likelihood(point), point) for point in trials]
        value, point = max(candidates, key=lambda candidate: candidate[0], default=(-math.inf, self.best))
        return point if value > self.top + TOLERANCE else None

    def to_values(self, point: np.ndarray) -> np.ndarray:
        """The keys, and the share of outliers at the end if allowed for: at most MAX_OUTLIER_SHARE, since all plots
        as outliers of a tenth of the σ are as likely as none."""
        count = len(self.likelihood.stated)
        keys = np.exp(np.clip(point[:count], -200, 200))
        keys = np.where(keys <= self.likelihood.least, 0.0, keys)
        share = 1 / (1 + np.exp(-point[count:]))
        share = np.where(share <= MIN_OUTLIER_SHARE, 0.0, np.minimum(share, MAX_OUTLIER_SHARE))
        return np.append(keys, share) if self.robust else keys

    def _log_likelihood(self, point: np.ndarray) -> float:
        values = self.to_values(point)
        self.evaluations += 1
        self.progress(self.evaluations, self._expected_evaluations())
        count = len(self.likelihood.stated)
        result = self.likelihood(values[:count], float(values[count]) if self.robust else 0.0)
        return result if math.isfinite(result) else IMPOSSIBLE_LOG_LIKELIHOOD

    def _expected_evaluations(self) -> int:
        """Expected number of evaluations: the maximum and each end at their usual cost, or at that of those found so
        far."""
        end_count, size = 2 * len(self.likelihood.keys), len(self.likelihood.keys) + self.robust
        explanation_cost = EXPLANATION_EVALUATIONS * (len(self.likelihood.explains) - self.robust)
        maximum_cost = self.ends_started_at or max(self.maximum_cost, self.evaluations)
        end_cost = (
            (self.evaluations - self.ends_started_at) / self.end_count if self.end_count else END_EVALUATIONS * size
        )
        return max(round(maximum_cost + end_cost * end_count), self.evaluations) + explanation_cost

    def _climb(
        self,
        start: np.ndarray,
        fixed_index: int | None,
        tolerance: float,
        simplex_evaluations: Sequence[int] = SIMPLEX_EVALUATIONS,
    ) -> tuple[np.ndarray, float]:
        """The maximum reached from a start, one coordinate held or none, and the log-likelihood there: by Newton steps,
        until one gains less than `close`; where they fail, by a simplex for a while."""
        free = np.array([i for i in range(len(start)) if i != fixed_index])
        point, value = start, self._log_likelihood(start)
        curvature = self.curvature_model if fixed_index is not None else Curvature(self._log_likelihood)
        for max_evaluations in simplex_evaluations:
            point, value, is_maximum = self._climb_by_newton(point, value, free, tolerance, curvature)
            if is_maximum:
                return point, value
            point, value = self._climb_by_simplex(point, free, tolerance, max_evaluations)
            curvature = Curvature(self._log_likelihood)
        return point, value

    def _climb_by_newton(
        self, point: np.ndarray, value: float, free: np.ndarray, tolerance: float, curvature: Curvature
    ) -> tuple[np.ndarray, float, bool]:
        """As `_climbed`, by Newton steps alone: where they end, and whether that is the maximum."""
        for _ in range(MAX_NEWTON_STEPS):
            point, value = self._set_zero(point, value, free)
            moving = free[point[free] > self.lowest[free]]
            if not moving.size:
                return point, value, True
            step, predicted_gain = curvature.step(point, value, moving)
            if not predicted_gain >= 0:
                break
            if predicted_gain < tolerance / 10:
                return point, value, True
            for fraction in (1.0, 0.5, 0.1, 0.01):
                trial_value = self._log_likelihood(point + fraction * step)
                if trial_value > value:
                    point, value = point + fraction * step, trial_value
                    break
                if predicted_gain < SMALL_GAIN_FACTOR * tolerance:
                    return point, value, True
            else:
                break
            if predicted_gain < SMALL_GAIN_FACTOR * tolerance:
                return point, value, True
            if fraction < 1 or predicted_gain > ROUGH_ACCURACY:
                curvature = Curvature(self._log_likelihood)
        return point, value, False

    def _set_zero(self, point: np.ndarray, value: float, free: np.ndarray) -> tuple[np.ndarray, float]:
        """A point and its likelihood, with free coordinates near zero set to zero, where that is no worse: the
        likelihood is flat in their logarithm there, and steps would never end."""
        for j in free:
            if self.lowest[j] < point[j] < self.lowest[j] + NEAR_ZERO_LOG:
                trial = point.copy()
                trial[j] = self.lowest[j] - FIRST_STEP
                if (trial_value := self._log_likelihood(trial)) >= value:
                    point, value = trial, trial_value
        return point, value

    def _climb_by_simplex(
        self, start: np.ndarray, free: np.ndarray, tolerance: float, max_evaluations: int
    ) -> tuple[np.ndarray, float]:
        """As `_climbed`, by a simplex, until it stands still within `close` or has taken `most` likelihoods."""
        from scipy.optimize import minimize

        point = start.copy()

        def cost(free_coordinates: np.ndarray) -> float:
            point[free] = free_coordinates
            return -self._log_likelihood(point)

        simplex = np.concatenate([start[None, free], start[free] + FIRST_STEP * np.eye(free.size)])
        options: Any = {
            "initial_simplex": simplex,
            "xatol": tolerance,
            "fatol": tolerance / 10,
            "maxfev": max_evaluations,
        }
        result = minimize(cost, start[free], method="Nelder-Mead", options=options)
        point[free] = result.x
        return point, -float(result.fun)

    def _profile(self, i: int, log_key: float, neighbour: np.ndarray) -> tuple[float, np.ndarray]:
        """The largest likelihood with key i held at the logarithm `at`, and its coordinates; others that are zero rise
        from there if that makes the plots likelier."""
        start = neighbour.copy()
        start[i] = log_key
        point, value = self._climb(start, i, TOLERANCE)
        for j, raised_log in self.raised_keys.items():
            if j != i and point[j] <= self.lowest[j]:
                for trial_log in (raised_log, *(raised_log - TRIAL_FALLS)):
                    start = point.copy()
                    start[j] = trial_log
                    if self._log_likelihood(start) > value:
                        point, value = self._climb(start, i, TOLERANCE)
                        break
        return value, point

    def refine_zero(self) -> bool:
        """Lower the values that count as zero where the likelihood leaps there; return whether any was lowered."""
        least_before = self.likelihood.least
        while leaping_keys := [i for i in range(len(self.likelihood.keys)) if self._has_leap_at_zero(i)]:
            is_zero = self.best <= self.lowest
            self.likelihood.least = np.array(self.likelihood.least)
            self.likelihood.least[leaping_keys] *= ZERO_REFINEMENT
            self.lowest[leaping_keys] += math.log(ZERO_REFINEMENT)
            self.best[is_zero] = self.lowest[is_zero] - FIRST_STEP
            self.top = self._log_likelihood(self.best)
        return self.likelihood.least is not least_before

    def _has_leap_at_zero(self, i: int) -> bool:
        """Whether the likelihood leaps at zero of a key, and is near the top there."""
        above, zero = (self._value_along(i, self.lowest[i] + sign * TOLERANCE) for sign in (1, -1))
        is_relevant = min(above, zero) > IMPOSSIBLE_LOG_LIKELIHOOD and max(above, zero) > self.top - HALF_CHI2_95
        return is_relevant and abs(above - zero) > LIKELIHOOD_LEAP

    def _may_be_zero(self, i: int) -> bool:
        """Whether the plots hardly distinguish a key, or the share of outliers, from zero: near zero its logarithm has
        no slope, on which a search stalls, though it must rise where another one is held too low. Tested a little above
        zero, since no filter has σ = 0."""
        return self._value_along(i, self.lowest[i] + TOLERANCE) > self.top - HALF_CHI2_95

    def _raised_log(self, i: int) -> float:
        """The logarithm of such a key at which a search has a slope: the likelihood has fallen from the maximum."""
        log = max(float(self.best[i]), float(self.lowest[i]))
        while self._value_along(i, log) > self.top - HALF_CHI2_95 and log < self.highest[i]:
            log += 1.0
        return log

    def _value_along(self, i: int, log: float) -> float:
        """The log-likelihood with one key changed and all others at the maximum."""
        point = self.best.copy()
        point[i] = log
        return self._log_likelihood(point)

    def interval(self, i: int) -> Fitted:
        """The 95 % profile interval of key i."""
        limit = self.top - HALF_CHI2_95
        lo, hi = (self._interval_end(i, direction, limit) for direction in (-1, 1))
        value = float(self.to_values(self.best)[i])
        lowest = self.lowest[i]
        bounds = (0.0 if lo is None or lo <= lowest else math.exp(lo), math.inf if hi is None else math.exp(hi))
        stated = float(self.likelihood.stated[i])
        return Fitted(self.likelihood.keys[i], stated, value, *bounds, bounds[0] > 0 and math.isfinite(bounds[1]))

    def _interval_end(self, i: int, direction: int, limit: float) -> float | None:
        """The logarithm of key i at which the profile falls to a limit; None if not within INTERVAL_REACH."""
        lowest = float(self.lowest[i])
        home = max(float(self.best[i]), float(self.lowest[i]))
        step = self._end_distance(i)
        # from zero the end may be farther than INTERVAL_REACH: up to there it is not
        if direction > 0 and i in self.raised_keys:
            home, step = max(home, self.raised_keys[i] - 1.0), 0.1
        inside = _ProfilePoint(home, self._value_along(i, home), self.best)
        while abs(inside.log_key - home) < math.log(INTERVAL_REACH):
            log_key = inside.log_key + direction * step
            outside = _ProfilePoint(log_key, *self._profile(i, log_key, inside.point))
            if outside.value < limit:
                self.end_count += 1
                return self._find_crossing(i, inside, outside, limit)
            if log_key < lowest:
                return None
            inside, step = outside, 2 * step
        return None

    def _find_crossing(self, i: int, inside: "_ProfilePoint", outside: "_ProfilePoint", limit: float) -> float:
        """The logarithm of key i at which the profile crosses a limit between two points: by secants of the square root
        of its fall from the maximum, which is nearly a straight line (Illinois method)."""

        def height(point: _ProfilePoint) -> float:
            fall = self.top - point.value
            return math.sqrt(2 * (self.top - limit)) - math.copysign(math.sqrt(2 * abs(fall)), fall)

        ends, values, replaced = [inside, outside], [height(inside), height(outside)], None
        while True:
            fraction, width = values[0] / (values[0] - values[1]), ends[1].log_key - ends[0].log_key
            log_key = ends[0].log_key + fraction * width
            trial = _ProfilePoint(
                log_key, *self._profile(i, log_key, ends[0].point + fraction * (ends[1].point - ends[0].point))
            )
            trial_height = height(trial)
            side = int(trial_height <= 0)
            if (
                abs(trial_height * width) < TOLERANCE * abs(values[0] - values[1])
                or abs(log_key - ends[side].log_key) < TOLERANCE
            ):
                return log_key
            ends[side], values[side] = trial, trial_height
            if side == replaced:
                values[1 - side] /= 2
            replaced = side

    def _end_distance(self, i: int) -> float:
        """A little more than the distance of an end from the maximum, if the likelihood were a parabola."""
        H = -self.curvature
        try:
            spread = float(np.linalg.inv(H)[i, i])
        except (np.linalg.LinAlgError, IndexError):  # IndexError: no curvature, where neighbours are impossible
            return 0.1
        return min(1.2 * math.sqrt(2 * HALF_CHI2_95 * spread), 1.0) if 0 < spread < math.inf else 0.1


def settings(fit_: Fit) -> dict[str, float]:
    """Settings for the config by key, to four digits; keys that the plots do not determine are left out."""
    return {row.key: float(f"{row.value:.4g}") for row in fit_.keys if row.identifiable and row.key != CORRELATION_TIME}


def as_rows(fit_: Fit) -> list[dict[str, Any]]:
    """The keys as rows of a table; columns plain…: those of the fit without outliers and correlation."""
    plain_cells = {row.key: (row.value, row.lo, row.hi) for row in (fit_.plain or fit_).keys}
    names = ("plain", "plain_lo", "plain_hi")
    return [asdict(row) | dict(zip(names, plain_cells.get(row.key, (None,) * 3), strict=True)) for row in fit_.keys]


# ---- advice ----------------------------------------------------------------------------------------------------------
FALSE_FINDING_LEVEL = 0.05  # of a false finding
MAX_FINDINGS = 3


@dataclass(frozen=True)
class Finding:
    """One explanation: the key (or one of EXPLANATIONS), its value (a share; a bias in σ; a correlation), and the
    increase of the log-likelihood over the findings before.

    from_zero: whether the plots distinguish a key's value from zero. turning: the cost of a smaller manoeuvre variance.
    """

    name: str
    value: float
    gain: float
    from_zero: bool = True
    turning: Turning | None = None


@dataclass(frozen=True)
class FilterComparison:
    """By how much the best filter predicts the plots better than each other: differences of the log-likelihood of the
    numbers that all of them take. fullest: the best predictor among those that take most columns of a plot."""

    best: str
    log_ratios: dict[str, float]
    most_columns: str


@dataclass(frozen=True)
class UsedRows:
    """The rows used for advice: their number, in how many stretches, spread over all tracks and the whole time."""

    rows: int
    stretches: int


@dataclass(frozen=True)
class Advice:
    """Advice from the likelihood of a config's filters over recorded plots: the best filter; the errors in the numbers
    of the one that takes most columns; the rows used. folding: where the velocities are folded, and nothing else is
    examined."""

    comparison: FilterComparison
    findings: list[Finding]
    used_rows: UsedRows
    folding: Folding | None = None


def advised(followed: Followed, progress: Progress = no_progress) -> Advice | None:
    """Advise on a config from a sample of the rows of all tracks; None if its study has no likelihood of plots.

    progress is called with the number of likelihoods computed."""
    case, interface = followed.case, recording_interface(followed.case)
    results = list(followed.tracks.values()) or [followed]
    stretches = [
        stretch for result in results for stretch in result.sample.stretches() if len(stretch["t_s"]) >= MIN_TRACK_ROWS
    ]
    if not stretches or unknown_inherited_keys(case, "likelihood"):
        return None
    sample = sample_rows(stretches, interface.rows_asked)
    candidates = [interface.likelihood(case, member.name, sample) for member in case.spec.members]
    likelihoods = {likelihood.filter: likelihood for likelihood in candidates if likelihood}
    if not likelihoods:
        return None
    comparison = compare_filters(list(likelihoods.values()))
    used_rows = UsedRows(sum(len(stretch["t_s"]) for stretch in sample), len(sample))
    if (folding := detect_case_folding(case, stretches)) is not None:
        return Advice(comparison, [], used_rows, folding)
    likelihood = likelihoods[comparison.most_columns]
    findings = [_with_turn_error(case, likelihood, finding) for finding in find_errors(likelihood, progress)]
    return Advice(comparison, findings, used_rows)


def _with_turn_error(case: Case, likelihood: Likelihood, finding: Finding) -> Finding:
    """Add to a finding the largest error in a turn, if it lowers a key."""
    stated = dict(zip(likelihood.keys, likelihood.stated.tolist(), strict=True))
    if finding.value >= stated.get(finding.name, -np.inf):
        return finding
    turning = recording_interface(case).in_a_turn(case, likelihood.filter, {finding.name: finding.value})
    return replace(finding, turning=turning)


def find_errors(likelihood: Likelihood, progress: Progress = no_progress) -> list[Finding]:
    """Errors in the configured numbers, the one with most weight first; empty if nothing is wrong."""
    from scipy.stats import chi2

    counted, names = CountedLikelihood(likelihood, progress), [*likelihood.keys, *likelihood.explains]
    needed = 0.5 * float(chi2.ppf(1 - FALSE_FINDING_LEVEL / len(names), 1))
    chosen_names: list[str] = []
    start: dict[str, float] = {}
    value_so_far, results = log_likelihood(counted, {}), []
    while len(chosen_names) < min(MAX_FINDINGS, len(names)):
        trials = {name: maximise(counted, [*chosen_names, name], start) for name in names if name not in chosen_names}
        best_name = max(trials, key=lambda name: trials[name][1])
        values, top = trials[best_name]
        if top - value_so_far < needed:
            break
        values, top = _polish_values(counted, values)
        results.append(Finding(best_name, values[best_name], top - value_so_far))
        chosen_names, start, value_so_far = [*chosen_names, best_name], values, top
    return [
        replace(
            finding,
            value=start[finding.name],
            from_zero=_is_distinguished_from_zero(counted, finding.name, start, value_so_far),
        )
        for finding in results
    ]


def _is_distinguished_from_zero(
    likelihood: CountedLikelihood, name: str, values: dict[str, float], maximum: float
) -> bool:
    """Whether the plots distinguish a key from zero, whatever the other keys are: tested where it is smaller than
    stated."""
    configured = dict(zip(likelihood.keys, likelihood.stated.tolist(), strict=True))
    if name not in configured or values[name] >= configured[name]:
        return True
    fixed = {key: value for key, value in (configured | values).items() if key != name}
    # An interval ends where it first leaves the maximum: in x and y a needle of σ = 0 across and kilometres along,
    # which turns with each measured bearing, explains errors across too.
    smaller = (float(likelihood.likelihood.least[likelihood.keys.index(name)]), values[name] / 2)
    return any(
        climb(LikelihoodSlice(likelihood, list(fixed), {name: lowest}), fixed)[1] < maximum - HALF_CHI2_95
        for lowest in smaller
    )


def compare_filters(likelihoods: Sequence[Likelihood]) -> FilterComparison:
    """Compare how well filters predict the plots with the configured numbers."""
    sums = {likelihood.filter: likelihood.by_number(np.asarray(likelihood.stated)) for likelihood in likelihoods}
    common = set.intersection(*(set(sums) for sums in sums.values()))
    totals = {name: sum(sums[number] for number in common) for name, sums in sums.items()}
    best_name = max(totals, key=lambda name: totals[name])
    column_count = max(len(sums) for sums in sums.values())
    full_sums = {name: sum(sums.values()) for name, sums in sums.items() if len(sums) == column_count}
    return FilterComparison(
        best_name,
        {name: totals[best_name] - total for name, total in totals.items()},
        max(full_sums, key=full_sums.__getitem__),
    )


def _polish_values(likelihood: CountedLikelihood, start: dict[str, float]) -> tuple[dict[str, float], float]:
    """Refine roughly searched values: printed numbers must not depend on the last digits of a processor."""
    slice_ = LikelihoodSlice(likelihood, list(start))
    point = polish_maximum(slice_, slice_.to_search(start))
    return slice_.to_values(point), slice_(point)
