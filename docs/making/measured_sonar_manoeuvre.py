"""Numbers of docs/sonar_manoeuvre.md."""

import math
from collections.abc import Callable

import numpy as np
from scipy.stats import binom

from making.numbers import Results, with_bounds
from making.pick import part, rows, value

STEM = "sonar_manoeuvre"
ACCELERATIONS = (0, 0.1, 0.2138, 0.4, 0.8)
PLOTS = (4, 5, 6, 8, 10)
END_S, LEG_S = 140, 40
FILTERS = {
    "growing": "growing memory, degree 1",
    "growing 2": "growing memory, degree 2",
    "window 5": "window of 5, degree 1",
    "window 8 deg 2": "window of 8, degree 2",
    "kalman": "Kalman, (0.2 m/s²)²",
    "degree by 5": "degree switched by 5 plots",
    "degree by 8": "degree switched by 8 plots",
    "memory by 5": "memory held short by 5 plots",
    "imm": "IMM, (0.005 m/s²)² and (0.4 m/s²)²",
}
HEADS = ("acceleration, m/s²", *(f"{acceleration:g}" for acceleration in ACCELERATIONS))


def own(results: Results, name: str, acceleration: float, plots: int, **wanted):
    """Rows of the range at 0.01 false alarms a test."""
    case = f"acceleration_mps2={acceleration:g}"
    table = rows(results, STEM, name, case=case, filter=f"{plots} plots", component="r", **wanted)
    return table[(table["false_alarm_probability"] - 0.01).abs() < 1e-6]


def alarms(results: Results) -> list[tuple]:
    """Alarms a test at the end of the manoeuvre, with the exact probability below."""
    made: list[tuple] = [HEADS]
    for plots in PLOTS:
        found = [own(results, "detections", one, plots, t_s=END_S).iloc[0] for one in ACCELERATIONS]
        made.append((f"{plots} plots", *(f"{row['probability']:.3f}" for row in found)))
        made.append(("exact", *(f"{row['exact']:.3f}" for row in found)))
    return made


def widest(results: Results) -> str:
    """The largest half-width of an interval in that table."""
    found = [own(results, "detections", one, plots, t_s=END_S).iloc[0] for plots in PLOTS for one in ACCELERATIONS]
    return f"{max((row['hi'] - row['lo']) / 2 for row in found):.4f}"


def times(event: str) -> Callable[[Results], list[tuple]]:
    """Mean time to an event, s; the end of the last scan looked at is counted where it does not come."""

    def made(results: Results) -> list[tuple]:
        filled: list[tuple] = [("acceleration, m/s²", *HEADS[2:])]
        for plots in PLOTS:
            found = (own(results, "delays", one, plots, event=event) for one in ACCELERATIONS[1:])
            filled.append((f"{plots} plots", *map(mean_time, found)))
        return filled

    return made


def mean_time(delays) -> str:
    """Mean of the time to an event with its interval, from the probability that it has come by each scan."""
    at = delays["delay_s"].to_numpy()
    shares = np.diff(delays["probability"].to_numpy(), prepend=0.0)
    shares[-1] += 1 - shares.sum()
    mean = shares @ at
    half = 1.96 * math.sqrt(shares @ (at - mean) ** 2 / delays["n"].iloc[0])
    return with_bounds(mean, mean - half, mean + half)


def classes(results: Results) -> list[tuple]:
    """How often a leg is called what it is not."""
    made: list[tuple] = [("wrongly called", *HEADS[1:])]
    for plots in (5, 8, 10):
        steady = own(results, "classes", 0, plots, truth="steady").iloc[-1]
        made.append((f"manoeuvring over 220 steady s, {plots} plots", f"{steady['error_probability']:.3f}", *[""] * 4))
    for plots in (5, 8, 10):
        found = (own(results, "classes", one, plots, truth="manoeuvre").iloc[0] for one in ACCELERATIONS[1:])
        cells = (f"{row['error_probability']:.3f}" for row in found)
        made.append((f"steady over the manoeuvre, {plots} plots", "", *cells))
    return made


def over_the_run(results: Results, name: str, acceleration: float) -> float:
    """σ of the range of a filter, the root of its mean square from the 5th scan on, m."""
    wanted = {"case": f"acceleration_mps2={acceleration:g}", "filter": name, "component": "r"}
    curve = rows(results, STEM, "curves", **wanted)
    return math.sqrt((curve[curve["k"] >= 5]["sigma"] ** 2).mean())


