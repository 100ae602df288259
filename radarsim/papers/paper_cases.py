"""Whether a case is the paper's own experiment; only such cases may judge its claims.

A claim names the shipped config that holds its experiment. A case is the paper's when its checked keys equal those of a
case of that config. These may differ: the number of realisations, the seed and the options of a run, which are not keys
of a study; display names (`config.marks.DisplayMark`); and members added to a list that the study declares in
`PaperClaims.may_grow`, or user filters (`python:`) beside the paper's own."""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from radarsim.config.experiment import Case
from radarsim.config.identity import identity_keys
from radarsim.config.marks import NameIn
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
    named_members: dict[str, object]
    user_filters: dict[str, str]


def case_keys(case: CaseResult | Case, may_grow: Sequence[str], may_shorten: Sequence[str] = ()) -> CaseKeys:
    """The keys of a case for comparison: all but may_shorten."""
    spec = case.spec
    keys = {key: value for key, value in identity_keys(spec).items() if key not in may_shorten}
    members = {key: keys.pop(key) for key in may_grow}
    named_members = {}
    for name, info in type(spec).model_fields.items():
        for mark in info.metadata:
            if isinstance(mark, NameIn) and mark.field in members:
                named_members[name] = members[mark.field][keys.pop(name)]
    return CaseKeys(keys, members, named_members, _user_filters(case))


def _user_filters(case: CaseResult | Case) -> dict[str, str]:
    """What filters from outside depend on, by their names."""
    if isinstance(case, Case):
        return {member.name: member.identity for member in case.user_filters}
    axes: Any = case.user_filters and case.user_filters.axes
    return dict(zip(axes.filters, axes.identities, strict=True)) if axes else {}


def paper_members(
    case: CaseKeys, paper_cases: Iterable[CaseKeys], may_grow: Sequence[str]
) -> dict[str, set[int]] | None:
    """For a paper's case, the indices of the paper's members of its lists; None for any other case.

    shipped: the cases of the claim's config."""
    members: dict[str, set[int]] | None = None
    for paper_case in paper_cases:
        is_same = is_equal(case.fixed, paper_case.fixed) and is_equal(case.named_members, paper_case.named_members)
        if not is_same or not paper_case.user_filters.items() <= case.user_filters.items():
            continue
        indices = {key: _member_indices(paper_case.members[key], case.members[key]) for key in may_grow}
        if all(len(indices[key]) == len(paper_case.members[key]) for key in may_grow):
            members = {key: indices[key] | (members or {}).get(key, set()) for key in may_grow}
    return members


def key_differences(case: CaseKeys, paper_cases: Iterable[CaseKeys], may_grow: Sequence[str]) -> list[str]:
    """The keys in which a case differs from the nearest of these, "key is x, the paper's y"; empty if none."""
    paper_cases = list(paper_cases)
    if paper_members(case, paper_cases, may_grow) is not None:
        return []
    differences = [
        _data_differences(case.fixed, paper_case.fixed) + _member_differences(case, paper_case, may_grow)
        for paper_case in paper_cases
    ]
    return min(differences, key=len, default=["no such experiment is shipped"])


def _member_differences(case: CaseKeys, paper_case: CaseKeys, may_grow: Sequence[str]) -> list[str]:
    lines = []
    for key in may_grow:
        missing = len(paper_case.members[key]) - len(_member_indices(paper_case.members[key], case.members[key]))
        if missing:
            lines.append(f"{missing} of the paper's {len(paper_case.members[key])} {key} changed or missing")
    if changed_filters := [
        name for name, identity in paper_case.user_filters.items() if case.user_filters.get(name) != identity
    ]:
        lines.append(f"filter {', '.join(changed_filters)} missing, or of other code")
    if not is_equal(case.named_members, paper_case.named_members):
        lines.append(f"{', '.join(paper_case.named_members)} differs from the paper's")
    return lines


def _data_differences(value: object, paper_value: object, path: str = "") -> list[str]:
    """The keys of plain data in which two differ, by dotted path."""
    if is_equal(value, paper_value):
        return []
    if isinstance(value, dict) and isinstance(paper_value, dict):
        if value.get("kind") != paper_value.get("kind"):  # keys of one kind are meaningless for another
            return _data_differences(value.get("kind"), paper_value.get("kind"), f"{path}.kind".strip("."))
        keys = dict.fromkeys((*value, *paper_value))
        return [
            line
            for key in keys
            for line in _data_differences(value.get(key), paper_value.get(key), f"{path}.{key}".strip("."))
        ]
    if isinstance(value, list) and isinstance(paper_value, list) and len(value) == len(paper_value):
        pairs = enumerate(zip(value, paper_value, strict=True))
        return [line for i, (item, paper_item) in pairs for line in _data_differences(item, paper_item, f"{path}.{i}")]
    return [f"{path} is {_quoted(value)}, the paper's {_quoted(paper_value)}"]


def _quoted(value: object) -> str:
    if value is None:
        return "none"
    text = f"{value:g}" if isinstance(value, int | float) and not isinstance(value, bool) else str(value)
    return text if len(text) <= MAX_QUOTED_CHARACTERS else text[:MAX_QUOTED_CHARACTERS] + "…"


MAX_QUOTED_CHARACTERS = 40  # characters of a value quoted in a reason


def _member_indices(members: Sequence, available: Sequence) -> set[int]:
    """The indices of the wanted members among the given ones, all different."""
    indices: set[int] = set()
    for member in members:
        index = next(
            (i for i, candidate in enumerate(available) if i not in indices and is_equal(member, candidate)), None
        )
        if index is not None:
            indices.add(index)
    return indices


def is_equal(first: object, second: object) -> bool:
    """Whether plain data are equal, numbers to a relative 10⁻¹²."""
    if isinstance(first, dict) and isinstance(second, dict):
        return first.keys() == second.keys() and all(is_equal(value, second[key]) for key, value in first.items())
    if isinstance(first, list) and isinstance(second, list):
        return len(first) == len(second) and all(map(is_equal, first, second))
    if isinstance(first, bool) or isinstance(second, bool):
        return first is second
    if isinstance(first, int | float) and isinstance(second, int | float):
        return math.isclose(first, second, rel_tol=RELATIVE_TOLERANCE)
    return first == second
