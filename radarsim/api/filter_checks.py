"""Checks of a user filter before it is judged: repeatable, causal, of the right shape and order."""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from radarsim.api.case_work import CaseWork
from radarsim.api.estimate_files import UNIT_FACTORS
from radarsim.api.estimate_time import time_warnings
from radarsim.config.experiment import Case
from radarsim.config.seeds import OTHER_NOISE, other_seed
from radarsim.errors import AUTHOR_ERRORS, ConfigError
from radarsim.language.numerals import numeral
from radarsim.language.translate import term, tr
from radarsim.report import statistics
from radarsim.studies.user_filters import estimates, sums
from radarsim.studies.user_filters.filters import EstimateChunks, Plots, StoredEstimates, UserFilter
from radarsim.studies.user_filters.independence import uses_generator
from radarsim.studies.user_filters.sums import Plan

TRIAL_REALISATIONS = 256  # realisations on which a filter is checked before it is judged
MATERIAL_CHANGE = 1e-3  # of a component's rms error; smaller changes are rounding, even that of float32
TRAINED = 4.5  # standard errors of a rank sum: by chance once in 300,000 filters
LOWEST_RANKS = (24, 32, 48, 64, 96, 128, 192)  # of both trials together, among which learned realisations are sought
DEPENDENCES = {  # warnings on a filter whose realisations depend on each other, by the reason
    "repeated": term(
        "{name}: draws the same random numbers in every block of {block} realisations: intervals do not hold then, "
        "and are shown of one block alone; plots.normals(m) and plots.uniforms(m) give it others"
    ),
    "shared": term(
        "{name}: seeds its random numbers again, so that all realisations share them: its results are of this seed, "
        "and no interval holds; plots.normals(m) and plots.uniforms(m) give each realisation others, and what is "
        "drawn in __init__ is part of the filter"
    ),
    "place": term(
        "{name}: its estimates depend on the row of a realisation in the batch, in every block alike: no interval "
        "holds; compute a row from its own plots, and take random numbers from plots.normals(m) or plots.uniforms(m)"
    ),
    "others": term(
        "{name}: its estimates of a realisation depend on the others in the batch: no interval holds; compute a row "
        "from its own plots alone"
    ),
}
MIN_FOLLOW_REALISATIONS = 50  # below it, it is not tested whether errors follow the plots
MIN_ORDER_FACTOR = 10.0  # errors that another order or unit divides by it show that this is the right one


Errors = tuple[np.ndarray, np.ndarray]  # of a user filter (n, K, C), and of the config's filters (F, n, K, C)


def check_user_filter(case: Case, member: UserFilter) -> list[str]:
    """Warnings on a filter from a trial on a few realisations.

    Raises ConfigError where its estimates cannot be of these plots."""
    plan = cast("Plan", CaseWork(case).plans[-1])
    plot_arrays = plan.draw(0, min(case.realisations, TRIAL_REALISATIONS))
    plots = sums.plots_of(plan, plot_arrays)
    output = member.estimates(plots)
    inner = sums.inner_errors(plan, 0, plot_arrays.n)
    errors = sums.filter_errors(plan, member, output, plot_arrays, sums.greatest_errors(inner))
    x, _ = estimates.check_estimates(
        member.name, output, plot_arrays.n, len(plan.world.t_s), plan.names, member.components
    )
    component_indices = estimates.columns_of(member.name, x.shape[2], plan.names, member.components)
    truth = plot_arrays.truth_of(plan.axes.components)
    _check_order(plan, member, x, truth, component_indices, inner)
    sees_plots = not isinstance(member, StoredEstimates | EstimateChunks)
    if not sees_plots:
        _check_follows_plots(case, member, errors.error, inner)
    rms = np.sqrt(_mean(np.square(errors.error), (0, 1)))[component_indices]
    lines, faults = _rounding_warnings(member, estimates.plain(estimates.parts(output)[0]), x, rms), list[str]()
    measured = [column for column in plot_arrays.columns.values() if column.shape == x.shape[:2]]
    if measured:
        plot_columns = np.stack(measured, axis=-1)
        faults = time_warnings(member.name, x, truth[..., component_indices], plot_columns, truth)
    if sees_plots:
        columns = plot_arrays.columns
        if any(not np.array_equal(plots[name], columns[name], equal_nan=True) for name in columns):
            lines.append(tr("{name}: changes the plots it is given; it gets copies", name=member.name))
        unrepeatable = list(_check_repeatable(plan, member, x, MATERIAL_CHANGE * rms))
        if plan.invalid_intervals(case.realisations):  # which the verdict says itself
            lines += unrepeatable
        else:
            faults += unrepeatable
        lines += _check_training(case, plan, member, (errors.error, inner))
    member.note_faults(case.name, tuple(faults))
    return [*faults, *lines]


