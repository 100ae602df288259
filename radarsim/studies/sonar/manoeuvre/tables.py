"""P3's tables on manoeuvres: what detectors see, how soon, thresholds, classes, modes of filters, uses of a track."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import consistency, statistics
from radarsim.report import tables as common
from radarsim.studies.sonar.exact import sigma_acceleration
from radarsim.studies.sonar.manoeuvre import exact
from radarsim.studies.sonar.manoeuvre.axes import ManoeuvreAxes
from radarsim.studies.sonar.manoeuvre.uses import QUANTITIES

if TYPE_CHECKING:
    import pandas as pd

PHASES = np.array(["steady", "manoeuvre", "after"], dtype=object)
EVENTS = np.array(["false alarm", "alarm", "all clear"], dtype=object)  # the first of a phase
JOINT = "joint"
NEAR = "fails: near zero"
NEAR_ZERO = 3.0  # σ within which speed and distances, which cannot be negative, are not of first order


def tables(results: Sequence[CaseResult[ManoeuvreAxes]]) -> "dict[str, pd.DataFrame]":
    """The tables of cases with detectors, filters that answer to manoeuvres, or uses."""
    measured = [result for result in results if result.spec.detectors]
    return {
        "detections": common.joined([_detections(result) for result in measured], DETECTIONS),
        "delays": common.joined([_delays(result) for result in measured], DELAYS),
        "classes": common.joined([_classes(result) for result in measured], CLASSES),
        "thresholds": common.joined([_thresholds(result) for result in measured], THRESHOLDS),
        "modes": common.joined([_modes(result) for result in results if "modes" in result.sums], MODES),
        "uses": common.joined([_uses(result) for result in results if "uses" in result.sums], USES),
    }


def groups(result: CaseResult[ManoeuvreAxes]) -> list[str]:
    """Names of the coordinates, and of all jointly."""
    return [*(name for name, _ in result.axes.coordinates), JOINT]


def _tested(result: CaseResult[ManoeuvreAxes]):
    """Indices (detector, group, threshold, scan), each (n,), of all tests, in this order, and leading columns."""
    tested = np.asarray(result.sums["tested"])
    count = np.array([limits.shape[1] for limits in result.axes.thresholds])
    there = np.arange(result.sums["alarms"].shape[2]) < count[:, None]
    d, g, t, k = np.nonzero((tested[:, :, None] > 0) & there[:, None, :, None])
    return (d, g, t, k), _leading(result, d, g, t) | {
        "k": np.asarray(result.axes.k)[k],
        "t_s": np.asarray(result.axes.t_s, dtype=float)[k],
    }


def _leading(result: CaseResult[ManoeuvreAxes], d: np.ndarray, g: np.ndarray, t: np.ndarray) -> dict[str, np.ndarray]:
    """Columns case, filter (the detector), component, plots, threshold_k, false_alarm_probability (the exact law's)."""
    chosen = result.axes.thresholds
    k = np.array([chosen[i][j, m] for i, j, m in zip(d, g, t, strict=True)])
    freedom = np.where(g == len(groups(result)) - 1, len(groups(result)) - 1, 1)
    return {
        "case": np.full(d.size, result.name, dtype=object),
        "filter": common.names([one.name for one in result.spec.detectors], d),
        "component": common.names(groups(result), g),
        "plots": np.array([one.plots for one in result.spec.detectors], dtype=np.int64)[d],
        "threshold_k": k,
        "false_alarm_probability": exact.false_alarm(k, freedom),
    }


DETECTIONS = (
    *("case", "filter", "component", "plots", "threshold_k", "false_alarm_probability", "k", "t_s", "n"),
    *("phase", "shift", "probability", "lo", "hi", "exact"),
)


def _detections(result: CaseResult[ManoeuvreAxes]) -> dict:
    """Probability of an alarm at each test; `shift` is the mean of â in units of its σ_a, `n` the tests made."""
    axes = result.axes
    at, columns = _tested(result)
    d, g, _, k = at
    n = np.asarray(result.sums["tested"])[d, g, k]
    of = statistics.rate(np.asarray(result.sums["alarms"])[at], n)
    return columns | {
        "n": n.astype(np.int64),
        "phase": PHASES[axes.phase[k]],
        "shift": axes.shifts[d, g, k],
        **dict(zip(("probability", "lo", "hi"), of, strict=True)),
        "exact": axes.exact_alarms[at],
    }


DELAYS = (
    *("case", "filter", "component", "plots", "threshold_k", "false_alarm_probability", "k", "t_s", "n"),
    *("event", "delay_s", "probability", "lo", "hi", "exact", "independent"),
)


def _delays(result: CaseResult[ManoeuvreAxes]) -> dict:
    """Probability that the first event of a phase has come by a scan: false alarm, alarm, end of alarms.

    The delay is counted from when the phase begins. `independent` is what tests independent of one another would give,
    and `exact` the same where they are: overlapping windows have no closed law.
    """
    axes, K = result.axes, len(result.axes.k)
    at, columns = _tested(result)
    d, k = at[0], at[3]
    phase, since = axes.phase, began(result)
    p = np.where(phase == 2, 1 - axes.exact_alarms, axes.exact_alarms)
    first = np.asarray(result.sums["first"])
    reached, law = np.zeros(first.shape), np.full(first.shape, np.nan)
    for part in range(3):
        scans = np.arange(K)[phase == part]
        reached[..., scans] = np.cumsum(first[..., scans], axis=-1)
        law[..., scans] = exact.by_then(np.nan_to_num(p[..., scans]))
    # Where some test of the phase has no known law, neither has the first event.
    unknown = np.isnan(p) & (np.asarray(result.sums["tested"])[:, :, None] > 0)
    law[unknown.any(axis=-1)] = np.nan
    of = statistics.rate(reached[at], result.count)
    return columns | {
        "n": np.full(d.size, result.count, dtype=np.int64),
        "event": EVENTS[phase[k]],
        "delay_s": columns["t_s"] - since[phase[k]],
        **dict(zip(("probability", "lo", "hi"), of, strict=True)),
        "exact": np.where(np.array(axes.independent)[d], law[at], np.nan),
        "independent": law[at],
    }


def began(result: CaseResult[ManoeuvreAxes]) -> np.ndarray:
    """When each phase begins (3,), s from the first plot; not-a-number where there is none."""
    times = result.axes.manoeuvre_s or (np.nan, np.nan)
    return np.array([0.0, *times])


CLASSES = (
    *("case", "filter", "component", "plots", "threshold_k", "false_alarm_probability", "k", "t_s", "n"),
    *("truth", "duration_s", "called_manoeuvring", "error_probability", "lo", "hi", "exact"),
)


def _classes(result: CaseResult[ManoeuvreAxes]) -> dict:
    """A track's class by its alarms: called manoeuvring where there was one, by legs: steady, manoeuvre.

    The error is a steady track called manoeuvring, or a manoeuvring one called steady; the row's scan is the last.
    """
    rows = {name: np.asarray(values) for name, values in _delays(result).items()}
    last = [_last_of(rows, event) for event in EVENTS[:2]]
    picked = np.concatenate(last)
    steady = rows["event"][picked] == EVENTS[0]
    one = {name: values[picked] for name, values in rows.items()}
    wrong = np.where(steady, one["probability"], 1 - one["probability"])
    of = statistics.rate(np.rint(wrong * one["n"]), one["n"])
    return {name: one[name] for name in CLASSES[:9]} | {
        "truth": PHASES[np.where(steady, 0, 1)],
        "duration_s": one["delay_s"],
        "called_manoeuvring": one["probability"],
        **dict(zip(("error_probability", "lo", "hi"), of, strict=True)),
        "exact": np.where(steady, one["exact"], 1 - one["exact"]),
    }


def _last_of(rows: dict, event: str) -> np.ndarray:
    """Places of the last rows of an event, one for each detector, component and threshold, in order."""
    at = np.flatnonzero(rows["event"] == event)
    keys = [tuple(rows[name][i] for name in ("filter", "component", "threshold_k")) for i in at]
    return np.array(sorted(dict(zip(keys, at, strict=True)).values()), dtype=np.int64)


THRESHOLDS = (
    *("case", "filter", "component", "unit", "plots", "threshold_k", "false_alarm_probability", "no_alarm_probability"),
    *("sigma_acceleration", "threshold_acceleration", "threshold_to_plot_variance"),
    *("acceleration_for_50_percent", "acceleration_for_68_percent", "acceleration_for_90_percent"),
)


def _thresholds(result: CaseResult[ManoeuvreAxes]) -> dict:
    """Thresholds of each detector with whole windows: false alarms by the χ² law, and what acceleration they stand for.

    `threshold_to_plot_variance` is k σ_a²/σ², in 1/s⁴: the k of the print, which compares with the plot's variance.
    """
    axes = result.axes
    d, g, t = (np.array(one, dtype=np.int64) for one in zip(*_every_threshold(axes.thresholds), strict=True))
    columns = _leading(result, d, g, t)
    k, n, joint = columns["threshold_k"], columns["plots"], g == len(groups(result)) - 1
    scale = np.append(axes.sigma, np.nan)[g]
    spread = np.where(joint, np.nan, sigma_acceleration(n.astype(float), axes.scan_period_s))
    reach = {
        f"acceleration_for_{percent}_percent": scale * spread * [exact.shift_for(percent / 100, one) for one in k]
        for percent in (50, 68, 90)
    }
    units = [f"{unit}/s2" for _, unit in axes.coordinates]
    return (
        columns
        | reach
        | {
            "unit": common.names([*units, ""], g),
            "no_alarm_probability": 1 - columns["false_alarm_probability"],
            "sigma_acceleration": scale * spread,
            "threshold_acceleration": np.sqrt(k) * scale * spread,
            "threshold_to_plot_variance": k * spread**2,
        }
    )


def _every_threshold(thresholds: Sequence[np.ndarray]) -> list[tuple[int, int, int]]:
    return [(d, g, t) for d, limits in enumerate(thresholds) for g, t in np.ndindex(*limits.shape)]


MODES = ("case", "filter", "component", "k", "t_s", "n", "probability", "lo", "hi", "memory_plots")


def _modes(result: CaseResult[ManoeuvreAxes]) -> dict:
    """Mean probability of a manoeuvre that a filter lives by, and the mean number of plots that it rests on.

    Of an adaptive filter the share of realisations in its manoeuvring mode; of an imm that of the second model.
    """
    axes = result.axes
    sums = np.asarray(result.sums["modes"])
    answers = np.array([f.kind in ("adaptive", "imm") for f in result.spec.filters])
    f, c, k = np.nonzero(np.broadcast_to(answers[:, None, None], (len(answers), sums.shape[2], sums.shape[1])))
    total, square, plots = np.moveaxis(sums[f, k, c], -1, 0)
    of = statistics.probability(total, square, result.count)
    counted = np.array([f.kind == "adaptive" for f in result.spec.filters])[f]
    return {
        "case": np.full(f.size, result.name, dtype=object),
        "filter": common.names(axes.filters, f),
        "component": common.names([name for name, _ in axes.coordinates], c),
        "k": np.asarray(axes.k)[k],
        "t_s": np.asarray(axes.t_s, dtype=float)[k],
        "n": np.full(f.size, result.count, dtype=np.int64),
        **dict(zip(("probability", "lo", "hi"), of, strict=True)),
        "memory_plots": np.where(counted, plots / result.count, np.nan),
    }


USES = (
    *("case", "filter", "component", "unit", "k", "t_s", "n"),
    *("true_value", "bias", "sigma", "sigma_lo", "sigma_hi", "believed_sigma", "ratio", "ratio_lo", "ratio_hi"),
    *("distance_in_sigma", "first_order"),
)


def _uses(result: CaseResult[ManoeuvreAxes]) -> dict:
    """Course, speed, predicted position, closest approach: error about the truth beside σ from the track's covariance.

    believed_sigma is the root of the mean first-order variance, ratio the measured σ over it. `distance_in_sigma`
    tells how many believed σ speed or closest approach lie from zero, beyond which they cannot go: within three the
    first order fails, for the course and the time of the closest approach with them.
    """
    axes = result.axes
    sums = np.asarray(result.sums["uses"])
    f, u, a = np.nonzero(np.moveaxis(sums[..., 0] > 0, 1, 2))
    n, first, square, fourth, spread = np.moveaxis(sums[f, a, u], -1, 0)
    of = statistics.root_mean_square(square, fourth, n)
    believed, true = np.sqrt(spread / n), axes.uses.true[a, u]
    away = _distance(sums, axes.uses.true, axes.uses.closing_mps)[f, u, a]
    compared = consistency.ratio_columns(of, believed)
    verdict = np.select(
        [away < NEAR_ZERO, compared["ratio_lo"] > 1.05, compared["ratio_hi"] < 0.95],
        [NEAR, "error larger", "error smaller"],
        "holds within 5 %",
    )
    k = axes.uses.at[a]
    return {
        "case": np.full(f.size, result.name, dtype=object),
        "filter": common.names(axes.filters, f),
        "component": common.names([name for name, _ in QUANTITIES], u),
        "unit": common.names([unit for _, unit in QUANTITIES], u),
        "k": np.asarray(axes.k)[k],
        "t_s": np.asarray(axes.t_s, dtype=float)[k],
        "n": n.astype(np.int64),
        "true_value": true,
        "bias": first / n,
        "sigma_lo": of.lo,
        "sigma_hi": of.hi,
        **compared,
        "distance_in_sigma": away,
        "first_order": verdict.astype(object),
    }


def _distance(sums: np.ndarray, true: np.ndarray, closing: np.ndarray) -> np.ndarray:
    """Distance from zero (F, U, A), in believed σ, of what each quantity hangs on; infinite for positions.

    The closest approach hangs on its distance and on the relative speed `closing` (A,), known as well as the speed.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        believed = np.sqrt(sums[..., 4] / sums[..., 0])
        speed, relative = true[:, 1] / believed[..., 1], closing / believed[..., 1]
        cpa = true[:, 4] / believed[..., 4]
    far = np.full_like(speed, np.inf)
    return np.stack([speed, speed, far, far, np.minimum(cpa, relative), relative], axis=1)
