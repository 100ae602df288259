"""Keys of the quantities derived from a track: course, speed, predicted position, closest approach."""

from typing import Annotated

from pydantic import Field

from radarsim.config.key_types import NonNegative, Number, Positive, key
from radarsim.config.model import Model


class OwnShip(Model):
    """The vessel that carries the sonar, or another to be kept clear of; its course and speed are constant."""

    x_m: Number = key("distance north", "distance north of the sonar's origin at the first plot, m", 0.0)
    y_m: Number = key("distance east", "distance east of the sonar's origin at the first plot, m", 0.0)
    speed_mps: NonNegative = key("speed", "speed, m/s", 0.0)
    course_rad: Number = key("course", "course, from north to east, rad", 0.0)


class Uses(Model):
    """Quantities derived from a track: course, speed, predicted position, closest point of approach."""

    horizon_s: Positive = key("prediction horizon", "how far ahead the position is predicted, s")
    at_s: Annotated[tuple[NonNegative, ...], Field(min_length=1, max_length=16)] | None = key(
        "times", "times, s from the first plot: the scan then or the next one; default: the last scan", None
    )
    own_ship: OwnShip = key("own ship", "the vessel that the closest approach refers to", OwnShip())
