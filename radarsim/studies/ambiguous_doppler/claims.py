"""What the wish that ends P1 promises, as extensions: written down before anything was measured.

"For filtering the radial range with the Doppler frequency use multi-hypothesis filters with a memory of hypotheses from
scan to scan … filters of order zero as well as one and two … combined by the total errors at that step."
"""

from radarsim.report.claims import Claim, Part, above, at_most, less
from radarsim.studies.ambiguous_doppler import measures

CONCLUSION = "last sentences"
WISH = (
    "для фильтрации радиальной дальности с использованием частоты Доплера следует использовать многогипотезные "
    "фильтры, с межобзорной памятью гипотез, для различных моделей движения с учетом и без учета F"
)
ORDERS = (
    "Необходимо рассматривать фильтры как нулевого, так и первого–второго порядков. Но использовать их оценки "
    "необходимо, комбинируя различные фильтры в зависимости от суммарных ошибок фильтрации на данном шаге"
)
THROUGH = "orders target=acceleration_pulse"  # the case of the manoeuvre
RADARS = {2: "decimetre", 3: "decimetre", 4: "centimetre", 5: "centimetre"}


def _claim(number: int, statement: str, *parts: Part, reading: str, config: str, original: str) -> Claim:
    return Claim(f"P1.E{number}", CONCLUSION, statement, parts, reading, config, original, extension=True)


def _radar(number: int) -> str:
    return f"ambiguous_rls{number}"


CLAIMS = (
    _claim(
        1,
        "Memory pays: with hypotheses kept from scan to scan folded velocity lowers the error of velocity",
        *(
            Part(
                (_radar(n),),
                f"gain of velocity at scan {measures.AT}",
                "%",
                measures.gain(_radar(n), "memory"),
                above(0),
            )
            for n in RADARS
        ),
        reading="against range alone, at 1 kHz, of the mean over the kept hypotheses",
        config="ambiguous",
        original=WISH,
    ),
    _claim(
        2,
        "Without memory folded velocity is worth nothing: it lowers no error of velocity",
        *(
            Part(
                (_radar(n),),
                f"gain of velocity at {words}: {name}",
                "%",
                measures.gain(_radar(n), name, at),
                at_most(0, 1),
                statement=name,
            )
            for name in ("nearest fold", "no memory")
            for n in RADARS
            for at, words in ((measures.AT, f"scan {measures.AT}"), (None, "the last scan"))
        ),
        reading="against range alone, both ways to have no memory: the nearest fold, and hypotheses merged at each "
        "scan. Either is right in fewer than half of the realisations, and merging pays all the same: little at first, "
        "a sixth to a half of σ by 140 s",
        config="ambiguous",
        original=WISH,
    ),
    _claim(
        3,
        "Centimetre radars reach the error of unfolded velocity",
        *(
            Part(
                (_radar(n),),
                "σ of velocity above that of unfolded velocity at the last scan",
                "%",
                measures.above_at_the_end(_radar(n), "memory"),
                at_most(5),
            )
            for n, band in RADARS.items()
            if band == "centimetre"
        ),
        reading="within 5 %",
        config="ambiguous",
        original=WISH,
    ),
    *(
        _claim(
            number,
            f"Orders pay: combined by {words} they lower the largest error of range through a manoeuvre",
            *(
                Part(
                    (THROUGH,),
                    f"largest σ of range: {name} over {single}",
                    "",
                    measures.worst_to_worst(THROUGH, name, single),
                    less(),
                )
                for single in ("order 0", "order 1", "order 2")
            ),
            reading="largest over the scans, against every single order with the same velocity",
            config="orders",
            original=ORDERS,
        )
        for number, name, words in (
            (4, "expected error", "the expected total error"),
            (5, "likelihood", "likelihood"),
            (6, "intersection", "intersecting intervals"),
        )
    ),
)
