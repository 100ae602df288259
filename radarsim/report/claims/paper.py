"""Whether a case is the paper's own experiment, of which alone its claims may be judged.

A claim names the shipped config that holds its experiment. A case is the paper's when its checked keys equal those of
a case of that config. What may differ: the number of realisations, the seed and the options of a run, which are no
keys of a study; names that are only displayed (`config.fields.Display`); and members that are added to a list which
the study declares in `PaperClaims.may_grow`.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from radarsim.config.fields import Model, NameIn
from radarsim.config.identity import canonical

CLOSE = 1e-12  # relative: one number in radians and in degrees
Shipped = Callable[[str], Sequence[Model] | None]  # config → the checked keys of its cases; None: not shipped


@dataclass(frozen=True)
class Described:
    """A case's keys, as plain data: those of its lists that may grow apart from the rest.

    named holds, for each key that names a member of such a list, that member.
    """

    fixed: dict
    members: dict[str, list]
    named: dict[str, object]


def described(spec: Model, may_grow: Sequence[str], may_shorten: Sequence[str] = ()) -> Described:
    """The keys of a case that are compared: all but may_shorten."""
    plain = {key: value for key, value in canonical(spec).items() if key not in may_shorten}
    members = {key: plain.pop(key) for key in may_grow}
    named = {}
    for field, info in type(spec).model_fields.items():
        for mark in info.metadata:
            if isinstance(mark, NameIn) and mark.field in members:
                named[field] = members[mark.field][plain.pop(field)]
    return Described(plain, members, named)


def own_members(mine: Described, shipped: Iterable[Described], may_grow: Sequence[str]) -> dict[str, set[int]] | None:
    """Of a case that is the paper's: which members of its lists, by number, are the paper's; None for any other case.

    shipped are the cases of the claim's config.
    """
    found: dict[str, set[int]] | None = None
    for papers in shipped:
        if not (equal(mine.fixed, papers.fixed) and equal(mine.named, papers.named)):
            continue
        places = {key: _places(papers.members[key], mine.members[key]) for key in may_grow}
        if all(len(places[key]) == len(papers.members[key]) for key in may_grow):
            found = {key: places[key] | (found or {}).get(key, set()) for key in may_grow}
    return found


def differences(mine: Described, shipped: Iterable[Described], may_grow: Sequence[str]) -> list[str]:
    """The keys in which a case differs from the nearest of these, "key is x, the paper's y"; empty where in none."""
    shipped = list(shipped)
    if own_members(mine, shipped, may_grow) is not None:
        return []
    every = [_differing(mine.fixed, papers.fixed) + _lacking(mine, papers, may_grow) for papers in shipped]
    return min(every, key=len, default=["no such experiment is shipped"])


def _lacking(mine: Described, papers: Described, may_grow: Sequence[str]) -> list[str]:
    said = []
    for key in may_grow:
        missing = len(papers.members[key]) - len(_places(papers.members[key], mine.members[key]))
        if missing:
            said.append(f"{missing} of the paper's {len(papers.members[key])} {key} changed or not there")
    if not equal(mine.named, papers.named):
        said.append(f"{', '.join(papers.named)} another one than the paper's")
    return said


def _differing(mine: object, papers: object, path: str = "") -> list[str]:
    """The keys of plain data in which two differ, by dotted path."""
    if equal(mine, papers):
        return []
    if isinstance(mine, dict) and isinstance(papers, dict):
        if mine.get("kind") != papers.get("kind"):  # the keys of one kind say nothing to those of another
            return _differing(mine.get("kind"), papers.get("kind"), f"{path}.kind".strip("."))
        keys = dict.fromkeys((*mine, *papers))
        return [line for key in keys for line in _differing(mine.get(key), papers.get(key), f"{path}.{key}".strip("."))]
    if isinstance(mine, list) and isinstance(papers, list) and len(mine) == len(papers):
        pairs = enumerate(zip(mine, papers, strict=True))
        return [line for i, (own, other) in pairs for line in _differing(own, other, f"{path}.{i}")]
    return [f"{path} is {_short(mine)}, the paper's {_short(papers)}"]


def _short(value: object) -> str:
    if value is None:
        return "none"
    text = f"{value:g}" if isinstance(value, int | float) and not isinstance(value, bool) else str(value)
    return text if len(text) <= LONGEST else text[:LONGEST] + "…"


LONGEST = 40  # characters of a value that a reason quotes


def _places(wanted: Sequence, given: Sequence) -> set[int]:
    """Where the wanted members stand among the given ones, each at a place of its own."""
    places: set[int] = set()
    for one in wanted:
        place = next((i for i, other in enumerate(given) if i not in places and equal(one, other)), None)
        if place is not None:
            places.add(place)
    return places


def equal(one: object, other: object) -> bool:
    """Whether plain data are equal, numbers to 10⁻¹² of their size."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(equal(value, other[key]) for key, value in one.items())
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(equal, one, other))
    if isinstance(one, bool) or isinstance(other, bool):
        return one is other
    if isinstance(one, int | float) and isinstance(other, int | float):
        return math.isclose(one, other, rel_tol=CLOSE)
    return one == other
