"""P1.1 … P1.36: what Gorshkov & Zavizhenets (2017) say, read from their words alone, before anything was measured.

Places are the sections of the article (Doklady BGUIR 2017, no. 4, pp. 19–26): "figures" is the text around figures
1 to 3, "conclusion" the last section. "At the end" is the last of the paper's fifteen points, 140 s.

Margins: every gain that the paper prints, but for 7 and 18, is a multiple of five, read off a graph: ± 2.5 points; 18
is a multiple of two, ± 1. Times stand on the grid of the slower radar, ± 10 s. "About 10 %" (P1.17) is 10 ± 1: the
"7–15 %" of the same curve in the conclusion is a range, printed to one per cent, and makes it no coarser.
"""

from radarsim.report.claims import (
    Claim,
    Part,
    about,
    above,
    at_least,
    at_most,
    below,
    between,
    on_grid,
    printed,
    same,
    within,
)
from radarsim.report.claims.rule import GRID
from radarsim.studies.range_doppler import measures as measured
from radarsim.studies.range_doppler.measures import RADARS, RV, Evidence, R, faster_part, gain_part
from radarsim.studies.range_doppler.tables import SETTLED

__all__ = ["CLAIMS", "Evidence"]

PAIRS = ((2, 3), (4, 5))  # radars that differ only in their period: slow, fast
UNITS = {"r": "m", "Vr": "m/s", "ar": "m/s²"}
BOTH = ((R, "range only"), (RV, "range and velocity"))


GRAPH = 5  # %: the step in which gains are read off graphs
SLOW = 10.0  # s: period of the slower radars
SHARE = 0.01  # of σ: what is no material difference
FALLEN = printed("18", 2)  # to which the range gain of the decimetre radars falls, P1.5


def _claim(number: int, place: str, statement: str, *parts: Part, original: str, reading: str = "") -> Claim:
    return Claim(f"P1.{number}", place, statement, parts, reading, "range_doppler", original)


def _falls(component: str, words: str, first_k: int) -> list[Part]:
    """A part for each radar and filter: how far σ of a component rises again over an earlier scan, from first_k on."""
    return [
        Part(
            (n,),
            f"largest rise of σ of {words} over an earlier scan, {of}",
            "%",
            measured.largest_rise(n, observes, component, first_k),
            same(0, 100 * SETTLED),
        )
        for n in RADARS
        for observes, of in BOTH
    ]


def first_steps(radar: int) -> list[Part]:
    """That velocity helps a radar's acceleration at the first steps, and at the end no more."""
    return [
        gain_part(radar, "ar", "first", "first", above(0)),
        gain_part(radar, "ar", "last", "final", same(0, 10)),
    ]


