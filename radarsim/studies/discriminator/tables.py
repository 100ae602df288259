"""Tables of a burst's Doppler frequency and its derivatives (P4).

Here `k` is the window and `t_s` its length. A burst is locked where all components are within five times the
Cramér–Rao bound of that window."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.bursts import fisher
from radarsim.engine.results import CaseResult
from radarsim.report import rare_events, statistics
from radarsim.report import tables as common
from radarsim.report.row_notes import notes_about
from radarsim.studies.discriminator.kernels.sums import LOCKS as COUNTED
from radarsim.studies.discriminator.kernels.sums import bin_edges

if TYPE_CHECKING:
    import pandas as pd

WAVELENGTHS_M = (("metre", 1.8), ("decimetre", 0.15), ("centimetre", 0.03))  # P1's five radars have these three
QUANTILES = (0.05, 0.5, 0.95)
table = common.TableMakers()


def last_locks(tables_by_name: "Mapping[str, pd.DataFrame]", result: CaseResult, name: str) -> "pd.Series":
    """The row of locks at the last window of an estimator."""
    return common.select_rows(tables_by_name["locks"], case=result.name, filter=name).iloc[-1]


def plain_bursts(result: CaseResult) -> int:
    """How many bursts were drawn from the plain law: all of them unless rare losses of lock are sought."""
    return int(result.sums["drawn"][0]) if "drawn" in result.sums else result.count


@table("curves")
def _curves(result: CaseResult) -> common.Columns:
    """As everywhere, window by window, of the locked bursts; without `exact_sigma`, as none is known.

    bound [unit]: the Cramér–Rao bound without the forecast
    sigma_all [unit]: σ of all bursts, none dropped
    posterior_crb [unit]: the bound with the prior
    """
    axes, indices = result.axes, common.row_index(result)
    f, k, c = indices
    locked = np.broadcast_to(result.sums["locks"][..., [COUNTED.index("lock")]], axes.available.shape)
    n, bound = locked[indices], axes.exact_sigma[indices]
    moments = result.sums["error"][indices]
    locked_errors = statistics.errors(moments, n)
    all_errors = statistics.errors(result.sums["error_all"][indices], plain_bursts(result))
    return {
        **_labels(result, f, k, c),
        "n": n.astype(np.int64),
        "sigma": statistics.Estimate(*(part * bound for part in locked_errors.sigma)),
        "bias": locked_errors.bias * bound,
        "bias_se": locked_errors.bias_se * bound,
        "spread": locked_errors.spread * bound,
        "bound": bound,
        "exact_bias": np.full(f.size, np.nan),
        "n_eff": statistics.effective(moments[..., 1], moments[..., 3], n),
        "sigma_all": all_errors.sigma.value * bound,
        "posterior_crb": axes.posterior_sigma[indices],
    }


@table.add_of_all_cases("gains")
def _gains(results: Sequence[CaseResult]) -> "pd.DataFrame":
    """Without rows: estimators have no baseline."""
    return common.join_columns((), common.GAINS)


def _labels(result: CaseResult, f: np.ndarray, k: np.ndarray, c: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """The first columns of rows of windows, of which t_s is the length."""
    components = {} if c is None else common.component_columns(result, c)
    return common.label_columns(result, f, k, **components) | {"t_s": result.axes.duration_s[f, k]}


def _at_windows(result: CaseResult) -> tuple[np.ndarray, np.ndarray]:
    """Indices (filter, window) of all windows there are."""
    f, k = np.nonzero(result.axes.available[..., 0])
    return f, k


@table("locks")
def _locks(result: CaseResult) -> common.Columns:
    """How many bursts lock, at each window; with the key `rare` by the weights of `rare.csv`.

    lock_rate ± lock, lock_rate_3sigma: share within five and within three times the bound
    posterior_lock_rate, posterior_lock_rate_3sigma: within as many times the bound with the prior
    unbroken_lock_rate_3sigma ±: within three times the bound at this and all earlier windows
    unbroken_posterior_lock_rate_3sigma ±: within three times the bound with the prior at all of these
    energy_ratio: μ of the window
    """
    f, k = _at_windows(result)
    count = result.sums["locks"][f, k]
    rates = {name: statistics.rate(count[:, i], result.count) for i, name in enumerate(COUNTED)}
    note = np.full(f.size, "", dtype=object)
    if "losses" in result.sums:
        losses_by_lock = {name: losses(result, (f, k, np.full(f.size, i))) for i, name in enumerate(COUNTED)}
        rates = {
            name: rare_events.complement(rare_events.event_rate(lost, sampling_weights(result)))
            for name, lost in losses_by_lock.items()
        }
        note = rare_events.weight_notes(sampling_weights(result), losses_by_lock["lock"])
        unbroken_notes = rare_events.weight_notes(
            sampling_weights(result), losses_by_lock["always_three"], losses_by_lock["always_posterior_three"]
        )
        note = np.where(note == "", notes_about(unbroken_notes, "unbroken"), note)
    return {
        **_labels(result, f, k),
        "n": np.full(f.size, result.count),
        "lock_rate|lock": rates["lock"],
        "lock_rate_3sigma": rates["three"].value,
        "posterior_lock_rate": rates["posterior"].value,
        "posterior_lock_rate_3sigma": rates["posterior_three"].value,
        "unbroken_lock_rate_3sigma": rates["always_three"],
        "unbroken_posterior_lock_rate_3sigma": rates["always_posterior_three"],
        "energy_ratio": result.axes.energy_ratio[f, k],
        "note": note,
    }


def sampling_weights(result: CaseResult) -> rare_events.SamplingWeights:
    """How the bursts of a case with rare losses of lock were drawn."""
    return rare_events.SamplingWeights(result.count, *result.sums["drawn"])


def losses(result: CaseResult, indices: tuple[np.ndarray, ...]) -> rare_events.EventWeights:
    """The weights of bursts that fail a condition of LOCKS, at indices of filter, window and, if given, condition."""
    return rare_events.EventWeights(*np.moveaxis(result.sums["losses"][indices], -1, 0))


def _rare_columns(result: CaseResult) -> dict[str, np.ndarray]:
    windows = np.array([len(window_pulses) for window_pulses in result.axes.pulses])
    f, k = np.arange(len(windows)), windows - 1
    lost = losses(result, (f, k, np.full(f.size, COUNTED.index("lock"))))
    sought = np.array([e.name == result.spec.rare.estimator for e in result.spec.estimators])
    return rare_events.rate_columns(_labels(result, f, k), "loss of lock", sought, lost, sampling_weights(result))


@table("residuals")
def _residuals(result: CaseResult) -> common.Columns:
    """Size of the errors of all bursts, locked or not, from the histograms.

    q05, median, q95 [unit]: 5 %, half and 95 % of the errors lie below
    posterior_crb [unit]: the bound with the prior
    """
    indices = f, k, c = common.row_index(result)
    bound = result.axes.posterior_sigma[indices]
    low, middle, high = quantiles(result.sums["residuals"][indices], bin_edges(), QUANTILES)
    return {
        **_labels(result, f, k, c),
        "n": np.full(f.size, plain_bursts(result)),
        "q05": low * bound,
        "median": middle * bound,
        "q95": high * bound,
        "posterior_crb": bound,
    }


def quantiles(counts: np.ndarray, edges: np.ndarray, shares: Sequence[float]) -> list[np.ndarray]:
    """Quantiles of histograms (n, bins) at `shares`, linear within a bin and limited to the outer edges."""
    total = np.cumsum(counts, axis=1)
    values = []
    for share in shares:
        goal = share * total[:, -1]
        i = np.minimum((total < goal[:, None]).sum(axis=1), counts.shape[1] - 1)
        rows = np.arange(len(counts))
        inside = counts[rows, i]
        count_below = total[rows, i] - inside
        fraction = (goal - count_below) / np.where(inside > 0, inside, 1.0)
        values.append(edges[i] + fraction * (edges[i + 1] - edges[i]))
    return values


@table("windows")
def _windows(result: CaseResult) -> common.Columns:
    """The schedules: what (15), (16) and the options made.

    pulses: number in the window
    energy_ratio: μ of the window
    """
    f, k = _at_windows(result)
    pulses = result.axes.pulses
    return {
        **_labels(result, f, k),
        "pulses": np.array([pulses[i][j] for i, j in zip(f, k, strict=True)]),
        "energy_ratio": result.axes.energy_ratio[f, k],
    }


@table("bounds")
def _bounds(result: CaseResult) -> common.Columns:
    """What limits an estimate, by component.

    prior_sigma [unit]: standard deviation of the forecast
    crb [unit]: Cramér–Rao bound on σ by the closed form
    crb_sum [unit]: by the sum over samples
    shortest_window_s: T_min of (17)
    model_error_turns, model_error_hz: what of the truth no polynomial holds
    """
    axes = result.axes
    f, k = next((f, k) for f, k in zip(*_at_windows(result), strict=True) if _is_whole(result, f, k))
    size = len(axes.components)
    names, units = zip(*axes.components, strict=True)
    return {
        "case": np.full(size, result.name, dtype=object),
        "component": np.array(names, dtype=object),
        "unit": np.array(units, dtype=object),
        "prior_sigma": axes.prior_sigma,
        "crb": axes.potential_closed_form,
        "crb_sum": axes.exact_sigma[f, k],
        "shortest_window_s": np.full(size, axes.shortest_window_s),
        "model_error_turns": np.full(size, axes.model_error_turns),
        "model_error_hz": np.full(size, axes.model_error_hz),
    }


def _is_whole(result: CaseResult, f: int, k: int) -> bool:
    duration = result.axes.duration_s
    return bool(np.isclose(duration[f, k], np.nanmax(duration)))


@table("motion")
def _motion(result: CaseResult) -> common.Columns:
    """What the bounds mean for a target: λ/2 of those of f₀ and f₁.

    band, wavelength_m: metre, decimetre or centimetre, and the wavelength
    burst_point: its beginning or middle
    sigma_velocity_mps, sigma_acceleration_mps2: bounds on the radial velocity and acceleration there
    """
    axes, rows = result.axes, []
    covariance, duration = axes.potential_covariance, axes.burst_s
    for band, wavelength in WAVELENGTHS_M:
        for place, t in (("beginning", 0.0), ("middle", 0.5 * duration)):
            velocity, acceleration = (0.5 * wavelength * fisher.derivative_spread(covariance, i, t) for i in (0, 1))
            row = {"case": result.name, "band": band, "wavelength_m": wavelength, "burst_point": place}
            rows.append(row | {"sigma_velocity_mps": velocity, "sigma_acceleration_mps2": acceleration})
    return common.columns_from_rows(rows)


@table("passes")
def _passes(result: CaseResult) -> common.Columns:
    """What an estimator costs.

    passes ±: mean number of passes over a window's data a burst
    """
    n, total = plain_bursts(result), result.sums["passes"]
    mean_passes = statistics.mean(total[:, 0], total[:, 1], n)
    count = len(mean_passes.value)
    return {**common.label_columns(result, np.arange(count)), "n": np.full(count, n), "passes": mean_passes}


@table.add_of_all_cases("rare")
def _rare(results: Sequence[CaseResult]) -> "pd.DataFrame | None":
    """Loss of lock at the last window of each estimator; `plain` bursts are not shifted."""
    return rare_events.rate_table([_rare_columns(result) for result in results if "losses" in result.sums])


tables = table.make


def curves(results: Sequence[CaseResult]) -> "pd.DataFrame":
    """σ of the locked bursts in place of the common table."""
    return common.join_columns(map(_curves, results))
