"""Folded Doppler velocity: filters that unfold it by hypotheses, with memory and without (the wish that ends P1)."""

from radarsim.report.quantities import RIGHT, WRONG
from radarsim.studies.folder import StudyFolder
from radarsim.studies.interface import Paper

STUDY = StudyFolder(
    package=__name__,
    name="ambiguous_doppler",
    about="Beyond P1: Doppler that folds, unfolded by hypotheses that are kept from scan to scan.",
    filters={
        "doppler: none": "Kalman filter on range alone, order 0, 1 or 2: the upper bracket",
        "doppler: unfolded": "the same with the velocity unfolded by the truth: the lower bracket",
        "doppler: folded": "the same, unfolded by up to `hypotheses` sequences of folds; 1: the nearest fold",
        "merge: each_scan": "the same, hypotheses merged into one each scan (GPB1): no memory",
    },
    paper=Paper("Gorshkov & Zavizhenets 2017, conclusion", page="ambiguous_doppler"),
    offers=("inputs", "recorded", "warnings"),
    own_quantities=(RIGHT, WRONG),
)
