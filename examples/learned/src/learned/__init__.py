"""A Doppler radar and targets that turn: is a learned filter better than a Kalman filter, or only better optimised?

The question of Greenberg, Yannay & Mannor, Optimization or architecture: how to hack Kalman filtering, NeurIPS 2023.
Letters: x, y east and north, m; an azimuth β from north to the east. A state is x, y and the velocity.
"""

from collections import namedtuple
from statistics import NormalDist
from typing import Literal

from radarsim.studies.authoring import (
    Component,
    MeasuredColumn,
    Member,
    Model,
    Paper,
    Positive,
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
    sin,
    sqrt,
    times,
    update,
    where,
)


class Radar(Model):
    """A Doppler radar that turns once a scan."""

    sigma_range_m: Positive = key("σ of the range", "standard deviation of a measured range, m", symbol="σ_r")
    sigma_azimuth_rad: Positive = key("σ of the azimuth", "standard deviation of a measured azimuth, rad", symbol="σ_β")
    sigma_velocity_mps: Positive = key("σ of the radial velocity", "of a measured one, m/s", symbol="σ_V")
    scan_period_s: Positive = key("scan period", "time between two plots, s", symbol="T")


class Target(Model):
    """A target that flies straight and turns in turn, on arcs of circles, anew in each realisation."""

    sigma_place_m: Positive = key("σ of the place", "of either coordinate of its first place about the radar, m")
    speed_mps: Positive = key("speed", "mean of its speed, which stays, m/s")
    sigma_speed_mps: Positive = key("σ of the speed", "about that mean, m/s")
    straight_s: Positive = key("time straight", "mean time between two turns, s")
    turn_s: Positive = key("time of a turn", "mean time that a turn lasts, s")
    acceleration_mps2: Positive = key("acceleration", "mean acceleration of a turn, m/s²", symbol="a")
    sigma_acceleration_mps2: Positive = key("σ of the acceleration", "of a turn about that mean, m/s²")


class Filter(Member):
    """A filter of position and velocity, over plots that are converted to x and y."""

    kind: Literal["converted", "constant", "imm"] = key("kind", "σ of a plot as the radar's, or constant; or models")
    sigma_acceleration_mps2: Positive = key("σ of the acceleration", "that it allows for on a straight course, m/s²")
    sigma_position_m: Positive = key("σ of the position", "of a plot's x and of its y, m", only={"kind": "constant"})
    sigma_velocity_mps: Positive = key("σ of the radial velocity", "of a plot, m/s", only={"kind": "constant"})
    sigma_turning_mps2: Positive = key(
        "σ of the acceleration in a turn", "about that of a circle, m/s²", only={"kind": "imm"}
    )
    turn_rate_radps: Positive = key("turn rate", "of the models to the left and right, rad/s", only={"kind": "imm"})


World = namedtuple("World", "sigma_r sigma_b sigma_v place speed sigma_speed begins ends a sigma_a")
Kalman = namedtuple("Kalman", "along flat angle doppler speed T q")  # variances of a plot are along, flat + (r angle)²


def turned(rate, T):
    """The transition of a motion that turns clockwise by `rate`, rad/s."""
    if rate == 0:
        return (1.0, 0.0, T, 0.0), (0.0, 1.0, 0.0, T), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0)
    s, c = float(sin(rate * T)), float(cos(rate * T))
    p, q = s / rate, (1 - c) / rate
    return (1.0, 0.0, p, q), (0.0, 1.0, -q, p), (0.0, 0.0, c, s), (0.0, 0.0, -s, c)


def moved(x, P, F, q, T):
    """A state and its covariance T later, with accelerations of variance q that stay for T."""
    pp, pv, vv = q * T**4 / 4, q * T**3 / 2, q * T**2
    noise = pp, 0.0, pv, 0.0, pp, 0.0, pv, vv, 0.0, vv
    return tuple(dot(row, x) for row in F), tuple(a + b for a, b in zip(congruence(F, P), noise, strict=True))


def rows(z, c):
    """What a plot says of the state: along the line of sight, across it, and by the Doppler shift."""
    s, o, across = sin(z[1]), cos(z[1]), c.flat + (c.angle * z[0]) ** 2
    return ((s, o, 0.0, 0.0), z[0], c.along), ((o, -s, 0.0, 0.0), 0.0, across), ((0.0, 0.0, s, o), z[2], c.doppler)


