"""Keys of the multimodel study (P2): a radar in biconical coordinates, a flight, filters with banks of motion
models."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from radarsim.config.fields import (
    At,
    DataFile,
    Design,
    Display,
    Flag,
    Model,
    Name,
    NameIn,
    NonNegative,
    Number,
    Positive,
    Probability,
    Scenario,
    Study,
    Whole,
    at,
    cross_check,
    unique_names,
)

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

    name: Annotated[Name | None, Display()] = Field(None, title="name", description="display name")
    sigma_range_m: Positive | None = Field(
        None,
        title="σ of the measured range",
        json_schema_extra={"symbol": "σ_r"},
        description="standard deviation of a measured range, m",
    )
    sigma_elevation_rad: Wide | None = Field(
        None,
        title="σ of the measured elevation",
        json_schema_extra={"symbol": "σ_ε"},
        description="of the biconical elevation asin(y_A / r), rad",
    )
    sigma_azimuth_rad: Wide | None = Field(
        None,
        title="σ of the measured azimuth",
        json_schema_extra={"symbol": "σ_α"},
        description="of the biconical azimuth asin(z_A / r), rad",
    )
    sigma_x_m: Positive | None = Field(
        None,
        title="σ of the measured x",
        json_schema_extra={"symbol": "σ_x"},
        description="of x (north), m: for plots measured in the local frame",
    )
    sigma_y_m: Positive | None = Field(
        None, title="σ of the measured y", json_schema_extra={"symbol": "σ_y"}, description="of y (up), m"
    )
    sigma_z_m: Positive | None = Field(
        None, title="σ of the measured z", json_schema_extra={"symbol": "σ_z"}, description="of z (east), m"
    )
    scan_period_s: Annotated[Positive, Field(le=LONGEST_INTERVAL_S)] = Field(
        title="scan period", json_schema_extra={"symbol": "Δt"}, description="time between two plots, s"
    )
    jitter_s: NonNegative = Field(
        0.0, title="jitter of the scans", description="each scan comes earlier or later by up to this, drawn once, s"
    )
    antenna_azimuth_rad: Angle = Field(
        0.0,
        title="antenna azimuth",
        json_schema_extra={"symbol": "α_A"},
        description="of the antenna's normal, from north to east, rad",
    )
    antenna_elevation_rad: Angle = Field(
        0.0,
        title="antenna elevation",
        json_schema_extra={"symbol": "ε_A"},
        description="of the antenna's normal above the horizon, rad",
    )
    antenna_height_m: Number = Field(
        0.0,
        title="antenna height",
        json_schema_extra={"symbol": "h"},
        description="of the phase centre above the origin, m",
    )
    detection_probability: Annotated[Probability, Field(gt=0)] = Field(
        1.0,
        title="detection probability",
        json_schema_extra={"symbol": "P_D"},
        description="probability that the plot of a scan comes; the three that start the track always do",
    )
    conversion: Annotated[Literal["plain", "unbiased"], Design()] = Field(
        "plain",
        title="conversion of plots",
        description="of plots to the local frame: as in the paper, or with its mean error taken off",
    )

    @cross_check
    def _one_frame(self) -> Iterator[At]:
        biconical = [self.sigma_range_m, self.sigma_elevation_rad, self.sigma_azimuth_rad]
        local = [self.sigma_x_m, self.sigma_y_m, self.sigma_z_m]
        if biconical.count(None) + local.count(None) != 3 or (None in biconical and None in local):
            yield at(
                "sigma_range_m",
                "give sigma_range_m, sigma_elevation_rad, sigma_azimuth_rad, or else sigma_x_m, sigma_y_m, sigma_z_m",
            )

    @cross_check
    def _scans_in_order(self) -> Iterator[At]:
        if 2 * self.jitter_s >= self.scan_period_s:
            yield at("jitter_s", "must be under half the scan period")

    @property
    def sigma(self) -> tuple[float, float, float]:
        """Of range (m), elevation and azimuth (rad), or of x, y, z (m)."""
        biconical = (self.sigma_range_m, self.sigma_elevation_rad, self.sigma_azimuth_rad)
        given = (*biconical, self.sigma_x_m, self.sigma_y_m, self.sigma_z_m)
        first, second, third = (sigma for sigma in given if sigma is not None)  # by _one_frame
        return first, second, third


class Stage(Model):
    """A named part of the flight, up to a time."""

    name: Name = Field(title="stage", description="start, ballistic, steady, manoeuvre, after, …")
    end_s: Positive | None = Field(
        None, title="end time", description="when it ends, s from the first plot; only the last has no end"
    )


Stages = Annotated[tuple[Stage, ...], Field(min_length=1, max_length=12), AfterValidator(unique_names)]


class Target(Model):
    """What all targets share: the stages by which tables are made."""

    stages: Annotated[Stages, Design()] = Field(
        (Stage(name="all", end_s=None),), title="stages", description="stages in order, the last without an end"
    )

    @property
    def stage_ends_s(self) -> tuple[float, ...]:
        """Ends of all stages but the last, s from the first plot."""
        return tuple(stage.end_s for stage in self.stages if stage.end_s is not None)

    @cross_check
    def _in_order(self) -> Iterator[At]:
        ends = [stage.end_s for stage in self.stages]
        if None in ends[:-1] or ends[-1] is not None:
            yield at("stages", "all but the last need end_s, and only they")
        elif any(b <= a for a, b in pairwise(end for end in ends if end is not None)):
            yield at("stages", "must follow one another in time")


class Phase(Model):
    """Accelerations commanded from a moment on, m/s²."""

    start_s: NonNegative = Field(title="start time", description="when it begins, s from the first plot")
    lateral_mps2: Acceleration = Field(
        0.0, title="lateral acceleration", description="to the right of the velocity, level, m/s²"
    )
    normal_mps2: Acceleration = Field(
        0.0, title="normal acceleration", description="upwards, normal to the velocity, m/s²"
    )
    axial_mps2: Acceleration = Field(0.0, title="axial acceleration", description="along the velocity, m/s²")
    period_s: Positive | None = Field(
        None, title="period of the weave", description="the commands follow a sine of this period, s; none: constant"
    )
    trimmed: Flag = Field(
        False, title="gravity and drag balanced", description="lift and thrust balance gravity and drag as well"
    )


class Flight(Target):
    """A point mass with gravity, an exponential atmosphere, and accelerations commanded by phase."""

    kind: Literal["flight"] = Field(title="kind", description="an integrated flight")
    duration_s: Annotated[Positive, Field(le=MOST_DURATION_S)] = Field(
        title="duration", description="time from first to last plot, s"
    )
    position_m: Point = Field(title="position at the first plot", description="north, up, east at the first plot, m")
    velocity_mps: Point = Field(
        title="velocity at the first plot", description="north, up, east at the first plot, m/s"
    )
    ballistic_coefficient_kgpm2: Positive = Field(
        1e4, title="ballistic coefficient", description="mass / (drag coefficient · area), kg/m²"
    )
    lag_s: Positive = Field(
        1.0, title="lag of the commands", description="time constant with which commands are followed, s"
    )
    phases: Annotated[tuple[Phase, ...], Field(min_length=1, max_length=64)] = Field(
        title="phases tried in the first window", description="phases, in order"
    )

    @cross_check
    def _phases_in_order(self) -> Iterator[At]:
        starts = [phase.start_s for phase in self.phases]
        if starts[0] != 0:
            yield at("phases.0.start_s", "must be 0")
        if any(b <= a for a, b in pairwise(starts)):
            yield at("phases", "must follow one another in time")

    @cross_check
    def _moves(self) -> Iterator[At]:
        if self.velocity_mps == (0, 0, 0):
            yield at("velocity_mps", "must not be zero")


class Recorded(Target):
    """A flight recorded in a file, smoothed by a spline whose derivatives are the true velocity and acceleration."""

    kind: Literal["recorded"] = Field(
        title="kind", description="a flight from a CSV file with columns t_s, x_m, y_m, z_m"
    )
    file: Annotated[str, DataFile()] = Field(title="file", description="the file, from the folder of this one")


AnyTarget = Annotated[Flight | Recorded, Field(discriminator="kind")]


class MotionModel(Model):
    """A hypothesis of how the target moves."""

    motion: Literal["uniform", "accelerated", "still"] = Field(
        title="motion", description="straight at a constant velocity, with a constant acceleration, or at rest"
    )
    sigma_acceleration_mps2: NonNegative = Field(
        title="σ of the random acceleration",
        json_schema_extra={"symbol": "σ_A"},
        description="standard deviation of the random acceleration of each step, m/s², whatever the step's length",
    )


Column = Annotated[tuple[Probability, ...], Field(min_length=1, max_length=MOST_MODELS)]


class Filter(Model):
    """A Kalman filter, or several that share what they know."""

    name: Annotated[Name, Display()] = Field(title="name", description="label; every filter has its own")
    family: Literal["kalman", "gpb1", "imm", "gpb2"] = Field(
        title="family of filters", description="one model; or MMA1 (GPB1), MMA2 (IMM), MMA3 (GPB2) of the paper"
    )
    models: Annotated[tuple[MotionModel, ...], Field(min_length=1, max_length=MOST_MODELS)] = Field(
        title="motion models", description="the bank of motion models, one to five; kalman has one"
    )
    transition: Annotated[tuple[Column, ...], Field(min_length=1, max_length=MOST_MODELS)] = Field(
        ((1.0,),),
        title="transition probabilities",
        description="transition probabilities: row i, column j from model j to model i; columns sum to one",
    )
    transition_interval_s: Positive = Field(
        0.05, title="interval of the transition matrix", description="time for which the matrix holds, s"
    )
    merge: Literal["moment", "best", "combined", "modified_combined"] = Field(
        "combined",
        title="merging rule",
        description="rule of the partial merges: eq. (4), eq. (5), or the paper's combinations of them",
    )
    output: Literal["moment", "best"] = Field(
        "best", title="output rule", description="rule by which the estimate is made"
    )
    covariance_at: Literal["plot", "prediction"] = Field(
        "plot",
        title="where the plot's covariance is computed",
        description="where the plot's covariance is computed: at the plot, as in the paper, or at its prediction",
    )

    @cross_check
    def _family_fits(self) -> Iterator[At]:
        size = len(self.models)
        if self.family == "kalman" and size != 1:
            yield at("models", f"kalman has one model, got {size}; take imm, gpb1 or gpb2")

    @cross_check
    def _transition_fits(self) -> Iterator[At]:
        size = len(self.models)
        if len(self.transition) != size or any(len(row) != size for row in self.transition):
            yield at("transition", f"must be {size} rows of {size} probabilities, one for each model")
            return
        columns = [sum(row[j] for row in self.transition) for j in range(size)]
        if any(abs(total - 1) > COLUMN_TOLERANCE for total in columns):
            by_rows = all(abs(sum(row) - 1) <= COLUMN_TOLERANCE for row in self.transition)
            hint = "; its rows do: transpose it" if by_rows else ""
            yield at("transition", f"its columns must sum to one (column j: from model j){hint}")


class Keys(Study):
    """Multiple-model filters on an aeroballistic target."""

    figure_names = ("trajectory", "sigma_y", "sigma_vy", "probabilities", "families", "cost", "consistency")

    sensor: Sensor = Field(title="sensor", description="the radar")
    target: Annotated[AnyTarget, Scenario()] = Field(
        title="target", description="the target: a scenario's stem, or inline"
    )
    filters: Annotated[
        tuple[Filter, ...], Field(min_length=1, max_length=32), AfterValidator(unique_names), Design()
    ] = Field(title="filters", description="the filters; all see the same plots")
    baseline: Annotated[Name | None, Design(), NameIn("filters")] = Field(
        None, title="baseline filter", description="name of the filter that gains are against; default: the first"
    )
    start_acceleration_mps2: Annotated[NonNegative, Design()] = Field(
        30.0,
        title="σ of the acceleration at the start of a track",
        description="spread of the acceleration that the start of a track allows for, m/s²",
    )
    scans: Annotated[int | None, Whole(4, MOST_SCANS), Design()] = Field(
        None, title="number of scans", description="number of plots; default: to the end of the flight"
    )
    report_every: Annotated[int, Whole(1, MOST_SCANS), Design()] = Field(
        1,
        title="every n-th scan reported",
        description="tables and figures keep every such scan and the last; stages are made of all",
    )
