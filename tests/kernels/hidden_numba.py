"""A Numba whose private half has gone, as seen by radarsim: imports of these names fail, for its modules alone.

python -m tests.kernels.hidden_numba WORDS … runs `radarsim WORDS …` so."""

import ast
import builtins
import sys
from collections.abc import Collection
from pathlib import Path

from radarsim.cli.command_group import main

KERNELS = Path(__file__).parents[2] / "radarsim/kernels"
PUBLIC = ("numba", "numba.extending", "llvmlite", "llvmlite.binding", "llvmlite.ir")


def private_names(*paths: Path) -> set[tuple[str, str]]:
    """What sources, or all of radarsim's kernels, import of Numba and llvmlite that no documentation describes.

    Pairs of a module and a name in it, which is "" for the module itself."""
    names = set()
    for path in paths or KERNELS.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {(alias.name, "") for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                names |= {(node.module, alias.name) for alias in node.names}
    libraries = {(module, name) for module, name in names if module.partition(".")[0] in ("numba", "llvmlite")}
    return {(module, name) for module, name in libraries if module not in PUBLIC or name.startswith("_")}


def hide(names: Collection[tuple[str, str]]) -> None:
    """From now on imports of these names fail in modules of radarsim."""
    find = getattr(builtins.__import__, "find", builtins.__import__)

    def importing(module, globals=None, locals=None, fromlist=(), level=0):
        if str((globals or {}).get("__name__")).startswith("radarsim."):
            for name in fromlist or ("",):
                if (module, name) in names:
                    raise ImportError(f"cannot import name {name!r} from {module!r}")
        return find(module, globals, locals, fromlist, level)

    importing.find = find
    builtins.__import__ = importing


if __name__ == "__main__":
    hide(private_names())
    from radarsim.cli import main

    main(sys.argv[1:])
