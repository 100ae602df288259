"""Several baselines of one case: each gain is paired on the common noise, as if its baseline stood alone."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import radarsim
from radarsim.api.case_results import case_result
from radarsim.api.case_work import CaseWork
from radarsim.api.configs import load
from radarsim.api.precision_target import check_precision
from radarsim.api.result_content import gains_table
from radarsim.api.simulate_cases import RunOptions, simulate
from radarsim.api.stored_cases import stored_case
from radarsim.errors import ConfigError
from radarsim.papers.evidence import Evidence
from radarsim.report import tables
from radarsim.report.precision import widest_cell
from radarsim.report.quantities import GAIN
from radarsim.studies.identity import identity
from radarsim.studies.registry import study
from tests.tolerances import assert_rounded, share_error

THREE = {
    "study": "range_doppler",
    "radar": {"wavelength_m": 0.15, "sigma_range_m": 250, "sigma_velocity_mps": 15, "scan_period_s": 10},
    "target": {"kind": "polynomial", "coefficients": [100e3, -250, 4]},
    "filters": [
        {"name": "r", "observes": ["range"], "manoeuvre_variance": 1e-3},
        {"name": "r+Vr", "observes": ["range", "velocity"], "manoeuvre_variance": 1e-3},
        {"name": "slow", "observes": ["range", "velocity"], "manoeuvre_variance": 1e-4},
    ],
    "baseline": ["r+Vr", "r"],
    "scans": 12,
    "realisations": 3000,
}


@pytest.fixture(scope="module")
def both():
    """A result with two baselines."""
    return radarsim.run(THREE)


@pytest.mark.slow_cases("sonar_smoothing-None-overrides2")
@pytest.mark.parametrize(
    ("config", "names", "overrides"),
    [
        (THREE, ("slow", "r"), ()),
        (THREE, ("slow", "r"), ("radar.detection_probability=0.7",)),  # a kernel of its own, exact values by patterns
        ("sonar_smoothing", None, ()),
        ("ambiguous_rls2", None, ()),  # a table of gains with columns of its own
    ],
)
def test_rows_are_those_of_each_baseline_alone(config, names, overrides):
    names = names or [one.name for one in load(config).cases[0].spec.filters][1::-1]
    given = {"realisations": 60, "overrides": [*overrides, f"baseline={json.dumps(list(names))}"]}
    made = radarsim.run(config, **given)
    alone = [
        radarsim.run(config, realisations=60, overrides=[*overrides, f"baseline={json.dumps(name)}"]).gains
        for name in names
    ]
    first = made.experiment.cases[0].name
    found = made.gains[made.gains["case"] == first].drop(columns="note", errors="ignore")
    wanted = pd.concat([one[one["case"] == first] for one in alone])[found.columns]
    assert len(found) > 10
    pd.testing.assert_frame_equal(found.reset_index(drop=True), wanted.reset_index(drop=True))
    pd.testing.assert_frame_equal(made.curves, radarsim.run(config, realisations=60, overrides=overrides).curves)


@pytest.mark.slow
def test_intervals_against_a_further_baseline_cover(both):
    """In 300 samples of 400 realisations; of 95 % intervals at most 5.85 standard errors fewer hold."""
    case = both.experiment.cases[0]
    work, held = CaseWork(case), []
    for first in range(0, 300 * 400, 400):
        collected = SimpleNamespace(count=400, values=work.simulate(first, 400), kernel_seconds=0.0)
        gains = gains_table(study(case.study))([case_result(case, work, collected)])
        rows = gains[(gains["k"] == 12) & (gains["baseline"] == "r")]
        held.append((rows["gain_lo"] <= rows["exact_percent"]) & (rows["exact_percent"] <= rows["gain_hi"]))
    share = np.mean(held, axis=0)
    assert share.shape == (6,)
    assert (share > 0.95 - share_error(0.95, 300)).all()
    assert (share < 1).any()


def test_figures_answer_and_last_scan(both):
    assert {"gain_r", "gain_r_2", "gain_Vr_2"} <= set(both.figures)
    assert "over filter r," in both._figures_by_name["gain_r_2"].caption
    assert "over filter r+Vr," in both._figures_by_name["gain_r"].caption
    (further,) = [line for line in both.answer if line.startswith("config, gain in r over r at 110 s: r+Vr ")]
    row = both.gains[(both.gains["baseline"] == "r") & (both.gains["filter"] == "slow") & (both.gains["k"] == 12)]
    assert f"“slow” {row[row.component == 'r'].iloc[0]['exact_percent']:.3g} %" in further
    assert len(both.last_scan) == 9
    assert set(both.last_scan["baseline"].dropna()) == {"r+Vr"}


def test_a_case_without_gains_has_a_last_scan():
    assert len(radarsim.run("discriminator", realisations=40).last_scan)
    rows = tables.gains_against_baselines(tables.gains([]), radarsim.run(THREE, realisations=40).cases)
    assert len(rows) == 0
    assert "baseline" in rows


def test_a_ratio_is_paired_where_either_is_a_baseline(both):
    seen = Evidence(both.cases, both.tables, {})
    paired, swapped = (seen.ratio("config", *names, "r").last() for names in (("slow", "r"), ("r", "slow")))
    curves = both.curves[(both.curves["component"] == "r") & (both.curves["k"] == 12)].set_index("filter")
    value = curves.loc["slow", "sigma"] / curves.loc["r", "sigma"]
    assert_rounded(paired.value, value, operations=3)
    assert_rounded([1 / swapped.value, 1 / swapped.hi, 1 / swapped.lo], list(paired), operations=12)  # an exponential
    alone = radarsim.run(THREE | {"baseline": "r+Vr"})
    independent = Evidence(alone.cases, alone.tables, {}).ratio("config", "slow", "r", "r").last()
    assert_rounded(independent.value, value, operations=3)
    assert paired.hi - paired.lo < 0.8 * (independent.hi - independent.lo)


def test_any_means_of_computing_gives_the_same_bytes_and_the_record_reads_back(tmp_path):
    config = tmp_path / "two.yaml"
    config.write_text(json.dumps(THREE | {"realisations": 9000}))
    whole = radarsim.run(config, out=tmp_path / "whole", figures=False)
    radarsim.run(config, realisations=5000, threads=1, out=tmp_path / "parts", figures=False)
    radarsim.run(config, out=tmp_path / "parts", figures=False, threads=2)
    made = [(tmp_path / name / "two" / "gains.csv").read_bytes() for name in ("whole", "parts")]
    assert made[0] == made[1]
    case = stored_case(json.loads((tmp_path / "whole/two/run.json").read_text()), "two")
    assert (case.spec.baseline, case.further_baselines) == ("r+Vr", ("r",))
    assert identity(case) == identity(whole.experiment.cases[0])


def test_identity_is_that_of_one_baseline_where_there_is_one():
    def of(baseline):
        return identity(load(THREE | {"baseline": baseline}).cases[0])

    assert of(["r+Vr"]) == of("r+Vr") != of(["r+Vr", "r"])
    assert len({of(["r+Vr", "r"]), of(["r", "r+Vr"]), of(["r+Vr", "slow"])}) == 3


def test_precision_of_gains_looks_at_all_baselines():
    """The gain of `slow` against `r+Vr`, whose errors are nearly its own, is known better than that against `r`."""
    wide = {}
    for names in (["r+Vr"], ["r+Vr", "r"], ["r"]):
        experiment = load(THREE | {"baseline": names, "realisations": 64_000})
        check_precision([experiment], 50, "gain")
        found = simulate(experiment, RunOptions(), precision=50, quantity_name="gain")
        wide[tuple(names)] = found.cells["config"].percent
    assert wide["r+Vr", "r"] == max(wide["r+Vr",], wide["r",])


@pytest.mark.parametrize(
    ("baseline", "line"),
    [
        ("[r, x]", "two.yaml:1:15: baseline: must be the name of a filter: r, r+Vr, slow, got 'x'"),
        ("[r, slow, r]", "two.yaml:1:21: baseline.2: stands there already, got 'r'"),
        ("[]", "two.yaml:1:11: baseline: must be the name of a filter or a list of such names, got []"),
        ("[x, r]", "two.yaml:1:12: baseline: must be the name of a filter: r, r+Vr, slow, got 'x'"),
    ],
)
def test_faults(tmp_path, monkeypatch, baseline, line):
    monkeypatch.chdir(tmp_path)
    rest = "\n".join(f"{key}: {json.dumps(value)}" for key, value in THREE.items() if key != "baseline")
    (tmp_path / "two.yaml").write_text(f"baseline: {baseline}\n{rest}\n")
    with pytest.raises(ConfigError) as caught:
        load("two.yaml")
    assert caught.value.lines == (line,)


def test_a_gains_precision_says_against_which(both):
    (case,) = both.cases
    table = gains_table(study("range_doppler"))
    found, alone = widest_cell(case, table, GAIN), widest_cell(replace(case, further_baselines=()), table, GAIN)
    assert found is not None
    assert found.against in ("r+Vr", "r")
    assert f"filter {found.filter!r} against {found.against!r}, component " in str(found)
    assert alone is not None
    assert " against " not in str(alone)
