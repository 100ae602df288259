"""The layout of the sums of tracks among false plots, which kernels write and tables read."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from radarsim.studies.sonar.kernels.shared_gains import Sums

COUNTS = 11
TRYING, KEPT, FOUND, LOST, DROPPED, FAILED, LOOKED, PLOTS, INSIDE, FALSE, EXPECTED = range(COUNTS)
FALSE_COUNTS = 3
FALSE_TRYING, FALSE_KEPT, FALSE_FOUND = range(FALSE_COUNTS)
RATIOS = 2
ENDS_PER_SCAN, WRONG_PER_PLOT = range(RATIOS)


class TrackSums(NamedTuple):
    """Sums of a block, for F trackers over K scans.

    Attributes:
        errors: of the tracks kept, as in all parts of the sonar.
        counts: (F, K, COUNTS) numbers of realisations that at a scan have a tentative track of the target (TRYING) or
            a confirmed one (KEPT), confirm their first one (FOUND), lose a confirmed one (LOST) or drop it (DROPPED),
            or drop a tentative one (FAILED); then, of settled tracks, the number that looked for a plot (LOOKED), of
            the target's plots (PLOTS), of those in the gate (INSIDE), of false plots in the gate (FALSE), and the
            expected number of these (EXPECTED).
        begun: (F, K, FALSE_COUNTS) numbers of tracks begun by false plots that are tentative, are confirmed, and become
            confirmed.
        ratios: (F, RATIOS, 5) Σa, Σa², Σb, Σb², Σab over realisations: a ends of tracks and b scans held
            (ENDS_PER_SCAN); a weight of false plots and b plots taken (WRONG_PER_PLOT).
        scores: (2, F, T + 1) numbers of the target's first tracks, and of false ones, whose score reached each of T
            thresholds, and last the number of all these tracks.
    """

    errors: "Sums"
    counts: np.ndarray
    begun: np.ndarray
    ratios: np.ndarray
    scores: np.ndarray


def shapes(F: int, K: int, T: int) -> dict[str, tuple[int, ...]]:
    """Shapes of these sums except the errors, for F trackers, K scans and T thresholds of the score."""
    return {"counts": (F, K, COUNTS), "begun": (F, K, FALSE_COUNTS), "ratios": (F, RATIOS, 5), "scores": (2, F, T + 1)}
