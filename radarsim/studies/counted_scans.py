"""From which scan on errors are compared: from the target's manoeuvre on, else once the filters have settled.

The error of a young track is large whatever the filter, the more so where plots may be missed: a worst error that
includes it says how the filter was started."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Axes, CaseResult

if TYPE_CHECKING:
    from radarsim.studies.interface import Study

SETTLED = 0.05  # within this share of the steady value, for good; the papers give no tolerance
PLOTS_SHARE = 0.99  # of the realisations, which have the plots to settle
LOOK_AHEAD = 0.5  # of a track's age, at least MIN_LOOK_AHEAD scans: over so long the σ of a filter that settled stays
MIN_LOOK_AHEAD = 5
STRIDE = 50  # of scans that are looked at: every one, beyond this many as seldom as 2 % of the track's age
PILOT_REALISATIONS = 400  # of σ that is known by simulation only: a standard error of 3.5 %
PILOT_SEED = 1  # of any run, so that the scan does not depend on a run's seed
SIZE_KEYS = "acceleration_mps2", "acceleration_g", "jerk_mps3"  # of a manoeuvre
Reason = Literal["manoeuvre", "settled", "last"]


class CountedScans(NamedTuple):
    """The first scan that counts, from 1, its time, s, and why it is the first."""

    k: int
    t_s: float
    reason: Reason


def counted_scans(
    start_s: float | None, t: np.ndarray, started: int, settled: Sequence[int], every: bool = True
) -> CountedScans:
    """The scans that count, of those at times t (K,): from the manoeuvre on, which begins at start_s, but not before
    the scan at which filters have started; else from the last of the scans at which they settle, which may lie beyond
    the run. Of a run in which they do not settle, the last scan.

    every: count only scans at which every filter has settled, not those at which all have that settle in the run."""
    reason: Reason = "manoeuvre"
    if (k := manoeuvre_scan(start_s, t)) is None:
        k, reason = max((scan for scan in settled if every or scan <= len(t)), default=len(t) + 1), "settled"
    k = max(k, started)
    if k > len(t):
        k, reason = len(t), "last"
    return CountedScans(k, float(t[k - 1]), reason)


def target_start_s(target: Any) -> float | None:
    """The time, s, at which a target begins to manoeuvre, by its keys; None without one, or where its size is zero."""
    sizes = [getattr(target, name, None) for name in SIZE_KEYS]
    return None if 0 in sizes else getattr(target, "start_s", None)


def manoeuvre_scan(start_s: float | None, t: np.ndarray) -> int | None:
    """The scan, from 1, at which a manoeuvre begins at start_s; None where there is none within times t (K,), or one
    from the first scan on."""
    if start_s is None or not t[0] < start_s <= t[-1]:
        return None
    return int(np.searchsorted(t, start_s)) + 1


def scan_with_plots(plots: int, detection: float, scans: int) -> int:
    """The scan, from 1, at which nearly all realisations have so many plots; scans + 1 where that is later."""
    if detection == 1:
        return min(plots, scans + 1)
    share = 0.0
    for k in range(plots, scans + 1):  # the plot that completes them is that of scan k
        ways = math.lgamma(k) - math.lgamma(plots) - math.lgamma(k - plots + 1)
        share += math.exp(ways + plots * math.log(detection) + (k - plots) * math.log1p(-detection))
        if share >= PLOTS_SHARE:
            return k
    return scans + 1


def first_for_good(is_settled: np.ndarray) -> int:
    """The index from which on all of (K,) are true; K where the last is not."""
    wrong = np.flatnonzero(~is_settled)
    return int(wrong[-1]) + 1 if wrong.size else 0


def settled_scan(spread: np.ndarray, may_grow: bool = True) -> int:
    """The scan, from 1, from which on the spread (K,) of a filter's errors stays within 5 % until the track is half as
    old again, but for twice that in a fifth of the scans; of one that grows, as with the distance, the scan from which
    on it falls no more. K + 1 where the run is too short to tell."""
    falls = []  # by scan: whether it lies over the middle of those that follow
    i, end = 0, 0
    while end < len(spread):
        end = i + max(MIN_LOOK_AHEAD, round(LOOK_AHEAD * i)) + 1
        window = spread[i:end]
        if end <= len(spread) and not np.isnan(window).any():
            low, middle, high = np.quantile(window, (0.1, 0.5, 0.9)) - spread[i]
            margin = SETTLED * spread[i]
            if abs(middle) <= margin and max(-low, high) <= 2 * margin:
                return i + 1
            falls.append((i, middle < -margin))
        i += max(1, i // STRIDE)
    for first, (i, _) in enumerate(falls if may_grow else ()):
        if not any(is_falling for _, is_falling in falls[first:]):
            return i + 1
    return len(spread) + 1


def study_scans(
    study: "Study", case: Case, component: str | None = None, axes: Axes | None = None
) -> CountedScans | None:
    """The scans that count for the errors of a case's filters in a component, by default the first; None where a study
    has no scans. axes: those of the case's plan, where they are known."""
    axes = study.prepare(case).axes if axes is None else axes
    t = np.asarray(axes.t_s, dtype=float)
    if len(t) < 2:
        return None
    names = [name for name, _ in axes.components]
    c = names.index(component) if component in names else 0
    available = np.asarray(axes.available)[:, :, c]
    available = available[available.any(axis=1)]
    if not len(available):
        return None
    start_s, settled = study.manoeuvre_start_s(case.spec), list[int]()
    if manoeuvre_scan(start_s, t) is None:
        settled = [
            settled_scan(spread) for spread in spread_by_scan(study, case, axes, c) if not np.isnan(spread).all()
        ]
    counted = counted_scans(start_s, t, int(available.argmax(axis=1).max()) + 1, settled)
    return counted._replace(k=int(axes.k[counted.k - 1]))


