"""Radial velocities that are a multiple of the change of the range: of another unit, or of the other sign.

Along a track the range is the integral of the velocity, however the target flies. Where the velocity is k times the
change of the range, the slope of the range on the integral is 1 / k: it is fitted by least absolute deviations, with a
constant for each stretch. A wrong unit of the velocities, of the ranges or of the times, and a wrong sign, each leave a
multiple of their own. Velocities that are folded may look like a multiple below 1/3: a speed V by a span D becomes
V - D = k V, with a size of at most D / 2. There the multiple is certain only if it holds without what grows with time
alone, as the spans do."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from radarsim.language.translate import term, tr
from radarsim.report.wording import significant_digits

COLUMNS = ("t_s", "range_m", "velocity_mps")
MAX_GAP_S, MAX_GAP_STEPS = 60.0, 5.0  # of a stretch over which velocities are integrated; in its median steps
MIN_STRETCH_ROWS, MIN_ROWS, MAX_ROWS = 5, 20, 10_000  # of a stretch, and of all
MIN_COURSE = 5.0  # median deviations of the ranges that the fitted course must span, by its median
ROUNDS = 40  # of reweighting, for least absolute deviations
ERROR_SIGMAS = 4.0  # of the multiple
MAX_ERROR = 0.2  # of the multiple, relative
MAX_PLAUSIBLE_MULTIPLE = 1.5  # or one over it: nearer to 1 no unit is
UNIT_TOLERANCE = 0.01  # of a multiple, relative: of units, and of a line of sight that is not that of the range
MIN_FOREIGN_SHARE, MIN_FOREIGN_MPS = 0.5, 3.0  # by which velocities of another column miss the ranges
FOREIGN_VELOCITY_SIGMAS, FOREIGN_RANGE_SIGMAS = 10.0, 3.0  # of noise that such a miss exceeds, in the median
MIN_WILD_MISSES, MAX_WILD_SHARE = 10.0, 0.2  # of an interval, in median misses; of the intervals of a track
FOREIGN_CAUSE = term("they are no radial velocities: a column may be swapped")
LOST_SIGN_CAUSE = term("their sign is lost; take it from the source, or leave the column out")
RATE_ROWS, MIN_SIGN_ROWS = 3, 10  # beside a row, over which its range changes; of each sign of that change
MAX_SIGN_MISS = 0.25  # of the speeds, by which the size of the change of the range misses them
MIN_FOLDABLE, MAX_FOLDABLE = -1.05, 1 / 3  # multiples that folds may leave
MAX_DRIFT_CHANGE = 0.2  # of such a multiple, relative, where a drift is allowed for
MIN_WAVELENGTH_M, MAX_WAVELENGTH_M = 0.003, 0.5  # of radars whose Doppler frequencies may stand for speeds
FOOT_M, KNOT_MPS, KMH_MPS, MPH_MPS = 0.3048, 1852 / 3600, 1 / 3.6, 1609.344 / 3600
CAUSES = {  # multiples, and what leaves them
    1 / KNOT_MPS: term("they are in knots (--column velocity_kn=NAME)"),
    1 / KMH_MPS: term("they are in km/h (--column velocity_kmh=NAME)"),
    1 / FOOT_M: term("they are in feet per second (--column velocity_fps=NAME)"),
    1 / MPH_MPS: term("they are in miles per hour (--column velocity_mph=NAME)"),
    KNOT_MPS: term("they are in m/s, not in knots"),
    KMH_MPS: term("they are in m/s, not in km/h"),
    FOOT_M: term("the ranges are in feet, not in m"),
    1.852: term("the ranges are in nautical miles, not in km"),
    1852.0: term("the ranges are in nautical miles, not in m"),
    1 / 1.852: term("the ranges are in km, not in nautical miles"),
    3000 * FOOT_M: term("the ranges are in kiloyards, not in m"),
    6000 * FOOT_M: term("the ranges are in data miles, not in m"),
    100 * FOOT_M: term("the ranges are in hundreds of feet, not in m"),
    60 / FOOT_M: term("they are in feet per minute (--column velocity_fpm=NAME)"),
    128.0: term("the times are in 128ths of a second"),
    10.0: term("they are in dm/s, or the times in tenths of a second"),
    100.0: term("they are in cm/s, or the times in hundredths of a second"),
    1e3: term("the times are in a unit a thousand times smaller, or the ranges in km"),
    1e6: term("the times are in µs"),
    1e9: term("the times are in ns"),
    1e-3: term("the times are in a unit a thousand times larger, or the ranges in m, not in km"),
    60.0: term("the times are minutes and seconds, read as hours and minutes (--column t_mmss=NAME)"),
    1 / 60: term("the times are in minutes (--column t_min=NAME)"),
    1 / 3600: term("the times are in hours (--column t_h=NAME)"),
    1 / 86400: term("the times are in days (--column t_days=NAME)"),
}


@dataclass(frozen=True)
class DopplerScale:
    """Velocities as a multiple of the change of the range; is_sign: whether only the sign is wrong; causes: those of
    CAUSES that leave such a multiple; is_certain: whether folds cannot leave it."""

    multiple: float
    is_sign: bool
    causes: tuple[str, ...]
    is_certain: bool = True

    @property
    def is_foldable(self) -> bool:
        """Whether folds of a constant speed may leave such a multiple."""
        return MIN_FOLDABLE < self.multiple < MAX_FOLDABLE


def detect_doppler_scale(tracks: Sequence[Mapping[str, np.ndarray]]) -> DopplerScale | None:
    """The multiple of the change of the range that the velocities of tracks, COLUMNS (n,), are; None where they agree
    with it, or do not show one. One that is not certain may come from folds."""
    arrays = [np.stack([columns[name] for name in COLUMNS]) for columns in tracks]
    arrays = [array[:, np.isfinite(array).all(axis=0)] for array in arrays]
    if sum(array.shape[1] for array in arrays) < MIN_ROWS:
        return None
    stretches = _longest_stretches([stretch for array in arrays for stretch in _stretches(array)])
    if sum(stretch.shape[1] for stretch in stretches) < MIN_ROWS:
        return None
    number = np.repeat(np.arange(len(stretches)), [stretch.shape[1] for stretch in stretches])
    t, r, _, integral = np.concatenate(stretches, axis=1)
    slope, residuals, course = _least_absolute_slope(integral, r, number)
    deviation = float(np.median(np.abs(residuals)))
    if slope == 0 or not float(np.median(np.abs(course))) > MIN_COURSE * deviation:
        return None
    size = float(np.sqrt(course @ course))
    wandering = abs(slope) * max(map(_wandering_m, stretches)) * np.sqrt(len(r)) / size
    error = ERROR_SIGMAS * (1.4826 * deviation / size + wandering)
    if error > MAX_ERROR:
        return None
    scale = _scale(1 / slope, max(error, UNIT_TOLERANCE))
    if scale is None or scale.is_sign or not scale.is_foldable:
        return scale
    return replace(scale, is_certain=_holds_with_drift(slope, t, r, integral, number))


def detect_foreign_velocities(tracks: Sequence[Mapping[str, np.ndarray]]) -> DopplerScale | None:
    """Velocities that have nothing to do with the change of the range, as those of another column: most miss it by most
    of their size over half of their track, far beyond noise. The multiple has no meaning."""
    rows = [np.empty((3, 0))]
    for columns in tracks:
        track = np.stack([np.asarray(columns[name], dtype=float) for name in COLUMNS])
        t, r, v = track[:, np.isfinite(track).all(axis=0)]
        half = t.size // 2
        if t.size < MIN_ROWS or not (np.diff(t) > 0).all():
            continue
        integral, course = _courses_without_jumps(t, r, v)
        spans = t[half:] - t[: t.size - half]
        expected, actual = ((values[half:] - values[: t.size - half]) / spans for values in (integral, course))
        sigma_v, sigma_r = (float(np.median(np.abs(np.diff(values, n=2)))) / (0.6745 * np.sqrt(6)) for values in (v, r))
        noise = np.maximum(FOREIGN_VELOCITY_SIGMAS * sigma_v, FOREIGN_RANGE_SIGMAS * sigma_r / spans)
        rows.append(np.stack([np.abs(expected - actual), np.maximum(np.abs(expected), np.abs(actual)), noise]))
    joined = np.concatenate(rows, axis=1)
    if not joined.shape[1]:
        return None
    miss, size, noise_mps = np.median(joined, axis=1).tolist()
    is_foreign = miss > max(MIN_FOREIGN_SHARE * size, noise_mps, MIN_FOREIGN_MPS)
    return DopplerScale(size / miss, False, (FOREIGN_CAUSE,)) if is_foreign else None


def detect_lost_signs(tracks: Sequence[Mapping[str, np.ndarray]]) -> DopplerScale | None:
    """Velocities of one sign alone that are as large as the change of the range, whether that rises or falls."""
    rows = [np.empty((2, 0))]
    for columns in tracks:
        track = np.stack([np.asarray(columns[name], dtype=float) for name in COLUMNS])
        t, r, v = track[:, np.isfinite(track).all(axis=0)]
        if t.size > 2 * RATE_ROWS and (np.diff(t) > 0).all():
            spans, changes = (values[2 * RATE_ROWS :] - values[: -2 * RATE_ROWS] for values in (t, r))
            is_close = spans < MAX_GAP_S * 2 * RATE_ROWS
            rows.append(np.stack([v[RATE_ROWS:-RATE_ROWS], changes / spans])[:, is_close])
    speeds, rates = np.concatenate(rows, axis=1)
    if not speeds.size or (speeds.min() < 0 < speeds.max()):
        return None
    for is_sign in (rates > 0, rates < 0):
        miss = np.abs(np.abs(speeds[is_sign]) - np.abs(rates[is_sign]))
        if miss.size < MIN_SIGN_ROWS or np.median(miss) > MAX_SIGN_MISS * np.median(np.abs(speeds[is_sign])):
            return None
    return DopplerScale(1.0, False, (LOST_SIGN_CAUSE,))


def _courses_without_jumps(t: np.ndarray, r: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The integral (n,) of the velocities of a track and the course of its ranges, without the few intervals in which
    the two differ far more than usual: single wild numbers would stay in either for all later rows."""
    ways, steps = 0.5 * (v[1:] + v[:-1]) * np.diff(t), np.diff(r)
    misses = np.abs(steps - ways)
    is_wild = misses > MIN_WILD_MISSES * np.median(misses)
    if is_wild.mean() <= MAX_WILD_SHARE:
        ways, steps = np.where(is_wild, 0.0, ways), np.where(is_wild, 0.0, steps)
    integral, course = (np.concatenate([[0.0], np.cumsum(values)]) for values in (ways, steps))
    return integral, course


