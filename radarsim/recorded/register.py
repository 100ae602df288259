r"""Find a radar's biases in range, bearing and time against positions of the same aircraft.

If an aircraft has range R and bearing B by the positions, its plot of time t has:

    range = (1 + range_scale) R(t - time_s) + range_m,   bearing = B(t - time_s) + bearing_rad

with errors that are independent between aircraft: registration to a reference by least squares (Dana 1990,
Registration: a prerequisite for multiple sensor tracking, in Bar-Shalom, Multitarget-multisensor tracking: advanced
applications). The squares are Tukey's biweight after Huber's function, each in units of the median absolute residual
(Huber 1981, Robust statistics, ch. 7).

Intervals are by clusters, so that errors may be correlated within an aircraft: variance and degrees of freedom of Bell
and McCaffrey (2002, Survey Methodology 28, 169), for the linear model that has the pseudo-residuals of the robust
estimate as its errors (Huber, sec. 7.6). A bias that moves the plots as other biases do is taken as 0 and reported as
unknown.
"""

import itertools
import math
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np

from radarsim.errors import ConfigError
from radarsim.language import plural, speaking, tr
from radarsim.recorded import plots as files
from radarsim.recorded.formats.sites import BIASES, DAY_S, Site
from radarsim.recorded.identity import (
    KINDS,
    AircraftMatch,
    AircraftPaths,
    are_far,
    assign_owner,
    distance,
    median_offsets,
    range_bearing_offsets,
)
from radarsim.recorded.plots import rows_by_name
from radarsim.report.wording import interval, significant_digits

OPTIONAL_BIASES = ("range_scale", "time_s")  # taken as 0 if they cannot be distinguished from the others
MIN_PLOTS = 20
MAX_VARIANCE_INFLATION = 100.0  # of the variance of a bias by the others, from which they cannot be distinguished
MIN_MOVEMENT_SIGMAS = 10.0  # σ of a plot that an aircraft must move for its lag to show
MAX_DEVIATION_M = 100.0  # of an interpolated position from the straight line
MIN_AIRCRAFT, MIN_CLUSTERS = 4, 20  # fewer aircraft are cut into about so many pieces
HUBER_LIMIT, BIWEIGHT_LIMIT = 1.345, 4.685  # of 95 % efficiency for normal errors
MAD_TO_SIGMA = 1.4826  # σ of normal errors over their median absolute value
MIN_RELATIVE_SIGMA = 1e-13  # of a range, relative, and of a bearing
MAX_ROUNDS, CONVERGENCE_STEP = 60, 1e-6
OUTLIER_LAG_SIGMAS = 5.0  # standard deviations from the other aircraft, from which a lag counts as different


