"""Biases of a radar against positions: known ones are found, intervals hold them, and what cannot be known is said."""

import json
import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pymap3d
import pytest
from click.testing import CliRunner
from scipy.optimize import least_squares

import radarsim
from radarsim.cli.command_group import main
from radarsim.errors import ConfigError
from radarsim.recordings.aircraft_match import distance_text, interpolate_states
from radarsim.recordings.formats.import_options import Options, parse_biases
from radarsim.recordings.formats.import_recording import import_recording
from radarsim.recordings.formats.records import BIASES
from radarsim.recordings.formats.sites import Site, parse_sites
from radarsim.recordings.registration import bias_fit, register, sentences
from radarsim.recordings.registration.matched_plots import MatchedPlots
from radarsim.recordings.registration.robust_fit import BIWEIGHT_LIMIT, CONVERGENCE_STEP
from radarsim.report.statistics import Z95
from tests.recordings.formats.example_files import block, plot_048, position_021
from tests.tolerances import rounding, share_error, sigma_error

NONE = (0.0, 0.0, 0.0, 0.0)
SOME = (60.0, 4e-4, 0.003, 0.35)


@dataclass(frozen=True)
class Flight:
    """An aircraft at a height of 8 km: position at a time, speed and turn."""

    x: float
    z: float
    heading: float
    speed: float
    turn: float = 0.0

    def at(self, t):
        x, z = np.full(len(t), self.x), np.full(len(t), self.z)
        if self.turn:
            now, radius = self.heading + self.turn * t, self.speed / self.turn
            x, z = x + radius * (np.sin(now) - np.sin(self.heading)), z - radius * (np.cos(now) - np.cos(self.heading))
        else:
            x, z = x + self.speed * t * np.cos(self.heading), z + self.speed * t * np.sin(self.heading)
        return np.stack([x, np.full(len(t), 8000.0), z], axis=1)


def measured(flight, t, biases):
    """Range and bearing of plots that are stamped t."""
    bias, scale, turn, lag = biases
    place = flight.at(t - lag)
    return (1 + scale) * np.linalg.norm(place, axis=1) + bias, np.arctan2(place[:, 2], place[:, 0]) + turn


def flights(rng, count, within=120e3, turn=1e-3):
    draws = [(*rng.uniform(-within, within, 2), rng.uniform(0, 6.28), rng.uniform(120, 260)) for _ in range(count)]
    return [Flight(*draw, rng.normal(0, turn) if turn else 0.0) for draw in draws]


def pairs(rng, flown, biases, sigma=(0.0, 0.0), plots=60, own=0.0, outliers=0.0, other=0.0, missed=0.15):
    """Plots with errors, those of an aircraft in common of `own` σ; positions every 5 s with errors of `other` m."""
    rows, paths = [], []
    for number, flight in enumerate(flown):
        fixes = np.arange(-10.0, 4.0 * plots + 20, 5.0) + rng.uniform(0, 5)
        paths.append(
            interpolate_states(np.column_stack([fixes, flight.at(fixes) + rng.normal(0, other, (len(fixes), 3))]))
        )
        t = 4.0 * np.arange(plots) + rng.uniform(0, 4)
        t = t[rng.random(plots) >= missed]
        wrong = np.where(rng.random((2, len(t))) < outliers, 20.0, 1.0)
        errors = np.array(sigma)[:, None] * (rng.normal(0, wrong) + own * rng.normal(size=(2, 1)))
        r, b = measured(flight, t, biases) + errors
        rows.append(np.stack([t, r, b % (2 * np.pi), np.full(len(t), number)]))
    t, r, b, path = np.concatenate(rows, axis=1)
    return MatchedPlots(t, r, b, path.astype(int), lambda number, at: paths[number](at))


def predicted(flown, made, biases):
    """Range and bearing of the plots (2, n) that these biases make of the exact paths."""
    return np.concatenate(
        [measured(one, made.t_s[made.path_numbers == k], biases) for k, one in enumerate(flown)], axis=1
    )


