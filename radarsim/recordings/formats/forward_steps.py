"""Recognise a clock that was set forward within a recording, by the places of the targets.

The times then have a gap in which nothing is seen, and after it the targets go on from where they were, as if a scan or
a few had passed. Rows on both sides of the gap lie on one parabola if those before it are so much later, and not as
they are. A target that may have come back to its place, since it turns or passes that place again, tells nothing; a
target that stands neither."""

import re
from typing import NamedTuple

import numpy as np

from radarsim.recordings.formats.clock_steps import SetBack, are_whole_scans
from radarsim.recordings.formats.records import Batch
from radarsim.recordings.grouping import rows_by_name
from radarsim.recordings.time_spans import HOUR_S

REUSE_PATTERN = re.compile(r"-\d+$")  # behind a number or a code that a radar uses again
MAX_GAPS, MAX_TRACKS = 8, 40  # that are examined, the longest; of one of them
USUAL_GAP_RANK, MIN_GAP_RATIO = 12, 1.4  # the gap between rows to which one that is examined is compared
MIN_GAP_SCANS = 0.5  # of a gap between the rows of all tracks
MAX_MISSED_SCANS = 5.5  # while the clock was set forward, and between the rows beside the gap
SIDE_ROWS = (12, 6)  # fitted on each side; fewer where the course bends
MIN_SIDE_ROWS, MIN_FITTED_ROWS = 3, 8  # on each side, and together
MIN_GAIN = 20.0  # of twice the log-likelihood, with the step over without
MAX_F_RATIO = 6.0  # of one parabola, over one for each side
MAX_LEG_SHARE = 0.02  # of the way in a scan, by which rows may miss the parabola though errors are smaller
MIN_RESOLUTION, RESOLUTION_M = 1e-6, 1e-3  # below which misfits are rounding: of the distances between rows; m
TURN_ROWS = 40  # on each side, that show a turn
MAX_HALF_TURN = np.pi  # rad in the time of the gap: a target that turns farther may have come back
MAX_STRAIGHT_MPS = 700.0  # of a target whose range alone is known
MIN_BEND_RATIO = 10.0  # F of the higher coefficients of a course that bends
WINDING_DEGREE, MIN_WINDING_SHARE = 5, 0.25  # of a course that is no parabola; of its time, within which it is none
MIN_WINDING_RATIO, SECOND_DIFFERENCE_POWER = 3.0, 6.0  # of squares to those of errors, by their second differences
BEND_SHARE = 0.02  # of a bend by which a target turns back within the gap, which is π / 8 of the way and times
MAX_REVISIT_LEGS = 1.5  # from the place of the gap, at which the target is seen at other times
MIN_SUPPORT_RATIO = 4  # of the tracks that show a step to those that show none
MAX_SMALL_STEP_S = 60.0  # of a step after which a few scans may be missed; after others, but of time zones, one passes
ZONE_STEP_S = HOUR_S / 2  # by which time zones differ
SNAP_GAIN = 6.0  # of twice the log-likelihood, by which a less usual step may be likelier
MAX_WHOLE_SECONDS = 200  # steps that are examined where scans are not regular
MIN_REGULAR_SHARE = 0.9  # of the steps that are whole scans


class _Join(NamedTuple):
    """The rows of a track before and after a gap, and all rows of it; each in the order of time."""

    before: np.ndarray
    after: np.ndarray
    all_rows: np.ndarray


class _Fit(NamedTuple):
    """A parabola through the rows of a join: what they miss it by (n, d), m, and the sum of squares, m²; velocity and
    acceleration in the middle (d,)."""

    residuals: np.ndarray
    misfit: float
    velocity: np.ndarray
    acceleration: np.ndarray


class GapWatch:
    """Whether the clock may have been set forward in the rows of tracks, batch by batch, each with the one before."""

    def __init__(self) -> None:
        self.names: list[str] = []
        self.t, self.positions = np.empty(0), np.empty((0, 1))
        self.has_gap = False  # in the batch before

    def has_step(self, batch: Batch, positions: np.ndarray) -> bool:
        """Whether the next rows, at positions (n, d), or those of the batch before, show a step of the clock."""
        names, t = names_over_gaps(batch), batch.columns["t_s"]
        before = (self.names, self.t, self.positions.reshape(-1, positions.shape[1]))
        had_gap, self.has_gap = self.has_gap, bool(rare_gaps(np.sort(np.append(t, self.t[-1:]))))
        self.names, self.t, self.positions = names, t, positions
        if not had_gap and not self.has_gap:
            return False
        tracks = [rows for name, rows in rows_by_name(before[0] + names).items() if name]
        joined = [np.concatenate(parts) for parts in zip(before[1:], (t, positions), strict=True)]
        return bool(tracks) and find_set_forward(joined[0], joined[1], tracks) is not None


