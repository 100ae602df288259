"""`radarsim pack`, and `check` of what it wrote: a referee learns what was verified, and nothing is left behind."""

import hashlib
import json
import os
import re
import shutil
import signal
import tempfile
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest

import radarsim
from radarsim.api.archive import Archive, write_archive
from radarsim.engine.store.block_file import decode
from radarsim.report import provenance
from tests.engine.test_damage import reforged
from tests.program import command, csv_bytes, record
from tests.studies import example_packages

N = 6000


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A directory of two results."""
    out = tmp_path_factory.mktemp("results")
    command("run", "rls1", "rls2", "-n", N, "--no-figures", "--quiet", "--out", out)
    return out


@pytest.fixture
def out(made, tmp_path):
    """A copy of it, to be damaged."""
    return shutil.copytree(made, tmp_path / "r")


@pytest.fixture
def study(out, tmp_path):
    """An archive of rls2."""
    command("pack", out / "rls2", "-o", tmp_path / "study.zip")
    return tmp_path / "study.zip"


@pytest.fixture
def temporary(tmp_path, monkeypatch):
    """Where temporary files go; empty after the test."""
    folder = tmp_path / "tmp"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    yield folder
    assert list(folder.iterdir()) == []


def repacked(path, alter):
    """An archive whose manifest is right, as a cunning person writes it, after a change of its contents."""
    with Archive(path) as archive:
        contents, facts = {name: archive.read(name) for name in archive.names}, archive.facts
    alter(contents)
    write_archive(path, contents, facts)


def blocks_in(contents):
    return sorted(name for name in contents if name.endswith(".sums"))


def test_a_referee_verifies_with_one_command_and_learns_how_much(study, temporary, tmp_path):
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*") if path != temporary}
    told = command("check", study).stdout
    assert f"computed again: 2 pieces: {N} of {N} realisations (100 %)" in told
    assert "compared: 6 tables made from the sums, equal to those stored" in told
    assert "all intact" in told
    with Archive(study) as archive:
        assert archive.sha256 in told
    (found,) = json.loads(command("check", study, "--recompute", 1, "--json").stdout)
    assert found["results"]["rls2"]["realisations"] == N - 4096
    assert found["results"]["rls2"]["faults"] == found["results"]["rls2"]["not_checked"] == []
    assert before == {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*") if path != temporary}


def test_equal_results_give_equal_bytes(out, tmp_path):
    command("pack", out / "rls1", out / "rls2", "-o", tmp_path / "a.zip")
    for path in out.rglob("*"):
        os.utime(path, (10, 10))
    copy = shutil.copytree(out, tmp_path / "elsewhere")
    command("pack", copy / "rls2", copy / "rls1", "-o", tmp_path / "b.zip")
    assert (tmp_path / "a.zip").read_bytes() == (tmp_path / "b.zip").read_bytes()
    assert command("check", tmp_path / "a.zip").stdout.count("all intact") == 2


def test_a_pack_is_unpacked_by_hand_too(study, tmp_path):
    zipfile.ZipFile(study).extractall(tmp_path / "in")
    told = command("doctor", tmp_path / "in" / "results" / "rls2", "--recompute", 1).stdout
    assert "all intact" in told
    assert "radarsim check FILE.zip" in (tmp_path / "in" / "README.txt").read_text()


def test_only_blocks_behind_the_result_are_packed(out, tmp_path):
    for n in (7000, 9000, N):
        command("run", "rls2", "-n", n, "--no-figures", "--quiet", "--replace", "--out", out)
    command("pack", out / "rls2", "-o", tmp_path / "s.zip")
    with Archive(tmp_path / "s.zip") as archive:
        names = [Path(name).stem for name in blocks_in(archive.names)]
    assert [name for name in names if name.startswith("T")] == [f"T{N}"]
    told = command("check", tmp_path / "s.zip", "--recompute", 9).stdout
    assert f"{N} of {N} realisations (100 %)" in told


def altered_number(content):
    """A table with one number changed by a thousandth."""
    lines = content.decode().splitlines()
    place = lines[0].split(",").index("sigma")
    cells = lines[9].split(",")
    cells[place] = repr(float(cells[place]) * 1.001)
    return "\n".join([*lines[:9], ",".join(cells), *lines[10:], ""]).encode()


def forge_table(contents):
    """Another number in a table, and a record that fits."""
    table = contents["results/rls2/curves.csv"] = altered_number(contents["results/rls2/curves.csv"])
    recorded = json.loads(contents["results/rls2/run.json"])
    recorded["outputs"]["curves.csv"] = hashlib.sha256(table).hexdigest()
    contents["results/rls2/run.json"] = json.dumps(recorded).encode()


def forge_block(contents):
    """Other sums in a block, and no total that betrays it."""
    for name in blocks_in(contents):
        path = Path(name)
        if path.name.startswith("P"):
            place = Path(tempfile.gettempdir()) / path.name
            place.write_bytes(contents[name])
            reforged(place, values=decode(contents[name])[1] * 1.000001)
            contents[name] = place.read_bytes()
            place.unlink()


FORGERIES = {
    "a table": (forge_table, "study.zip/results/rls2/curves.csv: is not the table of these sums"),
    "a block": (forge_block, "is not the sum of the blocks beside it"),
    "a table without its record": (
        lambda contents: contents.update({"results/rls2/gains.csv": b"a\n"}),
        "study.zip/results/rls2/gains.csv: altered since it was written",
    ),
    "a missing block": (lambda contents: contents.pop(blocks_in(contents)[0]), ".sums: missing"),
    "a record of nothing": (
        lambda contents: contents.update({"results/rls2/run.json": b"{}"}),
        "study.zip/results/rls2/run.json: is no record of a run",
    ),
}


@pytest.mark.parametrize("kind", FORGERIES)
def test_a_forged_result_is_found(study, temporary, kind):
    forge, words = FORGERIES[kind]
    repacked(study, forge)
    told = command("check", study, code=4)
    assert words in told.stderr
    assert "intact" not in told.stdout
    assert str(temporary) not in told.output


OTHER_SOURCES = "ab" * 16


def with_sources_of_others(contents):
    """The blocks of results under the name that other sources would give them, as an earlier version wrote them."""
    for name in blocks_in(contents):
        top, blocks, identity, file = name.split("/")
        place = Path(tempfile.gettempdir()) / file
        place.write_bytes(contents.pop(name))
        reforged(place, identity=identity[:32] + OTHER_SOURCES)
        contents[f"{top}/{blocks}/{identity[:32]}{OTHER_SOURCES}/{file}"] = place.read_bytes()
        place.unlink()
    for name in [name for name in contents if name.endswith("run.json")]:
        recorded = json.loads(contents[name])
        recorded["identities"] = {case: text[:32] + OTHER_SOURCES for case, text in recorded["identities"].items()}
        contents[name] = json.dumps(recorded).encode()


def with_record(contents, **changes):
    """Another config.yaml for rls2, its hash recorded, and other entries in its record."""
    recorded = json.loads(contents["results/rls2/run.json"]) | changes
    recorded["outputs"]["config.yaml"] = hashlib.sha256(contents["results/rls2/config.yaml"]).hexdigest()
    recorded["resolved_sha256"] = hashlib.sha256(provenance.to_json(recorded["resolved"])).hexdigest()
    contents["results/rls2/run.json"] = json.dumps(recorded).encode()


def forge_config(contents, old, new):
    """Another config, its hash recorded."""
    assert old in contents["results/rls2/config.yaml"]
    contents["results/rls2/config.yaml"] = contents["results/rls2/config.yaml"].replace(old, new)
    with_record(contents)


def forge_everything(contents):
    """Another config, and a record that has it too."""
    forge_config(contents, b"sigma_range_m: 250", b"sigma_range_m: 240")
    resolved = json.loads(contents["results/rls2/run.json"])["resolved"]
    resolved["cases"][0]["radar"]["sigma_range_m"] = 240.0
    with_record(contents, resolved=resolved)


def forge_number(contents, count):
    """So many realisations in config and record, without blocks."""
    for name in blocks_in(contents):
        del contents[name]
    cases = json.loads(contents["results/rls2/run.json"])["cases"]
    cases["rls2"]["done"] = count
    forge_config(contents, f"realisations: {N}".encode(), f"realisations: {count}".encode())
    with_record(contents, cases=cases)


def test_blocks_of_other_sources_are_computed_from_the_config(study, temporary):
    repacked(study, with_sources_of_others)
    told = command("check", study).stdout
    assert "note: rls2: the sources that compute have changed since its blocks were made" in told
    assert f"computed again: rls2 from the config: {N} of {N} realisations (100 %)" in told
    assert "compared: 6 tables made from the sums, equal to those stored" in told
    assert told.splitlines()[-1] == f"{study}: {N} of {N} realisations computed again (100 %)"


FORGED_CONFIGS = {
    "its keys": (lambda contents: forge_config(contents, b"sigma_range_m: 250", b"sigma_range_m: 240"), "config.yaml"),
    "its seed": (lambda contents: forge_config(contents, b"seed: 2017", b"seed: 2018"), "config.yaml"),
    "all that names it": (forge_everything, "curves.csv: is not the table that its config gives: differs by"),
}


@pytest.mark.parametrize("kind", FORGED_CONFIGS)
@pytest.mark.parametrize("alter_blocks", [lambda contents: None, with_sources_of_others])
def test_a_config_that_was_altered_with_its_hash_is_found(study, kind, alter_blocks):
    forge, words = FORGED_CONFIGS[kind]
    repacked(study, alter_blocks)
    repacked(study, forge)
    assert f"{study}/results/rls2/{words}" in command("check", study, code=4).stderr


@pytest.mark.parametrize("name", ["config.yaml", "curves.csv", "report.html", "consistency.csv"])
def test_any_file_that_is_not_as_recorded_is_a_fault_of_folder_and_archive(study, out, name):
    def alter(contents):
        contents[f"results/rls2/{name}"] += b" "

    with (out / "rls2" / name).open("ab") as file:
        file.write(b" ")
    repacked(study, alter)
    for words in (["doctor", out / "rls2"], ["doctor", out / "rls2", "--recompute", 1], ["check", study]):
        told = command(*words, code=4).stderr
        assert f"{name}: altered since it was written: SHA-256" in told
        assert ("makes it again" in told) == (words[0] == "doctor")


def test_a_forged_number_of_realisations_does_not_run_for_ever(study):
    repacked(study, lambda contents: forge_number(contents, 10**12))
    told = command("check", study, code=3)
    assert "rls2: not computed again: 1,000,000,000,000 realisations are more than is computed here" in told.stderr
    assert told.stdout.splitlines()[-1].endswith(f"0 of {10**12:,} realisations computed again (0 %)")


def test_a_large_run_is_announced(study, tmp_path):
    repacked(study, lambda contents: forge_number(contents, 10**12))
    told = command("run", study, "--time-limit", 0.01, "--no-figures", "--out", tmp_path / "again", code=3).stderr
    assert re.match(r"note: rls2: 1 case, 1,000,000,000,000 realisations, about \d+:\d\d:\d\d on", told)


@pytest.mark.parametrize("changes", [{"versions": "0.3"}, {"versions": {"radarsim": 3}}, {"packages": {"a": "1.0"}}])
def test_a_record_of_another_shape_is_damaged(study, changes):
    repacked(study, lambda contents: with_record(contents, **changes))
    told = command("check", study, code=4).stderr
    assert f"run.json: is no record of a run: `{next(iter(changes))}`" in told


def test_results_of_other_versions_may_have_other_columns(study):
    def alter(contents):
        forge_number(contents, N)
        with_record(contents, versions={"radarsim": "0.2.0"})
        table = contents["results/rls2/gains.csv"] = contents["results/rls2/gains.csv"].replace(b"gain_lo", b"low")
        outputs = json.loads(contents["results/rls2/run.json"])["outputs"]
        outputs["gains.csv"] = hashlib.sha256(table).hexdigest()
        with_record(contents, outputs=outputs)

    repacked(study, alter)
    reason = f"it has other rows or columns: radarsim 0.2.0 made it, this is {radarsim.__version__}"
    assert f"gains.csv could not be compared: {reason}" in command("check", study, code=3).stderr


STRANGE = {
    "a file that no record names": "results/rls2/evil.html",
    "a file of no result": "results/rls3/curves.csv",
    "a file in another place": "etc/passwd",
    "blocks of no identity": "results/.blocks/xyz/T5.sums",
    "a file among blocks": "results/.blocks/ab12/notes.txt",
}


@pytest.mark.parametrize("kind", STRANGE)
def test_an_archive_with_anything_else_is_refused(study, temporary, kind):
    repacked(study, lambda contents: contents.update({STRANGE[kind]: b"x"}))
    assert STRANGE[kind] in command("check", study, code=2).stderr


def test_a_changed_byte_is_refused_before_anything_is_written(study, temporary, monkeypatch):
    content = bytearray(study.read_bytes())
    place = content.index(b"sigma_lo")
    content[place] ^= 1
    study.write_bytes(content)
    monkeypatch.setattr(tempfile, "mkdtemp", lambda *_, **__: pytest.fail("written"))
    assert "damaged or altered: results/rls2/curves.csv" in command("check", study, code=4).stderr


def test_an_archive_that_cannot_be_read_does_not_keep_the_others_from_being_checked(study, tmp_path):
    (tmp_path / "none.zip").write_text("no zip")
    shutil.copy(study, tmp_path / "bad.zip")
    content = bytearray(study.read_bytes())
    content[content.index(b"sigma_lo")] ^= 1
    (tmp_path / "bad.zip").write_bytes(content)
    told = command("check", tmp_path / "none.zip", study, code=2)
    assert "all intact" in told.stdout
    assert "none.zip" in told.stderr
    told = command("check", tmp_path / "none.zip", tmp_path / "bad.zip", study, code=4)
    assert "all intact" in told.stdout
    assert [line.split(": ")[0].rpartition("/")[2] for line in told.stderr.splitlines()] == ["bad.zip", "none.zip"]


def test_without_blocks_it_says_last_what_was_not_verified(out, tmp_path):
    shutil.rmtree(out / ".blocks")
    told = command("pack", out / "rls2", "-o", tmp_path / "s.zip").stdout
    assert "no blocks of rls2 are stored: it can only be recomputed as a whole" in told
    told = command("check", tmp_path / "s.zip", "--recompute", 0, code=3).stderr
    assert told.splitlines()[-1].endswith("s.zip: rls2: nothing could be recomputed: no blocks are stored")
    assert "rls2 from the config: 6000 of 6000" in command("check", tmp_path / "s.zip").stdout


def test_a_damaged_result_is_not_packed(out, tmp_path):
    (out / "rls2" / "gains.csv").write_text("other")
    assert "gains.csv: altered" in command("pack", out / "rls2", "-o", tmp_path / "s.zip", code=4).stderr
    identity = record(out / "rls1")["identities"]["rls1"]
    (block, *_) = (out / ".blocks" / identity).glob("P*")
    block.write_bytes(b"bad")
    assert f"{block}: damaged" in command("pack", out / "rls1", "-o", tmp_path / "s.zip", code=4).stderr
    assert not (tmp_path / "s.zip").exists()


def test_what_cannot_be_packed_is_said(out, tmp_path):
    before = (out / "rls2" / "run.json").read_bytes()
    shutil.copytree(out / "rls2", out / "copy")
    for results, archive, code, reason in (
        (["none"], "s.zip", 2, "there is no such folder"),
        (["rls2", "copy"], "s.zip", 2, "is called rls2, too"),
        (["rls2"], "s.tar", 2, "must end with .zip"),
        (["rls2"], "no/s.zip", 4, "s.zip: cannot be written: No such file or directory"),
    ):
        words = [out / name for name in results]
        assert reason in command("pack", *words, "-o", tmp_path / archive, code=code).stderr
    assert not list(tmp_path.glob("*.zip"))
    assert (out / "rls2" / "run.json").read_bytes() == before


def test_options_of_configs_go_with_no_archive(study):
    for option in (["-n", 10], ["--seed", 1], ["--set", "scans=3"], ["--precision", 1], ["--of", "gain"], ["rls2"]):
        assert "archive" in command("check", study, *option, code=2).stderr
    assert "apply to a study.zip" in command("check", "rls2", "--recompute", 1, code=2).stderr
    assert "no such file" in command("check", study.with_name("none.zip"), code=2).stderr


def test_it_runs_anew_elsewhere_with_the_same_bytes(study, out, temporary, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.move(out, tmp_path / "gone")
    told = command("run", "study.zip", "--no-figures", "--out", "again")
    assert "compared  rls2: 6 tables, the same bytes as in study.zip" in told.stdout
    assert csv_bytes(tmp_path / "again" / "rls2") == csv_bytes(tmp_path / "gone" / "rls2")
    assert str(temporary) not in told.output
    written = "".join(path.read_text() for path in (tmp_path / "again" / "rls2").iterdir())
    assert not any(place in written for place in (str(tmp_path), "/radarsim-"))
    other = command("run", "study.zip", "--no-figures", "--out", "other", "-n", 2000).stdout
    assert "compared" not in other
    assert record(tmp_path / "other" / "rls2")["realisations_done"] == 2000


def test_tables_that_come_out_otherwise_are_named(study, tmp_path, monkeypatch):
    repacked(study, forge_table)
    told = command("run", study, "--no-figures", "--out", tmp_path / "again", code=4).stderr
    assert f"{study}/results/rls2/curves.csv: the table computed here differs by 1.0e-03 of σ" in told


def test_a_table_of_runs_is_compared_where_it_is_computed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    command("run", "rls2", "-n", 2000, "--runs", "3:10", "--no-figures", "-q")
    command("pack", "results/rls2", "-o", "s.zip")
    told = command("run", "s.zip", "--no-figures", "--out", "again")
    assert "compared  rls2: 7 tables, the same bytes as in s.zip" in told.stdout
    assert "`radarsim claims again/rls2/config.yaml --out again`" in told.stdout


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no device that is always full")
def test_a_full_temporary_folder_is_named(study, temporary, monkeypatch):
    monkeypatch.setattr("radarsim.api.archive.create_private_file", lambda path: Path("/dev/full").open("wb"))  # noqa: SIM115
    fault = command("check", study, code=4).stderr
    assert fault == f"{temporary}: cannot be written: No space left on device; TMPDIR names another\n"


FILTER = """
import pathlib
import numpy as np

