"""Menus of windows: for each accuracy of the track's forecast the windows of a burst.

A sequence that forecasts by its track takes its windows from a menu. They are designed for standard deviations of
velocity and acceleration in geometric progression; each scan of each realisation takes the smallest that is not below
its own. The menu begins with the uncertainty that ranges alone leave, and ends where the whole burst is the first
window."""

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from radarsim.bursts import schedule_design
from radarsim.bursts.burst import Burst
from radarsim.bursts.fisher import fisher
from radarsim.physics.motion import process_noise, transition
from radarsim.studies.pulses_to_tracks.scenario import burst_centre

RATIOS = (math.sqrt(2.0), 2.0)  # of neighbouring standard deviations of a menu: velocity, acceleration
MAX_LEVELS = (40, 16)
MIN_CURVATURE_TURNS = 0.02  # turns that an acceleration makes at the ends of the burst, below which it is neglected
UNKNOWN_RAD = 2.0 * math.pi  # the phase's spread before a burst


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


def designer(burst: Burst, size: int, spreads: tuple[float, float]) -> schedule_design.Designer:
    """The designer of a forecast's windows: by the paper's Gaussian tail, P_Δ = 0.99, c = 1."""
    sigma = theta_spreads(burst, size, spreads)
    return schedule_design.Designer(burst, sigma, partial(fisher, burst, size), schedule_design.Condition())


def sequence_windows(burst: Burst, options: Any, spreads: tuple[float, float]) -> tuple[int, ...]:
    """The windows in pulses of a filter's sequence; raises NoSchedule if there are none."""
    lengths = designer(burst, parameter_count(options), spreads).windows()
    return tuple(schedule_design.densify(lengths, 2) if options.estimator == "dense" else lengths)


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
