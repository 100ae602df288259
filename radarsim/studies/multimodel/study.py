"""P2's study: the plan of a case, its banks of models and stages, and the sums of a block of realisations."""

from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Axes
from radarsim.engine.sums import Layout
from radarsim.kernels.lanes import WIDTH, rows
from radarsim.studies.multimodel import model_bank
from radarsim.studies.multimodel.config import Filter, Keys
from radarsim.studies.multimodel.kernels import layout as kernels_layout
from radarsim.studies.multimodel.kernels import plots
from radarsim.studies.multimodel.kernels import sums as kernels_sums
from radarsim.studies.multimodel.scenario import intervals, plot_truth, sensor_frame, true_states
from radarsim.studies.noise import noise_key

COMPONENTS = tuple(
    (f"{prefix}{axis}", unit) for axis in "xyz" for prefix, unit in (("", "m"), ("v", "m/s"), ("a", "m/s2"))
)
BLOCK = 64  # eight groups of eight; 0.1 s with six filters and 3725 scans
FAMILIES = {
    "kalman": kernels_layout.KALMAN,
    "gpb1": kernels_layout.GPB1,
    "imm": kernels_layout.IMM,
    "gpb2": kernels_layout.GPB2,
}
RULES = {
    "moment": kernels_layout.MOMENT,
    "best": kernels_layout.BEST,
    "combined": kernels_layout.COMBINED,
    "modified_combined": kernels_layout.MODIFIED,
}


@dataclass(frozen=True, kw_only=True)
class FlightAxes(Axes):
    """Labels of the sums, and the data of the flight for tables and figures."""

    truth: np.ndarray  #: (K', 9) true states x, vx, ax, y, vy, ay, z, vz, az (m, m/s, m/s²) at the reported scans
    stage: np.ndarray  #: (K',) stage of each reported scan
    #: (S,) number of scans in the means of each stage: from the third scan of the track on, reported or not
    stage_scans: np.ndarray


@dataclass(frozen=True)
class Plan:
    """The data for simulating a block; see `kernels.layout` for the arrays."""

    layout: Layout
    axes: FlightAxes
    world: kernels_layout.World
    banks: kernels_layout.Banks
    block: int = BLOCK
    gaussian = False


