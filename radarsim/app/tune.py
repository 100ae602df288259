"""`radarsim tune`: the values of a filter's keys with which a quantity is best over a family of cases, and their gain.

Where the quantity is exact, exact values are searched and compared. Elsewhere every value is simulated with the same
noise, of a seed of its own; the gain is measured on the realisations of the config's seed, which the search has not
used, so that the optimism of a least value is in no number. Both filters see the same plots there: it is paired."""

import itertools
import math
import os
import re
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.app import configs, quantities, solve
from radarsim.app.configs import Config, load
from radarsim.app.quantities import Asked, Range, Wanted
from radarsim.app.run import merged
from radarsim.app.sensitivity import interval
from radarsim.app.shown import Shown
from radarsim.app.solve import Curve, timed
from radarsim.config import fields
from radarsim.config.check import label
from radarsim.config.document import did_you_mean
from radarsim.config.experiment import Case, Experiment, complete
from radarsim.config.fields import NumericKey
from radarsim.config.load import flow, given
from radarsim.engine.results import CaseResult
from radarsim.errors import ConfigError, argument
from radarsim.language import few, listed, plural, tr
from radarsim.report import tables
from radarsim.report.outside import TUNED
from radarsim.report.wording import shown, with_unit
from radarsim.studies import registry

if TYPE_CHECKING:
    import pandas as pd

FACTOR = 1e4  # of its value, to which a positive key is searched on both sides
TRAINING = 2**32  # more than the seed of the config: the seed of the noise that is searched with
MOST_KEYS = 6  # that are searched unless they are named
MOST_WHOLE = 100  # combinations of whole numbers
FLAT = 1e-3  # of the quantity: within it a key is as good as tuned
LEAST_SHARE = 1e-4  # of a probability, and of what is left of 1
STEP = 0.25  # on the scale of the search, of derivatives of sampled values
# Of exact and of sampled values: how closely the scale is searched, the logarithm of what is minimised, values a key of
# a simplex at most, and those expected of both.
CLOSE, ALIKE, TRIED = {True: 1e-7, False: 1e-2}, {True: 1e-12, False: 1e-6}, {True: 200, False: 50}
EXPECTED = {True: 100, False: 40}
SIMPLEX = 0.5, 0.1  # first steps, one simplex after the other
POINTS, PILOT_SHARE, PILOT_LEAST = 13, 8, 200  # of the scan of sampled values: values, and realisations of all
SAME = 1e-9  # of the quantity: it changes no more where a key has no effect
NO_GAIN = 1e-3  # per cent or points of an exact gain that are called nothing
NEAR_END = 0.01  # on the scale of the search, or of a linear one
DIGITS = 6  # of a tuned value: there the quantity hardly changes with it
WANTED = re.compile(
    r"(?P<name>[\w-]+)(?: +(?P<part>(?!at )\S.*?))??(?: +at +(?:(?P<s>[\d.eE+-]+) *s|k *=? *(?P<k>\d+)))?"
)
Place = tuple[float, ...]
Path = tuple[str | int, ...]


class Share(Range):
    """A probability, searched by its logit."""

    def inner(self, x: float) -> float:
        return math.log(x / (1 - x))

    def outer(self, u: float) -> float:
        return min(max(1 / (1 + math.exp(-u)), self.low), self.high)


@dataclass(frozen=True)
class Searched:
    """A key that is searched: where it stands in its filter, its stated value, its range.

    of: where it is one of probabilities that sum to one, the largest of these, its ratio to which is searched."""

    path: Path
    stated: float
    over: Range
    of: Path | None = None


@dataclass(frozen=True)
class Tuning:
    """A key as it was stated and is tuned; exact: the range that is as good to 0.1 %, the other keys tuned; sampled:
    the 95 % interval of the best value, None where it is not known."""

    key: str
    unit: str
    stated: float
    tuned: float
    lo: float | None
    hi: float | None


@dataclass(frozen=True)
class Judged:
    """The quantity of a case, or of all, with stated and tuned keys; gain and its 95 % interval in per cent of the
    stated value, of a share in points. Exact: lo and hi equal the gain."""

    case: str
    stated: float
    tuned: float
    gain: float
    lo: float
    hi: float


