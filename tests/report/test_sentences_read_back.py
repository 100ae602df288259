"""No sentence of an answer contradicts the tables: every number with an interval, and every exact one, is read back."""

import numpy as np
import pandas as pd
import pytest

from radarsim.api import result_content
from radarsim.api.configs import load
from radarsim.api.run import run
from radarsim.config.find_files import SHIPPED
from radarsim.language import current
from radarsim.report.exact_marks import MARK, marking
from tests.report.sentence_reader import EVENTS, derived_columns, names_of, read_sentence

CONFIGS = sorted(path.stem for path in (SHIPPED / "configs").glob("*.yaml"))
RANGE = {"observes": ["range"], "manoeuvre_variance": 1e-3}
VELOCITY = {"observes": ["range", "velocity"], "manoeuvre_variance": 1e-3}
ODD = {
    "swapped": ("rls2", {"filters": [{"name": "r+Vr", **VELOCITY}, {"name": "r", **RANGE}]}),
    "equal": ("rls2", {"filters": [{"name": "A", **RANGE}, {"name": "B", **RANGE}]}),
    "baseline last": ("rls2", {"baseline": "r+Vr"}),
    "missed": ("rls2", {"radar.detection_probability": 0.3}),
    "few scans": ("rls2", {"scans": 4}),
    "equal, measured": (
        "sonar_smoothing",
        {
            "sensor.detection_probability": 0.5,
            "filters": [{"name": name, "kind": "growing_memory", "degree": 1} for name in "AB"],
        },
    ),
    "two values": ("rls2", {"sweep": {"radar.sigma_velocity_mps": [2, 20]}}),
}


def faults_of(result):
    """Faults of all sentences of an answer and its captions, in every language, and how many numbers were read."""
    faults, count, derived = [], 0, list(derived_columns(result._tables, result.cases))
    for code in current.language_codes():
        with current.use_language(code):
            names = names_of(result.cases, code)
            texts = result_content.make_answer(result.cases, result._tables).marked_texts
            with marking():
                figures = result_content.case_figures(result.cases, result._tables, result.experiment).values()
        for text in (*texts, *(figure.caption for figure in figures)):
            reading = read_sentence(text, result._tables, code, derived, names)
            faults += [f"{code}: {text}: {fault}" for fault in reading.faults]
            count += len(reading.read)
    return faults, count


def test_the_reader_notices_what_contradicts_a_table():
    gains = {"gain_percent": [33.8], "gain_lo": [31.1], "gain_hi": [36.7], "exact_percent": [30.97]}
    exact, measured = ({"gains": pd.DataFrame(gains | {"exact_percent": [value]})} for value in (30.97, np.nan))
    quoted = "at worst 33.8 % [31.1, 36.7] higher, at 100 s"
    (fault,) = read_sentence(quoted, exact).faults
    assert "known exactly, 30.97" in fault
    assert read_sentence(quoted, measured).read == ["33.8 % [31.1, 36.7]"]
    assert read_sentence(f"at worst 31.0 %{MARK} higher", exact).read == [f"31.0 %{MARK}"]
    assert read_sentence(f"31,0 %{MARK}", exact, "ru").read == [f"31.0 %{MARK}"]
    assert read_sentence("33,8 % [31,1; 36,7]", measured, "ru").read == ["33.8 % [31.1, 36.7]"]
    assert read_sentence(f"at worst 32.0 %{MARK} higher", exact).faults
    assert read_sentence("33.8 % [29.0, 38.0]", measured).faults
    assert read_sentence("33.8 % [29.0, 38.0] (95 % for all 14 comparisons together)", measured).read


def test_the_reader_tells_all_from_nearly_all():
    for share, is_read in ((1.0, True), (0.99999, False)):
        tables = {
            "locks": pd.DataFrame({"lock_rate": [share], "lock_lo": [0.9985], "lock_hi": [1.0]}),
            "curves": pd.DataFrame({"sigma": [], "sigma_lo": [], "sigma_hi": [], "believed_sigma": []}),
        }
        assert bool(read_sentence("locked in 100 % [99.85, 100]", tables).read) == is_read


