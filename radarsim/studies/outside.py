"""Filters of somebody else beside those of a config, on the same plots: what such a filter is, and its sums.

A filter is an object (or a class, made anew for every batch) with

    start(world)                   before the first scan: `World`
    step(plots) -> estimate        one scan of n realisations: `Plots`, columns (n,); estimate (n, d), or
                                   (estimate, covariance (n, d, d))

or a function of all scans, `f(plots) -> estimates (n, K, d)`, or `(estimates, covariances (n, K, d, d))`, columns
(n, K); or one of a single realisation, columns (K,), estimates (K, d). An estimate holds the leading components of the
state, or those that the attribute `components` names. Not-a-number stands where a filter has no estimate yet.

Of each realisation the errors of the config's own filters are computed again: the gains of a filter from outside are
paired with every one of them, in every study that draws plots, and the sums of the study stay what they are.

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
    """A filter from outside. identity: what its numbers depend on beside the plots; components: names of those it
    estimates, by default the leading ones. in_order: realisations must be computed in their order, by one thread."""

    name: str
    identity: str
    components: tuple[str, ...] = ()
    in_order: bool = False
    written: Mapping[str, Any] | None = None  #: its keys, where a config has it
    baseline: bool = False  #: whether gains of the others are against it too
    judged_at: tuple[str, float] | None = None  #: component and time, s, that the answer is about; None: first, last

    @abstractmethod
    def estimates(self, plots: Plots) -> Any:
        """What the filter gives for these plots."""

    def bound_to(self, case: Case) -> "Outside":
        """The filter as one of a case."""
        return self

    def warnings(self) -> list[str]:
        """What a reader of its numbers should know, as far as it has run."""
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
                made = made_of(self.name, target) if isinstance(target, type) else target
                if not (hasattr(made, "step") and hasattr(made, "start")):
                    raise ConfigError(
                        f"{self.name}: a filter that is asked scan by scan must have start(world) and step(plots)"
                    )
                return stepped(self.name, made, plots)
            if not self.alone:
                return target(plots)
            each = [copied(target(of_one(plots, i))) for i in range(plots.n)]
            return stacked(self.name, each, [f"realisation {plots.first + i}" for i in range(plots.n)], axis=0)


def of_one(plots: Plots, i: int) -> Plots:
    """The plots of one realisation alone."""
    return replace(plots, columns={name: v[i] for name, v in plots.columns.items()}, first=plots.first + i, n=1)


def made_of(name: str, target: type, **keys: Any) -> Any:
    """An object of a filter's class."""
    made = target(**keys)
    if components_of(made) != components_of(target):
        raise ConfigError(f"{name}: components must be an attribute of the class itself, not of its objects")
    return made


def stepped(name: str, target: Any, plots: Plots) -> Any:
    """The estimates of a filter that is called scan by scan."""
    target.start(plots.world)
    found = []
    for k, t in enumerate(plots.t_s):
        columns = {column: np.ascontiguousarray(v[:, k]) for column, v in plots.columns.items()}
        given = target.step(replace(plots, t_s=float(t), columns=columns))
        found.append(copied(given))
        if (shape := found[-1][0].shape)[:1] != (plots.n,):
            got = f"shape {shape}" if shape else type(given).__name__
            raise ConfigError(f"{name}: step must give estimates (n, d) of n = {plots.n} realisations, got {got}")
    return stacked(name, found, [f"{t:g} s" for t in plots.t_s], axis=1)


def parts(given: Any) -> tuple[Any, Any]:
    """Estimates, and covariances or None, of a filter's answer: a tuple, or a list whose second has one more axis."""
    if isinstance(given, list) and len(given) == 2:
        x, P = (getattr(one, "ndim", 0) for one in given)
        given = tuple(given) if x and x + 1 == P else given
    return given if isinstance(given, tuple) and len(given) == 2 else (given, None)


def copied(given: Any) -> Estimates:
    """The same in arrays of their own, which no filter goes on to change."""
    x, P = parts(given)
    return plain(x), None if P is None else plain(P)


