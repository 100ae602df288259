"""Tables of trackers among false plots (P3).

docs/sonar_clutter.md says what confirmed, tentative, kept, lost and dropped mean."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import rare, statistics
from radarsim.report import tables as common
from radarsim.report.row_notes import notes_where
from radarsim.report.statistics import Z95, Estimate, Values
from radarsim.report.tables import Columns, leading, of_rows, stacked
from radarsim.studies.sonar.clutter.filters import ClutterAxes
from radarsim.studies.sonar.clutter.kernels import tracker as at
from radarsim.studies.sonar.clutter.kernels.rare import DROPPED, DROPPED_AFTER, KINDS, LOST, LOST_AFTER

if TYPE_CHECKING:
    import pandas as pd

table = common.Tables()
FALSE = "false track"
ENDED = "target's track ended"
PART = 0.05  # of a rate: what is less does not decide whether its interval holds
HOW = {"target's track dropped": [DROPPED, DROPPED_AFTER], "target's track lost": [LOST, LOST_AFTER]}
BESIDE = [DROPPED_AFTER, LOST_AFTER]


def trackers(result: CaseResult[ClutterAxes]) -> np.ndarray:
    """Indices (n,) of the filters that have to find their plots; the others cannot lose a track."""
    return np.flatnonzero([kind != "known" for kind in result.axes.associations])


def per_hour(result: CaseResult[ClutterAxes]) -> float:
    """Scans per hour."""
    return 3600.0 / result.axes.scan_period_s


def false_plots(result: CaseResult[ClutterAxes]) -> float:
    """Mean number of false plots a scan in the whole sector."""
    return result.spec.sensor.false_plots_per_km2 * result.axes.area_m2 / 1e6


def held(result: CaseResult[ClutterAxes], at: tuple[Any, ...]) -> rare.Counted:
    """Tracks begun by false plots that were held for at least so many scans, by their weights; at filter and scan."""
    return rare.Counted(*np.moveaxis(result.sums["held"][at], -1, 0))


def drawn(result: CaseResult[ClutterAxes], f: int | np.ndarray) -> rare.Drawn:
    """How the tracks of filter f that false plots begin were drawn, where false tracks are rare."""
    return rare.Drawn(result.count, *np.moveaxis(result.sums["drawn"][f], -1, 0))


def false_tracks(result: CaseResult[ClutterAxes], f: int) -> tuple[Estimate, np.ndarray, np.ndarray]:
    """The probability that a track begun by a false plot is confirmed; scans with a confirmed one, and confirmed ones.
    The last two count all realisations; where false tracks are rare, by their weights."""
    if "held" not in result.sums:
        begun = result.sums["begun"][f]
        alive, found = begun[:, at.FALSE_KEPT].sum(), begun[:, at.FALSE_FOUND].sum()
        return statistics.rate(found, result.count), alive, found
    confirmed = held(result, (f, 0))
    return rare.rate(confirmed, drawn(result, f)), held(result, (f,)).weight.sum(), confirmed.weight


# ---- statistics ------------------------------------------------------------------------------------------------------
def poisson(count: Values, exposure: Values) -> Estimate:
    """Rate of a Poisson number over an exposure with Garwood's 95 % interval, approximated by Wilson and Hilferty."""
    count = np.asarray(count, dtype=float)
    with np.errstate(divide="ignore", invalid="ignore"):
        low = count * np.maximum(1 - 1 / (9 * count) - Z95 / (3 * np.sqrt(count)), 0) ** 3
        high = (count + 1) * (1 - 1 / (9 * (count + 1)) + Z95 / (3 * np.sqrt(count + 1))) ** 3
        return Estimate(count / exposure, np.where(count > 0, low, 0.0) / exposure, high / exposure)


