"""A copy of the package, edited place by place: which cases get another identity?"""

import ast
import os
import shutil
import subprocess
import sys
from importlib.util import spec_from_file_location
from pathlib import Path

import pytest

from radarsim.app.configs import load
from radarsim.kernels import sources
from radarsim.studies import identity, registry
from radarsim.studies.folder import StudyFolder

ROOT = Path(__file__).parents[2]
STEMS = (
    *("rls2", "multimodel", "sonar_smoothing", "sonar_manoeuvre", "sonar_clutter", "discriminator"),
    *("ambiguous_rls4", "pulses"),
)
SONAR = {stem for stem in STEMS if stem.startswith("sonar_")}
ALL, NONE = set(STEMS), set()
FOLDERS = {
    "range_doppler": {"rls2"},
    "multimodel": {"multimodel"},
    "discriminator": {"discriminator"},
    "ambiguous_doppler": {"ambiguous_rls4"},
    "pulses_to_tracks": {"pulses"},
    "sonar": SONAR,
}
COMPUTING = ("study", "config", "world", "filters", "exact")
SHOWING = ("tables", "figures", "words", "claims", "measures")
STUDIES = ROOT / "radarsim" / "studies"
CLUTTER = {"sonar_clutter"}
# It puts the keys of the sonar's parts together: what it makes of them stands in the resolved case, and which part
# computes the case in what is named.
ASSEMBLED = {"radarsim.studies.sonar.schema"}


@pytest.fixture(scope="module")
def cases():
    return {stem: load(stem).cases[0] for stem in STEMS}


@pytest.fixture(scope="module")
def copy(tmp_path_factory):
    """The package's sources alone, in a folder of their own."""
    folder = tmp_path_factory.mktemp("copy") / "radarsim"
    shutil.copytree(ROOT / "radarsim", folder, ignore=shutil.ignore_patterns("__pycache__", "shipped", "known"))
    return folder


@pytest.fixture
def identities(copy, cases, monkeypatch):
    """The identity of every case, with the sources that the copy holds now."""

    def top_spec(package):
        found = sources.find_spec(package)
        if package != "radarsim":
            return found
        places = [str(copy)]
        return spec_from_file_location(package, copy / "__init__.py", submodule_search_locations=places)

    top_spec.cache_clear = lambda: None
    monkeypatch.setattr(sources, "top_spec", top_spec)
    monkeypatch.setattr(sources, "remember", lambda file: None)
    monkeypatch.setattr(identity, "computing_sources", identity.computing_sources.__wrapped__)

    def seen():
        sources.forget()
        return {stem: identity.identity(case) for stem, case in cases.items()}

    yield seen
    monkeypatch.undo()
    sources.forget()


@pytest.fixture(scope="module")
def unedited():
    """The identities with the copy as it was made, once they are known."""
    return {}


@pytest.fixture
def moved(copy, identities, unedited):
    """The stems whose identity another text of a file changes; the file is as before afterwards."""
    if not unedited:
        unedited.update(identities())

    def of(path, text):
        file = copy / path
        kept = file.read_text()
        file.write_text(text)
        try:
            after = identities()
        finally:
            file.write_text(kept)
        return {stem for stem in STEMS if unedited[stem] != after[stem]}

    return of


def text_of(path):
    return (ROOT / "radarsim" / path).read_text()


def replaced(path, old, new):
    text = text_of(path)
    assert old in text, f"{path}: no longer says {old!r}"
    return text.replace(old, new, 1)


def other_number(text):
    """A source with its first number, in a statement that is run, made another; with one more where it has none."""
    nodes = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Constant)]
    numbers = [node for node in nodes if type(node.value) in (int, float)]
    if not numbers:
        return f"{text}\nADDED = 1\n"
    first = min(numbers, key=lambda node: (node.lineno, node.col_offset))
    lines = text.splitlines(keepends=True)
    line = lines[first.lineno - 1].encode()
    changed = line[: first.col_offset] + repr(first.value + 3).encode() + line[first.end_col_offset :]
    lines[first.lineno - 1] = changed.decode()
    return "".join(lines)


