"""The picture of the rooms: each imports only rooms of lower rows, or the neighbour that an arrow names.

python -m making.house docs/house.svg          (with PYTHONPATH=docs; `make docs-house`)
"""

import ast
import sys
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "radarsim"
# Rooms from left to right, a row each. Every room may use `errors`, which is left out.
ROWS = (
    ("recorded",),
    ("cli",),
    ("app",),
    ("registry",),
    ("range_doppler", "multimodel", "sonar", "discriminator", "ambiguous_doppler", "pulses_to_tracks"),
    ("interface", "report"),
    ("config", "language", "engine", "bursts"),
    ("kernels", "physics"),
)
STUDIES = 4  # the row of the papers, which the registry knows by their names
ABOUT = {
    "cli": "parse, call, print",
    "app": "run, result, claims …",
    "recorded": "recorded plots: an extension",
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
WIDTH, ROOM, HEIGHT, GAP, MARGIN, SIDE = 840, 200, 58, 22, 6, 44  # px; SIDE: the column of the long arrow


def room_of(module: str) -> str | None:
    """The room in which a module of radarsim lies; None for the package's own top."""
    parts = module.split(".")
    if parts[0] != "radarsim" or len(parts) < 2:
        return None
    if parts[1] != "studies":
        return parts[1] if parts[1] in ABOUT else None
    if len(parts) > 2 and parts[2] in ABOUT:
        return parts[2]
    return "interface" if parts[2:3] in (["noise"], ["radial"], ["floor"]) else "registry"


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


@cache
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


def beside() -> list[tuple[str, str]]:
    """The imports within a row: from a room to its neighbour."""
    row = {room: i for i, rooms in enumerate(ROWS) for room in rooms}
    return sorted((a, b) for a, b in arrows() if row[a] == row[b])


def places() -> dict[str, tuple[float, float, float]]:
    """The upper left corner and the width of each room's box."""
    found = {}
    for row, rooms in enumerate(ROWS):
        free = WIDTH - SIDE - 2 * MARGIN
        width = min(ROOM, free / len(rooms) - 8)
        for i, room in enumerate(rooms):
            middle = SIDE + MARGIN + free * (i + 0.5) / len(rooms)
            found[room] = (middle - width / 2, MARGIN + row * (HEIGHT + GAP), width)
    return found


def line(x: float, y: float, u: float, v: float) -> str:
    """An arrow between two points."""
    return f'<path d="M{x:.0f} {y:.0f} L{u:.0f} {v:.0f}" marker-end="url(#tip)"/>'


def svg() -> str:
    """The whole picture."""
    at, lines = places(), sizes()
    height = 2 * MARGIN + len(ROWS) * HEIGHT + (len(ROWS) - 1) * GAP
    bands, boxes = [], []
    for row in range(len(ROWS)):
        y = MARGIN + row * (HEIGHT + GAP) - GAP / 4
        bands.append(
            f'<rect x="{SIDE}" y="{y:.0f}" width="{WIDTH - SIDE}" height="{HEIGHT + GAP / 2:.0f}" class="band"/>'
        )
    for room, (x, y, width) in at.items():
        title = f"studies/{room}" if room in ("registry", "interface") else room
        boxes.append(f'<rect x="{x:.0f}" y="{y:.0f}" width="{width:.0f}" height="{HEIGHT}" rx="4"/>')
        words = ((19, ' class="name"', title), (35, "", ABOUT[room]), (50, "", f"{lines[room]} lines"))
        boxes += [f'<text x="{x + width / 2:.0f}" y="{y + down:.0f}"{of}>{text}</text>' for down, of, text in words]
    for a, b in beside():
        (x, y, width), (u, _, _) = at[a], at[b]
        boxes.append(line(x + width, y + HEIGHT / 2, u, y + HEIGHT / 2))
    down = line(SIDE / 2, MARGIN, SIDE / 2, height - MARGIN)
    turn = f"translate({SIDE / 2 - 8:.0f} {height / 2:.0f}) rotate(-90)"
    turned = f'<text transform="{turn}">imports only what is below</text>'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}" '
        'role="img" aria-label="The rooms of radarsim, each of which imports only rooms below it">\n'
        "<style>rect{fill:#fff;stroke:#335} .band{fill:#eef1f6;stroke:none} "
        "path{fill:none;stroke:#335;stroke-width:1.6} text{font:11px sans-serif;text-anchor:middle;fill:#223} "
        ".name{font-weight:bold;font-size:12px}</style>\n"
        f'<rect width="{WIDTH}" height="{height}" style="stroke:none"/>\n'
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="9" markerHeight="9" '
        'markerUnits="userSpaceOnUse" orient="auto"><path d="M0 0L8 4L0 8z" style="fill:#335;stroke:none"/></marker>'
        "</defs>\n" + "\n".join([*bands, down, turned, *boxes]) + "\n</svg>\n"
    )


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(svg(), encoding="utf-8")
