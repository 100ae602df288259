"""Question and answer of an experiment with user filters: how each compares with the config's filters."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language.numerals import numeral
from radarsim.language.translate import join_names, list_filters, quote_name, term, tr
from radarsim.report import compared_value, consistency_tables, gain_sentences, sentences, wording
from radarsim.report import tables as common
from radarsim.report.compared_value import ComparedValue
from radarsim.report.quantities import GAIN
from radarsim.report.sentences import Sentence
from radarsim.report.user_filters.rival_comparison import RivalComparison, compare_with_rivals, worst_comparison
from radarsim.report.user_filters.rows import TablesByName, user_filter_cases
from radarsim.report.user_filters.tables import IMPROPER, REASONS

if TYPE_CHECKING:
    import pandas as pd


MATERIAL_LOSS = 1.0  # per cent: a smaller one in another component is not told in the first sentence
NEGLIGIBLE = 1e-3  # of the largest σ of a filter's component over time: what is below is known, not estimated
NEGLIGIBLE_GAIN = 1e-6  # per cent
MAX_SUGGESTED_REALISATIONS = 10**8
CONSISTENCY = {  # by the verdict of `consistency_tables`
    consistency_tables.CONSISTENT: term("its errors are as large as its covariance says"),
    consistency_tables.OPTIMISTIC: term("its errors are larger than its covariance says"),
    consistency_tables.PESSIMISTIC: term("its errors are smaller than its covariance says"),
}
DEPENDENCES = {  # why a filter has no intervals, after "as"
    "repeated": term("its random numbers repeat in every block"),
    "shared": term("all realisations share its random numbers"),
    "place": term("its estimates depend on the row in the batch"),
    "others": term("its estimates depend on the other realisations in the batch"),
}
UNBIASED = term("the Cramér–Rao bound of unbiased estimators")
ANY = term("the posterior Cramér–Rao bound")


def question(experiment: Experiment) -> str:
    """What an experiment with user filters asks; empty where it has none."""
    filters = list(dict.fromkeys(member.name for case in experiment.cases for member in case.user_filters))
    if len(filters) > 1:
        return tr("Are {names} better than the filters of the config?", names=list_filters(filters))
    return tr("Is {name} better than the filters of the config?", name=quote_name(filters[0])) if filters else ""


class Judgement(NamedTuple):
    """What is said of user filters: for each the verdict, its consistency or a fault, and the next step; then more."""

    main: list[Sentence]
    details: list[Sentence]


def judgement(results: Sequence[CaseResult], tables_by_name: TablesByName) -> Judgement:
    """How every user filter compares with the config's filters, case by case."""
    judgements = [
        _judge_filter(result, name, f"{result.name}: " if len(results) > 1 else "", tables_by_name)
        for result in results
        for case in user_filter_cases(result)
        for name in case.axes.filters
    ]
    return Judgement(*([sentence for part in parts for sentence in part] for parts in zip(*judgements, strict=True)))


def _judge_filter(result: CaseResult, name: str, prefix: str, tables_by_name: TablesByName) -> Judgement:
    """Whether a user filter is better than the config's best, how often it fails, then all gains at that scan.

    A fault of its estimates comes first, in place of their consistency, which is then a detail."""
    faults = [Sentence(f"{fault}.") for member, fault in user_filter_cases(result)[0].axes.faults if member == name]
    gains = common.select_rows(tables_by_name["gains"], case=result.name, filter=name)
    failing = _failing_clause(common.select_rows(tables_by_name["failures"], case=result.name, filter=name), name)
    if not len(gains):
        no_estimate = tr("{name} has no estimate that could be compared", name=quote_name(name))
        verdicts = [clause.with_text(f"{prefix}{clause.text}.") for clause in failing or [Sentence(no_estimate)]]
        return Judgement([*faults, *verdicts], [])

    comparison = worst_comparison(result, name, gains, tables_by_name)
    verdict = _training_clause(
        result, name, _verdict_sentence(comparison, _losses(result, comparison, gains, tables_by_name))
    )
    if failing:
        text = tr("{failing}, and in the others ", failing=failing[0].text)
        verdict = sentences.compose(text + verdict.text, [*failing, verdict])
    consistency = _consistency_sentence(result, name, tables_by_name)
    is_unsound = bool(faults or failing or comparison.dependence)
    components = ", ".join(f"{component} ({wording.unit(unit) or 1})" for component, unit in result.axes.components)
    main = [
        *faults,
        verdict.with_text(prefix + verdict.text),
        *([] if faults else [consistency]),
        Sentence(_next_step(comparison, components if is_unsound else "", _training_ratio(result, name) is not None)),
    ]
    return Judgement(
        main,
        [
            *_floor_sentence(comparison),
            *_further_gains(comparison),
            *_extreme_gains(_comparable(gains, result, tables_by_name), comparison),
            *([consistency] if faults and consistency.intervals else []),
            *_improper_sentence(result, name, tables_by_name),
        ],
    )


