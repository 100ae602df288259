"""Claims of a user: on a table that radarsim did not make, and on the stored run of a shipped config."""

import json
import math

import numpy as np
import pandas as pd
import pytest

import radarsim
from radarsim.errors import ConfigError
from radarsim.papers.claim_rows import measured_words
from radarsim.report import wording
from tests.program import command

HEAD = "paper: mine\nclaims:\n"
CLAIM = """- {id: ID, place: table 1, statement: It holds, parts: [
    {of: OF, what: number, measure: MEASURE, expected: EXPECTED}]}
"""


def claims(*parts):
    """A text of claims: for each the rows, the measure and the range."""
    texts = [
        CLAIM.replace("ID", str(i)).replace("OF", of).replace("MEASURE", measure).replace("EXPECTED", expected)
        for i, (of, measure, expected) in enumerate(parts, 1)
    ]
    return HEAD + "".join(texts)


def judged(table, *parts):
    """The rows of the verdicts."""
    return radarsim.claims.judge(claims(*parts), table).table.to_dict("records")


TABLE = {
    "filter": ["ekf", "ukf", "pf"],
    "order": [1, 2, 3],
    "mean": [0.3806, 0.3108, 0.42],
    "mean_lo": [0.3787, 0.3091, 0.41],
    "mean_hi": [0.3825, 0.3125, 0.43],
    "error": [0.01, 0.02, 0.03],
    "n": [20000, 20000, 500],
    "half": [0.2, 0.2, 0.2],
    "half_lo": [0.1, 0.1, 0.1],
}
BAD_TABLE = {"x": [1.0], "x_lo": [1.2], "x_hi": [0.8], "y": [1.0], "y_se": [-0.1], "z": [1.0], "z_se": [math.nan]}


def test_a_number_of_a_row_is_judged_with_its_interval(tmp_path):
    parts = (
        ("[{filter: ekf}]", "{value: {column: mean}}", '{printed: "0.374"}'),
        ("[{filter: ekf}]", "{value: {column: mean}}", '{printed: "0.374", runs: 100, variance: 0.015}'),
        ("[{order: 2.0}]", "{value: {column: mean, se: error}}", "{about: '0.31'}"),
        ("[{filter: pf}]", "{value: {column: order}}", "{within: [3, 3]}"),
    )
    rows = judged(TABLE, *parts)
    assert [row["verdict"] for row in rows] == ["refuted", "confirmed", "not yet decided", "confirmed"]
    assert [(row["measured"], row["lo"], row["hi"]) for row in rows[:2]] == [(0.3806, 0.3787, 0.3825)] * 2
    assert rows[2]["hi"] - rows[2]["measured"] == pytest.approx(1.959964 * 0.02)
    assert (rows[1]["margin_kind"], rows[1]["n"], rows[2]["needed"] > 20000) == ("sample", 20000, True)
    file = tmp_path / "mine.csv"
    pd.DataFrame(TABLE).to_csv(file, index=False)
    spreadsheet = tmp_path / "spreadsheet.csv"
    spreadsheet.write_bytes(b"\xef\xbb\xbf" + file.read_bytes().replace(b"\n", b"\r\n") + b"\r\n")
    for same in (file, str(file), spreadsheet, pd.DataFrame(TABLE), pd.DataFrame(TABLE).set_index("filter")):
        pd.testing.assert_frame_equal(pd.DataFrame(judged(same, *parts)), pd.DataFrame(rows))


@pytest.mark.parametrize("names", [("rmse_m_se",), ("rmse_se",), ("rmse_lo", "rmse_hi"), ("rmse_m_lo", "rmse_m_hi")])
def test_a_column_with_a_unit_has_its_interval_with_or_without_it(names):
    table = {"filter": ["ekf"], "rmse_m": [1.0]} | dict(zip(names, ([0.9], [1.1]), strict=False))
    (row,) = judged(table, ("[{filter: ekf}]", "{value: {column: rmse_m}}", '{printed: "1.0"}'))
    assert row["lo"] < 1 < row["hi"]


def test_ratio_and_difference_are_of_independent_rows():
    rows = judged(
        TABLE,
        ("[{filter: ukf}, {filter: ekf}]", "{ratio: {column: mean}}", "{less: []}"),
        ("[{filter: pf}, {filter: ekf}]", "{difference: {column: mean}}", "{above: 0}"),
        ("[{filter: pf}, {filter: ekf}]", "{difference: {column: order}}", "{within: [2, 2]}"),
    )
    half = math.hypot(0.0017 / 0.3108, 0.0019 / 0.3806) * 0.3108 / 0.3806
    assert rows[0]["hi"] - rows[0]["measured"] == pytest.approx(half, rel=0.01)
    assert rows[1]["lo"] == pytest.approx(0.0394 - math.hypot(0.01, 0.0019))
    assert [row["verdict"] for row in rows] == ["confirmed", "no material difference", "confirmed"]


