"""The floor under σ: the lower bound for any estimator of a case that has the same plots; and for smoothing.

For a target that each realisation draws it is the posterior Cramér-Rao bound (Van Trees 1968; with noise in the motion
by the recursion of Tichavský, Muravchik & Nehorai, IEEE Trans. SP 46, 1998), for every estimator, biased or not. For
a target that is the same in all realisations it is the Cramér-Rao bound of the family of motions that the config
states, for estimators that are unbiased for the whole family; a biased one may lie below it. Where plots are linear
and their errors Gaussian there is an estimator that reaches it.

Where plots may be missed the bound is averaged over the patterns of plots (enumeration: Farina, Ristic & Timmoneri,
IEEE Trans. SP 50, 2002). Where these are too many, the information of a plot is multiplied by the probability of the
plot (information reduction: Hernandez, Farina & Ristic, IEEE Trans. AES 42, 2006): a bound too, as the inverse is
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
MAX_PATTERNS = 1 << 11  # of plots that came or did not: so many of the likeliest are averaged over
IGNORED_SHARE = 1e-4  # of the realisations with an estimate, those of the worst patterns: counts as no error
MIN_EIGENVALUE = 1e-12  # of the largest, of parameters in units of their own errors: below, nothing is known
MAX_IGNORED_CHANGE = 3e-4  # of variances, relative: what ignoring the worst patterns, and rounding, may cause
MAX_UNKNOWN_SHARE = 1e-9  # of a component in what is not known: above, it has no bound


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
    """The lower bounds on σ of a case, see the module.

    kind: CRB or POSTERIOR; bounds: with the plots of each of the F filters; of_all: with all plots of the case, where
    one filter may have them; t_s (F, K): where filters differ in their times."""

    kind: str
    bounds: tuple[Bound | None, ...]
    of_all: Bound | None = None
    t_s: np.ndarray | None = None

    def below(self, f: int | None = None) -> Bound | None:
        """The bound for filter number f; where None, for any filter of the case's plots."""
        return self.of_all if f is None else self.bounds[f]


# ---- without noise in the motion -------------------------------------------------------------------------------------
def static(prior: np.ndarray, gained: np.ndarray, maps: np.ndarray, reached: bool = True) -> Bound:
    """The bound for parameters that stay.

    prior (p, p): their information before the first scan; gained (K, p, p): that of each scan's plots; maps (K, C, p):
    the derivatives of the components by the parameters."""
    J = decomposed(prior + np.cumsum(gained, axis=0))
    scans = len(gained)

    def sigma_after(lag: int) -> np.ndarray:
        sigma = np.full(maps.shape[:2], np.nan)
        sigma[: scans - lag] = spreads(tuple(part[lag:] for part in J), maps[: scans - lag])
        return sigma

    last = tuple(part[-1:] for part in J)
    waited = np.stack([sigma_after(lag) if lag < scans else np.full(maps.shape[:2], np.nan) for lag in LAGS])
    return Bound(sigma_after(0), waited, spreads(last, maps), ("",) * scans, reached)


