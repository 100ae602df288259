"""Tables, answer and figures of user filters beside those of a config: `CaseResult.outside`.

The study's own tables stay as they are; rows of these filters stand below. Their gains are against every filter of the
config, each over the realisations in which both have an estimate."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language import few, listed, numeral, term, tr
from radarsim.report import notes, panels, sentences, statistics, wording
from radarsim.report import tables as common
from radarsim.report.drawing import Figure
from radarsim.report.quantities import RADIAL, Component
from radarsim.report.row_notes import note_kinds
from radarsim.report.sentences import Sentence

if TYPE_CHECKING:
    import pandas as pd

TablesByName = Mapping[str, "pd.DataFrame"]
ROUNDING = 1e-6  # per cent: half-width of a gain that is nought but for rounding, whose variance is a difference
SINGLE = 1e-3  # per cent: width of the interval of a gain that is nought but for rounding to single precision
TUNED = ", tuned"  # the end of the names of filters that `radarsim tune` has tuned
GAIN = ("gain_percent", "gain_lo", "gain_hi")
SIGMA = ("sigma", "sigma_lo", "sigma_hi")
IMPROPER = "not_positive_definite"  # covariances, counted after the reasons of failures
REASONS = {  # in the order of the sums
    "not_a_number": term("not a number after an estimate:"),
    "no_estimate": term("no estimate:"),
    "diverged": term("over 100 times the largest error of the config's filters:"),
}
UNBIASED = term("the Cramér-Rao bound of unbiased estimators")
ANY = term("the posterior Cramér-Rao bound")


# ---- tables ----------------------------------------------------------------------------------------------------------
def others(result: CaseResult) -> list[CaseResult]:
    """The user filters of a result as a case; none where it has none."""
    return [] if result.outside is None else [result.outside]


def names(result: CaseResult) -> tuple[str, ...]:
    """What gains may be against: the config's filters, its baseline first, then user filters."""
    filters, b = result.axes.filters, result.axes.baseline
    user_filters = (name for case in others(result) for name in case.axes.filters)
    return (filters[b], *filters[:b], *filters[b + 1 :], *user_filters)


def gains(result: CaseResult) -> common.Columns:
    """Gains of the user filters of one case against all that come before them; then of the config's own against those
    that it names as baselines."""
    return common.stacked([_paired_gains(*pair) for pair in _paired_sums(result)])


def _paired_sums(result: CaseResult) -> Iterator[tuple[np.ndarray, str, CaseResult]]:
    """Of every baseline its sums (F, K, C, 7) with a case's filters, its name, and the case."""
    for user_case in others(result):
        both, filters = np.asarray(user_case.sums["both"]), (*result.axes.filters, *user_case.axes.filters)
        yield from ((both[:, filters.index(baseline)], baseline, user_case) for baseline in names(result))
        for baseline in user_case.axes.baselines:
            sums = both[user_case.axes.filters.index(baseline), : len(result.axes.filters)]
            yield sums[..., [0, 3, 4, 1, 2, 5, 6]], baseline, result


def _rests_on_few(result: CaseResult) -> np.ndarray:
    """Which gains (rows,) rest on the few realisations in which two filters differ much."""
    by_pair = []
    for both, _, case in _paired_sums(result):
        index = common.shown(case, both[..., 0] > 0)
        n, _, fourth_1, _, fourth_2, cross, fourth = np.moveaxis(both, -1, 0)
        by_pair.append(notes.few_differ(fourth_1 + fourth_2 - 2 * cross, fourth, n)[index])
    return np.concatenate(by_pair)


def _paired_gains(both: np.ndarray, baseline: str, case: CaseResult) -> common.Columns:
    """Gains of a case's filters from sums (F, K, C, 7) with those of a baseline."""
    index = f, k, c = common.shown(case, both[..., 0] > 0)
    n, square, fourth, base_square, base_fourth, cross, _ = np.moveaxis(both[index], -1, 0)
    gain = statistics.gain(square, fourth, base_square, base_fourth, cross, n)
    return {
        **common.leading(case, f, k, baseline=np.full(f.size, baseline, dtype=object), **common.components(case, c)),
        "gain_percent|gain": statistics.Estimate(gain.value, gain.lo - ROUNDING, gain.hi + ROUNDING),
        "exact_percent": np.full(f.size, np.nan),
    }


