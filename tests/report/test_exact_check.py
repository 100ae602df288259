"""Exact values beside measured ones: what is told, what is chance, and what a sample of heavy tails may lack."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

import radarsim
from radarsim.api.result import Result
from radarsim.config import find_files
from radarsim.errors import DisagreementError
from radarsim.report import exact_check, tables
from radarsim.report.quantities import Quantity
from radarsim.report.statistics import ERROR_OF_PROGRAM, Z95, Estimate, rate, root_mean_square, standard_errors
from tests.program import command
from tests.tolerances import assert_rounded


def test_standard_errors_of_an_even_interval():
    of = Estimate(2.0, 2.0 - Z95 * 0.5, 2.0 + Z95 * 0.5)
    assert_rounded(standard_errors(of, np.array([2.0, 3.0, 0.0])), [0, 2, 4], operations=4)
    assert np.isnan(standard_errors(of, np.nan))
    assert standard_errors(Estimate(1.0, 1.0, 1.0), 2.0) == np.inf
    assert standard_errors(Estimate(1.0, 0.5, np.inf), 9.0) == 0


def test_standard_errors_of_a_rate_are_its_score():
    """Of 20 events in 10⁷, towards more: (μ − 20)/√μ; and no number of events is far from a rate of none of them."""
    n = 1e7
    for expected in (30.0, 60.0, 100.0):
        # Poisson's law is the binomial one but for a term of the share.
        score = (expected - 20) / expected**0.5
        assert standard_errors(rate(20.0, n), expected / n) == pytest.approx(score, rel=expected / n)
    assert standard_errors(rate(0.0, n), 30 / n) == pytest.approx(30**0.5, rel=30 / n)
    assert (standard_errors(rate(np.arange(1.0, 30), n), 1e-20) < ERROR_OF_PROGRAM).all()


@pytest.mark.slow_cases("1000")
@pytest.mark.parametrize("n", [200, 1000])
def test_standard_errors_of_sigma_stray_no_further_than_normal_ones(n):
    """Of 20 000 samples of Gaussian errors: 0.27 % beyond three, within three binomial standard errors or fewer."""
    squares = np.random.default_rng(5).standard_normal((20_000, n)) ** 2
    of = root_mean_square(squares.sum(axis=1), (squares**2).sum(axis=1), np.full(20_000, float(n)))
    apart = standard_errors(of, 1.0)
    assert (apart > 3).sum() < 54 + 3 * 54**0.5
    assert (apart > 2).sum() > 0.6 * 0.0455 * 20_000  # and it is no bound that holds always
    assert apart.max() < ERROR_OF_PROGRAM


def changed(result, **axes):
    return replace(result, axes=replace(result.axes, **axes))


def made(*results):
    return {"curves": tables.curves(results), "gains": tables.gains(results)}


def test_each_row_of_each_table_counts(expected_radar):
    """Sums as they are expected agree; one σ of 85 that is 3 % off, one bias, one gain are told with their place."""
    radar = expected_radar("rls2", count=100_000)
    assert exact_check.disagreements(made(radar)) == []
    one = np.ones(radar.axes.exact_sigma.shape)
    one[1, 7, 1] = 1.03
    wrong = changed(radar, exact_sigma=radar.axes.exact_sigma * one)
    (line,) = exact_check.disagreements(made(wrong))
    assert line.startswith("curves.csv: rls2, r+Vr, Vr, k = 8 (70 s): sigma measured ")
    assert "1 of 85 rows of this column exceed 5.85" in line
    moved = changed(radar, exact_bias=radar.axes.exact_bias + 0.05 * radar.axes.exact_sigma * (one > 1))
    (line,) = exact_check.disagreements(made(moved))
    assert line.startswith("curves.csv: rls2, r+Vr, Vr, k = 8 (70 s): bias measured ")
    (line,) = exact_check.disagreements(made(changed(radar, exact_gain=radar.axes.exact_gains + (one > 1))))
    assert line.startswith("gains.csv: rls2, r+Vr, Vr, k = 8 (70 s): gain_percent measured ")


def test_a_bias_taken_for_none_is_told(expected_radar):
    """A target that jerks: the filters lag, and an exact bias of zero is as wrong as the σ that is right beside it."""
    radar = expected_radar("rls2", target={"kind": "polynomial", "coefficients": [100e3, -250, 4, 0.3]})
    assert exact_check.disagreements(made(radar)) == []
    (line,) = exact_check.disagreements(made(changed(radar, exact_bias=0 * radar.axes.exact_bias)))
    assert "bias measured" in line


def test_few_realisations_say_nothing(expected_radar):
    few = expected_radar("rls2", count=150)
    wrong = changed(few, exact_sigma=2 * few.axes.exact_sigma, exact_gain=few.axes.exact_gains - 90)
    assert exact_check.disagreements(made(wrong)) == []


def test_what_is_nearly_exact_may_differ_by_as_much(expected_radar):
    """At 10¹⁰ realisations a ten-thousandth is 14 standard errors."""
    radar = expected_radar("rls2", count=10**10)
    near = made(changed(radar, exact_sigma=radar.axes.exact_sigma * 1.0001))
    assert len(exact_check.disagreements(near)) == 1
    assert exact_check.disagreements(near, ["rls2"]) == []


def curves(sigma, exact, kurtosis, bias=(0.0, 0.0), exact_bias=(0.0, 0.0), n=100_000):
    """A filter at two scans, of 10⁵ realisations; κ is about the truth."""
    sigma, kurtosis, bias = (np.asarray(part, dtype=float) for part in (sigma, kurtosis, bias))
    of = root_mean_square(n * sigma**2, n * kurtosis * sigma**4, float(n))
    spread = np.sqrt(sigma**2 - bias**2)
    labels = {"case": "one", "filter": "f", "component": "r", "unit": "m", "k": [1, 2], "t_s": [0.0, 1.0], "n": n}
    biased = {"bias": bias, "bias_se": spread / n**0.5, "spread": spread}
    exactly = {"exact_sigma": np.array(exact, dtype=float), "exact_bias": np.array(exact_bias, dtype=float)}
    return pd.DataFrame(
        labels | tables.interval_columns("sigma", of) | biased | exactly | {"n_eff": n / (kurtosis - 1)}
    )


def told(table):
    return [line.partition(" measured")[0] for line in exact_check.disagreements({"curves": table})]


SECOND = "curves.csv: one, f, r, k = 2 (1 s): "


def test_errors_that_are_not_gaussian_are_held_against_being_too_large_alone():
    """What a sample lacks makes σ smaller, and its standard error too; any scan of a filter shows that it may."""
    for kurtosis in ((3, 100), (4, 3)):
        assert told(curves([1, 1], [1, 1.2], kurtosis)) == []
        assert told(curves([1, 1], [1, 0.7], kurtosis)) == [SECOND + "sigma"]
    assert told(curves([1, 1], [1, 1.05], (3.05, 2.95))) == [SECOND + "sigma"]
    assert told(curves([1, 1], [1, 0.95], (3.05, 2.95))) == [SECOND + "sigma"]


def test_a_mean_of_squares_that_a_study_declares_is_held_likewise():
    """Too small by what a sample lacks is no fault of it; too large is."""
    area = Quantity("area", "area", "areas", "area", squares=True)
    made = curves([1, 1], [1, 1], (3, 100))
    for value, faults in ((0.5, 0), (1.5, 1)):
        own = made[["case", "filter", "component", "k", "n"]].assign(area=[1, value])
        own = own.assign(area_lo=own["area"] - 0.01, area_hi=own["area"] + 0.01, exact_area=1.0)
        both = {"curves": made, "areas": own}
        assert len(exact_check.disagreements(both, quantities=[area])) == faults
        assert len(exact_check.disagreements(both)) == 1


def test_a_bias_may_lack_what_eighteen_realisations_make():
    """σ √(18/10⁵) is 0.0134 σ, beside 5.85 standard errors of 0.0032 σ each."""
    assert told(curves([1, 1], [1, 1], (4, 4), exact_bias=(0, 0.031))) == []
    assert told(curves([1, 1], [1, 1], (4, 4), exact_bias=(0, 0.033))) == [SECOND + "bias"]
    assert told(curves([1, 1], [1, 1], (3, 3), exact_bias=(0, 0.018))) == []
    assert told(curves([1, 1], [1, 1], (3, 3), exact_bias=(0, 0.019))) == [SECOND + "bias"]


def test_a_bias_makes_errors_no_less_gaussian():
    """κ of N(b, v) about zero."""
    b, v = 0.8, 0.36
    kurtosis = b**4 + 6 * b**2 * v + 3 * v**2
    same = {"bias": (0, b), "exact_bias": (0, b)}
    assert told(curves([1, 1], [1, 1.05], (3, kurtosis), **same)) == [SECOND + "sigma"]
    assert told(curves([1, 1], [1, 1.05], (3, kurtosis + 0.2), **same)) == []


def test_columns_by_their_names():
    names = ["case", "rate", "rate_lo", "rate_hi", "bias", "bias_se", "exact_bias", "exact_rate", "exact_other"]
    assert [one.value for one in exact_check.exact_columns(pd.DataFrame(columns=names))] == ["bias", "rate"]
    (one,) = exact_check.exact_columns(pd.DataFrame(columns=["case", "error_probability", "lo", "hi", "exact"]))
    assert one == ("error_probability", "lo", "hi", "exact")


def test_python_raises_with_the_result(monkeypatch):
    from radarsim.studies.range_doppler import study

    def wrong(made, right=study.axes):
        axes = right(made)
        return replace(axes, exact_sigma=1.05 * axes.exact_sigma)

    monkeypatch.setattr(study, "axes", wrong)
    with pytest.raises(DisagreementError, match=r"curves\.csv: rls2, .* the exact value is wrong") as raised:
        radarsim.run("rls2", realisations=100_000)
    assert isinstance(raised.value.result, Result)
    assert len(raised.value.result.curves) == 85
    assert "the exact value is wrong" in raised.value.result.warnings[0]


@pytest.mark.slow
def test_one_config_that_disagrees_does_not_stop_the_others(tmp_path, monkeypatch):
    """`run` and `report` of several: all are written, printed as JSON too, and each line names its config."""
    from radarsim.studies.range_doppler import study

    def wrong(made, right=study.axes):
        axes = right(made)
        return replace(axes, exact_sigma=(1.5 if made.spec.radar.name == "RLS 2" else 1.0) * axes.exact_sigma)

    monkeypatch.setattr(study, "axes", wrong)
    for verb, *more in (("run", "-n", "2000"), ("report",)):
        for folder in ("rls2", "rls3"):
            (tmp_path / folder / "report.html").unlink(missing_ok=True)
        ended = command(verb, "rls2", "rls3", *more, "--out", tmp_path, "--no-figures", "--json", code=4)
        assert [one["config"] for one in json.loads(ended.stdout)] == ["rls2", "rls3"]
        assert ended.stderr.startswith("rls2: curves.csv: rls2, r")
        assert "rls3" not in ended.stderr
        assert all((tmp_path / folder / "report.html").exists() for folder in ("rls2", "rls3"))


@pytest.mark.slow
@pytest.mark.parametrize("stem", sorted(path.stem for path in (find_files.SHIPPED / "configs").glob("*.yaml")))
def test_no_alarm_over_the_shipped_configs(stem):
    """Six seeds of 300 realisations, two of 2000: no exact value is further off than chance puts it."""
    for n, seed in (*((300, 1000 + i) for i in range(6)), (2000, 1), (2000, 2)):
        result = radarsim.run(stem, realisations=n, seed=seed)
        assert result.faults == ()
        if not any(set(exact_check.exact_columns(table)) for table in result.tables.values()):
            break
