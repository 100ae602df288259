"""The keys of a filter that are tuned, and the scales on which they are searched."""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

from radarsim.api.design import question, root_search, solve_answer
from radarsim.api.design.root_search import Range
from radarsim.config import marks as config_marks
from radarsim.config import numeric_keys
from radarsim.config.experiment import Case
from radarsim.config.find_files import did_you_mean
from radarsim.config.identity import all_keys
from radarsim.config.numeric_keys import NumericKey
from radarsim.errors import ConfigError, argument
from radarsim.language.translate import shorten_names

FACTOR = 1e4  # a positive key is searched from its value divided by this to its value times this
MAX_KEYS = 6  # searched unless the user names them
MAX_WHOLE_COMBINATIONS = 100  # combinations of whole numbers
MIN_PROBABILITY = 1e-4  # smallest probability, and smallest complement of one
NEAR_END = 0.01  # on the scale of the search, or of a linear one
DIGITS = 6  # of a tuned value: further digits hardly change the quantity
Place = tuple[float, ...]
Path = tuple[str | int, ...]


class ProbabilityRange(Range):
    """A probability, searched by its logit."""

    def to_scale(self, x: float) -> float:
        return math.log(x / (1 - x))

    def from_scale(self, u: float) -> float:
        return min(max(1 / (1 + math.exp(-u)), self.low), self.high)


@dataclass(frozen=True)
class SearchedKey:
    """A key that is searched: its path in the filter, its stated value, its range.

    of: for one of several probabilities that sum to one, the path of the largest; the ratio to it is searched."""

    path: Path
    stated: float
    search_range: Range
    largest_path: Path | None = None


def from_scale(searched: Sequence[SearchedKey], place: Place, filter_keys: Mapping[str, Any]) -> dict[Path, float]:
    """The values of keys at a place of the search, with all of a column of probabilities; filter_keys: as stated."""
    values = {key.path: x for key, x in zip(searched, place, strict=True) if key.largest_path is None}
    for largest_path in dict.fromkeys(key.largest_path for key in searched if key.largest_path is not None):
        largest, ratios = value_at_path(filter_keys, largest_path), dict[Path, float]()
        for i, row in enumerate(filter_keys[str(largest_path[0])]):
            share = value_at_path(row, largest_path[2:])
            ratios |= {(largest_path[0], i, *largest_path[2:]): share / largest} if share > 0 else {}
        ratios |= {key.path: x for key, x in zip(searched, place, strict=True) if key.largest_path == largest_path}
        values |= {path: ratio / sum(ratios.values()) for path, ratio in ratios.items()}
    return {path: solve_answer.rounded(value) for path, value in values.items()}


def value_at_path(keys: Any, path: Path) -> Any:
    """The value at a path."""
    for step in path:
        keys = keys[step]
    return keys


def parse_path(text: str) -> Path:
    """The path of a dotted key."""
    return tuple(int(step) if step.isdecimal() else step for step in text.split("."))


def set_at_path(keys: Any, path: Path, value: float) -> None:
    """Set the number at a path."""
    value_at_path(keys, path[:-1])[path[-1]] = int(value) if value.is_integer() else value


@contextmanager
def rename_arguments_in_errors(new_names: Mapping[str, str]) -> Iterator[None]:
    """Replace names of arguments, old to new, in the messages of ConfigErrors."""
    try:
        yield
    except ConfigError as error:
        lines = list(error.lines)
        for old, new in new_names.items():
            lines = [line.replace(old, new, 1) for line in lines]
        raise ConfigError(*lines) from None