def stacked(name: str, given: Sequence[Estimates], places: Sequence[str], axis: int) -> Any:
    """Estimates of one place after the other, and covariances if any have them, in one array each."""
    made = []
    for what, every in zip(("estimates", "covariances"), zip(*given, strict=True), strict=True):
        known = {place: one.shape for place, one in zip(places, every, strict=True) if one is not None}
        first = next(iter(known), "")
        if other := next((place for place, shape in known.items() if shape != known[first]), ""):
            both = " and ".join(f"{known[place]} at {place}" for place in (first, other))
            raise ConfigError(f"{name}: {what} must have one shape, got {both}")
        if known:
            none = np.full(known[first], np.nan)
            made.append(np.stack([none if one is None else one for one in every], axis=axis))
    return tuple(made) if len(made) > 1 else made[0]


def plain(values: Any) -> np.ndarray:
    """Values of any shape (n, …) as an array of its own: not-a-number where they are masked."""
    if isinstance(values, np.ma.MaskedArray):
        return np.ma.filled(values.astype(float), np.nan)
    try:
        return np.array(values)
    except ValueError:  # rows of several lengths
        return np.array(None)  # which is refused, as it holds no numbers


def components_of(target: Any) -> tuple[str, ...]:
    """The components that a filter names."""
    named = getattr(target, "components", ())
    return (named,) if isinstance(named, str) else tuple(named)


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
        while (there := self._first + sum(len(x) for x, _ in self._kept)) < stop:
            chunk = next(self.source, None)
            if chunk is None:
                takes = f"; realisations={there} takes these" if there else ""
                raise ConfigError(f"{self.name}: must give {stop} realisations, ended after {there}{takes}")
            self._kept.append(self._chunk(chunk, plots))
        rows = slice(start - self._first, stop - self._first)
        x = np.concatenate([x for x, _ in self._kept])
        if all(P is None for _, P in self._kept):
            return x[rows], None
        every = [np.full((*x.shape, x.shape[2]), np.nan) if P is None else P for x, P in self._kept]
        return x[rows], np.concatenate(every)[rows]

    def _chunk(self, given: Any, plots: Plots) -> Estimates:
        """A chunk's estimates (n, K, d) and covariances, in arrays of their own."""
        x, P = copied(given)
        names = [name for name, _ in plots.world.components]
        shape = checked(self.name, (x, P), len(x) if x.ndim else 0, len(plots.t_s), names, self.components)[0].shape
        if self._kept and shape[2] != self._kept[0][0].shape[2]:
            raise ConfigError(f"{self.name}: chunks must hold the same components, got {self._kept[0][0].shape[2]} "
                              f"and then {shape[2]}")  # fmt: skip
        return x.reshape(shape), P


def checked(name: str, given: Any, n: int, K: int, components: Sequence[str], own: Sequence[str]) -> Estimates:
    """Estimates (n, K, d) and their covariances, float64; raises ConfigError where they have another shape or type.

    own: the components that the filter names, in the order of its last axis."""
    x, P = parts(given)
    x = plain(x)
    x = x[..., None] if x.ndim == 2 else x
    most = len(own) or len(components)
    wanted = f"(n, K, d) = ({n}, {K}, {f'{most}' if own else f'1 … {most}'})"
    if x.dtype.kind not in "fiu":
        raise ConfigError(f"{name}: estimates must be real numbers, got {x.dtype}")
    if x.ndim != 3 or x.shape[:2] != (n, K) or not (x.shape[2] == most if own else 1 <= x.shape[2] <= most):
        orders = itertools.permutations(range(3)) if x.ndim == 3 else ()
        order = next((o for o in orders if x.shape[o[1]] == K and 1 <= x.shape[o[2]] <= most and o != (0, 1, 2)), None)
        hint = f"; its axes are in another order: transpose{order} fixes it" if order else ""
        raise ConfigError(f"{name}: estimates must have shape {wanted}, got {x.shape}{hint}")
    d = x.shape[2]
    if P is not None and (P := plain(P)).dtype.kind not in "fiu":
        raise ConfigError(f"{name}: covariances must be real numbers, got {P.dtype}")
    if P is not None and P.shape != (n, K, d, d):
        raise ConfigError(f"{name}: covariances must have shape {(n, K, d, d)}, got {P.shape}")
    return x.astype(float), None if P is None else np.asarray(P, dtype=float)


