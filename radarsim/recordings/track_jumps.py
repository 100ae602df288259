"""Tracks whose positions jump once and for all, or alternate between two places, as those of no single target do.

A unit or a zero that changes within a recording makes the one, two sensors under one name the other. Single wild rows
are neither: the rows before and after a jump must say it in the median. A jump is larger than any target moves, or it
changes the range by the factor of a unit, or the track goes on after it as before, as no manoeuvre between two plots
lets it; all are judged by the scatter of the same track."""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from radarsim.language.translate import tr
from radarsim.recordings.formats.clock_steps import SetBack
from radarsim.recordings.formats.forward_steps import find_set_forward
from radarsim.recordings.grouping import rows_by_name
from radarsim.recordings.target_speed import MAX_JUMP_MPS, MIN_JUMP_LEGS, MIN_ROWS, POSITION_COLUMNS, TrackPositions

USE_PATTERN = re.compile(r" \(\d+\)$")  # behind a track number that is used again
MAX_JUMP_MPS2 = 100.0  # of a target that moves on as before: 10 g
MIN_LASTING_SCATTER = 10.0  # median changes from leg to leg of a track
MAX_JUMP_STEPS = 5.0  # median steps of a track: after a longer gap its number may be another target's
MAX_JUMP_SHARE = 0.05  # of rows; where more jump, other checks say why
SIDE_ROWS, MIN_SIDE_ROWS = 12, 6  # before and after a jump
MIN_SIDE_SHARE, MAX_SIDE_WIDTH = 0.75, 0.25  # of the rows on a side, which are so near to each other; of the jump
MIN_LASTING_SHARE = 0.5  # of a jump, by which the rows after it differ from those before
MAX_TURN_SHARE = 0.2  # of the way on both sides, by which a turn may bend it
UNIT_FACTORS = np.log([1000.0, 1852.0, 1.852, 1 / 0.3048, 1000 / 0.3048, 1852 / 0.3048, 1000 / 0.9144])
UNIT_TOLERANCE = 0.02  # of the ratio of the ranges before and after a jump
MAX_SHIFT_MPS2 = MAX_JUMP_MPS2  # of a target that turns aside and back
MIN_SHIFT_M, MIN_SHIFT_SCATTER = 500.0, 8.0  # of a shift; in median distances from straight courses beside it: over 5 σ
MAX_COURSE_SCATTER, MAX_COURSE_SHARE = 5.0, 0.05  # of rows that lie on such a course, in the same; of the shift
MANOEUVRE_ROWS, MIN_MANOEUVRE_ROWS = 6, 2  # beside a shift that may belong to a manoeuvre; of these that show one
SPEED_SIGMAS = 3.0  # by which the speed of a target may be underestimated
MIN_OFFSET_SCATTER = 3.0  # of the step at a shift from those beside it, in its median over the track
MAX_SHIFT_CHANGE = 0.5  # of the shift, by which a change of the velocity may move the rows beside it
MAX_SHIFTS = 3  # of a track: cells of a coarse measurement change oftener
MIN_ALTERNATING_ROWS, MIN_ALTERNATING_SHARE = 20, 0.9  # of a track
MAX_ALTERNATING_RATIO = 0.5  # of the distances from the last row but one and from the last
MIN_ALTERNATING_SIGMAS = 8.0  # of the distance of two courses, if each row lies on the other than the one before


class Jump(NamedTuple):
    """A jump of a track: the time of the row after it, s, and its ranges before and after, m."""

    track: str
    t_s: float
    before_m: float
    after_m: float


class Alternation(NamedTuple):
    """A track that alternates between two places, and their distance, m."""

    track: str
    distance_m: float


class CourseFault(NamedTuple):
    """What no course of a single target explains: jumps, an alternation, or a clock that was set forward."""

    jumps: tuple[Jump, ...] = ()
    alternation: Alternation | None = None
    forward_step: SetBack | None = None

    def message(self) -> str:
        """What is wrong, and what would explain it."""
        if self.alternation is not None:
            track = self.alternation.track and tr(" of track {name}", name=self.alternation.track)
            return tr("the rows{track} alternate between two places, {distance:.0f} m apart (median): two sensors or "
                      "targets have one name", track=track, distance=self.alternation.distance_m)  # fmt: skip
        if self.forward_step is not None:
            return tr("the clock was set forward by {size:.6g} s at {time:g} s, as the targets go on from where they "
                      "were: radarsim import undoes it",
                      size=-self.forward_step.size_s, time=self.forward_step.until_s)  # fmt: skip
        name, time_s, before, after = self.jumps[0]
        track = name and tr(" in track {name}", name=name)
        return tr("positions jump as no target does (rows: {count}), first{track} from {before:.0f} to {after:.0f} m "
                  "of range at {time:g} s: a unit, a zero or the target changes there",
                  count=len(self.jumps), track=track, before=before, after=after, time=time_s)  # fmt: skip


