"""Tables of trackers among false plots.

docs/sonar_clutter.md says what confirmed, tentative, kept, lost and dropped mean."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import rare_events, statistics
from radarsim.report import tables as common
from radarsim.report.row_notes import notes_where
from radarsim.report.statistics import Estimate
from radarsim.report.tables import Columns, columns_from_rows, label_columns, stack_columns
from radarsim.studies.sonar.clutter.axes import ClutterAxes
from radarsim.studies.sonar.clutter.intervals import mean_event_time, poisson_rate, ratio_of_sums
from radarsim.studies.sonar.clutter.kernels import track_sums
from radarsim.studies.sonar.clutter.kernels.rare_ends import DROPPED, DROPPED_AFTER, END_KINDS, LOST, LOST_AFTER

if TYPE_CHECKING:
    import pandas as pd


table = common.TableMakers()
FALSE_TRACK_EVENT = "false track"
ENDED_TRACK_EVENT = "target's track ended"
MIN_SHARE = 0.05  # of a rate: a smaller part of it does not decide whether its interval holds
KINDS_BY_EVENT = {"target's track dropped": [DROPPED, DROPPED_AFTER], "target's track lost": [LOST, LOST_AFTER]}
BESIDE_KINDS = [DROPPED_AFTER, LOST_AFTER]


def tracker_indices(result: CaseResult[ClutterAxes]) -> np.ndarray:
    """Indices (n,) of the filters that have to find their plots; the others cannot lose a track."""
    return np.flatnonzero([kind != "known" for kind in result.axes.associations])


def scans_per_hour(result: CaseResult[ClutterAxes]) -> float:
    """Scans per hour."""
    return 3600.0 / result.axes.scan_period_s


def mean_false_plots(result: CaseResult[ClutterAxes]) -> float:
    """Mean number of false plots per scan in the whole sector."""
    return result.spec.sensor.false_plots_per_km2 * result.axes.area_m2 / 1e6


def held_tracks(result: CaseResult[ClutterAxes], index: tuple[Any, ...]) -> rare_events.EventWeights:
    """Weighted numbers of tracks that false plots began and that lived for 1 … K scans; index of filter and scan."""
    return rare_events.EventWeights(*np.moveaxis(result.sums["held"][index], -1, 0))


def sampling_weights(result: CaseResult[ClutterAxes], f: int | np.ndarray) -> rare_events.SamplingWeights:
    """The sampling weights of tracks of filter f that false plots begin, where false tracks are rare."""
    return rare_events.SamplingWeights(result.count, *np.moveaxis(result.sums["drawn"][f], -1, 0))


def false_track_rates(result: CaseResult[ClutterAxes], f: int) -> tuple[Estimate, np.ndarray, np.ndarray]:
    """The probability that a false plot's track is confirmed, and the numbers of scans with one and of confirmations.

    The numbers are those of all realisations; where false tracks are rare, weighted."""
    if "held" not in result.sums:
        begun = result.sums["begun"][f]
        alive, newly_confirmed = (
            begun[:, track_sums.FALSE_CONFIRMED].sum(),
            begun[:, track_sums.FALSE_NEWLY_CONFIRMED].sum(),
        )
        return statistics.rate(newly_confirmed, result.count), alive, newly_confirmed
    confirmed = held_tracks(result, (f, 0))
    return (
        rare_events.event_rate(confirmed, sampling_weights(result, f)),
        held_tracks(result, (f,)).weight.sum(),
        confirmed.weight,
    )


@table("tracks")
def _tracks(result: CaseResult[ClutterAxes]) -> Columns:
    """By scan: tracks of the target.

    confirmed_share ±: realisations that have confirmed one by then
    kept_share ±: those that have a confirmed one
    n_tentative: number of realisations that have a tentative one
    n_lost, n_dropped, n_tentative_dropped: number that have lost or dropped a confirmed one, or dropped a tentative one
    """
    filter_indices, K, n = tracker_indices(result), len(result.axes.k), result.count
    counts = np.asarray(result.sums["counts"])[filter_indices]
    kinds_by_column = {
        "n_tentative": track_sums.TENTATIVE_COUNT,
        "n_lost": track_sums.LOST_COUNT,
        "n_dropped": track_sums.DROPPED_COUNT,
        "n_tentative_dropped": track_sums.TENTATIVE_DROPPED_COUNT,
    }
    return {
        **label_columns(result, np.repeat(filter_indices, K), np.tile(np.arange(K), len(filter_indices))),
        "n": np.full(len(filter_indices) * K, n),
        "confirmed_share": statistics.rate(
            np.cumsum(counts[:, :, track_sums.FIRST_CONFIRMED_COUNT], axis=1).ravel(), n
        ),
        "exact_confirmed_share": result.axes.exact_confirmed[filter_indices].ravel(),
        "kept_share": statistics.rate(counts[:, :, track_sums.CONFIRMED_COUNT].ravel(), n),
        **{name: counts[:, :, kind].ravel().astype(np.int64) for name, kind in kinds_by_column.items()},
    }


@table("tracking")
def _tracking(result: CaseResult[ClutterAxes]) -> Columns:
    """One row a tracker: how surely and soon it confirms the target's track, how long it keeps it, its false tracks.

    Where false tracks are sought (key `rare`), these are by the weights of `rare.csv`.

    association, gate_probability: rule of association and probability of the gate
    confirm_plots, confirm_scans: plots that confirm a track, and scans among which they must be
    detection_probability: of the target's plots
    false_plots_per_km2 [1/km²]: density of false plots a scan
    false_in_gate: mean number of false plots in the gate a scan
    confirmed_share ±: realisations that confirm a track of the target
    time_to_confirm_s ±: mean time until then
    kept_at_end_share ±: those that have it at the last scan
    n_lost, n_dropped: number of confirmed tracks of the target that are lost or dropped
    ends_per_hour ± [1/h]: rate at which confirmed tracks of the target end
    life_s ±: mean time between such ends, over the time of all confirmed tracks
    wrong_share ±: plots in the target's track that are not the target's
    false_confirmed_share ±: tracks begun by a false plot that are confirmed
    false_tracks_per_hour ± [1/h]: rate of confirmed false tracks over the sector
    false_tracks_at_once, false_life_s: mean number of these at a time, and mean life of one
    """
    return columns_from_rows([_summary(result, f) for f in tracker_indices(result)])


def _summary(result: CaseResult[ClutterAxes], f: int) -> dict[str, Any]:
    member, sensor, n = result.spec.filters[f], result.spec.sensor, result.count
    counts, ratios = (result.sums[name][f] for name in ("counts", "ratios"))
    first_confirmed, (false, alive, false_found) = (
        counts[:, track_sums.FIRST_CONFIRMED_COUNT],
        false_track_rates(result, f),
    )
    ends_per_hour = Estimate(
        *(rate * scans_per_hour(result) for rate in ratio_of_sums(ratios[track_sums.ENDS_PER_SCAN], n))
    )
    any_false = sensor.false_plots_per_km2 > 0
    false_per_hour = Estimate(*(mean_false_plots(result) * scans_per_hour(result) * rate for rate in false))
    with np.errstate(divide="ignore", invalid="ignore"):
        life = Estimate(
            *(3600.0 / np.float64(rate) for rate in (ends_per_hour.value, ends_per_hour.hi, ends_per_hour.lo))
        )
        false_life = alive * result.axes.scan_period_s / false_found
        in_gate = counts[:, track_sums.FALSE_IN_GATE_COUNT].sum() / counts[:, track_sums.GATE_COUNT].sum()
    return {
        **{"case": result.name, "filter": result.axes.filters[f], "association": member.association},
        **{
            "gate_probability": member.gate_probability,
            "confirm_plots": member.rule.m,
            "confirm_scans": member.rule.n,
            "n": n,
        },
        "detection_probability": sensor.detection_probability,
        "false_plots_per_km2": sensor.false_plots_per_km2,
        "false_in_gate": in_gate,
        "confirmed_share": statistics.rate(first_confirmed.sum(), n),
        "time_to_confirm_s": mean_event_time(np.asarray(result.axes.t_s, dtype=float), first_confirmed),
        "kept_at_end_share": statistics.rate(counts[-1, track_sums.CONFIRMED_COUNT], n),
        **{
            "n_lost": int(counts[:, track_sums.LOST_COUNT].sum()),
            "n_dropped": int(counts[:, track_sums.DROPPED_COUNT].sum()),
        },
        "ends_per_hour": ends_per_hour,
        "life_s": life,
        "wrong_share": ratio_of_sums(ratios[track_sums.WRONG_PER_PLOT], n),
        "false_confirmed_share": false if any_false else Estimate(0.0, 0.0, 0.0),
        "exact_false_confirmed_share": result.axes.exact_begun[f].sum() if any_false else 0.0,
        "false_tracks_per_hour": false_per_hour,
        "false_tracks_at_once": mean_false_plots(result) * alive / n,
        "false_life_s": false_life,
    }


@table("gates")
def _gates(result: CaseResult[ClutterAxes]) -> Columns:
    """By scan, the gates of n tracks of two plots or more.

    The exact share, the gate's probability, holds for a filter that knows the target's plots and has the target's
    model. The expected number of false plots is density times area, π γ √|S| times the range, over the gates as they
    were, as far as these lie within the sector.

    plots: number of the target's plots
    in_gate_share ±: those of them that are in the gate
    false_in_gate ±: mean number of false plots in it
    """
    counts, filters = np.asarray(result.sums["counts"]), result.spec.filters
    f, k = np.nonzero(counts[:, :, track_sums.GATE_COUNT] > 0)
    rows = counts[f, k]
    gate = np.array([member.gate_probability for member in filters])
    matched = np.array([member.association == "known" and not member.manoeuvre_variance for member in filters])
    exact = np.where(matched & has_straight_course(result) & (not result.spec.target.fluctuation_mps2), gate, np.nan)
    return {
        **label_columns(result, f, k),
        "n": rows[:, track_sums.GATE_COUNT].astype(np.int64),
        "plots": rows[:, track_sums.TARGET_PLOT_COUNT].astype(np.int64),
        "in_gate_share": statistics.rate(
            rows[:, track_sums.PLOTS_IN_GATE_COUNT], rows[:, track_sums.TARGET_PLOT_COUNT]
        ),
        "exact_in_gate_share": exact[f],
        "false_in_gate": poisson_rate(rows[:, track_sums.FALSE_IN_GATE_COUNT], rows[:, track_sums.GATE_COUNT]),
        "exact_false_in_gate": rows[:, track_sums.EXPECTED_FALSE_COUNT] / rows[:, track_sums.GATE_COUNT],
    }


def has_straight_course(result: CaseResult[ClutterAxes]) -> bool:
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
    true_called_false_share ±: true tracks called false
    false_called_true_share ±: false tracks called true
    false_called_true_bound: upper bound of this share, exp(−threshold)
    """
    filter_indices, thresholds = tracker_indices(result), result.axes.thresholds
    scores = np.asarray(result.sums["scores"])[:, filter_indices]
    true, false = scores[:, :, :-1].reshape(2, -1)
    n_true, n_false = np.broadcast_to(scores[:, :, -1:], scores[:, :, :-1].shape).reshape(2, -1)
    return {
        **label_columns(result, np.repeat(filter_indices, len(thresholds))),
        "threshold": np.tile(thresholds, len(filter_indices)),
        "n_true": n_true.astype(np.int64),
        "true_called_false_share": statistics.rate(n_true - true, n_true),
        "n_false": n_false.astype(np.int64),
        "false_called_true_share": statistics.rate(false, n_false),
        "false_called_true_bound": np.tile(np.exp(-thresholds), len(filter_indices)),
    }


