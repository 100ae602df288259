"""Flights that the axes of P2's lost figures allow, beside the shipped one; chosen before any filter ran on them.

What is left of figures 1 to 4: 0 to 200 km north, ±100 km east, under 2000 m/s, 186.2 s, a ballistic part and one of
intense manoeuvre. What manoeuvre it is, in the vertical or to the side, how strong, from when on and for how long, is
lost. All flights but one begin as the shipped one does; they manoeuvre from 125 s on, the early ones from 60 s, to
170 s at the latest. Manoeuvres are those of the field's textbooks: a weave, reversals, one pull-up, a spiral; 40 to
250 m/s², which is 4 to 25 g.
"""

from typing import Any

from radarsim.studies.multimodel.config import Flight

BEGINS, ENDS, EARLY = 125, 170, 60  # s, of the manoeuvre; EARLY: another beginning
BASE: dict[str, Any] = {
    "kind": "flight",
    "duration_s": 186.2,
    "position_m": [190e3, 45e3, 97e3],
    "velocity_mps": [-931, 560, -930],
    "ballistic_coefficient_kgpm2": 9000,
    "lag_s": 1,
}


def _flight(phases: list[dict[str, Any]], ends: float = ENDS, **other: Any) -> Flight:
    """Ballistic, then these phases, then trimmed; stages as those of the shipped flight."""
    stages = [
        *({"name": "start", "end_s": 20}, {"name": "ballistic", "end_s": phases[0]["start_s"]}),
        *({"name": "manoeuvre", "end_s": ends}, {"name": "after"}),
    ]
    every = [{"start_s": 0}, *phases, {"start_s": ends, "trimmed": True}]
    return Flight.model_validate(BASE | other | {"phases": every, "stages": stages})


def _weave(period_s: float, **commands: float) -> list[dict[str, Any]]:
    """A sine of the commands, after eight seconds that lift the target out of its fall."""
    lifted = {"start_s": BEGINS, "normal_mps2": 40}
    return [lifted, {"start_s": BEGINS + 8, "period_s": period_s, "trimmed": True, **commands}]


def _held(size: float, until_s: float, key: str = "normal_mps2", **also: float) -> dict[str, Any]:
    """One acceleration, held; with the stage that ends where it ends."""
    return {"phases": [{"start_s": BEGINS, key: size, **also}], "ends": until_s}


def _reversals(key: str, size: float, held_s: float, begins: float = BEGINS, **also: float) -> list[dict[str, Any]]:
    """Accelerations of one size, the sign changed after each has been held."""
    count = int((ENDS - begins) / held_s)
    return [{"start_s": begins + i * held_s, key: size * (-1) ** i, **also} for i in range(count)]


def _spiral(size: float, held_s: float, turns: int) -> list[dict[str, Any]]:
    """The acceleration goes round: right, up, left, down, each held, and 20 m/s² upwards throughout."""
    round_ = ((1, 0), (0, 1), (-1, 0), (0, -1)) * turns
    return [
        {"start_s": BEGINS + held_s * i, "lateral_mps2": size * side, "normal_mps2": 20 + size * up}
        for i, (side, up) in enumerate(round_)
    ]


FLIGHTS: dict[str, Flight] = {
    "gentle, up and aside 40": _flight(
        [
            {"start_s": BEGINS, "normal_mps2": 40},
            {"start_s": 135},
            {"start_s": 140, "lateral_mps2": 40, "normal_mps2": 10},
            {"start_s": 150},
            {"start_s": 155, "lateral_mps2": -40, "normal_mps2": 20},
        ],
        ends=165,
    ),
    "lateral weave 40": _flight(_weave(20, lateral_mps2=40)),
    "lateral weave 100": _flight(_weave(12, lateral_mps2=100)),
    "lateral reversals 100": _flight(_reversals("lateral_mps2", 100, 9, normal_mps2=20)),
    "one turn 60": _flight(**_held(60, 139, "lateral_mps2", normal_mps2=20)),
    "vertical weave 60": _flight(_weave(16, normal_mps2=60)),
    "vertical weave 150": _flight(_weave(16, normal_mps2=150)),
    "vertical reversals 150": _flight(_reversals("normal_mps2", 150, 5)),
    "pull-up 100": _flight(**_held(100, 133)),
    "pull-up 250": _flight(**_held(250, 129)),
    "spiral 80": _flight(_spiral(80, 4, 2), ends=157),
    "low, vertical weave 60": _flight(
        _weave(16, normal_mps2=60), position_m=[150e3, 42e3, 60e3], velocity_mps=[-700, 560, -500]
    ),
    "early lateral reversals 150": _flight(
        _reversals("lateral_mps2", 150, 9, EARLY, normal_mps2=20), ends=EARLY + 12 * 9
    ),
    "early vertical reversals 100": _flight(_reversals("normal_mps2", 100, 6, EARLY), ends=EARLY + 18 * 6),
    "dive 60": _flight(**_held(-60, 145)),
}
