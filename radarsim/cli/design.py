"""What the terminal says of an answer: the value that was solved for, what it attains, its slope, the check.

Commands for a design: which value attains what is wanted, where a radar lies. Heavy imports wait inside them.
"""

import math
from collections.abc import Hashable, Sequence
from typing import TYPE_CHECKING, Any

import click

from radarsim.cli import group
from radarsim.cli.console import command, field, say, show
from radarsim.language import term, tr
from radarsim.report.tables import significant_digits

if TYPE_CHECKING:
    from radarsim.app.compare import Drawn
    from radarsim.app.quantities import Quantity
    from radarsim.app.question import Answer
    from radarsim.app.sensitivity import Sensitivity


# ---- answers ---------------------------------------------------------------------------------------------------------
PLAIN = ".6g"
RATES = ("lock", "right")  # kinds of which what is left to 100 % matters
MOST_DIGITS = 12  # behind the point: beyond, rounding shows
SAME = 1e-9  # of a quantity: how near an exact root comes


def print_answer(answer: "Answer") -> None:
    """A value with what it attains, then a line each: the slope, other values, the confirming run."""
    value, lo, hi = answer.value, answer.lo, answer.hi
    assert value is not None  # what is not attained is no answer
    assert lo is not None
    assert hi is not None
    interval = tr("exact") if answer.exact else f"95 % {_number(lo)} … {_number(hi)}"
    say(f"{answer.key} = {_with_unit(value, answer.unit)}   {interval}")
    attained = math.nan if answer.attained is None else answer.attained
    if abs(attained - answer.equals) < SAME * max(abs(answer.equals), abs(answer.attained_now)):
        attained = answer.equals  # of a root at zero rounding is all that is left
    field("attains", f"{answer.quantity.said}: {_quantity(answer, attained)}{_now(answer)}")
    if answer.slope is not None:
        field("slope", slope(answer))
    if answer.others:
        field("also at", ", ".join(_with_unit(other, answer.unit) for other in answer.others))
    for note in answer.notes:
        field("note", tr(note))
    command("check", answer.command)


def unattained(answer: "Answer") -> list[str]:
    """Why there is no answer: the nearest that was found, and where."""
    limit, at = answer.limit, answer.limit_at
    assert limit is not None
    assert at is not None
    told = {
        **{"quantity": answer.quantity.said, "key": answer.key, "wanted": _quantity(answer, answer.equals)},
        **{"low": _number(answer.low), "high": _with_unit(answer.high, answer.unit)},
        **{"limit": _quantity(answer, limit), "at": _with_unit(at, answer.unit)},
    }
    most = limit < answer.equals
    line = tr(AT_MOST, **told) if most else tr(AT_LEAST, **told)
    return [line, *(tr("note: {words}", words=tr(note)) for note in answer.notes)]


AT_MOST = term("{quantity}: {wanted} is not attainable by {key} from {low} to {high}: at most {limit}, at {at}")
AT_LEAST = term("{quantity}: {wanted} is not attainable by {key} from {low} to {high}: at least {limit}, at {at}")


def print_drawn(drawn: "Drawn") -> None:
    """Where each case lies, a line each, and what was written."""
    for line in drawn.sentences:
        say(line)
    kinds = sorted(name for name in drawn.files if name.endswith((".svg", ".png", ".pdf")))
    if kinds:
        field("figures", f"{drawn.folder} ({', '.join(kinds)})")
    field("table", str(drawn.folder / "chart.csv"))
    field("page", str(drawn.folder / "chart.html"))


