"""Where configs and scenarios are found, and what a name that is none is told."""

import os
import tomllib
from pathlib import Path

import pytest

from radarsim.api.configs import load
from radarsim.config import find_files

SHIPPED = sorted(file.stem for file in (find_files.SHIPPED / "configs").glob("*.yaml"))
KINDS = "configs", "scenarios"
OWN = (find_files.SHIPPED / "configs/rls2.yaml").read_text()


def coefficients(source):
    return load(source).cases[0].spec.target.coefficients


@pytest.mark.parametrize("stem", SHIPPED)
def test_shipped_configs_run_by_stem_from_anywhere(house, stem):
    experiment = load(stem)
    assert experiment.stem == stem
    assert experiment.path == str(find_files.SHIPPED / f"configs/{stem}.yaml")


def test_a_config_here_comes_before_one_in_configs_before_the_shipped(house):
    house("configs/rls2.yaml", OWN)
    assert load("rls2").path == "configs/rls2.yaml"
    house("rls2.yaml", OWN)
    assert load("rls2").path == "rls2.yaml"
    assert load("configs/rls2.yaml").path == "configs/rls2.yaml"
    assert load(Path("configs") / "rls2.yaml").path == "configs/rls2.yaml"


def test_scenarios_beside_the_config_then_next_to_its_folder_then_here_then_shipped(house):
    def scenario(value):
        return f"kind: polynomial\ncoefficients: [{value}]\n"

    house("project/configs/own.yaml", OWN)
    assert coefficients("project/configs/own.yaml") == (100e3, -250.0, 4.0)
    house("scenarios/polynomial.yaml", scenario(1))
    assert coefficients("project/configs/own.yaml") == (1.0,)
    house("project/scenarios/polynomial.yaml", scenario(2))
    assert coefficients("project/configs/own.yaml") == (2.0,)
    house("project/configs/polynomial.yaml", scenario(3))
    assert coefficients("project/configs/own.yaml") == (3.0,)


@pytest.mark.parametrize("name", ["configs/own.yaml", "./own.yaml", "../house/own.yaml", "own.yaml"])
def test_scenarios_next_to_the_folder_whatever_the_notation(tmp_path, monkeypatch, name):
    house = tmp_path / "house"
    (house / "configs").mkdir(parents=True)
    monkeypatch.chdir(house)
    Path(name).write_text(OWN)
    around = house if name.startswith("configs") else tmp_path
    (around / "scenarios").mkdir()
    (around / "scenarios/polynomial.yaml").write_text("kind: polynomial\ncoefficients: [5]\n")
    assert coefficients(name) == (5.0,)


def test_a_config_is_not_its_own_scenario(house):
    house("turn.yaml", OWN.replace("target: polynomial", "target: turn"))
    assert load("turn.yaml").cases[0].spec.target.kind == "turn"


def test_nor_is_another_config_beside_it(house):
    house("turn.yaml", "# compared\ninclude: [own]\nsweep: {target: [turn, polynomial]}\n")
    house("own.yaml", OWN)
    assert [case.spec.target.kind for case in load("turn.yaml").cases] == ["turn", "polynomial"]


def test_includes_are_looked_up_beside_the_config_first(house):
    house("project/both.yaml", "include: [rls2, rls1]\n")
    house("configs/rls2.yaml", OWN.replace("seed: 2017", "seed: 1"))
    assert [case.seed for case in load("project/both.yaml").cases] == [1, 2017]
    house("project/rls2.yaml", OWN.replace("seed: 2017", "seed: 2"))
    assert [case.seed for case in load("project/both.yaml").cases] == [2, 2017]


def test_faults_of_a_scenario_name_its_file(house, said):
    house("configs/own.yaml", OWN)
    house("scenarios/polynomial.yaml", "kind: polynomial\ncoefficients: [1, x]\ncolour: red\n")
    assert said("own") == [
        "scenarios/polynomial.yaml:2:19: coefficients.1: must be a number, got 'x'",
        "scenarios/polynomial.yaml:3:1: colour: unknown key; allowed: kind, coefficients",
    ]
    house("scenarios/polynomial.yaml", "kind: polynomial\nkind: turn\ncoefficients: [.inf]\n")
    assert said("own") == [
        "scenarios/polynomial.yaml:2:1: kind: duplicate key, first in line 1",
        "scenarios/polynomial.yaml:3:16: coefficients.0: must be a finite number, got '.inf'",
    ]
    house("scenarios/polynomial.yaml", "kind: polynomial\n")
    assert said("own") == ["scenarios/polynomial.yaml:1:1: coefficients: required key is missing"]


