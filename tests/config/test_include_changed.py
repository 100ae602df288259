"""Keys of a study beside `include`: the included experiment with these changed, and faults where they were written."""

import math

import pytest

from radarsim.api.configs import load
from radarsim.config.identity import identity_keys
from radarsim.config.new_config import new_config
from radarsim.errors import ConfigError
from radarsim.recordings.study_part import single_case
from radarsim.studies import registry
from tests.tolerances import assert_rounded

MINE = """
study: range_doppler
radar: {name: mine, wavelength_m: 0.15, sigma_range_m: 250, sigma_velocity_mps: 15, scan_period_s: 10}
target: straight
filters:
  - {name: r, observes: [range], manoeuvre_variance: 1e-3}
  - {name: r+Vr, observes: [range, velocity], manoeuvre_variance: 1e-3}
scans: 15
realisations: 1e3
"""
STRAIGHT = "kind: polynomial\ncoefficients: [1e5, -250]\n"
FLY_BY = "{kind: fly_by, start_range_m: 90e3, distance_m: 8e3, speed_mps: 200}"


@pytest.fixture
def folder(house):
    """configs/mine.yaml, whose target is scenarios/straight.yaml."""
    house("configs/mine.yaml", MINE)
    house("scenarios/straight.yaml", STRAIGHT)
    return house


@pytest.mark.parametrize(
    ("beside", "override"),
    [
        (f"target: {FLY_BY}", f"target={FLY_BY}"),  # another kind: nothing is left of the scenario
        ("target: polynomial", "target=polynomial"),
        ("target: {coefficients: [9e4, -100, 1]}", "target.coefficients=[9e4, -100, 1]"),  # the kind stays
        ("radar: {sigma_range_m: 80}", "radar.sigma_range_m=80"),  # the others stay
        ("duration_s: 100", "duration_s=100"),  # stands in place of scans
        ("filters: [{name: alone, observes: [range], manoeuvre_variance: 1e-4}]", ""),
    ],
)
def test_keys_beside_include_do_what_set_does(folder, beside, override):
    folder("configs/other.yaml", f"include: [mine]\n{beside}\n")
    (case,) = load("other").cases
    filters = ["filters=[{name: alone, observes: [range], manoeuvre_variance: 1e-4}]"]
    (expected,) = load("mine", [override] if override else filters).cases
    assert identity_keys(case.spec) == identity_keys(expected.spec) != identity_keys(load("mine").cases[0].spec)
    assert case.name == "mine"


def test_a_mapping_in_python_and_degrees_for_radians(folder):
    experiment = load({"include": ["mine"], "target": {"coefficients": [9e4, -100]}, "scans": 20})
    assert experiment.cases[0].spec.target.coefficients == (9e4, -100.0)
    assert experiment.cases[0].spec.scans == 20
    sensors = [{"include": ["sonar_manoeuvre"], "sensor": {f"sigma_bearing_{unit}": 0.5}} for unit in ("rad", "deg")]
    rad, deg = (load(one).cases[0].spec.sensor.sigma_bearing_rad for one in sensors)
    assert_rounded(deg, math.radians(rad), operations=2)


def test_the_nearer_key_yields_to_the_farther_and_both_to_an_override(folder):
    folder("configs/near.yaml", "include: [mine]\nscans: 20\nradar: {sigma_range_m: 80}\n")
    folder("configs/far.yaml", "include: [near, mine]\nscans: 30\n")
    near, plain = load("far").cases
    assert (near.name, near.spec.scans, near.spec.radar.sigma_range_m) == ("near", 30, 80.0)
    assert (plain.name, plain.spec.scans, plain.spec.radar.sigma_range_m) == ("mine", 30, 250.0)
    assert {case.spec.scans for case in load("far", ["scans=40"]).cases} == {40}


def test_included_in_its_turn_a_changed_case_has_the_name_of_who_changes_it(folder):
    folder("configs/yours.yaml", MINE)
    folder("configs/other.yaml", "include: [mine, yours]\nscans: 20\n")
    folder("configs/all.yaml", "include: [mine, other]\nsweep: {radar.sigma_range_m: [100]}\n")
    assert [case.name.split()[0] for case in load("all").cases] == ["mine", "other:mine", "other:yours"]
    assert [case.spec.scans for case in load("all").cases] == [15, 20, 20]


def test_a_scenario_is_looked_for_beside_the_config_that_names_it(folder):
    folder("project/mine.yaml", MINE.replace("target: straight", f"target: {FLY_BY}"))
    folder("project/turn.yaml", "kind: polynomial\ncoefficients: [5e4, 100]\n")
    folder("project/other.yaml", "include: [mine]\ntarget: turn\n")
    assert load("project/other.yaml").cases[0].spec.target.coefficients == (5e4, 100.0)


