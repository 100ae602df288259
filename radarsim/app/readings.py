"""Verdicts under every reading that the papers allow: computed exactly or by small stored runs, and written."""

import csv
import hashlib
import io
import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from radarsim.app import stored_claims
from radarsim.app.reading_runs import Asked, Paper, Plan, Progress
from radarsim.app.simulation import RunOptions
from radarsim.app.stored_readings import CLASSES, PLACE, stored_classes, stored_readings
from radarsim.engine.stopping import Signals
from radarsim.errors import ConfigError, StoreError
from radarsim.report import files
from radarsim.report.claims import classes
from radarsim.report.claims.joint import Joint, joint
from radarsim.report.claims.judge import NOT_JUDGED
from radarsim.report.claims.over import Over, Under, columns, depth, rows
from radarsim.report.claims.readings import PaperReadings
from radarsim.report.claims.rule import UNDECIDED, roughly
from radarsim.report.claims.search import Search
from radarsim.studies import registry

FOLDER, TABLE, DRAWN = *PLACE.parts, "drawn.json"
DRAW = (("claims", "curve.py"), *((name,) for name in ("figures.py", "legends.py", "drawing.py", "chart_look.py")))


@dataclass(frozen=True)
class Read:
    """What came of the readings of a paper, and of its joint search where the whole paper was asked for."""

    paper: Paper
    over: list[Over]
    counted: Search | Joint | None = None


@dataclass
class Done:
    """What `readings` made: of each paper asked for, and the files written, by their path under `folder`.

    left has a line for each claim that was to be decided and is not. outdated: the configs beside them whose stored
    claims have another class.
    """

    read: list[Read]
    folder: Path
    files: tuple[str, ...] = field(default=())
    left: tuple[str, ...] = field(default=())
    outdated: tuple[str, ...] = field(default=())


def papers() -> dict[str, Paper]:
    """The papers with readings, by their key (P1)."""
    found = {}
    for name, of in registry.parts(lambda study: study.readings()).items():
        claims = registry.study(name).claims()
        if of is not None and claims is not None:
            found[of.paper] = Paper(of, claims, name)
    return dict(sorted(found.items()))


def asked(names: Sequence[str] = (), only: Sequence[str] = ()) -> list[Asked]:
    """What names of papers (P1) and claims (P1.4) ask for; all papers, where there is no name.

    only: texts CHOICE=VALUE. Raises ConfigError for a paper, claim, choice or value that is not there, saying which
    are.
    """
    every = papers()
    owner = {claim.id: key for key, paper in every.items() for claim in paper.claims.claims}
    faults = [_unknown(name, every, owner) for name in names if name not in every and name not in owner]
    faults += [fault for paper in every.values() for fault in _closed(paper, names)]
    if faults:
        raise ConfigError(*faults)
    kept = _only(
        only, [paper for key, paper in every.items() if not names or any(n.split(".")[0] == key for n in names)]
    )
    found = []
    for key, paper in every.items():
        whole = not names or key in names
        claims = [one for one in paper.claims.claims if (whole or one.id in names) and paper.readings.open(one)]
        if claims:
            found.append(Asked(paper, claims, whole, kept))
    return found


def _closed(paper: Paper, names: Sequence[str]) -> list[str]:
    """Faults of claims that are asked for by name, and on which nothing bears that the paper leaves open."""
    kept = [one.id for one in paper.claims.claims if paper.readings.open(one)]
    return [
        f"readings: {one.id} depends on nothing that its paper leaves open; claims that do: {', '.join(kept)}"
        for one in paper.claims.claims
        if one.id in names and one.id not in kept
    ]


def _unknown(name: str, every: Mapping[str, Paper], owner: Mapping[str, str]) -> str:
    if any(
        claim.id == name for of in registry.parts(lambda study: study.claims()).values() if of for claim in of.claims
    ):
        return f"readings: {name} is an extension, ours, of which no paper leaves anything open"
    ids = [claim for claim, key in owner.items() if key == name.partition(".")[0]]
    allowed = f"its claims: {', '.join(ids)}" if ids else f"papers: {', '.join(every)}; claims as P1.4"
    return f"readings: no paper or claim {name!r}; {allowed}"


def _only(texts: Sequence[str], wanted: Sequence[Paper]) -> dict[str, str]:
    choices = {choice.key: choice for paper in wanted for choice in paper.readings.choices}
    found, faults = {}, []
    for text in texts:
        key, _, value = (part.strip() for part in text.partition("="))
        if key not in choices:
            faults.append(f"--only {text}: no choice {key!r}; choices: {', '.join(choices)}")
        elif value not in (values := [one.name for one in choices[key].alternatives]):
            faults.append(f"--only {text}: no value {value!r} of {key}; values: {', '.join(values)}")
        found[key] = value
    if faults:
        raise ConfigError(*faults)
    return found


def readings(
    wanted: Sequence[Asked],
    *,
    out: str | Path,
    realisations: int | None = None,
    decide: bool = False,
    options: RunOptions | None = None,
    progress: Progress | None = None,
    figures: bool = True,
    stop: Signals | None = None,
) -> Done:
    """Judge claims under every reading and write table and specification curves into out/readings.

    wanted is of `asked`. realisations of each run, where runs are needed; default: what the paper's readings declare.
    decide: the runs on which an undecided claim hangs grow on, to 2000·2^m realisations, until it is decided;
    `realisations` is then the most. Runs go through the store of blocks under out, so that a second call continues.
    Raises TargetUnmet where a time limit left something undone, Interrupted where `stop` saw a signal.
    """
    if realisations is not None and realisations < 1:
        raise ConfigError(f"--realisations: must be >= 1, got {realisations}")
    options = replace(options or RunOptions(), out=out)
    plans = [Plan(one, _first(one.paper.readings, realisations, decide)) for one in wanted]
    total, done = sum(plan.total for plan in plans), 0
    read, left = [], []
    for plan, one in zip(plans, wanted, strict=True):
        over = plan.judged(options, _after(progress, done, total), stop)
        if decide:
            over = plan.decided(over, realisations or one.paper.readings.most, options, progress, stop)
            left += [line for each in over if (line := _left(each))]
        done += plan.total
        read.append(Read(one.paper, over, _counted(one.paper, over) if one.whole and not one.only else None))
    made = Done(read, Path(out) / FOLDER, left=tuple(left))
    if not any(one.only for one in wanted):
        made.files = _write(made, figures)
        made.outdated = _outdated(made)
    return made


