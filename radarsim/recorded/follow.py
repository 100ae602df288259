"""The filters of an experiment over recorded plots, and a simulated realisation's plots to try them on.

Whether estimates after a long gap are more than rounding: the same plots are filtered again with times stretched by
10⁻¹⁰. A covariance extrapolated over a gap can be so much larger than a plot's that the estimate's, their difference,
has no digit left: σ comes out wrong, zero or not at all. Stretched times change correct values in the tenth digit, and
rounding altogether. Only the rows after a gap are compared: a multiple-model filter that has lost its target magnifies
any difference by itself.

The plots of many realisations in a file: arrays of NumPy (.npz), or one row a plot as Parquet or CSV. Memory does not
grow with their number."""

import os
import shlex
import zipfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.linalg import LinAlgError

from radarsim.config.case_choice import case_choice
from radarsim.config.experiment import Case, Experiment
from radarsim.config.fields import unknown_to
from radarsim.config.schema import LARGEST_REALISATIONS
from radarsim.engine.results import Track
from radarsim.errors import ConfigError, PlotFault, argument
from radarsim.recorded import plots
from radarsim.recorded.plots import Places, Thinned, cells
from radarsim.report.files import Writer
from radarsim.studies import outside
from radarsim.studies.interface import Drawn, RecordedPlots, Tracker, true_column
from radarsim.studies.registry import module as home_of
from radarsim.studies.registry import study
from radarsim.threads import mapping

# ---- rounding --------------------------------------------------------------------------------------------------------
STRETCH = 1 + 2.0**-33
SIGMA, ESTIMATE, CHANCE = 1e-5, 1e-3, 1e-3  # permitted changes by stretched times: of σ, in σ, in probability
WIDE, PERIODS = 30.0, 1000.0  # a gap in median intervals so far, or in the config's scan periods
AFTER = 100  # rows compared after a gap
LENGTHS = ("m", "rad")  # units of measured numbers, which are never known exactly


class Twin:
    """A second tracker beside the first, and the longest interval before the first loss."""

    def __init__(self, tracker: Tracker, period_s: float):
        self.tracker, self.period_s, self.whole = tracker, period_s, tracker.most_rows is not None
        self.origin: float | None = None  # the first time
        self.seen: list[float] = []  # the last time of each measured number
        self.usual = np.inf  # the longest interval that is no gap
        self.rows, self.compared, self.gap_s, self.gap_row = 0, 0, 0.0, 0

    def lost(self, columns: dict[str, np.ndarray], track: Track) -> bool:
        """Whether the track (of the first tracker) over the next rows has lost its digits. Then `gap_s` is the longest
        interval so far and `gap_row` the row, from 0, that ends it."""
        t, *measured = columns.values()
        if self.origin is None:
            self.origin, self.seen = float(t[0]), [float(t[0])] * len(measured)
            rises = np.diff(t)[np.diff(t) > 0]
            self.usual = min(WIDE * np.median(rises) if rises.size else np.inf, PERIODS * self.period_s)
        steps = self._steps(t, measured)
        compared = self._after(steps > self.usual)
        bad = np.zeros(len(track.t_s), dtype=bool)
        if compared.any() or not self.whole:
            with np.errstate(all="ignore"):
                other = self.tracker.feed(columns | {"t_s": (t - self.origin) * STRETCH})
            # Several plots of one time make one row of the track.
            bad = unlike(track, other) & np.isin(track.t_s, t[compared])
        first = np.searchsorted(t, track.t_s[bad.argmax()], side="right") if bad.any() else len(t)
        longest = int(steps[:first].argmax())
        if steps[longest] > self.gap_s:
            self.gap_s, self.gap_row = float(steps[longest]), self.rows + longest
        self.rows += len(t)
        return bool(bad.any())

    def _steps(self, t: np.ndarray, measured: list[np.ndarray]) -> np.ndarray:
        """The time (n,) since the last row with the numbers that a row has: the longest over these, zero where none."""
        longest = np.zeros(len(t))
        for j, column in enumerate(measured):
            present = np.isfinite(column)
            until = np.maximum.accumulate(np.where(present, t, self.seen[j]))
            before = np.concatenate([[self.seen[j]], until[:-1]])
            longest, self.seen[j] = np.maximum(longest, np.where(present, t - before, 0.0)), float(until[-1])
        return longest

    def _after(self, wide: np.ndarray) -> np.ndarray:
        """Which rows (n,) are among those after a gap."""
        n = len(wide)
        ends = np.maximum.accumulate(np.where(wide, np.arange(n) + AFTER, self.compared))
        self.compared = int(ends[-1]) - n
        return np.arange(n) < ends


