"""Where each number lies in the arrays that the kernels fill and that tables and tracking read. No compiled code.

A *row* is eight numbers side by side, one quantity of eight realisations (see `radarsim.kernels.lanes`). The constants
below are indices of rows within a record; HYPOTHESIS, PLOT, OUTPUT and STAGE are lengths of records in rows.

Sizes: F filters, M models of a filter, S stages, K scans, K' reported scans, U distinct intervals between scans.
States: x, vx, ax, y, vy, ay, z, vz, az (m, m/s, m/s²); an axis is a coordinate with its velocity and acceleration.

The groups of constants below are, in this order: a hypothesis (mean x, covariance P, probability); the work array of a
filter; whole numbers that a filter keeps between scans; a plot; a filter's output at a scan; a stage of a realisation
(sums over its scans, then means); plain numbers (not rows)."""

from typing import NamedTuple

import numpy as np

STATES = 9
MAX_MODELS = 5  # models in a bank
START = 3  # plots from which a track starts

MEAN = 0  # x (9), axis by axis
OWN = 9  # blocks of P on the diagonal, packed symmetric: 6 rows for each axis
CROSS = 27  # blocks of P between two axes: 9 rows for each of xy, xz, yz
PROBABILITY = 54
HYPOTHESIS = 56

BANK = MAX_MODELS * HYPOTHESIS  # two banks, before and after the plot, at rows 0 and BANK
SPARE = 2 * BANK  # hypotheses before they are merged (GPB2), and the merged output
WEIGHT = 3 * BANK  # weights of the hypotheses that may be merged, by number
SHARE = WEIGHT + MAX_MODELS  # shares of the merged hypotheses, in the order of the list
RESULT = SHARE + MAX_MODELS  # normalised innovation squared and determinant of S, two rows for each hypothesis
RESULT_GROUP = RESULT + 2 * MAX_MODELS  # the same of each model (of each group of hypotheses in GPB2)
MODEL = RESULT_GROUP + 2 * MAX_MODELS  # F and Q of each model over the present interval
MODEL_Q = 5  # rows of a model: F (5), then Q (6)
MODEL_ROWS = 11
TRANSITION = MODEL + MODEL_ROWS * MAX_MODELS  # transition probabilities, from model j to model i at i * MAX_MODELS + j
WAIT = TRANSITION + MAX_MODELS * MAX_MODELS  # seconds since the last plot
ESTIMATE = WAIT + 1  # the latest output mean (9)
NOISE = ESTIMATE + STATES  # measurement covariance R at the prediction (6)
MAIN_INNOVATION = NOISE + 6  # normalised innovation squared of the hypothesis that was most probable before the plot
MERGE_COUNTS = MAIN_INNOVATION + 1  # in this scan: hypotheses that went into merges of several, number of such merges
WORK = MERGE_COUNTS + 2

CURRENT = 0  # which of the two banks is in use
PREPARED = 1  # the interval that the rows MODEL and TRANSITION hold for; -1: none
NONE_WAITING = 2  # 1 where no lane waits for a plot that it missed

POSITION = 0  # z (3)
COVARIANCE = 3  # R (6): xx, xy, xz, yy, yz, zz
DETECTED = 9  # 1 where the plot was detected, else 0
PLOT = 10

ESTIMATED = 0  # mean (9)
VARIANCE = 9  # variances (9)
POSITION_COVARIANCE = 18  # xy, xz, yz
MODELS = 21  # probabilities of the models (MAX_MODELS)
INNOVATION = 26  # normalised innovation squared of the hypothesis that was most probable before the plot
MERGING = 27  # hypotheses that went into merges of more than one, number of such merges
OUTPUT = 29

NEES = 9  # after nine squared errors: e' P⁻¹ e of the position, at the reported scans
NIS = 10  # normalised innovation squared, of the detected plots
MERGED = 11  # hypotheses that went into merges of more than one
MERGES = 12  # number of such merges
MEANS = 13  # number of means of a stage that are summed over realisations
PLOTS = 13  # number of detected plots
STAGE = 14

