"""Tables of tracks from bursts of pulses.

`exact_sigma` of `curves.csv` is filled for range alone and for idealisations (`estimator: fisher_bound`). A `note`
*bursts lost more rarely than seen here may decide* stands where the bursts that the sample leaves possible to be lost
(95 %) beyond those it saw would add more to σ² than half its interval; docs/trust.md has why."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import panels, statistics
from radarsim.report import tables as common
from radarsim.report.notes import EFFECTIVE, HEAVY
from radarsim.report.row_notes import RowNote, notes_where
from radarsim.studies.pulses_to_tracks import kernels as rec
from radarsim.studies.pulses_to_tracks.filters import PulsesAxes

if TYPE_CHECKING:
    import pandas as pd

Result = CaseResult[PulsesAxes]
table = common.Tables()
MEASURED = 1  # number of the component that a burst's first number measures
OF_ALL = HEAVY.about("sigma_all")  # where the lost among all bursts, few of them, decide
# A lost burst is rare and decides σ: where it is missing in a sample, nothing else in that tells of it. As many more
# are supposed as the sample leaves possible (95 %); what they would add is marked from half of the interval on.
UNSEEN = RowNote("unseen_losses", "bursts lost more rarely than seen here may decide")
UNSEEN_SHARE = 0.5


def unseen(result: Result) -> np.ndarray:
    """The probability (F,) of a lost burst, beyond what was seen, that is the greatest the sample leaves possible."""
    from scipy.special import chdtri

    lost = (result.count - np.asarray(result.sums["locks"])[..., rec.LOCKED]).sum(axis=1)
    most = 0.5 * chdtri(2.0 * (lost + 1.0), 0.05) - lost
    return np.minimum(most / (result.count * result.axes.k.size), result.axes.most_lost)


def marks(results: Sequence[Result]) -> dict[tuple[str, str, str, int], RowNote]:
    """The notes on σ, by case, filter, component and scan, where losses that were not seen may decide."""
    found = {}
    for result in results:
        axes, (_, squares, _, fourths) = result.axes, np.moveaxis(np.asarray(result.sums["error"]), -1, 0)
        of = statistics.root_mean_square(squares, fourths, np.full(squares.shape, float(result.count)))
        added = unseen(result)[:, None, None] * axes.losses
        for f, k, c in zip(*np.nonzero(added > UNSEEN_SHARE * (of.hi**2 - of.value**2)), strict=True):
            found[result.name, axes.filters[f], axes.components[c][0], int(axes.k[k])] = UNSEEN
    return found


def noted(table: "pd.DataFrame", found: Mapping[tuple[str, str, str, int], RowNote]) -> "pd.DataFrame":
    """A table with the notes of its filters, or of their baselines."""
    if not found or not len(table):
        return table
    of = [table[label] for label in ("case", "filter", "component", "k")]
    notes = [found.get(row, "") for row in zip(*of, strict=True)]
    if "baseline" in table:
        of[1] = table["baseline"]
        notes = [note or found.get(row, "") for note, row in zip(notes, zip(*of, strict=True), strict=True)]
    if "note" in table:
        notes = [note or own for note, own in zip(notes, table["note"], strict=True)]
    return table.assign(note=np.array(notes, dtype=object)) if any(notes) else table


def tables(results: Sequence[Result]) -> "dict[str, pd.DataFrame]":
    """Curves and gains, marked where losses that were not seen may decide, and the study's own tables."""
    found = marks(results)
    made = {"curves": common.curves(results), "gains": common.gains(results), **table.made(results)}
    return {name: noted(one, found) if "component" in one else one for name, one in made.items()}


