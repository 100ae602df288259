"""From pulses to tracks: the plan of a case, and the sums of a block of realisations."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from radarsim.bursts.burst import Burst
from radarsim.bursts.fisher import energy_ratio
from radarsim.bursts.kernels.scoring import SIZE
from radarsim.bursts.schedule_design import NoSchedule
from radarsim.config.experiment import Case
from radarsim.engine.sums import Layout
from radarsim.errors import ConfigError
from radarsim.kernels.second_order import as_kernel_array
from radarsim.physics.motion import transition
from radarsim.studies.noise import noise_key
from radarsim.studies.pulses_to_tracks import exact_errors, filter_design, scenario
from radarsim.studies.pulses_to_tracks.axes import PulsesAxes
from radarsim.studies.pulses_to_tracks.kernels import block
from radarsim.studies.pulses_to_tracks.kernels import layout as kernels_layout
from radarsim.studies.pulses_to_tracks.window_menu import Menu

COMPONENTS = (("r", "m"), ("Vr", "m/s"), ("ar", "m/s2"))
BLOCK = 512  # some 0.2 s with six filters and 15 scans
STREAMS = ("ranges", "bursts", "prior", "forecasts")
PADDED = 2  # lines of a spectrum for each pulse, at least


@dataclass(frozen=True)
class Plan:
    """The data for simulating a block; see `kernels` for the arrays."""

    layout: Layout
    axes: PulsesAxes
    world: kernels_layout.World
    filters: kernels_layout.Filters
    menus: tuple[Menu | None, ...]
    block: int = BLOCK
    gaussian: bool = False  # an estimate that did not lock is no Gaussian error


def prepare(case: Case) -> Plan:
    """The bursts of a case, the windows of its estimators, and the exact values of its idealisations."""
    spec = case.spec
    t = np.arange(spec.scans) * spec.radar.scan_period_s
    truth = scenario.truth(spec.target, t, case.name)
    bursts = scenario.bursts(spec, truth)
    try:
        design = filter_design.design_filters(spec, bursts)
    except NoSchedule as error:
        raise ConfigError(f"{case.name}: filters: no windows lead from the forecast to the burst: {error}") from None
    defects = scenario.model_defects(truth, spec.radar.scan_period_s)
    return Plan(
        layout=Layout(**kernels_layout.shapes(len(spec.filters), spec.scans)),
        axes=axes(spec, t, bursts, design.arrays, defects),
        world=kernel_world(case, truth, bursts, design, defects),
        filters=design.arrays,
        menus=design.menus,
    )


def kernel_world(
    case: Case, truth: np.ndarray, bursts: list[Burst], design: filter_design.FilterDesign, defects: np.ndarray
) -> kernels_layout.World:
    """The kernels' arrays of the target and its bursts."""
    spec, burst, dt = case.spec, bursts[0], case.spec.radar.scan_period_s
    variances = [scan_burst.noise_variance for scan_burst in bursts]
    laws = {scan_burst.noise_variance: i for i, scan_burst in enumerate(dict.fromkeys(bursts))}
    physics = np.repeat(design.sums.physics.reshape(1), len(bursts))
    physics["sigma"] = np.sqrt(variances)
    per_sigma = design.sums.factor / design.sums.physics["sigma"]
    lines = 1 << math.ceil(math.log2(PADDED * burst.pulses)) if uses_spectrum(spec) else 1
    doppler = 2.0 * truth[:, 1] / burst.wavelength_m * burst.pulse_period_s * lines
    estimate_rows = np.zeros((2, SIZE))
    for c in range(2):
        row = scenario.centre_row(burst, SIZE, c + 1)
        estimate_rows[c] = row * [math.factorial(j) / burst.duration_s**j for j in range(SIZE)]
    return kernels_layout.World(
        keys=as_kernel_array([noise_key(case, stream) for stream in STREAMS], 4, 2, dtype=np.uint64),
        model_defects=as_kernel_array(defects, *defects.shape),
        motion=transition(dt)[np.array([0, 0, 1, 1, 2]), np.array([1, 2, 1, 2, 2])],
        sigma_r=float(spec.radar.sigma_range_m),
        prior=np.array([spec.prior.sigma_velocity_mps, spec.prior.sigma_acceleration_mps2]),
        span=float(spec.span_mps),
        physics=physics,
        noise_law=np.array([laws[variance] for variance in variances]),
        mean=design.sums.sums,
        factor=np.stack([per_sigma * math.sqrt(variance) for variance in laws]),
        tables=design.tables.arrays(),
        to_turns=turns_matrix(burst),
        measured=estimate_rows,
        offset=np.ceil(doppler) - doppler,
        twiddle=transform_factors(lines),
        bit_reversed=bit_reversed_order(lines),
    )


