"""P2's interpretations: which cases they change, and how; what is flown is looked up by what the shipped case is."""

from pathlib import Path

import pytest

from radarsim.api.configs import load
from radarsim.papers.multimodel.interpretations import Interpretations
from radarsim.papers.study_claims import claims_of
from radarsim.studies import registry
from radarsim.studies.multimodel.flights import FLIGHTS
from tests.tolerances import rounding

OF = Interpretations()
CLAIMS = {one.id: one for one in claims_of(registry.study("multimodel")).claims}


@pytest.fixture(scope="module")
def case():
    return load("multimodel").cases[0]


def sigmas(spec):
    return {f.name: [(m.motion, m.sigma_acceleration_mps2) for m in f.models] for f in spec.filters}


def test_the_default_interpretation_changes_nothing(case):
    assert OF.changed_case(CLAIMS["P2.1"], case, OF.interpretation()).spec == case.spec


def test_there_are_two_dozen_interpretations_of_the_main_claim():
    every = OF.for_claim("P2.1")
    assert every[0] == OF.interpretation()
    assert len(every) >= 24
    assert {one["flight"] for one in every} == {"aeroballistic", *FLIGHTS}
    assert {OF.kind(one) for one in every} == {"E", "U", "N"}


def test_every_combination_of_what_bears_on_a_claim_is_declared():
    """16 flights, σ_A read in two ways, three starts; of P2.13 two kinds of banks: the joint search has them all."""
    allowed = {claim: [one for one in OF.for_claim(claim) if OF.kind(one) != "N"] for claim in CLAIMS}
    assert len(allowed["P2.1"]) == len(allowed["P2.7"]) == len(allowed["P2.12"]) == 16 * 2 * 3
    assert len(allowed["P2.13"]) == 16 * 2 * 3 * 2
    assert len(allowed["P2.4"]) == 2 * 3
    assert {one["output"] for one in allowed["P2.7"]} == {"best"}  # (5) is printed


def test_the_printed_output_is_the_default():
    output = next(one for one in OF.choices if one.key == "output")
    assert "(5)" in output.original
    assert [one.kind for one in output.alternatives] == ["E", "N"]


def test_a_flight_takes_the_place_of_the_lost_one_alone(case):
    changed = OF.changed_case(CLAIMS["P2.1"], case, OF.interpretation(flight="pull-up 250"))
    assert changed.spec.target == FLIGHTS["pull-up 250"]
    assert changed.spec.filters == case.spec.filters
    others = load("multimodel_trajectories").cases
    kept = [OF.changed_case(CLAIMS["P2.4"], one, OF.interpretation()) for one in others]
    assert [one.name for one in kept if one is not None] == [one.name for one in others if "airliner" in one.name]


def test_sigma_per_second_is_a_twentieth_at_20_hz(case):
    shipped = sigmas(case.spec)
    second = sigmas(OF.changed_case(CLAIMS["P2.1"], case, OF.interpretation(sigma_acceleration="per second")).spec)
    for name, models in shipped.items():
        for (motion, own), (_, other) in zip(models, second[name], strict=True):
            assert other == pytest.approx(own * (0.05 if motion == "accelerated" else 1), rel=rounding(operations=3))
    both = sigmas(
        OF.changed_case(CLAIMS["P2.1"], case, OF.interpretation(sigma_acceleration="per second, both motions")).spec
    )
    assert both["Kalman-1 20"] == [("uniform", pytest.approx(1.0, rel=rounding(operations=3)))]


def test_the_output_start_and_bank(case):
    moment = OF.changed_case(CLAIMS["P2.1"], case, OF.interpretation(output="moment")).spec
    assert {f.name: f.output for f in moment.filters if f.family == "imm"} == {
        "MMA2-122": "moment",
        "MMA2-11": "moment",
    }
    assert (
        OF.changed_case(CLAIMS["P2.1"], case, OF.interpretation(start_acceleration="3")).spec.start_acceleration_mps2
        == 3
    )
    banks = load("multimodel_banks").cases[0]
    changed = OF.changed_case(CLAIMS["P2.13"], banks, OF.interpretation(bank="accelerated")).spec
    pairs = [own for own in sigmas(changed).values() if len(own) == 2]
    assert [("accelerated", 0.025), ("accelerated", 0.05)] in pairs
    assert [("accelerated", 15.0), ("accelerated", 30.0)] in pairs


@pytest.mark.slow
def test_a_flown_interpretation_is_measured_over_its_own_stages(tmp_path):
    from radarsim.papers.judge_interpretations import judge_requests
    from radarsim.papers.open_papers import JudgingRequest, judging_requests

    of = next(one for one in judging_requests(["P2.3"]))
    wanted = JudgingRequest(of.paper, of.claims, whole=False)
    done = judge_requests([wanted], out=tmp_path, realisations=16, figures=False)
    flown = [one for one in done.papers[0].claims[0].verdicts if one.interpretation["flight"] == "pull-up 250"]
    assert flown
    assert all(one.outcome is not None for one in flown)
    # Over the stages of what was flown, 125 to 129 s, and not over the shipped flight's, which end at 170 s.
    import radarsim

    config = load("multimodel")
    document = radarsim.run(
        {**_document(config), "target": FLIGHTS["pull-up 250"].model_dump(exclude_none=True)}, realisations=16
    )
    rows = document.tables["probabilities"]
    own = rows[(rows["filter"] == "MMA2-122") & (rows["t_s"] >= 125) & (rows["t_s"] < 129)]
    mean = own.groupby("model")["probability"].mean()
    expected = mean[3] - max(mean[1], mean[2])
    shipped = next(one for one in flown if one.interpretation["sigma_acceleration"] == "per step")
    size = mean[3] + max(mean[1], mean[2])  # means of so many probabilities, and their difference
    assert shipped.parts[0][1].measured == pytest.approx(expected, rel=0, abs=rounding(size, len(own)))


def _document(experiment):
    import yaml

    return yaml.safe_load(Path(experiment.path).read_text(encoding="utf-8"))
