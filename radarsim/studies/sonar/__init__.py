"""P3 (Butyrskiy): smoothing and extrapolation of sonar plots, missed plots, correlated errors."""

from collections.abc import Mapping, Sequence
from typing import ClassVar, TypeVar

from radarsim.studies.interface import RecordedPlots, Study
from radarsim.studies.sonar.part import SonarPart

Asked = TypeVar("Asked")  # a case, or the result of one


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
        "association: known": "a filter that is given the target's plots, beside the trackers",
        "kind: imm": "two Kalman filters that interact, steady and manoeuvring",
    }

    def keys(self):
        from radarsim.studies.sonar import schema

        return schema.Sonar

    def computes_in(self, spec):
        part = f"{__name__}.{spec.parts[-1]}"
        keys = __name__ if spec.parts[-1] == "smoothing" else part
        return f"{part}.study", f"{keys}.config"

    def prepare(self, case):
        # Not by way of `parts`: what a case is computed with is read off these imports, and what shows it is not.
        match case.spec.parts[-1]:
            case "smoothing":
                from radarsim.studies.sonar.smoothing import study
            case "manoeuvre":
                from radarsim.studies.sonar.manoeuvre import study
            case "clutter":
                from radarsim.studies.sonar.clutter import study
        return study.prepare(case)

    def simulate(self, plan, first, count):
        return plan.simulate(first, count)

    def tables(self, results):
        from radarsim.studies.sonar import tables

        made = tables.tables(results)
        for part, own in asked_of(results):
            made |= part.tables(own)
        return {name: table for name, table in made.items() if len(table)}

    def figures(self, results, made, experiment):
        from radarsim.studies.sonar import figures

        drawn = figures.figures(results, made, experiment)
        for part, own in asked_of(results):
            drawn |= part.figures(own, made)
        return {name: figure for name, figure in drawn.items() if figure}

    def question(self, experiment):
        part, cases = asked_of(experiment.cases)[-1]
        return part.question([case.spec for case in cases])

    def answer(self, results, made):
        return [sentence for part, own in reversed(asked_of(results)) for sentence in part.answer(own, made)]

    def claims(self):
        from radarsim.report.claims import PaperClaims
        from radarsim.studies.sonar.measures import Evidence

        claims = [claim for part in parts().values() for claim in part.claims()]
        claims.sort(key=lambda claim: int(claim.id.partition(".")[2]))
        return PaperClaims(claims, Evidence, paper="Butyrskiy", page="sonar", may_grow=("filters",))

    def recorded(self):
        return Recorded()


class Recorded(RecordedPlots):
    """The study's side of `radarsim track` and `radarsim simulate`."""

    def columns(self, spec):
        from radarsim.studies.sonar import track

        return track.plot_columns(spec)

    def sigmas(self, spec):
        from radarsim.studies.sonar import track

        return track.sigmas(spec)

    def scan_period_s(self, spec):
        return spec.sensor.scan_period_s

    def simulated(self, case, realisation):
        return part_of(case.spec).simulated(case, realisation)

    def tracker(self, case):
        return part_of(case.spec).tracker(case)


# ---- which part -----------------------------------------------------------------------------------------------------
def parts() -> Mapping[str, SonarPart]:
    """The parts by name, each after those whose questions are asked of its cases too."""
    from radarsim.studies.sonar import clutter, manoeuvre, smoothing

    return {"smoothing": smoothing.PART, "manoeuvre": manoeuvre.PART, "clutter": clutter.PART}


def part_of(spec) -> SonarPart:
    """The part that computes a case."""
    return parts()[spec.parts[-1]]


def asked_of(cases: Sequence[Asked]) -> list[tuple[SonarPart, list[Asked]]]:
    """Each part of which some case, or result, asks, with all that do."""
    found = [(part, [case for case in cases if name in case.spec.parts]) for name, part in parts().items()]
    return [(part, own) for part, own in found if own]


STUDY = Sonar()
