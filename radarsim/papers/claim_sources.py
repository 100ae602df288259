"""What a verdict follows from besides the words of its claim: measures, the code of a package, the keys of its config.

Of radarsim's own papers only the words and the calls of measures count: their classes are shipped with the code. Of a
user's package all of its code and data counts, and of the user's packages that it imports, without comments, docstrings
and the text of its claims, which counts as what is declared in it."""

from collections.abc import Mapping
from typing import Any

from radarsim.api import configs
from radarsim.config.identity import identity_keys
from radarsim.papers.claim import Claim, Part
from radarsim.papers.measure_call import MeasureCall
from radarsim.papers.paper_keys import CLAIMS_FILE, INTERPRETATIONS_FILE
from radarsim.studies.sources import RADARSIM, package_digest

CLAIMS_TEXT = "claims_yaml"  # the attribute of a study in one file that holds its claims
CLAIMS_FILES = (CLAIMS_FILE, INTERPRETATIONS_FILE)  # of a package of several files


def plain_data(value: Any) -> Any:
    """A value of any type as plain data that can be hashed."""
    if isinstance(value, Mapping):
        return {str(key): plain_data(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain_data(item) for item in value]
    return value if isinstance(value, str | bool | int | None) else repr(value)


def measure_calls(part: Part) -> list[Any]:
    """The functions that measure a part, with the cases that they are called with and their arguments."""
    return [_call(function) for function in (part.measure, part.scale, part.exact, part.ceiling)]


def _call(function: Any) -> Any:
    owner = getattr(function, "__self__", None)
    call = owner if isinstance(owner, MeasureCall) else function
    if isinstance(call, MeasureCall):
        return [call.name, plain_data(call.cases), plain_data(call.arguments)]
    return None if call is None else getattr(call, "__qualname__", type(call).__qualname__)


def package_sources(claim: Claim, module: str) -> Any:
    """The code and the config that a claim of a user's package rests on; nothing for radarsim's own.

    module: one of the package that declares the claim."""
    modules = {module, *(_module_of(function) for part in claim.parts for function in (part.measure, part.exact))}
    user_packages = sorted({name.partition(".")[0] for name in modules if name} - {RADARSIM, "builtins", "functools"})
    if not user_packages:
        return None
    return [
        package_digest(tuple(user_packages), CLAIMS_TEXT, CLAIMS_FILES),
        [_case_keys(case) for case in configs.shipped(claim.config) or ()],
    ]


def _module_of(function: Any) -> str:
    owner = getattr(function, "__self__", function)
    call = owner.function if isinstance(owner, MeasureCall) else function
    return getattr(call, "__module__", None) or ""


def _case_keys(case: Any) -> Any:
    """What decides the numbers of a case: its keys, and the code of user filters."""
    filters = [[member.name, getattr(member, "sources_digest", "")] for member in case.user_filters]
    return plain_data([case.name, identity_keys(case.spec), filters])