GAIN = float((pathlib.Path(__file__).parent / "data" / "gain.txt").read_text())
pathlib.Path({mark!r}).touch()


def follow(plots):
    z = plots["range_m"]
    return GAIN * np.stack([z, np.zeros_like(z)], axis=2)
"""
CONFIG = """
include: [rls2]
realisations: 2000
filters:
  - {name: r, observes: [range], manoeuvre_variance: 1e-3}
  - {name: mine, python: "my_filter.py:follow"}
"""


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A folder with a result of a user filter, which leaves a mark where it runs."""
    monkeypatch.delenv("RADARSIM_NO_CODE", raising=False)
    folder = tmp_path / "own"
    (folder / "data").mkdir(parents=True)
    (folder / "my_filter.py").write_text(FILTER.format(mark=str(tmp_path / "mark")))
    (folder / "data" / "gain.txt").write_text("1.0")
    (folder / "mine.yaml").write_text(CONFIG)
    monkeypatch.chdir(folder)
    command("run", "mine.yaml", "--no-figures", "--quiet")
    (tmp_path / "elsewhere").mkdir()
    return folder


def test_code_is_packed_on_request_and_run_by_those_who_trust_it(own, temporary, tmp_path, monkeypatch):
    mark = tmp_path / "mark"
    command("pack", "results/mine", "-o", tmp_path / "elsewhere" / "s.zip", "--code")
    with Archive(tmp_path / "elsewhere" / "s.zip") as archive:
        assert {"results/mine/my_filter.py", "results/mine/data/gain.txt"} <= {*archive.names}
        assert not any(
            str(tmp_path).encode() in archive.read(name) for name in archive.names if "my_filter" not in name
        )
    shutil.rmtree(own)
    monkeypatch.chdir(tmp_path / "elsewhere")
    mark.unlink()
    told = command("check", "s.zip", code=3).stderr
    assert "nothing could be recomputed: that runs code of its author: my_filter.py:follow; read it, then give" in told
    assert "--trust-code" in command("run", "s.zip", code=3).stderr
    assert not mark.exists()
    assert "RADARSIM_NO_CODE" not in os.environ
    told = command("check", "s.zip", "--trust-code").stdout
    assert "2000 of 2000 realisations (100 %)" in told
    assert mark.exists()
    told = command("run", "s.zip", "--trust-code", "--no-figures")
    assert "note: runs code of s.zip: results/mine/my_filter.py" in told.stderr
    assert "the same bytes as in s.zip" in told.stdout
    assert "--trust-code applies to a study.zip" in command("run", "rls2", "--trust-code", code=2).stderr


