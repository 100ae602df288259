"""Half-widths of σ and what they need: against the tables, against known laws, for every study."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import radarsim
from radarsim.api import result_content
from radarsim.api.configs import load
from radarsim.api.maintenance.self_test import KNOWN_FOLDER
from radarsim.config.common_keys import LARGEST_REALISATIONS
from radarsim.report import precision
from radarsim.report.precision import (
    FIRST_LOOK,
    look_counts,
    needed_realisations,
    scale_sums,
    widest_cell,
    with_gaussian_sums,
)
from radarsim.report.quantities import LOCK, LOST, WRONG
from radarsim.report.statistics import Z95
from radarsim.report.tables import curves
from radarsim.studies import registry
from tests.tolerances import assert_rounded


@pytest.fixture(scope="module")
def results():
    """A small result of each study."""
    studies = ("range_doppler", "multimodel", "sonar", "discriminator")
    return {study: radarsim.run(KNOWN_FOLDER / f"{study}.yaml").cases for study in studies}


@pytest.mark.parametrize("study", ["range_doppler", "multimodel", "sonar", "discriminator"])
def test_curves_alone_are_those_among_all_tables(results, study):
    cases = results[study]
    alone, among = registry.study(study).curves(cases), result_content.case_tables(cases)["curves"]
    columns = [name for name in alone.columns if name != "note"]
    assert alone[columns].equals(among[columns])
    if "note" in alone:  # a study's own; what every study's rows may bear comes to it among all tables
        assert all(own in note for own, note in zip(alone["note"], among["note"], strict=True))


@pytest.mark.parametrize("study", ["range_doppler", "multimodel", "sonar", "discriminator"])
def test_the_worst_cell_is_the_widest_of_the_table(results, study):
    for case in results[study]:
        table = registry.study(study).curves([case])
        widths = 50 * (table["sigma_hi"] - table["sigma_lo"]) / table["sigma"]
        cell = widest_cell(case, registry.study(study).curves)
        assert cell.percent == widths.max()
        row = table.loc[widths.idxmax()]
        assert (cell.filter, cell.component, cell.k) == (row["filter"], row["component"], row["k"])


def test_looks_are_declared_doublings_up_to_n():
    assert list(look_counts(FIRST_LOOK - 1)) == []
    assert list(look_counts(2_000)) == [2_000]
    assert list(look_counts(15_999)) == [2_000, 4_000, 8_000, 15_999]


def test_what_is_needed_is_the_first_look_that_suffices(results):
    (case,) = results["range_doppler"]
    for percent in (0.1, 1, 3, 50):
        n = needed_realisations(case, percent, curves)
        assert widest_cell(scale_sums(case, n), curves).percent < percent
        assert n == FIRST_LOOK or widest_cell(scale_sums(case, n // 2), curves).percent >= percent


def test_gaussian_errors_need_as_many_as_their_chi_square_says(results):
    """1.96 / √(2N) to first order, whatever the bias: a tenth of a per cent takes 1.92·10⁶."""
    (case,) = results["range_doppler"]
    n = needed_realisations(with_gaussian_sums(case), 0.1, curves)
    assert n == FIRST_LOOK * 2**10
    exact = scale_sums(with_gaussian_sums(case), 1_000_000)
    widths = widest_cell(exact, curves).percent
    # Second order: z²/n of the quantiles, (z² + 1)/4n of Student's t.
    assert widths == pytest.approx(100 * Z95 / np.sqrt(2e6), rel=(1.25 * Z95**2 + 0.25) / 1e6)


def test_losses_are_what_locks_leave(results):
    table = pd.DataFrame(
        {
            "case": "a",
            "filter": "f",
            "k": [1, 2],
            "lock_rate": [0.5, 0.9],
            "lock_lo": [0.1, 0.85],
            "lock_hi": [0.9, 0.95],
        }
    )
    (case,) = results["range_doppler"]
    lock, lost = (widest_cell(case, lambda _: table, of) for of in (LOCK, LOST))
    assert (lock.k, lost.k) == (2, 2)  # the last
    assert_rounded(lock.percent, 50 * 0.1 / 0.9, operations=4)
    assert_rounded(lost.percent, 50 * 0.1 / 0.1, condition=0.95 / 0.1, operations=4)  # a difference


def test_what_is_not_known_is_never_reached(results):
    (case,) = results["range_doppler"]
    sums = {name: array.copy() for name, array in case.sums.items()}
    sums["error"][0, 3, 0] = np.nan
    lost = replace(case, sums=sums)
    assert widest_cell(lost, curves).percent == np.inf
    assert "σ not known" in str(widest_cell(lost, curves))
    assert needed_realisations(lost, 10, curves) is None
    sums["error"][0, 3, 0] = 0.0
    assert widest_cell(replace(case, sums=sums), curves).percent < 10
    assert precision.MAX_REALISATIONS == LARGEST_REALISATIONS  # more cannot be asked for


def folds(*rates):
    """A table of two filters' right folds at one scan each, (value, lo, hi) by filter."""
    names = ("sought", "other")
    labels = [{"case": "one", "filter": name, "k": 9} for name in names]
    values = [dict(zip(("right", "right_lo", "right_hi"), one, strict=True)) for one in rates]
    made = pd.DataFrame([label | value for label, value in zip(labels, values, strict=True)])
    return lambda _: made


def test_of_rare_events_the_filter_they_are_drawn_for_counts_alone(results):
    (case,) = results["range_doppler"]
    table = folds((0.75, 0.625, 0.875), (1.0, 0.5, 1.0))
    assert widest_cell(case, table, WRONG).filter == "other"
    for aimed_at, filter_name in (("sought", "sought"), ("other", "other"), (None, "other")):
        aimed = replace(case, spec=SimpleNamespace(rare=SimpleNamespace(aimed_at=aimed_at)))
        assert widest_cell(aimed, table, WRONG).filter == filter_name
    drawn = replace(case, spec=SimpleNamespace(rare=SimpleNamespace(aimed_at="sought")))
    assert widest_cell(drawn, table, WRONG).percent == 50.0
    assert (
        widest_cell(drawn, curves).percent == widest_cell(case, curves).percent
    )  # σ is of plain realisations, of all filters


def test_events_never_seen_are_told_with_their_bound(results):
    (case,) = results["range_doppler"]
    none = widest_cell(case, folds((1.0, 0.75, 1.0), (0.5, 0.25, 0.75)), WRONG)
    assert (none.filter, none.percent, none.below) == ("sought", np.inf, 0.25)
    told = f"one: filter 'sought', k = 9: rate of wrong folds none seen, so below 0.25, at {case.count} realisations"
    assert str(none) == told
    assert widest_cell(case, folds((0.75, 0.5, 1.0), (0.5, 0.25, 0.75)), WRONG).below is None
    unknown = widest_cell(case, folds((np.nan, np.nan, np.nan), (0.5, 0.25, 0.75)), WRONG)
    assert unknown.below is None
    assert "not known" in str(unknown)


@pytest.mark.parametrize("config", ["ambiguous_rare", "discriminator_rare"])
def test_the_shipped_rare_events_are_of_one_filter(config):
    for case in load(config).cases:
        assert case.spec.rare.aimed_at in [member.name for member in case.spec.members]
