"""What a case's numbers depend on, as one hash: the name of its stored blocks.

Its first half is the request: the resolved case with every default written out, the seed, the layout of random numbers,
the study's `model` and the user's filters by their keys. Realisations, limits, threads, output, file and display names
are not in it.

Its second half is a hash of what computes: the sources of radarsim and of the study (`radarsim.studies.sources`), and
those of the user's filters. Any edit begins anew, also of a comment; an undone edit finds its own blocks again."""

from radarsim.config.experiment import Case
from radarsim.config.identity import digest, identity_keys, portable_code, world_keys
from radarsim.engine.blocks import REQUEST_DIGITS
from radarsim.studies.registry import study
from radarsim.studies.sources import UserPackage, computing_packages, sources_digest


def identity(case: Case) -> str:
    """What a case's numbers depend on, 64 hexadecimal digits."""
    sources = digest([sources_digest(case), *(user_filter.identity for user_filter in case.user_filters)])
    return request_digest(case)[:REQUEST_DIGITS] + sources[:REQUEST_DIGITS]


def user_packages(case: Case) -> dict[str, UserPackage]:
    """The packages of the user's that compute a case, by the names under which they are installed."""
    return computing_packages(case)


def request_digest(case: Case) -> str:
    """SHA-256 of what is computed, whatever computes it."""
    from radarsim.kernels import random  # the compiler, which takes half a second, is not loaded for `radarsim list`

    request: dict[str, object] = {} if case.noise_keys is None else {"noise_of": world_keys(case.noise_keys)}
    request |= {
        "study": case.study,
        "model": study(case.study).model,
        "spec": identity_keys(case.spec),
        "seed": case.seed,
        "random_layout": random.LAYOUT,
    }
    if case.further_baselines:
        names = [member.name for member in case.spec.members]
        request["against"] = [names.index(name) for name in case.further_baselines]
    if case.user_filters:
        request["user_filters"] = [
            {
                key: portable_code(value) if key == "python" else value
                for key, value in (user_filter.written or {}).items()
                if key != "name"
            }
            for user_filter in case.user_filters
        ]
    return digest(request)
