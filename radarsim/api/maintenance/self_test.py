"""`radarsim doctor --self-test`: small runs of every study compared with known tables.

radarsim/api/maintenance/known holds for each study (the sonar has three) a config and its tables on the platform of
platform.json. Elsewhere (instruction set, compiler, BLAS, mathematical library) the last bits differ: an ulp here and
there, which later arithmetic magnifies by its condition number κ. So a number may differ by what κ allows, see
`Tolerance`. `make known` computes the tables again, after an intended change of numbers. A study of an installed
package has its known answers in its own tests; here it is only loaded."""

import csv
import io
import json
from dataclasses import dataclass
from pathlib import Path

from radarsim.api import run
from radarsim.engine.machine import platform
from radarsim.report import atomic_files
from radarsim.studies import registry

KNOWN_FOLDER = Path(__file__).parent / "known"
TABLES = ("curves", "gains")


@dataclass(frozen=True)
class Tolerance:
    """How far a study's numbers may differ between platforms, in σ: sampled and exact ones.

    Spreads, standard errors and half-widths of intervals are compared by their squares, as each is the root of a
    difference of sums: where all realisations err alike, a rounding ε of σ² makes √(2ε) |bias| of the spread. Notes are
    not compared: each turns at a threshold, that on equal filters at a difference of zero."""

    sampled: float = 1e-12
    exact: float = 1e-12


TOLERANCES = {
    # Gains of up to three states from fits with κ < 10³ when balanced: some tens of roundings, 10⁻¹² leaves a factor 5.
    "range_doppler": Tolerance(),
    "sonar": Tolerance(),
    # The same, and thresholds: a test of a detector, or a plot at the edge of a gate, might fall otherwise within
    # rounding of it, once in 10⁹ of them; the cases hold some 10⁴. Likelihoods multiply: κε of a few hundred roundings.
    "sonar_manoeuvre": Tolerance(sampled=1e-10),
    "sonar_clutter": Tolerance(sampled=1e-10),
    # Innovation covariances of bearings have κ of up to 3·10⁶ (kernels.algebra.factored), so κε = 7·10⁻¹⁰.
    "multimodel": Tolerance(sampled=1e-9),
    # Balanced information of five parameters, κ = 2.1·10⁵: its inverse is known to κε/2 = 2.3·10⁻¹¹. Estimates are
    # found by scoring steps that use the inverse, each a fraction of σ long and ended by a threshold.
    "discriminator": Tolerance(sampled=1e-9, exact=1e-10),
    # Covariances of each realisation's own begin with a prior of (300 m/s)² beside plots of (15 m/s)², over scans of
    # 10 s: κ near 10⁴, κε = 2·10⁻¹². Weights of hypotheses are exponentials of up to −40, multiplying that by 40. A
    # hypothesis within rounding of `prune_below` might be dropped or kept: once in 10¹⁰ of some 10⁶ looked at.
    "ambiguous_doppler": Tolerance(sampled=1e-10, exact=1e-11),
    # Balanced information of a burst's three parameters, κ = 230: 10⁻¹³; covariances of the track from (3 m/s)² to
    # (0.04 m/s)², κ near 10⁴, κε = 2·10⁻¹². Estimates are found by scoring steps that end by a threshold, so that one
    # more or less, where two numbers nearly tie, shows by what it leaves: as in the discriminator.
    "pulses_to_tracks": Tolerance(sampled=1e-9, exact=1e-11),
}
PACKAGE_TOLERANCE = Tolerance(sampled=1e-9, exact=1e-9)  # of a study from another package


def tolerance(study: str) -> Tolerance:
    """How far a study's numbers may differ between platforms."""
    return TOLERANCES.get(study, PACKAGE_TOLERANCE)


EXACT_COLUMNS = ("exact_sigma", "bound", "exact_bias", "exact_percent", "posterior_crb", "floor")
LABELS_DIFFER = (float("inf"), float("inf"))
FIRST_NUMBER = {"curves": "sigma", "gains": "gain_percent"}  # columns before it are labels and counts


@dataclass(frozen=True)
class Verdict:
    """The outcome of a study's case, and whether it is as expected."""

    study: str
    good: bool
    words: str


