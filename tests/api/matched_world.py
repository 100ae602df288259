"""RLS 2 of the first paper in a world that is as its filters take it to be: a random jerk of the variance that they
allow for, or another. σ of every filter is exact."""

from radarsim.config.key_types import Positive, key
from radarsim.config.model import Model
from radarsim.config.study_keys import Member
from radarsim.physics.motion import process_noise, transition
from radarsim.report.quantities import RADIAL
from radarsim.studies.interface import Paper
from radarsim.studies.linear import LinearStudy, Motion
from radarsim.studies.onefile import MeasuredColumn

START = [[250.0**2, 0, 0], [0, 300.0**2, 0], [0, 0, 10.0**2]]


class Radar(Model):
    """A radar."""

    sigma_range_m: Positive = key("σ of the range", "standard deviation of a range, m")
    sigma_velocity_mps: Positive = key("σ of the velocity", "standard deviation of a velocity, m/s")
    scan_period_s: Positive = key("scan period", "time between two plots, s")


class Target(Model):
    """A target that jerks at random."""

    jerk_variance: Positive = key("variance of the jerk", "of each scan's, (m/s³)²", unit="(m/s³)²")


class Filter(Member):
    """A Kalman filter."""

    manoeuvre_variance: Positive = key("manoeuvre variance", "D_M, (m/s³)²", symbol="D_M", unit="(m/s³)²")


class Matched(LinearStudy):
    """The study."""

    name, about, filters, asks = "matched", "Matched.", {"manoeuvre_variance": "D_M"}, "How well?"
    components, parts, scan_period = RADIAL, {"radar": Radar, "target": Target}, "radar.scan_period_s"
    Filter = Filter
    measured = (
        MeasuredColumn("range_m", "m", ("radar.sigma_range_m",)),
        MeasuredColumn("velocity_mps", "m/s", ("radar.sigma_velocity_mps",)),
    )
    paper = Paper("Gorshkov & Zavizhenets 2017")

    def motion(self, spec):
        return self._with(spec.target.jerk_variance)

    def assumed_motion(self, spec, one):
        return self._with(one.manoeuvre_variance)

    def _with(self, variance):
        return Motion(
            lambda dt: transition(dt, 3), lambda dt: process_noise("random_jerk", variance, dt), [1e5, -200, 0], START
        )

    def plot(self, spec, one, k):
        return [[1, 0, 0], [0, 1, 0]], [spec.radar.sigma_range_m, spec.radar.sigma_velocity_mps]


STUDY = Matched()


def config(*variances, jerk=1e-3):
    """RLS 2 with these manoeuvre variances."""
    return {
        "study": "matched",
        "radar": {"sigma_range_m": 250, "sigma_velocity_mps": 15, "scan_period_s": 10},
        "target": {"jerk_variance": jerk},
        "filters": [{"name": f"{one:g}", "manoeuvre_variance": one} for one in variances],
        "scans": 15,
        "realisations": 2000,
    }
