"""A Kalman filter against a fixed gain on a random walk.

Yours: the question of your study, and where it comes from.
"""

from radarsim.studies.folder import StudyFolder
from radarsim.studies.interface import Paper

# Its parts are functions in the files of this folder, listed in radarsim.studies.folder. A study with other files
# derives a class from radarsim.studies.interface.Study.
STUDY = StudyFolder(
    package=__name__,
    # Yours: the entry point's name, and one line for `radarsim list`.
    name="random_walk",
    about="Random walk (textbook): a Kalman filter against a filter of fixed gain.",
    # Yours: the choice of filters: the keys, and what each makes.
    filters={
        "kind: kalman": "Kalman filter for the random walk, started from the first plot",
        "kind: fixed_gain": "exponential smoothing with `gain`, started from the first plot",
    },
    # Yours: how tables cite the paper, and the lists a user may extend without making it another experiment.
    paper=Paper("Kalman 1960", may_grow=("filters",)),
    # Yours: the optional parts that you have written.
    offers=("recorded", "shipped"),
)
