"""P3 (Butyrskiy): smoothing and extrapolation of sonar plots, missed plots, correlated errors.

Sums of F filters over K scans and components (coordinate by coordinate: value, rate and, where a filter has it,
acceleration): `error`, `paired`, `estimates` as everywhere; `believed` Σ of the variances that the filter claims; by
coordinate C: `joint` Σq, Σq², Σp, Σp² of q = eᵀP⁻¹e and p the product of the errors in value and rate, and `ahead` Σe
… Σe⁴ of the value extrapolated by one scan, in the row of the scan that it was extrapolated from. Cases with detectors,
filters that respond to manoeuvres or uses have the sums of `sonar_manoeuvre` beside; those whose filters have to find
their plots among false ones are of `sonar_clutter`.
"""

from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.moments import Layout
from radarsim.engine.results import Axes, Track
from radarsim.studies.noise import noise_key
from radarsim.studies.sonar import banks, filters
from radarsim.studies.sonar import world as models
from radarsim.studies.sonar.clutter import study as clutter
from radarsim.studies.sonar.exact_values import exact_values
from radarsim.studies.sonar.kernels import patterns as pattern_kernels
from radarsim.studies.sonar.kernels import shared_gains as kernels
from radarsim.studies.sonar.manoeuvre import study as manoeuvres
from radarsim.studies.sonar.manoeuvre.config import RESPONDING_KINDS
from radarsim.studies.sonar.responding import estimate_recorded
from radarsim.studies.sonar.scene import Scene, filter_specs, patterns, plots_of, scene, third_of

BLOCK = 4096
NAMES = {
    "polar": (("r", "m"), ("b", "rad")),
    "cartesian": (("x", "m"), ("y", "m")),
    "cartesian_unbiased": (("x", "m"), ("y", "m")),
}
THIRD = {"depth": ("d", "m"), "elevation": ("e", "rad")}


@dataclass(frozen=True)
class Plan:
    """All that a block needs; `observation` and `detector_plan` are None where all realisations share their gains."""

    layout: Layout
    axes: Axes
    world: kernels.World
    bank: tuple
    observation: tuple | None
    size: int
    believed: np.ndarray | None
    detector_plan: manoeuvres.DetectorPlan | None = None
    block: int = BLOCK

    @property
    def gaussian(self) -> bool:
        """Whether errors are Gaussian with the exact bias and σ of the axes, where these are known."""
        return self.observation is None and self.detector_plan is None


def prepare(case: Case) -> Plan | clutter.Plan:
    """Design the filters of a case and reckon the exact values of its errors."""
    spec, seen = case.spec, scene(case.spec)
    if spec.tracking:
        return clutter.prepare(case, seen, world(case, seen))
    specs = manoeuvres.with_manoeuvre_response(spec, filter_specs(spec))
    size = max(one.size for one in specs)
    F, K, C = len(specs), len(seen.t), seen.truth.shape[1]
    shared = spec.frame == "polar" and (seen.certain >= 0).all() and not spec.manoeuvring
    if shared:
        detected, probability = np.maximum(seen.certain, 0)[None], np.ones(1)
    else:
        detected, probability = patterns(seen) if spec.frame == "polar" else (np.zeros((0, 0)), np.zeros(0))
    designs = [_designs(one, seen, detected) for one in specs]
    detector_plan = None if shared else manoeuvres.detector_plan(spec, seen, specs)
    if shared:
        bank, claimed = banks.shared_bank(specs, designs), [[one.covariance[0] for one in row] for row in designs]
    else:
        bank, claimed = banks.per_realisation_bank(specs, seen.t, seen.period, seen.nominal, detector_plan.tests), None
    layout = Layout(
        **dict.fromkeys(("paired", "estimates", "believed"), (F, K, C * size)),
        **{"error": (F, K, C * size, 4), "joint": (F, K, C, 4), "ahead": (F, K, C, 4)},
        **(manoeuvres.shapes(detector_plan, F) if detector_plan else {}),
    )
    made = axes(spec, seen, specs, exact_values(seen, designs, probability, size), bank.known if shared else None)
    if spec.manoeuvring:
        made.extra.update(manoeuvres.told(detector_plan, detected, probability))
    return Plan(
        layout=layout,
        axes=made,
        world=world(case, seen),
        bank=bank,
        observation=None if shared else observation(case, seen),
        size=size,
        believed=np.diagonal(claimed, axis1=3, axis2=4).transpose(0, 2, 1, 3) if shared else None,
        detector_plan=detector_plan,
    )


