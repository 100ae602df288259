"""`radarsim doctor` and `radarsim clean`: every damage named, nothing but blocks removed."""

import hashlib
import json
import math
import os
import random
import re
import shutil

import numpy as np
import pytest

from radarsim.api import case_work
from radarsim.api.maintenance import self_test
from radarsim.report import stored_tables
from tests.engine.test_audit import damage
from tests.engine.test_damage import reforged
from tests.program import command, csv_bytes, record


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A finished run of two cases: its --out directory."""
    out = tmp_path_factory.mktemp("results")
    command("run", "rls1", "rls2", "-n", 50_001, "--no-figures", "--quiet", "--out", out)
    return out


@pytest.fixture(autouse=True)
def no_waiting(monkeypatch):
    """Outputs that look altered are looked at again without the pause for a run beside us."""
    monkeypatch.setattr(stored_tables, "PAUSE_S", 0)


@pytest.fixture
def out(made, tmp_path):
    """A copy of it, to be damaged."""
    shutil.copytree(made, tmp_path / "r")
    return tmp_path / "r"


def block_files(out):
    """Every stored block."""
    return sorted((out / ".blocks").rglob("*.sums"))


def contents(out):
    """Every file, by path."""
    return {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}


def test_a_whole_result_is_told_so_and_nothing_is_changed(out):
    before = contents(out)
    result = command("doctor", out / "rls2", "--recompute", 3)
    assert "all intact" in result.stdout
    assert "computed again: 3 pieces" in result.stdout
    found = json.loads(command("doctor", out / "rls2", "--recompute", 99, "--json").stdout)
    assert (found["realisations"], found["faults"], found["notes"]) == (50_001, [], [])
    assert contents(out) == before


def test_a_hundred_of_a_hundred_damaged_files_are_named_and_come_again(out):
    good, draw = contents(out), random.Random(1)
    identity = record(out / "rls2")["identities"]["rls2"]
    outputs = [path for path in (out / "rls2").iterdir() if path.name != "run.json"]
    files = [*(path for path in block_files(out) if identity in str(path)), *outputs]
    from radarsim.api.maintenance.doctor import inspect_result

    for _ in range(100):
        path = draw.choice(files)
        kind = damage(path, draw)
        faults = inspect_result(out / "rls2").faults
        assert [fault.split(":")[0] for fault in faults] == [str(path)], (kind, path, faults)
        path.write_bytes(good[path])
    for path in files:
        # That a block is gone shows by the others, of which none is whole here: blocks are left in their places.
        while damage(path, draw) == "deleted" and path.suffix == ".sums":
            path.write_bytes(good[path])
    result = command("doctor", out / "rls2", code=4)
    assert {line.split(":")[0] for line in result.stderr.splitlines()} == set(map(str, files))
    command("run", "rls2", "-n", 50_001, "--no-figures", "--quiet", "--out", out)
    assert csv_bytes(out / "rls2") == {p.name: good[p] for p in outputs if p.suffix == ".csv"}
    assert "all intact" in command("doctor", out / "rls2").stdout


def test_forged_sums_are_found_by_computing_them_again(out):
    identity = record(out / "rls2")["identities"]["rls2"]
    for total in (out / ".blocks" / identity).glob("T*"):
        total.unlink()
    (cut,) = (out / ".blocks" / identity).glob("P*")
    from radarsim.engine.store.block_file import decode

    reforged(cut, values=decode(cut.read_bytes())[1] * 1.000001)
    result = command("doctor", out / "rls2", "--recompute", 1, code=4)
    assert f"{cut}: computed again, the sums differ" in result.stderr


def rewritten(path, alter):
    """Change the record in a run.json."""
    record = json.loads(path.read_text())
    alter(record)
    path.write_text(json.dumps(record))


NO_RECORD = "run.json: is no record of a run: "
ALTERED_CONFIG = "run.json: damaged: the config in it is not the one that ran"


def nested(levels):
    """Lists in lists: read by json.loads, too deep for json.dumps with an indent."""
    return [nested(levels - 1)] if levels else []


@pytest.mark.parametrize(
    ("spoil", "code", "words"),
    [
        (lambda path: path.unlink(), 2, "no run.json in it"),
        (lambda path: path.write_text("{"), 4, NO_RECORD),
        (lambda path: path.write_text("[]"), 4, NO_RECORD),
        (lambda path: path.write_text("[" * 100_000), 4, NO_RECORD),
        (lambda path: path.write_text(re.sub('"rls2": "[0-9a-f]+"', '"rls2": "../x"', path.read_text())), 4, NO_RECORD),
        (lambda path: path.write_text(path.read_text().replace('"r+Vr"', '"r+vr"')), 4, ALTERED_CONFIG),
        (lambda path: rewritten(path, lambda record: record["resolved"].update(cases=[[[]]])), 4, ALTERED_CONFIG),
        (lambda path: rewritten(path, lambda record: record["resolved"].update(cases=[{}])), 4, ALTERED_CONFIG),
        (lambda path: rewritten(path, lambda record: record["resolved"].update(cases=None)), 4, ALTERED_CONFIG),
        (lambda path: rewritten(path, lambda record: record["resolved"].update(odd="\ud800")), 4, NO_RECORD),
        (lambda path: rewritten(path, lambda record: record["resolved"].update(odd=math.nan)), 4, NO_RECORD),
        (lambda path: rewritten(path, lambda record: record["resolved"].update(odd=nested(400))), 4, ALTERED_CONFIG),
        (
            lambda path: path.write_text(path.read_text().replace('"curves.csv"', '"../../etc"')),
            4,
            "`outputs` must lie in the folder",
        ),
    ],
)
def test_a_spoiled_record_is_told(out, spoil, code, words):
    spoil(out / "rls2" / "run.json")
    assert words in command("doctor", out / "rls2", code=code).stderr


def test_a_record_beyond_reading_is_made_anew_as_told(out):
    whole = contents(out / "rls2").keys()
    (out / "rls2" / "run.json").write_text("[" * 100_000)
    told = command("report", "rls2", "--no-figures", "--out", out, code=4).stderr
    assert "`radarsim run` makes it again, and so does `radarsim report` with -n" in told
    command("report", "rls2", "-n", 50_001, "--no-figures", "--out", out)
    command("run", "rls1", "-n", 50_001, "--no-figures", "--quiet", "--out", out)  # the index reads all records
    assert contents(out / "rls2").keys() == whole
    assert "all intact" in command("doctor", out / "rls2").stdout


def test_what_is_no_file_is_not_waited_for(out):
    identity = record(out / "rls2")["identities"]["rls2"]
    pipe, device = sorted((out / ".blocks" / identity).glob("*.sums"))[:2]
    pipe.unlink()
    os.mkfifo(pipe)
    device.unlink()
    device.symlink_to("/dev/zero")
    told = command("doctor", out / "rls2", code=4).stderr
    assert f"{pipe}: damaged: no regular file" in told
    assert f"{device}: damaged: no regular file" in told
    command("run", "rls2", "-n", 60_001, "--no-figures", "--quiet", "--out", out)


def test_outputs_that_a_run_is_writing_are_looked_at_again(out, monkeypatch):
    path = out / "rls2" / "curves.csv"
    whole = path.read_bytes()
    path.write_bytes(whole + b"\n")
    looks = iter([lambda: None, lambda: path.write_bytes(whole)])
    monkeypatch.setattr(stored_tables.time, "sleep", lambda seconds: next(looks)())
    assert "all intact" in command("doctor", out / "rls2").stdout


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="no user numbers here")
def test_blocks_that_another_user_may_have_written_are_named_by_doctor_and_report(out):
    total = next((out / ".blocks" / record(out / "rls2")["identities"]["rls2"]).glob("T*.sums"))
    total.chmod(0o666)
    assert f"{total}: can be written by every user: not used" in command("doctor", out / "rls2", code=4).stderr
    (out / ".blocks").chmod(0o777)
    (line,) = command("doctor", out / "rls2", code=4).stderr.splitlines()
    assert line == f"{out / '.blocks'}: can be written by every user: blocks in it are not used, and none are kept"
    lack = f"are not stored in {out}; {out / '.blocks'}: can be written by every user"
    assert lack in command("report", "rls2", "--out", out, code=2).stderr


def test_instead_of_blocks_of_other_sources_the_config_is_computed_again(out, monkeypatch):
    monkeypatch.setattr(case_work.CaseWork, "identity", "ab12")
    command("doctor", out / "rls2")
    told = command("doctor", out / "rls2", "--recompute", 1).stdout
    assert "the sources that compute have changed since its blocks were made: computed again from the config" in told
    assert "computed again: rls2 from the config" in told


NO_BLOCKS = "tables agree with their record; nothing could be recomputed: no blocks are stored"


def test_a_copied_folder_says_last_that_nothing_could_be_recomputed(out, tmp_path):
    copy = shutil.copytree(out / "rls2", tmp_path / "copy" / "rls2")
    told = command("doctor", copy, code=3)
    assert told.stderr == f"{NO_BLOCKS}\n"
    assert "intact" not in told.stdout
    found = command("doctor", copy, "--json", code=3)
    assert json.loads(found.stdout)["not_checked"] == ["nothing could be recomputed: no blocks are stored"]
    (copy / "curves.csv").write_text("other")
    assert "altered since it was written" in command("doctor", copy, code=4).stderr


def test_a_copied_folder_is_recomputed_from_its_config(out, tmp_path):
    copy = shutil.copytree(out / "rls2", tmp_path / "copy" / "rls2")
    before = contents(tmp_path)
    told = command("doctor", copy, "--recompute", 1).stdout
    assert "computed again: rls2 from the config: 50,001 of 50,001 realisations (100 %)" in told
    assert told.endswith("all intact\n")
    assert contents(tmp_path) == before


def test_a_forged_table_with_a_right_digest_is_found_by_recomputing(out, tmp_path):
    """By the sums of the blocks, and without blocks by those of the config."""
    path = out / "rls2" / "curves.csv"
    lines = path.read_text().splitlines()
    place = lines[0].split(",").index("sigma")
    cells = lines[9].split(",")
    cells[place] = repr(float(cells[place]) * 1.001)
    path.write_text("\n".join([*lines[:9], ",".join(cells), *lines[10:], ""]))
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    rewritten(out / "rls2" / "run.json", lambda record: record["outputs"].update({"curves.csv": digest}))
    command("doctor", out / "rls2")
    copy = shutil.copytree(out / "rls2", tmp_path / "copy" / "rls2")
    for folder, table in ((out / "rls2", "the table of these sums"), (copy, "the table that its config gives")):
        told = command("doctor", folder, "--recompute", 1, code=4).stderr
        assert f"{folder / 'curves.csv'}: is not {table}: differs by 1.0e-03 of σ" in told


def altered(tables, column, change):
    """The tables with one number of the discriminator's curves changed, in a row in the middle."""
    lines = tables["curves"].decode().splitlines()
    header, cells = lines[0].split(","), lines[30].split(",")
    cells[header.index(column)] = repr(change(float(cells[header.index(column)])))
    return tables | {"curves": "\n".join([*lines[:30], ",".join(cells), *lines[31:], ""]).encode()}


