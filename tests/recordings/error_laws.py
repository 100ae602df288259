"""The laws of a number's error, as the documentation has them."""

import numpy as np


def error_laws(shares, span, variance):
    """The probabilities and widths, in σ, of the stated law, that of near outliers and those of far ones."""
    near, far, _, near_width = shares
    widest = max(span / variance**0.5, 10.0)
    widths = np.concatenate([[1.0, near_width], np.geomspace(10.0, widest, 6)])
    return np.array([1 - near - far, near, *[far / 6] * 6]), widths
