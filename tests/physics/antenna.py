"""The way back from antenna coordinates to what is measured, which no filter takes."""

import numpy as np


def to_biconical(antenna):
    """Range, elevation and azimuth (…, 3) of antenna coordinates in front of the antenna: the inverse of eq. (10)."""
    r = np.linalg.norm(antenna, axis=-1)
    return np.stack([r, np.arcsin(antenna[..., 1] / r), np.arcsin(antenna[..., 2] / r)], axis=-1)
