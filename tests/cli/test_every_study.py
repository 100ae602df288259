"""`solve` and `sensitivity` in every study: one JSON document, a signal that ends them, what is refused at once."""

import json
import signal

import pytest
from click.testing import CliRunner

from radarsim.api.case_results import case_result
from radarsim.api.case_work import CaseWork
from radarsim.api.configs import load
from radarsim.cli.command_group import main
from radarsim.engine.collect import collect
from radarsim.report.quantities import FLOORS
from radarsim.studies import registry
from tests.cli.test_interrupts import ended_by
from tests.program import command

MANOEUVRE = ("sonar_manoeuvre", "--case", "sonar_manoeuvre target.acceleration_mps2=0.4")
CLUTTER = ("sonar_clutter", "--case", "sonar_clutter sensor.false_plots_per_km2=1")
CONFIGS = {
    "range_doppler": ("rls2",),
    "multimodel": ("multimodel_1hz",),
    "smoothing": ("sonar_smoothing",),
    "manoeuvre": MANOEUVRE,
    "clutter": CLUTTER,
    "discriminator": ("discriminator",),
    "ambiguous_doppler": ("ambiguous_rls2",),
    "pulses_to_tracks": ("pulses_rls2",),
}
SOLVED = {
    "range_doppler": "radar.sigma_velocity_mps --gain r --filter r+Vr --at 60 --equals 30",
    "multimodel": "sensor.sigma_range_m --sigma y --filter MMA2-11 --at-k 5 --equals 30",
    "smoothing": "sensor.sigma_range_m --sigma r --filter kalman --equals 10",
    "manoeuvre": "sensor.sigma_range_m --sigma r --filter growing --equals 300",
    "clutter": "sensor.detection_probability --loss nearest --equals 5 --between 0.6 1",
    "discriminator": "burst.noise_variance --lock sequence --equals 95",
    "ambiguous_doppler": "radar.sigma_velocity_mps --right memory --at-k 6 --equals 99",
    "pulses_to_tracks": "burst.snr_db --lock spectrum --equals 95",
}


def words(study, count):
    """The command `solve` of a study, with so many realisations behind a value."""
    config, *case = CONFIGS[study]
    return ["solve", config, *SOLVED[study].split(), *case, "-n", str(count)]


# A value of the key takes a second or more of them.
LONG = ("smoothing", "manoeuvre", "discriminator", "ambiguous_doppler", "pulses_to_tracks")


@pytest.mark.slow_cases("clutter", "multimodel")
@pytest.mark.parametrize("study", [pytest.param(one, marks=pytest.mark.slow) if one in LONG else one for one in SOLVED])
def test_solve_gives_one_document(study):
    result = CliRunner().invoke(main, [*words(study, 40), "--json"])
    assert result.exit_code in (0, 3), result.output
    found = json.loads(result.stdout)
    assert found["key"] == words(study, 1)[2]
    assert (found["value"] is None) == (result.exit_code == 3)
    shown = "limit" if found["value"] is None else "attained"
    assert isinstance(found[shown], float)


@pytest.mark.slow
@pytest.mark.parametrize("study", CONFIGS)
def test_sensitivity_gives_one_document_of_every_filter(study, tmp_path):
    config, *case = CONFIGS[study]
    words = ("sensitivity", config, *case, "-n", "40", "--no-figures", "--out", tmp_path, "--json")
    found = json.loads(command(*words).stdout)
    case = next(one for one in load(config).cases if len(case) == 0 or one.name == case[1])
    seen, silent = {row["filter"] for row in found["rows"]}, set(found["without_estimate"])
    assert seen | silent == {member.name for member in case.spec.members}
    assert seen
    assert not seen & silent
    assert all(row["sigma_change_lo"] <= row["sigma_change_percent"] <= row["sigma_change_hi"] for row in found["rows"])


@pytest.mark.slow
@pytest.mark.parametrize("verb", ["solve", "sensitivity"])
@pytest.mark.parametrize("study", CONFIGS)
def test_a_signal_ends_it(verb, study, tmp_path):
    config, *case = CONFIGS[study]
    given = words(study, 10**7) if verb == "solve" else ["sensitivity", config, *case, "-n", "1e7"]
    if study in ("range_doppler", "smoothing"):  # exact: in a moment
        given += ["--set", "radar.detection_probability=0.7" if study == "range_doppler" else "scans=200"]
        given += ["--set", "scans=40"] if study == "range_doppler" else []
    number = signal.SIGINT if verb == "solve" else signal.SIGTERM
    ended_by(number, [*given, "--json"], tmp_path, after_s=0.5)


@pytest.mark.parametrize("study", CONFIGS)
def test_a_wrong_name_is_refused_before_anything_is_prepared(study, monkeypatch):
    def prepared(self, case):
        raise AssertionError("prepared")

    config, *case = CONFIGS[study]
    key = SOLVED[study].split()[0]
    monkeypatch.setattr(type(registry.study(load(config).cases[0].study)), "prepare", prepared)
    asked = [("--sigma", "r", "--filter", "nobody"), ("--loss" if study != "clutter" else "--lock", "nobody")]
    for quantity, said in zip(asked, ("no filter 'nobody'", " measures no '"), strict=True):
        assert said in command("solve", config, key, *quantity, *case, "--equals", "1", code=2).stderr


@pytest.mark.parametrize("study", CONFIGS)
def test_studies_declare_the_quantities_that_their_tables_hold(study):
    case = load(CONFIGS[study][0]).cases[-1]
    work = CaseWork(case)
    study_of, result = registry.study(case.study), case_result(case, work, collect(work, 2, threads=1))
    tables = study_of.tables([result])
    quantities = study_of.quantities(case.spec)
    for one in quantities:
        made = study_of.table(one.table, [result], one.value)
        ends = () if one in FLOORS else one.ends  # which are known exactly
        assert {"filter", one.value, *ends, *filter(None, [one.per])} <= set(made)
    assert {one.table for one in quantities} >= set(tables) & {"locks", "folds", "tracking", "probabilities"}
