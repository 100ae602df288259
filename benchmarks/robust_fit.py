"""How often the intervals of robust fits hold the true σ of range, by the share and the size of outliers.

    python benchmarks/robust_fit.py range_doppler --results FITS.csv [--recordings 200] [--shares 0.01] [--sizes 5 100]

Recordings are of the config's own target, in plane of one that flies straight, in one track, with a σ of 60 m in
range_doppler. Each range is an outlier with the stated probability: off by the size, to either side, besides its error.
A size is in σ: 5 is 300 m, 1e5 is 6000 km. Each cell has recordings of its own: the chance of common ones would show in
all. Printed are the intervals that hold σ of range, per cent, those of the other σ together, and how many fits say that
outliers look sound. Fits are kept in a file: a later run goes on where one ended.
"""

import argparse
import itertools
import time
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy.stats import binomtest

from radarsim.api.load_experiments import load_all
from radarsim.errors import ConfigError
from radarsim.recordings import simulate_plots
from radarsim.recordings.fit import fit
from radarsim.recordings.study_part import recording_interface
from radarsim.studies.error_law import OUTLIERS

STRAIGHT_FLIGHT = "target={kind: straight, range_m: 60e3, speed_mps: 250, aspect_deg: 150}"  # as the filter's model
RLS2_KEYS = "radar.sigma_range_m=60", "radar.sigma_velocity_mps=1"
CONFIGS = {  # config, overrides, filter
    "range_doppler": ("rls2", RLS2_KEYS, None),
    "range_alone": ("rls2", RLS2_KEYS, "r"),
    "sonar": ("sonar_smoothing", (), None),
    "multimodel": ("multimodel_1hz", (), None),
    "ambiguous_doppler": ("ambiguous_rls2", (), None),
    "plane": ("plane", (STRAIGHT_FLIGHT,), "EKF+Vr"),
}
SHARES = 0.001, 0.01, 0.1
SIZES = 3.0, 10.0, 100.0, 1e5


class Outcome(NamedTuple):
    """A fit: whether it was refused; how many intervals of the σ of range and of the others hold, of how many; whether
    it says that outliers look sound; its time."""

    refused: int
    range_held: int
    ranges: int
    others_held: int
    others: int
    warned: int
    cpu_s: float


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", nargs="?", choices=list(CONFIGS), default="range_doppler")
    parser.add_argument("--rows", type=int, default=120)
    parser.add_argument("--recordings", type=int, default=200)
    parser.add_argument("--shares", type=float, nargs="+", default=SHARES)
    parser.add_argument("--sizes", type=float, nargs="+", default=SIZES)
    parser.add_argument("--results", type=Path, required=True, help="file of fits, to which a later run adds")
    options = parser.parse_args()
    config, overrides, filter_name = CONFIGS[options.study]
    (experiment,) = load_all([config], (f"scans={options.rows}", *overrides))
    cells = [(0.0, 0.0), *((share, size) for share in options.shares for size in options.sizes)]
    results = read_results(options.results, options.study, options.rows)
    # One recording of each cell after the other: wherever a run ends, the cells have as many.
    for index, (cell, (share, size)) in itertools.product(range(options.recordings), enumerate(cells)):
        if (share, size, index) not in results:
            outcome = fit_once(experiment, filter_name, 1000 * cell + index, share, size)
            results[share, size, index] = outcome
            with options.results.open("a") as file:
                print(options.study, options.rows, share, size, index, *outcome, sep=",", file=file)
    print_table(options.study, options.rows, results)


def read_results(path: Path, study: str, rows: int) -> dict[tuple[float, float, int], Outcome]:
    """The fits of a study that a file has, by share and size of outliers and number of the recording."""
    results = {}
    for line in path.read_text().splitlines() if path.exists() else []:
        name, row_count, share, size, index, *outcome = line.split(",")
        if (name, int(row_count)) == (study, rows):
            results[float(share), float(size), int(index)] = Outcome(*map(int, outcome[:-1]), float(outcome[-1]))
    return results


def fit_once(experiment, filter_name: str | None, number: int, share: float, size: float) -> Outcome:
    """The fit of a recording."""
    started, case = time.process_time(), experiment.cases[0]
    likelihood = recording_interface(case).likelihood(case, filter_name, [recording(experiment, number, share, size)])
    try:
        fitted = fit.fit_likelihood(likelihood, None, [OUTLIERS])
    except ConfigError:
        return Outcome(1, 0, 0, 0, 0, 0, time.process_time() - started)
    sigmas = [key for key in fitted.keys if "sigma_" in key.key and "acceleration" not in key.key]
    held = {of_range: [key.lo <= key.stated <= key.hi for key in sigmas if ("sigma_range" in key.key) == of_range]
            for of_range in (True, False)}  # fmt: skip
    counts = [count for part in held.values() for count in (sum(part), len(part))]
    return Outcome(0, *counts, int(fitted.has_overlap), time.process_time() - started)


def print_table(study: str, rows: int, results: Mapping[tuple[float, float, int], Outcome]) -> None:
    """The cells, each with its number of recordings."""
    print(f"{study}, {rows} rows")
    print("outliers, %  size, σ    n  range, % [95 %]      other σ, % [95 %]    warned, %  refused  CPU s a fit")
    for share, size in sorted({key[:2] for key in results}):
        outcomes = [outcome for key, outcome in results.items() if key[:2] == (share, size)]
        n, total = len(outcomes), Outcome(*map(sum, zip(*outcomes, strict=True)))
        coverage = [percent(total.range_held, total.ranges), percent(total.others_held, total.others)]
        warned, seconds = 100 * total.warned / max(n - total.refused, 1), total.cpu_s / n
        print(f"{100 * share:11g}  {size:7g}  {n:3d}  {coverage[0]:19}  {coverage[1]:19}  {warned:9.1f}  "
              f"{total.refused:7d}  {seconds:11.2f}")  # fmt: skip


def percent(count: int, n: int) -> str:
    """A share with its interval (Wilson)."""
    if not n:
        return "-"
    interval = binomtest(count, n).proportion_ci(method="wilson")
    return f"{100 * count / n:.1f} [{100 * interval.low:.1f}, {100 * interval.high:.1f}]"


def recording(experiment, number: int, share: float, size: float) -> dict[str, np.ndarray]:
    """The plots of a realisation, with outliers among its ranges."""
    columns = simulate_plots.simulate_realisation(experiment, number)
    rng, count = np.random.default_rng([number, 50]), len(columns["t_s"])
    is_off, sides = rng.random(count) < share, rng.choice([-1.0, 1.0], count)
    sigma = experiment.cases[0].spec
    sigma = getattr(sigma, "radar", None) or sigma.sensor
    ranges = columns["range_m"] + is_off * sides * size * sigma.sigma_range_m
    return {name: column for name, column in columns.items() if not name.startswith("true_")} | {"range_m": ranges}


if __name__ == "__main__":
    main()
