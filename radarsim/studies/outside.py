"""User filters beside those of a config, on the same plots: what such a filter is, and its sums.

A filter is an object (or a class, made anew for every batch) with

    start(world)                   before the first scan: `World`
    step(plots) -> estimate        one scan of n realisations: `Plots`, columns (n,); estimate (n, d), or
                                   (estimate, covariance (n, d, d))

or a function of all scans, `f(plots) -> estimates (n, K, d)`, or `(estimates, covariances (n, K, d, d))`, columns
(n, K); or one of a single realisation, columns (K,), estimates (K, d). An estimate holds the leading components of the
state, or those that the attribute `components` names. Not-a-number stands where a filter has no estimate yet.

For each realisation the errors of the config's own filters are computed again, so that gains of a user filter are
paired with each of them, in any study that draws plots; the sums of the study do not change.

A realisation fails where not-a-number follows an estimate, where an estimate is infinite, where there is none although
a filter of the config has one, and where an error is more than a hundred times the largest error of the config's
filters in it. Its errors enter no sum, so that σ and gains count the others; how many failed is counted."""

import itertools
import threading
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Axes, CaseResult, Layout
from radarsim.errors import ConfigError
from radarsim.studies.interface import World, column

if TYPE_CHECKING:
    from radarsim.studies.interface import Draw, Drawn, Study

DIVERGED = 100.0  # times the largest error of the config's filters in the same realisation
FAILURES = ("not_a_number", "no_estimate", "diverged")
COUNTS = (*FAILURES, "not_positive_definite")
PAIRED = 7  # sums over the realisations that both have: 1, e², e⁴, b², b⁴, e²b², (e² − b²)⁴

Estimates = tuple[np.ndarray, np.ndarray | None]  # (n, K, d), and covariances (n, K, d, d) where there are any


# ---- what a filter sees ----------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Plots:
    """Plots of n realisations from number `first` on, not-a-number where missing: `plots["range_m"]`, (n, K). Of one
    scan these are (n,), and t_s is its time; of one realisation (K,)."""

    t_s: Any
    columns: Mapping[str, np.ndarray]
    world: World
    first: int
    n: int

    def __getitem__(self, name: str) -> np.ndarray:
        return column(self.columns, name)


# ---- where estimates come from ---------------------------------------------------------------------------------------
class Outside(ABC):
    """A user filter. identity: what its numbers depend on besides the plots; components: names of those it estimates,
    by default the leading ones. in_order: realisations must be computed in their order, by one thread."""

    name: str
    identity: str
    components: tuple[str, ...] = ()
    in_order: bool = False
    written: Mapping[str, Any] | None = None  #: its keys, where a config has it
    baseline: bool = False  #: whether gains of the others are against it too
    judged_at: tuple[str, float] | None = None  #: component and time, s, that the answer is about; None: first, last

    @abstractmethod
    def estimates(self, plots: Plots) -> Any:
        """The estimates for these plots."""

    def bound_to(self, case: Case) -> "Outside":
        """The filter as one of a case."""
        return self

    def warnings(self) -> list[str]:
        """Warnings about its numbers, from what has run so far."""
        return []


@dataclass
class Called(Outside):
    """An object, class or function that is called with plots, by one thread at a time.

    alone: it is a function of one realisation."""

    name: str
    target: Any
    identity: str = ""
    components: tuple[str, ...] = ()
    alone: bool = False
    _lock: Any = field(default_factory=threading.Lock, repr=False)

    def estimates(self, plots: Plots) -> Any:
        with self._lock, np.errstate():  # which the code may change
            target = self.target
            if hasattr(target, "step") or hasattr(target, "start"):
                instance = made_of(self.name, target) if isinstance(target, type) else target
                if not (hasattr(instance, "step") and hasattr(instance, "start")):
                    raise ConfigError(
                        f"{self.name}: a filter that is asked scan by scan must have start(world) and step(plots)"
                    )
                return stepped(self.name, instance, plots)
            if not self.alone:
                return target(plots)
            answers = [copied(target(of_one(plots, i))) for i in range(plots.n)]
            return stacked(self.name, answers, [f"realisation {plots.first + i}" for i in range(plots.n)], axis=0)


def of_one(plots: Plots, i: int) -> Plots:
    """The plots of one realisation alone."""
    return replace(plots, columns={name: v[i] for name, v in plots.columns.items()}, first=plots.first + i, n=1)


