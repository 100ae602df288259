"""Filters of the user's own code in the config of any study with plots: `{name: mine, python: my_filter.py:Mine}`."""

import contextlib
import json
import os
import pickle
import py_compile
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import yaml

import radarsim
from radarsim.api.case_work import CaseWork
from radarsim.api.configs import load, schema_json
from radarsim.config import yaml_io
from radarsim.config.error_list import ErrorList
from radarsim.errors import ConfigError
from tests.program import command, csv_bytes, record
from tests.tolerances import assert_rounded

ROOT = Path(__file__).parents[2]
N = 9000  # two whole blocks and a partial one
FILTER = '''
"""A filter of mine."""
import numpy as np
import helper

class Mine:
    """Alpha and beta."""
    def __init__(self, alpha=0.5, weights=None):
        self.alpha, self.beta = alpha, np.loadtxt(weights) if weights else helper.BETA

    def start(self, world):
        self.x = None

    def step(self, plots):
        z = plots["range_m"]
        if self.x is None:
            self.x, self.v = z, 0 * z - 250.0
        else:
            dt = plots.t_s - self.t
            r = z - (self.x + self.v * dt)  # what is new
            self.x, self.v = self.x + self.v * dt + self.alpha * r, self.v + self.beta * r / dt
        self.t = plots.t_s
        return np.stack([self.x, self.v], axis=1)

def everything(plots, alpha=None):
    return plots["range_m"][:, :, None]

def single(plots):
    assert plots["range_m"].ndim == 1
    return plots["range_m"][:, None]
'''
MINE = {"name": "mine", "python": "my_filter.py:Mine", "alpha": 0.6}


@pytest.fixture
def place(tmp_path, monkeypatch):
    """A folder with the filter and a config, in which one works."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RADARSIM_NO_CODE", "")  # what a test sets is taken back
    Path("my_filter.py").write_text(FILTER)
    Path("helper.py").write_text("BETA = 0.3\n")
    written("mine", MINE)
    return tmp_path


def written(stem, *further, like="rls2", **keys):
    """A config as a shipped one, with further filters: its file."""
    config = shipped(like) | {"realisations": N, **keys}
    config["filters"] = [*config["filters"], *further]
    Path(f"{stem}.yaml").write_text(yaml.safe_dump(config, sort_keys=False))
    return Path(f"{stem}.yaml")


def shipped(stem):
    return yaml_io.read_document(ROOT / f"configs/{stem}.yaml", ErrorList()).data


def identity(config="mine.yaml", *overrides):
    (case,) = load(config, overrides).cases
    return CaseWork(case).identity


def run(out, *options, config="mine.yaml", code=0):
    return command("run", config, "--no-figures", "--out", out, *options, code=code)


def rows(out, table, name):
    lines = (Path(out) / "mine" / f"{table}.csv").read_text().splitlines()
    return [line.partition(",")[2].rstrip(",") for line in lines if line.split(",")[1] == name]


def test_it_stands_in_every_table_and_the_others_are_what_they_are_without_it(place):
    made = run("with", "--json")
    assert made.stderr.startswith("note: runs code of yours: Mine in ")
    assert len([line for line in made.stderr.splitlines() if "code of yours" in line]) == 1
    (place / "plain").mkdir()
    written("plain/mine")
    run("without", config="plain/mine.yaml")
    for table in ("steady", "curves"):
        for name in ("r", "r+Vr"):
            assert rows("with", table, name) == rows("without", table, name) != []
    assert rows("with", "gains", "r+Vr") == rows("without", "gains", "r+Vr")
    assert {line.split(",")[1] for line in rows("with", "gains", "mine")} == {"r", "r+Vr"}
    assert record(place / "with/mine")["resolved"]["cases"][0]["filters"][2] == MINE
    assert not list(place.glob("**/__pycache__"))


@pytest.mark.slow
def test_any_means_of_computing_gives_the_same_bytes(place):
    whole = run("whole", "--threads", 1), csv_bytes(place / "whole/mine")
    run("threads", "--threads", 3)
    run("none", "--threads", 0)
    run("later", "-n", 5000)
    run("later", "-n", N)
    for share in ("1/2", "2/2"):
        run("shares", "--shard", share)
    run("shares")
    assert record(place / "shares/mine")["realisations_computed"] == 0
    assert record(place / "later/mine")["realisations_computed"] == N - 4096  # the partial block is made again
    for out in ("threads", "none", "later", "shares"):
        assert csv_bytes(place / out / "mine") == whole[1], out


@pytest.mark.slow
def test_workers_give_the_same_bytes(place):
    run("whole", "--threads", 1)
    run("workers", "--workers", 2)
    assert csv_bytes(place / "workers/mine") == csv_bytes(place / "whole/mine")


def test_its_identity_is_what_its_numbers_depend_on(place):
    before = identity()
    for same in (FILTER.replace("# what is new", "# the innovation"), FILTER.replace('"""A filter of mine."""', "")):
        Path("my_filter.py").write_text(same)
        assert identity() == before
    Path("my_filter.py").write_text(FILTER)
    written("mine", MINE | {"name": "other"})
    assert identity() == before
    others = {identity("mine.yaml", "filters.other.alpha=0.7"), identity("mine.yaml", "filters.2.one_by_one=true")}
    others.add(identity("mine.yaml", "filters.other.python=my_filter.py:everything"))
    Path("my_filter.py").write_text(FILTER.replace("- 250.0", "- 251.0"))
    others.add(identity())
    Path("my_filter.py").write_text(FILTER)
    Path("helper.py").write_text("BETA = 0.31\n")
    others.add(identity())
    Path("helper.py").write_text("try:\n    import deeper\nexcept ImportError:\n    pass\nBETA = 0.3\n")
    others.add(identity())
    Path("deeper.py").write_text("ONE = 1\n")
    others.add(identity())
    Path("helper.py").write_text("BETA = 0.3\n")
    Path("my_filter.py").write_text(FILTER + "\nTABLE = 'table.csv'\n")
    others.add(identity())
    Path("table.csv").write_text("1")
    others.add(identity())
    Path("table.csv").write_text("2")
    others.add(identity())
    assert len(others - {before}) == 10


def test_a_file_among_its_keys_is_given_as_a_path_and_counts_by_its_content(place):
    named = set()
    for beta in (0.3, 0.4):
        Path("b.txt").write_text(str(beta))
        written("mine", MINE | {"weights": "b.txt"})
        found = radarsim.run("mine.yaml", realisations=500), identity()
        Path("helper.py").write_text(f"BETA = {beta}\n")
        written("mine", MINE)
        plain = radarsim.run("mine.yaml", realisations=500), identity()
        assert found[0].curves.equals(plain[0].curves)
        named |= {found[1], plain[1]}
    assert len(named) == 4
    assert record_of(found[0])["weights"] == "b.txt"


READING = """import ctypes, glob, importlib.resources, importlib.util, json, os, pickle, runpy, sqlite3, threading
from pathlib import Path
import numpy as np
HERE = Path(__file__).parent
class Mine:
    def __init__(self, **keys):
        self.keys = keys
        {reading}
    def start(self, world):
        pass
    def step(self, plots):
        return plots["range_m"][:, None]
