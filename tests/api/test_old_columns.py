"""Results whose tables have the column names of an earlier version are read, compared and verified."""

import hashlib
import json
import shutil
from importlib import import_module

import pandas as pd
import pytest

import radarsim
from radarsim.report.old_columns import ONE_FILE_STUDIES, RENAMED, with_current_columns
from tests.program import command, printed, record

OLD_NAMES = {
    "steady.csv": {"last_sigma_lo": "last_lo", "last_sigma_hi": "last_hi"},
    "claims.csv": {"quantity": "what", "reason": "why", "variants_of": "number"},
}
TRACKING = (
    "case,filter,association,gate_probability,m,of,n,detection_probability,false_plots_per_km2,false_in_gate,confirmed,"
    "confirmed_lo,confirmed_hi,time_to_confirm_s,time_lo,time_hi,kept_at_end,kept_lo,kept_hi,lost,dropped,ends_per_hour,"
    "ends_lo,ends_hi,life_s,life_lo,life_hi,wrong_share,wrong_lo,wrong_hi,false_confirmed,false_confirmed_lo,"
    "false_confirmed_hi,exact_false_confirmed,false_tracks_per_hour,false_lo,false_hi,false_tracks_at_once,false_life_s"
)
"""The header of tracking.csv as version 0.2 wrote it."""


@pytest.fixture(scope="module")
def old_and_new(tmp_path_factory):
    """The result folders of the same run, under the old and the present names of its columns."""
    new = tmp_path_factory.mktemp("new") / "rls2"
    command("run", "rls2", "-n", 400, "--no-figures", "-q", "--out", new.parent)
    old = tmp_path_factory.mktemp("old") / "rls2"
    shutil.copytree(new.parent, old.parent, dirs_exist_ok=True)
    facts = record(old)
    for table, old_names in OLD_NAMES.items():
        header, line_end, rows = (new / table).read_text(encoding="utf-8").partition("\n")
        names = [old_names.get(name, name) for name in header.split(",")]
        content = (",".join(names) + line_end + rows).encode()
        (old / table).write_bytes(content)
        facts["outputs"][table] = hashlib.sha256(content).hexdigest()
    (old / "run.json").write_text(json.dumps(facts), encoding="utf-8")
    return old, new


def test_old_results_are_loaded_and_compared(old_and_new, tmp_path):
    old, new = old_and_new
    assert b"last_lo" in (old / "steady.csv").read_bytes()
    without_blocks = [shutil.copytree(folder, tmp_path / folder.parent.name) for folder in (old, new)]
    for folders in (old_and_new, without_blocks):  # without blocks: read from the files
        tables_of_both = [radarsim.load(folder).tables for folder in folders]
        for table in ("steady", "claims"):
            pd.testing.assert_frame_equal(*(tables[table] for tables in tables_of_both))
    table = radarsim.compare(old, new).table
    assert (table["value"] == table["against"]).all()


def test_old_results_are_verified(old_and_new, tmp_path):
    old, _ = old_and_new
    said = printed("doctor", old)
    assert not any(table in said for table in OLD_NAMES)
    assert "equal to rounding" not in said
    archive = tmp_path / "old.zip"
    command("pack", old, "-o", archive)
    printed("check", archive)
    again = printed("run", archive, "--out", tmp_path / "again")
    assert "differs" not in again


def test_a_whole_header_of_an_earlier_version():
    names = with_current_columns("sonar", "tracking", f"{TRACKING}\n1,2\n".encode()).decode().split("\n")[0].split(",")
    assert len(names) == len({*names}) == len(TRACKING.split(","))
    for i, name in enumerate(names[:-2]):
        if name.endswith("_lo"):
            assert names[i - 1 : i + 2] == [name.removesuffix("_lo"), name, name.replace("_lo", "_hi")]
    assert {"confirm_plots", "n_lost", "life_s_lo", "exact_false_confirmed_share"} <= {*names}


@pytest.mark.parametrize("study", [*RENAMED, "mine"])
def test_present_names_stay(study):
    """A renamed column is one that the study declares, and its table is read as it stands."""
    for table, renamed in RENAMED.get(study, ONE_FILE_STUDIES).items():
        names = [name for new in renamed.values() for name in (new, f"{new}_lo", f"{new}_hi")]
        content = (",".join(["case", *names]) + "\n").encode()
        assert with_current_columns(study, table, content) == content


def test_tables_of_packages_are_left_alone():
    content = b"case,rate,rate_lo,rate_hi,m,last_lo\n"
    for table in ("rare", "tracking", "last", "mine"):
        assert with_current_columns("mine", table, content) == content


def test_new_names_are_declared():
    for study, tables in RENAMED.items():
        documented = _documentation(study)
        for table, renamed in tables.items():
            assert [new for new in renamed.values() if f"{new}" not in documented] == [], (study, table)


def _documentation(study):
    """The docstrings that declare the columns of a study's tables."""
    from radarsim.report import rare_events
    from radarsim.studies import registry

    package = registry.SHIPPED[study]
    names = ["tables", "clutter.tables", "manoeuvre.tables"] if study == "sonar" else ["tables"]
    modules = [import_module(f"{package}.{name}") for name in names]
    makers = [make for module in modules for make, _ in module.table.makers.values()]
    return "\n".join(str(thing.__doc__) for thing in (*modules, *makers, rare_events.rate_columns))
