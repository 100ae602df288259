"""A user filter's estimates, read from files."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any
from zipfile import BadZipFile

import numpy as np

from radarsim.config.experiment import Case
from radarsim.errors import ConfigError
from radarsim.studies import registry
from radarsim.studies.plot_arrays import TRUTH_PREFIX, true_column
from radarsim.studies.user_filters import plots

if TYPE_CHECKING:
    import pandas as pd


KNOT_MPS, FOOT_M = 1852 / 3600, 0.3048
UNIT_FACTORS = (  # between units that are confused
    *(1e3, 1e-3, -1.0, 3.6, 1 / 3.6, 180 / np.pi, np.pi / 180, KNOT_MPS, 1 / KNOT_MPS, FOOT_M, 1 / FOOT_M),
)
INDEX_COLUMNS = "realisation", "k", "t_s"  # of a table of estimates; its other columns are components
TIME_TOLERANCE = 1e-3  # of the time between scans: how far a time in a table may be from that of a plot


def read_estimates(path: Path, case: Case, components: tuple[str, ...]) -> tuple[Any, tuple[str, ...]]:
    """Estimates from a file by realisation from 0 on, with covariances if it has them, and the components it names.

    Raises ConfigError for a file of another kind, with other realisations, or with another seed than the case's.
    """
    try:
        if path.suffix == ".npz":
            with path.open("rb") as file, np.lib.npyio.NpzFile(file, allow_pickle=False) as archive:
                return _estimates_in_arrays(path, dict(archive), case, components)
        import pandas as pd

        if path.suffix not in (".csv", ".parquet"):
            raise ConfigError(f"{path}: must end in .npz, .csv or .parquet")
        table = pd.read_csv(path, comment="#") if path.suffix == ".csv" else pd.read_parquet(path)
        return _estimates_in_table(path, table.rename(columns=lambda name: str(name).strip()), case)
    except (OSError, EOFError, ValueError, TypeError, ImportError, BadZipFile) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from error


def _estimates_in_arrays(
    path: Path, arrays: Mapping[str, np.ndarray], case: Case, components: tuple[str, ...]
) -> tuple[Any, tuple[str, ...]]:
    """Estimates in the arrays of an .npz file; see `read_estimates`."""
    if "estimates" not in arrays:
        raise ConfigError(f"{path}: must hold an array `estimates` (n, K, d), got {', '.join(arrays) or 'nothing'}")
    if "seed" in arrays and (seed := arrays["seed"].ravel().tolist()) != [case.seed]:
        raise ConfigError(f"{path}: of plots with seed {', '.join(map(str, seed))}; the run has seed {case.seed}")
    x, P = arrays["estimates"], arrays.get("covariances")
    if x.ndim not in (2, 3):
        raise ConfigError(f"{path}: estimates must be an array (n, K, d), got {x.dtype} {x.shape}")
    realisations = next(
        (arrays[key].ravel() for key in ("realisation", "realisations") if key in arrays), np.arange(len(x))
    )
    if len(realisations) != len(x) or realisations.dtype.kind not in "fiu":
        got = f"{len(realisations)} of type {realisations.dtype}"
        raise ConfigError(f"{path}: realisation: must be {len(x)} numbers, as many as there are estimates, got {got}")
    order = _realisation_order(path, realisations)
    named_components = tuple(map(str, np.atleast_1d(arrays["components"]))) if "components" in arrays else components
    if P is None:
        return x[order], named_components
    return (x[order], P[order] if P.shape[:1] == x.shape[:1] else P), named_components


def _estimates_in_table(path: Path, table: "pd.DataFrame", case: Case) -> tuple[Any, tuple[str, ...]]:
    """Estimates in a table with a row for each realisation and scan: `realisation`, `k` or `t_s`, and components."""
    plot_arrays = plots.prepare_drawing(registry.study(case.study), case)(0, 1)
    columns = {
        name: component
        for name in table
        for component, unit in plot_arrays.components
        if name in (component, true_column(component, unit).removeprefix(TRUTH_PREFIX))
    }
    scan_column = next((name for name in INDEX_COLUMNS[1:] if name in table), "")
    if "realisation" not in table or not scan_column or not columns:
        names = ", ".join(name for name, _ in plot_arrays.components)
        required = f"realisation, k or t_s, and of {names} those it estimates"
        raise ConfigError(f"{path}: must have the columns {required}; got {', '.join(map(str, table))}")
    if not len(table):
        raise ConfigError(f"{path}: has no rows")
    numbers = {name: _column_numbers(path, table, name) for name in ("realisation", scan_column, *columns)}
    K = len(plot_arrays.t_s)
    scan_values = np.arange(1, K + 1.0) if scan_column == "k" else plot_arrays.t_s
    scan = _scan_indices(path, scan_column, numbers[scan_column], scan_values)
    rows = np.lexsort((scan, numbers["realisation"]))
    realisations, counts = np.unique(numbers["realisation"], return_counts=True)
    is_incomplete = counts != K
    if not is_incomplete.any():  # the rows of a realisation may still be twice of one scan
        is_incomplete = (scan[rows].reshape(-1, K) != np.arange(K)).any(1)
    if is_incomplete.any():
        raise ConfigError(f"{path}: realisation {realisations[is_incomplete][0]:g}: must have a row for each of the "
                          f"{K} scans, empty cells where there is no estimate")  # fmt: skip
    order = _realisation_order(path, realisations)
    x = np.stack([numbers[name][rows].reshape(-1, K) for name in columns], axis=-1)
    return x[order], tuple(columns.values())


def _scan_indices(path: Path, name: str, values: np.ndarray, scan_values: np.ndarray) -> np.ndarray:
    """The index of the scan of each row, from its number or time. Raises ConfigError for one that is no scan."""
    scan = np.searchsorted((scan_values[1:] + scan_values[:-1]) / 2, values)
    tolerance = TIME_TOLERANCE * np.diff(scan_values).min(initial=np.inf)
    is_off_scan = np.abs(values - scan_values[scan]) > tolerance
    if is_off_scan.any():
        scan_range = f"{scan_values[0]:g} … {scan_values[-1]:g}"
        raise ConfigError(f"{path}: {name}: must be one of the {len(scan_values)} scans of the plots, {scan_range}, "
                          f"got {values[is_off_scan][0]:g}")  # fmt: skip
    return scan


def _column_numbers(path: Path, table: "pd.DataFrame", name: str) -> np.ndarray:
    """A column as numbers, not-a-number where it is empty."""
    import pandas as pd

    numbers = pd.to_numeric(table[name], errors="coerce")
    is_invalid = numbers.isna() & (table[name].notna() | (name in INDEX_COLUMNS))
    if is_invalid.any():
        row = int(np.argmax(is_invalid))
        got = table[name].iloc[row]
        raise ConfigError(
            f"{path}: row {row + 1}, {name}: must be a number, got {got!r}"
            if isinstance(got, str)
            else f"{path}: row {row + 1}, {name}: has no value"
        )
    return numbers.to_numpy(dtype=float)


def _realisation_order(path: Path, rows: np.ndarray) -> np.ndarray:
    """The order in which the realisations of a file are 0, 1, 2, …"""
    order = np.argsort(rows, kind="stable")
    if (misplaced := np.flatnonzero(rows[order] != np.arange(len(rows)))).size:
        expected = int(misplaced[0])
        raise ConfigError(f"{path}: must hold every realisation from 0 on once: where {expected} should be there is "
                          f"{rows[order][expected]}; `radarsim simulate CONFIG --realisations 0:{len(rows)} -o …` "
                          f"writes them")  # fmt: skip
    return order
