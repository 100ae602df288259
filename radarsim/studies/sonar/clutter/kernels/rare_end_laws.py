"""The laws that bring the target's track to an end, and their ratios (importance sampling).

A share of the realisations is drawn as it is, the others by laws of three kinds:

    runs        the target's plots are missed more often than they should, once its track is confirmed, until as many
                misses in a row have come as the law is for
    far         errors of the plots of a young track are stretched along one direction, in range and bearing
    false       the gate of the young track contains a false plot more often than it should, until one has come
    seduced     likewise, in place of the target's plot: that is missed, and a false one comes

Each realisation counts with the law itself over the mixture of all. Of runs, the ratio of the laws is at first that of
the answers "detected or not". For a tracker, a plot outside its gate is a miss, as if it were not there; so where the
plots' errors are no longer stretched, it is that of the answers "in the gate or not" alone,

    (1 - h) / P_D   for a plot in the gate,     (h + (1 - h) c) / (1 - P_D + P_D c)   for none,

with h the probability that the target is not detected, as drawn, and c that its plot, if there is one, is outside the
gate: both follow from the scans before. For false plots the ratio is that of `rare_boxes`; for the last law it is that
of the answers "both or not". Letters as in `gate`, and

    c           probability that the target's plot is outside the gate
    p           probability that the box about a gate contains a false plot
    u, s        direction of errors, a unit vector; how much they are stretched along it
    ratio       of a law that is drawn from over the law itself"""

import math
from typing import NamedTuple

import numpy as np

from radarsim.kernels.compiler import inline, kernel_part
from radarsim.kernels.lanes import address
from radarsim.kernels.random import uniforms
from radarsim.studies.sonar.clutter.kernels import association as kernels_association
from radarsim.studies.sonar.clutter.kernels import false_plots, single_tracks, track_rules
from radarsim.studies.sonar.clutter.kernels import gate as kernels_gate
from radarsim.studies.sonar.clutter.kernels.outside_gate import probability_outside_gate
from radarsim.studies.sonar.clutter.kernels.rare_boxes import MAX_BOX_MEAN, MAX_RATIO, associate_in_box, gate_box
from radarsim.studies.sonar.clutter.kernels.rare_false_tracks import LAW
from radarsim.studies.sonar.kernels.chunks import CHUNK, copy_row
from radarsim.studies.sonar.kernels.world import move_and_measure

YOUNG_SCANS = 3.0  # a track is young in the scans of the rule that confirms it, and in so many more
MAX_LOG_RATIO = 600.0  # far beyond any ratio whose reciprocal counts
# Rows of the state of importance sampling of a realisation, after LAW (0 is the law itself): the longest run of misses
# since the confirmation; whether the track has ended; whether a false plot has come, and one in place of the target's;
# p of this scan, 0 where no plot is drawn in a box; by how much errors in range and bearing are stretched; ratios of
# the laws.
LONGEST_RUN, HAS_ENDED, FALSE_CAME, SEDUCED, BOX_PROBABILITY, PUSH_R, PUSH_B, FIRST_RATIO = range(1, 9)


class EndLaws(NamedTuple):
    """The laws from which the target's tracks of F trackers are drawn: R of runs, N of far plots, 2 of false plots."""

    choice: np.ndarray  #: (2,) key of the stream that chooses the law of each realisation
    plots: np.ndarray  #: (2,) key of false plots in boxes
    shares: np.ndarray  #: (F, 1 + R + N + 2) of the law itself and of the other laws, in this order; the sum is one
    length: np.ndarray  #: (F, R) length of the run of misses that a law produces
    #: (F, R, L, K) probability that the target is not detected at scan k by tracks with i misses in a row
    undetected: np.ndarray
    young: np.ndarray  #: (F, J) the first scans that may give a plot, -1 where there are fewer
    direction: np.ndarray  #: (F, N, J) of the errors at these
    stretch: np.ndarray  #: (F, N) of them


class TrackerLaws(NamedTuple):
    """The `EndLaws` of one tracker, without the axis F; its rule, and the age up to which a track is young."""

    shares: np.ndarray  #: (1 + R + N + 2,)
    length: np.ndarray  #: (R,)
    undetected: np.ndarray  #: (R, L, K)
    young: np.ndarray  #: (J,)
    direction: np.ndarray  #: (N, J)
    stretch: np.ndarray  #: (N,)
    rule: kernels_gate.AssociationRule
    young_age: float


