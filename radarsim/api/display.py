"""How Python and notebooks show an answer: its first sentences, its first figure, its figures by name."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

    from radarsim.report.drawing.model import Figure


MAX_LINES, MAX_LETTERS = 3, 200  # of a text that stands for the whole


class Displayable(ABC):
    """An answer with sentences, and perhaps a table and figures, drawn on demand."""

    @abstractmethod
    def _answer_lines(self) -> Sequence[str]:
        """The answer in words."""

    @property
    def _label(self) -> str:
        """Name of the answer among others."""
        return ""

    @property
    def _figures_by_name(self) -> "Mapping[str, Figure]":
        return {}

    @property
    def _html(self) -> Sequence[str]:
        """HTML in a notebook, above the first figure and below it."""
        from html import escape

        return "".join(f"<p>{escape(line)}</p>" for line in self._answer_lines()), ""

    def __repr__(self) -> str:
        return first_lines(self._answer_lines())

    def _repr_html_(self) -> str:
        above, below = self._html
        return "\n".join(filter(None, (above, _image(next(iter(self._figures_by_name.values()), None)), below)))

    @property
    def figures(self) -> tuple[str, ...]:
        """Names of the figures, for `figure`."""
        return tuple(self._figures_by_name)

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
        from radarsim.report.drawing.canvas import draw_on, render

        figures = self._figures_by_name
        if not figures:
            raise KeyError("there are no figures")
        name = name or next(iter(figures))
        if not isinstance(name, str) or name not in figures:
            raise KeyError(f"no figure {name!r}; there are: {', '.join(figures)}")
        if ax is None:
            return render(figures[name])
        return draw_on(figures[name], ax, self._label if label is None else label)


class ShortTuple(tuple[Any, ...]):
    """A tuple shown by its first item and its length."""

    __slots__ = ()

    def __repr__(self) -> str:
        ellipsis = f", … ({len(self)})" if len(self) > MAX_LINES else ""
        return f"({', '.join(map(repr, self[:MAX_LINES]))}{ellipsis})"


def first_lines(lines: Sequence[str]) -> str:
    """The first lines, long ones shortened."""
    lines_shown = [_shortened(line) for line in lines[:MAX_LINES]]
    if len(lines) > MAX_LINES and lines_shown:
        lines_shown[-1] += " …"
    return "\n".join(lines_shown)


def _shortened(line: str) -> str:
    """A line of at most MAX_LETTERS: cut between words, and before a bracket that would stay open."""
    if len(line) <= MAX_LETTERS:
        return line
    head = line[: MAX_LETTERS - 1]
    end, open_brackets = head.rfind(" "), list[int]()
    for place, letter in enumerate(head):
        if letter in "([":
            open_brackets.append(place)
        elif letter in ")]" and open_brackets:
            open_brackets.pop()
    if open_brackets and open_brackets[0] > 0:
        end = min(end, open_brackets[0])
    return f"{head[:end].rstrip(' ,;:')} …" if end > 0 else f"{head[:-1]} …"


def _image(figure: "Figure | None") -> str:
    """A figure as self-contained HTML; empty for none."""
    if figure is None:
        return ""
    from base64 import b64encode
    from html import escape

    from radarsim.report.drawing.canvas import save
    from radarsim.report.math_text import plain_text

    data = b64encode(save(figure, ("png",))["png"]).decode("ascii")
    style = f"width:{figure.width_mm:g}mm;max-width:100%"
    return f'<img src="data:image/png;base64,{data}" alt="{escape(plain_text(figure.title))}" style="{style}">'
