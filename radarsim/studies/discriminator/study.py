"""Where rare losses of lock come from, and bursts drawn from there: importance sampling along the hand-overs.

An estimate at the end of a window is, near the truth, linear in the unit normals z of forecast and noise. What a window
hands over, Δ = e_k − e_{k+1}, is caught when Z = Δᵀ H Δ is small (P4, (16)); Z is nearly λ (uᵀz)², u the unit vector
that the leading singular vector of its root names. So locks are lost where |uᵀz| is large for one of the hand-overs,
on either side; and where, with all hand-overs safe, a component of the last window's own error passes five bounds.

P4 (Uss, Baryshev & Djavad 2010): Doppler frequency and its derivatives from one burst, and how often they lock."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import Protocol

import numpy as np

from radarsim.bursts import burst as model
from radarsim.bursts.kernels import sequence as kernels
from radarsim.bursts.kernels import strip as strips
from radarsim.bursts.kernels.lanes import COLUMNS, END, RATIO, SHIFT, WEIGHTS, M, S
from radarsim.bursts.kernels.scoring import BLOCK_SUMS, DEMODULATED, SAMPLES, SIZE, TURN
from radarsim.config.experiment import Case
from radarsim.config.fields import PLAIN_SHARE
from radarsim.engine.results import Axes, Layout
from radarsim.errors import ConfigError
from radarsim.kernels.lanes import WIDTH
from radarsim.kernels.random import fill_normal_strip
from radarsim.studies.discriminator import kernels as sums_of
from radarsim.studies.discriminator import nearest
from radarsim.studies.discriminator.config import Estimator, Keys
from radarsim.studies.noise import noise_key

# ---- rare ------------------------------------------------------------------------------------------------------------
LEAST_SHARE = 0.1  # of a direction, over that of the likeliest


class RarePlan(nearest.Plan, Protocol):
    """What of the study's plan is used; see there."""

    @property
    def keys(self) -> np.ndarray: ...
    @property
    def mixture(self) -> sums_of.Mixture | None: ...


class NoLoss(ValueError):
    """Along no direction is a lock lost."""


@dataclass(frozen=True)
class Linear:
    """Errors at each window of an estimator as maps (K, size, 6 + 4B) of unit normals to turns over the burst.

    Columns: those of the forecast, then of each block four."""

    forecast: np.ndarray
    errors: np.ndarray


def linear(plan: RarePlan, f: int) -> Linear:
    """How the errors of estimator f follow from the normals, to first order about the truth."""
    size, law = plan.layout.shapes["error"][2], plan.world.factor
    count, forecast = 4 * len(law), np.zeros((size, SIZE + 4 * len(law)))
    forecast[:, :size] = np.diag(plan.prior_sigma[:size])
    weight = TURN * float(plan.world.physics["amplitude"]) / float(plan.world.physics["sigma"]) ** 2
    errors = np.zeros((int(plan.options[f]["windows"]), size, SIZE + count))
    table, weights = plan.tables
    for k, window in enumerate(plan.windows[f, : len(errors)]):
        begin, blocks = int(window["table"]), int(window["blocks"])
        row = table.reshape(-1, COLUMNS)[begin : begin + blocks]
        ends = row[:, END].astype(int)
        block_of = np.repeat(np.arange(blocks), np.diff(ends, prepend=0))  # the window's block of each one drawn
        weights_of_blocks = weights.reshape(-1, WEIGHTS)[
            int(window["weights"]) : int(window["weights"]) + len(block_of)
        ]
        mean, slope = np.ones((size, blocks)), np.zeros((size, blocks))
        mean[1:], slope[1:] = row[:, M : M + size - 1].T, row[:, S : S + size - 1].T
        zeroth, first = (
            mean[:, block_of] + slope[:, block_of] * weights_of_blocks[:, SHIFT],
            slope[:, block_of] * weights_of_blocks[:, RATIO],
        )
        g = law[: len(block_of)].T  # the rows of the imaginary parts of Z₀ and Z₁
        parts = [zeroth * g[1] + first * g[6], zeroth * g[2] + first * g[7], first * g[8], first * g[9]]
        gradient = np.zeros((size, SIZE + count))
        gradient[:, SIZE : SIZE + 4 * len(block_of)] = weight * np.stack(parts, axis=2).reshape(size, -1)
        powers = window["powers"][:size, None]
        if not plan.options[f]["from_truth"]:
            gradient += window["precision"][:size, None] * powers * forecast
        root = window["root"][:size, :size]
        errors[k] = root.T @ (root @ gradient) / powers
    return Linear(forecast, errors)


