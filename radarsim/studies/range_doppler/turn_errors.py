"""The error of a filter in a turn, as configured and with another manoeuvre variance."""

import math
from dataclasses import replace

from radarsim.config.experiment import Case
from radarsim.constants import STANDARD_GRAVITY_MPS2
from radarsim.studies.range_doppler.config import Turn
from radarsim.studies.range_doppler.study import COMPONENTS, prepare
from radarsim.studies.range_doppler.tracking import configured_variances
from radarsim.studies.recording_interface import TurnError

TURN_G, TURN_SPEED_MPS, TURN_ANGLE_DEG = 3.0, 250.0, 90.0  # a turn as an aircraft flies it
SETTLING_SCANS = 60  # scans before and after it
EXTRA_RANGE_M = 60e3  # than the flight is long, so that it does not meet the radar


def turn_error(case: Case, filter_name: str, variance: float) -> TurnError:
    """The largest exact error of range (m) of a filter in a turn, as configured and with another manoeuvre variance.

    The target flies straight until the filter has settled, turns, and flies straight again; no plot is missed."""
    dt = case.spec.radar.scan_period_s
    (options,) = (filter_keys for filter_keys in case.spec.filters if filter_keys.name == filter_name)
    configured = configured_variances(case)[case.spec.filters.index(options)]
    variances = {"stated": configured, "changed": variance}
    turn_s = math.radians(TURN_ANGLE_DEG) / (TURN_G * STANDARD_GRAVITY_MPS2 / TURN_SPEED_MPS)
    start_s, scans = SETTLING_SCANS * dt, 2 * SETTLING_SCANS + math.ceil(turn_s / dt)
    target = Turn.model_validate(
        {
            "kind": "turn",
            "range_m": TURN_SPEED_MPS * (scans * dt) + EXTRA_RANGE_M,
            "speed_mps": TURN_SPEED_MPS,
            "aspect_rad": math.pi,
            "acceleration_g": TURN_G,
            "start_s": start_s,
            "duration_s": turn_s,
        }
    )
    filters = tuple(
        options.model_copy(update={"name": name, "manoeuvre_variance": filter_variance})
        for name, filter_variance in variances.items()
    )
    radar = case.spec.radar.model_copy(update={"detection_probability": 1.0})
    changes = {"radar": radar, "target": target, "filters": filters, "baseline": "stated", "scans": scans}
    axes = prepare(replace(case, spec=case.spec.model_copy(update=changes))).axes
    worst = axes.exact_sigma[:, SETTLING_SCANS:, 0].max(axis=1)
    return TurnError(*COMPONENTS[0], TURN_G, *worst.tolist())
