"""The law of the errors of recorded plots, where it is not only the σ of a config: what a likelihood of plots takes
besides the keys."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    import numpy as np

CLEAR_RISE = 5.4138  # gain of the log-likelihood by chance in one recording of 1000: half that point of chi-square
OUTLIERS, BIAS, CORRELATION, MANOEUVRES = EXPLANATIONS = ("outliers", "bias", "correlation", "manoeuvres")


class OutlierLaw(NamedTuple):
    """The outliers among numbers of one kind: the shares of near and of far ones.

    A near outlier is off by `offset` to either side, with a normal error of `spread` added to the stated one, both in
    the stated σ; a far one by any size (`radarsim.kernels.likelihood`)."""

    near: float
    far: float
    offset: float
    spread: float

    @property
    def share(self) -> float:
        """The share of outliers."""
        return self.near + self.far

    @property
    def near_width(self) -> float:
        """The root mean square of near outliers, in the stated σ."""
        return math.sqrt(1 + self.offset**2 + self.spread**2)


@dataclass(frozen=True)
class ErrorLaw:
    """How errors deviate from those of the stated σ; by default they do not.

    outliers: their share among the numbers, of which half are normal of three times their σ and half far. outlier_laws:
    in place of these, those of each kind of numbers, or one law of all. bias: a constant error of a number that can
    show one, in its σ; correlation: of the errors of neighbouring plots, at the recording's usual interval; manoeuvres:
    the share of intervals in which the target manoeuvres far harder than in the others."""

    outliers: float = 0.0
    bias: float = 0.0
    correlation: float = 0.0
    manoeuvres: float = 0.0
    outlier_laws: tuple[OutlierLaw, ...] = ()

    def outlier_rows(self, count: int) -> "np.ndarray":
        """The law of outliers of each number of a plot (count, 4), as `radarsim.kernels.likelihood` takes them."""
        import numpy as np

        laws = self.outlier_laws or (OutlierLaw(self.outliers / 2, self.outliers / 2, 0.0, math.sqrt(8.0)),)
        return np.array(laws * (count if len(laws) == 1 else 1))


STATED_ERRORS = ErrorLaw()
