"""Keys of the multimodel study (P2): a radar in biconical coordinates, a flight, filters with banks of models."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from radarsim.config import key_types, marks, study_keys
from radarsim.config.cross_checks import CheckError, check_error, cross_check
from radarsim.config.key_types import Name, NonNegative, Number, Positive, key
from radarsim.config.marks import DesignMark, DisplayMark
from radarsim.config.model import Model

MOST_SCANS = 100_000
MOST_MODELS = 5
WIDEST_RAD = 0.0873  # 5 degrees: nine sigma stay within the 45 degrees up to which a plot's angle is turned exactly
COLUMN_TOLERANCE = 1e-6  # of the sum of a column of the transition matrix: three printed figures fall short by less
LONGEST_INTERVAL_S = 60.0
MOST_DURATION_S = 3600.0
Angle = Annotated[Number, Field(ge=-6.3, le=6.3)]
Wide = Annotated[Positive, Field(le=WIDEST_RAD)]
Point = Annotated[tuple[Number, Number, Number], Field()]
Acceleration = Annotated[Number, Field(ge=-2000, le=2000)]


class Sensor(Model):
    """A radar with a flat antenna: accuracies of a plot, its period, where the antenna looks."""

    name: Annotated[Name | None, DisplayMark()] = key("name", "display name", None)
    sigma_range_m: Positive | None = key(
        "σ of the measured range", "standard deviation of a measured range, m", None, symbol="σ_r"
    )
    sigma_elevation_rad: Wide | None = key(
        "σ of the measured elevation", "σ of the biconical elevation asin(y_A / r), rad", None, symbol="σ_ε"
    )
    sigma_azimuth_rad: Wide | None = key(
        "σ of the measured azimuth", "σ of the biconical azimuth asin(z_A / r), rad", None, symbol="σ_α"
    )
    sigma_x_m: Positive | None = key(
        "σ of the measured x", "σ of x (north), m: for plots measured in the local frame", None, symbol="σ_x"
    )
    sigma_y_m: Positive | None = key("σ of the measured y", "σ of y (up), m", None, symbol="σ_y")
    sigma_z_m: Positive | None = key("σ of the measured z", "σ of z (east), m", None, symbol="σ_z")
    scan_period_s: Annotated[Positive, Field(le=LONGEST_INTERVAL_S)] = key(
        "scan period", "time between two plots, s", symbol="Δt"
    )
    jitter_s: NonNegative = key(
        "jitter of the scans", "largest random shift of each scan, earlier or later, drawn once, s", 0.0
    )
    antenna_azimuth_rad: Angle = key(
        "antenna azimuth", "azimuth of the antenna's normal, from north to east, rad", 0.0, symbol="α_A"
    )
    antenna_elevation_rad: Angle = key(
        "antenna elevation", "elevation of the antenna's normal above the horizon, rad", 0.0, symbol="ε_A"
    )
    antenna_height_m: Number = key("antenna height", "height of the phase centre above the origin, m", 0.0, symbol="h")
    detection_probability: Annotated[key_types.Probability, Field(gt=0)] = key(
        "detection probability",
        "probability that a scan gives a plot; the three that start the track are never missed",
        1.0,
        symbol="P_D",
    )
    conversion: Annotated[Literal["plain", "unbiased"], DesignMark()] = key(
        "conversion of plots",
        "conversion of plots to the local frame: as in the paper, or with its mean error removed",
        "plain",
    )

    @cross_check
    def _one_frame(self) -> Iterator[CheckError]:
        biconical = [self.sigma_range_m, self.sigma_elevation_rad, self.sigma_azimuth_rad]
        local = [self.sigma_x_m, self.sigma_y_m, self.sigma_z_m]
        if biconical.count(None) + local.count(None) != 3 or (None in biconical and None in local):
            yield check_error(
                "sigma_range_m",
                "give sigma_range_m, sigma_elevation_rad, sigma_azimuth_rad, or else sigma_x_m, sigma_y_m, sigma_z_m",
            )

    @cross_check
    def _scans_in_order(self) -> Iterator[CheckError]:
        if 2 * self.jitter_s >= self.scan_period_s:
            yield check_error("jitter_s", "must be under half the scan period")

    @property
    def sigma(self) -> tuple[float, float, float]:
        """Of range (m), elevation and azimuth (rad), or of x, y, z (m)."""
        biconical = (self.sigma_range_m, self.sigma_elevation_rad, self.sigma_azimuth_rad)
        sigmas = (*biconical, self.sigma_x_m, self.sigma_y_m, self.sigma_z_m)
        first, second, third = (sigma for sigma in sigmas if sigma is not None)  # by _one_frame
        return first, second, third


class Stage(Model):
    """A named part of the flight, up to a time."""

    name: Name = key("stage", "start, ballistic, steady, manoeuvre, after, …")
    end_s: Positive | None = key("end time", "end, s from the first plot; only the last stage has none", None)


Stages = Annotated[tuple[Stage, ...], Field(min_length=1, max_length=12), AfterValidator(study_keys.unique_names)]


class Target(Model):
    """What all targets share: the stages by which tables are made."""

    stages: Annotated[Stages, DesignMark()] = key(
        "stages", "stages in order, the last without an end", (Stage(name="all", end_s=None),)
    )

    @property
    def stage_ends_s(self) -> tuple[float, ...]:
        """Ends of all stages but the last, s from the first plot."""
        return tuple(stage.end_s for stage in self.stages if stage.end_s is not None)

    @cross_check
    def _in_order(self) -> Iterator[CheckError]:
        ends = [stage.end_s for stage in self.stages]
        if None in ends[:-1] or ends[-1] is not None:
            yield check_error("stages", "all but the last need end_s, and only they")
        elif any(b <= a for a, b in pairwise(end for end in ends if end is not None)):
            yield check_error("stages", "must follow one another in time")


class Phase(Model):
    """Accelerations commanded from a moment on, m/s²."""

    start_s: NonNegative = key("start time", "start, s from the first plot")
    lateral_mps2: Acceleration = key("lateral acceleration", "to the right of the velocity, level, m/s²", 0.0)
    normal_mps2: Acceleration = key("normal acceleration", "upwards, normal to the velocity, m/s²", 0.0)
    axial_mps2: Acceleration = key("axial acceleration", "along the velocity, m/s²", 0.0)
    period_s: Positive | None = key(
        "period of the weave", "the commands follow a sine of this period, s; none: constant", None
    )
    trimmed: key_types.Flag = key(
        "gravity and drag balanced", "lift and thrust balance gravity and drag as well", False
    )


class Flight(Target):
    """A point mass with gravity, an exponential atmosphere, and accelerations commanded by phase."""

    kind: Literal["flight"] = key("kind", "an integrated flight")
    duration_s: Annotated[Positive, Field(le=MOST_DURATION_S)] = key("duration", "time from first to last plot, s")
    position_m: Point = key("position at the first plot", "north, up, east at the first plot, m")
    velocity_mps: Point = key("velocity at the first plot", "north, up, east at the first plot, m/s")
    ballistic_coefficient_kgpm2: Positive = key("ballistic coefficient", "mass / (drag coefficient · area), kg/m²", 1e4)
    lag_s: Positive = key("lag of the commands", "time constant with which commands are followed, s", 1.0)
    phases: Annotated[tuple[Phase, ...], Field(min_length=1, max_length=64)] = key(
        "phases tried in the first window", "phases, in order"
    )

    @property
    def start_s(self) -> float | None:
        """When the first acceleration is commanded, s from the first plot; None where none is."""
        commands = ((p.lateral_mps2, p.normal_mps2, p.axial_mps2) for p in self.phases)
        return next((p.start_s for p, command in zip(self.phases, commands, strict=True) if any(command)), None)

    @cross_check
    def _phases_in_order(self) -> Iterator[CheckError]:
        starts = [phase.start_s for phase in self.phases]
        if starts[0] != 0:
            yield check_error("phases.0.start_s", "must be 0")
        if any(b <= a for a, b in pairwise(starts)):
            yield check_error("phases", "must follow one another in time")

    @cross_check
    def _moves(self) -> Iterator[CheckError]:
        if self.velocity_mps == (0, 0, 0):
            yield check_error("velocity_mps", "must not be zero")


class RecordedFlight(Target):
    """A flight recorded in a file, smoothed by a spline whose derivatives are the true velocity and acceleration."""

    kind: Literal["recorded"] = key("kind", "a flight from a CSV file with columns t_s, x_m, y_m, z_m")
    file: Annotated[str, marks.DataFile()] = key("file", "path of the file, relative to this one")


AnyTarget = Annotated[Flight | RecordedFlight, Field(discriminator="kind")]


class MotionModel(Model):
    """A hypothesis of how the target moves."""

    motion: Literal["uniform", "accelerated", "still"] = key(
        "motion", "straight at a constant velocity, with a constant acceleration, or at rest"
    )
    sigma_acceleration_mps2: NonNegative = key(
        "σ of the random acceleration",
        "standard deviation of the random acceleration of each step, m/s², whatever the step's length",
        symbol="σ_A",
    )


Column = Annotated[tuple[key_types.Probability, ...], Field(min_length=1, max_length=MOST_MODELS)]


class Filter(Model):
    """A Kalman filter, or several that share what they know."""

    name: Annotated[Name, DisplayMark()] = key("name", "label; every filter has its own")
    family: Literal["kalman", "gpb1", "imm", "gpb2"] = key(
        "family of filters", "one model; or MMA1 (GPB1), MMA2 (IMM), MMA3 (GPB2) of the paper"
    )
    models: Annotated[tuple[MotionModel, ...], Field(min_length=1, max_length=MOST_MODELS)] = key(
        "motion models", "the bank of motion models, one to five; kalman has one"
    )
    transition: Annotated[tuple[Column, ...], Field(min_length=1, max_length=MOST_MODELS), marks.ColumnsOfOne()] = key(
        "transition probabilities",
        "transition probabilities: row i, column j from model j to model i; columns sum to one",
        ((1.0,),),
    )
    transition_interval_s: Positive = key(
        "interval of the transition matrix", "interval for which the matrix is valid, s", 0.05
    )
    merge: Literal["moment", "best", "combined", "modified_combined"] = key(
        "merging rule", "rule of the partial merges: eq. (4), eq. (5), or the paper's combinations of them", "combined"
    )
    output: Literal["moment", "best"] = key("output rule", "rule that forms the estimate", "best")
    covariance_at: Literal["plot", "prediction"] = key(
        "where the plot's covariance is computed",
        "where the plot's covariance is computed: at the plot, as in the paper, or at its prediction",
        "plot",
    )

    @cross_check
    def _family_fits(self) -> Iterator[CheckError]:
        size = len(self.models)
        if self.family == "kalman" and size != 1:
            yield check_error("models", f"kalman has one model, got {size}; take imm, gpb1 or gpb2")

    @cross_check
    def _transition_fits(self) -> Iterator[CheckError]:
        size = len(self.models)
        if len(self.transition) != size or any(len(row) != size for row in self.transition):
            yield check_error("transition", f"must be {size} rows of {size} probabilities, one for each model")
            return
        columns = [sum(row[j] for row in self.transition) for j in range(size)]
        if any(abs(total - 1) > COLUMN_TOLERANCE for total in columns):
            by_rows = all(abs(sum(row) - 1) <= COLUMN_TOLERANCE for row in self.transition)
            hint = "; its rows do: transpose it" if by_rows else ""
            yield check_error("transition", f"its columns must sum to one (column j: from model j){hint}")


class Keys(study_keys.StudyKeys):
    """Multiple-model filters on an aeroballistic target."""

    figure_names = ("trajectory", "sigma_y", "sigma_vy", "probabilities", "families", "cost", "consistency")

    sensor: Sensor = key("sensor", "the radar")
    target: Annotated[AnyTarget, marks.Scenario()] = key("target", "the target: a scenario's stem, or inline")
    filters: Annotated[
        tuple[Filter, ...], Field(min_length=1, max_length=32), AfterValidator(study_keys.unique_names), DesignMark()
    ] = key("filters", "the filters; all see the same plots")
    baseline: study_keys.Baseline = study_keys.BASELINE
    start_acceleration_mps2: Annotated[NonNegative, DesignMark()] = key(
        "σ of the acceleration at the start of a track",
        "standard deviation of the acceleration that the start of a track allows for, m/s²",
        30.0,
    )
    scans: Annotated[int | None, key_types.WholeNumber(4, MOST_SCANS), DesignMark()] = key(
        "number of scans", "number of plots; default: to the end of the flight", None
    )
    report_every: Annotated[int, key_types.WholeNumber(1, MOST_SCANS), DesignMark()] = key(
        "every n-th scan reported", "tables and figures contain every n-th scan and the last; stages use all scans", 1
    )