def _designs(one: banks.FilterSpec, seen: Scene, detected: np.ndarray) -> list[banks.FilterDesign]:
    """The designs of a filter by coordinate for all patterns of plots; none where gains depend on the plots' values."""
    if not len(detected) or one.kind in RESPONDING_KINDS:
        return []
    return [banks.design_filter(one, c, plots_of(seen, c, detected)) for c in range(len(seen.nominal))]


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


def axes(spec, seen: Scene, specs: list[banks.FilterSpec], values: dict, known: np.ndarray | None) -> Axes:
    """Labels and exact values, as `exact_values` gives them; known (F, K, C) components, or as many as may be."""
    F, K, C, size = values["sigma"].shape
    detected = (seen.certain != 0).astype(float)[None]  # what may come
    degree = np.array([one.size for one in specs])
    if known is None:
        most = np.stack([plots_of(seen, c, detected).moments()[0] for c in range(C)], axis=1)
        known = np.minimum(most[None], degree[:, None, None])
    available = known[..., None] > np.arange(size)
    names = tuple(f.name for f in spec.filters)
    flat = (F, K, C * size)
    return Axes(
        filters=names,
        components=labels(spec, size),
        k=np.arange(1, K + 1),
        t_s=seen.t,
        available=available.reshape(flat),
        baseline=names.index(spec.baseline) if spec.baseline else 0,
        exact_sigma=np.where(available, values["sigma"], np.nan).reshape(flat),
        exact_bias=np.where(available, values["bias"], np.nan).reshape(flat),
        extra={
            "coordinates": coordinates(spec),
            "sizes": degree,
            "exact_ahead": values["ahead"],
            "exact_nees": values["nees"],
            "scan_period_s": seen.period,
            "sigma": seen.nominal,
            "rho": seen.rho,
            "sigma_of_plots": np.where(detected.T > 0, seen.sigma, np.inf),
            "conversion_bias": plain_bias(spec, seen),
            "truth": seen.truth,
            "polar": seen.polar,
        },
    )


def coordinates(spec) -> tuple[tuple[str, str], ...]:
    """Names and units of the coordinates that the filters work in."""
    third, _ = third_of(spec.sensor)
    return (*NAMES[spec.frame], *([THIRD[third]] if third else []))


def labels(spec, size: int) -> tuple[tuple[str, str], ...]:
    """Names and units of all components: each coordinate with its rate and, for size 3, its acceleration."""
    rates = (("", ""), ("v", "/s"), ("a", "/s2"))[:size]
    return tuple((before + name, unit + after) for name, unit in coordinates(spec) for before, after in rates)


def plain_bias(spec, seen: Scene) -> float:
    """Mean error, along the line of sight, of the converted first plot, m; nought for the unbiased conversion."""
    plain = spec.frame == "cartesian"
    return float(models.conversion_bias(seen.polar[0, 0, 0], spec.sensor.sigma_bearing_rad)) if plain else 0.0


def simulate(plan: Plan | clutter.Plan, first: int, count: int) -> np.ndarray:
    """Sums of one block, in the order of the plan's layout."""
    if isinstance(plan, clutter.Plan):
        return clutter.simulate(plan, first, count)
    F, K = len(plan.axes.filters), len(plan.axes.k)
    C = len(plan.axes.extra["coordinates"])
    shapes = {"error": (3, 4), "paired": (3,), "joint": (4,), "ahead": (4,), "believed": (3,), "estimates": (3,)}
    sums = kernels.Sums(**{name: np.zeros((F, K, C, *tail)) for name, tail in shapes.items()})
    added = {}
    if plan.observation is None:
        kernels.simulate_block(plan.world, plan.bank, first, count, plan.axes.baseline, sums)
        sums.believed[:] = count * plan.believed
        sums.estimates[:] = count * (plan.bank.known[..., None] > np.arange(3))
    else:
        detector_plan = plan.detector_plan
        world = plan.world, plan.observation, plan.bank, detector_plan.detectors
        block = manoeuvres.empty_sums(detector_plan, sums, count)
        pattern_kernels.simulate_block(*world, first, count, plan.axes.baseline, block)
        added = manoeuvres.added_up(detector_plan, block)
    picked = {
        name: getattr(sums, name)[:, :, :, : plan.size].reshape(plan.layout.shapes[name])
        for name in ("error", "paired", "believed", "estimates")
    }
    return plan.layout.pack(**picked, joint=sums.joint, ahead=sums.ahead, **added)


