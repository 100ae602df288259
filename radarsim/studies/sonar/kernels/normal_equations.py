"""Normal equations of a polynomial through recent plots, and the inverse of their matrix."""

from radarsim.kernels import kalman_algebra
from radarsim.kernels.compiler import inline
from radarsim.kernels.lanes import full, get, where_greater
from radarsim.studies.sonar.kernels.chunks import PITCH


@inline
def leading_inverse(Y, rank):
    """Inverse of the leading block of size rank (0 to 3) of a packed matrix; zero outside."""
    y00, y01, y02, y11, y12, y22 = Y
    ones, zeros = full(1.0), full(0.0)
    above_0, above_1, above_2 = full(0.5), full(1.5), full(2.5)
    c0, c1, c2 = y11 * y22 - y12 * y12, y02 * y12 - y01 * y22, y01 * y12 - y02 * y11  # cofactors of the first row
    minor = y00 * y11 - y01 * y01
    determinant = where_greater(rank, above_1, minor, where_greater(rank, above_0, y00, ones))
    scale = 1.0 / where_greater(rank, above_2, y00 * c0 + y01 * c1 + y02 * c2, determinant)  # divisions are expensive
    p00 = where_greater(rank, above_1, y11, where_greater(rank, above_0, ones, zeros))
    return (
        scale * where_greater(rank, above_2, c0, p00),
        scale * where_greater(rank, above_2, c1, where_greater(rank, above_1, zeros - y01, zeros)),
        scale * where_greater(rank, above_2, c2, zeros),
        scale * where_greater(rank, above_2, y00 * y22 - y02 * y02, where_greater(rank, above_1, y00, zeros)),
        scale * where_greater(rank, above_2, y01 * y02 - y00 * y12, zeros),
        scale * where_greater(rank, above_2, minor, zeros),
    )


@inline
def normal_equations(recent, length, longest, i, origin, half):
    """Normal equations Y x = b of a polynomial through the last `length` plots of group i, at present: Y (6), b (3).

    recent is the address of the recent plots, at most `longest`; they are taken relative to origin. half is
    0.5 for a parabola and 0 for a straight line."""
    zero = full(0.0)
    Y, b = (zero, zero, zero, zero, zero, zero), (zero, zero, zero)
    for j in range(length):
        slot = j * PITCH + i
        z = get(recent, slot) - origin
        age, w = get(recent, longest * PITCH + slot), get(recent, 2 * longest * PITCH + slot)
        h = (1.0, zero - age, half * age * age)
        Y, b = kalman_algebra.add_outer(Y, w, h), kalman_algebra.add_scaled(b, w * z, h)
    return Y, b
