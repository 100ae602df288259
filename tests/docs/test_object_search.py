"""References to Python objects: what is found without a search is what Sphinx's search finds."""

from types import SimpleNamespace

import pytest

pytest.importorskip("sphinx")  # of the extra `docs`

from making.object_search import QuickPythonDomain
from sphinx.domains.python import ObjectEntry, PythonDomain

OBJECTS = {"a.b.Case": "class", "a.c.Case": "class", "a.b.Case.run": "method", "a.b.run": "function", "a.b": "module"}
NAMES = ("Case", "b.Case", "run", "run()", "Case.run", "a.b", "b", "ndarray", "np.ndarray", "xCase", "se", "()", "")


@pytest.mark.parametrize("searchmode", [0, 1])
@pytest.mark.parametrize("kind", ["class", "func", "meth", "mod", None])
def test_every_name_means_what_it_means_to_sphinx(kind, searchmode):
    environment = SimpleNamespace(domaindata={})
    quick, plain = QuickPythonDomain(environment), PythonDomain(environment)
    assert all(quick.find_obj(environment, "a.b", "Case", name, kind, searchmode) == [] for name in NAMES)  # no object
    for name, objtype in OBJECTS.items():
        plain.objects[name] = ObjectEntry("page", name, objtype, False)
    assert quick.objects is plain.objects
    for place in (("a.b", "Case"), ("a.b", ""), ("", "")):
        for name in NAMES:
            asked = (environment, *place, name, kind, searchmode)
            assert quick.find_obj(*asked) == plain.find_obj(*asked)
