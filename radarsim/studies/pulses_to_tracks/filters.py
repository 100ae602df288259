"""Labels of the study's sums, with the exact values.

The burst of each scan, and the defects of the filters' model of the target.

All errors are relative to the truth: for a polynomial of the second degree, which the model follows, nothing else
matters. Doppler frequency is f = 2V/λ, positive for a target that recedes; over a burst the acceleration is constant.

From a filter's options to the arrays that the kernels read: menus of windows, gates, noise.

A sequence that forecasts by its track takes its windows from a menu. They are designed for standard deviations of
velocity and acceleration in geometric progression; each scan of each realisation takes the smallest that is not below
its own. The menu begins with the uncertainty that ranges alone leave, and ends where the whole burst is the first
window.

Exact errors of range alone, and of every idealisation."""

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
    takes: np.ndarray  #: (F,) the number of these that a filter takes
    energy_db: np.ndarray  #: (K,) energy of the burst over the noise's density, dB
    ideal: np.ndarray  #: (F,) number of each filter's idealisation; −1: the case has none
    lost_squares: np.ndarray  #: (F, K, 3) mean squares that lost bursts add to the errors if all are lost
    max_loss_probability: np.ndarray  #: (F,) an upper bound of the probability that a burst is lost


# ---- world -----------------------------------------------------------------------------------------------------------
def truth(target: Any, t: np.ndarray, case: str) -> np.ndarray:
    """Range, radial velocity and acceleration (K, 3) of a configured target at times t (K,), in m, m/s, m/s².

    Raises ConfigError, with the name of the case, for an impossible target."""
    return radial.checked_truth(target, t, case)


def bursts(spec: Any, truth: np.ndarray) -> list[Burst]:
    """The burst of every scan; truth (K, 3) gives the range, on which the echo's power depends, and the velocity.

    The amplitude is one; the noise in each part of a complex sample has half the power over the ratio. Ratios are
    rounded to a hundredth of a decibel, so that scans share designs."""
    burst_keys, wavelength = spec.burst, spec.radar.wavelength_m
    doppler = 2.0 * truth[:, 1] / wavelength
    power_db = burst_keys.snr_db + 20.0 * np.log10(np.abs(np.sinc(burst_keys.pulse_length_s * doppler)))
    if burst_keys.snr_range_m is not None:
        power_db = power_db + 40.0 * np.log10(burst_keys.snr_range_m / truth[:, 0])
    return [
        Burst(
            carrier_hz=LIGHT_MPS / wavelength,
            pulse_period_s=1.0 / burst_keys.repetition_rate_hz,
            pulse_length_s=burst_keys.pulse_length_s,
            sampling_period_s=burst_keys.pulse_length_s,
            pulses=spec.pulses,
            amplitude=1.0,
            noise_variance=0.5 * 10.0 ** (-0.1 * float(ratio_db)),
            complex_samples=True,
        )
        for ratio_db in np.round(power_db, 2)
    ]


def burst_centre(burst: Burst) -> float:
    """The middle of the samples as a fraction of the burst: there velocity and acceleration are independent."""
    return 0.5 * (burst.pulses - 1) / burst.pulses


def centre_row(burst: Burst, size: int, order: int) -> np.ndarray:
    """The row (size,) that maps θ to the velocity (order 1) or the acceleration (2) at the middle, m/s or m/s²."""
    t = burst_centre(burst) * burst.duration_s
    powers = [t ** (j - order) / math.factorial(j - order) if j >= order else 0.0 for j in range(size)]
    return 0.5 * burst.wavelength_m * np.array(powers)


def fisher_bounds(burst: Burst, size: int) -> tuple[float, float]:
    """The Fisher bound of a burst's velocity and acceleration at its middle, m/s and m/s²; infinite if not estimated.

    size is the number of parameters: phase, frequency, its derivatives."""
    (information,) = fisher_sums(burst, size, [burst.pulses])
    scale = 1.0 / np.sqrt(np.diag(information))
    inverse = np.linalg.inv(information * np.outer(scale, scale)) * np.outer(scale, scale)
    rows = [centre_row(burst, size, order) for order in (1, 2)]
    velocity, acceleration = (float(np.sqrt(row @ inverse @ row)) if row.any() else math.inf for row in rows)
    return velocity, acceleration


