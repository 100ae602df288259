"""The keys of a study: its filters, baseline and length of a run."""

import types
import typing
import unicodedata
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, ClassVar, Protocol, TypeVar, cast, get_args

import pydantic
from pydantic import AfterValidator, Field
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError

from radarsim.config.cross_checks import CheckError, check_error, cross_check
from radarsim.config.key_types import Name, WholeNumber, key
from radarsim.config.marks import DesignMark, DisplayMark, NameIn, ProcessNoiseMark
from radarsim.config.model import Model, annotation_parts

VARIANCE_FACTORS = tuple(10.0**power for power in range(-2, 4))  # of a sweep, times the given value
SIGMA_FACTORS = (0.1, 0.3, 1, 3, 10)


class StudyKeys(Model):
    """The top-level keys of a study, beside the common ones.

    bare_keys: the list in whose members `sweep` and `--set` look for a bare key. figure_names: all figures that the
    report may draw, with * for what depends on the config; None if unknown: names under `figures` go unchecked.
    in_place_of: for each key, by its dotted name, the key that it replaces: where an override or a sweep sets the one,
    the other is removed.
    """

    bare_keys: ClassVar[str] = "filters"
    figure_names: ClassVar[tuple[str, ...] | None] = None
    in_place_of: ClassVar[Mapping[str, str]] = {}

    @classmethod
    def convert_keys(cls, study: str, data: Mapping[str, Any]) -> dict[str, Any] | None:
        """Convert the keys of another study's config, as read, to this study's: the same experiment as far as possible.

        Keys that this study lacks stay as they are, so that the check refuses them. None if it cannot convert."""
        return None

    @classmethod
    def sample_sweep(cls, data: Mapping[str, Any]) -> tuple[Mapping[str, Any], str]:
        """A sweep for a new config with this data, which stands there as a comment, and what it shows: of the process
        noise, where filters share its value."""
        members = [member for member in data.get(cls.bare_keys, ()) if isinstance(member, Mapping)]
        for name, field in _process_noise_fields(cls).items():
            values = [member[name] for member in members if name in member]
            if len(values) > 1 and values.count(values[0]) == len(values) and _is_number(values[0]) and values[0] > 0:
                factors = SIGMA_FACTORS if name.startswith("sigma") else VARIANCE_FACTORS
                extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
                label = extra.get("symbol", field.title)
                purpose = f"uncomment: each filter at its best {label}, and the gain then"
                return {name: [float(f"{factor * values[0]:.4g}") for factor in factors]}, purpose
        return {"some_key": [1, 2, 3]}, ""

    @property
    def device(self) -> str | None:
        """The display name of the sensor: that of the first mapping with a name."""
        parts = (getattr(self, key) for key in type(self).model_fields)
        names = (dict(part).get("name") for part in parts if isinstance(part, Model))
        return next(filter(None, names), None)

    @property
    def members(self) -> tuple[Any, ...]:
        """The list of `bare_keys`: the filters of a case."""
        return getattr(self, self.bare_keys)

    @cross_check
    def _check_names(self) -> Iterator[CheckError]:
        for field_name, field in type(self).model_fields.items():
            for mark in field.metadata:
                if isinstance(mark, NameIn) and getattr(self, field_name) is not None:
                    names = [member.name for member in getattr(self, mark.field)]
                    if getattr(self, field_name) not in names:
                        member_word = mark.field.removesuffix("s")
                        yield check_error(field_name, f"must be the name of a {member_word}: {', '.join(names)}")


def is_process_noise(keys: type[StudyKeys], key: str) -> bool:
    """Whether a bare key is one of process noise, of the filters of a study."""
    return key in _process_noise_fields(keys)


def process_noise_key(member: Model) -> str:
    """The first key of process noise that a filter has, with a number above zero; else empty."""
    values = ((name, getattr(member, name)) for name in _marked_fields(type(member)))
    return next((name for name, value in values if _is_number(value) and value > 0), "")


def _process_noise_fields(keys: type[StudyKeys]) -> dict[str, FieldInfo]:
    """The keys of process noise of a study's filters, by name."""
    annotation = keys.model_fields[keys.bare_keys].annotation if keys.bare_keys in keys.model_fields else None
    models = [part for part in annotation_parts(annotation) if isinstance(part, type) and issubclass(part, Model)]
    return {name: field for model in models for name, field in _marked_fields(model).items()}


def _marked_fields(model: type[Model]) -> dict[str, FieldInfo]:
    return {
        name: field
        for name, field in model.model_fields.items()
        if any(isinstance(mark, ProcessNoiseMark) for mark in field.metadata)
    }


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def possible_kinds(keys: type[Model]) -> tuple[str, ...]:
    """The allowed values of a model's key `kind`; for the keys of a study, those of its filters."""
    if issubclass(keys, StudyKeys):
        members = [
            member for member in annotation_parts(keys.model_fields[keys.bare_keys].annotation) if _is_model(member)
        ]
        return tuple(kind for member in members for kind in possible_kinds(member))
    return get_args(keys.model_fields["kind"].annotation) if "kind" in keys.model_fields else ()


def _is_model(part: Any) -> bool:
    return isinstance(part, type) and issubclass(part, Model)