def banks(spec: Keys, times: np.ndarray) -> kernels_layout.Banks:
    """The filters' arrays, padded to multiples of eight, for the distinct intervals times (U,) in s."""
    count = len(spec.filters)
    numbers, models = np.zeros((count, 8), dtype=np.int64), np.zeros((count, 16))
    transitions = np.zeros((count, -(-len(times) * kernels_layout.MAX_MODELS**2 // 8) * 8))
    probabilities = np.zeros((count, 8))
    for f, options in enumerate(spec.filters):
        size, T = len(options.models), model_bank.transition_matrix(options.transition)
        numbers[f] = filter_numbers(options, options.merge)
        bank = model_bank.model_rows(
            [m.motion for m in options.models], [m.sigma_acceleration_mps2 for m in options.models]
        )
        models[f, : bank.size] = bank.ravel()
        powers = model_bank.transition_powers(T, times / options.transition_interval_s)
        transitions[f, : powers.size] = powers.ravel()
        probabilities[f, :size] = model_bank.stationary(T)
    return kernels_layout.Banks(numbers, models, transitions, probabilities)


def filter_numbers(options: Filter, merge: str) -> np.ndarray:
    """The numbers (8,) of a filter with a merging rule."""
    numbers = np.zeros(8, dtype=np.int64)
    numbers[kernels_layout.FAMILY] = FAMILIES[options.family]
    numbers[kernels_layout.MERGE], numbers[kernels_layout.OUTPUT_RULE] = RULES[merge], RULES[options.output]
    numbers[kernels_layout.AT_PREDICTION] = options.covariance_at == "prediction"
    numbers[kernels_layout.SIZE] = len(options.models)
    return numbers


def stages(spec: Keys, t: np.ndarray, reported: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The stage of each scan (K,), and lengths (S, 2): scans of a stage from the third on, and the reported ones."""
    stage = np.searchsorted(np.array(spec.target.stage_ends_s), t, side="right").astype(np.int64)
    in_track = np.arange(len(t)) >= kernels_layout.START
    in_stage = stage == np.arange(len(spec.target.stages))[:, None]
    counts = [(in_stage & in_track).sum(axis=1), (in_stage & in_track & reported).sum(axis=1)]
    return stage, np.stack(counts, axis=1) * 1.0


def prepare(case: Case) -> Plan:
    """The plan of a case: truth, sensor, filters' banks, labels. Raises ConfigError for an impossible flight."""
    spec = case.spec
    t, x = true_states(case)
    scan = np.arange(len(t))
    reported = scan >= kernels_layout.START
    reported &= ((scan + 1) % spec.report_every == 0) | (scan == len(t) - 1)
    stage, lengths = stages(spec, t, reported)
    index, times = intervals(t)
    world = kernels_layout.World(
        keys=np.stack([noise_key(case, "plots"), noise_key(case, "detections")]),
        frame=sensor_frame(spec.sensor),
        plot_truth=plot_truth(case, t, x),
        truth=x,
        intervals=index,
        times=times,
        reported=reported.astype(np.int64),
        report_index=(np.cumsum(reported) - 1).astype(np.int64),
        stage=stage,
        lengths=lengths,
        weights=model_bank.start_weights(t[: kernels_layout.START], spec.start_acceleration_mps2),
    )
    shapes = kernels_layout.shapes(len(spec.filters), int(reported.sum()), len(lengths))
    return Plan(Layout(**shapes), axes(spec, t, world, lengths), world, banks(spec, times))


def axes(spec: Keys, t: np.ndarray, world: kernels_layout.World, lengths: np.ndarray) -> FlightAxes:
    """Labels of the sums; this study has no exact values."""
    reported = world.reported.astype(bool)
    shape = (len(spec.filters), int(reported.sum()), kernels_layout.STATES)
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
    return _simulate_block(plan, first, count, 0)[0]


def errors(plan: Plan, first: int, count: int) -> np.ndarray:
    """The errors (F, count, K, 9) of the realisations of a block."""
    return _simulate_block(plan, first, count, count)[1][..., :count].transpose(0, 3, 1, 2)


def _simulate_block(plan: Plan, first: int, count: int, kept_errors: int) -> tuple[np.ndarray, np.ndarray]:
    """Sums of one block, and the errors (F, K, 9, n) of kept_errors realisations, n a multiple of eight."""
    values = np.zeros(plan.layout.size)
    arrays = plan.layout.unpack(values)
    sums = kernels_layout.Sums(*(arrays[name] for name in kernels_layout.Sums._fields))
    memory = kernels_sums.block_memory(len(plan.banks.numbers), len(plan.world.lengths), len(plan.axes.k), kept_errors)
    kernels_sums.simulate_block(plan.world, plan.banks, memory, sums, plan.axes.baseline, first, count)
    return values, memory.errors


def simulate_plots(plan: Plan, first: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Plots of realisations first … first + 7: positions (K, 3, 8), covariances (K, 6, 8), and detections (K, 8).

    In m and m²; detections are 0 or 1. The covariances are packed (xx, xy, xz, yy, yz, zz)."""
    world, count = plan.world, len(plan.world.truth)
    plot_rows = rows(count * kernels_layout.PLOT)
    plots.fill_plots(
        world.keys, world.frame, world.plot_truth, kernels_layout.START, first, rows(plots.RANDOM), plot_rows
    )
    cells = plot_rows.reshape(count, kernels_layout.PLOT, WIDTH)
    covariance = slice(kernels_layout.COVARIANCE, kernels_layout.DETECTED)
    return cells[:, : kernels_layout.COVARIANCE], cells[:, covariance], cells[:, kernels_layout.DETECTED]
