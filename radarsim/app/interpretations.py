"""The runs that a paper's interpretations need, each once, judged as they finish; verdicts under every interpretation,
computed exactly or by small stored runs, and their files.

`radarsim run --decide`: as many realisations as it takes until each claim of the config is decided. It looks at
declared numbers of realisations only, 2000·2^m, as a precision does, and each verdict accounts for all these looks
(report.claims.rule.LOOKS): were each look judged at 95 %, chance would refute up to a fifth of the claims that are true
at a border."""

import csv
import io
import os
import tempfile
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import ExitStack, nullcontext, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radarsim.app import configs, result, run
from radarsim.app import stored as stored_claims
from radarsim.app.ahead import Ahead, Progress, estimated
from radarsim.app.case_work import CaseWork
from radarsim.app.run import RunOptions, SimulatedCases
from radarsim.app.shown import Shown
from radarsim.app.stored import CLASSES, PLACE, stored_classes, stored_interpretations
from radarsim.config.experiment import Case, Experiment
from radarsim.engine.machine import available_cores
from radarsim.engine.run import Either, Signals, Stop, TimeLimit
from radarsim.errors import ConfigError, StoreError, TargetUnmet, argument
from radarsim.language import tr
from radarsim.report import files
from radarsim.report.claims import PaperClaims, page
from radarsim.report.claims.declared import Claim
from radarsim.report.claims.judge import NOT_JUDGED
from radarsim.report.claims.over import (
    Interpretation,
    Over,
    PaperInterpretations,
    Seen,
    Under,
    Unreadable,
    columns,
    rows,
    under,
)
from radarsim.report.claims.rule import UNDECIDED, roughly
from radarsim.report.drawing import Figure
from radarsim.report.precision import looks
from radarsim.report.tables import read_rows
from radarsim.studies import registry
from radarsim.threads import limited

if TYPE_CHECKING:
    import pandas as pd


# ---- interpretation runs
# ----------------------------------------------------------------------------------------------------
@dataclass(frozen=True)
class Paper:
    """A paper with interpretations: its open choices, its claims, and the study that judges them."""

    interpretations: PaperInterpretations
    claims: PaperClaims
    study: str


@dataclass(frozen=True)
class Asked:
    """The part of a paper to judge: its claims."""

    paper: Paper
    claims: list[Claim]


# Expected seconds of judging a run, of an exact verdict and of a figure, until some are measured.
RUN_JUDGED_S, VERDICT_S, FIGURE_S = 0.05, 0.001, 0.13
LOOK_PART = 0.5  # of the time of all first runs, expected of each later look: fewer of them, and longer


