"""The modules that a source imports, by its syntax tree."""

import ast


def imports_in(tree: ast.Module, package: str) -> list[str]:
    """The names of modules that a module in a package imports, and names in them that may be modules."""
    modules = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            modules += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            modules += [base, *(f"{base}.{alias.name}" for alias in node.names)]
    return modules
