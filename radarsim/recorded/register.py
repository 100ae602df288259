r"""`radarsim register`: what a radar is off by in range, bearing and time, against positions of the same aircraft.

A plot of time t is that of an aircraft which is at range R and bearing B by the positions:

    range = (1 + range_scale) R(t - time_s) + range_m,   bearing = B(t - time_s) + bearing_rad

with errors that are independent between aircraft: registration to a reference by least squares (Dana 1990,
Registration: a prerequisite for multiple sensor tracking, in Bar-Shalom, Multitarget-multisensor tracking: advanced
applications). The squares are Tukey's biweight after Huber's function, each in units of the median absolute residual
(Huber 1981, Robust statistics, ch. 7).

Intervals are by clusters, so that errors may be correlated within an aircraft: variance and degrees of freedom of Bell
and McCaffrey (2002, Survey Methodology 28, 169), for the linear model that has the pseudo-residuals of the robust
estimate as its errors (Huber, sec. 7.6). A bias that moves the plots as others do is taken as 0 and called unknown.
"""

import itertools
import math
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from radarsim.errors import ConfigError
from radarsim.language import plural, speaking, tr
from radarsim.recorded import plots as files
from radarsim.recorded.formats.sites import BIASES, DAY_S, Site
from radarsim.recorded.identity import KINDS, Paths, apart, are_far, distance, offsets, owned
from radarsim.recorded.plots import grouped
from radarsim.report.wording import interval, significant_digits

HELD = ("range_scale", "time_s")  # taken as 0 where they cannot be told from the others
LEAST_PLOTS = 20
MOST_ALIKE = 100.0  # factor in the variance of a bias, by the others, from which they cannot be told apart
MOVED = 10.0  # σ of a plot that an aircraft must move for its lag to show
MOST_BENT_M = 100.0  # of an interpolated position from the straight line
LEAST_AIRCRAFT, PIECES = 4, 20  # fewer aircraft are cut into about so many pieces
HUBER, BIWEIGHT = 1.345, 4.685  # of 95 % efficiency for normal errors
MAD = 1.4826  # σ of normal errors over their median absolute value
LEAST_SIGMA = 1e-13  # of a range, relative, and of a bearing
ROUNDS, CONVERGED = 60, 1e-6
OWN_LAG = 5.0  # standard deviations from the others, from which an aircraft's lag is its own


