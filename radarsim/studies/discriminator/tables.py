"""P4's tables (curves of locked bursts, locks, windows, residuals, bounds, motion) and the words of its report.

Its figures stand in discriminator_figures.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import panels, statistics
from radarsim.report import tables as common
from radarsim.report.drawing import Figure
from radarsim.studies.discriminator import exact
from radarsim.studies.discriminator import figures as discriminator_figures

WAVELENGTHS_M = (("metre", 1.8), ("decimetre", 0.15), ("centimetre", 0.03))  # P1's five radars have these three
QUANTILES = (0.05, 0.5, 0.95)
EXACT = False  # exact_sigma is the bound, which an estimator reaches or does not
SWEPT = True  # lock is what is swept for, and has figures of its own


def tables(results: Sequence[CaseResult]) -> dict:
    """curves and gains in place of the common ones, and locks, windows, residuals, bounds, motion, passes."""
    return {
        "curves": curves(results),
        "gains": common.frame({name: [] for name in common.GAINS}),
        "locks": common.joined([_locks(result) for result in results], LOCKS),
        "residuals": common.joined([_residuals(result) for result in results], RESIDUALS),
        "windows": common.joined([_windows(result) for result in results], WINDOWS),
        "bounds": common.joined([_bounds(result) for result in results], BOUNDS),
        "motion": common.joined([_motion(result) for result in results], MOTION),
        "passes": common.joined([_passes(result) for result in results], PASSES),
    }


CURVES = (*common.CURVES, "sigma_all", "posterior_sigma")


def curves(results: Sequence[CaseResult]):
    """σ of the locked bursts in place of the common table."""
    return common.joined([_curves(result) for result in results], CURVES)


def _curves(result: CaseResult) -> dict[str, np.ndarray]:
    """σ of the locked bursts, window by window; sigma_all of all of them, none dropped."""
    axes, at = result.axes, common.shown(result)
    f, k, c = at
    n, bound = result.sums["locks"][f, k, 0], axes.exact_sigma[at]
    of = statistics.errors(result.sums["error"][at], n)
    every = statistics.errors(result.sums["error_all"][at], result.count)
    return {
        **_labels(result, f, k, c),
        "n": n.astype(np.int64),
        "sigma": of.sigma.value * bound,
        "sigma_lo": of.sigma.lo * bound,
        "sigma_hi": of.sigma.hi * bound,
        "bias": of.bias * bound,
        "bias_se": of.bias_se * bound,
        "spread": of.spread * bound,
        "exact_sigma": bound,
        "sigma_all": every.sigma.value * bound,
        "posterior_sigma": axes.extra["posterior_sigma"][at],
    }


def _labels(result: CaseResult, f: np.ndarray, k: np.ndarray, c: np.ndarray | None = None) -> dict[str, np.ndarray]:
    axes = result.axes
    labels = {"case": np.full(f.size, result.name, dtype=object), "filter": common.names(axes.filters, f)}
    if c is not None:
        labels["component"] = common.names([name for name, _ in axes.components], c)
        labels["unit"] = common.names([unit for _, unit in axes.components], c)
    return labels | {"k": np.asarray(axes.k)[k], "t_s": axes.extra["duration_s"][f, k]}


def _at_windows(result: CaseResult) -> tuple[np.ndarray, np.ndarray]:
    """Indices (filter, window) of all windows there are."""
    return np.nonzero(result.axes.available[..., 0])


LOCKS = (
    *("case", "filter", "k", "t_s", "n", "lock_rate", "lock_lo", "lock_hi", "lock_rate_3sigma"),
    *("posterior_rate", "posterior_rate_3sigma"),
    *("always_rate_3sigma", "always_lo", "always_hi", "always_posterior_rate_3sigma", "always_posterior_lo"),
    *("always_posterior_hi", "energy_ratio"),
)


def _locks(result: CaseResult) -> dict[str, np.ndarray]:
    """Share of bursts within 5 and 3 potential σ at each window, within as many posterior ones, and within 3 so far."""
    f, k = _at_windows(result)
    count = result.sums["locks"][f, k]
    lock, three, posterior, posterior_three, always, always_posterior = (
        statistics.rate(count[:, i], result.count) for i in range(6)
    )
    return {
        **_labels(result, f, k),
        "n": np.full(f.size, result.count),
        "lock_rate": lock.value,
        "lock_lo": lock.lo,
        "lock_hi": lock.hi,
        "lock_rate_3sigma": three.value,
        "posterior_rate": posterior.value,
        "posterior_rate_3sigma": posterior_three.value,
        "always_rate_3sigma": always.value,
        "always_lo": always.lo,
        "always_hi": always.hi,
        "always_posterior_rate_3sigma": always_posterior.value,
        "always_posterior_lo": always_posterior.lo,
        "always_posterior_hi": always_posterior.hi,
        "energy_ratio": result.axes.extra["energy_ratio"][f, k],
    }


RESIDUALS = ("case", "filter", "component", "unit", "k", "t_s", "n", "q05", "median", "q95", "posterior_sigma")


def _residuals(result: CaseResult) -> dict[str, np.ndarray]:
    """Median and 5 to 95 % band of |error| over all bursts, locked or not, from the histograms."""
    at = f, k, c = common.shown(result)
    bound = result.axes.extra["posterior_sigma"][at]
    low, middle, high = quantiles(result.sums["residuals"][at], result.axes.extra["bin_edges"], QUANTILES)
    return {
        **_labels(result, f, k, c),
        "n": np.full(f.size, result.count),
        "q05": low * bound,
        "median": middle * bound,
        "q95": high * bound,
        "posterior_sigma": bound,
    }


def quantiles(counts: np.ndarray, edges: np.ndarray, at: Sequence[float]) -> list[np.ndarray]:
    """Quantiles of histograms (n, bins): linear within a bin, the outer bins' outer edges where they fall outside."""
    total = np.cumsum(counts, axis=1)
    found = []
    for share in at:
        goal = share * total[:, -1]
        i = np.minimum((total < goal[:, None]).sum(axis=1), counts.shape[1] - 1)
        rows = np.arange(len(counts))
        inside = counts[rows, i]
        before = total[rows, i] - inside
        fraction = (goal - before) / np.where(inside > 0, inside, 1.0)
        found.append(edges[i] + fraction * (edges[i + 1] - edges[i]))
    return found


