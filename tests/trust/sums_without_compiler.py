"""Sums of tiny runs of every kernel, as arrays in a file: `python -m tests.trust.sums_without_compiler OUT.npz`.

With NUMBA_DISABLE_JIT=1 the kernels are plain Python; those on lanes then get arrays of eight floats in place of the
registers (`tests.trust.plain_lanes`), and calculate by the same algebra. The names of the kernels that ran are kept
beside the sums.
"""

import ast
import functools
import importlib
import os
import sys
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np

import radarsim
from radarsim.kernels import compiler

PACKAGE = Path(radarsim.__file__).parent
IS_PLAIN = os.environ.get("NUMBA_DISABLE_JIT") == "1"
DECORATORS = "kernel", "careful_kernel", "summing_kernel", "kernel_part", "careful_part"
# Short chunks: a partial one is calculated whole, which takes its time here.
CHUNK_SIZES = {"CHUNK": 8, "GROUPS": 1, "EIGHTS": 1}
kernels_that_ran: set[str] = set()


def kernels_of_source():
    """All kernels and parts of the package, as `module.function`; one that a function makes has that before it."""
    return {
        f"{module_name(file)}.{name}"
        for file in PACKAGE.rglob("*.py")
        if "template" not in file.parts and "kernels.compiler" in (text := file.read_text())
        for name in decorated_functions(ast.parse(text))
    }


def module_name(file):
    return ".".join(file.relative_to(PACKAGE.parent).with_suffix("").parts)


