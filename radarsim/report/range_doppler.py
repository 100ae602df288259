"""P1's own tables (steady state, consistency, radar) and the words of its report.

Its figures stand in range_doppler_figures.
"""

from collections.abc import Sequence

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.exact import linear
from radarsim.report import panels, statistics
from radarsim.report import tables as common
from radarsim.report.range_doppler_figures import PERIODS, QUANTITIES, figures

__all__ = ["answer", "figures", "question", "tables"]

SETTLED = 0.05  # within this share of the steady value, for good; the paper gives no tolerance
TARGET_SPEED = 300.0  # m/s, the paper's example of an ambiguous Doppler frequency


def tables(results: Sequence[CaseResult]) -> dict:
    """The tables beyond curves and gains: steady, consistency, radar."""
    return {"steady": steady(results), "consistency": consistency(results), "radar": radar(results)}


STEADY = (
    *("case", "filter", "manoeuvre_variance", "component", "unit", "steady_sigma", "last_sigma", "last_lo", "last_hi"),
    *("settling_periods", "settling_s", "settling_lo_s", "settling_hi_s", "under_10_periods", "best"),
)


def follows_the_model(result: CaseResult) -> bool:
    """Whether the target moves as the filters take it to, by no more than a square of the time."""
    target = result.spec.target
    return target.kind == "polynomial" and not any(target.coefficients[3:])


def steady(results: Sequence[CaseResult]):
    """Steady σ (exact) against settling, of every case, filter and component.

    Settled is the first scan from which σ(k) stays within 5 % of the exact steady value to the end of the run; the
    interval takes σ at the kind and at the unkind end of its own; infinite where it does not settle within the run.
    Cases whose target breaks the filters' model have no steady error and no rows.
    `best` marks, among the cases of one config that differ in D_M, the least steady σ of those that settle in under
    ten periods.
    """
    rows = [row for result in results if follows_the_model(result) for row in _steady(result)]
    if not rows:
        return common.frame({name: [] for name in STEADY})
    table = common.frame({name: [row[i] for row in rows] for i, name in enumerate(STEADY[:-1])})
    stem = table["case"].str.split(" ").str[0]
    family = table.groupby([stem, table["filter"], table["component"]], sort=False)
    several = family["manoeuvre_variance"].transform("nunique") > 1
    good = table["steady_sigma"].where(table["under_10_periods"] & several)
    least = good.groupby([stem, table["filter"], table["component"]], sort=False).transform("min")
    table["best"] = good.eq(least)
    return table


def _steady(result: CaseResult) -> list[tuple]:
    axes, extra = result.axes, result.axes.extra
    of = statistics.errors(result.sums["error"], common.realisations(result)).sigma
    t, period, rows = np.asarray(axes.t_s, dtype=float), extra["scan_period_s"], []
    for f, name in enumerate(axes.filters):
        variance = float(extra["manoeuvre_variance"][f])
        _, true = linear.steady_state(int(extra["observes"][f]), variance, extra["sigma"], period)
        for c, (component, unit) in enumerate(axes.components):
            at = np.flatnonzero(axes.available[f, :, c])
            if not at.size:
                continue
            value, lo, hi = (part[f, at, c] for part in of)
            last = np.sqrt(true[c, c])
            when = settling(statistics.Estimate(value, lo, hi), t[at], last)
            rows.append(
                (
                    *(result.name, name, variance, component, unit, float(last)),
                    *(value[-1], lo[-1], hi[-1], when.value / period, when.value, when.lo, when.hi),
                    bool(when.value < PERIODS * period * (1 - 1e-9)),
                )
            )
    return rows


def settling(sigma: statistics.Estimate, t: np.ndarray, last: float) -> statistics.Estimate:
    """Time from which σ over t (K,) stays within 5 % of the steady value `last`; infinite where it does not."""
    low, high = last * (1 - SETTLED), last * (1 + SETTLED)
    touches = (sigma.hi >= low) & (sigma.lo <= high)
    inside = (sigma.lo >= low) & (sigma.hi <= high)
    middle = (sigma.value >= low) & (sigma.value <= high)
    return statistics.Estimate(*(_for_good(settled, t) for settled in (middle, touches, inside)))


