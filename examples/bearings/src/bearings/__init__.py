"""A target tracked by bearings alone, from an observer that turns once: three filters of the literature.

Letters: x, y east and north, m; a bearing β from north to the east. A state is relative to the observer. Papers:
AES-15: Aidala, Kalman filter behavior in bearings-only tracking applications, IEEE Trans. 1979.
AES-18: Aidala & Nardone, Biased estimation properties of the pseudolinear tracking filter, IEEE Trans. 1982.
AC-28: Aidala & Hammel, Utilization of modified polar coordinates for bearings-only tracking, IEEE Trans. 1983.
"""

from collections import namedtuple
from typing import Literal

import numpy as np
from radarsim.studies.authoring import (
    Component,
    MeasuredColumn,
    Member,
    Model,
    Number,
    Paper,
    Positive,
    Probability,
    Steps,
    StepStudy,
    atan2,
    congruence,
    cos,
    key,
    sin,
    sqrt,
    update,
    where,
    wrap_angle,
)


class Observer(Model):
    """A ship that hears the target, sails straight and turns once."""

    sigma_bearing_rad: Positive = key("σ of a bearing", "standard deviation of a measured bearing, rad", symbol="σ_β")
    scan_period_s: Positive = key("scan period", "time between two bearings, s", symbol="T")
    speed_mps: Positive = key("speed", "of the ship, m/s")
    course_rad: Number = key("course", "before the turn, from north to the east, rad")
    turn_s: Positive = key("time of the turn", "from the first bearing, s")
    new_course_rad: Number = key("new course", "after the turn, rad")
    detection_probability: Probability = key("detection probability", "of each bearing but the first, no unit", 1.0)


class Target(Model):
    """A target on a straight course, drawn anew for each realisation."""

    bearing_rad: Number = key("bearing", "of its first place, rad")
    range_m: Positive = key("range", "mean of its first range, m")
    sigma_range_m: Positive = key("σ of the range", "about that mean, m")
    sigma_velocity_mps: Positive = key("σ of the velocity", "of either coordinate about zero, m/s")


class Filter(Member):
    """A filter of range and velocity."""

    kind: Literal["cartesian", "pseudolinear", "modified_polar"] = key("kind", "in which coordinates it is linear")


Numbers = namedtuple("Numbers", "sigma bearing range sigma_range sigma_velocity")  # what truth and filters need


def numbers(spec, filter_keys=None):
    t = spec.target
    return Numbers(spec.observer.sigma_bearing_rad, t.bearing_rad, t.range_m, t.sigma_range_m, t.sigma_velocity_mps)


def moved(x, dt, own, u):
    """A relative state dt seconds later: the target goes straight, the observer from its old motion `own` to u."""
    vx, vy = x[2] + own[2], x[3] + own[3]
    return x[0] + own[0] + dt * vx - u[0], x[1] + own[1] + dt * vy - u[1], vx - u[2], vy - u[3]


def transition(dt):
    return (1.0, 0.0, dt, 0.0), (0.0, 1.0, 0.0, dt), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0)


class Cartesian(Steps):
    """The extended Kalman filter of position and velocity: x, their covariance P, and the observer's motion."""

    design = numbers

    def start(z, u, c):
        s, o, v = sin(z[0]), cos(z[0]), c.sigma_velocity**2
        along, across = c.sigma_range**2, (c.range * c.sigma) ** 2
        xx, xy, yy = along * s * s + across * o * o, (along - across) * s * o, along * o * o + across * s * s
        return (c.range * s, c.range * o, -u[2], -u[3]), (xx, xy, 0.0, 0.0, yy, 0.0, 0.0, v, 0.0, v), u

    def predict(state, dt, u, c):
        x, P, own = state
        return moved(x, dt, own, u), congruence(transition(dt), P), u

    def update(state, z, u, c):
        x, P, own = state
        square = x[0] * x[0] + x[1] * x[1]
        h = x[1] / square, -x[0] / square, 0.0, 0.0
        return *update(x, P, h, wrap_angle(z[0] - atan2(x[0], x[1])), c.sigma**2), own

    def estimate(state, u, c):
        x = state[0]
        return sqrt(x[0] * x[0] + x[1] * x[1]), x[2] + u[2], x[3] + u[3]

    def covariance(state, u, c):
        (x, P, _), r = state, Cartesian.estimate(state, u, c)[0]
        return congruence(((x[0] / r, x[1] / r, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0)), P)


class Pseudolinear(Cartesian):
    """The Kalman filter of x cos z - y sin z = 0, whose error is that of the bearing times the range."""

    def update(state, z, u, c):
        x, P, own = state
        h = cos(z[0]), -sin(z[0]), 0.0, 0.0
        return *update(x, P, h, -h[0] * x[0] - h[1] * x[1], c.sigma**2 * (x[0] * x[0] + x[1] * x[1])), own


