"""What P3 leaves open about manoeuvres, and its claims on them under each reading.

Times to see a manoeuvre are runs of the shipped config. Switching the degree of a window of a few plots is exact, and
so is a single test. What P3 says of smoothing is formulas, which leave nothing open but what a high accuracy is.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.report.claims import Evidence, certain
from radarsim.report.claims.declared import Claim, PaperClaims, Part
from radarsim.report.claims.readings import Alternative, Choice, PaperReadings, Reading, Seen
from radarsim.report.claims.rule import UNSTATED
from radarsim.report.claims.written import with_arguments
from radarsim.report.statistics import Estimate
from radarsim.studies.sonar.manoeuvre import exact, measures
from radarsim.studies.sonar.manoeuvre.switched import switched_window
from radarsim.studies.sonar.measures import Evidence as SonarEvidence

ENOUGH, DETECTS, SINGLE, SWITCHES = "P3.3", "P3.8", "P3.9", "P3.10"
RATES = {"k = 1": measures.AT_ONE, "0.1": 0.1, "0.03": 0.03, "0.01": 0.01, "0.003": 0.003, "0.001": 0.001}
SHIFTS = {"one σ_a": 1.0, "1.456 σ_a": 1.456, "half σ_a": 0.5, "two σ_a": 2.0}
MEMORIES = {"six plots": 6, "five plots": 5}
BEGIN_AND_END = (
    "В процессе сопровождения реальной цели необходимо иметь возможность обнаруживать начало и конец маневра, с тем, "
    "чтобы правильно выбрать количество уравнений в системе (2)."
)
NOTHING = "nothing"

CHOICES = (
    Choice(
        "high_accuracy",
        "From which accuracy on it is high",
        "… для получения высокой точности оценки координат необходим одновременный учет большого числа (5-6) "
        "предыдущих наблюдений.",
        "… for a high accuracy of the estimated coordinates a large number (5–6) of the preceding observations has to "
        "be taken into account at once.",
        (
            Alternative("predicted as measured", UNSTATED, "the position a scan ahead is as good as a plot"),
            Alternative("half the variance", UNSTATED, "the smoothed position has half of a plot's"),
            Alternative("under 5 % more", UNSTATED, "a further plot lowers the smoothed σ by less"),
            Alternative("two thirds", UNSTATED, "the smoothed σ is two thirds of a plot's"),
        ),
        (ENOUGH,),
    ),
    Choice(
        "seen",
        "What of a manoeuvre has to be seen",
        BEGIN_AND_END,
        "In tracking a real target it is necessary to be able to detect the beginning and the end of a manoeuvre, so "
        "as to choose the number of equations in (2) rightly.",
        (
            Alternative("beginning and end", UNSTATED, "as the sentence before asks"),
            Alternative("beginning", UNSTATED, "as 'time to detect a manoeuvre' alone may be read"),
        ),
        (DETECTS,),
    ),
    Choice(
        "false_alarms",
        "False alarms a test",
        "С вероятностью, примерно равной 0,68, маневр по координате может быть обнаружен …",
        "With a probability of about 0.68 a manoeuvre in a coordinate can be detected …",
        (
            Alternative("k = 1", UNSTATED, "0.317: that to which 0.68 belongs"),
            *(Alternative(name, UNSTATED, "a rate that is used") for name in RATES if name != "k = 1"),
        ),
        (DETECTS,),
    ),
    Choice(
        "tests",
        "Whether tests overlap",
        "Порог k … зависит от числа наблюдений координаты n, используемых для расчета ускорения.",
        "The threshold k … depends on the number n of observations by which the acceleration is computed.",
        (
            Alternative("sliding", UNSTATED, "a test at each scan, of the last n plots"),
            Alternative("batches", UNSTATED, "a test at each n-th scan: no plot in two tests"),
        ),
        (DETECTS,),
    ),
    Choice(
        "manoeuvre",
        "How long the manoeuvre lasts",
        NOTHING,
        NOTHING,
        (
            Alternative("40 s", UNSTATED, "eight scans, as shipped"),
            Alternative("20 s", UNSTATED, "four scans"),
            Alternative("80 s", UNSTATED, "sixteen scans"),
        ),
        (DETECTS,),
    ),
    Choice(
        "strength",
        "How strong the manoeuvre is that is detected with 0.68",
        NOTHING,
        NOTHING,
        (
            Alternative("one σ_a", UNSTATED, "an acceleration at the threshold of k = 1"),
            Alternative("1.456 σ_a", UNSTATED, "the one that makes it 0.68"),
            Alternative("half σ_a", UNSTATED, "a weaker one"),
            Alternative("two σ_a", UNSTATED, "a stronger one"),
        ),
        (SINGLE,),
    ),
    Choice(
        "memory",
        "Over how many plots the filter smooths whose degree is switched",
        "… для получения высокой точности оценки координат необходим одновременный учет большого числа (5-6) "
        "предыдущих наблюдений.",
        "… for a high accuracy a large number (5–6) of the preceding observations has to be taken into account.",
        (
            Alternative("growing", UNSTATED, "all plots so far, as in the recursion (12)–(14)"),
            *(Alternative(name, UNSTATED, "as many as the paper advises, and the detector's too") for name in MEMORIES),
        ),
        (SWITCHES,),
    ),
    Choice(
        "switching_false_alarms",
        "False alarms a test of the detector that switches",
        NOTHING,
        NOTHING,
        (
            Alternative("0.01", UNSTATED, "as shipped"),
            *(Alternative(name, UNSTATED, "another rate") for name in ("0.1", "0.03", "k = 1")),
        ),
        (SWITCHES,),
    ),
)


class Readings(PaperReadings):
    """P3's readings."""

    paper = "P3"
    choices = CHOICES
    realisations = 5000

    def exact(self, claim: Claim, reading: Reading) -> bool:
        return claim.id in (ENOUGH, SINGLE) or reading["memory"] in MEMORIES

    def of_claim(self, claim: str) -> list[Reading]:
        """All combinations of what bears on a claim."""
        return list(self.combined([choice for choice in self.choices if choice.bears_on(claim)]))

    def parts(self, claim: Claim, reading: Reading) -> Sequence[Part]:
        if claim.id == ENOUGH:
            plots, criterion = _enough(reading["high_accuracy"])
            return [replace(part, what=criterion, measure=lambda seen: certain(plots)) for part in claim.parts]
        if claim.id == SINGLE:
            strength = SHIFTS[reading["strength"]]
            probability = float(exact.detection(1.0, strength))
            what = f"alarms a test at k = 1, five plots, acceleration of {strength:g} times its own spread"
            if strength == 1:
                what = claim.parts[0].what
            return [
                replace(part, what=what, measure=lambda seen: certain(probability), exact=None) for part in claim.parts
            ]
        if claim.id == SWITCHES and reading["memory"] in MEMORIES:
            return [_switched(part, reading) for part in claim.parts]
        asserted = [part for part in claim.parts if part.asserted]
        return [_delay(part, reading) for part in asserted] if claim.id == DETECTS else asserted

    def changed(self, claim: Claim, case: Case, reading: Reading) -> Case | None:
        """The weakest and the strongest manoeuvre of the sweep, tested and followed as a reading says."""
        target = case.spec.target
        if abs(target.acceleration_mps2) not in STRENGTHS:
            return None
        lasts = float(reading["manoeuvre"].split()[0])
        changes: dict[str, Any] = {"target": target.model_copy(update={"end_s": target.start_s + lasts})}
        if reading["tests"] == "batches":
            changes["detectors"] = tuple(
                one.model_copy(update={"test_every": one.plots}) if one.test_every == 1 else one
                for one in case.spec.detectors
            )
        changes["filters"] = tuple(_with_rate(one, reading) for one in case.spec.filters)
        return replace(case, spec=case.spec.model_copy(update=changes))

    def evidence(self, claim: Claim, reading: Reading, seen: Seen | None, of: PaperClaims) -> Evidence:
        if seen is None:
            return SonarEvidence((), {}, {})
        return super().evidence(claim, reading, seen, of)


