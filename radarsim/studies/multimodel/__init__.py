"""P2 (Sychev & Osipov 2023): multiple-model filters on an aeroballistic target, families × merging rules."""

from typing import ClassVar

from radarsim.studies.interface import Study


class Multimodel(Study):
    """P2, as `study: multimodel`."""

    name = "multimodel"
    about = "P2 (Sychev & Osipov 2023): multiple-model filters on an aeroballistic target, families × merging rules."
    filters: ClassVar = {
        "family": "kalman, gpb1 (MMA1), imm (MMA2), gpb2 (MMA3) with a bank of one to five motion models",
        "merge": "rule of the partial merges: moment, best, combined, modified_combined",
        "output": "rule by which the estimate is made: moment, best",
        "covariance_at": "the plot's covariance at the plot or at its prediction",
    }

    def keys(self):
        from radarsim.studies.multimodel import config

        return config.Multimodel

    def computes_in(self, spec):
        return "radarsim.studies.multimodel.study", "radarsim.studies.multimodel.config"

    def prepare(self, case):
        from radarsim.studies.multimodel import study

        return study.prepare(case)

    def simulate(self, plan, first, count):
        from radarsim.studies.multimodel import study

        return study.simulate(plan, first, count)

    def tables(self, results):
        from radarsim.studies.multimodel import tables

        return tables.tables(results)

    def figures(self, results, made, experiment):
        from radarsim.studies.multimodel import figures

        return figures.figures(results, made, experiment)

    def question(self, experiment):
        from radarsim.studies.multimodel import words

        return words.question(experiment)

    def answer(self, results, made):
        from radarsim.studies.multimodel import words

        return words.answer(results, made)

    def seconds_per_update(self, plan):
        from radarsim.studies.multimodel import cost

        return cost.seconds_per_update(plan)

    def cost(self, made, run):
        from radarsim.studies.multimodel import tables

        return tables.cost(made, run)

    def claims(self):
        from radarsim.report.claims import PaperClaims
        from radarsim.studies.multimodel import claims, measures

        return PaperClaims(
            claims.CLAIMS, measures.Evidence, paper="Sychev & Osipov 2023", page="multimodel", may_grow=("filters",)
        )

    def recorded(self):
        from radarsim.studies.multimodel import track

        return track.Recorded()


STUDY = Multimodel()
