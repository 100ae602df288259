"""The likelihood of recorded tracks under a filter that is given by its steps."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.studies.error_law import MANOEUVRES, OUTLIERS, STATED_ERRORS, ErrorLaw
from radarsim.studies.gross_errors import data_span, soundness_by_column, without_gross_starts
from radarsim.studies.missed_scans import missed_scan_times
from radarsim.studies.recording_interface import usual_interval_s
from radarsim.studies.step_checks import record
from radarsim.studies.step_laws import has_laws, plot_laws
from radarsim.studies.step_likelihood_programs import CompiledLikelihood, compile_likelihood, formula_choices, sigmas
from radarsim.studies.step_programs import to_numbers
from radarsim.user_code.errors import call_user_function, study_context, user_code_error

if TYPE_CHECKING:
    from radarsim.studies.stepwise import StepStudy

ZERO_SHARE = 1e-6  # of a fitted key's stated value: what counts as zero


class StepLikelihood:
    """The likelihood of tracks under a filter, by its prediction of each plot but the first of a track.

    Where the filter merges states, and says which of its numbers are the σ of a plot, errors may follow other laws."""

    far_kinds: tuple[str, ...] = ()
    has_offsets = True
    is_smooth = True

    def __init__(self, study: "StepStudy", spec: Any, keys: Any, tracks: Sequence[Mapping[str, np.ndarray]]):
        self.study, self.spec, self.filter_keys, self.filter = study, spec, keys, keys.name
        self.steps: Any = study.kinds[keys.kind]
        self.tracks, self.rows = len(tracks), sum(len(track["t_s"]) for track in tracks)
        self.keys = tuple(study.fitted(keys))
        self.stated = np.array([self._owner(key)[1] for key in self.keys], dtype=float)
        self.zero_limits = ZERO_SHARE * np.where(self.stated > 0, self.stated, 1.0)
        self.usual_s = usual_interval_s(tracks)
        self.columns = self.outlier_kinds = tuple(study.columns(spec, keys))
        self.explains: tuple[str, ...] = ()
        self.given_tracks = self.cleaned_tracks = list(tracks)
        if self.steps.merge is not None and self.steps.sigma_field is not None:
            self.explains = (OUTLIERS, MANOEUVRES) if self.steps.noise_field is not None else (OUTLIERS,)
            self.given_tracks = [unwrap_angles(study, self.columns, track) for track in tracks]
            folds = study.span_mps(spec) is not None
            smooth = [m.column for m in study.measured if m.column in self.columns and not (folds and m.unit == "m/s")]
            self.cleaned_tracks = [without_gross_starts(track, smooth, 1) for track in self.given_tracks]
        self.spans = data_span(self.given_tracks, self.columns)
        self.recording, self.places = join_tracks(study, spec, self.columns, self.cleaned_tracks)
        self.kernels: dict[Any, CompiledLikelihood] = {}  # by the formulas that numbers choose

    def _owner(self, key: str) -> tuple[str, Any]:
        """The part of the config that a key belongs to, empty for the filter, and its value."""
        part, _, name = key.rpartition(".")
        return part, getattr(getattr(self.spec, part) if part else self.filter_keys, name)

    def _config(self, values: np.ndarray) -> tuple[Any, Any]:
        """The config with these values of the keys, and the filter's part of it."""
        spec, filter_keys = self.spec, self.filter_keys
        for key, value in zip(self.keys, map(float, values), strict=True):
            part, _, name = key.rpartition(".")
            if part:
                spec = spec.model_copy(update={part: getattr(spec, part).model_copy(update={name: value})})
            else:
                filter_keys = filter_keys.model_copy(update={name: value})
        return spec, filter_keys

    def __call__(self, values: np.ndarray, law: ErrorLaw = STATED_ERRORS) -> float:
        if has_laws(law):
            total = float(self._scores(values, law)[0].sum())
        else:
            total = float(self._densities(values).sum())
        return total if math.isfinite(total) else -math.inf

    def by_number(self, values: np.ndarray) -> Mapping[str, float]:
        return dict(zip(self.columns, self._densities(values).tolist(), strict=True))

    def soundness(self, values: np.ndarray, law: ErrorLaw) -> Sequence[Mapping[str, np.ndarray]]:
        if not self.explains:
            raise user_code_error(self.steps.log_densities, "knows no law of outliers")
        judged = []
        if has_laws(law):
            soundness = self._scores(values, law)[1]
            judged = [(track, rows, soundness[places]) for track, (rows, places) in enumerate(self.places)]
        return soundness_by_column(self.columns, self.given_tracks, self.cleaned_tracks, judged)

    def _densities(self, values: np.ndarray) -> np.ndarray:
        """The logarithm of the density of all plots but the first of a track, given those before, by their numbers."""
        from radarsim.kernels.lanes import rows

        _, numbers, compiled = self._compiled(values, several_laws=False)
        result = np.zeros((len(self.recording.kinds), len(self.columns)))
        work = [rows(n) for n in (compiled.rows, 1, len(self.study.measured), len(self.columns))]
        compiled.kernel(*self.recording, numbers, *work, result)
        with np.errstate(invalid="ignore"):
            return np.diff(result.sum(axis=0), prepend=0.0)

    def _scores(self, values: np.ndarray, law: ErrorLaw) -> tuple[np.ndarray, np.ndarray]:
        """The logarithms of the densities (n,) of all plots but the first of a track, given those before, and the
        probabilities (n, m) of their numbers to be no outliers."""
        from radarsim.kernels.lanes import rows

        c, numbers, compiled = self._compiled(values, several_laws=True)
        measured = [number.column for number in self.study.measured]
        used = [measured.index(name) for name in self.columns]
        laws = plot_laws(law, sigmas(self.steps, c, len(measured)), self.spans.tolist(), used)
        scores, soundness = np.zeros(len(self.recording.kinds)), np.ones((len(self.recording.kinds), len(used)))
        states = [compiled.rows * count for count in (1, len(laws.chances), 1)]
        work = tuple(rows(n) for n in (compiled.rows, 1, len(measured), len(used), *states, 1, 1))
        compiled.kernel(self.recording, numbers, laws, work, scores, soundness)
        return scores, soundness

    def _compiled(self, values: np.ndarray, several_laws: bool) -> tuple[Any, np.ndarray, CompiledLikelihood]:
        """The numbers of the filter with these values of the keys, as it has them and as an array, and its kernel."""
        with study_context(self.study.name), np.errstate(all="ignore"):
            config = self._config(values)
            c = call_user_function(self.steps.design, *config)
            numbers, choices = to_numbers(c), (formula_choices(c), several_laws)
            if choices not in self.kernels or not np.isfinite(numbers).all():
                record(self.steps.design, *config)  # refuses what no kernel can take
                counts = len(self.study.measured), len(self.columns)
                self.kernels[choices] = compile_likelihood(self.steps, c, *counts, several_laws)
            return c, numbers, self.kernels[choices]


