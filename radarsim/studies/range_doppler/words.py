"""What the report of P1's experiments asks and answers, in words."""

from collections.abc import Sequence

from radarsim.engine.results import CaseResult
from radarsim.report import panels
from radarsim.report import tables as common
from radarsim.studies.range_doppler.figures import QUANTITIES
from radarsim.studies.range_doppler.tables import PERIODS, follows_the_model


def question(experiment) -> str:
    """What the experiment asks, in one sentence."""
    filters = list(dict.fromkeys(f.name for case in experiment.cases for f in case.spec.filters))
    names = list(dict.fromkeys(getattr(case.spec.radar, "name", None) or case.stem for case in experiment.cases))
    if any("velocity" in f.observes for case in experiment.cases for f in case.spec.filters):
        return f"How much does observing the radial velocity lower the errors of {listed(names)}?"
    return f"How large are the errors of {listed(names)} with {listed(filters)}?"


def listed(names: Sequence[str]) -> str:
    """Names in a sentence: a, b and c."""
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def answer(results: Sequence[CaseResult], made: dict) -> list[str]:
    """Sentences with numbers and 95 % intervals: the gains at the last scan, component by component.

    Of cases that nothing is swept in, where there are such; the greatest loss of any case at any scan is told with
    them. Further: the best D_M where several are tried, first where nothing but D_M is asked for, and the worst error
    where a target breaks the model.
    """
    gains, best = _gain_sentences(results, made), _best_sentences(results, made)
    told = [*best, *gains] if _asks_for_variance(results) else [*gains, *best]
    return [*told, *_broken_sentences(results, made)]


def _asks_for_variance(results: Sequence[CaseResult]) -> bool:
    """Whether every case is one of a sweep over the manoeuvre variance."""
    return all("manoeuvre_variance" in dict(result.swept) for result in results)


def _gain_sentences(results: Sequence[CaseResult], made: dict) -> list[str]:
    plain = panels.unswept(results)
    rows = made["gains"][made["gains"]["case"].isin([result.name for result in plain])]
    gains, every = common.groups(rows, "component"), common.groups(made["gains"], "component")
    labels = {result.name: panels.plain_label(result) for result in results}
    told = [
        _gain_sentence(plain, gains[(c,)], every[(c,)], of.name, labels)
        for c, of in QUANTITIES.items()
        if (c,) in gains
    ]
    return told or [_sigma_sentence(results[0], made["curves"])]


def _gain_sentence(results: Sequence[CaseResult], rows, every, quantity: str, labels: dict[str, str]) -> str:
    """The gain of one quantity at the last scan.

    rows: its gains in the cases told of; every: in all cases, among which the greatest loss is looked for.
    """
    last = rows.loc[rows.groupby(["case", "filter"], sort=False)["k"].idxmax()]
    several = rows["filter"].nunique() > 1
    base = _baseline(results)
    if len(last) > 1:
        early, late = last["t_s"].min(), last["t_s"].max()
        when = f"at {late:g} s" if early == late else f"at the last scan (after {early:g} to {late:g} s)"
        low, high = (last.loc[last["gain_percent"].agg(pick)] for pick in ("idxmin", "idxmax"))
        ends = " to ".join(f"{_gain(row)} ({_who(row, labels, several)})" for row in (low, high))
        loss = _loss(every, low, labels)
        if last["gain_lo"].max() <= last["gain_hi"].min():
            ends += ", which do not differ for certain,"
        return f"{quantity.capitalize()}: {when} σ is {ends} {base}{loss}."
    row = last.iloc[0]
    best = rows.loc[rows["gain_percent"].idxmax()]
    peak = "" if best["k"] == row["k"] else f"; at best {_gain(best)}, at {best['t_s']:g} s"
    loss = _loss(every, row, labels)
    return f"{quantity.capitalize()}: at {row['t_s']:g} s, the last scan, σ is {_gain(row)} {base}{peak}{loss}."


LOSS = 1.0  # per cent: a gain certainly below minus this, at any scan, is told


def _loss(every, told, labels: dict[str, str]) -> str:
    """The greatest of the certain losses in words, unless there is none or it is the gain already told."""
    sure = every[every["gain_hi"] < -LOSS]
    if not len(sure):
        return ""
    worst = sure.loc[sure["gain_percent"].idxmin()]
    if worst.name == told.name:
        return ""
    several = every["filter"].nunique() > 1
    who = f", with {_who(worst, labels, several)}" if several or every["case"].nunique() > 1 else ""
    return f"; at worst {_gain(worst)}, at {worst['t_s']:g} s{who}"