def extend_kinds(
    keys: type[StudyKeys],
    further_models: Mapping[str, type[Model]],
    unusable_reasons: Mapping[str, str],
    rebuild_arguments: tuple[Callable[[str], type[StudyKeys]], str],
) -> type[StudyKeys]:
    """The keys of a study whose filters may be of further kinds; a filter without a kind is the study's own.

    unusable_reasons: for each unusable kind the reason. rebuild_arguments: a function and its argument that return the
    same keys, by which a config is pickled."""
    info = keys.model_fields[keys.bare_keys]
    (own_model, _) = get_args(info.annotation)
    kinds = dict.fromkeys(possible_kinds(own_model), own_model) | dict(further_models)
    first = next(iter(kinds))

    def kind_of(data: Any) -> Any:
        return data.get("kind", first) if isinstance(data, dict) else getattr(data, "kind", first)

    def check_kind(data: Any) -> Any:
        if (kind := kind_of(data)) not in list(kinds):  # which may compare something other than text
            reason = f"; {unusable_reasons[kind]}" if isinstance(kind, str) and kind in unusable_reasons else ""
            error_context = {"kinds": ", ".join(kinds), "reason": reason, "discriminator": "kind"}
            raise PydanticCustomError("no_such_kind", "must be one of {kinds}{reason}", error_context)
        return data

    tagged_models = tuple(Annotated[model, pydantic.Tag(f"kind: {kind}")] for kind, model in kinds.items())
    union: Any = typing.Union[tagged_models]  # noqa: UP007
    choice: Any = Annotated[
        union, pydantic.Discriminator(lambda data: f"kind: {kind_of(data)}"), pydantic.BeforeValidator(check_kind)
    ]
    members: Any = (tuple[choice, ...], info)
    new_keys: Any = pydantic.create_model(
        keys.__name__, __base__=keys, __module__=keys.__module__, __doc__=keys.__doc__, **{keys.bare_keys: members}
    )
    new_keys.__reduce__ = lambda self: (_rebuild_keys, (*rebuild_arguments, dict(self), self.model_fields_set))
    return cast(type[StudyKeys], new_keys)


def _rebuild_keys(
    find: Callable[..., type[StudyKeys]], name: str, values: dict[str, Any], given_names: set[str]
) -> StudyKeys:
    return find(name).model_construct(given_names, **values)


class HasName(Protocol):
    """A member of a list with a name."""

    @property
    def name(self) -> str: ...


NamedMember = TypeVar("NamedMember", bound=HasName)


def unique_names(members: tuple[NamedMember, ...]) -> tuple[NamedMember, ...]:
    """Check that the members of a list have different names; for AfterValidator."""
    names: set[str] = set()
    for member in members:
        name = unicodedata.normalize("NFC", member.name)  # names that look alike are equal
        if name in names:
            raise PydanticCustomError("unique", "names must differ: {name} is there twice", {"name": member.name})
        names.add(name)
    return members


# For most studies: the filters that are compared, and the name of the one that gains are relative to.
Members = Annotated[
    tuple[NamedMember, ...], Field(min_length=1, max_length=16), AfterValidator(unique_names), DesignMark()
]
Baseline = Annotated[Name | None, DesignMark(), NameIn("filters")]
BASELINE = key(
    "baseline filter", "filter against which gains are computed, or a list of several; default: the first", None
)
# The length of a run, of `TimedStudyKeys`.
SCANS = key("number of scans", "number of scans; or give duration_s", None)
DURATION = key(
    "duration", "time from the first scan to the last, s, in place of scans: to the last scan within it", None
)


class Member(Model):
    """A member of a list whose members differ by their names."""

    name: Annotated[Name, DisplayMark()] = key("name", "label; every filter has its own")


def part_models(part: Any) -> tuple[Any, ...]:
    """The models of a part of a config: it alone, or those of a choice `A | B`."""
    return get_args(part) if isinstance(part, types.UnionType) else (part,)


def make_study_keys(
    name: str, module: str, parts: Mapping[str, Any], filters: type[Member], max_scans: int
) -> type[StudyKeys]:
    """The keys of a study: these mappings by name, each of one model or of several `A | B` that differ in their key
    `kind`, and `filters`, `baseline` and `scans`.

    name, module: those of the class."""
    fields: Any = {}
    for part_name, part in parts.items():
        models = part_models(part)
        about = (
            (models[0].__doc__ or part_name).strip().partition("\n")[0].rstrip(".") if len(models) == 1 else part_name
        )
        choice = part if len(models) == 1 else Annotated[part, Field(discriminator="kind")]
        fields[part_name] = (choice, key(part_name.replace("_", " "), about))
    fields |= {
        "filters": (Members[filters], key("filters", "the filters; all see the same world")),  # type: ignore[valid-type]
        "baseline": (Baseline, BASELINE),
        "scans": (Annotated[int, WholeNumber(2, max_scans), DesignMark()], key("number of scans", "number of plots")),
    }
    about = f"Keys: {', '.join(parts)}, filters, baseline and scans."
    study_keys: type[StudyKeys] = pydantic.create_model(
        name, __base__=StudyKeys, __module__=module, __doc__=about, **fields
    )
    return study_keys
