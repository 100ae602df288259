"""A document checked against a schema: pydantic's errors, reported in plain text at the place of the value.

Names of keys: one text, symbol and unit for each, from the schema of its study: `key("scan period", "time between two
plots, s", symbol="Δt")`. The unit is the one at the end of the key's name; a key without such an ending, or with an
unusual one, gives it beside the symbol, as `unit`."""

import math
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, get_args, get_origin

from pydantic import AfterValidator, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, PydanticCustomError

from radarsim.config.document import ABSENT, Document, Faults, KeyPath, child, did_you_mean, short
from radarsim.config.fields import At, Model, NotRead, Study, in_degrees, in_radians, radians
from radarsim.config.schema import Common

# ---- check -----------------------------------------------------------------------------------------------------------
M = TypeVar("M", bound=Model)
MESSAGES = {
    "missing": "required key is missing",
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "bool_type": "must be true or false",
    "string_type": "must be text",
    "tuple_type": "must be a list",
    "list_type": "must be a list",
    "dict_type": "must be a mapping of keys",
    "model_type": "must be a mapping of keys",
    "model_attributes_type": "must be a mapping of keys",
    "finite_number": "must be a finite number",
    "string_too_short": "must not be empty",
    "string_too_long": "must have at most {max_length} characters",
    "too_short": "must hold at least {min_length}",
    "too_long": "must hold at most {max_length}",
    "literal_error": "must be one of {expected}",
    "union_tag_invalid": "must be one of {expected_tags}",
    "greater_than": "must be > {gt}",
    "greater_than_equal": "must be >= {ge}",
    "less_than": "must be < {lt}",
    "less_than_equal": "must be <= {le}",
}
MAPPING = {"model_type", "model_attributes_type", "dict_type"}
LIST = {"tuple_type", "list_type"}
SCALAR = {"float_type", "int_type", "bool_type", "string_type", "literal_error"}
BOUNDS = ("gt", "ge", "lt", "le")
WITHOUT_VALUE = ("missing", "extra_forbidden", "unique", "union_tag_not_found")


def check(model: type[M], document: Document, faults: Faults, also: Iterable[str] = ()) -> M | None:
    """The document as a checked object; None, with faults noted, if it is invalid. `also` are top-level keys that are
    checked elsewhere and are listed among the allowed ones."""
    refuse_both_units(document, faults)
    try:
        return model.model_validate(document.data)
    except ValidationError as error:
        errors = error.errors(include_url=False, include_input=False)
        found = [one for each in errors for one in _Found.of(each, document)]
        for each in found:
            if not _irrelevant(each, found, document):
                _report(model, document, each, faults, also)
        for each in _Partial(model, document, found, faults).misfits():
            _report(model, document, each, faults, also)
        return None


@dataclass(frozen=True)
class _Found:
    """One of pydantic's errors: its kind, the path of the value as the user wrote it, and the data for its message."""

    kind: str
    path: KeyPath
    context: dict[str, Any]
    text: str

    @classmethod
    def of(cls, error: ErrorDetails, document: Document) -> "list[_Found]":
        """One, or one for each fault of a mapping's cross-checks."""
        kind, context = error["type"], dict(error.get("ctx", {}))
        path = path_in(document.data, error["loc"], keep_last=kind in ("missing", "extra_forbidden"))
        if kind in ("union_tag_invalid", "union_tag_not_found", "no_such_kind"):
            path = (*path, context["discriminator"].strip("'"))
            kind = kind if document.get(path) is not ABSENT else "missing"
        if kind == "at":
            return [cls.misfit(each, path, document) for each in context["faults"]]
        return [cls(kind, path, context, error["msg"])]

    @classmethod
    def misfit(cls, fault: At, path: KeyPath, document: Document) -> "_Found":
        """A fault from a cross-check of the mapping at a path."""
        *above, key = fault.key.split(".")
        outer = [int(step) if step.isdecimal() else step for step in above]
        return cls("at", twin(document.data, (*path, *outer), key), {"message": fault.message}, fault.message)


