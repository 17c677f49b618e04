# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that another version of the extension has saved: what they hold is kept, or a warning lists it."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import pytest

from addon.blender.render.viewport import Viewport
from addon.blender.settings import properties, quality, stored
from addon.core.base.notes import Notes
from tests.blender import atlas
from tests.blender.shapes import cube, look, reopened
from tests.blender.viewing import settle


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
    return [line for line in atlas.warnings(scene) if line.startswith(stored.REPLACED)]


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"traversal": stored.number_of("of a later version")}, "Rays Automatic"),
        ({"max_depth": 100_000}, "Depth Limit 60"),
        ({"integrator": 77}, "Integrator Path Tracing"),
        ({"pixel_filter_type": 77}, "Filter Type Blackman-Harris"),
        ({"instancing": 77}, "Instances Automatic"),
        ({"top": 77}, "Top Surface Area"),
    ],
    ids=lambda one: next(iter(one)) if isinstance(one, dict) else "",
)
def test_a_value_of_another_version_is_replaced_and_listed(
    lit: Any, tmp_path: Path, values: dict[str, Any], said: str
) -> None:
    loaded = later(lit, tmp_path / "later.blend", values)
    assert warnings(loaded) == [f"{stored.REPLACED}: {said}"]
    view = Viewport()
    view.update(Engine(), SimpleNamespace(space_data=None), bpy.context.evaluated_depsgraph_get())
    settle(view)
    assert f"{stored.REPLACED}: {said}" in view.status()


def test_settings_that_this_version_lacks_altogether_do_no_harm(lit: Any, tmp_path: Path) -> None:
    loaded = later(lit, tmp_path / "later.blend", {"a_setting_of_later": 3, "last_structure": "kd"})
    assert warnings(loaded) == []


def test_every_choice_of_the_picture_is_checked(lit: Any) -> None:
    """An unknown number in any of them must not stop a render."""
    notes = Notes()
    names = [name for name, made in quality.PROPERTIES.items() if made.function is bpy.props.EnumProperty]
    # Bakes alone read their type.
    assert {*names, "instancing", "top"} == {*quality.CHOICES, "bake_type"}
    quality.remark_unknown(lit.halfspace, notes)
    properties.remark_unknown(lit.halfspace, notes)
    assert notes.lines() == []
