"""Arguments of the Python functions, checked.

They are refused as the command refuses its options."""

import math
import operator
import os
from collections.abc import Iterable
from typing import Any, SupportsFloat, SupportsIndex, TypeGuard

from radarsim.api.configs import Overrides
from radarsim.config import overrides as config_overrides
from radarsim.errors import ConfigError, argument

MAX_THREADS, MAX_WIDTH_MM = 1024, 1000
FORMATS = ("svg", "png", "pdf")  # of figure files
EXECUTOR_MEMBERS = ("workers", "depth", "shortest_s", "longest_s", "submit", "take_outcomes", "cancel", "forget")


def check_arguments(
    overrides: Overrides = (),
    *,
    threads: object = None,
    workers: object = None,
    precision: object = None,
    time_limit: object = None,
    executor: object = None,
    out: object = None,
    figures: object = True,
    width_mm: object = None,
    **numbers: object,
) -> tuple[str, ...]:
    """The overrides as texts. Raises ConfigError with a line for each invalid one; `numbers` are further arguments."""
    faults = [
        *_count_faults("threads", threads, minimum=0),
        *_count_faults("workers", workers, minimum=1),
        *_number_faults("precision", precision, 100, " %"),
        *([] if callable(time_limit) else _number_faults("time_limit", time_limit, math.inf)),
        *_number_faults("width_mm", width_mm, MAX_WIDTH_MM),
    ]
    faults += [f"{name}: must be a number, got {value!r}" for name, value in numbers.items() if not _is_number(value)]
    if executor is not None and not all(hasattr(executor, name) for name in EXECUTOR_MEMBERS):
        faults.append(f"executor: must be an executor of radarsim.engine, got {executor!r}")
    if out is not None:
        faults += _directory_faults(out)
    faults += _format_faults(figures)
    override_texts: tuple[str, ...] = ()
    try:
        override_texts = config_overrides.override_texts(overrides)
    except ConfigError as error:
        faults += error.lines
    if faults:
        raise ConfigError(*faults)
    return override_texts


def figure_formats(figures: bool | str | Iterable[str]) -> tuple[str, ...]:
    """The file formats of the figures: True for svg; none for False or None. Raises ConfigError for an unknown
    format."""
    if faults := _format_faults(figures):
        raise ConfigError(*faults)
    if isinstance(figures, bool) or figures is None:
        return FORMATS[:1] if figures else ()
    return (figures,) if isinstance(figures, str) else tuple(figures)


def whole_number(realisations: object) -> int | None:
    """A number of realisations, which may be a float. Raises ConfigError for anything else."""
    if realisations is None:
        return None
    if not _is_number(realisations) or not float(realisations).is_integer():
        raise ConfigError(f"{argument('realisations')}: must be a whole number, got {realisations!r}")
    if float(realisations) < 1:
        raise ConfigError(f"{argument('realisations')}: must be >= 1, got {realisations}")
    return int(float(realisations))


def check_texts(names: Iterable[object]) -> None:
    """Raise ConfigError for names that are not texts."""
    if faults := [f"{name!r}: must be text" for name in names if not isinstance(name, str | os.PathLike)]:
        raise ConfigError(*faults)


def check_directory(out: object) -> None:
    """Raise ConfigError for an argument that names no directory."""
    if faults := _directory_faults(out):
        raise ConfigError(*faults)


def _directory_faults(out: object) -> list[str]:
    path = isinstance(out, str | os.PathLike) and os.fspath(out)
    return [] if path and isinstance(path, str) else [f"out: must name a directory, got {out!r}"]


def _format_faults(figures: object) -> list[str]:
    if isinstance(figures, bool) or figures is None:
        return []
    formats = [figures] if isinstance(figures, str) or not isinstance(figures, Iterable) else list(figures)
    allowed = ", ".join(FORMATS)
    return [
        f"figures: must be True, False or of {allowed}, got {file_format!r}"
        for file_format in formats
        if file_format not in FORMATS
    ]


def _count_faults(name: str, value: object, minimum: int) -> list[str]:
    scalar = not isinstance(value, bool) and not getattr(value, "ndim", 0)
    number = operator.index(value) if isinstance(value, SupportsIndex) and scalar else -1
    if value is None or minimum <= number <= MAX_THREADS:
        return []
    return [f"{name}: must be a whole number from {minimum} to {MAX_THREADS}, got {value!r}"]


def _is_number(value: object) -> TypeGuard[SupportsFloat]:
    return isinstance(value, SupportsFloat) and not isinstance(value, bool) and not getattr(value, "ndim", 0)


def is_pair(value: object, kind: Any = SupportsFloat) -> bool:
    """Whether a value has exactly two members, each of this kind."""
    return (
        isinstance(value, Iterable)
        and len(members := list(value)) == 2
        and all(isinstance(member, kind) for member in members)
    )


def _number_faults(name: str, value: object, maximum: float, unit: str = "") -> list[str]:
    number = float(value) if _is_number(value) else math.nan
    if value is None or (0 < number <= maximum and math.isfinite(number)):
        return []
    bound = f" and ≤ {maximum:g}{unit}" if math.isfinite(maximum) else ""
    return [f"{name}: must be > 0{bound}, got {value!r}"]
