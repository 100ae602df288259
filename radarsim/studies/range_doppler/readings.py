"""What P1 leaves open, and its claims under each reading: all by the exact recursion, nothing is run."""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from radarsim.report.claims import Series, same
from radarsim.report.claims.declared import Claim, PaperClaims, Part
from radarsim.report.claims.readings import Alternative, Choice, PaperReadings, Reading, Seen
from radarsim.report.claims.rule import AGAINST, EQUIVALENT, UNSTATED
from radarsim.report.claims.search import Search
from radarsim.report.claims.written import claims_in, of_other_cases
from radarsim.report.statistics import Estimate
from radarsim.studies.range_doppler import measures, recursion
from radarsim.studies.range_doppler.measures import RADARS

CLAIMS = claims_in(Path(__file__).with_name("claims.yaml"), measures)
ALGEBRA = ("P1.16", "P1.31", "P1.34", "P1.36")  # of the table of radars, and of the equations
NUMBERS = tuple(claim.id for claim in CLAIMS if claim.id not in ALGEBRA)
FIGURE_1A = ("P1.14", "P1.18")  # sentences on figure 1a, which is drawn for several D_M
LEVEL = ("P1.20",)  # what a curve converges to is no matter of where it is cut
FAST = tuple(  # those that look at a radar of Δt = 5 s
    claim.id
    for claim in CLAIMS
    if claim.id in NUMBERS and claim.id not in LEVEL
    for parts in [[part for part in claim.parts if part.asserted]]
    for keys in [{key[0] if isinstance(key, tuple) else key for part in parts for key in part.cases}]
    if keys & {3, 5}
)
ENDS = "P1.5"
FALLS = (ENDS, "P1.6")
FALLING = ("P1.26", "P1.27")  # as far as a settled curve may rise again
SETTLES = ("P1.14", "P1.15", *FALLING)
FIRST_STEPS = "P1.28"
EACH, SHOWN, LOWER = "each radar", "RLS 2", "the lower one"
SHIPPED = "0.001"  # D_M, (m/s³)²
SWEPT = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)  # D_M of the config manoeuvre_variance
FIFTEEN = 15  # points, as printed
LONG = 250  # scans after which a filter is taken as steady
FILTERS = ("r", "r+Vr")
PERIOD = {n: radar[2] for n, radar in RADARS.items()}
WAVELENGTH_M = {1: 1.8, 2: 0.15, 3: 0.15, 4: 0.03, 5: 0.03}
REPETITION_HZ = 1e3

