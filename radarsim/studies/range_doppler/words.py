"""What the report of P1's experiments asks and answers, in words."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.config.experiment import Case, Experiment
from radarsim.language import listed, numeral, plural, term, tr
from radarsim.report import panels, tables, wording
from radarsim.report.quantities import RADIAL
from radarsim.studies.range_doppler import tuning
from radarsim.studies.range_doppler.config import FOLDED, Best, can_fold, variance_of
from radarsim.studies.range_doppler.study import prepare
from radarsim.studies.range_doppler.tables import PERIODS, Result, follows_the_model, span_mps, steady_sigma

if TYPE_CHECKING:
    import pandas as pd

Made = Mapping[str, "pd.DataFrame"]


def question(experiment: Experiment) -> str:
    """What the experiment asks, in one sentence."""
    filters = list(dict.fromkeys(f.name for case in experiment.cases for f in case.spec.filters))
    names = list(dict.fromkeys(getattr(case.spec.radar, "name", None) or case.stem for case in experiment.cases))
    if any("velocity" in f.observes for case in experiment.cases for f in case.spec.filters):
        return tr("How much does observing the radial velocity lower the errors of {radars}?", radars=listed(names))
    return tr("How large are the errors of {radars} with {filters}?", radars=listed(names), filters=listed(filters))


def answer(results: Sequence[Result], made: Made) -> list[str]:
    """Sentences with numbers and 95 % intervals: the gains at the last scan, component by component.

    Of cases that nothing is swept in, where there are such; the greatest loss of any case at any scan is given with
    them. Further: the best D_M where several are tried, first where nothing but D_M is asked for, and the worst error
    where a target breaks the model; the D_M that was looked for; and how the radar's velocities are taken."""
    gains = _gain_sentences(results, made)
    best = [*_best_sentences(results, made), *_best_of_broken(results, made)]
    sentences = [*best, *gains] if _asks_for_variance(results) else [*gains, *best]
    return [*sentences, *_broken_sentences(results, made), *_looked_for(results), *_ambiguity(results)]


def _asks_for_variance(results: Sequence[Result]) -> bool:
    """Whether every case is one of a sweep over the manoeuvre variance."""
    return all("manoeuvre_variance" in dict(result.swept) for result in results)


def _gain_sentences(results: Sequence[Result], made: Made) -> list[str]:
    plain = panels.unswept(results)
    rows = made["gains"][made["gains"]["case"].isin([result.name for result in plain])]
    gains, every = tables.groups(rows, "component"), tables.groups(made["gains"], "component")
    labels = {result.name: panels.plain_label(result) for result in results}
    sentences = [
        _gain_sentence(plain, gains[(of.name,)], every[(of.name,)], of.words, labels)
        for of in RADIAL
        if (of.name,) in gains
    ]
    return sentences or [_sigma_sentence(results[0], made["curves"])]


class _Moment(NamedTuple):
    """The rows of a table at which cases are compared: one for each case and filter; and when that is."""

    rows: "pd.DataFrame"
    when: str


def _compared(rows: "pd.DataFrame") -> _Moment:
    """The last scan, where all cases end together; else the last time that all of them have in common."""
    last = rows.loc[rows.groupby(["case", "filter"], sort=False)["k"].idxmax()]
    early, late = last["t_s"].min(), last["t_s"].max()
    if early == late:
        return _Moment(last, tr("at {t_s:g} s", t_s=early))
    times = [set(np.round(own["t_s"], 6)) for own in tables.groups(rows, "case", "filter").values()]
    shared = set.intersection(*times) - {0.0}
    if not shared:
        return _Moment(last, tr("at the last scan (after {early:g} to {late:g} s)", early=early, late=late))
    at = max(shared)
    when = tr("at {t_s:g} s, the last time that all have in common,", t_s=at)
    return _Moment(rows[np.round(rows["t_s"], 6) == at], when)


