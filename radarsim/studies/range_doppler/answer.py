"""What the report of P1's experiments asks and answers, in sentences."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.language.translate import join_names, plural, term, tr
from radarsim.report import case_selection, compared_value, key_labels, sentences, tables
from radarsim.report.quantities import SIGMA
from radarsim.report.sentences import Sentence
from radarsim.studies.range_doppler import best_variance, gain_answer
from radarsim.studies.range_doppler.config import FOLDED_STUDY, Best, can_fold, configured_variance
from radarsim.studies.range_doppler.tables import PERIODS, Result, follows_the_model, span_mps

if TYPE_CHECKING:
    import pandas as pd


TablesByName = Mapping[str, "pd.DataFrame"]
FIRST_COUNTED_SCAN = 3  # from which on errors count when a D_M is the best on a manoeuvring target
MAX_CASES = 4  # with a broken model, or with a D_M that was looked for, each with a sentence of its own
CRITERION_TEXTS = {
    "worst": term("{error} is least at its worst from scan {k} on"),
    "mean": term("{error} is least on average from scan {k} on"),
    "last": term("{error} is least at the last scan"),
}


def question(experiment: Experiment) -> str:
    """What the experiment asks, in one sentence."""
    filters = list(dict.fromkeys(f.name for case in experiment.cases for f in case.spec.filters))
    names = list(dict.fromkeys(getattr(case.spec.radar, "name", None) or case.stem for case in experiment.cases))
    if any("velocity" in f.observes for case in experiment.cases for f in case.spec.filters):
        return tr("How much does observing the radial velocity lower the errors of {radars}?", radars=join_names(names))
    return tr(
        "How large are the errors of {radars} with {filters}?", radars=join_names(names), filters=join_names(filters)
    )


def answer(results: Sequence[Result], tables_by_name: TablesByName) -> list[Sentence]:
    """Sentences with numbers and 95 % intervals: the gains at the last scan, component by component.

    Of cases that nothing is swept in, where there are such; with the greatest loss of any case at any scan. Further:
    the best D_M where several are tried, first where nothing but D_M is swept, and the worst error where a target
    breaks the model; the D_M that was looked for; and whether the radar's velocities are folded."""
    gains = gain_answer.answer_gains(results, tables_by_name)
    best = [*_best_variances(results, tables_by_name), *_best_variances_of_broken(results, tables_by_name)]
    return [
        *([*best, *gains] if _sweeps_variance_only(results) else [*gains, *best]),
        *_broken_model_sentences(results, tables_by_name),
        *_optimised_variances(results),
        *_ambiguity_sentences(results),
    ]


def _sweeps_variance_only(results: Sequence[Result]) -> bool:
    """Whether every case is one of a sweep over the manoeuvre variance."""
    return all("manoeuvre_variance" in dict(result.swept_values) for result in results)


def _best_variances(results: Sequence[Result], tables_by_name: TablesByName) -> list[Sentence]:
    """The best manoeuvre variance of each radar and filter where several were tried, by exact values."""
    table = tables_by_name["steady"]
    lines: list[str] = []
    for members in case_selection.group_by_config(results).values():
        rows = table[table["case"].isin([result.name for result in members]) & (table["component"] == "r")]
        if rows.groupby("filter")["manoeuvre_variance"].nunique().max() > 1:
            rows_with_variance = rows[rows["manoeuvre_variance"].notna()]  # a filter of a package may have none
            best = [_best_variance(rows, str(name)) for name, rows in rows_with_variance.groupby("filter", sort=False)]
            lines.append(f"{key_labels.without_markup(key_labels.config_device(members[0]))}: {'; '.join(best)}.")
    rule = plural(
        "Best manoeuvre variance D_M, (m/s³)² (least steady σ of the range among those that settle in under {count} "
        "scan period).",
        "Best manoeuvre variance D_M, (m/s³)² (least steady σ of the range among those that settle in under {count} "
        "scan periods).",
        PERIODS,
    )
    return _with_rule(rule, lines)


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


def _cases_over_variance(results: Sequence[Result]) -> dict[str, list[Result]]:
    """Cases of targets that break the model and differ in the D_M given, by what else they are."""
    groups: dict[str, list[Result]] = {}
    for result in results:
        if not follows_the_model(result):
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


def _best_variances_of_broken(results: Sequence[Result], tables_by_name: TablesByName) -> list[Sentence]:
    """The D_M of those tried with which the worst error on a manoeuvring target is least, by radar and filter."""
    curves, lines = tables_by_name["curves"], []
    curves = curves[(curves["component"] == "r") & (curves["k"] >= FIRST_COUNTED_SCAN)]
    curves = curves.assign(error=tables.exact_first(curves, "sigma", "exact_sigma"))
    for name, members in _cases_over_variance(results).items():
        rows = curves[curves["case"].isin([member.name for member in members])]
        filters = zip(members[0].axes.filters, members[0].axes.manoeuvre_variance, strict=True)
        best = [
            _least_worst_error(rows[rows["filter"] == filter_name], members, filter_name)
            for filter_name, D_M in filters
            if not np.isnan(D_M)
        ]
        lines.append(f"{key_labels.without_markup(name)}: {'; '.join(best)}.")
    rule = tr(
        "Best manoeuvre variance D_M, (m/s³)², on a target that breaks the filters' model (least worst σ of the range "
        "from scan {k} on).",
        k=FIRST_COUNTED_SCAN,
    )
    return _with_rule(rule, lines)