def _first(of: PaperReadings, realisations: int | None, decide: bool) -> int:
    """Realisations of the first runs: those asked for, or declared; to decide, at most those asked for."""
    if realisations is None:
        return of.realisations
    return min(of.realisations, realisations) if decide else realisations


def _left(over: Over) -> str:
    """What is to be said of a claim that is not decided: under how many readings, and what it would take."""
    if over.outcome is None or over.outcome.kind != UNDECIDED:
        return ""
    needed = over.outcome.needed
    would = "a value lies on a border: no number would" if needed is None else f"about {roughly(needed):,} would"
    open_, n = len(over.undecided), over.looked
    return f"{over.claim.id} not yet decided under {open_} readings at {n:,} realisations; {would}"


def _counted(paper: Paper, over: list[Over]) -> Search | Joint:
    """The joint search of a paper: over all it computes at once, else over its declared readings."""
    return paper.readings.search() or joint(paper.readings, over)


def _after(progress: Progress | None, before: int, total: int) -> Progress | None:
    return progress and (lambda done, _, held: progress(before + done, max(total, 1), before + held))


# ---- files -----------------------------------------------------------------------------------------------------------
def _write(done: Done, figures: bool) -> tuple[str, ...]:
    """Write the table, with the stored rows of claims that were not asked for, and a curve a claim.

    A curve whose claim came out as it did before is not drawn again, unless what draws it has changed: `drawn.json`
    keeps what the files were drawn of.
    """
    contents = {TABLE: _table(done).encode(), CLASSES.name: _classes(done).encode()}
    if figures:
        drawn = _drawn(done.folder)
        for over in (over for read in done.read for over in read.over):
            if len(over.under) > 1 and over.outcome is not None:
                contents |= _curve(done, over, drawn)
        contents[DRAWN] = (json.dumps(drawn, indent=1, sort_keys=True) + "\n").encode()
    files.replace_all(done.folder, contents)
    return tuple(sorted(name for name in contents if name != DRAWN))


def _curve(done: Done, over: Over, drawn: dict[str, str]) -> dict[str, bytes]:
    """The files of a claim's specification curve; none where they stand there already."""
    of = next(read.paper.readings for read in done.read if over in read.over)
    content = repr([(one.name, one.kind, depth(one), one.why) for one in over.under]) + over.sentence()
    mark = hashlib.sha256(content.encode() + _sources()).hexdigest()
    name = f"{over.claim.id}.svg"
    if drawn.get(name) == mark and (done.folder / name).is_file():
        return {}
    from radarsim.report import figures as drawing  # Matplotlib
    from radarsim.report.claims import curve

    drawn[name] = mark
    return {name: drawing.save(curve.specification(of, over), ("svg",))["svg"]}


@cache
def _sources() -> bytes:
    """What draws the curves."""
    return b"".join(resources.files("radarsim.report").joinpath(*name).read_bytes() for name in DRAW)


def _drawn(folder: Path) -> dict[str, str]:
    try:
        found = json.loads(files.read(folder / DRAWN))
    except (OSError, ValueError):
        return {}
    return {str(name): str(mark) for name, mark in found.items()} if isinstance(found, dict) else {}


def _table(done: Done) -> str:
    names = columns(paper.readings for paper in papers().values())
    every = [over for read in done.read for over in read.over]
    new = [row for over in every for one in over.under for row in rows(one, names, over.outcome)]
    return _with(names, stored_readings(done.folder.parent), new, {over.claim.id for over in every})


def _classes(done: Done) -> str:
    """What each claim came to over its readings."""
    every = [(read.paper.readings, over) for read in done.read for over in read.over]
    new = [found.as_row() for of, over in every if (found := classes.of_over(of, over)) is not None]
    kept = [one.as_row() for one in stored_classes(done.folder.parent)]
    return _with(classes.COLUMNS, kept, new, {over.claim.id for _, over in every})


def _outdated(done: Done) -> tuple[str, ...]:
    """The configs whose stored claims have another class than their readings gave now."""
    new = {over.claim.id: over for read in done.read for over in read.over if over.outcome}
    found = []
    for config in dict.fromkeys(over.claim.config for over in new.values()):
        with suppress(StoreError):  # `radarsim claims` tells of a damaged one
            for row in stored_claims.stored(done.folder.parent / config / "claims.csv") or ():
                outcome = new[row["claim"]].outcome if row["claim"] in new else None
                if outcome and row["class"] not in (NOT_JUDGED, outcome.kind):
                    found.append(config)
    return tuple(dict.fromkeys(found))


def _with(names: Sequence[str], stored: Sequence[Mapping], new: Sequence[Mapping], own: set[str]) -> str:
    """A table of new rows and those that are stored of claims that were not asked for."""
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


def pages(done: Done) -> str:
    """The page of each paper, one after the other."""
    from radarsim.report.claims.readings_page import page

    return "\n".join(
        page(read.paper.readings, read.paper.claims.paper, read.over, read.counted or _counted(read.paper, read.over))
        for read in done.read
    )


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