def test_the_reader_notices_the_number_of_another_row():
    """Of another case, filter, component or time than those next to the number."""
    rows = [
        *(("one", "r", "r", 10.0, 7.0), ("one", "r+Vr", "r", 10.0, 5.0), ("one", "r", "r", 20.0, 6.0)),
        *(("two", "r", "r", 20.0, 4.0), ("one", "r", "Vr", 10.0, 3.0)),
    ]
    curves = pd.DataFrame(rows, columns=["case", "filter", "component", "t_s", "sigma"])
    curves.insert(4, "k", curves["t_s"] / 10)
    curves = curves.assign(sigma_lo=curves["sigma"] - 1, sigma_hi=curves["sigma"] + 1, exact_sigma=np.nan)
    names = {
        "case": {"a = 1": "one", "a = 2": "two"},
        "filter": {"r": "r", "r+Vr": "r+Vr"},
        "component": {"range": "r", "radial velocity": "Vr"},
    }
    for sentence, is_right in {
        "a = 1: σ of the range at 10 s: least with r+Vr, 5.0 m [4.0, 6.0], largest with r, 7.0 m [6.0, 8.0].": True,
        "a = 1: σ of the range at 10 s: least with r, 5.0 m [4.0, 6.0], largest with r+Vr, 7.0 m [6.0, 8.0].": False,
        "a = 1: σ of the radial velocity of r at 10 s is 3.0 m [2.0, 4.0].": True,
        "a = 1: σ of the range of r at 10 s is 3.0 m [2.0, 4.0].": False,
        "r: σ of the range is 4.0 m [3.0, 5.0] (a = 2) to 6.0 m [5.0, 7.0] (a = 1) at scan 2": True,
        "r: σ of the range is 4.0 m [3.0, 5.0] (a = 1) to 6.0 m [5.0, 7.0] (a = 2) at scan 2": False,
        "r: σ of the range at the last scan is 6.0 m [5.0, 7.0]": True,
        "r: σ of the range at the last scan is 7.0 m [6.0, 8.0]": False,
        "r: at best 6.0 m [5.0, 7.0], at 20 s; at worst 7.0 m [6.0, 8.0], at 10 s": True,
        "r: at best 6.0 m [5.0, 7.0], at 10 s; at worst 7.0 m [6.0, 8.0], at 20 s": False,
    }.items():
        assert (read_sentence(sentence, {"curves": curves}, names=names).faults == []) is is_right, sentence


def test_the_reader_notices_a_ratio_of_others():
    """Of the cases, or filters, in the other order, with an interval of another level, or measured though exact."""
    rows = [("one", "A", 8.0, np.nan), ("one", "B", 6.0, 6.0), ("two", "A", 2.0, 2.0)]
    curves = pd.DataFrame(rows, columns=["case", "filter", "sigma", "exact_sigma"]).assign(component="r", k=1, t_s=10.0)
    curves = curves.assign(sigma_lo=curves["sigma"] * 0.9, sigma_hi=curves["sigma"] / 0.9)
    names = {"case": {"a = 1": "one", "a = 2": "two"}, "filter": {"A": "A", "B": "B"}}
    other = "a = 1, σ relative to that at a = 2"
    for sentence, is_right in {
        f"{other}: 4.00 [3.60, 4.44] (A)": True,
        f"{other} (95 % for all 4 simulated values together): 4.00 [3.50, 4.57] (A)": True,
        f"{other} (95 % for all 4 simulated values together): 4.00 [3.60, 4.44] (A)": False,
        f"{other} (95 % for all 4 simulated values together): 4.00 [3.00, 5.30] (A)": False,
        "a = 2, σ relative to that at a = 1: 4.00 [3.60, 4.44] (A)": False,
        "A: σ is up to 1.33 [1.20, 1.48] times that with B (a = 1, scan 1)": True,
        "B: σ is up to 1.33 [1.20, 1.48] times that with A (a = 1, scan 1)": False,
        "B: σ is up to 0.75 [0.68, 0.83] times that with A (a = 1, scan 1)": True,
        f"B: σ is up to 0.75{MARK} times that with A (a = 1, scan 1)": False,
    }.items():
        assert (read_sentence(sentence, {"curves": curves}, names=names).faults == []) is is_right, sentence