class Linear(Steps):
    """The Kalman filter of a straight course, with the radar's own σ of each plot."""

    def design(spec, filter_keys):
        r, T = spec.radar, spec.radar.scan_period_s
        speed = spec.target.speed_mps
        q = filter_keys.sigma_acceleration_mps2**2
        return Kalman(r.sigma_range_m**2, 0.0, r.sigma_azimuth_rad, r.sigma_velocity_mps**2, speed, T, q)

    def start(z, u, c):
        ((s, o, *_), r, R), (_, _, W), (_, v, D) = rows(z, c)
        V = c.speed**2
        place = R * s * s + W * o * o, (R - W) * s * o, R * o * o + W * s * s
        moves = D * s * s + V * o * o, (D - V) * s * o, D * o * o + V * s * s
        P = place[0], place[1], 0.0, 0.0, place[2], 0.0, 0.0, *moves
        return (r * s, r * o, v * s, v * o), P

    def predict(state, dt, u, c):
        return moved(*state, turned(0, c.T), c.q, c.T)

    def update(state, z, u, c):
        x, P = state
        for h, value, R in rows(z, c):
            x, P = update(x, P, h, value - dot(h, x), R)
        return x, P

    def estimate(state, u, c):
        return state[0]

    def covariance(state, u, c):
        return state[1]


class Constant(Linear):
    """The same with constant σ of x, y and radial velocity, as one that is fitted to data has them."""

    def design(spec, filter_keys):
        R, D = filter_keys.sigma_position_m**2, filter_keys.sigma_velocity_mps**2
        speed, T, q = spec.target.speed_mps, spec.radar.scan_period_s, filter_keys.sigma_acceleration_mps2**2
        return Kalman(R, R, 0.0, D, speed, T, q)


class Models(Steps):
    """Interacting multiple models (Blom & Bar-Shalom 1988): straight, a turn to the right, one to the left."""

    Numbers = namedtuple("Numbers", "plot F q P T")

    def design(spec, filter_keys):
        t, T = spec.target, spec.radar.scan_period_s
        a, b = T / t.straight_s, T / t.turn_s
        F = tuple(turned(rate, T) for rate in (0, filter_keys.turn_rate_radps, -filter_keys.turn_rate_radps))
        q = filter_keys.sigma_acceleration_mps2**2, filter_keys.sigma_turning_mps2**2, filter_keys.sigma_turning_mps2**2
        changes = (1 - a, a / 2, a / 2), (b, 1 - b, 0.0), (b, 0.0, 1 - b)
        return Models.Numbers(Linear.design(spec, filter_keys), F, q, changes, T)

    def mixed(weights, states):
        """Mean and covariance of a mixture."""
        n = range(4)
        x = tuple(sum(w * x[i] for w, (x, _) in zip(weights, states, strict=True)) for i in n)
        parts = []
        for y, P in states:
            d = tuple(y[i] - x[i] for i in n)
            outer = tuple(d[i] * d[j] for i in n for j in range(i, 4))
            parts.append(tuple(a + b for a, b in zip(P, outer, strict=True)))
        return x, tuple(dot(weights, one) for one in zip(*parts, strict=True))

    def start(z, u, c):
        return (Linear.start(z, u, c.plot),) * 3, (1.0, 0.0, 0.0)

    def predict(state, dt, u, c):
        states, p = state
        after = tuple(dot(p, column) for column in zip(*c.P, strict=True))
        begun = []
        for j in range(3):
            weights = tuple(p[i] * c.P[i][j] / after[j] for i in range(3))
            begun.append(moved(*Models.mixed(weights, states), c.F[j], c.q[j], c.T))
        return tuple(begun), after

    def update(state, z, u, c):
        made, logs = [], []
        for x, P in state[0]:
            likelihood = 0.0
            for h, value, R in rows(z, c.plot):
                e, S = value - dot(h, x), dot(h, times(P, h)) + R
                likelihood = likelihood - 0.5 * (e * e / S + log(S))
                x, P = update(x, P, h, e, R)
            made.append((x, P))
            logs.append(likelihood)
        top = maximum(maximum(logs[0], logs[1]), logs[2])
        p = tuple(one * exp(maximum(of - top, -600.0)) for one, of in zip(state[1], logs, strict=True))
        return tuple(made), tuple(one / (p[0] + p[1] + p[2]) for one in p)

    def estimate(state, u, c):
        return Models.mixed(state[1], state[0])[0]

    def covariance(state, u, c):
        return Models.mixed(state[1], state[0])[1]


