"""Sentences about a radar's biases, and the options that correct them."""

import math

import numpy as np

from radarsim.language.translate import plural, tr
from radarsim.recordings.registration.bias_fit import MAD_TO_SIGMA, MIN_AIRCRAFT
from radarsim.recordings.registration.result import AircraftResiduals, Registration
from radarsim.report.wording import interval, significant_digits

OUTLIER_LAG_SIGMAS = 5.0  # standard deviations from the other aircraft, from which a lag counts as different


def registration_lines(registration: Registration) -> list[str]:
    """Sentences on the biases, and the options that correct them."""
    adjustment, sentences, options, has_nonzero_bias = registration.adjustment, [], [], False
    for bias in adjustment.biases:
        key, factor = ("bearing_deg", math.degrees(1)) if bias.key == "bearing_rad" else (bias.key, 1.0)
        if not bias.identifiable:
            sentences.append(tr("{key}: unknown: {why}", key=bias.key, why=bias.why))
            continue
        if bias.lo == bias.hi == 0:
            sentences.append(tr("{key}: 0, to the last digits of the numbers", key=key))
            continue
        value, *interval_ends = (significant_digits(factor * number) for number in (bias.value, bias.lo, bias.hi))
        zero = tr("; 0 is possible") if bias.lo <= 0 <= bias.hi else ""
        sentences.append(f"{key}: {value} {interval(*interval_ends)}{zero}")
        options.append(f"--bias {key}={factor * bias.value:.4g}")
        has_nonzero_bias |= not zero
    r, b = adjustment.sigma
    sigma_texts = [f"σ {significant_digits(r)} {tr('m')}"]
    if math.isfinite(b):
        sigma_texts.append(f"{significant_digits(math.degrees(b))}°")
    outliers = plural("{count} outlier", "{count} outliers", adjustment.outliers)
    sentences.append(tr("left: {sigma}; {outliers}", sigma=", ".join(sigma_texts), outliers=outliers))
    if len(registration.aircraft) < MIN_AIRCRAFT:
        sentences.append(
            tr("errors common to a whole flight are not in the intervals: that takes {n} flights", n=MIN_AIRCRAFT)
        )
    for aircraft in deviating_aircraft(registration):
        values = {"name": aircraft.name, "lag": significant_digits(aircraft.time_s, "+.2g")}
        sentences.append(
            tr("{name} alone is {lag} s from the others in time: its positions err, not the radar", **values)
        )
    command = f"radarsim import … {' '.join(options)}"
    sentences.append(
        tr("to correct: `{command}`", command=command) if has_nonzero_bias else tr("no bias differs from 0")
    )
    return sentences


def deviating_aircraft(registration: Registration) -> list[AircraftResiduals]:
    """The aircraft whose lag differs clearly from the lags of the others."""
    lags = np.array([aircraft.time_s for aircraft in registration.aircraft])
    is_known = np.isfinite(lags)
    if is_known.sum() < MIN_AIRCRAFT + 1:
        return []
    spread_s = MAD_TO_SIGMA * float(np.median(np.abs(lags[is_known] - np.median(lags[is_known]))))
    median_s = float(np.median(lags[is_known]))
    return [
        aircraft
        for aircraft in registration.aircraft
        if abs(aircraft.time_s - median_s) > OUTLIER_LAG_SIGMAS * math.hypot(spread_s, aircraft.sigma_time_s)
    ]
