"""Finished cases without a run: axes from the study, sums as their expected values at N realisations."""

import numpy as np
import pytest

from radarsim.api.configs import load
from radarsim.engine.results import CaseResult
from radarsim.studies.range_doppler import study as range_doppler
from radarsim.studies.range_doppler.error_recursion import error_recursion

# The paper's table: σ_r (m), σ_V (m/s), Δt (s), scans for 140 s, wavelength (m).
RADARS = {
    "rls1": (25, 5, 10, 15, 1.8),
    "rls2": (250, 15, 10, 15, 0.15),
    "rls3": (250, 15, 5, 29, 0.15),
    "rls4": (50, 1, 10, 15, 0.03),
    "rls5": (50, 1, 5, 29, 0.03),
}
SHARED = 0.6  # correlation of the two filters' errors, where a number is needed


def config(stem, variance=1e-3, **changes):
    """A radar of the paper as a config."""
    sigma_range, sigma_velocity, period, scans, wavelength = RADARS[stem]
    made = {
        "study": "range_doppler",
        "radar": {
            "name": stem.upper().replace("RLS", "RLS "),
            "band": "decimetre",
            "wavelength_m": wavelength,
            "sigma_range_m": sigma_range,
            "sigma_velocity_mps": sigma_velocity,
            "scan_period_s": period,
        },
        "target": {"kind": "polynomial", "coefficients": [100e3, -250, 4]},
        "filters": [
            {"name": "r", "observes": ["range"], "manoeuvre_variance": variance},
            {"name": "r+Vr", "observes": ["range", "velocity"], "manoeuvre_variance": variance},
        ],
        "scans": scans,
        "realisations": 1e5,
    }
    for key, value in changes.items():  # of a mapping, the named keys alone
        made[key] = made[key] | value if key == "radar" else value
    return made


def covariances(case):
    """Exact second moments (F, K, 3, 3) of the errors."""
    made, found = range_doppler.prepare(case).design, []
    for one in made.filters:
        lasting, S = error_recursion(one, made.plots, made.x, made.dt)
        found.append(S + lasting[:, :, :1] * lasting[:, None, :, 0])
    return np.stack(found)


def expected(case, name=None, count=100_000):
    """A finished case whose sums are what count realisations give on average, errors taken as Gaussian."""
    axes = range_doppler.prepare(case).axes
    b = np.nan_to_num(axes.exact_bias)
    v = np.nan_to_num(axes.exact_sigma) ** 2 - b**2
    m2 = v + b**2
    error = count * np.stack([b, m2, b**3 + 3 * b * v, b**4 + 6 * b**2 * v + 3 * v**2], axis=-1)
    base = m2[axes.baseline]
    paired = count * m2 * base * (1 + 2 * SHARED**2)
    paired[axes.baseline] = error[axes.baseline, ..., 3]
    paired[:, 0, 0] = error[:, 0, 0, 3]  # all filters begin with the same measured range
    S = covariances(case)
    cross = count * np.stack([S[..., 0, 1], S[..., 0, 2], S[..., 1, 2]], axis=-1)
    sums = {"error": error, "paired": paired, "cross": cross}
    return CaseResult(name or case.name, case.study, case.spec, case.swept_values, count, sums, axes)


def made_radar(stem, variance=1e-3, name=None, count=100_000, **changes):
    """A radar of the paper with some keys of its config changed."""
    return expected(load(config(stem, variance, **changes)).cases[0], name or stem, count)


@pytest.fixture(scope="session")
def paper():
    """The five radars at the paper's D_M = 10⁻³."""
    return [made_radar(stem) for stem in RADARS]


@pytest.fixture(scope="session")
def swept():
    """RLS 2 over the manoeuvre variance."""
    source = {**config("rls2"), "sweep": {"manoeuvre_variance": [1e-5, 1e-4, 1e-3, 1e-2, 1e-1]}, "scans": 40}
    return [expected(case, case.name.replace("config", "rls2")) for case in load(source).cases]


@pytest.fixture(scope="session")
def swept_all():
    """The five radars at the ends of the D_M sweep, long enough to settle."""
    return [made_radar(stem, v, f"{stem} D={v:g}", scans=60) for stem in RADARS for v in (1e-5, 1e-1)]


@pytest.fixture(scope="session")
def expected_radar():
    """`made_radar`."""
    return made_radar


@pytest.fixture(scope="session")
def radar_config():
    """`config`."""
    return config


@pytest.fixture(scope="session")
def expected_case():
    """`expected`."""
    return expected