def unwrap_angles(study: "StepStudy", columns: Sequence[str], track: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """A track with its angles less whole turns from row to row."""
    unwrapped = dict(track)
    for name in (m.column for m in study.measured if m.unit == "rad" and m.column in columns):
        is_finite = np.isfinite(track[name])
        unwrapped[name] = track[name].copy()
        unwrapped[name][is_finite] = np.unwrap(track[name][is_finite])
    return unwrapped


class Recording(NamedTuple):
    """The rows of all tracks, one after the other, as `radarsim.kernels.step_likelihood` takes them."""

    kinds: np.ndarray
    intervals: np.ndarray
    plots: np.ndarray


def join_tracks(
    study: "StepStudy", spec: Any, columns: Sequence[str], tracks: Sequence[Mapping[str, np.ndarray]]
) -> tuple[Recording, list[tuple[np.ndarray, np.ndarray]]]:
    """The rows of tracks, each from its first complete plot on, with the scans missed between them; and of each track
    the rows that have a later plot, and where they are."""
    from radarsim.kernels.step_likelihood import PLOT, PREDICT, START

    period, kinds, intervals, plots = study.scan_period_s(spec), list[int](), list[float](), []
    places = []
    for track in tracks:
        measured = [track[m.column] if m.column in columns else np.zeros(len(track["t_s"])) for m in study.measured]
        z, last, rows = np.transpose(measured), math.nan, list[tuple[int, int]]()
        is_whole = np.isfinite(z).all(axis=1)
        for row in range(int(is_whole.argmax()) if is_whole.any() else len(z), len(z)):
            time, is_first = float(track["t_s"][row]), math.isnan(last)
            missed = missed_scan_times(last, time, period)
            kinds += [*[PREDICT] * len(missed), START if is_first else PLOT if is_whole[row] else PREDICT]
            plots += [*np.zeros((len(missed), z.shape[1])), np.where(is_whole[row], z[row], 0.0)]
            intervals += np.diff([time if is_first else last, *missed, time]).tolist()
            if kinds[-1] == PLOT:
                rows.append((row, len(kinds) - 1))
            last = time
        of_rows, of_recording = np.array(rows, dtype=np.int64).reshape(-1, 2).T
        places.append((of_rows, of_recording))
    numbers = np.array(plots).reshape(-1, len(study.measured))
    return Recording(np.array(kinds, dtype=np.int64), np.array(intervals), numbers), places
