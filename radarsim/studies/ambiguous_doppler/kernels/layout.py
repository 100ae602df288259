"""The arrays that the kernels read and fill, and what their rows hold: eight realisations a row (`kernels.lanes`).

Letters: K scans; D designs, on which gains depend; B banks, each a design with a way to treat folds; F filters."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from radarsim.kernels.hypotheses import COLUMNS
from radarsim.kernels.lanes import WIDTH, rows

# A scan's plot and truth: range and folded velocity; the velocity before it was folded; 1 where there is a plot, where
# it is the track's first, where the track has started; the truth (3); the velocity by the Chinese remainder of this
# plot and the previous one, and 1 where the two have one.
RANGE, VELOCITY, UNFOLDED, DETECTED, FIRST, STARTED, TRUTH, SOLVED, PAIRED, PLOT = 0, 1, 2, 3, 4, 5, 6, 9, 10, 11

# A scan's gains, shared by all hypotheses of a realisation: 1/(2S) of the range's innovation and its gains (3); the
# variance S of the velocity's innovation, also where there is no plot, and its gains (3). Zero where nothing is taken.
WEIGHT, RANGE_GAIN, VARIANCE, VELOCITY_GAIN, GAINS = 0, 1, 4, 5, 8

# A scan's output of a bank: the mean of its hypotheses (3) and the best one (3); whether the best has all folds right,
# whether any in the list has; the number of hypotheses; the probability of the best; the weights of the orders (3).
MEAN, BEST, RIGHT, LISTED, COUNT, PROBABILITY, WEIGHTS, OUTPUT = 0, 3, 6, 7, 8, 9, 10, 13

# Numbers of a design: F above its diagonal of ones and zeros (5) and Q (6) as `kernels.kalman_algebra` has them; the
# prior variances of velocity and acceleration; 1 if it takes the velocity, 2 if it takes the one that two scans give.
MOTION, NOISE, PRIOR, TAKES_VELOCITY, DESIGN = 0, 5, 11, 13, 16

NONE, UNFOLDS, NEAREST, REMAINDER, MERGES, REMEMBERS = 0, 1, 2, 3, 4, 5  # how a bank treats the folds
INTERACTS, WEIGHS, CHOOSES = 6, 7, 8  # how a bank combines orders: by likelihood, by fixed shares, by intersection
MAX_MEMBERS = 6  # of a combination: three orders, with the velocity and without

RIGHT_SUM, LISTED_SUM, COUNT_SUM, OFF_BY_HALF_SPAN_SUM, FOLD_SUMS = 0, 1, 2, 3, 4  # last axis of `Sums.folds`
BINS = 10  # of the best hypothesis's probability


class World(NamedTuple):
    """The truth, and how plots are drawn."""

    keys: np.ndarray  #: (3, 2) of the random streams: plots, detections, the target's motion
    truth: np.ndarray  #: (K, 3) mean range, velocity, acceleration
    t: np.ndarray  #: (K,) times of the scans, s
    spread: np.ndarray  #: (2,) standard deviations of the velocity and of the acceleration that each realisation adds
    sigma: np.ndarray  #: (2,) of the plots: m, m/s
    spans: np.ndarray  #: (K,) of velocity at each scan, m/s
    rate_index: np.ndarray  #: (K,) number of each scan's repetition rate, of R
    joint_spans: (
        np.ndarray
    )  #: (R, R) span in which two rates together are unambiguous, m/s; zero where no filter asks for it
    detection_probability: float  #: probability of a plot


class Banks(NamedTuple):
    """The filters."""

    designs: np.ndarray  #: (D, DESIGN) see above
    kind: np.ndarray  #: (B,) NONE … CHOOSES
    #: (B, MAX_MEMBERS) a bank's design; INTERACTS: its designs; WEIGHS, CHOOSES: banks earlier in the list
    members: np.ndarray
    orders: np.ndarray  #: (B, MAX_MEMBERS) of the members of a bank that combines orders
    size: np.ndarray  #: (B,) number of members
    max_hypotheses: np.ndarray  #: (B,) hypotheses kept
    max_depth: np.ndarray  #: (B,) logarithm of the largest ratio of the best hypothesis's probability to a kept one's
    member_field: np.ndarray  #: (B,) WEIGHS, CHOOSES: the output that is read of the members, MEAN or BEST
    stay: np.ndarray  #: (B,) INTERACTS: probability that an order persists from scan to scan
    unfolding: np.ndarray  #: (B,) INTERACTS: how it treats the folds
    #: (B, K, MAX_MEMBERS, 3) WEIGHS: the members' shares in each component; CHOOSES: half widths of their intervals,
    #: zero for a member that does not estimate the component
    shares: np.ndarray
    bank: np.ndarray  #: (F,) number of each filter's bank
    estimate_field: np.ndarray  #: (F,) the output that is the filter's estimate, MEAN or BEST
    baseline: int  #: number of the filter that gains are relative to
    oracle: int  #: number of the filter with unfolded velocities; -1: there is none


class Memory(NamedTuple):
    """Work arrays for eight realisations; hypotheses, children, parents: of a `kernels.hypotheses.HypothesisLists`."""

    normals: np.ndarray  #: 2 + 2 K rows
    plots: np.ndarray  #: K × PLOT
    gains: np.ndarray  #: D × K × GAINS
    out: np.ndarray  #: B × K × OUTPUT
    active: np.ndarray  #: a row: 1 in each lane whose realisation counts, else 0
    hypotheses: np.ndarray
    children: np.ndarray
    parents: np.ndarray
    interacting_states: np.ndarray  #: two times three orders
    order_states: np.ndarray  #: two lists of hypotheses of three orders
    broadcast_plot: np.ndarray  #: a plot in all lanes, then the numbers 0 … 7, and two rows of branches
    room: int  #: hypotheses in a list, whole rows, with a free one


class Sums(NamedTuple):
    """Sums over realisations; e = estimate - truth of the components."""

    error: np.ndarray  #: (F, K, 3, 4) e, e², e³, e⁴
    paired: np.ndarray  #: (F, K, 3) e² times the baseline's
    oracle: np.ndarray  #: (F, K, 3) e² times the oracle's; zero where there is none
    estimates: np.ndarray  #: (F, K, 3) realisations that have an estimate
    #: (F, K, FOLD_SUMS) realisations whose best hypothesis has all folds right, whose list holds the right one; the
    #: number of hypotheses; realisations whose velocity is off by more than half the span
    folds: np.ndarray
    #: (F, K, BINS, 3) in bins of the best hypothesis's probability: realisations, those in which it is right, and the
    #: sum of the probabilities
    calibration: np.ndarray
    orders: np.ndarray  #: (F, K, 3, 2) weights of the orders 0, 1, 2 and their squares, of filters that combine orders


def shapes(filters: int, scans: int) -> Mapping[str, tuple[int, ...]]:
    """The shapes of `Sums`, by name."""
    components_shape = (filters, scans, 3)
    return {
        "error": (*components_shape, 4),
        "paired": components_shape,
        "oracle": components_shape,
        "estimates": components_shape,
        "folds": (filters, scans, FOLD_SUMS),
        "calibration": (filters, scans, BINS, 3),
        "orders": (*components_shape, 2),
    }


def keeps_several(banks: Banks) -> np.ndarray:
    """Which banks (B,) keep several hypotheses."""
    return (banks.kind == REMEMBERS) | ((banks.kind == INTERACTS) & (banks.unfolding == REMEMBERS))


def work_arrays(scans: int, banks: Banks) -> Memory:
    """Allocate the work arrays for that many scans."""
    capacity = max(
        (int(limit) for limit, several in zip(banks.max_hypotheses, keeps_several(banks), strict=True) if several),
        default=1,
    )
    room = -(-capacity // WIDTH) * WIDTH + WIDTH
    children = 4 * room + 64
    return Memory(
        normals=rows(2 + 2 * scans),
        plots=rows(scans * PLOT),
        gains=rows(len(banks.designs) * scans * GAINS),
        out=rows(len(banks.kind) * scans * OUTPUT),
        active=rows(1),
        hypotheses=rows(COLUMNS * room // WIDTH),
        children=rows(3 * children // WIDTH),
        parents=np.zeros(children, dtype=np.int64),
        interacting_states=rows(2 * 3 * 12),
        order_states=rows(
            2 * room // WIDTH * 3 * 12 if (keeps_several(banks) & (banks.kind == INTERACTS)).any() else 1
        ),
        broadcast_plot=rows(PLOT + 3),
        room=room,
    )
