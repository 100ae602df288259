"""Find the files of configs and scenarios by their stems, and suggest a name for an unknown one."""

import difflib
import re
import unicodedata
from collections.abc import Callable, Iterable
from pathlib import Path

SHIPPED = Path(__file__).parent.parent / "shipped"
STEM = re.compile(r"\w[\w+=-]*(?:\.[\w+=-]+)*")

RESULT_FILES = ("index.html", "readme.md")  # stand beside the folders of results, which have the names of configs
RESERVED = "a config must have another name: there is a file of that name among the results"

MAX_NAMES_LISTED = 12  # in a message about one that is not known


def no_folders() -> tuple[Path, ...]:
    """The further folders with configs/ and scenarios/: none, unless radarsim.api.configs sets `further_folders`."""
    return ()


further_folders: Callable[[], tuple[Path, ...]] = no_folders


def config_file(name: str, including_file: Path | None = None) -> Path | None:
    """The file of a config: beside the including one (or here), in ./configs, or shipped; None if there is none."""
    folders = [Path(), Path("configs")] if including_file is None else [including_file.parent, Path("configs")]
    return _first_file(name, [*folders, SHIPPED / "configs"]) or _first_file(name, _further_subfolders("configs"))


def scenario_file(name: str, config: Path | None) -> Path | None:
    """The file of a scenario: beside the config, in scenarios/ next to its folder or here, or shipped. A config of that
    name beside the config is not a scenario."""
    folders = [] if config is None else [config.parent, folder_around(config.parent) / "scenarios"]
    file = _first_file(name, [*folders, Path("scenarios"), SHIPPED / "scenarios"], is_refused=_is_config)
    return file or _first_file(name, _further_subfolders("scenarios"), is_refused=_is_config)


def _further_subfolders(kind: str) -> list[Path]:
    """The folders configs/ or scenarios/ of user packages."""
    return [folder / kind for folder in further_folders()]


def folder_around(folder: Path) -> Path:
    """The folder around a folder, written as the user did if possible."""
    return folder.parent if folder.name not in ("", "..") else folder / ".."


def _first_file(name: str, folders: list[Path], is_refused: Callable[[Path], bool] = lambda file: False) -> Path | None:
    for folder in folders:
        file = folder / f"{name}.yaml"
        if file.is_file() and not is_refused(file):
            return file
    return None


def _is_config(file: Path) -> bool:
    """Whether a file has a key that only configs have. An unreadable file has none: whoever reads it reports it."""
    try:
        with file.open(encoding="utf-8", errors="replace") as text:
            return any(line.startswith(("study:", "include:")) for line in text)
    except OSError:
        return False


def available_stems(kind: str) -> tuple[str, ...]:
    """The stems of the available configs or scenarios: in the working directory, shipped, and in user packages."""
    folders = (Path(kind), SHIPPED / kind, *_further_subfolders(kind))
    return tuple(sorted({file.stem for folder in folders for file in folder.glob("*.yaml")}))


def is_stem(name: str) -> bool:
    """Whether a name is a plain file stem, without separators, drive, `..` or leading dot."""
    return len(name) <= 100 and STEM.fullmatch(normalised_name(name)) is not None


def normalised_name(name: str) -> str:
    """A name with letters and accents composed (Unicode's NFC), so that equal looks are equal names."""
    return unicodedata.normalize("NFC", name)


def is_reserved(stem: str) -> bool:
    """Whether the folder of a config's results would have the name of a file beside it, in any case of letters."""
    return stem.casefold() in RESULT_FILES


def did_you_mean(name: str, known_names: Iterable[str]) -> str:
    """`; did you mean X?` for the nearest known name, or nothing."""
    return f"; did you mean {meant}?" if (meant := meant_name(name, known_names)) else ""


def meant_name(name: str, known_names: Iterable[str]) -> str:
    """The known name that is meant; empty where none is near."""
    name, known_names = str(name)[:100], list(known_names)
    beginnings = [full for full in known_names if len(name) > 2 and full.lower().startswith(name.lower())]
    return next(iter(beginnings or difflib.get_close_matches(name, known_names, n=1, cutoff=0.6)), "")


def nearest_names(name: str, known_names: Iterable[str]) -> tuple[str, ...]:
    """The three known names that are nearest."""
    return tuple(difflib.get_close_matches(str(name)[:100], list(known_names), n=3, cutoff=0.0))


def known_names_hint(name: str, known_names: Iterable[str], kind: str) -> str:
    """What follows a name that is not known: the name that is meant, else all names of a kind, of many the nearest."""
    known_names = list(known_names)
    if suggestion := did_you_mean(name, known_names):
        return suggestion
    if len(known_names) <= MAX_NAMES_LISTED:
        return f"; there are: {', '.join(known_names)}"
    nearest = ", ".join(nearest_names(name, known_names))
    return f"; the nearest: {nearest}; `radarsim list {kind}` has all {len(known_names)}"