def result_scans(study: "Study", result: CaseResult[Any], component: str | None = None) -> CountedScans:
    """The scans that count for the errors of a result; the last, where its study cannot tell."""
    case = Case(result.name, result.name, result.study, result.spec, (), PILOT_REALISATIONS, PILOT_SEED)
    last = CountedScans(int(result.axes.k[-1]), float(result.axes.t_s[-1]), "last")
    return study.counted_scans(case, component, result.axes) or last


def spread_by_scan(study: "Study", case: Case, axes: Axes, c: int, filters: Sequence[int] | None = None) -> np.ndarray:
    """The spread (F, K) of the errors in component c about their means, which a target's motion makes; not-a-number
    where there is no estimate. filters: the F by index, by default all."""
    sigma, bias = sigma_and_bias_by_scan(study, case, axes, c, filters)
    with np.errstate(over="ignore", invalid="ignore"):  # of filters that are lost
        return np.sqrt(np.maximum(sigma**2 - bias**2, 0.0))


def sigma_and_bias_by_scan(
    study: "Study", case: Case, axes: Axes, c: int, filters: Sequence[int] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """σ and mean (F, K) of the errors in component c: exact where they are known exactly, else of a few realisations
    with a seed of their own; not-a-number where there is no estimate. filters: the F by index, by default all."""
    chosen = list(range(len(axes.filters)) if filters is None else filters)
    available = np.asarray(axes.available)[chosen, :, c]
    sigma, bias = (np.array(values, dtype=float)[chosen, :, c] for values in (axes.exact_sigma, axes.exact_bias))
    if not study.exact_errors or np.isnan(np.where(available, sigma + bias, 0.0)).any():
        plan = study.prepare(replace(case, seed=PILOT_SEED))
        sums: Mapping[str, np.ndarray] = plan.layout.unpack(study.simulate(plan, 0, PILOT_REALISATIONS))
        result = CaseResult(case.name, case.study, case.spec, case.swept_values, PILOT_REALISATIONS, sums, plan.axes)
        curves = study.curves([result])
        curves = curves[curves["component"] == axes.components[c][0]]
        rows = {axes.filters[f]: i for i, f in enumerate(chosen)}
        places = {int(k): i for i, k in enumerate(axes.k)}
        for name, k, sigma_of_scan, bias_of_scan in curves[["filter", "k", "sigma", "bias"]].to_numpy():
            if name in rows:
                sigma[rows[name], places[int(k)]], bias[rows[name], places[int(k)]] = sigma_of_scan, bias_of_scan
    return np.where(available, sigma, np.nan), np.where(available, bias, np.nan)
