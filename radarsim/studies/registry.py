"""The available studies: those shipped here, and those of installed packages; also filters that packages add.

A package offers a study by an entry point of the group `radarsim.studies`: its name is the value of `study:` in YAML,
its target the declared object, see `radarsim.studies.interface.Study`. An unusable package is an error only where its
study is requested: lists of all studies leave it out, and `unusable` gives the reason.

A package adds a filter to a study that allows this by an entry point of the group `radarsim.filters`: its name is the
value of `kind:` of a filter in YAML, its target a class of keys, derived from that of `Study.own_filters`."""

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from inspect import isabstract
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from radarsim import failures
from radarsim.config.document import did_you_mean
from radarsim.config.experiment import Case
from radarsim.config.fields import Study as Keys
from radarsim.config.fields import kinds_of, widened
from radarsim.config.schema import COMMON_KEYS
from radarsim.errors import OF_AUTHORS, ConfigError, RadarsimError, StudyError
from radarsim.extensions import extensions
from radarsim.report.quantities import Quantity
from radarsim.studies.interface import Study

Part = TypeVar("Part")

GROUP, FILTERS = "radarsim.studies", "radarsim.filters"
SHIPPED = {  # in the order of the papers, then extensions
    "range_doppler": "radarsim.studies.range_doppler",
    "multimodel": "radarsim.studies.multimodel",
    "sonar": "radarsim.studies.sonar",
    "discriminator": "radarsim.studies.discriminator",
    "ambiguous_doppler": "radarsim.studies.ambiguous_doppler",
    "pulses_to_tracks": "radarsim.studies.pulses_to_tracks",
}


@cache
def entries(group: str = GROUP) -> Mapping[str, Mapping[str, EntryPoint]]:
    """Entry points of installed packages in a group: by the entry's name, then by the package's."""
    found: dict[str, dict[str, EntryPoint]] = {}
    for entry in sorted(entry_points(group=group)):
        found.setdefault(entry.name, {}).setdefault(entry.dist.name if entry.dist else entry.value, entry)
    return found


def offered() -> tuple[str, ...]:
    """The names of the studies of installed packages; a name that is shipped here is ignored."""
    return tuple(name for name in entries() if name not in SHIPPED)


def names() -> tuple[str, ...]:
    """The permitted values of `study:`."""
    return (*SHIPPED, *offered())


def has(name: str) -> bool:
    """Whether a study of that name exists; looks at installed packages only where it is not shipped here."""
    return name in SHIPPED or name in offered()


def study(name: str) -> Study:
    """The study of a name. Raises KeyError where there is none, ConfigError where a package's cannot be loaded."""
    found = _loaded(name)
    if isinstance(found, ConfigError):
        raise found
    return found


@cache
def _loaded(name: str) -> Study | ConfigError:
    """The study, or why it cannot be loaded: a package that fails is imported once."""
    if name in SHIPPED:
        return import_module(SHIPPED[name]).STUDY
    packages = entries()[name]
    if len(packages) > 1:
        return ConfigError(
            f"study {name}: offered by the packages {' and '.join(sorted(packages))}: uninstall all but one"
        )
    (entry,) = packages.values()
    try:
        found = entry.load()
    except OF_AUTHORS as error:
        return _fault(name, f"cannot be loaded: {failures.summary(error)}")
    if not isinstance(found, Study):
        return _fault(name, f"must offer a radarsim.studies.interface.Study, got {type(found).__name__}")
    if found.name != name:
        return _fault(name, f"offers it under this name, but it is called {found.name}")
    return found


def module(name: str) -> str:
    """The module that declares a study, by its full name."""
    return SHIPPED[name] if name in SHIPPED else next(iter(entries()[name].values())).module


def part(name: str, take: Callable[[Study], Part]) -> Part:
    """The result of `take` for the study of a name. Raises ConfigError with the package's name where the study of a
    package fails."""
    one = study(name)
    if name in SHIPPED:
        return take(one)
    try:
        return take(one)
    except RadarsimError:
        raise
    except OF_AUTHORS as error:
        raise _fault(name, f"fails: {failures.summary(error)}") from error


