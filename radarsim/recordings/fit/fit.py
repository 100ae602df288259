"""Fit the numbers of a config to recorded plots by maximum likelihood.

The filter's predictions give each plot a density; their product is the likelihood of the filter's parameters (Schweppe
1965). Estimates maximise it; intervals are those of `profile_intervals`. Besides the keys, outliers, a bias, or errors
correlated from plot to plot may explain the plots. Clear outliers and clear correlation are fitted too."""

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from radarsim.config.experiment import Case, Experiment
from radarsim.errors import ConfigError
from radarsim.language.current import use_language
from radarsim.recordings import read_plots
from radarsim.recordings.doppler_scale import doppler_scale_message
from radarsim.recordings.fit.folded_doppler import VELOCITY_COLUMN, folding_message
from radarsim.recordings.fit.likelihood_slice import (
    IMPOSSIBLE_LOG_LIKELIHOOD,
    CountedLikelihood,
    LikelihoodSlice,
    Progress,
    Rival,
    climb,
    half_chi2,
    maximise,
    no_progress,
    rival_of_outliers,
    single_explanations,
)
from radarsim.recordings.fit.profile_intervals import FittedKey, ProfileIntervals
from radarsim.recordings.fit.profile_search import EXPLANATION_EVALUATIONS, LikelihoodSearch, follows_another_law
from radarsim.recordings.fit.row_sample import MIN_TRACK_ROWS, ROUGH_ROWS, sample_rows
from radarsim.recordings.fit.velocity_faults import detect_case_velocity_fault, single_track_faults
from radarsim.recordings.rounding_guard import LOSS_GAP_PERIODS, gap_message
from radarsim.recordings.rows_by_track import split_by_track
from radarsim.recordings.study_part import recording_interface, refuse_inherited_part, single_case
from radarsim.recordings.target_speed import impossible_column_speed, speed_message, unreachable_rows
from radarsim.recordings.track_jumps import column_fault, column_positions
from radarsim.studies.error_law import (
    CLEAR_RISE,
    CORRELATION,
    MANOEUVRES,
    OUTLIERS,
    STATED_ERRORS,
    ErrorLaw,
    OutlierLaw,
)
from radarsim.studies.missed_scans import without_empty_rows
from radarsim.studies.recording_interface import Likelihood

FITTED_EXPLANATIONS = (OUTLIERS, CORRELATION)  # for which a fit can allow
SECOND_FIT_COST = 1.5  # evaluations of a fit that allows for more, in those of the plain one


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


SOUND_SIGMAS = 3.0  # by which a sound number may differ
MAX_OVERLAP = 0.002  # of the numbers that are near outliers and look sound: with more, a fit says so
OUTLIER_PROBABILITY = 0.5  # from which a number is named as an outlier
MAX_NAMED_ROWS = 5  # of plots far off, in a refusal
CORRELATION_TIME_KEY = "correlation_time_s"
ZERO_CORRELATION_TIME = 1e-4  # of the usual interval: a correlation time that counts as zero


@dataclass(frozen=True)
class Fit:
    """The fit: filter, tracks and plots used, the keys, the outliers of each kind of numbers (as in
    `Likelihood.outlier_kinds`) where allowed for, and the increase of the log-likelihood over the stated values;
    another explanation that the plots have: then the intervals do not hold; and the fit without outliers and
    correlation, where these are allowed for."""

    filter: str
    tracks: int
    rows: int
    keys: tuple[FittedKey, ...]
    outliers: Mapping[str, OutlierLaw]
    gain: float
    further_explanation: "FurtherExplanation | None" = None
    plain: "Fit | None" = None
    outlier_rows: tuple["OutlierRow", ...] = ()  # the numbers that are probably outliers
    knows_outliers: bool = True  # whether the likelihood can allow for them
    doubles: int = 0  # further plots of a track in a scan, left out
    fills: Mapping[str, int] = field(default_factory=dict)  # numbers that stand for none, left out, by column

    @property
    def has_overlap(self) -> bool:
        """Whether near outliers, which the plots plainly have, overlap the sound errors: how many look sound is
        uncertain then, and so is σ."""
        if self.plain is None or self.gain - self.plain.gain <= CLEAR_RISE:
            return False
        return any(share_within_sound(law) > MAX_OVERLAP for law in self.outliers.values())


