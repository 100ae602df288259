"""A study in one file: a zip archive that is written in one way, and checked as a whole before any of it is used.

Its first entry, manifest.json, lists every other entry with its size and SHA-256. Entries are stored, not compressed,
with a fixed date and mode: so the bytes depend only on the contents, and an archive cannot grow when it is opened. A
zip of any other kind is refused: compressed or encrypted entries, links, folders, comments, paths that lead outside,
names that are the same file on some system, entries that overlap, bytes between them."""

import hashlib
import json
import os
import re
import stat
import struct
import unicodedata
import zipfile
from collections.abc import Iterable, Mapping, Sequence
from io import BufferedReader
from pathlib import Path
from typing import Any, Self

from radarsim.errors import ConfigError, StoreError, count_text
from radarsim.report import atomic_files, provenance
from radarsim.system.private_files import create_private_file, make_private_folder

SUFFIX = ".zip"
FORMAT = "radarsim study 1"
MANIFEST = "manifest.json"
MAX_FILES = 20_000
MAX_NAME_BYTES = 200
MAX_FILE_BYTES = 256 * 2**20
MAX_TOTAL_BYTES = 2**30
MAX_MANIFEST_BYTES = 16 * 2**20
BLOCKS_FOLDER = ".blocks"  # the only name that may begin with a dot

