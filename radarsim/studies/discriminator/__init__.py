"""P4 (Uss, Baryshev & Djavad 2010): Doppler frequency and its derivatives from one burst, and how often they lock."""

from radarsim.report.quantities import FLOOR, LOCK, LOST
from radarsim.studies.folder import StudyFolder

STUDY = StudyFolder(
    package=__name__,
    name="discriminator",
    about="P4 (Uss, Baryshev & Djavad 2010): Doppler frequency and derivatives from one burst, how often they lock.",
    filters={
        "method: sequence": "discriminators over windows that grow to the whole burst, Fisher scoring in each",
        "method: ridge": "the classical rival: short-time spectrum, robust fit, unwrapping, then scoring; no prior",
    },
    offers=("curves", "floor"),
    exact_errors=False,  # exact_sigma is the bound, which an estimator reaches or does not
    draws_sweeps=True,  # lock is what is swept for, and has figures of its own
    own_quantities=(LOCK, LOST, FLOOR),
)
