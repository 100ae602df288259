"""A study of linear filters from its matrices: a base for studies in one file (`radarsim.studies.onefile`).

Besides the items listed there a class gives `motion` and `plot`: how the truth moves, and how a filter's plots depend
on it. A filter with a wrong model states its matrices by `assumed_motion` and `assumed_plot`, and a filter that has
gains of its own by `own_gains`. `detection` is the key of the probability of a plot, `fitted` are the keys, real
numbers, that `radarsim fit` estimates.

Derived are the Kalman gains, exact σ and bias of every filter, also one with a wrong model, the limit of its σ, the
compiled kernel, plots of one realisation, filters over recorded plots, and their likelihood. A plot's numbers have
independent errors. Where plots may be missed, the gains of a Kalman filter depend on which were: its exact values and
limits are then unknown; those of a filter with gains of its own are known."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial, reduce
from operator import attrgetter
from types import NoneType, UnionType
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, Union, get_args, get_origin

import numpy as np

from radarsim.engine.results import Axes, Layout, Track
from radarsim.errors import ConfigError
from radarsim.physics import is_covariance
from radarsim.report.quantities import FLOORS, Quantity
from radarsim.studies import floor
from radarsim.studies.floor import Floor
from radarsim.studies.interface import CORRELATION, OUTLIERS, Draw, Drawn, Tracker, usual_interval_s
from radarsim.studies.onefile import OneFile

if TYPE_CHECKING:
    from radarsim.config.experiment import Case
    from radarsim.kernels import states

BLOCK = 4096
SETTLED_CHANGE = 1e-14  # relative change of a limit's components that counts as settled
MAX_DOUBLINGS = 60
MAX_PERIOD = 64  # longest period of plots, in scans, that is looked for
ZERO_SHARE = 1e-6  # of a fitted key's stated value: what counts as zero


class Motion(NamedTuple):
    """Motion of a state of n components: F(dt) and Q(dt), each (n, n), and its mean (n,) and covariance (n, n) at the
    first plot."""

    F: Callable[[float], Any]
    Q: Callable[[float], Any]
    mean: Any
    covariance: Any


@dataclass(frozen=True)
class Matrices:
    """A filter of n states and D numbers over K scans, as the kernels take it.

    F, Q, P (n, n), x (n,), H (K, D, n), R (K, D): its model, R variances; see (K, D, n), sigma (K, D): of its plots;
    gains (K, D, n): its own, or the Kalman gains. has_own_gains: whether it has its own."""

    F: np.ndarray
    Q: np.ndarray
    x: np.ndarray
    P: np.ndarray
    H: np.ndarray
    R: np.ndarray
    see: np.ndarray
    sigma: np.ndarray
    gains: np.ndarray
    has_own_gains: bool


@dataclass(frozen=True)
class Plan:
    """Data of a block; see `kernels.states.Problem`."""

    layout: Layout
    axes: Axes
    simulator: "states.Simulator"
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

    # ---- the model ---------------------------------------------------------------------------------------------------
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

    # ---- from matrices to arrays ---------------------------------------------------------------------------------
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

    # ---- numbers -------------------------------------------------------------------------------------------------
    def prepare(self, case: "Case") -> Plan:
        from radarsim.kernels import states

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
        return Plan(self.sums(spec), axes, states.Simulator(problem, components), probability == 1)

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
        """The posterior Cramér-Rao bound, of each filter with its own plots."""
        (F, Q, _, P), probability = self._truth(spec)
        F, Q = (np.broadcast_to(matrix, (spec.scans, *matrix.shape)) for matrix in (F, Q))
        bound = partial(floor.driven, P, F, Q, chance=probability, shown=len(self.components))
        plots = [
            self._rows("plot", partial(self.call, self.plot, spec, filter_keys), spec.scans, len(P))
            for filter_keys in spec.filters
        ]
        names = [H.tobytes() + sigma.tobytes() for H, sigma in plots]
        bounds = {name: bound(H=H, R=sigma**2) for name, (H, sigma) in dict(zip(names, plots, strict=True)).items()}
        filter_bounds = tuple(bounds[name] for name in names)
        return Floor(floor.POSTERIOR, filter_bounds, filter_bounds[0] if len(bounds) == 1 else None)

    # ---- recorded plots ------------------------------------------------------------------------------------------
    def drawing(self, case: "Case") -> Draw:
        plan = self.prepare(case)
        places = {
            name: (group, d)
            for filter_keys, group in zip(case.spec.filters, plan.simulator.problem.sees, strict=True)
            for d, name in enumerate(self.columns(case.spec, filter_keys))
        }

        def draw(first: int, count: int) -> Drawn:
            truth, plots = plan.simulator.simulate_plots(first, count)
            columns = {name: plots[:, :, group, d] for name, (group, d) in places.items()}
            names = plan.axes.components
            return Drawn(plan.axes.t_s, columns, names, truth[..., : len(names)], first=first)

        return draw

    def tracker(self, case: "Case") -> Tracker:
        return LinearTracker(self, case.spec)

    def likelihood(
        self, case: "Case", filter_name: str | None, tracks: Sequence[Mapping[str, np.ndarray]]
    ) -> "PlotLikelihood | None":
        if not self.fitted:
            return None
        # Gains of a filter's own do not say how likely plots are; where all have such, their motion and plots do.
        filters = case.spec.filters
        kalman_filters = [keys for keys in filters if self.call(self.own_gains, case.spec, keys) is None] or filters
        candidates = [
            PlotLikelihood(self, case.spec, keys, tracks) for keys in kalman_filters if filter_name in (None, keys.name)
        ]
        if len(candidates) < 2:
            return candidates[0] if candidates else None
        return max(candidates, key=lambda candidate: (len(candidate.model.columns), candidate(candidate.stated)))


# ---- design ----------------------------------------------------------------------------------------------------------
def kalman(F: np.ndarray, Q: np.ndarray, P: np.ndarray, H: np.ndarray, R: np.ndarray) -> np.ndarray:
    """The gains (K, D, n) of a Kalman filter (Bar-Shalom et al. 2001, section 5.2), with P at the first scan."""
    gains = np.empty_like(H)
    for k in range(len(H)):
        P = F @ P @ F.T + Q if k else P
        gains[k], P = updated(P, H[k], R[k])
    return gains


def updated(P: np.ndarray, H: np.ndarray, R: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The gains (D, n) of numbers processed one after the other, and P after them, by Joseph's form."""
    gains = np.empty_like(H)
    for d, (h, r) in enumerate(zip(H, R, strict=True)):
        gains[d] = P @ h / (h @ P @ h + r)
        A = np.eye(h.size) - np.outer(gains[d], h)
        P = A @ P @ A.T + r * np.outer(gains[d], gains[d])
    return gains, P


