"""The log posterior of a burst's phase, and its gradient.

Uss, Baryshev, Djavad 2010, equations 5 and 6. It is computed over samples, or over sums of short blocks of them.

The phase is p(τ) = Σ b_j τ^j turns, τ the time in windows. In units of A/σ² the data's part of the log posterior is

    L = Re Σ u e^{-jψ} − (A/4) Re Σ e^{-2jψ};

the second sum, the image at twice the frequency, is absent for complex samples.

Block sums are those of u e^{-jψ_ref} sⁱ and e^{-2jψ_ref} sⁱ, i = 0, 1, 2, over a few samples, s the time from the
block's centre. With d the mean of ψ − ψ_ref over the block and D its slope,

    Σ u e^{-jψ} ≈ e^{-jd} (Z₀ − jD Z₁ − ½D² Z₂).

Without the terms in D, 32 blocks to a window are off by 0.11 Cramér–Rao bounds; with them 16 are within 0.02. With d
taken at the centre and not as the mean, information is lost and σ 0.3 % high. D is cut where the phase turns by one
radian rms within a block: beyond that the expansion is invalid, and without the limit it drives lost estimates away."""

import math

import numpy as np

from radarsim.kernels.compiler import inline, summing_kernel
from radarsim.kernels.polynomials import sine_cosine_polynomial

SIZE = 6  # coefficients of the phase; unused ones have zero rows in the root of the step matrix
TURN = 2.0 * math.pi
ROUND = 6755399441055744.0  # 1.5 · 2**52: adding it rounds to a whole number
# Rows of the array of block sums: the block's central time in bursts; half the mean of s²; the slope D in radians a
# burst that is one radian rms over the block; ψ_ref in turns, its mean over the block, and its slope in turns a burst;
# then Z₀, Z₁, Z₂, W₀, W₁, W₂, each a real and an imaginary part.
CENTRE, HALF, LIMIT, REF, SLOPE, Z0, Z1, Z2, W0, W1, W2, ROWS = 0, 1, 2, 3, 4, 5, 7, 9, 11, 13, 15, 17

# What a function is given to work on. A record is passed as one pointer; six arrays, which are some fifty words, made a
# scoring step twice as slow, and a tuple of arrays, which has its references counted, eight times.
STATE = np.dtype(
    [
        ("x", np.float64, SIZE),  # estimate in turns over the burst
        ("prior", np.float64, SIZE),
        ("truth", np.float64, SIZE),
        ("b", np.float64, SIZE),  # estimate in turns over the window
        ("out", np.float64, 8),  # L, the coherent sum and the gradient's six sums
        ("amplitude", np.float64),
    ],
    align=True,
)


@inline
def sincos_turns(u):
    """sin and cos of u turns, |u| < 2**50, to 1 unit in the last place of u's fraction."""
    r = 4.0 * u
    m = r + ROUND
    q = np.float64(m).view(np.int64)
    s, c = sine_cosine_polynomial((r - (m - ROUND)) * 1.5707963267948966)
    si, ci = np.float64(s).view(np.int64), np.float64(c).view(np.int64)
    swap = -(q & np.int64(1))
    cosine = ((ci & ~swap) | (si & swap)) ^ (((q + np.int64(1)) & np.int64(2)) << np.int64(62))
    sine = ((si & ~swap) | (ci & swap)) ^ ((q & np.int64(2)) << np.int64(62))
    return np.int64(sine).view(np.float64), np.int64(cosine).view(np.float64)


@inline
def number(m):
    """A whole number from 0 to 2**52 as float64: AVX2 has no such conversion, and a loop with one is half scalar."""
    return np.int64(m + np.int64(0x4330000000000000)).view(np.float64) - 4503599627370496.0


@inline
def polynomial(b0, b1, b2, b3, b4, b5, t):
    """Σ bⱼ tʲ by Horner's scheme, j = 0 … 5."""
    return ((((b5 * t + b4) * t + b3) * t + b2) * t + b1) * t + b0


@inline
def derivative(b1, b2, b3, b4, b5, t):
    """d/dt of `polynomial`."""
    return (((5.0 * b5 * t + 4.0 * b4) * t + 3.0 * b3) * t + 2.0 * b2) * t + b1


@inline
def second_derivative(b2, b3, b4, b5, t):
    """d²/dt² of `polynomial`."""
    return ((20.0 * b5 * t + 12.0 * b4) * t + 6.0 * b3) * t + 2.0 * b2


