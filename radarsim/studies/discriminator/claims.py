"""P4.1 … P4.20: what Uss, Baryshev & Djavad (2010) say, read from their words alone.

Places are the article's sections (Aviacionno-kosmicheskaya tehnika i tehnologiya 2010, no. 6): 3 holds the method, 4
the experiment. Its numbers are judged in both readings of its noise and threshold, see discriminator_measures.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

from radarsim.report.claims import (
    Claim,
    Part,
    Range,
    about,
    above,
    at_least,
    at_most,
    below,
    certain,
    greater,
    on_grid,
    printed,
    same,
    within,
)
from radarsim.report.statistics import Estimate, difference
from radarsim.studies.discriminator.measures import (
    COMPONENTS,
    COMPUTED,
    ESTIMATE,
    PRINTED,
    SPEEDS,
    WORDS,
    Evidence,
    OfReading,
    accuracy_of,
    closed_over_sum,
    doppler_of_polynomial,
    doppler_of_speed,
    efficient,
    forecast_spread,
    growth_of_first_window,
    loss_of_lock,
    potential_of,
    wide_over_whole,
)

__all__ = ["CLAIMS", "Evidence"]

PAPER, MAPS = "discriminator_paper", "discriminator_maps"
SPREADS = {
    "phi0": ("0.061", "rad"),
    "f0": ("0.45", "Hz"),
    "f1": ("12.2", "Hz/s"),
    "f2": ("183.38", "Hz/s²"),
    "f3": ("1213.04", "Hz/s³"),
}
PRINTED_FORECAST = {  # value, half of its last digit
    "phi0": (6.1, 0.05),
    "f0": (67.5, 0.05),
    "f1": (6.1e3, 50.0),
    "f2": (183.38e3, 5.0),
    "f3": (2.426e6, 500.0),
}
SCALE, NOISE, ERROR = "prior.scale", "burst.noise_variance", "prior.error_scale"


def _claim(
    number: int,
    place: str,
    statement: str,
    *parts: Part,
    original: str,
    reading: str = "",
    config: str = PAPER,
    **more: Any,
) -> Claim:
    return Claim(f"P4.{number}", place, statement, parts, reading, config, original, **more)


Value = TypeVar("Value")


def _at(measure: Callable[[Evidence, str], Value], key: str, seen: Evidence) -> Value:
    """What is measured of a reading, with the evidence last."""
    return measure(seen, key)


def _known(value: Estimate) -> Callable[[Evidence], Estimate]:
    """What needs no run."""
    return lambda seen: value


def _both(
    what: str, unit: str, measure: OfReading, expected: Range, asserted: bool = True, ceiling: bool = False
) -> list[Part]:
    """A part for each reading, both of which have to be true; measure(evidence, key)."""
    return [
        Part(
            (key,),
            f"{what} ({WORDS[key]})",
            unit,
            partial(_at, measure, key),
            expected,
            ceiling=partial(_at, efficient, key) if ceiling else None,
            asserted=asserted,
        )
        for key in (COMPUTED, PRINTED)
    ]


def _number(number: str, what: str, unit: str, measure: OfReading, expected: Range) -> list[Part]:
    """A printed number in both readings, of which one suffices; σ² = 2.25 is not what the paper prints."""
    return [
        replace(part, number=number, variant=key, against_print=key == COMPUTED)
        for key, part in zip((COMPUTED, PRINTED), _both(what, unit, measure, expected), strict=True)
    ]


SPREAD_PARTS = [
    part
    for component, (number, unit) in SPREADS.items()
    for part in _number(
        component,
        f"potential spread of {component}",
        unit,
        potential_of(component),
        printed(number),
    )
]
FIRST = _number("T0", "first window", "ms", lambda seen, key: certain(1e3 * seen.windows(key)[0]), printed("1.79"))
SHORTEST = _number(
    "Tmin",
    "shortest window at the paper's amplitude 1.17",
    "ms",
    lambda seen, key: seen.shortest_window(key, ESTIMATE),
    printed("1.31"),
)
WINDOWS = _number(
    "12", "windows after the first", "", lambda seen, key: certain(len(seen.windows(key)) - 1), within(12, 12)
)


CLAIMS = (
    _claim(
        1,
        "section 4",
        "The potential spreads are 0.061 rad, 0.45 Hz, 12.2 Hz/s, 183.38 Hz/s², 1213.04 Hz/s³",
        *SPREAD_PARTS,
        original="Для заданных параметров зондирующей пачки импульсов, потенциальные СКО … составляют: σ_φ0(T) = "
        "0.061; σ_f0(T) = 0.45 Гц; σ_f1(T) = 12.2 Гц²; σ_f2(T) = 183,38 Гц³; σ_f3(T) = 1213,04 Гц⁴.",
        reading="by the discrete sum over l = 0 … 29 998; the closed form for T = 0.3 s gives 183.37 and 1212.86",
    ),
    _claim(
        2,
        "section 4",
        "The first window is 1.79 ms, the shortest allowed 1.31 ms",
        *FIRST,
        *SHORTEST,
        original="Тогда согласно (17) максимальная длина сигнала T_min = 1,31 ms. Найден следующий корень уравнения "
        "(15): T_0 = 1,79 ms.",
        reading="each number in one of the readings; that one gives all is P4.11",
    ),
    _claim(
        3,
        "section 4, conclusion",
        "From the first window to the whole burst it takes 12 iterations",
        *WINDOWS,
        original="Для достижения полного времени наблюдения T = 0,3 с … начиная с T_0 = 1,79 ms требуется 12 итераций. "
        "/ При точности прогноза более чем в 100 раз ниже потенциальной точности … потребовалась последовательность "
        "из 12-ти оптимальных дискриминаторов …",
        reading="twelve windows after the first; the conclusion's sequence of twelve discriminators counts the first "
        "too, and is a reading",
    ),
    _claim(
        4,
        "section 4, conclusion",
        "The last discriminator reaches the potential accuracy",
        *(
            part
            for component in COMPONENTS
            for part in _both(
                f"σ of {component} over the potential one, locked bursts",
                "",
                accuracy_of(component),
                same(1, 0.01, strict=0.1),
            )
        ),
        original="Последний дискриминатор с наиболее узкой дискриминационной характеристикой обеспечивает потенциально "
        "достижимую точность измерения параметров сигнала.",
        reading="of the bursts that lock; P4.5 says how many do",
    ),
    _claim(
        5,
        "section 4, figure 2",
        "In the burst that figure 2 shows every error stays under three potential spreads at every window",
        *_both("share of bursts of which this is true", "", lambda seen, key: seen.always(key), above(0.05)),
        *_both(
            "share of bursts of which this is true, as often as a hand-over is to succeed",
            "",
            lambda seen, key: seen.always(key),
            within(0.99, 1, 0.005),
            asserted=False,
            ceiling=True,
        ),
        *_both(
            "share of bursts locked at the end",
            "",
            lambda seen, key: seen.lock(key, "sequence"),
            within(0.99, 1, 0.005),
            asserted=False,
        ),
        original="Графически это означает, что кривая невязок должна располагаться ниже границы допустимого интервала. "
        "Видно, что это строго соблюдается для всех элементов вектора параметров.",
        reading="one burst is shown; it contradicts the estimator if fewer than one burst in twenty is like it. That "
        "0.99 of all bursts are is not asserted, and an efficient estimator is not so good either: its share is the "
        "ceiling. Spreads with the prior",
    ),
    _claim(
        6,
        "section 3",
        "A narrow discriminator alone loses the signal from such a forecast",
        *_both(
            "share of bursts locked by the whole burst alone",
            "",
            lambda seen, key: seen.lock(key, "narrow"),
            at_most(0.01),
        ),
        original="… узкая дискриминационная характеристика обеспечивает высокую точность измерений, но при этом "
        "повышается вероятность срыва сопровождения.",
        reading="loses: locks less often than the 0.01 that the design allows to be lost",
    ),
    _claim(
        7,
        "section 3",
        "A wide discriminator alone loses the signal less often, and has a lower accuracy",
        *(
            part
            for component in COMPONENTS[:2]
            for part in _both(
                f"σ of {component} of the first window over the potential one of the burst",
                "",
                wide_over_whole(component),
                greater(),
            )
        ),
        *(
            replace(part, statement="lock")
            for part in _both(
                "share of bursts locked by the first window alone less that by the whole burst alone",
                "",
                lambda seen, key: difference(seen.lock(key, "wide"), seen.lock(key, "narrow")),
                above(0, 0.01),
            )
        ),
        original="Для широкой дискриминационной характеристики ситуация меняется на обратную: снижается вероятность "
        "срыва при одновременном снижении точности оценивания.",
    ),
    _claim(
        8,
        "section 3, after (16)",
        "The better the forecast, the nearer the first window is to the whole burst",
        *(
            Part(
                ((SCALE, better), (SCALE, worse)),
                f"first window with the forecast's spread × {better:g} over that with × {worse:g}",
                "",
                growth_of_first_window(SCALE, better, worse),
                greater(),
            )
            for worse, better in ((10, 1), (1, 0.1), (0.1, 0.01), (0.01, 0.001))
        ),
        original="При этом на участке траектории, где объект не совершает маневры и точность прогноза высока, "
        "начальное время T_0 будет выбрано близко к T. На участках интенсивного маневрирования, когда точность "
        "прогноза падает, время T_0 будет уменьшено для предотвращения срыва сопровождения.",
        config=MAPS,
    ),
    _claim(
        9,
        "section 3, before (17)",
        "At a low signal-to-noise ratio noise masks the main peak: the lock is lost unacceptably often",
        Part(
            ((NOISE, 72), (NOISE, 2.25)),
            "lock of the cured sequence where μ(T₀) < 1 less that where μ(T₀) > 20",
            "",
            lambda seen: seen.lock_loss((NOISE, 72), (NOISE, 2.25), "cured"),
            below(0, 0.01),
        ),
        Part(
            ((NOISE, 72),),
            "lock of the cured sequence where μ(T₀) < 1",
            "",
            lambda seen: seen.lock((NOISE, 72), "cured"),
            below(0.99),
        ),
        original="Уменьшение T_0 приводит к сокращению отношения сигнал/помеха μ, а при малых значениях μ выбросы "
        "шумовой составляющей ФП маскируют главный экстремум сигнальной составляющей, недопустимо повышая вероятность "
        "аномальных измерений.",
        reading="the sequence with a search at the hand-overs, which the paper's own losses do not blur",
        config=MAPS,
    ),
    _claim(
        10,
        "section 3, after (16)",
        "The covariance of the forecast must be estimated rightly",
        *(
            Part(
                ((ERROR, factor), (ERROR, 1)),
                f"lock with errors {factor:g} times those believed less that with right ones",
                "",
                loss_of_lock(ERROR, factor, 1),
                below(0, 0.01),
            )
            for factor in (2, 4)
        ),
        original="… ИДРЛС должно адекватно оценивать точность вырабатываемого прогноза θ_пр вектора параметров "
        "маневрирующего объекта, то есть оценивать матрицу R_пр.",
        reading="a forecast worse than believed; one that is better than believed only costs windows",
        config=MAPS,
    ),
    _claim(
        11,
        "section 4",
        "One set of parameters gives all numbers of the experiment: spreads, first and shortest window, 12 iterations",
        *SPREAD_PARTS,
        *FIRST,
        *SHORTEST,
        *WINDOWS,
        original="Для заданных параметров … σ_η² = 9 …",
        reading="the two readings of noise and threshold that are shipped, of which one has to give every number",
        joint=True,
    ),
    _claim(
        12,
        "section 3, (11) and (14)",
        "Windows designed by (14) hand over within the main lobe with a probability of 0.99 each",
        *_both(
            "largest probability of a miss at a hand-over",
            "",
            lambda seen, key: seen.worst_handover(key),
            at_most(0.01),
        ),
        original="Полагая P_Δ = 0,99 и учитывая (12) и (13), (11) запишем в виде tr(R_Δθ·H) + 3·√(2tr([H·R_Δθ]²)) ≤ 1.",
        reading="by the law of the quadratic form itself, a sum of weighted χ²; the last window is the whole burst, "
        "whatever (16) says, and is left out. One c for the design and for the lobe; that the design takes the 0.5 of "
        "(11) and the lobe is that of (10), under 1, is a reading, in which it holds",
    ),
    _claim(
        13,
        "section 4",
        "The first window is longer than the shortest allowed, so the method may be used",
        Part(
            (PRINTED,),
            f"first window less the shortest, at the paper's amplitude 1.17 ({WORDS[PRINTED]})",
            "ms",
            lambda seen: seen.spare_window(PRINTED, ESTIMATE),
            above(0, 0.005),
        ),
        Part(
            (PRINTED,),
            f"first window less the shortest, at the true amplitude 1 ({WORDS[PRINTED]})",
            "ms",
            lambda seen: seen.spare_window(PRINTED, 1.0),
            above(0, 0.005),
            asserted=False,
        ),
        original="Так как T_0 > T_min, то условие применимости предложенного алгоритма выполнено.",
        reading="with its own estimate of the amplitude; that the true one would not do is shown and not counted",
    ),
    _claim(
        14,
        "section 4",
        "The forecast's spreads are 6.1 rad, 67.5 Hz, 6.1·10³ Hz/s, 183.38·10³ Hz/s², 2.426·10⁶ Hz/s³: 100, 150, 500, "
        "1000, 2000 times the potential ones",
        *(
            Part(
                (PRINTED,),
                f"printed potential spread of {component} times its factor",
                SPREADS[component][1],
                _known(forecast_spread(component)),
                on_grid(value, value, half, strict=(value - half, value + half)),
            )
            for component, (value, half) in PRINTED_FORECAST.items()
        ),
        original="Пусть элементы вектора прогноза θ_пр некоррелированы и их СКО в 100, 150, 500, 1000 и 2000 раз выше "
        "потенциальных СКО … √diag(R_пр) = (6,1; 67,5 Гц; 6,1·10³ Гц²; 183,38·10³ Гц³; 2,426·10⁶ Гц⁴).",
        reading="algebra of printed numbers",
        internal=True,
    ),
    _claim(
        15,
        "section 4",
        "The Doppler derivatives 10 kHz, 180 kHz/s, −750 kHz/s², 1000 kHz/s³ are those of a radial speed of 0, 350, "
        "450, 475 m/s at 0, 0.1, 0.2, 0.3 s",
        *(
            Part(
                (PRINTED,),
                f"Doppler frequency of the printed derivatives at {t:g} s",
                "kHz",
                _known(doppler_of_polynomial(t)),
                about(f"{doppler_of_speed(t):.4g}", margin=max(0.1 * doppler_of_speed(t), 1.0)),
            )
            for t in SPEEDS
        ),
        original="… радиальная скорость меняется соответственно от 0 до 350 м/c, далее от 350 м/c до 450 м/c и от 450 "
        "м/c до 475 м/c. … Пересчитывая мгновенную радиальную скорость в доплеровскую частоту и аппроксимируя ее … "
        "полиномом второго порядка, получим, что f_0 = 10·10³ Гц, f_1 ≈ 180·10³ Гц², f_2 ≈ −750·10³ Гц³, "
        "f_3 ≈ 1000·10³ Гц⁴.",
        reading="2v/λ at the ends of the stated intervals; approximate: 10 %, and 1 kHz where the speed is nil. If the "
        "10 kHz are the offset to which the receiver moves the signal, it fails at the other three by 7 to 9 kHz. A "
        "polynomial of the second order has no f₃ at all; the printed one is taken as it stands",
        internal=True,
    ),
    _claim(
        16,
        "section 3, after (6)",
        "The closed form of the Fisher matrix approximates that of the burst",
        *(
            Part(
                (PRINTED,),
                f"potential spread of {component} by the closed form over the sum over the pulses",
                "",
                closed_over_sum(component),
                same(1, 0.01),
            )
            for component in COMPONENTS
        ),
        original="Для рассматриваемого сигнала в виде когерентной пачки импульсов … можно получить следующие "
        "приближенные выражения: Φ_1,1 = 2μ; …",
        reading="approximates: spreads within 1 %",
    ),
    _claim(
        17,
        "section 4",
        "The amplitude estimated by (7) from the simulated burst is 1.17",
        *(
            replace(part, number="amplitude", variant=part.cases[0], against_print=part.cases[0] == COMPUTED)
            for part in _both(
                "share of bursts whose (7) lies as far from its mean",
                "",
                lambda seen, key: certain(seen.as_far(key, ESTIMATE)),
                above(0.05),
            )
        ),
        *_both(
            "the same, were 1.17 the root of (7)",
            "",
            lambda seen, key: certain(seen.as_far(key, ESTIMATE**2)),
            above(0.05),
            asserted=False,
        ),
        original="На первом этапе оценивается амплитуда сигнала по выражению (7): Â = 1,17.",
        reading="one burst: it contradicts the parameters if fewer than one in twenty is as far from A = 1. (7) as "
        "printed gives the square; of the samples within pulses",
    ),
    _claim(
        18,
        "section 3, after (9)",
        "From its maximum to the mean level of its side lobes the log-likelihood falls by about 2μ",
        Part(
            (PRINTED,),
            "fall of ln L over 2μ, of the burst's own samples",
            "",
            lambda seen: seen.span(PRINTED),
            about("1"),
        ),
        original="Размах функции ln L(u(T)/θ) от ее максимального значения до среднего уровня боковых лепестков "
        "приближенно равен 2μ [6].",
        reading="of the signal without noise, which adds 5/2 to 2μ = 1667 on the mean; quoted from a book",
    ),
    _claim(
        19,
        "conclusions",
        "The sequence works from a poor forecast, and so keeps a track that a narrow discriminator loses",
        *(
            replace(part, statement="keeps")
            for part in _both(
                "share of bursts locked by the sequence less that by the whole burst alone",
                "",
                lambda seen, key: difference(seen.lock(key, "sequence"), seen.lock(key, "narrow")),
                above(0, 0.01),
            )
        ),
        *(
            replace(part, statement="works")
            for part in _both(
                "share of bursts locked by the sequence over what its design allows",
                "",
                lambda seen, key: seen.robust(key),
                at_least(1, 0.01),
            )
        ),
        original="Его основным достоинством является способность функционировать при низкой точности вектора "
        "начального приближения (вектора прогноза). Это позволяет не допустить срыв сопровождения при выполнении "
        "сопровождаемым объектом маневра, когда точность прогноза резко падает.",
        reading="of the experiment's forecast, a hundred to two thousand times worse than the potential accuracy; the "
        "design allows each hand-over to fail once in a hundred, of K windows 1 − 0.99^K",
    ),
    _claim(
        20,
        "section 3, step 1",
        "After the first window no search over the initial phase is needed",
        *(
            replace(part, statement="then")
            for part in _both(
                "largest probability at a hand-over that the start's phase is over a quarter of a turn off the best",
                "",
                lambda seen, key: seen.phase_lost(key)[1],
                at_most(0.01),
            )
        ),
        *(
            replace(part, statement="first")
            for part in _both(
                "the same at the first window, by the forecast",
                "",
                lambda seen, key: seen.phase_lost(key)[0],
                above(0.01),
            )
        ),
        *_both(
            "share of bursts locked that a search along the widest direction of the error adds",
            "",
            lambda seen, key: difference(seen.lock(key, "cured"), seen.lock(key, "sequence")),
            same(0, 0.01),
            asserted=False,
        ),
        original="Так как прогноз θ_пр не содержит оценки начальной фазы, то на первом этапе нужно дополнительно "
        "выполнить поиск по начальной фазе. … В дальнейшем поиск по начальной фазе выполнять не требуется.",
        reading="needed where, all else as the start has it, the best phase is over a quarter of a turn away, from "
        "where scoring does not find it, with more than the 0.01 of a miss. A search over all five parameters, along "
        "the direction in which the start is worst known, does keep locks: shown and not counted",
    ),
)