def _rounding_warnings(member: UserFilter, output: np.ndarray, x: np.ndarray, rms: np.ndarray) -> list[str]:
    """A warning where the output has less than double precision: its rounding as a share of the rms error (d,)."""
    if output.dtype.kind != "f" or output.dtype.itemsize >= np.dtype(float).itemsize:
        return []
    d = x.shape[2]
    largest = np.abs(output.reshape(-1, d)).max(0, where=np.isfinite(x).reshape(-1, d), initial=0)
    step = float(np.nan_to_num(np.spacing(largest) / rms).max())
    if not step:
        return []
    return [tr("{name}: estimates are {type}, rounded by up to {share:.1g} of their rms error",
               name=member.name, type=str(output.dtype), share=step)]  # fmt: skip


def _mean(values: np.ndarray, axis: int | tuple[int, ...]) -> np.ndarray:
    """The mean of the finite values, not-a-number where there are none."""
    is_finite = np.isfinite(values)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(is_finite, values, 0).sum(axis) / is_finite.sum(axis))


def _median(values: np.ndarray) -> np.ndarray:
    """The median over realisations, where values that are not finite count as infinite."""
    return np.asarray(np.median(np.where(np.isfinite(values), values, np.inf), axis=0))


def _typical_size(values: np.ndarray) -> np.ndarray:
    """The median of each component (d,) over the finite values of (…, d)."""
    finite = (component[np.isfinite(component)] for component in np.moveaxis(values, -1, 0))
    return np.array([np.median(component) if component.size else np.nan for component in finite])


def _repeated_estimates(plan: Plan, member: UserFilter, plots: Plots) -> np.ndarray:
    """The estimates (n, K, d) of another call of a filter."""
    return estimates.check_estimates(
        member.name, member.estimates(plots), plots.n, len(plan.world.t_s), plan.names, member.components
    )[0]


def _differ(first: np.ndarray, second: np.ndarray, tolerance: np.ndarray) -> bool:
    """Whether estimates differ by more than a tolerance (d,), or in which of them are finite."""
    if first.shape != second.shape:
        return True
    with np.errstate(invalid="ignore"):
        return bool((np.isfinite(first) != np.isfinite(second)).any() or (np.abs(first - second) > tolerance).any())


def _check_repeatable(plan: Plan, member: Any, x: np.ndarray, tolerance: np.ndarray) -> Iterator[str]:
    """Warnings where estimates change on another call, in a smaller batch, or with other plots after a later scan."""
    n, K = x.shape[:2]
    name = member.name
    if _differ(_repeated_estimates(plan, member, sums.plots_of(plan, plan.draw(0, n))), x, tolerance):
        yield tr(
            "{name}: gives other estimates for the same plots when called again, so its numbers cannot be repeated",
            name=name,
        )
        return
    reason = plan.dependences[member.name]
    if not reason and n > 1 and _depends_on_batch(plan, member, x, tolerance):
        member.note_dependence(plan.world.case)
        reason = "others"
    if reason:
        yield tr(DEPENDENCES[reason], name=name, block=plan.block)
        return
    if hasattr(member.target, "step") or K < 2 or n < 2:
        return
    cut = K // 2
    plots = sums.plots_of(plan, plan.draw(0, n))
    for column in plots.columns.values():
        column[:, cut:] = np.roll(column[:, cut:], 1, axis=0)  # those of another realisation
    if _differ(_repeated_estimates(plan, member, plots)[:, :cut], x[:, :cut], tolerance):
        yield tr("{name}: uses later plots: its estimates up to scan {k} change with the plots after it; compare it "
                 "with smoothers, not with filters", name=name, k=cut)  # fmt: skip


