"""The arrays that the kernels read and fill.

Letters: K scans, F filters, S laws of the noise (bursts of another signal-to-noise ratio), W windows of all designs.
"""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.hypotheses import COLUMNS
from radarsim.kernels.lanes import WIDTH, rows

NONE, BOUND, SEQUENCE, SPECTRUM = 0, 1, 2, 3  # how a filter's bursts are estimated
AS_MEASURED, GATED, MIXTURE = 0, 1, 2  # how it uses an estimate
# Counts of a scan's estimates: those within 5 and within 3 bounds of the truth; the sum of the weights with which they
# are taken; those taken in a wrong fold.
LOCKED, LOCKED_3, TAKEN, WRONG_FOLD, COUNTS = 0, 1, 2, 3, 4
# Counts of a filter that keeps hypotheses: realisations whose best one has no wrong fold, whose list holds one without;
# the number of hypotheses.
RIGHT, LISTED, NUMBER, FOLDS = 0, 1, 2, 3
AGES = 7  # classes of scans since a burst was lost: 0 … 5, then six and more, or none lost yet

FILTER = np.dtype(
    [
        ("kind", np.int64),  # NONE … SPECTRUM
        ("takes", np.int64),  # numbers that it takes of a burst: 0; 1 velocity; 2 also acceleration
        ("use", np.int64),  # AS_MEASURED … MIXTURE
        ("track", np.int64),  # whether its forecast is the track's prediction
        ("start", np.int64),  # scans without manoeuvre noise
        ("gate", np.float64),  # largest squared deviation in variances
        ("lock", np.float64),  # prior probability of lock
        ("density", np.float64),  # of an estimate that did not lock
        ("fixed", np.float64, 2),  # standard deviations of a forecast that is not the track's
        ("top", np.float64, 2),  # largest standard deviations of the menu: velocity, acceleration
        ("ratio", np.float64, 2),  # logarithm of the ratio of neighbouring standard deviations
        ("levels", np.int64, 2),  # number of standard deviations
        ("noise", np.float64, 6),  # Q, packed
        ("max_hypotheses", np.int64),  # 1: the nearest fold
        ("max_depth", np.float64),  # logarithm of the largest ratio of the best weight to a kept one
        ("averages", np.int64),  # 1: estimates are the mean of all hypotheses; 0: the best one
    ],
    align=True,
)


class World(NamedTuple):
    """The target, its bursts, and how ranges and bursts are drawn."""

    keys: np.ndarray  #: (4, 2) of the streams of ranges, bursts, the designation, fixed forecasts
    model_defects: np.ndarray  #: (K, 3) see `scenario.model_defects`
    motion: np.ndarray  #: (5,) F, as `kernels.kalman_algebra` has it
    sigma_r: float  #: of a range, m
    prior: np.ndarray  #: (2,) standard deviations of the designation
    span: float  #: of velocity, m/s
    physics: np.ndarray  #: (K,) bursts, see `bursts.kernels.signal.PHYSICS`
    noise_law: np.ndarray  #: (K,) number of its law
    mean: np.ndarray  #: (blocks, 4) of the sums drawn
    factor: np.ndarray  #: (S, blocks, 10) roots of their covariances
    tables: tuple[np.ndarray, np.ndarray]  #: two flat arrays, see `bursts.block_sums.WindowTables`
    #: (2, 2) of a forecast's errors of velocity and acceleration b₁ and b₂ in turns over the burst
    to_turns: np.ndarray
    measured: np.ndarray  #: (2, 6) of an estimate in turns over the burst velocity and acceleration at its middle
    offset: np.ndarray  #: (K,) of the true Doppler frequency from the spectrum's lines, in lines
    twiddle: np.ndarray  #: (M / 2, 2) cosines and sines of the transform of M points
    bit_reversed: np.ndarray  #: (M,) the order of the transform's input


