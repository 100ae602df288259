"""The densities of recorded plots under a filter that is given by its steps, compiled.

The steps come as programs (`radarsim.kernels.tracing`). Rows of all tracks follow each other; of each its kind, START,
PREDICT or PLOT, the time since the row before, s, and the numbers of its plot, where it has one. Without outliers a
recording takes one of the eight lanes: the others hold the same.

Where errors may follow another law, a plot is taken with each, in strips of lanes (`radarsim.studies.step_laws`). The
states after it are merged by moments, two by two: strip after strip, then lanes."""

import numpy as np

from radarsim.kernels.compiler import careful_kernel, careful_part
from radarsim.kernels.lane_programs import emit_program
from radarsim.kernels.lanes import WIDTH, address, full, put, row
from radarsim.kernels.tracing import Program

START, PREDICT, PLOT = range(3)  # kinds of rows: the first plot of a track, a scan without a plot, a later plot
# Arrays of a program: the state before and after a step, one to merge it with, its own probability of the two, the
# numbers of the filter, the time since the row before, a plot, its densities, and factors on σ of its numbers and
# shifts of these in the stated σ, a factor on σ of the process noise.
BEFORE, AFTER, OTHER, PROBABILITY, NUMBERS, INTERVAL, MEASURED, DENSITIES, FACTORS, SHIFTS, NOISE = range(11)


def plain_kernel(start: Program, predict: Program, take: Program):
    """The kernel that fills log_densities (n, m): of a later plot's first number, of the first two, and so on, given
    all plots before; zero in other rows, not-a-number where the state after a plot is none.

    It takes the kinds and intervals (n,) of rows, their plots (n, numbers), the numbers of the filter, and work arrays
    of rows: state, interval, measured, densities."""
    begin, move, update = map(emit_program, (start, predict, take))

    @careful_kernel
    def follow(kinds, intervals, plots, numbers, state, interval, measured, densities, log_densities):
        states, stated = (address(state), address(state), address(state)), address(numbers)
        addresses = (*states, stated, stated, address(interval), address(measured), address(densities))
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


def laws_kernel(start: Program, predict: Program, take: Program, merge: Program, rows: int):
    """The kernel that fills log_densities (n,), of later plots whose errors follow one of several laws, and soundness
    (n, m), the probability of each of their numbers that it is no outlier.

    It takes a recording as `plain_kernel` does, in a record; the numbers of the filter; the laws, as
    `radarsim.studies.step_laws` has them; and work arrays of rows: state, interval, measured, densities, a predicted
    state, one in each strip, another, and a row each of probabilities and of the noise. rows: of a state."""
    begin, move, update, merge_states = *map(emit_program, (start, predict, take)), merging_part(merge, rows)

    @careful_kernel
    def follow(recording, numbers, laws, work, log_densities, soundness):
        kinds, intervals, plots = recording
        state, interval, measured, densities, predicted, after, other, own, noise = work
        measured_rows, last = plots.shape[1], (soundness.shape[1] - 1) * WIDTH
        probabilities = np.empty(laws.chances.shape)
        fixed = address(other), address(own), address(numbers), address(interval), address(measured), address(densities)
        factors, shifts = address(laws.factors), address(laws.shifts)
        for k in range(kinds.size):
            put(address(interval), 0, full(intervals[k]))
            for j in range(measured_rows):
                put(address(measured), j, full(plots[k, j]))
            if kinds[k] == START:
                begin((address(state), address(state), *fixed, address(laws.start_factors), shifts, address(noise)))
                continue
            for s in range(len(probabilities) if kinds[k] == PLOT else 1):
                if s == 0 or laws.noise_factors[s] != laws.noise_factors[s - 1]:
                    put(address(noise), 0, full(laws.noise_factors[s]))
                    move((address(state), address(predicted), *fixed, factors, shifts, address(noise)))
                if kinds[k] == PLOT:
                    of_strip = row(factors, s * measured_rows), row(shifts, s * measured_rows), address(noise)
                    update((address(predicted), row(address(after), s * rows), *fixed, *of_strip))
                    for lane in range(WIDTH):
                        density = laws.chances[s, lane] + densities[last + lane]
                        probabilities[s, lane] = -np.inf if np.isnan(density) else density
            if kinds[k] == PLOT:
                log_densities[k] = weigh(probabilities, laws.outliers, soundness, k)
                merge_states(len(probabilities), address(after), address(probabilities), *fixed)
            new = after if kinds[k] == PLOT else predicted
            for i in range(state.size):
                state[i] = new[i]
                if not np.isfinite(new[i]):
                    log_densities[k] = np.nan

    return follow


@careful_part
def weigh(probabilities, outliers, soundness, k):
    """Make probabilities of laws (strips, 8) of their logarithms, fill row k of the soundness by them, and return the
    logarithm of their sum."""
    greatest = probabilities.max()
    probabilities[:] = np.exp(probabilities - greatest)
    total = probabilities.sum()
    probabilities /= total
    for j in range(soundness.shape[1]):
        soundness[k, j] = 1.0 - (probabilities * outliers[j]).sum()
    return greatest + np.log(total)


def merging_part(merge: Program, rows: int):
    """The part that merges states (strips, rows) by moments, with probabilities (strips, 8), into all lanes of the
    first."""
    join = emit_program(merge)

    @careful_part
    def merge_states(strips, states, probabilities, other, own, numbers, interval, measured, densities):
        for s in range(1, strips):
            add_probabilities(probabilities, row(probabilities, s), 0, own)
            join((states, states, row(states, s * rows), own, numbers))
        distance = WIDTH // 2
        while distance > 0:
            for r in range(rows):
                for lane in range(WIDTH):
                    other[r * WIDTH + lane] = states[r * WIDTH + (lane ^ distance)]
            add_probabilities(probabilities, probabilities, distance, own)
            join((states, states, other, own, numbers))
            distance //= 2
        for r in range(rows):
            put(states, r, full(states[r * WIDTH]))

    return merge_states


@careful_part
def add_probabilities(probabilities, others, distance, own):
    """Add to the probabilities (8,) of states those of others, each in the lane at a distance; own (8,): the share of
    the former."""
    for lane in range(WIDTH):
        total = probabilities[lane] + others[lane ^ distance]
        own[lane] = probabilities[lane] / total if total > 0.0 else 1.0
    for lane in range(WIDTH):
        if distance == 0 or lane & distance == 0:
            total = probabilities[lane] + others[lane ^ distance]
            probabilities[lane] = total
            if distance > 0:
                probabilities[lane ^ distance] = total