def _for_good(settled: np.ndarray, t: np.ndarray) -> float:
    wrong = np.flatnonzero(~settled)
    first = wrong[-1] + 1 if wrong.size else 0
    return float(t[first]) if first < len(t) else np.inf


CONSISTENCY = (
    *("case", "filter", "component", "unit", "k", "t_s", "sigma", "believed_sigma", "ratio", "ratio_lo", "ratio_hi"),
    *("nees", "nees_bound_lo", "nees_bound_hi", "nees_verdict"),
)


def consistency(results: Sequence[CaseResult]):
    """What a filter believes of its σ against what it is (ratio over 1: pessimistic), and its normalised error squared.

    `nees` is the mean of eᵀP⁻¹e per estimated component, 1 for a filter that is right about itself. In
    95 % of runs of such a filter over as many realisations the means of all its scans lie within the bounds.
    """
    return common.joined([_consistency(result) for result in results], CONSISTENCY)


def _consistency(result: CaseResult) -> dict[str, np.ndarray]:
    axes, at = result.axes, common.shown(result)
    f, k, c = at
    of = statistics.errors(np.asarray(result.sums["error"])[at], result.count).sigma
    believed = np.sqrt(np.diagonal(axes.extra["believed"], axis1=2, axis2=3))[at]
    nees, lo, hi = (part[f, k] for part in normalised_error(result))
    with np.errstate(divide="ignore"):
        ratio = [believed / part for part in (of.value, of.hi, of.lo)]
    return {
        "case": np.full(f.size, result.name, dtype=object),
        "filter": common.names(axes.filters, f),
        "component": common.names([name for name, _ in axes.components], c),
        "unit": common.names([unit for _, unit in axes.components], c),
        "k": np.asarray(axes.k)[k],
        "t_s": np.asarray(axes.t_s, dtype=float)[k],
        "sigma": of.value,
        "believed_sigma": believed,
        **dict(zip(("ratio", "ratio_lo", "ratio_hi"), ratio, strict=True)),
        "nees": nees,
        "nees_bound_lo": lo,
        "nees_bound_hi": hi,
        "nees_verdict": np.select([nees < lo, nees > hi], ["pessimistic", "optimistic"], "consistent").astype(object),
    }


def normalised_error(result: CaseResult) -> statistics.Estimate:
    """Mean of eᵀP⁻¹e per estimated component (F, K), P the believed covariance, and the bounds of a right filter.

    From Σe² and Σ of the products of two components; N·d times the mean is then chi-square of N·d degrees of freedom.
    The bounds hold 95 % over all scans of a filter together (Bonferroni: 5 % shared among them).
    """
    axes, P = result.axes, result.axes.extra["believed"]
    second = np.zeros(P.shape)
    for (i, j), crossed in zip(((0, 1), (0, 2), (1, 2)), np.moveaxis(result.sums["cross"], -1, 0), strict=True):
        second[..., i, j] = second[..., j, i] = crossed / result.count
    for i in range(3):
        second[..., i, i] = result.sums["error"][..., i, 1] / result.count
    variance = np.diagonal(P, axis1=2, axis2=3)
    scale = np.where(variance > 0, variance, np.inf) ** -0.5  # m, m/s and m/s² brought to one size before solving
    unit = scale[..., :, None] * scale[..., None, :]
    mean, freedom = np.full(P.shape[:2], np.nan), np.full(P.shape[:2], np.nan)
    for pattern in np.unique(axes.available.reshape(-1, 3), axis=0):
        known, where = np.flatnonzero(pattern), np.all(axes.available == pattern, axis=2)
        if known.size:
            one, other = ((part * unit)[where][:, known][:, :, known] for part in (P, second))
            mean[where] = np.trace(np.linalg.solve(one, other), axis1=1, axis2=2) / known.size
            freedom[where] = known.size * result.count
    looks = np.sum(np.isfinite(mean), axis=1, keepdims=True)
    return statistics.Estimate(mean, *statistics.normalised_bounds(freedom, looks))


RADAR = ("case", "C_theta", "doppler_hz", "doppler_per_repetition_rate", "unambiguous_velocity_mps")


