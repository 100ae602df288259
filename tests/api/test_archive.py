"""An archive gives back what was written, in the same bytes each time; any other zip is refused before it is read."""

import errno
import os
import random
import stat
import struct
import zipfile

import pytest

from radarsim.api import archive
from radarsim.api.archive import Archive, write_archive
from radarsim.errors import ConfigError, RadarsimError, StoreError
from tests.program import command

CONTENTS = {
    "results/a/curves.csv": b"k,sigma\n1,2\n",
    "results/.blocks/ab12/T5.sums": bytes(300),
    "README.txt": b"read me",
}


@pytest.fixture
def path(tmp_path):
    """A sound archive."""
    write_archive(tmp_path / "s.zip", CONTENTS, {"results": ["a"]})
    return tmp_path / "s.zip"


def opened(path):
    """All that an archive holds."""
    with Archive(path) as found:
        return {name: found.read(name) for name in found.names}


def rewritten(path, alter=lambda entries: None, method=zipfile.ZIP_STORED, **settings):
    """The archive written anew by Python's own zipfile, after a change of its entries (ZipInfo, content)."""
    with zipfile.ZipFile(path) as old:
        entries = [(info, old.read(info)) for info in old.infolist()]
    alter(entries)
    with zipfile.ZipFile(path, "w", method) as new:
        for info, content in entries:
            new.writestr(info, content, **settings)


def test_contents_come_back_and_equal_contents_have_equal_bytes(path, tmp_path, monkeypatch):
    assert opened(path) == CONTENTS
    with Archive(path) as found:
        assert found.facts == {"results": ["a"]}
        found.extract(tmp_path / "in", found.names)
    assert {name: (tmp_path / "in" / name).read_bytes() for name in CONTENTS} == CONTENTS
    monkeypatch.setenv("TZ", "Asia/Tokyo")
    before = os.umask(0o077)
    try:
        digest = write_archive(tmp_path / "t.zip", dict(reversed(CONTENTS.items())), {"results": ["a"]})
    finally:
        os.umask(before)
    assert (tmp_path / "t.zip").read_bytes() == path.read_bytes()
    with Archive(path) as found:
        assert found.sha256 == digest


def put(name, content=b"x", **attributes):
    """An entry that is added."""

    def alter(entries):
        info = zipfile.ZipInfo(name)
        for key, value in attributes.items():
            setattr(info, key, value)
        entries.append((info, content))

    return alter


HOSTILE = {
    "a path above": put("../evil"),
    "a path above, inside": put("results/../../evil"),
    "an absolute path": put("/etc/evil"),
    "a drive": put("C:/evil"),
    "backslashes": put("..\\evil"),
    "an empty part": put("results//evil"),
    "a hidden file": put("results/a/.bashrc"),
    "a device of Windows": put("results/nul.csv"),
    "a name with a line break": put("results/a\nb"),
    "a long name": put("a" * 300),
    "a folder": put("results/evil/", b""),
    "a link": put("results/link", b"/etc/passwd", external_attr=(stat.S_IFLNK | 0o777) << 16, create_system=3),
    "a device": put("results/device", external_attr=(stat.S_IFCHR | 0o777) << 16, create_system=3),
    "a pipe": put("results/pipe", external_attr=(stat.S_IFIFO | 0o777) << 16, create_system=3),
    "a file that is not listed": put("results/a/more.csv"),
    "a comment of an entry": put("results/a/more.csv", comment=b"hello"),
    "a further field": put("results/a/more.csv", extra=struct.pack("<HH", 0xCAFE, 0)),
    "the same file on some systems": put("results/a/CURVES.csv"),
    "a file in a file": put("results/a/curves.csv/b"),
    "a missing file": lambda entries: entries.pop(),
    "another order": lambda entries: entries.reverse(),
    "no manifest": lambda entries: entries.pop(0),
    "no entries": lambda entries: entries.clear(),
    "an unreadable manifest": lambda entries: entries.__setitem__(0, (entries[0][0], b"{")),
    "a deep manifest": lambda entries: entries.__setitem__(0, (entries[0][0], b"[" * 100_000)),
    "a manifest of another kind": lambda entries: entries.__setitem__(0, (entries[0][0], b"[]")),
    "a later format": lambda entries: entries.__setitem__(
        0, (entries[0][0], entries[0][1].replace(b"study 1", b"study 2"))
    ),
}


@pytest.mark.parametrize("kind", HOSTILE)
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_any_other_zip_is_refused(path, kind):
    rewritten(path, HOSTILE[kind])
    with pytest.raises(ConfigError, match=r"s\.zip: not as `radarsim pack` writes it: .*; nothing is read"):
        Archive(path)


