"""What joins P4 to P1, as extensions: neither paper says it, and both need it."""

from radarsim.report.claims import Claim, Part, at_most, less
from radarsim.studies.pulses_to_tracks import measures

TARGETS = ("polynomial", "turn", "acceleration_start")
COMPONENTS = {"r": "range", "Vr": "velocity"}
ALIKE = 1.05


def _claim(number: int, statement: str, *parts: Part, reading: str, config: str) -> Claim:
    return Claim(f"P4.E{number}", "between P1 and P4", statement, parts, reading, config, extension=True)


def _as_ideal(name: str) -> list[Part]:
    """Parts that a filter of `pulses` is as its idealisation."""
    return [
        Part(
            ("pulses",),
            f"σ of {words} at the last scan over its idealisation's: {name}",
            "",
            measures.over_ideal("pulses", name, component),
            at_most(ALIKE),
        )
        for component, words in COMPONENTS.items()
    ]


CLAIMS = (
    _claim(
        1,
        "P1's σ_V of RLS 4 follows from a burst: its track is that of the assumed Gaussian error",
        *_as_ideal("spectrum"),
        reading="16 pulses at 20 kHz, 17 dB in all: Fisher bound 1 m/s; the classical estimator; within 5 %",
        config="pulses",
    ),
    _claim(
        2,
        "The track forecasts P4's sequence well enough: its track is that of the assumed Gaussian error",
        *_as_ideal("sequence"),
        *_as_ideal("cured"),
        reading="the same burst; every estimate taken as measured; within 5 %",
        config="pulses",
    ),
    *(
        _claim(
            number,
            f"An acceleration from the burst pays where the velocity does, under {words}",
            *(
                Part(
                    (f"pulses_acceleration target={target}",),
                    f"σ of acceleration at the last scan, with the acceleration over without: {target}",
                    "",
                    measures.last_to_last(f"pulses_acceleration target={target}", f"r+V+a{of}", f"r+V{of}", "ar"),
                    less(),
                )
                for target in TARGETS
            ),
            reading="2048 pulses in 51 ms, both filters with the burst's velocity",
            config="pulses_acceleration",
        )
        for number, words, of in ((3, "white jerk", ""), (4, "P1's jerk, constant over a scan", ", random jerk"))
    ),
)
