"""Check a document against a schema; report pydantic's errors in plain text at the place of the value."""

import math
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin

from pydantic import AfterValidator, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, PydanticCustomError

from radarsim.config.cross_checks import CheckError, InvalidFieldError
from radarsim.config.document import Document, child
from radarsim.config.error_list import ABSENT, ErrorList
from radarsim.config.find_files import did_you_mean
from radarsim.config.model import Model, in_degrees, in_radians, radians
from radarsim.config.value_text import KeyPath, short_number

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
MAPPING_ERRORS = {"model_type", "model_attributes_type", "dict_type"}
LIST_ERRORS = {"tuple_type", "list_type"}
SCALAR_ERRORS = {"float_type", "int_type", "bool_type", "string_type", "literal_error"}
FORM_ERRORS = MAPPING_ERRORS | LIST_ERRORS | SCALAR_ERRORS
BOUND_NAMES = ("gt", "ge", "lt", "le")
ERRORS_WITHOUT_VALUE = ("missing", "extra_forbidden", "unique", "union_tag_not_found")


def validate(model: type[M], document: Document, faults: ErrorList, also: Iterable[str] = ()) -> M | None:
    """The document as a checked object; None, with errors added, if it is invalid.

    also: top-level keys that are checked elsewhere, and listed among the allowed ones."""
    refuse_both_units(document, faults)
    try:
        return model.model_validate(document.data)
    except ValidationError as error:
        pydantic_errors = error.errors(include_url=False, include_input=False)
        input_errors = [item for raw in pydantic_errors for item in _InputError.from_pydantic(raw, document)]
        relevant = [item for item in input_errors if not _is_of_other_member(item, input_errors, document)]
        misfits = _PartialCheck(model, document, input_errors, faults).misfits()
        for input_error in (*relevant, *misfits):
            _add_fault(model, document, input_error, faults, also)
        return None


@dataclass(frozen=True)
class _InputError:
    """An error that pydantic found: its kind, the path of the value as written, and the data for its message."""

    kind: str
    path: KeyPath
    context: dict[str, Any]
    text: str

    @classmethod
    def from_pydantic(cls, error: ErrorDetails, document: Document) -> "list[_InputError]":
        """The errors that one of pydantic's stands for: several if it collects those of a mapping's cross-checks."""
        kind, context = error["type"], dict(error.get("ctx", {}))
        path = path_in(document.data, error["loc"], keep_last=kind in ("missing", "extra_forbidden"))
        if kind in ("union_tag_invalid", "union_tag_not_found", "no_such_kind"):
            path = (*path, context["discriminator"].strip("'"))
            kind = kind if document.get(path) is not ABSENT else "missing"
        if kind == "cross_check":
            return [cls.misfit(misfit, path, document) for misfit in context["faults"]]
        return [cls(kind, path, context, error["msg"])]

    @classmethod
    def misfit(cls, fault: CheckError, path: KeyPath, document: Document) -> "_InputError":
        """The error that a cross-check of the mapping at a path reports."""
        *outer_steps, key = fault.key.split(".")
        outer_path = [int(step) if step.isdecimal() else step for step in outer_steps]
        return cls(
            "cross_check", twin(document.data, (*path, *outer_path), key), {"message": fault.message}, fault.message
        )


