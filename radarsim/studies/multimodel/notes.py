"""Where an interval over a stage of the flight rests on a few rare errors, or on a sample that lacks them.

A realisation's mean square over the K scans of a stage, q = Σ e_k²/K, is one observation. An error of a tail, of size
√T for d scans one after the other where the mean is b, adds up to X = (T + 2|b|√T) min(d, K)/K to it. If r of n
realisations had one and nothing else varied, Var q would be r X²/n: so an interval as wide as that of this sample can
speak of r = n Var q/X² such errors, and as rates of under `FEW_EVENTS` events are, it is marked where these are fewer.
Of a gain r is n² times the variance of the logarithm over (X/E q)², for either filter: its interval is narrower, as the
common noise is not in it.

X is told from all stages in which the filter has such errors in this component, and the greatest counts, as the sample
may lack them in the stage that is judged, or have fewer than its share:

* T is the mean of `tails` over the scans of that stage that have a tail;
* d is told by the serial correlation of the squares there: Var q = Σ_jk Cov(e_j², e_k²)/K² is d/K times the mean of
  Var(e_k²) where each scan goes with d others, so d = K Var q / mean Var(e_k²), between 1 and K;
* b² is the mean over the scans of the stage that is judged.

A model that is the best for one scan by mistake has d = 1: that decides σ over six scans, and not over hundreds.

Beside the bulk of the errors T is too small, and so r too large: m₄/m₂ is the size of the rare ones only where these
make m₂. A model is best for all three axes at once, so what its mistakes do to a gain is told by the axis that shows
them most: of components with one unit the least r counts. For σ that would mark rows that cover: its interval has the
variance of the bulk in it, which a gain's has not where both filters share their noise.

Nor has a speed more rare errors than the acceleration along the same stage: they are the same mistakes, of which it is
the sum over time. Acceleration shows them with the least bulk beside them, as noise of plots enters it last. So a gain
in speed has the least r of both. Not one in place: that is measured at every scan, which takes a mistake out of it
before it adds up; there the bulk decides, and the count in acceleration would mark what covers.

What came out stands in docs/trust.md.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import notes as common
from radarsim.report import statistics

if TYPE_CHECKING:
    from radarsim.studies.multimodel.study import FlightAxes

RARE = f"under {statistics.FEW_EVENTS} rare errors: heavy tails"
TAIL = 5.0  # κ
SHOWN_BY = {"m/s": "m/s2"}  # unit of a component, and of the one that shows its rare errors as well


def of_stages(result: "CaseResult[FlightAxes]") -> np.ndarray:
    """What is to be said (F, S, C) of σ and gain over each stage; "" of most."""
    b, n = result.axes.baseline, result.count
    square, fourth = np.moveaxis(np.asarray(result.sums["stage"])[:, :, : len(result.axes.components)], -1, 0)
    cross = np.asarray(result.sums["pairs"])[:, b]
    log_variance = statistics.log_variance(square, fourth, square[b], fourth[b], cross, n)
    with np.errstate(divide="ignore", invalid="ignore"):
        more, effective = rare(result) / (square / n), statistics.effective(square, fourth, n)
        few = n**2 / effective / more**2 < statistics.FEW_EVENTS
        events_of_gain = n**2 * log_variance / np.fmax(more, more[b]) ** 2
    few_of_gain = _least_of_axes(events_of_gain, [unit for _, unit in result.axes.components]) < statistics.FEW_EVENTS
    own = np.where(effective < common.EFFECTIVE, common.HEAVY, np.where(few, RARE, "")).astype(object)
    of_gain = np.where(own[b] != "", own[b], np.where(few_of_gain, RARE, "")).astype(object)
    of_gain[b] = ""
    return np.where((own == "") & (of_gain != ""), common.OF_GAIN + of_gain, own)


def _least_of_axes(events: np.ndarray, units: Sequence[str]) -> np.ndarray:
    """The least (F, S, C) over all axes: of place, velocity or acceleration alone, of velocity of acceleration too."""
    least = np.full(events.shape, np.inf)
    for unit in set(units):
        telling = np.isin(units, [unit, SHOWN_BY.get(unit, unit)])
        least[..., np.isin(units, [unit])] = np.fmin.reduce(events[..., telling], axis=-1, keepdims=True)
    return least


def rare(result: "CaseResult[FlightAxes]") -> np.ndarray:
    """What errors of a tail add to the mean square of a realisation over each stage, (F, S, C); 0 without one."""
    axes, scans = result.axes, np.maximum(np.asarray(result.axes.stage_scans, dtype=float), 1)[:, None]
    m1, m2, _, m4 = np.moveaxis(np.asarray(result.sums["error"], dtype=float) / result.count, -1, 0)
    square, fourth = np.moveaxis(np.asarray(result.sums["stage"])[:, :, : len(axes.components)] / result.count, -1, 0)
    of_scan, tail = m4 - m2**2, tails(result)
    bias, found = np.zeros(square.shape), np.zeros(square.shape)
    for s in np.unique(axes.stage):
        bias[:, s] = np.mean(m1[:, axes.stage == s] ** 2, axis=1)
    for s in np.unique(axes.stage):
        here = tail[:, axes.stage == s]
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = np.nan_to_num(here.sum(axis=1) / (here > 0).sum(axis=1))[:, None]
            lasts = scans[s] * (fourth[:, s] - square[:, s] ** 2) / np.mean(of_scan[:, axes.stage == s], axis=1)
        lasts = np.clip(np.nan_to_num(lasts, nan=1.0), 1.0, scans[s])[:, None]
        found = np.maximum(found, (mean + 2 * np.sqrt(bias * mean)) * np.minimum(lasts, scans) / scans)
    return found


def tails(result: "CaseResult[FlightAxes]") -> np.ndarray:
    """Squared size (F, K, C) of the errors about their mean that make a tail, κ over 5, at each scan; 0 elsewhere."""
    moments = np.asarray(result.sums["error"], dtype=float) / result.count
    with np.errstate(invalid="ignore", divide="ignore"):
        m1, m2, m3, m4 = np.moveaxis(moments, -1, 0)
        variance = np.maximum(m2 - m1**2, 0.0)
        fourth = np.maximum(m4 - 4 * m1 * m3 + 6 * m1**2 * m2 - 3 * m1**4, 0.0)
        kurtosis = np.where(variance > common.ROUNDING * m2, fourth / variance**2, 0.0)
    return np.where(result.axes.available & (kurtosis > TAIL), kurtosis * variance, 0.0)
