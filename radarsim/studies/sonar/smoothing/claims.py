"""P3.1 … P3.7, P3.11 … P3.19: what Butyrskiy says of smoothing, from his words alone, before anything was measured.

The paper has no experiment and prints few numbers, so most statements are formulas. A formula holds when what is
measured is within 1 % of it in σ, within 2 % in a variance or covariance; an identity, to 10⁻⁹. Places are the
paper's sections.
"""

from radarsim.report.claims import Claim, Part, above, at_most, greater, less, same, within
from radarsim.studies.sonar.smoothing import measures as measured
from radarsim.studies.sonar.smoothing.measures import ASYNCHRONOUS, FLUCTUATING, GAP, TEXTBOOK, TURNING, correlated

IN_SIGMA = same(1, 0.01)
IN_VARIANCE = same(1, 0.02)
SAME = same(1, 1e-9)


def _claim(
    number: int,
    place: str,
    statement: str,
    *parts: Part,
    original: str,
    reading: str = "",
    config: str = "sonar_smoothing",
    unstated: str = "",
) -> Claim:
    return Claim(f"P3.{number}", place, statement, parts, reading, config, original, unstated=unstated)


def _formula(what: str, n: int) -> Part:
    return Part(
        (TEXTBOOK,),
        f"{what} σ after {n} plots, over the formula",
        "",
        measured.over_formula(what, n),
        IN_SIGMA,
        exact=measured.exact_over_formula(what, n),
    )


def _gain(letter: str, n: int) -> Part:
    words = f"{letter}_n from the measured errors at n = {n}, over the formula"
    return Part(
        (TEXTBOOK,),
        words,
        "",
        measured.gain_over_formula(letter, n),
        IN_VARIANCE,
        exact=measured.exact_gain_over_formula(letter, n),
    )


def _optimal(rho: float) -> Part:
    words = f"σ of the range after 20 plots at ρ = {rho:g}, over generalised least squares"
    return Part(
        (correlated(rho),), words, "", measured.over_optimal(correlated(rho), "kalman_augmented", "r"), IN_SIGMA
    )