def found(made):
    return {one.key: one for one in bias_fit.fit_biases(made).biases}


@pytest.mark.parametrize("biases", [SOME, (-400.0, -0.01, -0.05, -4.0), (0.0, 0.0, 0.2, 0.0), NONE])
def test_known_biases_without_noise(biases):
    rng = np.random.default_rng(1)
    made = pairs(rng, flown := flights(rng, 6, turn=0.0), biases)
    one = found(made)
    # Ranges and bearings are as good as the places that they are of; the inverse of their slopes makes biases of that.
    ends = [
        [predicted(flown, made, biases + sign * step) for sign in (-1, 1)] for step in np.diag([1.0, 1e-4, 1e-4, 0.1])
    ]
    slopes = np.stack([(high - low) / 2 for low, high in ends], axis=-1)
    rounded = rounding(made.range_m.max(), 20) / np.array([np.ones(len(made.t_s)), made.range_m])
    allowed = np.abs(np.linalg.pinv((slopes / rounded[..., None]).reshape(-1, 4))).sum(axis=1) * [1.0, 1e-4, 1e-4, 0.1]
    for key, wanted, near in zip(BIASES, biases, allowed, strict=True):
        assert one[key].identifiable
        assert one[key].value == pytest.approx(wanted, rel=0, abs=near)
        assert (one[key].lo == one[key].hi == 0) == (wanted == 0)


def test_an_independent_search_finds_the_same():
    """The sum of Tukey's function by SciPy, over the exact geometry."""
    rng = np.random.default_rng(2)
    flown = flights(rng, 8, turn=0.0)
    made = pairs(rng, flown, SOME, (50.0, 0.0015), outliers=0.05)
    ours = bias_fit.fit_biases(made)
    limit = BIWEIGHT_LIMIT**2

    def errors(scaled):
        biases = scaled * [100.0, 1e-3, 1e-3, 1.0]
        r, b = predicted(flown, made, biases)
        turned = (made.bearing_rad - b + np.pi) % (2 * np.pi) - np.pi
        return np.concatenate([(made.range_m - r) / ours.sigma[0], turned / ours.sigma[1]])

    def tukey(z):
        rest = np.where(z < limit, 1 - z / limit, 0.0)
        return np.stack([limit / 3 * (1 - rest**3), rest**2, -2 / limit * rest])

    theirs = least_squares(errors, np.zeros(4), loss=tukey, xtol=1e-15, ftol=1e-15, gtol=1e-12).x
    for one, value in zip(ours.biases, theirs * [100.0, 1e-3, 1e-3, 1.0], strict=True):
        # Steps end below so many standard errors; ten times that is left where each is 0.9 of the one before.
        assert abs(one.value - value) < 10 * CONVERGENCE_STEP * (one.hi - one.lo) / (2 * Z95)
    for sigma, own in zip(ours.sigma, errors(theirs).reshape(2, -1) * np.array(ours.sigma)[:, None], strict=True):
        # Of the outliers 16 % are within 4 σ, which adds 1.7 %; the biweight is as good as 90 % of the errors would be.
        inner = own[np.abs(own) < 4 * sigma]
        assert sigma == pytest.approx(np.std(inner), rel=0.017 + sigma_error(len(inner), z=3) * np.sqrt(1 / 0.9 - 1))
    spoilt = np.abs(errors(theirs).reshape(2, -1)).max(axis=0) >= BIWEIGHT_LIMIT
    assert ours.outliers == spoilt.sum()


WORLDS = {
    "even": ({"count": 10}, {}),
    "in common": ({"count": 12}, {"own": 0.7}),
    "few": ({"count": 5}, {"own": 0.4}),
    "outliers": ({"count": 10}, {"outliers": 0.15, "missed": 0.4}),
    "near": ({"count": 15, "within": 40e3, "turn": 3e-3}, {"sigma": (15.0, 0.004), "other": 15.0, "plots": 40}),
}


