"""Range-Doppler coupling of chirp radars in tracking, after Fitzgerald (1974) and Wong & Blair (2000).

A linear chirp measures z = r + Δ v: the range, shifted by the velocity times the carrier over the slope.
"""

from typing import Annotated, Literal

import numpy as np
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
    Number,
    Paper,
    Positive,
    Probability,
    key,
)

SIGN = {"up": (1, 1), "down": (-1, -1), "alternating": (1, -1), "none": (0, 0)}  # of Δ, at even and odd scans


class Radar(Model):
    """A radar whose frequency rises or falls within the pulse."""

    name: Annotated[Name | None, DisplayMark()] = key("name", "display name", None)
    carrier_hz: Positive = key("carrier", "carrier frequency, Hz", symbol="f_0")
    slope_hz_per_s: Positive = key("slope of the chirp", "bandwidth over pulse length, Hz/s", symbol="μ", unit="Hz/s")
    sigma_range_m: Positive = key("σ of the measured range", "standard deviation of a plot, m", symbol="σ_r")
    scan_period_s: Positive = key("scan period", "time between two plots, s", symbol="T")
    detection_probability: Probability = key("probability of detection", "of each plot, no unit", 1.0, symbol="P_d")

    @property
    def coupling_s(self):
        """Δ, by which a velocity shifts the measured range."""
        return self.carrier_hz / self.slope_hz_per_s


class Target(Model):
    """A target whose velocity walks at random."""

    range_m: Number = key("expected range", "mean of the first range, m")
    velocity_mps: Number = key("expected velocity", "mean of the first velocity, m/s")
    sigma_range_m: NonNegative = key("σ of the first range", "about its mean, m")
    sigma_velocity_mps: NonNegative = key("σ of the first velocity", "about its mean, m/s")
    motion: Literal["white_noise", "steps"] = key(
        "motion", "acceleration: white noise, or a step a scan", "white_noise"
    )
    density_m2ps3: Positive = key("spectral density of the acceleration", "q, m²/s³", symbol="q", unit="m²/s³")


class Filter(Member):
    """A Kalman filter of range and velocity, and the chirps that it sees."""

    chirp: Literal["up", "down", "alternating", "none"] = key("chirp", "coupling Δ, −Δ, both in turn, or none", "up")
    coupling: Literal["known", "ignored"] = key("coupling", "whether the filter knows of it", "known")
    gain: Literal["kalman", "steady"] = key("gain", "of every scan, or its limit from the first one on", "kalman")


class Chirp(LinearStudy):
    """How accurate tracks are whose ranges are shifted by their velocities."""

    name, about = "chirp", "Chirp radar (Fitzgerald 1974): tracking with coupled range and Doppler."
    filters = {"chirp": "the chirps seen", "coupling": "known to the filter, or ignored", "gain": "kalman, or steady"}
    asks = "How accurate is tracking by chirps, whose range and Doppler are coupled?"
    components = (Component("r", "m", "$r$", "range"), Component("v", "m/s", "$v$", "velocity"))
    parts, Filter = {"radar": Radar, "target": Target}, Filter
    scan_period, detection = "radar.scan_period_s", "radar.detection_probability"
    measured = (MeasuredColumn("z_m", "m", ("radar.sigma_range_m",)),)
    fitted = ("radar.sigma_range_m", "target.density_m2ps3")
    paper = Paper("Fitzgerald 1974", may_grow=("filters",))

    def motion(self, spec):
        target, T = spec.target, spec.radar.scan_period_s
        q, white = target.density_m2ps3, target.motion == "white_noise"
        return Motion(
            F=lambda t: [[1, t], [0, 1]],
            Q=lambda t: q * np.array([[t**3 / 3, t**2 / 2], [t**2 / 2, t]] if white
                                     else [[t**4 / 4 / T, t**3 / 2 / T], [t**3 / 2 / T, t**2 / T]]),
            mean=[target.range_m, target.velocity_mps],
            covariance=np.diag([target.sigma_range_m**2, target.sigma_velocity_mps**2]),
        )  # fmt: skip

    def plot(self, spec, filter_keys, k):
        return [1, SIGN[filter_keys.chirp][k % 2] * spec.radar.coupling_s], spec.radar.sigma_range_m

    def assumed_plot(self, spec, filter_keys, k):
        seen, sigma = self.plot(spec, filter_keys, k)
        return (seen if filter_keys.coupling == "known" else [1, 0]), sigma

    def own_gains(self, spec, filter_keys):
        return self.steady_gains(spec, filter_keys) if filter_keys.gain == "steady" else None

    def columns(self, spec, filter_keys):
        return (f"z_{filter_keys.chirp}_m",)

    claims_yaml = """
paper: chirp
config: chirp
claims:
- {id: 1, place: abstract, statement: An up-chirp tracks the range better than a down-chirp, parts: [
    {of: [{}], what: gain of up, unit: "%", measure: {gain: {filter: up, component: r}}, expected: {above: 0}}]}
- {id: 2, place: III, statement: and the velocity, parts: [
    {of: [{}], what: gain of up, unit: "%", measure: {gain: {filter: up, component: v}}, expected: {above: 0}}]}
- {id: 3, place: III, statement: The advantage grows with the coupling, config: chirp_slopes, parts: [
    {of: [{radar.coupling_s: $less}, {radar.coupling_s: $more}], each: {"less, more": [[0.1, 0.3], [0.3, 1]]},
     what: "growth from $less s to $more s", unit: points, measure: {gain_change: {filter: up, component: r}},
     expected: {above: 0}}]}
- {id: 4, place: IV, statement: Ignoring the coupling more than doubles the error, parts: [
    {of: [{}], what: ignoring over up, measure: {ratio: {filter: ignoring, over: up, component: r}},
     expected: {at_least: 2}}]}
- {id: 5, place: V, statement: Alternating chirps are worth a waveform without coupling, config: chirp_slopes, parts: [
    {of: [{radar.coupling_s: 1}], what: alternating over none, expected: {same: [1, 0.02]},
     measure: {ratio: {filter: alternating, over: none, component: r}}}]}
choices:
- {key: motion, asks: how the acceleration is noise, original: random acceleration, alternatives: [
    {name: white noise, kind: U, reason: the usual},
    {name: steps, kind: U, reason: also usual, sets: {target.motion: steps}}]}
- {key: start, asks: what is known at first, original: nothing, claims: [4], alternatives: [
    {name: wide, kind: U, reason: the velocity is unknown}, {name: the gains' limit, kind: U, reason: a track that has
     lasted, sets: {gain: steady}}]}
"""


STUDY = Chirp()