def _next_step(comparison: RivalComparison, unsound: str, is_trained: bool) -> str:
    """What to do after a verdict. unsound: the components as which estimates were read that are missing, at fault, or
    depend on each other."""
    gains = [comparison.gain_against(rival) for rival in comparison.rivals]
    undecided = [
        gain for gain in gains if gain.estimate.lo <= 0 <= gain.estimate.hi and not gain_sentences.is_equal(gain)
    ]
    if is_trained:
        return tr('Next: train it on other noise: radarsim.plots(…, purpose="training").')
    if unsound:
        return tr("Next: mend this; the estimates were read as {components}.", components=unsound)
    if undecided:
        needed = _deciding_realisations(undecided[-1], int(comparison.sigma["n"]))
        if not math.isfinite(needed):
            return tr("Next: judge it on more realisations.")
        if needed > MAX_SUGGESTED_REALISATIONS:
            return tr("Next: choose by cost, or judge it at another time (--for); a gain this small decides nothing.")
        n = math.ceil(float(f"{needed:.1e}"))
        return tr("Next: about {n:,} realisations would tell a gain of this size from none.", n=n)
    if any(gain.estimate.hi < 0 for gain in gains):
        return tr('Next: tune it on other noise (radarsim.plots(…, purpose="training")), and judge it again.')
    if len(gains) == 1:
        return tr("Next: judge it against the config's filters at their best, with --against tuned.")
    return tr("Next: judge it on other targets; a filter tuned for one may be poor for others.")


def _deciding_realisations(gain: ComparedValue, n: int) -> float:
    """How many realisations tell a gain from 0 if it stays as it is: intervals narrow as the root of their number."""
    half_width = (gain.estimate.hi - gain.estimate.lo) / 2
    return float(n * (half_width / max(abs(gain.value), NEGLIGIBLE_GAIN)) ** 2)


def _failing_clause(failures: "pd.DataFrame", name: str) -> list[Sentence]:
    """How often a user filter fails, and why; none where it never does."""
    total, *by_reason = (row for _, row in failures.iterrows())
    if not total["failed"]:
        return []
    share = wording.share(*(100 * total[key] for key in ("share", "share_lo", "share_hi")))
    reasons = [
        f"{tr(REASONS[row['reason']])} {row['failed']:,}"
        for row in by_reason
        if row["failed"] and row["reason"] in REASONS
    ]
    text = tr(
        "{name} fails in {share} of the realisations ({reasons})",
        name=quote_name(name),
        share=share,
        reasons=join_names(reasons),
    )
    return [Sentence(text, sentences.intervals("failures", "share", total))]


def _losses(
    result: CaseResult, comparison: RivalComparison, gains: "pd.DataFrame", tables_by_name: TablesByName
) -> list[RivalComparison]:
    """The other components in which a filter that is not worse at the point of the answer is surely worse than the
    config's best one, at the same scan."""
    row = comparison.row_against(comparison.best)
    if not row["gain_hi"] >= 0:
        return []
    rows = gains[(gains["k"] == row["k"]) & (gains["component"] != row["component"])]
    comparisons = [
        compare_with_rivals(result, comparison.name, rows, tables_by_name, (component, np.inf))
        for component in dict.fromkeys(rows["component"])
    ]
    return [loss for loss in comparisons if loss.gain_against(loss.best).estimate.hi < -MATERIAL_LOSS]


