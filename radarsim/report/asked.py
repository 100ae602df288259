"""What was asked: every key of the cases with its value and the schema's description."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, TypeGuard

from radarsim.config.experiment import Case
from radarsim.config.fields import Model
from radarsim.language import numeral, plural, tr
from radarsim.report import tables as common
from radarsim.report.text import number

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("key", "value", "meaning")
MOST_ENTRIES = 12  # of a list shown one by one
MOST_CASES = 40  # shown row by row


def asked(cases: Sequence[Case]) -> "dict[str, pd.DataFrame]":
    """Tables of text by their title: what all cases share, and where there are several, in what they differ."""
    keys_of = {case.name: {key: (value, about) for key, value, about in described(case.spec)} for case in cases}
    first = keys_of[cases[0].name]
    shared = [
        (key, value, about)
        for key, (value, about) in first.items()
        if all(key in other and other[key][0] == value for other in keys_of.values())
    ]
    counts, seeds = (sorted({value(case) for case in cases}) for value in (_realisations, _seed))
    counted = [("realisations", numeral(f"{n:,}"), tr("independent runs")) for n in counts]
    counted += [("seed", str(s), tr("of the noise")) for s in seeds]
    title = plural("Every key with its value and meaning", "What all {count} cases share", len(cases))
    made = {title: _frame(COLUMNS, [*shared, *(counted if len(counted) == 2 else [])])}
    if len(cases) > 1:
        same = {key for key, _, _ in shared}
        keys = list(dict.fromkeys(key for of in keys_of.values() for key in of if key not in same))
        rows: list[tuple[object, ...]] = []
        for case in cases[:MOST_CASES]:
            values = (keys_of[case.name].get(key, ("–", ""))[0] for key in keys)
            rows.append((case.name, *values, numeral(f"{case.realisations:,}"), case.seed))
        left = len(cases) - len(rows)
        title = tr("In what the cases differ")
        if left:
            title = tr("In what the cases differ (first {shown}; {left} more in run.json)", shown=len(rows), left=left)
        made[title] = _frame(("case", *keys, "realisations", "seed"), rows)
    return made


def _realisations(case: Case) -> int:
    return case.realisations


def _seed(case: Case) -> int:
    return case.seed


def _frame(columns: Sequence[str], rows: Sequence[tuple[object, ...]]) -> "pd.DataFrame":
    return common.frame({name: [row[i] for row in rows] for i, name in enumerate(columns)})


def described(model: Model, before: str = "") -> Iterator[tuple[str, str, str]]:
    """Key, value and meaning of every field that a checked model holds, in the order of its schema."""
    for name, field in type(model).model_fields.items():
        value = getattr(model, name)
        about = tr(" ".join((field.description or "").split()))
        if isinstance(value, Model):
            yield from described(value, f"{before}{name}.")
        elif _models(value):
            for i, one in enumerate(value[:MOST_ENTRIES]):
                yield f"{before}{name}.{i}", "; ".join(_pairs(one)), about if i == 0 else ""
            if len(value) > MOST_ENTRIES:
                yield f"{before}{name}", tr("{count} more", count=len(value) - MOST_ENTRIES), ""
        elif value is not None and value != ():
            yield f"{before}{name}", as_text(name, value), about


def _models(value: object) -> TypeGuard[Sequence[Model]]:
    return isinstance(value, tuple | list) and bool(value) and all(isinstance(one, Model) for one in value)


def _pairs(model: Model) -> Iterator[str]:
    """A short "key value" for each field that is set."""
    for name in type(model).model_fields:
        value = getattr(model, name)
        if isinstance(value, Model):
            yield f"{name}: {', '.join(_pairs(value))}"
        elif _models(value):
            yield f"{name}: {' | '.join(', '.join(_pairs(one)) for one in value)}"
        elif value is not None and value != ():
            yield f"{name} {as_text(name, value)}"


def as_text(name: str, value: object) -> str:
    """A value as text: angles in degrees too, lists with commas."""
    if isinstance(value, bool):
        return tr("yes") if value else tr("no")
    if isinstance(value, float):
        text = number(value, 6)
        degrees = {"_rad": "°", "_radps": "°/s"}.get(name[name.rfind("_") :]) if "_" in name else None
        return f"{text} ({number(math.degrees(value), 6)}{degrees})" if degrees and value else text
    if isinstance(value, tuple | list):
        return ", ".join(
            as_text(name, one) if not isinstance(one, tuple | list) else f"[{as_text(name, one)}]" for one in value
        )
    if isinstance(value, Mapping):
        return ", ".join(f"{key}: {as_text(str(key), one)}" for key, one in value.items())
    return str(value)
