"""What a case's numbers depend on, as one hash: the name of its stored blocks.

In it: the resolved case with every default written out, the seed, the layout of random numbers, and the code that the
numbers are computed with: the study's own `prepare`, `simulate` and `keys`, and what is found by following imports, at
any depth and in any form, from these or from the modules that the study names (`Study.computes_in`). Whatever is
imported on the way counts, of radarsim, of the study's package and of any other that is no installed one; of an
installed package its version, but for those that every block's header records.

Not in it: realisations, limits, threads, output, comments, docstrings, descriptions of keys, file and display names;
other studies, the registry, tables, figures, words, claims, and the tracking of recorded plots.
"""

import sys
from functools import cache
from importlib.metadata import PackageNotFoundError, packages_distributions, version

from radarsim.config.experiment import Case
from radarsim.config.identity import canonical, digest, world
from radarsim.errors import ConfigError
from radarsim.kernels import sources
from radarsim.studies.interface import Study
from radarsim.studies.registry import study

# Of radarsim: what keeps machine code, carries a case, labels its sums or declares a study changes no number.
APART = sources.APART | {
    "radarsim",
    "radarsim.errors",
    "radarsim.config.experiment",
    "radarsim.config.faults",
    "radarsim.engine.results",
    "radarsim.studies.identity",
    "radarsim.studies.interface",
    "radarsim.studies.registry",
}
# Their versions are in the header of every stored block, see radarsim.engine.machine.
RECORDED = {"numpy", "scipy", "numba", "llvmlite", "pydantic", "pydantic_core"}
INSTALLED = {"site-packages", "dist-packages"}
COMPUTES = {"prepare", "simulate", "keys"}  # of a study's own class; the other parts of the interface show
SHOWS = frozenset({*vars(Study), *Study.__annotations__} - COMPUTES)


def identity(case: Case) -> str:
    """What a case's numbers depend on, as SHA-256 in hexadecimal."""
    from radarsim.kernels import random  # the compiler, which takes half a second, is not loaded for `radarsim list`

    shared: dict[str, object] = {} if case.noise_of is None else {"noise_of": world(case.noise_of)}
    return digest(
        shared
        | {
            "study": case.study,
            "spec": canonical(case.spec),
            "seed": case.seed,
            "random_layout": random.LAYOUT,
            "sources": computing_sources(case.study, study(case.study).computes_in(case.spec)),
        }
    )


@cache
def computing_sources(name: str, roots: tuple[str, ...]) -> str:
    """SHA-256 over the sources that compute a study's numbers, from the modules where it begins.

    Raises ConfigError where one of these modules has no source.
    """
    from radarsim.kernels import cache as compiled

    kinds = [kind for kind in type(study(name)).__mro__ if issubclass(kind, Study) and kind is not Study]
    own = {kind.__module__.partition(".")[0] for kind in kinds} | {root.partition(".")[0] for root in roots}
    try:
        parts = [(kind.__module__, kind.__qualname__, SHOWS) for kind in kinds]
        found = sources.closure(roots, lambda module: follows(module, own), parts)
    except LookupError as error:
        raise ConfigError(f"study {name}: computes_in names {error}, a module that has no source") from error
    finally:
        sources.remember(compiled.ROOT / compiled.SOURCES)
    return digest([found.digest(), versions(found.beyond)])


def follows(module: str, own: set[str]) -> bool:
    """Whether a module that a study imports is looked into; own are the top-level packages of the study."""
    top = module.partition(".")[0]
    if top == "radarsim":
        return module not in APART
    if top in own:
        return True
    return top not in sys.stdlib_module_names and top not in RECORDED and not _installed(top)


def _installed(top: str) -> bool:
    spec = sources.spec_of(top)
    places = [spec.origin or "", *(spec.submodule_search_locations or ())] if spec else []
    return any(not INSTALLED.isdisjoint(place.replace("\\", "/").split("/")) for place in places)


def versions(modules: set[str]) -> dict[str, str]:
    """The versions of installed packages that a study computes with, by package; empty for one without."""
    tops = {module.partition(".")[0] for module in modules} - {"radarsim"} - RECORDED - sys.stdlib_module_names
    return {top: _version(top) for top in sorted(tops)}


def _version(top: str) -> str:
    try:
        return version(top)
    except PackageNotFoundError:
        return ", ".join(sorted({version(name) for name in packages_distributions().get(top, ())}))