def _scans(result: Result, shown: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Filters and scans (n,) of the rows of the filters shown (F,)."""
    f, k = np.nonzero(np.broadcast_to(shown[:, None], (shown.size, result.axes.k.size)))
    return f, k


@table("locks")
def _locks(result: Result) -> common.Columns:
    """How many bursts lock, by scan.

    lock_rate ± lock, lock_rate_3sigma: share within five, or three, Fisher bounds of the truth in all that is taken
    taken: share taken into the track; of a mixture the mean weight
    wrong_fold ±: share taken in a fold that is not the truth's
    """
    f, k = _scans(result, result.axes.takes > 0)
    of, n = np.asarray(result.sums["locks"])[f, k], np.full(f.size, float(result.count))
    return {
        **common.leading(result, f, k),
        "n": n.astype(np.int64),
        "lock_rate|lock": statistics.rate(of[:, rec.LOCKED], n),
        "lock_rate_3sigma": of[:, rec.LOCKED_3] / n,
        "taken": of[:, rec.TAKEN] / n,
        "wrong_fold": statistics.rate(of[:, rec.WRONG_FOLD], n),
    }


@table("estimates")
def _estimates(result: Result) -> common.Columns:
    """Errors of the burst's velocity and acceleration, by scan and component; `n` and `sigma` of those that locked.

    sigma_all ± [unit]: σ of all bursts; marked where few lost ones decide it
    bound [unit]: the Fisher bound
    energy_db: energy of the burst over the density of the noise
    """
    axes = result.axes
    f, c, k = np.nonzero(np.moveaxis(np.isfinite(axes.bound), 1, 2))
    of, locked = np.asarray(result.sums["measured"])[f, k, c], np.asarray(result.sums["locks"])[f, k, rec.LOCKED]
    n = np.full(f.size, float(result.count))
    few = statistics.effective(of[:, 1, 0], of[:, 1, 1], n) < EFFECTIVE
    return {
        **common.leading(result, f, k, **common.components(result, MEASURED + c)),
        "n": locked.astype(np.int64),
        "sigma": statistics.root_mean_square(of[:, 0, 0], of[:, 0, 1], locked),
        "sigma_all": statistics.root_mean_square(of[:, 1, 0], of[:, 1, 1], n),
        "bound": axes.bound[f, k, c],
        "energy_db": axes.energy_db[k],
        "note": notes_where(few, OF_ALL),
    }


@table("losses")
def _losses(result: Result) -> common.Columns:
    """What a lost burst costs: σ of the track after it.

    since_loss: scans since the last burst that did not lock; 6: six and more, or none so far
    """
    counted = np.asarray(result.sums["ages"])
    shown = (counted > 0) & (result.axes.takes > 0)[:, None, None]
    f, c, k, age = np.nonzero(np.broadcast_to(shown[:, None], (len(counted), 3, *shown.shape[1:])))
    of, n = np.asarray(result.sums["losses"])[f, k, age, c], counted[f, k, age]
    return {
        **common.leading(result, f, k, **common.components(result, c)),
        "since_loss": age,
        "n": n.astype(np.int64),
        "sigma": statistics.root_mean_square(of[:, 0], of[:, 1], n),
    }


@table("idealisations")
def _ideal(result: Result) -> common.Columns:
    """σ of a filter beside the exact σ of its idealisation, where the case has one.

    ideal: name of the idealisation, a filter that is otherwise the same
    over_ideal ±: σ over the exact σ of that
    """
    axes = result.axes
    at = f, k, c = common.shown(result, np.broadcast_to((axes.ideal >= 0)[:, None, None], axes.available.shape))
    moments = np.asarray(result.sums["error"])[at]
    of = statistics.errors(moments, np.full(f.size, float(result.count))).sigma
    exact = axes.exact_sigma[axes.ideal[f], k, c]
    return {
        **common.leading(result, f, k, ideal=common.names(axes.filters, axes.ideal[f]), **common.components(result, c)),
        "over_ideal": statistics.Estimate(*(end / exact for end in of)),
    }


@table("folds")
def _folds(result: Result) -> common.Columns:
    """Of filters that keep several hypotheses, by scan: how often these have taken no velocity in a wrong fold.

    right ±: share of realisations whose best one has taken none
    listed: share of those where any of the list has taken none
    hypotheses: mean number of them
    """
    f, k = _scans(result, np.array([(one.hypotheses or 1) > 1 for one in result.spec.filters]))
    of, n = np.asarray(result.sums["folds"])[f, k], np.full(f.size, float(result.count))
    return {
        **common.leading(result, f, k),
        "n": n.astype(np.int64),
        "right": statistics.rate(of[:, rec.RIGHT], n),
        "listed": of[:, rec.LISTED] / n,
        "hypotheses": of[:, rec.NUMBER] / n,
    }


@table("passes")
def _passes(result: Result) -> common.Columns:
    """What an estimator costs.

    passes ±: mean number of passes over a window's data a burst
    """
    f, scans = np.flatnonzero(result.axes.takes > 0), result.axes.k.size
    of, n = np.asarray(result.sums["passes"])[f], np.full(f.size, float(result.count))
    found = statistics.mean(of[:, 0] / scans, of[:, 1] / scans**2, n)
    return {**common.leading(result, f), "passes": found}


INPUTS = ("radar", "σ_r, m", "Δt, s", "λ, m", "F, Hz", "pulses", "burst, ms", "SNR a pulse, dB", "energy, dB", "D, m/s")


def inputs(results: Sequence[Result]) -> "pd.DataFrame":
    """What was put in, for the page: a row for each radar and burst that differ from the others."""
    rows: dict[tuple, None] = {}
    for result in results:
        spec, energy = result.spec, result.axes.energy_db
        radar = spec.radar.sigma_range_m, spec.radar.scan_period_s, spec.radar.wavelength_m
        burst = spec.burst.repetition_rate_hz, spec.pulses, 1e3 * spec.burst_s, spec.burst.snr_db
        said = " … ".join(dict.fromkeys(f"{end:.3g}" for end in (energy.min(), energy.max())))
        rows[(panels.plain(panels.device(result)), *radar, *burst, said, spec.span_mps)] = None
    return common.frame({name: [row[i] for row in rows] for i, name in enumerate(INPUTS)})