def courses(results: Results) -> list[tuple]:
    """σ of the range over the run, each filter in each manoeuvre."""
    made: list[tuple] = [HEADS]
    for name, words in FILTERS.items():
        made.append((words, *(figures(over_the_run(results, name, one)) for one in ACCELERATIONS)))
    return made


def figures(number: float) -> str:
    """A number to three figures, its zeros kept."""
    return f"{number:#.3g}".rstrip(".")


def premium(over: str) -> Callable[[Results], str]:
    """By how much σ of a filter on the steady leg lies over that of the degree switched by eight plots."""

    def made(results: Results) -> str:
        return f"{100 * (over_the_run(results, over, 0) / over_the_run(results, 'degree by 8', 0) - 1):.0f} %"

    return made


def use(name: str, component: str) -> Callable[[Results], str]:
    """Measured over believed σ of a use of the track after 220 steady seconds."""
    wanted = {"case": "acceleration_mps2=0", "filter": name, "component": component, "t_s": 220}
    return value(STEM, "uses", "ratio", **wanted)


def beyond(results: Results) -> str:
    """How many rates lie outside the binomial 99.99 % bounds of their exact law, of how many."""
    table = results.table(STEM, "detections").dropna(subset="exact")
    count = (table["probability"] * table["n"]).round()
    low, high = (binom.ppf(tail, table["n"], table["exact"]) for tail in (0.5e-4, 1 - 0.5e-4))
    outside = int(((count < low) | (count > high)).sum())
    return f"Of {len(table)} rates {outside} outside, {len(table) * 1e-4:.1f} to be expected"


def turn(plots: int) -> Callable[[Results], str]:
    """Alarms a test in range at the end of a turn of 2°/s."""

    def made(results: Results) -> str:
        case = "rate_radps=0.03491 frame=polar"
        wanted = {"case": case, "filter": f"{plots} plots", "component": "r", "t_s": END_S}
        table = rows(results, "sonar_manoeuvre_turning", "detections", **wanted)
        row = table[(table["false_alarm_probability"] - 0.01).abs() < 1e-6].iloc[0]
        return with_bounds(row["probability"], row["lo"], row["hi"])

    return made


def threshold(more: int, few: int) -> Callable[[Results], str]:
    """The threshold's fall from few plots to more (P3.8)."""
    what = f"acceleration at the threshold, {more} plots over {few}, at 0.01 false alarms a test"
    return part(STEM, "P3.8", what, "")


def switched(case: str, degree: int) -> Callable[[Results], str]:
    """σ of a held degree over that of the degree switched by five plots (P3.10)."""
    what = (
        f"σ of the range over the run in the {case} manoeuvre, degree {degree} fixed over degree switched by five plots"
    )
    return part(STEM, "P3.10", what, "")


def delay_ratio(case: str) -> Callable[[Results], str]:
    """Mean time to see beginning and end of a manoeuvre, eight plots over five (P3.8)."""
    what = f"mean time to detect beginning and end of the {case} manoeuvre at k = 1, 8 plots over 5"
    return part(STEM, "P3.8", what, "")


USES = {
    "growing": ("course", "speed", "cpa", "t_cpa"),
    "window 5": ("course", "speed", "cpa", "t_cpa"),
    "degree by 5": ("course", "speed"),
    "memory by 5": ("course", "speed"),
    "imm": ("course", "speed"),
    "kalman": ("course", "speed"),
}

MEASURED = {
    "manoeuvre_alarms": alarms,
    "manoeuvre_widest": widest,
    "manoeuvre_times": times("alarm"),
    "manoeuvre_clear": times("all clear"),
    "manoeuvre_classes": classes,
    "manoeuvre_courses": courses,
    "manoeuvre_imm_pays": premium("imm"),
    "manoeuvre_bounded_pays": premium("kalman"),
    **{
        f"manoeuvre_{name.replace(' ', '_')}_{component}": use(name, component)
        for name, components in USES.items()
        for component in components
    },
    "manoeuvre_beyond": beyond,
    "manoeuvre_turn_8": turn(8),
    "manoeuvre_turn_5": turn(5),
    "manoeuvre_threshold_5_4": threshold(5, 4),
    "manoeuvre_threshold_8_5": threshold(8, 5),
    "manoeuvre_delay_weakest": delay_ratio("weakest"),
    "manoeuvre_delay_strongest": delay_ratio("strongest"),
    "manoeuvre_at_one": part(STEM, "P3.9", "alarms a test at k = 1, five plots, acceleration of one σ_a", ""),
    **{
        f"manoeuvre_held_{degree}_{case}": switched(case, degree)
        for degree in (1, 2)
        for case in ("weakest", "strongest")
    },
}
