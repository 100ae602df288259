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

`frame` is the address of the plain numbers of a sensor, see `pack_frame` and `records`.

A strip of scans with one filter: the track's start, models over the real interval, missed plots, outputs.

Letters, each of eight lanes but for the numbers i, j of models:

    dt            time of a prediction, s: since the previous plot
    F, Q          a model over it, eq. (11); F (5) and Q (6) of one axis, the same for all three
    T[i, j]       probability of passing from model j to model i over it, eq. (8)
    a, b, g (3)   weights of a track's start: x = Σ a z, v = Σ b z, and errors of the states by an acceleration
    R             covariance of a plot (6)

`work`, `plots`, `out` and the like are addresses.

A block of realisations: plots, all filters on them, and the sums of their estimates.

Letters, each of eight lanes:

    e          error of an estimate, by state (9), or of its position (3)
    e0         the same of the baseline filter
    p          probability of a model
    q          e' P⁻¹ e of the position, with the filter's own covariance
    active     1 for realisations of the block, 0 for those beyond its last

Arrays and their shapes: `records.World`, `Banks`, `Sums`; other arguments are addresses or numbers.

The log likelihood of recorded plots under a filter: the density that its bank gives each plot.

The filter is that of the simulation, run scan by scan. There its eight lanes are eight realisations; here lane 0 takes
the plots with the configured σ, lane 1 as outliers, with FACTOR times the σ. If there may be outliers, the two lanes
of each model are merged by moments after every plot."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels import lanes
from radarsim.kernels.algebra import dot, factored, scaled, whitened
from radarsim.kernels.compile import inline, kernel, part
from radarsim.kernels.hypotheses import FACTOR
from radarsim.kernels.lanes import WIDTH, address, full, get, get3, put, put3, root, row, rows, total, where_greater
from radarsim.kernels.random import U, fill_normal_strip, sine_cosine_polynomial, threefry, uniform
from radarsim.studies.multimodel.kernels import records as rec
from radarsim.studies.multimodel.kernels.hypothesis import merge, merge_gpb1, mixed_mean, put_shares, step
from radarsim.studies.multimodel.kernels.records import Rules

# ---- plots -----------------------------------------------------------------------------------------------------------
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


@part
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
    a = to_local(frame, (u * frame[rec.SIGMA], sine_e * frame[rec.SIGMA], sine_a * frame[rec.SIGMA]))
    t = r * cosine_e * frame[rec.SIGMA + 1]
    b = to_local(frame, ((0.0 - t) * sine_e * s, t, zero))
    t = r * cosine_a * frame[rec.SIGMA + 2]
    c = to_local(frame, ((0.0 - t) * sine_a * s, zero, t))
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
    """Write a plot of range r and two biconical angles, in the local frame (eq. 10 and the two rotations)."""
    e2, a2 = sine_e * sine_e, sine_a * sine_a
    u2, min_u2 = 1.0 - e2 - a2, full(MIN_U2)
    detected = where_greater(u2, min_u2, detected, full(0.0))
    u2 = where_greater(u2, min_u2, u2, min_u2)
    u = root(u2)
    x = (r * u, r * sine_e, r * sine_a)
    if frame[rec.UNBIASED] == 1.0:
        # E[sin] shrinks by exp(-variance / 2); the second-order term of the Taylor series of u is subtracted.
        ve, va = frame[rec.SIGMA + 1] * frame[rec.SIGMA + 1], frame[rec.SIGMA + 2] * frame[rec.SIGMA + 2]
        ce2, ca2, s = 1.0 - e2, 1.0 - a2, 1.0 / u
        second_order = ve * (e2 - ce2 - e2 * ce2 * s * s) + va * (a2 - ca2 - a2 * ca2 * s * s)
        x = (r * (u - 0.5 * s * second_order), r * sine_e * (1.0 + 0.5 * ve), r * sine_a * (1.0 + 0.5 * va))
    x = to_local(frame, x)
    p = covariance(frame, r, sine_e, cosine_e, sine_a, cosine_a, u)
    put_plot(plots, (x[0], x[1] + frame[rec.HEIGHT], x[2]), p, detected)


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
        t, coordinates, normal = rec.PLOT_TRUTH * (scan + n), rec.PLOT_TRUTH * (scan + n) + rec.COORDINATES, 3 * n
        a, b, c = get(random, normal), get(random, normal + 1), get(random, normal + 2)
        detected = where_greater(full(frame[rec.DETECTION]), get(random, NORMALS + n), unit, zero)
        if scan + n < detected_plots:
            detected = unit
        s0, s1, s2 = frame[rec.SIGMA], frame[rec.SIGMA + 1], frame[rec.SIGMA + 2]
        if frame[rec.FORM] == rec.CARTESIAN:
            x = truth[coordinates] + s0 * a, truth[coordinates + 1] + s1 * b, truth[coordinates + 2] + s2 * c
            put_plot(
                row(plots, n * rec.PLOT), x, (full(s0 * s0), zero, zero, full(s1 * s1), zero, full(s2 * s2)), detected
            )
        else:
            sine_e, cosine_e = turn_angle(truth[t + rec.ELEVATION], truth[t + rec.ELEVATION + 1], s1 * b)
            sine_a, cosine_a = turn_angle(truth[t + rec.AZIMUTH], truth[t + rec.AZIMUTH + 1], s2 * c)
            r = truth[t + rec.RANGE] + s0 * a
            biconical_plot(row(plots, n * rec.PLOT), frame, r, sine_e, cosine_e, sine_a, cosine_a, detected)


