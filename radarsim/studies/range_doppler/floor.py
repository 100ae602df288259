"""The floor under σ of range, velocity and acceleration (P1): of a polynomial, and of a flight that is drawn."""

import numpy as np

from radarsim.engine.results import Axes
from radarsim.studies.floors import bound, missed_plots, static
from radarsim.studies.floors.bound import Bound, Floor
from radarsim.studies.range_doppler import scenario
from radarsim.studies.range_doppler.config import PLOTS_NEEDED, Keys


def floor(spec: Keys, axes: Axes) -> Floor | None:
    """A polynomial has the second degree, or its own where that is higher; of other motions none is defined, but
    where flights are drawn. A drawn bias of the plots is one more unknown of each realisation."""
    radar, t = spec.radar, np.asarray(axes.t_s, dtype=float)
    has_random_flight = scenario.is_random(spec.target)
    if has_random_flight and len(t) <= scenario.MAX_RANDOM_SCANS:
        prior, maps, products = flight_bound_inputs(spec, t)
    elif spec.target.kind == "polynomial":
        size = max(3, len(spec.target.coefficients))
        prior, maps = np.zeros((size, size)), static.polynomial(t, size)
        products = np.einsum("kdi,kdj->kdij", maps[:, :2], maps[:, :2])
    else:
        return None
    sigma = np.array([radar.sigma_range_m, radar.sigma_velocity_mps])
    biases = np.array([radar.sigma_bias_range_m, radar.sigma_bias_velocity_mps])
    bounds: dict[tuple[int, int], Bound] = {}

    def below(observes: int, start: int) -> Bound:
        bound_key = observes, start if radar.detection_probability < 1 else 0
        if bound_key not in bounds:
            bounds[bound_key] = plot_bound(start, prior, maps, products[:, :observes], sigma, biases, spec)
        return bounds[bound_key]

    filter_bounds = tuple(below(len(filter_.observes), filter_.plots_to_start) for filter_ in spec.filters)
    return Floor(bound.POSTERIOR if has_random_flight else bound.CRB, filter_bounds, below(2, PLOTS_NEEDED[2]))


def plot_bound(
    start: int,
    prior: np.ndarray,
    maps: np.ndarray,
    products: np.ndarray,
    sigma: np.ndarray,
    biases: np.ndarray,
    spec: Keys,
) -> Bound:
    """Of plots whose numbers d have derivatives with these mean products (K, D, p, p)."""
    scans, numbers, size = products.shape[:3]
    bias_numbers = np.flatnonzero(biases[:numbers])
    full_size = size + len(bias_numbers)
    information, prior_information, derivatives = (
        np.zeros((scans, full_size, full_size)),
        np.zeros((full_size, full_size)),
        np.zeros((scans, 3, full_size)),
    )
    prior_information[:size, :size], derivatives[..., :size] = prior, maps
    for d in range(numbers):
        information[:, :size, :size] += products[:, d] / sigma[d] ** 2
    for i, d in enumerate(bias_numbers.tolist(), start=size):  # the derivative of number d by its bias is 1
        information[:, i, :size] = information[:, :size, i] = maps[:, d] / sigma[d] ** 2
        information[:, i, i], prior_information[i, i] = 1 / sigma[d] ** 2, 1 / biases[d] ** 2
    if (chance := spec.radar.detection_probability) == 1:
        return static.static_bound(prior_information, information, derivatives, not scenario.is_random(spec.target))
    multiplicity, plot_numbers = np.ones((scans, 3), dtype=int), (True, numbers == 2, False)
    settling_scans = 0 if prior.any() else -(-size // numbers)
    return missed_plots.missed_plots_bound(
        prior_information,
        information,
        derivatives,
        np.full(scans, chance),
        multiplicity,
        (start,) * 3,
        settling_scans,
        plot_numbers,
    )


def flight_bound_inputs(spec: Keys, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Information (p, p) on what is drawn of a flight, and means over it of the derivatives (K, 3, p) of range,
    velocity and acceleration, and of their products (K, 2, p, p) of the first two (Van Trees 1968)."""
    spread = scenario.sigma_flight(spec.target)
    path, random_numbers = scenario.flight(spec.target, t), np.flatnonzero(spread)
    maps, products = (
        np.zeros((len(t), 3, len(random_numbers))),
        np.zeros((len(t), 2, len(random_numbers), len(random_numbers))),
    )
    for weights, shifts in scenario.displacements(spread):
        derivatives_of_nodes = derivatives(path, shifts, t)[..., random_numbers]
        maps += np.einsum("m,mkci->kci", weights, derivatives_of_nodes)
        products += np.einsum(
            "m,mkdi,mkdj->kdij", weights, derivatives_of_nodes[:, :, :2], derivatives_of_nodes[:, :, :2]
        )
    return np.diag(spread[random_numbers] ** -2.0), maps, products


def derivatives(path: np.ndarray, shifts: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Derivatives (M, K, 3, 6) of `scenario.displaced_motion` by its shifts (M, 6)."""
    moves, since = shifts[:, None, 3:], t[:, None]
    p, v = path[:, 0::3] + shifts[:, None, :3] + moves * since, path[:, 1::3] + moves
    r, radial, a = (part[..., None] for part in np.moveaxis(scenario.displaced_motion(path, shifts, t), 2, 0))
    u = p / r
    w = (v - radial * u) / r
    b = (path[:, 2::3] - a * u - 2 * radial * w) / r
    rows = [(u, since * u), (w, since * w + u), (b, since * b + 2 * w)]
    return np.stack([np.concatenate(row, axis=2) for row in rows], axis=2)
