"""The search for the value of a key where the quantity is sampled.

The quantity is simulated with the same noise at every value. The interval of the answer is the set of values at which
the 95 % interval of the quantity contains the target; it covers the true value as often as that interval covers the
true quantity."""

import math
import time
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any

from radarsim.api.design import root_search
from radarsim.api.design.objective import UNPAIRED_FACTOR, Curve, have_common_noise
from radarsim.api.design.question import (
    JUMP_NOTE,
    WHOLE_NUMBER_NOTE,
    Question,
    boundary_note,
    check_effect,
    first_attaining,
    make_answer,
    nearest_value,
    predict_duration,
    question_fields,
    undefined_error,
)
from radarsim.api.design.solve_answer import Answer
from radarsim.errors import argument
from radarsim.language.translate import tr
from radarsim.report.compared_value import ComparedValue
from radarsim.report.statistics import Estimate

PILOT_SHARE, MIN_PILOT_REALISATIONS = 16, 200  # realisations of the scan: a share of all, but not fewer
PILOT_POINTS = 13
FULL_VALUES = 13  # values with all realisations: a bracket, the value, both ends of its interval
MAX_STEPS = 3  # of the scan: the pilot's noise may have moved a crossing that far
RESIDUE = 0.02  # share of its interval to which a sampled quantity is brought to the target: below it noise dominates


