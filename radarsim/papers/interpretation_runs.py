"""The runs that a paper's interpretations need, each once, judged as soon as it finishes."""

from collections.abc import Collection, Iterable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial

from radarsim.app import configs, result, run
from radarsim.app.ahead import Ahead, Progress, estimated
from radarsim.app.case_work import CaseWork
from radarsim.app.run import RunOptions, SimulatedCases
from radarsim.config.experiment import Case, Experiment
from radarsim.engine.machine import available_cores
from radarsim.engine.run import Signals
from radarsim.errors import ConfigError, TargetUnmet
from radarsim.papers.claim import Claim
from radarsim.papers.interpretations import ChangedResults, ImpossibleInterpretation, Interpretation
from radarsim.papers.open_papers import JudgingRequest
from radarsim.papers.verdict_rule import UNDECIDED
from radarsim.papers.verdicts_by_interpretation import ClaimVerdicts, InterpretationVerdict, judge_under
from radarsim.report.precision import looks

# Expected seconds of judging a run, of an exact verdict and of a figure, until some are measured.
RUN_JUDGED_S, VERDICT_S, FIGURE_S = 0.05, 0.001, 0.13
LATER_LOOK_SHARE = 0.5  # of the time of all first runs, expected of each later look: fewer of them, and longer


