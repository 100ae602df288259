"""`radarsim solve`: the value of a numeric key at which a quantity reaches a target.

If the quantity is known exactly, the root of the exact function. Otherwise it is simulated, with the same noise at
every value; the interval is then the set of values at which the quantity's own 95 % interval holds the target, and
covers the true value as often as that interval does.
"""

import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise

from radarsim.app import quantities, question
from radarsim.app.quantities import UNPAIRED, Wanted
from radarsim.app.question import Answer, Cases, Curve, Question
from radarsim.config import fields
from radarsim.errors import ConfigError, argument
from radarsim.language import tr
from radarsim.report.statistics import Estimate
from radarsim.studies import registry

# ---- sampled search --------------------------------------------------------------------------------------------------
PILOT_SHARE, PILOT_LEAST = 16, 200  # realisations of the scan: a share of all, but not fewer
PILOT_POINTS = 13
WITH_ALL = 13  # values with all realisations: a bracket, the value, both ends of its interval
MOST_STEPS = 3  # of the scan: the pilot's noise may have moved a crossing that far
RESIDUE = 0.02  # part of its interval to which a sampled quantity is brought to the target: below, noise dominates


def by_sampling(asked: Question, curve: Curve, notify: Callable[[str], None]) -> Answer:
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
    question.predict(notify, what, (WITH_ALL + len(grid) * pilot / count) * (time.monotonic() - begun))
    scanned = [(x, curve.simulated(x, pilot).value - asked.equals) for x in grid]
    known = [one for one in scanned if not math.isnan(one[1])]
    if not known:
        raise question.nowhere(asked, curve)
    question.refuse_without_effect(asked, [(x, y + asked.equals) for x, y in known])
    apart = unpaired(asked, curve)
    if apart:
        notify("; ".join(apart))
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
            "its 95 % interval, {lo:.4g} to {hi:.4g} {unit}, holds the target: more realisations, {option}, decide",
            lo=limit.lo,
            hi=limit.hi,
            unit=tr(asked.unit),
            option=argument("realisations=…", "-n"),
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
    """A note where the key moves the scans, so that values are not compared with the same noise.

    The quantity at a time is then read at another scan, whose noise is another.
    """
    if len(curve.scans) < 2:
        return ()
    words = tr(
        "{key} moves the scans, so the noise differs between values: each value gets {count} "
        "realisations, {times} times as many",
        key=asked.key,
        count=UNPAIRED * curve.realisations,
        times=UNPAIRED,
    )
    return (words,)


def _changes(scanned: Sequence[tuple[float, float]]) -> list[int]:
    """Places i of a scan of (x, y) between which and the next y changes its sign."""
    return [i for i, ((_, a), (_, b)) in enumerate(pairwise(scanned)) if a * b < 0 or (a == 0 and b != 0)]


