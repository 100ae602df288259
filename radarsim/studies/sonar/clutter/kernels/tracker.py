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

    errors: "Sums"  #: of the tracks kept, as in all parts of the sonar.
    #: (F, K, COUNTS) numbers of realisations that at a scan have a tentative track of the target (TRYING) or a
    #: confirmed one (KEPT), confirm their first one (FOUND), lose a confirmed one (LOST) or drop it (DROPPED), or drop
    #: a tentative one (FAILED); then, of settled tracks, the number that looked for a plot (LOOKED), of the target's
    #: plots (PLOTS), of those in the gate (INSIDE), of false plots in the gate (FALSE), and the expected number of
    #: these (EXPECTED).
    counts: np.ndarray
    #: (F, K, FALSE_COUNTS) numbers of tracks begun by false plots that are tentative, are confirmed, and become
    #: confirmed.
    begun: np.ndarray
    #: (F, RATIOS, 5) Σa, Σa², Σb, Σb², Σab over realisations: a ends of tracks and b scans held (ENDS_PER_SCAN); a
    #: weight of false plots and b plots taken (WRONG_PER_PLOT).
    ratios: np.ndarray
    #: (2, F, T + 1) numbers of the target's first tracks, and of false ones, whose score reached each of T thresholds,
    #: and last the number of all these tracks.
    scores: np.ndarray


def shapes(F: int, K: int, T: int) -> dict[str, tuple[int, ...]]:
    """Shapes of these sums except the errors, for F trackers, K scans and T thresholds of the score."""
    return {"counts": (F, K, COUNTS), "begun": (F, K, FALSE_COUNTS), "ratios": (F, RATIOS, 5), "scores": (2, F, T + 1)}


# ---- gate ------------------------------------------------------------------------------------------------------------
LEAST_DENSITY = 1e-9  # per m², in scores: without false plots a score would be infinite
OPEN = 1e30  # χ² of a gate that contains everything
CLOSEST = 1.0  # m: the least range at which densities and gates are computed, should a track pass through the sonar
LEAST = 1e-300  # least likelihood that counts: the reciprocal of a smaller one may be infinite
NEAREST, PDA, KNOWN = range(3)


class Rule(NamedTuple):
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


