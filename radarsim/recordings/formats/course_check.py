"""Positions that move against the courses that their records state, as those whose longitude or latitude has lost its
sign."""

import numpy as np

from radarsim.constants import EARTH_RADIUS_M
from radarsim.language.translate import term, tr
from radarsim.recordings.formats.records import POSITIONS, Batch
from radarsim.recordings.grouping import rows_by_name

MAX_ROWS, MAX_STEP_S = 3000, 60.0  # rows that are compared, and time from row to row
MIN_WAY_M = 30.0  # of a step, in an axis, whose direction counts
MIN_STEPS, MIN_SHARE = 20, 0.9  # of the steps in an axis that are turned
CAUSES = {  # by the axes that are turned, east and north
    (True, False): term("the longitudes may have lost their sign"),
    (False, True): term("the latitudes may have lost their sign"),
    (True, True): term("both coordinates may have lost their sign, or the courses are reversed"),
}


class CourseCheck:
    """Compare the steps of the first positions with their stated velocities."""

    def __init__(self) -> None:
        self.rows = 0
        self.steps: list[np.ndarray] = []  # (2, 2, n): actual and stated, east and north, m

    def add(self, batch: Batch) -> None:
        """Take the steps of a batch, while there are fewer than MAX_ROWS rows."""
        if batch.kind != POSITIONS or self.rows >= MAX_ROWS:
            return
        self.rows += len(batch.track)
        names = ("t_s", "latitude_deg", "longitude_deg", "east_mps", "north_mps")
        for name, rows in rows_by_name(batch.track).items():
            t, lat, lon, east, north = (batch.columns[key][rows] for key in names)
            steps_s = np.diff(t)
            eastward = EARTH_RADIUS_M * np.cos(np.radians(lat[1:])) * np.radians(np.diff(lon))
            stated = [0.5 * (speed[1:] + speed[:-1]) * steps_s for speed in (east, north)]
            is_used = np.isfinite(stated).all(axis=0) & (steps_s > 0) & (steps_s < MAX_STEP_S) & bool(name)
            actual = [eastward, EARTH_RADIUS_M * np.radians(np.diff(lat))]
            self.steps.append(np.array([actual, stated])[:, :, is_used])

    def notes(self) -> list[str]:
        """A note if most steps are turned against the courses in an axis."""
        if not self.steps:
            return []
        actual, stated = np.concatenate(self.steps, axis=2)
        is_long = (np.abs(actual) > MIN_WAY_M) & (np.abs(stated) > MIN_WAY_M)
        is_turned = is_long & (actual * stated < 0)
        long_steps, turned_steps = is_long.sum(axis=1), is_turned.sum(axis=1)
        east, north = ((long_steps >= MIN_STEPS) & (turned_steps >= MIN_SHARE * long_steps)).tolist()
        cause = CAUSES.get((east, north))
        return [] if cause is None else [tr("positions move against their courses: {cause}", cause=tr(cause))]
