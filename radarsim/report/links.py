"""What belongs to what in a report: the tables that a figure is drawn from, and of a claim its figures and tables."""

from collections.abc import Collection, Mapping, Sequence

COMMON = {"sigma": ("curves",), "sweep": ("curves",), "dynamic": ("curves",), "gain": ("gains",)}
MOST = 3  # figures that one claim leads to

Looked = Sequence[tuple[str, str]]  # tables, with the component that was looked at or nothing


def tables_of(figure: str, declared: Mapping[str, Sequence[str]], made: Collection[str]) -> tuple[str, ...]:
    """The tables, of those made, that a figure is drawn from: as its study declares, by its own name, by its kind."""
    begins = sorted((name for name in declared if figure.startswith(name)), key=len)
    if begins and figure not in made:
        found: Sequence[str] = declared[begins[-1]]
    elif figure in made:
        found = declared.get(figure, (figure,))
    else:
        found = COMMON.get(figure.partition("_")[0], ())
    return tuple(name for name in found if name in made)


def figures_of(looked: Looked, drawn_from: Mapping[str, Sequence[str]]) -> list[str]:
    """The figures that show what was looked at: of the table, and of these its component's own where there is one."""
    found: list[str] = []
    for table, component in looked:
        own = [name for name, tables in drawn_from.items() if table in tables]
        exact = [name for name in own if component and name.endswith(f"_{component}")]
        found += exact or own
    return list(dict.fromkeys(found))[:MOST]