def _gain_sentence(
    results: Sequence[Result], rows: "pd.DataFrame", every: "pd.DataFrame", quantity: str, labels: dict[str, str]
) -> str:
    """The gain of one quantity at the last scan, or at the last common time.

    rows: its gains in the cases told of; every: in all cases, among which the greatest loss is looked for."""
    last, when = _compared(rows)
    several = rows["filter"].nunique() > 1
    said: dict[str, Any] = {"quantity": _capital(quantity), "when": when, "base": _baseline(results)}
    if len(last) > 1:
        low, high = (last.iloc[int(pick(last["gain_percent"].to_numpy()))] for pick in (np.argmin, np.argmax))
        said |= {"least": _gain(low), "low": _who(low, labels, several)}
        said |= {"most": _gain(high), "high": _who(high, labels, several)}
        if last["gain_lo"].max() <= last["gain_hi"].min():
            words = tr(
                "{quantity}: {when} σ is {least} ({low}) to {most} ({high}), not significantly different from "
                "each other, {base}",
                **said,
            )
        else:
            words = tr("{quantity}: {when} σ is {least} ({low}) to {most} ({high}) {base}", **said)
        later = [f"{gain} ({_who(row, labels, several)})" for row in (low, high) if (gain := _later(results, row))]
        return "; ".join([words, *_not_settled(listed(later)), *_loss(every, low, labels)]) + "."
    row = last.iloc[0]
    best = rows.iloc[int(_decides(rows).argmax())]
    clauses = [
        tr("{quantity}: at {t_s:g} s, the last scan, σ is {gain} {base}", t_s=row["t_s"], gain=_gain(row), **said)
    ]
    clauses += _not_settled(_later(results, row))
    if best["k"] != row["k"]:
        clauses.append(tr("at best {gain}, at {t_s:g} s", gain=_gain(best), t_s=best["t_s"]))
    return "; ".join([*clauses, *_loss(every, row, labels)]) + "."


UNSETTLED = 1.0  # per cent: a gain further than this from that of the long run has not settled


def _not_settled(later: str) -> list[str]:
    """The clause on gains of the long run, where there are such."""
    return [tr("not settled: {gains} in the long run", gains=later)] if later else []


def _later(results: Sequence[Result], row: "pd.Series[Any]") -> str:
    """What a gain comes to in the long run, exact, in words; nothing where it has settled or that is not known. Where
    plots may be missed it is of the same radar with every plot, now and in the long run."""
    result = next(one for one in results if one.name == row["case"])
    axes, spec = result.axes, result.spec
    whole = spec.radar.model_copy(update={"detection_probability": 1.0})
    if not follows_the_model(result) or not whole.as_the_papers:
        return ""
    if not axes.plain:
        spec = spec.model_copy(update={"radar": whole})
        axes = prepare(Case(result.name, panels.stem(result), result.study, spec, (), 1, 1)).axes
    f, c = axes.filters.index(row["filter"]), [name for name, _ in axes.components].index(row["component"])
    own, base = (steady_sigma(axes, one) for one in (f, axes.baseline))
    if own is None or base is None:
        return ""
    gain = 100 * (1 - float(own[c] / base[c]))
    if not abs(axes.exact_gains[f, row["k"] - 1, c] - gain) > UNSETTLED:
        return ""
    percent = f"{numeral(f'{abs(gain):.1f}')} %"
    said = tr("{percent} lower", percent=percent) if gain > 0 else tr("{percent} higher", percent=percent)
    return said if result.axes.plain else tr("{gain} with every plot", gain=said)


def _decides(gains: "pd.DataFrame", end: str = "gain_percent") -> np.ndarray:
    """The gains (rows,), or an end of their intervals, by which one is called more than another: exact ones first."""
    return tables.exact_first(gains, end, "exact_percent")


def _capital(word: str) -> str:
    """A word that begins a sentence."""
    said = tr(word)
    return said[:1].upper() + said[1:]


LOSS = 1.0  # per cent: a gain certainly below minus this, at any scan, is told


