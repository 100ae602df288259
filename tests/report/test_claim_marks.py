"""A verdict follows from what is measured, how, and under which keys: an edit of any of these leaves no class."""

import csv
import dataclasses
import json
import math
import shutil
from types import SimpleNamespace

import pytest

from radarsim.engine.results import CaseResult
from radarsim.papers.claim import Part
from radarsim.papers.claim_files import with_arguments, with_cases
from radarsim.papers.claims_table import exact_value
from radarsim.papers.evidence import (
    ExactNumber,
    MissingEvidence,
    exact_number,
    has_interval,
    interpreted_case,
    shipped_spec,
)
from radarsim.papers.expected_ranges import above
from radarsim.papers.open_papers import open_papers
from radarsim.papers.verdict_classes import declaration_digest
from radarsim.report.statistics import Estimate
from radarsim.studies import sources
from tests.studies import example_packages

NAME = "walk53"
ANY_EVIDENCE = SimpleNamespace(exactly=lambda: None)  # of a measure that reads nothing


@pytest.mark.parametrize(
    ("estimate", "has"),
    [
        (Estimate(12.0, 5.0, 20.0), True),
        (Estimate(12.0, 12.0, 12.1), True),
        (Estimate(12.0, math.nan, math.nan), True),
        (Estimate(12.0, -math.inf, math.inf), True),
        (Estimate(12.0, 12.0, 12.0), False),
        (Estimate(1e9, 1e9, 1e9 * (1 + 2e-16)), False),
        (Estimate(0.0, math.nan, math.nan), False),  # a ratio of exact errors that are zero
        (Estimate(math.inf, math.inf, math.inf), False),
        (Estimate(math.inf, 14.0, math.inf), False),  # a settling time of a filter that does not settle
        (exact_number(3), False),
    ],
)
def test_an_estimate_with_an_interval_is_never_exact(estimate, has):
    assert has_interval(estimate) == has
    part = Part((), "it", "m", lambda evidence: estimate, above(10))
    value = exact_value(part, ANY_EVIDENCE, estimate)
    assert math.isnan(value) if has else value == estimate.value


def test_a_number_that_reads_tables_is_exact_where_it_says_so():
    def measure(evidence):
        raise MissingEvidence("sums")

    part = Part((), "it", "m", measure, above(10))
    assert exact_value(part, ANY_EVIDENCE, exact_number(12)) == 12
    assert math.isnan(exact_value(part, ANY_EVIDENCE, Estimate(12.0, 12.0, 12.0)))
    assert math.isnan(exact_value(part, ANY_EVIDENCE, ExactNumber(12.0, 11.0, 13.0)))


def test_a_case_under_an_interpretation_has_the_keys_of_its_run_and_is_found_by_those_of_the_paper():
    run, shipped = SimpleNamespace(sigma=2.0), SimpleNamespace(sigma=1.0)
    result = CaseResult("a", "study", run, (), 10, {}, None)
    case = dataclasses.replace(interpreted_case(result, shipped), count=20)
    assert (case.spec, shipped_spec(case), case.count) == (run, shipped, 20)
    assert shipped_spec(result) is run


@pytest.fixture(scope="module")
def paper():
    return open_papers(["P2"])["P2"]


def edited_parts(claim):
    """The claim with one thing of its first part changed, by the name of that."""
    part = claim.parts[0]
    for name, changed in {
        "arguments": with_arguments(part, further=1),
        "of": with_cases(part, "another case"),
        "measure": dataclasses.replace(part, measure=dataclasses.replace(part.measure, name="another")),
        "scale": dataclasses.replace(part, scale=part.measure.number),
        "ceiling": dataclasses.replace(part, ceiling=part.measure.number),
        "expected": dataclasses.replace(part, expected=part.expected._replace(lo=part.expected.lo - 1)),
        "margin": dataclasses.replace(part, expected=part.expected._replace(margin=2 * part.expected.margin)),
    }.items():
        yield name, dataclasses.replace(claim, parts=(changed, *claim.parts[1:]))