class _PartialCheck:
    """Runs the cross-checks of a document with errors on those of its fields that are valid.

    If a mapping has an unknown key, its missing optional keys count as unread, since one of them may be misspelt."""

    def __init__(self, model: type[Model], document: Document, input_errors: list[_InputError], faults: ErrorList):
        self.model, self.document, self.faults = model, document, faults
        self.unusable_paths = {error.path for error in input_errors if error.kind not in ("unique", "extra_forbidden")}
        self.paths_with_errors = {error.path[:n] for error in input_errors for n in range(len(error.path) + 1)}
        self.paths_with_unknown_keys = {error.path[:-1] for error in input_errors if error.kind == "extra_forbidden"}
        self.further_errors: list[_InputError] = []

    def misfits(self) -> list[_InputError]:
        """The errors that the cross-checks find."""
        with suppress(InvalidFieldError):
            self._read(())
        return self.further_errors

    def _read(self, path: KeyPath) -> Model:
        """The mapping at a path without the fields that have errors; InvalidFieldError if it is not a mapping."""
        model, data = model_at(self.model, self.document.data, path), self.document.get(path)
        if path in self.unusable_paths or model is None or not isinstance(data, dict):
            raise InvalidFieldError
        if path not in self.paths_with_errors:
            return model.model_validate(data)
        valid_values, unread_names = {}, []
        for name, info in model.model_fields.items():
            key = twin(data, (), name)[0]
            try:
                if key in data:
                    valid_values[name] = self._field((*path, key), name, info, model)
                elif info.is_required() or path in self.paths_with_unknown_keys or (*path, key) in self.unusable_paths:
                    unread_names.append(name)
            except (InvalidFieldError, ValidationError):
                unread_names.append(name)
        partial_model = model.model_construct(**valid_values)
        for name in unread_names:
            partial_model.__dict__.pop(name, None)
        misfits = list(partial_model.misfits())
        self.further_errors += [_InputError.misfit(misfit, path, self.document) for misfit in misfits]
        for misfit in misfits:
            partial_model.__dict__.pop(misfit.key, None)  # the mapping around it must not rely on it
        return partial_model

    def _field(self, path: KeyPath, name: str, info: FieldInfo, model: type[Model]) -> Any:
        data = self.document.get(path)
        if path in self.unusable_paths or self.faults.is_unusable(self.document.origin(path), path):
            raise InvalidFieldError
        if path not in self.paths_with_errors:
            return _field_adapter(model, name).validate_python(radians(data) if path[-1] != name else data)
        if not models_in(info.annotation) or not isinstance(data, list):
            return self._read(path)
        members = tuple([self._read((*path, i)) for i in range(len(data))])
        for mark in info.metadata:
            if isinstance(mark, AfterValidator):
                self._validate(mark.func, members, path)
        return members

    def _validate(self, validator: Callable[..., Any], members: tuple[Model, ...], path: KeyPath) -> None:
        """Run the check of a list on its valid members."""
        try:
            validator(members)
        except InvalidFieldError:
            return
        except PydanticCustomError as error:
            self.further_errors.append(_InputError(error.type, path, dict(error.context or {}), error.message()))


@cache
def _field_adapter(model: type[Model], name: str) -> TypeAdapter[Any]:
    """The check of a single field."""
    info = model.model_fields[name]
    annotated: Any = Annotated[info.annotation, info]
    return TypeAdapter(annotated)


def _is_of_other_member(error: _InputError, errors: list[_InputError], document: Document) -> bool:
    """Whether an error is about a member of a choice whose form (mapping, list or scalar) the value does not have."""
    value = document.get(error.path)
    fitting = MAPPING_ERRORS if isinstance(value, dict) else LIST_ERRORS if isinstance(value, list) else SCALAR_ERRORS
    wrong_form = FORM_ERRORS - fitting
    if error.kind not in wrong_form:
        return False
    depth = len(error.path)
    other_errors = [item for item in errors if item.path[:depth] == error.path and item is not error]
    errors_of_form = [item for item in errors if item.path == error.path and item.kind in FORM_ERRORS]
    if error is not errors_of_form[0] and all(item.kind in wrong_form for item in errors_of_form):
        return True  # the value has the form of no member: only the error of the first is reported
    return any(len(item.path) > depth or item.kind not in wrong_form for item in other_errors)


def _add_fault(
    model: type[Model], document: Document, input_error: _InputError, faults: ErrorList, further_keys: Iterable[str]
) -> None:
    """Add an error in plain text at the place of its value."""
    kind, path, context = input_error.kind, input_error.path, input_error.context
    if faults.is_unusable(document.origin(path), path):
        return
    if kind == "extra_forbidden":
        holder = model_at(model, document.data, path[:-1])
        known_keys = allowed_keys(holder) if holder else ()
        message = unknown_key_message(path[-1], [*known_keys, *(further_keys if len(path) == 1 else ())])
        faults.add(document.key_origin(path), path, message)
        return
    message = _message(kind, context, input_error.text, str(path[-1]) if path else "")
    value = document.get(path)
    if kind == "too_short" and isinstance(value, list | dict) and len(value) >= context["min_length"]:
        return  # pydantic counts the good members alone; the bad ones are reported one by one
    if kind in ERRORS_WITHOUT_VALUE or value is ABSENT:
        faults.add(document.origin(path), path, message)
    else:
        faults.add(document.origin(path), path, message, value)


