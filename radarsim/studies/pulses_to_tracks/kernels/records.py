"""The arrays that the kernels read and fill.

Letters: K scans, F filters, S laws of the noise (bursts of another signal-to-noise ratio), W windows of all designs."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.hypotheses import COLUMNS
from radarsim.kernels.lanes import WIDTH, rows

NONE, BOUND, SEQUENCE, SPECTRUM = 0, 1, 2, 3  # how a filter's bursts are estimated
AS_MEASURED, GATED, MIXTURE = 0, 1, 2  # what it does with an estimate
# Counted of the estimates of a scan: within 5 and 3 bounds of the truth; the weight with which they were taken; those
# taken in a fold that is not the truth's.
LOCKED, LOCKED_3, TAKEN, WRONG_FOLD, COUNTS = 0, 1, 2, 3, 4
# Of a filter that keeps hypotheses: realisations whose best one has no wrong fold, whose list holds one that has none,
# hypotheses.
RIGHT, LISTED, NUMBER, FOLDS = 0, 1, 2, 3
AGES = 7  # scans since the last burst that was lost: 0 … 5, then six and more, or none was lost so far

FILTER = np.dtype(
    [
        ("kind", np.int64),  # NONE … SPECTRUM
        ("takes", np.int64),  # numbers of the burst: 0, 1 velocity, 2 acceleration too
        ("use", np.int64),  # AS_MEASURED … MIXTURE
        ("track", np.int64),  # whether its forecast is its own prediction
        ("start", np.int64),  # scans without manoeuvre noise
        ("gate", np.float64),  # largest squared deviation in variances
        ("lock", np.float64),  # probability of lock before an estimate is seen
        ("density", np.float64),  # of an estimate that did not lock
        ("fixed", np.float64, 2),  # standard deviations of a forecast that is not the track's
        ("top", np.float64, 2),  # largest standard deviations of the menu: velocity, acceleration
        ("ratio", np.float64, 2),  # logarithm of the ratio of neighbouring ones
        ("levels", np.int64, 2),  # how many
        ("noise", np.float64, 6),  # Q, packed
        ("kept", np.int64),  # hypotheses kept at most; 1: the nearest fold
        ("deepest", np.float64),  # logarithm of the ratio to the best weight, below which one is dropped
        ("averages", np.int64),  # 1: estimates are the mean of all; 0: the best one
    ],
    align=True,
)


class World(NamedTuple):
    """What is observed."""

    keys: np.ndarray  #: (4, 2) of the streams of ranges, bursts, the designation, fixed forecasts
    missed: np.ndarray  #: (K, 3) see `filters.defects`
    motion: np.ndarray  #: (5,) F, as `kernels.algebra` has it
    sigma_r: float  #: of a range, m
    prior: np.ndarray  #: (2,) standard deviations of the designation
    span: float  #: of velocity, m/s
    physics: np.ndarray  #: (K,) bursts, see `bursts.kernels.scoring.PHYSICS`
    law: np.ndarray  #: (K,) of which law
    mean: np.ndarray  #: (blocks, 4) of the sums drawn
    factor: np.ndarray  #: (S, blocks, 10) roots of their covariances
    tables: tuple[np.ndarray, np.ndarray]  #: two flat arrays, see `bursts.burst.Tables`
    #: (2, 2) of a forecast's errors of velocity and acceleration b₁ and b₂ in turns over the burst
    to_turns: np.ndarray
    measured: np.ndarray  #: (2, 6) of an estimate in turns over the burst velocity and acceleration at its middle
    offset: np.ndarray  #: (K,) of the true Doppler frequency from the spectrum's lines, in lines
    twiddle: np.ndarray  #: (M / 2, 2) cosines and sines of the transform of M points
    reversed: np.ndarray  #: (M,) its order


class Filters(NamedTuple):
    """The filters."""

    filters: np.ndarray  #: (F,) see FILTER
    options: np.ndarray  #: (F,) of their sequences, see `bursts.kernels.sequence.OPTIONS`
    last: np.ndarray  #: (F,) of the last step, which is without forecast
    windows: np.ndarray  #: (W,) of all designs, see `bursts.kernels.sequence.WINDOW`
    first: np.ndarray  #: (F, K, E) where those of an entry of the menu begin
    count: np.ndarray  #: (F, K, E) how many there are
    free: np.ndarray  #: (F, K) the whole burst without forecast
    sigma: np.ndarray  #: (F, K, 2) Fisher bounds of velocity and acceleration
    baseline: int  #: the filter that gains are against


class Hypotheses(NamedTuple):
    """Up to H hypotheses of each of n realisations, H a whole number of lanes."""

    states: np.ndarray  #: (n, H, 9) see `chain.state_of`
    weights: np.ndarray  #: (n, H) logarithms, the best one's 0
    count: np.ndarray  #: (n,) how many there are
    right: np.ndarray  #: (n, H) 1 of those that have taken no velocity in a wrong fold, else 0
    fresh: np.ndarray  #: (H, 10) room for states, and whether they are right
    #: columns, children, parents: see `kernels.hypotheses.Lists`
    columns: np.ndarray
    children: np.ndarray
    parents: np.ndarray


def hypotheses(realisations: int, most: int) -> Hypotheses:
    """Room for so many of each realisation; for none where only the nearest fold is taken."""
    room = -(-most // WIDTH) * WIDTH if most > 1 else 0
    children = 4 * room + 64
    return Hypotheses(
        states=np.zeros((realisations, room, 9)),
        weights=np.zeros((realisations, room)),
        count=np.zeros(realisations, np.int64),
        right=np.zeros((realisations, room)),
        fresh=np.zeros((room, 10)),
        columns=rows(COLUMNS * room // WIDTH),
        children=rows(3 * children // WIDTH),
        parents=np.zeros(children, np.int64),
    )


class Work(NamedTuple):
    """Work arrays for n realisations."""

    #: (n, 9) states and covariances, see `chain.state_of`; of several hypotheses the best before the burst
    tracks: np.ndarray
    forecasts: np.ndarray  #: (n, 2) errors of the forecasts of velocity and acceleration
    entries: np.ndarray  #: (n,) of the menu
    measured: np.ndarray  #: (n, 2) the bursts' velocity and acceleration, less the truth
    ages: np.ndarray  #: (n,) scans since the last burst that was lost
    passes: np.ndarray  #: (n,) passes over a window's data so far
    room: tuple[np.ndarray, ...]  #: see `chain.room_for`
    held: Hypotheses  #: of filters that keep several


class Sums(NamedTuple):
    """Sums over realisations; e = estimate − truth."""

    error: np.ndarray  #: (F, K, 3, 4) e, e², e³, e⁴ of range, velocity, acceleration
    paired: np.ndarray  #: (F, K, 3) e² times the baseline's
    #: (F, K, 2, 2, 2) of the burst's velocity and acceleration e², e⁴: of those that locked, of all
    measured: np.ndarray
    locks: np.ndarray  #: (F, K, COUNTS) see above
    ages: np.ndarray  #: (F, K, AGES) realisations by the scans since the last burst that was lost
    losses: np.ndarray  #: (F, K, AGES, 3, 2) e², e⁴ of these
    passes: np.ndarray  #: (F, 2) passes over a window's data of all bursts of a realisation, and their squares
    folds: np.ndarray  #: (F, K, FOLDS) see above


def shapes(filters: int, scans: int) -> dict[str, tuple[int, ...]]:
    """The shapes of `Sums`, by name."""
    each = (filters, scans)
    return {
        "error": (*each, 3, 4),
        "paired": (*each, 3),
        "measured": (*each, 2, 2, 2),
        "locks": (*each, COUNTS),
        "ages": (*each, AGES),
        "losses": (*each, AGES, 3, 2),
        "passes": (filters, 2),
        "folds": (*each, FOLDS),
    }
