"""The sums of a block: their shapes, and how they are packed.

Sums of F filters over K scans and components (for each coordinate: value, rate and, where a filter has it,
acceleration): `error`, `paired`, `estimates` as in every study; `believed` Σ of the variances that the filter believes.
For each of C coordinates: `joint` Σq, Σq², Σp, Σp² of q = eᵀP⁻¹e and of p, the product of the errors in value and rate;
and `ahead` Σe … Σe⁴ of the value extrapolated by one scan, in the row of the scan that it is extrapolated from."""

import numpy as np

from radarsim.engine.sums import Layout
from radarsim.studies.sonar.kernels import shared_gains


def shapes(F: int, K: int, C: int, size: int) -> dict[str, tuple[int, ...]]:
    """Shapes of the sums of all cases with gains, for F filters with at most `size` components in a coordinate."""
    sums = dict.fromkeys(("paired", "estimates", "believed"), (F, K, C * size))
    return sums | {"error": (F, K, C * size, 4), "joint": (F, K, C, 4), "ahead": (F, K, C, 4)}


def empty_sums(F: int, K: int, C: int) -> shared_gains.Sums:
    """The sums that the kernels add to: always three components in a coordinate."""
    tails = {"error": (3, 4), "paired": (3,), "joint": (4,), "ahead": (4,), "believed": (3,), "estimates": (3,)}
    return shared_gains.Sums(**{name: np.zeros((F, K, C, *tail)) for name, tail in tails.items()})


def pack_sums(layout: Layout, sums: shared_gains.Sums, **more: np.ndarray) -> np.ndarray:
    """The sums of a block in the order of a layout, without those that it does not contain; more: sums of one part."""
    size = layout.shapes["error"][2] // sums.error.shape[2]
    arrays = dict(more)
    for name, values in sums._asdict().items():
        if name in layout.shapes:
            part = values if name in ("joint", "ahead") else values[:, :, :, :size]
            arrays[name] = part.reshape(layout.shapes[name])
    return layout.pack(**{name: values for name, values in arrays.items() if name in layout.shapes})


def flatten_errors(errors: np.ndarray) -> np.ndarray:
    """Reorder errors (F, K, C, S, n) to (F, n, K, C S)."""
    return np.moveaxis(errors.reshape(*errors.shape[:2], -1, errors.shape[4]), 3, 1)
