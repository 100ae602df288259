"""What flew: the target of an experiment in one line, for the head of its page."""

import math
from collections.abc import Sequence
from typing import Any

from radarsim.config.experiment import Case
from radarsim.language.numerals import numeral
from radarsim.language.translate import tr

ACCELERATION_UNITS = {"acceleration_mps2": "m/s²", "acceleration_g": "g", "jerk_mps3": "m/s³"}  # of a manoeuvre's size
POLYNOMIAL_UNITS = ("m/s", "m/s²")  # of the derivatives after the first


def target_words(cases: Sequence[Case]) -> str:
    """Kind, speed and manoeuvre of the target that all cases share; empty where they share none."""
    targets = [getattr(case.spec, "target", None) for case in cases]
    target = targets[0]
    if target is None or any(other != target for other in targets) or "kind" not in type(target).model_fields:
        return ""
    kind = tr(str(type(target).model_fields["kind"].description))
    return tr("Target: {words}.", words="; ".join([kind, *_motion(target)]))


def _motion(target: Any) -> list[str]:
    """Speed, and the size and time of the manoeuvre, as far as the target has them."""
    speed, velocity = getattr(target, "speed_mps", None), getattr(target, "velocity_mps", None)
    words = [] if speed is None else [_quantity(speed, "m/s")]
    if velocity is not None:
        words = [tr("{speed} at the first plot", speed=_quantity(math.hypot(*velocity), "m/s"))]
    elif speed is None:
        derivatives = (getattr(target, "coefficients", None) or getattr(target, "range_m", None)) or ()
        pairs = zip(derivatives[1:], POLYNOMIAL_UNITS, strict=False) if isinstance(derivatives, tuple) else ()
        words = [_quantity(value, unit) for value, unit in pairs if value]
    start_s = getattr(target, "start_s", None)
    if start_s is None:
        return words
    sizes = ((getattr(target, name, None), unit) for name, unit in ACCELERATION_UNITS.items())
    size = next((_quantity(value, unit) for value, unit in sizes if value), "")
    if size:
        return [*words, tr("{size} from {t_s:g} s on", size=size, t_s=start_s)]
    return words if velocity is None else [*words, tr("manoeuvres from {t_s:g} s on", t_s=start_s)]


def _quantity(value: float, unit: str) -> str:
    return f"{numeral(f'{value:.4g}')} {tr(unit)}"
