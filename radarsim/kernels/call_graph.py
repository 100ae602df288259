"""What a kernel is made from: one hash over the modules, numbers and closures that its code can reach.

Numba's cache on disk looks at the file of the compiled function alone: an edit of a function that it calls, in another
file, goes unnoticed and gives silently wrong results. Here the modules of ours and of the user's that its globals come
from count, directly or not. An edit in one study's kernels leaves those of the others as they are."""

import hashlib
import sys
from collections.abc import Callable
from enum import Enum
from types import FunctionType, ModuleType

import numpy as np

from radarsim.user_code.files import is_user_module
from radarsim.user_code.module_sources import module_digest


def source_hash(function: Callable) -> str:
    """SHA-256 of all that a kernel is compiled from: the files of the modules that its globals come from, directly or
    not, other than libraries, numbers in these, and what a function made by another takes from it."""
    texts: dict[str, str] = {}
    waiting: list[object] = [function]
    counts = dict.fromkeys(("radarsim", function.__module__.partition(".")[0]), True)
    while waiting:
        value = waiting.pop()
        value = getattr(value, "__wrapped__", value)  # compiled, or a formula
        if isinstance(value, tuple | list):
            waiting += value
        if isinstance(value, FunctionType) and value.__closure__:
            contents = [cell.cell_contents for cell in value.__closure__]
            text = f"{value.__module__}.{value.__qualname__} {value_text(contents)}"
            waiting += contents if text not in texts else []
            texts[text] = ""
        name = value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None)
        if not isinstance(name, str) or name in texts:
            continue
        top = name.partition(".")[0]
        if top not in counts:
            counts[top] = is_user_module(top)
        if not counts[top]:
            continue
        texts[name] = module_digest(name)
        module = sys.modules.get(name)
        if module is not None and not hasattr(module, "__path__"):  # a package's names depend on what is imported
            items = [(key, item) for key, item in vars(module).items() if not key.startswith("__")]
            waiting += (item for _, item in items)
            texts[name] += value_text(items)
    return hashlib.sha256(repr(sorted(texts.items())).encode()).hexdigest()


def value_text(value: object) -> str:
    """Numbers and texts of a value as they are, types, functions and programs by their names; of others nothing."""
    if isinstance(value, type) and issubclass(value, Enum):
        value = [(member.name, member.value) for member in value]
    if isinstance(value, list | tuple):
        return f"({', '.join(map(value_text, value))})"
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
    if isinstance(digest := getattr(value, "made_of", None), str):  # what runs a program of `kernels.tracing`
        return digest
    value = getattr(value, "__wrapped__", value)
    if isinstance(value, FunctionType):
        return f"{value.__module__}.{value.__qualname__}"
    if isinstance(value, type):
        return f"{value.__module__}.{value.__qualname__}"
    if isinstance(value, np.generic):
        return f"{value.dtype} {value!r}"
    if isinstance(value, Enum):
        return f"{value_text(type(value))} {value.name}"
    is_constant = isinstance(value, int | float | complex | str | bytes | np.dtype | range | slice | None)
    return repr(value) if is_constant or type(value).__module__.startswith("numba.core.types") else ""
