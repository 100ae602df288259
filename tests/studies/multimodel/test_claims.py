"""P2's claims that need no simulation, and the one that the paper only reports."""

import numpy as np
import pytest

import radarsim
from radarsim.papers.claim_rows import count_classes, is_extension
from radarsim.papers.multimodel import measures
from radarsim.papers.multimodel.interpretations import Interpretations
from radarsim.papers.study_claims import claims_of
from radarsim.papers.verdict_rule import CONFIRMED, REFUTED
from radarsim.studies import registry
from radarsim.studies.multimodel import cost
from tests.tolerances import mean_error

CLAIMS = {one.id: one for one in claims_of(registry.study("multimodel")).claims}


@pytest.fixture(scope="module")
def transition():
    return radarsim.run("multimodel_transition", realisations=64, figures=False)


@pytest.fixture(scope="module")
def rows():
    table = radarsim.run("multimodel", realisations=16, figures=False).tables["claims"]
    return table[table["claim"].isin(["P2.16", "P2.17"])].set_index("claim")


def test_linearisation_of_a_plot_against_noisy_plots():
    """The mean squared error along the line of sight of 10⁶ plots, converted with their own angles."""
    noise, n = np.random.default_rng(1).normal(size=(3, 1_000_000)), 1_000_000
    for sigma_m, minutes in ((2.5, 6), (17, 15), (1, 10)):
        angle = np.radians(minutes / 60)
        plot = (200e3 + sigma_m * noise[0]) * np.cos(angle * noise[1]) * np.cos(angle * noise[2])
        found = np.mean((plot - 200e3) ** 2) / sigma_m**2 - 1
        bend = float(measures.bend(200e3, np.array(sigma_m), np.array(angle)))
        assert found == pytest.approx(bend, abs=mean_error(n, np.sqrt(10)) * (1 + bend))


def test_most_of_the_printed_accuracies_are_linear_enough(rows):
    """Sure of them by hand: at 15′ a plot bends by r σ² √20 = 17 m over a tenth, at 2′ by less than the least σ."""
    assert rows.loc["P2.16", "exact"].tolist() == pytest.approx([0.9625, 0.801], abs=5e-4)
    assert rows.loc["P2.16", "class"].eq(CONFIRMED).all()
    assert rows.loc["P2.16", "extension"].tolist() == [False, True]
    assert measures.share_linear(None, (), 2e3) == 1
    assert measures.share_linear(None, (), 1e9) == 0


def test_blocks_of_the_families(rows):
    assert rows.loc["P2.17", "exact"].tolist() == pytest.approx([1, 1, 1, 7 / 9, 1, 7 / 9])
    assert rows.loc["P2.17", "class"].eq(CONFIRMED).all()
    assert rows.loc["P2.17", "extension"].tolist() == [False] * 3 + [True] * 3
    full, none = np.full((4, 4), 0.25), np.eye(4)
    for T, extrapolated in ((full, 16), (none, 4)):
        late, updated = cost.model_counts("imm", T, merged_first=False)
        assert (late.sum(), updated.sum()) == (extrapolated, 4)
        assert cost.model_counts("imm", T)[0].sum() == 4
        assert [one.sum() for one in cost.model_counts("gpb2", T)] == [extrapolated] * 2


def test_what_the_paper_reports_of_others_is_judged_and_not_counted(transition):
    parts = transition.tables["claims"].to_dict("records")
    own = [row for row in parts if row["claim"] == "P2.12"]
    assert {row["class"] for row in own} == {REFUTED}
    assert is_extension(own)
    assert "P2.12" in [claim for claim in CLAIMS if Interpretations().for_claim(claim)]
    assert count_classes(own) == ({}, 1)
