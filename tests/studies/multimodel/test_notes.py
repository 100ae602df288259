"""Marks of intervals over stages: what rare errors add, as a twin counts it, and where they are too few."""

from types import SimpleNamespace

import numpy as np
import pytest

from radarsim.report.notes import OF_GAIN
from radarsim.studies.multimodel import notes

SHORT, LONG = 10, 400  # scans of the two stages


def case_of(errors):
    """A case of errors (F, n, K): one component, two stages, every scan reported; the first filter is the baseline."""
    case, means = parts_of(errors[..., None], [("x", "m")])
    return case, means[..., 0]


def parts_of(errors, components):
    """As `case_of` for errors (F, n, K, C) of several components, and their mean squares (F, S, n, C)."""
    filters, n, scans, count = errors.shape
    stage = (np.arange(scans) >= SHORT).astype(int)
    means = np.stack([(errors[:, :, stage == s] ** 2).mean(axis=2) for s in (0, 1)], axis=1)
    axes = SimpleNamespace(
        available=np.full((filters, scans, count), True),
        components=tuple(components),
        baseline=0,
        stage=stage,
        stage_scans=np.array([SHORT, scans - SHORT], dtype=float),
    )
    sums = {
        "error": np.stack([(errors**p).sum(axis=1) for p in (1, 2, 3, 4)], axis=-1),
        "stage": np.stack([means.sum(axis=2), (means**2).sum(axis=2)], axis=-1),
        "pairs": np.einsum("fsnc,gsnc->fgsc", means, means),
    }
    return SimpleNamespace(count=n, sums=sums, axes=axes), means


def errors_of(rng, runs=1000, scans=SHORT + LONG):
    return rng.normal(size=(2, runs, scans))


def test_what_rare_errors_add_is_as_a_twin_counts_it():
    """Twelve realisations of 1000 err by 20 for three scans of the short stage, about a mean of five."""
    errors = errors_of(np.random.default_rng(1)) + 5
    errors[1, :12, 4:7] += 20
    case, means = case_of(errors)
    own = errors[1]
    tails = np.mean((own - own.mean(0)) ** 4, axis=0) / own.var(axis=0)
    tailed = np.mean((own - own.mean(0)) ** 4, axis=0) / own.var(axis=0) ** 2 > notes.TAIL
    assert list(np.flatnonzero(tailed)) == [4, 5, 6]
    size = tails[tailed].mean()
    lasts = SHORT * means[1, 0].var() / (own[:, :SHORT] ** 2).var(axis=0).mean()
    assert lasts == pytest.approx(3, rel=0.3)
    for s, length in enumerate((SHORT, LONG)):
        at = slice(0, SHORT) if s == 0 else slice(SHORT, None)
        bias = np.sqrt(np.mean(own.mean(0)[at] ** 2))
        expected = (size + 2 * bias * np.sqrt(size)) * lasts / length
        assert notes.rare(case)[1, s, 0] == pytest.approx(expected, rel=1e-9)
    assert np.all(notes.rare(case)[0] == 0)  # Gaussian errors have no tail


@pytest.mark.parametrize("many", [4, 100])
def test_few_rare_errors_mark_a_short_stage_and_not_a_long_one(many):
    """Of a hundred large errors the sums say enough; of four not, and over 400 scans they move nothing."""
    errors = errors_of(np.random.default_rng(2))
    errors[1, :many, 4] += 15
    said = notes.of_stages(case_of(errors)[0])[..., 0]
    assert list(said[0]) == ["", ""]
    assert said[1, 1] == ""
    assert said[1, 0] == (notes.RARE if many == 4 else "")


def test_a_stage_is_marked_for_what_its_sample_lacks():
    """The large errors of scan 300 are in no realisation of the short stage, and would decide it."""
    errors = errors_of(np.random.default_rng(3))
    errors[1, :3, 300] += 15
    said = notes.of_stages(case_of(errors)[0])[..., 0]
    assert said.tolist() == [["", ""], [notes.RARE, ""]]


def test_a_gain_is_marked_for_the_errors_of_either_filter():
    """σ of the other filter bears no mark; the gain against a baseline that does is marked by its words."""
    errors = errors_of(np.random.default_rng(4))
    errors[0, :3, 300] += 15
    said = notes.of_stages(case_of(errors)[0])[..., 0]
    assert said.tolist() == [[notes.RARE, ""], [OF_GAIN + notes.RARE, ""]]


def test_a_gain_may_be_narrower_than_what_its_filters_lack():
    """Filters that share all but a tenth of their noise: four of 15 σ are too few for the gain, and enough for σ."""
    rng = np.random.default_rng(5)
    errors = errors_of(rng)
    errors[1] = errors[0] + 0.1 * errors[1]
    errors[1, ::250, 300] += 15
    said = notes.of_stages(case_of(errors)[0])[..., 0]
    assert said[0].tolist() == ["", ""]
    assert said[1, 1] == OF_GAIN + notes.RARE


def test_a_gain_is_marked_by_the_axis_that_shows_rare_errors_most():
    """Errors of 15 σ along x alone: gains of y, whose own have no tail, bear the mark; those of speeds do not."""
    rng = np.random.default_rng(6)
    components = [("x", "m"), ("vx", "m/s"), ("ax", "m/s2"), ("y", "m"), ("vy", "m/s"), ("ay", "m/s2")]
    errors = np.stack([errors_of(rng) for _ in components], axis=-1)
    errors[1, :3, 4, 0] += 15
    said = notes.of_stages(parts_of(errors, components)[0])
    assert said[1, 0].tolist() == [notes.RARE, "", "", OF_GAIN + notes.RARE, "", ""]
    assert said[0].tolist() == [[""] * 6] * 2


@pytest.mark.parametrize(("wrong", "marked"), [("ax", ["vx", "vy", "ax", "ay"]), ("vx", ["vx", "vy"])])
def test_a_gain_in_speed_is_marked_by_the_acceleration_of_its_stage(wrong, marked):
    """The same mistakes, which a speed's own errors hide; a place's gain and another stage's are not touched."""
    rng = np.random.default_rng(7)
    components = [("x", "m"), ("vx", "m/s"), ("ax", "m/s2"), ("y", "m"), ("vy", "m/s"), ("ay", "m/s2")]
    names = [name for name, _ in components]
    errors = np.stack([errors_of(rng) for _ in components], axis=-1)
    errors[1, :3, 4, names.index(wrong)] += 17
    said = notes.of_stages(parts_of(errors, components)[0])
    own = {wrong: notes.RARE}
    assert said[1, 0].tolist() == [own.get(n, OF_GAIN + notes.RARE if n in marked else "") for n in names]
    assert said[1, 1].tolist() == [""] * 6
    assert said[0].tolist() == [[""] * 6] * 2
