"""What the report of folded Doppler asks and answers, in words."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Case, Experiment
from radarsim.language import listed, numeral, plural, tr
from radarsim.report import panels, rare, tables, wording
from radarsim.studies.ambiguous_doppler.kernels.records import BEYOND_SUM
from radarsim.studies.ambiguous_doppler.study import prepare, simulate
from radarsim.studies.ambiguous_doppler.tables import Result

if TYPE_CHECKING:
    import pandas as pd

AS_GOOD = 5.0  # per cent above the oracle's σ
HALF = 0.5  # share of realisations from which a filter counts as lost
# What brings a filter that loses its folds back to them: remedies tried on realisations of the same case.
TRIED = 400  # realisations: a share of a tenth is known to 1.5 points
HELPS = 0.1  # share of lost realisations up to which a remedy is one
SMOOTH_MPS2 = 10.0  # acceleration that the model of order 1 allows for: what keeps the lock through turns of some g
LARGER = 100.0  # times the manoeuvre variance
STAGGER = (1.0, 7 / 6, 4 / 3)  # times the repetition rate, used in turn
LOST = 100.0  # per cent above it, from which a σ is rather a share of lost tracks


def warnings(experiment: Experiment) -> list[str]:
    """Spans of velocity in which next to nothing can be unfolded: a line for each config and span."""
    lines: dict[str, None] = {}
    for case in experiment.cases:
        radar = case.spec.radar
        for span in radar.spans_mps:
            if span < 2 * radar.sigma_velocity_mps and any(one.folds for one in case.spec.filters):
                words = tr(
                    "its span of {span:g} m/s is under 2 σ_V, {sigma:g} m/s: next to nothing can be unfolded",
                    span=span,
                    sigma=2 * radar.sigma_velocity_mps,
                )
                lines[f"{case.stem}: radar.repetition_rate_hz: {words}"] = None
    return list(lines)


def question(experiment: Experiment) -> str:
    """What the experiment asks, in one sentence."""
    names = listed(list(dict.fromkeys(case.spec.device or case.stem for case in experiment.cases)))
    if any(one.folds for case in experiment.cases for one in case.spec.filters):
        return tr("How much is the folded velocity of {radars} worth, and from which scan on?", radars=names)
    return tr("Which filter order follows the target of {radars}, and how should several be combined?", radars=names)


def answer(results: Sequence[Result], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """For each case: from which scan on folded velocity is as good as unfolded, within 5 %; how often it is right.

    Of filters of several orders: the largest error of each over the scans, beside that of the best single order.
    First, of all cases: the filter of the least error, or in how many folded velocity is as good."""
    shown, others = panels.reported(results, 6)
    sentences = [sentence for result in shown for sentence in _sentences(result, made)]
    first = [*_least_of_all(results, made), *_of_all(results, made)]
    return [*first[:1], *sentences, *_cures(shown, made), *others]


def _largest(result: Result, made: "Mapping[str, pd.DataFrame]") -> "pd.DataFrame":
    """The row of each filter's largest σ of range over the scans; the first plot is common."""
    curves = tables.where(made["curves"], case=result.name, component="r")
    curves = curves[(curves["k"] > 1) & (curves["n"] > 0)]
    curves = curves.assign(decides=tables.exact_first(curves, "sigma", "exact_sigma"))
    return curves.loc[curves.groupby("filter", sort=False)["decides"].idxmax()]


def _sigma_m(row: Mapping) -> str:
    return wording.estimate((row["sigma"], row["sigma_lo"], row["sigma_hi"]), tr("m"))


