"""The windows of many interpretations at once against the designer of one."""

import math

import numpy as np
import pytest

from radarsim.bursts import burst as model
from radarsim.bursts import fisher as bursts_fisher
from radarsim.bursts.schedule_design import Condition, Designer
from radarsim.papers.discriminator import burst_versions
from radarsim.papers.discriminator.burst_versions import BURST, PRINTED_PRIOR, Version
from tests.tolerances import rounding, scaled_condition

POWERS = 2.1e5  # κ of five powers of time, each in its own unit

SHIPPED = Version(*(9.0, 0.5, 3.0, PRINTED_PRIOR, "left out of the form", "nearest", "next", 30000, "closed form"))
COMPUTED = SHIPPED._replace(noise_variance=2.25, threshold=1.0, sigma=None)


def one_at_a_time(version, pulses=30000):
    burst = model.Burst(10e9, 1e-5, 1e-6, 1e-6, pulses, 1.0, version.noise_variance)

    def fisher(duration):
        return bursts_fisher.fisher(burst, 5, duration)

    sigma = np.array(version.sigma or bursts_fisher.spreads(fisher(burst.duration_s)) * BURST.multiples)
    return Designer(burst, sigma, fisher, Condition(threshold=version.threshold)).windows()


@pytest.mark.parametrize(
    "version",
    [SHIPPED, COMPUTED, SHIPPED._replace(threshold=1.0), SHIPPED._replace(noise_variance=0.5, sigma=None)],
    ids=["as printed", "computed", "c = 1", "little noise"],
)
def test_windows_are_those_of_the_designer(version):
    (found,) = burst_versions.design_windows(BURST, [version]).windows
    assert found == one_at_a_time(version)


@pytest.mark.slow
def test_versions_do_not_disturb_one_another():
    every = [SHIPPED, COMPUTED, SHIPPED._replace(phase="kept"), COMPUTED._replace(rounding="up")]
    together = burst_versions.design_windows(BURST, every)
    for i, one in enumerate(every):
        alone = burst_versions.design_windows(BURST, [one])
        assert alone.windows[0] == together.windows[i]
        np.testing.assert_allclose(alone.spreads[0], together.spreads[i], rtol=rounding(POWERS, 5))


def test_the_sum_pulse_by_pulse_is_the_sum():
    found = burst_versions.design_windows(
        BURST, [COMPUTED._replace(pulses=n, sum="pulse by pulse") for n in (29999, 777)]
    )
    for n, spreads in zip((29999, 777), found.spreads, strict=True):
        t = 1e-5 * np.arange(n)
        rows = np.stack([np.ones(n), *(2 * np.pi * t**j / math.factorial(j) for j in range(1, 5))])
        information = rows @ rows.T / (2 * 2.25)  # A² sin² is ½ on average
        condition = scaled_condition(information)
        np.testing.assert_allclose(
            spreads, bursts_fisher.spreads(information), rtol=rounding(condition, 5 + math.log2(n))
        )


def test_with_the_phase_in_it_the_first_problem_has_no_root():
    assert burst_versions.design_windows(BURST, [SHIPPED._replace(phase="kept")]).windows == [None]
    assert burst_versions.first_windows(BURST, [SHIPPED._replace(phase="kept"), SHIPPED]).tolist() == [0, 179]


def test_rounding_up_and_down_are_one_pulse_apart():
    up, down = burst_versions.first_windows(BURST, [COMPUTED._replace(rounding=name) for name in ("up", "down")])
    nearest = burst_versions.first_windows(BURST, [COMPUTED])[0]
    assert up == down + 1
    assert nearest in (up, down)


def test_one_interpretation_gives_spreads_first_window_and_twelve():
    version = Version(2.25, 1.0, 3.0, PRINTED_PRIOR, "left out of the problem", "up", "next", 29999, "pulse by pulse")
    found = burst_versions.design_windows(BURST, [version, version._replace(curvature="as printed")])
    printed = ("0.061", "0.45", "12.2", "183.38", "1213.04")
    for text, value in zip(printed, found.spreads[0], strict=True):
        assert f"{value:.{len(text.partition('.')[2])}f}" == text
    defined, as_printed = found.windows
    assert defined[0] == as_printed[0] == 179  # 1.79 ms
    assert len(defined) - 1 == 12  # after the first
    assert len(as_printed) == 12  # in all