def _training_ratio(result: CaseResult, name: str) -> float | None:
    """How many times larger σ of a user filter is on other noise, where it seems to know the judged realisations."""
    return dict(user_filter_cases(result)[0].axes.training_ratios).get(name)


def _training_clause(result: CaseResult, name: str, verdict: Sentence) -> Sentence:
    """The verdict after the warning that a filter seems to know the realisations by which it is judged."""
    ratio = _training_ratio(result, name)
    if ratio is None:
        return verdict
    text = tr(
        "{name} seems to have been trained on these realisations: on other noise its RMS error is {ratio} times as "
        "large; here ",
        name=quote_name(name),
        ratio=numeral(f"{ratio:.3g}").replace("inf", "∞"),
    )
    return verdict.with_text(text + verdict.text)


def _comparable(gains: "pd.DataFrame", result: CaseResult, tables_by_name: TablesByName) -> "pd.DataFrame":
    """The gains that compare errors: not where a baseline has next to none, as of a component that is known."""
    curves = common.select_rows(tables_by_name["curves"], case=result.name)
    largest = curves.groupby(["filter", "component"])["sigma"].transform("max")
    keys = ["filter", "component", "k"]
    erring = curves.loc[curves["sigma"] > NEGLIGIBLE * largest, keys].rename(columns={"filter": "baseline"})
    comparable = set(erring.itertuples(index=False, name=None))
    rows = zip(gains["baseline"], gains["component"], gains["k"], strict=True)
    return gains[[row in comparable for row in rows] & np.isfinite(gains["gain_percent"].to_numpy(dtype=float))]


def _verdict_sentence(comparison: RivalComparison, losses: Sequence[RivalComparison] = ()) -> Sentence:
    """Whether a filter is better than the config's best one, and than its best tuned one; where it is worse; its σ, and
    theirs."""
    best, *tuned = comparison.rivals
    clauses = [_against_best(comparison, best), *(_against_tuned(comparison, rival) for rival in tuned)]
    clauses += [_loss_clause(loss) for loss in losses]
    sigmas = _sigma_clause(comparison)
    return sentences.compose(f"{sentences.join('', clauses).text}; {sigmas.text}", [*clauses, sigmas])


def _against_best(comparison: RivalComparison, best: str) -> Sentence:
    row, gain = comparison.row_against(best), comparison.gain_against(best)
    fields = {
        "name": quote_name(comparison.name),
        "best": comparison.best_name,
        "component": row["component"],
        "t": numeral(f"{row['t_s']:g}"),
        "gain": comparison.gain_text(best),
    }
    if np.isnan(gain.estimate.lo):
        text = tr(
            "{name} cannot be judged against {best}, the config's best in {component} at {t} s, as {reason} and no "
            "interval holds: gain {gain}",
            **fields,
            reason=tr(DEPENDENCES[comparison.dependence or "others"]),
        )
    elif comparison.is_equal:
        text = tr("{name} is equal to {best}, the config's best in {component} at {t} s, {gain}", **fields)
    elif gain.estimate.lo > 0:
        text = tr("{name} is better than {best}, the config's best in {component} at {t} s: gain {gain}", **fields)
    elif gain.estimate.hi < 0:
        text = tr("{name} is worse than {best}, the config's best in {component} at {t} s: gain {gain}", **fields)
    else:
        text = tr(
            "{name} cannot be distinguished from {best}, the config's best in {component} at {t} s: gain {gain}",
            **fields,
        )
    return Sentence(text, gain.intervals)


def _loss_clause(comparison: RivalComparison) -> Sentence:
    row = comparison.row_against(comparison.best)
    best, gain = quote_name(comparison.best), comparison.gain_text(comparison.best)
    text = tr(", but worse than {best} in {component} there: gain {gain}",
              best=best, component=row["component"], gain=gain)  # fmt: skip
    return Sentence(text, sentences.intervals("gains", "gain", row))


