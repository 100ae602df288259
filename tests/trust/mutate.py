"""Wrong formulas that a test must notice: `python -m tests.trust.mutate [-n 40] [--seed 1] [WORD…]`, or `make mutants`.

Each mutant is a copy of the package with one operation of a kernel, an exact value or a statistic changed in the syntax
tree. A seeded sample of them is tried, each under the tests of its module, and those that no test notices are printed
with their place. Ends with 1 where more than one in ten survive. Some always do: they change no number.
"""

import argparse
import ast
import itertools
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
FOLDERS = ("radarsim", "tests", "configs", "scenarios", "docs", "examples")
TREE = (*FOLDERS, "pyproject.toml", "Makefile", "README.md", "CHANGELOG.md")
ROOMS = ("kernels", "exact", "filters", "fisher", "statistics")  # folders and modules that hold formulas
# Beside the kernels, but calculates nothing.
MACHINERY = ("cache", "call_graph", "compile", "numba_internals", "numba_options")
OPERATORS = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult}
COMPARISONS = {ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt}
SYMMETRIC = {"min", "max", "minimum", "maximum", "hypot", "logaddexp"}  # their arguments may be swapped
NOT_ADDED = (ast.Tuple, ast.List, ast.ListComp, ast.JoinedStr)  # `+` joins them
ALLOWED = 0.1  # the share that may survive: a change that changes no number is no fault of the tests


class Site(NamedTuple):
    """Where a change can be made: the module by its path from the root, which of its changes, and of what kind."""

    path: str
    number: int
    kind: str


class Mutant(NamedTuple):
    """The change at a site: its line, that line before and after as Python prints it, and the whole module with it."""

    line: int
    before: str
    after: str
    text: str


def swapped(parts: list[ast.expr]) -> Iterator[tuple[str, Callable[[], object]]]:
    """Two neighbours in a list of arguments or indices, exchanged."""
    for i in range(len(parts) - 1):
        if ast.dump(parts[i]) != ast.dump(parts[i + 1]):
            yield "swap", lambda i=i: parts.__setitem__(slice(i, i + 2), [parts[i + 1], parts[i]])


def changes(node: ast.AST, formula: bool) -> Iterator[tuple[str, Callable[[], object]]]:
    """What may be done to a node in place, by kind; outside of a function (not `formula`) only to a real constant."""
    match node:
        case ast.Constant(value=float(value)):
            yield "constant", lambda: setattr(node, "value", value * (1 + 1e-6) if value else 1e-6)
        case _ if not formula:
            return
        case ast.Constant(value=int(value)) if not isinstance(value, bool):
            yield "constant", lambda: setattr(node, "value", value + 1)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
            joins = any(isinstance(x, NOT_ADDED) or isinstance(getattr(x, "value", 0), str) for x in (left, right))
            if not joins:
                yield "operator", lambda: setattr(node, "op", OPERATORS[type(op)]())
        case ast.Compare(ops=[op, *_]) if type(op) in COMPARISONS:
            yield "comparison", lambda: node.ops.__setitem__(0, COMPARISONS[type(op)]())
        case ast.Call(func=func, args=args):
            if (func.attr if isinstance(func, ast.Attribute) else getattr(func, "id", "")) not in SYMMETRIC:
                yield from swapped(args)
        case ast.Subscript(slice=ast.Tuple(elts=indices)):
            yield from swapped(indices)


def operations(tree: ast.Module) -> Iterator[tuple[str, ast.stmt, Callable[[], object]]]:
    """Every change of a module: its kind, the statement it is in, and how it is made there, in a fixed order."""

    def inside(node: ast.AST, statement: ast.stmt | None, formula: bool) -> Iterator:
        for name, field in ast.iter_fields(node):
            if name in ("annotation", "returns", "decorator_list", "type_params"):
                continue
            for i, child in enumerate(field if isinstance(field, list) else [field]):
                if not isinstance(child, ast.AST) or isinstance(child, ast.Raise | ast.Assert | ast.Import):
                    continue
                held = child if isinstance(child, ast.stmt) else statement
                within = formula or isinstance(child, ast.FunctionDef)
                if isinstance(child, ast.AugAssign) and formula:
                    yield "dropped", child, lambda rest=field, i=i: rest.__setitem__(i, ast.Pass())
                if held is not None:
                    for kind, change in changes(child, formula):
                        yield kind, held, change
                yield from inside(child, held, within)

    yield from inside(tree, None, False)


