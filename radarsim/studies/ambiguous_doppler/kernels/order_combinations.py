"""Filters of several orders combined by fixed shares, or by the intersection of their intervals."""

from radarsim.kernels.compiler import kernel_part
from radarsim.kernels.lane_matrices import get3, put3
from radarsim.kernels.lanes import full, get, row, where_greater
from radarsim.studies.ambiguous_doppler.kernels import layout
from radarsim.studies.ambiguous_doppler.kernels.orders import HUGE
from radarsim.studies.ambiguous_doppler.kernels.single_fold import put_single


@kernel_part
def run_fixed_shares(outputs, bank, reads, shares, scans, out):
    """Combine other banks by fixed shares over all scans.

    shares (K, MAX_MEMBERS, 3); outputs are those of all banks, of which MEAN or BEST is read."""
    zero, unit = full(0.0), full(1.0)
    members, orders, size = bank.members, bank.orders, bank.size
    for k in range(scans):
        output = row(out, k * layout.OUTPUT)
        x, w = (zero, zero, zero), (0.0, 0.0, 0.0)
        for i in range(size):
            y, share = (
                get3(row(outputs, (members[i] * scans + k) * layout.OUTPUT), reads),
                3 * (k * layout.MAX_MEMBERS + i),
            )
            x = (x[0] + shares[share] * y[0], x[1] + shares[share + 1] * y[1], x[2] + shares[share + 2] * y[2])
            w = (
                w[0] + (shares[share] if orders[i] == 0 else 0.0),
                w[1] + (shares[share] if orders[i] == 1 else 0.0),
                w[2] + (shares[share] if orders[i] == 2 else 0.0),
            )
        put_single(output, x, unit)
        put3(output, layout.WEIGHTS, (full(0.0) + w[0], full(0.0) + w[1], full(0.0) + w[2]))


@kernel_part
def smoothest_meeting(outputs, bank, reads, widths, scans, k, c):
    """The estimate of component c at scan k by the smoothest order whose interval meets those of all rougher ones, and
    that order."""
    members, orders, size = bank.members, bank.orders, bank.size
    x, order = full(0.0), full(0.0)
    low, high, meets, used = full(-HUGE), full(HUGE), full(1.0), 0
    for _ in range(size):
        roughest, width = -1, 0.0
        for i in range(size):
            half_width = widths[3 * (k * layout.MAX_MEMBERS + i) + c]
            if (used >> i) & 1 == 0 and half_width > width:
                roughest, width = i, half_width
        if roughest < 0:
            break
        used |= 1 << roughest
        y = get(row(outputs, (members[roughest] * scans + k) * layout.OUTPUT), reads + c)
        low, high = where_greater(y - width, low, y - width, low), where_greater(high, y + width, y + width, high)
        meets = where_greater(low, high, full(0.0), meets)
        x = where_greater(meets, full(0.5), y, x)
        order = where_greater(meets, full(0.5), full(float(orders[roughest])), order)
    return x, order


@kernel_part
def run_intersection(outputs, bank, reads, widths, scans, out):
    """Combine other banks by intersecting intervals, component by component, over all scans.

    widths (K, MAX_MEMBERS, 3) are the half widths of the intervals."""
    zero, unit = full(0.0), full(1.0)
    for k in range(scans):
        x0, order = smoothest_meeting(outputs, bank, reads, widths, scans, k, 0)
        x1, _ = smoothest_meeting(outputs, bank, reads, widths, scans, k, 1)
        x2, _ = smoothest_meeting(outputs, bank, reads, widths, scans, k, 2)
        output = row(out, k * layout.OUTPUT)
        put_single(output, (x0, x1, x2), unit)
        zeroth, second = where_greater(full(0.5), order, unit, zero), where_greater(order, full(1.5), unit, zero)
        put3(output, layout.WEIGHTS, (zeroth, unit - zeroth - second, second))