def unlike(track: Track, other: Track) -> np.ndarray:
    """Which rows (n,) of two tracks differ by more than permitted, or hold an impossible σ."""
    if track.estimate.shape != other.estimate.shape:
        return np.ones(len(track.t_s), dtype=bool)
    known, sigma = np.isfinite(track.estimate), track.sigma
    length = np.array([unit in LENGTHS for _, unit in track.components])
    with np.errstate(all="ignore"):
        bad = known & (~np.isfinite(sigma) | (length & (sigma <= 0)))
        bad |= known != np.isfinite(other.estimate)
        # NaN differs from every number: hence "not within" in place of "beyond".
        bad |= known & ~(np.abs(sigma - other.sigma) <= SIGMA * sigma)
        bad |= known & (sigma > 0) & ~(np.abs(track.estimate - other.estimate) <= ESTIMATE * sigma)
        rows = bad.any(axis=(0, 2))
        if track.probability is not None and other.probability is not None:
            alike = np.isclose(track.probability, other.probability, rtol=0, atol=CHANCE, equal_nan=True)
            rows |= ~alike.all(axis=(0, 2))
    return rows


# ---- follow ----------------------------------------------------------------------------------------------------------
GAP = 3.0  # in median intervals
BEFORE = 10  # first estimates of a filter, which are not compared with the truth
SAMPLE, BLOCK = 5000, 100  # rows of a track kept for the advice, in blocks that follow each other
BY_ROW = ("estimate", "sigma", "probability", "residual", "nis", "score", "residual_sigma")  # arrays (F, n, …)


def recorded_of(case: Case) -> RecordedPlots:
    """The recorded-plots interface of a case's study, which `one_case` has checked for."""
    found = study(case.study).recording_interface()
    assert found is not None
    return found


Part = Literal["tracker", "simulated", "drawing", "likelihood"]


def borrowed(case: Case, part: Part) -> list[str]:
    """The keys of a case, dotted, that an inherited part of its study does not know: its keys extend another's."""
    of = recorded_of(case)
    module = getattr(of, part).__module__
    if module == RecordedPlots.__module__ or of.of_any_keys:  # of no study: it does nothing
        return []
    if f"{module}.".startswith(f"{home_of(case.study)}."):  # of the study itself
        return []
    packages = module.split(".")
    return unknown_to(case.spec, ".".join(packages[:3] if packages[0] == "radarsim" else packages[:1]))


def refuse_borrowed(case: Case, part: Part) -> None:
    """Raise ConfigError where an inherited part of a study would ignore keys that it does not know."""
    if keys := borrowed(case, part):
        of = getattr(recorded_of(case), part).__module__
        raise ConfigError(
            f"study {case.study}: its part `{part}` of recorded plots is that of {of}, which does not know "
            f"{', '.join(keys)}: it must have one of its own"
        )


def one_case(experiment: Experiment, what: str, command: str) -> Case:
    """The one case of an experiment, of a study with plots; raises ConfigError.

    what (the purpose) and command are for the fault, which lists the choices; {} in the command is the config."""
    place = experiment.path or experiment.stem
    if len(experiment.cases) > 1:
        count = len(experiment.cases)
        raise ConfigError(f"{place}: must be one case to {what}, got {count}; {case_choice(experiment, command)}")
    (case,) = experiment.cases
    if study(case.study).recording_interface() is None:
        if what == "simulate":
            raise ConfigError(f"{place}: study: {case.study} draws no plots: its filters take bursts of pulses")
        raise ConfigError(f"{place}: study: {case.study} has no filters for recorded plots")
    return case


