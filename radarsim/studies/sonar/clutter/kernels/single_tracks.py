"""Trackers among false and missed plots: their arrays, and one scan of a chunk of tracks.

Each tracker has one track in each realisation. Plots are associated one realisation after the other, since the numbers
of false plots in the gates differ; covariances are then updated for eight realisations at a time (`track_prediction`,
`track_update`).

Letters as in `gate` and `track_prediction`; f numbers trackers, i realisations of a chunk, k scans."""

from typing import NamedTuple

import numpy as np

from radarsim.kernels.compiler import aligned_zeros, inline, kernel_part
from radarsim.studies.sonar.clutter.kernels.association import associate
from radarsim.studies.sonar.clutter.kernels.gate import PDA, AssociationRule
from radarsim.studies.sonar.clutter.kernels.track_prediction import Tracks, predict
from radarsim.studies.sonar.clutter.kernels.track_rules import FIRST, ROWS
from radarsim.studies.sonar.clutter.kernels.track_update import update
from radarsim.studies.sonar.kernels.chunks import CHUNK


class Trackers(NamedTuple):
    """F trackers."""

    association: np.ndarray  #: (F,)
    chi_square: np.ndarray  #: (F,) on the border of the gate
    gate_probability: np.ndarray  #: (F,) P_G
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
    score_thresholds: np.ndarray  #: (T,)


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


@kernel_part
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
    chi_square, gate_probability = trackers.chi_square[f], trackers.gate_probability[f]
    return AssociationRule(
        trackers.association[f], chi_square, trackers.detection, gate_probability, trackers.density, trackers.speed[f]
    )


@kernel_part
def step_tracker(trackers, f, field, scan, tracks, target, work, counts):
    """Predict, associate and update all tracks of tracker f at one scan."""
    manoeuvre, association = trackers.manoeuvre[f], trackers.association[f]
    predict(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, work.predicted)
    associate(field, association_rule(trackers, f), scan, tracks, work.status[f], target, work, counts)
    update(tracks, scan.dt, trackers.period, trackers.sigma, manoeuvre, association == PDA, work.association)
