"""The laws of a number's error, as the documentation has them."""

import numpy as np

from radarsim.studies.error_law import OutlierLaw

THREE_SIGMA = 8**0.5  # the spread of near outliers of three times their σ


def outlier_law(near, far, offset=0.0, spread=THREE_SIGMA):
    """A law of outliers; near ones are of three times their σ if nothing else is said."""
    return OutlierLaw(near, far, offset, spread)


def error_laws(law, span, variance):
    """The probabilities, means and widths, in σ, of the stated law, those of near outliers to either side and those of
    far ones."""
    widest, near_width = max(span / variance**0.5, 10.0), (1 + law.spread**2) ** 0.5
    chances = np.array([1 - law.near - law.far, law.near / 2, law.near / 2, *[law.far / 6] * 6])
    means = np.array([0.0, law.offset, -law.offset, *[0.0] * 6])
    return chances, means, np.array([1.0, near_width, near_width, *np.geomspace(10.0, widest, 6)])
