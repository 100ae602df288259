"""Errors of single realisations: those whose powers a run adds up, of every study; and each run's rms over scans."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

import radarsim
from radarsim.api.configs import load
from radarsim.api.realisation_errors import CaseErrors
from radarsim.api.simulate_cases import RunOptions, collected_results, simulate
from radarsim.errors import ConfigError
from radarsim.papers.evidence import MissingEvidence, UnknownName, UnknownScans
from radarsim.papers.one_file_measures import Evidence, run_rms, run_rms_ratio
from radarsim.report import run_statistics
from radarsim.studies.registry import study

N = 12
CONFIGS = (
    "rls2_manoeuvres",
    "multimodel_1hz",
    "sonar_missed",
    "sonar_clutter",
    "discriminator_pair",
    "pulses",
    "ambiguous_missed",
)


@pytest.mark.parametrize("name", [*CONFIGS, pytest.param("sonar_clutter_ends", marks=pytest.mark.slow)])
def test_their_root_mean_square_is_the_sigma_of_the_curves(name):
    experiment = load(name)
    case = replace(experiment.cases[0], realisations=N)
    (result,) = collected_results(simulate(replace(experiment, cases=(case,)), RunOptions(threads=0)))
    drawn = CaseErrors(case)
    errors = np.concatenate(list(drawn.blocks()), axis=1)
    k = list(drawn.work.plan.axes.k)
    for row in study(case.study).curves([result]).to_dict("records"):
        place = drawn.filter_index(row["filter"]), k.index(row["k"]), drawn.component_index(row["component"])
        e = errors[place[0], :, place[1], place[2]]
        e = e[np.isfinite(e)]
        assert row.get("n", N) == e.size
        if e.size:  # the same numbers, added in another order
            assert np.sqrt(np.mean(e**2)) == pytest.approx(row["sigma"], rel=1e-12)


def test_the_errors_of_a_result_come_in_order_and_of_user_filters_too(tmp_path):
    (tmp_path / "mine.py").write_text("def raw(plots):\n    return plots['range_m'][..., None]\n")
    shipped = Path(load("rls2").path).read_text(encoding="utf-8")
    file = tmp_path / "mine.yaml"
    file.write_text(shipped.replace("scans:", "  - {name: raw, python: 'mine.py:raw'}\nscans:", 1), encoding="utf-8")
    result = radarsim.run(file, realisations=5000)
    sigma = result.curves[(result.curves["filter"] == "raw") & (result.curves["component"] == "r")]["sigma"].to_numpy()
    chunks = list(result.errors("raw", "r"))
    assert [len(chunk) for chunk in chunks] == [4096, 904]
    np.testing.assert_allclose(np.sqrt(np.mean(np.concatenate(chunks) ** 2, axis=0)), sigma, rtol=1e-12)
    few = np.concatenate(list(result.errors("raw", "r", case="mine", realisations=100)))
    assert few.tobytes() == chunks[0][:100].tobytes()


def test_no_claim_rests_on_errors_of_a_filter_that_repeats_its_random_numbers(tmp_path):
    (tmp_path / "mine.py").write_text(
        "import numpy as np\n\ndef noisy(plots):\n"
        "    noise = np.random.default_rng(1).normal(0, 1000, plots['range_m'].shape)\n"
        "    return (plots['range_m'] + noise)[..., None]\n"
    )
    shipped = Path(load("rls2").path).read_text(encoding="utf-8")
    file = tmp_path / "mine.yaml"
    file.write_text(
        shipped.replace("scans:", "  - {name: noisy, python: 'mine.py:noisy'}\nscans:", 1), encoding="utf-8"
    )
    result = radarsim.run(file, realisations=9000)
    evidence = Evidence(result.cases, result.tables, {})
    with pytest.raises(MissingEvidence, match="realisations of a filter depend on each other"):
        evidence.run_rms({}, "noisy", "r")
    assert evidence.run_rms({}, "r", "r").shape == (9000,)


@pytest.fixture(scope="module")
def rls2():
    return radarsim.run("rls2", realisations=2000)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"filter": "q", "component": "r"}, "filter: no filter 'q'; there are r, r\\+Vr"),
        ({"filter": "r", "component": "x"}, "component: no component 'x'; there are r, Vr, ar"),
        ({"filter": "r", "component": "r", "case": "rls3"}, "case: no case 'rls3'; there are rls2"),
        ({"filter": "r", "component": "r", "realisations": 2001}, "realisations: must be 1 to 2000, got 2001"),
    ],
)
def test_an_unknown_name_is_refused_with_those_there_are(rls2, asked, said):
    with pytest.raises(ConfigError, match=said):
        list(rls2.errors(**asked))


def test_a_measure_sees_errors_and_the_rms_of_each_run(rls2):
    evidence = Evidence(rls2.cases, rls2.tables, {})
    errors = evidence.errors({}, "r", "r", realisations=500)
    assert errors.shape == (500, len(rls2.cases[0].axes.k))
    rms = evidence.run_rms({}, "r", "r", 3, 15)
    k = rls2.cases[0].axes.k
    np.testing.assert_allclose(rms[:500], np.sqrt(np.mean(errors[:, (k >= 3) & (k <= 15)] ** 2, axis=1)), rtol=1e-13)
    estimate = run_rms(evidence, {}, "r", "r", 3, 15)
    half = stats.t.ppf(0.975, 1999) * rms.std(ddof=1) / np.sqrt(2000)
    np.testing.assert_allclose(estimate, [rms.mean(), rms.mean() - half, rms.mean() + half], rtol=1e-6)
    assert run_rms(evidence, {}, "r", "r", 3, 15, "variance").value == pytest.approx(rms.var(ddof=1))
    base = evidence.run_rms({}, "r+Vr", "r", 3, 15)
    quotient = run_rms_ratio(evidence, {}, "r", "r+Vr", "r", 3, 15)
    resampled = np.random.default_rng(1).integers(0, 2000, (2000, 2000))  # bootstrap of the paired runs
    spread = (rms[resampled].mean(axis=1) / base[resampled].mean(axis=1)).std()
    assert quotient.value == pytest.approx(rms.mean() / base.mean())
    assert quotient.hi - quotient.value == pytest.approx(1.96 * spread, rel=4 / np.sqrt(2 * 2000) + 0.01)
    with pytest.raises(UnknownName, match="no filter 'q'; there are r"):
        evidence.errors({}, "q", "r")
    with pytest.raises(UnknownScans, match="no such scans"):
        evidence.run_rms({}, "r", "r", 3, 99)
    with pytest.raises(MissingEvidence, match="not known exactly"):
        evidence.exactly().errors({}, "r", "r")


def test_the_table_of_runs_has_a_row_for_each_filter_and_component(rls2):
    rls2.add_runs_table("3:15")
    table = rls2.tables["runs"]
    assert table[["filter", "component"]].to_numpy().tolist() == [
        [f, c] for f in ("r", "r+Vr") for c in ("r", "Vr", "ar")
    ]
    row = table.iloc[0]
    assert (row["case"], row["unit"], row["first_k"], row["last_k"], row["n"]) == ("rls2", "m", 3, 15, 2000)
    assert row["mean_lo"] < row["mean"] < row["mean_hi"]
    assert row["quantile_05"] < row["quantile_25"] < row["median"] < row["quantile_75"] < row["quantile_95"]
    with pytest.raises(ConfigError, match="runs: rls2: no such scans; there are 1 to 15"):
        rls2.add_runs_table("3:16")
    for text in ("3", "5:3", "0:4", "a:b"):
        with pytest.raises(ConfigError, match="runs: must be FIRST:LAST, such as 2:60, or all, got"):
            radarsim.run("rls2", realisations=10, runs=text)


@pytest.mark.parametrize("n", [20, 200])
def test_the_intervals_of_the_statistics_cover(n):
    """Of gamma variables, skewed as root mean squares of few scans are; the variance's interval is asymptotic."""
    rng, trials, law = np.random.default_rng(3), 2000, stats.gamma(4)
    truth = {"mean": law.mean(), "variance": law.var(), "median": law.median()}
    least = {"mean": 0.93, "variance": 0.88 if n > 100 else 0.75, "median": 0.95}
    for name, statistic in run_statistics.STATISTICS.items():
        ends = np.array([statistic(law.rvs(n, random_state=rng)) for _ in range(trials)])
        covered = np.mean((ends[:, 1] <= truth[name]) & (truth[name] <= ends[:, 2]))
        assert covered > least[name] - 4 * np.sqrt(0.05 * 0.95 / trials), (name, covered)


def test_runs_without_an_estimate_are_not_counted():
    errors = np.array([[3.0, np.nan, 4.0], [np.nan, np.nan, np.nan], [1.0, 1.0, 1.0]])
    rms = run_statistics.run_rms(errors)
    np.testing.assert_allclose(rms, [np.sqrt(12.5), np.nan, 1.0])
    assert run_statistics.statistics_row(rms)["n"] == 2