def test_statistics_of_rows_that_are_runs():
    rng = np.random.default_rng(2)
    runs = {"filter": np.repeat(["a", "b"], 400), "rmse": np.r_[rng.gamma(4, 1, 400), rng.gamma(4, 2, 400)]}
    of = "[{filter: b}]"
    rows = judged(
        runs, *((of, f"{{{name}: {{column: rmse}}}}", "{above: 1}") for name in ("mean", "median", "variance", "rms"))
    )
    b = runs["rmse"][400:]
    wanted = [b.mean(), np.median(b), b.var(ddof=1), np.sqrt(np.mean(b**2))]
    np.testing.assert_allclose([row["measured"] for row in rows], wanted, rtol=1e-9)
    assert all(row["lo"] < row["measured"] < row["hi"] and row["n"] == 400 for row in rows)


@pytest.mark.parametrize(
    ("of", "measure", "said"),
    [
        ("[{filter: kf}]", "{value: {column: mean}}", "value: of: no row has filter 'kf'; there are ekf, ukf and pf"),
        ("[{fitler: ekf}]", "{value: {column: mean}}", "value: of: no column 'fitler'; there are filter, order, mean"),
        ("[{filter: ekf}]", "{value: {column: men}}", "value: no column 'men'; there are filter, order, mean"),
        ("[{}]", "{value: {column: mean}}", "value: of: 3 rows have {}: name one; mean takes all of them"),
        ("[{filter: ekf}]", "{value: {column: filter}}", "value: column 'filter' has cells that are no numbers"),
        ("[{filter: ekf}]", "{value: {column: mean, lo: mean_lo}}", "value: takes lo and hi, or se alone"),
        ("[{filter: ekf}]", "{value: {column: half}}", "value: column 'half_lo' is one end of an interval"),
        ("[ekf]", "{value: {column: mean}}", "value: of: must name cells, {COLUMN: VALUE}, got 'ekf'"),
    ],
)
def test_a_mistake_is_a_reason_with_its_line(of, measure, said):
    (row,) = judged(TABLE, (of, measure, "{above: 0}"))
    assert row["verdict"] == "not judged here"
    assert row["reason"].startswith("its measure fails: claims:4:")
    assert said in row["reason"]


@pytest.mark.parametrize(
    ("column", "said"),
    [
        ("x", "value: x 1 is not between x_lo 1.2 and x_hi 0.8"),
        ("y", "value: y_se must be a standard error >= 0, got -0.1"),
        ("z", "value: z_se must be a standard error >= 0, got nan"),
    ],
)
def test_an_interval_that_is_none_is_not_judged(column, said):
    (row,) = judged(BAD_TABLE, ("[{}]", f"{{value: {{column: {column}}}}}", "{above: 0}"))
    assert row["verdict"] == "not judged here"
    assert said in row["reason"]


@pytest.mark.parametrize("number", [math.nan, math.inf])
def test_a_measure_without_a_number_is_not_judged(number):
    (row,) = judged({"a": [number]}, ("[{}]", "{value: {column: a}}", "{above: 0}"))
    assert (row["class"], row["reason"]) == ("not judged here", "its measure gives no number")


def test_measures_of_the_users_own_lie_beside_the_file(tmp_path, monkeypatch):
    (tmp_path / "mine.yaml").write_text(claims(("[{}]", "{half: {column: n}}", "{below: 1e4}")))
    (tmp_path / "mine.py").write_text(
        "def half(evidence, rows, column):\n    return evidence.numbers(rows, column).mean() / 2\n"
    )
    (row,) = radarsim.claims.judge(tmp_path / "mine.yaml", TABLE).table.to_dict("records")
    assert (row["measured"], row["verdict"]) == (6750, "confirmed")
    monkeypatch.setenv("RADARSIM_NO_CODE", "1")
    with pytest.raises(ConfigError, match="is code of yours, and --no-code runs none"):
        radarsim.claims.judge(tmp_path / "mine.yaml", TABLE)
    monkeypatch.delenv("RADARSIM_NO_CODE")
    (tmp_path / "mine.py").write_text("1 / 0\n")
    with pytest.raises(ConfigError, match=r"mine.py: cannot be imported: ZeroDivisionError: .* \(.*mine.py:1\)"):
        radarsim.claims.judge(tmp_path / "mine.yaml", TABLE)