class _Partial:
    """A document with faults: its valid part, for the cross-checks that need no more.

    Where a mapping has an unknown key, its optional keys that are not given count as unread: one may be misspelt."""

    def __init__(self, model: type[Model], document: Document, found: list[_Found], faults: Faults):
        self.model, self.document, self.faults = model, document, faults
        self.whole = {one.path for one in found if one.kind not in ("unique", "extra_forbidden")}
        self.inside = {one.path[:n] for one in found for n in range(len(one.path) + 1)}
        self.unknown = {one.path[:-1] for one in found if one.kind == "extra_forbidden"}
        self.more: list[_Found] = []

    def misfits(self) -> list[_Found]:
        """Further faults, from the cross-checks."""
        with suppress(NotRead):
            self._read(())
        return self.more

    def _read(self, path: KeyPath) -> Model:
        """The mapping at a path, without the fields that have faults; raises NotRead if it is not a mapping."""
        model, data = model_at(self.model, self.document.data, path), self.document.get(path)
        if path in self.whole or model is None or not isinstance(data, dict):
            raise NotRead
        if path not in self.inside:
            return model.model_validate(data)
        read, unread = {}, []
        for name, info in model.model_fields.items():
            key = twin(data, (), name)[0]
            try:
                if key in data:
                    read[name] = self._field((*path, key), name, info, model)
                elif info.is_required() or path in self.unknown or (*path, key) in self.whole:
                    unread.append(name)
            except (NotRead, ValidationError):
                unread.append(name)
        part = model.model_construct(**read)
        for name in unread:
            part.__dict__.pop(name, None)
        misfits = list(part.misfits())
        self.more += [_Found.misfit(each, path, self.document) for each in misfits]
        for each in misfits:
            part.__dict__.pop(each.key, None)  # the mapping around it must not rely on it
        return part

    def _field(self, path: KeyPath, name: str, info: FieldInfo, model: type[Model]) -> Any:
        data = self.document.get(path)
        if path in self.whole or self.faults.spoiled(self.document.origin(path), path):
            raise NotRead
        if path not in self.inside:
            return _reader(model, name).validate_python(radians(data) if path[-1] != name else data)
        if not models_in(info.annotation) or not isinstance(data, list):
            return self._read(path)
        members = tuple([self._read((*path, i)) for i in range(len(data))])
        for mark in info.metadata:
            if isinstance(mark, AfterValidator):
                self._validate(mark.func, members, path)
        return members

    def _validate(self, check: Callable[..., Any], members: tuple[Model, ...], path: KeyPath) -> None:
        """Let a check of the whole list see the valid members."""
        try:
            check(members)
        except NotRead:
            return
        except PydanticCustomError as error:
            self.more.append(_Found(error.type, path, dict(error.context or {}), error.message()))


@cache
def _reader(model: type[Model], name: str) -> TypeAdapter[Any]:
    """The check of one field by itself."""
    info = model.model_fields[name]
    annotated: Any = Annotated[info.annotation, info]
    return TypeAdapter(annotated)


def _irrelevant(one: _Found, found: list[_Found], document: Document) -> bool:
    """Whether an error concerns a member of a choice that the value, by its form, was not meant to be."""
    value = document.get(one.path)
    form = MAPPING if isinstance(value, dict) else LIST if isinstance(value, list) else SCALAR
    if one.kind not in (MAPPING | LIST | SCALAR) - form:
        return False
    depth = len(one.path)
    others = [other for other in found if other.path[:depth] == one.path and other is not one]
    forms = [other for other in found if other.path == one.path and other.kind in MAPPING | LIST | SCALAR]
    if one is not forms[0] and all(other.kind in (MAPPING | LIST | SCALAR) - form for other in forms):
        return True  # it has the form of no member: the first is named
    return any(len(other.path) > depth or other.kind not in (MAPPING | LIST | SCALAR) - form for other in others)


def _report(model: type[Model], document: Document, found: _Found, faults: Faults, also: Iterable[str]) -> None:
    """Note one of pydantic's errors as a fault."""
    kind, path, context = found.kind, found.path, found.context
    if faults.spoiled(document.origin(path), path):
        return
    if kind == "extra_forbidden":
        holder = model_at(model, document.data, path[:-1])
        known = allowed_keys(holder) if holder else ()
        message = unknown_key(path[-1], [*known, *(also if len(path) == 1 else ())])
        faults.add(document.key_origin(path), path, message)
        return
    message = _message(kind, context, found.text, str(path[-1]) if path else "")
    value = document.get(path)
    if kind == "too_short" and isinstance(value, list | dict) and len(value) >= context["min_length"]:
        return  # pydantic counts the good members alone; the bad ones are reported one by one
    if kind in WITHOUT_VALUE or value is ABSENT:
        faults.add(document.origin(path), path, message)
    else:
        faults.add(document.origin(path), path, message, value)


