"""Random draws of a realisation: which plots come, their biases, and where the flight starts."""

import math

from radarsim.kernels.compiler import kernel_part
from radarsim.kernels.lanes import full, get, put, where_greater
from radarsim.kernels.random import fill_normal_pairs
from radarsim.studies.range_doppler.kernels.missed_steps import CHUNK, EIGHTS


@kernel_part
def count_plots(memory, k, detection, n):
    """Which of the first n realisations have a plot at scan k, by uniform numbers, counted.

    Two scans share a pair of numbers: those of an even scan lie in `detected`, those of the next in `other`."""
    detected, ones, zeros = memory.detected, full(1.0), full(0.0)
    if detection == 1.0:
        for i in range(EIGHTS):
            put(detected, i, ones)
    else:
        uniforms = detected if k % 2 == 0 else memory.other
        for i in range(EIGHTS):
            put(detected, i, where_greater(full(detection), get(uniforms, i), ones, zeros))
    for i in range(n, CHUNK):
        detected[i] = 0.0
    for i in range(EIGHTS):
        present, count = get(detected, i), get(memory.count, i)
        is_first = present * where_greater(ones, count, ones, zeros)
        put(memory.first, i, where_greater(is_first, zeros, full(float(k)), get(memory.first, i)))
        put(memory.count, i, count + present)


@kernel_part
def draw_once(keys, first, arrays, bias, sigma_bias, sigma_flight):
    """Biases and the flight's displacement of realisations first, first + 1, …"""
    fill_normal_pairs(keys[2], first, 0, arrays.offset[0], arrays.offset[1])
    for m in range(2):
        for i in range(arrays.other.size):
            arrays.offset[m, i] = bias[m] + sigma_bias[m] * arrays.offset[m, i]
    for c in range(3):
        fill_normal_pairs(keys[2], first, 3 + c, arrays.shift[2 * c], arrays.shift[2 * c + 1])
    for c in range(6):
        for i in range(arrays.other.size):
            arrays.shift[c, i] = sigma_flight[c] * arrays.shift[c, i]


@kernel_part
def displace(arrays, flight, truth, t):
    """The difference of the truth (3,) at a time t (s) that the displacement of its flight (9,) makes, into state."""
    shift, state = arrays.shift, arrays.state
    for i in range(arrays.other.size):
        vx, vy, vz = flight[1] + shift[3, i], flight[4] + shift[4, i], flight[7] + shift[5, i]
        x = flight[0] + shift[0, i] + t * shift[3, i]
        y = flight[3] + shift[1, i] + t * shift[4, i]
        z = flight[6] + shift[2, i] + t * shift[5, i]
        r = math.sqrt(x * x + y * y + z * z)
        v = (x * vx + y * vy + z * vz) / r
        pull = x * flight[2] + y * flight[5] + z * flight[8]
        state[0, i], state[1, i] = r - truth[0], v - truth[1]
        state[2, i] = (vx * vx + vy * vy + vz * vz + pull - v * v) / r - truth[2]


@kernel_part
def displace_plots(memory):
    """Add what was drawn of the truth, and the biases, to the plots."""
    for i in range(2 * EIGHTS):
        put(memory.plots, i, get(memory.plots, i) + get(memory.state, i) + get(memory.offset, i))
