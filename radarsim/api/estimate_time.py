"""Check whether the estimates of a user filter belong to the scans at which they stand.

Estimates that stand one scan too late or too early fit the truth of another scan. Predictions, from before the plot of
their scan, do not: but their errors have nothing in common with the errors of that plot, only with those of plots
before it, whereas each filter's estimate with the plot takes some of the plot's error over. The error of a plot is what
the truth, where realisations differ in it, does not explain."""

import numpy as np

from radarsim.language.translate import plural, tr

MIN_TIME_FACTOR = 3.0  # by which errors against the truth of another scan must be smaller
MIN_LINK_SIGMAS = 8.0  # of a correlation of errors with plots before the scan, to be clear
MAX_LINK_SIGMAS = 4.0  # of a correlation with the plots of the scan, to be chance
MAX_LINK_RATIO = 0.15  # of the second to the first
HALF = 0.5
SHIFTS = (-2, -1, HALF, 1, 2)  # scans; half a scan late a filter may be that lags
MAX_SCANS = 200  # examined
MIN_ROWS_PER_UNKNOWN = 3.0  # realisations from which the part of the truth in a plot is fitted


def time_warnings(
    name: str, x: np.ndarray, truth: np.ndarray, plots: np.ndarray, full_truth: np.ndarray | None = None
) -> list[str]:
    """A warning where estimates x (n, K, d) fit the truth (n, K, d) of another scan, or owe nothing to the plots (n, K,
    m) of theirs; x and plots may hold not-a-number. full_truth: that of all components (n, K, D)."""
    if x.shape[1] <= 2 * max(SHIFTS):
        return []
    scans = _examined_scans(int(max(SHIFTS)), x.shape[1] - int(max(SHIFTS)))
    factors = {shift: _error_factor(x[:, scans], truth[:, scans], _shifted(truth, scans, shift)) for shift in SHIFTS}
    shift = max(factors, key=lambda candidate: factors[candidate])
    scans, full_truth = _examined_scans(1, x.shape[1]), truth if full_truth is None else full_truth
    errors = x[:, scans] - truth[:, scans]
    now, before = (_link(errors, _plot_errors(plots[:, k], full_truth[:, k])) for k in (scans, scans - 1))
    owes_nothing = now < max(MAX_LINK_SIGMAS, MAX_LINK_RATIO * before)
    if factors[shift] > MIN_TIME_FACTOR and (
        shift > 0 or owes_nothing
    ):  # a filter that lags owes something to its plot
        return [_shift_warning(name, shift, factors[shift])]
    if before > MIN_LINK_SIGMAS and owes_nothing:
        return [tr("{name}: the estimates owe nothing to the plot of their scan, only to those before it: they are "
                   "predictions, or stand a scan too late; the config's filters are judged after each plot",
                   name=name)]  # fmt: skip
    return []


def _shifted(truth: np.ndarray, scans: np.ndarray, shift: float) -> np.ndarray:
    """The truth (n, K, d) so many scans later than scans (k,); of half a scan the mean of two."""
    if shift == HALF:
        return np.asarray(0.5 * (truth[:, scans] + truth[:, scans + 1]))
    return truth[:, scans + int(shift)]


def _shift_warning(name: str, shift: float, factor: float) -> str:
    scans = tr("half a scan") if shift == HALF else plural("{count} scan", "{count} scans", int(abs(shift)))
    fields = {"name": name, "scans": scans, "factor": f"{factor:.2g}"}
    if shift < 0:
        return tr("{name}: the estimates fit the truth of {scans} earlier: their errors are then {factor} "
                  "times smaller; they may stand too late", **fields)  # fmt: skip
    return tr("{name}: the estimates fit the truth of {scans} later: their errors are then {factor} times smaller; "
              "they may stand too early", **fields)  # fmt: skip


def _examined_scans(first: int, stop: int) -> np.ndarray:
    """The scans from one up to, but not including, another; MAX_SCANS of them where there are more."""
    return np.unique(np.linspace(first, stop - 1, min(stop - first, MAX_SCANS)).astype(int))


def _error_factor(x: np.ndarray, truth: np.ndarray, shifted_truth: np.ndarray) -> float:
    """By how much the errors of estimates (n, K, d) are smaller against the truth of other scans, in the geometric mean
    over the components: of medians over realisations and scans."""
    with np.errstate(all="ignore"):
        error, shifted_error = (_medians(np.abs(x - reference)) for reference in (truth, shifted_truth))
        factor = float(np.exp(np.mean(np.log(error / shifted_error))))
    return factor if np.isfinite(factor) else 0.0


def _medians(errors: np.ndarray) -> np.ndarray:
    """The median of each component (d,) of errors (n, K, d), over what is finite; NaN where nothing is."""
    finite = (part[np.isfinite(part)] for part in np.moveaxis(errors, -1, 0))
    return np.array([np.median(part) if part.size else np.nan for part in finite])


def _plot_errors(plots: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Plots (n, K, m) less what is linear in the truth (n, K, D), where realisations differ in it."""
    varies = np.ptp(truth, axis=0).max(axis=-1, initial=0.0) > 0
    if not varies.any():
        return plots
    errors = plots.astype(float)
    for k, j in np.argwhere(np.broadcast_to(varies[:, None], plots.shape[1:])):
        known = np.isfinite(plots[:, k, j]) & np.isfinite(truth[:, k]).all(axis=-1)
        centred = truth[known, k] - truth[known, k].mean(axis=0) if known.any() else truth[known, k]
        if known.sum() < MIN_ROWS_PER_UNKNOWN * (centred.shape[1] + 1):
            errors[:, k, j] = np.nan
            continue
        unknowns = np.column_stack([np.ones(len(centred)), centred / np.maximum(centred.std(axis=0), 1e-300)])
        errors[known, k, j] -= unknowns @ np.linalg.lstsq(unknowns, errors[known, k, j], rcond=None)[0]
    return errors


def _link(errors: np.ndarray, plots: np.ndarray) -> float:
    """The largest correlation over realisations of errors (n, K, d) with plots (n, K, m) of the same place, summed over
    scans, in standard deviations for independent ones."""
    with np.errstate(all="ignore"):
        standard_errors, standard_plots = map(_standardised, (errors, plots))
        products = standard_errors[..., :, None] * standard_plots[..., None, :]
        is_finite = np.isfinite(products)
        total = np.where(is_finite, products, 0.0).sum(axis=(0, 1))
        return float(np.abs(np.nan_to_num(total / np.sqrt(is_finite.sum(axis=(0, 1))))).max())


def _standardised(values: np.ndarray) -> np.ndarray:
    """Values (n, K, d) less their median over realisations, in their median size there, cut at three."""
    centred = values - _nan_median(values)
    return np.asarray(np.clip(centred / (1.4826 * _nan_median(np.abs(centred))), -3, 3))


def _nan_median(values: np.ndarray) -> np.ndarray:
    """The median over realisations (K, d) of what is finite; not-a-number where nothing is."""
    is_known = np.isfinite(values).any(axis=0)
    return np.where(is_known, np.nanmedian(np.where(is_known, values, 0.0), axis=0), np.nan)
