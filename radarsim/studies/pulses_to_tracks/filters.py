"""Labels of the study's sums, and the exact values that go with them.

What is observed: the burst of each scan, and what the filters' model misses of the target.

All errors are counted from the truth: of a polynomial of the second degree, which the model follows, nothing else
matters. Doppler frequency is f = 2V/λ, positive for a target that recedes; over a burst the acceleration is constant.

From a filter's options to the arrays that the kernels read: menus of windows, gates, noise.

A sequence whose forecast is the track's takes its windows from a menu: they are designed for standard deviations of
velocity and acceleration in geometric progression, and each scan of each realisation takes the least that is no less
than its own. The menu begins with what the ranges alone leave open and ends where the whole burst is the first window.

What is known without sampling: the errors of range alone, and of every idealisation."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from radarsim.bursts import burst as model
from radarsim.bursts.burst import LIGHT_MPS, Burst, Tables, block_edges, energy_ratio, fisher, fisher_sums
from radarsim.bursts.kernels.scoring import BLOCK_SUMS
from radarsim.bursts.kernels.sequence import OPTIONS, WINDOW
from radarsim.engine.results import Axes
from radarsim.kernels import algebra
from radarsim.physics import process_noise, transition
from radarsim.studies import radial
from radarsim.studies.pulses_to_tracks import kernels


# ---- axes ------------------------------------------------------------------------------------------------------------
@dataclass(frozen=True, kw_only=True)
class PulsesAxes(Axes):
    """Labels of the sums, F filters over K scans, components r, Vr, ar."""

    #: (F, K, 2) Fisher bounds of the burst's velocity (m/s) and acceleration (m/s²); not-a-number where not taken
    bound: np.ndarray
    takes: np.ndarray  #: (F,) how many of these a filter takes
    energy_db: np.ndarray  #: (K,) energy of the burst over the noise's density, dB
    ideal: np.ndarray  #: (F,) number of each filter's idealisation; −1: the case has none
    losses: np.ndarray  #: (F, K, 3) what lost bursts add to the mean squares of the errors if all are lost
    most_lost: np.ndarray  #: (F,) a bound on how many are


# ---- world -----------------------------------------------------------------------------------------------------------
def truth(target: Any, t: np.ndarray, case: str) -> np.ndarray:
    """Range, radial velocity and acceleration (K, 3) of a configured target at times t (K,), in m, m/s, m/s². Raises
    ConfigError, with the name of the case, for a target that cannot be."""
    return radial.checked_truth(target, t, case)


def bursts(spec: Any, truth: np.ndarray) -> list[Burst]:
    """The burst of every scan; truth (K, 3) gives its range, on which the echo's power hangs, and its velocity. The
    amplitude is one, the noise has half the power over the ratio in each part of a complex sample. Ratios are taken to
    a hundredth of a decibel, so that scans share designs."""
    given, wavelength = spec.burst, spec.radar.wavelength_m
    doppler = 2.0 * truth[:, 1] / wavelength
    power_db = given.snr_db + 20.0 * np.log10(np.abs(np.sinc(given.pulse_length_s * doppler)))
    if given.snr_range_m is not None:
        power_db = power_db + 40.0 * np.log10(given.snr_range_m / truth[:, 0])
    return [
        Burst(
            carrier_hz=LIGHT_MPS / wavelength,
            pulse_period_s=1.0 / given.repetition_rate_hz,
            pulse_length_s=given.pulse_length_s,
            sampling_period_s=given.pulse_length_s,
            pulses=spec.pulses,
            amplitude=1.0,
            noise_variance=0.5 * 10.0 ** (-0.1 * float(one)),
            complex_samples=True,
        )
        for one in np.round(power_db, 2)
    ]


def centre(burst: Burst) -> float:
    """The middle of the samples in bursts from the first: there velocity and acceleration are independent."""
    return 0.5 * (burst.pulses - 1) / burst.pulses


def at_centre(burst: Burst, size: int, order: int) -> np.ndarray:
    """Row (size,) that makes of θ the velocity (order 1) or the acceleration (2) at the middle, m/s or m/s²."""
    t = centre(burst) * burst.duration_s
    powers = [t ** (j - order) / math.factorial(j - order) if j >= order else 0.0 for j in range(size)]
    return 0.5 * burst.wavelength_m * np.array(powers)


def bounds(burst: Burst, size: int) -> tuple[float, float]:
    """The Fisher bound of a burst's velocity and acceleration at its middle, m/s and m/s²; infinite if not estimated.

    size is the number of parameters: phase, frequency, its derivatives."""
    (information,) = fisher_sums(burst, size, [burst.pulses])
    scale = 1.0 / np.sqrt(np.diag(information))
    inverse = np.linalg.inv(information * np.outer(scale, scale)) * np.outer(scale, scale)
    rows = [at_centre(burst, size, order) for order in (1, 2)]
    velocity, acceleration = (float(np.sqrt(row @ inverse @ row)) if row.any() else math.inf for row in rows)
    return velocity, acceleration


def defects(truth: np.ndarray, period_s: float) -> np.ndarray:
    """What the model's prediction of a scan misses, F x(k − 1) − x(k), (K, 3) from the truth (K, 3); the first zero."""
    missed = np.zeros_like(truth)
    missed[1:] = truth[:-1] @ transition(period_s).T - truth[1:]
    return missed


