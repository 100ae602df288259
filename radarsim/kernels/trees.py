"""What a source says, by its syntax tree: a hash without its sentences, its imports, the files that it names."""

import ast
import hashlib
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

COMPUTED = "?"  # stands among imports for a module whose name is computed
# Of a configuration key, what only tells what it is: keywords, and texts before them; by the call that declares it.
WORDS = {"Field": ({"description", "title", "json_schema_extra"}, 0), "key": ({"symbol", "unit"}, 2)}
IMPORTERS = ("import_module", "__import__")
FILE_NAME = re.compile(r"[\w ./-]*[\w-]\.[A-Za-z]\w{0,9}")
OPAQUE = sys.stdlib_module_names | {"numpy", "scipy", "numba"}  # attributes of these are no modules of ours
Definition = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef


@dataclass(frozen=True)
class Source:
    """What is known of a source: the hash of its syntax tree; dotted names that it imports at any depth, relative ones
    with their dots; what its __all__ lists; texts in it that may be names of files."""

    tree: str
    imports: tuple[str, ...] = ()
    exports: tuple[str, ...] = ()
    files: tuple[str, ...] = ()


def read(content: bytes, name: str | None = None, without: frozenset[str] = frozenset()) -> Source:
    """What is known of a source, or with a name of that `part` of it; of what is no Python, the hash of its bytes."""
    try:
        statements = ast.parse(content).body
    except (SyntaxError, ValueError, RecursionError):
        return Source(hashlib.sha256(content).hexdigest())
    if name is not None:
        statements = part(statements, name, without)
    statements = [one for one in statements if not _is_text(one)]
    tree = hashlib.sha256(b"".join(_tokens(statements))).hexdigest()
    return Source(tree, _imports(statements), _exports(statements), _files(statements))


def part(statements: Sequence[ast.stmt], name: str, without: frozenset[str]) -> list[ast.stmt]:
    """The statements of a file that a class or function of it rests on: its own, without the members `without`, those
    that define names it uses, directly or not, and those that are run for what they do. An empty name: the last alone.
    """
    bound: dict[str, list[ast.stmt]] = {}
    effects: list[ast.stmt] = []
    for one in statements:
        names = list(_names_bound(one))
        for each in names:
            bound.setdefault(each, []).append(one)
        if not names and not _is_text(one) and not _only_for_checkers(one):
            effects.append(one)
    if name and name not in bound:
        return list(statements)  # defined in a way that is not looked into
    kept: dict[int, ast.stmt] = {}
    waiting = effects + bound.get(name, [])
    while waiting:
        one = waiting.pop()
        if id(one) in kept:
            continue
        kept[id(one)] = shown = _less(one, without) if getattr(one, "name", None) == name else one
        used = {node.id for node in ast.walk(shown) if isinstance(node, ast.Name)}
        waiting += [other for each in used for other in bound.get(each, ())]
    return [kept[id(one)] for one in statements if id(one) in kept]


def _less(definition: ast.stmt, without: frozenset[str]) -> ast.stmt:
    """A class without some members."""
    if not isinstance(definition, ast.ClassDef):
        return definition
    fields = {name: getattr(definition, name, []) for name in definition._fields}
    fields["body"] = [one for one in definition.body if not set(_names_bound(one)) & without]
    return ast.ClassDef(**fields)


def _names_bound(statement: ast.stmt) -> Iterator[str]:
    """The names that a statement defines; none for one that does something, such as a loop or a condition."""
    if isinstance(statement, Definition):
        yield statement.name
    elif isinstance(statement, ast.Import | ast.ImportFrom):
        yield from (alias.asname or alias.name.partition(".")[0] for alias in statement.names if alias.name != "*")
    elif isinstance(statement, ast.Assign | ast.AnnAssign):
        targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
        nodes = [node for target in targets for node in ast.walk(target)]
        if not any(isinstance(node, ast.Attribute | ast.Subscript) for node in nodes):
            yield from (node.id for node in nodes if isinstance(node, ast.Name))


