"""A burst's samples: signal, noise, demodulation, block sums."""

import numpy as np

from radarsim.bursts.kernels.scoring import (
    CENTRE,
    HALF,
    LIMIT,
    REF,
    ROWS,
    SLOPE,
    TURN,
    W0,
    W1,
    W2,
    Z0,
    Z1,
    Z2,
    derivative,
    number,
    polynomial,
    second_derivative,
    sincos_turns,
)
from radarsim.kernels.compiler import kernel, summing_kernel
from radarsim.kernels.random import U, normal_pair, threefry

PHYSICS = np.dtype(
    [
        ("mode", np.int64),  # BLOCK_SUMS, SAMPLES or DEMODULATED
        ("complex_samples", np.int64),
        ("image", np.int64),  # whether the sums at twice the frequency matter
        ("pulses", np.int64),
        ("samples_per_pulse", np.int64),
        ("amplitude", np.float64),
        ("sigma", np.float64),  # of the noise
        ("step", np.float64),  # pulse period in bursts
        ("offset", np.float64),  # sampling period in bursts
    ],
    align=True,
)
BLOCK_SUMS, SAMPLES, DEMODULATED = 0, 1, 2
NO_PIVOT = 1e-12  # of the variance: below it is rounding, and a σ under 10⁻⁶ of the row's

CHUNK = 2048  # samples made at a time, so that noise is still in the first cache when the signal is added


@kernel
def fill_noise(k0, k1, realisation, first, row):
    """Unit normals into row (n,): call first + j makes those of element j and of the ones 1, 2, 3 quarters later."""
    quarter = row.size // 4
    for j in range(quarter):
        x, y = threefry(U(realisation), U(first + j), k0, k1)
        row[j], row[j + quarter] = normal_pair(x)
        row[j + 2 * quarter], row[j + 3 * quarter] = normal_pair(y)
    x, y = threefry(U(realisation), U(first + quarter), k0, k1)
    last_normals = (*normal_pair(x), *normal_pair(y))
    for j in range(4 * quarter, row.size):
        row[j] = last_normals[j - 4 * quarter]


@kernel
def add_signal(sigma, clean, row):
    """clean (n,) plus sigma times the noise in row (n,), in place. In one loop with `fill_noise` LLVM stays scalar."""
    for j in range(row.size):
        row[j] = clean[j] + sigma * row[j]


@kernel
def draw_samples(physics, key, realisation, clean, samples):
    """Samples (1 or 2, n) of a burst: clean (1 or 2, n) and noise; row 1 is the imaginary part, with later draws. The
    columns are all pulses' first samples, then all second ones, …; each chunk of them has draws of its own."""
    n = samples.shape[1]
    for r in range(samples.shape[0]):
        for start in range(0, n, CHUNK):
            stop = min(start + CHUNK, n)
            part = samples[r, start:stop]
            fill_noise(key[0], key[1], realisation, r * (n + 1) + start, part)
            add_signal(physics.sigma, clean[r, start:stop], part)


@kernel
def demodulate(physics, edges, samples, x, first, last, sums):
    """Block sums of blocks first … last − 1 from the samples, about the phase of x (6,), turns over the burst.

    edges (blocks + 1,) are the pulses where blocks begin and end."""
    for i in range(first, last):
        centre = sums[CENTRE, i]
        for row in range(Z0, ROWS):
            sums[row, i] = 0.0
        bend = sums[HALF, i] * second_derivative(x[2], x[3], x[4], x[5], centre)
        sums[REF, i] = polynomial(x[0], x[1], x[2], x[3], x[4], x[5], centre) + bend
        sums[SLOPE, i] = derivative(x[1], x[2], x[3], x[4], x[5], centre)
        for j in range(physics.samples_per_pulse):
            place, count = j * physics.pulses + edges[i], edges[i + 1] - edges[i]
            time = edges[i] * physics.step + j * physics.offset
            if physics.complex_samples:
                demodulate_complex(samples, place, count, time, physics.step, x, sums, i)
            else:
                demodulate_real(samples, place, count, time, physics.step, x, sums, i)
                if physics.image:
                    reference_image(samples, place, count, time, physics.step, x, sums, i)