def names_over_gaps(batch: Batch) -> list[str]:
    """The track of each row of a batch: of a radar's numbers that were used again the first, as a gap makes these."""
    if not any(batch.radar):
        return batch.track
    names = {name: REUSE_PATTERN.sub("", name) for name in set(batch.track)}
    return [names[name] for name in batch.track]


def join_names(batch: Batch, last_s: float) -> None:
    """Give the numbers that seem to be used again after a gap that is none the names before it, in place."""
    t, rows = batch.columns["t_s"], rows_by_name(batch.track)
    for name, later_rows in rows.items():
        number = REUSE_PATTERN.search(name)
        count = int(number[0][1:]) if number else 0
        earlier = REUSE_PATTERN.sub("", name) + (f"-{count - 1}" if count > 2 else "")
        if number and earlier in rows and t[rows[earlier]].max() <= last_s < t[later_rows].min():
            for row in later_rows:
                batch.track[row] = earlier


def find_set_forward(t: np.ndarray, positions: np.ndarray, tracks: list[np.ndarray]) -> SetBack | None:
    """The longest gap in times (n,) that is a step of the clock, with a negative size, by the positions (n, d) of rows;
    tracks: the rows of each."""
    ordered = [rows[np.argsort(t[rows], kind="stable")] for rows in tracks]
    steps = [np.diff(t[rows]) for rows in ordered]
    scan_s = float(np.median(np.concatenate([np.empty(0), *steps]))) if any(map(len, steps)) else 0.0
    if not scan_s > 0:
        return None
    for last_s, next_s in rare_gaps(np.sort(t[np.concatenate(ordered)]), MIN_GAP_SCANS * scan_s):
        joins = [join for rows in ordered if (join := _join(t, rows, last_s, next_s, scan_s)) is not None]
        if joins and (size_s := _step(t, positions, joins[:MAX_TRACKS])) is not None:
            return SetBack(-size_s, np.flatnonzero(t <= last_s), last_s)
    return None


def rare_gaps(times: np.ndarray, min_gap_s: float = 0.0) -> list[tuple[float, float]]:
    """The longest gaps between sorted times (n,), if they are rare: the times before and after each."""
    gaps = np.diff(times)
    if len(gaps) < MIN_FITTED_ROWS - 1:
        return []
    rank = max(len(gaps) - USUAL_GAP_RANK, 0)
    shortest = max(MIN_GAP_RATIO * float(np.partition(gaps, rank)[rank]), min_gap_s)
    rows = np.flatnonzero(gaps > shortest)
    longest = rows[np.argsort(-gaps[rows], kind="stable")][:MAX_GAPS]
    return [(float(times[i]), float(times[i + 1])) for i in longest]


def _join(t: np.ndarray, rows: np.ndarray, last_s: float, next_s: float, scan_s: float) -> _Join | None:
    """The rows of a track beside a gap, as far as they follow each other; None of a track that is not seen there."""
    times = t[rows]
    end, longest = int(np.searchsorted(times, last_s, side="right")), MAX_MISSED_SCANS * scan_s
    if not 0 < end < len(rows) or last_s - times[end - 1] > longest or times[end] - next_s > longest:
        return None
    breaks = np.flatnonzero(np.diff(times) > longest) + 1
    first = max([0, *breaks[breaks < end].tolist()])
    last = min(breaks[breaks > end].tolist(), default=len(rows))
    before, after = rows[first:end], rows[end:last]
    if min(len(before), len(after)) < MIN_SIDE_ROWS or len(before) + len(after) < MIN_FITTED_ROWS:
        return None
    return _Join(before, after, rows)


def _step(t: np.ndarray, positions: np.ndarray, joins: list[_Join]) -> float | None:
    """The step of the clock, s, that puts the rows on both sides of a gap on one course; None if none does."""
    gap_s = float(np.median([t[join.after[0]] - t[join.before[-1]] for join in joins]))
    sides = [np.diff(t[side]) for join in joins for side in (join.before[-max(SIDE_ROWS) :], join.after)]
    size_s = _likeliest_size(t, positions, joins, gap_s, np.concatenate(sides))
    if size_s is None:
        return None
    verdicts = [_verdict(t, positions, join, size_s) for join in joins]
    return size_s if 0 < verdicts.count(1) >= MIN_SUPPORT_RATIO * verdicts.count(-1) else None


