"""P3 (Butyrskiy): what its parts compute in common: the kernels' world, labels and exact values, sums of errors.

Sums of F filters over K scans and components (coordinate by coordinate: value, rate and, where a filter has it,
acceleration): `error`, `paired`, `estimates` as everywhere; `believed` Σ of the variances that the filter believes; by
coordinate C: `joint` Σq, Σq², Σp, Σp² of q = eᵀP⁻¹e and p the product of the errors in value and rate, and `ahead` Σe
… Σe⁴ of the value extrapolated by one scan, in the row of the scan that it was extrapolated from.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.moments import Layout
from radarsim.studies.noise import noise_key
from radarsim.studies.sonar import banks
from radarsim.studies.sonar import world as models
from radarsim.studies.sonar.axes import GivenPlotsAxes
from radarsim.studies.sonar.kernels import detector as detector_kernels
from radarsim.studies.sonar.kernels import patterns as pattern_kernels
from radarsim.studies.sonar.kernels import shared_gains as kernels
from radarsim.studies.sonar.scene import Scene, patterns, plots_of, third_of

BLOCK = 4096
NAMES = {
    "polar": (("r", "m"), ("b", "rad")),
    "cartesian": (("x", "m"), ("y", "m")),
    "cartesian_unbiased": (("x", "m"), ("y", "m")),
}
THIRD = {"depth": ("d", "m"), "elevation": ("e", "rad")}


# ---- what the kernels look at -------------------------------------------------------------------------------------
def world(case: Case, seen: Scene) -> kernels.World:
    """The kernels' world; its coordinates are padded to an even number."""
    K, C = seen.sigma.shape
    wide = C + C % 2
    measured = np.isfinite(seen.sigma)
    sigma = np.where(measured, seen.sigma, 0.0)
    steps = np.stack([models.step_correlations(rho, seen.t, seen.period) for rho in seen.rho], axis=1)
    fresh, truth, walk = np.zeros((K, wide)), np.zeros((K, wide, 3)), np.zeros(wide)
    fresh[:, :C], truth[:, :C], walk[:C] = sigma * np.sqrt(1 - steps**2), seen.truth, seen.walk
    padded = np.zeros((K, wide))
    padded[:, :C] = steps
    dt = np.diff(seen.t, prepend=seen.t[0])
    return kernels.World(noise_key(case, "plots"), noise_key(case, "motion"), dt, truth, padded, fresh, walk)


def observation(case: Case, seen: Scene) -> pattern_kernels.Observation:
    """Which plots come and how they are converted, for filters that go along with each realisation."""
    frame = ("polar", "cartesian", "cartesian_unbiased").index(case.spec.frame)
    return pattern_kernels.Observation(
        misses=noise_key(case, "misses"),
        certain=seen.certain,
        probability=seen.probability,
        weight=(seen.nominal / seen.sigma) ** 2,
        period=seen.period,
        sigma=seen.nominal,
        frame=frame,
        measured=np.ascontiguousarray(seen.polar[:, :2, 0]),
        spread=seen.sigma[0, :2].copy(),
    )


