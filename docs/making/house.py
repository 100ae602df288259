"""The picture of the rooms and the arrows between them, drawn from the package's own imports.

python -m making.house docs/house.svg          (with PYTHONPATH=docs; `make docs-house`)
"""

import ast
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "radarsim"
# Rooms from left to right, a row each; arrows go from a row to a lower one, or to a neighbour. Every room may use
# `errors`, which is left out.
ROWS = (
    ("cli",),
    ("app", "recorded"),
    ("registry",),
    ("range_doppler", "multimodel", "sonar", "discriminator", "ambiguous_doppler", "pulses_to_tracks"),
    ("interface", "report"),
    ("config", "language", "engine", "bursts"),
    ("kernels", "physics"),
)
STUDIES = 3  # the row of the papers, which the registry knows by their names
ABOUT = {
    "cli": "parse, call, print",
    "app": "run, result, claims …",
    "recorded": "recorded plots",
    "registry": "which there are; identity",
    "interface": "what a study is; noise",
    "report": "statistics, charts, page",
    "language": "what is said, in Russian too",
    "range_doppler": "P1",
    "multimodel": "P2",
    "sonar": "P3, three studies",
    "discriminator": "P4",
    "ambiguous_doppler": "folded velocity",
    "pulses_to_tracks": "P4 into P1",
    "config": "YAML to checked cases",
    "engine": "blocks, sums, store",
    "kernels": "compiled, shared",
    "physics": "motion, targets, frames",
    "bursts": "a burst and its estimator",
}
WIDTH, ROOM, HEIGHT, GAP, MARGIN = 1290, 196, 44, 62, 12  # px


def room_of(module: str) -> str | None:
    """The room in which a module of radarsim lies; None for the package's own top."""
    parts = module.split(".")
    if parts[0] != "radarsim" or len(parts) < 2:
        return None
    if parts[1] != "studies":
        return parts[1] if parts[1] in ABOUT else None
    if len(parts) > 2 and parts[2] in ABOUT:
        return parts[2]
    return "interface" if parts[2:3] in (["noise"], ["folder"], ["radial"]) else "registry"


def modules() -> Iterator[tuple[str, ast.Module]]:
    """Every module of the package with its syntax tree."""
    for path in sorted(PACKAGE.rglob("*.py")):
        name = ".".join(("radarsim", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__")
        yield name, ast.parse(path.read_text(encoding="utf-8"))


def imported(tree: ast.Module) -> Iterator[str]:
    """The modules that a source imports, at any depth; `from package import name` as package.name."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def arrows() -> Counter[tuple[str, str]]:
    """How many modules of a room import something of another room."""
    found: Counter[tuple[str, str]] = Counter()
    for name, tree in modules():
        here = room_of(name)
        there = {room_of(module) for module in imported(tree)} - {here, None}
        if here is not None:
            found.update((here, room) for room in there if room is not None)
    found.update({("registry", study): 1 for study in ROWS[STUDIES]})  # by name
    return found


def sizes() -> Counter[str]:
    """Lines of each room."""
    found: Counter[str] = Counter()
    for path in PACKAGE.rglob("*.py"):
        name = ".".join(("radarsim", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__")
        room = room_of(name)
        if room is not None:
            found[room] += len(path.read_text(encoding="utf-8").splitlines())
    return found


def places() -> dict[str, tuple[float, float]]:
    """The upper left corner of each room's box."""
    found = {}
    for row, rooms in enumerate(ROWS):
        free = WIDTH - len(rooms) * ROOM
        for i, room in enumerate(rooms):
            found[room] = (free * (i + 1) / (len(rooms) + 1) + i * ROOM, MARGIN + row * (HEIGHT + GAP))
    return found


def line(a: tuple[float, float], b: tuple[float, float], count: int) -> str:
    """An arrow from a box to another, the wider the more modules stand behind it."""
    (x, y), (u, v) = a, b
    width = 0.8 + 0.35 * count**0.5
    if y == v:  # neighbours
        x0, x1 = (x + ROOM, u) if u > x else (x, u + ROOM)
        path = f"M{x0:.0f} {y + HEIGHT / 2:.0f} L{x1:.0f} {v + HEIGHT / 2:.0f}"
    else:
        shift = max(-0.38, min(0.38, (u - x) / WIDTH)) * ROOM  # so that arrows leave a box side by side
        x0, x1 = x + ROOM / 2 + shift, u + ROOM / 2 - shift
        bend = (v - y - HEIGHT) / 2
        path = f"M{x0:.0f} {y + HEIGHT:.0f} C{x0:.0f} {y + HEIGHT + bend:.0f} {x1:.0f} {v - bend:.0f} {x1:.0f} {v:.0f}"
    return f'<path d="{path}" stroke-width="{width:.1f}" marker-end="url(#tip)"/>'


def svg() -> str:
    """The whole picture."""
    at, lines = places(), sizes()
    height = 2 * MARGIN + len(ROWS) * HEIGHT + (len(ROWS) - 1) * GAP
    drawn = [line(at[a], at[b], count) for (a, b), count in sorted(arrows().items())]
    boxes = []
    for room, (x, y) in at.items():
        title = f"studies/{room}" if room in ROWS[STUDIES] or room in ("registry", "interface") else room
        boxes.append(f'<rect x="{x:.0f}" y="{y:.0f}" width="{ROOM}" height="{HEIGHT}" rx="4"/>')
        middle = x + ROOM / 2
        boxes.append(f'<text x="{middle:.0f}" y="{y + 18:.0f}" class="name">{title}</text>')
        boxes.append(f'<text x="{middle:.0f}" y="{y + 35:.0f}">{ABOUT[room]} · {lines[room]} lines</text>')
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}" '
        'role="img" aria-label="The rooms of radarsim and which imports which">\n'
        "<style>rect{fill:#fff;stroke:#335} path{fill:none;stroke:#557;opacity:.55} "
        "text{font:11px sans-serif;text-anchor:middle;fill:#223} .name{font-weight:bold;font-size:12px}</style>\n"
        f'<rect width="{WIDTH}" height="{height}" style="stroke:none"/>\n'
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="9" markerHeight="9" '
        'markerUnits="userSpaceOnUse" orient="auto"><path d="M0 0L8 4L0 8z" style="fill:#557;stroke:none"/></marker>'
        "</defs>\n" + "\n".join([*drawn, *boxes]) + "\n</svg>\n"
    )


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(svg(), encoding="utf-8")
