"""The config's numbers from recorded plots, by the likelihood of a filter's innovations.

The filter's predictions give each plot a density; their product is the likelihood of the filter's parameters (Schweppe
1965). Estimates maximise it; an interval holds the values of a key at which the largest likelihood over all other keys
is within half the 95 % point of chi-square of the maximum (profile likelihood). Beside the keys the plots may have
outliers, a bias, or errors correlated from plot to plot. Where outliers or correlation are plain, they are fitted too.

Whether recorded velocities are folded: from the ranges of the same plots, whatever a config states of their errors. A
velocity ambiguous by a span D lies within half of it, and differs from the rate of the range by a whole number of
spans. So if no velocity exceeds A / 2 in size, the span is A at least, and a range that changes faster than A / 2
proves folding. The span follows from the differences, as far as they determine it. A common error of all velocities
does not look like that: it shows in the velocities themselves.

Errors in the config's numbers, if any, by the likelihood along each of them.

Each explanation alone (a σ, the manoeuvre variance, a bias of the velocity, outliers, errors correlated from plot to
plot) is fitted to the plots. The one that raises the likelihood most is named, if it raises it by more than chance does
in one recording of twenty, over all explanations; then the search continues with it included. A recording with correct
numbers yields: nothing wrong.

The filter used is the one that takes most columns of a plot. One that takes fewer says nothing about the rest, and may
predict the ranges best just because the velocities are bad."""

import itertools
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from radarsim.config.experiment import Case, Experiment
from radarsim.errors import ConfigError
from radarsim.language import speaking, tr
from radarsim.recorded import plots
from radarsim.recorded.follow import Followed, borrowed, by_track, one_case, recorded_of, refuse_borrowed
from radarsim.report.wording import significant_digits
from radarsim.studies.interface import BIAS, CORRELATION, EXPLANATIONS, OUTLIERS, Likelihood, Turning

# ---- along -----------------------------------------------------------------------------------------------------------
ROUGHLY = 0.01  # relative accuracy, of a key and of the likelihood, to which explanations are compared
LOWEST, HIGHEST = np.log(1e-4), np.log(1e4)  # of a key's factor
MOST_BIAS = 50.0  # in σ of the velocity
SHARES = {OUTLIERS: (1e-3, 0.4, 3.0), CORRELATION: (1e-3, 0.99, 0.0)}  # least, most, logit at the start of the search
FAR_FROM_ZERO = 1e4  # times the value of a key that counts as zero
IMPOSSIBLE = -1e300  # stands for the logarithm of zero likelihood: a search needs a number
TOP, END, BESIDE = 130, 15, 60  # likelihood evaluations of a key to the maximum and to an end; of an explanation
FURTHER = 1.5  # evaluations of a fit that allows for more, in those of the plain one
NOTHING: Mapping[str, float] = MappingProxyType({})
STARTS = (-2.0, 0.0, 2.0)  # of a search
Progress = Callable[[int, int | None], None]  # likelihoods computed, and their expected number where known


def silent(evaluations: int, expected: int | None = None) -> None:
    """Progress that is not shown."""


class Stages:
    """Progress of one fit after the other; further: whether a second one, which takes FURTHER times as many
    likelihoods, is known to follow."""

    def __init__(self, progress: Progress, further: bool):
        self.progress, self.further, self.before, self.done = progress, further, 0, 0

    def report(self, evaluations: int, expected: int | None = None) -> None:
        self.done = self.before + evaluations
        whole = expected and self.before + round(expected * (1 + FURTHER * self.further))
        self.progress(self.done, whole)

    def next(self) -> Progress:
        """The progress of a further fit."""
        self.before, self.further = self.done, False
        return self.report


def units(likelihood: Likelihood) -> np.ndarray:
    """Starting values of the keys: as stated; one stated as zero starts far above what counts as zero."""
    near_zero = np.asarray(likelihood.stated) <= likelihood.least
    return np.where(near_zero, FAR_FROM_ZERO * np.asarray(likelihood.least), likelihood.stated)


class Counted:
    """A likelihood that counts its evaluations."""

    def __init__(self, of: Likelihood, progress: Progress, count: int = 0, expected: int | None = None):
        self.of, self.progress, self.count, self.expected = of, progress, count, expected
        self.keys, self.stated = of.keys, of.stated

    def __call__(self, values: np.ndarray, explained: Mapping[str, float]) -> float:
        self.count += 1
        self.progress(self.count, self.expected and max(self.expected, self.count))
        return self.of(values, **explained)


def value(likelihood: Counted, changed: Mapping[str, float]) -> float:
    """The likelihood with some of the explanations applied."""
    stated = zip(likelihood.keys, likelihood.stated, strict=True)
    values = np.array([changed.get(key, value) for key, value in stated])
    found = likelihood(values, {what: changed[what] for what in EXPLANATIONS if what in changed})
    return found if np.isfinite(found) else IMPOSSIBLE


class Along:
    """A likelihood along some explanations, each on its search scale; others held at a value."""

    def __init__(self, likelihood: Counted, whats: Sequence[str], held: Mapping[str, float] = NOTHING):
        unit = dict(zip(likelihood.keys, units(likelihood.of).tolist(), strict=True))
        self.likelihood, self.held = likelihood, held
        self.scales = {what: _scale(what, unit) for what in whats}

    def searched(self, values: Mapping[str, float]) -> np.ndarray:
        return np.array([back(values[what]) for what, (_, back) in self.scales.items()])

    def natural(self, at: np.ndarray) -> dict[str, float]:
        return {what: of(x) for (what, (of, _)), x in zip(self.scales.items(), at, strict=True)}

    def __call__(self, at: np.ndarray) -> float:
        return value(self.likelihood, {**self.held, **self.natural(at)})


def best(
    likelihood: Counted, whats: Sequence[str], start: Mapping[str, float], held: Mapping[str, float] = NOTHING
) -> tuple[dict[str, float], float]:
    """The maximum of the likelihood along some explanations, others held, and its logarithm there: roughly, from three
    starts of the last one."""
    along, last = Along(likelihood, whats, held), whats[-1]
    tops = [climbed(along, {**start, last: along.scales[last][0](first)}) for first in STARTS]
    return max(tops, key=lambda top: top[1])


