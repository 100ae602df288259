"""Sonar plots of one realisation, and filters over recorded plots that are known to be the target's; how likely these
are under a filter."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Track
from radarsim.kernels.hypotheses import lasting, log_likelihood
from radarsim.physics import manoeuvre_covariance, transition
from radarsim.studies import interface
from radarsim.studies.interface import CORRELATION, OUTLIERS, Draw, Drawn, RecordedPlots, usual_interval_s
from radarsim.studies.sonar import filters, world
from radarsim.studies.sonar import study as base
from radarsim.studies.sonar.config import Keys
from radarsim.studies.sonar.kernels import detector, steps
from radarsim.studies.sonar.kernels import patterns as pattern_kernels
from radarsim.studies.sonar.scene import build_scene, filter_specs, lateral_scale, third_coordinate

MOST_ROWS = 200_000  # of a file: designs of all rows are kept in memory
RANGE, BEARING = "sensor.sigma_range_m", "sensor.sigma_bearing_rad"
THIRD = {"depth": ("depth_m", "sensor.sigma_depth_m"), "elevation": ("elevation_rad", "sensor.sigma_elevation_rad")}
OPTIMAL = ("growing_memory", "window", "kalman")  # kinds whose residuals have a known variance if errors are white
MODELLED = ("growing_memory", "kalman")  # kinds that say how the target moves and that errors are white
STARTING = 3  # whole plots of a track from which its state is found, in the likelihood
WIDE = 1e3  # standard deviations of a plot by which a rate may differ, in an interval, from that of the first two plots
LEAST_SIGMA, LEAST_MANOEUVRE = 1e-4, 1e-8  # what counts as zero: of a stated σ, of the variance that moves by a σ
LEAST_FREEDOM = 1e-6  # of a plot's variance; with less the estimate passes through the plot


def columns(spec: Keys) -> tuple[tuple[str, ...], ...]:
    """The columns that `track` reads from a file of recorded plots."""
    third, _ = third_coordinate(spec.sensor)
    return (("t_s", "range_m", "bearing_rad", *([THIRD[third][0]] if third else [])),)


def sigmas(spec: Keys) -> dict[str, tuple[str, ...]]:
    """The keys of the standard deviations that determine the accuracy of each measured quantity."""
    third, _ = third_coordinate(spec.sensor)
    keys: dict[str, tuple[str, ...]] = {"range_m": (RANGE,), "bearing_rad": (BEARING,)}
    if spec.frame != "polar":
        keys = {"x_m": (RANGE, BEARING), "y_m": (RANGE, BEARING)}
    return keys | ({THIRD[third][0]: (THIRD[third][1],)} if third else {})


def drawing(case: Case) -> Draw:
    """The plots of realisations of a case; not-a-number too where a further sonar does not measure the coordinate."""
    spec, scene = case.spec, build_scene(case)
    world, detections, polar = base.world(case, scene), base.detections(case, scene), spec.frame == "polar"
    names = columns(spec)[0][1:]

    def draw(first: int, count: int) -> Drawn:
        plots, deviation = base.drawn_plots(world, detections, first, count, what=0 if polar else 1)
        plots, truth = plots[: len(names)], base.truth_of(scene, deviation, count, 3)
        if polar:
            exact = [truth[..., 3 * c] for c in range(len(names))]
        else:
            exact = [np.broadcast_to(true, plots.shape[1:]) for true in scene.polar[..., 0].T]
            plots += scene.polar[..., 0].T[:, None]
        if not np.isfinite(scene.sigma).all():
            plots.swapaxes(1, 2)[~np.isfinite(scene.sigma.T)] = np.nan
        true_plots = {f"true_{name}": column for name, column in zip(names, exact, strict=True)}
        return Drawn(scene.t, dict(zip(names, plots, strict=True)), base.labels(spec, 3), truth, true_plots, first)

    return draw


class Derived(NamedTuple):
    """Quantities derived from tracks: names and units of U quantities, values and their σ (F, n, U)."""

    names: tuple[tuple[str, str], ...]
    values: np.ndarray
    sigma: np.ndarray


class Tracker:
    """The filters of a case over recorded plots.

    Windows and designs computed in advance need many rows, so all rows are processed at once: `most_rows` limits their
    number. Bearings are made continuous from plot to plot, so an estimate may leave -pi … pi. In the cartesian frames a
    plot needs both range and bearing. Further sonars of the config are ignored: all plots are taken as the first one's.
    """

    most_rows = MOST_ROWS
    several = False

    def __init__(self, case: Case):
        self.spec: Any = case.spec

    def specs(self) -> list[filters.FilterSpec]:
        """The filters."""
        return filter_specs(self.spec)

    def derived(self, t: np.ndarray, x: np.ndarray, P: np.ndarray, known: np.ndarray) -> Derived:
        """Quantities derived from the tracks; here none.

        t (n,) from the first plot; x (F, n, C, 3), P (F, n, C, 3, 3) and known (F, n, C, 3)."""
        none = np.zeros((*x.shape[:2], 0))
        return Derived((), none, none)

    def feed(self, columns: Mapping[str, np.ndarray]) -> Track:
        """The estimates over all rows: columns (n,), NaN where a value is missing."""
        spec, specs = self.spec, self.specs()
        t = columns["t_s"] - columns["t_s"][0]
        z, weight, sigma = measured(spec, list(columns.values())[1:])
        x, P, known = _estimated(specs, t, spec.sensor.scan_period_s, z, weight, sigma)
        size = max(one.size for one in specs)
        flat = (len(specs), len(t), len(z) * size)
        variance = np.diagonal(P, axis1=3, axis2=4)
        estimate = np.where(known, x, np.nan)[..., :size].reshape(flat)
        spread = np.where(known, np.sqrt(np.maximum(variance, 0.0)), np.nan)[..., :size].reshape(flat)
        derived = self.derived(t, x, P, known)
        residual, nis, believed = self._residuals(z, weight, sigma, estimate[..., ::size], spread[..., ::size])
        measures = tuple(sigmas(spec))
        return Track(
            filters=tuple(member.name for member in spec.filters),
            components=(*base.labels(spec, size), *derived.names),
            t_s=columns["t_s"],
            estimate=np.concatenate([estimate, derived.values], axis=2),
            sigma=np.concatenate([spread, derived.sigma], axis=2),
            measured=tuple((name, name.rpartition("_")[2]) for name in measures),
            residual=residual,
            tested=tuple((name, 1) for name in measures),
            nis=nis,
            residual_sigma=believed,
        )

    def _residuals(
        self, z: np.ndarray, weight: np.ndarray, sigma: np.ndarray, value: np.ndarray, spread: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Residuals, their normalised squares and their σ (F, n, C) of plots z (C, n); value and its σ `spread`
        (F, n, C)."""
        residual = np.where(weight > 0, z, np.nan).T[None] - value
        with np.errstate(divide="ignore", invalid="ignore"):
            variance = np.where(weight > 0, sigma[:, None] ** 2 / weight, np.nan).T[None]
            freedom = variance - spread**2
            # For least squares and Kalman filters the residual after the update has variance R - P, and its normalised
            # square equals that of the innovation.
            nis = np.where(freedom > LEAST_FREEDOM * variance, residual**2 / freedom, np.nan)
        others = [member.kind not in OPTIMAL for member in self.spec.filters]
        nis[others] = np.nan
        believed = np.sqrt(np.maximum(freedom, 0.0))
        believed[others] = np.nan
        return residual, nis, believed


