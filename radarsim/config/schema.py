"""The YAML keys that every config may have, and what config knows of the studies: their names and their keys."""

from typing import Annotated, Protocol

from pydantic import Field

from radarsim.config.fields import Anything, Model, Name, Stem, Study, Whole, key

LARGEST_REALISATIONS = 10**12
LARGEST_SEED = 2**64 - 1


class Common(Model):
    """Keys that every config may have, whatever its study."""

    study: Stem | None = key("study", "the study, which decides the other keys", None)
    include: Annotated[tuple[Stem, ...], Field(min_length=1)] | None = key(
        "included configs", "stems of other configs, to be run together in place of an experiment of one's own", None
    )
    sweep: Annotated[dict[str, Annotated[tuple[Anything, ...], Field(min_length=1)]], Field(min_length=1)] | None = key(
        "swept keys", "a case for each combination of values: key or dotted path, and its list of values", None
    )
    realisations: Annotated[int, Whole(1, LARGEST_REALISATIONS)] | None = key(
        "realisations", "how often the experiment is repeated", None
    )
    seed: Annotated[int, Whole(0, LARGEST_SEED)] | None = key("seed", "seed of the noise; default 1", None)
    figures: dict[Name, Annotated[tuple[Name, ...], Field(min_length=1)]] = key(
        "cases in figures", "for a figure the cases it shows: names, or patterns with * and ?", {}
    )


COMMON_KEYS = tuple(Common.model_fields)


class Studies(Protocol):
    """The available studies; see radarsim.studies.registry, which config does not know."""

    def names(self) -> tuple[str, ...]:
        """The values that `study:` may have."""

    def usable(self) -> tuple[str, ...]:
        """Those of them whose keys can be read; a package from outside may be broken."""

    def has(self, name: str) -> bool:
        """Whether there is a study of that name."""

    def keys(self, name: str) -> type[Study]:
        """The schema of a study's keys, imported when first asked for."""
