"""Linear filters over recorded plots, and the likelihood of tracks."""

from collections.abc import Mapping, Sequence
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.studies.error_law import CORRELATION, MANOEUVRES, OUTLIERS, STATED_ERRORS, ErrorLaw
from radarsim.studies.gross_errors import data_span, soundness_by_column
from radarsim.studies.linear_design import period
from radarsim.studies.missed_scans import WHOLE_PERIODS, missed_scan_times
from radarsim.studies.recording_interface import Track, track_batches, usual_interval_s

if TYPE_CHECKING:
    from radarsim.studies.linear import LinearStudy


ZERO_SHARE = 1e-6  # of a fitted key's stated value: what counts as zero


class RowModel:
    """A filter's model over rows of recorded plots, whatever the times between them: a missed row is an empty one."""

    def __init__(self, study: "LinearStudy", spec: Any, filter_keys: Any):
        self.study, self.spec, self.filter_keys = study, spec, filter_keys
        self.columns = study.columns(spec, filter_keys)
        self.matrices = study.matrices(spec, filter_keys)
        self.period = period(self.matrices.H, self.matrices.R)
        self.scan_period_s = study.scan_period_s(spec)

    def scan_numbers(self, last: int, dt: np.ndarray) -> np.ndarray:
        """The numbers of the scans of rows (n,) by the times since the row before each, after the scan `last`."""
        return last + np.cumsum(np.maximum(np.rint(dt / self.scan_period_s), 1.0)).astype(int)

    def numbers(self, columns: Mapping[str, np.ndarray], n: int) -> np.ndarray:
        """The numbers z (n, D), NaN where a column is absent."""
        none = np.full(n, np.nan)
        return np.stack([columns.get(name, none) for name in self.columns], axis=1)

    def moves(self, dt: np.ndarray, spec: Any = None) -> tuple[np.ndarray, np.ndarray]:
        """F and Q (n, n, n) over times: over missed scans scan by scan; over a time of zero the state stays."""
        motion, n = self.study.assumed_motion(spec or self.spec, self.filter_keys), self.matrices.x.size
        times, places = np.unique(dt, return_inverse=True)
        F, Q = np.tile(np.eye(n), (times.size, 1, 1)), np.zeros((times.size, n, n))
        steps = [np.diff([0.0, *missed_scan_times(0.0, t, self.scan_period_s), t]) for t in times.tolist()]
        for place in np.flatnonzero(times != 0):
            first = steps[place][0]
            F_scan, Q_scan = self._move(motion, first)
            F[place], Q[place] = F_scan, Q_scan
            for step in steps[place][1:]:
                if abs(step - first) > WHOLE_PERIODS * self.scan_period_s:
                    F_scan, Q_scan = self._move(motion, step)
                F[place], Q[place] = F_scan @ F[place], F_scan @ Q[place] @ F_scan.T + Q_scan
        return F[places], Q[places]

    def _move(self, motion: Any, t: float) -> tuple[np.ndarray, np.ndarray]:
        """F and Q (n, n) over a time, in one step."""
        n = self.matrices.x.size
        F, Q = (
            self.study._array(f"assumed_motion: {name}(dt)", self.study.call(function, float(t)), n, n)
            for name, function in (("F", motion.F), ("Q", motion.Q))
        )
        if np.linalg.eigvalsh(Q)[0] < 0:
            self.study._covariance(f"assumed_motion: Q({t:g} s)", Q, n)
        return F, Q

    def rows(self, scans: np.ndarray, spec: Any = None) -> tuple[np.ndarray, np.ndarray]:
        """H (n, D, d) and R (n, D) of rows by the numbers of their scans (n,)."""
        if spec is None and self.period < len(self.matrices.H):
            phases = scans % self.period
            return self.matrices.H[phases], self.matrices.R[phases]
        plots = [self.study.assumed_plot(spec or self.spec, self.filter_keys, k) for k in scans.tolist()]
        H = np.stack([np.atleast_2d(row) for row, _ in plots]).astype(float)
        return H, np.stack([np.atleast_1d(sigma) for _, sigma in plots]).astype(float) ** 2

    def gains(self, k: np.ndarray) -> np.ndarray:
        """A filter's own gains at rows by the numbers of their scans (n,); after its last scan those of the last period
        repeat."""
        scans = len(self.matrices.gains)
        last = scans - min(self.period, scans)
        return self.matrices.gains[np.where(k < scans, k, last + (k - last) % (scans - last))]


