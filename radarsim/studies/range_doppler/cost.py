"""The most seconds that the realisations of a case take."""

from radarsim.studies.range_doppler.study import Plan

# A scan of a filter took 3 to 6 ns of a core where gains are shared and 12 to 25 where each realisation has its own, in
# 2026 (benchmarks/README.md). Twenty times as much: no processor that runs this is so slow, however busy it is.
SHARED_S, INDIVIDUAL_S = 1e-7, 5e-7


def seconds_at_most(plan: Plan) -> float:
    """CPU seconds that no processor exceeds for one realisation."""
    filters, scans = plan.axes.available.shape[:2]
    return filters * scans * (SHARED_S if plan.design.plain else INDIVIDUAL_S)
