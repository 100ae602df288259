"""What P4's report says: the question of an experiment, and its answer in sentences."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language.translate import list_filters, plural, quote_name, term, tr
from radarsim.report import (
    case_selection,
    compared_value,
    key_labels,
    rare_events,
    sentences,
    statistics,
    tables,
    wording,
)
from radarsim.report.quantities import LOCK, Quantity
from radarsim.report.sentences import Sentence
from radarsim.studies.discriminator.kernels.sums import LOCKS
from radarsim.studies.discriminator.tables import last_locks

if TYPE_CHECKING:
    import pandas as pd


TablesByName = Mapping[str, "pd.DataFrame"]
LOSS = Quantity("loss", term("rate of lost locks"), "rare", "event_rate")  # a size, as rare ones differ by factors


def question(experiment: Experiment) -> str:
    """What the experiment asks, in one sentence."""
    names = list(dict.fromkeys(e.name for case in experiment.cases for e in case.spec.estimators))
    return tr(
        "How often does the Doppler estimate of a burst lock, and how accurate is it then ({estimators})?",
        estimators=list_filters(names),
    )


def answer(results: Sequence[CaseResult], tables_by_name: TablesByName) -> list[Sentence]:
    """Sentences with numbers: by case where nothing is swept, else the range of lock of each estimator."""
    seeks_losses = any(result.spec.rare is not None for result in results)
    reported = list(results) if seeks_losses else [result for result in results if not result.swept_values]
    if not reported and len(results) > 1:
        return [_range_of_locks(results, tables_by_name, name) for name in results[0].axes.filters]
    reported = reported or list(results)
    answer = _worst_against_design(results, tables_by_name)
    for result in reported:
        prefix = f"{key_labels.plain_case_label(result)}: " if len(reported) > 1 else ""
        for sentence in _case_sentences(result, tables_by_name):
            answer.append(sentence.with_text(prefix + sentence.text))
    return answer


def _worst_against_design(results: Sequence[CaseResult], tables_by_name: TablesByName) -> list[Sentence]:
    """The case in which lock is lost the most often for its design, where losses are sought in several cases."""
    if len(results) < 2:
        return []
    losses = []
    for result in (result for result in results if result.spec.rare is not None):
        rates = tables.group_by(tables_by_name["rare"], "case")[(result.name,)]
        for _, row in rates[rates["sought"]].iterrows():
            estimator = next(e for e in result.spec.estimators if e.name == row["filter"])
            if estimator.schedule == "designed" and estimator.lock_probability < 1:
                designed = 1 - estimator.lock_probability
                losses.append((row["event_rate"] / designed, designed, row))
    if not losses:
        return []
    times, designed, row = max(losses, key=lambda loss: loss[0])
    rate = compared_value.row_value(row, LOSS).chosen_among(len(losses))
    text = tr(
        "{estimator} loses lock in {rate} of the bursts, {times:.3g} times the {designed:.3g} of its design: the "
        "largest ratio of {count} cases{chosen}.",
        estimator=quote_name(row["filter"]),
        rate=rate.text(form=".3g"),
        designed=designed,
        times=times,
        count=len(losses),
        chosen=rate.choice_remark(compared_value.cases_together),
    )
    return [Sentence(text, rate.intervals)]


def _case_sentences(result: CaseResult, tables_by_name: TablesByName) -> list[Sentence]:
    """Lock and accuracy of the first estimator at its last window, how often lock is lost, the locks of the others."""
    first_name, *other_names = result.axes.filters
    case_sentences = [_first_estimator(result, last_locks(tables_by_name, result, first_name), first_name)]
    if result.spec.rare is not None:
        case_sentences.append(_rate_of_losses(tables.group_by(tables_by_name["rare"], "case")[(result.name,)]))
    if other_names:
        rows = [last_locks(tables_by_name, result, name) for name in other_names]
        locks = "; ".join(f"{quote_name(name)}, {_lock_rate(row)}" for name, row in zip(other_names, rows, strict=True))
        case_sentences.append(Sentence(tr("Lock rates of the others: {locks}.", locks=locks), _lock_intervals(*rows)))
    return case_sentences


def _first_estimator(result: CaseResult, row: "pd.Series[Any]", name: str) -> Sentence:
    """How often an estimator is locked at its last window, and how accurate it is then.

    Where losses of lock are sought, a part of the bursts is shifted: the rate of losses has a sentence of its own."""
    k = int(row["k"])
    fields: dict[str, Any] = {"estimator": quote_name(name), "lock": _lock_rate(row), "bursts": result.count}
    if not row["lock_rate"]:
        text = plural(
            "{estimator} ({count} window): locked in {lock} of {bursts:,} bursts.",
            "{estimator} ({count} windows): locked in {lock} of {bursts:,} bursts.",
            k,
            **fields,
        )
        return Sentence(text, _lock_intervals(row))
    plain_bursts = max(result.sums["locks"][0, k - 1, LOCKS.index("lock")], 1)
    bound = result.axes.posterior_sigma[0, k - 1] / result.axes.exact_sigma[0, k - 1]
    moments = np.asarray(result.sums["error"])[0, k - 1]
    sigma = statistics.root_mean_square(moments[:, 1], moments[:, 3], plain_bursts, looks=len(moments))
    lowest, highest = int((sigma.value / bound).argmin()), int((sigma.value / bound).argmax())
    ratios = {"least": lowest, "most": highest}
    fields |= {name: wording.estimate((end[i] / bound[i] for end in sigma), form=".3f") for name, i in ratios.items()}
    if result.spec.rare is not None:
        text = plural(
            "{estimator} ({count} window): RMS error of the locked bursts over the bound (forecast included) is "
            "{least} to {most}, from {plain:,} bursts without importance sampling.",
            "{estimator} ({count} windows): RMS error of the locked bursts over the bound (forecast included) is "
            "{least} to {most}, from {plain:,} bursts without importance sampling.",
            k,
            plain=int(plain_bursts),
            **fields,
        )
        return Sentence(text)
    text = plural(
        "{estimator} ({count} window): locked in {lock} of {bursts:,} bursts; RMS error of the locked ones over the "
        "bound (forecast included) is {least} to {most}.",
        "{estimator} ({count} windows): locked in {lock} of {bursts:,} bursts; RMS error of the locked ones over the "
        "bound (forecast included) is {least} to {most}.",
        k,
        **fields,
    )
    return Sentence(text, _lock_intervals(row))


def _range_of_locks(results: Sequence[CaseResult], tables_by_name: TablesByName, name: str) -> Sentence:
    """The least and the largest lock of an estimator among swept cases."""
    cases = [result for result in results if name in result.axes.filters]
    rows = {result.name: last_locks(tables_by_name, result, name) for result in cases}
    cases.sort(key=lambda result: rows[result.name]["lock_rate"])
    extremes = (cases[0], cases[-1])
    rates = [_lock_rate(rows[result.name], len(cases)) for result in extremes]
    fields = {
        "estimator": quote_name(name),
        "realisations": case_selection.realisations_text(cases),
        "together": compared_value.cases_together(len(cases)),
    }
    if len(cases) > 1 and rates[0] == rates[1]:
        text = tr(
            "{estimator}: locked in {rate} of the bursts of each of {count} cases of {realisations} ({together}).",
            rate=rates[0],
            count=len(cases),
            **fields,
        )
        return Sentence(text, _lock_intervals(*(rows[result.name] for result in extremes)))
    lowest, highest = (
        f"{rate} ({key_labels.without_markup(key_labels.swept_description(result))})"
        for rate, result in zip(rates, extremes, strict=True)
    )
    text = plural(
        "{estimator}, share of bursts locked in {count} case of {realisations}: lowest {least}; highest {most}.",
        "{estimator}, share of bursts locked in {count} cases of {realisations} each ({together}): lowest {least}; "
        "highest {most}.",
        len(cases),
        least=lowest,
        most=highest,
        **fields,
    )
    return Sentence(text, _lock_intervals(*(rows[result.name] for result in extremes)))


def _lock_rate(row: "pd.Series[Any]", looks: int = 1) -> str:
    """A share of bursts with its interval; of one that was chosen among several, with one that holds for all."""
    return wording.share(*(100 * end for end in compared_value.row_value(row, LOCK).chosen_among(looks).estimate))


def _lock_intervals(*rows: "pd.Series[Any]") -> tuple[sentences.MeasuredInterval, ...]:
    return sentences.intervals("locks", "lock", *rows)


def _rate_of_losses(rates: "pd.DataFrame") -> Sentence:
    """How often lock is lost, by importance sampling, of the estimator for which it is sought."""
    row = rates[rates["sought"]].iloc[0]
    if not rare_events.is_estimated(row):
        text = tr(
            "{estimator}: probability of a lost lock: no estimate (effective sample size {n_eff:,.0f}).",
            estimator=quote_name(row["filter"]),
            n_eff=row["n_eff"],
        )
        return Sentence(text, sentences.intervals("rare", "event_rate", row))
    text = tr(
        "{estimator}: lock is lost in {rate} of the bursts (importance sampling; "
        "{events:,} events, effective sample size {n_eff:,.0f}).",
        estimator=quote_name(row["filter"]),
        **rare_events.rate_fields(row),
    )
    return Sentence(text, sentences.intervals("rare", "event_rate", row))