def share_within_sound(law: OutlierLaw) -> float:
    """The share of numbers that are near outliers and differ by less than sound ones may."""
    width = math.sqrt(2 * (1 + law.spread**2))
    below, above = ((side * SOUND_SIGMAS - law.offset) / width for side in (-1, 1))
    return law.near * 0.5 * (math.erf(above) - math.erf(below))


class FurtherExplanation(NamedTuple):
    """An explanation besides the keys, one of EXPLANATIONS: its value, and the increase of the log-likelihood by it;
    rival: hard manoeuvres, where these explain the plots about as well as outliers; weaker_rival: where less well."""

    name: str
    value: float
    gain: float
    rival: Rival | None = None
    weaker_rival: Rival | None = None


class OutlierRow(NamedTuple):
    """A number of a recording that is an outlier: its track (its name; an index where tracks have none), time and
    column."""

    track: str | int
    t_s: float
    column: str


class CorrelatedLikelihood:
    """A likelihood with the correlation time of the errors as a further key, s: of an error a share exp(-t / it) is
    left after a time t (first-order Gauss-Markov process)."""

    def __init__(self, likelihood: Likelihood):
        self.likelihood = likelihood
        self.filter = likelihood.filter
        self.tracks = likelihood.tracks
        self.rows = likelihood.rows
        self.usual_s = likelihood.usual_s
        self.outlier_kinds, self.far_kinds = likelihood.outlier_kinds, likelihood.far_kinds
        self.has_offsets = likelihood.has_offsets
        self.is_smooth = likelihood.is_smooth
        self.keys, self.stated = (*likelihood.keys, CORRELATION_TIME_KEY), np.append(likelihood.stated, 0.0)
        self.zero_limits = np.append(likelihood.zero_limits, ZERO_CORRELATION_TIME * likelihood.usual_s)
        self.explains = tuple(name for name in likelihood.explains if name not in (CORRELATION, MANOEUVRES))

    def __call__(self, values: np.ndarray, law: ErrorLaw = STATED_ERRORS) -> float:
        """The logarithm of the likelihood; the correlation is that of the last of the values (n,), whatever the law."""
        return self.likelihood(values[:-1], self._correlated(values, law))

    def soundness(self, values: np.ndarray, law: ErrorLaw) -> Sequence[Mapping[str, np.ndarray]]:
        """As the likelihood's, with the correlation of the last of the values."""
        return self.likelihood.soundness(values[:-1], self._correlated(values, law))

    def _correlated(self, values: np.ndarray, law: ErrorLaw) -> ErrorLaw:
        return replace(law, correlation=math.exp(-self.usual_s / values[-1]) if values[-1] else 0.0)

    def by_number(self, values: np.ndarray) -> Mapping[str, float]:
        """The same for the keys alone, without correlation."""
        return self.likelihood.by_number(values[:-1])


class FileLikelihoods(NamedTuple):
    """The likelihood of a filter over all tracks of a file, and over a sample of its rows; the tracks' names, None
    where they have none; how many further plots of a scan are left out, and velocities that stand for none."""

    complete: Likelihood
    rough: Likelihood | None
    track_names: list[str | None]
    doubles: int
    fills: Mapping[str, int]


