"""The line of a page that says what flew."""

import pytest

from radarsim.api import configs
from radarsim.report.target_words import target_words

PATH = "range_m: 8e3, speed_mps: 12, aspect_deg: 180"
TURN = f"target={{kind: turn, {PATH}, start_s: 60, acceleration_g: 0.2, duration_s: 18}}"


@pytest.mark.parametrize(
    ("config", "overrides", "words"),
    [
        ("rls2", [], "Target: a polynomial of any degree up to 11; −250 m/s; 4 m/s²."),
        ("rls2", [TURN], "Target: a turn of given g between two straight legs; 12 m/s; 0.2 g from 60 s on."),
        ("multimodel", [], "Target: an integrated flight; 1430 m/s at the first plot; manoeuvres from 125 s on."),
        ("discriminator", [], ""),
        ("rls2_manoeuvres", [], ""),
    ],
)
def test_kind_speed_and_manoeuvre_of_a_common_target(config, overrides, words):
    assert target_words(configs.load(config, overrides).cases) == words
