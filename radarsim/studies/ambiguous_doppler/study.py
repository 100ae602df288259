"""Folded Doppler: the plan of a case, and the sums of a block of realisations."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.moments import Layout
from radarsim.errors import ConfigError
from radarsim.kernels.linear import plain
from radarsim.studies.ambiguous_doppler import exact, filters, rare, world
from radarsim.studies.ambiguous_doppler.axes import FoldedAxes
from radarsim.studies.ambiguous_doppler.kernels import rare as rare_kernels
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
    mixture: rare_kernels.Mixture | None = None
    block: int = BLOCK
    gaussian: bool = False  # a wrong fold is no Gaussian error


def prepare(case: Case) -> Plan:
    """Design the filters of a case, its truth, and the exact values of its errors."""
    spec, radar = case.spec, case.spec.radar
    t = np.arange(spec.scans) * radar.scan_period_s
    solves, rates = any(one.doppler == "remainder" for one in spec.filters), len(radar.spans_mps)
    observed = records.World(
        keys=plain([noise_key(case, what) for what in ("plots", "detections", "target")], 3, 2, dtype=np.uint64),
        truth=plain(world.truth(spec.target, t, case.name), spec.scans, 3),
        t=t,
        spread=world.spread(spec.target),
        sigma=np.array([radar.sigma_range_m, radar.sigma_velocity_mps]),
        spans=np.resize(np.array(radar.spans_mps), spec.scans),
        turn=np.resize(np.arange(len(radar.spans_mps)), spec.scans),
        joint=plain(radar.joint_spans_mps if solves else 0.0, rates, rates),
        detection=float(radar.detection_probability),
    )
    banks = filters.banks(spec, lambda one: shares(spec, one, observed))
    shapes, labels, mixture = dict(records.shapes(len(spec.filters), spec.scans)), axes(spec, observed, banks), None
    if spec.rare is not None:
        shapes |= {"events": (len(spec.filters), spec.scans, rare_kernels.EVENTS, 4), "drawn": (3,)}
        try:
            mixture = rare.mixture(observed, spec, noise_key(case, "rare"))
        except rare.NotFound as error:
            raise ConfigError(f"{case.name}: rare: {spec.rare.filter} {error}") from None
    return Plan(Layout(**shapes), labels, observed, banks, mixture)


def shares(spec: Any, one: Any, observed: records.World) -> np.ndarray:
    """What a filter that combines its members needs, (K, MEMBERS, 3): shares, or half widths of intervals."""
    members = filters.members(one)
    of = [exact.gains(member, spec.prior, observed.sigma, spec.radar.scan_period_s, spec.scans) for member in members]
    drawn = world.drawn_motions(observed.t)
    made = np.zeros((spec.scans, records.MEMBERS, 3))
    if one.combine == "intersection":
        bias, noise = exact.errors(of, drawn, observed.sigma)
        made[:, : len(members)] = exact.widths(bias, noise, members, spec.prior)
    elif one.combine == "expected_error":
        manoeuvres = exact.expected_motions(one.manoeuvres, observed.t)
        motions = np.concatenate([drawn[:1], manoeuvres])
        weight = np.array([spec.prior.sigma_velocity_mps**2, *np.full(len(manoeuvres), 1 / len(manoeuvres))])
        E = exact.joint(*exact.errors(of, motions, observed.sigma), weight)
        made[:, : len(members)] = exact.best_shares(E, np.array([member.components for member in members]))
    return made


def axes(spec: Any, observed: records.World, banks: records.Banks) -> FoldedAxes:
    """Labels and exact values; none where plots are missed, as each realisation then has gains of its own."""
    shape = (len(spec.filters), spec.scans, 3)
    known = {
        name: np.full(shape, np.nan) for name in ("sigma", "bias", "oracle_sigma", "best_order", "best_combination")
    }
    right = np.full(shape[:2], np.nan)
    available = np.broadcast_to(np.array([filters.components(one) for one in spec.filters])[:, None], shape)
    if observed.detection == 1:
        for f, one in enumerate(spec.filters):
            found = exact_values(spec, one, observed, banks.shares[banks.bank[f]])
            for name, values in found.items():
                known[name][f] = np.where(available[f], values, np.nan)
            if one.doppler == "remainder":
                joint = np.concatenate([[0.0], observed.joint[observed.turn[1:], observed.turn[:-1]]])
                velocities = observed.truth[:, 1]
                right[f] = exact.remainders_right(
                    velocities, observed.spread, observed.t, observed.sigma[1], observed.spans, joint
                )
            elif one.hypotheses == 1 and one.combine is None and follows_the_model(spec, one):
                (member,) = filters.members(one)
                of = exact.gains(member, spec.prior, observed.sigma, spec.radar.scan_period_s, spec.scans)
                right[f] = exact.all_right(of, observed.spans)
    return FoldedAxes(
        filters=tuple(one.name for one in spec.filters),
        components=COMPONENTS,
        k=np.arange(1, spec.scans + 1),
        t_s=observed.t,
        available=available,
        baseline=banks.baseline,
        exact_sigma=known["sigma"],
        exact_bias=known["bias"],
        spans=observed.spans,
        folded=np.array([one.folds for one in spec.filters]),
        remembers=records.remembers(banks)[banks.bank],
        combines=np.array([one.combine is not None for one in spec.filters]),
        exact_right=right,
        oracle_sigma=known["oracle_sigma"],
        best_order=known["best_order"],
        best_combination=known["best_combination"],
    )


def exact_values(spec: Any, one: Any, observed: records.World, held: np.ndarray) -> dict[str, np.ndarray]:
    """What is known of a filter without sampling, each (K, 3), by the name in `axes`; held (K, MEMBERS, 3) its shares.

    σ and bias of a linear filter, with all folds right (oracle_sigma) of one that folds. Of one that combines its
    members, with all folds right: the least error of a single one, and of a linear combination, at each scan.
    """
    members = filters.members(one)
    of = [exact.gains(member, spec.prior, observed.sigma, spec.radar.scan_period_s, spec.scans) for member in members]
    motions = np.concatenate([observed.truth[None], world.drawn_motions(observed.t)])
    bias, noise = exact.errors(of, motions, observed.sigma)
    E = exact.joint(bias, noise, np.array([1.0, *observed.spread**2]))
    known = np.array([member.components for member in members])
    single = np.sqrt(np.where(known, np.einsum("kxii->kix", E), np.inf).min(axis=1))
    found = {}
    if one.combine:
        best = exact.best_shares(E, known)
        found = {"best_order": single, "best_combination": np.sqrt(np.einsum("kix,kxij,kjx->kx", best, E, best))}
    own = held[:, : len(members)] if one.combine == "expected_error" else np.ones((spec.scans, 1, 3))
    if one.combine in (None, "expected_error"):
        sigma = np.sqrt(np.einsum("kix,kxij,kjx->kx", own, E, own))
        if one.folds:
            return found | {"oracle_sigma": sigma}
        return found | {"sigma": sigma, "bias": np.einsum("kix,ikx->kx", own, bias[0])}
    return found


def follows_the_model(spec: Any, one: Any) -> bool:
    """Whether truth and filter agree: a polynomial drawn from the very prior, and no manoeuvre allowed for."""
    target, prior = spec.target, spec.prior
    return (
        target.kind == "random_polynomial"
        and (one.orders, one.variances) == ((2,), (0,))
        and target.sigma_velocity_mps == prior.sigma_velocity_mps
        and target.sigma_acceleration_mps2 == prior.sigma_acceleration_mps2
    )


def simulate(plan: Plan, first: int, count: int) -> np.ndarray:
    """Sums of one block, in the order of the plan's layout; with `rare` the common ones are of plain realisations."""
    values = np.zeros(plan.layout.size)
    arrays = plan.layout.unpack(values)
    common = records.Sums(**{name: arrays[name] for name in records.Sums._fields})
    if plan.mixture is None:
        sums.simulate_block(plan.world, plan.banks, common, first, count)
    else:
        losses = rare_kernels.Losses(arrays["events"], arrays["drawn"])
        rare_kernels.simulate_block(plan.world, plan.banks, plan.mixture, common, losses, first, count)
    return values
