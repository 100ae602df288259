"""P3 (Butyrskiy): smoothing, and what all parts compute: arrays for the kernels, labels, exact values, sums of errors.

Sums of F filters over K scans and components (for each coordinate: value, rate and, where a filter has it,
acceleration): `error`, `paired`, `estimates` as in every study; `believed` Σ of the variances that the filter believes.
For each of C coordinates: `joint` Σq, Σq², Σp, Σp² of q = eᵀP⁻¹e and of p, the product of the errors in value and rate;
and `ahead` Σe … Σe⁴ of the value extrapolated by one scan, in the row of the scan that it is extrapolated from."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Layout
from radarsim.studies.noise import noise_key
from radarsim.studies.sonar import filters
from radarsim.studies.sonar.config import Keys
from radarsim.studies.sonar.exact import exact_values
from radarsim.studies.sonar.kernels import detector, patterns, shared_gains
from radarsim.studies.sonar.scene import Scene, build_scene, filter_specs, third_coordinate
from radarsim.studies.sonar.world import GivenPlotsAxes, conversion_bias, step_correlations

BLOCK = 4096
FRAMES = ("polar", "cartesian", "cartesian_unbiased")
THIRD = {"depth": ("d", "m"), "elevation": ("e", "rad")}


# ---- what the kernels observe -------------------------------------------------------------------------------------
def world(case: Case, scene: Scene) -> shared_gains.World:
    """The kernels' world; its coordinates are padded to an even number."""
    K, C = scene.sigma.shape
    wide = C + C % 2
    fresh, truth, walk, steps = np.zeros((K, wide)), np.zeros((K, wide, 3)), np.zeros(wide), np.zeros((K, wide))
    for c in range(C):
        steps[:, c] = step_correlations(scene.rho[c], scene.t, scene.period)
    sigma = np.where(np.isfinite(scene.sigma), scene.sigma, 0.0)
    fresh[:, :C], truth[:, :C], walk[:C] = sigma * np.sqrt(1 - steps[:, :C] ** 2), scene.truth, scene.walk
    dt = np.diff(scene.t, prepend=scene.t[0])
    return shared_gains.World(noise_key(case, "plots"), noise_key(case, "motion"), dt, truth, steps, fresh, walk)


def detections(case: Case, scene: Scene) -> patterns.Detections:
    """Which scans give a plot."""
    return patterns.Detections(noise_key(case, "misses"), scene.certain, scene.probability)


def conversion(case: Case, scene: Scene) -> patterns.Conversion:
    """How plots are converted to the frame of the filters."""
    return patterns.Conversion(
        weight=(scene.nominal / scene.sigma) ** 2,
        frame=FRAMES.index(case.spec.frame),
        measured=np.ascontiguousarray(scene.polar[:, :2, 0]),
        spread=scene.sigma[0, :2].copy(),
    )


def designs(
    specs: Sequence[filters.FilterSpec], scene: Scene, detected: np.ndarray
) -> list[list[filters.FilterDesign]]:
    """The designs of each filter in each coordinate, for patterns detected (M, K') of plots.

    A filter that responds to manoeuvres has no design, because its gains depend on the plots."""
    return [
        [filters.design_filter(spec, c, scene.plots(c, detected)) for c in range(len(scene.nominal))]
        if spec.response is None
        else []
        for spec in specs
    ]


