"""Which tables are behind a figure, for the links of a page."""

from collections.abc import Collection, Mapping, Sequence

SOURCES_BY_KIND = {
    "sigma": ("curves.sigma",),
    "sweep": ("curves.sigma",),
    "dynamic": ("curves.bias",),
    "gain": ("gains.gain",),
}


def tables_behind_figure(
    figure_name: str, declared: Mapping[str, Sequence[str]], table_names: Collection[str]
) -> tuple[str, ...]:
    """The tables behind a figure, of those that exist: as its study declares, by its own name, by its kind."""
    sources = sources_behind_figure(figure_name, declared, table_names)
    return tuple(dict.fromkeys(source.partition(".")[0] for source in sources))


def sources_behind_figure(
    figure_name: str, declared: Mapping[str, Sequence[str]], table_names: Collection[str]
) -> tuple[str, ...]:
    """As `tables_behind_figure`, with the column, "folds.right", if it is known which one is drawn."""
    prefixes = sorted((name for name in declared if figure_name.startswith(name)), key=len)
    if prefixes and figure_name not in table_names:
        names: Sequence[str] = declared[prefixes[-1]]
    elif figure_name in table_names:
        names = declared.get(figure_name, (figure_name,))
    else:
        names = SOURCES_BY_KIND.get(figure_name.partition("_")[0], ())
    return tuple(name for name in names if name.partition(".")[0] in table_names)