def _over_samples(complex_samples):
    """The loop over samples, compiled for real and for complex ones apart."""

    @summing_kernel
    def score(samples, first, pulses, step, offset, amplitude, state):
        b0, b1, b2, b3, b4, b5 = state.b[0], state.b[1], state.b[2], state.b[3], state.b[4], state.b[5]
        u = samples[0, first : first + pulses]  # an index that may be negative is not vectorised
        v = samples[1, first : first + pulses] if complex_samples else u
        uc = cc = g0 = g1 = g2 = g3 = g4 = g5 = 0.0
        for m in range(pulses):
            t = number(m) * step + offset
            s, c = sincos_turns(polynomial(b0, b1, b2, b3, b4, b5, t))
            if complex_samples:
                x, y = u[m], v[m]
                uc += x * c + y * s
                e = y * c - x * s
            else:
                y = u[m]
                uc += y * c
                cc += c * c
                e = s * (amplitude * c - y)
            g0 += e
            e *= t
            g1 += e
            e *= t
            g2 += e
            e *= t
            g3 += e
            e *= t
            g4 += e
            e *= t
            g5 += e
        image = amplitude * (cc - 0.5 * pulses)
        add(state.out, uc - 0.5 * image, uc - image, (g0, g1, g2, g3, g4, g5))

    return score


@inline
def add(out, level, coherent, gradient):
    """Add to out (8,): L, the coherent sum that is A/2 a sample at the truth, and the sums of ∂L/∂ψ τ^j, j = 0 … 5."""
    out[0] += level
    out[1] += coherent
    for j in range(6):
        out[2 + j] += gradient[j]


# (samples, first, pulses, step, offset, amplitude, state): samples first … first + pulses − 1 at τ = offset,
# offset + step, …, at the phase state.b; adds to state.out. Complex samples have their
# imaginary parts in row 1 and no image: their amplitude is zero.
score_samples, score_complex_samples = _over_samples(False), _over_samples(True)


def _over_blocks(image):
    """The loop over sums of blocks; of the image at twice the phase, apart: a factor given at run time costs 6 %."""
    turns, first = (2.0, W0) if image else (1.0, Z0)

    @summing_kernel
    def score(sums, blocks, per_window, amplitude, state):
        b0, b1, b2, b3, b4, b5 = state.b[0], state.b[1], state.b[2], state.b[3], state.b[4], state.b[5]
        total = g0 = g1 = g2 = g3 = g4 = g5 = 0.0
        for i in range((blocks + 7) >> 3 << 3):
            t = sums[CENTRE, i] * per_window
            half = sums[HALF, i] * per_window**2
            mean = polynomial(b0, b1, b2, b3, b4, b5, t) + half * second_derivative(b2, b3, b4, b5, t)
            s, c = sincos_turns(turns * (mean - sums[REF, i]))
            D = turns * TURN * (derivative(b1, b2, b3, b4, b5, t) * per_window - sums[SLOPE, i])
            D = min(max(D, -sums[LIMIT, i]), sums[LIMIT, i])
            z1r, z1i, z2r, z2i = sums[first + 2, i], sums[first + 3, i], sums[first + 4, i], sums[first + 5, i]
            zr = sums[first, i] + D * (z1i - 0.5 * D * z2r)
            zi = sums[first + 1, i] - D * (z1r + 0.5 * D * z2i)
            re, e = c * zr + s * zi, c * zi - s * zr
            h = ((c * z1i - s * z1r) - D * (c * z2r + s * z2i)) * per_window
            inside = i < blocks
            re, e, h = (re if inside else 0.0), (e if inside else 0.0), (h if inside else 0.0)
            total += re
            # The mean of τ^j over the block is τ^j + j(j − 1) τ^{j−2} half; its slope takes h.
            bend = half * e
            g0 += e
            g1 += e * t + h
            e, h = e * t, h * t
            g2 += e * t + 2.0 * h + 2.0 * bend
            e, h, bend = e * t, h * t, bend * t
            g3 += e * t + 3.0 * h + 6.0 * bend
            e, h, bend = e * t, h * t, bend * t
            g4 += e * t + 4.0 * h + 12.0 * bend
            e, h, bend = e * t, h * t, bend * t
            g5 += e * t + 5.0 * h + 20.0 * bend
        if image:
            w = -0.5 * amplitude
            add(state.out, 0.5 * w * total, w * total, (w * g0, w * g1, w * g2, w * g3, w * g4, w * g5))
        else:
            state.out[:] = 0.0
            add(state.out, total, total, (g0, g1, g2, g3, g4, g5))

    return score


# (sums, blocks, per_window, amplitude, state): as `score_samples` over the first blocks of sums (ROWS, blocks padded),
# per_window bursts a window. score_blocks overwrites state.out and needs no amplitude; score_image adds the image's
# part −(A/4) Re Σ e^{-2jψ} to it.
score_blocks, score_image = _over_blocks(False), _over_blocks(True)