class MatchedPlots(NamedTuple):
    """Plots (n,), the number of each one's aircraft, and position and speed (m, 6) of an aircraft at times (m,)."""

    t_s: np.ndarray
    range_m: np.ndarray
    bearing_rad: np.ndarray
    path_numbers: np.ndarray
    states: Callable[[int, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Bias:
    """A bias with its 95 % interval; NaN if it is unknown, for the reason in `why`."""

    key: str
    value: float
    lo: float
    hi: float
    why: str = ""

    @property
    def identifiable(self) -> bool:
        """Whether the plots determine it."""
        return not self.why


@dataclass(frozen=True)
class AircraftResiduals:
    """Residuals of an aircraft's plots: medians of range and bearing, its lag beyond time_s and the σ of that lag."""

    name: str
    plots: int
    range_m: float
    bearing_rad: float
    time_s: float
    sigma_time_s: float


@dataclass(frozen=True)
class Adjustment:
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
    """The result of `register`.

    The biases and errors of plots; the number of plots, and of matched ones by kind of identity; their median offsets
    in range and bearing before the fit; the plots left out; the distance of 95 % of interpolated positions from
    straight lines."""

    adjusted: Adjustment
    aircraft: tuple[AircraftResiduals, ...]
    plots: int
    matched: int
    by: dict[str, int]
    apart: tuple[float, float]  # m and degrees
    left: tuple[str, ...]
    bent_m: float


# ---- words -----------------------------------------------------------------------------------------------------------
def lines(registration: Registration) -> list[str]:
    """Sentences on the biases, and the options that correct them."""
    adjustment, sentences, options, has_nonzero_bias = registration.adjusted, [], [], False
    for bias in adjustment.biases:
        key, factor = ("bearing_deg", math.degrees(1)) if bias.key == "bearing_rad" else (bias.key, 1.0)
        if not bias.identifiable:
            sentences.append(tr("{key}: unknown: {why}", key=bias.key, why=bias.why))
            continue
        if bias.lo == bias.hi == 0:
            sentences.append(tr("{key}: 0, to the last digits of the numbers", key=key))
            continue
        value, *interval_ends = (significant_digits(factor * number) for number in (bias.value, bias.lo, bias.hi))
        zero = tr("; 0 is possible") if bias.lo <= 0 <= bias.hi else ""
        sentences.append(f"{key}: {value} {interval(*interval_ends)}{zero}")
        options.append(f"--bias {key}={factor * bias.value:.4g}")
        has_nonzero_bias |= not zero
    r, b = adjustment.sigma
    sigma_texts = [f"σ {significant_digits(r)} {tr('m')}"]
    if math.isfinite(b):
        sigma_texts.append(f"{significant_digits(math.degrees(b))}°")
    outliers = plural("{count} outlier", "{count} outliers", adjustment.outliers)
    sentences.append(tr("left: {sigma}; {outliers}", sigma=", ".join(sigma_texts), outliers=outliers))
    if len(registration.aircraft) < MIN_AIRCRAFT:
        sentences.append(
            tr("errors common to a whole flight are not in the intervals: that takes {n} flights", n=MIN_AIRCRAFT)
        )
    for aircraft in deviating_aircraft(registration):
        values = {"name": aircraft.name, "lag": significant_digits(aircraft.time_s, "+.2g")}
        sentences.append(
            tr("{name} alone is {lag} s from the others in time: its positions err, not the radar", **values)
        )
    command = f"radarsim import … {' '.join(options)}"
    sentences.append(
        tr("to correct: `{command}`", command=command) if has_nonzero_bias else tr("no bias differs from 0")
    )
    return sentences


def deviating_aircraft(registration: Registration) -> list[AircraftResiduals]:
    """The aircraft whose lag differs clearly from the lags of the others."""
    lags = np.array([aircraft.time_s for aircraft in registration.aircraft])
    is_known = np.isfinite(lags)
    if is_known.sum() < MIN_AIRCRAFT + 1:
        return []
    spread_s = MAD_TO_SIGMA * float(np.median(np.abs(lags[is_known] - np.median(lags[is_known]))))
    median_s = float(np.median(lags[is_known]))
    return [
        aircraft
        for aircraft in registration.aircraft
        if abs(aircraft.time_s - median_s) > OUTLIER_LAG_SIGMAS * math.hypot(spread_s, aircraft.sigma_time_s)
    ]


def as_json(registration: Registration) -> dict[str, Any]:
    """The result as one document of plain data."""
    r, b = registration.adjusted.sigma
    return {
        "biases": [{**asdict(bias), "identifiable": bias.identifiable} for bias in registration.adjusted.biases],
        "sigma_range_m": r,
        "sigma_bearing_rad": b,
        "plots": registration.plots,
        "matched": registration.matched,
        "by": registration.by,
        "outliers": registration.adjusted.outliers,
        "clusters": registration.adjusted.clusters,
        "interpolation_m": registration.bent_m,
        "left_out": registration.left,
        "aircraft": [asdict(aircraft) for aircraft in registration.aircraft],
    }


# ---- recordings ------------------------------------------------------------------------------------------------------
SITE_LINE = re.compile(r"# radar(?: \S+)? \(WGS 84\): (\S+) deg (\S+) deg (\S+) m;")
ZERO_LINE = re.compile(r"# t_s: seconds from .*\((\S+) s after (1970|midnight|the start of its clock)\);")
PLOT_CHOICES = (("t_s", "range_m", "bearing_rad"), ("t_s", "range_m"))
UNKNOWN_ZERO = "the start of its clock"
POSITION_CHOICES = (("t_s", "x_m", "y_m", "z_m"),)


@dataclass(frozen=True)
class Recording:
    """A file of `radarsim import`: columns (n,), tracks, identities by KINDS; the place of its radar, degrees and m,
    where it says so; the zero of its times, s, and what that counts from."""

    columns: dict[str, np.ndarray]
    tracks: list[str]
    identity: dict[str, list[str]]
    site: tuple[float, float, float] | None
    zero: tuple[float, str]


class _Matching(NamedTuple):
    """Plots (n,) matched with aircraft: which are used, their offsets (n, 2), the distances (n,) of interpolated
    positions from straight lines, the names of the aircraft, and why the other plots are not used."""

    match: AircraftMatch
    is_used: np.ndarray
    offsets: np.ndarray
    deviations: np.ndarray
    names: list[str]
    unmatched_count: int
    distant_aircraft: list[tuple[str, tuple[float, float]]]
    bent_count: int


def register(radar: str, positions_file: str) -> Registration:
    """Find the biases of a radar's plots against positions of the same aircraft, both as `radarsim import` writes them.

    positions_file: `[ID=]FILE`, with the track, address, callsign or code of the plots to which all positions in the
    file belong, for a receiver that does not know them. Raises ConfigError if too few plots have a position, or if the
    plots lie too far from the positions."""
    from radarsim.recorded.formats.importing import truth_of

    path, owner = truth_of(positions_file)
    plots, positions = read_recording(radar, PLOT_CHOICES), read_recording(str(path), POSITION_CHOICES)
    if owner:
        positions.identity["address"] = [owner] * len(positions.tracks)
    paths, t = AircraftPaths(), plots.columns["t_s"]
    if plots.zero != positions.zero:
        t = t + _clock_difference(plots.zero, positions.zero, radar, str(path))
        paths.period_s = math.inf if plots.zero[1] == positions.zero[1] else DAY_S
    paths.add(_fixes_in_axes(plots, positions), positions.tracks, positions.identity)
    r = plots.columns["range_m"]
    b = plots.columns.get("bearing_rad", np.full(len(r), np.nan))
    matching = _match_plots(paths, t, r, b, assign_owner(owner, plots.tracks, plots.identity))
    is_used, path_numbers = matching.is_used, matching.match.path_numbers[matching.is_used]
    if is_used.sum() < MIN_PLOTS:
        raise _too_few_plots(radar, str(path), matching)
    adjustment = fit_biases(MatchedPlots(t[is_used], r[is_used], b[is_used], path_numbers, paths.states))
    counts_by_kind = Counter(KINDS[k] for k in matching.match.kind_numbers[is_used].tolist())
    return Registration(
        adjusted=adjustment,
        aircraft=_aircraft_residuals(adjustment, path_numbers, matching.names),
        plots=len(t),
        matched=int(is_used.sum()),
        by=dict(counts_by_kind),
        apart=median_offsets(matching.offsets[is_used]),
        left=tuple(_excluded_plots(matching, str(path))),
        bent_m=float(np.quantile(matching.deviations[is_used], 0.95)),
    )


def _clock_difference(zero: tuple[float, str], other_zero: tuple[float, str], radar: str, other_file: str) -> float:
    """The difference of the zeros of two clocks, s; raises ConfigError if it is unknown."""
    (zero_s, since), (other_zero_s, other_since) = zero, other_zero
    if since != other_since and UNKNOWN_ZERO in (since, other_since):
        fault = f"t_s counts from {since}, in {other_file} from {other_since}"
        raise ConfigError(f"{radar}: {fault}: both must be dated, as times of day or from 1970, by radarsim import")
    return zero_s - other_zero_s


def _fixes_in_axes(plots: Recording, positions: Recording) -> np.ndarray:
    """Times and positions (n, 4) of a recording in the local axes of the plots' radar."""
    fixes = np.stack([positions.columns[name] for name in POSITION_CHOICES[0]], axis=1)
    if plots.site and positions.site and plots.site != positions.site:
        states = np.pad(fixes[:, 1:], ((0, 0), (0, 3)))
        fixes[:, 1:] = Site(*plots.site).rotate_states(Site(*positions.site), states)[:, :3]
    return fixes


def _match_plots(
    paths: AircraftPaths, t: np.ndarray, r: np.ndarray, b: np.ndarray, identity: Mapping[str, Sequence[str]]
) -> _Matching:
    """Match plots (n,) with aircraft, without distant aircraft and without turns that positions do not resolve."""
    match, names = paths.find(t, r, b, identity), paths.names()
    offsets, is_used = range_bearing_offsets(match.states, r, b), match.path_numbers >= 0
    unmatched_count = int((~is_used).sum())
    distant_aircraft, deviations = [], np.zeros(len(t))
    for number, rows in rows_by_name(match.path_numbers.tolist()).items():
        if number < 0:
            continue
        if are_far(offsets[rows], r[rows]):
            distant_aircraft.append((names[number], median_offsets(offsets[rows])))
            is_used[rows] = False
        deviations[rows] = paths.deviations_m(number, t[rows])
    bent_count = int((is_used & (deviations > MAX_DEVIATION_M)).sum())
    is_used &= deviations <= MAX_DEVIATION_M
    return _Matching(match, is_used, offsets, deviations, names, unmatched_count, distant_aircraft, bent_count)


def _aircraft_residuals(
    adjustment: Adjustment, path_numbers: np.ndarray, names: Sequence[str]
) -> tuple[AircraftResiduals, ...]:
    """The residuals of the plots of each aircraft, whose path numbers (n,) are given."""
    aircraft = []
    for number, rows in rows_by_name(path_numbers.tolist()).items():
        range_m, bearing_rad = (_finite_median(adjustment.residuals[rows, k]) for k in range(2))
        lag = adjustment.lags[number]
        aircraft.append(AircraftResiduals(names[number], len(rows), range_m, bearing_rad, *lag))
    return tuple(aircraft)


def _too_few_plots(radar: str, positions_file: str, matching: _Matching) -> ConfigError:
    with speaking("en"):  # as all faults
        reasons = "".join(f"; left out: {reason}" for reason in _excluded_plots(matching, positions_file))
    counts = f"{matching.is_used.sum()} of {len(matching.is_used)} plots"
    return ConfigError(f"{radar}: {counts} have a position of their aircraft in {positions_file}, by address, callsign "
                       f"or Mode 3/A code and time; needs {MIN_PLOTS}{reasons}")  # fmt: skip


def _excluded_plots(matching: _Matching, positions_file: str) -> list[str]:
    """The plots that are not used, and why: of no aircraft in the file, of another aircraft, or in turns."""
    reasons = [
        tr("the plots of {name}, which lie {away} away: it is another", name=name, away=distance(*median))
        for name, median in matching.distant_aircraft
    ]
    if matching.unmatched_count:
        plot_count = plural("{count} plot", "{count} plots", matching.unmatched_count)
        reasons.insert(0, tr("{of} that no aircraft in {file} has at that time", of=plot_count, file=positions_file))
    if matching.bent_count:
        plot_count = plural("{count} plot", "{count} plots", matching.bent_count)
        text = tr("{of} in turns, where positions are too far apart to {most:g} m", of=plot_count, most=MAX_DEVIATION_M)
        reasons.append(text)
    return reasons


def read_recording(path: str, choices: Sequence[Sequence[str]]) -> Recording:
    """A file of `radarsim import`, with the first of the choices of columns that it has; rows without these are left
    out, and those that are marked as of no aircraft, which have no track. Raises ConfigError."""
    pieces = list(files.pieces(path, choices, texts=(*KINDS, "radar", "marks")))
    columns = {name: np.concatenate([part.columns[name] for part in pieces]) for name in pieces[0].columns}
    tracks = [name for part in pieces for name in part.tracks or [""] * len(part.columns["t_s"])]
    texts = {name: [text for part in pieces for text in part.texts[name]] for name in pieces[0].texts}
    is_used = np.isfinite([columns[name] for name in list(columns)[:2]]).all(axis=0)
    if texts.pop("marks", None):
        is_used &= np.array(tracks) != ""
    radars, (sites, zero) = set(texts.pop("radar", [""])), _read_comments(path)
    if choices == PLOT_CHOICES and len(radars) > 1:
        fault = "must hold plots of one radar, by `radarsim import --at SAC/SIC=LAT,LON,HEIGHT`"
        raise ConfigError(f"{path}: {fault}; has {', '.join(sorted(radars))}")
    if len(sites) > 1:
        raise ConfigError(f"{path}: must count x_m, y_m, z_m from one place, has {len(sites)} radars")
    if "address" not in texts:
        texts["address"] = tracks
    rows = np.flatnonzero(is_used).tolist()
    return Recording(
        {name: column[rows] for name, column in columns.items()},
        [tracks[i] for i in rows],
        {name: [column[i] for i in rows] for name, column in texts.items()},
        next(iter(sites), None),
        zero,
    )


def _read_comments(path: str) -> tuple[set[tuple[float, float, float]], tuple[float, str]]:
    """The places of radars and the zero of times in the first lines of a file."""
    sites, zero = set(), (0.0, UNKNOWN_ZERO)
    with open(path, encoding="utf-8-sig") as file:
        for line in itertools.takewhile(lambda line: line.startswith("#"), file):
            is_valid = True
            try:
                if match := SITE_LINE.match(line):
                    lat, lon, height = map(float, match.groups())
                    sites.add((lat, lon, height))
                    is_valid = abs(lat) <= 90 and math.isfinite(lon + height)
                if match := ZERO_LINE.match(line):
                    zero = (float(match[1]), match[2])
                    is_valid = math.isfinite(zero[0])
            except ValueError:
                is_valid = False
            if not is_valid:
                fault = "must be as radarsim import writes it, with finite numbers"
                raise ConfigError(f"{path}: {fault}; got {line.rstrip()[:120]!r}")
    return sites, zero


def _finite_median(values: np.ndarray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else math.nan


# ---- least squares ---------------------------------------------------------------------------------------------------
def fit_biases(pairs: MatchedPlots) -> Adjustment:
    """The biases of plots, by robust least squares."""
    reasons = _unobservable_biases(pairs)
    is_used = np.array([not reasons.get(key) for key in BIASES])
    values, sigma = _huber_fit(pairs, is_used)
    for _ in range(MAX_ROUNDS):
        errors, slopes = _linearise(pairs, values)
        step, length = _bias_step(errors, slopes, sigma, _biweight_weights(errors / sigma), is_used)
        values = values + step
        if length < CONVERGENCE_STEP:
            break
    errors, slopes = _linearise(pairs, values)
    # How far biases of 1 move a plot, in the last digits of its numbers: a bias that moves no plot by one is zero.
    movement_per_bias = np.abs(slopes / _smallest_sigmas(pairs)[:, None]).max(axis=(0, 1))
    u, slopes, clusters = errors / sigma, slopes / sigma[:, None], _cluster_numbers(pairs)
    weights = _biweight_weights(u)
    half_widths = _half_widths(u, slopes, clusters, is_used)
    values, half_widths = np.where((np.abs(values) + half_widths) * movement_per_bias > 1, [values, half_widths], 0.0)
    lags = {
        number: _aircraft_lag(u[rows], slopes[rows, :, 3])
        for number, rows in rows_by_name(pairs.path_numbers.tolist()).items()
    }
    biases = [
        Bias(key, math.nan, math.nan, math.nan, reasons[key]) if reasons.get(key) else Bias(key, v, v - h, v + h)
        for key, v, h in zip(BIASES, values.tolist(), half_widths.tolist(), strict=True)
    ]
    outliers = int(((weights == 0) & np.isfinite(u)).any(axis=1).sum())
    return Adjustment(
        tuple(biases), (float(sigma[0]), float(sigma[1])), errors, outliers, len(set(clusters.tolist())), lags
    )


def _linearise(pairs: MatchedPlots, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (n, 2) of range and bearing, NaN where there is none, and their derivatives (n, 2, biases)."""
    range_bias, range_scale, bearing_bias, time_bias = values.tolist()
    states = np.full((len(pairs.t_s), 6), np.nan)
    for number, rows in rows_by_name(pairs.path_numbers.tolist()).items():
        states[rows] = pairs.states(number, pairs.t_s[rows] - time_bias)
    position, velocity = states[:, :3], states[:, 3:]
    errors = range_bearing_offsets(states, pairs.range_m - range_bias, pairs.bearing_rad - bearing_bias)
    r = np.linalg.norm(position, axis=1)
    errors[:, 0] -= range_scale * r
    slopes = np.zeros((len(r), 2, len(BIASES)))
    slopes[:, 0, 0], slopes[:, 0, 1], slopes[:, 1, 2] = 1.0, r, 1.0
    slopes[:, 0, 3] = -(1 + range_scale) * np.einsum("ni,ni->n", position, velocity) / r
    slopes[:, 1, 3] = -(position[:, 0] * velocity[:, 2] - position[:, 2] * velocity[:, 0]) / (
        position[:, 0] ** 2 + position[:, 2] ** 2
    )
    return errors, np.where(np.isfinite(errors)[..., None], slopes, 0.0)


def _huber_fit(pairs: MatchedPlots, is_used: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Biases and σ (2,) of range and bearing by Huber's function, from biases of 0."""
    values = np.zeros(len(BIASES))
    smallest = _smallest_sigmas(pairs)
    for _ in range(MAX_ROUNDS):
        errors, slopes = _linearise(pairs, values)
        sigma = np.array([_robust_sigma(errors[:, k], smallest[k]) for k in range(2)])
        with np.errstate(divide="ignore"):
            weights = np.nan_to_num(np.minimum(1.0, HUBER_LIMIT / np.abs(errors / sigma)))
        step, length = _bias_step(errors, slopes, sigma, weights, is_used)
        values = values + step
        if length < CONVERGENCE_STEP:
            break
    errors, _ = _linearise(pairs, values)
    return values, np.maximum([_biweight_sigma(errors[:, k]) for k in range(2)], smallest)


def _robust_sigma(errors: np.ndarray, smallest: float) -> float:
    finite = errors[np.isfinite(errors)]
    return max(MAD_TO_SIGMA * float(np.median(np.abs(finite))), smallest) if len(finite) else math.inf


def _biweight_sigma(errors: np.ndarray) -> float:
    """σ of normal errors, of which some may be outliers, by the biweight midvariance (Lax 1985, JASA 80, 736)."""
    finite = errors[np.isfinite(errors)]
    limit = 9 * float(np.median(np.abs(finite))) if len(finite) else math.inf
    inner = finite[np.abs(finite) < limit]
    if not len(inner):
        return limit  # there are none, or most are zero
    v = (inner / limit) ** 2
    return math.sqrt(len(finite) * float((inner**2 * (1 - v) ** 4).sum())) / float(((1 - v) * (1 - 5 * v)).sum())


def _biweight_weights(u: np.ndarray) -> np.ndarray:
    return np.where(np.abs(u) < BIWEIGHT_LIMIT, (1 - (u / BIWEIGHT_LIMIT) ** 2) ** 2, 0.0)


def _bias_step(
    errors: np.ndarray, slopes: np.ndarray, sigma: np.ndarray, weights: np.ndarray, is_used: np.ndarray
) -> tuple[np.ndarray, float]:
    """Change of the biases (4,) by weighted least squares, and the largest in standard errors of it alone."""
    design = slopes[..., is_used] * (np.sqrt(weights) / sigma)[..., None]
    target = np.nan_to_num(errors) * np.sqrt(weights) / sigma
    size = np.sqrt((design**2).sum(axis=(0, 1)))
    size[size == 0] = 1.0
    step = np.zeros(len(is_used))
    step[is_used] = np.linalg.lstsq((design / size).reshape(-1, is_used.sum()), target.ravel(), rcond=1e-12)[0] / size
    return step, float(np.abs(step[is_used] * size).max())


def _unobservable_biases(pairs: MatchedPlots) -> dict[str, str]:
    """The biases that the plots cannot determine, and why: from where the targets are, not from what was measured."""
    errors, slopes = _linearise(pairs, np.zeros(len(BIASES)))
    sigma = _plot_sigmas(pairs, errors)
    reasons: dict[str, str] = {}
    if not math.isfinite(sigma[1]):
        reasons["bearing_rad"] = tr("there are no bearings")
    movement, farthest = _largest_movements(pairs, sigma)
    if movement < MIN_MOVEMENT_SIGMAS:
        reasons["time_s"] = tr("the targets hardly move ({distance:.3g} m at most)", distance=farthest)
    design = (slopes / sigma[:, None]).reshape(-1, len(BIASES))
    while True:
        used = [k for k, name in enumerate(BIASES) if name not in reasons]
        columns = design[:, used] / np.linalg.norm(design[:, used], axis=0)
        likeness = {}
        for column_index in (used.index(k) for k in used if BIASES[k] in OPTIONAL_BIASES):
            remaining_columns = np.delete(columns, column_index, axis=1)
            shares = np.linalg.lstsq(remaining_columns, columns[:, column_index], rcond=1e-12)[0]
            # 1 over the variance inflation
            unexplained = float(((columns[:, column_index] - remaining_columns @ shares) ** 2).sum())
            partner = int(np.delete(used, column_index)[np.abs(shares).argmax()])
            likeness[used[column_index]] = (unexplained, partner)
        k = min(likeness, key=likeness.__getitem__, default=-1)
        if k < 0 or likeness[k][0] * MAX_VARIANCE_INFLATION >= 1:
            return reasons
        reasons[BIASES[k]] = _likeness_message(BIASES[k], BIASES[likeness[k][1]], slopes)


def _plot_sigmas(pairs: MatchedPlots, errors: np.ndarray) -> np.ndarray:
    """σ of range and bearing (2,) from differences of successive plots of an aircraft, which biases hardly change.

    Infinite if there are no differences."""
    order = np.lexsort((pairs.t_s, pairs.path_numbers))
    steps = np.diff(errors[order], axis=0)[np.diff(pairs.path_numbers[order]) == 0]
    smallest = _smallest_sigmas(pairs)
    return np.array([_robust_sigma(steps[:, k] / math.sqrt(2), smallest[k]) for k in range(2)])


def _smallest_sigmas(pairs: MatchedPlots) -> np.ndarray:
    return MIN_RELATIVE_SIGMA * np.array([np.median(pairs.range_m), 1.0])


def _largest_movements(pairs: MatchedPlots, sigma: np.ndarray) -> tuple[float, float]:
    """The largest movement of an aircraft in range or bearing, in σ of a plot, and its largest distance moved, m."""
    largest, farthest = 0.0, 0.0
    for number, rows in rows_by_name(pairs.path_numbers.tolist()).items():
        position = pairs.states(number, pairs.t_s[rows])[:, :3]
        r = np.linalg.norm(position, axis=1)
        b = np.unwrap(np.arctan2(position[:, 2], position[:, 0]))
        largest = max(largest, float(np.ptp(r) / sigma[0]), float(np.ptp(b) / sigma[1]))
        farthest = max(farthest, float(np.linalg.norm(np.ptp(position, axis=0))))
    return largest, farthest


def _likeness_message(key: str, partner: str, slopes: np.ndarray) -> str:
    """Why a bias cannot be distinguished from another."""
    speed, r = -slopes[:, 0, 3], slopes[:, 0, 1]
    subject, values, unit = {
        "range_scale, range_m": (tr("ranges"), r / 1e3, "km"),
        "time_s, range_m": (tr("radial speeds"), speed, "m/s"),
        "time_s, bearing_rad": (tr("turns of bearing"), np.degrees(-slopes[:, 1, 3]), "°/s"),
    }.get(f"{key}, {partner}", (tr("ratios of radial speed and range"), speed / np.maximum(r, 1.0), "1/s"))
    lo, hi = np.quantile(values, (0.05, 0.95)).tolist()
    return tr(
        "the {what} are alike ({lo:.3g} to {hi:.3g} {unit}), so that it shows as {other} does, which holds if it is 0",
        **{"what": subject, "lo": lo, "hi": hi, "unit": tr(unit), "other": partner},
    )


def _aircraft_lag(u: np.ndarray, slope: np.ndarray) -> tuple[float, float]:
    """The lag of one aircraft and its σ by Huber's function, from residuals and slopes (n, 2) in σ; NaN where nothing
    moves."""
    is_informative = np.isfinite(u) & (slope != 0)
    u, slope, lag, error = u[is_informative], slope[is_informative], math.nan, math.inf
    for _ in range(MAX_ROUNDS if len(u) else 0):
        residuals = u - slope * np.nan_to_num(lag)
        scale = _robust_sigma(residuals, MIN_RELATIVE_SIGMA)
        weight = np.minimum(1.0, HUBER_LIMIT * scale / np.maximum(np.abs(residuals), MIN_RELATIVE_SIGMA))
        power = float((weight * slope**2).sum())
        lag, error = float((weight * slope * u).sum()) / power, scale / math.sqrt(power)
    return lag, error


def _cluster_numbers(pairs: MatchedPlots) -> np.ndarray:
    """The cluster number of each plot (n,): its aircraft, or a piece of its flight if there are few aircraft."""
    rows_by_aircraft = rows_by_name(pairs.path_numbers.tolist()).values()
    pieces = 1 if len(rows_by_aircraft) >= MIN_AIRCRAFT else math.ceil(MIN_CLUSTERS / len(rows_by_aircraft))
    clusters = np.zeros(len(pairs.t_s), dtype=int)
    parts = (part for rows in rows_by_aircraft for part in np.array_split(rows[np.argsort(pairs.t_s[rows])], pieces))
    for number, part in enumerate(parts):
        clusters[part] = number
    return clusters


def _half_widths(u: np.ndarray, slopes: np.ndarray, clusters: np.ndarray, is_used: np.ndarray) -> np.ndarray:
    """Half the width of each bias's 95 % interval (4,), from residuals (n, 2), NaN where there is none, and slopes
    (n, 2, 4), both in σ."""
    from scipy.stats import t as student

    v = np.where(np.isfinite(u), np.minimum((u / BIWEIGHT_LIMIT) ** 2, 1.0), 1.0)
    mean_slope = np.sqrt(((1 - v) * (1 - 5 * v)).sum(axis=0) / np.maximum(np.isfinite(u).sum(axis=0), 1))
    mean_slope = np.where(mean_slope > 0, mean_slope, 1.0)  # of bearings, where there are none
    design, errors = slopes[..., is_used] * mean_slope[:, None], np.nan_to_num(u) * (1 - v) ** 2 / mean_slope
    size = np.sqrt((design**2).sum(axis=(0, 1)))
    design = design / size
    inverse = np.linalg.inv(np.einsum("nki,nkj->ij", design, design))
    variance, lengths, projections = np.zeros_like(inverse), [], []
    for rows in rows_by_name(clusters.tolist()).values():
        q, basis = np.linalg.qr(design[rows].reshape(-1, len(size)))
        leverage, axes = np.linalg.eigh(np.eye(len(basis)) - basis @ inverse @ basis.T)
        spread = basis.T @ (axes * np.where(leverage > 1e-9, leverage, np.inf) ** -0.5) @ axes.T
        score = spread @ (q.T @ errors[rows].ravel())
        variance += np.outer(score, score)
        influence = spread.T @ inverse
        lengths.append((influence**2).sum(axis=0))
        projections.append(basis.T @ influence)
    length, projection = np.array(lengths), np.array(projections)  # (clusters, biases), (clusters, biases, biases)
    cross_terms = np.einsum("gij,ik,gkj->gj", projection, inverse, projection)
    products = np.einsum("gij,gkj->jik", projection, projection)
    trace = (length - cross_terms).sum(axis=0)
    square = (length**2 - 2 * length * cross_terms).sum(axis=0)
    square += np.einsum("ik,jkl,lm,jmi->j", inverse, products, inverse, products)
    half_widths = np.zeros(len(is_used))
    half_widths[is_used] = student.ppf(0.975, trace**2 / square) * np.sqrt(np.diag(inverse @ variance @ inverse)) / size
    return half_widths