def _likeliest_size(
    t: np.ndarray, positions: np.ndarray, joins: list[_Join], gap_s: float, steps_s: np.ndarray
) -> float | None:
    """The likeliest step of the clock, s, for a gap and the steps between rows beside it: one of time zones, or that
    which leaves one scan, if it is nearly as likely as others."""
    scan_s = float(np.median(steps_s))
    smallest, largest = max(gap_s - MAX_MISSED_SCANS * scan_s, 0.5 * scan_s), gap_s - 0.25 * scan_s
    zones = ZONE_STEP_S * np.arange(np.ceil(smallest / ZONE_STEP_S), np.floor(largest / ZONE_STEP_S) + 1)
    if are_whole_scans(steps_s, scan_s).mean() >= MIN_REGULAR_SHARE:
        others = gap_s - scan_s * np.arange(1, int(MAX_MISSED_SCANS) + 1)
    else:
        others = np.arange(np.ceil(smallest), np.floor(largest) + 1)[::-1][:MAX_WHOLE_SECONDS]
        others = others[np.argsort(np.abs(gap_s - others - scan_s), kind="stable")]
    is_small = (others < MAX_SMALL_STEP_S) | (np.abs(gap_s - others - scan_s) < 0.5 * scan_s)
    sizes = np.concatenate([zones[zones > 0], others[(others >= smallest) & is_small]])
    if not sizes.size:
        return None
    misfits = np.array([sum(_log_misfit(t, positions, join, size) for join in joins) for size in sizes.tolist()])
    return float(sizes[int(np.argmax(misfits < misfits.min() + SNAP_GAIN))])


def _log_misfit(t: np.ndarray, positions: np.ndarray, join: _Join, size_s: float) -> float:
    """The sum of squares of a join with a step of the clock, as a log-likelihood of it, negative and twice."""
    rows = np.concatenate([join.before[-min(SIDE_ROWS) :], join.after[: min(SIDE_ROWS)]])
    fit = _parabola(_stepped_times(t, join, rows, size_s), positions[rows])
    return len(rows) * float(np.log(fit.misfit + _resolution(positions[rows])))


def _verdict(t: np.ndarray, positions: np.ndarray, join: _Join, size_s: float) -> int:
    """1 if the rows of a join show a step of the clock, -1 if they show none, 0 if they tell nothing."""
    verdict = 0
    for side_rows in SIDE_ROWS:
        before, after = join.before[-side_rows:], join.after[:side_rows]
        before, after = (side[np.isfinite(positions[side]).all(axis=1)] for side in (before, after))
        rows = np.concatenate([before, after])
        if min(len(before), len(after)) < MIN_SIDE_ROWS or len(rows) < MIN_FITTED_ROWS:
            continue
        places, least = positions[rows], _resolution(positions[rows])
        recorded, stepped = (_parabola(_stepped_times(t, join, rows, s), places) for s in (0.0, size_s))
        gain = len(rows) * float(np.log((recorded.misfit + least) / (stepped.misfit + least)))
        if gain < -MIN_GAIN:
            verdict = -1
        elif gain > MIN_GAIN and _is_one_course(t, positions, join, (before, after), size_s, stepped):
            return 1
    return verdict


def _is_one_course(
    t: np.ndarray, positions: np.ndarray, join: _Join, sides: tuple[np.ndarray, np.ndarray], size_s: float, fit: _Fit
) -> bool:
    """Whether the rows on both sides lie on the parabola of a step as well as on one each, and the target cannot have
    come back within the gap."""
    rows = np.concatenate(sides)
    places, dimensions = positions[rows], positions.shape[1]
    times = _stepped_times(t, join, rows, size_s)
    single = [_parabola(t[side], positions[side], degree=2 if len(side) > 5 else 1) for side in sides]
    parameters = sum(3 if len(side) > 5 else 2 for side in sides)
    misfit = sum(side.misfit for side in single) + _resolution(places)
    freedom = dimensions * (len(rows) - parameters)
    leg_m = float(np.linalg.norm(fit.velocity)) * float(np.median(np.diff(times)))
    ratio = (fit.misfit - misfit) / (dimensions * (parameters - 3)) / (misfit / freedom)
    if ratio > MAX_F_RATIO and np.sqrt(fit.misfit / len(rows)) > MAX_LEG_SHARE * leg_m:
        return False
    return not (_may_turn_back(t, positions, join, size_s) or _is_revisited(positions, join, rows, fit.velocity, leg_m))


