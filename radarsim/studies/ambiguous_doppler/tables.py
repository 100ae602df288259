"""Tables of filters that unfold ambiguous velocities."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import key_labels, rare_events, statistics
from radarsim.report import tables as report_tables
from radarsim.report.row_notes import RowNote, notes_where
from radarsim.studies.ambiguous_doppler.axes import FoldedAxes
from radarsim.studies.ambiguous_doppler.kernels.layout import (
    BINS,
    COUNT_SUM,
    LISTED_SUM,
    OFF_BY_HALF_SPAN_SUM,
    RIGHT_SUM,
)
from radarsim.studies.ambiguous_doppler.kernels.weighted_sums import BEYOND, FULL, WRONG

if TYPE_CHECKING:
    import pandas as pd

Result = CaseResult[FoldedAxes]
table = report_tables.TableMakers()
BEYOND_SHARE = "beyond_half_interval_share"  # column of folds.csv
WRONG_FOLD, NO_ROOM = "wrong fold", "wrong fold that found no room"  # events of rare.csv, the second part of the first
# Velocities off by more than half the span may decide σ even if they occur once in 10⁵; most samples hold none and show
# no tail. So σ is marked where fewer than FEW_EVENTS occurred: in 60 × 20,000 realisations of `ambiguous_rls5` the
# intervals of marked σ cover in 45 % of cases, those of unmarked σ in 95 %.
FEW_FOLDS = RowNote(
    "few_folds", f"under {statistics.MIN_EVENTS} velocities off by half the unambiguous interval: rarer ones may decide"
)


@table.add_of_all_cases("curves")
def _curves(results: Sequence[Result]) -> "pd.DataFrame":
    """As in other studies; marked where few folds may decide."""
    return _with_notes(report_tables.curves(results), _few_folds(results))


@table.add_of_all_cases("gains")
def _gains(results: Sequence[Result]) -> "pd.DataFrame":
    """As in other studies; and relative to the oracle, the filter whose velocity is unfolded by the truth.

    excess_over_oracle_percent ±: by how much σ is above the oracle's, paired; empty without such a filter
    """
    columns = (
        {**report_tables.gains([result]), "excess_over_oracle_percent": _above_oracle(result)} for result in results
    )
    return _with_notes(report_tables.join_columns(columns), _few_folds(results))


def _few_folds(results: Sequence[Result]) -> set[tuple[str, str, int]]:
    """Case, filter and scan of each σ of a filter that unfolds which is off by half the span in few realisations."""
    rows = set()
    for result in results:
        beyond_counts = np.asarray(result.sums["folds"])[..., OFF_BY_HALF_SPAN_SUM]
        if "events" in result.sums:
            events_seen = events(result, tuple(np.indices(beyond_counts.shape)), BEYOND)
            beyond_counts = statistics.effective_events(events_seen.weight, events_seen.squared)
        few_events = unfolding_filters(result)[:, None] & (beyond_counts < statistics.MIN_EVENTS)
        rows |= {(result.name, result.axes.filters[f], int(result.axes.k[k])) for f, k in np.argwhere(few_events)}
    return rows


def _with_notes(table: "pd.DataFrame", noted_rows: set[tuple[str, str, int]]) -> "pd.DataFrame":
    """Curves or gains with the note on rows whose filter or baseline is among `noted_rows`."""
    sides = [table[["case", side, "k"]] for side in ("filter", "baseline") if side in table]
    rows = zip(*(side.itertuples(index=False, name=None) for side in sides), strict=True)
    is_noted = np.array([any(key in noted_rows for key in row) for row in rows], dtype=bool)
    return table.assign(note=notes_where(is_noted, FEW_FOLDS))


def _above_oracle(result: Result) -> statistics.Estimate:
    """By how much σ is above the oracle's, in the order of the rows of gains."""
    axes, b = result.axes, result.axes.baseline
    compared = np.array(axes.available[b : b + 1] & axes.available)
    compared[b] = False
    indices = f, k, c = report_tables.row_index(result, compared)
    oracles = [i for i, options in enumerate(result.spec.filters) if options.doppler == "unfolded"]
    if not oracles:
        return statistics.Estimate(*np.full((3, f.size), np.nan))
    oracle, error = oracles[0], np.asarray(result.sums["error"])
    moments, oracle_moments, products = error[indices], error[oracle, k, c], np.asarray(result.sums["oracle"])[indices]
    gain = statistics.gain(
        moments[:, 1],
        moments[:, 3],
        oracle_moments[:, 1],
        oracle_moments[:, 3],
        products,
        report_tables.realisation_counts(result)[indices],
    )
    has_oracle = axes.available[oracle, k, c] & (f != oracle)
    return statistics.Estimate(*(np.where(has_oracle, -value, np.nan) for value in (gain.value, gain.hi, gain.lo)))


