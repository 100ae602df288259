"""How often the intervals of robust fits hold the true σ of range, by the share and the size of outliers.

    python benchmarks/robust_fit.py [range_doppler] [--rows 120] [--recordings 200] [--shares 0.01 0.1] [--sizes 5 100]

Recordings are of the config's own target, in one track, with a σ of 60 m in range_doppler. Each range is an outlier
with the stated probability: off by the size, to either side, besides its error. A size is in σ: 5 is 300 m, 1e5 is
6000 km. Each cell has recordings of its own: the chance of common ones would show in all. Printed are the intervals
that hold σ of range, per cent, those of the other σ together, and how many fits say that outliers look sound.
"""

import argparse
import time

import numpy as np

from radarsim.api.load_experiments import load_all
from radarsim.errors import ConfigError
from radarsim.recordings import simulate_plots
from radarsim.recordings.fit import fit
from radarsim.recordings.study_part import recording_interface
from radarsim.studies.error_law import OUTLIERS

RLS2_KEYS = "radar.sigma_range_m=60", "radar.sigma_velocity_mps=1"
CONFIGS = {  # config, overrides, filter
    "range_doppler": ("rls2", RLS2_KEYS, None),
    "range_alone": ("rls2", RLS2_KEYS, "r"),
    "sonar": ("sonar_smoothing", (), None),
    "multimodel": ("multimodel_1hz", (), None),
    "ambiguous_doppler": ("ambiguous_rls2", (), None),
}
SHARES = 0.001, 0.01, 0.1
SIZES = 3.0, 10.0, 100.0, 1e5


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("study", nargs="?", choices=list(CONFIGS), default="range_doppler")
    parser.add_argument("--rows", type=int, default=120)
    parser.add_argument("--recordings", type=int, default=200)
    parser.add_argument("--shares", type=float, nargs="+", default=SHARES)
    parser.add_argument("--sizes", type=float, nargs="+", default=SIZES)
    options = parser.parse_args()
    config, overrides, filter_name = CONFIGS[options.study]
    (experiment,) = load_all([config], (f"scans={options.rows}", *overrides))
    case = experiment.cases[0]
    print(f"{options.study}, {options.rows} rows, {options.recordings} recordings a cell", flush=True)
    print("share of outliers  size, σ  range, %  other σ, %  warned, %  refused  CPU s a fit", flush=True)
    cells = [(0.0, 0.0), *((share, size) for share in options.shares for size in options.sizes)]
    for cell, (share, size) in enumerate(cells):
        started, results = time.process_time(), []
        for number in range(cell * options.recordings, (cell + 1) * options.recordings):
            likelihood = recording_interface(case).likelihood(
                case, filter_name, [recording(experiment, number, share, size)]
            )
            try:
                results.append(fit.fit_likelihood(likelihood, None, [OUTLIERS]))
            except ConfigError:
                results.append(None)
        seconds = (time.process_time() - started) / options.recordings
        print(f"{share:17g}  {size:7g}  {row(results)}  {seconds:11.2f}", flush=True)


def recording(experiment, number: int, share: float, size: float) -> dict[str, np.ndarray]:
    """The plots of a realisation, with outliers among its ranges."""
    columns = simulate_plots.simulate_realisation(experiment, number)
    rng, count = np.random.default_rng([number, 50]), len(columns["t_s"])
    is_off, sides = rng.random(count) < share, rng.choice([-1.0, 1.0], count)
    sigma = experiment.cases[0].spec
    sigma = getattr(sigma, "radar", None) or sigma.sensor
    ranges = columns["range_m"] + is_off * sides * size * sigma.sigma_range_m
    return {name: column for name, column in columns.items() if not name.startswith("true_")} | {"range_m": ranges}


def row(results) -> str:
    """The counts of a cell, per cent of the fits."""
    fits = [fitted for fitted in results if fitted is not None]
    held = {True: [], False: []}
    for fitted in fits:
        for key in fitted.keys:
            if "sigma_" in key.key and "acceleration" not in key.key:
                held["sigma_range" in key.key].append(key.lo <= key.stated <= key.hi)
    in_range, others = (f"{100 * np.mean(part):.1f}" if part else "-" for part in held.values())
    warned = 100 * np.mean([fitted.has_overlap for fitted in fits]) if fits else 0.0
    return f"{in_range:>8}  {others:>10}  {warned:9.1f}  {len(results) - len(fits):7d}"


if __name__ == "__main__":
    main()