def print_sensitivity(found: "Sensitivity", written: "Sequence[str]") -> None:
    """A table of the leading component: key, its values, and the change of σ and gain of each filter."""
    rows = [row for row in found.rows if row["component"] == found.leading]
    filters = list(dict.fromkeys(row["filter"] for row in rows))
    gaining = [
        one for one in filters if any(not math.isnan(row["gain_percent"]) for row in rows if row["filter"] == one)
    ]
    cells = []
    for key in dict.fromkeys(row["key"] for row in rows):
        own = {row["filter"]: row for row in rows if row["key"] == key}
        first = next(iter(own.values()))
        changed = _with_unit(first["changed_value"], found.labels[str(key)].unit)
        line = [key, f"{_number(first['value'])} → {changed}"]
        line += [_change(own.get(one), "sigma_change", "percent", "%") for one in filters]
        line += [_change(own.get(one), "gain_change", "points", "") for one in gaining]
        cells.append(line)
    columns = ["key", "value", *(tr("σ of {name}", name=one) for one in filters)]
    columns += [tr("gain of {name}, points", name=one) for one in gaining]
    title = tr(
        "{stem}: change of {component} {when} for +10 %", stem=found.stem, component=found.leading, when=found.at
    )
    show(title, columns, cells, right=columns[1:], spare=columns[:1:-1])
    if found.without_effect:
        field("no effect", ", ".join(found.without_effect))
    if found.without_estimate:
        field("no estimate", ", ".join(found.without_estimate))
    if found.not_paired:
        what = tr(
            "{keys}: the scans are at other times, so each has noise of its own", keys=", ".join(found.not_paired)
        )
        field("not paired", what)
    for key, reason in found.left_out.items():
        field("left out", f"{key}: {reason}")
    field("files", ", ".join(written))


def _change(row: "dict[Hashable, Any] | None", name: str, ending: str, unit: str) -> str:
    """A change with its sign, and with its interval where it has one."""
    if row is None:
        return ""
    value, lo, hi = (row[f"{name}_{end}"] for end in (ending, "lo", "hi"))
    text = f"{_number(value, '+.3g')} {unit}".strip()
    return text if row["exact"] else f"{text} [{_number(lo, '+.2g')}, {_number(hi, '+.2g')}]"


def slope(answer: "Answer") -> str:
    """What a little more of the key changes: `1 m/s more costs 1.7 points`."""
    value, per_unit = answer.value, answer.slope
    assert value is not None
    assert per_unit is not None
    step = 10.0 ** math.floor(math.log10(abs(value) / 2)) if value else 1.0
    step = max(step, 1.0) if float(value).is_integer() and step >= 0.5 else step
    change = per_unit * step
    better = (change > 0) == answer.quantity.of.more_is_better
    size = _number(abs(change), "#.3g")
    points = tr("{size} points", size=size)
    changed = points if answer.quantity_unit == "%" else f"{size} {tr(answer.quantity_unit)}"
    told = {"step": _with_unit(step, answer.unit, PLAIN), "change": changed}
    if answer.quantity.of.more_is_better:
        return tr("{step} more brings {change}", **told) if better else tr("{step} more costs {change}", **told)
    return tr("{step} more takes off {change}", **told) if better else tr("{step} more adds {change}", **told)


def _now(answer: "Answer") -> str:
    if math.isnan(answer.attained_now):
        return ""
    value = _quantity(answer, answer.attained_now)
    if answer.now is None:
        return tr(" (as the config is: {value})", value=value)
    return tr(" (at {at}: {value})", at=_with_unit(answer.now, answer.unit, PLAIN), value=value)


def _quantity(answer: "Answer", value: float) -> str:
    return f"{_rate(value) if answer.quantity.kind in RATES else _number(value, '.4g')} {tr(answer.quantity_unit)}"


def _rate(percent: float) -> str:
    """A share in per cent: of one that is nearly all so many digits that three are of the rest.

    >>> _rate(99.9990021)
    '99.999002'
    """
    rest = 100.0 - percent
    if not 0.0 < rest < 1.0:
        return _number(percent, ".4g")
    return _number(percent, f".{min(2 - math.floor(math.log10(rest)), MOST_DIGITS)}f")


def _with_unit(value: float, unit: str, form: str = PLAIN) -> str:
    return f"{_number(value, form)} {tr(unit)}".rstrip()


def _number(value: float, form: str = PLAIN) -> str:
    return significant_digits(value, form)


