"""Tables with the contract's columns, from finished cases.

Rows stand in the order case, filter, component, k, and only where the filter has an estimate. pandas is imported when
the first table is made."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import statistics
from radarsim.report.statistics import Estimate

if TYPE_CHECKING:
    import pandas as pd


Columns = Mapping[str, Any]  # of one length: arrays, or estimates of such
Maker = TypeVar("Maker", bound=Callable[..., Any])


def frame(columns: Mapping[str, Sequence[Any] | np.ndarray]) -> "pd.DataFrame":
    """A DataFrame of the named columns, in their order."""
    import pandas as pd

    return pd.DataFrame(dict(columns))


def join_columns(parts: Iterable[Columns], columns: Sequence[str] = ()) -> "pd.DataFrame":
    """One DataFrame of cases' columns set one below the other, in the order of the first, or as named by `columns`. An
    `Estimate` makes three columns, see `spread_estimates`. Cases without rows do not count where others have some."""
    spread_parts = [spread_estimates(part) for part in parts]
    with_rows = [part for part in spread_parts if any(map(len, part.values()))] or spread_parts[:1]
    if not with_rows:
        return frame({name: [] for name in columns})
    return frame({name: np.concatenate([part[name] for part in with_rows]) for name in columns or with_rows[0]})


def spread_estimates(columns: Columns) -> dict[str, Any]:
    """Columns in which an estimate `x` is `x`, `x_lo` and `x_hi`; of `x|y` the ends are `y_lo` and `y_hi`."""
    spread_columns: dict[str, Any] = {}
    for name, values in columns.items():
        stem, has_stem, interval_name = name.partition("|")
        if isinstance(values, Estimate):
            spread_columns |= interval_columns(stem, values, interval_name if has_stem else None)
        else:
            spread_columns[name] = values
    return spread_columns


def stack_columns(parts: Sequence[Columns]) -> dict[str, Any]:
    """Columns of several parts of one case, concatenated."""
    spread_parts = [spread_estimates(part) for part in parts]
    if not spread_parts:
        return {}
    return {name: np.concatenate([part[name] for part in spread_parts]) for name in spread_parts[0]}


def columns_from_rows(rows: Sequence[Columns]) -> dict[str, np.ndarray]:
    """Columns of rows, each of single values by the column's name."""
    spread_rows = [spread_estimates(row) for row in rows]
    if not spread_rows:
        return {}
    return {name: np.array([row[name] for row in spread_rows]) for name in spread_rows[0]}


class TableMakers:
    """The tables of a study, declared by functions that make the columns of one case, or the whole table of all cases.

    Their docstrings are the reference page: what a row is, then a paragraph of columns, a line each, except those
    declared by the functions below and those of `notes` and `rare`. `name: meaning`; `name ± stem: meaning` of an
    estimate, whose ends are `stem_lo` and `stem_hi`, without stem those of the name; several names before one meaning
    are parted by commas, a unit that the name does not end in stands in brackets before the colon, `[unit]` is that of
    the column `unit`; further lines are indented. `exact_NAME` needs no line."""

    def __init__(self) -> None:
        self.makers: dict[str, tuple[Callable[[Any], Any], Callable[[Any], bool] | None]] = {}

    def __call__(self, name: str, applies: Callable[[Any], bool] = lambda result: True) -> Callable[[Maker], Maker]:
        """Declares the table of a name, made separately for each of the cases that `applies` is true for."""
        return self._declare(name, applies)

    def add_of_all_cases(self, name: str) -> Callable[[Maker], Maker]:
        """Declares the table of a name, made of all cases at once; absent where the function returns None."""
        return self._declare(name, None)

    def _declare(self, name: str, applies: Callable[[Any], bool] | None) -> Callable[[Maker], Maker]:
        def declare(make: Maker) -> Maker:
            self.makers[name] = make, applies
            return make

        return declare

    def make(self, results: Sequence[CaseResult]) -> "dict[str, pd.DataFrame]":
        """All of them, with the rows of all cases."""
        tables = {
            name: make(results)
            if applies is None
            else join_columns(make(result) for result in results if applies(result))
            for name, (make, applies) in self.makers.items()
        }
        return {name: table for name, table in tables.items() if table is not None}


