"""How Python and notebooks show an answer: its first sentences, its first figure, its figures by name.

The output of --json: plain data, one document for each command, with the content of the text output."""

import json
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.extensions import extensions

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    from radarsim.app.compare import Comparison, DopplerChart
    from radarsim.app.configs import Inventory
    from radarsim.app.outlook import Outlook
    from radarsim.app.result import Result
    from radarsim.app.sensitivity import Sensitivity
    from radarsim.app.solve import Answer
    from radarsim.app.tune import Tuned
    from radarsim.config.experiment import Experiment
    from radarsim.report.drawing import Figure
    from radarsim.report.figures import Canvas


MOST_LINES, MOST_LETTERS = 3, 200  # of a text that stands for the whole


class Shown(ABC):
    """An answer with sentences, and perhaps a table and figures, drawn on demand."""

    @abstractmethod
    def _said(self) -> Sequence[str]:
        """The answer in words."""

    @property
    def _label(self) -> str:
        """Name of the answer among others."""
        return ""

    @property
    def _described(self) -> "Mapping[str, Figure]":
        return {}

    @property
    def _html(self) -> Sequence[str]:
        """HTML in a notebook, above the first figure and below it."""
        from html import escape

        return "".join(f"<p>{escape(line)}</p>" for line in self._said()), ""

    def __repr__(self) -> str:
        return brief(self._said())

    def _repr_html_(self) -> str:
        above, below = self._html
        return "\n".join(filter(None, (above, _image(next(iter(self._described.values()), None)), below)))

    @property
    def figures(self) -> tuple[str, ...]:
        """Names of the figures, for `figure`."""
        return tuple(self._described)

    def figure(self, name: str = "", *, ax: Any = None, label: str | None = None) -> "Canvas":
        """A Matplotlib figure by its name, by default the first; KeyError names those there are.

        ax: existing axes to draw on, as many as the figure has panels. Curves already there keep their colours, so that
        two results can share axes. label is put before the names of the new curves; by default the config's name.

        >>> import matplotlib.pyplot as plt, radarsim
        >>> result = radarsim.run("rls2", realisations=2000)
        >>> result.figure("sigma_r").axes[0].get_xlabel()
        'time from the first plot, s'
        >>> _, ax = plt.subplots()
        >>> for name in ("rls2", "rls4"):
        ...     _ = radarsim.run(name, realisations=2000).figure("gain_r", ax=ax)
        >>> [words.get_text() for words in ax.get_legend().get_texts()]
        ['rls2, r+Vr', 'rls4, r+Vr', 'exact']
        >>> plt.close()
        """
        from radarsim.report.figures import draw_on, render

        described = self._described
        if not described:
            raise KeyError("there are no figures")
        name = name or next(iter(described))
        if not isinstance(name, str) or name not in described:
            raise KeyError(f"no figure {name!r}; there are: {', '.join(described)}")
        if ax is None:
            return render(described[name])
        return draw_on(described[name], ax, self._label if label is None else label)


class Several(tuple[Any, ...]):
    """A tuple shown by its first item and its length."""

    __slots__ = ()

    def __repr__(self) -> str:
        more = f", … ({len(self)})" if len(self) > MOST_LINES else ""
        return f"({', '.join(map(repr, self[:MOST_LINES]))}{more})"


def brief(lines: Sequence[str]) -> str:
    """The first lines, and of long ones the beginning."""
    first = [line if len(line) <= MOST_LETTERS else f"{line[: MOST_LETTERS - 2]} …" for line in lines[:MOST_LINES]]
    if len(lines) > MOST_LINES and first:
        first[-1] += " …"
    return "\n".join(first)


def _image(figure: "Figure | None") -> str:
    """A figure as self-contained HTML; empty for none."""
    if figure is None:
        return ""
    from base64 import b64encode
    from html import escape

    from radarsim.report.figures import save
    from radarsim.report.wording import spoken

    data = b64encode(save(figure, ("png",))["png"]).decode("ascii")
    style = f"width:{figure.width_mm:g}mm;max-width:100%"
    return f'<img src="data:image/png;base64,{data}" alt="{escape(spoken(figure.title))}" style="{style}">'


# ---- documents -------------------------------------------------------------------------------------------------------
def text(document: object) -> str:
    """A document as JSON; NaN and infinities become null."""
    return json.dumps(_plain(document), indent=2, ensure_ascii=False, allow_nan=False)


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if hasattr(value, "item"):  # NumPy's numbers
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value


def fields(one: "DataclassInstance") -> dict[str, Any]:
    """A dataclass as a dict, paths as text."""
    return {key: str(value) if isinstance(value, Path) else value for key, value in asdict(one).items()}


def result(one: "Result") -> dict[str, Any]:
    """A finished run or report: request, counts, answer, σ at the last scan, verdicts, files."""
    written = one.written
    assert written is not None  # the commands write what they print
    names = {case.name: case.count for case in one.cases}
    return {
        "config": one.experiment.stem,
        "stop": one.facts["stop"],
        "unmet": one.unmet,
        "cases": {
            case.name: {"asked": case.realisations, "done": names.get(case.name, 0), "seed": case.seed}
            for case in one.experiment.cases
        },
        "precision": one.facts.get("precision"),
        "answer": list(written.answer),
        "last_scan": one.last_scan.to_dict("records"),
        **{key: value for extension in extensions() for key, value in extension.result_document(one).items()},
        "folder": str(written.folder),
        "files": list(written.files),
        "warnings": one.warnings,
    }


def outlook(experiment: "Experiment", one: "Outlook") -> dict[str, Any]:
    """The cost of a run."""
    return {"config": experiment.stem, "path": experiment.path, **asdict(one), "of": one.of.name}


def answer(one: "Answer") -> dict[str, Any]:
    """The answer of `solve`: the value with its interval, or the limit where it is not attainable."""
    return {**asdict(one), "quantity": one.quantity.words}


def tuned(one: "Tuned") -> dict[str, Any]:
    """What tuning found and gains."""
    return {**asdict(one), "quantity": one.quantity.words, "answer": one.answer}


def sensitivity(one: "Sensitivity") -> dict[str, Any]:
    """The effect of each key, the quantities by name."""
    return {**asdict(one), "of": [of.name for of in one.of]}


def compared(one: "Comparison") -> dict[str, Any]:
    """A comparison: sentences, notes and warnings, the rows of comparison.csv, and the files."""
    made = {name: getattr(one, name) for name in ("files", "sentences", "notes", "warnings", "rows", "last", "told")}
    return {"folder": str(one.folder), **made}


def drawn(one: "DopplerChart") -> dict[str, Any]:
    """A chart: the sentences, the rows of chart.csv, and the files."""
    rows = one.table.to_dict("records")
    return {"folder": str(one.folder), "sentences": one.sentences, "cases": rows, "files": one.files}


def inventory(tables: "Inventory") -> dict[str, list[dict[str, str]]]:
    """Configs, scenarios, studies and filters: lists of rows by the first word of their title."""
    return {
        title.split()[0].lower(): [dict(zip(columns, row, strict=True)) for row in rows]
        for title, columns, rows in tables
    }
