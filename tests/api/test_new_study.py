"""`radarsim new-study` writes a package under a name that nothing has, and never over anything.

That the package works is tested by tests/studies/test_package_studies.py.
"""

import pytest

from radarsim.api.maintenance import new_study
from radarsim.errors import ConfigError, StoreError
from tests.program import command
from tests.studies.example_packages import lines_without_imports


@pytest.mark.parametrize(("form", "options"), [("linear", ()), ("step", ("--step",))])
def test_the_command_writes_a_package_under_its_name(tmp_path, monkeypatch, form, options):
    monkeypatch.chdir(tmp_path)
    assert "pip install -e my_paper" in command("new-study", "my_paper", *options).output
    written = [file for file in sorted((tmp_path / "my_paper").rglob("*")) if file.is_file()]
    names = [file.relative_to(tmp_path / "my_paper").as_posix() for file in written]
    assert sorted(names) == sorted(one.replace("random_walk", "my_paper") for one in new_study.template_files(form))
    assert (tmp_path / "my_paper/src/my_paper/shipped/configs/my_paper.yaml").is_file()
    text = "".join(file.read_text(encoding="utf-8") for file in written)
    assert "random_walk" not in text
    assert '"my_paper"' in text


@pytest.mark.parametrize("form", new_study.FORMS)
def test_a_study_in_one_file_is_one_file_with_a_config_and_a_test(form):
    files = list(new_study.template_files(form).values())
    assert [file.suffix for file in files] == [".toml", ".py", ".yaml", ".py"]
    assert lines_without_imports(files[1].read_text(encoding="utf-8")) <= 114


@pytest.mark.parametrize("form", new_study.FORMS)
def test_every_file_says_what_goes_there(form):
    files = new_study.template_files(form).values()
    assert [file.name for file in files if "Yours:" not in file.read_text(encoding="utf-8")] == []


@pytest.mark.parametrize(
    "name", ["", "1st", "my-paper", "My", "class", "match", "a.b", "../a", "ё", "a" * 41, "a\nb", "_a", "true"]
)
def test_a_name_that_is_no_modules_is_refused(name, tmp_path):
    with pytest.raises(ConfigError, match="must be a module's name"):
        new_study.new_study(name, tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "taken"),
    [("sonar", "study"), ("rls2", "config"), ("json", "module"), ("numpy", "module"), ("radarsim", "module")],
)
def test_a_name_that_is_taken_is_refused(name, taken, tmp_path):
    with pytest.raises(ConfigError, match=f"{name}: there is a .*{taken}"):
        new_study.new_study(name, tmp_path)


def test_nothing_is_overwritten(tmp_path):
    (tmp_path / "mine").write_text("mine")
    with pytest.raises(ConfigError, match="never overwritten"):
        new_study.new_study("mine", tmp_path)
    assert (tmp_path / "mine").read_text() == "mine"


def test_a_folder_that_cannot_be_written_is_told(tmp_path):
    with pytest.raises(StoreError, match="cannot be written"):
        new_study.new_study("mine", tmp_path / "nowhere")
