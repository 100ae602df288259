"""P3's tables of tracks among false plots: tracks, tracking, gates, track_classes."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import statistics
from radarsim.report import tables as common
from radarsim.report.statistics import Z95, Estimate
from radarsim.studies.sonar.clutter.axes import ClutterAxes
from radarsim.studies.sonar.clutter.kernels.counts import (
    DROPPED,
    ENDS_PER_SCAN,
    EXPECTED,
    FAILED,
    FALSE,
    FALSE_FOUND,
    FALSE_KEPT,
    FOUND,
    INSIDE,
    KEPT,
    LOOKED,
    LOST,
    PLOTS,
    TRYING,
    WRONG_PER_PLOT,
)

if TYPE_CHECKING:
    import pandas as pd


def tables(results: Sequence[CaseResult[ClutterAxes]]) -> "dict[str, pd.DataFrame]":
    """The tables of these cases, all of trackers."""
    return {
        "tracks": common.joined([_tracks(result) for result in results], TRACKS),
        "tracking": common.joined([_tracking(result) for result in results], TRACKING),
        "gates": common.joined([_gates(result) for result in results], GATES),
        "track_classes": common.joined([_classes(result) for result in results], CLASSES),
    }


def trackers(result: CaseResult[ClutterAxes]) -> np.ndarray:
    """Filters (n,) that have to find their plots; those given them have no track to lose."""
    return np.flatnonzero([kind != "known" for kind in result.axes.associations])


def per_hour(result: CaseResult[ClutterAxes]) -> float:
    """Scans an hour."""
    return 3600.0 / result.axes.scan_period_s


def false_plots(result: CaseResult[ClutterAxes]) -> float:
    """Mean number of false plots a scan in the whole sector."""
    return result.spec.sensor.false_plots_per_km2 * result.axes.area_m2 / 1e6


# ---- statistics ------------------------------------------------------------------------------------------------------
def poisson(count, exposure) -> Estimate:
    """Rate of a Poisson number over an exposure with its 95 % interval: Garwood's, by Wilson and Hilferty."""
    count = np.asarray(count, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        low = count * np.maximum(1 - 1 / (9 * count) - Z95 / (3 * np.sqrt(count)), 0) ** 3
        high = (count + 1) * (1 - 1 / (9 * (count + 1)) + Z95 / (3 * np.sqrt(count + 1))) ** 3
        return Estimate(count / exposure, np.where(count > 0, low, 0.0) / exposure, high / exposure)


def ratio(sums: np.ndarray, n: int) -> Estimate:
    """Σa/Σb with its 95 % interval from sums (5,) Σa, Σa², Σb, Σb², Σab over n realisations.

    By the spread of a − R b over realisations (the delta method), on the logarithm; with no event at all as a Poisson
    number, and without exposure not-a-number.
    """
    a, aa, b, bb, ab = (float(part) for part in sums)
    if b <= 0:
        return Estimate(np.nan, np.nan, np.nan)
    if a <= 0 or n < 2:
        return Estimate(*(float(part) for part in poisson(a, b)))
    value = a / b
    spread = np.sqrt(max(aa - 2 * value * ab + value**2 * bb, 0.0) * n / (n - 1)) / b
    factor = float(np.exp(statistics.student(n - 1) * spread / value))
    return Estimate(value, value / factor, value * factor)


def mean_of_counts(times: np.ndarray, counts: np.ndarray) -> Estimate:
    """Mean time of events counted at times (K,), with its 95 % interval."""
    n = counts.sum()
    if n < 1:
        return Estimate(np.nan, np.nan, np.nan)
    mean = float(times @ counts / n)
    half = (
        float(statistics.student(n - 1) * np.sqrt((times - mean) ** 2 @ counts / n / max(n - 1, 1)))
        if n > 1
        else np.inf
    )
    return Estimate(mean, mean - half, mean + half)


# ---- tables ----------------------------------------------------------------------------------------------------------
TRACKS = (
    *("case", "filter", "k", "t_s", "n", "confirmed", "confirmed_lo", "confirmed_hi", "exact_confirmed"),
    *("kept", "kept_lo", "kept_hi", "tentative", "lost", "dropped", "tentative_dropped"),
)


def _tracks(result: CaseResult[ClutterAxes]) -> dict:
    """By scan: probability that a track of the target was confirmed by then, and that one is kept.

    And how many of n realisations have a tentative one, lost or dropped a confirmed one, dropped a tentative one.
    """
    chosen = trackers(result)
    counts, K = np.asarray(result.sums["counts"])[chosen], len(result.axes.k)
    n = result.count
    found = statistics.rate(np.cumsum(counts[:, :, FOUND], axis=1), n)
    kept = statistics.rate(counts[:, :, KEPT], n)
    whole = {"tentative": TRYING, "lost": LOST, "dropped": DROPPED, "tentative_dropped": FAILED}
    return {
        **_named(result, np.repeat(chosen, K)),
        "k": np.tile(result.axes.k, len(chosen)),
        "t_s": np.tile(np.asarray(result.axes.t_s, dtype=float), len(chosen)),
        "n": np.full(len(chosen) * K, n),
        **_three("confirmed", found),
        "exact_confirmed": result.axes.exact_confirmed[chosen].ravel(),
        **_three("kept", kept),
        **{name: counts[:, :, place].ravel().astype(np.int64) for name, place in whole.items()},
    }


def _named(result: CaseResult[ClutterAxes], f: np.ndarray) -> dict:
    return {"case": np.full(f.size, result.name, dtype=object), "filter": common.names(result.axes.filters, f)}


def _three(name: str, of: Estimate) -> dict:
    """Value and ends of an interval as columns."""
    return {f"{name}{end}": np.ravel(part).astype(float) for end, part in zip(("", "_lo", "_hi"), of, strict=True)}


TRACKING = (
    *("case", "filter", "association", "gate_probability", "m", "of", "n"),
    *("detection_probability", "false_plots_per_km2", "false_in_gate"),
    *("confirmed", "confirmed_lo", "confirmed_hi", "time_to_confirm_s", "time_lo", "time_hi"),
    *("kept_at_end", "kept_lo", "kept_hi", "lost", "dropped", "ends_per_hour", "ends_lo", "ends_hi"),
    *("life_s", "life_lo", "life_hi", "wrong_share", "wrong_lo", "wrong_hi"),
    *("false_confirmed", "false_confirmed_lo", "false_confirmed_hi", "exact_false_confirmed"),
    *("false_tracks_per_hour", "false_lo", "false_hi", "false_tracks_at_once", "false_life_s"),
)


def _tracking(result: CaseResult[ClutterAxes]) -> dict:
    """One row a tracker: how surely and soon it confirms the target's track, how long it keeps it, its false tracks.

    The life is a track's mean time between ends, over all confirmed tracks' time. false_confirmed is the probability
    that a track begun by a false plot is confirmed; false tracks are counted over the whole sector.
    """
    rows = [_summary(result, f) for f in trackers(result)]
    return {name: np.array([row[name] for row in rows]) if rows else [] for name in TRACKING}


def _summary(result: CaseResult[ClutterAxes], f: int) -> dict:
    one, sensor, n, sums = result.spec.filters[f], result.spec.sensor, result.count, result.sums
    counts, begun, t = sums["counts"][f], sums["begun"][f], np.asarray(result.axes.t_s, dtype=float)
    found = counts[:, FOUND]
    ends = ratio(sums["ratios"][f, ENDS_PER_SCAN], n)
    hourly = Estimate(*(part * per_hour(result) for part in ends))
    false = statistics.rate(begun[:, FALSE_FOUND].sum(), n)
    rate = false_plots(result) * per_hour(result)
    any_false = sensor.false_plots_per_km2 > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        alive = begun[:, FALSE_KEPT].sum()
        life = Estimate(*(3600.0 / np.float64(part) for part in (hourly.value, hourly.hi, hourly.lo)))
        false_life = alive * result.axes.scan_period_s / begun[:, FALSE_FOUND].sum()
        in_gate = counts[:, FALSE].sum() / counts[:, LOOKED].sum()
    exact = result.axes.exact_begun[f].sum()
    m, of = one.m_of_n()
    return {
        **{"case": result.name, "filter": result.axes.filters[f], "association": one.association},
        **{"gate_probability": one.tracker("gate_probability"), "m": m, "of": of, "n": n},
        "detection_probability": sensor.detection_probability,
        "false_plots_per_km2": sensor.false_plots_per_km2,
        "false_in_gate": float(in_gate),
        **_named_three("confirmed", statistics.rate(found.sum(), n)),
        **_named_three("time", mean_of_counts(t, found), "time_to_confirm_s"),
        **_named_three("kept", statistics.rate(counts[-1, KEPT], n), "kept_at_end"),
        **{"lost": int(counts[:, LOST].sum()), "dropped": int(counts[:, DROPPED].sum())},
        **_named_three("ends", hourly, "ends_per_hour"),
        **_named_three("life", life, "life_s"),
        **_named_three("wrong", ratio(sums["ratios"][f, WRONG_PER_PLOT], n), "wrong_share"),
        **_named_three("false_confirmed", false if any_false else Estimate(0.0, 0.0, 0.0)),
        "exact_false_confirmed": float(exact) if any_false else 0.0,
        **_named_three("false", Estimate(*(rate * part for part in false)), "false_tracks_per_hour"),
        "false_tracks_at_once": float(false_plots(result) * alive / n),
        "false_life_s": float(false_life),
    }


def _named_three(name: str, of: Estimate, value: str = "") -> dict:
    return {value or name: float(of.value), f"{name}_lo": float(of.lo), f"{name}_hi": float(of.hi)}


GATES = (
    *("case", "filter", "k", "t_s", "n", "plots", "inside", "inside_lo", "inside_hi", "exact_inside"),
    *("false_in_gate", "false_lo", "false_hi", "exact_false_in_gate"),
)


def _gates(result: CaseResult[ClutterAxes]) -> dict:
    """By scan: the share of the target's plots that lay in the gate, and false plots in it, of n tracks of two plots.

    A filter that is given its plots, and whose model is the target's, has the gate's probability exactly. The expected
    number of false plots is density times area, π γ √|S| times the range, over the gates as they were; a sector's edge
    is not reckoned with.
    """
    counts = np.asarray(result.sums["counts"])
    f, k = np.nonzero(counts[:, :, LOOKED] > 0)
    at = counts[f, k]
    inside = statistics.rate(at[:, INSIDE], at[:, PLOTS])
    false = poisson(at[:, FALSE], at[:, LOOKED])
    exact = np.array([one.tracker("gate_probability") for one in result.spec.filters])[f]
    steady = not getattr(result.spec.target, "fluctuation_mps2", 0.0)
    own = np.array([one.association == "known" and not one.manoeuvre_variance for one in result.spec.filters])[f]
    return {
        **_named(result, f),
        "k": np.asarray(result.axes.k)[k],
        "t_s": np.asarray(result.axes.t_s, dtype=float)[k],
        "n": at[:, LOOKED].astype(np.int64),
        "plots": at[:, PLOTS].astype(np.int64),
        **_three("inside", inside),
        "exact_inside": np.where(own & steady & straight(result), exact, np.nan),
        "false_in_gate": false.value,
        "false_lo": false.lo,
        "false_hi": false.hi,
        "exact_false_in_gate": at[:, EXPECTED] / at[:, LOOKED],
    }


def straight(result: CaseResult[ClutterAxes]) -> bool:
    """Whether range and bearing change at constant rates, as the trackers' model has it."""
    target = result.spec.target
    polar = target.kind == "polynomial" and target.frame == "polar"
    return polar and not any(any(c[2:]) for c in (target.range_m, target.bearing_rad))


CLASSES = (
    *("case", "filter", "threshold", "n_true", "true_called_false", "true_lo", "true_hi"),
    *("n_false", "false_called_true", "false_lo", "false_hi", "bound"),
)


def _classes(result: CaseResult[ClutterAxes]) -> dict:
    """Error rates of calling a track true once its score reaches a threshold, false if it ends before.

    Of the target's first tracks, and of tracks that false plots began. The score is the logarithm of the likelihood
    ratio of all plots in the gate; on false tracks its exponential is a martingale of mean one, so that no more than
    exp(−threshold) of them ever reach the threshold (Ville), whatever the tracker.
    """
    chosen, thresholds = trackers(result), result.axes.thresholds
    scores = np.asarray(result.sums["scores"])[:, chosen]
    n = np.broadcast_to(scores[:, :, -1:], scores[:, :, :-1].shape)
    missed = statistics.rate(n[0] - scores[0, :, :-1], n[0])
    taken = statistics.rate(scores[1, :, :-1], n[1])
    return {
        **_named(result, np.repeat(chosen, len(thresholds))),
        "threshold": np.tile(thresholds, len(chosen)),
        "n_true": n[0].ravel().astype(np.int64),
        **dict(zip(("true_called_false", "true_lo", "true_hi"), _flat(missed), strict=True)),
        "n_false": n[1].ravel().astype(np.int64),
        **dict(zip(("false_called_true", "false_lo", "false_hi"), _flat(taken), strict=True)),
        "bound": np.tile(np.exp(-thresholds), len(chosen)),
    }


def _flat(of: Estimate) -> list[np.ndarray]:
    return [np.ravel(part).astype(float) for part in of]