def covered(seed, runs, biases):
    """The share of intervals that hold the biases, by bias and world."""
    held = []
    for number, (sky, errors) in enumerate(WORLDS.values()):
        for run in range(runs):
            rng = np.random.default_rng((seed, number, run))
            made = pairs(rng, flights(rng, **sky), biases, **({"sigma": (50.0, 0.0015), "other": 8.0} | errors))
            held.append([one.lo <= true <= one.hi if one.identifiable else np.nan
                         for one, true in zip(bias_fit.fit_biases(made).biases, biases, strict=True)])  # fmt: skip
    return np.array(held).reshape(len(WORLDS), runs, len(BIASES))


@pytest.mark.slow_cases("biases1")
@pytest.mark.parametrize("biases", [SOME, NONE])
def test_intervals_hold_the_biases_of_some_pairs(biases):
    held = covered(3, 3, biases)
    assert np.isfinite(held).mean() > 0.9
    assert np.nanmean(held) > 0.85  # of 60: 0.95 less three and a half standard deviations of it


@pytest.mark.slow
@pytest.mark.parametrize("biases", [SOME, NONE])
def test_intervals_hold_the_biases(biases):
    """Of each bias in 1000 pairs: 95 % within three standard errors."""
    held = covered(4, 200, biases)
    share = np.nanmean(held, axis=(0, 1))
    assert np.isfinite(held).mean() > 0.9
    np.testing.assert_allclose(share, 0.95, rtol=0, atol=share_error(0.95, 1000, z=3))
    assert np.nanmean(held, axis=1).min() > 0.95 - share_error(0.95, 200, z=4)


RING = [Flight(x, z, h, 200.0) for x, z, h in ((9e4, 0, 1.6), (-9.2e4, 1e4, -1.6), (0, 9.1e4, 0.1), (0, -9e4, 3.1))]
INBOUND = [Flight(9e4 * math.cos(a), 9e4 * math.sin(a), a + math.pi, 200.0) for a in (0.1, 1.7, 3.3, 5.0)]
MOORED = [Flight(x, 2e4, 0.0, 0.0) for x in (1e4, 3e4, 6e4, 8e4)]
ORBIT = [Flight(r, 0.0, math.pi / 2, r * 4e-3, 4e-3) for r in (2e4, 3e4, 5e4, 6e4)]


@pytest.mark.parametrize(
    ("flown", "unknown", "why"),
    [
        (RING, "range_scale", "the ranges are alike (9"),
        (INBOUND, "time_s", "the radial speeds are alike (−199 to −197 m/s), so that it shows as range_m does"),
        (MOORED, "time_s", "the targets hardly move"),
        (ORBIT, "time_s", "the turns of bearing are alike (0.229 to 0.229 °/s), so that it shows as bearing_rad does"),
    ],
)
def test_what_cannot_be_told_is_named_with_the_reason(flown, unknown, why):
    rng = np.random.default_rng(5)
    one = found(pairs(rng, flown, (60.0, 0.0, 0.003, 0.0), (30.0, 0.001)))
    assert [key for key in BIASES if not one[key].identifiable] == [unknown]
    assert one[unknown].why.startswith(why)
    assert math.isnan(one[unknown].value)
    assert one["range_m"].lo < 60 < one["range_m"].hi
    assert one["bearing_rad"].lo < 0.003 < one["bearing_rad"].hi


def test_bearings_may_be_missing():
    rng = np.random.default_rng(8)
    made = pairs(rng, flights(rng, 8), SOME, (30.0, 0.001))
    one = found(made._replace(bearing_rad=np.full(len(made.t_s), np.nan)))
    assert one["bearing_rad"].why == "there are no bearings"
    for key, true in zip(BIASES, SOME, strict=True):
        assert key == "bearing_rad" or one[key].lo < true < one[key].hi


# ---- files -----------------------------------------------------------------------------------------------------------
SITE, ELSEWHERE = Site(52.3, 4.76, 12.0), Site(53.1, 5.9, 80.0)


