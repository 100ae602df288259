"""Question and answer of an experiment with user filters: how each compares with the config's filters."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language.numerals import numeral
from radarsim.language.translate import join_names, shorten_names, term, tr
from radarsim.report import compared_value, gain_sentences, key_labels, sentences, wording
from radarsim.report import tables as common
from radarsim.report.compared_value import ComparedValue
from radarsim.report.quantities import GAIN
from radarsim.report.sentences import Sentence
from radarsim.report.user_filters.rows import TablesByName, user_filter_cases
from radarsim.report.user_filters.tables import IMPROPER, REASONS

if TYPE_CHECKING:
    import pandas as pd


TUNED = ", tuned"  # the end of the names of filters that `radarsim tune` has tuned
ROUNDING = 1e-9  # relative difference of σ of filters that are the same but for rounding
MATERIAL_LOSS = 1.0  # per cent: a smaller one in another component is not told in the first sentence
NEGLIGIBLE = 1e-3  # of the largest σ of a filter's component over time: what is below is known, not estimated
DEPENDENCES = {  # why a filter has no intervals, after "as"
    "repeated": term("its random numbers repeat in every block"),
    "shared": term("all realisations share its random numbers"),
    "place": term("its estimates depend on the row in the batch"),
    "others": term("its estimates depend on the other realisations in the batch"),
}
UNBIASED = term("the Cramér-Rao bound of unbiased estimators")
ANY = term("the posterior Cramér-Rao bound")


def question(experiment: Experiment) -> str:
    """What an experiment with user filters asks; empty where it has none."""
    filters = list(dict.fromkeys(member.name for case in experiment.cases for member in case.user_filters))
    if len(filters) > 1:
        return tr("Are {names} better than the filters of the config?", names=shorten_names(filters))
    return tr("Is {name} better than the filters of the config?", name=filters[0]) if filters else ""


def answer(results: Sequence[CaseResult], tables_by_name: TablesByName) -> list[Sentence]:
    """How every user filter compares with the config's filters, case by case."""
    return [
        sentence
        for result in results
        for case in user_filter_cases(result)
        for name in case.axes.filters
        for sentence in _filter_sentences(result, name, f"{result.name}: " if len(results) > 1 else "", tables_by_name)
    ]


@dataclass(frozen=True)
class _Comparison:
    """The rows by which a user filter is compared with the config's filters: of one component at one scan."""

    name: str
    unit: str
    gains: "pd.DataFrame"  # against every other filter
    sigma: "pd.Series[Any]"  # of `curves`: the user filter's
    rivals: Mapping[str, "pd.Series[Any]"]  # of `curves`: the best filter, then the best tuned one
    equal: tuple[str, ...]  # the config's other filters with the σ of its best one, but for rounding
    dependence: str  # why the user filter has no intervals; empty where it has

    @property
    def best(self) -> str:
        return next(iter(self.rivals))

    @property
    def best_name(self) -> str:
        """The config's best filter in a sentence, with those that are equal to it."""
        return (
            tr("{name} (equal to {others})", name=self.best, others=join_names(self.equal)) if self.equal else self.best
        )

    @property
    def best_sigma(self) -> ComparedValue:
        return compared_value.row_value(self.rivals[self.best])

    @property
    def has_same_realisations(self) -> bool:
        """Whether the user filter has an estimate in as many realisations as the config's best filter."""
        return bool(self.sigma["n"] == self.rivals[self.best]["n"])

    @property
    def is_equal(self) -> bool:
        """Whether it has the same errors as the config's best filter, wherever both have an estimate."""
        return gain_sentences.is_equal(self.gain_against(self.best))

    def row_against(self, baseline: str) -> "pd.Series[Any]":
        return self.gains[self.gains["baseline"] == baseline].iloc[0]

    def gain_against(self, baseline: str) -> ComparedValue:
        return compared_value.row_value(self.row_against(baseline), GAIN)

    def gain_text(self, baseline: str) -> str:
        """The gain against a baseline with its interval, or what was not seen of equal filters."""
        return gain_sentences.percent_text(self.gain_against(baseline), self.sigma["n"])

    @cached_property
    def own_sigma(self) -> ComparedValue:
        """σ of the user filter: beside an exact rival that times the paired ratio, else measured."""
        if self.best_sigma.is_exact and self.has_same_realisations:
            return compared_value.paired_sigma(self.best_sigma.value, self.row_against(self.best))
        return compared_value.row_value(self.sigma)


