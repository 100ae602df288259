"""Print what identifies the cases of shipped configs, as JSON: `case_identities.py [CONFIG[,CONFIG…]…]`; default: all.

Each argument is computed by a process that has imported no study before. What was imported before must not change what
is printed, nor must the version of a package: stored blocks are found by it."""

import json
import multiprocessing
import sys
from collections.abc import Iterable

from radarsim.api.configs import load
from radarsim.config.experiment import Case
from radarsim.config.find_files import SHIPPED
from radarsim.config.identity import digest, identity_keys, world_keys

CONFIGS = tuple(sorted(path.stem for path in (SHIPPED / "configs").glob("*.yaml")))


def case_identities(configs: Iterable[str]) -> dict[str, str]:
    """By config and case, what identifies the case."""
    return {f"{stem}: {case.name}": case_identity(case) for stem in configs for case in load(stem).cases}


def case_identity(case: Case) -> str:
    """The digest of a case's keys and of those that its noise depends on."""
    return digest([identity_keys(case.spec), world_keys(case.spec)])


if __name__ == "__main__":
    groups = [group.split(",") for group in sys.argv[1:]] or [CONFIGS]
    with multiprocessing.get_context("fork").Pool(1, maxtasksperchild=1) as processes:
        parts = processes.map(case_identities, groups, chunksize=1)
    json.dump({name: identity for part in parts for name, identity in part.items()}, sys.stdout)