@table.add_of_all_cases("rare")
def _rare(results: Sequence[CaseResult[ClutterAxes]]) -> "pd.DataFrame | None":
    """That a track begun by a false plot is confirmed, or how the target's track ends, by tracker.

    Where false tracks are sought: that one is confirmed (`event` false track, k = 1), and that it is held to its k-th
    scan, `t_s` after the confirmation (false track held). Where ended tracks are: that the first confirmed track of the
    target has ended by each scan (target's track ended; `sought` by the last one), and by the last one how: target's
    track dropped, target's track lost; of further realisations, so that no other table changes by that.
    """
    makers = {"held": _rare_false, "ended": _rare_ends}
    return rare_events.rate_table(
        [make_rows(result) for result in results for name, make_rows in makers.items() if name in result.sums]
    )


def _rare_false(result: CaseResult[ClutterAxes]) -> dict[str, Any]:
    filter_indices = tracker_indices(result)
    is_shown = held_tracks(result, (filter_indices,)).number > 0
    is_shown[:, 0] = True
    row, k = np.nonzero(is_shown)
    f, sought = filter_indices[row], k == 0
    rows = rare_events.rate_columns(
        label_columns(result, f, k),
        f"{FALSE_TRACK_EVENT} held",
        sought,
        held_tracks(result, (f, k)),
        sampling_weights(result, f),
    )
    return {**rows, "event": np.where(sought, FALSE_TRACK_EVENT, rows["event"])}