@kernel_part
def write_young_errors(world, young, first, errors):
    """Write the errors of the target's plots at the scans `young` (J,), over their σ, to errors (J, 2, CHUNK)."""
    plots = np.zeros((2, 4, CHUNK))
    for j in range(young.size):
        move_and_measure(world, first, max(young[j], 0), plots)
        for c in range(2):
            for i in range(CHUNK):
                errors[j, c, i] = plots[c, 1, i] / world.fresh[young[j], c] if young[j] >= 0 else 0.0


@inline
def project_errors(direction, errors, c, i):
    """Project the errors (J, 2, CHUNK) of realisation i in coordinate c onto a direction u (J,)."""
    total = 0.0
    for j in range(direction.size):
        total += direction[j] * errors[j, c, i]
    return total


@inline
def inner_product(u, v):
    """The inner product of two directions."""
    total = 0.0
    for j in range(u.size):
        total += u[j] * v[j]
    return total


@kernel_part
def choose_end_laws(choice, laws, first, n, errors, sampling):
    """Choose the laws of n realisations from number `first` on, stretch errors, and set the ratios of the laws."""
    runs, direction, stretch = laws.length.size, laws.direction, laws.stretch
    for i in range(n):
        u, _ = uniforms(choice[0], choice[1], first + i, 0)
        law, total = 0, laws.shares[0]
        while u >= total and law < laws.shares.size - 1:
            law += 1
            total += laws.shares[law]
        sampling[:, i] = 0.0
        sampling[LAW, i], sampling[FIRST_RATIO:, i] = float(law), 1.0
        stretch_law = law - 1 - runs
        if 0 <= stretch_law < len(direction):
            sampling[PUSH_R, i] = (stretch[stretch_law] - 1.0) * project_errors(direction[stretch_law], errors, 0, i)
            sampling[PUSH_B, i] = (stretch[stretch_law] - 1.0) * project_errors(direction[stretch_law], errors, 1, i)
        else:
            stretch_law = 0  # no error is stretched
        for j in range(len(direction)):
            cosine = inner_product(direction[j], direction[stretch_law])
            r = project_errors(direction[j], errors, 0, i) + cosine * sampling[PUSH_R, i]
            b = project_errors(direction[j], errors, 1, i) + cosine * sampling[PUSH_B, i]
            square = stretch[j] * stretch[j]
            sampling[FIRST_RATIO + runs + j, i] = (
                math.exp(min(0.5 * (r * r + b * b) * (1.0 - 1.0 / square), MAX_LOG_RATIO)) / square
            )


@kernel_part
def stretch_plots(laws, k, n, z, sigma, sampling, out):
    """Write the target's plots (2, CHUNK) at scan k to out, with errors stretched by the law of each realisation."""
    runs = laws.length.size
    copy_row(z[0], out[0])
    copy_row(z[1], out[1])
    for j in range(laws.young.size):
        for i in range(n if laws.young[j] == k else 0):
            stretch_law = int(sampling[LAW, i]) - 1 - runs
            if 0 <= stretch_law < len(laws.direction):
                out[0, i] += laws.direction[stretch_law, j] * sampling[PUSH_R, i] * sigma[0]
                out[1, i] += laws.direction[stretch_law, j] * sampling[PUSH_B, i] * sigma[1]


@inline
def tracker_laws(ends, trackers, f):
    """The laws of tracker f."""
    stretched, rule = (ends.young[f], ends.direction[f], ends.stretch[f]), single_tracks.association_rule(trackers, f)
    return TrackerLaws(
        ends.shares[f], ends.length[f], ends.undetected[f], *stretched, rule, trackers.n[f] + YOUNG_SCANS
    )


@inline
def undetected_probability(laws, law, longest, misses, k, detection):
    """h: the probability under a law that the target of a confirmed track is not detected; 0 is the law itself."""
    if 0 < law <= laws.length.size and longest < laws.length[law - 1]:
        return laws.undetected[law - 1, misses, k]
    return 1.0 - detection


