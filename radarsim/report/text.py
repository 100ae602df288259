"""Numbers and counts as they stand in sentences, and text that is safe to print."""


def clock(seconds: float) -> str:
    """Seconds as h:mm:ss."""
    whole = round(seconds)
    return f"{whole // 3600}:{whole // 60 % 60:02}:{whole % 60:02}"


def plural(count: int, noun: str) -> str:
    """1 case, 2 cases."""
    return f"{count} {noun}{'s' * (count != 1)}"


def printable(text: str) -> str:
    """Text without control characters: what a config names must not steer the terminal."""
    return "".join(c if c.isprintable() else "�" for c in text)


def significant_digits(value: float, form: str = "#.4g") -> str:
    """A number in a form, of four figures, as sentences have it: no point at its end, no zero below zero, a minus."""
    text = format(value, form).removesuffix(".")
    return (text if float(text) else text.removeprefix("-")).replace("-", "−")


def known(value: float, form: str = "#.4g", after: str = "") -> str:
    """`figures` of a number and what follows it, or nothing for not-a-number."""
    return significant_digits(value, form) + after if value == value else ""