def mutant(text: str, number: int) -> Mutant:
    """A module with one of its changes made."""
    tree = ast.parse(text)
    _, statement, change = next(itertools.islice(operations(tree), number, None))
    line, before = statement.lineno, ast.unparse(tree)
    change()
    after = ast.unparse(tree)
    both = zip(before.splitlines(), after.splitlines(), strict=True)
    old, new = next((a, b) for a, b in both if a != b)
    return Mutant(line, old.strip(), new.strip(), after)


def modules(root: Path = ROOT) -> list[str]:
    """The modules that hold formulas, by their paths from the root."""
    found = (file.relative_to(root) for file in sorted((root / "radarsim").rglob("*.py")))
    rooms = (path for path in found if {*path.parts[1:-1], path.stem} & {*ROOMS})
    return [str(path) for path in rooms if path.stem not in (*MACHINERY, "__init__") and "template" not in path.parts]


def sites(root: Path, paths: Iterable[str]) -> list[Site]:
    """Every change of these modules."""
    trees = ((path, ast.parse((root / path).read_text(encoding="utf-8"))) for path in paths)
    return [Site(path, i, kind) for path, tree in trees for i, (kind, *_) in enumerate(operations(tree))]


def sample(among: list[Site], number: int, seed: int) -> list[Site]:
    """So many of them, of every kind as many while there are any: constants outnumber all others."""
    draw, kinds = random.Random(seed), {}
    for site in draw.sample(among, len(among)):
        kinds.setdefault(site.kind, []).append(site)
    turns = itertools.zip_longest(*(kinds[kind] for kind in sorted(kinds)))
    return [site for turn in turns for site in turn if site][:number]


def imported(file: Path) -> set[str]:
    """The names of modules that a file imports, and of all that it imports from them."""
    names = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{name.name}" for name in node.names)}
    return names


class Tests:
    """Which tests a module has: files that import it, those of its folder, those of the folders of its importers."""

    def __init__(self, root: Path):
        self.root = root
        self.imports = {
            str(file.relative_to(root)): imported(file)
            for room in ("radarsim", "tests")
            for file in sorted((root / room).rglob("*.py"))
        }

    def beside(self, path: str) -> list[str]:
        """The tests in and under the folder of `tests` that is nearest to a module's, if not all of them or studies."""
        folder = Path("tests", *Path(path).parts[1:-1])
        while folder.parts != ("tests",):
            pattern = "test_*.py" if folder.parts[-1] == "studies" else "**/test_*.py"
            if found := sorted((self.root / folder).glob(pattern)):
                return [str(file.relative_to(self.root)) for file in found]
            folder = folder.parent
        return []

    def of(self, path: str) -> list[str]:
        """The files of tests; first those with a word of the path in their name, the likeliest to notice."""
        words = {*Path(path).with_suffix("").parts}
        name = ".".join(Path(path).with_suffix("").parts)
        users = [file for file, names in self.imports.items() if name in names]
        direct = [file for file in users if Path(file).name.startswith("test_")]
        further = [test for user in users if user.startswith("radarsim") for test in self.beside(user)]
        every = dict.fromkeys([*direct, *self.beside(path), *further])
        return sorted(every, key=lambda test: words.isdisjoint(Path(test).stem.split("_")))


