"""Roots of a function of one number over a range.

Where there is no root, the place nearest to one is found. The function may be undefined (NaN) in places where keys of a
config exclude each other. Positive ranges of more than a factor of 20 are searched on a logarithmic scale."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

LOGARITHMIC_RATIO = 20  # ratio of high to low from which a range is searched logarithmically
POINTS_PER_DECADE, MIN_POINTS, MAX_POINTS = 5, 25, 61  # of the grid of a scan
EXACT_WIDTH = 1e-13  # relative width to which brackets are closed: far below the documented 1e-9
NEAR_ROOT_WIDTH = 1e-9
SECANT_TOLERANCE, MAX_SECANTS = 1e-10, 8  # relative step at which secants end; how many
FIRST_STEP = 1e-4  # of the range: distance of the second start in a search near a known root
GOLDEN = (math.sqrt(5) - 1) / 2

Function = Callable[[float], float]


@dataclass(frozen=True)
class Range:
    """A range to search: low to high, logarithmic or not, of whole numbers or not."""

    low: float
    high: float
    logarithmic: bool
    whole_numbers: bool = False

    def to_scale(self, x: float) -> float:
        """A value on the scale of the search."""
        return math.log(x) if self.logarithmic else x

    def from_scale(self, u: float) -> float:
        """The value at a place of the scale, within the range; rounded where only whole numbers are allowed."""
        x = math.exp(u) if self.logarithmic else u
        return min(max(float(round(x)) if self.whole_numbers else x, self.low), self.high)

    def grid(self, points: int | None = None) -> list[float]:
        """Grid over the search range, evenly spaced; every integer if there are few."""
        if self.whole_numbers and self.high - self.low < MAX_POINTS:
            return [float(n) for n in range(math.ceil(self.low), math.floor(self.high) + 1)]
        if points is None:
            decades = (self.to_scale(self.high) - self.to_scale(self.low)) / math.log(10) if self.logarithmic else 0
            points = min(max(MIN_POINTS, math.ceil(POINTS_PER_DECADE * decades) + 1), MAX_POINTS)
        first, step = self.to_scale(self.low), (self.to_scale(self.high) - self.to_scale(self.low)) / (points - 1)
        values = [self.from_scale(first + i * step) for i in range(points)]
        values[0], values[-1] = self.low, self.high
        return sorted(set(values)) if self.whole_numbers else values


def search_range(low: float, high: float, whole_numbers: bool = False) -> Range:
    """The range from low to high, on a suitable scale."""
    return Range(low, high, low > 0 and high / low > LOGARITHMIC_RATIO, whole_numbers)


@dataclass(frozen=True)
class Roots:
    """The roots on a range, ascending; without any, the place where the function is nearest to zero and its value."""

    roots: tuple[float, ...]
    nearest: float
    nearest_value: float


class UndefinedFunctionError(ValueError):
    """A function without a value anywhere on a range."""


def find_roots(function: Function, search_range: Range, width: float = EXACT_WIDTH) -> Roots:
    """All roots that a scan of the range shows: changes of sign, and touching ones where it turns near zero. A jump
    over zero counts as a root, unless the function is undefined between. Brackets are closed to the relative width
    `width`, by default to rounding. Raises Undefined where the function has no value anywhere on the scan."""
    places = [(x, function(x)) for x in search_range.grid()]
    places = _with_edges(function, search_range, places)
    places = _with_turns(function, search_range, places)
    defined = [(x, y) for x, y in places if not math.isnan(y)]
    if not defined:
        raise UndefinedFunctionError("not defined on the range")
    roots = [x for x, y in defined if y == 0]
    for (a, ya), (b, yb) in pairwise(places):
        if ya * yb < 0:
            roots.append(close_bracket(function, search_range, (a, ya), (b, yb), width=width))
    roots = [x for x in roots if not math.isnan(function(x))]
    nearest, at_nearest = min(defined, key=lambda point: abs(point[1]))
    return Roots(tuple(sorted(roots)), nearest, at_nearest)


def refine_root(
    function: Function, search_range: Range, root: float, rising: float, near_enough: float
) -> float | None:
    """The root of a smooth function near that of an approximation, by secants on the scale of the search.

    rising is the first slope. To ten digits, or to rounding; for a function that jumps where |function| <= near_enough.
    None where a step does not bring it nearer."""
    u, y = search_range.to_scale(root), function(root)
    for _ in range(MAX_SECANTS):
        size = 1.0 if search_range.logarithmic else abs(u)
        if y == 0 or (rising and abs(y / rising) <= SECANT_TOLERANCE * size):
            return search_range.from_scale(u)
        v = search_range.to_scale(search_range.from_scale(u - y / rising)) if rising else u
        z = function(search_range.from_scale(v)) if v != u else math.nan
        if not abs(z) <= abs(y) / 2:
            break
        u, y, rising = v, z, (z - y) / (v - u)
    return search_range.from_scale(u) if abs(y) <= near_enough else None


def find_root_near(function: Function, search_range: Range, root: float, near_enough: float) -> float | None:
    """The root of a function near that of an approximation: to 1e-9, or where |function| <= near_enough. None where the
    function keeps its sign within a tenth of the range."""
    u, reach = (
        search_range.to_scale(root),
        search_range.to_scale(search_range.high) - search_range.to_scale(search_range.low),
    )

    def evaluate(u: float) -> tuple[float, float]:
        x = search_range.from_scale(u)
        return x, function(x)

    start = evaluate(u)
    if abs(start[1]) <= near_enough:
        return root
    step, end = FIRST_STEP * reach, evaluate(u + FIRST_STEP * reach)
    side, previous = (1, end) if abs(end[1]) < abs(start[1]) else (-1, start)
    if start[1] * end[1] > 0:
        while previous[1] * (end := evaluate(u + side * step))[1] > 0 and step < reach / 10:
            previous, step = end, 2 * step
        start = previous
    if not start[1] * end[1] <= 0:
        return None
    return close_bracket(function, search_range, start, end, lambda x, y: abs(y) <= near_enough, NEAR_ROOT_WIDTH)


def close_bracket(
    function: Function,
    search_range: Range,
    start: tuple[float, float],
    end: tuple[float, float],
    near_enough: Callable[[float, float], bool] = lambda x, y: False,
    width: float = EXACT_WIDTH,
) -> float:
    """The root between two places (x, y) of opposite signs (Chandrupatla, Adv. Eng. Software 28, 1997, 145-149).

    Ends where near_enough(x, y), at a root, or where the bracket is closed to the relative width `width`, by default to
    rounding; where the function jumps over zero, at the jump. For whole numbers: the neighbour of the change of sign
    at which the function is nearer to zero."""
    (a, fa), (b, fb) = (search_range.to_scale(start[0]), start[1]), (search_range.to_scale(end[0]), end[1])
    c, fc, t = a, fa, 0.5
    for _ in range(200):
        x = search_range.from_scale(a + t * (b - a))
        u = search_range.to_scale(x)
        between = abs(search_range.from_scale(b) - search_range.from_scale(a))
        if (
            x in (search_range.from_scale(a), search_range.from_scale(b))
            or between <= width * abs(x)
            or (search_range.whole_numbers and between <= 1)
        ):
            break
        f = function(x)
        if f == 0 or near_enough(x, f) or math.isnan(f):
            return x
        if (f > 0) == (fa > 0):
            c, fc = a, fa
        else:
            c, b, fc, fb = b, a, fb, fa
        a, fa = u, f
        t = _next_share(a, b, c, fa, fb, fc)
    u, _ = min(((a, fa), (b, fb)), key=lambda point: abs(point[1]))
    return search_range.from_scale(u)


def _next_share(a: float, b: float, c: float, fa: float, fb: float, fc: float) -> float:
    """The next place between a and b, as a share: inverse quadratic interpolation where it is safe, else half."""
    if c in (a, b) or fc in (fa, fb):
        return 0.5
    xi, phi = (a - b) / (c - b), (fa - fb) / (fc - fb)
    if not (phi**2 < xi and (1 - phi) ** 2 < 1 - xi):
        return 0.5
    share = fa / (fb - fa) * fc / (fb - fc) + (c - a) / (b - a) * fa / (fc - fa) * fb / (fc - fb)
    margin = 2e-15 * max(abs(a), 1e-300) / abs(b - a)
    return min(max(share, margin), 1 - margin)


def _with_edges(
    function: Function, search_range: Range, places: list[tuple[float, float]]
) -> list[tuple[float, float]]:
    """The places plus those where the function starts or stops being defined, to a thousandth of a step."""
    extended = list(places)
    if search_range.whole_numbers:
        return extended
    for point, next_point in pairwise(places):
        if math.isnan(point[1]) == math.isnan(next_point[1]):
            continue
        undefined_place, defined_place = (point, next_point) if math.isnan(point[1]) else (next_point, point)
        for _ in range(10):
            x = search_range.from_scale(
                (search_range.to_scale(undefined_place[0]) + search_range.to_scale(defined_place[0])) / 2
            )
            middle = (x, function(x))
            undefined_place, defined_place = (
                (middle, defined_place) if math.isnan(middle[1]) else (undefined_place, middle)
            )
        extended.append(defined_place)
    return sorted(extended)


def _with_turns(
    function: Function, search_range: Range, places: list[tuple[float, float]]
) -> list[tuple[float, float]]:
    """The places plus the extremes, by golden sections, where the function turns back before it reaches zero. Only
    where zero may be reached: beyond a turn, the parabola through the three places comes at most that much nearer; and,
    without any zero, the turn that comes nearest."""
    extended = list(places)
    if search_range.whole_numbers:
        return extended
    has_crossing = any(y * y_next <= 0 for (_, y), (_, y_next) in pairwise(places))
    for (a, ya), (b, yb), (c, yc) in zip(places, places[1:], places[2:], strict=False):
        if math.isnan(ya + yb + yc) or not (ya * yb > 0 and yb * yc > 0 and abs(ya) > abs(yb) <= abs(yc)):
            continue
        if abs(yb) > 2 * max(abs(ya - yb), abs(yc - yb)) + 1e-12 and (has_crossing or not _is_minimum(places, b)):
            continue
        extended.append(_find_turn(function, search_range, a, c, math.copysign(1.0, yb)))
    return sorted(extended)


def _is_minimum(places: Sequence[tuple[float, float]], x: float) -> bool:
    """Whether the function is nearest to zero here: the limit, if zero is never reached."""
    return x == min((abs(y), x) for x, y in places if not math.isnan(y))[1]


def _find_turn(function: Function, search_range: Range, low: float, high: float, sign: float) -> tuple[float, float]:
    """The minimum of sign · function between two places; ends early where it crosses zero."""
    a, b = search_range.to_scale(low), search_range.to_scale(high)
    u, v = b - GOLDEN * (b - a), a + GOLDEN * (b - a)
    fu, fv = sign * function(search_range.from_scale(u)), sign * function(search_range.from_scale(v))
    for _ in range(40):
        if min(fu, fv) <= 0 or b - a < 1e-8 * max(abs(a), abs(b), 1.0):
            break
        if fu < fv:
            b, v, fv = v, u, fu
            u = b - GOLDEN * (b - a)
            fu = sign * function(search_range.from_scale(u))
        else:
            a, u, fu = u, v, fv
            v = a + GOLDEN * (b - a)
            fv = sign * function(search_range.from_scale(v))
    place, minimum = (u, fu) if fu < fv else (v, fv)
    return search_range.from_scale(place), sign * minimum