def decorated_functions(tree, prefix=""):
    """The qualified names of functions that a decorator of the compiler compiles."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.FunctionDef):
            names = {getattr(decorator, "id", getattr(decorator, "attr", "")) for decorator in node.decorator_list}
            if names & set(DECORATORS):
                yield prefix + node.name
            yield from decorated_functions(node, f"{prefix}{node.name}.<locals>.")


def record(argument):
    """A structured array or element of one with its fields as attributes, as compiled code has them."""
    if isinstance(argument, np.void) and not isinstance(argument, np.record):
        return np.array(argument).reshape(1).view(np.recarray)[0]
    if isinstance(argument, np.ndarray) and argument.dtype.names and not isinstance(argument, np.recarray):
        return argument.view(np.recarray)
    if isinstance(argument, tuple) and hasattr(argument, "_fields"):
        return argument._make(map(record, argument))
    return argument


class Records:
    """NumPy whose structured zeros are records."""

    def __getattr__(self, name):
        return getattr(np, name)

    def zeros(self, shape, dtype=float):
        return record(np.zeros(shape, dtype))


def run_plainly(function):
    """The decorator in place of those of the compiler: the function as it is, which notes that it ran."""
    name = f"{function.__module__}.{function.__qualname__}"

    @functools.wraps(function)
    def noting(*arguments):
        kernels_that_ran.add(name)
        return function(*map(record, arguments))

    return noting


def replace_compiler():
    """Put arrays in place of the registers, before any kernel is imported."""
    np.seterr(over="ignore")  # words of random numbers overflow by design
    replace_names(compiler, dict.fromkeys(DECORATORS, run_plainly))
    from radarsim.kernels import lane_programs, lanes
    from tests.trust import plain_lanes

    replace_names(lanes, plain_lanes.LANES)
    replace_names(lane_programs, plain_lanes.LANE_PROGRAMS)
    modules_of_kernels = {name.partition(".<locals>")[0].rpartition(".")[0] for name in kernels_of_source()}
    for name in sorted(modules_of_kernels):
        module = importlib.import_module(name)
        if hasattr(module, "np"):
            module.np = Records()
    for name, module in list(sys.modules.items()):
        if name.startswith("radarsim.") and not {"discriminator", "bursts"} & set(name.split(".")):
            replace_names(module, {name: size for name, size in CHUNK_SIZES.items() if hasattr(module, name)})


def replace_names(module, replacements):
    for name, value in replacements.items():
        getattr(module, name)  # a name that is no longer there is one to replace here
        setattr(module, name, value)


BURST = {"carrier_hz": 10e9, "pulse_period_s": 1e-5, "pulse_length_s": 2e-6, "sampling_period_s": 1e-6, "pulses": 64}
DISCRIMINATOR = {
    "study": "discriminator",
    "burst": BURST | {"amplitude": 1.0, "noise_variance": 0.05},
    "truth": {"phase_rad": 0.7, "doppler_derivatives": [300.0, -2000.0, 0.0, 0.0]},
    "prior": {"spread_over_potential": [2.0, 2.0, 2.0, 2.0, 2.0]},
    "estimators": [
        {"name": "sequence", "schedule": [4e-4, 6.4e-4]},
        {"name": "steps", "schedule": [6.4e-4], "phases": 4, "steps": 3},
        {"name": "cured", "schedule": [4e-4, 6.4e-4], "coherence_step": True, "search_points": 2},
    ],
    "realisations": 10,
}
COMPLEX = {"burst": DISCRIMINATOR["burst"] | {"samples": "complex"}}
SHIFTED = {"estimators": [{"name": "a", "schedule": [6.4e-4], "steps": 4}], "rare": {"estimator": "a"}}
ESTIMATED = {"estimators": [{"name": "estimated", "schedule": [6.4e-4], "amplitude": "estimated"}]}
RIVAL = {"estimators": [{"name": "ridge", "method": "ridge"}]}
RIVAL["burst"] = COMPLEX["burst"] | {"pulse_length_s": 1e-6, "pulses": 1024}

# Angles as rough as ranges: the plots' covariance is of a condition near 50 and not 3·10⁶, which multiplies rounding.
EVEN = ["sensor.sigma_range_m=2500", "sensor.sigma_elevation_deg=2", "sensor.sigma_azimuth_deg=2"]
SHORT = ["scans=9", "report_every=3", *EVEN]
SWEPT = [word if "elevation" not in word else "sweep.sensor.sigma_elevation_deg=[2]" for word in SHORT]
NEAR = "target={kind: polynomial, frame: polar, range_m: [900, -4], bearing_deg: [2, 0.01]}"
DETECTORS = "{name: a, plots: 4, false_alarm_probability: [0.1]}, {name: b, plots: 4, test_every: 4, threshold_k: [2]}"
HELD = ["scans=9", "target.x_m=900", "uses.at_s=[35]"]  # near: ranges beside their σ
MANOEUVRE = [*HELD, "sweep.target.acceleration_mps2=[0.2]", f"detectors=[{DETECTORS}]"]
MISSES = ["scans=9", "radar.detection_probability=0.7", "radar.sigma_bias_range_m=20"]
FEW = "filters=[{name: H 3, doppler: folded, manoeuvre_variance: 1e-3, hypotheses: 3}]"
PULSES = "filters.5={name: a, observes: [range, velocity, acceleration], manoeuvre_variance: 1, use: mixture}"
CLOSE = "prior.sigma_velocity_mps=20"
LOCKS = "[range, velocity, acceleration], manoeuvre_variance: 1, estimator: spectrum, use: mixture, hypotheses: 9"
ORDERS = "orders: [1, 2], manoeuvre_variance: [100, 1e-3], combine: likelihood"
TOGETHER = f"filters=[{{name: few, doppler: folded, hypotheses: 12, {ORDERS}}}]"
REMAINDER = "{name: remainder, doppler: remainder, manoeuvre_variance: 1e-3}"
FLIGHT = (
    "{kind: fly_by, distance_m: 2e4, speed_mps: 300, start_range_m: 5e4, sigma_position_m: 2e3, sigma_velocity_mps: 9}"
)
RARE = "rare={filter: H 3}"
# What is run: name → config, overrides, realisations; of several cases the last.
RUNS = {
    "linear": ("rls2", ["scans=9"], 11),
    "linear with misses": ("rls2", MISSES, 11),
    "linear, drawn flight": ("rls2", ["scans=4", f"target={FLIGHT}"], 11),
    "folds": ("ambiguous_depth", ["scans=4", FEW], 8),
    "folds shifted": ("ambiguous_rare", ["scans=3", "sweep.radar.repetition_rate_hz=[4000]", FEW, RARE], 8),
    "folds missed": ("ambiguous_missed", ["scans=5"], 8),
    "orders": ("orders", ["scans=6"], 8),
    "pulses": ("pulses", ["scans=3"], 8),
    "pulses fixed": ("pulses_forecast", ["scans=2", PULSES], 8),
    "pulses folds": ("pulses_folds", ["scans=2", f"filters=[{{name: a, observes: {LOCKS}}}]", CLOSE], 8),
    "folds and orders": ("ambiguous_orders", ["scans=4", "target.start_s=5", TOGETHER], 8),
    "remainders": ("ambiguous_turns", ["scans=4", f"filters=[{REMAINDER}]"], 8),
    "sonar alike": ("sonar_smoothing", ["scans=9"], 9),
    "sonar correlated": ("sonar_correlated", ["scans=9"], 9),
    "sonar missed": ("sonar_missed", ["scans=12", "sweep.sensor.detection_probability=[0.7]", NEAR], 9),
    "sonar converted": ("sonar_conversion", ["scans=6"], 9),
    "sonar fluctuating": ("sonar_fluctuating", ["scans=7", "sweep.target=[sonar_fluctuating]"], 9),
    "sonar manoeuvre": ("sonar_manoeuvre", MANOEUVRE, 9),
    "sonar clutter": ("sonar_clutter", ["scans=8", "sweep.sensor.false_plots_per_km2=[0.3]"], 9),
    "sonar rare false tracks": ("sonar_clutter_rare", ["scans=8", "sweep.sensor.false_plots_per_km2=[0.1]"], 20),
    "sonar rare ends": ("sonar_clutter_ends", ["scans=14", "sweep.sensor.false_plots_per_km2=[0.1]"], 20),
    "multimodel families": ("multimodel_families", SHORT, 8),
    "multimodel irregular": ("multimodel_irregular", SHORT, 8),
    "multimodel at prediction": ("multimodel_covariance", SWEPT, 8),
    "plane": ("plane", ["scans=6"], 9),
    "plane clutter": ("plane_clutter", ["scans=14", "sweep.radar.false_plots_per_km2=[0.3]"], 9),
    "discriminator on block sums": (DISCRIMINATOR | {"engine": "block_sums"}, [], 8),
    "discriminator shifted": (DISCRIMINATOR | SHIFTED | {"engine": "block_sums"}, [], 8),
    "discriminator demodulated": (DISCRIMINATOR | {"engine": "demodulated"}, [], 2),
    "discriminator on samples": (DISCRIMINATOR | {"engine": "samples"}, [], 2),
    "discriminator complex": (DISCRIMINATOR | COMPLEX | ESTIMATED | {"engine": "samples"}, [], 2),
    "discriminator ridge": (DISCRIMINATOR | RIVAL | {"engine": "samples"}, [], 2),
    "discriminator complex demodulated": (DISCRIMINATOR | COMPLEX | {"engine": "demodulated"}, [], 2),
}
# Runs whose realisations' errors are taken too: scans.
ERRORS = {"linear with misses": 4, "sonar alike": 4, "sonar missed": 12, "multimodel irregular": 6}


def random_numbers():
    """Random numbers of every kind."""
    from radarsim.kernels import random

    key, arrays = random.stream(3, "plain"), {}
    for fill, size in ((random.fill_normal_pairs, 5), (random.fill_uniform_pairs, 5), (random.fill_normal_strip, 16)):
        a, b = np.empty(size), np.empty(size)
        fill(key, 10, 2, a, b)
        arrays[fill.__name__] = np.stack([a, b])
    for fill in (random.fill_normal_rows, random.fill_uniform_rows):
        arrays[fill.__name__] = np.empty((2, 7))
        fill(key, np.arange(2, dtype=np.uint64), np.array([3, 4], np.uint64), arrays[fill.__name__])
    return arrays


class Work:
    """A case as its study computes it: the engine itself refuses to run without a compiler."""

    def __init__(self, case):
        from radarsim.studies.registry import study

        self.case, self.study = case, study(case.study)
        self.plan = self.study.prepare(case)

    def simulate(self, first, count):
        return self.study.simulate(self.plan, first, count)


def work(config, overrides):
    """The last case of a config; a search for rare losses takes one turn, a window few blocks, each is cured."""
    from radarsim.api.configs import load
    from radarsim.studies.discriminator import nearest_loss, study

    few = mock.patch.multiple(
        study,
        BLOCKS_PER_WINDOW=dict.fromkeys(study.BLOCKS_PER_WINDOW, 8),
        IMAGE_BLOCKS_PER_WINDOW=dict.fromkeys(study.BLOCKS_PER_WINDOW, 8),
        SEARCH_MARGIN=0.0,
    )
    with few, mock.patch.object(nearest_loss, "MAX_TURNS", 1):
        return Work(load(config, overrides).cases[-1])


def sums(config, overrides, count, errors=False):
    """Sums by name, from realisation 8 on; with `errors` the realisations' own in their place."""
    one = work(config, overrides)
    if errors:
        found = one.study.errors(one.plan, 8, count).swapaxes(0, 1)
        return {"each": np.where(one.plan.axes.available & np.isfinite(found), found, 0.0)}
    return one.plan.layout.unpack(one.simulate(8, count))


