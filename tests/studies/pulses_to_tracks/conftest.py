"""A case of the study from a few numbers, and the sums of one."""

from types import SimpleNamespace

import numpy as np

from radarsim.config.experiment import Case
from radarsim.studies.pulses_to_tracks import config, study

RADAR = {"wavelength_m": 0.03, "sigma_range_m": 50.0, "scan_period_s": 10.0}
BURST = {"repetition_rate_hz": 20e3, "pulses": 16, "pulse_length_s": 1e-6, "snr_db": 5.24}
PRIOR = {"sigma_velocity_mps": 30.0, "sigma_acceleration_mps2": 5.0}
POLYNOMIAL = {"kind": "polynomial", "coefficients": [100e3, -250.0, 4.0]}
V, A = ["range", "velocity"], ["range", "velocity", "acceleration"]
RANGE = {"name": "r", "observes": ["range"]}
IDEAL = {"name": "ideal", "observes": V, "estimator": "fisher_bound"}
SEQUENCE = {"name": "sequence", "observes": V, "estimator": "sequence"}
CURED = {"name": "cured", "observes": V}
SPECTRUM = {"name": "spectrum", "observes": V, "estimator": "spectrum"}


def make_case(filters, scans=5, burst=(), prior=(), variance=1e-3, target=POLYNOMIAL, **radar):
    """A checked case; burst, prior and radar are further keys of these."""
    document = {
        "radar": RADAR | radar,
        "burst": BURST | dict(burst),
        "prior": PRIOR | dict(prior),
        "target": target,
        "filters": [{"manoeuvre_variance": variance} | f for f in filters],
        "scans": scans,
    }
    return Case("case", "case", "pulses_to_tracks", config.Keys.model_validate(document), (), 1, 1)


def plan_and_sums(case, n):
    """The plan and the sums of n realisations."""
    plan = study.prepare(case)
    values = np.zeros(plan.layout.size)
    for first in range(0, n, plan.block):
        values += study.simulate(plan, first, min(plan.block, n - first))
    return plan, SimpleNamespace(**plan.layout.unpack(values))
