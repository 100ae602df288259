"""The keys that all configs have, and the interface to the studies."""

from pathlib import Path
from typing import Annotated, Any, Protocol

from pydantic import ConfigDict, Field, Strict, StringConstraints

from radarsim.config.key_types import Anything, Flag, Name, Stem, WholeNumber, key
from radarsim.config.model import Model
from radarsim.config.study_keys import Member, StudyKeys

LARGEST_REALISATIONS = 10**12
LARGEST_SEED = 2**64 - 1
CaseName = Annotated[str, Strict(), StringConstraints(min_length=1)]
Realisations = Annotated[int, WholeNumber(1, LARGEST_REALISATIONS)]


class CommonKeys(Model):
    """Keys that every config may have, whatever its study."""

    name: CaseName | None = key("name", "name of the experiment and of its results; default: that of the file", None)
    like: Stem | None = key("like", "shipped config of which this is a version; results say so", None)
    study: Stem | None = key("study", "the study; it determines the other keys", None)
    include: Annotated[tuple[Stem | dict[str, Anything], ...], Field(min_length=1)] | None = key(
        "included configs",
        "stems of other configs to run together, or whole configs with a name; study keys given with it override "
        "theirs",
        None,
    )
    sweep: Annotated[dict[str, Annotated[tuple[Anything, ...], Field(min_length=1)]], Field(min_length=1)] | None = key(
        "swept keys", "a case for each combination of values: key or dotted path, and its list of values", None
    )
    realisations: Realisations | Annotated[dict[CaseName, Realisations], Field(min_length=1)] | None = key(
        "realisations", "how often the experiment is repeated; or for each case, by its name", None
    )
    seed: Annotated[int, WholeNumber(0, LARGEST_SEED)] | None = key("seed", "seed of the noise; default 1", None)
    figures: tuple[Name, ...] | dict[Name, Annotated[tuple[Name, ...], Field(min_length=1)]] = key(
        "figures that are drawn",
        "names or patterns with * and ?, in the report's order; or a mapping to the cases of each; default and []: all",
        (),
    )
    runs: Annotated[str, Strict(), StringConstraints(pattern=r"^(all|[1-9]\d*:[1-9]\d*)$")] | None = key(
        "scans of runs.csv", "table of each run's root-mean-square error over these scans, '2:60' or all", None
    )
    scenarios: dict[Stem, dict[str, Anything]] | None = key(
        "scenarios", "scenarios by the stems under which this config names them, in place of files", None
    )

    def cases_of_figures(self) -> dict[str, tuple[str, ...]]:
        """For each figure to draw, or pattern of figures, the patterns of its cases."""
        return self.figures if isinstance(self.figures, dict) else dict.fromkeys(self.figures, ("*",))


class UserFilterKeys(Member):
    """A filter that a class or a function of your own code makes; further keys are given to it."""

    model_config = ConfigDict(frozen=True, extra="allow")

    python: Annotated[str, Strict()] = key(
        "own code", "FILE.py:NAME, of a file beside the config, or MODULE:NAME: a class or a function of yours"
    )
    source: Annotated[str, Strict(), StringConstraints(pattern="^[0-9a-f]{8,64}$")] | None = key(
        "source", "hash of the code, as a result records it: other code is refused", None
    )
    one_by_one: Flag = key("one by one", "whether the function takes the plots of one realisation at a time", False)
    identity: Annotated[str, Strict()] | Annotated[int, Strict()] | Annotated[float, Strict()] | None = key(
        "identity",
        "text or number, no unit: change it when what no file of yours shows has changed: data elsewhere, a network",
        None,
    )


COMMON_KEYS = tuple(CommonKeys.model_fields)


class Studies(Protocol):
    """The available studies: the interface of radarsim.studies.registry, which this package does not import."""

    def study_names(self) -> tuple[str, ...]:
        """The allowed values of `study:`."""

    def usable_studies(self) -> tuple[str, ...]:
        """The studies whose keys can be read; a user package may be broken."""

    def is_study(self, name: str) -> bool:
        """Whether there is a study of that name."""

    def reasons_for_missing_config(self, stem: str) -> tuple[str, ...]:
        """Why there is no config with a stem: the errors of packages that would have it."""

    def keys(self, name: str) -> type[StudyKeys]:
        """The schema of a study's keys, imported on first use."""

    def filter_from_code(self, keys: "UserFilterKeys", place: str, baseline: bool, folder: Path) -> Any:
        """The user filter that a config in a folder names at a place. Raises ConfigError."""
