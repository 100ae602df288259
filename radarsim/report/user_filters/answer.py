"""Question and answer of an experiment with user filters: how each compares with the config's filters."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language.numerals import numeral
from radarsim.language.translate import join_names, shorten_names, term, tr
from radarsim.report import key_labels, sentences, wording
from radarsim.report import tables as common
from radarsim.report.sentences import Sentence
from radarsim.report.statistics import Estimate
from radarsim.report.user_filters.tables import IMPROPER, REASONS, TablesByName, user_filter_cases

if TYPE_CHECKING:
    import pandas as pd


TUNED = ", tuned"  # the end of the names of filters that `radarsim tune` has tuned
GAIN = ("gain_percent", "gain_lo", "gain_hi")
SIGMA = ("sigma", "sigma_lo", "sigma_hi")
NARROWER = 2.0  # times: a σ from a paired ratio is told in place of the measured one where it is so much narrower
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
    exact_sigmas: Mapping[str, float]  # of the config's filters for which it is known
    best_sigma: "pd.Series[Any]"  # of `curves`: that of the config's best filter
    rivals: Mapping[str, float]  # the config's best filter, then its best tuned one, if any; their σ, exact first
    dependence: str  # why the user filter has no intervals; empty where it has

    @property
    def best(self) -> str:
        return next(iter(self.rivals))

    def gain_against(self, baseline: str) -> "pd.Series[Any]":
        return self.gains[self.gains["baseline"] == baseline].iloc[0]

    @cached_property
    def best_estimate(self) -> tuple[Estimate, tuple[sentences.MeasuredInterval, ...]]:
        """σ of the user filter, with the interval that it rests on: the measured one or, where that is far wider, the
        exact σ of another filter times the paired ratio of the two."""
        estimate = Estimate(*(float(self.sigma[key]) for key in SIGMA))
        intervals = sentences.intervals("curves", "sigma", self.sigma)
        for baseline, exact_sigma in self.exact_sigmas.items():
            row = self.gain_against(baseline)
            paired = Estimate(*(exact_sigma * (1 - row[key] / 100) for key in (GAIN[0], *GAIN[:0:-1])))
            if NARROWER * (paired.hi - paired.lo) < estimate.hi - estimate.lo:
                estimate, intervals = paired, sentences.intervals("gains", "gain", row)
        return estimate, intervals


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
    return min(comparisons, key=lambda comparison: comparison.gain_against(comparison.best)["gain_percent"])


def _compare(
    result: CaseResult, name: str, gains: "pd.DataFrame", tables_by_name: TablesByName, point: tuple[str, float]
) -> _Comparison:
    """The rows of a component at the scan next to a time."""
    (component, unit), t_s = next(c for c in result.axes.components if c[0] == point[0]), point[1]
    gains = gains[gains["component"] == component]
    distance_s = (gains["t_s"] - min(t_s, gains["t_s"].max())).abs()
    gains = gains[gains["k"] == gains["k"][distance_s.idxmin()]]
    curves = common.select_rows(tables_by_name["curves"], case=result.name, component=component, k=gains["k"].iloc[0])
    sigma = dict(zip(curves["filter"], common.exact_first(curves, "sigma", "exact_sigma"), strict=True))
    baselines = [baseline for baseline in gains["baseline"] if baseline in result.axes.filters]
    tuned = [baseline for baseline in baselines if baseline.endswith(TUNED)]
    best = min((baseline for baseline in baselines if baseline not in tuned), key=lambda baseline: sigma[baseline])
    rivals = [best, *sorted(tuned, key=lambda baseline: sigma[baseline])[:1]]
    rows = {row["filter"]: row for _, row in curves.iterrows()}
    unit = key_labels.unit_label(unit)
    exact = {row["filter"]: float(row["exact_sigma"]) for row in rows.values() if row["exact_sigma"] > 0}
    exact = {baseline: exact[baseline] for baseline in baselines if baseline in exact}
    dependence = dict(user_filter_cases(result)[0].axes.dependent).get(name, "")
    rival_sigmas = {rival: sigma[rival] for rival in rivals}
    return _Comparison(name, unit, gains, rows[name], exact, rows[best], rival_sigmas, dependence)


def _losses(
    result: CaseResult, comparison: _Comparison, gains: "pd.DataFrame", tables_by_name: TablesByName
) -> list[_Comparison]:
    """The other components in which a filter that is not worse at the point of the answer is surely worse than the
    config's best one, at the same scan."""
    row = comparison.gain_against(comparison.best)
    if not row["gain_hi"] >= 0:
        return []
    rows = gains[(gains["k"] == row["k"]) & (gains["component"] != row["component"])]
    comparisons = [
        _compare(result, comparison.name, rows, tables_by_name, (component, np.inf))
        for component in dict.fromkeys(rows["component"])
    ]
    return [loss for loss in comparisons if loss.gain_against(loss.best)["gain_hi"] < -MATERIAL_LOSS]


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
    estimate, intervals = comparison.best_estimate
    sigma = wording.estimate(estimate, comparison.unit)
    text = tr("its σ is {sigma}, {floor}.", sigma=sigma, floor=_best_sigma(comparison))
    if np.isnan(comparison.best_sigma["exact_sigma"]):
        intervals += sentences.intervals("curves", "sigma", comparison.best_sigma)
    verdict = sentences.join("", clauses)
    return sentences.compose(f"{verdict.text}; {text}", [verdict, Sentence(text, intervals)])


