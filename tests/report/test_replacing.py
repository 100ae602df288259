"""Files that are replaced together: a process killed at any moment leaves all old ones or all new ones."""

import json
import os
import shutil
import signal
import sys
from pathlib import Path

import pytest

from radarsim.api.archive import Archive, write_archive
from radarsim.errors import Interruption
from radarsim.report import atomic_files, provenance

OLD = {"curves.csv": b"old curves", "figures/sigma.svg": b"old figure", "gains.csv": b"old gains"}
NEW = {"curves.csv": b"new", "figures/gain.svg": b"new figure", "notes.csv": b"new notes", "gains.csv": b"new gains"}
STEPS = ("open", "os.rename", "os.remove", "os.chmod", "os.mkdir", "shutil.rmtree")


def killed_at(step, work):
    """Whether `work`, in a process of its own, was killed (-9) as it did something to files for the step-th time."""
    child = os.fork()
    if not child:
        left = step

        def watch(event, _):
            nonlocal left
            if event in STEPS:
                left -= 1
                if left < 0:
                    os.kill(os.getpid(), signal.SIGKILL)

        sys.addaudithook(watch)
        work()
        os._exit(0)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == -signal.SIGKILL


def with_record(contents):
    """The contents with the record that names them."""
    return contents | {"run.json": json.dumps({"outputs": dict.fromkeys(contents, "")}).encode()}


def found(folder):
    """All files of a folder but temporary ones, by path, as a reader of its record finds them."""
    atomic_files.read(folder / "run.json")
    files = [path for path in folder.rglob("*") if path.is_file() and not atomic_files.TEMPORARY.fullmatch(path.name)]
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


def replace(folder, contents):
    atomic_files.replace_all(folder, with_record(contents), stale=provenance.outputs)


@pytest.fixture(scope="module")
def killed(tmp_path_factory):
    """Folders as a process left them that was killed as it replaced files, one for each step; the last one it
    finished."""
    folders, is_killed = [], True
    while is_killed:
        folder = tmp_path_factory.mktemp("killed")
        replace(folder, OLD)
        (folder / "my notes.txt").write_bytes(b"mine")
        is_killed = killed_at(len(folders), lambda folder=folder: replace(folder, NEW))
        folders.append(folder)
    return folders


def test_a_replacement_that_is_killed_at_any_step_leaves_all_old_or_all_new_files(killed, tmp_path):
    seen = []
    for step, left in enumerate(killed[:-1]):
        folder = shutil.copytree(left, tmp_path / str(step))
        files = found(folder)
        assert files.pop("my notes.txt") == b"mine"
        assert files in (with_record(OLD), with_record(NEW)), step
        seen.append(files == with_record(NEW))
        replace(folder, OLD)  # and whatever is left is in nobody's way
        assert {**found(folder)}.pop("my notes.txt") == b"mine"
    assert len(seen) > 20
    assert seen == sorted(seen)
    assert {*seen} == {False, True}
    files = found(killed[-1])
    del files["my notes.txt"]
    assert files == with_record(NEW)


def test_the_next_writer_finishes_first(killed, tmp_path):
    """Else files of a run that nobody wrote down would stay."""
    for step, left in enumerate(killed):
        folder = shutil.copytree(left, tmp_path / str(step))
        replace(folder, {"curves.csv": b"third"})
        assert found(folder) == with_record({"curves.csv": b"third"}) | {"my notes.txt": b"mine"}, step


def test_a_signal_in_the_middle_is_late(tmp_path, monkeypatch):
    replace(tmp_path, OLD)
    original, renamed = atomic_files.rename, []

    def rename(temporary, path):
        original(temporary, path)
        renamed.append(path)
        if len(renamed) == 2:
            raise Interruption(2)

    monkeypatch.setattr(atomic_files, "rename", rename)
    with pytest.raises(Interruption):
        replace(tmp_path, NEW)
    monkeypatch.undo()
    assert found(tmp_path) == with_record(NEW)
    assert not (tmp_path / atomic_files.JOURNAL).exists()


@pytest.mark.parametrize(
    "journal",
    [
        b"{",
        b"[" * 100_000,
        b"[]",
        b'{"token": "x", "files": [], "removed": ["../treasure"]}',
        json.dumps({"token": "a" * 32, "files": [], "removed": ["../treasure"]}).encode(),
        json.dumps({"token": "a" * 32, "files": [], "removed": ["link/treasure"]}).encode(),
        json.dumps({"token": "a" * 32, "files": [7], "removed": []}).encode(),
        json.dumps({"token": "a" * 32, "files": ["\0"], "removed": []}).encode(),
    ],
)
def test_a_journal_of_strangers_moves_nothing_outside(tmp_path, journal):
    folder, treasure = tmp_path / "f", tmp_path / "treasure"
    replace(folder, OLD)
    treasure.write_text("gold")
    (folder / "link").symlink_to(tmp_path)
    (folder / atomic_files.JOURNAL).write_bytes(journal)
    atomic_files.read(folder / "run.json")
    assert treasure.read_text() == "gold"
    replace(folder, NEW)
    assert treasure.read_text() == "gold"
    assert (folder / "curves.csv").read_bytes() == NEW["curves.csv"]


def test_an_archive_whose_writer_is_killed_at_any_step_is_the_old_or_the_new_one(tmp_path):
    path, seen, step = tmp_path / "s.zip", [], 0
    while True:
        write_archive(path, OLD, {})
        if not killed_at(step, lambda: write_archive(path, NEW, {})):
            break
        with Archive(path) as archive:
            contents = {name: archive.read(name) for name in archive.names}
        assert contents in (OLD, NEW)
        seen.append(contents == NEW)
        step += 1
    assert step > 3
    assert seen == sorted(seen)
    assert not seen[0]


def test_files_are_replaced_where_the_clock_is_ahead_of_theirs(tmp_path, monkeypatch):
    """The clock was set, or a server, whose clock is behind, keeps them."""
    monkeypatch.setattr("time.time", lambda: 1e10)
    for content in (b"old", b"new"):
        atomic_files.replace_all(tmp_path, {"a": content, "b/c": content})
        assert [(tmp_path / name).read_bytes() for name in ("a", "b/c")] == [content, content]


def test_what_a_killed_process_left_is_removed_after_a_while(tmp_path):
    replace(tmp_path, OLD)
    old, fresh = tmp_path / f".curves.csv.{'a' * 32}.tmp", tmp_path / f".curves.csv.{'b' * 32}.tmp"
    own = Path(tmp_path / ".curves.csv.backup.tmp")
    for path in (old, fresh, own):
        path.write_bytes(b"")
    for path in (old, own):
        os.utime(path, (0, 0))
    replace(tmp_path, NEW)
    assert [path.exists() for path in (old, fresh, own)] == [False, True, True]
