"""Words for files of other programs, for filters without rows, for names of configs."""

import pytest

from radarsim.app import configs
from radarsim.errors import ConfigError
from tests.program import command
from tests.recorded.test_plots import faults

COLUMNS = "plots.csv:1: must have the columns t_s, range_m, bearing_rad or t_s, x_m, y_m; got "


@pytest.mark.parametrize(("sign", "shown", "words"), [(";", ";", "semicolons"), ("\t", "�", "tabulators")])
def test_other_separators_are_told(tmp_path, sign, shown, words):
    (line,) = faults(tmp_path, f"t_s{sign}x_m{sign}y_m\n0{sign}1{sign}2\n")
    hint = f" (commas must stand between cells, not {words}, and a point in numbers)"
    assert line == f"{COLUMNS}t_s{shown}x_m{shown}y_m{hint}"


def test_a_decimal_comma_is_told(tmp_path):
    lines = faults(tmp_path, 't_s,x_m,y_m\n0,"1,5",2\n1,"a,5",2\n')
    assert lines == [
        "plots.csv:2:2: x_m: must be a finite number, got '1,5' (a decimal point, not a comma)",
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
    assert configs.new("mine.yaml", "rls2", tmp_path) == tmp_path / "mine.yaml"


@pytest.mark.parametrize(("name", "shown"), [("-a", "-a"), ("=a", "=a"), ("a\nb", r"a\nb"), (".yaml", "")])
def test_what_a_name_may_begin_with_is_told_in_one_line(tmp_path, name, shown):
    with pytest.raises(ConfigError) as caught:
        configs.new(name, "rls2", tmp_path)
    (line,) = caught.value.lines
    assert line.startswith(f"{shown}: must be a plain name")
    assert line.endswith("that begins with a letter, a digit or _")
    assert "\n" not in line
    assert not list(tmp_path.iterdir())
