"""Tables: the contract's columns and order, and the bytes of the CSV."""

import io
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from radarsim.report import csv_text, tables
from radarsim.report.statistics import Z95
from tests.tolerances import assert_rounded, rounding


def read(table):
    return pd.read_csv(io.BytesIO(csv_text.to_csv(table)))


def test_rows_in_order_and_only_where_there_is_an_estimate(paper):
    table = tables.curves(paper[:2])
    keys = list(zip(table["case"], table["filter"], table["component"], table["k"], strict=True))
    order = {name: i for i, name in enumerate(("rls1", "rls2", "r", "r+Vr", "Vr", "ar"))}
    components = {"r": 0, "Vr": 1, "ar": 2}
    assert keys == sorted(keys, key=lambda row: (order[row[0]], order[row[1]], components[row[2]], row[3]))
    first = table.groupby(["case", "filter", "component"])["k"].min()
    assert first["rls1", "r", "r"] == 1
    assert first["rls1", "r", "Vr"] == first["rls1", "r", "ar"] == 3
    assert first["rls1", "r+Vr", "Vr"] == 1
    assert first["rls1", "r+Vr", "ar"] == 2
    assert len(table) == 2 * (15 + 13 + 13 + 15 + 15 + 14)


def test_values_of_expected_sums_are_exact(paper):
    table = tables.curves(paper)
    np.testing.assert_allclose(table["sigma"], table["exact_sigma"], rtol=rounding(operations=4))
    assert (table["sigma_lo"] < table["sigma"]).all()
    assert (table["sigma"] < table["sigma_hi"]).all()
    half = (table["sigma_hi"] - table["sigma_lo"]) / 2 / table["sigma"]
    np.testing.assert_allclose(half, Z95 / np.sqrt(2e5), rtol=(1.25 * Z95**2 + 0.25) / 1e5)  # as in test_precision


def test_gains_are_against_the_baseline(paper):
    table = tables.gains(paper)
    assert set(table["filter"]) == {"r+Vr"}
    assert set(table["baseline"]) == {"r"}
    assert_rounded(table["gain_percent"], table["exact_percent"], size=100, operations=6)
    other = replace(paper[0], axes=replace(paper[0].axes, baseline=1))
    assert set(tables.gains([other])["filter"]) == {"r"}


def test_fewer_estimates_than_realisations(paper):
    one = paper[0]
    half = replace(one, sums={**one.sums, "estimates": np.full(one.axes.available.shape, one.count / 2)})
    table = tables.curves([half])
    assert set(table["n"]) == {one.count // 2}
    np.testing.assert_allclose(table["sigma"], np.sqrt(2) * table["exact_sigma"], rtol=rounding(operations=5))


def test_exact_values_come_first():
    rows = pd.DataFrame({"sigma": [3.0, 2.0, 1.0], "exact_sigma": [1.5, 2.5, np.nan]})
    assert tables.exact_first(rows, "sigma", "exact_sigma").tolist() == [1.5, 2.5, 1.0]


def test_csv_reads_back_the_same(paper):
    table = tables.curves(paper[:1])
    table.loc[3, "exact_sigma"] = np.nan
    text = csv_text.to_csv(table).decode()
    again = pd.read_csv(io.StringIO(text), dtype=str, keep_default_na=False)
    for name in table:  # by Python's own reading of numbers, which is exact
        if pd.api.types.is_numeric_dtype(table[name]):
            again[name] = again[name].replace("", "nan").astype(float)
    pd.testing.assert_frame_equal(again, table, check_exact=True, check_dtype=False)
    assert ",," in text.splitlines()[4]
    assert text.endswith("\n")
    assert "\r" not in text
    assert csv_text.to_csv(tables.curves(paper[:1])) == csv_text.to_csv(tables.curves(paper[:1]))


def test_csv_equals_the_librarys(paper):
    table = tables.gains(paper)
    assert csv_text.to_csv(table) == table.to_csv(index=False, lineterminator="\n").encode()


@pytest.mark.parametrize("name", ["a,b", 'say "x"', "two\nlines", "plain", "<b>", "Δ"])
def test_csv_quotes_what_needs_it(name, paper):
    table = tables.curves([replace(paper[0], name=name)])
    assert set(read(table)["case"]) == {name}


def test_csv_of_flags_counts_and_nothing():
    table = tables.frame({"good": [True, False], "k": [1, 2], "x": [np.inf, np.nan], "word": ["a", None]})
    assert csv_text.to_csv(table) == b"good,k,x,word\ntrue,1,inf,a\nfalse,2,,\n"
    assert csv_text.to_csv(tables.frame({"a": [], "b": []})) == b"a,b\n"
