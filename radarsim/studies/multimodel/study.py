"""P2 (Sychev & Osipov 2023): multiple-model filters on an aeroballistic target, families × merging rules."""

from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Axes, Layout
from radarsim.kernels.lanes import WIDTH, rows
from radarsim.studies.multimodel import world as filters
from radarsim.studies.multimodel.config import Keys
from radarsim.studies.multimodel.kernels import records, strip
from radarsim.studies.multimodel.world import intervals, plot_truth, sensor_frame, truth
from radarsim.studies.noise import noise_key

COMPONENTS = tuple(
    (f"{prefix}{axis}", unit) for axis in "xyz" for prefix, unit in (("", "m"), ("v", "m/s"), ("a", "m/s2"))
)
BLOCK = 64  # eight groups of eight; 0.1 s with six filters and 3725 scans
FAMILIES = {"kalman": records.KALMAN, "gpb1": records.GPB1, "imm": records.IMM, "gpb2": records.GPB2}
RULES = {
    "moment": records.MOMENT,
    "best": records.BEST,
    "combined": records.COMBINED,
    "modified_combined": records.MODIFIED,
}


@dataclass(frozen=True, kw_only=True)
class FlightAxes(Axes):
    """Labels of the sums, and what tables and figures need of the flight; the case describes stages and banks."""

    truth: np.ndarray  #: (K', 9) true states x, vx, ax, y, vy, ay, z, vz, az (m, m/s, m/s²) at the reported scans
    stage: np.ndarray  #: (K',) stage of each reported scan
    #: (S,) scans of each stage that its means are of: from the third scan of the track on, reported or not
    stage_scans: np.ndarray


@dataclass(frozen=True)
class Plan:
    """All that a block needs; see `kernels.records` for the arrays."""

    layout: Layout
    axes: FlightAxes
    world: records.World
    banks: records.Banks
    block: int = BLOCK
    gaussian = False


def banks(spec: Keys, times: np.ndarray) -> records.Banks:
    """The filters' arrays, padded to eights, for the different intervals times (U,) in s."""
    count = len(spec.filters)
    numbers, models = np.zeros((count, 8), dtype=np.int64), np.zeros((count, 16))
    transitions, probabilities = np.zeros((count, -(-len(times) * records.MOST**2 // 8) * 8)), np.zeros((count, 8))
    for f, options in enumerate(spec.filters):
        size, T = len(options.models), filters.transition_matrix(options.transition)
        numbers[f, records.FAMILY] = FAMILIES[options.family]
        numbers[f, records.MERGE], numbers[f, records.OUTPUT_RULE] = RULES[options.merge], RULES[options.output]
        numbers[f, records.AT_PREDICTION] = options.covariance_at == "prediction"
        numbers[f, records.SIZE] = size
        bank = filters.bank([m.motion for m in options.models], [m.sigma_acceleration_mps2 for m in options.models])
        models[f, : bank.size] = bank.ravel()
        powers = filters.transition_powers(T, times / options.transition_interval_s)
        transitions[f, : powers.size] = powers.ravel()
        probabilities[f, :size] = filters.stationary(T)
    return records.Banks(numbers, models, transitions, probabilities)


def stages(spec: Keys, t: np.ndarray, reported: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Stage of each scan (K,), and lengths (S, 2): scans of a stage from the third on, and the reported ones."""
    stage = np.searchsorted(np.array(spec.target.stage_ends_s), t, side="right").astype(np.int64)
    counted = np.arange(len(t)) >= records.START
    inside = stage == np.arange(len(spec.target.stages))[:, None]
    return stage, np.stack([(inside & counted).sum(axis=1), (inside & counted & reported).sum(axis=1)], axis=1) * 1.0


def prepare(case: Case) -> Plan:
    """The plan of a case: truth, sensor, filters' banks, labels. Raises ConfigError where the flight is impossible."""
    spec = case.spec
    t, x = truth(case)
    scan = np.arange(len(t))
    reported = scan >= records.START
    reported &= ((scan + 1) % spec.report_every == 0) | (scan == len(t) - 1)
    stage, lengths = stages(spec, t, reported)
    index, times = intervals(t)
    world = records.World(
        keys=np.stack([noise_key(case, "plots"), noise_key(case, "detections")]),
        frame=sensor_frame(spec.sensor),
        plot_truth=plot_truth(case, t, x),
        truth=x,
        intervals=index,
        times=times,
        reported=reported.astype(np.int64),
        place=(np.cumsum(reported) - 1).astype(np.int64),
        stage=stage,
        lengths=lengths,
        weights=filters.start_weights(t[: records.START], spec.start_acceleration_mps2),
    )
    shapes = records.shapes(len(spec.filters), int(reported.sum()), len(lengths))
    return Plan(Layout(**shapes), axes(spec, t, world, lengths), world, banks(spec, times))


def axes(spec: Keys, t: np.ndarray, world: records.World, lengths: np.ndarray) -> FlightAxes:
    """Labels of the sums; nothing of this study is known exactly."""
    reported = world.reported.astype(bool)
    shape = (len(spec.filters), int(reported.sum()), records.STATES)
    names = tuple(f.name for f in spec.filters)
    unknown = np.full(shape, np.nan)
    return FlightAxes(
        filters=names,
        components=COMPONENTS,
        k=np.flatnonzero(reported) + 1,
        t_s=t[reported],
        available=np.ones(shape, dtype=bool),
        baseline=names.index(spec.baseline) if spec.baseline else 0,
        exact_sigma=unknown,
        exact_bias=unknown,
        truth=world.truth[reported],
        stage=world.stage[reported],
        stage_scans=lengths[:, 0],
    )


def simulate(plan: Plan, first: int, count: int) -> np.ndarray:
    """Sums of one block, in the order of the plan's layout."""
    return _simulated(plan, first, count, 0)[0]


def errors(plan: Plan, first: int, count: int) -> np.ndarray:
    """The errors (F, count, K, 9) of its realisations."""
    return _simulated(plan, first, count, count)[1][..., :count].transpose(0, 3, 1, 2)


def _simulated(plan: Plan, first: int, count: int, kept: int) -> tuple[np.ndarray, np.ndarray]:
    """Sums of one block, and the errors (F, K, 9, kept) of all its realisations, in whole eights, or of none."""
    values = np.zeros(plan.layout.size)
    arrays = plan.layout.unpack(values)
    plain = records.Sums(*(arrays[name] for name in records.Sums._fields))
    memory = strip.memory(len(plan.banks.numbers), len(plan.world.lengths), len(plan.axes.k), kept)
    strip.simulate_block(plan.world, plan.banks, memory, plain, plan.axes.baseline, first, count)
    return values, memory.each


def measured(plan: Plan, first: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Plots of the realisations first … first + 7: positions (K, 3, 8) in m, covariances (K, 6, 8) in m², and detected
    (K, 8) as 0 or 1. The covariances are packed (xx, xy, xz, yy, yz, zz)."""
    world, count = plan.world, len(plan.world.truth)
    found = rows(count * records.PLOT)
    strip.fill_plots(world.keys, world.frame, world.plot_truth, records.START, first, rows(strip.RANDOM), found)
    cells = found.reshape(count, records.PLOT, WIDTH)
    covariance = slice(records.COVARIANCE, records.DETECTED)
    return cells[:, : records.COVARIANCE], cells[:, covariance], cells[:, records.DETECTED]