def recordings(tmp_path, biases=SOME, late=None, of_day=False, count=8):
    """A radar's plots and positions of the same aircraft as others write them; late: one whose positions are."""
    rng = np.random.default_rng(7)
    plots, positions = [], []
    for number, flight in enumerate(flights(rng, count, within=80e3)):
        name, t = f"{0x4CA100 + number:06x}", 4.0 * np.arange(60) + rng.uniform(0, 4)
        r, b = measured(flight, t, biases) + np.array([[30.0], [0.001]]) * rng.normal(size=(2, 60))
        clock = [f"10:{int(s) // 60:02}:{s % 60:06.3f}" for s in t] if of_day else [f"{1.7e9 + s:.4f}" for s in t]
        plots += [(s, f"{c},{name},{x:.3f},{y % 6.28318530:.6f}") for s, c, x, y in zip(t, clock, r, b, strict=True)]
        t = np.arange(-20.0, 260, 4) + rng.uniform(0, 4)
        north, up, east = flight.at(t - (2.0 if number == late else 0.0)).T
        lat, lon, height = pymap3d.enu2geodetic(east, north, up, *SITE.coordinates)
        zero = 1.7e9 - 1.7e9 % 86400 + 36000 if of_day else 1.7e9
        cells = zip(t, lat, lon, height, strict=True)
        positions += [(s, f"{zero + s:.4f},{name},{x:.8f},{y:.8f},{h:.2f}") for s, x, y, h in cells]
    for file, header, rows in (
        ("radar", "time,icao24,range_m,bearing_rad", plots),
        ("adsb", "time,icao24,lat,lon,geoaltitude", positions),
    ):
        (tmp_path / file).write_text("\n".join([header, *(row for _, row in sorted(rows))]) + "\n")
    return tmp_path / "radar", tmp_path / "adsb"


def imported(tmp_path, files, sites=(SITE, SITE), biases=None):
    out = [tmp_path / f"{file.name}.csv" for file in files]
    for file, one, site, own in zip(files, out, sites, (biases or {}, {}), strict=True):
        import_recording(file, one, Options(site=site, biases=own))
    return [str(one) for one in out]


@pytest.mark.parametrize(("of_day", "sites"), [(False, (SITE, SITE)), (True, (SITE, SITE)), (False, (SITE, ELSEWHERE))])
def test_two_recordings(tmp_path, of_day, sites):
    """Positions from 1970 or times of day, seen from the radar or from elsewhere; the correction leaves nothing."""
    files = recordings(tmp_path, of_day=of_day)
    one = register.register_radar(*imported(tmp_path, files, sites))
    assert (one.plots, one.matched, one.counts_by_kind) == (480, 480, {"address": 480})
    for bias, true in zip(one.adjustment.biases, SOME, strict=True):
        assert bias.lo < true < bias.hi
        assert bias.hi - bias.lo < 1.2 * (abs(true) + (bias.key == "range_scale") * 1e-3)
    command = next(
        line for line in sentences.registration_lines(one) if line.startswith("to correct: `radarsim import … --bias ")
    )
    options = command.rstrip("`").split(" --bias ")[1:]
    assert options == [*(f"{key}={value:.4g}" for key, value in (
        ("range_m", one.adjustment.biases[0].value),
        ("range_scale", one.adjustment.biases[1].value),
        ("bearing_deg", math.degrees(one.adjustment.biases[2].value)),
        ("time_s", one.adjustment.biases[3].value),
    ))]  # fmt: skip
    again = register.register_radar(*imported(tmp_path, files, sites, parse_biases(options)))
    for bias, before in zip(again.adjustment.biases, one.adjustment.biases, strict=True):
        assert abs(bias.value) < 0.5e-3 * abs(before.value)  # four digits are in the option
    assert sentences.registration_lines(again)[-1] == "no bias differs from 0"