def radar(results: Sequence[CaseResult]):
    """C_θ = σ_r²/(Δt²σ_V²) (eq. 11), the Doppler frequency of 300 m/s, and the unambiguous span of velocity λF/2."""
    rows = []
    for result in results:
        extra = result.axes.extra
        doppler = 2 * TARGET_SPEED / extra["wavelength_m"]
        rate = extra["repetition_rate_hz"]
        rows.append((result.name, extra["C_theta"], doppler, doppler / rate, extra["wavelength_m"] * rate / 2))
    return common.frame({name: [row[i] for row in rows] for i, name in enumerate(RADAR)})


def inputs(results: Sequence[CaseResult]):
    """What was put in, for the page: a row for each radar, with its C_θ and the manoeuvre variances D_M tried."""
    rows = []
    for members in panels.families(results).values():
        radar, extra = members[0].spec.radar, members[0].axes.extra
        tried = sorted({f.manoeuvre_variance for result in members for f in result.spec.filters})
        scans = sorted({result.spec.scans for result in members})
        rows.append(
            (
                *(panels.plain(panels.device(members[0])), radar.sigma_range_m, radar.sigma_velocity_mps),
                *(radar.scan_period_s, radar.wavelength_m, float(extra["C_theta"])),
                *(", ".join(panels.number(v, powers=True) for v in tried), ", ".join(map(str, scans))),
            )
        )
    return common.frame({name: [row[i] for row in rows] for i, name in enumerate(INPUTS)})


INPUTS = ("radar", "σ_r, m", "σ_V, m/s", "Δt, s", "λ, m", "C_θ", "D_M, (m/s³)²", "scans")


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

    Of cases that nothing is swept in, where there are such. Further: the best D_M where several are tried, and the
    worst error where a target breaks the model.
    """
    return [*_gain_sentences(results, made), *_best_sentences(results, made), *_broken_sentences(results, made)]


def _gain_sentences(results: Sequence[CaseResult], made: dict) -> list[str]:
    plain = panels.unswept(results)
    rows = made["gains"][made["gains"]["case"].isin([result.name for result in plain])]
    gains = common.groups(rows, "component")
    told = [_gain_sentence(plain, gains[(c,)], of.name) for c, of in QUANTITIES.items() if (c,) in gains]
    return told or [_sigma_sentence(results[0], made["curves"])]


def _gain_sentence(results: Sequence[CaseResult], rows, quantity: str) -> str:
    labels = {result.name: panels.plain_label(result) for result in results}
    last = rows.loc[rows.groupby(["case", "filter"], sort=False)["k"].idxmax()]
    several = rows["filter"].nunique() > 1
    base = _baseline(results)
    if len(last) > 1:
        early, late = last["t_s"].min(), last["t_s"].max()
        when = f"at {late:g} s" if early == late else f"at the last scan (after {early:g} to {late:g} s)"
        low, high = (last.loc[last["gain_percent"].agg(pick)] for pick in ("idxmin", "idxmax"))
        ends = " to ".join(f"{_gain(row)} ({_who(row, labels, several)})" for row in (low, high))
        return f"{quantity.capitalize()}: {when} σ is {ends} {base}."
    row = last.iloc[0]
    best = rows.loc[rows["gain_percent"].idxmax()]
    peak = "" if best["k"] == row["k"] else f"; at best {_gain(best)}, at {best['t_s']:g} s"
    return f"{quantity.capitalize()}: at {row['t_s']:g} s, the last scan, σ is {_gain(row)} {base}{peak}."


def _baseline(results: Sequence[CaseResult]) -> str:
    """Than what a gain is: range alone only where the baseline filter observes no more."""
    bases = [result.spec.filters[result.axes.baseline] for result in results]
    if all(base.observes == ("range",) for base in bases):
        return "than with range alone"
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
    value, lo, hi = (row[name] for name in ("gain_percent", "gain_lo", "gain_hi"))
    if lo <= 0 <= hi:
        return f"neither lower nor higher (gain {value:.1f} % [{lo:.1f}, {hi:.1f}])".replace("-", "−")
    if value < 0:
        value, lo, hi = -value, -hi, -lo
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
