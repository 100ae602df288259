"""An installed package whose study cannot be used: one line with its name where it is asked for, no harm elsewhere."""

import json

import pytest

from tests.studies import example_packages

WHOLE = """
from radarsim.studies.interface import Study

class Whole(Study):
    name, about, filters = "{name}", "a study", {{}}
    def keys(self): {keys}
    def claims(self): return None
    prepare = simulate = tables = figures = question = answer = None

STUDY = Whole()
"""
PACKAGES = {  # study: source of its module, what is said
    "absent": (None, "cannot be loaded: ModuleNotFoundError: No module named 'module_of_absent'"),
    "failing": ("raise RuntimeError('first line\\nsecond')", "cannot be loaded: RuntimeError: first line"),
    "leaving": ("raise SystemExit(0)", "cannot be loaded: SystemExit: 0"),
    "quitting": ("import sys\nsys.exit('no licence')", "cannot be loaded: SystemExit: no licence"),
    "ending": (WHOLE.format(name="ending", keys="import sys; sys.exit()"), "fails: SystemExit ("),
    "typed": ("STUDY = 7", "must offer a radarsim.studies.interface.Study, got int"),
    "partial": (
        "from radarsim.studies.interface import Study\nclass S(Study): pass\nSTUDY = S()\n",
        "cannot be loaded: TypeError: Can't instantiate abstract class S",
    ),
    "named": (WHOLE.format(name="other", keys="return None"), "offers it under this name, but it is called other"),
    "keyless": (WHOLE.format(name="keyless", keys="return dict"), "must give keys that are a subclass of"),
    "raising": (
        WHOLE.format(name="raising", keys="import no_such_thing"),
        "fails: ModuleNotFoundError: No module named",
    ),
    "greedy": (
        WHOLE.format(
            name="greedy",
            keys="from radarsim.config.study_keys import StudyKeys as Keys; "
            "return type('Greedy', (Keys,), {'__annotations__': {'seed': int}})",
        ),
        "has keys that every config has already: seed",
    ),
}


@pytest.fixture(scope="module")
def radarsim(tmp_path_factory, warm):
    """The real command beside all these packages; further, two of one study and one of a shipped study's name."""
    folder = tmp_path_factory.mktemp("broken")
    site = folder / "site"
    for name, (source, _) in PACKAGES.items():
        example_packages.metadata(site, f"pack-{name}", "2.0", {name: f"module_of_{name}:STUDY"})
        if source is not None:
            (site / f"module_of_{name}.py").write_text(source)
    for number in (1, 2):
        example_packages.metadata(site, f"pack-twice{number}", "2.0", {"twice": "module_of_typed:STUDY"})
    example_packages.metadata(site, "pack-shipping", "2.0", {"shipping": "packed.study:STUDY"})
    (site / "packed" / "shipped" / "configs").mkdir(parents=True)
    (site / "packed" / "__init__.py").write_text("raise ImportError('no numba here')")
    (site / "packed" / "shipped" / "configs" / "packed_slopes.yaml").write_text("study: shipping\nrealisations: 9\n")
    example_packages.metadata(site, "pack-thief", "2.0", {"sonar": "module_of_typed:STUDY"})
    return example_packages.beside(warm, site, folder)


@pytest.mark.slow
def test_all_that_is_whole_is_listed_and_of_the_others_why_they_are_not(radarsim):
    studies = json.loads(radarsim("list", "--json").stdout)["studies"]
    told = {one["name"]: one["paper and question"] for one in studies if "cannot be used" in one["paper and question"]}
    assert told.keys() == {*PACKAGES, "twice", "sonar", "shipping"}
    assert "the package pack-thief is not used" in told["sonar"]
    assert any(one["name"] == "sonar" and "Butyrskiy" in one["paper and question"] for one in studies)


@pytest.mark.slow
def test_schema_claims_and_other_studies_take_no_harm(radarsim):
    kinds = json.loads(radarsim("schema").stdout)["$defs"]
    assert "sonar" in kinds
    assert not kinds.keys() & PACKAGES.keys()
    assert {row["claim"][:2] for row in json.loads(radarsim("claims", "--json").stdout)} == {"P1", "P2", "P3", "P4"}
    assert "valid" in radarsim("check", "rls2").stdout
    assert "no such config; did you mean rls2?" in radarsim("check", "rls22", code=2).stderr


def test_one_line_with_the_packages_name_where_it_is_asked_for(radarsim, tmp_path):
    """All configs at once: a fault each."""
    for name in (*PACKAGES, "twice"):
        (tmp_path / f"{name}.yaml").write_text(f"study: {name}\nrealisations: 10\n")
    asked = [f"{name}.yaml" for name in PACKAGES]
    lines = radarsim("run", *asked, "twice.yaml", cwd=tmp_path, code=2).stderr.splitlines()
    assert lines.pop() == "study twice: offered by the packages pack-twice1 and pack-twice2: uninstall all but one"
    for (name, (_, said)), line in zip(PACKAGES.items(), lines, strict=True):
        assert line.startswith(f"study {name}: the package pack-{name} 2.0 {said}")


@pytest.mark.slow_cases("packed_slopes")
@pytest.mark.parametrize("stem", ["shipping", "packed_slopes"])
def test_a_config_that_a_broken_package_would_have_is_not_merely_missing(radarsim, tmp_path, stem):
    fault = "study shipping: the package pack-shipping 2.0 cannot be loaded: ImportError: no numba here"
    begun, place = radarsim("run", stem, cwd=tmp_path, code=2).stderr.rstrip(")\n").split(" (")
    assert begun == f"{stem}: no such config: {fault}"
    assert place.endswith("packed/__init__.py:1")
    (tmp_path / "both.yaml").write_text(f"include: [rls2, {stem}]\n")
    said = radarsim("check", "both.yaml", cwd=tmp_path, code=2).stderr
    assert said == f"both.yaml:1:17: include.1: no such config: {fault} ({place}), got '{stem}'\n"
    assert "no such config; the nearest: " in radarsim("run", "wholly_unknown", cwd=tmp_path, code=2).stderr