def made_of(name: str, target: type, **keys: Any) -> Any:
    """An object of a filter's class."""
    instance = target(**keys)
    if components_of(instance) != components_of(target):
        raise ConfigError(f"{name}: components must be an attribute of the class itself, not of its objects")
    return instance


def stepped(name: str, target: Any, plots: Plots) -> Any:
    """The estimates of a filter that is called scan by scan."""
    target.start(plots.world)
    estimates = []
    for k, t in enumerate(plots.t_s):
        columns = {column: np.ascontiguousarray(v[:, k]) for column, v in plots.columns.items()}
        answer = target.step(replace(plots, t_s=float(t), columns=columns))
        estimates.append(copied(answer))
        if (shape := estimates[-1][0].shape)[:1] != (plots.n,):
            got = f"shape {shape}" if shape else type(answer).__name__
            raise ConfigError(f"{name}: step must give estimates (n, d) of n = {plots.n} realisations, got {got}")
    return stacked(name, estimates, [f"{t:g} s" for t in plots.t_s], axis=1)


def parts(answer: Any) -> tuple[Any, Any]:
    """Estimates, and covariances or None, of a filter's answer: a tuple, or a list whose second has one more axis."""
    if isinstance(answer, list) and len(answer) == 2:
        x, P = (getattr(array, "ndim", 0) for array in answer)
        answer = tuple(answer) if x and x + 1 == P else answer
    return answer if isinstance(answer, tuple) and len(answer) == 2 else (answer, None)


def copied(answer: Any) -> Estimates:
    """Copies of estimates and covariances, which the filter cannot change later."""
    x, P = parts(answer)
    return plain(x), None if P is None else plain(P)


def stacked(name: str, answers: Sequence[Estimates], labels: Sequence[str], axis: int) -> Any:
    """Estimates of several places in one array, and covariances, if any have them, in another.

    labels: of the places, for error messages."""
    stacks = []
    for array_name, arrays in zip(("estimates", "covariances"), zip(*answers, strict=True), strict=True):
        shapes = {place: array.shape for place, array in zip(labels, arrays, strict=True) if array is not None}
        first = next(iter(shapes), "")
        if different_place := next((place for place, shape in shapes.items() if shape != shapes[first]), ""):
            descriptions = " and ".join(f"{shapes[place]} at {place}" for place in (first, different_place))
            raise ConfigError(f"{name}: {array_name} must have one shape, got {descriptions}")
        if shapes:
            blank = np.full(shapes[first], np.nan)
            stacks.append(np.stack([blank if array is None else array for array in arrays], axis=axis))
    return tuple(stacks) if len(stacks) > 1 else stacks[0]


def plain(values: Any) -> np.ndarray:
    """A copy of values of any shape (n, …) as an array: not-a-number where they are masked."""
    if isinstance(values, np.ma.MaskedArray):
        return np.ma.filled(values.astype(float), np.nan)
    try:
        return np.array(values)
    except ValueError:  # rows of several lengths
        return np.array(None)  # which is refused, as it holds no numbers


def components_of(target: Any) -> tuple[str, ...]:
    """The components that a filter names in its attribute."""
    components = getattr(target, "components", ())
    return (components,) if isinstance(components, str) else tuple(components)


@dataclass
class Given(Outside):
    """Estimates that are there already, of realisations 0, 1, 2, …"""

    name: str
    arrays: Estimates
    identity: str = ""
    components: tuple[str, ...] = ()

    def estimates(self, plots: Plots) -> Estimates:
        rows = slice(plots.first, plots.first + plots.n)
        x, P = self.arrays
        return x[rows], None if P is None else P[rows]