# ---- filters ---------------------------------------------------------------------------------------------------------
RATIOS = (math.sqrt(2.0), 2.0)  # of neighbouring standard deviations of a menu: velocity, acceleration
MOST_LEVELS = (40, 16)
STILL = 0.02  # turns at the ends of the burst, left by an acceleration: below it none is designed for
BOTTOMLESS = 10.0**300  # the depth of a list that nothing is dropped from
BLOCKS_PER_WINDOW = 20  # as the discriminator's
UNKNOWN_RAD = 2.0 * math.pi  # the phase's spread before a burst
KINDS = {None: kernels.NONE, "fisher_bound": kernels.BOUND, "spectrum": kernels.SPECTRUM}
USES = {None: kernels.AS_MEASURED, "as_measured": kernels.AS_MEASURED} | {
    "gated": kernels.GATED,
    "mixture": kernels.MIXTURE,
}
SEARCH: dict[str, Any] = {"coherent": True, "search": 2, "margin": 2.0, "tolerance": 0.3}  # P4's cure at a hand-over


@dataclass(frozen=True)
class Menu:
    """Standard deviations (m/s, m/s²) that windows are designed for, and the windows in pulses of each pair.

    spreads are the largest of either; levels how many of either, the next one RATIOS times less."""

    top: tuple[float, float]
    levels: tuple[int, int]
    windows: tuple[tuple[int, ...], ...]

    def spreads(self, entry: int) -> tuple[float, float]:
        """The standard deviations of an entry; velocity counts fastest."""
        a, v = divmod(entry, self.levels[0])
        return self.top[0] / RATIOS[0] ** v, self.top[1] / RATIOS[1] ** a


def parameters(one: Any) -> int:
    """How many parameters a filter's estimator has: phase, frequency, derivatives."""
    return 2 + (one.derivatives or 0)


def theta_spreads(burst: Burst, size: int, spreads: tuple[float, float]) -> np.ndarray:
    """Standard deviations (size,) of θ at the burst's beginning, of a forecast of velocity and acceleration."""
    velocity, acceleration = spreads
    at_start = math.hypot(velocity, acceleration * centre(burst) * burst.duration_s)
    return np.array([UNKNOWN_RAD, *(2.0 / burst.wavelength_m * np.array([at_start, acceleration]))])[:size]


def designer(burst: Burst, size: int, spreads: tuple[float, float]) -> model.Designer:
    """Who designs the windows of a forecast: by the paper's Gaussian tail, P_Δ = 0.99, c = 1."""
    sigma = theta_spreads(burst, size, spreads)
    return model.Designer(burst, sigma, partial(fisher, burst, size), model.Condition())


def windows(burst: Burst, one: Any, spreads: tuple[float, float]) -> tuple[int, ...]:
    """The windows in pulses of a filter's sequence; raises NoSchedule where there are none."""
    found = designer(burst, parameters(one), spreads).windows()
    return tuple(model.denser(found, 2) if one.estimator == "dense" else found)


