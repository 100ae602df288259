"""The lanes: arithmetic and the exponential against NumPy, lane by lane."""

import numpy as np

from radarsim.kernels import lanes
from radarsim.kernels.compile import kernel
from radarsim.kernels.lanes import WIDTH


@kernel
def calculate(x, y, out):
    a, b, to = lanes.get(lanes.address(x), 0), lanes.get(lanes.address(y), 0), lanes.address(out)
    lanes.put(to, 0, a + b * 2.0)
    lanes.put(to, 1, 1.0 - a / b)
    lanes.put(to, 2, lanes.where_greater(a, b, a, lanes.full(7.0)))
    lanes.put(to, 3, lanes.root(a * a))
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
    for row, wanted in zip(found, expected, strict=True):
        assert np.allclose(row, wanted, rtol=1e-15, atol=1e-15)
    y[:] = 100
    calculate(x, y, out)
    assert not out[-8:].any()


def test_exponential_is_that_of_the_library():
    x = lanes.rows(20_000)
    x[:] = np.concatenate([np.linspace(-700, 0, x.size // 2), np.random.default_rng(2).normal(size=x.size // 2)])
    out = lanes.rows(20_000)
    exponentials(x, out)
    assert np.max(np.abs(out / np.exp(x) - 1)) < 1e-15
    x[:] = -1e300
    exponentials(x, out)
    assert np.all(out == np.exp(-700.0)) or np.allclose(out, np.exp(-700.0), rtol=1e-15)


def test_rows_begin_at_a_cache_line():
    for count in (1, 3, 1000):
        array = lanes.rows(count)
        assert array.ctypes.data % 64 == 0
        assert array.shape == (count * WIDTH,)