@dataclass
class Chunks(Outside):
    """Estimates that an iterator gives, chunk by chunk, of realisations 0, 1, 2, …; those of a block are kept."""

    name: str
    source: Iterator[Any]
    identity: str = ""
    components: tuple[str, ...] = ()
    in_order = True
    _first: int = 0
    _kept: list[Estimates] = field(default_factory=list)

    def estimates(self, plots: Plots) -> Estimates:
        start, stop = plots.first, plots.first + plots.n
        while self._kept and self._first + len(self._kept[0][0]) <= start:
            self._first += len(self._kept.pop(0)[0])
        while (available := self._first + sum(len(x) for x, _ in self._kept)) < stop:
            chunk = next(self.source, None)
            if chunk is None:
                takes = f"; realisations={available} takes these" if available else ""
                raise ConfigError(f"{self.name}: must give {stop} realisations, ended after {available}{takes}")
            self._kept.append(self._chunk(chunk, plots))
        rows = slice(start - self._first, stop - self._first)
        x = np.concatenate([x for x, _ in self._kept])
        if all(P is None for _, P in self._kept):
            return x[rows], None
        covariances = [np.full((*x.shape, x.shape[2]), np.nan) if P is None else P for x, P in self._kept]
        return x[rows], np.concatenate(covariances)[rows]

    def _chunk(self, answer: Any, plots: Plots) -> Estimates:
        """A chunk's estimates (n, K, d) and covariances, in arrays of their own."""
        x, P = copied(answer)
        names = [name for name, _ in plots.world.components]
        shape = checked(self.name, (x, P), len(x) if x.ndim else 0, len(plots.t_s), names, self.components)[0].shape
        if self._kept and shape[2] != self._kept[0][0].shape[2]:
            raise ConfigError(f"{self.name}: chunks must hold the same components, got {self._kept[0][0].shape[2]} "
                              f"and then {shape[2]}")  # fmt: skip
        return x.reshape(shape), P


def checked(
    name: str, answer: Any, n: int, K: int, components: Sequence[str], component_names: Sequence[str]
) -> Estimates:
    """Estimates (n, K, d) and their covariances, float64; raises ConfigError where they have another shape or type.

    component_names: those that the filter names, in the order of its last axis."""
    x, P = parts(answer)
    x = plain(x)
    x = x[..., None] if x.ndim == 2 else x
    _check_estimates(name, x, (n, K), len(component_names) or len(components), bool(component_names))
    d = x.shape[2]
    if P is not None and (P := plain(P)).dtype.kind not in "fiu":
        raise ConfigError(f"{name}: covariances must be real numbers, got {P.dtype}")
    if P is not None and P.shape != (n, K, d, d):
        raise ConfigError(f"{name}: covariances must have shape {(n, K, d, d)}, got {P.shape}")
    return x.astype(float), None if P is None else np.asarray(P, dtype=float)


def _check_estimates(
    name: str, x: np.ndarray, shape: tuple[int, int], max_components: int, has_named_components: bool
) -> None:
    """Raise ConfigError for estimates that are no real numbers (n, K, d).

    has_named_components: d must be max_components, not fewer."""
    n, K = shape
    if x.dtype.kind not in "fiu":
        raise ConfigError(f"{name}: estimates must be real numbers, got {x.dtype}")
    min_components = max_components if has_named_components else 1
    if x.ndim == 3 and x.shape[:2] == shape and min_components <= x.shape[2] <= max_components:
        return
    orders = itertools.permutations(range(3)) if x.ndim == 3 else ()
    fitting = (o for o in orders if x.shape[o[1]] == K and 1 <= x.shape[o[2]] <= max_components and o != (0, 1, 2))
    order = next(fitting, None)
    hint = f"; its axes are in another order: transpose{order} fixes it" if order else ""
    wanted_shape = f"(n, K, d) = ({n}, {K}, {f'{max_components}' if has_named_components else f'1 … {max_components}'})"
    raise ConfigError(f"{name}: estimates must have shape {wanted_shape}, got {x.shape}{hint}")


def columns_of(name: str, d: int, components: Sequence[str], component_names: Sequence[str]) -> list[int]:
    """The indices, among the state's components, of the d components that a filter estimates."""
    if unknown := [component for component in component_names if component not in components]:
        raise ConfigError(f"{name}: components: must be of {', '.join(components)}, got {', '.join(unknown)}")
    if len(set(component_names)) < len(component_names):
        raise ConfigError(f"{name}: components: must differ, got {', '.join(component_names)}")
    return [components.index(component) for component in component_names] or list(range(d))


@dataclass(frozen=True)
class OutsideAxes(Axes):
    """Axes of user filters. baselines: those that the gains of the config's filters refer to as well; identities: what
    the numbers of each depend on; judged_at: as in `Outside`."""

    baselines: tuple[str, ...] = ()
    identities: tuple[str, ...] = ()
    judged_at: tuple[str, float] | None = None


