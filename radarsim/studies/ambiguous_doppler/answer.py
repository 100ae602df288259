"""What the report of folded Doppler asks and answers, in sentences."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.language.numerals import numeral
from radarsim.language.translate import join_names, list_filters, plural, quote_name, tr
from radarsim.report import case_selection, compared_value, key_labels, rare_events, sentences, tables, wording
from radarsim.report.compared_value import ComparedValue, is_equal
from radarsim.report.quantities import RADIAL
from radarsim.report.sentences import Sentence
from radarsim.report.statistics import Estimate
from radarsim.studies.ambiguous_doppler import remedy_answer
from radarsim.studies.ambiguous_doppler.tables import BEYOND_SHARE, Result
from radarsim.studies.counted_scans import CountedScans
from radarsim.studies.process_noise_answer import BestNoise

if TYPE_CHECKING:
    import pandas as pd


TablesByName = Mapping[str, "pd.DataFrame"]
AS_GOOD_PERCENT = 5.0  # above the oracle's σ
MAX_CASES, MAX_RARE_CASES = 6, 2  # that the answer reports; of more the first and the last
MAX_LISTED_ERRORS = 3  # of filters in a sentence; of more the least and the greatest
LOST_PERCENT = 100.0  # above the oracle's σ, from which a σ is rather a share of lost tracks


def warnings(experiment: Experiment) -> list[str]:
    """Spans of velocity in which next to nothing can be unfolded: a line for each config and span."""
    lines: dict[str, None] = {}
    for case in experiment.cases:
        radar = case.spec.radar
        for span in radar.spans_mps:
            if span < 2 * radar.sigma_velocity_mps and any(f.folds for f in case.spec.filters):
                text = tr(
                    "its unambiguous interval of {span:g} m/s is under 2 σ_V, {sigma:g} m/s: next to nothing can be "
                    "unfolded",
                    span=span,
                    sigma=2 * radar.sigma_velocity_mps,
                )
                lines[f"{case.stem}: radar.repetition_rate_hz: {text}"] = None
    return list(lines)


def question(experiment: Experiment) -> str:
    """What the experiment asks, in one sentence."""
    names = key_labels.list_radars(list(dict.fromkeys(case.spec.device or case.stem for case in experiment.cases)))
    if any(f.folds for case in experiment.cases for f in case.spec.filters):
        if any(case.spec.rare is not None for case in experiment.cases):
            return tr("How often is an ambiguity of the velocity wrong for {radars}?", radars=names)
        return tr("From which scan on is ambiguous Doppler as good as unfolded velocity for {radars}?", radars=names)
    return tr(
        "Which model order suits the target of {radars}, and how should several orders be combined?", radars=names
    )


def answer(
    results: Sequence[Result], tables_by_name: TablesByName, scans: Mapping[str, CountedScans], noise: BestNoise
) -> list[Sentence]:
    """For each case: from which scan on folded velocity is as good as unfolded, within 5 %; how often it is right.

    Of filters of several orders: the largest error of each over the scans, beside that of the best single order.
    First, of all cases: the best D_M and the gain then; the filter of the least error, or in how many folded velocity
    is as good. scans: those that count, of each case that combines orders."""
    has_rare_events = any(result.spec.rare is not None for result in results)
    reported, remark = case_selection.select_reported(results, MAX_RARE_CASES if has_rare_events else MAX_CASES)
    if noise.cases:
        reported, remark = [result for result in results if result.name in noise.cases], []
    of_all_cases = _orders_over_cases(results, tables_by_name, scans) or _as_good_in_cases(results, tables_by_name)
    of_cases = [sentence for result in reported for sentence in _case_sentences(result, tables_by_name, scans)]
    filters = [(result, name) for result in reported for name in _reported_filters(result)]
    remedies = remedy_answer.remedy_sentence(filters, tables_by_name)
    if not (answered := [*noise.sentences, *of_all_cases, *of_cases, *remedies]):
        return list(map(Sentence, remark))
    mentions_span = any("D = " in sentence.text or "D/2" in sentence.text for sentence in answered)
    return [*answered, _prior_note(results, mentions_span), *map(Sentence, remark)]


def _prior_note(results: Sequence[Result], mentions_span: bool) -> Sentence:
    """What the filters know before the first plot, in any case; and what D is, where the answer mentions it."""
    velocity, acceleration = (
        _span_text([getattr(result.spec.prior, name) for result in results])
        for name in ("sigma_velocity_mps", "sigma_acceleration_mps2")
    )
    text = tr(
        "Note: prior of the filters: σ of the velocity {velocity} m/s, of the acceleration {acceleration} m/s²",
        velocity=velocity,
        acceleration=acceleration,
    )
    return Sentence(f"{text}; {tr('D is the unambiguous interval of the velocity')}." if mentions_span else f"{text}.")


def _span_text(values: Sequence[float]) -> str:
    """A value, or the least and the greatest of several."""
    low, high = (numeral(f"{end:g}") for end in (min(values), max(values)))
    return low if low == high else tr("{low} to {high}", low=low, high=high)


def _case_sentences(result: Result, tables_by_name: TablesByName, scans: Mapping[str, CountedScans]) -> list[Sentence]:
    case_sentences = []
    spans = wording.list_numbers(numeral(f"{span:g}") for span in result.spec.radar.spans_mps)
    for name in _reported_filters(result):
        subject = f"{key_labels.plain_case_label(result)}, D = {spans} {tr('m/s')}, {quote_name(name)}"
        clauses = _as_good_clause(result, name, tables_by_name)
        if sought := _wrong_folds_sought(result, name, tables_by_name):
            clauses += sought
        elif not (clauses and remedy_answer.is_lost(result, name, tables_by_name)):
            clauses += _right_folds(result, name, tables_by_name)
        if clauses:
            sentence = sentences.join("; ", clauses)
            case_sentences.append(sentence.with_text(f"{subject}: {sentence.text}."))
    if result.name not in scans:
        return case_sentences
    return [*case_sentences, *_orders_sentence(result, tables_by_name, scans[result.name])]


def _reported_filters(result: Result) -> list[str]:
    """The filters that unfold and that the answer is about: the means over kept hypotheses, else all."""
    unfolding = [f for f in result.spec.filters if f.folds and f.combine in (None, "likelihood")]
    means = [f for f in unfolding if f.merge == "never" and f.estimate == "mean" and f.hypotheses > 1]
    return [f.name for f in means or unfolding]


def _largest_errors(result: Result, tables_by_name: TablesByName, scans: CountedScans) -> "pd.DataFrame":
    """The row of each filter's largest σ of range over the scans that count.

    decides: σ, exact where it is known exactly; looks: measured values among which it was chosen"""
    curves = tables.select_rows(tables_by_name["curves"], case=result.name, component="r")
    curves = curves[(curves["k"] >= scans.k) & (curves["n"] > 0)]
    looks = curves["exact_sigma"].isna().groupby(curves["filter"]).transform("sum")
    curves = curves.assign(decides=tables.exact_first(curves, "sigma", "exact_sigma"), looks=looks)
    return curves.loc[curves.groupby("filter", sort=False)["decides"].idxmax()]


def _largest_sigma(row: "pd.Series[Any]") -> ComparedValue:
    """σ of a row of `_largest_errors`; of measured ones with an interval for all scans."""
    return compared_value.row_value(row).chosen_among(int(row["looks"]))


def _sigma_m(row: "pd.Series[Any]") -> str:
    return _largest_sigma(row).text(tr("m"))


def _scans_remark(rows: "Iterable[pd.Series[Any]]") -> str:
    """That intervals hold for all scans at once, where a largest value was measured."""
    return " " + tr("(95 % for all scans together)") if any(_largest_sigma(row).looks > 1 for row in rows) else ""


def _orders_over_cases(
    results: Sequence[Result], tables_by_name: TablesByName, scans: Mapping[str, CountedScans]
) -> list[Sentence]:
    """The filters of the least error in all cases, with the weak point of the first of them; and the best single order
    of each case."""
    combining = [result for result in results if result.axes.combines.any()]
    worst = {result.name: _largest_errors(result, tables_by_name, scans[result.name]) for result in combining}
    if not (best := _least_error_of_all(combining, worst, scans)):
        return []
    (name, sentence), singles = best, {f.name for result in combining for f in result.spec.filters if f.combine is None}
    labels = dict(zip(worst, case_selection.distinct_case_names(combining), strict=True))
    case_orders: list[str] = []
    intervals: list[sentences.MeasuredInterval] = []
    for result in combining:
        rows = worst[result.name][worst[result.name]["filter"].isin(singles)]
        if len(rows):
            row = rows.iloc[int(rows["decides"].to_numpy().argmin())]
            case_orders.append(f"{quote_name(row['filter'])}, {_sigma_m(row)} ({labels[result.name]})")
            intervals += _largest_sigma(row).intervals
    text = tr("Best single model order of each case, by the same error: {orders}.", orders="; ".join(case_orders))
    return [sentence, Sentence(text, tuple(intervals)), *_weak_point(name, singles, labels, tables_by_name, scans)]


def _weak_point(
    name: str,
    singles: Collection[str],
    labels: Mapping[str, str],
    tables_by_name: TablesByName,
    scans: Mapping[str, CountedScans],
) -> list[Sentence]:
    """Where σ of any component exceeds that of the best single order the most, over the scans that count; none where
    it nowhere does noticeably, or the filter is of a single order. labels: of the cases, by name."""
    curves = tables_by_name["curves"]
    first_scan = curves["case"].map({case: scans[case].k for case in labels})
    curves = curves[(curves["k"] >= first_scan) & (curves["n"] > 0)]
    curves = curves.assign(decides=tables.exact_first(curves, "sigma", "exact_sigma"))
    keys, values = ["case", "component", "k"], ["row", "decides", "exact_sigma"]
    curves["row"] = curves.index
    orders = curves[curves["filter"].isin(singles)]
    least = orders.loc[orders.groupby(keys)["decides"].idxmin()]
    pairs = curves[curves["filter"] == name].merge(least[keys + values], on=keys, suffixes=("", "_order"))
    if name in singles or not len(pairs):
        return []
    pair = pairs.iloc[int((pairs["decides"] / pairs["decides_order"]).to_numpy().argmax())]
    worst, order = (curves.loc[[pair[row]]].iloc[0] for row in ("row", "row_order"))
    looks = int((pairs["exact_sigma"].isna() | pairs["exact_sigma_order"].isna()).sum())
    ratio = compared_value.value_ratio(*map(compared_value.row_value, (worst, order))).chosen_among(looks)
    if not ratio.estimate.lo > 1 + compared_value.EQUAL:
        return []
    text = tr(
        "Weak point of {filter}: the RMS error of the {quantity} is up to {ratio} times that with {order} "
        "({case}, scan {k}{chosen}).",
        filter=quote_name(name),
        quantity=next(component.words for component in RADIAL if component.name == worst["component"]),
        ratio=ratio.text(form=".3g"),
        order=quote_name(order["filter"]),
        chosen=f"; {compared_value.comparisons_together(looks)}" if ratio.looks > 1 else "",
        case=labels[worst["case"]],
        k=worst["k"],
    )
    return [Sentence(text, ratio.intervals)]


def _least_error_of_all(
    combining: Sequence[Result], worst: Mapping[str, "pd.DataFrame"], scans: Mapping[str, CountedScans]
) -> tuple[str, Sentence] | None:
    """The filters whose largest σ of range in any case is least, and the best of the other kind: one order, or several.

    None where no filter combines orders, or none had a plot."""
    combinations = {f.name for result in combining for f in result.spec.filters if f.combine is not None}
    worst_rows: dict[str, tuple[pd.Series[Any], Result]] = {}
    for result in combining:
        for _, row in worst[result.name].iterrows():
            name = row["filter"]
            if name not in worst_rows or row["decides"] > worst_rows[name][0]["decides"]:
                worst_rows[name] = row, result
    ranked = sorted(worst_rows, key=lambda name: worst_rows[name][0]["decides"])
    other_kind = [name for name in ranked if (name in combinations) != (ranked[0] in combinations)]
    if not other_kind:
        return None
    best_row, _ = worst_rows[ranked[0]]
    other_row, other_case = worst_rows[other_kind[0]]
    if not compared_value.are_distinguished(_largest_sigma(best_row), _largest_sigma(other_row)):
        return None
    best_value = _largest_sigma(best_row)
    same_kind = [name for name in ranked if name not in other_kind]
    equal = [name for name in same_kind if is_equal(_largest_sigma(worst_rows[name][0]), best_value)]
    since_texts = {wording.since(*scans[result.name]) for result in combining}
    text = plural(
        "The largest RMS range error {since}{scans} is smallest with {best}: {least}; with {kind}, {other}, it is "
        "{most} ({where}).",
        "The largest RMS range error {since} in {count} cases{scans} is smallest with {best}: {least}; with {kind}, "
        "{other}, it is {most} ({where}).",
        len(combining),
        since=since_texts.pop() if len(since_texts) == 1 else tr("after the start of the track"),
        best=join_names([*map(quote_name, equal)]),
        least=_sigma_m(best_row),
        kind=tr("the best combination") if other_kind[0] in combinations else tr("the best single model order"),
        other=quote_name(other_kind[0]),
        most=_sigma_m(other_row),
        where=key_labels.plain_case_label(other_case),
        scans=_scans_remark((best_row, other_row)),
    )
    intervals = (*_largest_sigma(best_row).intervals, *_largest_sigma(other_row).intervals)
    return ranked[0], Sentence(text, intervals)


def _orders_sentence(result: Result, tables_by_name: TablesByName, counted: CountedScans) -> list[Sentence]:
    """The largest σ of range of every filter over the scans that count, and what remains to be gained.

    None where no realisation had a plot."""
    worst = _largest_errors(result, tables_by_name, counted)
    if not len(worst):
        return []
    ranked = [row for _, row in worst.sort_values("decides", kind="stable").iterrows()]
    clauses, axes = [], result.axes
    if len(ranked) > MAX_LISTED_ERRORS:
        clauses = [tr("least with {error}", error=_error_text(ranked[0], ranked[1:]))]
        clauses.append(tr("greatest with {error}", error=_error_text(ranked[-1])))
    else:
        clauses = [_error_text(row) for _, row in worst.iterrows()]
    best_order, best_combination = (
        float(np.min(np.max(sigma[axes.combines, counted.k - 1 :, 0], axis=1)))
        for sigma in (axes.best_order, axes.best_combination)
    )
    if np.isfinite(best_order) and np.isfinite(best_combination):
        clauses.append(
            tr(
                "lower limit, if the trajectory were known: {best:.4g} m with the best order of each scan, "
                "{whole:.4g} m with the best combination",
                best=best_order,
                whole=best_combination,
            )
        )
    elif np.isfinite(best_order):
        clauses.append(
            tr(
                "lower limit, if the trajectory were known: {best:.4g} m with the best order of each scan",
                best=best_order,
            )
        )
    subject = tr("largest RMS range error {since}", since=wording.since(*counted))
    text = f"{key_labels.plain_case_label(result)}, {subject}: {'; '.join(clauses)}."
    intervals = [interval for _, row in worst.iterrows() for interval in _largest_sigma(row).intervals]
    return [Sentence(text, tuple(intervals))]


def _error_text(row: "pd.Series[Any]", others: "Sequence[pd.Series[Any]]" = ()) -> str:
    """A filter's largest error with its scan, and the others that cannot be distinguished from it."""
    text = tr("{filter}, {sigma} at scan {k}", filter=quote_name(row["filter"]), sigma=_sigma_m(row), k=row["k"])
    text += _scans_remark([row])
    close = [
        o["filter"] for o in others if not compared_value.are_distinguished(_largest_sigma(o), _largest_sigma(row))
    ]
    return text + " " + tr("(not distinguished from {others})", others=list_filters(close, 2)) if close else text


