"""User filters: an object, a function or arrays that give estimates for plots.

A filter is an object (or a class, made anew for every batch) with

    start(world)                   before the first scan: `World`
    step(plots) -> estimate        one scan of n realisations: `Plots`, columns (n,); estimate (n, d), or
                                   (estimate, covariance (n, d, d))

or a function of all scans, `f(plots) -> estimates (n, K, d)`, or `(estimates, covariances (n, K, d, d))`, columns (n,
K); or one of a single realisation, columns (K,), estimates (K, d). An estimate holds the leading components of the
state, or those that the attribute `components` names. Not-a-number stands where a filter has no estimate yet.

`World` and `Plots` are those of `radarsim.studies.plot_arrays` and of this file."""

import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.errors import ConfigError
from radarsim.studies.plot_arrays import RandomPlots, World, plot_column
from radarsim.studies.random_numbers import RandomNumbers
from radarsim.studies.user_filters.estimates import (
    Estimates,
    check_estimates,
    components_of,
    copy_estimates,
    stack_estimates,
)
from radarsim.studies.user_filters.seeding import building_filter

COMPILERS = ("numba", "jaxlib")  # packages whose functions take arrays and numbers alone


@dataclass(frozen=True)
class Plots(RandomPlots):
    """Plots of n realisations from number `first` on, not-a-number where missing: `plots["range_m"]`, (n, K). Of one
    scan these are (n,), and t_s is its time; of one realisation (K,). scan: the number of the one scan, from 0.

    A filter that draws takes `plots.normals(m)`, `plots.uniforms(m)` or `plots.generator()`."""

    t_s: Any
    columns: Mapping[str, np.ndarray]
    world: World
    first: int
    n: int
    scan: int | None = None

    def __getitem__(self, name: str) -> np.ndarray:
        return plot_column(self.columns, name)

    def _make_random_numbers(self) -> RandomNumbers:
        source = self.world.random
        assert source is not None  # a case has made the world
        if self.scan is not None:
            return RandomNumbers(source, self.first, self.n, [self.scan], (self.n,))
        K = len(self.t_s)
        is_one_realisation = all(column.ndim == 1 for column in self.columns.values())
        return RandomNumbers(source, self.first, self.n, range(K), (K,) if is_one_realisation else (self.n, K))


class UserFilter(ABC):
    """A user filter. identity: what its numbers depend on besides the plots; components: names of those it estimates,
    by default the leading ones. in_order: realisations must be computed in their order, by one thread."""

    name: str
    identity: str
    components: tuple[str, ...] = ()
    in_order: bool = False
    written: Mapping[str, Any] | None = None  #: its keys, where a config has it
    baseline: bool = False  #: whether gains of the others are against it too
    answer_at: tuple[str, float] | None = None  #: component and time, s, that the answer is about; None: first, last
    training_ratios: Mapping[str, float] = MappingProxyType({})  #: by case, see `note_training`
    dependent_cases: frozenset[str] = frozenset()  #: see `note_dependence`
    faults: Mapping[str, tuple[str, ...]] = MappingProxyType({})  #: by case, see `note_faults`

    @abstractmethod
    def estimates(self, plots: Plots) -> Any:
        """The estimates for these plots."""

    def bound_to(self, case: Case) -> "UserFilter":
        """The filter as one of a case."""
        return self

    def note_training(self, case: str, ratio: float) -> None:
        """Note that its σ on other noise is so many times as large, beyond chance: it knows the realisations of a case
        that it is judged on."""
        vars(self)["training_ratios"] = {**self.training_ratios, case: ratio}

    def note_dependence(self, case: str) -> None:
        """Note that its estimates of a realisation depend on the others in the batch, in a case."""
        vars(self)["dependent_cases"] = self.dependent_cases | {case}

    def note_faults(self, case: str, faults: tuple[str, ...]) -> None:
        """Note what is wrong with its estimates in a case, in sentences: a judgement says it first."""
        vars(self)["faults"] = {**self.faults, case: faults}

    def warnings(self) -> list[str]:
        """Warnings about its numbers, from what has run so far."""
        return []


