"""Verdicts under every reading that the papers allow: computed exactly or by small stored runs, and written."""

import csv
import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from radarsim.app import configs, output, simulation
from radarsim.app.simulation import RunOptions
from radarsim.config.experiment import Case, Experiment
from radarsim.errors import ConfigError, StoreError, TargetUnmet
from radarsim.report import files
from radarsim.report.claims import PaperClaims
from radarsim.report.claims.declared import Claim
from radarsim.report.claims.over import Over, Under, columns, rows, under
from radarsim.report.claims.readings import PaperReadings, Reading, Seen, Unreadable
from radarsim.report.claims.search import Search
from radarsim.studies import registry

Progress = Callable[[int, int, int], None]
FOLDER, TABLE = "readings", "readings.csv"


@dataclass(frozen=True)
class Paper:
    """A paper with readings: what it leaves open, its claims, and the study that judges them."""

    readings: PaperReadings
    claims: PaperClaims
    study: str


@dataclass(frozen=True)
class Read:
    """What came of the readings of a paper; search: None where there is none, or only single claims were asked for."""

    paper: Paper
    over: list[Over]
    search: Search | None = None


@dataclass
class Done:
    """What `readings` made: of each paper asked for, and the files written, by their path under `folder`."""

    read: list[Read]
    folder: Path
    files: tuple[str, ...] = field(default=())


def papers() -> dict[str, Paper]:
    """The papers with readings, by their key (P1)."""
    found = {}
    for name, of in registry.parts(lambda study: study.readings()).items():
        claims = registry.study(name).claims()
        if of is not None and claims is not None:
            found[of.paper] = Paper(of, claims, name)
    return dict(sorted(found.items()))


def asked(names: Sequence[str]) -> list[tuple[Paper, list[Claim], bool]]:
    """The papers that are asked for, their claims, and whether as wholes; all, where no name is given.

    Raises ConfigError for a name that is neither a paper nor a claim, saying what is allowed.
    """
    every = papers()
    owner = {claim.id: key for key, paper in every.items() for claim in paper.claims.claims}
    faults = []
    for name in names:
        if name not in every and name not in owner:
            paper = name.partition(".")[0]
            ids = [claim for claim, key in owner.items() if key == paper]
            allowed = f"claims of {paper}: {', '.join(ids)}" if ids else f"papers: {', '.join(every)}; or a claim: P1.4"
            faults.append(f"readings: no paper or claim {name!r}; {allowed}")
    if faults:
        raise ConfigError(*faults)
    found = []
    for key, paper in every.items():
        whole = not names or key in names
        claims = [claim for claim in paper.claims.claims if whole or claim.id in names]
        if claims:
            found.append((paper, [claim for claim in claims if not claim.extension], whole))
    return found


def readings(
    names: Sequence[str] = (),
    *,
    out: str | Path,
    realisations: int | None = None,
    options: RunOptions | None = None,
    progress: Progress | None = None,
    write: bool = True,
) -> Done:
    """Judge claims under every reading and write table and specification curves into out/readings.

    names are papers (P1) and claims (P1.4); none: all. realisations of each run, where runs are needed; default: what
    the paper's readings declare. Runs go through the store of blocks under out, so that a second call continues.
    Raises ConfigError for an unknown name, TargetUnmet where a time limit left something undone.
    """
    wanted = asked(names)
    options = replace(options or RunOptions(), out=out)
    plans = [Plan(paper, claims, realisations or paper.readings.realisations) for paper, claims, _ in wanted]
    total, done = sum(plan.total for plan in plans), 0
    read = []
    for plan, (paper, _, whole) in zip(plans, wanted, strict=True):
        over = plan.judged(options, _after(progress, done, total))
        done += plan.total
        read.append(Read(paper, over, paper.readings.search() if whole else None))
    made = Done(read, Path(out) / FOLDER)
    if write:
        made.files = _write(made)
    return made


def _after(progress: Progress | None, before: int, total: int) -> Progress | None:
    return progress and (lambda done, _, held: progress(before + done, max(total, 1), before + held))


