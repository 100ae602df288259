"""Tables, answer and figures of filters from outside beside those of a config: `CaseResult.outside`.

The study's own tables stay as they are; rows of these filters stand below. Their gains are against every filter of the
config, each over the realisations in which both have an estimate."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language import few, listed, numeral, term, tr
from radarsim.report import notes, panels, statistics, wording
from radarsim.report import tables as common
from radarsim.report.drawing import Figure
from radarsim.report.quantities import RADIAL, Component

if TYPE_CHECKING:
    import pandas as pd

Made = Mapping[str, "pd.DataFrame"]
ROUNDING = 1e-6  # per cent: half-width of a gain that is nought but for rounding, whose variance is a difference
IMPROPER = "not_positive_definite"  # covariances, counted after the reasons
SINGLE = 1e-3  # per cent: width of the interval of a gain that is nought but for rounding to single precision
TUNED = ", tuned"  # the end of the names of filters that `radarsim tune` has tuned
GAIN = ("gain_percent", "gain_lo", "gain_hi")
SIGMA = ("sigma", "sigma_lo", "sigma_hi")


# ---- tables ----------------------------------------------------------------------------------------------------------
def others(result: CaseResult) -> list[CaseResult]:
    """The filters from outside of a result as a case; none where it has none."""
    return [] if result.outside is None else [result.outside]


def names(result: CaseResult) -> tuple[str, ...]:
    """What gains may be against: the config's filters, its baseline first, then those from outside."""
    own, b = result.axes.filters, result.axes.baseline
    return (own[b], *own[:b], *own[b + 1 :], *(name for one in others(result) for name in one.axes.filters))


def gains(result: CaseResult) -> common.Columns:
    """Gains of the filters from outside of one case against all that come before them; then of the config's own
    against those that it names as baselines."""
    return common.stacked([_paired(*one) for one in _pairs(result)])


def _pairs(result: CaseResult) -> Iterator[tuple[np.ndarray, str, CaseResult]]:
    """Of every baseline its sums (F, K, C, 7) with a case's filters, its name, and the case."""
    for of in others(result):
        both, every = np.asarray(of.sums["both"]), (*result.axes.filters, *of.axes.filters)
        yield from ((both[:, every.index(base)], base, of) for base in names(result))
        for base in of.axes.baselines:
            own = both[of.axes.filters.index(base), : len(result.axes.filters)]
            yield own[..., [0, 3, 4, 1, 2, 5, 6]], base, result


def _rare(result: CaseResult) -> np.ndarray:
    """Which gains (rows,) rest on the few realisations in which two filters differ much."""
    found = []
    for both, _, of in _pairs(result):
        at = common.shown(of, both[..., 0] > 0)
        n, _, own_4, _, base_4, cross, fourth = np.moveaxis(both, -1, 0)
        found.append(notes.few_differ(own_4 + base_4 - 2 * cross, fourth, n)[at])
    return np.concatenate(found)


def _paired(both: np.ndarray, base: str, of: CaseResult) -> common.Columns:
    """Gains of a case's filters from sums (F, K, C, 7) with those of a baseline."""
    at = f, k, c = common.shown(of, both[..., 0] > 0)
    n, own, own_4, base_2, base_4, cross, _ = np.moveaxis(both[at], -1, 0)
    gain = statistics.gain(own, own_4, base_2, base_4, cross, n)
    return {
        **common.leading(of, f, k, baseline=np.full(f.size, base, dtype=object), **common.components(of, c)),
        "gain_percent|gain": statistics.Estimate(gain.value, gain.lo - ROUNDING, gain.hi + ROUNDING),
        "exact_percent": np.full(f.size, np.nan),
    }


