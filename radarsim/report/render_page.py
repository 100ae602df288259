"""Self-contained pages from templates, with their style and script; the templates escape all text."""

import base64
import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING

from radarsim.language.current import current_language
from radarsim.language.translate import plural, term, tr
from radarsim.report import wording
from radarsim.report.typeset import cell_text, typeset

if TYPE_CHECKING:
    from jinja2 import Environment, Template
    from markupsafe import Markup


SCRIPT_TEXTS = (term("Light page"), term("Dark page"))


def fragment(package: str, template: str, filters: Mapping[str, Callable[..., str]], **content: object) -> "Markup":
    """A part of a page from a template of another package, with filters of its own."""
    from markupsafe import Markup

    environment = _environment(package)
    environment.filters.update(filters)
    return Markup(environment.get_template(template).render(**content))


def _template(name: str) -> "Template":
    return _environment("radarsim.report").get_template(name)


@cache
def _environment(package: str) -> "Environment":
    from jinja2 import Environment, PackageLoader, StrictUndefined

    loader = PackageLoader(package)
    environment = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    filters: dict[str, Callable[..., str]] = {
        "number": cell_text,
        "unit": lambda name: tr(wording.unit(name)),
        "typeset": typeset,
    }
    environment.filters.update(filters)
    environment.globals.update(tr=tr, plural=plural)
    return environment


def _script_texts(texts: Sequence[str] = ()) -> "Markup":
    """Texts of the page's script, and of a page's own script, in the current language, as JSON by the English."""
    return _safe_json({text: tr(text) for text in (*SCRIPT_TEXTS, *texts)})


def _safe_json(value: object) -> "Markup":
    """JSON of a value, or of text that is JSON already, that cannot end the element in which it stands."""
    from markupsafe import Markup

    data = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False, separators=(",", ":"))
    return Markup(data.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e"))


@cache
def _page_script() -> tuple[str, str]:
    """The page's script, and its hash as the page's policy names it: no other script runs."""
    code = _template_file("script.js")
    return code, _policy_hash(code)


def _policy_hash(code: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(code.encode()).digest()).decode()


@cache
def _template_file(name: str) -> str:
    return resources.files("radarsim.report").joinpath("templates", name).read_text(encoding="utf-8")


def live_page(title: str, sources: Sequence[str], data: str, texts: Sequence[str] = ()) -> str:
    """A self-contained page that computes: a study's own body, style and script, and its data as JSON.

    sources: the text of these files: in the body, a template, `tr` marks messages; style and script are copied. texts:
    of the script, to be translated. The data cannot end its element."""
    from jinja2 import Environment, StrictUndefined
    from markupsafe import Markup

    body_source, style, script = sources
    body = Environment(autoescape=True, undefined=StrictUndefined).from_string(body_source).render(tr=tr)
    return render_page(
        "live.html.j2",
        title=title,
        body=Markup(body),
        own_style=Markup(style),
        own_script=Markup(script),
        own_script_hash=_policy_hash(script),
        data=_safe_json(data),
        words=_script_texts(texts),
    )


def render_page(template: str, **content: object) -> str:
    """A page from a template, with the style and the script that all pages share."""
    from markupsafe import Markup

    script, script_hash = _page_script()
    content = {"language": current_language(), "words": _script_texts()} | content
    return _template(template).render(
        style=Markup(_template_file("style.css")), script=Markup(script), script_hash=script_hash, **content
    )