class Plan:
    """The runs that a paper's interpretations need, each once, and the verdicts from them. A run is judged as soon as
    it is done and then dropped: memory is that of one run, however many interpretations there are."""

    def __init__(self, wanted: Asked, realisations: int):
        self._wanted, self._paper, self._n = wanted, wanted.paper, realisations
        self._experiments: dict[str, Experiment] = {}
        self._jobs: dict[tuple[str, ...], list[tuple[Case, Case]]] = {}  # key: original and changed cases
        self._key: dict[tuple[str, Interpretation], tuple[str, ...]] = {}
        self._impossible: dict[tuple[str, Interpretation], str] = {}
        self._judged: dict[tuple[str, Interpretation], Under] = {}
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
        except Unreadable as error:
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
        self._look_s = LOOK_PART * sum(map(self._expected, self._jobs))
        self._expect_looks(ahead, self._looks)

    def _expect_looks(self, ahead: Ahead, count: int) -> None:
        ahead.add("later looks", 1.0, self._look_s * count)

    def _kind(self, key: tuple[str, ...]) -> str:
        """What is foretold together: an interpretation may change what a case takes, but hardly that of other cases."""
        return ", ".join(("run of", key[0], *(case.name for case, _ in self._jobs[key])))

    def _expected(self, key: tuple[str, ...]) -> float:
        """Expected seconds of a run; 0 before `estimate`."""
        return sum(self._seconds.get((key[0], case.name), 0.0) for case, _ in self._jobs[key]) * self._n

    def judged(self, options: RunOptions, ahead: Ahead, stop: Signals | None) -> list[Over]:
        """Every claim under every interpretation."""
        for key, pairs in self._jobs.items():
            try:
                self._see(key, pairs, options, ahead, stop)
            except ConfigError as error:
                self._fail(key, error.lines[0])
                ahead.add(f"judging of {key[0]}", RUN_JUDGED_S, -1)
        found = list[Over]()
        for claim in self._wanted.claims:
            verdicts = []
            for interpretation in self._paper.interpretations.of_claim(claim.id):
                run_for = (claim.id, interpretation) in self._key
                with nullcontext() if run_for else ahead.doing(f"verdict of {claim.id}"):
                    verdicts.append(self._under(claim, interpretation))
            found.append(Over(self._paper.interpretations, claim, tuple(verdicts)))
        return found

    def decided(
        self, over: list[Over], most: int, options: RunOptions, ahead: Ahead, stop: Signals | None
    ) -> list[Over]:
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

    def _seen(self, pairs: Sequence[tuple[Case, Case]], simulated: SimulatedCases) -> Seen:
        results = run.finished(simulated)
        tables = result.measured(results)
        originals = [replace(own, spec=case.spec) for own, (case, _) in zip(results, pairs, strict=True)]
        may_grow = self._paper.claims.may_grow
        places = {own.name: {key: set(range(len(getattr(own.spec, key)))) for key in may_grow} for own in originals}
        return Seen(originals, results, tables, places)

    def _fail(self, key: tuple[str, ...], why: str) -> None:
        """A run that could not be prepared: a target that hits the ground, an impossible schedule."""
        for place, own in list(self._key.items()):
            if own == key:
                self._impossible[place] = why

    def _under(self, claim: Claim, interpretation: Interpretation) -> Under:
        """A claim under an interpretation: the verdict of its run, or the exact one, or why there is none."""
        place = claim.id, interpretation
        if place not in self._judged:
            self._judged[place] = self._judge(claim, interpretation, None)
        return self._judged[place]

    def _judge(self, claim: Claim, interpretation: Interpretation, seen: Seen | None) -> Under:
        of = self._paper.interpretations
        why = self._impossible.get((claim.id, interpretation))
        if why is None:
            try:
                evidence = of.evidence(claim, interpretation, seen, self._paper.claims)
                return under(of, claim, interpretation, evidence, min(one.count for one in seen.ran) if seen else 0)
            except Unreadable as error:
                why = str(error)
        return Under(claim, interpretation, of.name(interpretation), of.kind(interpretation), why=why)


# ---- decide ----------------------------------------------------------------------------------------------------------
def check(experiment: Experiment) -> None:
    """ConfigError for a config that no claim names."""
    of = registry.study(experiment.study).claims()
    if of is None or all(claim.config != experiment.stem for claim in of.claims):
        configs = sorted({claim.config for claim in of.claims}) if of else []
        hint = f"; claims of its study name {', '.join(configs)}" if configs else ""
        raise ConfigError(f"{experiment.path or experiment.stem}: decide: no claim names this config{hint}")


def simulated(experiment: Experiment, options: RunOptions, progress: Progress | None = None) -> SimulatedCases:
    """The cases at the first look at which every claim is decided, or at the last permitted look; progress is towards
    that one."""
    most = max(case.realisations for case in experiment.cases)
    each = [realisations for _, realisations in dict(run.keyed(experiment))]
    before = 0  # realisations of the looks before

    def towards(done: int, _: int, held: int) -> None:
        if progress is not None:
            progress(before + done - held, sum(each), before)

    with ExitStack() as stack:
        if options.out is None:
            options = replace(options, out=stack.enter_context(tempfile.TemporaryDirectory(prefix="radarsim-")))
        best: SimulatedCases | None = None
        for n in dict.fromkeys((*looks(most), most)):
            cases = tuple(replace(case, realisations=min(n, case.realisations)) for case in experiment.cases)
            if before:
                towards(0, 0, 0)  # judging is not in the rate
            found = run.simulate(replace(experiment, cases=cases), options, progress=progress and towards)
            before = sum(min(n, one) for one in each)
            if found.stopped and best is not None and len(found.cases) < len(best.cases):
                return replace(best, stopped=found.stopped)
            best = found
            if found.stopped or not undecided(rows_of(experiment, found)):
                break
    assert best is not None  # there is a look at `most`
    return best


def rows_of(experiment: Experiment, found: SimulatedCases) -> list[dict[str, Any]]:
    """The rows of claims.csv so far."""
    results = run.finished(found)
    if len(results) < len(experiment.cases):
        return []
    table = result.case_tables(results, configs.shipped_stem(experiment))["claims"]
    return list(table.to_dict("records"))


