"""Curves and gains of a result as labelled arrays: a dataset of xarray, or a netCDF file."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.errors import ConfigError
from radarsim.report import atomic_files
from radarsim.report.column_units import UNIT_COLUMN, column_units

if TYPE_CHECKING:
    import pandas as pd
    import xarray


CURVE_DIMENSIONS = ("case", "filter", "component", "k")
GAIN_DIMENSIONS = ("case", "filter", "baseline", "component", "k")
LABELLED_COLUMNS = ("t_s", "unit")  # coordinates

Variable = tuple[tuple[str, ...], np.ndarray, dict[str, str]]  # dimensions, values, attributes


@dataclass(frozen=True)
class LabelledArrays:
    """Arrays with named dimensions.

    labels: those of each dimension, texts or whole numbers. variables: by name the dimensions, the array, and its
    attributes. attributes: of the whole."""

    labels: Mapping[str, np.ndarray]
    variables: Mapping[str, Variable]
    attributes: Mapping[str, str]


def labelled_arrays(curves: "pd.DataFrame", gains: "pd.DataFrame", attributes: Mapping[str, str]) -> LabelledArrays:
    """The columns of curves.csv and gains.csv over case, filter, component and scan; where a table has no row, numbers
    are NaN, and texts empty. Raises ConfigError where several rows have the same place."""
    tables = [(curves, CURVE_DIMENSIONS), (gains, GAIN_DIMENSIONS)]
    columns_by_dimension: dict[str, list[pd.Series]] = {}
    for table, dimensions in tables:
        for name in dimensions if len(table) else ():
            columns_by_dimension.setdefault(name, []).append(table[name])
    labels = {name: _labels(name, columns) for name, columns in columns_by_dimension.items()}
    variables: dict[str, Variable] = {}
    if len(curves):
        variables["t_s"] = _times(curves, labels)
        variables["unit"] = ("component",), _units(curves, labels["component"]), {}
    for table, dimensions in tables:
        units = column_units(table.columns)
        if len(table) and (twice := table.duplicated([*dimensions])).any():
            place = ", ".join(f"{name} {table[name][twice].iloc[0]}" for name in dimensions)
            raise ConfigError(f"several rows of one table are of {place}: they have no place in an array")
        columns = [name for name in table.columns if name not in (*dimensions, *LABELLED_COLUMNS)]
        for name in columns if len(table) else ():
            unit = {"units": units[name]} if units.get(name, UNIT_COLUMN) != UNIT_COLUMN else {}
            variables[name] = (dimensions, _array(table, dimensions, name, labels), unit)
    return LabelledArrays(labels, variables, attributes)


def _labels(name: str, columns: "list[pd.Series]") -> np.ndarray:
    """The labels of a dimension: in order of appearance, of scans in their order."""
    values = list(dict.fromkeys(value for column in columns for value in column.tolist()))
    return np.array(sorted(map(int, values))) if name == "k" else np.array(values, dtype=object)


def _times(curves: "pd.DataFrame", labels: Mapping[str, np.ndarray]) -> Variable:
    dimensions = ("case", "k")
    return dimensions, _array(curves, dimensions, "t_s", labels), {"units": "s"}


def _units(curves: "pd.DataFrame", components: np.ndarray) -> np.ndarray:
    by_component = dict(zip(curves["component"], curves["unit"], strict=True))
    return np.array([str(by_component.get(name, "")) for name in components], dtype=object)


def _array(
    table: "pd.DataFrame", dimensions: tuple[str, ...], column: str, labels: Mapping[str, np.ndarray]
) -> np.ndarray:
    """A column of a table as an array over these dimensions."""
    positions = [{label: i for i, label in enumerate(labels[name].tolist())} for name in dimensions]
    indices = tuple(table[name].map(where).to_numpy() for name, where in zip(dimensions, positions, strict=True))
    shape, cells = [len(labels[name]) for name in dimensions], table[column]
    if cells.dtype.kind in "biuf":
        values = np.full(shape, np.nan)
        values[indices] = cells.to_numpy(dtype=float)
        return values
    texts = np.full(shape, "", dtype=object)
    texts[indices] = ["" if text is None or text != text else str(text) for text in cells.tolist()]
    return texts


def to_xarray(arrays: LabelledArrays) -> "xarray.Dataset":
    """The arrays as a dataset of xarray. Raises ConfigError where that is not installed."""
    try:
        import xarray
    except ImportError as error:
        raise ConfigError("to_xarray needs the package xarray: pip install 'radarsim[xarray]'") from error
    data = {name: variable for name, variable in arrays.variables.items() if name not in LABELLED_COLUMNS}
    coordinates = {**arrays.labels, **{name: arrays.variables[name] for name in LABELLED_COLUMNS if len(arrays.labels)}}
    return xarray.Dataset(data, coordinates, dict(arrays.attributes))


def write_netcdf(path: str | os.PathLike[str], arrays: LabelledArrays) -> None:
    """Write a netCDF file (version 3, 64-bit offsets): numbers as they are, texts as UTF-8 characters.

    Raises StoreError where it cannot be written."""
    from io import BytesIO

    from scipy.io import netcdf_file

    content = BytesIO()
    file: Any = netcdf_file(content, "w", version=2)
    for name, value in arrays.attributes.items():
        setattr(file, name, value.encode())
    for name, labels in arrays.labels.items():
        file.createDimension(name, len(labels))
    variables = {**{name: ((name,), labels, {}) for name, labels in arrays.labels.items()}, **arrays.variables}
    for name, (dimensions, values, attributes) in variables.items():
        _create_variable(file, name, dimensions, values, attributes)
    file.flush()
    atomic_files.replace_all(Path(path).parent, {Path(path).name: content.getvalue()})


def _create_variable(
    file: Any, name: str, dimensions: tuple[str, ...], values: np.ndarray, attributes: Mapping[str, str]
) -> None:
    """A variable of a netCDF file; texts get a last dimension of their characters."""
    if values.dtype == object:
        texts = np.array([str(value).encode() for value in values.ravel()], dtype="S")
        letters = f"{name}_letters"
        file.createDimension(letters, max(texts.dtype.itemsize, 1))
        variable = file.createVariable(name, "c", (*dimensions, letters))
        variable[:] = texts.view("S1").reshape(*values.shape, -1)
        variable._Encoding = b"utf-8"
        return
    variable = file.createVariable(name, "i4" if values.dtype.kind == "i" else "f8", dimensions)
    variable[:] = values
    for attribute, text in attributes.items():
        setattr(variable, attribute, text.encode())
    if {"case", "component", "k"}.issubset(dimensions):
        variable.coordinates = b"t_s unit"
