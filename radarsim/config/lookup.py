"""Where configs and scenarios are found by their stem, and what is suggested when they are not."""

import difflib
import re
import unicodedata
from collections.abc import Callable, Iterable
from pathlib import Path

SHIPPED = Path(__file__).parent.parent / "shipped"
STEM = re.compile(r"\w[\w+=-]*(?:\.[\w+=-]+)*")


FILES_OF_RESULTS = ("index.html", "readme.md")  # stand where the folder of a config's results would
RESERVED = "a config must have another name: there is a file of that name among the results"


def no_folders() -> tuple[Path, ...]:
    """Folders with configs/ and scenarios/ beside the shipped one: none, but see radarsim.app.configs."""
    return ()


further_folders: Callable[[], tuple[Path, ...]] = no_folders


def config_file(name: str, beside: Path | None = None) -> Path | None:
    """The file of a config: beside the including one (or here), in ./configs, among the shipped; None if nowhere."""
    folders = [Path(), Path("configs")] if beside is None else [beside.parent, Path("configs")]
    return _first(name, [*folders, SHIPPED / "configs"]) or _first(name, _further("configs"))


def scenario_file(name: str, config: Path | None) -> Path | None:
    """The file of a scenario: beside the config, in scenarios/ next to its folder or here, among the shipped.

    A config of that name beside the config is no scenario.
    """
    folders = [] if config is None else [config.parent, next_to(config.parent) / "scenarios"]
    found = _first(name, [*folders, Path("scenarios"), SHIPPED / "scenarios"], refused=_is_config)
    return found or _first(name, _further("scenarios"), refused=_is_config)


def _further(kind: str) -> list[Path]:
    return [folder / kind for folder in further_folders()]


def next_to(folder: Path) -> Path:
    """The folder around a folder, in the user's own notation where that has one."""
    return folder.parent if folder.name not in ("", "..") else folder / ".."


def _first(name: str, folders: list[Path], refused: Callable[[Path], bool] = lambda file: False) -> Path | None:
    for folder in folders:
        file = folder / f"{name}.yaml"
        if file.is_file() and not refused(file):
            return file
    return None


def _is_config(file: Path) -> bool:
    """Whether a file has a key that only configs have; what cannot be read is judged by who reads it."""
    try:
        with file.open(encoding="utf-8", errors="replace") as text:
            return any(line.startswith(("study:", "include:")) for line in text)
    except OSError:
        return False


def stems(kind: str) -> tuple[str, ...]:
    """Stems of the configs or scenarios that can be named here: those of the working directory and the shipped ones."""
    folders = (Path(kind), SHIPPED / kind, *_further(kind))
    return tuple(sorted({file.stem for folder in folders for file in folder.glob("*.yaml")}))


def is_stem(name: str) -> bool:
    """Whether a name is a plain file stem: no separators, no drive, no `..`, no leading dot."""
    return len(name) <= 100 and STEM.fullmatch(composed(name)) is not None


def composed(name: str) -> str:
    """A name with each letter composed with its accents: the same for every way of writing it (Unicode's NFC)."""
    return unicodedata.normalize("NFC", name)


def is_reserved(stem: str) -> bool:
    """Whether a config's results would have the name of a file that is written beside them, in letters of any case."""
    return stem.casefold() in FILES_OF_RESULTS


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """`; did you mean X?` for the known name nearest to a mistaken one, or nothing."""
    name, known = str(name)[:100], list(known)
    begun = [full for full in known if len(name) > 2 and full.lower().startswith(name.lower())]
    near = begun or difflib.get_close_matches(name, known, n=1, cutoff=0.6)
    return f"; did you mean {near[0]}?" if near else ""
