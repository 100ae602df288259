"""Arguments that Python gives, refused as the command refuses its options."""

import math
import os

from radarsim.errors import ConfigError

MOST_THREADS = 1024
NEEDED = ("workers", "depth", "shortest_s", "longest_s", "submit", "finished", "cancel", "forget")  # of an executor


def check(*, threads=None, workers=None, precision=None, time_limit=None, executor=None, out=None) -> None:
    """ConfigError with a line for each argument of `run` that is none."""
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
    if faults:
        raise ConfigError(*faults)


def directory(out: str | os.PathLike) -> None:
    """ConfigError for what names no directory."""
    if faults := _directory(out):
        raise ConfigError(*faults)


def _directory(out) -> list[str]:
    named = isinstance(out, str | os.PathLike) and os.fspath(out)
    return [] if named and isinstance(named, str) else [f"out: must name a directory, got {out!r}"]


def _count(name: str, value) -> list[str]:
    whole = hasattr(value, "__index__") and not isinstance(value, bool)
    if value is None or (whole and 1 <= value <= MOST_THREADS):
        return []
    return [f"{name}: must be a whole number from 1 to {MOST_THREADS}, got {value!r}"]


def _number(name: str, value, most: float) -> list[str]:
    number = hasattr(value, "__float__") and not isinstance(value, bool)
    if value is None or (number and 0 < value <= most and math.isfinite(value)):
        return []
    bound = f" and ≤ {most:g} %" if math.isfinite(most) else ""
    return [f"{name}: must be > 0{bound}, got {value!r}"]
