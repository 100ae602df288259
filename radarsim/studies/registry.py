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

from radarsim.config.common_keys import COMMON_KEYS
from radarsim.config.experiment import Case
from radarsim.config.find_files import did_you_mean
from radarsim.config.study_keys import StudyKeys as Keys
from radarsim.config.study_keys import extend_kinds, possible_kinds
from radarsim.errors import AUTHOR_ERRORS, ConfigError, RadarsimError, StudyError
from radarsim.extensions import extensions
from radarsim.report.quantities import Quantity
from radarsim.studies.interface import Study
from radarsim.user_code import errors as user_code_errors

Part = TypeVar("Part")

GROUP, FILTERS = "radarsim.studies", "radarsim.filters"
SHIPPED = {  # in the order of the papers, then extensions
    "range_doppler": "radarsim.studies.range_doppler",
    "multimodel": "radarsim.studies.multimodel",
    "sonar": "radarsim.studies.sonar",
    "discriminator": "radarsim.studies.discriminator",
    "ambiguous_doppler": "radarsim.studies.ambiguous_doppler",
    "pulses_to_tracks": "radarsim.studies.pulses_to_tracks",
    "plane": "radarsim.studies.plane",
}


@cache
def entry_points_by_name(group: str = GROUP) -> Mapping[str, Mapping[str, EntryPoint]]:
    """Entry points of installed packages in a group: by the entry's name, then by the package's."""
    by_name: dict[str, dict[str, EntryPoint]] = {}
    for entry in sorted(entry_points(group=group)):
        by_name.setdefault(entry.name, {}).setdefault(entry.dist.name if entry.dist else entry.value, entry)
    return by_name


def package_study_names() -> tuple[str, ...]:
    """The names of the studies of installed packages; a name that is shipped here is ignored."""
    return tuple(name for name in entry_points_by_name() if name not in SHIPPED)


def study_names() -> tuple[str, ...]:
    """The permitted values of `study:`."""
    return (*SHIPPED, *package_study_names())


def is_study(name: str) -> bool:
    """Whether a study of that name exists; installed packages are searched only for names that are not shipped here."""
    return name in SHIPPED or name in package_study_names()


def study(name: str) -> Study:
    """The study of a name. Raises KeyError where there is none, ConfigError where a package's cannot be loaded."""
    loaded = _loaded(name)
    if isinstance(loaded, ConfigError):
        raise loaded
    return loaded


@cache
def _loaded(name: str) -> Study | ConfigError:
    """The study, or the error for which it cannot be loaded, so that a package that fails is imported only once."""
    if name in SHIPPED:
        return import_module(SHIPPED[name]).STUDY
    packages = entry_points_by_name()[name]
    if len(packages) > 1:
        return ConfigError(
            f"study {name}: offered by the packages {' and '.join(sorted(packages))}: uninstall all but one"
        )
    (entry,) = packages.values()
    try:
        loaded = entry.load()
    except AUTHOR_ERRORS as error:
        return _fault(name, f"cannot be loaded: {user_code_errors.error_summary(error)}")
    if not isinstance(loaded, Study):
        return _fault(name, f"must offer a radarsim.studies.interface.Study, got {type(loaded).__name__}")
    if loaded.name != name:
        return _fault(name, f"offers it under this name, but it is called {loaded.name}")
    return loaded


def module(name: str) -> str:
    """The module that declares a study, by its full name."""
    return SHIPPED[name] if name in SHIPPED else next(iter(entry_points_by_name()[name].values())).module


def call_study(name: str, take: Callable[[Study], Part]) -> Part:
    """The result of `take` for the study of a name. Raises ConfigError with the package's name where the study of a
    package fails."""
    loaded = study(name)
    if name in SHIPPED:
        return take(loaded)
    try:
        return take(loaded)
    except RadarsimError:
        raise
    except AUTHOR_ERRORS as error:
        raise _fault(name, f"fails: {user_code_errors.error_summary(error)}") from error


def call_studies(take: Callable[[Study], Part]) -> dict[str, Part]:
    """The results of `take` by the name of the study, without studies for which it fails."""
    results = {}
    for name in study_names():
        try:
            results[name] = call_study(name, take)
        except ConfigError:
            continue  # reported by `unusable`, and where this study is requested
    return results


