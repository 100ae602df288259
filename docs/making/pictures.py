"""Pictures in the pages, drawn by `make docs-pictures` from what `make reproduce-figures` left in results/.

    <!-- picture: CONFIG FIGURE [WIDTH] -->
    ![…](…) and the caption
    <!-- drawn -->

stands in a page for a figure of a config (its names are those of `figures/` beside a report), WIDTH in mm for another
than its own; several, with `|` between, stand side by side. The picture lies in docs/pictures/, as SVG where that is
small enough, else as PNG.
"""

import io
import os
import re
import sys
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import radarsim
from radarsim.app import result as output
from radarsim.app.compare import described
from radarsim.report import figures
from radarsim.report.drawing import Figure
from radarsim.report.wording import spoken

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "pictures"
MARK = re.compile(r"(?<=^<!-- picture: )(.+?)( -->\n)(.*?)(?=^<!-- drawn -->$)", re.MULTILINE | re.DOTALL)
MOST_BYTES = 60_000
CHART = "chart"  # in the place of a config: the figures of `radarsim chart`
SIZES, COLOURS = (1.0, 0.8, 0.6), (64, 32, 16)  # of a PNG: shares of 200 dpi, and how many; the first that are small


def asked(mark: str) -> list[tuple[str, str, float | None]]:
    """Config, figure and width of each picture of a mark."""
    parts = [one.split() for one in mark.split("|")]
    return [(config, name, float(width[0]) if width else None) for config, name, *width in parts]


def pages() -> Iterator[tuple[Path, str]]:
    """The pages that hold pictures, with their text."""
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        if "_build" not in path.parts and MARK.search(text := path.read_text(encoding="utf-8")):
            yield path, text


def every() -> dict[str, set[tuple[str, float | None]]]:
    """The figures that the pages show, by config."""
    found: dict[str, set[tuple[str, float | None]]] = {}
    for _, text in pages():
        for mark in MARK.finditer(text):
            for config, name, width in asked(mark[1]):
                found.setdefault(config, set()).add((name, width))
    return found


def figures_of(config: str, results: Path) -> dict[str, Figure]:
    """The figures of a stored result by their name; ConfigError, with the command, where it is not there."""
    if config == CHART:
        return dict(described([]).figures)
    result = radarsim.load(config, out=results)
    return output.case_figures(result.cases, result.tables, result.experiment)


def stem(config: str, name: str, width: float | None) -> str:
    """What a picture's file is called, without its ending."""
    return "_".join([config, name, *([f"{width:g}"] if width else [])])


def drawn(figure: Figure, width: float | None) -> tuple[str, bytes]:
    """The ending and the bytes of a picture: SVG, or PNG in as many colours as keep it under MOST_BYTES."""
    made = figures.save(figure, ("svg", "png"), width)
    return ("svg", made["svg"]) if len(made["svg"]) < MOST_BYTES else ("png", smaller(made["png"]))


def smaller(png: bytes) -> bytes:
    """A PNG of a palette under MOST_BYTES, of fewer colours and then of fewer points where it has to be."""
    from PIL import Image  # Matplotlib brings it

    whole = Image.open(io.BytesIO(png)).convert("RGB")
    for size, colours in product(SIZES, COLOURS):
        picture = whole.resize((round(size * whole.width), round(size * whole.height)), Image.Resampling.LANCZOS)
        out = io.BytesIO()
        picture.quantize(colours, dither=Image.Dither.NONE).save(out, "png", optimize=True)
        if out.tell() < MOST_BYTES:
            return out.getvalue()
    raise ValueError(f"{len(png)} bytes of PNG cannot be made {MOST_BYTES}")


def shown(page: Path, parts: list[tuple[str, Figure, Path]]) -> str:
    """What stands in a page between the marks: the pictures, and below them their captions."""
    images = [
        f"![{spoken(one.title)}]({Path(os.path.relpath(file, page.parent)).as_posix()})" for _, one, file in parts
    ]
    captions = [f"*{spoken(one.title)}.* {spoken(one.caption)}" for _, one, _ in parts]
    if len(parts) > 1:
        captions = [f"* {caption}" for caption in captions]
        return "\n".join(images) + "\n\n" + "\n".join(captions) + "\n"
    return f"{images[0]}\n\n{captions[0]}\n"


def main(results: str) -> None:
    """Draw every picture that the pages show, write the marks again, remove pictures that no page shows."""
    FOLDER.mkdir(exist_ok=True)
    made: dict[tuple[str, str, float | None], tuple[Figure, Path]] = {}
    for config, wanted in every().items():
        found = figures_of(config, Path(results))
        for name, width in sorted(wanted, key=str):
            ending, data = drawn(found[name], width)
            path = FOLDER / f"{stem(config, name, width)}.{ending}"
            path.write_bytes(data)
            made[config, name, width] = found[name], path
            sys.stdout.write(f"{path.relative_to(ROOT)}: {len(data)} bytes\n")
    for path in set(FOLDER.iterdir()) - {file for _, file in made.values()}:
        path.unlink()
    for page, text in list(pages()):

        def filled(mark: re.Match, page: Path = page) -> str:
            parts = [(one[0], *made[one]) for one in asked(mark[1])]
            return f"{mark[1]}{mark[2]}{shown(page, parts)}"

        page.write_text(MARK.sub(filled, text), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
