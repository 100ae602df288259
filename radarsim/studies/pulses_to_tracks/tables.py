"""Tables of tracks from bursts of pulses.

`exact_sigma` of `curves.csv` is filled for range alone and for idealisations (`estimator: fisher_bound`). A `note`
*bursts lost more rarely than seen here may decide* stands where the bursts that the sample leaves possible to be lost
(95 %) beyond those it saw would add more to σ² than half its interval; docs/trust.md has why."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import key_labels, statistics
from radarsim.report import tables as report_tables
from radarsim.report.interval_notes import HEAVY_TAILS, MIN_EFFECTIVE
from radarsim.report.row_notes import RowNote, notes_where
from radarsim.studies.pulses_to_tracks.axes import PulsesAxes
from radarsim.studies.pulses_to_tracks.kernels import layout

if TYPE_CHECKING:
    import pandas as pd

Result = CaseResult[PulsesAxes]
table = report_tables.TableMakers()
FIRST_MEASURED = 1  # number of the component that a burst's first number measures
SIGMA_ALL_NOTE = HEAVY_TAILS.about("sigma_all")  # where a few lost bursts decide the σ of all
# A lost burst is rare and decides σ: if a sample has none, nothing in it shows that. So the number of further losses is
# taken to be the greatest that the sample allows (95 %), and σ is marked if they would add half of its interval.
UNSEEN_NOTE = RowNote("unseen_losses", "bursts lost more rarely than seen here may decide")
UNSEEN_SHARE = 0.5


def unseen_loss_probability(result: Result) -> np.ndarray:
    """The greatest probability (F,) of further lost bursts, beyond those seen, that the sample allows."""
    from scipy.special import chdtri

    lost = (result.count - np.asarray(result.sums["locks"])[..., layout.LOCKED]).sum(axis=1)
    max_lost = 0.5 * chdtri(2.0 * (lost + 1.0), 0.05) - lost
    return np.minimum(max_lost / (result.count * result.axes.k.size), result.axes.max_loss_probability)


def loss_notes(results: Sequence[Result]) -> dict[tuple[str, str, str, int], RowNote]:
    """The notes on σ, by case, filter, component and scan, where unseen losses may decide."""
    notes = {}
    for result in results:
        axes, (_, squares, _, fourths) = result.axes, np.moveaxis(np.asarray(result.sums["error"]), -1, 0)
        sigmas = statistics.root_mean_square(squares, fourths, np.full(squares.shape, float(result.count)))
        added_squares = unseen_loss_probability(result)[:, None, None] * axes.lost_squares
        for f, k, c in zip(*np.nonzero(added_squares > UNSEEN_SHARE * (sigmas.hi**2 - sigmas.value**2)), strict=True):
            notes[result.name, axes.filters[f], axes.components[c][0], int(axes.k[k])] = UNSEEN_NOTE
    return notes


def with_notes(table: "pd.DataFrame", notes_by_row: Mapping[tuple[str, str, str, int], RowNote]) -> "pd.DataFrame":
    """A table with the notes of its filters, or of their baselines."""
    if not notes_by_row or not len(table):
        return table
    keys = [table[label] for label in ("case", "filter", "component", "k")]
    notes = [notes_by_row.get(row, "") for row in zip(*keys, strict=True)]
    if "baseline" in table:
        keys[1] = table["baseline"]
        notes = [note or notes_by_row.get(row, "") for note, row in zip(notes, zip(*keys, strict=True), strict=True)]
    if "note" in table:
        notes = [note or table_note for note, table_note in zip(notes, table["note"], strict=True)]
    return table.assign(note=np.array(notes, dtype=object)) if any(notes) else table


def tables(results: Sequence[Result]) -> "dict[str, pd.DataFrame]":
    """Curves and gains, marked where unseen losses may decide, and the tables of this study."""
    notes = loss_notes(results)
    tables_by_name = {
        "curves": report_tables.curves(results),
        "gains": report_tables.gains(results),
        **table.make(results),
    }
    return {name: with_notes(frame, notes) if "component" in frame else frame for name, frame in tables_by_name.items()}


def _scans(result: Result, visible: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Filters and scans (n,) of the rows of the visible filters (F,)."""
    f, k = np.nonzero(np.broadcast_to(visible[:, None], (visible.size, result.axes.k.size)))
    return f, k


@table("locks")
def _locks(result: Result) -> report_tables.Columns:
    """How many bursts lock, by scan.

    lock_rate ± lock, lock_rate_3sigma: share within five, or three, times the Cramér–Rao bound in all that is taken
    used_share: those taken into the track; of a mixture the mean weight
    wrong_fold_share ±: those taken in a fold that is not the truth's
    """
    f, k = _scans(result, result.axes.takes > 0)
    counts, n = np.asarray(result.sums["locks"])[f, k], np.full(f.size, float(result.count))
    return {
        **report_tables.label_columns(result, f, k),
        "n": n.astype(np.int64),
        "lock_rate|lock": statistics.rate(counts[:, layout.LOCKED], n),
        "lock_rate_3sigma": counts[:, layout.LOCKED_3] / n,
        "used_share": counts[:, layout.TAKEN] / n,
        "wrong_fold_share": statistics.rate(counts[:, layout.WRONG_FOLD], n),
    }