CLAIMS = (
    _claim(
        1,
        "conclusion, metre band",
        "RLS 1: the range gain is only 7–15 %",
        gain_part(1, "r", "least", "least", between("7", "15")),
        gain_part(1, "r", "largest", "largest", between("7", "15")),
        original="Для РЛС метрового диапазона … наблюдается выигрыш в точности измерений дальности лишь 7–15 %",
        reading="the whole run from k = 2, where the filters first differ",
    ),
    _claim(
        2,
        "conclusion, metre band",
        "RLS 1: the velocity gain lies between 10 and 50 %",
        gain_part(1, "Vr", "least", "least", between("10", "50", GRAPH)),
        gain_part(1, "Vr", "largest", "largest", between("10", "50", GRAPH)),
        original="Прирост в точности фильтрации радиальной скорости колеблется от 10 до 50 %",
        reading="the whole run from k = 3, where both filters have a velocity",
    ),
    _claim(
        3,
        "conclusion, metre band",
        "RLS 1: from the 5th scan on the acceleration is less accurate with velocity than without",
        gain_part(1, "ar", "largest", "largest, from the 5th scan on,", below(0), first=5),
        Part((1,), "acceleration gain at the 4th scan", "%", lambda seen: seen.k_gain(1, "ar").at(4), above(0)),
        original="… а радиального ускорения с пятого шага становится менее эффективным нежели без "
        "использования частоты Доплера.",
        reading="a loss at every scan k ≥ 5, and not yet at k = 4",
    ),
    _claim(
        4,
        "conclusion, decimetre band; figure 1b",
        "Decimetre radars: the range gain peaks at 45 % (Δt = 5 s) and 35 % (Δt = 10 s), about 20–30 s in",
        gain_part(3, "r", "largest", "largest", printed("45", GRAPH)),
        gain_part(2, "r", "largest", "largest", printed("35", GRAPH)),
        Part(
            (3,),
            "time of the largest range gain",
            "s",
            lambda seen: seen.k_gain(3, "r").when_largest(),
            about("20", "30", SLOW, GRID),
        ),
        Part(
            (2,),
            "time of the largest range gain",
            "s",
            lambda seen: seen.k_gain(2, "r").when_largest(),
            about("20", "30", SLOW, GRID),
        ),
        original="Для РЛС дециметрового диапазона максимальный относительный выигрыш в точности оценивания "
        "дальности в 45 % при высоком темпе и в 35 % при малом темпе обзора достигается примерно "
        "на 20–30-й секунде наблюдения цели …",
    ),
    _claim(
        5,
        "conclusion, decimetre band; figure 1b",
        "Decimetre radars: after its peak the range gain falls to 18 %",
        gain_part(2, "r", "last", "final", FALLEN),
        gain_part(3, "r", "last", "final", FALLEN),
        original="… с последующим спадом до 18 %.",
        reading="at the end of the run; one printed number for both radars: each has to end there, and that the lower "
        "curve is meant is a reading. 18 is no multiple of five: taken as one of two, ± 1; of both radars it fails "
        "with ± 0.5 too, and with ± 1.5 by 0.02 points",
    ),
    _claim(
        6,
        "conclusion, decimetre band; figure 2b",
        "Decimetre radars: the velocity gain falls from 80–90 % to 25 %",
        gain_part(2, "Vr", "first", "first", between("80", "90", GRAPH)),
        gain_part(3, "Vr", "first", "first", between("80", "90", GRAPH)),
        gain_part(2, "Vr", "last", "final", printed("25", GRAPH)),
        gain_part(3, "Vr", "last", "final", printed("25", GRAPH)),
        original="Зависимости эффективности, при фильтрации радиальной скорости, ведут себя примерно "
        "одинаково, постепенно убывая с 80–90 % (Δt = 5 с, 10 с) до 25 %.",
        reading="first: the scan at which both filters have a velocity; final: the end of the run. Which of 80 and 90 "
        "belongs to which period is not judged (the print gives 5 s, 10 s)",
    ),
    _claim(
        7,
        "conclusion, decimetre band; figure 3b",
        "Decimetre radars: the acceleration gain begins above 80 % and is useless from about 90–100 s",
        gain_part(2, "ar", "first", "first", above(80)),
        gain_part(3, "ar", "first", "first", above(80)),
        *(
            Part(
                (n,),
                "time at which the acceleration gain is first gone",
                "s",
                measured.ineffective_from(n, 90.0),
                about("90", "100", SLOW, GRID),
            )
            for n in (2, 3)
        ),
        original="… при этом применение оценок радиальной скорости становится неэффективным примерно с "
        "90–100-й секунды наблюдения. / Для прототипов РЛС 2–5 максимальный выигрыш может "
        "составлять более 80 % на начальных шагах фильтрации.",
        reading="useless: zero or a loss",
    ),
    _claim(
        8,
        "figures, after figure 1",
        "The range gain exceeds 50 % where C_θ is much larger than one (RLS 4, 5)",
        gain_part(4, "r", "largest", "largest", above(50)),
        gain_part(5, "r", "largest", "largest", above(50)),
        original="Из рис. 1 следует, что выигрыш в точности достигает более 50 % …",
    ),
    _claim(
        9,
        "figures, after figure 2",
        "For some radars with C_θ > 10 the velocity gain can exceed 90 %",
        Part(
            (3, 4, 5),
            "largest velocity gain of these radars",
            "%",
            lambda seen: max(seen.k_gain(n, "Vr").largest() for n in (3, 4, 5)),
            above(90),
        ),
        original="Максимальная эффективность для некоторых типов РЛС (при C_θ > 10) может достигать более 90 %.",
        reading="some: the best of RLS 3, 4, 5",
    ),
    _claim(
        10,
        "figures, after figure 3",
        "RLS 2–5: the acceleration gain can exceed 80 % at the first steps",
        *(
            Part(
                (n,),
                "largest acceleration gain at the scans 3 to 5",
                "%",
                measured.largest_early(n),
                above(80),
            )
            for n in (2, 3, 4, 5)
        ),
        original="Для прототипов РЛС 2–5 максимальный выигрыш может составлять более 80 % на начальных "
        "шагах фильтрации.",
        reading="first steps: the first three at which both filters have an acceleration; each radar of the four",
    ),
    _claim(
        11,
        "figures, after figure 1",
        "A faster scan raises the range gain in all cases; the extremum comes at about the same time",
        *(
            faster_part(
                *pair,
                "least difference of range gain, fast − slow, at common times",
                "points",
                measured.gain_raised,
                above(0),
            )
            for pair in PAIRS
        ),
        *(
            faster_part(
                *pair,
                "time between the two extrema of the range gain",
                "s",
                measured.extrema_apart,
                on_grid(0, 0, SLOW, strict=(0, 0)),
            )
            for pair in PAIRS
        ),
        original="Сопоставляя РЛС 2 и РЛС 3, РЛС 4 и РЛС 5 (см. рис. 1, б), можно видеть, что увеличение "
        "темпа обзора приводит к увеличению выигрыша в точности фильтрации дальности во всех "
        "случаях. Экстремум выигрыша при разных периодах повторения достигается примерно в одно "
        "время.",
        reading="an extremum is where the gain is within a point of its largest: a smaller difference is none; about "
        "the same time: no further apart than a slow scan",
    ),
    _claim(
        12,
        "figures, after figure 2",
        "As functions of time the velocity gains of radars that differ only in Δt practically coincide",
        *(
            faster_part(
                *pair, "largest distance of the velocity gains, of their height", "%", measured.apart("Vr"), same(0, 10)
            )
            for pair in PAIRS
        ),
        original="Зависимости относительного выигрыша для станций, отличающихся только темпом обзора (РЛС "
        "2 и РЛС 3, РЛС 4 и РЛС 5), практически совпадают.",
        reading="coincide: apart by at most 10 % of the higher curve's largest value, at every common time",
    ),
    _claim(
        13,
        "figures, after figure 2",
        "With velocity σ_V(1) is that of the plot; without, the first σ_V grows as Δt shrinks",
        *(
            Part(
                (n,),
                "first σ of velocity, with velocity",
                "m/s",
                measured.first_velocity(n),
                same(row[1], SHARE * row[1], strict=0.5),
            )
            for n, row in RADARS.items()
        ),
        *(
            faster_part(
                *pair,
                "first σ of velocity, range only, fast − slow",
                "m/s",
                measured.sigma_change(R, "Vr", "first"),
                above(0, SHARE),
                scale=measured.sigma_of(pair[0], R, "Vr", "first"),
            )
            for pair in PAIRS
        ),
        original="При этом СКО ошибки фильтрации σ_Vr(r,Vr)(k) при k = 1 равно σ_fVr, а начальное значение "
        "σ_Vr(r)(k) возрастает с уменьшением периода обзора.",
        reading="that of the plot: within 1 %",
    ),
    _claim(
        14,
        "figures, before figure 1",
        "From the 4th scan the range error falls to a steady value; a D_M is best if it settles in under 10 Δt",
        *(
            Part(
                (2,),
                f"σ of range at the end against the 4th scan, {words}",
                "%",
                measured.final_to_fourth(observes),
                below(100, 1),
            )
            for observes, words in BOTH
        ),
        *(
            Part(
                (n,),
                "settling of σ of range, range only",
                "Δt",
                measured.settling(n),
                below(10),
                asserted=False,
            )
            for n in RADARS
        ),
        original="Начиная с 4-го шага, суммарная ошибка убывает до некоего установившегося значения, определяемого "
        "коэффициентом маневра. Оптимальным стоит рассматривать значение D_м, если время сходимости меньше 10Δt.",
        reading="the second sentence defines a rule and asserts nothing: which radars meet it at D_M = 10⁻³ is shown "
        "and not counted; settled: within 5 % of the steady value, for good (the paper gives no tolerance)",
    ),
    _claim(
        15,
        "figures, after figure 1",
        "A smaller D_M lowers the steady error and lengthens the settling",
        *(
            Part(
                (n,),
                f"σ of range at the end, least D_M − greatest, {words}",
                "m",
                measured.by_variance(n, measured.last_range(observes)),
                below(0, SHARE),
                scale=measured.sigma_of(n, observes, "r", "last"),
                statement="steady error",
            )
            for n in RADARS
            for observes, words in BOTH
        ),
        *(
            Part(
                (n,),
                f"settling of σ of range, least D_M − greatest, {words}",
                "Δt",
                measured.by_variance(n, measured.settling_of(observes)),
                above(0),
                statement="settling",
            )
            for n in RADARS
            for observes, words in BOTH
        ),
        original="Существенное сужение полосы фильтра при малом коэффициенте маневра приводит к уменьшению "
        "установившейся ошибки фильтрации. Однако при этом увеличивается время сходимости.",
        reading="said of the filter, so of each radar: the least against the greatest D_M of the sweep",
    ),
    _claim(
        16,
        "conclusion, ambiguity",
        "A Doppler of 300 m/s at 1 kHz repetition is F/3, 4F and 20F in the three bands",
        Part((1,), "Doppler frequency in repetition rates", "", measured.doppler(1), printed("0.33")),
        Part((2,), "Doppler frequency in repetition rates", "", measured.doppler(2), printed("4")),
        Part((4,), "Doppler frequency in repetition rates", "", measured.doppler(4), printed("20")),
        original="… частота Доплера для радиальной скорости 300 м/с при частоте повторения F_п = 1 кГц для "
        "РЛС метрового диапазона составит лишь одну треть от F_п, а для дециметрового и "
        "сантиметрового она будет равна 4F_п и 20F_п соответственно.",
        reading="algebra: 2V/λF",
    ),
    _claim(
        17,
        "figures, after figure 1",
        "An inaccurate velocity (RLS 1) gives about 10 % at most, at the 3rd and 4th step only",
        gain_part(1, "r", "largest", "largest", about("10")),
        Part(
            (1,),
            "scan of the largest range gain",
            "k",
            lambda seen: seen.k_gain(1, "r").when_largest("k"),
            within(3, 4),
        ),
        Part(
            (1,),
            "least range gain at the scans 3 and 4 less the largest at any other",
            "points",
            measured.above_all_others(1, "r", (3, 4)),
            above(0),
        ),
        original="Использование низкоточной оценки радиальной скорости дает максимальный эффект в районе "
        "10 % лишь на 3–4 шаге фильтрации.",
        reading="the range gain; its largest value, the scan of it, and only: no other step gives as much as either "
        "of these. Scans from k = 2 on; of those from k = 3 on, before which range alone has filtered nothing, 'only' "
        "holds, and 10 % does not. The 7–15 % that the conclusion prints of the same curve (P1.1) do hold",
    ),
    _claim(
        18,
        "figures, before figure 1",
        "RLS 2: the difference Δσ_r(k) = σ_r(r) − σ_r(r,V) grows and stabilises",
        Part((2,), "Δσ of range at the end, of its largest value", "%", measured.final_share, about("100")),
        original="Разность суммарных ошибок Δσ_r(k) = σ_r(r)(k) − σ_r(r,Vr)(k) нарастает и стабилизируется.",
        reading="of figure 1a, at the D_M of the other figures; what grows and stabilises ends at its largest "
        "value, to 10 %",
    ),
    _claim(
        19,
        "figures, after figure 1; conclusion, centimetre band",
        "The effect is greatest where C_θ ≫ 1 (RLS 4, 5), in all three parameters",
        *(
            Part(
                (4, 5, 1, 2),
                f"final {words} gain: least of RLS 4, 5 − largest of RLS 1, 2",
                "points",
                measured.least_minus_largest(c, (4, 5), (1, 2), "last", strict=True),
                above(0),
            )
            for c, words in measured.COMPONENTS.items()
        ),
        *(
            Part(
                (4, 5, 1, 2, 3),
                f"largest {words} gain: best of RLS 4, 5 − best of RLS 1, 2, 3",
                "points",
                measured.least_minus_largest(c, (4, 5), (1, 2, 3), "largest", strict=False),
                above(0),
            )
            for c, words in measured.COMPONENTS.items()
        ),
        original="Максимальный эффект наблюдается для тех типов РЛС, где коэффициент C_θ (см. выражение "
        "(11)) много больше единицы. / Наибольший относительный выигрыш для всех фильтруемых "
        "параметров траектории проявляется у станций сантиметрового диапазона (РЛС 4, РЛС 5).",
        reading="at the end each of RLS 4, 5 above those with C_θ about one; over time the greatest gain is theirs",
    ),
    _claim(
        20,
        "figures, after figure 2",
        "A faster scan lowers the steady σ_V",
        *(
            faster_part(
                *pair,
                f"final σ of velocity, {words}, fast − slow",
                "m/s",
                measured.sigma_change(observes, "Vr", "last"),
                below(0, SHARE),
                scale=measured.sigma_of(pair[0], observes, "Vr", "last"),
            )
            for observes, words in BOTH
            for pair in PAIRS
        ),
        original="Повышение темпа обзора снижает уровень сходимости результирующей дисперсии ошибок "
        "фильтрации радиальной скорости.",
        reading="steady: at 140 s, where the curves have converged; a shorter run cuts the curve, not the level",
    ),
    _claim(
        21,
        "figures, after figure 3",
        "A faster scan raises the first σ_a, with and without velocity",
        *(
            faster_part(
                *pair,
                f"first σ of acceleration, {words}, fast − slow",
                "m/s²",
                measured.sigma_change(observes, "ar", "first"),
                above(0, SHARE),
                scale=measured.sigma_of(pair[0], observes, "ar", "first"),
            )
            for observes, words in BOTH
            for pair in PAIRS
        ),
        original="Уменьшение периода повторения (РЛС 3, РЛС 5) привело к росту начального значения ошибок "
        "фильтрации как при использовании оценок скорости, так и без них.",
    ),
    _claim(
        22,
        "figures, after figure 3",
        "As functions of time the acceleration gains of radars that differ only in Δt practically coincide",
        *(
            faster_part(
                *pair,
                "largest distance of the acceleration gains, of their height",
                "%",
                measured.apart("ar"),
                same(0, 10),
            )
            for pair in PAIRS
        ),
        original="Зависимости относительного выигрыша в точности для РЛС с разными темпами обзора "
        "практически совпадают при построении их во временном масштабе.",
        reading="as for the velocity gains",
    ),
    _claim(
        23,
        "figures, after figure 3",
        "RLS 2: the acceleration is a loss only on a short stretch; afterwards the gain is small or none",
        Part((2,), "scans with a loss in acceleration", "scans", measured.loss_scans, within(1, 3)),
        Part((2,), "largest acceleration gain after the first loss", "%", measured.after_loss, at_most(10)),
        original="Для РЛС 2 лишь на малом (переходном) участке наблюдается отрицательный эффект, на "
        "последующих шагах выигрыш небольшой либо вообще отсутствует.",
        reading="short: at least one scan and at most a quarter of the thirteen; small: at most 10 %",
    ),
    _claim(
        24,
        "figures, after figure 2",
        "The velocity gain falls, with transients in RLS 1",
        *(Part((n,), "velocity gain, end − first", "points", measured.fall(n), below(0)) for n in RADARS),
        Part((1,), "largest rise of the velocity gain over an earlier scan", "points", measured.rise(1), above(0)),
        original="Характер зависимостей – убывающий с возможными моментами переходных процессов "
        "(наблюдается для РЛС 1).",
        reading="each of the five ends below its first value; RLS 1 rises in between",
    ),
    _claim(
        25,
        "figures, after figure 2",
        "With velocity the velocity is there two scans earlier, from the first plot",
        *(
            Part((n,), "scans by which it is earlier", "scans", measured.earlier(n, "scans"), within(2, 2))
            for n in RADARS
        ),
        *(
            Part((n,), "time by which it is earlier", "s", measured.earlier(n, "s"), between("10", "20"))
            for n in (2, 3)
        ),
        original="Результат фильтрации радиальной скорости с использованием расширенного вектора "
        "наблюдения формируется уже по результатам первого обзора, что на два периода раньше (т. "
        "е. на 10–20 с в зависимости Δt), чем при работе только по оценкам дальности.",
    ),
    _claim(
        26,
        "figures, after figure 2",
        "From the 2nd scan on all errors of the velocity fall to a steady value",
        *_falls("Vr", "velocity", 2),
        original="Начиная со 2-го шага, все ошибки фильтрации убывают до установившегося значения, определенного "
        "дисперсией маневра.",
        reading="falls to: no scan from the 2nd on is more above an earlier one than the 5 % within which P1.14 "
        "calls a curve settled; range only from its first velocity, k = 3",
    ),
    _claim(
        27,
        "figures, before figure 3",
        "All errors of the acceleration fall to a limit",
        *_falls("ar", "acceleration", 1),
        original="Все зависимости СКО ошибок фильтрации радиального ускорения убывают до предела, который определяется "
        "параметрами станции и дисперсией случайного маневра.",
        reading="falls to: no scan is more above an earlier one than the 5 % within which P1.14 calls a curve settled",
    ),
    _claim(
        28,
        "figures, before figure 3",
        "Velocity lowers the error of the acceleration at the first steps only",
        *first_steps(2),
        original="Использование оценок радиальной скорости уменьшает ошибки фильтрации лишь на первых шагах обзора.",
        reading="of figure 3a, which shows RLS 2; only: at the end no gain, to 10 %",
    ),
    _claim(
        29,
        "figures, after figure 3",
        "With a precise range and a long wave (RLS 1) the acceleration gain vanishes or becomes a loss",
        gain_part(1, "ar", "last", "final", at_most(0, 1)),
        original="… если в РЛС дальность оценивается с высокой точностью, а при этом используется большая длина волны, "
        "то выигрыш нивелируется, а то и становится проигрышем. Это подтверждается зависимостью для РЛС 1.",
    ),
    _claim(
        30,
        "conclusion, decimetre band",
        "Decimetre radars: the acceleration gain behaves like the velocity gain",
        *(
            Part(
                (n,),
                "correlation of the acceleration gain with the velocity gain over the scans",
                "",
                measured.likeness(n, "ar", "Vr"),
                at_least(0.9, 0.05),
            )
            for n in (2, 3)
        ),
        original="Характер зависимости выигрыша для радиального ускорения схож с зависимостями для радиальной "
        "скорости …",
        reading="alike: a correlation of 0.9 over the scans at which both are there",
    ),
    _claim(
        31,
        "table",
        "C_θ of the five radars is 0.25, 2.78, 11.11, 25, 100",
        *(
            Part((n,), "C_θ from σ_r, σ_V and Δt", "", measured.c_theta(n), printed(text))
            for n, text in zip(RADARS, ("0.25", "2.78", "11.11", "25", "100"), strict=True)
        ),
        original="Значение коэффициента C_θ: 0,25; 2,78; 11,11; 25; 100",
        reading="algebra, eq. (11)",
    ),
    _claim(
        32,
        "figures, after figure 1",
        "The range gain depends on D_M, on the scan, on σ_r and σ_V, and on Δt",
        Part(
            (2,),
            "final range gain, least D_M − greatest",
            "points",
            measured.gain_by_variance(2),
            above(0),
            statement="D_M",
        ),
        Part(
            (2,),
            "range gain at its largest less at the end",
            "points",
            measured.after_peak(2),
            above(0),
            statement="scan",
        ),
        Part(
            (4, 2),
            "final range gain of RLS 4 less that of RLS 2, which differ in σ_r and σ_V",
            "points",
            measured.least_minus_largest("r", (4,), (2,), "last", strict=True),
            above(0),
            statement="accuracies",
        ),
        Part(
            (5, 4),
            "final range gain of RLS 5 less that of RLS 4, which differ in Δt",
            "points",
            measured.least_minus_largest("r", (5,), (4,), "last", strict=True),
            above(0),
            statement="period",
        ),
        original="… выигрыш … определяется не только дисперсией маневра и номером шага, но и значениями СКО ошибок "
        "измерения дальности, радиальной скорости и периода обзора.",
        reading="depends: by more than a point; each of the four is a sentence of its own",
    ),
    _claim(
        33,
        "figures, after figure 3",
        "The acceleration gain depends on how the accuracies of range and velocity compare",
        *(
            Part(
                (more, less),
                f"final acceleration gain of RLS {more} less that of RLS {less}, of a smaller σ_r / σ_V",
                "points",
                measured.least_minus_largest("ar", (more,), (less,), "last", strict=True),
                above(0),
            )
            for more, less in ((4, 2), (2, 1))
        ),
        original="Анализ относительного выигрыша в точности фильтрации радиального ускорения … для каждого типа "
        "гипотетической РЛС подчеркивает его зависимость от соотношения точности оценок дальности и оценок радиальной "
        "скорости.",
        reading="radars of one period, whose σ_r / σ_V is 5, 16.7, 50 s: the gain grows with it, by more than a point",
    ),
    _claim(
        34,
        "conclusion, ambiguity",
        "The Doppler frequency is ambiguous in the centimetre band, and not in the metre band",
        Part(
            (4,),
            "Doppler frequency of 300 m/s in repetition rates, centimetre band",
            "",
            measured.doppler(4),
            above(0.5),
            statement="centimetre",
        ),
        Part(
            (1,),
            "Doppler frequency of 300 m/s in repetition rates, metre band",
            "",
            measured.doppler(1),
            below(0.5),
            statement="metre",
        ),
        original="… для сантиметровых станций возникает эффект неоднозначности оценки частоты Доплера. … В метровых "
        "станциях данное явление не возникает …",
        reading="of the paper's own example, 300 m/s at 1 kHz; ambiguous: over half of the repetition rate, on either "
        "side of zero",
    ),
    _claim(
        35,
        "introduction",
        "A radial velocity beside the range raises the quality of filtering of both (quoted from the authors' papers)",
        *(
            gain_part(n, component, "least", "least", above(0), first=first)
            for n in RADARS
            for component, first in (("r", 2), ("Vr", 3))
        ),
        original="Использование разовых оценок радиальной скорости вместе с оценками дальности повышает качество "
        "фильтрации этих параметров [1–3].",
        reading="of each of the five radars, at every scan at which both filters have an estimate and differ",
    ),
    _claim(
        36,
        "equations (8) and (12)",
        "The printed elements of the forecast's covariance and of the gains are those of the matrices (5) and (9)",
        *(
            Part(
                (n,),
                "largest relative difference of (8) and (12) from (5) and (9)",
                "",
                measured.closed_forms(n),
                at_most(1e-9),
            )
            for n in RADARS
        ),
        original="… нормированная к D_fr корреляционная матрица ошибок экстраполяции, элементы которой вычисляются "
        "следующим образом: … (8) / Вычисляя (9) с использованием выражений (6), (7), (8) и (11), получим: … (12)",
        reading="algebra, on covariances drawn at random",
    ),
)