DATE = (1980, 1, 1, 0, 0, 0)  # the earliest that a zip can hold
MODE = stat.S_IFREG | 0o644
UNIX = 3
PART = re.compile(r"\w(?:[\w+=. -]*[\w+=-])?")  # of a path
PORTS = (*map(str, range(10)), *"¹²³")
DEVICES = {"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in PORTS)}  # of Windows

END = struct.Struct("<4s4H2LH")  # end of the central directory
ENTRY_BYTES = 46  # of the central directory, before the name
HEADER = struct.Struct("<4s5H3L2H")  # before an entry's name and content
UTF8_FLAG = 0x800


def write_archive(path: str | os.PathLike[str], contents: Mapping[str, bytes], facts: Mapping[str, Any]) -> str:
    """Write an archive of files (path in it: bytes), whole or not at all; facts go into its manifest. Its SHA-256.

    An archive of that name is replaced, any other file is not. Raises ConfigError for contents that `Archive` would
    refuse, StoreError where it cannot be written."""
    if faults := [*_name_faults((MANIFEST, *contents)), *_size_faults(contents)]:
        raise ConfigError(*(f"{path}: {fault}; nothing is written" for fault in faults))
    if os.path.exists(path) and not (os.path.isfile(path) and zipfile.is_zipfile(path)):
        raise ConfigError(f"{path}: is no archive, and is not replaced")
    manifest = {"format": FORMAT, **facts, "files": {name: _entry(contents[name]) for name in sorted(contents)}}
    with (
        atomic_files.OutputFile(path, durable=True) as writer,
        zipfile.ZipFile(writer.binary, "w", zipfile.ZIP_STORED, allowZip64=False) as archive,
    ):
        for name, content in ((MANIFEST, provenance.to_json(manifest)), *sorted(contents.items())):
            info = zipfile.ZipInfo(name, DATE)
            info.create_system, info.external_attr = UNIX, MODE << 16
            archive.writestr(info, content)
    atomic_files.sweep(Path(path))
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _entry(content: bytes) -> dict[str, Any]:
    """What the manifest says of a file."""
    return {"bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}


def _size_faults(contents: Mapping[str, bytes]) -> list[str]:
    """Why contents are more than an archive holds."""
    faults = [
        f"{name}: has {count_text(len(content))} bytes, the limit is {count_text(MAX_FILE_BYTES)}"
        for name, content in contents.items()
        if len(content) > MAX_FILE_BYTES
    ]
    total = sum(map(len, contents.values()))
    if total > MAX_TOTAL_BYTES:
        faults.append(f"has {count_text(total)} bytes, the limit is {count_text(MAX_TOTAL_BYTES)}")
    return faults


def _name_faults(names: Sequence[str]) -> list[str]:
    """Why names are not those of files in an archive."""
    limit = f"the limit is {count_text(MAX_FILES)}"
    faults = [f"has {count_text(len(names))} files, {limit}"] if len(names) > MAX_FILES else []
    faults += [f"{name!r}: is no path of a file in an archive" for name in names if not _is_safe(name)]
    folded_names: set[str] = set()
    for name in names:
        folded = unicodedata.normalize("NFC", name).casefold()
        if folded in folded_names:
            faults.append(f"{name!r}: is there twice, or as the same file on some systems")
        folded_names.add(folded)
    folders = {folded.rpartition("/")[0] for folded in folded_names}
    faults += [f"{name!r}: is a file and a folder" for name in folded_names & folders]
    return faults


def _is_safe(name: str) -> bool:
    """Whether a name leads, on every system, to a plain file inside the folder in which an archive is unpacked."""
    try:
        size = len(name.encode())
    except UnicodeEncodeError:
        return False
    parts = [part for part in name.split("/") if part != BLOCKS_FOLDER]
    return size <= MAX_NAME_BYTES and all(
        PART.fullmatch(part) and part.partition(".")[0].strip().casefold() not in DEVICES for part in parts
    )


class Archive:
    """An archive that `write_archive` wrote, checked to the last byte; open as long as the context.

    facts: the manifest without the list of files; names: the files, without the manifest; sha256: of the archive.
    Raises ConfigError for any other file, StoreError where contents differ from the manifest."""

    def __init__(self, path: str | os.PathLike[str]):
        self.path = Path(path)
        self._file = _open_regular(self.path)
        try:
            self._check()
        except BaseException:
            self._file.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def _check(self) -> None:
        infos = self._entries()
        if not infos or infos[0].filename != MANIFEST or infos[0].file_size > MAX_MANIFEST_BYTES:
            raise self._refusal(f"its first entry is no {MANIFEST}")
        self.facts, self._files = self._manifest(self._content(MANIFEST))
        self.names = tuple(info.filename for info in infos[1:])
        if {*self.names} != {*self._files}:
            odd = sorted({*self.names} ^ {*self._files})
            raise self._refusal(f"{MANIFEST} and the entries differ: {odd[0]!r}")
        for name in self.names:
            self.read(name)
        self._file.seek(0)
        self.sha256 = hashlib.file_digest(self._file, "sha256").hexdigest()

    def read(self, name: str) -> bytes:
        """The content of a file. Raises StoreError where it is not that of the manifest."""
        content = self._content(name)
        if _entry(content) != self._files[name]:
            raise StoreError(f"{self.path}: damaged or altered: {name} is not what {MANIFEST} says; nothing is read")
        return content

    def extract(self, folder: Path, names: Iterable[str]) -> None:
        """Write files, for the user alone, below a folder in which there is nothing yet."""
        for name in names:
            content = self.read(name)
            make_private_folder((folder / name).parent)
            with create_private_file(folder / name) as file:
                file.write(content)

    def _content(self, name: str) -> bytes:
        try:
            return self._zip.read(name)
        except (zipfile.BadZipFile, EOFError) as error:
            raise StoreError(f"{self.path}: damaged or altered: {name}: {error}; nothing is read") from error

    def _manifest(self, content: bytes) -> tuple[dict[str, Any], dict[str, Any]]:
        """The facts of a manifest, and its list of files."""
        try:
            manifest = json.loads(content)
            provenance.to_json(manifest)  # ValueError for content that `write_archive` never writes, such as NaN
            files, kind = manifest.pop("files"), manifest.pop("format")
        except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
            raise self._refusal(f"its {MANIFEST} cannot be read") from error
        if kind != FORMAT:
            raise self._refusal(f"its format is {str(kind)[:40]!r}, this program reads {FORMAT!r}")
        if not isinstance(files, dict):
            raise self._refusal(f"its {MANIFEST} lists no files")
        return manifest, files

    def _refusal(self, reason: str) -> ConfigError:
        return ConfigError(f"{self.path}: not as `radarsim pack` writes it: {reason}; nothing is read")

    def _entries(self) -> list[zipfile.ZipInfo]:
        """The entries of the archive, each checked by itself and to lie where the one before ends."""
        size = self._file.seek(0, os.SEEK_END)
        count, directory_size, directory = self._directory_end(size)
        if count > MAX_FILES or directory_size > count * (ENTRY_BYTES + MAX_NAME_BYTES):
            raise self._refusal(f"it lists {count_text(count)} files, the limit is {count_text(MAX_FILES)}")
        try:
            self._zip = zipfile.ZipFile(self._file)
        except (zipfile.BadZipFile, NotImplementedError, ValueError, struct.error) as error:
            raise self._refusal(str(error)) from error
        infos = self._zip.infolist()
        if len(infos) != count:
            raise self._refusal("it does not list as many files as it says")
        if faults := _name_faults([info.orig_filename for info in infos]):
            raise self._refusal(faults[0])
        offset = 0
        for info in infos:
            offset = self._checked_end(info, offset)
        if offset != directory:
            raise self._refusal("there are bytes before its list of files")
        if sum(info.file_size for info in infos) > MAX_TOTAL_BYTES + MAX_MANIFEST_BYTES:
            raise self._refusal(f"it holds over {count_text(MAX_TOTAL_BYTES)} bytes")
        return infos

    def _directory_end(self, size: int) -> tuple[int, int, int]:
        """The number of entries, and size and place of their list, which ends where the file does."""
        self._file.seek(max(0, size - END.size))
        tail = self._file.read(END.size)
        if len(tail) < END.size or not tail.startswith(b"PK\5\6"):
            raise self._refusal("it is no zip archive, or a part of one, or has something behind it")
        _, disk, first_disk, here, count, directory_size, directory, comment = END.unpack(tail)
        if disk or first_disk or comment or here != count or directory + directory_size + END.size != size:
            raise self._refusal("the end of its list of files is not in its place")
        return count, directory_size, directory

    def _checked_end(self, info: zipfile.ZipInfo, offset: int) -> int:
        """Where an entry ends that begins at an offset. Raises ConfigError where `write_archive` writes none such."""
        name = info.orig_filename
        mode = info.external_attr >> 16
        if stat.S_ISLNK(mode) or stat.S_IFMT(mode) not in (0, stat.S_IFREG) or info.is_dir():
            raise self._refusal(f"{name!r}: is a link or no regular file")
        if info.compress_type != zipfile.ZIP_STORED or info.compress_size != info.file_size:
            raise self._refusal(f"{name!r}: is compressed")
        has_more_fields = info.flag_bits & ~UTF8_FLAG or info.extra or info.comment or info.volume
        if has_more_fields or info.file_size > MAX_FILE_BYTES:
            raise self._refusal(f"{name!r}: is encrypted, too large or has fields that are not read")
        self._file.seek(offset)
        header = self._file.read(HEADER.size)
        encoded = name.encode("utf-8" if info.flag_bits & UTF8_FLAG else "cp437")
        size, name_size = info.file_size, len(encoded)
        expected = (b"PK\3\4", info.flag_bits, info.compress_type, info.CRC, size, size, name_size, 0)
        if len(header) == HEADER.size and info.header_offset == offset:
            magic, _, flags, method, _, _, *numbers = HEADER.unpack(header)
            if (magic, flags, method, *numbers) == expected:
                return offset + HEADER.size + name_size + size
        raise self._refusal(f"{name!r}: does not lie where the list of files says, or overlaps another")


def _open_regular(path: Path) -> BufferedReader:
    """A regular file, opened to read. Raises ConfigError for anything else, without waiting for a pipe."""
    try:
        descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    except FileNotFoundError as error:
        raise ConfigError(f"{path}: no such file") from error
    except OSError as error:
        raise StoreError(f"{path}: cannot be read: {error.strerror}") from error
    if not stat.S_ISREG(os.fstat(descriptor).st_mode):
        os.close(descriptor)
        raise ConfigError(f"{path}: is no regular file")
    return open(descriptor, "rb")