def failures(result: CaseResult) -> common.Columns:
    """How often a filter from outside fails, by the reason; σ and gains count the others.

    reason: `any`, or `not_a_number` after an estimate, `no_estimate` though a filter of the config has one, `diverged`
        with an error over a hundred times the largest of the config's filters in the realisation; no failure, but no
        part of NEES, is `not_positive_definite`, a covariance
    failed: realisations
    share ±: of all realisations"""
    rows = []
    for one in others(result):
        given = (np.asarray(one.sums["nees"])[..., 0] > 0).sum(1)
        for f, (name, counts) in enumerate(zip(one.axes.filters, np.asarray(one.sums["failures"]), strict=True)):
            for reason, count in (("any", counts[:3].sum()), *zip((*REASONS, IMPROPER), counts, strict=True)):
                if reason == IMPROPER and not (count or given[f]):
                    continue
                share = statistics.rate(count, one.count)
                row = {"case": one.name, "filter": name, "reason": reason, "n": one.count, "failed": int(count)}
                rows.append(row | {"share": statistics.Estimate(*map(float, share))})
    return common.of_rows(rows)


REASONS = {  # in the order of the sums
    "not_a_number": term("not a number after an estimate:"),
    "no_estimate": term("no estimate:"),
    "diverged": term("over 100 times the largest error of the config's filters:"),
}


def consistency(result: CaseResult) -> common.Columns:
    """NEES of the components that a filter from outside estimates, where it gives covariances."""
    parts: list[common.Columns] = []
    for one in others(result):
        sums = np.asarray(one.sums["nees"])
        f, k = np.nonzero(sums[..., 0] > 1)
        n, total, square = np.moveaxis(sums[f, k], -1, 0)
        looks = int((sums[..., 0] > 1).sum(1).max(initial=1))
        mean, bounds = statistics.mean_square(total, square, n), notes.bounds_from_spread(total, square, n, looks)
        parts.append({**common.leading(one, f, k), "n": n.astype(np.int64), **notes.normalised("nees", mean, bounds)})
    return common.stacked(parts)


def added(made: Made, results: Sequence[CaseResult], own: Made) -> "dict[str, pd.DataFrame]":
    """The tables with the rows of filters from outside below their own; own: those that are `measured`."""
    if not own:
        return dict(made)
    outside = [one for result in results for one in others(result)]
    with_own = [one for one in results if one.outside is not None]
    rows = {"curves": _below(made["curves"], own["curves"]), "gains": own["gains"]}
    rows = notes.noted(rows, [*results, *outside], exact=False)
    if "note" in (found := rows["gains"]):
        equal = found["gain_hi"] - found["gain_lo"] < SINGLE  # but for rounding
        everywhere = found["note"].eq(notes.ALIKE) & ~np.concatenate([_rare(one) for one in with_own])
        found["note"] = found["note"].mask(equal | everywhere, "")
    rows["curves"] = rows["curves"].tail(len(own["curves"]))
    for name, table in rows.items():
        if "note" in table and not table["note"].any():
            rows[name] = table.drop(columns="note")
    rows["failures"] = common.joined(map(failures, with_own))
    rows["nees"] = common.joined(map(consistency, with_own))
    below = {name: _below(made[name], own) if name in made else own for name, own in rows.items() if len(own)}
    return {**made, **below}


def measured(results: Sequence[CaseResult]) -> Made:
    """The curves and gains of filters from outside; nothing where there are none."""
    with_own = [one for one in results if one.outside is not None]
    if not with_own:
        return {}
    outside = [one for result in with_own for one in others(result)]
    return {"curves": common.curves(outside), "gains": common.joined(map(gains, with_own), common.GAINS)}


def for_claims(made: Made, own: Made) -> Made:
    """The tables with the rows of those that are `measured` below their own."""
    return {**made, **{name: _below(made[name], table) for name, table in own.items()}}


