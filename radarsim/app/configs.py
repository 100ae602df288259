"""Configs, read with all available studies; the command that repeats a result.

Arguments of Python functions are refused as the command refuses its options."""

import math
import operator
import os
import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, SupportsFloat, SupportsIndex, TypeGuard

from radarsim import language
from radarsim.config import document
from radarsim.config import load as reading
from radarsim.config.experiment import Case, Experiment
from radarsim.errors import ConfigError, argument
from radarsim.extensions import extensions
from radarsim.language import term, tr
from radarsim.report import files
from radarsim.studies import registry

if TYPE_CHECKING:
    from radarsim.studies.interface import Study


# ---- configs ---------------------------------------------------------------------------------------------------------
Config = str | os.PathLike[str] | Mapping[str, Any] | Experiment
Overrides = reading.Overrides
document.further_folders = registry.folders
language.packages = registry.packages


def load(source: Config, overrides: Overrides = ()) -> Experiment:
    """The experiment that a config describes, fully checked.

    source is a path, the stem of a config (here, in ./configs, or shipped), a mapping like the YAML, or an experiment
    loaded with these overrides; overrides are as in config.load.texts. Raises ConfigError, one line for each fault,
    also in the claims of an installed package's study."""
    if isinstance(source, Experiment):
        return source
    experiment = reading.load(source, overrides, registry)
    if experiment.study not in registry.SHIPPED and (faults := _extension_faults(experiment.study)):
        raise ConfigError(*faults)
    return experiment


@cache
def _extension_faults(name: str) -> Sequence[str]:
    """Faults in what a package's study declares for extensions, such as names in its claims that nothing has."""
    faults = (registry.part(name, partial(extension.study_faults, shipped=shipped)) for extension in extensions())
    return tuple(dict.fromkeys(line for lines in faults for line in lines))


@cache
def shipped(stem: str) -> tuple[Case, ...] | None:
    """The cases of a shipped config; None where none of that stem is shipped. Never of a user's file of that name:
    claims are judged by the shipped config."""
    file = shipped_file(stem)
    return None if file is None else reading.load(file, (), registry).cases


def shipped_file(stem: str) -> Path | None:
    """The file of the shipped config of a stem."""
    files = (folder / "configs" / f"{stem}.yaml" for folder in (document.SHIPPED, *registry.folders()))
    return next((file for file in files if stem and file.is_file()), None)


def shipped_stem(experiment: Experiment) -> str:
    """The stem of the shipped config behind an experiment, whatever was overridden; empty for a user's config."""
    file = shipped_file(experiment.stem)
    own = file and experiment.path and Path(experiment.path).resolve() == file.resolve()
    return experiment.stem if own else ""


def shadows(experiment: Experiment) -> list[str]:
    """Whether an experiment comes from a user's file although a config of its name is shipped."""
    if not experiment.path or shipped_stem(experiment) or not shipped_file(experiment.stem):
        return []
    file = Path(experiment.path).resolve()
    if file.is_relative_to(Path(__file__).parents[1].resolve()):  # of the self-test
        return []
    return [tr("{file}: used in place of the shipped config {config}", file=file.name, config=experiment.stem)]


EDITORS, SCHEMA = "# yaml-language-server: $schema=", "schema.json"


def new(
    name: str,
    like: str | os.PathLike[str],
    folder: str | os.PathLike[str] = ".",
    values: Mapping[str, float] = MappingProxyType({}),
    overrides: Overrides = (),
) -> Path:
    """Write folder/NAME.yaml, with or without suffix given, from a known config with some values changed; its path.

    The config is taken with its overrides, which it can have if it has one case.

    Where the folder holds a schema.json, the first line points editors to it. Raises ConfigError where the config
    exists already, StoreError where it cannot be written."""
    name, text = reading.new(name, like, registry, values, overrides)
    path = Path(folder) / name
    if path.with_name(SCHEMA).is_file():
        text = f"{EDITORS}{SCHEMA}\n{text}"
    try:
        files.create(path, text.encode())
    except FileExistsError:
        raise ConfigError(TAKEN.format(path=path)) from None
    return path


