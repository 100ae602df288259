"""What P1 leaves open, and its claims under each interpretation: all by the exact recursion, nothing is run."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple, cast

import numpy as np

from radarsim.papers.authoring import (
    ChangedResults,
    Claim,
    Curve,
    Estimate,
    Interpretation,
    PaperClaims,
    PaperInterpretations,
    Part,
    load_choices,
    with_cases,
)
from radarsim.papers.expected_ranges import same
from radarsim.papers.range_doppler import filter_versions, measures
from radarsim.papers.range_doppler.filter_versions import Form, Start, Version
from radarsim.papers.range_doppler.measures import RADARS
from radarsim.system.threads import mapping

FINAL_GAIN_CLAIM = "P1.5"
FALLING_SIGMA_CLAIMS = ("P1.26", "P1.27")  # as far as a settled curve may rise again
FIRST_STEPS_CLAIM = "P1.28"
EACH, LOWER = "each radar", "the lower one"
SHIPPED_VARIANCE = "0.001"  # D_M, (m/s³)²
SWEPT_VARIANCES = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)  # D_M of the config manoeuvre_variance
STEADY_SCANS = 250  # scans after which a filter is taken as steady
FILTERS = ("r", "r+Vr")
WAVELENGTH_M = {1: 1.8, 2: 0.15, 3: 0.15, 4: 0.03, 5: 0.03}
REPETITION_HZ = 1e3


class Interpretations(PaperInterpretations):
    """P1's interpretations."""

    paper = "P1"
    choices = load_choices(Path(__file__).with_name("interpretations.yaml"))

    def is_exact(self, claim: Claim, interpretation: Interpretation) -> bool:
        return True

    def parts(self, claim: Claim, interpretation: Interpretation) -> Sequence[Part]:
        """Those of the radars that the interpretation means; what falls to a steady value may rise by its tolerance."""
        if claim.id == FIRST_STEPS_CLAIM and interpretation["first_steps_of"] == EACH:
            return [with_cases(part, radar) for radar in RADARS for part in claim.parts]
        if claim.id == FINAL_GAIN_CLAIM and interpretation["end_of"] == LOWER:
            return [
                replace(claim.parts[0], cases=(2, 3), what="the lower of the final range gains", measure=_lower_end)
            ]
        if claim.id not in FALLING_SIGMA_CLAIMS:
            return claim.parts
        wide = same(0, 100 * self.settings(interpretation)["within"])
        parts = [part for part in claim.parts if interpretation["curves_of"] == EACH or part.cases == (2,)]
        return [replace(part, expected=wide) for part in parts]

    def evidence(
        self,
        claim: Claim,
        interpretation: Interpretation,
        changed_results: ChangedResults | None,
        paper_claims: PaperClaims,
    ) -> "ExactEvidence":
        return _evidence(interpretation)

    def versions(self) -> list[Version]:
        """Every version of the filters that a declared interpretation asks for, with the D_M of the shipped sweep."""
        versions: dict[Version, None] = {}
        for interpretation in self.declared_interpretations():
            form, start = cast(Form, interpretation["process_noise"]), cast(Start, interpretation["start"])
            for variance in (float(interpretation["manoeuvre_variance"]), *SWEPT_VARIANCES):
                versions[form, variance, start] = None
        return list(versions)


def _lower_end(evidence: measures.Evidence) -> Estimate:
    """The least of the final range gains of RLS 2 and 3, %."""
    return measures.extreme_gain(evidence, 2, 3, extreme="smallest", component="r", pick="last")


@cache
def _evidence(interpretation: Interpretation) -> "ExactEvidence":
    """That of an interpretation, which many claims share."""
    return ExactEvidence(interpretation)


@cache
def _table() -> Mapping[int, Mapping[Version, "_Sigmas"]]:
    """σ over LONG scans by radar and version, all by one recursion a radar."""
    versions = Interpretations().versions()

    def of_radar(number: int) -> dict[Version, _Sigmas]:
        errors = filter_versions.errors_of_both_filters(RADARS[number], versions, STEADY_SCANS)
        return {
            version: _Sigmas(*(tuple(e.true[i] for e in errors), tuple(e.believed[i] for e in errors)))
            for i, version in enumerate(versions)
        }

    with mapping() as mapped:  # NumPy computes outside the interpreter's lock
        return dict(zip(RADARS, mapped(of_radar, RADARS), strict=True))


class _Sigmas(NamedTuple):
    """σ (K, 3) of the filters r and r+Vr, on a quadratic and on a truth that moves as they believe."""

    true: tuple[np.ndarray, ...]
    believed: tuple[np.ndarray, ...]


