"""Advise on a config from recorded plots: the best filter, and errors in its numbers.

The likelihood finds errors in the config's numbers. Each explanation (a σ, the manoeuvre variance, a bias of the
velocity, outliers, errors correlated from plot to plot) is fitted alone. The one that raises the likelihood most is
reported, if it raises it by more than chance does in one recording of twenty, over all explanations; the search then
continues with it included. For a recording with correct numbers nothing is reported.

The advice is about the filter that takes most columns of a plot. A filter that takes fewer says nothing about the
others, and may predict the ranges best just because the velocities are bad."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from radarsim.config.experiment import Case
from radarsim.recordings.doppler_scale import DopplerScale
from radarsim.recordings.fit.fit import OutlierRow, find_outlier_rows
from radarsim.recordings.fit.folded_doppler import Folding
from radarsim.recordings.fit.likelihood_slice import (
    CountedLikelihood,
    LikelihoodSlice,
    Progress,
    Rival,
    climb,
    half_chi2,
    is_least_share,
    log_likelihood,
    maximise,
    no_progress,
    rival_of_outliers,
    single_explanations,
)
from radarsim.recordings.fit.newton_steps import LEAP_STEPS, SMOOTH_STEPS, polish_maximum
from radarsim.recordings.fit.profile_search import HALF_CHI2_95
from radarsim.recordings.fit.row_sample import MIN_TRACK_ROWS, sample_rows
from radarsim.recordings.fit.velocity_faults import detect_case_velocity_fault, single_track_faults
from radarsim.recordings.study_part import recording_interface, unknown_inherited_keys
from radarsim.recordings.target_speed import impossible_column_speed
from radarsim.recordings.track_jumps import CourseFault, column_fault
from radarsim.recordings.tracking_result import TrackingResult
from radarsim.studies.error_law import CORRELATION, MANOEUVRES, OUTLIERS, ErrorLaw
from radarsim.studies.missed_scans import without_empty_rows
from radarsim.studies.recording_interface import Likelihood, TurnError, likeliest

FALSE_FINDING_LEVEL = 0.05  # of a false finding
MAX_FINDINGS = 3


@dataclass(frozen=True)
class Finding:
    """One explanation: the key (or one of EXPLANATIONS), its value (a share; a bias in σ; a correlation), and the
    increase of the log-likelihood over the findings before.

    from_zero: whether the plots distinguish a key's value from zero. turning: the cost of a smaller manoeuvre variance.
    rival: hard manoeuvres, where these explain the plots about as well as outliers. rows: numbers that are outliers."""

    name: str
    value: float
    gain: float
    from_zero: bool = True
    turning: TurnError | None = None
    rival: Rival | None = None
    rows: tuple[OutlierRow, ...] = ()


@dataclass(frozen=True)
class FilterComparison:
    """By how much the best filter predicts the plots better than each other: differences of the log-likelihood of the
    numbers that all of them take. most_columns: the best predictor among those that take most columns of a plot."""

    best: str
    log_ratios: dict[str, float]
    most_columns: str


@dataclass(frozen=True)
class UsedRows:
    """The rows used for advice: their number, in how many stretches, spread over all tracks and the whole time; beside
    them those without a plot."""

    rows: int
    stretches: int
    empty: int


@dataclass(frozen=True)
class Advice:
    """Advice from the likelihood of a config's filters over recorded plots: the best filter; the errors in the numbers
    of the one that takes most columns; the rows used. folding, doppler_scale: where the velocities are folded, or a
    multiple of the change of the range; impossible_speed: that no target has, m/s; course_fault: where positions jump
    or alternate; velocity_faults: of some tracks alone; nothing else is then examined. start_errors: outliers at the
    values of the config, as plots too far off to start a track."""

    comparison: FilterComparison
    findings: list[Finding]
    used_rows: UsedRows
    folding: Folding | None = None
    doppler_scale: DopplerScale | None = None
    impossible_speed: float | None = None
    course_fault: CourseFault | None = None
    velocity_faults: tuple[str, ...] = ()
    start_errors: tuple[OutlierRow, ...] = ()


def advise(followed: TrackingResult, progress: Progress = no_progress) -> Advice | None:
    """Advise on a config from a sample of the rows of all tracks; None if its study has no likelihood of plots.

    progress is called with the number of likelihoods computed."""
    case, interface = followed.case, recording_interface(followed.case)
    results = list(followed.tracks.values()) or [followed]
    kept = [stretch for result in results for stretch in result.sample.stretches()]
    with_plots = [without_empty_rows(stretch) for stretch in kept]
    stretches = [stretch for stretch in with_plots if len(stretch["t_s"]) >= MIN_TRACK_ROWS]
    if not stretches or unknown_inherited_keys(case, "likelihood"):
        return None
    sample = sample_rows(stretches, interface.rows_asked)
    candidates = [interface.likelihood(case, member.name, sample) for member in case.spec.members]
    likelihoods = {likelihood.filter: likelihood for likelihood in candidates if likelihood}
    if not likelihoods:
        return None
    comparison = compare_filters(list(likelihoods.values()))
    rows = [sum(len(stretch["t_s"]) for stretch in group) for group in (sample, kept, with_plots)]
    used_rows = UsedRows(rows[0], len(sample), empty=rows[1] - rows[2])
    if speed := impossible_column_speed(stretches):
        return Advice(comparison, [], used_rows, impossible_speed=speed)
    if course_fault := column_fault(_stretches_by_track(followed)):
        return Advice(comparison, [], used_rows, course_fault=course_fault)
    if notes := single_track_faults(case, _stretches_by_track(followed)):
        return Advice(comparison, [], used_rows, velocity_faults=tuple(notes))
    fault = detect_case_velocity_fault(case, stretches)
    if fault.folding is not None or fault.scale is not None:
        return Advice(comparison, [], used_rows, fault.folding, fault.scale)
    likelihood = likelihoods[comparison.most_columns]
    findings = [_with_turn_error(case, likelihood, finding) for finding in find_errors(likelihood, progress)]
    start_errors = find_outlier_rows(likelihood, np.asarray(likelihood.stated))
    named_rows = {row for finding in findings for row in finding.rows}
    start_errors = tuple(row for row in start_errors if row not in named_rows)
    return Advice(comparison, findings, used_rows, start_errors=start_errors)


def _stretches_by_track(followed: TrackingResult) -> dict[str, list[dict[str, np.ndarray]]]:
    """The sampled rows of each track by its name, '' of one that has none."""
    return {name: result.sample.stretches() for name, result in (followed.tracks or {"": followed}).items()}


def _with_turn_error(case: Case, likelihood: Likelihood, finding: Finding) -> Finding:
    """Add to a finding the largest error in a turn, if it lowers a key."""
    stated = dict(zip(likelihood.keys, likelihood.stated.tolist(), strict=True))
    if finding.value >= stated.get(finding.name, -np.inf):
        return finding
    turning = recording_interface(case).in_a_turn(case, likelihood.filter, {finding.name: finding.value})
    return replace(finding, turning=turning)


def find_errors(likelihood: Likelihood, progress: Progress = no_progress) -> list[Finding]:
    """Errors in the configured numbers, the one with most weight first; empty if nothing is wrong."""
    counted, names = CountedLikelihood(likelihood, progress), [*likelihood.keys, *single_explanations(likelihood)]
    needed = half_chi2(1 - FALSE_FINDING_LEVEL / len(names))
    chosen_names: list[str] = []
    start: dict[str, float] = {}
    value_so_far, results, weaker_rival = log_likelihood(counted, {}), [], None
    while len(chosen_names) < min(MAX_FINDINGS, len(names)):
        trials = {name: maximise(counted, [*chosen_names, name], start) for name in names if name not in chosen_names}
        trials = {name: maximum for name, maximum in trials.items() if not is_least_share(name, maximum[0][name])}
        if not trials:
            break
        best_name = max(trials, key=lambda name: trials[name][1])
        values, top = trials[best_name]
        if top - value_so_far < needed:
            break
        if best_name == CORRELATION and _explain_better(counted, chosen_names, start, top):
            names = [name for name in names if name != CORRELATION]
            continue
        rival = rival_of_outliers(counted, values) if best_name == OUTLIERS else None
        if rival is not None and rival.is_clear:
            if rival.gain > 0:
                # Where errors last they are states, whose noise a hard manoeuvre would raise too.
                names = [MANOEUVRES if name == OUTLIERS else name for name in names if name != CORRELATION]
                best_name = MANOEUVRES
                values, top = maximise(counted, [*chosen_names, best_name], start)
            else:
                weaker_rival = rival
            rival = None
        values, top = _polish_values(counted, values)
        results.append(Finding(best_name, values[best_name], top - value_so_far, rival=rival))
        chosen_names, start, value_so_far = [*chosen_names, best_name], values, top
    rows = _rows_of_outliers(likelihood, start) if OUTLIERS in start else ()
    return [
        replace(
            finding,
            value=start[finding.name],
            from_zero=_is_distinguished_from_zero(counted, finding.name, start, value_so_far),
            rows=rows if finding.name == OUTLIERS else (),
            # Outliers of which no row is one may be manoeuvres, however the likelihood prefers them.
            rival=finding.rival or (weaker_rival if finding.name == OUTLIERS and not rows else None),
        )
        for finding in results
        if not is_least_share(finding.name, start[finding.name])  # what was found after it explains the plots too
    ]


def _explain_better(
    likelihood: CountedLikelihood, chosen_names: Sequence[str], start: dict[str, float], top: float
) -> bool:
    """Whether the keys together explain the plots better than errors that last do, whose log-likelihood is `top`: where
    several σ are far too large, each alone explains less."""
    names, values, value = list(chosen_names), start, -np.inf
    for key in likelihood.likelihood.keys:
        if key not in names:
            names.append(key)
            values, value = maximise(likelihood, names, values)
    return value > top


def _rows_of_outliers(likelihood: Likelihood, fitted_values: Mapping[str, float]) -> tuple[OutlierRow, ...]:
    """The rows that are outliers, for fitted values of keys and explanations."""
    stated = zip(likelihood.keys, likelihood.stated, strict=True)
    values = np.array([fitted_values.get(key, value) for key, value in stated])
    law = ErrorLaw(outliers=fitted_values[OUTLIERS], correlation=fitted_values.get(CORRELATION, 0.0))
    return find_outlier_rows(likelihood, values, law)


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
    smaller = (float(likelihood.likelihood.zero_limits[likelihood.keys.index(name)]), values[name] / 2)
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
    full_likelihoods = [likelihood for likelihood in likelihoods if len(sums[likelihood.filter]) == column_count]
    return FilterComparison(
        best_name,
        {name: totals[best_name] - total for name, total in totals.items()},
        likeliest(full_likelihoods).filter,
    )


def _polish_values(likelihood: CountedLikelihood, start: dict[str, float]) -> tuple[dict[str, float], float]:
    """Refine roughly searched values: printed numbers must not depend on the last digits of a processor."""
    slice_ = LikelihoodSlice(likelihood, list(start))
    steps = SMOOTH_STEPS if likelihood.likelihood.is_smooth else LEAP_STEPS
    point = polish_maximum(slice_, slice_.to_search(start), steps)
    return slice_.to_values(point), slice_(point)
