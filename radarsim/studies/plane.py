"""A target in the plane, by range, bearing and radial velocity: what is Doppler worth there, with and without clutter?

Letters: x north, y east, m; a bearing b and a course from north to the east, rad; r range, v radial velocity outwards.
n: numbers of a state; m: numbers of a plot that a filter uses, 2 or 3. A covariance P is packed row by row.

BLK: Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001.
LXYKB: Longbin, Xiaoquan, Yiyu, Kang & Bar-Shalom, IEEE Trans. AES 34 (1998), 1074: unbiased converted measurements.
BST: Bar-Shalom & Tse, Automatica 11 (1975), 451: probabilistic data association.
"""

import functools
import math
from collections import namedtuple
from typing import Annotated, Literal

import numpy as np
from pydantic import Field
from scipy.special import chdtri, pdtrik

from radarsim.config.key_types import Correlation, Flag, WholeNumber
from radarsim.constants import STANDARD_GRAVITY_MPS2
from radarsim.errors import ConfigError
from radarsim.kernels.small_matrices import row_of
from radarsim.studies.authoring import (
    Component,
    MeasuredColumn,
    Member,
    Model,
    NonNegative,
    Number,
    Positive,
    Probability,
    Steps,
    StepStudy,
    atan2,
    congruence,
    cos,
    dot,
    exp,
    key,
    log,
    maximum,
    minimum,
    sin,
    sqrt,
    times,
    update,
    where,
    wrap_angle,
)

SIZES = {"velocity": 4, "acceleration": 6, "turn": 5}  # numbers of a state: x, y, their rates, then of the model
SLOW_TURN = 1e-5  # rad in a scan: below, series stand for quotients by the rate of turn
CENTRE = 1 / 3  # weight of the central sigma point
LOST = 10  # standard deviations of a plot: a track that errs by more is lost
MARGIN = 2.0  # widths of the window in which false plots are drawn, in those of the widest gate
MAX_PLACES = 60  # for false plots of a scan
MAX_CUT = 1e-6  # probability of more
TINY = 1e-290
RESOLVED = 6  # standard deviations of a predicted velocity in a span: with fewer its fold is not known


class Radar(Model):
    """A radar that measures range, bearing and radial velocity."""

    sigma_range_m: Positive = key("σ of the measured range", "standard deviation of a measured range, m", symbol="σ_r")
    sigma_bearing_rad: Positive = key(
        "σ of the measured bearing", "standard deviation of a measured bearing, rad", symbol="σ_β"
    )
    sigma_velocity_mps: Positive = key(
        "σ of the measured radial velocity", "standard deviation of a measured radial velocity, m/s", symbol="σ_V"
    )
    range_velocity_correlation: Correlation = key(
        "correlation of range and velocity", "of the errors of one plot, as a chirp couples them, no unit", 0.0
    )
    velocity_span_mps: Positive = key(
        "unambiguous velocity interval", "measured velocities are folded into it about zero, m/s", 4000.0, symbol="D"
    )
    scan_period_s: Positive = key("scan period", "time between two scans, s", symbol="T")
    detection_probability: Probability = key(
        "detection probability", "of each plot of the target but the first, no unit", 1.0, symbol="P_D"
    )
    false_plots_per_km2: NonNegative = key(
        "false plots per scan",
        "mean number a scan, per km², of any velocity of the interval",
        0.0,
        symbol="λ",
        unit="km⁻²",
    )
    false_plots_from_s: NonNegative = key(
        "start of false plots", "time from the first plot, s: before, tracks are established without them", 0.0
    )


class Target(Model):
    """A target at a constant speed: straight, or turning for a while."""

    kind: Literal["straight", "turn", "fly_by"] = key("kind", "its flight; the keys are those of other studies")
    range_m: Positive = key("range", "at the first plot, m", only={"kind": ("straight", "turn")})
    aspect_rad: Number = key(
        "aspect angle", "direction of flight from the line of sight outwards, rad", only={"kind": ("straight", "turn")}
    )
    start_range_m: Positive = key("range at the first plot", "before closest approach, m", only={"kind": "fly_by"})
    distance_m: Positive = key("distance of closest approach", "m", only={"kind": "fly_by"})
    speed_mps: NonNegative = key("speed", "constant, m/s")
    bearing_rad: Number = key("bearing", "at the first plot, from north to the east, rad", 0.0)
    start_s: NonNegative = key("start time", "of the turn, from the first plot, s", only={"kind": "turn"})
    duration_s: Positive = key("duration", "of the turn, s", only={"kind": "turn"})
    acceleration_g: Number = key(
        "acceleration", "lateral, standard gravities; positive: from north to the east", only={"kind": "turn"}, unit="g"
    )
    course_spread_rad: NonNegative = key(
        "spread of the course", "each realisation draws its course evenly up to so far to either side, rad", 0.0
    )


