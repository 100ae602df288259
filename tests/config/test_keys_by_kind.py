"""Keys that belong to some kinds only: what is refused, what is asked for, what is filled in."""

from typing import Literal

import pytest
from pydantic import ValidationError

from radarsim.config.key_types import Positive, key
from radarsim.config.model import Model
from radarsim.errors import ConfigError


class Shape(Model):
    """A circle, or an ellipse that may be turned."""

    kind: Literal["circle", "ellipse", "point"] = key("kind", "its kind")
    radius_m: Positive | None = key("radius", "of a circle, m", only={"kind": "circle"})
    ratio: Positive | None = key("ratio", "of an ellipse's axes; default: 2", 2.0, only={"kind": "ellipse"})
    turned: Literal["yes", "no"] | None = key("turned", "of an ellipse; default: no", "no", only={"kind": "ellipse"})
    aspect_rad: Positive | None = key("aspect", "of a turned one, rad", 1.0, only={"kind": "ellipse", "turned": "yes"})
    label: str | None = key("label", "of what has a size", None, only={"kind": ("circle", "ellipse")})


@pytest.mark.parametrize(
    ("given", "filled"),
    [
        ({"kind": "circle", "radius_m": 3.0}, {}),
        ({"kind": "ellipse"}, {"ratio": 2.0, "turned": "no"}),
        ({"kind": "ellipse", "ratio": 3.0, "turned": "yes"}, {"aspect_rad": 1.0}),
        ({"kind": "point"}, {}),
    ],
)
def test_what_belongs_has_its_default(given, filled):
    assert Shape.model_validate(given).model_dump(exclude_none=True) == given | filled


@pytest.mark.parametrize(
    ("given", "faults"),
    [
        ({"kind": "circle"}, [("radius_m", "is needed by kind: circle")]),
        ({"kind": "point", "ratio": 1.0}, [("ratio", "belongs to kind: ellipse, not point")]),
        ({"kind": "point", "label": "a"}, [("label", "belongs to kind: circle or ellipse, not point")]),
        ({"kind": "ellipse", "aspect_rad": 1.0}, [("aspect_rad", "belongs to turned: yes, not no")]),
        (
            {"kind": "circle", "turned": "yes", "aspect_rad": 1.0},
            [
                ("radius_m", "is needed by kind: circle"),
                ("turned", "belongs to kind: ellipse, not circle"),
                ("aspect_rad", "belongs to kind: ellipse, not circle"),
            ],
        ),
    ],
)
def test_all_that_does_not_belong_or_is_missing_is_told_at_once(given, faults):
    with pytest.raises(ValidationError) as caught:
        Shape.model_validate(given)
    assert [tuple(each) for each in caught.value.errors()[0]["ctx"]["faults"]] == faults


@pytest.mark.parametrize(
    ("only", "words"),
    [
        ({"knid": "circle"}, r"Wrong\.hole_m: only: no key 'knid' is beside it; there are kind, .*, hole_m"),
        ({"kind": "square"}, r"Wrong\.hole_m: only: kind is one of .*circle, ellipse.*, got square"),
        ({"turned": ("yes", "on")}, r"Wrong\.hole_m: only: turned is one of yes, no, got on"),
    ],
)
def test_a_key_that_belongs_to_what_is_not_there_is_refused_with_its_class(only, words):
    with pytest.raises(ConfigError, match=words):

        class Wrong(Shape):
            hole_m: Positive | None = key("hole", "radius, m", only=only)