def _least_worst_error(rows: "pd.DataFrame", members: Sequence[Result], filter_name: str) -> str:
    worst = rows.loc[rows.groupby("case", sort=False)["error"].idxmax()]
    row = worst.iloc[int(worst["error"].to_numpy().argmin())]
    result = next(member for member in members if member.name == row["case"])
    variance = float(result.axes.manoeuvre_variance[result.axes.filters.index(filter_name)])
    return tr(
        "{filter} {variance} (σ at worst {sigma:.4g} m, at {t_s:g} s)",
        filter=filter_name,
        variance=key_labels.format_value(variance, powers=True),
        sigma=row["error"],
        t_s=row["t_s"],
    )


def _optimised_filters(result: Result) -> list[tuple[str, Best, float]]:
    """The filters whose D_M was optimised: name, what was minimised, and the D_M."""
    filters = zip(result.spec.filters, result.axes.manoeuvre_variance, strict=True)
    return [
        (f.name, objective, float(variance))
        for f, variance in filters
        if isinstance(objective := configured_variance(f), Best)
    ]


def _optimised_variances(results: Sequence[Result]) -> list[Sentence]:
    """The D_M that were optimised on the exact errors."""
    return [
        Sentence(
            tr(
                "{case}: D_M, (m/s³)², optimised on the exact errors: {filters}.",
                case=key_labels.plain_case_label(result),
                filters="; ".join(_optimised_variance(result, *f) for f in _optimised_filters(result)),
            )
        )
        for result in [result for result in results if _optimised_filters(result)][:MAX_CASES]
    ]


def _optimised_variance(result: Result, filter_name: str, objective: Best, variance: float) -> str:
    axes = result.axes
    fields = {
        "filter": filter_name,
        "variance": key_labels.format_value(variance, powers=True),
        "rule": tr(CRITERION_TEXTS[objective.over], error=objective.minimise, k=objective.from_k),
    }
    if best_variance.is_at_limit(variance, len(axes.t_s), axes.sigma, axes.scan_period_s):
        return tr("{filter} {variance} ({rule}, the limit of the search: no minimum inside)", **fields)
    return tr("{filter} {variance} ({rule})", **fields)


def _broken_model_sentences(results: Sequence[Result], tables_by_name: TablesByName) -> list[Sentence]:
    """Where a target breaks the model: the worst σ of the range over the run, and the largest bias, of each filter."""
    compared = {member.name for members in _cases_over_variance(results).values() for member in members}
    broken = [result for result in results if not follows_the_model(result) and result.name not in compared]
    rows = tables.group_by(tables.select_rows(tables_by_name["curves"], component="r"), "case", "filter")
    broken_sentences = []
    for result in broken[:MAX_CASES]:
        clauses = [_worst_errors(rows[result.name, name], name) for name in result.axes.filters]
        text = tr(
            "{case}, a target that breaks the filters' model: {filters}.",
            case=key_labels.plain_case_label(result),
            filters=sentences.join("; ", clauses).text,
        )
        broken_sentences.append(sentences.compose(text, clauses))
    if omitted_count := len(broken) - len(broken_sentences):
        text = plural(
            "{count} further case breaks the model: see curves.csv.",
            "{count} further cases break the model: see curves.csv.",
            omitted_count,
        )
        broken_sentences.append(Sentence(text))
    return broken_sentences


def _worst_errors(rows: "pd.DataFrame", filter_name: str) -> Sentence:
    """The largest σ and the largest bias of a filter over the scans, as a clause."""
    worst, sigma = compared_value.extreme(rows, SIGMA)
    bias = tables.exact_first(rows, "bias", "exact_bias")
    largest_bias = int(np.abs(bias).argmax())
    text = tr(
        "worst σ of the range {sigma} at {t_s:g} s, largest bias {bias:.4g} m at {bias_t_s:g} s",
        sigma=sigma.text(tr("m")) + sigma.choice_remark(),
        t_s=worst["t_s"],
        bias=bias[largest_bias],
        bias_t_s=rows["t_s"].iloc[largest_bias],
    )
    return Sentence(f"{filter_name}: {text}", sigma.intervals)


def _ambiguity_sentences(results: Sequence[Result]) -> list[Sentence]:
    """That velocities are not folded, where a config gives the repetition rate."""
    spans: dict[str, str] = {}
    for result in results:
        if "repetition_rate_hz" in result.spec.radar.model_fields_set and (result.axes.observes == 2).any():
            span, speed = span_mps(result), result.axes.speed_mps
            if 2 * speed < span:
                text = tr("a span of {span:.4g} m/s", span=span)
            else:
                text = tr("a span of {span:.4g} m/s, exceeded by the target's {speed:.4g} m/s", span=span, speed=speed)
            spans.setdefault(key_labels.without_markup(key_labels.config_device(result)), text)
    if not spans:
        return []
    assumption = tr(
        "Velocities are assumed unambiguous; the repetition rate alone distinguishes only λF/2 ({spans}).",
        spans="; ".join(f"{name}: {span}" for name, span in spans.items()),
    )
    if not all(can_fold(result.spec) for result in results):
        return [Sentence(assumption)]
    advice = tr(
        "With folded velocities: the same command with {setting}.", setting=f"--set {FOLDED_STUDY} --out folded"
    )
    return [Sentence(assumption), Sentence(advice)]
