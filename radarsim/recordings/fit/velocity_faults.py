"""Decide what is wrong with recorded velocities: folds, another unit, or the other sign."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.recordings.doppler_scale import (
    COLUMNS,
    DopplerScale,
    detect_doppler_scale,
    detect_foreign_velocities,
    detect_lost_signs,
)
from radarsim.recordings.fit.folded_doppler import Folding, detect_folding
from radarsim.recordings.study_part import recording_interface


class VelocityFault(NamedTuple):
    """What is wrong with velocities: one of the two, or neither."""

    folding: Folding | None = None
    scale: DopplerScale | None = None


def detect_velocity_fault(tracks: Sequence[Mapping[str, np.ndarray]], span_mps: float | None = None) -> VelocityFault:
    """What is wrong with the velocities of tracks, COLUMNS (n,); span_mps: the span, where it is stated.

    A constant speed that is folded is also a multiple of the change of the range. Where folds by the stated span
    explain it, they are taken; else a multiple that folds cannot leave."""
    if span_mps is None and (lost := detect_lost_signs(tracks)) is not None:
        return VelocityFault(scale=lost)
    scale = detect_doppler_scale(tracks)
    fault = _explained_fault(scale, tracks, span_mps)
    if fault == VelocityFault() and span_mps is None:
        return VelocityFault(scale=detect_foreign_velocities(tracks))
    return fault


def _explained_fault(
    scale: DopplerScale | None, tracks: Sequence[Mapping[str, np.ndarray]], span_mps: float | None
) -> VelocityFault:
    """The fault by folds, another unit or the other sign, if one explains the velocities."""
    if scale is not None and not scale.is_sign and not scale.is_foldable:
        return VelocityFault(scale=scale)
    folding = detect_folding(tracks, span_mps)
    if scale is None or scale.is_sign:
        return VelocityFault(folding, None if folding else scale)
    if scale.is_certain and not (folding is not None and folding.is_clear):
        return VelocityFault(scale=scale)
    if folding is None:
        return VelocityFault()
    return VelocityFault(
        replace(folding, other_causes=scale.causes or folding.other_causes if scale.multiple > 0 else ())
    )


def detect_case_velocity_fault(case: Case, tracks: Sequence[Mapping[str, np.ndarray]]) -> VelocityFault:
    """The same for tracks that a case's study takes as measured, unless it unfolds the velocities."""
    interface = recording_interface(case)
    if not tracks or not set(COLUMNS) <= set(tracks[0]) or interface.unfolds(case.spec):
        return VelocityFault()
    return detect_velocity_fault(tracks, interface.span_mps(case.spec))