def file_likelihoods(
    experiment: Experiment, source: str | os.PathLike, filter_name: str | None = None
) -> FileLikelihoods:
    """The likelihoods of a filter of an experiment's one case over a file; without a name, of one of those that take
    most columns of a plot. Raises ConfigError."""
    case = single_case(experiment, "fit", f"radarsim fit {{}} {os.fspath(source)}")
    refuse_inherited_part(case, "likelihood")
    interface = recording_interface(case)
    filter_names = [member.name for member in case.spec.members]
    if filter_name is not None and filter_name not in filter_names:
        user_filters = [user_filter.name for user_filter in case.user_filters]
        why = ": it is written in Python, and radarsim does not know its keys" if filter_name in user_filters else ""
        raise ConfigError(f"filter: must be one of {', '.join(filter_names)}; got {filter_name}{why}")
    tracks, doubles, fills = _read_tracks(source, interface.columns(case.spec), interface.from_any_origin)
    names = [name for name, columns in tracks.items() if len(columns["t_s"]) >= MIN_TRACK_ROWS]
    long_tracks = [tracks[name] for name in names]
    if not long_tracks:
        raise ConfigError(f"{source}: must have a track of at least {MIN_TRACK_ROWS} rows")
    if constant_columns := [
        name for name in long_tracks[0] if name != "t_s" and all(np.ptp(columns[name]) == 0 for columns in long_tracks)
    ]:
        raise ConfigError(
            f"{source}: {constant_columns[0]}: must differ between plots, or σ cannot be estimated; all are the same"
        )
    likelihood = interface.likelihood(case, filter_name, long_tracks)
    _refuse_impossible_motion(source, case, likelihood, {name or "": tracks[name] for name in names})
    if likelihood is None:
        raise ConfigError(
            no_likelihood_message(
                case, filter_name, [name for name in filter_names if interface.likelihood(case, name, long_tracks)]
            )
        )
    _refuse_gross_errors(source, likelihood, {name or "": tracks[name] for name in names})
    _refuse_lost_digits(source, case, likelihood, long_tracks)
    sample = sample_rows(long_tracks, min(ROUGH_ROWS, interface.rows_asked))
    rough = interface.likelihood(case, likelihood.filter, sample)
    return FileLikelihoods(likelihood, rough, names, doubles, fills)


def _refuse_impossible_motion(
    source: str | os.PathLike, case: Case, likelihood: Likelihood | None, named: Mapping[str, Mapping[str, np.ndarray]]
) -> None:
    """Raise ConfigError if no target moves as a track does, by its name, or if velocities that a likelihood takes are
    folded, or a multiple of the change of the range: their σ would mean nothing."""
    tracks = list(named.values())
    with use_language("en"):  # as all faults
        if speed := impossible_column_speed(tracks):
            raise ConfigError(f"{source}: {speed_message(speed)}")
        if course_fault := column_fault({name: [columns] for name, columns in named.items()}):
            raise ConfigError(f"{source}: {course_fault.message()}")
    if likelihood is None or VELOCITY_COLUMN not in likelihood.by_number(np.asarray(likelihood.stated)):
        return
    fault = detect_case_velocity_fault(case, tracks)
    with use_language("en"):  # as all faults
        if notes := single_track_faults(case, {name: [columns] for name, columns in named.items()}):
            raise ConfigError(*(f"{source}: {note}" for note in notes))
        if fault.folding is not None:
            raise ConfigError(f"{source}: {folding_message(fault.folding, case)}")
        if fault.scale is not None:
            raise ConfigError(f"{source}: {doppler_scale_message(fault.scale)}")


def _refuse_gross_errors(
    source: str | os.PathLike, likelihood: Likelihood, named: Mapping[str, Mapping[str, np.ndarray]]
) -> None:
    """Raise ConfigError if rows of tracks, by their names, are where no target comes, and the likelihood knows no
    outliers: the σ fitted would be that of these rows."""
    if OUTLIERS in likelihood.explains:
        return
    places = [
        f"{t_s:g} s{name and f' ({name})'}"
        for name, columns in named.items()
        if (track := column_positions(columns)) is not None
        for t_s in track.t_s[unreachable_rows(track)]
    ]
    if places:
        more = f" and {len(places) - MAX_NAMED_ROWS} more" if len(places) > MAX_NAMED_ROWS else ""
        raise ConfigError(
            f"{source}: plots far off, where the target cannot be, at {', '.join(places[:MAX_NAMED_ROWS])}{more}; "
            f"the likelihood of filter {likelihood.filter} knows no outliers, so that σ would be theirs: leave these "
            "plots out"
        )


