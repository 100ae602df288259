"""Table 1 of "The unscented particle filter": van der Merwe, Doucet, de Freitas & Wan, NIPS 2000, section 5.

x_t = 1 + sin(0.04 π t) + 0.5 x_{t-1} + v, v of Gamma(3, 2); y_t = 0.2 x² + n up to t = 30, 0.5 x - 2 + n after it.
What the paper leaves out (start, variances in the filters, the floor of likelihoods) is as in the authors' program.
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
    Steps,
    StepStudy,
    key,
    sin,
    sqrt,
    where,
)

PI = 3.141592653589793
LAST_SQUARED = 30  # the last t at which the square of x is measured
WEIGHTS = (0.6, 0.1, 0.1, 0.1, 0.1)  # of x, v and n, kappa = 2: the two points of n have the state of the centre


class Sensor(Model):
    """What is measured."""

    sigma_y: Positive = key("σ of y", "standard deviation of a measurement, no unit", symbol="σ_n")
    scan_period_s: Positive = key("scan period", "time between two measurements, s")


class Target(Model):
    """The state."""

    first: Number = key("first state", "known at t = 1, no unit")


class Filter(Member):
    """A filter of x."""

    kind: Literal["extended", "unscented"] = key("kind", "how it treats the square")
    noise_mean: Number = key("mean of v", "that it allows for, no unit", 0.0)
    noise_variance: Positive = key("variance of v", "that it allows for, no unit", 0.75)
    measured_variance: Positive = key("variance of n", "that it allows for, no unit", 1e-5)


Numbers = namedtuple("Numbers", "sigma first mean Q R")


def numbers(spec, filter_keys=None):
    names = ("noise_mean", "noise_variance", "measured_variance")
    return Numbers(spec.sensor.sigma_y, spec.target.first, *(getattr(filter_keys, name, 0.0) for name in names))


def f(x, t):
    return 1 + sin(0.04 * PI * t) + 0.5 * x


def sigma_points(x, P, Q, t, root):
    """The predicted states of the sigma points of x and v: the centre, then two of each."""
    far, noise = root(5 * P), root(5 * Q)
    centre = f(x, t)
    return centre, f(x + far, t), f(x - far, t), centre + noise, centre - noise


def weighted(numbers, others=None):
    return sum(w * a * b for w, a, b in zip(WEIGHTS, numbers, others or len(WEIGHTS) * (1,), strict=True))


def unscented(points, seen, y, R):
    """State and variance after a measurement y, from predicted states and what would be measured of them."""
    x, z = weighted(points), weighted(seen)
    e, d = [point - x for point in points], [one - z for one in seen]
    S = weighted(d, d) + R
    K = weighted(e, d) / S
    return x + K * (y - z), weighted(e, e) - K * K * S


class Extended(Steps):
    design = numbers

    def start(z, u, c):  # the first measurement is not used
        return c.first + 0 * z[0], 0.75 + 0 * z[0]

    def predict(s, dt, u, c):
        return f(s[0], u[0]) + c.mean, 0.25 * s[1] + c.Q

    def update(s, z, u, c):
        x, P = s
        slope = where(u[0] < LAST_SQUARED + 0.5, 0.4 * x, 0.5)
        K = P * slope / (slope * slope * P + c.R)
        return x + K * (z[0] - measured(x, u[0])), P - K * slope * P

    def estimate(s, u, c):
        return (s[0],)

    def covariance(s, u, c):
        return (s[1],)


class Unscented(Extended):
    def start(z, u, c):
        x, P = Extended.start(z, u, c)
        return x, P, (x, x, x, x, x)

    def predict(s, dt, u, c):
        points = tuple(point + c.mean for point in sigma_points(s[0], s[1], c.Q, u[0], sqrt))
        return weighted(points), s[1], points

    def update(s, z, u, c):
        x, P = unscented(s[2], [measured(point, u[0]) for point in s[2]], z[0], c.R)
        return x, P, (x, x, x, x, x)


def measured(x, t):
    return where(t < LAST_SQUARED + 0.5, 0.2 * x * x, 0.5 * x - 2)


class Particles:
    """Particles of n realisations at once, resampled at each scan; `proposal`: where they are drawn from.

    prior: the motion; unscented: a normal about the estimate of an unscented filter for each of them, of the variances
    Q and R. floor is added to each likelihood, as in the authors' program: where all particles miss y by more than
    0.067, it takes them as equally good. The numbers of table 1 hold with it."""

    def __init__(self, particles=200, proposal="prior", floor=1e-99, Q=1.5, R=0.1):
        self.count, self.is_unscented, self.floor, self.Q, self.R = particles, proposal == "unscented", floor, Q, R

    def start(self, world):
        self.x = None
        self.first, self.variance = world.keys["target"]["first"], world.keys["sensor"]["sigma_y"] ** 2

    def step(self, plots):
        if self.x is None:
            self.x = np.full((plots.n, self.count), float(self.first))
            self.P = np.full(self.x.shape, 0.75)
        else:
            y, t = plots["y"][:, None], float(plots["step"][0])
            log_weight = self.propose(plots, y, t) + self.log_likelihood(y, t)
            weight = np.exp(log_weight - log_weight.max(axis=1, keepdims=True))
            chosen = resampled(weight / weight.sum(axis=1, keepdims=True), plots.uniforms(self.count))
            self.x, self.P = (np.take_along_axis(values, chosen, axis=1) for values in (self.x, self.P))
        return self.x.mean(axis=1, keepdims=True)

    def log_likelihood(self, y, t):
        log_density = -0.5 * (y - self.seen(self.x, t)) ** 2 / self.variance - 0.5 * np.log(self.variance)
        return np.logaddexp(log_density, np.log(self.floor)) if self.floor else log_density

    def propose(self, plots, y, t):
        """Draw the particles, and give the logarithm of the density of the motion over that of the proposal."""
        if not self.is_unscented:  # v as a sum of three exponential variables
            self.x = f(self.x, t) - 0.5 * np.log(plots.uniforms((self.count, 3))).sum(axis=2)
            return 0.0
        points = sigma_points(self.x, self.P, self.Q, t, np.sqrt)
        mean, self.P = unscented(points, [self.seen(point, t) for point in points], y, self.R)
        normals, before = plots.normals(self.count), f(self.x, t)
        self.x = mean + np.sqrt(self.P) * normals
        v = self.x - before
        log_motion = np.where(v > 0, 2 * np.log(np.maximum(v, 1e-300)) - 2 * v, -1e9)
        return log_motion + 0.5 * normals**2 + 0.5 * np.log(self.P)

    def seen(self, x, t):
        return 0.2 * x * x if t <= LAST_SQUARED else 0.5 * x - 2


def resampled(weight, uniforms):
    """Residual resampling: of weights (n, N) the particles to keep, (n, N); uniforms (n, N)."""
    n, N = weight.shape
    copies = np.floor(N * weight)
    rest = N * weight - copies
    places = (np.arange(N) + 0.5) / N

    def picked(shares, points):  # all rows at once: row i lies between i and i + 1
        rows, ends = np.arange(n)[:, None], np.cumsum(shares, axis=1)
        found = np.searchsorted((np.minimum(ends, 1) + rows).ravel(), (points + rows).ravel(), side="right")
        return np.clip(found.reshape(n, N) - N * rows, 0, N - 1)

    drawn = picked(rest / np.maximum(rest.sum(axis=1, keepdims=True), 1e-300), uniforms)
    return np.where(places < copies.sum(axis=1, keepdims=True) / N, picked(copies / N, np.tile(places, (n, 1))), drawn)


class Upf(StepStudy):
    """Filters of a state that is seen by its square."""

    name, about = "upf", "A growing state seen by its square (van der Merwe 2000)."
    asks = "How accurate are nonlinear filters of one state?"
    filters = {"kind": "extended or unscented; particle filters are filters of Python, upf:Particles"}
    components = (Component("x", "1", "$x$", "state"),)
    parts, Filter = {"sensor": Sensor, "target": Target}, Filter
    scan_period = "sensor.scan_period_s"
    measured = (MeasuredColumn("y", "1", ("sensor.sigma_y",)),)
    known_columns = ("step",)
    kinds, normals = {"extended": Extended, "unscented": Unscented}, (0, 6, 1)
    paper, world = Paper("van der Merwe 2000", may_grow=("filters",)), staticmethod(numbers)

    def known_quantities(self, spec, t_s):
        return (t_s / spec.sensor.scan_period_s + 1,)

    def begin(self, c, w):
        return c.first, 1.0

    def move(self, x, dt, c, w):
        t = x[1] + 1
        return f(x[0], t) + 0.25 * sum(normal**2 for normal in w), t  # a sum of six squares over four is Gamma(3, 2)

    def plot(self, x, u, c, w):
        return (measured(x[0], u[0]) + c.sigma * w[0],)

    def truth(self, x, u, c):
        return (x[0],)

    claims_yaml = """
