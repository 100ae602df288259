"""Where the items of an ASTERIX record lie: their lengths, and the places and units of their fields.

The specification is that of the library libasterix. Decoding a record into its objects takes 0.3 ms, so only the
lengths of items are followed here; the fields needed are cut out of many records at a time.

A data block is its category (1 byte), its length (2 bytes, these three included) and records; a record is a field
specification (7 bits a byte, the eighth says that another byte follows) and the items that it names.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

from radarsim.recorded.formats import sites

Skip = Callable[[bytes, int], int]  # data and start of an item: its end


class Damaged(ValueError):
    """Bytes that the specification does not allow: where they are, and what is wrong."""

    def __init__(self, at: int, what: str):
        super().__init__(what)
        self.at, self.what = at, what


class Field(NamedTuple):
    """A number in items: its first byte, the bits after it, bytes it spans, bits, sign, resolution."""

    first: int
    shift: int
    size: int
    bits: int
    signed: bool
    step: float

    def whole(self, data: np.ndarray, at: np.ndarray) -> np.ndarray:
        """The bits as integers (n,) in the items that begin at `at` (n,); of no meaning where there is no item."""
        found = np.zeros(len(at), dtype=np.int64)
        for i in range(self.size):
            found = found << 8 | data[at + (self.first + i)]
        found = found >> self.shift & ((1 << self.bits) - 1)
        return found - (found >> (self.bits - 1) << self.bits) if self.signed else found

    def of(self, data: np.ndarray, at: np.ndarray) -> np.ndarray:
        """The values (n,) in the items that begin at `at` (n,); NaN where that is negative, as there is no item."""
        return np.where(at < 0, np.nan, self.whole(data, at) * self.step)


class Flag(NamedTuple):
    """Bits in an item that goes on while the last bit of a byte says so: their byte, the bits after them, how many."""

    byte: int
    shift: int
    bits: int

    def of(self, data: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Their values (n,); 0 where there is no item, or it ends before them."""
        there = at >= 0
        for i in range(self.byte):
            there = there & (data[at + i] & 1 == 1)
        return np.where(there, data[at + self.byte] >> self.shift & (1 << self.bits) - 1, 0)


def _library() -> tuple[ModuleType, ModuleType]:
    """The modules `base` and `generated` of libasterix; raises ConfigError where it is not installed."""
    try:
        from asterix import base, generated
    except ImportError as error:
        raise sites.needs("libasterix", "asterix") from error
    return base, generated


@cache
def newest(category: int) -> Any:
    """The newest edition of a category in libasterix."""
    _, generated = _library()
    return max(generated.manifest["CATS"][category], key=lambda edition: edition.cv_edition)


def edition(category: int) -> str:
    """The number of the edition that is read."""
    return ".".join(map(str, newest(category).cv_edition))


@cache
def record(category: int, variant: str | None = None) -> Any:
    """The profile of a category's records; category 001 has one for a plot and one for a track."""
    profile = newest(category).cv_uap
    return profile.cv_uaps[variant] if variant else profile.cv_record


def field(spec: Any, item: str, *path: str) -> Field:
    """The place of a field in an item of a record; path leads through groups, by the names of libasterix."""
    return field_in(spec.cv_items_dict[item].cv_rule.cv_variation, *path)


def field_in(variation: Any, *path: str) -> Field:
    """The same in a given element or group."""
    base, _ = _library()
    offset = 0
    for name in path:
        for part, size in variation.cv_items_list:
            if issubclass(part, base.Item) and part.cv_non_spare.cv_name == name:
                variation = part.cv_non_spare.cv_rule.cv_variation
                break
            offset += size
        else:
            raise KeyError(name)
    return _placed(base, variation, offset)


def flag(spec: Any, item: str, name: str) -> Flag:
    """The place of a flag in an item of parts of one byte."""
    base, _ = _library()
    for byte, part in enumerate(spec.cv_items_dict[item].cv_rule.cv_variation.cv_items_list):
        shift = 8
        for one, bits in (entry for entry in part if entry):
            shift -= bits
            if issubclass(one, base.Item) and one.cv_non_spare.cv_name == name:
                return Flag(byte, shift, bits)
    raise KeyError(name)


