"""The exact values of a case's filters, and the numbers by which a filter combines its members."""

from typing import Any

import numpy as np

from radarsim.studies.ambiguous_doppler import exact_errors, filter_design, scenario
from radarsim.studies.ambiguous_doppler.axes import COMPONENTS, FoldedAxes
from radarsim.studies.ambiguous_doppler.kernels import layout


def member_gains(spec: Any, member: filter_design.Member, observed: layout.World) -> exact_errors.Gains:
    """The gains of a member of a filter over the scans of a case."""
    return exact_errors.kalman_gains(member, spec.prior, observed.sigma, spec.radar.scan_period_s, spec.scans)


def combination_numbers(spec: Any, options: Any, observed: layout.World) -> np.ndarray:
    """The numbers (K, MAX_MEMBERS, 3) by which a filter combines its members: shares, or half widths of intervals."""
    members = filter_design.members(options)
    gains = [member_gains(spec, member, observed) for member in members]
    motions = scenario.unit_motions(observed.t)
    numbers = np.zeros((spec.scans, layout.MAX_MEMBERS, 3))
    if options.combine == "intersection":
        bias, noise = exact_errors.linear_errors(gains, motions, observed.sigma)
        numbers[:, : len(members)] = exact_errors.interval_widths(bias, noise, members, spec.prior)
    elif options.combine == "expected_error":
        manoeuvres = exact_errors.manoeuvre_motions(options.manoeuvres, observed.t)
        motions = np.concatenate([motions[:1], manoeuvres])
        weight = np.array([spec.prior.sigma_velocity_mps**2, *np.full(len(manoeuvres), 1 / len(manoeuvres))])
        moments = exact_errors.joint_moments(*exact_errors.linear_errors(gains, motions, observed.sigma), weight)
        numbers[:, : len(members)] = exact_errors.best_shares(
            moments, np.array([member.components for member in members])
        )
    return numbers


def axes(spec: Any, observed: layout.World, banks: layout.Banks) -> FoldedAxes:
    """Labels and exact values; these are unknown if plots are missed, as each realisation then has its own gains."""
    shape = (len(spec.filters), spec.scans, 3)
    exact = {
        name: np.full(shape, np.nan) for name in ("sigma", "bias", "oracle_sigma", "best_order", "best_combination")
    }
    exact_right = np.full(shape[:2], np.nan)
    available = np.broadcast_to(
        np.array([filter_design.components(options) for options in spec.filters])[:, None], shape
    )
    if observed.detection_probability == 1:
        for f, options in enumerate(spec.filters):
            values_of_filter = exact_values(spec, options, observed, banks.shares[banks.bank[f]])
            for name, values in values_of_filter.items():
                exact[name][f] = np.where(available[f], values, np.nan)
            exact_right[f] = right_fold_probability(spec, options, observed)
    return FoldedAxes(
        filters=tuple(options.name for options in spec.filters),
        components=COMPONENTS,
        k=np.arange(1, spec.scans + 1),
        t_s=observed.t,
        available=available,
        baseline=banks.baseline,
        exact_sigma=exact["sigma"],
        exact_bias=exact["bias"],
        spans=observed.spans,
        folded=np.array([options.folds for options in spec.filters]),
        remembers=layout.keeps_several(banks)[banks.bank],
        combines=np.array([options.combine is not None for options in spec.filters]),
        exact_right=exact_right,
        oracle_sigma=exact["oracle_sigma"],
        best_order=exact["best_order"],
        best_combination=exact["best_combination"],
    )


def right_fold_probability(spec: Any, options: Any, observed: layout.World) -> np.ndarray:
    """The exact probability (K,) that a filter's folds are right; not-a-number where it is unknown."""
    if options.doppler == "remainder":
        joint_spans = np.concatenate([[0.0], observed.joint_spans[observed.rate_index[1:], observed.rate_index[:-1]]])
        velocities = observed.truth[:, 1]
        return exact_errors.remainder_probability(
            velocities, observed.spread, observed.t, observed.sigma[1], observed.spans, joint_spans
        )
    if options.hypotheses == 1 and options.combine is None and matches_truth(spec, options):
        (member,) = filter_design.members(options)
        return exact_errors.nearest_fold_probability(member_gains(spec, member, observed), observed.spans)
    return np.full(spec.scans, np.nan)


def exact_values(spec: Any, options: Any, observed: layout.World, shares: np.ndarray) -> dict[str, np.ndarray]:
    """A filter's exact values (K, 3) by their name in `axes`; shares (K, MAX_MEMBERS, 3) as in its bank.

    For a linear filter σ and bias; for one that unfolds σ with all folds right (oracle_sigma). For one that combines
    its members, with all folds right: the smallest σ of a member, and of a linear combination, at each scan."""
    members = filter_design.members(options)
    gains = [member_gains(spec, member, observed) for member in members]
    motions = np.concatenate([observed.truth[None], scenario.unit_motions(observed.t)])
    bias, noise = exact_errors.linear_errors(gains, motions, observed.sigma)
    E = exact_errors.joint_moments(bias, noise, np.array([1.0, *observed.spread**2]))
    estimated = np.array([member.components for member in members])
    best_order = np.sqrt(np.where(estimated, np.einsum("kxii->kix", E), np.inf).min(axis=1))
    exact = {}
    if options.combine:
        best_weights = exact_errors.best_shares(E, estimated)
        exact = {
            "best_order": best_order,
            "best_combination": np.sqrt(np.einsum("kix,kxij,kjx->kx", best_weights, E, best_weights)),
        }
    weights = shares[:, : len(members)] if options.combine == "expected_error" else np.ones((spec.scans, 1, 3))
    if options.combine in (None, "expected_error"):
        sigma = np.sqrt(np.einsum("kix,kxij,kjx->kx", weights, E, weights))
        if options.folds:
            return exact | {"oracle_sigma": sigma}
        return exact | {"sigma": sigma, "bias": np.einsum("kix,ikx->kx", weights, bias[0])}
    return exact


def matches_truth(spec: Any, options: Any) -> bool:
    """Whether the filter's model is the truth: a random polynomial with the filter's prior, and no manoeuvre noise."""
    target, prior = spec.target, spec.prior
    return (
        target.kind == "random_polynomial"
        and (options.orders, options.variances) == ((2,), (0,))
        and target.sigma_velocity_mps == prior.sigma_velocity_mps
        and target.sigma_acceleration_mps2 == prior.sigma_acceleration_mps2
    )
