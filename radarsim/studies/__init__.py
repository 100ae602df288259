"""One file a paper. A study is `prepare(case) -> plan` (once) and `simulate(plan, first, count) -> sums` (a block).

A plan has `.block` (realisations a block), `.layout` (engine.moments.Layout) and `.axes` (engine.results.Axes). What is
common to all studies stands here: the registry, the identity of a case, the names of its noise streams, and the work
that the engine runs.
"""

import ast
import hashlib
import json
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np

from radarsim.config.load import Case, canonical, world

STUDIES = ("range_doppler", "multimodel", "sonar", "discriminator")
COMPUTING = ("models", "kernels", "filters", "exact", "studies")
PACKAGE = Path(__file__).parent.parent


def study(name: str) -> ModuleType:
    """The module of a study, imported when first asked for."""
    return import_module(f"radarsim.studies.{name}")


def digest(value: object) -> str:
    """SHA-256 in hexadecimal of a JSON-able value; numbers by their shortest exact form, keys sorted."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


@cache
def computing_sources(name: str) -> str:
    """SHA-256 over the sources that compute a study's numbers: its own file and what that imports, directly or not."""
    seen: dict[str, bytes] = {}
    waiting = [f"radarsim.studies.{name}", "radarsim.studies", "radarsim.engine.moments"]
    while waiting:
        module = waiting.pop()
        path = PACKAGE.joinpath(*module.split(".")[1:])
        path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
        if module in seen or not path.is_file():
            continue
        seen[module] = path.read_bytes()
        waiting += [found for found in _imports(seen[module]) if f"{found}.".split(".")[1] in COMPUTING]
    return digest({module: hashlib.sha256(source).hexdigest() for module, source in seen.items()})


def _imports(source: bytes) -> list[str]:
    """Modules of this package that a source imports, with `from package import module` in both readings."""
    found = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            found += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    return [module for module in found if module.split(".")[0] == "radarsim"]


def identity(case: Case) -> str:
    """What a case's numbers depend on, as SHA-256: resolved configuration, seed, random layout, computing sources.

    Not in it: realisations, limits, threads, output, comments, file and display names.
    """
    from radarsim.kernels.random import LAYOUT

    return digest(
        {
            "study": case.study,
            "spec": canonical(case.spec),
            "seed": case.seed,
            "random_layout": LAYOUT,
            "sources": computing_sources(case.study),
        }
    )


def noise_key(case: Case, what: str) -> np.ndarray:
    """Key (2,) of the noise stream `what` of a case: the same for cases that differ only in their filters."""
    from radarsim.kernels.random import stream

    return stream(case.seed, f"{case.study}:{what}:{digest(world(case.spec))}")


class CaseWork:
    """A case as the engine sees it: an identity, a block length, and sums to be made. Pickles as the case alone."""

    def __init__(self, case: Case):
        self.case = case

    def __reduce__(self):
        return CaseWork, (self.case,)

    @cached_property
    def plan(self):
        """The prepared plan, made when first needed."""
        return study(self.case.study).prepare(self.case)

    @cached_property
    def identity(self) -> str:
        """See `identity`."""
        return identity(self.case)

    @property
    def block(self) -> int:
        """Realisations in a block; depends on the study only."""
        return self.plan.block

    @property
    def size(self) -> int:
        """Length of the vector of sums."""
        return self.plan.layout.size

    def simulate(self, first: int, count: int) -> np.ndarray:
        """Sums (size,) over realisations first … first + count - 1."""
        return study(self.case.study).simulate(self.plan, first, count)

    def explain(self, first: int, count: int) -> list[str]:
        """Where the sums of these realisations are not finite, one line a filter, scan and number of realisations."""
        axes, layout = self.plan.axes, self.plan.layout
        bad = np.zeros((len(axes.filters), len(axes.k)), dtype=int)
        for i in range(first, first + count):
            error = layout.unpack(self.simulate(i, 1))["error"]
            bad += ~np.isfinite(error).all(axis=(2, 3))
        return [
            f"{self.case.name}: filter {axes.filters[f]!r}, scan {axes.k[k]}: "
            f"{bad[f, k]} of {count} realisations not finite"
            for f, k in np.argwhere(bad)[:20]
        ]
