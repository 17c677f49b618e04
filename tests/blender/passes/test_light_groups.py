# SPDX-License-Identifier: GPL-3.0-or-later
"""Light groups beside those of Cycles: their parts of the light."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import addon_utils
import atlas
import bpy
import numpy as np
import pytest
from atlas import add as node
from atlas import tile_material
from exr_files import exr
from shapes import cube, grid, with_nodes
from shapes import node as node_of

from addon.blender.render.engine import ENGINE

GROUPS = ("Lamps", "Glow", "Sky", "Dark")


@pytest.fixture
def room(add: Any, scene: Any) -> Any:
    """A glowing cube, a lamp that the camera sees, a lamp without shadows, a sun in no group, and a world."""
    addon_utils.enable("cycles")
    if not hasattr(scene, "cycles"):
        pytest.skip("this Blender has no Cycles")
    glow = cube("Glow")
    glow.materials.append(tile_material("Glow", lambda tree: node(tree, "Emission", Strength=3.0).outputs[0]))
    add("Glow", glow, location=(-2, 0, 0), rotation_euler=(0.3, 0.2, 0.4), scale=(0.6, 0.6, 0.6)).lightgroup = "Glow"
    floor = grid(1)
    floor.materials.append(
        tile_material("Floor", lambda tree: node(tree, "BsdfPrincipled", Metallic=0.5, Roughness=0.3).outputs[0])
    )
    add("Floor", floor, location=(0, 0, -1), scale=(6, 6, 1))
    area = bpy.data.lights.new("Area", "AREA")
    area.energy, area.size = 150.0, 1.5
    seen = add("Area", area, location=(2, 2, 2), rotation_euler=(0.9, 0.2, 0))
    seen.lightgroup, seen.visible_camera = "Lamps", True
    point = bpy.data.lights.new("Point", "POINT")
    point.energy, point.use_shadow = 60.0, False
    add("Point", point, location=(1, -2, 1.5)).lightgroup = "Lamps"
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy = 0.5
    add("Sun", sun, rotation_euler=(0.5, 0.3, 0))
    scene.world = bpy.data.worlds.new("World")
    with_nodes(scene.world)
    node_of(scene.world.node_tree, "ShaderNodeBackground").inputs["Color"].default_value = (0.1, 0.2, 0.4, 1)
    scene.world.lightgroup = "Sky"
    scene.camera = add("Camera", bpy.data.cameras.new("Camera"), location=(0, -9, 4), rotation_euler=(1.15, 0, 0))
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 60, 40, 100
    for name in GROUPS:
        bpy.context.view_layer.lightgroups.add(name=name)
    return scene


def parts(channels: dict[str, Any]) -> dict[str, Any]:
    """The picture of each group, and Combined, (h, w, 3)."""
    names = {"all": "Combined"} | {name: f"Combined_{name}" for name in GROUPS}
    return {name: np.dstack([channels[f"{own}.{c}"] for c in "RGB"]).astype(float) for name, own in names.items()}


def test_groups_have_the_light_that_they_have_in_cycles(room: Any, tmp_path: Path) -> None:
    atlas.configure(room, 400, 2)
    found = []
    for engine in (ENGINE, "CYCLES"):
        room.render.engine = engine
        found.append(parts(exr(room, tmp_path / f"{engine}.exr")))
    ours, theirs = found
    for name in ("all", "Lamps", "Glow", "Sky"):
        means = ours[name].mean(axis=(0, 1)), theirs[name].mean(axis=(0, 1))
        assert theirs[name].std() > 0.01, name
        assert np.abs(means[0] - means[1]).max() < 0.01 * means[1].mean(), name
    assert not ours["Dark"].any()


@pytest.mark.parametrize("integrator", ["path", "whitted"])
def test_groups_add_up_if_every_emitter_has_one(room: Any, tmp_path: Path, integrator: str) -> None:
    atlas.configure(room, 4, 3)
    room.render.engine, room.halfspace.integrator, room.halfspace.film_exposure = ENGINE, integrator, 1.5
    room.halfspace.clamp_indirect = room.halfspace.clamp_direct = 1.0
    bpy.data.objects["Sun"].lightgroup = "Dark"
    found = parts(exr(room, tmp_path / "picture.exr"))
    total = sum(found[name] for name in GROUPS)
    assert np.allclose(total, found["all"], rtol=1e-4, atol=1e-5)
    assert all(found[name].any() for name in GROUPS)
