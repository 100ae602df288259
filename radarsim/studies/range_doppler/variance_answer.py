"""The answer's sentences on the manoeuvre variance D_M: the best of those tried, and those that were optimised."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from radarsim.config.experiment import Case
from radarsim.language.translate import join_names, plural, term, tr
from radarsim.report import case_selection, compared_value, key_labels, tables, wording
from radarsim.report.compared_value import ComparedValue
from radarsim.report.quantities import SIGMA
from radarsim.report.sentences import Sentence
from radarsim.report.statistics import Estimate, simultaneous_sizes
from radarsim.studies.counted_scans import CountedScans
from radarsim.studies.range_doppler import best_gain_answer, best_variance, settling
from radarsim.studies.range_doppler.best_gain_answer import FilterChoices
from radarsim.studies.range_doppler.config import Best, Filter
from radarsim.studies.range_doppler.designed_case import design_case
from radarsim.studies.range_doppler.gain_answer import TablesByName
from radarsim.studies.range_doppler.tables import PERIODS, Result, follows_the_model

if TYPE_CHECKING:
    import pandas as pd

MAX_COMPUTED_SCANS = 1000  # of a run: 0.3 s for each D_M
MIN_RANGE = 3  # values next to each other that are named as a range
CRITERION_TEXTS = {
    "worst": term("{error} is least at its worst from {t_s:g} s on"),
    "mean": term("{error} is least on average from {t_s:g} s on"),
    "last": term("{error} is least at the last scan"),
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
    lines: list[str] = []
    gains: list[Sentence] = []
    for members in case_selection.group_by_config(results).values():
        rows = table[table["case"].isin([result.name for result in members]) & (table["component"] == "r")]
        if rows.groupby("filter")["manoeuvre_variance"].nunique().max() > 1:
            rows_with_variance = rows[rows["manoeuvre_variance"].notna()]  # a filter of a package may have none
            best = [_best_variance(rows, str(name)) for name, rows in rows_with_variance.groupby("filter", sort=False)]
            name = key_labels.without_markup(key_labels.config_device(members[0]))
            lines.append(f"{name}: {'; '.join(best)}.")
            gains += _gains_over(members[0], name, "sigma_r", "steady", _steady_choices(rows_with_variance))
    rule = plural(
        "Best manoeuvre variance D_M, (m/s³)² (least steady σ of the range among those that settle in under {count} "
        "scan period).",
        "Best manoeuvre variance D_M, (m/s³)² (least steady σ of the range among those that settle in under {count} "
        "scan periods).",
        PERIODS,
    )
    return [*_with_rule(rule, lines), *gains]


def _steady_choices(rows: "pd.DataFrame") -> list[FilterChoices]:
    """The filters of rows of `steady` with their steady σ by D_M; best the one of those that settle."""
    choices = []
    for name, of_filter in rows.groupby("filter", sort=False):
        sigmas = dict(zip(of_filter["manoeuvre_variance"], of_filter["steady_sigma"], strict=True))
        best = [float(variance) for variance in of_filter.loc[of_filter["best"], "manoeuvre_variance"].unique()]
        choices.append(FilterChoices(str(name), {float(v): Estimate(s, s, s) for v, s in sigmas.items()}, best))
    return choices


def _gains_over(
    result: Result, subject: str, error: str, measure: str, choices: Sequence[FilterChoices]
) -> list[Sentence]:
    """The gains over a case's baseline, where that is among the filters with several D_M."""
    baseline_name = result.axes.filters[result.axes.baseline]
    baseline = next((choice for choice in choices if choice.name == baseline_name), None)
    if baseline is None:
        return []
    others = [choice for choice in choices if choice.name != baseline_name]
    return best_gain_answer.gain_sentences(subject, error, measure, baseline, others)


def _with_rule(rule: str, lines: Sequence[str]) -> list[Sentence]:
    """The lines as sentences, the first of them after the rule by which all were chosen."""
    return [Sentence(f"{rule} {line}" if i == 0 else line) for i, line in enumerate(lines)]


