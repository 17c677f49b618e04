# SPDX-License-Identifier: GPL-3.0-or-later
"""The import graph of Python packages, read from their sources without importing them."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Import:
    """One import of a module by another, by dotted names. typing: whether only type checkers execute it."""

    importer: str
    imported: str
    line: int
    typing: bool = False


def modules(folder: Path, name: str) -> dict[str, Path]:
    """The modules of the package `name` in `folder`, and other files beside them: dotted name to file.

    A file that is no Python module keeps its suffix: `addon.core.report.page.html`.
    """
    found = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            relative = path.relative_to(folder)
            parts = relative.with_suffix("").parts if path.suffix == ".py" else relative.parts
            parts = parts[:-1] if relative.name == "__init__.py" else parts
            found[".".join([name, *parts])] = path
    return found


def imports(known: dict[str, Path]) -> list[Import]:
    """All imports of known modules by known modules, also those inside functions."""
    return [found for name, path in known.items() if path.suffix == ".py" for found in _imports_of(name, path, known)]


def _imports_of(name: str, path: Path, known: dict[str, Path]) -> list[Import]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    package = name if path.name == "__init__.py" else name.rpartition(".")[0]
    typing = {id(line) for node in ast.walk(tree) if _is_typing(node) for line in ast.walk(node)}
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            targets = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base += node.module.split(".") if node.module else []
            targets = [".".join([*base, alias.name]) for alias in node.names]
            targets = [target if target in known else ".".join(base) for target in targets]
        else:
            continue
        found += [Import(name, one, node.lineno, id(node) in typing) for one in targets if one in known]
    return found


def _is_typing(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def unreached(known: dict[str, Path], start: str) -> list[str]:
    """The known modules and files that `start` never loads.

    An import also loads the packages around the imported module. A string constant that is the name of a file in the
    folder of a module that is reached reaches this file, since such files are run or read by their path.
    """
    edges: dict[str, set[str]] = {}
    for one in imports(known):
        if not one.typing:
            edges.setdefault(one.importer, set()).add(one.imported)
    at = {path: name for name, path in known.items()}
    reached: set[str] = set()
    waiting = [start]
    while waiting:
        name = waiting.pop()
        if name in reached or name not in known:
            continue
        reached.add(name)
        waiting += [*edges.get(name, ()), name.rpartition(".")[0]]
        path = known[name]
        if path.suffix == ".py":
            tree = ast.parse(path.read_text(encoding="utf-8"))
            words = {node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)}
            files = [
                path.with_name(word)
                for word in words
                if isinstance(word, str) and word.endswith((".py", ".html", ".js"))
            ]
            waiting += [at[file] for file in files if file in at]
    return sorted(set(known) - reached)