def failures(result: CaseResult) -> common.Columns:
    """How often a user filter fails, by the reason; σ and gains count the others.

    reason: `any`, or `not_a_number` after an estimate, `no_estimate` though a filter of the config has one, `diverged`
        with an error over a hundred times the largest of the config's filters in the realisation; no failure, but no
        part of NEES, is `not_positive_definite`, a covariance
    failed: realisations
    share ±: of all realisations"""
    rows = []
    for case in others(result):
        covariances = (np.asarray(case.sums["nees"])[..., 0] > 0).sum(1)
        for f, (name, counts) in enumerate(zip(case.axes.filters, np.asarray(case.sums["failures"]), strict=True)):
            for reason, count in (("any", counts[:3].sum()), *zip((*REASONS, IMPROPER), counts, strict=True)):
                if reason == IMPROPER and not (count or covariances[f]):
                    continue
                share = statistics.rate(count, case.count)
                row = {"case": case.name, "filter": name, "reason": reason, "n": case.count, "failed": int(count)}
                rows.append(row | {"share": statistics.Estimate(*map(float, share))})
    return common.of_rows(rows)


def consistency(result: CaseResult) -> common.Columns:
    """NEES of the components that a user filter estimates, where it gives covariances."""
    parts: list[common.Columns] = []
    for case in others(result):
        sums = np.asarray(case.sums["nees"])
        f, k = np.nonzero(sums[..., 0] > 1)
        n, total, square = np.moveaxis(sums[f, k], -1, 0)
        looks = int((sums[..., 0] > 1).sum(1).max(initial=1))
        mean, bounds = statistics.mean_square(total, square, n), notes.bounds_from_spread(total, square, n, looks)
        parts.append({**common.leading(case, f, k), "n": n.astype(np.int64), **notes.normalised("nees", mean, bounds)})
    return common.stacked(parts)


def added(
    tables_by_name: TablesByName, results: Sequence[CaseResult], measured_rows: TablesByName
) -> "dict[str, pd.DataFrame]":
    """The tables with the rows of user filters below their own; measured_rows: as of `measured`."""
    if not measured_rows:
        return dict(tables_by_name)
    with_user_filters = [result for result in results if result.outside is not None]
    user_cases = [case for result in results for case in others(result)]
    count = len(measured_rows["curves"])
    rows = {"curves": _append(tables_by_name["curves"], measured_rows["curves"]), "gains": measured_rows["gains"]}
    rows = notes.add_notes(rows, [*results, *user_cases], exact=False)
    rows["gains"] = _without_needless_notes(rows["gains"], with_user_filters)
    rows["curves"] = rows["curves"].tail(count)
    for name, table in rows.items():
        if "note" in table and not table["note"].any():
            rows[name] = table.drop(columns="note")
    rows["failures"] = common.joined(map(failures, with_user_filters))
    rows["nees"] = common.joined(map(consistency, with_user_filters))
    appended = {
        name: _append(tables_by_name[name], table) if name in tables_by_name else table
        for name, table in rows.items()
        if len(table)
    }
    return {**tables_by_name, **appended}


def _without_needless_notes(gains: "pd.DataFrame", with_user_filters: Sequence[CaseResult]) -> "pd.DataFrame":
    """Gains without notes where both filters are the same but for rounding, or differ a little in every realisation."""
    if "note" not in gains:
        return gains
    is_equal = gains["gain_hi"] - gains["gain_lo"] < SINGLE
    rests_on_few = np.concatenate([_rests_on_few(result) for result in with_user_filters])
    differs_everywhere = (note_kinds(gains) == notes.ALIKE.kind) & ~rests_on_few
    return gains.assign(note=gains["note"].mask(is_equal | differs_everywhere, ""))


def measured(results: Sequence[CaseResult]) -> TablesByName:
    """The curves and gains of user filters; nothing where there are none."""
    with_user_filters = [result for result in results if result.outside is not None]
    if not with_user_filters:
        return {}
    user_cases = [case for result in with_user_filters for case in others(result)]
    return {"curves": common.curves(user_cases), "gains": common.joined(map(gains, with_user_filters), common.GAINS)}


def for_claims(tables_by_name: TablesByName, measured_rows: TablesByName) -> TablesByName:
    """The tables with the rows of those that are `measured` below their own."""
    appended = {name: _append(tables_by_name[name], table) for name, table in measured_rows.items()}
    return {**tables_by_name, **appended}


