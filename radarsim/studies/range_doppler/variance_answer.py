"""The answer's sentences on the manoeuvre variance D_M: the best of those tried, and those that were optimised."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from radarsim.config.experiment import Case
from radarsim.language.translate import plural, quote_name, term, tr
from radarsim.report import case_selection, key_labels, tables
from radarsim.report.compared_value import ComparedValue
from radarsim.report.quantities import RADIAL
from radarsim.report.sentences import Sentence
from radarsim.report.statistics import Estimate
from radarsim.studies import best_gain_answer
from radarsim.studies.best_gain_answer import FilterChoices, NoiseKey
from radarsim.studies.counted_scans import CountedScans
from radarsim.studies.process_noise_answer import (
    WorstError,
    best_values_sentence,
    filter_choices,
    measured_worst_errors,
)
from radarsim.studies.range_doppler import best_variance, settling
from radarsim.studies.range_doppler.config import Best, Filter
from radarsim.studies.range_doppler.designed_case import design_case
from radarsim.studies.range_doppler.gain_answer import TablesByName
from radarsim.studies.range_doppler.tables import PERIODS, Result, follows_the_model

if TYPE_CHECKING:
    import pandas as pd

MAX_COMPUTED_SCANS = 1000  # of a run: 0.3 s for each D_M
D_M = NoiseKey("D_M", partial(key_labels.format_value, powers=True))
CRITERION_TEXTS = {
    "worst": term("{error} is least at its worst from {t_s:g} s on"),
    "mean": term("{error} is least on average from {t_s:g} s on"),
    "last": term("{error} is least at the last scan"),
    "at": term("{error} is least at {t_s:g} s"),
}


def sweeps_variance_only(results: Sequence[Result]) -> bool:
    """Whether every case is one of a sweep over the manoeuvre variance."""
    return all("manoeuvre_variance" in dict(result.swept_values) for result in results)


def best_variances(results: Sequence[Result], tables_by_name: TablesByName) -> list[Sentence]:
    """The best of several D_M: by the steady σ where it is known, else by the worst σ."""
    return [*_best_settled_variances(results, tables_by_name), *_best_variances_by_worst(results, tables_by_name)]


def _best_settled_variances(results: Sequence[Result], tables_by_name: TablesByName) -> list[Sentence]:
    """The best manoeuvre variance of each radar and filter where several were tried, by exact values."""
    table = tables_by_name["steady"]
    sentences: list[Sentence] = []
    gains: list[Sentence] = []
    for members in case_selection.group_by_config(results).values():
        rows = table[table["case"].isin([result.name for result in members]) & (table["component"] == "r")]
        if rows.groupby("filter")["manoeuvre_variance"].nunique().max() > 1:
            rows_with_variance = rows[rows["manoeuvre_variance"].notna()]  # a filter of a package may have none
            best = [_best_variance(rows, str(name)) for name, rows in rows_with_variance.groupby("filter", sort=False)]
            name = key_labels.without_markup(key_labels.config_device(members[0]))
            text = plural(
                "{name}, best D_M (least steady RMS range error among those that settle in under {count} scan "
                "period): {filters}.",
                "{name}, best D_M (least steady RMS range error among those that settle in under {count} scan "
                "periods): {filters}.",
                PERIODS,
                name=name,
                filters="; ".join(best),
            )
            sentences.append(Sentence(text))
            gains += _gains_over(members[0], name, 0, "steady", _steady_choices(rows_with_variance))
    return [*sentences, *gains]


def _steady_choices(rows: "pd.DataFrame") -> list[FilterChoices]:
    """The filters of rows of `steady` with their steady σ by D_M; best the one of those that settle."""
    choices = []
    for name, of_filter in rows.groupby("filter", sort=False):
        sigmas = dict(zip(of_filter["manoeuvre_variance"], of_filter["steady_sigma"], strict=True))
        best = [float(variance) for variance in of_filter.loc[of_filter["best"], "manoeuvre_variance"].unique()]
        choices.append(FilterChoices(str(name), {float(v): Estimate(s, s, s) for v, s in sigmas.items()}, best))
    return choices


def _gains_over(
    result: Result, subject: str, component: int, measure: str, choices: Sequence[FilterChoices], t_s: float = 0.0
) -> list[Sentence]:
    """The gains over a case's baseline in σ of a component, if the baseline has several D_M; t_s: of measure `at`."""
    baseline_name = result.axes.filters[result.axes.baseline]
    baseline = next((choice for choice in choices if choice.name == baseline_name), None)
    if baseline is None:
        return []
    others = [choice for choice in choices if choice.name != baseline_name]
    return best_gain_answer.gain_sentences(subject, RADIAL[component].words, measure, D_M, baseline, others, t_s)