class _CaseComparison(NamedTuple):
    """How a filter compares with its oracle in a case: ordered from the best to the worst."""

    since_scan: float  # from which on it is as good; infinite where it is not at the last scan
    above_percent: float  # at the last scan
    text: str
    clause: Sentence
    deciding: tuple[sentences.MeasuredInterval, ...]
    is_undecided: bool  # whether its interval at the last scan holds the limit


def _case_comparisons(results: Sequence[Result], tables_by_name: TablesByName) -> dict[str, list[_CaseComparison]]:
    """How each reported filter compares with its oracle in each of several cases, by filter."""
    comparisons: dict[str, list[_CaseComparison]] = {}
    for result in results if len(results) > 1 else ():
        for name in _reported_filters(result):
            for clause in _as_good_clause(result, name, tables_by_name, looks=len(results)):
                gains = _gains_over_oracle(result, name, tables_by_name)
                since = _first_good_scan(gains) or np.inf
                text = f"{key_labels.plain_case_label(result)}: {clause.text}"
                deciding = _near_the_limit(gains.tail(1))
                above, low = gains[["excess_over_oracle_percent", "excess_over_oracle_percent_lo"]].iloc[-1]
                is_undecided = bool(np.isinf(since) and not low > AS_GOOD_PERCENT and above <= LOST_PERCENT)
                case = _CaseComparison(since, above, text, clause, deciding, is_undecided)
                comparisons.setdefault(name, []).append(case)
    return comparisons


