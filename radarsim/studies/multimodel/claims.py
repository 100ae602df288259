"""P2.1 … P2.17: what Sychev & Osipov (2023) say, read from their words alone.

Places are the sections of the article (Trudy MAI, 2023, no. 129). The paper's trajectory is lost: claims on it are
judged on the shipped `aeroballistic`, which was chosen before any filter ran on it; where a claim speaks of flights
in general it is judged once more, with the letter t, on the other four, which is an extension and not counted. "The
same" is read as within 1 % of σ. Where the words name no stage and no component, all stages count, in height and rate
of climb.
"""

from collections.abc import Callable
from dataclasses import replace

from radarsim.report.claims import Claim, Part, above, at_least, at_most, below, certain, greater, kept, less, same
from radarsim.report.statistics import Estimate
from radarsim.studies.multimodel.measures import (
    AEROBALLISTIC,
    BANK_122,
    COMPONENTS,
    MMA2_11,
    MMA2_122,
    RIVALS,
    Evidence,
    blocks_over,
    cost_of_merging_early,
    cost_part,
    gain_part,
    growth_of_change,
    largest_fault_of_powers,
    lead_part,
    merged_early,
    probability_part,
    rival_parts,
    share_linear,
)

__all__ = ["CLAIMS", "Evidence"]

SIX = (MMA2_122, *RIVALS)
PAPER = ("aeroballistic", 0.05, SIX)
SAME = same(0, 1, strict=0.5)  # %, of σ
FEW_PERCENT = at_least(-5)  # a loss of at most 5 %
RULES = {rule: ("imm", rule, BANK_122) for rule in ("moment", "best", "combined", "modified_combined")}
MMA3 = ("gpb2", "combined", BANK_122)
MMA1 = ("gpb1", "combined", BANK_122)
FAST = ("aeroballistic", 0.05, (*RULES.values(), MMA3, MMA1))
SLOW = ("aeroballistic", 1.0, (*RULES.values(), MMA3, MMA1))
RARE = ("imm", "combined", BANK_122, ((0.9996, 0, 0.0002), (0, 0.9996, 0.0002), (0.0004, 0.0004, 0.9996)))
OFTEN = ("imm", "combined", BANK_122, ((0.96, 0, 0.02), (0, 0.96, 0.02), (0.04, 0.04, 0.96)))
MATRICES = ("aeroballistic", 0.05, (MMA2_122, RARE, OFTEN))
ALIKE = ((0.996, 0.004), (0.004, 0.996))
WEAK = ("imm", "combined", ("uniform 0.05", "accelerated 0.05"), ALIKE)
STRONG = ("imm", "combined", ("uniform 30", "accelerated 30"), ALIKE)
BANKS = ("aeroballistic", 0.05, (MMA2_122, WEAK, STRONG))
BLOCKS = (  # what is counted, of which family, and over which power of N
    ("extrapolations of MMA2 over N²", "imm", 0, 2),
    ("updates of MMA2 over N", "imm", 1, 1),
    ("Kalman filters of MMA3 over N²", "gpb2", 1, 2),
)
RANGE_M = 200e3  # the far end of the printed axes
FLIGHTS = {
    "aeroballistic_gentle": AEROBALLISTIC,
    "ballistic": ("start", "ballistic"),
    "airliner": ("start", "steady"),
    "weaving": ("start", "steady", "manoeuvre", "after"),
}


def _claim(
    number: str,
    place: str,
    statement: str,
    *parts: Part,
    original: str,
    reading: str = "",
    config: str = "multimodel",
    extension: bool = False,
    reported: bool = False,
) -> Claim:
    return Claim(f"P2.{number}", place, statement, parts, reading, config, original, extension, reported)


def _said(statement: str, *parts: Part) -> list[Part]:
    """Parts of one sentence of a claim."""
    return [replace(part, statement=statement) for part in parts]


def _key(flight: str) -> tuple:
    return (flight, 0.05, SIX)


def _powers(tenfold: bool) -> Callable[[Evidence], Estimate]:
    return lambda seen: certain(largest_fault_of_powers(seen, PAPER, tenfold))