def climbed(along: Along, start: Mapping[str, float]) -> tuple[dict[str, float], float]:
    """The maximum reached from a start, and the log-likelihood there, roughly."""
    from scipy.optimize import minimize

    def cost(at: np.ndarray) -> float:
        return -along(at)

    at = along.searched(start)
    simplex = np.concatenate([at[None], at + 0.5 * np.eye(len(at))])
    options: Any = {"initial_simplex": simplex, "xatol": ROUGHLY, "fatol": ROUGHLY, "maxfev": 400}
    found = minimize(cost, at, method="Nelder-Mead", options=options)
    return along.natural(found.x), -float(found.fun)


def _scale(what: str, unit: dict[str, float]) -> tuple[Callable[[float], float], Callable[[float], float]]:
    """From the search scale to the value of an explanation, and back; unit: of each key."""
    if what == BIAS:
        return lambda x: float(np.clip(x, -MOST_BIAS, MOST_BIAS)), lambda value: value
    if what in SHARES:
        least, most, rare = SHARES[what]
        return (
            lambda x: float(np.clip(1 / (1 + np.exp(rare - x)), least, most)),
            lambda value: rare - float(np.log(1 / value - 1)),
        )
    return (
        lambda x: unit[what] * float(np.exp(np.clip(x, LOWEST, HIGHEST))),
        lambda value: float(np.log(value / unit[what])),
    )


# ---- doppler ---------------------------------------------------------------------------------------------------------
FINE = 1 / 8  # of the least span: the standard deviation required of the rate of the range
MOST = 0.6  # of the plots must have it
MOST_PLOTS = 1000  # examined at most
WIDEST = 2.0  # times its usual length that a window of plots may last
CLEAR = 4.0  # standard deviations by which a range changes faster than a velocity can be
LEAST_PLOTS, LEAST_SHARE_OF_PLOTS = 3, 0.1  # of the plots examined that must do so
CHANCE, FOUND = 1.0, 3.0  # standard deviations that distinguish whole spans from chance: for a known span, for any
VELOCITY = "velocity_mps"
STEPS = 200  # of a search for the span, in which the phase of the largest velocity turns once


@dataclass(frozen=True)
class Folding:
    """Folded velocities: the largest of them and the fastest rate of the ranges, m/s; the span, m/s, known or fitted to
    the plots, None where they do not determine it."""

    velocity_mps: float
    rate_mps: float
    span_mps: float | None
    known: bool


def folding(tracks: Sequence[Mapping[str, np.ndarray]], span_mps: float | None = None) -> Folding | None:
    """Whether the velocities of tracks, columns t_s, range_m and velocity_mps (n,), are folded; None where they are
    not, or where too few plots decide it. span_mps: the span, where known."""
    whole = [np.stack([one["t_s"], one["range_m"], one["velocity_mps"]]) for one in tracks]
    whole = [one[:, np.isfinite(one).all(axis=0)] for one in whole]
    fastest = max((float(np.abs(one[2]).max()) for one in whole if one.size), default=0.0)
    seen = _rates(whole, 2 * fastest)
    if seen is None:
        return None
    rates, velocities, sigma = seen
    off = rates - velocities
    beyond = int((np.abs(off) > fastest + CLEAR * sigma).sum())
    turned = np.median(np.abs(rates + velocities))  # with the other sign they are off by twice their size
    if beyond < max(LEAST_PLOTS, LEAST_SHARE_OF_PLOTS * off.size) or turned < 0.5 * np.median(np.abs(off)):
        return None
    span = _span(off, 2 * fastest)
    known = span_mps is not None and 2 * fastest <= span_mps * (1 + 1e-9)
    known = known and (span is None or bool(_whole(off, np.array([span_mps]))[0] > CHANCE))
    rate = float(np.abs(rates[np.abs(off) > fastest + CLEAR * sigma]).max())
    return Folding(fastest, rate, span_mps if known else span, known)


def folded(case: Case, tracks: Sequence[Mapping[str, np.ndarray]]) -> Folding | None:
    """Whether velocities of tracks, columns (n,) each, are folded although a case's study takes them as measured."""
    of = recorded_of(case)
    if VELOCITY not in tracks[0] or of.unfolds():
        return None
    return folding(tracks, of.span_mps(case.spec))


def said(found: Folding, case: Case | None = None) -> str:
    """The message that velocities are folded, with the settings that unfold them; case: of the radar, if known."""
    told = {
        "velocity": significant_digits(found.velocity_mps, "#.3g"),
        "rate": significant_digits(found.rate_mps, "#.3g"),
    }
    seen = tr(
        "the velocities are folded: none is beyond ±{velocity} m/s, and the ranges change by up to {rate} m/s", **told
    )
    span = "" if found.span_mps is None else significant_digits(found.span_mps, "#.3g")
    if found.span_mps is None:
        by = tr("the plots do not determine the span")
    elif found.known:
        by = tr("the config's span is {span} m/s", span=span)
    elif found.span_mps >= 4 * found.velocity_mps:
        by = tr("the plots suggest a span of about {span} m/s, or an integer fraction of it", span=span)
    else:
        by = tr("the plots suggest a span of about {span} m/s", span=span)
    parts = [seen, by]
    if case is None:
        parts.append(tr("with a config of the radar, `radarsim track` names the settings that unfold them"))
    elif settings := recorded_of(case).unfolding(case.spec, found.span_mps or float(f"{2 * found.velocity_mps:.4g}")):
        every = " ".join(f"--set {one}" for one in settings)
        parts.append(tr("for filters that unfold them: the same command with {settings}", settings=every))
    return "; ".join(parts)


