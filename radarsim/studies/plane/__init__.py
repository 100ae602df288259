"""A target in the plane, by range, bearing and radial velocity: what is Doppler worth there, with and without clutter?

Letters: x north, y east, m; a bearing b and a course from north to the east, rad; r range, v radial velocity outwards.
n: numbers of a state; m: numbers of a plot that a filter uses, 2 or 3. A covariance P is packed row by row.
"""

import math
from collections import namedtuple
from dataclasses import replace
from types import MappingProxyType
from typing import Literal

import numpy as np

from radarsim.config import radial_keys
from radarsim.config.cross_checks import check_error, cross_check
from radarsim.config.key_types import Correlation, Flag, NonNegative, Number, Positive, Probability, key, whole_number
from radarsim.config.model import Model
from radarsim.config.study_keys import Member
from radarsim.constants import STANDARD_GRAVITY_MPS2
from radarsim.errors import ConfigError
from radarsim.kernels import gaussian_filters
from radarsim.kernels.formula_functions import atan2, cos, exp, log, sin, wrap_angle
from radarsim.kernels.packed_matrices import add
from radarsim.kernels.planar_motion import predict
from radarsim.kernels.polar_plots import (
    converted,
    errors_covariance,
    fold,
    law_of_position,
    polar,
    polar_rows,
    speed_and_course_rows,
    state_of_plot,
)
from radarsim.kernels.small_matrices import congruence, dot, times, update
from radarsim.kernels.tracing import maximum, minimum, sqrt, where
from radarsim.kernels.uniform_numbers import uniform_pairs
from radarsim.report.quantities import Component
from radarsim.studies.onefile import MeasuredColumn
from radarsim.studies.step_clutter import ClutteredStudy
from radarsim.studies.stepwise import Steps

RESOLVED = (
    6  # standard deviations of a predicted velocity in the unambiguous interval: with fewer its fold is not known
)
UNFOLDED_MPS = 2 * radial_keys.MAX_SPEED_MPS  # the interval where none is stated
LOST = 10  # standard deviations of a plot: a track that errs by more is lost
MIDDLE = math.sqrt(2 * math.log(2)), 0.0  # normals of a course in the middle of its spread


ACROSS = Component("across", "m", "$\\perp$", "position across the line of sight")


class Radar(radial_keys.Radar):
    """A surveillance radar that measures range, bearing and radial velocity."""

    sigma_bearing_rad: Positive = key(
        "σ of the measured bearing", "standard deviation of a measured bearing, rad", symbol="σ_β", le=0.5
    )
    range_velocity_correlation: Correlation = key(
        "correlation of range and velocity", "correlation of the errors of one plot, as a chirp couples them", 0.0
    )
    repetition_rate_hz: Positive | None = key(
        "pulse repetition rate",
        "folds velocities into λ F_r / 2, Hz; default: they are unambiguous",
        None,
        symbol="F_r",
    )
    detection_probability: Probability = key(
        "detection probability", "probability of a plot of the target after the first", 1.0, symbol="P_D", gt=0
    )
    false_plots_per_km2: NonNegative = key(
        "false plots per scan", "mean number per scan and km², of any velocity", 0.0, symbol="λ", unit="km⁻²"
    )
    false_plots_from_s: NonNegative = key(
        "start of false plots", "time after the first plot from which there are false plots, s", 0.0
    )

    @property
    def span_mps(self):
        """The unambiguous velocity interval."""
        return UNFOLDED_MPS if self.repetition_rate_hz is None else self.wavelength_m * self.repetition_rate_hz / 2

    @cross_check
    def _check_false_plots(self):
        if self.false_plots_per_km2 and self.repetition_rate_hz is None:
            yield check_error("false_plots_per_km2", "needs repetition_rate_hz, whose interval holds their velocities")


class Flight(Model):
    """Where a flight begins, and how its course varies."""

    bearing_rad: Number = key("bearing", "bearing at the first plot, from north to the east, rad", 0.0)
    course_spread_rad: NonNegative = key(
        "spread of the course",
        "courses are even, by realisation, up to this angle to either side, rad",
        0.0,
        le=math.pi,
    )