def _placed(base: ModuleType, variation: Any, offset: int) -> Field:
    content = variation.cv_rule.cv_content
    quantity = issubclass(content, base.ContentQuantity)
    signed = quantity and issubclass(content.cv_signedness, base.Signed)
    bits = variation.cv_bit_size
    count = (offset % 8 + bits + 7) // 8
    return Field(offset // 8, 8 * count - offset % 8 - bits, count, bits, signed, content.cv_lsb if quantity else 1.0)


def variation_of(rule: Any) -> Any:
    """The variation behind a rule of libasterix; of one that depends on another item the default."""
    return getattr(rule, "cv_variation", None) or rule.cv_default_variation


def size_in_bits(base: ModuleType, variation: Any) -> int:
    """How many bits an element or a group has."""
    if not issubclass(variation, base.Element | base.Group):
        raise TypeError(variation)
    return int(variation.cv_bit_size)


@cache
def skip(variation: Any) -> Skip:
    """A function that finds the end of an item of a libasterix variation."""
    base, _ = _library()
    if issubclass(variation, base.Element | base.Group):
        size = size_in_bits(base, variation) // 8
        return lambda data, at: at + size
    if issubclass(variation, base.Extended):
        return _extended(variation)
    if issubclass(variation, base.Repetitive):
        return _repetitive(base, variation)
    if issubclass(variation, base.Explicit):
        return _explicit
    if issubclass(variation, base.Compound):
        return _compound(variation)
    raise TypeError(variation)


def _extended(variation: Any) -> Skip:
    parts = [(sum(one[1] if one else 1 for one in part) // 8, part[-1] is None) for part in variation.cv_items_list]

    def end(data: bytes, at: int) -> int:
        for size, extends in parts:
            at += size
            if not (extends and at <= len(data) and data[at - 1] & 1):
                return at
        raise Damaged(at - 1, "an item goes on after its last part")

    return end


def _repetitive(base: ModuleType, variation: Any) -> Skip:
    counted, inner = variation.cv_rep_bytes, variation.cv_variation
    bits = size_in_bits(base, inner)

    def by_count(data: bytes, at: int) -> int:
        return at + counted + int.from_bytes(data[at : at + counted], "big") * (bits // 8)

    def by_bit(data: bytes, at: int) -> int:
        at += (bits + 1) // 8
        while at <= len(data) and data[at - 1] & 1:
            at += (bits + 1) // 8
        return at

    return by_count if counted else by_bit


def _explicit(data: bytes, at: int) -> int:
    if at < len(data) and data[at] == 0:
        raise Damaged(at, "an item of length 0")
    return at + data[at] if at < len(data) else at + 1


def _compound(variation: Any) -> Skip:
    parts = [one and skip(variation_of(one.cv_rule)) for one in variation.cv_items_list]

    def end(data: bytes, at: int) -> int:
        begin = at
        numbers, at = _named(data, at)
        for number in numbers:
            part = parts[number] if number < len(parts) else None
            if part is None:
                raise Damaged(begin, f"a part {number + 1} that the item has not")
            at = part(data, at)
        return at

    return end


def _named(data: bytes, at: int) -> tuple[list[int], int]:
    """The numbers, from 0, in a field specification, and its end."""
    begin, numbers = at, []
    while True:
        if at >= len(data):
            raise Damaged(begin, "a field specification that does not end")
        byte = data[at]
        numbers += [7 * (at - begin) + bit for bit in range(7) if byte >> (7 - bit) & 1]
        at += 1
        if not byte & 1:
            return numbers, at


def after_specification(data: bytes, at: int) -> int:
    """The end of a field specification, whatever it names; beyond the data if it does not end."""
    while at < len(data) and data[at] & 1:
        at += 1
    return at + 1


class Step(NamedTuple):
    """A stretch of items of fixed length: the wanted ones and where in it they begin; its length; then an item of any
    length, which may be wanted too (-1: no)."""

    wanted: list[tuple[int, int]]
    size: int
    last: int
    end: Skip | None


class Profile:
    """Places of the wanted items of a category's records; the plan of each field specification is made once."""

    def __init__(self, category: int, wanted: Sequence[str], variant: str | None = None):
        base, _ = _library()
        self.wanted = wanted
        self.spec = record(category, variant)
        self.items = [
            (one.cv_non_spare.cv_name, variation_of(one.cv_non_spare.cv_rule))
            if issubclass(one, base.UapItem)
            else None
            for one in self.spec.cv_items_list
        ]
        self.plans: dict[bytes, list[Step]] = {}

    def places(self, data: bytes, at: int) -> tuple[list[int], int]:
        """The start of each wanted item, -1 where it is absent, and the end of the record."""
        begin, at = at, after_specification(data, at)
        plan = self.plans.get(data[begin:at])
        if plan is None:
            plan = self._plan(data, begin)
        places = [-1] * len(self.wanted)
        for wanted, size, last, end in plan:
            for one, offset in wanted:
                places[one] = at + offset
            at += size
            if end is not None:
                if last >= 0:
                    places[last] = at
                at = end(data, at)
            if at > len(data):
                raise Damaged(begin, f"item {self._cut(data, begin)} ends after the data block")
        return places, at

    def _plan(self, data: bytes, begin: int) -> list[Step]:
        base, _ = _library()
        numbers, at = _named(data, begin)
        plan: list[Step] = []
        fixed: list[tuple[int, int]] = []
        size = 0
        for name, variation in self._of(numbers, begin):
            index = self.wanted.index(name) if name in self.wanted else -1
            if issubclass(variation, base.Element | base.Group):
                fixed += [(index, size)] if index >= 0 else []
                size += size_in_bits(base, variation) // 8
            else:
                plan.append(Step(fixed, size, index, skip(variation)))
                fixed, size = [], 0
        plan += [Step(fixed, size, -1, None)] if size else []
        if not plan:
            raise Damaged(begin, "a record without items")
        self.plans[data[begin:at]] = plan
        return plan

    def _of(self, numbers: list[int], begin: int) -> Iterator[tuple[str, Any]]:
        """The items of these numbers."""
        for number in numbers:
            item = self.items[number] if number < len(self.items) else None
            if item is None:
                raise Damaged(begin, f"an item of number {number + 1}, which the category has not")
            yield item

    def _cut(self, data: bytes, begin: int) -> str:
        """The first item of a record that ends after the data."""
        numbers, at = _named(data, begin)
        for name, variation in self._of(numbers, begin):
            at = skip(variation)(data, at)
            if at > len(data):
                return name
        raise AssertionError("a record that ends in the data")