def menu(burst: Burst, one: Any, widest: tuple[float, float]) -> Menu:
    """The menu of a filter: of its fixed forecast alone, or from the widest that the track may have."""
    if one.forecast != "track":
        spreads = one.forecast.sigma_velocity_mps, one.forecast.sigma_acceleration_mps2
        return Menu(spreads, (1, 1), (windows(burst, one, spreads),))
    of_acceleration = 1
    if parameters(one) > 2:
        turns = widest[1] / burst.wavelength_m * (0.5 * burst.duration_s) ** 2
        of_acceleration = min(1 + max(0, math.ceil(math.log(turns / STILL, RATIOS[1]))), MOST_LEVELS[1])
    rows: list[list[tuple[int, ...]]] = []
    for a in range(of_acceleration):
        row: list[tuple[int, ...]] = []
        while len(row) < MOST_LEVELS[0] and (not row or row[-1] != (burst.pulses,)):
            row.append(windows(burst, one, (widest[0] / RATIOS[0] ** len(row), widest[1] / RATIOS[1] ** a)))
        rows.append(row)
    longest = max(map(len, rows))
    every = tuple(own for row in rows for own in (*row, *[row[-1]] * (longest - len(row))))
    return Menu(widest, (longest, of_acceleration), every)


def widest(spec: Any, one: Any) -> tuple[float, float]:
    """The largest standard deviations of velocity and acceleration that a forecast of the track may have.

    Those of range alone: a burst only adds to what is known. Of a velocity no more is left open than where in the span
    it lies."""
    dt = spec.radar.scan_period_s
    F, Q = transition(dt), process_noise(one.process_noise, one.manoeuvre_variance, dt)
    P = np.diag([0.0, spec.prior.sigma_velocity_mps**2, spec.prior.sigma_acceleration_mps2**2])
    found = []
    for k in range(spec.scans):
        if k == 0:
            P[0, 0] = spec.radar.sigma_range_m**2
        else:
            P = F @ P @ F.T + (Q if k >= start_scans(one) else 0.0)
            P = P - np.outer(P[0], P[0]) / (P[0, 0] + spec.radar.sigma_range_m**2)
        found.append(np.sqrt(np.diag(P)[1:]))
    largest = np.max(found, axis=0)
    return min(float(largest[0]), spec.span_mps / math.sqrt(12.0)), float(largest[1])


def start_scans(one: Any) -> int:
    """Scans that start a filter, as in P1: the manoeuvre is allowed for after them."""
    return 2 if one.takes else 3


@dataclass
class Gathered:
    """Windows of all designs so far."""

    windows: list[np.ndarray] = field(default_factory=list)

    def add(self, made: np.ndarray) -> int:
        """Where these begin."""
        begins = sum(map(len, self.windows))
        self.windows.append(made)
        return begins


@dataclass(frozen=True)
class Designed:
    """The arrays of the filters, and what they were made from."""

    arrays: kernels.Filters
    tables: Tables
    sums: model.World
    menus: tuple[Menu | None, ...]


def designed(spec: Any, bursts: list[Burst]) -> Designed:
    """All filters of a case: their menus, and of every scan and entry the records of its windows. Windows are designed
    for the weakest of the bursts, and weighed with the noise of each."""
    weakest = max(bursts, key=lambda one: one.noise_variance)
    menus = tuple(None if one.estimator in KINDS else menu(weakest, one, widest(spec, one)) for one in spec.filters)
    every = sorted({spec.pulses} | {w for one in menus if one for own in one.windows for w in own})
    if any(one.estimator == "spectrum" for one in spec.filters):
        every = list(range(1, spec.pulses + 1))  # a spectrum needs every pulse
    edges = block_edges(every, BLOCKS_PER_WINDOW)
    zero = np.zeros((1, spec.pulses))
    sums = model.world(weakest, BLOCK_SUMS, edges, False, zero, zero)
    tables = Tables(edges, sums.mean, BLOCKS_PER_WINDOW)
    return Designed(_arrays(spec, bursts, menus, tables), tables, sums, menus)


