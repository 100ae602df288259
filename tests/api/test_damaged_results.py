"""A damaged folder of a result gets one sentence from all that read it: which file, what is in it, what should be."""

import hashlib
import json
import shutil

import pytest

import radarsim
from radarsim.report import stored_tables
from radarsim.report.index_page import write_index
from tests.program import command


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    out = tmp_path_factory.mktemp("whole")
    return radarsim.run("rls2", realisations=500, out=out, figures=False).written.folder


@pytest.fixture
def folder(whole, tmp_path, monkeypatch):
    """A copy of a result without blocks, in a directory of results."""
    monkeypatch.setattr(stored_tables, "PAUSE_S", 0.0)
    return shutil.copytree(whole, tmp_path / "out" / "rls2")


def compare(folder):
    return command("compare", folder, folder, "--out", folder.parent / "compared", "--no-figures", code=...)


READERS = {
    "load": lambda folder: command("export", folder, "--netcdf", folder.parent / "a.nc", code=...),
    "compare": compare,
    "claims": lambda folder: command("claims", "rls2", "--out", folder.parent, code=...),
    "doctor": lambda folder: command("doctor", folder, code=...),
    "pack": lambda folder: command("pack", folder, "-o", folder.parent / "s.zip", code=...),
    "report": lambda folder: command("report", "rls2", "--out", folder.parent, "--no-figures", code=...),
}


def forge(name, content):
    """A function that puts a table into a folder, with its hash in run.json."""

    def put(folder):
        (folder / name).write_bytes(content)
        record = json.loads((folder / "run.json").read_text())
        record["outputs"][name] = hashlib.sha256(content).hexdigest()
        (folder / "run.json").write_text(json.dumps(record))

    return put


def rewrite(**changes):
    def put(folder):
        record = json.loads((folder / "run.json").read_text()) | changes
        (folder / "run.json").write_text(json.dumps(record))

    return put


def cut(name):
    def put(folder):
        path = folder / name
        path.write_bytes(path.read_bytes()[:-100])

    return put


ALL_READERS = tuple(READERS)
READERS_OF_CURVES = ("load", "compare", "doctor", "pack")
PARSERS_OF_CURVES = ("load", "compare")
RECORD_FAULTS = {
    "a cut record": (cut("run.json"), "run.json: is no record of a run: Unterminated string"),
    "not UTF-8": (lambda folder: (folder / "run.json").write_bytes(b'{"a": "\xff"}'), "run: not UTF-8 at byte 8"),
    "a list": (lambda folder: (folder / "run.json").write_text("[1]"), "run: it must be an object, got [1]"),
    "another JSON": (lambda folder: (folder / "run.json").write_text("{}"), "run: lacks `config`"),
    "odd cases": (rewrite(cases={"rls2": 5}), "run: case rls2 must be an object, got 5"),
    "odd counts": (rewrite(cases={"rls2": {"done": "x"}}), '`done` of case rls2 must be a whole number, got "x"'),
    "an odd table": (rewrite(outputs={"curves.csv": 7}), "`outputs` of curves.csv must be a hash, got 7"),
    "a path outside": (rewrite(outputs={"../a.csv": "0"}), '`outputs` must lie in the folder, got "../a.csv"'),
}
TABLE_FAULTS = {
    "missing": (lambda folder: (folder / "curves.csv").unlink(), READERS_OF_CURVES, "curves.csv: missing"),
    "truncated": (cut("curves.csv"), READERS_OF_CURVES, "curves.csv: altered since it was written: SHA-256"),
    "not UTF-8": (forge("curves.csv", b"case\n\xff\n"), PARSERS_OF_CURVES, "is no table: not UTF-8 at byte 6"),
    "no CSV": (forge("curves.csv", b'case\n"a\n'), PARSERS_OF_CURVES, "is no table: unexpected end of data"),
    "nothing": (forge("curves.csv", b""), PARSERS_OF_CURVES, "is no table: has no names of columns"),
    "ragged": (forge("curves.csv", b"case,k\na\n"), PARSERS_OF_CURVES, "is no table: line 2 has 1 cells"),
    "foreign columns": (
        forge("curves.csv", b"wine,price\nred,3\n"),
        PARSERS_OF_CURVES,
        "curves.csv: is no table of curves: lacks the column case, got wine, price",
    ),
    "words for numbers": (
        forge("curves.csv", b"case,filter,component,k,t_s,sigma,sigma_lo,sigma_hi\nrls2,r,r,1,0,much,1,2\n"),
        PARSERS_OF_CURVES,
        'curves.csv: is no table of curves: column sigma must hold numbers, got "much"',
    ),
    "foreign claims": (
        forge("claims.csv", b"claim,verdict\nP1.1,true\n"),
        ("claims",),
        "claims.csv: is no table of claims: lacks the column paper, got claim, verdict",
    ),
}


def check_fault(reader, folder, words):
    result = READERS[reader](folder)
    assert (result.exit_code, words in result.stderr) == (4, True), result.output
    assert str(folder) in result.stderr
    write_index(folder.parent)  # takes no harm


@pytest.mark.parametrize("reader", ALL_READERS)
@pytest.mark.parametrize("fault", RECORD_FAULTS)
def test_a_damaged_record_has_one_sentence(fault, reader, folder):
    spoil, words = RECORD_FAULTS[fault]
    spoil(folder)
    check_fault(reader, folder, words)


@pytest.mark.parametrize(
    ("fault", "reader"), [(name, reader) for name, (_, readers, _) in TABLE_FAULTS.items() for reader in readers]
)
def test_a_damaged_table_has_one_sentence(fault, reader, folder):
    spoil, _, words = TABLE_FAULTS[fault]
    spoil(folder)
    check_fault(reader, folder, words)


@pytest.mark.parametrize("reader", ["load", "doctor"])
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("empty", "no result: there is no run.json in it"),
        ("nowhere", "no result: there is no such folder"),
        ("study.zip", "no folder of a result; `radarsim check"),
        ("study.zip/results/rls2", "study.zip` verifies an archive"),
        ("a/run.json", "no folder of a result, but a file; its folder is"),
    ],
)
def test_what_is_no_result_is_named(name, words, reader, tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "study.zip").touch()
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "run.json").touch()
    result = READERS[reader](tmp_path / name)
    assert (result.exit_code, words in result.stderr) == (2, True), result.output


def test_a_record_is_no_config(folder):
    words = "run.json: is the record of a result, and no config; its folder is"
    assert words in command("run", folder / "run.json", code=2).stderr


def test_the_numbers_of_a_result_are_of_one_run(folder, monkeypatch):
    """Another run replaces the folder between reading run.json and the tables."""
    other = radarsim.run("rls2", realisations=1000)
    real = stored_tables.find_record

    def find_record(place):
        record = real(place)
        monkeypatch.setattr(stored_tables, "find_record", real)
        other.write(folder.parent, figures=False)
        return record

    monkeypatch.setattr(stored_tables, "find_record", find_record)
    loaded = radarsim.load(folder)
    assert (loaded.cases[0].count, set(loaded.curves["n"])) == (1000, {1000})
    radarsim.run("rls2", realisations=2000).write(folder.parent, figures=False)
    assert set(loaded.gains["case"]) == {"rls2"}
