"""All outputs of an experiment: what is written, whole or not at all, and what its report says."""

import hashlib
import json
import re
from html.parser import HTMLParser

import pandas as pd
import pytest
from markupsafe import escape

from radarsim.api import run, stored_runs, write_result
from radarsim.api.configs import load
from radarsim.api.result_content import undeclared_figures
from radarsim.report import page_tables, provenance
from radarsim.studies.registry import study

TABLES = {"curves.csv", "gains.csv", "steady.csv", "consistency.csv", "radar.csv"}
TABLES |= {"claims.csv", "config.yaml"}
FIGURES = {f"figures/{k}_{c}.svg" for k in ("sigma", "gain") for c in ("r", "Vr", "ar")}
FIGURES |= {"figures/consistency.svg", "figures/captions.md"}
RUN = {"stop": "done", "threads": 2, "seconds": 1.5, "warnings": ["watch out"], "identities": {"rls2": "ab"}}


HOSTILE = "<script>alert('x')</script> & \"{{ 1 }}\""


@pytest.fixture(scope="module")
def experiment(radar_config):
    filters = radar_config("rls2")["filters"]
    filters[0]["name"] = HOSTILE
    return load(radar_config("rls2", filters=filters, radar={"name": HOSTILE}))


@pytest.fixture(scope="module")
def results(experiment, expected_case):
    return [expected_case(case) for case in experiment.cases]


@pytest.fixture(scope="module")
def written(experiment, results, tmp_path_factory):
    """All outputs, figures too, of an experiment whose names are hostile."""
    return write_result.write_files(experiment, results, tmp_path_factory.mktemp("out") / "rls2", RUN)