def test_the_self_test_says_so_where_numbers_differ(monkeypatch):
    made = {name: (self_test.KNOWN_FOLDER / f"discriminator.{name}.csv").read_bytes() for name in self_test.TABLES}
    assert self_test.verdict("discriminator", made, True).words == "the known bytes"
    # Rounding is forgiven as far as its conditioning allows.
    for column, factor, sound in (
        ("sigma", 1 + 1e-10, True),
        ("sigma", 1 + 1e-7, False),
        ("bound", 1 + 2e-11, True),
        ("bound", 1 + 1e-9, False),
        ("sigma_hi", 1 + 1e-10, True),
        ("sigma_hi", 1 + 1e-6, False),
        ("spread", 1 + 1e-7, False),
    ):
        changed = altered(made, column, lambda value, factor=factor: value * factor)
        for same_platform in (True, False):
            assert self_test.verdict("discriminator", changed, same_platform).good is sound, (column, factor)
        if sound:
            assert "not the known bytes" in self_test.verdict("discriminator", changed, True).words
    for spoiled in (made["curves"].replace(b"cured", b"cursed"), made["curves"][: len(made["curves"]) // 2]):
        assert not self_test.verdict("discriminator", made | {"curves": spoiled}, False).good
    monkeypatch.setattr(self_test, "verdicts", lambda: [self_test.Verdict("sonar", False, "differs")])
    assert "self-test: sonar: differs" in command("doctor", code=4).stderr


def test_the_tolerances_are_what_conditioning_allows():
    """κ of the known case's balanced information, times half a rounding, and no more than a few times that."""
    from radarsim.api.configs import load
    from radarsim.bursts.fisher import fisher
    from radarsim.studies.discriminator.scenario import configured_burst

    burst = configured_burst(load(self_test.KNOWN_FOLDER / "discriminator.yaml").cases[0].spec)
    information = fisher(burst, 5, burst.duration_s)
    scale = np.sqrt(np.diag(information))
    rounding = np.linalg.cond(information / np.outer(scale, scale)) * np.finfo(float).eps / 2
    assert rounding < self_test.TOLERANCES["discriminator"].exact < 10 * rounding


def test_doctor_names_the_machine_and_passes_its_self_test():
    told = json.loads(command("doctor", "--json").stdout)
    assert {"machine", "instructions", "threads", "cache", "versions", "cluster"} <= told.keys()
    assert [(one["study"], one["good"]) for one in told["self-test"]] == [
        (study, True) for study in self_test.TOLERANCES
    ]


def test_clean_drops_blocks_and_nothing_else(out):
    (out / ".blocks" / "notes.txt").write_text("mine")
    (out / ".blocks" / "ab12").mkdir()
    (out / ".blocks" / "ab12" / "mine.txt").write_text("mine")
    files, size = len(block_files(out)), sum(path.stat().st_size for path in block_files(out))
    dry = command("clean", "--dry-run", "--out", out)
    assert dry.stdout == f"would drop {files} files in 3 folders of {out / '.blocks'}: {size / 1e6:.2f} MB\n"
    assert len(block_files(out)) == files
    command("clean", "rls1", "--out", out)
    assert 0 < len(block_files(out)) < files
    command("clean", "--out", out)
    assert block_files(out) == []
    left = {str(path.relative_to(out / ".blocks")) for path in (out / ".blocks").rglob("*")}
    assert left == {"notes.txt", "ab12", "ab12/mine.txt"}
    assert "no blocks are stored" in command("doctor", out / "rls2", code=3).stderr  # and stands on its own
    assert "dropped 0 files" in command("clean", "--out", out).stdout


def test_clean_follows_no_link(out, tmp_path):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "T16.sums").write_bytes(b"mine")
    os.symlink(elsewhere, out / ".blocks" / "ab12")
    (identity,) = [path for path in (out / ".blocks").iterdir() if path.is_dir() and not path.is_symlink()][:1]
    os.symlink(elsewhere / "T16.sums", identity / "T16.sums")
    command("clean", "--out", out)
    assert (elsewhere / "T16.sums").read_bytes() == b"mine"
    shutil.rmtree(out / ".blocks")
    os.symlink(elsewhere, out / ".blocks")
    assert "is a link" in command("clean", "--out", out, code=2).stderr
    assert (elsewhere / "T16.sums").exists()