def _arrays(spec: Any, bursts: list[Burst], menus: tuple[Menu | None, ...], tables: Tables) -> kernels.Filters:
    count, scans = len(spec.filters), len(bursts)
    entries = max((len(one.windows) for one in menus if one), default=1)
    gathered = Gathered()
    options = np.zeros(count, OPTIONS)
    first, many = np.zeros((count, scans, entries), np.int64), np.zeros((count, scans, entries), np.int64)
    free, sigma = np.zeros((count, scans), np.int64), np.ones((count, scans, 2))
    for f, (one, own) in enumerate(zip(spec.filters, menus, strict=True)):
        known: dict[Burst, int] = {}
        for k, burst in enumerate(bursts):
            if burst in known:
                for array in (first, many, free, sigma):
                    array[f, k] = array[f, known[burst]]
                continue
            known[burst] = k
            if one.takes:
                sigma[f, k] = bounds(burst, parameters(one))
                free[f, k] = gathered.add(_records(burst, one, (spec.pulses,), None, tables)[0])
            for entry, windows_ in enumerate(own.windows if own else ()):
                made, options[f] = _records(burst, one, windows_, own.spreads(entry) if own else None, tables)
                first[f, k, entry], many[f, k, entry] = gathered.add(made), len(made)
        if one.takes and own is None:
            options[f] = _records(bursts[0], one, (spec.pulses,), None, tables)[1]
    last = options.copy()
    last["search"] = 0
    names = [one.name for one in spec.filters]
    return kernels.Filters(
        filters=np.array([_filter(spec, one, own) for one, own in zip(spec.filters, menus, strict=True)]),
        options=options,
        last=last,
        windows=np.concatenate([*gathered.windows, np.zeros(1, WINDOW)]),
        first=first,
        count=many,
        free=free,
        sigma=sigma,
        baseline=names.index(spec.baseline) if spec.baseline else 0,
    )


def _records(
    burst: Burst, one: Any, own: tuple[int, ...], spreads: tuple[float, float] | None, tables: Tables
) -> tuple[np.ndarray, np.void]:
    """Records of the windows of an estimator and its options; without a forecast where no spreads are given."""
    size = parameters(one)
    cure = SEARCH if one.estimator == "cured" and spreads else {}
    of = designer(burst, size, spreads or (1.0, 1.0))
    design = model.Design(own, forecast=spreads is not None, **cure)
    information = dict(zip(own, fisher_sums(burst, size, list(own)), strict=True))
    made, options = model.estimators([design], tables.window, burst, of.sigma, information, of)
    return made[0], options[0]


def _filter(spec: Any, one: Any, own: Menu | None) -> np.void:
    """A filter's record."""
    dt = spec.radar.scan_period_s
    made = np.zeros(1, kernels.FILTER)[0]
    made["kind"] = KINDS.get(one.estimator, kernels.SEQUENCE)
    made["takes"], made["use"], made["start"] = one.takes, USES[one.use], start_scans(one)
    made["track"] = one.forecast == "track"
    made["noise"] = process_noise(one.process_noise, one.manoeuvre_variance, dt)[np.triu_indices(3)]
    if one.use == "gated":
        from scipy.special import chdtri

        made["gate"] = chdtri(one.takes, 1.0 - one.gate_probability)
    if one.use == "mixture":
        # An estimate that did not lock is anywhere in the span, its acceleration anywhere the rate can be swept.
        made["lock"], made["density"] = one.lock_probability, 1.0 / spec.span_mps
        if one.takes == 2:
            made["density"] /= spec.span_mps / spec.burst_s
    made["kept"] = one.hypotheses or 1
    if made["kept"] > 1:
        made["deepest"] = -math.log(one.prune_below) if one.prune_below > 0 else BOTTOMLESS
        made["averages"] = one.estimate == "mean"
    if own is not None:
        made["top"], made["levels"], made["ratio"] = own.top, own.levels, np.log(RATIOS)
        made["fixed"] = own.top if one.forecast != "track" else 0.0
    return made


# ---- exact -----------------------------------------------------------------------------------------------------------
def known(one: Any) -> bool:
    """Whether a filter's errors are Gaussian, and known: its estimates always lock, or there are none."""
    return one.takes == 0 or one.estimator == "fisher_bound"