paper: upf
config: upf
claims:
- {id: 1, place: table 1, statement: 'The extended Kalman filter: 0.374, variance 0.015', parts: [
    {of: [{}], what: mean of the runs' root-mean-square errors, measure: {run_rms: {filter: ekf, component: x}},
     expected: {printed: "0.374", runs: 100, variance: 0.015}}]}
- {id: 2, place: table 1, statement: 'The unscented Kalman filter: 0.280, variance 0.012', parts: [
    {of: [{}], what: mean of the runs' root-mean-square errors, measure: {run_rms: {filter: ukf, component: x}},
     expected: {printed: "0.280", runs: 100, variance: 0.012}}]}
- {id: 3, place: table 1, statement: 'The generic particle filter: 0.424, variance 0.053', parts: [
    {of: [{}], what: mean of the runs' root-mean-square errors, measure: {run_rms: {filter: pf, component: x}},
     expected: {printed: "0.424", runs: 100, variance: 0.053}}]}
- {id: 4, place: table 1, statement: 'The unscented particle filter: 0.070, variance 0.006', parts: [
    {of: [{}], what: mean of the runs' root-mean-square errors, measure: {run_rms: {filter: upf, component: x}},
     expected: {printed: "0.070", runs: 100, variance: 0.006}}]}
- {id: 5, place: section 5, statement: The unscented particle filter is better than the unscented Kalman one, parts: [
    {of: [{}], what: ratio of the means, measure: {run_rms_ratio: {filter: upf, over: ukf, component: x}},
     expected: {less: []}}]}
choices:
- key: mean_of_v
  asks: whether the Kalman filters know the mean of v
  original: nothing
  alternatives:
  - {name: no, kind: U, reason: as the authors' published program}
  - {name: yes, kind: U, reason: as a textbook has it, sets: {noise_mean: 1.5}}
"""


STUDY = Upf()