TAKEN = "{path}: already exists and is never overwritten; choose another name"


def writable(path: str, like: str | os.PathLike[str], overrides: Overrides) -> None:
    """Check, before a long search, that a config with these overrides can be written there. Raises ConfigError."""
    reading.new(os.path.basename(path), like, registry, {}, overrides)
    if os.path.lexists(path):
        raise ConfigError(TAKEN.format(path=path))
    if not os.path.isdir(os.path.dirname(path) or "."):
        raise ConfigError(f"{path}: cannot be written: there is no such folder")


def schema_json() -> str:
    """JSON Schema of the YAML of all studies, as text."""
    from radarsim.config import schema  # pydantic's part takes a tenth of a second to load

    return schema.schema_json(registry)


# ---- inventory -------------------------------------------------------------------------------------------------------
Inventory = Sequence[tuple[str, Sequence[str], Sequence[tuple[str, ...]]]]  # title, columns, rows


STUDY_OR_INCLUDED = re.compile(r"""^(study|include):[\s\[\-"']*([\w.-]+)""", re.MULTILINE)  # the first one included


def described(text: str) -> str:
    """The first line of a YAML file's leading comment, without the file's name; empty where there is none."""
    for line in text.splitlines():
        words = line.lstrip("#").strip()
        if not line.startswith("#"):
            break
        if not words.startswith("yaml-language-server"):
            return words.partition(" — ")[2] or words
    return ""


def _study_label(study: "Study") -> str:
    """A short label of a study, such as its paper's; empty if it has none."""
    return next(filter(None, (extension.study_label(study) for extension in extensions())), "")


def _configs() -> list[tuple[str, str, str]]:
    """Name, paper (P1; or the study's name) and line of each config, in the order of the studies."""
    papers = {name: key or name for name, key in registry.parts(_study_label).items()}
    texts = {stem: _text(document.config_file(stem)) for stem in document.stems("configs")}
    found = []
    for stem, text in texts.items():
        kind, study = "include", stem
        for _ in texts:  # no more often than there are configs: a circular include is refused at run time
            match = STUDY_OR_INCLUDED.search(texts.get(study, ""))
            if kind != "include" or match is None:
                break
            kind, study = match.groups()
        found.append((study, stem, described(text)))
    order = [*papers, *(study for study, _, _ in found)]
    found.sort(key=lambda one: (order.index(one[0]), one[1]))
    return [(stem, papers.get(study, ""), words) for study, stem, words in found]


def _text(file: Path | None) -> str:
    return file.read_text(encoding="utf-8", errors="replace") if file else ""


def inventory() -> Inventory:
    """What `radarsim list` shows: title, columns and rows of each kind."""
    scenarios = [(stem, described(_text(document.scenario_file(stem, None)))) for stem in document.stems("scenarios")]
    studies = registry.parts(lambda study: (study.about, dict(study.filters)))
    about = [(name, words) for name, (words, _) in studies.items()]
    about += [(name, f"cannot be used: {words}") for name, words in registry.unusable().items()]
    filters = [(name, key, words) for name, (_, of) in studies.items() for key, words in of.items()]
    added, unusable = registry.filters()
    filters += [
        (name, f"kind: {kind}", keys.model_fields["kind"].description or "")
        for name, of in added.items()
        for kind, keys in of.items()
    ]
    filters += [("", f"kind: {kind}", f"cannot be used: {words}") for kind, words in unusable.items()]
    return [
        (term("Configs (radarsim run NAME)"), ("name", "paper", "what it is"), _configs()),
        (term("Scenarios (target: NAME)"), ("name", "what it is"), scenarios),
        (term("Studies (study: NAME)"), ("name", "paper and question"), about),
        (term("Filters"), ("study", "keys", "what it is"), filters),
    ]


