"""The likelihood of recorded tracks under a filter that is given by its steps."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.studies.error_law import STATED_ERRORS, ErrorLaw
from radarsim.studies.missed_scans import missed_scan_times
from radarsim.studies.recording_interface import ALL_KINDS, usual_interval_s
from radarsim.studies.step_checks import record
from radarsim.studies.step_likelihood_programs import CompiledLikelihood, compile_likelihood, formula_choices
from radarsim.studies.step_programs import to_numbers
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
        self.recording = _join_tracks(study, spec, self.columns, tracks)
        self.kernels: dict[Any, CompiledLikelihood] = {}  # by the formulas that numbers choose

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
        from radarsim.kernels.lanes import rows

        with study_context(self.study.name), np.errstate(all="ignore"):
            c, recording = self._numbers(values), self.recording
            compiled = self._compiled(c)
        result = np.zeros((len(recording.kinds), len(self.columns)))
        numbers, work = to_numbers(c), [rows(n) for n in (compiled.rows, 1, recording.plots.shape[1], len(result.T))]
        compiled.kernel(*recording, numbers, *work, result)
        with np.errstate(invalid="ignore"):
            return np.diff(result.sum(axis=0), prepend=0.0)

    def _compiled(self, c: Any) -> CompiledLikelihood:
        """The kernel of the filter with these numbers."""
        choices = formula_choices(c)
        if choices not in self.kernels:
            self.kernels[choices] = compile_likelihood(self.steps, c, len(self.study.measured), len(self.columns))
        return self.kernels[choices]

    def soundness(self, values: np.ndarray, law: ErrorLaw) -> Sequence[Mapping[str, np.ndarray]]:
        raise user_code_error(self.steps.log_densities, "knows no law of outliers")


class _Recording(NamedTuple):
    """The rows of all tracks, one after the other, as `radarsim.kernels.step_likelihood` takes them."""

    kinds: np.ndarray
    intervals: np.ndarray
    plots: np.ndarray


def _join_tracks(
    study: "StepStudy", spec: Any, columns: Sequence[str], tracks: Sequence[Mapping[str, np.ndarray]]
) -> _Recording:
    """The rows of tracks, each from its first complete plot on, with the scans missed between them."""
    from radarsim.kernels.step_likelihood import PLOT, PREDICT, START

    period, kinds, intervals, plots = study.scan_period_s(spec), list[int](), list[float](), []
    for track in tracks:
        measured = [track[m.column] if m.column in columns else np.zeros(len(track["t_s"])) for m in study.measured]
        z, last = np.transpose(measured), math.nan
        for time, plot, is_whole in zip(track["t_s"].tolist(), z, np.isfinite(z).all(axis=1).tolist(), strict=True):
            is_first = math.isnan(last)
            if is_first and not is_whole:
                continue
            missed = missed_scan_times(last, time, period)
            kinds += [*[PREDICT] * len(missed), START if is_first else PLOT if is_whole else PREDICT]
            plots += [*[np.zeros(len(plot))] * len(missed), plot if is_whole else np.zeros(len(plot))]
            times = [time if is_first else last, *missed, time]
            intervals += np.diff(times).tolist()
            last = time
    return _Recording(
        np.array(kinds, dtype=np.int64), np.array(intervals), np.array(plots).reshape(-1, len(study.measured))
    )
