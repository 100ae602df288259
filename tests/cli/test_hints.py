"""Words for files of other programs, for filters without rows, for names of configs."""

import pytest

from radarsim.api.new_configs import write_new_config
from radarsim.errors import ConfigError
from tests.program import command
from tests.recordings import plot_files
from tests.recordings.test_plots import CHOICES, faults

COLUMNS = "plots.csv:1: must have the columns t_s, range_m, bearing_rad or t_s, x_m, y_m; got "


@pytest.mark.parametrize(("sign", "shown"), [(";", ";"), ("\t", "�")])
def test_a_raw_file_is_shown_the_way(tmp_path, sign, shown, monkeypatch):
    """And the command, as given, cures it."""
    text = f"Zeit{sign}range [km]{sign}azimuth [°]\n10:00:00{sign}20.5{sign}45\n10:00:04{sign}20.4{sign}45\n"
    (line,) = faults(tmp_path, text)
    given = f"Zeit{shown}range [km]{shown}azimuth [°]"
    command_given = "radarsim import plots.csv -o imported.csv"
    assert line == f"{COLUMNS}{given}; ranges and positions with other names, separators or units: {command_given}"
    monkeypatch.chdir(tmp_path)
    command(*command_given.split()[1:], "--column", "t_s=Zeit")
    assert list(plot_files.read(tmp_path / "imported.csv", CHOICES)["range_m"]) == [20500, 20400]


def test_a_decimal_comma_is_told(tmp_path):
    lines = faults(tmp_path, 't_s,x_m,y_m\n0,"1,5",2\n1,"a,5",2\n')
    assert lines == [
        "plots.csv:2:2: x_m: must be a finite number with a decimal point, not a comma, got '1,5'",
        "plots.csv:3:2: x_m: must be a finite number, got 'a,5'",
    ]


@pytest.mark.parametrize(("ranges", "silent"), [(("", "", "", ""), "no rows  r: no estimate from"), ("9876", None)])
def test_a_filter_without_a_row_is_named(tmp_path, ranges, silent):
    rows = "".join(f"{10 * k},{r},-250\n" for k, r in enumerate(ranges))
    (tmp_path / "plots.csv").write_text("t_s,range_m,velocity_mps\n" + rows)
    ended = command("track", "rls2", tmp_path / "plots.csv", "-o", tmp_path / "track.csv")
    assert (silent or "plots    4 rows") in ended.output
    assert ("no rows" in ended.output) == bool(silent)


def test_the_suffix_of_a_new_config_may_be_given(tmp_path):
    assert write_new_config("mine.yaml", "rls2", tmp_path) == tmp_path / "mine.yaml"


@pytest.mark.parametrize(("name", "shown"), [("-a", "-a"), ("=a", "=a"), ("a\nb", r"a\nb"), (".yaml", "")])
def test_what_a_name_may_begin_with_is_told_in_one_line(tmp_path, name, shown):
    with pytest.raises(ConfigError) as caught:
        write_new_config(name, "rls2", tmp_path)
    (line,) = caught.value.lines
    assert line.startswith(f"{shown}: must be a plain name")
    assert line.endswith("that begins with a letter, a digit or _")
    assert "\n" not in line
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("code", "meant", "nearest"),
    [
        ("en", "rsl2: no such config; did you mean rls2?", "nosuch: no such config; the nearest: "),
        ("ru", "rsl2: такой конфигурации нет; возможно, rls2?", "nosuch: такой конфигурации нет; ближайшие: "),
    ],
)
def test_an_unknown_config_is_answered_in_the_language_in_use(monkeypatch, code, meant, nearest):
    monkeypatch.setenv("RADARSIM_LANGUAGE", code)
    assert meant in command("check", "rsl2", code=2).output
    assert nearest in command("check", "nosuch", code=2).output


def test_a_list_shows_a_family_of_variants_in_one_line_unless_they_are_meant():
    shown = command("list", "P4").output
    assert "16 variants of discriminator: `radarsim list discriminator`" in shown
    assert "discriminator_tails" not in shown
    for words in (("discriminator",), ("configs",), ("P4", "tails")):
        assert "discriminator_tails" in command("list", *words).output
