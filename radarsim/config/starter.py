"""The text of a new config, each key with its description from the schema."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from radarsim.config.commented_yaml import CommentedYaml, description, with_comment
from radarsim.config.common_keys import COMMON_KEYS, CommonKeys
from radarsim.config.study_keys import StudyKeys
from radarsim.config.yaml_text import one_line_yaml

NAMING_KEYS = ("name", "like")  # of the config that it is taken from


def starter_text(
    data: Mapping[str, Any],
    study_keys: type[StudyKeys],
    name: str,
    like: str,
    reasons: Mapping[str, str] = MappingProxyType({}),
) -> str:
    """The YAML of a config under a new name, each key with its description from the schema.

    data: as read, with keys as written; reasons: as CommentedYaml has them. Missing optional keys follow as comments,
    with their defaults."""
    lines = [
        f"# {name}.yaml — like {like}: change the numbers, then `radarsim run {name}.yaml`",
        "# Units stand in the keys: _m, _s, _mps (m/s), _mps2 (m/s²), _hz, _rad; _deg is taken wherever _rad is.",
    ]
    common_data = {key: value for key, value in data.items() if key in COMMON_KEYS and key not in NAMING_KEYS}
    study_data = {key: value for key, value in data.items() if key not in COMMON_KEYS}
    # The display name of a radar or sensor becomes the config's name.
    named_parts = {key: value for key, value in study_data.items() if isinstance(value, Mapping) and "name" in value}
    study_data |= {key: {**value, "name": name} for key, value in named_parts.items()}
    # Keys laid over an included config need not be complete.
    yaml, study_yaml = CommentedYaml(), CommentedYaml(adds_optional="include" not in data, reasons=reasons)
    for key in ("study", "include"):
        if key in common_data:
            lines += yaml.key_lines(key, common_data.pop(key), CommonKeys, "")
    if study_data:
        lines += study_yaml.mapping_lines(study_data, study_keys, "")
    lines += [line for key, value in common_data.items() for line in yaml.key_lines(key, value, CommonKeys, "")]
    sweep, purpose = study_keys.sample_sweep(data)
    samples = {
        "sweep": (one_line_yaml(sweep), purpose or description(CommonKeys, "sweep")),
        **{key: (value, description(CommonKeys, key)) for key, value in (("realisations", "1e5"), ("seed", "1"))},
    }
    lines += [with_comment(f"# {key}: {value}", text) for key, (value, text) in samples.items() if key not in data]
    return "\n".join(lines) + "\n"
