"""`radarsim solve`: the value of a numeric key at which a quantity reaches a target.

Where the quantity is known exactly the root is that of the exact function, found here; else see `sampled_search`.
"""

import math
import time
from collections.abc import Callable, Sequence
from functools import partial

from radarsim.app import quantities, question, sampled_search, search
from radarsim.app.quantities import Quantity
from radarsim.app.question import Answer, Cases, Curve, Question
from radarsim.config import numeric
from radarsim.errors import ConfigError
from radarsim.language import tr
from radarsim.studies import registry

NEAR = 1e-4  # of a value: the step of a derivative
JUMP = 1e-4  # of a quantity: more than means over patterns of plots may jump where others are merged
STEP = 1e-3  # on the scale of the search, the step of a rough derivative
AROUND = 2  # rough values a place of the scan, with those about roots and turns
TINY = 1e-300  # in place of nothing
TO_CLOSE = 12  # values, beside those of the scan, that bring a root from its bracket to rounding, and its slope
NEAR_ENOUGH = 1e-10  # of the quantity: how near to its target it ends where it jumps about at a ten-thousandth anyway
ROUGHLY = 1e-4  # part of a root, to which a rough one is closed
DOUBT = 0.01  # of the quantity: how near to the target the rough one may come without a root before it is not trusted


def solve(
    config: question.Config,
    key: str,
    quantity: Quantity,
    equals: float,
    *,
    overrides: Sequence[str] = (),
    between: tuple[float, float] | None = None,
    case: str | None = None,
    realisations: int | None = None,
    threads: int | None = None,
    sampled: bool = False,
    progress: Callable[[int, int, int], None] | None = None,
    told: Callable[[str], None] | None = None,
) -> Answer:
    """The value of a key at which a quantity equals `equals`, in the quantity's unit (gains and rates in per cent).

    between: what is searched; by default what the key allows, and of one that has no two bounds a thousandth to a
    thousand times its value. realisations: behind each sampled value, by default the config's. sampled: simulate also
    what is known exactly. told is called with a line, before the search, that says what it will do, if that takes some
    seconds.

    Raises ConfigError for a wrong config, key, filter or component, and for a key without effect.
    """
    if not math.isfinite(equals):
        raise ConfigError(f"--equals: must be a finite number, got {equals:g}")
    cases = Cases(config, tuple(overrides), case)
    found = numeric.find(cases.base.spec, key)
    quantities.checked(quantity, cases.base)
    axes = quantities.labels(quantity, cases.base)
    quantity = quantities.resolved(quantity, axes)
    over = question.range_of(found, key, between)
    curve = Curve(cases, key, quantity, threads, progress, realisations or cases.base.realisations)
    now = found[0].value if len({one.value for one in found}) == 1 else None
    asked = Question(
        cases, key, quantity, equals, over, now, quantities.unit(quantity, axes), tuple(overrides), realisations
    )
    work = _exactly if not sampled and curve.exact(axes) else sampled_search.by_sampling
    return work(asked, curve, told or (lambda line: None))


def _exactly(asked: Question, curve: Curve, told: Callable[[str], None]) -> Answer:
    """The answer where the quantity is exact."""
    attained_now = curve.exactly(None)
    grid = asked.over.grid()
    curve.expected = len(grid) + TO_CLOSE
    study, base = registry.study(asked.cases.base.study), quantities.shortened(asked.quantity, asked.cases.base)
    curve.rough = study.costly(base) and not asked.over.whole
    elsewhere = grid[len(grid) // 3]  # not the config's own, which a study may still know
    near = study.exact_but_for(base)
    roughly = timed(partial(curve.roughly, elsewhere))
    # One exact value beside the search's own where it may take seconds: where each pattern of plots is followed it
    # takes a twentieth of one.
    each = timed(partial(curve.exactly, elsewhere)) if near or not curve.rough else 0.0
    said = question.said_of(asked)
    what = tr("computes the {quantity} at about {count} values of {key}", **said, count=curve.expected)
    seconds = TO_CLOSE * each + len(grid) * (AROUND * roughly if curve.rough else each)
    question.predict(told, what + (tr(", each {near}", near=tr(near)) if near else ""), seconds)
    try:
        found = roots(asked, curve)
    except ValueError:
        raise question.nowhere(asked, curve) from None
    counted = question.ROUGH if curve.rough else 0  # both kinds differ a little where the key has no effect
    question.refuse_without_effect(asked, [one.value for (_, count), one in curve.known.items() if count == counted])
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


def roots(asked: Question, curve: Curve) -> search.Found:
    """Where the exact quantity reaches the target; first looked for roughly where that is much less work.

    Raises ValueError where it is defined nowhere.
    """

    def missing(x: float) -> float:
        return curve.exactly(x) - asked.equals

    if not curve.rough:
        return search.roots(missing, asked.over)
    size = max(abs(asked.equals), TINY)
    found = search.roots(lambda x: curve.roughly(x) - asked.equals, asked.over, ROUGHLY)
    near = [exact_near(missing, curve, asked.over, x, NEAR_ENOUGH * size) for x in found.roots]
    exactly = [x for x in near if x is not None]
    if len(exactly) < len(near) or (not near and abs(found.at_nearest) < DOUBT * size):
        return search.roots(missing, asked.over)
    return search.Found(tuple(exactly), found.nearest, found.at_nearest if exactly else missing(found.nearest))


def exact_near(
    missing: Callable[[float], float], curve: Curve, over: search.Range, x: float, near_enough: float
) -> float | None:
    """The root near a rough one: by secants, the first that of the rough quantity; where they fail, bracketed."""
    u = over.inner(x)
    ends = over.outer(u - STEP), over.outer(u + STEP)
    low, high = (curve.roughly(end) for end in ends)
    rising = (high - low) / (over.inner(ends[1]) - over.inner(ends[0]))
    found = search.polished(missing, over, x, rising, near_enough)
    return search.near(missing, over, x, near_enough) if found is None else found


def timed(work: Callable[[], float]) -> float:
    """Seconds that a piece of work takes."""
    begun = time.monotonic()
    work()
    return time.monotonic() - begun


def slope(of: Callable[[float], float], value: float, over: search.Range) -> float | None:
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
