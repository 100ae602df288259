"""P3.8 … P3.10: what Butyrskiy says of detecting manoeuvres, from his words alone, before anything was measured.

He prints an inequality of two known variances and no experiment. Read as the rule behind it: a manoeuvre is declared
where the squared acceleration of a parabola through n plots exceeds k times its own variance.
"""

from radarsim.report.claims import Claim, Part, about, at_most, greater, kept, less
from radarsim.studies.sonar.manoeuvre import measures as measured

CONFIG = "sonar_manoeuvre"
EXTREMES = (measured.WEAK, measured.STRONG)

CLAIMS = (
    Claim(
        "P3.8",
        "principle of optimal construction, after (3)",
        "With more plots n the threshold falls and the detector grows more sensitive, but the time to see a "
        "manoeuvre's beginning and end grows too; n above 4–5 is not worth while",
        (
            *(
                Part(
                    (measured.STRONG,),
                    f"acceleration at the threshold, {more} plots over {few}, at 0.01 false alarms a test",
                    "",
                    measured.thresholds_ratio(more, few),
                    less(),
                    statement="threshold",
                )
                for few, more in ((4, 5), (5, 8))
            ),
            *(
                Part(
                    (case,),
                    f"mean time to see beginning and end of the {case} at k = 1, 8 plots over 5",
                    "",
                    measured.delays_ratio(case, 8, 5, measured.both_ends, measured.AT_ONE),
                    greater(),
                    statement="time",
                )
                for case in EXTREMES
            ),
            *(
                Part(
                    (case,),
                    f"mean time to see beginning and end of the {case} at k = 1, over 5 plots against the best of 4–5",
                    "%",
                    measured.further(case, measured.ENOUGH, measured.both_ends, measured.AT_ONE),
                    kept(),
                    statement="not worth while",
                )
                for case in EXTREMES
            ),
            *(
                Part(
                    (case,),
                    f"plots of the least mean time to see {words} of the {case}, at 0.01 false alarms a test",
                    "plots",
                    measured.fastest(case, delay, measured.USUAL),
                    at_most(5),
                    asserted=False,
                )
                for delay, words in ((measured.mean_delay, "the beginning"), (measured.both_ends, "beginning and end"))
                for case in EXTREMES
            ),
        ),
        "the sentence before asks for beginning and end, and its 0.68 belongs to k = 1; a time is counted at the end "
        "of the manoeuvre, or of the run, where no alarm came, or no all-clear; the weakest and the strongest shipped "
        "manoeuvre. Not worth while: with more plots not 1 % sooner than with the best of 4–5; that they tie, as in "
        "the weakest manoeuvre, is what these words say. The beginning alone, and at a fixed rate of false alarms, is "
        "shown and not counted",
        CONFIG,
        original="В процессе сопровождения реальной цели необходимо иметь возможность обнаруживать начало и конец "
        "маневра … С увеличением n порог уменьшается, что способствует повышению чувствительности алгоритма (3). "
        "Однако одновременно увеличивается время выявления маневра. Поэтому брать n больше 4-5 нецелесообразно.",
    ),
    Claim(
        "P3.9",
        "principle of optimal construction, before (3)",
        "A manoeuvre in a coordinate is detected with a probability of about 0.68",
        (
            Part(
                (measured.EQUAL,),
                "alarms a test at k = 1, five plots, acceleration as large as its own spread",
                "",
                measured.detected_at_one,
                about("0.68"),
                exact=measured.exactly_detected_at_one,
            ),
        ),
        "shown: k = 1 and an acceleration of one σ_a, which is where its threshold then lies. 0.683 is the probability "
        "of no alarm without a manoeuvre; as often are 1.456 σ_a detected",
        CONFIG,
        original="С вероятностью, примерно равной 0,68, маневр по координате может быть обнаружен путем сравнения "
        "дисперсии оценки ускорения по данной координате с дисперсией оценки координаты.",
        unstated="the paper names no manoeuvre, and the probability may be any from 0.32 to 1 with its strength",
    ),
    Claim(
        "P3.10",
        "principle of optimal construction, before (3)",
        "To choose the degree rightly the beginning and the end of a manoeuvre have to be detected: switching pays",
        tuple(
            Part(
                (case,),
                f"σ of the range over the run in the {case}, degree {degree} held over degree switched by five plots",
                "",
                measured.degrees_ratio(case, degree),
                greater(),
            )
            for case in EXTREMES
            for degree in (1, 2)
        ),
        "growing memory; σ is the root of its mean square over all scans from the detector's first test on; 0.01 false "
        "alarms a test; the weakest and the strongest shipped manoeuvre",
        CONFIG,
        original="В процессе сопровождения реальной цели необходимо иметь возможность обнаруживать начало и конец "
        "маневра, с тем, чтобы правильно выбрать количество уравнений в системе (2).",
    ),
)
