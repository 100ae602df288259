"""Every key of range_doppler, spoiled in every way, and the very words the user gets."""

import math
import random

import pytest

from radarsim.api.configs import load
from radarsim.errors import ConfigError

NUMBER = "must be a number"
BANDS = "metre, decimetre, centimetre, HF, VHF, UHF, L, S, C, X, Ku, K, Ka, V, W, mm"
SIZE = "must be at least 1e-18 in size"
POSITIVE = [
    (0, "must be > 0, got 0"),
    (-250, "must be > 0, got -250"),
    (-1e-30, "must be > 0, got -1e-30"),
    ("x", f"{NUMBER}, got 'x'"),
    (True, f"{NUMBER}, got true"),
    ([1], f"{NUMBER}, got [1]"),
    ({}, f"{NUMBER}, got {{}}"),
    ("1e5", f"{NUMBER}, got '1e5'"),
    (1e19, "must be at most 1e18 in size, got 1e19"),
    (1e-19, f"{SIZE}, got 1e-19"),
    (math.nan, "must be a finite number, got nan"),
    (math.inf, "must be a finite number, got inf"),
    (None, "has no value"),
    ("", f"{NUMBER}, got ''"),
    ("0x1", f"{NUMBER}, got '0x1'"),
]
POSITIVE_KEYS = [
    "radar.wavelength_m",
    "radar.sigma_range_m",
    "radar.sigma_velocity_mps",
    "radar.scan_period_s",
    "radar.repetition_rate_hz",
    "filters.0.manoeuvre_variance",
    "filters.1.manoeuvre_variance",
]
WHOLE = "must be a whole number"
COUNT = [
    (2.5, f"{WHOLE}, got 2.5"),
    (True, f"{WHOLE}, got true"),
    ("3", f"{WHOLE}, got '3'"),
    ([3], f"{WHOLE}, got [3]"),
    (math.inf, "must be a finite number, got inf"),
    (None, "has no value"),
    ({}, f"{WHOLE}, got {{}}"),
]
COUNTS = {
    "scans": [
        (1, "must be >= 2, got 1"),
        (0, "must be >= 2, got 0"),
        (-3, "must be >= 2, got -3"),
        (100_001, "must be <= 100000, got 100001"),
        (1e18, "must be <= 100000, got 1e18"),
        (2, "must be >= 3 for the initialisation of filter r, got 2"),
    ],
    "realisations": [
        (0, "must be >= 1, got 0"),
        (-1, "must be >= 1, got -1"),
        (1e13, "must be <= 1e12, got 1e13"),
        (10**12 + 1, "must be <= 1e12, got 1000000000001"),
    ],
    "seed": [
        (-1, "must be >= 0, got -1"),
        (2**64, "must be <= 18446744073709551615, got 18446744073709551616"),
        (1e300, "must be <= 18446744073709551615, got 1e300"),
    ],
    "filters.0.initial_scans": [
        (1, "must be >= 2, got 1"),
        (2, "must be >= 3 for a filter that observes range, got 2"),
    ],
    "filters.1.initial_scans": [(1, "must be >= 2, got 1"), (0, "must be >= 2, got 0")],
}
TEXT = [
    (3, "must be text, got 3"),
    (True, "must be text, got true"),
    ("", "must not be empty, got ''"),
    (["a"], "must be text, got ['a']"),
    ("x" * 65, "must have at most 64 characters, got 'xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx…"),
    ("a\nb", r"must be printable text on one line, without blanks around it, got 'a\nb'"),
    ("\x1b[31m", r"must be printable text on one line, without blanks around it, got '\x1b[31m'"),
    (" a", "must be printable text on one line, without blanks around it, got ' a'"),
]
OBSERVES = "must be [range] or [range, velocity]"
OTHERS = [
    ("radar", 3, "must be a mapping of keys, got 3"),
    ("radar", [1], "must be a mapping of keys, got [1]"),
    ("radar.band", "meter", "must be one of {bands}, got 'meter'"),
    ("radar.band", 3, "must be one of {bands}, got 3"),
    ("target", 3, "must be a mapping of keys, got 3"),
    ("target", [], "must be a mapping of keys, got []"),
    ("target", "../polynomial", "must be the stem of a scenario, without folder or suffix, got '../polynomial'"),
    ("target", "", "must be the stem of a scenario, without folder or suffix, got ''"),
    ("target", "polynomal", "no such scenario; did you mean polynomial?, got 'polynomal'"),
    (
        "target.kind",
        "jerk",
        "must be one of polynomial, acceleration_start, jerk_pulse, turn, fly_by, recorded, got 'jerk'",
    ),
    ("target.kind", 3, "must be one of polynomial, acceleration_start, jerk_pulse, turn, fly_by, recorded, got 3"),
    ("target.coefficients", [], "must hold at least 1, got []"),
    ("target.coefficients", [0] * 13, "must hold at most 12, got [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]"),
    ("target.coefficients", 3, "must be a list, got 3"),
    ("target.coefficients", "123", "must be a list, got '123'"),
    ("target.coefficients", {"0": 1}, "must be a list, got {0: 1}"),
    ("filters", [], "must hold at least 1, got []"),
    ("filters", {}, "must be a list, got {}"),
    ("filters", "r", "must be a list, got 'r'"),
    ("filters.0", "r", "must be a mapping of keys, got 'r'"),
    ("filters.0.observes", ["velocity"], f"{OBSERVES}, got ['velocity']"),
    ("filters.0.observes", ["velocity", "range"], f"{OBSERVES}, got ['velocity', 'range']"),
    ("filters.0.observes", ["range", "range"], f"{OBSERVES}, got ['range', 'range']"),
    ("filters.0.observes", [], f"{OBSERVES}, got []"),
    ("filters.0.observes", "range", "must be a list, got 'range'"),
    ("baseline", "x", "must be the name of a filter: r, r+Vr, got 'x'"),
    ("study", "range_dopler", "must be one of {studies}; did you mean range_doppler?, got 'range_dopler'"),
    ("study", 3, "must be text, got 3"),
    ("sweep", [1], "must be a mapping of keys, got [1]"),
    ("sweep", {}, "must hold at least 1, got {}"),
    ("sweep", {"scans": 15}, "config: sweep.scans: must be a list, got 15"),
    ("sweep", {"scans": []}, "config: sweep.scans: must hold at least 1, got []"),
    ("include", "rls2", "must be a list, got 'rls2'"),
    ("figures", 3, "must be a list, got 3"),
    ("figures", {"sigma_r": "x"}, "config: figures.sigma_r: must be a list, got 'x'"),
    ("figures", {"sigma_r": []}, "config: figures.sigma_r: must hold at least 1, got []"),
    ("figures", {"sigma_r": ["rls*"]}, "config: figures.sigma_r.0: no case has this name, got 'rls*'"),
]
TABLE = [
    *((key, value, message) for key in POSITIVE_KEYS for value, message in POSITIVE),
    *((key, value, message) for key in COUNTS for value, message in [*COUNT, *COUNTS[key]]),
    *((key, value, message) for key in ("radar.name", "filters.1.name") for value, message in TEXT),
    *(("target.coefficients.1", value, message) for value, message in POSITIVE if "> 0" not in message),
    *OTHERS,
]


