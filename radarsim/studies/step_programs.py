"""The programs of a step study's case: of its truth and plots, and of each filter; see `radarsim.kernels.steps`."""

import inspect
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.kernels import lane_loops, small_matrices, tracing
from radarsim.kernels.formula_functions import exp
from radarsim.kernels.lane_loops import RepeatedRows
from radarsim.studies.step_checks import check_length, check_same_shape, record, traced_step, variances

if TYPE_CHECKING:
    from radarsim.studies.stepwise import Steps, StepStudy

NO_COVARIANCE = -1e100  # stands for the variances and the NEES of a matrix that is not positive
TRACED: dict[Any, Any] = {}  # scenes and programs by what they depend on
MAX_TRACED = 100
MOVE_PARAMETERS = 4  # of `move` without the time: x, dt, c, w


@dataclass(frozen=True)
class Scene:
    """The programs of truth and plots: those of the first scan, and of later ones.

    rows: of the state; plot_rows: of a plot with the truth and the false plots; pairs: of normals of a scan; false: the
    places for false plots, and the pairs of uniform numbers that they take."""

    first: tracing.Program
    following: tracing.Program
    rows: int
    plot_rows: int
    pairs: int
    false: int
    uniform_pairs: int


@dataclass(frozen=True)
class CompiledFilter:
    """A filter of a case: its kernel, its numbers (n,), the rows of its state, and whether it has a covariance."""

    kernel: Callable[..., None]
    numbers: np.ndarray
    rows: int
    tested: bool


def remembered(key: Any, trace: Callable[[], Any]) -> Any:
    """What tracing gives, of functions and records that have not been traced before; those of a hundred are kept.

    Tracing does not read the numbers of a record, but may refuse their signs (`radarsim.kernels.tracing.case_value`);
    whatever else a record has, texts, truth values and whole numbers, decides branches."""
    try:
        known = TRACED.get(key)
    except TypeError:  # a record with what cannot be compared
        return trace()
    if known is None:
        if len(TRACED) >= MAX_TRACED:
            TRACED.clear()
        known = TRACED[key] = trace()
    return known


def branches(record_of_numbers: Any) -> Any:
    """A record with the signs of its numbers in their place: what a trace of it depends on."""
    return tracing.map_numbers(lambda number: (number > 0) - (number < 0), record_of_numbers)


def functions_of(owner: Any, *names: str) -> tuple[Any, ...]:
    """The functions of a class with these names, if it has them."""
    return tuple(getattr(owner, name, None) for name in names)


def trace_scene(study: "StepStudy", spec: Any, world: Any) -> Scene:
    """The programs of truth and plots."""
    names = "begin", "move", "plot", "truth", "expected_false_plots", "false_plot", "normals", "known_columns"
    places = study.false_places(spec)
    key = functions_of(type(study), *names), study.false_quantities, places, branches(world)
    scene: Scene = remembered(key, lambda: _trace_scene(study, world, places))
    return scene