def _only_for_checkers(statement: ast.AST) -> bool:
    """Whether a statement is for type checkers: it is never run."""
    if not isinstance(statement, ast.If):
        return False
    test = statement.test
    return getattr(test, "id", getattr(test, "attr", None)) == "TYPE_CHECKING" and not statement.orelse


def _walked(statements: Iterable[ast.AST]) -> Iterator[ast.AST]:
    """All nodes but those that are for type checkers."""
    waiting = list(statements)
    while waiting:
        node = waiting.pop()
        if not _only_for_checkers(node):
            yield node
            waiting += ast.iter_child_nodes(node)


def _imports(statements: Sequence[ast.stmt]) -> tuple[str, ...]:
    """Dotted names of what is imported, and of attributes of these, which may be modules too."""
    found: set[str] = set()
    known: dict[str, str] = {}
    attributes: list[ast.Attribute] = []
    for node in _walked(statements):
        if isinstance(node, ast.Import):
            for alias in node.names:
                found.add(alias.name)
                first = alias.name.partition(".")[0]
                known[alias.asname or first] = alias.name if alias.asname else first
        elif isinstance(node, ast.ImportFrom):
            package = "." * node.level + (f"{node.module}." if node.module else "")
            found |= {package + alias.name for alias in node.names}
            known |= {alias.asname or alias.name: package + alias.name for alias in node.names}
        elif isinstance(node, ast.Attribute):
            attributes.append(node)
        elif isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in IMPORTERS:
            named = node.args[0] if node.args else None
            text = named.value if isinstance(named, ast.Constant) else None
            found.add(text if isinstance(text, str) else COMPUTED)
    for node in attributes:
        name = _dotted(node)
        target = known.get(name.partition(".")[0], "")
        if target and target.partition(".")[0] not in OPAQUE:
            found.add(f"{target}.{name.partition('.')[2]}")
    return tuple(sorted(found))


def _dotted(node: ast.AST) -> str:
    """`a.b.c` of an attribute of an attribute of a name; empty for one of anything else."""
    if isinstance(node, ast.Name):
        return node.id
    above = _dotted(node.value) if isinstance(node, ast.Attribute) else ""
    return f"{above}.{node.attr}" if above else ""


def _exports(statements: Sequence[ast.stmt]) -> tuple[str, ...]:
    """The names in __all__, as far as they are written out."""
    listed = [one for one in statements if isinstance(one, ast.Assign) and "__all__" in _names_bound(one)]
    return tuple(sorted(set(_texts(listed))))


def _files(statements: Sequence[ast.stmt]) -> tuple[str, ...]:
    return tuple(sorted({text for text in _texts(statements) if FILE_NAME.fullmatch(text)}))


def _texts(statements: Sequence[ast.stmt]) -> Iterator[str]:
    nodes = (node for node in _walked(statements) if isinstance(node, ast.Constant))
    return (node.value for node in nodes if isinstance(node.value, str))


def _tokens(node: object) -> Iterable[bytes]:
    """The syntax tree as text, equal in every version of Python: fields that are empty or new ones' defaults are left
    out, type comments, statements that are mere texts (docstrings), and the words of configuration keys too."""
    if isinstance(node, ast.AST):
        yield f"({type(node).__name__}".encode()
        for name in node._fields:
            value = getattr(node, name, None)
            if isinstance(node, ast.Call) and _called(node) in WORDS:
                words, first = WORDS[_called(node)]
                if name == "keywords":
                    value = [one for one in value if one.arg not in words]
                elif name == "args":
                    value = [one for i, one in enumerate(value) if i >= first or not isinstance(one, ast.Constant)]
            elif name in ("kind", "type_comment", "ctx", "type_params"):
                continue
            if value is not None and value != []:
                yield f" {name}=".encode()
                yield from _tokens(value)
        yield b")"
    elif isinstance(node, list):
        for one in node:
            if not _is_text(one):
                yield from _tokens(one)
    else:
        yield repr(node).encode()


def _called(node: ast.Call) -> str:
    """The name of what is called; empty where it has none."""
    return getattr(node.func, "attr", getattr(node.func, "id", ""))


def _is_text(statement: object) -> bool:
    """Whether a statement is a mere text: a docstring."""
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )
