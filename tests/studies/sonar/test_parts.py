"""The sonar's three parts: each rests on the common base alone."""

import ast
import inspect
import json
import re
from pathlib import Path

import pytest

import radarsim
from radarsim.api.configs import load
from radarsim.engine.results import Axes
from radarsim.studies.sonar import PARTS, STUDY
from radarsim.studies.sonar.axes import GivenPlotsAxes, SonarAxes
from radarsim.studies.sonar.clutter.axes import ClutterAxes
from radarsim.studies.sonar.manoeuvre.axes import ManoeuvreAxes
from tests.studies.sonar.clutter.test_study import config as clutter_config
from tests.studies.sonar.clutter.test_study import tracker
from tests.studies.sonar.manoeuvre.test_kernels import config as manoeuvre_config
from tests.studies.sonar.test_study import config as smoothing_config

PACKAGE = "radarsim.studies.sonar"
FOLDER = Path(radarsim.__file__).parent / "studies" / "sonar"
SHIPPED = {
    "smoothing": ("sonar_smoothing", "sonar_missed", "sonar_correlated", "sonar_asynchronous", "sonar_conversion"),
    "manoeuvre": ("sonar_manoeuvre", "sonar_manoeuvre_turning"),
    "clutter": ("sonar_clutter", "sonar_clutter_gate", "sonar_clutter_rare", "sonar_clutter_ends"),
}
CASES = [(part, stem) for part, stems in SHIPPED.items() for stem in stems]
TOGETHER = ("__init__.py",)  # the declared study


def part_of(module):
    """The part that a module lies in; None for the base and what is no sonar's."""
    rest = module.removeprefix(f"{PACKAGE}.").partition(".")[0]
    return rest if module.startswith(f"{PACKAGE}.") and rest in PARTS else None


def imported(path):
    """Every name that a file imports, at any depth."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            yield from (f"{node.module}.{alias.name}" for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


@pytest.mark.parametrize("path", sorted(FOLDER.rglob("*.py")), ids=lambda path: str(path.relative_to(FOLDER)))
def test_the_base_knows_no_part_and_a_part_no_other(path):
    own = path.relative_to(FOLDER).parts[0]
    if own not in TOGETHER:
        found = {part_of(name) for name in imported(path)} - {None}
        assert found <= ({own} if own in PARTS else set())


@pytest.mark.parametrize(("part", "stem"), CASES)
def test_what_a_case_is_follows_from_its_keys(part, stem):
    for case in load(stem).cases:
        assert case.spec.parts[-1] == part
        assert case.spec.parts == (("smoothing", "manoeuvre") if part == "manoeuvre" else (part,))


def test_labels_are_typed_and_described():
    for kind in (SonarAxes, GivenPlotsAxes, ManoeuvreAxes, ClutterAxes):
        for name in set(kind.__annotations__) - set(Axes.__annotations__):
            described = rf"\n    {name}: .*  #: |\n    #: .*\n    {name}: "
            assert re.search(described, inspect.getsource(kind)), f"{kind.__name__}.{name}"
    kinds = {"sonar_smoothing": GivenPlotsAxes, "sonar_manoeuvre": ManoeuvreAxes, "sonar_clutter": ClutterAxes}
    for stem, kind in kinds.items():
        case = load(stem).cases[0]
        axes = STUDY.prepare(case).axes
        assert type(axes) is kind
        relabelled = STUDY.relabelled(axes, case)
        assert type(relabelled) is kind
        assert relabelled.filters == tuple(one.name for one in case.spec.filters)


def written(folder, name, config):
    """A config in a file, in JSON, which is YAML."""
    (folder / f"{name}.yaml").write_text(json.dumps(config | {"realisations": 64}), encoding="utf-8")


def test_cases_of_all_parts_in_one_run(tmp_path):
    """Tables have the rows of each case that asks for them, figures are drawn, answers told of each part."""
    written(tmp_path, "plain", smoothing_config(scans=30, filters=[{"name": "growing", "kind": "growing_memory"}]))
    written(tmp_path, "moving", manoeuvre_config())
    written(tmp_path, "among", clutter_config([tracker("nearest")], density=1.0, detection=0.9, scans=12))
    (tmp_path / "all.yaml").write_text("include: [plain, moving, among]\n", encoding="utf-8")
    result = radarsim.run(tmp_path / "all.yaml")
    rows = {name: set(table["case"]) for name, table in result.tables.items() if "case" in table}
    assert rows["extrapolation"] == rows["curves"] == {"plain", "moving", "among"}
    assert rows["plots"] == {"plain"}
    assert rows["detections"] == {"moving"}
    assert rows["tracks"] == {"among"}
    assert {"sigma_r", "plots", "modes", "confirmation"} <= set(result.figures)
    assert result.question.startswith("How soon and how surely is a track confirmed")
    assert result.answer[0].startswith("“nearest” confirms")
    assert any("RMS error of the range after 145 s" in sentence for sentence in result.answer)
