"""The densities of recorded plots under a filter that is given by its steps, compiled.

The steps come as programs (`radarsim.kernels.tracing`). A recording takes one of the eight lanes: the others hold the
same. Rows of all tracks follow each other; of each its kind, START, PREDICT or PLOT, the time since the row before, s,
and the numbers of its plot, where it has one."""

import numpy as np

from radarsim.kernels.compiler import careful_kernel
from radarsim.kernels.lane_programs import emit_program
from radarsim.kernels.lanes import WIDTH, address, full, put
from radarsim.kernels.tracing import Program

START, PREDICT, PLOT = range(3)  # kinds of rows: the first plot of a track, a scan without a plot, a later plot
STATE, NUMBERS, INTERVAL, MEASURED, DENSITIES = range(5)  # arrays of a program


def plain_kernel(start: Program, predict: Program, take: Program):
    """The kernel that fills log_densities (n, m): of a later plot's first number, of the first two, and so on, given
    all plots before; zero in other rows, not-a-number where the state after a plot is none.

    It takes the kinds and intervals (n,) of rows, their plots (n, numbers), the numbers of the filter, and work arrays
    of rows: state, interval, measured, densities."""
    begin, move, update = map(emit_program, (start, predict, take))

    @careful_kernel
    def follow(kinds, intervals, plots, numbers, state, interval, measured, densities, log_densities):
        addresses = address(state), address(numbers), address(interval), address(measured), address(densities)
        for k in range(kinds.size):
            put(address(interval), 0, full(intervals[k]))
            for j in range(plots.shape[1]):
                put(address(measured), j, full(plots[k, j]))
            if kinds[k] == START:
                begin(addresses)
                continue
            move(addresses)
            if kinds[k] == PLOT:
                update(addresses)
                for j in range(log_densities.shape[1]):
                    log_densities[k, j] = densities[j * WIDTH]
                for number in state:
                    if not np.isfinite(number):
                        log_densities[k] = np.nan

    return follow