def _message(kind: str, context: dict[str, Any], original: str, key: str) -> str:
    """What is required, as text; the bounds of a `_deg` key in degrees."""
    if kind == "cross_check":
        return str(context["message"])
    if kind == "value_error":
        return str(context["error"])
    for bound_name in BOUND_NAMES:
        if bound_name in context:
            limit = math.degrees(context[bound_name]) if in_radians(key) else context[bound_name]
            context[bound_name] = short_number(float(f"{limit:.12g}") if isinstance(limit, float) else limit)
    if "expected" in context:
        context["expected"] = context["expected"].replace("'", "").replace(" or ", ", ")
    if "expected_tags" in context:
        context["expected_tags"] = context["expected_tags"].replace("'", "")
    if kind in MESSAGES:
        return MESSAGES[kind].format(**context)
    if kind.startswith("int_"):  # a fraction, or a whole number of too many digits
        return "must be a whole number"
    return original


def unknown_key_message(key: object, known_keys: Iterable[str]) -> str:
    """The message for an unknown key."""
    known_keys = list(known_keys)
    suggestion = did_you_mean(str(key), known_keys) or ";"
    return f"unknown key{suggestion} allowed: {', '.join(known_keys)}"


def path_in(data: object, location: tuple[int | str, ...], keep_last: bool) -> KeyPath:
    """The path of a value from pydantic's location: without names of union members, `_deg` keys as written."""
    path: KeyPath = ()
    for i, step in enumerate(location):
        key = step
        if child(data, step) is ABSENT and isinstance(data, dict) and isinstance(step, str):
            key = twin(data, (), step)[0]
        value_below = child(data, key)
        if value_below is ABSENT and not (keep_last and i == len(location) - 1):
            continue
        path, data = (*path, key), value_below
    return path


def twin(data: object, path: KeyPath, key: str) -> KeyPath:
    """The path of a key below a path, with its `_deg` name if the user wrote that."""
    for step in path:
        data = child(data, step)
    degrees_key = in_degrees(key)
    if degrees_key and child(data, key) is ABSENT and child(data, degrees_key) is not ABSENT:
        return (*path, degrees_key)
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
        current = _matching_model(candidates, data)
    return current


def models_in(annotation: object) -> list[type[Model]]:
    """All schemas in an annotation: of a choice, a list, an optional."""
    if isinstance(annotation, type) and issubclass(annotation, Model):
        return [annotation]
    return [model for argument in get_args(annotation) for model in models_in(argument)]


def _matching_model(candidates: list[type[Model]], data: object) -> type[Model] | None:
    """The schema among several whose tags the data has; None if there is none."""
    matching = [model for model in candidates if _matches_tags(model, data)] if len(candidates) > 1 else candidates
    return matching[0] if matching else None


def _matches_tags(model: type[Model], data: object) -> bool:
    """Whether the data has the tags of a schema: its fields with a single allowed value."""
    fields = [(name, info) for name, info in model.model_fields.items() if get_origin(info.annotation) is Literal]
    tags = [
        (name, get_args(info.annotation)[0], info.default)
        for name, info in fields
        if len(get_args(info.annotation)) == 1
    ]
    return isinstance(data, dict) and all(data.get(name, default) == tag for name, tag, default in tags)


def refuse_both_units(document: Document, faults: ErrorList, path: KeyPath = ()) -> None:
    """Add an error for each quantity that is given both in radians and in degrees."""
    data = document.get(path)
    if isinstance(data, list):
        data = dict(enumerate(data))
    if not isinstance(data, dict):
        return
    for key, value in data.items():
        if isinstance(value, dict | list):
            refuse_both_units(document, faults, (*path, key))
        elif (twin_key := in_radians(str(key))) in data and twin_key:
            faults.add(document.key_origin((*path, key)), (*path, key), f"given as {twin_key} too")
