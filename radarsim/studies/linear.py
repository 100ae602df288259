"""A study of linear filters from its matrices: a base for studies in one file (`radarsim.studies.onefile`).

Besides the items listed there, a class gives `motion` and `plot`: how the truth moves, and how a filter's plots depend
on it. A filter with a wrong model states its matrices by `assumed_motion` and `assumed_plot`, and a filter with other
than Kalman gains gives them by `own_gains`. `detection` is the key of the probability of a plot, `fitted` are the keys,
real numbers, that `radarsim fit` estimates.

Derived are the Kalman gains, exact σ and bias of every filter, also one with a wrong model, the limit of its σ, the
compiled kernel, plots of one realisation, filters over recorded plots, and their likelihood. A plot's numbers have
independent errors. Where plots may be missed, the gains of a Kalman filter depend on which were: its exact values and
limits are then unknown; those of a filter with `own_gains` are known."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from operator import attrgetter
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, Union, get_args, get_origin

import numpy as np

from radarsim.engine.results import Axes
from radarsim.engine.sums import Layout
from radarsim.errors import ConfigError
from radarsim.physics.motion import is_covariance
from radarsim.report.quantities import FLOORS, Quantity
from radarsim.studies.floors import bound as floors_bound
from radarsim.studies.floors import moving
from radarsim.studies.floors.bound import Floor
from radarsim.studies.linear_design import Matrices, kalman, period, steady
from radarsim.studies.linear_exact import exact, limit
from radarsim.studies.linear_problem import problem_of
from radarsim.studies.onefile import OneFile
from radarsim.studies.plot_arrays import DrawPlots, SimulatedPlots
from radarsim.studies.recording_interface import Tracker

if TYPE_CHECKING:
    from radarsim.config.experiment import Case
    from radarsim.kernels import linear_states
    from radarsim.studies.linear_recordings import PlotLikelihood


BLOCK = 4096


class Motion(NamedTuple):
    """Motion of a state of n components: F(dt) and Q(dt), each (n, n), and its mean (n,) and covariance (n, n) at the
    first plot."""

    F: Callable[[float], Any]
    Q: Callable[[float], Any]
    mean: Any
    covariance: Any


@dataclass(frozen=True)
class Plan:
    """Data of a block; see `kernels.linear_formulas.Problem`."""

    layout: Layout
    axes: Axes
    simulator: "linear_states.Simulator"
    gaussian: bool
    block: int = BLOCK


class LinearStudy(OneFile):
    """A study of linear filters; the module's docstring lists what a subclass gives.

    motion(spec): how the truth moves; its first components are those of the study. plot(spec, filter_keys, k): what a
    filter with these keys sees at scan k, from 0: the rows H (D, n), and the standard deviations (D,) of its numbers; a
    single number may be given as (n,) and a float."""

    motion: Callable[[Any], Motion]
    plot: Callable[[Any, Any, int], tuple[Any, Any]]
    detection: str = ""
    fitted: tuple[str, ...] = ()

    @classmethod
    def missing(cls) -> Iterator[str]:
        yield from super().missing()
        for needed, description in (("motion", "how the truth moves"), ("plot", "what a filter sees at scan k")):
            if not callable(getattr(cls, needed, None)):
                yield f"{cls.__name__}.{needed} must be given: {description}"
        if isinstance(cls.fitted, str):
            yield f"fitted: must be a tuple of keys, ({cls.fitted!r},); got {cls.fitted!r}"
            return
        for name, keys in (("detection", (cls.detection,)), ("fitted", cls.fitted)):
            if isinstance(getattr(cls, "parts", None), Mapping):
                yield from (f"{name}: there is no key {key}" for key in keys if key and not cls.has_key(str(key)))
        if cls.detection and cls.has_key(str(cls.detection)) and not cls._of_a_part(str(cls.detection)):
            yield f"detection: {cls.detection} must be a key of a part, PART.KEY"
        for key in map(str, cls.fitted):
            if cls.has_key(key) and (error := cls._fitted_error(key)):
                yield f"fitted: {key} must be {error}"

    @classmethod
    def _fitted_error(cls, key: str) -> str:
        """What a key must be so that `radarsim fit` can estimate it; nothing where it is."""
        part, *names = key.split(".")
        annotation: Any = cls.parts.get(part)
        for name in names:
            fields = [getattr(model, "model_fields", {}) for model in (annotation, *get_args(annotation))]
            annotation = next((members[name].annotation for members in fields if name in members), None)
        if not names or annotation is None:
            return "a key of a part that YAML gives, PART.KEY"
        return "" if _is_real(annotation) else "a key that is a real number"

    def assumed_motion(self, spec: Any, filter_keys: Any) -> Motion:
        """The motion that a filter assumes. Default: the true one."""
        return self.motion(spec)

    def assumed_plot(self, spec: Any, filter_keys: Any, k: int) -> tuple[Any, Any]:
        """A filter's model of its plots. Default: the truth."""
        return self.plot(spec, filter_keys, k)

    def own_gains(self, spec: Any, filter_keys: Any) -> Any:
        """The gains (K, D, n) of a filter that has its own, such as `steady_gains`; None: a Kalman filter. A plot's
        numbers are processed one after the other, each with its gains."""
        return None

    def steady_gains(self, spec: Any, filter_keys: Any) -> np.ndarray:
        """The limit of the Kalman gains (K, D, n) of this filter's model, used from the first scan on."""
        model = self._believed(spec, filter_keys)
        phases = np.arange(spec.scans) % period(model.H, model.R)
        return np.asarray(steady(model)[0][phases])

    def probability(self, spec: Any) -> float:
        """The probability of a plot."""
        probability = self.call(attrgetter(self.detection), spec) if self.detection else 1.0
        if not isinstance(probability, int | float) or not 0 <= probability <= 1:
            raise self._fault("detection", f"{self.detection} must be a probability, from 0 to 1, got {probability!r}")
        return float(probability)

    def quantities(self, spec: Any = None) -> tuple[Quantity, ...]:
        return (*super().quantities(spec), *FLOORS)

    def _fault(self, part: str, message: str) -> ConfigError:
        """An error with the line of the method that a part names: `motion`, or `motion: F(dt)`."""
        name = part.partition(":")[0]
        code = getattr(getattr(self, name, None), "__code__", None)
        place = self.place
        if code is not None and code.co_filename != __file__:
            place = f"{code.co_filename}:{code.co_firstlineno}"
        return ConfigError(f"{place}: study {self.name}: {part}: {message}"[:400])

    def _array(self, part: str, values: Any, *shape: int) -> np.ndarray:
        """A matrix of the study, checked to have this shape; raises ConfigError."""
        try:
            array = np.asarray(values, dtype=float)
        except (TypeError, ValueError):
            raise self._fault(part, f"must be numbers, got {values!r}"[:150]) from None
        if array.shape != shape or not np.isfinite(array).all():
            size = " × ".join(map(str, shape)) or "a number"
            description = (
                "numbers that are not finite" if array.shape == shape else " × ".join(map(str, array.shape)) or "one"
            )
            raise self._fault(part, f"must be {size}, got {description}")
        return array

    def _covariance(self, part: str, values: Any, n: int) -> np.ndarray:
        """A covariance (n, n) of the study, checked; raises ConfigError."""
        covariance = self._array(part, values, n, n)
        if not is_covariance(covariance):
            raise self._fault(part, f"must be symmetric and not negative, got {covariance.tolist()}")
        return covariance

    def _moved(self, part: str, motion: Motion, dt: float) -> tuple[np.ndarray, ...]:
        """F, Q, mean and covariance of a motion over a time."""
        if not isinstance(motion, Motion):
            raise self._fault(part, f"must give Motion(F, Q, mean, covariance), got {motion!r}"[:150])
        n = np.size(motion.mean)
        if n < len(self.components):
            raise self._fault(part, f"mean: must be of the {len(self.components)} components, got {n}")
        for name, function in (("F", motion.F), ("Q", motion.Q)):
            if not callable(function):
                raise self._fault(part, f"{name}: must be a function of dt, got {function!r}"[:150])
        F = self._array(f"{part}: F(dt)", self.call(motion.F, dt), n, n)
        Q = self._covariance(f"{part}: Q(dt)", self.call(motion.Q, dt), n)
        for name, function, first in (("F", motion.F, F), ("Q", motion.Q, Q)):
            if not np.array_equal(np.asarray(self.call(function, dt)), first):
                raise self._fault(part, f"{name}(dt): gives another formula each time: draw by normals")
        P = self._covariance(f"{part}: covariance", motion.covariance, n)
        return F, Q, self._array(f"{part}: mean", motion.mean, n), P

    def _truth(self, spec: Any) -> tuple[tuple[np.ndarray, ...], float]:
        """The motion of the truth (`_moved`), and the probability of a plot."""
        return self._moved("motion", self.call(self.motion, spec), self.scan_period_s(spec)), self.probability(spec)

    def _rows(self, part: str, plot_at: Callable[[int], tuple[Any, Any]], scans: int, n: int) -> tuple[np.ndarray, ...]:
        """Rows H (K, D, n) and standard deviations (K, D) from those of each scan."""
        plots = [plot_at(k) for k in range(scans)]
        for plot in plots:
            if not isinstance(plot, tuple | list) or len(plot) != 2:
                raise self._fault(part, f"must give rows and standard deviations, H, sigma, got {plot!r}"[:150])
        D = len(self.measured) or len(np.atleast_2d(plots[0][0]))
        H = np.stack([self._array(f"{part}: H", np.atleast_2d(row), D, n) for row, _ in plots])
        sigma = np.stack([self._array(f"{part}: sigma", np.atleast_1d(row_sigma), D) for _, row_sigma in plots])
        if not (sigma > 0).all():
            raise self._fault(part, f"sigma: must be positive, got {sigma.min():g}")
        repeated = plot_at(0)
        if not (
            np.array_equal(np.atleast_2d(repeated[0]), H[0]) and np.array_equal(np.atleast_1d(repeated[1]), sigma[0])
        ):
            raise self._fault(part, "gives another formula each time: the noise of a plot is added to it")
        return H, sigma

    def _believed(self, spec: Any, filter_keys: Any) -> Matrices:
        """A Kalman filter with the model that a filter assumes."""
        F, Q, x, P = self._moved(
            "assumed_motion", self.call(self.assumed_motion, spec, filter_keys), self.scan_period_s(spec)
        )
        see, sigma = self._rows("plot", lambda k: self.call(self.plot, spec, filter_keys, k), spec.scans, x.size)
        H, R = self._rows(
            "assumed_plot", lambda k: self.call(self.assumed_plot, spec, filter_keys, k), spec.scans, x.size
        )
        if x.size != (n := self._truth(spec)[0][2].size):
            raise self._fault(
                "assumed_motion", f"{filter_keys.name}: mean: must be of the {n} states of `motion`, got {x.size}"
            )
        if R.shape != sigma.shape:
            message = f"{filter_keys.name}: must be of as many numbers as `plot`, {sigma.shape[1]}, got {R.shape[1]}"
            raise self._fault("assumed_plot", message)
        return Matrices(F, Q, x, P, H, R**2, see, sigma, kalman(F, Q, P, H, R**2), False)

    def matrices(self, spec: Any, filter_keys: Any) -> Matrices:
        """The matrices of a filter of a config."""
        model, own_gains = self._believed(spec, filter_keys), self.call(self.own_gains, spec, filter_keys)
        if own_gains is None:
            return model
        gains = self._array("own_gains", own_gains, *model.H.shape)
        return Matrices(model.F, model.Q, model.x, model.P, model.H, model.R, model.see, model.sigma, gains, True)

    def prepare(self, case: "Case") -> Plan:
        from radarsim.kernels import linear_states as kernels_linear_states

        spec = case.spec
        truth, probability = self._truth(spec)
        filters = [self.matrices(spec, filter_keys) for filter_keys in spec.filters]
        numbers = sorted({model.sigma.shape[1] for model in filters})
        if len(numbers) > 1:
            raise self._fault("plot", f"must give all filters as many numbers, got {numbers[0]} and {numbers[-1]}")
        components = len(self.components)
        exact_values = [
            exact(truth, model, probability) if model.has_own_gains or probability == 1 else None for model in filters
        ]
        shape = len(filters), spec.scans, components
        sigma, bias = np.full(shape, np.nan), np.full(shape, np.nan)
        for f, values in enumerate(exact_values):
            if values is not None:
                sigma[f], bias[f] = values[0][:, :components], values[1][:, :components]
        axes = self.axes(spec, sigma, bias)
        problem = problem_of(case, truth, filters, probability, axes.baseline)
        return Plan(self.sums(spec), axes, kernels_linear_states.Simulator(problem, components), probability == 1)

    def simulate(self, plan: Plan, first: int, count: int) -> np.ndarray:
        sums = {name: np.zeros(shape) for name, shape in plan.layout.shapes.items()}
        plan.simulator.simulate_block(int(first), int(count), sums["error"], sums["paired"])
        return plan.layout.pack(**sums)

    def errors(self, plan: Plan, first: int, count: int) -> np.ndarray:
        return plan.simulator.errors(int(first), int(count))

    def limits(self, spec: Any) -> np.ndarray:
        truth, probability = self._truth(spec)
        filters = [self.matrices(spec, filter_keys) for filter_keys in spec.filters]
        limits = [
            limit(truth, model, probability) if model.has_own_gains or probability == 1 else model.x * np.nan
            for model in filters
        ]
        return np.stack(limits)[:, : len(self.components)]

    def floor(self, spec: Any, axes: Axes) -> Floor:
        """The posterior Cramér–Rao bound, of each filter with its own plots."""
        (F, Q, _, P), probability = self._truth(spec)
        F, Q = (np.broadcast_to(matrix, (spec.scans, *matrix.shape)) for matrix in (F, Q))
        bound = partial(moving.driven_bound, P, F, Q, detection=probability, component_count=len(self.components))
        plots = [
            self._rows("plot", partial(self.call, self.plot, spec, filter_keys), spec.scans, len(P))
            for filter_keys in spec.filters
        ]
        names = [H.tobytes() + sigma.tobytes() for H, sigma in plots]
        bounds = {name: bound(H=H, R=sigma**2) for name, (H, sigma) in dict(zip(names, plots, strict=True)).items()}
        filter_bounds = tuple(bounds[name] for name in names)
        return Floor(floors_bound.POSTERIOR, filter_bounds, filter_bounds[0] if len(bounds) == 1 else None)

    def drawing(self, case: "Case") -> DrawPlots:
        plan = self.prepare(case)
        places = {
            name: (group, d)
            for filter_keys, group in zip(case.spec.filters, plan.simulator.problem.sees, strict=True)
            for d, name in enumerate(self.columns(case.spec, filter_keys))
        }

        def draw(first: int, count: int) -> SimulatedPlots:
            truth, plots = plan.simulator.simulate_plots(first, count)
            columns = {name: plots[:, :, group, d] for name, (group, d) in places.items()}
            names = plan.axes.components
            return SimulatedPlots(plan.axes.t_s, columns, names, truth[..., : len(names)], first=first)

        return draw

    def tracker(self, case: "Case") -> Tracker:
        from radarsim.studies.linear_recordings import LinearTracker

        return LinearTracker(self, case.spec)

    def likelihood(
        self, case: "Case", filter_name: str | None, tracks: Sequence[Mapping[str, np.ndarray]]
    ) -> "PlotLikelihood | None":
        if not self.fitted:
            return None
        from radarsim.studies.linear_recordings import PlotLikelihood

        # Gains of a filter's own do not say how likely plots are; where all have such, their motion and plots do.
        filters = case.spec.filters
        kalman_filters = [keys for keys in filters if self.call(self.own_gains, case.spec, keys) is None] or filters
        candidates = [
            PlotLikelihood(self, case.spec, keys, tracks) for keys in kalman_filters if filter_name in (None, keys.name)
        ]
        if len(candidates) < 2:
            return candidates[0] if candidates else None
        return max(candidates, key=lambda candidate: (len(candidate.model.columns), candidate(candidate.stated)))


def _is_real(annotation: Any) -> bool:
    """Whether a key is a real number, or may be left out."""
    if get_origin(annotation) in (Union, UnionType):
        return all(member is NoneType or _is_real(member) for member in get_args(annotation))
    return (get_args(annotation)[0] if get_origin(annotation) is Annotated else annotation) is float