def columns_of(name: str, d: int, components: Sequence[str], own: Sequence[str]) -> list[int]:
    """The places among the state's components of the d that a filter estimates."""
    if unknown := [one for one in own if one not in components]:
        raise ConfigError(f"{name}: components: must be of {', '.join(components)}, got {', '.join(unknown)}")
    if len(set(own)) < len(own):
        raise ConfigError(f"{name}: components: must differ, got {', '.join(own)}")
    return [components.index(one) for one in own] or list(range(d))


@dataclass(frozen=True)
class OutsideAxes(Axes):
    """Axes of filters from outside. baselines: those that the gains of the config's filters are against too;
    identities: what the numbers of each depend on; judged_at: as of `Outside`."""

    baselines: tuple[str, ...] = ()
    identities: tuple[str, ...] = ()
    judged_at: tuple[str, float] | None = None


# ---- plan and sums ---------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Plan:
    """What the sums of the filters from outside of a case are made of; beside it the study's own plan, `inner`."""

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
    """The plan beside the study's own. Raises ConfigError for a study whose errors no filter can be paired with."""
    axes = inner.axes
    draw, world, scans = setting(study, case, inner)
    names = [member.name for member in case.outside]
    if taken := [name for i, name in enumerate(names) if name in (*axes.filters, *names[:i])]:
        raise ConfigError(f"{case.name}: name: there is a filter {taken[0]!r} already; give another name")
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
    own = OutsideAxes(*labels, baselines, tuple(member.identity for member in case.outside), judged_at)
    return Plan(study, inner, draw, world, scans, case.outside, own, layout)


def setting(study: "Study", case: Case, inner: Any) -> tuple["Draw", World, np.ndarray]:
    """What draws the plots of a case, what a filter may know, and the places (K,) of the axes' scans among all scans.

    Raises ConfigError for a study whose errors no filter can be paired with."""
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
    """What a filter sees of the first realisations of a case, before there is a plan for it."""
    draw, world, _ = setting(study, case, study.prepare(case))
    return seen_by_filter(world, draw(0, count))


def drawing(study: "Study", case: Case) -> "Draw":
    """What draws the plots of a case; raises ConfigError for a study without any."""
    recorded = study.recording_interface()
    if recorded is None:
        raise ConfigError(f"{case.name}: study {study.name} draws no plots that a filter from outside could take")
    return recorded.drawing(case)


def world_of(study: "Study", case: Case, drawn: "Drawn", components: tuple[tuple[str, str], ...]) -> World:
    """What a filter over these plots may know, of a state with these components."""
    recorded = study.recording_interface()
    keys = {} if recorded is None else recorded.sigmas(case.spec)
    stated = {one.rpartition("sigma_")[2]: one for of in keys.values() for one in of}
    sigma = {name: attrgetter(stated[name])(case.spec) for name in drawn.columns if name in stated}
    return World(drawn.t_s, tuple(drawn.columns), sigma, components, case.keys, case.name)


def plots_of(plan: Plan, drawn: "Drawn") -> Plots:
    """What a filter of a plan sees of plots."""
    return seen_by_filter(plan.world, drawn)


def seen_by_filter(world: World, drawn: "Drawn") -> Plots:
    """What a filter sees of plots: arrays and keys of its own, which it may change."""
    columns = {name: np.array(values, order="C") for name, values in drawn.columns.items()}  # as C code takes them
    world = replace(world, t_s=np.array(world.t_s), keys=deepcopy(world.keys))
    return Plots(np.array(drawn.t_s), columns, world, drawn.first, drawn.n)


def inner_errors(plan: Plan, first: int, count: int) -> np.ndarray:
    """Errors (F, n, K, C) of the study's own filters, not-a-number where one has no estimate."""
    found = np.ascontiguousarray(plan.study.errors(plan.inner, first, count))
    found.swapaxes(0, 1)[:, ~np.asarray(plan.inner.axes.available)] = np.nan
    return found


