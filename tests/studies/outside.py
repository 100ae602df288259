"""Packages that offer studies or filters, as pip leaves them: a folder on the path with the package's metadata."""

import os
import subprocess
import sys
import tomllib
from functools import partial
from pathlib import Path

from tests.warm import Start

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


def forking(site: Path, place: Path):
    """The command with the packages in `site`, without a start for each; what is yielded is called as `command`."""

    def asked(start, *arguments, code: int = 0, **options):
        return whole(start.run(*arguments, **{"cwd": place} | options), code)

    with Start(place, path=(site,)) as start:
        yield partial(asked, start)


def command(*arguments, site: Path, cwd: Path, code: int = 0, module: str = "radarsim", **environment):
    """Run the command in an interpreter of its own with the packages in `site`; what it printed."""
    path = os.pathsep.join([str(site), str(ROOT)])
    done = subprocess.run(
        [sys.executable, "-m", module, *map(str, arguments)],
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": path} | environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    return whole(done, code)


def whole(done, code):
    """What a command answered, once its exit code is right and it has not failed in Python."""
    assert done.returncode == code, (done.args, done.stdout, done.stderr)
    assert "Traceback" not in done.stderr
    return done
