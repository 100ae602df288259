"""Sums of tracks among false plots: their layout, and how kernels add to them.

Letters as in `sonar.kernels.sums`; f numbers trackers, c the lines in range and bearing, k scans."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from radarsim.kernels.compiler import kernel_part
from radarsim.studies.sonar.kernels.sums import add_sums, rows_of

if TYPE_CHECKING:
    from radarsim.studies.sonar.kernels.shared_gains import Sums


COUNTS = 11
(
    TENTATIVE_COUNT,
    CONFIRMED_COUNT,
    FIRST_CONFIRMED_COUNT,
    LOST_COUNT,
    DROPPED_COUNT,
    TENTATIVE_DROPPED_COUNT,
    GATE_COUNT,
    TARGET_PLOT_COUNT,
    PLOTS_IN_GATE_COUNT,
    FALSE_IN_GATE_COUNT,
    EXPECTED_FALSE_COUNT,
) = range(COUNTS)
FALSE_COUNTS = 3
FALSE_TENTATIVE, FALSE_CONFIRMED, FALSE_NEWLY_CONFIRMED = range(FALSE_COUNTS)
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


@kernel_part
def add_scores(thresholds, n, first, best, scores):
    """Count first tracks by the thresholds that their score reached, and all first tracks, in scores (T + 1,).

    first (CHUNK,) is negative where a realisation had no track; best (CHUNK,) is the greatest score of its first track.
    """
    for i in range(n):
        if first[i] >= 0.0:
            scores[thresholds.size] += 1.0
            for t in range(thresholds.size):
                scores[t] += best[i] >= thresholds[t]


@kernel_part
def add_ratio(a, b, n, ratio):
    """Add Σa, Σa², Σb, Σb², Σab over n realisations to ratio (5,)."""
    for i in range(n):
        ratio[0] += a[i]
        ratio[1] += a[i] * a[i]
        ratio[2] += b[i]
        ratio[3] += b[i] * b[i]
        ratio[4] += a[i] * b[i]


@kernel_part
def add_errors(trackers, tracks, f, k, course, plot_counts, used, scratch, sums):
    """Add the errors of tracker f at scan k, in range and in bearing; scratch (7,).

    plot_counts (CHUNK,) is 2 where a realisation has a confirmed track on the target, else 0."""
    size = tracks.x.shape[0]  # two; were it a constant, the compiler would unroll the loop and compile everything twice
    for c in range(size):
        rows, units = rows_of(tracks.x[c], course, c, plot_counts, used), (trackers.sigma[c], trackers.period)
        add_sums(rows, tracks.P[c], size, tracks.x[c], 0, units, (f, k, c), scratch, sums)
