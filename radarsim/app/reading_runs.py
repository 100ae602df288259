"""The runs that readings of a paper need, each once, judged as they are done."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

from radarsim.app import configs, output, simulation
from radarsim.app.simulation import RunOptions
from radarsim.config.experiment import Case, Experiment
from radarsim.engine.stopping import Signals
from radarsim.errors import ConfigError, TargetUnmet
from radarsim.report.claims import PaperClaims
from radarsim.report.claims.declared import Claim
from radarsim.report.claims.over import Over, Under, under
from radarsim.report.claims.readings import PaperReadings, Reading, Seen, Unreadable
from radarsim.report.claims.rule import UNDECIDED
from radarsim.report.precision import looks

Progress = Callable[[int, int, int], None]


@dataclass(frozen=True)
class Paper:
    """A paper with readings: what it leaves open, its claims, and the study that judges them."""

    readings: PaperReadings
    claims: PaperClaims
    study: str


@dataclass(frozen=True)
class Asked:
    """What is wanted of a paper: its claims, which readings of them, and whether it is wanted as a whole."""

    paper: Paper
    claims: list[Claim]
    whole: bool
    only: Mapping[str, str] = field(default_factory=dict)

    def readings(self, claim: Claim) -> list[Reading]:
        """The readings of a claim, the default one first, and with `only` those that take these alternatives."""
        default, *others = self.paper.readings.of_claim(claim.id)
        return [default, *(one for one in others if all(one[key] == value for key, value in self.only.items()))]


class Plan:
    """The runs that a paper's readings need, each once, and the verdicts from them.

    A run is judged as soon as it is done, and not kept: memory is that of one, however many readings there are.
    """

    def __init__(self, wanted: Asked, realisations: int):
        self._wanted, self._paper, self._n = wanted, wanted.paper, realisations
        self._experiments: dict[str, Experiment] = {}
        self._jobs: dict[tuple[str, ...], list[tuple[Case, Case]]] = {}  # key: original and changed cases
        self._key: dict[tuple[str, Reading], tuple[str, ...]] = {}
        self._impossible: dict[tuple[str, Reading], str] = {}
        self._judged: dict[tuple[str, Reading], Under] = {}
        self._claims = {claim.id: claim for claim in wanted.claims}
        for claim in wanted.claims:
            for reading in wanted.readings(claim):
                if not self._paper.readings.exact(claim, reading):
                    self._add(claim, reading)

    def _add(self, claim: Claim, reading: Reading) -> None:
        try:
            pairs = [
                (case, replace(changed, realisations=self._n))
                for case in self._experiment(claim.config).cases
                if (changed := self._paper.readings.changed(claim, case, reading)) is not None
            ]
            key = (claim.config, *(f"{case.name}: {changed.spec!r}" for case, changed in pairs))
        except Unreadable as error:
            self._impossible[claim.id, reading] = str(error)
            return
        self._key[claim.id, reading] = key
        self._jobs[key] = pairs

    def _experiment(self, config: str) -> Experiment:
        if config not in self._experiments:
            self._experiments[config] = configs.load(config)
        return self._experiments[config]

    @property
    def total(self) -> int:
        """Realisations over all runs."""
        return sum(len(pairs) for pairs in self._jobs.values()) * self._n

    def judged(self, options: RunOptions, progress: Progress | None, stop: Signals | None) -> list[Over]:
        """Every claim under every reading."""
        done = 0
        for key, pairs in self._jobs.items():
            try:
                self._see(key, pairs, options, _shifted(progress, done), stop)
            except ConfigError as error:
                self._fail(key, error.lines[0])
            done += len(pairs) * self._n
        contradicting = frozenset(choice.key for choice in self._paper.readings.choices if choice.contradicts)
        return [
            Over(claim, tuple(self._under(claim, one) for one in self._wanted.readings(claim)), contradicting)
            for claim in self._wanted.claims
        ]

    def decided(
        self, over: list[Over], most: int, options: RunOptions, progress: Progress | None, stop: Signals | None
    ) -> list[Over]:
        """The claims again, those that are not decided by longer runs of the readings that leave them so.

        They look at declared numbers only, as `run --decide` does; each claim is judged at its own last look, so that
        what else was asked for changes nothing.
        """
        for n in (n for n in looks(most) if n > self._n):
            open_ = {
                (one.claim.id, each.reading)
                for one in over
                if one.outcome is not None and one.outcome.kind == UNDECIDED
                for each in one.undecided
            }
            keys = dict.fromkeys(key for place, key in self._key.items() if place in open_)
            if not keys:
                break
            self._n, total, done = n, sum(len(self._jobs[key]) for key in keys) * n, 0
            for key in keys:
                pairs = [(case, replace(changed, realisations=n)) for case, changed in self._jobs[key]]
                self._see(key, pairs, options, _shifted(progress, done, total), stop, open_)
                done += len(pairs) * n
            over = [replace(one, under=tuple(self._under(one.claim, own.reading) for own in one.under)) for one in over]
        return over

    def _see(
        self,
        key: tuple[str, ...],
        pairs: Sequence[tuple[Case, Case]],
        options: RunOptions,
        progress: Progress | None,
        stop: Signals | None,
        only: Collection[tuple[str, Reading]] | None = None,
    ) -> None:
        """Run the cases of a key, or continue them, and judge what is seen by them, of `only` these places."""
        try:
            seen = self._run(key[0], pairs, options, progress)
        except TargetUnmet:
            if stop is not None:
                stop.raise_if_received()
            raise
        for place in (place for place, own in self._key.items() if own == key and (only is None or place in only)):
            self._judged[place] = self._judge(self._claims[place[0]], place[1], seen)

    def _run(
        self, config: str, pairs: Sequence[tuple[Case, Case]], options: RunOptions, progress: Progress | None
    ) -> Seen:
        changed = tuple(other for _, other in pairs)
        experiment = replace(self._experiment(config), cases=changed, realisations=self._n)
        simulated = simulation.simulated(experiment, options, progress=progress)
        if simulated.stopped:
            raise TargetUnmet(f"readings: {simulated.stopped}: the same command continues")
        results = [simulation.result_of(*one) for one in simulated.cases]
        tables = output.measured(results)
        originals = [replace(own, spec=case.spec) for own, (case, _) in zip(results, pairs, strict=True)]
        may_grow = self._paper.claims.may_grow
        places = {own.name: {key: set(range(len(getattr(own.spec, key)))) for key in may_grow} for own in originals}
        return Seen(originals, results, tables, places)

    def _fail(self, key: tuple[str, ...], why: str) -> None:
        """A run that could not be prepared: a target that hits the ground, a schedule that does not exist."""
        for place, own in list(self._key.items()):
            if own == key:
                self._impossible[place] = why

    def _under(self, claim: Claim, reading: Reading) -> Under:
        """A claim under a reading: as its run was judged, or exactly, or why not."""
        place = claim.id, reading
        if place not in self._judged:
            self._judged[place] = self._judge(claim, reading, None)
        return self._judged[place]

    def _judge(self, claim: Claim, reading: Reading, seen: Seen | None) -> Under:
        of = self._paper.readings
        why = self._impossible.get((claim.id, reading))
        if why is None:
            try:
                evidence = of.evidence(claim, reading, seen, self._paper.claims)
                return under(of, claim, reading, evidence, min(one.count for one in seen.ran) if seen else 0)
            except Unreadable as error:
                why = str(error)
        return Under(claim, reading, of.name(reading), of.kind(reading), why=why)


def _shifted(progress: Progress | None, before: int, of: int = 0) -> Progress | None:
    return progress and (lambda done, total, held: progress(before + done, of or total, before + held))