def period(*arrays: np.ndarray) -> int:
    """The period, in scans, of arrays (K, …); K where they have none."""
    scans = len(arrays[0])
    for p in range(1, min(MAX_PERIOD, scans // 2) + 1):
        if all(np.array_equal(array[p:], array[:-p]) for array in arrays):
            return p
    return scans


@np.errstate(all="ignore")  # growth without end has no limit
def steady(model: Matrices) -> tuple[np.ndarray, np.ndarray]:
    """The limit over a period of p scans of a Kalman filter's gains (p, D, n), and its P before the first of them. P
    goes from scan to scan as A (P⁻¹ + J)⁻¹ A' + C with A = F, C = Q, J = H'R⁻¹H. Two such steps are one of the same
    form, so 2^m periods take m of them (structured doubling: Chu, Fan & Lin 2005)."""
    eye, phases = np.eye(model.x.size), range(period(model.H, model.R))
    try:
        A, C, J = reduce(_after, ((model.F, model.Q, (model.H[k].T / model.R[k]) @ model.H[k]) for k in phases))
        P = C
        for _ in range(MAX_DOUBLINGS):
            A, C, J = _after((A, C, J), (A, C, J))
            previous, P = P, A @ np.linalg.solve(eye + model.P @ J, model.P) @ A.T + C
            sigma = np.sqrt(np.diag(P))
            if not np.isfinite(P).all() or (np.abs(P - previous) <= SETTLED_CHANGE * np.outer(sigma, sigma)).all():
                break
    except np.linalg.LinAlgError:
        P = np.full_like(model.P, np.nan)
    gains = []
    for k in phases:
        scan_gains, P_after = updated(P, model.H[k], model.R[k])
        gains.append(scan_gains)
        P = model.F @ P_after @ model.F.T + model.Q
    return np.stack(gains), P


Step = tuple[np.ndarray, np.ndarray, np.ndarray]


def _after(before: Step, after: Step) -> Step:
    """Two steps of `steady` as one."""
    (A, C, J), (B, E, M) = before, after
    eye = np.eye(len(A))
    between = np.linalg.solve(eye + C @ M, np.hstack([A, C]))
    moved_state, spread = between[:, : len(A)], between[:, len(A) :]
    parts = B @ spread @ B.T + E, A.T @ M @ moved_state + J
    return B @ moved_state, *((part + part.T) / 2 for part in parts)


# ---- exact values ----------------------------------------------------------------------------------------------------
@np.errstate(all="ignore")  # of a filter that diverges
def exact(truth: tuple[np.ndarray, ...], model: Matrices, probability: float) -> tuple[np.ndarray, np.ndarray]:
    """σ and bias (K, n) of a filter's errors e, from the mean and covariance of (e, truth), whatever its model. A
    missed plot makes a mixture of two; then σ is exact still, though the error is not Gaussian."""
    F, Q, mean, P = truth
    n = mean.size
    eye, none = np.eye(n), np.zeros((n, n))
    m, S = np.concatenate([model.x - mean, mean]), np.block([[P, -P], [-P, P]])
    M, B = np.block([[model.F, model.F - F], [none, F]]), np.vstack([-eye, eye])
    noise, sigma, bias = B @ Q @ B.T, np.empty((len(model.H), n)), np.empty((len(model.H), n))
    for k in range(len(model.H)):
        if k:
            m, S = M @ m, M @ S @ M.T + noise
        m0, S0 = m, S
        for h, g, see, s in zip(model.H[k], model.gains[k], model.see[k], model.sigma[k], strict=True):
            A = np.block([[eye - np.outer(g, h), np.outer(g, see - h)], [none, eye]])
            G = s * np.concatenate([g, np.zeros(n)])
            m, S = A @ m, A @ S @ A.T + np.outer(G, G)
        if probability < 1:
            d, q = m - m0, probability
            m, S = q * m + (1 - q) * m0, q * S + (1 - q) * S0 + q * (1 - q) * np.outer(d, d)
        bias[k] = m[:n]
        sigma[k] = np.sqrt(np.diag(S)[:n] + m[:n] ** 2)
    return sigma, bias


@np.errstate(all="ignore")
def limit(truth: tuple[np.ndarray, ...], model: Matrices, probability: float) -> np.ndarray:
    """The limit of σ (n,) of a filter's errors, at scans of the phase of its last one; NaN where there is none, or
    where it depends on the truth: by a wrong F or H.

    Of a filter's own gains the last ones are kept. The covariance of the errors goes over a period as S → T S + W, with
    S as a vector, and stays at (1 - T)⁻¹ W."""
    F, Q, mean, _ = truth
    n = mean.size
    p = period(model.H, model.R, model.see, model.sigma)
    if not (np.array_equal(model.F, F) and np.array_equal(model.H, model.see)) or 2 * p > len(model.H):
        return np.full(n, np.nan)
    scans = np.arange(len(model.H) - p, len(model.H))  # a period that ends with the last one
    gains = model.gains[scans] if model.has_own_gains else steady(model)[0][scans % p]
    T, W = np.eye(n * n), np.zeros(n * n)
    for g, k in zip(gains, scans, strict=True):
        moved, added = np.kron(F, F), Q.ravel()
        retained, noise = np.eye(n), np.zeros((n, n))
        for h, gain, s in zip(model.H[k], g, model.sigma[k], strict=True):
            A = np.eye(n) - np.outer(gain, h)
            retained, noise = A @ retained, A @ noise @ A.T + s**2 * np.outer(gain, gain)
        take = probability * np.kron(retained, retained) + (1 - probability) * np.eye(n * n)
        T, W = take @ moved @ T, take @ (moved @ W + added) + probability * noise.ravel()
    if not np.isfinite(T).all() or np.abs(np.linalg.eigvals(T)).max() >= 1:
        return np.full(n, np.nan)
    return np.sqrt(np.linalg.solve(np.eye(n * n) - T, W).reshape(n, n).diagonal())


# ---- for the kernel --------------------------------------------------------------------------------------------------
def root(S: np.ndarray) -> np.ndarray:
    """L (n, n) with L L' = S ≥ 0, lower; columns not needed for S are zero (Cholesky)."""
    L, remainder = np.zeros_like(S), S.copy()
    for j in range(len(S)):
        if remainder[j, j] > 1e-12 * S[j, j]:
            L[j:, j] = remainder[j:, j] / np.sqrt(remainder[j, j])
            remainder -= np.outer(L[:, j], L[:, j])
    return L


def problem_of(
    case: "Case", truth: tuple[np.ndarray, ...], filters: Sequence[Matrices], probability: float, baseline: int
) -> "states.Problem":
    """The problem that the kernel simulates."""
    from radarsim.kernels import states
    from radarsim.studies.noise import noise_key

    F, Q, mean, P = truth
    noises = root(Q), root(P)
    used = [[j for j in range(len(mean)) if noise[:, j].any()] for noise in noises]
    push, spread = (np.zeros((len(mean), max(map(len, used)))) for _ in noises)
    for noise, reduced, columns in zip(noises, (push, spread), used, strict=True):
        reduced[:, : len(columns)] = noise[:, columns]
    groups: dict[bytes, int] = {}
    sees = [groups.setdefault(model.see.tobytes() + model.sigma.tobytes(), len(groups)) for model in filters]
    first_filters = [filters[sees.index(group)] for group in range(len(groups))]
    arrays = {
        name: np.stack([getattr(model, name) for model in filters]) for name in ("F", "x", "H", "gains", "P", "Q", "R")
    }
    return states.Problem(
        key=noise_key(case, "plots"),
        detections=noise_key(case, "detections"),
        move=np.ascontiguousarray(F),
        push=push,
        start=mean,
        spread=spread,
        see=np.stack([model.see for model in first_filters]),
        sigma=np.stack([model.sigma for model in first_filters]),
        sees=np.array(sees),
        adapts=np.array([int(probability < 1 and not model.has_own_gains) for model in filters]),
        probability=probability,
        baseline=baseline,
        **arrays,
    )


# ---- recorded plots --------------------------------------------------------------------------------------------------
class RowModel:
    """A filter's model over rows of recorded plots, whatever the times between them."""

    def __init__(self, study: "LinearStudy", spec: Any, filter_keys: Any):
        self.study, self.spec, self.filter_keys = study, spec, filter_keys
        self.columns = study.columns(spec, filter_keys)
        self.matrices = study.matrices(spec, filter_keys)
        self.period = period(self.matrices.H, self.matrices.R)

    def numbers(self, columns: Mapping[str, np.ndarray], n: int) -> np.ndarray:
        """The numbers z (n, D), NaN where a column is absent."""
        none = np.full(n, np.nan)
        return np.stack([columns.get(name, none) for name in self.columns], axis=1)

    def moves(self, dt: np.ndarray, spec: Any = None) -> tuple[np.ndarray, np.ndarray]:
        """F and Q (n, n, n) over times; over a time of zero the state stays."""
        motion, n = self.study.assumed_motion(spec or self.spec, self.filter_keys), self.matrices.x.size
        times, places = np.unique(dt, return_inverse=True)
        F, Q = np.tile(np.eye(n), (times.size, 1, 1)), np.zeros((times.size, n, n))
        for name, function, matrices in (("F", motion.F, F), ("Q", motion.Q, Q)):
            values = [self.study.call(function, t) for t in times[times != 0].tolist()]
            matrices[times != 0] = self.study._array(
                f"assumed_motion: {name}(dt)", values or matrices[:0], len(values), n, n
            )
        for i in np.flatnonzero(np.linalg.eigvalsh(Q)[:, 0] < 0):
            self.study._covariance(f"assumed_motion: Q({times[i]:g} s)", Q[i], n)
        return F[places], Q[places]

    def rows(self, first: int, n: int, spec: Any = None) -> tuple[np.ndarray, np.ndarray]:
        """H (n, D, d) and R (n, D) of rows from number `first` on."""
        if spec is None and self.period < len(self.matrices.H):
            phases = (first + np.arange(n)) % self.period
            return self.matrices.H[phases], self.matrices.R[phases]
        plots = [self.study.assumed_plot(spec or self.spec, self.filter_keys, first + k) for k in range(n)]
        H = np.stack([np.atleast_2d(row) for row, _ in plots]).astype(float)
        return H, np.stack([np.atleast_1d(sigma) for _, sigma in plots]).astype(float) ** 2

    def gains(self, first: int, n: int) -> np.ndarray:
        """A filter's own gains at rows; after its last scan those of the last period repeat."""
        k, scans = first + np.arange(n), len(self.matrices.gains)
        last = scans - min(self.period, scans)
        return self.matrices.gains[np.where(k < scans, k, last + (k - last) % (scans - last))]


class LinearTracker:
    """The filters of a case over recorded plots, chunk by chunk in constant memory.

    The first row is the first scan: there the state is as in the config. A filter none of whose columns are in the file
    has no estimates."""

    most_rows: int | None = None
    several = False

    def __init__(self, study: "LinearStudy", spec: Any):
        self.study, self.names = study, tuple(keys.name for keys in spec.filters)
        self.filters = [RowModel(study, spec, keys) for keys in spec.filters]
        self.states = [(rows.matrices.x.copy(), rows.matrices.P.copy()) for rows in self.filters]
        self.count, self.last = 0, np.nan

    def feed(self, columns: Mapping[str, np.ndarray]) -> Track:
        """The estimates over the next rows: columns (n,), NaN where a value is missing."""
        t = columns["t_s"]
        dt = np.diff(t, prepend=self.last if self.count else t[0])
        results = [
            self._follow(rows, *state, dt, columns) for rows, state in zip(self.filters, self.states, strict=True)
        ]
        self.count, self.last = self.count + len(t), t[-1]
        out, residual = (np.stack([each[i] for each in results]) for i in range(2))
        states, components = self.filters[0].matrices.x.size, len(self.study.components)
        measured = self.study.measured
        return Track(
            filters=self.names,
            components=tuple((component.name, component.unit) for component in self.study.components),
            t_s=t,
            estimate=out[..., :components],
            sigma=out[..., states : states + components],
            measured=tuple((number.column, number.unit) for number in measured),
            residual=residual,
            tested=tuple((number.column, 1) for number in measured),
            nis=out[..., 2 * states :],
        )

    def _follow(
        self, model: RowModel, x: np.ndarray, P: np.ndarray, dt: np.ndarray, columns: Mapping[str, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """The result of `states.follow` for a filter, and its residuals (n, D)."""
        from radarsim.kernels import states

        rows, z = len(dt), model.numbers(columns, len(dt))
        (F, Q), (H, R) = model.moves(dt), model.rows(self.count, rows)
        out, there = np.full((rows, 2 * x.size + z.shape[1]), np.nan), np.isfinite(z)
        gains = model.gains(self.count, rows) if model.matrices.has_own_gains else np.zeros_like(H)
        states.follow(x, P, F, Q, H, R, gains, not model.matrices.has_own_gains, np.where(there, z, 0.0), there, out)
        if not any(name in columns for name in model.columns):
            out[:] = np.nan
        return out, z - np.einsum("kdn,kn->kd", H, out[:, : x.size])


class PlotLikelihood:
    """The likelihood of tracks under a filter's model, by the keys that the study names as `fitted`. The state at the
    first plot is as in the config."""

    explains: tuple[str, ...] = (OUTLIERS, CORRELATION)

    def __init__(self, study: "LinearStudy", spec: Any, track: Any, tracks: Sequence[Mapping[str, np.ndarray]]):
        self.spec, self.filter, self.model = spec, track.name, RowModel(study, spec, track)
        self.tracks, self.rows = len(tracks), sum(len(track["t_s"]) for track in tracks)
        self.keys = study.fitted
        stated = [attrgetter(key)(spec) for key in self.keys]
        if None in stated:
            raise study._fault("fitted", f"{self.keys[stated.index(None)]} is not given")
        self.stated = np.array(stated, dtype=float)
        self.least = ZERO_SHARE * np.where(self.stated > 0, self.stated, 1.0)
        self.plots = [
            (np.diff(track["t_s"], prepend=track["t_s"][0]), self.model.numbers(track, len(track["t_s"])))
            for track in tracks
        ]
        self.usual_s = usual_interval_s(tracks)

    def _scores(self, values: np.ndarray, outliers: float, correlation: float) -> np.ndarray:
        """Sums over all tracks for each number of a plot."""
        from radarsim.kernels.hypotheses import lasting, log_likelihood

        spec = self.spec
        for key, value in zip(self.keys, values, strict=True):
            spec = _changed(spec, key.split("."), float(value))
        start = self.model.study.assumed_motion(spec, self.model.filter_keys)
        total: np.ndarray = np.zeros(len(self.model.columns))
        for dt, z in self.plots:
            (F, Q), (H, R) = self.model.moves(dt, spec), self.model.rows(0, len(dt), spec)
            x, P = np.array(start.mean, dtype=float), np.array(start.covariance, dtype=float)
            model, white, there = (x, P, F, Q, H), 1.0, np.isfinite(z)
            if correlation:
                first = np.zeros((x.size, z.shape[1]))
                model, white = lasting(x, P, first, F, Q, H, R, correlation ** (dt / self.usual_s)), 0.0
            score = np.empty(z.shape)
            log_likelihood(*model, np.where(there, z, 0.0), R, there, 1.0, outliers, white, score)
            total += score.sum(axis=0)
        return total

    def __call__(self, values: np.ndarray, outliers: float = 0.0, bias: float = 0.0, correlation: float = 0.0) -> float:
        """The logarithm of the likelihood."""
        return float(self._scores(values, outliers, correlation).sum())

    def by_number(self, values: np.ndarray) -> dict[str, float]:
        """The sums of each number of a plot."""
        return dict(zip(self.model.columns, self._scores(values, 0.0, 0.0).tolist(), strict=True))


def _is_real(annotation: Any) -> bool:
    """Whether a key is a real number, or may be left out."""
    if get_origin(annotation) in (Union, UnionType):
        return all(member is NoneType or _is_real(member) for member in get_args(annotation))
    return (get_args(annotation)[0] if get_origin(annotation) is Annotated else annotation) is float


def _changed(model: Any, path: Sequence[str], value: float) -> Any:
    """A config's keys with another value of the key at a path."""
    key, *remaining_path = path
    return model.model_copy(
        update={key: _changed(getattr(model, key), remaining_path, value) if remaining_path else value}
    )
