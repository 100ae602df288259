"""P2 (Sychev & Osipov 2023): multiple-model filters on an aeroballistic target, families × merging rules."""

from radarsim.language import term
from radarsim.report.quantities import Quantity
from radarsim.studies.folder import StudyFolder

STUDY = StudyFolder(
    package=__name__,
    name="multimodel",
    about="P2 (Sychev & Osipov 2023): multiple-model filters on an aeroballistic target, families × merging rules.",
    filters={
        "family": "kalman, gpb1 (MMA1), imm (MMA2), gpb2 (MMA3) with a bank of one to five motion models",
        "merge": "rule of the partial merges: moment, best, combined, modified_combined",
        "output": "rule that forms the estimate: moment, best",
        "covariance_at": "the plot's covariance at the plot or at its prediction",
    },
    offers=("cost", "seconds_per_update", "recorded", "errors"),
    own_quantities=(
        Quantity("probability", term("probability"), "probabilities", "probability", per=term("model"), kind="share"),
    ),
)
