"""A study of a package that offers a part of another study: what the part does not know is refused, not passed over."""

import numpy as np
import pytest

from radarsim.api.load_experiments import load_all
from radarsim.recordings import csv_output, simulate_plots, study_part
from tests.studies import example_packages

FILES = {
    "__init__.py": """
from radarsim.studies.range_doppler import RangeDoppler


class Frozen(RangeDoppler):
    name, about, filters = "frozen", "Frozen gains.", {}

    def keys(self):
        from frozen.config import Keys

        return Keys

    def recording_interface(self):
        from frozen.track import Recorded

        return Recorded()

    def claims(self):
        return None


STUDY = Frozen()
""",
    "config.py": """
from radarsim.studies.range_doppler import config


class Filter(config.Filter):
    frozen_from_k: int = 5


class Keys(config.Keys):
    filters: tuple[Filter, ...]
""",
    "track.py": "from radarsim.studies.range_doppler.recorded_plots import RangeDopplerRecordedPlots\n",
}
OWN = """
from radarsim.studies.range_doppler import track


class Recorded(track.Recorded):
    def tracker(self, case):
        return track.Tracker(case)
"""
CONFIG = """
study: frozen
radar: {wavelength_m: 0.15, sigma_range_m: 250, sigma_velocity_mps: 15, scan_period_s: 10}
target: polynomial
filters:
  - {name: r, observes: [range], manoeuvre_variance: 1e-3}
scans: 15
realisations: 1000
seed: 1
"""


@pytest.fixture
def place(tmp_path):
    (tmp_path / "site/frozen").mkdir(parents=True)
    for name, text in FILES.items():
        (tmp_path / "site/frozen" / name).write_text(text)
    example_packages.metadata(tmp_path / "site", "frozen", "1", {"frozen": "frozen:STUDY"})
    (tmp_path / "mine.yaml").write_text(CONFIG)
    columns = simulate_plots.simulate_realisation(load_all(["rls2"], ())[0])
    csv_output.write_columns({name: np.asarray(column) for name, column in columns.items()}, tmp_path / "plots.csv")
    return tmp_path


@pytest.mark.slow
def test_a_borrowed_part_refuses_keys_that_it_does_not_know(place, warm):
    command = example_packages.beside(warm, place / "site", place)
    for words in (("track", "mine.yaml", "plots.csv"), ("fit", "mine.yaml", "plots.csv"), ("simulate", "mine.yaml")):
        told = command(*words, *(("-o", "out.csv") if words[0] != "fit" else ()), code=2).stderr
        assert "does not know filters.0.frozen_from_k" in told
        assert not (place / "out.csv").exists()
    # Of its own it knows them; what it still borrows is not asked for advice.
    (place / "site/frozen/track.py").write_text(OWN)
    said = command("track", "mine.yaml", "plots.csv", "-o", "out.csv").stdout
    assert "NIS" in said
    assert "advice" not in said


def test_no_shipped_study_refuses_itself():
    for stem in ("rls2", "ambiguous_rls2", "multimodel", "sonar_smoothing", "sonar_clutter"):
        case = load_all([stem], ())[0].cases[0]
        assert not any(
            study_part.unknown_inherited_keys(case, part) for part in ("tracker", "simulated", "drawing", "likelihood")
        )
