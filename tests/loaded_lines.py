"""How many lines of radarsim a command or a script imports, and how many of them lie in modules that ran nothing.

python -m tests.loaded_lines COMMAND…      of `radarsim COMMAND…`: its output, then the modules, then the sums
python -m tests.loaded_lines --sums STEM   of the way from a config to its merged sums, without results and reports

A module ran nothing if none of its functions was called after it was imported."""

import json
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

FUNCTION = 1  # the flag of a function's code: that of a module or a class has it not


class LoadedModule(NamedTuple):
    """A module of radarsim that a process has imported: its lines, and whether a function of it was called."""

    name: str
    lines: int
    has_run: bool


def loaded_modules(run: Callable[[], object]) -> list[LoadedModule]:
    """The modules that the process has imported after a function ran, by name."""
    files = set()

    def note_call(frame: FrameType, event: str, _: Any) -> None:
        if event == "call" and frame.f_code.co_flags & FUNCTION:
            files.add(frame.f_code.co_filename)

    threading.setprofile(note_call)
    sys.setprofile(note_call)
    try:
        run()
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    return [LoadedModule(name, len(Path(file).read_bytes().splitlines()), file in files) for name, file in _files()]


def _files() -> Iterator[tuple[str, str]]:
    for name, module in sorted(sys.modules.items()):
        file = getattr(module, "__file__", None)
        if name.partition(".")[0] == "radarsim" and file:
            yield name, file


def run_command(words: Sequence[str]) -> None:
    """Run `radarsim` with these words."""
    from radarsim.cli import main

    main(list(words), standalone_mode=False)


def sum_config(stem: str) -> None:
    """Simulate the cases of a config, 2000 realisations each, to merged sums."""
    from radarsim.api.configs import load
    from radarsim.api.simulate_cases import RunOptions, simulate

    simulated = simulate(load(stem, {"realisations": 2000}), RunOptions(threads=1))
    assert all(sums.count == 2000 for _, _, sums in simulated.cases)


if __name__ == "__main__":
    words = sys.argv[1:]
    modules = loaded_modules(lambda: sum_config(words[1]) if words[0] == "--sums" else run_command(words))
    idle = sum(module.lines for module in modules if not module.has_run)
    total = (
        f"{sum(module.lines for module in modules)} lines in {len(modules)} modules, {idle} in those that ran nothing"
    )
    lines = [f"{module.lines:6d} {'ran' if module.has_run else '-':3s} {module.name}" for module in modules]
    sys.stdout.write("\n".join([*lines, total, ""]))
    sys.stderr.write(f"{json.dumps(modules)}\n")
