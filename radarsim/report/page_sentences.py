"""The sentences of an answer as a page shows them: which are split, and which are folded."""

from collections.abc import Sequence

from radarsim.report import wording

MAX_VISIBLE_LETTERS = 200  # of an answer above its figure
MAX_SENTENCE_LETTERS = 300  # of a sentence that is not split into its clauses


def split_into_clauses(answer: Sequence[str]) -> list[str]:
    """The sentences of an answer, long ones in their clauses."""
    split = [
        wording.split_clauses(sentence) if len(sentence) > MAX_SENTENCE_LETTERS else [sentence] for sentence in answer
    ]
    return [f"{clause};" if clause is not clauses[-1] else clause for clauses in split for clause in clauses]


def headline(answer: Sequence[str]) -> str:
    """The first sentence of an answer as the page shows it, of a long one its first clause; empty without any."""
    return split_into_clauses(answer)[0].removesuffix(";") if answer else ""


def count_visible_sentences(answer: Sequence[str]) -> int:
    """How many sentences of an answer are not folded: the first one, others while they are short together."""
    lengths = [sum(len(sentence) for sentence in answer[: n + 1]) for n in range(len(answer))]
    return max(1, sum(length <= MAX_VISIBLE_LETTERS for length in lengths))
