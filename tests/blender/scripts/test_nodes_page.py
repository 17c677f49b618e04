# SPDX-License-Identifier: GPL-3.0-or-later
"""The page of shader nodes agrees with Blender, with the engine's tables and with the tests that it names."""

import re
from pathlib import Path

import bpy
import pytest

from tests.blender import beside_cycles, nodes_page

TESTS = Path(__file__).resolve().parents[1]


def rows(text: str) -> dict[str, tuple[str, list[str]]]:
    """State and tests by the name of the node, of the first list of a page."""
    text = text.partition("\n## ")[0]
    found = re.findall(r"^- (.+?)(?: \(\*([a-z ]+)\*\))?(?:: (`.*`))?$", text, re.MULTILINE)
    return {name: (state or "supported", re.findall(r"`(\w+)`", tests)) for name, state, tests in found}


def test_the_page_of_nodes_is_current() -> None:
    if bpy.app.version < (5, 2):
        pytest.skip("the page is about the nodes of Blender 5.2")
    page = rows(nodes_page.PAGE.read_text(encoding="utf-8"))
    labels = nodes_page.offered()
    assert {name: state for name, (state, _) in page.items()} == {
        label: nodes_page.state(node) for node, label in labels.items()
    }, "run python -m tests.blender.nodes_page"
    text = "".join(path.read_text(encoding="utf-8") for path in TESTS.rglob("test_*.py"))
    assert [test for _, tests in page.values() for test in tests if f"def {test}(" not in text] == []
    # Nodes that only hand values on have no tile of their own; those that move or cut out things have other tests.
    bare = {name for name, (state, tests) in page.items() if state == "supported" and not tests}
    handed = {"Add Shader", "AOV Output", "Background", "Color Attribute", "Group", "World Output"}
    others = {"Displacement", "Vector Displacement", "Holdout", "Point Info", "Squeeze Value (Legacy)", "Volume Info"}
    assert bare <= handed | others, bare


def test_the_page_lists_objects_cameras_and_passes_with_tests_that_exist() -> None:
    assert nodes_page.PAGE.read_text(encoding="utf-8").endswith(beside_cycles.section())
    text = "".join(path.read_text(encoding="utf-8") for path in TESTS.rglob("test_*.py"))
    named = [test for _, _, _, tests in beside_cycles.ROWS for test in tests]
    assert [test for test in named if f"def {test}(" not in text] == []
    assert {kind for kind, _, _, _ in beside_cycles.ROWS} >= {"Object", "Light", "Camera", "Pass"}


def test_a_record_becomes_a_list() -> None:
    lines = ['["test_b", ["ShaderNodeMath"]]', '["test_a", ["ShaderNodeMath", "ShaderNodeTexCoord"]]']
    labels = {"ShaderNodeMath": "Math", "ShaderNodeTexCoord": "Texture Coordinate", "ShaderNodeUnknown": "Unknown"}
    found = rows(nodes_page.page(labels, nodes_page.compared(lines), "9.9"))
    assert found == {
        "Math": ("supported", ["test_a", "test_b"]),
        "Texture Coordinate": ("in part", ["test_a"]),
        "Unknown": ("not rendered", []),
    }
