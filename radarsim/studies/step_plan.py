"""The plan of a step study's case: what its blocks need, computed once, with the author's numbers checked."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from radarsim.engine.results import Axes
from radarsim.engine.sums import Layout
from radarsim.studies.noise import noise_key
from radarsim.studies.step_checks import DIFFERENT_FORMULA, record, to_array
from radarsim.studies.step_programs import CompiledFilter, Scene, cached_kernel, compile_filter, to_numbers, trace_scene
from radarsim.user_code.errors import user_code_error

if TYPE_CHECKING:
    from radarsim.config.experiment import Case
    from radarsim.studies.stepwise import StepStudy

BLOCK = 512  # realisations in a block


@dataclass(frozen=True)
class Plan:
    """Data of a block; see `radarsim.kernels.steps` for the arrays."""

    layout: Layout
    axes: Axes
    keys: np.ndarray
    detection: float
    known_quantities: np.ndarray
    width: int
    draw: Callable[..., None]
    numbers: np.ndarray
    scene: Scene
    filters: tuple[CompiledFilter, ...]
    case: "Case"
    checked: dict[str, np.ndarray] = field(default_factory=dict)
    block: int = BLOCK
    gaussian = False


def prepare_plan(study: "StepStudy", case: "Case") -> Plan:
    """The plan of a case. Raises ConfigError where the author's functions give what no block can use."""
    from radarsim.kernels import steps

    spec = case.spec
    axes, sums = study.axes(spec, exact_sigma(study, spec)), study.sums(spec)
    known_quantities = quantities_at_scans(study, spec, axes.t_s)
    world, detection = record(study.world, spec), plot_probability(study, spec)
    scene = trace_scene(study, spec, world)
    filters = tuple(compile_filter(study, spec, keys, scene, detection < 1) for keys in spec.filters)
    f, k, c = sums.shapes["paired"]
    if any(member.tested for member in filters):
        sums = Layout(**sums.shapes, believed=(f, k, c), nees=(f, k, 2))
    if scene.false:
        counts = f, k, 1 + len(study.counted)
        sums = Layout(**sums.shapes, estimates=(f, k, c), counts=counts, both=(f, k, c, 5))
    keys = np.stack([noise_key(case, stream) for stream in ("plots", "detections", "false plots")])
    draw = cached_kernel(
        steps.truth_kernel, scene.first, scene.following, scene.pairs, scene.plot_rows, scene.uniform_pairs
    )
    kernel_arguments = known_quantities.ravel(), known_quantities.shape[1], draw, to_numbers(world)
    return Plan(sums, axes, keys, detection, *kernel_arguments, scene, filters, case)


def plot_probability(study: "StepStudy", spec: Any) -> float:
    """The probability of a plot, checked."""
    probability = study.call(study.detection, spec)
    if not isinstance(probability, int | float) or not 0 <= probability <= 1:
        raise user_code_error(study.detection, f"must give a probability, from 0 to 1, got {probability!r}"[:200])
    return float(probability)


def exact_sigma(study: "StepStudy", spec: Any) -> np.ndarray | None:
    """The value of `exact_sigma`, checked."""
    if (values := study.call(study.exact_sigma, spec)) is None:
        return None
    shape = len(spec.filters), spec.scans, len(study.components)
    sigma = to_array(study.exact_sigma, values, "filters × scans × components")
    if sigma.shape != shape or (sigma < 0).any():
        raise user_code_error(study.exact_sigma, f"must give σ {shape}, none negative, got {sigma.shape}")
    return sigma


def quantities_at_scans(study: "StepStudy", spec: Any, t_s: np.ndarray) -> np.ndarray:
    """The time since the scan before, the known quantities, checked, and the time of each scan, (K, whole eights)."""
    count = len(study.known_columns) + study.false_quantities
    required = f"must give {count} columns of {t_s.size} finite numbers, as known_columns says; got "
    known_quantities, repeated = (study.call(study.known_quantities, spec, t_s) for _ in range(2))
    if (
        not isinstance(known_quantities, Sequence | np.ndarray)
        or isinstance(known_quantities, str)
        or len(known_quantities) != count
    ):
        size = f"{len(known_quantities)}" if isinstance(known_quantities, tuple | list) else repr(known_quantities)
        raise user_code_error(study.known_quantities, f"{required}{size}"[:200])
    values, repeated_values = (
        to_array(study.known_quantities, columns, f"{t_s.size} in each column")
        for columns in (known_quantities, repeated)
    )
    if values.shape[1:] != (t_s.size,) * bool(len(known_quantities)) or not np.isfinite(values).all():
        raise user_code_error(
            study.known_quantities, f"{required}{values.shape}, {np.sum(~np.isfinite(values))} of them not finite"
        )
    if not np.array_equal(values, repeated_values):
        raise user_code_error(study.known_quantities, f"{DIFFERENT_FORMULA}: draw in begin, move and plot, by normals")
    columns = [np.diff(t_s, prepend=t_s[0]), *values, t_s]
    padded = np.zeros((t_s.size, -(-len(columns) // 8) * 8))
    padded[:, : len(columns)] = np.transpose(columns)
    return padded
