"""P3 (Butyrskiy): smoothing and extrapolation of sonar plots, missed plots, correlated errors.

Sums of F filters over K scans and components (coordinate by coordinate: value, rate and, where a filter has it,
acceleration): `error`, `paired`, `estimates` as everywhere; `believed` Σ of the variances that the filter claims; by
coordinate C: `joint` Σq, Σq², Σp, Σp² of q = eᵀP⁻¹e and p the product of the errors in value and rate, and `ahead` Σe
… Σe⁴ of the value extrapolated by one scan, in the row of the scan that it was extrapolated from.
"""

from dataclasses import dataclass

import numpy as np

from radarsim.config.load import Case
from radarsim.config.sonar import correlation_of
from radarsim.engine.moments import Layout
from radarsim.engine.results import Axes
from radarsim.exact import least_squares as exact
from radarsim.filters import sonar as filters
from radarsim.filters import sonar_banks as banks
from radarsim.kernels import sonar as kernels
from radarsim.kernels import sonar_patterns as pattern_kernels
from radarsim.models import sonar as models
from radarsim.studies import noise_key

BLOCK = 4096
MOST_OPEN = 9  # scans that may be missed up to which all patterns are told off for exact values: 512
NAMES = {
    "polar": (("r", "m"), ("b", "rad")),
    "cartesian": (("x", "m"), ("y", "m")),
    "cartesian_unbiased": (("x", "m"), ("y", "m")),
}
THIRD = {"depth": ("d", "m"), "elevation": ("e", "rad")}
FILTERS = {
    "kind: growing_memory": "least squares on all plots so far, the recursion (12)-(14)",
    "kind: window": "least squares on the last `plots` plots",
    "kind: kalman": "Kalman-Bucy (11), with manoeuvre_variance or without",
    "kind: fixed_gain": "α-β (degree 1) or α-β-γ (degree 2) at the steady gains",
    "kind: kalman_augmented": "plots' errors estimated beside the state, for correlated errors",
    "kind: kalman_differenced": "differences of neighbouring plots, for correlated errors",
}


@dataclass(frozen=True)
class Scene:
    """What is looked at: K times, C coordinates.

    t (K,) s; truth (K, C, 3) in the working frame, polar (K, C, 3) as measured; sigma (K, C) of the plots, infinite
    where a coordinate is not measured; nominal (C,) plots' σ in the working frame; rho (C,); walk (C,) a random
    acceleration; certain (K,) 1, 0 or -1 as in kernels.sonar_patterns.Sight.
    """

    t: np.ndarray
    truth: np.ndarray
    polar: np.ndarray
    sigma: np.ndarray
    nominal: np.ndarray
    rho: np.ndarray
    walk: np.ndarray
    certain: np.ndarray
    period: float
    probability: float


@dataclass(frozen=True)
class Plan:
    """All that a block needs; `sight` is None where all realisations share their gains."""

    layout: Layout
    axes: Axes
    world: kernels.World
    bank: tuple
    sight: tuple | None
    size: int
    believed: np.ndarray | None
    block: int = BLOCK


# ---- the scene ----------------------------------------------------------------------------------------------------
def schedule(sensor, scans: int) -> tuple[np.ndarray, np.ndarray]:
    """Times (K,) of all sonars' plots, in order, and σ (K, 2) of range and bearing, infinite where not measured."""
    t = [np.arange(scans) * sensor.scan_period_s]
    sigma = [np.tile([sensor.sigma_range_m, sensor.sigma_bearing_rad], (scans, 1))]
    for other in sensor.further:
        times = np.arange(other.first_s, t[0][-1] + 1e-9, other.scan_period_s)
        t.append(times)
        spread = [np.inf if s is None else s for s in (other.sigma_range_m, other.sigma_bearing_rad)]
        sigma.append(np.tile(spread, (len(times), 1)))
    order = np.argsort(np.concatenate(t), kind="stable")
    return np.concatenate(t)[order], np.concatenate(sigma)[order]