class Filter(Member):
    """A filter of position, velocity and more, in Cartesian coordinates."""

    kind: Literal["extended", "unscented", "converted", "imm"] = key("kind", "how it takes a plot; imm: two extended")
    doppler: Flag = key("uses Doppler", "whether it uses the radial velocity")
    doppler_update: Literal["sequential", "linear"] = key(
        "Doppler update",
        "sequential: after the position, linearised there; linear: along the measured bearing",
        "sequential",
        only={"kind": "converted"},
    )
    unbiased: Flag = key("unbiased", "whether conversion allows for its bias", True, only={"kind": "converted"})
    model: Literal["velocity", "acceleration", "turn"] = key(
        "model", "what is constant but for process noise", "velocity"
    )
    sigma_acceleration_mps2: NonNegative = key(
        "σ of the acceleration",
        "of either coordinate, constant over a scan, m/s²",
        only={"model": ("velocity", "turn")},
    )
    sigma_jerk_mps3: NonNegative = key(
        "σ of the jerk", "of either coordinate, constant over a scan, m/s³", only={"model": "acceleration"}
    )
    sigma_turn_rate_radps: NonNegative = key(
        "σ of the turn rate", "of its step in a scan, rad/s", only={"model": "turn"}
    )
    quiet_sigma_acceleration_mps2: NonNegative = key(
        "σ of the acceleration of the quiet model", "of constant velocity, the other of two, m/s²", only={"kind": "imm"}
    )
    mean_stay_s: Positive = key("mean stay in a model", "before it changes to the other, s", 60.0, only={"kind": "imm"})
    association: Literal["known", "nearest", "pda"] = key(
        "association",
        "which plots of the gate it takes: the target's, the nearest, or all by their probabilities",
        "nearest",
    )
    gate_probability: Annotated[Probability, Field(gt=0.5, lt=1)] = key(
        "gate probability", "that the target's plot lies in the gate, no unit", 0.99, symbol="P_G"
    )
    confirming_plots: Annotated[int, WholeNumber(2, 8)] = key(
        "plots that confirm", "plots in the gate, of the first one on, that confirm a track", 3
    )
    confirming_scans: Annotated[int, WholeNumber(2, 8)] = key(
        "scans that confirm", "neighbouring scans in which they must be", 4
    )
    sigma_start_speed_mps: Positive = key(
        "σ of the first velocity", "of either coordinate, about zero, before the first plot, m/s", 300.0
    )


Numbers = namedtuple("Numbers", "sigma rho span density speed r bearing aspect spread kind rate begins lasts")
Design = namedtuple(
    "Design",
    "sigma rho span density kind in_clutter m model linear unbiased first noise quiet stay start "
    "association gate detected missed confirming scans clear",
)


def world(spec):
    """The numbers of a case that its truth and plots need."""
    radar, t = spec.radar, spec.target
    sigma = radar.sigma_range_m, radar.sigma_bearing_rad, radar.sigma_velocity_mps
    r, aspect, rate = t.range_m, t.aspect_rad, 0.0
    if t.kind == "fly_by":
        r, aspect = t.start_range_m, math.pi - math.asin(t.distance_m / t.start_range_m)
    elif t.kind == "turn" and t.speed_mps > 0:
        rate = t.acceleration_g * STANDARD_GRAVITY_MPS2 / t.speed_mps
    flight = t.speed_mps, r, t.bearing_rad, aspect, t.course_spread_rad
    turn = "turn" if rate else "straight", rate, float(t.start_s or 0.0), float(t.duration_s or 0.0)
    density = 1e-6 * radar.false_plots_per_km2
    return Numbers(sigma, radar.range_velocity_correlation, radar.velocity_span_mps, density, *flight, *turn)