"""
BY_PATH = "spec = importlib.util.spec_from_file_location('part', HERE / 'part.' 'py'); "
DATABASE = "sqlite3.connect(str(HERE / ('base.' + 'db'))).execute('select * from t').fetchall()"
READINGS = {  # how a filter reads: the file that it reads, of which no text in it is the name
    "open(HERE / f'{len(HERE.parts) * 0}.txt').read()": "0.txt",
    "open('sub/' + 'w.npz', 'rb').read(); open('other/' + 'w.npz', 'rb').read()": "other/w.npz",
    "np.load(HERE.joinpath('sub', 'w' '.npz'))": "sub/w.npz",
    "np.fromfile(HERE / ('raw.' + 'bin'))": "raw.bin",
    "np.memmap(HERE / ('raw.' + 'bin'))": "raw.bin",
    "pickle.load(os.fdopen(os.open(str(HERE / ('p.' + 'pkl')), os.O_RDONLY), 'rb'))": "p.pkl",
    "[open(json.load(open(HERE / ('list.' + 'json')))[0]).read()]": "0.txt",
    "[open(path).read() for path in glob.glob('sub/*.t*')]": "sub/a.txt",
    "[path.read_bytes() for path in (HERE / 'sub').iterdir()]": "sub/a.txt",
    "[os.listdir('sub')]": "sub/new",
    "runpy.run_path('part' + '.py')": "part.py",
    BY_PATH + "spec.loader.exec_module(importlib.util.module_from_spec(spec))": "part.py",
    "exec(open('part' + '.py').read())": "part.py",
    "importlib.import_module('pa' + 'rt')": "part.py",
    "importlib.import_module('sub.' + 'inner')": "sub/inner.py",
    "importlib.resources.files('pack' + 'age').joinpath('d' + '.txt').read_text()": "package/d.txt",
    DATABASE: "base.db",
    "t = threading.Thread(target=lambda: open('0' + '.txt').read()); t.start(); t.join()": "0.txt",
    "os.path.exists('late' + '.txt') and open('late' + '.txt').read()": "late.txt",
}


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning", "ignore::ResourceWarning")
@pytest.mark.parametrize("reading", READINGS)
def test_whatever_it_reads_counts(place, reading):
    for folder in ("sub", "other", "package"):
        Path(folder).mkdir()
    for name in ("0.txt", "sub/a.txt", "package/d.txt", "package/__init__.py", "raw.bin"):
        Path(name).write_text("01234567" if name.endswith("bin") else "")
    for name in ("sub/w.npz", "other/w.npz"):
        np.savez(name, w=[1.0])
    Path("p.pkl").write_bytes(pickle.dumps(1) + b"        ")
    Path("list.json").write_text('["0.txt"]')
    for name in ("part.py", "sub/inner.py"):
        Path(name).write_text("BETA = 0.3  # of mine\n")
    with contextlib.closing(sqlite3.connect("base.db")) as base:
        base.execute("create table t (x)")
    Path("my_filter.py").write_text(READING.replace("{reading}", reading))
    written("mine", MINE)
    before, file = identity(), Path(READINGS[reading])
    if file.suffix == ".py" and "exec(" not in reading:
        file.write_text("BETA = 0.3\n")  # without the comment
    assert identity() == before
    content = file.read_bytes() if file.exists() else None
    file.write_bytes(b"BETA = 0.4\n" if file.suffix == ".py" else (content or b"")[:-1] + b"8")
    if file.suffix in (".npz", ".db"):
        file.write_bytes((content or b"") + b"\0")
    assert identity() != before
    if content is None:
        file.unlink()
    else:
        file.write_bytes(content)
    assert identity() == before


def reading_filter(start="pass", step="pass", **keys):
    """A filter of raw plots that runs a line at the start of each batch, and one in each step."""
    source = READING.replace("{reading}", "pass").replace(
        "        pass\n    def step", f"        {start}\n    def step"
    )
    Path("my_filter.py").write_text(source.replace("        return plots", f"        {step}\n        return plots"))
    return written("mine", {"name": "mine", "python": "my_filter.py:Mine", **keys}, scans=4)


def test_files_of_one_name_in_two_folders_are_two(place):
    reading_filter("'a/t.csv', 'b/t.csv'")
    found = set()
    for content in ("12", "34", "13", "24"):
        for folder, text in zip("ab", content, strict=True):
            Path(folder).mkdir(exist_ok=True)
            Path(folder, "t.csv").write_text(text)
        found.add(identity())
    assert len(found) == 4


def test_files_in_lists_mappings_and_folders_of_keys_count_and_are_paths(place):
    Path("nets/deep").mkdir(parents=True)
    files = [Path(name) for name in ("a.npz", "b.npz", "c.npz", "nets/deep/d.npz")]
    for file in files:
        file.write_text("1")
    nets = {"first": ["a.npz", {"second": ["b.npz", 0.5, "no.npz"]}], "third": "c.npz", "all": "nets/", "as": "nets"}
    reading_filter("Path('seen').write_text(repr(self.keys))", nets=nets)
    found = {identity()}
    for file in files:
        file.write_text("2")
        found.add(identity())
    assert len(found) == 5
    a, b, c, _ = (str(place / file) for file in files)
    seen = {"first": [a, {"second": [b, 0.5, "no.npz"]}], "third": c, "all": str(place / "nets"), "as": "nets"}
    assert Path("seen").read_text() == repr({"nets": seen})


def test_a_library_in_c_counts(place):
    library = next(Path(os.__file__).with_name("lib-dynload").glob("*.so")).read_bytes()
    reading_filter("ctypes.CDLL('./' + 'lib' + '.so')")
    Path("lib.so").write_bytes(library)
    before = identity()
    Path("lib.so").unlink()
    Path("lib.so").write_bytes(library + b" ")
    assert identity() != before


def test_a_file_that_it_first_reads_in_a_later_batch_ends_the_run_with_the_cure(place):
    Path("late.txt").write_text("1")
    late = "plots.first >= 4096 and Path('late' + '.txt').read_text()"
    reading_filter(step=late)
    said = run("out", code=2).stderr
    assert (
        f"filter mine, my_filter.py:Mine, reads {place / 'late.txt'} in realisations 4096:8192 of mine, but not" in said
    )
    assert "name it by a text in" in said
    before = identity()
    reading_filter(step=late, identity="1 of late.txt")
    run("out", "--replace")
    assert identity() != before
    reading_filter(step=late, nets=["late.txt"])
    run("out", "--replace")
    assert "identity" not in record(place / "out/mine")["resolved"]["cases"][0]["filters"][2]
    Path("late.txt").write_text("2")
    run("out")
    assert record(place / "out/mine")["realisations_computed"] == N


def test_what_it_reads_may_not_change_under_a_run(place):
    Path("w.txt").write_text("1")
    reading_filter("Path('w' + '.txt').read_text()")
    work = CaseWork(load("mine.yaml").cases[0])
    there = pickle.dumps(work)
    work.simulate(0, 20)
    Path("w.txt").write_text("2")
    with pytest.raises(ConfigError, match=r"w\.txt has changed since the run began"):
        work.simulate(20, 20)
    assert pickle.loads(there).identity != work.identity  # where other files are, a worker finds another identity


def test_a_case_depends_on_what_it_reads_whatever_ran_before(place):
    """Code is imported once for all cases, and anew where it may remember what it has read for another case."""
    Path("w.txt").write_text("1")
    remember = "remembered = functools.cache(lambda name: Path(name + '.txt').read_text())\n"
    count = "os.write(file := os.open('imports', os.O_APPEND | os.O_CREAT | os.O_WRONLY), b'1'); os.close(file)\n"
    for opening, imports in (("Path('w' + '.txt').read_text()", "1"), ("remembered('w')", "11")):
        reading_filter(opening)
        source = Path("my_filter.py").read_text()
        Path("imports").write_text("")
        Path("my_filter.py").write_text(source.replace("HERE =", f"import functools\n{remember}{count}HERE ="))
        both = [CaseWork(case).identity for case in load("mine.yaml", ["sweep={scans: [4, 5]}"]).cases]
        assert Path("imports").read_text() == imports
        Path("imports").write_text("")
        alone = [CaseWork(load("mine.yaml", [f"sweep={{scans: [{n}]}}"]).cases[0]).identity for n in (5, 4)]
        assert alone[::-1] == both
        Path("w.txt").write_text(f"{imports} more")
        edited = [CaseWork(case).identity for case in load("mine.yaml", ["sweep={scans: [4, 5]}"]).cases]
        assert not set(edited) & set(both)


def test_a_package_that_is_installed_to_be_edited_counts(place, monkeypatch, tmp_path_factory):
    package = tmp_path_factory.mktemp("source") / "mylib"
    package.mkdir()
    monkeypatch.syspath_prepend(str(package.parent))
    Path(package, "data.txt").write_text("1")
    Path("my_filter.py").write_text(FILTER.replace("import helper", "from mylib import helper"))
    Path(package, "__init__.py").write_text("")
    found = set()
    for beta in (0.3, 0.4):
        Path(package, "helper.py").write_text(
            f"from pathlib import Path\nPath(__file__).with_name('da' + 'ta.txt').read_text()\nBETA = {beta}\n"
        )
        found.add(identity())
    Path(package, "data.txt").write_text("2")
    found.add(identity())
    assert len(found) == 3


@pytest.mark.slow
def test_what_it_writes_is_nothing_that_it_depends_on(place):
    write = "os.write(log := os.open('log.txt', os.O_APPEND | os.O_CREAT | os.O_WRONLY), b'a line'); os.close(log)"
    write += "; Path('scratch').write_text('1'); Path('scratch').read_text(); list(HERE.glob('*.c*'))"
    config = reading_filter(write)
    computed = [radarsim.run(str(config), realisations=50, out="out", figures=False) for _ in range(3)]
    assert [one.facts["realisations_computed"] for one in computed] == [50, 0, 0]
    assert not any("stored blocks" in line for one in computed for line in one.warnings)
    Path("state").write_text("1")
    config = reading_filter("Path('state').write_text(Path('state').read_text() + '1')")
    computed = [radarsim.run(str(config), realisations=50, out="out", figures=False) for _ in range(2)]
    assert [one.facts["realisations_computed"] for one in computed] == [50, 0]
    for one in computed:
        assert any(f"takes from files that it also writes ({place / 'state'})" in line for line in one.warnings)


def test_what_no_file_shows_is_named_once_and_may_be_declared(place, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "w.txt"
    elsewhere.write_text("1")
    line = f"Path({str(elsewhere)!r}).read_text(); __import__('subprocess').run(['true'])"
    line += "; s = __import__('socket').socket(type=2); s.connect(('127.0.0.1', 9)); s.close()"
    line += "; Path('__pycache__/my_filter.f-1.py311.nbi').read_text()"
    Path("__pycache__").mkdir()
    Path("__pycache__/my_filter.f-1.py311.nbi").write_text("")
    config = str(reading_filter(line))
    told = [one for one in radarsim.run(config, realisations=50).warnings if "stored blocks" in one]
    places = f"files outside its folders ({elsewhere}), the network (127.0.0.1:9), processes that it starts and "
    places += "machine code kept by Numba, which outlives edits of other files"
    assert told == [f"mine: stored blocks do not notice changes of what the filter takes from {places}; when they "
                    "change, change its key `identity`"]  # fmt: skip
    found = set()
    for declared in (1, 2, "of May"):
        reading_filter(line, identity=declared)
        assert not [one for one in radarsim.run(config, realisations=50).warnings if "stored blocks" in one]
        found.add(identity())
    assert len(found) == 3


def record_of(result):
    return result.experiment.resolved["cases"][0]["filters"][2]


EDITED = {  # the import of a module with the number, its file, what the file holds
    "import helper": ("helper.py", "BETA = {}"),
    "from sub import helper": ("sub/helper.py", "BETA = {}"),
    "import importlib; helper = importlib.import_module('sub.' + 'helper')": ("sub/helper.py", "BETA = {}"),
    "import pathlib\nclass helper: BETA = float(pathlib.Path('beta' + '.txt').read_text())": ("beta.txt", "{}"),
}


@pytest.mark.slow_cases("from sub import helper", "import importlib*")
@pytest.mark.parametrize("imports", EDITED)
def test_an_edit_counts_at_once_and_an_edit_undone_finds_its_blocks(place, imports):
    name, content = EDITED[imports]
    Path("sub").mkdir()
    Path("my_filter.py").write_text(FILTER.replace("import helper", imports))
    made = []
    for beta in (0.3, 0.4, 0.3):
        Path(name).write_text(content.format(beta))
        made.append(radarsim.run("mine.yaml", realisations=500, out="out", figures=False))
    assert [one.facts["realisations_computed"] for one in made] == [500, 500, 0]
    sigma = [one.curves.query("filter == 'mine' and component == 'r'")["sigma"].iloc[-1] for one in made[:2]]
    assert sigma[0] != sigma[1]
    assert made[2].curves.equals(made[0].curves)


def test_blocks_from_before_an_edit_are_named_and_clean_runs_it_only_to_tell_them_apart(place):
    run("out", "-n", "500")
    Path("helper.py").write_text("BETA = 0.4\n")
    lack = "mine: 500 realisations are not stored in out; those there are of other sources, as before an edit"
    assert lack in command("report", "mine.yaml", "--out", "out", code=2).stderr
    assert "`radarsim clean CONFIG --other-sources` removes them" in run("out", "-n", "500").stderr
    unnamed = command("clean", "--other-sources", "--out", "out").stdout
    assert "dropped 0 files" in unnamed
    assert "blocks of mine are left" in unnamed
    assert "dropped 2 files in 1 folder" in command("clean", "mine.yaml", "--other-sources", "--out", "out").stdout
    Path("helper.py").write_text("raise OSError('not here')\n")
    assert "not here" in command("clean", "mine.yaml", "--other-sources", "--out", "out", code=2).stderr
    assert "dropped 2 files in 1 folder" in command("clean", "mine.yaml", "--out", "out").stdout


def test_a_module_that_it_imports_from_elsewhere_counts(place, tmp_path_factory):
    folder = tmp_path_factory.mktemp("elsewhere")
    text = f"import sys\nsys.path.insert(0, {str(folder)!r})\nimport tools_elsewhere as helper"
    Path("my_filter.py").write_text(FILTER.replace("import helper", text))
    found = []
    for beta in (0.3, 0.4, 0.3):
        (folder / "tools_elsewhere.py").write_text(f"BETA = {beta}\n")
        found.append(identity())
    assert found[0] == found[2] != found[1]


def test_results_in_a_folder_of_its_keys_do_not_count(place):
    reading_filter(nets="./")
    before = identity()
    Path("out/.blocks").mkdir(parents=True)
    Path("out/report.html").write_text("")
    assert identity() == before
    Path("nets.npz").write_text("")
    assert identity() != before


def test_one_that_leaves_the_working_directory_is_refused(place):
    """Results would be written to where it went."""
    Path("sub").mkdir()
    reading_filter("os.chdir(HERE / 'sub'); os.chdir(HERE)")
    assert identity()
    for start in ("os.chdir(HERE / 'sub')", "os.chdir('/')"):
        reading_filter(start)
        said = run("out", code=2).stderr
        assert "filter mine, my_filter.py:Mine, fails in realisations 0:16 of mine" in said
        assert "it changed the working directory to /" in said
    assert not list(place.rglob(".blocks"))


def test_bytecode_of_another_text_ends_a_run(place):
    """Python takes it for that of the text where size and second are the same."""
    source = Path("helper.py")
    py_compile.compile("helper.py")
    time = source.stat().st_mtime
    source.write_text("BETA = 0.4\n")
    os.utime(source, (time, time))
    with pytest.raises(ConfigError, match=r"helper\.py: Python runs bytecode of another text: delete .*\.pyc"):
        identity()
    shutil.rmtree("__pycache__")
    assert identity()


def test_what_changes_between_reading_and_running_is_noticed(place):
    experiment = load("mine.yaml")
    Path("my_filter.py").write_text(FILTER.replace("- 250.0", "- 260.0"))
    with pytest.raises(ConfigError, match=r"my_filter\.py is not what it was when the config was read"):
        radarsim.run(experiment, realisations=500)


FAILING = """import numpy as np
import helper
class Mine:
    def start(self, world):
        pass
    def step(self, plots):
        if plots.first >= 4096:
            {line}
        return plots["range_m"][:, None]
    def deep(self):
        self.deep()