class Filters(NamedTuple):
    """The filters."""

    filters: np.ndarray  #: (F,) see FILTER
    options: np.ndarray  #: (F,) of their sequences, see `bursts.kernels.sequence.OPTIONS`
    last_options: np.ndarray  #: (F,) of their last step, which is without forecast
    windows: np.ndarray  #: (W,) of all designs, see `bursts.kernels.sequence.WINDOW`
    first_window: np.ndarray  #: (F, K, E) index of the first window of an entry of the menu
    window_count: np.ndarray  #: (F, K, E) number of windows of an entry
    whole_burst: np.ndarray  #: (F, K) index of the window of the whole burst without forecast
    sigma: np.ndarray  #: (F, K, 2) Cramér–Rao bounds of velocity and acceleration
    baseline: int  #: number of the filter that gains are relative to
    ideals: np.ndarray  #: (F,) numbers of their idealisations; −1: none


class Hypotheses(NamedTuple):
    """Up to H hypotheses of each of n realisations, H a whole number of lanes."""

    states: np.ndarray  #: (n, H, 9) see `state_of`
    weights: np.ndarray  #: (n, H) logarithms, the best one's 0
    count: np.ndarray  #: (n,) number of hypotheses
    right: np.ndarray  #: (n, H) 1 for those that have taken no velocity in a wrong fold, else 0
    child_states: np.ndarray  #: (H, 10) states of the children, and whether they are right
    #: columns, children, parents: see `kernels.hypotheses.HypothesisLists`
    columns: np.ndarray
    children: np.ndarray
    parents: np.ndarray


def allocate_hypotheses(realisations: int, capacity: int) -> Hypotheses:
    """Allocate hypotheses, `capacity` for each realisation; none if only the nearest fold is taken."""
    room = -(-capacity // WIDTH) * WIDTH if capacity > 1 else 0
    children = 4 * room + 64
    return Hypotheses(
        states=np.zeros((realisations, room, 9)),
        weights=np.zeros((realisations, room)),
        count=np.zeros(realisations, np.int64),
        right=np.zeros((realisations, room)),
        child_states=np.zeros((room, 10)),
        columns=rows(COLUMNS * room // WIDTH),
        children=rows(3 * children // WIDTH),
        parents=np.zeros(children, np.int64),
    )


class Work(NamedTuple):
    """Work arrays for n realisations."""

    #: (n, 9) states and covariances, see `state_of`; with several hypotheses those of the best before the burst
    tracks: np.ndarray
    forecasts: np.ndarray  #: (n, 2) errors of the forecasts of velocity and acceleration
    entries: np.ndarray  #: (n,) of the menu
    measured: np.ndarray  #: (n, 2) the bursts' velocity and acceleration, minus the truth
    ages: np.ndarray  #: (n,) scans since a burst was lost
    passes: np.ndarray  #: (n,) passes over a window's data
    burst_arrays: tuple[np.ndarray, ...]  #: see `allocate_burst_arrays`
    hypotheses: Hypotheses  #: for filters that keep several


class Sums(NamedTuple):
    """Sums over realisations; e = estimate − truth."""

    error: np.ndarray  #: (F, K, 3, 4) e, e², e³, e⁴ of range, velocity, acceleration
    paired: np.ndarray  #: (F, K, 3) e² times the baseline's
    paired_ideal: np.ndarray  #: (F, K, 3) e² times the idealisation's
    #: (F, K, 2, 2, 2) e², e⁴ of the burst's velocity and acceleration: over bursts that locked, over all
    measured: np.ndarray
    locks: np.ndarray  #: (F, K, COUNTS) see above
    ages: np.ndarray  #: (F, K, AGES) realisations by the scans since a burst was lost
    losses: np.ndarray  #: (F, K, AGES, 3, 2) e², e⁴ of these realisations
    passes: np.ndarray  #: (F, 2) passes over a window's data in all bursts of a realisation, and their squares
    folds: np.ndarray  #: (F, K, FOLDS) see above


def shapes(filters: int, scans: int) -> dict[str, tuple[int, ...]]:
    """The shapes of `Sums`, by name."""
    scans_shape = (filters, scans)
    return {
        "error": (*scans_shape, 3, 4),
        "paired": (*scans_shape, 3),
        "paired_ideal": (*scans_shape, 3),
        "measured": (*scans_shape, 2, 2, 2),
        "locks": (*scans_shape, COUNTS),
        "ages": (*scans_shape, AGES),
        "losses": (*scans_shape, AGES, 3, 2),
        "passes": (filters, 2),
        "folds": (*scans_shape, FOLDS),
    }
