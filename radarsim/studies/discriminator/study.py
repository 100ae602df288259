"""P4's study: the plan of a case, the labels of its sums, and the simulation of a block of bursts."""

from dataclasses import dataclass, replace

import numpy as np

from radarsim.bursts import block_sums, estimators, fisher, schedule_design
from radarsim.bursts import burst as model
from radarsim.bursts.kernels import sequence as kernels
from radarsim.bursts.kernels import sequence_lanes, signal
from radarsim.bursts.kernels.scoring import SIZE
from radarsim.bursts.kernels.signal import BLOCK_SUMS, DEMODULATED, SAMPLES
from radarsim.config.experiment import Case
from radarsim.config.rare_event_keys import PLAIN_SHARE
from radarsim.engine.results import Axes
from radarsim.engine.sums import Layout
from radarsim.errors import ConfigError
from radarsim.studies.discriminator.config import Estimator, Keys
from radarsim.studies.discriminator.estimator_windows import schedule_windows, window_designer
from radarsim.studies.discriminator.importance_sampling import NoLoss, mixture, weighted_estimates
from radarsim.studies.discriminator.kernels import sums as kernels_sums
from radarsim.studies.discriminator.kernels import weights
from radarsim.studies.discriminator.scenario import Phase, configured_burst, forecast, true_phase
from radarsim.studies.noise import noise_key

COMPONENTS = (("phi0", "rad"), ("f0", "Hz"), ("f1", "Hz/s"), ("f2", "Hz/s2"), ("f3", "Hz/s3"), ("f4", "Hz/s4"))
BLOCK = 64  # 20 ms with nine estimators on block sums, half a second with two on samples
MODES = {"block_sums": BLOCK_SUMS, "samples": SAMPLES, "demodulated": DEMODULATED}
# Estimates are within 0.016 Cramér–Rao bounds of those from samples, and 0.024 (demodulated). Where the image at twice
# the frequency counts, phases turn twice as fast within a block: with 16 of them 1.3 % of the bursts that may lock or
# not change sides, with 24 of them 0.5 %.
BLOCKS_PER_WINDOW = {BLOCK_SUMS: 20, SAMPLES: 20, DEMODULATED: 32}
IMAGE_BLOCKS_PER_WINDOW = {BLOCK_SUMS: 24, SAMPLES: 24, DEMODULATED: 32}
# Of the cure at a hand-over: points closer than the main lobe reaches, 1 rad rms by (10), so that it is between no two;
# and by how many standard errors the coherence is short of 1 for a search: about one lock in 44 is then searched for.
SEARCH_SPACING_RAD = 0.8
SEARCH_MARGIN = 2.0


@dataclass(frozen=True, kw_only=True)
class DiscriminatorAxes(Axes):
    """Labels of P4's sums, and what its tables need beside them: F estimators, K windows, C components of θ in their
    units."""

    duration_s: np.ndarray  #: (F, K) length of a window; not-a-number where an estimator has none
    pulses: tuple[tuple[int, ...], ...]  #: the same in pulses
    posterior_sigma: np.ndarray  #: (F, K, C) bounds with the prior; not-a-number likewise
    prior_sigma: np.ndarray  #: (C,) of the forecast
    potential_closed_form: np.ndarray  #: (C,) Cramér–Rao bounds of the whole burst
    potential_covariance: np.ndarray  #: (C, C) their covariance
    energy_ratio: np.ndarray  #: (F, K) a window's μ, no unit; not-a-number likewise
    burst_s: float  #: length of the whole burst
    shortest_window_s: float  #: T_min (17)
    model_error_turns: float  #: rms difference between the true phase and that of the fitted parameters
    model_error_hz: float  #: the same of the frequency


@dataclass(frozen=True)
class Plan:
    """All that a block needs; arrays as in `bursts.kernels.sequence.estimate_block` and `accumulate`."""

    layout: Layout
    axes: DiscriminatorAxes
    world: estimators.World
    tables: tuple[np.ndarray, np.ndarray]
    windows: np.ndarray
    options: np.ndarray
    keys: np.ndarray
    truth: np.ndarray
    prior_sigma: np.ndarray
    potential: np.ndarray
    posterior: np.ndarray
    ridges: tuple[int, ...]
    mixture: weights.Mixture | None = None
    block: int = BLOCK
    gaussian = False


