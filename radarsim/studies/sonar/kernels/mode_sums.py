"""Sums of the modes of filters that respond to manoeuvres."""

from radarsim.kernels.compiler import kernel_part
from radarsim.kernels.lanes import address, full, get, total
from radarsim.studies.sonar.kernels.chunks import GROUPS


@kernel_part
def mode_sums(kind_rows, row, row_plots, used, out):
    """Write Σp and Σp² of the probability in one of kind_rows, and Σ of the filter's plots in memory, to out (3,).

    row_plots is the row with the number of plots, negative where there is none."""
    a, au, zero = address(kind_rows), address(used), full(0.0)
    s1, s2, s3 = zero, zero, zero
    for i in range(GROUPS):
        u = get(au, i)
        p = u * get(a, row * GROUPS + i)
        s1, s2 = s1 + p, s2 + p * p
        if row_plots >= 0:
            s3 = s3 + u * get(a, row_plots * GROUPS + i)
    out[0], out[1], out[2] = total(s1), total(s2), total(s3)
