"""What a case's numbers depend on, as one hash: the name of its stored blocks.

In it: the resolved case with every default written out, the seed, the layout of random numbers, and the code that the
numbers are computed with. That code is found by following the imports of the modules that the study names
(`Study.computes_in`): its own, kernels, physics, and of config what turns keys into numbers.

Not in it: realisations, limits, threads, output, comments, docstrings, descriptions of keys, file and display names;
other studies, the registry, tables, figures, words, claims, and the tracking of recorded plots.
"""

from functools import cache

from radarsim.config.experiment import Case
from radarsim.config.identity import canonical, digest
from radarsim.kernels import cache as compiled
from radarsim.kernels import random, sources
from radarsim.studies.registry import study

# Of radarsim; of the study's own package, and of a package from outside, everything that is imported counts.
SHARED = ("radarsim.kernels", "radarsim.physics", "radarsim.studies.noise")
SHARED_PARTS = ("radarsim.engine.moments", "radarsim.config.fields", "radarsim.config.identity")
APART = ("radarsim.kernels.cache", "radarsim.kernels.sources")  # where machine code lies changes no number
SHOWN = ("tables", "figures", "words", "claims", "measures", "track")  # of a study: what is made of its numbers


def identity(case: Case) -> str:
    """What a case's numbers depend on, as SHA-256 in hexadecimal."""
    return digest(
        {
            "study": case.study,
            "spec": canonical(case.spec),
            "seed": case.seed,
            "random_layout": random.LAYOUT,
            "sources": computing_sources(study(case.study).computes_in(case.spec)),
        }
    )


@cache
def computing_sources(roots: tuple[str, ...]) -> str:
    """SHA-256 over the sources that compute a study's numbers, from the modules where it begins."""
    found = sources.digest(sources.closure(roots, lambda module: follows(module, roots)))
    sources.remember(compiled.ROOT / compiled.SOURCES)
    return found


def follows(module: str, roots: tuple[str, ...]) -> bool:
    """Whether a module that a study imports can change its numbers."""
    if module in APART:
        return False
    if module in SHARED_PARTS or any(f"{module}.".startswith(f"{shared}.") for shared in SHARED):
        return True
    return any(_of_the_study(module, root) for root in roots)


def _of_the_study(module: str, root: str) -> bool:
    parts, own = module.split("."), root.split(".")
    if own[0] != "radarsim":
        return parts[0] == own[0] and parts[-1] not in SHOWN
    # radarsim.studies.sonar.clutter.study stands on what lies in radarsim.studies.sonar, too.
    return parts[:3] == own[:3] and parts[-1] not in SHOWN
