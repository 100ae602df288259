"""How P4's claims are measured: which case is which interpretation of the paper, which estimator which discriminator.

The paper's numbers do not belong together: its bounds follow from a noise variance of 2.25, a quarter of the
one it states, and then its threshold c is the 1 of (14); its first window follows from the stated 9, and then c is the
0.5 of (11). Both interpretations are judged: "computed" and "printed"."""

import math
from functools import partial
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from radarsim.bursts import fisher as bursts_fisher
from radarsim.bursts import schedule_design
from radarsim.bursts.burst import balanced_inverse
from radarsim.papers.authoring import CaseResult, MissingEvidence, exact_number, shipped_spec
from radarsim.papers.authoring import Evidence as GeneralEvidence
from radarsim.report.statistics import Estimate, difference, root_mean_square
from radarsim.studies.discriminator import efficient_share, scenario
from radarsim.studies.discriminator.kernels.sums import LOCKS

COMPUTED, PRINTED = "computed", "printed"
INTERPRETATIONS = {COMPUTED: (2.25, 1.0), PRINTED: (9.0, 0.5)}  # noise variance, threshold c
DOPPLER = (10e3, 180e3, -750e3, 1000e3)
COMPONENTS = ("phi0", "f0", "f1", "f2", "f3")
Key = str | tuple[str, float]  # an interpretation, or a swept key and its value
PER_HANDOVER = 0.99  # P_Δ
PRINTED_AMPLITUDE_ESTIMATE = 1.17  # the paper's own estimate of the amplitude, which it puts into (17)


