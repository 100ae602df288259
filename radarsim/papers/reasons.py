"""Reasons why a claim is not judged, in the current language.

claims.csv and interpretations.csv have them in English."""

import re
from collections.abc import Iterator

from radarsim.language.numerals import numeral
from radarsim.language.translate import term, tr

NUMBER_PATTERN = re.compile(r"-?\d+(\.\d+)?(e[+-]?\d+)?")
PLACEHOLDER_PATTERN = re.compile(r"\{(\w+)\}")
REASONS = (  # `changed` is made of differences, case by case
    term("not the paper's experiment: {changed}"),
    term("{case} ends at {end} s, the paper's run at {duration} s"),
    term("the run of RLS {number} ends at {end} s, before {asked} s"),
    term(
        "exact value and simulation differ by more than {errors} standard errors: exact {exact}, simulated {simulated} "
        "[{lo}, {hi}]"
    ),
    term("its measure fails: {error}"),
    term("no filter {name}; there are {names}"),
    term("no component {name}; there are {names}"),
    term("filter {name} is the baseline: it has no gain"),
)
DIFFERENCES = (
    term("{missing} of the paper's {count} {key} changed or missing"),
    term("{key} differs from the paper's"),
    term("{key} is {own}, the paper's {printed}"),
)
AND_MORE = term("and {count} more")
PLAIN_REASONS = (
    term("realisations of a filter depend on each other: no interval holds"),
    *(term("no such experiment is shipped"), term("a required case is missing"), term("there is no gain")),
    term("its measure gives no number"),
    *(term("there is nothing to measure it with"), term("no such scans"), term("not known exactly")),
    *(term("no Kalman filter with manoeuvre variance"), term("gains over growing memory")),
    *(term("the run ends before the manoeuvre does"), term("the errors of its realisations are not known")),
    term("(15) has no root: with the phase in it, its left side exceeds c at every length"),
)


def translate_reason(why: object) -> str:
    """A reason in the current language; an unknown one unchanged."""
    text = str(why)
    for message in REASONS:
        match = _message_pattern(message).fullmatch(text)
        if match:
            values = _placeholder_values(match)
            return tr(message, **values | {"changed": "; ".join(_differences_by_case(values.get("changed", "")))})
    return tr(text)


def _differences_by_case(changed: str) -> Iterator[str]:
    """Differences by case: `rls2: radar.sigma_range_m is 30, the paper's 25; and 2 more`."""
    for part in changed.split("; "):
        case, _, differences = part.rpartition(": ")
        match = _message_pattern(AND_MORE).fullmatch(part)
        if match:
            yield tr(AND_MORE, **_placeholder_values(match))
        else:
            yield (f"{case}: " if case else "") + ", ".join(map(_translate_difference, _split_differences(differences)))


def _split_differences(differences: str) -> list[str]:
    """A list of differences split; the second half of one begins with a comma as well."""
    return re.split(r", (?!the paper's )(?=\S+ is |\d+ of the paper's |\S+ differs from )", differences)


def _translate_difference(text: str) -> str:
    for message in DIFFERENCES:
        match = _message_pattern(message).fullmatch(text.removesuffix(" …"))
        if match:
            return tr(message, **_placeholder_values(match)) + (" …" if text.endswith(" …") else "")
    return tr(text)


def _placeholder_values(match: re.Match[str]) -> dict[str, str]:
    """The values in the placeholders, numbers as the language writes them."""
    return {name: numeral(text) if NUMBER_PATTERN.fullmatch(text) else text for name, text in match.groupdict().items()}


def _message_pattern(message: str) -> re.Pattern[str]:
    """The pattern of a message with its placeholders filled."""
    parts = PLACEHOLDER_PATTERN.split(message)
    return re.compile("".join(f"(?P<{text}>.+?)" if i % 2 else re.escape(text) for i, text in enumerate(parts)))
