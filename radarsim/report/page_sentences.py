"""The sentences of an answer as they are shown: at most three lines of a terminal, the first above its figure."""

import re
import textwrap
from collections.abc import Sequence

from radarsim.report import wording
from radarsim.report.exact_marks import MARK

LINE_LETTERS, MAX_LINES = 80, 3  # of a sentence on a terminal
ORDINARY_WORD = re.compile(r"(?:[^\W\d_]{2,}|[а-яё])[ ,]")  # at the beginning; other words are names of filters
SENTENCE_END = re.compile(rf"(?<=[\w%)\]{MARK}]\.) (?=[A-ZА-ЯЁ])")
MAX_VISIBLE_LETTERS = 200  # of an answer above its figure


def split_long_sentence(sentence: str) -> list[str]:
    """A sentence; in place of one that is too long several of its clauses, each after what the first colon is behind.

    >>> split_long_sentence(f"of A: {'x' * 90}; {'y' * 90}; {'z' * 90}.") == [
    ...     f"of A: {'x' * 90}; {'y' * 90}.", f"of A: {'z' * 90}."
    ... ]
    True
    """
    if is_short(sentence):
        return [sentence]
    if SENTENCE_END.search(sentence):  # several, which belong together
        return [part for whole in SENTENCE_END.split(sentence) for part in split_long_sentence(whole)]
    first, *others = wording.split_clauses(sentence.removesuffix("."))
    subject, colon, _ = first.partition(": ")
    parts = [first]
    for clause in others:
        if is_short(f"{parts[-1]}; {clause}."):
            parts[-1] += f"; {clause}"
        else:
            parts.append(f"{subject}: {clause}" if colon else capitalise_like(sentence, clause))
    end = "." if sentence.endswith(".") else ""
    return [f"{part}{end}" for part in parts]


def capitalise_like(sentence: str, clause: str) -> str:
    """A clause as a sentence of its own: with a capital if the sentence has one, and the clause begins with no name.

    >>> capitalise_like("The least", "the largest is b"), capitalise_like("The least", "r+Vr is")
    ('The largest is b', 'r+Vr is')
    >>> capitalise_like("a is", "b is")
    'b is'
    """
    has_capital = sentence[:1].isupper() and ORDINARY_WORD.match(clause) is not None
    return clause[:1].upper() + clause[1:] if has_capital else clause


def is_short(sentence: str) -> bool:
    """Whether a sentence takes no more than three lines of a terminal."""
    text = wording.with_unbroken_units(sentence)
    return len(textwrap.wrap(text, LINE_LETTERS, break_long_words=False, break_on_hyphens=False)) <= MAX_LINES


def count_visible_sentences(answer: Sequence[str]) -> int:
    """How many sentences of an answer are not folded: the first one, others while they are short together."""
    lengths = [sum(len(sentence) for sentence in answer[: n + 1]) for n in range(len(answer))]
    return max(1, sum(length <= MAX_VISIBLE_LETTERS for length in lengths))
