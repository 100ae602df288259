"""What claims add to studies, runs, reports and commands; imports are inside, so that a list of configs stays quick."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.extensions import Extension, IndexEntry, ReportSection

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.api.result import Result
    from radarsim.api.simulate_cases import RunOptions, SimulatedCases
    from radarsim.config.experiment import Experiment
    from radarsim.engine.results import CaseResult
    from radarsim.extensions import Tables
    from radarsim.report.drawing.model import Figure

CLAIMS = "claims"  # the table, and the figure
MAX_CLAIMS_WITHOUT_FIGURE = 3  # their verdicts are clearer than a figure


class UntilDecided:
    """The rule that ends a run when each claim of its config is decided."""

    help = "Run until each claim of the config is decided, at most N realisations."

    def check(self, experiment: "Experiment") -> None:
        from radarsim.papers import run_until_decided

        run_until_decided.check_config_has_claims(experiment)

    def simulate(self, experiment: "Experiment", options: "RunOptions", progress: Any) -> "SimulatedCases":
        from radarsim.papers import run_until_decided

        return run_until_decided.simulate_until_decided(experiment, options, progress)

    def unmet(self, experiment: "Experiment", simulated: "SimulatedCases") -> list[str]:
        from radarsim.papers import run_until_decided

        return run_until_decided.undecided_messages(experiment, simulated)


class PapersExtension(Extension):
    """Claims of papers: claims.csv, its part of the report, `claims`, `interpretations` and `run --decide`."""

    command_sections: Mapping[str, Mapping[str, str]] = {
        "The papers": dict.fromkeys(("claims", "interpretations"), "radarsim.papers.commands")
    }
    figure_names = (CLAIMS,)
    table_names = (CLAIMS,)
    columns_from_elsewhere: Mapping[str, Sequence[str]] = {CLAIMS: ("overall", "class", "as_shipped", "declared")}
    stop_rule = UntilDecided()

    def study_label(self, study: Any) -> str:
        from radarsim.papers import paper_keys

        return paper_keys.paper_key(study)

    def check_study(self, study: Any) -> None:
        if getattr(study, "claims_yaml", ""):
            from radarsim.papers import study_claims

            study_claims.check_declarations(study)

    def study_faults(self, study: Any, shipped: Any) -> Sequence[str]:
        from radarsim.papers import study_claims

        return study_claims.claim_faults(study, shipped)

    def tables(
        self, results: "Sequence[CaseResult]", measured: "Tables", user_filters: "Tables", stem: str
    ) -> "dict[str, pd.DataFrame]":
        from radarsim.papers import result_claims

        return {CLAIMS: result_claims.claims_of_results(results, measured, user_filters, stem)}

    def updated_tables(self, tables: "Tables", study_name: str, out: Path) -> "dict[str, pd.DataFrame]":
        from radarsim.papers import result_claims

        return {CLAIMS: result_claims.with_stored_classes(tables[CLAIMS], study_name, out)}

    def stored_tables(self, tables: "Tables", study_name: str) -> "dict[str, pd.DataFrame]":
        from radarsim.papers import result_claims

        if CLAIMS not in tables:
            return {}
        return {CLAIMS: result_claims.without_outdated_verdicts(tables[CLAIMS], study_name)}

    def figures(self, tables: "Tables") -> "dict[str, Figure]":
        claims = tables[CLAIMS]
        if claims["claim"].nunique() <= MAX_CLAIMS_WITHOUT_FIGURE:
            return {}
        from radarsim.papers.forest_plot import forest_plot

        rows: Any = claims.to_dict("records")
        figure = forest_plot(rows)
        return {} if figure is None else {CLAIMS: figure}

    def disagreements(self, tables: "Tables") -> Sequence[str]:
        from radarsim.papers import claims_table

        return claims_table.disagreements(tables[CLAIMS])

    def author_errors(self, tables: "Tables") -> Sequence[str]:
        from radarsim.papers import claims_table

        return claims_table.failed_measures(tables[CLAIMS])

    def report_section(
        self,
        tables: "Tables",
        titles: Mapping[str, str],
        sources: Mapping[str, Sequence[str]],
        written: Collection[str],
        study_name: str,
    ) -> ReportSection | None:
        from radarsim.papers import report_section

        return report_section.claims_section(tables, titles, sources, written, study_name)

    def index_entry(self, folder: Path) -> IndexEntry | None:
        from radarsim.papers import report_section

        return report_section.index_entry(folder)

    def result_document(self, result: "Result") -> dict[str, Any]:
        from radarsim.papers import result_claims

        verdicts = result_claims.claims_by_class
        return {"claims": verdicts(result), "claims_as_shipped": verdicts(result, "as_shipped")}

    def result_lines(self, result: "Result") -> Sequence[tuple[str, str]]:
        from radarsim.papers import print_claims

        return print_claims.verdict_lines(result)

    def result_summary(self, result: "Result") -> str:
        from radarsim.papers import result_claims
        from radarsim.papers.claim_rows import class_count

        by_class = result_claims.claims_by_class(result)
        counts = ", ".join(class_count(kind, len(names)) for kind, names in by_class.items())
        return f"claims: {counts}" if counts else ""

    def overall_summary(self, out: str) -> Sequence[str]:
        from radarsim.papers.claim_rows import classes_in_words, count_classes
        from radarsim.papers.list_claims import claims

        rows = claims(out=out).rows
        classes, _ = count_classes(rows)
        return [f"claims   {sum(classes.values())}: {classes_in_words(rows)}"]


EXTENSION = PapersExtension()