def test_the_mark_covers_measure_arguments_cases_expectation_and_what_choices_set(paper):
    interpretations, claim = paper.interpretations, paper.claims.claims[0]
    marks = {name: declaration_digest(interpretations, changed) for name, changed in edited_parts(claim)}
    marks["as declared"] = declaration_digest(interpretations, claim)
    choice = next(c for c in interpretations.choices if c.affects(claim.id) and len(c.alternatives) > 1)
    first, *others = choice.alternatives
    changed = dataclasses.replace(choice, alternatives=(dataclasses.replace(first, sets={"a": 1}), *others))
    other = type(interpretations)()
    other.choices = tuple(changed if c is choice else c for c in interpretations.choices)
    marks["sets"] = declaration_digest(other, claim)
    assert len(set(marks.values())) == len(marks), marks
    words = dataclasses.replace(claim, statement="in other words", original="anders gesagt")
    assert declaration_digest(interpretations, words) == marks["as declared"]


def test_comments_and_the_text_of_claims_are_no_code():
    code = b'"""About."""\nclass S:\n    """It."""\n    claims_yaml = "a"\n    def f(self):\n        return 1  # one\n'
    same = b'class S:\n    claims_yaml = """b"""\n    def f(self):\n        """One."""\n        return (1)\n'
    other = code.replace(b"return 1", b"return 2")
    first, second, third = (sources._plain_code(text, "claims_yaml") for text in (code, same, other))
    assert first == second != third


@pytest.fixture(scope="module")
def package(tmp_path_factory, warm):
    """A folder with a new package and its command."""
    folder = tmp_path_factory.mktemp("package")
    (folder / "site").mkdir()
    command = example_packages.beside(warm, folder / "site", folder)
    command("new-study", NAME)
    example_packages.installed(folder / NAME, folder / "site")
    return SimpleNamespace(folder=folder, command=command, file=folder / NAME / "src" / NAME / "__init__.py")


def edit(package, old, new):
    text = package.file.read_text(encoding="utf-8")
    assert text.count(old) == 1, old
    package.file.write_text(text.replace(old, new), encoding="utf-8")


GAIN = "measure: {gain: {filter: kalman, component: x}}, expected: {above: 10}"
STUDY_FILE, CONFIG = "__init__.py", f"shipped/configs/{NAME}.yaml"
EDITS = {  # of what: in which file, from what, to what
    "source of the measure": (STUDY_FILE, "(value / limit for", "(2 * value / limit for"),
    "source of a module that it calls": ("helper.py", "1.0", "2.0"),
    "data": ("factor.txt", "1.0", "2.0"),
    "shipped data": ("shipped/factor.txt", "1.0", "2.0"),
    "measure": (STUDY_FILE, GAIN, GAIN.replace("gain: {", "sigma: {")),
    "arguments": (STUDY_FILE, GAIN, GAIN.replace("component: x", "component: x, at: 1")),
    "cases": (
        STUDY_FILE,
        "of: [{target.sigma_step_m: 0.5}], what: gain",
        "of: [{target.sigma_step_m: 0.1}], what: gain",
    ),
    "expected": (STUDY_FILE, GAIN, GAIN.replace("10", "30")),
    "margin": (STUDY_FILE, "{same: [1, 0.01]}", "{same: [1, 1e-12]}"),
    "what an alternative sets": (STUDY_FILE, "sets: {target.sigma_start_m: 0}", "sets: {target.sigma_start_m: 1}"),
    "choices": (STUDY_FILE, "- {name: hardly anything,", "- {name: nothing,"),
    "config": (CONFIG, "scans: 30", "scans: 29"),
}
DOORS = f"""
import json, sys
import radarsim
from radarsim.errors import RadarsimError

def overall(rows):
    return {{row["claim"]: row["overall"] for row in rows}}

def claims():
    return overall(radarsim.claims("{NAME}").rows)

def loaded():
    return overall(radarsim.load("{NAME}").tables["claims"].to_dict("records"))

def reported():
    result = radarsim.load("{NAME}", overrides={{"realisations": 1000}})
    result.write("results", figures=False)
    return claims()

def run():
    radarsim.run("{NAME}", realisations=1000, out="results", figures=False, replace=True)
    return claims()

shown = {{}}
for door in claims, loaded, reported, run:
    try:
        shown[door.__name__] = door()
    except RadarsimError as error:
        shown[door.__name__] = {{}}
json.dump(shown, sys.stdout)
"""