CLAIMS = (
    _claim(
        "1",
        "part 7, figures 5 and 6",
        "MMA2-122 shows the best results at all stages of tracking, in height and rate of climb",
        *rival_parts(PAPER, AEROBALLISTIC, above(0)),
        original="Из рис. 5 и 6 видно, что на всех этапах сопровождения объекта алгоритм ММА2-122 показал наилучшие "
        "результаты.",
        reading="of the six algorithms the least σ over each stage; paired with the best of the other five there",
    ),
    _claim(
        "1t",
        "part 7, figures 5 and 6",
        "MMA2-122 shows the best results at all stages of tracking: on four other flights",
        *(part for flight, stages in FLIGHTS.items() for part in rival_parts(_key(flight), stages, above(0))),
        original="Из рис. 5 и 6 видно, что на всех этапах сопровождения объекта алгоритм ММА2-122 показал наилучшие "
        "результаты.",
        extension=True,
        config="multimodel_trajectories",
    ),
    _claim(
        "2",
        "part 7, figure 7",
        "On the ballistic part the weak uniform-acceleration model is the main one",
        lead_part(PAPER, MMA2_122, "ballistic", 1, above(0, 0.01)),
        original="Из рис. 7 видно, что на баллистическом участке траектории движения объекта в алгоритме ММА2-122 "
        "основной является модель равноускоренного движения с малыми возмущениями.",
        reading="its mean probability over the stage is the largest of the three",
    ),
    _claim(
        "2t",
        "part 7, figure 7",
        "On the ballistic part the weak uniform-acceleration model is the main one: on two other flights",
        lead_part(_key("aeroballistic_gentle"), MMA2_122, "ballistic", 1, above(0, 0.01)),
        lead_part(_key("ballistic"), MMA2_122, "ballistic", 1, above(0, 0.01)),
        original="Из рис. 7 видно, что на баллистическом участке траектории движения объекта в алгоритме ММА2-122 "
        "основной является модель равноускоренного движения с малыми возмущениями.",
        extension=True,
        config="multimodel_trajectories",
    ),
    _claim(
        "3",
        "part 7, figure 7",
        "Under intense manoeuvre the strong uniform-acceleration model takes the initiative",
        lead_part(PAPER, MMA2_122, "manoeuvre", 2, above(0, 0.01)),
        original="На участке интенсивного маневрирования объекта инициативу на себя берет модель равноускоренного "
        "движения с большими возмущениями.",
        reading="its mean probability over the stage is the largest of the three",
    ),
    _claim(
        "3t",
        "part 7, figure 7",
        "Under manoeuvre the strong uniform-acceleration model takes the initiative: on two gentler flights",
        lead_part(_key("aeroballistic_gentle"), MMA2_122, "manoeuvre", 2, above(0, 0.01)),
        lead_part(_key("weaving"), MMA2_122, "manoeuvre", 2, above(0, 0.01)),
        original="На участке интенсивного маневрирования объекта инициативу на себя берет модель равноускоренного "
        "движения с большими возмущениями.",
        extension=True,
        config="multimodel_trajectories",
    ),
    _claim(
        "4",
        "part 7, after figure 7's discussion",
        "For aerodynamic targets without manoeuvre the weak uniform-motion model becomes the main one",
        lead_part(_key("airliner"), MMA2_122, "steady", 0, above(0, 0.01)),
        original="Проведенные исследования показали, что для аэродинамических объектов без маневрирования основной "
        "становится модель прямолинейного равномерного движения с малыми возмущениями.",
        reading="its mean probability is the largest of the three, once the track has settled",
        config="multimodel_trajectories",
    ),
    _claim(
        "5",
        "part 7, after figure 7's discussion",
        "In MMA2-11 the weak model takes practically no part on this trajectory",
        probability_part(PAPER, MMA2_11, "whole", 0, below(0.1)),
        original="Для алгоритма ММА2-11, для приведенной на рис. 1-4 траектории движения объекта, модель "
        "прямолинейного равномерного движения с малыми возмущениями фактически не участвует в работе "
        "алгоритма.",
        reading="its mean probability over the whole flight is under a tenth; flights that manoeuvre from 60 s on are "
        "among the readings, and change nothing",
    ),
    _claim(
        "6",
        "part 7",
        "At 20 Hz combined and modified combined coincide; at 1 Hz the modified rule gains a little under manoeuvre",
        *_said(
            "20 Hz",
            *(
                gain_part(
                    FAST, RULES["modified_combined"], RULES["combined"], stage, c, SAME, "modified over combined, 20 Hz"
                )
                for stage in AEROBALLISTIC
                for c in COMPONENTS
            ),
        ),
        *_said(
            "1 Hz, manoeuvre",
            *(
                gain_part(
                    SLOW, RULES["modified_combined"], RULES["combined"], "manoeuvre", c, above(0), "modified, 1 Hz"
                )
                for c in COMPONENTS
            ),
        ),
        *_said(
            "1 Hz, elsewhere",
            *(
                gain_part(SLOW, RULES["modified_combined"], RULES["combined"], stage, c, SAME, "modified, 1 Hz")
                for stage in ("start", "ballistic", "after")
                for c in COMPONENTS
            ),
        ),
        original="При частоте поступления отметок … около 20 Гц результаты полностью совпали. При частоте "
        "поступления отметок около 1 Гц алгоритм с модифицированным комбинированным способом объединения "
        "гипотез дал небольшой выигрыш по точности сопровождения объекта на участке интенсивного "
        "маневрирования. На остальных участках результаты совпали.",
        reading="coincide: within 1 %, at 1 Hz in all stages but the manoeuvre; a little: more than 1 %",
        config="multimodel_rules",
    ),
    _claim(
        "7",
        "part 1",
        "MMA3 is the most accurate; MMA2 loses at most 5 % to it, at a much lower cost",
        *_said(
            "at most 5 %",
            *(
                gain_part(key, RULES["combined"], MMA3, stage, c, FEW_PERCENT, f"MMA2 over MMA3, {rate}")
                for key, rate in ((FAST, "20 Hz"), (SLOW, "1 Hz"))
                for stage in AEROBALLISTIC
                for c in COMPONENTS
            ),
        ),
        *_said(
            "the most accurate",
            *(
                gain_part(key, other, MMA3, stage, c, below(0), f"{name} over MMA3, {rate}")
                for key, rate in ((FAST, "20 Hz"), (SLOW, "1 Hz"))
                for other, name in ((RULES["combined"], "MMA2"), (MMA1, "MMA1"))
                for stage in AEROBALLISTIC
                for c in COMPONENTS
            ),
        ),
        *_said(
            "cost",
            cost_part(FAST, RULES["combined"], MMA3, below(0.5), "MMA2 / MMA3, 20 Hz"),
            cost_part(SLOW, RULES["combined"], MMA3, below(0.5), "MMA2 / MMA3, 1 Hz"),
            cost_part(FAST, MMA1, MMA3, less(), "MMA1 / MMA3, 20 Hz"),
            cost_part(SLOW, MMA1, MMA3, less(), "MMA1 / MMA3, 1 Hz"),
        ),
        original="Исследования показали, что алгоритм ММА3 обеспечивает наиболее высокую точность оценивания вектора "
        "состояния объекта, но при этом является наиболее трудоемким. Алгоритм ММА2 обычно проигрывает ему "
        "по точности не более 5%, но при этом значительно менее трудоемкий.",
        reading="all with the combined rule; a gain of -5 % is a loss of 5 %; much lower: less than half",
        config="multimodel_rules",
    ),
    _claim(
        "8",
        "part 3",
        "The combined rule gives the best accuracy: better than both pure rules",
        *(
            part
            for pure in ("moment", "best")
            for part in _said(
                pure,
                *(
                    gain_part(FAST, RULES["combined"], RULES[pure], stage, c, above(0), f"combined over {pure}, 20 Hz")
                    for stage in AEROBALLISTIC
                    for c in COMPONENTS
                ),
            )
        ),
        original="Проведенные исследования показали, что наилучшие результаты, с точки зрения точности оценивания "
        "вектора состояния, достигаются при комбинированном использовании алгоритмов (4) и (5).",
        reading="MMA2 at 20 Hz",
        config="multimodel_rules",
    ),
    _claim(
        "9",
        "part 3",
        "Moment merging makes a filter more responsive; merging by the best smooths better in steady motion",
        *_said(
            "responsive",
            gain_part(FAST, RULES["moment"], RULES["best"], "manoeuvre", "y", above(0), "moment over best, 20 Hz"),
        ),
        *_said(
            "smooth",
            gain_part(FAST, RULES["best"], RULES["moment"], "ballistic", "y", above(0), "best over moment, 20 Hz"),
        ),
        original="В алгоритме (4), гипотезы с малыми вероятностями … делает соответствующий фильтр более "
        "чувствительным к текущим наблюдениям. … В условиях, когда рассматриваемая гипотеза соответствует "
        "текущему типу движения объекта, это ухудшает возможности соответствующего фильтра по сглаживанию … "
        "В этом случае алгоритм (5) выглядит более предпочтительным.",
        reading="MMA2: less σ of the height under manoeuvre, and on the ballistic part",
        config="multimodel_rules",
    ),
    _claim(
        "10",
        "parts 3 and 7",
        "The modified rule lowers the cost and keeps the accuracy",
        *_said(
            "cost",
            cost_part(FAST, RULES["modified_combined"], RULES["combined"], less(), "modified / combined, 20 Hz"),
            cost_part(SLOW, RULES["modified_combined"], RULES["combined"], less(), "modified / combined, 1 Hz"),
        ),
        *_said(
            "accuracy",
            *(
                gain_part(key, RULES["modified_combined"], RULES["combined"], stage, c, kept(), f"modified, {rate}")
                for key, rate in ((FAST, "20 Hz"), (SLOW, "1 Hz"))
                for stage in AEROBALLISTIC
                for c in COMPONENTS
            ),
        ),
        original="Основной выигрыш модифицированного комбинированного способа объединения гипотез заключается в "
        "снижении вычислительных затрат при сохранении точности сопровождения объекта.",
        reading="operations counted over the whole flight; accuracy kept: no loss of 1 %",
        config="multimodel_rules",
    ),
    _claim(
        "11",
        "part 4, eq. (8)",
        "P(Δt) tends to the unit matrix as Δt → 0, and P(nΔt) is the n-th power of P(Δt)",
        Part((PAPER,), "largest element of P(50 ns) − I", "", _powers(tenfold=False), below(1e-6)),
        Part((PAPER,), "largest element of P(0.5 s) − P(50 ms)¹⁰", "", _powers(tenfold=True), below(1e-12)),
        original="При этом lim(P(Δt)) = I, где I - единичная матрица. Можно показать, что P(nΔt) = Pⁿ(Δt).",
        reading="algebra of the matrices in use",
    ),
    _claim(
        "12",
        "part 4",
        "Many publications assert that the transition matrix has little influence on the characteristics",
        *(
            gain_part(MATRICES, other, MMA2_122, stage, c, same(0, 10), f"changes {words} over as printed")
            for other, words in ((RARE, "ten times rarer"), (OFTEN, "ten times as frequent"))
            for stage in AEROBALLISTIC
            for c in COMPONENTS
        ),
        original="Во многих публикациях утверждается, что влияние этой матрицы на характеристики алгоритмов "
        "незначительно [1].",
        reading="little: σ changes by under 10 % when models change ten times less or more often. The paper reports "
        "it, and goes on to derive how the matrix has to follow Δt: what came out is not counted against it. It fails "
        "on the ballistic part alone, of the rate of climb at half and twice the rate already",
        config="multimodel_transition",
        reported=True,
    ),
    _claim(
        "13",
        "part 6",
        "Good banks hold weak models and at least one strong one",
        *_said(
            "weak", gain_part(BANKS, MMA2_122, STRONG, "ballistic", "y", above(0), "weak and strong over strong alone")
        ),
        *_said(
            "strong", gain_part(BANKS, MMA2_122, WEAK, "manoeuvre", "y", above(0), "weak and strong over weak alone")
        ),
        *_said(
            "transients", gain_part(BANKS, MMA2_122, WEAK, "after", "y", above(0), "weak and strong over weak alone")
        ),
        original="Исследование многомодельных алгоритмов показало, что хорошо себя зарекомендовали те из них, "
        "которые используют как слабо возмущенные модели движения и как минимум одну сильно возмущенную "
        "модель. В этом случае удается достичь высокой точности … в условиях, когда одна из слабо возмущенных моделей "
        "соответствует текущему движению объекта, и избежать больших динамических ошибок и длительных переходных "
        "процессов при маневрировании или смене типа движения.",
        reading="better than strong models alone where nothing manoeuvres, than weak ones alone where something does "
        "and over the stage after it",
        config="multimodel_banks",
    ),
    _claim(
        "14",
        "part 4, before eq. (8)",
        "The probability of a change of the motion grows with the interval between plots",
        Part(
            (PAPER,),
            "largest probability to leave a model within 1 s over that within 50 ms, least of the filters",
            "",
            lambda seen: certain(growth_of_change(seen, PAPER)),
            greater(),
        ),
        original="Рассматривая процесс смены типа движения воздушного объекта как Марковскую цепь несложно прийти к "
        "выводу, что вероятность смены типа движения растет при увеличении интервала времени Δt.",
        reading="algebra of the matrices in use",
    ),
    _claim(
        "15",
        "part 1, last sentences",
        "MMA2 is the IMM algorithm: merging before extrapolation gives the same, at a lower cost",
        Part(
            (PAPER,),
            "largest relative difference of merging before and after extrapolation",
            "",
            lambda seen: certain(merged_early(seen, PAPER, MMA2_122)),
            at_most(1e-9),
            statement="same",
        ),
        Part(
            (PAPER,),
            "operations of extrapolating what is merged over those of merging what is extrapolated",
            "",
            lambda seen: certain(cost_of_merging_early(seen, PAPER, MMA2_122)),
            less(),
            statement="cost",
        ),
        original="Поэтому появляется возможность … провести с учетом этого вычисление объединенных вектора состояния и "
        "его ковариационной матрицы, а только потом провести их экстраполяцию. В результате ММА2 полностью "
        "соответствует описанию алгоритма IMM [1]. Это позволяет дополнительно сократить вычислительные затраты.",
        reading="algebra of the models of MMA2-122, on hypotheses drawn at random; operations are counted",
    ),
    _claim(
        "16",
        "part 2",
        "Radar plots are so accurate that in the overwhelming majority of cases normal densities, which is to say "
        "linearisation, are justified",
        Part(
            (PAPER,),
            "share of the printed accuracies, at 200 km, with which linearisation is right about a plot to 10 %",
            "",
            lambda seen: certain(share_linear(RANGE_M)),
            at_least(0.9, 0.05),
        ),
        Part(
            (PAPER,),
            "the same, spread evenly in their logarithms",
            "",
            lambda seen: certain(share_linear(RANGE_M, even_logarithms=True)),
            at_least(0.9, 0.05),
            asserted=False,
        ),
        original="Точность оценивания координат объектов достаточно высокая. Для первичных радиолокационных наблюдений "
        "среднее квадратическое отклонение (с.к.о.) ошибки по дальности (1-150) м, с.к.о. ошибки по азимуту (2-15) "
        "угловых минут. Поэтому в подавляющем большинстве случаев оправдана аппроксимация плотностей распределения "
        "вероятностей векторов состояния и наблюдения нормальным законом, что фактически эквивалентно линеаризации "
        "задачи.",
        reading="the printed ranges of σ, each spread evenly and the elevation as accurate as the azimuth, at the far "
        "end of the printed axes. Right: of a plot's mean squared error along the line of sight, which bends most, "
        "at most a tenth is from the bend; overwhelming: nine in ten",
    ),
    _claim(
        "17",
        "part 1",
        "MMA2 has N² extrapolations and N updates, MMA3 is N² Kalman filters side by side",
        *(
            Part(
                (PAPER,),
                f"{what}, bank of MMA2-11",
                "",
                blocks_over(PAPER, MMA2_11, family, which, power),
                same(1, 1e-9),
                statement=family,
            )
            for what, family, which, power in BLOCKS
        ),
        *(
            Part(
                (PAPER,),
                f"{what}, bank of MMA2-122",
                "",
                blocks_over(PAPER, MMA2_122, family, which, power),
                same(1, 1e-9),
                statement=family,
                asserted=False,
            )
            for what, family, which, power in BLOCKS
        ),
        original="В результате в ММА2 присутствует N² блоков экстраполяции и N блоков обновления. … Алгоритм ММА3 "
        "представляет собой N² параллельно работающих фильтров Калмана с частичным объединением информации для "
        "отдельных гипотез после их обновления.",
        reading="algebra of the blocks that operations are counted by, MMA2 before the saving of P2.15; of a matrix "
        "that allows every change. The printed one of three models allows seven of nine, and so many are run",
    ),
)