"""
FAILURES = {  # a line of the filter: the frame that is shown last, and what is said
    "z = plots['range']": (
        "my_filter.py:8, in step: z = plots['range']",
        "KeyError: 'range: plots have range_m, velocity_mps'",
    ),
    "import sys; sys.exit('no licence')": ("my_filter.py:8, in step: import sys;", "SystemExit: no licence"),
    "helper.broken(plots)": ("helper.py:3, in broken: np.linalg.inv(plots['range_m'])", "LinAlgError: 1-dimensional"),
    "self.deep()": ("my_filter.py:11, in deep: self.deep()", "RecursionError: maximum recursion depth"),
    "raise GeneratorExit": ("my_filter.py:8, in step: raise GeneratorExit", "GeneratorExit"),
    "raise type('Odd', (Exception,), {'__str__': lambda self: 1 / 0})": (
        "in step: raise type('Odd'",
        "Odd: its __str__ fails",
    ),
    "raise ValueError": ("my_filter.py:8, in step: raise ValueError", "ValueError"),
}


@pytest.mark.parametrize("line", FAILURES)
def test_its_errors_are_its_own_traceback(place, line):
    written("mine", {"name": "mine", "python": "my_filter.py:Mine"})
    Path("helper.py").write_text("import numpy as np\ndef broken(plots):\n    np.linalg.inv(plots['range_m'])\n")
    Path("my_filter.py").write_text(FAILING.format(line=line))
    _, where, *frames, said = run("out", "--threads", 2, code=2).stderr.splitlines()
    assert where.startswith("mine.yaml:")
    assert where.endswith(": filter mine, my_filter.py:Mine, fails in realisations 4096:8192 of mine:")
    assert FAILURES[line][0] in frames[-1]
    assert said.startswith(FAILURES[line][1])
    assert 1 <= len(frames) <= 8
    assert all(frame.startswith(f"  {place}") for frame in frames)
    with pytest.raises(ConfigError, match="fails in realisations 4096:8192 of mine:"):
        radarsim.run("mine.yaml", threads=0)


def test_what_it_lacks_is_named_with_its_place_in_the_config(place):
    Path("my_filter.py").write_text(FILTER.replace("def start", "def begin"))
    (line,) = command("report", "mine.yaml", "--out", "out", code=2).stderr.splitlines()
    words = "mine: a filter that is asked scan by scan must have start(world) and step(plots)"
    assert line == f"mine.yaml:21:11: {words}"


LOADING = {  # what stands in the config and in the module: what is said
    (
        "my_filter.py:Mine",
        "import no_such_thing",
    ): "cannot be imported:\n  {place}/my_filter.py:1, in <module>: import no_",
    (
        "my_filter.py:Mine",
        "import sys\nsys.exit()",
    ): "cannot be imported:\n  {place}/my_filter.py:2, in <module>: sys.ex",
    (
        "my_filter.py:Mine",
        "Mine = 7\ndef other(): pass",
    ): "no class or function Mine in {place}/my_filter.py; it has other",
    ("my_filter.py:Mine", "def Mine(:"): "filters.2.python: {place}/my_filter.py:1: SyntaxError: invalid syntax",
    ("my_filter.py:Mine", "\0"): "filters.2.python: {place}/my_filter.py:1: ",
    ("my_filter.py:Mine", "from .helper import BETA"): "of a package, it is {place.name}.my_filter:Mine",
    ("my_filter.py:Mine", "Mine = None"): "no class or function Mine in {place}/my_filter.py; it has none",
    ("json.py:Mine", "class Mine: pass"): ": {place}/json.py: give it another name: json is /",
    ("no.py:Mine", ""): "filters.2.python: no such file: {place}/no.py",
    (
        "no_such_module:Mine",
        "",
    ): "filters.2.python: no such module, neither beside the config nor installed: no_such_mod",
    ("my_filter.py", ""): "filters.2.python: must be FILE.py:NAME or MODULE:NAME, got 'my_filter.py'",
    (7, ""): "filters.2.python: must be text, got 7",
}


@pytest.mark.parametrize(("python", "source"), LOADING)
def test_what_cannot_be_loaded_is_said_before_anything_runs(place, python, source):
    Path("json.py" if python == "json.py:Mine" else "my_filter.py").write_text(source)
    written("mine", {"name": "mine", "python": python})
    said = command("run", "rls2", "mine.yaml", "--out", "out", code=2)
    assert said.stderr.startswith("mine.yaml:")
    assert LOADING[python, source].format(place=place) in said.stderr
    assert said.stdout == ""
    assert not Path("out").exists()


def test_where_it_may_stand_and_what_it_is_called_is_checked(place):
    text = Path("mine.yaml").read_text()
    config = yaml.safe_load(text)
    for members, said in (
        (
            config["filters"][2:],
            "filters.0.python: must stand after filters of the study itself, and beside at least one",
        ),
        (config["filters"][::-1], "filters.0.python: must stand after filters of the study itself"),
        ([*config["filters"], MINE], "filters.3.name: names must differ, and this is there twice"),
        ([*config["filters"][:2], {**MINE, "name": "r"}], "filters.2.name: names must differ, and this is there twice"),
        ([*config["filters"][:2], {"python": "my_filter.py:Mine"}], "filters.2.name: required key is missing"),
        ([*config["filters"][:2], {**MINE, "name": "=1"}], "filters.2.name: must not begin with = + - or @"),
        ([{**config["filters"][0], "alpha": 1}, MINE], "filters.0.alpha: unknown key"),
    ):
        Path("mine.yaml").write_text(yaml.safe_dump(config | {"filters": members}, sort_keys=False))
        stderr = command("check", "mine.yaml", code=2).stderr
        assert said in stderr
        assert stderr.startswith("mine.yaml:")
    Path("mine.yaml").write_text(text)
    unknown = run("out", "--set", "filters.mine.gamma=1", code=2).stderr
    assert unknown.endswith("TypeError: Mine.__init__() got an unexpected keyword argument 'gamma'\n")
    nobody = run("out", "--set", "baseline=nobody", code=2).stderr
    assert nobody == "--set baseline: must be the name of a filter: r, r+Vr, mine, got 'nobody'\n"


def test_gains_are_against_it_where_it_is_a_baseline(place):
    made = radarsim.run("mine.yaml", realisations=2000, overrides=["baseline=[r, mine]"])
    gains = made.gains.set_index(["filter", "baseline", "component", "k"])["gain_percent"]
    mine, back = gains["mine", "r", "r", 9], gains["r", "mine", "r", 9]
    assert_rounded((1 - mine / 100) * (1 - back / 100), 1, operations=10)
    assert {base for _, base, *_ in gains.index} == {"r", "r+Vr", "mine"}
    assert made.experiment.cases[0].keys["baseline"] == ["r", "mine"]
    plain = radarsim.run("mine.yaml", realisations=2000, overrides=["baseline=mine"])
    assert plain.experiment.cases[0].spec.baseline is None
    assert plain.answer == made.answer


def test_no_code_refuses_it_and_runs_none(place):
    Path("my_filter.py").write_text("open('ran', 'w')\n" + FILTER)
    refused = "filters.2.python: is code of yours, and --no-code runs none, got 'my_filter.py:Mine'\n"
    for words in (("run", "mine.yaml"), ("check", "mine.yaml"), ("report", "mine.yaml")):
        assert command(*words, "--no-code", code=2).stderr.endswith(refused)
        os.environ["RADARSIM_NO_CODE"] = ""
    command("run", "rls2", "-n", 200, "--no-figures", "--no-code", "--out", "out")
    os.environ["RADARSIM_NO_CODE"] = "1"
    with pytest.raises(ConfigError, match="is code of yours"):
        radarsim.run("mine.yaml")
    assert not Path("ran").exists()


def test_what_it_prints_is_not_in_the_answer(place):
    Path("my_filter.py").write_text("print('read')\n" + FILTER.replace("dt = ", "print('a step'); dt = "))
    done = run("out", "-n", 100, "--json")
    assert json.loads(done.stdout)[0]["config"] == "mine"
    assert {"read", "a step"} <= set(done.stderr.splitlines())


@pytest.mark.slow
def test_one_may_have_processes_of_its_own(place):
    """Their end by a signal is not that of the run."""
    pool = "with multiprocessing.get_context('fork').Pool(1) as pool: pool.map(abs, [1])"
    source = FILTER.replace("import helper", "import helper, multiprocessing")
    Path("my_filter.py").write_text(source.replace('z = plots["range_m"]', f'z = plots["range_m"]\n        {pool}'))
    words = [sys.executable, "-m", "radarsim", "run", "mine.yaml", "-n", "300", "--set", "scans=4", "--no-figures"]
    assert subprocess.run(words, env=os.environ | {"PYTHONPATH": str(ROOT)}, timeout=60).returncode == 0


@pytest.mark.slow
def test_one_that_never_returns_is_stopped_by_a_signal(place):
    Path("my_filter.py").write_text(
        FILTER.replace("dt = ", "open('there', 'w')\n            while True: pass\n            dt = ")
    )
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    words = [sys.executable, "-m", "radarsim", "run", "mine.yaml", "--out", "out"]
    process = subprocess.Popen(words, env=environment, stderr=subprocess.PIPE, text=True)
    while not Path("there").exists():
        assert process.poll() is None
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=20)
    assert process.returncode == 130
    assert "stopped by Ctrl-C" in said


def test_its_keys_are_set_swept_and_included_by_its_name(place):
    swept = load("mine.yaml", ["sweep={filters.mine.alpha: [0.5, 0.6]}", "scans=8"])
    assert [case.name for case in swept.cases] == ["mine filters.mine.alpha=0.5", "mine filters.mine.alpha=0.6"]
    result = radarsim.run(swept, realisations=300)
    own, plain = result.curves["filter"] == "mine", result.curves["filter"] == "r"
    for which, same in ((own, False), (plain, True)):
        halves = [one["sigma"].to_numpy() for _, one in result.curves[which & (result.curves["k"] > 2)].groupby("case")]
        assert (halves[0] == halves[1]).all() == same
    (bare,) = load("mine.yaml", ["alpha=0.5", "filters.r.manoeuvre_variance=1e-4"]).cases
    assert bare.keys["filters"][2]["alpha"] == 0.5
    assert [one["manoeuvre_variance"] for one in bare.keys["filters"][:2]] == [1e-4, 1e-3]
    Path("sub").mkdir()
    Path("sub/all.yaml").write_text(
        "include: [rls2]\nfilters:\n  - {name: r, observes: [range], manoeuvre_variance: 1e-3}\n"
        "  - {name: mine, python: ../my_filter.py:Mine}\n"
    )
    (case,) = load("sub/all.yaml").cases
    assert case.user_filters[0].file == str(place / "my_filter.py")
    Path("both.yaml").write_text("include: [mine, rls1]\n")
    assert [len(case.user_filters) for case in load("both.yaml").cases] == [1, 0]
    assert load(swept.resolved["cases"][0] | {"study": "range_doppler"} and json.loads(json.dumps(keys_of(swept))))
    (carried,) = load(
        "mine.yaml",
        [
            "study=ambiguous_doppler",
            "radar.repetition_rate_hz=1000",
            "prior={sigma_velocity_mps: 100, sigma_acceleration_mps2: 5}",
        ],
    ).cases
    assert [one.name for one in carried.user_filters] == ["mine"]


def keys_of(experiment):
    keys = dict(experiment.resolved["cases"][0])
    return {"study": experiment.study} | {key: one for key, one in keys.items() if key not in ("case", "swept")}


def test_the_keys_without_it_are_those_of_a_plain_config(place):
    (case,), (plain,) = load("mine.yaml").cases, load(str(written("plain"))).cases
    assert case.spec == plain.spec
    assert type(case.spec) is type(plain.spec)


def test_a_function_takes_all_plots_or_those_of_one_realisation(place):
    made = []
    for name, keys in (("everything", {}), ("single", {"one_by_one": True})):
        written("mine", {"name": "mine", "python": f"my_filter.py:{name}", **keys})
        made.append(radarsim.run("mine.yaml", realisations=300).curves)
    assert made[0].equals(made[1])
    sigma = made[0].query("filter == 'mine'")["sigma"]
    assert (abs(sigma / 250 - 1) < 5 / (2 * 300) ** 0.5).all()


def test_one_that_looks_ahead_or_cannot_be_repeated_is_told(place):
    Path("my_filter.py").write_text(
        "import numpy as np\nrandom = np.random.default_rng(1)\n"
        "def ahead(plots):\n    return np.roll(plots['range_m'], -1, axis=1)[:, :, None]\n"
        "def noisy(plots):\n    z = plots['range_m'][:, :, None]\n    return z + random.normal(size=z.shape)\n"
    )
    for name, said in (
        ("ahead", "mine: uses later plots"),
        ("noisy", "mine: gives other estimates for the same plots"),
    ):
        written("mine", {"name": "mine", "python": f"my_filter.py:{name}"})
        assert any(line.startswith(said) for line in radarsim.run("mine.yaml", realisations=300).warnings)


@pytest.mark.slow
def test_modules_and_packages_are_found_beside_the_config_or_installed(place, monkeypatch):
    package = Path("site-packages/own_package")
    package.mkdir(parents=True)
    Path(package, "__init__.py").write_text("")
    Path(package, "parts.py").write_text("BETA = 0.3\n")
    Path(package, "deep.py").write_text(FILTER.replace("import helper", "from . import parts as helper"))
    monkeypatch.syspath_prepend(str(place / "site-packages"))
    want = radarsim.run("mine.yaml", realisations=300).curves
    for python in ("my_filter:Mine", "own_package.deep:Mine", "site-packages/own_package/../../my_filter.py:Mine"):
        written("mine", {"name": "mine", "python": python, "alpha": 0.6})
        assert radarsim.run("mine.yaml", realisations=300).curves.equals(want)
    written("mine", {"name": "mine", "python": "own_package.deep:Mine", "alpha": 0.6})
    before = identity()
    Path(package, "parts.py").write_text("BETA = 0.4\n")
    assert identity() != before
    assert not radarsim.run("mine.yaml", realisations=300).curves.equals(want)


@pytest.mark.slow_cases("sonar_missed", "multimodel")
@pytest.mark.parametrize("like", ["multimodel", "sonar_missed", "ambiguous_rls2"])
def test_any_study_with_plots_takes_it(place, like):
    Path("my_filter.py").write_text("""