def _best_variance(rows: "pd.DataFrame", filter_name: str) -> str:
    best = rows[rows["best"]]
    if not len(best):
        return tr("{filter}: none of those tried settles so soon", filter=quote_name(filter_name))
    row = best.iloc[0]
    return tr(
        "{filter} {variance} ({sigma:.4g} m, settled after {settling:g} s)",
        filter=quote_name(filter_name),
        variance=key_labels.format_value(float(row["manoeuvre_variance"]), powers=True),
        sigma=row["steady_sigma"],
        settling=row["settling_s"],
    )


def cases_over_variance(results: Sequence[Result]) -> dict[str, list[Result]]:
    """Cases without a steady σ, as of targets that break the model, that differ in the D_M given, by what else they
    are."""
    groups: dict[str, list[Result]] = {}
    for result in results:
        if not (follows_the_model(result) and result.axes.plain):
            other_keys = ", ".join(
                f"{key_labels.key_symbol(result, key)} = {key_labels.value_with_unit(result, key, value)}"
                for key, value in result.swept_values
                if not _is_variance(key)
            )
            name = ", ".join(filter(None, (key_labels.config_device(result), other_keys)))
            groups.setdefault(name, []).append(result)
    return {
        name: members for name, members in groups.items() if len(members) > 1 and all(map(_has_swept_variance, members))
    }


def _is_variance(key: str) -> bool:
    """Whether the path of a key ends in `manoeuvre_variance`."""
    return key.rpartition(".")[2] == "manoeuvre_variance"


def _has_swept_variance(result: Result) -> bool:
    return any(_is_variance(key) for key, _ in result.swept_values) and not _optimised_filters(result)


def _best_variances_by_worst(results: Sequence[Result], tables_by_name: TablesByName) -> list[Sentence]:
    """The D_M of those tried with which the worst error is least, by radar and filter."""
    rows = tables.group_by(tables.select_rows(tables_by_name["curves"], component="r"), "case", "filter")
    sentences: list[Sentence] = []
    gains: list[Sentence] = []
    for group, members in cases_over_variance(results).items():
        scans, name = _member_scans(members), key_labels.without_markup(group)
        by_filter = {
            filter_name: _worst_errors(f, members, rows, scans)
            for f, filter_name in enumerate(members[0].axes.filters)
            if not np.isnan(members[0].axes.manoeuvre_variance[f])
        }
        sentences.append(best_values_sentence(name, RADIAL[0].words, tr("m"), scans, D_M, by_filter))
        choices = [filter_choices(filter_name, worst) for filter_name, worst in by_filter.items()]
        gains += _gains_over(members[0], name, 0, "worst", choices)
    return [*sentences, *gains]


def _member_scans(members: Sequence[Result]) -> CountedScans:
    """The scans that count for cases that differ in D_M: those at which all have settled that settle in the run."""
    counted = [settling.case_scans(member.spec, member.axes.manoeuvre_variance, component=0) for member in members]
    return max([scans for scans in counted if scans.reason != "last"] or counted)


def _worst_errors(
    f: int, members: Sequence[Result], rows: "Mapping[tuple[str, str], pd.DataFrame]", scans: CountedScans
) -> dict[float, WorstError]:
    """The worst error of filter f by its D_M; computed where the tables have it measured alone, so that noise does not
    decide."""
    variances = [float(member.axes.manoeuvre_variance[f]) for member in members]
    tables_of_members = [rows[member.name, member.axes.filters[f]] for member in members]
    if any(table.loc[table["k"] >= scans.k, "exact_sigma"].isna().any() for table in tables_of_members):
        sigma = _computed_sigma(members[0], f, np.array(variances))[:, scans.k - 1 :, 0]
        if not np.isnan(sigma).any():
            t_s = members[0].axes.t_s[scans.k - 1 :]
            return {
                variance: WorstError(ComparedValue(worst, True), float(t_s[values.argmax()]), worst)
                for variance, values in zip(variances, sigma, strict=True)
                for worst in [Estimate(*[float(values.max())] * 3)]
            }
    return measured_worst_errors(variances, tables_of_members, scans, len(members[0].axes.filters))


