"""P1 (Gorshkov & Zavizhenets 2017): range-only against range + Doppler Kalman filters of the second order."""

from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.moments import Layout
from radarsim.engine.results import Axes
from radarsim.errors import ConfigError
from radarsim.kernels import linear as kernels
from radarsim.physics import targets
from radarsim.studies.noise import noise_key
from radarsim.studies.range_doppler import exact, filters

COMPONENTS = (("r", "m"), ("Vr", "m/s"), ("ar", "m/s2"))
BLOCK = 4096  # 8 chunks of 512; 0.4 ms with two filters and 15 scans


@dataclass(frozen=True, kw_only=True)
class RangeDopplerAxes(Axes):
    """Labels of P1's sums, and what its tables need beside them: F filters, K scans, components r, Vr, ar.

    believed (F, K, 3, 3) is the covariance that a filter believes, in m, m/s, m/s²; zero where it has no estimate.
    exact_nees (F, K) is the expectation of eᵀP⁻¹e per estimated component, no unit. observes (F,) is 1 for filters of
    the range, 2 for those of range and velocity; manoeuvre_variance (F,) their D_M in (m/s³)². sigma (2,) holds the
    standard deviations of the plots, m and m/s; C_theta is σ_r²/(Δt²σ_V²) (eq. 11), no unit.
    """

    believed: np.ndarray
    exact_nees: np.ndarray
    observes: np.ndarray
    manoeuvre_variance: np.ndarray
    sigma: np.ndarray
    scan_period_s: float
    C_theta: float
    wavelength_m: float
    repetition_rate_hz: float


@dataclass(frozen=True)
class Plan:
    """All that a block needs."""

    layout: Layout
    axes: RangeDopplerAxes
    problem: kernels.Problem
    block: int = BLOCK
    gaussian = True  # the errors are, with the exact bias and σ of the axes


def truth(target, t: np.ndarray) -> np.ndarray:
    """Range, radial velocity and acceleration (K, 3) of a configured target at times t (K,)."""
    match target.kind:
        case "polynomial":
            return targets.polynomial(target.coefficients, t)
        case "acceleration_start":
            return targets.acceleration_start(target.coefficients, target.acceleration_mps2, target.start_s, t)
        case "jerk_pulse":
            return targets.jerk_pulse(target.coefficients, target.jerk_mps3, target.start_s, target.duration_s, t)
        case "turn":
            return targets.turn(
                target.range_m,
                target.speed_mps,
                target.aspect_rad,
                target.acceleration_g,
                target.start_s,
                target.duration_s,
                t,
            )
    raise ValueError(f"no such target: {target.kind}")


def prepare(case: Case) -> Plan:
    """Design the filters of a case, its truth, and the exact values of its errors."""
    spec, radar = case.spec, case.spec.radar
    dt, scans = radar.scan_period_s, spec.scans
    sigma = np.array([radar.sigma_range_m, radar.sigma_velocity_mps])
    t = np.arange(scans) * dt
    x = truth(spec.target, t)
    if not (x[:, 0] > 0).all():
        k = int(np.flatnonzero(x[:, 0] <= 0)[0])
        fault = f"its range must stay > 0, is {x[k, 0]:g} m at {t[k]:g} s, scan {k + 1} of {scans}"
        raise ConfigError(f"{case.name}: target: {fault}")
    designs = [
        filters.design(len(f.observes), f.initial_scans, f.manoeuvre_variance, sigma, dt, scans) for f in spec.filters
    ]
    labels, longest = axes(spec, designs, x, sigma, t), max(d.start for d in designs)
    problem = kernels.Problem(
        key=noise_key(case, "plots"),
        truth=x,
        sigma=sigma,
        dt=dt,
        observes=labels.observes,
        start=np.array([d.start for d in designs]),
        weights=np.stack([np.pad(d.weights, ((0, 0), (0, 0), (0, longest - d.start))) for d in designs]),
        gains=np.stack([d.gains for d in designs]),
        baseline=labels.baseline,
    )
    return Plan(Layout(**kernels.shapes(len(designs), scans)), labels, problem.plain())


def axes(
    spec, designs: list[filters.LinearFilter], x: np.ndarray, sigma: np.ndarray, t: np.ndarray
) -> RangeDopplerAxes:
    """Labels and exact values: x (K, 3) the truth, sigma (2,) of the plots, t (K,) the times."""
    dt, names = spec.radar.scan_period_s, tuple(f.name for f in spec.filters)
    errors = [exact.error_recursion(d.weights, d.gains, d.observes, x, sigma, dt) for d in designs]
    bias = np.stack([b for b, _ in errors])
    variance = np.stack([np.diagonal(S, axis1=1, axis2=2) for _, S in errors])
    moment = np.stack([S for _, S in errors]) + bias[..., :, None] * bias[..., None, :]
    available, believed = np.stack([d.available for d in designs]), np.stack([d.believed for d in designs])
    return RangeDopplerAxes(
        filters=names,
        components=COMPONENTS,
        k=np.arange(1, len(t) + 1),
        t_s=t,
        available=available,
        baseline=names.index(spec.baseline) if spec.baseline else 0,
        exact_sigma=np.where(available, np.sqrt(variance + bias**2), np.nan),
        exact_bias=np.where(available, bias, np.nan),
        believed=believed,
        exact_nees=exact.normalised_error(believed, bias, moment, available)[0],
        observes=np.array([d.observes for d in designs]),
        manoeuvre_variance=np.array([f.manoeuvre_variance for f in spec.filters]),
        sigma=sigma,
        scan_period_s=dt,
        C_theta=float(sigma[0] ** 2 / (dt**2 * sigma[1] ** 2)),
        wavelength_m=spec.radar.wavelength_m,
        repetition_rate_hz=spec.radar.repetition_rate_hz,
    )


def simulate(plan: Plan, first: int, count: int) -> np.ndarray:
    """Sums of one block, in the order of the plan's layout."""
    sums = kernels.Sums(**{name: np.zeros(shape) for name, shape in plan.layout.shapes.items()})
    kernels.simulate_block(plan.problem, first, count, sums)
    return plan.layout.pack(**sums._asdict())