def _as_good_in_cases(results: Sequence[Result], tables_by_name: TablesByName) -> list[Sentence]:
    """Of several cases: in how many the filter that unfolds best is as good as unfolded velocity; and the worst."""
    comparisons = _case_comparisons(results, tables_by_name)
    if not comparisons:
        return []
    good = {name: sum(np.isfinite(case.since_scan) for case in cases) for name, cases in comparisons.items()}
    worst = {name: max(cases, key=lambda case: case[:3]) for name, cases in comparisons.items()}
    best_name = min(comparisons, key=lambda name: (-good[name], worst[name][:3]))
    undecided = sum(case.is_undecided for case in comparisons[best_name])
    ties = sum(case.clause.text == worst[best_name].clause.text for case in comparisons[best_name]) - 1
    also = ", " + plural("as in {count} other case", "as in {count} other cases", ties) if ties else ""
    text = tr(
        "{filter}: the RMS velocity error is within {percent:g} % of that with unfolded velocity in {good} of {count} "
        "cases at the last scan{undecided}; worst case, {worst}{also}.",
        undecided=", " + tr("undecided in {count}", count=undecided) if undecided else "",
        filter=quote_name(best_name),
        percent=AS_GOOD_PERCENT,
        good=good[best_name],
        count=len(comparisons[best_name]),
        worst=worst[best_name].text,
        also=also,
    )
    by_limit = (interval for case in comparisons[best_name] for interval in case.deciding)
    return [Sentence(text, (*worst[best_name].clause.intervals, *by_limit))]


