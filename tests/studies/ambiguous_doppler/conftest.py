"""A case of the study from a few numbers, and the sums of one."""

from types import SimpleNamespace

import numpy as np
import pytest

from radarsim.config.experiment import Case
from radarsim.studies.ambiguous_doppler import config, filter_design, study
from tests.studies.ambiguous_doppler import naive

RADARS = {  # σ_r, σ_V, Δt, λ of P1's
    "RLS 2": (250.0, 15.0, 10.0, 0.15),
    "RLS 3": (250.0, 15.0, 5.0, 0.15),
    "RLS 4": (50.0, 1.0, 10.0, 0.03),
    "RLS 5": (50.0, 1.0, 5.0, 0.03),
}
RANGE_ONLY = {"name": "range only", "doppler": "none"}
ORACLE = {"name": "oracle", "doppler": "unfolded"}
NEAREST = {"name": "nearest fold", "doppler": "folded", "hypotheses": 1}
NO_MEMORY = {"name": "no memory", "doppler": "folded", "merge": "each_scan"}
BEST = {"name": "best hypothesis", "doppler": "folded", "estimate": "best"}
MEMORY = {"name": "memory", "doppler": "folded"}
RANDOM = {"kind": "random_polynomial"}
FIXED = {"kind": "polynomial", "coefficients": [100e3, -250.0, 4.0]}


def make_case(radar, filters, scans, target=RANDOM, variance=1e-3, seed=1, prior=None, rare=None, **keys):
    """A checked case; keys are further ones of the radar."""
    sigma_r, sigma_v, dt, wavelength = RADARS[radar]
    radar_keys = {
        "sigma_range_m": sigma_r,
        "sigma_velocity_mps": sigma_v,
        "scan_period_s": dt,
        "wavelength_m": wavelength,
    }
    document = {
        "radar": radar_keys | {"repetition_rate_hz": 1000.0} | keys,
        "target": target,
        "filters": [{"manoeuvre_variance": variance} | f for f in filters],
        "scans": scans,
    }
    if prior:
        document["prior"] = prior
    if rare:
        document["rare"] = rare
    spec = config.Keys.model_validate(document)
    return Case("case", "case", "ambiguous_doppler", spec, (), 1, seed)


def tolerances(case, detected, size=naive.SIZE):
    """Rounding of estimates (3,), and of weights, of filters that list or combine: as of ranges alone, of any order."""
    radar = case.spec.radar
    sigma = radar.sigma_range_m, radar.sigma_velocity_mps
    range_only_options = [
        SimpleNamespace(orders=(member.order,), variances=(member.manoeuvre_variance,), doppler="none")
        for options in case.spec.filters
        for member in filter_design.members(options)
    ]
    kalmans = [naive.Kalman(member, case.spec.prior, sigma, radar.scan_period_s) for member in range_only_options]
    estimates, weights = zip(*(naive.rounding_errors(member, detected, size) for member in kalmans), strict=True)
    return np.max(estimates, axis=0), max(weights)


def simulate_sums(plan, n):
    """Sums of n realisations."""
    values = np.zeros(plan.layout.size)
    for first in range(0, n, plan.block):
        values += study.simulate(plan, first, min(plan.block, n - first))
    return plan.layout.unpack(values)


def plan_and_sums(case, n):
    """The plan and the sums of n realisations."""
    plan = study.prepare(case)
    return plan, SimpleNamespace(**simulate_sums(plan, n))


def config_document(*filters, **keys):
    """The config of eight scans of RLS 5, as a document, with further keys."""
    spec = make_case("RLS 5", filters, 8).spec
    return {"study": "ambiguous_doppler", "realisations": 10} | spec.model_dump(exclude_none=True) | keys


@pytest.fixture(scope="session")
def matched():
    """Sums of 100 000 realisations where truth and filters agree, by radar."""
    sums_by_radar = {}
    wide = {"hypotheses": 3000, "prune_below": 1e-7}

    def sums_of_radar(radar):
        if radar not in sums_by_radar:
            filters = [RANGE_ONLY, ORACLE, NEAREST, MEMORY | wide]
            sums_by_radar[radar] = plan_and_sums(make_case(radar, filters, 10, variance=0.0), 100_000)
        return sums_by_radar[radar]

    return sums_of_radar