def left(experiment: Experiment, found: SimulatedCases) -> list[str]:
    """Lines on claims that stayed undecided or, where the time was up before all cases, unjudged."""
    if len(found.cases) == len(experiment.cases):
        return undecided(rows_of(experiment, found))
    of = registry.study(experiment.study).claims()
    names = [claim.id for claim in of.claims if claim.config == experiment.stem] if of else []
    return [
        f"{len(found.cases)} of {len(experiment.cases)} cases were done by then, too few to decide {', '.join(names)}"
    ]


def undecided(rows: Sequence[dict[str, Any]]) -> list[str]:
    """A line for each undecided claim, with the realisations that it would take."""
    lines = []
    for parts in page.grouped(rows):
        if parts[0]["as_shipped"] != UNDECIDED or page.extension(parts):
            continue
        needed = page.number(parts[0]["needed"])
        would = (
            "its value lies on a border: more realisations would not decide"
            if needed is None
            else f"about {roughly(needed):,} would"
        )
        most = max(page.number(part["n"]) or 0.0 for part in parts)
        lines.append(f"{parts[0]['claim']} not yet decided at {most:,.0f} realisations; {would}")
    return lines


# ---- interpretations
# --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Read:
    """Verdicts over the interpretations of a paper."""

    paper: Paper
    over: list[Over]


@dataclass(repr=False)
class Interpretations(Shown):
    """Result of `interpretations`: for each paper, and the files written, by their path under `folder`.

    left: a line for each claim that stayed undecided although `decide` was set. outdated: configs whose stored claims
    have another class."""

    read: list[Read]
    folder: Path
    files: tuple[str, ...] = field(default=())
    left: tuple[str, ...] = field(default=())
    outdated: tuple[str, ...] = field(default=())

    @property
    def over(self) -> list[Over]:
        """The claims, each with its verdicts."""
        return [over for read in self.read for over in read.over]

    @property
    def table(self) -> "pd.DataFrame":
        """The rows of interpretations.csv for these claims: one for each claim, interpretation and part."""
        names = columns(read.paper.interpretations for read in self.read)
        made = [row for over in self.over for one in over.under for row in rows(one, names, over.outcome)]
        return read_rows(made, names)

    @property
    def _described(self) -> dict[str, Figure]:
        several = (over for over in self.over if len(over.under) > 1 and over.outcome is not None)
        return {over.claim.id: page.specification(over) for over in several}

    def _said(self) -> list[str]:
        return [f"{over.claim.id} {tr(over.outcome.kind)}: {over.sentence()}" for over in self.over if over.outcome]


def papers(keys: Collection[str] = ()) -> dict[str, Paper]:
    """The papers with interpretations, by key (P1); `keys` adds or restricts papers."""
    found = {}
    for name, of in registry.papers(lambda study: study.interpretations(), keys).items():
        claims = None if of is None else registry.study(name).claims()
        if of is not None and claims is not None:
            found[of.paper] = Paper(of, claims, name)
    return dict(sorted(found.items()))


def asked(names: Sequence[str] = ()) -> list[Asked]:
    """Requests from names of papers (P1) and claims (P1.4); without names, all papers. Raises ConfigError for an
    unknown paper or claim, with the known ones."""
    every = papers()
    owner = {claim.id: key for key, paper in every.items() for claim in paper.claims.claims}
    faults = [_unknown(name, every, owner) for name in names if name not in every and name not in owner]
    faults += [fault for paper in every.values() for fault in _closed(paper, names)]
    if faults:
        raise ConfigError(*faults)
    found = []
    for key, paper in every.items():
        whole = not names or key in names
        claims = [one for one in paper.claims.claims if (whole or one.id in names) and paper.interpretations.open(one)]
        if claims:
            found.append(Asked(paper, claims))
    return found


def _closed(paper: Paper, names: Sequence[str]) -> list[str]:
    """Faults of requested claims that depend on nothing that the paper leaves open."""
    kept = [one.id for one in paper.claims.claims if paper.interpretations.open(one)]
    return [
        f"interpretations: {one.id} depends on nothing that its paper leaves open; claims that do: {', '.join(kept)}"
        for one in paper.claims.claims
        if one.id in names and one.id not in kept
    ]


