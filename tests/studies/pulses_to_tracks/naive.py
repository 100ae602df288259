"""The chain as a textbook has it: samples of a burst, Fisher scoring over them, Kalman filters with matrices."""

import math

import numpy as np

from radarsim.physics.motion import manoeuvre_covariance, transition


def score(u, variance, x, forecast, precision, size, first, steps=40, tolerance=1e-3):
    """The coefficients x (6,) in turns over the whole burst that complex samples u (N, whole burst of M) make likely.

    u holds the first samples only; M is `forecast` and `precision`'s burst. precision (6,) of the forecast; size of the
    coefficients are estimated; `first`: the phase is put at its best before.
    """
    samples, burst_time = u
    tau = np.arange(len(samples)) / burst_time
    powers = tau[:, None] ** np.arange(6)
    information = (2 * math.pi) ** 2 / variance * (powers[:, :size].T @ powers[:, :size]) + np.diag(precision[:size])
    x = x.copy()

    def residual_signal():
        return samples * np.exp(-2j * math.pi * (powers @ x))

    if first:
        x[0] += np.angle(residual_signal().sum()) / (2 * math.pi)
    for _ in range(steps):
        away = forecast - x
        away[0] -= round(away[0])
        gradient = 2 * math.pi / variance * (powers.T @ residual_signal().imag) + precision * away
        step = np.linalg.solve(information, gradient[:size])
        x[:size] += step
        if gradient[:size] @ step <= tolerance**2:
            break
    return x


def sequence(samples, variance, forecast, precision, size, windows):
    """P4's sequence over windows in pulses from a forecast (6,), then the whole burst without it."""
    x, pulse_count = forecast.copy(), len(samples)
    for n, pulses in enumerate(windows):
        x = score((samples[:pulses], pulse_count), variance, x, forecast, precision, size, n == 0)
    return score((samples, pulse_count), variance, x, forecast, np.zeros(6), size, False)


def spectrum(samples, variance, forecast, size, lines, offset):
    """The highest line of the padded spectrum, then scoring over the whole burst."""
    n = np.arange(len(samples))
    turned = samples * np.exp(-2j * math.pi * (forecast[2] * (n / len(n)) ** 2 + offset * n / lines))
    line = np.argmax(abs(np.fft.fft(turned, lines)))
    x = forecast.copy()
    x[1] = (np.fft.fftfreq(lines, 1 / lines)[line] + offset) * len(n) / lines
    return score((samples, len(n)), variance, x, forecast, np.zeros(6), size, True)


class Track:
    """A Kalman filter of errors: estimate less truth."""

    def __init__(self, sigma_r, noise, designation, prior):
        self.x = np.array([noise, *designation])
        self.P = np.diag([sigma_r**2, prior[0] ** 2, prior[1] ** 2])

    def predict(self, dt, variance, missed):
        """To the next scan; the model misses so much of the target."""
        F = transition(dt)
        self.x = F @ self.x + missed
        self.P = F @ self.P @ F.T + manoeuvre_covariance(variance, dt)

    def updated(self, rows, innovation, variances):
        """State and covariance after numbers (m,), and the innovation's covariance."""
        H = np.eye(3)[rows]
        S = H @ self.P @ H.T + np.diag(variances)
        K = self.P @ H.T @ np.linalg.inv(S)
        return self.x + K @ innovation, (np.eye(3) - K @ H) @ self.P, S

    def take(self, rows, innovation, variances, use="as_measured", **keys):
        """Take numbers as measured, if they are in the gate, or by the probability that they are right."""
        x, P, S = self.updated(rows, innovation, variances)
        distance = innovation @ np.linalg.solve(S, innovation)
        w = 1.0
        if use == "gated":
            w = float(distance <= keys["gate"])
        elif use == "mixture":
            near = keys["lock"] * math.exp(-0.5 * distance) / math.sqrt(np.linalg.det(2 * math.pi * S))
            w = near / (near + (1 - keys["lock"]) * keys["density"])
        d = x - self.x
        self.P = (1 - w) * self.P + w * P + w * (1 - w) * np.outer(d, d)
        self.x = self.x + w * d
