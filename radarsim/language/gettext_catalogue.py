"""Gettext catalogues, `<code>.po`, read and compiled in memory for the standard library."""

import ast
import io
import re
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

MAGIC = 0x950412DE  # of a compiled catalogue
CONTEXT_ENDS, NEXT_FORM = "\x04", "\x00"
LINE = re.compile(r'(?:(msgctxt|msgid|msgid_plural|msgstr|msgstr\[(\d)\])\s+)?(".*")')


@dataclass
class Entry:
    """A message: its context, its text, its plural, and their translations, one for each form of the plural."""

    id: str = ""
    context: str = ""
    plural: str = ""
    translations: dict[int, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    @property
    def key(self) -> tuple[str, str]:
        """Its key in the catalogue."""
        return self.context, self.id

    @property
    def is_translated(self) -> bool:
        """Whether it is translated, in all its forms."""
        return bool(self.translations) and all(self.translations.values())


def entries(text: str) -> list[Entry]:
    """The entries of a catalogue, including the header. Raises ValueError, with the line, for any other file."""
    blocks: list[list[tuple[int, str]]] = [[]]
    for number, line in enumerate(text.splitlines(), 1):
        if line.strip():
            blocks[-1].append((number, line))
        elif blocks[-1]:
            blocks.append([])
    return [entry for block in blocks if (entry := _entry(block)) is not None]


def _entry(block: Iterable[tuple[int, str]]) -> Entry | None:
    entry, keyword, empty = Entry(), "", True
    for number, line in block:
        if line.startswith("#"):
            entry.notes.append(line)
            continue
        match = LINE.fullmatch(line.strip())
        if match is None:
            raise ValueError(f"line {number}: no line of a catalogue: {line}")
        keyword, empty = match[1] or keyword, False
        try:
            piece = ast.literal_eval(match[3])
        except SyntaxError as error:
            raise ValueError(f"line {number}: {error.msg}: {line}") from error
        if keyword == "msgctxt":
            entry.context += piece
        elif keyword == "msgid":
            entry.id += piece
        elif keyword == "msgid_plural":
            entry.plural += piece
        else:
            form = int(keyword[7:-1]) if "[" in keyword else 0
            entry.translations[form] = entry.translations.get(form, "") + piece
    return None if empty else entry


def compile_catalogue(catalogue_entries: Iterable[Entry]) -> io.BytesIO:
    """The translated entries as a compiled catalogue (GNU gettext manual, "The Format of GNU MO Files")."""
    pairs = sorted(_pair(entry) for entry in catalogue_entries if entry.is_translated)
    ids, translated = [identifier for identifier, _ in pairs], [translation for _, translation in pairs]
    tables, content = b"", b""
    start = 28 + 16 * len(pairs)
    for text in (*ids, *translated):
        tables += struct.pack("<II", len(text), start + len(content))
        content += text + b"\x00"
    head = struct.pack("<7I", MAGIC, 0, len(pairs), 28, 28 + 8 * len(pairs), 0, start)
    return io.BytesIO(head + tables + content)


def _pair(entry: Entry) -> tuple[bytes, bytes]:
    name = f"{entry.context}{CONTEXT_ENDS}{entry.id}" if entry.context else entry.id
    if entry.plural:
        name += NEXT_FORM + entry.plural
    return name.encode(), NEXT_FORM.join(text for _, text in sorted(entry.translations.items())).encode()


def catalogue_text(catalogue_entries: Iterable[Entry]) -> str:
    """Entries as the text of a catalogue."""
    return "\n".join("\n".join(_lines(entry)) + "\n" for entry in catalogue_entries)


def _lines(entry: Entry) -> Iterator[str]:
    yield from entry.notes
    if entry.context:
        yield f"msgctxt {_quoted(entry.context)}"
    yield f"msgid {_quoted(entry.id)}"
    if entry.plural:
        yield f"msgid_plural {_quoted(entry.plural)}"
        yield from (f"msgstr[{form}] {_quoted(text)}" for form, text in sorted(entry.translations.items()))
    else:
        yield f"msgstr {_quoted(entry.translations.get(0, ''))}"


def _quoted(text: str) -> str:
    """A text in quotes; one of several lines as several."""
    marks = str.maketrans({"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t"})
    lines = text.splitlines(keepends=True)
    if len(lines) < 2:
        return f'"{text.translate(marks)}"'
    return "\n".join(['""', *(f'"{line.translate(marks)}"' for line in lines)])
