"""Lengths of the items of an ASTERIX record, and positions and units of their fields.

The library libasterix has the specification. It decodes a record into objects in 0.3 ms, so this module only follows
the lengths of items; the fields needed are read from many records at a time.

A data block is its category (1 byte), its length (2 bytes, including these three bytes) and records; a record is a
field specification (7 bits a byte, the eighth says that another byte follows) and the items that it names."""

from collections.abc import Callable, Iterator, Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from radarsim.recordings.formats import records

base: Any
try:
    from asterix import base
except ImportError:
    base = None  # `newest` says so

ItemEnd = Callable[[bytes, int], int]  # data and start of an item: its end


class DamagedRecord(ValueError):
    """Bytes that the specification does not allow: their offset, and the fault."""

    def __init__(self, offset: int, fault: str):
        super().__init__(fault)
        self.offset, self.fault = offset, fault


class Field(NamedTuple):
    """A number in items: its first byte, the bits after it, bytes it spans, bits, sign, resolution."""

    first: int
    shift: int
    size: int
    bits: int
    signed: bool
    step: float

    def integers(self, data: np.ndarray, starts: np.ndarray) -> np.ndarray:
        """The bits as integers (n,) in the items that begin at `starts` (n,); meaningless where there is no item."""
        bits = np.zeros(len(starts), dtype=np.int64)
        for i in range(self.size):
            bits = bits << 8 | data[starts + (self.first + i)]
        bits = bits >> self.shift & ((1 << self.bits) - 1)
        return bits - (bits >> (self.bits - 1) << self.bits) if self.signed else bits

    def values(self, data: np.ndarray, starts: np.ndarray) -> np.ndarray:
        """The values (n,) in the items that begin at `starts` (n,); NaN where that is negative, as there is no item."""
        return np.where(starts < 0, np.nan, self.integers(data, starts) * self.step)


class Flag(NamedTuple):
    """Bits in an item that goes on while the last bit of a byte says so: their byte, the bits after them, how many."""

    byte: int
    shift: int
    bits: int

    def values(self, data: np.ndarray, starts: np.ndarray) -> np.ndarray:
        """Their values (n,); 0 where there is no item, or it ends before them."""
        is_present = starts >= 0
        for i in range(self.byte):
            is_present = is_present & (data[starts + i] & 1 == 1)
        return np.where(is_present, data[starts + self.byte] >> self.shift & (1 << self.bits) - 1, 0)


@cache
def newest_edition(category: int) -> Any:
    """The newest edition of a category in libasterix."""
    try:
        from asterix import generated
    except ImportError as error:
        raise records.missing_package("libasterix", "asterix") from error
    manifest: Any = generated.manifest
    return max(manifest["CATS"][category], key=lambda edition: edition.cv_edition)


def edition_number(category: int) -> str:
    """The number of the newest edition, by which records are read."""
    return ".".join(map(str, newest_edition(category).cv_edition))


@cache
def record_profile(category: int, variant: str | None = None) -> Any:
    """The profile of a category's records; category 001 has one for a plot and one for a track."""
    profile = newest_edition(category).cv_uap
    return profile.cv_uaps[variant] if variant else profile.cv_record


def locate_field(spec: Any, item: str, *path: str) -> Field:
    """The offset of a field in an item of a record; path leads through groups, by the names of libasterix."""
    return locate_field_in(spec.cv_items_dict[item].cv_rule.cv_variation, *path)