class Page(HTMLParser):
    """Tags and addresses of a page; fails on a tag that is not closed."""

    VOID = ("meta", "br", "link", "img")

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.addresses = [], [], []
        self.feed(text)
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.addresses += [value for name, value in attrs if name in ("src", "href", "xlink:href", "action")]
        if tag not in self.VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in self.VOID:
            self.handle_endtag(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_everything_is_written(written):
    folder = written.folder
    found = {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()}
    assert found == TABLES | FIGURES | {"run.json", "report.html"} == set(written.files)
    record = json.loads((folder / "run.json").read_bytes())
    for path, digest in record["outputs"].items():
        assert hashlib.sha256((folder / path).read_bytes()).hexdigest() == digest
    assert set(record["outputs"]) == found - {"run.json"}
    assert record["realisations_asked"] == record["realisations_done"] == 100_000
    assert record["stop"] == "done"
    assert record["warnings"] == ["watch out"]
    assert record["identities"] == {"rls2": "ab"}
    assert re.fullmatch("[0-9a-f]{64}", record["resolved_sha256"])
    assert {"python", "numpy", "numba", "radarsim"} <= set(record["versions"])


def test_tables_are_the_same_bytes_each_time(experiment, results, tmp_path):
    for name in ("a", "b"):
        write_result.write_files(experiment, results, tmp_path / name, RUN, draw=False)
    for path in TABLES | {"report.html"}:
        assert (tmp_path / "a" / path).read_bytes() == (tmp_path / "b" / path).read_bytes()


def test_without_figures_old_ones_go_and_nothing_else(experiment, results, tmp_path):
    folder = tmp_path / "rls2"
    (folder / "figures").mkdir(parents=True)
    for name in ("figures/sigma_r.svg", "track.csv", "figures/mine.svg", "../outside.csv"):
        (folder / name).write_text("old")
    named = {"figures/sigma_r.svg": "", "../outside.csv": "", str(tmp_path / "outside.csv"): ""}
    (folder / "run.json").write_text(json.dumps({"outputs": named}))
    written = write_result.write_files(experiment, results, folder, RUN, draw=False)
    assert set(written.files) == TABLES | {"run.json", "report.html"}
    assert not (folder / "figures/sigma_r.svg").exists()
    for name in ("track.csv", "figures/mine.svg", "../outside.csv"):
        assert (folder / name).read_text() == "old"
    page = (folder / "report.html").read_text()
    Page(page)
    assert "<svg" not in page


@pytest.mark.parametrize("damaged", [b"", b"[]", b'{"outputs": [1]}', b"\xff", b'{"outputs": null}'])
def test_a_damaged_record_is_replaced(damaged, tmp_path):
    (tmp_path / "run.json").write_bytes(damaged)
    assert provenance.outputs(tmp_path) == []


def test_no_claims_no_file(radar_config, expected_case, tmp_path):
    experiment = load(radar_config("rls2", radar={"sigma_range_m": 251}))
    written = write_result.write_files(
        experiment, [expected_case(case) for case in experiment.cases], tmp_path, RUN, draw=False
    )
    assert "claims.csv" not in written.files
    assert "Claims of the paper" not in (tmp_path / "report.html").read_text()


def test_page_is_whole_and_leads_nowhere(written):
    text = (written.folder / "report.html").read_text()
    page = Page(text)
    beside = set(written.files)  # leads to its own tables and figures, and fetches none
    assert all(address.startswith("#") or address == "data:," or address in beside for address in page.addresses)
    assert "http://" not in re.sub(r'xmlns(:\w+)?="[^"]*"', "", text)
    assert page.tags.count("script") == 2  # the page's own, and its words
    assert "Content-Security-Policy" in text
    ids = re.findall(r'\bid="([^"]+)"', text)
    assert len(ids) == len(set(ids))
    assert text.count('<svg class="figure"') == 7
    assert str(escape(written.answer[0])) in text.replace("\u00a0", " ")
    assert "<i>C</i><sub>θ</sub>" in text[text.index('id="asked"') : text.index('class="rest"')]
    assert "(1 rows)" not in text
    assert re.search(r">sigma</th><th[^>]*>exact_sigma<", text)
    assert "watch out" in text
    assert "P1.18" in text


def test_the_figure_of_the_first_sentence_of_the_answer_bears_it_and_no_other_does(written):
    def of(name):
        """The texts of a figure, one after the other."""
        text = (written.folder / name).read_text().replace("\u00a0", " ")
        return " ".join(re.findall(r"<text[^>]*>([^<]*)</text>", text))

    first, *others = re.findall(r"^## (\w+)$", (written.folder / "figures/captions.md").read_text(), re.MULTILINE)
    sentence = written.answer[0]
    assert str(escape(sentence)) in of(f"figures/{first}.svg").replace("&quot;", "&#34;").replace("'", "&#39;")
    assert [name for name in others if sentence in of(f"figures/{name}.svg")] == []
    page = (written.folder / "report.html").read_text().replace("\u00a0", " ")
    assert re.search(r'class="answer".*?<p>(.*?)</p>', page, re.DOTALL)[1] == str(escape(sentence))


def test_names_are_escaped(written):
    text = (written.folder / "report.html").read_text()
    scripts = {"<script>", '<script type="application/json" id="words">'}
    assert set(re.findall("<script[^>]*>", text)) == scripts
    assert text.count("<script>") == 1
    assert "&lt;script&gt;" in text
    assert set(pd.read_csv(written.folder / "gains.csv")["baseline"]) == {HOSTILE}


def test_few_realisations_are_warned_of(experiment, expected_case, tmp_path):
    write_result.write_files(experiment, [expected_case(experiment.cases[0], count=10)], tmp_path, RUN, draw=False)
    record = json.loads((tmp_path / "run.json").read_bytes())
    assert "intervals from 10 realisations are rough" in record["warnings"][-1]
    assert record["realisations_done"] == 10


def of_cases(*cases):
    return {"cases": {str(i): dict(zip(("asked", "done", "seed"), case, strict=True)) for i, case in enumerate(cases)}}


def test_extent_in_words():
    assert provenance.extent(of_cases((10_000, 10_000, 7))) == "10,000 realisations, seed 7"
    differing = of_cases((100_000, 100_000, 2017), (200_000, 200_000, 1))
    assert provenance.extent(differing) == "100,000 to 200,000 realisations per case, seeds 1, 2017"
    short = of_cases((200_000, 100_000, 1), (200_000, 200_000, 1))
    assert provenance.extent(short) == "100,000 to 200,000 of 200,000 realisations per case, seed 1"


def test_many_long_tables_share_the_room_of_a_page():
    long = pd.DataFrame({"k": range(5000), "sigma": 1.0})
    shown = page_tables.page_tables({f"table {i}": long for i in range(15)} | {"short": long.head(30)})
    assert sum(len(table["rows"]) for table in shown) <= page_tables.MAX_PAGE_ROWS
    assert len(shown[-1]["rows"]) == 30
    assert all(table["cut"] and table["count"] == 5000 for table in shown[:-1])
    assert len(page_tables.page_tables({"alone": long})[0]["rows"]) == page_tables.MAX_ROWS


@pytest.mark.slow
def test_figures_have_the_width_asked_for_their_captions_and_what_they_were_made_of(tmp_path):
    first = run.run("rls2", realisations=2000, out=tmp_path, overrides=["figures=[sigma_r,gain_r]"])
    folder = tmp_path / "rls2"
    names = {path.name for path in (folder / "figures").iterdir()}
    assert "captions.md" in names
    captions = (folder / "figures" / "captions.md").read_text()
    assert f"## gain_r\n\n{first.answer[0]}\n\n**" in captions
    assert "## sigma_r\n\n**" in captions
    svg = (folder / "figures" / "sigma_r.svg").read_text()
    assert ">time from the first plot, s</text>" in svg  # text, not paths
    record = json.loads((folder / "run.json").read_text())
    assert f"rls2, config {record['resolved_sha256']}" in svg
    assert "Root-mean-square error of the range" in svg
    for width in (85, 175):
        result = stored_runs.stored_result(first.experiment, out=tmp_path)
        result.write(tmp_path, ("svg",), width)
        svg = (folder / "figures" / "sigma_r.svg").read_text()
        points = float(re.search(r'<svg[^>]* width="([\d.]+)pt"', svg)[1])
        assert points / 72 * 25.4 == pytest.approx(width, rel=0, abs=25.4 / 72 * 0.5e-6)  # six decimals
        assert "7.5px" in svg  # as large as at any other width
    assert result.written.removed == ()
    kept = stored_runs.stored_result(first.experiment, out=tmp_path).write(tmp_path, ("pdf",))
    assert {"figures/sigma_r.svg", "figures/sigma_r.pdf"} <= {*kept.files}
    assert not kept.removed


def test_the_figures_that_a_config_names_are_written_and_every_other_is_at_hand(tmp_path):
    asked = ["figures=[sigma_ar,gain_r]"]
    result = run.run("rls2", realisations=200, out=tmp_path, overrides=asked)
    described = (tmp_path / "rls2" / "figures" / "captions.md").read_text()
    assert re.findall("^## (.*)$", described, re.MULTILINE) == ["sigma_ar", "gain_r"]
    page = (tmp_path / "rls2" / "report.html").read_text()
    assert page.index("sigma_ar.svg") < page.index("gain_r.svg")
    assert "sigma_r.svg" not in page
    assert result.figure("sigma_r").axes


def test_a_figure_that_the_keys_do_not_name_is_complained_of():
    own = study("range_doppler")
    known = ", ".join(own.keys().figure_names)
    line = f"study range_doppler: draws sigma_rr, which its `figure_names` lacks: {known}"
    assert undeclared_figures(own, ["sigma_r", "gain_r_2", "claims", "sweep_sigma_r", "sigma_rr"]) == [line]
    assert undeclared_figures(own, ["sigma_r"]) == []
