"""How a C limit of this folder is compiled and paired with the kernel, for the scripts that do so."""

import ctypes
import shutil
import statistics
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

FLAGS = ("-O3", "-march=native", "-fno-math-errno", "-shared", "-fPIC")


def library(source: Path, folder: str) -> ctypes.CDLL:
    """A C file of this folder, compiled for this processor; the program ends where there is no gcc."""
    if shutil.which("gcc") is None:
        raise SystemExit("no gcc: the C limit cannot be compiled")
    made = Path(folder) / f"{source.stem}.so"
    subprocess.run(["gcc", *FLAGS, "-Wno-psabi", "-o", str(made), str(source), "-lm"], check=True)
    return ctypes.CDLL(str(made))


def structure(fields: dict[str, object]) -> ctypes.Structure:
    """A C structure of these members in this order: int, float, or the address of an array, which must be kept."""
    kinds = {int: ctypes.c_int, float: ctypes.c_double}
    types = [(name, kinds.get(type(value), ctypes.c_void_p)) for name, value in fields.items()]
    made = type("Given", (ctypes.Structure,), {"_fields_": types})()
    for name, value in fields.items():
        setattr(made, name, value.ctypes.data if isinstance(value, np.ndarray) else value)
    return made


def paired(ours: Callable, limit: Callable, pairs: int) -> tuple[float, float, float]:
    """CPU seconds of ours and of the limit, and the time of the limit over ours; medians of pairs in this thread."""

    def seconds(function: Callable) -> float:
        started = time.thread_time()
        function()
        return time.thread_time() - started

    rows = []
    for _ in range(pairs):
        before, own, after = seconds(limit), seconds(ours), seconds(limit)
        rows.append((own, (before + after) / 2, (before + after) / 2 / own))
    return tuple(statistics.median(column) for column in zip(*rows, strict=True))
