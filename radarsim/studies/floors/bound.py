"""The floor under σ: the lower bound for any estimator of a case that has the same plots.

For a target that each realisation draws, the floor is the posterior Cramér–Rao bound (Van Trees 1968; with noise in the
motion by the recursion of Tichavský, Muravchik & Nehorai, IEEE Trans. SP 46, 1998), for every estimator, biased or not.
For a target that is the same in all realisations, it is the Cramér–Rao bound of the family of motions that the config
states, for estimators that are unbiased for the whole family; a biased one may lie below it. Where plots are linear and
their errors Gaussian, there is an estimator that reaches it."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from radarsim.report.quantities import SMOOTHED_TERMS

LAGS = tuple(SMOOTHED_TERMS)
CRB, POSTERIOR = "CRB", "posterior CRB"
ENUMERATION, REDUCTION = "enumeration", "information reduction"
FALSE_REDUCTION = "information reduction among false plots"
MIN_EIGENVALUE = 1e-12  # of the largest, of parameters in units of their own errors: below, nothing is known
MAX_UNKNOWN_SHARE = 1e-9  # of a component in what is not known: above, it has no bound


class Bound(NamedTuple):
    """The least σ (K, C) of components with the same plots, not-a-number where there is no bound.

    lagged (LAGS, K, C): so many scans later; smoothed (K, C): after the last scan; both not-a-number where plots may be
    missed. patterns (K,): how missed and false plots count, of ENUMERATION, REDUCTION, FALSE_REDUCTION and nothing.
    is_attained: whether an estimator attains it."""

    sigma: np.ndarray
    lagged: np.ndarray
    smoothed: np.ndarray
    patterns: tuple[str, ...]
    is_attained: bool = True


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


def decompose_information(J: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Units (…, p), eigenvalues (…, p) and eigenvectors (…, p, p) of informations (…, p, p) in these units."""
    size = np.sqrt(np.diagonal(J, axis1=-2, axis2=-1))
    size = np.where(size > 0, size, 1.0)
    return size, *np.linalg.eigh(J / size[..., :, None] / size[..., None, :])


def sigma_from_information(J: tuple[np.ndarray, ...], maps: np.ndarray) -> np.ndarray:
    """σ (…, C) of components with derivatives maps (…, C, p), from decomposed informations; not-a-number where
    they do not determine a component."""
    size, values, vectors = J
    parts = (maps / size[..., None, :] @ vectors) ** 2
    nothing = (values <= MIN_EIGENVALUE * values[..., -1:])[..., None, :]
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = np.where(nothing, 0.0, parts / values[..., None, :]).sum(axis=-1)
        lost = np.where(nothing, parts, 0.0).sum(axis=-1) > MAX_UNKNOWN_SHARE**2 * parts.sum(axis=-1)
    return np.where(lost | (variance <= 0), np.nan, np.sqrt(variance))
