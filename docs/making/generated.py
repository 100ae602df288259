"""Parts of pages that are read off the program while building: `<!-- generated: NAME -->` on a line of its own."""

import re
from functools import partial
from pathlib import Path

from making import claims, commands, interpretations, keys, modules, tables

MARK = re.compile(r"^<!-- generated: (\w+) -->$", re.MULTILINE)
PARTS = {
    **{"claims": claims.markdown, "commands": commands.markdown, "keys": keys.markdown},
    **{"modules": modules.markdown, "tables": tables.common_tables},
    **{f"tables_{study}": partial(tables.own_tables, study) for study in tables.with_own_tables()},
    **{
        f"interpretations_{paper.lower()}": partial(interpretations.markdown, paper) for paper in interpretations.PAPERS
    },
}


def filled(page: str) -> str:
    """A page with each part in the place of its mark; KeyError for a mark that nothing makes."""
    return MARK.sub(lambda found: PARTS[found[1]](), page)


def fill(app, name: str, source: list[str]) -> None:
    """Fill a page while Sphinx reads it."""
    source[0] = filled(source[0])


def outdated(app, env, added: set[str], changed: set[str], removed: set[str]) -> list[str]:
    """Pages with marks are read again in every build: what they are made of is no file that Sphinx looks at."""
    return [name for name in env.found_docs if MARK.search(Path(env.doc2path(name)).read_text(encoding="utf-8"))]