def directions(plan: RarePlan, f: int) -> np.ndarray:
    """Unit vectors (M, 6 + 4B) along which estimator f loses lock: its hand-overs', then its last window's components.
    Of the first window the start is the forecast, of which the phase is not used."""
    maps, units = linear(plan, f), []
    handed_over = [maps.forecast, *maps.errors[:-1]]
    for k, window in enumerate(plan.windows[f, : len(maps.errors)]):
        if k == 0 and plan.options[f]["from_truth"]:
            continue
        size, drop = len(maps.forecast), int(k == 0)
        root = window["root"][:size, :size]
        delta = window["powers"][:size, None] * (handed_over[k] - maps.errors[k])
        # Σ v vᵀ = (Φ + P)⁻¹ over the root's rows; without the phase the form is a block of Φ + P, not its complement.
        form = np.linalg.inv(root.T @ root)[drop:, drop:]
        units.append(leading(np.linalg.cholesky(form).T @ delta[drop:]))
    last = maps.errors[-1]
    return np.array([*units, *(last / np.linalg.norm(last, axis=1, keepdims=True))])


def leading(matrix: np.ndarray) -> np.ndarray:
    """The right singular vector (n,) of the largest singular value of a matrix (m, n), m small; its side is fixed."""
    vectors = np.linalg.eigh(matrix @ matrix.T)[1]
    vector = vectors[:, -1] @ matrix
    vector = vector / np.linalg.norm(vector)
    # An eigenvector's sign is LAPACK's choice.
    return vector * np.sign(vector[np.argmax(np.abs(vector))])


def mixture(plan: RarePlan, f: int, plain: float) -> sums_of.Mixture:
    """The mixture for the losses of estimator f at its last window, with a share of plain bursts. From each direction
    the nearest losses on both sides are looked for; each is shifted to, and has a share by the probability of what lies
    beyond it. Raises NoLoss where there is none."""
    room = nearest.Room(plan)
    losses = [loss for unit in directions(plan, f) for loss in nearest.either_side(room, f, unit)]
    if not losses:
        raise NoLoss(f"loses no lock within {nearest.FARTHEST:g} σ along any direction: far rarer than 10⁻¹²")
    units, shift = np.array([loss.unit for loss in losses]), np.array([loss.distance for loss in losses])
    chance = np.array([math.erfc(distance / math.sqrt(2.0)) for distance in shift])
    return made(plan, units, shift, chance + LEAST_SHARE * chance.max(), plain)


def made(plan: RarePlan, units: np.ndarray, shift: np.ndarray, shares: np.ndarray, plain: float) -> sums_of.Mixture:
    """A mixture of directions units (M, 6 + 4B), shifts and shares (M,) among those that are not plain."""
    sigma, noise = plan.prior_sigma, units[:, SIZE:].reshape(len(units), -1, 4)
    cumulative = np.cumsum([plain, *((1.0 - plain) * shares / shares.sum())])
    cumulative[-1] = 1.0
    return sums_of.Mixture(
        cumulative=cumulative,
        shift=np.asarray(shift, dtype=float),
        forecast=units[:, :SIZE] * sigma,
        weight=np.where(sigma > 0.0, units[:, :SIZE] / np.where(sigma > 0.0, sigma, 1.0), 0.0),
        first=np.ascontiguousarray(noise[:, :, [0, 2]].reshape(len(units), -1)),
        second=np.ascontiguousarray(noise[:, :, [1, 3]].reshape(len(units), -1)),
    )


