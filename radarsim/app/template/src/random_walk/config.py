"""The YAML keys of the study. Faults of a config are found here and reported with line and column."""

from typing import Annotated, Literal

from pydantic import Field
from radarsim.config.fields import (
    Baseline,
    Design,
    Display,
    Members,
    Model,
    Name,
    NonNegative,
    Positive,
    Study,
    Whole,
    key,
)

MOST_SCANS = 100_000


# Yours: the sensor. A key ends in its unit (_m, _s, _mps, _rad, …) and its description names it.
class Sensor(Model):
    """A sensor that measures the position."""

    name: Annotated[Name | None, Display()] = key("name", "display name", None)
    sigma_x_m: Positive = key("σ of the measured x", "standard deviation of a measured position, m", symbol="σ_x")
    scan_period_s: Positive = key("scan period", "time between two plots, s", symbol="Δt")


# Yours: the target. With `Scenario()` in the annotation of its field below, a config may name a file in scenarios/.
class Target(Model):
    """A target whose position is a random walk."""

    sigma_step_m: NonNegative = key("σ of a step", "standard deviation of its step from one scan to the next, m")


# Yours: the filters compared; a key may have a default.
class Filter(Model):
    """A filter of the position."""

    name: Annotated[Name, Display()] = key("name", "label; every filter has its own")
    kind: Literal["kalman", "fixed_gain"] = key("kind", "how its gain is computed")
    gain: Annotated[Positive, Field(le=1)] | None = key(
        "gain", "fixed_gain: share of the innovation used, no unit", only={"kind": "fixed_gain"}
    )


class Keys(Study):
    """A random walk and the filters that follow it."""

    # Yours: all figures that the study may draw, so that a misspelt name under `figures:` is refused.
    figure_names = ("sigma_x", "gain_x")

    sensor: Sensor = key("sensor", "the sensor")
    target: Target = key("target", "the target")
    # Design(): cases that differ only here have the same noise, so their comparison is paired.
    filters: Members[Filter] = key("filters", "the filters; all see the same plots")
    baseline: Baseline = key(
        "baseline filter", "filter against which gains are computed, or a list of several; default: the first", None
    )
    scans: Annotated[int, Whole(1, MOST_SCANS), Design()] = key("number of scans", "number of plots")