@kernel_part
def set_box_probabilities(field, laws, scan, tracks, status, predicted, sampling):
    """Set the p of this scan: false plots are drawn in a box while a track is young."""
    cells, plots = field.cells, tracks.plots
    for i in range(scan.count):
        sampling[BOX_PROBABILITY, i] = 0.0
        if (
            status[track_rules.STATE, i] != track_rules.NONE
            and status[track_rules.AGE, i] < laws.young_age
            and laws.shares[-1] > 0.0
        ):
            position, S = (predicted[0, i], predicted[1, i]), (predicted[2, i], predicted[3, i], predicted[4, i])
            reach = laws.rule.speed * (status[track_rules.TIME_SINCE_PLOT, i] + scan.dt)
            mean = gate_box(
                cells, kernels_gate.track_gate(position, S, plots[i] > 1.5, reach), laws.rule.chi_square
            ).mean
            sampling[BOX_PROBABILITY, i] = -math.expm1(-mean) if 0.0 < mean <= MAX_BOX_MEAN else 0.0


@inline
def hastened_probability(laws, age):
    """The probability, as drawn, that an event that has not come yet comes at this scan of a young track.

    Early scans are preferred: with L scans left it is L times as likely now as at the last of them."""
    return 2.0 / (laws.young_age - age + 1.0)


@inline
def seduction_probability(laws, age, miss_probability, p):
    """η: the probability, as drawn, that the target's plot is missed and a false one is in the box."""
    return max(hastened_probability(laws, age), miss_probability * p)


@inline
def miss_probability_with_seduction(eta, miss_probability, p):
    """The probability that the target's plot is missed, where a miss with a false plot in the box is drawn with η."""
    return eta + (1.0 - eta) * miss_probability * (1.0 - p) / (1.0 - miss_probability * p)


@inline
def can_be_seduced(laws, k, certain, sampling, i):
    """Whether the law of seduction shifts realisation i at scan k: not where "missed" means "not in the gate"."""
    return sampling[BOX_PROBABILITY, i] > 0.0 and sampling[SEDUCED, i] == 0.0 and certain < 0 and k <= laws.young.max()


@kernel_part
def detect_by_laws(detections, laws, scan, status, predicted, target, course, sigma, sampling):
    """Set target.detected by the law of each realisation, and update the ratios of runs in sampling.

    To be called before association: predicted (5, CHUNK) belongs to this scan; plots lie about course with σ (2,) in m
    and rad. A realisation whose track has ended has no more plots."""
    k, certain, detection = scan.k, detections.certain[scan.k], detections.probability
    detected, z, longest_law, unstretched = target.detected, target.z, laws.length.max(), k > laws.young.max()
    for i in range(scan.count):
        u, _ = uniforms(detections.key[0], detections.key[1], scan.first + i, k)
        law, h = int(sampling[LAW, i]), 1.0 - detection
        if law == laws.shares.size - 1 and can_be_seduced(laws, k, certain, sampling, i):
            h = miss_probability_with_seduction(
                seduction_probability(laws, status[track_rules.AGE, i], h, sampling[BOX_PROBABILITY, i]),
                h,
                sampling[BOX_PROBABILITY, i],
            )
        if sampling[HAS_ENDED, i] > 0.0 or certain >= 0 or status[track_rules.STATE, i] != track_rules.CONFIRMED:
            is_detected = u < 1.0 - h if certain < 0 else certain > 0
            detected[i] = 1.0 if is_detected and sampling[HAS_ENDED, i] == 0.0 else 0.0
            continue
        misses, longest = (
            int(status[track_rules.MISSES, i]),
            max(sampling[LONGEST_RUN, i], status[track_rules.MISSES, i]),
        )
        sampling[LONGEST_RUN, i] = longest
        h = undetected_probability(laws, law, longest, misses, k, detection) if law <= laws.length.size else h
        detected[i] = 1.0 if u < 1.0 - h else 0.0
        if longest >= longest_law:  # under every law plots are then missed as they are
            continue
        in_gate, c = detected[i] > 0.0, 0.0
        if unstretched:
            S = (predicted[2, i], predicted[3, i], predicted[4, i])
            irr, irb, ibb, _ = kernels_gate.inverse_two(S[0], S[1], S[2])
            nu = (z[0, i] - predicted[0, i], z[1, i] - predicted[1, i])
            in_gate = in_gate and kernels_gate.distance_squared(nu[0], nu[1], (irr, irb, ibb)) <= laws.rule.chi_square
            if not in_gate:
                off_r = course.truth[0, 0] + course.shift[0, 0, i] - predicted[0, i]
                off_b = course.truth[1, 0] + course.shift[1, 0, i] - predicted[1, i]
                c = probability_outside_gate((off_r, off_b), S, laws.rule.chi_square, (sigma[0], sigma[1]))
        for j in range(laws.length.size):
            h = undetected_probability(laws, j + 1, longest, misses, k, detection)
            factor = (1.0 - h) / detection if in_gate else (h + (1.0 - h) * c) / (1.0 - detection + detection * c)
            sampling[FIRST_RATIO + j, i] = min(sampling[FIRST_RATIO + j, i] * factor, MAX_RATIO)


