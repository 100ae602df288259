"""A learned filter: a recurrent network that corrects the position of a Kalman filter, by what surprises that one.

As in the neural Kalman filter of Greenberg et al. there is a Kalman filter within. The network is a gated recurrent
unit (Cho et al. 2014) with 24 hidden numbers. It sees each scan from the course of the Kalman filter's state, so that
east is as good as north. `learned.train` makes its weights.
"""

from pathlib import Path

import numpy as np

ACCELERATION_MPS2 = 16.0  # that the Kalman filter within allows for
SCALE_M = 30.0  # of a correction
COLUMNS = "range_m", "azimuth_rad", "velocity_mps"
WEIGHTS = Path(__file__).with_name("weights.npz")


class Inner:
    """The Kalman filter within, of n realisations at once: x (n, 4) is its state, P (n, 4, 4) the covariance."""

    def __init__(self, sigma, speed, T):
        """sigma: σ of range, azimuth and radial velocity; speed: σ of the first velocity across the line of sight."""
        (self.along, self.angle, self.radial), self.speed = np.square(sigma), speed**2
        q = np.outer([T / 2, 1], [T / 2, 1]) * (ACCELERATION_MPS2 * T) ** 2
        self.F, self.Q, self.x = np.kron([[1, T], [0, 1]], np.eye(2)), np.kron(q, np.eye(2)), None

    def features(self, r, azimuth, v):
        """What the network sees (n, 9) of a scan: along the course and to its right the innovation, the change of the
        velocity and the line of sight; of the radial velocity the innovation, σ across, the speed."""
        sight = np.stack([np.sin(azimuth), np.cos(azimuth)], axis=1)
        aside, across, begins = right_of(sight), self.angle * r**2, self.x is None
        if begins:
            before = self.x = np.concatenate([r[:, None] * sight, v[:, None] * sight], axis=1)
            u, w = (one[:, :, None] * one[:, None] for one in (sight, aside))
            self.P = np.zeros((len(r), 4, 4))
            self.P[:, :2, :2] = self.along * u + across[:, None, None] * w
            self.P[:, 2:, 2:] = self.radial * u + self.speed * w
        else:
            before = self.x = self.x @ self.F.T
            self.P, none = self.F @ self.P @ self.F.T + self.Q, np.zeros_like(sight)
            for h, z, R in (
                ((sight, none), r, self.along),
                ((aside, none), 0, across),
                ((none, sight), v, self.radial),
            ):
                self.update(np.concatenate(h, axis=1), z, R)
        radial = v - (sight * before[:, 2:]).sum(1)
        seen = (r[:, None] * sight - before[:, :2]) / 50, (self.x - before)[:, 2:] / 20, sight
        rest = radial / 20, np.sqrt(across) / 40 - 1, np.hypot(*self.x[:, 2:].T) / 30 - 7 / 3
        return np.concatenate([*map(self.to_course, seen), np.stack(rest, axis=1)], axis=1) * (not begins)

    def update(self, h, z, R):
        """By a number z (n,) with rows h (n, 4) and an error of variance R."""
        Ph = np.einsum("nij,nj->ni", self.P, h)
        gain = Ph / ((h * Ph).sum(1) + R)[:, None]
        self.x = self.x + gain * (z - (h * self.x).sum(1))[:, None]
        self.P = self.P - gain[:, :, None] * Ph[:, None]

    def course(self):
        """The direction (n, 2) of the state's velocity."""
        v = self.x[:, 2:]
        return v / (np.hypot(*v.T) + 1e-9)[:, None]

    def to_course(self, vectors):
        """Vectors (n, 2) from east and north to ahead and right."""
        ahead = self.course()
        return np.stack([(vectors * ahead).sum(1), (vectors * right_of(ahead)).sum(1)], axis=1)

    def from_course(self, vectors):
        """Vectors (n, 2) from ahead and right to east and north."""
        ahead = self.course()
        return vectors[:, :1] * ahead + vectors[:, 1:] * right_of(ahead)


def right_of(u):
    """Vectors (n, 2) of east and north a quarter turn to the right."""
    return np.stack([u[:, 1], -u[:, 0]], axis=1)


def unit(weights, h, seen):
    """The hidden numbers (n, H) after a scan; also the parts that a gradient needs."""
    H = h.shape[1]
    a, b = seen @ weights["seen"] + weights["bias"], h @ weights["gates"]
    kept, new = (1 / (1 + np.exp(-one)) for one in np.split(a[:, : 2 * H] + b, 2, axis=1))
    candidate = np.tanh(a[:, 2 * H :] + (kept * h) @ weights["candidate"])
    return h + new * (candidate - h), (kept, new, candidate)


class Network:
    """The learned filter, as a config names it: `python: learned.network:Network`. It estimates x and y alone."""

    def __init__(self, weights=WEIGHTS):
        with np.load(weights) as file:
            self.weights = dict(file)

    def start(self, world):
        keys = world.keys
        sigma = [world.sigma[name] for name in COLUMNS]
        self.inner, self.h = Inner(sigma, keys["target"]["speed_mps"], keys["radar"]["scan_period_s"]), None

    def step(self, plots):
        seen = self.inner.features(*(plots[name] for name in COLUMNS))
        if self.h is None:
            self.h = np.zeros((plots.n, len(self.weights["out"])))
        self.h, _ = unit(self.weights, self.h, seen)
        correction = SCALE_M * (self.h @ self.weights["out"] + self.weights["level"])
        return self.inner.x[:, :2] + self.inner.from_course(correction)