class Straight(Flight):
    """A straight flight."""

    kind: Literal["straight"] = key("kind", "straight flight")
    range_m: Positive = key("range", "range at the first plot, m")
    speed_mps: NonNegative = key("speed", "speed, constant, m/s")
    aspect_rad: Number = key("aspect angle", "direction of flight from the line of sight outwards, rad")


class Turn(Flight, radial_keys.Turn):
    """Straight flight, a turn of constant load, straight flight again."""

    acceleration_g: Number = key(
        "acceleration", "lateral, standard gravities; positive: to the right", unit="g", symbol="a"
    )


class FlyBy(Flight, radial_keys.FlyBy):
    """Straight flight past the radar."""


class Filter(Member):
    """A filter of position, velocity and what its model has, in Cartesian coordinates."""

    kind: Literal["extended", "unscented", "converted", "imm"] = key(
        "kind", "how it takes a plot; imm: extended, of its own model and a quiet one of constant velocity"
    )
    doppler: Flag = key("uses Doppler", "whether it uses the radial velocity")
    doppler_update: Literal["sequential", "linear"] = key(
        "Doppler update",
        "sequential: after the position, linearised there; linear: along the measured bearing",
        "sequential",
        only={"kind": "converted"},
    )
    unbiased: Flag = key("unbiased", "whether the conversion allows for its bias", True, only={"kind": "converted"})
    model: Literal["velocity", "acceleration", "turn"] = key("model", "what is constant between plots", "velocity")
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
        "σ of the acceleration of the quiet model",
        "standard deviation, as of the other model, m/s²",
        only={"kind": "imm"},
    )
    mean_stay_s: Positive = key("mean stay in a model", "before it changes to the other, s", 60.0, only={"kind": "imm"})
    sigma_start_velocity_mps: Positive = key(
        "σ of the first velocity", "of either coordinate, before a plot, m/s", 300.0
    )
    sigma_start_acceleration_mps2: Positive = key(
        "σ of the first acceleration", "of either coordinate, m/s²", 30.0, only={"model": "acceleration"}
    )
    sigma_start_turn_rate_radps: Positive = key("σ of the first turn rate", "rad/s", 0.1, only={"model": "turn"})
    association: Literal["known", "nearest", "pda"] = key(
        "association", "takes the target's plot, the nearest in the gate, or all in the gate, weighed (pda)", "nearest"
    )
    gate_probability: Probability = key(
        "gate probability", "probability that the gate contains the target's plot", 0.99, symbol="P_G", gt=0.5, lt=1
    )
    confirming_plots: whole_number(2, 8) = key(
        "plots that confirm", "number of scans with a plot in the gate that confirm a track", 3
    )
    confirming_scans: whole_number(2, 8) = key("scans that confirm", "number of last scans that count for it", 4)

    @cross_check
    def _check_association(self):
        if self.kind == "converted" and self.association == "pda":
            yield check_error("association", "must be known or nearest: a converted filter takes one plot")
        if self.confirming_plots > self.confirming_scans:
            yield check_error("confirming_plots", f"must be at most confirming_scans, {self.confirming_scans}")


World = namedtuple("World", "sigma rho span density speed range bearing aspect spread turns rate begins lasts")
Design = namedtuple(
    "Design", "sigma rho span density in_clutter m keys model kind noise quiet stay first start gate missed clear"
)


def world(spec):
    """The numbers of a case that its truth and plots need."""
    radar, target, r, aspect, turn = spec.radar, spec.target, getattr(spec.target, "range_m", 0.0), 0.0, (0.0, 0.0, 0.0)
    if target.kind == "fly_by":
        r, aspect = target.start_range_m, math.pi - math.asin(target.distance_m / target.start_range_m)
    else:
        aspect = target.aspect_rad
    if target.kind == "turn":
        turn = target.acceleration_g * STANDARD_GRAVITY_MPS2 / target.speed_mps, target.start_s, target.duration_s
    sigma = radar.sigma_range_m, radar.sigma_bearing_rad, radar.sigma_velocity_mps
    density, flight = 1e-6 * radar.false_plots_per_km2, (target.bearing_rad, aspect, target.course_spread_rad)
    plots = sigma, radar.range_velocity_correlation, radar.span_mps, density
    return World(*plots, target.speed_mps, r, *flight, turn[0] != 0, *turn)


