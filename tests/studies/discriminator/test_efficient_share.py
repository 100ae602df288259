"""What an efficient estimator would score, against a Gaussian drawn another way."""

import math

import numpy as np
import pytest

from radarsim.bursts import fisher
from radarsim.bursts.burst import Burst, balanced_inverse
from radarsim.studies.discriminator import efficient_share
from tests.tolerances import Z

BURST = Burst(10e9, 1e-5, 1e-6, 1e-6, 3000, 1.0, 2.25)
SIGMA = (6.1, 67.5, 6.1e3, 183.38e3, 2.426e6)
SLACK = Z * math.sqrt(2 * 0.02 / efficient_share.DRAWS)  # of the difference of two shares, of some 2 % outside


def test_of_one_window():
    whole = fisher.fisher_sums(BURST, 5, [3000])[0] + np.diag(np.array(SIGMA) ** -2.0)
    covariance = balanced_inverse(whole)
    scale = np.sqrt(np.diag(covariance))
    root = np.linalg.cholesky(covariance / np.outer(scale, scale))
    drawn = np.random.default_rng(7).standard_normal((efficient_share.DRAWS, 5)) @ root.T
    twin = (np.abs(drawn) < 3).all(axis=1).mean()
    assert efficient_share.share_within_bounds(BURST, (3000,), SIGMA) == pytest.approx(twin, abs=SLACK)


def test_windows_only_take_away():
    one, two = (efficient_share.share_within_bounds(BURST, windows, SIGMA) for windows in ((3000,), (300, 3000)))
    assert two < one < math.erf(3 / math.sqrt(2))
    assert efficient_share.share_within_bounds(BURST, (300, 3000), SIGMA, 40.0) == 1.0


def test_louder_noise_than_believed_is_a_narrower_limit():
    """Where the forecast says nothing, noise of twice the σ under 3 σ is noise as believed under 1.5 σ."""
    nothing = tuple(1e4 * np.array(SIGMA))
    louder = efficient_share.share_within_bounds(BURST, (3000,), nothing, 3.0, 2.0)
    assert louder == pytest.approx(efficient_share.share_within_bounds(BURST, (3000,), nothing, 1.5), abs=3e-4)
    assert louder < 0.8 * efficient_share.share_within_bounds(BURST, (3000,), nothing)
