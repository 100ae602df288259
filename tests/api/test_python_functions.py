"""radarsim's functions give what the commands of their names do, with tables; their faults speak of Python."""

import json
import subprocess
import sys

import pytest
from click.testing import CliRunner

import radarsim
from radarsim.api import json_output
from radarsim.cli.command_group import main
from radarsim.papers.interpretation_files import json_documents
from radarsim.report import csv_text
from tests.cli.test_every_study import CONFIGS, SOLVED

IN_PYTHON = {"--between LO HI": "between=(low, high)", "--at:": "at_s:"}  # how its notes call options


def printed(*words):
    """What a command prints with --json, its options called as Python's arguments."""
    done = CliRunner().invoke(main, [*map(str, words), "--json"])
    assert done.exit_code in (0, 3), done.output
    text = done.stdout
    for option, argument in IN_PYTHON.items():
        text = text.replace(option, argument)
    return json.loads(text)


def document(value):
    """What Python found, as a command prints it."""
    return json.loads(json_output.text(value))


def asked(words):
    """The options of `solve` as arguments of Python."""
    options = {"--at": "at_s", "--at-k": "at_k"}
    found = {}
    while words:
        name, value, *words = words
        if name == "--between":
            found["between"], words = (float(value), float(words[0])), words[1:]
            continue
        key = options.get(name, name.removeprefix("--"))
        found[key] = {"at_s": float, "equals": float, "at_k": int}.get(key, str)(value)
    return found


def some(every, *ordinary):
    """Studies, those that are not named as slow ones."""
    return [one if one in ordinary else pytest.param(one, marks=pytest.mark.slow) for one in every]


@pytest.mark.parametrize("study", some(SOLVED, "range_doppler"))
def test_solve(study):
    config, *case = CONFIGS[study]
    key, *words = SOLVED[study].split()
    answer = radarsim.solve(config, key, realisations=40, **asked([*words, *case]))
    told = document(json_output.answer(answer))
    assert told == printed("solve", config, key, *words, *case, "-n", 40)
    (row,) = answer.table.to_dict("records")
    assert row["equals"] == answer.equals
    assert row["key"] == answer.key in repr(answer)
    assert len(repr(answer).splitlines()) <= 3


@pytest.mark.parametrize("study", some(CONFIGS, "range_doppler"))
def test_sensitivity(study, tmp_path):
    config, *case = CONFIGS[study]
    found = radarsim.sensitivity(config, realisations=40, **asked(case))
    told = document(json_output.sensitivity(found))
    shown = printed("sensitivity", config, *case, "-n", 40, "--no-figures", "--out", tmp_path)
    assert told | {"files": shown["files"]} == shown
    assert found.table["key"].tolist() == [row["key"] for row in shown["rows"]]
    (stored,) = tmp_path.rglob("sensitivity.csv")
    assert stored.read_bytes() == csv_text.to_csv(found.table)
    assert found.figures == ("tornado",)
    assert f"{config}: change of" in repr(found)


SIDES = {
    "range_doppler": ("rls2", {"radar": {"sigma_velocity_mps": 5}}),
    "multimodel": ("multimodel_1hz", {"sensor": {"sigma_range_m": 40}}),
    "sonar": ("sonar_smoothing", {"sensor": {"sigma_range_m": 40}}),
    "clutter": ("sonar_clutter", {"sensor.detection_probability": 0.8}),
    "discriminator": ("discriminator", {"burst": {"noise_variance": 1e-3}}),
    "ambiguous_doppler": ("ambiguous_rls2", {"radar.sigma_velocity_mps": 3}),
    "pulses_to_tracks": ("pulses_rls2", {"burst.snr_db": 3}),
}


@pytest.mark.slow_cases_except("range_doppler")
@pytest.mark.parametrize("study", some(SIDES, "range_doppler", "sonar", "discriminator"))
def test_compare_of_results_is_that_of_stored_ones(study, tmp_path):
    config, change = SIDES[study]
    one = radarsim.run(config, realisations=10, out=tmp_path / "a", figures=False)
    other = radarsim.run(config, realisations=10, overrides=change, out=tmp_path / "b", figures=False)
    folders = [tmp_path / place / one.experiment.stem for place in "ab"]
    names = {
        f"{one.experiment.stem} in {folder.parent}": result
        for folder, result in zip(folders, (one, other), strict=True)
    }
    before = sorted(tmp_path.rglob("*"))
    found = radarsim.compare(names)
    assert sorted(tmp_path.rglob("*")) == before
    shown = printed("compare", *folders, "--no-figures", "--out", tmp_path)
    told = document(json_output.comparison(found))
    assert told["sentences"] == shown["sentences"]
    assert told["notes"] == shown["notes"]
    assert (tmp_path / "compare" / "comparison.csv").read_bytes() == csv_text.to_csv(found.table)
    assert repr(found).startswith(found.sentences[0][:100])


