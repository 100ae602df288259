"""P3 (Butyrskiy): smoothing and extrapolation of sonar plots, missed plots, correlated errors."""

from typing import ClassVar

from radarsim.studies.interface import Study


class Sonar(Study):
    """P3, as `study: sonar`."""

    name = "sonar"
    about = "P3 (Butyrskiy): smoothing and extrapolation of sonar plots, missed plots, correlated errors."
    filters: ClassVar = {
        "kind: growing_memory": "least squares on all plots so far, the recursion (12)-(14)",
        "kind: window": "least squares on the last `plots` plots",
        "kind: kalman": "Kalman-Bucy (11), with manoeuvre_variance or without",
        "kind: fixed_gain": "α-β (degree 1) or α-β-γ (degree 2) at the steady gains",
        "kind: kalman_augmented": "plots' errors estimated beside the state, for correlated errors",
        "kind: kalman_differenced": "differences of neighbouring plots, for correlated errors",
        "kind: adaptive": "growing memory, begun anew, raised or cut short by a detector of manoeuvres (3)",
        "association: nearest": "a tracker among false plots: the nearest plot in the gate; of kind kalman, degree 1",
        "association: pda": "a tracker with probabilistic data association",
        "association: known": "a filter told which plots are the target's, beside the trackers",
        "kind: imm": "two Kalman filters that interact, steady and manoeuvring",
    }

    def keys(self):
        from radarsim.studies.sonar import config

        return config.Sonar

    def computes_in(self, spec):
        return "radarsim.studies.sonar.study", "radarsim.studies.sonar.config"

    def prepare(self, case):
        from radarsim.studies.sonar import study

        return study.prepare(case)

    def simulate(self, plan, first, count):
        from radarsim.studies.sonar import study

        return study.simulate(plan, first, count)

    def tables(self, results):
        from radarsim.studies.sonar import tables

        return tables.tables(results)

    def figures(self, results, made, experiment):
        from radarsim.studies.sonar import figures

        return figures.figures(results, made, experiment)

    def question(self, experiment):
        from radarsim.studies.sonar import tables

        return tables.question(experiment)

    def answer(self, results, made):
        from radarsim.studies.sonar import tables

        return tables.answer(results, made)

    def claims(self):
        from radarsim.report.claims import PaperClaims
        from radarsim.studies.sonar import claims, measures

        return PaperClaims(claims.CLAIMS, measures.Evidence, may_grow=("filters",))

    def recorded(self):
        from radarsim.studies.sonar import track

        return track.Recorded()


STUDY = Sonar()