CLAIMS = (
    _claim(
        1,
        "principle of optimal construction, after (2)",
        "σ of a straight line through n plots: σ√(2(2n−1)/(n(n+1))) at the last, σ√(2(2n+1)/(n(n−1))) a scan ahead",
        *(_formula("smoothed", n) for n in (2, 3, 5, 8, 20)),
        *(_formula("extrapolated", n) for n in (2, 3, 5, 8, 20)),
        original="Среднеквадратическая ошибка сглаженной и экстраполированной на один обзор координаты таким образом "
        "определяются выражениями: σ_x̄n = σ_x √(2(2n−1)/(n(n+1))), σ_x̄n+1 = σ √(2(2n+1)/(n(n−1))).",
    ),
    _claim(
        2,
        "equation (3)",
        "The acceleration of a parabola through n plots has variance 720 σ²/(T₀⁴ n(n²−1)(n²−4))",
        *(_formula("acceleration", n) for n in (3, 5, 8, 20)),
        original="… где σ²_ax = 720σ²_x / (T⁴_0 [n(n²−1)(n²−4)]). (3)",
    ),
    _claim(
        3,
        "principle of optimal construction, after (2)",
        "High accuracy of smoothing and extrapolation needs many plots: 5–6",
        Part(
            (TEXTBOOK,),
            "fewest plots that extrapolate no worse than a plot measures",
            "plots",
            measured.enough,
            within(5, 6),
            exact=measured.exact_enough,
        ),
        original="Анализ показывает, что при оптимальной фильтрации и экстраполяции по методу максимального "
        "правдоподобия для получения высокой точности оценки координат необходим одновременный учет "
        "большого числа (5-6) предыдущих наблюдений.",
        reading="the paper does not say what high accuracy is; taken: a predicted position as good as a measured one",
    ),
    _claim(
        4,
        "equation (14) and step 5",
        "A_n = 2(2n−1)/(n(n+1)), B_n = 6/(n(n+1)); the recursion is the Kalman filter of a straight line",
        *(_gain(letter, n) for letter in "AB" for n in (2, 5, 20)),
        Part(
            (TEXTBOOK,),
            "largest relative difference in σ of recursion and Kalman filter",
            "",
            measured.alike,
            at_most(1e-9),
        ),
        original="При равнодискретных и равноточных (без пропусков) измерениях координаты имеем … Подставляя эти "
        "значения в выражение (14), получаем: A_n = 2(2n−1)/(n(n+1)), B_n = 6/(n(n+1)).",
        reading="var r / σ² is A_n and T₀ cov(r, v) / σ² is B_n",
    ),
    _claim(
        5,
        "step 4, after (14)",
        "At a missed plot the estimate is the extrapolated one",
        Part((GAP,), "σ at the missed scan over σ extrapolated to it", "", measured.at_a_miss("growing_memory"), SAME),
        Part((GAP,), "the same of the Kalman filter", "", measured.at_a_miss("kalman"), SAME),
        original="Если в очередном (n-м) обзоре имеет место пропуск отметки, то w_rn = 0 … и A_n = B_n = 0. В "
        "качестве сглаженного значения координаты и скорости в этом случае принимаются их "
        "экстраполированные значения.",
        config="sonar_missed",
    ),
    _claim(
        6,
        "correlated errors",
        "Errors estimated beside the state, and differences of plots, both solve the case of correlated errors",
        *(
            Part(
                (correlated(rho),),
                f"largest relative difference in σ of the two at ρ = {rho:g}",
                "",
                measured.two_ways(rho),
                at_most(1e-9),
            )
            for rho in (-0.5, 0.6, 0.9)
        ),
        *(_optimal(rho) for rho in (-0.5, 0.6, 0.9)),
        original="… применяется прием, суть которого состоит в расширении вектора оцениваемых параметров за счет "
        "включения в него вектора ошибок измерения. / Возможен другой подход к решению поставленной задачи, "
        "позволяющий обойтись без расширения вектора оцениваемых параметров.",
        reading="optimal both: equal to generalised least squares",
        config="sonar_correlated",
    ),
    _claim(
        7,
        "step 5, last sentences",
        "With growing n new plots count less and less; the filter stops following a real, fluctuating target",
        *(
            Part(
                (TEXTBOOK,),
                f"{letter}_40 over {letter}_5, measured",
                "",
                measured.gain_falls(letter, 5, 40),
                less(),
                exact=measured.exact_gain_falls(letter, 5, 40),
            )
            for letter in "AB"
        ),
        Part(
            (FLUCTUATING,),
            "σ of the range at the end over its own least, growing memory",
            "",
            measured.rises,
            greater(),
        ),
        Part(
            (FLUCTUATING,),
            "gain in σ of the range of a window of 10 plots at the end",
            "%",
            measured.bounded,
            above(0),
            exact=measured.exact_bounded,
        ),
        original="Из последних выражений следует, что с увеличением n результаты последних наблюдений при "
        "сглаживании координаты и скорости учитываются – все с меньшим весом и алгоритм перестает "
        "реагировать на изменение входного сигнала. В этом существенный недостаток …, если иметь в виду, "
        "что для реальных целей траектория движения подвержена случайным флуктуациям.",
        reading="on the shipped course, whose velocity changes by 0.25 m/s at random between plots, after 40 plots",
        config="sonar_fluctuating",
    ),
    _claim(
        11,
        "principle of optimal construction, sequential smoothing",
        "The recursion keeps two numbers however many the plots, with fewer operations than repeated least squares",
        Part((TEXTBOOK,), "numbers kept from plot to plot", "", measured.kept("recursion (12)-(14)"), within(2, 2)),
        *(
            Part(
                (TEXTBOOK,),
                f"operations of the recursion over those of least squares on {n} plots",
                "",
                measured.cost("recursion (12)-(14)", f"least squares (2) on {n} plots"),
                less(),
            )
            for n in (2, 6)
        ),
        original="Независимо от числа наблюдений при оценке координат и параметров используются лишь два числа: "
        "предыдущее усреднение и новое измеренное значение. / Уменьшить требования к емкостным и "
        "вычислительным затратам …",
        reading="r and v are kept; the weights' own f, g, h, K depend on no measurement. Operations are counted",
    ),
    _claim(
        12,
        "correlated errors, end of the first method",
        "Estimating the errors beside the state complicates the calculation; differences do without",
        Part(
            (correlated(0.6),),
            "operations of the augmented filter over those of the differenced one",
            "",
            measured.cost("augmented", "differenced"),
            greater(),
        ),
        original="Недостатком рассмотренного метода является усложнение расчетов из-за увеличения размерности "
        "вектора оцениваемых параметров …",
        reading="a scan of one coordinate, degree 1; operations are counted, in matrices as printed",
        config="sonar_correlated",
    ),
    _claim(
        13,
        "conclusions, 2",
        "Plots of any moments, in any combination and of different accuracy are handled by the same equations",
        *(
            Part(
                (ASYNCHRONOUS,),
                f"σ of the {name} at the end over weighted least squares",
                "",
                measured.over_optimal(ASYNCHRONOUS, "kalman", component),
                IN_SIGMA,
            )
            for component, name in (("r", "range"), ("b", "bearing"))
        ),
        original="В процессе решения задачи обеспечивается возможность задания различной информации о цели, "
        "поступающей в любые моменты времени в произвольном сочетании и с разной точностью.",
        config="sonar_asynchronous",
    ),
    _claim(
        14,
        "principle of optimal construction, sequential smoothing",
        "Sequential smoothing raises the accuracy of what is put out, at a lower cost than repeated least squares",
        Part(
            (TEXTBOOK,),
            "σ of the recursion after 20 plots over that of least squares on 6",
            "",
            measured.bought(20, 6),
            less(),
            exact=measured.exact_bought(20, 6),
            statement="accuracy",
        ),
        Part(
            (TEXTBOOK,),
            "operations of the recursion over those of least squares on 6 plots",
            "",
            measured.cost("recursion (12)-(14)", "least squares (2) on 6 plots"),
            less(),
            statement="cost",
        ),
        Part(
            (TEXTBOOK,),
            "σ of the recursion over that of least squares, both after 20 plots",
            "",
            measured.over_formula("smoothed", 20),
            less(),
            exact=measured.exact_over_formula("smoothed", 20),
            asserted=False,
        ),
        original="Уменьшить требования к емкостным и вычислительным затратам специализированной ЭВМ вторичной "
        "обработки при одновременном повышении точности выходных данных можно путем применения принципа "
        "последовательного сглаживания координат и параметров.",
        reading="against the 5–6 plots that the paper recommends: the accuracy is that of more plots at the same cost. "
        "On the same plots both are one estimate (P3.4): shown, and neither better nor worse. Of a target that moves "
        "as the filter takes it to",
    ),
    _claim(
        15,
        "conclusions, 1",
        "A Kalman-Bucy filter looks at two neighbouring moments only and demands less of the target's uniform motion",
        Part(
            (FLUCTUATING,),
            "σ of the range at the end of (11) over that of growing memory",
            "",
            measured.as_printed,
            less(),
        ),
        Part(
            (FLUCTUATING,),
            "the same of (11) with process noise",
            "",
            measured.with_manoeuvres,
            less(),
            asserted=False,
        ),
        original="В расчетах непосредственно используется информация только о двух соседних моментах времени, что "
        "позволяет оценивать изменяющийся во времени вектор неизвестных параметров и снижает жесткость требований к "
        "прямолинейному и равномерному движению цели в течение всего времени определения КПДЦ.",
        reading="on the shipped course whose velocity walks at random. (11) is printed without process noise, Ψ_э = "
        "ΦΨΦᵀ, and is then the recursion with growing memory: the same estimate, neither better nor worse. With "
        "process noise, which the print lacks, it does demand less: shown and not counted",
        config="sonar_fluctuating",
    ),
    _claim(
        16,
        "after (12)",
        "Over an interval of any length g_n is g_{n−1} + f_n Δt/T₀",
        *(
            Part(
                (TEXTBOOK,),
                f"g_{n} of this formula at equal intervals over the closed form n(n−1)/2",
                "",
                measured.printed_sum(n),
                SAME,
            )
            for n in (2, 5, 20)
        ),
        original="Если экстраполяция производится на произвольный интервал времени Δt_э, формулы для h_n и g_n "
        "приобретают вид: … g_n = g_{n−1} + f_n(Δt_э/T_0).",
        reading="an interval of T₀ is one of any length: (12) has f_{n−1} there, and step 5 the closed form. A like "
        "slip, if it is one, is B_n = 6/(n(n+1)) of (14), printed without restriction: it is that of equal intervals "
        "and weights",
        unstated="it stands on one subscript of a scan that a machine has read: f_n for f_{n−1} is as likely the "
        "reader's slip as the print's",
    ),
    _claim(
        17,
        "correlated errors, after (15)",
        "The predictable part of correlated errors lets them be forecast and smoothed",
        *(
            Part(
                (correlated(rho),),
                f"σ of the range after 20 plots at ρ = {rho:g}, errors taken as independent over errors estimated",
                "",
                measured.ignored(rho),
                greater(),
            )
            for rho in (-0.5, 0.6, 0.9)
        ),
        original="Наличие предсказуемой части позволяет прогнозировать и сглаживать ошибки измерения.",
        reading="it pays: the filter that estimates the errors is better than one that takes them as independent",
        config="sonar_correlated",
    ),
    _claim(
        18,
        "principle of optimal construction, before (1)",
        "Smoothing the plots makes extrapolation more accurate",
        *(
            Part(
                (TEXTBOOK,),
                f"extrapolated σ of {n} plots smoothed over that of the last two as they are",
                "",
                measured.bought(n, 2, "extrapolated"),
                less(),
                exact=measured.exact_bought(n, 2, "extrapolated"),
            )
            for n in (3, 6, 20)
        ),
        original="Экстраполяция состоит в том, что по координатам ранее полученных отметок вычисляются координаты "
        "будущей отметки. … Для более точного решения задачи экстраполяции … осуществляется сглаживание измеренных "
        "координат отметок или параметров траекторий целей.",
        reading="a scan ahead; without smoothing: the straight line through the last two plots",
    ),
    _claim(
        19,
        "filtering of a linear trajectory, first sentence",
        "The parameters of a linear trajectory can be filtered coordinate by coordinate: these are not tied together",
        *(
            Part(
                (TEXTBOOK,),
                f"σ of the {name} after 20 plots, filtered alone, over least squares on range and bearing at once",
                "",
                measured.over_jointly(component, 20),
                IN_SIGMA,
            )
            for component, name in (("r", "range"), ("b", "bearing"))
        ),
        *(
            Part(
                (TURNING,),
                f"σ of the {name} at the end of a straight course at constant speed over that of a linear trajectory",
                "",
                measured.on_a_straight_course(component),
                IN_SIGMA,
                asserted=False,
            )
            for component, name in (("r", "range"), ("b", "bearing"))
        ),
        original="Закон изменения координат линейной траектории записывается в виде: … Фильтрацию параметров линейной "
        "траектории можно проводить отдельно по каждой координате, так как последние не связаны между собой.",
        reading="linear as the law before the sentence has it: range and bearing each at a constant rate, with errors "
        "independent of each other. Range and bearing of a vessel on a straight course are no polynomials, and are "
        "tied together: what that costs in two minutes is shown and not counted",
        config="sonar_fluctuating",
    ),
)