def test_an_aircraft_whose_own_clock_is_wrong_is_named(tmp_path):
    one = register.register_radar(*imported(tmp_path, recordings(tmp_path, late=3)))
    (line,) = [line for line in sentences.registration_lines(one) if "alone" in line]
    assert line.startswith("4ca103 alone is −2")
    assert one.adjustment.biases[3].lo < SOME[3] < one.adjustment.biases[3].hi


def test_the_command_and_python_say_the_same(tmp_path):
    radar, other = imported(tmp_path, recordings(tmp_path))
    document = json.loads(CliRunner().invoke(main, ["register", radar, other, "--json"]).stdout)
    one = radarsim.register(radar, other)
    assert [row["value"] for row in document["biases"]] == one.biases["value"].tolist()
    assert document["sigma_range_m"] == one.sigma_range_m == pytest.approx(30, rel=sigma_error(480, z=3))
    assert [row["time_s"] for row in document["aircraft"]] == one.aircraft["time_s"].tolist()
    assert document["findings"] == document["coefficients"] == []
    assert document["sigma_of_steps"] == pytest.approx([30, 1e-3], rel=4 * sigma_error(480, z=1))
    said = CliRunner().invoke(main, ["register", radar, other]).stdout
    assert f"480 of 480 plots have a position of their aircraft in {other} (by address 480)" in said
    assert "8 aircraft" in said
    assert str(one).splitlines()[0] in said


def test_few_aircraft_say_what_their_intervals_lack(tmp_path):
    one = register.register_radar(*imported(tmp_path, recordings(tmp_path, count=2)))
    assert one.adjustment.clusters == 20
    assert any(
        line.startswith("errors common to a whole flight are not in the intervals")
        for line in sentences.registration_lines(one)
    )


def test_recordings_that_do_not_belong_together(tmp_path):
    radar, adsb = recordings(tmp_path)
    plots, positions = imported(tmp_path, (radar, adsb))
    others = tmp_path / "others"
    others.write_text(adsb.read_text().replace("4ca1", "3c64"))
    shifted = tmp_path / "shifted"
    shifted.write_text(radar.read_text().replace("17000", "17007"))  # by 70 000 s
    undated = tmp_path / "undated.csv"
    undated.write_text("t_s,track,range_m,bearing_rad\n1,4ca100,30000,1\n")
    for file, site, expected in (
        (others, SITE, "0 of 480 plots have a position of their aircraft in"),
        (adsb, Site(55.3, 4.76, 0.0), "its place"),
    ):
        import_recording(file, tmp_path / "wrong.csv", Options(site=site))
        if site is SITE:
            with pytest.raises(ConfigError, match=expected):
                register.register_radar(plots, str(tmp_path / "wrong.csv"))
    import_recording(shifted, tmp_path / "late.csv", Options(site=SITE))
    with pytest.raises(ConfigError, match="needs 20"):
        register.register_radar(str(tmp_path / "late.csv"), positions)
    with pytest.raises(
        ConfigError, match=r"t_s counts from the start of its clock, in .* from 1970: both must be dated"
    ):
        register.register_radar(str(undated), positions)
    with pytest.raises(ConfigError, match="must have the columns t_s, x_m, y_m, z_m"):
        register.register_radar(plots, str(undated))
    text = Path(positions).read_text()
    for k, (was, spoilt) in enumerate(
        ((r"84\): \S+", "84): north"), (r"84\): \S+", "84): 95"), (r"\S+ s after", "(nan s after"))
    ):
        spoiled = re.sub(was, spoilt, text, count=1)
        assert spoiled != text
        (wrong := tmp_path / f"wrong{k}.csv").write_text(spoiled)
        with pytest.raises(ConfigError, match=r"must be as radarsim import writes it, with finite numbers; got '# "):
            register.register_radar(plots, str(wrong))
    lines = Path(plots).read_text().splitlines(keepends=True)
    few = tmp_path / "few.csv"
    few.write_text("".join(lines[: [line[0] for line in lines].index("0") + 1]))
    with pytest.raises(ConfigError, match=r"1 of 1 plots have .* needs 20$"):
        register.register_radar(str(few), positions)


