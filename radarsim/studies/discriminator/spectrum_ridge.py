"""The classical rival of the sequence of discriminators: the ridge of the short-time spectrum, without a prior.

Quasi maximum likelihood with a refinement in the manner of O'Shea: a short-time Fourier transform gives the frequency
of each stretch of the burst; a robust polynomial through them demodulates the burst; sums over longer and longer
stretches of the remainder, unwrapped, give the phase, and a least-squares polynomial its coefficients. Scoring over the
whole burst follows, in the kernels."""

import numpy as np

STRETCH = 256  # pulses of a short-time spectrum
PADDED = 4 * STRETCH
TRIALS = 400  # polynomials through a few stretches each, of which the one with most company starts the fit
INLIER = 2.0 / PADDED  # turns a pulse between ridge and polynomial
ROUNDS = 4  # of fitting to the inliers
SUMS = (150, 300)  # sums in which the demodulated burst is unwrapped, first coarse


class Ridge:
    """Samples (n,), one a pulse, to phase coefficients (size,) in turns over the burst."""

    def __init__(self, pulses: int, size: int):
        self.pulses, self.size = pulses, size
        starts = np.arange(0, pulses - STRETCH + 1, STRETCH // 2)
        self.stretches = starts[:, None] + np.arange(STRETCH)
        self.centres = (starts + 0.5 * (STRETCH - 1)) / pulses
        self.t = np.arange(pulses) / pulses
        # One stretch from each of as many equal parts of the burst as the polynomial has coefficients; fixed draws.
        bounds = np.linspace(0, len(starts), size).astype(int)
        draws = np.random.default_rng(1).random((TRIALS, size - 1))
        self.trials = bounds[:-1] + (draws * np.diff(bounds)).astype(int)

    def __call__(self, samples: np.ndarray) -> np.ndarray:
        rough = self.from_frequencies(self.frequencies(samples))
        for count in SUMS:
            rough = self.refine(samples, rough, count)
        return rough

    def frequencies(self, samples: np.ndarray) -> np.ndarray:
        """Frequency in turns a burst of each stretch: the parabola through the spectrum's peak and its neighbours."""
        from scipy import fft

        windowed = samples[self.stretches] * np.hanning(STRETCH)
        power = np.abs(fft.fft(windowed, PADDED, axis=1)[:, : PADDED // 2 if np.isrealobj(samples) else PADDED]) ** 2
        peak = np.clip(power.argmax(axis=1), 1, power.shape[1] - 2)
        before_peak, at_peak, after_peak = (power[np.arange(len(peak)), peak + d] for d in (-1, 0, 1))
        bend = np.minimum(before_peak - 2.0 * at_peak + after_peak, -1e-12 * at_peak)
        turns = (peak + np.clip(0.5 * (before_peak - after_peak) / bend, -1.0, 1.0)) / PADDED
        if np.iscomplexobj(samples):
            turns = turns - np.rint(turns)
        return turns * self.pulses

    def from_frequencies(self, frequencies: np.ndarray) -> np.ndarray:
        """Coefficients of a robust polynomial through the ridge: random sample consensus, then a fit to the inliers."""
        powers = self.centres[:, None] ** np.arange(self.size - 1)
        slopes = np.linalg.solve(powers[self.trials], frequencies[self.trials][..., None])[..., 0]
        is_inlier = np.abs(slopes @ powers.T - frequencies) < INLIER * self.pulses
        best = slopes[is_inlier.sum(axis=1).argmax()]
        for _ in range(ROUNDS):
            inliers = np.abs(powers @ best - frequencies) < INLIER * self.pulses
            best = np.linalg.lstsq(powers[inliers], frequencies[inliers], rcond=None)[0]
        return np.concatenate([[0.0], best / np.arange(1, self.size)])

    def refine(self, samples: np.ndarray, coefficients: np.ndarray, count: int) -> np.ndarray:
        """Demodulated, summed over stretches, unwrapped, and the remaining phase fitted."""
        turns = np.polynomial.polynomial.polyval(self.t, coefficients)
        bare = samples * np.exp(-2j * np.pi * (turns - np.rint(turns)))
        used = self.pulses // count * count
        sums = bare[:used].reshape(-1, count).sum(axis=1)
        centre = (np.arange(len(sums)) + 0.5 - 0.5 / count) * count / self.pulses
        phase = np.unwrap(np.angle(sums)) / (2.0 * np.pi)
        powers = centre[:, None] ** np.arange(self.size)
        return coefficients + np.linalg.lstsq(powers, phase, rcond=None)[0]
