"""P1's study: the plan of a case, the exact values of its filters, and the sums of a block of realisations."""

from dataclasses import dataclass, replace
from functools import cached_property
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from radarsim.config.experiment import Case
from radarsim.engine.results import Axes
from radarsim.engine.sums import Layout
from radarsim.studies.range_doppler import error_recursion, package_filters, scenario, steady_state
from radarsim.studies.range_doppler.config import Best, Filter, Keys
from radarsim.studies.range_doppler.designed_case import DesignedCase, design_case

if TYPE_CHECKING:
    from radarsim.kernels import second_order
    from radarsim.studies.range_doppler.kernels import missed_block

COMPONENTS = (("r", "m"), ("Vr", "m/s"), ("ar", "m/s2"))
BLOCK = 4096  # 8 chunks of 512; 0.4 ms with two filters and 15 scans


@dataclass(frozen=True, kw_only=True)
class RangeDopplerAxes(Axes):
    """Labels of P1's sums, and what its tables need beside them: F filters, K scans, components r, Vr, ar."""

    #: (F, K, 3, 3) covariance that a filter believes, m, m/s, m/s²; zero without an estimate, or if plots may be missed
    believed: np.ndarray
    exact_nees: np.ndarray  #: (F, K) expectation of eᵀP⁻¹e per estimated component, no unit
    exact_gain: np.ndarray  #: (F, K, 3) gain in per cent against the baseline, where both have an estimate
    observes: np.ndarray  #: (F,) 1: filters of the range, 2: of range and velocity
    manoeuvre_variance: np.ndarray  #: (F,) D_M in (m/s³)²
    criteria: tuple[Best | None, ...]  #: what a filter's D_M minimises; None where it is given
    process_noise: tuple[str, ...]  #: forms of their Q; "" of a filter of a package
    steady_gain: np.ndarray  #: (F, 3, 2) a package's gain in the long run; not-a-number where there is none
    sigma: np.ndarray  #: (2,) standard deviations of the plots, m and m/s
    scan_period_s: float
    C_theta: float  #: σ_r²/(Δt²σ_V²) (eq. 11), no unit
    wavelength_m: float
    repetition_rate_hz: float
    speed_mps: float  #: the target's greatest radial speed at a scan
    plain: bool  #: every scan has its plot, which errs by noise alone, as in the paper

    @property
    def exact_gains(self) -> np.ndarray:
        return self.exact_gain


@dataclass(frozen=True)
class Plan:
    """All that a block needs. The kernels' problem is built with the first block, as loading the compiler takes half
    a second.

    gaussian: whether the errors are, with the exact bias and σ of the axes, and in sums of the common kind."""

    case: Case
    design: DesignedCase
    axes: RangeDopplerAxes
    block: int = BLOCK

    @property
    def gaussian(self) -> bool:
        return self.design.plain

    @cached_property
    def layout(self) -> Layout:
        return Layout(**self.world.kernel.shapes(len(self.design.filters), len(self.design.t)))

    @cached_property
    def problem(self) -> "second_order.Problem | missed_block.Problem":
        """What is simulated, as the kernel takes it."""
        problem: second_order.Problem | missed_block.Problem
        problem = self.world.problem(self.case, self.design, self.axes.baseline)
        return problem

    @property
    def world(self) -> ModuleType:
        """The module with the kernel and its problem: for the paper's world with shared gains, for any other one with
        gains of each realisation. Each loads the compiler and kernels of its own."""
        if self.design.plain:
            from radarsim.studies.range_doppler import shared_gains_kernel

            return shared_gains_kernel
        from radarsim.studies.range_doppler import individual_gains_kernel

        return individual_gains_kernel


def prepare(case: Case) -> Plan:
    """Design the filters of a case, its truth, and the exact values of its errors."""
    designed_case = design_case(case)
    return Plan(case, designed_case, axes(designed_case))


def shorten_case(case: Case, at_s: float | None, at_k: int | None) -> Case:
    """The case up to a time (s) or scan; later scans change the errors there only through an optimised D_M."""
    spec: Keys = case.spec
    scenario.true_motion(case)
    if not all(isinstance(f, Filter) and isinstance(f.manoeuvre_variance, float) for f in spec.filters):
        return case  # gains of a package may depend on how many scans there are
    until = spec.plots
    if at_k is not None and at_k > 0:
        until = min(at_k, until)
    elif at_s is not None and 0 <= at_s < until * spec.radar.scan_period_s:
        until = min(int(at_s / spec.radar.scan_period_s) + 2, until)  # the scans before and after it
    scans = max(until, *(f.plots_to_start for f in spec.filters))
    return replace(case, spec=spec.model_copy(update={"scans": scans}), asked_from_k=max(1, until - 1))


def exact_but_for(case: Case) -> str:
    """How exact σ of missed plots is, where not every pattern of plots is followed on its own."""
    spec: Keys = case.spec
    if spec.radar.detection_probability == 1:
        return ""
    from radarsim.studies.range_doppler import missed_plot_patterns

    if 2**spec.plots <= missed_plot_patterns.FOLLOWED_PATTERNS:
        return ""
    return "averaged over detection patterns, similar ones merged; accurate to about 1e-4"


def is_costly(case: Case) -> bool:
    """Whether patterns of plots are so many that merging most of them spares work."""
    if case.spec.radar.detection_probability == 1:
        return False
    from radarsim.studies.range_doppler import missed_plot_patterns

    return bool(2**case.spec.plots > missed_plot_patterns.PATTERNS_AT_ONCE)


