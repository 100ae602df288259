"""P2.1 … P2.13: what Sychev & Osipov (2023) say, read from their words alone.

Places are the sections of the article (Trudy MAI, 2023, no. 129). The paper's trajectory is lost: claims on it are
judged on the shipped `aeroballistic`, which was chosen before any filter ran on it; where a claim speaks of flights
in general it is judged once more, with the letter t, on the other four. "The same" is read as within 0.5 %. Where
the words name no stage and no component, all stages count, in height and rate of climb.
"""

from radarsim.report.claims import Claim, Part, above, at_least, at_most, below, certain, same, within
from radarsim.studies.multimodel.measures import (
    AEROBALLISTIC,
    BANK_122,
    COMPONENTS,
    MMA2_11,
    MMA2_122,
    RIVALS,
    Evidence,
    cost_part,
    gain_part,
    largest_fault_of_powers,
    lead_part,
    probability_part,
    rival_parts,
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
FLIGHTS = {
    "aeroballistic_gentle": AEROBALLISTIC,
    "ballistic": ("start", "ballistic"),
    "airliner": ("start", "steady"),
    "weaving": ("start", "steady", "manoeuvre", "after"),
}


def _claim(number: str, place: str, statement: str, *parts: Part, reading: str = "", config: str = "multimodel"):
    return Claim(f"P2.{number}", place, statement, parts, reading, config)


def _key(flight: str) -> tuple:
    return (flight, 0.05, SIX)


def _powers(tenfold: bool):
    return lambda seen: certain(largest_fault_of_powers(seen, PAPER, tenfold))


CLAIMS = (
    _claim(
        "1",
        "part 7, figures 5 and 6",
        "MMA2-122 shows the best results at all stages of tracking, in height and rate of climb",
        *rival_parts(PAPER, AEROBALLISTIC, above(0)),
        reading="of the six algorithms the least σ over each stage; paired with the best of the other five there",
    ),
    _claim(
        "1t",
        "part 7, figures 5 and 6",
        "MMA2-122 shows the best results at all stages of tracking: on four other flights",
        *(part for flight, stages in FLIGHTS.items() for part in rival_parts(_key(flight), stages, above(0))),
        config="multimodel_trajectories",
    ),
    _claim(
        "2",
        "part 7, figure 7",
        "On the ballistic part the weak uniform-acceleration model is the main one",
        lead_part(PAPER, MMA2_122, "ballistic", 1, above(0)),
        reading="its mean probability over the stage is the largest of the three",
    ),
    _claim(
        "2t",
        "part 7, figure 7",
        "On the ballistic part the weak uniform-acceleration model is the main one: on two other flights",
        lead_part(_key("aeroballistic_gentle"), MMA2_122, "ballistic", 1, above(0)),
        lead_part(_key("ballistic"), MMA2_122, "ballistic", 1, above(0)),
        config="multimodel_trajectories",
    ),
    _claim(
        "3",
        "part 7, figure 7",
        "Under intense manoeuvre the strong uniform-acceleration model takes the initiative",
        lead_part(PAPER, MMA2_122, "manoeuvre", 2, above(0)),
        reading="its mean probability over the stage is the largest of the three",
    ),
    _claim(
        "3t",
        "part 7, figure 7",
        "Under manoeuvre the strong uniform-acceleration model takes the initiative: on two gentler flights",
        lead_part(_key("aeroballistic_gentle"), MMA2_122, "manoeuvre", 2, above(0)),
        lead_part(_key("weaving"), MMA2_122, "manoeuvre", 2, above(0)),
        config="multimodel_trajectories",
    ),
    _claim(
        "4",
        "part 7, after figure 7's discussion",
        "For aerodynamic targets without manoeuvre the weak uniform-motion model becomes the main one",
        lead_part(_key("airliner"), MMA2_122, "steady", 0, above(0)),
        reading="its mean probability is the largest of the three, once the track has settled",
        config="multimodel_trajectories",
    ),
    _claim(
        "5",
        "part 7, after figure 7's discussion",
        "In MMA2-11 the weak model takes practically no part on this trajectory",
        probability_part(PAPER, MMA2_11, "whole", 0, below(0.1)),
        reading="its mean probability over the whole flight is under a tenth",
    ),
    _claim(
        "6",
        "part 7",
        "At 20 Hz combined and modified combined coincide; at 1 Hz the modified rule gains a little under manoeuvre",
        *(
            gain_part(
                FAST, RULES["modified_combined"], RULES["combined"], stage, c, SAME, "modified over combined, 20 Hz"
            )
            for stage in AEROBALLISTIC
            for c in COMPONENTS
        ),
        *(
            gain_part(SLOW, RULES["modified_combined"], RULES["combined"], "manoeuvre", c, above(0), "modified, 1 Hz")
            for c in COMPONENTS
        ),
        *(
            gain_part(SLOW, RULES["modified_combined"], RULES["combined"], stage, c, SAME, "modified, 1 Hz")
            for stage in ("start", "ballistic", "after")
            for c in COMPONENTS
        ),
        reading="coincide: within 0.5 %, at 1 Hz in all stages but the manoeuvre; a little: more than nothing",
        config="multimodel_rules",
    ),
    _claim(
        "7",
        "part 1",
        "MMA3 is the most accurate; MMA2 loses at most 5 % to it, at a much lower cost",
        *(
            gain_part(key, RULES["combined"], MMA3, stage, c, FEW_PERCENT, f"MMA2 over MMA3, {rate}")
            for key, rate in ((FAST, "20 Hz"), (SLOW, "1 Hz"))
            for stage in AEROBALLISTIC
            for c in COMPONENTS
        ),
        *(
            gain_part(key, other, MMA3, stage, c, at_most(0), f"{name} over MMA3, {rate}")
            for key, rate in ((FAST, "20 Hz"), (SLOW, "1 Hz"))
            for other, name in ((RULES["combined"], "MMA2"), (MMA1, "MMA1"))
            for stage in AEROBALLISTIC
            for c in COMPONENTS
        ),
        cost_part(FAST, RULES["combined"], MMA3, below(0.5), "MMA2 / MMA3, 20 Hz"),
        cost_part(SLOW, RULES["combined"], MMA3, below(0.5), "MMA2 / MMA3, 1 Hz"),
        reading="all with the combined rule; a gain of -5 % is a loss of 5 %; much lower: less than half",
        config="multimodel_rules",
    ),
    _claim(
        "8",
        "part 3",
        "The combined rule gives the best accuracy: better than both pure rules",
        *(
            gain_part(FAST, RULES["combined"], RULES[pure], stage, c, above(0), f"combined over {pure}, 20 Hz")
            for pure in ("moment", "best")
            for stage in AEROBALLISTIC
            for c in COMPONENTS
        ),
        reading="MMA2 at 20 Hz",
        config="multimodel_rules",
    ),
    _claim(
        "9",
        "part 3",
        "Moment merging makes a filter more responsive; merging by the best smooths better in steady motion",
        gain_part(FAST, RULES["moment"], RULES["best"], "manoeuvre", "y", above(0), "moment over best, 20 Hz"),
        gain_part(FAST, RULES["best"], RULES["moment"], "ballistic", "y", above(0), "best over moment, 20 Hz"),
        reading="MMA2: less σ of the height under manoeuvre, and on the ballistic part",
        config="multimodel_rules",
    ),
    _claim(
        "10",
        "parts 3 and 7",
        "The modified rule lowers the cost and keeps the accuracy",
        cost_part(FAST, RULES["modified_combined"], RULES["combined"], below(1), "modified / combined, 20 Hz"),
        cost_part(SLOW, RULES["modified_combined"], RULES["combined"], below(1), "modified / combined, 1 Hz"),
        *(
            gain_part(key, RULES["modified_combined"], RULES["combined"], stage, c, above(-0.5), f"modified, {rate}")
            for key, rate in ((FAST, "20 Hz"), (SLOW, "1 Hz"))
            for stage in AEROBALLISTIC
            for c in COMPONENTS
        ),
        reading="operations counted over the whole flight; accuracy kept: no loss of 0.5 %",
        config="multimodel_rules",
    ),
    _claim(
        "11",
        "part 4, eq. (8)",
        "P(Δt) tends to the unit matrix as Δt → 0, and P(nΔt) is the n-th power of P(Δt)",
        Part((PAPER,), "largest element of P(50 ns) − I", "", _powers(tenfold=False), below(1e-6)),
        Part((PAPER,), "largest element of P(0.5 s) − P(50 ms)¹⁰", "", _powers(tenfold=True), below(1e-12)),
        reading="algebra of the matrices in use",
    ),
    _claim(
        "12",
        "part 4",
        "The transition matrix has little influence on the characteristics (quoted from the literature)",
        *(
            gain_part(MATRICES, other, MMA2_122, stage, c, within(-10, 10), f"changes {words} over as printed")
            for other, words in ((RARE, "ten times rarer"), (OFTEN, "ten times as frequent"))
            for stage in AEROBALLISTIC
            for c in COMPONENTS
        ),
        reading="little: σ changes by under 10 % when models change ten times less or more often",
        config="multimodel_transition",
    ),
    _claim(
        "13",
        "part 6",
        "Good banks hold weak models and at least one strong one",
        gain_part(BANKS, MMA2_122, STRONG, "ballistic", "y", above(0), "weak and strong over strong alone"),
        gain_part(BANKS, MMA2_122, WEAK, "manoeuvre", "y", above(0), "weak and strong over weak alone"),
        reading="better than strong models alone where nothing manoeuvres, than weak ones alone where something does",
        config="multimodel_banks",
    ),
)