def plot_columns(spec) -> tuple[tuple[str, ...], ...]:
    """The columns that `track` reads of a file of recorded plots."""
    third, _ = third_of(spec.sensor)
    more = {"depth": ("depth_m",), "elevation": ("elevation_rad",)}.get(third, ())
    return (("t_s", "range_m", "bearing_rad", *more),)


def track(case: Case, recorded: dict[str, np.ndarray]) -> Track:
    """The filters of a case over recorded plots: columns of equal length (n,), not-a-number where a value is missing.

    Bearings are made continuous from plot to plot, so an estimate may leave -pi … pi. In the cartesian frames a plot
    needs both range and bearing. Further sonars of the config play no part: all plots are taken as the first one's.
    """
    spec, t = case.spec, recorded["t_s"] - recorded["t_s"][0]
    specs, columns = manoeuvres.with_manoeuvre_response(spec, filter_specs(spec)), list(recorded.values())[1:]
    z, weight, sigma = measured(spec, columns)
    plots = [filters.Plots(t, w[None], spec.sensor.scan_period_s, unit) for w, unit in zip(weight, sigma, strict=True)]
    size, period = max(one.size for one in specs), spec.sensor.scan_period_s
    x, P = np.zeros((len(specs), len(t), len(z), 3)), np.zeros((len(specs), len(t), len(z), 3, 3))
    known = np.zeros(x.shape, dtype=bool)
    responding = [f for f, one in enumerate(specs) if one.response]
    if responding:
        x[responding], P[responding] = estimate_recorded([specs[f] for f in responding], t, period, sigma, z, weight)
    for f, one in enumerate(specs):
        for c in range(len(z)):
            if not one.response:
                x[f, :, c], P[f, :, c] = banks.apply_filter(one, c, plots[c], z[c])
            known[f, :, c] = np.arange(3) < np.minimum(plots[c].moments()[0], one.size)[:, None]
    variance = np.diagonal(P, axis1=3, axis2=4)
    estimate, spread = np.where(known, x, np.nan), np.where(known, np.sqrt(np.maximum(variance, 0.0)), np.nan)
    flat, components = (len(specs), len(t), len(z) * size), labels(spec, size)
    estimate, spread = estimate[..., :size].reshape(flat), spread[..., :size].reshape(flat)
    if spec.uses is not None:
        found = manoeuvres.uses_of(spec, t, x, P, known)
        components += manoeuvres.QUANTITIES
        estimate, spread = (np.concatenate(pair, axis=2) for pair in zip((estimate, spread), found, strict=True))
    return Track(tuple(f.name for f in spec.filters), components, recorded["t_s"], estimate, spread)


def measured(spec, columns: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Plots (C, n), their weights (C, n), zero where missing, and nominal σ (C,), in the frame that the filters work
    in.
    """
    sensor = spec.sensor
    third, other = third_of(sensor)
    sigma = np.array([sensor.sigma_range_m, sensor.sigma_bearing_rad, *([other] if third else [])])
    z = np.stack(columns)
    z[1] = continuous(z[1])
    weight = np.isfinite(z).astype(float)
    if spec.frame != "polar":
        detected = np.flatnonzero(weight[:2].all(axis=0))
        plain = spec.frame == "cartesian" or not len(detected)
        place = z[:2, detected] if plain else models.places(*z[:2, detected])
        convert = models.converted if spec.frame == "cartesian" else models.converted_unbiased
        x, y, _ = convert(*z[:2, detected], *sigma[:2])
        xx, _, yy = convert(*place, *sigma[:2])[2]
        weight[:2], z[:2] = 0.0, 0.0
        sigma[:2] = np.sqrt([xx[0], yy[0]]) if len(detected) else 1.0
        z[0, detected], z[1, detected] = x, y
        weight[0, detected], weight[1, detected] = sigma[0] ** 2 / xx, sigma[1] ** 2 / yy
    return np.where(weight > 0, z, 0.0), weight, sigma


def continuous(bearing: np.ndarray) -> np.ndarray:
    """Bearings (n,) without jumps of a full turn between neighbouring plots; gaps stay."""
    seen = np.isfinite(bearing)
    out = bearing.copy()
    out[seen] = np.unwrap(bearing[seen])
    return out
