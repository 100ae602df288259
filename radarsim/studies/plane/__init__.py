"""A target in the plane, by range, bearing and radial velocity: what is Doppler worth there, with and without clutter?

This file holds the filters; the target and the radar are `radarsim.studies.planar`'s. n: numbers of a state; m: numbers
of a plot that a filter uses, 2 or 3. A covariance P is packed row by row.
"""

import math
from collections import namedtuple
from types import MappingProxyType
from typing import Literal

from radarsim.config.cross_checks import check_error, cross_check
from radarsim.config.key_types import Flag, NonNegative, Positive, Probability, key, whole_number
from radarsim.config.radial_keys import MAX_SPEED_MPS
from radarsim.config.study_keys import Member
from radarsim.errors import ConfigError
from radarsim.kernels import gaussian_filters
from radarsim.kernels.formula_functions import atan2
from radarsim.kernels.planar_motion import predict
from radarsim.kernels.polar_filters import is_fold_known, law_of_plot, plot_difference, take_converted_plot
from radarsim.kernels.polar_plots import polar, polar_rows, speed_and_course_rows, state_of_plot
from radarsim.kernels.small_matrices import congruence
from radarsim.kernels.tracing import maximum, sqrt, where
from radarsim.language.translate import term
from radarsim.studies.planar import PlanarStudy
from radarsim.studies.stepwise import Steps


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
        symbol="σ_a",
        only={"model": ("velocity", "turn")},
        process_noise=True,
    )
    sigma_jerk_mps3: NonNegative = key(
        "σ of the jerk",
        "of either coordinate, constant over a scan, m/s³",
        symbol="σ_j",
        only={"model": "acceleration"},
        process_noise=True,
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
        "σ of the first velocity", "of either coordinate, before a plot, m/s", 300.0, le=MAX_SPEED_MPS
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


Design = namedtuple(
    "Design",
    "sigma rho span density in_clutter m kind model association unbiased linear confirming noise quiet stay first "
    "start gate missed clear",
)


def design(spec, keys):
    """The numbers of a filter."""
    import numpy as np
    from scipy.special import chdtri

    radar, m = spec.radar, 3 if keys.doppler else 2
    noise = keys.sigma_jerk_mps3 if keys.model == "acceleration" else keys.sigma_acceleration_mps2
    stay = math.exp(-radar.scan_period_s / keys.mean_stay_s) if keys.kind == "imm" else 0.0
    start = {"acceleration": (keys.sigma_start_acceleration_mps2,) * 2, "turn": (keys.sigma_start_turn_rate_radps,)}
    missed = (1 - radar.detection_probability * keys.gate_probability) / radar.detection_probability
    clear = np.arange(spec.scans) * radar.scan_period_s < radar.false_plots_from_s
    density = 1e-6 * radar.false_plots_per_km2
    return Design(
        radar.sigma, radar.range_velocity_correlation, radar.span_mps, density, density > 0,
        m, keys.kind, keys.model, keys.association, keys.unbiased, keys.doppler_update == "linear",
        (keys.confirming_plots, keys.confirming_scans),
        (noise, keys.sigma_turn_rate_radps or 0.0), keys.quiet_sigma_acceleration_mps2 or 0.0, stay,
        keys.doppler and is_fold_known(keys.sigma_start_velocity_mps**2, radar.span_mps),
        (keys.sigma_start_velocity_mps, start.get(keys.model, ())),
        float(chdtri(m, 1 - keys.gate_probability)), missed, float(clear.sum()),
    )  # fmt: skip


def expected_plot(state, c):
    """The law of a plot under a state."""
    return law_of_plot(state, c, c.m, c.kind == "unscented")


def take_plots(state, z, density, c):
    """A state after the plots of a scan, and their association. z: the plot, or among false plots, of a density per m²,
    the places for plots."""
    mean, S, _ = law = expected_plot(state, c)
    if c.in_clutter:
        false_to_missed = c.missed * density * mean[0] / (c.span if c.m == 3 else 1.0)  # per m, rad and m/s
        association = gaussian_filters.associate(
            z, lambda plot: plot_difference(plot, mean, c.span), S, c.association, c.gate, false_to_missed
        )
    else:
        association = gaussian_filters.take_plot(plot_difference(z, mean, c.span), S)
    if c.kind != "converted":
        return gaussian_filters.take(state, law, association), association
    if c.in_clutter:
        z = tuple(a + b for a, b in zip(mean, association.e, strict=True))
    after = take_converted_plot(state, z, c, c.m, c.unbiased, c.linear)
    return where(association.has_plot > 0.5, after, state), association


class Tracking(Steps):
    """A filter: its state, of an imm those of both models and the probability of the first; and among false plots the
    history of its track: whether it is confirmed, whether the likeliest plot of the scan is not the target's, whether
    the gate had a plot at the last scans, and the scan."""

    design = design
    sigma_field, noise_field = "sigma", "noise"

    def start(z, u, c):
        velocity, sigma, rho = (z[2], c.sigma, c.rho) if c.first else (0.0, (*c.sigma[:2], c.start[0]), 0.0)
        state, seen = state_of_plot(z, velocity, sigma, rho, *c.start), (1.0, *(0.0,) * (c.confirming[1] - 2))
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
            confirmed = maximum(was_confirmed, where(plots > c.confirming[0] - 0.5, 1.0, 0.0))
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
        laws = [expected_plot(state, c) for state in (s[0][:2] if c.kind == "imm" else s[:1])]
        by_model = [gaussian_filters.log_densities(plot_difference(z, mean, c.span), S) for mean, S, _ in laws]
        if c.kind != "imm":
            return by_model[0]
        return [gaussian_filters.log_mixture(a, b, s[0][2]) for a, b in zip(*by_model, strict=True)]

    def merge(s, other, p, c):
        mix = gaussian_filters.mix_pairs if c.kind == "imm" else gaussian_filters.mix
        return mix(s[0], other[0], p), s[1]

    def innovation(s, z, u, c):
        mean, S, _ = expected_plot(moments(s, c), c)
        e = plot_difference(z, mean, c.span)
        return (*e[:2], e[2] if is_fold_known(S[5], c.span) else math.nan) if c.m == 3 else e, S

    def gate(s, u, c):
        S = expected_plot(moments(s, c), c)[1]
        return math.sqrt(c.gate * S[0]), math.sqrt(c.gate * S[3 if c.m == 3 else 2])

    def counts(s, u, c):
        return s[1][:2]


def moments(s, c):
    """The state of a filter with its covariance."""
    return gaussian_filters.mix(*s[0]) if c.kind == "imm" else s[0]


class Plane(PlanarStudy):
    """Filters of a target in the plane."""

    name, about = "plane", "Range, bearing and radial velocity in the plane, among false plots."
    asks = term("How much does Doppler help a tracker in the plane?")
    filters = MappingProxyType(
        {"kind": "extended, unscented, converted or imm", "model": "velocity, acceleration or turn"}
    )
    Filter, counted = Filter, ("confirmed", "wrong_plot")
    kinds = dict.fromkeys(("extended", "unscented", "converted", "imm"), Tracking)

    def columns(self, spec, filter_keys):
        return super().columns(spec, filter_keys)[: 3 if filter_keys.doppler else 2]

    def alternatives(self, spec, index):
        """Higher repetition rates, with which velocities fold less."""
        rate, baseline = spec.radar.repetition_rate_hz, spec.baseline or spec.filters[0].name
        if not spec.filters[index].doppler or any(keys.doppler for keys in spec.filters if keys.name == baseline):
            return None
        return [] if rate is None else [(("radar.repetition_rate_hz", factor * rate),) for factor in (2.0, 4.0)]

    def tells_folds(self, spec, keys):
        if not keys.doppler:
            return True
        for s, c in self.typical_states(spec, keys):
            states, _ = s if c.kind == "converted" else Tracking.predict(s, spec.radar.scan_period_s, (), c)
            laws = [expected_plot(state, c)[1] for state in (states[:2] if c.kind == "imm" else (states,))]
            if c.first or any(is_fold_known(S[5], c.span) for S in laws):
                return True
        return False

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


STUDY = Plane()