def test_the_reader_reads_the_share_at_the_end_of_a_phase():
    rows = [("alarm", 20.0, 0.3), ("alarm", 35.0, 0.5), ("alarm", 45.0, 0.7), ("false alarm", 35.0, 0.1)]
    delays = pd.DataFrame(rows, columns=["event", "delay_s", "probability"])
    delays = delays.assign(probability_lo=delays["probability"] - 0.1, probability_hi=delays["probability"] + 0.1)
    delays = delays.assign(case="one", filter="10 plots", component="x", t_s=100.0, false_alarm_probability=0.01)
    names = {"filter": {"10 plots": "10 plots"}, "event": EVENTS}
    tables = {"delays": delays, "curves": pd.DataFrame()}
    for share, rate, is_right in (
        ("50 % [40, 60]", 0.01, True),
        ("30 % [20, 40]", 0.01, False),
        ("50 % [40, 60]", 0.1, False),
    ):
        text = f"alarm by the end of the manoeuvre (40 s), P_FA ≈ {rate}: 10 plots in {share}, in half within 20 s."
        assert (read_sentence(text, tables, names=names).faults == []) is is_right, text
    assert read_sentence(
        "False alarm within the 40 s, P_FA ≈ 0.01: 10 plots in 50 % [40, 60]", tables, names=names
    ).faults


@pytest.mark.parametrize("odd", ODD)
def test_odd_variants_contradict_no_table(odd):
    config, overrides = ODD[odd]
    faults, count = faults_of(run(config, realisations=200, overrides=overrides))
    assert faults == []
    assert count or odd == "equal"


ODD_OF_STUDIES = {  # of the first config of each part; keys of odd values, and values to sweep
    "multimodel_1hz": {"scans": 4, "sensor.detection_probability": 0.3},
    "multimodel_families_1hz": {"sweep": {"sensor.detection_probability": [0.5, 1]}},
    "sonar_smoothing": {"scans": 4, "sensor.detection_probability": 0.3},
    "sonar_missed": {"sweep": {"sensor.detection_probability": [0.3, 1]}},
    "sonar_manoeuvre": {"scans": 60},
    "sonar_clutter": {"sensor.detection_probability": 0.3},
    "ambiguous_rls2": {"scans": 2, "radar.detection_probability": 0.3},
    "orders": {"scans": 4},
    "pulses_rls2": {"scans": 4, "sweep": {"radar.sigma_range_m": [100, 400]}},
    "discriminator_rival": {"sweep": {"burst.noise_variance": [2.25, 18]}},
}


def odd_filters(config):
    """Filters, or estimators, of a config in another order, twice the same, and one alone; its last as the baseline."""
    spec = load(config).cases[0].spec
    key = "estimators" if hasattr(spec, "estimators") else "filters"
    filters = [one.model_dump(mode="json", exclude_unset=True) for one in getattr(spec, key)]
    yield {key: filters[::-1]}
    yield {key: [{**filters[0], "name": name} for name in "AB"]}
    yield {key: filters[:1]}
    if key == "filters":
        yield {"baseline": filters[-1]["name"]}


@pytest.mark.slow
@pytest.mark.parametrize("config", ODD_OF_STUDIES)
def test_odd_variants_of_every_study_contradict_no_table(config):
    for overrides in (*odd_filters(config), *({key: odd} for key, odd in ODD_OF_STUDIES[config].items())):
        assert faults_of(run(config, realisations=60, overrides=overrides))[0] == [], overrides


@pytest.mark.slow
@pytest.mark.parametrize("config", CONFIGS)
def test_no_shipped_config_contradicts_its_tables(config):
    assert faults_of(run(config, realisations=100))[0] == []
