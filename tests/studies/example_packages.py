"""Packages that offer studies or filters, as pip leaves them: a folder on the path with the package's metadata."""

import ast
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]


def installed(package: Path, site: Path) -> None:
    """Make the package in a folder with pyproject.toml and src/ known, in the folder `site`, which is on the path."""
    project = tomllib.loads((package / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for group, offers in project["entry-points"].items():
        metadata(site, project["name"], project["version"], offers, group)
    for inner in (package / "src").iterdir():
        (site / inner.name).symlink_to(inner)


def metadata(site: Path, name: str, version: str, offers: dict[str, str], group: str = "radarsim.studies") -> None:
    """The metadata of a package that offers studies, or filters: {name: where it is}."""
    folder = site / f"{name.replace('-', '_')}-{version}.dist-info"
    folder.mkdir(parents=True)
    (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    lines = [f"{key} = {value}" for key, value in offers.items()]
    (folder / "entry_points.txt").write_text("\n".join([f"[{group}]", *lines, ""]))


def beside(start, site: Path, place: Path):
    """The command with the packages in `site`, in processes of `start`; what is returned is called as `command`."""

    def asked(*arguments, code: int = 0, **options):
        done = start.run(*arguments, **{"path": [site], "cwd": place} | options)
        assert done.returncode == code, (done.args, done.stdout, done.stderr)
        assert "Traceback" not in done.stderr
        return done

    return asked


def lines_without_imports(text: str) -> int:
    """The number of lines of a module's text apart from its imports."""
    imports = [node for node in ast.parse(text).body if isinstance(node, ast.Import | ast.ImportFrom)]
    return len(text.splitlines()) - sum(node.end_lineno - node.lineno + 1 for node in imports)
