"""P1's own tables: steady state, consistency, radar.

Its figures stand in range_doppler_figures, the words of its report in range_doppler_words.
"""

from collections.abc import Sequence

import numpy as np

from radarsim.engine.results import CaseResult
from radarsim.report import panels, statistics
from radarsim.report import tables as common
from radarsim.studies.range_doppler import exact as linear
from radarsim.studies.range_doppler.figures import PERIODS, figures
from radarsim.studies.range_doppler.words import answer, follows_the_model, question

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
    """What was put in, for the page: a row for each radar that differs from the others, with the D_M tried on it."""
    radars: dict[tuple, list[CaseResult]] = {}
    for members in panels.families(results).values():
        for result in members:
            of, theta = result.spec.radar, float(result.axes.extra["C_theta"])
            given = (of.sigma_range_m, of.sigma_velocity_mps, of.scan_period_s, of.wavelength_m, theta)
            radars.setdefault((panels.stem(result), panels.plain(panels.device(result)), *given), []).append(result)
    rows = []
    for (_, *radar), members in radars.items():
        tried = sorted({f.manoeuvre_variance for result in members for f in result.spec.filters})
        scans = sorted({result.spec.scans for result in members})
        rows.append((*radar, ", ".join(panels.number(v, powers=True) for v in tried), ", ".join(map(str, scans))))
    return common.frame({name: [row[i] for row in rows] for i, name in enumerate(INPUTS)})


INPUTS = ("radar", "σ_r, m", "σ_V, m/s", "Δt, s", "λ, m", "C_θ", "D_M, (m/s³)²", "scans")
