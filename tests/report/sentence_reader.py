"""Reads sentences back: every value with an interval, and every exact one, must stand in a row of the tables.

A value that is quoted as measured though its row has an exact one is a fault, and so is a value that no row has. An
interval that is wider than its row's must be said to hold for all values compared. Both languages write numbers in
their own way, so that the sentences of each are read by the same tables."""

import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np
import pandas as pd

NUMBER = r"[−-]?(?:\d[\d,\u202f\u00a0]*(?:\.\d+)?|∞)(?:·10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?"
UNIT = r"(?:[ \u00a0](?:%|°|k?m/s²|k?m/s|k?m|s|к?м/с²|к?м/с|к?м|с|Hz\S*|Гц\S*|rad\S*|рад\S*|m²|м²))?"
MEASURED = re.compile(rf"(?P<value>{NUMBER}){UNIT} \[(?P<low>{NUMBER}), (?P<high>{NUMBER})\]")
EXACT = re.compile(rf"(?P<value>{NUMBER}){UNIT}(?: (?:lower|higher))? \((?:exact|точно)\)")
FOR_ALL = re.compile(r"intervals? for all|интервал\w* сразу для всех")
RUSSIAN_COMMA = re.compile(r"(?<=\d),(?=\d)")
SUPERSCRIPTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
CHANGES = (  # how sentences write a column: itself, in per cent, of a gain the loss and the factor
    lambda x: x,
    lambda x: 100 * x,
    lambda x: -x,
    lambda x: 1 - x / 100,
)


WITHOUT_COLUMN = re.compile(r"over the bound|отнесённое к границе")  # σ over the posterior bound, which no table has


class Reading(NamedTuple):
    """What a sentence's numbers are: found in a row, contradicted by it, or in no row."""

    read: list[str]
    faults: list[str]


class Table(NamedTuple):
    """The measured columns of all tables: values with their ends (n,), and exact values, NaN where unknown."""

    name: str
    value: np.ndarray
    low: np.ndarray
    high: np.ndarray
    exact: np.ndarray


def columns_of(tables) -> Iterator[Table]:
    """Each measured column of the tables with its ends and its exact column."""
    for name, table in tables.items():
        columns = [str(column) for column in table.columns]
        for value, low, high in zip(columns, columns[1:], columns[2:], strict=False):
            if low.endswith("lo") and high.endswith("hi"):
                known = [c for c in columns if c in (f"exact_{value}", f"exact_{value.removeprefix('gain_')}", "exact")]
                numbers = [pd.to_numeric(table[c], "coerce").to_numpy(float) for c in (value, low, high, *known[:1])]
                exact = numbers[3] if known else np.full(len(table), np.nan)
                yield Table(f"{name}.{value}", *numbers[:3], exact)


def derived_columns(tables) -> Iterator[Table]:
    """σ over what a filter believes, biases known by formula, and σ by a paired gain over an exact σ."""
    curves, gains = tables["curves"], tables["gains"]
    ratios = [curves[name].to_numpy(float) for name in ("sigma", "sigma_lo", "sigma_hi")]
    with np.errstate(divide="ignore", invalid="ignore"):
        believed = curves["believed_sigma"].to_numpy(float)
        exact = curves["exact_sigma"].to_numpy(float) / believed
        yield Table("σ over believed", *(part / believed for part in ratios), exact)
    if "conversion" in tables:
        biases = [tables["conversion"][name].to_numpy(float) for name in ("bias_m", "bias_lo", "bias_hi", "formula_m")]
        yield Table("bias of a conversion", *biases)
    keys = ["case", "baseline", "component", "k"]
    exact = curves.rename(columns={"filter": "baseline"})[[*keys, "exact_sigma"]]
    paired = gains.merge(exact, on=keys, how="left")
    base = paired["exact_sigma"].to_numpy(float)
    parts = [base * (1 - paired[name].to_numpy(float) / 100) for name in ("gain_percent", "gain_hi", "gain_lo")]
    yield Table("paired σ", *parts, np.full(len(paired), np.nan))


def number(text: str) -> tuple[float, float]:
    """A number of a sentence, and half a unit of its last digit."""
    text = text.replace("−", "-").replace("\u202f", "").replace("\u00a0", "").replace(",", "").replace("∞", "inf")
    mantissa, _, power = text.partition("·10")
    scale = 10.0 ** int(power.translate(SUPERSCRIPTS)) if power else 1.0
    decimals = len(mantissa.partition(".")[2])
    trailing = len(mantissa) - len(mantissa.rstrip("0")) if not decimals and mantissa != "0" else 0
    return float(mantissa) * scale, 0.501 * scale * 10.0 ** (trailing - decimals)


def near(column: np.ndarray, text: str) -> np.ndarray:
    """Which values (n,) round to a number of a sentence; of its last digit by one, where ends are rounded outward."""
    value, half = number(text)
    with np.errstate(invalid="ignore"):
        return (np.abs(column - value) <= 2 * half) | (column == value)


def read_sentence(sentence: str, tables: Mapping, language: str = "en", derived=()) -> Reading:
    """Each number with an interval, and each exact one, by the row that it stands in.

    derived: further columns (`Table`) that sentences may take their numbers from, as σ by a paired ratio."""
    if language != "en":
        sentence = RUSSIAN_COMMA.sub(".", sentence).replace("; ", ", ")
    columns, read, faults = [*columns_of(tables), *derived], [], []
    sentence = WITHOUT_COLUMN.split(sentence)[0]
    for match in MEASURED.finditer(sentence):
        text = match[0]
        rows = [found for column in columns for found in _rows(column, match, bool(FOR_ALL.search(sentence)))]
        if not rows:
            faults.append(f"{text}: in no row")
        elif all(not np.isnan(exact) for _, exact in rows):
            faults.append(f"{text}: measured, though {rows[0][0]} is known exactly, {rows[0][1]:.6g}")
        else:
            read.append(text)
    for match in EXACT.finditer(sentence):
        is_known = any(near(change(column.exact), match["value"]).any() for column in columns for change in CHANGES)
        (read if is_known else faults).append(match[0] if is_known else f"{match[0]}: in no exact column")
    return Reading(read, faults)


def _rows(column: Table, match: re.Match, may_be_wider: bool) -> Iterator[tuple[str, float]]:
    """The name and the exact value of the rows of a column that hold a value and the ends of its interval."""
    for change in CHANGES:
        value, ends = change(column.value), np.sort([change(column.low), change(column.high)], axis=0)
        has_value = near(value, match["value"])
        is_same = near(ends[0], match["low"]) & near(ends[1], match["high"])
        if may_be_wider:
            is_same |= (number(match["low"])[0] <= ends[0] + 1e-9) & (ends[1] - 1e-9 <= number(match["high"])[0])
        yield from ((column.name, exact) for exact in column.exact[has_value & is_same])
