"""What filters believe of their errors: one direction, one set of words and columns in every study."""

import numpy as np
import pytest

import radarsim
from radarsim.report import consistency_tables, statistics


def test_verdicts():
    mean = np.array([0.8, 1.0, 1.3])
    assert list(consistency_tables.consistency_verdict(mean, np.full(3, 0.9), np.full(3, 1.1))) == [
        consistency_tables.PESSIMISTIC,
        consistency_tables.CONSISTENT,
        consistency_tables.OPTIMISTIC,
    ]


def test_a_ratio_over_one_is_optimistic():
    of = consistency_tables.ratio_columns(statistics.Estimate(*np.array([[30.0], [28.0], [33.0]])), np.array([20.0]))
    assert [of[name].item() for name in ("ratio", "ratio_lo", "ratio_hi")] == [1.5, 1.4, 1.65]


@pytest.mark.parametrize("looks", [1, 24])
def test_bounds_from_the_spread_judge_as_the_interval_does(looks):
    rng, n = np.random.default_rng(3), 400
    q = np.linspace(0.8, 1.2, 101)[:, None] * rng.chisquare(3, size=(101, n)) / 3
    sums = q.sum(axis=1), np.square(q).sum(axis=1), n
    verdicts = consistency_tables.consistency_verdict(
        q.mean(axis=1), *consistency_tables.bounds_from_spread(*sums, looks)
    )
    wide = statistics.mean_square(*sums, looks)
    assert list(verdicts == consistency_tables.OPTIMISTIC) == list(wide.lo > 1)
    assert list(verdicts == consistency_tables.PESSIMISTIC) == list(wide.hi < 1)
    assert set(verdicts) == {
        consistency_tables.PESSIMISTIC,
        consistency_tables.CONSISTENT,
        consistency_tables.OPTIMISTIC,
    }


@pytest.mark.slow_cases("multimodel-quantities2-False-False")
@pytest.mark.parametrize(
    ("config", "quantities", "exact", "believed"),
    [
        ("rls2", ("nees",), True, True),
        ("sonar_correlated", ("nees",), True, True),
        ("multimodel", ("nees", "nis"), False, False),
    ],
)
def test_every_study_has_the_same_columns(config, quantities, exact, believed):
    made = radarsim.run(config, realisations=1000).tables
    columns = list(made["consistency"].columns)
    for quantity in quantities:
        first = columns.index(quantity)
        known = [f"exact_{quantity}"] if exact else []
        ends = [f"{quantity}_{end}" for end in ("bound_lo", "bound_hi", "verdict")]
        wanted = [quantity, f"{quantity}_lo", f"{quantity}_hi", *known, *ends]
        assert columns[first : first + len(wanted)] == wanted
        known = {consistency_tables.OPTIMISTIC, consistency_tables.CONSISTENT, consistency_tables.PESSIMISTIC}
        assert set(made["consistency"][f"{quantity}_verdict"]) <= known
    curves = made["curves"].drop(columns="note", errors="ignore")
    assert list(curves.columns)[-4:] == ["n_eff", "believed_sigma", "floor", "floor_kind"]
    assert curves["believed_sigma"].notna().all() == believed
    assert curves["believed_sigma"].isna().all() != believed


def test_a_known_expectation_is_judged_in_place_of_the_mean():
    mean = statistics.Estimate(*(np.array([value] * 3) for value in (1.2, 1.15, 1.25)))
    bounds = np.full(3, 0.9), np.full(3, 1.1)
    made = consistency_tables.normalised_square_columns("nees", mean, bounds, np.array([1.0, 0.8, np.nan]))
    assert made["nees_verdict"].tolist() == ["consistent", "pessimistic", "optimistic"]
