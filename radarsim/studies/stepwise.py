"""A study in one file whose filters are not linear: the step of one realisation, from which eight are computed.

    class Turning(StepStudy):                       # besides what `radarsim.studies.onefile` needs
        known_columns = ("own_x_m", "own_y_m")      # what is known at each scan, as columns of recorded plots
        kinds = {"ekf": Ekf, "pseudo_linear": Pseudo}  # the filters' steps, by their key `kind`
        normals = 4, 0, 1                           # unit normals: of the first state, of a move, of a plot

        def world(self, spec): …                    # the numbers of a case that its truth and plots need, a record
        def known_quantities(self, spec, t_s): …    # what is known at times t_s (K,), columns (K,)
        def begin(self, c, w): …                    # the first state, of the world's numbers c and normals w
        def move(self, x, dt, c, w): …              # the state after dt seconds; (self, x, dt, c, w, t): at time t, s
        def plot(self, x, u, c, w): …               # the numbers of a plot; u: what is known at the scan
        def truth(self, x, u, c): …                 # the components of the state; where not given, the state itself

    class Ekf(Steps):
        def design(spec, filter_keys): …            # the numbers of a filter by its keys, a record
        def start(z, u, c): …                       # its state after the first plot
        def predict(s, dt, u, c): …                 # its state before a plot, or in place of one that is missed
        def update(s, z, u, c): …                   # its state after a plot
        def estimate(s, u, c): …                    # its estimates of the components
        def covariance(s, u, c): …                  # their packed covariance, or None
        def log_densities(s, z, u, c): …            # of a plot's first number, of the first two, … by the state before
        def innovation(s, z, u, c): …               # of a plot, with its packed covariance, or None

These are plain functions of numbers, tuples and named records; what calculates with numbers of a realisation is in
`radarsim.kernels.tracing` (`sqrt`, `where`, …) and `radarsim.kernels.formula_functions` (`sin`, `atan2`, …). A state, a
plot, a record is any tuple of numbers or of such tuples; its shape stays the same. The same text runs on eight
realisations at a time, compiled, and on floats over recorded plots. Branches by keys are Python's: text, truth values
and whole numbers of a record are no numbers of a realisation, and each of their values has a separate kernel.

The first plot is always there; `detection` is the probability of each later one. Where a filter gives a covariance,
`believed_sigma` in `curves` and the table `consistency` say how it agrees with the errors, the latter from the scan
`tested_from(spec, filter_keys)` on. A study that knows σ exactly gives `exact_sigma`.

Among false plots a study gives more:

    false_quantities = 1                            # numbers of a scan after those that are known, for its plots alone
    counted = ("confirmed",)                        # what is counted of kept tracks

    def false_places(self, spec): …                 # how many places for false plots a scan has; 0: none
    def expected_false_plots(self, x, u, c): …      # their mean number, of Poisson's law
    def false_plot(self, x, u, even, c): …          # one, of numbers `even` from 0 to 1, as many as are measured
    def kept(self, e, u, c): …                      # whether a track with these errors is still the target's

and each filter `counts(s, u, c)`, what is counted of a track: 1.0 or 0.0 each. An update then takes, in place of a
plot, places for plots, each whether there is one (1.0), and its numbers: that of the target first, at missed scans too;
`radarsim.kernels.lane_loops.accumulate` goes over them. Lost tracks stay lost, their errors do not count; the table
`tracks` says how many are kept."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.study_keys import possible_kinds
from radarsim.engine.results import Axes, CaseResult
from radarsim.engine.sums import Layout
from radarsim.errors import ConfigError
from radarsim.kernels.formula_functions import wrap_angle
from radarsim.studies.noise import noise_key
from radarsim.studies.onefile import OneFile
from radarsim.studies.plot_arrays import DrawPlots, SimulatedPlots, true_column
from radarsim.studies.step_checks import DIFFERENT_FORMULA, record, to_array
from radarsim.studies.step_programs import CompiledFilter, Scene, cached_kernel, compile_filter, to_numbers, trace_scene
from radarsim.studies.step_tracker import Tracker
from radarsim.user_code.errors import study_context, user_code_error

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.config.experiment import Case, Experiment
    from radarsim.report.drawing.model import Figure
    from radarsim.studies.recording_interface import Likelihood


MAX_DIFFERENCE = 1e-9  # of the largest truth: permitted difference between plain Python and the kernel
BLOCK = 512  # realisations in a block
MAX_ROWS = 20_000  # rows of plots and errors at once, 1.3 MB: fits a processor's cache


class Steps:
    """A filter of one realisation; see the module's docstring. Its functions have no self."""

    design: Callable[[Any, Any], Any]
    start: Callable[[Any, Any, Any], Any]
    predict: Callable[[Any, Any, Any, Any], Any]
    update: Callable[[Any, Any, Any, Any], Any]
    estimate: Callable[[Any, Any, Any], tuple[Any, ...]]
    covariance: Callable[[Any, Any, Any], tuple[Any, ...]] | None = None
    log_densities: Callable[[Any, Any, Any, Any], Sequence[Any]] | None = None
    innovation: Callable[[Any, Any, Any, Any], tuple[Any, Any]] | None = None
    counts: Callable[[Any, Any, Any], tuple[Any, ...]]
    gate: Callable[[Any, Any, Any], tuple[float, ...]]