CHOICES = (
    Choice(
        "start",
        "How the filter starts, and with which covariance",
        "Инициализация фильтра Калмана второго порядка проводится за три первых контакта при наблюдении дальности и за "
        "два контакта – при условии наблюдения дальности и радиальной скорости. […] Параметры инициализации "
        "рассчитываются по конечной выборке (методом наименьших квадратов).",
        "The filter starts from three contacts where the range is observed, from two where the velocity is too […] by "
        "least squares on a finite sample.",
        (
            Alternative("weighted", UNSTATED, "least squares, each measurement by its own σ"),
            Alternative("unweighted", UNSTATED, "least squares without weights, in m and m/s: the paper names none"),
            Alternative("process_noise", UNSTATED, "least squares on a state that M moves during the start too"),
            Alternative("first_differences", AGAINST, "the last plot and differences: not least squares"),
            Alternative("three_and_three", AGAINST, "three contacts for both, where the print has two with velocity"),
            Alternative("four_and_four", AGAINST, "four contacts for both"),
            Alternative("five_and_five", AGAINST, "five contacts for both"),
        ),
        NUMBERS,
    ),
    Choice(
        "points",
        "How long the radars of Δt = 5 s are watched",
        "Задающее воздействие – полиномиальная модель 2-го порядка, в соответствии с которой рассчитано 15 точек "
        "траектории.",
        "The input is a polynomial of the second order, by which 15 points of the trajectory were computed.",
        (
            Alternative("to 140 s", UNSTATED, "the figures go over time, and the text speaks of 100 s for Δt = 5 s"),
            Alternative("fifteen each", UNSTATED, "fifteen points as printed: RLS 3 and 5 end at 70 s"),
        ),
        FAST,
    ),
    Choice(
        "falls_to",
        "When the value is read to which a gain falls",
        "… с последующим спадом до 18 %. […] постепенно убывая с 80–90 % (Δt = 5 с, 10 с) до 25 %. […] применение "
        "оценок радиальной скорости становится неэффективным примерно с 90–100-й секунды наблюдения.",
        "… falls to 18 % afterwards. […] gradually decreasing from 80–90 % (Δt = 5 s, 10 s) to 25 %. […] from about "
        "the 90th to 100th second on the velocity is of no use.",
        (
            Alternative("the last point", UNSTATED, "the end of the curve"),
            Alternative("100 s", UNSTATED, "the time to which the passage speaks"),
        ),
        FALLS,
    ),
    Choice(
        "end_of",
        "Whose end is meant where two curves fall to one number",
        "… в 45 % при высоком темпе и в 35 % при малом темпе обзора достигается … с последующим спадом до 18 %.",
        "… of 45 % at the fast and of 35 % at the slow rate … is reached, falling to 18 % afterwards.",
        (
            Alternative(EACH, UNSTATED, "both peaks are named, and one end: each falls to it"),
            Alternative(LOWER, UNSTATED, "the lower end of the two curves"),
        ),
        (ENDS,),
    ),
    Choice(
        "extremum",
        "What an extremum of a gain is",
        "Экстремум выигрыша при разных периодах повторения достигается примерно в одно время.",
        "The extremum of the gain is reached at about the same time with different periods.",
        (
            Alternative("within a point", UNSTATED, "every time at which the gain is within a point of its largest"),
            Alternative("the largest value", UNSTATED, "the one point that is largest, by however little"),
        ),
        ("P1.11",),
    ),
    Choice(
        "settled_within",
        "How near the steady value counts as settled",
        "Оптимальным стоит рассматривать значение D_M, если время сходимости меньше 10Δt.",
        "A value of D_M should be taken as optimal if the time of convergence is under 10 Δt.",
        (
            Alternative("5 %", UNSTATED, "the usual tolerance of settling"),
            Alternative("2 %", UNSTATED, "the other usual one"),
            Alternative("10 %", UNSTATED, "a coarse one"),
        ),
        SETTLES,
    ),
    Choice(
        "shown_variance",
        "D_M of figure 1a, (m/s³)²",
        "Ошибки фильтрации дальности … получены по результатам моделирования при различных D_M для РЛС 2 и приведены "
        "на рис. 1.",
        "The errors of range … were found by simulation at various D_M for RLS 2 and are shown in figure 1.",
        (
            Alternative("0.001", UNSTATED, "that of the other figures"),
            *(Alternative(name, UNSTATED, "of the decades about it") for name in ("0.00001", "0.0001", "0.01", "0.1")),
        ),
        FIGURE_1A,
    ),
    Choice(
        "curves_of",
        "Of which radars it is said that errors fall to a steady value",
        "Начиная со 2-го шага, все ошибки фильтрации убывают до установившегося значения … […] Ошибки фильтрации "
        "радиального ускорения … получены по результатам моделирования РЛС 2 при D_M = 10⁻³ и приведены в виде "
        "графиков на рис. 3, а. Все зависимости … убывают до предела, который определяется параметрами станции …",
        "From the 2nd step on all errors of filtering fall to a steady value … […] The errors of the radial "
        "acceleration … were found by simulation of RLS 2 and are shown in figure 3a. All curves … fall to a limit "
        "that is determined by the parameters of the radar …",
        (
            Alternative(EACH, UNSTATED, "all errors, and parameters of the radar: each of the five"),
            Alternative(SHOWN, UNSTATED, "the radar of figure 3a; that of figure 2a is lost with the scan"),
        ),
        FALLING,
    ),
    Choice(
        "first_steps_of",
        "Of which radars it is said that velocity helps the acceleration at the first steps only",
        "Ошибки фильтрации радиального ускорения … получены по результатам моделирования РЛС 2 … и приведены … на "
        "рис. 3, а. […] Использование оценок радиальной скорости уменьшает ошибки фильтрации лишь на первых шагах "
        "обзора. Уменьшение периода повторения (РЛС 3, РЛС 5) привело к росту начального значения ошибок …",
        "The errors of the radial acceleration … were found by simulation of RLS 2 … and are shown in figure 3a. […] "
        "Estimates of the velocity lower the errors at the first steps only. A shorter period (RLS 3, RLS 5) has "
        "raised the first errors …",
        (
            Alternative(SHOWN, UNSTATED, "the radar of figure 3a, of which the paragraph begins to speak"),
            Alternative(EACH, UNSTATED, "each of the five: the next sentence speaks of others"),
        ),
        (FIRST_STEPS,),
    ),
    Choice(
        "manoeuvre_variance",
        "D_M of the gains, (m/s³)²",
        "… графически представлены на рис. 1, б для пяти типов РЛС (см. табл.) при D_M = 10⁻³.",
        "… are shown in figure 1b for the five radars of the table at D_M = 10⁻³.",
        (
            Alternative("0.001", EQUIVALENT, "as printed"),
            Alternative("0.0003", AGAINST, "another value than printed"),
            Alternative("0.0007", AGAINST, "another value than printed: RLS 3 then falls to 18 %"),
            Alternative("0.0015", AGAINST, "another value than printed: RLS 2 then falls to 25 %"),
            Alternative("0.003", AGAINST, "another value than printed"),
        ),
        tuple(one for one in NUMBERS if one not in FIGURE_1A),
    ),
    Choice(
        "process_noise",
        "What M is, of which D_M is the size",
        "M = ‖Δt⁶/36 Δt⁵/12 Δt⁴/6; Δt⁵/12 Δt⁴/4 Δt³/2; Δt⁴/6 Δt³/2 Δt²‖ · D_M (6)",
        "M is printed: the covariance of a jerk that is constant over the scan.",
        (
            Alternative("random_jerk", EQUIVALENT, "as printed"),
            Alternative("white_jerk", AGAINST, "D_M the spectral density of a white jerk"),
            Alternative("white_jerk_rate", AGAINST, "D_M Δt that density"),
            Alternative("acceleration_step", AGAINST, "D_M the variance of a step of acceleration"),
            Alternative("normalised", AGAINST, "the printed number is C_M = D_M/σ_r² of (5)"),
        ),
        NUMBERS,
    ),
    Choice(
        "truth",
        "How the target moves",
        "Задающее воздействие – полиномиальная модель 2-го порядка …",
        "The input is a polynomial model of the second order …",
        (
            Alternative("quadratic", EQUIVALENT, "as printed"),
            Alternative("as believed", AGAINST, "a target that manoeuvres as the filter believes"),
        ),
        NUMBERS,
    ),
)