def other_sentences(text):
    """A source with another docstring, other comments and another blank line."""
    ends = ast.parse(text).body[0]
    assert isinstance(ends, ast.Expr)
    lines = text.splitlines(keepends=True)
    return "".join(['"""Other words."""\n', "# A comment.\n\n", *lines[ends.end_lineno :], "\n# The end.\n"])


def files_of(folder, names):
    """The files of a study with these roles, wherever they lie in it."""
    return [
        str(path.relative_to(ROOT / "radarsim")) for name in names for path in (STUDIES / folder).rglob(f"{name}.py")
    ]


def affected(path):
    """The cases that a computing source of a study may move, and those that it must."""
    _, folder, *rest = Path(path).parts
    if folder != "sonar":
        return FOLDERS[folder], FOLDERS[folder]
    return SONAR, {f"sonar_{rest[0]}"} if len(rest) > 1 and f"sonar_{rest[0]}" in SONAR else NONE


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_number_in_a_source_that_computes_moves_its_study_and_no_other(folder, moved):
    for path in files_of(folder, COMPUTING):
        may, must = affected(path)
        found = moved(path, other_number(text_of(path)))
        assert must <= found <= may, path
        assert found, path


@pytest.mark.parametrize("folder", FOLDERS)
def test_what_shows_numbers_moves_nothing(folder, moved):
    for path in files_of(folder, SHOWING):
        assert moved(path, other_number(text_of(path))) == NONE, path


@pytest.mark.parametrize("folder", FOLDERS)
def test_sentences_move_nothing(folder, moved):
    for path in [*files_of(folder, (*COMPUTING, "track")), f"studies/{folder}/__init__.py"]:
        assert moved(path, other_sentences(text_of(path))) == NONE, path


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("kernels/random.py", ALL),
        ("kernels/compile.py", ALL),
        ("physics/motion.py", {"rls2", "ambiguous_rls4", "pulses"} | SONAR),
        ("physics/frames.py", {"multimodel"}),
        ("bursts/fisher.py", {"discriminator", "pulses"}),
        ("bursts/kernels/scoring.py", {"discriminator", "pulses"}),
        ("studies/noise.py", ALL),
        ("studies/radial.py", {"rls2", "ambiguous_rls4", "pulses"}),
        ("config/fields.py", ALL),
        ("config/radial.py", {"rls2", "ambiguous_rls4", "pulses"}),
        ("config/identity.py", ALL),
        ("engine/moments.py", ALL),
        ("kernels/cache.py", NONE),
        ("kernels/sources.py", NONE),
        ("kernels/trees.py", NONE),
        ("config/experiment.py", NONE),
        ("config/load.py", NONE),
        ("engine/store.py", NONE),
        ("engine/machine.py", NONE),
        ("engine/results.py", NONE),
        ("errors.py", NONE),
        ("report/statistics.py", NONE),
        ("report/tables.py", NONE),
        ("app/run.py", NONE),
        ("cli/console.py", NONE),
        ("recorded/follow.py", NONE),
        ("studies/registry.py", NONE),
        ("studies/interface.py", NONE),
        ("studies/identity.py", NONE),
    ],
)
def test_the_shared_rooms(path, expected, moved):
    assert moved(path, other_number(text_of(path)) + "\nADDED = 1\n") == expected


@pytest.mark.parametrize(
    ("path", "old", "new", "expected"),
    [
        # Derived values and defaults of configs, which the resolved case does not show.
        ("studies/sonar/clutter/config.py", '"gate_probability": 0.99', '"gate_probability": 0.90', CLUTTER),
        ("studies/sonar/clutter/config.py", "(3, 4)", "(2, 3)", CLUTTER),
        ("studies/discriminator/config.py", "def needs_samples(self, estimator: Estimator) -> bool:\n",
         "def needs_samples(self, estimator: Estimator) -> bool:\n        estimator = None\n", {"discriminator"}),
        # A word in a docstring, a description, a comment; a line of a registry.
        ("studies/sonar/clutter/track.py", '"""', '"""Here: ', NONE),
        ("studies/sonar/clutter/config.py", 'description="', 'description="that is ', NONE),
        ("studies/range_doppler/config.py", 'description="', 'description="that is ', NONE),
        ("studies/range_doppler/config.py", 'title="', 'title="another ', NONE),
        ("studies/range_doppler/config.py", '{"symbol": "', '{"symbol": "Q', NONE),
        ("studies/range_doppler/config.py", "Field(gt=0), Added()", "Field(gt=0.5), Added()", {"rls2"}),
        ("studies/registry.py", '"multimodel": ', '"another": "elsewhere.study",\n    "multimodel": ', NONE),
        # The declared study: what it is called and shows, and how it computes.
        ("studies/range_doppler/__init__.py", 'about="', 'about="Indeed: ', NONE),
        ("studies/range_doppler/__init__.py", '"inputs",', "", NONE),
        ("studies/sonar/__init__.py", ".simulate(first, count)", ".simulate(first + 1, count)", SONAR),
    ],
)  # fmt: skip
def test_single_places(path, old, new, expected, moved):
    found = moved(path, replaced(path, old, new))
    assert found == expected or (expected == CLUTTER and CLUTTER <= found <= SONAR)