def _enough(criterion: str) -> tuple[int, str]:
    """Fewest plots that meet a criterion of high accuracy, by the closed forms after (2), and what these are."""
    n = np.arange(2, 100)
    smoothed, ahead = 2 * (2 * n - 1) / (n * (n + 1)), 2 * (2 * n + 1) / (n * (n - 1))  # variances, of a plot's
    met, what = {
        "predicted as measured": (ahead <= 1, "that extrapolate no worse than a plot measures"),
        "half the variance": (smoothed <= 0.5, "that smooth to half of a plot's variance"),
        "under 5 % more": (
            np.append(np.sqrt(smoothed[1:] / smoothed[:-1]) > 0.95, True),
            "to which a further one lowers the smoothed σ by under 5 %",
        ),
        "two thirds": (smoothed <= (2 / 3) ** 2, "that smooth to two thirds of a plot's σ"),
    }[criterion]
    return int(n[met][0]), f"fewest plots {what}"


EXTREMES = (measures.WEAK, measures.STRONG)
STRENGTHS = (0.1, 0.8)  # m/s²: the weakest and the strongest manoeuvre of the shipped sweep


def _with_rate(one: Any, reading: Reading) -> Any:
    """An adaptive filter with the reading's rate of false alarms."""
    rate = RATES[reading["switching_false_alarms"]]
    if one.detector is None or rate == measures.USUAL or one.detector.false_alarm_probability is None:
        return one
    return one.model_copy(update={"detector": one.detector.model_copy(update={"false_alarm_probability": rate})})