@dataclass(frozen=True)
class Judged:
    """Errors (n, K, C) of a filter, not-a-number where it has none, of realisations that fail too; failed (n, 4) the
    counts of each, by COUNTS; nees (n, K)."""

    error: np.ndarray
    failed: np.ndarray
    nees: np.ndarray


def judged(plan: Plan, member: Outside, given: Any, drawn: "Drawn", scale: np.ndarray) -> Judged:
    """The errors of a filter's estimates. scale (n, C): the largest error of the study's own filters."""
    names, K = plan.names, len(plan.world.t_s)
    x, P = checked(member.name, given, drawn.n, K, names, member.components)
    places = columns_of(member.name, x.shape[2], names, member.components)
    begun, finite = np.maximum.accumulate(np.isfinite(x), axis=1), np.isfinite(x)
    failed = np.zeros((drawn.n, len(COUNTS)), dtype=bool)
    failed[:, 0] = (begun & ~finite).any((1, 2)) | np.isinf(x).any((1, 2))
    failed[:, 1] = ~failed[:, 0] & ~finite.any((1, 2)) & np.isfinite(scale).any(1)
    error = np.full((drawn.n, len(plan.scans), len(names)), np.nan)
    error[..., places] = x[:, plan.scans] - drawn.truth_of(plan.axes.components)[:, plan.scans][..., places]
    with np.errstate(invalid="ignore"):
        failed[:, 2] = ~failed[:, 0] & (np.abs(error) > DIVERGED * scale[:, None]).any((1, 2))
    error[failed.any(1)] = np.nan
    nees = np.full(error.shape[:2], np.nan)
    if P is not None:
        of, there = P[:, plan.scans], np.isfinite(error[..., places]).all(-1)
        there &= np.isfinite(of).all((-2, -1))
        nees[there], proper = normalised(error[there][:, places], of[there])
        failed[np.nonzero(there)[0][~proper], 3] = True
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
    drawn = plan.draw(first, count)
    errors = list(inner_errors(plan, first, count))
    scale = largest(errors)
    sums = {name: np.zeros(shape) for name, shape in plan.layout.shapes.items()}
    squares = [squared(one) for one in errors]
    for g, member in enumerate(plan.members):
        found = judged(plan, member, member.estimates(plots_of(plan, drawn)), drawn, scale)
        e, (there, square, fourth) = np.nan_to_num(found.error), squared(found.error)
        sums["estimates"][g] = there.sum(0)
        for power, values in enumerate((e, square, square * e, fourth)):
            sums["error"][g, ..., power] = values.sum(0)
        for b, (other, base, base_fourth) in enumerate(squares):
            pairs = (
                (there, other),
                (square, other),
                (fourth, other),
                (there, base),
                (there, base_fourth),
                (square, base),
                (there * other, np.square(np.square(square - base))),
            )
            for j, (one, two) in enumerate(pairs):
                sums["both"][g, b, ..., j] = np.einsum("nkc,nkc->kc", one, two)
        known = np.isfinite(found.nees)
        q = np.where(known, found.nees, 0)
        sums["nees"][g] = np.stack([known.sum(0), q.sum(0), (q * q).sum(0)], axis=-1)
        sums["failures"][g] = found.failed.sum(0)
        squares.append((there, square, fourth))
    return plan.layout.pack(**sums)


def largest(errors: Iterable[np.ndarray]) -> np.ndarray:
    """The largest error (n, C) of any filter at any scan; not-a-number where none has an estimate."""
    every = np.stack([np.abs(one) for one in errors])
    most = np.where(np.isnan(every), -1, every).max((0, 2))
    return np.where(most < 0, np.nan, most)


def squared(error: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of errors (n, K, C) where there is one (1 or 0), its square and fourth power, zero elsewhere."""
    there = np.isfinite(error).astype(float)
    square = np.square(np.nan_to_num(error))
    return there, square, np.square(square)


def result(plan: Plan, of: CaseResult, sums: Mapping[str, np.ndarray]) -> CaseResult:
    """The filters from outside as a case of their own, beside `of`: with estimates only where there was one."""
    axes = replace(plan.axes, available=sums["estimates"] > 0)
    return replace(of, sums=sums, axes=axes, against=())