WINDOWS = ("case", "filter", "k", "t_s", "pulses", "energy_ratio")


def _windows(result: CaseResult) -> dict[str, np.ndarray]:
    """The schedules: what (15), (16) and the options made."""
    f, k = _at_windows(result)
    pulses = result.axes.extra["pulses"]
    return {
        **_labels(result, f, k),
        "pulses": np.array([pulses[i][j] for i, j in zip(f, k, strict=True)]),
        "energy_ratio": result.axes.extra["energy_ratio"][f, k],
    }


BOUNDS = (
    *("case", "component", "unit", "prior_sigma", "potential_sigma", "potential_sigma_sum", "shortest_window_s"),
    *("model_error_turns", "model_error_hz"),
)


def _bounds(result: CaseResult) -> dict[str, np.ndarray]:
    """Spreads of prior and bound (closed form, and the exact sum over samples), T_min, and what no polynomial fits."""
    axes, extra = result.axes, result.axes.extra
    f, k = next((f, k) for f, k in zip(*_at_windows(result), strict=True) if _is_whole(result, f, k))
    size = len(axes.components)
    return {
        "case": np.full(size, result.name, dtype=object),
        "component": np.array([name for name, _ in axes.components], dtype=object),
        "unit": np.array([unit for _, unit in axes.components], dtype=object),
        "prior_sigma": extra["prior_sigma"],
        "potential_sigma": extra["potential_closed_form"],
        "potential_sigma_sum": axes.exact_sigma[f, k],
        "shortest_window_s": np.full(size, extra["shortest_window_s"]),
        "model_error_turns": np.full(size, extra["model_error_turns"]),
        "model_error_hz": np.full(size, extra["model_error_hz"]),
    }


def _is_whole(result: CaseResult, f: int, k: int) -> bool:
    extra = result.axes.extra
    return bool(np.isclose(extra["duration_s"][f, k], np.nanmax(extra["duration_s"])))


MOTION = ("case", "band", "wavelength_m", "at", "sigma_velocity_mps", "sigma_acceleration_mps2")