def patched(offset, value, form="<H", at=b"PK\1\2", last=True):
    """The archive with a number changed in the list of files, or behind it, of the last such place."""

    def alter(content):
        place = content.rindex(at) if last else content.index(at)
        struct.pack_into(form, content, place + offset, value)
        return content

    return alter


def renamed(old, new):
    """The archive with other bytes of equal number in all names of an entry."""

    def alter(content):
        assert len(old) == len(new)
        assert old in content
        return bytearray(bytes(content).replace(old, new))

    return alter


def with_zip64_end(content):
    """The list of files also given by a 64-bit end, which says that there are more of them."""
    end = content.rindex(b"PK\5\6")
    record = struct.pack("<4sQ2H2L4Q", b"PK\6\6", 44, 45, 45, 0, 0, 2**40, 2**40, 2**40, 0)
    locator = struct.pack("<4sLQL", b"PK\6\7", 0, end, 1)
    return content[:end] + record + locator + content[end:]


NAME = b"README.txt"
HOSTILE_BYTES = {
    "encrypted": patched(8, 1),
    "strongly encrypted": patched(8, 0x41),
    "sizes behind the content": patched(8, 8),
    "names of another encoding": patched(8, 0x2000),
    "compressed by LZMA": patched(10, 14),
    "a method that nobody knows": patched(10, 99),
    "on a second disk": patched(34, 1),
    "sizes of 64 bits": patched(20, 0xFFFFFFFF, "<L"),
    "a place of 64 bits": patched(42, 0xFFFFFFFF, "<L"),
    "a list of 64 bits": with_zip64_end,
    "another count of files": patched(8, 2, at=b"PK\5\6"),
    "no files": patched(10, 0, at=b"PK\5\6"),
    "a list elsewhere": patched(16, 7, "<L", at=b"PK\5\6"),
    "a program before it": lambda content: bytearray(b"#!/bin/sh\n") + content,
    "a zip in its tail": lambda content: content + content,
    "a remark": lambda content: content[:-2] + b"\4\0evil",
    "a zero in a name": renamed(NAME, b"README.tx\0"),
    "a path of two halves": renamed(NAME, b"README.\0/x"),
    "a name that turns around": renamed(NAME, "RE\u202etxt12".encode()[:10]),
    "bytes that are no text": renamed(NAME, b"README.t\xff\xfe"),
    "a tilde": renamed(NAME, b"~/.profile"),
    "a network path": renamed(NAME, b"//host/abc"),
    "a stream of Windows": renamed(NAME, b"README:evl"),
    "a device": renamed(NAME, b"COM1.x.txt"),
    "another device": renamed(NAME, "com¹.txtx".encode()[:10]),
    "a point at the end": renamed(NAME, b"README.tx."),
    "another name in the list": patched(46, 0x41, "<B"),
    "a link": patched(38, (stat.S_IFLNK | 0o777) << 16, "<L"),
    "a folder": patched(38, (stat.S_IFDIR | 0o777) << 16, "<L"),
}


@pytest.mark.parametrize("kind", HOSTILE_BYTES)
def test_any_other_bytes_are_refused(path, kind, tmp_path):
    path.write_bytes(HOSTILE_BYTES[kind](bytearray(path.read_bytes())))
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises((ConfigError, StoreError), match="nothing is read"):
        Archive(path)
    assert sorted(tmp_path.rglob("*")) == before


def test_an_archive_in_an_archive_is_a_file_of_no_result(path, tmp_path):
    write_archive(tmp_path / "outer.zip", {"study.zip": path.read_bytes()}, {"results": {"a": {}}})
    assert "nothing is read" in command("check", tmp_path / "outer.zip", code=2).stderr


def test_a_name_twice_is_refused(path):
    with pytest.warns(UserWarning, match="Duplicate"):
        rewritten(path, put("README.txt"))
    with pytest.raises(ConfigError, match="twice"):
        Archive(path)


def test_a_bomb_is_refused_before_it_grows(path):
    def bomb(entries):
        for n in range(3):
            entries.append((zipfile.ZipInfo(f"results/a/zeros{n}.csv"), bytes(50_000_000)))

    rewritten(path, bomb, compress_type=zipfile.ZIP_DEFLATED)
    assert path.stat().st_size < 200_000
    with pytest.raises(ConfigError, match="is compressed"):
        Archive(path)


def test_sizes_that_lie_are_refused(path):
    content = bytearray(path.read_bytes())
    place = content.index(b"PK\1\2")
    for offset, value in ((20, 2**31), (24, 2**31), (24, 3), (42, 7), (8, 1)):  # sizes, place, flags
        changed = bytearray(content)
        struct.pack_into("<L" if offset != 8 else "<H", changed, place + offset, value)
        path.write_bytes(changed)
        with pytest.raises(ConfigError, match="nothing is read"):
            Archive(path)


