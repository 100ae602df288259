"""Flights that the axes of P2's lost figures allow, besides the shipped one; chosen before any filter ran on them.

What remains of figures 1 to 4: 0 to 200 km north, ±100 km east, under 2000 m/s, 186.2 s, a ballistic part and one of
intense manoeuvre. Lost are the kind of the manoeuvre (vertical or lateral), its strength, its start and its duration.
All flights but one start as the shipped one; they manoeuvre from 125 s on, the early ones from 60 s, to 170 s at the
latest. The manoeuvres are those of textbooks: a weave, reversals, one pull-up, a spiral; 40 to 250 m/s², or 4 to 25
g."""

from typing import Any

from radarsim.studies.multimodel.config import Flight

START_S, END_S, EARLY_START_S = 125, 170, 60  # of the manoeuvre, s, and of an early one
FLIGHT_KEYS: dict[str, Any] = {
    "kind": "flight",
    "duration_s": 186.2,
    "position_m": [190e3, 45e3, 97e3],
    "velocity_mps": [-931, 560, -930],
    "ballistic_coefficient_kgpm2": 9000,
    "lag_s": 1,
}


def _flight(phases: list[dict[str, Any]], end_s: float = END_S, **keys: Any) -> Flight:
    """A ballistic flight, then these phases, then a trimmed flight; its stages are those of the shipped flight."""
    stages = [
        *({"name": "start", "end_s": 20}, {"name": "ballistic", "end_s": phases[0]["start_s"]}),
        *({"name": "manoeuvre", "end_s": end_s}, {"name": "after"}),
    ]
    all_phases = [{"start_s": 0}, *phases, {"start_s": end_s, "trimmed": True}]
    return Flight.model_validate(FLIGHT_KEYS | keys | {"phases": all_phases, "stages": stages})


def _weave(period_s: float, **commands: float) -> list[dict[str, Any]]:
    """Commands that follow a sine, after eight seconds of lift that end the fall."""
    lift = {"start_s": START_S, "normal_mps2": 40}
    return [lift, {"start_s": START_S + 8, "period_s": period_s, "trimmed": True, **commands}]


def _constant_acceleration(
    size: float, end_s: float, key: str = "normal_mps2", **other_commands: float
) -> dict[str, Any]:
    """A constant acceleration, with the end of its stage."""
    return {"phases": [{"start_s": START_S, key: size, **other_commands}], "end_s": end_s}


def _reversals(
    key: str, size: float, interval_s: float, begin_s: float = START_S, **other_commands: float
) -> list[dict[str, Any]]:
    """Accelerations of the same size, whose sign changes at intervals."""
    count = int((END_S - begin_s) / interval_s)
    return [{"start_s": begin_s + i * interval_s, key: size * (-1) ** i, **other_commands} for i in range(count)]


def _spiral(size: float, interval_s: float, turns: int) -> list[dict[str, Any]]:
    """An acceleration to the right, up, left and down in turn, plus 20 m/s² upwards throughout."""
    directions = ((1, 0), (0, 1), (-1, 0), (0, -1)) * turns
    return [
        {"start_s": START_S + interval_s * i, "lateral_mps2": size * side, "normal_mps2": 20 + size * up}
        for i, (side, up) in enumerate(directions)
    ]


FLIGHTS: dict[str, Flight] = {
    "gentle, up and aside 40": _flight(
        [
            {"start_s": START_S, "normal_mps2": 40},
            {"start_s": 135},
            {"start_s": 140, "lateral_mps2": 40, "normal_mps2": 10},
            {"start_s": 150},
            {"start_s": 155, "lateral_mps2": -40, "normal_mps2": 20},
        ],
        end_s=165,
    ),
    "lateral weave 40": _flight(_weave(20, lateral_mps2=40)),
    "lateral weave 100": _flight(_weave(12, lateral_mps2=100)),
    "lateral reversals 100": _flight(_reversals("lateral_mps2", 100, 9, normal_mps2=20)),
    "one turn 60": _flight(**_constant_acceleration(60, 139, "lateral_mps2", normal_mps2=20)),
    "vertical weave 60": _flight(_weave(16, normal_mps2=60)),
    "vertical weave 150": _flight(_weave(16, normal_mps2=150)),
    "vertical reversals 150": _flight(_reversals("normal_mps2", 150, 5)),
    "pull-up 100": _flight(**_constant_acceleration(100, 133)),
    "pull-up 250": _flight(**_constant_acceleration(250, 129)),
    "spiral 80": _flight(_spiral(80, 4, 2), end_s=157),
    "low, vertical weave 60": _flight(
        _weave(16, normal_mps2=60), position_m=[150e3, 42e3, 60e3], velocity_mps=[-700, 560, -500]
    ),
    "early lateral reversals 150": _flight(
        _reversals("lateral_mps2", 150, 9, EARLY_START_S, normal_mps2=20), end_s=EARLY_START_S + 12 * 9
    ),
    "early vertical reversals 100": _flight(
        _reversals("normal_mps2", 100, 6, EARLY_START_S), end_s=EARLY_START_S + 18 * 6
    ),
    "dive 60": _flight(**_constant_acceleration(-60, 145)),
}