def _filter_sentences(result: CaseResult, name: str, prefix: str, tables_by_name: TablesByName) -> list[Sentence]:
    """Whether a user filter is better than the config's best, how often it fails, then all gains at that scan."""
    gains = common.select_rows(tables_by_name["gains"], case=result.name, filter=name)
    failing = _failing_clause(common.select_rows(tables_by_name["failures"], case=result.name, filter=name), name)
    if not len(gains):
        no_estimate = tr("{name} has no estimate that could be compared", name=name)
        return [clause.with_text(f"{prefix}{clause.text}.") for clause in failing or [Sentence(no_estimate)]]

    comparison = _worst_comparison(result, name, gains, tables_by_name)
    verdict = _training_clause(
        result, name, _verdict_sentence(comparison, _losses(result, comparison, gains, tables_by_name))
    )
    if failing:
        text = tr("{failing}, and in the others ", failing=failing[0].text)
        verdict = sentences.compose(text + verdict.text, [*failing, verdict])
    return [
        verdict.with_text(prefix + verdict.text),
        *_floor_sentence(comparison),
        *_further_gains(comparison),
        *_extreme_gains(_comparable(gains, result, tables_by_name), comparison),
        *_nees_sentences(result, name, tables_by_name),
    ]


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
        "{name} fails in {share} of the realisations ({reasons})", name=name, share=share, reasons=join_names(reasons)
    )
    return [Sentence(text, sentences.intervals("failures", "share", total))]


def _worst_comparison(
    result: CaseResult, name: str, gains: "pd.DataFrame", tables_by_name: TablesByName
) -> _Comparison:
    """The comparison by which a filter is judged: at the point asked for, else at the worst of those that the study's
    answer is about."""
    axes = user_filter_cases(result)[0].axes
    points = [axes.answer_at] if axes.answer_at else axes.answer_points
    present = set(gains["component"])
    first = next(component for component, _ in result.axes.components if component in present)
    usable_points = [point for point in points if point[0] in present] or [(first, points[-1][1])]
    comparisons = [_compare(result, name, gains, tables_by_name, point) for point in usable_points]
    return min(comparisons, key=lambda comparison: comparison.row_against(comparison.best)["gain_percent"])


def _compare(
    result: CaseResult, name: str, gains: "pd.DataFrame", tables_by_name: TablesByName, point: tuple[str, float]
) -> _Comparison:
    """The rows of a component at the scan next to a time."""
    (component, unit), t_s = next(c for c in result.axes.components if c[0] == point[0]), point[1]
    gains = gains[gains["component"] == component]
    distance_s = (gains["t_s"] - min(t_s, gains["t_s"].max())).abs()
    gains = gains[gains["k"] == gains["k"][distance_s.idxmin()]]
    curves = common.select_rows(tables_by_name["curves"], case=result.name, component=component, k=gains["k"].iloc[0])
    rows = {row["filter"]: row for _, row in curves.iterrows()}
    baselines = [baseline for baseline in gains["baseline"] if baseline in result.axes.filters]
    rank = _ranks(baselines, rows, gains)
    tuned = [baseline for baseline in baselines if baseline.endswith(TUNED)]
    best = min((baseline for baseline in baselines if baseline not in tuned), key=rank.__getitem__)
    rivals = {rival: rows[rival] for rival in (best, *sorted(tuned, key=rank.__getitem__)[:1])}
    dependence = dict(user_filter_cases(result)[0].axes.dependent).get(name, "")
    equal = tuple(
        baseline
        for baseline in baselines
        if baseline != best and math.isclose(rows[baseline]["sigma"], rows[best]["sigma"], rel_tol=ROUNDING)
    )
    return _Comparison(name, key_labels.unit_label(unit), gains, rows[name], rivals, equal, dependence)


def _ranks(baselines: Sequence[str], rows: Mapping[str, "pd.Series[Any]"], gains: "pd.DataFrame") -> dict[str, float]:
    """By what the config's filters are ranked: exact σ where all have it, else how little is gained against them."""
    exact = {baseline: float(rows[baseline]["exact_sigma"]) for baseline in baselines}
    if not np.isnan(list(exact.values())).any():
        return exact
    return dict(zip(gains["baseline"], gains["gain_percent"], strict=True))