class Learned(StepStudy):
    name, about = "learned", "A Doppler radar, targets that turn: learned and tuned filters (Greenberg 2023)."
    asks = "Is a learned filter better than a Kalman filter, or only better optimised?"
    filters = {"kind": "converted, constant or imm; `python:` a learned one"}
    components = (
        Component("x", "m", "$x$", "position east"),
        Component("y", "m", "$y$", "position north"),
        Component("vx", "m/s", "$v_x$", "velocity east"),
        Component("vy", "m/s", "$v_y$", "velocity north"),
    )
    parts, Filter = {"radar": Radar, "target": Target}, Filter
    scan_period = "radar.scan_period_s"
    measured = (
        MeasuredColumn("range_m", "m", ("radar.sigma_range_m",)),
        MeasuredColumn("azimuth_rad", "rad", ("radar.sigma_azimuth_rad",)),
        MeasuredColumn("velocity_mps", "m/s", ("radar.sigma_velocity_mps",)),
    )
    kinds = {"converted": Linear, "constant": Constant, "imm": Models}
    normals = 5, 3, 3
    paper = Paper("Greenberg, Yannay & Mannor 2023", may_grow=("filters",))
    claims_yaml = """
paper: learned
config: learned
names:
  FITTED: {filter: network, over: fitted, component: x}
  NETWORK: {filter: optimised, over: network, component: x}
  MODELS: {filter: network, over: models, component: x}
claims:
- {id: 1, place: section 1, statement: The learned filter is better than the Kalman filter with fitted parameters,
   original: NKF achieved significantly better accuracy than the linear KF, parts: [
    {what: "σ of x, network over fitted", of: [{}], measure: {ratio: $FITTED}, expected: {less: []}}]}
- {id: 2, place: section 1, statement: The Kalman filter with optimised parameters is better than the learned filter,
   original: "unlike KF, OKF outperformed NKF, which reversed the whole experimental conclusion", parts: [
    {what: "σ of x, optimised over network", of: [{}], measure: {ratio: $NETWORK}, expected: {less: []}}]}
- {id: 3, place: ours alone, statement: The learned filter is better than multiple models with optimised parameters,
   parts: [{what: "σ of x, network over models", of: [{}], measure: {ratio: $MODELS}, expected: {less: []}}]}
- {id: 4, place: ours alone, statement: It is so too where turns are half and twice as hard, config: learned_elsewhere,
   parts: [
    {what: "σ of x, network over models", of: [{target.acceleration_mps2: 12}], measure: {ratio: $MODELS},
     expected: {less: []}},
    {what: "σ of x, network over models", of: [{target.acceleration_mps2: 48}], measure: {ratio: $MODELS},
     expected: {less: []}}]}
"""

    def world(self, spec):
        r, t = spec.radar, spec.target
        begins, ends = (NormalDist().inv_cdf(r.scan_period_s / mean) for mean in (t.straight_s, t.turn_s))
        sigma = r.sigma_range_m, r.sigma_azimuth_rad, r.sigma_velocity_mps
        own = t.sigma_place_m, t.speed_mps, t.sigma_speed_mps
        return World(*sigma, *own, begins, ends, t.acceleration_mps2, t.sigma_acceleration_mps2)

    def begin(self, c, w):
        speed = maximum(c.speed + c.sigma_speed * w[2], 0.3 * c.speed)
        return c.place * w[0], c.place * w[1], speed, atan2(w[3], w[4]), 0.0

    def move(self, state, dt, c, w):
        """On an arc to the next scan, after a turn has perhaps begun or ended."""
        x, y, v, course, rate = state
        new = where(w[1] < 0.0, -1.0, 1.0) * (c.a + c.sigma_a * w[2]) / v
        rate = where(rate == 0.0, where(w[0] < c.begins, new, 0.0), where(w[0] < c.ends, 0.0, rate))
        half = where(abs(rate) * dt < 1e-6, 1e-6, 0.5 * rate * dt)
        chord = v * dt * sin(half) / half
        middle = course + 0.5 * rate * dt
        return x + chord * sin(middle), y + chord * cos(middle), v, course + rate * dt, rate

    def plot(self, state, u, c, w):
        x, y, v, course, _ = state
        azimuth = atan2(x, y)
        radial = v * cos(course - azimuth)
        return sqrt(x * x + y * y) + c.sigma_r * w[0], azimuth + c.sigma_b * w[1], radial + c.sigma_v * w[2]

    def truth(self, state, u, c):
        x, y, v, course, _ = state
        return x, y, v * sin(course), v * cos(course)


STUDY = Learned()