def test_results_that_cannot_be_run_do_not_keep_the_others_from_it(own, tmp_path):
    command("run", "rls2", "-n", 500, "--no-figures", "--quiet")
    command("pack", "results", "-o", "s.zip", "--code")
    told = command("run", "s.zip", "--no-figures", "--out", "again", code=3)
    assert "compared  rls2: 6 tables, the same bytes as in s.zip" in told.stdout
    reason = "that runs code of its author: my_filter.py:follow; read it, then give --trust-code"
    assert told.stderr == f"s.zip: mine: not run: {reason}\n"
    assert [path.name for path in Path("again").iterdir() if path.is_dir()] == [".blocks", "rls2"]
    told = command("check", "s.zip", code=3)
    assert "compared: 6 tables" in told.stdout
    assert told.stderr == f"s.zip: mine: nothing could be recomputed: {reason}\n"


def test_a_result_that_cannot_be_read_is_named_and_the_others_run(own, out, tmp_path):
    command("pack", out, "-o", "s.zip")

    def alter(contents):
        forge_config(contents, b"study: range_doppler", b"study: of_a_package")

    repacked("s.zip", alter)
    told = command("run", "s.zip", "--no-figures", "--out", "again", code=3)
    assert "compared  rls1: 6 tables" in told.stdout
    assert told.stderr.startswith("s.zip: rls2: not run: s.zip/results/rls2/config.yaml:")
    assert "of_a_package" in told.stderr


