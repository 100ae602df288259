"""Plots of a strip of scans, eight realisations at a time: noise by counter, biconical and local coordinates.

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

`frame` is the address of the plain numbers of a sensor, see `pack_frame` and `layout`."""

import numpy as np

from radarsim.kernels.compiler import inline, kernel, kernel_part
from radarsim.kernels.kalman_algebra import dot
from radarsim.kernels.lanes import WIDTH, address, full, get, put, row, square_root, where_greater
from radarsim.kernels.polynomials import sine_cosine_polynomial
from radarsim.kernels.random import U, fill_normal_strip, threefry, uniform
from radarsim.studies.multimodel.kernels import layout

STRIP = 16  # scans
NORMALS, UNIFORMS = 3 * STRIP, STRIP
RANDOM = NORMALS + UNIFORMS  # rows of random numbers of a strip
MIN_U = 0.1  # of u, below which no covariance at the prediction is used
MIN_U2 = 1e-6  # of u²: closer to the antenna's plane a plot is missed


def pack_frame(rotation, height: float, sigma, form: int, unbiased: bool, detection: float) -> np.ndarray:
    """The numbers (FRAME,) of a sensor, in the order of `records`.

    rotation (3, 3) from the antenna's axes to the local ones; height of the phase centre, m; sigma (3,) of range (m),
    elevation and azimuth (rad), or of x, y, z (m) where form is CARTESIAN; unbiased: with the unbiased conversion;
    detection: probability of detection."""
    return np.concatenate([np.ravel(rotation), sigma, [height, form, unbiased, detection, 0.0, 0.0]]).astype(float)


