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
from radarsim.studies.sonar import filters, study, world
from radarsim.studies.sonar.config import Keys
from radarsim.studies.sonar.kernels import detector, patterns, steps
from radarsim.studies.sonar.scene import build_scene, filter_specs, lateral_scale, third_coordinate

MAX_ROWS = 200_000  # of a file: the designs of all rows are held in memory
RANGE, BEARING = "sensor.sigma_range_m", "sensor.sigma_bearing_rad"
THIRD_COLUMN_AND_KEY = {
    "depth": ("depth_m", "sensor.sigma_depth_m"),
    "elevation": ("elevation_rad", "sensor.sigma_elevation_rad"),
}
OPTIMAL_KINDS = ("growing_memory", "window", "kalman")  # their residuals have a known variance if errors are white
MODELLED_KINDS = ("growing_memory", "kalman")  # kinds that model the target's motion and white errors
STARTING_PLOTS = 3  # complete plots from which the likelihood determines the state of a track
WIDE_RATE_SIGMAS = 1e3  # σ of a plot by which a rate may differ, in an interval, from that of the first two plots
MIN_SIGMA_SHARE = 1e-4  # of a configured σ: less counts as zero
MIN_MANOEUVRE_SHARE = 1e-8  # of the variance that moves a target by a σ of a plot: less counts as zero
MIN_FREEDOM = 1e-6  # of a plot's variance; with less the estimate passes through the plot


def columns(spec: Keys) -> tuple[tuple[str, ...], ...]:
    """The columns that `track` reads from a file of recorded plots."""
    third, _ = third_coordinate(spec.sensor)
    return (("t_s", "range_m", "bearing_rad", *([THIRD_COLUMN_AND_KEY[third][0]] if third else [])),)


def sigmas(spec: Keys) -> dict[str, tuple[str, ...]]:
    """The keys of the standard deviations that determine the accuracy of each measured quantity."""
    third, _ = third_coordinate(spec.sensor)
    keys: dict[str, tuple[str, ...]] = {"range_m": (RANGE,), "bearing_rad": (BEARING,)}
    if spec.frame != "polar":
        keys = {"x_m": (RANGE, BEARING), "y_m": (RANGE, BEARING)}
    return keys | ({THIRD_COLUMN_AND_KEY[third][0]: (THIRD_COLUMN_AND_KEY[third][1],)} if third else {})


def drawing(case: Case) -> Draw:
    """Draw the plots of realisations of a case; NaN also where a further sonar does not measure the coordinate."""
    spec, scene = case.spec, build_scene(case)
    world, detections, polar = study.world(case, scene), study.detections(case, scene), spec.frame == "polar"
    names = columns(spec)[0][1:]

    def draw(first: int, count: int) -> Drawn:
        plots, deviation = study.drawn_plots(world, detections, first, count, source_row=0 if polar else 1)
        plots, truth = plots[: len(names)], study.truth_of(scene, deviation, count, 3)
        if polar:
            exact = [truth[..., 3 * c] for c in range(len(names))]
        else:
            exact = [np.broadcast_to(true, plots.shape[1:]) for true in scene.polar[..., 0].T]
            plots += scene.polar[..., 0].T[:, None]
        if not np.isfinite(scene.sigma).all():
            plots.swapaxes(1, 2)[~np.isfinite(scene.sigma.T)] = np.nan
        true_plots = {f"true_{name}": column for name, column in zip(names, exact, strict=True)}
        return Drawn(scene.t, dict(zip(names, plots, strict=True)), study.labels(spec, 3), truth, true_plots, first)

    return draw


