"""Numbers of docs/sonar_clutter.md."""

from collections.abc import Callable

from making.numbers import Results
from making.pick import bounded, rows

DENSITIES = (0.03, 0.1, 0.3, 1, 2, 4)
BOTH = ("nearest", "PDA")
SLOWER = "nearest, 4 of 6"


def track(results: Results, name: str, density: float):
    """The row of a tracker at a density of false plots."""
    return rows(results, "sonar_clutter", "tracking", filter=name, false_plots_per_km2=density).iloc[0]


def last(results: Results, stem: str, name: str, density: float, component: str = "r"):
    """The last scan's row of a tracker in a table by scan."""
    case = f"false_plots_per_km2={density:g}"
    return rows(results, "sonar_clutter", stem, case=case, filter=name, component=component).iloc[-1]


def keeping(results: Results) -> list[tuple]:
    """How long tracks are kept and how many of their plots are wrong, by density."""
    heads = ("in PDA's gate", "life, nearest, s", "PDA, s", "wrong plots, nearest", "PDA")
    made: list[tuple] = [("false plots per km²", *heads)]
    for density in DENSITIES:
        nearest, pda = (track(results, name, density) for name in BOTH)
        lives = (bounded(row, "life_s", "life") for row in (nearest, pda))
        wrong = (bounded(row, "wrong_share", "wrong") for row in (nearest, pda))
        made.append((f"{density:g}", f"{pda['false_in_gate']:.2g}", *lives, *wrong))
    return made


def erring(results: Results) -> list[tuple]:
    """σ_r at the last scan and the normalised error there, by density."""
    names = (*BOTH, "known association")
    made: list[tuple] = [
        ("false plots per km²", *(f"σ_r, {name}, m" for name in names), *(f"normalised error, {name}" for name in BOTH))
    ]
    for density in DENSITIES:
        sigmas = (bounded(last(results, "curves", name, density), "sigma") for name in names)
        errors = (bounded(last(results, "consistency", name, density), "nees") for name in BOTH)
        made.append((f"{density:g}", *sigmas, *errors))
    return made


def false_tracks(results: Results) -> list[tuple]:
    """False tracks an hour and the time to confirm, of two rules."""
    heads = ("3 of 4, an hour", "4 of 6, an hour", "3 of 4 confirms after, s", "4 of 6, s")
    made: list[tuple] = [("false plots per km²", *heads)]
    for density in DENSITIES:
        pair = [track(results, name, density) for name in ("nearest", SLOWER)]
        rates = (bounded(row, "false_tracks_per_hour", "false") for row in pair)
        times = (bounded(row, "time_to_confirm_s", "time") for row in pair)
        made.append((f"{density:g}", *rates, *times))
    return made


def gates(results: Results) -> list[tuple]:
    """Life, time to confirm and false tracks by gate and detection probability."""
    heads = ("P_G", "life, nearest, s", "PDA, s", "confirmed after, s", "false tracks an hour")
    made: list[tuple] = [("P_D", *heads)]
    table = rows(results, "sonar_clutter_gate", "tracking", filter="nearest")
    for nearest in table.sort_values(["detection_probability", "gate_probability"], ascending=[False, True]).iloc:
        wanted = {"filter": "PDA", "case": nearest["case"]}
        pda = rows(results, "sonar_clutter_gate", "tracking", **wanted).iloc[0]
        cells = (bounded(row, "life_s", "life") for row in (nearest, pda))
        others = (bounded(nearest, "time_to_confirm_s", "time"), bounded(nearest, "false_tracks_per_hour", "false"))
        settings = (f"{nearest['detection_probability']:g}", f"{nearest['gate_probability']:g}")
        made.append((*settings, *cells, *others))
    return made


def longer(results: Results) -> str:
    """The largest ratio of PDA's life to that of the nearest plot."""
    ratios = {one: track(results, "PDA", one)["life_s"] / track(results, "nearest", one)["life_s"] for one in DENSITIES}
    best = max(ratios, key=ratios.__getitem__)
    return f"{ratios[best]:.1f} times (at {best:g} per km²)"


def fewer(density: float) -> Callable[[Results], str]:
    """False tracks of 3 of 4 over those of 4 of 6."""

    def made(results: Results) -> str:
        first, second = (track(results, name, density)["false_tracks_per_hour"] for name in ("nearest", SLOWER))
        return f"{first / second:.2g}"

    return made


MEASURED = {
    "clutter_keeping": keeping,
    "clutter_erring": erring,
    "clutter_false_tracks": false_tracks,
    "clutter_gates": gates,
    "clutter_longer": longer,
    "clutter_fewer_tenth": fewer(0.1),
    "clutter_fewer_dense": fewer(1),
}