def _bracket(
    asked: Question, curve: Curve, grid: Sequence[float], i: int
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Neighbouring places of the grid between which the quantity crosses the target with all realisations.

    Starts at place i, where the pilot crossed or came nearest; its noise may have moved that by some steps.
    """
    for j in sorted(range(i - MOST_STEPS, i + MOST_STEPS + 1), key=lambda j: abs(j - i)):
        if not 0 <= j < len(grid) - 1:
            continue
        ends = [(x, curve.simulated(x, curve.realisations).value - asked.equals) for x in grid[j : j + 2]]
        if ends[0][1] * ends[1][1] <= 0:
            return ends[0], ends[1]
    return None


def _interval(asked: Question, curve: Curve, one: tuple[float, float], other: tuple[float, float]) -> Estimate:
    """A value and its 95 % set: all values at which the quantity's own interval holds the target."""
    over, count, end = asked.over, curve.realisations, asked.equals

    def part(of: str, x: float) -> float:
        return float(getattr(curve.simulated(x, count), of)) - end

    def close(of: str, x: float, y: float) -> bool:
        found = curve.simulated(x, count)
        return not over.whole and abs(y) <= RESIDUE * (found.hi - found.lo)

    value = quantities.closed(partial(part, "value"), over, one, other, partial(close, "value"))
    if over.whole:
        value = question.fulfilling(asked, value, lambda n: curve.simulated(n, count).value)
    rising = other[1] > one[1]
    ends = []
    for side, of in ((-1, "hi" if rising else "lo"), (1, "lo" if rising else "hi")):
        inside, outside = (value, part(of, value)), _outside(over, partial(part, of), value, one, other, side)
        if inside[1] * outside[1] >= 0 or math.isnan(outside[1]):
            ends.append(outside[0])  # the interval holds the target up to the end of the search
        else:
            ends.append(quantities.closed(partial(part, of), over, inside, outside, partial(close, of)))
    return Estimate(value, *ends)


def _outside(
    over: quantities.Range,
    function: Callable[[float], float],
    value: float,
    one: tuple[float, float],
    other: tuple[float, float],
    side: int,
) -> tuple[float, float]:
    """A place on one side of a value where the function has the other sign, or the end of the range.

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
    """The change of the quantity for one unit of the key, over the interval, with the same noise at both ends."""
    low, high = (curve.simulated(x, curve.realisations).value for x in (found.lo, found.hi))
    return None if found.lo == found.hi or math.isnan(high - low) else (high - low) / (found.hi - found.lo)


# ---- solve -----------------------------------------------------------------------------------------------------------
NEAR = 1e-4  # of a value: the step of a derivative
JUMP = 1e-4  # of a quantity: larger changes may be jumps of means over detection patterns, where others are merged
STEP = 1e-3  # on the scale of the search, the step of a rough derivative
AROUND = 2  # rough values for each place of the scan, including those around roots and turns
TINY = 1e-300  # instead of zero
TO_CLOSE = 12  # values, besides those of the scan, to close a bracket to rounding and take the slope
NEAR_ENOUGH = 1e-10  # of the quantity: distance from the target at which a search ends that jumps by 1e-4 anyway
ROUGHLY = 1e-4  # relative width to which a rough root is closed
DOUBT = 0.01  # of the quantity: a rough one that comes this near the target without a root is not trusted


def solve(
    config: question.Config,
    key: str,
    wanted: Wanted,
    equals: float,
    *,
    overrides: Sequence[str] = (),
    between: tuple[float, float] | None = None,
    case: str | None = None,
    realisations: int | None = None,
    threads: int | None = None,
    sampled: bool = False,
    progress: Callable[[int, int, int], None] | None = None,
    notify: Callable[[str], None] | None = None,
) -> Answer:
    """The value of a key at which a quantity equals `equals`, in the quantity's unit (gains and rates in per cent).

    between: the search range; by default the bounds of the key, or a thousandth to a thousand times its value if it has
    no two bounds. realisations: for each sampled value, by default the config's. sampled: simulate even if the exact
    value is known. notify is called with a line on a search that will take some seconds.

    Raises ConfigError for a wrong config, key, filter or component, and for a key without effect.
    """
    if not math.isfinite(equals):
        raise ConfigError(f"{argument('equals')}: must be a finite number, got {equals:g}")
    cases = Cases(config, tuple(overrides), case)
    found = fields.find(cases.base.spec, key)
    quantity = quantities.checked(wanted, cases.base)
    axes = quantities.labels(quantity, cases.base)
    quantity = quantities.resolved(quantity, axes)
    over = question.range_of(found, key, between)
    curve = Curve(cases, key, quantity, threads, progress, realisations or cases.base.realisations)
    now = found[0].value if len({one.value for one in found}) == 1 else None
    asked = Question(
        cases, key, quantity, equals, over, now, quantities.unit(quantity, axes), tuple(overrides), realisations
    )
    work = _exactly if not sampled and curve.exact(axes) else by_sampling
    return work(asked, curve, notify or (lambda line: None))


def _exactly(asked: Question, curve: Curve, notify: Callable[[str], None]) -> Answer:
    """The answer where the quantity is exact."""
    attained_now = curve.exactly(None)
    grid = asked.over.grid()
    curve.expected = len(grid) + TO_CLOSE
    study, base = registry.study(asked.cases.base.study), quantities.shortened(asked.quantity, asked.cases.base)
    curve.rough = study.costly(base) and not asked.over.whole
    elsewhere = grid[len(grid) // 3]  # not the config's own value, which a study may have cached
    near = study.exact_but_for(base)
    roughly = timed(partial(curve.roughly, elsewhere))
    # One exact value beyond the search's own, where it may take seconds: with each pattern of plots followed it takes
    # a twentieth of one.
    each = timed(partial(curve.exactly, elsewhere)) if near or not curve.rough else 0.0
    said = question.said_of(asked)
    what = tr("computes the {quantity} at about {count} values of {key}", **said, count=curve.expected)
    seconds = TO_CLOSE * each + len(grid) * (AROUND * roughly if curve.rough else each)
    question.predict(notify, what + (tr(", each {near}", near=tr(near)) if near else ""), seconds)
    try:
        found = roots(asked, curve)
    except quantities.Undefined:
        raise question.nowhere(asked, curve) from None
    counted = question.ROUGH if curve.rough else 0  # both kinds differ a little where the key has no effect
    question.refuse_without_effect(asked, [(x, one.value) for (x, n), one in curve.known.items() if n == counted])
    values = found.roots
    if asked.over.whole:
        values = tuple(dict.fromkeys(question.fulfilling(asked, x, curve.exactly) for x in values))
    answer = partial(question.answered, asked, attained_now, exact=True)
    if not values:
        limit = found.at_nearest + asked.equals
        return answer(limit=limit, limit_at=found.nearest, notes=question.boundary(asked, curve, found.nearest))
    value = question.nearest(values, asked)
    near = study.exact_but_for(quantities.shortened(asked.quantity, asked.cases.at(asked.key, value)))
    attained = curve.exactly(value)
    jumps = not asked.over.whole and abs(attained - asked.equals) > JUMP * max(abs(asked.equals), abs(attained_now))
    return answer(
        **{"value": value, "lo": value, "hi": value, "attained": attained},
        slope=None if jumps else slope(curve.exactly, value, asked.over),
        others=tuple(x for x in values if x != value),
        notes=((question.JUMPS,) if jumps else ())
        + ((question.WHOLE,) if asked.over.whole and attained != asked.equals else ())
        + ((tr("σ is {what}", what=tr(near)),) if near else ()),
    )


def roots(asked: Question, curve: Curve) -> quantities.Found:
    """Where the exact quantity reaches the target; searched roughly first where that is much cheaper.

    Raises quantities.Undefined where it has no value.
    """

    def missing(x: float) -> float:
        return curve.exactly(x) - asked.equals

    if not curve.rough:
        return quantities.roots_of(missing, asked.over)
    size = max(abs(asked.equals), TINY)
    found = quantities.roots_of(lambda x: curve.roughly(x) - asked.equals, asked.over, ROUGHLY)
    near = [exact_near(missing, curve, asked.over, x, NEAR_ENOUGH * size) for x in found.roots]
    exactly = [x for x in near if x is not None]
    if len(exactly) < len(near) or (not near and abs(found.at_nearest) < DOUBT * size):
        return quantities.roots_of(missing, asked.over)
    return quantities.Found(tuple(exactly), found.nearest, found.at_nearest if exactly else missing(found.nearest))


def exact_near(
    missing: Callable[[float], float], curve: Curve, over: quantities.Range, x: float, near_enough: float
) -> float | None:
    """The root near a rough one: by secants, the first from the rough quantity; if they fail, bracketed."""
    u = over.inner(x)
    ends = over.outer(u - STEP), over.outer(u + STEP)
    low, high = (curve.roughly(end) for end in ends)
    rising = (high - low) / (over.inner(ends[1]) - over.inner(ends[0]))
    found = quantities.polished(missing, over, x, rising, near_enough)
    return quantities.near(missing, over, x, near_enough) if found is None else found


def timed(work: Callable[[], object]) -> float:
    """Seconds that a function takes."""
    begun = time.monotonic()
    work()
    return time.monotonic() - begun


def slope(of: Callable[[float], float], value: float, over: quantities.Range) -> float | None:
    """The change of a function for one unit of the key, by a central difference within the range; one-sided at an end.

    Error of the order of 1e-8 of itself; of whole numbers the change to the next.
    """
    step = NEAR * (abs(value) or 1.0)
    low, high = max(value - step, over.low), min(value + step, over.high)
    if over.whole:
        low, high = value, min(value + 1, over.high)
    if math.isnan(of(low)):
        low = value
    if math.isnan(of(high)):
        high = value
    if low == high or math.isnan(of(low)) or math.isnan(of(high)):
        return None
    return (of(high) - of(low)) / (high - low)
