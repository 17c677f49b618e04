# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that another version of the extension has saved: what they hold is kept, or a warning lists it."""

import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import atlas
import bpy
import pytest
from layouts import draw
from shapes import cube, look, reopened

from addon.blender.render.viewport import Viewport
from addon.blender.settings import earlier, properties, quality
from addon.blender.ui import panels, structure
from addon.core.base import native
from addon.core.base.notes import Notes
from addon.core.structures import specs

WAYS = Path(__file__).resolve().parents[3] / "native" / "structure" / "src" / "way.rs"


@pytest.fixture
def lit(scene: Any, add: Any) -> Any:
    """A small picture of a cube."""
    add("Cube", cube())
    look((8, 8), (0, 0, 9))
    scene.render.engine, scene.halfspace.samples = "HALFSPACE", 1
    return scene


class Engine:
    """Nothing of an engine is needed until its view is drawn."""


def later(scene: Any, path: Path, values: dict[str, Any]) -> Any:
    """The scene of a file that holds these raw values under `halfspace`, as another version may have stored them."""
    held = scene.bl_system_properties_get(do_create=True) if hasattr(scene, "bl_system_properties_get") else scene
    for name, value in values.items():
        held["halfspace"][name] = value
    return reopened(path)


def warnings(scene: Any) -> list[str]:
    """The warnings of a render."""
    bpy.ops.render.render()
    return [line for line in atlas.warnings(scene) if line.startswith(earlier.REPLACED)]


def test_former_traversals_are_those_of_the_native_module() -> None:
    spelled = re.findall(r'spelled: "([a-z0-9]+)"', WAYS.read_text(encoding="utf-8"))
    assert sorted(spelled) == sorted(earlier.SPELLINGS)


@pytest.mark.parametrize("spelled", earlier.SPELLINGS)
def test_a_former_traversal_is_kept(lit: Any, tmp_path: Path, spelled: str) -> None:
    loaded = later(lit, tmp_path / "old.blend", {"traversal": earlier.number_of(spelled)})
    assert not loaded.halfspace.traversal
    today = specs.canonical(native.load(), f"kd:traversal={spelled}")
    assert properties.spec(loaded.halfspace) == today != "kd"
    assert warnings(loaded) == []
    assert structure.menu_of("traversal") in draw(panels.HALFSPACE_PT_structure, scene=loaded)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"traversal": earlier.number_of("of a later version")}, "Rays Automatic"),
        ({"max_depth": 100_000}, "Depth Limit 60"),
        ({"integrator": 77}, "Integrator Path Tracing"),
        ({"pixel_filter_type": 77}, "Filter Type Blackman-Harris"),
        ({"instancing": 77}, "Instances Automatic"),
    ],
    ids=lambda one: next(iter(one)) if isinstance(one, dict) else "",
)
def test_a_value_of_another_version_is_replaced_and_listed(
    lit: Any, tmp_path: Path, values: dict[str, Any], said: str
) -> None:
    loaded = later(lit, tmp_path / "later.blend", values)
    assert warnings(loaded) == [f"{earlier.REPLACED}: {said}"]
    view = Viewport()
    view.update(Engine(), SimpleNamespace(space_data=None), bpy.context.evaluated_depsgraph_get())
    assert f"{earlier.REPLACED}: {said}" in view.status()


def test_settings_that_this_version_lacks_altogether_do_no_harm(lit: Any, tmp_path: Path) -> None:
    loaded = later(lit, tmp_path / "later.blend", {"a_setting_of_later": 3, "last_structure": "kd"})
    assert warnings(loaded) == []


def test_every_choice_of_the_picture_is_checked(lit: Any) -> None:
    """An unknown number in any of them must not stop a render."""
    notes = Notes()
    names = [name for name, made in quality.PROPERTIES.items() if made.function is bpy.props.EnumProperty]
    # Bakes alone read their type.
    assert {*names, "instancing"} == {*quality.CHOICES, "bake_type"}
    quality.remark_unknown(lit.halfspace, notes)
    properties.remark_unknown(lit.halfspace, notes)
    assert notes.lines() == []
