"""The lanes: arithmetic and the exponential against NumPy, lane by lane."""

import numpy as np
import pytest

from radarsim.kernels import lanes
from radarsim.kernels.compiler import kernel
from radarsim.kernels.lanes import WIDTH
from tests.tolerances import assert_rounded, units_off


@kernel
def calculate(x, y, out):
    a, b, to = lanes.get(lanes.address(x), 0), lanes.get(lanes.address(y), 0), lanes.address(out)
    lanes.put(to, 0, a + b * 2.0)
    lanes.put(to, 1, 1.0 - a / b)
    lanes.put(to, 2, lanes.where_greater(a, b, a, lanes.full(7.0)))
    lanes.put(to, 3, lanes.square_root(a * a))
    lanes.put(to, 4, lanes.nearest(a))
    lanes.put(to, 5, lanes.full(lanes.total(a)))
    lanes.put(lanes.row(to, 6), 0, lanes.full(1.0 if lanes.any_greater(a, b) else 0.0))


@kernel
def exponentials(x, out):
    for n in range(x.size // WIDTH):
        lanes.put(lanes.address(out), n, lanes.exponential(lanes.get(lanes.address(x), n)))


def test_arithmetic_is_lane_by_lane():
    rng = np.random.default_rng(1)
    x, y, out = lanes.rows(1), lanes.rows(1), lanes.rows(7)
    x[:], y[:] = rng.normal(size=8) * 5, rng.normal(size=8) * 5
    calculate(x, y, out)
    found = out.reshape(-1, WIDTH)
    expected = [x + 2 * y, 1 - x / y, np.where(x > y, x, 7.0), np.abs(x), np.rint(x), np.full(8, x.sum()), np.ones(8)]
    summed = [np.abs(x) + 2 * np.abs(y), 1 + np.abs(x / y), *expected[2:5], np.full(8, np.abs(x).sum()), expected[6]]
    for row, wanted, size, operations in zip(found, expected, summed, (1, 2, 0, 2, 0, 7, 0), strict=True):
        assert_rounded(row, wanted, size, operations=operations)
    y[:] = 100
    calculate(x, y, out)
    assert not out[-8:].any()


@pytest.mark.skipif(np.finfo(np.longdouble).eps > 1e-18, reason="no extended precision to compare with")
def test_exponential_is_that_of_the_library():
    """To the units that it states."""
    x = lanes.rows(20_000)
    x[:] = np.concatenate([np.linspace(-700, 0, x.size // 2), np.random.default_rng(2).normal(size=x.size // 2)])
    out = lanes.rows(20_000)
    exponentials(x, out)
    assert units_off(out, np.exp(x.astype(np.longdouble))) < 3
    x[:] = -1e300
    exponentials(x, out)
    assert units_off(out, np.exp(np.full(x.size, np.longdouble(-700)))) < 3


def test_rows_begin_at_a_cache_line():
    for count in (1, 3, 1000):
        array = lanes.rows(count)
        assert array.ctypes.data % 64 == 0
        assert array.shape == (count * WIDTH,)