def find_jumps(name: str, track: TrackPositions) -> list[Jump]:
    """The jumps of a track that last; none where its times do not rise."""
    if len(track.t_s) < MIN_ROWS or not (np.diff(track.t_s) > 0).all():
        return []
    leaps = _leaps(track)
    shifts = [i for i in _shifts(track) if all(abs(i - leap) >= SIDE_ROWS for leap in leaps)]
    return [
        Jump(name, float(track.t_s[i + 1]), *np.linalg.norm(track.positions[i : i + 2], axis=1).tolist())
        for i in sorted(leaps + shifts)
    ]


def _leaps(track: TrackPositions) -> list[int]:
    """The rows before jumps that are larger than any target moves, or by the factor of a unit."""
    t, positions = track
    steps = np.diff(t)
    legs = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    speed_mps = float(np.median(legs / steps))
    scatter = MIN_LASTING_SCATTER * float(np.median(np.abs(np.diff(legs))))
    is_large = (legs > scatter) & (legs > MIN_JUMP_LEGS * speed_mps * steps)
    rows = np.flatnonzero(
        is_large & (legs > MIN_JUMP_LEGS * np.median(legs)) & (steps < MAX_JUMP_STEPS * np.median(steps))
    )
    return [
        i
        for i in rows.tolist()
        if _is_impossible(positions, i, float(legs[i]), float(steps[i])) and _lasts(track, i, float(legs[i]), speed_mps)
    ]


def _shifts(track: TrackPositions) -> list[int]:
    """The rows before jumps after which the track goes on as before: a target that turns aside and back between two
    plots moves less. A step is compared with the mean of those beside it, which a steady turn does not change."""
    t, positions = track
    if len(t) < 2 * MIN_SIDE_ROWS:
        return []
    steps, ways = np.diff(t), np.diff(positions, axis=0)
    velocities = ways / steps[:, None]
    expected = 0.5 * steps[1:-1, None] * (velocities[:-2] + velocities[2:])
    offsets = np.pad(np.linalg.norm(ways[1:-1] - expected, axis=1), 1)
    least = _manoeuvre_m(steps, float(np.median(np.linalg.norm(velocities, axis=1))))
    is_far = (offsets > MIN_OFFSET_SCATTER * np.median(offsets)) & (offsets > least)
    is_far[1:-1] &= (offsets[1:-1] >= offsets[:-2]) & (offsets[1:-1] >= offsets[2:])
    rows = np.flatnonzero(is_far & (steps < MAX_JUMP_STEPS * np.median(steps))).tolist()
    shifts = [i for i in rows if _is_shift(track, i)]
    return shifts if len(shifts) <= MAX_SHIFTS else []


def _manoeuvre_m(duration_s: np.ndarray | float, speed_mps: float) -> np.ndarray:
    """How far a target of a speed gets from its course, m, that turns aside and back within such times (n,);
    MIN_SHIFT_M if less."""
    times = np.asarray(duration_s)
    return np.maximum(MIN_SHIFT_M, np.minimum(0.25 * MAX_SHIFT_MPS2 * times**2, 2 * speed_mps * times))


def _largest_speed(t: np.ndarray, positions: np.ndarray) -> float:
    """How fast a target may be that flies straight along positions (n, d), m/s: of ranges alone, their second
    derivative shows its speed across the line of sight."""
    powers = (t - t.mean())[:, None] ** np.arange(3)
    coefficients = np.linalg.lstsq(powers, positions, rcond=None)[0]
    residuals = positions - powers @ coefficients
    variances = np.diag(np.linalg.inv(powers.T @ powers)) * float(np.square(residuals).sum()) / residuals.size
    sigmas = SPEED_SIGMAS * np.sqrt(variances * len(t) / (len(t) - 3))
    speed = float(np.linalg.norm(coefficients[1]) + sigmas[1])
    if positions.shape[1] > 1:
        return speed
    acceleration = max(0.0, 2 * float(coefficients[2, 0] + sigmas[2]))
    return float(np.sqrt(speed**2 + abs(coefficients[0, 0]) * acceleration))


