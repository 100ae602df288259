"""Speed of a study by its matrices against rls2's kernel: python benchmarks/matrices.py [--pairs 9] [--only 3,2]

CPU time of a filter, a realisation and a scan in a pool thread, noise and sums in, in units of `rls2`'s (r+Vr and r,
15 scans, all plots there), by turns.
"""

import argparse
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from radarsim.api.configs import load
from radarsim.config.experiment import Case
from radarsim.config.key_types import Positive, Probability, key
from radarsim.config.model import Model
from radarsim.config.study_keys import Member
from radarsim.report.quantities import Component
from radarsim.studies import registry
from radarsim.studies.linear import LinearStudy, Motion
from radarsim.studies.onefile import MeasuredColumn

SCANS, BLOCK = 15, 8192
WORK = {  # states, numbers of a plot, process noises, probability of a plot
    "1,1": (1, 1, 1, 1.0),
    "2,1": (2, 1, 1, 1.0),
    "3,2 without process noise": (3, 2, 0, 1.0),
    "3,2 of one noise": (3, 2, 1, 1.0),
    "3,2 of three": (3, 2, 3, 1.0),
    "4,2 of one": (4, 2, 1, 1.0),
    "4,2 of four": (4, 2, 4, 1.0),
    "2,1 missed": (2, 1, 1, 0.7),
    "3,2 missed": (3, 2, 0, 0.7),
    "4,2 missed": (4, 2, 1, 0.7),
}


class Sensor(Model):
    """A sensor."""

    scan_period_s: Positive = key("scan period", "time between two plots, s", 0.5)
    probability: Probability = key("probability of detection", "of a plot, no unit", 1.0)


class Filter(Member):
    """A filter."""

    scale: Positive = key("scale", "of its Q", 1.0)


def case_of(n: int, D: int, noises: int, probability: float) -> tuple[LinearStudy, Case]:
    """A chain of n states, the first D of which are measured."""

    def F(t):
        return np.array([[t ** (j - i) / np.prod(np.arange(1, j - i + 1)) if j >= i else 0.0 for j in range(n)]
                         for i in range(n)])  # fmt: skip

    def Q(t):
        some = np.tril(np.ones((n, n)))[:, :noises] * t
        return some @ some.T

    class Chain(LinearStudy):
        """A chain."""

        name, about, filters, asks = "chain", "A chain.", {"scale": "of Q"}, "How well?"
        components = tuple(Component(f"x{i}", "m") for i in range(min(n, 3)))
        parts, scan_period, detection = {"sensor": Sensor}, "sensor.scan_period_s", "sensor.probability"
        measured = tuple(MeasuredColumn(f"z{d}_m", "m") for d in range(D))

        def motion(self, spec):
            start = np.tril(np.ones((n, n)))[:, : max(noises, 0)]
            return Motion(F, Q, np.ones(n), start @ start.T)

        def plot(self, spec, one, k):
            return np.eye(D, n), np.arange(1.0, D + 1)

        def assumed_motion(self, spec, one):
            made = self.motion(spec)
            return made._replace(Q=lambda t: one.scale * Q(t) + 0.01 * np.eye(n), covariance=np.eye(n))

    Chain.Filter = Filter
    Chain.__init_subclass__()
    study = Chain()
    given = {"sensor": {"probability": probability}, "scans": SCANS}
    filters = [{"name": "a", "scale": 1.0}, {"name": "b", "scale": 2.0}]
    return study, Case("chain", "chain", "chain", study.keys().model_validate(given | {"filters": filters}), (), 1, 1)


def cpu(action) -> float:
    started = time.thread_time()
    action()
    return time.thread_time() - started


def measured(pairs: int, only: str) -> None:
    shipped = load("rls2").cases[0]
    study = registry.study(shipped.study)
    plan = study.prepare(shipped)
    steps = BLOCK * plan.axes.k.size * len(plan.axes.filters)
    base = lambda: study.simulate(plan, 0, BLOCK)  # noqa: E731
    base()
    for name, of in WORK.items():
        if only and not any(name.startswith(one) for one in only.split(";")):
            continue
        own, case = case_of(*of)
        started = time.thread_time()
        made = own.prepare(case)
        own.simulate(made, 0, 8)
        first = time.thread_time() - started
        run = lambda: own.simulate(made, 0, BLOCK)  # noqa: E731, B023
        run()
        ratios, least = [], np.inf
        for _ in range(pairs):
            before, one, after = (min(cpu(what) for _ in range(5)) for what in (base, run, base))
            here = one / (BLOCK * SCANS * 2) / ((before + after) / 2 / steps)
            ratios, least = [*ratios, here], min(least, one)
        ns = least / (BLOCK * SCANS * 2) * 1e9
        print(f"{name:28} {np.median(ratios):5.2f} ({min(ratios):.2f} … {max(ratios):.2f}), {ns:.2f} ns; "
              f"first block {first:.1f} s", flush=True)  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=9)
    parser.add_argument("--only", default="", help="names of work that begin so, between ;")
    asked = parser.parse_args()
    with ThreadPoolExecutor(1) as pool:
        pool.submit(measured, asked.pairs, asked.only).result()


if __name__ == "__main__":
    main()
