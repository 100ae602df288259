"""Speed of a study that is written as the step of one realisation: python benchmarks/stepwise.py [--pairs 7]

Beside the package of examples/bearings, installed (`pip install ./examples/bearings`).
Filter-realisation-scans a second of one thread, by CPU time: each filter of examples/bearings alone over given plots,
then whole blocks (truth, plots, filters, sums) of it and of two studies with kernels of their own, and the extended
Kalman filter in plain loops of Numba over the same plots, one realisation after the other.
"""

import argparse
import time

import numpy as np
from numba import njit

from radarsim.api.configs import load
from radarsim.kernels.compiler import aligned_zeros
from radarsim.kernels.lanes import WIDTH
from radarsim.studies import registry

GROUPS = 64


@njit(error_model="numpy", fastmath={"contract", "arcp", "nsz", "nnan", "ninf"}, nogil=True)
def plain(z, own, dt, sigma, ranges, spread, velocity, found):
    """The extended Kalman filter of z (K, N) in loops; found (K, N) gets the range."""
    F = np.eye(4)
    F[0, 2] = F[1, 3] = dt
    x, old, P, M, h, g = np.empty(4), np.empty(4), np.empty((4, 4)), np.empty((4, 4)), np.zeros(4), np.empty(4)
    for i in range(z.shape[1]):
        s, o = np.sin(z[0, i]), np.cos(z[0, i])
        along, across = spread * spread, (ranges * sigma) ** 2
        x[:] = 0.0
        x[0], x[1], x[2], x[3] = ranges * s, ranges * o, -own[0, 2], -own[0, 3]
        P[:] = 0.0
        P[0, 0], P[1, 1] = along * s * s + across * o * o, along * o * o + across * s * s
        P[0, 1] = P[1, 0] = (along - across) * s * o
        P[2, 2] = P[3, 3] = velocity * velocity
        found[0, i] = np.sqrt(x[0] * x[0] + x[1] * x[1])
        for k in range(1, z.shape[0]):
            for a in range(4):
                old[a] = x[a] + own[k - 1, a]
            for a in range(4):
                x[a] = -own[k, a]
                for b in range(4):
                    x[a] += F[a, b] * old[b]
                    M[a, b] = 0.0
                    for c in range(4):
                        M[a, b] += F[a, c] * P[c, b]
            for a in range(4):
                for b in range(4):
                    P[a, b] = 0.0
                    for c in range(4):
                        P[a, b] += M[a, c] * F[b, c]
            square = x[0] * x[0] + x[1] * x[1]
            h[0], h[1] = x[1] / square, -x[0] / square
            e = z[k, i] - np.arctan2(x[0], x[1])
            e -= 2 * np.pi * np.rint(e / (2 * np.pi))
            S = sigma * sigma
            for a in range(4):
                g[a] = P[a, 0] * h[0] + P[a, 1] * h[1]
            S += h[0] * g[0] + h[1] * g[1]
            for a in range(4):
                x[a] += g[a] / S * e
                for b in range(4):
                    P[a, b] -= g[a] * g[b] / S
            found[k, i] = np.sqrt(x[0] * x[0] + x[1] * x[1])


def cpu(action, *arguments) -> float:
    started = time.process_time()
    action(*arguments)
    return time.process_time() - started


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=7)
    pairs = parser.parse_args().pairs
    case = load("bearings").cases[0]
    study = registry.study("bearings")
    plan = study.prepare(case)
    scans, components, (_, rows, normals) = plan.axes.k.size, 3, plan.shape
    many = GROUPS * WIDTH
    work, plots = aligned_zeros(400), aligned_zeros(GROUPS * scans * rows * WIDTH)
    a, b, u = (aligned_zeros(n * WIDTH) for n in (16 * normals, 16 * normals, 2))
    seen = plan.known_quantities, plan.width
    plan.draw(plan.keys, 0, GROUPS, *seen, plan.numbers, 1.0, work, a, b, u, plots)
    drawn = plots.reshape(GROUPS, scans, rows, WIDTH)
    z, true = (np.ascontiguousarray(drawn[:, :, n].transpose(1, 0, 2).reshape(scans, many)) for n in (1, 2))
    own = np.ascontiguousarray(plan.known_quantities.reshape(scans, -1)[:, 1:5])
    target, found = case.spec.target, np.zeros((scans, many))
    numbers = case.spec.observer.sigma_bearing_rad, target.range_m, target.sigma_range_m, target.sigma_velocity_mps
    loops = lambda: plain(z, own, case.spec.observer.scan_period_s, *numbers, found)  # noqa: E731
    errors = aligned_zeros(GROUPS * scans * components * WIDTH)
    sums = {name: np.zeros(shape) for name, shape in plan.layout.shapes.items()}

    def eights(f):
        of = (sums[name][f] for name in ("error", "paired", "believed", "nees"))
        plan.filters[f].kernel(GROUPS, many, *seen, plan.filters[f].numbers, plots, work, errors, errors, *of)

    loops(), eights(0)
    e = errors.reshape(GROUPS, scans, components, WIDTH)[:, :, 0].transpose(1, 0, 2).reshape(scans, many)
    print(f"loops and eights differ by {np.abs((e + true) / found - 1).max():.1g} of the range")
    for f, name in enumerate(plan.axes.filters):
        eights(f)
        ratios, best = [], np.inf
        for _ in range(pairs):
            slow, fast = cpu(loops), min(cpu(eights, f) for _ in range(5))
            ratios, best = [*ratios, slow / fast], min(best, fast)
        times = np.median(ratios)
        print(f"{name:15} {many * scans / best:.3g} a second; the Cartesian filter's loops {times:.1f} times as long")
    for name in ("bearings", "multimodel_1hz", "ambiguous_rls2"):
        one = load(name).cases[0]
        of = registry.study(one.study)
        made = of.prepare(one)
        of.simulate(made, 0, 8)
        best = min(cpu(of.simulate, made, 0, made.block) for _ in range(pairs))
        steps = len(made.world.truth) if name == "multimodel_1hz" else made.axes.k.size
        print(f"{name:15} {made.block * steps * len(made.axes.filters) / best:.3g} a second, whole blocks")


if __name__ == "__main__":
    main()