def simulated(experiment: Experiment, realisation: int = 0) -> dict[str, np.ndarray]:
    """The plots of one realisation of an experiment's one case, exactly those of a run, and the truth as true_….
    Columns of equal length, NaN where a plot is missed. Raises ConfigError for a realisation outside every run."""
    if not 0 <= realisation < LARGEST_REALISATIONS:
        raise ConfigError(f"realisation: must be from 0 to {LARGEST_REALISATIONS - 1}, got {realisation}")
    case = case_with_plots(experiment)
    return dict(recorded_of(case).simulated(case, realisation))


def case_with_plots(experiment: Experiment) -> Case:
    """An experiment's one case, of a study that draws plots; raises ConfigError."""
    case = one_case(experiment, "simulate", "radarsim simulate {} -o PLOTS.csv")
    refuse_borrowed(case, "simulated")
    refuse_borrowed(case, "drawing")
    return case


def batches(experiment: Experiment, n: int, first: int = 0, chunk: int | None = None) -> Iterator[Drawn]:
    """The plots of n realisations of an experiment's one case from number `first` on, chunk by chunk, in flat memory.
    Raises ConfigError, at once, for realisations that no run has."""
    given = {"n": (n, 1), "first": (first, 0), "chunk": (n if chunk is None else chunk, 1)}
    n, first, size = (_whole(name, *one) for name, one in given.items())
    if first + n > LARGEST_REALISATIONS:
        what = argument("first + n", "--realisations: STOP")
        raise ConfigError(f"{what}: must be at most {LARGEST_REALISATIONS}, got {first + n}")
    case = case_with_plots(experiment)
    plots, last, of = recorded_of(case), first + n, study(case.study)
    world = cache(lambda: outside.world_of(of, case, plots.drawn(case, first, 1), of.prepare(case).axes.components))
    own: dict[str, Any] = {"seed": case.seed, "known": world}
    return (replace(plots.drawn(case, i, min(size, last - i)), **own) for i in range(first, last, size))


def _whole(name: str, value: Any, least: int) -> int:
    """A whole number, which may be a float; raises ConfigError."""
    number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    if not number or not float(value).is_integer() or value < least:
        raise ConfigError(f"{name}: must be a whole number >= {least}, got {value!r}")
    return int(value)


@dataclass
class Tally:
    """Number of tests of a filter's innovations, and the sum of their normalised squares."""

    filter: str
    name: str
    freedom: int
    count: int = 0
    total: float = 0.0

    @property
    def mean(self) -> float:
        """For each degree of freedom: 1 for a consistent filter."""
        return self.total / (self.count * self.freedom) if self.count else np.nan


@dataclass
class Errors:
    """A filter's errors against the truth in one component: number, sum of squares, and sum of squares over the
    filter's variances. The first BEFORE estimates, those of its start, are left out."""

    filter: str
    component: str
    unit: str
    seen: int = 0
    count: int = 0
    squares: float = 0.0
    normed: float = 0.0

    def add(self, error: np.ndarray, sigma: np.ndarray) -> None:
        """Count errors (n,) with the filter's standard deviations (n,); not-a-number where it gives none."""
        skip = max(0, BEFORE - self.seen)
        self.seen += len(error)
        error, sigma = error[skip:], sigma[skip:]
        self.count += len(error)
        self.squares += float((error**2).sum())
        self.normed += float(((error / sigma) ** 2).sum())

    @property
    def rms(self) -> float:
        """Root of the mean square error, in the component's unit."""
        return (self.squares / self.count) ** 0.5 if self.count else np.nan

    @property
    def ratio(self) -> float:
        """Root of the mean square error in the filter's standard deviations: 1 for a consistent filter."""
        return (self.normed / self.count) ** 0.5 if self.count else np.nan


