"""Where each number stands in the sums of tracks among false plots; kernels add and tables read there."""

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
    """Sums of a block, of F trackers over K scans.

    Attributes:
        errors: of the tracks kept, as everywhere in the sonar.
        counts: (F, K, COUNTS) at each scan how many realisations have a tentative track of the target (TRYING) or a
            confirmed one (KEPT), confirm their first one (FOUND), lose a confirmed one (LOST) or drop it (DROPPED),
            drop a tentative one (FAILED); of settled tracks how many looked for a plot (LOOKED), the target's plots
            then (PLOTS), those in the gate (INSIDE), false plots in it (FALSE) and their expected number (EXPECTED).
        begun: (F, K, FALSE_COUNTS) how many tracks begun by false plots are tentative, are confirmed, and become so.
        ratios: (F, RATIOS, 5) Σa, Σa², Σb, Σb², Σab over realisations: of ends of tracks over scans held
            (ENDS_PER_SCAN), of the weight of false plots over plots taken (WRONG_PER_PLOT).
        scores: (2, F, T + 1) how many of the target's first tracks, and of false ones, reached each of T thresholds of
            the score, and last how many tracks there were.
    """

    errors: "Sums"
    counts: np.ndarray
    begun: np.ndarray
    ratios: np.ndarray
    scores: np.ndarray


def shapes(F: int, K: int, T: int) -> dict[str, tuple[int, ...]]:
    """Shapes of these sums but the errors, for F trackers, K scans and T thresholds of the score."""
    return {"counts": (F, K, COUNTS), "begun": (F, K, FALSE_COUNTS), "ratios": (F, RATIOS, 5), "scores": (2, F, T + 1)}
