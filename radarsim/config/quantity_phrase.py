"""The phrase that says what is asked: a quantity, its component, and the scans at which it is taken.

`sigma r at 60 s`, `lock at k 6`, `worst sigma r`, `mean sigma r from 60 s`, `sigma r in the long run`, `gain of Vr at
the end`."""

import re
from typing import Any, Literal, NamedTuple

Over = Literal["at", "worst", "mean", "long run"]
OVER_SCANS = ("worst", "mean")  # what is taken over several scans
TIME_ROUNDING = 1e-12  # of a time: the scan that a phrase names may be at a rounded one
NUMBER = r"[\d.eE+-]+"
PHRASE = re.compile(
    r"(?:(?P<over>worst|mean) +)?(?P<name>[\w-]+)(?: +(?:of +)?(?P<part>(?!(?:at|in|from|of) )\S.*?))??"
    rf"(?: +(?:at +(?:(?P<s>{NUMBER}) *s|k *=? *(?P<k>\d+)|(?P<end>the +end))|(?P<long>in +the +long +run)"
    rf"|from +(?P<from_s>{NUMBER}) *s(?: +on)?))?"
)
TIME_WORDS = re.compile(r" (?:at|from) | in the ")
EXAMPLES = (
    *('"sigma r at 60 s"', '"worst sigma r"', '"mean sigma r from 60 s"', '"sigma r in the long run"'),
    '"gain of Vr at the end"',
)


class PhraseError(ValueError):
    """A text that is no phrase; its message is the requirement."""


class QuantityPhrase(NamedTuple):
    """What a phrase says. `at`: at time at_s, s, at scan at_k, or at the last; `worst`, `mean`: over the scans from
    from_s on, s, by default those that count."""

    name: str
    component: str | None = None
    over: Over = "at"
    at_s: float | None = None
    at_k: int | None = None
    from_s: float | None = None


def parse_phrase(text: str) -> QuantityPhrase:
    """The meaning of a phrase. Raises PhraseError.

    >>> parse_phrase("mean sigma r from 60 s")
    QuantityPhrase(name='sigma', component='r', over='mean', at_s=None, at_k=None, from_s=60.0)
    """
    match = PHRASE.fullmatch(text.strip()) if isinstance(text, str) else None
    if match is None or TIME_WORDS.search(f" {match['part']} "):
        raise PhraseError(f"must be a quantity such as {', '.join(EXAMPLES)}, got {text!r}")
    over: Literal["worst", "mean"] | None = match["over"]  # type: ignore[assignment]
    has_time = match["s"] or match["k"] or match["end"] or match["long"]
    if over and has_time:
        raise PhraseError(f"{over} is over scans: write from S s in place of a time, got {text!r}")
    if match["from_s"] and not over:
        raise PhraseError(f"from S s goes with worst or mean, got {text!r}")
    at_s, from_s = (_seconds(match[group]) for group in ("s", "from_s"))
    return QuantityPhrase(
        "sigma" if match["name"] == "σ" else match["name"].replace("-", "_"),
        match["part"],
        "long run" if match["long"] else over or "at",
        at_s,
        int(match["k"]) if match["k"] else None,
        from_s,
    )


def is_counted(t_s: Any, from_s: float | None) -> Any:
    """Whether scans at times t_s, s, count from a time on; without one all do."""
    return t_s >= (from_s or 0.0) * (1 - TIME_ROUNDING)


def _seconds(text: str | None) -> float | None:
    try:
        return None if text is None else float(text)
    except ValueError:
        raise PhraseError(f"no time in s: {text}") from None
