"""Tables of filters that unfold ambiguous velocities."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import panels, rare, statistics
from radarsim.report import tables as common
from radarsim.report.row_notes import RowNote, notes_where
from radarsim.studies.ambiguous_doppler.filters import FoldedAxes
from radarsim.studies.ambiguous_doppler.kernels.records import BEYOND_SUM, BINS, COUNT_SUM, LISTED_SUM, RIGHT_SUM
from radarsim.studies.ambiguous_doppler.kernels.sums import BEYOND, FULL, WRONG

if TYPE_CHECKING:
    import pandas as pd

Result = CaseResult[FoldedAxes]
table = common.Tables()
WRONG_FOLD, NO_ROOM = "wrong fold", "wrong fold that found no room"  # events of rare.csv, the second part of the first
# A velocity that is off by more than half the span, once in 10⁵, decides σ, and most samples hold none: they show no
# tail. So σ is marked where fewer than so many were seen. Of `ambiguous_rls5`, 60 × 20 000 realisations, σ so marked
# covers 45 %, and what is left unmarked 95 %.
FEW_FOLDS = RowNote(
    "few_folds", f"under {statistics.FEW_EVENTS} velocities off by half the span: rarer ones may decide"
)


@table.whole("curves")
def _curves(results: Sequence[Result]) -> "pd.DataFrame":
    """As everywhere; marked where few folds may decide."""
    return _noted(common.curves(results), _few_folds(results))


@table.whole("gains")
def _gains(results: Sequence[Result]) -> "pd.DataFrame":
    """As everywhere; and against the filter whose velocity is unfolded by the truth, the oracle.

    above_oracle_percent ± above_oracle: by how much σ is above the oracle's, paired; empty without such a filter
    """
    parts = ({**common.gains([one]), "above_oracle_percent|above_oracle": _above_oracle(one)} for one in results)
    return _noted(common.joined(parts), _few_folds(results))


def _few_folds(results: Sequence[Result]) -> set[tuple[str, str, int]]:
    """Case, filter and scan wherever a filter that unfolds was seen to be off by half the span in few realisations."""
    found = set()
    for result in results:
        beyond = np.asarray(result.sums["folds"])[..., BEYOND_SUM]
        if "events" in result.sums:
            off = events(result, tuple(np.indices(beyond.shape)), BEYOND)
            beyond = statistics.effective_events(off.weight, off.squared)
        few = unfolding(result)[:, None] & (beyond < statistics.FEW_EVENTS)
        found |= {(result.name, result.axes.filters[f], int(result.axes.k[k])) for f, k in np.argwhere(few)}
    return found


def _noted(table: "pd.DataFrame", few: set[tuple[str, str, int]]) -> "pd.DataFrame":
    """Curves or gains with the note on the rows of these filters, or of what they are compared with."""
    sides = [table[["case", side, "k"]] for side in ("filter", "baseline") if side in table]
    rows = zip(*(side.itertuples(index=False, name=None) for side in sides), strict=True)
    has_few = np.array([any(side in few for side in row) for row in rows], dtype=bool)
    return table.assign(note=notes_where(has_few, FEW_FOLDS))


def _above_oracle(result: Result) -> statistics.Estimate:
    """By how much σ is above the oracle's (rows,), in the order of the rows of gains."""
    axes, b = result.axes, result.axes.baseline
    both = np.array(axes.available[b : b + 1] & axes.available)
    both[b] = False
    at = f, k, c = common.shown(result, both)
    oracles = [i for i, one in enumerate(result.spec.filters) if one.doppler == "unfolded"]
    if not oracles:
        return statistics.Estimate(*np.full((3, f.size), np.nan))
    o, error = oracles[0], np.asarray(result.sums["error"])
    own, base, cross = error[at], error[o, k, c], np.asarray(result.sums["oracle"])[at]
    of = statistics.gain(own[:, 1], own[:, 3], base[:, 1], base[:, 3], cross, common.realisations(result)[at])
    known = axes.available[o, k, c] & (f != o)
    return statistics.Estimate(*(np.where(known, -part, np.nan) for part in (of.value, of.hi, of.lo)))


@table("folds")
def _folds(result: Result) -> common.Columns:
    """How often all folds are right, by scan, of every filter that unfolds.

    With the key `rare` the rates are by the weights of `rare.csv`, of all n; all else is of the plain realisations.

    right ±: share of realisations whose best hypothesis has all folds right so far; of a `remainder` that scan's fold
    exact_right: known of the nearest fold, without missed plots, where truth and filter agree; of a `remainder` always
    listed: share whose list holds the right sequence
    hypotheses: mean number of hypotheses kept
    beyond ±: share whose velocity is off by more than half the span
    """
    axes = result.axes
    shown = np.broadcast_to(unfolding(result)[:, None], axes.exact_right.shape)
    at = f, k = np.nonzero(shown & (np.asarray(result.sums["estimates"])[..., 0] > 0))
    n = np.asarray(result.sums["estimates"])[..., 0][at]
    of = np.asarray(result.sums["folds"])[at]
    right, beyond, every = statistics.rate(of[:, RIGHT_SUM], n), statistics.rate(of[:, BEYOND_SUM], n), n
    note = np.full(f.size, "", dtype=object)
    if "events" in result.sums:
        every = np.full(f.size, float(result.count))
        wrong, off = (events(result, (f, k), event) for event in (WRONG, BEYOND))
        right, beyond = rare.complement(rare.rate(wrong, drawn(result))), rare.rate(off, drawn(result))
        note = rare.note(drawn(result), wrong, off)
    return {
        **common.leading(result, f, k),
        "n": every.astype(np.int64),
        "right": right,
        "exact_right": axes.exact_right[at],
        "listed": of[:, LISTED_SUM] / n,
        "hypotheses": of[:, COUNT_SUM] / n,
        "beyond": beyond,
        "note": note,
    }


