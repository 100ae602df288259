"""The law of the errors of recorded plots, where it is not only the σ of a config: what a likelihood of plots takes
besides the keys."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

OUTLIERS, BIAS, CORRELATION, MANOEUVRES = EXPLANATIONS = ("outliers", "bias", "correlation", "manoeuvres")
NEAR, NEAR_WIDTH = "near", "near_width"  # the further fields of an ErrorLaw


@dataclass(frozen=True)
class ErrorLaw:
    """How errors deviate from those of the stated σ; by default they do not.

    outliers: their share among the numbers, of which the part `near` has `near_width` times its σ and the rest any size
    (`radarsim.kernels.likelihood`); bias: a constant error of a number that can show one, in its σ; correlation: of the
    errors of neighbouring plots, at the recording's usual interval; manoeuvres: the share of intervals in which the
    target manoeuvres far harder than in the others."""

    outliers: float = 0.0
    near: float = 0.5
    near_width: float = 3.0
    bias: float = 0.0
    correlation: float = 0.0
    manoeuvres: float = 0.0

    def shares(self) -> "np.ndarray":
        """The shares of near and far outliers and of hard manoeuvres, and the width of near outliers (4,), as
        `radarsim.kernels.likelihood` takes them."""
        import numpy as np

        return np.array([self.outliers * self.near, self.outliers * (1 - self.near), self.manoeuvres, self.near_width])


STATED_ERRORS = ErrorLaw()