class Readings(PaperReadings):
    """P1's readings."""

    paper = "P1"
    choices = CHOICES

    def exact(self, claim: Claim, reading: Reading) -> bool:
        return True

    def parts(self, claim: Claim, reading: Reading) -> Sequence[Part]:
        """Those of the radars that the reading means; what falls to a steady value may rise by its tolerance."""
        if claim.id == FIRST_STEPS and reading["first_steps_of"] == EACH:
            return [of_other_cases(part, radar) for radar in RADARS for part in claim.parts]
        if claim.id == ENDS and reading["end_of"] == LOWER:
            return [
                replace(claim.parts[0], cases=(2, 3), what="the lower of the final range gains", measure=_lower_end)
            ]
        if claim.id not in FALLING:
            return claim.parts
        wide = same(0, _tolerance(reading, 100))
        meant = [part for part in claim.parts if reading["curves_of"] == EACH or part.cases == (2,)]
        return [replace(part, expected=wide) for part in meant]

    def evidence(self, claim: Claim, reading: Reading, seen: Seen | None, of: PaperClaims) -> "ExactEvidence":
        return _evidence(reading)

    def search(self) -> Search:
        from radarsim.studies.range_doppler import search

        return search.search()

    def versions(self) -> list[recursion.Version]:
        """Every version of the filters that a declared reading asks for, with the D_M of the shipped sweep."""
        found: dict[recursion.Version, None] = {}
        for one in self.declared():
            form, start = cast(recursion.Form, one["process_noise"]), cast(recursion.Start, one["start"])
            for variance in (float(one["manoeuvre_variance"]), *SWEPT):
                found[form, variance, start] = None
        return list(found)