def _rare_ends(result: CaseResult[ClutterAxes]) -> dict[str, Any]:
    return stack_columns([_ended(result, f) for f in tracker_indices(result)])


def _ended(result: CaseResult[ClutterAxes], f: int) -> dict[str, Any]:
    by_scan, last = np.cumsum(result.sums["ended"][f], axis=0), len(result.axes.k) - 1
    ended = by_scan.sum(axis=1)
    k = np.flatnonzero((ended[:, 2] > 0) | (np.arange(last + 1) == last))
    weights, total = (
        rare_events.SamplingWeights(result.count, *result.sums["ended_drawn"][f]),
        rare_events.EventWeights(*ended[k].T),
    )
    curve = rare_events.rate_columns(
        label_columns(result, np.full(len(k), f), k), ENDED_TRACK_EVENT, k == last, total, weights
    )
    curve["note"] = ends_note(weights, by_scan[k], mean_false_plots(result) > 0)
    label = label_columns(result, np.array([f]), np.array([last]))
    parts = [curve]
    for event, kinds in KINDS_BY_EVENT.items():
        event_counts = rare_events.EventWeights(*by_scan[last, kinds].sum(axis=0)[:, None])
        rows = rare_events.rate_columns(label, event, np.array([False]), event_counts, weights)
        parts.append(rows | {"note": ends_note(weights, by_scan[[last]], mean_false_plots(result) > 0, kinds)})
    return stack_columns(parts)


