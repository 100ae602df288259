"""What P3 leaves open about manoeuvres, and its claims on them under each interpretation.

Times to see a manoeuvre are runs of the shipped config. Switching the degree of a window of a few plots is exact, and
so is a single test. What P3 says of smoothing is formulas, which leave nothing open but what a high accuracy is."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.papers.authoring import (
    ChangedResults,
    Claim,
    Estimate,
    Evidence,
    Interpretation,
    PaperClaims,
    PaperInterpretations,
    Part,
    exact_number,
    load_choices,
    with_arguments,
)
from radarsim.papers.sonar.manoeuvre import measures
from radarsim.papers.sonar.measures import Evidence as SonarEvidence
from radarsim.studies.sonar.manoeuvre import detection_laws
from radarsim.studies.sonar.manoeuvre.switched_window import switched_window

ENOUGH, DETECTS, SINGLE, SWITCHES = "P3.3", "P3.8", "P3.9", "P3.10"


class Interpretations(PaperInterpretations):
    """P3's interpretations."""

    paper = "P3"
    choices = load_choices(Path(__file__).with_name("interpretations.yaml"))
    realisations = 5000

    def is_exact(self, claim: Claim, interpretation: Interpretation) -> bool:
        return claim.id in (ENOUGH, SINGLE) or "plots" in self.settings(interpretation)

    def for_claim(self, claim: str) -> list[Interpretation]:
        """All combinations of the choices that bear on a claim."""
        return list(self.combinations([choice for choice in self.choices if choice.affects(claim)]))

    def parts(self, claim: Claim, interpretation: Interpretation) -> Sequence[Part]:
        if claim.id == ENOUGH:
            plots, criterion = _enough(interpretation["high_accuracy"])
            return [replace(part, what=criterion, measure=lambda evidence: exact_number(plots)) for part in claim.parts]
        if claim.id == SINGLE:
            strength = self.settings(interpretation)["shift"]
            probability = float(detection_laws.detection(1.0, strength))
            quantity = f"alarms a test at k = 1, five plots, acceleration of {strength:g} σ_a"
            if strength == 1:
                quantity = claim.parts[0].what
            return [
                replace(part, what=quantity, measure=lambda evidence: exact_number(probability), exact=None)
                for part in claim.parts
            ]
        if claim.id == SWITCHES and "plots" in self.settings(interpretation):
            return [_switched(part, interpretation["memory"], **self.settings(interpretation)) for part in claim.parts]
        asserted = [part for part in claim.parts if part.asserted]
        return (
            [_delay(part, interpretation["seen"], self.settings(interpretation)["rate"]) for part in asserted]
            if claim.id == DETECTS
            else asserted
        )

    def changed_case(self, claim: Claim, case: Case, interpretation: Interpretation) -> Case | None:
        """The weakest and the strongest manoeuvre of the sweep, tested and followed as an interpretation says."""
        target = case.spec.target
        if abs(target.acceleration_mps2) not in STRENGTHS:
            return None
        settings = self.settings(interpretation)
        changes: dict[str, Any] = {"target": target.model_copy(update={"end_s": target.start_s + settings["lasts_s"]})}
        if interpretation["tests"] == "batches":
            changes["detectors"] = tuple(
                detector_keys.model_copy(update={"test_every": detector_keys.plots})
                if detector_keys.test_every == 1
                else detector_keys
                for detector_keys in case.spec.detectors
            )
        changes["filters"] = tuple(
            _with_rate(filter_keys, settings["switching_rate"]) for filter_keys in case.spec.filters
        )
        return replace(case, spec=case.spec.model_copy(update=changes))

    def evidence(
        self,
        claim: Claim,
        interpretation: Interpretation,
        changed_results: ChangedResults | None,
        paper_claims: PaperClaims,
    ) -> Evidence:
        if changed_results is None:
            return SonarEvidence((), {}, {})
        return super().evidence(claim, interpretation, changed_results, paper_claims)


def _enough(criterion: str) -> tuple[int, str]:
    """Fewest plots that meet a criterion of high accuracy, by the closed forms after (2), and what these are."""
    n = np.arange(2, 100)
    smoothed, extrapolated = 2 * (2 * n - 1) / (n * (n + 1)), 2 * (2 * n + 1) / (n * (n - 1))  # variances, of a plot's
    is_met, meaning = {
        "predicted as measured": (extrapolated <= 1, "whose extrapolation is no worse than a plot"),
        "half the variance": (smoothed <= 0.5, "that smooth to half of a plot's variance"),
        "under 5 % more": (
            np.append(np.sqrt(smoothed[1:] / smoothed[:-1]) > 0.95, True),
            "to which a further one lowers the smoothed σ by under 5 %",
        ),
        "two thirds": (smoothed <= (2 / 3) ** 2, "that smooth to two thirds of a plot's σ"),
    }[criterion]
    return int(n[is_met][0]), f"fewest plots {meaning}"


EXTREMES = (measures.WEAK, measures.STRONG)
STRENGTHS = (0.1, 0.8)  # m/s²: the weakest and the strongest manoeuvre of the shipped sweep


def _with_rate(filter_keys: Any, rate: float) -> Any:
    """An adaptive filter with the interpretation's rate of false alarms."""
    if (
        filter_keys.detector is None
        or rate == measures.USUAL_FALSE_ALARM_RATE
        or filter_keys.detector.false_alarm_probability is None
    ):
        return filter_keys
    return filter_keys.model_copy(
        update={"detector": filter_keys.detector.model_copy(update={"false_alarm_probability": rate})}
    )


def _delay(part: Part, until: str, rate: float) -> Part:
    """A part on the time to detect a manoeuvre, with the interpretation's rate of false alarms and its event."""
    rate_words = "k = 1" if rate == measures.FALSE_ALARM_RATE_AT_ONE else f"{rate:g} false alarms a test"
    event = "the beginning" if until == "beginning" else until
    quantity = f"mean time to detect {event} of the {part.cases[0]} at {rate_words}"
    if part.statement == "time":
        return with_arguments(replace(part, what=f"{quantity}, 8 plots over 5"), until=until, rate=rate)
    if part.statement == "not worth while":
        comparison = f"{quantity}, over 5 plots against the best of 4–5"
        return with_arguments(replace(part, what=comparison), until=until, rate=rate)
    return part


def _switched(part: Part, memory: str, *, plots: int, switching_rate: float, **_: Any) -> Part:
    """A part on switching the degree, by the exact law of a window of a few plots."""
    degree = 1 if "degree 1" in part.what else 2
    acceleration = STRENGTHS[EXTREMES.index(part.cases[0])]

    def measure(_: Any) -> Estimate:
        window = switched_window(
            _course(acceleration), SIGMA_M, PERIOD_S, plots, plots, float(detection_laws.threshold(switching_rate))
        )
        errors = window.line if degree == 1 else window.parabola
        return exact_number(float(np.sqrt(np.mean(errors**2) / np.mean(window.switched**2))))

    return replace(part, what=part.what.replace("five plots", memory), measure=measure)


SIGMA_M, PERIOD_S, SCANS = 10.0, 5.0, 45  # of the shipped config
START_S, END_S = 100.0, 140.0


def _course(acceleration: float) -> np.ndarray:
    """Range (SCANS,) of the shipped accelerating target but for its steady motion, which no error depends on."""
    t = PERIOD_S * np.arange(SCANS)
    pushed = np.clip(t - START_S, 0, END_S - START_S)
    return acceleration * (pushed**2 / 2 + (END_S - START_S) * np.clip(t - END_S, 0, None))
