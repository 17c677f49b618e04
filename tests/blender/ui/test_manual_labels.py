# SPDX-License-Identifier: GPL-3.0-or-later
"""The manual names panels, properties and buttons as they are labelled: each name in italics is a label."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import pytest

from addon.blender.inspector import exporting

ROOT = Path(__file__).resolve().parents[3]
MANUAL = ROOT / "docs" / "manual.md"
DRAWN = (
    *sorted((ROOT / "addon" / "blender" / "ui").glob("*.py")),
    ROOT / "addon" / "blender" / "samples" / "arrays.py",
)
"""Sources that draw buttons and titles with texts of their own."""

CODE = re.compile(r"^```.*?^```$|`[^`\n]+`", re.MULTILINE | re.DOTALL)
ITALIC = re.compile(r"(?<!\*)\*([^*]+)\*(?!\*)")


def every(base: Any) -> Iterator[Any]:
    """All classes below a class."""
    for one in base.__subclasses__():
        yield one
        yield from every(one)


def names_of(struct: Any) -> Iterator[str]:
    """The names of a type of Blender, of its properties and of their choices."""
    yield struct.name
    for one in struct.properties:
        yield one.name
        if one.type == "ENUM":
            yield from (item.name for item in one.enum_items_static)


def labels() -> set[str]:
    """All labels of this Blender with the extension: of types, panels, menus, operators and properties."""
    found: set[str] = set()
    types = [getattr(bpy.types, name) for name in dir(bpy.types)]
    for base in (bpy.types.PropertyGroup, bpy.types.Panel, bpy.types.Operator, bpy.types.Menu):
        types += every(base)
    for one in types:
        if struct := getattr(one, "bl_rna", None):
            found.update(names_of(struct))
        found.update(getattr(one, name, "") for name in ("bl_label", "bl_category"))
    for module in map(bpy.ops.__getattribute__, dir(bpy.ops)):
        for name in dir(module):
            found.update(names_of(getattr(module, name).get_rna_type()))
    return found


def drawn() -> set[str]:
    """The texts with which panels draw titles and buttons in place of labels."""
    found = {f"Export {name}" for _, name, *_ in exporting.WHAT}
    for path in DRAWN:
        tree = ast.parse(path.read_text(encoding="utf-8"))
        told = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
        found.update(
            node.value
            for node in ast.walk(tree)
            if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in told
        )
    return found


def italics(text: str) -> list[str]:
    """The names in italics of a document, once each."""
    return list(dict.fromkeys(" ".join(one.split()) for one in ITALIC.findall(CODE.sub("", text))))


@pytest.fixture(scope="module")
def known(_addon: None) -> set[str]:
    return labels() | drawn()


def test_names_in_italics_are_labels(known: set[str]) -> None:
    names = italics(MANUAL.read_text(encoding="utf-8"))
    assert len(names) > 100
    assert [name for name in names if name not in known] == []


def test_a_name_that_is_no_label_is_found(known: set[str]) -> None:
    text = "Press *Pick a Ray*, not\n`*Ray Pick*`, **bold** or\n\n```sh\n*x*\n```\n\n*Pick a\nBeam*."
    assert [name for name in italics(text) if name not in known] == ["Pick a Beam"]
