"""Which random generators a user's code seeds while it runs, and whether other seeds change what it gives.

Within `SeedRecorder.recording` the functions and classes that seed a generator of NumPy, Python, PyTorch or JAX note
their seed, in the recording thread alone; asked to, they take another one. Code compiled by Numba and libraries in C
seed without being seen."""

import contextlib
import functools
import pickle
import sys
import threading
from collections.abc import Callable, Collection, Iterator
from typing import Any, cast

import numpy as np

SEEDING = {  # by module: what takes a seed as its first argument
    "numpy.random": ("default_rng", "seed", "RandomState", "SeedSequence", "MT19937", "PCG64", "PCG64DXSM", "SFC64"),
    "random": ("seed", "Random"),
    "torch": ("manual_seed",),
    "jax.random": ("PRNGKey", "key"),
}
OTHER = 1_000_003  # is added to a seed for another one
SEED_LIMIT = 2**32  # of the older generators of NumPy
_object_hash = object.__hash__  # of an identity; `id` raises an event, which costs a call of every audit hook


class SeedRecorder:
    """The seeds of one run of a user's code in their order; replaced: places in that order where another is taken.

    in_use: places of the generators that gave numbers after the filter was built. What is drawn while a filter is
    built, as the weights of a network, belongs to the filter."""

    def __init__(self, replaced: Collection[int] = ()):
        self.seeds: list[str] = []
        self._replaced, self._thread, self._is_building = replaced, threading.get_ident(), False
        self._generators: list[Any] = []
        self._states_when_built: dict[int, bytes | None] = {}

    @property
    def in_use(self) -> set[int]:
        built = self._states_when_built
        return {i for i, generator in enumerate(self._generators) if built.get(i, b"") != _state(generator)}

    @contextlib.contextmanager
    def recording(self) -> Iterator[None]:
        """The code within is recorded, in this thread."""
        replacements = {id(seed): (seed, self._spy(module, seed)) for module, seed in _seeding_objects()}
        seed_hashes = {_object_hash(seed) for seed, _ in replacements.values()}
        changed = []
        for name, module in list(sys.modules.items()):
            if name.partition(".")[0] in ("numpy", "torch", "jax") and name not in SEEDING:
                continue
            names = getattr(module, "__dict__", {})
            if seed_hashes.isdisjoint(map(_object_hash, list(names.values()))):  # as nearly all of a thousand modules
                continue
            for key, value in [(key, value) for key, value in list(names.items()) if id(value) in replacements]:
                changed.append((names, key, value))
                names[key] = replacements[id(value)][1]
        outer, _current.recorder = _current.recorder, self
        try:
            yield
        finally:
            _current.recorder = outer
            for names, key, value in changed:
                names[key] = value

    @contextlib.contextmanager
    def building(self) -> Iterator[None]:
        """The filter is built within."""
        first, self._is_building = len(self.seeds), True
        try:
            yield
        finally:
            self._is_building = False
            self._states_when_built |= {i: _state(self._generators[i]) for i in range(first, len(self.seeds))}

    def _spy(self, module: Any, seeding: Any) -> Any:
        """The function or class, which notes its seed."""
        if isinstance(seeding, type):
            return _noting_class(seeding, self._noted)

        @functools.wraps(seeding)
        def noting(*arguments: Any, **keywords: Any) -> Any:
            place, arguments, keywords = self._noted(arguments, keywords)
            generator = seeding(*arguments, **keywords)
            if place is not None:
                self._generators[place] = generator if generator is not None else _global_generator(module)
            return generator

        return noting

    def _noted(self, arguments: tuple, keywords: dict, generator: Any = None) -> tuple[int | None, tuple, dict]:
        """The place of a seed among the others, None where there is none, and the arguments with the seed to take."""
        key = next((name for name in ("seed", "entropy", "x", "a") if name in keywords), None)
        seed = arguments[0] if arguments else keywords[key] if key else None
        if threading.get_ident() != self._thread or _another(seed) is None:
            return None, arguments, keywords
        place = len(self.seeds)
        self.seeds.append(repr(seed))
        self._generators.append(generator)
        if place in self._replaced:
            arguments = (_another(seed), *arguments[1:]) if arguments else ()
            keywords = keywords | ({key: _another(seed)} if key and not arguments else {})
        return place, arguments, keywords


class _CurrentRecorder(threading.local):
    recorder: SeedRecorder | None = None


_current = _CurrentRecorder()


def building_filter() -> contextlib.AbstractContextManager[None]:
    """The recorder of this thread, if any, knows that a filter is built within."""
    return _current.recorder.building() if _current.recorder else contextlib.nullcontext()


def _seeding_objects() -> Iterator[tuple[Any, Any]]:
    """The modules that are loaded, each with what seeds generators in it."""
    for module_name, names in SEEDING.items():
        module = sys.modules.get(module_name)
        yield from ((module, vars(module)[name]) for name in names if module and name in vars(module))


def _noting_class(seeding: type, note: Callable[..., tuple[int | None, tuple, dict]]) -> type:
    """A class of generators whose objects note their seed; what is an object of the class, is one of this."""

    class Meta(type(seeding)):  # type: ignore[misc]
        def __instancecheck__(cls, instance: Any) -> bool:
            return isinstance(instance, seeding)

    def build(cls: type, *arguments: Any, **keywords: Any) -> Any:
        return cast("Any", seeding).__new__(cls)  # without the seed, which `__init__` takes

    def initialise(self: Any, *arguments: Any, **keywords: Any) -> None:
        _, arguments, keywords = note(arguments, keywords, self)
        cast("Any", seeding).__init__(self, *arguments, **keywords)

    return Meta(seeding.__name__, (seeding,), {"__new__": build, "__init__": initialise})


def _another(seed: Any) -> Any:
    """Another seed of the same kind; None for what is none, such as a generator."""
    if isinstance(seed, int | np.integer):
        return int(seed + OTHER) % SEED_LIMIT
    if isinstance(seed, float):
        return seed + OTHER
    if isinstance(seed, str):
        return f"{seed} {OTHER}"
    if isinstance(seed, bytes):
        return seed + b"*"
    if isinstance(seed, list | tuple | np.ndarray) and np.asarray(seed).dtype.kind in "iu":
        return [*np.ravel(seed).tolist(), OTHER]
    return None


def _global_generator(module: Any) -> Any:
    """The generator that the functions of a module draw from."""
    import random

    return {"numpy.random": np.random.mtrand._rand, "random": random._inst}.get(module.__name__)


def _state(generator: Any) -> bytes | None:
    """The state of a generator; None where it is not known."""
    if isinstance(generator, np.random.Generator):
        generator = generator.bit_generator
    for name in ("get_state", "getstate", "state"):
        if (state := getattr(generator, name, None)) is not None:
            return pickle.dumps(state() if callable(state) else state)
    return None