def _refuse_lost_digits(
    source: str | os.PathLike, case: Case, likelihood: Likelihood, tracks: Sequence[Mapping[str, np.ndarray]]
) -> None:
    """Raise ConfigError if a gap leaves no digit of the likelihood."""
    gap_s = max(float(np.diff(track["t_s"]).max(initial=0.0)) for track in tracks)
    is_long = gap_s > LOSS_GAP_PERIODS * recording_interface(case).scan_period_s(case.spec)
    if is_long and not np.isfinite(sum(likelihood.by_number(np.asarray(likelihood.stated)).values())):
        raise ConfigError(f"{source}: t_s: {gap_message(gap_s)}")


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
) -> tuple[dict[str | None, dict[str, np.ndarray]], int, Mapping[str, int]]:
    """The columns (n,) of each track of a file of plots, by its name, without empty rows; and how many further plots of
    a scan are left out, and numbers that stand for none, by column."""
    pieces_by_track, doubles = dict[str | None, list[dict[str, np.ndarray]]](), 0
    fills: Mapping[str, int] = {}
    for piece in read_plots.pieces(source, choices, any_origin=any_origin):
        doubles, fills = piece.doubles, piece.fills
        for rows in split_by_track(piece):
            if rows.name != "":
                pieces_by_track.setdefault(rows.name, []).append(rows.columns)
    tracks = {
        name: without_empty_rows({key: np.concatenate([piece[key] for piece in pieces]) for key in pieces[0]})
        for name, pieces in pieces_by_track.items()
    }
    return tracks, doubles, fills


def fit_plots(
    experiment: Experiment,
    source: str | os.PathLike,
    filter_name: str | None = None,
    allowing: Sequence[str] | None = None,
    progress: Progress = no_progress,
) -> Fit:
    """Fit the config's numbers to the plots of a file; allowing: for these of OUTLIERS and CORRELATION; None: for those
    that are plain. progress is called with the number of likelihoods computed. Raises ConfigError."""
    likelihoods = file_likelihoods(experiment, source, filter_name)
    fitted = fit_likelihood(likelihoods.complete, likelihoods.rough, allowing, progress)
    rows = tuple(
        row._replace(track=likelihoods.track_names[int(row.track)] or row.track) for row in fitted.outlier_rows
    )
    return replace(fitted, doubles=likelihoods.doubles, fills=likelihoods.fills, outlier_rows=rows)


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
        result = fit_keys(likelihood, allowed, stages.next(), rough, plain)
    while allowing is None and (explanation := result.further_explanation) and _is_clear_error(explanation):
        allowed = (*allowed, explanation.name)
        try:
            further = fit_keys(likelihood, allowed, stages.next(), rough, plain)
        except ConfigError:  # so many outliers that the errors follow another law: the plain fit reports it
            break
        if explanation.weaker_rival is not None and not further.outlier_rows:
            # Outliers of which no row is one may be manoeuvres.
            explanation = explanation._replace(rival=explanation.weaker_rival)
            return replace(result, further_explanation=explanation, plain=None if result is plain else plain)
        result = further
    return result if result is plain else replace(result, plain=plain)


def _is_clear_error(explanation: FurtherExplanation) -> bool:
    """Whether outliers or correlation raise the likelihood by more than chance does in one recording of 1000, and
    nothing else does as well."""
    return explanation.name in FITTED_EXPLANATIONS and explanation.gain > CLEAR_RISE and explanation.rival is None


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
    plain: Fit | None = None,
) -> Fit:
    """The keys at the maximum of a likelihood, with profile intervals; allowing: for these of OUTLIERS and CORRELATION;
    rough: the likelihood of fewer rows, for a first search; plain: a fit that allows for none. Raises ConfigError where
    these cannot be allowed for, or the plots are impossible whatever the keys."""
    check_explanations(likelihood, allowing)
    robust = OUTLIERS in allowing
    if CORRELATION in allowing:
        likelihood, rough = CorrelatedLikelihood(likelihood), rough and CorrelatedLikelihood(rough)
    start = LikelihoodSearch(rough, robust, no_progress).best if rough and rough.rows < likelihood.rows else None
    plain_values = [key.value for key in plain.keys] if plain else []
    search = LikelihoodSearch(likelihood, robust, progress, start, plain_values)
    while search.refine_zero():
        search.raise_zero_keys()
    if search.top <= IMPOSSIBLE_LOG_LIKELIHOOD:
        raise ConfigError(f"filter {likelihood.filter} cannot take the plots: `radarsim track` says at which row")
    law = search.law(search.best)
    shares = [outliers.share for outliers in law.outlier_laws if follows_another_law(outliers)]
    if shares:
        raise ConfigError(
            f"robust: {100 * max(shares):.0f} % of the plots would have to be outliers: their errors follow another "
            "law (few different values?); fit without it"
        )
    intervals = ProfileIntervals(search)
    keys = tuple(intervals.interval(i) for i in range(len(likelihood.keys)))
    gain = likelihood(search.to_values(search.best), law) - likelihood(np.array(likelihood.stated))
    return Fit(
        likelihood.filter,
        likelihood.tracks,
        likelihood.rows,
        keys,
        dict(zip(likelihood.outlier_kinds, law.outlier_laws, strict=False)),
        gain,
        _find_further_explanation(search, likelihood),
        outlier_rows=_outlier_rows(search, likelihood),
        knows_outliers=OUTLIERS in likelihood.explains,
    )


