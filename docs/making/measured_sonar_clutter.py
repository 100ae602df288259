"""Numbers of docs/sonar_clutter.md."""

from collections.abc import Callable

from making.numbers import Results
from making.result_rows import bounded, select_rows

DENSITIES = (0.03, 0.1, 0.3, 1, 2, 4)
BOTH = ("nearest", "PDA")
SLOWER = "nearest, 4 of 6"


def track(results: Results, name: str, density: float):
    """The row of a tracker at a density of false plots."""
    return select_rows(results, "sonar_clutter", "tracking", filter=name, false_plots_per_km2=density).iloc[0]


def last(results: Results, stem: str, name: str, density: float, component: str = "r"):
    """The last scan's row of a tracker in a table by scan."""
    case = f"false_plots_per_km2={density:g}"
    return select_rows(results, "sonar_clutter", stem, case=case, filter=name, component=component).iloc[-1]


def keeping(results: Results) -> list[tuple]:
    """How long tracks are kept and how many of their plots are wrong, by density."""
    heads = ("in PDA's gate", "life, nearest, s", "PDA, s", "wrong plots, nearest", "PDA")
    table_rows: list[tuple] = [("false plots per km²", *heads)]
    for density in DENSITIES:
        nearest, pda = (track(results, name, density) for name in BOTH)
        lives = (bounded(row, "life_s") for row in (nearest, pda))
        wrong = (bounded(row, "wrong_share") for row in (nearest, pda))
        table_rows.append((f"{density:g}", f"{pda['false_in_gate']:.2g}", *lives, *wrong))
    return table_rows


def erring(results: Results) -> list[tuple]:
    """σ_r at the last scan and the normalised error there, by density."""
    names = (*BOTH, "known association")
    table_rows: list[tuple] = [
        ("false plots per km²", *(f"σ_r, {name}, m" for name in names), *(f"normalised error, {name}" for name in BOTH))
    ]
    for density in DENSITIES:
        sigmas = (bounded(last(results, "curves", name, density), "sigma") for name in names)
        errors = (bounded(last(results, "consistency", name, density), "nees") for name in BOTH)
        table_rows.append((f"{density:g}", *sigmas, *errors))
    return table_rows


def false_tracks(results: Results) -> list[tuple]:
    """False tracks an hour and the time to confirm, of two rules."""
    heads = ("3 of 4, an hour", "4 of 6, an hour", "3 of 4 confirms after, s", "4 of 6, s")
    table_rows: list[tuple] = [("false plots per km²", *heads)]
    for density in DENSITIES:
        pair = [track(results, name, density) for name in ("nearest", SLOWER)]
        rates = (bounded(row, "false_tracks_per_hour") for row in pair)
        times = (bounded(row, "time_to_confirm_s") for row in pair)
        table_rows.append((f"{density:g}", *rates, *times))
    return table_rows


def gates(results: Results) -> list[tuple]:
    """Life, time to confirm and false tracks by gate and detection probability."""
    heads = ("P_G", "life, nearest, s", "PDA, s", "confirmed after, s", "false tracks an hour")
    table_rows: list[tuple] = [("P_D", *heads)]
    table = select_rows(results, "sonar_clutter_gate", "tracking", filter="nearest")
    for nearest in table.sort_values(["detection_probability", "gate_probability"], ascending=[False, True]).iloc:
        columns = {"filter": "PDA", "case": nearest["case"]}
        pda = select_rows(results, "sonar_clutter_gate", "tracking", **columns).iloc[0]
        cells = (bounded(row, "life_s") for row in (nearest, pda))
        further_cells = (bounded(nearest, "time_to_confirm_s"), bounded(nearest, "false_tracks_per_hour"))
        settings = (f"{nearest['detection_probability']:g}", f"{nearest['gate_probability']:g}")
        table_rows.append((*settings, *cells, *further_cells))
    return table_rows


def longer(results: Results) -> str:
    """The largest ratio of PDA's life to that of the nearest plot."""
    ratios = {
        density: track(results, "PDA", density)["life_s"] / track(results, "nearest", density)["life_s"]
        for density in DENSITIES
    }
    best = max(ratios, key=ratios.__getitem__)
    return f"{ratios[best]:.1f} times (at {best:g} per km²)"


def fewer(density: float) -> Callable[[Results], str]:
    """False tracks of 3 of 4 over those of 4 of 6."""

    def text(results: Results) -> str:
        first, second = (track(results, name, density)["false_tracks_per_hour"] for name in ("nearest", SLOWER))
        return f"{first / second:.2g}"

    return text


MEASURED = {
    "clutter_keeping": keeping,
    "clutter_erring": erring,
    "clutter_false_tracks": false_tracks,
    "clutter_gates": gates,
    "clutter_longer": longer,
    "clutter_fewer_tenth": fewer(0.1),
    "clutter_fewer_dense": fewer(1),
}
