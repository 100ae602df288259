"""Run every planted fault on a copy of the tree: `python -m tests.trust.mutate [WORD…]`, those whose place has a WORD.

Prints a line each and ends with 1 if a fault survives. Nothing of the tree itself is touched; machine code goes into a
cache of the copy's own.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue

from tests.trust.mutant import Mutant
from tests.trust.mutants import ALL

ROOT = Path(__file__).parents[2]
TREE = ("radarsim", "tests", "configs", "scenarios", "docs", "pyproject.toml", "Makefile", "README.md")
CAUGHT, SURVIVED = 1, 0  # what pytest ends with where a test fails, and where none does


def copied(where: Path) -> Path:
    """A copy of what the tests need."""
    where.mkdir()
    for name in TREE:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(source, where / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy(source, where / name)
    return where


def outcome(mutant: Mutant, tree: Path) -> tuple[int, str]:
    """How pytest ended with the fault in place, and its last lines; the file is as it was afterwards."""
    file = tree / mutant.path
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace(mutant.original, mutant.mutated), encoding="utf-8")
    environment = {"PYTHONPATH": str(tree), "RADARSIM_CACHE_DIR": str(tree / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *mutant.tests]
    try:
        done = subprocess.run(
            command, cwd=tree, env=os.environ | environment, capture_output=True, text=True, check=False
        )
    finally:
        file.write_text(text, encoding="utf-8")
        shutil.rmtree(tree / "cache", ignore_errors=True)
    return done.returncode, done.stdout[-2000:] + done.stderr[-2000:]


def chosen(words: list[str]) -> list[Mutant]:
    """The faults whose path or text holds one of the words; all without words."""
    return [m for m in ALL if not words or any(word in f"{m.path} {m.original}" for word in words)]


def main(words: list[str]) -> int:
    workers, faults, lost = min(os.cpu_count() or 1, 4), chosen(words), []
    trees: SimpleQueue[Path] = SimpleQueue()

    def tried(mutant: Mutant) -> tuple[Mutant, int, str, float]:
        tree, begun = trees.get(), time.perf_counter()
        try:
            return mutant, *outcome(mutant, tree), time.perf_counter() - begun
        finally:
            trees.put(tree)

    with tempfile.TemporaryDirectory(prefix="radarsim-mutants-") as folder, ThreadPoolExecutor(workers) as pool:
        for i in range(workers):
            trees.put(copied(Path(folder) / str(i)))
        for mutant, code, output, seconds in pool.map(tried, faults):
            verdict = {CAUGHT: "caught", SURVIVED: "SURVIVED"}.get(code, f"pytest ended with {code}")
            line = f"{verdict:10} {seconds:5.0f} s  {mutant.path}: {mutant.original!r} -> {mutant.mutated!r}\n"
            sys.stdout.write(line if code == CAUGHT else line + output)
            sys.stdout.flush()
            lost += [mutant] if code != CAUGHT else []
    sys.stdout.write(f"{len(faults) - len(lost)} of {len(faults)} planted faults caught\n")
    return 1 if lost or not faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
