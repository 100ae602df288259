"""Plots of cases among false ones: the trackers over recorded plots, and over those of one realisation."""

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Track
from radarsim.errors import ConfigError
from radarsim.studies.noise import noise_key
from radarsim.studies.sonar.clutter import filters as design
from radarsim.studies.sonar.clutter.kernels.field import Field, whole_field
from radarsim.studies.sonar.clutter.multitrack import confirmed_tracks
from radarsim.studies.sonar.kernels import patterns as pattern_kernels
from radarsim.studies.sonar.kernels import shared_gains as sonar_kernels
from radarsim.studies.sonar.scene import Scene, angular

COMPONENTS = (("r", "m"), ("vr", "m/s"), ("b", "rad"), ("vb", "rad/s"))
NEAR_M = 2500.0  # of the target's course: what the map shows
EVERY = 4  # scans between the gates that it shows


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


def target_plots(world: sonar_kernels.World, observation: pattern_kernels.Observation, realisation: int):
    """Plots (K, 2) of the target in one realisation, not-a-number where missed, and its true places (K, 2)."""
    K, plots, detected = len(world.dt), np.zeros((2, 4, 1)), np.empty(1)
    z, true = np.full((K, 2), np.nan), world.truth[:, :2, 0].copy()
    for k in range(K):
        sonar_kernels.move_and_measure(world, realisation, k, plots)
        pattern_kernels.detect(observation, realisation, k, detected)
        true[k] += plots[:, 2, 0]
        if detected[0]:
            z[k] = plots[:, 0, 0]
    return z, true


def false_plots(field: Field, realisation: int, scan: int) -> np.ndarray:
    """All false plots (2, n) of a scan, range and bearing."""
    if field.density == 0:
        return np.zeros((2, 0))
    room = np.empty((2, int(20 + 2 * field.density * field.dq * field.nq * field.db * field.nb)))
    n = whole_field(field, realisation, scan, *room)
    while n > room.shape[1]:
        room = np.empty((2, n))
        n = whole_field(field, realisation, scan, *room)
    return room[:, :n]


def realisation_map(spec, world, observation, field: Field, wanted: list[design.TrackerSpec]) -> dict:
    """Realisation 0 for the map, as seen by the first tracker that is not told its plots: what lies near the course.

    Places are (north, east) in m: truth and plots (2, K), false (2, n), tracks and gates lists of such curves.
    """
    z, true = target_plots(world, observation, 0)
    course = _flat(*true.T)
    (south, north), (west, east) = ((side.min() - NEAR_M, side.max() + NEAR_M) for side in course)
    scans, seen = [], []
    for k, t in enumerate(np.cumsum(world.dt)):
        r, b = false_plots(field, 0, k)
        x, y = _flat(r, b)
        near = (south < x) & (x < north) & (west < y) & (y < east)
        seen.append(np.stack([x[near], y[near]]))
        own = z[k][:, None] if np.isfinite(z[k, 0]) else np.zeros((2, 0))
        scans.append((t, *np.concatenate([own, np.stack([r[near], b[near]])], axis=1)))
    f = next((i for i, one in enumerate(wanted) if one.association != "known"), None)
    lives = [] if f is None else confirmed_tracks(wanted[f], *_conditions(spec), scans)
    tracks, gates = [], []
    for life in lives:
        states = np.array(life.states)
        tracks.append(_flat(states[:, 0], states[:, 2]))
        gates += [_ellipse(g, wanted[f]) for k, g in zip(life.scans, life.gates, strict=True) if not k % EVERY]
    return {
        "tracker": "" if f is None else spec.filters[f].name,
        "truth": course,
        "plots": _flat(*z[np.isfinite(z[:, 0])].T),
        "false": np.concatenate(seen, axis=1),
        "tracks": tracks,
        "gates": [gate for gate in gates if np.isfinite(gate[0]).all()],
        "window": ((south, north), (west, east)),
    }