def decomposed(J: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Units (…, p), eigenvalues (…, p) and eigenvectors (…, p, p) of informations (…, p, p) in these units."""
    size = np.sqrt(np.diagonal(J, axis1=-2, axis2=-1))
    size = np.where(size > 0, size, 1.0)
    return size, *np.linalg.eigh(J / size[..., :, None] / size[..., None, :])


def spreads(J: tuple[np.ndarray, ...], maps: np.ndarray) -> np.ndarray:
    """σ (…, C) of components with derivatives maps (…, C, p), from decomposed informations; not-a-number where
    they do not determine a component."""
    size, values, vectors = J
    parts = (maps / size[..., None, :] @ vectors) ** 2
    nothing = (values <= MIN_EIGENVALUE * values[..., -1:])[..., None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = np.where(nothing, 0.0, parts / values[..., None, :]).sum(axis=-1)
        lost = np.where(nothing, parts, 0.0).sum(axis=-1) > MAX_UNKNOWN_SHARE**2 * parts.sum(axis=-1)
    return np.where(lost | (variance <= 0), np.nan, np.sqrt(variance))


def polynomial(t: np.ndarray, size: int, components: int = 3) -> np.ndarray:
    """Derivatives (K, components, size) of value, rate, … at times t (K,) by the `size` coefficients Σ cᵢ tⁱ/i!."""
    derivatives = np.zeros((len(t), components, size))
    for j in range(min(components, size)):
        power = np.ones_like(t)
        for i in range(j, size):
            derivatives[:, j, i] = power
            power = power * t / (i - j + 1)
    return derivatives


# ---- missed plots ----------------------------------------------------------------------------------------------------
def missed(
    prior: np.ndarray,
    gained: np.ndarray,
    maps: np.ndarray,
    chance: np.ndarray,
    counts: np.ndarray,
    needed: Sequence[int],
    settles: int,
    immediate: Sequence[bool] = (),
) -> Bound:
    """As `static`, over the realisations with an estimate; scan k gives its plots with the probability chance (K,).

    counts (K, C): whether the plots count for a component, which has an estimate from `needed` plots (C,) on, or, where
    `immediate` (C,), at any scan with a plot. `settles` scans that count for all components settle all parameters."""
    shape, needs = maps.shape[:2], np.array(needed)
    is_immediate = np.array(immediate or [False] * shape[1])
    sigma, kinds = np.full(shape, np.nan), []
    J, share, count = prior[None], np.ones(1), np.zeros((1, shape[1]), dtype=int)  # of patterns of plots so far
    mean, following = prior.copy(), True
    enough = [np.eye(1, n + 1)[0] for n in (*needed, settles)]  # probabilities of 0, 1, … and of at least n plots
    for k, (p, information) in enumerate(zip(chance, gained, strict=True)):
        # A plot in this scan, with which there are still too few.
        too_few = np.array([p * probabilities[:-2].sum() for probabilities in enough[:-1]])
        of_scan = (*counts[k], counts[k].all())
        enough = [
            _after(probabilities, p) if counted else probabilities
            for probabilities, counted in zip(enough, of_scan, strict=True)
        ]
        enough_plots = np.array([probabilities[-1] for probabilities in enough[:-1]])
        settled = np.minimum(enough_plots, enough[-1][-1])
        likely = enough_plots + np.where(is_immediate & (counts[k] > 0), too_few, 0.0)
        mean = mean + p * information
        with np.errstate(divide="ignore", invalid="ignore"):
            averaged = reduced = settled**2 / likely * spreads(decomposed(mean), maps[k]) ** 2
            if following:
                (pattern, has_plot), share = likeliest_patterns(np.array([p, 1 - p])[:, None] * share)
                J = J[pattern] + has_plot[:, None, None] * information
                count = count[pattern] + has_plot[:, None] * counts[k]
                has_estimate = (count >= needs) | (has_plot[:, None] * counts[k] > 0) & is_immediate
                averaged = over_patterns(share, _pattern_variances(J, maps[k], has_estimate), likely)
        sigma[k] = np.sqrt(np.fmax(averaged, reduced))
        following = following and not (reduced > averaged * (1 + MAX_IGNORED_CHANGE)).any()  # too many are left out
        kinds.append(ENUMERATION if following else REDUCTION)
    blank = np.full(shape, np.nan)
    return Bound(np.where(sigma > 0, sigma, np.nan), np.stack([blank] * len(LAGS)), blank, tuple(kinds), False)


def _pattern_variances(J: np.ndarray, maps: np.ndarray, has_estimate: np.ndarray) -> np.ndarray:
    """Variances (S, C) by patterns with informations J (S, p, p); zero where there is no estimate."""
    variance, rows = np.zeros(has_estimate.shape), has_estimate.any(axis=1)
    values = np.nan_to_num(spreads(decomposed(J[rows]), maps)) ** 2
    variance[rows] = np.where(has_estimate[rows], values, 0.0)
    return variance


def over_patterns(share: np.ndarray, variance: np.ndarray, likely: np.ndarray | float) -> np.ndarray:
    """Mean (C,) of variances (S, C) over patterns with probabilities (S,), in sum `likely` (C,); see IGNORED_SHARE."""
    worst_first = np.argsort(-variance, axis=0, kind="stable")
    counted = np.clip(np.cumsum(share[worst_first], axis=0) - IGNORED_SHARE * likely, 0, share[worst_first])
    mean: np.ndarray = (counted * np.take_along_axis(variance, worst_first, axis=0)).sum(axis=0) / likely
    return mean


def likeliest_patterns(shares: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], np.ndarray]:
    """The likeliest of the patterns that go on with a plot and without one, which have the probabilities (2, S).

    Gives for each (n,) the number of the old pattern and whether a plot came (1 or 0), and its probability (n,)."""
    all_shares = shares.ravel()
    chosen = np.flatnonzero(all_shares)
    if len(chosen) > MAX_PATTERNS:
        chosen = np.argsort(-all_shares, kind="stable")[:MAX_PATTERNS]
    without, pattern = np.divmod(chosen, shares.shape[1])
    return (pattern, 1 - without), all_shares[chosen]


def _after(enough: np.ndarray, p: float) -> np.ndarray:
    """The probabilities of 0, 1, … and of at least n plots after one more scan, which has a plot with probability p."""
    after = (1 - p) * enough
    after[1:] += p * enough[:-1]
    after[-1] += p * enough[-1]
    return after


# ---- with noise in the motion ----------------------------------------------------------------------------------------
def moved(M: np.ndarray, Q: np.ndarray) -> np.ndarray:
    """Information (…, n, n) on states after noise of covariance Q is added: (M⁻¹ + Q)⁻¹, also for a singular M."""
    information: np.ndarray = np.linalg.solve(np.eye(M.shape[-1]) + M @ Q, M)
    return (information + information.swapaxes(-1, -2)) / 2


def moving(J: np.ndarray, gained: np.ndarray, F: np.ndarray, Q: np.ndarray, shown: int) -> Bound:
    """The bound for the first components of states that noise moves, by the recursion of their information.

    J (n, n): before the first scan; gained (K, n, n): by each scan's plots; F, Q (K, n, n): from the scan before."""
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
    """As `moving`, for states whose covariance P (n, n) at the first scan is known and may be singular.

    The plots have rows H (K, D, n) and variances R (K, D), and come with the probability `chance`."""
    states, share, mean, following = P[None], np.ones(1), P[None], True
    forward, sigma, kinds = np.zeros((len(H), *P.shape)), np.zeros((len(H), shown)), []
    for k in range(len(H)):
        if k:
            states, mean = (F[k] @ covariance @ F[k].T + Q[k] for covariance in (states, mean))
        mean = _after_plot(mean, H[k], R[k] / max(chance, np.finfo(float).tiny))
        averaged = reduced = np.diagonal(mean[0])[:shown]
        if following:
            (pattern, has_plot), share = likeliest_patterns(np.array([chance, 1 - chance])[:, None] * share)
            states = np.where(has_plot[:, None, None] > 0, _after_plot(states, H[k], R[k])[pattern], states[pattern])
            averaged = over_patterns(share, np.diagonal(states, axis1=1, axis2=2)[:, :shown], 1.0)
        forward[k] = states[0]
        sigma[k] = np.sqrt(np.maximum(averaged, reduced))
        following = following and not (reduced > averaged * (1 + MAX_IGNORED_CHANGE)).any()
        kinds.append(ENUMERATION if following else REDUCTION)
    if chance < 1:
        blank = np.full(sigma.shape, np.nan)
        return Bound(sigma, np.stack([blank] * len(LAGS)), blank, tuple(kinds), False)

    def later(B: np.ndarray) -> np.ndarray:
        every = np.linalg.solve(np.eye(len(P)) + forward @ B, forward)
        made: np.ndarray = np.sqrt(np.diagonal(every, axis1=1, axis2=2)[:, :shown])
        return made

    return _smoothed(later, np.einsum("kdi,kdj,kd->kij", H, H, 1 / R), F, Q)


def _after_plot(P: np.ndarray, H: np.ndarray, R: np.ndarray) -> np.ndarray:
    """Covariances (S, n, n) after the numbers of a plot, rows H (D, n) with variances R (D,), by Joseph's form."""
    for h, r in zip(H, R, strict=True):
        gain = (P @ h) / (P @ h @ h + r)[:, None]
        A = np.eye(len(h)) - gain[:, :, None] * h
        P = A @ P @ A.swapaxes(1, 2) + r * gain[:, :, None] * gain[:, None, :]
    return P


def _smoothed(later: Callable[[np.ndarray], np.ndarray], gained: np.ndarray, F: np.ndarray, Q: np.ndarray) -> Bound:
    """The bound for which later(B) gives σ (K, C) with the information B (K, n, n) of later scans on each state."""
    scans = len(gained)

    def information_before(B: np.ndarray, next_scans: slice) -> np.ndarray:
        """Information at scans from that at the next ones, without the plots of the scans themselves."""
        information: np.ndarray = (
            F[next_scans].swapaxes(1, 2) @ moved(B + gained[next_scans], Q[next_scans]) @ F[next_scans]
        )
        return information

    def waited(lag: int) -> np.ndarray:
        remaining = max(scans - lag, 0)
        B = np.zeros_like(gained)
        for step in range(lag, 0, -1):
            B[:remaining] = information_before(B[:remaining], slice(step, remaining + step))
        sigma = later(B)
        sigma[remaining:] = np.nan
        return sigma

    B = np.zeros_like(gained)
    for k in range(scans - 1, 0, -1):
        B[k - 1] = information_before(B[k : k + 1], slice(k, k + 1))[0]
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

    return tables.joined(
        (part for result in results for part in _parts(study.floor(result.spec, result.axes), result)), COLUMNS
    )


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
    """The rows of a case, filter by filter; user filters are given all plots."""
    if floor is None:
        return
    for f, bound in enumerate(floor.bounds):
        if bound is not None:
            yield _rows(floor, f, bound, result)
    if (user_filters := result.outside) is not None and floor.of_all is not None:
        for f in range(len(user_filters.axes.filters)):
            yield _rows(floor, f, floor.of_all, user_filters)


def _rows(floor: Floor, f: int, bound: Bound, result: "CaseResult") -> dict[str, Any]:
    from radarsim.report import tables

    c, k = np.nonzero((result.axes.available[f] & np.isfinite(bound.sigma)).T)
    kinds = np.array(
        [", ".join(filter(None, (floor.kind, pattern_kind))) for pattern_kind in bound.patterns], dtype="O"
    )
    rows = tables.leading(result, np.full(k.size, f), k, **tables.components(result, c))
    if floor.t_s is not None:
        rows["t_s"] = floor.t_s[f, k]
    lags = {name: waited[k, c] for name, waited in zip(LATER, bound.waited, strict=True)}
    last_columns = {"smoothed": bound.smoothed[k, c], "reached": np.full(k.size, bound.reached), "kind": kinds[k]}
    return rows | {"floor": bound.sigma[k, c]} | lags | last_columns
