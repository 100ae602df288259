"""Plots of a strip of scans for eight realisations: noise by counter, biconical coordinates, local frame, covariance.

Layout of the noise: a scan takes three normals. The pair 24 s + j of a realisation (j = 0 … 23) gives the normals j and
24 + j of the 48 of strip s, whose scan n takes 3 n, 3 n + 1, 3 n + 2 for range, elevation, azimuth. Of the stream of
detections, the pair 8 s + j gives the uniform numbers of the scans j and 8 + j of strip s.

Letters, each of eight lanes:

    r                       measured range, m
    sine_e, cosine_e        of the measured elevation; sine_a, cosine_a: of the azimuth (biconical)
    u                       direction cosine of the plot along the antenna's normal, u² = 1 - sine_e² - sine_a²
    x, y, z                 position (antenna's axes: x along the normal)
    p                       covariance of a plot R J diag(sigma²) J' R' (eq. 10) as (xx, xy, xz, yy, yz, zz), m²
    detected                1 where a plot is detected, else 0

`frame` is the address of the plain numbers of a sensor, see `frame` and `records`.
"""

import numpy as np

from radarsim.kernels.algebra import dot
from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.lanes import WIDTH, address, full, get, put, root, row, where_greater
from radarsim.kernels.random import U, fill_normal_strip, sine_cosine_polynomial, threefry, uniform
from radarsim.studies.multimodel.kernels import records as rec

STRIP = 16  # scans
NORMALS, UNIFORMS = 3 * STRIP, STRIP
RANDOM = NORMALS + UNIFORMS  # rows of random numbers of a strip
NEARLY_OUTSIDE = 0.1  # u under which no covariance at the prediction is used
LEAST = 1e-6  # least u²: nearer to the antenna's plane a plot is missed


def frame(rotation, height: float, sigma, form: int, unbiased: bool, detection: float) -> np.ndarray:
    """The numbers (FRAME,) of a sensor, in the order of `records`.

    rotation (3, 3) from the antenna's axes to the local ones; height of the phase centre, m; sigma (3,) of range (m),
    elevation and azimuth (rad), or of x, y, z (m) where form is CARTESIAN; unbiased: with the unbiased conversion;
    detection: probability of detection.
    """
    return np.concatenate([np.ravel(rotation), sigma, [height, form, unbiased, detection, 0.0, 0.0]]).astype(float)