def _demodulated(source):
    """The loop that adds samples times e^{-jψ_ref} sⁱ, i = 0, 1, 2, to block i; source: real, complex, or the image's.
    The image's samples are all one, at twice the phase, and go to W₀, W₁, W₂ in place of Z₀, Z₁, Z₂."""
    turns, first = (2.0, W0) if source == "image" else (1.0, Z0)
    real, image = source == "real", source == "image"
    sign = 1.0 if source == "complex" else -1.0

    @summing_kernel
    def demodulate(samples, place, count, time, step, x, sums, i):
        x0, x1, x2, x3, x4, x5 = turns * x[0], turns * x[1], turns * x[2], turns * x[3], turns * x[4], turns * x[5]
        row = samples[0, place : place + count]  # an index that may be negative is not vectorised
        imaginary = row if real or image else samples[1, place : place + count]
        centre, a, b, p, q, v, w = sums[CENTRE, i], 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for m in range(count):
            t = time + number(m) * step
            s, c = sincos_turns(polynomial(x0, x1, x2, x3, x4, x5, t))
            t = t - centre
            if real:
                c, s = row[m] * c, row[m] * s
            elif not image:
                re, im = row[m], imaginary[m]
                c, s = re * c + im * s, im * c - re * s
            a += c
            b += s
            c, s = c * t, s * t
            p += c
            q += s
            v += c * t
            w += s * t
        sums[first, i] += a
        sums[first + 1, i] += sign * b
        sums[first + 2, i] += p
        sums[first + 3, i] += sign * q
        sums[first + 4, i] += v
        sums[first + 5, i] += sign * w

    return demodulate


# (samples, place, count, time, step, x, sums, i): of the samples from column `place`, the first at `time`.
demodulate_real, demodulate_complex, reference_image = map(_demodulated, ("real", "complex", "image"))


def block_table(
    physics: np.void, edges: np.ndarray, reference: np.ndarray, clean: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Exact mean (ROWS, blocks padded to eights) and covariance root (blocks, 10) of sums about a reference phase.

    reference (samples per pulse, pulses) in turns; clean alike, the noise-free samples. Z₂ is put at its mean: its
    noise meets only the square of a small slope. The root holds the lower triangle by rows for Re and Im of Z₀ and Z₁,
    see `triangular_root`."""
    blocks = len(edges) - 1
    padded = -(-blocks // 8) * 8  # so that loops over blocks have no remainder
    mean, factor = np.zeros((ROWS, padded)), np.zeros((blocks, 10))
    t = np.arange(physics["pulses"]) * physics["step"]
    t = t + np.arange(physics["samples_per_pulse"])[:, None] * physics["offset"]
    turn = np.exp(-1j * TURN * (reference - np.rint(reference)))
    for i in range(blocks):
        part = slice(edges[i], edges[i + 1])
        mean[CENTRE, i] = t[:, part].mean()
        s, e = (t[:, part] - mean[CENTRE, i]).ravel(), turn[:, part].ravel()
        mean[HALF, i] = 0.5 * np.mean(s**2)
        mean[LIMIT, i] = 1.0 / max(np.sqrt(np.mean(s**2)), 1e-9)
        received = clean[:, part].ravel() * e
        for n, (z, w) in enumerate(((Z0, W0), (Z1, W1), (Z2, W2))):
            mean[z, i], mean[z + 1, i] = np.sum(received * s**n).real, np.sum(received * s**n).imag
            if not physics["complex_samples"]:
                mean[w, i], mean[w + 1, i] = np.sum(e**2 * s**n).real, np.sum(e**2 * s**n).imag
        rows = np.stack([e.real, e.imag, e.real * s, e.imag * s])
        covariance = rows @ rows.T
        if physics["complex_samples"]:
            rows = np.stack([-e.imag, e.real, -e.imag * s, e.real * s])
            covariance = covariance + rows @ rows.T
        root = triangular_root(covariance)
        factor[i] = physics["sigma"] * root[np.tril_indices(4)]
    return mean, factor


def triangular_root(covariance: np.ndarray) -> np.ndarray:
    """The lower triangular root L (n, n), L Lᵀ = covariance, whose diagonal is not negative; singular ones too.

    Such a root is unique when a column without a pivot is zero. Roots from eigenvectors or QR are not: LAPACK chooses
    their signs, and chooses otherwise on other processors, so that the same words gave other noise. A block of fewer
    than four samples has a singular covariance; a pivot within rounding of zero then stands for zero."""
    n = len(covariance)
    root = np.zeros((n, n))
    for j in range(n):
        pivot = covariance[j, j] - root[j, :j] @ root[j, :j]
        if pivot > NO_PIVOT * covariance[j, j]:
            root[j, j] = np.sqrt(pivot)
            root[j + 1 :, j] = (covariance[j + 1 :, j] - root[j + 1 :, :j] @ root[j, :j]) / root[j, j]
    return root