def design(spec, keys):
    """The numbers of a filter."""
    from scipy.special import chdtri

    radar, c, m = spec.radar, world(spec), 3 if keys.doppler else 2
    noise = keys.sigma_jerk_mps3 if keys.model == "acceleration" else keys.sigma_acceleration_mps2
    stay = math.exp(-radar.scan_period_s / keys.mean_stay_s) if keys.kind == "imm" else 0.0
    start = {"acceleration": (keys.sigma_start_acceleration_mps2,) * 2, "turn": (keys.sigma_start_turn_rate_radps,)}
    missed = (1 - radar.detection_probability * keys.gate_probability) / radar.detection_probability
    clear = np.arange(spec.scans) * radar.scan_period_s < radar.false_plots_from_s
    return Design(
        *c[:4], c.density > 0, m, keys, keys.model, keys.kind,
        (noise, keys.sigma_turn_rate_radps or 0.0), keys.quiet_sigma_acceleration_mps2 or 0.0, stay,
        keys.doppler and c.span >= RESOLVED * keys.sigma_start_velocity_mps,
        (keys.sigma_start_velocity_mps, start.get(keys.model, ())),
        float(chdtri(m, 1 - keys.gate_probability)), missed, float(clear.sum()),
    )  # fmt: skip


def plot_difference(z, mean, c):
    """A plot less another, or less the expected one: the numbers that the filter uses."""
    position = z[0] - mean[0], wrap_angle(z[1] - mean[1])
    return (*position, fold(z[2] - mean[2], c.span)) if c.m == 3 else position


def law_of_plot(state, c):
    """The law of a plot under a state, with nothing of the velocity where its fold is not known."""
    if c.kind == "unscented":
        mean, S, C = gaussian_filters.unscented_law(
            state, lambda x: polar(x)[: c.m], lambda a, b: plot_difference(a, b, c)
        )
    else:
        mean, S, C = gaussian_filters.linearised_law(state[1], polar(state[0])[: c.m], polar_rows(state[0])[: c.m])
    R = errors_covariance(c.sigma, c.rho)
    if c.m == 2:
        return mean, add(S, (R[0], R[1], R[3])), C
    S = add(S, R)
    known = S[5] * RESOLVED**2 < c.span * c.span
    with_r, with_b, *with_state = where(known, (S[2], S[4], *C[2]), (0.0,) * (2 + len(C[2])))
    return mean, (S[0], S[1], with_r, S[3], with_b, S[5]), (C[0], C[1], tuple(with_state))


def take_plots(state, z, density, c):
    """A state after the plots of a scan, and their association. z: the plot, or among false plots, of a density per m²,
    the places for plots."""
    mean, S, _ = law = law_of_plot(state, c)
    if c.in_clutter:
        false_to_missed = c.missed * density * mean[0] / (c.span if c.m == 3 else 1.0)  # per m, rad and m/s
        association = gaussian_filters.associate(
            z, lambda plot: plot_difference(plot, mean, c), S, c.keys.association, c.gate, false_to_missed
        )
    else:
        association = gaussian_filters.take_plot(plot_difference(z, mean, c), S)
    if c.kind != "converted":
        return gaussian_filters.take(state, law, association), association
    if c.in_clutter:
        z = tuple(a + b for a, b in zip(mean, association.e, strict=True))
    return where(association.has_plot > 0.5, take_converted_plot(state, z, c), state), association