def test_overlapping_entries_are_refused(path):
    """As in a bomb whose entries share their content."""
    content = bytearray(path.read_bytes())
    first = content.index(b"PK\1\2")
    second = content.index(b"PK\1\2", first + 4)
    content[second + 42 : second + 46] = content[first + 42 : first + 46]
    path.write_bytes(content)
    with pytest.raises(ConfigError, match="does not lie where"):
        Archive(path)


def test_more_files_than_the_limit_are_refused_before_they_are_listed(path, monkeypatch):
    monkeypatch.setattr(archive, "MAX_FILES", 3)
    with pytest.raises(ConfigError, match="the limit is 3"):
        Archive(path)
    with pytest.raises(ConfigError, match="the limit is 3"):
        write_archive(path.with_name("t.zip"), CONTENTS, {})
    monkeypatch.setattr(archive, "MAX_FILES", 9)
    monkeypatch.setattr(archive, "MAX_FILE_BYTES", 299)
    with pytest.raises(ConfigError, match="too large"):
        Archive(path)
    with pytest.raises(ConfigError, match=r"T5\.sums: has 300 bytes, the limit is 299"):
        write_archive(path.with_name("t.zip"), CONTENTS, {})
    assert not path.with_name("t.zip").exists()


def test_every_altered_byte_and_every_truncation_is_noticed(path, tmp_path):
    """But the date, the versions and the rights of an entry, on which nothing depends."""
    good, draw = path.read_bytes(), random.Random(1)
    changed = tmp_path / "c.zip"
    for place in draw.sample(range(len(good)), 300):
        changed.write_bytes(good[:place] + bytes([good[place] ^ (1 << draw.randrange(8))]) + good[place + 1 :])
        try:
            assert opened(changed) == CONTENTS
        except RadarsimError:
            continue
        nearest = max(good.rfind(b"PK\3\4", 0, place), good.rfind(b"PK\1\2", 0, place + 1))
        assert place - nearest < 46, place
    for length in [*range(60), *draw.sample(range(60, len(good)), 60)]:
        changed.write_bytes(good[:length])
        with pytest.raises(ConfigError):
            Archive(changed)
    changed.write_bytes(good + b"\0")
    with pytest.raises(ConfigError):
        Archive(changed)


def test_a_changed_file_with_a_right_checksum_is_named(path):
    def alter(entries):
        entries[2] = entries[2][0], entries[2][1][:-1] + b"1"

    rewritten(path, alter)
    with pytest.raises(StoreError, match=r"damaged or altered: results/\.blocks/ab12/T5\.sums is not what"):
        Archive(path)


@pytest.mark.parametrize("name", ["../up", "/abs", "a/../b", "a\\b", ".hidden", "con.csv", "a.", "a ", "é" * 150])
def test_no_such_name_is_written(tmp_path, name):
    with pytest.raises(ConfigError, match="no path of a file"):
        write_archive(tmp_path / "t.zip", {name: b""}, {})
    assert not list(tmp_path.iterdir())


def test_only_an_archive_is_replaced(path, tmp_path):
    thesis = tmp_path / "thesis.zip"
    thesis.write_text("ten years")
    with pytest.raises(ConfigError, match="is no archive, and is not replaced"):
        write_archive(thesis, CONTENTS, {})
    assert thesis.read_text() == "ten years"
    write_archive(path, {"b": b""}, {})
    assert opened(path) == {"b": b""}


def test_a_full_disk_leaves_the_old_archive(path, monkeypatch):
    old = path.read_bytes()

    def full(descriptor):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StoreError, match="No space left"):
        write_archive(path, {"b": b""}, {})
    assert path.read_bytes() == old
    assert [file.name for file in path.parent.iterdir()] == ["s.zip"]


def test_what_is_no_file_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "p.zip")
    (tmp_path / "d.zip").mkdir()
    for name, words in (("p", "no regular file"), ("d", "no regular file|Is a directory"), ("none", "no such file")):
        with pytest.raises(RadarsimError, match=words):
            Archive(tmp_path / f"{name}.zip")


def test_a_list_of_millions_is_refused_before_it_is_read(tmp_path, monkeypatch):
    """A zip that says of itself that it lists 65,534 files, as bombs of memory do."""
    monkeypatch.setattr(zipfile, "ZipFile", lambda *_: pytest.fail("read"))
    size = 65_534 * 50
    end = struct.pack("<4s4H2LH", b"PK\5\6", 0, 0, 65_534, 65_534, size, 0, 0)
    (tmp_path / "m.zip").write_bytes(bytes(size) + end)
    with pytest.raises(ConfigError, match="lists 65,534 files"):
        Archive(tmp_path / "m.zip")
