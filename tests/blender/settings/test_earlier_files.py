# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that another version of the extension has saved: what they hold is kept, or a warning lists it."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy
import pytest
from shapes import cube

from addon.blender.render.viewport import Viewport
from addon.blender.session import reports
from addon.blender.settings import earlier, properties, quality
from addon.core.base.notes import Notes


@pytest.fixture
def lit(scene: Any, add: Any) -> Any:
    """A small picture of a cube."""
    add("Cube", cube())
    scene.camera = add("Camera", bpy.data.cameras.new("Camera"), location=(0, 0, 9))
    scene.render.engine, scene.render.resolution_x, scene.render.resolution_y = "HALFSPACE", 8, 8
    scene.halfspace.samples = 1
    return scene


class Engine:
    """Nothing of an engine is needed until its view is drawn."""


def reopened(scene: Any, path: Path, values: dict[str, Any]) -> Any:
    """The scene of a file that holds these raw values under `halfspace`, as another version may have stored them."""
    held = scene.bl_system_properties_get(do_create=True) if hasattr(scene, "bl_system_properties_get") else scene
    for name, value in values.items():
        held["halfspace"][name] = value
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return bpy.context.scene


def warnings(scene: Any) -> list[str]:
    """The warnings of a render."""
    bpy.ops.render.render()
    report = reports.last(scene)
    assert report is not None
    return [line for line in report.warnings if line.startswith(earlier.REPLACED)]


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
    loaded = reopened(lit, tmp_path / "later.blend", values)
    assert warnings(loaded) == [f"{earlier.REPLACED}: {said}"]
    view = Viewport()
    view.update(Engine(), SimpleNamespace(space_data=None), bpy.context.evaluated_depsgraph_get())
    assert f"{earlier.REPLACED}: {said}" in view.status()


def test_settings_that_this_version_lacks_altogether_do_no_harm(lit: Any, tmp_path: Path) -> None:
    loaded = reopened(lit, tmp_path / "later.blend", {"a_setting_of_later": 3, "last_structure": "kd"})
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
