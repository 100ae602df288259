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
from radarsim.api import result_content
from radarsim.api.doppler_chart import describe_chart
from radarsim.config.find_files import SHIPPED
from radarsim.report import caption_remarks
from radarsim.report.drawing import canvas
from radarsim.report.drawing.model import Figure
from radarsim.report.math_text import plain_text

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "docs" / "pictures"
MARK = re.compile(r"(?<=^<!-- picture: )(.+?)( -->\n)(.*?)(?=^<!-- drawn -->$)", re.MULTILINE | re.DOTALL)
MAX_BYTES = 60_000
CHART = "chart"  # in the place of a config: the figures of `radarsim chart`
PNG_SIZES, PNG_COLOURS = (
    (1.0, 0.8, 0.6),
    (64, 32, 16),
)  # of a PNG: shares of 200 dpi, and how many; the first that are small


def pictures_of_mark(mark: str) -> list[tuple[str, str, float | None]]:
    """Config, figure and width of each picture of a mark."""
    pictures = [picture.split() for picture in mark.split("|")]
    return [(config, name, float(width[0]) if width else None) for config, name, *width in pictures]


def pages() -> Iterator[tuple[Path, str]]:
    """The pages that hold pictures, with their text."""
    for path in [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]:
        if "_build" not in path.parts and MARK.search(text := path.read_text(encoding="utf-8")):
            yield path, text


def figures_by_config() -> dict[str, set[tuple[str, float | None]]]:
    """The figures that the pages show, by config."""
    figures: dict[str, set[tuple[str, float | None]]] = {}
    for _, text in pages():
        for mark in MARK.finditer(text):
            for config, name, width in pictures_of_mark(mark[1]):
                figures.setdefault(config, set()).add((name, width))
    return figures


def figures_of(config: str, results: Path) -> dict[str, Figure]:
    """The figures of a stored result by their name; ConfigError, with the command, where it is not there."""
    if config == CHART:
        return dict(describe_chart([]).figures)
    result = radarsim.load(SHIPPED / "configs" / f"{config}.yaml", out=results)
    return result_content.case_figures(result.cases, result.tables, result.experiment)


def file_stem(config: str, name: str, width: float | None) -> str:
    """What a picture's file is called, without its ending."""
    return "_".join([config, name, *([f"{width:g}"] if width else [])])


def picture_file(figure: Figure, width: float | None) -> tuple[str, bytes]:
    """The ending and the bytes of a picture: SVG, or PNG in as many colours as keep it under MOST_BYTES."""
    files = canvas.save(figure, ("svg", "png"), width)
    return ("svg", files["svg"]) if len(files["svg"]) < MAX_BYTES else ("png", compressed_png(files["png"]))


def compressed_png(png: bytes) -> bytes:
    """A PNG of a palette under MOST_BYTES, of fewer colours and then of fewer points where it has to be."""
    from PIL import Image  # Matplotlib brings it

    original = Image.open(io.BytesIO(png)).convert("RGB")
    for size, colours in product(PNG_SIZES, PNG_COLOURS):
        picture = original.resize(
            (round(size * original.width), round(size * original.height)), Image.Resampling.LANCZOS
        )
        out = io.BytesIO()
        picture.quantize(colours, dither=Image.Dither.NONE).save(out, "png", optimize=True)
        if out.tell() < MAX_BYTES:
            return out.getvalue()
    raise ValueError(f"{len(png)} bytes of PNG cannot be made {MAX_BYTES}")


def picture_text(page: Path, parts: list[tuple[str, Figure, Path]]) -> str:
    """What stands in a page between the marks: the pictures, and below them their captions."""
    images = [
        f"![{plain_text(figure.title)}]({Path(os.path.relpath(file, page.parent)).as_posix()})"
        for _, figure, file in parts
    ]
    captions = [
        f"*{plain_text(figure.title)}.* {plain_text(figure.caption)} {caption_remarks.conventions([figure])}".rstrip()
        for _, figure, _ in parts
    ]
    if len(parts) > 1:
        captions = [f"* {caption}" for caption in captions]
        return "\n".join(images) + "\n\n" + "\n".join(captions) + "\n"
    return f"{images[0]}\n\n{captions[0]}\n"


def main(results: str) -> None:
    """Draw every picture that the pages show, write the marks again, remove pictures that no page shows."""
    FOLDER.mkdir(exist_ok=True)
    drawn_figures: dict[tuple[str, str, float | None], tuple[Figure, Path]] = {}
    for config, wanted_figures in figures_by_config().items():
        figures = figures_of(config, Path(results))
        for name, width in sorted(wanted_figures, key=str):
            ending, data = picture_file(figures[name], width)
            path = FOLDER / f"{file_stem(config, name, width)}.{ending}"
            path.write_bytes(data)
            drawn_figures[config, name, width] = figures[name], path
            sys.stdout.write(f"{path.relative_to(ROOT)}: {len(data)} bytes\n")
    for path in set(FOLDER.iterdir()) - {file for _, file in drawn_figures.values()}:
        path.unlink()
    for page, text in list(pages()):

        def filled(mark: re.Match, page: Path = page) -> str:
            pictures = [(key[0], *drawn_figures[key]) for key in pictures_of_mark(mark[1])]
            return f"{mark[1]}{mark[2]}{picture_text(page, pictures)}"

        page.write_text(MARK.sub(filled, text), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1])