def spoil(config: dict, key: str, value: object) -> dict:
    """The config with another value at a dotted key."""
    *outer, last = (int(step) if step.isdigit() else step for step in key.split("."))
    holder = config
    for step in outer:
        holder = holder[step]
    holder[last] = value
    return config


@pytest.mark.parametrize(("key", "value", "message"), TABLE, ids=lambda v: repr(v)[:40])
def test_bad_value(good, said, key, value, message):
    from radarsim.studies import registry

    message = message.replace("{studies}", ", ".join(registry.study_names())).replace("{bands}", BANDS)
    line = message if message.startswith("config: ") else f"config: {key}: {message}"
    lines = said(spoil(good, key, value))
    if value == {} and key.endswith("manoeuvre_variance"):  # a mapping says what it is to make least
        assert lines == [f"config: {key}.minimise: required key is missing"]
    elif value == {} and key == "realisations":  # a mapping has the numbers of each case
        assert lines == ["config: realisations: must hold at least 1, got {}"]
    elif key == "include":
        assert line in lines
    else:
        assert lines == [line]


REQUIRED = [
    "radar",
    "radar.wavelength_m",
    "radar.sigma_range_m",
    "radar.sigma_velocity_mps",
    "radar.scan_period_s",
    "target",
    "target.kind",
    "target.coefficients",
    "filters",
    "filters.0.name",
    "filters.1.observes",
    "filters.0.manoeuvre_variance",
    "realisations",
]
RADAR = (
    "name, band, wavelength_m, sigma_range_m, sigma_velocity_mps, scan_period_s, repetition_rate_hz, "
    "detection_probability, bias_range_m, bias_velocity_mps, sigma_bias_range_m, sigma_bias_velocity_mps"
)
FILTER = "name, kind, observes, initial_scans, manoeuvre_variance, process_noise"
TOP = "radar, target, filters, baseline, scans, duration_s, "
TOP += "name, like, study, include, sweep, realisations, seed, figures, runs, scenarios"
UNKNOWN = [
    ("radar.sigma_rnge_m", f"unknown key; did you mean sigma_range_m? allowed: {RADAR}"),
    ("filters.0.manoeuver_variance", f"unknown key; did you mean manoeuvre_variance? allowed: {FILTER}"),
    ("target.coeficients", "unknown key; did you mean coefficients? allowed: kind, coefficients"),
    ("scan", f"unknown key; did you mean scans? allowed: {TOP}"),
    ("realizations", f"unknown key; did you mean realisations? allowed: {TOP}"),
    ("radar.\n\x1b[2J", f"unknown key; allowed: {RADAR}"),
]


