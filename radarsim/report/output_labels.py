"""Labels of lines that commands print, and times on them."""

from radarsim.language.translate import term, tr

LABELS = (  # of lines
    *(term("claims"), term("tables"), term("figures"), term("report"), term("removed"), term("note"), term("table")),
    *(term("page"), term("total"), term("share"), term("blocks"), term("attains"), term("slope"), term("also at")),
    *(term("check"), term("config"), term("package"), term("plots"), term("track"), term("tracks"), term("passed")),
    *(term("missing"), term("no rows"), term("untested"), term("gaps"), term("best"), term("advice")),
    *(term("again"), term("doubles")),
    *(term("more"), term("no effect"), term("no estimate"), term("no lock"), term("not paired"), term("left out")),
    *(term("files"), term("slight")),
)
LONG_LABEL = 8  # letters of an English label from which it does not set the width of all


def labelled_line(label: str, text: str) -> str:
    """A line under a label; without one it stands under the line before."""
    label_text, width = tr(label), max(len(tr(name)) for name in LABELS if len(name) < LONG_LABEL) + 2
    return f"{label_text:<{width}}{text}" if len(label_text) <= width - 2 else f"{label_text}  {text}"


def clock(seconds: float) -> str:
    """Seconds as h:mm:ss."""
    whole_seconds = round(seconds)
    return f"{whole_seconds // 3600}:{whole_seconds // 60 % 60:02}:{whole_seconds % 60:02}"