# ---- design ----------------------------------------------------------------------------------------------------------
OPTIONS = {
    "gain": ("COMPONENT", "Gain in a component (r, Vr, …) against the baseline, per cent."),
    "sigma": ("COMPONENT", "σ of a component, in its unit."),
    "lock": ("NAME", "Rate of locks of this estimator, per cent (discriminator)."),
    "right": ("NAME", "Rate of rightly unfolded velocities of this filter, per cent."),
    "loss": ("NAME", "Ends of the target's track an hour with this tracker (sonar)."),
    "false_tracks": ("NAME", "False tracks an hour of this tracker (sonar)."),
}


class Named(click.ParamType):
    """A name after an option; not the next option, which click would take for it and then stumble over what is left."""

    def __init__(self, metavar: str):
        self.name = metavar

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        text = str(value)
        if text.startswith("--"):
            filters = "" if self.name == "COMPONENT" else ", of the filter itself, without --filter"
            self.fail(f"must be followed by a {self.name}{filters}, got {text}", param, ctx)
        return text


def quantity_options(command: Any) -> Any:
    """The options that name a quantity."""
    for kind, (metavar, text) in reversed(OPTIONS.items()):
        name = f"--{kind.replace('_', '-')}"
        command = click.option(name, kind, type=Named(metavar), metavar=metavar, help=text)(command)
    return command


at_options = (
    click.option("--at", "at_s", type=float, metavar="S", help="At this time, s; default: the last scan."),
    click.option("--at-k", type=click.IntRange(1), metavar="K", help="At this scan, from 1, in place of --at."),
)


@group.main.command()
@group.config_argument
@click.argument("key", metavar="KEY")
@quantity_options
@click.option("--filter", "filter_name", metavar="NAME", help="The filter, where there are several.")
@at_options[0]
@at_options[1]
@click.option("--equals", type=float, required=True, metavar="X", help="What it shall be: per cent of gains and rates.")
@click.option("--between", type=(float, float), metavar="LO HI", help="Values of KEY that are searched.")
@click.option("--case", metavar="CASE", help="The case, of a config that has several.")
@group.set_option
@group.realisations_option
@group.seed_option
@group.threads_option
@group.json_option
def solve(
    config: str,
    key: str,
    filter_name: str | None,
    at_s: float | None,
    at_k: int | None,
    equals: float,
    between: tuple[float, float] | None,
    case: str | None,
    overrides: tuple[str, ...],
    realisations: int | None,
    seed: int | None,
    threads: int | None,
    as_json: bool,
    **kinds: str | None,
) -> None:
    """The value of KEY at which a quantity reaches a target.

    KEY is any key that holds a number, by its dotted path as for --set; a bare filter key means that of all filters.
    Where the quantity is known exactly (linear filters), so is the answer. Else each value is simulated with the same
    noise, and the answer has a 95 % interval. What is not attainable ends in exit code 3, with the nearest there is.
    A positive key is searched from a thousandth to a thousand times its value, unless --between says otherwise.

    \b
    Examples
      radarsim solve rls2 radar.sigma_velocity_mps --gain r --filter r+Vr --at 60 --equals 30
      radarsim solve rls2 radar.scan_period_s --sigma Vr --filter r --at 60 --equals 5
      radarsim solve discriminator burst.noise_variance --lock sequence --equals 95 -n 1000
      radarsim solve sonar_clutter sensor.detection_probability --loss nearest --equals 5 --between 0.6 1 \\
          --case "sonar_clutter sensor.false_plots_per_km2=1" -n 2000
    """
    from radarsim.app import result, run
    from radarsim.app import solve as solving
    from radarsim.cli import console
    from radarsim.errors import TargetUnmet

    quantity = asked(kinds, filter_name, at_s, at_k)
    overrides = run.merged(overrides, None, seed)
    with console.Progress(key, quiet=as_json, what="values") as progress:
        answer = solving.solve(
            *(config, key, quantity, equals),
            overrides=overrides,
            between=between,
            case=case,
            realisations=realisations,
            threads=threads,
            progress=progress.update,
            told=None if as_json else console.say_aside,
        )
    if as_json:
        click.echo(result.text(result.answer(answer)))
    elif answer.value is not None:
        print_answer(answer)
    if answer.value is None:
        raise TargetUnmet(*unattained(answer))


