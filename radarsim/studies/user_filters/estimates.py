"""Estimates and covariances that a user filter gives: copied, and checked for shape and type."""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np

from radarsim.errors import ConfigError

Estimates = tuple[np.ndarray, np.ndarray | None]  # (n, K, d), and covariances (n, K, d, d) where there are any


def parts(answer: Any) -> tuple[Any, Any]:
    """Estimates, and covariances or None, of a filter's answer: a tuple, or a list whose second has one more axis."""
    if isinstance(answer, list) and len(answer) == 2:
        x, P = (getattr(array, "ndim", 0) for array in answer)
        answer = tuple(answer) if x and x + 1 == P else answer
    return answer if isinstance(answer, tuple) and len(answer) == 2 else (answer, None)


def copy_estimates(answer: Any) -> Estimates:
    """Copies of estimates and covariances, which the filter cannot change later."""
    x, P = parts(answer)
    return plain(x), None if P is None else plain(P)


def stack_estimates(name: str, answers: Sequence[Estimates], labels: Sequence[str], axis: int) -> Any:
    """Estimates of several places in one array, and covariances, if any have them, in another.

    labels: of the places, for error messages."""
    stacks = []
    for array_name, arrays in zip(("estimates", "covariances"), zip(*answers, strict=True), strict=True):
        shapes = {label: array.shape for label, array in zip(labels, arrays, strict=True) if array is not None}
        first = next(iter(shapes), "")
        if different_label := next((label for label, shape in shapes.items() if shape != shapes[first]), ""):
            descriptions = " and ".join(f"{shapes[label]} at {label}" for label in (first, different_label))
            raise ConfigError(f"{name}: {array_name} must have one shape, got {descriptions}")
        if shapes:
            blank = np.full(shapes[first], np.nan)
            stacks.append(np.stack([blank if array is None else array for array in arrays], axis=axis))
    return tuple(stacks) if len(stacks) > 1 else stacks[0]


def plain(values: Any) -> np.ndarray:
    """A copy of values of any shape (n, …) as an array: not-a-number where they are masked."""
    if isinstance(values, np.ma.MaskedArray):
        return np.ma.filled(values.astype(float), np.nan)
    try:
        return np.array(values)
    except ValueError:  # rows of several lengths
        return np.array(None)  # which is refused, as it holds no numbers


def components_of(target: Any) -> tuple[str, ...]:
    """The components that a filter names in its attribute."""
    components = getattr(target, "components", ())
    return (components,) if isinstance(components, str) else tuple(components)


def check_estimates(
    name: str, answer: Any, n: int, K: int, components: Sequence[str], component_names: Sequence[str]
) -> Estimates:
    """Estimates (n, K, d) and their covariances, float64; raises ConfigError where they have another shape or type.

    component_names: those that the filter names, in the order of its last axis."""
    x, P = parts(answer)
    x = plain(x)
    x = x[..., None] if x.ndim == 2 else x
    _check_estimates(name, x, (n, K), len(component_names) or len(components), bool(component_names))
    d = x.shape[2]
    if P is not None and (P := plain(P)).dtype.kind not in "fiu":
        raise ConfigError(f"{name}: covariances must be real numbers, got {P.dtype}")
    if P is not None and P.shape != (n, K, d, d):
        raise ConfigError(f"{name}: covariances must have shape {(n, K, d, d)}, got {P.shape}")
    return x.astype(float), None if P is None else np.asarray(P, dtype=float)


def _check_estimates(
    name: str, x: np.ndarray, shape: tuple[int, int], max_components: int, has_named_components: bool
) -> None:
    """Raise ConfigError for estimates that are no real numbers (n, K, d).

    has_named_components: d must be max_components, not fewer."""
    n, K = shape
    if x.dtype.kind not in "fiu":
        raise ConfigError(f"{name}: estimates must be real numbers, got {x.dtype}")
    min_components = max_components if has_named_components else 1
    if x.ndim == 3 and x.shape[:2] == shape and min_components <= x.shape[2] <= max_components:
        return
    orders = itertools.permutations(range(3)) if x.ndim == 3 else ()
    fitting = (o for o in orders if x.shape[o[1]] == K and 1 <= x.shape[o[2]] <= max_components and o != (0, 1, 2))
    order = next(fitting, None)
    hint = f"; its axes are in another order: transpose{order} fixes it" if order else ""
    wanted_shape = f"(n, K, d) = ({n}, {K}, {f'{max_components}' if has_named_components else f'1 … {max_components}'})"
    raise ConfigError(f"{name}: estimates must have shape {wanted_shape}, got {x.shape}{hint}")


def columns_of(name: str, d: int, components: Sequence[str], component_names: Sequence[str]) -> list[int]:
    """The indices, among the state's components, of the d components that a filter estimates."""
    if unknown := [component for component in component_names if component not in components]:
        raise ConfigError(f"{name}: components: must be of {', '.join(components)}, got {', '.join(unknown)}")
    if len(set(component_names)) < len(component_names):
        raise ConfigError(f"{name}: components: must differ, got {', '.join(component_names)}")
    return [components.index(component) for component in component_names] or list(range(d))
