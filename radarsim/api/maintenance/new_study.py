"""`radarsim new-study`: a package with a small complete study, from a template.

The package is a copy of radarsim/api/maintenance/one_file under another name. With --step, the files of
radarsim/api/maintenance/one_step replace those of the same name. These packages work as they are, and are linted and
tested. Nothing is overwritten."""

import os
import re
import sys
from importlib.metadata import packages_distributions
from keyword import iskeyword, issoftkeyword
from pathlib import Path

from radarsim.api.configs import config_path
from radarsim.config.value_text import one_line
from radarsim.errors import ConfigError, StoreError
from radarsim.studies import registry
from radarsim.system.private_files import create_readable_file, make_readable_folder

ONE_FILE, ONE_STEP = (Path(__file__).parent / name for name in ("one_file", "one_step"))
FORMS = {"linear": (ONE_FILE,), "step": (ONE_FILE, ONE_STEP)}  # files of a later folder win
MODULE = "random_walk"  # the name that the templates have
SUFFIXES = (".md", ".py", ".toml", ".yaml")
PLAIN = re.compile(r"[a-z][a-z0-9_]{0,39}")


def new_study(name: str, folder: str | os.PathLike = ".", form: str = "linear") -> Path:
    """Write the package folder/NAME with a study called NAME, in one of `FORMS`; its path.

    Raises ConfigError for a name that cannot be a new module's, and where something of that name exists; StoreError
    where it cannot be written."""
    if fault := name_fault(name):
        raise ConfigError(f"{one_line(name)}: {fault}")
    path = Path(folder) / name
    try:
        path.mkdir(mode=0o755)
    except FileExistsError:
        raise ConfigError(f"{path}: already exists and is never overwritten; choose another name") from None
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from error
    for template_path, file in template_files(form).items():
        _write(path / rename_template(template_path, name), rename_template(file.read_text("utf-8"), name))
    return path


def name_fault(name: str) -> str | None:
    """Why a name is unusable for a new study, its package and its first config; None where it is usable."""
    if not PLAIN.fullmatch(name) or iskeyword(name) or issoftkeyword(name) or name in ("true", "false", "null"):
        rule = "a small letter, then at most 39 small letters, digits and _; no word of Python or YAML"
        return f"must be a module's name: {rule}"
    if name in registry.study_names():
        return "there is a study of this name already; choose another"
    if name in sys.stdlib_module_names or name == "tests" or name in packages_distributions():
        return "there is a Python module of this name already; choose another"
    if config := config_path(name):
        return f"there is a config of this name already, {config}; choose another"
    return None


def template_files(form: str) -> dict[str, Path]:
    """The files of a form by their paths in the package, in order."""
    files = {
        file.relative_to(folder).as_posix(): file
        for folder in FORMS[form]
        for file in folder.rglob("*")
        if file.suffix in SUFFIXES
    }
    return dict(sorted(files.items()))


def rename_template(text: str, name: str) -> str:
    """A text of the template with another study's name."""
    return text.replace(MODULE, name)


def _write(path: Path, text: str) -> None:
    try:
        make_readable_folder(path.parent)
        with create_readable_file(path) as file:
            file.write(text.encode())
    except OSError as error:
        raise StoreError(f"{path}: cannot be written: {error.strerror}") from error