@table("folds")
def _folds(result: Result) -> report_tables.Columns:
    """How often all folds are right, by scan, of every filter that unfolds.

    With the key `rare` the rates are by the weights of `rare.csv`, of all n; all else is of the plain realisations.

    right ±: share of realisations whose best hypothesis has all folds right so far; of a `remainder` that scan's fold
    exact_right: known of the nearest fold, without missed plots, where truth and filter agree; of a `remainder` always
    listed: share whose list holds the right sequence
    hypotheses: mean number of hypotheses kept
    beyond_half_interval_share ±: those whose velocity is off by more than half the unambiguous interval
    """
    axes = result.axes
    visible = np.broadcast_to(unfolding_filters(result)[:, None], axes.exact_right.shape)
    indices = f, k = np.nonzero(visible & (np.asarray(result.sums["estimates"])[..., 0] > 0))
    n = np.asarray(result.sums["estimates"])[..., 0][indices]
    folds = np.asarray(result.sums["folds"])[indices]
    right_rate, beyond_rate = (statistics.rate(folds[:, index], n) for index in (RIGHT_SUM, OFF_BY_HALF_SPAN_SUM))
    counts = n
    note = np.full(f.size, "", dtype=object)
    if "events" in result.sums:
        counts = np.full(f.size, float(result.count))
        wrong_events, beyond_events = (events(result, (f, k), event) for event in (WRONG, BEYOND))
        right_rate = rare_events.complement(rare_events.event_rate(wrong_events, sampling(result)))
        beyond_rate = rare_events.event_rate(beyond_events, sampling(result))
        note = rare_events.weight_notes(sampling(result), wrong_events, beyond_events)
    return {
        **report_tables.label_columns(result, f, k),
        "n": counts.astype(np.int64),
        "right": right_rate,
        "exact_right": axes.exact_right[indices],
        "listed": folds[:, LISTED_SUM] / n,
        "hypotheses": folds[:, COUNT_SUM] / n,
        BEYOND_SHARE: beyond_rate,
        "note": note,
    }


def unfolding_filters(result: Result) -> np.ndarray:
    """Which filters (F,) unfold the velocity and combine no members by shares or intervals."""
    return np.array([options.folds and options.combine in (None, "likelihood") for options in result.spec.filters])


def sampling(result: Result) -> rare_events.SamplingWeights:
    """The weights of the realisations of a case with rare wrong folds."""
    return rare_events.SamplingWeights(result.count, *np.asarray(result.sums["drawn"]))


def events(result: Result, indices: tuple[np.ndarray, ...], event: int) -> rare_events.EventWeights:
    """The weighted counts of realisations with an event (WRONG, BEYOND or FULL), at filters and scans."""
    return rare_events.EventWeights(*np.moveaxis(np.asarray(result.sums["events"])[(*indices, event)], -1, 0))


def _rare_tables(result: Result) -> Iterator[dict[str, np.ndarray]]:
    (f,) = np.nonzero(unfolding_filters(result) & ~result.axes.combines)
    aimed_at = np.array([options.name == result.spec.rare.filter for options in result.spec.filters])
    yield _rare_rows(result, f, aimed_at[f], WRONG, WRONG_FOLD)
    (aimed_filter,) = np.nonzero(aimed_at)
    if result.spec.filters[aimed_filter[0]].hypotheses > 1:
        yield _rare_rows(result, aimed_filter, np.zeros(aimed_filter.size, dtype=bool), FULL, NO_ROOM)