class Pairs(NamedTuple):
    """Plots (n,), the number of each one's aircraft, and position and speed (m, 6) of an aircraft at times (m,)."""

    t_s: np.ndarray
    range_m: np.ndarray
    bearing_rad: np.ndarray
    path: np.ndarray
    at: Callable[[int, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Bias:
    """A bias with its 95 % interval, NaN where it is unknown, as `why` says."""

    key: str
    value: float
    lo: float
    hi: float
    why: str = ""

    @property
    def identifiable(self) -> bool:
        """Whether the plots tell it."""
        return not self.why


@dataclass(frozen=True)
class Aircraft:
    """What the biases leave of an aircraft's plots: medians of range and bearing, its own lag and the error of that."""

    name: str
    plots: int
    range_m: float
    bearing_rad: float
    time_s: float
    sigma_time_s: float


@dataclass(frozen=True)
class Adjusted:
    """Biases in the order of BIASES; σ of range and bearing of a plot; residuals (n, 2); plots without weight; the
    number of independent clusters; lag of each aircraft beyond time_s and its σ, by number."""

    biases: tuple[Bias, ...]
    sigma: tuple[float, float]
    residuals: np.ndarray
    outliers: int
    clusters: int
    lags: dict[int, tuple[float, float]]


@dataclass(frozen=True)
class Registration:
    """What `register` finds: biases and errors of plots; the matched ones, out of how many and how; their median
    distance in range and bearing before; the items left out; the distance of 95 % of interpolated positions from
    straight lines."""

    adjusted: Adjusted
    aircraft: tuple[Aircraft, ...]
    plots: int
    matched: int
    by: dict[str, int]
    apart: tuple[float, float]  # m and degrees
    left: tuple[str, ...]
    bent_m: float


# ---- words -----------------------------------------------------------------------------------------------------------
def lines(found: Registration) -> list[str]:
    """The biases in sentences, and what to do about them."""
    adjusted, said, options, shown = found.adjusted, [], [], False
    for one in adjusted.biases:
        name, factor = ("bearing_deg", math.degrees(1)) if one.key == "bearing_rad" else (one.key, 1.0)
        if not one.identifiable:
            said.append(tr("{key}: unknown: {why}", key=one.key, why=one.why))
            continue
        if one.lo == one.hi == 0:
            said.append(tr("{key}: 0, to the last digits of the numbers", key=name))
            continue
        value, *ends = (significant_digits(factor * number) for number in (one.value, one.lo, one.hi))
        zero = tr("; 0 is possible") if one.lo <= 0 <= one.hi else ""
        said.append(f"{name}: {value} {interval(*ends)}{zero}")
        options.append(f"--bias {name}={factor * one.value:.4g}")
        shown |= not zero
    r, b = adjusted.sigma
    rest = [f"σ {significant_digits(r)} {tr('m')}"]
    if math.isfinite(b):
        rest.append(f"{significant_digits(math.degrees(b))}°")
    of = plural("{count} outlier", "{count} outliers", adjusted.outliers)
    said.append(tr("left: {sigma}; {outliers}", sigma=", ".join(rest), outliers=of))
    if len(found.aircraft) < LEAST_AIRCRAFT:
        said.append(
            tr("errors common to a whole flight are not in the intervals: that takes {n} flights", n=LEAST_AIRCRAFT)
        )
    for own in apart_in_time(found):
        told = {"name": own.name, "lag": significant_digits(own.time_s, "+.2g")}
        said.append(tr("{name} alone is {lag} s from the others in time: its positions err, not the radar", **told))
    command = f"radarsim import … {' '.join(options)}"
    said.append(tr("to correct: `{command}`", command=command) if shown else tr("no bias differs from 0"))
    return said


def apart_in_time(found: Registration) -> list[Aircraft]:
    """Aircraft whose lag is not that of the others."""
    lags = np.array([one.time_s for one in found.aircraft])
    known = np.isfinite(lags)
    if known.sum() < LEAST_AIRCRAFT + 1:
        return []
    spread = MAD * float(np.median(np.abs(lags[known] - np.median(lags[known]))))
    middle = float(np.median(lags[known]))
    return [one for one in found.aircraft if abs(one.time_s - middle) > OWN_LAG * math.hypot(spread, one.sigma_time_s)]


def as_json(found: Registration) -> dict[str, Any]:
    """The result as one document of plain data."""
    r, b = found.adjusted.sigma
    return {
        "biases": [{**asdict(one), "identifiable": one.identifiable} for one in found.adjusted.biases],
        "sigma_range_m": r,
        "sigma_bearing_rad": b,
        "plots": found.plots,
        "matched": found.matched,
        "by": found.by,
        "outliers": found.adjusted.outliers,
        "clusters": found.adjusted.clusters,
        "interpolation_m": found.bent_m,
        "left_out": found.left,
        "aircraft": [asdict(one) for one in found.aircraft],
    }


# ---- recordings ------------------------------------------------------------------------------------------------------
SITE = re.compile(r"# radar(?: \S+)? \(WGS 84\): (\S+) deg (\S+) deg (\S+) m;")
ZERO = re.compile(r"# t_s: seconds from .*\((\S+) s after (1970|midnight|the start of its clock)\);")
RADAR = (("t_s", "range_m", "bearing_rad"), ("t_s", "range_m"))
UNKNOWN = "the start of its clock"
OTHER = (("t_s", "x_m", "y_m", "z_m"),)


@dataclass(frozen=True)
class Recording:
    """A file of `radarsim import`: columns (n,), tracks, identities by KINDS; the place of its radar, degrees and m,
    where it says so; the zero of its times, s, and what that counts from."""

    columns: dict[str, np.ndarray]
    tracks: list[str]
    identity: dict[str, list[str]]
    place: tuple[float, float, float] | None
    zero: tuple[float, str]


def register(radar: str, other: str) -> Registration:
    """The biases of a radar's plots against positions of the same aircraft, both as `radarsim import` writes them.

    other: `[ID=]FILE`, with the track, address, callsign or code of the plots whose positions are all in the file, of a
    receiver that knows nothing of these. Raises ConfigError where too few plots have a position, or these lie too far
    apart."""
    from radarsim.recorded.formats.importing import truth_of

    path, whose = truth_of(other)
    plots, positions = read(radar, RADAR), read(other := str(path), OTHER)
    if whose:
        positions.identity["address"] = [whose] * len(positions.tracks)
    fixes, t = np.stack([positions.columns[name] for name in OTHER[0]], axis=1), plots.columns["t_s"]
    if plots.place and positions.place and plots.place != positions.place:
        states = np.pad(fixes[:, 1:], ((0, 0), (0, 3)))
        fixes[:, 1:] = Site(*plots.place).turned(Site(*positions.place), states)[:, :3]
    paths = Paths()
    if plots.zero != positions.zero:
        (zero, since), (other_zero, other_since) = plots.zero, positions.zero
        if since != other_since and UNKNOWN in (since, other_since):
            fault = f"t_s counts from {since}, in {other} from {other_since}"
            raise ConfigError(f"{radar}: {fault}: both must be dated, as times of day or from 1970, by radarsim import")
        t = t + (zero - other_zero)
        paths.period_s = math.inf if since == other_since else DAY_S
    paths.add(fixes, positions.tracks, positions.identity)
    r = plots.columns["range_m"]
    b = plots.columns.get("bearing_rad", np.full(len(r), np.nan))
    found = paths.find(t, r, b, owned(whose, plots.tracks, plots.identity))
    missed, own, names = offsets(found.states, r, b), found.path >= 0, paths.names()
    strange, others = int((~own).sum()), []
    bent = np.zeros(len(t))
    for number, rows in grouped(found.path.tolist()).items():
        if number < 0:
            continue
        if are_far(missed[rows], r[rows]):
            others.append((names[number], apart(missed[rows])))
            own[rows] = False
        bent[rows] = paths.bent(number, t[rows])
    wide = int((own & (bent > MOST_BENT_M)).sum())
    own &= bent <= MOST_BENT_M
    left = partial(_left_out, strange, other, others, wide)
    if own.sum() < LEAST_PLOTS:
        with speaking("en"):  # as all faults
            why = "".join(f"; left out: {what}" for what in left())
        raise ConfigError(f"{radar}: {own.sum()} of {len(t)} plots have a position of their aircraft in {other}, by "
                          f"address, callsign or Mode 3/A code and time; needs {LEAST_PLOTS}{why}")  # fmt: skip
    adjusted = adjust(Pairs(t[own], r[own], b[own], found.path[own], paths.at))
    aircraft = []
    for number, rows in grouped(found.path[own].tolist()).items():
        r_left, b_left = (_median(adjusted.residuals[rows, k]) for k in range(2))
        aircraft.append(Aircraft(names[number], len(rows), r_left, b_left, *adjusted.lags[number]))
    by = Counter(KINDS[k] for k in found.kind[own].tolist())
    return Registration(
        *(adjusted, tuple(aircraft), len(t), int(own.sum()), dict(by)),
        *(apart(missed[own]), tuple(left()), float(np.quantile(bent[own], 0.95))),
    )


def _left_out(strange: int, file: str, others: Sequence[tuple[str, tuple[float, float]]], wide: int) -> list[str]:
    """The plots that are not used, and why: of no aircraft in the file, of others than named, in turns."""
    left = [
        tr("the plots of {name}, which lie {away} away: it is another", name=name, away=distance(*far))
        for name, far in others
    ]
    if strange:
        of = plural("{count} plot", "{count} plots", strange)
        left.insert(0, tr("{of} that no aircraft in {file} has at that time", of=of, file=file))
    if wide:
        of = plural("{count} plot", "{count} plots", wide)
        left.append(tr("{of} in turns, where positions are too far apart to {most:g} m", of=of, most=MOST_BENT_M))
    return left


def read(path: str, choices: Sequence[Sequence[str]]) -> Recording:
    """A file of `radarsim import`, with the first of the choices of columns that it has; rows without these are left
    out, and those that are marked as of no aircraft, which have no track. Raises ConfigError."""
    parts = list(files.pieces(path, choices, texts=(*KINDS, "radar", "marks")))
    columns = {name: np.concatenate([part.columns[name] for part in parts]) for name in parts[0].columns}
    tracks = [name for part in parts for name in part.tracks or [""] * len(part.columns["t_s"])]
    named = {name: [text for part in parts for text in part.texts[name]] for name in parts[0].texts}
    known = np.isfinite([columns[name] for name in list(columns)[:2]]).all(axis=0)
    if named.pop("marks", None):
        known &= np.array(tracks) != ""
    radars, (sites, zero) = set(named.pop("radar", [""])), _stated(path)
    if choices == RADAR and len(radars) > 1:
        fault = "must hold plots of one radar, by `radarsim import --at SAC/SIC=LAT,LON,HEIGHT`"
        raise ConfigError(f"{path}: {fault}; has {', '.join(sorted(radars))}")
    if len(sites) > 1:
        raise ConfigError(f"{path}: must count x_m, y_m, z_m from one place, has {len(sites)} radars")
    if "address" not in named:
        named["address"] = tracks
    rows = np.flatnonzero(known).tolist()
    return Recording(
        {name: column[rows] for name, column in columns.items()},
        [tracks[i] for i in rows],
        {name: [column[i] for i in rows] for name, column in named.items()},
        next(iter(sites), None),
        zero,
    )


def _stated(path: str) -> tuple[set[tuple[float, float, float]], tuple[float, str]]:
    """The places of radars and the zero of times in the first lines of a file."""
    sites, zero = set(), (0.0, UNKNOWN)
    with open(path, encoding="utf-8-sig") as file:
        for line in itertools.takewhile(lambda line: line.startswith("#"), file):
            known = True
            try:
                if found := SITE.match(line):
                    lat, lon, height = map(float, found.groups())
                    sites.add((lat, lon, height))
                    known = abs(lat) <= 90 and math.isfinite(lon + height)
                if found := ZERO.match(line):
                    zero = (float(found[1]), found[2])
                    known = math.isfinite(zero[0])
            except ValueError:
                known = False
            if not known:
                fault = "must be as radarsim import writes it, with finite numbers"
                raise ConfigError(f"{path}: {fault}; got {line.rstrip()[:120]!r}")
    return sites, zero


def _median(values: np.ndarray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else math.nan


# ---- least squares ---------------------------------------------------------------------------------------------------
def adjust(pairs: Pairs) -> Adjusted:
    """The biases of plots, by robust least squares."""
    why = _unknown(pairs)
    used = np.array([not why.get(key) for key in BIASES])
    values, sigma = _huber(pairs, used)
    for _ in range(ROUNDS):
        errors, slopes = _linear(pairs, values)
        step, length = _step(errors, slopes, sigma, _biweight(errors / sigma), used)
        values = values + step
        if length < CONVERGED:
            break
    errors, slopes = _linear(pairs, values)
    # How far biases of 1 move a plot, in the last digits of its numbers: what moves none by one of these is none.
    moved = np.abs(slopes / _floor(pairs)[:, None]).max(axis=(0, 1))
    u, slopes, clusters = errors / sigma, slopes / sigma[:, None], _clusters(pairs)
    weights = _biweight(u)
    half = _halves(u, slopes, clusters, used)
    values, half = np.where((np.abs(values) + half) * moved > 1, [values, half], 0.0)
    lags = {number: _lag(u[rows], slopes[rows, :, 3]) for number, rows in grouped(pairs.path.tolist()).items()}
    biases = [
        Bias(key, math.nan, math.nan, math.nan, why[key]) if why.get(key) else Bias(key, v, v - h, v + h)
        for key, v, h in zip(BIASES, values.tolist(), half.tolist(), strict=True)
    ]
    outliers = int(((weights == 0) & np.isfinite(u)).any(axis=1).sum())
    return Adjusted(
        tuple(biases), (float(sigma[0]), float(sigma[1])), errors, outliers, len(set(clusters.tolist())), lags
    )


def _linear(pairs: Pairs, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (n, 2) of range and bearing, NaN where there is none, and their derivatives (n, 2, biases)."""
    bias, scale, turn, lag = values.tolist()
    states = np.full((len(pairs.t_s), 6), np.nan)
    for number, rows in grouped(pairs.path.tolist()).items():
        states[rows] = pairs.at(number, pairs.t_s[rows] - lag)
    place, speed = states[:, :3], states[:, 3:]
    errors = offsets(states, pairs.range_m - bias, pairs.bearing_rad - turn)
    r = np.linalg.norm(place, axis=1)
    errors[:, 0] -= scale * r
    slopes = np.zeros((len(r), 2, len(BIASES)))
    slopes[:, 0, 0], slopes[:, 0, 1], slopes[:, 1, 2] = 1.0, r, 1.0
    slopes[:, 0, 3] = -(1 + scale) * np.einsum("ni,ni->n", place, speed) / r
    slopes[:, 1, 3] = -(place[:, 0] * speed[:, 2] - place[:, 2] * speed[:, 0]) / (place[:, 0] ** 2 + place[:, 2] ** 2)
    return errors, np.where(np.isfinite(errors)[..., None], slopes, 0.0)


def _huber(pairs: Pairs, used: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Biases and σ (2,) of range and bearing by Huber's function, from biases of 0."""
    values = np.zeros(len(BIASES))
    floor = _floor(pairs)
    for _ in range(ROUNDS):
        errors, slopes = _linear(pairs, values)
        sigma = np.array([_sigma(errors[:, k], floor[k]) for k in range(2)])
        with np.errstate(divide="ignore"):
            weights = np.nan_to_num(np.minimum(1.0, HUBER / np.abs(errors / sigma)))
        step, length = _step(errors, slopes, sigma, weights, used)
        values = values + step
        if length < CONVERGED:
            break
    errors, _ = _linear(pairs, values)
    return values, np.maximum([_spread(errors[:, k]) for k in range(2)], floor)


def _sigma(errors: np.ndarray, least: float) -> float:
    known = errors[np.isfinite(errors)]
    return max(MAD * float(np.median(np.abs(known))), least) if len(known) else math.inf


def _spread(errors: np.ndarray) -> float:
    """σ of normal errors, of which some may be outliers, by the biweight midvariance (Lax 1985, JASA 80, 736)."""
    known = errors[np.isfinite(errors)]
    limit = 9 * float(np.median(np.abs(known))) if len(known) else math.inf
    inner = known[np.abs(known) < limit]
    if not len(inner):
        return limit  # there are none, or most are zero
    v = (inner / limit) ** 2
    return math.sqrt(len(known) * float((inner**2 * (1 - v) ** 4).sum())) / float(((1 - v) * (1 - 5 * v)).sum())


def _biweight(u: np.ndarray) -> np.ndarray:
    return np.where(np.abs(u) < BIWEIGHT, (1 - (u / BIWEIGHT) ** 2) ** 2, 0.0)


def _step(
    errors: np.ndarray, slopes: np.ndarray, sigma: np.ndarray, weights: np.ndarray, used: np.ndarray
) -> tuple[np.ndarray, float]:
    """Change of the biases (4,) by weighted least squares, and the largest in standard errors of it alone."""
    design = slopes[..., used] * (np.sqrt(weights) / sigma)[..., None]
    target = np.nan_to_num(errors) * np.sqrt(weights) / sigma
    size = np.sqrt((design**2).sum(axis=(0, 1)))
    size[size == 0] = 1.0
    step = np.zeros(len(used))
    step[used] = np.linalg.lstsq((design / size).reshape(-1, used.sum()), target.ravel(), rcond=1e-12)[0] / size
    return step, float(np.abs(step[used] * size).max())


def _unknown(pairs: Pairs) -> dict[str, str]:
    """The biases that the plots cannot tell, and why: by where the targets are, not by what was measured."""
    errors, slopes = _linear(pairs, np.zeros(len(BIASES)))
    sigma = _scatter(pairs, errors)
    why: dict[str, str] = {}
    if not math.isfinite(sigma[1]):
        why["bearing_rad"] = tr("there are no bearings")
    moved, farthest = _moved(pairs, sigma)
    if moved < MOVED:
        why["time_s"] = tr("the targets hardly move ({distance:.3g} m at most)", distance=farthest)
    design = (slopes / sigma[:, None]).reshape(-1, len(BIASES))
    while True:
        used = [k for k, name in enumerate(BIASES) if name not in why]
        columns = design[:, used] / np.linalg.norm(design[:, used], axis=0)
        alike = {}
        for own in (used.index(k) for k in used if BIASES[k] in HELD):
            others = np.delete(columns, own, axis=1)
            shares = np.linalg.lstsq(others, columns[:, own], rcond=1e-12)[0]
            left = float(((columns[:, own] - others @ shares) ** 2).sum())  # 1 over the variance inflation
            partner = int(np.delete(used, own)[np.abs(shares).argmax()])
            alike[used[own]] = (left, partner)
        k = min(alike, key=alike.__getitem__, default=-1)
        if k < 0 or alike[k][0] * MOST_ALIKE >= 1:
            return why
        why[BIASES[k]] = _alike(BIASES[k], BIASES[alike[k][1]], slopes)


def _scatter(pairs: Pairs, errors: np.ndarray) -> np.ndarray:
    """σ of range and bearing (2,) by the differences of successive plots of an aircraft, on which biases have little
    part; infinite where there is none."""
    order = np.lexsort((pairs.t_s, pairs.path))
    steps = np.diff(errors[order], axis=0)[np.diff(pairs.path[order]) == 0]
    floor = _floor(pairs)
    return np.array([_sigma(steps[:, k] / math.sqrt(2), floor[k]) for k in range(2)])


def _floor(pairs: Pairs) -> np.ndarray:
    return LEAST_SIGMA * np.array([np.median(pairs.range_m), 1.0])


def _moved(pairs: Pairs, sigma: np.ndarray) -> tuple[float, float]:
    """The farthest way of an aircraft along range or bearing, in σ of a plot; the farthest between two plots, m."""
    most, farthest = 0.0, 0.0
    for number, rows in grouped(pairs.path.tolist()).items():
        place = pairs.at(number, pairs.t_s[rows])[:, :3]
        r = np.linalg.norm(place, axis=1)
        b = np.unwrap(np.arctan2(place[:, 2], place[:, 0]))
        most = max(most, float(np.ptp(r) / sigma[0]), float(np.ptp(b) / sigma[1]))
        farthest = max(farthest, float(np.linalg.norm(np.ptp(place, axis=0))))
    return most, farthest


def _alike(key: str, other: str, slopes: np.ndarray) -> str:
    """Why a bias cannot be told from another."""
    speed, r = -slopes[:, 0, 3], slopes[:, 0, 1]
    what, values, unit = {
        "range_scale, range_m": (tr("ranges"), r / 1e3, "km"),
        "time_s, range_m": (tr("radial speeds"), speed, "m/s"),
        "time_s, bearing_rad": (tr("turns of bearing"), np.degrees(-slopes[:, 1, 3]), "°/s"),
    }.get(f"{key}, {other}", (tr("ratios of radial speed and range"), speed / np.maximum(r, 1.0), "1/s"))
    lo, hi = np.quantile(values, (0.05, 0.95)).tolist()
    return tr(
        "the {what} are alike ({lo:.3g} to {hi:.3g} {unit}), so that it shows as {other} does, which holds if it is 0",
        **{"what": what, "lo": lo, "hi": hi, "unit": tr(unit), "other": other},
    )


def _lag(u: np.ndarray, slope: np.ndarray) -> tuple[float, float]:
    """The lag of one aircraft and its σ by Huber's function, from residuals and slopes (n, 2) in σ; NaN where nothing
    moves."""
    known = np.isfinite(u) & (slope != 0)
    u, slope, lag, error = u[known], slope[known], math.nan, math.inf
    for _ in range(ROUNDS if len(u) else 0):
        rest = u - slope * np.nan_to_num(lag)
        scale = _sigma(rest, LEAST_SIGMA)
        weight = np.minimum(1.0, HUBER * scale / np.maximum(np.abs(rest), LEAST_SIGMA))
        power = float((weight * slope**2).sum())
        lag, error = float((weight * slope * u).sum()) / power, scale / math.sqrt(power)
    return lag, error


def _clusters(pairs: Pairs) -> np.ndarray:
    """The number of the cluster of each plot (n,): its aircraft, or a piece of its flight where there are few."""
    own = grouped(pairs.path.tolist()).values()
    pieces = 1 if len(own) >= LEAST_AIRCRAFT else math.ceil(PIECES / len(own))
    clusters = np.zeros(len(pairs.t_s), dtype=int)
    parts = (part for rows in own for part in np.array_split(rows[np.argsort(pairs.t_s[rows])], pieces))
    for number, part in enumerate(parts):
        clusters[part] = number
    return clusters


def _halves(u: np.ndarray, slopes: np.ndarray, clusters: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Half the width of each bias's 95 % interval (4,), from residuals (n, 2), NaN where there is none, and slopes
    (n, 2, 4), both in σ."""
    from scipy.stats import t as student

    v = np.where(np.isfinite(u), np.minimum((u / BIWEIGHT) ** 2, 1.0), 1.0)
    steep = np.sqrt(((1 - v) * (1 - 5 * v)).sum(axis=0) / np.maximum(np.isfinite(u).sum(axis=0), 1))
    steep = np.where(steep > 0, steep, 1.0)  # of bearings, where there are none
    design, errors = slopes[..., used] * steep[:, None], np.nan_to_num(u) * (1 - v) ** 2 / steep
    size = np.sqrt((design**2).sum(axis=(0, 1)))
    design = design / size
    inverse = np.linalg.inv(np.einsum("nki,nkj->ij", design, design))
    variance, lengths, pulls = np.zeros_like(inverse), [], []
    for rows in grouped(clusters.tolist()).values():
        q, own = np.linalg.qr(design[rows].reshape(-1, len(size)))
        leverage, axes = np.linalg.eigh(np.eye(len(own)) - own @ inverse @ own.T)
        spread = own.T @ (axes * np.where(leverage > 1e-9, leverage, np.inf) ** -0.5) @ axes.T
        score = spread @ (q.T @ errors[rows].ravel())
        variance += np.outer(score, score)
        ways = spread.T @ inverse
        lengths.append((ways**2).sum(axis=0))
        pulls.append(own.T @ ways)
    length, pull = np.array(lengths), np.array(pulls)  # (clusters, biases), (clusters, biases, biases)
    tied = np.einsum("gij,ik,gkj->gj", pull, inverse, pull)
    of_all = np.einsum("gij,gkj->jik", pull, pull)
    trace = (length - tied).sum(axis=0)
    square = (length**2 - 2 * length * tied).sum(axis=0)
    square += np.einsum("ik,jkl,lm,jmi->j", inverse, of_all, inverse, of_all)
    half = np.zeros(len(used))
    half[used] = student.ppf(0.975, trace**2 / square) * np.sqrt(np.diag(inverse @ variance @ inverse)) / size
    return half
