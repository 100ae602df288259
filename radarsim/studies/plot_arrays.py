"""Plots of many realisations as arrays, with the truth; columns are named with their units."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from radarsim.errors import ConfigError
from radarsim.studies.random_numbers import RandomNumbers, RandomSource

if TYPE_CHECKING:
    import numpy as np
    import xarray


TRUTH_PREFIX = "true_"  # prefix of the names of columns that hold the truth
UNITS_IN_NAMES = {"m/s": "mps", "m/s2": "mps2", "rad/s": "radps", "rad/s2": "radps2"}  # other units stand as they are


def true_column(component: str, unit: str) -> str:
    """The column with the true values of a component of the state: `true_Vr_mps`."""
    plain = unit.translate(str.maketrans("²³⁴⁵", "2345"))
    return f"{TRUTH_PREFIX}{component}_{UNITS_IN_NAMES.get(plain, plain.replace('/', 'p'))}"


def estimate_errors(
    estimates: "np.ndarray", truth: "np.ndarray", components: Sequence[tuple[str, str]]
) -> "np.ndarray":
    """Estimates less the truth, both (…, C), of components by name and unit: of an angle less whole turns."""
    import numpy as np

    errors = estimates - truth
    for c, (_, unit) in enumerate(components):
        if unit == "rad":
            errors[..., c] -= 2 * np.pi * np.round(errors[..., c] / (2 * np.pi))
    return errors


@dataclass(frozen=True)
class World:
    """What a filter may know beforehand.

    t_s (K,) times of the scans, s; columns: what is measured, units in the names; sigma: its standard deviations, where
    the config states them; components: names and units of the state; keys: the config, as YAML has it;
    case: what the case is called; random: where the random numbers that go with the plots come from.
    """

    t_s: "np.ndarray"
    columns: tuple[str, ...]
    sigma: Mapping[str, float]
    components: tuple[tuple[str, str], ...]
    keys: Mapping[str, Any]
    case: str = ""
    random: RandomSource | None = field(default=None, repr=False, compare=False)


class RandomPlots:
    """Plots with random numbers of their own, for filters that draw: see `radarsim.studies.random_numbers`.

    They are fixed by the seed of the run, the realisation, the scan and the order of calls, and the same for every
    filter. A call gives numbers that no earlier call gave."""

    def normals(self, m: int | tuple[int, ...]) -> "np.ndarray":
        """m independent unit normals for each realisation: (n, m) at one scan, (n, K, m) of all scans, (K, m) of one
        realisation. m may be a shape."""
        return self._random_numbers.normals(m)

    def uniforms(self, m: int | tuple[int, ...]) -> "np.ndarray":
        """m independent uniform numbers in (0, 1) for each realisation, as `normals`."""
        return self._random_numbers.uniforms(m)

    def generator(self) -> "np.random.Generator":
        """A generator of NumPy's for a library that draws by itself, seeded by the run, the batch and the scan.

        Its numbers depend on how realisations are put into batches; those of `normals` do not."""
        return self._random_numbers.generator()

    @cached_property
    def _random_numbers(self) -> RandomNumbers:
        return self._make_random_numbers()

    def _make_random_numbers(self) -> RandomNumbers:
        raise NotImplementedError


def plot_column(columns: "Mapping[str, np.ndarray]", name: str) -> "np.ndarray":
    """A column of plots by its name; the KeyError names those that are there."""
    if name not in columns:
        raise KeyError(f"{name}: plots have {', '.join(columns)}")
    return columns[name]


@dataclass(frozen=True, eq=False, repr=False)
class SimulatedPlots(RandomPlots):
    """The plots of n realisations from number `first` on, exactly those of a run, and the truth at times t_s (K,), s.

    columns (n, K)  what is measured, by name and unit, not-a-number where missing; (n, K, M) where a scan may have
                    several plots: these come first, the rest is not-a-number, and M is as large as needed
    truth (n, K, C) the true state, its components by name and unit; further_columns: true_…, of either shape

    seed: of the noise; world: what a filter may know beforehand, a `World`. A function for `radarsim.judge` can be
    called with these plots: it reads `plots["range_m"]`, t_s, world. Arrays may be views that cannot be written."""

    t_s: "np.ndarray"
    columns: "Mapping[str, np.ndarray]"
    components: tuple[tuple[str, str], ...]
    truth: "np.ndarray"
    further_columns: "Mapping[str, np.ndarray]" = field(default_factory=dict)
    first: int = 0
    seed: int = 0
    make_world: Callable[[], World] | None = None  # the world, made when asked for

    def __getitem__(self, name: str) -> "np.ndarray":
        return plot_column(self.columns, name)

    @property
    def world(self) -> World:
        """See the class."""
        assert self.make_world is not None  # as in what `radarsim.plots` gives
        return self.make_world()

    @property
    def n(self) -> int:
        """How many realisations there are."""
        return len(self.truth)

    @property
    def several(self) -> bool:
        """Whether a scan may have several plots."""
        return any(column.ndim == 3 for column in self.columns.values())

    def _make_random_numbers(self) -> RandomNumbers:
        source = self.world.random
        assert source is not None  # a case has made the world
        n, K = self.truth.shape[:2]
        return RandomNumbers(source, self.first, n, range(K), (n, K))

    def __repr__(self) -> str:
        names = ", ".join(f"{name} ({unit})" for name, unit in self.components)
        numbers = f"{self.first} … {self.first + self.n - 1}, {len(self.t_s)} scans"
        return f"<plots of realisations {numbers}: {', '.join(self.columns)}; truth {names}>"

    def truth_of(self, components: Sequence[tuple[str, str]]) -> "np.ndarray":
        """The truth (n, K, C) of these components, which may be fewer than all or in another order."""
        names = [true_column(*component) for component in self.components]
        chosen = [names.index(true_column(*component)) for component in components]
        return self.truth if chosen == list(range(len(names))) else self.truth[..., chosen]

    def arrays(self) -> "dict[str, np.ndarray]":
        """All arrays (n, K) or (n, K, M): what is measured, then the truth in columns true_…."""
        names = (true_column(*component) for component in self.components)
        state = {name: self.truth[..., c] for c, name in enumerate(names)}
        return {**self.columns, **self.further_columns, **state}

    def table(self) -> "dict[str, np.ndarray]":
        """All realisations one after the other as columns (rows,): `realisation`, `t_s`, what is measured, the truth.

        There is one row per scan. Where a scan may have several plots, there is one row per plot, or one without values
        where a scan has none; the truth is then that in `further_columns`."""
        import numpy as np

        n, K = self.truth.shape[:2]
        columns = {"realisation": np.arange(self.first, self.first + n)[:, None], "t_s": self.t_s[None]}
        if not self.several:
            return {name: np.broadcast_to(v, (n, K)).flatten() for name, v in (columns | self.arrays()).items()}
        columns |= {**self.columns, **self.further_columns}
        has_row = np.any([np.isfinite(column) for column in self.columns.values()], axis=0)
        has_row[..., 0] = True
        wide = ((name, values if values.ndim == 3 else values[..., None]) for name, values in columns.items())
        return {name: np.broadcast_to(values, has_row.shape)[has_row] for name, values in wide}

    def rows(self, i: int) -> "dict[str, np.ndarray]":
        """One of the realisations, counted from 0, with the columns of `table` except its number."""
        selected = (
            {name: v[i : i + 1] for name, v in values.items()} for values in (self.columns, self.further_columns)
        )
        realisation = SimulatedPlots(
            self.t_s, next(selected), self.components, self.truth[i : i + 1], next(selected)
        ).table()
        return {name: column for name, column in realisation.items() if name != "realisation"}

    def to_xarray(self) -> "xarray.Dataset":
        """All arrays as a dataset of xarray, which must be installed; its dimensions are realisation, t_s and plot."""
        import numpy as np

        try:
            import xarray
        except ImportError as error:
            raise ConfigError("to_xarray needs the package xarray: pip install 'radarsim[xarray]'") from error
        axes = ("realisation", "t_s", "plot")
        units = {true_column(name, unit): {"units": unit} for name, unit in self.components}
        data = {name: (axes[: v.ndim], v, units.get(name, {})) for name, v in self.arrays().items()}
        return xarray.Dataset(data, {axes[0]: np.arange(self.first, self.first + self.n), axes[1]: self.t_s})


DrawPlots = Callable[[int, int], SimulatedPlots]