def weighted_estimates(plan: RarePlan, first: int, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Errors (count, F, K, 6) and passes (count, F) as `study.estimate`, weights (count,), and whether it is plain."""
    law, shape = plan.mixture, plan.windows.shape
    assert law is not None  # a case with `rare` has one
    errors, passes = np.zeros((count, *shape, SIZE)), np.zeros((count, shape[0]), np.int64)
    weights, chosen = np.empty(count), np.zeros(-(-count // WIDTH) * WIDTH, np.int64)
    room = nearest.Room(plan)
    sums_of.choose(plan.keys[2], first, law.cumulative, chosen)
    for start in range(0, count, WIDTH):
        stop = min(start + WIDTH, count)
        strips.draw_forecasts(plan.keys[1], first + start, plan.prior_sigma, room.work)
        fill_normal_strip(plan.keys[0], first + start, 0, room.a, room.b)
        sums_of.move(law, chosen[start : start + WIDTH], room.work, room.a, room.b)
        sums_of.weigh(law, room.work, room.a, room.b, room.along, weights[start:stop])
        room.put()
        for f in range(shape[0]):
            room.follow(f, errors[start:stop, f])
            passes[start:stop, f] = room.passes[: stop - start]
    return errors, passes, weights, chosen[:count] == 0


# ---- study -----------------------------------------------------------------------------------------------------------
COMPONENTS = (("phi0", "rad"), ("f0", "Hz"), ("f1", "Hz/s"), ("f2", "Hz/s2"), ("f3", "Hz/s3"), ("f4", "Hz/s4"))
BLOCK = 64  # 20 ms with nine estimators on block sums, half a second with two on samples
MODES = {"block_sums": BLOCK_SUMS, "samples": SAMPLES, "demodulated": DEMODULATED}
# Estimates are within 0.016 potential σ of those from samples, and 0.024 (demodulated). Where the image at twice the
# frequency counts, phases turn twice as fast within a block: with 16 of them 1.3 % of the bursts that may lock or not
# change sides, with 24 of them 0.5 %.
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
    potential_closed_form: np.ndarray  #: (C,) potential standard deviations of the whole burst
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
    world: model.World
    tables: tuple[np.ndarray, np.ndarray]
    windows: np.ndarray
    options: np.ndarray
    keys: np.ndarray
    truth: np.ndarray
    prior_sigma: np.ndarray
    potential: np.ndarray
    posterior: np.ndarray
    ridges: tuple[int, ...]
    mixture: sums_of.Mixture | None = None
    block: int = BLOCK
    gaussian = False


@dataclass(frozen=True)
class Phase:
    """The echo's phase: in turns at every sample, and its parameters θ, which for a profile are the best fit."""

    turns: np.ndarray
    reference: np.ndarray
    theta: np.ndarray


def burst_of(spec: Keys) -> model.Burst:
    """The configured burst."""
    b = spec.burst
    return model.Burst(
        b.carrier_hz,
        b.pulse_period_s,
        b.pulse_length_s,
        b.sampling_period_s,
        b.pulses,
        b.amplitude,
        b.noise_variance,
        b.samples == "complex",
    )


def phase_of(spec: Keys, burst: model.Burst) -> Phase:
    """The configured truth."""
    t, truth = model.sample_times(burst, burst.pulses), spec.truth
    if truth.doppler_derivatives is not None:
        theta = np.array([truth.phase_rad, *truth.doppler_derivatives])
        turns = model.phase_turns(theta, t)
        return Phase(turns, turns, theta)
    profile = model.VelocityProfile(truth.times_s or (), truth.velocities_mps or ())
    turns = profile.phase_turns(t, burst.wavelength_m, truth.phase_rad)
    theta = model.fitted_parameters(turns, t, truth.parameters)
    return Phase(turns, model.phase_turns(theta, t), theta)


def forecast(spec: Keys, burst: model.Burst) -> np.ndarray:
    """Standard deviations (size,) of the forecast as the estimators believe them."""
    sigma = np.array(spec.prior.given) * spec.prior.scale
    if spec.prior.sigma is None:
        sigma = sigma * model.spreads(model.fisher(burst, len(sigma), burst.duration_s))
    return sigma


def designer_of(burst: model.Burst, sigma: np.ndarray, condition: model.Condition) -> model.Designer:
    """The designer of a burst's windows under a forecast sigma (size,)."""
    return model.Designer(burst, sigma, partial(model.fisher, burst, len(sigma)), condition)


@lru_cache(maxsize=64)
def designed_windows(burst: model.Burst, sigma: tuple[float, ...], condition: model.Condition) -> tuple[int, ...]:
    """Windows in pulses of one condition, designed once: of many cases that differ elsewhere they are the same."""
    return tuple(designer_of(burst, np.array(sigma), condition).windows())


def windows_of(spec: Keys, burst: model.Burst, sigma: np.ndarray) -> list[list[int]]:
    """Window lengths of every estimator in pulses, for the forecast's standard deviations sigma (size,)."""
    windows_by_estimator = []
    for e in spec.estimators:
        if e.method == "ridge":
            windows_by_estimator.append([burst.pulses])
            continue
        if e.schedule == "designed":
            condition = model.Condition(e.lock_probability, e.main_lobe_threshold, e.tail)
            windows = list(designed_windows(burst, tuple(sigma.tolist()), condition))
        else:
            windows = sorted({burst.pulses_in(duration) for duration in e.schedule})
        windows_by_estimator.append(model.denser(windows, e.density)[: e.first_windows])
    return windows_by_estimator


def mode_of(spec: Keys) -> int:
    """The engine: as configured, or block sums where every estimator can be served by them."""
    if spec.engine != "auto":
        return MODES[spec.engine]
    return SAMPLES if any(spec.needs_samples(e) for e in spec.estimators) else BLOCK_SUMS


def prepare(case: Case) -> Plan:
    """Schedules, block sums' law, step matrices and bounds of a case."""
    try:
        return prepared(case)
    except model.NoSchedule as error:
        raise ConfigError(f"{case.name}: estimators: no designed schedule: {error}") from None
    except np.linalg.LinAlgError:
        raise ConfigError(f"{case.name}: prior: too wide, equations (15) and (16) cannot be solved") from None


def prepared(case: Case) -> Plan:
    """`prepare`, with the errors of those who compute."""
    spec = case.spec
    burst, mode = burst_of(spec), mode_of(spec)
    phase, sigma = phase_of(spec, burst), forecast(spec, burst)
    size = len(sigma)
    designer = designer_of(burst, sigma, model.Condition())  # of forms, which no condition enters
    windows = windows_of(spec, burst, sigma)
    all_windows = sorted({w for estimator_windows in windows for w in estimator_windows})
    image = model.has_image(burst, sigma, all_windows, phase.turns)
    per_window = (IMAGE_BLOCKS_PER_WINDOW if image else BLOCKS_PER_WINDOW)[mode]
    edges = model.block_edges(all_windows, per_window, 8 if mode == DEMODULATED else 1)
    world = model.world(burst, mode, edges, image, phase.turns, phase.reference)
    tables = model.Tables(edges, world.mean, per_window)
    blocks = tables.window if mode == BLOCK_SUMS else tables.drawn
    designs = [design_of(e, w) for e, w in zip(spec.estimators, windows, strict=True)]
    mean_information = dict(zip(all_windows, model.fisher_sums(burst, size, all_windows), strict=True))
    records, options = model.estimators(designs, blocks, burst, sigma, mean_information, designer)
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
            locks=(count, max_windows, len(sums_of.LOCKS)),
            residuals=(count, max_windows, size, sums_of.BINS),
            passes=(count, 2),
            **({} if spec.rare is None else {"losses": (count, max_windows, len(sums_of.LOCKS), 4), "drawn": (3,)}),
        ),
        axes=axes(spec, burst, windows, phase, sigma, potential, posterior),
        world=world,
        tables=tables.arrays(),
        windows=records,
        options=options,
        keys=np.stack([noise_key(case, "noise"), noise_key(case, "prior")]),
        truth=padded(phase.theta) * turns_per_unit,
        prior_sigma=padded(sigma) * turns_per_unit * spec.prior.error_scale,
        potential=padded(potential, 1.0) * turns_per_unit,
        posterior=padded(posterior, 1.0) * turns_per_unit,
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


