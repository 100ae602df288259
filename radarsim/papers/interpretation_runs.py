"""The runs that a paper's interpretations need, each once, judged as soon as it finishes."""

from collections.abc import Collection, Iterable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial

from radarsim.api import configs, result_content, simulate_cases
from radarsim.api.case_work import CaseWork
from radarsim.api.progress import Progress, TimedProgress, estimate_seconds
from radarsim.api.simulate_cases import RunOptions, SimulatedCases
from radarsim.api.stored_runs import stored_realisations
from radarsim.config.experiment import Case, Experiment
from radarsim.engine.machine import available_cores
from radarsim.engine.stop_conditions import Signals
from radarsim.errors import ConfigError, TargetUnmet
from radarsim.papers.claim import Claim
from radarsim.papers.evidence import interpreted_case, shipped_spec
from radarsim.papers.interpretations import ChangedResults, ImpossibleInterpretation, Interpretation
from radarsim.papers.open_papers import JudgingRequest
from radarsim.papers.verdict_rule import UNDECIDED
from radarsim.papers.verdicts_by_interpretation import ClaimVerdicts, InterpretationVerdict, judge_claim
from radarsim.report.precision import look_counts
from radarsim.report.user_filters import rows as user_filters_rows
from radarsim.report.user_filters import tables as user_filters_tables

# Expected seconds of judging a run, of an exact verdict and of a figure, until some are measured.
RUN_JUDGED_S, VERDICT_S, FIGURE_S = 0.05, 0.001, 0.13
LATER_LOOK_SHARE = 0.5  # of the time of all first runs, expected of each later look: fewer of them, and longer


