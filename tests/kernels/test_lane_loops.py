"""Loops and branches of eight realisations: what plain Python does with each alone."""

import numpy as np
import pytest

from radarsim.errors import ConfigError
from radarsim.kernels.compiler import kernel
from radarsim.kernels.lane_loops import RepeatedRows, accumulate, record_loop, when
from radarsim.kernels.lane_programs import emit_program
from radarsim.kernels.lanes import WIDTH, address, rows
from radarsim.kernels.tracing import Trace, maximum, where
from radarsim.studies.step_checks import traced_step

RNG = np.random.default_rng(3)
MOST = 5


def run(trace, *arrays):
    program = emit_program(trace.program())

    @kernel
    def calculate(x, y):
        program((address(x), address(y)))

    calculate(*arrays)
    return arrays


def lanes_of(values):
    """Rows (n, WIDTH) as an array of a kernel."""
    array = rows(len(values))
    array[:] = np.ravel(values)
    return array


def sums(places, limit):
    """The sum, the greatest and a running product of the numbers of places that are below a limit: a branch in a
    loop."""

    def step(state, place):
        there, (number, factor) = place
        is_small = (there > 0.5) & (number < limit)

        def add(state):
            total, (greatest, product) = state
            grown = total + number * limit, (maximum(greatest, number), product * factor)
            return tuple(where(is_small, new, old) for new, old in zip(grown, state, strict=True))

        return when(is_small, state, add)

    return accumulate(places, (0.0, (-1e3, 1.0)), step)


def test_what_a_loop_adds_up_is_that_of_each_realisation():
    counts = RNG.integers(0, MOST + 1, WIDTH)
    places = np.array([[n < counts, *RNG.normal(size=(2, WIDTH))] for n in range(MOST)])
    limit = RNG.normal(size=WIDTH) + 0.5
    trace = Trace()
    found = sums((RepeatedRows(trace, 0, (0.0, 0.0), 1, MOST),), trace.rows(0, 0.0))
    trace.write(1, found)
    trace.write(1, found[0] * 2.0, 3)
    _, y = run(trace, lanes_of([limit, *places.reshape(-1, WIDTH)]), rows(4))
    for lane, made in enumerate(y.reshape(4, WIDTH).T):
        total, (greatest, product) = sums(
            [(there, (number, factor)) for there, number, factor in places[..., lane].tolist()], float(limit[lane])
        )
        assert made.tolist() == pytest.approx([total, greatest, product, 2 * total], rel=1e-15)


def test_a_loop_writes_rows_until_no_realisation_goes_on():
    """Powers of the lanes' numbers below a limit."""
    trace = Trace()
    number = trace.rows(0, 0.0)

    def write_power(loop, state):
        (power,) = state
        loop.write(1, (where(power < 50.0, power, 0.0), loop.rows(0, 0.0, 1, 1)), 0, 2)
        return (where(power < 50.0, power * number, power),)

    record_loop(trace, MOST, (number,), lambda _, state: state[0] < 50.0, write_power)
    base, others = np.linspace(2.5, 9, WIDTH), RNG.normal(size=(MOST, WIDTH))
    _, y = run(trace, lanes_of([base, *others]), rows(2 * MOST))
    powers = base ** np.arange(1, MOST + 1)[:, None]
    passes = int((powers < 50).sum(axis=0).max())
    assert passes < MOST
    found = y.reshape(MOST, 2, WIDTH)
    np.testing.assert_allclose(found[:, 0], np.where(powers < 50, powers, 0), rtol=1e-15)
    np.testing.assert_array_equal(found[:passes, 1], others[:passes])
    assert not found[passes:].any()


def test_a_step_with_a_loop_is_the_same_on_each_call_or_refused():
    trace = Trace()
    limit = trace.rows(0, 0.0)

    def step(limit):
        return sums((RepeatedRows(trace, 0, (0.0, 0.0), 1, MOST),), limit + 1.0)

    first = len(trace.ops)
    traced_step(step, limit)
    loops = [operation for operation in trace.ops[first:] if operation[0] == "loop"]
    assert len(loops) == 2  # that of the places, and its branch: once

    def drawn(limit):
        return sums((RepeatedRows(trace, 0, (0.0, 0.0), 1, MOST),), limit + RNG.normal())

    with pytest.raises(ConfigError, match="another formula each time"):
        traced_step(drawn, limit)
