"""What P2 leaves open, and its claims under each reading: small runs of the shipped configs with another flight, σ_A,
output, start or bank.
"""

from dataclasses import replace
from typing import Any

from radarsim.config.experiment import Case
from radarsim.report.claims import Evidence
from radarsim.report.claims.declared import Claim, PaperClaims
from radarsim.report.claims.readings import Alternative, Choice, PaperReadings, Reading, Seen
from radarsim.report.claims.rule import AGAINST, EQUIVALENT, UNSTATED
from radarsim.studies.multimodel import measures, tables
from radarsim.studies.multimodel.flights import FLIGHTS

OF_FLIGHT = tuple(f"P2.{n}" for n in (1, 2, 3, 5, 6, 7, 8, 9, 10, 12, 13))
AERODYNAMIC = "P2.4"  # speaks of another target than the lost flight
ESTIMATES = tuple(f"P2.{n}" for n in (1, 6, 7, 8, 9, 10, 12, 13))
SHIPPED = "aeroballistic"


def _begins(flight: str) -> float:
    """When the manoeuvre of a flight begins, s."""
    return FLIGHTS[flight].phases[1].start_s


CHOICES = (
    Choice(
        "flight",
        "The trajectory",
        "… при сопровождении аэробаллистического объекта, траектория которого приведена на рис. 1-4.",
        "… in tracking an aeroballistic target whose trajectory is shown in figures 1 to 4. The figures are lost but "
        "for their axes: 0 to 200 km north, ±100 km east, under 2000 m/s, 186.2 s.",
        (
            Alternative(SHIPPED, UNSTATED, "a pull-up, then a lateral weave of 60 m/s² and 16 s"),
            *(
                Alternative(name, UNSTATED, f"within the printed axes, ballistic to {_begins(name):g} s")
                for name in FLIGHTS
            ),
        ),
        OF_FLIGHT,
    ),
    Choice(
        "sigma_acceleration",
        "What σ_A is a standard deviation of",
        "… параметром σ_A, который интерпретируется как с.к.о. проекции случайного ускорения на одну из осей МПСК.",
        "… by the parameter σ_A, which is interpreted as the standard deviation of a random acceleration's projection "
        "on an axis.",
        (
            Alternative("per step", UNSTATED, "of the increment of a step of 50 ms, whatever its length: G of (11)"),
            Alternative("per second", UNSTATED, "of the increment of acceleration in a second: σ_A Δt in a step"),
            Alternative("per second, both motions", AGAINST, "σ_A Δt in the uniform motion too: an acceleration there"),
        ),
        (*OF_FLIGHT, AERODYNAMIC),
    ),
    Choice(
        "output",
        "How the hypotheses become one estimate",
        "Для выдачи результата работы алгоритма на выход используется алгоритм объединения гипотез (5). Такой алгоритм "
        "объединения гипотез будем называть комбинированным.",
        "To give the algorithm's result to the output the rule (5) is used. Such an algorithm of merging hypotheses "
        "will be called combined.",
        (
            Alternative("best", EQUIVALENT, "the most probable hypothesis, as (5) says"),
            Alternative("moment", AGAINST, "the mean weighted by probability: (4), where (5) is printed"),
        ),
        ESTIMATES,
    ),
    Choice(
        "start_acceleration",
        "The spread of acceleration with which a track starts, m/s²",
        "nothing",
        "nothing",
        (
            Alternative("30", UNSTATED, "that of the strong model"),
            Alternative("3", UNSTATED, "a tenth"),
            Alternative("100", UNSTATED, "three times"),
        ),
        (*OF_FLIGHT, AERODYNAMIC),
    ),
    Choice(
        "bank",
        "What banks without a weak, or without a strong model are",
        "… хорошо себя зарекомендовали те из них, которые используют как слабо возмущенные модели движения и как "
        "минимум одну сильно возмущенную модель.",
        "… those have proved good that use weakly disturbed models of motion and at least one strongly disturbed one.",
        (
            Alternative("both motions", UNSTATED, "two models of one strength, uniform and accelerated"),
            Alternative("accelerated", UNSTATED, "two accelerated models, one of them of half the strength"),
        ),
        ("P2.13",),
    ),
)


class Readings(PaperReadings):
    """P2's readings."""

    paper = "P2"
    choices = CHOICES

    def changed(self, claim: Claim, case: Case, reading: Reading) -> Case | None:
        """The case with the flight, the banks, the output and the start of a reading."""
        spec = case.spec
        if claim.id == AERODYNAMIC and not measures.is_flight(spec.target, "airliner"):
            return None
        changes: dict[str, Any] = {"start_acceleration_mps2": float(reading["start_acceleration"])}
        if claim.id != AERODYNAMIC:
            changes["target"] = FLIGHTS.get(reading["flight"], spec.target)
        period = spec.sensor.scan_period_s
        changes["filters"] = tuple(_changed(one, reading, claim.id, period) for one in spec.filters)
        return replace(case, spec=spec.model_copy(update=changes))

    def evidence(self, claim: Claim, reading: Reading, seen: Seen | None, of: PaperClaims) -> Evidence:
        assert seen is not None  # nothing of P2 is exact
        return Flown(seen)


def _changed(one: Any, reading: Reading, claim: str, period_s: float) -> Any:
    """A filter as a reading has it."""
    changes: dict[str, Any] = {}
    if one.family != "kalman" and one.output == "best" and claim in ESTIMATES and reading["output"] == "moment":
        changes["output"] = "moment"
    models = one.models
    if reading["bank"] == "accelerated" and len(models) == 2 and len({m.sigma_acceleration_mps2 for m in models}) == 1:
        halved = models[1].model_copy(update={"sigma_acceleration_mps2": models[1].sigma_acceleration_mps2 / 2})
        models = (halved, models[1])
    per = reading["sigma_acceleration"]
    if per != "per step":
        models = tuple(
            m.model_copy(update={"sigma_acceleration_mps2": m.sigma_acceleration_mps2 * period_s})
            if m.motion == "accelerated" or per == "per second, both motions"
            else m
            for m in models
        )
    return one.model_copy(update={**changes, "models": models})


class Flown(measures.Evidence):
    """What was flown under a reading, found by what the shipped filters are; stages are those of what was flown."""

    def __init__(self, seen: Seen):
        super().__init__(seen.results, seen.tables, seen.places)
        self._ran = {one.name: one for one in seen.ran}

    def stage(self, key: Any, name: str) -> int:
        """The number of a stage of what was flown."""
        return tables.stage_names(self._ran[self.case(key).name]).index(name)

    def _bounds(self, of: Any, stage: str) -> tuple[float, float]:
        return super()._bounds(self._ran[of.name], stage)