def test_claims_or_tables_that_cannot_be_read_are_named(tmp_path):
    text = claims(("[{}]", "{mean: {column: n}}", "{below: 1e4}"))
    with pytest.raises(ConfigError, match=r"nowhere\.yaml: cannot be read"):
        radarsim.claims.judge(tmp_path / "nowhere.yaml", TABLE)
    with pytest.raises(ConfigError, match=r"nowhere\.csv: cannot be read"):
        radarsim.claims.judge(text, tmp_path / "nowhere.csv")
    for content, said in (
        ("a,b\n1\n", "line 2 has 1 cells, and the first line 2"),
        ("a;b\n0,5;1\n", "its first line has another separator"),
        ("", "has no names of columns"),
    ):
        (tmp_path / "odd.csv").write_text(content)
        with pytest.raises(ConfigError, match=rf"odd\.csv: is no table in CSV with commas: {said}"):
            radarsim.claims.judge(text, tmp_path / "odd.csv")
    choices = "choices: [{key: a, asks: b, original: c, alternatives: [{name: d, kind: U, reason: e}]}]\n"
    with pytest.raises(ConfigError, match="choices: need runs of a study in a package"):
        radarsim.claims.judge(text + choices, TABLE)


def test_claims_on_the_stored_run_of_a_shipped_config(tmp_path):
    file = tmp_path / "mine.yaml"
    parts = (
        ("[{radar.scan_period_s: 10}]", "{gain: {filter: r+Vr, component: r}}", '{about: "20"}'),
        ("[{}]", "{run_rms: {filter: r+Vr, component: r, first: 3, last: 15}}", '{printed: "150.1", se: 1.5}'),
    )
    file.write_text(
        claims(*parts)
        + CLAIM.replace("{id: ID", "{id: 9, config: rls3")
        .replace("OF", "[{}]")
        .replace("MEASURE", "{limit: {filter: r, component: r}}")
        .replace("EXPECTED", "{above: 0}")
    )
    with pytest.raises(ConfigError, match="100,000 realisations are not stored"):
        radarsim.claims("rls2", also=file, out=tmp_path)
    radarsim.run("rls2", realisations=20_000, out=tmp_path, figures=False)
    listed = radarsim.claims("rls2", also=file, out=tmp_path)
    own = listed.table[listed.table["claim"].str.startswith("mine.")]
    assert own["verdict"].tolist() == ["confirmed"] * 2
    assert own["config"].tolist() == ["rls2"] * 2  # those of rls3 are not asked for
    assert own["exact"].notna().tolist() == [True, False]
    assert {"P1.18", "P1.28"} < set(listed.table["claim"])
    done = command("claims", "rls2", "--also", file, "--out", tmp_path, "--json")
    assert [row["claim"] for row in json.loads(done.stdout)][-2:] == ["mine.1", "mine.2"]
    words = command("claims", "rls2", "--also", file, "--out", tmp_path).stdout
    assert "mine.1 confirmed: It holds [mine, table 1; rls2]" in words
    assert "--also: needs a CONFIG" in command("claims", "--also", file, "--out", tmp_path, code=2).stderr
    file.write_text(
        HEAD
        + CLAIM.replace("{id: ID", "{id: 9, config: rls3")
        .replace("OF", "[{}]")
        .replace("MEASURE", "{gain: {filter: r+Vr, component: r}}")
        .replace("EXPECTED", "{above: 0}")
    )
    with pytest.raises(ConfigError, match="no claim is of rls2; there are claims of rls3"):
        radarsim.claims("rls2", also=file, out=tmp_path)


WELL = ("[{filter: ekf}]", "{value: {column: mean}}", '{printed: "0.374"}')


def fault(text, table=None):
    with pytest.raises(ConfigError) as caught:
        radarsim.claims.judge(text, TABLE if table is None else table)
    return str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("paper: mine", "paper: a.b", "claims:1:8: paper: must be of letters, digits, _ and -, got 'a.b'"),
        ("id: 1", "id: [1]", "claims:3:8: claims.0.id: must be a whole number, or letters and digits, as 3 or 3a, got"),
        ("id: 1", "id: true", "as 3 or 3a, got true"),
        ("id: 1", "id: 1.5", "as 3 or 3a, got 1.5"),
        ("statement: It holds", "statement: ''", "claims.0.statement: must not be empty"),
        ("what: number", "what: ''", "claims.0.parts.0.what: must not be empty"),
        ("what: number", "what: $zzz", "$zzz is not given under names or each; allowed: none"),
        ("what: number", 'what: n, unit: "m\\n"', "unit: must be printable text on one line"),
        ("what: number", "what: n, each: {a: []}", "claims.0.parts.0.each: makes 0 parts; allowed: 1 to 10,000"),
        (
            "what: number",
            "what: n, each: {" + ", ".join(f"{key}: [1,2,3,4,5,6,7,8,9,0]" for key in "abcdefg") + "}",
            "makes 10,000,000 parts; allowed: 1 to 10,000",
        ),
        ("[{filter: ekf}]", "[]", "claims.0.parts.0.of: must hold at least 1 case"),
        ('"0.374"', '"nan"', "expected: printed: must be a number as it is printed, such as 0.374"),
        ('"0.374"', '"inf"', "expected: printed: must be a number as it is printed, such as 0.374"),
        ('"0.374"', "abc", "expected: printed: must be a number as it is printed, such as 0.374"),
    ],
)
def test_a_mistake_in_claims_is_one_line_with_its_place_and_what_is_allowed(old, new, words):
    text = claims(WELL)
    assert old in text
    said = fault(text.replace(old, new, 1))
    assert words in said
    assert said.startswith("claims:")