def take_converted_plot(state, z, c):
    """A state after a plot that is converted to x and y, then after its radial velocity."""
    position, R = converted(z, c.sigma, c.keys.unbiased)
    e = position[0] - state[0][0], position[1] - state[0][1]
    law = law_of_position(state, position, R)
    x, P = gaussian_filters.take(state, law, gaussian_filters.take_plot(e, law[1]))
    if c.m == 2:
        return x, P
    north, east, v = cos(z[1]), sin(z[1]), c.sigma[2]
    if c.keys.doppler_update == "linear":
        h = 0.0, 0.0, north, east, *(0.0,) * (len(x) - 4)
        across = x[3] * north - x[2] * east
        e, variance = z[2] - dot(h, x), v * v + (across * c.sigma[1]) ** 2
    else:
        h, e, variance = polar_rows(x)[2], z[2] - polar(x)[2], v * v
    known = (dot(h, times(P, h)) + variance) * RESOLVED**2 < c.span * c.span
    # Less what the error of the range tells of that of the velocity, both are independent.
    share = c.rho * v / c.sigma[0]
    e = fold(e, c.span) - share * (north * (position[0] - x[0]) + east * (position[1] - x[1]))
    h = h[0] - share * north, h[1] - share * east, *h[2:]
    return where(known, update(x, P, h, e, variance - (c.rho * v) ** 2), (x, P))


class Tracking(Steps):
    """A filter: its state, of an imm those of both models and the probability of the first; and among false plots the
    history of its track: whether it is confirmed, whether the likeliest plot of the scan is not the target's, whether
    the gate had a plot at the last scans, and the scan."""

    design = design

    def start(z, u, c):
        velocity, sigma, rho = (z[2], c.sigma, c.rho) if c.first else (0.0, (*c.sigma[:2], c.start[0]), 0.0)
        state, seen = state_of_plot(z, velocity, sigma, rho, *c.start), (1.0, *(0.0,) * (c.keys.confirming_scans - 2))
        history = (0.0, 0.0, seen, 1.0) if c.in_clutter else ()
        return ((state, state, 0.5) if c.kind == "imm" else state), history

    def predict(s, dt, u, c):
        states, history = s
        if c.kind != "imm":
            return predict(states, c.model, c.noise, dt), history
        first, second, p = gaussian_filters.share_states(*states, c.stay)
        return (predict(first, c.model, c.noise, dt), predict(second, "velocity", (c.quiet, 0.0), dt), p), history

    def update(s, z, u, c):
        (states, history), density = s, 0.0
        if c.in_clutter:
            density = where(history[3] > c.clear - 0.5, c.density, 0.0)
        if c.kind == "imm":
            (first, association), (second, other) = (take_plots(state, z, density, c) for state in states[:2])
            states = first, second, gaussian_filters.probability_after(states[2], association, other)
        else:
            states, association = take_plots(states, z, density, c)
        if c.in_clutter:
            was_confirmed, _, seen, scan = history
            plots, has_plot = association.has_plot + sum(seen), association.has_plot
            confirmed = maximum(was_confirmed, where(plots > c.keys.confirming_plots - 0.5, 1.0, 0.0))
            history = confirmed, association.is_wrong, (has_plot, *seen[:-1]), scan + 1.0
        return states, history

    def estimate(s, u, c):
        x = moments(s, c)[0]
        return *polar(x)[:2], sqrt(x[2] * x[2] + x[3] * x[3]), atan2(x[3], x[2])

    def covariance(s, u, c):
        x, P = moments(s, c)
        moving = (*x[:2], where(x[2] == 0.0, 1.0, x[2]), *x[3:])  # before the second plot it may stand still
        return congruence((*polar_rows(x)[:2], *speed_and_course_rows(moving)), P)

    def log_densities(s, z, u, c):
        states, weights = (s[0][:2], (s[0][2], 1 - s[0][2])) if c.kind == "imm" else (s[:1], (1.0,))
        laws = [law_of_plot(state, c) for state in states]
        by_model = [gaussian_filters.log_densities(plot_difference(z, mean, c), S) for mean, S, _ in laws]
        return [log(maximum(dot(weights, [exp(a) for a in logs]), 1e-300)) for logs in zip(*by_model, strict=True)]

    def gate(s, u, c):
        S = law_of_plot(moments(s, c), c)[1]
        return math.sqrt(c.gate * S[0]), math.sqrt(c.gate * S[3 if c.m == 3 else 2])

    def counts(s, u, c):
        return s[1][:2]


