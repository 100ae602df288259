"""The keys of claims.yaml and interpretations.yaml, as `radarsim.papers.claim_files` reads them."""

from typing import Literal

from radarsim.config.key_types import Anything, Flag, Line, NonEmpty, NonEmptyTuple, NumberOrName, PlainName, Stem
from radarsim.config.model import Model


class PartKeys(Model):
    """A part of a claim; see `claim.Part`."""

    what: NonEmpty
    of: Anything
    measure: Anything
    expected: Anything
    unit: Line = ""
    scale: Anything = None
    ceiling: Anything = None
    statement: str = ""
    number: str = ""
    variant: str = ""
    against_print: Anything = False
    asserted: Flag = True
    each: dict[str, Anything] = {}  # noqa: RUF012  (pydantic copies it)


class ClaimKeys(Model):
    """A claim; see `claim.Claim`. parts_of: the claims whose parts it has too."""

    id: NumberOrName
    place: str
    statement: NonEmpty
    interpretation: str = ""
    reading: str = ""  # the key's name in earlier versions
    config: Stem | None = None
    original: str = ""
    extension: Flag = False
    reported: Flag = False
    unstated: str = ""
    joint: Flag = False
    internal: Flag = False
    parts_of: tuple[str, ...] = ()
    parts: tuple[PartKeys, ...] = ()


class AlternativeKeys(Model):
    """A way to take a choice; see `Alternative`."""

    name: NonEmpty
    kind: Literal["E", "U", "N"]
    reason: str
    sets: dict[str, Anything] = {}  # noqa: RUF012


class ChoiceKeys(Model):
    """An open point of a paper; see `Choice`. claims: without the paper; english: where the paper is not silent."""

    key: Stem
    asks: NonEmpty
    original: str
    english: str = ""
    claims: Anything = ()
    contradicts: Flag = False
    alternatives: NonEmptyTuple[AlternativeKeys]


class ChoicesKeys(Model):
    """The open points of a paper, the file interpretations.yaml."""

    paper: PlainName
    names: dict[str, Anything] = {}  # noqa: RUF012
    choices: tuple[ChoiceKeys, ...]


class FileKeys(Model):
    """The claims of a paper in one file; config: of those that name none. choices: as in interpretations.yaml."""

    paper: PlainName
    config: Stem
    names: dict[str, Anything] = {}  # noqa: RUF012
    claims: tuple[ClaimKeys, ...]
    choices: tuple[ChoiceKeys, ...] = ()


class OwnFileKeys(FileKeys):
    """Claims of a user on a config that is named elsewhere, or on a table."""

    config: Stem | None = None  # type: ignore[assignment]
    claims: NonEmptyTuple[ClaimKeys]
