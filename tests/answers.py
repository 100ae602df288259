"""The answer of a study as texts."""


def answer_texts(study, results, tables):
    """The sentences of a study's answer, without the intervals that they rest on."""
    return [str(sentence) for sentence in study.answer(results, tables)]
