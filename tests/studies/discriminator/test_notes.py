"""σ of locked bursts: where a sample may lack those that are about to be lost."""

from types import SimpleNamespace

import numpy as np

from radarsim.report.notes import UNSEEN
from radarsim.studies.discriminator import notes

N = 1000.0


def moments(sigma, size=0.0, number=0):
    """Σe … Σe⁴ of N errors: Gaussian ones of this σ and a number of this size, of either sign."""
    rest = N - number
    return [0.0, rest * sigma**2 + number * size**2, 0.0, rest * 3 * sigma**4 + number * size**4]


def case(errors, bound, length):
    errors, length = np.array(errors)[:, :, None, :], np.array(length)
    axes = SimpleNamespace(
        available=np.isfinite(length)[..., None], exact_sigma=np.array(bound)[..., None], duration_s=length
    )
    return SimpleNamespace(sums={"error": errors}, axes=axes)


def said(result):
    return (notes.of_curves(result, np.full((*result.axes.duration_s.shape, 1), N))[..., 0] == UNSEEN).tolist()


CLEAN = [moments(0.1), moments(0.1), moments(1.0)]
LENGTH = [1.0, 2.0, 4.0]


def test_errors_of_another_estimator_mark_windows_beside_them():
    """Two of 1000 of 2 potential σ in one window: 3 such move σ = 0.1 by half, σ = 1 by less than its interval.

    The row that has them itself is marked by its effective realisations, and not here.
    """
    tail = [moments(0.1), moments(0.1, 2.0, 2), moments(1.0)]
    bound = [[1.0, 1.0, 1.0]] * 2
    assert said(case([CLEAN, CLEAN], bound, [LENGTH] * 2)) == [[False] * 3] * 2
    assert said(case([CLEAN, tail], bound, [LENGTH] * 2)) == [[True, True, False], [True, False, False]]


def test_windows_are_beside_each_other_by_their_length():
    """The second estimator doubles each window twice: its fourth is as long as the first one's second."""
    dense = [moments(0.1)] * 3 + [moments(0.1, 2.0, 2)] + [moments(0.1)] * 2
    first = [*CLEAN[:2], moments(0.1), *[[np.nan] * 4] * 3]
    length = [[0.5, 1.8, 4.0, np.nan, np.nan, np.nan], [0.2, 0.5, 1.0, 1.8, 3.0, 4.0]]
    marked = said(case([first, dense], np.ones((2, 6)), length))
    assert marked[1] == [False, False, True, False, True, False]
    assert marked[0] == [True, True, True, False, False, False]
    length[0][0] = 0.1
    assert notes.nearby(np.ones((2, 6, 1)), np.array(length))[0, :3].tolist() == [[1.0]] * 3
    size = np.zeros((2, 6, 1))
    size[1, 5] = 3.0
    assert notes.nearby(size, np.array(length))[0, :3, 0].tolist() == [0.0, 3.0, 3.0]
    assert notes.nearby(size, np.array(length))[1, :, 0].tolist() == [0.0] * 4 + [3.0] * 2


def test_errors_are_compared_in_hertz_not_in_potential_sigma():
    """A longer window has a smaller bound: what is two of its σ is little for the window before."""
    tail = [moments(0.1), moments(0.1, 2.0, 2), moments(1.0)]
    assert said(case([tail], [[1.0, 1.0, 1.0]], [LENGTH])) == [[True, False, False]]
    assert said(case([tail], [[500.0, 10.0, 1.0]], [LENGTH])) == [[False, False, True]]