def unusable_studies() -> dict[str, str]:
    """The unusable studies of installed packages, by name, with the reason."""
    reasons = {
        name: f"study {name}: shipped with radarsim; that of the package {' and '.join(sorted(packages))} is not used"
        for name, packages in entry_points_by_name().items()
        if name in SHIPPED
    }
    for name in package_study_names():
        try:
            keys(name)
        except ConfigError as error:
            reasons[name] = error.lines[0]
    return reasons


def reasons_for_missing_config(stem: str) -> tuple[str, ...]:
    """Why no config of a stem was found: errors of studies with this name, or whose packages ship such a config."""
    return tuple(fault for name, fault in unusable_studies().items() if stem == name or _ships(name, stem))


def _ships(name: str, stem: str) -> bool:
    """Whether a package, which may fail to import, has a config of this stem in one of its folders `configs`."""
    for entry in entry_points_by_name()[name].values():
        try:
            spec = find_spec(entry.module.partition(".")[0])  # of the outermost module, which this does not import
        except (ImportError, ValueError):
            continue
        folders = spec.submodule_search_locations if spec is not None else None
        if any(True for folder in folders or () for _ in Path(folder).rglob(f"configs/{stem}.yaml")):
            return True
    return False


def keys(name: str) -> type[Keys]:
    """The schema of a study's YAML keys, with filters that packages add. Raises as `study`."""
    takes_filters = name in SHIPPED and entry_points_by_name(FILTERS) and study(name).own_filters()
    return _with_filters(name) if takes_filters else own_keys(name)


def own_keys(name: str) -> type[Keys]:
    """The schema of a study's own YAML keys. Raises as `study`."""
    key_class = call_study(name, _checked_keys)
    if not (isinstance(key_class, type) and issubclass(key_class, Keys)):
        raise _fault(name, "must give keys that are a subclass of radarsim.config.study_keys.StudyKeys")
    if taken_keys := [key for key in key_class.model_fields if key in COMMON_KEYS]:
        raise _fault(name, f"has keys that every config has already: {', '.join(taken_keys)}")
    return key_class


def _checked_keys(study: Study) -> type[Keys]:
    """The keys of a study. Raises ConfigError for faults in what a package's study declares for extensions."""
    key_class = study.keys()
    for extension in extensions() if study.name not in SHIPPED else ():
        extension.check_study(study)
    return key_class


def usable_studies() -> tuple[str, ...]:
    """The names of the studies whose keys can be read."""
    return tuple(call_studies(lambda loaded: keys(loaded.name)))


def quantity(name: str, case: Case) -> Quantity:
    """The quantity of this name in a case, also in the spelling of its option (`above-oracle`). Raises ConfigError for
    an unknown name."""
    measured = {candidate.name: candidate for candidate in quantities(case.study, case.spec)}
    spelt = name if name in measured else name.removeprefix("--").replace("-", "_")
    if spelt not in measured:
        suggestion = did_you_mean(spelt, measured)
        raise ConfigError(
            f"{case.name}: study {case.study} measures no {name!r}, but {', '.join(measured)}{suggestion}"
        )
    return measured[spelt]


def counted_from_s(case: Case, component: str | None, over: str, from_s: float | None) -> float | None:
    """The time, s, from which on the scans of a quantity over several count: the one asked for, else the study's."""
    from radarsim.config.quantity_phrase import OVER_SCANS

    if over in OVER_SCANS and from_s is None:
        scans = study(case.study).counted_scans(case, component)
        return None if scans is None else scans.t_s
    return from_s


def quantities(name: str, spec: Keys | None) -> tuple[Quantity, ...]:
    """The quantities of a study in a case with these keys; None: in any case. Raises as `part`."""
    return call_study(name, lambda loaded: study_quantities(loaded, spec))


def study_quantities(study: Study, spec: Keys | None) -> tuple[Quantity, ...]:
    """The quantities of a study object. Raises ConfigError for anything but a tuple of Quantity."""
    quantities: Any = study.quantities(spec)
    if not isinstance(quantities, tuple | list) or not all(isinstance(quantity, Quantity) for quantity in quantities):
        raise _fault(study.name, f"quantities: must give a tuple of Quantity, got {quantities!r}"[:200])
    return tuple(quantities)


def folders() -> tuple[Path, ...]:
    """Folders of packages with `configs/` and `scenarios/`, whose configs are found by stem."""
    shipped_folders = call_studies(lambda loaded: loaded.shipped()) if package_study_names() else {}
    return tuple(Path(folder) for folder in shipped_folders.values() if folder is not None)


