"""What a case's numbers depend on, as one hash: the name of its stored blocks.

Its first half is the request: the resolved case with every default written out, the seed, the layout of random numbers
and the study's `model`. Realisations, limits, threads, output, file and display names are not in it.

Its second half is a hash of files, which any edit changes, also of comments: for radarsim's own studies those of the
study, of the packages that it uses and of the engine, except files that only show numbers; for a study from another
package all its files, and the versions of installed packages; likewise for filters from another package. It is only a
quick answer: where it differs, stored blocks are recomputed in part and kept if their bytes are equal; see
radarsim.engine.store."""

import hashlib
import os
from collections.abc import Iterator
from functools import cache
from importlib.metadata import distributions
from importlib.util import find_spec
from pathlib import Path

from radarsim.config.experiment import Case, canonical, digest, world
from radarsim.config.fields import Model
from radarsim.engine.blocks import QUESTION
from radarsim.studies.registry import SHIPPED, module, study

PACKAGE = Path(__file__).parents[1]
ROOMS = ("app/configs.py", "bursts", "config", "engine", "constants.py", "kernels", "physics.py")
SHOW = {"claims", "figures", "measures", "readings", "tables", "words"}  # a study's files, by stem


def identity(case: Case) -> str:
    """What a case's numbers depend on, 64 hexadecimal digits."""
    from radarsim.kernels import random  # the compiler, which takes half a second, is not loaded for `radarsim list`

    question: dict[str, object] = {} if case.noise_of is None else {"noise_of": world(case.noise_of)}
    question |= {
        "study": case.study,
        "model": study(case.study).model,
        "spec": canonical(case.spec),
        "seed": case.seed,
        "random_layout": random.LAYOUT,
    }
    if case.against:
        names = [member.name for member in case.spec.members]
        question["against"] = [names.index(name) for name in case.against]
    if case.outside:
        question["outside"] = [one.identity for one in case.outside]
    return digest(question)[:QUESTION] + sources(case.study, packages(case))[:QUESTION]


def packages(case: Case) -> tuple[str, ...]:
    """The packages other than radarsim that compute a case's numbers: of its study, of its filters' keys and gains."""
    of_study = () if case.study in SHIPPED else (module(case.study),)
    kinds = [
        one
        for member in getattr(case.spec, case.spec.bare_keys, ())
        for one in type(member).__mro__
        if issubclass(one, Model)
    ]
    tops = (one.partition(".")[0] for one in (*of_study, *(kind.__module__ for kind in kinds)))
    return tuple(sorted(set(tops) - {__package__.partition(".")[0]}))


@cache
def sources(name: str, outside: tuple[str, ...] = ()) -> str:
    """SHA-256 of the files that may compute a study's numbers, including those of outside packages."""
    found = hashlib.sha256()
    places = [(PACKAGE / room, files(PACKAGE / room)) for room in ROOMS]
    places.append((PACKAGE / "studies", (PACKAGE / "studies").glob("*.py")))
    if name in SHIPPED:
        own = PACKAGE.joinpath(*module(name).split(".")[1:])
        places.append((own, (path for path in files(own) if path.stem not in SHOW)))
    for package in outside:
        spec = find_spec(package)
        own_places = [] if spec is None else spec.submodule_search_locations or [spec.origin or ""]
        places += [(Path(own), files(Path(own))) for own in own_places]
    if outside:
        metadata = (one.metadata for one in distributions())  # read once; a name and a version would read it twice
        found.update(repr(sorted({(one["Name"], one["Version"]) for one in metadata})).encode())
    for place, every in places:
        for path in sorted(every):
            found.update(f"{os.path.relpath(path, place)} ".encode() + hashlib.sha256(path.read_bytes()).digest())
    return found.hexdigest()


def files(place: Path) -> Iterator[Path]:
    """All files of a package except bytecode beside sources; the archive if it is in one."""
    if place.is_dir():
        yield from (path for path in place.rglob("*") if path.is_file() and path.parent.name != "__pycache__")
    else:
        yield next(path for path in (place, *place.parents) if path.is_file())
