"""P3.8 … P3.10: what Butyrskiy says of detecting manoeuvres, from his words alone, before anything was measured.

He prints an inequality of two known variances and no experiment. Read as the rule behind it: a manoeuvre is declared
where the squared acceleration of a parabola through n plots exceeds k times its own variance.
"""

from radarsim.report.claims import Claim, Part, about, above, at_most, below
from radarsim.studies.sonar.manoeuvre import measures as measured

CONFIG = "sonar_manoeuvre"
EXTREMES = (measured.WEAK, measured.STRONG)

CLAIMS = (
    Claim(
        "P3.8",
        "principle of optimal construction, after (3)",
        "With more plots n the threshold falls and the detector grows more sensitive, but the time to detect grows "
        "too; n above 4–5 is not worth while",
        (
            *(
                Part(
                    (measured.STRONG,),
                    f"acceleration at the threshold, {more} plots over {few}, at 0.01 false alarms a test",
                    "",
                    measured.thresholds_ratio(more, few),
                    below(1),
                )
                for few, more in ((4, 5), (5, 8))
            ),
            *(
                Part(
                    (case,),
                    f"mean time to an alarm in the {case}, 8 plots over 5",
                    "",
                    measured.delays_ratio(case, 8, 5),
                    above(1),
                )
                for case in EXTREMES
            ),
            *(
                Part(
                    (case,),
                    f"plots of the least mean time to an alarm in the {case}",
                    "plots",
                    measured.fastest(case),
                    at_most(5),
                )
                for case in EXTREMES
            ),
        ),
        "at one rate of false alarms, 0.01 a test; a time is counted at the end of the manoeuvre where no alarm came; "
        "the weakest and the strongest shipped manoeuvre",
        CONFIG,
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
            ),
        ),
        "the paper names no manoeuvre; taken: k = 1 and an acceleration of one σ_a, which is where its threshold then "
        "lies. 0.683 is the probability of no alarm without a manoeuvre; as often are 1.456 σ_a detected",
        CONFIG,
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
                above(1),
            )
            for case in EXTREMES
            for degree in (1, 2)
        ),
        "growing memory; σ is the root of its mean square over all scans from the detector's first test on; 0.01 false "
        "alarms a test; the weakest and the strongest shipped manoeuvre",
        CONFIG,
    ),
)