# of a sensor (FRAME,)
ROTATION, SIGMA, HEIGHT, FORM, UNBIASED, DETECTION = 0, 9, 12, 13, 14, 15
FRAME = 18
BICONICAL, CARTESIAN = 0, 1  # values of FORM
# of a scan of the true track: range, sine and cosine of elevation and of azimuth, x, y, z
RANGE, ELEVATION, AZIMUTH, COORDINATES = 0, 1, 3, 5
PLOT_TRUTH = 8
# of a filter
FAMILY, MERGE, OUTPUT_RULE, AT_PREDICTION, SIZE = range(5)
KALMAN, GPB1, IMM, GPB2 = range(4)  # values of FAMILY
MOMENT, BEST, COMBINED, MODIFIED = range(4)  # values of MERGE and OUTPUT_RULE
MODEL_NUMBERS = 3  # of a model: moves, accelerates (0 or 1), sigma of the acceleration


class Rules(NamedTuple):
    """The rules of a filter: values of FAMILY, MERGE, OUTPUT_RULE and AT_PREDICTION, and its number of models."""

    family: int
    merge: int
    output: int
    at_prediction: int
    size: int


class World(NamedTuple):
    """The target, the sensor and the scans, which all filters of a case share."""

    keys: np.ndarray  #: (2, 2) streams of the plots' noise and of detections
    frame: np.ndarray  #: (FRAME,) the sensor
    plot_truth: np.ndarray  #: (K, PLOT_TRUTH) truth of the plots
    truth: np.ndarray  #: (K, 9) the true state
    intervals: np.ndarray  #: (K,) number of each scan's interval since the previous scan
    times: np.ndarray  #: (U,) the intervals, s
    reported: np.ndarray  #: (K,) 1 where a scan is reported
    report_index: np.ndarray  #: (K,) index of a scan among the reported ones
    stage: np.ndarray  #: (K,) stage of a scan
    lengths: np.ndarray  #: (S, 2) scans of a stage from the third on, and the reported ones of these
    weights: np.ndarray  #: (9,) for the start of a track: a, b, g of `filter_strip.start_track`


class Banks(NamedTuple):
    """The filters; the rows of each array are padded to multiples of eight numbers."""

    numbers: np.ndarray  #: (F, 8) FAMILY, MERGE, OUTPUT_RULE, AT_PREDICTION, SIZE
    models: np.ndarray  #: (F, 16) MODEL_NUMBERS of each model
    transitions: np.ndarray  #: (F, …) transition probabilities (U, M, M) over each distinct interval, columns: from
    probabilities: np.ndarray  #: (F, 8) of the models at the start of a track


class Sums(NamedTuple):
    """Sums over realisations, as a block of results holds them."""

    error: np.ndarray  #: (F, K', 9, 4) Σ e, Σ e², Σ e³, Σ e⁴ of the estimate's errors
    paired: np.ndarray  #: (F, K', 9) Σ e² e₀², with the error of the baseline filter
    probability: np.ndarray  #: (F, K', MAX_MODELS, 2) Σ p, Σ p² of the models' probabilities
    believed: np.ndarray  #: (F, K', 2) Σ q, Σ q² of q = e' P⁻¹ e of the position
    #: (F, S, MEANS, 2) Σ m, Σ m² of each mean over a stage: nine squared errors, NEES, NIS, MERGED, MERGES
    stage: np.ndarray
    pairs: np.ndarray  #: (F, F, S, 9) Σ m n of the mean squared errors of two filters


def shapes(filters: int, reported: int, stages: int) -> dict[str, tuple[int, ...]]:
    """The shape of each array of `Sums`, by name."""
    return Sums(
        error=(filters, reported, STATES, 4),
        paired=(filters, reported, STATES),
        probability=(filters, reported, MAX_MODELS, 2),
        believed=(filters, reported, 2),
        stage=(filters, stages, MEANS, 2),
        pairs=(filters, filters, stages, STATES),
    )._asdict()