@pytest.mark.parametrize("key", REQUIRED)
def test_required_key(good, said, key):
    *outer, last = (int(step) if step.isdigit() else step for step in key.split("."))
    holder = good
    for step in outer:
        holder = holder[step]
    del holder[last]
    assert said(good) == [f"config: {key}: required key is missing"]


@pytest.mark.parametrize(("key", "message"), UNKNOWN)
def test_unknown_key(good, said, key, message):
    shown = key.encode("unicode_escape").decode()
    assert said(spoil(good, key, 1)) == [f"config: {shown}: {message}"]


def test_the_contracts_example(house, said):
    from radarsim.config.find_files import SHIPPED

    text = (SHIPPED / "configs/rls2.yaml").read_text()
    house("configs/rls2.yaml", text.replace("sigma_range_m: 250", "sigma_range_m: -250"))
    assert said("configs/rls2.yaml") == ["configs/rls2.yaml:7:18: radar.sigma_range_m: must be > 0, got -250"]
    assert said("rls2") == ["configs/rls2.yaml:7:18: radar.sigma_range_m: must be > 0, got -250"]


@pytest.mark.parametrize(
    ("key", "value", "at", "limit"),
    [
        ("radar.sigma_velocity_mps", 1e9, "radar.sigma_velocity_mps", "6.25e-16, must be from 1e-12 to 1e12"),
        ("radar.sigma_velocity_mps", 1e-9, "radar.sigma_velocity_mps", "6.25e+20, must be from 1e-12 to 1e12"),
        ("filters.0.manoeuvre_variance", 1e12, "filters.0.manoeuvre_variance", "1.6e+13, must be from 1e-28 to 1e12"),
        ("radar.scan_period_s", 1e-4, "filters.0.manoeuvre_variance", "1.6e-32, must be from 1e-28 to 1e12"),
        ("radar.sigma_velocity_mps", 5e-5, "filters.1.manoeuvre_variance", "4e+12, must be <= 1e12"),
    ],
)
def test_what_double_precision_cannot_hold_is_refused(good, said, key, value, at, limit):
    good["filters"][1]["manoeuvre_variance"] = 1.0
    line, *others = said(spoil(good, key, value))
    assert all(other.startswith(("config: filters.", "config: target: ")) for other in others)
    assert line.startswith(f"config: {at}: out of proportion: ")
    assert f"², here {limit}, got " in line


@pytest.mark.filterwarnings("error")
def test_what_is_accepted_can_be_designed(good):
    from radarsim.studies import registry

    rng = random.Random(1)
    prepared = 0
    for _ in range(100):
        for key in ("sigma_range_m", "sigma_velocity_mps", "scan_period_s"):
            good["radar"][key] = 10 ** rng.uniform(-3, 3)
        for one in good["filters"]:
            one["manoeuvre_variance"] = 10 ** rng.uniform(-9, 5)
        try:
            experiment = load(good)
        except ConfigError:
            continue
        registry.study("range_doppler").prepare(experiment.cases[0])
        prepared += 1
    assert prepared > 30