@dataclass
class Followed:
    """The filters over a file of plots: rows, time, gaps, missing values, tests; data for figures and checks."""

    case: Case
    rows: int = 0
    first_s: float = np.nan
    last_s: float = np.nan
    missing: dict[str, int] = field(default_factory=dict)
    gaps: int = 0
    longest_gap_s: float = 0.0
    longest_gap_at_s: float = np.nan
    tallies: dict[tuple[str, str], Tally] = field(default_factory=dict)
    estimating: set[str] = field(default_factory=set)
    drawn: Track | None = None  # thinned for figures
    thinned: Thinned = field(default_factory=Thinned)
    sample: "Sample" = field(default_factory=lambda: Sample())
    median_s: float = np.nan
    tracks: dict[str, "Followed"] = field(default_factory=dict)  # by name, where the file has several
    passed_over: int = 0  # rows of no track
    again: int = 0  # numbers of tracks that were used again, for another track
    doubles: int = 0  # further plots of a track in a scan, left out
    errors: dict[tuple[str, str], Errors] = field(default_factory=dict)  # by filter and component, with truth
    places: Places = field(default_factory=Places)  # places of the plots, for the plan view

    def take(self, columns: Mapping[str, np.ndarray], track: Track) -> None:
        """Count one more piece of the file."""
        t = columns["t_s"]
        self._gaps(np.unique(t))
        estimates = np.isfinite(track.estimate).any(axis=(1, 2))
        self.estimating |= {name for name, some in zip(track.filters, estimates, strict=True) if some}
        for name, column in list(columns.items())[1:]:
            self.missing[name] = self.missing.get(name, 0) + int(np.isnan(column).sum())
        nis = np.empty((len(track.filters), len(t), 0)) if track.nis is None else track.nis
        for q, (name, freedom) in enumerate(track.tested):
            for f, filter_name in enumerate(track.filters):
                known = nis[f, :, q]
                known = known[np.isfinite(known)]
                tally = self.tallies.setdefault((filter_name, name), Tally(filter_name, name, freedom))
                tally.count, tally.total = tally.count + known.size, tally.total + float(known.sum())
        self.sample.add(columns)
        kept = self.thinned.kept(len(track.t_s))
        self.drawn = rows_of(joined([self.drawn, track]) if self.drawn else track, np.flatnonzero(kept))
        self.rows += len(t)

    def compare(self, track: Track, t_s: np.ndarray, truth: Mapping[str, np.ndarray]) -> None:
        """Count the errors of a piece of the track; truth: columns (n,) `true_COMPONENT_UNIT` at times t_s (n,)."""
        rows = np.searchsorted(t_s, track.t_s)  # several plots of one time make one row of the track
        for c, (component, unit) in enumerate(track.components):
            column = truth.get(true_column(component, unit))
            if column is None:
                continue
            error = track.estimate[:, :, c] - column[rows]
            for f, name in enumerate(track.filters):
                known = np.isfinite(error[f]) & ~(track.sigma[f, :, c] <= 0)
                one = self.errors.setdefault((name, component), Errors(name, component, unit))
                one.add(error[f, known], track.sigma[f, known, c])

    @property
    def silent(self) -> list[str]:
        """The filters of the config that never had an estimate."""
        return [one.name for one in self.case.spec.members if one.name not in self.estimating]

    @property
    def untested(self) -> list[str]:
        """The filters with estimates that have no innovation to test: they give no covariance of it."""
        tested = {name for (name, _), tally in self.tallies.items() if tally.count}
        return [one.name for one in self.case.spec.members if one.name in self.estimating - tested]

    @property
    def without_plots(self) -> dict[str, list[str]]:
        """The filters that took no plot, as the file has none of their columns, with these."""
        of, spec = recorded_of(self.case), self.case.spec
        wanted = {one.name: list(of.columns_of(spec, one)) for one in spec.members}
        return {name: names for name, names in wanted.items() if names and self.sample.columns.keys().isdisjoint(names)}

    def _gaps(self, t: np.ndarray) -> None:
        if self.rows == 0:
            self.first_s = self.last_s = float(t[0])
            self.median_s = float(np.median(np.diff(t))) if len(t) > 1 else np.nan
        steps = np.diff(t, prepend=self.last_s)
        wide = steps > GAP * self.median_s
        self.gaps += int(wide.sum())
        if wide.any() and steps.max() > self.longest_gap_s:
            self.longest_gap_s, at = float(steps.max()), int(steps.argmax())
            self.longest_gap_at_s = float(t[at] - steps[at])
        self.last_s = float(t[-1])