def _computed_sigma(result: Result, f: int, variances: np.ndarray) -> np.ndarray:
    """σ (B, K, 3) of filter f with each D_M (B,), averaged over patterns of missed plots, to about 1e-3; not-a-number
    where a run is too long for that."""
    filter_, spec = result.spec.filters[f], result.spec
    if spec.plots > MAX_COMPUTED_SCANS or not isinstance(filter_, Filter):
        return np.full((len(variances), spec.plots, 3), np.nan)
    with_variances = tuple(  # those found, so that no search is made again
        each.model_copy(update={"manoeuvre_variance": float(found)}) if isinstance(each, Filter) else each
        for each, found in zip(spec.filters, result.axes.manoeuvre_variance, strict=True)
    )
    spec = spec.model_copy(update={"filters": with_variances})
    designed = design_case(Case(result.name, key_labels.config_stem(result), result.study, spec, (), 1, 1))
    filter_inputs = best_variance.FilterInputs(designed.plots, designed.x, designed.dt, designed.random_truth)
    return best_variance.errors(filter_, variances, filter_inputs)


def _optimised_filters(result: Result) -> list[tuple[str, Best, float]]:
    """The filters whose D_M was optimised: name, what was minimised, and the D_M."""
    axes = result.axes
    filters = zip(axes.filters, axes.criteria, axes.manoeuvre_variance, strict=True)
    return [(name, criterion, float(variance)) for name, criterion, variance in filters if criterion]


def optimised_variances(results: Sequence[Result]) -> list[Sentence]:
    """The D_M that were optimised on the exact errors, each with the gain between the filters so optimised."""
    sentences = []
    for result in results:
        if optimised := _optimised_filters(result):
            case = key_labels.plain_case_label(result)
            filters = "; ".join(_optimised_variance(result, *f) for f in optimised)
            text = tr("{case}: D_M, (m/s³)², optimised on the exact errors: {filters}.", case=case, filters=filters)
            sentences += [Sentence(text), *_optimised_gains(result, case)]
    return sentences


def _optimised_gains(result: Result, case: str) -> list[Sentence]:
    """The gains between filters whose D_M minimise the same, each at its best; and with the D_M of either for both."""
    axes = result.axes
    criterion = axes.criteria[axes.baseline]
    if criterion is None:
        return []
    alike = [f for f, other in enumerate(axes.criteria) if other == criterion]
    variances = list(dict.fromkeys(float(axes.manoeuvre_variance[f]) for f in alike))
    choices = []
    for f in alike:
        sigma = _computed_sigma(result, f, np.array(variances))
        if np.isnan(sigma[:, (criterion.from_k or 1) - 1 :]).any():
            return []
        values = best_variance.objective(criterion, sigma)
        sigmas = {variance: Estimate(*[float(v)] * 3) for variance, v in zip(variances, values, strict=True)}
        choices.append(FilterChoices(axes.filters[f], sigmas, (float(axes.manoeuvre_variance[f]),)))
    component = best_variance.COMPONENTS[criterion.minimise]
    return _gains_over(result, case, component, str(criterion.over), choices, axes.t_s[(criterion.from_k or 1) - 1])


def _optimised_variance(result: Result, filter_name: str, objective: Best, variance: float) -> str:
    axes = result.axes
    fields = {
        "filter": quote_name(filter_name),
        "variance": key_labels.format_value(variance, powers=True),
        "rule": tr(
            CRITERION_TEXTS[str(objective.over)], error=objective.minimise, t_s=axes.t_s[(objective.from_k or 1) - 1]
        ),
    }
    if best_variance.is_at_limit(variance, len(axes.t_s), axes.sigma, axes.scan_period_s):
        return tr("{filter} {variance} ({rule}, the limit of the search: no minimum inside)", **fields)
    return tr("{filter} {variance} ({rule})", **fields)