def engine_mode(spec: Keys) -> int:
    """The engine: as configured, or block sums where every estimator can be served by them."""
    if spec.engine != "auto":
        return MODES[spec.engine]
    return SAMPLES if any(spec.needs_samples(e) for e in spec.estimators) else BLOCK_SUMS


def prepare(case: Case) -> Plan:
    """Schedules, block sums' law, step matrices and bounds of a case."""
    try:
        return make_plan(case)
    except schedule_design.NoSchedule as error:
        raise ConfigError(f"{case.name}: estimators: no designed schedule: {error}") from None
    except np.linalg.LinAlgError:
        raise ConfigError(f"{case.name}: prior: too wide, equations (15) and (16) cannot be solved") from None


def make_plan(case: Case) -> Plan:
    """`prepare`, with the errors of those who compute."""
    spec = case.spec
    burst, mode = configured_burst(spec), engine_mode(spec)
    phase, sigma = true_phase(spec, burst), forecast(spec, burst)
    size = len(sigma)
    designer = window_designer(burst, sigma, schedule_design.Condition())  # of forms, which no condition enters
    windows = schedule_windows(spec, burst, sigma)
    all_windows = sorted({w for estimator_windows in windows for w in estimator_windows})
    image = estimators.has_image(burst, sigma, all_windows, phase.turns)
    per_window = (IMAGE_BLOCKS_PER_WINDOW if image else BLOCKS_PER_WINDOW)[mode]
    edges = block_sums.block_edges(all_windows, per_window, 8 if mode == DEMODULATED else 1)
    world = estimators.world(burst, mode, edges, image, phase.turns, phase.reference)
    tables = block_sums.WindowTables(edges, world.mean, per_window)
    blocks = tables.window if mode == BLOCK_SUMS else tables.window_of_drawn_blocks
    designs = [estimator_design(e, w) for e, w in zip(spec.estimators, windows, strict=True)]
    mean_information = dict(zip(all_windows, fisher.fisher_sums(burst, size, all_windows), strict=True))
    records, options = estimators.estimators(designs, blocks, burst, sigma, mean_information, designer)
    turns_per_unit = np.ones(SIZE)
    turns_per_unit[:size] = model.turns_per_parameter(size, burst.duration_s)
    potential, posterior = bounds(burst, windows, phase.theta, sigma)
    if not (np.isfinite(potential).all() and np.isfinite(posterior).all()):
        raise ConfigError(f"{case.name}: truth: the samples of a window do not determine the {size} parameters")
    count, max_windows = records.shape
    plan = Plan(
        layout=Layout(
            error=(count, max_windows, size, 4),
            error_all=(count, max_windows, size, 4),
            locks=(count, max_windows, len(kernels_sums.LOCKS)),
            residuals=(count, max_windows, size, kernels_sums.BINS),
            passes=(count, 2),
            **(
                {} if spec.rare is None else {"losses": (count, max_windows, len(kernels_sums.LOCKS), 4), "drawn": (3,)}
            ),
        ),
        axes=axes(spec, burst, windows, phase, sigma, potential, posterior),
        world=world,
        tables=tables.arrays(),
        windows=records,
        options=options,
        keys=np.stack([noise_key(case, "noise"), noise_key(case, "prior")]),
        truth=pad_to_kernel_size(phase.theta) * turns_per_unit,
        prior_sigma=pad_to_kernel_size(sigma) * turns_per_unit * spec.prior.error_scale,
        potential=pad_to_kernel_size(potential, 1.0) * turns_per_unit,
        posterior=pad_to_kernel_size(posterior, 1.0) * turns_per_unit,
        ridges=tuple(i for i, e in enumerate(spec.estimators) if e.method == "ridge"),
    )
    if spec.rare is None:
        return plan
    target = [e.name for e in spec.estimators].index(spec.rare.estimator)
    keys = np.concatenate([plan.keys, [noise_key(case, "rare")]])
    try:
        return replace(plan, keys=keys, mixture=mixture(plan, target, PLAIN_SHARE))
    except NoLoss as error:
        raise ConfigError(f"{case.name}: rare: {spec.rare.estimator} {error}") from None