def _message(kind: str, context: dict[str, Any], original: str, key: str) -> str:
    """The requirement, as text; bounds of a `_deg` key in degrees."""
    if kind == "at":
        return str(context["message"])
    if kind == "value_error":
        return str(context["error"])
    for bound in BOUNDS:
        if bound in context:
            limit = math.degrees(context[bound]) if in_radians(key) else context[bound]
            context[bound] = short(float(f"{limit:.12g}") if isinstance(limit, float) else limit)
    if "expected" in context:
        context["expected"] = context["expected"].replace("'", "").replace(" or ", ", ")
    if "expected_tags" in context:
        context["expected_tags"] = context["expected_tags"].replace("'", "")
    if kind in MESSAGES:
        return MESSAGES[kind].format(**context)
    if kind.startswith("int_"):  # a fraction, or a whole number of too many digits
        return "must be a whole number"
    return original


def unknown_key(key: object, known: Iterable[str]) -> str:
    """The message for an unknown key."""
    known = list(known)
    near = did_you_mean(str(key), known) or ";"
    return f"unknown key{near} allowed: {', '.join(known)}"


def path_in(data: object, location: tuple[int | str, ...], keep_last: bool) -> KeyPath:
    """The keys of pydantic's location as in the data: without names of union members, `_deg` as written."""
    path: KeyPath = ()
    for i, step in enumerate(location):
        written = step
        if child(data, step) is ABSENT and isinstance(data, dict) and isinstance(step, str):
            written = twin(data, (), step)[0]
        below = child(data, written)
        if below is ABSENT and not (keep_last and i == len(location) - 1):
            continue
        path, data = (*path, written), below
    return path


def twin(data: object, path: KeyPath, key: str) -> KeyPath:
    """The path of a key below a path, under its `_deg` name where the user wrote that."""
    for step in path:
        data = child(data, step)
    other = in_degrees(key)
    if other and child(data, key) is ABSENT and child(data, other) is not ABSENT:
        return (*path, other)
    return (*path, key)


def allowed_keys(model: type[Model]) -> list[str]:
    """The keys of a mapping, with the `_deg` twins."""
    return [key for name in model.model_fields for key in (name, in_degrees(name)) if key]


def model_at(model: type[Model], data: object, path: KeyPath) -> type[Model] | None:
    """The schema of the mapping at a path; of a choice, the member with the data's kind."""
    current: type[Model] | None = model
    candidates = [model]
    for step in path:
        data = child(data, step)
        if isinstance(step, str):
            if current is None or step not in current.model_fields:
                return None
            candidates = models_in(current.model_fields[step].annotation)
        current = _chosen(candidates, data)
    return current


def models_in(annotation: object) -> list[type[Model]]:
    """All schemas in an annotation: of a choice, a list, an optional."""
    if isinstance(annotation, type) and issubclass(annotation, Model):
        return [annotation]
    return [model for argument in get_args(annotation) for model in models_in(argument)]


def _chosen(candidates: list[type[Model]], data: object) -> type[Model] | None:
    fitting = [model for model in candidates if _fits(model, data)] if len(candidates) > 1 else candidates
    return fitting[0] if fitting else None


def _fits(model: type[Model], data: object) -> bool:
    """Whether the fields with one allowed value, which distinguish a choice's members, have it in the data."""
    fields = [(name, info) for name, info in model.model_fields.items() if get_origin(info.annotation) is Literal]
    tags = [(name, get_args(i.annotation)[0], i.default) for name, i in fields if len(get_args(i.annotation)) == 1]
    return isinstance(data, dict) and all(data.get(name, default) == tag for name, tag, default in tags)


def refuse_both_units(document: Document, faults: Faults, path: KeyPath = ()) -> None:
    """Note every quantity that is given in radians and in degrees at once."""
    data = document.get(path)
    if isinstance(data, list):
        data = dict(enumerate(data))
    if not isinstance(data, dict):
        return
    for key, value in data.items():
        if isinstance(value, dict | list):
            refuse_both_units(document, faults, (*path, key))
        elif (other := in_radians(str(key))) in data and other:
            faults.add(document.key_origin((*path, key)), (*path, key), f"given as {other} too")