def test_ranges_alone_have_a_distance_in_range_alone():
    assert distance_text(98.94, math.nan) == "98.9 m"
    assert distance_text(98.94, 0.123) == "98.9 m and 0.12°"


@pytest.mark.parametrize("wrong", [None, 5, [], b"plots.csv"])
def test_python_takes_files_and_tables_alone(wrong):
    for call in (lambda: radarsim.register(wrong, "positions.csv"), lambda: radarsim.fit("rls2", wrong)):
        with pytest.raises(ConfigError, match=r"recorded: must be the path of a file or a table \(pandas\), got"):
            call()
    with pytest.raises(
        ConfigError, match=r"path: must be the path of a file, as str or Path, got (None|5|\[\]|b'plots.csv')"
    ):
        radarsim.read_plots(wrong)


@pytest.mark.parametrize("wrong", ["outliers", ["x"], [None], 5, True])
def test_a_fit_allows_for_what_it_knows(wrong):
    with pytest.raises(ConfigError, match="allowing: must be a list of outliers, correlation, got"):
        radarsim.fit("rls2", "plots.csv", allowing=wrong)


def test_no_range_that_is_not_above_zero_is_written(tmp_path):
    table, out = tmp_path / "table.csv", tmp_path / "plots.csv"
    table.write_text("time_s,track,range_m,bearing_deg\n0,1,90,20\n4,1,100,20\n8,1,110,20\n")
    assert import_recording(table, out, Options()).rows == 3
    done = import_recording(table, out, Options(biases={"range_m": 100.0}))
    assert [line.split(",")[2] for line in out.read_text().splitlines() if line[0].isdigit()] == ["10.0"]
    assert done.skipped == ["plots whose range is not above 0 (2)"]


def test_a_radar_has_one_place():
    with pytest.raises(ConfigError, match=r"of each radar, once; got 1/2=52,4,0 1/2=53,4,0"):
        parse_sites(["1/2=52,4,0", "1/2=53,4,0"])


@pytest.mark.parametrize(
    "text",
    [
        "range=1",
        "range_m",
        "range_m=x",
        "range_m=nan",
        "range_scale=-1",
        "range_m=1,2",
        "time_s=1e308",
        "bearing_deg=181",
    ],
)
def test_a_bias_that_cannot_be_is_refused(text):
    with pytest.raises(
        ConfigError, match=r"bias: must be range_m=NUMBER, .*, each once; their size is .* at most; got"
    ):
        parse_biases([text])
    with pytest.raises(ConfigError, match="each once"):
        parse_biases(["bearing_deg=1", "bearing_rad=1"])


def test_positions_have_no_bias_of_a_radar(tmp_path):
    _, adsb = recordings(tmp_path, count=1)
    with pytest.raises(ConfigError, match="bias: is subtracted from plots of a radar"):
        import_recording(adsb, tmp_path / "out.csv", Options(site=SITE, biases={"range_m": 1.0}))
    assert not (tmp_path / "out.csv").exists()


