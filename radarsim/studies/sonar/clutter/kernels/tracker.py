"""The layout of the sums of tracks among false plots, which kernels write and tables read.

Plots in the gate of a track: which one is the nearest, how probable each is, and what the track takes of them.

The letters, plain numbers here:

    r, b        range in m, bearing in rad
    nu          innovation (r, b)
    S           covariance of the innovation: rr, rb, bb
    S_inverse   S⁻¹ likewise: rr, rb, bb
    d           νᵀ S⁻¹ ν of a plot; e = exp(-d / 2), its likelihood without the constant
    beta0       probability that no plot in the gate is the target's (PDA)
    P_D, P_G    probabilities of detection, and that the gate contains the target's plot

Sums over a chunk of tracks: errors, scores, ratios of two numbers of each realisation, and weights.

Letters as in `sonar.kernels.sums`; f numbers trackers, c the lines in range and bearing, k scans.

Tracks of range and bearing, eight at a time: prediction with the innovation's covariance, and the update.

The state is that of two lines, (r, vr) and (b, vb), each with the recursion of a plain Kalman filter (after
`steps.least_squares` up to two plots). Probabilistic association causes a covariance between
them: four numbers, which are exactly zero as long as every plot taken is certain. The coordinates of a plot are
processed one after the other, which is possible because their errors are independent. Letters as in
`sonar.kernels.steps`, and

    P_r, P_b    (6)   covariances of the two lines; their third component is zero
    C           (4)   covariance between them, (r, vr) by (b, vb), packed by rows
    nu_r, nu_b        innovations in range and bearing, in m and rad
    S           (3)   covariance of the innovations: rr, rb, bb
    V           (3)   additional covariance of innovations that may not be the target's: rr, rb, bb
    K_rb        (2)   gain of the line in range for the innovation in bearing; likewise K_rr, K_br, K_bb
    n, w              plots of a track before this scan; 1 where it takes a plot, else 0

P, C and K are in nominal plots and periods. Arrays contain a chunk, as in `steps`.

The life of a track: confirmed by m plots in its first n scans, dropped after misses, lost too far from the target.

Letters as in `tracker`; i numbers the realisations of a chunk.

False plots of a whole sector; a gate draws only those that it needs.

The sector is divided into cells of equal area, uniform in q = r²/2 and in the bearing. Poisson processes on disjoint
cells are independent, so the number of plots in a cell (by inversion of the distribution function) and their positions
are functions of key, realisation, scan and cell: all filters see the same field, and a gate costs only the cells that
it touches. The letters are those of `gate`, and

    q           r² / 2, m²: uniform where plots are uniform in area

Trackers among false and missed plots (P3): prediction, association and update of a chunk of tracks.

Each tracker has one track a realisation. Plots are associated one realisation after the other, since the numbers of
false plots in the gates differ; covariances are then updated for eight realisations at a time (`tracks`).

Letters as in `gate` and `tracks`; f numbers trackers, i realisations of a chunk, k scans.

Blocks of realisations of trackers among false plots: the target's track, and tracks that false plots begin.

Every plot that no track takes begins a track. The target's plots do so one at a time. Of the false plots one begins a
track in each realisation, at a position drawn uniformly over the sector. By the theorem of Slivnyak and Mecke the plots
about it are again those of the field, and the expected number of false tracks is their density times the share that is
confirmed. Letters as in `tracker`."""

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from radarsim.kernels import lanes
from radarsim.kernels.algebra import add_outer, constant_acceleration, predicted, predicted_covariance, take_value
from radarsim.kernels.compile import aligned_zeros, inline, kernel, part
from radarsim.kernels.lanes import address, choose3, choose6, full, get, get3, get4, get6, put, put4, put6
from radarsim.kernels.random import U, log_polynomial, threefry, uniform, uniforms
from radarsim.studies.sonar.kernels import steps
from radarsim.studies.sonar.kernels.patterns import detect
from radarsim.studies.sonar.kernels.shared_gains import move_and_measure
from radarsim.studies.sonar.kernels.steps import CHUNK, GROUPS, copy_row, get_information, least_squares
from radarsim.studies.sonar.kernels.sums import Course, add_ahead, add_sums, rows_of

if TYPE_CHECKING:
    from radarsim.studies.sonar.kernels.shared_gains import Sums


# ---- counts ----------------------------------------------------------------------------------------------------------
COUNTS = 11
TRYING, KEPT, FOUND, LOST, DROPPED, FAILED, LOOKED, PLOTS, INSIDE, FALSE, EXPECTED = range(COUNTS)
FALSE_COUNTS = 3
FALSE_TRYING, FALSE_KEPT, FALSE_FOUND = range(FALSE_COUNTS)
RATIOS = 2
ENDS_PER_SCAN, WRONG_PER_PLOT = range(RATIOS)


class TrackSums(NamedTuple):
    """Sums of a block, for F trackers over K scans."""

    errors: "Sums"  #: of the confirmed tracks that are on the target, as in all parts of the sonar.
    #: (F, K, COUNTS) numbers of realisations that at a scan have a tentative track of the target (TRYING) or a
    #: confirmed one (KEPT), confirm their first one (FOUND), lose a confirmed one (LOST) or drop it (DROPPED), or drop
    #: a tentative one (FAILED); then, of settled tracks, the number that looked for a plot (LOOKED), of the target's
    #: plots (PLOTS), of those in the gate (INSIDE), of false plots in the gate (FALSE), and the expected number of
    #: these (EXPECTED).
    counts: np.ndarray
    #: (F, K, FALSE_COUNTS) numbers of tracks that false plots began and that are tentative, are confirmed, and become
    #: confirmed at this scan.
    begun: np.ndarray
    #: (F, RATIOS, 5) Σa, Σa², Σb, Σb², Σab over realisations: a ends of tracks and b scans held (ENDS_PER_SCAN); a
    #: weight of false plots and b plots taken (WRONG_PER_PLOT).
    ratios: np.ndarray
    #: (2, F, T + 1) numbers of the target's first tracks, and of false ones, whose score reached each of T thresholds,
    #: and last the number of all these tracks.
    scores: np.ndarray


def shapes(F: int, K: int, T: int) -> dict[str, tuple[int, ...]]:
    """Shapes of all sums but the errors, for F trackers, K scans and T thresholds of the score."""
    return {"counts": (F, K, COUNTS), "begun": (F, K, FALSE_COUNTS), "ratios": (F, RATIOS, 5), "scores": (2, F, T + 1)}


