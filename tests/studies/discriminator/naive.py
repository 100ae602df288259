"""Textbook twins of the discriminator: the log posterior as written, least squares by SciPy, the printed formulas."""

import itertools
import math

import numpy as np
from scipy.optimize import least_squares


def phase(theta, t):
    """k(t) θ in rad (3)."""
    return theta[0] + 2 * np.pi * sum(f * t ** (i + 1) / math.factorial(i + 1) for i, f in enumerate(theta[1:]))


def log_posterior(theta, u, t, amplitude, noise_variance, prior, precision):
    """(5), the prior a penalty; complex samples have that noise variance in both parts."""
    clean = amplitude * (np.exp(1j * phase(theta, t)) if np.iscomplexobj(u) else np.cos(phase(theta, t)))
    d = np.asarray(theta) - prior
    return -0.5 * (np.sum(np.abs(u - clean) ** 2) / noise_variance + np.sum(precision * d**2))


def maximum(u, t, amplitude, noise_variance, prior, precision, start, scale):
    """The maximum of (5) near a start, by SciPy: the prior as further residuals, unknowns in units of `scale`."""
    sigma, root = math.sqrt(noise_variance), np.sqrt(precision)
    k = np.stack([2 * np.pi * t**i / math.factorial(i) for i in range(len(start))], axis=1)
    k[:, 0] = 1.0

    def residuals(x):
        theta = x * scale
        return np.concatenate([(amplitude * np.cos(phase(theta, t)) - u) / sigma, root * (theta - prior)])

    def jacobian(x):
        slope = -amplitude / sigma * np.sin(phase(x * scale, t))
        return np.vstack([slope[:, None] * k, np.diag(root)]) * scale

    found = least_squares(residuals, start / scale, jac=jacobian, method="lm", xtol=1e-12, ftol=1e-12, gtol=1e-12)
    return found.x * scale


def fisher(mu, duration, size):
    """The paper's printed elements of Φ_θ, one by one (after (6)); i, j from 1 as there."""
    phi = np.empty((size, size))
    for i in range(1, size + 1):
        for j in range(1, size + 1):
            if i == j == 1:
                phi[0, 0] = 2 * mu
            elif i == 1 or j == 1:
                m = max(i, j)
                phi[i - 1, j - 1] = 4 * math.pi * mu * duration ** (m - 1) / math.factorial(m)
            else:
                phi[i - 1, j - 1] = (2 * math.pi) ** 2 * 2 * mu * duration ** (i + j - 2)
                phi[i - 1, j - 1] /= math.factorial(i - 1) * math.factorial(j - 1) * (i + j - 1)
    return phi


def handover_form(before, after, mu_after, factor=3.0):
    """The left side of (14) at a hand-over (16) between two matrices Φ + R_pr⁻¹, with Σ of traces as printed."""
    scale = np.sqrt(np.diag(after))
    before, after = before / np.outer(scale, scale), after / np.outer(scale, scale)
    error, curvature = np.linalg.inv(before) - np.linalg.inv(after), after / (2 * mu_after)
    product = curvature @ error
    return np.trace(product) + factor * math.sqrt(2 * np.trace(product @ product))


def block_sums(u, turns, edges, t):
    """Σ u e^{-jψ} (t − mean t)^i over blocks of pulses, i = 0, 1, 2: (3, blocks)."""
    out = []
    for a, b in itertools.pairwise(edges):
        e, s = np.exp(-2j * np.pi * turns[:, a:b]), t[:, a:b] - t[:, a:b].mean()
        out.append([np.sum(u[:, a:b] * e * s**i) for i in range(3)])
    return np.array(out).T


def fisher_sum(burst, size, pulses, theta=None):
    """Fisher matrix (size, size) of the samples of the first pulses, a row of sensitivities each.

    With the true θ the sum is exact; without, sin² of the phase is replaced by its mean ½, as in the closed form.
    """
    offsets = np.arange(burst.samples_per_pulse) * burst.sampling_period_s
    t = (offsets[:, None] + np.arange(pulses) * burst.pulse_period_s).ravel()
    k = np.stack([2 * np.pi * t**i / math.factorial(i) for i in range(size)], axis=1)
    k[:, 0] = 1.0
    weight = np.full((len(t), 1), 1.0 if burst.complex_samples else 0.5)
    if theta is not None and not burst.complex_samples:
        weight = np.sin(phase(theta, t))[:, None] ** 2
    return burst.amplitude**2 / burst.noise_variance * (weight * k).T @ k


def amplitude(burst, samples, as_printed=False):
    """Amplitude from the mean energy (7) of the samples of a burst; the print gives its square."""
    numbers = samples.size * (2 if burst.complex_samples else 1)
    square = 2 * (np.sum(np.abs(samples) ** 2) - numbers * burst.noise_variance) / numbers
    return square if as_printed else math.sqrt(square)
