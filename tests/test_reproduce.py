"""`make reproduce-figures` in small: a line for each config, the rest goes on after a fault, a summary at the end."""

from radarsim import experiment, reproduce


def test_a_line_each_and_a_summary(tmp_path):
    told = []
    experiments = experiment.load_all(["rls2", "rls4"], ["realisations=100"])
    done = reproduce.reproduce(experiments, str(tmp_path), told.append, figures=False)
    assert [line[:14] for line in told] == ["[ 1/2] rls2   ", "[ 2/2] rls4   "]
    assert "claims: " in told[0]
    summary = reproduce.summary(done, str(tmp_path))
    assert any(line.startswith("claims   ") and "not run" in line for line in summary)
    assert any(line.startswith("time     0:00:") and "2 configs" in line for line in summary)
    assert (tmp_path / "index.html").exists()


def test_a_fault_is_told_and_the_rest_runs(tmp_path):
    (tmp_path / "rls2").write_text("a file where a folder should be")
    told = []
    experiments = experiment.load_all(["rls2", "rls4"], ["realisations=100"])
    done = reproduce.reproduce(experiments, str(tmp_path), told.append, figures=False)
    assert "FAILED: " in told[0]
    assert [bool(one.faults) for one in done] == [True, False]
    assert "failed   rls2" in reproduce.summary(done, str(tmp_path))