# ---- gate ------------------------------------------------------------------------------------------------------------
MIN_DENSITY = 1e-9  # per m², in scores: without false plots a score would be infinite
OPEN_GATE = 1e30  # χ² of a gate that contains everything
MIN_RANGE_M = 1.0  # of densities and gates, should a track pass through the sonar
MIN_LIKELIHOOD = 1e-300  # the reciprocal of a smaller likelihood may be infinite
NEAREST, PDA, KNOWN = range(3)


class AssociationRule(NamedTuple):
    """How a tracker chooses among the plots in its gate."""

    association: int  #: NEAREST, PDA or KNOWN
    gate: float  #: χ² of two components
    detection: float  #: P_D
    inside: float  #: P_G
    density: float  #: of false plots per m², as the tracker assumes it
    speed: float  #: of targets in m/s, which widens the gate of a track of one plot


class Gate(NamedTuple):
    """The gate of a track: predicted r and b, S (rr, rb, bb), and whether the track has two plots or more."""

    r: float
    b: float
    S: tuple[float, float, float]
    settled: bool


class GatedPlots(NamedTuple):
    """The plots found in a gate so far.

    Number of plots, number of false plots; of the nearest plot d, the innovation, and 1 if it is false. Then, weighted
    with the likelihoods e: Σe, Σe of false plots, mean innovation and scatter (rr, rb, bb) about it."""

    count: float
    false_count: float
    d: float
    nu_r: float
    nu_b: float
    nearest_false: float
    weight: float
    false_weight: float
    mean_r: float
    mean_b: float
    rr: float
    rb: float
    bb: float


class Association(NamedTuple):
    """What a track takes from the plots in its gate."""

    nu_r: float  #: innovation in range
    nu_b: float  #: innovation in bearing
    rr: float  #: of the additional covariance V
    rb: float
    bb: float
    has_plot: float  #: 1 if any plot is taken, else 0
    false_share: float  #: weight of false plots among those taken
    score: float  #: increment of the track's score


@inline
def inverse_two(rr, rb, bb):
    """Inverse (rr, rb, bb) and determinant of a symmetric 2 × 2 matrix."""
    det = rr * bb - rb * rb
    per = 1.0 / det
    return bb * per, -rb * per, rr * per, det