def _baseline(results: Sequence[CaseResult]) -> str:
    """Than what a gain is: range alone only where the baseline filter observes no more."""
    bases = [result.spec.filters[result.axes.baseline] for result in results]
    same = " at the same D_M" if len({base.manoeuvre_variance for base in bases}) > 1 else ""
    if all(base.observes == ("range",) for base in bases):
        return f"than with range alone{same}"
    names = {base.name for base in bases}
    return f"than with filter '{bases[0].name}'" if len(names) == 1 else "than with the baseline filter"


def _best_sentences(results: Sequence[CaseResult], made: dict) -> list[str]:
    """The best manoeuvre variance of each radar and filter, in words, where several were tried."""
    table, told = made["steady"], []
    for members in panels.families(results).values():
        rows = table[table["case"].isin([r.name for r in members]) & (table["component"] == "r")]
        if rows.groupby("filter")["manoeuvre_variance"].nunique().max() > 1:
            chosen = [_best(rows[rows["filter"] == name], name) for name in members[0].axes.filters]
            told.append(f"{panels.plain(panels.device(members[0]))}: {'; '.join(chosen)}")
    if not told:
        return []
    rule = f"least steady σ of the range among those that settle in under {PERIODS} scan periods"
    return [f"Best manoeuvre variance D_M, (m/s³)² ({rule}). {'. '.join(told)}."]


def _best(rows, name: str) -> str:
    best = rows[rows["best"]]
    if not len(best):
        return f"{name} none of those tried"
    row = best.iloc[0]
    variance = panels.number(float(row["manoeuvre_variance"]), powers=True)
    return f"{name} {variance} (σ {row['steady_sigma']:.4g} m, settled after {row['settling_s']:g} s)"


MOST_TOLD = 4  # cases with a broken model told in the answer


def _broken_sentences(results: Sequence[CaseResult], made: dict) -> list[str]:
    """Where a target breaks the model: the worst σ of the range over the run, and the largest bias, of each filter."""
    broken = [result for result in results if not follows_the_model(result)]
    rows = common.groups(made["curves"][made["curves"]["component"] == "r"], "case", "filter")
    told = []
    for result in broken[:MOST_TOLD]:
        words = [f"{name} {_worst(rows[result.name, name])}" for name in result.axes.filters]
        told.append(f"{panels.plain_label(result)}, a target that breaks the filters' model: {'; '.join(words)}.")
    left = len(broken) - len(told)
    return told + ([f"{left} further cases break the model: see curves.csv."] if left else [])


def _worst(rows) -> str:
    worst, bias = rows.loc[rows["sigma"].idxmax()], rows.loc[rows["bias"].abs().idxmax()]
    text = (
        f"worst σ of the range {worst['sigma']:.4g} m [{worst['sigma_lo']:.4g}, {worst['sigma_hi']:.4g}] "
        f"at {worst['t_s']:g} s, largest bias {bias['bias']:.4g} m at {bias['t_s']:g} s"
    )
    return text.replace("-", "−")


def _gain(row) -> str:
    """A gain in words: lower, higher, or neither for certain."""
    value, lo, hi = (round(float(row[name]), 1) + 0.0 for name in ("gain_percent", "gain_lo", "gain_hi"))
    if value == lo == hi == 0:
        return "no lower nor higher by 0.1 %"
    if row["gain_lo"] <= 0 <= row["gain_hi"]:
        return f"neither lower nor higher for certain (gain {value:.1f} % [{lo:.1f}, {hi:.1f}])".replace("-", "−")
    if row["gain_percent"] < 0:
        value, lo, hi = 0.0 - value, 0.0 - hi, 0.0 - lo
        return f"{value:.1f} % [{lo:.1f}, {hi:.1f}] higher"
    return f"{value:.1f} % [{lo:.1f}, {hi:.1f}] lower"


def _who(row, labels: dict[str, str], several: bool) -> str:
    return labels[row["case"]] + (f", {row['filter']}" if several else "")


def _sigma_sentence(result: CaseResult, curves) -> str:
    """For experiments without a second filter: σ of the range at the end."""
    rows = curves[(curves["case"] == result.name) & (curves["component"] == "r")]
    row = rows.iloc[-1]
    return (
        f"{panels.plain_label(result)}, {row['filter']}: σ of the range at {row['t_s']:g} s is {row['sigma']:.4g} m "
        f"[{row['sigma_lo']:.4g}, {row['sigma_hi']:.4g}]."
    )