@dataclass(frozen=True, repr=False)
class Tuned(Shown):
    """What was found: keys, the gain of each case and that of all.

    training and judged are numbers of realisations a case, none where exact; minimised says what is least, or largest.
    settings are the tuned values by key; command is a run with them, of the noise with which the gain is measured.
    inert: the keys without effect on the quantity."""

    stem: str
    filter: str
    quantity: Asked
    unit: str
    minimised: str
    exact: bool
    keys: tuple[Tuning, ...]
    cases: tuple[Judged, ...]
    all: Judged
    training: int
    judged: int
    settings: Mapping[str, float]
    command: str
    notes: tuple[str, ...] = ()
    inert: tuple[str, ...] = ()

    @property
    def table(self) -> "pd.DataFrame":
        """A row for each key: stated and tuned value, and the range of the tuned one."""
        return tables.frame({name: [getattr(one, name) for one in self.keys] for name in Tuning.__annotations__})

    @property
    def gains(self) -> "pd.DataFrame":
        """A row for each case, and the last for all of them: what tuning gains."""
        rows = (*self.cases, self.all)
        return tables.frame({name: [getattr(one, name) for one in rows] for name in Judged.__annotations__})

    @property
    def gain_unit(self) -> str:
        """What gains are counted in."""
        return "%" if self.quantity.of.kind == "size" else tr("points") if self.unit == "%" else tr(self.unit)

    @property
    def answer(self) -> str:
        """What tuning gains, in a sentence."""
        one, of = self.all, {"quantity": self.quantity.said}
        if self.exact:
            if len(self.inert) == len(self.keys):
                return plural(
                    "There is nothing to tune: {keys} has no effect on {quantity}.",
                    "There is nothing to tune: {keys} have no effect on {quantity}.",
                    len(self.inert),
                    keys=listed(self.inert),
                    **of,
                )
            if abs(one.gain) < NO_GAIN:
                return tr("Tuning gains nothing: {quantity} is at its best as stated (exact).", **of)
            words = tr("exact")
        else:
            others = plural("{count} other realisation", "{count} other realisations", self.judged)
            words = f"95 % {shown(one.lo, '+.3g')} … {shown(one.hi, '+.3g')}; {others}"
        told = of | {"gain": f"{shown(one.gain, '.3g')} {self.gain_unit}", "how": words}
        told |= {"stated": shown(one.stated, ".4g"), "tuned": f"{shown(one.tuned, '.4g')} {tr(self.unit)}".rstrip()}
        if one.hi < 0:
            told["gain"] = f"{shown(-one.gain, '.3g')} {self.gain_unit}"
            return tr("Tuning loses {gain} in the {quantity}: {stated} → {tuned} ({how}).", **told)
        if not one.lo > 0:
            return tr("Tuning gains nothing that shows in the {quantity}: {gain} ({how}).", **told)
        return tr("Tuning gains {gain} in the {quantity}: {stated} → {tuned} ({how}).", **told)

    def member(self, case: Case) -> dict[str, Any]:
        """The tuned filter as the keys of a further one of a case."""
        (i,) = [i for i, one in enumerate(case.spec.members) if one.name == self.filter]
        made = complete(case.spec.members[i])
        for key, value in self.settings.items():
            put(made, path_of(key.split(".", 2)[2]), value)
        return made | {"name": self.filter + TUNED}

    def _said(self) -> list[str]:
        return [self.answer, *(f"{one.key} = {with_unit(one.tuned, one.unit)}" for one in self.keys)]


class Variants:
    """A case with one filter alone, and what its gains are against, with other values of keys; as `Cases` is."""

    def __init__(self, case: Case, chosen: str, searched: Sequence[Searched], paired: bool):
        self.case, self.chosen, self.searched, self.seed = case, chosen, searched, case.seed
        self.plain = {one.name: complete(one) for one in case.spec.members}
        own = getattr(case.spec, "baseline", None)
        self.baseline = (own or next(iter(self.plain))) if paired else None
        self.kept = {chosen, self.baseline}
        try:
            self.base = self.of(self.plain[chosen])
        except ConfigError:  # other keys name the filters that are left out
            self.kept, self.baseline = set(self.plain), own
            self.base = self.of(self.plain[chosen])

    def of(self, own: Mapping[str, Any], *tuned: Mapping[str, Any]) -> Case:
        """The case with these keys of the filter, and a tuned one beside it. Raises ConfigError."""
        members = [own if name == self.chosen else one for name, one in self.plain.items() if name in self.kept]
        made = with_filters(self.case, [*members, *tuned], self.baseline)
        return replace(made, seed=self.seed, noise_of=self.case.noise_of or self.case.spec)

    def at(self, key: str, place: Place) -> Case:
        """The case with other values. Raises ConfigError where the config refuses them."""
        return self.of(self.filter(place))

    def beside(self, place: Place) -> Case:
        """The case with the filter as stated and as tuned, with the config's own seed."""
        made = self.of(self.plain[self.chosen], self.filter(place) | {"name": self.chosen + TUNED})
        return replace(made, seed=self.case.seed)

    def filter(self, place: Place) -> dict[str, Any]:
        """The filter's keys with other values."""
        made = deepcopy(self.plain[self.chosen])
        for path, value in natural(self.searched, place, made).items():
            put(made, path, value)
        return made