def _unknown(name: str, every: Mapping[str, Paper], owner: Mapping[str, str]) -> str:
    paper = name.partition(".")[0]
    judged = {claim.id for of in run.papers([paper]) for claim in of.claims}
    if paper not in every and any(claim.partition(".")[0] == paper for claim in judged):
        return (
            f"interpretations: {name}: its study declares no choices that {paper} leaves open: "
            "there are no other interpretations"
        )
    if name in judged:
        return f"interpretations: {name} is an extension of ours: no paper leaves anything open in it"
    ids = [claim for claim, key in owner.items() if key == paper]
    allowed = f"its claims: {', '.join(ids)}" if ids else f"papers: {', '.join(every)}; claims as P1.4"
    return f"interpretations: no paper or claim {name!r}; {allowed}"


def judged(
    wanted: Sequence[Asked],
    *,
    out: str | Path,
    realisations: int | None = None,
    decide: bool = False,
    options: RunOptions | None = None,
    progress: Progress | None = None,
    figures: bool = True,
    stop: Signals | None = None,
    write: bool = True,
) -> Interpretations:
    """Judge claims under every interpretation and, unless disabled, write table and specification curves into
    out/interpretations.

    wanted: of `asked`. realisations of each run, where runs are needed; default: the number declared by the paper's
    interpretations. decide: runs behind undecided claims are extended, up to 2000·2^m realisations, until each claim is
    decided; `realisations` is then the limit. Runs go through the store of blocks under out, so that a second call
    continues. Raises TargetUnmet where a time limit left something undone, Interrupted on a signal seen by `stop`."""
    if realisations is not None and realisations < 1:
        raise ConfigError(f"{argument('realisations')}: must be >= 1, got {realisations}")
    options = replace(options or RunOptions(), out=out)
    plans = [Plan(one, _first(one.paper.interpretations, realisations, decide)) for one in wanted]

    def estimate() -> None:
        for plan in plans:
            plan.estimate(ahead, options.threads)

    ahead = Ahead(progress, estimate)
    for plan, one in zip(plans, wanted, strict=True):
        plan.expect(ahead, realisations or one.paper.interpretations.most if decide else 0)
    if write and figures:
        several = [
            claim for one in wanted for claim in one.claims if len(one.paper.interpretations.of_claim(claim.id)) > 1
        ]
        ahead.add("figure", FIGURE_S, len(several))
    read, left = [], []
    for plan, one in zip(plans, wanted, strict=True):
        over = plan.judged(options, ahead, stop)
        if decide:
            over = plan.decided(over, realisations or one.paper.interpretations.most, options, ahead, stop)
            left += [line for each in over if (line := _left(each))]
        read.append(Read(one.paper, over))
    made = Interpretations(read, Path(out) / PLACE.parent, left=tuple(left))
    if write:
        made.files = _write(made, figures, ahead)
        made.outdated = _outdated(made)
    return made


def interpretations(
    *names: str,
    realisations: float | None = None,
    decide: bool = False,
    threads: int | None = None,
    time_limit: float | Stop | None = None,
    out: str | os.PathLike[str] | None = None,
    figures: bool = True,
    progress: Progress | None = None,
    stop: Signals | None = None,
) -> Interpretations:
    """Judge claims (P1.4) or whole papers (P1) under every interpretation that the papers allow; default: all.

    Interpretations are judged exactly where possible, otherwise by runs of `realisations`, by default the number that
    the paper's interpretations declare. decide: extend the runs, up to `realisations`, until each claim is decided.
    time_limit is in seconds. out: directory for interpretations.csv, a figure for each claim, and the stored runs.

    `table` is interpretations.csv: a row for each claim, interpretation and part. Raises ConfigError for unknown names,
    TargetUnmet if the time did not suffice. progress is called with the milliseconds that have passed, those that all
    is expected to take, and 0.

    >>> interpretations("P1.4")
    P1.4 depends on: holds in 4 of 6 interpretations; depends on how the filter starts
    """
    configs.check(threads=threads, time_limit=time_limit, out=out, figures=figures)
    configs.texts(names)
    wanted = asked(names)
    limit = time_limit if time_limit is None or callable(time_limit) else TimeLimit(time_limit)
    options: dict[str, Any] = {"realisations": configs.whole(realisations), "decide": decide}
    options |= {"progress": progress, "figures": figures, "stop": stop, "write": out is not None}
    with tempfile.TemporaryDirectory(prefix="radarsim-") as folder, limited(threads):
        means = RunOptions(None, threads, Either(stop, limit))
        return judged(wanted, out=Path(folder if out is None else out), options=means, **options)


def _first(of: PaperInterpretations, realisations: int | None, decide: bool) -> int:
    """Realisations of the first runs: those requested, or declared; with `decide`, at most those requested."""
    if realisations is None:
        return of.realisations
    return min(of.realisations, realisations) if decide else realisations