def _rare_rows(result: Result, f: np.ndarray, aimed_at: np.ndarray, event: int, name: str) -> dict[str, np.ndarray]:
    """Columns of rare.csv for filters f (n,) and an event, by its number in the sums and its name."""
    k = np.full(f.size, len(result.axes.k) - 1)
    labels, counts = report_tables.label_columns(result, f, k), events(result, (f, k), event)
    return rare_events.rate_columns(labels, name, aimed_at, counts, sampling(result), is_unguided_part=event == FULL)


@table("calibration")
def _calibration(result: Result) -> report_tables.Columns:
    """By the probability that a filter gives its best hypothesis, in ten bins: how often that is right.

    Of filters that keep several hypotheses, with orders or without, at each scan, over realisations with a plot there;
    empty bins have no row.

    bin_lo, bin_hi: ends of the bin
    right ±: how often the best hypothesis has all folds right
    expected: mean of these probabilities, which `right` equals where truth and filter agree
    """
    axes, counts = result.axes, np.asarray(result.sums["calibration"])
    indices = f, k, bins = np.nonzero(axes.remembers[:, None, None] & (counts[..., 0] > 0))
    n, right, expected = counts[indices].T
    return {
        **report_tables.label_columns(result, f),
        "k": np.asarray(axes.k)[k],
        **{"bin_lo": bins / BINS, "bin_hi": (bins + 1) / BINS, "n": n.astype(np.int64)},
        "right": statistics.rate(right, n),
        "expected": expected / n,
    }


@table("orders")
def _orders(result: Result) -> report_tables.Columns:
    """Mean weight of each order in the range, by scan, of filters that combine orders.

    order: of the member's model, from 0
    weight ±: its probability, its share (of several members the sum; it may be negative), or how often it is chosen
    best_order_sigma_r, best_combination_sigma_r [m]: exact σ, for one who knows the target, all folds right: of the
        best member at each scan, and of the best linear combination of the members
    """
    axes, orders_by_filter = result.axes, [set(options.orders) for options in result.spec.filters]
    has_order = np.array(
        [
            [axes.combines[f] and order in orders_by_filter[f] for order in range(3)]
            for f in range(len(orders_by_filter))
        ]
    )
    counts = np.asarray(result.sums["estimates"])[..., 0]
    f, order, k = np.nonzero(has_order[:, :, None] & (counts > 0)[:, None])
    n, sums = counts[f, k], np.asarray(result.sums["orders"])[f, k, order]
    return {
        **report_tables.label_columns(result, f, k, order=order),
        "n": n.astype(np.int64),
        "weight": statistics.mean(sums[:, 0], sums[:, 1], n),
        "best_order_sigma_r": axes.best_order[f, k, 0],
        "best_combination_sigma_r": axes.best_combination[f, k, 0],
    }


@table.add_of_all_cases("rare")
def _rare(results: Sequence[Result]) -> "pd.DataFrame | None":
    """Wrong folds of every filter of one order that unfolds, at the last scan.

    Those of the sought filter that found no room in a full list in a row of their own: no shift leads there.
    """
    return rare_events.rate_table(
        [columns for result in results if "events" in result.sums for columns in _rare_tables(result)]
    )


tables = table.make


INPUTS = ("radar", "σ_r, m", "σ_V, m/s", "Δt, s", "λ, m", "F, Hz", "D, m/s", "D/σ_V", "P_D", "scans")


def inputs(results: Sequence[Result]) -> "pd.DataFrame":
    """The inputs, for the page: a row for each distinct radar."""
    rows: dict[tuple, None] = {}
    for result in results:
        radar = result.spec.radar
        spans = radar.spans_mps
        formatted = [", ".join(map(key_labels.format_value, values)) for values in (radar.rates_hz, spans)]
        accuracy = (radar.sigma_range_m, radar.sigma_velocity_mps, radar.scan_period_s, radar.wavelength_m)
        other_values = (min(spans) / radar.sigma_velocity_mps, radar.detection_probability, result.spec.scans)
        rows[(key_labels.without_markup(key_labels.config_device(result)), *accuracy, *formatted, *other_values)] = None
    return report_tables.frame({name: [row[i] for row in rows] for i, name in enumerate(INPUTS)})