def design(spec, f):
    """The numbers of a filter."""
    radar, w = spec.radar, world(spec)
    noise = f.sigma_jerk_mps3 if f.model == "acceleration" else f.sigma_acceleration_mps2
    stay = math.exp(-radar.scan_period_s / f.mean_stay_s) if f.kind == "imm" else 0.0
    start = f.sigma_start_speed_mps, 0.1 * f.sigma_start_speed_mps, 0.1
    first = f.doppler and radar.velocity_span_mps >= RESOLVED * f.sigma_start_speed_mps
    m, gate_probability = 3 if f.doppler else 2, f.gate_probability
    gate = float(chdtri(m, 1 - gate_probability))
    detected, missed = radar.detection_probability, 1 - radar.detection_probability * gate_probability
    return Design(
        *w[:4], f.kind, w.density > 0, m, f.model, f.doppler_update == "linear", bool(f.unbiased), first,
        (noise, f.sigma_turn_rate_radps or 0.0), f.quiet_sigma_acceleration_mps2 or 0.0, stay, start,
        f.association, gate, detected, missed, f.confirming_plots, f.confirming_scans,
        radar.false_plots_from_s / radar.scan_period_s,
    )  # fmt: skip


def uniforms(w):
    """As many independent numbers, even from 0 to 1, as there are unit normals, an even number."""
    for a, b in zip(w[::2], w[1::2], strict=True):
        yield exp(-(a * a + b * b) / 2)
        yield atan2(b, a) / math.tau + 0.5


def fold(v, span):
    """A velocity folded into its span about zero."""
    return wrap_angle(v * (math.tau / span)) * (span / math.tau)


def polar(x):
    """Range, bearing and radial velocity of a state."""
    r = sqrt(x[0] * x[0] + x[1] * x[1])
    return r, atan2(x[1], x[0]), (x[0] * x[2] + x[1] * x[3]) / r


def polar_rows(x, m):
    """The derivatives of the first m of them, rows (m, n)."""
    r, _, v = polar(x)
    north, east, rest = x[0] / r, x[1] / r, (0.0,) * (len(x) - 4)
    along = (x[2] - v * north) / r, (x[3] - v * east) / r
    return ((north, east, 0.0, 0.0, *rest), (-east / r, north / r, 0.0, 0.0, *rest), (*along, north, east, *rest))[:m]


def errors_covariance(c):
    """The packed covariance of a plot's errors, of the numbers that the filter uses."""
    r, b, v = c.sigma
    return (r * r, 0.0, c.rho * r * v, b * b, 0.0, v * v) if c.m == 3 else (r * r, 0.0, b * b)


def inverse(S, m):
    """The inverse of a packed matrix of 2 or 3 rows, and its determinant."""
    if m == 2:
        determinant = S[0] * S[2] - S[1] * S[1]
        return (S[2] / determinant, -S[1] / determinant, S[0] / determinant), determinant
    a, b, d, e, f, g = S
    first = e * g - f * f, d * f - b * g, b * f - d * e
    determinant = a * first[0] + b * first[1] + d * first[2]
    rest = a * g - d * d, b * d - a * f, a * e - b * b
    return tuple(cofactor / determinant for cofactor in (*first, *rest)), determinant


def transition(model, x, dt):
    """A state dt seconds later if what the model says stays constant, and the derivatives, rows (n, n)."""
    n = len(x)
    rows = [[1.0 if i == j else 0.0 for j in range(n)] for i in range(n)]
    if model == "turn":
        return turned(x, dt)
    if model == "velocity":  # in an IMM the further numbers of the other model
        rows = [row if i < 4 else [0.0] * n for i, row in enumerate(rows)]
        x = (*x[:4], *(0.0,) * (n - 4))
    for i in range(n - 2) if model == "acceleration" else range(2):
        rows[i][i + 2] = dt
    for i in range(2) if model == "acceleration" else ():
        rows[i][i + 4] = 0.5 * dt * dt
    return tuple(dot(row, x) for row in rows), tuple(map(tuple, rows))


def turned(x, dt):
    """As `transition` at a constant rate of turn, BLK 11.7.1."""
    _, _, vx, vy, w = x
    angle = w * dt
    s, o, slow = sin(angle), cos(angle), abs(angle) < SLOW_TURN
    safe = where(slow, 1.0, w)
    along, across = where(slow, dt, s / safe), where(slow, 0.5 * dt * angle, (1.0 - o) / safe)
    d_along = where(slow, -dt * dt * angle / 3, (dt * o - along) / safe)
    d_across = where(slow, 0.5 * dt * dt, (dt * s - across) / safe)
    moved = x[0] + along * vx - across * vy, x[1] + across * vx + along * vy, o * vx - s * vy, s * vx + o * vy, w
    return moved, (
        (1.0, 0.0, along, -across, d_along * vx - d_across * vy),
        (0.0, 1.0, across, along, d_across * vx + d_along * vy),
        (0.0, 0.0, o, -s, -dt * moved[3]),
        (0.0, 0.0, s, o, dt * moved[2]),
        (0.0, 0.0, 0.0, 0.0, 1.0),
    )


