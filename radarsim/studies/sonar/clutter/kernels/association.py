"""The association of a scan's plots with the tracks of a chunk, one realisation after the other."""

from radarsim.kernels.compiler import inline, kernel_part
from radarsim.kernels.lanes import address
from radarsim.studies.sonar.clutter.kernels.false_plots import add_false_plots, field_draws
from radarsim.studies.sonar.clutter.kernels.gate import (
    KNOWN,
    OPEN_GATE,
    add_plot,
    associate_gated_plots,
    distance_squared,
    empty_gate,
    inverse_two,
    track_gate,
)
from radarsim.studies.sonar.clutter.kernels.gate_area import gate_area
from radarsim.studies.sonar.clutter.kernels.track_prediction import clear_track
from radarsim.studies.sonar.clutter.kernels.track_rules import (
    AGE,
    BEST,
    CONFIRMED,
    FALSE_WEIGHT,
    FIRST,
    HITS,
    MISSES,
    NONE,
    PLOTS_TAKEN,
    SCORE,
    STATE,
    TENTATIVE,
    TIME_SINCE_PLOT,
)
from radarsim.studies.sonar.clutter.kernels.track_sums import (
    EXPECTED_FALSE_COUNT,
    FALSE_IN_GATE_COUNT,
    GATE_COUNT,
    PLOTS_IN_GATE_COUNT,
    TARGET_PLOT_COUNT,
)
from radarsim.studies.sonar.kernels.chunks import CHUNK


@inline
def associate_track(draws, rule, realisation, k, plot, gate, counts):
    """Associate one track with the plots of scan k; counts is the address of the scan's counts.

    plot is (1 if there is a plot of the target, else 0; its range; its bearing)."""
    gated_plots, is_known = empty_gate(), rule.association == KNOWN
    nu_r, nu_b = plot[1] - gate.r, plot[2] - gate.b
    irr, irb, ibb, det = inverse_two(gate.S[0], gate.S[1], gate.S[2])
    S_inverse = (irr, irb, ibb)
    if plot[0] > 0.0:
        gated_plots = add_plot(gated_plots, nu_r, nu_b, 0.0, S_inverse, OPEN_GATE if is_known else rule.chi_square)
        if gate.has_velocity:
            counts[TARGET_PLOT_COUNT] += 1.0
            counts[PLOTS_IN_GATE_COUNT] += distance_squared(nu_r, nu_b, S_inverse) <= rule.chi_square
    cells = draws.cells
    if cells.density > 0.0:
        with_false = add_false_plots(gated_plots, draws, realisation, k, gate, rule.chi_square)
        if gate.has_velocity:
            counts[FALSE_IN_GATE_COUNT] += with_false.false_count
            counts[EXPECTED_FALSE_COUNT] += cells.density * gate_area(gate, det, rule.chi_square, cells)
        gated_plots = gated_plots if is_known else with_false
    if gate.has_velocity:
        counts[GATE_COUNT] += 1.0
    return associate_gated_plots(gated_plots, rule, gate.r, gate.S, gate.has_velocity)


@kernel_part
def begin_track(tracks, status, i, z, association):
    """Begin a track of one plot in realisation i."""
    clear_track(tracks, i)
    association[:, i] = 0.0
    association[0, i], association[1, i], association[2, i] = 1.0, z[0, i], z[1, i]
    status[STATE, i], status[AGE, i], status[HITS, i], status[MISSES, i] = (TENTATIVE, 1.0, 1.0, 0.0)
    status[TIME_SINCE_PLOT, i], status[SCORE, i], status[FIRST, i] = (0.0, 0.0, 0.0 if status[FIRST, i] >= 0.0 else 1.0)


@inline
def record_association(status, i, association, out):
    """Write the association of track i to the rows of out (6, CHUNK), and update the track's status (ROWS, CHUNK).

    status and out are addresses, because Numba may count references to arrays for every track."""
    rows = (association.has_plot, association.nu_r, association.nu_b, association.rr, association.rb, association.bb)
    for j in range(6):
        out[j * CHUNK + i] = rows[j]
    if status[STATE * CHUNK + i] == CONFIRMED:
        status[FALSE_WEIGHT * CHUNK + i] += association.false_share
        status[PLOTS_TAKEN * CHUNK + i] += association.has_plot
    status[AGE * CHUNK + i] += 1.0
    score = status[SCORE * CHUNK + i] + association.score
    status[SCORE * CHUNK + i] = score
    if status[FIRST * CHUNK + i] > 0.0:
        status[BEST * CHUNK + i] = max(status[BEST * CHUNK + i], score)
    if association.has_plot > 0.0:
        status[HITS * CHUNK + i] += 1.0
        status[MISSES * CHUNK + i] = 0.0
        status[TIME_SINCE_PLOT * CHUNK + i] = 0.0
    else:
        status[MISSES * CHUNK + i] += 1.0


@kernel_part
def associate(field, rule, scan, tracks, status, target, work, counts):
    """Associate the plots of a scan with every track of a chunk; write the results to work.association (6, CHUNK).

    Its rows: 1 if a plot is taken, else 0; innovations (r, b) and their additional covariance V (rr, rb, bb). A track
    that begins at this scan has the plot itself in place of the innovations."""
    # Arrays are taken out of their records once, because every access counts a reference.
    draws, out, counts_address, plots = field_draws(field), work.association, address(counts), tracks.plots
    detected = target.detected
    z = target.z
    predicted = work.predicted
    status_address = address(status)
    out_address = address(out)
    for i in range(scan.count):
        if status[STATE, i] == NONE:
            out[:, i] = 0.0
            if target.begins and detected[i] > 0.0:
                begin_track(tracks, status, i, z, out)
            continue
        status[TIME_SINCE_PLOT, i] += scan.dt
        position, S = (predicted[0, i], predicted[1, i]), (predicted[2, i], predicted[3, i], predicted[4, i])
        gate = track_gate(position, S, plots[i] > 1.5, rule.speed * status[TIME_SINCE_PLOT, i])
        plot = (detected[i], z[0, i], z[1, i])
        association = associate_track(draws, rule, scan.first + i, scan.k, plot, gate, counts_address)
        record_association(status_address, i, association, out_address)