def _wandering_m(stretch: np.ndarray) -> float:
    """How far the errors of the velocities of a stretch (4, m) carry their integral from its mean, m: a random walk."""
    t, _, v, _ = stretch
    sigma = float(np.median(np.abs(np.diff(v, n=2)))) / (0.6745 * np.sqrt(6))
    return sigma * float(np.sqrt(np.sum(np.diff(t) ** 2) / 6))


def _holds_with_drift(slope: float, t: np.ndarray, r: np.ndarray, integral: np.ndarray, number: np.ndarray) -> bool:
    """Whether the slope of ranges on integrals (n,) stays where a drift in time is allowed for in each stretch."""
    without_drift = []
    for values in (integral, r):
        deviations = values.copy()
        for stretch in range(int(number[-1]) + 1):
            rows = number == stretch
            deviations[rows] -= np.polyval(np.polyfit(t[rows] - t[rows][0], values[rows], 1), t[rows] - t[rows][0])
        without_drift.append(deviations)
    refitted, residuals, course = _least_absolute_slope(without_drift[0], without_drift[1], number)
    error = ERROR_SIGMAS * 1.4826 * float(np.median(np.abs(residuals))) / float(np.sqrt(course @ course) or 1e-300)
    return error <= MAX_ERROR and abs(refitted / slope - 1) <= MAX_DRIFT_CHANGE