def copied(root: Path, where: Path) -> Path:
    """A copy of what the tests need."""
    where.mkdir()
    for name in TREE:
        if (root / name).is_dir():
            shutil.copytree(root / name, where / name, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
        elif (root / name).exists():
            shutil.copy(root / name, where / name)
    return where


def tested(tree: Path, options: Iterable[str], limit_s: float) -> tuple[int | None, str]:
    """How pytest ended in a copy of the tree, None past the limit, and what it printed.

    Machine code lies in a cache of the copy's own, by what the sources hold: that of other kernels is used again.
    """
    own = {"PYTHONPATH": str(tree), "RADARSIM_CACHE_DIR": str(tree / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", f"--rootdir={tree}", *options]
    with tempfile.TemporaryFile("w+") as output:
        begun = subprocess.Popen(
            command, cwd=tree, env=os.environ | own, stdout=output, stderr=output, start_new_session=True
        )
        try:
            code = begun.wait(limit_s)
        except subprocess.TimeoutExpired:
            os.killpg(begun.pid, signal.SIGKILL)
            begun.wait()
            code = None
        output.seek(0)
        return code, output.read()


def failing(tree: Path, files: list[str]) -> list[str]:
    """The tests that fail without any change, for want of what the copy has not."""
    _, output = tested(tree, ["-rfE", *files], 3600.0)
    lines = (line.split() for line in output.splitlines())
    return [words[1] for words in lines if len(words) > 1 and words[0] in ("FAILED", "ERROR")]


def survives(tree: Path, site: Site, options: list[str], limit_s: float) -> tuple[bool, str]:
    """Whether no test notices the change at a site, and the line that says so; the tree is as it was afterwards."""
    begun = time.perf_counter()
    file = tree / site.path
    text = file.read_text(encoding="utf-8")
    made = mutant(text, site.number)
    file.write_text(made.text, encoding="utf-8")
    try:
        code, _ = tested(tree, ["-x", *options], limit_s)
    finally:
        file.write_text(text, encoding="utf-8")
    silent = code in (0, 5)  # none failed, or none ran
    verdict, seconds = "SURVIVED" if silent else "caught", time.perf_counter() - begun
    place = f"{site.path}:{made.line} ({site.kind}, change {site.number})"
    return silent, f"{verdict:8} {seconds:4.0f} s  {place}\n           {made.before}\n        -> {made.after}\n"


def main(words: list[str]) -> int:
    ask = argparse.ArgumentParser(prog="python -m tests.trust.mutate", description="Try a sample of wrong formulas.")
    ask.add_argument("words", nargs="*", metavar="WORD", help="only modules whose path holds one of these")
    ask.add_argument("-n", "--number", type=int, default=40, help="how many (default 40)")
    ask.add_argument("--seed", type=int, default=int(time.time() // 86400), help="of the sample (default: the day)")
    ask.add_argument("--change", type=int, help="this one change of the modules, as an earlier report numbers it")
    ask.add_argument("--limit-s", type=float, default=900.0, help="for the tests of one (default 900)")
    ask.add_argument("--root", type=Path, default=ROOT, help="the tree (default: this one)")
    given = ask.parse_args(words)
    paths = [path for path in modules(given.root) if not given.words or any(word in path for word in given.words)]
    among = [site for site in sites(given.root, paths) if given.change in (None, site.number)]
    drawn, tests = sample(among, given.number, given.seed), Tests(given.root)
    files = {site: tests.of(site.path) for site in drawn}
    sys.stdout.write(f"{len(drawn)} of {len(among)} changes in {len(paths)} modules, seed {given.seed}\n")
    trees: SimpleQueue[Path] = SimpleQueue()

    def tried(site: Site) -> bool:
        tree = trees.get()
        try:
            silent, line = survives(tree, site, [*skipped, *files[site]], given.limit_s)
        finally:
            trees.put(tree)
        sys.stdout.write(line)
        sys.stdout.flush()
        return silent

    workers = min(os.cpu_count() or 1, 4)
    with tempfile.TemporaryDirectory(prefix="radarsim-mutants-") as folder, ThreadPoolExecutor(workers) as pool:
        first = copied(given.root, Path(folder) / "0")
        broken = failing(first, sorted({test for some in files.values() for test in some}))
        skipped = [word for test in broken for word in ("--deselect", test)]
        sys.stdout.writelines(f"left out, fails without a change: {test}\n" for test in broken)
        for i in range(workers):
            trees.put(shutil.copytree(first, Path(folder) / str(i), symlinks=True) if i else first)
        lost = sum(pool.map(tried, drawn))
    sys.stdout.write(f"{len(drawn) - lost} of {len(drawn)} changes noticed\n")
    return 1 if not drawn or lost > ALLOWED * len(drawn) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