def process_noise(model, n, noise, dt):
    """The packed covariance (n) that process noise adds over dt seconds: of a step constant over it."""
    g = (dt * dt * dt / 6, 0.5 * dt * dt, dt) if model == "acceleration" else (0.5 * dt * dt, dt)
    variance, turn = noise[0] * noise[0], (noise[1] * noise[1] if model == "turn" else 0.0)

    def element(i, j):
        orders = i // 2, j // 2
        if model == "turn" and i == j == 4:
            return turn
        return variance * g[orders[0]] * g[orders[1]] if i % 2 == j % 2 and max(orders) < len(g) else 0.0

    return tuple(element(i, j) for i in range(n) for j in range(i, n))


def predicted(x, P, model, noise, dt):
    """A state and its covariance dt seconds later."""
    moved, rows = transition(model, x, dt)
    return moved, added(congruence(rows, P), process_noise(model, len(x), noise, dt))


def added(a, b):
    """The sum of two packed matrices."""
    return tuple(p + q for p, q in zip(a, b, strict=True))


def root(P, n):
    """The lower triangular root of a packed covariance, rows of growing length."""
    rows = []
    for i in range(n):
        row = []
        for j in range(i):
            row.append((row_of(P, n, j)[i] - sum(row[k] * rows[j][k] for k in range(j))) / rows[j][j])
        row.append(sqrt(maximum(row_of(P, n, i)[i] - sum(a * a for a in row), 1e-30)))
        rows.append(row)
    return rows


def sigma_points(x, P):
    """The deviations of sigma points from the state other than the state itself, and the weight of each."""
    n = len(x)
    scale, rows = math.sqrt(n / (1 - CENTRE)), root(P, n)
    columns = [tuple(scale * rows[i][j] if i >= j else 0.0 for i in range(n)) for j in range(n)]
    return [tuple(sign * a for a in column) for column in columns for sign in (1.0, -1.0)], (1 - CENTRE) / (2 * n)


def measured_unscented(x, P, m):
    """The mean of the first m numbers of `polar`, their packed covariance, and that with the state, columns (m, n)."""
    points, weight = sigma_points(x, P)
    centre, n = polar(x), len(x)

    def deviations(point):
        z = polar(tuple(a + b for a, b in zip(x, point, strict=True)))
        return (z[0] - centre[0], wrap_angle(z[1] - centre[1]), z[2] - centre[2])[:m]

    d = [deviations(point) for point in points]
    mean = tuple(weight * sum(e[k] for e in d) for k in range(m))
    S = tuple(weight * sum(e[k] * e[j] for e in d) - mean[k] * mean[j] for k in range(m) for j in range(k, m))
    C = tuple(
        tuple(weight * sum(p[i] * e[k] for p, e in zip(points, d, strict=True)) for i in range(n)) for k in range(m)
    )
    return tuple(a + b for a, b in zip(centre, mean, strict=False)), S, C


def measured_extended(x, P, m):
    """The same, linearised at the state, BLK 10.3."""
    rows = polar_rows(x, m)
    C = tuple(times(P, row) for row in rows)
    return polar(x)[:m], tuple(dot(rows[j], C[k]) for k in range(m) for j in range(k, m)), C


def innovation(z, mean, c):
    """A plot less what was expected of it."""
    position = z[0] - mean[0], wrap_angle(z[1] - mean[1])
    return (*position, fold(z[2] - mean[2], c.span)) if c.m == 3 else position


Association = namedtuple("Association", "e weight spread density has_plot is_wrong")