@part
def noise_at_prediction(frame, mean, wait, plot_noise, noise):
    """Write the covariance (6 rows at `noise`) of a plot at the position predicted from `mean` (9 rows), eq. (10).

    The prediction is over `wait` s. If the position is outside the sector, or nearly so, the covariance at the plot
    (6 rows at `plot_noise`) is used."""
    half = 0.5 * wait * wait
    a = get(mean, 0) + wait * get(mean, 1) + half * get(mean, 2)
    b = get(mean, 3) + wait * get(mean, 4) + half * get(mean, 5) - frame[rec.HEIGHT]
    c = get(mean, 6) + wait * get(mean, 7) + half * get(mean, 8)
    x = frame[0] * a + frame[3] * b + frame[6] * c
    y = frame[1] * a + frame[4] * b + frame[7] * c
    z = frame[2] * a + frame[5] * b + frame[8] * c
    r = root(x * x + y * y + z * z)
    scale, min_u, unit = 1.0 / r, full(MIN_U), full(1.0)
    sine_e, sine_a, u = y * scale, z * scale, x * scale
    in_sector = where_greater(u, min_u, unit, full(0.0))
    sine_e, sine_a = sine_e * in_sector, sine_a * in_sector
    u = where_greater(u, min_u, u, unit)
    p = covariance(frame, r, sine_e, root(unit - sine_e * sine_e), sine_a, root(unit - sine_a * sine_a), u)
    for i in range(6):
        put(noise, i, where_greater(in_sector, full(0.5), p[i], get(plot_noise, i)))


