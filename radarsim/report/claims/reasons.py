"""Why a claim is not judged, in the language spoken: claims.csv and readings.csv say it in English."""

import re
from collections.abc import Iterator

from radarsim.language import numeral, term, tr

NUMBER = re.compile(r"-?\d+(\.\d+)?(e[+-]?\d+)?")
PLACE = re.compile(r"\{(\w+)\}")
WHOLE = (  # `changed` is made of differences, case by case
    term("not the paper's experiment: {changed}"),
    term("{case} ends at {end} s, the paper's run at {duration} s"),
    term("the run of RLS {number} ends at {end} s, before {asked} s"),
    term(
        "exact value and simulation differ by more than {errors} standard errors: exact {exact}, simulated {simulated} "
        "[{lo}, {hi}]"
    ),
)
DIFFERENCES = (
    term("{missing} of the paper's {count} {key} changed or not there"),
    term("{key} another one than the paper's"),
    term("{key} is {own}, the paper's {printed}"),
)
AND_MORE = term("and {count} more")
SAID_WHOLE = (
    *(term("no such experiment is shipped"), term("a case that it needs is not there"), term("there is no gain")),
    *(term("there is nothing to measure it by"), term("no such scans"), term("not known exactly")),
    *(term("no Kalman filter with manoeuvre variance"), term("gains against growing memory")),
    *(term("the run ends before the manoeuvre does"),),
    term("(15) has no root: with the phase in it, its left side is over c at every length"),
)


def said(why: object) -> str:
    """A reason in the language spoken; one that is not known here as it stands."""
    text = str(why)
    for message in WHOLE:
        found = _pattern(message).fullmatch(text)
        if found:
            places = _said(found)
            return tr(message, **places | {"changed": "; ".join(_by_case(places.get("changed", "")))})
    return tr(text)


def _by_case(changed: str) -> Iterator[str]:
    """What differs, by case: `rls2: radar.sigma_range_m is 30, the paper's 25; and 2 more`."""
    for part in changed.split("; "):
        case, _, differences = part.rpartition(": ")
        found = _pattern(AND_MORE).fullmatch(part)
        if found:
            yield tr(AND_MORE, **_said(found))
        else:
            yield (f"{case}: " if case else "") + ", ".join(map(_difference, _apart(differences)))


def _apart(differences: str) -> list[str]:
    """Differences one by one; the second half of one begins with a comma as well."""
    return re.split(r", (?!the paper's )(?=\S+ is |\d+ of the paper's |\S+ another one )", differences)


def _difference(text: str) -> str:
    for message in DIFFERENCES:
        found = _pattern(message).fullmatch(text.removesuffix(" …"))
        if found:
            return tr(message, **_said(found)) + (" …" if text.endswith(" …") else "")
    return tr(text)


def _said(found: re.Match[str]) -> dict[str, str]:
    """What stands in the places, numbers as the language writes them."""
    return {name: numeral(text) if NUMBER.fullmatch(text) else text for name, text in found.groupdict().items()}


def _pattern(message: str) -> re.Pattern[str]:
    """What a message becomes when its places are filled."""
    parts = PLACE.split(message)
    return re.compile("".join(f"(?P<{one}>.+?)" if i % 2 else re.escape(one) for i, one in enumerate(parts)))