def ratio(sums: np.ndarray, n: int) -> Estimate:
    """Σa/Σb with its 95 % interval from sums (5,) Σa, Σa², Σb, Σb², Σab over n realisations. The interval is that of
    the logarithm, from the spread of a − R b over realisations (the delta method). Without any event it is that of a
    Poisson number; without exposure it is NaN."""
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
@table("tracks")
def _tracks(result: CaseResult[ClutterAxes]) -> Columns:
    """By scan: tracks of the target.

    confirmed ±: share of realisations that have confirmed one by then
    kept ±: share that have a confirmed one
    tentative: number of realisations that have a tentative one
    lost, dropped, tentative_dropped: number that have lost or dropped a confirmed one, or dropped a tentative one
    """
    chosen, K, n = trackers(result), len(result.axes.k), result.count
    counts = np.asarray(result.sums["counts"])[chosen]
    shown = {"tentative": at.TRYING, "lost": at.LOST, "dropped": at.DROPPED, "tentative_dropped": at.FAILED}
    return {
        **leading(result, np.repeat(chosen, K), np.tile(np.arange(K), len(chosen))),
        "n": np.full(len(chosen) * K, n),
        "confirmed": statistics.rate(np.cumsum(counts[:, :, at.FOUND], axis=1).ravel(), n),
        "exact_confirmed": result.axes.exact_confirmed[chosen].ravel(),
        "kept": statistics.rate(counts[:, :, at.KEPT].ravel(), n),
        **{name: counts[:, :, place].ravel().astype(np.int64) for name, place in shown.items()},
    }


@table("tracking")
def _tracking(result: CaseResult[ClutterAxes]) -> Columns:
    """One row a tracker: how surely and soon it confirms the target's track, how long it keeps it, its false tracks.

    Where false tracks are sought (key `rare`), these are by the weights of `rare.csv`.

    association, gate_probability: rule of association and probability of the gate
    m, of: the tracker confirms with m plots of so many scans
    detection_probability: of the target's plots
    false_plots_per_km2 [1/km²]: density of false plots a scan
    false_in_gate: mean number of false plots in the gate a scan
    confirmed ±: share of realisations that confirm a track of the target
    time_to_confirm_s ± time: mean time until then
    kept_at_end ± kept: share that have it at the last scan
    lost, dropped: number of confirmed tracks of the target that are lost or dropped
    ends_per_hour ± ends [1/h]: rate at which confirmed tracks of the target end
    life_s ± life: mean time between such ends, over the time of all confirmed tracks
    wrong_share ± wrong: share of the plots in the target's track that are not the target's
    false_confirmed ±: probability that a track begun by a false plot is confirmed
    false_tracks_per_hour ± false [1/h]: rate of confirmed false tracks over the sector
    false_tracks_at_once, false_life_s: mean number of these at a time, and mean life of one
    """
    return of_rows([_summary(result, f) for f in trackers(result)])


def _summary(result: CaseResult[ClutterAxes], f: int) -> dict[str, Any]:
    tracker, sensor, n = result.spec.filters[f], result.spec.sensor, result.count
    counts, ratios = (result.sums[name][f] for name in ("counts", "ratios"))
    found, (false, alive, false_found) = counts[:, at.FOUND], false_tracks(result, f)
    ends_per_hour = Estimate(*(part * per_hour(result) for part in ratio(ratios[at.ENDS_PER_SCAN], n)))
    any_false = sensor.false_plots_per_km2 > 0
    false_per_hour = Estimate(*(false_plots(result) * per_hour(result) * part for part in false))
    with np.errstate(divide="ignore", invalid="ignore"):
        life = Estimate(
            *(3600.0 / np.float64(part) for part in (ends_per_hour.value, ends_per_hour.hi, ends_per_hour.lo))
        )
        false_life = alive * result.axes.scan_period_s / false_found
        in_gate = counts[:, at.FALSE].sum() / counts[:, at.LOOKED].sum()
    return {
        **{"case": result.name, "filter": result.axes.filters[f], "association": tracker.association},
        **{"gate_probability": tracker.gate_probability, "m": tracker.rule.m, "of": tracker.rule.n, "n": n},
        "detection_probability": sensor.detection_probability,
        "false_plots_per_km2": sensor.false_plots_per_km2,
        "false_in_gate": in_gate,
        "confirmed": statistics.rate(found.sum(), n),
        "time_to_confirm_s|time": mean_of_counts(np.asarray(result.axes.t_s, dtype=float), found),
        "kept_at_end|kept": statistics.rate(counts[-1, at.KEPT], n),
        **{"lost": int(counts[:, at.LOST].sum()), "dropped": int(counts[:, at.DROPPED].sum())},
        "ends_per_hour|ends": ends_per_hour,
        "life_s|life": life,
        "wrong_share|wrong": ratio(ratios[at.WRONG_PER_PLOT], n),
        "false_confirmed": false if any_false else Estimate(0.0, 0.0, 0.0),
        "exact_false_confirmed": result.axes.exact_begun[f].sum() if any_false else 0.0,
        "false_tracks_per_hour|false": false_per_hour,
        "false_tracks_at_once": false_plots(result) * alive / n,
        "false_life_s": false_life,
    }


