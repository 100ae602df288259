"""Simulated plots, and filters over recorded plots that are known to be the target's."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.studies.missed_scans import leading_empty_rows, with_missed_scans
from radarsim.studies.plot_arrays import DrawPlots, SimulatedPlots
from radarsim.studies.recording_interface import Track, with_rows_before
from radarsim.studies.sonar import conversion, detector_arrays, filter_banks, filter_design, kernel_inputs, labels
from radarsim.studies.sonar.config import Keys
from radarsim.studies.sonar.kernels import chunks, detector, imm, realisation_gains, steps, windows
from radarsim.studies.sonar.scene import build_scene, filter_specs, third_coordinate

MAX_ROWS = 200_000  # of a file: the designs of all rows are held in memory
RANGE, BEARING = "sensor.sigma_range_m", "sensor.sigma_bearing_rad"
THIRD_COLUMN_AND_KEY = {
    "depth": ("depth_m", "sensor.sigma_depth_m"),
    "elevation": ("elevation_rad", "sensor.sigma_elevation_rad"),
}
OPTIMAL_KINDS = ("growing_memory", "window", "kalman")  # their residuals have a known variance if errors are white
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


def simulated_plots(case: Case) -> DrawPlots:
    """Draw the plots of realisations of a case; NaN also where a further sonar does not measure the coordinate."""
    spec, scene = case.spec, build_scene(case)
    world, detections, polar = (
        kernel_inputs.kernel_world(case, scene),
        kernel_inputs.kernel_detections(case, scene),
        spec.frame == "polar",
    )
    names = columns(spec)[0][1:]

    def draw(first: int, count: int) -> SimulatedPlots:
        plots, deviation = kernel_inputs.draw_plots(world, detections, first, count, source_row=0 if polar else 1)
        plots, truth = plots[: len(names)], kernel_inputs.true_states(scene, deviation, count, 3)
        if polar:
            exact = [truth[..., 3 * c] for c in range(len(names))]
        else:
            exact = [np.broadcast_to(true, plots.shape[1:]) for true in scene.polar[..., 0].T]
            plots += scene.polar[..., 0].T[:, None]
        if not np.isfinite(scene.sigma).all():
            plots.swapaxes(1, 2)[~np.isfinite(scene.sigma.T)] = np.nan
        true_plots = {f"true_{name}": column for name, column in zip(names, exact, strict=True)}
        return SimulatedPlots(
            scene.t, dict(zip(names, plots, strict=True)), labels.labels(spec, 3), truth, true_plots, first
        )

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

    def specs(self) -> list[filter_design.FilterSpec]:
        """The filters."""
        return filter_specs(self.spec)

    def derived(self, t: np.ndarray, x: np.ndarray, P: np.ndarray, is_known: np.ndarray) -> DerivedQuantities:
        """Quantities derived from the tracks; here none.

        t (n,) from the first plot; x (F, n, C, 3), P (F, n, C, 3, 3) and is_known (F, n, C, 3)."""
        no_quantities = np.zeros((*x.shape[:2], 0))
        return DerivedQuantities((), no_quantities, no_quantities)

    def feed(self, columns: Mapping[str, np.ndarray]) -> Track:
        """The estimates over all rows: columns (n,), NaN where a value is missing; empty rows before the first plot
        begin nothing."""
        if empty := leading_empty_rows(columns):
            track = self.feed({name: column[empty:] for name, column in columns.items()})
            return with_rows_before(track, columns["t_s"])
        spec, specs = self.spec, self.specs()
        t, period = columns["t_s"] - columns["t_s"][0], spec.sensor.scan_period_s
        z, weight, sigma = plots_in_filter_frame(spec, list(columns.values())[1:])
        times, rows = with_missed_scans(t, period)
        all_z, all_weights = np.zeros((2, len(z), len(times)))
        all_z[:, rows], all_weights[:, rows] = z, weight
        estimates = _estimate_tracks(specs, times, period, all_z, all_weights, sigma)
        x, P, is_known = (part[:, rows] for part in estimates)
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
            components=(*labels.labels(spec, size), *derived.names),
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
    specs: Sequence[filter_design.FilterSpec],
    t: np.ndarray,
    period: float,
    z: np.ndarray,
    weight: np.ndarray,
    sigma: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Estimates (F, n, C, 3), covariances (F, n, C, 3, 3) and which are known (F, n, C, 3), from plots z (C, n)."""
    plots = [filter_design.Plots(t, w[None], period, unit) for w, unit in zip(weight, sigma, strict=True)]
    x, P = np.zeros((len(specs), len(t), len(z), 3)), np.zeros((len(specs), len(t), len(z), 3, 3))
    is_known = np.zeros(x.shape, dtype=bool)
    responding = [f for f, filter_spec in enumerate(specs) if filter_spec.response]
    if responding:
        x[responding], P[responding] = estimate_recorded([specs[f] for f in responding], t, period, sigma, z, weight)
    for f, filter_spec in enumerate(specs):
        for c in range(len(z)):
            if not filter_spec.response:
                x[f, :, c], P[f, :, c] = filter_design.apply_filter(filter_spec, c, plots[c], z[c])
            is_known[f, :, c] = np.arange(3) < np.minimum(plots[c].moments()[0], filter_spec.size)[:, None]
    return x, P, is_known


def estimate_recorded(
    specs: Sequence[filter_design.FilterSpec],
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
    detectors = detector_arrays.detector_arrays([], filter_banks.needed_tests(specs), np.zeros(n, dtype=np.int64), C)
    bank = filter_banks.per_realisation_bank(specs, t, period, sigma, detectors)
    x, Y, further_rows = (np.zeros((F, C, rows, chunks.CHUNK)) for rows in (4, 8, imm.ROWS))
    memory = steps.Filters(x, Y, further_rows, np.empty((6, chunks.CHUNK)))
    recent, T = (np.zeros((C, 3, bank.memory, chunks.ROW)), np.zeros((len(detectors.plots), C + 1, chunks.CHUNK)))
    count = np.zeros((C, chunks.CHUNK))
    estimates, covariances = np.zeros((F, n, C, 3)), np.zeros((F, n, C, 3, 3))
    scale = period ** -np.arange(3.0)
    packed = np.array([[0, 1, 2], [1, 3, 4], [2, 4, 5]])
    for k, dt in enumerate(np.diff(t, prepend=t[0])):
        plot, w = (np.repeat(values[:, k : k + 1], chunks.CHUNK, axis=1) for values in (z, weight))
        previous_count, count = count, count + (w > 0)
        for c in range(C if bank.memory else 0):
            windows.remember_plots(recent[c], plot[c], w[c], dt / period)
        detector.detector_statistics(detectors, k, recent, sigma, count, w, T)
        plots = steps.Plots(plot, w, previous_count, count, recent, T)
        for f, c in np.ndindex(F, C):
            realisation_gains.filter_scan(bank, f, c, k, dt, memory, plots)
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
        convert = conversion.convert_plainly if spec.frame == "cartesian" else conversion.convert_unbiased
        x, y, _ = convert(*plots, *sigma[:2])
        position = plots if spec.frame == "cartesian" or not len(detected) else conversion.weighting_positions(*plots)
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
