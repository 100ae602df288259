"""What joins P4 to P1, as extensions: neither paper says it, and both need it."""

from radarsim.report.claims import Claim, Part, at_most, less
from radarsim.studies.pulses_to_tracks import measures

TARGETS = ("polynomial", "turn", "acceleration_start")
COMPONENTS = {"r": "range", "Vr": "velocity"}
RADARS = range(1, 6)
ALIKE = 1.05


def _claim(number: int, statement: str, *parts: Part, reading: str, config: str) -> Claim:
    return Claim(f"P4.E{number}", "between P1 and P4", statement, parts, reading, config, extension=True)


def _as_ideal(name: str, case: str = "pulses", of: str = "") -> list[Part]:
    """Parts that a filter of a case is as its idealisation; of: which case it is, in words."""
    return [
        Part(
            (case,),
            f"σ of {words} at the last scan over its idealisation's: {of}{name}",
            "",
            measures.over_ideal(case, name, component),
            at_most(ALIKE),
        )
        for component, words in COMPONENTS.items()
    ]


CLAIMS = (
    _claim(
        1,
        "P1's σ_V follows from a burst for each of its five radars: the track is that of the assumed Gaussian error",
        *(part for n in RADARS for part in _as_ideal("spectrum", f"pulses_rls{n}", f"RLS {n}, ")),
        reading="16 pulses of 17 dB in all, at the repetition rate whose Fisher bound is σ_V: 1.7, 60 and 20 kHz; "
        "the classical estimator; within 5 %",
        config="pulses_radars",
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
    _claim(
        5,
        "Hypotheses on folds make up for velocities that fold: the track is that of the true folds",
        *_as_ideal("hypotheses", "pulses_folds burst.snr_db=5.24"),
        reading="RLS 4 at P1's 1 kHz, 15 m/s to a fold, ± 300 m/s known; bursts of 17 dB; 300 hypotheses; within 5 %",
        config="pulses_folds",
    ),
)
