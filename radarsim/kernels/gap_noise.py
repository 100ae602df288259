"""Process noise over the time between two rows of a recording: the same whether a missed plot has an empty row or none.

The jerk of a target, or its acceleration, is drawn anew in each scan period. Over n periods the noise is therefore the
sum of that of n scans, each carried on to the end; sums of powers give it in closed form as a polynomial in 1 / n.
Between n and n + 1 periods it is interpolated linearly between n and n + 1 equal draws over the whole time: so it stays
a covariance, and its variances grow with time. Up to one period there is one draw."""

from radarsim.kernels.kalman_algebra import NO_NOISE, add_outer, inline

ONE_PERIOD = 1.0 + 1e-9  # up to which rounding makes a time of one period


@inline
def draw_powers(periods):
    """The powers 1 to 5 of 1 / n for n draws, interpolated between the whole numbers n next to `periods` (> 1)."""
    part = periods % 1
    u = 1 / (periods - part)
    w = 1 / (periods - part + 1)
    u2, w2 = u * u, w * w
    return (
        u + part * (w - u),
        u2 + part * (w2 - u2),
        u * u2 + part * (w * w2 - u * u2),
        u2 * u2 + part * (w2 * w2 - u2 * u2),
        u * u2 * u2 + part * (w * w2 * w2 - u * u2 * u2),
    )


@inline
def manoeuvre_noise(variance, t, period, size):
    """Q, packed, over a time t of a random derivative of order `size`, 2 or 3, drawn with a variance in each period."""
    half = 0.5 * t * t
    if t <= ONE_PERIOD * period:
        g = (half, t, 0.0) if size == 2 else (t * half / 3.0, half, t)
        return add_outer(NO_NOISE, variance, g)
    u1, _, u3, _, u5 = draw_powers(t / period)
    t2 = t * t
    last, mixed, middle = variance * u1 * t2, variance * u1 * t2 * t / 2, variance * t2 * t2 * (4 * u1 - u3) / 12
    if size == 2:
        return middle, mixed, 0.0 * last, last, 0.0 * last, 0.0 * last
    first = variance * t2 * t2 * t2 * (9 * u1 - 5 * u3 + u5) / 180
    return first, variance * t2 * t2 * t * (3 * u1 - u3) / 24, variance * t2 * t2 * u1 / 6, middle, mixed, last


@inline
def acceleration_step_noise(density, t, period):
    """Q, packed, over a time t of steps of the acceleration, one at the beginning of each period and each of the
    variance density · its length."""
    u1, u2, u4 = 1.0, 1.0, 1.0
    if t > ONE_PERIOD * period:
        u1, u2, _, u4, _ = draw_powers(t / period)
    t2, q = t * t, density * t
    return (
        q * t2 * t2 * (6 + 15 * u1 + 10 * u2 - u4) / 120,
        q * t2 * t * (1 + 2 * u1 + u2) / 8,
        q * t2 * (2 + 3 * u1 + u2) / 12,
        q * t2 * (2 + 3 * u1 + u2) / 6,
        q * t * (1 + u1) / 2,
        q,
    )


@inline
def white_jerk_noise(density, t):
    """Q, packed, over a time t of white jerk of a spectral density: the same for any rows between."""
    t2, q = t * t, density * t
    return q * t2 * t2 / 20, q * t2 * t / 8, q * t2 / 6, q * t2 / 3, q * t / 2, q
