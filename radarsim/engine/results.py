"""The sums of a case with the labels of their axes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np

from radarsim.errors import count_text


@dataclass(frozen=True)
class Axes:
    """Labels of the error sums, (F filters, K scans, C components).

    k (K,) counts scans from 1, t_s (K,) is the time from the first plot. available (F, K, C): where a filter has an
    estimate. baseline: the filter that gains refer to. exact_sigma and exact_bias (F, K, C) are NaN where no exact
    value is known. A study's subclass adds what its tables need."""

    filters: tuple[str, ...]
    components: tuple[tuple[str, str], ...]
    k: np.ndarray
    t_s: np.ndarray
    available: np.ndarray
    baseline: int
    exact_sigma: np.ndarray
    exact_bias: np.ndarray

    def __init_subclass__(cls) -> None:
        cls.__repr__ = Axes.__repr__  # type: ignore[method-assign]  # else a dataclass shows all its arrays

    def __repr__(self) -> str:
        parts = ", ".join(name for name, _ in self.components)
        return f"<axes: filters {', '.join(self.filters)}; components {parts}; {len(self.k)} scans>"

    @property
    def exact_gains(self) -> np.ndarray:
        """Exact gains (F, K, C) against the baseline, per cent, in the realisations in which both have an estimate.
        Here each has one wherever it is available."""
        sigma = np.asarray(self.exact_sigma, dtype=float)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(100 * (1 - sigma / sigma[self.baseline]))


A_co = TypeVar("A_co", bound=Axes, covariant=True)


@dataclass(frozen=True)
class CaseResult(Generic[A_co]):
    """A case, its number of finished realisations, and the named arrays of their sums.

    A study's own tables take results with its own axes, `CaseResult[RangeDopplerAxes]`; a plain `CaseResult` is any.

    further_baselines holds the same case with the sums and axes of each further baseline; user_filters, where it has
    filters of somebody else, with theirs.

    `error` (F, K, C, 4) holds the sums of e, e², e³, e⁴; `paired` (F, K, C) those of e²·e² with the baseline's error;
    where not all realisations have an estimate, `estimates` (F, K, C) counts those that do, and `both` (F, K, C, 5)
    those that have the baseline's too, with the sums of e², e⁴ and of the baseline's over these; a study adds its
    own."""

    name: str
    study: str
    spec: Any
    swept_values: tuple[tuple[str, Any], ...]
    count: int
    sums: Mapping[str, np.ndarray]
    axes: A_co
    seconds: float = 0.0
    further_baselines: "tuple[CaseResult[A_co], ...]" = ()
    user_filters: "CaseResult[Axes] | None" = None
    realisation_errors: Any = None  #: of its realisations, drawn again (`api.realisation_errors`), if known

    def __repr__(self) -> str:
        filters = ", ".join(self.axes.filters)
        count = f"{count_text(self.count)} realisation{'s' * (self.count != 1)}"
        return f"<case {self.name}: {count}, {len(self.axes.k)} scans; filters {filters}>"

    @property
    def baseline(self) -> str:
        """The name of the filter that gains refer to."""
        return self.axes.filters[self.axes.baseline]