def test_at_most_sixteen_filters(good, said):
    good["filters"] = [{**good["filters"][0], "name": f"f{i}"} for i in range(16)]
    assert said(good) == []
    good["filters"].append({**good["filters"][0], "name": "one more"})
    (line,) = said(good)
    assert line.startswith("config: filters: must hold at most 16, got [{name: 'f0'")


def test_whole_numbers_in_every_notation(good):
    good.update(scans=1.5e1, realisations=1e5, seed=1e3)
    case = load(good).cases[0]
    assert (case.spec.scans, case.realisations, case.seed) == (15, 100_000, 1000)
    assert all(type(n) is int for n in (case.spec.scans, case.realisations, case.seed))


def test_defaults(good):
    case = load(good).cases[0]
    assert case.seed == 1
    assert case.spec.radar.repetition_rate_hz == 1000.0
    assert [f.initial_scans for f in case.spec.filters] == [3, 2]
    assert case.spec.baseline is None


def test_longest_and_shortest(good):
    good["filters"][0]["initial_scans"] = 7
    good["scans"] = 7
    assert load(good).cases[0].spec.filters[0].initial_scans == 7
    good["scans"] = 100_000
    assert load(good).cases[0].spec.scans == 100_000


# ---- the world beyond the paper -------------------------------------------------------------------------------------

FLY_BY = {"kind": "fly_by", "distance_m": 15e3, "speed_mps": 300, "start_range_m": 40e3}
BEST = {"minimise": "sigma_r", "over": "worst"}
BEYOND = [
    ({"radar.detection_probability": 0}, "radar.detection_probability: must be > 0, got 0"),
    ({"radar.detection_probability": 1.1}, "radar.detection_probability: must be <= 1, got 1.1"),
    ({"radar.bias_range_m": "x"}, f"radar.bias_range_m: {NUMBER}, got 'x'"),
    ({"radar.sigma_bias_velocity_mps": -1}, "radar.sigma_bias_velocity_mps: must be >= 0, got -1"),
    ({"radar.band": "X"}, "radar.band: X is 0.025 to 0.0375 m, not 0.15, got 'X'"),
    ({"target": FLY_BY | {"distance_m": 10}}, "target.distance_m: must be >= 100, got 10"),
    ({"target": FLY_BY | {"start_range_m": 1e4}}, "target.start_range_m: must be >= distance_m, 15000, got 10000"),
    ({"target": FLY_BY | {"speed_mps": 2e4}}, "target.speed_mps: must be <= 12000, got 20000"),
    ({"target": {"kind": "recorded", "file": "none.csv"}}, "target.file: no such file: 'none.csv'"),
    ({"filters.0.process_noise": "jerk"}, "must be one of random_jerk, white_jerk, white_acceleration, got 'jerk'"),
    (
        {"filters.0.manoeuvre_variance": BEST | {"over": "most"}},
        "over: must be one of worst, mean, last, at, got 'most'",
    ),
    (
        {"filters.0.manoeuvre_variance": {"minimise": "sigma_r"}},
        "over: required key is missing: worst, mean, last or at",
    ),
    (
        {"filters.0.manoeuvre_variance": BEST | {"minimise": "worst sigma r"}},
        "over: stands in minimise already: 'worst sigma r', got 'worst'",
    ),
    (
        {"filters.0.manoeuvre_variance": {"minimise": "worst gain r"}},
        "minimise: must be an error, such as 'sigma r at the end': the less, the more gain, got 'worst gain r'",
    ),
    (
        {"filters.0.manoeuvre_variance": {"minimise": "sigma r in the long run"}},
        "minimise: must be worst, mean or at a time: in the long run, without a manoeuvre, 0 is best, got",
    ),
    (
        {"filters.0.manoeuvre_variance": {"minimise": "sigma r at 63 s"}},
        "minimise: must be at the time of a scan, a multiple of 10 s, got",
    ),
    (
        {"filters.0.manoeuvre_variance": {"minimise": "worst sigma r from 1e3 s"}},
        "minimise: must be from 0 to 140 s, the last scan's time, got",
    ),
    (
        {"filters.0.manoeuvre_variance": {"minimise": "sigma r at k 16"}},
        "minimise: must be at a scan up to 15, the last, got",
    ),
    (
        {"filters.0.manoeuvre_variance": {"minimise": "sigma r at k 6", "from_k": 3}},
        "from_k: stands in minimise already: 'sigma r at k 6', got",
    ),
    (
        {"filters.0.manoeuvre_variance": {"minimise": "sigma_r", "over": "at"}},
        "from_k: required key is missing: the scan at which the error is taken",
    ),
    ({"filters.0.manoeuvre_variance": BEST | {"from_k": 16}}, "from_k: must be <= the number of scans, 15, got 16"),
    ({"duration_s": 140}, "duration_s: stands in place of scans: give one of them, got 140"),
    ({"scans": None, "duration_s": 5}, "duration_s: must be 2 to 100000 scans of radar.scan_period_s, makes 1, got 5"),
    ({"scans": None, "duration_s": 15}, "must be >= 3 scans of radar.scan_period_s for the initialisation of filter r"),
    ({"scans": None, "duration_s": 0}, "duration_s: must be > 0, got 0"),
]