class ModifiedPolar(Steps):
    """The extended Kalman filter of y = (β', r'/r, β, 1/r), with ranges up to ten times the expected one."""

    design = numbers

    def polar(x):
        """y of a Cartesian state, and its derivatives."""
        square = x[0] * x[0] + x[1] * x[1]
        q, s, o = 1.0 / sqrt(square), x[0] / square, x[1] / square
        turn, rate = x[2] * o - x[3] * s, x[2] * s + x[3] * o
        by_turn = -x[3] / square - 2 * s * turn, x[2] / square - 2 * o * turn, o, -s
        by_rate = x[2] / square - 2 * s * rate, x[3] / square - 2 * o * rate, s, o
        return (turn, rate, atan2(x[0], x[1]), q), (by_turn, by_rate, (o, -s, 0.0, 0.0), (-s * q, -o * q, 0.0, 0.0))

    def cartesian(y):
        """The Cartesian state of y, and its derivatives."""
        s, o, r = sin(y[2]), cos(y[2]), 1.0 / y[3]
        vx, vy = r * (y[1] * s + y[0] * o), r * (y[1] * o - y[0] * s)
        place = (0.0, 0.0, r * o, -s * r * r), (0.0, 0.0, -r * s, -o * r * r)
        return (r * s, r * o, vx, vy), (*place, (r * o, r * s, vy, -vx * r), (-r * s, r * o, -vx, -vy * r))

    def start(z, u, c):
        x, P, own = Cartesian.start(z, u, c)
        y, J = ModifiedPolar.polar(x)
        return y, congruence(J, P), own

    def predict(state, dt, u, c):
        x, J = ModifiedPolar.cartesian(state[0])
        y, back = ModifiedPolar.polar(moved(x, dt, state[2], u))
        return y, congruence(back, congruence(transition(dt), congruence(J, state[1]))), u

    def update(state, z, u, c):
        (y, P, own), least = state, 0.1 / c.range
        y, P = update(y, P, (0.0, 0.0, 1.0, 0.0), wrap_angle(z[0] - y[2]), c.sigma**2)
        return (y[0], y[1], y[2], where(y[3] < least, least, y[3])), P, own

    def estimate(state, u, c):
        return Cartesian.estimate(ModifiedPolar.cartesian(state[0]), u, c)

    def covariance(state, u, c):
        x, J = ModifiedPolar.cartesian(state[0])
        return Cartesian.covariance((x, congruence(J, state[1]), u), u, c)


class Bearings(StepStudy):
    name, about = "bearings", "Bearings alone, from an observer that turns (Aidala 1979)."
    asks = "How accurate is tracking by bearings alone?"
    filters = {"kind": "cartesian, pseudolinear or modified_polar"}
    components = Component("r", "m", "$r$", "range"), Component("vx", "m/s"), Component("vy", "m/s")
    parts, Filter = {"observer": Observer, "target": Target}, Filter
    scan_period = "observer.scan_period_s"
    measured = (MeasuredColumn("bearing_rad", "rad", ("observer.sigma_bearing_rad",)),)
    known_columns = "own_x_m", "own_y_m", "own_vx_mps", "own_vy_mps"
    kinds = {"cartesian": Cartesian, "pseudolinear": Pseudolinear, "modified_polar": ModifiedPolar}
    normals, world = (3, 0, 1), staticmethod(numbers)
    paper = Paper("Aidala 1979, 1982, 1983", may_grow=("filters",))
    claims_yaml = """
paper: bearings
config: bearings
names: {CARTESIAN: {filter: cartesian, component: r}, POLAR: {filter: modified polar, component: r}}
claims:
- {id: 1, place: AES-18, statement: The pseudolinear filter's range is biased towards the observer, parts: [
    {what: mean error, unit: m, of: [{}], measure: {bias: {filter: pseudolinear, component: r}}, expected: {below: 0}}]}
- {id: 2, place: AES-15, statement: The Cartesian filter's covariance collapses too early, parts: [
    {what: true over believed σ, of: [{}], measure: {over_believed: $CARTESIAN}, expected: {above: 1}}]}
- {id: 3, place: AC-28, statement: The covariance in modified polar coordinates is true and errors are smaller, parts: [
    {what: true over believed σ, of: [{}], measure: {over_believed: $POLAR}, expected: {same: [1, 0.05]}},
    {what: gain, unit: "%", of: [{}], measure: {gain: $POLAR}, expected: {above: 0}}]}
"""

    def detection(self, spec):
        return spec.observer.detection_probability

    def known_quantities(self, spec, t_s):
        o = spec.observer
        before, after = np.minimum(t_s, o.turn_s), np.maximum(t_s - o.turn_s, 0)
        course = np.where(t_s < o.turn_s, o.course_rad, o.new_course_rad)
        x, y = (o.speed_mps * (f(o.course_rad) * before + f(o.new_course_rad) * after) for f in (np.sin, np.cos))
        return x, y, o.speed_mps * np.sin(course), o.speed_mps * np.cos(course)

    def begin(self, c, w):
        r = c.range + c.sigma_range * w[0]
        return r * sin(c.bearing), r * cos(c.bearing), c.sigma_velocity * w[1], c.sigma_velocity * w[2]

    def move(self, x, dt, c, w):
        return x[0] + dt * x[2], x[1] + dt * x[3], x[2], x[3]

    def plot(self, x, u, c, w):
        return (atan2(x[0] - u[0], x[1] - u[1]) + c.sigma * w[0],)

    def truth(self, x, u, c):
        return sqrt((x[0] - u[0]) ** 2 + (x[1] - u[1]) ** 2), x[2], x[3]


STUDY = Bearings()
