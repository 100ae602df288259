"""The arrows of the house: which package may import which, and which single file may import a foreign library."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / "radarsim"
DATA = {"engine.moments", "engine.results"}  # the engine's plain data, which studies fill
ALLOWED = {
    "models": set(),
    "kernels": set(),
    "exact": {"models"},
    "filters": {"errors", "config", "models", "kernels"},
    "studies": {"errors", "config", "models", "filters", "kernels", "exact", *DATA},
    "report": {"errors", "engine", "exact", "config"},
    "engine": {"errors"},
    "config": {"errors"},
    "errors": set(),
}
FENCED = {
    "yaml": {"config/load.py"},
    "matplotlib": {"report/figures.py"},
    "dask": {"engine/cluster.py"},
    "distributed": {"engine/cluster.py"},
    "pandas": {"report", "app/run.py", "app/result.py"},
    "rich": {"cli/console.py"},
    "click": {"cli"},
    "jinja2": {"report/html.py"},
    "pydantic": {"config"},
    "numba": {"kernels"},
    "llvmlite": {"kernels"},
}
FILES = sorted(PACKAGE.rglob("*.py"))


def imports(path):
    """Every module that a file imports, at any depth; `from radarsim import x` counts as radarsim.x."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            yield node.module
            if node.module and node.module.split(".")[0] == "radarsim":
                yield from (f"{node.module}.{alias.name}" for alias in node.names)


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def test_arrows_point_downwards(path):
    floor = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
    if floor not in ALLOWED:
        return
    for module in imports(path):
        parts = module.split(".")
        if parts[0] != "radarsim" or len(parts) == 1 or parts[1] == floor:
            continue
        name = ".".join(parts[1:])
        is_ours = (PACKAGE / parts[1]).is_dir() or (PACKAGE / f"{parts[1]}.py").is_file()
        assert not is_ours or any(f"{name}.".startswith(f"{home}.") for home in ALLOWED[floor]), (
            f"{path.name}: {module}"
        )


@pytest.mark.parametrize("library", FENCED)
def test_foreign_libraries_are_fenced(library):
    users = {
        str(path.relative_to(PACKAGE))
        for path in FILES
        if any(module.split(".")[0] == library for module in imports(path) if module)
    }
    outside = {
        user for user in users if not any(user == home or user.startswith(f"{home}/") for home in FENCED[library])
    }
    assert not outside


def test_the_arrows_are_looked_at():
    seen = {path.relative_to(PACKAGE).parts[0] for path in FILES}
    assert {"config", "engine", "exact", "filters", "kernels", "models", "report", "studies"} <= seen
