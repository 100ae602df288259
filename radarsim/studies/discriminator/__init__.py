"""P4 (Uss, Baryshev & Djavad 2010): Doppler frequency and its derivatives from one burst, and how often they lock."""

from typing import ClassVar

from radarsim.studies.interface import Study


class Discriminator(Study):
    """P4, as `study: discriminator`."""

    name = "discriminator"
    about = "P4 (Uss, Baryshev & Djavad 2010): Doppler frequency and derivatives from one burst, how often they lock."
    filters: ClassVar = {
        "method: sequence": "discriminators over windows that grow to the whole burst, Fisher scoring in each",
        "method: ridge": "the classical rival: short-time spectrum, robust fit, unwrapping, then scoring; no prior",
    }

    exact_errors = False  # exact_sigma is the bound, which an estimator reaches or does not
    draws_sweeps = True  # lock is what is swept for, and has figures of its own

    def keys(self):
        from radarsim.studies.discriminator import config

        return config.Discriminator

    def computes_in(self, spec):
        return "radarsim.studies.discriminator.study", "radarsim.studies.discriminator.config"

    def prepare(self, case):
        from radarsim.studies.discriminator import study

        return study.prepare(case)

    def simulate(self, plan, first, count):
        from radarsim.studies.discriminator import study

        return study.simulate(plan, first, count)

    def tables(self, results):
        from radarsim.studies.discriminator import tables

        return tables.tables(results)

    def figures(self, results, made, experiment):
        from radarsim.studies.discriminator import figures

        return figures.figures(results, made, experiment)

    def question(self, experiment):
        from radarsim.studies.discriminator import words

        return words.question(experiment)

    def answer(self, results, made):
        from radarsim.studies.discriminator import words

        return words.answer(results, made)

    def curves(self, results):
        from radarsim.studies.discriminator import tables

        return tables.curves(results)

    def claims(self):
        from radarsim.report.claims import PaperClaims
        from radarsim.studies.discriminator import claims, measures

        return PaperClaims(
            claims.CLAIMS,
            measures.Evidence,
            paper="Uss, Baryshev & Djavad 2010",
            page="discriminator",
            may_grow=("estimators",),
        )


STUDY = Discriminator()