def rows_of(track: Track, kept: np.ndarray) -> Track:
    """Some rows of a track, copied."""
    some: dict[str, Any] = {name: getattr(track, name)[:, kept] for name in BY_ROW if getattr(track, name) is not None}
    return replace(track, t_s=track.t_s[kept], **some)


def joined(parts: list[Track]) -> Track:
    """Tracks one after the other."""
    first = parts[0]
    whole: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts], axis=1)
        for name in BY_ROW
        if getattr(first, name) is not None
    }
    return replace(first, t_s=np.concatenate([part.t_s for part in parts]), **whole)


@dataclass
class Sample(Thinned):
    """Rows of a track, columns (n,), in blocks that follow each other."""

    most: int = SAMPLE
    block: int = BLOCK
    columns: dict[str, np.ndarray] = field(default_factory=dict)

    def add(self, columns: Mapping[str, np.ndarray]) -> None:
        """Add the next rows."""
        kept = self.kept(len(columns["t_s"]))
        before = self.columns or {name: column[:0] for name, column in columns.items()}
        self.columns = {name: np.concatenate([before[name], column])[kept] for name, column in columns.items()}

    def stretches(self) -> list[dict[str, np.ndarray]]:
        """The rows that follow each other, stretch by stretch: the whole track where no block was dropped."""
        ends = np.flatnonzero(np.diff(self.number) > 1) + 1
        parts = {name: np.split(column, ends) for name, column in self.columns.items()}
        return [{name: parts[name][i] for name in parts} for i in range(len(ends) + 1)]


class Follower:
    """The filters of a case over one track of a file of plots."""

    def __init__(self, case: Case, source: str | os.PathLike, name: str | None):
        of = recorded_of(case)
        self.source, self.name = source, name
        self.tracker, self.followed = of.tracker(case), Followed(case)
        self.twin = Twin(of.tracker(case), of.scan_period_s(case.spec))

    def feed(self, own: "Own") -> Track:
        """The estimates over the next rows of the track; raises ConfigError where they are only rounding errors, or a
        filter cannot take a row.

        The estimates are compared with the truth where its names match the components."""
        columns = own.columns
        try:
            track = self.tracker.feed(columns)
            lost = self.twin.lost(columns, track)
        except LinAlgError as error:
            fault = "intervals so different leave a filter's equations without solution"
            raise ConfigError(f"{self.source}: {self._named()}t_s: {fault}") from error
        except PlotFault as refused:
            raise ConfigError(f"{self._place(self.twin.rows + refused.row)}: {refused}") from refused
        if lost:
            fault = f"after a gap of {self.twin.gap_s:g} s a filter's numbers are lost in rounding: split the file here"
            raise ConfigError(f"{self._place(self.twin.gap_row)}: t_s: {fault}")
        self.followed.take(columns, track)
        self.followed.compare(track, columns["t_s"], own.truth)
        self.followed.places.add(columns["t_s"], own.places)
        return track

    def _place(self, row: int) -> str:
        if self.name is None:
            return plots.place_of(self.source, row)
        return f"{self.source}: {self._named()}row {row + 1} of it"

    def _named(self) -> str:
        return "" if self.name is None else f"track {self.name}: "