@inline
def false_plot_probabilities(laws, k, certain, miss_probability, detected, status, sampling, i):
    """The probabilities with which a false plot is drawn about the young track of realisation i.

    Returns h of the law of false plots, h of the law that the realisation is drawn from, and η, zero where seduction
    does not shift it. miss_probability: that the target is not detected; detected: whether it is."""
    age, law, last = status[track_rules.AGE, i], int(sampling[LAW, i]), laws.shares.size - 1
    law_probability = hastened_probability(laws, age) if sampling[FALSE_CAME, i] == 0.0 else 0.0
    eta = (
        seduction_probability(laws, age, miss_probability, sampling[BOX_PROBABILITY, i])
        if can_be_seduced(laws, k, certain, sampling, i)
        else 0.0
    )
    drawn_probability = law_probability if law == last - 1 else 0.0
    if law == last and eta > 0.0 and not detected:
        drawn_probability = eta / miss_probability_with_seduction(eta, miss_probability, sampling[BOX_PROBABILITY, i])
    return law_probability, drawn_probability, eta


@kernel_part
def associate_young_tracks(field, detections, keys, laws, scan, tracks, status, target, work, sampling, counts):
    """Associate a scan's plots with every track, as `association.associate` does, drawing false plots about young ones.

    Updates the ratios of the last two laws, those of false plots; keys belong to these plots."""
    draws, out, rule, counts_address = false_plots.field_draws(field), work.association, laws.rule, address(counts)
    predicted, detected, z, status_address = work.predicted, target.detected, target.z, address(status)
    last, miss_probability = sampling.shape[0] - 1, 1.0 - detections.probability
    for i in range(scan.count):
        if status[track_rules.STATE, i] == track_rules.NONE:
            out[:, i] = 0.0
            if detected[i] > 0.0:
                kernels_association.begin_track(tracks, status, i, z, out)
            continue
        status[track_rules.TIME_SINCE_PLOT, i] += scan.dt
        position, S = (predicted[0, i], predicted[1, i]), (predicted[2, i], predicted[3, i], predicted[4, i])
        gate = kernels_gate.track_gate(
            position, S, tracks.plots[i] > 1.5, rule.speed * status[track_rules.TIME_SINCE_PLOT, i]
        )
        plot, realisation = (detected[i], z[0, i], z[1, i]), scan.first + i
        if sampling[BOX_PROBABILITY, i] > 0.0:
            certain = detections.certain[scan.k]
            box = gate_box(draws.cells, gate, rule.chi_square)
            is_detected = detected[i] > 0.0
            law_probability, drawn_probability, eta = false_plot_probabilities(
                laws, scan.k, certain, miss_probability, is_detected, status, sampling, i
            )
            association, factor, any_in_box = associate_in_box(
                keys, rule, (realisation, scan.k), gate, plot, box, law_probability, drawn_probability
            )
            sampling[last - 1, i] = min(sampling[last - 1, i] * factor, MAX_RATIO)
            sampling[FALSE_CAME, i] = 1.0 if any_in_box else sampling[FALSE_CAME, i]
            if eta > 0.0:
                seduced = any_in_box and not is_detected
                plain_probability = miss_probability * sampling[BOX_PROBABILITY, i]
                sampling[last, i] = min(
                    sampling[last, i]
                    * (eta / plain_probability if seduced else (1.0 - eta) / (1.0 - plain_probability)),
                    MAX_RATIO,
                )
                sampling[SEDUCED, i] = 1.0 if seduced else 0.0
        else:
            association = kernels_association.associate_track(
                draws, rule, realisation, scan.k, plot, gate, counts_address
            )
        kernels_association.record_association(status_address, i, association, address(out))