def _against_tuned(comparison: RivalComparison, rival: str) -> Sentence:
    gain, rival_sigma = comparison.gain_against(rival), compared_value.row_value(comparison.rivals[rival])
    fields = {"best": quote_name(rival), "gain": comparison.gain_text(rival)}
    if np.isnan(gain.estimate.lo):
        text = tr(", nor against {best}: gain {gain}", **fields)
    elif gain.estimate.lo > 0:
        text = tr(", and better than {best}: gain {gain}", **fields)
    elif gain.estimate.hi < 0:
        text = tr(", and worse than {best}: gain {gain}", **fields)
    elif gain_sentences.is_equal(gain):
        text = tr(", and equal to {best}, {gain}", **fields)
    else:
        text = tr(", and cannot be distinguished from {best}: gain {gain}", **fields)
    text += tr(", whose RMS error is {sigma}", sigma=rival_sigma.text(comparison.unit))
    return Sentence(text, (*gain.intervals, *rival_sigma.intervals))


def _sigma_clause(comparison: RivalComparison) -> Sentence:
    """σ of the user filter and of the config's best one, of the same realisations."""
    own, best, unit = comparison.own_sigma, comparison.best_sigma, comparison.unit
    if comparison.is_equal and comparison.has_same_realisations:
        return Sentence(tr("the RMS error of both is {sigma}.", sigma=best.text(unit)), best.intervals)
    fields = {"best": quote_name(comparison.best), "sigma": own.text(unit)}
    if comparison.has_same_realisations:
        text = tr("its RMS error is {sigma}, that of {best} {rival}.", rival=best.text(unit), **fields)
        return Sentence(text, (*own.intervals, *best.intervals))
    of_both = own.value / (1 - comparison.gain_against(comparison.best).value / 100)
    rival = f"{wording.number(of_both)} {unit}".rstrip()
    text = tr("its RMS error is {sigma}, that of {best} in the same realisations about {rival}.", rival=rival, **fields)
    return Sentence(text, own.intervals)


def _floor_sentence(comparison: RivalComparison) -> list[Sentence]:
    """How far the user filter, the config's best one, and the best tuned one are above the floor; none without one.

    A filter that fails is not compared with it: the floor is one of all realisations."""
    lowest = float(comparison.sigma["floor"])
    if np.isnan(lowest):
        return []
    own = comparison.own_sigma.mapped(lambda sigma: round(100 * (sigma / lowest - 1), 9))  # without the rounding of σ
    rivals = {name: compared_value.row_value(row) for name, row in comparison.rivals.items()}
    above = [
        f"{quote_name(name)} {sigma.mapped(lambda sigma: round(100 * (sigma / lowest - 1), 2)).text('%', '.3g')}"
        for name, sigma in rivals.items()
    ]
    is_of_unbiased = comparison.sigma["floor_kind"].startswith("CRB")
    fields = {
        "kind": tr(UNBIASED if is_of_unbiased else ANY),
        "floor": f"{wording.number(lowest)} {comparison.unit}".rstrip(),
        "name": quote_name(comparison.name),
        "others": join_names(above),
    }
    if not comparison.has_same_realisations:
        text = tr(
            "There {kind} is {floor}; above it is {others}. {name}, which has an estimate in other "
            "realisations, is not compared with it.",
            **fields,
        )
        return [Sentence(text, sentences.intervals("curves", "sigma", comparison.sigma))]
    if comparison.is_equal:
        text = tr("There {kind} is {floor}: above it is {others}, and {name} as far.", **fields)
        return [Sentence(text, comparison.best_sigma.intervals)]
    if own.value < 0:
        below = own.mapped(lambda percent: -percent).text("%", ".3g")
        text = tr("There {kind} is {floor}: {name} is {own} below it; above it is {others}.", own=below, **fields)
    else:
        text = tr("There {kind} is {floor}: {name} is {own} above it, {others}.", own=own.text("%", ".3g"), **fields)
    if comparison.own_sigma.estimate.hi < lowest and is_of_unbiased:
        text += " " + tr("Only a biased estimator, or one with extra information, can lie below it.")
    elif comparison.own_sigma.estimate.hi < lowest:
        text += " " + tr(
            "Below it no estimator can be, biased or not, as it holds on the mean over all truths drawn: {name} "
            "knows more than these plots; was it trained on their truth?",
            name=quote_name(comparison.name),
        )
    return [Sentence(text, comparison.own_sigma.intervals)]


