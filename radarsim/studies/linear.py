"""A study of linear filters from its matrices: a base for studies in one file (`radarsim.studies.onefile`).

Besides the items listed there a class gives `motion` and `plot`: how the truth moves, and how a filter's plots depend
on it. A filter with a wrong model states its matrices by `assumed_motion` and `assumed_plot`, one with gains of its own
by `own_gains`. `detection` is the key of the probability of a plot, `fitted` are the keys that `radarsim fit`
estimates, real numbers.

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
CLOSE = 1e-14  # relative change of a limit's components that counts as settled
DOUBLINGS = 60
LONGEST_PERIOD = 64  # longest period of plots, in scans, that is looked for
LEAST = 1e-6  # of a fitted key's stated value, which counts as zero


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
    gains (K, D, n): its own, or the Kalman gains. own: whether it has its own."""

    F: np.ndarray
    Q: np.ndarray
    x: np.ndarray
    P: np.ndarray
    H: np.ndarray
    R: np.ndarray
    see: np.ndarray
    sigma: np.ndarray
    gains: np.ndarray
    own: bool


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

    motion(spec): how the truth moves; its first components are those of the study. plot(spec, one, k): the plot of
    filter `one` at scan k, from 0: the rows H (D, n), and the standard deviations (D,) of its numbers; a single number
    may be given as (n,) and a float."""

    motion: Callable[[Any], Motion]
    plot: Callable[[Any, Any, int], tuple[Any, Any]]
    detection: str = ""
    fitted: tuple[str, ...] = ()

    @classmethod
    def missing(cls) -> Iterator[str]:
        yield from super().missing()
        for needed, what in (("motion", "how the truth moves"), ("plot", "what a filter sees at scan k")):
            if not callable(getattr(cls, needed, None)):
                yield f"{cls.__name__}.{needed} must be given: {what}"
        if isinstance(cls.fitted, str):
            yield f"fitted: must be a tuple of keys, ({cls.fitted!r},); got {cls.fitted!r}"
            return
        for name, keys in (("detection", (cls.detection,)), ("fitted", cls.fitted)):
            if isinstance(getattr(cls, "parts", None), Mapping):
                yield from (f"{name}: there is no key {key}" for key in keys if key and not cls.has_key(str(key)))
        if cls.detection and cls.has_key(str(cls.detection)) and not cls._of_a_part(str(cls.detection)):
            yield f"detection: {cls.detection} must be a key of a part, PART.KEY"
        for key in map(str, cls.fitted):
            if not cls.has_key(key):
                continue
            part, *own = key.split(".")
            found: Any = cls.parts.get(part)
            for one in own:
                fields = [getattr(model, "model_fields", {}) for model in (found, *get_args(found))]
                found = next((each[one].annotation for each in fields if one in each), None)
            if not own or found is None:
                yield f"fitted: {key} must be a key of a part that YAML gives, PART.KEY"
            elif not _is_real(found):
                yield f"fitted: {key} must be a key that is a real number"

    # ---- the model ---------------------------------------------------------------------------------------------------
    def assumed_motion(self, spec: Any, one: Any) -> Motion:
        """The motion that a filter assumes. Default: the true one."""
        return self.motion(spec)

    def assumed_plot(self, spec: Any, one: Any, k: int) -> tuple[Any, Any]:
        """A filter's model of its plots. Default: the truth."""
        return self.plot(spec, one, k)

    def own_gains(self, spec: Any, one: Any) -> Any:
        """The gains (K, D, n) of a filter that has its own, such as `steady_gains`; None: a Kalman filter. A plot's
        numbers are processed one after the other, each with its gains."""
        return None

    def steady_gains(self, spec: Any, one: Any) -> np.ndarray:
        """The limit of the Kalman gains (K, D, n) of this filter's model, used from the first scan on."""
        of = self._believed(spec, one)
        phases = np.arange(spec.scans) % period(of.H, of.R)
        return np.asarray(steady(of)[0][phases])

    def probability(self, spec: Any) -> float:
        """The probability of a plot."""
        given = self.call(attrgetter(self.detection), spec) if self.detection else 1.0
        if not isinstance(given, int | float) or not 0 <= given <= 1:
            raise self._fault("detection", f"{self.detection} must be a probability, from 0 to 1, got {given!r}")
        return float(given)

    def quantities(self, spec: Any = None) -> tuple[Quantity, ...]:
        return (*super().quantities(spec), *FLOORS)

    # ---- from matrices to arrays ---------------------------------------------------------------------------------
    def _fault(self, what: str, words: str) -> ConfigError:
        """An error with the line of the method whose name begins `what`."""
        name = what.partition(":")[0]
        code = getattr(getattr(self, name, None), "__code__", None)
        place = self.place
        if code is not None and code.co_filename != __file__:
            place = f"{code.co_filename}:{code.co_firstlineno}"
        return ConfigError(f"{place}: study {self.name}: {what}: {words}"[:400])

    def _array(self, what: str, given: Any, *shape: int) -> np.ndarray:
        """A matrix of the study, checked for this shape; raises ConfigError."""
        try:
            found = np.asarray(given, dtype=float)
        except (TypeError, ValueError):
            raise self._fault(what, f"must be numbers, got {given!r}"[:150]) from None
        if found.shape != shape or not np.isfinite(found).all():
            size = " × ".join(map(str, shape)) or "a number"
            got = "numbers that are not finite" if found.shape == shape else " × ".join(map(str, found.shape)) or "one"
            raise self._fault(what, f"must be {size}, got {got}")
        return found

    def _covariance(self, what: str, given: Any, n: int) -> np.ndarray:
        """A covariance (n, n) of the study, checked; raises ConfigError."""
        found = self._array(what, given, n, n)
        if not is_covariance(found):
            raise self._fault(what, f"must be symmetric and not negative, got {found.tolist()}")
        return found

    def _moved(self, what: str, of: Motion, dt: float) -> tuple[np.ndarray, ...]:
        """F, Q, mean and covariance over a time."""
        if not isinstance(of, Motion):
            raise self._fault(what, f"must give Motion(F, Q, mean, covariance), got {of!r}"[:150])
        n = np.size(of.mean)
        if n < len(self.components):
            raise self._fault(what, f"mean: must be of the {len(self.components)} components, got {n}")
        for name, one in (("F", of.F), ("Q", of.Q)):
            if not callable(one):
                raise self._fault(what, f"{name}: must be a function of dt, got {one!r}"[:150])
        F = self._array(f"{what}: F(dt)", self.call(of.F, dt), n, n)
        Q = self._covariance(f"{what}: Q(dt)", self.call(of.Q, dt), n)
        for name, one, first in (("F", of.F, F), ("Q", of.Q, Q)):
            if not np.array_equal(np.asarray(self.call(one, dt)), first):
                raise self._fault(what, f"{name}(dt): gives another formula each time: draw by normals")
        P = self._covariance(f"{what}: covariance", of.covariance, n)
        return F, Q, self._array(f"{what}: mean", of.mean, n), P

    def _truth(self, spec: Any) -> tuple[tuple[np.ndarray, ...], float]:
        """The motion of the truth (`_moved`), and the probability of a plot."""
        return self._moved("motion", self.call(self.motion, spec), self.scan_period_s(spec)), self.probability(spec)

    def _rows(self, what: str, given: Callable[[int], tuple[Any, Any]], scans: int, n: int) -> tuple[np.ndarray, ...]:
        """Rows H (K, D, n) and standard deviations (K, D) from those of each scan."""
        every = [given(k) for k in range(scans)]
        for one in every:
            if not isinstance(one, tuple | list) or len(one) != 2:
                raise self._fault(what, f"must give rows and standard deviations, H, sigma, got {one!r}"[:150])
        D = len(self.measured) or len(np.atleast_2d(every[0][0]))
        H = np.stack([self._array(f"{what}: H", np.atleast_2d(row), D, n) for row, _ in every])
        sigma = np.stack([self._array(f"{what}: sigma", np.atleast_1d(one), D) for _, one in every])
        if not (sigma > 0).all():
            raise self._fault(what, f"sigma: must be positive, got {sigma.min():g}")
        again = given(0)
        if not (np.array_equal(np.atleast_2d(again[0]), H[0]) and np.array_equal(np.atleast_1d(again[1]), sigma[0])):
            raise self._fault(what, "gives another formula each time: the noise of a plot is added to it")
        return H, sigma

    def _believed(self, spec: Any, one: Any) -> Matrices:
        """The Kalman filter of a filter's model."""
        F, Q, x, P = self._moved("assumed_motion", self.call(self.assumed_motion, spec, one), self.scan_period_s(spec))
        see, sigma = self._rows("plot", lambda k: self.call(self.plot, spec, one, k), spec.scans, x.size)
        H, R = self._rows("assumed_plot", lambda k: self.call(self.assumed_plot, spec, one, k), spec.scans, x.size)
        if x.size != (n := self._truth(spec)[0][2].size):
            raise self._fault(
                "assumed_motion", f"{one.name}: mean: must be of the {n} states of `motion`, got {x.size}"
            )
        if R.shape != sigma.shape:
            words = f"{one.name}: must be of as many numbers as `plot`, {sigma.shape[1]}, got {R.shape[1]}"
            raise self._fault("assumed_plot", words)
        return Matrices(F, Q, x, P, H, R**2, see, sigma, kalman(F, Q, P, H, R**2), False)

    def matrices(self, spec: Any, one: Any) -> Matrices:
        """A filter of a config."""
        of, own = self._believed(spec, one), self.call(self.own_gains, spec, one)
        if own is None:
            return of
        gains = self._array("own_gains", own, *of.H.shape)
        return Matrices(of.F, of.Q, of.x, of.P, of.H, of.R, of.see, of.sigma, gains, True)

    # ---- numbers -------------------------------------------------------------------------------------------------
    def prepare(self, case: "Case") -> Plan:
        from radarsim.kernels import states

        spec = case.spec
        truth, probability = self._truth(spec)
        every = [self.matrices(spec, one) for one in spec.filters]
        numbers = sorted({of.sigma.shape[1] for of in every})
        if len(numbers) > 1:
            raise self._fault("plot", f"must give all filters as many numbers, got {numbers[0]} and {numbers[-1]}")
        shown = len(self.components)
        known = [exact(truth, of, probability) if of.own or probability == 1 else None for of in every]
        shape = len(every), spec.scans, shown
        sigma, bias = np.full(shape, np.nan), np.full(shape, np.nan)
        for f, found in enumerate(known):
            if found is not None:
                sigma[f], bias[f] = found[0][:, :shown], found[1][:, :shown]
        axes = self.axes(spec, sigma, bias)
        problem = problem_of(case, truth, every, probability, axes.baseline)
        return Plan(self.sums(spec), axes, states.Simulator(problem, shown), probability == 1)

    def simulate(self, plan: Plan, first: int, count: int) -> np.ndarray:
        sums = {name: np.zeros(shape) for name, shape in plan.layout.shapes.items()}
        plan.simulator.simulate_block(int(first), int(count), sums["error"], sums["paired"])
        return plan.layout.pack(**sums)

    def errors(self, plan: Plan, first: int, count: int) -> np.ndarray:
        return plan.simulator.errors(int(first), int(count))

    def limits(self, spec: Any) -> np.ndarray:
        truth, probability = self._truth(spec)
        every = [self.matrices(spec, one) for one in spec.filters]
        found = [limit(truth, of, probability) if of.own or probability == 1 else of.x * np.nan for of in every]
        return np.stack(found)[:, : len(self.components)]

    def floor(self, spec: Any, axes: Axes) -> Floor:
        """The posterior Cramér-Rao bound, of each filter with its own plots."""
        (F, Q, _, P), probability = self._truth(spec)
        F, Q = (np.broadcast_to(one, (spec.scans, *one.shape)) for one in (F, Q))
        of = partial(floor.driven, P, F, Q, chance=probability, shown=len(self.components))
        seen = [
            self._rows("plot", partial(self.call, self.plot, spec, one), spec.scans, len(P)) for one in spec.filters
        ]
        names = [H.tobytes() + sigma.tobytes() for H, sigma in seen]
        bounds = {name: of(H=H, R=sigma**2) for name, (H, sigma) in dict(zip(names, seen, strict=True)).items()}
        each = tuple(bounds[name] for name in names)
        return Floor(floor.POSTERIOR, each, each[0] if len(bounds) == 1 else None)

    # ---- recorded plots ------------------------------------------------------------------------------------------
    def drawing(self, case: "Case") -> Draw:
        plan = self.prepare(case)
        taken = {
            name: (group, d)
            for one, group in zip(case.spec.filters, plan.simulator.problem.sees, strict=True)
            for d, name in enumerate(self.columns(case.spec, one))
        }

        def draw(first: int, count: int) -> Drawn:
            truth, plots = plan.simulator.simulate_plots(first, count)
            columns = {name: plots[:, :, group, d] for name, (group, d) in taken.items()}
            names = plan.axes.components
            return Drawn(plan.axes.t_s, columns, names, truth[..., : len(names)], first=first)

        return draw

    def tracker(self, case: "Case") -> Tracker:
        return Following(self, case.spec)

    def likelihood(
        self, case: "Case", filter_name: str | None, tracks: Sequence[Mapping[str, np.ndarray]]
    ) -> "PlotLikelihood | None":
        if not self.fitted:
            return None
        # One with gains of its own does not say how likely plots are; its motion and its plots do, where all have such.
        members = case.spec.filters
        known = [one for one in members if self.call(self.own_gains, case.spec, one) is None] or members
        every = [PlotLikelihood(self, case.spec, one, tracks) for one in known if filter_name in (None, one.name)]
        if len(every) < 2:
            return every[0] if every else None
        return max(every, key=lambda one: (len(one.of.columns), one(one.stated)))


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
    for p in range(1, min(LONGEST_PERIOD, scans // 2) + 1):
        if all(np.array_equal(one[p:], one[:-p]) for one in arrays):
            return p
    return scans


@np.errstate(all="ignore")  # growth without end has no limit
def steady(of: Matrices) -> tuple[np.ndarray, np.ndarray]:
    """The limit over a period of p scans of a Kalman filter's gains (p, D, n), and its P before the first of them. P
    goes from scan to scan as A (P⁻¹ + J)⁻¹ A' + C with A = F, C = Q, J = H'R⁻¹H. Two such steps are one of the same
    form, so 2^m periods take m of them (structured doubling: Chu, Fan & Lin 2005)."""
    eye, phases = np.eye(of.x.size), range(period(of.H, of.R))
    try:
        A, C, J = reduce(_after, ((of.F, of.Q, (of.H[k].T / of.R[k]) @ of.H[k]) for k in phases))
        P = C
        for _ in range(DOUBLINGS):
            A, C, J = _after((A, C, J), (A, C, J))
            before, P = P, A @ np.linalg.solve(eye + of.P @ J, of.P) @ A.T + C
            sigma = np.sqrt(np.diag(P))
            if not np.isfinite(P).all() or (np.abs(P - before) <= CLOSE * np.outer(sigma, sigma)).all():
                break
    except np.linalg.LinAlgError:
        P = np.full_like(of.P, np.nan)
    gains = []
    for k in phases:
        found, P_after = updated(P, of.H[k], of.R[k])
        gains.append(found)
        P = of.F @ P_after @ of.F.T + of.Q
    return np.stack(gains), P


Step = tuple[np.ndarray, np.ndarray, np.ndarray]


def _after(first: Step, second: Step) -> Step:
    """Two steps of `steady` as one."""
    (A, C, J), (B, E, M) = first, second
    eye = np.eye(len(A))
    between = np.linalg.solve(eye + C @ M, np.hstack([A, C]))
    moved, spread = between[:, : len(A)], between[:, len(A) :]
    made = B @ spread @ B.T + E, A.T @ M @ moved + J
    return B @ moved, *((one + one.T) / 2 for one in made)


# ---- exact values ----------------------------------------------------------------------------------------------------
@np.errstate(all="ignore")  # of a filter that diverges
def exact(truth: tuple[np.ndarray, ...], of: Matrices, probability: float) -> tuple[np.ndarray, np.ndarray]:
    """σ and bias (K, n) of a filter's errors e, from the mean and covariance of (e, truth), whatever its model. A
    missed plot makes a mixture of two; then σ is exact still, though the error is not Gaussian."""
    F, Q, mean, P = truth
    n = mean.size
    eye, none = np.eye(n), np.zeros((n, n))
    m, S = np.concatenate([of.x - mean, mean]), np.block([[P, -P], [-P, P]])
    M, B = np.block([[of.F, of.F - F], [none, F]]), np.vstack([-eye, eye])
    noise, sigma, bias = B @ Q @ B.T, np.empty((len(of.H), n)), np.empty((len(of.H), n))
    for k in range(len(of.H)):
        if k:
            m, S = M @ m, M @ S @ M.T + noise
        m0, S0 = m, S
        for h, g, see, s in zip(of.H[k], of.gains[k], of.see[k], of.sigma[k], strict=True):
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
def limit(truth: tuple[np.ndarray, ...], of: Matrices, probability: float) -> np.ndarray:
    """The limit of σ (n,) of a filter's errors, at scans of the phase of its last one; NaN where there is none, or
    where it depends on the truth: by a wrong F or H.

    Of a filter's own gains the last ones are kept. The covariance of the errors goes over a period as S → T S + W, with
    S as a vector, and stays at (1 - T)⁻¹ W."""
    F, Q, mean, _ = truth
    n = mean.size
    p = period(of.H, of.R, of.see, of.sigma)
    if not (np.array_equal(of.F, F) and np.array_equal(of.H, of.see)) or 2 * p > len(of.H):
        return np.full(n, np.nan)
    scans = np.arange(len(of.H) - p, len(of.H))  # a period that ends with the last one
    gains = of.gains[scans] if of.own else steady(of)[0][scans % p]
    T, W = np.eye(n * n), np.zeros(n * n)
    for g, k in zip(gains, scans, strict=True):
        moved, added = np.kron(F, F), Q.ravel()
        kept, noise = np.eye(n), np.zeros((n, n))
        for h, one, s in zip(of.H[k], g, of.sigma[k], strict=True):
            A = np.eye(n) - np.outer(one, h)
            kept, noise = A @ kept, A @ noise @ A.T + s**2 * np.outer(one, one)
        take = probability * np.kron(kept, kept) + (1 - probability) * np.eye(n * n)
        T, W = take @ moved @ T, take @ (moved @ W + added) + probability * noise.ravel()
    if not np.isfinite(T).all() or np.abs(np.linalg.eigvals(T)).max() >= 1:
        return np.full(n, np.nan)
    return np.sqrt(np.linalg.solve(np.eye(n * n) - T, W).reshape(n, n).diagonal())


# ---- for the kernel --------------------------------------------------------------------------------------------------
def root(S: np.ndarray) -> np.ndarray:
    """L (n, n) with L L' = S ≥ 0, lower; columns not needed for S are zero (Cholesky)."""
    L, left = np.zeros_like(S), S.copy()
    for j in range(len(S)):
        if left[j, j] > 1e-12 * S[j, j]:
            L[j:, j] = left[j:, j] / np.sqrt(left[j, j])
            left -= np.outer(L[:, j], L[:, j])
    return L


def problem_of(
    case: "Case", truth: tuple[np.ndarray, ...], every: Sequence[Matrices], probability: float, baseline: int
) -> "states.Problem":
    """The problem that the kernel simulates."""
    from radarsim.kernels import states
    from radarsim.studies.noise import noise_key

    F, Q, mean, P = truth
    noises = root(Q), root(P)
    used = [[j for j in range(len(mean)) if one[:, j].any()] for one in noises]
    push, spread = (np.zeros((len(mean), max(map(len, used)))) for _ in noises)
    for one, made, columns in zip(noises, (push, spread), used, strict=True):
        made[:, : len(columns)] = one[:, columns]
    seen: dict[bytes, int] = {}
    sees = [seen.setdefault(of.see.tobytes() + of.sigma.tobytes(), len(seen)) for of in every]
    of_group = [every[sees.index(group)] for group in range(len(seen))]
    arrays = {name: np.stack([getattr(of, name) for of in every]) for name in ("F", "x", "H", "gains", "P", "Q", "R")}
    return states.Problem(
        key=noise_key(case, "plots"),
        detections=noise_key(case, "detections"),
        move=np.ascontiguousarray(F),
        push=push,
        start=mean,
        spread=spread,
        see=np.stack([of.see for of in of_group]),
        sigma=np.stack([of.sigma for of in of_group]),
        sees=np.array(sees),
        adapts=np.array([int(probability < 1 and not of.own) for of in every]),
        probability=probability,
        baseline=baseline,
        **arrays,
    )


# ---- recorded plots --------------------------------------------------------------------------------------------------
class _Rows:
    """A filter's model over rows of recorded plots, whatever the times between them."""

    def __init__(self, study: LinearStudy, spec: Any, one: Any):
        self.study, self.spec, self.one = study, spec, one
        self.columns = study.columns(spec, one)
        self.of = study.matrices(spec, one)
        self.period = period(self.of.H, self.of.R)

    def numbers(self, columns: Mapping[str, np.ndarray], n: int) -> np.ndarray:
        """The numbers z (n, D), NaN where a column is absent."""
        none = np.full(n, np.nan)
        return np.stack([columns.get(name, none) for name in self.columns], axis=1)

    def moves(self, dt: np.ndarray, spec: Any = None) -> tuple[np.ndarray, np.ndarray]:
        """F and Q (n, n, n) over times; over a time of zero the state stays."""
        motion, n = self.study.assumed_motion(spec or self.spec, self.one), self.of.x.size
        times, at = np.unique(dt, return_inverse=True)
        F, Q = np.tile(np.eye(n), (times.size, 1, 1)), np.zeros((times.size, n, n))
        for name, one, made in (("F", motion.F, F), ("Q", motion.Q, Q)):
            moved = [self.study.call(one, t) for t in times[times != 0].tolist()]
            made[times != 0] = self.study._array(f"assumed_motion: {name}(dt)", moved or made[:0], len(moved), n, n)
        for i in np.flatnonzero(np.linalg.eigvalsh(Q)[:, 0] < 0):
            self.study._covariance(f"assumed_motion: Q({times[i]:g} s)", Q[i], n)
        return F[at], Q[at]

    def rows(self, first: int, n: int, spec: Any = None) -> tuple[np.ndarray, np.ndarray]:
        """H (n, D, d) and R (n, D) of rows from number `first` on."""
        if spec is None and self.period < len(self.of.H):
            at = (first + np.arange(n)) % self.period
            return self.of.H[at], self.of.R[at]
        every = [self.study.assumed_plot(spec or self.spec, self.one, first + k) for k in range(n)]
        H = np.stack([np.atleast_2d(row) for row, _ in every]).astype(float)
        return H, np.stack([np.atleast_1d(sigma) for _, sigma in every]).astype(float) ** 2

    def gains(self, first: int, n: int) -> np.ndarray:
        """A filter's own gains at rows; after its last scan those of the last period repeat."""
        k, scans = first + np.arange(n), len(self.of.gains)
        last = scans - min(self.period, scans)
        return self.of.gains[np.where(k < scans, k, last + (k - last) % (scans - last))]


class Following:
    """The filters of a case over recorded plots, chunk by chunk in constant memory.

    The first row is the first scan: there the state is as in the config. A filter none of whose columns are in the file
    has no estimates."""

    most_rows: int | None = None
    several = False

    def __init__(self, study: LinearStudy, spec: Any):
        self.study, self.names = study, tuple(one.name for one in spec.filters)
        self.filters = [_Rows(study, spec, one) for one in spec.filters]
        self.states = [(one.of.x.copy(), one.of.P.copy()) for one in self.filters]
        self.count, self.last = 0, np.nan

    def feed(self, columns: Mapping[str, np.ndarray]) -> Track:
        """The estimates over the next rows: columns (n,), NaN where a value is missing."""
        t = columns["t_s"]
        dt = np.diff(t, prepend=self.last if self.count else t[0])
        made = [self._one(one, *state, dt, columns) for one, state in zip(self.filters, self.states, strict=True)]
        self.count, self.last = self.count + len(t), t[-1]
        out, residual = (np.stack([each[i] for each in made]) for i in range(2))
        n, shown = self.filters[0].of.x.size, len(self.study.components)
        numbers = self.study.measured
        return Track(
            filters=self.names,
            components=tuple((one.name, one.unit) for one in self.study.components),
            t_s=t,
            estimate=out[..., :shown],
            sigma=out[..., n : n + shown],
            measured=tuple((one.column, one.unit) for one in numbers),
            residual=residual,
            tested=tuple((one.column, 1) for one in numbers),
            nis=out[..., 2 * n :],
        )

    def _one(
        self, one: _Rows, x: np.ndarray, P: np.ndarray, dt: np.ndarray, columns: Mapping[str, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray]:
        """The result of `states.follow` for a filter, and its residuals (n, D)."""
        from radarsim.kernels import states

        rows, z = len(dt), one.numbers(columns, len(dt))
        (F, Q), (H, R) = one.moves(dt), one.rows(self.count, rows)
        out, there = np.full((rows, 2 * x.size + z.shape[1]), np.nan), np.isfinite(z)
        gains = one.gains(self.count, rows) if one.of.own else np.zeros_like(H)
        states.follow(x, P, F, Q, H, R, gains, not one.of.own, np.where(there, z, 0.0), there, out)
        if not any(name in columns for name in one.columns):
            out[:] = np.nan
        return out, z - np.einsum("kdn,kn->kd", H, out[:, : x.size])


class PlotLikelihood:
    """The likelihood of tracks under a filter's model, by the keys that the study names as `fitted`. The state at the
    first plot is as in the config."""

    explains: tuple[str, ...] = (OUTLIERS, CORRELATION)

    def __init__(self, study: LinearStudy, spec: Any, one: Any, tracks: Sequence[Mapping[str, np.ndarray]]):
        self.spec, self.filter, self.of = spec, one.name, _Rows(study, spec, one)
        self.tracks, self.rows = len(tracks), sum(len(track["t_s"]) for track in tracks)
        self.keys = study.fitted
        stated = [attrgetter(key)(spec) for key in self.keys]
        if None in stated:
            raise study._fault("fitted", f"{self.keys[stated.index(None)]} is not given")
        self.stated = np.array(stated, dtype=float)
        self.least = LEAST * np.where(self.stated > 0, self.stated, 1.0)
        self.plots = [
            (np.diff(one["t_s"], prepend=one["t_s"][0]), self.of.numbers(one, len(one["t_s"]))) for one in tracks
        ]
        self.usual_s = usual_interval_s(tracks)

    def _scores(self, values: np.ndarray, outliers: float, correlation: float) -> np.ndarray:
        """Sums over all tracks for each number of a plot."""
        from radarsim.kernels.hypotheses import lasting, log_likelihood

        spec = self.spec
        for key, value in zip(self.keys, values, strict=True):
            spec = _changed(spec, key.split("."), float(value))
        start = self.of.study.assumed_motion(spec, self.of.one)
        total: np.ndarray = np.zeros(len(self.of.columns))
        for dt, z in self.plots:
            (F, Q), (H, R) = self.of.moves(dt, spec), self.of.rows(0, len(dt), spec)
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
        return dict(zip(self.of.columns, self._scores(values, 0.0, 0.0).tolist(), strict=True))


def _is_real(annotation: Any) -> bool:
    """Whether a key is a real number, or may be left out."""
    if get_origin(annotation) in (Union, UnionType):
        return all(one is NoneType or _is_real(one) for one in get_args(annotation))
    return (get_args(annotation)[0] if get_origin(annotation) is Annotated else annotation) is float


def _changed(model: Any, path: Sequence[str], value: float) -> Any:
    """A config's keys with another value of one."""
    first, *rest = path
    return model.model_copy(update={first: _changed(getattr(model, first), rest, value) if rest else value})
