"""Bursts a second of one core in pulses_to_tracks, by estimator: CPU time, in which other work counts little.

python benchmarks/pulses.py [-n 4096] [--repeats 3] [KEY=VALUE …]
"""

import argparse
import statistics
import time

from radarsim.api.configs import load
from radarsim.studies.registry import study


def bursts_per_second(overrides: list[str], name: str, n: int, repeats: int) -> float:
    """The median over repeats of a filter alone, on n realisations of `pulses`."""
    case = load("pulses", overrides).cases[0]
    (one,) = (one for one in case.spec.filters if one.name == name)
    spec = case.spec.model_copy(update={"filters": (one,), "baseline": None})
    of = study("pulses_to_tracks")
    plan = of.prepare(case.__class__(**{**vars(case), "spec": spec}))
    of.simulate(plan, 0, plan.block)  # compiled
    rates = []
    for _ in range(repeats):
        began = time.process_time()
        for first in range(0, n, plan.block):
            of.simulate(plan, first, plan.block)
        rates.append(n * spec.scans / (time.process_time() - began))
    return statistics.median(rates)


def main() -> None:
    """A line for each estimator."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("-n", type=int, default=4096)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("overrides", nargs="*")
    given = parser.parse_args()
    for name in ("ideal", "sequence", "cured", "spectrum", "cured, mixture"):
        rate = bursts_per_second(given.overrides, name, given.n, given.repeats)
        print(f"{name:16s} {rate:12,.0f} bursts/s a core")


if __name__ == "__main__":
    main()