@table("gates")
def _gates(result: CaseResult[ClutterAxes]) -> Columns:
    """By scan, the gates of n tracks of two plots or more.

    The exact share, the gate's probability, holds for a filter that knows the target's plots and has the target's
    model. The expected number of false plots is density times area, π γ √|S| times the range, over the gates as they
    were, as far as these lie within the sector.

    plots: number of the target's plots
    inside ±: share of these in the gate
    false_in_gate ± false: mean number of false plots in it
    """
    counts, filters = np.asarray(result.sums["counts"]), result.spec.filters
    f, k = np.nonzero(counts[:, :, at.LOOKED] > 0)
    rows = counts[f, k]
    gate = np.array([one.gate_probability for one in filters])
    matched = np.array([one.association == "known" and not one.manoeuvre_variance for one in filters])
    exact = np.where(matched & straight(result) & (not result.spec.target.fluctuation_mps2), gate, np.nan)
    return {
        **leading(result, f, k),
        "n": rows[:, at.LOOKED].astype(np.int64),
        "plots": rows[:, at.PLOTS].astype(np.int64),
        "inside": statistics.rate(rows[:, at.INSIDE], rows[:, at.PLOTS]),
        "exact_inside": exact[f],
        "false_in_gate|false": poisson(rows[:, at.FALSE], rows[:, at.LOOKED]),
        "exact_false_in_gate": rows[:, at.EXPECTED] / rows[:, at.LOOKED],
    }


def straight(result: CaseResult[ClutterAxes]) -> bool:
    """Whether range and bearing change at constant rates, as the trackers' model assumes."""
    target = result.spec.target
    polar = target.kind == "polynomial" and target.frame == "polar"
    return polar and not any(any(c[2:]) for c in (target.range_m, target.bearing_rad))


@table("track_classes")
def _classes(result: CaseResult[ClutterAxes]) -> Columns:
    """Tracks called true once their score reaches a threshold, false if they end before.

    The target's first tracks, and those that false plots began, where these are sought the plain ones alone. The score
    is the logarithm of the likelihood ratio of all plots in the gate. For false tracks its exponential is a martingale
    of mean one, so that at most exp(−threshold) of them ever reach the threshold (Ville), for any tracker.

    threshold: least score of a track called true
    n_true, n_false: number of true and of false tracks
    true_called_false ± true: share of the true ones called false
    false_called_true ± false: share of the false ones called true
    bound: the latter is at most, exp(−threshold)
    """
    chosen, thresholds = trackers(result), result.axes.thresholds
    scores = np.asarray(result.sums["scores"])[:, chosen]
    true, false = scores[:, :, :-1].reshape(2, -1)
    n_true, n_false = np.broadcast_to(scores[:, :, -1:], scores[:, :, :-1].shape).reshape(2, -1)
    return {
        **leading(result, np.repeat(chosen, len(thresholds))),
        "threshold": np.tile(thresholds, len(chosen)),
        "n_true": n_true.astype(np.int64),
        "true_called_false|true": statistics.rate(n_true - true, n_true),
        "n_false": n_false.astype(np.int64),
        "false_called_true|false": statistics.rate(false, n_false),
        "bound": np.tile(np.exp(-thresholds), len(chosen)),
    }


