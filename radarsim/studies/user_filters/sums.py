"""Sums of the errors of user filters, paired with those of a study's own filters.

For each realisation the errors of the config's own filters are computed again, so that gains of a user filter are
paired with each of them, in any study that draws plots; the sums of the study do not change.

A realisation fails where not-a-number follows an estimate, where an estimate is infinite, where there is none although
a filter of the config has one, and where an error is more than a hundred times the largest error of the config's
filters in it. Its errors enter no sum, so that σ and gains are over the other realisations; the number of failures is
counted."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Axes, CaseResult
from radarsim.engine.sums import Layout
from radarsim.errors import ConfigError
from radarsim.studies.plot_arrays import World, estimate_errors
from radarsim.studies.user_filters.estimates import check_estimates, columns_of
from radarsim.studies.user_filters.filters import Plots, UserFilter
from radarsim.studies.user_filters.independence import Dependence, dependence
from radarsim.studies.user_filters.plots import drawing_setup, plots_for_filter

if TYPE_CHECKING:
    from radarsim.studies.interface import Study
    from radarsim.studies.plot_arrays import DrawPlots, SimulatedPlots


DIVERGENCE_RATIO = 100.0  # times the largest error of the config's filters in the same realisation
FAILURES = ("not_a_number", "no_estimate", "diverged")
COUNTS = (*FAILURES, "not_positive_definite")
MAX_NEES = 1e100  # its square is added up as well
PAIRED = 7  # sums over the realisations that both have: 1, e², e⁴, b², b⁴, e²b², (e² − b²)⁴


@dataclass(frozen=True)
class UserFilterAxes(Axes):
    """Axes of user filters. baselines: those that the gains of the config's filters refer to as well; identities: what
    the numbers of each depend on; answer_at: as in `UserFilter`."""

    baselines: tuple[str, ...] = ()
    identities: tuple[str, ...] = ()
    answer_at: tuple[str, float] | None = None
    answer_points: tuple[tuple[str, float], ...] = ()  #: see `Study.answer_points`
    training_ratios: tuple[tuple[str, float], ...] = ()  #: by the name of a filter: see `UserFilter.note_training`
    dependent: tuple[tuple[str, Dependence], ...] = ()  #: filters whose intervals do not hold, and why
    faults: tuple[tuple[str, str], ...] = ()  #: by the name of a filter: see `UserFilter.note_faults`


@dataclass(frozen=True)
class Plan:
    """The plan of a case's user filters, with the study's own plan, `inner`."""

    study: "Study"
    inner: Any
    draw: "DrawPlots"
    world: World
    scans: np.ndarray  #: (K,) places of the axes' scans among all scans
    members: tuple[UserFilter, ...]
    axes: UserFilterAxes
    layout: Layout

    gaussian = False

    @property
    def block(self) -> int:
        return int(self.inner.block)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(name for name, _ in self.axes.components)

    @cached_property
    def dependences(self) -> dict[str, Dependence]:
        """Why realisations of each filter depend on each other; empty where they do not."""
        return {member.name: dependence(self, member) for member in self.members}

    def invalid_intervals(self, count: int) -> tuple[tuple[str, Dependence], ...]:
        """The filters without intervals among so many realisations, and why; one block alone repeats nothing."""
        reasons: dict[str, Dependence] = {
            member.name: self.dependences[member.name]
            or ("others" if self.world.case in member.dependent_cases else "")
            for member in self.members
        }
        return tuple(
            (name, reason)
            for name, reason in reasons.items()
            if reason and (reason != "repeated" or count > self.block)
        )


def prepare(study: "Study", case: Case, inner: Any) -> Plan:
    """The plan of a case's user filters. Raises ConfigError where their errors cannot be paired with the study's."""
    axes = inner.axes
    draw, world, scans = drawing_setup(study, case, inner)
    names = [member.name for member in case.user_filters]
    if taken_names := [name for i, name in enumerate(names) if name in (*axes.filters, *names[:i])]:
        raise ConfigError(f"{case.name}: name: there is a filter {taken_names[0]!r} already; give another name")
    G, (F, K, C) = len(names), axes.available.shape
    layout = Layout(
        error=(G, K, C, 4),
        estimates=(G, K, C),
        both=(G, F + G, K, C, PAIRED),
        nees=(G, K, 3),
        failures=(G, len(COUNTS)),
    )
    unknown = np.full((G, K, C), np.nan)
    labels = tuple(names), axes.components, axes.k, axes.t_s, np.ones((G, K, C), dtype=bool), 0, unknown, unknown
    baselines = tuple(member.name for member in case.user_filters if member.baseline)
    answer_at = next((member.answer_at for member in case.user_filters if member.answer_at), None)
    user_axes = UserFilterAxes(*labels, baselines, tuple(member.identity for member in case.user_filters), answer_at)
    return Plan(study, inner, draw, world, scans, case.user_filters, user_axes, layout)


def with_other_noise(plan: Plan, case: Case, seed: int) -> Plan:
    """The plan of a case's user filters with the noise of another seed."""
    other_case = replace(case, seed=seed, user_filters=())
    inner = plan.study.prepare(other_case)
    draw, world, _ = drawing_setup(plan.study, other_case, inner)
    return replace(plan, inner=inner, draw=draw, world=world)


