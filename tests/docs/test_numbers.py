"""Numbers in the pages: each mark is made by something, and what makes it still gives the same rows and columns."""

import re

import pytest
from making import numbers

PAGES = numbers.pages()
PARTS = {"range_doppler": 5000, "manoeuvre_variance": 5000}


def every_mark():
    return [mark for page in PAGES for mark in numbers.marks(page.read_text(encoding="utf-8"))]


def shape(kind, text):
    """Heads and first column of a table; a value without digits, interval and what is in brackets: results decide."""
    if kind == "value":
        return re.sub(r"−?\d[\d.,]*", "0", re.sub(r" (± [\d.]+|\[[^]]*\]|\([^)]*\))", "", text))
    lines = [line.strip("| ").split(" | ") for line in text.strip().split("\n")]
    return [lines[0], *(line[0] for line in lines[2:])]


def test_marks_are_whole_and_each_is_made_once():
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        opened = re.findall(r"<!-- (?:table|value): ", text)
        assert len(numbers.marks(text)) == len(opened) == text.count("<!-- end -->"), page.name
        assert not re.search(r"^ *<!-- value: ", text, re.MULTILINE), page.name  # there it would end the paragraph
    assert sorted(name for _, name, _ in every_mark()) == sorted(numbers.measured())


def check(prefix, results):
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for (kind, name, stands), (_, _, made) in zip(
            numbers.marks(text), numbers.marks(filled(text, results, prefix)), strict=True
        ):
            assert shape(kind, stands) == shape(kind, made), f"{page.name}: {name}"


def filled(text, results, prefix):
    """The page with those of its marks filled that begin so."""
    mark = re.compile(rf"<!-- (?:table|value): (?:{prefix})\w* -->.*?<!-- end -->", re.DOTALL)
    return mark.sub(lambda found: numbers.filled(found[0], results), text)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    from radarsim.api.run import run

    out = tmp_path_factory.mktemp("results")

    def made(stem, realisations):
        run(stem, realisations=realisations, out=out, figures=False)
        return numbers.Results(out)

    return made


@pytest.mark.slow
def test_range_and_radial_velocity(run):
    for stem, realisations in PARTS.items():
        results = run(stem, realisations)
    check("range_doppler|rls", results)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("marks", "stem", "more", "realisations"),
    [
        ("multimodel", "multimodel", ("", "_trajectories", "_rules", "_transition", "_banks", "_covariance"), 1000),
        ("pulses", "pulses", ("", "_snr", "_forecast", "_energy", "_radars", "_folds", "_acceleration"), 300),
        ("sonar", "sonar", ("_smoothing", "_fluctuating", "_missed", "_correlated", "_conversion"), 1000),
        ("manoeuvre_(?!variance)", "sonar_manoeuvre", ("", "_turning"), 500),
        ("clutter", "sonar_clutter", ("", "_gate"), 1000),
        ("doppler", "discriminator", ("_paper", "_maps", "_region", "_rival", "_crossing", "_profile"), 64),
    ],
)
def test_other_studies(run, marks, stem, more, realisations):
    for end in more:
        results = run(f"{stem}{end}", realisations)
    check(marks, results)


def test_missing_results_are_told_with_the_command(tmp_path):
    with pytest.raises(numbers.Missing, match="radarsim run range_doppler --out"):
        numbers.measured()["range_doppler_gains"](numbers.Results(tmp_path))


def test_numbers_as_people_write_them():
    assert numbers.with_bounds(18.366, 18.06, 18.68) == "18.4 ± 0.3"
    assert numbers.with_bounds(-5.2, -5.8, -4.6) == "−5.2 ± 0.6"
    assert numbers.with_bounds(100.1, 77.27, 142.3) == "100 [77, 142]"
    assert numbers.with_bounds(-0.004, -0.3, 0.29) == "0.0 ± 0.3"
    assert numbers.with_bounds(2.0, 2.0, 2.0) == "2.0 ± 0.0"
