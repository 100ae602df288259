"""P3: tracks among false plots."""

from radarsim.studies.sonar.part import SonarPart


class Clutter(SonarPart):
    """The part as the study sees it."""

    def tables(self, results):
        from radarsim.studies.sonar.clutter import tables

        return tables.tables(results)

    def figures(self, results, made):
        from radarsim.studies.sonar.clutter import figures

        return figures.figures(results, made)

    def question(self, specs):
        from radarsim.studies.sonar.clutter import words

        return words.question(specs)

    def answer(self, results, made):
        from radarsim.studies.sonar.clutter import words

        return words.answer(results, made)

    def simulated(self, case, realisation):
        from radarsim.studies.sonar.clutter import track

        return track.simulated(case, realisation)

    def tracker(self, case):
        from radarsim.studies.sonar.clutter import track

        return track.Tracker(case)


PART = Clutter()
