"""Checks of fields that must fit together, and the errors that they yield."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import cache
from types import FunctionType
from typing import Any, NamedTuple, TypeVar

ItemType = TypeVar("ItemType")
Value = TypeVar("Value")
CheckMethod = TypeVar("CheckMethod", bound=Callable[[Any], "Iterator[CheckError]"])


class InvalidFieldError(Exception):
    """A cross-check reads a field that is itself invalid, so that the check is impossible."""


class CheckError(NamedTuple):
    """An error that a cross-check finds: the key, dotted if deeper, and the requirement."""

    key: str
    message: str


def check_error(key: str, message: str) -> CheckError:
    """An error that a cross-check yields: `yield at("scans", "must be >= 3")`."""
    return CheckError(key, message)


_CROSS_CHECK_METHODS: set[Callable[[Any], Iterator[CheckError]]] = set()


def cross_check(method: CheckMethod) -> CheckMethod:
    """Marks a method of a model that yields the errors of fields that do not fit together.

    All cross-checks of a model run, in order, even if some fields are invalid: a check ends when it reads one of these.
    So independent checks are separate methods."""
    _CROSS_CHECK_METHODS.add(method)
    return method


def check_each(
    members: Iterable[ItemType], check: Callable[[int, ItemType], Iterator[CheckError]]
) -> Iterator[CheckError]:
    """The errors of each member of a list, `check(i, member)`; an invalid field of one does not stop the others."""
    for i, member in enumerate(members):
        with suppress(InvalidFieldError):
            yield from check(i, member)


def valid_values(members: Iterable[ItemType], value: Callable[[ItemType], Value]) -> list[Value]:
    """The values of those members whose value is valid."""
    values = []
    for member in members:
        with suppress(InvalidFieldError):
            values.append(value(member))
    return values


@cache
def cross_check_methods(model: type) -> tuple[Callable[[Any], Iterator[CheckError]], ...]:
    """The cross-checks of a model, beginning with those of its base classes."""
    methods_by_name: dict[str, Callable[[Any], Iterator[CheckError]]] = {}
    for base in reversed(model.__mro__):
        methods = {name: method for name, method in vars(base).items() if isinstance(method, FunctionType)}
        methods_by_name |= {name: method for name, method in methods.items() if method in _CROSS_CHECK_METHODS}
    return tuple(methods_by_name.values())