def bursts(config, overrides, count):
    """Errors over the potential σ of each burst, (realisation, estimator, window, component), and what they are to.

    Their sums are of bursts that lock and others: see `burst_sums`.
    """
    from radarsim.studies.discriminator import importance_sampling, study

    plan = work(config, overrides).plan
    size = plan.layout.shapes["error"][2]
    arrays = {}
    if plan.mixture is None:
        errors, arrays["passes"] = study.estimate(plan, 8, count)
    else:
        errors, arrays["passes"], arrays["weights"], _ = importance_sampling.weighted_estimates(plan, 8, count)
    arrays["bursts"] = errors[..., :size] / plan.potential[..., :size]
    arrays["condition"] = burst_condition(plan)
    return arrays


def burst_condition(plan):
    """How much a relative error of the samples is multiplied in estimates over their potential σ, (F, K, C).

    A step adds (Φ + P)⁻¹ g: g, the gradient in turns, is a sum over the window whose terms have the size 2π A²/σ² each.
    A search that has converged forgets with what rounding it came there, so that the last step counts. Block sums are
    drawn by the root of their covariance: of one that is nearly singular, the least pivot being r² of its variance,
    the root is off by 1/2r as much, and the errors, of one σ together, are sums over √n σ of normals.
    """
    from radarsim.bursts.kernels import signal

    physics, size = plan.world.physics, plan.layout.shapes["error"][2]
    noise = 0.0
    if physics["mode"] == signal.BLOCK_SUMS:
        root = np.zeros((len(plan.world.factor), 4, 4))
        root[:, *np.tril_indices(4)] = plan.world.factor
        pivots = np.diagonal(root, axis1=1, axis2=2) / np.linalg.norm(root, axis=2)
        noise = np.sqrt(pivots.size) / (2 * pivots[pivots > 0].min())
    term = 2 * np.pi * float(physics["amplitude"]) ** 2 / float(physics["sigma"]) ** 2
    condition = np.zeros(plan.potential[..., :size].shape)
    for f, options in enumerate(plan.options):
        for k, window in enumerate(plan.windows[f, : options["windows"]]):
            root = window["root"][:size, :size]
            gradient = term * window["pulses"] * physics["samples_per_pulse"]
            step = gradient * np.abs(root.T @ root).sum(axis=1) / window["powers"][:size]
            condition[f, k] = step / plan.potential[f, k, :size] + noise
    return condition