def model_defects(truth: np.ndarray, period_s: float) -> np.ndarray:
    """The errors F x(k − 1) − x(k) of the model's predictions (K, 3), from the truth (K, 3); the first is zero."""
    defects = np.zeros_like(truth)
    defects[1:] = truth[:-1] @ transition(period_s).T - truth[1:]
    return defects


# ---- filters ---------------------------------------------------------------------------------------------------------
RATIOS = (math.sqrt(2.0), 2.0)  # of neighbouring standard deviations of a menu: velocity, acceleration
MAX_LEVELS = (40, 16)
MIN_CURVATURE_TURNS = 0.02  # turns that an acceleration makes at the ends of the burst, below which it is neglected
UNLIMITED_DEPTH = 10.0**300  # of a list from which no hypothesis is dropped
BLOCKS_PER_WINDOW = 20  # as the discriminator's
UNKNOWN_RAD = 2.0 * math.pi  # the phase's spread before a burst
KINDS = {None: kernels.NONE, "fisher_bound": kernels.BOUND, "spectrum": kernels.SPECTRUM}
USES = {None: kernels.AS_MEASURED, "as_measured": kernels.AS_MEASURED} | {
    "gated": kernels.GATED,
    "mixture": kernels.MIXTURE,
}
HANDOVER_SEARCH: dict[str, Any] = {
    "coherent": True,
    "search": 2,
    "margin": 2.0,
    "tolerance": 0.3,
}  # P4's cure at a hand-over


@dataclass(frozen=True)
class Menu:
    """Pairs of standard deviations (m/s, m/s²) with the windows, in pulses, designed for each.

    top: the largest of either; levels: the number of either, each RATIOS times smaller than the one before."""

    top: tuple[float, float]
    levels: tuple[int, int]
    windows: tuple[tuple[int, ...], ...]

    def spreads(self, entry: int) -> tuple[float, float]:
        """The standard deviations of an entry; velocity counts fastest."""
        a, v = divmod(entry, self.levels[0])
        return self.top[0] / RATIOS[0] ** v, self.top[1] / RATIOS[1] ** a


def parameter_count(options: Any) -> int:
    """The number of parameters of a filter's estimator: phase, frequency, derivatives."""
    return 2 + (options.derivatives or 0)


def theta_spreads(burst: Burst, size: int, spreads: tuple[float, float]) -> np.ndarray:
    """Standard deviations (size,) of θ at the burst's start, for a forecast of velocity and acceleration."""
    velocity, acceleration = spreads
    at_start = math.hypot(velocity, acceleration * burst_centre(burst) * burst.duration_s)
    return np.array([UNKNOWN_RAD, *(2.0 / burst.wavelength_m * np.array([at_start, acceleration]))])[:size]


def designer(burst: Burst, size: int, spreads: tuple[float, float]) -> model.Designer:
    """The designer of a forecast's windows: by the paper's Gaussian tail, P_Δ = 0.99, c = 1."""
    sigma = theta_spreads(burst, size, spreads)
    return model.Designer(burst, sigma, partial(fisher, burst, size), model.Condition())


def sequence_windows(burst: Burst, options: Any, spreads: tuple[float, float]) -> tuple[int, ...]:
    """The windows in pulses of a filter's sequence; raises NoSchedule if there are none."""
    lengths = designer(burst, parameter_count(options), spreads).windows()
    return tuple(model.denser(lengths, 2) if options.estimator == "dense" else lengths)


def window_menu(burst: Burst, options: Any, widest: tuple[float, float]) -> Menu:
    """The menu of a filter: for its fixed forecast alone, or from the widest forecast of the track downwards."""
    if options.forecast != "track":
        spreads = options.forecast.sigma_velocity_mps, options.forecast.sigma_acceleration_mps2
        return Menu(spreads, (1, 1), (sequence_windows(burst, options, spreads),))
    acceleration_levels = 1
    if parameter_count(options) > 2:
        turns = widest[1] / burst.wavelength_m * (0.5 * burst.duration_s) ** 2
        acceleration_levels = min(
            1 + max(0, math.ceil(math.log(turns / MIN_CURVATURE_TURNS, RATIOS[1]))), MAX_LEVELS[1]
        )
    rows: list[list[tuple[int, ...]]] = []
    for a in range(acceleration_levels):
        row: list[tuple[int, ...]] = []
        while len(row) < MAX_LEVELS[0] and (not row or row[-1] != (burst.pulses,)):
            row.append(
                sequence_windows(burst, options, (widest[0] / RATIOS[0] ** len(row), widest[1] / RATIOS[1] ** a))
            )
        rows.append(row)
    longest = max(map(len, rows))
    all_windows = tuple(entry for row in rows for entry in (*row, *[row[-1]] * (longest - len(row))))
    return Menu(widest, (longest, acceleration_levels), all_windows)


