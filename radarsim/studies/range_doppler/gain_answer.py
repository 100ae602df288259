"""The answer's sentences on gains of observing the velocity, component by component; of a single filter on its σ."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.language.numerals import numeral
from radarsim.language.translate import join_names, quote_name, tr
from radarsim.report import case_selection, compared_value, gain_sentences, key_labels, sentences, tables, wording
from radarsim.report.compared_value import ComparedValue
from radarsim.report.quantities import GAIN, RADIAL
from radarsim.report.sentences import Sentence
from radarsim.studies.counted_scans import CountedScans
from radarsim.studies.range_doppler.config import FilterKeys, configured_variance
from radarsim.studies.range_doppler.settling import case_scans
from radarsim.studies.range_doppler.study import prepare
from radarsim.studies.range_doppler.tables import Result, follows_the_model, steady_sigma

if TYPE_CHECKING:
    import pandas as pd

TablesByName = Mapping[str, "pd.DataFrame"]
LONG_RUN_MARGIN = 1.0  # per cent: a gain further than this from that of the long run has not settled
MIN_LOSS = 1.0  # per cent: from this loss on a case's worst gain is in the answer


def answer_gains(results: Sequence[Result], tables_by_name: TablesByName, omits_range: bool = False) -> list[Sentence]:
    """A sentence on the gains in each component; of an experiment with a single filter one on its σ.

    omits_range: whether other sentences tell of the gain in range, so that this is on the greatest loss alone."""
    unswept_results = case_selection.unswept_cases(results)
    unswept_gains = tables_by_name["gains"]
    unswept_gains = unswept_gains[unswept_gains["case"].isin([result.name for result in unswept_results])]
    gains, all_gains = (tables.group_by(rows, "component") for rows in (unswept_gains, tables_by_name["gains"]))
    labels = {result.name: key_labels.plain_case_label(result) for result in results}
    of_components = [
        _gain_sentence(
            unswept_results,
            gains[(component.name,)],
            all_gains[(component.name,)],
            component.words,
            _than_baseline(unswept_results, results),
            labels,
            {result.name: case_scans(result.spec, result.axes.manoeuvre_variance, c) for result in results},
            omits_range and c == 0,
        )
        for c, component in enumerate(RADIAL)
        if (component.name,) in gains
    ]
    return [*filter(None, of_components)] or [_sigma_sentence(results[0], tables_by_name["curves"])]


def _gain_sentence(
    results: Sequence[Result],
    gains: "pd.DataFrame",
    all_gains: "pd.DataFrame",
    quantity: str,
    baseline: str,
    labels: Mapping[str, str],
    scans: Mapping[str, CountedScans],
    is_on_loss: bool,
) -> Sentence | None:
    """The gain in one quantity at the last scan, or at the last common time.

    gains: of the cases in the sentence; all_gains: of all cases, among which the greatest loss is looked for;
    baseline: as `_than_baseline`; scans: those of each case that count for extremes; is_on_loss: on the greatest loss
    alone, if any."""
    if all(gain_sentences.is_equal(compared_value.row_value(row, GAIN)) for _, row in all_gains.iterrows()):
        return _equality(results, all_gains, quantity)
    best_clause: list[Sentence] = []
    compared, time_text = _rows_compared(gains)
    has_several_filters = gains["filter"].nunique() > 1
    if is_on_loss:
        loss = _worst_loss(all_gains, None, labels, scans)
        return loss[0].with_text(f"{_capitalised(quantity)}: {loss[0].text}, {baseline}.") if loss else None
    if len(compared) > 1:
        lowest, highest = (compared_value.extreme(compared, GAIN, largest) for largest in (False, True))
        clauses = [
            _range_of_gains(compared, lowest, highest, time_text, quantity, baseline, labels, has_several_filters)
        ]
        shown = lowest[0]
        long_run = [
            f"{gain} ({_case_label(row, labels, has_several_filters)})"
            for row in (lowest[0], highest[0])
            if (gain := _long_run_gain(results, row))
        ]
        clauses += _long_run_clause(join_names(long_run))
    else:
        shown = compared.iloc[0]
        final_gain = compared_value.row_value(shown, GAIN)
        fields = {
            "quantity": _capitalised(quantity),
            "t_s": shown["t_s"],
            "gain": gain_sentences.comparison_text(final_gain),
            "base": baseline,
        }
        if _is_range_alone(results):
            text = tr("{quantity}: at {t_s:g} s, the last scan, the RMS error is {gain} {base}", **fields)
        else:
            text = tr(
                "{quantity}: at {t_s:g} s, the last scan, the RMS error with filter {filter} is {gain} {base}",
                filter=quote_name(shown["filter"]),
                **fields,
            )
        clauses = [Sentence(text, final_gain.intervals), *_long_run_clause(_long_run_gain(results, shown))]
        if not all(map(follows_the_model, results)):  # else, once settled, the gain stays what it is at the end
            best_clause = _best_gain(gains, shown, scans)
    clauses += [*best_clause, *_worst_loss(all_gains, shown.name, labels, scans)]
    sentence = sentences.join("; ", clauses)
    return sentence.with_text(f"{sentence.text}.")


def _equality(results: Sequence[Result], gains: "pd.DataFrame", quantity: str) -> Sentence:
    """That filters have the same σ at every scan."""
    value = compared_value.row_value(gains.iloc[0], GAIN)
    text = tr(
        "{quantity}: the RMS error is equal to that {base} at every scan ({known}).",
        quantity=_capitalised(quantity),
        base=_with_baseline(results, results),
        known=tr("exact") if value.is_exact else gain_sentences.unseen_text(min(result.count for result in results)),
    )
    return Sentence(text)


def _extreme_text(gain: ComparedValue) -> str:
    return gain_sentences.comparison_text(gain) + gain.choice_remark()


def _rows_compared(gains: "pd.DataFrame") -> "tuple[pd.DataFrame, str]":
    """The rows at which cases are compared, one for each case and filter, and when that is, in words.

    The last scan, where all cases end together; else the last time that all of them have in common."""
    final = gains.loc[gains.groupby(["case", "filter"], sort=False)["k"].idxmax()]
    earliest, latest = final["t_s"].min(), final["t_s"].max()
    if earliest == latest:
        return final, tr("at {t_s:g} s", t_s=earliest)
    times = [set(np.round(rows["t_s"], 6)) for rows in tables.group_by(gains, "case", "filter").values()]
    shared_times = set.intersection(*times) - {0.0}
    if not shared_times:
        return final, tr("at the last scan (after {early:g} to {late:g} s)", early=earliest, late=latest)
    time = max(shared_times)
    time_text = tr("at {t_s:g} s, the last time that all have in common,", t_s=time)
    return gains[np.round(gains["t_s"], 6) == time], time_text


def _range_of_gains(
    compared: "pd.DataFrame",
    lowest: "tuple[pd.Series[Any], ComparedValue]",
    highest: "tuple[pd.Series[Any], ComparedValue]",
    time_text: str,
    quantity: str,
    baseline: str,
    labels: Mapping[str, str],
    has_several_filters: bool,
) -> Sentence:
    """The least and the largest of several gains, and whether they differ significantly."""
    fields = {
        "quantity": _capitalised(quantity),
        "when": time_text,
        "base": baseline,
        "least": gain_sentences.comparison_text(lowest[1]),
        "low": _case_label(lowest[0], labels, has_several_filters),
        "most": gain_sentences.comparison_text(highest[1]),
        "high": _case_label(highest[0], labels, has_several_filters),
        "remark": lowest[1].choice_remark() or highest[1].choice_remark(),
    }
    if not compared_value.are_distinguished(lowest[1], highest[1]):
        text = tr(
            "{quantity}: {when} the RMS error is {least} ({low}) to {most} ({high}), not significantly different, "
            "{base}{remark}",
            **fields,
        )
    else:
        text = tr("{quantity}: {when} the RMS error is {least} ({low}) to {most} ({high}) {base}{remark}", **fields)
    return Sentence(text, (*lowest[1].intervals, *highest[1].intervals))


def _long_run_clause(gains: str) -> list[Sentence]:
    """The clause on gains of the long run, which are exact, where there are such."""
    return [Sentence(tr("still changing: {gains} in the long run", gains=gains))] if gains else []


def _long_run_gain(results: Sequence[Result], row: "pd.Series[Any]") -> str:
    """The exact gain in the long run, in words; empty where the gain in `row` has settled, or its limit is unknown.

    Where plots may be missed, both are those of the same radar without misses."""
    result = next(result for result in results if result.name == row["case"])
    radar = result.spec.radar.model_copy(update={"detection_probability": 1.0})
    if not follows_the_model(result) or not radar.as_the_papers:
        return ""
    axes = result.axes
    if not axes.plain:
        spec = result.spec.model_copy(update={"radar": radar})
        axes = prepare(Case(result.name, key_labels.config_stem(result), result.study, spec, (), 1, 1)).axes

    filter_index = axes.filters.index(row["filter"])
    component_index = [name for name, _ in axes.components].index(row["component"])
    sigma, baseline_sigma = steady_sigma(axes, filter_index), steady_sigma(axes, axes.baseline)
    if sigma is None or baseline_sigma is None:
        return ""
    limit = 100 * (1 - float(sigma[component_index] / baseline_sigma[component_index]))
    gain_now = axes.exact_gains[filter_index, row["k"] - 1, component_index]
    if not abs(gain_now - limit) > LONG_RUN_MARGIN:  # also where the gain is not a number
        return ""

    percent = f"{numeral(f'{abs(limit):.1f}')} %"
    text = tr("{percent} lower", percent=percent) if limit > 0 else tr("{percent} higher", percent=percent)
    return text if result.axes.plain else tr("{gain} with every plot", gain=text)


def _best_gain(
    gains: "pd.DataFrame", sentence_row: "pd.Series[Any]", scans: Mapping[str, CountedScans]
) -> list[Sentence]:
    """The largest gain of a case at the scans that count, unless it is the gain already given."""
    counted = scans[sentence_row["case"]]
    best, gain = compared_value.extreme(gains[gains["k"] >= counted.k], GAIN)
    if best["k"] == sentence_row["k"]:
        return []
    text = tr(
        "{since} at best {gain}, at {t_s:g} s", since=_since_text(counted), gain=_extreme_text(gain), t_s=best["t_s"]
    )
    return [Sentence(text, gain.intervals)]


def _worst_loss(
    all_gains: "pd.DataFrame", stated: Any, labels: Mapping[str, str], scans: Mapping[str, CountedScans]
) -> list[Sentence]:
    """The greatest loss of any case at the scans that count, unless it may be none or is the gain already stated, by
    its label in the table."""
    first_scan = all_gains["case"].map({case: counted.k for case, counted in scans.items()})
    all_gains = all_gains[all_gains["k"] >= first_scan]
    worst, loss = compared_value.extreme(all_gains, GAIN, largest=False)
    if not loss.estimate.hi < -MIN_LOSS or worst.name == stated:
        return []
    has_several_filters = all_gains["filter"].nunique() > 1
    fields = {"gain": _extreme_text(loss), "t_s": worst["t_s"]}
    if has_several_filters or all_gains["case"].nunique() > 1:
        label = _case_label(worst, labels, has_several_filters)
        text = tr("at worst {gain}, at {t_s:g} s, with {who}", who=label, **fields)
    else:
        text = tr("at worst {gain}, at {t_s:g} s", **fields)
    counted = scans[worst["case"]]
    if counted.reason != "last":
        text = f"{_since_text(counted)} {text}"
    return [Sentence(text, loss.intervals)]


def _since_text(counted: CountedScans) -> str:
    """From which scan on the errors of a gain count: those of filters that have settled, whose gain may not have."""
    return tr("from {t_s:g} s on", t_s=counted.t_s) if counted.reason == "settled" else wording.since(*counted)


def _than_baseline(results: Sequence[Result], other_results: Sequence[Result]) -> str:
    """The clause on what the gains are relative to, and of which realisations where plots may be missed."""
    baseline = tr("than {base}", base=_with_baseline(results, other_results))
    if any(result.spec.radar.detection_probability < 1 for result in results):
        return tr("{base}, where both have an estimate", base=baseline)
    return baseline


def _is_range_alone(results: Sequence[Result]) -> bool:
    """Whether the baseline filter, and no other, observes the range alone."""
    baselines = [result.spec.filters[result.axes.baseline] for result in results]
    range_filters = [f.name for result in results for f in result.spec.filters if f.observes == ("range",)]
    return all(f.observes == ("range",) for f in baselines) and len(range_filters) == len(baselines)


def _with_baseline(results: Sequence[Result], other_results: Sequence[Result]) -> str:
    """The baseline after `than`: `with range alone` if only the baseline filter observes no more.

    With D_M where it is the same in all results, but not in all of other_results, which hold them."""
    baselines = [result.spec.filters[result.axes.baseline] for result in results]
    if _is_range_alone(results):
        if len(_configured_variances(baselines)) > 1:
            return tr("with range alone at the same D_M")
        variances, all_variances = (
            _configured_variances(f for result in group for f in result.spec.filters)
            for group in (results, other_results)
        )
        if len(variances) == 1 < len(all_variances):
            (variance,) = variances
            return tr("with range alone, at D_M = {variance}", variance=key_labels.format_value(variance, powers=True))
        return tr("with range alone")
    if len({f.name for f in baselines}) == 1:
        return tr("with filter {filter}", filter=quote_name(baselines[0].name))
    return tr("with the baseline filter")


def _configured_variances(filters: Iterable[FilterKeys]) -> set[float]:
    """The D_M that a config gives filters as numbers."""
    variances = map(configured_variance, filters)
    return {variance for variance in variances if isinstance(variance, float) and not np.isnan(variance)}


def _case_label(row: "pd.Series[Any]", labels: Mapping[str, str], has_several_filters: bool) -> str:
    return labels[row["case"]] + (f", {quote_name(row['filter'])}" if has_several_filters else "")


def _capitalised(quantity: str) -> str:
    """The name of a quantity as a sentence begins with it."""
    name = tr(quantity)
    return name[:1].upper() + name[1:]


def _sigma_sentence(result: Result, curves: "pd.DataFrame") -> Sentence:
    """σ of the range at the end, for experiments without a second filter."""
    row = tables.select_rows(curves, case=result.name, component="r").iloc[-1]
    sigma = compared_value.row_value(row)
    text = tr(
        "{case}, {filter}: the RMS range error at {t_s:g} s is {sigma}.",
        case=key_labels.plain_case_label(result),
        filter=quote_name(row["filter"]),
        t_s=row["t_s"],
        sigma=sigma.text(tr("m")),
    )
    return Sentence(text, sigma.intervals)
