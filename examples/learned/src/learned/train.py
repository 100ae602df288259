"""Learn from data: `python -m learned.train` prints the three σ of the filter `fitted`, and writes weights.npz.

All learn from the same realisations, of another seed than those by which filters are judged.
"""

import sys

import numpy as np
import radarsim
from radarsim.api.configs import load

from learned.network import COLUMNS, SCALE_M, WEIGHTS, Inner, unit

SEED, TRACKS = 2**32 + 1, 20_000  # the seed with which `radarsim tune` searches
HIDDEN, EPOCHS, BATCH, RATE = 24, 30, 250, 5e-3


def drawn(tracks=TRACKS):
    """The plots to learn from, with their truth."""
    return radarsim.plots("learned", n=tracks, overrides=[f"seed={SEED}"])


def fitted(plots):
    """σ of x and of y, of the radial velocity and of the acceleration, as estimated from plots and their truth."""
    x, T = plots.truth, plots.t_s[1] - plots.t_s[0]
    r, azimuth, v = (plots.columns[name] for name in COLUMNS)
    sight = np.stack([np.sin(azimuth), np.cos(azimuth)], axis=-1)
    errors = r[..., None] * sight - x[..., :2], v - (sight * x[..., 2:]).sum(-1), np.diff(x[..., 2:], axis=1) / T
    return tuple(float(np.sqrt(np.mean(one**2))) for one in errors)


def lessons(plots):
    """What the network sees (K, n, 9) of plots, and what it should say (K, n, 2)."""
    spec = load("learned").cases[0].spec
    sigma = spec.radar.sigma_range_m, spec.radar.sigma_azimuth_rad, spec.radar.sigma_velocity_mps
    inner = Inner(sigma, spec.target.speed_mps, spec.radar.scan_period_s)
    seen, wanted = [], []
    for k in range(len(plots.t_s)):
        seen.append(inner.features(*(plots.columns[name][:, k] for name in COLUMNS)))
        wanted.append(inner.to_course(plots.truth[:, k, :2] - inner.x[:, :2]) / SCALE_M)
    return np.array(seen, dtype=np.float32), np.array(wanted, dtype=np.float32)


def untrained(rng, features, hidden=HIDDEN, dtype=np.float32):
    """Weights to begin with."""
    shapes = {"seen": (features, 3 * hidden), "gates": (hidden, 2 * hidden), "candidate": (hidden, hidden)}
    w = {name: rng.normal(size=shape) / np.sqrt(features + hidden) for name, shape in shapes.items()}
    w |= {"bias": np.repeat([0.0, -1.0, 0.0], hidden), "out": 0.1 * rng.normal(size=(hidden, 2)), "level": np.zeros(2)}
    return {name: one.astype(dtype) for name, one in w.items()}


def slope(w, seen, wanted):
    """The mean squared error of what the network says, and its derivatives by the weights, back through time."""
    K, n, _ = seen.shape
    h = [np.zeros((n, len(w["out"])), seen.dtype)]
    parts = []
    for k in range(K):
        after, made = unit(w, h[-1], seen[k])
        h.append(after)
        parts.append(made)
    error = np.array(h[1:]) @ w["out"] + w["level"] - wanted
    by = {name: np.zeros_like(one) for name, one in w.items()}
    e = 2 * error / error.size
    by["level"], by["out"] = e.sum((0, 1)), np.einsum("knh,kno->ho", h[1:], e)
    back = np.zeros_like(h[0])
    for k in range(K - 1, -1, -1):
        before, (kept, new, candidate) = h[k], parts[k]
        back = back + e[k] @ w["out"].T
        inside = back * new * (1 - candidate**2)
        of_kept = inside @ w["candidate"].T
        gates = [of_kept * before * kept * (1 - kept), back * (candidate - before) * new * (1 - new)]
        gates = np.concatenate(gates, axis=1)
        by["candidate"] += (kept * before).T @ inside
        by["gates"] += before.T @ gates
        sums = np.concatenate([gates, inside], axis=1)
        by["bias"] += sums.sum(0)
        by["seen"] += seen[k].T @ sums
        back = back * (1 - new) + of_kept * kept + gates @ w["gates"].T
    return float(np.mean(error**2)), by


def trained(seen, wanted, epochs=EPOCHS, say=lambda _: None):
    """Weights after so many times all tracks, by Adam (Kingma & Ba 2015) with steps that become smaller."""
    rng, n = np.random.default_rng(SEED), seen.shape[1]
    w = untrained(rng, seen.shape[2])
    mean, square = ({name: np.zeros_like(one) for name, one in w.items()} for _ in range(2))
    steps, done = epochs * (n // BATCH), 0
    for epoch in range(epochs):
        losses = []
        for some in rng.permutation(n)[: n // BATCH * BATCH].reshape(-1, BATCH):
            loss, by = slope(w, seen[:, some], wanted[:, some])
            losses.append(loss)
            done += 1
            rate = RATE * (1 + np.cos(np.pi * done / steps)) / 2
            for name, one in by.items():
                mean[name] += 0.1 * (one - mean[name])
                square[name] += 0.001 * (one**2 - square[name])
                usual = np.sqrt(square[name] / (1 - 0.999**done)) + 1e-8
                w[name] -= (rate * mean[name] / (1 - 0.9**done) / usual).astype(w[name].dtype)
        say(f"epoch {epoch + 1} of {epochs}: {SCALE_M * np.sqrt(np.mean(losses)):.2f} m")
    return w


if __name__ == "__main__":
    plots = drawn()
    names = "sigma_position_m", "sigma_velocity_mps", "sigma_acceleration_mps2"
    print("fitted:", *(f"{name}: {one:.2f}" for name, one in zip(names, fitted(plots), strict=True)))
    np.savez(sys.argv[1] if sys.argv[1:] else WEIGHTS, **trained(*lessons(plots), say=print))