@kernel_part
def draw_strip(keys, first, strip, random):
    """Fill `random` (RANDOM rows) with the random numbers of a strip for the realisations first … first + 7.

    keys (2, 2): streams of the noise and of the detections."""
    size = NORMALS // 2 * WIDTH
    fill_normal_strip(keys[0], first, strip * (NORMALS // 2), random[:size], random[size : 2 * size])
    k0, k1 = keys[1, 0], keys[1, 1]
    half = NORMALS * WIDTH + UNIFORMS // 2 * WIDTH
    for n in range(UNIFORMS // 2 * WIDTH):
        x, y = threefry(U(first) + U(n % WIDTH), U(strip * (UNIFORMS // 2)) + U(n // WIDTH), k0, k1)
        random[NORMALS * WIDTH + n], random[half + n] = uniform(x), uniform(y)


@inline
def to_local(frame, x):
    """R x: a vector in the antenna's axes as one in those of the local frame."""
    return (
        frame[0] * x[0] + frame[1] * x[1] + frame[2] * x[2],
        frame[3] * x[0] + frame[4] * x[1] + frame[5] * x[2],
        frame[6] * x[0] + frame[7] * x[1] + frame[8] * x[2],
    )


@inline
def covariance(frame, r, sine_e, cosine_e, sine_a, cosine_a, u):
    """R J diag(sigma²) J' R' of eq. (10); a, b, c: the columns of R J diag(sigma)."""
    zero, s = full(0.0), 1.0 / u
    a = to_local(frame, (u * frame[layout.SIGMA], sine_e * frame[layout.SIGMA], sine_a * frame[layout.SIGMA]))
    t = r * cosine_e * frame[layout.SIGMA + 1]
    b = to_local(frame, ((0.0 - t) * sine_e * s, t, zero))
    t = r * cosine_a * frame[layout.SIGMA + 2]
    c = to_local(frame, ((0.0 - t) * sine_a * s, zero, t))
    x, y, z = (a[0], b[0], c[0]), (a[1], b[1], c[1]), (a[2], b[2], c[2])
    return dot(x, x), dot(x, y), dot(x, z), dot(y, y), dot(y, z), dot(z, z)


@inline
def put_plot(plots, x, p, detected):
    """Write a plot's rows: position, covariance, detection."""
    for i in range(3):
        put(plots, layout.POSITION + i, x[i])
    for i in range(6):
        put(plots, layout.COVARIANCE + i, p[i])
    put(plots, layout.DETECTED, detected)


@inline
def biconical_plot(plots, frame, r, sine_e, cosine_e, sine_a, cosine_a, detected):
    """Write a plot of range r and two biconical angles, in the local frame (eq. 10 and the two rotations)."""
    e2, a2 = sine_e * sine_e, sine_a * sine_a
    u2, min_u2 = 1.0 - e2 - a2, full(MIN_U2)
    detected = where_greater(u2, min_u2, detected, full(0.0))
    u2 = where_greater(u2, min_u2, u2, min_u2)
    u = square_root(u2)
    x = (r * u, r * sine_e, r * sine_a)
    if frame[layout.UNBIASED] == 1.0:
        # E[sin] shrinks by exp(-variance / 2); the second-order term of the Taylor series of u is subtracted.
        ve, va = frame[layout.SIGMA + 1] * frame[layout.SIGMA + 1], frame[layout.SIGMA + 2] * frame[layout.SIGMA + 2]
        ce2, ca2, s = 1.0 - e2, 1.0 - a2, 1.0 / u
        second_order = ve * (e2 - ce2 - e2 * ce2 * s * s) + va * (a2 - ca2 - a2 * ca2 * s * s)
        x = (r * (u - 0.5 * s * second_order), r * sine_e * (1.0 + 0.5 * ve), r * sine_a * (1.0 + 0.5 * va))
    x = to_local(frame, x)
    p = covariance(frame, r, sine_e, cosine_e, sine_a, cosine_a, u)
    put_plot(plots, (x[0], x[1] + frame[layout.HEIGHT], x[2]), p, detected)


@inline
def turn_angle(sine, cosine, delta):
    """Sine and cosine of an angle increased by delta (lanes, |delta| up to pi/4)."""
    s, c = sine_cosine_polynomial(delta)
    return sine * c + cosine * s, cosine * c - sine * s


@inline
def make_plots(random, frame, truth, scan, scans, detected_plots, plots):
    """Write the plots of the scans `scan` … of a strip from their random rows.

    truth: PLOT_TRUTH plain numbers for each scan of the track. The first `detected_plots` plots of a track are always
    detected."""
    unit, zero = full(1.0), full(0.0)
    for n in range(scans):
        t, coordinates, normal = (
            layout.PLOT_TRUTH * (scan + n),
            layout.PLOT_TRUTH * (scan + n) + layout.COORDINATES,
            3 * n,
        )
        a, b, c = get(random, normal), get(random, normal + 1), get(random, normal + 2)
        detected = where_greater(full(frame[layout.DETECTION]), get(random, NORMALS + n), unit, zero)
        if scan + n < detected_plots:
            detected = unit
        s0, s1, s2 = frame[layout.SIGMA], frame[layout.SIGMA + 1], frame[layout.SIGMA + 2]
        if frame[layout.FORM] == layout.CARTESIAN:
            x = truth[coordinates] + s0 * a, truth[coordinates + 1] + s1 * b, truth[coordinates + 2] + s2 * c
            put_plot(
                row(plots, n * layout.PLOT),
                x,
                (full(s0 * s0), zero, zero, full(s1 * s1), zero, full(s2 * s2)),
                detected,
            )
        else:
            sine_e, cosine_e = turn_angle(truth[t + layout.ELEVATION], truth[t + layout.ELEVATION + 1], s1 * b)
            sine_a, cosine_a = turn_angle(truth[t + layout.AZIMUTH], truth[t + layout.AZIMUTH + 1], s2 * c)
            r = truth[t + layout.RANGE] + s0 * a
            biconical_plot(row(plots, n * layout.PLOT), frame, r, sine_e, cosine_e, sine_a, cosine_a, detected)


@kernel_part
def noise_at_prediction(frame, mean, wait, plot_noise, noise):
    """Write the covariance (6 rows at `noise`) of a plot at the position predicted from `mean` (9 rows), eq. (10).

    The prediction is over `wait` s. If the position is outside the sector, or nearly so, the covariance at the plot
    (6 rows at `plot_noise`) is used."""
    half = 0.5 * wait * wait
    a = get(mean, 0) + wait * get(mean, 1) + half * get(mean, 2)
    b = get(mean, 3) + wait * get(mean, 4) + half * get(mean, 5) - frame[layout.HEIGHT]
    c = get(mean, 6) + wait * get(mean, 7) + half * get(mean, 8)
    x = frame[0] * a + frame[3] * b + frame[6] * c
    y = frame[1] * a + frame[4] * b + frame[7] * c
    z = frame[2] * a + frame[5] * b + frame[8] * c
    r = square_root(x * x + y * y + z * z)
    scale, min_u, unit = 1.0 / r, full(MIN_U), full(1.0)
    sine_e, sine_a, u = y * scale, z * scale, x * scale
    in_sector = where_greater(u, min_u, unit, full(0.0))
    sine_e, sine_a = sine_e * in_sector, sine_a * in_sector
    u = where_greater(u, min_u, u, unit)
    p = covariance(
        frame, r, sine_e, square_root(unit - sine_e * sine_e), sine_a, square_root(unit - sine_a * sine_a), u
    )
    for i in range(6):
        put(noise, i, where_greater(in_sector, full(0.5), p[i], get(plot_noise, i)))


@kernel
def fill_plots(keys, frame, truth, detected_plots, first, random, plots):
    """Fill in all plots of realisations first … first + 7 of a track, PLOT rows a scan; truth (K, PLOT_TRUTH)."""
    scans = truth.shape[0]
    for k in range(0, scans, STRIP):
        draw_strip(keys, first, k // STRIP, random)
        target = row(address(plots), k * layout.PLOT)
        make_plots(address(random), address(frame), address(truth), k, min(STRIP, scans - k), detected_plots, target)


@kernel
def fill_noise(keys, frame, truth, detected_plots, first, random, plots, noise):
    """Fill noise (3, n, K) with the unit normals of plots of realisations from `first` on; not-a-number where missed.

    random, plots: work arrays of RANDOM rows, and of PLOT rows for each scan of a strip."""
    scans, count = noise.shape[2], noise.shape[1]
    for g in range(0, count, WIDTH):
        for k in range(0, scans, STRIP):
            draw_strip(keys, first + g, k // STRIP, random)
            length = min(STRIP, scans - k)
            make_plots(address(random), address(frame), address(truth), k, length, detected_plots, address(plots))
            for lane in range(min(WIDTH, count - g)):
                for n in range(length):
                    is_missed = plots[(n * layout.PLOT + layout.DETECTED) * WIDTH + lane] < 0.5
                    for m in range(3):
                        noise[m, g + lane, k + n] = np.nan if is_missed else random[(3 * n + m) * WIDTH + lane]
