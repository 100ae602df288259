"""The arrays that the kernels read and fill, and what their rows hold: eight realisations a row (`kernels.lanes`).

Letters: K scans, D designs (what gains depend on), B banks (a design and what is done about folds), F filters."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from radarsim.kernels.hypotheses import COLUMNS
from radarsim.kernels.lanes import WIDTH, rows

# A scan's plot and truth: range and folded velocity; the velocity before it was folded; 1 where there is a plot, where
# it is the first, where there has been one; the truth (3); the velocity by the Chinese remainder of this plot and the
# one before it, and 1 where these have one.
RANGE, VELOCITY, UNFOLDED, DETECTED, FIRST, STARTED, TRUTH, SOLVED, PAIRED, PLOT = 0, 1, 2, 3, 4, 5, 6, 9, 10, 11

# A scan's gains, shared by all hypotheses of a realisation: 1/(2S) of the range's innovation and its gains (3); of the
# velocity's the variance S, which stands also where there is no plot, and its gains (3). Zero where nothing is taken.
WEIGHT, RANGE_GAIN, VARIANCE, VELOCITY_GAIN, GAINS = 0, 1, 4, 5, 8

# A scan's output of a bank: the mean of its hypotheses (3) and the best one (3); whether that has all folds right,
# whether any listed has, how many there are, and the probability of the best; of several orders the weight of each (3).
MEAN, BEST, RIGHT, LISTED, COUNT, PROBABILITY, WEIGHTS, OUTPUT = 0, 3, 6, 7, 8, 9, 10, 13

# Numbers of a design: F above its diagonal of ones and zeros (5) and Q (6) as `kernels.algebra` has them, the prior
# variances of velocity and acceleration, 1 where it takes the velocity, 2 where it takes that of two scans.
MOTION, NOISE, PRIOR, TAKES_VELOCITY, DESIGN = 0, 5, 11, 13, 16

NONE, UNFOLDS, NEAREST, REMAINDER, MERGES, REMEMBERS = 0, 1, 2, 3, 4, 5  # what a bank does about the folds
INTERACTS, WEIGHS, CHOOSES = 6, 7, 8  # and one that combines orders: by likelihood, by fixed shares, by intersection
MEMBERS = 6  # most that are combined: three orders, with the velocity and without

RIGHT_SUM, LISTED_SUM, COUNT_SUM, BEYOND_SUM, FOLD_SUMS = 0, 1, 2, 3, 4  # last axis of `Sums.folds`
BINS = 10  # of the best hypothesis's probability


class World(NamedTuple):
    """What is observed."""

    keys: np.ndarray  #: (3, 2) of the streams of plots, detections, and of what a target draws
    truth: np.ndarray  #: (K, 3) mean range, velocity, acceleration
    t: np.ndarray  #: (K,) times of the scans, s
    spread: np.ndarray  #: (2,) standard deviations of the velocity and of the acceleration that each realisation adds
    sigma: np.ndarray  #: (2,) of the plots: m, m/s
    spans: np.ndarray  #: (K,) of velocity at each scan, m/s
    turn: np.ndarray  #: (K,) which of the R repetition rates a scan has
    joint: np.ndarray  #: (R, R) span in which two rates together are unambiguous, m/s; zero where no filter asks for it
    detection: float  #: probability of a plot


class Banks(NamedTuple):
    """The filters."""

    designs: np.ndarray  #: (D, DESIGN) see above
    kind: np.ndarray  #: (B,) NONE … CHOOSES
    parts: np.ndarray  #: (B, MEMBERS) a bank's design; INTERACTS: its designs; WEIGHS, CHOOSES: banks before it
    orders: np.ndarray  #: (B, MEMBERS) of the parts of a bank that combines
    size: np.ndarray  #: (B,) how many parts there are
    most: np.ndarray  #: (B,) hypotheses kept
    deepest: np.ndarray  #: (B,) logarithm of the largest ratio of the best hypothesis's probability to a kept one's
    reads: np.ndarray  #: (B,) WEIGHS, CHOOSES: MEAN or BEST of the parts
    stay: np.ndarray  #: (B,) INTERACTS: probability that an order persists from scan to scan
    unfolding: np.ndarray  #: (B,) INTERACTS: what it does about the folds
    #: (B, K, MEMBERS, 3) WEIGHS: the parts' shares in each component; CHOOSES: half widths of their intervals, zero of
    #: a part that does not estimate the component
    shares: np.ndarray
    bank: np.ndarray  #: (F,) of each filter
    place: np.ndarray  #: (F,) MEAN or BEST
    baseline: int  #: number of the filter that gains are against
    oracle: int  #: number of the filter with unfolded velocities; -1: there is none


class Memory(NamedTuple):
    """Work arrays for a group of eight realisations; those from `listed` on: see `kernels.hypotheses.Lists` and
    `together`."""

    normals: np.ndarray  #: 2 + 2 K rows
    plots: np.ndarray  #: K × PLOT
    gains: np.ndarray  #: D × K × GAINS
    out: np.ndarray  #: B × K × OUTPUT
    counted: np.ndarray
    listed: np.ndarray
    children: np.ndarray
    parents: np.ndarray
    interacting: np.ndarray
    together: np.ndarray
    broad: np.ndarray
    room: int


class Sums(NamedTuple):
    """Sums over realisations; e = estimate - truth of the components."""

    error: np.ndarray  #: (F, K, 3, 4) e, e², e³, e⁴
    paired: np.ndarray  #: (F, K, 3) e² times the baseline's
    oracle: np.ndarray  #: (F, K, 3) e² times the oracle's; zero where there is none
    estimates: np.ndarray  #: (F, K, 3) realisations that have an estimate
    #: (F, K, FOLD_SUMS) the best hypothesis has all folds right; the list holds the right one; hypotheses; the
    #: velocity's error is over half the span
    folds: np.ndarray
    #: (F, K, BINS, 3) by the probability of the best hypothesis: realisations, those where it is right, and the sum of
    #: these probabilities
    calibration: np.ndarray
    orders: np.ndarray  #: (F, K, 3, 2) weights of the orders 0, 1, 2 and their squares, of filters that combine orders


def shapes(filters: int, scans: int) -> Mapping[str, tuple[int, ...]]:
    """The shapes of `Sums`, by name."""
    each = (filters, scans, 3)
    return {
        "error": (*each, 4),
        "paired": each,
        "oracle": each,
        "estimates": each,
        "folds": (filters, scans, FOLD_SUMS),
        "calibration": (filters, scans, BINS, 3),
        "orders": (*each, 2),
    }


def remembers(banks: Banks) -> np.ndarray:
    """Which banks (B,) keep several hypotheses."""
    return (banks.kind == REMEMBERS) | ((banks.kind == INTERACTS) & (banks.unfolding == REMEMBERS))


def memory(scans: int, banks: Banks) -> Memory:
    """Work arrays for so many scans."""
    most = max((int(n) for n, kept in zip(banks.most, remembers(banks), strict=True) if kept), default=1)
    room = -(-most // WIDTH) * WIDTH + WIDTH
    children = 4 * room + 64
    return Memory(
        normals=rows(2 + 2 * scans),
        plots=rows(scans * PLOT),
        gains=rows(len(banks.designs) * scans * GAINS),
        out=rows(len(banks.kind) * scans * OUTPUT),
        counted=rows(1),
        listed=rows(COLUMNS * room // WIDTH),
        children=rows(3 * children // WIDTH),
        parents=np.zeros(children, dtype=np.int64),
        interacting=rows(2 * 3 * 12),
        together=rows(2 * room // WIDTH * 3 * 12 if (remembers(banks) & (banks.kind == INTERACTS)).any() else 1),
        broad=rows(PLOT + 3),
        room=room,
    )
