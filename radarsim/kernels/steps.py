"""A block of realisations of a study that is written as the step of one: truth and plots, then each filter over them.

The steps come as programs (`radarsim.kernels.tracing`), so a kernel holds the study's own formulas and no call. All
arrays are flat; rows are eights of realisations. Of `groups` eights and K scans: known (K · width,) numbers known at a
scan, its first is the time since the scan before, s; numbers (n,) numbers of a case, or of a filter; plots (groups · K
· PLOT) rows: of a scan 1 where there is a plot, else 0, the numbers of the plot, the truth, and the same two of each
false plot; errors (groups · K · C) rows: errors of the components, zero beyond the block's last realisation and of
lost tracks; among false plots C + 1 rows of a scan, the last 1 of tracks that count, else 0.

Layout of the noise: the normals 2 j and 2 j + 1 of scan k are those of pair `pairs` · k + j of the stream of plots;
whether there is one, the uniform number k of the stream of detections; for false plots the uniform numbers j and
`uniform_pairs` + j of a scan are those of pair `uniform_pairs` · k + j of their stream."""

import numpy as np

from radarsim.kernels.compiler import kernel, kernel_part
from radarsim.kernels.lane_programs import emit_program
from radarsim.kernels.lanes import WIDTH, add_totals, address, full, get, put, row, total, where_greater
from radarsim.kernels.random import U, fill_normal_strip, fill_uniform_pairs, fill_uniform_strip
from radarsim.kernels.tracing import Program

STRIP = 16  # scans whose noise is drawn at once
# Arrays of a program of the world, and of one of a filter.
STATE, KNOWN, NUMBERS, FIRST_NORMALS, SECOND_NORMALS, PLOT, EVEN = range(7)
COUNTED, ERRORS, TESTED, EVENTS = 3, 4, 6, 7


def truth_kernel(first: Program, following: Program, pairs: int, rows: int, uniform_pairs: int):
    """The kernel that draws truth and plots, from the programs of the first scan and of those that follow."""
    begin, move = emit_program(first), emit_program(following)

    @kernel
    def draw(keys, start, groups, known, width, numbers, detection, state, a, b, u, even, plots):
        scans = known.size // width
        for g in range(groups):
            for k in range(scans):
                if k % STRIP == 0:
                    fill_normal_strip(keys[0], start + g * WIDTH, U(k * pairs), a, b)
                if detection < 1.0 and k & 1 == 0:
                    fill_uniform_pairs(keys[1], start + g * WIDTH, U(k >> 1), u[:WIDTH], u[WIDTH:])
                if uniform_pairs > 0:
                    half = uniform_pairs * WIDTH
                    fill_uniform_strip(keys[2], start + g * WIDTH, U(k * uniform_pairs), even[:half], even[half:])
                plot_row = row(address(plots), (g * scans + k) * rows)
                present = full(1.0)
                if detection < 1.0 and k > 0:
                    uniform = get(address(u), k & 1)
                    present = where_greater(full(detection), uniform, present, full(0.0))
                put(plot_row, 0, present)
                noise = (k % STRIP) * pairs
                scan_row = row(address(known), k * width // WIDTH)
                addresses = (
                    address(state),
                    scan_row,
                    address(numbers),
                    row(address(a), noise),
                    row(address(b), noise),
                    plot_row,
                    address(even),
                )
                if k == 0:
                    begin(addresses)
                else:
                    move(addresses)

    return draw


@kernel_part
def add_errors_of_both(sums, first, components, error_row, baseline_row):
    """Add, from sums[first] on, how many tracks count in both rows, and e² and e⁴ of each over these, by component."""
    counted = get(error_row, components) * get(baseline_row, components)
    for c in range(components):
        e, b = counted * get(error_row, c), counted * get(baseline_row, c)
        square, base_square = e * e, b * b
        sums[first + 5 * c] += total(counted)
        add_totals(sums, first + 5 * c + 1, square, square * square, base_square, base_square * base_square)


def filter_kernel(first: Program, following: Program, rows: int, components: int, tested: bool, events: int):
    """The kernel that runs a filter over plots of `rows` rows a scan, and adds up its errors.

    error (K, C, 4) takes the sums of e … e⁴, paired (K, C) those of e² times the baseline's e²; where tested, believed
    (K, C) takes those of the variances that the filter believes, nees (K, 2) those of e' P⁻¹ e and its square. Among
    false plots counts (K, events) takes those of the events, and both (K, C, 5) how many tracks count with the baseline
    too, and the sums of e², e⁴ and of the baseline's over these."""
    begin, step = emit_program(first), emit_program(following)
    error_rows = components + (1 if events else 0)

    @kernel
    def follow(
        groups, count, known, width, numbers, plots, state, errors, base, error, paired, believed, nees, counts, both
    ):
        scans = known.size // width
        sums, products, variances, squares = address(error), address(paired), address(believed), address(nees)
        totals, shared = address(counts), address(both)
        is_counted, extra, marks = np.empty(WIDTH), np.zeros((components + 1) * WIDTH), np.zeros((events + 1) * WIDTH)
        for g in range(groups):
            for lane in range(WIDTH):
                is_counted[lane] = 1.0 if g * WIDTH + lane < count else 0.0
            for k in range(scans):
                n = g * scans + k
                error_row, baseline_row = row(address(errors), n * error_rows), row(address(base), n * error_rows)
                scan_row, plot_row = row(address(known), k * width // WIDTH), row(address(plots), n * rows)
                addresses = (
                    address(state),
                    scan_row,
                    address(numbers),
                    address(is_counted),
                    error_row,
                    plot_row,
                    address(extra),
                    address(marks),
                )
                if k == 0:
                    begin(addresses)
                else:
                    step(addresses)
                for event in range(events):
                    totals[k * events + event] += total(get(address(marks), event))
                if events:
                    put(error_row, components, get(address(marks), 0))
                    add_errors_of_both(shared, k * components * 5, components, error_row, baseline_row)
                for c in range(components):
                    e, b = get(error_row, c), get(baseline_row, c)
                    square = e * e
                    add_totals(sums, (k * components + c) * 4, e, square, e * square, square * square)
                    products[k * components + c] += total(square * (b * b))
                if tested:
                    for c in range(components):
                        variances[k * components + c] += total(get(address(extra), c))
                    q = get(address(extra), components)
                    squares[2 * k] += total(q)
                    squares[2 * k + 1] += total(q * q)

    return follow
