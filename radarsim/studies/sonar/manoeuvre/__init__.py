"""P3: detection of manoeuvres, filters that respond to them, uses of a track."""

from radarsim.studies.sonar.part import SonarPart


class Manoeuvre(SonarPart):
    """The part as the study sees it."""

    def tables(self, results):
        from radarsim.studies.sonar.manoeuvre import tables

        return tables.tables(results)

    def figures(self, results, made):
        from radarsim.studies.sonar.manoeuvre import figures

        return figures.figures(results, made)

    def question(self, specs):
        from radarsim.studies.sonar.manoeuvre import words

        return words.question(specs)

    def answer(self, results, made):
        from radarsim.studies.sonar.manoeuvre import words

        return words.answer(results, made)

    def claims(self):
        from radarsim.studies.sonar.manoeuvre import claims

        return claims.CLAIMS

    def tracker(self, case):
        from radarsim.studies.sonar.manoeuvre import track

        return track.Tracker(case)


PART = Manoeuvre()
