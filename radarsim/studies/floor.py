"""The floor under σ: what no estimator of a case can do better than, given the same plots; and smoothing.

Of a target that each realisation draws it is the posterior Cramér-Rao bound (Van Trees 1968; with noise in the motion
by the recursion of Tichavský, Muravchik & Nehorai, IEEE Trans. SP 46, 1998), under every estimator, biased or not. Of
one target that is the same in all realisations it is the Cramér-Rao bound of the family of motions that the config
states, under estimators that are unbiased for all of the family; a biased one may lie below it. Where plots are linear
and their errors Gaussian there is an estimator that reaches it.

Where plots may be missed the bound is averaged over the patterns of plots (enumeration: Farina, Ristic & Timmoneri,
IEEE Trans. SP 50, 2002). Where these are too many the information of a plot is multiplied by the probability that there
is one (information reduction: Hernandez, Farina & Ristic, IEEE Trans. AES 42, 2006): a bound too, as the inverse is
convex, but a lower one. Patterns that do not determine a component, and the worst, so rare that samples may have none
of them, count as if there were no error: a mean that leaves some out is still a bound.

Everything that moves without noise is a function of parameters θ (p,) that stay; a scan adds information (p, p) on it.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from radarsim.report.quantities import SMOOTHED

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.engine.results import CaseResult
    from radarsim.studies.interface import Study

LAGS = tuple(SMOOTHED)
CRB, POSTERIOR = "CRB", "posterior CRB"
ENUMERATION, REDUCTION = "enumeration", "information reduction"
MOST_PATTERNS = 1 << 11  # of plots that came or not that are averaged over, the likeliest
RAREST = 1e-4  # share of the realisations with an estimate, those of the worst patterns, that counts as nothing
NOTHING = 1e-12  # of the greatest eigenvalue, of parameters in units of their own errors: nothing is known there
ALIKE = 3e-4  # relative difference of variances that leaving out the worst patterns, and rounding, may make
SEEN = 1e-9  # share of a component in what is not known, from which it has no bound


class Bound(NamedTuple):
    """The least σ (K, C) of components with the same plots, not-a-number where there is no bound.

    waited (LAGS, K, C): so many scans later; smoothed (K, C): after the last scan; both not-a-number where plots may be
    missed. patterns (K,): how missed plots count, of ENUMERATION, REDUCTION and nothing. reached: whether there is an
    estimator that attains it."""

    sigma: np.ndarray
    waited: np.ndarray
    smoothed: np.ndarray
    patterns: tuple[str, ...]
    reached: bool = True


@dataclass(frozen=True)
class Floor:
    """What no estimator of a case can do better than, see the module: kind, CRB or POSTERIOR; with the plots of each of
    the F filters; and with all plots of the case, where one filter may have them. t_s (F, K), where filters differ."""

    kind: str
    bounds: tuple[Bound | None, ...]
    of_all: Bound | None = None
    t_s: np.ndarray | None = None

    def below(self, f: int | None = None) -> Bound | None:
        """That under filter number f; under any filter of the plots of the case where None."""
        return self.of_all if f is None else self.bounds[f]


# ---- without noise in the motion -------------------------------------------------------------------------------------
def static(prior: np.ndarray, gained: np.ndarray, maps: np.ndarray, reached: bool = True) -> Bound:
    """Of parameters that stay: prior (p, p) their information before the first scan, gained (K, p, p) that of its
    plots, maps (K, C, p) the derivatives of the components."""
    J = decomposed(prior + np.cumsum(gained, axis=0))
    scans = len(gained)

    def after(lag: int) -> np.ndarray:
        found = np.full(maps.shape[:2], np.nan)
        found[: scans - lag] = spreads(tuple(part[lag:] for part in J), maps[: scans - lag])
        return found

    last = tuple(part[-1:] for part in J)
    waited = np.stack([after(lag) if lag < scans else np.full(maps.shape[:2], np.nan) for lag in LAGS])
    return Bound(after(0), waited, spreads(last, maps), ("",) * scans, reached)


def decomposed(J: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Units (…, p), eigenvalues (…, p) and eigenvectors (…, p, p) of informations (…, p, p) in these units."""
    size = np.sqrt(np.diagonal(J, axis1=-2, axis2=-1))
    size = np.where(size > 0, size, 1.0)
    return size, *np.linalg.eigh(J / size[..., :, None] / size[..., None, :])


