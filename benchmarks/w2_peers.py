"""Workload W2 in other libraries, on the plots of w2.py: a three-model IMM in FilterPy and in JAX.

    python benchmarks/w2_peers.py filterpy|jax [--limit DIR]

Needs an environment of its own with radarsim, filterpy or jax (never this package's): see README.md. Prints how far the
estimates lie from ours, steps a second of both, and their ratio.
"""

import argparse
import json
import os
import sys
import time

os.environ.setdefault("JAX_ENABLE_X64", "1")
os.environ.setdefault("JAX_PLATFORMS", "cpu")

import numpy as np
import w1
import w2

H = np.kron(np.eye(3), [[1.0, 0, 0]])


def motions(dt: float = 0.05) -> tuple[np.ndarray, np.ndarray]:
    """F and Q (3, 9, 9) of the three models."""
    F, Q = np.empty((2, 3, 9, 9))
    for i, (moves, bends, sigma) in enumerate(w2.MODELS[:3]):
        g = np.array([dt**2 / 2, moves * dt, bends])
        F[i] = np.kron(np.eye(3), [[1, moves * dt, bends * dt**2 / 2], [0, moves, bends * dt], [0, 0, bends]])
        Q[i] = np.kron(np.eye(3), sigma**2 * np.outer(g, g))
    return F, Q


def start(given) -> tuple[np.ndarray, np.ndarray]:
    """Means (3, 9) and covariances (3, 9, 9) that the kernel starts from."""
    live = np.array([np.tile([1, 1, bends], 3) for _, bends, _ in w2.MODELS[:3]])
    return given.start * live, given.P0 * live[:, :, None] * live[:, None, :]


def by_filterpy(given, R, scans: int) -> tuple[np.ndarray, int]:
    """Estimates (scans, 9, 1) of the first realisation."""
    from filterpy.kalman import IMMEstimator, KalmanFilter

    (F, Q), (x, P), filters = motions(), start(given), []
    for i in range(3):
        f = KalmanFilter(dim_x=9, dim_z=3)
        f.x, f.P, f.F, f.Q, f.H = x[i].copy(), P[i].copy(), F[i], Q[i], H
        filters.append(f)
    bank, out = IMMEstimator(filters, np.full(3, 1 / 3), w2.T3.T.copy()), np.empty((scans, 9, 1))
    for k in range(scans):
        for f in filters:
            f.R = R[k]
        bank.predict()
        bank.update(given.z[k, :, 0])
        out[k, :, 0] = bank.x.ravel()
    return out, 1


def by_jax(given, R, scans: int) -> tuple[np.ndarray, int]:
    """Estimates (scans, 9, 8) of all realisations, repeated to 256 for the timing."""
    import jax
    import jax.numpy as jnp

    (F, Q), (x, P), T = motions(), start(given), jnp.asarray(w2.T3)

    def step(carry, plot):
        x, P, p = carry
        z, R = plot
        c = T @ p
        w = T * p / c[:, None]
        mean = w @ x
        d = x[None] - mean[:, None]
        mixed = jnp.einsum("ij,jab->iab", w, P) + jnp.einsum("ij,ija,ijb->iab", w, d, d)
        x, P = jnp.einsum("iab,ib->ia", F, mean), F @ mixed @ jnp.swapaxes(F, 1, 2) + Q
        S = H @ P @ H.T + R
        K = jnp.swapaxes(jnp.linalg.solve(S, H @ P), 1, 2)
        v = z - x @ H.T
        P = P - K @ S @ jnp.swapaxes(K, 1, 2)
        q = jnp.einsum("ia,ia->i", v, jnp.linalg.solve(S, v[..., None])[..., 0])
        p = c * jnp.exp((q.min() - q) / 2) / jnp.sqrt(jnp.linalg.det(S))
        x, p = x + jnp.einsum("iab,ib->ia", K, v), p / p.sum()
        return (x, (P + jnp.swapaxes(P, 1, 2)) / 2, p), p @ x

    def one(z):
        return jax.lax.scan(step, (x, P, jnp.full(3, 1 / 3)), (z, R))[1]

    run = jax.jit(jax.vmap(one, in_axes=2, out_axes=2))
    z = jnp.asarray(np.tile(given.z[:scans], (1, 1, 32)))
    by_jax.run = lambda: np.asarray(run(z))
    return by_jax.run()[:, :, : w2.GROUP], z.shape[2]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("peer", choices=("filterpy", "jax"))
    parser.add_argument("--limit", help="folder of the C limit, which holds the workload")
    arguments = parser.parse_args()
    sys.path.insert(0, str(w1.limit_folder(arguments.limit)))
    sys.argv = sys.argv[:1]
    import common

    given, scans = w2.Given(common), 400
    R = common.w2_R()[:scans]
    peer = {"filterpy": by_filterpy, "jax": by_jax}[arguments.peer]
    estimates, count = peer(given, R, scans)
    difference = float(np.abs(estimates - given.run()[:scans, :, : estimates.shape[2]]).max())
    again = getattr(peer, "run", lambda: peer(given, R, scans))
    started = time.process_time()
    again()
    theirs = count * scans / (time.process_time() - started)
    ours = w2.per_step(min(w1.cpu(given.run) for _ in range(5))) * 1e6
    print(
        json.dumps(
            {"peer": arguments.peer, "difference": difference, "steps_s": theirs, "ours": ours, "ratio": ours / theirs}
        )
    )


if __name__ == "__main__":
    main()