# ---- labels ----------------------------------------------------------------------------------------------------------
UNITS = {
    **{"m": "m", "s": "s", "mps": "m/s", "mps2": "m/s²", "mps3": "m/s³", "rad": "rad", "deg": "°", "hz": "Hz"},
    **{"radps": "rad/s", "degps": "°/s", "radps2": "rad/s²", "degps2": "°/s²", "g": "g", "db": "dB"},
    **{"kgpm2": "kg/m²"},
}


class Words(str):
    """The name of a key, and the top-level package of its schema, whose catalogues translate it."""

    package = ""


class Label(NamedTuple):
    """A key in words: "scan period", its symbol in the papers ("Δt", "σ_r": a subscript after _) and its unit. Symbol
    and unit are empty where there is none."""

    text: str
    symbol: str
    unit: str


def label(keys: Study | type[Study] | None, key: str) -> Label:
    """The label of a key, dotted or bare, as `sweep` and `--set` name it; keys are a study's, checked or not.

    >>> from radarsim.studies import registry
    >>> label(registry.keys("range_doppler"), "radar.sigma_velocity_mps")
    Label(text='σ of the measured radial velocity', symbol='σ_V', unit='m/s')

    A key without a schema is named by its own words:

    >>> label(None, "echo.rise_time_s")
    Label(text='rise time', symbol='', unit='s')
    """
    steps = [step for step in key.split(".") if not step.isdecimal()]
    stem, _, end = steps[-1].rpartition("_")
    unit = UNITS.get(end, "") if stem and not stem.endswith("_per") else ""  # hertz per second are not seconds
    at = _field(keys, steps) if keys is not None else None
    if keys is not None and at is None and len(steps) > 2:
        at = _field(keys, [steps[0], *steps[2:]])  # filters.NAME.KEY
    holder, found = at or _field(Common, steps) or (None, None)
    if found is None:
        name = stem if unit else steps[-1]
        return Label(name.replace("_", " "), "", unit)
    extra = found.json_schema_extra if isinstance(found.json_schema_extra, dict) else {}
    text = Words(found.title or (stem if unit else steps[-1]).replace("_", " "))
    text.package = holder.__module__.partition(".")[0] if holder else ""
    own = unit if in_radians(steps[-1]) else str(extra.get("unit", unit))  # a twin in degrees has no field of its own
    return Label(text, str(extra.get("symbol", "")), own)


def _field(keys: Model | type[Model], steps: list[str]) -> tuple[type[Model], FieldInfo] | None:
    """The field at dotted steps, from the top or, for a bare key, from the members of the study's list.

    With it the schema that names it: a base class, where the field is inherited."""
    model = keys if isinstance(keys, type) else type(keys)
    if steps and _named(steps[0]).isdisjoint(model.model_fields) and issubclass(model, Study):
        steps = [model.bare_keys, *steps]
    holders: list[Any] = [keys]
    found: tuple[type[Model], FieldInfo] | None = None
    for step in steps:
        at = next(((one, name) for one in holders for name in _named(step) if name in _fields(one)), None)
        if at is None:
            return None
        holder, name = at
        info = _fields(holder)[name]
        line = [one for one in (holder if isinstance(holder, type) else type(holder)).__mro__ if issubclass(one, Model)]
        alike = [one for one in line if name in one.model_fields and one.model_fields[name].title == info.title]
        found = alike[-1], info
        given = [] if isinstance(holder, type) else list(_models(getattr(holder, name)))
        holders = [*given, *models_in(info.annotation)]
    return found


def _named(step: str) -> set[str]:
    """A key, and its twin in radians where it is one in degrees."""
    return {step, in_radians(step) or step}


def _fields(model: Model | type[Model]) -> dict[str, FieldInfo]:
    return (model if isinstance(model, type) else type(model)).model_fields


def _models(value: object) -> Iterator[Model]:
    """The mappings that a value is or holds: of a choice, the given kind."""
    if isinstance(value, Model):
        yield value
    elif isinstance(value, tuple | list):
        for one in value:
            yield from _models(one)
