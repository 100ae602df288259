"""Tables of a burst's Doppler frequency and its derivatives (P4).

Here `k` is the window and `t_s` its length. A burst is locked where all components are within five potential σ of that
window."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.bursts import burst as model
from radarsim.engine.results import CaseResult
from radarsim.report import rare, statistics
from radarsim.report import tables as common
from radarsim.report.row_notes import notes_about
from radarsim.studies.discriminator.kernels import LOCKS as COUNTED
from radarsim.studies.discriminator.kernels import bin_edges

if TYPE_CHECKING:
    import pandas as pd

WAVELENGTHS_M = (("metre", 1.8), ("decimetre", 0.15), ("centimetre", 0.03))  # P1's five radars have these three
QUANTILES = (0.05, 0.5, 0.95)
table = common.Tables()


def last_locks(made: "Mapping[str, pd.DataFrame]", result: CaseResult, name: str) -> "pd.Series":
    """The row of locks at the last window of an estimator."""
    return common.where(made["locks"], case=result.name, filter=name).iloc[-1]


def plain(result: CaseResult) -> int:
    """How many bursts were drawn as they are: all, but where rare losses of lock are sought."""
    return int(result.sums["drawn"][0]) if "drawn" in result.sums else result.count


@table("curves")
def _curves(result: CaseResult) -> common.Columns:
    """As everywhere, window by window, of the locked bursts; `exact_sigma` is the potential σ.

    sigma_all [unit]: σ of all bursts, none dropped
    posterior_sigma [unit]: the potential σ with the prior
    """
    axes, at = result.axes, common.shown(result)
    f, k, c = at
    locked = np.broadcast_to(result.sums["locks"][..., [COUNTED.index("lock")]], axes.available.shape)
    n, bound = locked[at], axes.exact_sigma[at]
    moments = result.sums["error"][at]
    of = statistics.errors(moments, n)
    every = statistics.errors(result.sums["error_all"][at], plain(result))
    return {
        **_labels(result, f, k, c),
        "n": n.astype(np.int64),
        "sigma": statistics.Estimate(*(part * bound for part in of.sigma)),
        "bias": of.bias * bound,
        "bias_se": of.bias_se * bound,
        "spread": of.spread * bound,
        "exact_sigma": bound,
        "exact_bias": np.full(f.size, np.nan),
        "n_eff": statistics.effective(moments[..., 1], moments[..., 3], n),
        "sigma_all": every.sigma.value * bound,
        "posterior_sigma": axes.posterior_sigma[at],
    }


@table.whole("gains")
def _gains(results: Sequence[CaseResult]) -> "pd.DataFrame":
    """Without rows: estimators have no baseline."""
    return common.joined((), common.GAINS)


def _labels(result: CaseResult, f: np.ndarray, k: np.ndarray, c: np.ndarray | None = None) -> dict[str, np.ndarray]:
    """The first columns of rows of windows, of which t_s is the length."""
    components = {} if c is None else common.components(result, c)
    return common.leading(result, f, k, **components) | {"t_s": result.axes.duration_s[f, k]}


def _at_windows(result: CaseResult) -> tuple[np.ndarray, np.ndarray]:
    """Indices (filter, window) of all windows there are."""
    f, k = np.nonzero(result.axes.available[..., 0])
    return f, k


@table("locks")
def _locks(result: CaseResult) -> common.Columns:
    """How many bursts lock, at each window; with the key `rare` by the weights of `rare.csv`.

    lock_rate ± lock, lock_rate_3sigma: share within five and within three potential σ
    posterior_rate, posterior_rate_3sigma: within as many σ with the prior
    always_rate_3sigma ± always: within three potential σ at this and all earlier windows
    always_posterior_rate_3sigma ± always_posterior: within three σ with the prior at all of these
    energy_ratio: μ of the window
    """
    f, k = _at_windows(result)
    count = result.sums["locks"][f, k]
    rates = {name: statistics.rate(count[:, i], result.count) for i, name in enumerate(COUNTED)}
    note = np.full(f.size, "", dtype=object)
    if "losses" in result.sums:
        every = {name: losses(result, (f, k, np.full(f.size, i))) for i, name in enumerate(COUNTED)}
        rates = {name: rare.complement(rare.rate(lost, drawn(result))) for name, lost in every.items()}
        note = rare.note(drawn(result), every["lock"])
        so_far = rare.note(drawn(result), every["always_three"], every["always_posterior_three"])
        note = np.where(note == "", notes_about(so_far, "always"), note)
    return {
        **_labels(result, f, k),
        "n": np.full(f.size, result.count),
        "lock_rate|lock": rates["lock"],
        "lock_rate_3sigma": rates["three"].value,
        "posterior_rate": rates["posterior"].value,
        "posterior_rate_3sigma": rates["posterior_three"].value,
        "always_rate_3sigma|always": rates["always_three"],
        "always_posterior_rate_3sigma|always_posterior": rates["always_posterior_three"],
        "energy_ratio": result.axes.energy_ratio[f, k],
        "note": note,
    }


def drawn(result: CaseResult) -> rare.Drawn:
    """How the bursts of a case with rare losses of lock were drawn."""
    return rare.Drawn(result.count, *result.sums["drawn"])


def losses(result: CaseResult, at: tuple[np.ndarray, ...]) -> rare.Counted:
    """Of what LOCKS counts the bursts that fail it, at filters, windows and, if given, entry of LOCKS."""
    return rare.Counted(*np.moveaxis(result.sums["losses"][at], -1, 0))


def _rare_part(result: CaseResult) -> dict[str, np.ndarray]:
    windows = np.array([len(own) for own in result.axes.pulses])
    f, k = np.arange(len(windows)), windows - 1
    lost = losses(result, (f, k, np.full(f.size, COUNTED.index("lock"))))
    sought = np.array([e.name == result.spec.rare.estimator for e in result.spec.estimators])
    return rare.rows(_labels(result, f, k), "loss of lock", sought, lost, drawn(result))


@table("residuals")
def _residuals(result: CaseResult) -> common.Columns:
    """Size of the errors of all bursts, locked or not, from the histograms.

    q05, median, q95 [unit]: 5 %, half and 95 % of the errors lie below
    posterior_sigma [unit]: the potential σ with the prior
    """
    at = f, k, c = common.shown(result)
    bound = result.axes.posterior_sigma[at]
    low, middle, high = quantiles(result.sums["residuals"][at], bin_edges(), QUANTILES)
    return {
        **_labels(result, f, k, c),
        "n": np.full(f.size, plain(result)),
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

    prior_sigma [unit]: spread of the forecast
    potential_sigma [unit]: the potential σ by the closed form
    potential_sigma_sum [unit]: by the sum over samples
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
        "potential_sigma": axes.potential_closed_form,
        "potential_sigma_sum": axes.exact_sigma[f, k],
        "shortest_window_s": np.full(size, axes.shortest_window_s),
        "model_error_turns": np.full(size, axes.model_error_turns),
        "model_error_hz": np.full(size, axes.model_error_hz),
    }


def _is_whole(result: CaseResult, f: int, k: int) -> bool:
    duration = result.axes.duration_s
    return bool(np.isclose(duration[f, k], np.nanmax(duration)))


@table("motion")
def _motion(result: CaseResult) -> common.Columns:
    """What the spreads mean for a target: λ/2 of those of f₀ and f₁.

    band, wavelength_m: metre, decimetre or centimetre, and the wavelength
    at: beginning or middle of the burst
    sigma_velocity_mps, sigma_acceleration_mps2: potential σ of the radial velocity and acceleration there
    """
    axes, rows = result.axes, []
    covariance, duration = axes.potential_covariance, axes.burst_s
    for band, wavelength in WAVELENGTHS_M:
        for place, t in (("beginning", 0.0), ("middle", 0.5 * duration)):
            velocity, acceleration = (0.5 * wavelength * model.derivative_spread(covariance, i, t) for i in (0, 1))
            row = {"case": result.name, "band": band, "wavelength_m": wavelength, "at": place}
            rows.append(row | {"sigma_velocity_mps": velocity, "sigma_acceleration_mps2": acceleration})
    return common.of_rows(rows)


@table("passes")
def _passes(result: CaseResult) -> common.Columns:
    """What an estimator costs.

    passes ±: mean number of passes over a window's data a burst
    """
    n, total = plain(result), result.sums["passes"]
    of = statistics.mean(total[:, 0], total[:, 1], n)
    count = len(of.value)
    return {**common.leading(result, np.arange(count)), "n": np.full(count, n), "passes": of}


@table.whole("rare")
def _rare(results: Sequence[CaseResult]) -> "pd.DataFrame | None":
    """Loss of lock at the last window of each estimator; `plain` bursts are not shifted."""
    return rare.table([_rare_part(result) for result in results if "losses" in result.sums])


tables = table.made


def curves(results: Sequence[CaseResult]) -> "pd.DataFrame":
    """σ of the locked bursts in place of the common table."""
    return common.joined(map(_curves, results))