@part
def draw_strip(keys, first, strip, random):
    """Random numbers of strip `strip` for the realisations first … first + 7, into `random` (RANDOM rows).

    keys (2, 2): streams of the noise and of the detections.
    """
    size = NORMALS // 2 * WIDTH
    fill_normal_strip(keys[0], first, strip * (NORMALS // 2), random[:size], random[size : 2 * size])
    k0, k1 = keys[1, 0], keys[1, 1]
    half = NORMALS * WIDTH + UNIFORMS // 2 * WIDTH
    for n in range(UNIFORMS // 2 * WIDTH):
        x, y = threefry(U(first) + U(n % WIDTH), U(strip * (UNIFORMS // 2)) + U(n // WIDTH), k0, k1)
        random[NORMALS * WIDTH + n], random[half + n] = uniform(x), uniform(y)


@inline
def rotated(frame, x):
    """R x: from the antenna's axes to those of the local frame."""
    return (
        frame[0] * x[0] + frame[1] * x[1] + frame[2] * x[2],
        frame[3] * x[0] + frame[4] * x[1] + frame[5] * x[2],
        frame[6] * x[0] + frame[7] * x[1] + frame[8] * x[2],
    )


@inline
def covariance(frame, r, sine_e, cosine_e, sine_a, cosine_a, u):
    """R J diag(sigma²) J' R' of eq. (10); a, b, c: the columns of R J diag(sigma)."""
    zero, s = full(0.0), 1.0 / u
    a = rotated(frame, (u * frame[rec.SIGMA], sine_e * frame[rec.SIGMA], sine_a * frame[rec.SIGMA]))
    t = r * cosine_e * frame[rec.SIGMA + 1]
    b = rotated(frame, ((0.0 - t) * sine_e * s, t, zero))
    t = r * cosine_a * frame[rec.SIGMA + 2]
    c = rotated(frame, ((0.0 - t) * sine_a * s, zero, t))
    x, y, z = (a[0], b[0], c[0]), (a[1], b[1], c[1]), (a[2], b[2], c[2])
    return dot(x, x), dot(x, y), dot(x, z), dot(y, y), dot(y, z), dot(z, z)


@inline
def put_plot(plots, x, p, detected):
    """Write a plot's rows: position, covariance, detection."""
    for i in range(3):
        put(plots, rec.POSITION + i, x[i])
    for i in range(6):
        put(plots, rec.COVARIANCE + i, p[i])
    put(plots, rec.DETECTED, detected)


@inline
def biconical_plot(plots, frame, r, sine_e, cosine_e, sine_a, cosine_a, detected):
    """A plot of range r and the two biconical angles, in the local frame (eq. 10 and the two turns)."""
    e2, a2 = sine_e * sine_e, sine_a * sine_a
    u2, least = 1.0 - e2 - a2, full(LEAST)
    detected = where_greater(u2, least, detected, full(0.0))
    u2 = where_greater(u2, least, u2, least)
    u = root(u2)
    x = (r * u, r * sine_e, r * sine_a)
    if frame[rec.UNBIASED] == 1.0:
        # E[sin] shrinks by exp(-variance / 2); the second-order term of the Taylor series of u is subtracted.
        ve, va = frame[rec.SIGMA + 1] * frame[rec.SIGMA + 1], frame[rec.SIGMA + 2] * frame[rec.SIGMA + 2]
        ce2, ca2, s = 1.0 - e2, 1.0 - a2, 1.0 / u
        bend = ve * (e2 - ce2 - e2 * ce2 * s * s) + va * (a2 - ca2 - a2 * ca2 * s * s)
        x = (r * (u - 0.5 * s * bend), r * sine_e * (1.0 + 0.5 * ve), r * sine_a * (1.0 + 0.5 * va))
    x = rotated(frame, x)
    p = covariance(frame, r, sine_e, cosine_e, sine_a, cosine_a, u)
    put_plot(plots, (x[0], x[1] + frame[rec.HEIGHT], x[2]), p, detected)


@inline
def turned(sine, cosine, delta):
    """Sine and cosine of an angle increased by delta (lanes, |delta| up to pi/4)."""
    s, c = sine_cosine_polynomial(delta)
    return sine * c + cosine * s, cosine * c - sine * s


@inline
def make_plots(random, frame, truth, scan, scans, certain, plots):
    """Plots of the scans `scan` … of a strip from their random rows.

    truth: PLOT_TRUTH plain numbers a scan of the whole track. The first `certain` plots of a track are always
    detected.
    """
    one, zero = full(1.0), full(0.0)
    for n in range(scans):
        t, at, normal = rec.PLOT_TRUTH * (scan + n), rec.PLOT_TRUTH * (scan + n) + rec.COORDINATES, 3 * n
        a, b, c = get(random, normal), get(random, normal + 1), get(random, normal + 2)
        detected = where_greater(full(frame[rec.DETECTION]), get(random, NORMALS + n), one, zero)
        if scan + n < certain:
            detected = one
        s0, s1, s2 = frame[rec.SIGMA], frame[rec.SIGMA + 1], frame[rec.SIGMA + 2]
        if frame[rec.FORM] == rec.CARTESIAN:
            x = truth[at] + s0 * a, truth[at + 1] + s1 * b, truth[at + 2] + s2 * c
            put_plot(
                row(plots, n * rec.PLOT), x, (full(s0 * s0), zero, zero, full(s1 * s1), zero, full(s2 * s2)), detected
            )
        else:
            sine_e, cosine_e = turned(truth[t + rec.ELEVATION], truth[t + rec.ELEVATION + 1], s1 * b)
            sine_a, cosine_a = turned(truth[t + rec.AZIMUTH], truth[t + rec.AZIMUTH + 1], s2 * c)
            r = truth[t + rec.RANGE] + s0 * a
            biconical_plot(row(plots, n * rec.PLOT), frame, r, sine_e, cosine_e, sine_a, cosine_a, detected)


@part
def noise_at_prediction(frame, mean, wait, at_plot, noise):
    """Covariance (6 rows at `noise`) of a plot at the place that the estimate `mean` (9 rows) is extrapolated to over
    `wait` s, eq. (10).

    Where this place is outside the sector, or nearly so, the covariance at the plot (6 rows at `at_plot`) is taken.
    """
    half = 0.5 * wait * wait
    a = get(mean, 0) + wait * get(mean, 1) + half * get(mean, 2)
    b = get(mean, 3) + wait * get(mean, 4) + half * get(mean, 5) - frame[rec.HEIGHT]
    c = get(mean, 6) + wait * get(mean, 7) + half * get(mean, 8)
    x = frame[0] * a + frame[3] * b + frame[6] * c
    y = frame[1] * a + frame[4] * b + frame[7] * c
    z = frame[2] * a + frame[5] * b + frame[8] * c
    r = root(x * x + y * y + z * z)
    scale, least, one = 1.0 / r, full(NEARLY_OUTSIDE), full(1.0)
    sine_e, sine_a, u = y * scale, z * scale, x * scale
    inside = where_greater(u, least, one, full(0.0))
    sine_e, sine_a = sine_e * inside, sine_a * inside
    u = where_greater(u, least, u, one)
    p = covariance(frame, r, sine_e, root(one - sine_e * sine_e), sine_a, root(one - sine_a * sine_a), u)
    for i in range(6):
        put(noise, i, where_greater(inside, full(0.5), p[i], get(at_plot, i)))


@kernel
def fill_plots(keys, frame, truth, certain, first, random, plots):
    """All plots of the realisations first … first + 7 of a track, PLOT rows a scan; truth (K, PLOT_TRUTH)."""
    scans = truth.shape[0]
    for k in range(0, scans, STRIP):
        draw_strip(keys, first, k // STRIP, random)
        to = row(address(plots), k * rec.PLOT)
        make_plots(address(random), address(frame), address(truth), k, min(STRIP, scans - k), certain, to)
