"""The cache of compiled kernels: damage and bad disks are misses, reported once; one study's edit leaves the others."""

import errno
import hashlib
import json
import os
import pickle
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType

import pytest
from numba import njit
from numba.core.registry import cpu_target

from radarsim.api.maintenance import self_test
from radarsim.kernels import cache
from radarsim.kernels.compiler import FAST_MATH_FLAGS
from radarsim.kernels.numba_internals import COMMON, KernelCache, compile_kernel


def twice(x):
    return 2 * x


@pytest.fixture(autouse=True)
def troubles(monkeypatch):
    """The lines for the user, none at first."""
    found = {}
    monkeypatch.setattr(cache, "troubles", found)
    return found


def kept_in(function, path):
    """A cache in a directory of its own."""
    result = KernelCache(function)
    result.entries.folder = path
    return result


def used(path):
    """Call a kernel that keeps its code in a directory; whether that came from there."""
    function = njit(**COMMON)(twice)
    function._cache = kept_in(function.py_func, path)
    assert function(4.0) == 8.0
    return bool(sum(function.stats.cache_hits.values()))


def entry(path):
    (found,) = path.glob("*.kernel")
    return found


def test_a_kernel_is_read_from_where_it_was_kept(tmp_path, troubles):
    assert [used(tmp_path / "kernels") for _ in range(3)] == [False, True, True]
    assert [path.suffix for path in (tmp_path / "kernels").iterdir()] == [".kernel"]
    assert not troubles


def test_what_it_takes_to_compile_is_not_loaded_for_a_kept_kernel(tmp_path, monkeypatch):
    """Numba's refresh: SciPy's linear algebra and a hundred files more."""
    used(tmp_path)
    monkeypatch.setattr(type(cpu_target.target_context), "refresh", lambda context: pytest.fail("it compiles"))
    assert used(tmp_path)


def test_flushing_removes_the_entries_of_the_kernel(tmp_path):
    used(tmp_path)
    kept_in(twice, tmp_path).flush()
    assert not list(tmp_path.glob("*.kernel"))


def altered(raw):
    return raw[:200] + bytes([raw[200] ^ 1]) + raw[201:]


def signed(body):
    return hashlib.sha256(body).digest() + body


@pytest.mark.parametrize(
    "damage",
    [
        lambda raw: b"",
        lambda raw: raw[: len(raw) // 2],
        altered,
        lambda raw: b"\x80" * 500,
        lambda raw: signed(b"no pickle"),
        lambda raw: signed(pickle.dumps(3)),
        lambda raw: signed(pickle.dumps((pickle.loads(raw[cache.DIGEST :])[0], ()))),
        lambda raw: signed(b"cno_such_module\nname\n."),
    ],
)
def test_a_damaged_entry_is_a_miss_and_is_made_anew(tmp_path, troubles, damage):
    used(tmp_path)
    path = entry(tmp_path)
    path.write_bytes(damage(path.read_bytes()))
    assert not used(tmp_path)
    assert list(troubles) == ["damaged"]
    assert str(path) in troubles["damaged"]
    assert used(tmp_path)


def test_an_entry_of_other_sources_is_a_miss(tmp_path, troubles):
    """Copied by hand from one directory to another."""
    used(tmp_path / "one")
    shutil.copytree(tmp_path / "one", tmp_path / "two")
    path = entry(tmp_path / "two")
    assert not used(tmp_path / "two")
    names = {found.name for found in (tmp_path / "two").iterdir()}
    assert path.name in names
    path = next(found for found in (tmp_path / "two").iterdir() if found.name != path.name)
    path.write_bytes(entry(tmp_path / "one").read_bytes())  # under the other's name too
    assert not used(tmp_path / "two")
    assert not troubles


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EDQUOT, errno.EIO])
def test_a_disk_that_cannot_be_written_is_reported_once_and_left_alone(tmp_path, troubles, monkeypatch, number):
    tried = []

    def refuse(path, content):
        tried.append(path)
        raise OSError(number, "no")

    monkeypatch.setattr(cache, "write_private_file", refuse)
    assert [used(tmp_path / "kernels") for _ in range(3)] == [False, False, False]
    assert (len(tried), list(troubles)) == (1, ["write"])


def test_an_entry_that_cannot_be_read_is_a_miss(tmp_path, troubles):
    used(tmp_path)
    path = entry(tmp_path)
    path.unlink()
    path.mkdir()
    assert not used(tmp_path)
    assert "cannot be read" in troubles["read"]