import numpy as np
def zero(plots):
    return np.zeros((plots.n, len(plots.t_s), len(plots.world.components)))
""")
    written("mine", {"name": "mine", "python": "my_filter.py:zero"}, like=like)
    result = radarsim.run("mine.yaml", realisations=20)
    assert set(result.tables["failures"]["filter"]) == {"mine"}


def test_studies_without_plots_refuse_it(place):
    for stem, members in (("discriminator", "estimators"), ("pulses", "filters")):
        config = shipped(stem)
        config[members] = [*config[members], {"name": "mine", "python": "my_filter.py:Mine"}]
        with pytest.raises(ConfigError, match=f"study {config['study']} draws no plots"):
            radarsim.run(config, realisations=10)


def test_the_schema_admits_it(place):
    definitions = json.loads(schema_json())["$defs"]
    assert {"$ref": "#/$defs/UserFilterKeys"} in definitions["range_doppler"]["properties"]["filters"]["items"]["oneOf"]
    own = definitions["UserFilterKeys"]
    assert own["required"] == ["name", "python"]
    assert own["additionalProperties"] is True


OTHER = 4321
MARK = "        __import__('pathlib').Path('executed').touch()\n"
MARKING = FILTER.replace("        self.x = None\n", f"        self.x = None\n{MARK}")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="gives files to another user")
def test_code_of_another_user_does_not_run_by_mistake(place):
    """Of a config that is found by its name, itself or by an include, and of a module that lies beside a config."""
    (place / "configs").mkdir()
    Path("my_filter.py").write_text(MARKING)
    taken = [written("rls2", MINE), written("configs/rls1", MINE), Path("my_filter.py")]
    for file in taken:
        os.chown(file, OTHER, OTHER)
    Path("included.yaml").write_text("include: [rls1]\n")
    Path("around.yaml").write_text("include: [rls2]\n")
    os.chown("around.yaml", OTHER, OTHER)
    for config, file in (
        ("rls2", "rls2.yaml"),
        ("rls1", "configs/rls1.yaml"),
        ("included.yaml", "configs/rls1.yaml"),
        ("around", "rls2.yaml"),
    ):
        refused = run("out", config=config, code=2).stderr
        assert f"{file}: names code and belongs to another user ({OTHER}): to run it, give its path" in refused
    assert "must be code of yours or of the config's owner" in run("out", code=2).stderr
    assert not Path("executed").exists()
    assert "runs code of yours: Mine in" in run("out", config="around.yaml").stderr  # named by its path
    assert Path("executed").exists()


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="gives files to another user")
def test_doctor_runs_no_code_that_a_record_of_another_user_names(place):
    Path("my_filter.py").write_text(MARKING)
    run("out")
    Path("executed").unlink()
    os.chown("out/mine/run.json", OTHER, OTHER)
    refused = command("doctor", "out/mine", "--recompute", "1", code=2).stderr
    assert f"out/mine/run.json: names code and belongs to another user ({OTHER})" in refused
    command("doctor", "out/mine")
    command("compare", "out/mine", "out/mine", "--no-figures", "--out", "compared")
    assert not Path("executed").exists()
    os.chown("out/mine/run.json", os.geteuid(), os.getegid())
    command("doctor", "out/mine", "--recompute", "1")
    assert Path("executed").exists()