def beside(name: str, table: "Callable[[Sequence[CaseResult]], pd.DataFrame]") -> Any:
    """A table of the study, made from results, with the rows of user filters: curves or gains."""

    def made(results: Sequence[CaseResult]) -> "pd.DataFrame":
        with_user_filters = [result for result in results if result.outside is not None]
        study_rows = table(results)
        if name == "curves":
            return _append(study_rows, common.curves([case for result in with_user_filters for case in others(result)]))
        if name == "gains":
            return _append(study_rows, common.joined(map(gains, with_user_filters), common.GAINS))
        return study_rows

    return made


def without(tables_by_name: TablesByName, results: Sequence[CaseResult]) -> TablesByName:
    """The tables without the rows of user filters, as the study made them."""
    user_filters = {name for result in results for case in others(result) for name in case.axes.filters}
    if not user_filters:
        return tables_by_name
    study_rows = {}
    for name in ("curves", "gains"):
        table = tables_by_name[name]
        labels = table.loc[:, table.columns.isin(("filter", "baseline"))]
        study_rows[name] = table[~labels.isin(user_filters).any(axis=1)]
    return {**study_rows, **{name: table for name, table in tables_by_name.items() if name not in study_rows}}


def _append(table: "pd.DataFrame", rows: "pd.DataFrame") -> "pd.DataFrame":
    """Rows below those of a table, whose columns they get, and `note`; empty cells where they lack one."""
    columns = [*table, *(["note"] if "note" in rows and "note" not in table else [])]

    def filled(part: "pd.DataFrame", other: "pd.DataFrame") -> "pd.DataFrame":
        blank = {n: "" if n == "note" or other[n].dtype == object else np.nan for n in columns if n not in part}
        return part.assign(**blank)[columns]

    return common.below([filled(table, rows), filled(rows, table)]) if len(table) else rows


# ---- question and answer ---------------------------------------------------------------------------------------------
def question(experiment: Experiment) -> str:
    """What an experiment with user filters asks; empty where it has none."""
    filters = list(dict.fromkeys(member.name for case in experiment.cases for member in case.outside))
    if len(filters) > 1:
        return tr("Are {names} better than the filters of the config?", names=few(filters))
    return tr("Is {name} better than the filters of the config?", name=filters[0]) if filters else ""


