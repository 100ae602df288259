"""The claims of P1: range-only against range + Doppler Kalman filters."""

from radarsim.studies.interface import Paper

PAPER = Paper(
    "Gorshkov & Zavizhenets 2017",
    page="range_doppler",
    may_shorten=("scans",),
    held_too={
        "rls1": ("P1.1", "P1.2", "P1.3", "P1.17", "P1.29"),
        **dict.fromkeys(("rls2", "rls2_manoeuvre_variance", "rls2_manoeuvres"), ("P1.18", "P1.23", "P1.28")),
        "manoeuvre_variance": tuple(f"P1.{number}" for number in range(1, 37)),
    },
)