def plots_of(plan: Plan, plots: "SimulatedPlots") -> Plots:
    """Plots as a filter of a plan sees them."""
    return plots_for_filter(plan.world, plots)


def inner_errors(plan: Plan, first: int, count: int) -> np.ndarray:
    """Errors (F, n, K, C) of the study's own filters, not-a-number where one has no estimate."""
    errors = np.ascontiguousarray(plan.study.errors(plan.inner, first, count))
    errors.swapaxes(0, 1)[:, ~np.asarray(plan.inner.axes.available)] = np.nan
    return errors


@dataclass(frozen=True)
class FilterErrors:
    """Errors (n, K, C) of a filter, not-a-number where it has no estimate or the realisation fails; failed (n, 4):
    which of COUNTS apply to each realisation; nees (n, K)."""

    error: np.ndarray
    failed: np.ndarray
    nees: np.ndarray


def filter_errors(
    plan: Plan, member: UserFilter, answer: Any, plots: "SimulatedPlots", scale: np.ndarray
) -> FilterErrors:
    """The errors of a filter's estimates. scale (n, C): the largest error of the study's own filters."""
    names, K = plan.names, len(plan.world.t_s)
    x, P = check_estimates(member.name, answer, plots.n, K, names, member.components)
    places = columns_of(member.name, x.shape[2], names, member.components)
    has_estimate, finite = np.maximum.accumulate(np.isfinite(x), axis=1), np.isfinite(x)
    failed = np.zeros((plots.n, len(COUNTS)), dtype=bool)
    failed[:, 0] = (has_estimate & ~finite).any((1, 2)) | np.isinf(x).any((1, 2))
    failed[:, 1] = ~failed[:, 0] & ~finite.any((1, 2)) & np.isfinite(scale).any(1)
    error = np.full((plots.n, len(plan.scans), len(names)), np.nan)
    components = [plan.axes.components[c] for c in places]
    error[..., places] = estimate_errors(x[:, plan.scans], plots.truth_of(components)[:, plan.scans], components)
    with np.errstate(invalid="ignore"):
        failed[:, 2] = ~failed[:, 0] & (np.abs(error) > DIVERGENCE_RATIO * scale[:, None]).any((1, 2))
    error[failed.any(1)] = np.nan
    nees = np.full(error.shape[:2], np.nan)
    if P is not None:
        covariances, has_both = P[:, plan.scans], np.isfinite(error[..., places]).all(-1)
        has_both &= np.isfinite(covariances).all((-2, -1))
        nees[has_both], proper = normalised(error[has_both][:, places], covariances[has_both])
        failed[np.nonzero(has_both)[0][~proper], 3] = True
    return FilterErrors(error, failed, nees)