def selected(whole: Inventory, words: Sequence[str]) -> Inventory:
    """The kinds of an inventory that the words name, with the rows that contain all other words; case is ignored.
    Raises ConfigError where nothing is left."""
    kinds = {title.partition(" ")[0].lower(): title for title, _, _ in whole}
    wanted = {kinds[word.lower()] for word in words if word.lower() in kinds} or set(kinds.values())
    parts = [word.lower() for word in words if word.lower() not in kinds]
    found = [
        (title, columns, [row for row in rows if all(part in " ".join(row).lower() for part in parts)])
        for title, columns, rows in whole
        if title in wanted
    ]
    if parts and not any(rows for _, _, rows in found):
        raise ConfigError(
            f"{' '.join(words)}: no entry has this name; `radarsim list` shows all, or one of {', '.join(kinds)}"
        )
    return [(title, columns, rows) for title, columns, rows in found if rows or not parts]


# ---- arguments -------------------------------------------------------------------------------------------------------
MOST_THREADS, WIDEST_MM = 1024, 1000
FORMATS = ("svg", "png", "pdf")  # of the figures' files
NEEDED = ("workers", "depth", "shortest_s", "longest_s", "submit", "finished", "cancel", "forget")  # of an executor


def check(
    overrides: Overrides = (),
    *,
    threads: object = None,
    workers: object = None,
    precision: object = None,
    time_limit: object = None,
    executor: object = None,
    out: object = None,
    figures: object = True,
    width_mm: object = None,
    **numbers: object,
) -> tuple[str, ...]:
    """The overrides as texts. ConfigError with a line for each invalid argument; others than named are numbers."""
    faults = [
        *_count("threads", threads, least=0),
        *_count("workers", workers, least=1),
        *_number("precision", precision, 100, " %"),
        *([] if callable(time_limit) else _number("time_limit", time_limit, math.inf)),
        *_number("width_mm", width_mm, WIDEST_MM),
    ]
    faults += [f"{name}: must be a number, got {value!r}" for name, value in numbers.items() if not _is_number(value)]
    if executor is not None and not all(hasattr(executor, name) for name in NEEDED):
        faults.append(f"executor: must be an executor of radarsim.engine, got {executor!r}")
    if out is not None:
        faults += _directory(out)
    faults += _formats(figures)
    texts: tuple[str, ...] = ()
    try:
        texts = reading.texts(overrides)
    except ConfigError as error:
        faults += error.lines
    if faults:
        raise ConfigError(*faults)
    return texts


def formats(figures: bool | str | Iterable[str]) -> tuple[str, ...]:
    """The file formats of the figures: True for svg; none for False or None. Raises ConfigError for an unknown
    format."""
    if faults := _formats(figures):
        raise ConfigError(*faults)
    if isinstance(figures, bool) or figures is None:
        return FORMATS[:1] if figures else ()
    return (figures,) if isinstance(figures, str) else tuple(figures)


def whole(realisations: object) -> int | None:
    """A number of realisations, which may be a float. Raises ConfigError for anything else."""
    if realisations is None:
        return None
    if not _is_number(realisations) or not float(realisations).is_integer():
        raise ConfigError(f"{argument('realisations')}: must be a whole number, got {realisations!r}")
    if float(realisations) < 1:
        raise ConfigError(f"{argument('realisations')}: must be >= 1, got {realisations}")
    return int(float(realisations))


def texts(names: Iterable[object]) -> None:
    """ConfigError for names that are not texts."""
    if faults := [f"{name!r}: must be text" for name in names if not isinstance(name, str | os.PathLike)]:
        raise ConfigError(*faults)


def directory(out: object) -> None:
    """ConfigError for an argument that names no directory."""
    if faults := _directory(out):
        raise ConfigError(*faults)


def _directory(out: object) -> list[str]:
    named = isinstance(out, str | os.PathLike) and os.fspath(out)
    return [] if named and isinstance(named, str) else [f"out: must name a directory, got {out!r}"]