def parts(take: Callable[[Study], Part]) -> dict[str, Part]:
    """The result of `take` for every study that gives one, by the study's name."""
    found = {}
    for name in names():
        try:
            found[name] = part(name, take)
        except ConfigError:
            continue  # reported by `unusable`, and where this study is requested
    return found


def unusable() -> dict[str, str]:
    """The unusable studies of installed packages, by name, with the reason."""
    found = {
        name: f"study {name}: shipped with radarsim; that of the package {' and '.join(sorted(packages))} is not used"
        for name, packages in entries().items()
        if name in SHIPPED
    }
    for name in offered():
        try:
            keys(name)
        except ConfigError as error:
            found[name] = error.lines[0]
    return found


def lacking(stem: str) -> tuple[str, ...]:
    """Why no config of a stem was found: faults of the studies of this name, or whose packages ship such a config."""
    return tuple(fault for name, fault in unusable().items() if stem == name or _ships(name, stem))


def _ships(name: str, stem: str) -> bool:
    """Whether a package that may fail to import has a config of this stem in a folder `configs` within it."""
    for entry in entries()[name].values():
        try:
            spec = find_spec(entry.module.partition(".")[0])  # of the outermost module, which this does not import
        except (ImportError, ValueError):
            continue
        folders = spec.submodule_search_locations if spec is not None else None
        if any(True for folder in folders or () for _ in Path(folder).rglob(f"configs/{stem}.yaml")):
            return True
    return False


def keys(name: str) -> type[Keys]:
    """The schema of a study's YAML keys, with those of filters of packages. Raises as `study`."""
    takes = name in SHIPPED and entries(FILTERS) and study(name).own_filters()
    return _with_filters(name) if takes else own_keys(name)


def own_keys(name: str) -> type[Keys]:
    """The schema of a study's own YAML keys. Raises as `study`."""
    found = part(name, _checked_keys)
    if not (isinstance(found, type) and issubclass(found, Keys)):
        raise _fault(name, "must give keys that are a subclass of radarsim.config.fields.Study")
    if taken := [key for key in found.model_fields if key in COMMON_KEYS]:
        raise _fault(name, f"has keys that every config has already: {', '.join(taken)}")
    return found


def _checked_keys(study: Study) -> type[Keys]:
    """The keys of a study. Raises ConfigError for faults in what a package's study declares for extensions."""
    found = study.keys()
    for extension in extensions() if study.name not in SHIPPED else ():
        extension.check_study(study)
    return found


def usable() -> tuple[str, ...]:
    """The names of the studies whose keys can be read."""
    return tuple(parts(lambda one: keys(one.name)))


def quantity(name: str, case: Case) -> Quantity:
    """The quantity of a name that a case measures, also in the spelling of its option (`above-oracle`). Raises
    ConfigError for an unknown one."""
    measured = {one.name: one for one in quantities(case.study, case.spec)}
    spelt = name if name in measured else name.removeprefix("--").replace("-", "_")
    if spelt not in measured:
        near = did_you_mean(spelt, measured)
        raise ConfigError(f"{case.name}: study {case.study} measures no {name!r}, but {', '.join(measured)}{near}")
    return measured[spelt]


def quantities(name: str, spec: Keys | None) -> tuple[Quantity, ...]:
    """The quantities that the study of a name measures in a case with these keys; None: in any. Raises as `part`."""
    return part(name, lambda one: declared(one, spec))


def declared(study: Study, spec: Keys | None) -> tuple[Quantity, ...]:
    """The same of a study. ConfigError for anything but a Quantity."""
    given: Any = study.quantities(spec)
    if not isinstance(given, tuple | list) or not all(isinstance(one, Quantity) for one in given):
        raise _fault(study.name, f"quantities: must give a tuple of Quantity, got {given!r}"[:200])
    return tuple(given)


def folders() -> tuple[Path, ...]:
    """Folders with `configs/` and `scenarios/` of packages, whose configs are found by stem."""
    found = parts(lambda one: one.shipped()) if offered() else {}
    return tuple(Path(folder) for folder in found.values() if folder is not None)


