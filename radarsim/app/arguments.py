"""Arguments that Python gives, refused as the command refuses its options."""

import math
import operator
import os
from collections.abc import Iterable
from typing import SupportsFloat, SupportsIndex

from radarsim.errors import ConfigError

MOST_THREADS = 1024
FORMATS = ("svg", "png", "pdf")  # of the figures' files
NEEDED = ("workers", "depth", "shortest_s", "longest_s", "submit", "finished", "cancel", "forget")  # of an executor


def check(
    *,
    threads: object = None,
    workers: object = None,
    precision: object = None,
    time_limit: object = None,
    executor: object = None,
    out: object = None,
    overrides: object = (),
    figures: object = True,
) -> None:
    """ConfigError with a line for each invalid argument of `run`."""
    faults = [
        *_count("threads", threads),
        *_count("workers", workers),
        *_number("precision", precision, 100),
        *([] if callable(time_limit) else _number("time_limit", time_limit, math.inf)),
    ]
    if executor is not None and not all(hasattr(executor, name) for name in NEEDED):
        faults.append(f"executor: must be an executor of radarsim.engine, got {executor!r}")
    if out is not None:
        faults += _directory(out)
    if isinstance(overrides, str | bytes) or not isinstance(overrides, Iterable):
        faults.append(f"overrides: must be a list of texts key=value, got {overrides!r}")
    faults += _formats(figures)
    if faults:
        raise ConfigError(*faults)


def formats(figures: bool | str | Iterable[str]) -> tuple[str, ...]:
    """The formats of the figures' files that an argument asks for: True for svg and png; none for False or None.

    Raises ConfigError for a format that there is not.
    """
    if faults := _formats(figures):
        raise ConfigError(*faults)
    if isinstance(figures, bool) or figures is None:
        return FORMATS[:2] if figures else ()
    return (figures,) if isinstance(figures, str) else tuple(figures)


def directory(out: object) -> None:
    """ConfigError for what names no directory."""
    if faults := _directory(out):
        raise ConfigError(*faults)


def _directory(out: object) -> list[str]:
    named = isinstance(out, str | os.PathLike) and os.fspath(out)
    return [] if named and isinstance(named, str) else [f"out: must name a directory, got {out!r}"]


def _formats(figures: object) -> list[str]:
    if isinstance(figures, bool) or figures is None:
        return []
    given = [figures] if isinstance(figures, str) or not isinstance(figures, Iterable) else list(figures)
    allowed = ", ".join(FORMATS)
    return [f"figures: must be True, False or of {allowed}, got {one!r}" for one in given if one not in FORMATS]


def _count(name: str, value: object) -> list[str]:
    scalar = not isinstance(value, bool) and not getattr(value, "ndim", 0)
    number = operator.index(value) if isinstance(value, SupportsIndex) and scalar else 0
    if value is None or 1 <= number <= MOST_THREADS:
        return []
    return [f"{name}: must be a whole number from 1 to {MOST_THREADS}, got {value!r}"]


def _number(name: str, value: object, most: float) -> list[str]:
    scalar = not isinstance(value, bool) and not getattr(value, "ndim", 0)
    number = float(value) if isinstance(value, SupportsFloat) and scalar else math.nan
    if value is None or (0 < number <= most and math.isfinite(number)):
        return []
    bound = f" and ≤ {most:g} %" if math.isfinite(most) else ""
    return [f"{name}: must be > 0{bound}, got {value!r}"]
