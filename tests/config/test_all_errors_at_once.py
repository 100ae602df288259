"""All faults of a file at once: of fields, and of fields that do not go together, whichever else is wrong."""

import copy

import pytest

from radarsim.api.configs import load
from radarsim.config.identity import all_keys

SHORT = "must be >= 3 for the initialisation of filter r, got 2"
OBSERVES = "must be [range] or [range, velocity], got ['velocity']"


def test_all_that_does_not_go_together(good, said):
    good["filters"][1].update(name="r", observes=["velocity"])
    good.update(baseline="x", scans=2)
    good["target"]["coefficients"] = [1e16]
    *lines, of_target = sorted(said(good))
    assert of_target.startswith("config: target: must stay within ")
    assert set(lines) == {
        "config: filters: names must differ: r is there twice",
        f"config: filters.1.observes: {OBSERVES}",
        "config: baseline: must be the name of a filter: r, r, got 'x'",
        f"config: scans: {SHORT}",
    }


def test_beside_faults_of_fields(good, said):
    good["radar"]["sigma_range_m"] = -1
    good["filters"][1].update(name="r", manoeuvre_variance="x")
    good.update(baseline="x", scans=2)
    assert set(said(good)) == {
        "config: radar.sigma_range_m: must be > 0, got -1",
        "config: filters.1.manoeuvre_variance: must be a number, got 'x'",
        "config: filters: names must differ: r is there twice",
        "config: baseline: must be the name of a filter: r, r, got 'x'",
        f"config: scans: {SHORT}",
    }


def test_at_their_lines_in_a_file(house, said):
    text = """
        study: range_doppler
        radar: {wavelength_m: 0.15, sigma_range_m: 250, sigma_velocity_mps: 15, scan_period_s: 0}
        target: {kind: turn, range_m: 1e4, speed_mps: 200, aspect_deg: 180, acceleration_g: 1, duration_s: 10}
        filters:
          - {name: r, observes: [range], manoeuvre_variance: 1e-3}
        baseline: s
        scans: 2
        realisations: 0
        seed: 1
        seed: 2
        """
    assert said(house("own.yaml", text)) == [
        "own.yaml:2:88: radar.scan_period_s: must be > 0, got 0",
        "own.yaml:3:9: target.start_s: required key is missing",
        "own.yaml:6:11: baseline: must be the name of a filter: r, got 's'",
        f"own.yaml:7:8: scans: {SHORT}",
        "own.yaml:8:15: realisations: must be >= 1, got 0",
        "own.yaml:10:1: seed: duplicate key, first in line 9",
    ]


@pytest.mark.parametrize(
    ("given", "at", "got"), [([], "", "[]"), (["r", 3], ".1", "3"), (3, "", "3"), ({"a": 1}, "", "{a: 1}")]
)
def test_a_baseline_is_a_name_or_a_list_of_names(good, said, given, at, got):
    good["baseline"] = given
    assert said(good) == [f"config: baseline{at}: must be the name of a filter or a list of such names, got {got}"]


@pytest.mark.parametrize("key", ["initial_scan", "colour"])
def test_a_misspelt_key_is_not_taken_for_one_left_out(good, said, key):
    good["scanz"] = good.pop("scans")
    good["filters"][0][key] = 9
    lines = said(good)
    assert len(lines) == 2
    assert lines[0].startswith(f"config: filters.0.{key}: unknown key")
    assert lines[1].startswith("config: scanz: unknown key; did you mean scans?")


@pytest.mark.parametrize("name", [None, 3])
def test_names_that_were_not_read_say_nothing_of_the_baseline(good, said, name):
    good["baseline"] = "x"
    good["filters"][0]["name"] = name
    (line,) = said(good)
    assert line.startswith("config: filters.0.name: ")


OTHER_STUDIES = {
    "sonar_smoothing": (
        {"sensor.scan_period_s": 0, "filters.0.kind": "window", "filters.0.plots": None, "baseline": "x", "scans": 2},
        {"sensor.scan_period_s", "filters.0.plots", "baseline"},
    ),
    "multimodel": (
        {"sensor.jitter_s": 1e3, "sensor.antenna_height_m": "x", "filters.0.merge": "y", "baseline": "z"},
        {"sensor.jitter_s", "sensor.antenna_height_m", "filters.0.merge", "baseline"},
    ),
    "discriminator": (
        {"burst.amplitude": 0, "prior.sigma": [1.0, 1.0], "prior.spread_over_potential": None, "estimators.0.steps": 0},
        {"burst.amplitude", "prior.sigma", "estimators.0.steps"},
    ),
}


def test_what_is_around_does_not_lean_on_what_does_not_go_together(said):
    changes = {"prior": {"scale": 0}}
    assert set(said(spoilt("discriminator", changes))) == {
        "config: prior.scale: must be > 0, got 0",
        "config: prior.spread_over_potential: give either spread_over_potential or sigma",
    }


@pytest.mark.parametrize("stem", OTHER_STUDIES)
def test_in_the_other_studies(said, stem):
    changes, keys = OTHER_STUDIES[stem]
    assert keys <= {line.split(": ")[1] for line in said(spoilt(stem, changes))}


def spoilt(stem: str, changes: dict) -> dict:
    """A shipped config's first case as a dictionary, with other values at dotted keys; None takes the key away."""
    experiment = load(stem)
    case = experiment.cases[0]
    config = {"study": case.study, "realisations": 10} | copy.deepcopy(all_keys(case.spec))
    for key, value in changes.items():
        *outer, last = (int(step) if step.isdecimal() else step for step in key.split("."))
        holder = config
        for step in outer:
            holder = holder[step]
        holder[last] = value
        if value is None:
            del holder[last]
    return config


def test_figures_are_those_of_the_study(good, said):
    good["figures"] = {"sigma_Vr": ["config"], "dynamic_r": ["*"], "settling": ["*"]}
    assert said(good) == []
    good["figures"] = {"sigma_vr": ["config"], "map": ["config"]}
    good["scans"] = 0
    known = "sigma_r, gain_r, dynamic_r, sigma_Vr, gain_Vr, dynamic_Vr, sigma_ar, gain_ar, dynamic_ar, settling"
    assert set(said(good)) == {
        "config: figures.sigma_vr: no such figure; did you mean sigma_Vr?",
        f"config: figures.map: no such figure; there are: {known}, consistency, claims, sweep_*",
        "config: scans: must be >= 2, got 0",
    }


def test_figures_in_a_file_and_of_included_configs(house, said):
    house("configs/both.yaml", "include: [rls1, rls2]\nfigures:\n  gian_r: [rls1]\n")
    assert said("configs/both.yaml") == ["configs/both.yaml:3:3: figures.gian_r: no such figure; did you mean gain_r?"]
    house("configs/both.yaml", "include: [rls1, rls2]\nfigures: ['gain_*', gian_r, sweep_target, claims, 'map_*']\n")
    assert [one.partition(";")[0] for one in said("configs/both.yaml")] == [
        "configs/both.yaml:2:21: figures.1: no such figure",
        "configs/both.yaml:2:51: figures.4: no such figure",
    ]