def beside(name: str, table: "Callable[[Sequence[CaseResult]], pd.DataFrame]") -> Any:
    """A table of the study, made from results, with the rows of filters from outside: curves or gains."""

    def made(results: Sequence[CaseResult]) -> "pd.DataFrame":
        with_own = [one for one in results if one.outside is not None]
        rows = {
            "curves": lambda: common.curves([one for result in with_own for one in others(result)]),
            "gains": lambda: common.joined(map(gains, with_own), common.GAINS),
        }
        own = table(results)
        return _below(own, rows[name]()) if name in rows else own

    return made


def without(made: Made, results: Sequence[CaseResult]) -> Made:
    """The tables without these rows, as the study made them."""
    own = {name for result in results for one in others(result) for name in one.axes.filters}
    rows = {name: made[name].loc[:, made[name].columns.isin(("filter", "baseline"))] for name in ("curves", "gains")}
    return {name: made[name][~table.isin(own).any(axis=1)] for name, table in rows.items()} | {
        name: table for name, table in made.items() if name not in ("curves", "gains")
    } if own else made  # fmt: skip


def _below(above: "pd.DataFrame", below: "pd.DataFrame") -> "pd.DataFrame":
    """Rows below those of a table, whose columns they get, and `note`; empty cells where they lack one."""
    columns = [*above, *(["note"] if "note" in below and "note" not in above else [])]

    def filled(table: "pd.DataFrame", other: "pd.DataFrame") -> "pd.DataFrame":
        blank = {n: "" if n == "note" or other[n].dtype == object else np.nan for n in columns if n not in table}
        return table.assign(**blank)[columns]

    return common.below([filled(above, below), filled(below, above)]) if len(above) else below


# ---- question and answer ---------------------------------------------------------------------------------------------
def question(experiment: Experiment) -> str:
    """What an experiment with filters from outside asks; empty where it has none."""
    every = list(dict.fromkeys(one.name for case in experiment.cases for one in case.outside))
    if len(every) > 1:
        return tr("Are {names} better than the filters of the config?", names=few(every))
    return tr("Is {name} better than the filters of the config?", name=every[0]) if every else ""


def answers(results: Sequence[CaseResult]) -> "list[notes.Answer]":
    """What says how the filters from outside do, a part for each."""
    several = len(results) > 1
    return [
        partial(_said, result, name, f"{result.name}: " if several else "")
        for result in results
        for one in others(result)
        for name in one.axes.filters
    ]