def _against_best(comparison: _Comparison, best: str) -> Sentence:
    row = comparison.gain_against(best)
    fields = {
        "name": comparison.name,
        "best": best,
        "component": row["component"],
        "t": numeral(f"{row['t_s']:g}"),
        "gain": _gain(row),
    }
    if np.isnan(row["gain_lo"]):
        text = tr(
            "{name} cannot be judged against {best}, the config's best in {component} at {t} s, as {reason} and no "
            "interval holds: gain {gain}",
            **fields,
            reason=tr(DEPENDENCES[comparison.dependence or "others"]),
        )
    elif row["gain_lo"] > 0:
        text = tr("{name} is better than {best}, the config's best in {component} at {t} s: gain {gain}", **fields)
    elif row["gain_hi"] < 0:
        text = tr("{name} is worse than {best}, the config's best in {component} at {t} s: gain {gain}", **fields)
    else:
        text = tr(
            "{name} cannot be distinguished from {best}, the config's best in {component} at {t} s: gain {gain}",
            **fields,
        )
    return Sentence(text, sentences.intervals("gains", "gain", row))


def _loss_clause(comparison: _Comparison) -> Sentence:
    row = comparison.gain_against(comparison.best)
    text = tr(", but worse than {best} in {component} there: gain {gain}",
              best=comparison.best, component=row["component"], gain=_gain(row))  # fmt: skip
    return Sentence(text, sentences.intervals("gains", "gain", row))


def _against_tuned(comparison: _Comparison, rival: str) -> Sentence:
    row = comparison.gain_against(rival)
    fields = {"best": rival, "gain": _gain(row)}
    if np.isnan(row["gain_lo"]):
        text = tr(", nor against {best}: gain {gain}", **fields)
    elif row["gain_lo"] > 0:
        text = tr(", and better than {best}: gain {gain}", **fields)
    elif row["gain_hi"] < 0:
        text = tr(", and worse than {best}: gain {gain}", **fields)
    else:
        text = tr(", and cannot be distinguished from {best}: gain {gain}", **fields)
    sigma = f"{wording.number(comparison.rivals[rival])} {comparison.unit}".rstrip()
    return Sentence(text + tr(", whose σ is {sigma}", sigma=sigma), sentences.intervals("gains", "gain", row))


