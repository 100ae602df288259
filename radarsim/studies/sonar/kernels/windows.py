"""The last plots of each realisation, and least squares on a window of them."""

from radarsim.kernels import kalman_algebra, lane_matrices
from radarsim.kernels.compiler import inline, kernel
from radarsim.kernels.lane_matrices import put6
from radarsim.kernels.lanes import address, full, get, put, where_greater
from radarsim.studies.sonar.kernels.chunks import GROUPS, PITCH
from radarsim.studies.sonar.kernels.normal_equations import leading_inverse, normal_equations
from radarsim.studies.sonar.kernels.steps import memory_addresses


@kernel
def remember_plots(recent, z, weight, tau):
    """Add the plots of a scan to recent (3, L, ROW), the last L plots: plot, age, weight, the newest first."""
    a, az, aw, length = address(recent), address(z), address(weight), recent.shape[1]
    zero, ages, weights = full(0.0), length * PITCH, 2 * length * PITCH
    for i in range(GROUPS):
        w = get(aw, i)
        for j in range(length - 1, 0, -1):
            slot, older = j * PITCH + i, (j - 1) * PITCH + i
            put(a, slot, where_greater(w, zero, get(a, older), get(a, slot)))
            put(a, ages + slot, where_greater(w, zero, get(a, ages + older), get(a, ages + slot)) + tau)
            put(a, weights + slot, where_greater(w, zero, get(a, weights + older), get(a, weights + slot)))
        put(a, i, where_greater(w, zero, get(az, i), get(a, i)))
        put(a, ages + i, where_greater(w, zero, zero, get(a, ages + i) + tau))
        put(a, weights + i, where_greater(w, zero, w, get(a, weights + i)))


@inline
def fit_window(filters, plots, f, c, length, size, period):
    """Least squares on the last `length` of recent plots."""
    ax, _, _, ap, _, _, _ = memory_addresses(filters, plots, f, c)
    recent, n = plots.recent[c], plots.n_now[c]
    a, an, longest = address(recent), address(n), recent.shape[1]
    per, twice, half, zero = 1.0 / period, 1.0 / (period * period), 0.5 if size == 3 else 0.0, full(0.0)
    full_rank = full(float(size))
    for i in range(GROUPS):
        Y, b = normal_equations(a, length, longest, i, zero, half)
        rank = get(an, i)
        P = leading_inverse(Y, where_greater(rank, full_rank, full_rank, rank))
        r, v, acceleration = kalman_algebra.times(P, b)
        lane_matrices.put3(ax, i, (r, per * v, twice * acceleration), GROUPS)
        put6(ap, i, P, GROUPS)
