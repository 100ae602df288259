"""Check the unit, the sign and the folding of imported Doppler speeds."""

import numpy as np

from radarsim.language.translate import tr
from radarsim.recordings.doppler_scale import doppler_scale_message
from radarsim.recordings.fit.folded_doppler import folding_message
from radarsim.recordings.fit.velocity_faults import detect_velocity_fault, doppler_offsets, single_track_notes
from radarsim.recordings.formats.records import Batch
from radarsim.recordings.grouping import rows_by_name

DOPPLER_ROWS, MIN_DOPPLER_ROWS = 3000, 20  # rows on which sign and folding of the Doppler speed are tested
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
        tracks = [np.concatenate(parts) for parts in self.rows.values()]
        spanless_tracks = [
            dict(zip(DOPPLER_COLUMNS, track[np.isnan(track[:, 3]), :3].T, strict=True)) for track in tracks
        ]
        notes, are_certain = single_track_notes(dict(zip(self.rows, spanless_tracks, strict=True)))
        if are_certain:
            return notes
        single_notes = notes.copy()
        fault = detect_velocity_fault(spanless_tracks)
        if fault.scale is not None and not fault.scale.is_sign:
            return [*notes, doppler_scale_message(fault.scale)]
        offsets = np.abs(np.concatenate([np.empty((2, 0)), *map(doppler_offsets, tracks)], axis=1))
        if offsets.shape[1] >= MIN_DOPPLER_ROWS:
            offset, opposite_offset = np.median(offsets, axis=1).tolist()
            if opposite_offset < 0.5 * offset:
                cure = tr("leave out --doppler-towards") if towards else tr("give --doppler-towards")
                fields = {"as_is": offset, "turned": opposite_offset, "cure": cure}
                notes += [tr("the Doppler speeds miss the change of the range by {as_is:.1f} m/s (median), with the "
                            "other sign by {turned:.1f} m/s: {cure}", **fields)]  # fmt: skip
        return notes if fault.folding is None else [*single_notes, folding_message(fault.folding)]
