"""The tool that tries wrong formulas: its changes, the tests of a module, and what none of them notices."""

import ast

import pytest

from tests.trust import mutate

ONE_OF_EACH = '''
"""Words - and more."""
SHARE: float = 0.5
ROW = 3

def moved(x, f, many=2):
    "A docstring * of words."
    if x[many, 1] < max(many, 3):
        f(x, many)
        x += many - f
    return "a" + many
'''
CHANGED = {
    "SHARE: float = 0.5000005": "constant",
    "def moved(x, f, many=3):": "constant",
    "if x[many, 1] <= max(many, 3):": "comparison",
    "if x[1, many] < max(many, 3):": "swap",
    "if x[many, 2] < max(many, 3):": "constant",
    "if x[many, 1] < max(many, 4):": "constant",
    "f(many, x)": "swap",
    "pass": "dropped",
    "x += many + f": "operator",
}


def test_one_operation_is_changed_and_nothing_else():
    kinds = [kind for kind, *_ in mutate.operations(ast.parse(ONE_OF_EACH))]
    made = [mutate.mutant(ONE_OF_EACH, i) for i in range(len(kinds))]
    assert {one.after: kind for one, kind in zip(made, kinds, strict=True)} == CHANGED
    whole = ast.unparse(ast.parse(ONE_OF_EACH))
    assert all(one.text == whole.replace(one.before, one.after) for one in made)


def test_a_sample_has_every_kind_and_is_the_seeds():
    sites = mutate.sites(mutate.ROOT, ["radarsim/kernels/random.py", "radarsim/report/statistics.py"])
    drawn = mutate.sample(sites, 20, 1)
    assert len({site.kind for site in drawn}) == 5
    assert len(set(drawn)) == 20
    assert drawn == mutate.sample(sites, 20, 1) != mutate.sample(sites, 20, 2)
    assert set(mutate.sample(sites, len(sites) + 1, 1)) == set(sites)


@pytest.mark.slow
def test_every_module_of_formulas_has_its_tests():
    paths, tests = mutate.modules(), mutate.Tests(mutate.ROOT)
    assert {"radarsim/kernels/random.py", "radarsim/report/statistics.py"} <= set(paths)
    studies = {path.name for path in (mutate.ROOT / "radarsim/studies").iterdir() if (path / "config.py").exists()}
    assert studies - {path.split("/")[2] for path in paths} == set()
    assert not [path for path in paths if not tests.of(path)]
    asked = tests.of("radarsim/kernels/random.py")
    assert asked[0] == "tests/kernels/test_random.py"
    assert "tests/studies/range_doppler/test_study.py" in asked


MODULE, NOTICED = "radarsim/kernels/field.py", "tests/kernels/test_field.py"
FORMULAS = """
def area(a, b):
    return a * b


def edge(a, b):
    return a + b
"""
TESTS = """
from radarsim.kernels.field import area, edge


def test_area():
    assert area(2, 3) == 6
    assert edge(1, 0) == 1


def test_that_fails_without_a_change():
    assert area(2, 3) == 5
"""


@pytest.fixture
def tried(tmp_path, capfd):
    """What the tool prints of a package of one module with these formulas and tests; the module is left as it was."""

    def run(formulas: str, tests: str, limit_s: float = 120) -> tuple[int, list[str]]:
        files = {"radarsim/__init__.py": "", "radarsim/kernels/__init__.py": "", MODULE: formulas, NOTICED: tests}
        for name, text in files.items():
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_text(text, encoding="utf-8")
        code = mutate.main(["--root", str(tmp_path), "--limit-s", str(limit_s)])
        assert (tmp_path / MODULE).read_text(encoding="utf-8") == formulas
        return code, capfd.readouterr().out.splitlines()

    return run


@pytest.mark.slow
def test_what_no_test_notices_is_found(tried):
    code, lines = tried(FORMULAS, TESTS)
    verdicts = {lines[i + 2].split("-> ")[1]: lines[i].split()[0] for i in range(2, 8, 3)}
    assert verdicts == {"return a / b": "caught", "return a - b": "SURVIVED"}
    assert any(f"{MODULE}:7 (operator, change 1)" in line for line in lines)
    assert lines[1] == f"left out, fails without a change: {NOTICED}::test_that_fails_without_a_change"
    assert lines[-1] == "1 of 2 changes noticed"
    assert code == 1


@pytest.mark.slow
def test_a_change_that_never_ends_is_noticed(tried):
    formulas = "def area(a, b):\n    while a - b:\n        pass\n"
    code, lines = tried(
        formulas, "from radarsim.kernels.field import area\ndef test_area():\n    assert not area(1, 1)\n", 5
    )
    assert (code, lines[-1]) == (0, "1 of 1 changes noticed")
