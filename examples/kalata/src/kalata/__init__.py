"""Steady gains of α-β and α-β-γ filters by the tracking index: P. R. Kalata, IEEE Trans. AES-20 (1984), 174-182.

Λ = σ_w T²/σ_v, of a target's random acceleration σ_w, the period T and the sensor's σ_v. The state is x, v, a.
"""

from typing import Literal

import numpy as np
from radarsim.studies.authoring import (
    Component,
    LinearStudy,
    MeasuredColumn,
    Member,
    Model,
    Motion,
    NonNegative,
    Number,
    Paper,
    Positive,
    key,
)


class Sensor(Model):
    """A sensor of position."""

    sigma_x_m: Positive = key("σ of x", "standard deviation of a measured position, m", symbol="σ_v")
    scan_period_s: Positive = key("scan period", "time between two plots, s", symbol="T")


class Target(Model):
    """A target with a random acceleration about a constant one."""

    index: NonNegative = key("tracking index", "σ_w T²/σ_v of the random acceleration, no unit", symbol="Λ")
    order: Literal[2, 3] = key("order", "2: random accelerations are independent; 3: they add up, scan by scan", 2)
    acceleration_mps2: Number = key("acceleration", "constant, which no filter knows, m/s²", 0.0)


class Filter(Member):
    """A filter of position."""

    kind: Literal["kalman", "alpha_beta", "benedict_bordner", "alpha_beta_gamma"] = key(
        "kind", "where its gains are from"
    )
    alpha: Positive | None = key(
        "α", "gain of the position, no unit", only={"kind": ("alpha_beta", "benedict_bordner", "alpha_beta_gamma")}
    )


class Kalata(LinearStudy):
    """Kalman filters and fixed gains, of one sensor."""

    name, about = "kalata", "Steady gains by the tracking index (Kalata 1984)."
    asks = "How accurate are α-β filters?"
    filters = {"kind": "kalman; alpha_beta, alpha_beta_gamma by Kalata; benedict_bordner: β = α²/(2 - α)"}
    components = (Component("x", "m", "$x$", "position"), Component("v", "m/s", "$v$", "velocity"))
    parts, Filter = {"sensor": Sensor, "target": Target}, Filter
    scan_period = "sensor.scan_period_s"
    measured = (MeasuredColumn("x_m", "m", ("sensor.sigma_x_m",)),)
    paper = Paper("Kalata 1984", may_grow=("filters",))

    def motion(self, spec):
        target, T = spec.target, spec.sensor.scan_period_s
        adds_up = float(target.order == 3)
        return Motion(
            F=lambda dt: [[1, dt, dt * dt / 2], [0, 1, dt], [0, 0, 1]],
            Q=lambda dt: (
                (target.index * spec.sensor.sigma_x_m / T**2) ** 2 * np.outer(*2 * [[dt * dt / 2, dt, adds_up]])
            ),
            mean=[0, 0, target.acceleration_mps2],
            covariance=np.diag([1e4, 1e4, 100 * adds_up]),
        )

    def assumed_motion(self, spec, filter_keys):
        return self.motion(spec)._replace(mean=[0, 0, 0])

    def plot(self, spec, filter_keys, k):
        return [1, 0, 0], spec.sensor.sigma_x_m

    def own_gains(self, spec, filter_keys):
        if filter_keys.kind == "kalman":
            return None
        a, T = filter_keys.alpha, spec.sensor.scan_period_s
        b = a * a / (2 - a) if filter_keys.kind == "benedict_bordner" else 2 * (2 - a) - 4 * (1 - a) ** 0.5
        c = b * b / a if filter_keys.kind == "alpha_beta_gamma" else 0.0
        return np.tile([a, b / T, c / (2 * T * T)], (spec.scans, 1, 1))

    claims_yaml = """
paper: kalata
config: kalata
names: {WHITE: {target.order: 2, target.acceleration_mps2: 0}, STEADY: {target.order: 2, target.acceleration_mps2: 2},
  SUM: {target.order: 3, target.acceleration_mps2: 0}}
claims:
- {id: 1, place: α-β filter, statement: At a tracking index of 1 α is 0.75, parts: [
    {of: [$WHITE], what: σ²/σ_v² of the position in the long run, measure: {reduction: {component: x}},
     expected: {printed: "0.7500"}}]}
- {id: 2, place: α-β filter, statement: and the variance of the velocity is σ_v²/T², parts: [
    {of: [$WHITE], what: σ² T²/σ_v² of the velocity, measure: {reduction: {component: v}},
     expected: {printed: "1.0000"}}]}
- {id: 3, place: α-β filter, statement: With α = 0.75 and β = 0.5 it is the Kalman filter in the long run, parts: [
    {of: [$WHITE], each: {c: [x, v]}, what: ratio of σ in $c, expected: {same: [1, 0.0001]},
     measure: {ratio: {filter: alpha-beta, over: kalman, component: $c}}}]}
- {id: 4, place: α-β filter, statement: and better in velocity than with the β of Benedict and Bordner, parts: [
    {of: [$WHITE], what: ratio of σ, measure: {ratio: {filter: benedict-bordner, over: alpha-beta, component: v}},
     expected: {greater: []}}]}
- {id: 5, place: lag, statement: 'A constant acceleration a leaves a lag of (1 - α) a T²/β', parts: [
    {of: [$STEADY], what: lag at 2 m/s², unit: m, measure: {lag: {filter: alpha-beta}}, expected: {printed: "1.0000"}}]}
- {id: 6, place: α-β-γ filter, statement: Where the acceleration adds up α is 0.8643, parts: [
    {of: [$SUM], what: σ²/σ_v² of the position in the long run, measure: {reduction: {component: x}},
     expected: {printed: "0.8643"}}]}
- {id: 7, place: α-β-γ filter, statement: and the filter with these gains is the Kalman filter in the long run, parts: [
    {of: [$SUM], each: {c: [x, v]}, what: ratio of σ in $c, expected: {same: [1, 0.0001]},
     measure: {ratio: {filter: alpha-beta-gamma, over: kalman, component: $c}}}]}
"""


def reduction(evidence, case, component):
    """The variance in the long run over σ_v², of the velocity over σ_v²/T²."""
    result = evidence.case(case)
    row = evidence.row("last", case=result.name, filter="kalman", component=component)
    sensor = result.spec.sensor
    return (row["steady_sigma"] / sensor.sigma_x_m * (sensor.scan_period_s if component == "v" else 1)) ** 2


def lag(evidence, case, filter):
    """Minus the exact bias of the position at the last scan."""
    axes = evidence.case(case).axes
    return -float(axes.exact_bias[axes.filters.index(filter), -1, 0])


STUDY = Kalata()