def _estimated(
    specs: Sequence[filters.FilterSpec],
    t: np.ndarray,
    period: float,
    z: np.ndarray,
    weight: np.ndarray,
    sigma: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Estimates (F, n, C, 3), covariances (F, n, C, 3, 3) and which are known (F, n, C, 3), of `measured` plots."""
    plots = [filters.Plots(t, w[None], period, unit) for w, unit in zip(weight, sigma, strict=True)]
    x, P = np.zeros((len(specs), len(t), len(z), 3)), np.zeros((len(specs), len(t), len(z), 3, 3))
    known = np.zeros(x.shape, dtype=bool)
    responding = [f for f, one in enumerate(specs) if one.response]
    if responding:
        x[responding], P[responding] = estimate_recorded([specs[f] for f in responding], t, period, sigma, z, weight)
    for f, one in enumerate(specs):
        for c in range(len(z)):
            if not one.response:
                x[f, :, c], P[f, :, c] = filters.apply_filter(one, c, plots[c], z[c])
            known[f, :, c] = np.arange(3) < np.minimum(plots[c].moments()[0], one.size)[:, None]
    return x, P, known


def estimate_recorded(
    specs: Sequence[filters.FilterSpec],
    t: np.ndarray,
    period: float,
    sigma: np.ndarray,
    z: np.ndarray,
    weight: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Estimates (F, n, C, 3) and covariances (F, n, C, 3, 3) of filters that respond to manoeuvres.

    From plots z (C, n) of weights (C, n), zero where missing, by the kernels of the simulation: they process a chunk of
    realisations, here all the same track. t (n,) in s; sigma (C,) of a plot of weight one. A detector that tests every
    so many scans counts the rows."""
    F, C, n = len(specs), len(z), len(t)
    detectors = filters.detector_arrays([], filters.needed_tests(specs), np.zeros(n, dtype=np.int64), C)
    bank = filters.per_realisation_bank(specs, t, period, sigma, detectors)
    x, Y, further = (np.zeros((F, C, rows, steps.CHUNK)) for rows in (4, 8, detector.ROWS))
    memory = steps.Filters(x, Y, further, np.empty((6, steps.CHUNK)))
    recent, T = np.zeros((C, 3, bank.memory, steps.ROW)), np.zeros((len(detectors.plots), C + 1, steps.CHUNK))
    count = np.zeros((C, steps.CHUNK))
    estimates, covariances = np.zeros((F, n, C, 3)), np.zeros((F, n, C, 3, 3))
    scale = period ** -np.arange(3.0)
    packed = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
    for k, dt in enumerate(np.diff(t, prepend=t[0])):
        plot, w = (np.repeat(values[:, k : k + 1], steps.CHUNK, axis=1) for values in (z, weight))
        before, count = count, count + (w > 0)
        for c in range(C if bank.memory else 0):
            steps.remember(recent[c], plot[c], w[c], dt / period)
        detector.detector_statistics(detectors, k, recent, sigma, count, w, T)
        plots = steps.Plots(plot, w, before, count, recent, T)
        for f, c in np.ndindex(F, C):
            pattern_kernels.filter_scan(bank, f, c, k, dt, memory, plots)
            estimates[f, k, c] = x[f, c, :3, 0]
            covariances[f, k, c] = memory.P[packed, 0] * sigma[c] ** 2 * np.outer(scale, scale)
    return estimates, covariances


def measured(spec: Keys, columns: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Plots (C, n), their weights (C, n), zero where missing, and nominal σ (C,), in the frame of the filters."""
    sensor = spec.sensor
    third, third_sigma = third_coordinate(sensor)
    sigma = np.array([sensor.sigma_range_m, sensor.sigma_bearing_rad, *([third_sigma] if third else [])])
    z = np.stack(columns)
    z[1] = continuous(z[1])
    weight = np.isfinite(z).astype(float)
    if spec.frame != "polar":
        detected = np.flatnonzero(weight[:2].all(axis=0))
        plots = z[:2, detected]
        convert = world.converted if spec.frame == "cartesian" else world.converted_unbiased
        x, y, _ = convert(*plots, *sigma[:2])
        position = plots if spec.frame == "cartesian" or not len(detected) else world.places(*plots)
        xx, _, yy = convert(*position, *sigma[:2])[2]
        weight[:2], z[:2] = 0.0, 0.0
        sigma[:2] = np.sqrt([xx[0], yy[0]]) if len(detected) else 1.0
        z[0, detected], z[1, detected] = x, y
        weight[0, detected], weight[1, detected] = sigma[0] ** 2 / xx, sigma[1] ** 2 / yy
    return np.where(weight > 0, z, 0.0), weight, sigma


def continuous(bearing: np.ndarray) -> np.ndarray:
    """Bearings (n,) without jumps of a full turn between neighbouring plots; gaps stay."""
    there = np.isfinite(bearing)
    out = bearing.copy()
    out[there] = np.unwrap(bearing[there])
    return out


class PlotLikelihood:
    """How likely tracks are under a filter's model: a polynomial of its degree in each coordinate, whose next
    derivative is random; errors of range, bearing and a third coordinate that are independent. The state before the
    first whole plot is taken as unknown."""

    def __init__(self, case: Case, number: int, tracks: Sequence[Mapping[str, np.ndarray]]):
        self.spec: Any = case.spec
        # Errors that last are of range and bearing, which in other frames are not measured along one direction each.
        self.explains: tuple[str, ...] = (OUTLIERS, CORRELATION) if self.spec.frame == "polar" else (OUTLIERS,)
        member, scale = self.spec.filters[number], lateral_scale(self.spec, 2)
        self.filter, self.tracks, self.size = member.name, len(tracks), member.degree + 1
        self.rows, self.usual_s = sum(len(columns["t_s"]) for columns in tracks), usual_interval_s(tracks)
        sensor = self.spec.sensor
        third, third_sigma = third_coordinate(sensor)
        sigma = {RANGE: sensor.sigma_range_m, BEARING: sensor.sigma_bearing_rad}
        sigma |= {THIRD[third][1]: third_sigma} if third else {}
        self.coordinates = len(sigma)
        stated, least = list(sigma.values()), [LEAST_SIGMA * one for one in sigma.values()]
        names = list(sigma)
        if member.kind == "kalman":
            names.append(f"filters.{number}.manoeuvre_variance")
            stated.append(member.manoeuvre_variance or 0.0)
            least.append(LEAST_MANOEUVRE * (sensor.sigma_range_m / sensor.scan_period_s**self.size) ** 2)
        self.keys, self.stated, self.least = tuple(names), np.array(stated), np.array(least)
        found = (self._problem(list(columns.values()), scale) for columns in tracks)
        self.problems = [one for one in found if one is not None]

    def _problem(self, columns: Sequence[np.ndarray], scale: np.ndarray) -> "_Problem | None":
        """A track from its first whole plot on; None where it has none."""
        t, *values = columns
        whole = np.isfinite(np.stack(values)).all(axis=0)
        if not whole.any():
            return None
        first, C, size = int(whole.argmax()), self.coordinates, self.size
        t, z = t[first:], np.stack(values)[:, first:]
        z[1] = continuous(z[1])
        there = np.isfinite(z).T.copy()
        if self.spec.frame != "polar":
            there[:, :2] = there[:, :2].all(axis=1, keepdims=True)
        steps = np.diff(t, prepend=t[0])
        eye = np.eye(C)
        F = np.stack([np.kron(eye, transition(step, size)) for step in steps])
        Q = np.stack([np.kron(np.diag(scale), manoeuvre_covariance(1.0, step, size)) for step in steps])
        settled = int(np.searchsorted(np.cumsum(whole[first:]), STARTING, side="right"))
        usual = float(np.median(steps[1:])) if len(steps) > 1 else self.spec.sensor.scan_period_s
        rates = WIDE * usual ** -np.arange(1.0, size)
        there[0] = False  # it starts the track
        following = int(whole[first + 1 :].argmax()) + 1 if whole[first + 1 :].any() else 0
        one = _Problem(F, Q, np.where(np.isfinite(z), z, 0.0), there, t - t[0], rates, following, settled)
        _, along, variance = self._numbers(one, self.stated[:C])  # the stated errors, whatever is tried
        wide = np.sqrt(np.diag(along[0].T @ np.diag(variance[0]) @ along[0]))
        return one._replace(rates=np.outer(rates, wide))

    def _numbers(self, one: "_Problem", sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What is measured along independent directions: positions (n, C) in the frame of the filters, the directions
        (n, C, C) by rows, and the variances (n, C) along them."""
        n, C = one.there.shape
        along, variance = np.tile(np.eye(C), (n, 1, 1)), np.tile(sigma**2, (n, 1))
        place = one.z.T.copy()
        if self.spec.frame != "polar":
            convert = world.converted if self.spec.frame == "cartesian" else world.converted_unbiased
            x, y, _ = convert(*one.z[:2], *sigma[:2])
            xx, xy, yy = convert(*(one.z[:2] if self.spec.frame == "cartesian" else world.places(*one.z[:2])),
                                 *sigma[:2])[2]  # fmt: skip
            values, vectors = np.linalg.eigh(np.stack([xx, xy, xy, yy], axis=1).reshape(n, 2, 2))
            place[:, 0], place[:, 1] = x, y
            variance[:, :2], along[:, :2, :2] = np.maximum(values, 0.0), np.swapaxes(vectors, 1, 2)
        return place, along, variance

    def _score(self, values: np.ndarray, outliers: float, correlation: float = 0.0) -> float:
        sigma, C, size = values[: self.coordinates], self.coordinates, self.size
        manoeuvre, total = float(values[C]) if len(values) > C else 0.0, 0.0
        for one in self.problems:
            place, along, variance = self._numbers(one, sigma)
            H = np.zeros((*along.shape[:2], C * size))
            H[:, :, ::size] = along
            z = np.einsum("nij,nj->ni", along, place)
            x, P = np.zeros(C * size), np.zeros((C * size, C * size))
            x[::size] = place[0]
            if one.following:
                x[1::size] = (place[one.following] - place[0]) / one.t[one.following]
            start = along[0].T @ np.diag(variance[0]) @ along[0]
            P[::size, ::size] = start
            for i, rate in enumerate(one.rates, start=1):
                P[np.arange(C) * size + i, np.arange(C) * size + i] = rate**2
            model, scale, white = (x, P, one.F, one.Q, H), manoeuvre, 1.0
            if correlation:
                first = np.zeros((C * size, C))
                of = np.arange(C)
                first[of * size, of] = -sigma
                shares = correlation ** (np.diff(one.t, prepend=0.0) / self.usual_s)
                model = lasting(x, P, first, one.F, manoeuvre * one.Q, H, variance, shares)
                scale, white = 1.0, 0.0
            score = np.empty(z.shape)
            log_likelihood(*model, z, variance, one.there, scale, outliers, white, score)
            total += float(score[one.settled :].sum())
        return total

    def __call__(self, values: np.ndarray, outliers: float = 0.0, bias: float = 0.0, correlation: float = 0.0) -> float:
        """The logarithm of the likelihood; no bias is looked for."""
        return self._score(values, outliers, correlation)

    def by_number(self, values: np.ndarray) -> dict[str, float]:
        """Of the plot as a whole: its numbers are not apart in every frame."""
        return {"plot": self._score(values, 0.0)}


class _Problem(NamedTuple):
    """A track for the kernel: transitions and process noises of unit variance (n, d, d), values (C, n) as measured,
    which of them count (n, C), times (n,) from the first, standard deviations of the rates of each order (size − 1, C)
    before the first plot, the row of the second whole plot (0: none), the row from which the state is known."""

    F: np.ndarray
    Q: np.ndarray
    z: np.ndarray
    there: np.ndarray
    t: np.ndarray
    rates: np.ndarray
    following: int
    settled: int


def likelihood(
    case: Case, filter_name: str | None, tracks: Sequence[Mapping[str, np.ndarray]]
) -> PlotLikelihood | None:
    """How likely tracks are under a filter, or where None is named under the first Kalman filter, else the first that
    models the target; None where it does not."""
    members = case.spec.filters
    known = [i for i, one in enumerate(members) if one.kind in MODELLED and one.association is None]
    if filter_name is None:
        kalman = [i for i in known if members[i].kind == "kalman" and members[i].manoeuvre_variance]
        known = [*kalman, *known][:1]
    else:
        known = [i for i in known if members[i].name == filter_name]
    return PlotLikelihood(case, known[0], tracks) if known else None


class Recorded(RecordedPlots):
    """Recorded plots of all parts, for `radarsim track` and `radarsim simulate`.

    part_of: the part of a case with these keys."""

    rows_asked = 3000
    columns, sigmas, likelihood = staticmethod(columns), staticmethod(sigmas), staticmethod(likelihood)

    def __init__(self, part_of: Callable[[Any], Any]):
        self.part_of = part_of

    def scan_period_s(self, spec: Keys) -> float:
        return spec.sensor.scan_period_s

    def drawing(self, case: Case) -> Draw:
        draw: Draw = self.part_of(case.spec).drawing(case)
        return draw

    def tracker(self, case: Case) -> interface.Tracker:
        tracker: interface.Tracker = self.part_of(case.spec).tracker(case)
        return tracker
