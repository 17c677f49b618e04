# SPDX-License-Identifier: GPL-3.0-or-later
"""What `help()` says of the native module is what its type stub says."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import halfspace_native as native
import stub

STUB = Path(__file__).resolve().parents[3] / "native" / "python" / "halfspace_native.pyi"

Described = tuple[str, Any, str, ast.FunctionDef | None]
"""A name, what stands under it in the module, its text in the stub, and its declaration if it is a function."""


def described() -> Iterator[Described]:
    """All classes, functions, methods and attributes of the module that have a text in the stub."""
    for node in ast.parse(STUB.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.FunctionDef):
            yield node.name, getattr(native, node.name), ast.get_docstring(node) or "", node
        elif isinstance(node, ast.ClassDef) and hasattr(native, node.name):
            owner = getattr(native, node.name)
            yield node.name, owner, ast.get_docstring(node) or "", None
            yield from _members(node, owner)


def _members(node: ast.ClassDef, owner: Any) -> Iterator[Described]:
    seen: set[str] = set()
    for one, following in zip(node.body, [*node.body[1:], None], strict=True):
        if isinstance(one, ast.FunctionDef) and not one.name.startswith("__"):
            # The first overload carries the text and the defaults of all.
            if any(isinstance(d, ast.Name) and d.id == "overload" for d in one.decorator_list) and one.name in seen:
                continue
            seen.add(one.name)
            is_property = any(isinstance(d, ast.Name) and d.id == "property" for d in one.decorator_list)
            function = None if is_property else one
            yield f"{node.name}.{one.name}", getattr(owner, one.name), ast.get_docstring(one) or "", function
        elif isinstance(one, ast.AnnAssign) and isinstance(following, ast.Expr):
            assert isinstance(one.target, ast.Name)
            assert isinstance(following.value, ast.Constant)
            yield f"{node.name}.{one.target.id}", getattr(owner, one.target.id), following.value.value, None


ALL = list(described())


def test_the_stub_describes_the_whole_module() -> None:
    assert len(ALL) > 40
    # Installed from a wheel, the module is a package around the compiled one.
    public = {name for name, thing in inspect.getmembers(native) if not inspect.ismodule(thing)}
    assert {name for name in public if not name.startswith("__")} <= {name for name, *_ in ALL}


def test_the_texts_of_the_stub_are_those_of_the_module() -> None:
    assert [name for name, _, text, _ in ALL if not text] == []
    text = STUB.read_text(encoding="utf-8")
    assert stub.filled(text, native) == text, "scripts/dev/stub.py writes it"
    first = ALL[0][2].split()[0]
    assert stub.filled(text.replace(f'"""{first}', '"""Other', 1), native) == text


def test_the_stub_declares_the_parameters_of_the_module() -> None:
    for _, thing, _, function in ALL:
        if function is None:
            continue
        given = [(p.name, p.kind.description, p.default) for p in inspect.signature(thing).parameters.values()]
        # Methods of compiled classes take their own object by place alone.
        assert [one for one in given if one[0] != "self"] == list(_parameters(function))


def _parameters(function: ast.FunctionDef) -> Iterator[tuple[str, str, Any]]:
    """Name, kind and default of what the stub declares."""
    named = function.args.args
    defaults = [inspect.Parameter.empty] * (len(named) - len(function.args.defaults))
    defaults += [ast.literal_eval(default) for default in function.args.defaults]
    for one, default in zip(named, defaults, strict=True):
        if one.arg != "self":
            yield one.arg, "positional or keyword", default
    for one, node in zip(function.args.kwonlyargs, function.args.kw_defaults, strict=True):
        yield one.arg, "keyword-only", inspect.Parameter.empty if node is None else ast.literal_eval(node)