def _further_gains(comparison: RivalComparison) -> list[Sentence]:
    """The gains at the same scan against all filters but those of the verdict."""
    rows = comparison.gains[~comparison.gains["baseline"].isin([*comparison.rivals, *comparison.equal])]
    if not len(rows):
        return []
    against = [f"{quote_name(baseline)} {comparison.gain_text(baseline)}" for baseline in rows["baseline"]]
    text = tr(
        "Further gains of {name} there: against {gains}.", name=quote_name(comparison.name), gains=join_names(against)
    )
    return [Sentence(text, sentences.intervals("gains", "gain", rows))]


def _extreme_gains(gains: "pd.DataFrame", comparison: RivalComparison) -> list[Sentence]:
    """The least and the largest gain against the config's best over all components and scans, if there are several."""
    rows = gains[gains["baseline"] == comparison.best]
    if len(rows) < 2:
        return []
    values = [compared_value.row_value(row, GAIN) for _, row in rows.iterrows()]
    if all(map(gain_sentences.is_equal, values)):
        text = tr("It is equal to {best} in all components and at all scans.", best=quote_name(comparison.best))
        return [Sentence(text)]
    extremes = [compared_value.extreme(rows, GAIN, largest) for largest in (False, True)]
    smallest, largest = (
        tr(
            "{gain} ({component} at {t} s)",
            gain=gain_sentences.number_text(gain),
            component=row["component"],
            t=numeral(f"{row['t_s']:g}"),
        )
        for row, gain in extremes
    )
    text = tr(
        "Over all components and scans its gain against {best} is from {least} to {most}{chosen}.",
        best=quote_name(comparison.best),
        least=smallest,
        most=largest,
        chosen=extremes[0][1].choice_remark(),
    )
    return [Sentence(text, tuple(interval for _, gain in extremes for interval in gain.intervals))]


def _consistency_sentence(result: CaseResult, name: str, tables_by_name: TablesByName) -> Sentence:
    """Whether the covariances of a user filter are right at the last scan."""
    rows = (
        common.select_rows(tables_by_name["nees"], case=result.name, filter=name) if "nees" in tables_by_name else None
    )
    if rows is None or not len(rows):
        return Sentence(tr("Its consistency is not judged, as {name} gives no covariances.", name=quote_name(name)))
    row = rows.iloc[-1]
    text = tr(
        "NEES of {name} at {t} s: {nees} (1 is right): {meaning}.",
        name=quote_name(name),
        t=numeral(f"{row['t_s']:g}"),
        nees=wording.estimate((row[key] for key in ("nees", "nees_lo", "nees_hi")), "", ".3g"),
        meaning=tr(CONSISTENCY[row["nees_verdict"]]),
    )
    return Sentence(text, sentences.intervals("nees", "nees", row))


def _improper_sentence(result: CaseResult, name: str, tables_by_name: TablesByName) -> list[Sentence]:
    """How many covariances of a user filter are none, if any."""
    improper = common.select_rows(tables_by_name["failures"], case=result.name, filter=name, reason=IMPROPER)
    if not len(improper) or not (count := int(improper["failed"].iloc[0])):
        return []
    text = tr(
        "In {count:,} of {n:,} realisations {name} gives a covariance that is not positive definite: it is no "
        "part of NEES.",
        count=count,
        n=int(improper["n"].iloc[0]),
        name=quote_name(name),
    )
    return [Sentence(text)]