@cache
def _case(number: int, variance: float) -> SimpleNamespace:
    """What stands in for a case: one radar at one D_M."""
    sigma_r, sigma_v, period = RADARS[number]
    k = np.arange(1, round(measures.DURATION_S / period) + 2)
    axes = {"k": k, "t_s": (k - 1.0) * period, "scan_period_s": period, "C_theta": (sigma_r / (period * sigma_v)) ** 2}
    axes |= {"wavelength_m": WAVELENGTH_M[number], "repetition_rate_hz": REPETITION_HZ}
    return SimpleNamespace(name=f"rls{number}", number=number, variance=variance, axes=SimpleNamespace(**axes), count=0)


class ExactEvidence(measures.Evidence):
    """P1's curves and gains by the exact recursion, under an interpretation; series end at limit_s."""

    def __init__(self, interpretation: Interpretation):
        super().__init__((), {}, {})
        self._interpretation, self._sets = interpretation, Interpretations().settings(interpretation)
        self._limit_s: float = self._sets.get("limit_s", np.inf)
        self.extremum = self._sets["extremum"]
        variance = interpretation["shown_variance"]
        self._own = float(variance if variance != SHIPPED_VARIANCE else interpretation["manoeuvre_variance"])
        self._curves: dict[tuple[Any, ...], Curve] = {}

    def case(self, key: Any) -> Any:
        """key: the number of a radar (at the interpretation's D_M), or (number, D_M)."""
        return _case(*key) if isinstance(key, tuple) else _case(key, self._own)

    def marked(self, series: Curve, key: Any) -> Curve:
        """As it is: where a run ends is a choice of the interpretation."""
        return series

    def exactly(self) -> "ExactEvidence":
        """All is exact already."""
        return self

    def filter(self, key: Any, observes: tuple[str, ...]) -> str:
        """r or r+Vr."""
        return FILTERS[len(observes) - 1]

    def curve(self, key: Any, filter_name: str, component: str) -> Curve:
        """σ(k) of a filter."""
        place = key, filter_name, component
        if place not in self._curves:
            self._curves[place] = self._cut(key, self._sigma(key, component)[FILTERS.index(filter_name)])
        return self._curves[place]

    def gain(self, key: Any, filter_name: str, component: str) -> Curve:
        """Relative gain of the filter with velocity, %, from the scan at which it has filtered."""
        place = key, "", component
        if place not in self._curves:
            gain = filter_versions.gain(*self._sigma(key, component))
            gain[: filter_versions.first_scan(self._start, 2) - 1] = np.nan
            self._curves[place] = self._cut(key, gain)
        return self._curves[place]

    def settling(self, key: Any, observes: tuple[str, ...], component: str = "r") -> Estimate:
        """Scan periods from the first plot to settling for good; infinite where it does not within the run."""
        sigma = self.curve(key, self.filter(key, observes), component)
        radar = self.case(key)
        steady = self._sigma(key, component)[len(observes) - 1][-1]
        wrong = np.flatnonzero(~(abs(sigma.value / steady - 1) <= self._sets["within"]))
        first = wrong[-1] + 1 if wrong.size else 0
        when = sigma.t[first] / radar.axes.scan_period_s if first < len(sigma.t) else np.inf
        return Estimate(float(when), float(when), float(when))

    def variances(self, radar: int) -> list[float]:
        """Those of the shipped sweep."""
        return list(SWEPT_VARIANCES)

    @property
    def _start(self) -> Start:
        return cast(Start, self._interpretation["start"])

    def _sigma(self, key: Any, component: str) -> tuple[np.ndarray, np.ndarray]:
        """σ (LONG,) of the two filters."""
        radar = self.case(key)
        version = cast(Form, self._interpretation["process_noise"]), radar.variance, self._start
        sigmas = _table()[radar.number][version]
        range_only, both = sigmas.believed if self._interpretation["truth"] == "as believed" else sigmas.true
        c = tuple(measures.COMPONENTS).index(component)
        return range_only[:, c], both[:, c]

    def _cut(self, key: Any, values: np.ndarray) -> Curve:
        axes = self.case(key).axes
        scans = self._sets.get("scans", len(axes.k))
        values = values[: len(axes.k)]
        is_kept = np.isfinite(values) & (axes.t_s <= self._limit_s + 1e-6) & (axes.k <= scans)
        end, limit_s = float(axes.t_s[min(scans, len(axes.k)) - 1]), self._limit_s
        short = f"the run of RLS {self.case(key).number} ends at {end:g} s, before {limit_s:g} s"
        ends = short if np.isfinite(limit_s) and end < limit_s - 1e-6 else ""
        return Curve(axes.k[is_kept], axes.t_s[is_kept], *(values[is_kept],) * 3, short=ends)