def follow(
    experiment: Experiment,
    source: str | os.PathLike,
    sink: Callable[[Track, str | None], None] = lambda track, name: None,
    threads: int | None = None,
    progress: Callable[[int], None] = lambda rows: None,
) -> Followed:
    """The filters of an experiment's one case over the recorded plots in a CSV file, piece by piece to `sink`.

    A file with a column `track` holds several tracks: each is filtered by itself, and the sink gets its name; rows
    without a name are skipped. Tracks run in several threads (all cores where None, none where 0), and reach the sink
    in the order of the file. Memory does not grow with a track's rows where the study's filters are recursive; others
    take a limited number of rows. progress is called with the rows done.

    Raises ConfigError for an experiment of several cases, a study without recorded plots, and faults in the file."""
    plots_named = shlex.quote(os.fspath(source)).replace("{", "{{").replace("}", "}}")
    case = one_case(experiment, "track with", f"radarsim track {{}} {plots_named}")
    refuse_borrowed(case, "tracker")
    of = recorded_of(case)
    tracker = of.tracker(case)
    size = tracker.most_rows or plots.CHUNK
    followers: dict[str | None, Follower] = {}
    passed_over = rows = again = doubles = 0
    with mapping(os.cpu_count() or 1 if threads is None else threads) as mapped:
        for piece in plots.pieces(source, of.columns(case.spec), size, tracker.several, of.from_any_origin):
            if followers and tracker.most_rows:
                raise ConfigError(f"{source}: must be of at most {size} rows for the study {case.study}")
            again, doubles = piece.again, piece.doubles
            named_parts = [own for own in by_track(piece) if own.name != ""]
            passed_over += len(piece.columns["t_s"]) - sum(own.rows for own in named_parts)
            for own in named_parts:
                if own.name not in followers:
                    followers[own.name] = Follower(case, source, own.name)
            done = mapped(lambda own: followers[own.name].feed(own), named_parts)
            for own, track in zip(named_parts, done, strict=True):
                sink(track, own.name)
                rows += own.rows
                progress(rows)
    if not followers:
        raise ConfigError(f"{source}: track: must name the track of some rows, all {passed_over} are empty")
    found = {name: one.followed for name, one in followers.items()}
    return found[None] if None in found else replace(together(case, found, passed_over), again=again, doubles=doubles)


class Own(NamedTuple):
    """The rows of one track in a piece of a file: its name, None where tracks are not distinguished, and columns (n,)
    as in `plots.Piece`."""

    name: str | None
    columns: dict[str, np.ndarray]
    truth: dict[str, np.ndarray]
    places: dict[str, np.ndarray]

    @property
    def rows(self) -> int:
        """How many there are."""
        return len(self.columns["t_s"])


def by_track(piece: plots.Piece) -> list[Own]:
    """The rows of each track, in the order in which the tracks first appear."""
    tables = (piece.columns, piece.truth, piece.places)
    if piece.tracks is None:
        return [Own(None, *tables)]
    return [
        Own(name, *({key: column[rows] for key, column in columns.items()} for columns in tables))
        for name, rows in plots.grouped(piece.tracks).items()
    ]


def together(case: Case, found: Mapping[str | None, Followed], passed_over: int) -> Followed:
    """Sums over several tracks, and the drawings and checks of the longest of them."""
    longest = max(found.values(), key=lambda one: one.rows)
    whole = replace(longest, tallies={}, missing={}, estimating=set(), rows=0, gaps=0, errors={})
    whole.passed_over = passed_over
    whole.tracks = {str(name): one for name, one in found.items()}
    for one in found.values():
        whole.rows += one.rows
        whole.gaps += one.gaps
        whole.first_s, whole.last_s = min(whole.first_s, one.first_s), max(whole.last_s, one.last_s)
        if one.longest_gap_s > whole.longest_gap_s:
            whole.longest_gap_s, whole.longest_gap_at_s = one.longest_gap_s, one.longest_gap_at_s
        whole.estimating |= one.estimating
        for name, count in one.missing.items():
            whole.missing[name] = whole.missing.get(name, 0) + count
        for key, tally in one.tallies.items():
            sums = whole.tallies.setdefault(key, Tally(tally.filter, tally.name, tally.freedom))
            sums.count, sums.total = sums.count + tally.count, sums.total + tally.total
        for key, own in one.errors.items():
            total = whole.errors.setdefault(key, Errors(own.filter, own.component, own.unit))
            total.count, total.squares = total.count + own.count, total.squares + own.squares
            total.normed += own.normed
    return whole


