"""P1.1 … P1.25: what Gorshkov & Zavizhenets (2017) say, read from their words alone, before anything was measured.

Places are the sections of the article (Doklady BGUIR 2017, no. 4, pp. 19–26): "figures" is the text around figures
1 to 3, "conclusion" the last section. "At the end" is the last of the paper's fifteen points, 140 s; only steady errors
and settling (P1.14, P1.15) look at the whole run.
"""

from radarsim.report.claims import Claim, Part, about, above, at_most, below, between, printed, within
from radarsim.studies.range_doppler import measures as measured
from radarsim.studies.range_doppler.measures import RADARS, RV, Evidence, R, faster_part, gain_part

__all__ = ["CLAIMS", "Evidence"]

PAIRS = ((2, 3), (4, 5))  # radars that differ only in their period: slow, fast
UNITS = {"r": "m", "Vr": "m/s", "ar": "m/s²"}
BOTH = ((R, "range only"), (RV, "range and velocity"))


def _claim(number: int, place: str, statement: str, *parts: Part, reading: str = "", config: str = "range_doppler"):
    return Claim(f"P1.{number}", place, statement, parts, reading, config)


CLAIMS = (
    _claim(
        1,
        "conclusion, metre band",
        "RLS 1: the range gain is only 7–15 %",
        gain_part(1, "r", "least", "least", between("7", "15")),
        gain_part(1, "r", "largest", "largest", between("7", "15")),
        reading="the whole run from k = 2, where the filters first differ",
    ),
    _claim(
        2,
        "conclusion, metre band",
        "RLS 1: the velocity gain lies between 10 and 50 %",
        gain_part(1, "Vr", "least", "least", between("10", "50")),
        gain_part(1, "Vr", "largest", "largest", between("10", "50")),
        reading="the whole run from k = 3, where both filters have a velocity",
    ),
    _claim(
        3,
        "conclusion, metre band",
        "RLS 1: from the 5th scan on the acceleration is less accurate with velocity than without",
        gain_part(1, "ar", "largest", "largest, from the 5th scan on,", below(0), first=5),
        Part((1,), "acceleration gain at the 4th scan", "%", lambda seen: seen.k_gain(1, "ar").at(4), above(0)),
        reading="a loss at every scan k ≥ 5, and not yet at k = 4",
    ),
    _claim(
        4,
        "conclusion, decimetre band; figure 1b",
        "Decimetre radars: the range gain peaks at 45 % (Δt = 5 s) and 35 % (Δt = 10 s), about 20–30 s in",
        gain_part(3, "r", "largest", "largest", printed("45")),
        gain_part(2, "r", "largest", "largest", printed("35")),
        Part(
            (3,),
            "time of the largest range gain",
            "s",
            lambda seen: seen.k_gain(3, "r").when_largest(),
            about("20", "30"),
        ),
        Part(
            (2,),
            "time of the largest range gain",
            "s",
            lambda seen: seen.k_gain(2, "r").when_largest(),
            about("20", "30"),
        ),
    ),
    _claim(
        5,
        "conclusion, decimetre band; figure 1b",
        "Decimetre radars: after its peak the range gain falls to 18 %",
        gain_part(2, "r", "last", "final", printed("18")),
        gain_part(3, "r", "last", "final", printed("18")),
        reading="at the end of the run; a printed number, of both radars",
    ),
    _claim(
        6,
        "conclusion, decimetre band; figure 2b",
        "Decimetre radars: the velocity gain falls from 80–90 % to 25 %",
        gain_part(2, "Vr", "first", "first", between("80", "90")),
        gain_part(3, "Vr", "first", "first", between("80", "90")),
        gain_part(2, "Vr", "last", "final", printed("25")),
        gain_part(3, "Vr", "last", "final", printed("25")),
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
                measured.ineffective_from(n),
                about("90", "100"),
            )
            for n in (2, 3)
        ),
        reading="useless: zero or a loss",
    ),
    _claim(
        8,
        "figures, after figure 1",
        "The range gain exceeds 50 % where C_θ is much larger than one (RLS 4, 5)",
        gain_part(4, "r", "largest", "largest", above(50)),
        gain_part(5, "r", "largest", "largest", above(50)),
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
                lambda seen, n=n: (gain := seen.k_gain(n, "ar")).where(gain.k <= 5).largest(),
                above(80),
            )
            for n in (2, 3, 4, 5)
        ),
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
            faster_part(*pair, "time of the largest range gain, fast : slow", "", measured.peak_times, about("1"))
            for pair in PAIRS
        ),
    ),
    _claim(
        12,
        "figures, after figure 2",
        "As functions of time the velocity gains of radars that differ only in Δt practically coincide",
        *(
            faster_part(
                *pair, "largest distance of the velocity gains, of their height", "%", measured.apart("Vr"), at_most(10)
            )
            for pair in PAIRS
        ),
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
                lambda seen, n=n: seen.sigma(n, RV, "Vr").at(1),
                printed(f"{row[1]}"),
            )
            for n, row in RADARS.items()
        ),
        *(
            faster_part(
                *pair,
                "first σ of velocity, range only, fast − slow",
                "m/s",
                measured.sigma_change(R, "Vr", "first"),
                above(0),
            )
            for pair in PAIRS
        ),
        reading="that of the plot: rounds to the table's number",
    ),
    _claim(
        14,
        "figures, before figure 1",
        "From the 4th scan the range error falls to a steady value; D_M is good when it settles in under 10 Δt",
        *(
            Part(
                (2,),
                f"σ of range at the end against the 4th scan, {words}",
                "%",
                lambda seen, observes=observes: measured.final_to_fourth(seen, observes),
                below(100),
            )
            for observes, words in BOTH
        ),
        *(
            Part((n,), "settling of σ of range, range only", "Δt", lambda seen, n=n: seen.settling(n, R), below(10))
            for n in RADARS
        ),
        reading="the paper's own D_M = 10⁻³ passes its rule for each of its radars; settled: within 5 % of the steady "
        "value, for good (the paper gives no tolerance)",
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
                measured.by_variance(
                    n, lambda seen, key, observes=observes: seen.whole_sigma(key, observes, "r").last()
                ),
                below(0),
            )
            for n in RADARS
            for observes, words in BOTH
        ),
        *(
            Part(
                (n,),
                f"settling of σ of range, least D_M − greatest, {words}",
                "Δt",
                measured.by_variance(n, lambda seen, key, observes=observes: seen.settling(key, observes)),
                above(0),
            )
            for n in RADARS
            for observes, words in BOTH
        ),
        reading="said of the filter, so of each radar: the least against the greatest D_M of the sweep",
    ),
    _claim(
        16,
        "conclusion, ambiguity",
        "A Doppler of 300 m/s at 1 kHz repetition is F/3, 4F and 20F in the three bands",
        Part((1,), "Doppler frequency in repetition rates", "", measured.doppler(1), printed("0.33")),
        Part((2,), "Doppler frequency in repetition rates", "", measured.doppler(2), printed("4")),
        Part((4,), "Doppler frequency in repetition rates", "", measured.doppler(4), printed("20")),
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
        reading="the range gain; its largest value and the scan of it",
    ),
    _claim(
        18,
        "figures, before figure 1",
        "RLS 2: the difference Δσ_r(k) = σ_r(r) − σ_r(r,V) grows and stabilises",
        Part((2,), "Δσ of range at the end, of its largest value", "%", measured.final_share, within(90, 100)),
        reading="what grows and stabilises ends at its largest value, to 10 %",
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
                below(0),
            )
            for observes, words in BOTH
            for pair in PAIRS
        ),
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
                above(0),
            )
            for observes, words in BOTH
            for pair in PAIRS
        ),
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
                at_most(10),
            )
            for pair in PAIRS
        ),
        reading="as for the velocity gains",
    ),
    _claim(
        23,
        "figures, after figure 3",
        "RLS 2: the acceleration is a loss only on a short stretch; afterwards the gain is small or none",
        Part((2,), "scans with a loss in acceleration", "scans", measured.loss_scans, within(1, 3)),
        Part((2,), "largest acceleration gain after the first loss", "%", measured.after_loss, at_most(10)),
        reading="short: at least one scan and at most a quarter of the thirteen; small: at most 10 %",
    ),
    _claim(
        24,
        "figures, after figure 2",
        "The velocity gain falls, with transients in RLS 1",
        *(Part((n,), "velocity gain, end − first", "points", measured.fall(n), below(0)) for n in RADARS),
        Part((1,), "largest rise of the velocity gain over an earlier scan", "points", measured.rise(1), above(0)),
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
    ),
)