def test_a_sweep_within_and_above(folder):
    folder("configs/swept.yaml", MINE + "sweep: {manoeuvre_variance: [1, 2]}\n")
    folder("configs/other.yaml", "include: [swept]\nscans: 20\nsweep: {scans: [21, 22]}\n")
    found = [(case.name, case.spec.scans) for case in load("other").cases]
    names = [f"swept manoeuvre_variance={v} scans={n}" for v in (1, 2) for n in (21, 22)]
    assert found == [(name, int(name[-2:])) for name in names]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("radr: {sigma_range_m: 1}", "configs/c.yaml:2:1: radr: unknown key; did you mean radar? allowed: radar, "),
        ("radar: {sigma_range_m: -1}", "configs/c.yaml:2:24: radar.sigma_range_m: must be > 0, got -1"),
        ("radar:\n  sigma_m: 1", "configs/c.yaml:3:3: radar.sigma_m: unknown key; did you mean sigma_range_m?"),
        ("filters:\n  - {name: r}", "configs/c.yaml:3:5: filters.0.observes: required key is missing"),
        ("scans: 20\nduration_s: 100", "configs/c.yaml:3:13: duration_s: stands in place of scans: give one"),
        ("target: nowhere", "configs/c.yaml:2:9: target: no such scenario"),
        ("target: {distance_m: 4}", "configs/c.yaml:2:10: target.distance_m: unknown key"),
        ("target: bent", "scenarios/bent.yaml:2:15: coefficients: must be a list, got 'a'"),
    ],
)
def test_a_fault_is_where_it_was_written(folder, said, text, line):
    folder("scenarios/bent.yaml", "kind: polynomial\ncoefficients: 'a'\n")
    folder("configs/c.yaml", f"include: [mine]\n{text}\n")
    found = said("c")
    assert any(one.startswith(line) for one in found), found
    assert not any("mine.yaml" in one for one in found), found


def test_what_the_included_config_sweeps_cannot_be_changed_beside_it(folder, said):
    folder("configs/swept.yaml", MINE + "sweep: {target.coefficients: [[1e5, 1], [1e5, 2]]}\n")
    folder("configs/c.yaml", "include: [swept]\ntarget:\n  coefficients: [9e4, -100]\n")
    said_of = "configs/swept.yaml, which is included, sweeps it; sweep it here instead, and not there"
    assert said("c") == [f"configs/c.yaml:3:3: target.coefficients: {said_of}"]


@pytest.mark.parametrize(
    ("base", "swept", "beside"),
    [
        ("sonar_manoeuvre", "sensor.sigma_bearing_deg: [1, 2]", "sensor: {sigma_bearing_rad: 0.5}"),
        ("sonar_manoeuvre", "sensor.sigma_bearing_rad: [0.1, 0.2]", "sensor: {sigma_bearing_deg: 5}"),
        ("mine", "scans: [10, 12]", "duration_s: 100"),
    ],
)
def test_nor_can_its_twin_in_another_unit_or_said_another_way(folder, said, base, swept, beside):
    folder("configs/swept.yaml", f"include: [{base}]\nsweep: {{{swept}}}\n")
    folder("configs/c.yaml", f"include: [swept]\n{beside}\n")
    (line,) = said("c")
    assert line.startswith("configs/c.yaml:2:")
    assert line.endswith("swept.yaml, which is included, sweeps it; sweep it here instead, and not there")
    key, value = beside.replace("sensor: {", "sensor.").strip("}").split(": ")
    with pytest.raises(ConfigError, match=r"the config sweeps it: set sweep"):
        load("swept", [f"{key}={value}"])
    folder("configs/twice.yaml", f"include: [swept]\nsweep: {{{key}: [{value}, 0.1]}}\n")
    assert any("as well" in one for one in said("twice"))


def test_one_of_ones_own_after_a_config_that_changes_another(folder):
    folder("configs/other.yaml", "include: [mine]\nradar: {sigma_range_m: 80}\n")
    name, text = new_config("third", "other", registry)
    folder(f"configs/{name}", text)
    assert "detection_probability" not in text  # a default is not what the included config says
    assert identity_keys(load("third").cases[0].spec) == identity_keys(load("other").cases[0].spec)
    name, text = new_config("fitted", "other", registry, {"radar.sigma_range_m": 70.0, "manoeuvre_variance": 0.5})
    folder(f"configs/{name}", text)
    expected = load("other", ["radar.sigma_range_m=70", "manoeuvre_variance=0.5"]).cases[0].spec
    assert identity_keys(load("fitted").cases[0].spec) == identity_keys(expected)


def test_of_several_changed_cases_one_is_chosen_with_its_changes(folder, command_line):
    folder("configs/yours.yaml", MINE)
    folder("configs/other.yaml", "include: [mine, yours]\nscans: 20\n")
    with pytest.raises(ConfigError, match=r"choose one of mine, yours: track other --set 'include=\[mine\]'"):
        single_case(load("other"), "track with", "track {}")
    assert single_case(load("other", ["include=[mine]"]), "track with", "track {}").spec.scans == 20


def test_one_of_ones_own_after_what_includes_a_neighbour_is_written_out(folder):
    folder("apart/base.yaml", "include: [rls2]\nscans: 20\n")
    folder("apart/over.yaml", "include: [base]\nscans: 30\n")
    name, text = new_config("copy", "apart/over.yaml", registry)
    folder(name, text)
    assert identity_keys(load("copy").cases[0].spec)["scans"] == 30


def test_what_own_keys_break_in_an_included_config_names_both(folder, said):
    folder("configs/base.yaml", "include: [sonar_missed]\n")
    folder("configs/over.yaml", "include: [base]\nscans: 5\n")
    (line,) = said("over")
    assert "sonar_missed.yaml:" in line
    assert line.endswith("(with the keys of configs/over.yaml over it)")
    assert all("over it" not in one for one in said("rls2", "radar.detection_probability=2"))


def test_in_python_a_case_is_chosen_by_its_arguments(folder):
    folder("configs/yours.yaml", MINE)
    folder("configs/other.yaml", "include: [mine, yours]\nscans: 20\n")
    with pytest.raises(ConfigError, match=r"choose one of mine, yours: 'other', overrides=\['include=\[mine\]'\]$"):
        single_case(load("other"), "track with", "track {}")