class InterpretationRuns:
    """The runs that a paper's interpretations need, each once, and the verdicts from them. A run is judged as soon as
    it is done and then dropped: memory is that of one run, however many interpretations there are."""

    def __init__(self, wanted: JudgingRequest, realisations: int):
        self._wanted, self._paper, self._n = wanted, wanted.paper, realisations
        self._experiments: dict[str, Experiment] = {}
        self._jobs: dict[tuple[str, ...], list[tuple[Case, Case]]] = {}  # key: original and changed cases
        self._key: dict[tuple[str, Interpretation], tuple[str, ...]] = {}
        self._impossible: dict[tuple[str, Interpretation], str] = {}
        self._judged: dict[tuple[str, Interpretation], InterpretationVerdict] = {}
        self._claims = {claim.id: claim for claim in wanted.claims}
        self._seconds: dict[tuple[str, str], float] = {}  # of a realisation, by config and case
        self._open: dict[tuple[str, ...], None] = {}  # keys of the runs ahead
        self._looks, self._look_s = 0, 0.0  # later looks ahead, and the expected seconds of each
        for claim in wanted.claims:
            for interpretation in self._paper.interpretations.of_claim(claim.id):
                if not self._paper.interpretations.exact(claim, interpretation):
                    self._add(claim, interpretation)

    def _add(self, claim: Claim, interpretation: Interpretation) -> None:
        try:
            pairs = [
                (case, replace(changed, realisations=self._n))
                for case in self._experiment(claim.config).cases
                if (changed := self._paper.interpretations.changed(claim, case, interpretation)) is not None
            ]
            key = (claim.config, *(f"{case.name}: {changed.spec!r}" for case, changed in pairs))
        except ImpossibleInterpretation as error:
            self._impossible[claim.id, interpretation] = str(error)
            return
        self._key[claim.id, interpretation] = key
        self._jobs[key] = pairs

    def _experiment(self, config: str) -> Experiment:
        if config not in self._experiments:
            self._experiments[config] = configs.load(configs.shipped_file(config) or config)
        return self._experiments[config]

    def expect(self, ahead: Ahead, most: int) -> None:
        """Add the runs, verdicts, and looks up to so many realisations that are ahead."""
        self._looks = sum(n > self._n for n in looks(most))
        self._expect_runs(ahead, self._jobs)
        for claim in self._wanted.claims:
            own = self._paper.interpretations.of_claim(claim.id)
            ahead.add(f"verdict of {claim.id}", VERDICT_S, sum((claim.id, one) not in self._key for one in own))

    def _expect_runs(self, ahead: Ahead, keys: Iterable[tuple[str, ...]]) -> None:
        self._open = dict.fromkeys(keys)
        for key in self._open:
            ahead.add(f"judging of {key[0]}", RUN_JUDGED_S)
            ahead.add(self._kind(key), 1.0, self._expected(key))

    def estimate(self, ahead: Ahead, threads: int | None) -> None:
        """Measure a few realisations of every case as shipped, and add the seconds of the runs ahead."""
        cases = {(key[0], case.name): case for key in self._open for case, _ in self._jobs[key]}
        each = self._n * (available_cores() if threads is None else max(threads, 1))
        timed = estimated({of: (CaseWork(case), self._n) for of, case in cases.items()})
        self._seconds = {of: seconds / each for of, seconds in timed.items()}
        for key in self._open:
            ahead.add(self._kind(key), 1.0, self._expected(key))
        self._look_s = LATER_LOOK_SHARE * sum(map(self._expected, self._jobs))
        self._expect_looks(ahead, self._looks)

    def _expect_looks(self, ahead: Ahead, count: int) -> None:
        ahead.add("later looks", 1.0, self._look_s * count)

    def _kind(self, key: tuple[str, ...]) -> str:
        """What is foretold together: an interpretation may change what a case takes, but hardly that of other cases."""
        return ", ".join(("run of", key[0], *(case.name for case, _ in self._jobs[key])))

    def _expected(self, key: tuple[str, ...]) -> float:
        """Expected seconds of a run; 0 before `estimate`."""
        return sum(self._seconds.get((key[0], case.name), 0.0) for case, _ in self._jobs[key]) * self._n

    def judged(self, options: RunOptions, ahead: Ahead, stop: Signals | None) -> list[ClaimVerdicts]:
        """Every claim under every interpretation."""
        for key, pairs in self._jobs.items():
            try:
                self._see(key, pairs, options, ahead, stop)
            except ConfigError as error:
                self._fail(key, error.lines[0])
                ahead.add(f"judging of {key[0]}", RUN_JUDGED_S, -1)
        found = list[ClaimVerdicts]()
        for claim in self._wanted.claims:
            verdicts = []
            for interpretation in self._paper.interpretations.of_claim(claim.id):
                run_for = (claim.id, interpretation) in self._key
                with nullcontext() if run_for else ahead.doing(f"verdict of {claim.id}"):
                    verdicts.append(self._under(claim, interpretation))
            found.append(ClaimVerdicts(self._paper.interpretations, claim, tuple(verdicts)))
        return found

    def decided(
        self, over: list[ClaimVerdicts], most: int, options: RunOptions, ahead: Ahead, stop: Signals | None
    ) -> list[ClaimVerdicts]:
        """The claims again, undecided ones after longer runs of the interpretations that leave them undecided. Looks
        are at declared numbers only, as in `run --decide`; each claim is judged at its own last look, so that other
        requests change nothing."""
        for n in (n for n in looks(most) if n > self._n):
            open_ = {
                (one.claim.id, each.interpretation)
                for one in over
                if one.outcome is not None and one.outcome.kind == UNDECIDED
                for each in one.undecided
            }
            keys = dict.fromkeys(key for place, key in self._key.items() if place in open_)
            if not keys:
                break
            self._n = n
            self._looks -= 1
            self._expect_looks(ahead, -1)
            self._expect_runs(ahead, keys)
            for key in keys:
                pairs = [(case, replace(changed, realisations=n)) for case, changed in self._jobs[key]]
                self._see(key, pairs, options, ahead, stop, open_)
            over = [
                replace(one, under=tuple(self._under(one.claim, own.interpretation) for own in one.under))
                for one in over
            ]
        self._expect_looks(ahead, -self._looks)
        self._looks = 0
        return over

    def _see(
        self,
        key: tuple[str, ...],
        pairs: Sequence[tuple[Case, Case]],
        options: RunOptions,
        ahead: Ahead,
        stop: Signals | None,
        only: Collection[tuple[str, Interpretation]] | None = None,
    ) -> None:
        """Run or continue the cases of a key, and judge what they show; `only`: for these places."""
        progress = ahead.running(self._kind(key), partial(self._expected, key))
        try:
            done = self._run(key, pairs, options, progress)
        except ConfigError:
            progress(1, 1, 1)  # nothing of it is ahead
            raise
        except TargetUnmet:
            if stop is not None:
                stop.raise_if_received()
            raise
        finally:
            del self._open[key]
        with ahead.doing(f"judging of {key[0]}"):
            seen = self._seen(pairs, done)
            for place in (place for place, own in self._key.items() if own == key and (only is None or place in only)):
                self._judged[place] = self._judge(self._claims[place[0]], place[1], seen)

    def _run(
        self, key: tuple[str, ...], pairs: Sequence[tuple[Case, Case]], options: RunOptions, progress: Progress
    ) -> SimulatedCases:
        changed = tuple(other for _, other in pairs)
        experiment = replace(self._experiment(key[0]), cases=changed, realisations=self._n)
        simulated = run.simulate(experiment, options, progress=progress)
        if simulated.stopped:
            raise TargetUnmet(f"interpretations: {simulated.stopped}: the same command continues")
        return simulated

    def _seen(self, pairs: Sequence[tuple[Case, Case]], simulated: SimulatedCases) -> ChangedResults:
        results = run.finished(simulated)
        tables = result.measured(results)
        originals = [replace(own, spec=case.spec) for own, (case, _) in zip(results, pairs, strict=True)]
        may_grow = self._paper.claims.may_grow
        places = {own.name: {key: set(range(len(getattr(own.spec, key)))) for key in may_grow} for own in originals}
        return ChangedResults(originals, results, tables, places)

    def _fail(self, key: tuple[str, ...], why: str) -> None:
        """A run that could not be prepared: a target that hits the ground, an impossible schedule."""
        for place, own in list(self._key.items()):
            if own == key:
                self._impossible[place] = why

    def _under(self, claim: Claim, interpretation: Interpretation) -> InterpretationVerdict:
        """A claim under an interpretation: the verdict of its run, or the exact one, or why there is none."""
        place = claim.id, interpretation
        if place not in self._judged:
            self._judged[place] = self._judge(claim, interpretation, None)
        return self._judged[place]

    def _judge(
        self, claim: Claim, interpretation: Interpretation, seen: ChangedResults | None
    ) -> InterpretationVerdict:
        of = self._paper.interpretations
        why = self._impossible.get((claim.id, interpretation))
        if why is None:
            try:
                evidence = of.evidence(claim, interpretation, seen, self._paper.claims)
                return judge_under(
                    of, claim, interpretation, evidence, min(one.count for one in seen.ran) if seen else 0
                )
            except ImpossibleInterpretation as error:
                why = str(error)
        return InterpretationVerdict(claim, interpretation, of.name(interpretation), of.kind(interpretation), why=why)
