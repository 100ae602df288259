"""The hypotheses of one realisation, scan by scan, for the figure that shows them."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from radarsim.config.experiment import Case
from radarsim.kernels.hypotheses import COLUMNS
from radarsim.kernels.lanes import WIDTH
from radarsim.studies.ambiguous_doppler.kernels import records, sums
from radarsim.studies.ambiguous_doppler.study import prepare

LANE = WIDTH - 1  # the realisation of a group whose list the kernel leaves behind


@dataclass(frozen=True)
class Fan:
    """Of one realisation and filter: times t (K,), true velocities (K,), and by scan the list of hypotheses.

    Each list is (velocity (n,) m/s, acceleration (n,) m/s², probability (n,)), the most probable first.
    """

    t_s: np.ndarray
    truth: np.ndarray
    lists: tuple[tuple[np.ndarray, np.ndarray, np.ndarray], ...]


def fan(case: Case, number: int, scans: int) -> Fan:
    """The lists of filter `number` over the first scans, in realisation 7 of the case."""
    alone = {"filters": (case.spec.filters[number],), "baseline": None, "rare": None}
    only: Any = case.spec.model_copy(update=alone)
    plan = prepare(Case(case.name, case.stem, case.study, only, case.swept, case.realisations, case.seed))
    lists = []
    for k in range(1, scans + 1):
        world = plan.world._replace(
            truth=plan.world.truth[:k].copy(), t=plan.world.t[:k].copy(), spans=plan.world.spans[:k].copy()
        )
        plots, out, listed = sums.simulated_lists(world, plan.banks, 0)
        count = int(out[0, -1, records.COUNT, LANE])
        which = int(plots[:, records.DETECTED, LANE].sum()) % 2  # each plot is written from one list into the other
        own = listed.reshape(COLUMNS, -1)[4 * which : 4 * which + 4, :count]
        weight = np.exp(own[3] - own[3].max(initial=-np.inf))
        order = np.argsort(-weight, kind="stable")
        lists.append((own[1][order], own[2][order], weight[order] / weight.sum()))
        truth = plots[:, records.TRUTH + 1, LANE]
    return Fan(plan.world.t[:scans], truth, tuple(lists))