class DerivedQuantities(NamedTuple):
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

    most_rows = MAX_ROWS
    several = False

    def __init__(self, case: Case):
        self.spec: Any = case.spec

    def specs(self) -> list[filters.FilterSpec]:
        """The filters."""
        return filter_specs(self.spec)

    def derived(self, t: np.ndarray, x: np.ndarray, P: np.ndarray, is_known: np.ndarray) -> DerivedQuantities:
        """Quantities derived from the tracks; here none.

        t (n,) from the first plot; x (F, n, C, 3), P (F, n, C, 3, 3) and is_known (F, n, C, 3)."""
        no_quantities = np.zeros((*x.shape[:2], 0))
        return DerivedQuantities((), no_quantities, no_quantities)

    def feed(self, columns: Mapping[str, np.ndarray]) -> Track:
        """The estimates over all rows: columns (n,), NaN where a value is missing."""
        spec, specs = self.spec, self.specs()
        t = columns["t_s"] - columns["t_s"][0]
        z, weight, sigma = plots_in_filter_frame(spec, list(columns.values())[1:])
        x, P, is_known = _estimate_tracks(specs, t, spec.sensor.scan_period_s, z, weight, sigma)
        size = max(filter_spec.size for filter_spec in specs)
        flat = (len(specs), len(t), len(z) * size)
        variance = np.diagonal(P, axis1=3, axis2=4)
        estimate = np.where(is_known, x, np.nan)[..., :size].reshape(flat)
        spread = np.where(is_known, np.sqrt(np.maximum(variance, 0.0)), np.nan)[..., :size].reshape(flat)
        derived = self.derived(t, x, P, is_known)
        residual, nis, believed = self._residuals(z, weight, sigma, estimate[..., ::size], spread[..., ::size])
        measures = tuple(sigmas(spec))
        return Track(
            filters=tuple(member.name for member in spec.filters),
            components=(*study.labels(spec, size), *derived.names),
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
        """Residuals, their normalised squares and their σ (F, n, C), of plots z (C, n).

        value and spread (F, n, C) are the estimates and their σ."""
        residual = np.where(weight > 0, z, np.nan).T[None] - value
        with np.errstate(divide="ignore", invalid="ignore"):
            variance = np.where(weight > 0, sigma[:, None] ** 2 / weight, np.nan).T[None]
            freedom = variance - spread**2
            # For least squares and Kalman filters the residual after the update has variance R - P, and its normalised
            # square equals that of the innovation.
            nis = np.where(freedom > MIN_FREEDOM * variance, residual**2 / freedom, np.nan)
        has_no_residual_law = [member.kind not in OPTIMAL_KINDS for member in self.spec.filters]
        nis[has_no_residual_law] = np.nan
        believed = np.sqrt(np.maximum(freedom, 0.0))
        believed[has_no_residual_law] = np.nan
        return residual, nis, believed


def _estimate_tracks(
    specs: Sequence[filters.FilterSpec],
    t: np.ndarray,
    period: float,
    z: np.ndarray,
    weight: np.ndarray,
    sigma: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Estimates (F, n, C, 3), covariances (F, n, C, 3, 3) and which are known (F, n, C, 3), from plots z (C, n)."""
    plots = [filters.Plots(t, w[None], period, unit) for w, unit in zip(weight, sigma, strict=True)]
    x, P = np.zeros((len(specs), len(t), len(z), 3)), np.zeros((len(specs), len(t), len(z), 3, 3))
    is_known = np.zeros(x.shape, dtype=bool)
    responding = [f for f, filter_spec in enumerate(specs) if filter_spec.response]
    if responding:
        x[responding], P[responding] = estimate_recorded([specs[f] for f in responding], t, period, sigma, z, weight)
    for f, filter_spec in enumerate(specs):
        for c in range(len(z)):
            if not filter_spec.response:
                x[f, :, c], P[f, :, c] = filters.apply_filter(filter_spec, c, plots[c], z[c])
            is_known[f, :, c] = np.arange(3) < np.minimum(plots[c].moments()[0], filter_spec.size)[:, None]
    return x, P, is_known


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
    x, Y, further_rows = (np.zeros((F, C, rows, steps.CHUNK)) for rows in (4, 8, detector.ROWS))
    memory = steps.Filters(x, Y, further_rows, np.empty((6, steps.CHUNK)))
    recent, T = np.zeros((C, 3, bank.memory, steps.ROW)), np.zeros((len(detectors.plots), C + 1, steps.CHUNK))
    count = np.zeros((C, steps.CHUNK))
    estimates, covariances = np.zeros((F, n, C, 3)), np.zeros((F, n, C, 3, 3))
    scale = period ** -np.arange(3.0)
    packed = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
    for k, dt in enumerate(np.diff(t, prepend=t[0])):
        plot, w = (np.repeat(values[:, k : k + 1], steps.CHUNK, axis=1) for values in (z, weight))
        previous_count, count = count, count + (w > 0)
        for c in range(C if bank.memory else 0):
            steps.remember_plots(recent[c], plot[c], w[c], dt / period)
        detector.detector_statistics(detectors, k, recent, sigma, count, w, T)
        plots = steps.Plots(plot, w, previous_count, count, recent, T)
        for f, c in np.ndindex(F, C):
            patterns.filter_scan(bank, f, c, k, dt, memory, plots)
            estimates[f, k, c] = x[f, c, :3, 0]
            covariances[f, k, c] = memory.P[packed, 0] * sigma[c] ** 2 * np.outer(scale, scale)
    return estimates, covariances


def plots_in_filter_frame(spec: Keys, columns: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Plots (C, n), their weights (C, n), zero where missing, and nominal σ (C,), in the frame of the filters."""
    sensor = spec.sensor
    third, third_sigma = third_coordinate(sensor)
    sigma = np.array([sensor.sigma_range_m, sensor.sigma_bearing_rad, *([third_sigma] if third else [])])
    z = np.stack(columns)
    z[1] = unwrap_bearings(z[1])
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


def unwrap_bearings(bearing: np.ndarray) -> np.ndarray:
    """Bearings (n,) without jumps of a full turn between neighbouring plots; gaps stay."""
    is_measured = np.isfinite(bearing)
    out = bearing.copy()
    out[is_measured] = np.unwrap(bearing[is_measured])
    return out


class PlotLikelihood:
    """The likelihood of tracks under a filter's model.

    A polynomial of the filter's degree in each coordinate, whose next derivative is random, and independent errors of
    range, bearing and a third coordinate. The state before the first complete plot is taken as unknown."""

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
        sigma |= {THIRD_COLUMN_AND_KEY[third][1]: third_sigma} if third else {}
        self.coordinates = len(sigma)
        configured = list(sigma.values())
        smallest = [MIN_SIGMA_SHARE * configured_sigma for configured_sigma in sigma.values()]
        names = list(sigma)
        if member.kind == "kalman":
            names.append(f"filters.{number}.manoeuvre_variance")
            configured.append(member.manoeuvre_variance or 0.0)
            smallest.append(MIN_MANOEUVRE_SHARE * (sensor.sigma_range_m / sensor.scan_period_s**self.size) ** 2)
        self.keys, self.stated, self.least = tuple(names), np.array(configured), np.array(smallest)
        problems = (self._problem(list(columns.values()), scale) for columns in tracks)
        self.problems = [problem for problem in problems if problem is not None]

    def _problem(self, columns: Sequence[np.ndarray], scale: np.ndarray) -> "_TrackProblem | None":
        """A track from its first complete plot on; None if it has none."""
        t, *values = columns
        is_whole = np.isfinite(np.stack(values)).all(axis=0)
        if not is_whole.any():
            return None
        first, C, size = int(is_whole.argmax()), self.coordinates, self.size
        t, z = t[first:], np.stack(values)[:, first:]
        z[1] = unwrap_bearings(z[1])
        is_used = np.isfinite(z).T.copy()
        if self.spec.frame != "polar":
            is_used[:, :2] = is_used[:, :2].all(axis=1, keepdims=True)
        steps = np.diff(t, prepend=t[0])
        eye = np.eye(C)
        F = np.stack([np.kron(eye, transition(step, size)) for step in steps])
        Q = np.stack([np.kron(np.diag(scale), manoeuvre_covariance(1.0, step, size)) for step in steps])
        settled = int(np.searchsorted(np.cumsum(is_whole[first:]), STARTING_PLOTS, side="right"))
        usual_interval_s = float(np.median(steps[1:])) if len(steps) > 1 else self.spec.sensor.scan_period_s
        rates = WIDE_RATE_SIGMAS * usual_interval_s ** -np.arange(1.0, size)
        is_used[0] = False  # it starts the track
        second_whole = int(is_whole[first + 1 :].argmax()) + 1 if is_whole[first + 1 :].any() else 0
        problem = _TrackProblem(F, Q, np.where(np.isfinite(z), z, 0.0), is_used, t - t[0], rates, second_whole, settled)
        _, directions, variance = self._numbers(problem, self.stated[:C])  # the stated errors, whatever is tried
        position_sigma = np.sqrt(np.diag(directions[0].T @ np.diag(variance[0]) @ directions[0]))
        return problem._replace(rates=np.outer(rates, position_sigma))

    def _numbers(self, problem: "_TrackProblem", sigma: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions (n, C) in the frame of the filters, independent directions, and variances (n, C) along these.

        The directions (n, C, C) are rows."""
        n, C = problem.is_used.shape
        directions, variance = np.tile(np.eye(C), (n, 1, 1)), np.tile(sigma**2, (n, 1))
        positions = problem.z.T.copy()
        if self.spec.frame != "polar":
            convert = world.converted if self.spec.frame == "cartesian" else world.converted_unbiased
            x, y, _ = convert(*problem.z[:2], *sigma[:2])
            xx, xy, yy = convert(*(problem.z[:2] if self.spec.frame == "cartesian" else world.places(*problem.z[:2])),
                                 *sigma[:2])[2]  # fmt: skip
            values, vectors = np.linalg.eigh(np.stack([xx, xy, xy, yy], axis=1).reshape(n, 2, 2))
            positions[:, 0], positions[:, 1] = x, y
            variance[:, :2], directions[:, :2, :2] = np.maximum(values, 0.0), np.swapaxes(vectors, 1, 2)
        return positions, directions, variance

    def _score(self, values: np.ndarray, outliers: float, correlation: float = 0.0) -> float:
        sigma, C, size = values[: self.coordinates], self.coordinates, self.size
        manoeuvre, total = float(values[C]) if len(values) > C else 0.0, 0.0
        for problem in self.problems:
            positions, directions, variance = self._numbers(problem, sigma)
            H = np.zeros((*directions.shape[:2], C * size))
            H[:, :, ::size] = directions
            z = np.einsum("nij,nj->ni", directions, positions)
            x, P = np.zeros(C * size), np.zeros((C * size, C * size))
            x[::size] = positions[0]
            if problem.second_whole:
                x[1::size] = (positions[problem.second_whole] - positions[0]) / problem.t[problem.second_whole]
            start = directions[0].T @ np.diag(variance[0]) @ directions[0]
            P[::size, ::size] = start
            for i, rate in enumerate(problem.rates, start=1):
                P[np.arange(C) * size + i, np.arange(C) * size + i] = rate**2
            model, scale, white = (x, P, problem.F, problem.Q, H), manoeuvre, 1.0
            if correlation:
                error_loading = np.zeros((C * size, C))
                coordinates = np.arange(C)
                error_loading[coordinates * size, coordinates] = -sigma
                shares = correlation ** (np.diff(problem.t, prepend=0.0) / self.usual_s)
                model = lasting(x, P, error_loading, problem.F, manoeuvre * problem.Q, H, variance, shares)
                scale, white = 1.0, 0.0
            score = np.empty(z.shape)
            log_likelihood(*model, z, variance, problem.is_used, scale, outliers, white, score)
            total += float(score[problem.settled :].sum())
        return total

    def __call__(self, values: np.ndarray, outliers: float = 0.0, bias: float = 0.0, correlation: float = 0.0) -> float:
        """The logarithm of the likelihood; a bias is not part of the model."""
        return self._score(values, outliers, correlation)

    def by_number(self, values: np.ndarray) -> dict[str, float]:
        """The logarithm of the likelihood of complete plots: their numbers are not independent in every frame."""
        return {"plot": self._score(values, 0.0)}


class _TrackProblem(NamedTuple):
    """A recorded track as the kernel needs it, from its first complete plot on."""

    F: np.ndarray  #: (n, d, d) transitions
    Q: np.ndarray  #: (n, d, d) process noise of unit variance
    z: np.ndarray  #: (C, n) values as measured
    is_used: np.ndarray  #: (n, C) which values update the state
    t: np.ndarray  #: (n,) from the first plot
    rates: np.ndarray  #: (size - 1, C) σ of the rates of each order before the first plot
    second_whole: int  #: row of the second complete plot, 0 if there is none
    settled: int  #: row from which the state is known


def likelihood(
    case: Case, filter_name: str | None, tracks: Sequence[Mapping[str, np.ndarray]]
) -> PlotLikelihood | None:
    """The likelihood of tracks under a filter; without a name, under the first Kalman filter with a manoeuvre variance.

    Without such a filter, under the first one that models the target. None if the filter does not model it."""
    members = case.spec.filters
    candidates = [i for i, member in enumerate(members) if member.kind in MODELLED_KINDS and member.association is None]
    if filter_name is None:
        kalman = [i for i in candidates if members[i].kind == "kalman" and members[i].manoeuvre_variance]
        candidates = [*kalman, *candidates][:1]
    else:
        candidates = [i for i in candidates if members[i].name == filter_name]
    return PlotLikelihood(case, candidates[0], tracks) if candidates else None


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
