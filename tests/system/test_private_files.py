"""Files that belong to the user alone: how they are created, and which ones are trusted, by owner, mode and kind."""

import errno
import os
import stat
from pathlib import Path
from types import SimpleNamespace

import pytest

from radarsim.system import private_files
from radarsim.system.private_files import (
    UntrustedFileError,
    create_private_file,
    distrust_reason,
    make_private_folder,
    make_trusted_folder,
    read_trusted,
    write_private_file,
)

pytestmark = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="no user numbers here")
as_root = pytest.mark.skipif(hasattr(os, "geteuid") and os.geteuid() != 0, reason="gives files to other users")
USER, OTHER, ROOT = 1234, 4321, 0


@pytest.fixture(params=[0o000, 0o022, 0o777], ids=oct)
def umask(request):
    before = os.umask(request.param)
    yield request.param
    os.umask(before)


def mode(path):
    return stat.S_IMODE(path.lstat().st_mode)


def test_what_is_created_is_private_whatever_the_umask(tmp_path, umask):
    make_private_folder(tmp_path / "a/b/c")
    assert [mode(tmp_path / name) for name in ("a", "a/b", "a/b/c")] == [0o700] * 3
    for _ in range(2):
        write_private_file(tmp_path / "a/file", b"content")
    with create_private_file(tmp_path / "a/other") as file:
        file.write(b"more")
    assert sorted(
        (path.name, mode(path), path.read_bytes()) for path in (tmp_path / "a").iterdir() if path.is_file()
    ) == [("file", 0o600, b"content"), ("other", 0o600, b"more")]


def test_what_exists_is_left_as_it_is(tmp_path):
    (tmp_path / "shared").mkdir()
    (tmp_path / "shared").chmod(0o775)
    make_private_folder(tmp_path / "shared")
    make_private_folder(tmp_path / "shared/inner")
    assert (mode(tmp_path / "shared"), mode(tmp_path / "shared/inner")) == (0o775, 0o700)
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    for name in ("file", "link"):
        with pytest.raises(FileExistsError):
            make_private_folder(tmp_path / name)
        with pytest.raises(FileExistsError):
            create_private_file(tmp_path / name)
    with pytest.raises(NotADirectoryError):
        make_private_folder(tmp_path / "file/inner")
    assert not (tmp_path / "nowhere").exists()


def test_a_folder_that_exists_and_takes_none_ends_in_an_error(tmp_path, monkeypatch):
    """As /proc does, and the folder of homes where each is mounted when it is first used."""
    mkdir = Path.mkdir

    def refuse(path, *arguments, **options):
        if path.parent == tmp_path:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), str(path))
        mkdir(path, *arguments, **options)

    monkeypatch.setattr(Path, "mkdir", refuse)
    for name in ("folder", "folder/inner"):
        with pytest.raises(FileNotFoundError):
            make_private_folder(tmp_path / name)


def test_a_file_that_cannot_be_written_leaves_nothing_behind(tmp_path):
    (tmp_path / "folder/inner").mkdir(parents=True)
    with pytest.raises(OSError, match="folder"):
        write_private_file(tmp_path / "folder", b"content")
    assert [path.name for path in tmp_path.iterdir()] == ["folder"]


@as_root
@pytest.mark.parametrize("kind", ["file", "folder"])
@pytest.mark.parametrize(
    ("owner", "bits", "reason"),
    [
        (USER, 0o700, None),
        (USER, 0o755, None),
        (ROOT, 0o755, None),
        (OTHER, 0o700, "belongs to another user (4321)"),
        (OTHER, 0o777, "belongs to another user (4321)"),
        (USER, 0o722, "can be written by every user"),
        (USER, 0o1777, "can be written by every user"),
        (ROOT, 0o702, "can be written by every user"),
        (USER, 0o770, "can be written by other users (group 50)"),
        (ROOT, 0o720, "can be written by other users (group 50)"),
    ],
)
def test_trust_by_owner_and_mode(tmp_path, monkeypatch, owner, bits, reason, kind):
    """The entry itself, and a file below the folder, for a user who is not root."""
    monkeypatch.setattr(os, "geteuid", lambda: USER)
    entry = tmp_path / "entry"
    if kind == "folder":
        entry.mkdir()
        (entry / "inner").write_bytes(b"content")
    else:
        entry.write_bytes(b"content")
    os.chown(entry, owner, 50)
    entry.chmod(bits)
    assert distrust_reason(entry) == reason
    file = entry / "inner" if kind == "folder" else entry
    if kind == "folder":
        reason = reason and f"lies in {entry}, which {reason}"
        reason = None if bits & stat.S_ISVTX else reason  # as /tmp: others cannot replace what is the user's
        assert distrust_reason(file) == reason
        assert distrust_reason(entry / "not/yet/there") == reason
    if reason is None:
        assert read_trusted(file) == b"content"
    else:
        with pytest.raises(UntrustedFileError) as error:
            read_trusted(file)
        assert (error.value.strerror, error.value.filename) == (reason, str(file))