def solve_by_sampling(question: Question, curve: Curve, notify: Callable[[str], None]) -> Answer:
    """The answer where the quantity is simulated, with the same noise at every value."""
    search_range, count = question.search_range, curve.realisations
    grid, pilot = search_range.grid(PILOT_POINTS), min(count, max(MIN_PILOT_REALISATIONS, count // PILOT_SHARE))
    curve.expected = len(grid) * pilot + FULL_VALUES * count
    curve.simulate(None, 1)  # compiles
    start_s = time.monotonic()
    attained_now = curve.simulate(None, count).value
    counts = {"grid": len(grid), "pilot": pilot, "more": FULL_VALUES, "count": count}
    work = tr(
        "simulates {grid} values of {key} with {pilot} realisations, then about {more} with {count}",
        **question_fields(question),
        **counts,
    )
    predict_duration(notify, work, (FULL_VALUES + len(grid) * pilot / count) * (time.monotonic() - start_s))
    scanned = [(x, curve.simulate(x, pilot).value - question.equals) for x in grid]
    defined = [(x, y) for x, y in scanned if not math.isnan(y)]
    if not defined:
        raise undefined_error(question, curve)
    check_effect(question, [(x, y + question.equals) for x, y in defined])
    scan_notes = unpaired_note(question, curve)
    if scan_notes:
        notify("; ".join(scan_notes))
        count = curve.realisations = UNPAIRED_FACTOR * count
        curve.expected = curve.completed + FULL_VALUES * count
    answer = partial(make_answer, question, attained_now, exact=False)
    best, _ = min(defined, key=lambda point: abs(point[1]))
    places = _sign_changes(scanned) or [grid.index(best)]
    brackets = [pair for pair in map(partial(_find_bracket, question, curve, grid), places) if pair is not None]
    if not brackets:  # the pilot may have been far off, as where its errors have heavy tails
        full_scan = [(x, curve.simulate(x, count).value - question.equals) for x in grid]
        brackets = [(full_scan[i], full_scan[i + 1]) for i in _sign_changes(full_scan)]
        best = min(
            ((x, y) for x, y in full_scan if not math.isnan(y)), key=lambda point: abs(point[1]), default=(best, 0.0)
        )[0]
    solutions = [_close_interval(question, curve, *pair) for pair in dict.fromkeys(brackets)]
    if not solutions:
        limit = _chosen_among(question, curve.simulate(best, count), len(grid))
        fields = {"count": len(grid), "lo": limit.lo, "hi": limit.hi, "unit": tr(question.unit)}
        if limit.lo <= question.equals <= limit.hi:
            doubt = tr(
                "the interval for all {count} values tried, {lo:.4g} to {hi:.4g} {unit}, holds the target: more "
                "realisations, {option}, decide",
                **fields,
                option=argument("realisations=…", "-n"),
            )
            notes: tuple[str, ...] = (doubt,)
        else:
            known = tr("simulated; the interval for all {count} values tried is {lo:.4g} to {hi:.4g} {unit}", **fields)
            notes = (known, *boundary_note(question, curve, best))
        return answer(limit=limit.value, limit_at=best, notes=notes + scan_notes)
    value = nearest_value([root.value for root in solutions], question)
    solution, estimate = next(root for root in solutions if root.value == value), curve.simulate(value, count)
    is_jump = not search_range.whole_numbers and not estimate.lo <= question.equals <= estimate.hi
    return answer(
        solution=solution,
        attained=estimate.value,
        slope=None if is_jump else _sampled_slope(curve, solution),
        other_values=tuple(root.value for root in solutions if not solution.lo <= root.value <= solution.hi),
        notes=(JUMP_NOTE,) * is_jump
        + (WHOLE_NUMBER_NOTE,) * search_range.whole_numbers
        + scan_notes
        + curve.interval_notes(value),
    )


def _chosen_among(question: Question, estimate: Estimate, looks: int) -> Estimate:
    """The nearest value that was simulated, with an interval that holds for all values tried."""
    quantity = question.quantity.definition
    kind: Any = "gain" if quantity.paired else quantity.kind
    value = ComparedValue(Estimate(*(float(end) / quantity.scale for end in estimate)), is_exact=False, kind=kind)
    return Estimate(*(end * quantity.scale for end in value.chosen_among(looks).estimate))


def unpaired_note(question: Question, curve: Curve) -> tuple[str, ...]:
    """A note if the key moves the scans, so that values are not compared with the same noise: the quantity at a time is
    then read at another scan, which has other noise."""
    if have_common_noise(curve.scans):
        return ()
    note = tr(
        "{key} moves the scans, so the noise differs between values: each value gets {count} "
        "realisations, {times} times as many",
        key=question.key,
        count=UNPAIRED_FACTOR * curve.realisations,
        times=UNPAIRED_FACTOR,
    )
    return (note,)


def _sign_changes(scanned: Sequence[tuple[float, float]]) -> list[int]:
    """The indices i of a scan of (x, y) at which y changes its sign to the next point."""
    return [i for i, ((_, a), (_, b)) in enumerate(pairwise(scanned)) if a * b < 0 or (a == 0 and b != 0)]


def _find_bracket(
    question: Question, curve: Curve, grid: Sequence[float], i: int
) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Neighbouring places of the grid between which the quantity crosses the target with all realisations.

    The search starts at place i, where the pilot crossed the target or came nearest to it; the noise of the pilot may
    have moved that by some steps."""
    for j in sorted(range(i - MAX_STEPS, i + MAX_STEPS + 1), key=lambda j: abs(j - i)):
        if not 0 <= j < len(grid) - 1:
            continue
        ends = [(x, curve.simulate(x, curve.realisations).value - question.equals) for x in grid[j : j + 2]]
        if ends[0][1] * ends[1][1] <= 0:
            return ends[0], ends[1]
    return None


def _close_interval(question: Question, curve: Curve, start: tuple[float, float], end: tuple[float, float]) -> Estimate:
    """A value and its 95 % interval: all values at which the interval of the quantity holds the target."""
    search_range, count, target = question.search_range, curve.realisations, question.equals

    def difference(field: str, x: float) -> float:
        return float(getattr(curve.simulate(x, count), field)) - target

    def is_near_zero(field: str, x: float, y: float) -> bool:
        estimate = curve.simulate(x, count)
        return not search_range.whole_numbers and abs(y) <= RESIDUE * (estimate.hi - estimate.lo)

    def close_at(field: str, start: tuple[float, float], end: tuple[float, float]) -> float:
        # If each value has other noise, the quantity jumps; the search would close such a jump down to rounding.
        estimate = curve.simulate(start[0], count)
        is_rough = not have_common_noise(curve.scans)
        share = RESIDUE * (estimate.hi - estimate.lo) / abs(start[1] - end[1]) if is_rough else 0.0
        width = share * abs(start[0] - end[0]) / max(abs(start[0]), abs(end[0]), 1e-300)
        return root_search.close_bracket(
            partial(difference, field),
            search_range,
            start,
            end,
            partial(is_near_zero, field),
            max(width, root_search.EXACT_WIDTH),
        )

    value = close_at("value", start, end)
    if search_range.whole_numbers:
        value = first_attaining(question, value, lambda n: curve.simulate(n, count).value)
    rising = end[1] > start[1]
    ends = []
    for side, field in ((-1, "hi" if rising else "lo"), (1, "lo" if rising else "hi")):
        inside, outside = (
            (value, difference(field, value)),
            _opposite_sign(search_range, partial(difference, field), value, start, end, side),
        )
        if inside[1] * outside[1] >= 0 or math.isnan(outside[1]):
            ends.append(outside[0])  # the interval holds the target up to the end of the search
        else:
            ends.append(close_at(field, inside, outside))
    return Estimate(value, *ends)


def _opposite_sign(
    search_range: root_search.Range,
    function: Callable[[float], float],
    value: float,
    start: tuple[float, float],
    end: tuple[float, float],
    side: int,
) -> tuple[float, float]:
    """A place on one side of a value where the function has the other sign, or the end of the range. The first step is
    a twentieth of the bracket's width on the scale of the search, each further one twice as long."""
    sign = function(value)
    step = max(abs(search_range.to_scale(end[0]) - search_range.to_scale(start[0])) / 20, search_range.whole_numbers)
    u = search_range.to_scale(value)
    while True:
        u += side * step
        x = search_range.from_scale(u)
        y = function(x)
        if y * sign <= 0 or math.isnan(y) or x in (search_range.low, search_range.high):
            return x, y
        step *= 2


def _sampled_slope(curve: Curve, solution: Estimate) -> float | None:
    """The change of the quantity for one unit of the key, over the interval, with the same noise at both ends."""
    low, high = (curve.simulate(x, curve.realisations).value for x in (solution.lo, solution.hi))
    return None if solution.lo == solution.hi or math.isnan(high - low) else (high - low) / (solution.hi - solution.lo)