def test_a_directory_that_goes_during_the_run_is_made_again(tmp_path, troubles):
    for _ in range(2):
        assert not used(tmp_path / "kernels")
        assert used(tmp_path / "kernels")
        shutil.rmtree(tmp_path / "kernels")
    assert not troubles


def test_many_at_once(tmp_path, troubles):
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda _: used(tmp_path), range(16)))
    assert used(tmp_path)
    assert len(list(tmp_path.iterdir())) == 1
    assert not troubles


def test_the_first_writable_place(monkeypatch, tmp_path, troubles):
    blocked = tmp_path / "file"
    blocked.write_text("not a directory")
    monkeypatch.setenv("RADARSIM_CACHE_DIR", str(tmp_path / "own"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    assert cache.cache_root() == tmp_path / "own"
    monkeypatch.setenv("RADARSIM_CACHE_DIR", str(blocked))
    assert not troubles
    assert cache.cache_root() == tmp_path / "home" / "radarsim"
    assert f"{blocked} cannot be written" in troubles["trust"]  # a place that is named is not passed over in silence
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    monkeypatch.setattr(cache.tempfile, "tempdir", str(tmp_path))
    shared = cache.cache_root()
    assert shared.parent == tmp_path
    assert cache.cache_root() == shared
    if hasattr(os, "getuid"):
        assert shared.stat().st_mode & 0o777 == 0o700


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no such permissions here")
def test_a_shared_place_that_others_can_write_is_not_trusted(monkeypatch, tmp_path):
    """The cache holds machine code: in the common temporary directory it must be ours alone."""
    blocked = tmp_path / "file"
    blocked.write_text("not a directory")
    monkeypatch.setenv("RADARSIM_CACHE_DIR", str(blocked))
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    monkeypatch.setattr(cache.tempfile, "tempdir", str(tmp_path))
    planted = cache.cache_root()
    planted.chmod(0o777)
    assert cache.cache_root() != planted


def test_nowhere_to_keep_anything(monkeypatch, tmp_path, troubles):
    blocked = tmp_path / "file"
    blocked.write_text("not a directory")
    monkeypatch.setenv("RADARSIM_CACHE_DIR", str(blocked))
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    monkeypatch.setattr(cache.tempfile, "tempdir", str(blocked))
    assert cache.cache_root() == blocked
    assert "each run compiles again" in troubles["write"]


def test_a_function_of_no_file_is_not_kept():
    names = {"__name__": "no_file"}
    sys.modules["no_file"] = module = ModuleType("no_file")
    try:
        exec("def thrice(x):\n    return 3 * x\n", names)
        assert not isinstance(compile_kernel(names["thrice"], FAST_MATH_FLAGS)._cache, KernelCache)
    finally:
        del sys.modules[module.__name__]


@pytest.mark.slow
def test_the_command_goes_on_and_says_so_in_one_line(tmp_path, libraries):
    """A run whose cache cannot be used at all: the same bytes, one line on stderr, and the same in run.json."""
    place = {"RADARSIM_CACHE_DIR": str(tmp_path / "cache")}
    prepared = "from radarsim.kernels.second_order import add_block as one; print(one._cache.cache_path)"
    Path(libraries.run(code=prepared, **place).stdout.strip()).write_text("no directory")
    config = self_test.KNOWN_FOLDER / "range_doppler.yaml"
    done = libraries.run("run", config, "--no-figures", "--out", tmp_path, **place)
    assert done.returncode == 0
    lines = [line for line in done.stderr.splitlines() if "kernel cache" in line]
    assert len(lines) == len(done.stderr.splitlines()) == 1, done.stderr
    assert (tmp_path / "range_doppler" / "run.json").read_text().count("kernel cache: ") == 1
    assert (tmp_path / "range_doppler" / "curves.csv").read_bytes() == self_test.compute_tables("range_doppler")[
        "curves"
    ]


by_numbers = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="no user numbers here")


class Planted:
    """What creates a folder when it is unpickled."""

    def __init__(self, flag):
        self.flag = flag

    def __reduce__(self):
        return os.mkdir, (str(self.flag),)


def open_to_all(path):
    path.chmod(path.stat().st_mode | 0o002)


def give_away(path):
    if os.geteuid() != 0:
        pytest.skip("only root gives files away")
    os.chown(path, 4321, 4321)


@by_numbers
@pytest.mark.parametrize("place", ["", "kernels", "kernels/entry"])
@pytest.mark.parametrize("harm", [open_to_all, give_away])
def test_what_another_user_could_have_written_is_not_run(tmp_path, troubles, place, harm):
    """An entry with a correct checksum: it, its folder or the whole cache is open to others, or somebody else's."""
    root, flag = tmp_path / "cache", tmp_path / "flag"
    used(root / "kernels")
    path = entry(root / "kernels")
    planted = signed(pickle.dumps(Planted(flag)))
    path.write_bytes(planted)
    assert not used(root / "kernels")
    assert flag.is_dir()  # the premise: it runs from a cache that is the user's
    flag.rmdir()
    troubles.clear()
    path.write_bytes(planted)
    harmed = path if place.endswith("entry") else root / place
    harm(harmed)
    for _ in range(2):
        assert not used(root / "kernels") or place.endswith("entry")  # then it was written anew
    assert not flag.exists()
    (line,) = troubles.values()
    assert str(harmed) in line
    assert ("can be written by every user" if harm is open_to_all else "belongs to another user (4321)") in line
    assert (path.read_bytes() == planted) is not place.endswith("entry")


@by_numbers
@pytest.mark.parametrize("variable", ["RADARSIM_CACHE_DIR", "XDG_CACHE_HOME", "HOME", "TMPDIR"])
def test_a_place_that_others_can_write_is_passed_over(monkeypatch, tmp_path, troubles, variable):
    """By whatever variable it is named: the next place is used, and one line names both."""
    blocked, private, shared = tmp_path / "file", tmp_path / "private", tmp_path / "shared"
    blocked.write_text("not a directory")
    private.mkdir()
    shared.mkdir()
    shared.chmod(0o777)
    places = {"RADARSIM_CACHE_DIR": blocked, "XDG_CACHE_HOME": blocked, "HOME": blocked, "TMPDIR": private}
    places[variable] = shared
    for name, place in places.items():
        monkeypatch.setenv(name, str(place))
    if variable == "HOME":
        monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setattr(cache.tempfile, "tempdir", None)
    root = cache.cache_root()
    (line,) = troubles.values()
    assert f"{shared}" in line
    assert "can be written by every user" in line
    if variable == "TMPDIR":
        assert list(troubles) == ["write"]
        assert not list(shared.iterdir())
    else:
        assert root.parent == private
        assert line.endswith(f"compiled kernels are kept in {root}")


@by_numbers
@pytest.mark.parametrize("mask", [0, 0o777], ids=oct)
def test_what_is_kept_is_for_the_user_alone_whatever_the_umask(tmp_path, monkeypatch, mask):
    monkeypatch.setenv("RADARSIM_CACHE_DIR", str(tmp_path / "a/b"))
    before = os.umask(mask)
    try:
        monkeypatch.setattr(cache, "ROOT", cache.cache_root())
        used(cache.ROOT / "kernels")
    finally:
        os.umask(before)
    modes = {path.name: path.stat().st_mode & 0o777 for path in (tmp_path / "a").rglob("*")}
    assert modes == {"b": 0o700, "kernels": 0o700, entry(tmp_path / "a/b/kernels").name: 0o600}


@by_numbers
def test_the_command_passes_over_a_place_that_others_can_write_in_one_line(tmp_path, libraries):
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o777)
    place = {"RADARSIM_CACHE_DIR": str(shared)}
    done = libraries.run("run", "rls2", "-n", 200, "--no-figures", "--out", tmp_path / "results", **place)
    assert done.returncode == 0
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"warning: kernel cache: {shared} is not used, as it can be written by every user")
    assert not list(shared.iterdir())


@pytest.mark.slow
def test_what_is_compiled_beforehand_is_not_compiled_by_a_run(tmp_path):
    """As after an installation: an empty cache, the command, then a run of another process."""
    environment = os.environ | {"RADARSIM_CACHE_DIR": str(tmp_path / "cache")}

    def command(*words):
        program = [sys.executable, "-m", "radarsim", *words]
        return subprocess.run(program, env=environment, cwd=tmp_path, capture_output=True, text=True, check=True).stdout

    (first,) = json.loads(command("compile", "rls3", "--json"))
    kept = {path: path.stat().st_mtime_ns for path in tmp_path.glob("cache/*/*.kernel")}
    assert kept
    command("run", "rls3", "-n", "5000", "--no-figures", "--out", str(tmp_path))
    assert {path: path.stat().st_mtime_ns for path in tmp_path.glob("cache/*/*.kernel")} == kept
    (again,) = json.loads(command("compile", "rls3", "--json"))
    assert again["config"] == "rls3"
    assert again["seconds"] < 0.5 * first["seconds"]
    assert command("compile", "rls3").startswith("rls3  ")
