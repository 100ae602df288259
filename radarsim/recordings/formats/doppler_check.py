"""Check the unit, the sign and the folding of imported Doppler speeds."""

from collections.abc import Mapping

import numpy as np

from radarsim.language.translate import plural, tr
from radarsim.recordings.aircraft_match import MAX_GAP_S
from radarsim.recordings.doppler_scale import DopplerScale, detect_doppler_scale, doppler_scale_message
from radarsim.recordings.fit.folded_doppler import folding_message
from radarsim.recordings.fit.velocity_faults import detect_velocity_fault
from radarsim.recordings.formats.records import Batch
from radarsim.recordings.grouping import rows_by_name

DOPPLER_ROWS, MIN_DOPPLER_ROWS = 3000, 20  # rows on which sign and folding of the Doppler speed are tested
MAX_TRACKS, MAX_NAMED = 50, 3  # that are judged one by one; that a note names
DOPPLER_COLUMNS = ("t_s", "range_m", "velocity_mps")


class DopplerCheck:
    """Check the unit, the sign and the folding of Doppler speeds on the first rows of tracks."""

    def __init__(self) -> None:
        self.rows: dict[str, list[np.ndarray]] = {}
        self.count = 0

    def add(self, batch: Batch) -> None:
        """Keep a batch, while there are fewer than DOPPLER_ROWS rows."""
        if self.count >= DOPPLER_ROWS:
            return
        table = np.stack([batch.columns[name] for name in (*DOPPLER_COLUMNS, "span_mps")], axis=1)
        usable = np.isfinite(table[:, :3]).all(axis=1)
        self.count += int(usable.sum())
        for name, rows in rows_by_name(batch.track).items():
            if name:
                self.rows.setdefault(name, []).append(table[rows][usable[rows]])

    def notes(self, towards: bool) -> list[str]:
        """Notes if another unit or sign fits the rate of the range clearly better, and if speeds are folded."""
        tracks, notes = [np.concatenate(parts) for parts in self.rows.values()], []
        spanless_tracks = [
            dict(zip(DOPPLER_COLUMNS, track[np.isnan(track[:, 3]), :3].T, strict=True)) for track in tracks
        ]
        if notes := _notes_of_single_tracks(dict(zip(self.rows, spanless_tracks, strict=True))):
            return notes
        fault = detect_velocity_fault(spanless_tracks)
        if fault.scale is not None and not fault.scale.is_sign:
            return [doppler_scale_message(fault.scale)]
        offsets = np.abs(np.concatenate([np.empty((2, 0)), *map(_doppler_offsets, tracks)], axis=1))
        if offsets.shape[1] >= MIN_DOPPLER_ROWS:
            offset, opposite_offset = np.median(offsets, axis=1).tolist()
            if opposite_offset < 0.5 * offset:
                cure = tr("leave out --doppler-towards") if towards else tr("give --doppler-towards")
                fields = {"as_is": offset, "turned": opposite_offset, "cure": cure}
                notes = [tr("the Doppler speeds miss the change of the range by {as_is:.1f} m/s (median), with the "
                            "other sign by {turned:.1f} m/s: {cure}", **fields)]  # fmt: skip
        return notes if fault.folding is None else [folding_message(fault.folding)]


def _notes_of_single_tracks(tracks: Mapping[str, Mapping[str, np.ndarray]]) -> list[str]:
    """Notes on tracks whose velocities are a multiple of the change of the range, or of the other sign, beside others
    whose velocities agree with it; none where all are alike."""
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
        return []
    return [
        plural("in track {names} alone: {message}; --track imports it apart",
               "in tracks {names} alone: {message}; --track imports them apart", len(names),
               names=", ".join(names[:MAX_NAMED]) + " …" * (len(names) > MAX_NAMED),
               message=doppler_scale_message(scale))
        for scale, names in names_by_scale.items()
    ]  # fmt: skip


def _agrees(columns: Mapping[str, np.ndarray]) -> bool:
    """Whether the velocities of a track agree with the change of its range far better than the opposite ones."""
    track = np.stack([*(columns[name] for name in DOPPLER_COLUMNS), np.full(len(columns["t_s"]), np.nan)], axis=1)
    if len(track) < MIN_DOPPLER_ROWS:
        return False
    offsets = np.abs(_doppler_offsets(track))
    return bool(offsets.size) and bool(2 * np.median(offsets[0]) < np.median(offsets[1]))


def _doppler_offsets(track: np.ndarray) -> np.ndarray:
    """Differences (2, m) of a track's speeds, and of the opposite ones, from the rates of its range, m/s, without whole
    spans."""
    (dt, dr, *_), (v, span) = np.diff(track, axis=0).T, track[1:, 2:].T
    is_close = (dt > 0) & (dt < MAX_GAP_S)
    offsets = np.stack([v, -v])[:, is_close] - dr[is_close] / dt[is_close]
    return offsets - np.nan_to_num(span[is_close] * np.rint(offsets / span[is_close]))
