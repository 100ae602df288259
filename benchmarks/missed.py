"""P1's filters where plots are missed or biased, against the same run with every plot: one core, CPU time.

    python benchmarks/missed.py [--pairs 9] [-n 40960]

The kernels alone: blocks whose sums are thrown away. A ratio is the median over pairs timed one after the other.
"""

import argparse
import statistics
import time

from radarsim.api.case_work import CaseWork
from radarsim.api.configs import load

WORLDS = (
    ("radar.detection_probability=0.9",),
    ("radar.detection_probability=0.5",),
    ("radar.detection_probability=0.9", "scans=30"),
    ("radar.sigma_bias_range_m=30",),
)


def work(*overrides: str) -> CaseWork:
    """RLS 2, prepared."""
    made = CaseWork(load("rls2", overrides).cases[0])
    made.simulate(0, 1)
    return made


def seconds(made: CaseWork, n: int) -> float:
    """CPU seconds of n realisations."""
    started = time.thread_time()
    for first in range(0, n, made.block):
        made.simulate(first, min(made.block, n - first))
    return time.thread_time() - started


def main() -> None:
    """Time all and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=9)
    parser.add_argument("-n", type=int, default=40960)
    given = parser.parse_args()
    for overrides in WORLDS:
        here, plain = work(*overrides), work(*(o for o in overrides if o.startswith("scans")))
        both = [(seconds(plain, given.n), seconds(here, given.n)) for _ in range(given.pairs)]
        own = statistics.median(b for _, b in both) / given.n
        ratio = statistics.median(b / a for a, b in both)
        print(f"{', '.join(overrides):48s} {own * 1e9:6.0f} ns a realisation, {ratio:.2f} of every plot")


if __name__ == "__main__":
    main()
