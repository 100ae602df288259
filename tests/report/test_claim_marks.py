"""A verdict follows from what is measured, how, and under which keys: an edit of any of these leaves no class."""

import csv
import dataclasses
import math
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


@pytest.mark.slow
def test_a_class_does_not_outlive_the_edit_of_its_measure(package):
    package.command("run", NAME, "-n", "2000", "--no-figures", "-q")
    first = package.command("interpretations", NAME, "--no-figures").stdout
    assert f"{NAME}.1" in first
    before = package.command("claims", NAME, "--parts").stdout
    assert "other interpretations not judged" not in before
    edit(
        package,
        "measure: {gain: {filter: kalman, component: x}}, expected: {above: 10}",
        "measure: {sigma: {filter: fixed, component: x, at: 1}}, expected: {above: 10}",
    )
    assert f"{NAME}.1 not run" in " ".join(package.command("claims", NAME).stdout.split())
    package.command("run", NAME, "-n", "2000", "--no-figures", "-q")
    after = package.command("claims", NAME, "--parts").stdout
    assert f"{NAME}.1 refuted as shipped; other interpretations not judged" in " ".join(after.split())


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
