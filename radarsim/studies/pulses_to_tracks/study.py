"""From pulses to tracks: bursts are drawn, estimated, and taken by the filters that forecast them."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from radarsim.bursts.burst import Burst, NoSchedule, energy_ratio
from radarsim.bursts.kernels.scoring import SIZE
from radarsim.config.experiment import Case
from radarsim.engine.results import Layout
from radarsim.errors import ConfigError
from radarsim.kernels.linear import plain
from radarsim.physics import transition
from radarsim.studies.noise import noise_key
from radarsim.studies.pulses_to_tracks import filters, kernels
from radarsim.studies.pulses_to_tracks.filters import Menu, PulsesAxes

COMPONENTS = (("r", "m"), ("Vr", "m/s"), ("ar", "m/s2"))
BLOCK = 512  # some 0.2 s with six filters and 15 scans
STREAMS = ("ranges", "bursts", "prior", "forecasts")
PADDED = 2  # lines of a spectrum for each pulse, at least


@dataclass(frozen=True)
class Plan:
    """All that a block needs; see `kernels` for the arrays."""

    layout: Layout
    axes: PulsesAxes
    world: kernels.World
    filters: kernels.Filters
    menus: tuple[Menu | None, ...]
    block: int = BLOCK
    gaussian: bool = False  # an estimate that did not lock is no Gaussian error


def prepare(case: Case) -> Plan:
    """The bursts of a case, the windows of its estimators, and the exact values of its idealisations."""
    spec = case.spec
    t = np.arange(spec.scans) * spec.radar.scan_period_s
    truth = filters.truth(spec.target, t, case.name)
    bursts = filters.bursts(spec, truth)
    try:
        made = filters.designed(spec, bursts)
    except NoSchedule as error:
        raise ConfigError(f"{case.name}: filters: no windows lead from the forecast to the burst: {error}") from None
    missed = filters.defects(truth, spec.radar.scan_period_s)
    return Plan(
        layout=Layout(**kernels.shapes(len(spec.filters), spec.scans)),
        axes=axes(spec, t, bursts, made.arrays, missed),
        world=observed(case, truth, bursts, made, missed),
        filters=made.arrays,
        menus=made.menus,
    )


def observed(
    case: Case, truth: np.ndarray, bursts: list[Burst], made: filters.Designed, missed: np.ndarray
) -> kernels.World:
    """The kernels' arrays of the observations."""
    spec, burst, dt = case.spec, bursts[0], case.spec.radar.scan_period_s
    laws = {one.noise_variance: i for i, one in enumerate(dict.fromkeys(bursts))}
    sigmas = np.sqrt([one.noise_variance for one in bursts])
    physics = np.repeat(made.sums.physics.reshape(1), len(bursts))
    physics["sigma"] = sigmas
    per_sigma = made.sums.factor / made.sums.physics["sigma"]
    lines = 1 << math.ceil(math.log2(PADDED * burst.pulses)) if spectra(spec) else 1
    doppler = 2.0 * truth[:, 1] / burst.wavelength_m * burst.pulse_period_s * lines
    middle = np.zeros((2, SIZE))
    for c in range(2):
        row = filters.at_centre(burst, SIZE, c + 1)
        middle[c] = row * [math.factorial(j) / burst.duration_s**j for j in range(SIZE)]
    return kernels.World(
        keys=plain([noise_key(case, what) for what in STREAMS], 4, 2, dtype=np.uint64),
        missed=plain(missed, *missed.shape),
        motion=transition(dt)[np.array([0, 0, 1, 1, 2]), np.array([1, 2, 1, 2, 2])],
        sigma_r=float(spec.radar.sigma_range_m),
        prior=np.array([spec.prior.sigma_velocity_mps, spec.prior.sigma_acceleration_mps2]),
        span=float(spec.span_mps),
        physics=physics,
        law=np.array([laws[one.noise_variance] for one in bursts]),
        mean=made.sums.sums,
        factor=np.stack([per_sigma * math.sqrt(variance) for variance in laws]),
        tables=made.tables.arrays(),
        to_turns=to_turns(burst),
        measured=middle,
        offset=np.ceil(doppler) - doppler,
        twiddle=twiddle(lines),
        reversed=reversed_order(lines),
    )


def spectra(spec: Any) -> bool:
    """Whether any filter looks at spectra."""
    return any(one.estimator == "spectrum" for one in spec.filters)


def to_turns(burst: Burst) -> np.ndarray:
    """Matrix (2, 2) from velocity and acceleration at the middle to b₁ and b₂ in turns over the burst."""
    T, middle = burst.duration_s, filters.centre(burst) * burst.duration_s
    return 2.0 / burst.wavelength_m * np.array([[T, -middle * T], [0.0, 0.5 * T**2]])


def twiddle(lines: int) -> np.ndarray:
    """Cosines and sines (lines / 2, 2) of the transform."""
    angle = 2.0 * math.pi * np.arange(max(lines // 2, 1)) / lines
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def reversed_order(lines: int) -> np.ndarray:
    """Numbers (lines,) with their bits reversed."""
    order = np.zeros(1, np.int64)
    while order.size < lines:
        order = np.concatenate([2 * order, 2 * order + 1])
    return order


def axes(spec: Any, t: np.ndarray, bursts: list[Burst], made: kernels.Filters, missed: np.ndarray) -> PulsesAxes:
    """Labels, Fisher bounds, and the exact values where all errors are Gaussian."""
    shape = (len(spec.filters), spec.scans, 3)
    sigma, bias, bound = np.full(shape, np.nan), np.full(shape, np.nan), np.full((*shape[:2], 2), np.nan)
    losses, most_lost = np.zeros(shape), np.zeros(len(spec.filters))
    for f, one in enumerate(spec.filters):
        if not filters.known(one):
            losses[f] = filters.of_losses(spec, one, made.sigma[f])
            most_lost[f] = filters.most_lost(bursts, one)
        if one.takes:
            bound[f, :, : one.takes] = made.sigma[f, :, : one.takes]
        if filters.known(one):
            mean, covariance = filters.errors(spec, one, made.sigma[f], missed)
            sigma[f], bias[f] = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2) + mean**2), mean
    return PulsesAxes(
        filters=tuple(one.name for one in spec.filters),
        components=COMPONENTS,
        k=np.arange(1, spec.scans + 1),
        t_s=t,
        available=np.ones(shape, dtype=bool),
        baseline=made.baseline,
        exact_sigma=sigma,
        exact_bias=bias,
        bound=bound,
        takes=np.array([one.takes for one in spec.filters]),
        energy_db=10.0 * np.log10([energy_ratio(one, one.duration_s) for one in bursts]),
        ideal=np.array([idealisation(spec, one) for one in spec.filters]),
        losses=losses,
        most_lost=most_lost,
    )


def idealisation(spec: Any, one: Any) -> int:
    """The number of the filter with ideal errors that is otherwise as this one; −1: there is none, or it is its own."""
    if not one.takes or one.estimator == "fisher_bound":
        return -1
    for i, other in enumerate(spec.filters):
        alike = ("observes", "manoeuvre_variance", "process_noise")
        same = all(getattr(other, key) == getattr(one, key) for key in alike)
        if same and other.estimator == "fisher_bound" and other.derivatives == one.derivatives:
            return i
    return -1


def simulate(plan: Plan, first: int, count: int) -> np.ndarray:
    """Sums of one block, in the order of the plan's layout."""
    values = np.zeros(plan.layout.size)
    kernels.simulate_block(plan.world, plan.filters, kernels.Sums(**plan.layout.unpack(values)), first, count)
    return values