def moments(s, c):
    """The state of a filter with its covariance."""
    return gaussian_filters.mix(*s[0]) if c.kind == "imm" else s[0]


class Plane(ClutteredStudy):
    """A target in the plane."""

    name, about = "plane", "Range, bearing and radial velocity in the plane, among false plots."
    asks = "What is Doppler worth in the plane?"
    filters = MappingProxyType(
        {"kind": "extended, unscented, converted or imm", "model": "velocity, acceleration or turn"}
    )
    components = (
        Component("r", "m", "$r$", "range"),
        Component("b", "rad", "$\\beta$", "bearing"),
        Component("v", "m/s", "$v$", "speed"),
        Component("course", "rad", "$\\psi$", "course"),
    )
    extra_figures = (*ClutteredStudy.extra_figures, "position")
    parts, Filter = {"radar": Radar, "target": Straight | Turn | FlyBy}, Filter
    scan_period = "radar.scan_period_s"
    measured = (
        MeasuredColumn("range_m", "m", ("radar.sigma_range_m",)),
        MeasuredColumn("bearing_rad", "rad", ("radar.sigma_bearing_rad",)),
        MeasuredColumn("velocity_mps", "m/s", ("radar.sigma_velocity_mps",)),
    )
    kinds = dict.fromkeys(("extended", "unscented", "converted", "imm"), Tracking)
    normals, world = (2, 0, 3), staticmethod(world)
    window, middle, counted = ("range_m", "bearing_rad"), MIDDLE, ("confirmed", "wrong_plot")

    def detection(self, spec):
        return spec.radar.detection_probability

    def columns(self, spec, filter_keys):
        return super().columns(spec, filter_keys)[: 3 if filter_keys.doppler else 2]

    def floor(self, spec, axes):
        """As `Study.floor`, of straight flights on one course; among false plots the bound with known origins."""
        from radarsim.studies.floors.bound import CRB, Floor
        from radarsim.studies.floors.straight_flight import straight_flight_bound

        c = world(spec)
        if c.turns or c.spread or not c.speed:
            return None
        flight = [(*x[:2], c.speed * math.cos(x[2]), c.speed * math.sin(x[2])) for x in self.typical_flight(spec)]
        rows, R = np.array([polar_rows(x) for x in flight]), np.zeros((3, 3))
        R[np.triu_indices(3)] = errors_covariance(c.sigma, c.rho)
        R = R + np.triu(R, 1).T
        maps = np.concatenate([rows[:, :2], [speed_and_course_rows(x) for x in flight]], axis=1)
        detection = spec.radar.detection_probability
        bounds = {m: straight_flight_bound(axes.t_s, rows[:, :m], R[:m, :m], maps, detection) for m in (2, 3)}
        return Floor(CRB, tuple(bounds[3 if keys.doppler else 2] for keys in spec.filters), bounds[3])

    def tables(self, results):
        from radarsim.report import tables

        position = tables.join_columns(map(self.position_columns, results))
        return {**super().tables(results), "position": position}

    def position_columns(self, result):
        """σ of position along the line of sight, that of the range, and across it, that of the bearing times the range.

        range_m: range of the flight whose course is in the middle of its spread
        sigma_m ±: σ of position along the line of sight, or across it, as `component` says"""
        from radarsim.report import statistics, tables

        f, k, c = np.nonzero(result.axes.available[:, :, :2])
        r = np.array([polar((*x[:2], 0.0, 0.0))[0] for x in self.typical_flight(result.spec)])[k]
        n = tables.realisation_counts(result)[f, k, c]
        sigma = statistics.errors(np.asarray(result.sums["error"])[f, k, c], n).sigma
        factor = np.where(c == 1, r, 1.0)
        return {
            **tables.label_columns(result, f, k, component=np.array(["along", "across"], dtype=object)[c]),
            "n": n.astype(int),
            "range_m": r,
            **tables.interval_columns("sigma_m", statistics.Estimate(*(factor * end for end in sigma))),
        }

    def figures(self, results, tables, experiment):
        from radarsim.report import case_selection, time_figures
        from radarsim.report import tables as common

        figures = super().figures(results, tables, experiment)
        columns = {"sigma_m": "sigma", "sigma_m_lo": "sigma_lo", "sigma_m_hi": "sigma_hi"}
        rows = tables["position"].rename(columns=columns).assign(exact_sigma=np.nan)
        groups = common.group_by(rows, "case", "filter", "component")
        names = case_selection.cases_for_figure(experiment, "position")
        visible, remark = case_selection.select_cases_by_panel(results, names)
        across = time_figures.sigma_figure("position", visible, groups, ACROSS)
        return {**figures, "position": replace(across, caption=across.caption + remark)}

    def tracker(self, case):
        if self.false_places(case.spec):
            for i, keys in enumerate(case.spec.filters):
                if keys.association == "known":
                    reason = "recorded plots do not say which is the target's: give nearest or pda"
                    raise ConfigError(f"filters.{i}.association: known: {reason}")
        return super().tracker(case)

    def fitted(self, filter_keys):
        noise = "sigma_jerk_mps3" if filter_keys.model == "acceleration" else "sigma_acceleration_mps2"
        return (
            "radar.sigma_range_m",
            "radar.sigma_bearing_rad",
            *["radar.sigma_velocity_mps"] * filter_keys.doppler,
            noise,
        )

    def begin(self, c, w):
        even, _ = uniform_pairs(w)
        heading = c.bearing + c.aspect + c.spread * (2 * even - 1)
        return c.range * cos(c.bearing), c.range * sin(c.bearing), heading

    def move(self, x, dt, c, w, t):
        if not c.turns:
            return x[0] + dt * c.speed * cos(x[2]), x[1] + dt * c.speed * sin(x[2]), x[2]
        before = minimum(maximum(c.begins - t + dt, 0.0), dt)
        after = minimum(maximum(t - c.begins - c.lasts, 0.0), dt)
        angle = c.rate * (dt - before - after)
        chord, middle, last = 2 * c.speed / c.rate * sin(angle / 2), x[2] + angle / 2, x[2] + angle
        north, east = (c.speed * (before * f(x[2]) + after * f(last)) + chord * f(middle) for f in (cos, sin))
        return x[0] + north, x[1] + east, last

    def plot(self, x, u, c, w):
        r, b, v = polar((x[0], x[1], c.speed * cos(x[2]), c.speed * sin(x[2])))
        e = c.rho * w[0] + sqrt(1 - c.rho * c.rho) * w[2]
        return r + c.sigma[0] * w[0], wrap_angle(b + c.sigma[1] * w[1]), fold(v + c.sigma[2] * e, c.span)

    def truth(self, x, u, c):
        return *polar((x[0], x[1], 0.0, 0.0))[:2], c.speed, wrap_angle(x[2])

    def false_plots_from_s(self, spec):
        return spec.radar.false_plots_from_s if spec.radar.false_plots_per_km2 else None

    def edges(self, x, halves):
        """Of a window: the bearing of its middle, the squares of its least and greatest range, half its angle."""
        r, b, _ = polar((*x[:2], 0.0, 0.0))
        return b, maximum(r - halves[0], 0.0) ** 2, (r + halves[0]) ** 2, minimum(halves[1], math.pi)

    def expected_false_plots(self, x, halves, c):
        _, near, far, across = self.edges(x, halves)
        return c.density * (far - near) * across

    def false_plot(self, x, halves, even, c):
        b, near, far, across = self.edges(x, halves)  # even in area
        return sqrt(near + (far - near) * even[0]), wrap_angle(b + across * (2 * even[1] - 1)), c.span * (even[2] - 0.5)

    def kept(self, e, u, c):
        return (u[0] <= 0.0) | ((abs(e[0]) < LOST * c.sigma[0]) & (abs(e[1]) < LOST * c.sigma[1]))


STUDY = Plane()