def _loss(every: "pd.DataFrame", sentences: "pd.Series[Any]", labels: dict[str, str]) -> list[str]:
    """The greatest of the certain losses in words, unless there is none or it is the gain already told."""
    sure = every[_decides(every, "gain_hi") < -LOSS]
    if not len(sure):
        return []
    worst = sure.iloc[int(_decides(sure).argmin())]
    if worst.name == sentences.name:
        return []
    several = every["filter"].nunique() > 1
    gain, at = _gain(worst), worst["t_s"]
    if several or every["case"].nunique() > 1:
        who = _who(worst, labels, several)
        return [tr("at worst {gain}, at {t_s:g} s, with {who}", gain=gain, t_s=at, who=who)]
    return [tr("at worst {gain}, at {t_s:g} s", gain=gain, t_s=at)]


def _baseline(results: Sequence[Result]) -> str:
    """Than what a gain is: range alone only where the baseline filter, and no other, observes no more."""
    bases = [result.spec.filters[result.axes.baseline] for result in results]
    given = {one for one in map(variance_of, bases) if isinstance(one, float)}
    alone = [one.name for result in results for one in result.spec.filters if one.observes == ("range",)]
    if all(base.observes == ("range",) for base in bases) and len(alone) == len(bases):
        if len(given) > 1:
            return tr("than with range alone at the same D_M")
        return tr("than with range alone")
    if len({base.name for base in bases}) == 1:
        return tr("than with filter '{filter}'", filter=bases[0].name)
    return tr("than with the baseline filter")


def _best_sentences(results: Sequence[Result], made: Made) -> list[str]:
    """The best manoeuvre variance of each radar and filter, in words, where several were tried."""
    table = made["steady"]
    sentences: list[str] = []
    for members in panels.families(results).values():
        rows = table[table["case"].isin([r.name for r in members]) & (table["component"] == "r")]
        if rows.groupby("filter")["manoeuvre_variance"].nunique().max() > 1:
            tried = rows[rows["manoeuvre_variance"].notna()]  # a filter of a package may have none
            chosen = [_best(own, str(name)) for name, own in tried.groupby("filter", sort=False)]
            sentences.append(f"{panels.plain(panels.device(members[0]))}: {'; '.join(chosen)}.")
    if not sentences:
        return []
    rule = plural(
        "Best manoeuvre variance D_M, (m/s³)² (least steady σ of the range among those that settle in under {count} "
        "scan period).",
        "Best manoeuvre variance D_M, (m/s³)² (least steady σ of the range among those that settle in under {count} "
        "scan periods).",
        PERIODS,
    )
    return [f"{rule} {sentences[0]}", *sentences[1:]]


def _best(rows: "pd.DataFrame", name: str) -> str:
    best = rows[rows["best"]]
    if not len(best):
        return tr("{filter} none of the values tried", filter=name)
    row = best.iloc[0]
    variance = panels.number(float(row["manoeuvre_variance"]), powers=True)
    return tr(
        "{filter} {variance} (σ {sigma:.4g} m, settled after {settling:g} s)",
        filter=name,
        variance=variance,
        sigma=row["steady_sigma"],
        settling=row["settling_s"],
    )


FIRST = 3  # the scan from which on errors count when a D_M is the best on a manoeuvring target


def _tried_on(results: Sequence[Result]) -> dict[str, list[Result]]:
    """Cases of targets that break the model and differ in the D_M given, by what else they are."""
    found: dict[str, list[Result]] = {}
    for result in results:
        if not follows_the_model(result):
            others = ", ".join(
                f"{panels.symbol_of(result, key)} = {panels.with_its_unit(result, key, v)}"
                for key, v in result.swept
                if not _is_variance(key)
            )
            found.setdefault(", ".join(filter(None, (panels.device(result), others))), []).append(result)
    return {name: members for name, members in found.items() if len(members) > 1 and all(map(_given, members))}


def _is_variance(key: str) -> bool:
    return key.rpartition(".")[2] == "manoeuvre_variance"


def _given(result: Result) -> bool:
    return any(_is_variance(key) for key, _ in result.swept) and not _tuned(result)


