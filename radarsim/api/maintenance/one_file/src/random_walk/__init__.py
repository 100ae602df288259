"""A Kalman filter against a fixed gain on a random walk: a study in one file.

Yours: the question of your study, and where it comes from. The docstrings of radarsim.studies.onefile and
radarsim.studies.linear list all further options.
"""

from typing import Annotated

import numpy as np
from pydantic import Field
from radarsim.studies.authoring import (
    Component,
    DisplayMark,
    LinearStudy,
    MeasuredColumn,
    Member,
    Model,
    Motion,
    Name,
    NonNegative,
    Paper,
    Positive,
    key,
)


# Yours: the keys. A key ends in its unit (_m, _s, _mps, _rad, …) and its description names it; its letter is optional.
class Sensor(Model):
    """A sensor that measures the position."""

    name: Annotated[Name | None, DisplayMark()] = key("name", "display name", None)
    sigma_x_m: Positive = key("σ of the measured x", "standard deviation of a measured position, m", symbol="σ_x")
    scan_period_s: Positive = key("scan period", "time between two plots, s", symbol="Δt")


class Target(Model):
    """A target whose position is a random walk."""

    sigma_start_m: NonNegative = key("σ of the start", "standard deviation of its first position from zero, m")
    sigma_step_m: NonNegative = key("σ of a step", "standard deviation of its step from one scan to the next, m")


class Filter(Member):
    """A filter of the position."""

    gain: Annotated[Positive, Field(le=1)] | None = key("gain", "share of the innovation used, no unit", None)


class Walk(LinearStudy):
    """A random walk and the filters that follow it."""

    # Yours: the entry point's name, one line for `radarsim list`, what distinguishes the filters.
    name, about = "random_walk", "Random walk (textbook): a Kalman filter against a filter of fixed gain."
    filters = {"gain": "exponential smoothing with this gain; without it a Kalman filter"}
    asks = "How well do filters follow a random walk?"
    components = (Component("x", "m", "$x$", "position"),)  # the errors shown: name, unit, letter, words
    parts, Filter = {"sensor": Sensor, "target": Target}, Filter
    scan_period = "sensor.scan_period_s"
    measured = (MeasuredColumn("x_m", "m", ("sensor.sigma_x_m",)),)  # of a recorded plot: column, unit, keys of its σ
    fitted = ("sensor.sigma_x_m", "target.sigma_step_m")  # what `radarsim fit` estimates
    paper = Paper("Kalman 1960", may_grow=("filters",))

    # Yours: how the state moves, and what a filter sees at scan k: rows H and their σ.
    def motion(self, spec):
        """x⁺ = x + w, w of variance step² a scan."""
        q = spec.target.sigma_step_m**2 / spec.sensor.scan_period_s
        return Motion(lambda t: [[1]], lambda t: [[q * t]], mean=[0], covariance=[[spec.target.sigma_start_m**2]])

    def plot(self, spec, filter_keys, k):
        """z = x + v."""
        return [1], spec.sensor.sigma_x_m

    # Yours, where filters differ: other gains here; a mismatched model by assumed_motion and assumed_plot.
    def own_gains(self, spec, filter_keys):
        """The fixed gain; None makes a Kalman filter."""
        return None if filter_keys.gain is None else np.full((spec.scans, 1, 1), filter_keys.gain)

    # Yours: the paper's claims, each with the range its wording allows, and the choices the paper leaves open.
    # Measures: the functions of radarsim.papers.one_file_measures, and those here whose first argument is `evidence`.
    claims_yaml = """
paper: random_walk
config: random_walk
claims:
- id: 1
  place: section 1
  statement: The Kalman filter's error is more than 10 % below that of the fixed gain
  interpretation: of the root-mean-square error at the last scan
  parts:
  - {of: [{target.sigma_step_m: 0.5}], what: gain in σ at the last scan, unit: "%",
     measure: {gain: {filter: kalman, component: x}}, expected: {above: 10}}
- id: 2
  place: section 2
  statement: and has settled by then
  interpretation: its σ is within 1 % of its limit
  parts:
  - {of: [{target.sigma_step_m: 0.5}], what: σ over its limit, measure: {settled: {filter: kalman}},
     expected: {same: [1, 0.01]}}
choices:
- key: start
  asks: what is known at the start
  original: nothing
  alternatives:
  - {name: hardly anything, kind: U, reason: the usual}
  - {name: the first position, kind: U, reason: also usual, sets: {target.sigma_start_m: 0}}
"""


def settled(evidence, case, filter):
    """σ at the last scan over its limit."""
    last = evidence.curve(case, filter, "x").last()
    limit = STUDY.limits(evidence.case(case).spec)[
        [filter_keys.name for filter_keys in evidence.case(case).spec.filters].index(filter), 0
    ]
    return type(last)(*(value / limit for value in last))


STUDY = Walk()