class LinearTracker:
    """The filters of a case over recorded plots, chunk by chunk in constant memory.

    The first row is the first scan: there the state is as in the config. A filter none of whose columns are in the file
    has no estimates."""

    most_rows: int | None = None
    several = False

    def __init__(self, study: "LinearStudy", spec: Any):
        self.study, self.names = study, tuple(keys.name for keys in spec.filters)
        self.filters = [RowModel(study, spec, keys) for keys in spec.filters]
        self.states = [(rows.matrices.x.copy(), rows.matrices.P.copy()) for rows in self.filters]
        self.last_scan, self.last = -1, np.nan

    def feed(self, columns: Mapping[str, np.ndarray]) -> Track:
        """The estimates over the next rows: columns (n,), NaN where a value is missing."""
        t = columns["t_s"]
        dt = np.diff(t, prepend=t[0] if np.isnan(self.last) else self.last)
        scans = self.filters[0].scan_numbers(self.last_scan, dt)
        results = [
            self._follow(rows, *state, dt, scans, columns)
            for rows, state in zip(self.filters, self.states, strict=True)
        ]
        self.last_scan, self.last = int(scans[-1]), t[-1]
        out, residual = (np.stack([result[i] for result in results]) for i in range(2))
        states, components = self.filters[0].matrices.x.size, len(self.study.components)
        measured = self.study.measured
        return Track(
            filters=self.names,
            components=tuple((component.name, component.unit) for component in self.study.components),
            t_s=t,
            estimate=out[..., :components],
            sigma=out[..., states : states + components],
            measured=tuple((number.column, number.unit) for number in measured),
            residual=residual,
            tested=tuple((number.column, 1) for number in measured),
            nis=out[..., 2 * states :],
        )

    def _follow(
        self,
        model: RowModel,
        x: np.ndarray,
        P: np.ndarray,
        dt: np.ndarray,
        scans: np.ndarray,
        columns: Mapping[str, np.ndarray],
    ) -> tuple[np.ndarray, np.ndarray]:
        """The result of `linear_recorded.filter_recorded` for a filter, and its residuals (n, D)."""
        from radarsim.kernels import linear_recorded

        rows, z = len(dt), model.numbers(columns, len(dt))
        (F, Q), (H, R) = model.moves(dt), model.rows(scans)
        out, has_number = np.full((rows, 2 * x.size + z.shape[1]), np.nan), np.isfinite(z)
        gains = model.gains(scans) if model.matrices.has_own_gains else np.zeros_like(H)
        linear_recorded.filter_recorded(
            x, P, F, Q, H, R, gains, not model.matrices.has_own_gains, np.where(has_number, z, 0.0), has_number, out
        )
        if not any(name in columns for name in model.columns):
            out[:] = np.nan
        return out, z - np.einsum("kdn,kn->kd", H, out[:, : x.size])


