"""The notebooks run from top to bottom, and every cell shows what a notebook would show."""

import ast
import json
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[2] / "docs" / "notebooks").glob("*.ipynb"))


def cells(notebook):
    """The source of each cell of code."""
    made = json.loads(notebook.read_text(encoding="utf-8"))
    return ["".join(cell["source"]) for cell in made["cells"] if cell["cell_type"] == "code"]


def shown(cell, names):
    """Run a cell; what a notebook shows of its last expression: HTML where there is some, else text."""
    body = ast.parse(cell).body
    last = body.pop() if isinstance(body[-1], ast.Expr) else None
    exec(compile(ast.Module(body, []), "cell", "exec"), names)
    if last is None:
        return ""
    value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
    return "" if value is None else value._repr_html_() if hasattr(value, "_repr_html_") else repr(value)


@pytest.mark.slow
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(notebook, tmp_path, monkeypatch, capsys):
    import matplotlib.pyplot as plt

    monkeypatch.chdir(tmp_path)
    plt.switch_backend("agg")
    names, answers = {}, []
    try:
        for cell in cells(notebook):
            answers.append(shown(cell, names) + capsys.readouterr().out)
    finally:
        plt.close("all")
    said = "\n".join(answers)
    assert said.count("data:image/png;base64,") >= 2
    assert said.count("<table") >= 4
    assert ">nan<" not in said.lower()


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_outputs(notebook):
    made = json.loads(notebook.read_text(encoding="utf-8"))
    assert (made["nbformat"], made["nbformat_minor"]) == (4, 5)
    assert len({cell["id"] for cell in made["cells"]}) == len(made["cells"])
    for cell in made["cells"]:
        assert cell["cell_type"] == "markdown" or (cell["outputs"], cell["execution_count"]) == ([], None)


def test_there_are_notebooks():
    assert [path.stem for path in NOTEBOOKS] == ["claim", "my_radar"]
