"""Whether a case is the paper's own experiment; only such cases may judge its claims.

A claim names the shipped config that holds its experiment. A case is the paper's when its checked keys equal those of a
case of that config. These may differ: the number of realisations, the seed and the options of a run, which are not keys
of a study; display names (`config.fields.Display`); and members added to a list that the study declares in
`PaperClaims.may_grow`, or user filters (`python:`) beside the paper's own."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from radarsim.config.experiment import Case, canonical
from radarsim.config.fields import NameIn
from radarsim.engine.results import CaseResult

RELATIVE_TOLERANCE = 1e-12  # relative: one number in radians and in degrees
ShippedCases = Callable[[str], "Sequence[CaseResult | Case] | None"]  # config → its cases; None: not shipped


@dataclass(frozen=True)
class CaseKeys:
    """A case's keys, as plain data: those of its lists that may grow separate from the rest.

    named: for each key that names a member of such a list, that member. outside: by the name of a filter of the user's
    own code what its numbers depend on."""

    fixed: dict
    members: dict[str, list]
    named: dict[str, object]
    outside: dict[str, str]


def case_keys(one: CaseResult | Case, may_grow: Sequence[str], may_shorten: Sequence[str] = ()) -> CaseKeys:
    """The keys of a case for comparison: all but may_shorten."""
    spec = one.spec
    plain = {key: value for key, value in canonical(spec).items() if key not in may_shorten}
    members = {key: plain.pop(key) for key in may_grow}
    named = {}
    for name, info in type(spec).model_fields.items():
        for mark in info.metadata:
            if isinstance(mark, NameIn) and mark.field in members:
                named[name] = members[mark.field][plain.pop(name)]
    return CaseKeys(plain, members, named, _user_filters(one))


def _user_filters(one: CaseResult | Case) -> dict[str, str]:
    """What filters from outside depend on, by their names."""
    if isinstance(one, Case):
        return {member.name: member.identity for member in one.outside}
    axes: Any = one.outside and one.outside.axes
    return dict(zip(axes.filters, axes.identities, strict=True)) if axes else {}


def paper_members(mine: CaseKeys, shipped: Iterable[CaseKeys], may_grow: Sequence[str]) -> dict[str, set[int]] | None:
    """For a paper's case, the indices of the paper's members of its lists; None for any other case.

    shipped: the cases of the claim's config."""
    found: dict[str, set[int]] | None = None
    for papers in shipped:
        same = is_equal(mine.fixed, papers.fixed) and is_equal(mine.named, papers.named)
        if not same or not papers.outside.items() <= mine.outside.items():
            continue
        places = {key: _member_indices(papers.members[key], mine.members[key]) for key in may_grow}
        if all(len(places[key]) == len(papers.members[key]) for key in may_grow):
            found = {key: places[key] | (found or {}).get(key, set()) for key in may_grow}
    return found


def key_differences(mine: CaseKeys, shipped: Iterable[CaseKeys], may_grow: Sequence[str]) -> list[str]:
    """The keys in which a case differs from the nearest of these, "key is x, the paper's y"; empty if none."""
    shipped = list(shipped)
    if paper_members(mine, shipped, may_grow) is not None:
        return []
    every = [
        _data_differences(mine.fixed, papers.fixed) + _member_differences(mine, papers, may_grow) for papers in shipped
    ]
    return min(every, key=len, default=["no such experiment is shipped"])


def _member_differences(mine: CaseKeys, papers: CaseKeys, may_grow: Sequence[str]) -> list[str]:
    said = []
    for key in may_grow:
        missing = len(papers.members[key]) - len(_member_indices(papers.members[key], mine.members[key]))
        if missing:
            said.append(f"{missing} of the paper's {len(papers.members[key])} {key} changed or missing")
    if others := [name for name, one in papers.outside.items() if mine.outside.get(name) != one]:
        said.append(f"filter {', '.join(others)} missing, or of other code")
    if not is_equal(mine.named, papers.named):
        said.append(f"{', '.join(papers.named)} differs from the paper's")
    return said


def _data_differences(mine: object, papers: object, path: str = "") -> list[str]:
    """The keys of plain data in which two differ, by dotted path."""
    if is_equal(mine, papers):
        return []
    if isinstance(mine, dict) and isinstance(papers, dict):
        if mine.get("kind") != papers.get("kind"):  # keys of one kind are meaningless for another
            return _data_differences(mine.get("kind"), papers.get("kind"), f"{path}.kind".strip("."))
        keys = dict.fromkeys((*mine, *papers))
        return [
            line
            for key in keys
            for line in _data_differences(mine.get(key), papers.get(key), f"{path}.{key}".strip("."))
        ]
    if isinstance(mine, list) and isinstance(papers, list) and len(mine) == len(papers):
        pairs = enumerate(zip(mine, papers, strict=True))
        return [line for i, (own, other) in pairs for line in _data_differences(own, other, f"{path}.{i}")]
    return [f"{path} is {_quoted(mine)}, the paper's {_quoted(papers)}"]


def _quoted(value: object) -> str:
    if value is None:
        return "none"
    text = f"{value:g}" if isinstance(value, int | float) and not isinstance(value, bool) else str(value)
    return text if len(text) <= MAX_QUOTED_CHARACTERS else text[:MAX_QUOTED_CHARACTERS] + "…"


MAX_QUOTED_CHARACTERS = 40  # characters of a value quoted in a reason


def _member_indices(wanted: Sequence, given: Sequence) -> set[int]:
    """The indices of the wanted members among the given ones, all different."""
    places: set[int] = set()
    for one in wanted:
        place = next((i for i, other in enumerate(given) if i not in places and is_equal(one, other)), None)
        if place is not None:
            places.add(place)
    return places


def is_equal(one: object, other: object) -> bool:
    """Whether plain data are equal, numbers to a relative 10⁻¹²."""
    if isinstance(one, dict) and isinstance(other, dict):
        return one.keys() == other.keys() and all(is_equal(value, other[key]) for key, value in one.items())
    if isinstance(one, list) and isinstance(other, list):
        return len(one) == len(other) and all(map(is_equal, one, other))
    if isinstance(one, bool) or isinstance(other, bool):
        return one is other
    if isinstance(one, int | float) and isinstance(other, int | float):
        return math.isclose(one, other, rel_tol=RELATIVE_TOLERANCE)
    return one == other
