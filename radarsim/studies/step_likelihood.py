"""The likelihood of recorded tracks under a filter that is given by its steps, in plain Python."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.studies.error_law import STATED_ERRORS, ErrorLaw
from radarsim.studies.missed_scans import missed_scan_times
from radarsim.studies.recording_interface import ALL_KINDS, usual_interval_s
from radarsim.studies.step_checks import record
from radarsim.user_code.errors import study_context, user_code_error

if TYPE_CHECKING:
    from radarsim.studies.stepwise import StepStudy

ZERO_SHARE = 1e-6  # of a fitted key's stated value: what counts as zero


class StepLikelihood:
    """The likelihood of tracks under a filter, by its prediction of each plot but the first of a track."""

    explains: tuple[str, ...] = ()
    outlier_kinds = ALL_KINDS
    far_kinds: tuple[str, ...] = ()
    has_offsets = False
    is_smooth = True

    def __init__(self, study: "StepStudy", spec: Any, keys: Any, tracks: Sequence[Mapping[str, np.ndarray]]):
        self.study, self.spec, self.filter_keys, self.filter = study, spec, keys, keys.name
        self.steps: Any = study.kinds[keys.kind]
        self.tracks, self.rows = len(tracks), sum(len(track["t_s"]) for track in tracks)
        self.keys = tuple(study.fitted(keys))
        self.stated = np.array([self._owner(key)[1] for key in self.keys], dtype=float)
        self.zero_limits = ZERO_SHARE * np.where(self.stated > 0, self.stated, 1.0)
        self.usual_s = usual_interval_s(tracks)
        self.columns = study.columns(spec, keys)
        unused = np.full(max((len(track["t_s"]) for track in tracks), default=0), 0.0)
        self.plots = [
            (
                track["t_s"],
                np.transpose(
                    [
                        track[number.column] if number.column in self.columns else unused[: len(track["t_s"])]
                        for number in study.measured
                    ]
                ),
            )
            for track in tracks
        ]

    def _owner(self, key: str) -> tuple[str, Any]:
        """The part of the config that a key belongs to, empty for the filter, and its value."""
        part, _, name = key.rpartition(".")
        return part, getattr(getattr(self.spec, part) if part else self.filter_keys, name)

    def _numbers(self, values: np.ndarray) -> Any:
        """The numbers of the filter with these values of the keys."""
        spec, filter_keys = self.spec, self.filter_keys
        for key, value in zip(self.keys, map(float, values), strict=True):
            part, _, name = key.rpartition(".")
            if part:
                spec = spec.model_copy(update={part: getattr(spec, part).model_copy(update={name: value})})
            else:
                filter_keys = filter_keys.model_copy(update={name: value})
        return record(self.steps.design, spec, filter_keys)

    def __call__(self, values: np.ndarray, law: ErrorLaw = STATED_ERRORS) -> float:
        total = float(self._densities(values).sum())
        return total if math.isfinite(total) else -math.inf

    def by_number(self, values: np.ndarray) -> Mapping[str, float]:
        return dict(zip(self.columns, self._densities(values).tolist(), strict=True))

    def _densities(self, values: np.ndarray) -> np.ndarray:
        """The logarithm of the density of all plots but the first of a track, given those before, by their numbers."""
        with study_context(self.study.name), np.errstate(all="ignore"):
            c = self._numbers(values)
            return np.sum([self._track_densities(t_s, plots, c) for t_s, plots in self.plots], axis=0)

    def _track_densities(self, t_s: np.ndarray, plots: np.ndarray, c: Any) -> np.ndarray:
        """The same of one track."""
        steps, s, last, total = self.steps, None, math.nan, np.zeros(len(self.columns))
        period = self.study.scan_period_s(self.spec)
        for t, z in zip(map(float, t_s), (tuple(map(float, row)) for row in plots), strict=True):
            if s is not None:
                for time in (*missed_scan_times(last, t, period), t):
                    s = steps.predict(s, time - last, (), c)
                    last = time
            if not any(map(math.isnan, z)):
                if s is None:
                    s, last = steps.start(z, (), c), t
                else:
                    total += np.diff([0.0, *map(float, self.steps.log_densities(s, z, (), c))])
                    s = steps.update(s, z, (), c)
        return total

    def soundness(self, values: np.ndarray, law: ErrorLaw) -> Sequence[Mapping[str, np.ndarray]]:
        raise user_code_error(self.steps.log_densities, "knows no law of outliers")