def searched_keys(
    case: Case, filter_name: str, requested_ranges: Mapping[str, tuple[float, float] | None]
) -> tuple[SearchedKey, ...]:
    """The keys that are searched: as named, each with its range or None; else all of the filter that are real numbers
    other than zero. Raises ConfigError."""
    spec, option = case.spec, argument("free", "--free")
    (i,) = [i for i, member in enumerate(spec.members) if member.name == filter_name]
    prefix = f"{type(spec).bare_keys}.{i}."
    keys_by_path = {
        key.path.removeprefix(prefix): key for key in numeric_keys.numeric_keys(spec) if key.path.startswith(prefix)
    }
    ranges: dict[str, tuple[float, float] | None] = {}
    for name, between in requested_ranges.items():
        short_name = name.removeprefix(prefix)
        paths = [path for path in keys_by_path if f"{path}.".startswith(f"{short_name}.")]
        if not paths:
            suggestion = did_you_mean(short_name, keys_by_path) or f"; there are: {', '.join(keys_by_path)}"
            raise ConfigError(f"{option}: no key {name!r} of filter {filter_name!r} holds a number{suggestion}")
        ranges |= dict.fromkeys(paths, between)
    if not requested_ranges:
        ranges = {path: None for path, key in keys_by_path.items() if key.value and not key.is_whole}
    searched, filter_keys = [], all_keys(spec.members[i])
    for path, between in ranges.items():
        searched_key = _searched_key(spec.members[i], filter_keys, path, keys_by_path[path], between)
        searched += [] if searched_key is None else [searched_key]
    if not searched:
        names = ", ".join(path for path, key in keys_by_path.items() if key.value is not None)
        suggestion = f": name one of {names}" if names else ""
        raise ConfigError(f"{option}: filter {filter_name!r} states no real number other than zero{suggestion}")
    if not requested_ranges and len(searched) > MAX_KEYS:
        names = shorten_names(list(dict.fromkeys(path.partition(".")[0] for path in ranges)), 8)
        raise ConfigError(
            f"{option}: filter {filter_name!r} has {len(searched)} keys to tune: name those to tune, of {names}"
        )
    return tuple(searched)


def _searched_key(
    member: Any, filter_keys: Mapping[str, Any], text: str, key: NumericKey, between: tuple[float, float] | None
) -> SearchedKey | None:
    """A key as it is searched; None for the largest of probabilities that sum to one, which follows from the others,
    and for one of them that is zero."""
    path = parse_path(text)
    marks = type(member).model_fields[str(path[0])].metadata
    if any(isinstance(mark, config_marks.ColumnsOfOne) for mark in marks):
        column: dict[Path, float] = {}
        for i, row in enumerate(filter_keys[str(path[0])]):
            column[path[0], i, path[2]] = row[path[2]]
        largest_path = max(column, key=column.__getitem__)
        if path == largest_path or not column[path]:
            return None
        ratio = column[path] / column[largest_path]
        return SearchedKey(path, ratio, root_search.search_range(ratio / FACTOR, ratio * FACTOR), largest_path)
    if key.value is None:
        raise ConfigError(f"{key.path}: has no value to begin from: {argument('overrides', '--set')} it")
    option = argument("free", "--free")
    range_example = argument('free={"KEY": (LOW, HIGH)}', f"{option} KEY=LOW:HIGH")
    # A positive key that has an upper bound too is searched on the scale of its value.
    unbounded = replace(key, high=math.inf) if key.low == 0 and key.value else key
    with rename_arguments_in_errors({question.range_option(): range_example, argument("between"): option}):
        search_range = question.key_range([unbounded], key.path, between, FACTOR)
    if between is None and search_range.high > key.high:
        search_range = root_search.search_range(search_range.low, key.high, key.is_whole)
    if not key.is_whole and (key.low, key.high) == (0, 1) and between is None:
        smallest = min(MIN_PROBABILITY, *(x / 10 for x in (key.value, 1 - key.value) if x > 0))
        search_range = ProbabilityRange(smallest, 1 - smallest, False)
    return SearchedKey(path, min(max(key.value, search_range.low), search_range.high), search_range)


def is_at_end(key: SearchedKey, x: float) -> bool:
    """Whether a value is at an end of the searched range."""
    low, high, position = (
        key.search_range.to_scale(value) for value in (key.search_range.low, key.search_range.high, x)
    )
    return min(position - low, high - position) < NEAR_END * min(1.0, high - low)


def parse_range(entry: Any) -> tuple[str, tuple[float, float] | None]:
    """A key and its range or None, from `KEY`, `KEY=LOW:HIGH` or a pair (key, range). Raises ConfigError."""
    key, _, ends = entry.partition("=") if isinstance(entry, str) else (entry[0], "", entry[1])
    try:
        low, high = map(float, ends.split(":") if isinstance(ends, str) else ends) if ends else (0.0, 0.0)
    except (TypeError, ValueError):
        option = argument("free", "--free")
        raise ConfigError(f"{option}: must be KEY or KEY=LOW:HIGH with two numbers, got {key}={ends}") from None
    return key, (low, high) if ends else None
