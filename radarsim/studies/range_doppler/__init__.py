"""P1 (Gorshkov & Zavizhenets 2017): range-only against range + Doppler Kalman filters of the second order."""

from radarsim.report.quantities import FLOORS
from radarsim.studies.folder import StudyFolder

STUDY = StudyFolder(
    package=__name__,
    name="range_doppler",
    about="P1 (Gorshkov & Zavizhenets 2017): range-only against range + Doppler Kalman filters of the second order.",
    filters={
        "observes: [range]": "Kalman filter of the second order on range, started by least squares on three scans",
        "observes: [range, velocity]": "the same on range and radial velocity, started on two scans",
        "kind: NAME": "a filter of an installed package (entry points radarsim.filters), by its gains at every scan",
    },
    offers=(
        "gains",
        "inputs",
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