def _said(result: CaseResult, name: str, case: str, made: Made) -> list[str]:
    """Whether the filter is better than the config's best, how often it fails, then all gains at the last scan."""
    rows = common.where(made["gains"], case=result.name, filter=name)
    fails, *why = common.where(made["failures"], case=result.name, filter=name).to_dict("records")
    share = wording.share(*(100 * fails[key] for key in ("share", "share_lo", "share_hi")))
    reasons = listed(
        [f"{tr(REASONS[one['reason']])} {one['failed']:,}" for one in why if one["failed"] and one["reason"] in REASONS]
    )
    failing = tr("{name} fails in {share} of the realisations ({reasons})", name=name, share=share, reasons=reasons)
    if not len(rows):
        none = tr("{name} has no estimate that could be compared", name=name)
        return [f"{case}{failing if fails['failed'] else none}."]
    start = case + (tr("{failing}, and in the others ", failing=failing) if fails["failed"] else "")
    there = [one for one in result.axes.components if one[0] in set(rows["component"])]
    wanted, at_s = others(result)[0].axes.judged_at or (there[0][0], np.inf)
    component, unit = next((one for one in there if one[0] == wanted), there[0])
    of = rows[rows["component"] == component]
    away = (of["t_s"] - min(at_s, of["t_s"].max())).abs()
    last = of[of["k"] == of["k"][away.idxmin()]]
    curves = common.where(made["curves"], case=result.name, component=component, k=last["k"].iloc[0])
    sigma = dict(zip(curves["filter"], common.exact_first(curves, "sigma", "exact_sigma"), strict=True))
    own = [base for base in last["baseline"] if base in result.axes.filters]
    tuned = [base for base in own if base.endswith(TUNED)]
    best = min((base for base in own if base not in tuned), key=lambda base: sigma[base])
    row = last[last["baseline"] == best].iloc[0]
    told: dict[str, Any] = {"name": name, "best": best, "component": component, "t": numeral(f"{row['t_s']:g}")}
    told["gain"] = _gain(row)
    if row["gain_lo"] > 0:
        first = tr("{name} is better than {best}, the config's best in {component} at {t} s: gain {gain}", **told)
    elif row["gain_hi"] < 0:
        first = tr("{name} is worse than {best}, the config's best in {component} at {t} s: gain {gain}", **told)
    else:
        first = tr(
            "{name} cannot be distinguished from {best}, the config's best in {component} at {t} s: gain {gain}", **told
        )
    rivals = [best, *sorted(tuned, key=lambda base: sigma[base])[:1]]
    if tuned:
        rival = last[last["baseline"] == rivals[1]].iloc[0]
        told |= {"best": rival["baseline"], "gain": _gain(rival)}
        if rival["gain_lo"] > 0:
            first += tr(", and better than {best}: gain {gain}", **told)
        elif rival["gain_hi"] < 0:
            first += tr(", and worse than {best}: gain {gain}", **told)
        else:
            first += tr(", and cannot be distinguished from {best}: gain {gain}", **told)
        own_sigma = f"{wording.number(sigma[rival['baseline']])} {panels.unit_of(unit)}"
        first += tr(", whose σ is {sigma}", sigma=own_sigma.rstrip())
    mine = curves[curves["filter"] == name].iloc[0]
    sigmas = wording.estimate((mine[key] for key in SIGMA), panels.unit_of(unit))
    said = [start + first + "; " + tr("its σ is {sigma}, {floor}.", sigma=sigmas, floor=_floor(curves, best, unit))]
    said += _above_floor(mine, {one: sigma[one] for one in rivals}, panels.unit_of(unit))
    against = [f"{one['baseline']} {_gain(one)}" for one in last.to_dict("records") if one["baseline"] != best]
    if against:
        said.append(tr("Further gains of {name} there: against {gains}.", name=name, gains=listed(against)))
    extremes = rows[rows["baseline"] == best].sort_values("gain_percent").iloc[[0, -1]].to_dict("records")
    ends = [
        tr("{gain} ({component} at {t} s)", gain=_gain(one), component=one["component"], t=numeral(f"{one['t_s']:g}"))
        for one in extremes
    ]
    if len(rows) > len(last):
        said.append(tr("Over all components and scans its gain against {best} is from {least} to {most}.",
                       best=best, least=ends[0], most=ends[1]))  # fmt: skip
    return [*said, *_nees(result, name, made)]


def _gain(row: Any) -> str:
    """A gain with its interval, to a thousandth of a per cent, its ends outward: what is finer is rounding."""
    value, lo, hi = (float(row[key]) for key in GAIN)
    rounded = np.round(value, 3), np.floor(1e3 * lo) / 1e3, np.ceil(1e3 * hi) / 1e3
    return wording.estimate((one + 0.0 for one in rounded), "%", ".3g")


def _floor(curves: "pd.DataFrame", best: str, unit: str) -> str:
    """How far the least σ that is known exactly lies, in words."""
    row = curves[curves["filter"] == best].iloc[0]
    if np.isnan(row["exact_sigma"]):
        return tr("that of {best} {sigma}", best=best, sigma=wording.estimate(
            (row[key] for key in SIGMA), panels.unit_of(unit)))  # fmt: skip
    return tr("that of {best} {sigma} {unit} exactly", best=best, sigma=wording.number(row["exact_sigma"]),
              unit=panels.unit_of(unit))  # fmt: skip


