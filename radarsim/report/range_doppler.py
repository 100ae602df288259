"""P1's own tables (steady state, consistency, radar) and the words of its report.

Its figures stand in range_doppler_figures.
"""

from collections.abc import Sequence

import numpy as np

from radarsim.engine.results import CaseResult
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


def steady(results: Sequence[CaseResult]):
    """Steady σ (exact) against settling, of every case, filter and component.

    Settled is the first scan from which σ(k) stays within 5 % of the exact steady value to the end of the run; the
    interval takes σ at the kind and at the unkind end of its own. Empty where it does not settle within the run.
    `best` marks, among the cases of one config that differ in D_M, the least steady σ of those that settle in under
    ten periods.
    """
    rows = [row for result in results for row in _steady(result)]
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
        for c, (component, unit) in enumerate(axes.components):
            at = np.flatnonzero(axes.available[f, :, c])
            if not at.size:
                continue
            value, lo, hi = (part[f, at, c] for part in of)
            last = extra["steady_sigma"][f, c]
            when = settling(statistics.Estimate(value, lo, hi), t[at], last)
            rows.append(
                (
                    *(result.name, name, float(extra["manoeuvre_variance"][f]), component, unit, float(last)),
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
    *("nees", "nees_bound_lo", "nees_bound_hi", "verdict"),
)


def consistency(results: Sequence[CaseResult]):
    """What a filter believes of its σ against what it is (ratio over 1: pessimistic), and its normalised error squared.

    `nees` is the mean of eᵀP⁻¹e per estimated component, 1 for a filter that is right about itself; the bounds hold
    95 % of such filters' means over as many realisations.
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
        "verdict": np.select([nees < lo, nees > hi], ["pessimistic", "optimistic"], "consistent").astype(object),
    }


def normalised_error(result: CaseResult) -> statistics.Estimate:
    """Mean of eᵀP⁻¹e per estimated component (F, K), P the believed covariance, and the 95 % bounds of a right filter.

    From Σe² and Σ of the products of two components; N·d times the mean is then chi-square of N·d degrees of freedom.
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
    mean, ninth = np.full(P.shape[:2], np.nan), np.full(P.shape[:2], np.nan)
    for pattern in np.unique(axes.available.reshape(-1, 3), axis=0):
        known, where = np.flatnonzero(pattern), np.all(axes.available == pattern, axis=2)
        if known.size:
            one, other = ((part * unit)[where][:, known][:, :, known] for part in (P, second))
            mean[where] = np.trace(np.linalg.solve(one, other), axis1=1, axis2=2) / known.size
            ninth[where] = 2 / (9 * known.size * result.count)
    step = statistics.Z95 * np.sqrt(ninth)
    return statistics.Estimate(mean, (1 - ninth - step) ** 3, (1 - ninth + step) ** 3)


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
    """Sentences with numbers and 95 % intervals: the gains at the end of the run, component by component.

    Of cases that nothing is swept in, where there are such.
    """
    plain = panels.unswept(results)
    rows = made["gains"][made["gains"]["case"].isin([result.name for result in plain])]
    gains = common.groups(rows, "component")
    told = [_gain_sentence(plain, gains[(c,)], of.name) for c, of in QUANTITIES.items() if (c,) in gains]
    return told or [_sigma_sentence(results[0], made["curves"])]


def _gain_sentence(results: Sequence[CaseResult], rows, quantity: str) -> str:
    labels = {result.name: panels.plain_label(result) for result in results}
    last = rows.loc[rows.groupby(["case", "filter"], sort=False)["k"].idxmax()]
    several = rows["filter"].nunique() > 1
    base = f"than with {rows['baseline'].iloc[0]} alone" if rows["baseline"].nunique() == 1 else "than the baseline's"
    if len(last) > 1:
        low, high = (last.loc[last["gain_percent"].agg(pick)] for pick in ("idxmin", "idxmax"))
        ends = " to ".join(f"{_gain(row)} ({_who(row, labels, several)})" for row in (low, high))
        return f"{quantity.capitalize()}: at the end of the run σ is {ends} {base}."
    row = last.iloc[0]
    best = rows.loc[rows["gain_percent"].idxmax()]
    peak = "" if best["k"] == row["k"] else f"; at best {_gain(best)}, at {best['t_s']:g} s"
    return f"{quantity.capitalize()}: at the end of the run ({row['t_s']:g} s) σ is {_gain(row)} {base}{peak}."


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
