"""What publishes the package says the same as the package: version, requirements, files, commands, references."""

import re
import shlex
import tomllib
from pathlib import Path

import jinja2
import pytest
import yaml
from packaging.version import Version

import radarsim
from radarsim.cli.command_group import main
from tests.trust import versions

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
CONDA = {"matplotlib": "matplotlib-base"}  # what conda calls otherwise; its `matplotlib` brings a window toolkit along
FORMS = sorted((ROOT / ".github/ISSUE_TEMPLATE").glob("*.yaml"))


def text(name):
    return (ROOT / name).read_text(encoding="utf-8")


def recipe():
    return yaml.safe_load(
        jinja2.Environment(undefined=jinja2.StrictUndefined)
        .from_string(text("recipe/meta.yaml"))
        .render(PYTHON="python")
    )


def runs(command):
    """Raises where radarsim has no such command or option."""
    _, *words = shlex.split(command)
    with main.make_context("radarsim", words, resilient_parsing=True) as context:
        if not context._protected_args + context.args:
            return
        name, found, rest = main.resolve_command(context, context._protected_args + context.args)
        found.make_context(name, rest, parent=context).close()


def test_there_is_one_version():
    assert "version" in PROJECT["project"]["dynamic"]
    assert PROJECT["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "radarsim.__version__"}
    newest = re.search(r"^## (\S+) \(", text("CHANGELOG.md"), re.M)[1]
    cited = yaml.safe_load(text("CITATION.cff"))["version"]
    assert {newest, cited, recipe()["package"]["version"]} == {radarsim.__version__}


def test_the_changelog_has_at_most_forty_lines_a_version():
    versions = re.split(r"^## ", text("CHANGELOG.md"), flags=re.M)[1:]
    assert {one.split()[0]: lines for one in versions if (lines := len(one.splitlines())) > 40} == {}


def test_the_conda_recipe_needs_what_the_package_needs():
    project, made = PROJECT["project"], recipe()

    def conda(requirement):
        name, bound = re.fullmatch(r"([\w-]+)(>=[\d.]+)", requirement).groups()
        return f"{CONDA.get(name, name)} {bound}"

    python = f"python {project['requires-python']}"
    assert made["requirements"]["run"] == [python, *map(conda, project["dependencies"])]
    assert made["requirements"]["host"] == [python, "pip", *map(conda, PROJECT["build-system"]["requires"])]
    assert made["build"]["entry_points"] == [f"{name} = {of}" for name, of in project["scripts"].items()]
    about = made["about"]
    assert (about["summary"], about["license"]) == (project["description"], project["license"])
    assert (ROOT / "recipe" / made["source"]["path"] / about["license_file"]).resolve() == ROOT / "LICENSE"
    check, *commands = made["test"]["commands"]
    assert check == "pip check"
    for command in commands:
        runs(command)


def test_the_lowest_versions_that_are_tried_are_those_that_are_allowed():
    """On the oldest Python; on a later one the lowest that has a wheel for it."""
    pins = re.findall(r"^(\S+)==(\S+) ; python_version == '(\S+)'$", text("constraints-lowest.txt"), re.M)
    tried = {(python, name): Version(version) for name, version, python in pins}
    pythons = re.findall(r"Python :: (3\.\d+)", "\n".join(PROJECT["project"]["classifiers"]))
    assert PROJECT["project"]["requires-python"] == f">={pythons[0]}"
    for requirement in versions.newest_requirements():
        name, bound = requirement.split(">=")
        assert tried[pythons[0], name] == Version(bound), requirement
        assert all(tried[python, name] >= Version(bound) for python in pythons), requirement


def test_the_container_copies_what_a_wheel_is_made_of_and_runs_the_command():
    lines = [line.split(maxsplit=1) for line in text("Containerfile").splitlines() if line and line[0] != "#"]
    words = [word for word, _ in lines]
    assert words[0] == "FROM"
    assert set(words) <= {"FROM", "COPY", "RUN", "ENV", "WORKDIR", "ENTRYPOINT", "CMD"}
    base = re.fullmatch(r"python:(3\.\d+)-slim", lines[0][1])[1]
    assert tuple(map(int, base.split("."))) >= tuple(map(int, PROJECT["project"]["requires-python"][2:].split(".")))
    copied = {name for word, rest in lines if word == "COPY" for name in rest.split()[:-1]}
    assert all((ROOT / name).exists() for name in copied)
    shipped = {folder.name for folder in (ROOT / "radarsim/shipped").iterdir()}
    assert copied == {"pyproject.toml", "constraints.txt", "README.md", "LICENSE", "radarsim", *shipped}
    commands = [rest for word, rest in lines if word == "RUN"]
    for command in re.findall(r"radarsim compile[^&]*", " ".join(commands)):
        runs(command)
    extra = re.search(r"/src\[(\w+)\]", " ".join(commands))[1]
    assert extra in PROJECT["project"]["optional-dependencies"]
    assert dict(lines)["ENTRYPOINT"] == '["radarsim"]'


@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.stem)
def test_an_issue_form_can_be_shown_and_asks_for_commands_that_exist(form):
    asked = yaml.safe_load(form.read_text(encoding="utf-8"))
    assert {"name", "description", "body"} <= set(asked) <= {"name", "description", "title", "labels", "body"}
    names = [part["id"] for part in asked["body"]]
    assert len(set(names)) == len(names) >= 2
    for part in asked["body"]:
        assert part["type"] in ("textarea", "input", "dropdown", "checkboxes")
        assert set(part["attributes"]) <= {"label", "description", "render", "placeholder"}
        assert set(part.get("validations", {})) <= {"required"}
    for command in re.findall(r"`(radarsim [^`]+)`", form.read_text(encoding="utf-8")):
        runs(command)
    assert any(part.get("validations", {}).get("required") for part in asked["body"])


