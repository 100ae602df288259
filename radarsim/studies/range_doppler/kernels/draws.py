"""What is drawn of a scan: which realisations have their plot, its noise, biases, and a target's own motion."""

import math

from radarsim.kernels.compile import part
from radarsim.kernels.lanes import full, get, put, where_greater
from radarsim.kernels.random import fill_normal_pairs
from radarsim.studies.range_doppler.kernels.chunk import CHUNK, EIGHTS


@part
def count_plots(at, k, detection, n):
    """Which of the first n realisations have a plot at scan k, by uniform numbers, counted.

    Two scans share a pair of numbers: those of an even scan lie in `detected`, those of the next in `other`.
    """
    detected, one, none = at.detected, full(1.0), full(0.0)
    if detection == 1.0:
        for i in range(EIGHTS):
            put(detected, i, one)
    else:
        drawn = detected if k % 2 == 0 else at.other
        for i in range(EIGHTS):
            put(detected, i, where_greater(full(detection), get(drawn, i), one, none))
    for i in range(n, CHUNK):
        detected[i] = 0.0
    for i in range(EIGHTS):
        here, count = get(detected, i), get(at.count, i)
        first_one = here * where_greater(one, count, one, none)
        put(at.first, i, where_greater(first_one, none, full(float(k)), get(at.first, i)))
        put(at.count, i, count + here)


@part
def draw_once(keys, first, made, bias, sigma_bias, sigma_flight):
    """Biases and the flight's displacement of realisations first, first + 1, …"""
    fill_normal_pairs(keys[2], first, 0, made.offset[0], made.offset[1])
    for m in range(2):
        for i in range(made.other.size):
            made.offset[m, i] = bias[m] + sigma_bias[m] * made.offset[m, i]
    for c in range(3):
        fill_normal_pairs(keys[2], first, 3 + c, made.shift[2 * c], made.shift[2 * c + 1])
    for c in range(6):
        for i in range(made.other.size):
            made.shift[c, i] = sigma_flight[c] * made.shift[c, i]


@part
def displace(made, flight, truth, t):
    """The difference of the truth (3,) at a time t (s) that the displacement of its flight (9,) makes, into state."""
    shift, state = made.shift, made.state
    for i in range(made.other.size):
        vx, vy, vz = flight[1] + shift[3, i], flight[4] + shift[4, i], flight[7] + shift[5, i]
        x = flight[0] + shift[0, i] + t * shift[3, i]
        y = flight[3] + shift[1, i] + t * shift[4, i]
        z = flight[6] + shift[2, i] + t * shift[5, i]
        r = math.sqrt(x * x + y * y + z * z)
        v = (x * vx + y * vy + z * vz) / r
        pull = x * flight[2] + y * flight[5] + z * flight[8]
        state[0, i], state[1, i] = r - truth[0], v - truth[1]
        state[2, i] = (vx * vx + vy * vy + vz * vz + pull - v * v) / r - truth[2]


@part
def displace_plots(at):
    """Add what was drawn of the truth, and the biases, to the plots."""
    for i in range(2 * EIGHTS):
        put(at.plots, i, get(at.plots, i) + get(at.state, i) + get(at.offset, i))
