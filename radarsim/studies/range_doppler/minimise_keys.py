"""`manoeuvre_variance: {minimise: PHRASE}`: the phrase of the commands, and the keys that it stands for."""

import math
from collections.abc import Collection, Iterator
from typing import Any

from radarsim.config.cross_checks import CheckError, check_error
from radarsim.config.quantity_phrase import OVER_SCANS, TIME_ROUNDING, PhraseError, QuantityPhrase, parse_phrase


def check_phrase(text: str, minimised: Collection[str]) -> None:
    """Raise ValueError for a phrase that is none of the errors to minimise."""
    try:
        phrase = parse_phrase(text)
    except PhraseError:
        phrase = QuantityPhrase("")
    if phrase.name == "gain":
        raise ValueError(f"must be an error, such as 'sigma {phrase.component} at the end': the less, the more gain")
    if f"{phrase.name}_{phrase.component}" not in minimised:
        raise ValueError(f"must be {', '.join(minimised)}, or a phrase such as 'worst sigma r' or 'sigma r at 60 s'")
    if phrase.over == "long run":
        raise ValueError("must be worst, mean or at a time: in the long run, without a manoeuvre, 0 is best")


def phrase_keys(text: str, from_k: int | None, scan_period_s: float) -> dict[str, Any]:
    """The keys that a phrase stands for."""
    phrase = parse_phrase(text)
    time_s, from_k = phrase.from_s if phrase.at_s is None else phrase.at_s, phrase.at_k or from_k
    if time_s is not None:
        from_k = math.ceil(time_s / scan_period_s * (1 - TIME_ROUNDING)) + 1
    at_one = (phrase.at_s, phrase.at_k) != (None, None)
    over = phrase.over if phrase.over in OVER_SCANS else "at" if at_one else "last"
    return {"minimise": f"{phrase.name}_{phrase.component}", "over": over, "from_k": from_k}


def phrase_errors(path: str, text: str, from_k: int | None, scans: int, scan_period_s: float) -> Iterator[CheckError]:
    """The errors of a phrase whose scans the run lacks, or that from_k says as well."""
    phrase, last_s = parse_phrase(text), (scans - 1) * scan_period_s
    time_s, at_s = phrase.from_s if phrase.at_s is None else phrase.at_s, phrase.at_s
    if from_k is not None and (time_s, phrase.at_k) != (None, None):
        yield check_error(f"{path}.from_k", f"stands in minimise already: {text!r}")
    elif (phrase.at_k or 0) > scans:
        yield check_error(f"{path}.minimise", f"must be at a scan up to {scans}, the last")
    elif time_s is not None and not 0 <= time_s <= last_s * (1 + TIME_ROUNDING):
        yield check_error(f"{path}.minimise", f"must be from 0 to {last_s:g} s, the last scan's time")
    elif at_s is not None and not math.isclose(at_s, scan_period_s * round(at_s / scan_period_s)):
        yield check_error(f"{path}.minimise", f"must be at the time of a scan, a multiple of {scan_period_s:g} s")