def _left(over: Over) -> str:
    """The line on an undecided claim: under how many interpretations, and what it would take."""
    if over.outcome is None or over.outcome.kind != UNDECIDED:
        return ""
    needed = over.outcome.needed
    would = (
        "a value lies on a border: more realisations would not decide"
        if needed is None
        else f"about {roughly(needed):,} would"
    )
    open_, n = len(over.undecided), over.looked
    return f"{over.claim.id} not yet decided under {open_} interpretations at {n:,} realisations; {would}"


# ---- files -----------------------------------------------------------------------------------------------------------
def _write(done: Interpretations, figures: bool, ahead: Ahead) -> tuple[str, ...]:
    """Write the table, with the stored rows of other claims, and a curve for each claim."""
    contents = {PLACE.name: _table(done).encode(), CLASSES.name: _classes(done).encode()}
    described = done._described if figures else {}
    for name, figure in described.items():
        from radarsim.report.figures import save  # Matplotlib

        with ahead.doing("figure"):
            contents[f"{name}.svg"] = save(figure, ("svg",))["svg"]
    files.replace_all(done.folder, contents)
    return tuple(sorted(contents))


def _table(done: Interpretations) -> str:
    names = columns(paper.interpretations for paper in papers().values())
    new = [row for over in done.over for one in over.under for row in rows(one, names, over.outcome)]
    return _with(names, stored_interpretations(done.folder.parent), new, {over.claim.id for over in done.over})


def _classes(done: Interpretations) -> str:
    """The class of each claim over its interpretations."""
    new = [found.as_row() for over in done.over if (found := page.of_over(over)) is not None]
    kept = [one.as_row() for one in stored_classes(done.folder.parent)]
    return _with(page.COLUMNS, kept, new, {over.claim.id for over in done.over})


def _outdated(done: Interpretations) -> tuple[str, ...]:
    """Configs whose stored claims differ in class from their interpretations now. Except configs that have changed
    since their run: their stored results make no report."""
    new = {over.claim.id: over for over in done.over if over.outcome}
    found = []
    for config in dict.fromkeys(over.claim.config for over in new.values()):
        if not files.is_of(done.folder.parent / config, configs.load(config)):
            continue
        with suppress(StoreError):  # `radarsim claims` reports a damaged one
            for row in stored_claims.stored(done.folder.parent / config / "claims.csv") or ():
                outcome = new[row["claim"]].outcome if row["claim"] in new else None
                if outcome and row["class"] not in (NOT_JUDGED, outcome.kind):
                    found.append(config)
    return tuple(dict.fromkeys(found))


def _with(names: Sequence[str], stored: Sequence[Mapping], new: Sequence[Mapping], own: set[str]) -> str:
    """New rows and the stored rows of other claims."""
    text = io.StringIO(newline="")
    table = csv.writer(text, lineterminator="\n")
    table.writerow(names)
    every = sorted([*(row for row in stored if row["claim"] not in own), *new], key=lambda row: _order(row["claim"]))
    table.writerows([row.get(name, "") for name in names] for row in every)
    return text.getvalue()


def _order(claim: str) -> tuple[str, float, str]:
    """P1.2 before P1.10."""
    paper, _, number = claim.partition(".")
    digits = number.rstrip("abcdefghijklmnopqrstuvwxyz")
    return paper, float(digits) if digits.isdigit() else 0.0, number


def pages(done: Interpretations) -> str:
    """The page of each paper, one after the other."""
    from radarsim.report.claims import interpretations_page

    return "\n".join(
        interpretations_page.page(read.paper.interpretations, read.paper.claims.paper, read.over) for read in done.read
    )


def documents(done: Interpretations) -> list[dict[str, Any]]:
    """The documents of --json: one for each claim, with every interpretation."""
    found = []
    for over in done.over:
        outcome = over.outcome
        found.append(
            {
                "claim": over.claim.id,
                "verdict": outcome.words if outcome else "not judged",
                **{"holds": outcome and outcome.holds_in, "of": outcome and outcome.interpretations},
                "depends_on": list(outcome.depends_on) if outcome else [],
                "interpretations": [_document(one) for one in over.under],
            }
        )
    return found


def _document(one: Under) -> dict[str, Any]:
    return {
        "interpretation": one.name,
        "kind": one.kind,
        "choices": dict(one.interpretation.taken),
        "verdict": one.outcome.kind if one.outcome else None,
        "miss": one.outcome.miss if one.outcome else None,
        "reason": one.why or None,
    }