def _best_of_broken(results: Sequence[Result], made: Made) -> list[str]:
    """The D_M of those tried with which the worst error on a manoeuvring target is least, by radar and filter."""
    curves, sentences = made["curves"], []
    rows = curves[(curves["component"] == "r") & (curves["k"] >= FIRST)]
    rows = rows.assign(error=tables.exact_first(rows, "sigma", "exact_sigma"))
    for name, members in _tried_on(results).items():
        own = rows[rows["case"].isin([member.name for member in members])]
        names = zip(members[0].axes.filters, members[0].axes.manoeuvre_variance, strict=True)
        words = [_least_worst(own[own["filter"] == one], members, one) for one, D_M in names if not np.isnan(D_M)]
        sentences.append(f"{panels.plain(name)}: {'; '.join(words)}.")
    if not sentences:
        return []
    rule = tr(
        "Best manoeuvre variance D_M, (m/s³)², on a target that breaks the filters' model (least worst σ of the range "
        "from scan {k} on).",
        k=FIRST,
    )
    return [f"{rule} {sentences[0]}", *sentences[1:]]


def _least_worst(rows: "pd.DataFrame", members: Sequence[Result], name: str) -> str:
    worst = rows.loc[rows.groupby("case", sort=False)["error"].idxmax()]
    row = worst.iloc[int(worst["error"].to_numpy().argmin())]
    result = next(member for member in members if member.name == row["case"])
    variance = float(result.axes.manoeuvre_variance[result.axes.filters.index(name)])
    return tr(
        "{filter} {variance} (σ at worst {sigma:.4g} m, at {t_s:g} s)",
        filter=name,
        variance=panels.number(variance, powers=True),
        sigma=row["error"],
        t_s=row["t_s"],
    )


MOST_TOLD = 4  # cases with a broken model told in the answer


def _broken_sentences(results: Sequence[Result], made: Made) -> list[str]:
    """Where a target breaks the model: the worst σ of the range over the run, and the largest bias, of each filter."""
    compared = {member.name for members in _tried_on(results).values() for member in members}
    broken = [result for result in results if not follows_the_model(result) and result.name not in compared]
    rows = tables.groups(tables.where(made["curves"], component="r"), "case", "filter")
    sentences = []
    for result in broken[:MOST_TOLD]:
        words = [f"{name}: {_worst(rows[result.name, name])}" for name in result.axes.filters]
        sentences.append(
            tr(
                "{case}, a target that breaks the filters' model: {filters}.",
                case=panels.plain_label(result),
                filters="; ".join(words),
            )
        )
    left = len(broken) - len(sentences)
    if left:
        sentences.append(
            plural(
                "{count} further case breaks the model: see curves.csv.",
                "{count} further cases break the model: see curves.csv.",
                left,
            )
        )
    return sentences


def _tuned(result: Result) -> list[tuple[str, Best, float]]:
    """The filters whose D_M was looked for: name, what was to be least, what was found."""
    found = zip(result.spec.filters, result.axes.manoeuvre_variance, strict=True)
    return [
        (one.name, wanted, float(variance)) for one, variance in found if isinstance(wanted := variance_of(one), Best)
    ]


OVER = {
    "worst": term("{error} is least at its worst from scan {k} on"),
    "mean": term("{error} is least on average from scan {k} on"),
    "last": term("{error} is least at the last scan"),
}


def _looked_for(results: Sequence[Result]) -> list[str]:
    """The D_M that were looked for."""
    sentences = []
    for result in [result for result in results if _tuned(result)][:MOST_TOLD]:
        axes, words = result.axes, []
        for name, wanted, variance in _tuned(result):
            said = {
                "filter": name,
                "variance": panels.number(variance, powers=True),
                "rule": tr(OVER[wanted.over], error=wanted.minimise, k=wanted.from_k),
            }
            if tuning.at_a_limit(variance, len(axes.t_s), axes.sigma, axes.scan_period_s):
                words.append(tr("{filter} {variance} ({rule}, the limit of the search: no minimum inside)", **said))
            else:
                words.append(tr("{filter} {variance} ({rule})", **said))
        sentences.append(
            tr(
                "{case}: D_M, (m/s³)², optimised on the exact errors: {filters}.",
                case=panels.plain_label(result),
                filters="; ".join(words),
            )
        )
    return sentences


