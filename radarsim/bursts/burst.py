"""A coherent burst of pulses and the phase of its echo (Uss, Baryshev, Djavad 2010, equations 1–4).

The echo's phase is k(t) θ with θ = (φ₀, f₀, f₁, …, f_n) in rad, Hz, Hz/s, … and
k(t) = (1, 2πt, 2πt²/2!, …, 2πt^{n+1}/(n+1)!). Kernels count phases in turns and times in windows: p(τ) = Σ b_j τ^j with
τ = t/T, b_0 = φ₀/2π and b_j = f_{j-1} T^j / j!. A burst is sampled only inside its pulses, at l T_p + m Δt.

How a burst is cut into blocks, and the blocks of every window in terms of those drawn.

Which windows a sequence of discriminators uses (Uss, Baryshev, Djavad 2010, equations 8–17).

A window of length T catches a start with error covariance R_Δ when Z = Δθᵀ H Δθ, H = (Φ + R_pr⁻¹)/2μ, stays below
the main-lobe threshold c with probability P_Δ. Z is a sum of χ²₁ with the eigenvalues of R_Δ H as weights; the paper
takes the Gaussian of the same two moments (14), `tail_probability` the sum itself.

How accurately a burst can be measured at all: Fisher matrices, potential spreads, what they mean for the motion.

Uss, Baryshev, Djavad 2010: the Fisher matrix below (6), the potential accuracy after (7), T_min (17). Matrices are in
the units of θ = (φ₀, f₀, …), rad, Hz, Hz/s, ….

Arrays for the estimator's kernels: the burst cut into blocks, each estimator's windows and step matrices."""

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from radarsim.bursts.kernels.lanes import COLUMNS, END, RATIO, SHIFT, W0, W1, W2, WEIGHTS, Z2, M, S
from radarsim.bursts.kernels.scoring import CENTRE, HALF, PHYSICS, SIZE, block_table
from radarsim.bursts.kernels.scoring import W0 as SUM_W
from radarsim.bursts.kernels.scoring import Z0 as SUM_Z
from radarsim.bursts.kernels.sequence import OPTIONS, WINDOW

# ---- burst -----------------------------------------------------------------------------------------------------------
LIGHT_MPS = 299_792_458.0


@dataclass(frozen=True)
class Burst:
    """What is sent and how it is sampled; one noise variance for each real number sampled."""

    carrier_hz: float
    pulse_period_s: float
    pulse_length_s: float
    sampling_period_s: float
    pulses: int
    amplitude: float
    noise_variance: float
    complex_samples: bool = False

    @property
    def duration_s(self) -> float:
        return self.pulses * self.pulse_period_s

    @property
    def samples_per_pulse(self) -> int:
        """Samples at 0, Δt, 2Δt, … below the pulse length, a hair of rounding forgiven."""
        return max(1, math.ceil(self.pulse_length_s / self.sampling_period_s - 1e-6))

    @property
    def wavelength_m(self) -> float:
        return LIGHT_MPS / self.carrier_hz

    def pulses_in(self, duration_s: float) -> int:
        """The nearest whole number of pulses (0.3 s / 10 µs is 29999.99…), at least one and at most all."""
        return min(max(1, round(duration_s / self.pulse_period_s)), self.pulses)


def sample_times(burst: Burst, pulses: int) -> np.ndarray:
    """Times in s of the samples of the first `pulses` pulses, (samples per pulse, pulses)."""
    offsets = np.arange(burst.samples_per_pulse) * burst.sampling_period_s
    return offsets[:, None] + np.arange(pulses) * burst.pulse_period_s


def turns_per_parameter(size: int, duration_s: float) -> np.ndarray:
    """Factors (size,) that take θ = (φ₀, f₀, …) to the coefficients b of the phase in turns over a window."""
    orders = np.arange(size)
    factors = duration_s**orders / np.array([math.factorial(j) for j in orders])
    factors[0] = 1.0 / (2.0 * math.pi)
    return factors


