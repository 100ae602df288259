"""From pulses to tracks: what a burst's estimate of velocity and acceleration is worth to the track (P4 into P1)."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from radarsim.report.quantities import COMMON, FLOORS, LOCK, LOST, RIGHT, WRONG, Quantity
from radarsim.studies.interface import Study

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from radarsim.config.experiment import Case, Experiment
    from radarsim.engine.results import CaseResult
    from radarsim.report.drawing.model import Figure
    from radarsim.report.sentences import Sentence
    from radarsim.studies.floors.bound import Floor
    from radarsim.studies.pulses_to_tracks.config import Keys
    from radarsim.studies.pulses_to_tracks.study import Plan


class PulsesToTracks(Study):
    """P4's estimates in P1's tracks, as `study: pulses_to_tracks`."""

    name = "pulses_to_tracks"
    about = "Beyond P1 and P4: Doppler estimated from bursts, which may fail to lock, and the resulting tracks."
    filters = {
        "observes: [range]": "Kalman filter on range alone, which needs no burst",
        "estimator: sequence": "with the velocity, or velocity and acceleration, that P4's sequence estimates",
        "estimator: dense": "twice as many windows; cured: the sequence corrected by a search where coherence is short",
        "estimator: spectrum": "the same by the classical method: the peak of the spectrum, then Fisher scoring",
        "estimator: fisher_bound": "the idealisation: Gaussian errors at the Cramér–Rao bound, which always lock",
    }

    def keys(self) -> "type[Keys]":
        from radarsim.studies.pulses_to_tracks.config import Keys

        return Keys

    def quantities(self, spec: "Keys | None" = None) -> tuple[Quantity, ...]:
        return (*COMMON, LOCK, LOST, RIGHT, WRONG, *FLOORS)

    def without_manoeuvre(self, spec: "Keys") -> Mapping[str, Any]:
        from radarsim.studies.radial_truth import resting_target

        return {"target": resting_target(spec.target)}

    def prepare(self, case: "Case") -> "Plan":
        from radarsim.studies.pulses_to_tracks import study

        return study.prepare(case)

    def computing_modules(self, spec: "Keys", plots: bool) -> Sequence[str]:
        return f"{__name__}.config", f"{__name__}.study"

    def simulate(self, plan: "Plan", first: int, count: int) -> "np.ndarray":
        from radarsim.studies.pulses_to_tracks import study

        return study.simulate(plan, first, count)

    def floor(self, spec: "Keys", axes: Any) -> "Floor | None":
        from radarsim.studies.pulses_to_tracks import floor

        return floor.floor(spec, axes)

    def tables(self, results: "Sequence[CaseResult]") -> "dict[str, pd.DataFrame]":
        from radarsim.studies.pulses_to_tracks import tables

        return tables.tables(results)

    def inputs(self, results: "Sequence[CaseResult]") -> "pd.DataFrame":
        from radarsim.studies.pulses_to_tracks import tables

        return tables.inputs(results)

    def figures(
        self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]", experiment: "Experiment"
    ) -> "dict[str, Figure]":
        from radarsim.studies.pulses_to_tracks import figures

        return figures.figures(results, tables, experiment)

    def drawn_from(self) -> Mapping[str, Sequence[str]]:
        from radarsim.studies.pulses_to_tracks import figures

        return figures.DRAWN_FROM

    def question(self, experiment: "Experiment") -> str:
        from radarsim.studies.pulses_to_tracks import answer

        return answer.question(experiment)

    def answer(self, results: "Sequence[CaseResult]", tables: "Mapping[str, pd.DataFrame]") -> "Sequence[Sentence]":
        from radarsim.studies.process_noise_answer import best_noise
        from radarsim.studies.pulses_to_tracks import answer

        return [*best_noise(self, results, tables).sentences, *answer.answer(results, tables)]

    def warnings(self, experiment: "Experiment") -> Sequence[str]:
        from radarsim.studies.pulses_to_tracks import answer

        return answer.warnings(experiment)


STUDY = PulsesToTracks()
