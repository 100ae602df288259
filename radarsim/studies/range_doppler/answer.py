"""What the report of P1's experiments asks and answers, in sentences."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Case, Experiment
from radarsim.language.numerals import numeral
from radarsim.language.translate import join_names, plural, term, tr
from radarsim.report import case_selection, key_labels, sentences, tables, wording
from radarsim.report.quantities import RADIAL
from radarsim.report.sentences import Sentence
from radarsim.studies.range_doppler import best_variance
from radarsim.studies.range_doppler.config import FOLDED_STUDY, Best, can_fold, configured_variance
from radarsim.studies.range_doppler.study import prepare
from radarsim.studies.range_doppler.tables import PERIODS, Result, follows_the_model, span_mps, steady_sigma

if TYPE_CHECKING:
    import pandas as pd


TablesByName = Mapping[str, "pd.DataFrame"]
LONG_RUN_MARGIN = 1.0  # per cent: a gain further than this from that of the long run has not settled
MIN_LOSS = 1.0  # per cent: from this loss on a case's worst gain is in the answer
FIRST_COUNTED_SCAN = 3  # from which on errors count when a D_M is the best on a manoeuvring target
MAX_CASES = 4  # with a broken model, or with a D_M that was looked for, each with a sentence of its own
MIN_EXACT_GAIN = 0.05  # per cent: what is not nil to one decimal
FACTOR_LOSS = 100.0  # per cent of loss from which it is given as a factor
SIGMA = ("sigma", "sigma_lo", "sigma_hi")
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
    gains = _gain_sentences(results, tables_by_name)
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


def _gain_sentences(results: Sequence[Result], tables_by_name: TablesByName) -> list[Sentence]:
    """A sentence on the gains in each component; of an experiment with a single filter one on its σ."""
    unswept_results = case_selection.unswept_cases(results)
    unswept_gains = tables_by_name["gains"]
    unswept_gains = unswept_gains[unswept_gains["case"].isin([result.name for result in unswept_results])]
    gains, all_gains = (tables.group_by(rows, "component") for rows in (unswept_gains, tables_by_name["gains"]))
    labels = {result.name: key_labels.plain_case_label(result) for result in results}
    gain_sentences = [
        _gain_sentence(unswept_results, gains[(component.name,)], all_gains[(component.name,)], component.words, labels)
        for component in RADIAL
        if (component.name,) in gains
    ]
    return gain_sentences or [_sigma_sentence(results[0], tables_by_name["curves"])]


def _gain_sentence(
    results: Sequence[Result],
    gains: "pd.DataFrame",
    all_gains: "pd.DataFrame",
    quantity: str,
    labels: Mapping[str, str],
) -> Sentence:
    """The gain in one quantity at the last scan, or at the last common time.

    gains: of the cases in the sentence; all_gains: of all cases, among which the greatest loss is looked for."""
    compared, time_text = _rows_compared(gains)
    baseline = _than_baseline(results)
    has_several_filters = gains["filter"].nunique() > 1
    if len(compared) > 1:
        lowest, highest = (
            compared.iloc[int(pick(compared["gain_percent"].to_numpy()))] for pick in (np.argmin, np.argmax)
        )
        clauses = [
            _range_of_gains(compared, lowest, highest, time_text, quantity, baseline, labels, has_several_filters)
        ]
        long_run = [
            f"{gain} ({_case_label(row, labels, has_several_filters)})"
            for row in (lowest, highest)
            if (gain := _long_run_gain(results, row))
        ]
        clauses += [*_long_run_clause(join_names(long_run)), *_worst_loss(all_gains, lowest, labels)]
    else:
        final = compared.iloc[0]
        best = gains.iloc[int(_deciding_values(gains).argmax())]
        text = tr(
            "{quantity}: at {t_s:g} s, the last scan, σ is {gain} {base}",
            quantity=_capitalised(quantity),
            t_s=final["t_s"],
            gain=_gain_text(final),
            base=baseline,
        )
        clauses = [Sentence(text, _gain_interval(final)), *_long_run_clause(_long_run_gain(results, final))]
        if best["k"] != final["k"]:
            text = tr("at best {gain}, at {t_s:g} s", gain=_gain_text(best), t_s=best["t_s"])
            clauses.append(Sentence(text, _gain_interval(best)))
        clauses += _worst_loss(all_gains, final, labels)
    sentence = sentences.join("; ", clauses)
    return sentence.with_text(f"{sentence.text}.")


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
    lowest: "pd.Series[Any]",
    highest: "pd.Series[Any]",
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
        "least": _gain_text(lowest),
        "low": _case_label(lowest, labels, has_several_filters),
        "most": _gain_text(highest),
        "high": _case_label(highest, labels, has_several_filters),
    }
    if compared["gain_lo"].max() <= compared["gain_hi"].min():
        text = tr(
            "{quantity}: {when} σ is {least} ({low}) to {most} ({high}), not significantly different from "
            "each other, {base}",
            **fields,
        )
    else:
        text = tr("{quantity}: {when} σ is {least} ({low}) to {most} ({high}) {base}", **fields)
    return Sentence(text, _gain_interval(lowest, highest))


def _long_run_clause(gains: str) -> list[Sentence]:
    """The clause on gains of the long run, which are exact, where there are such."""
    return [Sentence(tr("not settled: {gains} in the long run", gains=gains))] if gains else []


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


def _worst_loss(all_gains: "pd.DataFrame", sentence_row: "pd.Series[Any]", labels: Mapping[str, str]) -> list[Sentence]:
    """The greatest of the significant losses, unless there is none or it is the gain already given."""
    losses = all_gains[_deciding_values(all_gains, "gain_hi") < -MIN_LOSS]
    if not len(losses):
        return []
    worst = losses.iloc[int(_deciding_values(losses).argmin())]
    if worst.name == sentence_row.name:
        return []
    has_several_filters = all_gains["filter"].nunique() > 1
    fields = {"gain": _gain_text(worst), "t_s": worst["t_s"]}
    if has_several_filters or all_gains["case"].nunique() > 1:
        label = _case_label(worst, labels, has_several_filters)
        text = tr("at worst {gain}, at {t_s:g} s, with {who}", who=label, **fields)
    else:
        text = tr("at worst {gain}, at {t_s:g} s", **fields)
    return [Sentence(text, _gain_interval(worst))]


def _deciding_values(gains: "pd.DataFrame", column: str = "gain_percent") -> np.ndarray:
    """The gains (rows,), or a bound of their intervals, by which they are compared: exact ones first."""
    return tables.exact_first(gains, column, "exact_percent")


def _than_baseline(results: Sequence[Result]) -> str:
    """The clause on what the gains are relative to: `range alone` if only the baseline filter observes no more."""
    baselines = [result.spec.filters[result.axes.baseline] for result in results]
    variances = {variance for variance in map(configured_variance, baselines) if isinstance(variance, float)}
    range_filters = [f.name for result in results for f in result.spec.filters if f.observes == ("range",)]
    if all(f.observes == ("range",) for f in baselines) and len(range_filters) == len(baselines):
        if len(variances) > 1:
            return tr("than with range alone at the same D_M")
        return tr("than with range alone")
    if len({f.name for f in baselines}) == 1:
        return tr("than with filter '{filter}'", filter=baselines[0].name)
    return tr("than with the baseline filter")


def _gain_interval(*rows: "pd.Series[Any]") -> tuple[sentences.MeasuredInterval, ...]:
    return sentences.intervals("gains", "gain", *rows)


def _gain_text(row: "pd.Series[Any]") -> str:
    """A gain in words: lower, higher, or not significantly either; where the sample cannot tell, the exact one."""
    value, low, high = (round(float(row[name]), 1) + 0.0 for name in ("gain_percent", "gain_lo", "gain_hi"))
    if value == low == high == 0:
        return tr("less than 0.1 % lower or higher")
    is_significant = not row["gain_lo"] <= 0 <= row["gain_hi"]
    exact = float(row.get("exact_percent", np.nan))
    if not is_significant and abs(exact) >= MIN_EXACT_GAIN:
        message = term("exactly {percent} lower") if exact > 0 else term("exactly {percent} higher")
        return tr(message, percent=f"{numeral(f'{abs(exact):.1f}')} %")
    if not is_significant:
        return tr("not significantly lower or higher (gain {gain})", gain=_percent(value, low, high))
    if value < -FACTOR_LOSS:
        factor = wording.estimate((1 - value / 100, 1 - high / 100, 1 - low / 100), form=".3g")
        return tr("higher by a factor of {factor}", factor=factor)
    if value < 0:
        return tr("{percent} higher", percent=_percent(0.0 - value, 0.0 - high, 0.0 - low))
    return tr("{percent} lower", percent=_percent(value, low, high))


def _percent(value: float, low: float, high: float) -> str:
    return wording.estimate((value, low, high), "%", ".1f")


def _case_label(row: "pd.Series[Any]", labels: Mapping[str, str], has_several_filters: bool) -> str:
    return labels[row["case"]] + (f", {row['filter']}" if has_several_filters else "")


def _capitalised(quantity: str) -> str:
    """The name of a quantity as a sentence begins with it."""
    name = tr(quantity)
    return name[:1].upper() + name[1:]


def _sigma_sentence(result: Result, curves: "pd.DataFrame") -> Sentence:
    """σ of the range at the end, for experiments without a second filter."""
    row = tables.select_rows(curves, case=result.name, component="r").iloc[-1]
    text = tr(
        "{case}, {filter}: σ of the range at {t_s:g} s is {sigma}.",
        case=key_labels.plain_case_label(result),
        filter=row["filter"],
        t_s=row["t_s"],
        sigma=wording.estimate((row[key] for key in SIGMA), tr("m")),
    )
    return Sentence(text, sentences.intervals("curves", "sigma", row))


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
    worst, largest_bias = (
        rows.iloc[int(np.abs(tables.exact_first(rows, name, f"exact_{name}")).argmax())] for name in ("sigma", "bias")
    )
    text = tr(
        "worst σ of the range {sigma} at {t_s:g} s, largest bias {bias:.4g} m at {bias_t_s:g} s",
        sigma=wording.estimate((worst[key] for key in SIGMA), tr("m")),
        t_s=worst["t_s"],
        bias=largest_bias["bias"],
        bias_t_s=largest_bias["t_s"],
    )
    return Sentence(f"{filter_name}: {text}", sentences.intervals("curves", "sigma", worst))


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