def answer(results: Sequence[CaseResult], tables_by_name: TablesByName) -> list[Sentence]:
    """How every user filter compares with the config's filters, case by case."""
    return [
        sentence
        for result in results
        for case in others(result)
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
    best_sigma: "pd.Series[Any]"  # of `curves`: that of the config's best filter
    rivals: Mapping[str, float]  # the config's best filter, then its best tuned one, if any; their σ, exact first

    @property
    def best(self) -> str:
        return next(iter(self.rivals))

    def gain_against(self, baseline: str) -> "pd.Series[Any]":
        return self.gains[self.gains["baseline"] == baseline].iloc[0]


def _filter_sentences(result: CaseResult, name: str, prefix: str, tables_by_name: TablesByName) -> list[Sentence]:
    """Whether a user filter is better than the config's best, how often it fails, then all gains at that scan."""
    gains = common.where(tables_by_name["gains"], case=result.name, filter=name)
    failing = _failing_clause(common.where(tables_by_name["failures"], case=result.name, filter=name), name)
    if not len(gains):
        no_estimate = tr("{name} has no estimate that could be compared", name=name)
        return [clause.with_text(f"{prefix}{clause.text}.") for clause in failing or [Sentence(no_estimate)]]

    comparison = _compare(result, name, gains, tables_by_name)
    verdict = _verdict_sentence(comparison)
    if failing:
        text = tr("{failing}, and in the others ", failing=failing[0].text)
        verdict = sentences.compose(text + verdict.text, [*failing, verdict])
    return [
        verdict.with_text(prefix + verdict.text),
        *_floor_sentence(comparison),
        *_further_gains(comparison),
        *_extreme_gains(gains, comparison),
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
        "{name} fails in {share} of the realisations ({reasons})", name=name, share=share, reasons=listed(reasons)
    )
    return [Sentence(text, sentences.intervals("failures", "share", total))]


def _compare(result: CaseResult, name: str, gains: "pd.DataFrame", tables_by_name: TablesByName) -> _Comparison:
    """The rows of the component and scan that the answer is about: those asked for, else the first and the last."""
    components = [component for component in result.axes.components if component[0] in set(gains["component"])]
    requested, t_s = others(result)[0].axes.judged_at or (components[0][0], np.inf)
    component, unit = next((c for c in components if c[0] == requested), components[0])
    gains = gains[gains["component"] == component]
    distance_s = (gains["t_s"] - min(t_s, gains["t_s"].max())).abs()
    gains = gains[gains["k"] == gains["k"][distance_s.idxmin()]]
    curves = common.where(tables_by_name["curves"], case=result.name, component=component, k=gains["k"].iloc[0])
    sigma = dict(zip(curves["filter"], common.exact_first(curves, "sigma", "exact_sigma"), strict=True))
    baselines = [baseline for baseline in gains["baseline"] if baseline in result.axes.filters]
    tuned = [baseline for baseline in baselines if baseline.endswith(TUNED)]
    best = min((baseline for baseline in baselines if baseline not in tuned), key=lambda baseline: sigma[baseline])
    rivals = [best, *sorted(tuned, key=lambda baseline: sigma[baseline])[:1]]
    rows = {row["filter"]: row for _, row in curves.iterrows()}
    unit = panels.unit_of(unit)
    return _Comparison(name, unit, gains, rows[name], rows[best], {rival: sigma[rival] for rival in rivals})


def _verdict_sentence(comparison: _Comparison) -> Sentence:
    """Whether a filter is better than the config's best one, and than its best tuned one; its σ, and theirs."""
    best, *tuned = comparison.rivals
    clauses = [_against_best(comparison, best), *(_against_tuned(comparison, rival) for rival in tuned)]
    sigma = wording.estimate((comparison.sigma[key] for key in SIGMA), comparison.unit)
    text = tr("its σ is {sigma}, {floor}.", sigma=sigma, floor=_best_sigma(comparison))
    given = sentences.intervals("curves", "sigma", comparison.sigma)
    if np.isnan(comparison.best_sigma["exact_sigma"]):
        given += sentences.intervals("curves", "sigma", comparison.best_sigma)
    verdict = sentences.join("", clauses)
    return sentences.compose(f"{verdict.text}; {text}", [verdict, Sentence(text, given)])


def _against_best(comparison: _Comparison, best: str) -> Sentence:
    row = comparison.gain_against(best)
    fields = {
        "name": comparison.name,
        "best": best,
        "component": row["component"],
        "t": numeral(f"{row['t_s']:g}"),
        "gain": _gain(row),
    }
    if row["gain_lo"] > 0:
        text = tr("{name} is better than {best}, the config's best in {component} at {t} s: gain {gain}", **fields)
    elif row["gain_hi"] < 0:
        text = tr("{name} is worse than {best}, the config's best in {component} at {t} s: gain {gain}", **fields)
    else:
        text = tr(
            "{name} cannot be distinguished from {best}, the config's best in {component} at {t} s: gain {gain}",
            **fields,
        )
    return Sentence(text, sentences.intervals("gains", "gain", row))


def _against_tuned(comparison: _Comparison, rival: str) -> Sentence:
    row = comparison.gain_against(rival)
    fields = {"best": rival, "gain": _gain(row)}
    if row["gain_lo"] > 0:
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
    above = wording.estimate((100 * (comparison.sigma[key] / lowest - 1) for key in SIGMA), "%", ".3g")
    rivals = [
        f"{name} {wording.number(round(100 * (sigma / lowest - 1), 2), 3)} %"
        for name, sigma in comparison.rivals.items()
    ]
    text = tr(
        "The floor there, {kind}, is {floor}: {name} is {own} above it, {others}.",
        kind=tr(UNBIASED if comparison.sigma["floor_kind"].startswith("CRB") else ANY),
        floor=f"{wording.number(lowest)} {comparison.unit}".rstrip(),
        name=comparison.name,
        own=above,
        others=listed(rivals),
    )
    if comparison.sigma["sigma_hi"] < lowest:
        text += " " + tr("Below it is only what is biased, or knows more than these plots.")
    return [Sentence(text, sentences.intervals("curves", "sigma", comparison.sigma))]


def _further_gains(comparison: _Comparison) -> list[Sentence]:
    """The gains at the same scan against all filters but the config's best."""
    rows = comparison.gains[comparison.gains["baseline"] != comparison.best]
    if not len(rows):
        return []
    against = [f"{row['baseline']} {_gain(row)}" for _, row in rows.iterrows()]
    text = tr("Further gains of {name} there: against {gains}.", name=comparison.name, gains=listed(against))
    return [Sentence(text, sentences.intervals("gains", "gain", rows))]


def _extreme_gains(gains: "pd.DataFrame", comparison: _Comparison) -> list[Sentence]:
    """The least and the largest gain against the config's best over all components and scans, if there are several."""
    if len(gains) <= len(comparison.gains):
        return []
    extremes = gains[gains["baseline"] == comparison.best].sort_values("gain_percent").iloc[[0, -1]]
    least, most = (
        tr("{gain} ({component} at {t} s)", gain=_gain(row), component=row["component"], t=numeral(f"{row['t_s']:g}"))
        for _, row in extremes.iterrows()
    )
    text = tr(
        "Over all components and scans its gain against {best} is from {least} to {most}.",
        best=comparison.best,
        least=least,
        most=most,
    )
    return [Sentence(text, sentences.intervals("gains", "gain", extremes))]


def _gain(row: "pd.Series[Any]") -> str:
    """A gain with its interval, to a thousandth of a per cent, its bounds outward: what is finer is rounding."""
    value, low, high = (float(row[key]) for key in GAIN)
    rounded = np.round(value, 3), np.floor(1e3 * low) / 1e3, np.ceil(1e3 * high) / 1e3
    return wording.estimate((number + 0.0 for number in rounded), "%", ".3g")


def _nees_sentences(result: CaseResult, name: str, tables_by_name: TablesByName) -> Iterator[Sentence]:
    """Whether the covariances of a user filter are right at the last scan, and how many are no covariances."""
    rows = common.where(tables_by_name["nees"], case=result.name, filter=name) if "nees" in tables_by_name else None
    if rows is not None and len(rows):
        row = rows.iloc[-1]
        nees = wording.estimate((row[key] for key in ("nees", "nees_lo", "nees_hi")), "", ".3g")
        text = tr(
            "NEES of {name} at {t} s: {nees} (1 if its covariance is right).", name=name, t=f"{row['t_s']:g}", nees=nees
        )
        yield Sentence(text, sentences.intervals("nees", "nees", row))
    improper = common.where(tables_by_name["failures"], case=result.name, filter=name, reason=IMPROPER)
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


# ---- figures ---------------------------------------------------------------------------------------------------------
def figures(
    results: Sequence[CaseResult],
    tables_by_name: TablesByName,
    experiment: Experiment,
    study_figures: Mapping[str, Figure],
    shown_components: Sequence[Component],
) -> dict[str, Figure]:
    """σ, gain and NEES over time with the user filters: in place of the study's figures of these names.

    σ and gain at least of the first component. shown_components: the components as the study calls them."""
    if not any(result.outside for result in results):
        return {}
    combined = [case for case, result in zip(joined(results), results, strict=True) if result.outside]
    by_name = {component.name: component for component in (*RADIAL, *shown_components)}
    components = [
        by_name.get(name, Component(name, unit, panels.letter(name), name))
        for name, unit in combined[0].axes.components
    ]
    rows = {**tables_by_name, "gains": common.against_own(tables_by_name["gains"], combined)}
    figures_by_name = panels.per_component(combined, rows, components, experiment)
    consistency = tables_by_name.get("consistency")
    if "nees" in tables_by_name and consistency is not None and {"t_s", "nees"} <= set(consistency) - {"component"}:
        nees = _append(consistency, tables_by_name["nees"])
        figures_by_name |= panels.consistency(panels.unswept(combined), nees, experiment)
    always = {f"{kind}_{components[0].name}" for kind in ("gain", "sigma")}
    return {name: figure for name, figure in figures_by_name.items() if name in study_figures or name in always}


def joined(results: Sequence[CaseResult]) -> list[CaseResult]:
    """The cases with user filters among their own, as figures that are drawn from tables alone need it."""
    return [_with_user_filters(result) if result.outside else result for result in results]


def _with_user_filters(result: CaseResult) -> CaseResult:
    (user_case,) = others(result)
    arrays = {
        name: np.concatenate([getattr(result.axes, name), getattr(user_case.axes, name)])
        for name in ("available", "exact_sigma", "exact_bias")
    }
    filters = (*result.axes.filters, *user_case.axes.filters)
    axes = replace(user_case.axes, filters=filters, baseline=result.axes.baseline, **arrays)
    return replace(result, axes=axes)