def _lower_end(seen: measures.Evidence) -> Estimate:
    """The least of the final range gains of RLS 2 and 3, %."""
    return measures.extreme_gain(seen, 2, 3, which="least", component="r", pick="last")


def _tolerance(reading: Reading, of: float) -> float:
    """How near the steady value counts as settled, of so much."""
    return of * float(reading["settled_within"].split()[0]) / 100


@cache
def _evidence(reading: Reading) -> "ExactEvidence":
    """That of a reading, which many claims share."""
    return ExactEvidence(reading, limit_s=100.0 if reading["falls_to"] == "100 s" else np.inf)


@cache
def _table() -> Mapping[int, Mapping[recursion.Version, "_Sigmas"]]:
    """σ over LONG scans by radar and version, all by one recursion a radar."""
    versions = Readings().versions()

    def of_radar(number: int) -> dict[recursion.Version, _Sigmas]:
        found = recursion.both(RADARS[number], versions, LONG)
        return {
            one: _Sigmas(*(tuple(e.true[i] for e in found), tuple(e.believed[i] for e in found)))
            for i, one in enumerate(versions)
        }

    with ThreadPoolExecutor() as pool:  # NumPy computes outside the interpreter's lock
        return dict(zip(RADARS, pool.map(of_radar, RADARS), strict=True))


class _Sigmas(NamedTuple):
    """σ (K, 3) of the filters r and r+Vr, on a quadratic and on a truth that moves as they believe."""

    true: tuple[np.ndarray, ...]
    believed: tuple[np.ndarray, ...]


@dataclass(frozen=True)
class _Axes:
    """Scans and times of a radar's run, C_θ (11), and what its Doppler frequencies follow from."""

    k: np.ndarray
    t_s: np.ndarray
    scan_period_s: float
    C_theta: float
    wavelength_m: float
    repetition_rate_hz: float = REPETITION_HZ


@dataclass(frozen=True)
class _Radar:
    """What stands in for a case: one radar at one D_M."""

    name: str
    number: int
    variance: float
    axes: _Axes
    count: int = 0