def _may_turn_back(t: np.ndarray, positions: np.ndarray, join: _Join, size_s: float) -> bool:
    """Whether a target turns so fast that it may have come back in the time of a gap. The square of the range alone is
    a parabola where the course is straight."""
    rows = np.concatenate([join.before[-TURN_ROWS:], join.after[:TURN_ROWS]])
    rows = rows[np.isfinite(positions[rows]).all(axis=1)]
    times, places = _stepped_times(t, join, rows, size_s), positions[rows]
    is_range = places.shape[1] == 1
    line, parabola, curve = (_parabola(times, places**2 if is_range else places, n) for n in (1, 2, WINDING_DEGREE))
    course = _parabola(times, places)
    speed = float(np.linalg.norm(course.velocity)) or float(np.finfo(float).tiny)
    span_s = float(np.ptp(times))
    least = (
        len(rows) * (BEND_SHARE * speed * span_s**2 / size_s * (2 * np.abs(places).mean() if is_range else 1.0)) ** 2
    )
    errors = float(np.square(np.diff(parabola.residuals, n=2, axis=0)).sum()) / SECOND_DIFFERENCE_POWER
    if (
        parabola.misfit > MIN_WINDING_RATIO * (errors + least)
        or _f_ratio(parabola, curve, places.shape, (2, WINDING_DEGREE), least) > MIN_BEND_RATIO
    ):
        return size_s > MIN_WINDING_SHARE * span_s
    if _f_ratio(line, parabola, places.shape, (1, 2), least) < MIN_BEND_RATIO:
        return False
    if is_range and 0 <= float(parabola.acceleration[0]) < 2 * MAX_STRAIGHT_MPS**2:
        return False
    along = course.velocity / speed
    aside = course.acceleration if is_range else course.acceleration - (course.acceleration @ along) * along
    return float(np.linalg.norm(aside)) / speed * size_s > MAX_HALF_TURN


def _f_ratio(low: _Fit, high: _Fit, shape: tuple[int, ...], degrees: tuple[int, int], least: float) -> float:
    """F of the further coefficients of a polynomial of a higher degree through places of that shape; least: the sum of
    squares of bends that do not matter, m²."""
    rows, dimensions = shape
    freedom = dimensions * max(rows - degrees[1] - 1, 1)
    gain = (low.misfit - high.misfit) / (dimensions * (degrees[1] - degrees[0]))
    return gain * freedom / (high.misfit + least)


def _is_revisited(positions: np.ndarray, join: _Join, rows: np.ndarray, velocity: np.ndarray, leg_m: float) -> bool:
    """Whether a track passes the place of a gap at another time too, in the same direction."""
    place = 0.5 * (positions[join.before[-1]] + positions[join.after[0]])
    track = positions[join.all_rows]
    is_near = np.linalg.norm(track[:-1] - place, axis=1) < MAX_REVISIT_LEGS * leg_m
    is_other = ~np.isin(join.all_rows, rows)
    return bool((is_near & is_other[:-1] & is_other[1:] & (np.diff(track, axis=0) @ velocity > 0)).any())


def _stepped_times(t: np.ndarray, join: _Join, rows: np.ndarray, size_s: float) -> np.ndarray:
    """The times of rows (m,), those before the gap as much later as the clock was set."""
    return t[rows] + np.where(t[rows] <= t[join.before[-1]], size_s, 0.0)


def _parabola(t: np.ndarray, places: np.ndarray, degree: int = 2) -> _Fit:
    """A parabola, or a polynomial of another degree, through places (n, d) at times (n,)."""
    middle, span = float(t.mean()), float(np.ptp(t)) or 1.0
    powers = ((t - middle) / span)[:, None] ** np.arange(degree + 1)
    coefficients = np.linalg.lstsq(powers, places, rcond=None)[0]
    acceleration = 2 * coefficients[2] / span**2 if degree > 1 else np.zeros(places.shape[1])
    residuals = places - powers @ coefficients
    return _Fit(residuals, float(np.square(residuals).sum()), coefficients[1] / span, acceleration)


def _resolution(places: np.ndarray) -> float:
    """The square of a distance, m², below which misfits of places (n, d) are rounding."""
    return max(RESOLUTION_M, MIN_RESOLUTION * float(np.ptp(places, axis=0).max())) ** 2