def locate_field_in(variation: Any, *path: str) -> Field:
    """The offset of a field in an element or group."""
    offset = 0
    for name in path:
        for part, size in variation.cv_items_list:
            if issubclass(part, base.Item) and part.cv_non_spare.cv_name == name:
                variation = part.cv_non_spare.cv_rule.cv_variation
                break
            offset += size
        else:
            raise KeyError(name)
    content, bits = variation.cv_rule.cv_content, variation.cv_bit_size
    quantity = issubclass(content, base.ContentQuantity)
    signed = quantity and issubclass(content.cv_signedness, base.Signed)
    count = (offset % 8 + bits + 7) // 8
    return Field(offset // 8, 8 * count - offset % 8 - bits, count, bits, signed, content.cv_lsb if quantity else 1.0)


def locate_flag(spec: Any, item: str, name: str) -> Flag:
    """The offset of a flag in an item whose parts have one byte each."""
    for byte, parts in enumerate(spec.cv_items_dict[item].cv_rule.cv_variation.cv_items_list):
        shift = 8
        for part, bits in (entry for entry in parts if entry):
            shift -= bits
            if issubclass(part, base.Item) and part.cv_non_spare.cv_name == name:
                return Flag(byte, shift, bits)
    raise KeyError(name)


def variation_of(rule: Any) -> Any:
    """The variation of a rule of libasterix; the default if it depends on another item."""
    return getattr(rule, "cv_variation", None) or rule.cv_default_variation


@cache
def item_end_function(variation: Any) -> ItemEnd:
    """A function that finds the end of an item of a libasterix variation."""
    if issubclass(variation, base.Element | base.Group):
        size = variation.cv_bit_size // 8
        return lambda data, start: start + size
    kinds = (
        (base.Extended, _extended_item_end),
        (base.Repetitive, _repetitive_item_end),
        (base.Compound, _compound_item_end),
    )
    (make,) = (
        make for kind, make in (*kinds, (base.Explicit, lambda _: _explicit_item_end)) if issubclass(variation, kind)
    )
    return make(variation)


def _extended_item_end(variation: Any) -> ItemEnd:
    parts = [
        (sum(field[1] if field else 1 for field in part) // 8, part[-1] is None) for part in variation.cv_items_list
    ]

    def end(data: bytes, offset: int) -> int:
        for size, extends in parts:
            offset += size
            if not (extends and offset <= len(data) and data[offset - 1] & 1):
                return offset
        raise DamagedRecord(offset - 1, "an item goes on after its last part")

    return end


def _repetitive_item_end(variation: Any) -> ItemEnd:
    count_bytes, inner = variation.cv_rep_bytes, variation.cv_variation
    bits = inner.cv_bit_size

    def by_count(data: bytes, start: int) -> int:
        return start + count_bytes + int.from_bytes(data[start : start + count_bytes], "big") * (bits // 8)

    def by_bit(data: bytes, start: int) -> int:
        start += (bits + 1) // 8
        while start <= len(data) and data[start - 1] & 1:
            start += (bits + 1) // 8
        return start

    return by_count if count_bytes else by_bit


def _explicit_item_end(data: bytes, start: int) -> int:
    if start < len(data) and data[start] == 0:
        raise DamagedRecord(start, "an item of length 0")
    return start + data[start] if start < len(data) else start + 1


def _compound_item_end(variation: Any) -> ItemEnd:
    parts = [item and item_end_function(variation_of(item.cv_rule)) for item in variation.cv_items_list]

    def end(data: bytes, offset: int) -> int:
        begin = offset
        numbers, offset = _read_specification(data, offset)
        for number in numbers:
            part = parts[number] if number < len(parts) else None
            if part is None:
                raise DamagedRecord(begin, f"a part {number + 1} that the item has not")
            offset = part(data, offset)
        return offset

    return end


def _read_specification(data: bytes, offset: int) -> tuple[list[int], int]:
    """The numbers, from 0, in a field specification, and its end."""
    begin, numbers = offset, []
    while True:
        if offset >= len(data):
            raise DamagedRecord(begin, "a field specification that does not end")
        byte = data[offset]
        numbers += [7 * (offset - begin) + bit for bit in range(7) if byte >> (7 - bit) & 1]
        offset += 1
        if not byte & 1:
            return numbers, offset


def specification_end(data: bytes, offset: int) -> int:
    """The end of a field specification, whatever it names; beyond the data if it does not end."""
    while offset < len(data) and data[offset] & 1:
        offset += 1
    return offset + 1


class FixedItems(NamedTuple):
    """Items of fixed length that follow each other: the requested ones with their offsets, and the total length.

    Then an item of variable length: its index if it is requested, else -1."""

    items: list[tuple[int, int]]
    size: int
    variable_item: int
    end: ItemEnd | None


class Profile:
    """Places of the requested items of a category's records; each field specification is planned once."""

    def __init__(self, category: int, names: Sequence[str], variant: str | None = None):
        self.names = names
        self.spec = record_profile(category, variant)
        self.items = [
            (item.cv_non_spare.cv_name, variation_of(item.cv_non_spare.cv_rule))
            if issubclass(item, base.UapItem)
            else None
            for item in self.spec.cv_items_list
        ]
        self.plans: dict[bytes, list[FixedItems]] = {}

    def offsets(self, data: bytes, offset: int) -> tuple[list[int], int]:
        """The start of each requested item, -1 if it is absent, and the end of the record."""
        begin, offset = offset, specification_end(data, offset)
        plan = self.plans.get(data[begin:offset])
        if plan is None:
            plan = self._plan(data, begin)
        offsets = [-1] * len(self.names)
        for fixed_items, size, variable_item, end in plan:
            for index, item_offset in fixed_items:
                offsets[index] = offset + item_offset
            offset += size
            if end is not None:
                if variable_item >= 0:
                    offsets[variable_item] = offset
                offset = end(data, offset)
            if offset > len(data):
                raise DamagedRecord(begin, f"item {self._cut_off_item(data, begin)} ends after the data block")
        return offsets, offset

    def _plan(self, data: bytes, begin: int) -> list[FixedItems]:
        numbers, end = _read_specification(data, begin)
        plan: list[FixedItems] = []
        fixed: list[tuple[int, int]] = []
        size = 0
        for name, variation in self._numbered_items(numbers, begin):
            index = self.names.index(name) if name in self.names else -1
            if issubclass(variation, base.Element | base.Group):
                fixed += [(index, size)] if index >= 0 else []
                size += variation.cv_bit_size // 8
            else:
                plan.append(FixedItems(fixed, size, index, item_end_function(variation)))
                fixed, size = [], 0
        plan += [FixedItems(fixed, size, -1, None)] if size else []
        if not plan:
            raise DamagedRecord(begin, "a record without items")
        self.plans[data[begin:end]] = plan
        return plan

    def _numbered_items(self, numbers: list[int], begin: int) -> Iterator[tuple[str, Any]]:
        """The items of these numbers."""
        for number in numbers:
            item = self.items[number] if number < len(self.items) else None
            if item is None:
                raise DamagedRecord(begin, f"an item of number {number + 1}, which the category has not")
            yield item

    def _cut_off_item(self, data: bytes, begin: int) -> str:
        """The first item of a record that ends after the data."""
        numbers, offset = _read_specification(data, begin)
        for name, variation in self._numbered_items(numbers, begin):
            offset = item_end_function(variation)(data, offset)
            if offset > len(data):
                return name
        raise AssertionError("a record that ends in the data")