def courses(target, t: np.ndarray, third: str | None) -> tuple[np.ndarray, np.ndarray]:
    """States (K, C, 3) of a target in polar and in cartesian coordinates; a third coordinate is the same in both."""
    if target.kind == "turning":
        turns = [(leg.start_s, leg.end_s, leg.rate_radps) for leg in target.turns]
        flat = models.turning(target.x_m, target.y_m, target.speed_mps, target.course_rad, turns, t)
        polar = models.polar_states(*flat)
    elif target.frame == "polar":
        polar = models.polynomials([target.range_m, target.bearing_rad], t)
        flat = models.cartesian_states(*polar)
    else:
        flat = models.polynomials([target.x_m, target.y_m], t)
        polar = models.polar_states(*flat)
    if third is None:
        return np.stack(polar, axis=1), np.stack(flat, axis=1)
    beside = models.polynomials([getattr(target, {"depth": "depth_m", "elevation": "elevation_rad"}[third])], t)
    return np.stack([*polar, *beside], axis=1), np.stack([*flat, *beside], axis=1)


def third_of(sensor) -> tuple[str | None, float]:
    """Name and σ of the third coordinate, if there is one."""
    if sensor.sigma_depth_m is not None:
        return "depth", sensor.sigma_depth_m
    return ("elevation", sensor.sigma_elevation_rad) if sensor.sigma_elevation_rad is not None else (None, 0.0)


def scene(spec) -> Scene:
    """The scene of a case."""
    sensor, target = spec.sensor, spec.target
    third, spread = third_of(sensor)
    t, sigma = schedule(sensor, spec.scans)
    polar, flat = courses(target, t, third)
    if third is not None:
        own = np.isin(np.arange(len(t)), np.flatnonzero(sigma[:, 0] == sensor.sigma_range_m))
        sigma = np.column_stack([sigma, np.where(own, spread, np.inf)])
    nominal = sigma[0].copy()
    if spec.frame != "polar":
        xx, _, yy = models.converted(*polar[0, :2, 0], *nominal[:2])[2]
        nominal[:2] = np.sqrt(xx), np.sqrt(yy)
    walk = getattr(target, "fluctuation_mps2", 0.0)
    certain = np.full(len(t), 1 if sensor.detection_probability == 1 else -1)
    certain[0] = 1
    certain[[k - 1 for k in sensor.missed_scans if k <= len(t)]] = 0
    return Scene(
        t=t,
        truth=polar if spec.frame == "polar" else flat,
        polar=polar,
        sigma=sigma,
        nominal=nominal,
        rho=np.array([correlation_of(sensor.error_correlation, c) for c in range(sigma.shape[1])]),
        walk=walk * angular(spec, 1),
        certain=certain,
        period=sensor.scan_period_s,
        probability=sensor.detection_probability,
    )


def angular(spec, power: int) -> np.ndarray:
    """What turns a lateral (m/s²)^power into the units of each coordinate (C,): 1, and 1 / range^power for angles."""
    third, _ = third_of(spec.sensor)
    angle = spec.target.range_0() ** -float(power)
    units = [1.0, angle if spec.frame == "polar" else 1.0, {"depth": 1.0, "elevation": angle}.get(third, 0.0)]
    return np.array(units[: 2 if third is None else 3])


# ---- the filters --------------------------------------------------------------------------------------------------
def choices(spec) -> list[banks.Choice]:
    """The filters of a case, in the units of each coordinate."""
    found, coordinates = [], len(angular(spec, 2))
    for f in spec.filters:
        rho = spec.sensor.error_correlation if f.error_correlation is None else f.error_correlation
        known = f.kind in ("kalman_augmented", "kalman_differenced")
        found.append(
            banks.Choice(
                kind=f.kind,
                size=f.degree + 1,
                length=f.plots or 0,
                variance=(f.manoeuvre_variance or 0.0) * angular(spec, 2),
                rho=np.array([correlation_of(rho, c) if known else 0.0 for c in range(coordinates)]),
            )
        )
    return found