class Plan:
    """The runs that a paper's readings need, each once, and the verdicts from them."""

    def __init__(self, paper: Paper, claims: Sequence[Claim], realisations: int):
        self._paper, self._claims, self._n = paper, list(claims), realisations
        self._experiments: dict[str, Experiment] = {}
        self._jobs: dict[tuple[str, ...], list[tuple[Case, Case]]] = {}  # key: original and changed cases
        self._key: dict[tuple[str, Reading], tuple[str, ...]] = {}
        self._impossible: dict[tuple[str, Reading], str] = {}
        self._seen: dict[tuple[str, ...], Seen] = {}
        if not paper.readings.exact:
            for claim in self._claims:
                for reading in paper.readings.of_claim(claim.id):
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

    def judged(self, options: RunOptions, progress: Progress | None) -> list[Over]:
        """Every claim under every reading."""
        done = 0
        for key, pairs in self._jobs.items():
            try:
                self._seen[key] = self._run(key[0], pairs, options, _shifted(progress, done))
            except ConfigError as error:
                self._fail(key, error.lines[0])
            done += len(pairs) * self._n
        return [
            Over(claim, tuple(self._under(claim, one) for one in self._paper.readings.of_claim(claim.id)))
            for claim in self._claims
        ]

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
        of = self._paper.readings
        why = self._impossible.get((claim.id, reading))
        if why is None:
            try:
                seen = None if of.exact else self._seen[self._key[claim.id, reading]]
                return under(of, claim, reading, of.evidence(claim, reading, seen, self._paper.claims))
            except Unreadable as error:
                why = str(error)
        return Under(claim, reading, of.name(reading), of.kind(reading), why=why)


def _shifted(progress: Progress | None, before: int) -> Progress | None:
    return progress and (lambda done, total, held: progress(before + done, total, before + held))


# ---- files -----------------------------------------------------------------------------------------------------------
def _write(done: Done) -> tuple[str, ...]:
    """Write the table, with the stored rows of claims that were not asked for, and a curve a claim."""
    from radarsim.report import figures as drawing  # Matplotlib
    from radarsim.report.claims import curve

    contents = {TABLE: _table(done).encode()}
    for read in done.read:
        for over in read.over:
            if len(over.under) > 1 and over.outcome is not None:
                figure = curve.specification(read.paper.readings, over)
                contents |= {f"{over.claim.id}.{kind}": data for kind, data in drawing.save(figure).items()}
    files.replace_all(done.folder, contents)
    return tuple(sorted(contents))


def _table(done: Done) -> str:
    names = columns(paper.readings for paper in papers().values())
    own = {over.claim.id for read in done.read for over in read.over}
    kept = [row for row in stored(done.folder.parent) if row["claim"] not in own]
    new = [row for read in done.read for over in read.over for one in over.under for row in rows(one, names)]
    text = io.StringIO(newline="")
    table = csv.DictWriter(text, names, restval="", extrasaction="ignore", lineterminator="\n")
    table.writeheader()
    table.writerows(sorted([*kept, *new], key=lambda row: _order(str(row["claim"]))))
    return text.getvalue()


def _order(claim: str) -> tuple[str, float, str]:
    """P1.2 before P1.10."""
    paper, _, number = claim.partition(".")
    digits = number.rstrip("abcdefghijklmnopqrstuvwxyz")
    return paper, float(digits) if digits.isdigit() else 0.0, number


def stored(out: str | Path) -> list[dict[str, Any]]:
    """The rows of readings.csv under `out`; none where there is no such file. Raises StoreError for a damaged one."""
    path = Path(out) / FOLDER / TABLE
    try:
        text = files.read(path).decode("utf-8")
    except FileNotFoundError:
        return []
    except (OSError, ValueError) as error:
        raise StoreError(f"{path}: cannot be read: {error}") from error
    table = csv.DictReader(io.StringIO(text, newline=""))
    found = list(table)
    if not {"claim", "reading", "kind", "outcome"} <= set(table.fieldnames or ()):
        raise StoreError(f"{path}: is no table of readings; remove it, `radarsim readings` makes it anew")
    return found


def documents(done: Done) -> list[dict[str, Any]]:
    """What --json prints: a document a claim, with every reading."""
    found = []
    for over in (over for read in done.read for over in read.over):
        outcome = over.outcome
        found.append(
            {
                "claim": over.claim.id,
                "verdict": outcome.words if outcome else "not judged",
                "holds": outcome.holds_in if outcome else None,
                "of": outcome.readings if outcome else None,
                "depends_on": list(outcome.depends_on) if outcome else [],
                "readings": [_document(one) for one in over.under],
            }
        )
    return found


def _document(one: Under) -> dict[str, Any]:
    return {
        "reading": one.name,
        "kind": one.kind,
        "choices": dict(one.reading.taken),
        "verdict": one.outcome.kind if one.outcome else None,
        "miss": one.outcome.miss if one.outcome else None,
        "reason": one.why or None,
    }