def widest_forecast(spec: Any, options: Any) -> tuple[float, float]:
    """The largest standard deviations of velocity and acceleration that a forecast of the track may have.

    They are those of range alone, as bursts only narrow them, and for the velocity at most that of a uniform
    distribution over the span."""
    dt = spec.radar.scan_period_s
    F, Q = transition(dt), process_noise(options.process_noise, options.manoeuvre_variance, dt)
    P = np.diag([0.0, spec.prior.sigma_velocity_mps**2, spec.prior.sigma_acceleration_mps2**2])
    sigmas = []
    for k in range(spec.scans):
        if k == 0:
            P[0, 0] = spec.radar.sigma_range_m**2
        else:
            P = F @ P @ F.T + (Q if k >= start_scans(options) else 0.0)
            P = P - np.outer(P[0], P[0]) / (P[0, 0] + spec.radar.sigma_range_m**2)
        sigmas.append(np.sqrt(np.diag(P)[1:]))
    largest = np.max(sigmas, axis=0)
    return min(float(largest[0]), spec.span_mps / math.sqrt(12.0)), float(largest[1])


def start_scans(options: Any) -> int:
    """The number of scans that start a filter, as in P1; manoeuvre noise is added only after them."""
    return 2 if options.takes else 3


@dataclass
class WindowList:
    """The windows of all designs."""

    windows: list[np.ndarray] = field(default_factory=list)

    def add(self, records: np.ndarray) -> int:
        """Add records; returns the index of the first."""
        start = sum(map(len, self.windows))
        self.windows.append(records)
        return start


@dataclass(frozen=True)
class FilterDesign:
    """The arrays of the filters, with the tables, sums and menus behind them."""

    arrays: kernels.Filters
    tables: Tables
    sums: model.World
    menus: tuple[Menu | None, ...]


def design_filters(spec: Any, bursts: list[Burst]) -> FilterDesign:
    """Design all filters of a case: their menus, and the records of the windows of each scan and entry.

    Windows are designed for the weakest burst, and weighted with the noise of each."""
    weakest = max(bursts, key=lambda burst: burst.noise_variance)
    menus = tuple(
        None if options.estimator in KINDS else window_menu(weakest, options, widest_forecast(spec, options))
        for options in spec.filters
    )
    lengths = sorted({spec.pulses} | {w for menu in menus if menu for windows in menu.windows for w in windows})
    if any(options.estimator == "spectrum" for options in spec.filters):
        lengths = list(range(1, spec.pulses + 1))  # a spectrum needs every pulse
    edges = block_edges(lengths, BLOCKS_PER_WINDOW)
    zero = np.zeros((1, spec.pulses))
    sums = model.world(weakest, BLOCK_SUMS, edges, False, zero, zero)
    tables = Tables(edges, sums.mean, BLOCKS_PER_WINDOW)
    return FilterDesign(_filter_arrays(spec, bursts, menus, tables), tables, sums, menus)


