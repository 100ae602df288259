"""A study as a folder with the usual files: each part of the interface is a function of the same name in one of them.

A study that follows this declares an object and writes no class:

    STUDY = StudyFolder(
        package=__name__,
        name="random_walk",
        about="Random walk: a Kalman filter against a fixed gain.",
        filters={"kind: kalman": "Kalman filter", "kind: fixed_gain": "exponential smoothing"},
        paper=Paper("Kalman 1960"),
        offers=("recorded",),
    )

| part | is |
|---|---|
| `keys` | the class `config.Keys` |
| `prepare`, `simulate` | functions of `study` |
| `tables`; if offered `curves`, `gains`, `inputs`, `cost` | functions of `tables` |
| `figures` | the function of `figures` |
| `shown`, `drawn_from` | `figures.COMPONENTS` and `figures.DRAWN_FROM`, where there are such |
| `question`, `answer` | functions of `words` |
| `warnings`, if offered | the function of `words` |
| claims, if there is a paper | those of `claims.yaml`, measured by functions of `measures`; see `radarsim.papers` |
| `seconds_per_update`, `seconds_at_most`, if offered | functions of `cost` |
| `errors`, `shortened`, `exact_but_for`, `costly`, if offered | functions of `study` |
| `recorded`, if offered | an object of the class `track.Recorded` |
| `chart`, if offered | the function of `chart` |
| `own_filters`, if offered | the function of `given` |
| `floor`, if offered | the function of `floor` |
| `shipped`, if offered | the folder `shipped` |

A file is imported when a part of it is first asked for, so that `radarsim list` loads no kernels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any, get_args

from radarsim.report.quantities import COMMON, Component, Quantity
from radarsim.studies.interface import OptionalPart, Paper, Study

if TYPE_CHECKING:
    from radarsim.config.fields import Study as Keys


class _Part:
    """A method of a folder's class that is the function, or class, of its name in a file; see `part`."""

    def __init__(self, file: str, name: str):
        self.path, self.name = file, name

    def __set_name__(self, owner: type, name: str) -> None:
        self.owner, self.method, self.name = owner, name, self.name or name

    def __get__(self, folder: Any, owner: type) -> Any:
        if folder is None:
            return self
        if self.method in get_args(OptionalPart) and self.method not in folder.offers:
            return getattr(super(self.owner, folder), self.method)
        return getattr(folder.file(self.path), self.name)


def part(file: str, name: str = "") -> Any:
    """A method that a file of the folder has, under its own name or another one; the default where it is not offered.
    It is what `radarsim.studies.interface` says of the method, without self."""
    return _Part(file, name)


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyFolder(Study):
    """A study whose parts are the functions of the files of a folder.

    package is the folder as Python imports it, `__name__` in its `__init__.py`. paper is whose claims it judges. offers
    are the optional parts that it has; own_quantities what it measures beside σ and gain. The others are as in
    `Study`.
    """

    package: str
    name: str
    about: str
    filters: Mapping[str, str]
    paper: Paper | None = None
    offers: tuple[OptionalPart, ...] = ()
    model: int = 1
    exact_errors: bool = True
    draws_sweeps: bool = False
    own_quantities: tuple[Quantity, ...] = ()

    def __post_init__(self) -> None:
        if unknown := set(self.offers) - set(get_args(OptionalPart)):
            allowed = ", ".join(get_args(OptionalPart))
            raise ValueError(f"study {self.name}: offers {', '.join(sorted(unknown))}, must be of {allowed}")

    def file(self, name: str) -> ModuleType:
        """A module of the folder."""
        return import_module(f"{self.package}.{name}")

    def keys(self) -> "type[Keys]":
        return self.file("config").Keys

    def computing_modules(self, spec: Any, plots: bool) -> Sequence[str]:
        optional = {"given": "own_filters" in self.offers, "track": plots and "recorded" in self.offers}
        files = ("config", "study", *(file for file, computes in optional.items() if computes))
        return tuple(f"{self.package}.{file}" for file in files)

    def quantities(self, spec: Any = None) -> tuple[Quantity, ...]:
        return (*COMMON, *self.own_quantities)

    prepare, simulate = part("study"), part("study")
    errors, shortened, exact_but_for, costly = part("study"), part("study"), part("study"), part("study")
    seconds_per_update, seconds_at_most = part("cost"), part("cost")
    tables, curves, gains = part("tables"), part("tables"), part("tables")
    inputs, cost = part("tables"), part("tables")
    figures, chart = part("figures"), part("chart")
    question, answer, warnings = part("words"), part("words"), part("words")
    own_filters, floor = part("given"), part("floor")
    recorded = part("track", "Recorded")

    def shown(self) -> Sequence[Component]:
        return getattr(self.file("figures"), "COMPONENTS", ())

    def drawn_from(self) -> Mapping[str, Sequence[str]]:
        return getattr(self.file("figures"), "DRAWN_FROM", {})

    def shipped(self) -> Path | None:
        (folder,) = import_module(self.package).__path__
        return Path(folder) / "shipped" if "shipped" in self.offers else None
