"""Folded Doppler: the plan of a case, and the sums of a block of realisations."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.moments import Layout
from radarsim.kernels.linear import plain
from radarsim.studies.ambiguous_doppler import exact, filters, world
from radarsim.studies.ambiguous_doppler.axes import FoldedAxes
from radarsim.studies.ambiguous_doppler.kernels import records, sums
from radarsim.studies.noise import noise_key

COMPONENTS = (("r", "m"), ("Vr", "m/s"), ("ar", "m/s2"))
BLOCK = 512  # 64 groups of eight; some 5 ms with six filters and 15 scans


@dataclass(frozen=True)
class Plan:
    """All that a block needs; see `kernels.records` for the arrays."""

    layout: Layout
    axes: FoldedAxes
    world: records.World
    banks: records.Banks
    block: int = BLOCK
    gaussian: bool = False  # a wrong fold is no Gaussian error


def prepare(case: Case) -> Plan:
    """Design the filters of a case, its truth, and the exact values of its errors."""
    spec, radar = case.spec, case.spec.radar
    t = np.arange(spec.scans) * radar.scan_period_s
    observed = records.World(
        keys=plain([noise_key(case, what) for what in ("plots", "detections", "target")], 3, 2, dtype=np.uint64),
        truth=plain(world.truth(spec.target, t), spec.scans, 3),
        t=t,
        spread=world.spread(spec.target),
        sigma=np.array([radar.sigma_range_m, radar.sigma_velocity_mps]),
        spans=np.resize(np.array(radar.spans_mps), spec.scans),
        detection=float(radar.detection_probability),
    )
    banks = filters.banks(spec)
    return Plan(Layout(**records.shapes(len(spec.filters), spec.scans)), axes(spec, observed, banks), observed, banks)


def axes(spec: Any, observed: records.World, banks: records.Banks) -> FoldedAxes:
    """Labels and exact values."""
    shape = (len(spec.filters), spec.scans, 3)
    sigma, bias, oracle = np.full(shape, np.nan), np.full(shape, np.nan), np.full(shape, np.nan)
    right = np.full(shape[:2], np.nan)
    available = np.broadcast_to(np.array([filters.components(one) for one in spec.filters])[:, None], shape)
    for f, one in enumerate(spec.filters):
        if observed.detection < 1:
            break  # the gains are then another's in each realisation
        of = exact.gains(one, spec.prior, observed.sigma, spec.radar.scan_period_s, spec.scans)
        mean, covariance = exact.errors(
            of, observed.truth, world.drawn_motions(observed.t), observed.spread, observed.sigma
        )
        rms = np.where(available[f], np.sqrt(np.diagonal(covariance, axis1=1, axis2=2) + mean**2), np.nan)
        if one.doppler == "folded":
            oracle[f] = rms
        else:
            sigma[f], bias[f] = rms, np.where(available[f], mean, np.nan)
        if filters.kind(one) == records.NEAREST and follows_the_model(spec, one):
            right[f] = exact.all_right(of, observed.spans)
    return FoldedAxes(
        filters=tuple(one.name for one in spec.filters),
        components=COMPONENTS,
        k=np.arange(1, spec.scans + 1),
        t_s=observed.t,
        available=available,
        baseline=banks.baseline,
        exact_sigma=sigma,
        exact_bias=bias,
        spans=observed.spans,
        folded=np.array([one.doppler == "folded" for one in spec.filters]),
        remembers=np.array([filters.kind(one) == records.REMEMBERS for one in spec.filters]),
        exact_right=right,
        oracle_sigma=oracle,
    )


def follows_the_model(spec: Any, one: Any) -> bool:
    """Whether truth and filter agree: a polynomial drawn from the very prior, and no manoeuvre allowed for."""
    target, prior = spec.target, spec.prior
    return (
        target.kind == "random_polynomial"
        and (one.order, one.manoeuvre_variance) == (2, 0)
        and target.sigma_velocity_mps == prior.sigma_velocity_mps
        and target.sigma_acceleration_mps2 == prior.sigma_acceleration_mps2
    )


def simulate(plan: Plan, first: int, count: int) -> np.ndarray:
    """Sums of one block, in the order of the plan's layout."""
    values = np.zeros(plan.layout.size)
    sums.simulate_block(plan.world, plan.banks, records.Sums(**plan.layout.unpack(values)), first, count)
    return values