def detection_patterns(spec, seen: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Patterns (M, K') of plots over which exact values are means, and their probabilities (M,).

    None in the cartesian frames: weights go with the plots there, and nothing is known.
    """
    return patterns(seen) if spec.frame == "polar" else (np.zeros((0, 0)), np.zeros(0))


def designs(specs: Sequence[banks.FilterSpec], seen: Scene, detected: np.ndarray) -> list[list[banks.FilterDesign]]:
    """The designs of each filter by coordinate, for patterns detected (M, K') of plots.

    A filter has none where there is no pattern, or where it responds to manoeuvres: its gains depend on the plots.
    """
    coordinates = range(len(seen.nominal)) if len(detected) else ()
    return [
        [banks.design_filter(one, c, plots_of(seen, c, detected)) for c in coordinates if one.response is None]
        for one in specs
    ]


# ---- labels -------------------------------------------------------------------------------------------------------
def coordinates(spec) -> tuple[tuple[str, str], ...]:
    """Names and units of the coordinates that the filters work in."""
    third, _ = third_of(spec.sensor)
    return (*NAMES[spec.frame], *([THIRD[third]] if third else []))


def labels(spec, size: int) -> tuple[tuple[str, str], ...]:
    """Names and units of all components: each coordinate with its rate and, for size 3, its acceleration."""
    rates = (("", ""), ("v", "/s"), ("a", "/s2"))[:size]
    return tuple((before + name, unit + after) for name, unit in coordinates(spec) for before, after in rates)


def baseline(spec) -> int:
    """Place of the filter that gains are against."""
    return [one.name for one in spec.filters].index(spec.baseline) if spec.baseline else 0


def axes(
    spec, seen: Scene, specs: Sequence[banks.FilterSpec], values: Mapping[str, np.ndarray], known: np.ndarray | None
) -> GivenPlotsAxes:
    """Labels and exact values, as `exact_values` gives them; known (F, K, C) components, or as many as may be."""
    F, K, C, size = values["sigma"].shape
    detected = (seen.certain != 0).astype(float)[None]  # what may come
    degree = np.array([one.size for one in specs])
    if known is None:
        most = np.stack([plots_of(seen, c, detected).moments()[0] for c in range(C)], axis=1)
        known = np.minimum(most[None], degree[:, None, None])
    available = known[..., None] > np.arange(size)
    flat = (F, K, C * size)
    return GivenPlotsAxes(
        filters=tuple(f.name for f in spec.filters),
        components=labels(spec, size),
        k=np.arange(1, K + 1),
        t_s=seen.t,
        available=available.reshape(flat),
        baseline=baseline(spec),
        exact_sigma=np.where(available, values["sigma"], np.nan).reshape(flat),
        exact_bias=np.where(available, values["bias"], np.nan).reshape(flat),
        coordinates=coordinates(spec),
        sizes=degree,
        exact_ahead=values["ahead"],
        exact_nees=values["nees"],
        scan_period_s=seen.period,
        sigma=seen.nominal,
        rho=seen.rho,
        sigma_of_plots=np.where(detected.T > 0, seen.sigma, np.inf),
        conversion_bias=plain_bias(spec, seen),
        polar=seen.polar,
    )


def plain_bias(spec, seen: Scene) -> float:
    """Mean error, along the line of sight, of the converted first plot, m; zero for the unbiased conversion."""
    plain = spec.frame == "cartesian"
    return float(models.conversion_bias(seen.polar[0, 0, 0], spec.sensor.sigma_bearing_rad)) if plain else 0.0


# ---- sums ---------------------------------------------------------------------------------------------------------
def shapes(F: int, K: int, C: int, size: int) -> dict[str, tuple[int, ...]]:
    """Shapes of the sums that all cases with gains have, of F filters with `size` components a coordinate at most."""
    found = dict.fromkeys(("paired", "estimates", "believed"), (F, K, C * size))
    return found | {"error": (F, K, C * size, 4), "joint": (F, K, C, 4), "ahead": (F, K, C, 4)}


def empty_sums(F: int, K: int, C: int) -> kernels.Sums:
    """What the kernels add to: three components a coordinate, whatever the filters estimate."""
    tails = {"error": (3, 4), "paired": (3,), "joint": (4,), "ahead": (4,), "believed": (3,), "estimates": (3,)}
    return kernels.Sums(**{name: np.zeros((F, K, C, *tail)) for name, tail in tails.items()})


def packed(layout: Layout, sums: kernels.Sums, **more: np.ndarray) -> np.ndarray:
    """The sums of a block in the order of a layout, of which it may leave some out; more: those of one part alone."""
    size = layout.shapes["error"][2] // sums.error.shape[2]
    found = dict(more)
    for name, values in sums._asdict().items():
        if name in layout.shapes:
            own = values if name in ("joint", "ahead") else values[:, :, :, :size]
            found[name] = own.reshape(layout.shapes[name])
    return layout.pack(**found)


@dataclass(frozen=True)
class RealisationPlan:
    """A plan of filters whose gains go along with each realisation's own plots.

    kept (A,) are the scans at which estimates are kept for further sums of a block.
    """

    layout: Layout
    axes: GivenPlotsAxes
    world: kernels.World
    bank: pattern_kernels.RealisationBank
    observation: pattern_kernels.Observation
    detectors: detector_kernels.Detectors
    kept: np.ndarray
    block: int = BLOCK
    gaussian = False

    def simulate(self, first: int, count: int) -> np.ndarray:
        """Sums of one block, in the order of the layout."""
        return packed(self.layout, self.added(first, count).errors)

    def added(self, first: int, count: int) -> pattern_kernels.BlockSums:
        """What the kernels add up in one block."""
        F, K, C = self.bank.carry.shape
        D, G, T = self.detectors.threshold.shape
        alarms = detector_kernels.Alarms(np.zeros((D, G, K)), np.zeros((D, G, T, K)), np.zeros((D, G, T, K)))
        estimates = np.zeros((len(self.kept), F, 2, 6, count))
        sums = pattern_kernels.BlockSums(empty_sums(F, K, C), alarms, np.zeros((F, K, C, 3)), self.kept, estimates)
        looked_at = (self.world, self.observation, self.bank, self.detectors)
        pattern_kernels.simulate_block(*looked_at, first, count, self.axes.baseline, sums)
        return sums