def associate(z, mean, S, density, c):
    """The innovation of a filter, its weight and spread, and the logarithm of the density of the plots, times -2 but
    for a constant; whether the gate has a plot, and whether the likeliest is not the target's.

    z: a plot, or among false plots, of a density per m², the places for plots, that of the target first. BST eq. 3.4 to
    3.11."""
    m, (S_inverse, determinant) = c.m, inverse(S, c.m)
    if not c.in_clutter:
        e = innovation(z, mean, c)
        return Association(e, 1.0, None, dot(e, times(S_inverse, e)) + log(determinant), 1.0, 0.0)
    field = density * mean[0] / (c.span if m == 3 else 1.0)  # false plots per m, rad and m/s
    nothing = field * (math.tau ** (m / 2) * c.missed / c.detected) * sqrt(determinant)
    known = c.association == "known"
    total, best, target, e, second = nothing, 0.0, 0.0, (0.0,) * m, (0.0,) * (m * (m + 1) // 2)
    for place, (there, plot) in enumerate(z[:1] if known else z):
        d = innovation(plot, mean, c)
        square = dot(d, times(S_inverse, d))
        g = where((there > 0.5) & (True if known else square < c.gate), exp(-maximum(square, 0.0) / 2), 0.0)
        if c.association == "pda":
            e = tuple(a + g * b for a, b in zip(e, d, strict=True))
            second = tuple(a + g * b for a, b in zip(second, squares(d), strict=True))
        else:
            e = tuple(where(g > best, b, a) for a, b in zip(e, d, strict=True))
        total, best, target = total + g, maximum(best, g), target if place else g
    has_plot, is_wrong = where(best > 0.0, 1.0, 0.0), where(best > target, 1.0, 0.0)
    if c.association == "pda":
        e, (total, some) = tuple(a / maximum(total, TINY) for a in e), (maximum(total, TINY), total - nothing)
        spread = tuple(a / total - b for a, b in zip(second, squares(e), strict=True))
        return Association(e, some / total, spread, log(determinant) - 2 * log(total), has_plot, is_wrong)
    chosen = maximum(best + (0.0 if known else nothing), TINY)
    likeliness = where((best > 0.0) | (not known), log(determinant) - 2 * log(chosen), 0.0)
    return Association(e, has_plot, None, likeliness, has_plot, is_wrong)


def squares(e):
    """e e', packed."""
    return tuple(e[i] * e[j] for i in range(len(e)) for j in range(i, len(e)))


def resolved(S, C, c):
    """S and C with nothing of the velocity where its fold is not known."""
    if c.m < 3:
        return S, C
    known = S[5] * RESOLVED**2 < c.span * c.span
    r, b, v = (tuple(where(known, a, 0.0) for a in numbers) for numbers in ((S[2],), (S[4],), C[2]))
    return (S[0], S[1], *r, S[3], *b, S[5]), (*C[:2], v)


def corrected(x, P, C, S, a):
    """A state after an association, with the innovation's covariance S and its columns C with the state."""
    n, m = len(x), len(C)
    S_inverse = inverse(S, m)[0]
    columns = tuple(tuple(C[k][i] for k in range(m)) for i in range(n))
    K = tuple(times(S_inverse, column) for column in columns)
    after = tuple(row_of(P, n, i)[j] - a.weight * dot(K[i], columns[j]) for i in range(n) for j in range(i, n))
    if a.spread is not None:
        after = added(after, congruence(K, a.spread))
    return tuple(i + dot(k, a.e) for i, k in zip(x, K, strict=True)), after


def begun(z, c):
    """The state after the first plot, and its covariance: the rest from the config."""
    s, o, (r, b, v) = sin(z[1]), cos(z[1]), c.sigma
    speed, acceleration, rate = c.start
    first, n = (z[2] if c.first else 0.0), SIZES[c.model]
    along, across = (r * r, v * v if c.first else speed * speed), ((z[0] * b) ** 2, speed * speed)
    coupled = c.rho * r * v if c.first else 0.0
    rest = {"velocity": (), "acceleration": (acceleration * acceleration,) * 2, "turn": (rate * rate,)}[c.model]
    P = [[0.0] * n for _ in range(n)]
    for i, variances in enumerate(zip(along, across, strict=True)):
        P[2 * i][2 * i] = variances[0] * o * o + variances[1] * s * s
        P[2 * i + 1][2 * i + 1] = variances[0] * s * s + variances[1] * o * o
        P[2 * i][2 * i + 1] = (variances[0] - variances[1]) * s * o
    P[0][2], P[1][3], P[0][3], P[1][2] = coupled * o * o, coupled * s * s, coupled * s * o, coupled * s * o
    for i, variance in enumerate(rest):
        P[4 + i][4 + i] = variance
    packed = tuple(P[i][j] for i in range(n) for j in range(i, n))
    return (z[0] * o, z[0] * s, first * o, first * s, *(0.0,) * (n - 4)), packed


def taken(state, z, density, c, measured=measured_extended):
    """A state after the plots of a scan, and their association."""
    (x, P), (mean, S, C) = state, measured(*state, c.m)
    S, C = resolved(added(S, errors_covariance(c)), C, c)
    a = associate(z, mean, S, density, c)
    return corrected(x, P, C, S, a), a


def taken_unscented(state, z, density, c):
    """The same with the law of a plot by sigma points."""
    return taken(state, z, density, c, measured_unscented)


def taken_converted(state, z, density, c):
    """The same with the plot converted to x and y, then its velocity."""
    (x, P), (mean, S, C), (_, b, v) = state, measured_extended(*state, c.m), c.sigma
    S, _ = resolved(added(S, errors_covariance(c)), C, c)
    a = associate(z, mean, S, density, c)
    z, n = (tuple(p + q for p, q in zip(mean, a.e, strict=True)) if c.in_clutter else z), len(x)
    xy, R = converted(z, c)
    rows = row_of(P, n, 0), row_of(P, n, 1)
    position = Association((xy[0] - x[0], xy[1] - x[1]), 1.0, None, a.density, 1.0, 0.0)
    x, P = corrected(x, P, rows, added((rows[0][0], rows[0][1], rows[1][1]), R), position)
    if c.m == 3:
        if c.linear:
            h = 0.0, 0.0, cos(z[1]), sin(z[1]), *(0.0,) * (n - 4)
            across = x[3] * h[2] - x[2] * h[3]
            e, variance = z[2] - dot(h, x), v * v + across * across * b * b
        else:
            h = polar_rows(x, 3)[2]
            e, variance = z[2] - polar(x)[2], v * v
        known = (dot(h, times(P, h)) + variance) * RESOLVED**2 < c.span * c.span
        x, P = where(known, update(x, P, h, fold(e, c.span), variance), (x, P))
    return where(a.has_plot > 0.5, (x, P), state) if c.in_clutter else (x, P), a


def converted(z, c):
    """Position and packed covariance of a plot, LXYKB eq. 10 and 11 if unbiased, else linearised at the plot."""
    s, o, (r, b, _) = sin(z[1]), cos(z[1]), c.sigma
    if not c.unbiased:
        along, across = r * r, (z[0] * b) ** 2
        R = along * o * o + across * s * s, (along - across) * s * o, along * s * s + across * o * o
        return (z[0] * o, z[0] * s), R
    shrink, twice = exp(-b * b / 2), exp(-2 * b * b)
    square, both = z[0] * z[0] * (1 / (shrink * shrink) - 2), (z[0] * z[0] + r * r) / 2
    R = (
        square * o * o + both * (1 + twice * (o * o - s * s)),
        square * s * o + both * twice * 2 * s * o,
        square * s * s + both * (1 - twice * (o * o - s * s)),
    )
    return (z[0] * o / shrink, z[0] * s / shrink), R


def mixed(first, second, p):
    """The mean of two states with the weights p and 1 - p, and its covariance, BLK 11.6.6."""
    (a, P), (b, Q) = first, second
    d, q = tuple(i - j for i, j in zip(a, b, strict=True)), 1 - p
    x = tuple(p * i + q * j for i, j in zip(a, b, strict=True))
    return x, tuple(p * i + q * j + p * q * k for i, j, k in zip(P, Q, squares(d), strict=True))


def predicted_pair(core, dt, c):
    """The two models of an IMM dt seconds later, which share their states, and the probability of the first."""
    first, second, p = core
    own = c.stay * p + (1 - c.stay) * (1 - p)
    first, second = mixed(first, second, c.stay * p / own), mixed(first, second, (1 - c.stay) * p / (1 - own))
    return predicted(*first, c.model, c.noise, dt), predicted(*second, "velocity", (c.quiet, 0.0), dt), own


def taken_pair(core, z, density, c):
    """The two after the plots of a scan, and the probability of the first by the density of the plots."""
    first, second, p = core
    (first, one), (second, other) = taken(first, z, density, c), taken(second, z, density, c)
    least = minimum(one.density, other.density)
    a, b = (q * exp((least - i.density) / 2) for q, i in ((p, one), (1 - p, other)))
    p = minimum(maximum(a / (a + b), 1e-9), 1 - 1e-9)
    return (first, second, p), one._replace(has_plot=maximum(one.has_plot, other.has_plot))


UPDATES = {"extended": taken, "unscented": taken_unscented, "converted": taken_converted, "imm": taken_pair}


class Tracking(Steps):
    """A filter; its state is that of the filter, and among false plots what happened to the track: whether it is
    confirmed, whether the plot that weighs most is not the target's, whether its gate had a plot at the last scans, and
    its age in scans."""

    design = design

    def start(z, u, c):
        state = begun(z, c)
        history = (0.0, 0.0, (1.0, *(0.0,) * (c.scans - 2)), 0.0) if c.in_clutter else ()
        return ((state, state, 0.5) if c.kind == "imm" else state), history

    def predict(s, dt, u, c):
        core, history = s
        return predicted_pair(core, dt, c) if c.kind == "imm" else predicted(*core, c.model, c.noise, dt), history

    def update(s, z, u, c):
        core, history = s
        if not c.in_clutter:
            return UPDATES[c.kind](core, z, 0.0, c)[0], history
        confirmed, _, recent, age = history
        core, a = UPDATES[c.kind](core, z, where(age + 1.5 > c.clear, c.density, 0.0), c)
        confirmed = maximum(confirmed, where(a.has_plot + sum(recent) > c.confirming - 0.5, 1.0, 0.0))
        return core, (confirmed, a.is_wrong, (a.has_plot, *recent[:-1]), age + 1.0)

    def estimate(s, u, c):
        x = moments(s[0], c)[0]
        return *polar(x)[:2], sqrt(x[2] * x[2] + x[3] * x[3]), atan2(x[3], x[2])

    def covariance(s, u, c):
        x, P = moments(s[0], c)
        vx, vy, rest = where(x[2] == 0.0, 1.0, x[2]), x[3], (0.0,) * (len(x) - 4)  # at first it may stand still
        speed = sqrt(vx * vx + vy * vy)
        north, east = vx / speed, vy / speed
        rows = (0.0, 0.0, north, east, *rest), (0.0, 0.0, -east / speed, north / speed, *rest)
        return congruence((*polar_rows(x, 2), *rows), P)

    def counts(s, u, c):
        return s[1][:2]


def moments(core, c):
    """The state of a filter and its covariance."""
    return mixed(*core) if c.kind == "imm" else core


class Plane(StepStudy):
    """A target in the plane."""

    name, about = "plane", "Range, bearing and radial velocity in the plane; clutter."
    asks = "What is Doppler worth in the plane?"
    filters = {"kind": "extended, unscented, converted or imm", "model": "velocity, acceleration or turn"}
    components = (
        Component("r", "m", "$r$", "range"),
        Component("b", "rad", "$\\beta$", "bearing"),
        Component("v", "m/s", "$v$", "speed"),
        Component("course", "rad", "$\\psi$", "course"),
    )
    parts, Filter = {"radar": Radar, "target": Target}, Filter
    scan_period = "radar.scan_period_s"
    measured = (
        MeasuredColumn("range_m", "m", ("radar.sigma_range_m",)),
        MeasuredColumn("bearing_rad", "rad", ("radar.sigma_bearing_rad",)),
        MeasuredColumn("velocity_mps", "m/s", ("radar.sigma_velocity_mps",)),
    )
    kinds = dict.fromkeys(UPDATES, Tracking)
    false_quantities, counted = 2, ("confirmed", "wrong_plot")
    normals, world = (2, 0, 3), staticmethod(world)

    def detection(self, spec):
        return spec.radar.detection_probability

    def known_quantities(self, spec, t_s):
        return self._windows(spec) if spec.radar.false_plots_per_km2 else np.zeros((2, t_s.size))

    def false_normals(self, spec):
        if not spec.radar.false_plots_per_km2:
            return 0
        t_s = spec.radar.scan_period_s * np.arange(spec.scans)
        along, across = self._windows(spec)
        r = np.array([polar(x)[0] for x in self._nominal_flight(spec, t_s)])
        places = int(np.ceil(pdtrik(1 - MAX_CUT, (4e-6 * spec.radar.false_plots_per_km2 * r * along * across).max())))
        if places > MAX_PLACES:
            raise ConfigError(
                f"radar.false_plots_per_km2: {places} false plots may lie in and about the widest gate, at most "
                f"{MAX_PLACES} are drawn; let them begin later, radar.false_plots_from_s"
            )
        return 2 * -(-(1 + 3 * places) // 2)

    def _nominal_flight(self, spec, t_s):
        """The states of the target without random course, at times t_s (K,)."""
        c = world(spec)
        x, last, states = self.begin(c, (math.sqrt(2 * math.log(2)), 0.0)), t_s[0], []
        for t in map(float, t_s):
            x = self.move(x, t - last, c, (), t) if t > last else x
            states.append((*x[:2], c.speed * math.cos(x[2]), c.speed * math.sin(x[2])))
            last = t
        return states

    @functools.lru_cache(maxsize=16)  # noqa: B019
    def _windows(self, spec):
        """Half the widths (2, K) in range and bearing of the window about the target in which false plots are drawn:
        MARGIN times those of the widest gate of any filter whose estimates are true."""
        t_s = spec.radar.scan_period_s * np.arange(spec.scans)
        halves = np.zeros((2, spec.scans))
        for keys in spec.filters:
            c, s = design(spec, keys)._replace(association="known"), None
            for k, x in enumerate(self._nominal_flight(spec, t_s)):
                z = polar(x)
                if s is None:
                    s = Tracking.start(z, (), c)
                    continue
                s = Tracking.predict(s, float(t_s[k] - t_s[k - 1]), (), c)
                S = measured_extended(*moments(s[0], c), 2)[1]
                halves[:, k] = np.maximum(halves[:, k], [S[0] + c.sigma[0] ** 2, S[2] + c.sigma[1] ** 2])
                s = Tracking.update(s, ((1.0, z),), (), c)
        halves[:, t_s < spec.radar.false_plots_from_s] = 0.0
        return MARGIN * np.sqrt(max(design(spec, keys).gate for keys in spec.filters) * halves)

    def false_plots(self, x, u, c, w):
        (along, across), (r, b, _) = u, polar((x[0], x[1], 0.0, 0.0))
        uniform, *rest = uniforms(w)
        expected = 4 * c.density * r * along * across
        term = below = exp(-expected)
        nearest, areas, places = (r - along) * (r - along), 4 * r * along, []
        for place in range(len(rest) // 3):
            q, turn, v = rest[3 * place : 3 * place + 3]
            position = sqrt(nearest + q * areas), wrap_angle(b + across * (2 * turn - 1))
            places.append((where(uniform > below, 1.0, 0.0), (*position, c.span * (v - 0.5))))
            term = term * expected / (place + 1)
            below = below + term
        return tuple(places)

    def kept(self, e, u, c):
        return (u[0] <= 0.0) | ((abs(e[0]) < LOST * c.sigma[0]) & (abs(e[1]) < LOST * c.sigma[1]))

    def begin(self, c, w):
        evenly = 2 * exp(-(w[0] * w[0] + w[1] * w[1]) / 2) - 1  # of -1 to 1
        heading = c.bearing + c.aspect + c.spread * evenly
        return c.r * cos(c.bearing), c.r * sin(c.bearing), heading

    def move(self, x, dt, c, w, t):
        if c.kind == "straight":
            return x[0] + dt * c.speed * cos(x[2]), x[1] + dt * c.speed * sin(x[2]), x[2]
        since = t - c.begins
        before = minimum(maximum(dt - since, 0.0), dt)
        after = minimum(maximum(since - c.lasts, 0.0), dt)
        angle = c.rate * (dt - before - after)
        chord, last = 2 * c.speed / c.rate * sin(angle / 2), x[2] + angle
        along = tuple(c.speed * (before * f(x[2]) + after * f(last)) + chord * f(x[2] + angle / 2) for f in (cos, sin))
        return x[0] + along[0], x[1] + along[1], last

    def plot(self, x, u, c, w):
        r, b, v = polar((x[0], x[1], c.speed * cos(x[2]), c.speed * sin(x[2])))
        velocity = c.rho * w[0] + sqrt(1 - c.rho * c.rho) * w[2]
        return r + c.sigma[0] * w[0], wrap_angle(b + c.sigma[1] * w[1]), fold(v + c.sigma[2] * velocity, c.span)

    def truth(self, x, u, c):
        return sqrt(x[0] * x[0] + x[1] * x[1]), atan2(x[1], x[0]), c.speed, wrap_angle(x[2])

    def difference(self, estimate, true):
        r, b, v, course = (a - b for a, b in zip(estimate, true, strict=True))
        return r, wrap_angle(b), v, wrap_angle(course)


STUDY = Plane()