def burst_sums():
    """Sums over bursts whose errors are given: locked or not, no search has its end in them."""
    from radarsim.studies.discriminator.kernels import sums as kernels_sums

    plan = work(*RUNS["discriminator on block sums"][:2]).plan
    draw = np.random.default_rng(5)
    errors = plan.potential * draw.standard_normal((40, *plan.potential.shape)) * draw.choice([1, 3], (40, 1, 1, 1))
    weights = draw.uniform(0.1, 2, len(errors))
    arrays = {name: np.zeros(plan.layout.shapes[name]) for name in kernels_sums.Sums._fields}
    losses = np.zeros((*plan.potential.shape[:2], len(kernels_sums.LOCKS), 4))
    kernels_sums.accumulate(errors, plan.options, plan.potential, plan.posterior, kernels_sums.Sums(**arrays))
    kernels_sums.accumulate_losses(errors, plan.options, plan.potential, plan.posterior, weights, losses)
    return arrays | {"losses": losses}


def tracks():
    """Plots that are drawn by themselves, and estimates over recorded ones."""
    from radarsim.kernels import second_order
    from radarsim.studies.ambiguous_doppler.kernels import realisations
    from radarsim.studies.ambiguous_doppler.recorded_plots import FoldedRecordedPlots
    from radarsim.studies.multimodel import study as multimodel
    from radarsim.studies.multimodel import tracking as multimodel_tracking
    from radarsim.studies.range_doppler import tracking as range_doppler_tracking
    from radarsim.studies.range_doppler.recorded_plots import RangeDopplerRecordedPlots
    from radarsim.studies.sonar.clutter import tracking as clutter_tracking

    made = {}
    plan = work(*RUNS["linear"][:2]).plan
    plots = second_order.simulate_plots(plan.problem, 7, 3)
    made["linear plots"] = plots
    made["linear estimates"] = np.nan_to_num(second_order.estimate(plan.problem, plots))
    one = work(*RUNS["linear"][:2])
    tracker = range_doppler_tracking.Tracker(one.case)
    recorded = RangeDopplerRecordedPlots().simulated(one.case, 3)
    made["linear track"] = np.nan_to_num(tracker.feed(recorded).estimate)
    missed = RangeDopplerRecordedPlots().simulated(work(*RUNS["linear with misses"][:2]).case, 3)
    made["plots with misses"] = np.nan_to_num(np.stack([missed["range_m"], missed["true_r_m"]]))
    one = work(*RUNS["folds missed"][:2])
    folded = FoldedRecordedPlots().simulated(one.case, 3)
    made["folded plots"] = np.nan_to_num(folded["velocity_mps"])
    made["folds of one"] = np.nan_to_num(realisations.simulate_hypotheses(one.plan.world, one.plan.banks, 0)[1])
    one = work(*RUNS["multimodel families"][:2])
    z, R, _ = multimodel.simulate_plots(one.plan, 0)
    made["multimodel plots"], made["multimodel covariances"] = z, R
    made["multimodel drawn"] = np.stack(list(multimodel_tracking.drawing(one.case)(0, 3).columns.values()))
    r = np.linalg.norm(z[:, :, 0], axis=1)
    angles = np.arcsin(z[:, 1, 0] / r), np.arcsin(z[:, 2, 0] / r)
    columns = (0.5 * np.arange(len(r)), r, *angles)
    recorded = dict(zip(("t_s", "range_m", "elevation_rad", "azimuth_rad"), columns, strict=True))
    track = multimodel_tracking.track(one.case, recorded)
    made["multimodel track"] = np.nan_to_num(track.estimate)
    one = work(*RUNS["sonar clutter"][:2])
    recorded = clutter_tracking.simulated_plots(one.case)(3, 1).rows(0)
    made["clutter plots"] = np.stack([np.nan_to_num(recorded[name]) for name in ("t_s", "range_m", "bearing_rad")])
    measured = {name: recorded[name] for name in ("t_s", "range_m", "bearing_rad")}
    made["clutter track"] = np.nan_to_num(clutter_tracking.Tracker(one.case).feed(measured).estimate)
    return made


