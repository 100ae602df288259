"""What a gain depends on: steady errors in closed form, as the scan period becomes short.

With τ₁ = σ_r/σ_V and τ₂ = (σ_r²/D_M)^(1/6) a gain depends on k, C_θ = (τ₁/Δt)² and Λ = (Δt/τ₂)³ alone. As Δt → 0 the
plots become white noise of density σ_r²Δt and σ_V²Δt, the manoeuvre a white jerk of density D_M Δt, and what is left is
t/τ₁ and c = (τ₁/τ₂)². Derived in docs/chart.md, tested against the recursion."""

from typing import NamedTuple

import numpy as np

# Where Δt/τ₁ and Δt/τ₂ are at most SMALL and c at most LARGEST, gains with the first order of the period are within
# ERROR_POINTS of the recursion's, up to c of MODERATE within MODERATE_POINTS. As functions of c alone, without it, they
# are within LIMIT_POINTS. What grows with c is the error in acceleration: the fastest root, ~ √2 c^(1/4)/τ₂, is no
# longer slow against a scan.
MAX_STEP, MAX_C, MODERATE_C = 0.05, 5e4, 1000.0
LIMIT_POINTS, ERROR_POINTS, MODERATE_POINTS = 0.55, 0.5, 0.11


class Groups(NamedTuple):
    """The dimensionless numbers on which the gains of a radar depend; c holds neither Δt."""

    C_theta: float
    Lambda: float
    c: float


def dimensionless_groups(
    sigma_range_m: float, sigma_velocity_mps: float, dt: float, manoeuvre_variance: float
) -> Groups:
    """C_θ (11), Λ = √D_M Δt³/σ_r, and c = (σ_r/σ_V)² (D_M/σ_r²)^(1/3)."""
    memory = filter_memory(sigma_range_m, manoeuvre_variance)
    ratio = sigma_range_m / sigma_velocity_mps
    return Groups((ratio / dt) ** 2, (dt / memory) ** 3, (ratio / memory) ** 2)


def filter_memory(sigma_range_m: float, manoeuvre_variance: float) -> float:
    """τ₂ = (σ_r²/D_M)^(1/6), s."""
    return float((sigma_range_m**2 / manoeuvre_variance) ** (1 / 6))


def damping(c: np.ndarray | float) -> np.ndarray:
    """A, the greatest root of A⁴ − 8A = 4c for c ≥ 0, of any shape, to rounding (Newton's method from above)."""
    c = np.asarray(c, dtype=float)
    A = 2.0 + np.sqrt(2.0) * c**0.25
    for _ in range(60):
        A = A - (A**4 - 8 * A - 4 * c) / (4 * A**3 - 8)
    return A


def error_polynomial(c: float) -> np.ndarray:
    """Coefficients (4,), highest power first, of the limit filter's error in units of τ₂: s³ + As² + (A²/2)s + 1. Of
    range and velocity, c > 0, A is `damping`; of the range alone c = 0 and A = 2."""
    A = float(damping(c))
    return np.array([1.0, A, A**2 / 2, 1.0])


def believed_covariance(c: np.ndarray | float) -> np.ndarray:
    """Steady covariance (3, 3, …) that the limit filter believes, over σ_r² Δt/τ₂ and powers of τ₂: rational in A. The
    solution of the algebraic Riccati equation; derived in docs/chart.md."""
    A = damping(c)
    X = A**3
    W = X**2 - 8 * X + 8
    p11, p12, p13, p22 = 2 * A * (X - 4) / W, 4 * A**2 / W, 8 / W, 4 * (X - 2) / W
    p33 = p12 * p13 + A * (X - 8) / 4 * p22 * p11
    return np.array([[p11, p12, p13], [p12, p22, p11], [p13, p11, p33]])


def steady_gain(c: float) -> np.ndarray:
    """Gain (3, 2) of the limit filter on range and velocity, in units of σ_r and τ₂; c = 0: the second column is zero.
    The error that it leaves has the characteristic polynomial `error_polynomial`."""
    return believed_covariance(c)[:, :2] * np.array([1.0, c])


def noise_variances(c: np.ndarray | float, step: np.ndarray | float = 0.0) -> np.ndarray:
    """σ_r², σ_V², σ_a² (3, …) of the limit filter on a quadratic truth, over σ_r² Δt/τ₂ · (1, τ₂⁻², τ₂⁻⁴). Of the range
    alone, c = 0, they are 5/3, 3/2, 1/3. They are what the filter believes, less what the manoeuvre would add that such
    a truth has not. step is Δt/τ₂, to first order: half a scan of extrapolation."""
    A, P = damping(c), believed_covariance(c)
    X, p11 = A**3, P[0, 0]
    b, d = A**2 / 2 - A * (X - 8) / 4 * p11, X - 2
    range_variance = P[0, 0] - P[0, 2] ** 2 * A / d - step * (P[0, 1] - P[0, 2] * p11 * A / d)
    velocity_variance = P[1, 1] - (1 + p11**2 * A) / d - step * (P[1, 2] - (A - p11 + p11 * b * A) / d)
    return np.array([range_variance, velocity_variance, P[2, 2] - (1.5 * A**2 - 2 * b + b**2 * A) / d])


def steady_gains(c: np.ndarray | float, step: np.ndarray | float = 0.0) -> np.ndarray:
    """Relative gains (3, …) of range, velocity, acceleration by the velocity in the limit, %: functions of c alone.
    Within LIMIT_POINTS of the recursion up to SMALL and LARGEST; with the first order of the period, step = Δt/τ₂,
    within ERROR_POINTS."""
    with np.errstate(invalid="ignore"):
        return 100 * (1 - np.sqrt(noise_variances(c, step) / noise_variances(np.zeros_like(c, dtype=float), step)))


def no_acceleration_gain() -> float:
    """The c at which the gain in acceleration changes its sign, to rounding: below it the velocity costs accuracy."""
    low, high = 0.5, 1.0
    while (c := (low + high) / 2) not in (low, high):
        low, high = (c, high) if steady_gains(c)[2] < 0 else (low, c)
    return c
