"""What brings a filter that loses its folds back to them: remedies tried on realisations of the same case."""

from collections.abc import Iterable, Iterator
from typing import Any

from radarsim.config.experiment import Case
from radarsim.studies.ambiguous_doppler.kernels.records import BEYOND_SUM
from radarsim.studies.ambiguous_doppler.study import prepare, simulate

TRIED = 400  # realisations: a share of a tenth is known to 1.5 points
HELPS = 0.1  # share of lost realisations up to which a remedy is one
SMOOTH_MPS2 = 10.0  # acceleration that the model of order 1 allows for: what keeps the lock through turns of some g
LARGER = 100.0  # times the manoeuvre variance
STAGGER = (1.0, 7 / 6, 4 / 3)  # times the repetition rate, used in turn


def cures(spec: Any, name: str, swept: Iterable[str] = ()) -> Iterator[tuple[str, float]]:
    """The remedies that help a filter, as settings of the config, and the share of realisations it then loses.

    swept: keys that the config sweeps, which no setting may change beside it.
    """
    number, one = next((i, one) for i, one in enumerate(spec.filters) if one.name == name)
    key = f"filters.{number}"
    (variance, *_), rates = one.variances, spec.radar.rates_hz
    larger = LARGER * variance
    tried: list[tuple[str, Any, Any]] = []
    if one.combine is None:
        both = {"orders": (1, 2), "combine": "likelihood", "manoeuvre_variance": (SMOOTH_MPS2**2, variance)}
        said = f"--set {key}.orders=[1,2] --set {key}.combine=likelihood "
        said += f"--set {key}.manoeuvre_variance=[{SMOOTH_MPS2**2:g},{variance:g}]"
        tried.append((said, one.model_copy(update=both | {"stay_probability": 0.95}), spec.radar))
        said = f"--set {key}.manoeuvre_variance={larger:g}"
        tried.append((said, one.model_copy(update={"manoeuvre_variance": larger}), spec.radar))
    if len(rates) == 1:
        several = tuple(float(f"{factor * rates[0]:.4g}") for factor in STAGGER)
        said = f"--set radar.repetition_rate_hz=[{','.join(f'{rate:g}' for rate in several)}]"
        tried.append((said, one, spec.radar.model_copy(update={"repetition_rate_hz": several})))
    for said, changed, radar in tried:
        if any(f"--set {key}{end}" in said for key in swept for end in "=."):
            continue
        share = _lost(spec.model_copy(update={"radar": radar, "filters": (changed,), "baseline": None, "rare": None}))
        if share <= HELPS:
            yield said, share


def _lost(spec: Any) -> float:
    """The share of realisations in which the only filter's velocity is off by more than half the span at the end."""
    plan = prepare(Case("", "", "ambiguous_doppler", spec, (), TRIED, 1))
    arrays = plan.layout.unpack(simulate(plan, 0, TRIED))
    return float(arrays["folds"][0, -1, BEYOND_SUM] / arrays["estimates"][0, -1, 0])
