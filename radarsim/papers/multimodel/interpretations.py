"""What P2 leaves open, and its claims under each interpretation.

The claims are judged by small runs of the shipped configs with another flight, σ_A, output, start or bank."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from radarsim.config.experiment import Case
from radarsim.papers.authoring import (
    ChangedResults,
    Claim,
    Evidence,
    Interpretation,
    PaperClaims,
    PaperInterpretations,
    load_choices,
)
from radarsim.papers.multimodel import measures
from radarsim.studies.multimodel import tables
from radarsim.studies.multimodel.flights import FLIGHTS

AERODYNAMIC_CLAIM = "P2.4"  # speaks of another target than the lost flight


class Interpretations(PaperInterpretations):
    """P2's interpretations."""

    paper = "P2"
    choices = load_choices(Path(__file__).with_name("interpretations.yaml"))

    def changed_case(self, claim: Claim, case: Case, interpretation: Interpretation) -> Case | None:
        """The case with the flight, the banks, the output and the start of an interpretation."""
        spec = case.spec
        if claim.id == AERODYNAMIC_CLAIM and not measures.is_flight(spec.target, "airliner"):
            return None
        changes = self.settings(interpretation)
        if claim.id != AERODYNAMIC_CLAIM:
            changes["target"] = FLIGHTS.get(interpretation["flight"], spec.target)
        period = spec.sensor.scan_period_s
        interpretation = self.restricted_to(interpretation, claim.id)
        changes["filters"] = tuple(_changed(filter_keys, interpretation, period) for filter_keys in spec.filters)
        return replace(case, spec=spec.model_copy(update=changes))

    def evidence(
        self,
        claim: Claim,
        interpretation: Interpretation,
        changed_results: ChangedResults | None,
        paper_claims: PaperClaims,
    ) -> Evidence:
        assert changed_results is not None  # nothing of P2 is exact
        return FlightEvidence(changed_results)


def _changed(filter_keys: Any, interpretation: Interpretation, period_s: float) -> Any:
    """A filter as an interpretation has it."""
    changes: dict[str, Any] = {}
    if filter_keys.family != "kalman" and filter_keys.output == "best":
        changes["output"] = interpretation["output"]
    models = filter_keys.models
    if (
        interpretation["bank"] == "accelerated"
        and len(models) == 2
        and len({m.sigma_acceleration_mps2 for m in models}) == 1
    ):
        halved = models[1].model_copy(update={"sigma_acceleration_mps2": models[1].sigma_acceleration_mps2 / 2})
        models = (halved, models[1])
    sigma_meaning = interpretation["sigma_acceleration"]
    if sigma_meaning != "per step":
        models = tuple(
            m.model_copy(update={"sigma_acceleration_mps2": m.sigma_acceleration_mps2 * period_s})
            if m.motion == "accelerated" or sigma_meaning == "per second, both motions"
            else m
            for m in models
        )
    return filter_keys.model_copy(update={**changes, "models": models})


class FlightEvidence(measures.Evidence):
    """The flights under an interpretation, found by the settings of the shipped filters; stages are those of the
    flights."""

    def __init__(self, changed_results: ChangedResults):
        super().__init__(changed_results.results, changed_results.tables, changed_results.places)
        self._ran = {result.name: result for result in changed_results.run_results}

    def stage(self, key: Any, name: str) -> int:
        """The number of a stage of a flight."""
        return tables.stage_names(self._ran[self.case(key).name]).index(name)

    def _bounds(self, result: Any, stage: str) -> tuple[float, float]:
        return super()._bounds(self._ran[result.name], stage)
