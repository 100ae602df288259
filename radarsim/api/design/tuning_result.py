"""The result of a tuning: the values found, and what they change."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from radarsim.api.design.quantities import MeasuredQuantity
from radarsim.api.design.tuning_space import parse_path, set_at_path
from radarsim.api.display import Displayable
from radarsim.config.experiment import Case
from radarsim.config.identity import all_keys
from radarsim.language.translate import join_names, plural, tr
from radarsim.report import tables
from radarsim.report.user_filters.rival_comparison import TUNED
from radarsim.report.wording import format_number, with_unit

if TYPE_CHECKING:
    import pandas as pd

    from radarsim.api.design.tuning_cost import FamilyCost


NO_GAIN = 0.1  # per cent or points of an exact gain that are called nothing


@dataclass(frozen=True)
class TunedKey:
    """A key as it was stated and is tuned; exact: the range that is as good to 0.1 %, the other keys tuned; sampled:
    the 95 % interval of the best value, None where it is not known."""

    key: str
    unit: str
    stated: float
    tuned: float
    lo: float | None
    hi: float | None


@dataclass(frozen=True)
class TunedQuantity:
    """The quantity of a case, or of all, with stated and tuned keys; gain and its 95 % interval in per cent of the
    stated value, of a share in points. Exact: lo and hi equal the gain."""

    case: str
    stated: float
    tuned: float
    gain: float
    lo: float
    hi: float


@dataclass(frozen=True, repr=False)
class TuningResult(Displayable):
    """What was found: keys, the gain of each case and that of all.

    training and judged are numbers of realisations a case, none where exact; minimised says what is least, or largest.
    search_ends: the quantity where each of the searches ended, the best first, on the realisations that chose the best.
    settings are the tuned values by key; command is a run with them, of the noise with which the gain is measured.
    inert: the keys without effect on the quantity, which are not tuned unless they are named."""

    stem: str
    filter: str
    quantity: MeasuredQuantity
    unit: str
    minimised: str
    exact: bool
    keys: tuple[TunedKey, ...]
    cases: tuple[TunedQuantity, ...]
    all: TunedQuantity
    training: int
    judged: int
    settings: Mapping[str, float]
    command: str
    search_ends: tuple[float, ...] = ()
    notes: tuple[str, ...] = ()
    inert: tuple[str, ...] = ()

    @property
    def table(self) -> "pd.DataFrame":
        """A row for each key: stated and tuned value, and the range of the tuned one."""
        return tables.frame({name: [getattr(key, name) for key in self.keys] for name in TunedKey.__annotations__})

    @property
    def gains(self) -> "pd.DataFrame":
        """A row for each case, and the last for all of them: what tuning gains."""
        rows = (*self.cases, self.all)
        return tables.frame({name: [getattr(row, name) for row in rows] for name in TunedQuantity.__annotations__})

    @property
    def gain_unit(self) -> str:
        """What gains are counted in."""
        return "%" if self.quantity.definition.kind == "size" else tr("points") if self.unit == "%" else tr(self.unit)

    @property
    def is_flat(self) -> bool:
        """Whether no key has an effect on the quantity."""
        return {key.key for key in self.keys} <= {*self.inert}

    @property
    def answer(self) -> str:
        """What tuning gains, and how far the search looked."""
        return " ".join(sentence for sentence in (self._gain_sentence, self._search_sentence) if sentence)

    @property
    def _search_sentence(self) -> str:
        """How many searches started, and where they ended; empty for one, and where no key has an effect."""
        if len(self.search_ends) < 2 or self.is_flat:
            return ""
        ends = [format_number(end, ".4g") for end in (min(self.search_ends), max(self.search_ends))]
        where = f"{tr('{low} to {high}', low=ends[0], high=ends[1]) if len({*ends}) > 1 else ends[0]} {tr(self.unit)}"
        fields = {"count": str(len(self.search_ends)), "where": where.rstrip()}
        if self.exact:
            return tr("Best of {count} starts, which ended at {where}.", **fields)
        return tr("Best of {count} starts, which ended at {where} on the realisations that chose among them.", **fields)

    @property
    def _gain_sentence(self) -> str:
        """What tuning gains."""
        total, quantity_field = self.all, {"quantity": self.quantity.translated_words}
        if self.exact:
            if nothing := self._nothing_sentence:
                return nothing
            how = tr("exact")
        else:
            other_realisations = plural("{count} other realisation", "{count} other realisations", self.judged)
            how = f"95 % {format_number(total.lo, '+.3g')} … {format_number(total.hi, '+.3g')}; {other_realisations}"
        fields = quantity_field | {"gain": f"{format_number(total.gain, '.3g')} {self.gain_unit}", "how": how}
        fields |= {
            "stated": format_number(total.stated, ".4g"),
            "tuned": f"{format_number(total.tuned, '.4g')} {tr(self.unit)}".rstrip(),
        }
        if total.hi < 0:
            fields["gain"] = f"{format_number(-total.gain, '.3g')} {self.gain_unit}"
            return tr("Tuning loses {gain} in the {quantity}: {stated} → {tuned} ({how}).", **fields)
        if not total.lo > 0:
            return tr("Tuning gains nothing that shows in the {quantity}: {gain} ({how}).", **fields)
        return tr("Tuning gains {gain} in the {quantity}: {stated} → {tuned} ({how}).", **fields)

    @property
    def _nothing_sentence(self) -> str:
        """That there is nothing to gain, of an exact quantity; empty where there is."""
        fields = {"quantity": self.quantity.translated_words}
        if self.is_flat:
            return plural(
                "There is nothing to tune: {keys} has no effect on {quantity}.",
                "There is nothing to tune: {keys} have no effect on {quantity}.",
                len(self.inert),
                keys=join_names(self.inert),
                **fields,
            )
        if abs(self.all.gain) >= NO_GAIN:
            return ""
        limit = f"{format_number(NO_GAIN)} {self.gain_unit}"
        return tr(
            "Tuning gains nothing: {quantity} as stated is within {limit} of its best (exact).", limit=limit, **fields
        )

    def member(self, case: Case) -> dict[str, Any]:
        """The tuned filter as the keys of a further one of a case."""
        (index,) = [i for i, member in enumerate(case.spec.members) if member.name == self.filter]
        filter_keys = all_keys(case.spec.members[index])
        for key, value in self.settings.items():
            set_at_path(filter_keys, parse_path(key.split(".", 2)[2]), value)
        return filter_keys | {"name": self.filter + TUNED}

    def _answer_lines(self) -> list[str]:
        return [self.answer, *(f"{key.key} = {with_unit(key.tuned, key.unit)}" for key in self.keys)]


def family_words(family: "FamilyCost", cases: int) -> str:
    """What the search makes least, or largest, in words."""
    quantity_words = family.curves[0].quantity.translated_words
    if cases == 1:
        return quantity_words
    fields = {"quantity": quantity_words, "cases": str(cases)}
    if family.definition.kind == "size":
        return tr("{quantity}, root mean square of {cases} cases", **fields)
    return tr("{quantity}, mean of {cases} cases", **fields)