def asked(kinds: "dict[str, str | None]", filter_name: str | None, at_s: float | None, at_k: int | None) -> "Quantity":
    """The quantity that the options name. Raises UsageError unless it is one."""
    from radarsim.app.quantities import Quantity

    given = {kind: value for kind, value in kinds.items() if value is not None}
    if len(given) != 1:
        options = ", ".join(f"--{kind.replace('_', '-')}" for kind in OPTIONS)
        raise click.UsageError(f"name one quantity: {options}")
    if at_s is not None and at_k is not None:
        raise click.UsageError("--at and --at-k do not go together: a time or a scan")
    ((kind, name),) = given.items()
    of_component = kind in ("gain", "sigma")
    if not of_component and filter_name is not None:
        raise click.UsageError(f"--{kind.replace('_', '-')} names the filter itself: leave --filter out")
    component, chosen = (name, filter_name) if of_component else (None, name)
    return Quantity(kind, chosen, component, at_s, at_k)


@group.main.command()
@click.argument("configs", nargs=-1, metavar="[CONFIG…]", shell_complete=group.completed)
@group.set_option
@group.out_option
@group.drawing_options
@group.json_option
def chart(
    configs: tuple[str, ...], overrides: tuple[str, ...], out: str, drawing: group.Drawing, as_json: bool
) -> None:
    """What Doppler gains for every radar, and yours on it; simulates nothing.

    Gains over time and in the long run against c = (σ_r/σ_V)² (D_M/σ_r²)^(1/3), on which alone they depend as the scan
    period becomes short, a map with the period in it, and a sentence where each case of CONFIG lies. Also
    DIR/chart/chart.html, a page of its own with sliders, which computes σ(k) and gains of any radar as they move.

    \b
    Examples
      radarsim chart                              the first paper's five radars
      radarsim chart rls2 --set radar.sigma_velocity_mps=5
    """
    from radarsim.app import compare, result
    from radarsim.cli import console

    with console.Progress("chart", quiet=as_json, what="figures") as progress:
        shown: dict[str, Any] = {"formats": drawing.formats, "width_mm": drawing.width_mm}
        drawn = compare.chart(configs, out, overrides=overrides, progress=progress.update, **shown)
    if as_json:
        click.echo(result.text(result.drawn(drawn)))
    else:
        print_drawn(drawn)


@group.main.command()
@group.config_argument
@at_options[0]
@at_options[1]
@click.option("--component", metavar="COMPONENT", help="The component that is shown and leads; default: the first.")
@click.option("--case", metavar="CASE", help="The case, of a config that has several.")
@group.set_option
@group.realisations_option
@group.seed_option
@group.out_option
@group.drawing_options
@group.json_option
def sensitivity(
    config: str,
    at_s: float | None,
    at_k: int | None,
    component: str | None,
    case: str | None,
    overrides: tuple[str, ...],
    realisations: int | None,
    seed: int | None,
    out: str,
    drawing: group.Drawing,
    as_json: bool,
) -> None:
    """What +10 % of each key changes: σ and gain, the largest effect first.

    Every key that holds a number is raised by a tenth, one at a time; whole numbers by at least one. Exact where σ is;
    else paired, with the same noise, and with 95 % intervals. All filters and components are in
    DIR/sensitivity/CONFIG/sensitivity.csv, the leading component is drawn beside it as tornado.svg.

    \b
    Examples
      radarsim sensitivity rls2
      radarsim sensitivity rls2 --at 60 --component Vr
    """
    from radarsim.app import result, run
    from radarsim.app import sensitivity as finding
    from radarsim.cli import console

    if at_s is not None and at_k is not None:
        raise click.UsageError("--at and --at-k do not go together: a time or a scan")
    asked_for: dict[str, Any] = {
        "at_s": at_s,
        "at_k": at_k,
        "component": component,
        "case": case,
        "realisations": realisations,
    }
    with console.Progress(config, quiet=as_json, what="keys") as progress:
        found = finding.sensitivity(
            config, overrides=run.merged(overrides, None, seed), progress=progress.update, **asked_for
        )
    written = finding.write(found, out, *drawing)
    if as_json:
        click.echo(result.text(result.fields(found) | {"files": written}))
    else:
        print_sensitivity(found, written)
