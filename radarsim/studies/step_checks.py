"""Checks of an author's step functions, and of the numbers that they give."""

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from radarsim.kernels import small_matrices, tracing
from radarsim.user_code.errors import call_user_function, user_code_error

if TYPE_CHECKING:
    import numpy as np

DIFFERENT_FORMULA = "gives another formula each time"


def step_numbers(function: Callable[..., Any], *arguments: Any) -> Any:
    """The result of a step, with whole numbers as numbers of a realisation."""
    return tracing.with_float_numbers(call_user_function(function, *arguments))


def traced_step(function: Callable[..., Any], *arguments: Any) -> Any:
    """The result of a step on numbers of a realisation, checked to be the same on each call."""
    trace = next((number.trace for number in tracing.leaves(arguments) if isinstance(number, tracing.Lane)), None)
    result, operations = _trace_once(trace, function, *arguments)
    if trace:
        trace.forget(len(trace.ops) - len(operations))
    repeated, repeated_operations = _trace_once(trace, function, *arguments)
    if result is None or isinstance(result, list):
        raise user_code_error(
            function, f"must give a tuple of numbers, got {'nothing' if result is None else 'a list'}"
        )
    if any(isinstance(number, tracing.Mask) for number in tracing.leaves(result)):
        raise user_code_error(
            function, "gives a comparison in place of a number: where(condition, 1.0, 0.0) makes one of it"
        )
    for numbers in (result, repeated):
        if non_finite := [
            number
            for number in tracing.leaves(numbers)
            if not isinstance(number, tracing.Lane) and not math.isfinite(number)
        ]:
            raise user_code_error(function, f"gives {non_finite[0]:g}, which is no number to calculate with")
    formulas = (
        [number.index if isinstance(number, tracing.Lane) else number for number in tracing.leaves(numbers)]
        for numbers in (result, repeated)
    )
    if next(formulas) != next(formulas) or operations != repeated_operations:
        raise user_code_error(function, f"{DIFFERENT_FORMULA}: draw by normals")
    return result


def _trace_once(trace: tracing.Trace | None, function: Callable[..., Any], *arguments: Any) -> tuple[Any, list[tuple]]:
    """The result of a step, and the operations that it adds to a trace, if any."""
    first = len(trace.ops) if trace else 0
    result = step_numbers(function, *arguments)
    return result, trace.ops[first:] if trace else []


def record(function: Callable[..., Any], *arguments: Any) -> Any:
    """The numbers that an author's function makes of keys; ConfigError where it gives no tuple or named record."""
    result, repeated = call_user_function(function, *arguments), call_user_function(function, *arguments)
    if not isinstance(result, tuple):
        raise user_code_error(function, f"must give a tuple or a named record, got {type(result).__name__}")
    numbers = [float(number) for number in tracing.leaves(result)]
    if not all(map(math.isfinite, numbers)):
        raise user_code_error(function, f"must give finite numbers, got {result!r}"[:200])
    if numbers != [float(number) for number in tracing.leaves(repeated)]:
        raise user_code_error(function, f"{DIFFERENT_FORMULA}: draw in begin, move and plot, by normals")
    return result


def to_array(function: Callable[..., Any], values: Any, description: str) -> "np.ndarray":
    """An array (…,) of the numbers that an author's function gives; ConfigError where they are no such numbers."""
    import numpy as np

    try:
        return np.asarray(values, dtype=float)
    except (TypeError, ValueError):
        raise user_code_error(function, f"must give numbers, {description}, got {values!r}"[:200]) from None


def check_length(function: Callable[..., Any], values: Any, count: int, description: str) -> None:
    """Raise ConfigError where a function does not give this many numbers."""
    if not isinstance(values, tuple) or tracing.count_numbers(values) != count or len(values) != count:
        raise user_code_error(function, f"must give a tuple of {count} numbers ({description}), got {shape(values)}")


def variances(P: Sequence[Any], n: int) -> tuple[Any, ...]:
    """The diagonal of a packed covariance of n components."""
    return tuple(small_matrices.row_of(P, n, i)[i] for i in range(n))


def check_same_shape(function: Callable[..., Any], state: Any, previous: Any) -> None:
    """Raise ConfigError where a state's shape differs from that of the previous one."""
    if shape(state) != shape(previous):
        raise user_code_error(
            function, f"gives a state of the shape {shape(state)}, the one before has {shape(previous)}"
        )


def shape(value: Any) -> str:
    """A structure with its numbers left out: ((·, ·), ·)."""
    if isinstance(value, tuple):
        return f"({', '.join(map(shape, value))})"
    return "·" if tracing.is_number(value) else f"a {type(value).__name__}" if isinstance(value, list) else repr(value)
