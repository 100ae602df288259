"""Which choices give most of the numbers that P4 prints: spreads and windows of thousands of readings, exactly."""

import itertools
from typing import Any, get_args

import numpy as np

from radarsim.report.claims.over import Printed, Search
from radarsim.studies.discriminator import versions
from radarsim.studies.discriminator.measures import ESTIMATE, SPREADS
from radarsim.studies.discriminator.readings import BURST, LEAST_RATIO, PRINTED_PRIOR
from radarsim.studies.discriminator.versions import Version

NOISES, THRESHOLDS, FACTORS = ("9", "2.25"), ("0.5", "1"), ("3", "2.326")
FORECASTS = {"numbers": PRINTED_PRIOR, "multiples": None}
AMPLITUDES = {"1.17": ESTIMATE, "1": 1.0}
COUNTED = ("after the first", "in all")
AXES: dict[str, tuple[str, ...]] = {
    **{"noise_variance": NOISES, "threshold": THRESHOLDS, "factor": FACTORS, "forecast": tuple(FORECASTS)},
    **{"first_phase": get_args(versions.Phase), "rounding": get_args(versions.Rounding)},
    **{"curvature": get_args(versions.Curvature), "pulses": ("30000", "29999"), "sum": get_args(versions.Sum)},
}
FURTHER = {"counted": COUNTED, "amplitude": tuple(AMPLITUDES)}
SHARE = 0.01  # of a number, under the granular rule
READ_AS = "To the digit: what rounds to the print. To the steps of the print: within 1 % of it."


def _printed(claim: str, what: str, unit: str, text: str) -> Printed:
    value, half = float(text), 0.5 * 10.0 ** -len(text.partition(".")[2])
    wide = max(half, SHARE * value)
    return Printed(claim, what, unit, text, (value - half, value + half), (value - wide, value + wide))


PRINTED = (
    *(_printed("P4.1", f"potential spread of {name}", unit, text) for name, (text, unit) in SPREADS.items()),
    _printed("P4.2", "first window", "ms", "1.79"),
    _printed("P4.2", "shortest window", "ms", "1.31"),
    _printed("P4.3", "iterations", "", "12"),
)


def search() -> Search:
    """The eight printed numbers under every combination of the choices."""
    every = [_version(*names) for names in itertools.product(*AXES.values())]
    found = versions.designed(BURST, every)
    first = np.array([own[0] if own else np.nan for own in found.windows])
    count = np.array([len(own) if own else np.nan for own in found.windows])
    noise = np.array([one.noise_variance for one in every])
    shape = tuple(len(values) for values in (*AXES.values(), *FURTHER.values()))
    values = np.empty((len(PRINTED), len(every), len(COUNTED), len(AMPLITUDES)), dtype=np.float64)
    values[:5] = found.spreads.T[:, :, None, None]
    values[5] = 1e3 * BURST.period_s * first[:, None, None]
    shortest = [4 * LEAST_RATIO * 1e3 * BURST.period_s * noise / amplitude**2 for amplitude in AMPLITUDES.values()]
    values[6] = np.array(shortest).T[:, None, :]
    values[7] = np.stack([count - 1, count], axis=1)[:, :, None]
    values = values.reshape(len(PRINTED), *shape)
    strict, granular = (_inside(values, [getattr(one, rule) for one in PRINTED]) for rule in ("strict", "granular"))
    axes = AXES | FURTHER
    shipped = {key: own[0] for key, own in axes.items()}
    return Search("P4", PRINTED, axes, shipped, strict, granular, values, read_as=READ_AS)


def _version(*names: str) -> Version:
    of: Any = dict(zip(AXES, names, strict=True))
    return Version(
        float(of["noise_variance"]),
        float(of["threshold"]),
        float(of["factor"]),
        FORECASTS[of["forecast"]],
        of["first_phase"],
        of["rounding"],
        of["curvature"],
        int(of["pulses"]),
        of["sum"],
    )


def _inside(values: np.ndarray, ends: list[tuple[float, float]]) -> np.ndarray:
    low, high = (np.array(part).reshape(-1, *(1,) * (values.ndim - 1)) for part in zip(*ends, strict=True))
    return (values >= low * (1 - 1e-12)) & (values <= high * (1 + 1e-12))