class Evidence(GeneralEvidence):
    """Finds the paper's experiment in its two interpretations, its swept variants, and the estimators, by their
    settings."""

    def case(self, key: Any) -> CaseResult:
        """key: an interpretation, or (swept key, value) of the maps."""
        for result in self.results:
            swept = [(name, float(str(value))) for name, value in result.swept_values]
            if isinstance(key, tuple):
                if len(swept) == 1 and swept[0][0] == key[0] and math.isclose(swept[0][1], key[1]):
                    return result
            elif not swept and shipped_spec(result).burst.noise_variance == INTERPRETATIONS[key][0]:
                return result
        raise MissingEvidence(key)

    def estimator(self, key: Key, kind: str) -> int:
        """Index of an estimator of a case by its kind: sequence, narrow, wide, cured, truth."""
        threshold = INTERPRETATIONS.get(key, (0, 1.0))[1] if not isinstance(key, tuple) else 1.0
        for i, e in self.members(self.case(key), "estimators"):
            if kind_of(e, threshold) == kind:
                return i
        raise MissingEvidence((key, kind))

    def windows(self, key: Key, kind: str = "sequence") -> np.ndarray:
        """Window lengths in s of an estimator."""
        durations = self.case(key).axes.duration_s[self.estimator(key, kind)]
        return durations[np.isfinite(durations)]

    def lock(
        self, key: Key, kind: str, column: str = "lock_rate", ends: tuple[str, str] = ("lock_lo", "lock_hi")
    ) -> Estimate:
        """Share of bursts at the last window of an estimator."""
        result, i = self.case(key), self.estimator(key, kind)
        row = self.row("locks", case=result.name, filter=result.axes.filters[i], k=len(self.windows(key, kind)))
        return Estimate(*(float(row[name]) for name in (column, *ends)))

    def always(self, key: Key) -> Estimate:
        """Share of bursts with every component of the sequence within 3σ at every window, σ with the prior."""
        column = "unbroken_posterior_lock_rate_3sigma"
        return self.lock(key, "sequence", column, (f"{column}_lo", f"{column}_hi"))

    def accuracy(self, key: Key, kind: str, component: str) -> Estimate:
        """σ of the locked bursts over the Cramér–Rao bound of the window, at the last window."""
        result, i = self.case(key), self.estimator(key, kind)
        k, c = len(self.windows(key, kind)) - 1, COMPONENTS.index(component)
        moments = result.sums["error"][i, k, c]
        return root_mean_square(moments[1], moments[3], result.sums["locks"][i, k, LOCKS.index("lock")])

    def over_whole(self, key: Key, kind: str, component: str) -> Estimate:
        """σ of all bursts at an estimator's last window over the Cramér–Rao bound of the whole burst."""
        result, i = self.case(key), self.estimator(key, kind)
        k, c = len(self.windows(key, kind)) - 1, COMPONENTS.index(component)
        moments = result.sums["error_all"][i, k, c]
        scale = result.axes.exact_sigma[i, k, c] / result.axes.potential_closed_form[c]
        return Estimate(*(scale * part for part in root_mean_square(moments[1], moments[3], result.count)))

    def potential(self, key: Key, component: str) -> Estimate:
        """Cramér–Rao bound by the discrete sum over the pulses l = 0 … n − 2, which gives the paper's digits."""
        burst = scenario.configured_burst(self.case(key).spec)
        spreads = bursts_fisher.spreads(bursts_fisher.fisher_sums(burst, len(COMPONENTS), [burst.pulses - 1])[0])
        return exact_number(spreads[COMPONENTS.index(component)])

    def as_far(self, key: Key, amplitude: float, power: int = 1) -> float:
        """Share of bursts whose (7), the square of the amplitude, lies as far from its mean as a printed one's power.

        The sum of so many squares is Gaussian: of N samples with noise σ² it has a variance N (2σ⁴ + 2σ²A²)."""
        burst = self.case(key).spec.burst
        samples, noise = burst.pulses * round(burst.pulse_length_s / burst.sampling_period_s), burst.noise_variance
        square = burst.amplitude**2
        spread = 2 * math.sqrt((2 * noise**2 + 2 * noise * square) / samples)
        return math.erfc(abs(amplitude**power - square) / spread / math.sqrt(2))

    def span(self, key: Key) -> Estimate:
        """How far ln L of the signal falls from its maximum to the mean level of its side lobes, over 2μ. Without noise
        it falls by Σ(s − s')²/2σ²; a side lobe's s' is as strong, and of any phase: its mean square is A²/2 a sample
        and its mean product with s nil. Σs² is that of the true phase."""
        burst = scenario.configured_burst(self.case(key).spec)
        samples = burst.pulses * burst.samples_per_pulse
        level = burst.amplitude**2 / burst.noise_variance
        of_sines = bursts_fisher.fisher_sums(burst, 1, [burst.pulses], np.array([0.0, *DOPPLER]))[0][0, 0]
        fall = (level * samples - of_sines + level * samples / 2) / 2
        return exact_number(fall / (2 * bursts_fisher.energy_ratio(burst, burst.duration_s)))

    def robust(self, key: Key) -> Estimate:
        """Lock of the sequence over what its design allows: 0.99 of each hand-over, the first window's too."""
        designed = PER_HANDOVER ** len(self.windows(key))
        return Estimate(*(part / designed for part in self.lock(key, "sequence")))

    def efficient(self, key: Key) -> float:
        """What an efficient estimator would score in `always`, over the windows of the sequence."""
        result, i = self.case(key), self.estimator(key, "sequence")
        forecast = tuple(map(float, result.axes.prior_sigma))
        return efficient_share.share_within_bounds(
            scenario.configured_burst(result.spec), tuple(result.axes.pulses[i]), forecast
        )

    def worst_handover(self, key: str) -> Estimate:
        """The largest probability over the hand-overs that Z passes c: of the form's own law, not of a Gaussian."""
        designer, times = self._designer(key)
        threshold = designer.condition.threshold
        forms = [designer.handover(before)(after) for before, after in pairwise(times[:-1])]  # the last is cut short
        return exact_number(max(schedule_design.tail_probability(form.values, threshold) for form in forms))

    def _designer(self, key: str) -> tuple[schedule_design.Designer, np.ndarray]:
        """What designed the sequence, and its windows in s."""
        result, i = self.case(key), self.estimator(key, "sequence")
        burst, condition = (
            scenario.configured_burst(result.spec),
            schedule_design.Condition(threshold=INTERPRETATIONS[key][1]),
        )
        fisher = partial(bursts_fisher.fisher, burst, len(COMPONENTS))
        times = burst.pulse_period_s * np.array(result.axes.pulses[i])
        return schedule_design.Designer(burst, result.axes.prior_sigma, fisher, condition), times

    def phase_offsets(self, key: str) -> np.ndarray:
        """How far the best phase lies from the start's, rad, one σ: from the forecast, then at each hand-over."""
        designer, times = self._designer(key)
        error, offsets = np.diag(designer.sigma**2), []
        for information in (designer.posterior(duration)[0] for duration in times):
            after, row = balanced_inverse(information), information[0] / information[0, 0]
            offsets.append(math.sqrt(row @ (error - after) @ row))
            error = after
        return np.array(offsets)

    def phase_lost(self, key: str, window: Literal["first", "later"]) -> float:
        """Probability that the starting phase is over a quarter turn off the best: at first, or largest afterwards.
        Over the phase alone the likelihood is a cosine, so that from nearer scoring finds its maximum."""
        first, *later = (math.erfc(math.pi / 2 / sigma / math.sqrt(2)) for sigma in self.phase_offsets(key))
        return first if window == "first" else max(later)

    def spare_window(self, key: Key, amplitude: float) -> Estimate:
        """First window less the shortest allowed at an amplitude, ms."""
        return exact_number(1e3 * self.windows(key)[0] - self.shortest_window(key, amplitude).value)

    def shortest_window(self, key: Key, amplitude: float) -> Estimate:
        """T_min (17) in ms at an amplitude."""
        return exact_number(1e3 * self.case(key).axes.shortest_window_s / amplitude**2)


