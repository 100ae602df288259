"""What `radarsim tune` minimises: cases with other values of a filter's keys, and the quantity over all of them."""

import math
from collections.abc import Mapping, Sequence
from copy import copy, deepcopy
from dataclasses import replace
from typing import Any

import numpy as np

from radarsim.api.configs import load
from radarsim.api.design.objective import Curve
from radarsim.api.design.tuning_space import Place, SearchedKey, from_scale, set_at_path
from radarsim.config.experiment import Case
from radarsim.config.identity import all_keys
from radarsim.errors import ConfigError
from radarsim.report.user_filters.rival_comparison import TUNED

PILOT_SHARE = 8  # all realisations over those of a value of the scan
MIN_PILOT_REALISATIONS = 200  # of a value of the scan


class Variants:
    """A case with one filter, and the baseline of its gains, with other values of the keys; like `Cases`."""

    def __init__(self, case: Case, filter_name: str, searched: Sequence[SearchedKey], paired: bool):
        self.case, self.filter_name, self.searched, self.seed = case, filter_name, searched, case.seed
        self.keys_by_filter = {member.name: all_keys(member) for member in case.spec.members}
        config_baseline = getattr(case.spec, "baseline", None)
        self.baseline = (config_baseline or next(iter(self.keys_by_filter))) if paired else None
        self.kept_names = {filter_name, self.baseline}
        try:
            self.base = self.case_with_filter(self.keys_by_filter[filter_name])
        except ConfigError:  # other keys name the filters that are left out
            self.kept_names, self.baseline = set(self.keys_by_filter), config_baseline
            self.base = self.case_with_filter(self.keys_by_filter[filter_name])

    def case_with_filter(self, filter_keys: Mapping[str, Any], *tuned: Mapping[str, Any]) -> Case:
        """The case with these keys of the filter, and with a tuned filter if it is given. Raises ConfigError."""
        members = [
            filter_keys if name == self.filter_name else keys
            for name, keys in self.keys_by_filter.items()
            if name in self.kept_names
        ]
        case = case_with_filters(self.case, [*members, *tuned], self.baseline)
        return replace(case, seed=self.seed, noise_keys=self.case.noise_keys or self.case.spec)

    def with_seed(self, seed: int) -> "Variants":
        """The same with noise of another seed."""
        variants = copy(self)
        variants.seed, variants.base = seed, replace(self.base, seed=seed)
        return variants

    def with_keys(self, searched: Sequence[SearchedKey]) -> "Variants":
        """The same with other values of some of the keys."""
        variants = copy(self)
        variants.searched = searched
        return variants

    def case_with_value(self, key: str, place: Place) -> Case:
        """The case with other values. Raises ConfigError where the config refuses them."""
        return self.case_with_filter(self.filter(place))

    def stated_and_tuned_case(self, place: Place) -> Case:
        """The case with the filter as stated and as tuned, with the config's own seed."""
        case = self.case_with_filter(
            self.keys_by_filter[self.filter_name], self.filter(place) | {"name": self.filter_name + TUNED}
        )
        return replace(case, seed=self.case.seed)

    def filter(self, place: Place) -> dict[str, Any]:
        """The filter's keys with other values."""
        filter_keys = deepcopy(self.keys_by_filter[self.filter_name])
        for path, value in from_scale(self.searched, place, filter_keys).items():
            set_at_path(filter_keys, path, value)
        return filter_keys


def case_with_filters(case: Case, members: Sequence[Mapping[str, Any]], baseline: str | None) -> Case:
    """A case with other filters. Raises ConfigError where the config refuses them."""
    settings = {"study": case.study, "realisations": case.realisations, "seed": case.seed, "baseline": baseline}
    keys = all_keys(case.spec) | settings | {type(case.spec).bare_keys: members}
    (loaded,) = load({key: value for key, value in keys.items() if value is not None}).cases
    return replace(case, spec=loaded.spec)


class FamilyCost:
    """What is minimised, at a place of the search: over the family the root of the mean square of a size, the mean of
    anything else; of a quantity that is better the larger, 100 % less its value."""

    def __init__(self, variants: Sequence[Variants], curves: Sequence[Curve], exact: bool, count: int):
        self.variants, self.curves, self.exact, self.count = variants, curves, exact, count
        self.searched, self.filter_keys = variants[0].searched, variants[0].keys_by_filter[variants[0].filter_name]
        self.definition = curves[0].quantity.definition
        self.rough = exact and any(curve.has_rough_values for curve in curves)

    def with_noise(self, seed_offset: int) -> "FamilyCost":
        """The same with noise of another seed, so much more than that of the config."""
        return self._with_variants(
            [variant.with_seed((variant.case.seed + seed_offset) % 2**64) for variant in self.variants]
        )

    def with_keys(self, searched: Sequence[SearchedKey]) -> "FamilyCost":
        """The same over some of the keys."""
        return self._with_variants([variant.with_keys(searched) for variant in self.variants])

    def _with_variants(self, variants: Sequence[Variants]) -> "FamilyCost":
        curves = [
            Curve(variant, "", curve.objective, curve.realisations, curve.progress, sampled=not self.exact)
            for variant, curve in zip(variants, self.curves, strict=True)
        ]
        return FamilyCost(variants, curves, self.exact, self.count)

    @property
    def pilot_realisations(self) -> int:
        """Realisations of a value of a scan."""
        return min(self.count, max(MIN_PILOT_REALISATIONS, self.count // PILOT_SHARE))

    def combined(self, values: Sequence[Any]) -> Any:
        """The quantity of the family, from the values of its cases, numbers or arrays."""
        is_size = self.definition.kind == "size"
        mean = sum(value**2 if is_size else value for value in values) / len(values)
        return mean**0.5 if is_size else mean

    def combined_cost(self, values: Sequence[Any]) -> Any:
        """What is minimised, from the values of the cases."""
        combined = self.combined(values)
        return 100.0 - combined if self.definition.more_is_better else combined

    def from_costs(self, costs: Sequence[float]) -> tuple[float, ...]:
        """The quantity at costs."""
        return tuple(100.0 - cost if self.definition.more_is_better else cost for cost in costs)

    def batch_costs(self, place: Place) -> np.ndarray:
        """The costs at a place with all realisations, then without each of the batches (1 + batches,)."""
        values = [
            curve.objective.batch_values(variant.case_with_value("", place), self.count)[:, 0]
            for variant, curve in zip(self.variants, self.curves, strict=True)
        ]
        return np.asarray(self.combined_cost(values))

    def __call__(self, place: Place, count: int | None = None) -> float:
        """The cost at a place, with all training realisations or fewer; infinite if there is no estimate."""
        if self.rough:
            values = [curve.roughly(place) for curve in self.curves]
        elif self.exact:
            values = [curve.exact_value(place) for curve in self.curves]
        else:
            values = [curve.simulate(place, count or self.count).value for curve in self.curves]
        cost = float(self.combined_cost(values))
        return math.inf if math.isnan(cost) else cost