def test_without_its_code_a_result_is_checked_as_far_as_it_goes(own, tmp_path, monkeypatch):
    told = command("pack", "results/mine", "-o", tmp_path / "elsewhere" / "s.zip").stdout
    assert "note: results/mine: the code of its filters is not packed: my_filter.py:follow; --code adds it" in told
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert "code that is not in the archive: my_filter.py:follow" in command("check", "s.zip", code=3).stderr
    assert "a result does not contain the code" in command("check", "s.zip", "--trust-code", code=3).stderr
    monkeypatch.chdir(own)
    assert "all intact" in command("check", tmp_path / "elsewhere" / "s.zip", "--trust-code").stdout


def test_code_that_has_changed_since_is_not_packed_with_a_result(own, tmp_path):
    (own / "data" / "gain.txt").write_text("1.5")
    told = command("pack", "results/mine", "-o", tmp_path / "s.zip", "--code", code=2).stderr
    assert "has changed since it ran: run it again before packing" in told
    assert not (tmp_path / "s.zip").exists()


def test_a_judged_result_says_what_it_lacks(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    command("simulate", "rls2", "--realisations", "0:500", "-o", "plots.npz")
    ranges = np.load("plots.npz")["range_m"]
    np.savez("estimates.npz", estimates=np.stack([ranges, np.zeros_like(ranges)], axis=2))
    command("judge", "rls2", tmp_path / "estimates.npz", "--no-figures", "--quiet")
    assert not any(str(tmp_path) in path.read_text() for path in Path("results/rls2_mine").iterdir())
    told = command("pack", "results/rls2_mine", "-o", "s.zip").stdout
    assert "the estimates of its judged filter mine are not in it" in told
    lack = "nothing could be recomputed: s.zip/results/rls2_mine: a result does not contain the estimates"
    assert lack in command("check", "s.zip", code=3).stderr
    assert "holds no estimates of its judged filter mine" in command("run", "s.zip", code=3).stderr


@pytest.mark.slow
def test_a_package_of_the_author_is_named_and_its_reader_told_to_install_it(tmp_path, warm):
    (tmp_path / "site").mkdir()
    packaged = example_packages.beside(warm, tmp_path / "site", tmp_path)
    packaged("new-study", "walk52")
    example_packages.installed(tmp_path / "walk52", tmp_path / "site")
    packaged("run", "walk52", "-n", "2000", "--no-figures", "-q")
    packaged("run", "rls2", "-n", "500", "--no-figures", "-q")
    (name,) = record(tmp_path / "results" / "walk52")["packages"]
    package = record(tmp_path / "results" / "walk52")["packages"][name]
    assert "packages" not in record(tmp_path / "results" / "rls2")
    told = packaged("pack", "results", "-o", "s.zip").stdout
    assert f"the package that computes it is not packed: {name}=={package['version']}; name its source" in told
    assert "all intact" in packaged("check", "s.zip").stdout
    words = f"install the package that computed it: {name} {package['version']} (SHA-256 of its sources: "
    words += f"{package['sha256']})"
    away = tmp_path / "away"
    away.mkdir()
    shutil.move(tmp_path / "s.zip", away)
    referee = example_packages.beside(warm, away, away)
    assert f"s.zip: walk52: nothing could be recomputed: {words}" in referee("check", "s.zip", code=3).stderr
    told = referee("run", "s.zip", "--no-figures", code=3)
    assert told.stderr == f"s.zip: walk52: not run: {words}\n"
    assert "compared  rls2: 6 tables, the same bytes" in told.stdout


def test_a_directory_of_results_is_packed_as_a_whole(out, tmp_path):
    for words in ([out], [*out.iterdir()]):
        command("pack", *(word for word in words if word.name != ".blocks"), "-o", tmp_path / "s.zip")
        with Archive(tmp_path / "s.zip") as archive:
            assert [*archive.facts["results"]] == ["rls1", "rls2"]
    assert "no folder of results" in command("pack", out / "index.html", "-o", tmp_path / "s.zip", code=2).stderr


def test_other_commands_say_what_takes_an_archive(study):
    for words in (("report", study), ("claims", study), ("doctor", study), ("compare", study, "rls2")):
        assert "radarsim check" in command(*words, code=2).stderr


def killed_after(seconds, *words):
    """The command in a process of its own, killed (-9) after so many seconds; whether it had ended by then."""
    child = os.fork()
    if not child:
        for number in (1, 2):
            os.dup2(os.open(os.devnull, os.O_WRONLY), number)
        command(*words)
        os._exit(0)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if os.waitpid(child, os.WNOHANG)[0]:
            return True
        time.sleep(0.0005)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return False


def seconds_of(*words):
    """How long a command takes in a process of its own."""
    started = time.monotonic()
    assert killed_after(100, *words)
    return time.monotonic() - started


@pytest.mark.slow
def test_a_kill_at_fifty_moments_leaves_the_old_result_or_the_new_one(out):
    """Also where the next program that looks is doctor."""
    folder, runs = out / "rls2", [("run", "rls2", "-n", n, "--out", out, "--quiet", "--replace") for n in (N, 7000)]
    tables = []
    for words in runs:
        command(*words)
        tables.append(csv_bytes(folder))
    command(*runs[0])
    duration, seen = seconds_of(*runs[1]), []
    for moment in range(50):
        command(*runs[0])
        killed_after(duration * (0.2 + 0.8 * moment / 49), *runs[1])
        assert "all intact" in command("doctor", folder).stdout
        assert csv_bytes(folder) in tables
        seen.append(tables.index(csv_bytes(folder)))
    assert {*seen} == {0, 1}, duration


@pytest.mark.slow
def test_a_kill_at_fifty_moments_leaves_the_old_archive_or_the_new_one(out, tmp_path):
    archive, packs = tmp_path / "s.zip", [("pack", out / name, "-o", tmp_path / "s.zip") for name in ("rls1", "rls2")]
    contents = []
    for words in packs:
        command(*words)
        contents.append(archive.read_bytes())
    duration, seen = seconds_of(*packs[1]), []
    for moment in range(50):
        command(*packs[0])
        killed_after(1.2 * duration * moment / 49, *packs[1])
        seen.append(contents.index(archive.read_bytes()))
    assert {*seen} == {0, 1}, duration