def _is_shift(track: TrackPositions, i: int) -> bool:
    """Whether the rows after i follow a straight course beside that of the rows up to i, farther than a target gets
    from the last row on the one course to the first on the other."""
    middle_s = float(track.t_s[i : i + 2].mean())
    places, velocities, distances, speed = [], [], [], 0.0
    for first, last in ((max(0, i + 1 - SIDE_ROWS), i + 1), (i + 1, i + 1 + SIDE_ROWS)):
        t, positions = (values[first:last] for values in track)
        if len(t) < MIN_SIDE_ROWS:
            return False
        speed = max(speed, _largest_speed(t, positions))
        before, after = np.triu_indices(len(t), k=1)
        slopes = (positions[after] - positions[before]) / (t[after] - t[before])[:, None]
        velocities.append(np.median(slopes, axis=0))
        continued = positions - velocities[-1] * (t - middle_s)[:, None]
        places.append(np.median(continued, axis=0))
        distances.append(np.linalg.norm(continued - places[-1], axis=1))
    shift = float(np.linalg.norm(places[1] - places[0]))
    beside_s = float(np.ptp(track.t_s[i - MIN_SIDE_ROWS // 2 + 1 : i + MIN_SIDE_ROWS // 2 + 1]))
    change = float(np.linalg.norm(velocities[1] - velocities[0])) * beside_s
    scatter = float(np.median(np.concatenate(distances)))
    is_straight = all((side < MAX_SIDE_WIDTH * shift).mean() >= MIN_SIDE_SHARE for side in distances)
    if not is_straight or shift < MIN_SHIFT_SCATTER * scatter or change > MAX_SHIFT_CHANGE * shift:
        return False
    largest = max(MAX_COURSE_SCATTER * scatter, MAX_COURSE_SHARE * shift)
    last, first = (_first_on_course(side <= largest) for side in (distances[0][::-1], distances[1]))
    return shift > float(_manoeuvre_m(float(track.t_s[i + 1 + first] - track.t_s[i - last]), speed))


def _first_on_course(is_on_course: np.ndarray) -> int:
    """The index (of n) of the row that ends a manoeuvre, from a shift on: the second on the course after rows beside
    it; a single one of these makes none, unless it is the first."""
    aside = np.flatnonzero(~is_on_course[:MANOEUVRE_ROWS])
    is_manoeuvre = aside.size >= MIN_MANOEUVRE_ROWS or not is_on_course[0]
    return min(int(aside[-1]) + 2, is_on_course.size - 1) if is_manoeuvre else 0


def _lasts(track: TrackPositions, i: int, leg: float, speed_mps: float) -> bool:
    """Whether most rows from i + 1 on, and most before, lie as far from each other as the jump, but for their way: each
    side is continued to the jump with its median velocity."""
    places, way_m = [], 0.0
    for first, last in ((max(0, i + 1 - SIDE_ROWS), i + 1), (i + 1, i + 1 + SIDE_ROWS)):
        t, positions = (values[first:last] for values in track)
        if len(t) < MIN_SIDE_ROWS:
            return False
        velocity = np.median(np.diff(positions, axis=0) / np.diff(t)[:, None], axis=0)
        continued = positions - velocity * (t - track.t_s[i])[:, None]
        places.append(np.median(continued, axis=0))
        way_m += speed_mps * float(t[-1] - t[0])
        if (np.linalg.norm(continued - places[-1], axis=1) < MAX_SIDE_WIDTH * leg).mean() < MIN_SIDE_SHARE:
            return False
    return float(np.linalg.norm(places[1] - places[0])) > MIN_LASTING_SHARE * leg + MAX_TURN_SHARE * way_m


def _is_impossible(positions: np.ndarray, i: int, leg: float, step: float) -> bool:
    """Whether no target jumps so, or the ranges before and after differ by the factor of a unit."""
    if leg > min(MAX_JUMP_MPS * step, MAX_JUMP_MPS2 * step**2):
        return True
    before, after = np.linalg.norm(positions[i : i + 2], axis=1)
    with np.errstate(divide="ignore"):
        return bool((np.abs(np.abs(np.log(after / before)) - UNIT_FACTORS) < UNIT_TOLERANCE).any())


def jumps_fault(jumps: Sequence[Jump], rows: int) -> CourseFault | None:
    """The fault of jumps among rows; None without any, or with so many that something else explains them."""
    return CourseFault(tuple(jumps)) if 0 < len(jumps) <= MAX_JUMP_SHARE * rows else None


def find_alternation(name: str, track: TrackPositions) -> Alternation | None:
    """Whether the rows of a track, whose times rise, alternate between two places or two courses: almost each is nearer
    to the last but one than to the one before it, or lies on the same side of the line between those beside it as
    every other. Errors do not make it so, nor motion."""
    t, positions = track
    if len(t) < MIN_ALTERNATING_ROWS:
        return None
    single, double = (np.linalg.norm(positions[2:] - positions[2 - lag : -lag], axis=1) for lag in (1, 2))
    if (double < MAX_ALTERNATING_RATIO * single).mean() >= MIN_ALTERNATING_SHARE:
        return Alternation(name, float(np.median(single)))
    share = ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))[:, None]
    aside = positions[1:-1] - (1 - share) * positions[:-2] - share * positions[2:]
    sides = aside * np.where(np.arange(len(aside)) % 2, -1.0, 1.0)[:, None]
    distance = np.median(sides, axis=0)
    sigma = np.median(np.abs(sides - distance), axis=0) / 0.6745
    is_far = np.abs(distance) > MIN_ALTERNATING_SIGMAS * sigma / np.sqrt(len(sides) / 6)  # neighbours share rows
    is_same_side = (sides * np.sign(distance) > 0).mean(axis=0) >= MIN_ALTERNATING_SHARE
    if not (is_far & is_same_side).any():
        return None
    return Alternation(name, float(np.linalg.norm(distance)))


def recording_jumps(names: Sequence[str], t_s: np.ndarray, positions: np.ndarray) -> list[Jump]:
    """The jumps of all tracks of a recording, positions (n, d), by the names of its rows; times from the first."""
    return [
        jump._replace(t_s=jump.t_s - float(t_s.min()))
        for name, rows in rows_by_name(names).items()
        if name
        for jump in find_jumps(name, TrackPositions(t_s[rows], positions[rows]))
    ]


def column_positions(columns: Mapping[str, np.ndarray]) -> TrackPositions | None:
    """Times and positions of the rows of a track, by its columns (n,) of plots: x_m, y_m, z_m, or range_m, with
    bearing_rad where that is measured; None without these. Rows without a position are left out."""
    names = next((names for names in POSITION_COLUMNS if set(names) <= set(columns)), None)
    if names is None:
        return None
    positions = np.stack([columns[name] for name in names], axis=1)
    if "range_m" in names and np.isfinite(bearing := columns.get("bearing_rad", np.nan)).all():
        positions = positions * np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
    is_known = np.isfinite(positions).all(axis=1)
    return TrackPositions(columns["t_s"][is_known], positions[is_known])


def column_fault(tracks: Mapping[str, Sequence[Mapping[str, np.ndarray]]]) -> CourseFault | None:
    """The fault of tracks, by their names, with columns (n,) of plots in one or several stretches."""
    jumps, rows = [], 0
    for name, stretches in tracks.items():
        for columns in stretches:
            if (track := column_positions(columns)) is None:
                return None
            if (np.diff(track.t_s) > 0).all() and (alternation := find_alternation(name, track)):
                return CourseFault(alternation=alternation)
            jumps += find_jumps(name, track)
            rows += len(track.t_s)
    return jumps_fault(jumps, rows) or _forward_fault(tracks)


def _forward_fault(tracks: Mapping[str, Sequence[Mapping[str, np.ndarray]]]) -> CourseFault | None:
    """The fault of a clock that was set forward, which may have given a track another name."""
    parts: dict[str, list[TrackPositions]] = {}
    for name, stretches in tracks.items():
        for columns in stretches:
            if (track := column_positions(columns)) is not None:
                parts.setdefault(USE_PATTERN.sub("", name), []).append(track)
    tables = [part for track in parts.values() for part in track]
    if not tables or len({part.positions.shape[1] for part in tables}) > 1:
        return None
    t, positions = (np.concatenate(values) for values in zip(*tables, strict=True))
    ends = np.cumsum([sum(len(part.t_s) for part in track) for track in parts.values()])
    rows = np.split(np.arange(len(t)), ends[:-1])
    step = find_set_forward(t, positions, rows)
    return None if step is None else CourseFault(forward_step=step)
