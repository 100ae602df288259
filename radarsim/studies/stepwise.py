"""The declaration of a study whose filters are not linear: the step of one realisation, from which eight are computed.

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
        def merge(s, other, p, c): …                # one state of two, with the probabilities p and 1 - p
        sigma_field = "sigma"                       # the numbers' field of σ of what is measured, a tuple
        noise_field = "noise"                       # that of σ of the process noise, which hard manoeuvres raise

These are plain functions of numbers, tuples and named records; what calculates with numbers of a realisation is in
`radarsim.kernels.tracing` (`sqrt`, `where`, …) and `radarsim.kernels.formula_functions` (`sin`, `atan2`, …). A state, a
plot, a record is any tuple of numbers or of such tuples; its shape stays the same. The same text runs on eight
realisations at a time, compiled, and on floats over recorded plots. Branches by keys are Python's: text, truth values
and whole numbers of a record are no numbers of a realisation, and each of their values has a separate kernel.

The first plot is always there; `detection` is the probability of each later one. Where a filter gives a covariance,
`believed_sigma` in `curves` and the table `consistency` say how it agrees with the errors, the latter from the scan
`tested_from(spec, filter_keys)` on. A study that knows σ exactly gives `exact_sigma`. `fit` allows for outliers where a
filter gives `merge` and `sigma_field`.

Among false plots a study gives more:

    false_quantities = 1                            # numbers of a scan after those that are known, for its plots alone
    counted = ("confirmed",)                        # what is counted of kept tracks

    def false_places(self, spec): …                 # how many places for false plots a scan has; 0: none
    def expected_false_plots(self, x, u, c): …      # their mean number, of Poisson's law
    def false_plot(self, x, u, even, c): …          # one, of numbers `even` from 0 to 1, as many as are measured
    def is_on_target(self, e, u, c): …              # whether a track with these errors is still the target's

and each filter `counts(s, u, c)`, what is counted of a track: 1.0 or 0.0 each. An update then takes, in place of a
plot, places for plots, each whether there is one (1.0), and its numbers: that of the target first, at missed scans too;
`radarsim.kernels.lane_loops.accumulate` goes over them. Lost tracks stay lost, their errors do not count; the table
`tracks` says how many are kept."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from radarsim.config.study_keys import possible_kinds
from radarsim.kernels.formula_functions import wrap_angle
from radarsim.studies.onefile import OneFile
from radarsim.user_code.errors import study_context

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from radarsim.config.experiment import Case, Experiment
    from radarsim.engine.results import CaseResult
    from radarsim.report.drawing.model import Figure
    from radarsim.studies.plot_arrays import DrawPlots
    from radarsim.studies.recording_interface import Likelihood
    from radarsim.studies.step_plan import Plan
    from radarsim.studies.step_tracker import Tracker


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
    sigma_field: str | None = None
    noise_field: str | None = None
    merge: Callable[[Any, Any, Any, Any], Any] | None = None


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

    is_on_target: Callable[..., Any]
    expected_false_plots: Callable[..., Any]
    false_plot: Callable[..., Any]

    def known_quantities(self, spec: Any, t_s: "np.ndarray") -> "Sequence[np.ndarray]":
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

    def exact_sigma(self, spec: Any) -> "np.ndarray | None":
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

    def prepare(self, case: "Case") -> "Plan":
        from radarsim.studies.step_plan import prepare_plan

        with study_context(self.name):
            return prepare_plan(self, case)

    def simulate(self, plan: "Plan", first: int, count: int) -> "np.ndarray":
        from radarsim.studies.step_blocks import simulate_sums

        return simulate_sums(self, plan, first, count)

    def errors(self, plan: "Plan", first: int, count: int) -> "np.ndarray":
        from radarsim.studies.step_blocks import simulate_errors

        return simulate_errors(self, plan, first, count)

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

    def drawing(self, case: "Case") -> "DrawPlots":
        from radarsim.studies.step_plots import prepare_drawing

        return prepare_drawing(self, self.prepare(case))

    def fitted(self, filter_keys: Any) -> Sequence[str]:
        """The keys that `radarsim fit` looks for with a filter: dotted ones of parts, bare ones of the filter. Default:
        none."""
        return ()

    def likelihood(
        self, case: "Case", filter_name: str | None, tracks: "Sequence[Mapping[str, np.ndarray]]"
    ) -> "Likelihood | None":
        from radarsim.studies.recording_interface import likeliest
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
        most = max(len(self.columns(case.spec, keys)) for keys in usable)
        likelihoods = [StepLikelihood(self, case.spec, keys, tracks) for keys in usable]
        likelihoods = [likelihood for likelihood in likelihoods if len(likelihood.columns) == most]
        return likelihoods[0] if len(likelihoods) == 1 else likeliest(likelihoods)

    def tracker(self, case: "Case") -> "Tracker":
        from radarsim.studies.step_tracker import Tracker

        with study_context(self.name):
            return Tracker(self, case.spec)
