"""Numbers of docs/sonar.md."""

from collections.abc import Callable

from making.numbers import Results, signed, with_bounds
from making.result_rows import select_rows

COURSES = {"straight": "steady", "fluctuating": "fluctuating, 0.05 m/s²", "turning": "75 s into a turn of 1°/s"}
DETECTION = (1, 0.9, 0.7, 0.5)
CORRELATIONS = (-0.5, 0, 0.3, 0.6, 0.9, 0.99)
BEARINGS_DEG = (0.5, 1, 2, 4, 8)


def last(results: Results, stem: str, **values):
    """The last scan of one filter's σ of the range."""
    return select_rows(results, stem, "curves", component="r", **values).iloc[-1]


def sigma(row) -> str:
    """σ with its interval."""
    return with_bounds(row["sigma"], row["sigma_lo"], row["sigma_hi"])


def plots(results: Results) -> list[tuple]:
    """What each further plot of a straight course buys, smoothed and a scan ahead, σ of a plot being 1."""
    heads = ("plots", "smoothed", "formula", "reduction, %", "one scan ahead", "formula", "reduction, %")
    table_rows: list[tuple] = [heads]
    for count in range(2, 9):
        cells: list[str] = [str(count)]
        for estimate in ("smoothed", "extrapolated"):
            columns = {"filter": "growing", "component": "r", "quantity": estimate, "plots": count}
            row = select_rows(results, "sonar_smoothing", "plots", **columns).iloc[0]
            value = with_bounds(row["ratio"], row["ratio_lo"], row["ratio_hi"])
            cells += [value, f"{row['formula']:.4f}", f"{row['reduction_percent']:.1f}" if count > 2 else ""]
        table_rows.append(tuple(cells))
    return table_rows


def courses(results: Results) -> list[tuple]:
    """σ_r at the last of 40 scans of each filter on each course."""
    filter_names = ("growing", "kalman q", "alpha-beta", "window 10", "window 5")
    table_rows: list[tuple] = [("course", *filter_names)]
    for target, words in COURSES.items():
        case = {"case": f"target=sonar_{target}"}
        table_rows.append(
            (words, *(sigma(last(results, "sonar_fluctuating", filter=name, **case)) for name in filter_names))
        )
    return table_rows


def missed(results: Results) -> list[tuple]:
    """σ_r after 20 scans of which three gave no plot, by the probability that each of the others did."""
    filter_names = ("growing", "kalman", "window 5", "growing 2")
    table_rows: list[tuple] = [("P_D", *filter_names)]
    for probability in DETECTION:
        case = {"case": f"probability={probability:g}"}
        table_rows.append(
            (f"{probability:g}", *(sigma(last(results, "sonar_missed", filter=name, **case)) for name in filter_names))
        )
    return table_rows


def gap(name: str) -> Callable[[Results], str]:
    """σ_r of a filter before and at the end of three scans missed in a row."""

    def text(results: Results) -> str:
        curve = select_rows(
            results, "sonar_missed", "curves", case="probability=1", filter=name, component="r"
        ).set_index("k")
        return f"{curve.loc[7, 'sigma']:.1f} → {curve.loc[10, 'sigma']:.1f} m"

    return text


def correlated(results: Results) -> list[tuple]:
    """What ignoring the correlation of the errors costs after 20 plots, and what the filter then believes."""
    heads = (
        "ρ",
        "σ_r of those that know, m",
        "of those that do not, m",
        "they believe, m",
        "normalised error",
        "calculated",
    )
    table_rows: list[tuple] = [heads]
    for rho in CORRELATIONS:
        case = {"case": f"correlation={rho:g}"}
        knows, ignores = (last(results, "sonar_correlated", filter=name, **case) for name in ("augmented", "naive"))
        naive = {"filter": "naive", "component": "r", **case}
        believed = select_rows(results, "sonar_correlated", "curves", **naive).iloc[-1]
        error = select_rows(results, "sonar_correlated", "consistency", **naive).iloc[-1]
        normalised = (with_bounds(error["nees"], error["nees_lo"], error["nees_hi"]), f"{error['exact_nees']:.2f}")
        table_rows.append(
            (signed(f"{rho:g}"), sigma(knows), sigma(ignores), f"{believed['believed_sigma']:.2f}", *normalised)
        )
    return table_rows


def conversion(results: Results) -> list[tuple]:
    """The bias of converted plots at 15 km, plain and unbiased."""
    table_rows: list[tuple] = [("σ_β", "plain, m", "by the formula, m", "unbiased, m")]
    for degrees in BEARINGS_DEG:
        plain, unbiased = (
            select_rows(results, "sonar_conversion", "conversion", case=f"deg={degrees:g} frame={frame}").iloc[0]
            for frame in ("cartesian", "cartesian_unbiased")
        )
        first, second = (with_bounds(row["bias_m"], row["bias_m_lo"], row["bias_m_hi"]) for row in (plain, unbiased))
        table_rows.append((f"{degrees:g}°", first, signed(f"{plain['formula_m']:.1f}"), second))
    return table_rows


MEASURED = {
    "sonar_plots": plots,
    "sonar_courses": courses,
    "sonar_missed": missed,
    "sonar_gap_growing": gap("growing"),
    "sonar_gap_window": gap("window 5"),
    "sonar_correlated": correlated,
    "sonar_conversion": conversion,
}
