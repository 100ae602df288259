"""Linear filters laid out as the kernel `radarsim.kernels.linear_states` takes them."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.studies.linear_design import Matrices

if TYPE_CHECKING:
    from radarsim.config.experiment import Case
    from radarsim.kernels import linear_formulas


def root(S: np.ndarray) -> np.ndarray:
    """L (n, n) with L L' = S ≥ 0, lower; columns not needed for S are zero (Cholesky)."""
    L, remainder = np.zeros_like(S), S.copy()
    for j in range(len(S)):
        if remainder[j, j] > 1e-12 * S[j, j]:
            L[j:, j] = remainder[j:, j] / np.sqrt(remainder[j, j])
            remainder -= np.outer(L[:, j], L[:, j])
    return L


def problem_of(
    case: "Case", truth: tuple[np.ndarray, ...], filters: Sequence[Matrices], probability: float, baseline: int
) -> "linear_formulas.Problem":
    """The problem that the kernel simulates."""
    from radarsim.kernels import linear_formulas as kernels_linear_formulas
    from radarsim.studies.noise import noise_key

    F, Q, mean, P = truth
    noises = root(Q), root(P)
    used = [[j for j in range(len(mean)) if noise[:, j].any()] for noise in noises]
    push, spread = (np.zeros((len(mean), max(map(len, used)))) for _ in noises)
    for noise, reduced, columns in zip(noises, (push, spread), used, strict=True):
        reduced[:, : len(columns)] = noise[:, columns]
    groups: dict[bytes, int] = {}
    sees = [groups.setdefault(model.see.tobytes() + model.sigma.tobytes(), len(groups)) for model in filters]
    first_filters = [filters[sees.index(group)] for group in range(len(groups))]
    arrays = {
        name: np.stack([getattr(model, name) for model in filters]) for name in ("F", "x", "H", "gains", "P", "Q", "R")
    }
    return kernels_linear_formulas.Problem(
        key=noise_key(case, "plots"),
        detections=noise_key(case, "detections"),
        move=np.ascontiguousarray(F),
        push=push,
        start=mean,
        spread=spread,
        see=np.stack([model.see for model in first_filters]),
        sigma=np.stack([model.sigma for model in first_filters]),
        sees=np.array(sees),
        adapts=np.array([int(probability < 1 and not model.has_own_gains) for model in filters]),
        probability=probability,
        baseline=baseline,
        **arrays,
    )
