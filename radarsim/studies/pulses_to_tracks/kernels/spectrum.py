"""The classical estimate of a burst's frequency: the highest line of its spectrum, for eight bursts side by side."""

from radarsim.bursts.kernels.scoring_lanes import X, sine_cosine
from radarsim.kernels.compiler import kernel_part
from radarsim.kernels.lanes import full, get, put, where_greater


@kernel_part
def load_pulses(block_sums, pulses, offset, order, work, re, im):
    """Load the pulses' sums in the transform's order, padded with zeros, with the phase of the acceleration removed.

    offset is the distance of the true frequency from the nearest line, in lines."""
    phase_curvature, zero = get(work, X + 2), full(0.0)
    step, lines = 1.0 / pulses, 1.0 / order.size
    for i in range(order.size):
        j = order[i]
        if j >= pulses:
            put(re, i, zero)
            put(im, i, zero)
            continue
        t = j * step
        s, c = sine_cosine(phase_curvature * (t * t) + offset * lines * j)
        x, y = get(block_sums, 4 * j), get(block_sums, 4 * j + 1)
        put(re, i, c * x + s * y)
        put(im, i, c * y - s * x)


@kernel_part
def transform(twiddle, size, re, im):
    """Transform in place (discrete Fourier transform) values in bit-reversed order (Cooley and Tukey 1965)."""
    half = 1
    while half < size:
        stride = size // (2 * half)
        for begin in range(0, size, 2 * half):
            for j in range(half):
                c, s = twiddle[j * stride, 0], twiddle[j * stride, 1]
                low, high = begin + j, begin + j + half
                x, y = get(re, high), get(im, high)
                u, v = c * x + s * y, c * y - s * x
                x, y = get(re, low), get(im, low)
                put(re, low, x + u)
                put(im, low, y + v)
                put(re, high, x - u)
                put(im, high, y - v)
        half *= 2


@kernel_part
def highest_line(block_sums, pulses, offset, twiddle, order, work, re, im):
    """Put the frequency of the highest line into work, in turns over the burst, from −half the rate to half of it."""
    size = order.size
    load_pulses(block_sums, pulses, offset, order, work, re, im)
    transform(twiddle, size, re, im)
    best, highest = full(-1.0), full(0.0)
    for m in range(size):
        x, y = get(re, m), get(im, m)
        power = x * x + y * y
        line = float(m if 2 * m < size else m - size)
        highest = where_greater(power, best, full(line), highest)
        best = where_greater(power, best, power, best)
    put(work, X + 1, (highest + offset) * (pulses / size))