def test_a_halved_correlation_and_another_start(moved):
    """Functions and properties of a config that its numbers are made with."""
    path = "studies/sonar/config.py"
    tree = ast.parse(text_of(path))
    for name in ("correlation_of", "initial_range_m"):
        text = text_of(path)
        found = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and node.name == name]
        last = next(node for node in ast.walk(found[0]) if isinstance(node, ast.Return))
        lines = text.splitlines(keepends=True)
        line = lines[last.lineno - 1]
        lines[last.lineno - 1] = line.replace("return ", "return 0.5 * ", 1)
        assert moved(path, "".join(lines)) == SONAR, name


def test_a_statement_that_a_package_runs_counts(moved):
    path = "studies/multimodel/__init__.py"
    text = text_of(path)
    assert moved(path, f"{text}\nADDED = 1\n") == NONE
    assert moved(path, f"{text}\nimport numpy\nnumpy.seterr(over='raise')\n") == {"multimodel"}
    assert moved("kernels/__init__.py", text_of("kernels/__init__.py") + "print()\n") == ALL


@pytest.mark.parametrize("name", registry.SHIPPED)
def test_every_study_begins_where_prepare_and_simulate_do(name):
    """What these import is among what is followed from `computes_in`, over all shipped cases of a study."""
    study = registry.study(name)
    if isinstance(study, StudyFolder):
        (spec,) = (case.spec for case in load(next(stem for stem in STEMS if stem in FOLDERS[name])).cases)
        assert study.computes_in(spec) == (study.keys().__module__.replace("config", "study"), study.keys().__module__)
        assert study.file("study").__name__ == study.computes_in(spec)[0]
        return
    found: set[str] = set()
    for file in sorted((ROOT / "configs").glob(f"{name}*.yaml")):
        for case in load(str(file)).cases[:1]:
            found |= closed(study, study.computes_in(case.spec))
    assert closed(study, ()) - ASSEMBLED <= found


def closed(study, roots):
    parts = [(type(study).__module__, type(study).__qualname__, identity.SHOWS)]
    return set(sources.closure(roots, lambda module: identity.follows(module, {"radarsim"}), parts).hashes)


GATE = """
from radarsim.app.configs import load
from radarsim.studies.identity import identity
print(identity(load("sonar_clutter").cases[0]), identity(load("rls2").cases[0]))
"""


def test_the_program_itself_sees_it(tmp_path):
    """Not by way of this file's tools: two programs, of which one has another gate."""
    folder = tmp_path / "radarsim"
    shutil.copytree(ROOT / "radarsim", folder, ignore=shutil.ignore_patterns("__pycache__"))
    environment = os.environ | {"PYTHONPATH": str(tmp_path), "RADARSIM_CACHE_DIR": str(tmp_path / "cache")}

    def printed():
        done = subprocess.run(
            [sys.executable, "-c", GATE], env=environment, cwd=tmp_path, capture_output=True, check=True
        )
        return done.stdout.split()

    before = printed()
    path = folder / "studies" / "sonar" / "clutter" / "config.py"
    path.write_text(path.read_text().replace('"gate_probability": 0.99', '"gate_probability": 0.90'))
    after = printed()
    assert before[0] != after[0]
    assert before[1] == after[1]