@pytest.mark.slow
def test_compare_names_two_results_of_one_config(tmp_path):
    given = {"realisations": 50, "out": tmp_path, "figures": False}
    one, other = (radarsim.run("rls2", seed=seed, **given) for seed in (1, 2))
    assert set(radarsim.compare(one, other).table["label"]) == {"rls2 (2)"}
    assert radarsim.compare(one, other).figures[:2] == ("sigma_r", "sigma_Vr")
    assert set(radarsim.compare("rls2", one, out=tmp_path).table["against_label"]) == {f"rls2 in {tmp_path}"}
    assert (tmp_path / "compare" / "compare.html").exists()


def test_chart(tmp_path):
    found = radarsim.chart("rls2", overrides={"radar": {"sigma_velocity_mps": 5}})
    words = ("chart", "rls2", "--set", "radar.sigma_velocity_mps=5", "--no-figures", "--out", tmp_path)
    shown = printed(*words)
    assert document(json_output.doppler_chart(found)) | {"folder": shown["folder"], "files": shown["files"]} == shown
    assert (tmp_path / "chart" / "chart.csv").read_bytes() == csv_text.to_csv(found.table)
    assert found.figures == ("gain_against_time", "steady_gain", "map")
    assert found.figure("steady_gain").axes


def test_claims(tmp_path):
    result = radarsim.run("rls2", realisations=2000, out=tmp_path, figures=False)
    for names in (("rls2",), ("P1.3", "P4"), ()):
        found = radarsim.claims(*names, out=tmp_path)
        assert document(found.rows) == printed("claims", *names, "--out", tmp_path)
        assert len(repr(found).splitlines()) <= 3
    own = radarsim.claims("rls2", out=tmp_path)
    assert own.table["variants_of"].dtype == own.table["measured"].dtype == float
    assert set(result.tables["claims"].columns) <= set(own.table.columns)
    assert own.figures == (("claims",) if (own.table["verdict"] != "not run").any() else ())
    with pytest.raises(radarsim.ConfigError, match="P9 is no claim and no paper"):
        radarsim.claims("P9", out=tmp_path)


def test_interpretations(tmp_path):
    found = radarsim.interpretations("P1.4")
    assert document(json_documents(found)) == printed("interpretations", "P1.4", "--out", tmp_path, "--no-figures")
    assert found.files == ()
    assert found.figures == ("P1.4",)
    assert repr(found).startswith("P1.4 ")
    stored = csv_text.from_csv((tmp_path / "interpretations" / "interpretations.csv").read_bytes())
    assert found.table.columns.isin(stored.columns).all()
    assert csv_text.to_csv(found.table) == csv_text.to_csv(stored[found.table.columns])


@pytest.mark.slow_cases("range_doppler")
@pytest.mark.parametrize("config", ["rls2", "range_doppler"])
def test_check(config):
    outlook = radarsim.check(config, realisations=1000)
    assert (
        document(json_output.cost(radarsim.run(config, realisations=1).experiment, outlook))["cases"]
        == (printed("check", config, "-n", 1000)[0]["cases"])
    )
    assert outlook.table["realisations"].eq(1000).all()
    assert "1000 realisations" in repr(outlook) or "30,000 realisations" in repr(outlook)


KEY = "rls2", "radar.sigma_range_m"


