"""Why P1's gains come out as they do: the groups on which they depend, and their steady limit for fast scans.

With τ₁ = σ_r/σ_V and τ₂ = (σ_r²/D_M)^(1/6) a gain depends on k, C_θ = (τ₁/Δt)² and Λ = (Δt/τ₂)³ alone. As Δt → 0 the
plots become white noise of density σ_r²Δt and σ_V²Δt, the manoeuvre a white jerk of density D_M Δt, and what is left is
t/τ₂ and c = (τ₁/τ₂)². Derived in docs/range_doppler.md, tested against the recursion.
"""

from typing import NamedTuple

import numpy as np

MOTION = np.diag([1.0, 1.0], 1)  # of (r, V, a) over time


class Groups(NamedTuple):
    """The dimensionless numbers on which the gains of a radar depend; c holds neither Δt."""

    C_theta: float
    Lambda: float
    c: float


def groups(sigma_range_m: float, sigma_velocity_mps: float, dt: float, manoeuvre_variance: float) -> Groups:
    """C_θ (11), Λ = √D_M Δt³/σ_r, and c = (σ_r/σ_V)² (D_M/σ_r²)^(1/3)."""
    memory = filter_memory(sigma_range_m, manoeuvre_variance)
    ratio = sigma_range_m / sigma_velocity_mps
    return Groups((ratio / dt) ** 2, (dt / memory) ** 3, (ratio / memory) ** 2)


def filter_memory(sigma_range_m: float, manoeuvre_variance: float) -> float:
    """τ₂ = (σ_r²/D_M)^(1/6), s."""
    return float((sigma_range_m**2 / manoeuvre_variance) ** (1 / 6))


def error_polynomial(c: float) -> np.ndarray:
    """Coefficients (4,), highest power first, of the limit filter's error in units of τ₂: s³ + a₂s² + (a₂²/2)s + 1.

    Of range and velocity, c > 0, a₂ is the positive root of a₂⁴ − 8a₂ = 4c; of the range alone c = 0 and a₂ = 2.
    """
    roots = np.roots([1.0, 0.0, 0.0, -8.0, -4.0 * c])
    a2 = float(max(root.real for root in roots if abs(root.imag) < 1e-9))
    return np.array([1.0, a2, a2**2 / 2, 1.0])


def steady_gain(c: float) -> np.ndarray:
    """Gain (3, 2) of the limit filter on range and velocity, in units of σ_r and τ₂; c = 0: the second column is zero.

    From the algebraic Riccati equation; the error that it leaves has the characteristic polynomial `error_polynomial`.
    """
    from scipy.linalg import solve_continuous_are

    H = np.eye(3)[:2] * np.array([[1.0], [np.sqrt(c)]])
    Q = np.diag([0.0, 0.0, 1.0])
    P = solve_continuous_are(MOTION.T, H.T, Q, np.eye(2))
    return P[:, :2] * np.array([1.0, c])


def noise_variances(c: float) -> np.ndarray:
    """σ_r², σ_V², σ_a² (3,) of the limit filter on a quadratic truth, over σ_r² Δt/τ₂ · (1, τ₂⁻², τ₂⁻⁴).

    Of the range alone, c = 0, they are 5/3, 3/2, 1/3. Solved from the Lyapunov equation of the noise that the gain
    lets through: no manoeuvre is in it.
    """
    from scipy.linalg import solve_continuous_lyapunov

    K = steady_gain(c)
    closed = MOTION - np.column_stack([K, np.zeros(3)])
    noise = np.diag([1.0, 1 / c if c else 0.0])
    return np.diag(solve_continuous_lyapunov(closed, -K @ noise @ K.T))


def steady_gains(c: float) -> np.ndarray:
    """Relative gains (3,) of range, velocity, acceleration by the velocity in the limit, %: functions of c alone."""
    return 100 * (1 - np.sqrt(noise_variances(c) / noise_variances(0.0)))


def no_acceleration_gain() -> float:
    """The c at which the gain in acceleration changes its sign: below it the velocity costs accuracy. 0.698."""
    from scipy.optimize import brentq

    return float(brentq(lambda c: steady_gains(c)[2], 0.1, 10.0, xtol=1e-12))
