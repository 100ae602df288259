"""The programs by which a step filter gives recorded plots a density; see `radarsim.kernels.step_likelihood`."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from radarsim.kernels import tracing
from radarsim.studies.step_checks import check_length, check_same_shape, traced_step
from radarsim.studies.step_programs import cached_kernel, functions_of, remembered

if TYPE_CHECKING:
    from radarsim.studies.stepwise import Steps


@dataclass(frozen=True)
class CompiledLikelihood:
    """The kernel of a filter, and the rows of its state."""

    kernel: Callable[..., None]
    rows: int


def compile_likelihood(steps: "type[Steps]", numbers: Any, measured: int, used: int) -> CompiledLikelihood:
    """The kernel of a filter with these numbers. measured: how many a plot has; used: how many of them it takes."""
    from radarsim.kernels import step_likelihood

    names = "start", "predict", "update", "log_densities"
    key = functions_of(steps, *names), measured, used, formula_choices(numbers)
    *programs, rows = remembered(key, lambda: _trace(steps, numbers, measured, used))
    return CompiledLikelihood(cached_kernel(step_likelihood.plain_kernel, *programs), rows)


def formula_choices(numbers: Any) -> Any:
    """A record without the values of its numbers: with what it decides in the formulas of a filter."""
    return tracing.map_numbers(lambda _: 0.0, numbers)


def _trace(steps: Any, numbers: Any, measured: int, used: int) -> tuple[Any, ...]:
    """The programs of the first plot, of a prediction and of a later plot, and the rows of the state."""
    from radarsim.kernels.step_likelihood import DENSITIES, INTERVAL, MEASURED, NUMBERS, STATE

    @functools.wraps(steps.log_densities)
    def log_densities(*arguments: Any) -> tuple[Any, ...]:
        return tuple(steps.log_densities(*arguments))

    programs, state = [], None
    for step in (steps.start, steps.predict, steps.update):
        trace = tracing.Trace()
        c, z = trace.plain(NUMBERS, numbers, stated=True), trace.rows(MEASURED, (0.0,) * measured)
        if state is None:
            state = traced_step(step, z, (), c)
        else:
            s, before = trace.rows(STATE, state), state
            state = traced_step(step, s, trace.rows(INTERVAL, 0.0) if step == steps.predict else z, (), c)
            check_same_shape(step, state, before)
            if step == steps.update:
                densities = traced_step(log_densities, s, z, (), c)
                check_length(log_densities, densities, used, "numbers of a plot that the filter takes")
                trace.write(DENSITIES, densities)
        trace.write(STATE, state)
        programs.append(trace.program())
    return *programs, tracing.count_numbers(state)