def _formats(figures: object) -> list[str]:
    if isinstance(figures, bool) or figures is None:
        return []
    given = [figures] if isinstance(figures, str) or not isinstance(figures, Iterable) else list(figures)
    allowed = ", ".join(FORMATS)
    return [f"figures: must be True, False or of {allowed}, got {one!r}" for one in given if one not in FORMATS]


def _count(name: str, value: object, least: int) -> list[str]:
    scalar = not isinstance(value, bool) and not getattr(value, "ndim", 0)
    number = operator.index(value) if isinstance(value, SupportsIndex) and scalar else -1
    if value is None or least <= number <= MOST_THREADS:
        return []
    return [f"{name}: must be a whole number from {least} to {MOST_THREADS}, got {value!r}"]


def _is_number(value: object) -> TypeGuard[SupportsFloat]:
    return isinstance(value, SupportsFloat) and not isinstance(value, bool) and not getattr(value, "ndim", 0)


def is_pair(given: object, kind: Any = SupportsFloat) -> bool:
    """Whether an argument is two numbers."""
    return isinstance(given, Iterable) and len(two := list(given)) == 2 and all(isinstance(one, kind) for one in two)


def _number(name: str, value: object, most: float, unit: str = "") -> list[str]:
    number = float(value) if _is_number(value) else math.nan
    if value is None or (0 < number <= most and math.isfinite(number)):
        return []
    bound = f" and ≤ {most:g}{unit}" if math.isfinite(most) else ""
    return [f"{name}: must be > 0{bound}, got {value!r}"]


# ---- repeat ----------------------------------------------------------------------------------------------------------
RESULTS = "results"  # the command's default directory
SHORT = {"realisations": "-n", "seed": "--seed"}


Precision = tuple[float, str]  # in per cent, and for which kind of quantity


def repeated(asked: Experiment, done: Mapping[str, int], overrides: Sequence[str], precision: Precision | None) -> str:
    """The command that reproduces the tables, or a sentence that says why there is none.

    asked is the experiment as config and overrides give it, done the realisations of each case in the tables; precision
    ended the cases, unless it is None."""
    if asked.path is None:
        return "none: the config was given in Python, and is printed below"
    wanted = {case.name: case.realisations for case in asked.cases}
    counts = {done.get(name, 0) for name in wanted}
    if all(done.get(name) == count for name, count in wanted.items()):
        return command(asked, overrides, RESULTS)
    if len(counts) == 1:
        kept = [text for text in overrides if text.partition("=")[0].strip() != "realisations"]
        return command(asked, [*kept, f"realisations={counts.pop()}"], RESULTS)
    if precision is not None:
        return command(asked, overrides, RESULTS, precision)
    return "none: the run was stopped, its cases at different numbers of realisations, which are listed below"


def command(
    experiment: Experiment,
    overrides: Sequence[str],
    out: str | os.PathLike,
    precision: Precision | None = None,
    verb: str = "run",
) -> str:
    """The command that runs an experiment or reads its result; a shipped config by its stem."""
    # In a checkout the shipped folder is a link to configs/.
    folders = {(folder / "configs").resolve() for folder in (document.SHIPPED, *document.further_folders())}
    shipped = not experiment.path or Path(experiment.path).resolve().parent in folders
    words = ["radarsim", verb, experiment.stem if shipped else as_text(experiment.path or "")]
    for override in overrides:
        key, _, value = override.partition("=")
        words += [SHORT[key], value] if key in SHORT else ["--set", override]
    if precision is not None:
        percent, of = precision
        words += ["--precision", f"{percent:.17g}", *(["--of", of] if of != "sigma" else [])]
    return shlex.join(words) + into(out)


def into(out: str | os.PathLike) -> str:
    """The option for the results directory at the end of a command."""
    return f" {shlex.join(['--out', as_text(os.fspath(out))])}" if str(out) != RESULTS else ""


def as_text(path: str) -> str:
    """A path as printable text; bytes that are not UTF-8 escaped."""
    return os.fsencode(path).decode("utf-8", "backslashreplace")