@table.whole("rare")
def _rare(results: Sequence[CaseResult[ClutterAxes]]) -> "pd.DataFrame | None":
    """That a track begun by a false plot is confirmed, or how the target's track ends, by tracker.

    Where false tracks are sought: that one is confirmed (`event` false track, k = 1), and that it is held to its k-th
    scan, `t_s` after the confirmation (false track held). Where ended tracks are: that the first confirmed track of the
    target has ended by each scan (target's track ended; `sought` by the last one), and by the last one how: target's
    track dropped, target's track lost; of further realisations, so that no other table changes by that.
    """
    made = {"held": _rare_false, "ended": _rare_ends}
    return rare.table([rows(one) for one in results for name, rows in made.items() if name in one.sums])


def _rare_false(result: CaseResult[ClutterAxes]) -> dict[str, Any]:
    chosen = trackers(result)
    shown = held(result, (chosen,)).number > 0
    shown[:, 0] = True
    row, k = np.nonzero(shown)
    f, sought = chosen[row], k == 0
    rows = rare.rows(leading(result, f, k), f"{FALSE} held", sought, held(result, (f, k)), drawn(result, f))
    return {**rows, "event": np.where(sought, FALSE, rows["event"])}


def _rare_ends(result: CaseResult[ClutterAxes]) -> dict[str, Any]:
    return stacked([_ended(result, f) for f in trackers(result)])


def _ended(result: CaseResult[ClutterAxes], f: int) -> dict[str, Any]:
    by_scan, last = np.cumsum(result.sums["ended"][f], axis=0), len(result.axes.k) - 1
    ended = by_scan.sum(axis=1)
    k = np.flatnonzero((ended[:, 2] > 0) | (np.arange(last + 1) == last))
    drawn, whole = rare.Drawn(result.count, *result.sums["ended_drawn"][f]), rare.Counted(*ended[k].T)
    curve = rare.rows(leading(result, np.full(len(k), f), k), ENDED, k == last, whole, drawn)
    curve["note"] = ends_note(drawn, by_scan[k], false_plots(result) > 0)
    label = leading(result, np.array([f]), np.array([last]))
    made = [curve]
    for how, kinds in HOW.items():
        own = rare.Counted(*by_scan[last, kinds].sum(axis=0)[:, None])
        rows = rare.rows(label, how, np.array([False]), own, drawn)
        made.append(rows | {"note": ends_note(drawn, by_scan[[last]], false_plots(result) > 0, kinds)})
    return stacked(made)


def ends_note(
    drawn: rare.Drawn, ended: np.ndarray, among_false: bool, kinds: Sequence[int] = range(KINDS)
) -> np.ndarray:
    """Notes (n,) on rates of ends of some kinds, from sums (n, KINDS, 4): of all or a part that matters.

    Runs of misses have equal weights, and many; the few tracks that end by far plots, or by false ones beside the
    target's, have large ones, which the whole does not show while they are few. A part matters where it may be over a
    share of PART, by its interval; the last one does anyhow, since it is small where those are missing. among_false:
    whether there are false plots."""
    whole = rare.Counted(*ended[:, list(kinds)].sum(axis=1).T)
    said, rate = [whole], rare.rate(whole, drawn).value
    parts = [(own, PART) for own in HOW.values() if len(own) < len(kinds)]
    parts += [([kind for kind in kinds if kind in BESIDE], 0.0)] if among_false else []
    for own_kinds, least in parts:
        part = rare.Counted(*ended[:, own_kinds].sum(axis=1).T)
        matters = rare.rate(part, drawn).hi > least * rate
        said.append(rare.Counted(*(np.where(matters, own, of) for own, of in zip(part, whole, strict=True))))
    own_note, any_note = rare.note(drawn, whole), rare.note(drawn, *said)
    in_part = notes_where(any_note != "", rare.IN_PART)
    return np.where(own_note != "", own_note, in_part)


tables = table.made