def unfolding(result: Result) -> np.ndarray:
    """Which filters (F,) unfold by themselves."""
    return np.array([one.folds and one.combine in (None, "likelihood") for one in result.spec.filters])


def drawn(result: Result) -> rare.Drawn:
    """How the realisations of a case with rare wrong folds were drawn."""
    return rare.Drawn(result.count, *np.asarray(result.sums["drawn"]))


def events(result: Result, at: tuple[np.ndarray, ...], event: int) -> rare.Counted:
    """The realisations that have an event, WRONG, BEYOND or FULL, at filters and scans."""
    return rare.Counted(*np.moveaxis(np.asarray(result.sums["events"])[(*at, event)], -1, 0))


def _rare_parts(result: Result) -> Iterator[dict[str, np.ndarray]]:
    (f,) = np.nonzero(unfolding(result) & ~result.axes.combines)
    sought = np.array([one.name == result.spec.rare.filter for one in result.spec.filters])
    yield _rare_rows(result, f, sought[f], WRONG, WRONG_FOLD)
    (own,) = np.nonzero(sought)
    if result.spec.filters[own[0]].hypotheses > 1:
        yield _rare_rows(result, own, np.zeros(own.size, dtype=bool), FULL, NO_ROOM)


def _rare_rows(result: Result, f: np.ndarray, sought: np.ndarray, event: int, name: str) -> dict[str, np.ndarray]:
    """Columns of rare.csv of filters f (n,), of an event by its place in the sums and its name."""
    k = np.full(f.size, len(result.axes.k) - 1)
    labels, counted = common.leading(result, f, k), events(result, (f, k), event)
    return rare.rows(labels, name, sought, counted, drawn(result), is_unguided_part=event == FULL)


@table("calibration")
def _calibration(result: Result) -> common.Columns:
    """By the probability that a filter gives its best hypothesis, in ten bins: how often that is right.

    Of filters that keep several hypotheses, with orders or without, at each scan, over realisations with a plot there;
    empty bins have no row.

    bin_lo, bin_hi: ends of the bin
    right ±: how often the best hypothesis has all folds right
    expected: mean of these probabilities, which `right` equals where truth and filter agree
    """
    axes, counted = result.axes, np.asarray(result.sums["calibration"])
    at = f, k, bins = np.nonzero(axes.remembers[:, None, None] & (counted[..., 0] > 0))
    n, right, expected = counted[at].T
    return {
        **common.leading(result, f),
        "k": np.asarray(axes.k)[k],
        **{"bin_lo": bins / BINS, "bin_hi": (bins + 1) / BINS, "n": n.astype(np.int64)},
        "right": statistics.rate(right, n),
        "expected": expected / n,
    }


@table("orders")
def _orders(result: Result) -> common.Columns:
    """Mean weight of each order in the range, by scan, of filters that combine orders.

    order: of the member's model, from 0
    weight ±: its probability, its share (of several members the sum; it may be negative), or how often it is chosen
    best_order_sigma_r, best_combination_sigma_r [m]: exact σ, for one who knows the target, all folds right: of the
        best member at each scan, and of the best linear combination of the members
    """
    axes, given = result.axes, [set(one.orders) for one in result.spec.filters]
    own = np.array([[axes.combines[f] and order in given[f] for order in range(3)] for f in range(len(given))])
    counted = np.asarray(result.sums["estimates"])[..., 0]
    f, order, k = np.nonzero(own[:, :, None] & (counted > 0)[:, None])
    n, sums = counted[f, k], np.asarray(result.sums["orders"])[f, k, order]
    return {
        **common.leading(result, f, k, order=order),
        "n": n.astype(np.int64),
        "weight": statistics.mean(sums[:, 0], sums[:, 1], n),
        "best_order_sigma_r": axes.best_order[f, k, 0],
        "best_combination_sigma_r": axes.best_combination[f, k, 0],
    }


@table.whole("rare")
def _rare(results: Sequence[Result]) -> "pd.DataFrame | None":
    """Wrong folds of every filter of one order that unfolds, at the last scan.

    Those of the sought filter that found no room in a full list in a row of their own: no shift leads there.
    """
    return rare.table([part for result in results if "events" in result.sums for part in _rare_parts(result)])


tables = table.made


INPUTS = ("radar", "σ_r, m", "σ_V, m/s", "Δt, s", "λ, m", "F, Hz", "D, m/s", "D/σ_V", "P_D", "scans")


def inputs(results: Sequence[Result]) -> "pd.DataFrame":
    """What was put in, for the page: a row for each radar that differs from the others."""
    rows: dict[tuple, None] = {}
    for result in results:
        of = result.spec.radar
        spans = of.spans_mps
        said = [", ".join(map(panels.number, each)) for each in (of.rates_hz, spans)]
        accuracy = (of.sigma_range_m, of.sigma_velocity_mps, of.scan_period_s, of.wavelength_m)
        last = (min(spans) / of.sigma_velocity_mps, of.detection_probability, result.spec.scans)
        rows[(panels.plain(panels.device(result)), *accuracy, *said, *last)] = None
    return common.frame({name: [row[i] for row in rows] for i, name in enumerate(INPUTS)})