@dataclass
class CalledFilter(UserFilter):
    """An object, class or function that is called with plots, by one thread at a time.

    alone: it is a function of one realisation."""

    name: str
    target: Any
    identity: str = ""
    components: tuple[str, ...] = ()
    takes_one_realisation: bool = False
    _lock: Any = field(default_factory=threading.Lock, repr=False)

    def estimates(self, plots: Plots) -> Any:
        with self._lock, np.errstate():  # which the code may change
            target = build_filter(self.name, self.target) if isinstance(self.target, type) else self.target
            if hasattr(target, "step") and hasattr(target, "start"):
                return run_steps(self.name, target, plots)
            if hasattr(target, "step") or hasattr(target, "start") or not callable(target):
                raise ConfigError(
                    f"{self.name}: a filter that is asked scan by scan must have start(world) and step(plots)"
                )
            _check_not_compiled(self.name, target, plots)
            if not self.takes_one_realisation:
                return target(plots)
            answers = [copy_estimates(target(plots_of_realisation(plots, i))) for i in range(plots.n)]
            return stack_estimates(
                self.name, answers, [f"realisation {plots.first + i}" for i in range(plots.n)], axis=0
            )


def _check_not_compiled(name: str, target: Any, plots: Plots) -> None:
    """Raise ConfigError for a compiled function, which cannot take plots."""
    function = target.func if isinstance(target, partial) else target
    if type(function).__module__.partition(".")[0] in COMPILERS or isinstance(function, np.ufunc):
        called = getattr(function, "__name__", "compiled")
        columns = ", ".join(f"plots[{column!r}]" for column in plots.columns)
        raise ConfigError(
            f"{name}: is a compiled function, which takes arrays, not plots: call it in a function of Python, "
            f"def my_filter(plots): return {called}({columns})"
        )


def plots_of_realisation(plots: Plots, i: int) -> Plots:
    """The plots of one realisation alone."""
    return replace(plots, columns={name: v[i] for name, v in plots.columns.items()}, first=plots.first + i, n=1)


def build_filter(name: str, target: type, **keys: Any) -> Any:
    """An object of a filter's class."""
    with building_filter():
        instance = target(**keys)
    if components_of(instance) != components_of(target):
        raise ConfigError(f"{name}: components must be an attribute of the class itself, not of its objects")
    return instance


def run_steps(name: str, target: Any, plots: Plots) -> Any:
    """The estimates of a filter that is called scan by scan."""
    target.start(plots.world)
    estimates = []
    for k, t in enumerate(plots.t_s):
        columns = {column: np.ascontiguousarray(v[:, k]) for column, v in plots.columns.items()}
        answer = target.step(replace(plots, t_s=float(t), columns=columns, scan=k))
        estimates.append(copy_estimates(answer))
        if (shape := estimates[-1][0].shape)[:1] != (plots.n,):
            got = f"shape {shape}" if shape else type(answer).__name__
            raise ConfigError(f"{name}: step must give estimates (n, d) of n = {plots.n} realisations, got {got}")
    return stack_estimates(name, estimates, [f"{t:g} s" for t in plots.t_s], axis=1)


@dataclass
class StoredEstimates(UserFilter):
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
class EstimateChunks(UserFilter):
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
        x, P = copy_estimates(answer)
        names = [name for name, _ in plots.world.components]
        shape = check_estimates(self.name, (x, P), len(x) if x.ndim else 0, len(plots.t_s), names, self.components)[
            0
        ].shape
        if self._kept and shape[2] != self._kept[0][0].shape[2]:
            raise ConfigError(f"{self.name}: chunks must hold the same components, got {self._kept[0][0].shape[2]} "
                              f"and then {shape[2]}")  # fmt: skip
        return x.reshape(shape), P