def pick_names(values: Sequence[str], index: np.ndarray) -> np.ndarray:
    """The names for an index array (n,)."""
    return np.array(list(values), dtype=object)[index]


def row_index(result: CaseResult, mask: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which rows of a case are written: indices (filter, scan, component), each (n,), ordered filter, component, scan.

    mask (F, K, C) narrows what is available."""
    available = result.axes.available if mask is None else result.axes.available & mask
    f, c, k = np.nonzero(np.moveaxis(available, 1, 2))
    return f, k, c


def label_columns(
    result: CaseResult, f: np.ndarray, k: np.ndarray | None = None, **labels: np.ndarray
) -> dict[str, np.ndarray]:
    """The first columns of n rows: case, filter, further labels and, for scans k (n,), their number and time.

    case: the config's stem, and each swept key with its value
    filter: the filter's name
    k: the scan, from 1
    t_s: time from the first plot"""
    columns = {"case": np.full(f.size, result.name, dtype=object), "filter": pick_names(result.axes.filters, f)}
    columns |= labels
    if k is not None:
        columns |= {"k": np.asarray(result.axes.k)[k], "t_s": np.asarray(result.axes.t_s, dtype=float)[k]}
    return columns


def interval_columns(name: str, estimate: statistics.Estimate, ends: str | None = None) -> dict[str, Any]:
    """An estimate as columns `name`, `…_lo` and `…_hi`; ends: what stands before `_lo`, by default the name.

    lo, hi: ends of the 95 % interval of the measured column before them; `…_lo`, `…_hi` where a table has several"""
    prefix = f"{name}_" if ends is None else ends and f"{ends}_"
    return {name: estimate.value, f"{prefix}lo": estimate.lo, f"{prefix}hi": estimate.hi}


def component_columns(result: CaseResult, c: np.ndarray) -> dict[str, np.ndarray]:
    """The labels of components c (n,).

    component: what is estimated: `r`, `Vr`, `x`, `f0`, …
    unit: its unit"""
    labels, units = zip(*result.axes.components, strict=True)
    return {"component": pick_names(labels, c), "unit": pick_names(units, c)}


def exact_first(rows: "pd.DataFrame", value: str, exact: str) -> np.ndarray:
    """A column (rows,) with the exact value in place of the measured one wherever it is known: what decides."""
    exact_values = rows[exact].to_numpy(dtype=float)
    return np.where(np.isnan(exact_values), rows[value].to_numpy(dtype=float), exact_values)


def realisation_counts(result: CaseResult) -> np.ndarray:
    """How many realisations stand behind each sum (F, K, C): all, or `estimates` where not all have an estimate.

    n: number of realisations behind the row"""
    estimates = result.sums.get("estimates")
    return np.full(result.axes.available.shape, float(result.count)) if estimates is None else np.asarray(estimates)


def curves(results: Sequence[CaseResult]) -> "pd.DataFrame":
    """Errors about the truth by case, filter, component and scan, wherever the filter has an estimate.

    sigma ± [unit]: root of the mean squared error: sigma² = bias² + spread²
    bias, bias_se [unit]: mean error, and its standard error
    spread [unit]: standard deviation of the errors
    n_eff: realisations that stand behind σ where a few large errors decide: n/(κ − 1), κ the fourth moment over the
        squared second; half of n for Gaussian errors
    believed_sigma [unit]: root of the mean variance that the filter computes; with sigma above it a filter is
        optimistic, with sigma below it pessimistic. A sampled mean where a filter adapts, or learns which plots are
        missed"""
    return join_columns(map(curve_columns, results))


def curve_columns(result: CaseResult, believed_sigma: np.ndarray | None = None) -> Columns:
    """The columns of `curves` for one case. believed_sigma (F, K, C): what its filters believe, NaN where unknown."""
    axes, index = result.axes, row_index(result)
    f, k, c = index
    n = realisation_counts(result)[index]
    moments = np.asarray(result.sums["error"])[index]
    errors = statistics.errors(moments, n)
    return {
        **label_columns(result, f, k, **component_columns(result, c)),
        "n": n.astype(np.int64),
        "sigma": errors.sigma,
        "bias": errors.bias,
        "bias_se": errors.bias_se,
        "spread": errors.spread,
        "exact_sigma": np.asarray(axes.exact_sigma, dtype=float)[index],
        "exact_bias": np.asarray(axes.exact_bias, dtype=float)[index],
        "n_eff": statistics.effective(moments[..., 1], moments[..., 3], n),
        "believed_sigma": np.full(f.size, np.nan) if believed_sigma is None else believed_sigma[index],
    }


GAINS = ("case", "filter", "baseline", "component", "k", "t_s", "gain_percent", "gain_lo", "gain_hi", "exact_percent")


def gains(results: Sequence[CaseResult]) -> "pd.DataFrame":
    """Paired gains against the baseline filter, over the realisations in which both have an estimate (P1 eq. 17).

    baseline: the filter compared with
    gain_percent ± gain: by how much σ is less than the baseline's, of the same realisations"""
    return join_columns(map(_gains, results), GAINS)


def _gains(result: CaseResult) -> Columns:
    axes, b, has_both = result.axes, result.axes.baseline, "both" in result.sums
    compared = np.array(axes.available[b : b + 1] & axes.available)
    compared[b] = False
    compared &= "paired" in result.sums  # trackers keep tracks in realisations of their own
    if has_both:
        compared &= np.asarray(result.sums["both"])[..., 0] > 0
    index = f, k, c = row_index(result, compared)
    cross = np.asarray(result.sums["paired"])[index] if f.size else np.zeros(0)  # a lone filter pairs with none
    if has_both:
        n, square, fourth, base_square, base_fourth = np.asarray(result.sums["both"])[index].T
    else:
        n, error = realisation_counts(result)[index], np.asarray(result.sums["error"])
        square, fourth = error[index][:, 1], error[index][:, 3]
        base_square, base_fourth = error[b, k, c][:, 1], error[b, k, c][:, 3]
    gain = statistics.gain(square, fourth, base_square, base_fourth, cross, n)
    return {
        **label_columns(
            result, f, k, baseline=np.full(f.size, axes.filters[b], dtype=object), **component_columns(result, c)
        ),
        "gain_percent|gain": gain,
        "exact_percent": axes.exact_gains[index],
    }


def gains_against_baselines(gains: "pd.DataFrame", results: Sequence[CaseResult]) -> "pd.DataFrame":
    """The rows of gains against the baselines of these results, not against further ones of their cases."""
    own_pairs = {(result.name, result.baseline) for result in results}
    pairs = zip(gains["case"].tolist(), gains["baseline"].tolist(), strict=True)
    return gains[np.array([pair in own_pairs for pair in pairs], dtype=bool)]


def stack_tables(parts: "Sequence[pd.DataFrame]") -> "pd.DataFrame":
    """Tables of the same columns concatenated; a note is empty where one has none."""
    if any("note" in part for part in parts):
        parts = [part if "note" in part else part.assign(note="") for part in parts]
    return join_columns({str(name): part[name].to_numpy() for name in part} for part in parts)


def select_rows(table: "pd.DataFrame", **values: object) -> "pd.DataFrame":
    """The rows of a table that hold these values, by column."""
    for column, value in values.items():
        table = table[table[column] == value]
    return table


def group_by(table: "pd.DataFrame", *columns: str) -> "dict[Any, pd.DataFrame]":
    """The rows of a table by the values of some columns, in the order of the table: {(case, filter, …): rows}."""
    return dict(iter(table.groupby(list(columns), sort=False)))
