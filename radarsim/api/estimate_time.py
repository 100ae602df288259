"""Check whether the estimates of a user filter belong to the scans at which they stand.

Estimates that stand one scan too late or too early fit the truth of another scan. Predictions, from before the plot of
their scan, do not: but their errors have nothing in common with the errors of that plot, only with those of plots
before it, whereas each filter's estimate with the plot takes some of the plot's error over."""

import numpy as np

from radarsim.language.translate import plural, tr

MIN_TIME_FACTOR = 3.0  # by which errors against the truth of another scan must be smaller
MIN_LINK_SIGMAS = 8.0  # of a correlation of errors with plots before the scan, to be clear
MAX_LINK_SIGMAS = 4.0  # of a correlation with the plots of the scan, to be chance
MAX_LINK_RATIO = 0.15  # of the second to the first
SHIFTS = (-2, -1, 1, 2)  # scans


def time_warnings(name: str, x: np.ndarray, truth: np.ndarray, plots: np.ndarray) -> list[str]:
    """A warning where estimates x (n, K, d) fit the truth (n, K, d) of another scan, or owe nothing to the plots (n, K,
    m) of theirs; x and plots may hold not-a-number."""
    if x.shape[1] <= 2 * max(SHIFTS):
        return []
    factors = {shift: _error_factor(x, truth, shift) for shift in SHIFTS}
    shift = max(factors, key=lambda candidate: factors[candidate])
    if factors[shift] > MIN_TIME_FACTOR:
        return [_shift_warning(name, shift, factors[shift])]
    if _is_prediction(x - truth, plots):
        return [tr("{name}: the estimates owe nothing to the plot of their scan, only to those before it: they are "
                   "predictions, or stand a scan too late; the config's filters are judged after each plot",
                   name=name)]  # fmt: skip
    return []


def _shift_warning(name: str, shift: int, factor: float) -> str:
    scans = plural("{count} scan", "{count} scans", abs(shift))
    fields = {"name": name, "scans": scans, "factor": f"{factor:.2g}"}
    if shift < 0:
        return tr("{name}: the estimates fit the truth of {scans} before: their errors are then {factor} times "
                  "smaller; do they stand too late?", **fields)  # fmt: skip
    return tr("{name}: the estimates fit the truth of {scans} after: their errors are then {factor} times smaller; do "
              "they stand too early?", **fields)  # fmt: skip


def _error_factor(x: np.ndarray, truth: np.ndarray, shift: int) -> float:
    """By how much the estimates' errors are smaller against the truth of so many scans later, in the geometric mean
    over the components: of medians over realisations and scans that both have."""
    K, margin = x.shape[1], max(SHIFTS)
    inner = slice(margin, K - margin)
    with np.errstate(all="ignore"):
        error, shifted_error = (
            _medians(np.abs(x[:, inner] - truth[:, margin + step : K - margin + step])) for step in (0, shift)
        )
        factor = float(np.exp(np.mean(np.log(error / shifted_error))))
    return factor if np.isfinite(factor) else 0.0


def _medians(errors: np.ndarray) -> np.ndarray:
    """The median of each component (d,) of errors (n, K, d), over what is finite; NaN where nothing is."""
    finite = (part[np.isfinite(part)] for part in np.moveaxis(errors, -1, 0))
    return np.array([np.median(part) if part.size else np.nan for part in finite])


def _is_prediction(errors: np.ndarray, plots: np.ndarray) -> bool:
    """Whether errors (n, K, d) are correlated with plots (n, K, m) of the scan before, and with those of their own scan
    by chance at most."""
    now, before = _links(errors[:, 1:], plots[:, 1:]), _links(errors[:, 1:], plots[:, :-1])
    clear = np.abs(before) > MIN_LINK_SIGMAS
    if not clear.any():
        return False
    return bool(np.abs(now).max() < max(MAX_LINK_SIGMAS, MAX_LINK_RATIO * np.abs(before).max()))


def _links(errors: np.ndarray, plots: np.ndarray) -> np.ndarray:
    """The correlations (d, m) over realisations of errors (n, K, d) with plots (n, K, m) of the same place, summed over
    scans, in their standard deviations for independent ones."""
    with np.errstate(all="ignore"):
        standard_errors, standard_plots = map(_standardised, (errors, plots))
        products = standard_errors[..., :, None] * standard_plots[..., None, :]
        is_finite = np.isfinite(products)
        total = np.where(is_finite, products, 0.0).sum(axis=(0, 1))
        return np.asarray(np.nan_to_num(total / np.sqrt(is_finite.sum(axis=(0, 1)))))


def _standardised(values: np.ndarray) -> np.ndarray:
    """Values (n, K, d) less their median over realisations, in their median size there, cut at three."""
    centred = values - _nan_median(values)
    return np.asarray(np.clip(centred / (1.4826 * _nan_median(np.abs(centred))), -3, 3))


def _nan_median(values: np.ndarray) -> np.ndarray:
    """The median over realisations (K, d) of what is finite; not-a-number where nothing is."""
    is_known = np.isfinite(values).any(axis=0)
    return np.where(is_known, np.nanmedian(np.where(is_known, values, 0.0), axis=0), np.nan)