def uses_spectrum(spec: Any) -> bool:
    """Whether any filter estimates by the spectrum."""
    return any(options.estimator == "spectrum" for options in spec.filters)


def turns_matrix(burst: Burst) -> np.ndarray:
    """Matrix (2, 2) from velocity and acceleration at the middle to b₁ and b₂ in turns over the burst."""
    T, centre_s = burst.duration_s, scenario.burst_centre(burst) * burst.duration_s
    return 2.0 / burst.wavelength_m * np.array([[T, -centre_s * T], [0.0, 0.5 * T**2]])


def transform_factors(lines: int) -> np.ndarray:
    """Cosines and sines (lines / 2, 2) of the transform."""
    angle = 2.0 * math.pi * np.arange(max(lines // 2, 1)) / lines
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def bit_reversed_order(lines: int) -> np.ndarray:
    """Numbers (lines,) with their bits reversed."""
    order = np.zeros(1, np.int64)
    while order.size < lines:
        order = np.concatenate([2 * order, 2 * order + 1])
    return order


def axes(
    spec: Any, t: np.ndarray, bursts: list[Burst], arrays: kernels_layout.Filters, defects: np.ndarray
) -> PulsesAxes:
    """Labels, Cramér–Rao bounds, and the exact values where all errors are Gaussian."""
    shape = (len(spec.filters), spec.scans, 3)
    sigma, bias, bound = np.full(shape, np.nan), np.full(shape, np.nan), np.full((*shape[:2], 2), np.nan)
    losses, max_losses = np.zeros(shape), np.zeros(len(spec.filters))
    for f, options in enumerate(spec.filters):
        if not exact_errors.has_exact_errors(options):
            losses[f] = exact_errors.lost_burst_errors(spec, options, arrays.sigma[f])
            max_losses[f] = exact_errors.max_loss_probability(bursts, options)
        if options.takes:
            bound[f, :, : options.takes] = arrays.sigma[f, :, : options.takes]
        if exact_errors.has_exact_errors(options):
            mean, covariance = exact_errors.locked_errors(spec, options, arrays.sigma[f], defects)
            sigma[f], bias[f] = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2) + mean**2), mean
    return PulsesAxes(
        filters=tuple(options.name for options in spec.filters),
        components=COMPONENTS,
        k=np.arange(1, spec.scans + 1),
        t_s=t,
        available=np.ones(shape, dtype=bool),
        baseline=arrays.baseline,
        exact_sigma=sigma,
        exact_bias=bias,
        bound=bound,
        takes=np.array([options.takes for options in spec.filters]),
        energy_db=10.0 * np.log10([energy_ratio(options, options.duration_s) for options in bursts]),
        ideal=arrays.ideals,
        lost_squares=losses,
        max_loss_probability=max_losses,
    )


def simulate(plan: Plan, first: int, count: int) -> np.ndarray:
    """Sums of one block, in the order of the plan's layout."""
    values = np.zeros(plan.layout.size)
    block.simulate_block(plan.world, plan.filters, kernels_layout.Sums(**plan.layout.unpack(values)), first, count)
    return values