def packages() -> tuple[str, ...]:
    """The top-level modules of the packages that offer studies or filters, without importing them."""
    added = (entry.module for of in entries(FILTERS).values() for entry in of.values())
    return tuple(dict.fromkeys(one.partition(".")[0] for one in (*map(module, offered()), *added)))


def package(name: str) -> str | None:
    """The installed package that offers a study, with its version; None for a study shipped here."""
    if name in SHIPPED:
        return None
    return _package(next(iter(entries()[name].values())))


def homes() -> Iterator[Path]:
    """The folder of each of these packages, or its one file."""
    for name in packages():
        try:
            spec = find_spec(name)
        except (ImportError, ValueError):
            continue
        if spec is not None:
            folders = spec.submodule_search_locations or [spec.origin or ""]
            yield from (Path(one).resolve() for one in folders)


failures.homes = homes


def _package(entry: EntryPoint) -> str:
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.value


def fault_of(error: BaseException) -> StudyError | None:
    """The message of an uncaught error if the code of an installed package raised it; else None."""
    if failures.place(error, installed=True) is None:
        return None
    return StudyError(f"the code of an installed package fails: {failures.summary(error)}")


def _fault(name: str, words: str) -> ConfigError:
    return ConfigError(f"study {name}: the package {package(name) or 'radarsim'} {words}")


def coded(keys: Any, place: str, baseline: bool, folder: Path) -> Any:
    """A filter of the user's own code that a config in a folder names at a place. Raises ConfigError."""
    from radarsim.studies import code

    return code.coded(keys, place, baseline, folder, first_plots)


def first_plots(case: Case, count: int) -> Any:
    """What a filter of the user's sees of the first realisations of a case, as in a run."""
    from radarsim.studies import outside

    return outside.first_plots(study(case.study), case, count)


# ---- filters of packages ---------------------------------------------------------------------------------------------
class Filters(NamedTuple):
    """Filters of installed packages: the keys of each by study and kind, and by kind why others are unusable."""

    usable: Mapping[str, Mapping[str, Any]]
    unusable: Mapping[str, str]


@cache
def filters() -> Filters:
    """The filters of all installed packages, which are imported for this."""
    usable: dict[str, dict[str, Any]] = {}
    unusable: dict[str, str] = {}
    for kind, packages in entries(FILTERS).items():
        of: dict[str, dict[str, Any]] = {}
        faults = []
        for package, entry in packages.items():
            found, fault = _filter(kind, entry)
            if fault:
                faults.append(f"the package {_package(entry)} offers the filter {kind}, {fault}")
            else:
                of.setdefault(found.study, {})[package] = found
        for name, several in of.items():
            if len(several) > 1:
                every = " and ".join(sorted(several))
                faults.append(f"filter {kind} of {name}: offered by the packages {every}: uninstall all but one")
            else:
                usable.setdefault(name, {})[kind] = next(iter(several.values()))
        if faults:
            unusable[kind] = "; ".join(faults)
    return Filters(usable, unusable)


def _filter(kind: str, entry: EntryPoint) -> tuple[Any, str]:
    """The keys of a filter that a package offers, and its fault; empty if it is usable."""
    try:
        found = entry.load()
    except OF_AUTHORS as error:
        return None, f"which cannot be loaded: {failures.summary(error)}"
    name = str(getattr(found, "study", None))
    base = study(name).own_filters() if name in SHIPPED else None
    if base is None:
        takes = " and ".join(one for one in SHIPPED if study(one).own_filters())
        return None, f"for the study {name}, which takes no filters of packages: {takes} does"
    if not (isinstance(found, type) and issubclass(found, base)) or isabstract(found):
        return None, f"which must be a class derived from {base.__module__}.{base.__name__}, with all that it asks for"
    if kind in kinds_of(own_keys(name)):
        return None, f"which {name} has itself: that of the package is not used"
    if kinds_of(found) != (kind,):
        return None, f"whose key kind must be Literal[{kind!r}]"
    return found, ""


@cache
def _with_filters(name: str) -> type[Keys]:
    return widened(own_keys(name), filters().usable.get(name, {}), filters().unusable, (keys, name))
