"""P1 (Gorshkov & Zavizhenets 2017): range-only against range + Doppler Kalman filters of the second order."""

from radarsim.report.quantities import FLOORS
from radarsim.studies.folder import StudyFolder
from radarsim.studies.interface import Paper

STUDY = StudyFolder(
    package=__name__,
    name="range_doppler",
    about="P1 (Gorshkov & Zavizhenets 2017): range-only against range + Doppler Kalman filters of the second order.",
    filters={
        "observes: [range]": "Kalman filter of the second order on range, started by least squares on three scans",
        "observes: [range, velocity]": "the same on range and radial velocity, started on two scans",
        "kind: NAME": "a filter of an installed package (entry points radarsim.filters), by its gains at every scan",
    },
    paper=Paper(
        "Gorshkov & Zavizhenets 2017",
        page="range_doppler",
        may_shorten=("scans",),
        held_too={
            "rls1": ("P1.1", "P1.2", "P1.3", "P1.17", "P1.29"),
            **dict.fromkeys(("rls2", "rls2_manoeuvre_variance", "rls2_manoeuvres"), ("P1.18", "P1.23", "P1.28")),
            "manoeuvre_variance": tuple(f"P1.{number}" for number in range(1, 37)),
        },
    ),
    offers=(
        "gains",
        "inputs",
        "interpretations",
        "recorded",
        "chart",
        "shortened",
        "exact_but_for",
        "costly",
        "errors",
        "seconds_at_most",
        "own_filters",
        "floor",
    ),
    own_quantities=FLOORS,
)