def _trace_scene(study: "StepStudy", world: Any, places: int) -> Scene:
    from radarsim.kernels import steps

    first, move, plot = study.normals
    measured, components = len(study.measured), len(study.components)
    programs = []
    state: Any = None
    for count in (first, move):
        trace = tracing.Trace()
        c, (dt, *u, time) = trace.plain(steps.NUMBERS, world, stated=True), numbers_at_a_scan(study, trace)
        w = tuple(unit_normal(trace, n) for n in range(count + plot))
        if state is None:
            x = traced_step(study.begin, c, w[:count])
        else:
            times = [time] if moves_by_time(study) else []
            x = traced_step(study.move, trace.rows(steps.STATE, state), dt, c, w[:count], *times)
            check_same_shape(study.move, x, state)
        state = x
        z, true = traced_step(study.plot, x, tuple(u), c, w[count:]), traced_step(study.truth, x, tuple(u), c)
        check_length(study.plot, z, measured, "measured")
        check_length(study.truth, true, components, "components")
        trace.write(steps.STATE, x)
        trace.write(steps.PLOT, (z, true), 1)
        if places:
            write_false_plots(study, trace, x, tuple(u), c, places)
        programs.append(trace.program())
    plot_rows = 1 + measured + components + places * (1 + measured)
    uniform_pairs = -(-(1 + places * measured) // 2) if places else 0
    pairs = -(-(max(first, move) + plot) // 2)
    return Scene(programs[0], programs[1], tracing.count_numbers(state), plot_rows, pairs, places, uniform_pairs)


def write_false_plots(study: "StepStudy", trace: tracing.Trace, x: Any, u: Any, c: Any, places: int) -> None:
    """Write the false plots of a scan about a true state: their number is Poisson's, by the inverse of its law."""
    from radarsim.kernels import steps

    measured, components = len(study.measured), len(study.components)
    number, expected = trace.rows(steps.EVEN, 0.0), traced_step(study.expected_false_plots, x, u, c)

    def write_plot(loop: lane_loops.Loop, state: tuple[Any, ...]) -> tuple[Any, ...]:
        probability, at_most, count = state
        plot = traced_step(study.false_plot, x, u, loop.rows(steps.EVEN, (0.0,) * measured, 1, measured), c)
        check_length(study.false_plot, plot, measured, "measured")
        there = tracing.where(number > at_most, 1.0, 0.0)
        loop.write(steps.PLOT, (there, plot), 1 + measured + components, 1 + measured)
        probability = probability * expected / count
        return probability, at_most + probability, count + 1.0

    none = exp(-expected)
    lane_loops.record_loop(trace, places, (none, none, 1.0), lambda _, state: number > state[1], write_plot)


def compile_filter(study: "StepStudy", spec: Any, filter_keys: Any, scene: Scene, missed: bool) -> CompiledFilter:
    """A filter's kernel and numbers. missed: whether plots may be missed."""
    from radarsim.kernels import steps as kernels_steps

    steps = study.kinds[filter_keys.kind]
    numbers = record(steps.design, spec, filter_keys)
    names = "start", "predict", "update", "estimate", "covariance", "counts"
    of_study = functions_of(
        type(study), "difference", "is_on_target", "known_columns", "counted", "components", "measured"
    )
    key = functions_of(steps, *names), of_study, study.false_quantities, scene.false, missed, branches(numbers)
    first, following, rows = remembered(key, lambda: trace_filter(study, steps, numbers, scene, missed))
    tested = steps.covariance is not None
    events = 1 + len(study.counted) if scene.false else 0
    kernel = cached_kernel(
        kernels_steps.filter_kernel, first, following, scene.plot_rows, len(study.components), tested, events
    )
    return CompiledFilter(kernel, to_numbers(numbers), rows, tested)


def trace_filter(
    study: "StepStudy", steps: "type[Steps]", numbers: Any, scene: Scene, missed: bool
) -> tuple[tracing.Program, tracing.Program, int]:
    """The programs of a filter's first scan and of later ones, and the rows of its state."""
    from radarsim.kernels import steps as kernels_steps

    programs, state, n, m = [], None, len(study.components), len(study.measured)
    for begins in (True, False):
        trace = tracing.Trace()
        c, (dt, *known, _) = trace.plain(kernels_steps.NUMBERS, numbers, stated=True), numbers_at_a_scan(study, trace)
        u = tuple(known[: len(study.known_columns)])
        present, z, true = trace.rows(kernels_steps.PLOT, (0.0, (0.0,) * m, (0.0,) * n))
        if begins:
            s = traced_step(steps.start, z, u, c)
        else:
            predicted = traced_step(steps.predict, trace.rows(kernels_steps.STATE, state), dt, u, c)
            check_same_shape(steps.predict, predicted, state)
            if scene.false:
                z = (present, z), RepeatedRows(trace, kernels_steps.PLOT, (0.0,) * m, 1 + m + n, scene.false)
            s = traced_step(steps.update, predicted, z, u, c)
            check_same_shape(steps.update, s, state)
            if missed and not scene.false:
                s = tracing.where(present > 0.5, s, predicted)
        state = s
        trace.write(kernels_steps.STATE, s)
        estimate = traced_step(steps.estimate, s, u, c)
        check_length(steps.estimate, estimate, n, "components")
        e = study.difference(estimate, true)
        counts = trace.rows(kernels_steps.COUNTED, 0.0) > 0.5
        rows = tracing.count_numbers(s)
        if scene.false:
            was_kept = True if begins else trace.rows(kernels_steps.STATE, 0.0, rows) > 0.5
            is_kept = study.is_on_target(e, tuple(known), c) & was_kept
            trace.write(kernels_steps.STATE, tracing.where(is_kept, 1.0, 0.0), rows)
            counts, rows = counts & is_kept, rows + 1
            events = traced_step(steps.counts, s, u, c)
            check_length(steps.counts, events, len(study.counted), "counted")
            trace.write(kernels_steps.EVENTS, tracing.where(counts, (1.0, *events), (0.0,) * (1 + len(events))))
        trace.write(kernels_steps.ERRORS, tracing.where(counts, e, (0.0,) * n))
        if steps.covariance is not None:
            P = traced_step(steps.covariance, s, u, c)
            check_length(steps.covariance, P, n * (n + 1) // 2, "elements of a packed covariance")
            nees, pivot = small_matrices.eliminate(P, e)
            tests = tracing.where(pivot > 0.0, (*variances(P, n), nees), (NO_COVARIANCE,) * (n + 1))
            trace.write(kernels_steps.TESTED, tracing.where(counts, tests, (0.0,) * (n + 1)))
        programs.append(trace.program())
    return programs[0], programs[1], rows


def numbers_at_a_scan(study: "StepStudy", trace: tracing.Trace) -> tuple[Any, ...]:
    """The time since the scan before, the quantities known at a scan, those of false plots after them, and the time."""
    from radarsim.kernels import steps

    count = 2 + len(study.known_columns) + study.false_quantities
    numbers: tuple[Any, ...] = trace.plain(steps.KNOWN, (0.0,) * count)
    return numbers


def moves_by_time(study: "StepStudy") -> bool:
    """Whether `move` takes the time."""
    return len(inspect.signature(study.move).parameters) > MOVE_PARAMETERS


@cache
def cached_kernel(make: Callable[..., Any], *programs: Any) -> Callable[..., None]:
    """The kernel that a function of `radarsim.kernels.steps` makes of programs, cached."""
    kernel: Callable[..., None] = make(*programs)
    return kernel


def unit_normal(trace: tracing.Trace, n: int) -> tracing.Lane:
    """The unit normal n of a scan."""
    from radarsim.kernels import steps

    array = (steps.FIRST_NORMALS, steps.SECOND_NORMALS)[n % 2]
    lane: tracing.Lane = trace.rows(array, 0.0, n // 2)
    return lane


def to_numbers(numbers: Any) -> np.ndarray:
    """The numbers (n,) of a record and a zero, so that there is at least one."""
    return np.array([*tracing.leaves(numbers), 0.0], dtype=float)
