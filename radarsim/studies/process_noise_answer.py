"""The answer's sentences on a sweep over the process noise of filters: the best value of each, and the gains then.

The best value has the least worst error over the scans that count (`counted_scans`). Values that differ from it by no
more than their noise are named together."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.config.study_keys import is_process_noise
from radarsim.engine.results import CaseResult
from radarsim.language.translate import join_names, quote_name, tr
from radarsim.report import compared_value, key_labels, tables, wording
from radarsim.report.compared_value import ComparedValue
from radarsim.report.quantities import RADIAL, SIGMA
from radarsim.report.sentences import Sentence
from radarsim.report.statistics import Estimate, simultaneous_sizes
from radarsim.studies.best_gain_answer import FilterChoices, NoiseKey, gain_sentences
from radarsim.studies.counted_scans import CountedScans, result_scans
from radarsim.studies.interface import Study

if TYPE_CHECKING:
    import pandas as pd

MIN_RANGE = 3  # values next to each other that are named as a range


class WorstError(NamedTuple):
    """The greatest σ of a filter over the scans that count, and its time, s; with the ends of intervals that hold for
    all scans, values and filters at once, so that the least of several may be taken."""

    sigma: ComparedValue
    t_s: float
    bounds: Estimate


WorstByValue = Mapping[Any, WorstError]  # by the value of the process noise


class BestNoise(NamedTuple):
    """The sentences, and the names of the cases in which a filter is at its best."""

    sentences: list[Sentence]
    cases: list[str]


def best_noise(
    study: Study, results: Sequence[CaseResult[Any]], tables_by_name: "Mapping[str, pd.DataFrame]"
) -> BestNoise:
    """Of cases that differ in a bare key of process noise alone: the best value of each filter that has the key, in the
    first component, and the gains over the baseline with each at its best."""
    component = results[0].axes.components[0][0]
    named = {each.name: each for each in (*RADIAL, *study.user_filter_components())}
    quantity = named[component].words if component in named else component
    rows = tables.group_by(tables.select_rows(tables_by_name["curves"], component=component), "case", "filter")
    best = BestNoise([], [])
    for key, subject, members in _groups(results):
        values = [_hashable(dict(member.swept_values)[key]) for member in members]
        scans = _member_scans(study, members, component)
        first = members[0]
        names = [f.name for f in first.spec.members if getattr(f, key, None) is not None]
        worst = {
            name: measured_worst_errors(values, [rows[member.name, name] for member in members], scans, len(names))
            for name in names
        }
        noise = NoiseKey(key_labels.without_markup(key_labels.key_symbol(first, key)), partial(_value_text, first, key))
        unit = key_labels.unit_label(first.axes.components[0][1])
        best.sentences.append(best_values_sentence(subject, quantity, unit, scans, noise, worst))
        choices = [filter_choices(name, errors) for name, errors in worst.items()]
        baseline = first.axes.filters[first.axes.baseline]
        for choice in choices if baseline in worst else ():
            if choice.name == baseline:
                others = [other for other in choices if other is not choice]
                best.sentences.extend(gain_sentences(subject, quantity, "worst", noise, choice, others))
        chosen = {value for choice in choices for value in choice.best}
        best.cases.extend(member.name for value, member in zip(values, members, strict=True) if value in chosen)
    return best


def _groups(results: Sequence[CaseResult[Any]]) -> list[tuple[str, str, list[CaseResult[Any]]]]:
    """Of each swept bare key of process noise, the cases that differ in nothing else, and what they are."""
    groups: dict[tuple[str, str], list[CaseResult[Any]]] = {}
    for result in results:
        for key, _ in result.swept_values:
            if is_process_noise(type(result.spec), key):
                others = key_labels.swept_description(result, without=[key])
                device = ", ".join(filter(None, (key_labels.config_device(result), others)))
                groups.setdefault((key, key_labels.without_markup(device)), []).append(result)
    return [(key, subject, members) for (key, subject), members in groups.items() if len(members) > 1]


def _hashable(value: Any) -> Any:
    return tuple(value) if isinstance(value, list) else value


def _value_text(result: CaseResult[Any], key: str, value: Any) -> str:
    return key_labels.value_with_unit(result, key, value)


def _member_scans(study: Study, members: Sequence[CaseResult[Any]], component: str) -> CountedScans:
    """The scans that count for cases that differ in a value: those at which all have settled that settle in the run."""
    counted = [result_scans(study, member, component) for member in members]
    return max([scans for scans in counted if scans.reason != "last"] or counted)


def measured_worst_errors(
    values: Sequence[Any], members: "Sequence[pd.DataFrame]", scans: CountedScans, filters: int
) -> dict[Any, WorstError]:
    """The worst error of a filter by value, from the rows of `curves` of each; filters: so many are compared."""
    counted_rows = [table[table["k"] >= scans.k] for table in members]
    looks = filters * sum(map(len, counted_rows))
    worst_rows = [compared_value.extreme(table, SIGMA) for table in counted_rows]
    return {
        value: WorstError(sigma, float(row["t_s"]), _worst_bounds(table, looks))
        for value, (row, sigma), table in zip(values, worst_rows, counted_rows, strict=True)
    }


def _worst_bounds(rows: "pd.DataFrame", looks: int) -> Estimate:
    """The greatest σ of rows of `curves`, with an interval of which so many hold at once."""
    measured = Estimate(*(rows[name].to_numpy(dtype=float) for name in ("sigma", "sigma_lo", "sigma_hi")))
    widened, exact = simultaneous_sizes(measured, looks), rows["exact_sigma"].to_numpy(dtype=float)
    return Estimate(*(float(np.nanmax(np.where(np.isnan(exact), end, exact))) for end in widened))


def filter_choices(name: str, worst: WorstByValue) -> FilterChoices:
    """A filter's worst errors as choices of its process noise."""
    return FilterChoices(name, {value: error.bounds for value, error in worst.items()}, equally_good(worst))


