"""P4 (Uss, Baryshev & Djavad 2010): Doppler frequency and its derivatives from one burst, and how often they lock."""

from radarsim.report.quantities import FLOOR, LOCK, LOST
from radarsim.studies.folder import StudyFolder
from radarsim.studies.interface import Paper

STUDY = StudyFolder(
    package=__name__,
    name="discriminator",
    about="P4 (Uss, Baryshev & Djavad 2010): Doppler frequency and derivatives from one burst, how often they lock.",
    filters={
        "method: sequence": "discriminators over windows that grow to the whole burst, Fisher scoring in each",
        "method: ridge": "the classical rival: short-time spectrum, robust fit, unwrapping, then scoring; no prior",
    },
    paper=Paper(
        "Uss, Baryshev & Djavad 2010",
        page="discriminator",
        may_grow=("estimators",),
        held_too={
            "discriminator_as_printed": ("P4.13", "P4.14", "P4.15", "P4.16", "P4.18"),
            "discriminator_prior": ("P4.8",),
            "discriminator_noise": ("P4.9",),
            "discriminator_forecast": ("P4.10",),
        },
    ),
    offers=("curves", "interpretations", "floor"),
    exact_errors=False,  # exact_sigma is the bound, which an estimator reaches or does not
    draws_sweeps=True,  # lock is what is swept for, and has figures of its own
    own_quantities=(LOCK, LOST, FLOOR),
)