def _outlier_rows(search: "LikelihoodSearch", likelihood: Likelihood) -> tuple[OutlierRow, ...]:
    """The numbers that are probably outliers at the maximum, and the gross errors before the start of a track."""
    values = search.to_values(search.best)
    return find_outlier_rows(likelihood, values, search.law(search.best))


def find_outlier_rows(
    likelihood: Likelihood, values: np.ndarray, law: ErrorLaw = STATED_ERRORS
) -> tuple[OutlierRow, ...]:
    """The numbers that are outliers with a probability of over 1/2, for values of the keys and a law of errors; none
    where the likelihood knows no outliers."""
    if OUTLIERS not in likelihood.explains:
        return ()
    tracks = likelihood.soundness(values, law)
    return tuple(
        OutlierRow(number, float(track["t_s"][row]), name)
        for number, track in enumerate(tracks)
        for name in track
        if name != "t_s"
        for row in np.flatnonzero(track[name] < 1 - OUTLIER_PROBABILITY)
    )


def _find_further_explanation(search: "LikelihoodSearch", likelihood: Likelihood) -> FurtherExplanation | None:
    """The explanation that raises the maximum most in addition to the fitted keys.

    None if it raises it by less than chance does in one recording of twenty."""
    fitted_values = search.to_values(search.best).tolist()
    fixed = dict(zip(likelihood.keys, fitted_values, strict=True))
    names = [name for name in single_explanations(likelihood) if name != OUTLIERS or not search.robust]
    expected = search.evaluations + EXPLANATION_EVALUATIONS * len(names)
    law = search.law(search.best)
    counted_likelihood = CountedLikelihood(likelihood, search.progress, search.evaluations, expected, law)
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
        maxima[i] = max(maxima[i], (values, maximum), key=lambda maximum: maximum[1])
    if not maxima:
        return None
    (values, maximum), name = max(zip(maxima, names, strict=True), key=lambda candidate: candidate[0][1])
    needed_gain = half_chi2(0.95 ** (1 / len(maxima)))
    if maximum <= search.top + needed_gain:
        return None
    value, all_values = values[name], fixed | values
    rival = rival_of_outliers(counted_likelihood, fixed | {name: value}) if name == OUTLIERS else None
    weaker_rival = None
    if rival is not None and rival.is_clear:
        if rival.gain > 0:
            name, value, maximum, rival = MANOEUVRES, rival.share, maximum + rival.gain, None
        elif find_outlier_rows(
            likelihood, np.array([all_values[key] for key in likelihood.keys]), replace(law, outliers=value)
        ):
            rival, weaker_rival = None, rival
    return FurtherExplanation(name, value, maximum - search.top, rival, weaker_rival)


def fitted_settings(fit_: Fit) -> dict[str, float]:
    """Settings for the config by key, to four digits; keys that the plots do not determine are left out."""
    return {
        row.key: float(f"{row.value:.4g}") for row in fit_.keys if row.identifiable and row.key != CORRELATION_TIME_KEY
    }


def fit_rows(fit_: Fit) -> list[dict[str, Any]]:
    """The keys as rows of a table; columns plain…: those of the fit without outliers and correlation."""
    plain_cells = {row.key: (row.value, row.lo, row.hi) for row in (fit_.plain or fit_).keys}
    names = ("plain", "plain_lo", "plain_hi")
    return [asdict(row) | dict(zip(names, plain_cells.get(row.key, (None,) * 3), strict=True)) for row in fit_.keys]