# ---- plan and sums ---------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Plan:
    """The plan of a case's user filters, with the study's own plan, `inner`."""

    study: "Study"
    inner: Any
    draw: "Draw"
    world: World
    scans: np.ndarray  #: (K,) places of the axes' scans among all scans
    members: tuple[Outside, ...]
    axes: Axes
    layout: Layout

    gaussian = False

    @property
    def block(self) -> int:
        return int(self.inner.block)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(name for name, _ in self.axes.components)


def prepare(study: "Study", case: Case, inner: Any) -> Plan:
    """The plan of a case's user filters. Raises ConfigError where their errors cannot be paired with the study's."""
    axes = inner.axes
    draw, world, scans = setting(study, case, inner)
    names = [member.name for member in case.outside]
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
    baselines = tuple(member.name for member in case.outside if member.baseline)
    judged_at = next((member.judged_at for member in case.outside if member.judged_at), None)
    user_axes = OutsideAxes(*labels, baselines, tuple(member.identity for member in case.outside), judged_at)
    return Plan(study, inner, draw, world, scans, case.outside, user_axes, layout)


def setting(study: "Study", case: Case, inner: Any) -> tuple["Draw", World, np.ndarray]:
    """The function that draws a case's plots, its `World`, and the indices (K,) of the axes' scans among all scans.

    Raises ConfigError where errors of a user filter cannot be paired with the study's."""
    draw, axes = drawing(study, case), inner.axes
    if "paired" not in inner.layout.shapes:
        raise ConfigError(
            f"{case.name}: its trackers find tracks of their own, in other realisations each: there is no estimate in "
            "every one that a filter from outside could be paired with"
        )
    first = draw(0, 1)
    scans = np.asarray(axes.k) - 1
    if first.several or scans[-1] >= len(first.t_s) or not np.allclose(first.t_s[scans] - first.t_s[0], axes.t_s):
        raise ConfigError(f"{case.name}: its plots do not stand at the scans of its errors")
    return draw, world_of(study, case, first, axes.components), scans


def first_plots(study: "Study", case: Case, count: int) -> Plots:
    """The plots of a case's first realisations as a filter sees them, before there is a plan for it."""
    draw, world, _ = setting(study, case, study.prepare(case))
    return seen_by_filter(world, draw(0, count))


def drawing(study: "Study", case: Case) -> "Draw":
    """The function that draws a case's plots; raises ConfigError for a study without plots."""
    interface = study.recording_interface()
    if interface is None:
        raise ConfigError(f"{case.name}: study {study.name} draws no plots that a filter from outside could take")
    return interface.drawing(case)


def world_of(study: "Study", case: Case, plots: "Drawn", components: tuple[tuple[str, str], ...]) -> World:
    """What a filter may know beforehand about these plots and a state with these components."""
    interface = study.recording_interface()
    keys = {} if interface is None else interface.sigmas(case.spec)
    keys_by_number = {key.rpartition("sigma_")[2]: key for key_names in keys.values() for key in key_names}
    sigma = {name: attrgetter(keys_by_number[name])(case.spec) for name in plots.columns if name in keys_by_number}
    return World(plots.t_s, tuple(plots.columns), sigma, components, case.keys, case.name)


def plots_of(plan: Plan, plots: "Drawn") -> Plots:
    """Plots as a filter of a plan sees them."""
    return seen_by_filter(plan.world, plots)


def seen_by_filter(world: World, plots: "Drawn") -> Plots:
    """Plots as a filter sees them: copies of arrays and keys, which it may change."""
    columns = {name: np.array(values, order="C") for name, values in plots.columns.items()}  # as C code takes them
    world = replace(world, t_s=np.array(world.t_s), keys=deepcopy(world.keys))
    return Plots(np.array(plots.t_s), columns, world, plots.first, plots.n)


def inner_errors(plan: Plan, first: int, count: int) -> np.ndarray:
    """Errors (F, n, K, C) of the study's own filters, not-a-number where one has no estimate."""
    errors = np.ascontiguousarray(plan.study.errors(plan.inner, first, count))
    errors.swapaxes(0, 1)[:, ~np.asarray(plan.inner.axes.available)] = np.nan
    return errors


@dataclass(frozen=True)
class Judged:
    """Errors (n, K, C) of a filter, not-a-number where it has no estimate or the realisation fails; failed (n, 4):
    which of COUNTS apply to each realisation; nees (n, K)."""

    error: np.ndarray
    failed: np.ndarray
    nees: np.ndarray