# ---- bulk ------------------------------------------------------------------------------------------------------------
NUMBERS = 200_000  # drawn at a time: what a processor keeps near
Parts = Callable[[], Iterator[Drawn]]  # the plots, drawn anew at each call


def write_many(
    experiment: Experiment, n: int, first: int, path: str | os.PathLike, progress: Callable[[int, int], object]
) -> Drawn:
    """Write the plots of n realisations of an experiment's one case from number `first` on, in the format that the
    path's ending names, CSV by default. Returns those of the first ones.

    Raises ConfigError as `batches`, or where a format's package is missing; errors of `Writer`."""
    to = FORMATS.get(Path(path).suffix.lower(), to_csv)
    one = next(batches(experiment, n, first, chunk=2))
    size = max(8, NUMBERS // sum(array[0].size for array in one.arrays().values()))

    def parts() -> Iterator[Drawn]:
        for part in batches(experiment, n, first, size):
            yield part
            progress(part.first - first + part.n, n)

    with Writer(path, {"the config": experiment.path}) as file:
        to(file, one, parts, n)
    return one


def to_npz(file: Writer, one: Drawn, parts: Parts, n: int) -> None:
    """`seed`, `t_s` (K,), `realisation` (n,), and each array (n, K) or (n, K, M); (1, K) where all have the same. One
    array after the other, so that the plots are drawn as often as there are arrays."""
    widest = max(array.shape[2] for part in parts() for array in part.columns.values()) if one.several else 0
    first, alone = {"realisation": np.arange(one.n), **one.arrays()}, {"t_s": one.t_s, "seed": np.array(one.seed)}
    alone |= {name: array[:1] for name, array in first.items() if array.strides[0] == 0}
    with zipfile.ZipFile(file.binary, "w") as archive:
        for name, array in (first | alone).items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                if name in alone:
                    np.lib.format.write_array(member, np.asarray(array, order="C"))
                    continue
                shape = (n, *array.shape[1:2], *[widest] * (array.ndim - 2))
                header = {"descr": np.lib.format.dtype_to_descr(array.dtype), "fortran_order": False, "shape": shape}
                np.lib.format.write_array_header_1_0(member, header)
                for part in parts():
                    values = part.arrays().get(name, np.arange(part.first, part.first + part.n))
                    if values.ndim == 3:
                        more = widest - values.shape[2]
                        values = np.pad(values, ((0, 0), (0, 0), (0, more)), constant_values=np.nan)
                    member.write(values.tobytes())


def to_csv(file: Writer, one: Drawn, parts: Parts, n: int) -> None:
    """The rows of all realisations, with the number of each in the column `realisation`."""
    file.write([tuple(one.table())])
    for part in parts():
        file.write(zip(*map(cells, part.table().values()), strict=True))


def to_parquet(file: Writer, one: Drawn, parts: Parts, n: int) -> None:
    """The same rows as numbers."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        need = "Parquet needs pyarrow (pip install 'radarsim[parquet]'); .npz and .csv do not"
        raise ConfigError(f"{file.path}: {need}") from error
    schema = pyarrow.table(one.table()).schema
    with parquet.ParquetWriter(file.binary, schema) as rows:
        for part in parts():
            rows.write_table(pyarrow.table(part.table(), schema))


FORMATS = {".npz": to_npz, ".parquet": to_parquet}  # beside CSV