def _losses(
    result: CaseResult, comparison: _Comparison, gains: "pd.DataFrame", tables_by_name: TablesByName
) -> list[_Comparison]:
    """The other components in which a filter that is not worse at the point of the answer is surely worse than the
    config's best one, at the same scan."""
    row = comparison.row_against(comparison.best)
    if not row["gain_hi"] >= 0:
        return []
    rows = gains[(gains["k"] == row["k"]) & (gains["component"] != row["component"])]
    comparisons = [
        _compare(result, comparison.name, rows, tables_by_name, (component, np.inf))
        for component in dict.fromkeys(rows["component"])
    ]
    return [loss for loss in comparisons if loss.gain_against(loss.best).estimate.hi < -MATERIAL_LOSS]


def _training_clause(result: CaseResult, name: str, verdict: Sentence) -> Sentence:
    """The verdict after the warning that a filter seems to know the realisations by which it is judged."""
    ratio = dict(user_filter_cases(result)[0].axes.training_ratios).get(name)
    if ratio is None:
        return verdict
    text = tr(
        "{name} seems to have been trained on these realisations: on other noise its σ is {ratio} times as large; "
        "here ",
        name=name,
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


def _verdict_sentence(comparison: _Comparison, losses: Sequence[_Comparison] = ()) -> Sentence:
    """Whether a filter is better than the config's best one, and than its best tuned one; where it is worse; its σ, and
    theirs."""
    best, *tuned = comparison.rivals
    clauses = [_against_best(comparison, best), *(_against_tuned(comparison, rival) for rival in tuned)]
    clauses += [_loss_clause(loss) for loss in losses]
    sigmas = _sigma_clause(comparison)
    return sentences.compose(f"{sentences.join('', clauses).text}; {sigmas.text}", [*clauses, sigmas])


def _against_best(comparison: _Comparison, best: str) -> Sentence:
    row, gain = comparison.row_against(best), comparison.gain_against(best)
    fields = {
        "name": comparison.name,
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


def _loss_clause(comparison: _Comparison) -> Sentence:
    row = comparison.row_against(comparison.best)
    text = tr(", but worse than {best} in {component} there: gain {gain}",
              best=comparison.best, component=row["component"], gain=comparison.gain_text(comparison.best))  # fmt: skip
    return Sentence(text, sentences.intervals("gains", "gain", row))


def _against_tuned(comparison: _Comparison, rival: str) -> Sentence:
    gain, rival_sigma = comparison.gain_against(rival), compared_value.row_value(comparison.rivals[rival])
    fields = {"best": rival, "gain": comparison.gain_text(rival)}
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
    text += tr(", whose σ is {sigma}", sigma=rival_sigma.text(comparison.unit))
    return Sentence(text, (*gain.intervals, *rival_sigma.intervals))


def _sigma_clause(comparison: _Comparison) -> Sentence:
    """σ of the user filter and of the config's best one, of the same realisations."""
    own, best, unit = comparison.own_sigma, comparison.best_sigma, comparison.unit
    if comparison.is_equal and comparison.has_same_realisations:
        return Sentence(tr("the σ of both is {sigma}.", sigma=best.text(unit)), best.intervals)
    fields = {"best": comparison.best, "sigma": own.text(unit)}
    if comparison.has_same_realisations:
        text = tr("its σ is {sigma}, that of {best} {rival}.", rival=best.text(unit), **fields)
        return Sentence(text, (*own.intervals, *best.intervals))
    of_both = own.value / (1 - comparison.gain_against(comparison.best).value / 100)
    rival = f"{wording.number(of_both)} {unit}".rstrip()
    text = tr("its σ is {sigma}, that of {best} in the same realisations {rival}.", rival=rival, **fields)
    return Sentence(text, own.intervals)


def _floor_sentence(comparison: _Comparison) -> list[Sentence]:
    """How far the user filter, the config's best one, and the best tuned one are above the floor; none without one.

    A filter that fails is not compared with it: the floor is one of all realisations."""
    lowest = float(comparison.sigma["floor"])
    if np.isnan(lowest):
        return []
    own = comparison.own_sigma.mapped(lambda sigma: round(100 * (sigma / lowest - 1), 9))  # without the rounding of σ
    rivals = {name: compared_value.row_value(row) for name, row in comparison.rivals.items()}
    above = [
        f"{name} {sigma.mapped(lambda sigma: round(100 * (sigma / lowest - 1), 2)).text('%', '.3g')}"
        for name, sigma in rivals.items()
    ]
    is_of_unbiased = comparison.sigma["floor_kind"].startswith("CRB")
    fields = {
        "kind": tr(UNBIASED if is_of_unbiased else ANY),
        "floor": f"{wording.number(lowest)} {comparison.unit}".rstrip(),
        "name": comparison.name,
        "others": join_names(above),
    }
    if not comparison.has_same_realisations:
        text = tr(
            "The floor there, {kind}, is {floor}; above it is {others}. {name}, which has an estimate in other "
            "realisations, is not compared with it.",
            **fields,
        )
        return [Sentence(text, sentences.intervals("curves", "sigma", comparison.sigma))]
    if comparison.is_equal:
        text = tr("The floor there, {kind}, is {floor}: above it is {others}, and {name} as far.", **fields)
        return [Sentence(text, comparison.best_sigma.intervals)]
    if own.value < 0:
        below = own.mapped(lambda percent: -percent).text("%", ".3g")
        text = tr(
            "The floor there, {kind}, is {floor}: {name} is {own} below it; above it is {others}.", own=below, **fields
        )
    else:
        text = tr(
            "The floor there, {kind}, is {floor}: {name} is {own} above it, {others}.",
            own=own.text("%", ".3g"),
            **fields,
        )
    if comparison.own_sigma.estimate.hi < lowest and is_of_unbiased:
        text += " " + tr("Below it is only what is biased, or knows more than these plots.")
    elif comparison.own_sigma.estimate.hi < lowest:
        text += " " + tr(
            "Below it no estimator can be, biased or not, as it holds on the mean over all truths drawn: {name} "
            "knows more than these plots; was it trained on their truth?",
            name=comparison.name,
        )
    return [Sentence(text, comparison.own_sigma.intervals)]


def _further_gains(comparison: _Comparison) -> list[Sentence]:
    """The gains at the same scan against all filters but the config's best."""
    rows = comparison.gains[~comparison.gains["baseline"].isin([comparison.best, *comparison.equal])]
    if not len(rows):
        return []
    against = [f"{baseline} {comparison.gain_text(baseline)}" for baseline in rows["baseline"]]
    text = tr("Further gains of {name} there: against {gains}.", name=comparison.name, gains=join_names(against))
    return [Sentence(text, sentences.intervals("gains", "gain", rows))]


def _extreme_gains(gains: "pd.DataFrame", comparison: _Comparison) -> list[Sentence]:
    """The least and the largest gain against the config's best over all components and scans, if there are several."""
    rows = gains[gains["baseline"] == comparison.best]
    if len(rows) < 2:
        return []
    values = [compared_value.row_value(row, GAIN) for _, row in rows.iterrows()]
    if all(map(gain_sentences.is_equal, values)):
        text = tr("It is equal to {best} in all components and at all scans.", best=comparison.best)
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
        best=comparison.best,
        least=smallest,
        most=largest,
        chosen=extremes[0][1].choice_remark(),
    )
    return [Sentence(text, tuple(interval for _, gain in extremes for interval in gain.intervals))]


def _nees_sentences(result: CaseResult, name: str, tables_by_name: TablesByName) -> Iterator[Sentence]:
    """Whether the covariances of a user filter are right at the last scan, and how many are no covariances."""
    rows = (
        common.select_rows(tables_by_name["nees"], case=result.name, filter=name) if "nees" in tables_by_name else None
    )
    if rows is not None and len(rows):
        row = rows.iloc[-1]
        nees = wording.estimate((row[key] for key in ("nees", "nees_lo", "nees_hi")), "", ".3g")
        text = tr(
            "NEES of {name} at {t} s: {nees} (1 if its covariance is right).", name=name, t=f"{row['t_s']:g}", nees=nees
        )
        yield Sentence(text, sentences.intervals("nees", "nees", row))
    improper = common.select_rows(tables_by_name["failures"], case=result.name, filter=name, reason=IMPROPER)
    if len(improper) and (count := int(improper["failed"].iloc[0])):
        yield Sentence(
            tr(
                "In {count:,} of {n:,} realisations {name} gives a covariance that is not positive definite: it is no "
                "part of NEES.",
                count=count,
                n=int(improper["n"].iloc[0]),
                name=name,
            )
        )