@table("estimates")
def _estimates(result: Result) -> report_tables.Columns:
    """Errors of the burst's velocity and acceleration, by scan and component; `n` and `sigma` of those that locked.

    sigma_all ± [unit]: σ of all bursts; marked where few lost ones decide it
    crb [unit]: Cramér–Rao bound on σ
    energy_db: energy of the burst over the density of the noise
    """
    axes = result.axes
    f, c, k = np.nonzero(np.moveaxis(np.isfinite(axes.bound), 1, 2))
    moments, locked = (
        np.asarray(result.sums["measured"])[f, k, c],
        np.asarray(result.sums["locks"])[f, k, layout.LOCKED],
    )
    n = np.full(f.size, float(result.count))
    is_heavy = statistics.effective(moments[:, 1, 0], moments[:, 1, 1], n) < MIN_EFFECTIVE
    return {
        **report_tables.label_columns(result, f, k, **report_tables.component_columns(result, FIRST_MEASURED + c)),
        "n": locked.astype(np.int64),
        "sigma": statistics.root_mean_square(moments[:, 0, 0], moments[:, 0, 1], locked),
        "sigma_all": statistics.root_mean_square(moments[:, 1, 0], moments[:, 1, 1], n),
        "crb": axes.bound[f, k, c],
        "energy_db": axes.energy_db[k],
        "note": notes_where(is_heavy, SIGMA_ALL_NOTE),
    }


@table("losses")
def _losses(result: Result) -> report_tables.Columns:
    """What a lost burst costs: σ of the track after it.

    since_loss: scans since the last burst that did not lock; 6: six and more, or none so far
    """
    counts = np.asarray(result.sums["ages"])
    visible = (counts > 0) & (result.axes.takes > 0)[:, None, None]
    f, c, k, age = np.nonzero(np.broadcast_to(visible[:, None], (len(counts), 3, *visible.shape[1:])))
    moments, n = np.asarray(result.sums["losses"])[f, k, age, c], counts[f, k, age]
    return {
        **report_tables.label_columns(result, f, k, **report_tables.component_columns(result, c)),
        "since_loss": age,
        "n": n.astype(np.int64),
        "sigma": statistics.root_mean_square(moments[:, 0], moments[:, 1], n),
    }


@table("idealisations")
def _ideal(result: Result) -> report_tables.Columns:
    """σ of a filter beside the exact σ of its idealisation, where the case has one.

    idealisation: its name, a filter that is otherwise the same
    over_ideal ±: σ over the exact σ of that
    paired_over_ideal ±: σ over the measured σ of that, in the same bursts
    """
    axes = result.axes
    indices = f, k, c = report_tables.row_index(
        result, np.broadcast_to((axes.ideal >= 0)[:, None, None], axes.available.shape)
    )
    moments = np.asarray(result.sums["error"])[indices]
    sigmas = statistics.errors(moments, np.full(f.size, float(result.count))).sigma
    exact = axes.exact_sigma[axes.ideal[f], k, c]
    ideal_moments = np.asarray(result.sums["error"])[axes.ideal[f], k, c]
    gain = statistics.gain(
        *(moments[:, 1], moments[:, 3], ideal_moments[:, 1], ideal_moments[:, 3]),
        *(np.asarray(result.sums["paired_ideal"])[indices], np.full(f.size, float(result.count))),
    )
    return {
        **report_tables.label_columns(
            result,
            f,
            k,
            idealisation=report_tables.pick_names(axes.filters, axes.ideal[f]),
            **report_tables.component_columns(result, c),
        ),
        "over_ideal": statistics.Estimate(*(value / exact for value in sigmas)),
        "paired_over_ideal": statistics.Estimate(*(1 - gain[i] / 100 for i in (0, 2, 1))),
    }


@table("folds")
def _folds(result: Result) -> report_tables.Columns:
    """Of filters that keep several hypotheses, by scan: how often these have taken no velocity in a wrong fold.

    right ±: share of realisations whose best one has taken none
    listed: share of those where any of the list has taken none
    hypotheses: mean number of them
    """
    f, k = _scans(result, np.array([(options.hypotheses or 1) > 1 for options in result.spec.filters]))
    counts, n = np.asarray(result.sums["folds"])[f, k], np.full(f.size, float(result.count))
    return {
        **report_tables.label_columns(result, f, k),
        "n": n.astype(np.int64),
        "right": statistics.rate(counts[:, layout.RIGHT], n),
        "listed": counts[:, layout.LISTED] / n,
        "hypotheses": counts[:, layout.NUMBER] / n,
    }


@table("passes")
def _passes(result: Result) -> report_tables.Columns:
    """What an estimator costs.

    passes ±: mean number of passes over a window's data a burst
    """
    f, scans = np.flatnonzero(result.axes.takes > 0), result.axes.k.size
    pass_sums, n = np.asarray(result.sums["passes"])[f], np.full(f.size, float(result.count))
    mean_passes = statistics.mean(pass_sums[:, 0] / scans, pass_sums[:, 1] / scans**2, n)
    return {**report_tables.label_columns(result, f), "passes": mean_passes}


INPUTS = ("radar", "σ_r, m", "Δt, s", "λ, m", "F, Hz", "pulses", "burst, ms", "SNR a pulse, dB", "energy, dB", "D, m/s")


def inputs(results: Sequence[Result]) -> "pd.DataFrame":
    """The inputs, for the page: a row for each distinct radar and burst."""
    rows: dict[tuple, None] = {}
    for result in results:
        spec, energy = result.spec, result.axes.energy_db
        radar = spec.radar.sigma_range_m, spec.radar.scan_period_s, spec.radar.wavelength_m
        burst = spec.burst.repetition_rate_hz, spec.pulses, 1e3 * spec.burst_s, spec.burst.snr_db
        energy_range = " … ".join(dict.fromkeys(f"{value:.3g}" for value in (energy.min(), energy.max())))
        rows[
            (key_labels.without_markup(key_labels.config_device(result)), *radar, *burst, energy_range, spec.span_mps)
        ] = None
    return report_tables.frame({name: [row[i] for row in rows] for i, name in enumerate(INPUTS)})
