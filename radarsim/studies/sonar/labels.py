"""Labels of the sums that all parts of the study share, and the axes of filters with known association."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from radarsim.studies.sonar import filter_design
from radarsim.studies.sonar.axes import GivenPlotsAxes
from radarsim.studies.sonar.config import Keys
from radarsim.studies.sonar.conversion import conversion_bias
from radarsim.studies.sonar.scene import Scene, third_coordinate

THIRD = {"depth": ("d", "m"), "elevation": ("e", "rad")}


def coordinates(spec: Keys) -> tuple[tuple[str, str], ...]:
    """Names and units of the coordinates that the filters work in."""
    third, _ = third_coordinate(spec.sensor)
    first_two = (("r", "m"), ("b", "rad")) if spec.frame == "polar" else (("x", "m"), ("y", "m"))
    return (*first_two, *([THIRD[third]] if third else []))


def labels(spec: Keys, size: int) -> tuple[tuple[str, str], ...]:
    """Names and units of all components: each coordinate with its rate and, for size 3, its acceleration."""
    rates = (("", ""), ("v", "/s"), ("a", "/s2"))[:size]
    return tuple((prefix + name, unit + per) for name, unit in coordinates(spec) for prefix, per in rates)


def common_labels(
    spec: Keys, scene: Scene, sizes: np.ndarray, available: np.ndarray, values: Mapping[str, np.ndarray]
) -> dict[str, Any]:
    """The fields of `SonarAxes`, by name; available (F, K, C, size), values as `exact_values` returns them."""
    F, K, C, size = available.shape
    flat = (F, K, C * size)
    names = tuple(member.name for member in spec.filters)
    return {
        "filters": names,
        "components": labels(spec, size),
        "k": np.arange(1, K + 1),
        "t_s": scene.t,
        "available": available.reshape(flat),
        "baseline": names.index(spec.baseline) if spec.baseline else 0,
        "exact_sigma": np.where(available, values["sigma"], np.nan).reshape(flat),
        "exact_bias": np.where(available, values["bias"], np.nan).reshape(flat),
        "coordinates": coordinates(spec),
        "sizes": sizes,
        "exact_ahead": values["ahead"],
        "exact_nees": values["nees"],
        "scan_period_s": scene.period,
        "sigma": scene.nominal,
    }


def given_plots_axes(
    spec: Keys,
    scene: Scene,
    specs: Sequence[filter_design.FilterSpec],
    values: Mapping[str, np.ndarray],
    estimated_sizes: np.ndarray | None = None,
) -> GivenPlotsAxes:
    """Labels and exact values of a case.

    estimated_sizes (F, K, C): numbers of estimated components, by default as many as the plots may determine."""
    size = values["sigma"].shape[3]
    possible = (scene.certain != 0).astype(float)[None]
    sizes = np.array([filter_spec.size for filter_spec in specs])
    if estimated_sizes is None:
        times = [scene.plots(c, possible).moments()[0] for c in range(len(scene.nominal))]
        estimated_sizes = np.minimum(np.stack(times, axis=1)[None], sizes[:, None, None])
    plain = spec.frame == "cartesian"
    return GivenPlotsAxes(
        **common_labels(spec, scene, sizes, estimated_sizes[..., None] > np.arange(size), values),
        rho=scene.rho,
        sigma_of_plots=np.where(possible.T > 0, scene.sigma, np.inf),
        conversion_bias=float(conversion_bias(scene.polar[0, 0, 0], spec.sensor.sigma_bearing_rad)) if plain else 0.0,
        polar=scene.polar,
    )