def likelihoods():
    """Likelihoods of recorded plots under every filter that has one, of the stated errors and of other laws."""
    from radarsim.studies.error_law import BIAS, MANOEUVRES, OUTLIERS, ErrorLaw
    from radarsim.studies.registry import study

    arrays = {}
    for run in ("linear", "folds missed", "multimodel families", "plane"):
        config, overrides, _ = RUNS[run]
        case = work(config, [*overrides, "scans=9"]).case
        interface = study(case.study).recording_interface()
        recorded = interface.simulated(case, 3)
        names = next(names for names in interface.columns(case.spec) if recorded.keys() >= set(names))
        for options in case.spec.filters:
            if likelihood := interface.likelihood(case, options.name, [{name: recorded[name] for name in names}]):
                explained = likelihood.explains
                law = ErrorLaw(
                    0.1 * (OUTLIERS in explained), 0.5 * (BIAS in explained), 0, 0.1 * (MANOEUVRES in explained)
                )
                values = [likelihood(likelihood.stated), likelihood(likelihood.stated, law)]
                arrays[f"{run} {options.name}"] = np.array(values)
    return arrays


def alike():
    """Exact means over patterns of plots, of which the alike are merged, or all are followed to the end."""
    from radarsim.kernels.kalman_algebra import pack
    from radarsim.physics.motion import process_noise
    from radarsim.studies.range_doppler import missed_plot_patterns
    from radarsim.studies.range_doppler.error_recursion import Plots

    truth, dt = work(*RUNS["linear with misses"][:2]).plan.problem.truth, 5.0
    plots = Plots(np.array([25.0, 5.0]), np.zeros(2), np.array([10.0, 0.0]), 0.7)
    design = missed_plot_patterns.Design(2, 2, pack(process_noise("white_jerk", 1.0, dt)))
    made = {"merged": missed_plot_patterns.mixture(design, plots, truth, dt, 32)}
    made["in pieces"] = missed_plot_patterns.mixture(design, plots, truth[:9], dt, 16, follow_all=True)
    names = "moment", "bias", "believed", "nees"
    return {f"{how} {name}": np.nan_to_num(getattr(one, name)) for how, one in made.items() for name in names}