class PlotLikelihood:
    """The likelihood of tracks under a filter's model, by the keys that the study names as `fitted`. The state at the
    first plot is as in the config."""

    explains: tuple[str, ...] = (OUTLIERS, CORRELATION, MANOEUVRES)

    def __init__(self, study: "LinearStudy", spec: Any, track: Any, tracks: Sequence[Mapping[str, np.ndarray]]):
        self.spec, self.filter, self.model = spec, track.name, RowModel(study, spec, track)
        self.outlier_kinds = tuple(self.model.columns)
        self.far_kinds: tuple[str, ...] = ()
        self.has_offsets = True
        self.is_smooth = True
        self.tracks, self.rows = len(tracks), sum(len(track["t_s"]) for track in tracks)
        self.keys = study.fitted
        stated = [attrgetter(key)(spec) for key in self.keys]
        if None in stated:
            raise study._fault("fitted", f"{self.keys[stated.index(None)]} is not given")
        self.stated = np.array(stated, dtype=float)
        self.zero_limits = ZERO_SHARE * np.where(self.stated > 0, self.stated, 1.0)
        none = np.full(self.rows, np.nan)
        self.given_tracks = [
            {"t_s": track["t_s"], **{name: track.get(name, none[: len(track["t_s"])]) for name in self.model.columns}}
            for track in tracks
        ]
        self.span = data_span(self.given_tracks, self.model.columns)
        self.batches = [self._batch(batch) for batch in track_batches(tracks, lambda track: len(track["t_s"]))]
        self.usual_s = usual_interval_s(tracks)

    def _batch(self, tracks: Sequence[Mapping[str, np.ndarray]]) -> "_Batch":
        """Tracks for the kernel."""
        lengths = np.array([len(track["t_s"]) for track in tracks])
        intervals = [np.diff(track["t_s"], prepend=track["t_s"][0]) for track in tracks]
        scans = [self.model.scan_numbers(-1, dt) for dt in intervals]
        z = [self.model.numbers(track, len(track["t_s"])) for track in tracks]
        return _Batch(lengths, np.concatenate(intervals), np.concatenate(scans), np.concatenate(z))

    def _batch_scores(self, values: np.ndarray, law: ErrorLaw) -> list[tuple["_Batch", np.ndarray, np.ndarray]]:
        """For each batch of tracks the log-densities (n, D) of its numbers, and their probabilities to be no
        outliers."""
        from radarsim.kernels.likelihood import log_likelihood_of_tracks, with_lasting_errors

        spec, correlation = self.spec, law.correlation
        outliers = law.outlier_rows(len(self.model.columns))
        for key, value in zip(self.keys, values, strict=True):
            spec = _changed(spec, key.split("."), float(value))
        start = self.model.study.assumed_motion(spec, self.model.filter_keys)
        result = []
        for batch in self.batches:
            count, z = len(batch.lengths), batch.z
            (F, Q), (H, R) = self.model.moves(batch.intervals, spec), self.model.rows(batch.scans, spec)
            x, P = (np.array([value] * count, dtype=float) for value in (start.mean, start.covariance))
            model, white, has_number = (x, P, F, Q, H), 1.0, np.isfinite(z)
            if correlation:
                first, shares_left = np.zeros((x.shape[1], z.shape[1])), correlation ** (batch.intervals / self.usual_s)
                model, white = with_lasting_errors(x, P, first, F, Q, H, R, shares_left), 0.0
            score, soundness = np.empty((2, *z.shape))
            numbers = np.where(has_number, z, 0.0), R, has_number
            errors = outliers, np.zeros(count, dtype=np.int64), law.manoeuvres, self.span, white
            log_likelihood_of_tracks(batch.lengths, *model, *numbers, 1.0, *errors, score, soundness)
            result.append((batch, score, soundness))
        return result

    def _scores(self, values: np.ndarray, law: ErrorLaw) -> np.ndarray:
        """Sums over all tracks for each number of a plot."""
        total: np.ndarray = np.zeros(len(self.model.columns))
        for _, score, _ in self._batch_scores(values, law):
            total += score.sum(axis=0)
        return total

    def __call__(self, values: np.ndarray, law: ErrorLaw = STATED_ERRORS) -> float:
        """The logarithm of the likelihood."""
        return float(self._scores(values, law).sum())

    def soundness(self, values: np.ndarray, law: ErrorLaw) -> list[dict[str, np.ndarray]]:
        """The probability of each number that it is no outlier."""
        parts = [
            part
            for batch, _, soundness in self._batch_scores(values, law)
            for part in np.split(soundness, np.cumsum(batch.lengths)[:-1])
        ]
        judged = [(i, np.arange(len(part)), part) for i, part in enumerate(parts)]
        return soundness_by_column(self.model.columns, self.given_tracks, self.given_tracks, judged)

    def by_number(self, values: np.ndarray) -> dict[str, float]:
        """The sums of each number of a plot."""
        return dict(zip(self.model.columns, self._scores(values, STATED_ERRORS).tolist(), strict=True))


class _Batch(NamedTuple):
    """Tracks for the kernel, one after the other: the numbers of their rows; of each row the time since the row before,
    the number of its scan, and what it measured (n, D)."""

    lengths: np.ndarray
    intervals: np.ndarray
    scans: np.ndarray
    z: np.ndarray


def _changed(model: Any, path: Sequence[str], value: float) -> Any:
    """A config's keys with another value of the key at a path."""
    key, *remaining_path = path
    return model.model_copy(
        update={key: _changed(getattr(model, key), remaining_path, value) if remaining_path else value}
    )