@pytest.fixture(scope="module")
def judged_package(tmp_path_factory, warm):
    """A folder with a package whose claims have been judged under every interpretation, and what its doors show."""
    folder = tmp_path_factory.mktemp("judged")
    (folder / "site").mkdir()
    command = example_packages.beside(warm, folder / "site", folder)
    command("new-study", NAME)
    example_packages.installed(folder / NAME, folder / "site")
    source = folder / NAME / "src" / NAME
    study = source / STUDY_FILE
    text = study.read_text(encoding="utf-8").replace(
        "import numpy as np\n", "from pathlib import Path\n\nimport numpy as np\n", 1
    )
    text = text.replace("from radarsim", f"from {NAME} import helper\nfrom radarsim", 1)
    factor = "helper.FACTOR"
    for file in ("factor.txt", "shipped/factor.txt"):
        (source / file).write_text("1.0\n")
        factor += f" * float((Path(__file__).parent / '{file}').read_text())"
    study.write_text(text.replace("    limit = STUDY", f"    limit = {factor} * STUDY", 1), encoding="utf-8")
    (source / "helper.py").write_text("FACTOR = 1.0\n")
    config = source / CONFIG
    config.write_text(
        config.read_text(encoding="utf-8") + "sweep: {target.sigma_step_m: [0.5, 0.1]}\n", encoding="utf-8"
    )
    command("run", NAME, "-n", "1000", "--no-figures", "-q")
    command("interpretations", NAME, "--no-figures", "-q")
    return folder


def shown_by_the_doors(warm, folder):
    ended = warm.run(code=DOORS, path=[folder / "site"], cwd=folder)
    assert ended.returncode == 0, ended.stderr
    return json.loads(ended.stdout)


@pytest.mark.slow
def test_unedited_claims_keep_their_class_at_every_door(warm, judged_package, tmp_path):
    shown = shown_by_the_doors(warm, a_copy(judged_package, tmp_path))
    assert [*shown] == ["claims", "loaded", "reported", "run"]
    for door in ("claims", "reported", "run"):
        assert set(shown[door].values()) == {"confirmed"}
    assert {words.partition(" ")[0] for words in shown["loaded"].values()} == {"confirmed"}


def a_copy(package, folder):
    """The folder with package and results, and the package's metadata, to be edited."""
    shutil.copytree(package, folder, symlinks=True, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
    (folder / "site" / NAME).unlink()
    (folder / "site" / NAME).symlink_to(folder / NAME / "src" / NAME)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("what", EDITS)
def test_no_door_shows_a_verdict_that_was_made_before_an_edit(warm, judged_package, tmp_path, what):
    file, old, new = EDITS[what]
    folder = a_copy(judged_package, tmp_path)
    path = folder / NAME / "src" / NAME / file
    text = path.read_text(encoding="utf-8")
    assert text.count(old) == 1, old
    path.write_text(text.replace(old, new), encoding="utf-8")
    shown = shown_by_the_doors(warm, folder)
    edited = f"{NAME}.1" if GAIN in old or "gain" in old else f"{NAME}.2"
    assert shown["claims"].get(edited, "not run") == "not run"
    for door, verdicts in shown.items():
        assert verdicts.get(edited) != "confirmed", door
    if what in ("source of the measure", "source of a module that it calls", "data", "shipped data", "expected"):
        assert shown["run"][edited].startswith("refuted as shipped")
        assert not shown["loaded"][edited].startswith("confirmed")


@pytest.mark.slow
def test_a_measure_under_an_interpretation_sees_its_keys(package):
    line = next(line for line in package.file.read_text().splitlines() if "name: the first position, kind: U" in line)
    edit(package, line, line + "\n  - {name: longer steps, kind: U, reason: a test, sets: {target.sigma_step_m: 2}}")
    package.command("interpretations", NAME, "--no-figures", code=0)
    with open(package.folder / "results/interpretations/interpretations.csv", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["claim"] == f"{NAME}.2"]
    (longer,) = [row for row in rows if "longer steps" in row["interpretation"]]
    assert float(longer["exact"]) == pytest.approx(1, abs=1e-3)  # σ over the limit of the same keys
    assert longer["outcome"] == "confirmed"