def normalised(e: np.ndarray, P: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """eᵀP⁻¹e over its degrees of freedom (m,), of errors (m, d), covariances (m, d, d); not-a-number of those that are
    not positive definite, or so nearly so that it is beyond MAX_NEES, and which are (m,). By Cholesky's root, column by
    column of all of them."""
    m, d = e.shape
    L, w = np.zeros((m, d, d)), np.zeros((m, d))
    proper = (np.abs(P - np.swapaxes(P, 1, 2)) <= 1e-6 * np.abs(P).max((1, 2), initial=0)[:, None, None]).all((1, 2))
    for j in range(d):
        pivot = P[:, j, j] - (L[:, j, :j] ** 2).sum(1)
        proper &= pivot > 0
        L[:, j, j] = np.sqrt(np.where(pivot > 0, pivot, 1))
        w[:, j] = (e[:, j] - (L[:, j, :j] * w[:, :j]).sum(1)) / L[:, j, j]
        L[:, j + 1 :, j] = (P[:, j + 1 :, j] - (L[:, j + 1 :, :j] * L[:, j : j + 1, :j]).sum(2)) / L[:, j, j, None]
    with np.errstate(over="ignore", invalid="ignore"):
        nees = (w**2).sum(1) / d
    proper &= nees <= MAX_NEES
    return np.where(proper, nees, np.nan), proper


def simulate(plan: Plan, first: int, count: int) -> np.ndarray:
    """Sums (size,) of one block, in the order of the plan's layout."""
    plots = plan.draw(first, count)
    errors = list(inner_errors(plan, first, count))
    largest_errors = greatest_errors(errors)
    sums = {name: np.zeros(shape) for name, shape in plan.layout.shapes.items()}
    powers = [error_powers(error) for error in errors]
    for g, member in enumerate(plan.members):
        outcome = filter_errors(plan, member, member.estimates(plots_of(plan, plots)), plots, largest_errors)
        e, (present, square, fourth) = np.nan_to_num(outcome.error), error_powers(outcome.error)
        sums["estimates"][g] = present.sum(0)
        for power, values in enumerate((e, square, square * e, fourth)):
            sums["error"][g, ..., power] = values.sum(0)
        for b, other_powers in enumerate(powers):
            sums["both"][g, b] = _paired_sums((present, square, fourth), other_powers)
        has_nees = np.isfinite(outcome.nees)
        q = np.where(has_nees, outcome.nees, 0)
        sums["nees"][g] = np.stack([has_nees.sum(0), q.sum(0), (q * q).sum(0)], axis=-1)
        sums["failures"][g] = outcome.failed.sum(0)
        powers.append((present, square, fourth))
    return plan.layout.pack(**sums)


def errors(plan: Plan, first: int, count: int) -> np.ndarray:
    """The errors (F + G, count, K, C) of the same realisations, of the config's filters and then of the user's;
    not-a-number where a filter has no estimate or the realisation fails."""
    plots, study_errors = plan.draw(first, count), list(inner_errors(plan, first, count))
    largest_errors = greatest_errors(study_errors)
    answers = ((member, member.estimates(plots_of(plan, plots))) for member in plan.members)
    return np.stack([*study_errors, *(filter_errors(plan, *answer, plots, largest_errors).error for answer in answers)])


def _paired_sums(powers: tuple[np.ndarray, ...], other_powers: tuple[np.ndarray, ...]) -> np.ndarray:
    """The sums (K, C, PAIRED) over realisations in which both filters have an estimate, from `squared` of each."""
    present, square, fourth = powers
    other_present, other_square, other_fourth = other_powers
    pairs = (
        (present, other_present),
        (square, other_present),
        (fourth, other_present),
        (present, other_square),
        (present, other_fourth),
        (square, other_square),
        (present * other_present, np.square(np.square(square - other_square))),
    )
    return np.stack(
        [np.einsum("nkc,nkc->kc", first_factor, second_factor) for first_factor, second_factor in pairs], axis=-1
    )


def greatest_errors(errors: Iterable[np.ndarray]) -> np.ndarray:
    """The largest error (n, C) of any filter at any scan; not-a-number where none has an estimate."""
    absolute = np.stack([np.abs(error) for error in errors])
    largest_errors = np.where(np.isnan(absolute), -1, absolute).max((0, 2))
    return np.where(largest_errors < 0, np.nan, largest_errors)


def error_powers(error: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For errors (n, K, C): 1 where there is an error, else 0; its square and fourth power, 0 where there is none."""
    present = np.isfinite(error).astype(float)
    square = np.square(np.nan_to_num(error))
    return present, square, np.square(square)


def result(plan: Plan, study_result: CaseResult, sums: Mapping[str, np.ndarray]) -> CaseResult:
    """The user filters as a case of their own: available only where some realisation has an estimate."""
    case = plan.world.case
    ratios = tuple((m.name, m.training_ratios[case]) for m in plan.members if case in m.training_ratios)
    axes = replace(
        plan.axes,
        available=sums["estimates"] > 0,
        answer_points=tuple(plan.study.answer_points(study_result)),
        training_ratios=ratios,
        dependent=plan.invalid_intervals(study_result.count),
        faults=tuple((member.name, fault) for member in plan.members for fault in member.faults.get(case, ())),
    )
    return replace(study_result, sums=sums, axes=axes, further_baselines=())