def _depends_on_batch(plan: Plan, member: Any, x: np.ndarray, tolerance: np.ndarray) -> bool:
    """Whether estimates depend on the other realisations in the batch, and not by random numbers that differ from block
    to block."""
    n = len(x)
    rows = slice(n // 4, n // 4 + max(n // 2, 1))  # neither the first nor the last, on which such a filter may rely
    some_plots = sums.plots_of(plan, plan.draw(rows.start, rows.stop - rows.start))
    if not _differ(_repeated_estimates(plan, member, some_plots), x[rows], tolerance):
        return False
    other_block = replace(sums.plots_of(plan, plan.draw(0, n)), first=plan.block)
    is_random = uses_generator(some_plots) or _differ(_repeated_estimates(plan, member, other_block), x, tolerance)
    return not is_random


def _check_training(case: Case, plan: Plan, member: UserFilter, judged: Errors) -> Iterator[str]:
    """A warning where errors are larger on noise of another seed than chance explains."""
    n = len(judged[0])
    other_plan = sums.with_other_noise(plan, case, other_seed(case.seed, OTHER_NOISE))
    plots = other_plan.draw(0, n)
    inner = sums.inner_errors(other_plan, 0, n)
    try:
        answer = member.estimates(sums.plots_of(other_plan, plots))
    except AUTHOR_ERRORS as error:  # whatever the user's code raises: on the judged noise it did not
        member.note_training(case.name, math.inf)
        yield tr(
            "{name}: fails on noise of another seed ({error}): it seems to know the realisations by which it is judged",
            name=member.name,
            error=f"{type(error).__name__}: {error}",
        )
        return
    errors = sums.filter_errors(other_plan, member, answer, plots, sums.greatest_errors(inner))
    here, there = _mean_squares(judged, (errors.error, inner))
    if not _is_smaller_beyond_chance(here, there):
        return
    ratio = _error_ratio(there, here)
    member.note_training(case.name, ratio)
    yield tr(
        "{name}: on noise of another seed its σ is {ratio} times as large: it seems to have been trained on the "
        'realisations by which it is judged; radarsim.plots(…, purpose="training") draws others',
        name=member.name,
        ratio=numeral(f"{ratio:.3g}").replace("inf", "∞"),
    )


def _is_smaller_beyond_chance(here: np.ndarray, there: np.ndarray) -> bool:
    """Whether values (n,) are smaller than others (n,), by their rank sum (Mann and Whitney), or too many of them among
    the smallest of both, as where a filter has learned some realisations. By chance once in 150,000 filters."""
    n = len(here)
    smaller = (here[:, None] < there).mean() + (here[:, None] == there).mean() / 2
    if smaller - 0.5 > TRAINED * np.sqrt((2 * n + 1) / (12 * n * n)):
        return True
    order = np.lexsort((np.repeat([1, 0], n), np.concatenate([here, there])))  # of equal ones those there first
    counts = np.cumsum(order < n)
    ranks = [rank for rank in LOWEST_RANKS if rank <= n]
    by_chance = [_share_of_draws(n, rank, int(counts[rank - 1])) for rank in ranks]
    return min(by_chance, default=1.0) * len(LOWEST_RANKS) < math.erfc(TRAINED / math.sqrt(2)) / 2


def _share_of_draws(n: int, drawn: int, count: int) -> float:
    """The share of draws out of n white and n black balls that hold at least so many white ones."""
    held = range(count, drawn + 1)
    return sum(math.comb(n, white) * math.comb(n, drawn - white) for white in held) / math.comb(2 * n, drawn)


def _error_ratio(there: np.ndarray, here: np.ndarray) -> float:
    """How many times as large errors are there as here, from their mean squares; from medians where few decide."""
    there, here = there[np.isfinite(there)], here[np.isfinite(here)]
    if not there.size or not here.size:
        return math.inf
    means, medians = ((average(there), average(here)) for average in (np.mean, np.median))
    numerator, denominator = means if means[0] > means[1] else medians
    return math.sqrt(numerator / denominator) if denominator > 0 else math.inf


def _mean_squares(*trials: Errors) -> list[np.ndarray]:
    """For each trial, the mean square (n,) of a realisation's errors, over scans and components, each over that of the
    config's best filter; infinite where there is none, as of a failure."""
    with np.errstate(all="ignore"):
        squares = np.concatenate([_mean(np.square(inner), 1) for _, inner in trials])
        best = np.where(squares > 0, squares, np.inf).min(0)
        means = [_mean((np.square(error) / best).reshape(len(error), -1), 1) for error, _ in trials]
    return [np.where(np.isfinite(values), values, np.inf) for values in means]


def _check_order(
    plan: Plan,
    member: UserFilter,
    x: np.ndarray,
    truth: np.ndarray,
    component_indices: Sequence[int],
    inner: np.ndarray,
) -> None:
    """Raise ConfigError where estimates fit the truth in another order of components or scans, or in another unit, and
    not as they stand."""
    with np.errstate(all="ignore"):
        scale = _typical_size(np.abs(inner))[list(component_indices)]
        estimated_truth = truth[..., list(component_indices)]
        _check_component_order(plan, member, x, estimated_truth, component_indices, scale)
        _check_units(plan, member, x, estimated_truth, component_indices, scale)


def _check_component_order(
    plan: Plan,
    member: UserFilter,
    x: np.ndarray,
    truth: np.ndarray,
    component_indices: Sequence[int],
    scale: np.ndarray,
) -> None:
    """Raise ConfigError where another order of components or scans makes errors MIN_ORDER_FACTOR times smaller."""

    def log_error(order: Sequence[int], step: int) -> float:
        errors = np.abs(x[:, ::step][..., list(order)] - truth)
        return float(_mean(np.log(np.maximum(_typical_size(errors) / scale, 1e-3)), 0))

    d = len(component_indices)
    swaps = itertools.permutations(range(d)) if d <= 4 else (
        [*range(i), j, *range(i + 1, j), i, *range(j + 1, d)] for i in range(d) for j in range(i + 1, d)
    )  # fmt: skip
    candidates = [(range(d), 1), (range(d), -1), *((order, 1) for order in swaps)]
    log_errors = np.nan_to_num([log_error(*candidate) for candidate in candidates], nan=np.inf)
    log_factor = log_errors[0] - log_errors.min()
    if not log_factor > np.log(MIN_ORDER_FACTOR):
        return
    order, step = candidates[int(log_errors.argmin())]
    actual_order = (
        "the scans from the last to the first"
        if step < 0
        else "the components in the order "
        + ", ".join(plan.names[component_indices[list(order).index(i)]] for i in range(d))
    )
    factor, expected = np.exp(log_factor), ", ".join(plan.names[i] for i in component_indices)
    raise ConfigError(f"{member.name}: estimates hold {actual_order}: their errors are then {factor:.2g} times "
                      f"smaller; expected {expected} by rising scans")  # fmt: skip


def _check_units(
    plan: Plan,
    member: UserFilter,
    x: np.ndarray,
    truth: np.ndarray,
    component_indices: Sequence[int],
    scale: np.ndarray,
) -> None:
    """Raise ConfigError where a factor between units makes a component's errors MIN_ORDER_FACTOR times smaller."""
    errors = np.array([_typical_size(np.abs(x * factor - truth)) for factor in (1.0, *UNIT_FACTORS)])
    corrected_errors = np.maximum(errors[1:], 1e-3 * scale)
    ratios = np.nan_to_num(np.minimum(errors[0], _typical_size(np.abs(truth))) / corrected_errors, nan=0.0)
    if not ratios.max() > MIN_ORDER_FACTOR:
        return
    f, i = np.unravel_index(int(ratios.argmax()), ratios.shape)
    component, unit = plan.axes.components[component_indices[int(i)]]
    raise ConfigError(f"{member.name}: estimates of {component} must be in {unit}, with the sign of the truth: "
                      f"multiplied by {UNIT_FACTORS[int(f)]:.4g} their errors are {ratios.max():.2g} times "
                      "smaller")  # fmt: skip


def _check_follows_plots(case: Case, member: UserFilter, error: np.ndarray, inner: np.ndarray) -> None:
    """Raise ConfigError where errors correlate with those of the config's filters no more than chance explains.

    Filters that see the same plots have correlated errors. For each realisation the products of the normalised errors,
    cut at three, are averaged over scans and components; their mean over realisations is tested against zero."""
    n = len(error)
    if n < MIN_FOLLOW_REALISATIONS:
        return
    scores = []
    with np.errstate(all="ignore"):
        centred = [filter_error - np.nan_to_num(_median(filter_error)) for filter_error in (error, *inner)]
        normalised, *config_errors = (np.clip(values / _median(np.abs(values)), -3, 3) for values in centred)
        for config_error in config_errors:
            products = _mean((normalised * config_error).reshape(n, -1), 1)
            products = products[np.isfinite(products)]
            is_enough = products.size >= MIN_FOLLOW_REALISATIONS
            scores.append(products.mean() / products.std() * np.sqrt(products.size) if is_enough else np.nan)
    if np.isfinite(scores).any() and np.nanmax(scores) < statistics.largest_by_chance(len(scores)):
        raise ConfigError(f"{member.name}: its errors have nothing in common with those of the config's filters, "
                          f"which see the same plots: estimates of other realisations, in another order, or of another "
                          f"seed than {case.seed}?")  # fmt: skip