def packages() -> tuple[str, ...]:
    """The top-level modules of the packages that offer studies or filters, without importing them."""
    filter_modules = (
        entry.module for by_package in entry_points_by_name(FILTERS).values() for entry in by_package.values()
    )
    return tuple(
        dict.fromkeys(
            module_name.partition(".")[0] for module_name in (*map(module, package_study_names()), *filter_modules)
        )
    )


def package(name: str) -> str | None:
    """The installed package that offers a study, with its version; None for a study shipped here."""
    if name in SHIPPED:
        return None
    return _package(next(iter(entry_points_by_name()[name].values())))


def package_folders() -> Iterator[Path]:
    """The folder of each of these packages, or its single file."""
    for name in packages():
        try:
            spec = find_spec(name)
        except (ImportError, ValueError):
            continue
        if spec is not None:
            folders = spec.submodule_search_locations or [spec.origin or ""]
            yield from (Path(folder).resolve() for folder in folders)


user_code_errors.study_folders = package_folders


def _package(entry: EntryPoint) -> str:
    return f"{entry.dist.name} {entry.dist.version}" if entry.dist else entry.value


def package_error(error: BaseException) -> StudyError | None:
    """An error for the user where the code of an installed package raised an uncaught one; else None."""
    if user_code_errors.locate(error, installed=True) is None:
        return None
    return StudyError(f"the code of an installed package fails: {user_code_errors.error_summary(error)}")


def _fault(name: str, words: str) -> ConfigError:
    return ConfigError(f"study {name}: the package {package(name) or 'radarsim'} {words}")


def filter_from_code(keys: Any, place: str, baseline: bool, folder: Path) -> Any:
    """The user filter in Python that a config in a folder names at a place. Raises ConfigError."""
    from radarsim.studies.user_filters import from_code

    return from_code.filter_from_code(keys, place, baseline, folder, first_plots)


def first_plots(case: Case, count: int) -> Any:
    """The plots of a case's first realisations as a user filter sees them in a run."""
    from radarsim.studies.user_filters import plots

    return plots.first_plots(study(case.study), case, count)


class Filters(NamedTuple):
    """Filters of installed packages: the keys of each by study and kind, and by kind why others cannot be used."""

    usable: Mapping[str, Mapping[str, Any]]
    unusable: Mapping[str, str]


@cache
def package_filters() -> Filters:
    """The filters of all installed packages, which are imported for this."""
    usable: dict[str, dict[str, Any]] = {}
    unusable: dict[str, str] = {}
    for kind, packages in entry_points_by_name(FILTERS).items():
        by_study: dict[str, dict[str, Any]] = {}
        faults = []
        for package, entry in packages.items():
            key_class, fault = _filter(kind, entry)
            if fault:
                faults.append(f"the package {_package(entry)} offers the filter {kind}, {fault}")
            else:
                by_study.setdefault(key_class.study, {})[package] = key_class
        for name, by_package in by_study.items():
            if len(by_package) > 1:
                package_names = " and ".join(sorted(by_package))
                faults.append(
                    f"filter {kind} of {name}: offered by the packages {package_names}: uninstall all but one"
                )
            else:
                usable.setdefault(name, {})[kind] = next(iter(by_package.values()))
        if faults:
            unusable[kind] = "; ".join(faults)
    return Filters(usable, unusable)


def _filter(kind: str, entry: EntryPoint) -> tuple[Any, str]:
    """The keys of a filter that a package offers, and why it cannot be used; empty where it can."""
    try:
        key_class = entry.load()
    except AUTHOR_ERRORS as error:
        return None, f"which cannot be loaded: {user_code_errors.error_summary(error)}"
    name = str(getattr(key_class, "study", None))
    base = study(name).own_filters() if name in SHIPPED else None
    if base is None:
        takes = " and ".join(study_name for study_name in SHIPPED if study(study_name).own_filters())
        return None, f"for the study {name}, which takes no filters of packages: {takes} does"
    if not (isinstance(key_class, type) and issubclass(key_class, base)) or isabstract(key_class):
        return None, f"which must be a class derived from {base.__module__}.{base.__name__}, with all that it asks for"
    if kind in possible_kinds(own_keys(name)):
        return None, f"which {name} has itself: that of the package is not used"
    if possible_kinds(key_class) != (kind,):
        return None, f"whose key kind must be Literal[{kind!r}]"
    return key_class, ""


@cache
def _with_filters(name: str) -> type[Keys]:
    return extend_kinds(
        own_keys(name), package_filters().usable.get(name, {}), package_filters().unusable, (keys, name)
    )