def _least_of_all(results: Sequence[Result], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """The filter whose largest σ of range in any case is least, and the best of the other kind: one order, or several.
    None where no filter combines orders, or none had a plot."""
    combining = [result for result in results if result.axes.combines.any()]
    several = {one.name for result in combining for one in result.spec.filters if one.combine is not None}
    worst: dict[str, tuple[Any, Result]] = {}
    for result in combining:
        for row in _largest(result, made).to_dict("records"):
            if row["filter"] not in worst or row["decides"] > worst[row["filter"]][0]["decides"]:
                worst[row["filter"]] = row, result
    ranked = sorted(worst, key=lambda name: worst[name][0]["decides"])
    others = [name for name in ranked if (name in several) != (ranked[0] in several)]
    if not others:
        return []
    row, where = worst[others[0]]
    return [
        plural(
            "{best} keeps σ of the range after the first plot within {least}; {kind}, {other}, comes to {most} "
            "({where}).",
            "{best} keeps σ of the range after the first plot within {least} in all {count} cases; {kind}, {other}, "
            "comes to {most} ({where}).",
            len(combining),
            best=ranked[0],
            least=_sigma_m(worst[ranked[0]][0]),
            kind=tr("the best combination") if others[0] in several else tr("the best single order"),
            other=others[0],
            most=_sigma_m(row),
            where=panels.plain_label(where),
        )
    ]


def _of_all(results: Sequence[Result], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """Of several cases: in how many the filter that unfolds best is as good as unfolded velocity; and the worst."""
    found: dict[str, list[tuple[float, float, str]]] = {}
    for result in results if len(results) > 1 else ():
        for name in _told_of(result):
            if words := _as_good(result, name, made):
                above = _above(result, name, made)["above_oracle_percent"].iloc[-1]
                since = _since(result, name, made) or np.inf
                found.setdefault(name, []).append((since, above, f"{panels.plain_label(result)}: {words}"))
    if not found:
        return []
    good = {name: sum(np.isfinite(since) for since, _, _ in own) for name, own in found.items()}
    name = min(found, key=lambda one: (-good[one], max(found[one])))
    return [
        tr(
            "{filter}: as good as unfolded velocity, within {percent:g} %, in {good} of {count} cases by the last "
            "scan; {worst}.",
            filter=name,
            percent=AS_GOOD,
            good=good[name],
            count=len(found[name]),
            worst=max(found[name])[2],
        )
    ]


def _cures(results: Sequence[Result], made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """What helps the first filter that is lost, where something does of what is tried."""
    for result in results:
        for name in _told_of(result):
            folds = tables.where(made["folds"], case=result.name, filter=name)
            if not len(folds) or folds.iloc[-1]["beyond"] <= HALF:
                continue
            shares = [
                tr("{settings} ({share} % lost)", settings=settings, share=numeral(f"{100 * share:.2g}"))
                for settings, share in cures(result.spec, name, dict(result.swept))
            ]
            if not shares:
                return []
            told = {"case": panels.plain_label(result), "filter": name, "cures": "; ".join(shares), "count": TRIED}
            return [tr("{case}, {filter}: what helps, tried on {count} realisations: {cures}.", **told)]
    return []


def _sentences(result: Result, made: "Mapping[str, pd.DataFrame]") -> list[str]:
    axes, sentences = result.axes, []
    spans = wording.in_a_row(numeral(f"{span:g}") for span in result.spec.radar.spans_mps)
    for name in _told_of(result):
        where = f"{panels.plain_label(result)}, D = {spans} {tr('m/s')}, {name}"
        right = _wrong(result, name, made) or _right(result, name, made)
        clauses = list(filter(None, (_as_good(result, name, made), right)))
        if clauses:
            sentences.append(f"{where}: {'; '.join(clauses)}.")
    if axes.combines.any():
        sentences.extend(_orders_sentence(result, made))
    return sentences


def _told_of(result: Result) -> list[str]:
    """Of the filters that unfold those that are told of: the means over kept hypotheses, else all."""
    unfolding = [one for one in result.spec.filters if one.folds and one.combine in (None, "likelihood")]
    means = [one for one in unfolding if one.merge == "never" and one.estimate == "mean" and one.hypotheses > 1]
    return [one.name for one in means or unfolding]


def _orders_sentence(result: Result, made: "Mapping[str, pd.DataFrame]") -> list[str]:
    """The largest σ of range over the scans of every filter, and what is left to gain; the first plot is common. None
    where no realisation had a plot."""
    worst = _largest(result, made)
    if not len(worst):
        return []
    said = [
        tr("{filter}, {sigma} at scan {k}", filter=row["filter"], sigma=_sigma_m(row), k=row["k"])
        for row in worst.to_dict("records")
    ]
    axes = result.axes
    bounds = (axes.best_order[axes.combines, 1:, 0], axes.best_combination[axes.combines, 1:, 0])
    best, whole = (float(np.min(np.max(values, axis=1))) for values in bounds)
    words = [tr("largest σ of the range after the first plot: {filters}", filters="; ".join(said))]
    if np.isfinite(best) and np.isfinite(whole):
        words.append(
            tr(
                "with the trajectory known, the best order of each scan gives {best:.4g} m, the best combination "
                "{whole:.4g} m",
                best=best,
                whole=whole,
            )
        )
    elif np.isfinite(best):
        words.append(tr("with the trajectory known, the best order of each scan gives {best:.4g} m", best=best))
    return [f"{panels.plain_label(result)}: {'; '.join(words)}."]


def _right(result: Result, name: str, made: "Mapping[str, pd.DataFrame]") -> str:
    """How often all folds are right at the last scan; empty where no realisation had a plot."""
    rows = tables.where(made["folds"], case=result.name, filter=name)
    if not len(rows):
        return ""
    last = rows.iloc[-1]
    share = wording.share(*(100 * last[key] for key in ("right", "right_lo", "right_hi")))
    return tr("all folds are right in {share} of realisations at scan {k}", share=share, k=last["k"])


def _wrong(result: Result, name: str, made: "Mapping[str, pd.DataFrame]") -> str:
    """How often a fold is wrong at the last scan, by importance sampling; empty where it was not drawn so."""
    rows = tables.groups(made["rare"], "case", "filter") if result.spec.rare is not None else {}
    if (result.name, name) not in rows:
        return ""
    row = rows[result.name, name].iloc[0]
    return tr(
        "a fold is wrong at scan {k} in {rate:.3g} [{low:.3g}, {high:.3g}] of realisations, by importance sampling "
        "from {events:,} of them, {n_eff:,.0f} effective ones",
        k=row["k"],
        **rare.told(row),
    )


def _as_good(result: Result, name: str, made: "Mapping[str, pd.DataFrame]") -> str:
    """From which scan on σ of the velocity is within 5 % of the oracle's, for good; empty where it has none."""
    rows, folds = _above(result, name, made), tables.where(made["folds"], case=result.name, filter=name)
    if not len(rows):
        return ""
    if since := _since(result, name, made):
        return tr("as good as unfolded velocity, within {percent:g} %, from scan {k} on", percent=AS_GOOD, k=since)
    last, end = folds.iloc[-1], rows.iloc[-1]
    if end["above_oracle_percent"] > LOST:
        off = tr(
            "at scan {k}, the last, the velocity is off by more than half the span in {share} of realisations",
            k=end["k"],
            share=wording.share(*(100 * last[key] for key in ("beyond", "beyond_lo", "beyond_hi"))),
        )
        return tr("lost: {off}", off=off) if last["beyond"] > HALF else off
    keys = ("above_oracle_percent", "above_oracle_lo", "above_oracle_hi")
    told = {"above": wording.estimate((end[key] for key in keys), "%", ".3g"), "k": end["k"]}
    if end["above_oracle_percent"] <= AS_GOOD:
        return tr(
            "σ of the velocity is {above} above that of unfolded velocity at scan {k}, the last: too few realisations "
            "to tell whether within {percent:g} %",
            percent=AS_GOOD,
            **told,
        )
    return tr("σ of the velocity is still {above} above that of unfolded velocity at scan {k}, the last", **told)


def _above(result: Result, name: str, made: "Mapping[str, pd.DataFrame]") -> "pd.DataFrame":
    """The gains in the velocity of a filter that has an oracle beside it."""
    rows = tables.where(made["gains"], case=result.name, filter=name, component="Vr")
    return rows.dropna(subset=["above_oracle_percent"])


def _since(result: Result, name: str, made: "Mapping[str, pd.DataFrame]") -> int:
    """The scan from which on a filter is as good as its oracle, for good; 0 where it is not at the last one."""
    rows = _above(result, name, made)
    late = rows["above_oracle_hi"].to_numpy() > AS_GOOD
    return 0 if late[-1] else int(rows["k"].to_numpy()[int(late.nonzero()[0][-1]) + 1 if late.any() else 0])


def cures(spec: Any, name: str, swept: Iterable[str] = ()) -> Iterator[tuple[str, float]]:
    """The remedies that help a filter, as settings of the config, and the share of realisations it then loses.

    swept: keys that the config sweeps, which no setting may change beside it."""
    number, one = next((i, one) for i, one in enumerate(spec.filters) if one.name == name)
    key = f"filters.{number}"
    (variance, *_), rates = one.variances, spec.radar.rates_hz
    larger = LARGER * variance
    tried: list[tuple[str, Any, Any]] = []
    if one.combine is None:
        both = {"orders": (1, 2), "combine": "likelihood", "manoeuvre_variance": (SMOOTH_MPS2**2, variance)}
        said = f"--set {key}.orders=[1,2] --set {key}.combine=likelihood "
        said += f"--set {key}.manoeuvre_variance=[{SMOOTH_MPS2**2:g},{variance:g}]"
        tried.append((said, one.model_copy(update=both | {"stay_probability": 0.95}), spec.radar))
        said = f"--set {key}.manoeuvre_variance={larger:g}"
        tried.append((said, one.model_copy(update={"manoeuvre_variance": larger}), spec.radar))
    if len(rates) == 1:
        several = tuple(float(f"{factor * rates[0]:.4g}") for factor in STAGGER)
        said = f"--set radar.repetition_rate_hz=[{','.join(f'{rate:g}' for rate in several)}]"
        tried.append((said, one, spec.radar.model_copy(update={"repetition_rate_hz": several})))
    for said, changed, radar in tried:
        if any(f"--set {key}{end}" in said for key in swept for end in "=."):
            continue
        share = _lost(spec.model_copy(update={"radar": radar, "filters": (changed,), "baseline": None, "rare": None}))
        if share <= HELPS:
            yield said, share


@lru_cache(maxsize=64)  # an answer is asked once for each interval that may matter
def _lost(spec: Any) -> float:
    """The share of realisations in which the only filter's velocity is off by more than half the span at the end."""
    plan = prepare(Case("", "", "ambiguous_doppler", spec, (), TRIED, 1))
    arrays = plan.layout.unpack(simulate(plan, 0, TRIED))
    return float(arrays["folds"][0, -1, BEYOND_SUM] / arrays["estimates"][0, -1, 0])