class ExactEvidence(measures.Evidence):
    """P1's curves and gains by the exact recursion, under a reading; series end at limit_s."""

    def __init__(self, reading: Reading, limit_s: float = np.inf):
        super().__init__((), {}, {})
        self._reading, self._limit_s = reading, limit_s
        self.extremum = 0.0 if reading["extremum"] == "the largest value" else measures.Evidence.extremum
        shown = reading["shown_variance"]
        self._own = float(shown if shown != SHIPPED else reading["manoeuvre_variance"])
        self._cases: dict[Any, _Radar] = {}
        self._curves: dict[tuple[Any, str, str], Series] = {}

    def case(self, key: Any) -> Any:
        """key: the number of a radar (at the reading's D_M), or (number, D_M)."""
        if key not in self._cases:
            self._cases[key] = self._case(key)
        return self._cases[key]

    def _case(self, key: Any) -> _Radar:
        number, variance = key if isinstance(key, tuple) else (key, self._own)
        period = PERIOD[number]
        k = np.arange(1, round(measures.DURATION / period) + 2)
        sigma_r, sigma_v, _ = RADARS[number]
        theta = (sigma_r / (period * sigma_v)) ** 2
        return _Radar(
            f"rls{number}", number, variance, _Axes(k, (k - 1.0) * period, period, theta, WAVELENGTH_M[number])
        )

    def marked(self, series: Series, key: Any) -> Series:
        """As it is: where a run ends is a choice of the reading."""
        return series

    def exactly(self) -> "ExactEvidence":
        """All is exact already."""
        return self

    def filter(self, key: Any, observes: tuple[str, ...]) -> str:
        """r or r+Vr."""
        return FILTERS[len(observes) - 1]

    def curve(self, key: Any, filter_name: str, component: str) -> Series:
        """σ(k) of a filter."""
        place = key, filter_name, component
        if place not in self._curves:
            sigma = self._sigma(key)[FILTERS.index(filter_name)][:, self._place(component)]
            self._curves[place] = self._cut(key, sigma)
        return self._curves[place]

    def gain(self, key: Any, filter_name: str, component: str) -> Series:
        """Relative gain of the filter with velocity, %, from the scan at which it has filtered."""
        place = key, "", component
        if place not in self._curves:
            base, own = (sigma[:, self._place(component)] for sigma in self._sigma(key))
            gain = recursion.gain(base, own)
            gain[: recursion.first_scan(self._start, 2) - 1] = np.nan
            self._curves[place] = self._cut(key, gain)
        return self._curves[place]

    def settling(self, key: Any, observes: tuple[str, ...], component: str = "r") -> Estimate:
        """Scan periods from the first plot to settling for good; infinite where it does not within the run."""
        sigma = self.curve(key, self.filter(key, observes), component)
        radar = self.case(key)
        steady = self._sigma(key)[len(observes) - 1][-1, self._place(component)]
        wide = _tolerance(self._reading, 1)
        wrong = np.flatnonzero(~(abs(sigma.value / steady - 1) <= wide))
        first = wrong[-1] + 1 if wrong.size else 0
        when = sigma.t[first] / radar.axes.scan_period_s if first < len(sigma.t) else np.inf
        return Estimate(float(when), float(when), float(when))

    def variances(self, radar: int) -> list[float]:
        """Those of the shipped sweep."""
        return list(SWEPT)

    @property
    def _start(self) -> recursion.Start:
        return cast(recursion.Start, self._reading["start"])

    def _sigma(self, key: Any) -> tuple[np.ndarray, ...]:
        """σ (LONG, 3) of the two filters."""
        radar = self.case(key)
        version = cast(recursion.Form, self._reading["process_noise"]), radar.variance, self._start
        of = _table()[radar.number][version]
        return of.believed if self._reading["truth"] == "as believed" else of.true

    @staticmethod
    def _place(component: str) -> int:
        return tuple(measures.COMPONENTS).index(component)

    def _cut(self, key: Any, values: np.ndarray) -> Series:
        axes = self.case(key).axes
        scans = FIFTEEN if self._reading["points"] == "fifteen each" else len(axes.k)
        values = values[: len(axes.k)]
        kept = np.isfinite(values) & (axes.t_s <= self._limit_s + 1e-6) & (axes.k <= scans)
        end, asked = float(axes.t_s[min(scans, len(axes.k)) - 1]), self._limit_s
        short = f"the run of RLS {self.case(key).number} ends at {end:g} s, before {asked:g} s"
        ends = short if np.isfinite(asked) and end < asked - 1e-6 else ""
        return Series(axes.k[kept], axes.t_s[kept], *(values[kept],) * 3, short=ends)