def test_a_scenario_that_is_no_mapping(house, said):
    house("configs/own.yaml", OWN)
    house("scenarios/polynomial.yaml", "[1, 2]\n")
    assert said("own") == [
        "scenarios/polynomial.yaml:1:1: must be a mapping of keys, got [1, 2]",
        "configs/own.yaml:10:9: target: the scenario cannot be read, got 'polynomial'",
    ]


NO_CONFIG = [
    ("rsl2", "rsl2: no such config; did you mean rls2?"),
    ("nothing at all", "nothing at all: no such file"),
    ("rls9.yaml", "rls9.yaml: no such file"),
    ("configs/rls2.yaml", "configs/rls2.yaml: no such file"),
    ("../rls2", "../rls2: no such file"),
    ("folder", "folder: no such config"),
    ("folder/", "folder: is a directory"),
    (".", ".: is a directory"),
    ("..", "..: is a directory"),
    ("", ".: is a directory"),
    ("pipe.yaml", "pipe.yaml: is not a regular file"),
    ("/dev/zero", "/dev/zero: is not a regular file"),
    ("a\x00b", r"a\x00b: "),
    ("a\nb", r"a\nb: no such file"),
    ("x" * 5000, "x"),
    (".hidden.yaml", ".hidden.yaml: a config's name must be of letters, digits and _ + = - . and not begin with a dot"),
    ("a b.yaml", "a b.yaml: a config's name must be of letters, digits and _ + = - . and not begin with a dot"),
]


@pytest.mark.parametrize(("name", "line"), NO_CONFIG, ids=lambda text: repr(text)[:20])
def test_a_name_that_is_no_config(house, said, name, line):
    os.mkfifo("pipe.yaml")
    house("folder/x", "")
    house(".hidden.yaml", OWN)
    house("a b.yaml", OWN)
    (found,) = said(name)
    assert found.startswith(line)
    assert len(found) < 700


@pytest.mark.skipif(os.geteuid() == 0, reason="root reads everything")
def test_a_file_that_may_not_be_read(house, said):
    house("own.yaml", OWN)
    os.chmod("own.yaml", 0)
    assert said("own.yaml") == ["own.yaml: cannot be read: Permission denied"]


@pytest.mark.parametrize("name", ["a", "rls2_manoeuvre_variance", "multimodel_1hz", "a-b+c=1.5", "рлс2", "2"])
def test_stems(name):
    assert find_files.is_stem(name)


@pytest.mark.parametrize(
    "name", ["", ".", "..", ".a", "a/b", "/a", "a\\b", "C:a", "a b", "a\n", "a..b", "a.", "-a", "x" * 101, "~"]
)
def test_no_stems(name):
    assert not find_files.is_stem(name)


def test_what_is_shipped_is_what_lies_beside_the_package():
    """By links in a checkout, by copies in a source distribution."""
    root = Path(__file__).parents[2]
    for kind in KINDS:
        folders = find_files.SHIPPED / kind, root / kind
        shipped, beside = ({file.name: file.read_bytes() for file in folder.iterdir()} for folder in folders)
        assert shipped == beside


def test_a_wheel_holds_every_shipped_file():
    """By the patterns of package-data, which setuptools expands through the links into copies."""
    root = Path(__file__).parents[2]
    patterns = tomllib.loads((root / "pyproject.toml").read_text())["tool"]["setuptools"]["package-data"]["radarsim"]
    packed = {file for pattern in patterns for file in (root / "radarsim").glob(pattern)}
    assert packed >= {find_files.SHIPPED / kind / file.name for kind in KINDS for file in (root / kind).iterdir()}


def test_of_many_names_the_three_nearest_are_listed():
    names = [f"radar{i}" for i in range(20)]
    hint = find_files.known_names_hint("wholly_unknown", names, "configs")
    assert hint.endswith("; `radarsim list configs` has all 20")
    assert len(hint.partition("nearest: ")[2].partition(";")[0].split(", ")) == 3
    assert find_files.known_names_hint("radar", names, "configs").startswith("; did you mean radar")
    assert find_files.known_names_hint("xyz", ["a", "b"], "configs") == "; there are: a, b"