def _rates(tracks: Sequence[np.ndarray], least: float) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """The rate of the range at plots, the velocities there, and the standard deviations of the rates, (m,) each: from
    parabolas through the smallest number of ranges around each that gives an accuracy of FINE for most of them; None
    where no number does."""
    half, total = 2, sum(one.shape[1] for one in tracks)
    every = max(total // MOST_PLOTS, 1)
    while least > 0:
        fits = [_parabolas(one, half, every) for one in tracks if one.shape[1] > 2 * half]
        rates, velocities, left, spread = np.concatenate([np.empty((4, 0)), *fits], axis=1)
        if not left.size:
            return None
        # The median of the residual squares of normal errors is about that of chi-square (Wilson and Hilferty).
        freedom = 2 * half - 2
        sigma = np.sqrt(np.median(left) / (freedom * (1 - 2 / (9 * freedom)) ** 3))
        fine = sigma * spread <= FINE * least
        if fine.mean() >= MOST:
            return rates[fine], velocities[fine], sigma * spread[fine]
        half += 1 + half // 4
    return None


def _parabolas(track: np.ndarray, half: int, every: int) -> np.ndarray:
    """Parabolas through the ranges of 2 half + 1 plots around each, at the ends of a track of the nearest ones: (4, m)
    slope there, velocity there, residual sum of squares, standard deviation of the slope for errors of 1 m."""
    size, (t, r, v) = 2 * half + 1, track
    usual = np.median(np.diff(t)) * (size - 1)
    rows = []
    for i in range(0, len(t), every):
        first = min(max(i - half, 0), len(t) - size)
        own = slice(first, first + size)
        scale = t[own][-1] - t[own][0]
        if 0 < scale <= WIDEST * usual:
            powers = ((t[own] - t[i]) / scale)[:, None] ** np.arange(3)
            inverse = np.linalg.pinv(powers)
            found = inverse @ (r[own] - r[i])
            left = r[own] - r[i] - powers @ found
            rows.append((found[1] / scale, v[i], left @ left, np.sqrt(inverse[1] @ inverse[1]) / scale))
    return np.array(rows).T.reshape(4, -1)


def _whole(off: np.ndarray, spans: np.ndarray) -> np.ndarray:
    """How clearly the velocities that are off (m,) by more than half a span are off by whole ones, for each span: the
    mean cosine of their phase, in its standard deviations for random phases; zero where there are none."""
    phase = np.abs(off)[None] / spans[:, None]
    folded = phase > 0.5
    count = folded.sum(axis=1)
    return np.where(folded, np.cos(2 * np.pi * phase), 0.0).sum(axis=1) / np.sqrt(np.maximum(count, 1) / 2)


def _span(off: np.ndarray, least: float) -> float | None:
    """The span, from the least one on, that fits the plots best; None where none does."""
    farthest = float(np.abs(off).max())
    lowest, highest = 1 / (2 * farthest), 1 / least
    spans = 1 / np.linspace(lowest, highest, 2 + int(STEPS * farthest * (highest - lowest)))
    clear = _whole(off, spans)
    return float(spans[clear.argmax()]) if clear.max() > FOUND else None


# ---- fit -------------------------------------------------------------------------------------------------------------
HALF_CHI2_95 = 1.9207294103470  # half the 95 % point of chi-square with one degree of freedom
LEAST_ROWS = 10  # of a track; shorter ones carry almost no information
FIRST_STEP, ROUGH = 0.3, 1e-4  # step of a search at its start, and its end before a restart, in the same logarithms
REACH = 1e4  # ratio to the estimate up to which an end of an interval is searched
# Accuracy of a maximum and of an interval's end, in the logarithm of a key; of the likelihood a tenth of that. Far
# finer than printed digits, since the path of a search depends on last digits, and these differ between processors.
CLOSE = 1e-6
STEP = 1e-3  # difference for a slope, in the logarithm of a key
WIDE_STEP = 1e-2  # the same during the search, where curvature is needed too
FLAT, LONGEST_STEP = 1e-3, 1.5  # curvature that counts as none, and the longest Newton step, in that logarithm
MOST_TOGETHER = 0.999  # of the correlation of two keys
MOST_STEPS = 40
SHORT_SIMPLEX = (50, 100, 200)  # evaluations of a simplex before Newton steps are tried again
RISES = np.array([2.0, 4.0, 6.0])  # below these a key that may be zero is clearly not zero, in that logarithm
FROM_ZERO = np.arange(1.0, 16.0)  # above what counts as zero: where a key at zero is tried
NEAR_ZERO = 7.0  # above the value that counts as zero, in that logarithm: zero is tried
ALMOST = 300.0  # times the accuracy: a Newton step that gains no more ends the search
LEAST_SHARE, MOST_SHARE = 1e-6, 0.5  # of outliers; fewer are none
MOST_OUTLIERS = 0.3  # of plots that may have ten times their σ; beyond, their errors follow another law
CORRELATION_TIME = "correlation_time_s"
NO_TIME = 1e-4  # of the usual interval: a correlation time that counts as zero
PLAIN = 5.4138  # gain of the log-likelihood by chance in one of 1000: half that point of chi-square
ROUGH_ROWS = 600  # on which the maximum is looked for before all are asked
LONGEST, SHORTEST = 100, 25  # rows of a stretch of a track, where not all are asked
NEAR = 30  # as TOP, from near the maximum
FINER, LEAP = 1e-3, 0.01  # factor on the value that counts as zero where the likelihood jumps by more there


@dataclass(frozen=True)
class Fitted:
    """One key: the best value, its 95 % interval, and whether the plots distinguish it from all other values.

    lo is 0 where the key may be zero, hi infinite where it has no upper end."""

    key: str
    stated: float
    value: float
    lo: float
    hi: float
    identifiable: bool


@dataclass(frozen=True)
class Fit:
    """The fit: filter, tracks and plots used, the keys, the share of outliers where allowed for, and the increase of
    the log-likelihood over the stated values; another explanation that the plots have: then the intervals do not hold;
    and the fit without outliers and correlation, where these are allowed for."""

    filter: str
    tracks: int
    rows: int
    keys: tuple[Fitted, ...]
    outliers: float | None
    gain: float
    beside: "Beside | None" = None
    plain: "Fit | None" = None
    doubles: int = 0  # further plots of a track in a scan, left out


class Beside(NamedTuple):
    """An explanation beside the keys, of EXPLANATIONS, its value, and the increase of the log-likelihood by it."""

    what: str
    value: float
    gain: float


class Correlated:
    """A likelihood with the correlation time of the errors as a further key, s: of an error a share exp(-t / it) is
    left after a time t (first-order Gauss-Markov process)."""

    def __init__(self, of: Likelihood):
        self.of, self.filter, self.tracks, self.rows, self.usual_s = of, of.filter, of.tracks, of.rows, of.usual_s
        self.keys, self.stated = (*of.keys, CORRELATION_TIME), np.append(of.stated, 0.0)
        self.least = np.append(of.least, NO_TIME * of.usual_s)
        self.explains = tuple(what for what in of.explains if what != CORRELATION)

    def __call__(self, values: np.ndarray, outliers: float = 0.0, bias: float = 0.0, correlation: float = 0.0) -> float:
        """The logarithm of the likelihood; `correlation` is that of the last of the values (n,), whatever is given."""
        return self.of(values[:-1], outliers, bias, math.exp(-self.usual_s / values[-1]) if values[-1] else 0.0)

    def by_number(self, values: np.ndarray) -> Mapping[str, float]:
        """The same for the keys alone, without correlation."""
        return self.of.by_number(values[:-1])


def some(tracks: Sequence[Mapping[str, np.ndarray]], most: int) -> list[Mapping[str, np.ndarray]]:
    """About `most` rows of tracks, columns (n,) each, spread over all tracks and their whole time: stretches of rows
    that follow each other; the tracks themselves where they have no more rows. Of very many tracks only some."""
    total = sum(len(one["t_s"]) for one in tracks)
    if total <= most:
        return list(tracks)
    length = min(max(most // len(tracks), SHORTEST), LONGEST)
    stretches = [
        {name: column[start : start + length] for name, column in one.items()}
        for one in tracks
        for start in _starts(len(one["t_s"]), length)
    ]
    count = min(max(round(most / length), 1), len(stretches))
    return [stretches[(2 * i + 1) * len(stretches) // (2 * count)] for i in range(count)]


def _starts(rows: int, length: int) -> list[int]:
    """The first rows of as many stretches of a length as fit into a track, spread evenly."""
    return np.rint(np.linspace(0, max(rows - length, 0), max(rows // length, 1))).astype(int).tolist()


def likelihood_of(
    experiment: Experiment, source: str | os.PathLike, filter_name: str | None = None
) -> tuple[Likelihood, Likelihood | None, int]:
    """The likelihood of a filter of an experiment's one case over all tracks of a file, and over a sample of its rows;
    without a name, of the filter that takes most columns of a plot. And how many further plots of a track in a scan are
    left out. Raises ConfigError."""
    case = one_case(experiment, "fit", f"radarsim fit {{}} {os.fspath(source)}")
    refuse_borrowed(case, "likelihood")
    of = recorded_of(case)
    names = [member.name for member in case.spec.members]
    if filter_name is not None and filter_name not in names:
        own = [one.name for one in case.outside]
        why = ": it is written in Python, and radarsim does not know its keys" if filter_name in own else ""
        raise ConfigError(f"filter: must be one of {', '.join(names)}; got {filter_name}{why}")
    tracks, doubles = _tracks(source, of.columns(case.spec), of.from_any_origin)
    long = [columns for columns in tracks if len(columns["t_s"]) >= LEAST_ROWS]
    if not long:
        raise ConfigError(f"{source}: must have a track of at least {LEAST_ROWS} rows")
    if same := [name for name in long[0] if name != "t_s" and all(np.ptp(one[name]) == 0 for one in long)]:
        raise ConfigError(f"{source}: {same[0]}: must differ between plots, or σ cannot be estimated; all are the same")
    found = of.likelihood(case, filter_name, long)
    folding = folded(case, long)
    if folding and found is not None and VELOCITY in found.by_number(np.asarray(found.stated)):
        with speaking("en"):  # as all faults
            raise ConfigError(f"{source}: {said(folding, case)}")
    if found is None:
        raise ConfigError(unlikely(case, filter_name, [name for name in names if of.likelihood(case, name, long)]))
    return found, of.likelihood(case, filter_name, some(long, min(ROUGH_ROWS, of.rows_asked))), doubles


def unlikely(case: Case, filter_name: str | None, others: Sequence[str]) -> str:
    """The fault that no likelihood exists; others: the filters for which the study has one."""
    if filter_name is not None and others:
        known = ", ".join(others)
        return f"filter: {filter_name} does not say how likely plots are, which fit needs; must be one of {known}"
    return (
        f"{case.name}: study {case.study} does not say how likely recorded plots are under "
        f"{'these filters' if filter_name is None else filter_name}, which fit needs; track takes them"
    )


def _tracks(
    source: str | os.PathLike, choices: Sequence[Sequence[str]], any_origin: bool
) -> tuple[list[dict[str, np.ndarray]], int]:
    """The columns (n,) of each track of a file of plots, and how many further plots of a scan are left out."""
    parts, doubles = dict[str | None, list[dict[str, np.ndarray]]](), 0
    for piece in plots.pieces(source, choices, any_origin=any_origin):
        doubles = piece.doubles
        for own in by_track(piece):
            if own.name != "":
                parts.setdefault(own.name, []).append(own.columns)
    whole = [{key: np.concatenate([part[key] for part in pieces]) for key in pieces[0]} for pieces in parts.values()]
    return whole, doubles


def fit(
    experiment: Experiment,
    source: str | os.PathLike,
    filter_name: str | None = None,
    allowing: Sequence[str] | None = None,
    progress: Progress = silent,
) -> Fit:
    """Fit the config's numbers to the plots of a file; allowing: for these of OUTLIERS and CORRELATION; None: for those
    that are plain. progress is called with the number of likelihoods computed. Raises ConfigError."""
    likelihood, rough, doubles = likelihood_of(experiment, source, filter_name)
    return replace(answered(likelihood, rough, allowing, progress), doubles=doubles)


def answered(
    likelihood: Likelihood,
    rough: Likelihood | None = None,
    allowing: Sequence[str] | None = None,
    progress: Progress = silent,
) -> Fit:
    """The fit of a likelihood, with the plain fit beside it. allowing: for which errors; None: for outliers and
    correlation that raise the likelihood by more than chance does in one recording of 1000."""
    allowed = tuple(allowing or ())
    check_explained(likelihood, allowed)
    stages = Stages(progress, bool(allowed))
    plain = found = fitted(likelihood, (), stages.report, rough)
    if allowed:
        found = fitted(likelihood, allowed, stages.next(), rough)
    while allowing is None and (more := found.beside) and more.what in (OUTLIERS, CORRELATION) and more.gain > PLAIN:
        allowed = (*allowed, more.what)
        try:
            found = fitted(likelihood, allowed, stages.next(), rough)
        except ConfigError:  # so many outliers that they are another law: the plain fit says so beside
            break
    return found if found is plain else replace(found, plain=plain)


def check_explained(likelihood: Likelihood, allowing: Sequence[str]) -> None:
    """ConfigError unless a likelihood can allow for these."""
    for what in allowing:
        if what not in likelihood.explains:
            thing = {OUTLIERS: "outliers", CORRELATION: "errors that last"}[what]
            raise ConfigError(f"the likelihood of filter {likelihood.filter} cannot allow for {thing}")


def fitted(
    likelihood: Likelihood, allowing: Sequence[str] = (), progress: Progress = silent, rough: Likelihood | None = None
) -> Fit:
    """The keys at the maximum of a likelihood, with profile intervals; allowing: for these of OUTLIERS and CORRELATION;
    rough: the likelihood of fewer rows, for a first search. Raises ConfigError where these cannot be allowed for, or
    the plots are impossible whatever the keys."""
    check_explained(likelihood, allowing)
    robust = OUTLIERS in allowing
    if CORRELATION in allowing:
        likelihood, rough = Correlated(likelihood), rough and Correlated(rough)
    start = _Search(rough, robust, silent).best if rough and rough.rows < likelihood.rows else None
    search = _Search(likelihood, robust, progress, start)
    while search.refined():
        search.settle()
    if search.top <= IMPOSSIBLE:
        raise ConfigError(f"filter {likelihood.filter} cannot take the plots: `radarsim track` says at which row")
    share = float(search.natural(search.best)[-1]) if robust else None
    if share is not None and share > MOST_OUTLIERS:
        raise ConfigError(f"robust: {100 * share:.0f} % of the plots would have to be outliers: their errors follow "
                          "another law (few different values?); fit without it")  # fmt: skip
    keys = tuple(search.interval(i) for i in range(len(likelihood.keys)))
    stated = likelihood(np.array(likelihood.stated), 0.0)
    gain = search.top - stated
    return Fit(likelihood.filter, likelihood.tracks, likelihood.rows, keys, share, gain, _beside(search, likelihood))


def _beside(search: "_Search", likelihood: Likelihood) -> Beside | None:
    """The explanation that raises the maximum most beside the fitted keys, if by more than chance does in one recording
    of twenty."""
    from scipy.stats import chi2

    fitted = search.natural(search.best).tolist()
    held = dict(zip((*likelihood.keys, OUTLIERS), fitted, strict=False))
    asked = [what for what in likelihood.explains if what not in held]
    expected = search.evaluations + BESIDE * len(asked)
    counted = Counted(likelihood, search.progress, search.evaluations, expected)
    found = [best(counted, [what], {}, held) for what in asked]
    if OUTLIERS in asked and likelihood.rows <= ROUGH_ROWS:
        # They have raised σ, which hides a few of them: so the keys, but those at zero, are fitted again beside them.
        i, free = asked.index(OUTLIERS), [key for key in likelihood.keys if held[key] > 0]
        along = Along(counted, [*free, OUTLIERS], {key: value for key, value in held.items() if key not in free})
        values, top = climbed(along, held | found[i][0])
        found[i] = max(found[i], ({OUTLIERS: values[OUTLIERS]}, top), key=lambda one: one[1])
    if not found:
        return None
    values, top = max(found, key=lambda one: one[1])
    needed = 0.5 * float(chi2.ppf(0.95 ** (1 / len(found)), 1))
    return Beside(*next(iter(values.items())), top - search.top) if top > search.top + needed else None


def polished(value: Callable[[np.ndarray], float], at: np.ndarray) -> np.ndarray:
    """The maximum of a likelihood near one from a search, by two Newton steps. A search by comparison stalls at the
    root of the last digits. A difference over STEP is 10⁻⁷ wrong by them, and so is the maximum."""
    shape, start = _Shape(value), at
    here = value(at)
    if not math.isfinite(shape.step(at, here, np.arange(at.size))[1]):
        return start
    for _ in range(2):
        moves = STEP * np.eye(at.size)
        at = at + shape.solved(np.array([(value(at + move) - value(at - move)) / (2 * STEP) for move in moves]))
    return at if value(at) >= here - CLOSE and np.abs(at - start).max() < FIRST_STEP else start


class _Shape:
    """Curvature of a likelihood near a point, for Newton steps: along each coordinate it is computed anew at each step,
    from the differences that give the slope; cross terms between coordinates, (n, n), are kept from before."""

    def __init__(self, value: Callable[[np.ndarray], float], together: np.ndarray | None = None):
        self.value, self.together = value, together
        self.H = np.zeros((0, 0))  # the curvature at the last step, of the coordinates free then

    def step(self, at: np.ndarray, here: float, free: np.ndarray) -> tuple[np.ndarray, float]:
        """An ascending step from `at`, of the free coordinates alone, and its predicted gain."""
        moves = WIDE_STEP * np.eye(at.size)[free]
        above, below = (np.array([self.value(at + sign * move) for move in moves]) for sign in (1, -1))
        if not (np.isfinite(here) and min(above.min(), below.min(), here) > IMPOSSIBLE):
            return np.zeros(at.size), math.nan
        slope, curvature = (above - below) / (2 * WIDE_STEP), (above - 2 * here + below) / WIDE_STEP**2
        scale = np.sqrt(np.maximum(np.abs(curvature), FLAT))
        if self.together is None:
            self.together = np.eye(at.size)
            for i, j in itertools.combinations(range(free.size), 2):
                cross = self.value(at + moves[i] + moves[j]) - above[i] - above[j] + here
                share = float(np.clip(cross / WIDE_STEP**2 / (scale[i] * scale[j]), -MOST_TOGETHER, MOST_TOGETHER))
                self.together[free[i], free[j]] = self.together[free[j], free[i]] = share
        self.H = H = self.together[np.ix_(free, free)] * np.outer(scale, scale)
        np.fill_diagonal(H, np.where(np.abs(curvature) < FLAT, -FLAT, curvature))
        step = np.zeros(at.size)
        step[free] = self.solved(slope)
        return step, float(step[free] @ slope)

    def solved(self, slope: np.ndarray) -> np.ndarray:
        """The Newton step up a slope (n,), at most LONGEST_STEP along any axis of the curvature."""
        sizes, axes = np.linalg.eigh(self.H)
        along = axes.T @ slope / np.maximum(np.abs(sizes), FLAT)
        return axes @ np.clip(along, -LONGEST_STEP, LONGEST_STEP)


class _Point(NamedTuple):
    """A point of a profile: the logarithm of the key held, the largest likelihood there, and its coordinates."""

    at: float
    top: float
    best: np.ndarray


class _Search:
    """The maximum of a likelihood, and its profile along each key. Coordinates are logarithms of the keys, and the
    logit of the share of outliers."""

    def __init__(self, likelihood: Likelihood, robust: bool, progress: Progress, near: np.ndarray | None = None):
        self.likelihood, self.robust, self.progress, self.evaluations = likelihood, robust, progress, 0
        self.ends_found, self.ends_begun_at = 0, 0
        start, self.lowest = np.log(units(likelihood)), np.log(likelihood.least)
        self.highest = start + math.log(REACH)
        if robust:
            start, self.lowest, self.highest = (
                np.append(keys, math.log(share / (1 - share)))
                for keys, share in ((start, 0.05), (self.lowest, LEAST_SHARE), (self.highest, MOST_SHARE))
            )
        self.top_at = (TOP if near is None else NEAR) * start.size
        self.shape = _Shape(self._value)
        self.best, self.top = self._climbed(start if near is None else near, None, ROUGH)
        # A second start far away: the likelihood of manoeuvre and plot errors may have two maxima.
        for climbs, factor in enumerate((0.1, 10.0) if near is None else (), 1):
            self.top_at = max(self.top_at, self.evaluations * 3 // climbs)
            moved = np.where(self.best > self.lowest, self.best, start)
            moved[: len(likelihood.stated)] += math.log(factor)
            other, top = self._climbed(moved, None, ROUGHLY, SHORT_SIMPLEX[:1])
            if top > self.top - ROUGHLY and np.abs(other - self.best).max() > FIRST_STEP:
                other, top = self._climbed(other, None, ROUGH)
            if top > self.top + 1e-6:
                self.best, self.top = other, top
        self.top = -math.inf
        self._polish(self.best)
        self.settle()

    def _polish(self, start: np.ndarray) -> bool:
        """Take the top near a point as the best, if it is higher; whether it is."""
        at = polished(self._value, self._climbed(start, None, CLOSE)[0])
        top = self._value(at)
        if higher := top > self.top:
            self.best, self.top = at, top
        return higher

    def settle(self) -> None:
        """Raise keys that are zero where that makes the plots likelier, then look about the top."""
        while (risen := self._risen()) is not None and self._polish(risen):
            pass
        self.shape = _Shape(self._value)
        self.shape.step(self.best, self.top, np.arange(self.best.size))
        self.curvature = self.shape.H
        self.raised = {i: self._raised(i) for i in range(self.best.size) if self._maybe_zero(i)}
        self.ends_begun_at = self.evaluations

    def _risen(self) -> np.ndarray | None:
        """The likeliest point above the top with a single key raised from zero; None if there is none."""
        steps = np.eye(self.best.size)
        zero = np.flatnonzero((self.best <= self.lowest)[: len(self.likelihood.keys)])
        trials = [self.best + (self.lowest[i] + rise - self.best[i]) * steps[i] for i in zero for rise in FROM_ZERO]
        found = [(self._value(at), at) for at in trials]
        value, at = max(found, key=lambda one: one[0], default=(-math.inf, self.best))
        return at if value > self.top + CLOSE else None

    def natural(self, searched: np.ndarray) -> np.ndarray:
        """The keys, with the share of outliers at the end where allowed for: at most MOST_SHARE, since all plots as
        outliers of a tenth of the σ are as likely as none."""
        count = len(self.likelihood.stated)
        keys = np.exp(np.clip(searched[:count], -200, 200))
        keys = np.where(keys <= self.likelihood.least, 0.0, keys)
        share = 1 / (1 + np.exp(-searched[count:]))
        share = np.where(share <= LEAST_SHARE, 0.0, np.minimum(share, MOST_SHARE))
        return np.append(keys, share) if self.robust else keys

    def _value(self, searched: np.ndarray) -> float:
        values = self.natural(searched)
        self.evaluations += 1
        self.progress(self.evaluations, self._expected())
        count = len(self.likelihood.stated)
        found = self.likelihood(values[:count], float(values[count]) if self.robust else 0.0)
        return found if math.isfinite(found) else IMPOSSIBLE

    def _expected(self) -> int:
        """Expected number of evaluations: the maximum and each end at their usual cost, or at that of those found so
        far."""
        ends, size = 2 * len(self.likelihood.keys), len(self.likelihood.keys) + self.robust
        beside = BESIDE * (len(self.likelihood.explains) - self.robust)
        top = self.ends_begun_at or max(self.top_at, self.evaluations)
        each = (self.evaluations - self.ends_begun_at) / self.ends_found if self.ends_found else END * size
        return max(round(top + each * ends), self.evaluations) + beside

    def _climbed(
        self, start: np.ndarray, held: int | None, close: float, simplexes: Sequence[int] = SHORT_SIMPLEX
    ) -> tuple[np.ndarray, float]:
        """The maximum reached from a start, one coordinate held or none, and the log-likelihood there: by Newton steps,
        until one gains less than `close`; where they fail, by a simplex for a while."""
        free = np.array([i for i in range(len(start)) if i != held])
        at, here = start, self._value(start)
        shape = self.shape if held is not None else _Shape(self._value)
        for most in simplexes:
            at, here, arrived = self._newton(at, here, free, close, shape)
            if arrived:
                return at, here
            at, here = self._by_simplex(at, free, close, most)
            shape = _Shape(self._value)
        return at, here

    def _newton(
        self, at: np.ndarray, here: float, free: np.ndarray, close: float, shape: _Shape
    ) -> tuple[np.ndarray, float, bool]:
        """As `_climbed`, by Newton steps alone: where they end, and whether that is the maximum."""
        for _ in range(MOST_STEPS):
            at, here = self._zeroed(at, here, free)
            moved = free[at[free] > self.lowest[free]]
            if not moved.size:
                return at, here, True
            step, promised = shape.step(at, here, moved)
            if not promised >= 0:
                break
            if promised < close / 10:
                return at, here, True
            for shorter in (1.0, 0.5, 0.1, 0.01):
                there = self._value(at + shorter * step)
                if there > here:
                    at, here = at + shorter * step, there
                    break
                if promised < ALMOST * close:
                    return at, here, True
            else:
                break
            if promised < ALMOST * close:
                return at, here, True
            if shorter < 1 or promised > ROUGHLY:
                shape = _Shape(self._value)
        return at, here, False

    def _zeroed(self, at: np.ndarray, here: float, free: np.ndarray) -> tuple[np.ndarray, float]:
        """A point and its likelihood, with free coordinates near zero set to zero, where that is no worse: the
        likelihood is flat in their logarithm there, and steps would never end."""
        for j in free:
            if self.lowest[j] < at[j] < self.lowest[j] + NEAR_ZERO:
                zero = at.copy()
                zero[j] = self.lowest[j] - FIRST_STEP
                if (there := self._value(zero)) >= here:
                    at, here = zero, there
        return at, here

    def _by_simplex(self, start: np.ndarray, free: np.ndarray, close: float, most: int) -> tuple[np.ndarray, float]:
        """As `_climbed`, by a simplex, until it stands still within `close` or has taken `most` likelihoods."""
        from scipy.optimize import minimize

        whole = start.copy()

        def cost(part: np.ndarray) -> float:
            whole[free] = part
            return -self._value(whole)

        simplex = np.concatenate([start[None, free], start[free] + FIRST_STEP * np.eye(free.size)])
        options: Any = {"initial_simplex": simplex, "xatol": close, "fatol": close / 10, "maxfev": most}
        found = minimize(cost, start[free], method="Nelder-Mead", options=options)
        whole[free] = found.x
        return whole, -float(found.fun)

    def _profile(self, i: int, at: float, near: np.ndarray) -> tuple[float, np.ndarray]:
        """The largest likelihood with key i held at the logarithm `at`, and its coordinates; others that are zero rise
        from there if that makes the plots likelier."""
        start = near.copy()
        start[i] = at
        where, top = self._climbed(start, i, CLOSE)
        for j, log in self.raised.items():
            if j != i and where[j] <= self.lowest[j]:
                for risen in (log, *(log - RISES)):
                    start = where.copy()
                    start[j] = risen
                    if self._value(start) > top:
                        where, top = self._climbed(start, i, CLOSE)
                        break
        return top, where

    def refined(self) -> bool:
        """Whether a key has to be smaller to count as zero, as the likelihood leaps there; then it does."""
        begun = self.likelihood.least
        while coarse := [i for i in range(len(self.likelihood.keys)) if self._leaps_at_zero(i)]:
            zero = self.best <= self.lowest
            self.likelihood.least = np.array(self.likelihood.least)
            self.likelihood.least[coarse] *= FINER
            self.lowest[coarse] += math.log(FINER)
            self.best[zero] = self.lowest[zero] - FIRST_STEP
            self.top = self._value(self.best)
        return self.likelihood.least is not begun

    def _leaps_at_zero(self, i: int) -> bool:
        """Whether the likelihood leaps at zero of a key, and is near the top there."""
        above, zero = (self._sliced(i, self.lowest[i] + sign * CLOSE) for sign in (1, -1))
        known = min(above, zero) > IMPOSSIBLE and max(above, zero) > self.top - HALF_CHI2_95
        return known and abs(above - zero) > LEAP

    def _maybe_zero(self, i: int) -> bool:
        """Whether the plots hardly distinguish a key, or the share of outliers, from zero: near zero its logarithm has
        no slope, on which a search stalls, though it must rise where another one is held too low. Tested a little above
        zero, since no filter has σ = 0."""
        return self._sliced(i, self.lowest[i] + CLOSE) > self.top - HALF_CHI2_95

    def _raised(self, i: int) -> float:
        """The logarithm of such a key from which a search has a slope: where the likelihood falls above the maximum."""
        log = max(float(self.best[i]), float(self.lowest[i]))
        while self._sliced(i, log) > self.top - HALF_CHI2_95 and log < self.highest[i]:
            log += 1.0
        return log

    def _sliced(self, i: int, log: float) -> float:
        """The likelihood with one key changed and all others at the maximum."""
        at = self.best.copy()
        at[i] = log
        return self._value(at)

    def interval(self, i: int) -> Fitted:
        """The 95 % profile interval of key i."""
        limit = self.top - HALF_CHI2_95
        lo, hi = (self._end(i, direction, limit) for direction in (-1, 1))
        value = float(self.natural(self.best)[i])
        least = self.lowest[i]
        ends = (0.0 if lo is None or lo <= least else math.exp(lo), math.inf if hi is None else math.exp(hi))
        stated = float(self.likelihood.stated[i])
        return Fitted(self.likelihood.keys[i], stated, value, *ends, ends[0] > 0 and math.isfinite(ends[1]))

    def _end(self, i: int, direction: int, limit: float) -> float | None:
        """The logarithm of key i at which the profile falls to a limit; None where it does not within REACH."""
        least, home, step = float(self.lowest[i]), max(float(self.best[i]), float(self.lowest[i])), self._far_as(i)
        if direction > 0 and i in self.raised:  # from zero the end may be farther than REACH: up to there it is not
            home, step = max(home, self.raised[i] - 1.0), 0.1
        inside = _Point(home, self._sliced(i, home), self.best)
        while abs(inside.at - home) < math.log(REACH):
            at = inside.at + direction * step
            outside = _Point(at, *self._profile(i, at, inside.best))
            if outside.top < limit:
                self.ends_found += 1
                return self._crossing(i, inside, outside, limit)
            if at < least:
                return None
            inside, step = outside, 2 * step
        return None

    def _crossing(self, i: int, inside: "_Point", outside: "_Point", limit: float) -> float:
        """The logarithm of key i at which the profile crosses a limit between two points: by secants of the square root
        of its fall from the maximum, which is nearly a straight line (Illinois method)."""

        def above(point: _Point) -> float:
            fall = self.top - point.top
            return math.sqrt(2 * (self.top - limit)) - math.copysign(math.sqrt(2 * abs(fall)), fall)

        ends, values, replaced = [inside, outside], [above(inside), above(outside)], None
        while True:
            share, width = values[0] / (values[0] - values[1]), ends[1].at - ends[0].at
            at = ends[0].at + share * width
            found = _Point(at, *self._profile(i, at, ends[0].best + share * (ends[1].best - ends[0].best)))
            miss = above(found)
            side = int(miss <= 0)
            if abs(miss * width) < CLOSE * abs(values[0] - values[1]) or abs(at - ends[side].at) < CLOSE:
                return at
            ends[side], values[side] = found, miss
            if side == replaced:
                values[1 - side] /= 2
            replaced = side

    def _far_as(self, i: int) -> float:
        """A little more than the distance of an end from the maximum if the likelihood were a parabola."""
        H = -self.curvature
        try:
            spread = float(np.linalg.inv(H)[i, i])
        except (np.linalg.LinAlgError, IndexError):  # IndexError: no curvature, where neighbours are impossible
            return 0.1
        return min(1.2 * math.sqrt(2 * HALF_CHI2_95 * spread), 1.0) if 0 < spread < math.inf else 0.1


def settings(found: Fit) -> dict[str, float]:
    """Settings for the config, by key, to four digits; keys that the plots do not determine stay as they are."""
    return {
        one.key: float(f"{one.value:.4g}") for one in found.keys if one.identifiable and one.key != CORRELATION_TIME
    }


def as_rows(found: Fit) -> list[dict[str, Any]]:
    """The keys as rows of a table, with the plain answer beside the one that allows for outliers or correlation."""
    plain = {one.key: (one.value, one.lo, one.hi) for one in (found.plain or found).keys}
    names = ("plain", "plain_lo", "plain_hi")
    return [asdict(one) | dict(zip(names, plain.get(one.key, (None,) * 3), strict=True)) for one in found.keys]


# ---- advice ----------------------------------------------------------------------------------------------------------
LEVEL = 0.05  # of a false finding
MOST_FOUND = 3


@dataclass(frozen=True)
class Finding:
    """One explanation: the key (or one of EXPLANATIONS), its value (a share; a bias in σ; a correlation), and the
    increase of the log-likelihood over the findings before.

    from_zero: whether the plots distinguish a key's value from zero. turning: the cost of a smaller manoeuvre variance.
    """

    what: str
    value: float
    gain: float
    from_zero: bool = True
    turning: Turning | None = None


@dataclass(frozen=True)
class Compared:
    """By how much the best filter predicts the plots better than each other: differences of the log-likelihood of the
    numbers that all of them take. fullest: the best predictor among those that take most columns of a plot."""

    best: str
    behind: dict[str, float]
    fullest: str


@dataclass(frozen=True)
class Asked:
    """The rows used: so many altogether, of so many stretches of rows, spread over all tracks and the whole time."""

    rows: int
    stretches: int


@dataclass(frozen=True)
class Advice:
    """Advice from the likelihood of a config's filters over recorded plots: the best filter; the errors in the numbers
    of the one that takes most columns; the rows used. folding: where the velocities are folded, and nothing else is
    examined."""

    compared: Compared
    findings: list[Finding]
    asked: Asked
    folding: Folding | None = None


def advised(followed: Followed, progress: Progress = silent) -> Advice | None:
    """Advice from rows of all tracks over the whole time; none where the study has no likelihood of recorded plots.
    progress is called with the number of likelihoods computed."""
    case, of = followed.case, recorded_of(followed.case)
    every = list(followed.tracks.values()) or [followed]
    long = [part for one in every for part in one.sample.stretches() if len(part["t_s"]) >= LEAST_ROWS]
    if not long or borrowed(case, "likelihood"):
        return None
    chosen = some(long, of.rows_asked)
    known = {one.filter: one for member in case.spec.members if (one := of.likelihood(case, member.name, chosen))}
    if not known:
        return None
    found = compared(list(known.values()))
    asked = Asked(sum(len(part["t_s"]) for part in chosen), len(chosen))
    if (folding := folded(case, long)) is not None:
        return Advice(found, [], asked, folding)
    one = known[found.fullest]
    return Advice(found, [_judged(case, one, each) for each in findings(one, progress)], asked)


def _judged(case: Case, likelihood: Likelihood, found: Finding) -> Finding:
    """A finding with the cost of a smaller manoeuvre variance."""
    stated = dict(zip(likelihood.keys, likelihood.stated.tolist(), strict=True))
    if found.value >= stated.get(found.what, -np.inf):
        return found
    turning = recorded_of(case).in_a_turn(case, likelihood.filter, {found.what: found.value})
    return replace(found, turning=turning)


def findings(likelihood: Likelihood, progress: Progress = silent) -> list[Finding]:
    """Errors in the stated numbers, the weightiest first; empty where nothing is wrong."""
    from scipy.stats import chi2

    of, whats = Counted(likelihood, progress), [*likelihood.keys, *likelihood.explains]
    needed = 0.5 * float(chi2.ppf(1 - LEVEL / len(whats), 1))
    chosen: list[str] = []
    start: dict[str, float] = {}
    reached, found = value(of, {}), []
    while len(chosen) < min(MOST_FOUND, len(whats)):
        trials = {what: best(of, [*chosen, what], start) for what in whats if what not in chosen}
        what = max(trials, key=lambda name: trials[name][1])
        values, top = trials[what]
        if top - reached < needed:
            break
        values, top = _exactly(of, values)
        found.append(Finding(what, values[what], top - reached))
        chosen, start, reached = [*chosen, what], values, top
    return [replace(one, value=start[one.what], from_zero=_from_zero(of, one.what, start, reached)) for one in found]


def _from_zero(likelihood: Counted, what: str, found: dict[str, float], top: float) -> bool:
    """Whether the plots distinguish a key from zero, whatever the other keys are: tested where it is smaller than
    stated."""
    stated = dict(zip(likelihood.keys, likelihood.stated.tolist(), strict=True))
    if what not in stated or found[what] >= stated[what]:
        return True
    others = {one: value for one, value in (stated | found).items() if one != what}
    # An interval ends where it first leaves the maximum: in x and y a needle of σ = 0 across and kilometres along,
    # which turns with each measured bearing, explains errors across too.
    smaller = (float(likelihood.of.least[likelihood.keys.index(what)]), found[what] / 2)
    return any(climbed(Along(likelihood, list(others), {what: at}), others)[1] < top - HALF_CHI2_95 for at in smaller)


def compared(likelihoods: Sequence[Likelihood]) -> Compared:
    """Which filter predicts the plots best, with the stated numbers."""
    sums = {one.filter: one.by_number(np.asarray(one.stated)) for one in likelihoods}
    common = set.intersection(*(set(parts) for parts in sums.values()))
    totals = {name: sum(parts[number] for number in common) for name, parts in sums.items()}
    best = max(totals, key=lambda name: totals[name])
    most = max(len(parts) for parts in sums.values())
    full = {name: sum(parts.values()) for name, parts in sums.items() if len(parts) == most}
    return Compared(
        best, {name: totals[best] - total for name, total in totals.items()}, max(full, key=full.__getitem__)
    )


def _exactly(likelihood: Counted, near: dict[str, float]) -> tuple[dict[str, float], float]:
    """The maximum near roughly found values: printed numbers must not depend on a processor's last digits."""
    along = Along(likelihood, list(near))
    at = polished(along, along.searched(near))
    return along.natural(at), along(at)