class Gated(NamedTuple):
    """Plots in a gate so far: their number, that of false ones; d and innovation of the nearest, 1 if it is false.

    Then, weighted with the likelihoods e: Σe, Σe of false plots, mean innovation and scatter (rr, rb, bb) about it."""

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
    """What a track takes of the plots in its gate."""

    nu_r: float  #: innovation in range
    nu_b: float  #: innovation in bearing
    rr: float  #: of the additional covariance V
    rb: float
    bb: float
    taken: float  #: 1 if any plot is taken, else 0
    false_share: float  #: weight of false plots among them
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
    return Gated(0.0, 0.0, OPEN, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@inline
def distance_squared(nu_r, nu_b, S_inverse):
    """νᵀ S⁻¹ ν."""
    return S_inverse[0] * nu_r * nu_r + 2.0 * S_inverse[1] * nu_r * nu_b + S_inverse[2] * nu_b * nu_b


@inline
def with_plot(gated, nu_r, nu_b, false, S_inverse, threshold):
    """The plots in a gate with one more of innovation (nu_r, nu_b), if its d is at most the threshold; false 1 or 0.

    The weighted mean and scatter are updated plot by plot (West 1979): the scatter of a single plot is exactly zero."""
    count, false_count, least, r, b, nearest_false, weight, false_weight, mean_r, mean_b, rr, rb, bb = gated
    d = distance_squared(nu_r, nu_b, S_inverse)
    if d > threshold:
        return gated
    count, false_count = count + 1.0, false_count + false
    if d < least:
        least, r, b, nearest_false = d, nu_r, nu_b, false
    e = math.exp(-0.5 * d)
    if e > LEAST:
        weight, false_weight = weight + e, false_weight + e * false
        share, off_r, off_b = e / weight, nu_r - mean_r, nu_b - mean_b
        mean_r, mean_b = mean_r + share * off_r, mean_b + share * off_b
        rr, rb = rr + e * (off_r * (nu_r - mean_r)), rb + e * (off_r * (nu_b - mean_b))
        bb = bb + e * (off_b * (nu_b - mean_b))
    return Gated(count, false_count, least, r, b, nearest_false, weight, false_weight, mean_r, mean_b, rr, rb, bb)


@inline
def associated(gated, rule, r, S, settled):
    """The Association of a track at range r from the plots in its gate.

    This is Bar-Shalom's parametric filter (Bar-Shalom, Daum, Huang 2009). With b = λ 2π √|S| (1 - P_D P_G) / P_D, no
    plot is the target's with probability β₀ = b / (b + Σe), and the covariance exceeds that after a certain plot by
    K (β₀ S + scatter) Kᵀ. λ is the density in range and bearing: the density per m² times the range. The score is the
    logarithm of the likelihood ratio of all plots in the gate, with a target against without. A track of one plot (not
    settled) takes the nearest."""
    r = max(r, CLOSEST)
    density, root = rule.density * r, 2.0 * math.pi * math.sqrt(S[0] * S[2] - S[1] * S[1])
    missed = 1.0 - rule.detection * rule.inside
    ratio = missed + rule.detection * gated.weight / (root * max(density, LEAST_DENSITY * r))
    score = log_polynomial(max(ratio, 1e-12))
    if gated.count == 0.0:
        return Association(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, score)
    none = density * root * missed / rule.detection
    if rule.association != PDA or not settled or none + gated.weight == 0.0:
        return Association(gated.nu_r, gated.nu_b, 0.0, 0.0, 0.0, 1.0, gated.nearest_false, score)
    beta0 = none / (none + gated.weight)
    # In an open gate all plots may be so far away that their likelihoods are zero.
    some, per = 1.0 - beta0, 1.0 / gated.weight if gated.weight > 0.0 else 0.0
    mean_r, mean_b = gated.mean_r, gated.mean_b
    return Association(
        some * mean_r,
        some * mean_b,
        beta0 * S[0] + some * (gated.rr * per + beta0 * (mean_r * mean_r)),
        beta0 * S[1] + some * (gated.rb * per + beta0 * (mean_r * mean_b)),
        beta0 * S[2] + some * (gated.bb * per + beta0 * (mean_b * mean_b)),
        1.0,
        gated.false_weight * per,
        score,
    )


@kernel
def associate_innovations(rule, settled, r, S, nu_r, nu_b):
    """The Association of a track at range r with innovation covariance S (rr, rb, bb), from plots' innovations (n,)."""
    irr, irb, ibb, _ = inverse_two(S[0], S[1], S[2])
    gated = empty_gate()
    for i in range(nu_r.size):
        gated = with_plot(gated, nu_r[i], nu_b[i], 0.0, (irr, irb, ibb), rule.gate)
    return associated(gated, rule, r, S, settled)


# ---- sums ------------------------------------------------------------------------------------------------------------
@part
def add_scores(thresholds, n, first, best, scores):
    """Add to scores (T + 1,) the number of first tracks whose score reached each threshold, and that of first tracks.

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
def add_errors(trackers, tracks, f, k, course, kept, used, out, sums):
    """Add the errors of the tracks kept of tracker f at scan k, in range and in bearing; out (7,) is scratch."""
    size = tracks.x.shape[0]  # two; were it a constant, the compiler would unroll the loop and compile everything twice
    for c in range(size):
        rows, units = rows_of(tracks.x[c], course, c, kept, used), (trackers.sigma[c], trackers.period)
        add_sums(rows, tracks.P[c], size, tracks.x[c], 0, units, (f, k, c), out, sums)


# ---- tracks ----------------------------------------------------------------------------------------------------------
STARTED = 2.0  # plots from which a line is no longer least squares


class Tracks(NamedTuple):
    """A chunk of tracks of one tracker; lines in range and in bearing."""

    x: np.ndarray  #: (2, 4, CHUNK) states of each line
    Y: np.ndarray  #: (2, 8, CHUNK) information, as in `steps`
    P: np.ndarray  #: (2, 6, CHUNK) covariance
    C: np.ndarray  #: (4, CHUNK) covariance between the lines
    plots: np.ndarray  #: (CHUNK,) so far


def no_tracks() -> Tracks:
    """A chunk without a track."""
    shapes = ((2, 4, CHUNK), (2, 8, CHUNK), (2, 6, CHUNK), (4, CHUNK), (CHUNK,))
    return Tracks(*(aligned_zeros(*shape) for shape in shapes))


@kernel
def clear(tracks, i):
    """Clear the place of track i."""
    tracks.x[:, :, i], tracks.Y[:, :, i], tracks.P[:, :, i] = 0.0, 0.0, 0.0
    tracks.C[:, i], tracks.plots[i] = 0.0, 0.0


# ---- prediction ---------------------------------------------------------------------------------------------------
@inline
def predicted_line(P, n, tau, q):
    """Covariance (6) of a line after tau periods."""
    moved = predicted_covariance(P, constant_acceleration(tau), steps.manoeuvre_covariance(q, tau, 2))
    return choose6(full(STARTED), n, P, moved)


@inline
def predicted_between(C, tau):
    """F C Fᵀ of the covariance between the lines, after tau periods."""
    top, low = C[0] + tau * C[2], C[1] + tau * C[3]
    return top + tau * low, low, C[2] + tau * C[3], C[3]


@kernel
def predict(tracks, dt, period, sigma, manoeuvre, forecast):
    """Write positions and innovation covariances after dt to forecast (5, CHUNK): r, b, S (rr, rb, bb); in m, rad.

    sigma (2,) of a nominal plot; manoeuvre (2,) variances q of the lines."""
    ar, ab, pr, pb = address(tracks.x[0]), address(tracks.x[1]), address(tracks.P[0]), address(tracks.P[1])
    ac, an, out, tau = address(tracks.C), address(tracks.plots), address(forecast), dt / period
    rr, rb, bb, F = sigma[0] * sigma[0], sigma[0] * sigma[1], sigma[1] * sigma[1], constant_acceleration(dt)
    for i in range(GROUPS):
        n, (r, _, _), (b, _, _) = get(an, i), predicted(get3(ar, i, GROUPS), F), predicted(get3(ab, i, GROUPS), F)
        P_r = predicted_line(get6(pr, i, GROUPS), n, tau, manoeuvre[0])
        P_b = predicted_line(get6(pb, i, GROUPS), n, tau, manoeuvre[1])
        C, _, _, _ = predicted_between(get4(ac, i, GROUPS), tau)
        put(out, i, r)
        put(out, GROUPS + i, b)
        put(out, 2 * GROUPS + i, rr * (P_r[0] + 1.0))
        put(out, 3 * GROUPS + i, rb * C)
        put(out, 4 * GROUPS + i, bb * (P_b[0] + 1.0))


# ---- update -------------------------------------------------------------------------------------------------------
@inline
def updated_line(P, start, n, w):
    """Gain K (3) and covariance P (6) of a line after a plot; start (K, P) are those of least squares."""
    P, K, _ = take_value(P, 1.0, w)
    first = full(STARTED)
    return choose3(first, n, start[0][:3], K), choose6(first, n, start[1], P)


@inline
def transposed(C):
    """Cᵀ: the covariance between the lines in the other order."""
    return C[0], C[2], C[1], C[3]


@inline
def updated_pair(P, P_other, C, start, n, w):
    """Both lines after a plot of one: gains K and K_other (2), covariances P and P_other (6), and C (4) between them. P
    belongs to the line that has the plot, start (K, P) its least squares; C is that line by the other."""
    h = (C[0], C[1])  # covariance of the measured value with the other line
    scale = w / (P[0] + 1.0)
    K, P = updated_line(P, start, n, w)
    K_other = (h[0] * scale, h[1] * scale)
    P_other = add_outer(P_other, full(0.0) - scale, (h[0], h[1], 0.0))
    C = (C[0] - K[0] * h[0], C[1] - K[0] * h[1], C[2] - K[1] * h[0], C[3] - K[1] * h[1])
    return K, K_other, P, P_other, C


@inline
def with_scatter(P, K, L, V):
    """P (6) of a line plus [K L] V [K L]ᵀ, K and L its gains (2) for the two innovations."""
    u0, u1 = V[0] * K[0] + V[1] * L[0], V[0] * K[1] + V[1] * L[1]
    v0, v1 = V[1] * K[0] + V[2] * L[0], V[1] * K[1] + V[2] * L[1]
    xx, xv, vv = P[0] + u0 * K[0] + v0 * L[0], P[1] + u0 * K[1] + v0 * L[1], P[3] + u1 * K[1] + v1 * L[1]
    return xx, xv, P[2], vv, P[4], P[5]


@inline
def between_with_scatter(C, K_r, K_b, V):
    """C (4) plus [K_rr K_rb] V [K_br K_bb]ᵀ; K_r and K_b are these pairs of gains."""
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
def jointly_updated(P, C, starts, n, w, V):
    """Both lines after a plot that may not be the target's: gains (K_rr, K_br, K_rb, K_bb), P (P_r, P_b), and C.

    The range of the plot is processed first, then its bearing: K_rb and K_bb are gains for the part of the innovation
    in bearing that the innovation in range does not explain. starts are the least squares (K, P) of both lines."""
    K_rr, K_br, P_r, P_b, C = updated_pair(P[0], P[1], C, starts[0], n, w)
    K_bb, K_rb, P_b, P_r, C = updated_pair(P_b, P_r, transposed(C), starts[1], n, w)
    # Gains for the two innovations, both processed at once.
    K_r = ((K_rr[0] - K_rb[0] * K_br[0], K_rr[1] - K_rb[1] * K_br[0]), K_rb)
    K_b = ((K_br[0] - K_bb[0] * K_br[0], K_br[1] - K_bb[1] * K_br[0]), K_bb)
    P_r, P_b = with_scatter(P_r, K_r[0], K_r[1], V), with_scatter(P_b, K_b[0], K_b[1], V)
    return (K_rr, K_br, K_rb, K_bb), (P_r, P_b), between_with_scatter(transposed(C), K_r, K_b, V)


@kernel
def update(tracks, dt, period, sigma, manoeuvre, joint, association):
    """Update all tracks with one scan, in place; association (6, CHUNK) is what `tracker.associate` writes.

    Its rows: 1 if a plot is taken, else 0; innovations in range and bearing; V (rr, rb, bb), in m and rad. joint: V may
    differ from zero."""
    ar, ab, pr, pb = address(tracks.x[0]), address(tracks.x[1]), address(tracks.P[0]), address(tracks.P[1])
    yr, yb, ac, an = address(tracks.Y[0]), address(tracks.Y[1]), address(tracks.C), address(tracks.plots)
    at, tau, per, F = address(association), dt / period, 1.0 / period, constant_acceleration(dt)
    r_per_b, b_per_r, per_r, per_b = sigma[0] / sigma[1], sigma[1] / sigma[0], 1.0 / sigma[0], 1.0 / sigma[1]
    for i in range(GROUPS):
        n, w, nu_r, nu_b = get(an, i), get(at, i), get(at, GROUPS + i), get(at, 2 * GROUPS + i)
        (r, vr, _), (b, vb, _) = predicted(get3(ar, i, GROUPS), F), predicted(get3(ab, i, GROUPS), F)
        Y_r, K_start_r, P_start_r = least_squares(get_information(yr, i), n, w, tau, 0.0, 2)
        Y_b, K_start_b, P_start_b = least_squares(get_information(yb, i), n, w, tau, 0.0, 2)
        P_r = predicted_line(get6(pr, i, GROUPS), n, tau, manoeuvre[0])
        P_b = predicted_line(get6(pb, i, GROUPS), n, tau, manoeuvre[1])
        if joint:
            rr, rb = per_r * per_r * get(at, 3 * GROUPS + i), per_r * per_b * get(at, 4 * GROUPS + i)
            V = (rr, rb, per_b * per_b * get(at, 5 * GROUPS + i))
            starts = ((K_start_r, P_start_r), (K_start_b, P_start_b))
            C = predicted_between(get4(ac, i, GROUPS), tau)
            K, (P_r, P_b), C = jointly_updated((P_r, P_b), C, starts, n, w, V)
            K_rr, K_br, K_rb, K_bb = K
            put4(ac, i, C, GROUPS)
            nu_b = nu_b - (b_per_r * K_br[0]) * nu_r
            r, vr = r + (r_per_b * K_rb[0]) * nu_b, vr + (per * r_per_b * K_rb[1]) * nu_b
            b, vb = b + (b_per_r * K_br[0]) * nu_r, vb + (per * b_per_r * K_br[1]) * nu_r
        else:
            K_rr, P_r = updated_line(P_r, (K_start_r, P_start_r), n, w)
            K_bb, P_b = updated_line(P_b, (K_start_b, P_start_b), n, w)
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
STATE, AGE, HITS, MISSES, SINCE, SCORE, BEST, FIRST, BEFORE, ENDS, HELD, WRONG, TAKEN = range(ROWS)


@kernel
def next_state(state, hits, misses, age, m, n, most):
    """State of a track after a scan, by the rule m of n and that of misses."""
    if state == TENTATIVE:
        if hits >= m:
            return CONFIRMED
        return TENTATIVE if hits + (n - age) >= m else NONE
    return NONE if misses >= most else CONFIRMED


@part
def judge_known(tracks, status, n, kept, counts):
    """Tracks of a filter that knows the target's plots are kept from their second plot on; arguments as of `judge`."""
    plots = tracks.plots
    for i in range(n):
        kept[i] = 0.0
        if status[STATE, i] == NONE:
            continue
        kept[i] = 2.0 if plots[i] > 1.5 else 0.0
        status[STATE, i] = CONFIRMED if kept[i] > 0.0 else TENTATIVE
        counts[KEPT] += kept[i] > 0.0
        status[HELD, i] += kept[i] > 0.0


@inline
def off_target(tracks, course, limit, i):
    """Whether the track of realisation i is further from the target than limit (r, b), in m and rad."""
    x, truth, shift = tracks.x, course.truth, course.shift
    off = abs(x[0, 0, i] - truth[0, 0] - shift[0, 0, i]) > limit[0]
    return off | (abs(x[1, 0, i] - truth[1, 0] - shift[1, 0, i]) > limit[1])


@part
def judge(trackers, f, n, tracks, status, course, kept, counts):
    """Apply the rules to the target's track in n realisations after a scan; kept (CHUNK,) is 2 where there is one.

    A confirmed track ends when it is dropped, either for misses or because its position has become too uncertain, or
    when it is lost: too far from the target."""
    limit, m, of, misses = trackers.lost[f], trackers.m[f], trackers.n[f], trackers.misses[f]
    P, beyond = tracks.P, (limit * trackers.sigma[0], limit * trackers.sigma[1])
    for i in range(n):
        state = status[STATE, i]
        kept[i] = 0.0
        if state == NONE:
            continue
        now = next_state(state, status[HITS, i], status[MISSES, i], status[AGE, i], m, of, misses)
        if now == CONFIRMED:
            off = off_target(tracks, course, beyond, i)
            uncertain = max(P[0, 0, i], P[1, 0, i]) > limit * limit
            if state == CONFIRMED and (off or uncertain):
                counts[LOST if off else DROPPED] += 1.0
                now = NONE
            elif off:  # confirmed on other plots than the target's
                counts[FAILED] += 1.0
                now = NONE
        elif now == NONE:
            counts[DROPPED if state == CONFIRMED else FAILED] += 1.0
        if now == CONFIRMED:
            kept[i] = 2.0
            counts[KEPT] += 1.0
            status[HELD, i] += 1.0
            counts[FOUND] += status[BEFORE, i] == 0.0
            status[BEFORE, i] = 1.0
        elif now == TENTATIVE:
            counts[TRYING] += 1.0
        elif state == CONFIRMED:
            status[ENDS, i] += 1.0
        if now == NONE:
            status[FIRST, i] = 0.0
        status[STATE, i] = now


@part
def judge_false(trackers, f, n, tracks, status, begun):
    """Apply the rules to every track that a false plot began; returns whether any is left."""
    limit, m, of, misses = trackers.lost[f] * trackers.lost[f], trackers.m[f], trackers.n[f], trackers.misses[f]
    P, left = tracks.P, False
    for i in range(n):
        state = status[STATE, i]
        if state == NONE:
            continue
        now = next_state(state, status[HITS, i], status[MISSES, i], status[AGE, i], m, of, misses)
        if state == CONFIRMED and max(P[0, 0, i], P[1, 0, i]) > limit:
            now = NONE
        begun[FALSE_TRYING] += now == TENTATIVE
        begun[FALSE_KEPT] += now == CONFIRMED
        begun[FALSE_FOUND] += now == CONFIRMED and state == TENTATIVE
        status[STATE, i] = now
        left |= now != NONE
    return left


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
    """A field without its arrays, references to which would be counted at each call. The two words of the key, the
    address of the distribution function, and the cells."""

    k0: int
    k1: int
    share: int
    cells: Cells


@inline
def draws_of(field):
    """The draws of a field, which must outlive them."""
    return Draws(field.key[0], field.key[1], address(field.share), field.cells)


@inline
def number_in(share, u):
    """Number of plots in a cell: the first index at which the distribution function exceeds the uniform number u.

    share is the address of the distribution function, whose last value is 1."""
    n = 0
    while u >= share[n]:
        n += 1
    return n


@inline
def cell_words(k0, k1, realisation, cell, draw):
    """Two random words of a cell; cells are numbered through all scans. The first word of draw 0 gives the number of
    plots, and each further word the position of one of them."""
    return threefry(U(realisation), (U(cell) << U(DRAW_BITS)) + U(draw), k0, k1)


@inline
def place_in(k0, k1, realisation, cell, n, spare):
    """Position of plot n in a cell, each coordinate from 0 to 1, by the halves of a word; and the spare word after it.
    Words come two at a time; the first spare one is that beside the word of the number of plots."""
    word = spare
    if n % 2 == 1:
        word, spare = cell_words(k0, k1, realisation, cell, (n + 1) // 2)
    return np.float64(word >> U(32)) * 2.0**-32 + 2.0**-33, np.float64(word & HALF) * 2.0**-32 + 2.0**-33, spare


@inline
def touched(low, high, least, step, count):
    """First and last cell that the interval low … high touches, of `count` cells of size step from `least` on. Floors
    stay floating-point numbers, because an open gate reaches further than an integer can."""
    first = min(max(np.floor((low - least) / step), 0.0), count - 1.0)
    last = min(max(np.floor((high - least) / step), -1.0), count - 1.0)
    return int(first), int(last)


# ---- false plots in a gate and in the whole sector ----------------------------------------------------------------
@inline
def with_false_plots(gated, draws, realisation, scan, gate, threshold):
    """The plots in a gate with all false ones of a scan in addition."""
    irr, irb, ibb, _ = inverse_two(gate.S[0], gate.S[1], gate.S[2])
    r, b = gate.r, gate.b
    q0, dq, nq, b0, db, nb, ring, _ = draws.cells
    wide, high = math.sqrt(threshold * gate.S[0]), math.sqrt(threshold * gate.S[2])
    near, far = max(r - wide, 0.0), r + wide
    least, most = 0.5 * near * near, 0.5 * far * far
    i_first, i_last = touched(least, most, q0, dq, nq)
    if ring:
        high = min(high, 0.5 * nb * db)
        j_first, j_last = math.floor((b - high - b0) / db), math.floor((b + high - b0) / db)
        j_last = min(j_last, j_first + nb)  # the same column at both ends of a full turn: half a turn to each side
    else:
        b -= TURN * np.floor(
            (b - b0) / TURN - 0.5 * nb * db / TURN + 0.5
        )  # less whole turns from the middle of the sector
        j_first, j_last = touched(b - high, b + high, b0, db, nb)
    for i in range(i_first, i_last + 1):
        for j in range(j_first, j_last + 1):
            column = j if 0 <= j < nb else j % nb
            cell = (scan * nq + i) * nb + column
            u, spare = cell_words(draws.k0, draws.k1, realisation, cell, 0)
            for n in range(number_in(draws.share, uniform(u))):
                u_q, u_b, spare = place_in(draws.k0, draws.k1, realisation, cell, n, spare)
                q, off = q0 + dq * (i + u_q), b0 + db * (j + u_b) - b
                if least <= q <= most and abs(off) <= high:  # roots are slow
                    gated = with_plot(gated, math.sqrt(2.0 * q) - r, off, 1.0, (irr, irb, ibb), threshold)
    return gated


@part
def area_within(gate, det, threshold, cells):
    """Area in m² of a gate's part within the sector; det is |S|. A gate that reaches over an edge is integrated as the
    unit disc u² + v² ≤ 1, with r = r₀ + s u, b = b₀ + c u + h v: over u between the edges in range, the weight is r,
    and v runs from the arc or an edge in bearing to the other."""
    s, high = math.sqrt(threshold * gate.S[0]), math.sqrt(threshold * gate.S[2])
    least, most = math.sqrt(2.0 * cells.q0), math.sqrt(2.0 * (cells.q0 + cells.dq * cells.nq))
    half, off = 0.5 * cells.nb * cells.db, 0.0  # the gate's middle from that of the sector, less whole turns
    if not cells.ring:
        off = gate.b - cells.b0 - half
        off -= TURN * np.floor(off / TURN + 0.5)
    if gate.r - s >= least and gate.r + s <= most and abs(off) + high <= half:
        return gate.r * np.pi * threshold * math.sqrt(det)
    c, h = s * gate.S[1] / gate.S[0], math.sqrt(threshold * det / gate.S[0])
    begin, end = (least - gate.r) / s, (most - gate.r) / s
    furthest = 0.0
    for side in (begin, end):
        for edge in (-half - off, half - off):
            furthest = max(furthest, side**2 + ((edge - c * side) / h) ** 2)
    if furthest <= 1.0:  # an ellipse that holds the corners holds the sector
        return cells.dq * cells.nq * cells.db * cells.nb
    area, u, end = 0.0, max(begin, -1.0), min(end, 1.0)
    while u < end:  # to where an edge in bearing next cuts the circle
        to = end
        for edge in (-half - off, half - off):
            root = high * high - edge * edge
            if root > 0.0:
                for sign in (-1.0, 1.0):
                    cut = (edge * c + sign * h * math.sqrt(root)) / (high * high)
                    to = cut if u < cut < to else to
        middle = 0.5 * (u + to)
        arc = math.sqrt(1.0 - middle * middle)
        low, top = (-half - off - c * middle) / h, (half - off - c * middle) / h
        if top > -arc and low < arc:
            weight = (gate.r, s, u, to)
            area += arc_moment(weight) if top > arc else line_moment(weight, (half - off) / h, -c / h)
            area += arc_moment(weight) if low < -arc else line_moment(weight, (half + off) / h, c / h)
        u = to
    return h * s * area


@inline
def arc_moment(weight):
    """∫ (r + s u) √(1 − u²) du from begin to end; weight = (r, s, begin, end)."""
    r, s, begin, end = weight
    a, b = math.sqrt(1.0 - begin * begin), math.sqrt(1.0 - end * end)
    turned = end * b - begin * a + math.asin(end) - math.asin(begin)
    return 0.5 * r * turned + s * (a * a * a - b * b * b) / 3.0


@inline
def line_moment(weight, at, slope):
    """∫ (r + s u) (at + slope u) du, likewise."""
    r, s, begin, end = weight
    first, second, third = end - begin, (end**2 - begin**2) / 2.0, (end**3 - begin**3) / 3.0
    return r * at * first + (r * slope + s * at) * second + s * slope * third


@part
def even_places(key, field, first, n, z):
    """Write positions drawn uniformly over the sector, one a realisation from `first` on, to z (2, ≥ n)."""
    q0, dq, nq, b0, db, nb, _, _ = field.cells
    for i in range(n):
        u, v = uniforms(key[0], key[1], first + i, 0)
        z[0, i] = np.sqrt(2.0 * (q0 + dq * nq * u))
        z[1, i] = b0 + db * nb * v


@part
def insert(plot, total, into):
    """Put a plot (r, b, whether it is the target's) among `total` in order of bearing, into (3, M) if there is room."""
    if total < into.shape[1]:
        at = total
        while at > 0 and into[1, at - 1] > plot[1]:
            into[0, at], into[1, at], into[2, at] = into[0, at - 1], into[1, at - 1], into[2, at - 1]
            at -= 1
        into[0, at], into[1, at], into[2, at] = plot
    return total + 1


@kernel
def fill_scans(field, first, scan, own, there, plots):
    """All plots of n realisations from `first` on and K scans from `scan` on, into plots (n, K, 3, M): range, bearing
    and 1 of the target's, 0 of others, in order of bearing; the rest is not-a-number.

    own (2, n, K) the target's, where `there` (n, K). Returns the most plots of a scan, even if more than fit."""
    k0, k1, share, most = field.key[0], field.key[1], address(field.share), 0
    q0, dq, nq, b0, db, nb, _, density = field.cells
    for i in range(there.shape[0]):
        for k in range(there.shape[1]):
            into, total = plots[i, k], 0
            if there[i, k]:
                total = insert((own[0, i, k], own[1, i, k], 1.0), total, into)
            for cell in range(nq * nb if density > 0.0 else 0):  # bearing by bearing, so that little is out of order
                a, j = cell % nq, cell // nq
                number = (scan + k) * (nq * nb) + a * nb + j
                u, spare = cell_words(k0, k1, first + i, number, 0)
                for n in range(number_in(share, uniform(u))):
                    u_q, u_b, spare = place_in(k0, k1, first + i, number, n, spare)
                    total = insert((math.sqrt(2.0 * (q0 + dq * (a + u_q))), b0 + db * (j + u_b), 0.0), total, into)
            most = max(most, total)
            into[:, total:] = np.nan
    return most


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
    """Work arrays of a chunk for F trackers: the fields of `Tracks` and the status (F, ROWS, CHUNK) of each, and for
    one tracker at a time the predictions (5, CHUNK) and associations (6, CHUNK), as in `tracks`."""

    x: np.ndarray
    Y: np.ndarray
    P: np.ndarray
    C: np.ndarray
    plots: np.ndarray
    status: np.ndarray
    predicted: np.ndarray
    association: np.ndarray


class Scan(NamedTuple):
    """Scan k of a chunk, dt after the scan before: `count` realisations from number `first` on."""

    first: int
    count: int
    k: int
    dt: float


class Target(NamedTuple):
    """The target's plots at a scan: detected (CHUNK,) 1 or 0, z (2, CHUNK); begins: whether they begin tracks."""

    detected: np.ndarray
    z: np.ndarray
    begins: bool


def workspace(count: int) -> Workspace:
    """Work arrays of this many trackers."""
    shapes = ((2, 4), (2, 8), (2, 6), (4,), (), (ROWS,))
    own = [aligned_zeros(count, *shape, CHUNK) for shape in shapes]
    return Workspace(*own, aligned_zeros(5, CHUNK), aligned_zeros(6, CHUNK))


@part
def reset(work):
    """Set the work arrays to a state without any tracks."""
    work.x[:], work.Y[:], work.P[:], work.C[:] = 0.0, 0.0, 0.0, 0.0
    work.plots[:], work.status[:], work.association[:] = 0.0, 0.0, 0.0
    work.status[:, FIRST] = -1.0


@inline
def tracks_of(work, f):
    """The tracks of tracker f."""
    return Tracks(work.x[f], work.Y[f], work.P[f], work.C[f], work.plots[f])


@inline
def rule_of(trackers, f):
    """How tracker f chooses among plots."""
    association, gate, inside, speed = trackers.association[f], trackers.gate[f], trackers.inside[f], trackers.speed[f]
    return Rule(association, gate, trackers.detection, inside, trackers.density, speed)


# ---- association --------------------------------------------------------------------------------------------------
@inline
def associate_track(draws, rule, realisation, k, plot, gate, counts):
    """The Association of one track at scan k; counts is the address of the scan's counts.

    plot is 1 if there is a plot of the target, else 0, with its range and bearing."""
    gated, known = empty_gate(), rule.association == KNOWN
    nu_r, nu_b = plot[1] - gate.r, plot[2] - gate.b
    irr, irb, ibb, det = inverse_two(gate.S[0], gate.S[1], gate.S[2])
    S_inverse = (irr, irb, ibb)
    if plot[0] > 0.0:
        gated = with_plot(gated, nu_r, nu_b, 0.0, S_inverse, OPEN if known else rule.gate)
        if gate.settled:
            counts[PLOTS] += 1.0
            counts[INSIDE] += distance_squared(nu_r, nu_b, S_inverse) <= rule.gate
    cells = draws.cells
    if cells.density > 0.0:
        among_false = with_false_plots(gated, draws, realisation, k, gate, rule.gate)
        if gate.settled:
            counts[FALSE] += among_false.false_count
            counts[EXPECTED] += cells.density * area_within(gate, det, rule.gate, cells)
        gated = gated if known else among_false
    if gate.settled:
        counts[LOOKED] += 1.0
    return associated(gated, rule, gate.r, gate.S, gate.settled)


@part
def begin(tracks, status, i, z, association):
    """Begin a track with one plot."""
    clear(tracks, i)
    association[:, i] = 0.0
    association[0, i], association[1, i], association[2, i] = 1.0, z[0, i], z[1, i]
    status[STATE, i], status[AGE, i], status[HITS, i], status[MISSES, i] = (TENTATIVE, 1.0, 1.0, 0.0)
    status[SINCE, i], status[SCORE, i], status[FIRST, i] = (0.0, 0.0, 0.0 if status[FIRST, i] >= 0.0 else 1.0)


@inline
def gate_of(place, S, settled, reach):
    """The gate of a track; the velocity after one plot is unknown, and a target may have moved by `reach`, in m."""
    r, b = place
    if not settled:
        S = (S[0] + reach * reach, S[1], S[2] + (reach / max(r, CLOSEST)) ** 2)
    return Gate(r, b, S, settled)


@inline
def settle(status, i, found, out):
    """Write the Association of track i to the rows of out (6, CHUNK), and count it in the track's status (ROWS, CHUNK).

    Both are addresses: Numba may count references to arrays for every track."""
    rows = (found.taken, found.nu_r, found.nu_b, found.rr, found.rb, found.bb)
    for j in range(6):
        out[j * CHUNK + i] = rows[j]
    if status[STATE * CHUNK + i] == CONFIRMED:
        status[WRONG * CHUNK + i] += found.false_share
        status[TAKEN * CHUNK + i] += found.taken
    status[AGE * CHUNK + i] += 1.0
    score = status[SCORE * CHUNK + i] + found.score
    status[SCORE * CHUNK + i] = score
    if status[FIRST * CHUNK + i] > 0.0:
        status[BEST * CHUNK + i] = max(status[BEST * CHUNK + i], score)
    if found.taken > 0.0:
        status[HITS * CHUNK + i] += 1.0
        status[MISSES * CHUNK + i] = 0.0
        status[SINCE * CHUNK + i] = 0.0
    else:
        status[MISSES * CHUNK + i] += 1.0


@part
def associate(field, rule, scan, tracks, status, target, work, counts):
    """Associate a scan's plots with every track of a chunk; the results go to work.association (6, CHUNK).

    Its rows: 1 if a plot is taken, else 0; innovations (r, b) and their additional covariance V (rr, rb, bb). A track
    that begins here has the plot itself in place of the innovations."""
    # Arrays are taken out of their records once, because every access counts a reference.
    draws, out, tally, plots = draws_of(field), work.association, address(counts), tracks.plots
    detected, z, predicted, lives, taken = target.detected, target.z, work.predicted, address(status), address(out)
    for i in range(scan.count):
        if status[STATE, i] == NONE:
            out[:, i] = 0.0
            if target.begins and detected[i] > 0.0:
                begin(tracks, status, i, z, out)
            continue
        status[SINCE, i] += scan.dt
        place, S = (predicted[0, i], predicted[1, i]), (predicted[2, i], predicted[3, i], predicted[4, i])
        gate = gate_of(place, S, plots[i] > 1.5, rule.speed * status[SINCE, i])
        plot = (detected[i], z[0, i], z[1, i])
        found = associate_track(draws, rule, scan.first + i, scan.k, plot, gate, tally)
        settle(lives, i, found, taken)


@part
def step(trackers, f, field, scan, tracks, target, work, counts):
    """Predict, associate and update all tracks of tracker f at one scan."""
    manoeuvre, association = trackers.manoeuvre[f], trackers.association[f]
    predict(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, work.predicted)
    associate(field, rule_of(trackers, f), scan, tracks, work.status[f], target, work, counts)
    update(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, association == PDA, work.association)


# ---- blocks ----------------------------------------------------------------------------------------------------------
@part
def measure_target(world, first, k, plots, z, shift):
    """Write the target's plots at scan k to z (2, CHUNK), and where it has moved off its course to shift (2, 3, CHUNK).
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
    detected, used, kept = np.empty(CHUNK), np.ones(CHUNK), np.empty((F, CHUNK))
    counts, out, target = np.zeros(COUNTS), np.empty(7), Target(detected, z, True)
    for done in range(0, total, CHUNK):
        reset(work)
        plots[:], kept[:] = 0.0, 0.0
        n = min(CHUNK, total - done)
        used[n:] = 0.0
        for k in range(K):
            scan, course = Scan(first + done, n, k, world.dt[k]), Course(world.truth[k], shift)
            measure_target(world, first + done, k, plots, z, shift)
            detect(detections, first + done, k, detected)
            for f in range(F):
                tracks = tracks_of(work, f)
                for c in range(2 if k > 0 else 0):
                    rows = rows_of(tracks.x[c], course, c, kept[f], used)
                    add_ahead(rows, 2, scan.dt, address(out), sums.errors.ahead[f, k - 1, c])
                counts[:] = 0.0
                step(trackers, f, field, scan, tracks, target, work, counts)
                if trackers.association[f] == KNOWN:
                    judge_known(tracks, status[f], n, kept[f], counts)
                else:
                    judge(trackers, f, n, tracks, status[f], course, kept[f], counts)
                for j in range(COUNTS):
                    sums.counts[f, k, j] += counts[j]
                add_errors(trackers, tracks, f, k, course, kept[f], used, out, sums.errors)
        for f in range(F):
            add_ratio(status[f, ENDS], status[f, HELD], n, sums.ratios[f, ENDS_PER_SCAN])
            add_ratio(status[f, WRONG], status[f, TAKEN], n, sums.ratios[f, WRONG_PER_PLOT])
            add_scores(trackers.thresholds, n, status[f, FIRST], status[f, BEST], sums.scores[0, f])


@kernel
def simulate_false(key, field, trackers, work, dt, first, total, sums):
    """Add the sums of tracks that false plots begin at scan 0: one plot a realisation, uniform over the sector.

    key (2,) of the stream of their positions; dt (K,) intervals before each scan."""
    z, detected, counts, nothing = np.empty((2, CHUNK)), np.ones(CHUNK), np.zeros(COUNTS), np.zeros(CHUNK)
    for done in range(0, total, CHUNK):
        reset(work)
        n = min(CHUNK, total - done)
        even_places(key, field, first + done, n, z)
        for f in range(trackers.gate.size):
            tracks, status = tracks_of(work, f), work.status[f]
            if trackers.association[f] == KNOWN:
                continue
            for k in range(dt.size):
                target = Target(detected if k == 0 else nothing, z, k == 0)
                step(trackers, f, field, Scan(first + done, n, k, dt[k]), tracks, target, work, counts)
                if not judge_false(trackers, f, n, tracks, status, sums.begun[f, k]):
                    break
            add_scores(trackers.thresholds, n, status[FIRST], status[BEST], sums.scores[1, f])
