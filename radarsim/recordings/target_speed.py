"""Speeds in recorded tracks that no target has.

Where most rows of a recording say so, a unit is wrong, or the columns are; single rows that no target reaches from the
rows beside them are none of its positions. A target may fly at orbital speed; jumps are judged by the scatter of the
same track, since errors of plots that follow each other fast look like speeds."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from radarsim.language.translate import term, tr

MAX_SPEED_MPS = 10_000.0  # of a target, over half of its track
MAX_STEP_S = 1e8  # from row to row: years, as of a clock that was set
MAX_JUMP_MPS = 3000.0  # from row to row, from which a row is examined: faster than aircraft
MIN_JUMP_SCATTER = 30.0  # median distances of the rows of a track from those beside them
MIN_JUMP_LEGS = 5.0  # median distances from row to row
MIN_ORBIT_MPS, MIN_ORBIT_M = 5000.0, 150e3  # of a target in orbit, from a radar
MIN_MOVING_SCATTER = 3.0  # of a track's rows, which half of it must cover: shorter legs may be noise
NEIGHBOURS = 5  # rows of which a row's place is compared with the median
MIN_ROWS = 5  # of a track
LIKELY_MPS = (0.5, 1500.0)  # speeds that explain a wrong unit of time
TIME_UNITS_S = {term("minutes"): 60.0, term("hours"): 3600.0, term("days"): 86_400.0}
POSITION_COLUMNS = (("x_m", "y_m", "z_m"), ("range_m",))


class TrackPositions(NamedTuple):
    """Times (n,) of a track, s, and positions (n, d), m, in any axes."""

    t_s: np.ndarray
    positions: np.ndarray


class FastestLegs:
    """Whether the rows of tracks, batch by batch, come nearer to each other than any target could bring them."""

    def __init__(self) -> None:
        self.numbers: dict[str, int] = {}
        self.last = np.empty((0, 1))
        self.steps = np.empty((3, 0))  # of the last batch: the number of the track, its time, and the step before it, s

    def has_jump(self, tracks: Sequence[str], t: np.ndarray, positions: np.ndarray) -> bool:
        """Whether a row at positions (n, d) is too far from that before it in its track, or too much later."""
        numbers = self.numbers
        row_numbers = np.array([numbers.setdefault(track, len(numbers)) for track in tracks])
        table = np.column_stack([t, positions])
        order = np.argsort(row_numbers, kind="stable")
        sorted_numbers, sorted_rows = row_numbers[order], table[order]
        is_first = np.diff(sorted_numbers, prepend=-1) != 0
        previous = np.roll(sorted_rows, 1, axis=0)
        if len(self.last) < len(numbers):
            missing = np.full((len(numbers) - len(self.last), table.shape[1]), np.nan)
            self.last = np.concatenate([self.last.reshape(-1, table.shape[1]), missing])
        previous[is_first] = self.last[sorted_numbers[is_first]]
        is_last = np.diff(sorted_numbers, append=-1) != 0
        self.last[sorted_numbers[is_last]] = sorted_rows[is_last]
        steps = sorted_rows - previous
        self.steps = np.array([sorted_numbers, sorted_rows[:, 0], steps[:, 0]])
        with np.errstate(invalid="ignore"):
            distances = np.sqrt((steps[:, 1:] ** 2).sum(axis=1))
            is_jump = (distances > MAX_JUMP_MPS * steps[:, 0]) | (steps[:, 0] > MAX_STEP_S)
        if "" in numbers:
            is_jump &= sorted_numbers != numbers[""]
        return bool(is_jump.any())


def unreachable_rows(track: TrackPositions) -> np.ndarray:
    """The rows of a track that no target reaches from those beside them: farther from the median of their neighbours
    than MAX_JUMP_MPS allows, MIN_JUMP_SCATTER times as far as its rows usually are, and than MIN_JUMP_LEGS steps."""
    from scipy.ndimage import median_filter

    t, positions = track
    if len(t) < MIN_ROWS:
        return np.empty(0, dtype=int)
    distances = np.linalg.norm(positions - median_filter(positions, size=(NEIGHBOURS, 1), mode="reflect"), axis=1)
    steps = np.diff(t)
    span = np.maximum(np.append(steps, steps[-1]), np.insert(steps, 0, steps[0]))
    legs = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    usual = max(MIN_JUMP_SCATTER * float(np.median(distances)), MIN_JUMP_LEGS * float(np.median(legs)))
    return np.flatnonzero((distances > MAX_JUMP_MPS * span) & (distances > usual))


def median_speed(tracks: Sequence[TrackPositions]) -> float:
    """The median speed over half of each track, m/s: errors of plots hardly enter; NaN of too few rows."""
    speeds = []
    for t, positions in tracks:
        half = len(t) // 2
        if len(t) >= MIN_ROWS and (dt := t[half:] - t[: len(t) - half]).all():
            speeds.append(np.linalg.norm(positions[half:] - positions[: len(t) - half], axis=1) / dt)
    return float(np.median(np.concatenate(speeds))) if speeds else float("nan")


def impossible_speed(tracks: Sequence[TrackPositions]) -> float | None:
    """The median speed of tracks, m/s, if no target has it; else None."""
    speed = median_speed(tracks)
    return speed if speed > MAX_SPEED_MPS else None


def unlikely_speed(tracks: Sequence[TrackPositions]) -> float | None:
    """The median speed of tracks, m/s, if it is one of orbits though the targets are too near for them; else None."""
    speed = median_speed(tracks)
    if not MIN_ORBIT_MPS < speed <= MAX_SPEED_MPS:
        return None
    long_tracks = [track for track in tracks if len(track.t_s) >= MIN_ROWS]
    distance = np.median([np.median(np.linalg.norm(track.positions, axis=1)) for track in long_tracks])
    legs, scatters = [], []
    for _, positions in long_tracks:
        half = len(positions) // 2
        legs.append(np.median(np.linalg.norm(positions[half:] - positions[: len(positions) - half], axis=1)))
        scatters.append(np.median(np.linalg.norm(np.diff(positions, n=2, axis=0), axis=1)))
    is_moving = np.median(legs) > MIN_MOVING_SCATTER * np.median(scatters)
    return speed if is_moving and distance < MIN_ORBIT_M else None


def impossible_column_speed(tracks: Sequence[Mapping[str, np.ndarray]]) -> float | None:
    """The same of tracks with columns (n,) of plots: t_s, and x_m, y_m, z_m or range_m; None without these."""
    names = next((names for names in POSITION_COLUMNS if tracks and set(names) <= set(tracks[0])), None)
    if names is None:
        return None
    positions = [np.stack([columns[name] for name in names], axis=1) for columns in tracks]
    return impossible_speed(
        [
            TrackPositions(columns["t_s"][is_known], places[is_known])
            for columns, places in zip(tracks, positions, strict=True)
            for is_known in [np.isfinite(places).all(axis=1)]
        ]
    )


def speed_message(speed: float, is_possible: bool = False) -> str:
    """The message that targets move at a speed that none has, m/s, or none so near, with the units that would explain
    it."""
    likely = [
        tr("{speed:.3g} m/s if they are in {unit}", speed=speed / unit_s, unit=tr(unit))
        for unit, unit_s in TIME_UNITS_S.items()
        if LIKELY_MPS[0] <= speed / unit_s <= LIKELY_MPS[1]
    ]
    causes = [tr("times may be in another unit: {likely}", likely=tr(" or ").join(likely))] if likely else []
    if speed / 1000 <= LIKELY_MPS[1]:
        causes.append(tr("ranges may be a thousand times too large: {speed:.3g} m/s", speed=speed / 1000))
    cause = "; ".join(causes) or tr("a unit is wrong")
    if is_possible:
        return tr("the targets move at {speed:.3g} m/s (median), as none so near does: {cause}; or columns are swapped",
                  speed=speed, cause=cause)  # fmt: skip
    return tr("the targets move at {speed:.3g} m/s (median), which none does: {cause}", speed=speed, cause=cause)
