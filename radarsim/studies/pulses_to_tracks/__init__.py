"""From pulses to tracks: what a burst's estimate of velocity and acceleration is worth to the track (P4 into P1)."""

from radarsim.report.quantities import FLOORS, LOCK, LOST, RIGHT, WRONG
from radarsim.studies.folder import StudyFolder

STUDY = StudyFolder(
    package=__name__,
    name="pulses_to_tracks",
    about="Beyond P1 and P4: Doppler estimated from bursts, which may fail to lock, and the resulting tracks.",
    filters={
        "observes: [range]": "Kalman filter on range alone, which needs no burst",
        "estimator: sequence": "with the velocity, or velocity and acceleration, that P4's sequence estimates",
        "estimator: dense": "the same with twice as many windows; cured: with a search where coherence is short",
        "estimator: spectrum": "the same by the classical method: the peak of the spectrum, then scoring",
        "estimator: fisher_bound": "the idealisation: Gaussian errors of the Fisher bound, which always lock",
    },
    offers=("inputs", "warnings", "floor"),
    own_quantities=(LOCK, LOST, RIGHT, WRONG, *FLOORS),
)