def plots_of(seen: Scene, c: int, came: np.ndarray) -> filters.Plots:
    """Plots of coordinate c under patterns came (M, K)."""
    weight = came * (seen.nominal[c] / seen.sigma[: came.shape[1], c]) ** 2
    return filters.Plots(seen.t[: came.shape[1]], weight, seen.period, seen.nominal[c])


def patterns(seen: Scene) -> tuple[np.ndarray, np.ndarray]:
    """All patterns (M, K') of plots that come in the first scans, as far as there are not too many, and their
    probabilities.
    """
    open_scans = np.cumsum(seen.certain < 0)
    reach = int(np.searchsorted(open_scans, MOST_OPEN, side="right"))
    free = np.flatnonzero(seen.certain[:reach] < 0)
    came = np.tile(np.maximum(seen.certain[:reach], 0), (2 ** len(free), 1))
    came[:, free] = (np.arange(2 ** len(free))[:, None] >> np.arange(len(free))) & 1
    number = came[:, free].sum(axis=1)
    return came, seen.probability**number * (1 - seen.probability) ** (len(free) - number)


# ---- exact values -------------------------------------------------------------------------------------------------
def true_errors(seen: Scene, choice: banks.Choice, c: int, came: np.ndarray) -> tuple[np.ndarray, ...]:
    """Bias (M, K, 3), covariance (M, K, 3, 3) and number of plots (M, K) of one filter in one coordinate."""
    plots, scans = plots_of(seen, c, came), came.shape[1]
    t, truth, sigma = (
        seen.t[:scans],
        seen.truth[:scans, c],
        np.where(np.isfinite(seen.sigma[:scans, c]), seen.sigma[:scans, c], 0.0),
    )
    if choice.kind != "window":
        design, steps = banks.designed(choice, c, plots), models.step_correlations(seen.rho[c], t, seen.period)
        errors = exact.recursive_errors(design.gain, design.carry, t, truth, steps, sigma, seen.walk[c])
        return *errors, design.plots
    bias, covariance = np.zeros((len(came), scans, 3)), np.zeros((len(came), scans, 3, 3))
    for k in range(scans):
        first, weights, _ = filters.window_weights(plots, k, choice.length, choice.size)
        C = models.error_covariance(sigma[first : k + 1], seen.rho[c], t[first : k + 1], seen.period)
        started = plots.moments()[:, k].min() >= choice.size
        bias[:, k], covariance[:, k] = exact.weighted_errors(
            weights, first, t, truth, C, seen.walk[c], first if started else 0
        )
    return bias, covariance, plots.moments()


def exact_values(spec, seen: Scene, wanted: list[banks.Choice], size: int) -> dict[str, np.ndarray]:
    """Exact σ and bias (F, K, C, size), σ one scan ahead and normalised error (F, K, C); not-a-number where not known.

    With random misses they are means over all patterns, each with its probability, as far as these can be told off.
    """
    F, K, C = len(wanted), len(seen.t), seen.truth.shape[1]
    made = {name: np.full((F, K, C, size), np.nan) for name in ("sigma", "bias")}
    made |= {name: np.full((F, K, C), np.nan) for name in ("ahead", "nees")}
    if spec.frame != "polar":
        return made
    came, probability = patterns(seen)
    reach = came.shape[1]
    for f, choice in enumerate(wanted):
        for c in range(C):
            bias, S, plots = true_errors(seen, choice, c, came)
            for j in range(choice.size):
                share = probability[:, None] * (plots > j)
                with np.errstate(invalid="ignore", divide="ignore"):
                    square = (share * (S[:, :, j, j] + bias[:, :, j] ** 2)).sum(axis=0) / share.sum(axis=0)
                    made["sigma"][f, :reach, c, j] = np.sqrt(square)
                    made["bias"][f, :reach, c, j] = (share * bias[:, :, j]).sum(axis=0) / share.sum(axis=0)
            full = probability[:, None] * (plots >= choice.size)
            made["ahead"][f, :reach, c] = _ahead(seen, c, bias, S, full)
            if len(came) == 1:
                believed = banks.believed(choice, c, plots_of(seen, c, came))[0]
                n = choice.size
                ready = np.flatnonzero(plots[0] >= n)
                unit = np.sqrt(np.diagonal(believed, axis1=1, axis2=2))[ready][:, :n]
                P = believed[ready][:, :n, :n] / (unit[:, :, None] * unit[:, None, :])
                scaled = S[0, ready][:, :n, :n] / (unit[:, :, None] * unit[:, None, :])
                made["nees"][f, ready, c] = exact.consistency(P, bias[0, ready][:, :n] / unit, scaled)
    return made