def first_window(evidence: Evidence, key: Key) -> float:
    """The first window of the sequence, ms."""
    return float(1e3 * evidence.windows(key)[0])


def windows_counted(evidence: Evidence, key: Key, first: bool) -> float:
    """How many windows the sequence has, with the first or after it."""
    return len(evidence.windows(key)) - (not first)


def window_growth(evidence: Evidence, better: Key, worse: Key) -> float:
    """The first window of one case over that of another."""
    return float(evidence.windows(better)[0] / evidence.windows(worse)[0])


def closed_over_sum(evidence: Evidence, key: Key, component: str) -> float:
    """Cramér–Rao bound of a component by the closed form over that by the sum over the pulses."""
    closed = evidence.case(key).axes.potential_closed_form[COMPONENTS.index(component)]
    return float(closed / evidence.potential(key, component).value)


def lock_above(evidence: Evidence, key: Key, kind: str, base: str) -> Estimate:
    """Lock of one estimator less that of another."""
    return difference(evidence.lock(key, kind), evidence.lock(key, base))


def lock_loss(evidence: Evidence, key: Key, base: Key, kind: str) -> Estimate:
    """Lock of one case less that of another."""
    return difference(evidence.lock(key, kind), evidence.lock(base, kind))


def forecast_spread(evidence: Evidence, key: Key, component: str) -> float:
    """Printed Cramér–Rao bound times the printed factor."""
    return float(SPREADS[component][0]) * FACTORS[component]


def doppler_of_polynomial(evidence: Evidence, key: Key, t_s: float) -> float:
    """Doppler frequency of the printed derivatives at a time, kHz."""
    f0, f1, f2, f3 = DOPPLER
    return 1e-3 * (f0 + f1 * t_s + f2 * t_s**2 / 2 + f3 * t_s**3 / 6)


SPREADS = {  # as printed
    **{"phi0": ("0.061", "rad"), "f0": ("0.45", "Hz"), "f1": ("12.2", "Hz/s"), "f2": ("183.38", "Hz/s²")},
    "f3": ("1213.04", "Hz/s³"),
}
FACTORS = {"phi0": 100, "f0": 150, "f1": 500, "f2": 1000, "f3": 2000}


def kind_of(estimator: Any, threshold: float) -> str:
    """What an estimator is, at the interpretation's threshold c; "other" for variants."""
    e = estimator
    is_plain = e.method == "sequence" and e.amplitude == "known" and e.density == 1 and e.tail == "gaussian"
    if not is_plain or e.steps < 40 or e.phases:
        return "other"
    if e.schedule != "designed":
        is_whole_burst = len(e.schedule) == 1 and np.isclose(e.schedule[0], 0.3)
        return {"truth": "truth", "prior": "narrow"}[e.start] if is_whole_burst else "other"
    if e.main_lobe_threshold != threshold or e.lock_probability != PER_HANDOVER or e.start != "prior":
        return "other"
    if e.first_windows == 1:
        return "wide"
    return "other" if e.first_windows else "cured" if e.search_points else "sequence"
