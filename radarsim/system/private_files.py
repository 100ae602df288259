"""Files and folders to which only the user may write: to create them, and to tell what another user could have made.

What is read from a trusted path may be believed and run: the file and every folder and link on the way to it belong to
the user or to root, and nobody else may write to them. Folders such as /tmp, in which everybody may write but nobody
may replace what others put there (the sticky bit), are allowed on the way. Permission by access lists counts as well:
Linux shows it in the bits of the group. A group with the name of the user, who is its only member, is nobody else: many
systems give each user one, and let it write.

What is made to be handed on, such as results, others may read as the umask lets them, but nobody else may write to it.

Systems without user numbers (Windows) trust every path."""

import contextlib
import errno
import os
import stat
import uuid
from pathlib import Path
from typing import BinaryIO

MAX_LINKS = 40  # symbolic links on the way to a file, as many as Linux follows
ROOT_USER = 0
STALE_S = 600  # by how much the files of a killed process are older than the last change in their folder


class UntrustedFileError(PermissionError):
    """A file that another user could have made or changed; `strerror` says how."""


def is_stale(temporary: Path) -> bool:
    """Whether a temporary file is one that a killed process left. Raises OSError.

    Only times of files are compared: another machine may write them, or our clock may have been set."""
    return os.stat(temporary.parent).st_mtime - os.lstat(temporary).st_mtime > STALE_S


def make_private_folder(path: str | os.PathLike) -> None:
    """Create a folder, and those missing above it, for the user alone (0700) whatever the umask.

    Folders that exist keep their permissions. Raises OSError where one cannot be created."""
    folder = Path(path)
    try:
        _make_private_entry(folder)
    except FileNotFoundError:
        if folder.parent == folder:
            raise
        make_private_folder(folder.parent)
        _make_private_entry(folder)  # once: in /proc, or where homes are mounted, a folder that exists takes none


def make_trusted_folder(path: str | os.PathLike) -> None:
    """As `make_private_folder`; raises UntrustedFileError where another user may write to the folder or replace it."""
    _check_trust(path)
    make_private_folder(path)
    _check_trust(path)


def create_private_file(path: str | os.PathLike) -> BinaryIO:
    """A new file, open for writing, that the user alone may read and write (0600) whatever the umask.

    Raises FileExistsError where there is anything of that name, a symbolic link included."""
    file = open(path, "xb", opener=lambda name, flags: os.open(name, flags, 0o600))  # noqa: SIM115 (for the caller)
    if hasattr(os, "fchmod"):
        os.fchmod(file.fileno(), 0o600)
    return file


def write_private_file(path: str | os.PathLike, content: bytes, durable: bool = False) -> None:
    """Write a file that the user alone may read and write, whole or not at all; it replaces what has its name.

    durable: its content survives a power cut, once its folder is synchronised too. Raises OSError with this path."""
    target = Path(path)
    temporary = target.with_name(f".{target.name}.{uuid.uuid4().hex}.tmp")
    try:
        with create_private_file(temporary) as file:
            file.write(content)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        os.replace(temporary, target)
    except BaseException as error:
        with contextlib.suppress(OSError):
            temporary.unlink()
        if isinstance(error, OSError):
            error.filename, error.filename2 = str(target), None
        raise


def make_readable_folder(path: str | os.PathLike) -> None:
    """Create a folder, and those missing above it: others may read it if the umask lets them, but never write to it.

    Folders that exist keep their permissions. Raises OSError where one cannot be created."""
    folder = Path(path)
    for directory in (*reversed(folder.parents), folder):
        if not directory.is_dir():
            directory.mkdir(mode=0o755, exist_ok=True)


def create_readable_file(path: str | os.PathLike) -> BinaryIO:
    """A new file, open for writing: others may read it if the umask lets them, but never write to it.

    Raises FileExistsError where there is anything of that name, a symbolic link included."""
    return open(path, "xb", opener=lambda name, flags: os.open(name, flags, 0o644))


def foreign_owner(path: str | os.PathLike, named_by: str | os.PathLike | None = None) -> int | None:
    """The number of the user to whom a file belongs; None for this user, root, and the owner of the file that names it.

    Raises OSError where a file cannot be looked at."""
    if not hasattr(os, "geteuid"):
        return None
    owner = os.stat(path).st_uid
    trusted = {os.geteuid(), ROOT_USER} | (set() if named_by is None else {os.stat(named_by).st_uid})
    return None if owner in trusted else owner