def _delay(part: Part, reading: Reading) -> Part:
    """A part on times to see a manoeuvre, at the reading's rate and of what it wants to be seen."""
    rate, both = RATES[reading["false_alarms"]], reading["seen"] == "beginning and end"
    until: measures.Until = "beginning and end" if both else "beginning"
    at = "k = 1" if rate == measures.AT_ONE else f"{rate:g} false alarms a test"
    seen = f"mean time to see {reading['seen'] if both else 'the beginning'} of the {part.cases[0]} at {at}"
    if part.statement == "time":
        return with_arguments(replace(part, what=f"{seen}, 8 plots over 5"), until=until, rate=rate)
    if part.statement == "not worth while":
        what = f"{seen}, over 5 plots against the best of 4–5"
        return with_arguments(replace(part, what=what), until=until, rate=rate)
    return part


def _switched(part: Part, reading: Reading) -> Part:
    """A part on switching the degree, by the exact law of a window of a few plots."""
    degree = 1 if "degree 1" in part.what else 2
    plots, rate = MEMORIES[reading["memory"]], RATES[reading["switching_false_alarms"]]
    acceleration = STRENGTHS[EXTREMES.index(part.cases[0])]

    def measure(_: Any) -> Estimate:
        of = switched_window(_course(acceleration), SIGMA_M, PERIOD_S, plots, plots, float(exact.threshold(rate)))
        held = of.line if degree == 1 else of.parabola
        return certain(float(np.sqrt(np.mean(held**2) / np.mean(of.switched**2))))

    return replace(part, what=part.what.replace("five plots", f"{reading['memory']}"), measure=measure)


SIGMA_M, PERIOD_S, SCANS = 10.0, 5.0, 45  # of the shipped config
START_S, END_S = 100.0, 140.0


def _course(acceleration: float) -> np.ndarray:
    """Range (SCANS,) of the shipped accelerating target but for its steady motion, which no error depends on."""
    t = PERIOD_S * np.arange(SCANS)
    pushed = np.clip(t - START_S, 0, END_S - START_S)
    return acceleration * (pushed**2 / 2 + (END_S - START_S) * np.clip(t - END_S, 0, None))
