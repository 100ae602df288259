"""How P2's claims are measured: the paper's cases and filters, and numbers from the sums of the stages.

Cases are found by target, scan period and what their filters are, whatever their names; filters by family, merging rule
and bank."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from radarsim.papers.authoring import CaseResult, Estimate, MissingEvidence, shipped_spec
from radarsim.papers.authoring import Evidence as GeneralEvidence
from radarsim.studies.multimodel import cost, model_bank, tables

BANK_122 = ("uniform 0.05", "accelerated 0.05", "accelerated 30")
BANK_11 = ("uniform 5", "uniform 30")
MATRIX_122 = ((0.996, 0, 0.002), (0, 0.996, 0.002), (0.004, 0.004, 0.996))
MATRIX_11 = ((0.995, 0.01), (0.005, 0.99))
COMPONENTS = {"y": 3, "vy": 4}
STAGES = {  # the shipped flights, as their stages tell them apart: names, and ends in s
    "aeroballistic": (("start", 20), ("ballistic", 125), ("manoeuvre", 170), ("after", None)),
    "aeroballistic_gentle": (("start", 20), ("ballistic", 125), ("manoeuvre", 165), ("after", None)),
    "ballistic": (("start", 20), ("ballistic", None)),
    "airliner": (("start", 20), ("steady", None)),
    "weaving": (("start", 20), ("steady", 30), ("manoeuvre", 150), ("after", None)),
}


def is_flight(target: Any, flight: str) -> bool:
    """Whether a target of a shipped config is this flight."""
    return tuple((stage.name, stage.end_s) for stage in target.stages) == STAGES[flight]


class Evidence(GeneralEvidence):
    """Finds cases by (target's stages and kind, scan period), and filters by their settings."""

    def case(self, key: Any) -> CaseResult:
        """key: (name of the flight, scan period, filters that must be there)."""
        flight, period, filter_keys = key
        for result in self.results:
            spec = shipped_spec(result)
            is_case = is_flight(spec.target, flight) and np.isclose(spec.sensor.scan_period_s, period)
            if is_case and all(self._index(result, filter_key) is not None for filter_key in filter_keys):
                return result
        raise MissingEvidence(key)

    def _index(self, result: CaseResult, filter_key: tuple) -> int | None:
        """The number of a case's filter (family, rule, bank[, matrix]); the paper's matrix where none is named."""
        family, rule, bank, *matrix = filter_key
        printed = {BANK_122: MATRIX_122, BANK_11: MATRIX_11}.get(bank)
        for f, filter_keys in self.members(result):
            is_same = (
                filter_keys.family == family
                and model_bank.model_labels(filter_keys.models) == bank
                and (not rule or filter_keys.merge == rule)
            )
            expected = matrix[0] if matrix else printed
            T = model_bank.transition_matrix(filter_keys.transition)
            has_matrix = expected is None or (np.shape(expected) == T.shape and np.allclose(expected, T, atol=1e-9))
            if is_same and has_matrix and filter_keys.covariance_at == "plot":
                return f
        return None

    def filter(self, key: tuple, filter_key: tuple) -> int:
        """The number of a filter in a case; raises MissingEvidence."""
        index = self._index(self.case(key), filter_key)
        if index is None:
            raise MissingEvidence(filter_key)
        return index

    def stage(self, key: tuple, name: str) -> int:
        """The number of a stage of a case; raises MissingEvidence."""
        names = tables.stage_names(self.case(key))
        if name not in names:
            raise MissingEvidence(name)
        return names.index(name)

    def stage_gain(self, key: tuple, filter_key: tuple, base: tuple, stage: str, component: str) -> Estimate:
        """Paired gain of a filter against another over a stage, %."""
        result, s = self.case(key), self.stage(key, stage)
        return tables.stage_gain(result, self.filter(key, filter_key), self.filter(key, base), s, COMPONENTS[component])

    def probability(self, key: tuple, filter_key: tuple, stage: str, model: int) -> Estimate:
        """Mean probability of a model (from 1) over the reported scans of a stage; ends of intervals are averaged."""
        result, f = self.case(key), self.filter(key, filter_key)
        table = self.tables["probabilities"]
        t = self._bounds(result, stage)
        is_model = (
            (table["case"] == result.name) & (table["filter"] == result.axes.filters[f]) & (table["model"] == model)
        )
        rows = table[is_model & (table["t_s"] >= t[0]) & (table["t_s"] < t[1])]
        return Estimate(*(float(rows[name].mean()) for name in ("probability", "probability_lo", "probability_hi")))

    def _bounds(self, result: CaseResult, stage: str) -> tuple[float, float]:
        if stage == "whole":
            return 0.0, np.inf
        for name, begin, end in tables.stage_bounds(result):
            if name == stage:
                last = name == tables.stage_names(result)[-1]
                return begin, np.inf if last else end
        raise MissingEvidence(stage)

    def operations(self, key: tuple, filter_key: tuple) -> float:
        """Operations of one update, mean over the whole flight."""
        result = self.case(key)
        name = result.axes.filters[self.filter(key, filter_key)]
        return float(self.row("operations", case=result.name, filter=name, stage="whole")["operations"])


def growth_of_change(evidence: Evidence, key: tuple) -> float:
    """The probability to leave a model, the largest of a filter's, within 20 intervals over that within one; the least
    of a case's filters of several models."""
    growths = []
    for options in evidence.case(key).spec.filters:
        T = model_bank.transition_matrix(options.transition)
        if len(T) > 1:
            later = model_bank.transition_powers(T, np.array([20.0]))[0]
            growths.append(np.max(1 - np.diag(later)) / np.max(1 - np.diag(T)))
    return float(min(growths))


def largest_fault_of_powers(evidence: Evidence, key: tuple, tenfold: bool) -> float:
    """The largest element, over a case's filters, of T(Δt/10⁶) − I, or of T(10 Δt) − T(Δt)¹⁰ where tenfold."""
    faults = []
    for options in evidence.case(key).spec.filters:
        T = model_bank.transition_matrix(options.transition)
        near, ten = model_bank.transition_powers(T, np.array([1e-6, 10.0]))
        product = np.linalg.multi_dot([T] * 10) if len(T) > 1 else T
        faults.append(np.abs(ten - product if tenfold else near - np.eye(len(T))).max())
    return float(max(faults))


def early_merging_fault(evidence: Evidence, key: tuple, filter_key: tuple) -> float:
    """The largest relative difference of merging hypotheses before a model extrapolates them and after, on an axis. The
    hypotheses are drawn at random; weights are those of (7), merged by moments (4)."""
    options = evidence.case(key).spec.filters[evidence.filter(key, filter_key)]
    T = model_bank.transition_matrix(options.transition)
    dt = float(evidence.case(key).spec.sensor.scan_period_s)
    rng = np.random.default_rng(1)
    p = rng.dirichlet(np.ones(len(T)))
    x, root = rng.normal(size=(len(T), 3)), rng.normal(size=(len(T), 3, 3))
    P = root @ np.swapaxes(root, 1, 2)
    faults = []
    for n, model in enumerate(options.models):
        moves, accelerates = model_bank.MOTIONS[model.motion]
        F = np.array([[1, moves * dt, accelerates * dt**2 / 2], [0, 1, accelerates * dt], [0, 0, accelerates]])
        G = np.array([dt**2 / 2, dt, accelerates])
        Q = model.sigma_acceleration_mps2**2 * np.outer(G, G)
        weight = T[n] * p / (T[n] @ p)
        early, late = _moments(weight, x, P), _moments(weight, x @ F.T, F @ P @ F.T + Q)
        for merged_before, merged_after in ((F @ early[0], late[0]), (F @ early[1] @ F.T + Q, late[1])):
            faults.append(float(np.abs(merged_before - merged_after).max() / np.abs(merged_after).max()))
    return max(faults)


def _moments(weight: np.ndarray, x: np.ndarray, P: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean (3,) and covariance (3, 3) of hypotheses (n, 3), (n, 3, 3) by (4)."""
    mean = weight @ x
    deviations = x - mean
    return mean, np.einsum("i,ijk->jk", weight, P + deviations[:, :, None] * deviations[:, None, :])


def cost_of_merging_early(evidence: Evidence, key: tuple, filter_key: tuple) -> float:
    """Operations of a scan of a filter that extrapolates what is merged, over one that merges what is extrapolated."""
    options = evidence.case(key).spec.filters[evidence.filter(key, filter_key)]
    merges = np.count_nonzero(model_bank.transition_matrix(options.transition))
    early, late = (
        fixed + merge * merges + once
        for fixed, merge, once in (cost.operations_of(options, merged_first) for merged_first in (True, False))
    )
    return float(early / late)


def blocks_over_power(
    evidence: Evidence,
    key: tuple,
    filter_key: tuple,
    family: str,
    blocks: Literal["extrapolations", "updates"],
    power: int,
) -> float:
    """Extrapolations or updates of a family with a filter's bank of N models, over a power of N."""
    options = evidence.case(key).spec.filters[evidence.filter(key, filter_key)]
    T = model_bank.transition_matrix(options.transition)
    counts = cost.model_counts(family, T, merged_first=False)[blocks == "updates"]
    return float(counts.sum() / len(T) ** power)


def bend(range_m: float, sigma_range_m: np.ndarray, sigma_angle_rad: np.ndarray) -> np.ndarray:
    """The part of a plot's mean squared error that linearisation omits along the line of sight, over what it has. A
    plot converted to rectangular coordinates falls short by r(α² + β²)/2, whose mean square is 2r²σ⁴."""
    return 2 * (range_m * sigma_angle_rad**2 / sigma_range_m) ** 2


SIGMA_RANGE_M, SIGMA_ANGLE_RAD = (1.0, 150.0), tuple(np.radians(np.array([2.0, 15.0]) / 60))  # as P2 prints them


def share_linear(
    evidence: Evidence | None, key: tuple, range_m: float, even_logarithms: bool = False, max_bend: float = 0.1
) -> float:
    """Share of the printed accuracies of radars with a `bend` of at most so much; each range is spread evenly."""
    steps = 1000
    middles = (np.arange(steps) + 0.5) / steps
    axes = [
        low * (high / low) ** middles if even_logarithms else low + (high - low) * middles
        for low, high in (SIGMA_RANGE_M, SIGMA_ANGLE_RAD)
    ]
    return float(np.mean(bend(range_m, *np.meshgrid(*axes)) <= max_bend))


def gain_over_best(
    evidence: Evidence, key: tuple, filter_key: tuple, rivals: Sequence[tuple], stage: str, component: str
) -> Estimate:
    """The paired gain of a filter over the best of its rivals over a stage, %."""
    return min(
        (evidence.stage_gain(key, filter_key, rival, stage, component) for rival in rivals), key=lambda gain: gain.value
    )


def lead(evidence: Evidence, key: tuple, filter_key: tuple, stage: str, model: int) -> Estimate:
    """By how much a model's mean probability exceeds the largest of the others'."""
    models = range(1, len(filter_key[2]) + 1)
    probability = evidence.probability(key, filter_key, stage, model)
    largest = max(
        (evidence.probability(key, filter_key, stage, m) for m in models if m != model),
        key=lambda estimate: estimate.value,
    )
    return Estimate(probability.value - largest.value, probability.lo - largest.hi, probability.hi - largest.lo)


def operations_ratio(evidence: Evidence, key: tuple, filter_key: tuple, base: tuple) -> float:
    """Ratio of counted operations of two filters."""
    return evidence.operations(key, filter_key) / evidence.operations(key, base)
