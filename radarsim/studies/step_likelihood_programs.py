"""The programs by which a step filter gives recorded plots a density; see `radarsim.kernels.step_likelihood`."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from radarsim.kernels import tracing
from radarsim.studies.step_checks import check_length, check_same_shape, traced_step
from radarsim.studies.step_programs import cached_kernel, functions_of, remembered
from radarsim.user_code.errors import user_code_error

if TYPE_CHECKING:
    from radarsim.studies.stepwise import Steps


@dataclass(frozen=True)
class CompiledLikelihood:
    """The kernel of a filter, and the rows of its state."""

    kernel: Callable[..., None]
    rows: int


def compile_likelihood(
    steps: "type[Steps]", numbers: Any, measured: int, used: int, several_laws: bool
) -> CompiledLikelihood:
    """The kernel of a filter with these numbers. measured: how many a plot has; used: how many of them it takes;
    several_laws: whether errors follow one of several laws."""
    from radarsim.kernels import step_likelihood

    names = "start", "predict", "update", "log_densities", "merge", "sigma_field", "noise_field"
    key = functions_of(steps, *names), measured, used, formula_choices(numbers), several_laws
    programs, rows = remembered(key, lambda: _trace(steps, numbers, measured, used, several_laws))
    if several_laws:
        return CompiledLikelihood(cached_kernel(step_likelihood.laws_kernel, *programs, rows), rows)
    return CompiledLikelihood(cached_kernel(step_likelihood.plain_kernel, *programs), rows)


def formula_choices(numbers: Any) -> Any:
    """A record without the values of its numbers: with what it decides in the formulas of a filter."""
    return tracing.map_numbers(lambda _: 0.0, numbers)


def _trace(
    steps: Any, numbers: Any, measured: int, used: int, several_laws: bool
) -> tuple[tuple[tracing.Program, ...], int]:
    """The programs of the first plot, of a prediction, of a later plot, and of merging, and the rows of the state."""
    from radarsim.kernels.step_likelihood import AFTER, BEFORE, DENSITIES, INTERVAL, MEASURED, NUMBERS, SHIFTS

    @functools.wraps(steps.log_densities)
    def log_densities(*arguments: Any) -> tuple[Any, ...]:
        return tuple(steps.log_densities(*arguments))

    programs, state = [], None
    for step in (steps.start, steps.predict, steps.update):
        trace = tracing.Trace()
        c, z = trace.plain(NUMBERS, numbers, stated=True), trace.rows(MEASURED, (0.0,) * measured)
        if several_laws and step == steps.update:
            shifts = trace.rows(SHIFTS, z)
            z = tuple(a - b * d for a, b, d in zip(z, shifts, sigmas(steps, c, measured), strict=True))
        if several_laws:
            c = (
                _with_noise_of_law(steps, trace, c)
                if step == steps.predict
                else _with_errors_of_law(steps, trace, c, z)
            )
        if state is None:
            state = traced_step(step, z, (), c)
        else:
            s, before = trace.rows(BEFORE, state), state
            state = traced_step(step, s, trace.rows(INTERVAL, 0.0) if step == steps.predict else z, (), c)
            check_same_shape(step, state, before)
            if step == steps.update:
                densities = traced_step(log_densities, s, z, (), c)
                check_length(log_densities, densities, used, "numbers of a plot that the filter takes")
                trace.write(DENSITIES, densities)
        trace.write(AFTER, state)
        programs.append(trace.program())
    if several_laws:
        programs.append(_trace_merging(steps, numbers, state))
    return tuple(programs), tracing.count_numbers(state)


def _trace_merging(steps: Any, numbers: Any, state: Any) -> tracing.Program:
    """The program that merges two states."""
    from radarsim.kernels.step_likelihood import AFTER, BEFORE, NUMBERS, OTHER, PROBABILITY

    trace = tracing.Trace()
    c, p = trace.plain(NUMBERS, numbers, stated=True), trace.rows(PROBABILITY, 0.0)
    merged = traced_step(steps.merge, trace.rows(BEFORE, state), trace.rows(OTHER, state), p, c)
    check_same_shape(steps.merge, merged, state)
    trace.write(AFTER, merged)
    return trace.program()


def sigmas(steps: Any, c: Any, measured: int) -> tuple[Any, ...]:
    """σ of the numbers of a plot, among the numbers of a filter."""
    values = getattr(c, steps.sigma_field, None)
    if not isinstance(values, tuple) or len(values) != measured:
        raise user_code_error(steps.design, f"must give {steps.sigma_field}, a tuple of σ of the {measured} measured")
    return values


def _with_errors_of_law(steps: Any, trace: tracing.Trace, c: Any, z: Any) -> Any:
    """The numbers of a filter with the σ of a law of errors."""
    from radarsim.kernels.step_likelihood import FACTORS

    factors = trace.rows(FACTORS, (0.0,) * len(z))
    values = tuple(a * b for a, b in zip(sigmas(steps, c, len(z)), factors, strict=True))
    return c._replace(**{steps.sigma_field: values})


def _with_noise_of_law(steps: Any, trace: tracing.Trace, c: Any) -> Any:
    """The numbers of a filter with the process noise of a law of manoeuvres, where it says which these are."""
    from radarsim.kernels.step_likelihood import NOISE

    if steps.noise_field is None:
        return c
    factor, noise = trace.rows(NOISE, 0.0), getattr(c, steps.noise_field)
    return c._replace(**{steps.noise_field: tracing.map_numbers(lambda number: factor * number, noise)})