def _filter_arrays(spec: Any, bursts: list[Burst], menus: tuple[Menu | None, ...], tables: Tables) -> kernels.Filters:
    """The filters' arrays; scans whose bursts are the same share their windows."""
    count, scans = len(spec.filters), len(bursts)
    entries = max((len(menu.windows) for menu in menus if menu), default=1)
    window_list = WindowList()
    estimator_options = np.zeros(count, OPTIONS)
    first_window = np.zeros((count, scans, entries), np.int64)
    window_count = np.zeros((count, scans, entries), np.int64)
    whole_burst, sigma = np.zeros((count, scans), np.int64), np.ones((count, scans, 2))
    for f, (options, menu) in enumerate(zip(spec.filters, menus, strict=True)):
        scan_of_burst: dict[Burst, int] = {}
        for k, burst in enumerate(bursts):
            if burst in scan_of_burst:
                for array in (first_window, window_count, whole_burst, sigma):
                    array[f, k] = array[f, scan_of_burst[burst]]
                continue
            scan_of_burst[burst] = k
            if options.takes:
                sigma[f, k] = fisher_bounds(burst, parameter_count(options))
                whole_burst[f, k] = window_list.add(_window_records(burst, options, (spec.pulses,), None, tables)[0])
            for entry, windows in enumerate(menu.windows if menu else ()):
                spreads = menu.spreads(entry) if menu else None
                records, estimator_options[f] = _window_records(burst, options, windows, spreads, tables)
                first_window[f, k, entry], window_count[f, k, entry] = window_list.add(records), len(records)
        if options.takes and menu is None:
            estimator_options[f] = _window_records(bursts[0], options, (spec.pulses,), None, tables)[1]
    last_options = estimator_options.copy()
    last_options["search"] = 0
    names = [options.name for options in spec.filters]
    return kernels.Filters(
        filters=np.array([_filter_record(spec, *pair) for pair in zip(spec.filters, menus, strict=True)]),
        options=estimator_options,
        last_options=last_options,
        windows=np.concatenate([*window_list.windows, np.zeros(1, WINDOW)]),
        first_window=first_window,
        window_count=window_count,
        whole_burst=whole_burst,
        sigma=sigma,
        baseline=names.index(spec.baseline) if spec.baseline else 0,
    )


def _window_records(
    burst: Burst, options: Any, lengths: tuple[int, ...], spreads: tuple[float, float] | None, tables: Tables
) -> tuple[np.ndarray, np.void]:
    """The records of an estimator's windows, and its options; without a forecast if no spreads are given."""
    size = parameter_count(options)
    search_options = HANDOVER_SEARCH if options.estimator == "cured" and spreads else {}
    window_designer = designer(burst, size, spreads or (1.0, 1.0))
    design = model.Design(lengths, forecast=spreads is not None, **search_options)
    information = dict(zip(lengths, fisher_sums(burst, size, list(lengths)), strict=True))
    records, estimator_options = model.estimators(
        [design], tables.window, burst, window_designer.sigma, information, window_designer
    )
    return records[0], estimator_options[0]


def _filter_record(spec: Any, options: Any, menu: Menu | None) -> np.void:
    """The record of a filter for the kernels."""
    dt = spec.radar.scan_period_s
    record = np.zeros(1, kernels.FILTER)[0]
    record["kind"] = KINDS.get(options.estimator, kernels.SEQUENCE)
    record["takes"], record["use"], record["start"] = options.takes, USES[options.use], start_scans(options)
    record["track"] = options.forecast == "track"
    record["noise"] = process_noise(options.process_noise, options.manoeuvre_variance, dt)[np.triu_indices(3)]
    if options.use == "gated":
        from scipy.special import chdtri

        record["gate"] = chdtri(options.takes, 1.0 - options.gate_probability)
    if options.use == "mixture":
        # An estimate that did not lock is anywhere in the span, its acceleration anywhere the rate can be swept.
        record["lock"], record["density"] = options.lock_probability, 1.0 / spec.span_mps
        if options.takes == 2:
            record["density"] /= spec.span_mps / spec.burst_s
    record["max_hypotheses"] = options.hypotheses or 1
    if record["max_hypotheses"] > 1:
        record["max_depth"] = -math.log(options.prune_below) if options.prune_below > 0 else UNLIMITED_DEPTH
        record["averages"] = options.estimate == "mean"
    if menu is not None:
        record["top"], record["levels"], record["ratio"] = menu.top, menu.levels, np.log(RATIOS)
        record["fixed"] = menu.top if options.forecast != "track" else 0.0
    return record


# ---- exact -----------------------------------------------------------------------------------------------------------
def has_exact_errors(options: Any) -> bool:
    """Whether a filter's errors are known exactly: its estimates always lock, or it takes none."""
    return options.takes == 0 or options.estimator == "fisher_bound"


