"""Chunks of realisations, and small matrices of eight realisations at a time."""

from radarsim.kernels import kalman_algebra
from radarsim.kernels.compiler import inline, kernel_part
from radarsim.kernels.lanes import WIDTH, full, get, where_greater

CHUNK = 512  # realisations, as in `shared_gains`
GROUPS = CHUNK // WIDTH
PITCH = GROUPS + 1  # of the rows of recent plots: rows 4 KiB apart would all use the same few lines of the cache
ROW = PITCH * WIDTH


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


@kernel_part
def copy_row(source, target):
    """Copy a row (CHUNK,); an assignment to a slice has Numba compile texts of errors for seconds."""
    for i in range(target.size):
        target[i] = source[i]


@inline
def manoeuvre_covariance(q, tau, size):
    """Q (6) of a random derivative of order `size` and variance q, constant over tau."""
    half = 0.5 * tau * tau
    g = (half, tau, 0.0) if size == 2 else (tau * half / 3.0, half, tau)
    return kalman_algebra.add_outer(kalman_algebra.NO_NOISE, q, g)