def _gains_over_oracle(result: Result, name: str, tables_by_name: TablesByName) -> "pd.DataFrame":
    """The rows (scans) of `gains` in the velocity, of a filter that is compared with its oracle."""
    rows = tables.select_rows(tables_by_name["gains"], case=result.name, filter=name, component="Vr")
    return rows.dropna(subset=["excess_over_oracle_percent"])


def _first_good_scan(gains: "pd.DataFrame") -> int:
    """The scan from which on a filter is as good as its oracle, for good; 0 where it is not at the last one."""
    is_worse = gains["excess_over_oracle_percent_hi"].to_numpy() > AS_GOOD_PERCENT
    if is_worse[-1]:
        return 0
    return int(gains["k"].to_numpy()[int(is_worse.nonzero()[0][-1]) + 1 if is_worse.any() else 0])


def _near_the_limit(gains: "pd.DataFrame") -> tuple[sentences.MeasuredInterval, ...]:
    """The intervals by which a filter is as good as its oracle, and would not be if they were twice as wide."""
    low, high = (gains[name].to_numpy() for name in ("excess_over_oracle_percent_lo", "excess_over_oracle_percent_hi"))
    return sentences.intervals(
        "gains", "excess_over_oracle_percent", gains[sentences.would_exceed(AS_GOOD_PERCENT, low, high)]
    )


