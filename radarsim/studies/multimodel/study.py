"""P2 (Sychev & Osipov 2023): multiple-model filters on an aeroballistic target, families × merging rules."""

from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.moments import Layout
from radarsim.engine.results import Axes
from radarsim.kernels.lanes import WIDTH, rows
from radarsim.studies.multimodel import filters
from radarsim.studies.multimodel.kernels import filters as kernels
from radarsim.studies.multimodel.kernels import plots, sums
from radarsim.studies.multimodel.kernels.hypothesis import MOST, PLOT
from radarsim.studies.multimodel.world import intervals, plot_truth, sensor_frame, truth
from radarsim.studies.noise import noise_key

COMPONENTS = tuple(
    (f"{prefix}{axis}", unit) for axis in "xyz" for prefix, unit in (("", "m"), ("v", "m/s"), ("a", "m/s2"))
)
BLOCK = 64  # eight groups of eight; 0.1 s with six filters and 3725 scans
FAMILIES = {"kalman": kernels.KALMAN, "gpb1": kernels.GPB1, "imm": kernels.IMM, "gpb2": kernels.GPB2}
RULES = {
    "moment": kernels.MOMENT,
    "best": kernels.BEST,
    "combined": kernels.COMBINED,
    "modified_combined": kernels.MODIFIED,
}


@dataclass(frozen=True)
class Plan:
    """All that a block needs; see `kernels.multimodel_sums` for the arrays."""

    layout: Layout
    axes: Axes
    world: sums.World
    banks: sums.Banks
    block: int = BLOCK
    gaussian = False