@pytest.mark.parametrize(("changes", "message"), BEYOND, ids=lambda v: repr(v)[:50])
def test_bad_value_of_a_new_key(good, said, changes, message):
    for key, value in changes.items():
        if value is None:
            del good[key]
        else:
            spoil(good, key, value)
    lines = said(good)
    assert any(message in line for line in lines), lines


@pytest.mark.parametrize(
    ("phrase", "keys"),
    [
        ("worst sigma r", {"minimise": "sigma_r", "over": "worst"}),
        ("mean sigma Vr", {"minimise": "sigma_Vr", "over": "mean"}),
        ("sigma ar at the end", {"minimise": "sigma_ar", "over": "last"}),
    ],
)
def test_minimise_takes_the_phrase_of_the_commands_for_the_same_case(good, phrase, keys):
    specs = []
    for best in ({"minimise": phrase, "from_k": 5}, keys | {"from_k": 5}):
        good["filters"][0]["manoeuvre_variance"] = best
        specs.append(load(good).cases[0].spec)
    assert specs[0] == specs[1]


@pytest.mark.parametrize(
    ("phrase", "keys"),
    [
        ("sigma r at 60 s", {"over": "at", "from_k": 7}),
        ("sigma r at k 7", {"over": "at", "from_k": 7}),
        ("mean sigma r from 60 s", {"over": "mean", "from_k": 7}),
        ("worst sigma r from 61 s on", {"over": "worst", "from_k": 8}),
    ],
)
def test_minimise_takes_a_time_for_the_scan_that_it_names(good, phrase, keys):
    specs = []
    for best in ({"minimise": phrase}, {"minimise": "sigma_r"} | keys):
        good["filters"][0]["manoeuvre_variance"] = best
        specs.append(load(good).cases[0].spec)
    assert specs[0] == specs[1]


def test_letter_bands(good):
    good["radar"] |= {"band": "S", "wavelength_m": 0.1}
    assert load(good).cases[0].spec.radar.band == "S"


def test_either_scans_or_a_duration(good, said):
    del good["scans"]
    assert said(good) == ["config: scans: required key is missing, or duration_s in its place"]
    good["duration_s"] = 100
    assert load(good).cases[0].spec.scans == 11
    assert load(good, ["radar.scan_period_s=3"]).cases[0].spec.scans == 34
    assert load(good, ["scans=20"]).cases[0].spec.scans == 20  # the one that is set stands for both
    assert load("rls2", ["duration_s=70"]).cases[0].spec.scans == 8
    periods = load({**good, "sweep": {"radar.scan_period_s": [4, 5, 10]}}).cases
    assert [case.spec.scans for case in periods] == [26, 21, 11]


def test_a_duration_is_the_scans_that_it_makes(good):
    from radarsim.config.identity import all_keys, identity_keys

    given = load(good).cases[0].spec
    del good["scans"]
    made = load(good | {"duration_s": 140}).cases[0].spec
    assert identity_keys(made) == identity_keys(given)
    assert all_keys(made) == all_keys(given)
