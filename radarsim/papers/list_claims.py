"""`radarsim claims`: the claims of papers with their verdicts from stored results."""

import os
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from radarsim.api import arguments, configs, repeat_command
from radarsim.api.display import Displayable
from radarsim.api.load_experiments import load_all
from radarsim.config.experiment import Experiment
from radarsim.errors import ConfigError, argument
from radarsim.language.translate import tr
from radarsim.papers.claim import PaperClaims
from radarsim.papers.claim_rows import classes_in_words, group_by_claim, verdict_sentence
from radarsim.papers.claims_table import claim_rows, rows_without_results
from radarsim.papers.interpretations import PaperInterpretations
from radarsim.papers.open_papers import open_papers
from radarsim.papers.outdated_verdicts import current_marks, current_rows
from radarsim.papers.paper_keys import paper_key
from radarsim.papers.stored_verdicts import known_classes, stored_claims
from radarsim.papers.study_claims import by_study, claims_of, paper_claims
from radarsim.papers.verdict_classes import add_classes, rows_in_words
from radarsim.report import atomic_files
from radarsim.report.csv_text import read_rows
from radarsim.studies import registry

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.report.drawing.model import Figure


# P1.3 and P4, known or not; lower case and names joined by commas are understood.
CLAIM_PATTERN = re.compile(r"P\d+(\.\w*)?|[Pp]\d+(\.[Ee]?\d+\w?)?(,.+)?")


class Claims(Displayable):
    """Claims of papers and their verdicts; a row for each measured part of a claim. own_claims: those of the user."""

    def __init__(
        self,
        rows: Sequence[dict[str, Any]],
        interpretations: Iterable[PaperInterpretations] = (),
        own_claims: Collection[str] = (),
    ):
        self.rows, self._interpretations = tuple(rows), tuple(interpretations)
        self.own_claims = own_claims

    @property
    def in_words(self) -> list[dict[str, Any]]:
        """The rows for people: what a claim depends on is in words, not in keys."""
        return rows_in_words(self.rows, self._interpretations)

    @property
    def table(self) -> "pd.DataFrame":
        """The columns of claims.csv, and `config`, which judges the claim."""
        return read_rows(self.rows, self.rows[0] if self.rows else ())

    @property
    def _figures_by_name(self) -> "Mapping[str, Figure]":
        from radarsim.papers.forest_plot import forest_plot

        figure = forest_plot(self.rows)
        return {} if figure is None else {"claims": figure}

    def _answer_lines(self) -> list[str]:
        lines = [classes_in_words(self.rows)] if self.rows else []
        for parts in group_by_claim(self.in_words):
            verdict = verdict_sentence(parts).replace("*", "")
            lines.append(f"{parts[0]['claim']} {verdict}: {tr(parts[0]['statement'])}")
        return lines

    def draw(self, path: str | os.PathLike[str]) -> None:
        """Write the figure to a file. Raises ConfigError if the name has no known format or no claim is judged."""
        from radarsim.report.drawing.canvas import save

        kind, figures = Path(path).suffix[1:].lower(), self._figures_by_name
        if kind not in arguments.FORMATS:
            raise ConfigError(f"{path}: must end in {', '.join(f'.{name}' for name in arguments.FORMATS)}")
        if not figures:
            raise ConfigError(f"{path}: no claim is judged here, so there is nothing to draw")
        atomic_files.replace_all(Path(path).parent, {Path(path).name: save(figures["claims"], (kind,))[kind]})


def claims(
    *names: str, out: str | os.PathLike[str] = repeat_command.RESULTS, also: str | os.PathLike[str] | None = None
) -> Claims:
    """List the papers' claims with verdicts from the results stored in `out`; computes nothing.

    names are claims (P1.3), papers (P1) or configs; default: all claims of all papers. `table` has a row for each
    measured part of a claim: measured value, 95 % interval, expected value, verdict. Claims without stored results are
    listed as not run; for a config that judges none, those of its study's paper, with the reason why it does not judge
    each. also: a YAML file of claims of yours, judged on the stored runs of the configs. Raises ConfigError for unknown
    names. The attribute `judge` judges claims of yours on any table.

    >>> listed = claims("P1.3", out="/nowhere")
    >>> listed.table["verdict"].tolist()
    ['not run']
    """
    arguments.check_arguments(out=out)
    arguments.check_texts(names)
    claim_names = [name for name in names if _is_meant_as_claim(name)]
    _check_claim_names(claim_names)
    experiments = load_all([name for name in names if name not in claim_names])
    own_rows = [] if also is None else _own_claim_rows(experiments, also, out)
    keys = _paper_keys(claim_names) + [paper_key(registry.study(experiment.study)) for experiment in experiments]
    papers = paper_claims(keys)
    config_of = {claim.id: claim.config for paper in papers for claim in paper.claims}
    requested = [
        claim for claim in config_of if not names or claim in claim_names or claim.partition(".")[0] in claim_names
    ]
    stems = dict.fromkeys(
        [*(experiment.stem for experiment in experiments), *(config_of[claim] for claim in requested)]
    )
    marks = {
        name: mark for of_study in by_study(current_marks, keys).values() for name, mark in (of_study or {}).items()
    }
    stored = {
        stem: current_rows(rows, papers, marks)
        for stem in stems
        if (rows := stored_claims(Path(out) / stem)) is not None
    }
    rows = [row for experiment in experiments for row in _experiment_rows(experiment, papers, stored)]
    listed = {(row["claim"], row["config"]) for row in rows}
    requested_rows = [row for row in claim_rows(papers, stored) if row["claim"] in requested]
    rows += [row for row in requested_rows if (row["claim"], row["config"]) not in listed]
    with_choices = [(paper.interpretations, paper.claims) for paper in open_papers(keys).values()]
    classes = known_classes(with_choices, Path(out))
    own_names = [row["claim"] for row in own_rows]
    interpretations = [interpretations for interpretations, _ in with_choices]
    return Claims(add_classes(rows, classes) + own_rows, interpretations, own_names)