def _ahead(seen: Scene, c: int, bias: np.ndarray, S: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Exact σ (K',) of the value extrapolated to the next scan; not-a-number for the last."""
    reach = S.shape[1]
    out = np.full(reach, np.nan)
    for k in range(min(reach, len(seen.t) - 1)):
        dt = seen.t[k + 1] - seen.t[k]
        row = np.array([1.0, dt, dt**2 / 2])
        variance = np.einsum("i,mij,j->m", row, S[:, k], row) + (seen.walk[c] * dt**2 / 2) ** 2
        mean = bias[:, k] @ row + row @ seen.truth[k, c] - seen.truth[k + 1, c, 0]
        total = share[:, k].sum()
        if total > 0:
            out[k] = np.sqrt((share[:, k] * (variance + mean**2)).sum() / total)
    return out


# ---- the study ----------------------------------------------------------------------------------------------------
def prepare(case: Case) -> Plan:
    """Design the filters of a case and reckon the exact values of its errors."""
    spec, seen, wanted = case.spec, scene(case.spec), choices(case.spec)
    size = max(choice.size for choice in wanted)
    F, K, C = len(wanted), len(seen.t), seen.truth.shape[1]
    shared = spec.frame == "polar" and (seen.certain >= 0).all()
    came = np.maximum(seen.certain, 0)[None]
    by_coordinate = [plots_of(seen, c, came) for c in range(C)]
    bank = banks.shared(wanted, by_coordinate) if shared else banks.own(wanted, seen.t, seen.period, seen.nominal)
    layout = Layout(
        **dict.fromkeys(("paired", "estimates", "believed"), (F, K, C * size)),
        **{"error": (F, K, C * size, 4), "joint": (F, K, C, 4), "ahead": (F, K, C, 4)},
    )
    return Plan(
        layout=layout,
        axes=axes(spec, seen, wanted, size),
        world=world(case, seen),
        bank=bank,
        sight=None if shared else sight(case, seen),
        size=size,
        believed=banks.all_believed(wanted, by_coordinate) if shared else None,
    )


def world(case: Case, seen: Scene) -> kernels.World:
    """The kernels' world; its coordinates are padded to an even number."""
    K, C = seen.sigma.shape
    wide = C + C % 2
    measured = np.isfinite(seen.sigma)
    sigma = np.where(measured, seen.sigma, 0.0)
    steps = np.stack([models.step_correlations(rho, seen.t, seen.period) for rho in seen.rho], axis=1)
    fresh, truth, walk = np.zeros((K, wide)), np.zeros((K, wide, 3)), np.zeros(wide)
    fresh[:, :C], truth[:, :C], walk[:C] = sigma * np.sqrt(1 - steps**2), seen.truth, seen.walk
    padded = np.zeros((K, wide))
    padded[:, :C] = steps
    dt = np.diff(seen.t, prepend=seen.t[0])
    return kernels.World(noise_key(case, "plots"), noise_key(case, "motion"), dt, truth, padded, fresh, walk)


def sight(case: Case, seen: Scene) -> pattern_kernels.Sight:
    """Which plots come and how they are converted, for filters that go along with each realisation."""
    frame = ("polar", "cartesian", "cartesian_unbiased").index(case.spec.frame)
    return pattern_kernels.Sight(
        misses=noise_key(case, "misses"),
        certain=seen.certain,
        probability=seen.probability,
        weight=(seen.nominal / seen.sigma) ** 2,
        period=seen.period,
        sigma=seen.nominal,
        frame=frame,
        measured=np.ascontiguousarray(seen.polar[:, :2, 0]),
        spread=seen.sigma[0, :2].copy(),
    )


def axes(spec, seen: Scene, wanted: list[banks.Choice], size: int) -> Axes:
    """Labels and exact values."""
    F, K, C = len(wanted), len(seen.t), seen.truth.shape[1]
    third, _ = third_of(spec.sensor)
    coordinates = (*NAMES[spec.frame], *([THIRD[third]] if third else []))
    rates = (("", ""), ("v", "/s"), ("a", "/s2"))
    labels = tuple((before + name, unit + after) for name, unit in coordinates for before, after in rates[:size])
    values = exact_values(spec, seen, wanted, size)
    came = np.maximum(seen.certain, 0)[None] if (seen.certain >= 0).all() else np.ones((1, K))
    count = np.stack([plots_of(seen, c, came).moments()[0] for c in range(C)], axis=1)
    degree = np.array([choice.size for choice in wanted])
    available = (np.arange(size) < degree[:, None, None, None]) & (count[None, :, :, None] > np.arange(size))
    names = tuple(f.name for f in spec.filters)
    flat = (F, K, C * size)
    return Axes(
        filters=names,
        components=labels,
        k=np.arange(1, K + 1),
        t_s=seen.t,
        available=available.reshape(flat),
        baseline=names.index(spec.baseline) if spec.baseline else 0,
        exact_sigma=np.where(available, values["sigma"], np.nan).reshape(flat),
        exact_bias=np.where(available, values["bias"], np.nan).reshape(flat),
        extra={
            "coordinates": coordinates,
            "sizes": degree,
            "exact_ahead": values["ahead"],
            "exact_nees": values["nees"],
            "scan_period_s": seen.period,
            "sigma": seen.nominal,
            "rho": seen.rho,
            "sigma_of_plots": np.where(came.T > 0, seen.sigma, np.inf),
            "conversion_bias": plain_bias(spec, seen),
            "truth": seen.truth,
            "polar": seen.polar,
        },
    )


def plain_bias(spec, seen: Scene) -> float:
    """Mean error, along the line of sight, of the converted first plot, m; nought for the unbiased conversion."""
    plain = spec.frame == "cartesian"
    return float(models.conversion_bias(seen.polar[0, 0, 0], spec.sensor.sigma_bearing_rad)) if plain else 0.0


def simulate(plan: Plan, first: int, count: int) -> np.ndarray:
    """Sums of one block, in the order of the plan's layout."""
    F, K = len(plan.axes.filters), len(plan.axes.k)
    C = len(plan.axes.extra["coordinates"])
    shapes = {"error": (3, 4), "paired": (3,), "joint": (4,), "ahead": (4,), "believed": (3,), "estimates": (3,)}
    sums = kernels.Sums(**{name: np.zeros((F, K, C, *tail)) for name, tail in shapes.items()})
    if plan.sight is None:
        kernels.simulate_block(plan.world, plan.bank, first, count, plan.axes.baseline, sums)
        sums.believed[:] = count * plan.believed
        sums.estimates[:] = count * (plan.bank.known[..., None] > np.arange(3))
    else:
        pattern_kernels.simulate_block(plan.world, plan.sight, plan.bank, first, count, plan.axes.baseline, sums)
    picked = {
        name: getattr(sums, name)[:, :, :, : plan.size].reshape(plan.layout.shapes[name])
        for name in ("error", "paired", "believed", "estimates")
    }
    return plan.layout.pack(**picked, joint=sums.joint, ahead=sums.ahead)