def with_filters(case: Case, members: Sequence[Mapping[str, Any]], baseline: str | None) -> Case:
    """A case with other filters. Raises ConfigError where the config refuses them."""
    own = {"study": case.study, "realisations": case.realisations, "seed": case.seed, "baseline": baseline}
    keys = complete(case.spec) | own | {type(case.spec).bare_keys: members}
    (made,) = load({key: value for key, value in keys.items() if value is not None}).cases
    return replace(case, spec=made.spec)


def natural(searched: Sequence[Searched], place: Place, plain: Mapping[str, Any]) -> dict[Path, float]:
    """The values of keys at a place of the search, with all of a column of probabilities; plain: as stated."""
    found = {one.path: x for one, x in zip(searched, place, strict=True) if one.of is None}
    for top in dict.fromkeys(one.of for one in searched if one.of is not None):
        most, ratios = at_path(plain, top), dict[Path, float]()
        for i, row in enumerate(plain[str(top[0])]):
            share = at_path(row, top[2:])
            ratios |= {(top[0], i, *top[2:]): share / most} if share > 0 else {}
        ratios |= {one.path: x for one, x in zip(searched, place, strict=True) if one.of == top}
        found |= {path: ratio / sum(ratios.values()) for path, ratio in ratios.items()}
    return {path: solve.rounded(value) for path, value in found.items()}


def at_path(plain: Any, path: Path) -> Any:
    """What stands at a path."""
    for step in path:
        plain = plain[step]
    return plain


def path_of(text: str) -> Path:
    """The path of a dotted key."""
    return tuple(int(step) if step.isdecimal() else step for step in text.split("."))


def put(plain: Any, path: Path, value: float) -> None:
    """Put a number at a path."""
    at_path(plain, path[:-1])[path[-1]] = int(value) if value.is_integer() else value


def parsed(wanted: str, chosen: str | None) -> Wanted:
    """The quantity named by text such as `sigma r at 60 s`, `lock at k = 6`. Raises ConfigError."""
    match = WANTED.fullmatch(wanted.strip()) if isinstance(wanted, str) else None
    if match is None or " at " in f" {match['part']} ":
        example = '"sigma r at 60 s"'
        raise ConfigError(f"{argument('wanted', '--for')}: must be a quantity such as {example}, got {wanted!r}")
    name, part, at_s, at_k = match.group("name", "part", "s", "k")
    try:
        return Wanted(name.replace("-", "_"), chosen, part, float(at_s) if at_s else None, int(at_k) if at_k else None)
    except ValueError:
        raise ConfigError(f"{argument('wanted', '--for')}: no time in s: {at_s}") from None


@contextmanager
def instead(names: Mapping[str, str]) -> Iterator[None]:
    """Messages with these names of arguments in the place of others."""
    try:
        yield
    except ConfigError as error:
        lines = list(error.lines)
        for old, new in names.items():
            lines = [line.replace(old, new, 1) for line in lines]
        raise ConfigError(*lines) from None


def keys_of(case: Case, chosen: str, free: Mapping[str, tuple[float, float] | None]) -> tuple[Searched, ...]:
    """The keys that are searched: as named, each with its range or None; else all of the filter that are real numbers
    other than zero. Raises ConfigError."""
    spec, option = case.spec, argument("free", "--free")
    (i,) = [i for i, one in enumerate(spec.members) if one.name == chosen]
    above = f"{type(spec).bare_keys}.{i}."
    known = {one.path.removeprefix(above): one for one in fields.keys(spec) if one.path.startswith(above)}
    wanted: dict[str, tuple[float, float] | None] = {}
    for name, between in free.items():
        bare = name.removeprefix(above)
        own = [path for path in known if f"{path}.".startswith(f"{bare}.")]
        if not own:
            near = did_you_mean(bare, known) or f"; there are: {', '.join(known)}"
            raise ConfigError(f"{option}: no key {name!r} of filter {chosen!r} holds a number{near}")
        wanted |= dict.fromkeys(own, between)
    if not free:
        wanted = {path: None for path, one in known.items() if one.value and not one.whole}
    made, plain = [], complete(spec.members[i])
    for path, between in wanted.items():
        one = _searched(spec.members[i], plain, path, known[path], between)
        made += [] if one is None else [one]
    if not made:
        near = ", ".join(path for path, one in known.items() if one.value is not None)
        raise ConfigError(f"{option}: filter {chosen!r} states no real number other than zero: name one of {near}")
    if not free and len(made) > MOST_KEYS:
        names = few(list(dict.fromkeys(path.partition(".")[0] for path in wanted)), 8)
        raise ConfigError(f"{option}: filter {chosen!r} has {len(made)} keys to tune: name those to tune, of {names}")
    return tuple(made)