class InterpretationRuns:
    """The runs that a paper's interpretations need, each once, and the verdicts from them. A run is judged as soon as
    it is done and then dropped: memory is that of one run, however many interpretations there are. Where a larger run
    is stored, it is judged in place of a smaller one."""

    def __init__(self, request: JudgingRequest, realisations: int):
        self._request, self._paper, self._realisations = request, request.paper, realisations
        self._experiments: dict[str, Experiment] = {}
        self._case_pairs: dict[tuple[str, ...], list[tuple[Case, Case]]] = {}  # key: original and changed cases
        self._run_of: dict[tuple[str, Interpretation], tuple[str, ...]] = {}
        self._impossible: dict[tuple[str, Interpretation], str] = {}
        self._verdicts: dict[tuple[str, Interpretation], InterpretationVerdict] = {}
        self._claims = {claim.id: claim for claim in request.claims}
        self._seconds: dict[tuple[str, str], float] = {}  # of a realisation, by config and case
        self._pending: dict[tuple[str, ...], None] = {}  # keys of the runs ahead
        self._later_looks, self._look_seconds = 0, 0.0  # later looks ahead, and the expected seconds of each
        for claim in request.claims:
            for interpretation in self._paper.interpretations.for_claim(claim.id):
                if not self._paper.interpretations.is_exact(claim, interpretation):
                    self._add(claim, interpretation)

    def _add(self, claim: Claim, interpretation: Interpretation) -> None:
        try:
            pairs = [
                (case, replace(changed, realisations=self._realisations))
                for case in self._experiment(claim.config).cases
                if (changed := self._paper.interpretations.changed_case(claim, case, interpretation)) is not None
            ]
            key = (claim.config, *(f"{case.name}: {changed.spec!r}" for case, changed in pairs))
        except ImpossibleInterpretation as error:
            self._impossible[claim.id, interpretation] = str(error)
            return
        self._run_of[claim.id, interpretation] = key
        self._case_pairs[key] = pairs

    def _experiment(self, config: str) -> Experiment:
        if config not in self._experiments:
            self._experiments[config] = configs.load(configs.shipped_file(config) or config)
        return self._experiments[config]

    def forecast_runs(self, forecast: TimedProgress, max_realisations: int) -> None:
        """Add the runs, verdicts, and looks up to so many realisations that are ahead."""
        self._later_looks = sum(n > self._realisations for n in look_counts(max_realisations))
        self._expect_runs(forecast, self._case_pairs)
        for claim in self._request.claims:
            interpretations = self._paper.interpretations.for_claim(claim.id)
            forecast.add(
                f"verdict of {claim.id}",
                VERDICT_S,
                sum((claim.id, interpretation) not in self._run_of for interpretation in interpretations),
            )

    def _expect_runs(self, forecast: TimedProgress, keys: Iterable[tuple[str, ...]]) -> None:
        self._pending = dict.fromkeys(keys)
        for key in self._pending:
            forecast.add(f"judging of {key[0]}", RUN_JUDGED_S)
            forecast.add(self._forecast_name(key), 1.0, self._expected_seconds(key))

    def estimate(self, forecast: TimedProgress, threads: int | None) -> None:
        """Measure a few realisations of every case as shipped, and add the seconds of the runs ahead."""
        cases = {(key[0], case.name): case for key in self._pending for case, _ in self._case_pairs[key]}
        realisations = self._realisations * (available_cores() if threads is None else max(threads, 1))
        seconds_of_case = estimate_seconds(
            {case_key: (CaseWork(case), self._realisations) for case_key, case in cases.items()}
        )
        self._seconds = {case_key: seconds / realisations for case_key, seconds in seconds_of_case.items()}
        for key in self._pending:
            forecast.add(self._forecast_name(key), 1.0, self._expected_seconds(key))
        self._look_seconds = LATER_LOOK_SHARE * sum(map(self._expected_seconds, self._case_pairs))
        self._expect_looks(forecast, self._later_looks)

    def _expect_looks(self, forecast: TimedProgress, count: int) -> None:
        forecast.add("later looks", 1.0, self._look_seconds * count)

    def _forecast_name(self, key: tuple[str, ...]) -> str:
        """A name for runs that take similar times: an interpretation may change what a case takes, but hardly that of
        other cases."""
        return ", ".join(("run of", key[0], *(case.name for case, _ in self._case_pairs[key])))

    def _expected_seconds(self, key: tuple[str, ...]) -> float:
        """Expected seconds of a run; 0 before `estimate`."""
        return (
            sum(self._seconds.get((key[0], case.name), 0.0) for case, _ in self._case_pairs[key]) * self._realisations
        )

    def judge(self, options: RunOptions, forecast: TimedProgress, stop: Signals | None) -> list[ClaimVerdicts]:
        """Every claim under every interpretation."""
        for key, pairs in self._case_pairs.items():
            try:
                self._run_and_judge(key, pairs, options, forecast, stop)
            except ConfigError as error:
                self._note_impossible(key, error.lines[0])
                forecast.add(f"judging of {key[0]}", RUN_JUDGED_S, -1)
        claims = list[ClaimVerdicts]()
        for claim in self._request.claims:
            verdicts = []
            for interpretation in self._paper.interpretations.for_claim(claim.id):
                has_run = (claim.id, interpretation) in self._run_of
                with nullcontext() if has_run else forecast.measure_unit(f"verdict of {claim.id}"):
                    verdicts.append(self._verdict(claim, interpretation))
            claims.append(ClaimVerdicts(self._paper.interpretations, claim, tuple(verdicts)))
        return claims

    def decide(
        self,
        claims: list[ClaimVerdicts],
        max_realisations: int,
        options: RunOptions,
        forecast: TimedProgress,
        stop: Signals | None,
    ) -> list[ClaimVerdicts]:
        """The claims again, undecided ones after longer runs of the interpretations that leave them undecided. Looks
        are at declared numbers only, as in `run --decide`; each claim is judged at its own last look, so that other
        requests change nothing."""
        for n in (n for n in look_counts(max_realisations) if n > self._realisations):
            undecided = {
                (claim.claim.id, verdict.interpretation)
                for claim in claims
                if claim.outcome is not None and claim.outcome.kind == UNDECIDED
                for verdict in claim.undecided
            }
            keys = dict.fromkeys(key for subject, key in self._run_of.items() if subject in undecided)
            if not keys:
                break
            self._realisations = n
            self._later_looks -= 1
            self._expect_looks(forecast, -1)
            self._expect_runs(forecast, keys)
            for key in keys:
                pairs = [(case, replace(changed, realisations=n)) for case, changed in self._case_pairs[key]]
                self._run_and_judge(key, pairs, options, forecast, stop, undecided)
            claims = [
                replace(
                    claim,
                    verdicts=tuple(self._verdict(claim.claim, verdict.interpretation) for verdict in claim.verdicts),
                )
                for claim in claims
            ]
        self._expect_looks(forecast, -self._later_looks)
        self._later_looks = 0
        return claims

    def _run_and_judge(
        self,
        key: tuple[str, ...],
        pairs: Sequence[tuple[Case, Case]],
        options: RunOptions,
        forecast: TimedProgress,
        stop: Signals | None,
        judged_only: Collection[tuple[str, Interpretation]] | None = None,
    ) -> None:
        """Run or continue the cases of a key, and judge what they show; judged_only: for these claims and
        interpretations."""
        progress = forecast.run_callback(self._forecast_name(key), partial(self._expected_seconds, key))
        try:
            simulated = self._run(key, pairs, options, progress)
        except ConfigError:
            progress(1, 1, 1)  # nothing of it is ahead
            raise
        except TargetUnmet:
            if stop is not None:
                stop.raise_if_received()
            raise
        finally:
            del self._pending[key]
        with forecast.measure_unit(f"judging of {key[0]}"):
            results = self._changed_results(pairs, simulated)
            for subject in (
                subject
                for subject, run_key in self._run_of.items()
                if run_key == key and (judged_only is None or subject in judged_only)
            ):
                self._verdicts[subject] = self._judge(self._claims[subject[0]], subject[1], results)

    def _run(
        self, key: tuple[str, ...], pairs: Sequence[tuple[Case, Case]], options: RunOptions, progress: Progress
    ) -> SimulatedCases:
        changed_cases = [changed_case for _, changed_case in pairs]
        n = max(self._realisations, stored_realisations(changed_cases, options.out))
        changed_cases = [replace(case, realisations=max(n, case.realisations)) for case in changed_cases]
        experiment = replace(self._experiment(key[0]), cases=tuple(changed_cases), realisations=n)
        simulated = simulate_cases.simulate(experiment, options, progress=progress)
        if simulated.stopped:
            raise TargetUnmet(f"interpretations: {simulated.stopped}: the same command continues")
        return simulated

    def _changed_results(self, pairs: Sequence[tuple[Case, Case]], simulated: SimulatedCases) -> ChangedResults:
        results = simulate_cases.collected_results(simulated)
        user_rows = user_filters_tables.measured_rows(results)
        tables = user_filters_rows.tables_for_claims(result_content.measured_tables(results), user_rows)
        originals = [interpreted_case(changed, case.spec) for changed, (case, _) in zip(results, pairs, strict=True)]
        may_grow = self._paper.claims.may_grow
        places = {
            changed.name: {key: set(range(len(getattr(shipped_spec(changed), key)))) for key in may_grow}
            for changed in originals
        }
        return ChangedResults(originals, results, tables, places)

    def _note_impossible(self, key: tuple[str, ...], why: str) -> None:
        """A run that could not be prepared: a target that hits the ground, an impossible schedule."""
        for subject, run_key in list(self._run_of.items()):
            if run_key == key:
                self._impossible[subject] = why

    def _verdict(self, claim: Claim, interpretation: Interpretation) -> InterpretationVerdict:
        """A claim under an interpretation: the verdict of its run, or the exact one, or why there is none."""
        subject = claim.id, interpretation
        if subject not in self._verdicts:
            self._verdicts[subject] = self._judge(claim, interpretation, None)
        return self._verdicts[subject]

    def _judge(
        self, claim: Claim, interpretation: Interpretation, results: ChangedResults | None
    ) -> InterpretationVerdict:
        interpretations = self._paper.interpretations
        why = self._impossible.get((claim.id, interpretation))
        if why is None:
            try:
                evidence = interpretations.evidence(claim, interpretation, results, self._paper.claims)
                return judge_claim(
                    interpretations,
                    claim,
                    interpretation,
                    evidence,
                    min(result.count for result in results.run_results) if results else 0,
                )
            except ImpossibleInterpretation as error:
                why = str(error)
        return InterpretationVerdict(
            claim, interpretation, interpretations.name(interpretation), interpretations.kind(interpretation), why=why
        )