@inline
def empty_gate():
    """A gate without plots."""
    return GatedPlots(0.0, 0.0, OPEN_GATE, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@inline
def distance_squared(nu_r, nu_b, S_inverse):
    """νᵀ S⁻¹ ν."""
    return S_inverse[0] * nu_r * nu_r + 2.0 * S_inverse[1] * nu_r * nu_b + S_inverse[2] * nu_b * nu_b


@inline
def add_plot(gated_plots, nu_r, nu_b, false, S_inverse, threshold):
    """Add a plot with innovation (nu_r, nu_b) to those in a gate, if its d is at most the threshold.

    false is 1 for a false plot, else 0. The weighted mean and scatter are updated plot by plot (West 1979): the scatter
    of a single plot is exactly zero."""
    count, false_count, nearest_d, r, b, nearest_false, weight, false_weight, mean_r, mean_b, rr, rb, bb = gated_plots
    d = distance_squared(nu_r, nu_b, S_inverse)
    if d > threshold:
        return gated_plots
    count, false_count = count + 1.0, false_count + false
    if d < nearest_d:
        nearest_d, r, b, nearest_false = d, nu_r, nu_b, false
    e = math.exp(-0.5 * d)
    if e > MIN_LIKELIHOOD:
        weight, false_weight = weight + e, false_weight + e * false
        share, off_r, off_b = e / weight, nu_r - mean_r, nu_b - mean_b
        mean_r, mean_b = mean_r + share * off_r, mean_b + share * off_b
        rr, rb = rr + e * (off_r * (nu_r - mean_r)), rb + e * (off_r * (nu_b - mean_b))
        bb = bb + e * (off_b * (nu_b - mean_b))
    return GatedPlots(
        count, false_count, nearest_d, r, b, nearest_false, weight, false_weight, mean_r, mean_b, rr, rb, bb
    )


@inline
def associate_gated_plots(gated_plots, rule, r, S, settled):
    """Associate a track at range r with the plots in its gate.

    This is Bar-Shalom's parametric filter (Bar-Shalom, Daum, Huang 2009). With b = λ 2π √|S| (1 - P_D P_G) / P_D, no
    plot is the target's with probability β₀ = b / (b + Σe), and the covariance exceeds that after a certain plot by
    K (β₀ S + scatter) Kᵀ. λ is the density in range and bearing: the density per m² times the range. The score is the
    logarithm of the likelihood ratio of all plots in the gate, with a target against without. A track of one plot (not
    settled) takes the nearest."""
    r = max(r, MIN_RANGE_M)
    density, root = rule.density * r, 2.0 * math.pi * math.sqrt(S[0] * S[2] - S[1] * S[1])
    miss_probability = 1.0 - rule.detection * rule.inside
    ratio = miss_probability + rule.detection * gated_plots.weight / (root * max(density, MIN_DENSITY * r))
    score = log_polynomial(max(ratio, 1e-12))
    if gated_plots.count == 0.0:
        return Association(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, score)
    missed_weight = density * root * miss_probability / rule.detection
    if rule.association != PDA or not settled or missed_weight + gated_plots.weight == 0.0:
        return Association(gated_plots.nu_r, gated_plots.nu_b, 0.0, 0.0, 0.0, 1.0, gated_plots.nearest_false, score)
    beta0 = missed_weight / (missed_weight + gated_plots.weight)
    # In an open gate all plots may be so far away that their likelihoods are zero.
    target_probability, per = 1.0 - beta0, 1.0 / gated_plots.weight if gated_plots.weight > 0.0 else 0.0
    mean_r, mean_b = gated_plots.mean_r, gated_plots.mean_b
    return Association(
        target_probability * mean_r,
        target_probability * mean_b,
        beta0 * S[0] + target_probability * (gated_plots.rr * per + beta0 * (mean_r * mean_r)),
        beta0 * S[1] + target_probability * (gated_plots.rb * per + beta0 * (mean_r * mean_b)),
        beta0 * S[2] + target_probability * (gated_plots.bb * per + beta0 * (mean_b * mean_b)),
        1.0,
        gated_plots.false_weight * per,
        score,
    )


@kernel
def associate_innovations(rule, settled, r, S, nu_r, nu_b):
    """Associate a track at range r, with innovation covariance S (rr, rb, bb), with plots of innovations (n,)."""
    irr, irb, ibb, _ = inverse_two(S[0], S[1], S[2])
    gated_plots = empty_gate()
    for i in range(nu_r.size):
        gated_plots = add_plot(gated_plots, nu_r[i], nu_b[i], 0.0, (irr, irb, ibb), rule.gate)
    return associate_gated_plots(gated_plots, rule, r, S, settled)


# ---- sums ------------------------------------------------------------------------------------------------------------
@part
def add_scores(thresholds, n, first, best, scores):
    """Count first tracks by the thresholds that their score reached, and all first tracks, in scores (T + 1,).

    first (CHUNK,) is negative where a realisation had no track; best (CHUNK,) is the greatest score of its first track.
    """
    for i in range(n):
        if first[i] >= 0.0:
            scores[thresholds.size] += 1.0
            for t in range(thresholds.size):
                scores[t] += best[i] >= thresholds[t]


@part
def add_ratio(a, b, n, ratio):
    """Add Σa, Σa², Σb, Σb², Σab over n realisations to ratio (5,)."""
    for i in range(n):
        ratio[0] += a[i]
        ratio[1] += a[i] * a[i]
        ratio[2] += b[i]
        ratio[3] += b[i] * b[i]
        ratio[4] += a[i] * b[i]


@part
def add_errors(trackers, tracks, f, k, course, plot_counts, used, scratch, sums):
    """Add the errors of tracker f at scan k, in range and in bearing; scratch (7,).

    plot_counts (CHUNK,) is 2 where a realisation has a confirmed track on the target, else 0."""
    size = tracks.x.shape[0]  # two; were it a constant, the compiler would unroll the loop and compile everything twice
    for c in range(size):
        rows, units = rows_of(tracks.x[c], course, c, plot_counts, used), (trackers.sigma[c], trackers.period)
        add_sums(rows, tracks.P[c], size, tracks.x[c], 0, units, (f, k, c), scratch, sums)


# ---- tracks ----------------------------------------------------------------------------------------------------------
LEAST_SQUARES_PLOTS = 2.0  # plots from which a line is no longer least squares


class Tracks(NamedTuple):
    """A chunk of tracks of one tracker; lines in range and in bearing."""

    x: np.ndarray  #: (2, 4, CHUNK) states of each line
    Y: np.ndarray  #: (2, 8, CHUNK) information, as in `steps`
    P: np.ndarray  #: (2, 6, CHUNK) covariance
    C: np.ndarray  #: (4, CHUNK) covariance between the lines
    plots: np.ndarray  #: (CHUNK,) so far


def no_tracks() -> Tracks:
    """A chunk without any track."""
    shapes = ((2, 4, CHUNK), (2, 8, CHUNK), (2, 6, CHUNK), (4, CHUNK), (CHUNK,))
    return Tracks(*(aligned_zeros(*shape) for shape in shapes))


@kernel
def clear_track(tracks, i):
    """Set track i to zero."""
    tracks.x[:, :, i], tracks.Y[:, :, i], tracks.P[:, :, i] = 0.0, 0.0, 0.0
    tracks.C[:, i], tracks.plots[i] = 0.0, 0.0


# ---- prediction ---------------------------------------------------------------------------------------------------
@inline
def predict_line_covariance(P, n, tau, q):
    """Predict the covariance (6) of a line over tau periods."""
    moved = predicted_covariance(P, constant_acceleration(tau), steps.manoeuvre_covariance(q, tau, 2))
    return choose6(full(LEAST_SQUARES_PLOTS), n, P, moved)


@inline
def predict_cross_covariance(C, tau):
    """Predict the covariance between the lines over tau periods: F C Fᵀ."""
    value, rate = C[0] + tau * C[2], C[1] + tau * C[3]
    return value + tau * rate, rate, C[2] + tau * C[3], C[3]


@kernel
def predict(tracks, dt, period, sigma, manoeuvre, forecast):
    """Write positions and innovation covariances after dt to forecast (5, CHUNK): r, b, S (rr, rb, bb); in m, rad.

    sigma (2,) of a nominal plot; manoeuvre (2,) variances q of the lines."""
    ar, ab, pr, pb = address(tracks.x[0]), address(tracks.x[1]), address(tracks.P[0]), address(tracks.P[1])
    ac, an, out, tau = address(tracks.C), address(tracks.plots), address(forecast), dt / period
    rr, rb, bb, F = sigma[0] * sigma[0], sigma[0] * sigma[1], sigma[1] * sigma[1], constant_acceleration(dt)
    for i in range(GROUPS):
        n, (r, _, _), (b, _, _) = get(an, i), predicted(get3(ar, i, GROUPS), F), predicted(get3(ab, i, GROUPS), F)
        P_r = predict_line_covariance(get6(pr, i, GROUPS), n, tau, manoeuvre[0])
        P_b = predict_line_covariance(get6(pb, i, GROUPS), n, tau, manoeuvre[1])
        C, _, _, _ = predict_cross_covariance(get4(ac, i, GROUPS), tau)
        put(out, i, r)
        put(out, GROUPS + i, b)
        put(out, 2 * GROUPS + i, rr * (P_r[0] + 1.0))
        put(out, 3 * GROUPS + i, rb * C)
        put(out, 4 * GROUPS + i, bb * (P_b[0] + 1.0))


# ---- update -------------------------------------------------------------------------------------------------------
@inline
def update_line(P, start, n, w):
    """Gain K (3) and covariance P (6) of a line after a plot; start is (K, P) by least squares."""
    P, K, _ = take_value(P, 1.0, w)
    start_plots = full(LEAST_SQUARES_PLOTS)
    return choose3(start_plots, n, start[0][:3], K), choose6(start_plots, n, start[1], P)


@inline
def transpose(C):
    """Cᵀ: the covariance between the lines in the other order."""
    return C[0], C[2], C[1], C[3]


@inline
def update_pair(P, P_other, C, start, n, w):
    """Update both lines with a plot of one of them.

    Returns the gains K and K_other (2), the covariances P and P_other (6), and the covariance C (4) between the lines.
    P belongs to the line that has the plot, start is its (K, P) by least squares; C is that line by the other."""
    h = (C[0], C[1])  # covariance of the measured value with the other line
    scale = w / (P[0] + 1.0)
    K, P = update_line(P, start, n, w)
    K_other = (h[0] * scale, h[1] * scale)
    P_other = add_outer(P_other, full(0.0) - scale, (h[0], h[1], 0.0))
    C = (C[0] - K[0] * h[0], C[1] - K[0] * h[1], C[2] - K[1] * h[0], C[3] - K[1] * h[1])
    return K, K_other, P, P_other, C


@inline
def add_scatter(P, K, L, V):
    """Add [K L] V [K L]ᵀ to the covariance P (6) of a line; K and L are its gains (2) for the two innovations."""
    u0, u1 = V[0] * K[0] + V[1] * L[0], V[0] * K[1] + V[1] * L[1]
    v0, v1 = V[1] * K[0] + V[2] * L[0], V[1] * K[1] + V[2] * L[1]
    xx, xv, vv = P[0] + u0 * K[0] + v0 * L[0], P[1] + u0 * K[1] + v0 * L[1], P[3] + u1 * K[1] + v1 * L[1]
    return xx, xv, P[2], vv, P[4], P[5]


@inline
def add_scatter_between(C, K_r, K_b, V):
    """Add [K_rr K_rb] V [K_br K_bb]ᵀ to the covariance C (4) between the lines; K_r, K_b are these pairs of gains."""
    (K_rr, K_rb), (K_br, K_bb) = K_r, K_b
    u0, u1 = V[0] * K_br[0] + V[1] * K_bb[0], V[0] * K_br[1] + V[1] * K_bb[1]
    v0, v1 = V[1] * K_br[0] + V[2] * K_bb[0], V[1] * K_br[1] + V[2] * K_bb[1]
    return (
        C[0] + K_rr[0] * u0 + K_rb[0] * v0,
        C[1] + K_rr[0] * u1 + K_rb[0] * v1,
        C[2] + K_rr[1] * u0 + K_rb[1] * v0,
        C[3] + K_rr[1] * u1 + K_rb[1] * v1,
    )


@inline
def update_jointly(P, C, starts, n, w, V):
    """Update both lines with a plot that may not be the target's.

    Returns the gains (K_rr, K_br, K_rb, K_bb), the covariances (P_r, P_b), and C. The range of the plot is processed
    first, then its bearing: K_rb and K_bb are gains for the part of the innovation in bearing that the innovation in
    range does not explain. starts are (K, P) of both lines by least squares."""
    K_rr, K_br, P_r, P_b, C = update_pair(P[0], P[1], C, starts[0], n, w)
    K_bb, K_rb, P_b, P_r, C = update_pair(P_b, P_r, transpose(C), starts[1], n, w)
    # Gains for the two innovations, both processed at once.
    K_r = ((K_rr[0] - K_rb[0] * K_br[0], K_rr[1] - K_rb[1] * K_br[0]), K_rb)
    K_b = ((K_br[0] - K_bb[0] * K_br[0], K_br[1] - K_bb[1] * K_br[0]), K_bb)
    P_r, P_b = add_scatter(P_r, K_r[0], K_r[1], V), add_scatter(P_b, K_b[0], K_b[1], V)
    return (K_rr, K_br, K_rb, K_bb), (P_r, P_b), add_scatter_between(transpose(C), K_r, K_b, V)


@kernel
def update(tracks, dt, period, sigma, manoeuvre, joint, association):
    """Update all tracks with one scan, in place; association (6, CHUNK) is what `tracker.associate` writes.

    Its rows: 1 if a plot is taken, else 0; innovations in range and bearing; V (rr, rb, bb), in m and rad. joint: V may
    differ from zero."""
    ar, ab, pr, pb = address(tracks.x[0]), address(tracks.x[1]), address(tracks.P[0]), address(tracks.P[1])
    yr, yb, ac, an = address(tracks.Y[0]), address(tracks.Y[1]), address(tracks.C), address(tracks.plots)
    az, tau, per, F = address(association), dt / period, 1.0 / period, constant_acceleration(dt)
    r_per_b, b_per_r, per_r, per_b = sigma[0] / sigma[1], sigma[1] / sigma[0], 1.0 / sigma[0], 1.0 / sigma[1]
    for i in range(GROUPS):
        n, w, nu_r, nu_b = get(an, i), get(az, i), get(az, GROUPS + i), get(az, 2 * GROUPS + i)
        (r, vr, _), (b, vb, _) = predicted(get3(ar, i, GROUPS), F), predicted(get3(ab, i, GROUPS), F)
        Y_r, K_start_r, P_start_r = least_squares(get_information(yr, i), n, w, tau, 0.0, 2)
        Y_b, K_start_b, P_start_b = least_squares(get_information(yb, i), n, w, tau, 0.0, 2)
        P_r = predict_line_covariance(get6(pr, i, GROUPS), n, tau, manoeuvre[0])
        P_b = predict_line_covariance(get6(pb, i, GROUPS), n, tau, manoeuvre[1])
        if joint:
            rr, rb = per_r * per_r * get(az, 3 * GROUPS + i), per_r * per_b * get(az, 4 * GROUPS + i)
            V = (rr, rb, per_b * per_b * get(az, 5 * GROUPS + i))
            starts = ((K_start_r, P_start_r), (K_start_b, P_start_b))
            C = predict_cross_covariance(get4(ac, i, GROUPS), tau)
            K, (P_r, P_b), C = update_jointly((P_r, P_b), C, starts, n, w, V)
            K_rr, K_br, K_rb, K_bb = K
            put4(ac, i, C, GROUPS)
            nu_b = nu_b - (b_per_r * K_br[0]) * nu_r
            r, vr = r + (r_per_b * K_rb[0]) * nu_b, vr + (per * r_per_b * K_rb[1]) * nu_b
            b, vb = b + (b_per_r * K_br[0]) * nu_r, vb + (per * b_per_r * K_br[1]) * nu_r
        else:
            K_rr, P_r = update_line(P_r, (K_start_r, P_start_r), n, w)
            K_bb, P_b = update_line(P_b, (K_start_b, P_start_b), n, w)
        put(ar, i, r + K_rr[0] * nu_r)
        put(ar, GROUPS + i, vr + per * K_rr[1] * nu_r)
        put(ab, i, b + K_bb[0] * nu_b)
        put(ab, GROUPS + i, vb + per * K_bb[1] * nu_b)
        put6(pr, i, P_r, GROUPS)
        put6(pb, i, P_b, GROUPS)
        steps.put_information(yr, i, Y_r)
        steps.put_information(yb, i, Y_b)
        put(an, i, n + lanes.where_greater(w, full(0.0), full(1.0), full(0.0)))


# ---- rules -----------------------------------------------------------------------------------------------------------
NONE, TENTATIVE, CONFIRMED = range(3)
# Rows of a track's status: state, scans since its first plot, plots taken, misses in a row, time since the last plot,
# score and its greatest value so far, whether it is the realisation's first track, whether one was confirmed before;
# then sums over the realisation: ends of confirmed tracks, scans with one, weight of false plots taken, plots taken.
ROWS = 13
(
    STATE,
    AGE,
    HITS,
    MISSES,
    TIME_SINCE_PLOT,
    SCORE,
    BEST,
    FIRST,
    CONFIRMED_BEFORE,
    ENDS,
    CONFIRMED_SCANS,
    FALSE_WEIGHT,
    PLOTS_TAKEN,
) = range(ROWS)


@kernel
def next_state(state, hits, misses, age, m, n, max_misses):
    """The state of a track after a scan, by the rule m of n and the rule on misses."""
    if state == TENTATIVE:
        if hits >= m:
            return CONFIRMED
        return TENTATIVE if hits + (n - age) >= m else NONE
    return NONE if misses >= max_misses else CONFIRMED


@part
def judge_known_association(tracks, status, n, plot_counts, counts):
    """Confirm tracks of a filter with known association at their second plot; arguments as in `judge_target_track`."""
    plots = tracks.plots
    for i in range(n):
        plot_counts[i] = 0.0
        if status[STATE, i] == NONE:
            continue
        plot_counts[i] = 2.0 if plots[i] > 1.5 else 0.0
        status[STATE, i] = CONFIRMED if plot_counts[i] > 0.0 else TENTATIVE
        counts[KEPT] += plot_counts[i] > 0.0
        status[CONFIRMED_SCANS, i] += plot_counts[i] > 0.0


@inline
def is_off_target(tracks, course, limit, i):
    """Whether the track of realisation i is farther from the target than limit (r, b), in m and rad."""
    x, truth, shift = tracks.x, course.truth, course.shift
    off = abs(x[0, 0, i] - truth[0, 0] - shift[0, 0, i]) > limit[0]
    return off | (abs(x[1, 0, i] - truth[1, 0] - shift[1, 0, i]) > limit[1])


@part
def judge_target_track(trackers, f, n, tracks, status, course, plot_counts, counts):
    """Apply the rules to the target's track in n realisations after a scan.

    plot_counts (CHUNK,) becomes 2 where there is a confirmed track, else 0. A confirmed track ends when it is dropped,
    either for misses or because its position has become too uncertain, or when it is lost: too far from the target."""
    limit, m, rule_scans, misses = trackers.lost[f], trackers.m[f], trackers.n[f], trackers.misses[f]
    P, lost_error = tracks.P, (limit * trackers.sigma[0], limit * trackers.sigma[1])
    for i in range(n):
        state = status[STATE, i]
        plot_counts[i] = 0.0
        if state == NONE:
            continue
        new_state = next_state(state, status[HITS, i], status[MISSES, i], status[AGE, i], m, rule_scans, misses)
        if new_state == CONFIRMED:
            is_lost = is_off_target(tracks, course, lost_error, i)
            uncertain = max(P[0, 0, i], P[1, 0, i]) > limit * limit
            if state == CONFIRMED and (is_lost or uncertain):
                counts[LOST if is_lost else DROPPED] += 1.0
                new_state = NONE
            elif is_lost:  # confirmed on other plots than the target's
                counts[FAILED] += 1.0
                new_state = NONE
        elif new_state == NONE:
            counts[DROPPED if state == CONFIRMED else FAILED] += 1.0
        if new_state == CONFIRMED:
            plot_counts[i] = 2.0
            counts[KEPT] += 1.0
            status[CONFIRMED_SCANS, i] += 1.0
            counts[FOUND] += status[CONFIRMED_BEFORE, i] == 0.0
            status[CONFIRMED_BEFORE, i] = 1.0
        elif new_state == TENTATIVE:
            counts[TRYING] += 1.0
        elif state == CONFIRMED:
            status[ENDS, i] += 1.0
        if new_state == NONE:
            status[FIRST, i] = 0.0
        status[STATE, i] = new_state


@part
def judge_false_tracks(trackers, f, n, tracks, status, begun):
    """Apply the rules to every track that a false plot began; return whether any is alive."""
    limit, m, rule_scans, misses = trackers.lost[f] * trackers.lost[f], trackers.m[f], trackers.n[f], trackers.misses[f]
    P, any_alive = tracks.P, False
    for i in range(n):
        state = status[STATE, i]
        if state == NONE:
            continue
        new_state = next_state(state, status[HITS, i], status[MISSES, i], status[AGE, i], m, rule_scans, misses)
        if state == CONFIRMED and max(P[0, 0, i], P[1, 0, i]) > limit:
            new_state = NONE
        begun[FALSE_TRYING] += new_state == TENTATIVE
        begun[FALSE_KEPT] += new_state == CONFIRMED
        begun[FALSE_FOUND] += new_state == CONFIRMED and state == TENTATIVE
        status[STATE, i] = new_state
        any_alive |= new_state != NONE
    return any_alive


# ---- field -----------------------------------------------------------------------------------------------------------
DRAW_BITS = 12  # of the number of a draw: the draw in its cell
HALF = U(0xFFFFFFFF)
TURN = 2.0 * math.pi


class Cells(NamedTuple):
    """Cells from q0 and b0 (m², rad), nq by nb of them, each dq by db."""

    q0: float
    dq: float
    nq: int
    b0: float
    db: float
    nb: int
    ring: bool  #: whether they close to a full circle
    density: float  #: of false plots per m²


class Field(NamedTuple):
    """False plots: key (2,) of the noise; share (J,) the distribution function of the number in a cell, up to 1."""

    key: np.ndarray
    share: np.ndarray
    cells: Cells


class Draws(NamedTuple):
    """A field without its arrays, because Numba would count references to them at each call.

    The two words of the key, the address of the distribution function, and the cells."""

    k0: int
    k1: int
    share: int
    cells: Cells


@inline
def field_draws(field):
    """The draws of a field; the field must outlive them."""
    return Draws(field.key[0], field.key[1], address(field.share), field.cells)


@inline
def number_of_plots(share, u):
    """The number of plots in a cell: the first index at which the distribution function exceeds the uniform number u.

    share is the address of the distribution function, whose last value is 1."""
    n = 0
    while u >= share[n]:
        n += 1
    return n


@inline
def random_words(k0, k1, realisation, cell, draw):
    """Two random words of a cell; cells are numbered through all scans.

    The first word of draw 0 gives the number of plots, each later word the position of one plot."""
    return threefry(U(realisation), (U(cell) << U(DRAW_BITS)) + U(draw), k0, k1)


@inline
def plot_position(k0, k1, realisation, cell, n, spare):
    """The position of plot n in a cell, each coordinate from 0 to 1 by half a word, and the spare word after it.

    Words are drawn in pairs: the first spare word is drawn with the word that gives the number of plots."""
    word = spare
    if n % 2 == 1:
        word, spare = random_words(k0, k1, realisation, cell, (n + 1) // 2)
    return np.float64(word >> U(32)) * 2.0**-32 + 2.0**-33, np.float64(word & HALF) * 2.0**-32 + 2.0**-33, spare


@inline
def touched_cells(low, high, start, step, count):
    """The first and the last cell that the interval low … high touches, of `count` cells of size step from `start` on.

    Floors stay floating-point numbers, because an open gate reaches farther than an integer can."""
    first = min(max(np.floor((low - start) / step), 0.0), count - 1.0)
    last = min(max(np.floor((high - start) / step), -1.0), count - 1.0)
    return int(first), int(last)


# ---- false plots in a gate and in the whole sector ----------------------------------------------------------------
@inline
def add_false_plots(gated_plots, draws, realisation, scan, gate, threshold):
    """Add all false plots of a scan that lie in a gate."""
    irr, irb, ibb, _ = inverse_two(gate.S[0], gate.S[1], gate.S[2])
    r, b = gate.r, gate.b
    q0, dq, nq, b0, db, nb, ring, _ = draws.cells
    half_r, half_b = math.sqrt(threshold * gate.S[0]), math.sqrt(threshold * gate.S[2])
    r_min, r_max = max(r - half_r, 0.0), r + half_r
    q_min, q_max = 0.5 * r_min * r_min, 0.5 * r_max * r_max
    i_first, i_last = touched_cells(q_min, q_max, q0, dq, nq)
    if ring:
        half_b = min(half_b, 0.5 * nb * db)
        j_first, j_last = math.floor((b - half_b - b0) / db), math.floor((b + half_b - b0) / db)
        j_last = min(j_last, j_first + nb)  # the same column at both ends of a full turn: half a turn to each side
    else:
        # Without whole turns, relative to the middle of the sector.
        b -= TURN * np.floor((b - b0) / TURN - 0.5 * nb * db / TURN + 0.5)
        j_first, j_last = touched_cells(b - half_b, b + half_b, b0, db, nb)
    for i in range(i_first, i_last + 1):
        for j in range(j_first, j_last + 1):
            column = j if 0 <= j < nb else j % nb
            cell = (scan * nq + i) * nb + column
            u, spare = random_words(draws.k0, draws.k1, realisation, cell, 0)
            for n in range(number_of_plots(draws.share, uniform(u))):
                u_q, u_b, spare = plot_position(draws.k0, draws.k1, realisation, cell, n, spare)
                q, offset = q0 + dq * (i + u_q), b0 + db * (j + u_b) - b
                if q_min <= q <= q_max and abs(offset) <= half_b:  # roots are slow
                    gated_plots = add_plot(gated_plots, math.sqrt(2.0 * q) - r, offset, 1.0, (irr, irb, ibb), threshold)
    return gated_plots


@part
def gate_area(gate, det, threshold, cells):
    """The area, m², of the part of a gate that lies within the sector; det is |S|.

    A gate that reaches over an edge is integrated as the unit disc u² + v² ≤ 1, with r = r₀ + s u, b = b₀ + c u + h v:
    over u between the edges in range, with weight r; v runs from the arc or an edge in bearing to the other one."""
    s, half_b = math.sqrt(threshold * gate.S[0]), math.sqrt(threshold * gate.S[2])
    r_min, r_max = math.sqrt(2.0 * cells.q0), math.sqrt(2.0 * (cells.q0 + cells.dq * cells.nq))
    # from the middle of the sector to that of the gate, without whole turns
    half_sector = 0.5 * cells.nb * cells.db
    offset = 0.0
    if not cells.ring:
        offset = gate.b - cells.b0 - half_sector
        offset -= TURN * np.floor(offset / TURN + 0.5)
    if gate.r - s >= r_min and gate.r + s <= r_max and abs(offset) + half_b <= half_sector:
        return gate.r * np.pi * threshold * math.sqrt(det)
    c, h = s * gate.S[1] / gate.S[0], math.sqrt(threshold * det / gate.S[0])
    begin, end = (r_min - gate.r) / s, (r_max - gate.r) / s
    max_square = 0.0
    for side in (begin, end):
        for edge in (-half_sector - offset, half_sector - offset):
            max_square = max(max_square, side**2 + ((edge - c * side) / h) ** 2)
    if max_square <= 1.0:  # an ellipse that holds the corners holds the sector
        return cells.dq * cells.nq * cells.db * cells.nb
    area, u, end = 0.0, max(begin, -1.0), min(end, 1.0)
    while u < end:  # up to the next point where an edge in bearing cuts the circle
        next_cut = end
        for edge in (-half_sector - offset, half_sector - offset):
            root = half_b * half_b - edge * edge
            if root > 0.0:
                for sign in (-1.0, 1.0):
                    cut = (edge * c + sign * h * math.sqrt(root)) / (half_b * half_b)
                    next_cut = cut if u < cut < next_cut else next_cut
        middle = 0.5 * (u + next_cut)
        arc = math.sqrt(1.0 - middle * middle)
        v_min, v_max = (-half_sector - offset - c * middle) / h, (half_sector - offset - c * middle) / h
        if v_max > -arc and v_min < arc:
            weight = (gate.r, s, u, next_cut)
            area += arc_moment(weight) if v_max > arc else line_moment(weight, (half_sector - offset) / h, -c / h)
            area += arc_moment(weight) if v_min < -arc else line_moment(weight, (half_sector + offset) / h, c / h)
        u = next_cut
    return h * s * area


@inline
def arc_moment(weight):
    """The integral ∫ (r + s u) √(1 − u²) du from begin to end; weight = (r, s, begin, end)."""
    r, s, begin, end = weight
    a, b = math.sqrt(1.0 - begin * begin), math.sqrt(1.0 - end * end)
    integral = end * b - begin * a + math.asin(end) - math.asin(begin)
    return 0.5 * r * integral + s * (a * a * a - b * b * b) / 3.0


@inline
def line_moment(weight, intercept, slope):
    """The integral ∫ (r + s u) (intercept + slope u) du from begin to end; weight = (r, s, begin, end)."""
    r, s, begin, end = weight
    first, second, third = end - begin, (end**2 - begin**2) / 2.0, (end**3 - begin**3) / 3.0
    return r * intercept * first + (r * slope + s * intercept) * second + s * slope * third


@part
def draw_uniform_positions(key, field, first, n, z):
    """Draw a position uniform over the sector in each of n realisations from `first` on; write them to z (2, ≥ n)."""
    q0, dq, nq, b0, db, nb, _, _ = field.cells
    for i in range(n):
        u, v = uniforms(key[0], key[1], first + i, 0)
        z[0, i] = np.sqrt(2.0 * (q0 + dq * nq * u))
        z[1, i] = b0 + db * nb * v


@part
def insert_plot(plot, total, scan_plots):
    """Insert a plot (r, b, 1 of the target or 0) into `total` plots in order of bearing; return their new number.

    scan_plots (3, M) takes it only if there is room."""
    if total < scan_plots.shape[1]:
        j = total
        while j > 0 and scan_plots[1, j - 1] > plot[1]:
            scan_plots[0, j] = scan_plots[0, j - 1]
            scan_plots[1, j] = scan_plots[1, j - 1]
            scan_plots[2, j] = scan_plots[2, j - 1]
            j -= 1
        scan_plots[0, j], scan_plots[1, j], scan_plots[2, j] = plot
    return total + 1


@kernel
def fill_scans(field, first, scan, target_plots, detected, plots):
    """Write all plots of n realisations from `first` on and K scans from `scan` on to plots (n, K, 3, M).

    Range, bearing and 1 for the target's plots, 0 for false ones, in order of bearing; unused places are NaN.
    target_plots (2, n, K) are valid where detected (n, K). Returns the largest number of plots in a scan, which may
    exceed M."""
    k0, k1, share, max_total = field.key[0], field.key[1], address(field.share), 0
    q0, dq, nq, b0, db, nb, _, density = field.cells
    for i in range(detected.shape[0]):
        for k in range(detected.shape[1]):
            scan_plots, total = plots[i, k], 0
            if detected[i, k]:
                total = insert_plot((target_plots[0, i, k], target_plots[1, i, k], 1.0), total, scan_plots)
            for cell in range(nq * nb if density > 0.0 else 0):  # bearing by bearing, so that little is out of order
                a, j = cell % nq, cell // nq
                number = (scan + k) * (nq * nb) + a * nb + j
                u, spare = random_words(k0, k1, first + i, number, 0)
                for n in range(number_of_plots(share, uniform(u))):
                    u_q, u_b, spare = plot_position(k0, k1, first + i, number, n, spare)
                    total = insert_plot(
                        (math.sqrt(2.0 * (q0 + dq * (a + u_q))), b0 + db * (j + u_b), 0.0), total, scan_plots
                    )
            max_total = max(max_total, total)
            scan_plots[:, total:] = np.nan
    return max_total


# ---- tracker ---------------------------------------------------------------------------------------------------------
class Trackers(NamedTuple):
    """F trackers."""

    association: np.ndarray  #: (F,)
    gate: np.ndarray  #: (F,) as χ²
    inside: np.ndarray  #: (F,) probability of the gate
    m: np.ndarray  #: (F,) of the rule that confirms
    n: np.ndarray  #: (F,) likewise
    misses: np.ndarray  #: (F,) in a row that drop a track
    speed: np.ndarray  #: (F,) of targets in m/s
    lost: np.ndarray  #: (F,) in σ of a plot
    manoeuvre: np.ndarray  #: (F, 2) variances q in nominal plots and periods
    detection: float  #: probability as the trackers assume it
    density: float  #: of false plots per m², likewise
    period: float  #: s
    sigma: np.ndarray  #: (2,) of a plot
    thresholds: np.ndarray  #: (T,) of the score


class Workspace(NamedTuple):
    """Work arrays of a chunk for F trackers.

    The fields of `Tracks` and the status (F, ROWS, CHUNK) of each tracker; for one tracker at a time the predictions
    (5, CHUNK) of `predict` and the associations (6, CHUNK) of `associate`."""

    x: np.ndarray
    Y: np.ndarray
    P: np.ndarray
    C: np.ndarray
    plots: np.ndarray
    status: np.ndarray
    predicted: np.ndarray
    association: np.ndarray


class Scan(NamedTuple):
    """Scan k of a chunk, dt after the previous scan: `count` realisations from number `first` on."""

    first: int
    count: int
    k: int
    dt: float


class Target(NamedTuple):
    """The target's plots at a scan: detected (CHUNK,) 1 or 0, z (2, CHUNK); begins: whether they may begin a track."""

    detected: np.ndarray
    z: np.ndarray
    begins: bool


def workspace(count: int) -> Workspace:
    """Work arrays for `count` trackers."""
    shapes = ((2, 4), (2, 8), (2, 6), (4,), (), (ROWS,))
    arrays = [aligned_zeros(count, *shape, CHUNK) for shape in shapes]
    return Workspace(*arrays, aligned_zeros(5, CHUNK), aligned_zeros(6, CHUNK))


@part
def reset_tracks(work):
    """Reset the work arrays to a state without any tracks."""
    work.x[:], work.Y[:], work.P[:], work.C[:] = 0.0, 0.0, 0.0, 0.0
    work.plots[:], work.status[:], work.association[:] = 0.0, 0.0, 0.0
    work.status[:, FIRST] = -1.0


@inline
def tracks_of_tracker(work, f):
    """The tracks of tracker f."""
    return Tracks(work.x[f], work.Y[f], work.P[f], work.C[f], work.plots[f])


@inline
def association_rule(trackers, f):
    """The rule by which tracker f chooses among plots."""
    association, gate, inside, speed = trackers.association[f], trackers.gate[f], trackers.inside[f], trackers.speed[f]
    return AssociationRule(association, gate, trackers.detection, inside, trackers.density, speed)


# ---- association --------------------------------------------------------------------------------------------------
@inline
def associate_track(draws, rule, realisation, k, plot, gate, counts):
    """Associate one track with the plots of scan k; counts is the address of the scan's counts.

    plot is (1 if there is a plot of the target, else 0; its range; its bearing)."""
    gated_plots, is_known = empty_gate(), rule.association == KNOWN
    nu_r, nu_b = plot[1] - gate.r, plot[2] - gate.b
    irr, irb, ibb, det = inverse_two(gate.S[0], gate.S[1], gate.S[2])
    S_inverse = (irr, irb, ibb)
    if plot[0] > 0.0:
        gated_plots = add_plot(gated_plots, nu_r, nu_b, 0.0, S_inverse, OPEN_GATE if is_known else rule.gate)
        if gate.settled:
            counts[PLOTS] += 1.0
            counts[INSIDE] += distance_squared(nu_r, nu_b, S_inverse) <= rule.gate
    cells = draws.cells
    if cells.density > 0.0:
        with_false = add_false_plots(gated_plots, draws, realisation, k, gate, rule.gate)
        if gate.settled:
            counts[FALSE] += with_false.false_count
            counts[EXPECTED] += cells.density * gate_area(gate, det, rule.gate, cells)
        gated_plots = gated_plots if is_known else with_false
    if gate.settled:
        counts[LOOKED] += 1.0
    return associate_gated_plots(gated_plots, rule, gate.r, gate.S, gate.settled)


@part
def begin_track(tracks, status, i, z, association):
    """Begin a track of one plot in realisation i."""
    clear_track(tracks, i)
    association[:, i] = 0.0
    association[0, i], association[1, i], association[2, i] = 1.0, z[0, i], z[1, i]
    status[STATE, i], status[AGE, i], status[HITS, i], status[MISSES, i] = (TENTATIVE, 1.0, 1.0, 0.0)
    status[TIME_SINCE_PLOT, i], status[SCORE, i], status[FIRST, i] = (0.0, 0.0, 0.0 if status[FIRST, i] >= 0.0 else 1.0)


@inline
def track_gate(position, S, settled, reach):
    """The gate of a track; after one plot the velocity is unknown, and the target may have moved by `reach`, in m."""
    r, b = position
    if not settled:
        S = (S[0] + reach * reach, S[1], S[2] + (reach / max(r, MIN_RANGE_M)) ** 2)
    return Gate(r, b, S, settled)


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


@part
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


@part
def step_tracker(trackers, f, field, scan, tracks, target, work, counts):
    """Predict, associate and update all tracks of tracker f at one scan."""
    manoeuvre, association = trackers.manoeuvre[f], trackers.association[f]
    predict(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, work.predicted)
    associate(field, association_rule(trackers, f), scan, tracks, work.status[f], target, work, counts)
    update(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, association == PDA, work.association)


# ---- blocks ----------------------------------------------------------------------------------------------------------
@part
def measure_target(world, first, k, plots, z, shift):
    """Write the target's plots at scan k to z (2, CHUNK), and its deviation from its course to shift (2, 3, CHUNK).

    In realisations from number `first` on; plots (2, 4, CHUNK) as in `move_and_measure`."""
    move_and_measure(world, first, k, plots)
    for c in range(2):
        copy_row(plots[c, 0], z[c])
        copy_row(plots[c, 2], shift[c, 0])
        copy_row(plots[c, 3], shift[c, 1])


@kernel
def simulate_block(world, detections, field, trackers, work, first, total, sums):
    """Add the sums of the target's tracks in realisations first … first + total - 1 to sums, a TrackSums."""
    F, K, status = trackers.gate.size, world.dt.size, work.status
    plots, shift, z = np.empty((2, 4, CHUNK)), np.zeros((2, 3, CHUNK)), np.empty((2, CHUNK))
    detected, used, plot_counts = np.empty(CHUNK), np.ones(CHUNK), np.empty((F, CHUNK))
    counts, scratch, target = np.zeros(COUNTS), np.empty(7), Target(detected, z, True)
    for done in range(0, total, CHUNK):
        reset_tracks(work)
        plots[:], plot_counts[:] = 0.0, 0.0
        n = min(CHUNK, total - done)
        used[n:] = 0.0
        for k in range(K):
            scan, course = Scan(first + done, n, k, world.dt[k]), Course(world.truth[k], shift)
            measure_target(world, first + done, k, plots, z, shift)
            detect(detections, first + done, k, detected)
            for f in range(F):
                tracks = tracks_of_tracker(work, f)
                for c in range(2 if k > 0 else 0):
                    rows = rows_of(tracks.x[c], course, c, plot_counts[f], used)
                    add_ahead(rows, 2, scan.dt, address(scratch), sums.errors.ahead[f, k - 1, c])
                counts[:] = 0.0
                step_tracker(trackers, f, field, scan, tracks, target, work, counts)
                if trackers.association[f] == KNOWN:
                    judge_known_association(tracks, status[f], n, plot_counts[f], counts)
                else:
                    judge_target_track(trackers, f, n, tracks, status[f], course, plot_counts[f], counts)
                for j in range(COUNTS):
                    sums.counts[f, k, j] += counts[j]
                add_errors(trackers, tracks, f, k, course, plot_counts[f], used, scratch, sums.errors)
        for f in range(F):
            add_ratio(status[f, ENDS], status[f, CONFIRMED_SCANS], n, sums.ratios[f, ENDS_PER_SCAN])
            add_ratio(status[f, FALSE_WEIGHT], status[f, PLOTS_TAKEN], n, sums.ratios[f, WRONG_PER_PLOT])
            add_scores(trackers.thresholds, n, status[f, FIRST], status[f, BEST], sums.scores[0, f])


@kernel
def simulate_false_tracks(key, field, trackers, work, dt, first, total, sums):
    """Add the sums of tracks that false plots begin at scan 0: one plot a realisation, uniform over the sector.

    key (2,) of the stream of their positions; dt (K,) intervals before each scan."""
    z, detected, counts, undetected = np.empty((2, CHUNK)), np.ones(CHUNK), np.zeros(COUNTS), np.zeros(CHUNK)
    for done in range(0, total, CHUNK):
        reset_tracks(work)
        n = min(CHUNK, total - done)
        draw_uniform_positions(key, field, first + done, n, z)
        for f in range(trackers.gate.size):
            tracks, status = tracks_of_tracker(work, f), work.status[f]
            if trackers.association[f] == KNOWN:
                continue
            for k in range(dt.size):
                target = Target(detected if k == 0 else undetected, z, k == 0)
                step_tracker(trackers, f, field, Scan(first + done, n, k, dt[k]), tracks, target, work, counts)
                if not judge_false_tracks(trackers, f, n, tracks, status, sums.begun[f, k]):
                    break
            add_scores(trackers.thresholds, n, status[FIRST], status[BEST], sums.scores[1, f])