def judged(plan: Plan, member: Outside, answer: Any, plots: "Drawn", scale: np.ndarray) -> Judged:
    """The errors of a filter's estimates. scale (n, C): the largest error of the study's own filters."""
    names, K = plan.names, len(plan.world.t_s)
    x, P = checked(member.name, answer, plots.n, K, names, member.components)
    places = columns_of(member.name, x.shape[2], names, member.components)
    has_estimate, finite = np.maximum.accumulate(np.isfinite(x), axis=1), np.isfinite(x)
    failed = np.zeros((plots.n, len(COUNTS)), dtype=bool)
    failed[:, 0] = (has_estimate & ~finite).any((1, 2)) | np.isinf(x).any((1, 2))
    failed[:, 1] = ~failed[:, 0] & ~finite.any((1, 2)) & np.isfinite(scale).any(1)
    error = np.full((plots.n, len(plan.scans), len(names)), np.nan)
    error[..., places] = x[:, plan.scans] - plots.truth_of(plan.axes.components)[:, plan.scans][..., places]
    with np.errstate(invalid="ignore"):
        failed[:, 2] = ~failed[:, 0] & (np.abs(error) > DIVERGED * scale[:, None]).any((1, 2))
    error[failed.any(1)] = np.nan
    nees = np.full(error.shape[:2], np.nan)
    if P is not None:
        covariances, has_both = P[:, plan.scans], np.isfinite(error[..., places]).all(-1)
        has_both &= np.isfinite(covariances).all((-2, -1))
        nees[has_both], proper = normalised(error[has_both][:, places], covariances[has_both])
        failed[np.nonzero(has_both)[0][~proper], 3] = True
    return Judged(error, failed, nees)


def normalised(e: np.ndarray, P: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """eᵀP⁻¹e over its degrees of freedom (m,), of errors (m, d), covariances (m, d, d); not-a-number of those that are
    not positive definite, and which are (m,). By Cholesky's root, column by column of all of them."""
    m, d = e.shape
    L, w = np.zeros((m, d, d)), np.zeros((m, d))
    proper = (np.abs(P - np.swapaxes(P, 1, 2)) <= 1e-6 * np.abs(P).max((1, 2), initial=0)[:, None, None]).all((1, 2))
    for j in range(d):
        pivot = P[:, j, j] - (L[:, j, :j] ** 2).sum(1)
        proper &= pivot > 0
        L[:, j, j] = np.sqrt(np.where(pivot > 0, pivot, 1))
        w[:, j] = (e[:, j] - (L[:, j, :j] * w[:, :j]).sum(1)) / L[:, j, j]
        L[:, j + 1 :, j] = (P[:, j + 1 :, j] - (L[:, j + 1 :, :j] * L[:, j : j + 1, :j]).sum(2)) / L[:, j, j, None]
    return np.where(proper, (w**2).sum(1) / d, np.nan), proper


def simulate(plan: Plan, first: int, count: int) -> np.ndarray:
    """Sums (size,) of one block, in the order of the plan's layout."""
    plots = plan.draw(first, count)
    errors = list(inner_errors(plan, first, count))
    largest_errors = largest(errors)
    sums = {name: np.zeros(shape) for name, shape in plan.layout.shapes.items()}
    powers = [squared(error) for error in errors]
    for g, member in enumerate(plan.members):
        outcome = judged(plan, member, member.estimates(plots_of(plan, plots)), plots, largest_errors)
        e, (present, square, fourth) = np.nan_to_num(outcome.error), squared(outcome.error)
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


def largest(errors: Iterable[np.ndarray]) -> np.ndarray:
    """The largest error (n, C) of any filter at any scan; not-a-number where none has an estimate."""
    absolute = np.stack([np.abs(error) for error in errors])
    largest_errors = np.where(np.isnan(absolute), -1, absolute).max((0, 2))
    return np.where(largest_errors < 0, np.nan, largest_errors)


def squared(error: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """For errors (n, K, C): 1 where there is an error, else 0; its square and fourth power, 0 where there is none."""
    present = np.isfinite(error).astype(float)
    square = np.square(np.nan_to_num(error))
    return present, square, np.square(square)


def result(plan: Plan, study_result: CaseResult, sums: Mapping[str, np.ndarray]) -> CaseResult:
    """The user filters as a case of their own: available only where some realisation has an estimate."""
    axes = replace(plan.axes, available=sums["estimates"] > 0)
    return replace(study_result, sums=sums, axes=axes, against=())
