"""A target of a kind that is well known, for a new config: its turn, the scans and the manoeuvre variance that fit it
and the radar; and whether a run is long enough for what it asks."""

import math
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from radarsim.api import configs
from radarsim.config import radial_keys
from radarsim.config.error_list import ErrorList
from radarsim.config.experiment import Case
from radarsim.config.find_files import SHIPPED, did_you_mean
from radarsim.config.new_config import FittedParts
from radarsim.config.yaml_io import read_document
from radarsim.errors import ConfigError, argument
from radarsim.language.translate import tr
from radarsim.report import wording
from radarsim.studies import registry
from radarsim.studies.interface import Study

TARGETS = {  # the scenario of each
    "airliner": "airliner_turn",
    "boat": "boat",
    "drone": "drone",
    "helicopter": "helicopter",
    "missile": "missile",
    "ship": "ship",
}
VALUE_WITH_REASON = re.compile(r"^(\w+): *\S.*?  +# (.+)$", re.MULTILINE)
MAX_CASES = 8  # of a config that are looked at
STANDING_TARGET = {"kind": "polynomial", "coefficients": [1e6]}
MIN_SCANS = 15  # of a run, as of the papers' radars
RANGE_TO_WAY = 2.0  # range at the first plot over the way flown, so that the target stays in front of the radar
VARIANCE_REASON = (
    "here half the turn's acceleration, gained in a scan (Bar-Shalom, Li & Kirubarajan 2001, 6.3.3); see sweep below"
)


def fitted_parts(like: str | os.PathLike[str], name: str) -> FittedParts:
    """What replaces the keys of a config, for a target of a name of TARGETS. Raises ConfigError for another name, and
    for a config whose radar sees no target in range, or of several cases."""
    if name not in TARGETS:
        hint = did_you_mean(name, TARGETS)
        where = argument("target", "--target")
        raise ConfigError(f"{where}: {name}: no such target; there are: {', '.join(TARGETS)}{hint}")
    experiment = configs.load(like)
    case = experiment.cases[0]
    if len(experiment.cases) > 1 or not has_known_settling(case):
        raise ConfigError(
            f"{argument('target', '--target')}: needs a config of one case with filters of range_doppler, as rls1 to "
            f"rls5; {experiment.stem} has {wording.plural(len(experiment.cases), 'case')} of {case.study}"
        )
    target, reasons = _scenario(TARGETS[name])
    period_s = float(case.spec.radar.scan_period_s)
    variance = float(f"{radial_keys.turn_variance(target['acceleration_g'], period_s):.2g}")
    filters = [{**filter_keys, "manoeuvre_variance": variance} for filter_keys in case.keys["filters"]]
    draft = {"realisations": 1, **case.keys, "study": case.study, "target": STANDING_TARGET, "filters": filters}
    settled = settled_s(configs.load(draft).cases[0])
    start = max(2, round((settled or 0.0) / period_s))  # scans before the turn
    scans = max(MIN_SCANS, 2 * start + math.ceil(target["duration_s"] / period_s) + 1)
    last_s = (scans - 1) * period_s
    target["start_s"] = start * period_s
    reasons["start_s"] = "by then the filters have settled"
    reasons["speed_mps"] += "; the prior of folded velocities follows it"
    if target["range_m"] < (range_m := RANGE_TO_WAY * target["speed_mps"] * last_s):
        target["range_m"] = math.ceil(range_m / 1e3) * 1e3
        reasons["range_m"] = "twice what it flies in this run, so that it stays in front of the radar"
    by_place = {f"  {key}": reason for key, reason in reasons.items() if key != "target"} | {
        "target": reasons["target"],
        "scans": f"these last {last_s:g} s: settling, the turn, and as long again",
        "  manoeuvre_variance": VARIANCE_REASON,
    }
    return FittedParts({"target": target, "scans": scans}, {"manoeuvre_variance": variance}, by_place)


def _scenario(stem: str) -> tuple[dict[str, Any], dict[str, str]]:
    """The keys of a shipped scenario; and the comments on their values, on the whole under `target`."""
    file, faults = Path(SHIPPED, "scenarios", f"{stem}.yaml"), ErrorList()
    document = read_document(file, faults)
    faults.raise_if_any()
    assert document is not None  # a file that cannot be read is an error
    text = file.read_text(encoding="utf-8")
    reasons = {key: reason.strip() for key, reason in VALUE_WITH_REASON.findall(text)}
    return dict(document.data), reasons | {"target": text.partition("— ")[2].partition("\n")[0]}


def has_known_settling(case: Case) -> bool:
    """Whether the study knows when the filters of a case have settled."""
    return type(registry.study(case.study)).in_the_long_run is not Study.in_the_long_run


def settled_s(case: Case) -> float | None:
    """The time, s, from which σ of the range has settled in every filter, without a manoeuvre; None where it does not,
    or is not known before a search for D_M."""
    study = registry.study(case.study)
    has_variances = all(isinstance(getattr(f, "manoeuvre_variance", 0.0), float) for f in case.spec.members)
    if not (has_known_settling(case) and has_variances):
        return None
    try:
        scans = study.counted_scans(study.in_the_long_run(case), "r")
    except ConfigError:  # filters do not settle
        return None
    return None if scans is None or scans.reason == "last" else scans.t_s


def short_run_warnings(cases: Sequence[Case]) -> tuple[str, ...]:
    """That the first cases end before their filters have settled, or before the target's manoeuvre, with the scans
    needed."""
    return tuple(dict.fromkeys(filter(None, map(_short_run_warning, cases[:MAX_CASES]))))


def _short_run_warning(case: Case) -> str:
    if not has_known_settling(case):
        return ""
    period_s, scans = float(case.spec.radar.scan_period_s), case.spec.plots
    last_s, start_s = (scans - 1) * period_s, getattr(case.spec.target, "start_s", 0.0)
    if start_s > last_s:
        return tr(
            "{case}: the last of {scans} scans is at {last:g} s, before the target's manoeuvre at {start:g} s: set "
            "scans to {needed} or more",
            case=case.name,
            scans=scans,
            last=last_s,
            start=start_s,
            needed=math.ceil(start_s / period_s) + 2,
        )
    settled = settled_s(case)
    if settled is None or settled <= last_s:
        return ""
    return tr(
        "{case}: the last of {scans} scans is at {last:g} s, before the filters have settled at {settled:g} s: set "
        "scans to {needed} or more",
        case=case.name,
        scans=scans,
        last=last_s,
        settled=settled,
        needed=math.ceil(settled / period_s) + 1,
    )