def phase_turns(theta: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Phase in turns of parameters θ (size,) at times t in s, any shape."""
    coefficients = np.asarray(theta, dtype=float) * turns_per_parameter(len(theta), 1.0)
    return np.polynomial.polynomial.polyval(t, coefficients)


def signal(burst: Burst, turns: np.ndarray) -> np.ndarray:
    """Noise-free samples at phases in turns, any shape: A cos (4), or A exp j where the receiver gives complex ones."""
    angle = 2.0 * math.pi * (turns - np.rint(turns))
    return burst.amplitude * (np.exp(1j * angle) if burst.complex_samples else np.cos(angle))


@dataclass(frozen=True)
class VelocityProfile:
    """Radial velocity in m/s, positive towards the radar, straight between the given instants (s)."""

    times_s: tuple[float, ...]
    velocities_mps: tuple[float, ...]

    def phase_turns(self, t: np.ndarray, wavelength_m: float, phase_rad: float) -> np.ndarray:
        """Phase in turns at times t: the exact integral of the Doppler frequency from the first instant."""
        knots, v = np.array(self.times_s), np.array(self.velocities_mps)
        steps = np.diff(knots)
        path = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * steps)])
        i = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, len(steps) - 1)
        s = t - knots[i]
        metres = path[i] + s * (v[i] + 0.5 * s * np.diff(v)[i] / steps[i])
        return phase_rad / (2.0 * math.pi) + 2.0 / wavelength_m * metres


def fitted_parameters(turns: np.ndarray, t: np.ndarray, size: int) -> np.ndarray:
    """Parameters θ (size,) whose phase fits that given in turns at t best in least squares: the truth of a profile."""
    duration = float(np.max(t))
    powers = (t.ravel()[:, None] / duration) ** np.arange(size)
    coefficients = np.linalg.lstsq(powers, turns.ravel(), rcond=None)[0]
    return coefficients / turns_per_parameter(size, duration)


def balanced_inverse(information: np.ndarray) -> np.ndarray:
    """Inverse (n, n) of a positive definite matrix whose rows differ by many orders of magnitude, as θ's units do."""
    scale = 1.0 / np.sqrt(np.diag(information))
    return np.linalg.inv(information * np.outer(scale, scale)) * np.outer(scale, scale)


# ---- blocks ----------------------------------------------------------------------------------------------------------
def block_edges(windows: list[int], per_window: int, whole: int = 1) -> np.ndarray:
    """Pulses (B + 1,) where B blocks begin and end: every window ends one, none longer than its time over per_window.
    Long ones are multiples of `whole`: with 8, demodulation fills its registers, at the price of a third more
    blocks."""
    edges = [0]
    for end in sorted(set(windows)):
        begin = edges[-1]
        while begin < end:
            longest = max(1, max(begin, windows[0]) // per_window)
            # Equal parts of what is left, so that no sliver remains before the window's end.
            length = math.ceil((end - begin) / math.ceil((end - begin) / longest))
            begin += length if length < 2 * whole else length // whole * whole
            edges.append(begin)
    return np.array(edges)


def merged(edges: np.ndarray, pulses: int, per_window: int) -> list[int]:
    """Indices in edges (B + 1,) where a window's blocks end: as few as may be, none longer than it over per_window. A
    block that was drawn longer stays alone."""
    last = int(np.searchsorted(edges, pulses))
    ends, begin = [], 0
    for i in range(1, last + 1):
        if i == last or edges[i + 1] - edges[begin] > max(1, pulses / per_window):
            ends.append(i)
            begin = i
    return ends


def moments(sums: np.ndarray, row: int, shift: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Sums of a quantity times 1, s, s² over joined blocks (3, joined), from those over the blocks drawn.

    s is now counted from a centre `shift` before theirs; joined blocks begin at starts."""
    z0, z1, z2 = (sums[row + 2 * n] + 1j * sums[row + 2 * n + 1] for n in range(3))
    return np.add.reduceat([z0, z1 + shift * z0, z2 + 2.0 * shift * z1 + shift**2 * z0], starts, axis=1)


class Tables:
    """Tables of the windows' blocks for `kernels.lanes`: flat arrays `table` and `weights`."""

    def __init__(self, edges: np.ndarray, sums: np.ndarray, per_window: int):
        self.edges, self.sums, self.per_window = edges, sums, per_window
        self.pulses = int(edges[-1])
        self.rows, self.weights = [np.zeros((0, COLUMNS))], [np.zeros((0, WEIGHTS))]
        self.known: dict[int, tuple[int, int, int]] = {}

    def window(self, pulses: int) -> tuple[int, int, int]:
        """First row in the table, first weight and number of blocks of a window; rows are made where they are new."""
        if pulses not in self.known:
            ends = merged(self.edges, pulses, self.per_window)
            self.known[pulses] = sum(map(len, self.rows)), sum(map(len, self.weights)), len(ends)
            self._add(np.array(ends), pulses / self.pulses)
        return self.known[pulses]

    def drawn(self, pulses: int) -> tuple[int, int, int]:
        """As `window` where blocks are used as drawn and no tables are needed."""
        return 0, 0, int(np.searchsorted(self.edges, pulses))

    def _add(self, ends: np.ndarray, share: float) -> None:
        starts, drawn = np.append(0, ends[:-1]), self.sums[:, : ends[-1]]
        count = np.diff(self.edges[: ends[-1] + 1])

        def mean(x: np.ndarray) -> np.ndarray:
            return np.add.reduceat(count * x, starts) / np.add.reduceat(count, starts)

        joined = np.repeat(np.arange(len(ends)), ends - starts)
        centre = mean(drawn[CENTRE])
        shift = drawn[CENTRE] - centre[joined]
        rms = np.sqrt(mean(2.0 * drawn[HALF] + shift**2))
        ratio = 1.0 / np.where(rms > 0.0, rms, np.inf)  # a block of one sample has no slope
        t, width, orders, rows = centre / share, rms / share, np.arange(1, SIZE), np.zeros((len(ends), COLUMNS))
        bend = np.where(orders > 1, orders * (orders - 1) * t[:, None] ** np.maximum(orders - 2, 0), 0.0)
        rows[:, M : M + SIZE - 1] = t[:, None] ** orders + 0.5 * bend * width[:, None] ** 2  # means of τ^j
        rows[:, S : S + SIZE - 1] = orders * t[:, None] ** (orders - 1) * width[:, None]
        echo, image = (moments(drawn, row, shift, starts) for row in (SUM_Z, SUM_W))
        image = image * ratio ** np.arange(3)[:, None]
        for column, value in ((Z2, echo[2] * ratio**2), (W0, image[0]), (W1, image[1]), (W2, image[2])):
            rows[:, column], rows[:, column + 1] = value.real, value.imag
        rows[:, END] = ends
        weights = np.zeros((len(joined), WEIGHTS))
        weights[:, RATIO], weights[:, SHIFT] = ratio[joined], shift * ratio[joined]
        self.rows.append(rows)
        self.weights.append(weights)

    def arrays(self) -> tuple[np.ndarray, np.ndarray]:
        """Both tables, flat."""
        return np.concatenate(self.rows).ravel(), np.concatenate(self.weights).ravel()


# ---- schedule --------------------------------------------------------------------------------------------------------
Tail = Literal["gaussian", "exact"]
PAPER_PROBABILITY, PAPER_FACTOR = 0.99, 3.0
MOST_WINDOWS = 200
NODES = 600  # of the tail integral: 10⁻¹² is reached from about 300 on


class NoSchedule(ValueError):
    """No sequence of windows follows from the burst and the forecast."""


@dataclass(frozen=True)
class Condition:
    """When a hand-over counts as safe: P_Δ, threshold c, and the law taken for the quadratic form."""

    probability: float = PAPER_PROBABILITY
    threshold: float = 1.0
    tail: Tail = "gaussian"


def spread_factor(probability: float) -> float:
    """Standard deviations that (14) asks for at P_Δ: the normal quantile in the proportion that makes it 3 at 0.99. The
    paper pairs 0.99 with 3, where a one-sided normal quantile would be 2.33."""
    from scipy.special import ndtri

    return float(PAPER_FACTOR * ndtri(probability) / ndtri(PAPER_PROBABILITY))


def tail_probability(weights: np.ndarray, threshold: float) -> float:
    """P(Σ wᵢ χ²₁ > c) for weights (n,) ≥ 0, to about 10⁻¹². Laplace inversion of the moment generating function Π(1 −
    2wᵢs)^(−½) along a parabola that starts between the pole at 0 and the first branch point and bends around the cut,
    where exp(−sc) makes the integrand vanish like a Gaussian."""
    weights = np.asarray(weights, dtype=float)
    weights = weights[weights > 1e-14 * weights.max()]
    edge = 0.5 / weights.max()
    # The start balances the pole against the edge: near the edge for a small tail.
    start = edge * max(0.5, 1.0 - 1.0 / (1.0 + threshold * edge))
    reach = math.asinh(math.sqrt(40.0 / (threshold * start)))
    w = (np.arange(NODES) + 0.5) * (reach / NODES)
    v = np.sinh(w)  # fine near the poles, far out to where the integrand has vanished
    s = start * (1.0 + v**2) + 1j * start * v
    ds = start * (2.0 * v + 1j) * np.cosh(w)
    logarithm = -0.5 * np.log(1.0 - 2.0 * weights[:, None] * s).sum(axis=0) - s * threshold
    return float(np.sum((np.exp(logarithm) / s * ds).imag) * (w[1] - w[0]) / math.pi)


def excess(weights: np.ndarray, condition: Condition) -> float:
    """Negative where a hand-over with weights (n,) is safe: the left side of (14) less c, or the tail's excess."""
    if condition.tail == "exact":
        return tail_probability(weights, condition.threshold) - (1.0 - condition.probability)
    spread = math.sqrt(2.0 * float(np.sum(weights**2)))
    return float(weights.sum()) + spread_factor(condition.probability) * spread - condition.threshold


class Form:
    """The quadratic form R_Δ H: its eigenvalues (size,), ascending."""

    def __init__(self, covariance: np.ndarray, curvature: np.ndarray):
        self._scale = np.sqrt(np.diag(curvature))
        balance = self._scale[:, None] * self._scale
        self._root = np.linalg.cholesky(curvature / balance)
        values, self._vectors = np.linalg.eigh(self._root.T @ (covariance * balance) @ self._root)
        self.values = np.maximum(values, 0.0)

    def leading(self) -> np.ndarray:
        """The direction (size,) of the largest eigenvalue, one σ long; its largest element, balanced, is positive."""
        direction = np.linalg.solve(self._root.T, self._vectors[:, -1] * np.sqrt(self.values[-1]))
        # An eigenvector's sign is LAPACK's choice.
        return direction * np.sign(direction[np.argmax(np.abs(direction))]) / self._scale


@dataclass(frozen=True)
class Designer:
    """Solves (15) and (16) for a burst, the prior spreads sigma (size,) of θ, and Φ_θ as a function of time in s."""

    burst: Burst
    sigma: np.ndarray
    fisher: Callable[[float], np.ndarray]
    condition: Condition

    def posterior(self, duration_s: float) -> tuple[np.ndarray, float]:
        """Φ_θ + R_pr⁻¹ of a window, and μ, of which Φ's first element is the double."""
        information = self.fisher(duration_s)
        return information + np.diag(self.sigma**-2.0), 0.5 * float(information[0, 0])

    def first_excess(self, duration_s: float) -> float:
        """Condition (15). The phase, unknown at first, is left out of the form, though not out of the estimate."""
        information, ratio = self.posterior(duration_s)
        error = np.diag(self.sigma[1:] ** 2) - balanced_inverse(information)[1:, 1:]
        return excess(Form(error, information[1:, 1:] / (2.0 * ratio)).values, self.condition)

    def handover(self, before_s: float) -> Callable[[float], Form]:
        """The error form when a window hands over to another, as a function of the latter's length (16)."""
        covariance = balanced_inverse(self.posterior(before_s)[0])

        def form(after_s: float) -> Form:
            information, ratio = self.posterior(after_s)
            return Form(covariance - balanced_inverse(information), information / (2.0 * ratio))

        return form

    def handover_excess(self, before_s: float) -> Callable[[float], float]:
        """Condition (16) on the length of the window after one of before_s."""
        form = self.handover(before_s)
        return lambda after_s: excess(form(after_s).values, self.condition)

    def longest(self, criterion: Callable[[float], float], shortest_s: float) -> int:
        """Pulses of the longest window that meets a criterion: its root, rounded to the nearest whole pulse."""
        from scipy.optimize import brentq

        if criterion(self.burst.duration_s) <= 0.0:
            return self.burst.pulses
        if criterion(shortest_s) >= 0.0:
            return self.burst.pulses_in(shortest_s)
        root = brentq(criterion, shortest_s, self.burst.duration_s, xtol=1e-4 * self.burst.pulse_period_s)
        return self.burst.pulses_in(root)

    def windows(self) -> list[int]:
        """Window lengths in pulses from T₀ (15) over (16) to the whole burst. None is shorter than there are
        parameters. Raises NoSchedule where over 200 are needed."""
        period, fewest = self.burst.pulse_period_s, len(self.sigma)
        sequence = [max(self.longest(self.first_excess, fewest * period), fewest)]
        while sequence[-1] < self.burst.pulses:
            if len(sequence) == MOST_WINDOWS:
                raise NoSchedule(f"it needs over {MOST_WINDOWS} windows")
            before = sequence[-1] * period
            following = self.longest(self.handover_excess(before), before * (1.0 + 1e-9))
            sequence.append(max(following, sequence[-1] + 1))
        return sequence


def denser(windows: list[int], density: int) -> list[int]:
    """`density` − 1 windows put between each neighbouring pair, in geometric progression."""
    dense = [windows[0]]
    for a, b in itertools.pairwise(windows):
        dense += [round(a * (b / a) ** (i / density)) for i in range(1, density)] + [b]
    return sorted(set(dense))


def handover_directions(designer: Designer, windows: list[int]) -> np.ndarray:
    """Directions (windows, size) in θ to search along before each window: the leading one of R_Δ at the hand-over. One
    direction is as long as an error of one radian rms over the window; the first window has none."""
    period = designer.burst.pulse_period_s
    directions = np.zeros((len(windows), len(designer.sigma)))
    for k in range(1, len(windows)):
        form = designer.handover(windows[k - 1] * period)(windows[k] * period)
        directions[k] = form.leading() / math.sqrt(form.values[-1])
    return directions


# ---- fisher ----------------------------------------------------------------------------------------------------------
def energy_ratio(burst: Burst, duration_s: float) -> float:
    """μ = A² T t_p / (4 σ² Δt T_p); twice that for complex samples, each of which is two numbers."""
    samples = burst.samples_per_pulse * duration_s / burst.pulse_period_s
    return (2 if burst.complex_samples else 1) * burst.amplitude**2 * samples / (4.0 * burst.noise_variance)


def shortest_window(burst: Burst, least_ratio: float = 5.0) -> float:
    """T_min (17) in s: where μ reaches μ_min."""
    return least_ratio * burst.pulse_period_s / energy_ratio(burst, burst.pulse_period_s)


def sensitivities(size: int, duration_s: float) -> np.ndarray:
    """k(t) at the end of a window, (size,): its value at τT is this times τ^j."""
    factors = np.array([2.0 * math.pi * duration_s**j / math.factorial(j) for j in range(size)])
    factors[0] = 1.0
    return factors


def fisher(burst: Burst, size: int, duration_s: float) -> np.ndarray:
    """Fisher matrix (size, size) in closed form, 2μ c_i c_j T^{i+j} / (i + j + 1)."""
    c, order = sensitivities(size, duration_s), np.arange(size)
    return 2.0 * energy_ratio(burst, duration_s) * np.outer(c, c) / (order[:, None] + order + 1.0)


def fisher_sums(burst: Burst, size: int, windows: list[int], theta: np.ndarray | None = None) -> list[np.ndarray]:
    """Fisher matrices (size, size) of the samples up to each window (in pulses), from running sums of powers of time.
    With the true θ the sums are exact; without, sin² of the phase is replaced by its mean ½, as in the closed form."""
    t = sample_times(burst, max(windows))
    x = t / burst.duration_s
    weight = np.full(t.shape, 1.0 if burst.complex_samples else 0.5)
    if theta is not None and not burst.complex_samples:
        turns = phase_turns(theta, t)
        weight = np.sin(2.0 * math.pi * (turns - np.rint(turns))) ** 2
    moments = running_moments(weight, x, windows, 2 * size - 1)
    c, order = sensitivities(size, burst.duration_s), np.arange(size)
    level = burst.amplitude**2 / burst.noise_variance
    return [level * np.outer(c, c) * moments[order[:, None] + order, w] for w in range(len(windows))]


def running_moments(weight: np.ndarray, x: np.ndarray, windows: list[int], count: int) -> np.ndarray:
    """Sums (count, K) of weight · x^j, j = 0 … count − 1, over the samples up to each window (in pulses).

    weight and x are (samples per pulse, pulses)."""
    ends, moments = np.array(windows) - 1, []
    for _ in range(count):
        moments.append(np.cumsum(weight.sum(axis=0))[ends])
        weight = weight * x  # products are the same on every processor, powers are not
    return np.array(moments)


def image_bias(burst: Burst, sigma: np.ndarray, windows: list[int], turns: np.ndarray) -> np.ndarray:
    """How far real samples' estimates of each window (K,) lie off where the image is left out, in standard deviations.

    That is √(gᵀ (Φ_θ + R_pr⁻¹)⁻¹ g), no less than the bias of any component over its spread with the prior. At the
    truth the image in Re Σ u e^{-jψ} has the gradient g = (A²/2σ²) Σ sin 2ψ k, which the second sum of (5) takes away.
    It is the same in every burst, so estimates without that sum are biased, by the more of their spreads the larger
    A/σ is. sigma (size,) is the prior's, turns (samples per pulse, pulses) the true phase."""
    x, size = sample_times(burst, max(windows)) / burst.duration_s, len(sigma)
    turns = turns[:, : max(windows)]
    sums = running_moments(np.sin(4.0 * math.pi * (turns - np.rint(turns))), x, windows, size)
    level = burst.amplitude**2 / (2.0 * burst.noise_variance)
    gradients = level * sensitivities(size, burst.duration_s)[:, None] * sums
    known = np.diag(phase_prior(sigma))
    covariances = [balanced_inverse(data + known) for data in fisher_sums(burst, size, windows)]
    return np.sqrt([max(g @ R @ g, 0.0) for g, R in zip(gradients.T, covariances, strict=True)])


def phase_prior(sigma: np.ndarray) -> np.ndarray:
    """Prior precisions (size,) of θ as the estimator uses them: a phase known no better than π is not known at all."""
    precision = np.asarray(sigma, dtype=float) ** -2.0
    if sigma[0] > math.pi:
        precision[0] = 0.0
    return precision


def spreads(information: np.ndarray) -> np.ndarray:
    """Potential standard deviations (size,) that an information matrix allows; infinite where it is singular."""
    try:
        with np.errstate(divide="ignore", invalid="ignore"):
            variance = np.diag(balanced_inverse(information))
    except np.linalg.LinAlgError:
        return np.full(len(information), np.inf)
    return np.sqrt(np.where(variance > 0.0, variance, np.inf))


def derivative_spread(covariance: np.ndarray, order: int, t_s: float) -> float:
    """Spread of the frequency's derivative of this order at time t within the burst, from the covariance (n, n) of θ.

    The beginning of the burst, where θ is defined, is the worst place: in the middle it is known many times better."""
    size = len(covariance)
    row = np.array([t_s ** (j - 1 - order) / math.factorial(j - 1 - order) if j > order else 0.0 for j in range(size)])
    return float(np.sqrt(row @ covariance @ row))


# ---- estimators ------------------------------------------------------------------------------------------------------
Blocks = Callable[[int], tuple[int, int, int]]
# The sum at twice the frequency is left out of the likelihood where it is less of every window's samples than this, and
# where that biases no estimate by more than this in its standard deviations: then no σ is over 2 % too large.
IMAGE_SHARE, IMAGE_BIAS = 0.02, 0.2


@dataclass(frozen=True)
class Design:
    """One estimator: window lengths in pulses, and how it starts, steps and searches; see `sequence.OPTIONS`."""

    windows: tuple[int, ...]
    phases: int = 0
    steps: int = 40
    tolerance: float = 1e-3
    coherent: bool = False
    search: int = 0
    spacing: float = 0.8
    margin: float = 3.0
    from_truth: bool = False
    amplitude: int = 0
    forecast: bool = True  # whether the prior is used


@dataclass(frozen=True)
class World:
    """The burst for the kernels, see `kernels.sequence.estimate_block`."""

    physics: np.void
    edges: np.ndarray
    clean: np.ndarray
    mean: np.ndarray
    factor: np.ndarray

    @property
    def sums(self) -> np.ndarray:
        """Means (blocks, 4) of Z₀ and Z₁, of which factor (blocks, 10) is the covariance root."""
        return np.ascontiguousarray(self.mean[SUM_Z : SUM_Z + 4, : len(self.factor)].T)


def has_image(burst: Burst, sigma: np.ndarray, windows: list[int], truth_turns: np.ndarray) -> bool:
    """Whether the sum at twice the frequency counts in any window, of forecasts of standard deviations sigma (size,).
    Phases (samples per pulse, pulses) are in turns."""
    if burst.complex_samples:
        return False
    ends = np.array(windows)
    doubled = np.cumsum(np.exp(-4j * math.pi * (truth_turns - np.rint(truth_turns))).sum(axis=0))[ends - 1]
    shares = np.abs(doubled) / (burst.samples_per_pulse * ends)
    return bool(shares.max() > IMAGE_SHARE or image_bias(burst, sigma, windows, truth_turns).max() > IMAGE_BIAS)


def world(
    burst: Burst, mode: int, edges: np.ndarray, image: bool, truth_turns: np.ndarray, reference_turns: np.ndarray
) -> World:
    """Arrays of a burst; phases (samples per pulse, pulses) in turns, the same unless the truth is no polynomial."""
    physics = np.zeros(1, PHYSICS)
    physics[0] = (
        mode,
        burst.complex_samples,
        image,
        burst.pulses,
        burst.samples_per_pulse,
        burst.amplitude,
        math.sqrt(burst.noise_variance),
        1.0 / burst.pulses,
        burst.sampling_period_s / burst.duration_s,
    )
    clean = signal(burst, truth_turns)
    mean, factor = block_table(physics[0], edges, reference_turns, clean)
    rows = [clean.real.ravel(), clean.imag.ravel()] if burst.complex_samples else [clean.ravel()]
    return World(physics[0], edges.astype(np.int64), np.stack(rows), mean, factor)


def step_root(data: np.ndarray, precision: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows v (size, size) with Σ v vᵀ = (Φ + P)⁻¹ and vᵀ Φ v = share (size,): Φ the data's, P the prior's information.
    Then (ρΦ + P)⁻¹ = Σ v vᵀ / (1 − (1 − ρ) share) for any coherence ρ."""
    information = data + np.diag(precision)
    scale = 1.0 / np.sqrt(np.diag(information))
    lower = np.linalg.cholesky(information * np.outer(scale, scale))
    white = np.linalg.solve(lower, np.linalg.solve(lower, data * np.outer(scale, scale)).T)
    share, vectors = np.linalg.eigh(0.5 * (white + white.T))
    return (np.linalg.solve(lower.T, vectors) * scale[:, None]).T, np.clip(share, 0.0, 1.0)


def estimators(
    designs: list[Design],
    blocks: Blocks,
    burst: Burst,
    sigma: np.ndarray,
    information: Mapping[int, np.ndarray],
    designer: Designer,
) -> tuple[np.ndarray, np.ndarray]:
    """Records of the windows (F, K) and options (F,) of a case's estimators.

    blocks gives a window's place in the table of blocks, in that of weights, and its number of blocks, see `Tables`;
    information is Φ_θ by window in the units of θ, sigma (size,) is the prior. Unused windows stay zero."""
    size, whole = len(sigma), turns_per_parameter(len(sigma), burst.duration_s)
    windows = np.zeros((len(designs), max(len(d.windows) for d in designs)), WINDOW)
    options = np.zeros(len(designs), OPTIONS)
    for e, design in enumerate(designs):
        for name in OPTIONS.names or ():
            options[e][name] = len(design.windows) if name == "windows" else getattr(design, name)
        directions = handover_directions(designer, list(design.windows)) if design.search else None
        for k, pulses in enumerate(design.windows):
            window = windows[e, k]
            window["pulses"] = pulses
            window["table"], window["weights"], window["blocks"] = blocks(pulses)
            window["powers"] = (pulses / burst.pulses) ** np.arange(SIZE)
            turns = whole * window["powers"][:size]
            if design.forecast:
                window["precision"][:size] = phase_prior(sigma) / turns**2
            root, share = step_root(information[pulses] / np.outer(turns, turns), window["precision"][:size])
            window["root"][:size, :size], window["share"][:size] = root, share
            if directions is not None:
                window["direction"][:size] = directions[k] * whole
    return windows, options