@as_root
def test_a_folder_is_made_only_where_nobody_else_can_replace_it(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: USER)
    make_trusted_folder(tmp_path / "a/b")
    make_trusted_folder(tmp_path / "a/b")
    (tmp_path / "a").chmod(0o777)
    for path in (tmp_path / "a/b", tmp_path / "a/c"):
        with pytest.raises(UntrustedFileError, match="can be written by every user"):
            make_trusted_folder(path)
    assert [path.name for path in (tmp_path / "a").iterdir()] == ["b"]
    (tmp_path / "a").chmod(0o1777)
    make_trusted_folder(tmp_path / "a/c")


@as_root
def test_links_are_trusted_by_their_owner_and_where_they_lead(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "geteuid", lambda: USER)
    monkeypatch.chdir(tmp_path)
    for name in ("safe", "open"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "file").write_bytes(b"content")
    (tmp_path / "open").chmod(0o777)
    (tmp_path / "safe/link").symlink_to("../safe/file")
    (tmp_path / "safe/leads_out").symlink_to(tmp_path / "open")
    (tmp_path / "round").symlink_to("round")
    assert read_trusted("safe/link") == read_trusted("safe/../safe/file") == b"content"
    assert distrust_reason(tmp_path / "safe/leads_out") == "can be written by every user"
    assert distrust_reason("safe/leads_out/file") == f"lies in {tmp_path / 'open'}, which can be written by every user"
    os.lchown(tmp_path / "safe/link", OTHER, OTHER)
    link = f"is reached by the symbolic link {tmp_path / 'safe/link'}, which belongs to another user ({OTHER})"
    assert distrust_reason("safe/link") == link
    with pytest.raises(OSError, match="symbolic links"):
        distrust_reason("round")


def test_what_is_the_users_own_is_read(tmp_path):
    write_private_file(tmp_path / "file", b"content")
    assert read_trusted(tmp_path / "file") == b"content"
    assert distrust_reason(tmp_path / "missing") is distrust_reason(tmp_path / "file/inner") is None
    for path in (tmp_path / "missing", tmp_path / "file/inner"):
        with pytest.raises(OSError, match=path.name):
            read_trusted(path)
    (tmp_path / "file").chmod(0o602)
    with pytest.raises(UntrustedFileError):
        read_trusted(tmp_path / "file")


def test_files_of_somebody_else_are_not_trusted(tmp_path, monkeypatch):
    """For root and for anybody else: after the files were made, the process is another user."""
    write_private_file(tmp_path / "file", b"content")
    monkeypatch.setattr(private_files, "ROOT_USER", USER)
    monkeypatch.setattr(os, "geteuid", lambda: USER)
    assert "belongs to another user" in distrust_reason(tmp_path / "file")


@as_root
@pytest.mark.parametrize(
    ("name", "members", "trusted"), [("ann", [], True), ("ann", ["bob"], False), ("staff", [], False)]
)
def test_a_group_of_the_user_alone_is_nobody_else(tmp_path, monkeypatch, name, members, trusted):
    """As Debian, Ubuntu, Fedora and Red Hat set users up, with a umask of 002."""
    monkeypatch.setattr(os, "geteuid", lambda: USER)
    monkeypatch.setattr("pwd.getpwuid", lambda user: SimpleNamespace(pw_name="ann", pw_gid=USER))
    monkeypatch.setattr("grp.getgrgid", lambda group: SimpleNamespace(gr_name=name, gr_mem=members))
    os.chown(tmp_path, USER, USER)
    tmp_path.chmod(0o775)
    assert (distrust_reason(tmp_path) is None) is trusted
    monkeypatch.setattr(os, "getxattr", lambda place, attribute: b"an access list", raising=False)
    assert distrust_reason(tmp_path) is not None


def test_where_users_have_no_numbers_every_path_is_trusted(tmp_path, monkeypatch):
    monkeypatch.delattr(os, "geteuid")
    (tmp_path / "file").write_bytes(b"content")
    (tmp_path / "file").chmod(0o666)
    assert distrust_reason(tmp_path / "file") is None
    assert read_trusted(tmp_path / "file") == b"content"
