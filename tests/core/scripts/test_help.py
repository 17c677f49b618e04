# SPDX-License-Identifier: GPL-3.0-or-later
"""The type stub of the native module: its texts are generated from the module, its declarations are the module's."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Iterator
from typing import Any

import halfspace_native as native

from scripts.dev import stub


def test_the_texts_of_the_stub_are_those_of_the_module() -> None:
    text = stub.STUB.read_text(encoding="utf-8")
    assert stub.filled(text, native) == text, "python -m scripts.dev.stub writes it"
    described = list(stub.described(text, native))
    first = described[0][0].value.split()[0]
    assert stub.filled(text.replace(f'"""{first}', '"""Other', 1), native) == text
    assert all(constant.value for constant, _ in described)
    # Installed from a wheel, the module is a package around the compiled one.
    public = {name for name, thing in inspect.getmembers(native) if not inspect.ismodule(thing)}
    declared = {getattr(node, "name", "") for node in ast.parse(text).body}
    assert {name for name in public if not name.startswith("__")} <= declared


def functions(body: list[ast.stmt], owner: Any) -> Iterator[tuple[ast.FunctionDef, Any]]:
    """The functions and methods that the stub declares, of several overloads the first, with those of the module."""
    seen: set[str] = set()
    for node in body:
        if isinstance(node, ast.ClassDef) and hasattr(owner, node.name):
            yield from functions(node.body, getattr(owner, node.name))
        is_property = any("property" in ast.unparse(one) for one in getattr(node, "decorator_list", ()))
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("__") and not is_property:
            if node.name not in seen:
                yield node, getattr(owner, node.name)
            seen.add(node.name)


def test_the_stub_declares_the_parameters_of_the_module() -> None:
    found = list(functions(ast.parse(stub.STUB.read_text(encoding="utf-8")).body, native))
    assert len(found) > 40
    for node, thing in found:
        given = [one for one in inspect.signature(thing).parameters.values() if one.name != "self"]
        own = [one.arg for one in node.args.args if one.arg != "self"]
        assert [one.name for one in given] == [*own, *(one.arg for one in node.args.kwonlyargs)], node.name
        assert [one.name for one in given if one.kind is one.KEYWORD_ONLY] == [one.arg for one in node.args.kwonlyargs]
        defaults = [ast.literal_eval(one) for one in (*node.args.defaults, *node.args.kw_defaults) if one is not None]
        assert [one.default for one in given if one.default is not one.empty] == defaults, node.name