def axes(designed_case: DesignedCase) -> RangeDopplerAxes:
    """Labels and exact values."""
    spec, radar = designed_case.spec, designed_case.spec.radar
    names = tuple(f.name for f in spec.filters)
    baseline = names.index(spec.baseline) if spec.baseline else 0
    available = np.stack([d.available for d in designed_case.filters])
    exact = (
        exact_values(designed_case, baseline)
        if radar.detection_probability == 1
        else exact_means(designed_case, baseline)
    )
    return RangeDopplerAxes(
        filters=names,
        components=COMPONENTS,
        k=np.arange(1, len(designed_case.t) + 1),
        t_s=designed_case.t,
        available=available,
        baseline=baseline,
        exact_sigma=np.where(available, exact.sigma, np.nan),
        exact_bias=np.where(available, exact.bias, np.nan),
        believed=exact.believed,
        exact_nees=exact.nees,
        exact_gain=exact.gain,
        observes=designed_case.observes,
        manoeuvre_variance=np.array(designed_case.variances),
        criteria=designed_case.criteria,
        process_noise=tuple(f.process_noise if isinstance(f, Filter) else "" for f in spec.filters),
        steady_gain=np.stack([package_filters.steady_gain(d) for d in designed_case.filters]),
        sigma=designed_case.plots.sigma,
        scan_period_s=designed_case.dt,
        C_theta=float(designed_case.plots.sigma[0] ** 2 / (designed_case.dt**2 * designed_case.plots.sigma[1] ** 2)),
        wavelength_m=radar.wavelength_m,
        repetition_rate_hz=radar.repetition_rate_hz,
        speed_mps=float(np.abs(designed_case.x[:, 1]).max()),
        plain=radar.as_the_papers,
    )


@dataclass(frozen=True)
class ExactErrors:
    """Exact values: sigma, bias and gain (F, K, 3), NEES (F, K), and the believed covariance (F, K, 3, 3)."""

    sigma: np.ndarray
    bias: np.ndarray
    gain: np.ndarray
    nees: np.ndarray
    believed: np.ndarray


def exact_values(designed_case: DesignedCase, baseline: int) -> ExactErrors:
    """Of filters that get every plot."""
    inputs = designed_case.plots, designed_case.x, designed_case.dt, designed_case.random_truth
    errors = [
        package_filters.error_recursion(d, *inputs)
        if d.has_given_gains
        else error_recursion.error_recursion(d, *inputs)
        for d in designed_case.filters
    ]
    lasting, covariance = np.stack([E for E, _ in errors]), np.stack([S for _, S in errors])
    bias, random_columns = lasting[..., 0], lasting[..., 1:]
    covariance = covariance + np.einsum("fkic,fkjc->fkij", random_columns, random_columns)
    available, believed = (
        np.stack([getattr(d, attribute) for d in designed_case.filters]) for attribute in ("available", "believed")
    )
    moment = covariance + bias[..., :, None] * bias[..., None, :]
    with np.errstate(invalid="ignore"):  # a filter that diverges has variances below zero by rounding: no σ
        root = np.sqrt(np.diagonal(covariance, axis1=2, axis2=3) + bias**2)
    return ExactErrors(
        root, bias, gains(root, root[baseline]), expected_nees(believed, bias, moment, available), believed
    )


def expected_nees(believed: np.ndarray, bias: np.ndarray, moment: np.ndarray, available: np.ndarray) -> np.ndarray:
    """The expectation (F, K) of eᵀP⁻¹e per estimated component."""
    return steady_state.normalised_error(believed, bias, moment, available)[0]


def gains(sigma: np.ndarray, base: np.ndarray) -> np.ndarray:
    """Relative gains in per cent (eq. 17)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return 100 * (1 - sigma / base)


def exact_means(designed_case: DesignedCase, baseline: int) -> ExactErrors:
    """Of filters that miss plots, as means over the patterns: not-a-number where these are too many to be exact."""
    shape = (len(designed_case.filters), len(designed_case.t), 3)
    sigma, bias, gain = (np.full(shape, np.nan) for _ in range(3))
    nees = np.full(shape[:2], np.nan)
    from radarsim.studies.range_doppler import missed_plot_means

    is_rough_end = designed_case.roughly and designed_case.asked_from_k > 0
    if len(designed_case.t) <= (
        missed_plot_means.ROUGH_PATTERN_SCANS if is_rough_end else missed_plot_means.PATTERN_SCANS
    ):
        filter_designs = missed_plot_means.designs(designed_case)
        baseline_means = missed_plot_means.means(filter_designs[baseline], filter_designs, designed_case)
        for f, design in enumerate(filter_designs):
            filter_means = (
                baseline_means
                if f == baseline
                else missed_plot_means.means(design, [filter_designs[baseline]], designed_case)
            )
            sigma[f], bias[f], nees[f] = filter_means.sigma, filter_means.bias, filter_means.nees
            gain[f] = gains(filter_means.companion_sigma[0], baseline_means.companion_sigma[f])
    return ExactErrors(sigma, bias, gain, nees, np.zeros((*shape, 3)))


def simulate(plan: Plan, first: int, count: int) -> np.ndarray:
    """Sums of one block, in the order of the plan's layout."""
    kernel = plan.world.kernel
    block_sums = kernel.Sums(**{name: np.zeros(shape) for name, shape in plan.layout.shapes.items()})
    kernel.simulate_block(plan.problem, first, count, block_sums)
    return plan.layout.pack(**block_sums._asdict())


def errors(plan: Plan, first: int, count: int) -> np.ndarray:
    """The errors (F, count, K, 3) of its realisations."""
    block_errors: np.ndarray = plan.world.kernel.errors(plan.problem, first, count)
    return block_errors
