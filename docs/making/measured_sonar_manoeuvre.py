"""Numbers of docs/sonar_manoeuvre.md."""

import math
from collections.abc import Callable

import numpy as np
from scipy.stats import binom

from making.numbers import Results, with_bounds
from making.result_rows import claim_value, column_value, select_rows

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


def rows_at_one_percent(results: Results, name: str, acceleration: float, plots: int, **values):
    """Rows of the range at 0.01 false alarms a test."""
    case = f"acceleration_mps2={acceleration:g}"
    table = select_rows(results, STEM, name, case=case, filter=f"{plots} plots", component="r", **values)
    return table[(table["false_alarm_probability"] - 0.01).abs() < 1e-6]


def alarms(results: Results) -> list[tuple]:
    """Alarms a test at the end of the manoeuvre, with the exact probability below."""
    table_rows: list[tuple] = [HEADS]
    for plots in PLOTS:
        detections = [
            rows_at_one_percent(results, "detections", acceleration, plots, t_s=END_S).iloc[0]
            for acceleration in ACCELERATIONS
        ]
        table_rows.append((f"{plots} plots", *(f"{row['probability']:.3f}" for row in detections)))
        table_rows.append(("exact", *(f"{row['exact_probability']:.3f}" for row in detections)))
    return table_rows


def widest(results: Results) -> str:
    """The largest half-width of an interval in that table."""
    detections = [
        rows_at_one_percent(results, "detections", acceleration, plots, t_s=END_S).iloc[0]
        for plots in PLOTS
        for acceleration in ACCELERATIONS
    ]
    return f"{max((row['probability_hi'] - row['probability_lo']) / 2 for row in detections):.4f}"


def times(event: str) -> Callable[[Results], list[tuple]]:
    """Mean time to an event, s; the end of the last scan looked at is counted where it does not come."""

    def table(results: Results) -> list[tuple]:
        table_rows: list[tuple] = [("acceleration, m/s²", *HEADS[2:])]
        for plots in PLOTS:
            delays = (
                rows_at_one_percent(results, "delays", acceleration, plots, event=event)
                for acceleration in ACCELERATIONS[1:]
            )
            table_rows.append((f"{plots} plots", *map(mean_time, delays)))
        return table_rows

    return table


def mean_time(delays) -> str:
    """Mean of the time to an event with its interval, from the probability that it has come by each scan."""
    delay_s = delays["delay_s"].to_numpy()
    shares = np.diff(delays["probability"].to_numpy(), prepend=0.0)
    shares[-1] += 1 - shares.sum()
    mean = shares @ delay_s
    half = 1.96 * math.sqrt(shares @ (delay_s - mean) ** 2 / delays["n"].iloc[0])
    return with_bounds(mean, mean - half, mean + half)


def classes(results: Results) -> list[tuple]:
    """How often a leg is called what it is not."""
    table_rows: list[tuple] = [("wrongly called", *HEADS[1:])]
    for plots in (5, 8, 10):
        steady = rows_at_one_percent(results, "classes", 0, plots, truth="steady").iloc[-1]
        table_rows.append(
            (f"manoeuvring over 220 steady s, {plots} plots", f"{steady['error_probability']:.3f}", *[""] * 4)
        )
    for plots in (5, 8, 10):
        manoeuvres = (
            rows_at_one_percent(results, "classes", acceleration, plots, truth="manoeuvre").iloc[0]
            for acceleration in ACCELERATIONS[1:]
        )
        cells = (f"{row['error_probability']:.3f}" for row in manoeuvres)
        table_rows.append((f"steady over the manoeuvre, {plots} plots", "", *cells))
    return table_rows


def over_the_run(results: Results, name: str, acceleration: float) -> float:
    """σ of the range of a filter, the root of its mean square from the 5th scan on, m."""
    columns = {"case": f"acceleration_mps2={acceleration:g}", "filter": name, "component": "r"}
    curve = select_rows(results, STEM, "curves", **columns)
    return math.sqrt((curve[curve["k"] >= 5]["sigma"] ** 2).mean())


def courses(results: Results) -> list[tuple]:
    """σ of the range over the run, each filter in each manoeuvre."""
    table_rows: list[tuple] = [HEADS]
    for name, words in FILTERS.items():
        table_rows.append(
            (words, *(figures(over_the_run(results, name, acceleration)) for acceleration in ACCELERATIONS))
        )
    return table_rows


def figures(number: float) -> str:
    """A number to three figures, its zeros kept."""
    return f"{number:#.3g}".rstrip(".")


def premium(filter_name: str) -> Callable[[Results], str]:
    """By how much σ of a filter on the steady leg lies over that of the degree switched by eight plots."""

    def text(results: Results) -> str:
        return f"{100 * (over_the_run(results, filter_name, 0) / over_the_run(results, 'degree by 8', 0) - 1):.0f} %"

    return text


def use(name: str, component: str) -> Callable[[Results], str]:
    """Measured over believed σ of a use of the track after 220 steady seconds."""
    columns = {"case": "acceleration_mps2=0", "filter": name, "component": component, "t_s": 220}
    return column_value(STEM, "uses", "ratio", **columns)


def beyond(results: Results) -> str:
    """How many rates lie outside the binomial 99.99 % bounds of their exact law, of how many."""
    table = results.table(STEM, "detections").dropna(subset="exact_probability")
    count = (table["probability"] * table["n"]).round()
    low, high = (binom.ppf(tail, table["n"], table["exact_probability"]) for tail in (0.5e-4, 1 - 0.5e-4))
    outside = int(((count < low) | (count > high)).sum())
    return f"Of {len(table)} rates {outside} outside, {len(table) * 1e-4:.1f} to be expected"


def turn(plots: int) -> Callable[[Results], str]:
    """Alarms a test in range at the end of a turn of 2°/s."""

    def text(results: Results) -> str:
        case = "rate_radps=0.03491 frame=polar"
        columns = {"case": case, "filter": f"{plots} plots", "component": "r", "t_s": END_S}
        table = select_rows(results, "sonar_manoeuvre_turning", "detections", **columns)
        row = table[(table["false_alarm_probability"] - 0.01).abs() < 1e-6].iloc[0]
        return with_bounds(row["probability"], row["probability_lo"], row["probability_hi"])

    return text


def threshold(more: int, few: int) -> Callable[[Results], str]:
    """The threshold's fall from few plots to more (P3.8)."""
    part_name = f"acceleration at the threshold, {more} plots over {few}, at 0.01 false alarms a test"
    return claim_value(STEM, "P3.8", part_name, "")


def switched(case: str, degree: int) -> Callable[[Results], str]:
    """σ of a held degree over that of the degree switched by five plots (P3.10)."""
    manoeuvre = f"RMS range error over the run in the {case} manoeuvre"
    part_name = f"{manoeuvre}, degree {degree} fixed over degree switched by five plots"
    return claim_value(STEM, "P3.10", part_name, "")


def delay_ratio(case: str) -> Callable[[Results], str]:
    """Mean time to see beginning and end of a manoeuvre, eight plots over five (P3.8)."""
    part_name = f"mean time to detect beginning and end of the {case} manoeuvre at k = 1, 8 plots over 5"
    return claim_value(STEM, "P3.8", part_name, "")


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
    "manoeuvre_at_one": claim_value(STEM, "P3.9", "alarms a test at k = 1, five plots, acceleration of one σ_a", ""),
    **{
        f"manoeuvre_held_{degree}_{case}": switched(case, degree)
        for degree in (1, 2)
        for case in ("weakest", "strongest")
    },
}