def distrust_reason(path: str | os.PathLike) -> str | None:
    """Why a file or folder may not be trusted, as a phrase that follows its name; None where it may.

    Where it does not exist, the folders that do are judged. Raises OSError where they cannot be looked at."""
    try:
        return _follow(path)[1]
    except (FileNotFoundError, NotADirectoryError):
        return None


def entry_fault(place: Path, status: os.stat_result, on_the_way: bool = False) -> str | None:
    """Why a file or folder of this status may be in another user's hand, whatever leads to it; None if it is not.

    On the way to others, a folder with the sticky bit is not. This alone is for data that is checked when it is read,
    and run by nobody; what is run needs `distrust_reason`."""
    if not hasattr(os, "geteuid"):
        return None
    if reason := _owner_fault(status):
        return reason
    if on_the_way and status.st_mode & stat.S_ISVTX:
        return None
    if status.st_mode & stat.S_IWOTH:
        return "can be written by every user"
    if status.st_mode & stat.S_IWGRP and (_has_access_list(place) or not _is_private_group(status.st_gid)):
        return f"can be written by other users (group {status.st_gid})"
    return None


def read_trusted(path: str | os.PathLike) -> bytes:
    """The content of a file that nobody else can have written; raises UntrustedFileError for any other."""
    place, reason = _follow(path)
    if reason is None:
        # By the descriptor once more, and through no link: between the two looks another process may replace the file.
        flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0)
        with open(place, "rb", opener=lambda name, given: os.open(name, given | flags)) as file:
            reason = entry_fault(place, os.fstat(file.fileno()))
            if reason is None:
                return file.read()
    raise UntrustedFileError(errno.EPERM, reason, os.fspath(path))


def _make_private_entry(folder: Path) -> None:
    """Create a folder for the user alone in one that exists."""
    try:
        folder.mkdir(mode=0o700)
    except OSError:  # some systems refuse a folder that exists with another error than FileExistsError
        if not folder.is_dir():
            raise
    else:
        mode = folder.lstat().st_mode
        if mode & stat.S_IRWXU != stat.S_IRWXU:  # the umask took bits from the user
            folder.chmod(mode | stat.S_IRWXU)


def _check_trust(path: str | os.PathLike) -> None:
    if reason := distrust_reason(path):
        raise UntrustedFileError(errno.EPERM, reason, os.fspath(path))


def _follow(path: str | os.PathLike) -> tuple[Path, str | None]:
    """The place to which a path leads through its links, and why it, or anything on the way, may not be trusted.

    Raises FileNotFoundError or NotADirectoryError where there is nothing, after the folders that exist."""
    start = Path(path).absolute()
    if not hasattr(os, "geteuid"):
        return start, None
    place, parts, links = Path(start.anchor), list(reversed(start.parts[1:])), 0
    while parts:
        if reason := entry_fault(place, place.lstat(), on_the_way=True):
            return place, f"lies in {place}, which {reason}"
        part = parts.pop()
        entry = place.parent if part == ".." else place / part
        status = entry.lstat()
        if not stat.S_ISLNK(status.st_mode):
            place = entry
            continue
        if reason := _owner_fault(status):
            return place, f"is reached by the symbolic link {entry}, which {reason}"
        links += 1
        if links > MAX_LINKS:
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), os.fspath(path))
        target = Path(os.readlink(entry))
        parts += reversed(target.parts[1:] if target.is_absolute() else target.parts)
        place = Path(target.anchor) if target.is_absolute() else place
    return place, entry_fault(place, place.lstat())


def _owner_fault(status: os.stat_result) -> str | None:
    return None if status.st_uid in (os.geteuid(), ROOT_USER) else f"belongs to another user ({status.st_uid})"


def _is_private_group(group: int) -> bool:
    """Whether a group is the one that the system gave to this user alone: with the same name, and no other member."""
    if os.geteuid() == ROOT_USER:
        return False
    import grp
    import pwd

    try:
        user, entry = pwd.getpwuid(os.geteuid()), grp.getgrgid(group)
    except KeyError:
        return False
    return user.pw_gid == group and entry.gr_name == user.pw_name and set(entry.gr_mem) <= {user.pw_name}


def _has_access_list(place: Path) -> bool:
    """Whether Linux keeps an access list beside the permission bits; those of the group then bound the list's."""
    try:
        return bool(os.getxattr(place, "system.posix_acl_access"))
    except (AttributeError, OSError):  # another system, no list, or a file system without lists
        return False
