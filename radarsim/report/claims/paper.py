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


def described(spec: Model, may_grow: Sequence[str]) -> Described:
    """The keys of a case that are compared."""
    plain = canonical(spec)
    members = {key: plain.pop(key) for key in may_grow}
    named = {}
    for field, info in type(spec).model_fields.items():
        for mark in info.metadata:
            if isinstance(mark, NameIn) and mark.field in members:
                named[field] = members[mark.field][plain.pop(field)]
    return Described(plain, members, named)


def own_members(spec: Model, shipped: Iterable[Described], may_grow: Sequence[str]) -> dict[str, set[int]] | None:
    """Of a case that is the paper's: which members of its lists, by number, are the paper's; None for any other case.

    shipped are the cases of the claim's config.
    """
    mine = described(spec, may_grow)
    found: dict[str, set[int]] | None = None
    for papers in shipped:
        if not (equal(mine.fixed, papers.fixed) and equal(mine.named, papers.named)):
            continue
        places = {key: _places(papers.members[key], mine.members[key]) for key in may_grow}
        if all(len(places[key]) == len(papers.members[key]) for key in may_grow):
            found = {key: places[key] | (found or {}).get(key, set()) for key in may_grow}
    return found


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
