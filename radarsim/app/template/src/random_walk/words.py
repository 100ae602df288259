"""The report's question and answer. Yours: sentences with numbers and 95 % intervals from the tables, through `tr`."""

from collections.abc import Mapping, Sequence

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language import tr


def question(experiment: Experiment) -> str:
    """The question of an experiment, in one sentence."""
    names = list(dict.fromkeys(one.name for case in experiment.cases for one in case.spec.filters))
    return tr("How well do the filters {names} follow a random walk?", names=", ".join(names))


def answer(results: Sequence[CaseResult], made: Mapping) -> list[str]:
    """A sentence for each case and filter: σ at the last scan, and the gain against the baseline."""
    last = made["gains"].groupby(["case", "filter"], sort=False).tail(1).set_index(["case", "filter"])
    sentences = []
    for row in made["steady"].to_dict("records"):
        words = f"{row['last_sigma']:.4g} m [{row['last_lo']:.4g}, {row['last_hi']:.4g}]"
        if (row["case"], row["filter"]) in last.index:
            gain = last.loc[(row["case"], row["filter"])]
            interval = f"[{gain['gain_lo']:.3g}, {gain['gain_hi']:.3g}]"
            told = {"gain": f"{gain['gain_percent']:.3g} % {interval}", "base": gain["baseline"]}
            words = tr("{words}, a gain of {gain} against {base}", words=words, **told)
        told = {"case": row["case"], "filter": row["filter"], "words": words}
        sentences.append(tr("{case}, {filter}: σ of the position at the last scan is {words}.", **told))
    return sentences
