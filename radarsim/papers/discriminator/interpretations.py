"""What P4 leaves open, and its claims under each interpretation.

Spreads and windows are exact. Locks and accuracies are small runs of the shipped configs whose noise, forecast and
windows are those of the interpretation."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, cast

import numpy as np

from radarsim.bursts import schedule_design
from radarsim.config.experiment import Case
from radarsim.papers.authoring import (
    ChangedResults,
    Claim,
    Estimate,
    Evidence,
    ImpossibleInterpretation,
    Interpretation,
    PaperClaims,
    PaperInterpretations,
    Part,
    exact_number,
    load_choices,
)
from radarsim.papers.discriminator import burst_versions, measures
from radarsim.papers.discriminator.burst_versions import BURST, MIN_ENERGY_RATIO, PRINTED_PRIOR, Version
from radarsim.papers.discriminator.measures import COMPONENTS, COMPUTED, PRINTED
from radarsim.papers.verdict_rule import AGAINST

SHIPPED_NOISE = measures.INTERPRETATIONS[COMPUTED][0]
OTHER_THRESHOLD = {0.5: 1.0, 1.0: 0.5}
ITERATIONS = "12"  # the number of the part that counts windows
EXACT_CLAIMS = ("P4.1", "P4.2", "P4.3", "P4.8", "P4.11", "P4.12", "P4.13", "P4.20")
WINDOW_CLAIMS = ("P4.2", "P4.3", "P4.8", "P4.11", "P4.12", "P4.13", "P4.20")
NO_ROOT = "(15) has no root: with the phase in it, its left side exceeds c at every length"


class Interpretations(PaperInterpretations):
    """P4's interpretations."""

    paper = "P4"
    choices = load_choices(Path(__file__).with_name("interpretations.yaml"))
    realisations = 4000  # with 500 the interval of P4.6 reaches over its limit, though not over the margin
    max_realisations = 1_024_000  # P4.4: σ of the locked bursts is up to 0.6 % off, of the 1 % that it may be

    def is_exact(self, claim: Claim, interpretation: Interpretation) -> bool:
        return claim.id in EXACT_CLAIMS

    def for_claim(self, claim: str) -> list[Interpretation]:
        """All combinations of E and U for exact claims; for claims that need runs, of the choices that bear on them."""
        choices = [choice for choice in self.choices if choice.affects(claim)]
        singly = [
            self.interpretation(**{choice.key: alternative.name})
            for choice in choices
            for alternative in choice.alternatives
            if alternative.kind == AGAINST
        ]
        return list(dict.fromkeys([*self.combinations(choices), *singly]))

    def parts(self, claim: Claim, interpretation: Interpretation) -> Sequence[Part]:
        """Of parts that stand there in both shipped interpretations, those of one: the interpretation takes its
        place."""
        asserted = [part for part in claim.parts if part.asserted]
        both = {COMPUTED, PRINTED} <= {part.cases[0] for part in asserted}
        return [_counted(part, interpretation) for part in asserted if not both or part.cases[0] != PRINTED]

    def changed_case(self, claim: Claim, case: Case, interpretation: Interpretation) -> Case | None:
        """The case with the noise and forecast of an interpretation, and its windows in place of those of its
        estimators. One of the two shipped interpretations takes the place of any; of the sweeps, those that a part asks
        for."""
        keys = {key for part in claim.parts for key in part.cases if isinstance(key, tuple)}
        noise = case.spec.burst.noise_variance
        is_needed = any(_is_swept(case, *key) for key in keys) if case.swept_values else noise == SHIPPED_NOISE
        if not is_needed:
            return None
        burst_version = version(interpretation)
        forecast = {
            "sigma": burst_version.sigma,
            "spread_over_potential": None if burst_version.sigma else BURST.multiples,
        }
        changes = {
            "burst": case.spec.burst.model_copy(
                update={"noise_variance": noise * burst_version.noise_variance / SHIPPED_NOISE}
            ),
            "prior": case.spec.prior.model_copy(update=forecast),
            "estimators": tuple(_changed(estimator, burst_version) for estimator in case.spec.estimators),
        }
        return replace(case, spec=case.spec.model_copy(update=changes))

    def evidence(
        self,
        claim: Claim,
        interpretation: Interpretation,
        changed_results: ChangedResults | None,
        paper_claims: PaperClaims,
    ) -> Evidence:
        if changed_results is None:
            return ExactEvidence(interpretation)
        return super().evidence(claim, interpretation, changed_results, paper_claims)


def _is_swept(case: Case, key: str, value: float) -> bool:
    """Whether a case varies this key alone, and takes this value."""
    return (
        len(case.swept_values) == 1
        and case.swept_values[0][0] == key
        and math.isclose(float(str(case.swept_values[0][1])), value)
    )