def _own_claim_rows(
    experiments: Sequence[Experiment], also: str | os.PathLike[str], out: str | os.PathLike[str]
) -> list[dict[str, Any]]:
    """The rows of a user's claims on the stored runs of experiments."""
    from radarsim.papers import own_claims

    if not experiments:
        raise ConfigError(f"{argument('also')}: needs a CONFIG, on whose stored run the claims are judged")
    return [row for experiment in experiments for row in own_claims.rows_on_stored_run(experiment, also, out)]


def judge_table(
    claims: str | os.PathLike[str],
    table: "pd.DataFrame | Mapping[str, Any] | str | os.PathLike[str]",
    measures: ModuleType | None = None,
) -> Claims:
    """Judge claims on a table, without a study: by the rule, and with the columns, of claims.csv.

    claims: a YAML file, or its text. table: a DataFrame, its columns, or a CSV file. A part of a claim names rows by
    their cells (`of: [{filter: ekf}]`) and a measure: `value`, `ratio` and `difference` of numbers in single rows,
    `mean`, `median`, `variance` and `rms` of a column over rows that are runs, or a function of `measures`, or of a
    module of the same name beside the file, whose first argument is `evidence`. Raises ConfigError for mistakes in the
    claims or the table.

    >>> text = '''
    ... paper: mine
    ... claims:
    ... - id: 1
    ...   place: table 1
    ...   statement: The error of the extended filter is 0.374
    ...   parts:
    ...   - {of: [{filter: ekf}], what: mean error, measure: {value: {column: mean}},
    ...      expected: {printed: "0.374", runs: 100, variance: 0.015}}
    ... '''
    >>> judge_table(text, {"filter": ["ekf"], "mean": [0.3806], "mean_lo": [0.3787], "mean_hi": [0.3825]})
    1 confirmed
    mine.1 confirmed: The error of the extended filter is 0.374
    """
    from radarsim.papers import own_claims

    rows = own_claims.rows_on_table(claims, table, measures)
    return Claims(rows, own_claims=[row["claim"] for row in rows])


claims.judge = judge_table  # type: ignore[attr-defined]


def _experiment_rows(
    experiment: Experiment, papers: Sequence[PaperClaims], stored: Mapping[str, Sequence[dict[str, Any]]]
) -> list[dict[str, Any]]:
    """The rows of an experiment's claims: stored, else of the shipped config, else why none is judged."""
    shipped_stem = configs.shipped_stem(experiment)
    rows: Sequence[dict[str, Any]] = stored.get(experiment.stem) or [
        row for row in claim_rows(papers, {}) if row["config"] == shipped_stem
    ]
    if not rows and experiment.cases:
        paper = claims_of(registry.study(experiment.cases[0].study))
        rows = [] if paper is None else rows_without_results(paper, experiment.cases, configs.shipped, shipped_stem)
    return [row | {"config": experiment.stem} for row in rows]


def _is_meant_as_claim(name: str) -> bool:
    """Whether a name has the form of a claim or a paper; a package's claim begins with the key of its paper."""
    if Path(name).is_file():
        return False
    paper, _, number = name.partition(".")
    is_known_paper = paper and number and paper in registry.call_studies(paper_key).values()
    return bool(is_known_paper or CLAIM_PATTERN.fullmatch(name))


def _check_claim_names(names: Sequence[str]) -> None:
    """Raise ConfigError, with the claims or papers that there are, for names that are none."""
    existing = [claim.id for paper in paper_claims(_paper_keys(names)) for claim in paper.claims] if names else []
    if _unknown_claims(names, existing):
        all_claims = [claim.id for paper in paper_claims() for claim in paper.claims]
        raise ConfigError(*_unknown_claims(names, all_claims))


def _unknown_claims(names: Sequence[str], existing: Collection[str]) -> list[str]:
    """A line for each name that has the form of a claim or a paper, but is unknown."""
    lines, papers = [], _paper_keys(existing)
    for name in names:
        paper = name.partition(".")[0]
        if name in existing or name in papers:
            continue
        if (suggestion := name.rstrip(".").upper()) in (*existing, *papers):
            lines.append(f"claims: {name} is no claim and no paper; did you mean {suggestion}?")
        elif paper in papers:
            allowed = [claim for claim in existing if claim.startswith(f"{paper}.")]
            lines.append(f"claims: {name} is no claim of {paper}; its claims: {', '.join(allowed)}")
        else:
            lines.append(f"claims: {name} is no claim and no paper; papers: {', '.join(papers)}")
    return lines


def _paper_keys(claim_names: Iterable[str]) -> list[str]:
    """The papers of claims: P1 of P1.4."""
    return sorted({claim.partition(".")[0] for claim in claim_names})
