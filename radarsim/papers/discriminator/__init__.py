"""The claims of P4: Doppler frequency and derivatives from one burst."""

from radarsim.studies.interface import Paper

PAPER = Paper(
    "Uss, Baryshev & Djavad 2010",
    page="discriminator",
    may_grow=("estimators",),
    held_too={
        "discriminator_as_printed": ("P4.13", "P4.14", "P4.15", "P4.16", "P4.18"),
        "discriminator_prior": ("P4.8",),
        "discriminator_noise": ("P4.9",),
        "discriminator_forecast": ("P4.10",),
    },
)