def _motion(result: CaseResult) -> dict[str, np.ndarray]:
    """Spreads of radial velocity and acceleration, λ/2 of those of f₀ and f₁, at the burst's beginning and middle."""
    extra, rows = result.axes.extra, []
    covariance, duration = extra["potential_covariance"], extra["burst_s"]
    for band, wavelength in WAVELENGTHS_M:
        for place, t in (("beginning", 0.0), ("middle", 0.5 * duration)):
            velocity, acceleration = (0.5 * wavelength * exact.derivative_spread(covariance, i, t) for i in (0, 1))
            rows.append((result.name, band, wavelength, place, velocity, acceleration))
    return {name: np.array([row[i] for row in rows]) for i, name in enumerate(MOTION)}


PASSES = ("case", "filter", "n", "passes", "passes_lo", "passes_hi")


def _passes(result: CaseResult) -> dict[str, np.ndarray]:
    """Passes over a window's data a burst, the measure of an estimator's cost: mean with its interval."""
    n, total = result.count, result.sums["passes"]
    of = statistics.mean(total[:, 0], total[:, 1], n)
    count = len(of.value)
    return {
        "case": np.full(count, result.name, dtype=object),
        "filter": np.array(result.axes.filters, dtype=object),
        "n": np.full(count, n),
        "passes": of.value,
        "passes_lo": of.lo,
        "passes_hi": of.hi,
    }


def figures(results: Sequence[CaseResult], made: Mapping, experiment) -> dict[str, Figure]:
    """See `discriminator_figures.figures`."""
    return discriminator_figures.figures(results, made, experiment)


def question(experiment) -> str:
    """What the experiment asks, in one sentence."""
    names = list(dict.fromkeys(e.name for case in experiment.cases for e in case.spec.estimators))
    listed = names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
    return f"How often do {listed} lock onto the Doppler frequency and its derivatives, and how accurate are they then?"


def answer(results: Sequence[CaseResult], made: Mapping) -> list[str]:
    """Sentences with numbers: by case where nothing is swept, else the range of lock of each estimator."""
    plain = [result for result in results if not result.swept]
    if not plain and len(results) > 1:
        return [_over(results, made, name) for name in results[0].axes.filters]
    told = plain or list(results)
    return [words for result in told for words in _of_one(result, made, f"{result.name}, " if len(told) > 1 else "")]


def _of_one(result: CaseResult, made: Mapping, before: str) -> list[str]:
    """Lock and accuracy of the first estimator at its last window, and the locks of the others."""
    first, *others = result.axes.filters
    row = _last(made, result, first)
    k, n, accuracy = int(row["k"]), max(row["lock_rate"] * row["n"], 1), ""
    if row["lock_rate"]:
        bound = result.axes.extra["posterior_sigma"][0, k - 1] / result.axes.exact_sigma[0, k - 1]
        ratio = np.sqrt(result.sums["error"][0, k - 1, :, 1] / n) / bound
        accuracy = f"; σ of the locked over the bound (forecast included) {ratio.min():.3f} to {ratio.max():.3f}"
    windows = f"{k} window{'s' if k > 1 else ''}"
    words = [f"{before}{first}: {windows}, locked in {_lock(row)} of {result.count:,} bursts{accuracy}."]
    if others:
        locks = ", ".join(f"{name} {_lock(_last(made, result, name))}" for name in others)
        words.append(f"{before}the others lock in: {locks}.")
    return words


def _over(results: Sequence[CaseResult], made: Mapping, name: str) -> str:
    """The least and the largest lock of an estimator among swept cases."""
    found = [result for result in results if name in result.axes.filters]
    rows = {result.name: _last(made, result, name) for result in found}
    found.sort(key=lambda result: rows[result.name]["lock_rate"])
    ends = (found[0], found[-1])
    least, most = (f"{_lock(rows[result.name])} ({panels.plain(panels.swept(result))})" for result in ends)
    return f"{name}: locked in {least} to {most}; {len(found)} cases of {panels.realisations(found)}."


def _last(made: Mapping, result: CaseResult, name: str):
    """An estimator's row of locks at its last window."""
    return common.groups(made["locks"], "case", "filter")[(result.name, name)].iloc[-1]


def _lock(row) -> str:
    """A share of bursts with its interval; of all or none the bound to as many digits as it has."""
    value, low, high = (100 * row[name] for name in ("lock_rate", "lock_lo", "lock_hi"))
    if 0 < value < 100:
        return f"{value:.2f} % [{low:.2f}, {high:.2f}]"
    return f"{value:.0f} % [{low:.3f}, {high:.3f}]"
