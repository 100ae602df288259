"""P3's second half: tracks among false and missed plots.

Sums besides those of `sonar.study`, where errors are of the tracks kept (confirmed, and on the target): `counts`,
`begun`, `ratios`, `scores`, see `kernels.counts`.
"""

from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.moments import Layout
from radarsim.studies.noise import noise_key
from radarsim.studies.sonar import study as base
from radarsim.studies.sonar.clutter import exact
from radarsim.studies.sonar.clutter import filters as design
from radarsim.studies.sonar.clutter.axes import ClutterAxes
from radarsim.studies.sonar.clutter.kernels import counts
from radarsim.studies.sonar.clutter.kernels import tracker as kernels
from radarsim.studies.sonar.clutter.kernels.field import Field
from radarsim.studies.sonar.clutter.world import observation_of
from radarsim.studies.sonar.exact_values import exact_values
from radarsim.studies.sonar.kernels.patterns import Observation
from radarsim.studies.sonar.kernels.shared_gains import World
from radarsim.studies.sonar.scene import Scene, angular, filter_specs, scene

COORDINATES, SIZE = 2, 2  # range and bearing, each a straight line


@dataclass(frozen=True)
class Plan:
    """A plan of trackers: the world with the target's plots, false plots about it, and about false tracks.

    seeds (2,) is the key of the stream of false tracks' first plots.
    """

    layout: Layout
    axes: ClutterAxes
    world: World
    observation: Observation
    field: Field
    other_field: Field
    seeds: np.ndarray
    trackers: kernels.Trackers
    block: int = base.BLOCK
    gaussian = False

    def simulate(self, first: int, count: int) -> np.ndarray:
        """Sums of one block, in the order of the layout."""
        F, K = len(self.axes.filters), len(self.axes.k)
        sums = base.empty_sums(F, K, COORDINATES)
        own = {name: np.zeros(shape) for name, shape in counts.shapes(F, K, len(self.axes.thresholds)).items()}
        track_sums, work = counts.TrackSums(sums, **own), kernels.workspace(F)
        looked_at = (self.world, self.observation, self.field, self.trackers)
        kernels.simulate_block(*looked_at, work, first, count, track_sums)
        if self.field.density > 0:
            false = (self.seeds, self.other_field, self.trackers)
            kernels.simulate_false(*false, work, self.world.dt, first, count, track_sums)
        return base.packed(self.layout, sums, **own)


def prepare(case: Case) -> Plan:
    """Design the trackers of a case, and compute the exact laws of their errors and of initiation."""
    spec, seen = case.spec, scene(case.spec)
    sensor, specs, world = spec.sensor, tracker_specs(spec), base.world(case, seen)
    F, K = len(specs), len(seen.t)
    density = sensor.false_plots_per_km2 / 1e6
    observation = observation_of(case, seen)
    fields = [design.field(noise_key(case, name), sensor.sector, density, seen.nominal) for name in ("false", "seeds")]
    common = base.shapes(F, K, COORDINATES, SIZE)
    layout = Layout(
        **{name: common[name] for name in ("error", "estimates", "believed", "joint", "ahead")},
        **counts.shapes(F, K, len(design.THRESHOLDS)),
    )
    return Plan(
        layout=layout,
        axes=axes(spec, seen, specs, world, observation, fields[0]),
        world=world,
        observation=observation,
        field=fields[0],
        other_field=fields[1],
        seeds=noise_key(case, "places"),
        trackers=design.trackers(specs, seen.period, seen.nominal, sensor.detection_probability, density),
    )


def tracker_specs(spec) -> list[design.TrackerSpec]:
    """The trackers of a case."""
    return [
        design.TrackerSpec(
            f.association,
            f.tracker("gate_probability"),
            *f.m_of_n(),
            int(f.tracker("drop_after_misses")),
            f.tracker("speed_mps"),
            f.tracker("lost_beyond_sigmas"),
            (f.manoeuvre_variance or 0.0) * angular(spec, 2),
        )
        for f in spec.filters
    ]


def axes(
    spec, seen: Scene, specs: list[design.TrackerSpec], world: World, observation: Observation, field: Field
) -> ClutterAxes:
    """Labels, exact σ of an oracle's filters where every plot's coming is certain, exact laws of initiation."""
    F, K = len(specs), len(seen.t)
    values = oracle_values(spec, seen, observation.certain)
    least = np.array([2 if one.association == "known" else one.m for one in specs])
    available = np.repeat((np.arange(1, K + 1) >= least[:, None])[..., None], COORDINATES * SIZE, axis=2)
    confirmed, begun = initiation_laws(spec, seen, specs, observation.certain)
    flat = (F, K, COORDINATES * SIZE)
    return ClutterAxes(
        filters=tuple(f.name for f in spec.filters),
        components=base.labels(spec, SIZE),
        k=np.arange(1, K + 1),
        t_s=seen.t,
        available=available,
        baseline=base.baseline(spec),
        exact_sigma=np.where(available, values["sigma"].reshape(flat), np.nan),
        exact_bias=np.where(available, values["bias"].reshape(flat), np.nan),
        coordinates=base.coordinates(spec),
        sizes=np.full(F, SIZE),
        exact_ahead=values["ahead"],
        exact_nees=values["nees"],
        scan_period_s=seen.period,
        sigma=seen.nominal,
        associations=tuple(one.association for one in specs),
        thresholds=design.THRESHOLDS,
        exact_confirmed=confirmed,
        exact_begun=begun,
        area_m2=spec.sensor.sector.area_m2(),
        world=world,
        observation=observation,
        field=field,
    )


def initiation_laws(
    spec, seen: Scene, specs: list[design.TrackerSpec], certain: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Probabilities (F, K) that a track of the target was confirmed by each scan, and one begun by a false plot at it.

    Not-a-number where no law is known: the first needs open gates and no false plots, the second a rule 2 of n.
    """
    F, K = len(specs), len(seen.t)
    sector, density = spec.sensor.sector, spec.sensor.false_plots_per_km2 / 1e6
    probability = np.where(certain < 0, seen.probability, certain)
    confirmed, begun = np.full((F, K), np.nan), np.full((F, K), np.nan)
    for f, one in enumerate(specs):
        if one.association == "known":
            continue
        if density == 0 and one.gate_probability == 1:
            confirmed[f] = exact.confirmed_by(probability, one.m, one.n)
        if one.m == 2:
            begun[f] = exact.false_pairs(sector.range_m, sector.bearing_rad, density, seen.nominal, one, seen.period, K)
    return confirmed, begun


def oracle_values(spec, seen: Scene, certain: np.ndarray) -> dict[str, np.ndarray]:
    """Exact errors, as `exact_values` gives them, of filters that are given the target's plots."""
    known = np.array([f.association == "known" for f in spec.filters])
    if (certain < 0).any() or certain[0] == 0 or not known.any():
        return exact_values(seen, [[]] * len(known), np.zeros(0), SIZE)
    designs = base.designs(filter_specs(spec), seen, certain[None].astype(float))
    values = exact_values(seen, designs, np.ones(1), SIZE)
    return {name: np.where(known.reshape(-1, *[1] * (v.ndim - 1)), v, np.nan) for name, v in values.items()}
