"""Folded Doppler: the plan of a case, and the sums of a block of realisations."""

from dataclasses import dataclass

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.sums import Layout
from radarsim.errors import ConfigError
from radarsim.kernels.second_order import as_kernel_array
from radarsim.studies.ambiguous_doppler import filter_design, scenario
from radarsim.studies.ambiguous_doppler.axes import FoldedAxes
from radarsim.studies.ambiguous_doppler.exact_values import axes, combination_numbers
from radarsim.studies.ambiguous_doppler.importance_sampling import NoRareFolds, wrong_fold_mixture
from radarsim.studies.ambiguous_doppler.kernels import layout as kernels_layout
from radarsim.studies.ambiguous_doppler.kernels import realisations, sums, weighted_sums
from radarsim.studies.noise import noise_key

BLOCK = 512  # 64 groups of eight; some 5 ms with six filters and 15 scans


@dataclass(frozen=True)
class Plan:
    """All that a block needs; see `kernels.layout` for the arrays."""

    layout: Layout
    axes: FoldedAxes
    world: kernels_layout.World
    banks: kernels_layout.Banks
    mixture: weighted_sums.Mixture | None = None
    block: int = BLOCK
    gaussian: bool = False  # a wrong fold is no Gaussian error


def prepare(case: Case) -> Plan:
    """Design the filters of a case, its truth, and the exact values of its errors."""
    spec, radar = case.spec, case.spec.radar
    t = np.arange(spec.scans) * radar.scan_period_s
    solves, rates = any(options.doppler == "remainder" for options in spec.filters), len(radar.spans_mps)
    observed = kernels_layout.World(
        keys=as_kernel_array(
            [noise_key(case, stream) for stream in ("plots", "detections", "target")], 3, 2, dtype=np.uint64
        ),
        truth=as_kernel_array(scenario.truth(spec.target, t, case.name), spec.scans, 3),
        t=t,
        spread=scenario.random_motion_sigma(spec.target),
        sigma=np.array([radar.sigma_range_m, radar.sigma_velocity_mps]),
        spans=np.resize(np.array(radar.spans_mps), spec.scans),
        rate_index=np.resize(np.arange(len(radar.spans_mps)), spec.scans),
        joint_spans=as_kernel_array(radar.joint_spans_mps if solves else 0.0, rates, rates),
        detection_probability=float(radar.detection_probability),
    )
    banks = filter_design.banks(spec, lambda options: combination_numbers(spec, options, observed))
    shapes, labels, mixture = (
        dict(kernels_layout.shapes(len(spec.filters), spec.scans)),
        axes(spec, observed, banks),
        None,
    )
    if spec.rare is not None:
        shapes |= {"events": (len(spec.filters), spec.scans, weighted_sums.EVENTS, 4), "drawn": (3,)}
        try:
            mixture = wrong_fold_mixture(observed, spec, noise_key(case, "rare"))
        except NoRareFolds as error:
            raise ConfigError(f"{case.name}: rare: {spec.rare.filter} {error}") from None
    return Plan(Layout(**shapes), labels, observed, banks, mixture)


def simulate(plan: Plan, first: int, count: int) -> np.ndarray:
    """Sums of one block, in the order of the plan's layout; with `rare` the usual ones hold plain realisations only."""
    values = np.zeros(plan.layout.size)
    arrays = plan.layout.unpack(values)
    common = kernels_layout.Sums(**{name: arrays[name] for name in kernels_layout.Sums._fields})
    if plan.mixture is None:
        sums.simulate_block(plan.world, plan.banks, common, first, count)
    else:
        losses = weighted_sums.Losses(arrays["events"], arrays["drawn"])
        weighted_sums.simulate_weighted_block(plan.world, plan.banks, plan.mixture, common, losses, first, count)
    return values


def errors(plan: Plan, first: int, count: int) -> np.ndarray:
    """The errors (F, count, K, 3) of plain realisations; not-a-number where a filter has not started."""
    return realisations.simulate_errors(plan.world, plan.banks, first, count)