@dataclass(frozen=True)
class Plan:
    """Data of a block; see `radarsim.kernels.steps` for the arrays."""

    layout: Layout
    axes: Axes
    keys: np.ndarray
    detection: float
    known_quantities: np.ndarray
    width: int
    draw: Callable[..., None]
    numbers: np.ndarray
    scene: Scene
    filters: tuple[CompiledFilter, ...]
    case: "Case"
    checked: dict[str, np.ndarray] = field(default_factory=dict)
    block: int = BLOCK
    gaussian = False


class StepStudy(OneFile):
    """A study by the steps of one realisation; the module's docstring lists what a subclass gives."""

    kinds: Mapping[str, type[Steps]]
    normals: tuple[int, int, int]
    known_columns: tuple[str, ...] = ()
    false_quantities: int = 0
    counted: tuple[str, ...] = ()
    extra_figures: tuple[str, ...] = ("consistency", "tracks")

    world: Callable[..., Any]
    begin: Callable[..., Any]
    move: Callable[..., Any]
    plot: Callable[..., Any]

    kept: Callable[..., Any]
    expected_false_plots: Callable[..., Any]
    false_plot: Callable[..., Any]

    def known_quantities(self, spec: Any, t_s: np.ndarray) -> Sequence[np.ndarray]:
        """Quantities known at times t_s (K,) s: columns (K,), in the order of `known_columns`, and those of false
        plots. Default: nothing."""
        return ()

    def false_places(self, spec: Any) -> int:
        """How many places for false plots a scan has. Default: 0, there are none."""
        return 0

    def truth(self, x: Any, u: Any, c: Any) -> tuple[Any, ...]:
        """The components of a true state. Default: the state."""
        return tuple(x)

    def difference(self, estimate: Any, true: Any) -> tuple[Any, ...]:
        """The errors of the components: estimates less the truth, of an angle less whole turns."""
        errors = (a - b for a, b in zip(estimate, true, strict=True))
        units = (component.unit for component in self.components)
        return tuple(wrap_angle(e) if unit == "rad" else e for e, unit in zip(errors, units, strict=True))

    def detection(self, spec: Any) -> float:
        """The probability of a plot after the first. Default: certain."""
        return 1.0

    def tested_from(self, spec: Any, filter_keys: Any) -> int:
        """The number of the scan, from 0, from which the NEES tests a filter's covariance. Default: the first."""
        return 0

    def exact_sigma(self, spec: Any) -> np.ndarray | None:
        """The exact σ (F, K, C) of a case about the truth, NaN where unknown. Default: not known."""
        return None

    @classmethod
    def missing(cls) -> Iterator[str]:
        yield from super().missing()
        for needed in ("kinds", "normals", "world", "begin", "move", "plot"):
            if not hasattr(cls, needed):
                yield f"{cls.__name__}.{needed} must be given; see radarsim.studies.stepwise"
        for name in ("world", "begin", "move", "plot", "known_quantities", "truth", "detection", "exact_sigma"):
            if not callable(attribute := getattr(cls, name, len)):
                yield f"{cls.__name__}.{name} must be a function, got {attribute!r}"[:200]
        normals = getattr(cls, "normals", (0, 0, 0))
        if not isinstance(normals, tuple) or len(normals) != 3 or not all(type(n) is int and n >= 0 for n in normals):
            yield f"normals: must be three whole numbers, of the first state, of a move, of a plot; got {normals!r}"
        if isinstance(cls.known_columns, str):
            yield f"known_columns: must be a tuple, ({cls.known_columns!r},); got {cls.known_columns!r}"
        kinds = getattr(cls, "kinds", {})
        if not isinstance(kinds, Mapping):
            yield f"kinds: must be a mapping, a subclass of Steps by its kind, got {kinds!r}"[:200]
            return
        for kind, steps in kinds.items():
            if not (isinstance(steps, type) and issubclass(steps, Steps)):
                yield f"kinds: {kind}: must be a subclass of radarsim.studies.stepwise.Steps, got {steps!r}"[:200]
                continue
            for needed in ("design", "start", "predict", "update", "estimate"):
                if not callable(getattr(steps, needed, None)):
                    yield f"{cls.__name__}.kinds: {kind}: {needed} must be given; see radarsim.studies.stepwise"
        allowed_kinds = possible_kinds(cls.Filter) if isinstance(getattr(cls, "Filter", None), type) else ()
        if kinds and not allowed_kinds:
            yield f"Filter: must have a key kind: Literal[{', '.join(map(repr, kinds))}]"
        elif missing_kinds := [kind for kind in allowed_kinds if kind not in kinds]:
            names = ", ".join(kinds)
            yield f"kinds: no {' and no '.join(missing_kinds)}, which the key kind of Filter allows; there are {names}"

    def prepare(self, case: "Case") -> Plan:
        with study_context(self.name):
            return self._prepared(case)

    def _prepared(self, case: "Case") -> Plan:
        from radarsim.kernels import steps

        spec = case.spec
        axes, sums = self.axes(spec, self._exact(spec)), self.sums(spec)
        known_quantities = self._checked_known_quantities(spec, axes.t_s)
        world, detection = record(self.world, spec), self._probability(spec)
        scene = trace_scene(self, spec, world)
        filters = tuple(compile_filter(self, spec, keys, scene, detection < 1) for keys in spec.filters)
        f, k, c = sums.shapes["paired"]
        if any(member.tested for member in filters):
            sums = Layout(**sums.shapes, believed=(f, k, c), nees=(f, k, 2))
        if scene.false:
            sums = Layout(**sums.shapes, estimates=(f, k, c), counts=(f, k, 1 + len(self.counted)))
        keys = np.stack([noise_key(case, stream) for stream in ("plots", "detections", "false plots")])
        draw = cached_kernel(
            steps.truth_kernel, scene.first, scene.following, scene.pairs, scene.plot_rows, scene.uniform_pairs
        )
        kernel_arguments = known_quantities.ravel(), known_quantities.shape[1], draw, to_numbers(world)
        return Plan(sums, axes, keys, detection, *kernel_arguments, scene, filters, case)

    def _probability(self, spec: Any) -> float:
        """The probability of a plot."""
        probability = self.call(self.detection, spec)
        if not isinstance(probability, int | float) or not 0 <= probability <= 1:
            raise user_code_error(self.detection, f"must give a probability, from 0 to 1, got {probability!r}"[:200])
        return float(probability)

    def _exact(self, spec: Any) -> np.ndarray | None:
        """The value of `exact_sigma`, checked."""
        if (values := self.call(self.exact_sigma, spec)) is None:
            return None
        shape = len(spec.filters), spec.scans, len(self.components)
        sigma = to_array(self.exact_sigma, values, "filters × scans × components")
        if sigma.shape != shape or (sigma < 0).any():
            raise user_code_error(self.exact_sigma, f"must give σ {shape}, none negative, got {sigma.shape}")
        return sigma

    def _checked_known_quantities(self, spec: Any, t_s: np.ndarray) -> np.ndarray:
        """The time since the scan before, and the known quantities at each, (K, whole eights)."""
        count = len(self.known_columns) + self.false_quantities
        required = f"must give {count} columns of {t_s.size} finite numbers, as known_columns says; got "
        known_quantities, repeated = (self.call(self.known_quantities, spec, t_s) for _ in range(2))
        if (
            not isinstance(known_quantities, Sequence | np.ndarray)
            or isinstance(known_quantities, str)
            or len(known_quantities) != count
        ):
            size = f"{len(known_quantities)}" if isinstance(known_quantities, tuple | list) else repr(known_quantities)
            raise user_code_error(self.known_quantities, f"{required}{size}"[:200])
        values, repeated_values = (
            to_array(self.known_quantities, columns, f"{t_s.size} in each column")
            for columns in (known_quantities, repeated)
        )
        if values.shape[1:] != (t_s.size,) * bool(len(known_quantities)) or not np.isfinite(values).all():
            raise user_code_error(
                self.known_quantities, f"{required}{values.shape}, {np.sum(~np.isfinite(values))} of them not finite"
            )
        if not np.array_equal(values, repeated_values):
            raise user_code_error(
                self.known_quantities, f"{DIFFERENT_FORMULA}: draw in begin, move and plot, by normals"
            )
        columns = [np.diff(t_s, prepend=t_s[0]), *values, t_s]
        padded = np.zeros((t_s.size, -(-len(columns) // 8) * 8))
        padded[:, : len(columns)] = np.transpose(columns)
        return padded

    def simulate(self, plan: Plan, first: int, count: int) -> np.ndarray:
        values = np.zeros(plan.layout.size)
        sums = plan.layout.unpack(values)
        for _ in self._followers(plan, first, count, sums):
            pass
        is_zero = (sums["error"][..., 1] == 0) & (sums["estimates"] > 0 if "estimates" in sums else True)
        if is_zero.any():
            sums["error"][is_zero & ~self._free_of_error(plan)] = np.nan
        if "believed" in sums and (has_no_covariance := (sums["believed"] < 0).any(axis=2)).any():
            sums["believed"][has_no_covariance] = sums["nees"][has_no_covariance] = np.nan
        return values

    def errors(self, plan: Plan, first: int, count: int) -> np.ndarray:
        errors = np.empty((count, *plan.axes.available.shape))
        sums = plan.layout.unpack(np.zeros(plan.layout.size))
        for f, start, used, block_errors in self._followers(plan, first, count, sums):
            errors[start : start + used, f] = block_errors[:used]
        if (is_zero := errors == 0).any():
            errors[is_zero & ~self._free_of_error(plan)] = np.nan
        return np.moveaxis(errors, 0, 1)

    def _followers(
        self, plan: Plan, first: int, count: int, sums: Mapping[str, np.ndarray]
    ) -> Iterator[tuple[int, int, int, np.ndarray]]:
        """Run the filters over a block and add up their sums.

        Gives each filter, the number of the first of some realisations and how many they are, and their errors
        (≥ used, K, C), which are valid till the next ones."""
        from radarsim.kernels.compiler import aligned_zeros
        from radarsim.kernels.lanes import WIDTH

        nothing = np.zeros((1, 2))
        scans, components = plan.axes.k.size, len(plan.axes.components)
        max_groups = max(1, MAX_ROWS // (scans * (plan.scene.plot_rows + 2 * components)))
        work = aligned_zeros(max(member.rows for member in plan.filters) * WIDTH)
        baseline_errors, own_errors = (aligned_zeros(max_groups * scans * components * WIDTH) for _ in range(2))
        order = sorted(range(len(plan.filters)), key=lambda f: f != plan.axes.baseline)
        for start in range(0, count, max_groups * WIDTH):
            used = min(max_groups * WIDTH, count - start)
            groups = -(-used // WIDTH)
            plots = draw_plots(plan, first + start, groups)
            for f in order:
                member, errors = plan.filters[f], baseline_errors if f == plan.axes.baseline else own_errors
                tested = [sums[name][f] if member.tested else nothing for name in ("believed", "nees")]
                counts = sums["counts"][f] if "counts" in sums else nothing
                filter_sums = sums["error"][f], sums["paired"][f], *tested, counts
                member.kernel(
                    groups,
                    used,
                    plan.known_quantities,
                    plan.width,
                    member.numbers,
                    plots,
                    work,
                    errors,
                    baseline_errors,
                    *filter_sums,
                )
                if "counts" in sums:
                    sums["estimates"][f] = counts[:, :1]
                values = errors.reshape(max_groups, scans, components, WIDTH)[:groups]
                yield f, start, used, values.transpose(0, 3, 1, 2).reshape(-1, scans, components)

    def _free_of_error(self, plan: Plan) -> np.ndarray:
        """Where (F, K, C) estimates equal the truth in plain Python too, in realisation 0.

        Compiled code assumes finite numbers: a NaN error may be stored as zero."""
        if "free" not in plan.checked:
            plots = self._drawing(plan)(0, 1)
            columns, truth = plots.rows(0), plots.truth[0]
            try:
                with np.errstate(all="ignore"):
                    estimate = Tracker(self, plan.case.spec).feed(columns).estimate
            except ConfigError:  # a division by zero
                estimate = np.full_like(plan.axes.exact_sigma, np.nan)
            errors = np.stack(self.difference(np.moveaxis(estimate, -1, 0), truth.T), axis=-1)
            plan.checked["free"] = np.abs(errors) <= MAX_DIFFERENCE * np.abs(truth).max(axis=0)
        return plan.checked["free"]

    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        from radarsim.report import tables
        from radarsim.studies import step_tables

        tables_of_study = super().tables(results)
        made = {
            "consistency": (step_tables.consistency_columns, "nees"),
            "tracks": (step_tables.track_columns, "counts"),
        }
        for name, (columns, sums) in made.items():
            if with_sums := [result for result in results if sums in result.sums]:
                tables_of_study[name] = tables.join_columns([columns(self, result) for result in with_sums])
        if "consistency" in tables_of_study:
            tables_of_study["curves"] = self.curves(results)
        return tables_of_study

    def curves(self, results: "Sequence[CaseResult]") -> "pd.DataFrame":
        from radarsim.report import tables
        from radarsim.studies import step_tables

        return tables.join_columns([step_tables.curve_columns(self, result) for result in results])

    def figures(
        self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "dict[str, Figure]":
        from radarsim.report import consistency_figures

        figures = super().figures(results, tables, experiment)
        return (
            figures | consistency_figures.consistency_figures(results, tables["consistency"], experiment)
            if "consistency" in tables
            else figures
        )

    def columns(self, spec: Any, filter_keys: Any) -> tuple[str, ...]:
        return (*super().columns(spec, filter_keys), *self.known_columns)

    def drawing(self, case: "Case") -> DrawPlots:
        return self._drawing(self.prepare(case))

    def _drawing(self, plan: Plan) -> DrawPlots:
        from radarsim.kernels.lanes import WIDTH

        scans, rows, numbers = plan.axes.k.size, plan.scene.plot_rows, len(self.measured)
        components, places = len(self.components), plan.scene.false
        known_quantities = plan.known_quantities.reshape(scans, -1)[:, 1 : 1 + len(self.known_columns)].T
        size = max(1, MAX_ROWS // (scans * rows))

        def draw(first: int, count: int) -> SimulatedPlots:
            groups = -(-count // WIDTH)
            plots = np.empty((rows, scans, groups, WIDTH))
            for start in range(0, groups, size):
                group_count = min(size, groups - start)
                block = draw_plots(plan, first + start * WIDTH, group_count).reshape(group_count, scans, rows, WIDTH)
                plots[:, :, start : start + group_count] = block.transpose(2, 1, 0, 3)
            values = plots.reshape(rows, scans, -1)[..., :count].swapaxes(1, 2)
            truth = values[1 + numbers : 1 + numbers + components].transpose(1, 2, 0)
            measured, false = values[: 1 + numbers], values[1 + numbers + components :]
            if places:
                measured = all_plots(np.stack([measured, *np.split(false, places)], axis=-1))
            measured[1:, measured[0] < 0.5] = np.nan
            columns = dict(zip((number.column for number in self.measured), measured[1:], strict=True))
            columns |= {
                name: np.broadcast_to(row.reshape(-1, *(1,) * bool(places)), measured[0].shape)
                for name, row in zip(self.known_columns, known_quantities, strict=True)
            }
            names = [true_column(*component) for component in plan.axes.components] if places else []
            true_columns = dict(zip(names, np.moveaxis(truth, -1, 0), strict=False))
            return SimulatedPlots(plan.axes.t_s, columns, plan.axes.components, truth, true_columns, first)

        return draw

    def fitted(self, filter_keys: Any) -> Sequence[str]:
        """The keys that `radarsim fit` looks for with a filter: dotted ones of parts, bare ones of the filter. Default:
        none."""
        return ()

    def likelihood(
        self, case: "Case", filter_name: str | None, tracks: "Sequence[Mapping[str, np.ndarray]]"
    ) -> "Likelihood | None":
        from radarsim.studies.step_likelihood import StepLikelihood

        usable = [
            keys
            for keys in case.spec.filters
            if self.kinds[keys.kind].log_densities is not None
            and self.fitted(keys)
            and all(name in track for track in tracks for name in self.columns(case.spec, keys))
            and filter_name in (None, keys.name)
        ]
        if not usable or self.known_columns or self.false_places(case.spec):
            return None
        return StepLikelihood(self, case.spec, max(usable, key=lambda keys: len(self.columns(case.spec, keys))), tracks)

    def tracker(self, case: "Case") -> "Tracker":
        with study_context(self.name):
            return Tracker(self, case.spec)


def all_plots(plots: np.ndarray) -> np.ndarray:
    """The places for plots (1 + measured, n, K, M), with the plots first, by their first number: nothing tells that of
    the target; without places that no scan needs."""
    order = np.argsort(np.where(plots[0] > 0.5, plots[1], np.inf), axis=-1)[..., : int(plots[0].sum(axis=-1).max())]
    return np.take_along_axis(plots, order[None], axis=-1)


def draw_plots(plan: Plan, first: int, groups: int) -> np.ndarray:
    """Truth and plots (groups × K × rows × 8, flat) of realisations from `first` on, see `radarsim.kernels.steps`."""
    from radarsim.kernels.compiler import aligned_zeros
    from radarsim.kernels.lanes import WIDTH
    from radarsim.kernels.steps import STRIP

    scene = plan.scene
    rows = scene.rows, STRIP * scene.pairs, STRIP * scene.pairs, 2, 2 * scene.uniform_pairs
    room = [aligned_zeros(n * WIDTH) for n in rows]
    plots = aligned_zeros(groups * plan.axes.k.size * scene.plot_rows * WIDTH)
    plan.draw(plan.keys, first, groups, plan.known_quantities, plan.width, plan.numbers, plan.detection, *room, plots)
    return plots