def _searched(
    member: Any, plain: Mapping[str, Any], text: str, key: NumericKey, between: tuple[float, float] | None
) -> Searched | None:
    """A key as it is searched; None for the largest of probabilities that sum to one, which follows from the others,
    and for one of them that is zero."""
    path = path_of(text)
    marks = type(member).model_fields[str(path[0])].metadata
    if any(isinstance(mark, fields.ColumnsOfOne) for mark in marks):
        column: dict[Path, float] = {}
        for i, row in enumerate(plain[str(path[0])]):
            column[path[0], i, path[2]] = row[path[2]]
        top = max(column, key=column.__getitem__)
        if path == top or not column[path]:
            return None
        ratio = column[path] / column[top]
        return Searched(path, ratio, quantities.searched(ratio / FACTOR, ratio * FACTOR), top)
    if key.value is None:
        raise ConfigError(f"{key.path}: has no value to begin from: {argument('overrides', '--set')} it")
    free = argument("free", "--free")
    ranged = argument('free={"KEY": (LOW, HIGH)}', f"{free} KEY=LOW:HIGH")
    with instead({solve.ends(): ranged, argument("between"): free}):
        over = solve.range_of([key], key.path, between, FACTOR)
    if not key.whole and (key.low, key.high) == (0, 1) and between is None:
        rest = min(LEAST_SHARE, *(x / 10 for x in (key.value, 1 - key.value) if x > 0))
        over = Share(rest, 1 - rest, False)
    return Searched(path, min(max(key.value, over.low), over.high), over)