def errors(spec: Any, one: Any, sigma: np.ndarray, missed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance (K, 3), (K, 3, 3) of the errors of a filter whose estimates always lock.

    sigma (K, 2) of velocity and acceleration; missed (K, 3) what the model misses, see `defects`. The filter's
    covariance P gives the gains; that of the errors, S, has no manoeuvre noise."""
    F, S, mean = algebra.constant_acceleration(spec.radar.scan_period_s), designation(spec), (0.0, 0.0, 0.0)
    means, covariances = np.zeros((len(missed), 3)), np.zeros((len(missed), 6))
    for k, taken in enumerate(gains(spec, one, sigma)):
        if k > 0:
            S = algebra.predicted_covariance(S, F, algebra.NO_NOISE)
            mean = algebra.add_scaled(algebra.predicted(mean, F), 1.0, missed[k])
        for c, gain, variance in taken:
            S, mean = algebra.CORRECT[c](S, variance, gain), algebra.add_scaled(mean, -mean[c], gain)
        means[k], covariances[k] = mean, S
    return means, algebra.unpack(covariances.T)


def designation(spec: Any) -> tuple[float, ...]:
    """The packed covariance after the first range, and what was known of velocity and acceleration before."""
    variances = spec.radar.sigma_range_m**2, spec.prior.sigma_velocity_mps**2, spec.prior.sigma_acceleration_mps2**2
    return variances[0], 0.0, 0.0, variances[1], 0.0, variances[2]


def gains(spec: Any, one: Any, sigma: np.ndarray) -> Iterator[list[tuple[int, Any, float]]]:
    """By scan what a filter takes as measured: number of the component, gain (3,), variance. sigma as in `errors`."""
    dt = spec.radar.scan_period_s
    F, Q = algebra.constant_acceleration(dt), algebra.pack(process_noise(one.process_noise, one.manoeuvre_variance, dt))
    P = designation(spec)
    for k in range(len(sigma)):
        if k > 0:
            P = algebra.predicted_covariance(P, F, Q if k >= start_scans(one) else algebra.NO_NOISE)
        taken = []
        for c in range(0 if k else 1, one.takes + 1):
            variance = float(spec.radar.sigma_range_m**2 if c == 0 else sigma[k, c - 1] ** 2)
            P, gain, _ = algebra.TAKE[c](P, variance, 1.0)
            taken.append((c, gain, variance))
        yield taken


def of_losses(spec: Any, one: Any, sigma: np.ndarray) -> np.ndarray:
    """What lost bursts add to the mean squares (K, 3) of a filter's errors, over the probability that one is lost.

    It is the mean square of the answer to a burst, summed over those up to a scan. A lost estimate is uniform over the
    span (the acceleration over what sweeps the rate), and taken as measured; one that the next forecast rests on
    confirms itself from scan to scan. A gate, a mixture or hypotheses answer less."""
    F, scans = algebra.constant_acceleration(spec.radar.scan_period_s), len(sigma)
    size = np.array([spec.span_mps, spec.span_mps / spec.burst_s]) / math.sqrt(12.0)
    answers, found = np.zeros((3, scans, 2)), np.zeros((scans, 3))  # of the bursts so far to errors of one
    for k, taken in enumerate(gains(spec, one, sigma)):
        answers = np.array(algebra.predicted(answers, F))
        begun = np.arange(scans) <= k if one.forecast == "track" else np.arange(scans) == k
        for c, gain, _ in taken:
            answers = np.array(algebra.add_scaled(answers, -answers[c], gain))
            if c:
                answers[:, begun, c - 1] += np.array(gain)[:, None]
        found[k] = np.einsum("xjc,c->x", answers**2, size**2)
    return found


def most_lost(bursts: Sequence[Burst], one: Any) -> float:
    """A bound on the probability that a burst is lost: of a spectrum by its energy, one where none is known.

    A line of noise is higher than the signal's with a probability of exp(−E/2)/2, E the energy over the noise's density
    (Rife & Boorstyn 1974), for two lines that are orthogonal. Of lines at half their distance the signal's is down to
    sinc²(1/4) at worst, and a side lobe of it, 0.217 of its height, helps the other one."""
    if one.estimator != "spectrum":
        return 1.0
    least = min(energy_ratio(burst, burst.duration_s) for burst in dict.fromkeys(bursts))
    energy = np.sinc(0.25) ** 2 * (1.0 - 0.217) * least
    return float(min(1.0, bursts[0].pulses * math.exp(-0.5 * energy)))
