"""Sentences about a radar's biases, and the options that correct them."""

import math

import numpy as np

from radarsim.language.translate import join_names, plural, tr
from radarsim.recordings.formats.records import BIASES
from radarsim.recordings.registration.bias_fit import MIN_AIRCRAFT
from radarsim.recordings.registration.result import Adjustment, AircraftResiduals, Bias, Finding, Registration
from radarsim.recordings.registration.robust_fit import MAD_TO_SIGMA
from radarsim.report.wording import interval, significant_digits

OUTLIER_LAG_SIGMAS = 5.0  # standard deviations from the other aircraft, from which a lag counts as different
POSITION_KEYS = ("height_m",)  # of the error that is not the radar's
BIASES_IN = {
    "range": ("range_m", "range_scale", "time_s"),
    "bearing": ("bearing_rad", "time_s"),
    "range and bearing": BIASES,
}


def registration_lines(registration: Registration) -> list[str]:
    """Sentences on what the biases do not describe, on the biases, and the options that correct them."""
    return [*finding_lines(registration), *bias_lines(registration)]


def finding_lines(registration: Registration) -> list[str]:
    """What the biases do not describe: none if they describe all."""
    adjustment = registration.adjustment
    if not adjustment.findings:
        return []
    values = {"left": _sigma_text(adjustment.sigma_of_biases_alone), "steps": _sigma_text(adjustment.sigma_of_steps)}
    first = tr("the four biases do not describe these plots: they leave {left}, from plot to plot {steps}", **values)
    return [first, *(_finding_line(finding) for finding in adjustment.findings)]


def bias_lines(registration: Registration) -> list[str]:
    """Sentences on the biases, and the options that correct them."""
    adjustment = registration.adjustment
    sentences = [_bias_line(bias) for bias in (*adjustment.biases, *adjustment.coefficients)]
    outliers = plural("{count} outlier", "{count} outliers", adjustment.outliers)
    sentences.append(tr("left: {sigma}; {outliers}", sigma=_sigma_text(adjustment.sigma), outliers=outliers))
    if len(registration.aircraft) < MIN_AIRCRAFT:
        sentences.append(
            tr("errors common to a whole flight are not in the intervals: that takes {n} flights", n=MIN_AIRCRAFT)
        )
    for aircraft in deviating_aircraft(registration):
        values = {"name": aircraft.name, "lag": significant_digits(aircraft.time_s, "+.2g")}
        sentences.append(
            tr(
                "{name} alone is {lag} s from the others in time: its positions, or the radar in its direction, err",
                **values,
            )
        )
    return [*sentences, *_correction_lines(adjustment)]


def deviating_aircraft(registration: Registration) -> list[AircraftResiduals]:
    """The aircraft whose lag differs clearly from the lags of the others.

    None if the radar has errors of unknown cause; lags are as uncertain as those of the others show."""
    lags, sigmas = np.array([[aircraft.time_s, aircraft.sigma_time_s] for aircraft in registration.aircraft]).T
    is_known = np.isfinite(lags)
    if is_known.sum() < MIN_AIRCRAFT + 1 or any(not finding.cause for finding in registration.adjustment.findings):
        return []
    distances = np.abs(lags - np.median(lags[is_known]))
    spread_s = MAD_TO_SIGMA * float(np.median(distances[is_known]))
    inflation = max(1.0, MAD_TO_SIGMA * float(np.median((distances / sigmas)[is_known])))
    limits = OUTLIER_LAG_SIGMAS * np.hypot(spread_s, inflation * sigmas)
    return [registration.aircraft[i] for i in np.flatnonzero(distances > limits)]


def _finding_line(finding: Finding) -> str:
    values = {"coordinate": finding.coordinate, "companion": finding.companion, "cause": finding.cause}
    if not finding.cause:
        return tr(
            "errors in {coordinate} go with {companion}, for a reason unknown: biases in {coordinate} may be wrong",
            **values,
        )
    if not finding.rivals:
        return tr("errors in {coordinate} go with {companion}: {cause}, allowed for", **values)
    rivals = join_names([tr(rival) for rival in finding.rivals])
    return tr(
        "errors in {coordinate} go with {companion}: {cause}, allowed for; the plots do not exclude {rivals}",
        rivals=rivals,
        **values,
    )


def _bias_line(bias: Bias) -> str:
    """A coefficient with its interval, in degrees where it is an angle."""
    key, factor = _shown_key(bias)
    if not bias.identifiable:
        return tr("{key}: unknown: {why}", key=bias.key, why=bias.why)
    if bias.lo == bias.hi == 0:
        return tr("{key}: 0, to the last digits of the numbers", key=key)
    value, *ends = (significant_digits(factor * number) for number in (bias.value, bias.lo, bias.hi))
    zero = tr("; 0 is possible") if _may_be_zero(bias) else ""
    return f"{key}: {value} {interval(*ends)}{zero}"


def _correction_lines(adjustment: Adjustment) -> list[str]:
    """The options that subtract the biases that differ from 0, and do not depend on a cause that is unknown."""
    undecided = [finding for finding in adjustment.findings if finding.rivals or not finding.cause]
    doubtful = {key for finding in undecided for key in BIASES_IN[finding.coordinate]}
    nonzero = [bias for bias in adjustment.biases if bias.identifiable and not _may_be_zero(bias)]
    options = []
    for bias in nonzero:
        key, factor = _shown_key(bias)
        if bias.key not in doubtful:
            options.append(f"--bias {key}={factor * bias.value:.4g}")
    lines = []
    if options:
        lines.append(tr("to correct: `{command}`", command=f"radarsim import … {' '.join(options)}"))
    elif not nonzero:
        lines.append(tr("no bias differs from 0"))
    of_radar = [finding for finding in adjustment.findings if finding.cause and finding.keys != POSITION_KEYS]
    if of_radar:
        causes = join_names([tr(finding.cause) for finding in of_radar])
        lines.append(tr("`radarsim import` does not correct {causes}", causes=causes))
    return lines


def _may_be_zero(bias: Bias) -> bool:
    return bias.lo <= 0 <= bias.hi


def _shown_key(bias: Bias) -> tuple[str, float]:
    """The key of a coefficient as it is shown, and by what to multiply its value."""
    stem = bias.key.removesuffix("_rad")
    return (bias.key, 1.0) if stem == bias.key else (f"{stem}_deg", math.degrees(1))


def _sigma_text(sigma: tuple[float, float]) -> str:
    """σ in range and, where there are bearings, in bearing."""
    texts = [f"σ {significant_digits(sigma[0])} {tr('m')}"]
    if math.isfinite(sigma[1]):
        texts.append(f"{significant_digits(math.degrees(sigma[1]))}°")
    return ", ".join(texts)