def _as_good_clause(result: Result, name: str, tables_by_name: TablesByName, looks: int = 1) -> list[Sentence]:
    """From which scan on σ of the velocity is within 5 % of the oracle's, for good; none without an oracle.

    looks: at how many cases, of which this is the worst."""
    gains = _gains_over_oracle(result, name, tables_by_name)
    if not len(gains):
        return []
    if since := _first_good_scan(gains):
        text = tr(
            "the RMS velocity error is within {percent:g} % of that with unfolded velocity from scan {k} on",
            percent=AS_GOOD_PERCENT,
            k=since,
        )
        return [Sentence(text, _near_the_limit(gains[gains["k"] >= since]))]
    final = gains.iloc[-1]
    if final["excess_over_oracle_percent"] > LOST_PERCENT:
        return [
            _lost_clause(
                tables.select_rows(tables_by_name["folds"], case=result.name, filter=name).iloc[-1], final["k"], looks
            )
        ]
    return [_excess_clause(final, looks)]


def _excess_clause(final: "pd.Series[Any]", looks: int) -> Sentence:
    """By how much σ of the velocity is above the oracle's at the last scan; with signs where that may be within 5 %."""
    ratio = Estimate(
        *(
            100.0 + final[key]
            for key in ("excess_over_oracle_percent", "excess_over_oracle_percent_lo", "excess_over_oracle_percent_hi")
        )
    )
    above = ComparedValue(ratio, is_exact=False).chosen_among(looks).mapped(lambda percent: percent - 100.0)
    fields = {"k": final["k"], "chosen": above.choice_remark(compared_value.cases_together)}
    if above.estimate.lo > AS_GOOD_PERCENT:
        text = tr(
            "the RMS velocity error is still {above} above that of unfolded velocity at scan {k}, the last{chosen}",
            above=above.text("%", ".3g"),
            **fields,
        )
    else:
        text = tr(
            "the RMS velocity error differs by {above} from that of unfolded velocity at scan {k}, the last{chosen}: "
            "undecided whether within {percent:g} %",
            above=above.text("%", "+.3g"),
            percent=AS_GOOD_PERCENT,
            **fields,
        )
    return Sentence(text, sentences.intervals("gains", "excess_over_oracle_percent", final))


