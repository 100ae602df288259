"""P1 (Gorshkov & Zavizhenets 2017): range-only against range + Doppler Kalman filters of the second order."""

from typing import ClassVar

from radarsim.studies.interface import Study


class RangeDoppler(Study):
    """P1, as `study: range_doppler`."""

    name = "range_doppler"
    about = "P1 (Gorshkov & Zavizhenets 2017): range-only against range + Doppler Kalman filters of the second order."
    filters: ClassVar = {
        "observes: [range]": "Kalman filter of the second order on range, started by least squares on three scans",
        "observes: [range, velocity]": "the same on range and radial velocity, started on two scans",
    }

    def keys(self):
        from radarsim.studies.range_doppler import config

        return config.RangeDoppler

    def computes_in(self, spec):
        return "radarsim.studies.range_doppler.study", "radarsim.studies.range_doppler.config"

    def prepare(self, case):
        from radarsim.studies.range_doppler import study

        return study.prepare(case)

    def simulate(self, plan, first, count):
        from radarsim.studies.range_doppler import study

        return study.simulate(plan, first, count)

    def tables(self, results):
        from radarsim.studies.range_doppler import tables

        return tables.tables(results)

    def figures(self, results, made, experiment):
        from radarsim.studies.range_doppler import figures

        return figures.figures(results, made, experiment)

    def question(self, experiment):
        from radarsim.studies.range_doppler import words

        return words.question(experiment)

    def answer(self, results, made):
        from radarsim.studies.range_doppler import words

        return words.answer(results, made)

    def inputs(self, results):
        from radarsim.studies.range_doppler import tables

        return tables.inputs(results)

    def claims(self):
        from radarsim.report.claims import PaperClaims
        from radarsim.studies.range_doppler import claims, measures

        return PaperClaims(claims.CLAIMS, measures.Evidence, paper="Gorshkov & Zavizhenets 2017", page="range_doppler")

    def recorded(self):
        from radarsim.studies.range_doppler import track

        return track.Recorded()


STUDY = RangeDoppler()