def _changed(estimator: Any, burst_version: Version) -> Any:
    """An estimator as an interpretation has it: its threshold, and the windows that no key of a config asks for.

    Those of which no claim speaks are cut to one window: they are not looked at."""
    kind = measures.kind_of(estimator, measures.INTERPRETATIONS[COMPUTED][1])
    if kind == "other":
        return estimator.model_copy(update={"first_windows": 1, "phases": 0, "steps": 5, "density": 1})
    if estimator.schedule != "designed":
        return estimator
    changes: dict[str, Any] = {"main_lobe_threshold": burst_version.threshold}
    if burst_version.curvature != "next":
        lengths = tuple(n * BURST.period_s for n in windows(burst_version))
        changes |= {"schedule": lengths[: estimator.first_windows], "first_windows": None}
    return estimator.model_copy(update=changes)


def _counted(part: Part, interpretation: Interpretation) -> Part:
    """A part that counts windows, of all of them where an interpretation counts the first too."""
    if part.number != ITERATIONS or interpretation["counted"] != "in all":
        return part
    return replace(part, measure=lambda evidence: exact_number(len(evidence.windows(COMPUTED))))


def version(interpretation: Interpretation) -> Version:
    """What the interpretations' names mean for (14) to (16)."""
    return Version(
        float(interpretation["noise_variance"]),
        float(interpretation["threshold"]),
        float(interpretation["factor"]),
        PRINTED_PRIOR if interpretation["forecast"] == "numbers" else None,
        cast(burst_versions.Phase, interpretation["first_phase"]),
        cast(burst_versions.Rounding, interpretation["rounding"]),
        cast(burst_versions.Curvature, interpretation["curvature"]),
        int(interpretation["pulses"]),
        cast(burst_versions.Sum, interpretation["sum"]),
    )


SCALES = (10.0, 1.0, 0.1, 0.01, 0.001)  # of the forecast, in P4.8


@cache
def _designed() -> Mapping[Version, tuple[np.ndarray, list[int] | None]]:
    """Spreads and windows of every version that a declared interpretation asks for, all at once."""
    interpretations = Interpretations()
    distinct = {
        version(interpretation)
        for claim in ("P4.1", *WINDOW_CLAIMS)
        for interpretation in interpretations.for_claim(claim)
    }
    versions = list(distinct)
    designs = burst_versions.design_windows(BURST, versions)
    return {
        burst_version: (spreads, lengths)
        for burst_version, spreads, lengths in zip(versions, designs.spreads, designs.windows, strict=True)
    }


@cache
def _scaled() -> Mapping[tuple[Version, float], int | None]:
    """The first windows with the forecast's spreads times each of SCALES."""
    distinct = {version(interpretation) for interpretation in Interpretations().for_claim("P4.8")}
    scaled = [(burst_version, scale) for burst_version in distinct for scale in SCALES]
    versions = []
    for burst_version, scale in scaled:
        sigma = burst_version.sigma or tuple(np.array(BURST.multiples) * _designed()[burst_version][0])
        versions.append(burst_version._replace(sigma=tuple(scale * float(value) for value in sigma)))
    first = burst_versions.first_windows(BURST, versions)
    return {key: int(n) or None for key, n in zip(scaled, first, strict=True)}


def windows(burst_version: Version) -> list[int]:
    """The windows of a version in pulses; raises ImpossibleInterpretation where there are none."""
    designs = _designed()
    lengths = (
        designs[burst_version][1]
        if burst_version in designs
        else burst_versions.design_windows(BURST, [burst_version]).windows[0]
    )
    if lengths is None:
        raise ImpossibleInterpretation(NO_ROOT)
    return lengths


class ExactEvidence(measures.Evidence):
    """P4's spreads and windows under an interpretation, whatever interpretation of the shipped ones a part asks for."""

    def __init__(self, interpretation: Interpretation):
        super().__init__((), {}, {})
        self._version = version(interpretation)
        c = self._version.threshold
        self._lobe = c if interpretation["lobe"] == "one c" else OTHER_THRESHOLD[c]

    def windows(self, key: Any, kind: str = "sequence") -> np.ndarray:
        """Window lengths in s; of a forecast with the scale that a key of a sweep names, the first alone."""
        if isinstance(key, tuple):
            first = _scaled()[self._version, float(key[1])]
            if first is None:
                raise ImpossibleInterpretation(NO_ROOT)
            return np.array([first * BURST.period_s])
        return np.array(windows(self._version)) * BURST.period_s

    def potential(self, key: Any, component: str) -> Estimate:
        return exact_number(_designed()[self._version][0][COMPONENTS.index(component)])

    def worst_handover(self, key: Any) -> Estimate:
        """The largest probability over the hand-overs that Z passes c, by its own law; the last one is cut short."""
        weights = burst_versions.handover_weights(BURST, self._version, windows(self._version)[:-1])
        return exact_number(max(schedule_design.tail_probability(form_weights, self._lobe) for form_weights in weights))

    def phase_offsets(self, key: Any) -> np.ndarray:
        return burst_versions.phase_offsets(BURST, self._version, windows(self._version))

    def shortest_window(self, key: Any, amplitude: float) -> Estimate:
        """T_min (17), ms: one sample a pulse."""
        noise = self._version.noise_variance
        return exact_number(1e3 * 4 * MIN_ENERGY_RATIO * noise * BURST.period_s / amplitude**2)