def endless():
    """A mapping that contains itself."""
    made: dict[str, object] = {}
    made["radar"] = made
    return made


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (
            lambda: radarsim.solve(*KEY, equals=3),
            "name one quantity, as `radarsim solve --help` lists them: wanted=…, sigma=…",
        ),
        (lambda: radarsim.solve(*KEY, equals=3, gain="r", sigma="r"), "got gain, sigma"),
        (lambda: radarsim.solve(*KEY, equals=3, gain="r", at_s=1, at_k=2), "at_s and at_k do not go together"),
        (lambda: radarsim.solve(*KEY, equals=3, sigma="r"), "filter: name one of r, r+Vr"),
        (lambda: radarsim.solve(*KEY, equals=3, sigma="r", filter="r", at_s=1e4), "at_s: must be from 0 to 140 s"),
        (lambda: radarsim.solve(*KEY, equals=3, sigma="r", filter="r", at_k=99), "at_k: must be from 1 to 15"),
        (lambda: radarsim.solve(*KEY, equals=3, sigma="r", filter="r", at_k=7.5), "at_k: must be a whole number"),
        (lambda: radarsim.sensitivity("rls2", at_k=7.5), "at_k: must be a whole number, that of a scan, got 7.5"),
        (
            lambda: radarsim.solve("rls2", "scans", equals=30, sigma="r", filter="r", at_s=60, between=(3, 5)),
            "with scans=3: at_s: must be from 0 to 20 s, the last scan's time, got 60",
        ),
        (
            lambda: radarsim.solve("rls2", "scans", equals=30, sigma="r", filter="r", at_s=60, between=(3, 12)),
            "m at every value from 7 to 12",
        ),
        (lambda: radarsim.solve(*KEY, equals=3, gain="r", between=(5, 3)), "between: must be two rising numbers"),
        (lambda: radarsim.solve("rls2", "duration_s", equals=3, gain="r"), "give between=(low, high)"),
        (lambda: radarsim.solve("range_doppler", KEY[1], equals=3, gain="r"), "choose one with case: 'rls1'"),
        (lambda: radarsim.solve(*KEY, equals=float("nan"), gain="r"), "equals: must be a finite number"),
        (lambda: radarsim.solve(*KEY, equals=3, lock="r"), "measures no 'lock', but sigma, gain"),
        (lambda: radarsim.sensitivity("rls2", of="lock"), "measures no 'lock', but sigma, gain"),
        (lambda: radarsim.sensitivity("rls2", figures="gif"), "figures: must be True, False or of svg, png, pdf"),
        (lambda: radarsim.sensitivity("rls2", overrides={"scans": 0}), "overrides['scans']: must be >= "),
        (lambda: radarsim.compare("rls2"), "takes two results or more, got 1"),
        (lambda: radarsim.compare("rls2", "rls4", out="nowhere"), "`radarsim run rls4 --out nowhere` computes it"),
        (lambda: radarsim.chart("sonar_missed"), "study sonar has no chart"),
        (lambda: radarsim.claims("P1."), "claims: P1. is no claim and no paper; did you mean P1?"),
        (lambda: radarsim.claims("p1.3"), "claims: p1.3 is no claim and no paper; did you mean P1.3?"),
        (lambda: radarsim.run("rls2", overrides=endless()), "overrides['radar.radar.radar']: nested more than 50 deep"),
        (lambda: radarsim.run(endless()), "config: radar.radar.radar: nested more than 50 deep"),
        (
            lambda: radarsim.run("rls2", overrides={"radar": {"sigma_range_m": 3}, "radar.sigma_range_m": 4}),
            "overrides['radar.sigma_range_m']: is given twice",
        ),
        (
            lambda: radarsim.run("rls2", overrides={"radar.sigma_range_m": 3, "radar": 4}),
            "overrides['radar']: overwrites radar.sigma_range_m, given before it",
        ),
        (lambda: radarsim.interpretations("P1.4", realisations=0), "realisations: must be >= 1, got 0"),
        (lambda: radarsim.check("rls2", precision=0), "precision: must be > 0 and ≤ 100 %, got 0"),
    ],
)
def test_faults_speak_of_python(ask, words):
    with pytest.raises(radarsim.ConfigError) as refused:
        ask()
    assert words in str(refused.value)
    assert " --" not in str(refused.value).replace("radarsim solve --help", "").replace("--out", "")


def test_radarsim_is_imported_without_what_computes():
    code = (
        "import sys, radarsim; dir(radarsim); print(*sorted({'numpy', 'pandas', 'click', 'yaml'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "\n"
    for name in radarsim.__all__:
        assert getattr(radarsim, name).__doc__ or name == "__version__"