def _flat(r: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ways north and east."""
    return r * np.cos(b), r * np.sin(b)


def _ellipse(gate: np.ndarray, tracker: design.TrackerSpec) -> tuple[np.ndarray, np.ndarray]:
    """A gate's edge on the map; of an open gate a small circle."""
    angle, (r, b, rr, rb, bb) = np.linspace(0, 2 * np.pi, 61), gate
    size = np.sqrt(design.gate_threshold(min(tracker.gate_probability, 0.9999)))
    low = rb / np.sqrt(rr)
    u, v = size * np.cos(angle), size * np.sin(angle)
    return _flat(r + np.sqrt(rr) * u, b + low * u + np.sqrt(max(bb - low**2, 0.0)) * v)


def _conditions(spec) -> tuple[float, np.ndarray, float, float]:
    """Period, σ of a plot (2,), detection probability, density per m²."""
    sensor = spec.sensor
    sigma = np.array([sensor.sigma_range_m, sensor.sigma_bearing_rad])
    return sensor.scan_period_s, sigma, sensor.detection_probability, sensor.false_plots_per_km2 / 1e6


def track(case: Case, recorded: dict[str, np.ndarray]) -> Track:
    """The trackers of a case over recorded plots, several of a time: every confirmed track, from its first plot on.

    A row without range or bearing is no plot, but its time is a scan. A tracker that would have to be told its plots is
    left out; raises ConfigError where there is no other. What tracks are is said in `clutter.multitrack`.
    """
    spec, wanted = case.spec, tracker_specs(case.spec)
    some = [f for f, one in enumerate(wanted) if one.association != "known"]
    if not some:
        raise ConfigError(
            f"{case.name}: filters: nobody can tell which plots are the target's: nearest or pda is needed"
        )
    t, at = np.unique(recorded["t_s"], return_inverse=True)
    plots = np.stack([recorded["range_m"], recorded["bearing_rad"]])
    there = np.isfinite(plots).all(axis=0)
    scans = [(time, *plots[:, there & (at == k)]) for k, time in enumerate(t)]
    lives = [
        (f, n + 1, life) for f in some for n, life in enumerate(confirmed_tracks(wanted[f], *_conditions(spec), scans))
    ]
    estimate, sigma = np.full((2, len(lives), len(t), 4), np.nan)
    score = np.full((len(lives), len(t)), np.nan)
    for i, (_, _, life) in enumerate(lives):
        estimate[i, life.scans], sigma[i, life.scans] = life.states, np.sqrt(life.variances)
        score[i, life.scans] = life.scores
    names = tuple(spec.filters[f].name for f, _, _ in lives)
    return Track(names, COMPONENTS, t, estimate, sigma, numbers=np.array([n for _, n, _ in lives]), score=score)


def simulated(case: Case, seen: Scene, world, realisation: int) -> dict[str, np.ndarray]:
    """All plots of one realisation in the sector, in order of time and bearing, as the columns of a file of plots.

    true_target is 1 for the target's plots, 0 for false ones; true_range_m and true_bearing_rad are the target's. A
    scan without a plot has one row without values.
    """
    spec = case.spec
    observation = observation_of(case, seen)
    field = design.field(noise_key(case, "false"), spec.sensor.sector, _conditions(spec)[3], seen.nominal)
    z, true = target_plots(world, observation, realisation)
    rows = []
    for k, t in enumerate(seen.t):
        own = [(z[k, 0], z[k, 1], 1.0)] if np.isfinite(z[k, 0]) else []
        scan = [*own, *((r, b, 0.0) for r, b in false_plots(field, realisation, k).T)] or [(np.nan, np.nan, np.nan)]
        rows += [(t, r, b, whose, *true[k]) for r, b, whose in sorted(scan, key=lambda row: row[1])]
    names = ("t_s", "range_m", "bearing_rad", "true_target", "true_range_m", "true_bearing_rad")
    return dict(zip(names, np.array(rows).T, strict=True))


def certain_detections(spec, seen: Scene) -> np.ndarray:
    """Which scans give a plot of the target (K,): 0 never (missed, or outside the sector), 1 always, else -1."""
    sensor = spec.sensor
    certain = np.where(seen.certain == 0, 0, 1 if sensor.detection_probability == 1 else -1)
    (near, far), (first, last) = sensor.sector.range_m, sensor.sector.bearing_rad
    r, b = seen.polar[:, 0, 0], seen.polar[:, 1, 0]
    turned = first + np.mod(b - first, 2 * np.pi)
    return np.where((near <= r) & (r <= far) & (turned <= last), certain, 0)


def observation_of(case: Case, seen: Scene) -> pattern_kernels.Observation:
    """When the target's plots come."""
    return pattern_kernels.Observation(
        misses=noise_key(case, "misses"),
        certain=certain_detections(case.spec, seen),
        probability=seen.probability,
        weight=np.ones((len(seen.t), 2)),
        period=seen.period,
        sigma=seen.nominal,
        frame=0,
        measured=np.ascontiguousarray(seen.polar[:, :2, 0]),
        spread=seen.sigma[0, :2].copy(),
    )
