"""Decide what is wrong with recorded velocities: folds, another unit, or the other sign."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.language.translate import plural
from radarsim.recordings.aircraft_match import MAX_GAP_S
from radarsim.recordings.doppler_scale import (
    COLUMNS,
    DopplerScale,
    detect_doppler_scale,
    detect_foreign_velocities,
    detect_lost_signs,
    doppler_scale_message,
)
from radarsim.recordings.fit.folded_doppler import Folding, detect_folding
from radarsim.recordings.study_part import recording_interface

MAX_TRACKS, MAX_NAMED = 50, 3  # that are judged one by one; that a note names
MIN_ROWS = 20  # of a track whose velocities agree with its ranges


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


def single_track_faults(case: Case, tracks: Mapping[str, Sequence[Mapping[str, np.ndarray]]]) -> list[str]:
    """What is wrong with the velocities of some tracks alone, by their names, in one or several stretches, if folds
    cannot explain it."""
    stretches = [stretch for parts in tracks.values() for stretch in parts]
    interface = recording_interface(case)
    if not stretches or not set(COLUMNS) <= set(stretches[0]) or interface.unfolds(case.spec):
        return []
    joined = {
        name: {key: np.concatenate([part[key] for part in parts]) for key in COLUMNS} for name, parts in tracks.items()
    }
    notes, are_certain = single_track_notes(joined)
    return notes if are_certain else []


def single_track_notes(tracks: Mapping[str, Mapping[str, np.ndarray]]) -> tuple[list[str], bool]:
    """Notes on tracks whose velocities are a multiple of the change of the range, or of the other sign, beside others
    whose velocities agree with it, none where all are alike; and whether folds cannot explain these."""
    names_by_scale: dict[DopplerScale, list[str]] = {}
    agreeing = 0
    for name, columns in list(tracks.items())[:MAX_TRACKS] if len(tracks) > 1 else []:
        scale = detect_doppler_scale([columns])
        if scale is not None and (scale.causes or scale.is_sign):
            match = next((key for key in names_by_scale if key.causes == scale.causes
                          and key.is_sign == scale.is_sign), scale)  # fmt: skip
            names_by_scale.setdefault(match, []).append(name)
        elif scale is None:
            agreeing += _agrees(columns)
    if not agreeing:
        return [], False
    notes = [
        plural("in track {names} alone: {message}; --track imports it apart",
               "in tracks {names} alone: {message}; --track imports them apart", len(names),
               names=", ".join(names[:MAX_NAMED]) + " …" * (len(names) > MAX_NAMED),
               message=doppler_scale_message(scale))
        for scale, names in names_by_scale.items()
    ]  # fmt: skip
    return notes, bool(notes) and all(scale.is_sign or scale.is_certain for scale in names_by_scale)


def _agrees(columns: Mapping[str, np.ndarray]) -> bool:
    """Whether the velocities of a track agree with the change of its range far better than the opposite ones."""
    track = np.stack([*(columns[name] for name in COLUMNS), np.full(len(columns["t_s"]), np.nan)], axis=1)
    track = track[np.isfinite(track[:, :3]).all(axis=1)]
    if len(track) < MIN_ROWS:
        return False
    offsets = np.abs(doppler_offsets(track))
    return bool(offsets.size) and bool(2 * np.median(offsets[0]) < np.median(offsets[1]))


def doppler_offsets(track: np.ndarray) -> np.ndarray:
    """Differences (2, m) of a track's speeds, and of the opposite ones, from the rates of its range, m/s, without whole
    spans."""
    (dt, dr, *_), (v, span) = np.diff(track, axis=0).T, track[1:, 2:].T
    is_close = (dt > 0) & (dt < MAX_GAP_S)
    offsets = np.stack([v, -v])[:, is_close] - dr[is_close] / dt[is_close]
    return offsets - np.nan_to_num(span[is_close] * np.rint(offsets / span[is_close]))