def compute_tables(study: str) -> dict[str, bytes]:
    """The tables of a study's known case, as computed here: CSV by name."""
    from radarsim.report.csv_text import to_csv

    result = run.run(KNOWN_FOLDER / f"{study}.yaml", threads=1)
    return {name: to_csv(result.tables[name]) for name in TABLES}


def verdicts() -> list[Verdict]:
    """A verdict for each study. An unusable package is reported, but is not damage."""
    same_platform = platform() == json.loads((KNOWN_FOLDER / "platform.json").read_text())
    broken = registry.unusable_studies()
    return [
        *(verdict(study, compute_tables(study), same_platform) for study in TOLERANCES),
        *(
            Verdict(name, True, f"{registry.package(name)}: loads")
            for name in registry.package_study_names()
            if name not in broken
        ),
        *(Verdict(name, True, f"cannot be used: {words}") for name, words in broken.items()),
    ]


def verdict(study: str, computed: dict[str, bytes], same_platform: bool) -> Verdict:
    """Compare tables with the known ones."""
    known_tables = {name: (KNOWN_FOLDER / f"{study}.{name}.csv").read_bytes() for name in TABLES}
    if computed == known_tables:
        return Verdict(study, True, "the known bytes")
    allowed, differences = TOLERANCES[study], [distances(name, computed[name], known_tables[name]) for name in TABLES]
    sampled, exact = (max(pair) for pair in zip(*differences, strict=True))
    if sampled > allowed.sampled or exact > allowed.exact:
        words = f"differs from the known answer by {sampled:.1e} of sigma (exact values {exact:.1e}); "
        return Verdict(study, False, words + f"at most {allowed.sampled:.0e} ({allowed.exact:.0e}) is rounding")
    words = f"the known numbers to {max(sampled, exact):.1e} of sigma"
    return Verdict(
        study, True, words + (", not the known bytes, though the platform is the same" if same_platform else "")
    )


def distances(table: str, computed: bytes, expected: bytes) -> tuple[float, float]:
    """The largest differences of two tables' sampled and exact numbers, in σ or 100 %; infinite where labels differ."""
    computed_rows, expected_rows = (list(csv.DictReader(io.StringIO(text.decode()))) for text in (computed, expected))
    if len(computed_rows) != len(expected_rows):
        return LABELS_DIFFER
    largest = {"sampled": 0.0, "exact": 0.0}
    centre = FIRST_NUMBER[table]
    for row, expected_row in zip(computed_rows, expected_rows, strict=True):
        columns = list(expected_row)
        numbers = [name for name in columns[columns.index(centre) :] if name not in ("floor_kind", "note")]
        if any(row.get(name) != expected_row[name] for name in columns if name not in (*numbers, "note")):
            return LABELS_DIFFER
        scale = float(expected_row["sigma"] or 1) if table == "curves" else 100.0
        for name in numbers:
            if (row.get(name) or "") == expected_row[name]:
                continue
            if not (row.get(name) and expected_row[name]):
                return LABELS_DIFFER
            number_scale = max(scale, abs(float(expected_row[name])))  # ends of intervals may lie far above σ
            value, expected_value = (
                _comparable_number(name, float(r[name]) / number_scale, float(r[centre] or 0) / number_scale)
                for r in (row, expected_row)
            )
            kind = "exact" if name in EXACT_COLUMNS else "sampled"
            largest[kind] = max(largest[kind], abs(value - expected_value))
    return largest["sampled"], largest["exact"]


def _comparable_number(name: str, value: float, centre: float) -> float:
    """The number by which a column is compared; see `Tolerance`."""
    if name in ("spread", "bias_se"):
        return value**2
    return (value - centre) ** 2 if name.endswith(("_lo", "_hi")) else value


def write_known_tables() -> None:
    """Make the known tables again, on this platform."""
    tables_by_study = {study: compute_tables(study) for study in TOLERANCES}
    contents = {
        f"{study}.{name}.csv": content
        for study, study_tables in tables_by_study.items()
        for name, content in study_tables.items()
    }
    atomic_files.replace_all(
        KNOWN_FOLDER, contents | {"platform.json": (json.dumps(platform(), indent=2) + "\n").encode()}
    )


if __name__ == "__main__":
    write_known_tables()