def locked_errors(spec: Any, options: Any, sigma: np.ndarray, defects: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance (K, 3), (K, 3, 3) of the errors of a filter whose estimates always lock.

    sigma (K, 2) of velocity and acceleration; defects (K, 3) of the model, see `model_defects`. The filter's
    covariance P gives the gains; that of the errors, S, has no manoeuvre noise."""
    F, S, mean = algebra.constant_acceleration(spec.radar.scan_period_s), designation(spec), (0.0, 0.0, 0.0)
    means, covariances = np.zeros((len(defects), 3)), np.zeros((len(defects), 6))
    for k, corrections in enumerate(corrections_by_scan(spec, options, sigma)):
        if k > 0:
            S = algebra.predicted_covariance(S, F, algebra.NO_NOISE)
            mean = algebra.add_scaled(algebra.predicted(mean, F), 1.0, defects[k])
        for c, gain, variance in corrections:
            S, mean = algebra.CORRECT[c](S, variance, gain), algebra.add_scaled(mean, -mean[c], gain)
        means[k], covariances[k] = mean, S
    return means, algebra.unpack(covariances.T)


def designation(spec: Any) -> tuple[float, ...]:
    """The packed covariance after the first range, with the prior of velocity and acceleration."""
    variances = spec.radar.sigma_range_m**2, spec.prior.sigma_velocity_mps**2, spec.prior.sigma_acceleration_mps2**2
    return variances[0], 0.0, 0.0, variances[1], 0.0, variances[2]


def corrections_by_scan(spec: Any, options: Any, sigma: np.ndarray) -> Iterator[list[tuple[int, Any, float]]]:
    """For each scan the numbers that a filter takes: component, gain (3,), variance. sigma as in `locked_errors`."""
    dt = spec.radar.scan_period_s
    F, Q = (
        algebra.constant_acceleration(dt),
        algebra.pack(process_noise(options.process_noise, options.manoeuvre_variance, dt)),
    )
    P = designation(spec)
    for k in range(len(sigma)):
        if k > 0:
            P = algebra.predicted_covariance(P, F, Q if k >= start_scans(options) else algebra.NO_NOISE)
        corrections = []
        for c in range(0 if k else 1, options.takes + 1):
            variance = float(spec.radar.sigma_range_m**2 if c == 0 else sigma[k, c - 1] ** 2)
            P, gain, _ = algebra.TAKE[c](P, variance, 1.0)
            corrections.append((c, gain, variance))
        yield corrections


def lost_burst_errors(spec: Any, options: Any, sigma: np.ndarray) -> np.ndarray:
    """The mean squares (K, 3) that lost bursts add to a filter's errors, divided by the probability of a loss.

    This is the mean square of the response to a lost burst, summed over the bursts up to a scan. A lost estimate is
    uniform over the span (the acceleration over one that sweeps it), and is taken as measured; if the next forecast
    depends on it, it confirms itself from scan to scan. A gate, a mixture or hypotheses respond less."""
    F, scans = algebra.constant_acceleration(spec.radar.scan_period_s), len(sigma)
    size = np.array([spec.span_mps, spec.span_mps / spec.burst_s]) / math.sqrt(12.0)
    responses, squares = np.zeros((3, scans, 2)), np.zeros((scans, 3))  # to a unit error in each burst
    for k, corrections in enumerate(corrections_by_scan(spec, options, sigma)):
        responses = np.array(algebra.predicted(responses, F))
        is_answered = np.arange(scans) <= k if options.forecast == "track" else np.arange(scans) == k
        for c, gain, _ in corrections:
            responses = np.array(algebra.add_scaled(responses, -responses[c], gain))
            if c:
                responses[:, is_answered, c - 1] += np.array(gain)[:, None]
        squares[k] = np.einsum("xjc,c->x", responses**2, size**2)
    return squares


def max_loss_probability(bursts: Sequence[Burst], options: Any) -> float:
    """An upper bound of the probability that a burst is lost: for a spectrum from its energy, else one.

    A line of noise is higher than the signal's with probability exp(−E/2)/2, where E is the energy over the noise's
    density (Rife & Boorstyn 1974), if the two lines are orthogonal. With lines at half that distance the signal's is
    reduced to sinc²(1/4) at worst, and a side lobe of it, 0.217 of its height, adds to the other one."""
    if options.estimator != "spectrum":
        return 1.0
    min_ratio = min(energy_ratio(burst, burst.duration_s) for burst in dict.fromkeys(bursts))
    energy = np.sinc(0.25) ** 2 * (1.0 - 0.217) * min_ratio
    return float(min(1.0, bursts[0].pulses * math.exp(-0.5 * energy)))
