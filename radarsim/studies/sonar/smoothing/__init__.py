"""P3: smoothing and extrapolation of plots, missed ones, correlated errors."""

from radarsim.studies.sonar.part import SonarPart


class Smoothing(SonarPart):
    """The part as the study sees it."""

    def tables(self, results):
        from radarsim.studies.sonar.smoothing import tables

        return tables.tables(results)

    def figures(self, results, made):
        from radarsim.studies.sonar.smoothing import figures

        return figures.figures(results, made)

    def question(self, specs):
        from radarsim.studies.sonar.smoothing import words

        return words.question(specs)

    def answer(self, results, made):
        from radarsim.studies.sonar.smoothing import words

        return words.answer(results, made)

    def claims(self):
        from radarsim.studies.sonar.smoothing import claims

        return claims.CLAIMS

    def tracker(self, case):
        from radarsim.studies.sonar import track

        return track.Tracker(case)


PART = Smoothing()
