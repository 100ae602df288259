"""Packages that offer studies, installed as pip leaves them: a folder on the path with the package's metadata."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]


def installed(package: Path, site: Path) -> None:
    """Make the package in a folder with pyproject.toml and src/ known, in the folder `site`, which is on the path."""
    project = tomllib.loads((package / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    offers = project["entry-points"]["radarsim.studies"]
    metadata(site, project["name"], project["version"], offers)
    for inner in (package / "src").iterdir():
        (site / inner.name).symlink_to(inner)


def metadata(site: Path, name: str, version: str, offers: dict[str, str]) -> None:
    """The metadata of a package that offers studies: {name: where it is}."""
    folder = site / f"{name.replace('-', '_')}-{version}.dist-info"
    folder.mkdir(parents=True)
    (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
    lines = [f"{key} = {value}" for key, value in offers.items()]
    (folder / "entry_points.txt").write_text("\n".join(["[radarsim.studies]", *lines, ""]))


def command(*arguments, site: Path, cwd: Path, code: int = 0, module: str = "radarsim", **environment):
    """Run the real command with the packages in `site`; what it printed."""
    path = os.pathsep.join([str(site), str(ROOT)])
    done = subprocess.run(
        [sys.executable, "-m", module, *map(str, arguments)],
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": path} | environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == code, (arguments, done.stdout, done.stderr)
    assert "Traceback" not in done.stderr
    return done
