"""An extended Kalman filter against a fixed gain: a random walk on the ground whose slant range is measured.

Yours: the question of your study, and where it comes from. The docstrings of radarsim.studies.onefile and
radarsim.studies.stepwise list all further options; radarsim.kernels.tracing, the operations allowed in a step.
"""

from collections import namedtuple
from typing import Literal

from radarsim.studies.authoring import (
    Component,
    MeasuredColumn,
    Member,
    Model,
    NonNegative,
    Paper,
    Positive,
    Steps,
    StepStudy,
    key,
    sqrt,
    update,
)


# Yours: the keys. A key ends in its unit (_m, _s, _mps, _rad, …) and its description names it; its letter is optional.
class Sensor(Model):
    """A sensor on a mast that measures the slant range."""

    height_m: Positive = key("height", "of the sensor above the target's plane, m", symbol="h")
    sigma_range_m: Positive = key("σ of the slant range", "standard deviation of a measured range, m", symbol="σ_r")
    scan_period_s: Positive = key("scan period", "time between two plots, s", symbol="Δt")


class Target(Model):
    """A target whose distance on the ground is a random walk."""

    distance_m: Positive = key("distance", "mean of its first distance on the ground, m")
    sigma_start_m: NonNegative = key("σ of the start", "of its first distance about that mean, m")
    sigma_step_m: NonNegative = key("σ of a step", "standard deviation of its step from one scan to the next, m")


class Filter(Member):
    """A filter of the distance."""

    kind: Literal["fixed", "kalman"] = key("kind", "how it weighs a plot")
    gain: Positive | None = key("gain", "share of the innovation used, no unit", only={"kind": "fixed"})


Numbers = namedtuple("Numbers", "h r2 x0 p2 q2 gain")  # height and first distance, m; variances, m²


def numbers(spec, filter_keys=None):
    """The numbers of a config that truth and filters use."""
    s, t, gain = spec.sensor, spec.target, getattr(filter_keys, "gain", None) or 0.0
    return Numbers(s.height_m, s.sigma_range_m**2, t.distance_m, t.sigma_start_m**2, t.sigma_step_m**2, gain)


def slant(x, c):
    return sqrt(x * x + c.h * c.h)


# Yours: the filters. A step is plain Python on numbers and tuples; write `where` instead of an `if` on a number.
class Kalman(Steps):
    """The extended Kalman filter: its state is the estimate and its variance."""

    design = numbers

    def start(z, u, c):
        return Kalman.update((c.x0, c.p2), z, u, c)

    def predict(s, dt, u, c):
        return s[0], s[1] + c.q2

    def update(s, z, u, c):
        r = slant(s[0], c)
        x, P = update((s[0],), (s[1],), (s[0] / r,), z[0] - r, c.r2)
        return x[0], P[0]

    def estimate(s, u, c):
        return (s[0],)

    def covariance(s, u, c):
        return (s[1],)


class FixedGain(Kalman):
    """A fixed share of the innovation, as a distance on the ground, from the same start."""

    covariance = None  # it has none

    def update(s, z, u, c):
        r = slant(s[0], c)
        return s[0] + c.gain * (z[0] - r) * r / s[0], s[1]


class Walk(StepStudy):
    # Yours: the entry point's name, one line for `radarsim list`, what distinguishes the filters.
    name, about = "random_walk", "Random walk seen by slant range: an extended Kalman filter against a fixed gain."
    filters = {"kind": "kalman, or fixed with a gain"}
    asks = "How well do filters follow a random walk by its slant range?"
    components = (Component("x", "m", "$x$", "distance"),)  # the errors shown: name, unit, letter, words
    parts, Filter = {"sensor": Sensor, "target": Target}, Filter
    scan_period = "sensor.scan_period_s"
    measured = (MeasuredColumn("range_m", "m", ("sensor.sigma_range_m",)),)  # recorded: column, unit, keys of its σ
    kinds = {"kalman": Kalman, "fixed": FixedGain}
    normals = 1, 1, 1  # unit normals of the start, of a move, of a plot
    paper, world = Paper("Jazwinski 1970", may_grow=("filters",)), staticmethod(numbers)

    # Yours: the truth and its plots, from the numbers c of `world` and the unit normals w.
    def begin(self, c, w):
        return (c.x0 + sqrt(c.p2) * w[0],)

    def move(self, x, dt, c, w):
        return (x[0] + sqrt(c.q2) * w[0],)

    def plot(self, x, u, c, w):
        return (slant(x[0], c) + sqrt(c.r2) * w[0],)

    # Yours: the paper's claims, each with the range of values its wording allows.
    claims_yaml = """
paper: random_walk
config: random_walk
claims:
- {id: 1, place: chapter 8, statement: The extended Kalman filter is the better one by more than 10 %, parts: [
    {of: [{}], what: gain, unit: "%", measure: {gain: {filter: kalman, component: x}}, expected: {above: 10}}]}
"""


STUDY = Walk()