def _best_sigma(comparison: _Comparison) -> str:
    """σ of the config's best filter, exact where it is known exactly."""
    row, unit = comparison.best_sigma, comparison.unit
    if np.isnan(row["exact_sigma"]):
        sigma = wording.estimate((row[key] for key in SIGMA), unit)
        return tr("that of {best} {sigma}", best=comparison.best, sigma=sigma)
    return tr(
        "that of {best} {sigma} {unit} exactly",
        best=comparison.best,
        sigma=wording.number(row["exact_sigma"]),
        unit=unit,
    )


def _floor_sentence(comparison: _Comparison) -> list[Sentence]:
    """How far the user filter, the config's best one, and the best tuned one are above the floor; none without one."""
    lowest = float(comparison.sigma["floor"])
    if np.isnan(lowest):
        return []
    estimate, intervals = comparison.best_estimate
    above = [round(100 * (number / lowest - 1), 9) for number in estimate]  # without the rounding of σ
    is_below = above[0] < 0
    distance = wording.estimate((-above[0], -above[2], -above[1]) if is_below else above, "%", ".3g")
    rivals = [
        f"{name} {wording.number(round(100 * (sigma / lowest - 1), 2), 3)} %"
        for name, sigma in comparison.rivals.items()
    ]
    is_of_unbiased = comparison.sigma["floor_kind"].startswith("CRB")
    text = tr(
        "The floor there, {kind}, is {floor}: {name} is {own} below it; above it is {others}."
        if is_below
        else "The floor there, {kind}, is {floor}: {name} is {own} above it, {others}.",
        kind=tr(UNBIASED if is_of_unbiased else ANY),
        floor=f"{wording.number(lowest)} {comparison.unit}".rstrip(),
        name=comparison.name,
        own=distance,
        others=join_names(rivals),
    )
    if estimate.hi < lowest and is_of_unbiased:
        text += " " + tr("Below it is only what is biased, or knows more than these plots.")
    elif estimate.hi < lowest:
        text += " " + tr(
            "Below it no estimator can be, biased or not, as it holds on the mean over all truths drawn: {name} "
            "knows more than these plots; was it trained on their truth?",
            name=comparison.name,
        )
    return [Sentence(text, intervals)]


def _further_gains(comparison: _Comparison) -> list[Sentence]:
    """The gains at the same scan against all filters but the config's best."""
    rows = comparison.gains[comparison.gains["baseline"] != comparison.best]
    if not len(rows):
        return []
    against = [f"{row['baseline']} {_gain(row)}" for _, row in rows.iterrows()]
    text = tr("Further gains of {name} there: against {gains}.", name=comparison.name, gains=join_names(against))
    return [Sentence(text, sentences.intervals("gains", "gain", rows))]


def _extreme_gains(gains: "pd.DataFrame", comparison: _Comparison) -> list[Sentence]:
    """The least and the largest gain against the config's best over all components and scans, if there are several."""
    rows = gains[gains["baseline"] == comparison.best].sort_values("gain_percent")
    if len(rows) < 2:
        return []
    extremes = rows.iloc[[0, -1]]
    smallest, largest = (
        tr("{gain} ({component} at {t} s)", gain=_gain(row), component=row["component"], t=numeral(f"{row['t_s']:g}"))
        for _, row in extremes.iterrows()
    )
    text = tr(
        "Over all components and scans its gain against {best} is from {least} to {most}.",
        best=comparison.best,
        least=smallest,
        most=largest,
    )
    return [Sentence(text, sentences.intervals("gains", "gain", extremes))]


def _gain(row: "pd.Series[Any]") -> str:
    """A gain with its interval, to a thousandth of a per cent, its bounds outward: what is finer is rounding."""
    value, low, high = (float(row[key]) for key in GAIN)
    rounded = np.round(value, 3), np.floor(1e3 * low) / 1e3, np.ceil(1e3 * high) / 1e3
    return wording.estimate((number + 0.0 for number in rounded), "%", ".3g")


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