def test_the_paper_cites_what_its_list_holds_and_has_the_journals_parts():
    head, body = re.fullmatch(r"---\n(.*?)\n---\n(.*)", text("paper.md"), re.S).groups()
    about = yaml.safe_load(head)
    assert {"title", "tags", "authors", "affiliations", "date", "bibliography"} <= set(about)
    assert {of["affiliation"] for of in about["authors"]} <= {of["index"] for of in about["affiliations"]}
    listed = re.findall(r"^@\w+\{(\w+),", text(about["bibliography"]), re.M)
    assert set(re.findall(r"@(\w+)", body)) == set(listed)
    assert len(listed) == len(set(listed))
    wanted = ["Summary", "Statement of need", "State of the field", "AI usage disclosure", "References"]
    headings = re.findall(r"^# (.+)", body, re.M)
    assert [name for name in headings if name in wanted] == wanted
    assert 750 <= len(body.split()) <= 1200


def test_the_papers_numbers_are_those_of_the_pages():
    """Where a page's number moves, the paper's has to move with it."""
    paper, speed, trust = text("paper.md"), text("benchmarks/README.md"), text("docs/trust.md")
    for library, words in {
        "dynamax": "Dynamax took {}",
        "simdkalman": "simdkalman {}",
        "FilterPy": "FilterPy {}",
        "Stone Soup": "Stone Soup {}",
    }.items():
        times = re.search(rf"^\| {library}.*\| ([\d  ]+) \| [^|]*\|$", speed, re.M)[1].replace(" ", "").replace(" ", "")
        said = f"{int(times):,}" if int(times) >= 10_000 else times
        assert words.format(said) in paper, library
    claims = re.search(r"(\d+) claims of four", text("README.md"))[1]
    assert f"Their {claims} claims" in paper
    assert f"a table of {claims} claims" in paper
    assert re.search(r"^\| all \|.*\| ([\d.]+ %) \|$", trust, re.M)[1] in paper
    checked = int(re.search(r"([\d,]+) intervals, of", trust)[1].replace(",", ""))
    assert f"{checked / 1e6:.1f} million intervals" in paper
    found, planted = re.search(r"(\d+) of (\d+) faults", trust).groups()
    assert found == planted
    assert f"of {planted} faults of meaning all" in paper