def _ambiguity(results: Sequence[Result]) -> list[str]:
    """That velocities are not folded, where a config gives the repetition rate."""
    sentences: dict[str, str] = {}
    folds = all(can_fold(result.spec) for result in results)
    for result in results:
        if "repetition_rate_hz" in result.spec.radar.model_fields_set and (result.axes.observes == 2).any():
            span, speed = span_mps(result), result.axes.speed_mps
            if 2 * speed < span:
                words = tr("a span of {span:.4g} m/s", span=span)
            else:
                words = tr("a span of {span:.4g} m/s, exceeded by the target's {speed:.4g} m/s", span=span, speed=speed)
            sentences.setdefault(panels.plain(panels.device(result)), words)
    if not sentences:
        return []
    return [
        tr(
            "Velocities are assumed unambiguous; the repetition rate alone distinguishes only λF/2 ({spans}).",
            spans="; ".join(f"{name}: {span}" for name, span in sentences.items()),
        ),
        *([tr("With folded velocities: the same command with {setting}.", setting=f"--set {FOLDED}")] if folds else []),
    ]


def _worst(rows: "pd.DataFrame") -> str:
    worst, bias = (
        rows.iloc[int(np.abs(tables.exact_first(rows, name, f"exact_{name}")).argmax())] for name in ("sigma", "bias")
    )
    return tr(
        "worst σ of the range {sigma} at {t_s:g} s, largest bias {bias:.4g} m at {bias_t_s:g} s",
        sigma=wording.estimate((worst[key] for key in SIGMA), tr("m")),
        t_s=worst["t_s"],
        bias=bias["bias"],
        bias_t_s=bias["t_s"],
    )


SIGMA = ("sigma", "sigma_lo", "sigma_hi")
TOLD = 0.05  # per cent: what is not nil to one decimal
MANIFOLD = 100.0  # per cent of loss from which it is told as a factor


def _gain(row: "pd.Series[Any]") -> str:
    """A gain in words: lower, higher, or neither for certain; where the sample cannot tell, by the exact one."""
    value, lo, hi = (round(float(row[name]), 1) + 0.0 for name in ("gain_percent", "gain_lo", "gain_hi"))
    if value == lo == hi == 0:
        return tr("less than 0.1 % lower or higher")
    exact = float(row.get("exact_percent", np.nan))
    if row["gain_lo"] <= 0 <= row["gain_hi"] and abs(exact) >= TOLD:
        words = term("exactly {percent} lower") if exact > 0 else term("exactly {percent} higher")
        return tr(words, percent=f"{numeral(f'{abs(exact):.1f}')} %")
    if row["gain_lo"] <= 0 <= row["gain_hi"]:
        return tr("not significantly lower or higher (gain {gain})", gain=_percent(value, lo, hi))
    if value < -MANIFOLD:
        factor = wording.estimate((1 - value / 100, 1 - hi / 100, 1 - lo / 100), form=".3g")
        return tr("higher by a factor of {factor}", factor=factor)
    if value < 0:
        return tr("{percent} higher", percent=_percent(0.0 - value, 0.0 - hi, 0.0 - lo))
    return tr("{percent} lower", percent=_percent(value, lo, hi))


def _percent(value: float, low: float, high: float) -> str:
    return wording.estimate((value, low, high), "%", ".1f")


def _who(row: "pd.Series[Any]", labels: dict[str, str], several: bool) -> str:
    return labels[row["case"]] + (f", {row['filter']}" if several else "")


def _sigma_sentence(result: Result, curves: "pd.DataFrame") -> str:
    """For experiments without a second filter: σ of the range at the end."""
    rows = tables.where(curves, case=result.name, component="r")
    row = rows.iloc[-1]
    return tr(
        "{case}, {filter}: σ of the range at {t_s:g} s is {sigma}.",
        case=panels.plain_label(result),
        filter=row["filter"],
        t_s=row["t_s"],
        sigma=wording.estimate((row[key] for key in SIGMA), tr("m")),
    )
