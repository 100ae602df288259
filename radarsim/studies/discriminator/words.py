"""What P4's report says: the question of an experiment, and its answer in sentences."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from radarsim.config.experiment import Experiment
from radarsim.engine.results import CaseResult
from radarsim.language import few, plural, tr
from radarsim.report import panels, rare, tables, wording
from radarsim.studies.discriminator.kernels import LOCKS
from radarsim.studies.discriminator.tables import last_locks

if TYPE_CHECKING:
    import pandas as pd


def question(experiment: Experiment) -> str:
    """What the experiment asks, in one sentence."""
    names = list(dict.fromkeys(e.name for case in experiment.cases for e in case.spec.estimators))
    return tr(
        "How often does an estimate by {estimators} lock onto the Doppler frequency and its derivatives, and how "
        "accurate is it then?",
        estimators=few(names),
    )


def answer(results: Sequence[CaseResult], made: Mapping) -> list[str]:
    """Sentences with numbers: by case where nothing is swept, else the range of lock of each estimator."""
    plain = [result for result in results if not result.swept]
    if any(result.spec.rare is not None for result in results):
        plain = list(results)  # what is sought is said of each
    if not plain and len(results) > 1:
        return [_over(results, made, name) for name in results[0].axes.filters]
    sentences = plain or list(results)
    return [
        *_against_design(results, made),
        *(
            words
            for result in sentences
            for words in _of_one(result, made, f"{panels.plain_label(result)}, " if len(sentences) > 1 else "")
        ),
    ]


def _against_design(results: Sequence[CaseResult], made: Mapping) -> list[str]:
    """The case in which lock is lost the most often for its design, where losses are sought among several cases."""
    found = []
    for result in (one for one in results if one.spec.rare is not None and len(results) > 1):
        rows = tables.groups(made["rare"], "case")[(result.name,)]
        for _, row in rows[rows["sought"]].iterrows():
            (of,) = (one for one in result.spec.estimators if one.name == row["filter"])
            if of.schedule == "designed" and of.lock_probability < 1:
                found.append((row["rate"] / (1 - of.lock_probability), 1 - of.lock_probability, row))
    if not found:
        return []
    times, designed, row = max(found, key=lambda one: one[0])
    return [
        tr(
            "{estimator} loses lock in {rate:.3g} [{low:.3g}, {high:.3g}] of the bursts where it was designed for "
            "{designed:.3g}, {times:.3g} times as often, the most of {count} cases.",
            estimator=row["filter"],
            designed=designed,
            times=times,
            count=len(found),
            **rare.told(row),
        )
    ]


def _of_one(result: CaseResult, made: Mapping, before: str) -> list[str]:
    """Lock and accuracy of the first estimator at its last window, and the locks of the others."""
    first, *others = result.axes.filters
    row = last_locks(made, result, first)
    k = int(row["k"])
    n = max(result.sums["locks"][0, k - 1, LOCKS.index("lock")], 1)  # of the plain bursts, where some are shifted
    said = {"estimator": first, "lock": _lock(row), "bursts": result.count}
    words = [
        before
        + plural(
            "{estimator}: {count} window, locked in {lock} of {bursts:,} bursts.",
            "{estimator}: {count} windows, locked in {lock} of {bursts:,} bursts.",
            k,
            **said,
        )
    ]
    rare_event = result.spec.rare is not None
    if row["lock_rate"]:
        bound = result.axes.posterior_sigma[0, k - 1] / result.axes.exact_sigma[0, k - 1]
        ratio = np.sqrt(result.sums["error"][0, k - 1, :, 1] / n) / bound
        said |= {"least": ratio.min(), "most": ratio.max()}
    if row["lock_rate"] and rare_event:  # the lock is told by its losses: of these bursts some are shifted
        words = [
            before
            + plural(
                "{estimator}: {count} window; σ of the locked over the bound (forecast included) {least:.3f} to "
                "{most:.3f}, of {plain:,} bursts without importance sampling.",
                "{estimator}: {count} windows; σ of the locked over the bound (forecast included) {least:.3f} to "
                "{most:.3f}, of {plain:,} bursts without importance sampling.",
                k,
                plain=int(n),
                **said,
            )
        ]
    elif row["lock_rate"]:
        words = [
            before
            + plural(
                "{estimator}: {count} window, locked in {lock} of {bursts:,} bursts; σ of the locked over the bound "
                "(forecast included) {least:.3f} to {most:.3f}.",
                "{estimator}: {count} windows, locked in {lock} of {bursts:,} bursts; σ of the locked over the bound "
                "(forecast included) {least:.3f} to {most:.3f}.",
                k,
                **said,
            )
        ]
    if rare_event:
        words.append(before + _rare(tables.groups(made["rare"], "case")[(result.name,)]))
    if others:
        locks = "; ".join(f"{name}, {_lock(last_locks(made, result, name))}" for name in others)
        words.append(before + tr("locks of the others: {locks}.", locks=locks))
    return words


def _over(results: Sequence[CaseResult], made: Mapping, name: str) -> str:
    """The least and the largest lock of an estimator among swept cases."""
    found = [result for result in results if name in result.axes.filters]
    rows = {result.name: last_locks(made, result, name) for result in found}
    found.sort(key=lambda result: rows[result.name]["lock_rate"])
    ends = (found[0], found[-1])
    least, most = (f"{_lock(rows[result.name])} ({panels.plain(panels.swept(result))})" for result in ends)
    return plural(
        "{estimator}: locked in {least} to {most}; {count} case of {realisations}.",
        "{estimator}: locked in {least} to {most}; {count} cases of {realisations}.",
        len(found),
        estimator=name,
        least=least,
        most=most,
        realisations=panels.realisations(found),
    )


def _lock(row: "pd.Series") -> str:
    """A share of bursts with its interval."""
    return wording.share(*(100 * row[name] for name in ("lock_rate", "lock_lo", "lock_hi")))


def _rare(rows: "pd.DataFrame") -> str:
    """How often lock is lost, by importance sampling, of the estimator for which it is sought."""
    row = rows[rows["sought"]].iloc[0]
    return tr(
        "{estimator}: lock is lost in {rate:.3g} [{low:.3g}, {high:.3g}] of the bursts, by importance sampling from "
        "{events:,} losses, {n_eff:,.0f} effective ones.",
        estimator=row["filter"],
        **rare.told(row),
    )