def equally_good(worst: WorstByValue) -> list[Any]:
    """The values with the least worst σ, and those that differ from it by no more than their noise."""
    least = min((error.sigma for error in worst.values()), key=lambda sigma: sigma.value)
    return [value for value in sorted(worst) if compared_value.is_equal(worst[value].sigma, least)]


def best_values_sentence(
    subject: str, quantity: str, unit: str, scans: CountedScans, key: NoiseKey, worst: Mapping[str, WorstByValue]
) -> Sentence:
    """The best values of each filter, by its worst σ of a quantity."""
    text = tr(
        "{subject}, best {symbol}, by the largest RMS error of the {quantity} {since}: {filters}.",
        subject=subject,
        symbol=key.symbol,
        quantity=quantity,
        since=wording.since(*scans),
        filters="; ".join(f"{quote_name(name)} {_best_values(key, unit, errors)}" for name, errors in worst.items()),
    )
    return Sentence(text)


def _error_text(error: ComparedValue, unit: str) -> str:
    """An exact error; one of a simulation rounded, as it is the largest of many."""
    if error.is_exact:
        return error.text(unit)
    return tr("about {value}", value=f"{wording.number(error.value, 3)} {unit}".rstrip())


def _best_values(key: NoiseKey, unit: str, worst: WorstByValue) -> str:
    """The value with the least worst σ; those together that differ by no more than their noise."""
    ranked, equal = sorted(worst), equally_good(worst)
    best = min(ranked, key=lambda value: worst[value].sigma.value)
    if len(equal) == 1:
        return tr(
            "{variance} (RMS error {sigma}, at {t_s:g} s)",
            variance=key.value_text(best),
            sigma=_error_text(worst[best].sigma, unit),
            t_s=worst[best].t_s,
        )
    return tr(
        "{variances} do equally well (RMS error {low} to {high})",
        variances=_value_range(key, equal, ranked),
        low=_error_text(worst[best].sigma, ""),
        high=_error_text(max((worst[value].sigma for value in equal), key=lambda sigma: sigma.value), unit),
    )


def _value_range(key: NoiseKey, values: Sequence[Any], ranked: Sequence[Any]) -> str:
    """Several of the ranked values, in words: as a range where there are some that are next to each other."""
    names = [key.value_text(value) for value in values]
    first = ranked.index(values[0])
    if len(values) >= MIN_RANGE and list(values) == list(ranked[first : first + len(values)]):
        return tr("{low} to {high}", low=names[0], high=names[-1])
    return join_names(names)