def _above_floor(mine: Any, rivals: Mapping[str, float], unit: str) -> Iterator[str]:
    """How far the filter from outside, a row of its curve, the config's best, and the best tuned one are from the
    floor."""
    name = mine["filter"]
    least = float(mine["floor"])
    if not np.isnan(least):
        own = wording.estimate((100 * (mine[key] / least - 1) for key in SIGMA), "%", ".3g")
        others = [f"{one} {wording.number(round(100 * (of / least - 1), 2), 3)} %" for one, of in rivals.items()]
        told = {"name": name, "own": own, "floor": f"{wording.number(least)} {unit}".rstrip(), "others": listed(others)}
        kind = tr(UNBIASED if mine["floor_kind"].startswith("CRB") else ANY)
        said = tr("The floor there, {kind}, is {floor}: {name} is {own} above it, {others}.", kind=kind, **told)
        if mine["sigma_hi"] < least:
            said += " " + tr("Below it is only what is biased, or knows more than these plots.")
        yield said


UNBIASED = term("the Cramér-Rao bound of unbiased estimators")
ANY = term("the posterior Cramér-Rao bound")


def _nees(result: CaseResult, name: str, made: Made) -> Iterator[str]:
    """What its covariances are worth at the last scan."""
    rows = common.where(made["nees"], case=result.name, filter=name) if "nees" in made else None
    if rows is not None and len(rows):
        row = rows.iloc[-1]
        nees = wording.estimate((row[key] for key in ("nees", "nees_lo", "nees_hi")), "", ".3g")
        told = {"name": name, "t": f"{row['t_s']:g}", "nees": nees}
        yield tr("NEES of {name} at {t} s: {nees} (1 if its covariance is right).", **told)
    none = common.where(made["failures"], case=result.name, filter=name, reason=IMPROPER)
    if len(none) and (count := int(none["failed"].iloc[0])):
        yield tr("In {count:,} of {n:,} realisations {name} gives a covariance that is not positive definite: it is no "
                 "part of NEES.", count=count, n=int(none["n"].iloc[0]), name=name)  # fmt: skip


# ---- figures ---------------------------------------------------------------------------------------------------------
def figures(
    results: Sequence[CaseResult],
    made: Made,
    experiment: Experiment,
    drawn: Mapping[str, Figure],
    shown: Sequence[Component],
) -> dict[str, Figure]:
    """σ, gain and NEES over time with the filters from outside: in place of the study's figures of these names, σ and
    gain at least of the first component. shown: the components as the study calls them."""
    if not any(result.outside for result in results):
        return {}
    joint = [one for one, result in zip(joined(results), results, strict=True) if result.outside]
    known = {one.name: one for one in (*RADIAL, *shown)}
    each = [
        known.get(name, Component(name, unit, panels.letter(name), name)) for name, unit in joint[0].axes.components
    ]
    rows = {**made, "gains": common.against_own(made["gains"], joint)}
    found = panels.per_component(joint, rows, each, experiment)
    if "nees" in made and "consistency" in made and {"t_s", "nees"} <= set(made["consistency"]) - {"component"}:
        every = _below(made["consistency"], made["nees"])
        found |= panels.consistency(panels.unswept(joint), every, experiment)
    first = {f"{kind}_{each[0].name}" for kind in ("gain", "sigma")}
    return {name: figure for name, figure in found.items() if name in drawn or name in first}


def joined(results: Sequence[CaseResult]) -> list[CaseResult]:
    """The cases with filters from outside among their own, as figures that are drawn from tables alone need it."""
    return [_joint(result) if result.outside else result for result in results]


def _joint(result: CaseResult) -> CaseResult:
    (of,) = others(result)
    together = {
        name: np.concatenate([getattr(result.axes, name), getattr(of.axes, name)])
        for name in ("available", "exact_sigma", "exact_bias")
    }
    filters = (*result.axes.filters, *of.axes.filters)
    return replace(result, axes=replace(of.axes, filters=filters, baseline=result.axes.baseline, **together))