@pytest.mark.parametrize("text", ["paper: mine\nclaims: []\n", HEAD + "- {id: 1, place: p, statement: s, parts: []}\n"])
def test_claims_without_a_part_are_refused(text):
    assert "must hold at least 1" in fault(text)


@pytest.mark.parametrize("given", [None, 3, b"a", "a\0b"])
def test_claims_that_are_no_file_are_refused(given):
    assert fault(given).startswith("claims: must be a YAML file, or its text, got ")


@pytest.mark.parametrize(
    ("table", "words"),
    [
        (3, "table: must be a DataFrame, its columns, or a CSV file, got int"),
        (pd.Series([1.0]), "table: must be a DataFrame, its columns, or a CSV file, got Series"),
        ({"filter": ["ekf"], "mean": [1, 2]}, "table: must have columns of one length"),
        (pd.DataFrame([[1, 2]], columns=["mean", "mean"]), "table: names of columns must differ, twice there: mean"),
        (b"filter,mean,mean\nekf,1,2\n", "line 1 has the column 'mean' twice"),
        (b"filter;mean\nekf;1\n", "mine.csv: is no table in CSV with commas: its first line has another separator"),
        (b'filter,mean\n"ekf,1\n', "is no table in CSV with commas: unexpected end of data"),
    ],
)
def test_a_table_that_is_none_is_refused(tmp_path, table, words):
    if isinstance(table, bytes):
        (tmp_path / "mine.csv").write_bytes(table)
        table = tmp_path / "mine.csv"
    assert words in fault(claims(WELL), table)


@pytest.mark.parametrize("cell", [1j, np.datetime64("2020-01-01"), np.timedelta64(3, "s"), "0,374", object()])
def test_cells_that_are_no_numbers_are_said(cell):
    (row,) = judged({"filter": ["ekf"], "mean": [cell]}, WELL)
    assert row["verdict"] == "not judged here"
    assert "column 'mean' has cells that are no numbers" in row["reason"]


def test_more_cases_than_a_measure_takes_are_said():
    assert fault(claims(("[{filter: ekf}, {filter: ukf}]", *WELL[1:]))).endswith(
        "; of has 2 cases, got " + "{value: {column: 'mean'}}"
    )


@pytest.mark.parametrize("count", ["many", math.nan, math.inf, -3, 1.5])
def test_a_count_that_is_none_is_said(count):
    (row,) = judged({"filter": ["ekf"], "mean": [0.374], "n": [count]}, WELL)
    assert row["verdict"] == "not judged here"
    assert f"column 'n' holds the realisations of a number, whole and > 0, got {count}" in row["reason"]


@pytest.mark.parametrize(
    ("body", "why"),
    [
        ("return Estimate(5, 10, 20)", "must give an Estimate whose value is within its interval, got 5 and [10, 20]"),
        ("return Estimate('a', 'b', 'c')", "must give an Estimate or a number"),
        ("return Estimate(float('nan'), 1, 2)", "its measure gives no number"),
        ("return float('inf')", "its measure gives no number"),
        ("return [1, 2]", "must give an Estimate or a number"),
        ("return 10**400", "must give an Estimate or a number"),
        ("raise RuntimeError('boom')", "RuntimeError: boom"),
        ("import sys; sys.exit(3)", "SystemExit: 3"),
    ],
)
def test_what_a_measure_may_not_give_is_said(tmp_path, body, why):
    (tmp_path / "mine.yaml").write_text(claims((WELL[0], "odd", WELL[2])))
    head = "from radarsim.report.statistics import Estimate\n\n\n"
    (tmp_path / "mine.py").write_text(f"{head}def odd(evidence, rows):\n    {body}\n")
    (row,) = radarsim.claims.judge(tmp_path / "mine.yaml", TABLE).table.to_dict("records")
    assert row["verdict"] == "not judged here"
    assert why in row["reason"]


def test_a_unit_of_one_is_not_written():
    text = claims(WELL).replace("what: number", "what: number, unit: '1'")
    (row,) = radarsim.claims.judge(text, TABLE).in_words
    assert measured_words(row).endswith("]")
    assert wording.unit("1") == ""
