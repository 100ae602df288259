"""Loops and branches in formulas of one realisation, for floats and for eight lanes.

A loop of lanes goes on while any of the eight has to; so it must leave a lane that is finished as it is. In a program
(`radarsim.kernels.tracing`) it is made of these operations:

    ("loop", *starts)               begins a loop, whose number this operation's is, with these numbers
    ("carry", loop, j)              number j of those that a pass begins with
    ("while", mask, most)           the loop ends where the mask holds in no lane, and after so many passes
    ("pass_row", loop, array, r, d) row r + d n of an array, in pass n from 0 on
    ("store", loop, x, array, r, d) writes x there
    ("repeat", loop, *results)      ends a pass with the numbers of the next
    ("result", loop, j)             number j after the last pass"""

from collections.abc import Callable, Sequence
from typing import Any

from radarsim.kernels.tracing import Lane, Mask, Trace, count_numbers, leaves, map_numbers, with_float_numbers


class Loop:
    """A loop of a trace, by the number of the operation that begins it."""

    def __init__(self, trace: Trace, number: int):
        self.trace, self.number = trace, number

    def rows(self, array: int, like: Any, first: int, stride: int) -> Any:
        """A structure like another, whose numbers stand in the rows of an array from first + stride · pass on."""
        rows = iter(range(first, first + count_numbers(like)))
        return map_numbers(lambda _: self._lane("pass_row", array, next(rows), stride), like)

    def write(self, array: int, value: Any, first: int, stride: int) -> None:
        """Write the numbers of a structure into these rows."""
        for row, number in enumerate(leaves(value), first):
            self.trace.index("store", self.number, self.trace.place(number), array, row, stride)

    def numbers(self, op: str, like: Any) -> Any:
        """A structure like another of the numbers that a pass begins with (`carry`), or that are left (`result`)."""
        places = iter(range(count_numbers(like)))
        return map_numbers(lambda _: self._lane(op, next(places)), like)

    def _lane(self, op: str, *operands: int) -> Lane:
        return Lane(self.trace, self.trace.index(op, self.number, *operands))


def record_loop(
    trace: Trace, most: int, start: Any, has_next: Callable[[Loop, Any], Any], step: Callable[[Loop, Any], Any]
) -> Any:
    """What at most so many passes make of `start`: step(loop, state), while has_next(loop, state), a mask."""
    start = with_float_numbers(start)
    starts, outside, begin = [trace.place(number) for number in leaves(start)], dict(trace.indices), len(trace.ops)
    trace.ops.append(("loop", *starts))
    loop = Loop(trace, begin)
    state = loop.numbers("carry", start)
    trace.ops.append(("while", trace.holds(has_next(loop, state)), most))
    after = map_numbers(lambda _, number: number, start, with_float_numbers(step(loop, state)))  # of one shape
    trace.ops.append(("repeat", begin, *[trace.place(number) for number in leaves(after)]))
    trace.indices = outside  # nothing outside may use what the loop computes
    return loop.numbers("result", start)


class RepeatedRows:
    """Places for plots, in rows of an array: whether there is one (1.0), then its numbers, in a structure `like`.

    There is one in the first of them, as many as there are in a realisation."""

    def __init__(self, trace: Trace, array: int, like: Any, first: int, most: int):
        self.trace, self.array, self.like, self.first, self.most = trace, array, (0.0, like), first, most

    def accumulate(self, start: Any, step: Callable[[Any, Any], Any]) -> Any:
        """As the function of this name."""

        def place(loop: Loop) -> Any:
            return loop.rows(self.array, self.like, self.first, count_numbers(self.like))

        return record_loop(
            self.trace,
            self.most,
            start,
            lambda loop, state: place(loop)[0] > 0.5,
            lambda loop, state: step(state, place(loop)),
        )


def accumulate(places: Sequence[Any], start: Any, step: Callable[[Any, Any], Any]) -> Any:
    """What step(state, place) makes of `start` over places for plots, which are pairs or `RepeatedRows`."""
    state = start
    for place in places:
        state = place.accumulate(state, step) if isinstance(place, RepeatedRows) else step(state, place)
    return state


def when(condition: Any, state: Any, step: Callable[[Any], Any]) -> Any:
    """step(state) if a condition holds, in any of the lanes; where it does not hold, the step must change nothing."""
    if not isinstance(condition, Mask):
        return step(state) if condition else state
    trace = condition.trace
    return record_loop(trace, 1, state, lambda loop, _: condition, lambda loop, now: step(now))
