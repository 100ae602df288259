"""The claims of P3: smoothing of sonar plots; those on manoeuvres lie in the folder `manoeuvre`."""

from radarsim.studies.interface import Paper

ON_SMOOTHING = tuple(f"P3.{number}" for number in (1, 2, 3, 4, 11, 14, 16, 18))  # of the config sonar_smoothing
PAPER = Paper("Butyrskiy", page="sonar", may_grow=("filters",), held_too={"sonar_fluctuating": ON_SMOOTHING})