def _stretches(track: np.ndarray) -> list[np.ndarray]:
    """Stretches (4, m) of a track (3, n) without long gaps: with the integral of the velocity, m."""
    t, _, v = track
    steps = np.diff(t)
    if not steps.size:
        return []
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * steps)])
    longest = max(MAX_GAP_S, MAX_GAP_STEPS * float(np.median(steps)))  # times may be in a smaller unit than s
    parts = np.split(np.vstack([track, integral]), np.flatnonzero((steps <= 0) | (steps > longest)) + 1, axis=1)
    return [part for part in parts if part.shape[1] >= MIN_STRETCH_ROWS]


def _longest_stretches(stretches: list[np.ndarray]) -> list[np.ndarray]:
    """The longest stretches (4, m), of MAX_ROWS in all; the first rows of one that is longer."""
    longest = sorted((stretch[:, :MAX_ROWS] for stretch in stretches), key=lambda stretch: -stretch.shape[1])
    ends = np.cumsum([stretch.shape[1] for stretch in longest])
    return longest[: int(np.searchsorted(ends, MAX_ROWS)) + 1]


def _least_absolute_slope(x: np.ndarray, y: np.ndarray, number: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """The slope of y (n,) on x with least absolute deviations, with a constant for each stretch, by its number (n,);
    the residuals (n,), and the fitted course (n,) without the constants."""
    weights, slope, residuals, centred = np.ones(len(x)), 0.0, y, x
    smallest = 1e-9 * float(np.abs(y).max()) + np.finfo(float).tiny
    for _ in range(ROUNDS):
        total = np.bincount(number, weights)
        centred, y_centred = (z - (np.bincount(number, weights * z) / total)[number] for z in (x, y))
        square = float(weights @ centred**2)
        if not square > 0:
            return 0.0, residuals, centred
        slope = float(weights @ (centred * y_centred)) / square
        residuals = y_centred - slope * centred
        weights = 1 / np.maximum(np.abs(residuals), smallest)
        weights /= weights.max()
    return slope, residuals, slope * centred


def _scale(multiple: float, error: float) -> DopplerScale | None:
    """What a multiple says, with its relative error; None where it is near 1, or says nothing known."""
    size = abs(multiple)
    is_sign = abs(multiple + 1) <= error
    if not is_sign and multiple > 0 and 1 / MAX_PLAUSIBLE_MULTIPLE < size < MAX_PLAUSIBLE_MULTIPLE:
        return None
    causes = tuple(cause for factor, cause in CAUSES.items() if abs(np.log(size / factor)) <= error)
    is_likely = bool(causes) or size >= MAX_PLAUSIBLE_MULTIPLE  # any other multiple below 1 may be folded in part
    return DopplerScale(multiple, is_sign, causes) if is_sign or is_likely else None


def doppler_scale_message(scale: DopplerScale) -> str:
    """The message that velocities are a multiple of the change of the range, with its cause and cure."""
    if scale.causes == (FOREIGN_CAUSE,):
        return tr(
            "the Doppler speeds have nothing to do with the change of the range: {cause}", cause=tr(FOREIGN_CAUSE)
        )
    if scale.causes == (LOST_SIGN_CAUSE,):
        return tr("the Doppler speeds have one sign where the ranges rise and where they fall: {cause}",
                  cause=tr(LOST_SIGN_CAUSE))  # fmt: skip
    if scale.is_sign:
        return tr("the velocities have the opposite sign of the change of the range: import the recording with "
                  "--doppler-towards, or without it if it was given")  # fmt: skip
    is_opposite = scale.multiple < 0 and scale.causes
    sign = tr("; and the sign is opposite: --doppler-towards") if is_opposite else ""
    cause = tr(" or ").join(map(tr, scale.causes)) or _unknown_cause(scale.multiple)
    return tr(
        "the Doppler speeds miss the change of the range by a factor of {multiple}: {cause}{sign}",
        multiple=significant_digits(abs(scale.multiple), "#.3g"),
        cause=cause,
        sign=sign,
    )


def _unknown_cause(multiple: float) -> str:
    """What may leave a multiple that no unit leaves; a large one may be of frequencies, at a wavelength."""
    wavelength_m = 2 / abs(multiple)
    if not MIN_WAVELENGTH_M < wavelength_m < MAX_WAVELENGTH_M:
        return tr("their unit, or that of ranges or times, is another, or a column is swapped")
    return tr("their unit, or that of ranges or times, is another (as Hz, at a wavelength of {length:.3g} m), or a "
              "column is swapped", length=wavelength_m)  # fmt: skip