def banks(spec, times: np.ndarray) -> sums.Banks:
    """The filters' arrays, padded to eights, for the different intervals times (U,)."""
    count = len(spec.filters)
    numbers, models = np.zeros((count, 8), dtype=np.int64), np.zeros((count, 16))
    transitions, probabilities = np.zeros((count, -(-len(times) * MOST**2 // 8) * 8)), np.zeros((count, 8))
    for f, options in enumerate(spec.filters):
        size, T = len(options.models), transition(options)
        rules = FAMILIES[options.family], RULES[options.merge], RULES[options.output]
        numbers[f, :5] = *rules, options.covariance_at == "prediction", size
        bank = filters.bank([m.motion for m in options.models], [m.sigma_acceleration_mps2 for m in options.models])
        models[f, : 3 * size] = bank.ravel()
        powers = filters.transition_powers(T, times / options.transition_interval_s)
        transitions[f, : powers.size] = powers.ravel()
        probabilities[f, :size] = filters.stationary(T)
    return sums.Banks(numbers, models, transitions, probabilities)


def transition(options) -> np.ndarray:
    """The transition matrix (M, M) of a filter, columns summing to one exactly."""
    T = np.array(options.transition)
    return T / T.sum(axis=0)


def stages(spec, t: np.ndarray, everything: np.ndarray) -> tuple[np.ndarray, np.ndarray, tuple[str, ...]]:
    """Stage of each scan (K,), lengths (S, 2) in scans from the third on and in reported scans, and names."""
    parts = spec.target.stages
    ends = np.array([stage.end_s for stage in parts[:-1]])
    stage = np.searchsorted(ends, t, side="right").astype(np.int64)
    counted = np.arange(len(t)) >= sums.START
    lengths = np.array(
        [[np.sum(counted & (stage == s)), np.sum(counted & everything & (stage == s))] for s in range(len(parts))]
    )
    return stage, lengths.astype(float), tuple(part.name for part in parts)


def prepare(case: Case) -> Plan:
    """Truth, plots' frame and banks of a case."""
    spec = case.spec
    t, x = truth(case)
    count = len(t)
    reported = np.arange(count) >= sums.START
    reported &= ((np.arange(count) + 1) % spec.report_every == 0) | (np.arange(count) == count - 1)
    place = np.cumsum(reported) - 1
    stage, lengths, names = stages(spec, t, reported)
    index, times = intervals(t)
    shape = (len(spec.filters), int(reported.sum()))
    world = sums.World(
        keys=np.stack([noise_key(case, "plots"), noise_key(case, "detections")]),
        frame=sensor_frame(spec.sensor),
        plot_truth=plot_truth(case, t, x),
        truth=x,
        intervals=index,
        times=times,
        everything=reported.astype(np.int64),
        place=place.astype(np.int64),
        stage=stage,
        lengths=lengths,
        weights=filters.start_weights(t[:3], spec.start_acceleration_mps2),
    )
    return Plan(
        layout=Layout(
            error=(*shape, 9, 4),
            paired=(*shape, 9),
            probability=(*shape, MOST, 2),
            believed=(*shape, 2),
            stage=(shape[0], len(names), sums.MEANS, 2),
            pairs=(shape[0], shape[0], len(names), 9),
        ),
        axes=axes(spec, t, x, reported, names, lengths),
        world=world,
        banks=banks(spec, times),
    )


def axes(spec, t: np.ndarray, x: np.ndarray, reported: np.ndarray, names: tuple[str, ...], lengths: np.ndarray) -> Axes:
    """Labels of the sums; nothing of this study is known exactly."""
    shape = (len(spec.filters), int(reported.sum()), 9)
    labels = tuple(f.name for f in spec.filters)
    unknown = np.full(shape, np.nan)
    return Axes(
        filters=labels,
        components=COMPONENTS,
        k=np.flatnonzero(reported) + 1,
        t_s=t[reported],
        available=np.ones(shape, dtype=bool),
        baseline=labels.index(spec.baseline) if spec.baseline else 0,
        exact_sigma=unknown,
        exact_bias=unknown,
        extra={
            "truth": x[reported],
            "stages": names,
            "stage_ends_s": np.array([stage.end_s for stage in spec.target.stages[:-1]]),
            "lengths": lengths,
            "families": tuple(f.family for f in spec.filters),
            "rules": tuple(f.merge for f in spec.filters),
            "models": tuple(tuple(f"{m.motion} {m.sigma_acceleration_mps2:g}" for m in f.models) for f in spec.filters),
            "transitions": tuple(transition(f) for f in spec.filters),
            "intervals_s": np.array([f.transition_interval_s for f in spec.filters]),
            "powers": powers_hold(spec),
            "operations": np.array([operations(f) for f in spec.filters]),
        },
    )


def operations(options) -> tuple[float, float, float]:
    """See `filters.multimodel.operations`."""
    accelerates = [filters.MOTIONS[model.motion][1] > 0 for model in options.models]
    return filters.operations(options.family, transition(options), accelerates)


def powers_hold(spec) -> np.ndarray:
    """How far P(t → 0) is from the unit matrix, at a millionth of the interval, and P(10 Δt) from P(Δt)¹⁰: (F, 2)."""
    found = []
    for f in spec.filters:
        T = transition(f)
        near, tenfold = filters.transition_powers(T, np.array([1e-6, 10.0]))
        apart = np.linalg.multi_dot([T] * 10) if len(T) > 1 else T
        found.append((np.abs(near - np.eye(len(T))).max(), np.abs(tenfold - apart).max()))
    return np.array(found)


def simulate(plan: Plan, first: int, count: int) -> np.ndarray:
    """Sums of one block, in the order of the plan's layout."""
    arrays = sums.MultimodelSums(*(np.zeros(plan.layout.shapes[name]) for name in sums.MultimodelSums._fields))
    memory = sums.memory(len(plan.banks.numbers), len(plan.world.lengths))
    sums.simulate_block(plan.world, plan.banks, memory, arrays, plan.axes.baseline, first, count)
    return plan.layout.pack(**arrays._asdict())


def measured(plan: Plan, first: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Plots of the realisations first … first + 7: positions (K, 3, 8), covariances (K, 6, 8), detected (K, 8) as 0
    or 1.

    The covariances are packed (xx, xy, xz, yy, yz, zz).
    """
    world, count = plan.world, len(plan.world.truth)
    found = rows(count * PLOT)
    plots.fill_plots(world.keys, world.frame, world.plot_truth, sums.START, first, rows(plots.RANDOM), found)
    cells = found.reshape(count, PLOT, WIDTH)
    return cells[:, :3], cells[:, 3:9], cells[:, 9]
