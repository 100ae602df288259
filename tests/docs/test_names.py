"""Names of our modules, classes and functions in docstrings and pages, in code font, are names of something."""

import re
from collections import defaultdict
from functools import cache

import pytest

from tests.docs.test_links import PAGES, ROOT

NAME = re.compile(r"`([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)+)(?:\([^`]*\))?`|(?<![\w/.])([\w/]+\.py)\b")
FILES = r"\.(?:ast|bib|bin|blocks|csv|html|json|md|pdf|png|po|pyc?|svg|toml|txt|typed|cff|yaml|yml)$"
FOREIGN = (
    "concurrent",
    "csv",
    "dask",
    "json",
    "math",
    "np",
    "numpy",
    "os",
    "pd",
    "pydantic",
    "scipy",
    "Security",
    "yaml",
)
OTHERS = (
    "FILE.py",
    "my_filter.py",
    "radarsim.filters",
    "scans.errors",
    "STUDY.filters",
    "claims.CLAIMS",
    "plots.generator",  # of the argument of a filter, `radarsim.studies.plot_arrays.RandomPlots`
    "plots.normals",
    "plots.uniforms",
    "docs/making/measured_STUDY.py",
    "w2_c.py",
)
OF = {"result": "Result", "evidence": "Evidence"}  # classes of what pages call so
ROOMS = "radarsim", "tests", "docs", "benchmarks", "examples"
SOURCES = sorted(path for room in ROOMS for path in (ROOT / room).rglob("*.py"))
TEXTS = [page for page in PAGES if page.name != "CHANGELOG.md"]  # which says how things were called
TEXTS += [path for path in SOURCES if path.relative_to(ROOT).parts[0] in ("radarsim", "docs")]


@cache
def bound() -> dict[str, set[str]]:
    """What each dotted name may be followed by: modules by any end of their path, and classes."""
    found, bases = defaultdict(set), defaultdict(set)
    for path in SOURCES:
        text = path.read_text(encoding="utf-8")
        parts = path.relative_to(ROOT).with_suffix("").parts
        names = {name for line in re.findall(r"^(?:def |class )?([\w, ]*\w)", text, re.M) for name in line.split(", ")}
        if parts[-1] == "__init__":  # a room, which hands on what it imports
            parts, names = parts[:-1], set(re.findall(r"\w+", text))
        for start in range(len(parts)):
            found[".".join(parts[start:])] |= names
            found[".".join(parts[start:-1])].add(parts[-1])
        for name, body in re.findall(r"^class (\w+)(.*?)(?=^\S|\Z)", text, re.M | re.S):
            found[name] |= set(re.findall(r"^    (?:def )?(\w+)", body, re.M))
            bases[name] |= set(re.findall(r"\w+", body.partition(":")[0]))
    for name, of in bases.items():
        found[name] = found[name].union(*(found[base] for base in of if base in found))
    return found


@cache
def keys() -> str:
    return (ROOT / "docs/schema.json").read_text(encoding="utf-8")


def stands(name: str) -> bool:
    """Whether a name is that of a file, a key, of a library, or of something of ours."""
    if name in OTHERS:
        return True
    if name.endswith(".py"):
        return name.startswith("my_paper/") or any(str(path).endswith(f"/{name}") for path in SOURCES)
    of, _, last = name.rpartition(".")
    if re.search(FILES, name) or name.split(".")[0] in FOREIGN or all(f'"{key}"' in keys() for key in name.split(".")):
        return True
    of = OF.get(of, of)
    owner = of.rpartition(".")[2]
    return name in bound() or last in bound().get(owner if owner[0].isupper() else of, ())


def test_names_in_code_font_are_names_of_something():
    named = {(path, a or b) for path in TEXTS for a, b in NAME.findall(path.read_text(encoding="utf-8"))}
    assert sorted(f"{path.relative_to(ROOT)}: {name}" for path, name in named if not stands(name)) == []


@pytest.mark.parametrize(
    "name", ["kernels.lanes", "second_order.simulate_block", "Study.floor", "api/run.py", "radar.seed"]
)
def test_a_name_of_something_stands(name):
    assert stands(name)


@pytest.mark.parametrize(
    "name", ["kernels.quadruples", "second_order.simulated", "Study.computes_in", "radarsim.went", "fit/run.py"]
)
def test_a_name_of_nothing_is_seen(name):
    assert not stands(name)