def _best_variance(rows: "pd.DataFrame", filter_name: str) -> str:
    best = rows[rows["best"]]
    if not len(best):
        return tr("{filter} none of the values tried", filter=filter_name)
    row = best.iloc[0]
    return tr(
        "{filter} {variance} (σ {sigma:.4g} m, settled after {settling:g} s)",
        filter=filter_name,
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
    lines: list[str] = []
    gains: list[Sentence] = []
    for group, members in cases_over_variance(results).items():
        scans, name = _member_scans(members), key_labels.without_markup(group)
        by_filter = {
            filter_name: _worst_errors(f, members, rows, scans)
            for f, filter_name in enumerate(members[0].axes.filters)
            if not np.isnan(members[0].axes.manoeuvre_variance[f])
        }
        best = [_least_worst_error(filter_name, worst) for filter_name, worst in by_filter.items()]
        lines.append(f"{name}, {wording.since(*scans)}: {'; '.join(best)}.")
        choices = [
            FilterChoices(filter_name, {v: error.bounds for v, error in worst.items()}, _equally_good(worst))
            for filter_name, worst in by_filter.items()
        ]
        gains += _gains_over(members[0], name, "sigma_r", "worst", choices)
    rule = tr("Best manoeuvre variance D_M, (m/s³)² (least worst σ of the range).")
    return [*_with_rule(rule, lines), *gains]


def _member_scans(members: Sequence[Result]) -> CountedScans:
    """The scans that count for cases that differ in D_M: those at which all have settled that settle in the run."""
    counted = [settling.case_scans(member.spec, member.axes.manoeuvre_variance, component=0) for member in members]
    return max([scans for scans in counted if scans.reason != "last"] or counted)


class _WorstError(NamedTuple):
    """The greatest σ of a filter over the scans that count, and its time, s; with the ends of intervals that hold for
    all scans, D_M and filters at once, so that the least of several may be taken."""

    sigma: ComparedValue
    t_s: float
    bounds: Estimate


def _worst_bounds(rows: "pd.DataFrame", looks: int) -> Estimate:
    """The greatest σ of rows of `curves`, with an interval of which so many hold at once."""
    measured = Estimate(*(rows[name].to_numpy(dtype=float) for name in ("sigma", "sigma_lo", "sigma_hi")))
    widened, exact = simultaneous_sizes(measured, looks), rows["exact_sigma"].to_numpy(dtype=float)
    return Estimate(*(float(np.nanmax(np.where(np.isnan(exact), end, exact))) for end in widened))


def _worst_errors(
    f: int, members: Sequence[Result], rows: "Mapping[tuple[str, str], pd.DataFrame]", scans: CountedScans
) -> dict[float, _WorstError]:
    """The worst error of filter f by its D_M; computed where the tables have it measured alone, so that noise does not
    decide."""
    variances = [float(member.axes.manoeuvre_variance[f]) for member in members]
    tables_of_members = [rows[member.name, member.axes.filters[f]] for member in members]
    if any(table.loc[table["k"] >= scans.k, "exact_sigma"].isna().any() for table in tables_of_members):
        sigma = _computed_sigma(members[0], f, np.array(variances))[:, scans.k - 1 :, 0]
        if not np.isnan(sigma).any():
            t_s = members[0].axes.t_s[scans.k - 1 :]
            return {
                variance: _WorstError(ComparedValue(worst, True), float(t_s[values.argmax()]), worst)
                for variance, values in zip(variances, sigma, strict=True)
                for worst in [Estimate(*[float(values.max())] * 3)]
            }
    counted_rows = [table[table["k"] >= scans.k] for table in tables_of_members]
    looks = len(members[0].axes.filters) * sum(map(len, counted_rows))
    worst_rows = [compared_value.extreme(table, SIGMA) for table in counted_rows]
    return {
        variance: _WorstError(value, float(row["t_s"]), _worst_bounds(table, looks))
        for variance, (row, value), table in zip(variances, worst_rows, counted_rows, strict=True)
    }


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


def _least_worst_error(filter_name: str, worst_by_variance: Mapping[float, _WorstError]) -> str:
    """The D_M of a filter with the least worst σ; those together that differ by no more than their noise."""
    ranked, equal = sorted(worst_by_variance), _equally_good(worst_by_variance)
    best = min(ranked, key=lambda variance: worst_by_variance[variance].sigma.value)
    least = worst_by_variance[best].sigma
    if len(equal) == 1:
        return tr(
            "{filter} {variance} (σ at worst {sigma:.4g} m, at {t_s:g} s)",
            filter=filter_name,
            variance=key_labels.format_value(best, powers=True),
            sigma=least.value,
            t_s=worst_by_variance[best].t_s,
        )
    return tr(
        "{filter} {variances} do equally well (σ at worst {low:.4g} to {high:.4g} m)",
        filter=filter_name,
        variances=_value_range(equal, ranked),
        low=least.value,
        high=max(worst_by_variance[variance].sigma.value for variance in equal),
    )


def _equally_good(worst_by_variance: Mapping[float, _WorstError]) -> list[float]:
    """The D_M with the least worst σ, and those that differ from it by no more than their noise."""
    least = min((worst.sigma for worst in worst_by_variance.values()), key=lambda sigma: sigma.value)
    return [
        variance
        for variance in sorted(worst_by_variance)
        if compared_value.is_equal(worst_by_variance[variance].sigma, least)
    ]


def _value_range(values: Sequence[float], ranked: Sequence[float]) -> str:
    """Several of the ranked values, in words: as a range where there are some that are next to each other."""
    names = [key_labels.format_value(value, powers=True) for value in values]
    first = ranked.index(values[0])
    if len(values) >= MIN_RANGE and list(values) == list(ranked[first : first + len(values)]):
        return tr("{low} to {high}", low=names[0], high=names[-1])
    return join_names(names)


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
    return _gains_over(result, case, criterion.minimise, str(criterion.over), choices)


def _optimised_variance(result: Result, filter_name: str, objective: Best, variance: float) -> str:
    axes = result.axes
    fields = {
        "filter": filter_name,
        "variance": key_labels.format_value(variance, powers=True),
        "rule": tr(
            CRITERION_TEXTS[str(objective.over)], error=objective.minimise, t_s=axes.t_s[(objective.from_k or 1) - 1]
        ),
    }
    if best_variance.is_at_limit(variance, len(axes.t_s), axes.sigma, axes.scan_period_s):
        return tr("{filter} {variance} ({rule}, the limit of the search: no minimum inside)", **fields)
    return tr("{filter} {variance} ({rule})", **fields)