@kernel
def fill_plots(keys, frame, truth, detected_plots, first, random, plots):
    """Fill in all plots of realisations first … first + 7 of a track, PLOT rows a scan; truth (K, PLOT_TRUTH)."""
    scans = truth.shape[0]
    for k in range(0, scans, STRIP):
        draw_strip(keys, first, k // STRIP, random)
        target = row(address(plots), k * rec.PLOT)
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
                    is_missed = plots[(n * rec.PLOT + rec.DETECTED) * WIDTH + lane] < 0.5
                    for m in range(3):
                        noise[m, g + lane, k + n] = np.nan if is_missed else random[(3 * n + m) * WIDTH + lane]


# ---- strip -----------------------------------------------------------------------------------------------------------
class Scans(NamedTuple):
    """The scans first … stop - 1 of a strip."""

    first: int
    stop: int
    intervals: np.ndarray  #: address, (scans,): number of each scan's interval since the previous scan
    times: np.ndarray  #: address, (U,): the intervals, s
    reported: np.ndarray  #: address, (scans,): 1 where covariances are needed


@inline
def prepare_model(work, first_row, moves, accelerates, sigma, dt):
    """Write F and Q = G sigma² G' over dt from row `first_row` on (eq. 11), G = (dt² / 2, moves dt, accelerates)'.

    moves, accelerates (0 or 1): whether the model has a velocity, an acceleration; sigma of it per step, m/s²."""
    half_square, variance = 0.5 * dt * dt, sigma * sigma
    g0, g1 = half_square, moves * dt
    put3(work, first_row, (g1, accelerates * half_square, full(moves)))
    put(work, first_row + 3, accelerates * dt)
    put(work, first_row + 4, full(accelerates))
    first_row += rec.MODEL_Q
    put3(work, first_row, (variance * (g0 * g0), variance * (g0 * g1), (variance * accelerates) * g0))
    put3(work, first_row + 3, (variance * (g1 * g1), (variance * accelerates) * g1, full(variance * accelerates)))


@part
def prepare_step(work, size, models, transitions, interval, dt, settled):
    """Write models and transition probabilities over the time since each lane's previous plot.

    interval is the number of the interval dt since the previous scan; if lanes still wait for a plot (not settled),
    T(a + b) = T(a) T(b), eq. (8)."""
    first = interval * size * size
    wait = full(dt)
    if not settled:
        wait = wait + get(work, rec.WAIT)
    put(work, rec.WAIT, wait)
    for i in range(size):
        m = rec.MODEL_NUMBERS * i
        prepare_model(work, rec.MODEL + rec.MODEL_ROWS * i, models[m], models[m + 1], models[m + 2], wait)
    for j in range(size):
        for i in range(size):
            c = full(transitions[first + i * size + j])
            if not settled:
                c = full(0.0)
                for n in range(size):
                    c = c + transitions[first + i * size + n] * get(work, rec.TRANSITION + n * rec.MAX_MODELS + j)
            put(work, rec.WEIGHT + i, c)
        for i in range(size):
            put(work, rec.TRANSITION + i * rec.MAX_MODELS + j, get(work, rec.WEIGHT + i))


@part
def keep_missed(work, old, new, size, detected):
    """Keep the old bank and its wait where the plot was missed: the next prediction starts again from the previous
    plot."""
    threshold = full(0.5)
    for i in range(size):
        for r in range(i * rec.HYPOTHESIS, i * rec.HYPOTHESIS + rec.PROBABILITY + 1):
            put(work, new + r, where_greater(detected, threshold, get(work, new + r), get(work, old + r)))
        for j in range(size):
            r = rec.TRANSITION + i * rec.MAX_MODELS + j
            put(work, r, where_greater(detected, threshold, full(1.0 if i == j else 0.0), get(work, r)))
    put(work, rec.WAIT, where_greater(detected, threshold, full(0.0), get(work, rec.WAIT)))


@part
def put_output(work, listed, bank, rules, reported, out):
    """Merge a bank by the output rule into the rows at `out`, see OUTPUT.

    Variances, covariances and probabilities are written only if `reported`; the rows from MERGING on are written at the
    end of the scan."""
    size = rules.size
    for j in range(size):
        put(work, rec.WEIGHT + j, get(work, bank + j * rec.HYPOTHESIS + rec.PROBABILITY))
    count = put_shares(work, listed, bank, size, full(1.0), full(0.0), rules.output)
    put(out, rec.INNOVATION, get(work, rec.MAIN_INNOVATION))
    if not reported:
        for axis in range(3):
            put3(out, 3 * axis, mixed_mean(listed, count, row(work, rec.SHARE), row(work, rec.MEAN + 3 * axis)))
        return
    merge(work, listed, count, row(work, rec.SPARE))
    for axis in range(3):
        block = rec.SPARE + rec.OWN + 6 * axis
        put3(out, 3 * axis, get3(work, rec.SPARE + rec.MEAN + 3 * axis))
        put3(out, rec.VARIANCE + 3 * axis, (get(work, block), get(work, block + 3), get(work, block + 5)))
        put(out, rec.POSITION_COVARIANCE + axis, get(work, rec.SPARE + rec.CROSS + 9 * axis))
    for j in range(size):
        put(out, rec.MODELS + j, get(work, bank + j * rec.HYPOTHESIS + rec.PROBABILITY))


@part
def start_track(work, numbers, size, plots, weights, probabilities):
    """Write the first bank, the same hypothesis for all models, from the plots of the first START scans.

    weights (9,): a (3) and b (3), by which the coordinate and the velocity at the third plot follow from the three
    coordinates; g (3), the errors that an acceleration of one standard deviation causes in the three states.
    probabilities (size,): of the models at the start."""
    for e in range(6):
        start_block(work, e, plots, weights)
    for axis in range(3):
        x, v = full(0.0), full(0.0)
        for k in range(rec.START):
            z = get(plots, k * rec.PLOT + axis)
            x, v = x + weights[k] * z, v + weights[3 + k] * z
        put3(work, rec.MEAN + 3 * axis, (x, v, full(0.0)))
    for i in range(size):
        put(work, i * rec.HYPOTHESIS + rec.PROBABILITY, full(probabilities[i]))
        for r in range(rec.PROBABILITY):
            put(work, i * rec.HYPOTHESIS + r, get(work, r))
    for r in range(rec.STATES):
        put(work, rec.ESTIMATE + r, get(work, rec.MEAN + r))
    numbers[rec.CURRENT], numbers[rec.PREPARED], numbers[rec.SETTLED] = 0, -1, 1


@inline
def start_block(work, e, plots, weights):
    """Write the block of the first covariance for element e of R (xx, xy, xz, yy, yz, zz).

    It is Σ (a, b)' (a, b) R, plus g g' on the diagonal."""
    aa, ab, bb = full(0.0), full(0.0), full(0.0)
    for k in range(rec.START):
        R = get(plots, k * rec.PLOT + rec.COVARIANCE + e)
        aa = aa + (weights[k] * weights[k]) * R
        ab = ab + (weights[k] * weights[3 + k]) * R
        bb = bb + (weights[3 + k] * weights[3 + k]) * R
    if e == 0 or e == 3 or e == 5:
        block, g0, g1, g2 = rec.OWN + (0 if e == 0 else (6 if e == 3 else 12)), weights[6], weights[7], weights[8]
        put3(work, block, (aa + g0 * g0, ab + g0 * g1, full(g0 * g2)))
        put3(work, block + 3, (bb + g1 * g1, full(g1 * g2), full(g2 * g2)))
    else:
        block, zero = rec.CROSS + 9 * (e - 1 if e < 3 else 2), full(0.0)
        put3(work, block, (aa, ab, zero))
        put3(work, block + 3, (ab, bb, zero))
        put3(work, block + 6, (zero, zero, zero))


@part
def run_strip(work, numbers, listed, rules, models, transitions, scans, plots, frame, out):
    """Run one filter over scans, see `Scans`; all arguments are addresses.

    work: rows (WORK,); numbers: CURRENT … SETTLED; listed: MAX_MODELS whole numbers; models (size * 3,): moves,
    accelerates (0 or 1), sigma of the acceleration per step in m/s²; transitions (U * size * size,): T over each
    distinct interval between scans, row by row; plots: PLOT rows a scan; frame: of the sensor, for the covariance at
    the prediction; out: OUTPUT rows a scan."""
    for k in range(scans.first, scans.stop):
        plot, interval, output = row(plots, k * rec.PLOT), scans.intervals[k], row(out, k * rec.OUTPUT)
        noise, detected = row(plot, rec.COVARIANCE), get(plot, rec.DETECTED)
        if numbers[rec.PREPARED] != interval or numbers[rec.SETTLED] == 0:
            dt, settled = scans.times[interval], numbers[rec.SETTLED] == 1
            prepare_step(work, rules.size, models, transitions, interval, dt, settled)
            numbers[rec.PREPARED] = interval
        if rules.at_prediction == 1:
            noise = row(work, rec.NOISE)
            noise_at_prediction(frame, row(work, rec.ESTIMATE), get(work, rec.WAIT), row(plot, rec.COVARIANCE), noise)
        put(work, rec.MERGE_COUNTS, full(0.0))
        put(work, rec.MERGE_COUNTS + 1, full(0.0))
        old, new = numbers[rec.CURRENT] * rec.BANK, (1 - numbers[rec.CURRENT]) * rec.BANK
        step(work, listed, old, new, rules, plot, noise)
        put_output(work, listed, new, rules, scans.reported[k] == 1, output)
        if rules.family == rec.GPB1:
            merge_gpb1(work, listed, old, new, rules.size, rules.merge)
        put(output, rec.MERGING, get(work, rec.MERGE_COUNTS))
        put(output, rec.MERGING + 1, get(work, rec.MERGE_COUNTS + 1))
        if rules.at_prediction == 1:
            for i in range(rec.STATES):
                x = get(output, rec.ESTIMATED + i)
                put(work, rec.ESTIMATE + i, where_greater(detected, full(0.5), x, get(work, rec.ESTIMATE + i)))
        if lanes.any_greater(full(0.5), detected):
            keep_missed(work, old, new, rules.size, detected)
            numbers[rec.SETTLED] = 0
        elif numbers[rec.SETTLED] == 0:
            numbers[rec.PREPARED], numbers[rec.SETTLED] = -1, 1
        numbers[rec.CURRENT] = 1 - numbers[rec.CURRENT]


@inline
def make_rules(numbers, size):
    """The rules of a filter from its numbers (FAMILY, MERGE, OUTPUT_RULE, AT_PREDICTION)."""
    return Rules(numbers[rec.FAMILY], numbers[rec.MERGE], numbers[rec.OUTPUT_RULE], numbers[rec.AT_PREDICTION], size)


@kernel
def filter_strip(work, numbers, plots, first, stop, models, transitions, intervals, times, rules, frame, reported, out):
    """Run one filter over scans, with arrays instead of addresses; see `run_strip`."""
    memory = address(work), address(numbers), address(np.zeros(rec.MAX_MODELS, dtype=np.int64))
    design = make_rules(rules, models.size // rec.MODEL_NUMBERS), address(models), address(transitions)
    scans = Scans(first, stop, address(intervals), address(times), address(reported))
    run_strip(*memory, *design, scans, address(plots), address(frame), address(out))


@kernel
def start_strip(work, numbers, plots, weights, probabilities):
    """Write the first bank, with arrays instead of addresses; see `start_track`."""
    start_track(
        address(work), address(numbers), probabilities.size, address(plots), address(weights), address(probabilities)
    )


# ---- sums ------------------------------------------------------------------------------------------------------------
class BlockMemory(NamedTuple):
    """Memory of one thread for eight realisations: rows, and whole numbers."""

    works: np.ndarray  #: WORK rows of each filter
    random: np.ndarray  #: RANDOM rows
    plots: np.ndarray  #: PLOT rows a scan of a strip
    out: np.ndarray  #: OUTPUT rows a filter and scan of a strip
    stages: np.ndarray  #: STAGE rows a filter and stage
    active: np.ndarray  #: one row
    numbers: np.ndarray  #: (F, 8) whole numbers of each filter, see `run_strip`
    listed: np.ndarray  #: (MAX_MODELS,) see `run_strip`
    errors: np.ndarray  #: (F, K', 9, n or 0) errors of all realisations of a block, n a multiple of eight


def block_memory(filters: int, stages: int, scans: int = 0, kept_realisations: int = 0) -> BlockMemory:
    """Allocate memory for filters and stages, and for the errors of realisations at reported scans if they are kept."""
    return BlockMemory(
        works=rows(filters * rec.WORK),
        random=rows(RANDOM),
        plots=rows(STRIP * rec.PLOT),
        out=rows(filters * STRIP * rec.OUTPUT),
        stages=rows(filters * stages * rec.STAGE),
        active=rows(1),
        numbers=np.zeros((filters, 8), dtype=np.int64),
        listed=np.zeros(rec.MAX_MODELS, dtype=np.int64),
        errors=rows(filters * scans * rec.STATES * (-(-kept_realisations // WIDTH))).reshape(
            filters, scans, rec.STATES, -1
        ),
    )


@inline
def position_error(out, truth):
    """Error of the estimated position (3)."""
    return get(out, 0) - truth[0], get(out, 3) - truth[3], get(out, 6) - truth[6]


@inline
def believed_error(out, e):
    """q = e' P⁻¹ e of the position (3), with the filter's own covariance."""
    P = (
        get(out, rec.VARIANCE),
        get(out, rec.POSITION_COVARIANCE),
        get(out, rec.POSITION_COVARIANCE + 1),
        get(out, rec.VARIANCE + 3),
        get(out, rec.POSITION_COVARIANCE + 2),
        get(out, rec.VARIANCE + 6),
    )
    L, i, _ = factored(P)  # P = L D L', i: the diagonal of D⁻¹
    e = whitened(e, L)
    return dot(scaled(e, i), e)


@part
def add_scan(out, baseline, truth, active, size, sums):
    """Add a reported scan of eight realisations to the sums of a filter and scan.

    sums: addresses of error, paired, probability, believed; out, baseline: outputs of the filter and of the baseline;
    truth (9,); size: number of models."""
    error, paired, probability, believed = sums
    for c in range(rec.STATES):
        e, e0 = active * (get(out, c) - truth[c]), get(baseline, c) - truth[c]
        e2 = e * e
        error[4 * c] += total(e)
        error[4 * c + 1] += total(e2)
        error[4 * c + 2] += total(e2 * e)
        error[4 * c + 3] += total(e2 * e2)
        paired[c] += total(e2 * (e0 * e0))
    for i in range(size):
        p = active * get(out, rec.MODELS + i)
        probability[2 * i] += total(p)
        probability[2 * i + 1] += total(p * p)
    q = active * believed_error(out, position_error(out, truth))
    believed[0] += total(q)
    believed[1] += total(q * q)


@part
def add_to_stage(out, plot, truth, reported, stage):
    """Add a scan to the rows of its stage: squared errors, NIS and merges; NEES where `reported`."""
    for c in range(rec.STATES):
        e = get(out, c) - truth[c]
        put(stage, c, get(stage, c) + e * e)
    detected = get(plot, rec.DETECTED)
    put(stage, rec.NIS, get(stage, rec.NIS) + detected * get(out, rec.INNOVATION))
    put(stage, rec.PLOTS, get(stage, rec.PLOTS) + detected)
    for i in range(2):
        put(stage, rec.MERGED + i, get(stage, rec.MERGED + i) + get(out, rec.MERGING + i))
    if reported:
        put(stage, rec.NEES, get(stage, rec.NEES) + believed_error(out, position_error(out, truth)))


@part
def close_stages(stages, filters, count, lengths, active, sums, pairs):
    """Add each realisation's means over each stage to the sums, and the products of all pairs of filters.

    stages: rows of all filters, STAGE for each of `count` stages; lengths (count, 2): scans of a stage, and the
    reported ones; sums (F, S, MEANS, 2); pairs (F, F, S, 9)."""
    for s in range(count):
        for f in range(filters):
            stage = row(stages, (f * count + s) * rec.STAGE)
            for c in range(rec.MEANS):
                length = full(max(lengths[2 * s + (1 if c == rec.NEES else 0)], 1.0))
                if c == rec.NIS:
                    length = where_greater(get(stage, rec.PLOTS), full(0.5), get(stage, rec.PLOTS), full(1.0))
                put(stage, c, get(stage, c) / length)
        for f in range(filters):
            stage, offset = row(stages, (f * count + s) * rec.STAGE), f * count + s
            for c in range(rec.MEANS):
                x = active * get(stage, c)
                sums[(offset * rec.MEANS + c) * 2] += total(x)
                sums[(offset * rec.MEANS + c) * 2 + 1] += total(x * x)
            for g in range(filters):
                other_stage, offset = row(stages, (g * count + s) * rec.STAGE), (f * filters + g) * count + s
                for c in range(rec.STATES):
                    pairs[offset * rec.STATES + c] += total(active * get(stage, c) * get(other_stage, c))


@inline
def clear_rows(first, count):
    """Set `count` rows from the address `first` on to zero."""
    for n in range(count):
        put(first, n, full(0.0))


@kernel
def simulate_block(world, banks, memory, sums, baseline, first, count):
    """Add the realisations first … first + count - 1 to the sums; gains are relative to the filter `baseline`."""
    filters, scans, stages = banks.numbers.shape[0], world.truth.shape[0], world.lengths.shape[0]
    padded = banks.transitions.shape[1] // WIDTH
    for group in range(0, count, WIDTH):
        for n in range(WIDTH):
            memory.active[n] = 1.0 if group + n < count else 0.0
        clear_rows(address(memory.stages), filters * stages * rec.STAGE)
        for k in range(0, scans, STRIP):
            length, begin = min(STRIP, scans - k), rec.START if k == 0 else 0
            draw_strip(world.keys, first + group, k // STRIP, memory.random)
            plots, frame = address(memory.plots), address(world.frame)
            make_plots(address(memory.random), frame, address(world.plot_truth), k, length, rec.START, plots)
            # This loop is not a function: as one, LLVM fuses the products in GPB2's merges in another order, which
            # changes the last bits of the results.
            for f in range(filters):
                work, numbers = row(address(memory.works), f * rec.WORK), row(address(memory.numbers), f)
                size = banks.numbers[f, rec.SIZE]
                if k == 0:
                    start_track(
                        work, numbers, size, plots, address(world.weights), row(address(banks.probabilities), f)
                    )
                rules = make_rules(row(address(banks.numbers), f), size)
                filter_arrays = rules, row(address(banks.models), 2 * f), row(address(banks.transitions), padded * f)
                intervals, reported = address(world.intervals[k:]), address(world.reported[k:])
                strip_scans = Scans(begin, length, intervals, address(world.times), reported)
                out = row(address(memory.out), f * STRIP * rec.OUTPUT)
                run_strip(work, numbers, address(memory.listed), *filter_arrays, strip_scans, plots, frame, out)
            add_strip(world, banks, memory, sums, baseline, k, begin, length)
            if memory.errors.shape[3] > 0:
                keep_errors(world, memory, k, begin, length, group // WIDTH)
        lengths, active = address(world.lengths), get(address(memory.active), 0)
        close_stages(address(memory.stages), filters, stages, lengths, active, address(sums.stage), address(sums.pairs))


@inline
def add_strip(world, banks, memory, sums, baseline, k, begin, length):
    """Add the outputs of all filters over a strip that starts at scan k."""
    stages = world.lengths.shape[0]
    baseline_outputs = row(address(memory.out), baseline * STRIP * rec.OUTPUT)
    active = get(address(memory.active), 0)
    for f in range(banks.numbers.shape[0]):
        for n in range(begin, length):
            out, truth = row(address(memory.out), (f * STRIP + n) * rec.OUTPUT), address(world.truth[k + n])
            stage = row(address(memory.stages), (f * stages + world.stage[k + n]) * rec.STAGE)
            reported = world.reported[k + n] == 1
            add_to_stage(out, row(address(memory.plots), n * rec.PLOT), truth, reported, stage)
            if reported:
                s, size = world.report_index[k + n], banks.numbers[f, rec.SIZE]
                error_sums = address(sums.error[f, s]), address(sums.paired[f, s])
                scan_sums = *error_sums, address(sums.probability[f, s]), address(sums.believed[f, s])
                add_scan(out, row(baseline_outputs, n * rec.OUTPUT), truth, active, size, scan_sums)


@part
def keep_errors(world, memory, k, begin, length, group):
    """Store the errors of all filters at the reported scans of a strip from scan k on, for eight realisations."""
    filters, scans, states, padded_count = memory.errors.shape
    for f in range(filters):
        for n in range(begin, length):
            if world.reported[k + n] == 1:
                out, truth = row(address(memory.out), (f * STRIP + n) * rec.OUTPUT), address(world.truth[k + n])
                first_row = (f * scans + world.report_index[k + n]) * states * (padded_count // WIDTH) + group
                for c in range(states):
                    put(address(memory.errors), first_row + c * (padded_count // WIDTH), get(out, c) - truth[c])


# ---- likelihood ------------------------------------------------------------------------------------------------------
@kernel
def log_likelihood(work, numbers, plots, models, transitions, intervals, times, rules, frame, share, score):
    """Fill score (n,) with the logarithm of each plot's density given the earlier plots; zero where there is no plot.

    work, numbers: a filter's memory, started; plots (n · PLOT rows), of which lane 1 gets FACTOR times the σ; models,
    transitions, intervals (n,), times, rules, frame as in `filter_strip`; share: of outliers."""
    n, filter_rules = score.size, make_rules(rules, models.size // rec.MODEL_NUMBERS)
    out, reported = np.empty(n * rec.OUTPUT * WIDTH), np.zeros(n, dtype=np.int64)
    for k in range(n):
        for i in range(6):
            plots[(k * rec.PLOT + rec.COVARIANCE + i) * WIDTH + 1] *= FACTOR * FACTOR
    listed = np.zeros(rec.MAX_MODELS, dtype=np.int64)
    memory = address(work), address(numbers), address(listed)
    design = filter_rules, address(models), address(transitions)
    for k in range(n):
        scans = Scans(k, k + 1, address(intervals), address(times), address(reported))
        run_strip(*memory, *design, scans, address(plots), address(frame), address(out))
        score[k] = 0.0
        if plots[(k * rec.PLOT + rec.DETECTED) * WIDTH] > 0.5:
            new = numbers[rec.CURRENT] * rec.BANK
            regular = density(work, rec.BANK - new, new, filter_rules, 0)
            outlier = density(work, rec.BANK - new, new, filter_rules, 1)
            score[k] = regular
            if share > 0.0:
                regular, outlier = regular + np.log(1.0 - share), outlier + np.log(share)
                greatest = max(regular, outlier)
                score[k] = greatest + np.log(np.exp(regular - greatest) + np.exp(outlier - greatest))
                merge_lanes(work, new, filter_rules, np.exp(regular - score[k]), np.exp(outlier - score[k]))


@inline
def density(work, old, new, rules, lane):
    """The logarithm of the density of a lane's plot under the old bank: Σ c N(innovation; 0, S) over the models.

    c is the predicted probability of a model. For pairs of models (GPB2) the memory still has those that end in the
    last model: their sum, divided by the sum over all pairs, is that model's new probability."""
    size, total, min_distance = rules.size, 0.0, 1e300
    last, first_row = size - 1, rec.RESULT if rules.family == rec.GPB2 else rec.RESULT_GROUP
    for i in range(size):
        if predicted_probability(work, old, rules, lane, i) > 0.0:
            min_distance = min(min_distance, work[(first_row + 2 * i) * WIDTH + lane])
    for i in range(size):
        c = predicted_probability(work, old, rules, lane, i)
        if c > 0.0:
            q, determinant = work[(first_row + 2 * i) * WIDTH + lane], work[(first_row + 2 * i + 1) * WIDTH + lane]
            total += c * np.exp(0.5 * (min_distance - q)) / np.sqrt(determinant)
    last_model_weight = (
        work[(new + last * rec.HYPOTHESIS + rec.PROBABILITY) * WIDTH + lane] if rules.family == rec.GPB2 else 1.0
    )
    if not (total > 0.0 and last_model_weight > 0.0):
        return np.nan
    return np.log(total) - np.log(last_model_weight) - 0.5 * min_distance - 1.5 * np.log(2.0 * np.pi)


@inline
def predicted_probability(work, old, rules, lane, i):
    """The predicted probability of model i; for GPB2, that of the pair from model i to the last model."""
    if rules.family == rec.GPB2:
        last = rules.size - 1
        return work[(rec.TRANSITION + last * rec.MAX_MODELS + i) * WIDTH + lane] * probability(work, old, lane, i)
    c = 0.0
    for j in range(rules.size):
        c += work[(rec.TRANSITION + i * rec.MAX_MODELS + j) * WIDTH + lane] * probability(work, old, lane, j)
    return c


@inline
def probability(work, bank, lane, i):
    """The probability of model i of a bank."""
    return work[(bank + i * rec.HYPOTHESIS + rec.PROBABILITY) * WIDTH + lane]


@kernel
def merge_lanes(work, bank, rules, regular, outlier):
    """Merge each model's hypotheses of lanes 0 and 1, with probabilities regular and outlier, into both lanes."""
    for i in range(rules.size):
        first = (bank + i * rec.HYPOTHESIS) * WIDTH
        p, q = regular * probability(work, bank, 0, i), outlier * probability(work, bank, 1, i)
        # GPB1 has one hypothesis, the first, whatever the models' probabilities are.
        a, b = (regular, outlier) if rules.family == rec.GPB1 else (p, q)
        weight_sum = a + b
        if weight_sum > 0.0:
            merge_states(work, first, a / weight_sum, b / weight_sum)
        work[first + rec.PROBABILITY * WIDTH] = work[first + rec.PROBABILITY * WIDTH + 1] = p + q


@kernel
def merge_states(work, first, a, b):
    """Merge mean and covariance of lanes 0 and 1 of a hypothesis, with weights a and b, into both lanes."""
    d = np.empty(rec.STATES)
    for s in range(rec.STATES):
        element = first + s * WIDTH
        d[s] = work[element + 1] - work[element]
        work[element] = work[element + 1] = work[element] + b * d[s]
    for axis in range(3):
        element = rec.OWN + 6 * axis
        for i in range(3):
            for j in range(i, 3):
                put_merged_element(work, first + element * WIDTH, a, b, d[3 * axis + i] * d[3 * axis + j])
                element += 1
    for pair in range(3):
        row_axis, column_axis = (0, 1 + pair) if pair < 2 else (1, 2)
        for i in range(3):
            for j in range(3):
                element = rec.CROSS + 9 * pair + 3 * i + j
                put_merged_element(work, first + element * WIDTH, a, b, d[3 * row_axis + i] * d[3 * column_axis + j])


@inline
def put_merged_element(work, element, a, b, spread):
    """Write an element of the merged covariance into lanes 0 and 1."""
    work[element] = work[element + 1] = a * work[element] + b * work[element + 1] + a * b * spread