def padded(values: np.ndarray, filling: float = 0.0) -> np.ndarray:
    """The last axis filled up to the kernels' six coefficients."""
    missing = SIZE - values.shape[-1]
    return np.pad(values, [(0, 0)] * (values.ndim - 1) + [(0, missing)], constant_values=filling)


def design_of(estimator: Estimator, windows: list[int]) -> model.Design:
    """An estimator as the kernels' options."""
    return model.Design(
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
    """Potential spreads (F, K, size) of each window without and with the prior; ones where there is no window."""
    size, max_windows = len(sigma), max(map(len, windows))
    shape = (len(windows), max_windows, size)
    potential, posterior = np.ones(shape), np.ones(shape)
    all_windows = sorted({w for estimator_windows in windows for w in estimator_windows})
    prior_information = np.diag(model.phase_prior(sigma))
    spreads = {
        window: (model.spreads(information), model.spreads(information + prior_information))
        for window, information in zip(all_windows, model.fisher_sums(burst, size, all_windows, theta), strict=True)
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
    information = model.fisher(burst, size, burst.duration_s)
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
        potential_closed_form=model.spreads(information),
        potential_covariance=model.balanced_inverse(information),
        energy_ratio=model.energy_ratio(burst, 1.0) * durations,
        burst_s=burst.duration_s,
        shortest_window_s=model.shortest_window(burst),
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
    sums = sums_of.Sums(**{name: arrays[name] for name in sums_of.Sums._fields})
    if plan.mixture is None:
        errors, passes = estimate(plan, first, count)
    else:
        errors, passes, weights, plain = weighted_estimates(plan, first, count)
        bounds = plan.potential, plan.posterior
        sums_of.accumulate_losses(errors, plan.options, *bounds, weights, arrays["losses"])
        arrays["drawn"][:] = plain.sum(), weights.sum(), (weights**2).sum()
        errors, passes = errors[plain], passes[plain]
    sums_of.accumulate(errors, plan.options, plan.potential, plan.posterior, sums)
    sums.passes[:, 0], sums.passes[:, 1] = passes.sum(axis=0), (passes**2).sum(axis=0)
    return values


def estimate(plan: Plan, first: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Errors (count, F, K, 6) in turns over the burst and passes (count, F) of bursts first, first + 1, …."""
    shape = plan.windows.shape
    errors, passes = np.zeros((count, *shape, SIZE)), np.zeros((count, shape[0]), np.int64)
    physics, law = plan.world.physics, plan.world
    if physics["mode"] == BLOCK_SUMS:
        sums, noise = (law.sums, law.factor), (plan.keys, plan.prior_sigma)
        strips.estimate_strips(physics, sums, plan.tables, plan.windows, plan.options, noise, first, (errors, passes))
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
    from radarsim.studies.discriminator.nearest import Ridge

    physics, clean = plan.world.physics.copy(), plan.world.clean
    physics["mode"] = SAMPLES
    follow = Ridge(int(physics["pulses"]), plan.layout.shapes["error"][2])
    samples = np.empty(clean.shape)
    for i in range(len(errors)):
        kernels.draw_samples(physics, plan.keys[0], first + i, clean, samples)
        received = samples[0] + 1j * samples[1] if physics["complex_samples"] else samples[0]
        start = padded(follow(received))
        passes[i, f] = kernels.polish(
            physics, samples, plan.windows[f], plan.options[f], start, plan.truth, errors[i, f]
        )