def drawn_plots(
    world: shared_gains.World, detections: patterns.Detections, first: int, count: int, source_row: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Draw the plots (C, count, K) of realisations first … first + count - 1, or their errors (source_row 1).

    NaN where a scan gives no plot. Also returns the deviation of the target's value and rate (C, 2, count, K), or
    (C, 2, 1, 1) if no target moves at random. C is the world's padded number of coordinates."""
    K, C = world.fresh.shape
    plots, deviation = np.empty((C, K, count)), np.zeros((C, 2, K, count) if world.walk.any() else (C, 2, 1, 1))
    patterns.fill_plots(world, detections, first, source_row, plots, deviation)
    return plots.swapaxes(1, 2), deviation.swapaxes(2, 3)


def truth_of(scene: Scene, deviation: np.ndarray, count: int, size: int) -> np.ndarray:
    """True states (count, K, C size), with size components of each coordinate, by a deviation from `drawn_plots`.

    A read-only view if all realisations have the same states."""
    K, C, _ = scene.truth.shape
    true = scene.truth[..., :size].reshape(K, -1)
    if deviation.shape[-1] == 1:
        return np.broadcast_to(true, (count, K, C * size))
    states = np.empty((C * size, K, count))
    states[:] = true.T[..., None]
    states.reshape(C, size, K, count)[:, :2] += deviation[:C].swapaxes(2, 3)
    return states.transpose(2, 1, 0)


# ---- labels -------------------------------------------------------------------------------------------------------
def coordinates(spec: Keys) -> tuple[tuple[str, str], ...]:
    """Names and units of the coordinates that the filters work in."""
    third, _ = third_coordinate(spec.sensor)
    first_two = (("r", "m"), ("b", "rad")) if spec.frame == "polar" else (("x", "m"), ("y", "m"))
    return (*first_two, *([THIRD[third]] if third else []))


def labels(spec: Keys, size: int) -> tuple[tuple[str, str], ...]:
    """Names and units of all components: each coordinate with its rate and, for size 3, its acceleration."""
    rates = (("", ""), ("v", "/s"), ("a", "/s2"))[:size]
    return tuple((prefix + name, unit + per) for name, unit in coordinates(spec) for prefix, per in rates)


def common_labels(
    spec: Keys, scene: Scene, sizes: np.ndarray, available: np.ndarray, values: Mapping[str, np.ndarray]
) -> dict[str, Any]:
    """The fields of `SonarAxes`, by name; available (F, K, C, size), values as `exact_values` returns them."""
    F, K, C, size = available.shape
    flat = (F, K, C * size)
    names = tuple(member.name for member in spec.filters)
    return {
        "filters": names,
        "components": labels(spec, size),
        "k": np.arange(1, K + 1),
        "t_s": scene.t,
        "available": available.reshape(flat),
        "baseline": names.index(spec.baseline) if spec.baseline else 0,
        "exact_sigma": np.where(available, values["sigma"], np.nan).reshape(flat),
        "exact_bias": np.where(available, values["bias"], np.nan).reshape(flat),
        "coordinates": coordinates(spec),
        "sizes": sizes,
        "exact_ahead": values["ahead"],
        "exact_nees": values["nees"],
        "scan_period_s": scene.period,
        "sigma": scene.nominal,
    }


def axes(
    spec: Keys,
    scene: Scene,
    specs: Sequence[filters.FilterSpec],
    values: Mapping[str, np.ndarray],
    estimated_sizes: np.ndarray | None = None,
) -> GivenPlotsAxes:
    """Labels and exact values of a case.

    estimated_sizes (F, K, C): numbers of estimated components, by default as many as the plots may determine."""
    size = values["sigma"].shape[3]
    possible = (scene.certain != 0).astype(float)[None]
    sizes = np.array([filter_spec.size for filter_spec in specs])
    if estimated_sizes is None:
        times = [scene.plots(c, possible).moments()[0] for c in range(len(scene.nominal))]
        estimated_sizes = np.minimum(np.stack(times, axis=1)[None], sizes[:, None, None])
    plain = spec.frame == "cartesian"
    return GivenPlotsAxes(
        **common_labels(spec, scene, sizes, estimated_sizes[..., None] > np.arange(size), values),
        rho=scene.rho,
        sigma_of_plots=np.where(possible.T > 0, scene.sigma, np.inf),
        conversion_bias=float(conversion_bias(scene.polar[0, 0, 0], spec.sensor.sigma_bearing_rad)) if plain else 0.0,
        polar=scene.polar,
    )


# ---- sums ---------------------------------------------------------------------------------------------------------
def shapes(F: int, K: int, C: int, size: int) -> dict[str, tuple[int, ...]]:
    """Shapes of the sums of all cases with gains, for F filters with at most `size` components in a coordinate."""
    sums = dict.fromkeys(("paired", "estimates", "believed"), (F, K, C * size))
    return sums | {"error": (F, K, C * size, 4), "joint": (F, K, C, 4), "ahead": (F, K, C, 4)}


def empty_sums(F: int, K: int, C: int) -> shared_gains.Sums:
    """The sums that the kernels add to: always three components in a coordinate."""
    tails = {"error": (3, 4), "paired": (3,), "joint": (4,), "ahead": (4,), "believed": (3,), "estimates": (3,)}
    return shared_gains.Sums(**{name: np.zeros((F, K, C, *tail)) for name, tail in tails.items()})


def packed(layout: Layout, sums: shared_gains.Sums, **more: np.ndarray) -> np.ndarray:
    """The sums of a block in the order of a layout, without those that it does not contain; more: sums of one part."""
    size = layout.shapes["error"][2] // sums.error.shape[2]
    arrays = dict(more)
    for name, values in sums._asdict().items():
        if name in layout.shapes:
            part = values if name in ("joint", "ahead") else values[:, :, :, :size]
            arrays[name] = part.reshape(layout.shapes[name])
    return layout.pack(**{name: values for name, values in arrays.items() if name in layout.shapes})


def of_components(errors: np.ndarray) -> np.ndarray:
    """Reorder errors (F, K, C, S, n) to (F, n, K, C S)."""
    return np.moveaxis(errors.reshape(*errors.shape[:2], -1, errors.shape[4]), 3, 1)


@dataclass(frozen=True)
class RealisationPlan:
    """A plan of filters whose gains differ between realisations; kept (A,) are the scans whose estimates are stored."""

    layout: Layout
    axes: GivenPlotsAxes
    world: shared_gains.World
    detections: patterns.Detections
    conversion: patterns.Conversion
    bank: patterns.RealisationBank
    detectors: detector.Detectors
    kept: np.ndarray
    block: int = BLOCK
    gaussian = False

    def simulate(self, first: int, count: int) -> np.ndarray:
        """The sums of one block, in the order of the layout."""
        return packed(self.layout, self.block_sums(first, count).errors)

    def errors(self, first: int, count: int) -> np.ndarray:
        """The errors (F, count, K, C S) of one block's realisations."""
        return of_components(self.block_sums(first, count, count).realisation_errors)

    def block_sums(self, first: int, count: int, error_count: int = 0) -> patterns.BlockSums:
        """The sums of one block as the kernels compute them, and the errors of all its realisations or of none."""
        F, K, C = self.bank.carry.shape
        D, G, T = self.detectors.threshold.shape
        alarms = detector.Alarms(np.zeros((D, G, K)), np.zeros((D, G, T, K)), np.zeros((D, G, T, K)))
        estimates = np.zeros((len(self.kept), F, 2, 6, count))
        errors = np.full((F, K, C, int(self.bank.size.max()), error_count), np.nan)
        modes = np.zeros((F, K, C, 3))
        sums = patterns.BlockSums(empty_sums(F, K, C), alarms, modes, self.kept, estimates, errors)
        inputs = (self.world, self.detections, self.conversion, self.bank, self.detectors)
        patterns.simulate_block(*inputs, first, count, self.axes.baseline, sums)
        return sums


def realisation_plan(
    case: Case, scene: Scene, specs: Sequence[filters.FilterSpec], detectors: detector.Detectors
) -> RealisationPlan:
    """The plan of a case whose gains differ between realisations, with exact values by patterns of plots.

    No values are known in the cartesian frames, where weights depend on the plots."""
    spec, (K, C), size = case.spec, scene.sigma.shape, max(filter_spec.size for filter_spec in specs)
    if spec.frame == "polar":
        detected, probability = scene.patterns()
        values = exact_values(scene, designs(specs, scene, detected), probability, size)
    else:
        values = exact_values(scene, [[]] * len(specs), np.zeros(0), size)
    return RealisationPlan(
        layout=Layout(**shapes(len(specs), K, C, size)),
        axes=axes(spec, scene, specs, values),
        world=world(case, scene),
        detections=detections(case, scene),
        conversion=conversion(case, scene),
        bank=filters.per_realisation_bank(specs, scene.t, scene.period, scene.nominal, detectors),
        detectors=detectors,
        kept=np.zeros(0, dtype=np.int64),
    )


# ---- smoothing -----------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class SharedPlan:
    """A plan of filters whose gains all realisations share; believed (F, K, C, 3) are their variances."""

    layout: Layout
    axes: GivenPlotsAxes
    world: shared_gains.World
    bank: shared_gains.SharedBank
    believed: np.ndarray
    block: int = BLOCK
    gaussian = True

    def simulate(self, first: int, count: int) -> np.ndarray:
        """The sums of one block, in the order of the layout."""
        sums, _ = self._simulated(first, count, 0)
        sums.believed[:] = count * self.believed
        sums.estimates[:] = count * (self.bank.known[..., None] > np.arange(3))
        return packed(self.layout, sums)

    def errors(self, first: int, count: int) -> np.ndarray:
        """The errors (F, count, K, C S) of one block's realisations."""
        return of_components(self._simulated(first, count, count)[1])

    def _simulated(self, first: int, count: int, error_count: int) -> tuple[shared_gains.Sums, np.ndarray]:
        """The sums of one block, and the errors (F, K, C, S, error_count) of all its realisations or of none."""
        sums = empty_sums(*self.bank.known.shape)
        errors = np.empty((*self.bank.known.shape, self.bank.size.max(), error_count))
        shared_gains.simulate_block(self.world, self.bank, first, count, self.axes.baseline, sums, errors)
        return sums, errors


def prepare(case: Case) -> SharedPlan | RealisationPlan:
    """Design the filters of a case and compute the exact values of its errors."""
    scene, specs = build_scene(case), filter_specs(case.spec)
    if case.spec.frame == "polar" and (scene.certain >= 0).all():
        return _shared_plan(case, scene, specs)
    K, C = scene.sigma.shape
    return realisation_plan(case, scene, specs, filters.detector_arrays([], [], np.zeros(K, dtype=np.int64), C))


def _shared_plan(case: Case, scene: Scene, specs: list[filters.FilterSpec]) -> SharedPlan:
    size = max(filter_spec.size for filter_spec in specs)
    designs_by_filter = designs(specs, scene, np.maximum(scene.certain, 0)[None])
    bank = filters.shared_bank(specs, designs_by_filter)
    F, K, C = bank.known.shape
    covariance = np.array([[design.covariance[0] for design in row] for row in designs_by_filter])
    values = exact_values(scene, designs_by_filter, np.ones(1), size)
    return SharedPlan(
        layout=Layout(**shapes(F, K, C, size)),
        axes=axes(case.spec, scene, specs, values, bank.known),
        world=world(case, scene),
        bank=bank,
        believed=np.diagonal(covariance, axis1=3, axis2=4).transpose(0, 2, 1, 3),
    )