def test_a_radar_that_knows_codes_alone(tmp_path):
    """Category 048 with Mode 3/A against 021 with address and code; a code used twice; a field monitor with a code."""
    pytest.importorskip("asterix.base", reason="libasterix is not installed")
    rng, plots, positions = np.random.default_rng(9), [], []
    flown = flights(rng, 7, within=80e3)
    for number, flight in enumerate([*flown, Flight(-flown[0].x, -flown[0].z, 1.0, 200.0)]):
        code, t = 0o2101 + number % 7, 36000 + 4.0 * np.arange(60) + rng.uniform(0, 4)
        r, b = measured(flight, t - 36000, SOME) + np.array([[30.0], [0.001]]) * rng.normal(size=(2, 60))
        rho, theta = np.round(r / 1852 * 256).astype(int), np.round(b % (2 * np.pi) / (2 * np.pi) * 65536).astype(int)
        cells = zip(t.tolist(), rho.tolist(), (theta % 65536).tolist(), strict=True)
        plots += [(s, plot_048(s, x, y, code=code)) for s, x, y in cells]
        monitor = zip(t.tolist()[::20], rho.tolist()[::20], (theta % 65536).tolist()[::20], strict=True)
        plots += [(s + 1, plot_048(s + 1, x + 200, y, code=code, kind=b"\x22")) for s, x, y in monitor]
        north, up, east = flight.at(t - 36000 - 1.0).T
        places = zip((t - 1).tolist(), *pymap3d.enu2geodetic(east, north, up, *SITE.coordinates), strict=True)
        more = {"address": 0xA1 + number, "code": code}
        positions += [(s, position_021(s, x, y, height_ft=h / 0.3048, **more)) for s, x, y, h in places]
    files = tmp_path / "radar", tmp_path / "adsb"
    for file, category, records in ((files[0], 48, plots), (files[1], 21, positions)):
        ordered = sorted(records, key=lambda one: one[0])
        file.write_bytes(b"".join(block(category, one) for _, one in ordered))
    one = register.register_radar(*imported(tmp_path, files))
    assert one.counts_by_kind == {"mode_3a": one.matched}
    assert one.plots == 480
    assert 440 < one.matched <= 480
    assert len(one.aircraft) == 8
    for bias, true in zip(one.adjustment.biases, SOME, strict=True):
        assert bias.lo < true < bias.hi


def test_tables_are_matched_by_what_identifies_their_rows(tmp_path):
    """Flights are numbered in one file and named in the other; two lone tracks without a name are not the same."""
    radar, adsb = recordings(tmp_path)
    names = {f"{0x4CA100 + n:06x}": f"KLM{n}" for n in range(8)}
    plots = [line.split(",") for line in radar.read_text().splitlines()[1:]]
    rows = [",".join([t, str(int(name, 16) % 100), names[name], *rest]) for t, name, *rest in plots]
    radar.write_text("\n".join(["time,id,callsign,range_m,bearing_rad", *rows]))
    fixes = [line.split(",") for line in adsb.read_text().splitlines()[1:]]
    rows = [",".join([t, name, names[name].lower() + " ", *rest]) for t, name, *rest in fixes]
    adsb.write_text("\n".join(["time,icao24,callsign,lat,lon,geoaltitude", *rows]))
    assert register.register_radar(*imported(tmp_path, (radar, adsb))).counts_by_kind == {"callsign": 480}
    lone = [[row for row in table if row[1] == "4ca100"] for table in (plots, fixes)]
    for file, header, table in ((radar, "range_m,bearing_rad", lone[0]), (adsb, "lat,lon,geoaltitude", lone[1])):
        file.write_text("\n".join([f"time,{header}", *(",".join([t, *rest]) for t, _, *rest in table)]))
    with pytest.raises(ConfigError, match="0 of 60 plots have a position of their aircraft"):
        register.register_radar(*imported(tmp_path, (radar, adsb)))
    plots, positions = imported(tmp_path, (radar, adsb))
    assert register.register_radar(plots, f"1={positions}").counts_by_kind == {"address": 60}


def test_an_aircraft_that_is_another_is_left_out_and_named(tmp_path):
    """Two plots' aircraft have swapped addresses: their plots lie far from the positions of these."""
    radar, adsb = recordings(tmp_path)
    text = radar.read_text()
    radar.write_text(text.replace("4ca101", "x").replace("4ca106", "4ca101").replace("x", "4ca106"))
    one = register.register_radar(*imported(tmp_path, (radar, adsb)))
    assert one.matched == 360
    assert sorted(line.split(",")[0] for line in one.left_out) == ["the plots of 4ca101", "the plots of 4ca106"]
    for bias, true in zip(one.adjustment.biases, SOME, strict=True):
        assert bias.lo < true < bias.hi
