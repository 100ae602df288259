"""Numbers of docs/range_doppler.md."""

import math

from making.numbers import Results, with_bounds

RADARS = ("rls1", "rls2", "rls3", "rls4", "rls5")
COMPONENTS = {"r": "range", "Vr": "velocity", "ar": "acceleration"}


def title(case: str) -> str:
    """RLS 2 of the case rls2, never broken over lines."""
    return case.replace("rls", "RLS\N{NO-BREAK SPACE}")


def gains(results: Results) -> list[tuple]:
    """The largest and the last gain of each radar and component, with its interval."""
    table = results.table("range_doppler", "gains")
    ratio = results.table("range_doppler", "radar").set_index("case")["C_theta"]
    heads = [head for name in COMPONENTS.values() for head in (f"{name}: best, %", "at 140 s, %")]
    table_rows: list[tuple] = [("radar", "C_θ", *heads)]
    for radar in RADARS:
        cells = [title(radar), f"{ratio[radar]:.3g}"]
        for component in COMPONENTS:
            curve = table[(table["case"] == radar) & (table["component"] == component)]
            highest = curve.loc[curve["gain_percent"].idxmax()]
            cells += [f"{bounded(highest)}, at {highest['t_s']:g}\N{NO-BREAK SPACE}s", bounded(curve.iloc[-1])]
        table_rows.append(tuple(cells))
    return table_rows


def bounded(row) -> str:
    """A gain with its interval."""
    return with_bounds(row["gain_percent"], row["gain_lo"], row["gain_hi"])


def best(results: Results) -> list[tuple]:
    """The best manoeuvre variance of each radar and filter by the paper's rule, with steady σ and settling time."""
    steady = results.table("manoeuvre_variance", "steady")
    ranges = steady[steady["component"] == "r"]
    table_rows = [("radar", "filter", "best D_M, (m/s³)²", "steady σ_r, m", "settled after, s")]
    for radar in RADARS:
        results_of_radar = ranges[ranges["case"].str.startswith(f"{radar} ")]
        for name in dict.fromkeys(results_of_radar["filter"]):
            for row in results_of_radar[(results_of_radar["filter"] == name) & results_of_radar["best"]].itertuples():
                settled = f"{row.settling_s:g}"
                table_rows.append(
                    (title(radar), name, power(row.manoeuvre_variance), f"{row.steady_sigma:.1f}", settled)
                )
            if not results_of_radar.loc[results_of_radar["filter"] == name, "best"].any():
                table_rows.append((title(radar), name, "none of those tried", "–", "–"))
    return table_rows


def power(value: float) -> str:
    """A power of ten as print writes it."""
    exponent = round(math.log10(value))
    return "10" + str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def exact_gain(radar: str, component: str, k: int):
    """The exact gain of a radar at scan k, %."""

    def text(results: Results) -> str:
        table = results.table("range_doppler", "gains")
        (row,) = table[(table["case"] == radar) & (table["component"] == component) & (table["k"] == k)].itertuples()
        return f"{row.exact_percent:.1f} %"

    return text


def difference(at: str):
    """The exact difference of σ_r between the filters of RLS 2: its `peak` with the time, or its `last` value."""

    def text(results: Results) -> str:
        table = results.table("range_doppler", "curves")
        curves = table[(table["case"] == "rls2") & (table["component"] == "r")]
        sigma = curves.pivot(index="t_s", columns="filter", values="exact_sigma")
        gap = sigma["r"] - sigma["r+Vr"]
        return f"{gap.max():.0f} m at {gap.idxmax():g} s" if at == "peak" else f"{gap.iloc[-1]:.0f} m"

    return text


def settling(radar: str):
    """Scan periods in which the range of a radar settles with range alone at D_M = 10⁻³."""

    def text(results: Results) -> str:
        steady = results.table("range_doppler", "steady")
        (row,) = steady[
            (steady["case"] == radar) & (steady["filter"] == "r") & (steady["component"] == "r")
        ].itertuples()
        return f"{row.settling_periods:g}"

    return text


MEASURED = {
    "range_doppler_gains": gains,
    "range_doppler_best": best,
    "rls2_first_velocity_gain": exact_gain("rls2", "Vr", 3),
    "rls3_first_velocity_gain": exact_gain("rls3", "Vr", 3),
    "rls2_difference_peak": difference("peak"),
    "rls2_difference_last": difference("last"),
    "rls3_settling": settling("rls3"),
    "rls5_settling": settling("rls5"),
}
