"""P3's second half: tracks among false and missed plots.

Sums besides those of `studies.sonar`, where errors are of the tracks kept (confirmed, and on the target): `counts` (F,
K, COUNTS), `begun` (F, K, 3), `ratios` (F, 2, 5), `scores` (2, F, T + 1); see `kernels.sonar_clutter`.
"""

from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.moments import Layout
from radarsim.engine.results import Axes
from radarsim.studies.noise import noise_key
from radarsim.studies.sonar import banks
from radarsim.studies.sonar.clutter import exact
from radarsim.studies.sonar.clutter import filters as design
from radarsim.studies.sonar.clutter.kernels import tracker as kernels
from radarsim.studies.sonar.clutter.kernels.field import Field
from radarsim.studies.sonar.clutter.track import COMPONENTS, observation_of, realisation_map, tracker_specs
from radarsim.studies.sonar.exact_values import exact_values
from radarsim.studies.sonar.kernels import patterns as pattern_kernels
from radarsim.studies.sonar.kernels import shared_gains as sonar_kernels
from radarsim.studies.sonar.scene import Scene, filter_specs, plots_of

BLOCK = 4096
COORDINATES = (("r", "m"), ("b", "rad"))


@dataclass(frozen=True)
class Plan:
    """All that a block needs: the world with the target's plots, false plots about it, and about false tracks."""

    layout: Layout
    axes: Axes
    world: sonar_kernels.World
    observation: pattern_kernels.Observation
    field: Field
    other_field: Field
    seeds: np.ndarray
    trackers: kernels.Trackers
    block: int = BLOCK
    gaussian = False


def prepare(case: Case, seen: Scene, world: sonar_kernels.World) -> Plan:
    """Design the trackers of a case, given its scene and the world of its target's plots."""
    spec = case.spec
    sensor, wanted = spec.sensor, tracker_specs(spec)
    F, K, T = len(wanted), len(seen.t), len(design.THRESHOLDS)
    density = sensor.false_plots_per_km2 / 1e6
    observation = observation_of(case, seen)
    fields = [design.field(noise_key(case, name), sensor.sector, density, seen.nominal) for name in ("false", "seeds")]
    layout = Layout(
        **{"error": (F, K, 4, 4), "estimates": (F, K, 4), "believed": (F, K, 4)},
        **{"joint": (F, K, 2, 4), "ahead": (F, K, 2, 4)},
        counts=(F, K, kernels.COUNTS),
        begun=(F, K, kernels.FALSE_COUNTS),
        ratios=(F, 2, 5),
        scores=(2, F, T + 1),
    )
    return Plan(
        layout=layout,
        axes=axes(
            spec,
            seen,
            observation.certain,
            wanted,
            lambda: realisation_map(spec, world, observation, fields[0], wanted),
        ),
        world=world,
        observation=observation,
        field=fields[0],
        other_field=fields[1],
        seeds=noise_key(case, "places"),
        trackers=design.trackers(wanted, seen.period, seen.nominal, sensor.detection_probability, density),
    )


def axes(spec, seen: Scene, certain: np.ndarray, wanted: list[design.TrackerSpec], realisation) -> Axes:
    """Labels, exact σ of an oracle's filters where every plot's coming is certain, exact laws of initiation."""
    F, K = len(wanted), len(seen.t)
    values = oracle_values(spec, seen, certain)
    least = np.array([2 if w.association == "known" else w.m for w in wanted])
    available = np.repeat((np.arange(1, K + 1) >= least[:, None])[..., None], 4, axis=2)
    names = tuple(f.name for f in spec.filters)
    sector, density = spec.sensor.sector, spec.sensor.false_plots_per_km2 / 1e6
    probability = np.where(certain < 0, seen.probability, certain)
    confirmed = np.full((F, K), np.nan)
    begun = np.full((F, K), np.nan)
    for f, one in enumerate(wanted):
        if one.association == "known":
            continue
        if density == 0 and one.gate_probability == 1:
            confirmed[f] = exact.confirmed_by(probability, one.m, one.n)
        if one.m == 2:
            begun[f] = exact.false_pairs(sector.range_m, sector.bearing_rad, density, seen.nominal, one, seen.period, K)
    return Axes(
        filters=names,
        components=COMPONENTS,
        k=np.arange(1, K + 1),
        t_s=seen.t,
        available=available,
        baseline=names.index(spec.baseline) if spec.baseline else 0,
        exact_sigma=np.where(available, values["sigma"].reshape(F, K, 4), np.nan),
        exact_bias=np.where(available, values["bias"].reshape(F, K, 4), np.nan),
        extra={
            "coordinates": COORDINATES,
            "sizes": np.full(F, 2),
            "exact_ahead": values["ahead"],
            "exact_nees": values["nees"],
            "scan_period_s": seen.period,
            "sigma": seen.nominal,
            "rho": seen.rho,
            "sigma_of_plots": seen.sigma,
            "conversion_bias": 0.0,
            "truth": seen.truth,
            "polar": seen.polar,
            "thresholds": design.THRESHOLDS,
            "associations": tuple(one.association for one in wanted),
            "exact_confirmed": confirmed,
            "exact_begun": begun,
            "area_m2": sector.area_m2(),
            "realisation": realisation,
        },
    )


def oracle_values(spec, seen: Scene, certain: np.ndarray) -> dict[str, np.ndarray]:
    """Exact errors, as `exact_values` gives them, of filters that are told which plots are the target's."""
    known = np.array([f.association == "known" for f in spec.filters])
    if (certain < 0).any() or certain[0] == 0 or not known.any():
        return exact_values(seen, [[]] * len(known), np.zeros(0), 2)
    detected = certain[None].astype(float)
    designs = [
        [banks.design_filter(one, c, plots_of(seen, c, detected)) for c in range(2)] for one in filter_specs(spec)
    ]
    values = exact_values(seen, designs, np.ones(1), 2)
    return {name: np.where(known.reshape(-1, *[1] * (v.ndim - 1)), v, np.nan) for name, v in values.items()}


def simulate(plan: Plan, first: int, count: int) -> np.ndarray:
    """Sums of one block, in the order of the plan's layout."""
    F, K = len(plan.axes.filters), len(plan.axes.k)
    shapes = {"error": (3, 4), "paired": (3,), "joint": (4,), "ahead": (4,), "believed": (3,), "estimates": (3,)}
    sums = sonar_kernels.Sums(**{name: np.zeros((F, K, 2, *tail)) for name, tail in shapes.items()})
    own = ("counts", "begun", "ratios", "scores")
    track_sums = kernels.TrackSums(sums, **{name: np.zeros(plan.layout.shapes[name]) for name in own})
    work = kernels.workspace(F)
    kernels.simulate_block(plan.world, plan.observation, plan.field, plan.trackers, work, first, count, track_sums)
    if plan.field.density > 0:
        kernels.simulate_false(
            plan.seeds, plan.other_field, plan.trackers, work, plan.world.dt, first, count, track_sums
        )
    picked = {
        name: getattr(sums, name)[:, :, :, :2].reshape(plan.layout.shapes[name])
        for name in ("error", "believed", "estimates")
    }
    return plan.layout.pack(
        **picked, joint=sums.joint, ahead=sums.ahead, **{name: getattr(track_sums, name) for name in own}
    )
