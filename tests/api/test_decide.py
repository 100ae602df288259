"""`--decide`: as many realisations as decide, no more; what is left, and what it would take. Disagreement: exit 4."""

import math

import pytest

import radarsim
from radarsim.papers import claims_table
from radarsim.papers.run_until_decided import _undecided_rows as undecided_rows
from radarsim.papers.verdict_rule import CONFIRMED, UNDECIDED
from tests.program import command


@pytest.mark.slow
def test_what_is_known_exactly_is_decided_at_the_first_look(tmp_path):
    seen = []
    keep = {"out": tmp_path, "progress": lambda *of: seen.append(of)}
    result = radarsim.run("range_doppler", realisations=8000, decide=True, figures=False, **keep)
    assert seen[-1] == (25 * 2000, 25 * 8000, 0)  # 25 of the 30 cases differ; towards the last look
    assert {case.count for case in result.cases} == {2000}
    assert result.unmet == []
    assert result.facts["stop"] == "done"
    assert result.facts["command"] == "radarsim run range_doppler -n 2000"


def test_what_is_left_says_what_it_would_take():
    row = {"paper": "p", "claim": "P9.1", "as_shipped": UNDECIDED, "extension": False, "n": 4000, "needed": 12345.0}
    assert undecided_rows([row]) == ["P9.1 not yet decided at 4000 realisations; about 13,000 would"]
    assert "more realisations would not decide" in undecided_rows([row | {"needed": math.nan}])[0]
    assert undecided_rows([row | {"as_shipped": CONFIRMED}]) == []
    assert undecided_rows([row | {"extension": True}]) == []
    assert undecided_rows([row | {"class": CONFIRMED}])  # over all interpretations, by other runs than this


def test_a_time_limit_before_all_cases_names_the_claims_that_wait(tmp_path):
    def one_case():
        return "time limit of 1 s" if len(list((tmp_path / ".blocks").glob("*/*"))) > 1 else None

    done = radarsim.run(
        "range_doppler", realisations=8000, decide=True, time_limit=one_case, out=tmp_path, figures=False
    )
    assert done.unmet[0] == "time limit of 1 s"
    assert len(done.cases) < 30
    assert done.unmet[1].startswith(f"{len(done.cases)} of 30 cases were done by then, too few to decide P1.1, P1.2,")


@pytest.mark.slow
def test_undecided_at_the_most_is_exit_code_3(tmp_path):
    """Eight bursts leave P4.4 open; a look at the most is made though it is no 2000·2^m."""
    words = ("run", "discriminator_paper", "-n", "60", "--decide", "--no-figures", "-q")
    done = command(*words, "--out", tmp_path, code=3)
    assert "P4.4 not yet decided at 60 realisations; " in done.stderr


def test_an_exact_value_that_simulation_denies_is_exit_code_4_with_all_written(tmp_path, monkeypatch):
    monkeypatch.setattr(claims_table, "disagreements", lambda table: ["P1.1: exact 1, simulated 2"])
    done = command("run", "rls1", "rls2", "-n", "500", "--out", tmp_path, "--no-figures", "-q", code=4)
    assert done.stderr == "".join(f"{stem}: P1.1: exact 1, simulated 2\n" for stem in ("rls1", "rls2"))
    for stem in ("rls1", "rls2"):
        assert (tmp_path / stem / "claims.csv").is_file()
        assert (tmp_path / stem / "report.html").is_file()
