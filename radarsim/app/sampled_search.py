"""`radarsim solve` where the quantity is simulated, with the same noise at every value.

The interval is the set of values at which the quantity's own 95 % interval holds the target: it covers the true value
as often as that interval covers.
"""

import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise

from radarsim.app import question, search
from radarsim.app.quantities import UNPAIRED
from radarsim.app.question import Answer, Curve, Question
from radarsim.language import tr
from radarsim.report.statistics import Estimate

PILOT_SHARE, PILOT_LEAST = 16, 200  # realisations of the scan: a share of all, but not fewer
PILOT_POINTS = 13
WITH_ALL = 13  # values with all realisations: a bracket, the value, both ends of its interval
MOST_STEPS = 3  # of the scan, by which the pilot's noise may have moved a crossing
RESIDUE = 0.02  # of its interval: how near a sampled quantity is brought to the target, so that the noise decides


def by_sampling(asked: Question, curve: Curve, told: Callable[[str], None]) -> Answer:
    """The answer where the quantity is simulated, with the same noise at every value."""
    over, count = asked.over, curve.realisations
    grid, pilot = over.grid(PILOT_POINTS), min(count, max(PILOT_LEAST, count // PILOT_SHARE))
    curve.expected = len(grid) + WITH_ALL
    curve.simulated(None, 1)  # compiles
    begun = time.monotonic()
    attained_now = curve.simulated(None, count).value
    counts = {"grid": len(grid), "pilot": pilot, "more": WITH_ALL, "count": count}
    what = tr(
        "simulates {grid} values of {key} with {pilot} realisations, then about {more} with {count}",
        **question.said_of(asked),
        **counts,
    )
    question.predict(told, what, (WITH_ALL + len(grid) * pilot / count) * (time.monotonic() - begun))
    scanned = [(x, curve.simulated(x, pilot).value - asked.equals) for x in grid]
    known = [one for one in scanned if not math.isnan(one[1])]
    if not known:
        raise question.nowhere(asked, curve)
    question.refuse_without_effect(asked, [y for _, y in known])
    apart = unpaired(asked, curve)
    if apart:
        told("; ".join(apart))
        count = curve.realisations = UNPAIRED * count
    answer = partial(question.answered, asked, attained_now, exact=False)
    best, _ = min(known, key=lambda one: abs(one[1]))
    places = _changes(scanned) or [grid.index(best)]
    brackets = [pair for pair in map(partial(_bracket, asked, curve, grid), places) if pair is not None]
    if not brackets:  # the pilot may have been far off, as where its errors have heavy tails
        whole = [(x, curve.simulated(x, count).value - asked.equals) for x in grid]
        brackets = [(whole[i], whole[i + 1]) for i in _changes(whole)]
        best = min((one for one in whole if not math.isnan(one[1])), key=lambda one: abs(one[1]), default=(best, 0.0))[
            0
        ]
    found = [_interval(asked, curve, *pair) for pair in dict.fromkeys(brackets)]
    if not found:
        limit = curve.simulated(best, count)
        near = limit.lo <= asked.equals <= limit.hi
        doubt = tr(
            "its 95 % interval, {lo:.4g} to {hi:.4g} {unit}, holds the target: -n decides",
            lo=limit.lo,
            hi=limit.hi,
            unit=tr(asked.unit),
        )
        notes = (doubt,) if near else question.boundary(asked, curve, best)
        return answer(limit=limit.value, limit_at=best, notes=notes + apart)
    value = question.nearest([one.value for one in found], asked)
    own, there = next(one for one in found if one.value == value), curve.simulated(value, count)
    jumps = not over.whole and not there.lo <= asked.equals <= there.hi
    return answer(
        **{"value": value, "lo": own.lo, "hi": own.hi, "attained": there.value},
        slope=None if jumps else _sampled_slope(curve, own),
        others=tuple(one.value for one in found if not own.lo <= one.value <= own.hi),
        notes=(question.JUMPS,) * jumps + (question.WHOLE,) * over.whole + apart + curve.noted(value),
    )


def unpaired(asked: Question, curve: Curve) -> tuple[str, ...]:
    """Where the key moves the scans, that values are not compared with the same noise, in words.

    The quantity at a time is then read at another scan, whose noise is another.
    """
    if len(curve.scans) < 2:
        return ()
    words = tr(
        "{key} moves the scans, whose noise differs: each value has {count} realisations, {times} times as many",
        key=asked.key,
        count=UNPAIRED * curve.realisations,
        times=UNPAIRED,
    )
    return (words,)


def _changes(scanned: Sequence[tuple[float, float]]) -> list[int]:
    """Places i of a scan of (x, y) at which y changes its sign to the next place."""
    return [i for i, ((_, a), (_, b)) in enumerate(pairwise(scanned)) if a * b < 0 or (a == 0 and b != 0)]


def _bracket(
    asked: Question, curve: Curve, grid: Sequence[float], i: int
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Neighbouring places of the grid between which the quantity crosses the target with all realisations.

    About the place i where the pilot saw it cross or come nearest, from which the noise may have moved it by steps.
    """
    for j in sorted(range(i - MOST_STEPS, i + MOST_STEPS + 1), key=lambda j: abs(j - i)):
        if not 0 <= j < len(grid) - 1:
            continue
        ends = [(x, curve.simulated(x, curve.realisations).value - asked.equals) for x in grid[j : j + 2]]
        if ends[0][1] * ends[1][1] <= 0:
            return ends[0], ends[1]
    return None


def _interval(asked: Question, curve: Curve, one: tuple[float, float], other: tuple[float, float]) -> Estimate:
    """A value and the 95 % set about it: all values at which the quantity's own interval holds the target."""
    over, count, end = asked.over, curve.realisations, asked.equals

    def part(of: str, x: float) -> float:
        return float(getattr(curve.simulated(x, count), of)) - end

    def close(of: str, x: float, y: float) -> bool:
        found = curve.simulated(x, count)
        return not over.whole and abs(y) <= RESIDUE * (found.hi - found.lo)

    value = search.closed(partial(part, "value"), over, one, other, partial(close, "value"))
    if over.whole:
        value = question.fulfilling(asked, value, lambda n: curve.simulated(n, count).value)
    rising = other[1] > one[1]
    ends = []
    for side, of in ((-1, "hi" if rising else "lo"), (1, "lo" if rising else "hi")):
        inside, outside = (value, part(of, value)), _outside(over, partial(part, of), value, one, other, side)
        if inside[1] * outside[1] >= 0 or math.isnan(outside[1]):
            ends.append(outside[0])  # as far as is searched, the interval holds the target
        else:
            ends.append(search.closed(partial(part, of), over, inside, outside, partial(close, of)))
    return Estimate(value, *ends)


def _outside(
    over: search.Range,
    function: Callable[[float], float],
    value: float,
    one: tuple[float, float],
    other: tuple[float, float],
    side: int,
) -> tuple[float, float]:
    """A place on one side of a value at which the function has another sign than there, or the end of the range.

    The first step is a twentieth of the bracket's width on the scale of the search, each further one twice as long.
    """
    sign = function(value)
    step = max(abs(over.inner(other[0]) - over.inner(one[0])) / 20, over.whole)
    u = over.inner(value)
    while True:
        u += side * step
        x = over.outer(u)
        y = function(x)
        if y * sign <= 0 or math.isnan(y) or x in (over.low, over.high):
            return x, y
        step *= 2


def _sampled_slope(curve: Curve, found: Estimate) -> float | None:
    """The change of the quantity for one unit of the key, over the interval, of the same noise at both ends."""
    low, high = (curve.simulated(x, curve.realisations).value for x in (found.lo, found.hi))
    return None if found.lo == found.hi or math.isnan(high - low) else (high - low) / (found.hi - found.lo)