def _lost_clause(folds: "pd.Series[Any]", k: int, looks: int) -> Sentence:
    """The share of realisations whose velocity is off by more than half the span at the last scan, k."""
    beyond = Estimate(*(float(folds[key]) for key in (BEYOND_SHARE, f"{BEYOND_SHARE}_lo", f"{BEYOND_SHARE}_hi")))
    share = ComparedValue(beyond, is_exact=False, kind="share").chosen_among(looks)
    fields = {"k": k, "share": wording.share(*(100 * end for end in share.estimate))}
    if folds[BEYOND_SHARE] > remedy_answer.LOST_SHARE:
        text = tr(
            "the track is lost, at scan {k} the velocity is off by more than D/2 in {share} of realisations", **fields
        )
    else:
        text = tr("at scan {k} the velocity is off by more than D/2 in {share} of realisations", **fields)
    text += share.choice_remark(compared_value.cases_together)
    return Sentence(text, sentences.intervals("folds", BEYOND_SHARE, folds))


def _right_folds(result: Result, name: str, tables_by_name: TablesByName) -> list[Sentence]:
    """How often all folds are right at the last scan; none where no realisation had a plot."""
    rows = tables.select_rows(tables_by_name["folds"], case=result.name, filter=name)
    if not len(rows):
        return []
    final = rows.iloc[-1]
    share = wording.share(*(100 * final[key] for key in ("right", "right_lo", "right_hi")))
    text = tr("all folds are right in {share} of realisations at scan {k}", share=share, k=final["k"])
    return [Sentence(text, sentences.intervals("folds", "right", final))]


def _wrong_folds_sought(result: Result, name: str, tables_by_name: TablesByName) -> list[Sentence]:
    """How often a fold is wrong at the last scan, by importance sampling; none where it was not drawn so."""
    rows = tables.group_by(tables_by_name["rare"], "case", "filter") if result.spec.rare is not None else {}
    if (result.name, name) not in rows:
        return []
    row = rows[result.name, name].iloc[0]
    if not rare_events.is_estimated(row):
        text = tr(
            "probability of a wrong ambiguity: no estimate (effective sample size {n_eff:,.0f})", n_eff=row["n_eff"]
        )
        return [Sentence(text, sentences.intervals("rare", "event_rate", row))]
    text = tr(
        "an ambiguity is wrong at scan {k} in {rate} of realisations (importance sampling; "
        "{events:,} events, effective sample size {n_eff:,.0f})",
        k=row["k"],
        **rare_events.rate_fields(row),
    )
    return [Sentence(text, sentences.intervals("rare", "event_rate", row))]