def pad_to_kernel_size(values: np.ndarray, filling: float = 0.0) -> np.ndarray:
    """The last axis filled up to the kernels' six coefficients."""
    missing = SIZE - values.shape[-1]
    return np.pad(values, [(0, 0)] * (values.ndim - 1) + [(0, missing)], constant_values=filling)


def estimator_design(estimator: Estimator, windows: list[int]) -> estimators.Design:
    """An estimator as the kernels' options."""
    return estimators.Design(
        windows=tuple(windows),
        phases=estimator.phases,
        steps=estimator.steps,
        tolerance=estimator.tolerance,
        coherent=estimator.coherence_step,
        search=estimator.search_points,
        spacing=SEARCH_SPACING_RAD,
        margin=SEARCH_MARGIN,
        from_truth=estimator.start == "truth",
        amplitude=("known", "estimated", "as_printed").index(estimator.amplitude),
        forecast=estimator.method == "sequence",
    )


def bounds(
    burst: model.Burst, windows: list[list[int]], theta: np.ndarray, sigma: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Cramér–Rao bounds (F, K, size) of each window without and with the prior; ones where there is no window."""
    size, max_windows = len(sigma), max(map(len, windows))
    shape = (len(windows), max_windows, size)
    potential, posterior = np.ones(shape), np.ones(shape)
    all_windows = sorted({w for estimator_windows in windows for w in estimator_windows})
    prior_information = np.diag(fisher.phase_prior(sigma))
    spreads = {
        window: (fisher.spreads(information), fisher.spreads(information + prior_information))
        for window, information in zip(all_windows, fisher.fisher_sums(burst, size, all_windows, theta), strict=True)
    }
    for f, estimator_windows in enumerate(windows):
        for k, window in enumerate(estimator_windows):
            potential[f, k], posterior[f, k] = spreads[window]
    return potential, posterior


def axes(
    spec: Keys,
    burst: model.Burst,
    windows: list[list[int]],
    phase: Phase,
    sigma: np.ndarray,
    potential: np.ndarray,
    posterior: np.ndarray,
) -> DiscriminatorAxes:
    """Labels: filters are the estimators, scans their windows; each has window lengths of its own."""
    names, size = tuple(e.name for e in spec.estimators), len(sigma)
    max_windows = max(map(len, windows))
    durations = np.full((len(names), max_windows), np.nan)
    for f, estimator_windows in enumerate(windows):
        durations[f, : len(estimator_windows)] = np.array(estimator_windows) * burst.pulse_period_s
    available = np.repeat(np.isfinite(durations)[..., None], size, axis=2)
    information = fisher.fisher(burst, size, burst.duration_s)
    return DiscriminatorAxes(
        filters=names,
        components=COMPONENTS[:size],
        k=np.arange(1, max_windows + 1),
        t_s=durations[int(np.argmax([len(estimator_windows) for estimator_windows in windows]))],
        available=available,
        baseline=0,
        exact_sigma=np.where(available, potential, np.nan),
        exact_bias=np.where(available, 0.0, np.nan),
        duration_s=durations,
        pulses=tuple(tuple(estimator_windows) for estimator_windows in windows),
        posterior_sigma=np.where(available, posterior, np.nan),
        prior_sigma=sigma,
        potential_closed_form=fisher.spreads(information),
        potential_covariance=model.balanced_inverse(information),
        energy_ratio=fisher.energy_ratio(burst, 1.0) * durations,
        burst_s=burst.duration_s,
        shortest_window_s=fisher.shortest_window(burst),
        model_error_turns=float(np.sqrt(np.mean((phase.turns - phase.reference) ** 2))),
        model_error_hz=doppler_error(burst, phase),
    )


def doppler_error(burst: model.Burst, phase: Phase) -> float:
    """Root-mean-square difference in Hz between the true Doppler frequency and that of the fitted parameters."""
    residual = (phase.turns - phase.reference)[0]
    return float(np.sqrt(np.mean((np.diff(residual) / burst.pulse_period_s) ** 2)))


def simulate(plan: Plan, first: int, count: int) -> np.ndarray:
    """Sums of one block, in the order of the plan's layout; with `rare` the common ones count the plain bursts."""
    values = np.zeros(plan.layout.size)
    arrays = plan.layout.unpack(values)
    sums = kernels_sums.Sums(**{name: arrays[name] for name in kernels_sums.Sums._fields})
    if plan.mixture is None:
        errors, passes = estimate(plan, first, count)
    else:
        errors, passes, weights, plain = weighted_estimates(plan, first, count)
        bounds = plan.potential, plan.posterior
        kernels_sums.accumulate_losses(errors, plan.options, *bounds, weights, arrays["losses"])
        arrays["drawn"][:] = plain.sum(), weights.sum(), (weights**2).sum()
        errors, passes = errors[plain], passes[plain]
    kernels_sums.accumulate(errors, plan.options, plan.potential, plan.posterior, sums)
    sums.passes[:, 0], sums.passes[:, 1] = passes.sum(axis=0), (passes**2).sum(axis=0)
    return values


def errors(plan: Plan, first: int, count: int) -> np.ndarray:
    """The errors (F, count, K, C) of locked bursts in the units of the axes; not-a-number where a burst does not lock,
    and of bursts that importance sampling draws."""
    is_plain = np.ones(count, dtype=bool)
    if plan.mixture is None:
        turns, _ = estimate(plan, first, count)
    else:
        turns, _, _, is_plain = weighted_estimates(plan, first, count)
    size = len(plan.axes.components)
    lock_flags = np.zeros((len(plan.options), count, turns.shape[2], len(kernels_sums.LOCKS)))
    for f, options in enumerate(plan.options):
        bounds = plan.potential[f, :, :size], plan.posterior[f, :, :size]
        kernels_sums.mark_locks(turns[:, f], *bounds, options["windows"], lock_flags[f])
    is_locked = (lock_flags[..., kernels_sums.LOCKS.index("lock")] > 0) & is_plain[:, None]
    errors_in_units = turns[..., :size] / model.turns_per_parameter(size, plan.axes.burst_s)
    return np.where(is_locked[..., None], np.moveaxis(errors_in_units, 1, 0), np.nan)


def estimate(plan: Plan, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Errors (count, F, K, 6) in turns over the burst and passes (count, F) of bursts first, first + 1, …."""
    shape = plan.windows.shape
    errors, passes = np.zeros((count, *shape, SIZE)), np.zeros((count, shape[0]), np.int64)
    physics, law = plan.world.physics, plan.world
    if physics["mode"] == BLOCK_SUMS:
        sums, noise = (law.sums, law.factor), (plan.keys, plan.prior_sigma)
        sequence_lanes.estimate_strips(
            physics, sums, plan.tables, plan.windows, plan.options, noise, first, (errors, passes)
        )
        return errors, passes
    kernels.estimate_block(
        *(physics, law.edges, law.clean, law.mean, plan.windows, plan.options),
        *(plan.keys, first, plan.truth, plan.prior_sigma, errors, passes),
    )
    for f in plan.ridges:
        _follow_ridges(plan, f, first, errors, passes)
    return errors, passes


def _follow_ridges(plan: Plan, f: int, first: int, errors: np.ndarray, passes: np.ndarray) -> None:
    """The classical rival's errors and passes: its start is found outside the kernels, burst by burst."""
    from radarsim.studies.discriminator.spectrum_ridge import Ridge

    physics, clean = plan.world.physics.copy(), plan.world.clean
    physics["mode"] = SAMPLES
    follow = Ridge(int(physics["pulses"]), plan.layout.shapes["error"][2])
    samples = np.empty(clean.shape)
    for i in range(len(errors)):
        signal.draw_samples(physics, plan.keys[0], first + i, clean, samples)
        received = samples[0] + 1j * samples[1] if physics["complex_samples"] else samples[0]
        start = pad_to_kernel_size(follow(received))
        passes[i, f] = kernels.polish(
            physics, samples, plan.windows[f], plan.options[f], start, plan.truth, errors[i, f]
        )
