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

from radarsim.bursts import burst
from radarsim.config.experiment import Case
from radarsim.papers.claim import Claim, PaperClaims, Part
from radarsim.papers.claim_files import load_choices
from radarsim.papers.discriminator import burst_versions, measures
from radarsim.papers.discriminator.burst_versions import BURST, LEAST_RATIO, PRINTED_PRIOR, Version
from radarsim.papers.discriminator.measures import COMPONENTS, COMPUTED, PRINTED
from radarsim.papers.evidence import Evidence, exact_number
from radarsim.papers.interpretations import (
    ChangedResults,
    ImpossibleInterpretation,
    Interpretation,
    PaperInterpretations,
)
from radarsim.papers.verdict_rule import AGAINST
from radarsim.report.statistics import Estimate

SHIPPED_NOISE = measures.INTERPRETATIONS[COMPUTED][0]
OTHER_THRESHOLD = {0.5: 1.0, 1.0: 0.5}
ITERATIONS = "12"  # the number of the part that counts windows
EXACT = ("P4.1", "P4.2", "P4.3", "P4.8", "P4.11", "P4.12", "P4.13", "P4.20")
WINDOWS = ("P4.2", "P4.3", "P4.8", "P4.11", "P4.12", "P4.13", "P4.20")
NO_ROOT = "(15) has no root: with the phase in it, its left side exceeds c at every length"


class Interpretations(PaperInterpretations):
    """P4's interpretations."""

    paper = "P4"
    choices = load_choices(Path(__file__).with_name("interpretations.yaml"))
    realisations = 4000  # with 500 the interval of P4.6 reaches over its limit, though not over the margin
    max_realisations = 1_024_000  # P4.4: σ of the locked bursts is up to 0.6 % off, of the 1 % that it may be

    def is_exact(self, claim: Claim, interpretation: Interpretation) -> bool:
        return claim.id in EXACT

    def for_claim(self, claim: str) -> list[Interpretation]:
        """All combinations of E and U for exact claims; for claims that need runs, of the choices that bear on them."""
        own = [choice for choice in self.choices if choice.bears_on(claim)]
        singly = [
            self.interpretation(**{choice.key: one.name})
            for choice in own
            for one in choice.alternatives
            if one.kind == AGAINST
        ]
        return list(dict.fromkeys([*self.combined(own), *singly]))

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
        wanted = any(_is_swept(case, *key) for key in keys) if case.swept else noise == SHIPPED_NOISE
        if not wanted:
            return None
        own = version(interpretation)
        given = {"sigma": own.sigma, "spread_over_potential": None if own.sigma else BURST.multiples}
        changes = {
            "burst": case.spec.burst.model_copy(update={"noise_variance": noise * own.noise_variance / SHIPPED_NOISE}),
            "prior": case.spec.prior.model_copy(update=given),
            "estimators": tuple(_changed(one, own) for one in case.spec.estimators),
        }
        return replace(case, spec=case.spec.model_copy(update=changes))

    def evidence(
        self, claim: Claim, interpretation: Interpretation, seen: ChangedResults | None, of: PaperClaims
    ) -> Evidence:
        if seen is None:
            return ExactEvidence(interpretation)
        return super().evidence(claim, interpretation, seen, of)


def _is_swept(case: Case, key: str, value: float) -> bool:
    """Whether a case varies this key alone, and takes this value."""
    return len(case.swept) == 1 and case.swept[0][0] == key and math.isclose(float(str(case.swept[0][1])), value)


def _changed(estimator: Any, own: Version) -> Any:
    """An estimator as an interpretation has it: its threshold, and the windows that no key of a config asks for.

    Those of which no claim speaks are cut to one window: they are not looked at."""
    kind = measures.kind_of(estimator, measures.INTERPRETATIONS[COMPUTED][1])
    if kind == "other":
        return estimator.model_copy(update={"first_windows": 1, "phases": 0, "steps": 5, "density": 1})
    if estimator.schedule != "designed":
        return estimator
    changes: dict[str, Any] = {"main_lobe_threshold": own.threshold}
    if own.curvature != "next":
        lengths = tuple(n * BURST.period_s for n in windows(own))
        changes |= {"schedule": lengths[: estimator.first_windows], "first_windows": None}
    return estimator.model_copy(update=changes)


def _counted(part: Part, interpretation: Interpretation) -> Part:
    """A part that counts windows, of all of them where an interpretation counts the first too."""
    if part.number != ITERATIONS or interpretation["counted"] != "in all":
        return part
    return replace(part, measure=lambda seen: exact_number(len(seen.windows(COMPUTED))))


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
    of = Interpretations()
    plain = {version(one) for claim in ("P4.1", *WINDOWS) for one in of.for_claim(claim)}
    found = burst_versions.designed(BURST, every := list(plain))
    return {one: (spreads, own) for one, spreads, own in zip(every, found.spreads, found.windows, strict=True)}


@cache
def _scaled() -> Mapping[tuple[Version, float], int | None]:
    """The first windows with the forecast's spreads times each of SCALES."""
    plain = {version(one) for one in Interpretations().for_claim("P4.8")}
    every = [(one, scale) for one in plain for scale in SCALES]
    asked = []
    for one, scale in every:
        sigma = one.sigma or tuple(np.array(BURST.multiples) * _designed()[one][0])
        asked.append(one._replace(sigma=tuple(scale * float(value) for value in sigma)))
    first = burst_versions.first_windows(BURST, asked)
    return {key: int(n) or None for key, n in zip(every, first, strict=True)}


def windows(own: Version) -> list[int]:
    """The windows of a version in pulses; raises Unreadable where there are none."""
    known = _designed()
    found = known[own][1] if own in known else burst_versions.designed(BURST, [own]).windows[0]
    if found is None:
        raise ImpossibleInterpretation(NO_ROOT)
    return found


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
        weights = burst_versions.handovers(BURST, self._version, windows(self._version)[:-1])
        return exact_number(max(burst.tail_probability(one, self._lobe) for one in weights))

    def phase_offsets(self, key: Any) -> np.ndarray:
        return burst_versions.phase_offsets(BURST, self._version, windows(self._version))

    def shortest_window(self, key: Any, amplitude: float) -> Estimate:
        """T_min (17), ms: one sample a pulse."""
        noise = self._version.noise_variance
        return exact_number(1e3 * 4 * LEAST_RATIO * noise * BURST.period_s / amplitude**2)
