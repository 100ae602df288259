"""A Kalman filter against a fixed gain on a random walk.

Yours: the question of your study, and where it comes from.
"""

from pathlib import Path
from typing import ClassVar

from radarsim.studies.interface import Study


class RandomWalkStudy(Study):
    """The study, as `study: random_walk`. Its methods import when they are called: `radarsim list` loads no kernels."""

    # Yours: the entry point's name, and one line for `radarsim list`.
    name = "random_walk"
    about = "Random walk (textbook): a Kalman filter against a filter of fixed gain."
    # Yours: what a user may choose among the filters: the keys, and what they make.
    filters: ClassVar = {
        "kind: kalman": "Kalman filter for the random walk, started from the first plot",
        "kind: fixed_gain": "exponential smoothing with `gain`, started from the first plot",
    }

    def keys(self):
        from random_walk import config

        return config.Keys

    def prepare(self, case):
        from random_walk import study

        return study.prepare(case)

    def simulate(self, plan, first, count):
        from random_walk import study

        return study.simulate(plan, first, count)

    def tables(self, results):
        from random_walk import tables

        return tables.tables(results)

    def figures(self, results, made, experiment):
        from random_walk import figures

        return figures.figures(results, made, experiment)

    def question(self, experiment):
        from random_walk import words

        return words.question(experiment)

    def answer(self, results, made):
        from random_walk import words

        return words.answer(results, made)

    # The methods below are optional: radarsim.studies.interface.Study says what each does, and what its default is.
    def claims(self):
        from radarsim.report.claims import PaperClaims

        from random_walk import claims

        # Yours: how tables cite the paper, and to which lists a user may add without its being another experiment.
        return PaperClaims(claims.CLAIMS, claims.Evidence, paper="Kalman 1960", may_grow=("filters",))

    def recorded(self):
        from random_walk import track

        return track.Recorded()

    def shipped(self):
        return Path(__file__).parent / "shipped"


STUDY = RandomWalkStudy()