class Objective:
    """What is minimised, at a place of the search: over the family the root of the mean square of a size, the mean of
    anything else; of a quantity that is better the larger, 100 % less its value."""

    def __init__(self, variants: Sequence[Variants], curves: Sequence[Curve], exact: bool, count: int):
        self.variants, self.curves, self.exact, self.count = variants, curves, exact, count
        self.searched, self.plain = variants[0].searched, variants[0].plain[variants[0].chosen]
        self.of = curves[0].quantity.of
        self.rough = exact and any(curve.rough for curve in curves)

    @property
    def pilot(self) -> int:
        """Realisations of a value of a scan."""
        return min(self.count, max(PILOT_LEAST, self.count // PILOT_SHARE))

    def combined(self, values: Sequence[Any]) -> Any:
        """The quantity of the family, of values of its cases, numbers or arrays."""
        size = self.of.kind == "size"
        found = sum(value**2 if size else value for value in values) / len(values)
        return found**0.5 if size else found

    def cost(self, values: Sequence[Any]) -> Any:
        """What is minimised, of values of the cases."""
        found = self.combined(values)
        return 100.0 - found if self.of.more_is_better else found

    def __call__(self, place: Place, count: int | None = None) -> float:
        """At a place, with all training realisations or fewer; infinite where there is none."""
        if self.rough:
            values = [curve.roughly(place) for curve in self.curves]
        elif self.exact:
            values = [curve.exactly(place) for curve in self.curves]
        else:
            values = [curve.simulated(place, count or self.count).value for curve in self.curves]
        found = float(self.cost(values))
        return math.inf if math.isnan(found) else found


def least(of: Objective) -> Place:
    """The place with the least value: of every combination of whole numbers the others by scans, one after the other;
    from the best by simplexes (Nelder and Mead)."""
    from scipy.optimize import minimize

    searched, start = of.searched, tuple(one.stated for one in of.searched)
    real = [i for i, one in enumerate(searched) if not one.over.whole]
    pilot = None if of.exact else of.pilot
    grids = [one.over.grid() if one.over.whole else [one.stated] for one in searched]
    if math.prod(map(len, grids)) > MOST_WHOLE:
        raise ConfigError(f"{argument('free', '--free')}: too many whole numbers to try: give KEY=LOW:HIGH")

    def scanned(best: Place) -> Place:
        for i in real:
            tried = [(*best[:i], x, *best[i + 1 :]) for x in searched[i].over.grid(None if of.exact else POINTS)]
            best = min((best, *tried), key=lambda place: of(place, pilot))
        return best

    possible = [place for place in itertools.product(*grids) if math.isfinite(of(place, pilot))]
    best = min(map(scanned, possible), key=lambda place: of(place, pilot), default=start)
    for step in SIMPLEX if real else ():
        at = np.array([searched[i].over.inner(best[i]) for i in real])
        options: Any = {"initial_simplex": np.vstack([at, at + step * np.eye(len(at))]), "xatol": CLOSE[of.exact]}
        options |= {"fatol": ALIKE[of.exact], "maxfev": TRIED[of.exact] * len(at)}
        logarithm: Any = lambda u, best=best: float(np.log(max(of(moved(searched, best, u)), 1e-300)))  # noqa: E731
        best = moved(searched, best, minimize(logarithm, at, method="Nelder-Mead", options=options).x)
    best = tuple(float(f"{x:.{DIGITS}g}") for x in best)
    return min((start, best), key=of)


def moved(searched: Sequence[Searched], best: Place, at: np.ndarray) -> Place:
    """A place with the real numbers at other places (n,) of the scales of the search."""
    there = iter(at)
    return tuple(
        x if one.over.whole else one.over.outer(float(next(there))) for one, x in zip(searched, best, strict=True)
    )


def flat(of: Objective, best: Place, i: int) -> tuple[float, float]:
    """From where to where along a key the exact quantity is within 0.1 % of its least value."""
    over, limit = of.searched[i].over, (1 + FLAT) * of(best)
    ends = []
    for end in (over.low, over.high):
        inside, outside = over.inner(best[i]), over.inner(end)
        if of((*best[:i], end, *best[i + 1 :])) > limit:
            for _ in range(24):
                middle = (inside + outside) / 2
                good = of((*best[:i], over.outer(middle), *best[i + 1 :])) <= limit
                inside, outside = (middle, outside) if good else (inside, middle)
            outside = inside
        ends.append(over.outer(outside))
    return ends[0], ends[1]


def inert(of: Objective, best: Place, i: int) -> bool:
    """Whether a key changes nothing over the whole searched range."""
    over = of.searched[i].over
    ends = (of((*best[:i], x, *best[i + 1 :])) for x in (over.low, over.high))
    return all(math.isclose(value, of(best), rel_tol=SAME) for value in ends)


def spread(of: Objective, best: Place) -> dict[Path, tuple[float, float]]:
    """The 95 % intervals of the best values, of real numbers: by how much they move without each of the batches. That
    is a Newton step from the best place, whose gradient is that of the others; nothing where the quantity has no
    minimum there on this scale, as where it is flat or jumps, or the search ended."""
    searched = [
        replace(one, over=replace(one.over, whole=True)) if at_end(one, x) else one
        for one, x in zip(of.searched, best, strict=True)
    ]
    at = np.array([one.over.inner(x) for one, x in zip(searched, best, strict=True) if not one.over.whole])

    def costs(u: np.ndarray) -> np.ndarray:
        """With all realisations, then without each of the batches."""
        cases = [one.at("", moved(searched, best, u)) for one in of.variants]
        pairs = zip(cases, of.curves, strict=True)
        return np.asarray(of.cost([parted(case, (curve.quantity,), of.count)[:, 0] for case, curve in pairs]))

    size, steps = len(at), STEP * np.eye(len(at))
    if not size:
        return {}
    try:
        here = costs(at)
        above, below = ([costs(at + sign * step) for step in steps] for sign in (1, -1))
        cross = {(i, j): costs(at + steps[i] + steps[j]) for i, j in itertools.combinations(range(size), 2)}
    except ConfigError:
        return {}
    slopes = (np.array(above) - np.array(below)) / (2 * STEP)
    curvature = np.diag([(a[0] - 2 * here[0] + b[0]) / STEP**2 for a, b in zip(above, below, strict=True)])
    for (i, j), both in cross.items():
        curvature[i, j] = curvature[j, i] = (both[0] - above[i][0] - above[j][0] + here[0]) / STEP**2
    if not np.isfinite(curvature).all() or np.linalg.eigvalsh(curvature)[0] <= 0:
        return {}
    newton = at[:, None] - np.linalg.solve(curvature, slopes - slopes[:, :1])
    values = [natural(searched, moved(searched, best, u), of.plain) for u in newton.T]
    found = {}
    for path in values[0]:
        own = [one for one in searched if one.path == path and one.of is None]
        if own and own[0].over.whole:
            continue
        over = own[0].over if own else Share(LEAST_SHARE**2, 1 - LEAST_SHARE**2, False)
        inner = np.array([over.inner(min(max(one[path], over.low), over.high)) for one in values])
        _, lo, hi = interval(inner[1:], float(inner[0]))
        found[path] = over.outer(lo), over.outer(hi)
    return found


def at_end(of: Searched, x: float) -> bool:
    """Whether a value is at an end of the searched range."""
    low, high, at = (of.over.inner(one) for one in (of.over.low, of.over.high, x))
    return min(at - low, high - at) < NEAR_END * min(1.0, high - low)


def parted(case: Case, asked: Sequence[Asked], count: int) -> np.ndarray:
    """Quantities (Q) of a case: (1 + n, Q) of all realisations, then without each of n batches."""

    def values(result: CaseResult) -> list[float]:
        return [float(quantities.sampled(one, result)[0].value) for one in asked]

    whole, but_one, _ = solve.without_one(case, values, count)
    return np.array([whole, *but_one])


def _predict(notify: Callable[[str], None], of: Objective, each: float) -> None:
    """Say what the search will do and about how long it takes, where that is long; each: seconds of one place."""
    grids = [len(one.over.grid(None if of.exact or one.over.whole else POINTS)) for one in of.searched]
    whole = [one.over.whole for one in of.searched]
    scans = math.prod(itertools.compress(grids, whole)) * max(1, sum(grids) - sum(itertools.compress(grids, whole)))
    full = EXPECTED[of.exact] * whole.count(False)
    pilot, count = (1, 1) if of.exact else (of.pilot, of.count)
    for curve in of.curves:
        curve.expected = scans * pilot + full * count
    keys = plural("{count} key", "{count} keys", len(grids))
    what = tr("searches {keys}, about {count} places", keys=keys, count=scans + full)
    solve.predict(notify, what, each * (scans * pilot / count + full))


def judged(of: Objective, names: Sequence[str], pairs: Sequence[np.ndarray]) -> list[Judged]:
    """The gain of each case, and the last of all; pairs (1 + n, 2) of each case: stated and tuned."""
    found, less = [], -1 if of.of.more_is_better else 1
    every = [*pairs, np.stack([of.combined([pair[:, i] for pair in pairs]) for i in (0, 1)], axis=1)]
    for name, pair in zip((*names, ""), every, strict=True):
        stated, tuned = pair.T
        with np.errstate(divide="ignore", invalid="ignore"):
            gains = less * (stated - tuned) * (100 / stated if of.of.kind == "size" else 1)
        ends: Sequence[float] = interval(gains[1:], float(gains[0])) if len(gains) > 1 else [float(gains[0])] * 3
        found.append(Judged(name, float(stated[0]), float(tuned[0]), *ends))
    return found


def family(
    config: Config, settings: Sequence[str], members: Sequence[str], names: Sequence[str]
) -> tuple[list[Case], list[str]]:
    """The cases over which a filter is tuned, and the names of filters of Python, which they are without.

    members: settings of each. Raises ConfigError."""
    outside: list[str] = []
    cases, set_too = [], {one.partition("=")[0].strip() for one in settings}
    for member in members:
        key = member.partition("=")[0].strip()
        if key in set_too:
            raise ConfigError(f"{argument('over', '--over')}: {key} is given by {given(key)} too")
        with instead({str(given(key)): argument("over", "--over")}):
            experiment = load(config, [*settings, *([member] if member else [])])
        outside += [one.name for case in experiment.cases for one in case.outside]
        cases += [
            replace(case, name=f"{case.name} {member}".strip(), against=(), outside=()) for case in experiment.cases
        ]
    for name in names:
        quantities.named(name, [case.name for case in cases], "case")
    return [case for case in cases if not names or case.name in names], outside


def _ranged(given: Any) -> tuple[str, tuple[float, float] | None]:
    """A key and the range to search, of KEY, KEY=LOW:HIGH, or both as they are. Raises ConfigError."""
    key, _, ends = given.partition("=") if isinstance(given, str) else (given[0], "", given[1])
    try:
        low, high = map(float, ends.split(":") if isinstance(ends, str) else ends) if ends else (0.0, 0.0)
    except (TypeError, ValueError):
        where = argument("free", "--free")
        raise ConfigError(f"{where}: must be KEY or KEY=LOW:HIGH with two numbers, got {key}={ends}") from None
    return key, (low, high) if ends else None


def tune(
    config: Config,
    wanted: str,
    *,
    filter: str | None = None,
    over: Mapping[str, Sequence[Any]] | Sequence[str] = (),
    free: Mapping[str, Sequence[float] | None] | Sequence[str] = (),
    case: str | Sequence[str] = (),
    overrides: configs.Overrides = (),
    realisations: float | None = None,
    seed: int | None = None,
    threads: int | None = None,
    sampled: bool = False,
    progress: Callable[[int, int, int], None] | None = None,
    notify: Callable[[str], None] | None = None,
) -> Tuned:
    """Find the values of a filter's keys with which a quantity is best, and measure what they gain.

    wanted is a quantity of `radarsim solve` with its component, and a time or scan, `"sigma r at 60 s"`, `"gain r at k
    6"`; default: the last scan. free: the keys, by name, `KEY=LOW:HIGH`, or a mapping to the range to search or None;
    default: all of the filter that are real numbers other than zero. Elements of a matrix of probabilities keep columns
    that sum to one; zeros stay. over: the family of targets, stems of scenarios or texts `KEY=VALUE`, or values by key;
    case: some of the config's cases; default: all. Over a family the root of the mean of σ² is least, or the mean rate
    is best.

    If σ is not known exactly, or is to be `sampled`, the search uses `realisations` with noise of its own seed, by
    default as many as the config's, and the gain is measured on as many of the config's seed, stated and tuned filter
    on the same plots. notify is called with a line on what a search of some seconds will do.

    `keys` have the stated and the tuned value, `all` and `cases` the gain with its 95 % interval, in per cent of σ, of
    rates in points. Raises ConfigError for a wrong config, key, filter or quantity.

    >>> found = tune("rls2", "sigma r at 60 s", filter="r+Vr", over=["turn", "jerk_pulse"])
    >>> print(f"{found.keys[0].tuned:.3f} {found.keys[0].unit}", f"{found.all.gain:.1f} %", found.exact)
    4.187 (m/s³)² 36.3 % True
    """
    settings = merged(configs.check(overrides, threads=threads), None, seed)
    if isinstance(over, Mapping):
        over = [text for key, values in over.items() for value in values for text in configs.check({key: value})]
    configs.texts((*over, *free))
    ranges = dict(asked_for := [*map(_ranged, free.items() if isinstance(free, Mapping) else free)])
    if len(ranges) < len(asked_for):
        raise ConfigError(f"{argument('free', '--free')}: a key is given twice")
    members = [*dict.fromkeys(one if "=" in one else f"target={one}" for one in over)] or [""]
    every, outside = family(config, settings, members, [case] if isinstance(case, str) else case)
    asked_at = dict.fromkeys((argument("at_k", "--at-k"), argument("at_s", "--at")), argument("wanted", "--for"))
    with instead(asked_at):
        kind = quantities.checked(parsed(wanted, filter), every[0], outside)
    chosen = quantities.resolved(kind, quantities.labels(kind, every[0])).filter
    assert chosen is not None  # resolved
    for other in every:
        quantities.named(chosen, [one.name for one in other.spec.members])
    each = [keys_of(other, chosen, ranges) for other in every]
    if apart := {one.path for keys in each for one in {*keys} ^ {*each[0]}}:
        text = ", ".join(".".join(map(str, path)) for path in apart)
        raise ConfigError(f"{text}: differs between the cases: choose with {argument('case', '--case')}")
    searched, count = each[0], configs.whole(realisations) or every[0].realisations
    count = solve.BATCHES * max(2, count // solve.BATCHES)
    variants = [Variants(other, chosen, searched, kind.of.paired) for other in every]
    curves = []
    for one in variants:
        asked = replace(quantities.checked(parsed(wanted, filter), one.base), filter=chosen)
        curves.append(Curve(one, "", asked, threads, progress, count))
    with instead(asked_at):
        known = [curve.exact(quantities.labels(curve.quantity, curve.cases.base)) for curve in curves]
    exact = all(known) and not sampled
    for one, curve in zip(variants, curves, strict=True):
        one.seed = one.seed if exact else (one.seed + TRAINING) % 2**64
        curve.cases.base = one.base = replace(one.base, seed=one.seed)
        curve.rough = exact and registry.study(curve.cases.base.study).costly(curve.cases.base)
    of = Objective(variants, curves, exact, count)
    start = tuple(one.stated for one in searched)
    begun = timed(lambda: of(start, 1))  # compiles
    begun = timed(lambda: of(start)) if not exact else begun
    if not math.isfinite(of(start)):
        raise ConfigError(f"{curves[0].quantity.words}: there is no estimate there")
    _predict(notify or (lambda line: None), of, begun)
    best = least(of)
    if exact:
        of.rough = False
        pairs = [np.array([[curve.exactly(None), curve.exactly(best)]]) for curve in curves]
        of.rough = any(curve.rough for curve in curves)
        ends = {one.path: flat(of, best, i) for i, one in enumerate(searched) if one.of is None}
    else:
        names = chosen, chosen + TUNED
        pairs = [
            parted(one.beside(best), [replace(curve.quantity, filter=name) for name in names], count)
            for one, curve in zip(variants, curves, strict=True)
        ]
        ends = spread(of, best)
    return _told(config, every, of, best, ends, pairs, [one for one in (*settings, members[0]) if one])


def _told(
    config: Config,
    every: Sequence[Case],
    of: Objective,
    best: Place,
    ranges: Mapping[Path, tuple[float, float]],
    pairs: Sequence[np.ndarray],
    settings: Sequence[str],
) -> Tuned:
    """The answer, with the run that shows it."""
    searched, plain, case, quantity = of.searched, of.plain, every[0], of.curves[0].quantity
    chosen = str(quantity.filter)
    (i,) = [i for i, one in enumerate(case.spec.members) if one.name == chosen]
    above, tuned = f"{type(case.spec).bare_keys}.{i}.", deepcopy(dict(plain))
    found, keys = natural(searched, best, plain), []
    for path, value in found.items():
        put(tuned, path, value)
        key = above + ".".join(map(str, path))
        ends = ranges.get(path, (None, None))
        keys.append(Tuning(key, label(case.spec, key).unit, at_path(plain, path), value, *ends))
    sets = list(settings)
    for path in found:
        # An item of a list is set with the whole list, which other items of it may have changed as well.
        text = re.sub(r"(\.\d+)+$", "", ".".join(map(str, path)))
        sets.append(f"{above}{text}={flow(at_path(tuned, path[: text.count('.') + 1]))}")
    name = os.fspath(config) if isinstance(config, str | os.PathLike) else "CONFIG.yaml"
    words = ["radarsim", "run", name, *(word for one in dict.fromkeys(sets) for word in ("--set", one))]
    axes = quantities.labels(quantity, of.curves[0].cases.base)
    judgements = judged(of, [one.name for one in every], pairs)
    held = {one.path for one, x in zip(searched, best, strict=True) if one.over.whole or at_end(one, x)}
    notes = [
        tr("{key} ends at {value}, the end of the searched range; --free KEY=LOW:HIGH searches elsewhere", **told)
        for one, x in zip(searched, best, strict=True)
        for told in [{"key": ".".join(map(str, one.path)), "value": shown(x)}]
        if at_end(one, x)
    ]
    dead = tuple(
        above + ".".join(map(str, one.path)) for i, one in enumerate(searched) if one.of is None and inert(of, best, i)
    )
    notes += [tr("{key} has no effect on {quantity}", key=key, quantity=quantity.said) for key in dead[: len(keys) - 1]]
    if not of.exact and any(path not in ranges and path not in held for path in found):
        notes.append(tr("no intervals of the values: the quantity is flat there, or too noisy to tell its curvature"))
    return Tuned(
        stem=case.stem,
        filter=chosen,
        quantity=quantity,
        unit=quantities.unit(quantity, axes),
        minimised=_minimised(of, len(every)),
        exact=of.exact,
        keys=tuple(keys),
        cases=tuple(judgements[:-1]),
        all=judgements[-1],
        training=0 if of.exact else of.count,
        judged=0 if of.exact else of.count,
        settings={one.key: one.tuned for one in keys},
        command=shlex.join(words),
        notes=tuple(notes),
        inert=dead,
    )


def _minimised(of: "Objective", cases: int) -> str:
    """What the search makes least, or largest, in words."""
    said = of.curves[0].quantity.said
    if cases == 1:
        return said
    told = {"quantity": said, "cases": str(cases)}
    if of.of.kind == "size":
        return tr("{quantity}, root mean square of {cases} cases", **told)
    return tr("{quantity}, mean of {cases} cases", **told)


def beside(
    experiment: Experiment, wanted: str | None, **asked: Any
) -> tuple[Experiment, list[str], tuple[str, float] | None]:
    """The experiment with each of its filters as tuned over all its cases too, why some are not, and the component and
    time, s, that they are tuned for, None if it has no component; raises ConfigError where none is.

    wanted: the quantity, by default σ of the first component at the last scan; asked: as `tune` takes it."""
    case, found, left_out = experiment.cases[0], list[Tuned](), []
    axes = registry.study(case.study).prepare(case).axes
    wanted = wanted or f"sigma {axes.components[0][0]}"
    for one in case.spec.members:
        try:
            found.append(tune(experiment, wanted, filter=one.name, **asked))
        except ConfigError as error:
            left_out.append(tr("{filter} is not tuned: {why}", filter=one.name, why=error.lines[0]))
    if not found:
        raise ConfigError(*left_out)
    made = []
    for each in experiment.cases:
        members = [*map(complete, each.spec.members), *(one.member(each) for one in found)]
        made.append(with_filters(each, members, getattr(each.spec, "baseline", None)))
    quantity = found[0].quantity
    at_s = axes.t_s[-1] if quantity.at_s is None else quantity.at_s
    at_s = at_s if quantity.at_k is None else axes.t_s[list(axes.k).index(quantity.at_k)]
    judged_at = (quantity.component, float(at_s)) if quantity.component else None
    return replace(experiment, cases=tuple(made)), left_out, judged_at