def matrices():
    """Sums of studies by their matrices, of filters right and wrong, with gains of their own and without."""
    from tests.studies.test_linear import case_of, study_of

    filters = [{"name": "right"}, {"name": "half", "gain": "half"}, {"name": "wrong", "wrong": "H"}]
    made = {}
    for n, D, probability in ((2, 1, 1.0), (3, 2, 1.0), (3, 2, 0.7), (4, 1, 0.7)):
        study = study_of(n, D)
        case = case_of(study, filters, 5, probability=probability)
        plan = study.prepare(case)
        sums = plan.layout.unpack(study.simulate(plan, 8, 9))
        recorded = study.recording_interface().simulated(case, 3)
        sums["plots"] = np.nan_to_num(np.stack(list(recorded.values())))
        sums["track"] = study.tracker(case).feed(recorded).estimate
        made |= {f"{n} states, {D} numbers, {probability}/{name}": array for name, array in sums.items()}
    return made


def given():
    """Sums of a filter of a package, whose gains are given, beside one whose covariance is each realisation's own."""
    from radarsim.physics.motion import process_noise
    from radarsim.studies.range_doppler import study
    from radarsim.studies.range_doppler.package_filters import GivenGains

    class Own(GivenGains):
        """The Kalman filter's gains, given."""

        def noise(self, dt_s):
            return process_noise("random_jerk", 1e-3, dt_s)

        def gains(self, scans):
            return scans.kalman(self.noise)

    case = work("rls2", ["scans=9", "radar.sigma_bias_range_m=20"]).case
    filters = (
        *case.spec.filters,
        Own.model_construct(**case.spec.filters[-1].model_dump() | {"name": "given", "kind": "given"}),
    )
    plan = study.prepare(replace(case, spec=case.spec.model_copy(update={"filters": filters})))
    return plan.layout.unpack(study.simulate(plan, 8, 11))


def numbers():
    """All arrays: {run/name: array}."""
    made = {f"random/{name}": array for name, array in random_numbers().items()}
    made |= {f"tracks/{name}": array for name, array in tracks().items()}
    made |= {f"likelihoods/{name}": array for name, array in likelihoods().items()}
    made |= {f"patterns/{name}": array for name, array in alike().items()}
    made |= {f"matrices of {name}": array for name, array in matrices().items()}
    made |= {f"given gains/{name}": array for name, array in given().items()}
    made |= {f"discriminator sums/{name}": array for name, array in burst_sums().items()}
    for run, scans in ERRORS.items():
        config, overrides, _ = RUNS[run]
        made |= {f"{run}/{name}": v for name, v in sums(config, [*overrides, f"scans={scans}"], 1, errors=True).items()}
    for run, arguments in RUNS.items():
        calculate = bursts if run.startswith("discriminator") else sums
        made |= {f"{run}/{name}": array for name, array in calculate(*arguments).items()}
    return made


if __name__ == "__main__":
    if IS_PLAIN:
        replace_compiler()
    arrays = numbers()
    np.savez(sys.argv[1], **arrays, kernels_that_ran=np.array(sorted(kernels_that_ran)))
