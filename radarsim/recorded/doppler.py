"""Whether recorded velocities are folded: by the ranges of the same plots, whatever a config says of their errors.

A velocity that is ambiguous by a span D lies within half of it, and differs from the change of the range by a whole
number of spans. So where no velocity is beyond A / 2 the span is A at least, and a range that changes faster than A / 2
has folded them. Which span it is follows from the differences, as far as they tell it. An error of all velocities
alike does not look so: it shows in the velocities themselves.
"""

import os
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from operator import attrgetter

import numpy as np

from radarsim.config.experiment import Case
from radarsim.language import tr
from radarsim.recorded.follow import recorded_of
from radarsim.report.text import significant_digits
from radarsim.studies import registry

FINE = 1 / 8  # of the least span: the standard deviation to which the change of the range is to be known
MOST = 0.6  # of the plots at which it is
MOST_PLOTS = 1000  # over which is looked
WIDEST = 2.0  # times its usual length that a window of plots may last
CLEAR = 4.0  # standard deviations by which a range changes faster than a velocity can be
LEAST_PLOTS, LEAST_SHARE = 3, 0.1  # of those looked at, at which it does
CHANCE, FOUND = 1.0, 3.0  # standard deviations by which whole spans are told from chance: of one that is known, of any
VELOCITY, MEASURED = "velocity_mps", ("range_m", "velocity_mps")
STEPS = 200  # of a search for the span, in which the phase of the farthest velocity turns once


@dataclass(frozen=True)
class Folding:
    """Velocities that are folded: the greatest of them and the fastest change of the ranges, m/s; the span, m/s, that
    was known or that the plots fit best, None where they do not tell."""

    velocity_mps: float
    rate_mps: float
    span_mps: float | None
    known: bool


def folding(tracks: Sequence[Mapping[str, np.ndarray]], span_mps: float | None = None) -> Folding | None:
    """Whether the velocities of tracks, columns t_s, range_m and velocity_mps (n,), are folded; None where they are
    not, or the plots are too few to tell. span_mps: by what, where it is known."""
    whole = [np.stack([one["t_s"], one["range_m"], one["velocity_mps"]]) for one in tracks]
    whole = [one[:, np.isfinite(one).all(axis=0)] for one in whole]
    fastest = max((float(np.abs(one[2]).max()) for one in whole if one.size), default=0.0)
    seen = _rates(whole, 2 * fastest)
    if seen is None:
        return None
    rates, velocities, sigma = seen
    off = rates - velocities
    beyond = int((np.abs(off) > fastest + CLEAR * sigma).sum())
    turned = np.median(np.abs(rates + velocities))  # of the other sign they are off by twice their size
    if beyond < max(LEAST_PLOTS, LEAST_SHARE * off.size) or turned < 0.5 * np.median(np.abs(off)):
        return None
    span = _span(off, 2 * fastest)
    known = span_mps is not None and 2 * fastest <= span_mps * (1 + 1e-9)
    known = known and (span is None or bool(_whole(off, np.array([span_mps]))[0] > CHANCE))
    rate = float(np.abs(rates[np.abs(off) > fastest + CLEAR * sigma]).max())
    return Folding(fastest, rate, span_mps if known else span, known)


def folded(case: Case, tracks: Sequence[Mapping[str, np.ndarray]]) -> Folding | None:
    """Whether the velocities of tracks, columns (n,) each, are folded where a case's study takes them as measured."""
    of = recorded_of(case)
    if VELOCITY not in tracks[0] or of.unfolding(1.0) is not None:
        return None
    return folding(tracks, of.span_mps(case.spec))


def said(found: Folding, source: str | os.PathLike, case: Case | None = None) -> str:
    """That velocities are folded, by what, and the command that unfolds them; source: the file of plots; case: of whose
    radar, where there is one."""
    told = {
        "velocity": significant_digits(found.velocity_mps, "#.3g"),
        "rate": significant_digits(found.rate_mps, "#.3g"),
    }
    seen = tr(
        "the velocities are folded: none is beyond ±{velocity} m/s, and the ranges change by up to {rate} m/s", **told
    )
    span = "" if found.span_mps is None else significant_digits(found.span_mps, "#.3g")
    if found.span_mps is None:
        by = tr("the plots do not tell the span")
    elif found.known:
        by = tr("the config's span is {span} m/s", span=span)
    elif found.span_mps >= 4 * found.velocity_mps:
        by = tr("by the plots the span is about {span} m/s, or a whole part of that", span=span)
    else:
        by = tr("by the plots the span is about {span} m/s", span=span)
    return "; ".join([seen, by, *_unfolded(found, source, case)])


def _unfolded(found: Folding, source: str | os.PathLike, case: Case | None) -> list[str]:
    """The command whose filters take the velocities as they are, with what the config says of their errors."""
    span = found.span_mps or 2 * found.velocity_mps
    parts = [one for one in registry.parts(lambda study: study.recorded()).values() if one is not None]
    ways = [way for part in parts if (way := part.unfolding(float(f"{span:.4g}"))) is not None]
    if not ways:
        return []
    stated = []
    if case is not None:
        keys = recorded_of(case).sigmas(case.spec)
        stated = [f"{key}={attrgetter(key)(case.spec):g}" for name in MEASURED for key in keys.get(name, ())]
    settings = " ".join(f"--set {one}" for one in (ways[0][1], *stated))
    plots = shlex.quote(os.fspath(source))
    command = f"radarsim track {ways[0][0]} {plots} -o unfolded.csv {settings}"
    return [tr("filters that unfold them: {command}", command=command)]


def _rates(tracks: Sequence[np.ndarray], least: float) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """The change of the range at plots, the velocities there, and the standard deviations of the changes, (m,) each:
    from parabolas through as few ranges about each as let it be known to FINE for most of them; None where no number of
    them does."""
    half, total = 2, sum(one.shape[1] for one in tracks)
    every = max(total // MOST_PLOTS, 1)
    while least > 0:
        fits = [_parabolas(one, half, every) for one in tracks if one.shape[1] > 2 * half]
        rates, velocities, left, spread = np.concatenate([np.empty((4, 0)), *fits], axis=1)
        if not left.size:
            return None
        # Of the squares left of normal errors the median is about that of chi-square (Wilson and Hilferty).
        freedom = 2 * half - 2
        sigma = np.sqrt(np.median(left) / (freedom * (1 - 2 / (9 * freedom)) ** 3))
        fine = sigma * spread <= FINE * least
        if fine.mean() >= MOST:
            return rates[fine], velocities[fine], sigma * spread[fine]
        half += 1 + half // 4
    return None


def _parabolas(track: np.ndarray, half: int, every: int) -> np.ndarray:
    """Of parabolas through the ranges of 2 half + 1 plots about one, at the ends of a track of those nearest: (4, m)
    slope there, velocity there, the sum of squares that is left, the standard deviation of the slope for errors of 1 m.
    """
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
    """How clearly those velocities that are off (m,) by more than half a span are off by whole ones, for each span: the
    mean of the cosine of their phase, in its standard deviations for phases by chance; zero where there are none."""
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