def spreads(J: tuple[np.ndarray, ...], maps: np.ndarray) -> np.ndarray:
    """σ (…, C) of components with derivatives maps (…, C, p), of decomposed informations; not-a-number of one that they
    do not determine."""
    size, values, vectors = J
    parts = (maps / size[..., None, :] @ vectors) ** 2
    nothing = (values <= NOTHING * values[..., -1:])[..., None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = np.where(nothing, 0.0, parts / values[..., None, :]).sum(axis=-1)
        lost = np.where(nothing, parts, 0.0).sum(axis=-1) > SEEN**2 * parts.sum(axis=-1)
    return np.where(lost | (variance <= 0), np.nan, np.sqrt(variance))


def polynomial(t: np.ndarray, size: int, components: int = 3) -> np.ndarray:
    """Derivatives (K, components, size) of value, rate, … at times t (K,) by the `size` coefficients Σ cᵢ tⁱ/i!."""
    made = np.zeros((len(t), components, size))
    for j in range(min(components, size)):
        power = np.ones_like(t)
        for i in range(j, size):
            made[:, j, i] = power
            power = power * t / (i - j + 1)
    return made


# ---- missed plots ----------------------------------------------------------------------------------------------------
def missed(
    prior: np.ndarray,
    gained: np.ndarray,
    maps: np.ndarray,
    chance: np.ndarray,
    counts: np.ndarray,
    needed: Sequence[int],
    settles: int,
    alone: Sequence[bool] = (),
) -> Bound:
    """As `static`, of the realisations with an estimate, where scan k gives its plots with the probability chance (K,).

    counts (K, C): whether they count for a component, which has an estimate from so many `needed` plots (C,) on, and
    where `alone` (C,) at any scan with a plot. Scans that count for all determine all parameters, `settles` of them."""
    shape, needs = maps.shape[:2], np.array(needed)
    lone = np.array(alone or [False] * shape[1])
    sigma, kinds = np.full(shape, np.nan), []
    J, share, count = prior[None], np.ones(1), np.zeros((1, shape[1]), dtype=int)  # of patterns of plots so far
    mean, following = prior.copy(), True
    enough = [np.eye(1, n + 1)[0] for n in (*needed, settles)]  # probabilities of 0, 1, … and of at least n plots
    for k, (p, information) in enumerate(zip(chance, gained, strict=True)):
        few = np.array([p * one[:-2].sum() for one in enough[:-1]])  # a plot now, with which there are too few
        of_scan = (*counts[k], counts[k].all())
        enough = [_after(one, p) if counted else one for one, counted in zip(enough, of_scan, strict=True)]
        many = np.array([one[-1] for one in enough[:-1]])
        settled = np.minimum(many, enough[-1][-1])
        likely = many + np.where(lone & (counts[k] > 0), few, 0.0)
        mean = mean + p * information
        with np.errstate(divide="ignore", invalid="ignore"):
            averaged = reduced = settled**2 / likely * spreads(decomposed(mean), maps[k]) ** 2
            if following:
                (of, came), share = _likeliest(np.array([p, 1 - p])[:, None] * share)
                J, count = J[of] + came[:, None, None] * information, count[of] + came[:, None] * counts[k]
                known = (count >= needs) | (came[:, None] * counts[k] > 0) & lone
                some = known.any(axis=1)
                variance = np.zeros(known.shape)
                variance[some] = np.where(known[some], np.nan_to_num(spreads(decomposed(J[some]), maps[k])) ** 2, 0.0)
                averaged = over_patterns(share, variance, likely)
        sigma[k] = np.sqrt(np.fmax(averaged, reduced))
        following = following and not (reduced > averaged * (1 + ALIKE)).any()  # too many are left out
        kinds.append(ENUMERATION if following else REDUCTION)
    blank = np.full(shape, np.nan)
    return Bound(np.where(sigma > 0, sigma, np.nan), np.stack([blank] * len(LAGS)), blank, tuple(kinds), False)


def over_patterns(share: np.ndarray, variance: np.ndarray, likely: np.ndarray | float) -> np.ndarray:
    """Mean (C,) of variances (S, C) over patterns with probabilities (S,), of `likely` ones (C,); see RAREST."""
    worst = np.argsort(-variance, axis=0, kind="stable")
    counted = np.clip(np.cumsum(share[worst], axis=0) - RAREST * likely, 0, share[worst])
    made: np.ndarray = (counted * np.take_along_axis(variance, worst, axis=0)).sum(axis=0) / likely
    return made


def _likeliest(shares: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """Of patterns that go on with a plot and without one, with probabilities (2, S), the likeliest: the number of the
    pattern and 1 or 0 (n,), and their probabilities (n,)."""
    each = shares.ravel()
    kept = np.flatnonzero(each)
    if len(kept) > MOST_PATTERNS:
        kept = np.argsort(-each, kind="stable")[:MOST_PATTERNS]
    without, of = np.divmod(kept, shares.shape[1])
    return (of, 1 - without), each[kept]


def _after(enough: np.ndarray, p: float) -> np.ndarray:
    """The probabilities of 0, 1, … and of at least n plots, after one more scan with a plot by p."""
    made = (1 - p) * enough
    made[1:] += p * enough[:-1]
    made[-1] += p * enough[-1]
    return made


# ---- with noise in the motion ----------------------------------------------------------------------------------------
def moved(M: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """Information (…, n, n) on states after they have got noise of covariance Q: (M⁻¹ + Q)⁻¹, also of a singular M."""
    made: np.ndarray = np.linalg.solve(np.eye(M.shape[-1]) + M @ Q, M)
    return (made + made.swapaxes(-1, -2)) / 2


def moving(J: np.ndarray, gained: np.ndarray, F: np.ndarray, Q: np.ndarray, shown: int) -> Bound:
    """Of states that noise moves, by the recursion of their information: J (n, n) before the first scan, gained
    (K, n, n), F and Q (K, n, n) from the scan before; of the first components."""
    forward, maps = np.zeros_like(gained), np.eye(shown, len(J))
    for k, information in enumerate(gained):
        if k:
            back = np.linalg.inv(F[k])
            J = moved(back.T @ J @ back, Q[k])
        forward[k] = J = J + information

    def later(B: np.ndarray) -> np.ndarray:
        return spreads(decomposed(forward + B), maps)

    return _smoothed(later, gained, F, Q)


def driven(
    P: np.ndarray, F: np.ndarray, Q: np.ndarray, H: np.ndarray, R: np.ndarray, chance: float, shown: int
) -> Bound:
    """The same of states whose covariance P (n, n) at the first scan is known, and may be singular; of plots
    H (K, D, n) with variances R (K, D), which come with the probability `chance`."""
    states, share, mean, following = P[None], np.ones(1), P[None], True
    forward, sigma, kinds = np.zeros((len(H), *P.shape)), np.zeros((len(H), shown)), []
    for k in range(len(H)):
        if k:
            states, mean = (F[k] @ one @ F[k].T + Q[k] for one in (states, mean))
        mean = _taken(mean, H[k], R[k] / max(chance, np.finfo(float).tiny))
        averaged = reduced = np.diagonal(mean[0])[:shown]
        if following:
            (of, came), share = _likeliest(np.array([chance, 1 - chance])[:, None] * share)
            states = np.where(came[:, None, None] > 0, _taken(states, H[k], R[k])[of], states[of])
            averaged = over_patterns(share, np.diagonal(states, axis1=1, axis2=2)[:, :shown], 1.0)
        forward[k] = states[0]
        sigma[k] = np.sqrt(np.maximum(averaged, reduced))
        following = following and not (reduced > averaged * (1 + ALIKE)).any()
        kinds.append(ENUMERATION if following else REDUCTION)
    if chance < 1:
        blank = np.full(sigma.shape, np.nan)
        return Bound(sigma, np.stack([blank] * len(LAGS)), blank, tuple(kinds), False)

    def later(B: np.ndarray) -> np.ndarray:
        every = np.linalg.solve(np.eye(len(P)) + forward @ B, forward)
        made: np.ndarray = np.sqrt(np.diagonal(every, axis1=1, axis2=2)[:, :shown])
        return made

    return _smoothed(later, np.einsum("kdi,kdj,kd->kij", H, H, 1 / R), F, Q)


def _taken(P: np.ndarray, H: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Covariances (S, n, n) after the numbers of a plot, rows H (D, n) with variances R (D,), by Joseph's form."""
    for h, r in zip(H, R, strict=True):
        gain = (P @ h) / (P @ h @ h + r)[:, None]
        A = np.eye(len(h)) - gain[:, :, None] * h
        P = A @ P @ A.swapaxes(1, 2) + r * gain[:, :, None] * gain[:, None, :]
    return P


def _smoothed(later: Callable[[np.ndarray], np.ndarray], gained: np.ndarray, F: np.ndarray, Q: np.ndarray) -> Bound:
    """The bound of which later(B) gives σ (K, C) with what further scans tell of each, B (K, n, n)."""
    scans = len(gained)

    def behind(B: np.ndarray, at: slice) -> np.ndarray:
        """Information at scans, from that at the next ones, `at`, without their plots."""
        made: np.ndarray = F[at].swapaxes(1, 2) @ moved(B + gained[at], Q[at]) @ F[at]
        return made

    def waited(lag: int) -> np.ndarray:
        left = max(scans - lag, 0)
        B = np.zeros_like(gained)
        for step in range(lag, 0, -1):
            B[:left] = behind(B[:left], slice(step, left + step))
        found = later(B)
        found[left:] = np.nan
        return found

    B = np.zeros_like(gained)
    for k in range(scans - 1, 0, -1):
        B[k - 1] = behind(B[k : k + 1], slice(k, k + 1))[0]
    return Bound(waited(0), np.stack([waited(lag) for lag in LAGS]), later(B), ("",) * scans)


# ---- table -----------------------------------------------------------------------------------------------------------
LATER = tuple(f"lag_{lag}" for lag in LAGS)
COLUMNS = ("case", "filter", "component", "unit", "k", "t_s", "floor", *LATER, "smoothed", "reached", "kind")


def floors(study: "Study", results: "Sequence[CaseResult]") -> "pd.DataFrame":
    """What no estimator can do better than with the plots of a filter, where a floor is known: what quantities read.

    `floor` is the least σ with the plots up to the scan; `lag_1` … `lag_10` that so many scans later, of fixed-lag
    smoothing; `smoothed` that after the last scan, of fixed-interval smoothing. `reached` says whether some estimator
    reaches it, `kind` which bound it is."""
    from radarsim.report import tables

    return tables.joined((part for one in results for part in _parts(study.floor(one.spec, one.axes), one)), COLUMNS)


def with_floors(curves: "pd.DataFrame", floors: "pd.DataFrame") -> "pd.DataFrame":
    """Curves with the floor of each row; empty where none is known.

    floor [unit]: what no estimator does better than with the plots that the filter is given up to the scan
    floor_kind: `CRB`, of a target that is the same in all realisations, under unbiased estimators; `posterior CRB`, of
        a random one, under any; and how missed plots count, see `docs/methods.md`
    """
    keys, note = ["case", "filter", "component", "k"], curves.columns.isin(["note"])
    made = curves.loc[:, ~note]
    if "believed_sigma" not in made:
        made = made.assign(believed_sigma=np.nan)
    if len(floors):
        known = floors[[*keys, "floor", "kind"]].rename(columns={"kind": "floor_kind"})
        made = made.merge(known, on=keys, how="left", validate="many_to_one").fillna({"floor_kind": ""})
    else:
        made = made.assign(floor=np.nan, floor_kind="")
    return made.set_index(curves.index).join(curves.loc[:, note])


def _parts(floor: Floor | None, result: "CaseResult") -> Iterator[dict[str, Any]]:
    """The rows of a case, filter by filter; filters from outside are given all plots."""
    if floor is None:
        return
    for f, bound in enumerate(floor.bounds):
        if bound is not None:
            yield _rows(floor, f, bound, result)
    if (other := result.outside) is not None and floor.of_all is not None:
        for f in range(len(other.axes.filters)):
            yield _rows(floor, f, floor.of_all, other)


def _rows(floor: Floor, f: int, bound: Bound, result: "CaseResult") -> dict[str, Any]:
    from radarsim.report import tables

    c, k = np.nonzero((result.axes.available[f] & np.isfinite(bound.sigma)).T)
    kinds = np.array([", ".join(filter(None, (floor.kind, one))) for one in bound.patterns], dtype="O")
    rows = tables.leading(result, np.full(k.size, f), k, **tables.components(result, c))
    if floor.t_s is not None:
        rows["t_s"] = floor.t_s[f, k]
    lags = {name: waited[k, c] for name, waited in zip(LATER, bound.waited, strict=True)}
    ends = {"smoothed": bound.smoothed[k, c], "reached": np.full(k.size, bound.reached), "kind": kinds[k]}
    return rows | {"floor": bound.sigma[k, c]} | lags | ends