def ends_note(
    weights: rare_events.SamplingWeights, ended: np.ndarray, among_false: bool, kinds: Sequence[int] = range(END_KINDS)
) -> np.ndarray:
    """Notes (n,) on the rates at which tracks end in some of the ways, from sums (n, END_KINDS, 4).

    The many tracks that end by runs of misses have equal weights. The few that end by far plots, or by false ones
    beside the target's, have large weights, which the total does not show while they are few. So a part of the total is
    judged as well if by its interval it may exceed MIN_SHARE of the rate; the part beside the target's always, because
    it seems small where such tracks were missed. among_false: whether there are false plots."""
    total = rare_events.EventWeights(*ended[:, list(kinds)].sum(axis=1).T)
    noted_counts, rate = [total], rare_events.event_rate(total, weights).value
    parts = [(event_kinds, MIN_SHARE) for event_kinds in KINDS_BY_EVENT.values() if len(event_kinds) < len(kinds)]
    parts += [([kind for kind in kinds if kind in BESIDE_KINDS], 0.0)] if among_false else []
    for part_kinds, min_share in parts:
        part_counts = rare_events.EventWeights(*ended[:, part_kinds].sum(axis=1).T)
        matters = rare_events.event_rate(part_counts, weights).hi > min_share * rate
        pairs = zip(part_counts, total, strict=True)
        noted_counts.append(rare_events.EventWeights(*(np.where(matters, part, all_ends) for part, all_ends in pairs)))
    total_note, any_note = rare_events.weight_notes(weights, total), rare_events.weight_notes(weights, *noted_counts)
    in_part = notes_where(any_note != "", rare_events.IN_PART)
    return np.where(total_note != "", total_note, in_part)


tables = table.make
