"""Examples of a Markdown page, run in their order in one folder as a reader would.

    ```yaml      beginning `# NAME.yaml`: that file; beginning `# in NAME.yaml`: the same keys of that file changed
    ```console   lines `$ command`, each with what it prints; nothing below it: only that it ends well
    ```python    run, with names kept to the end of the page
    ```pycon     the same with `>>>` and what it gives

A line of output that is `…` alone stands for any lines. `<!-- slow -->` on the line before a block leaves it to the
slow tests. Other blocks (`text`, `sh`) are not run. `make docs-examples` writes what the commands print now into the
pages.
"""

import doctest
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import chdir
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

ROOT = Path(__file__).parents[2]
BLOCK = re.compile(r"^(<!-- slow -->\n)?```(yaml|console|python|pycon)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
ANYTHING = "…"


@dataclass(frozen=True)
class Block:
    """One example: its language, its text, the line of the page it begins on, and whether it takes long."""

    language: str
    text: str
    line: int
    slow: bool


class ExampleError(Exception):
    """An example that does not do what the page says."""


def blocks(page: str) -> list[Block]:
    """The examples of a page, in order."""
    matches = BLOCK.finditer(page)
    return [Block(match[2], match[3], page[: match.start(3)].count("\n") + 1, bool(match[1])) for match in matches]


def run(page: str, folder: Path, slow: bool) -> Iterator[tuple[Block, str]]:
    """Run a page's examples in a folder; each with its text as it would stand if written now."""
    names: dict = {}
    with chdir(folder):
        for block in blocks(page):
            if slow or not block.slow:
                try:
                    yield block, RUN[block.language](block.text, names)
                except ExampleError as failure:
                    raise ExampleError(f"line {block.line}: {failure}") from None


def yaml(text: str, names: dict) -> str:
    """Write the file that the first line names, or change the same keys in it."""
    first_line, _, other_lines = text.partition("\n")
    match re.fullmatch(r"# (in )?(\S+\.yaml)", first_line):
        case None:
            raise ExampleError(f"a yaml example begins `# NAME.yaml` or `# in NAME.yaml`, got {first_line!r}")
        case match if match[1]:
            file = Path(match[2])
            file.write_text(changed(file.read_text(encoding="utf-8"), other_lines), encoding="utf-8")
        case match:
            Path(match[2]).write_text(text, encoding="utf-8")
    return text


def changed(config: str, lines: str) -> str:
    """A config with the values of some lines `key: value`; lines without a value only say where these stand."""
    for key, value in re.findall(r"^ *(\w+): *([^\s#].*?)(?: +#.*)?$", lines, re.MULTILINE):
        config, count = re.subn(rf"(?m)^( *{key}: *)([^\s#]\S*)", lambda old, new=value: old[1] + new, config)
        if count != 1:
            raise ExampleError(f"{key} stands {count} times in the file")
    return config


def console(text: str, names: dict) -> str:
    """Run the commands; the block with their present output. Failed where that is not what stands there."""
    outputs = []
    for entry in re.split(r"^(?=\$ )", text, flags=re.MULTILINE)[1:]:
        command, expected = re.fullmatch(r"\$ ((?:[^\n]*\\\n)*[^\n]*)\n?(.*)", entry, re.DOTALL).groups()
        printed = output(command.replace("\\\n", ""))
        outputs.append(
            entry if not expected or agrees(expected, printed) else f"$ {command}\n{shortened(printed, expected)}"
        )
    return "".join(outputs)


def output(command: str) -> str:
    """What a command prints; radarsim's own in this process, which saves its start."""
    if command.startswith("radarsim "):
        import shlex

        from click.testing import CliRunner

        from radarsim.cli.command_group import main

        result = CliRunner().invoke(main, shlex.split(command)[1:])
        code, out, err = result.exit_code, result.stdout, result.stderr + (repr(result.exception) or "")
    else:
        done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
        code, out, err = done.returncode, done.stdout, done.stderr
    if code:
        raise ExampleError(f"`{command}` ends with {code}: {err}")
    return "\n".join(line.rstrip() for line in out.rstrip("\n").split("\n")) + "\n"


def agrees(expected: str, printed: str) -> bool:
    """Whether what was printed is what the page says, a line `…` standing for any lines."""
    parts = [re.escape(part) for part in re.split(rf"^{ANYTHING}\n", expected, flags=re.MULTILINE)]
    return re.fullmatch(r"(?:.*\n)*?".join(parts), printed) is not None


def shortened(printed: str, expected: str) -> str:
    """What was printed, cut where the page cuts it.

    A line `…` stands for all up to the line that has most of its first words in common with the page's next one.
    """
    lines, shown_lines, after_gap = printed.splitlines(), [], False
    for line in expected.splitlines():
        if line == ANYTHING:
            shown_lines.append(ANYTHING)
        elif lines:
            index = (
                max(range(len(lines)), key=[in_common(line, candidate) for candidate in lines].__getitem__)
                if after_gap
                else 0
            )
            shown_lines.append(lines[index])
            del lines[: index + 1]
        after_gap = line == ANYTHING
    return "\n".join(shown_lines if after_gap else shown_lines + lines) + "\n"


def in_common(line: str, other_line: str) -> int:
    """How many words two lines begin alike with."""
    return sum(takewhile(bool, (a == b for a, b in zip(line.split(), other_line.split(), strict=False))))


def python(text: str, names: dict) -> str:
    """Run a piece of Python."""
    exec(compile(text, "example", "exec"), names)
    return text


def pycon(text: str, names: dict) -> str:
    """Run a session; Failed where something else comes out."""
    test = doctest.DocTestParser().get_doctest(text, names, "example", None, 0)
    messages: list[str] = []
    if (
        doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE)
        .run(test, out=messages.append, clear_globs=False)
        .failed
    ):
        raise ExampleError("".join(messages))
    names.update(test.globs)
    return text


RUN = {"yaml": yaml, "console": console, "python": python, "pycon": pycon}


def rewritten(path: Path, folder: Path) -> bool:
    """Write what the commands of a page print now into it; whether that changed anything."""
    page = path.read_text(encoding="utf-8")
    new = page
    for block, text in run(page, folder, slow=True):
        new = new.replace(block.text, text, 1)
    path.write_text(new, encoding="utf-8")
    return new != page


if __name__ == "__main__":
    import tempfile

    os.environ.setdefault("COLUMNS", "110")
    for name in sys.argv[1:]:
        page = Path(name).resolve()
        with tempfile.TemporaryDirectory() as scratch:
            sys.stdout.write(f"{name}: {'changed' if rewritten(page, Path(scratch)) else 'as it was'}\n")
