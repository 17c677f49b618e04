# SPDX-License-Identifier: GPL-3.0-or-later
"""Light groups compared with those of Cycles: their parts of the light."""

from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.render.engine import ENGINE
from tests.blender import atlas
from tests.blender.atlas import made, tile_material
from tests.blender.exr_files import both, colours, exr
from tests.blender.shapes import cube, grid, lamp, look, place, world

GROUPS = ("Lamps", "Glow", "Sky", "Dark")


@pytest.fixture
def room(scene: Any) -> Any:
    """A glowing cube, a lamp that the camera sees, a lamp without shadows, a sun in no group, and a world."""
    atlas.with_cycles(scene)
    glow, metal = made("Emission", Strength=3.0), made("BsdfPrincipled", Metallic=0.5, Roughness=0.3)
    turned = {"location": (-2, 0, 0), "rotation_euler": (0.3, 0.2, 0.4), "scale": (0.6, 0.6, 0.6)}
    place("Glow", cube("Glow"), tile_material("Glow", glow), **turned, lightgroup="Glow")
    place("Floor", grid(1), tile_material("Floor", metal), location=(0, 0, -1), scale=(6, 6, 1))
    area = {"size": 1.5, "location": (2, 2, 2), "rotation_euler": (0.9, 0.2, 0), "visible_camera": True}
    lamp("AREA", 150.0, **area, lightgroup="Lamps")
    lamp("POINT", 60.0, use_shadow=False, location=(1, -2, 1.5), lightgroup="Lamps")
    lamp("SUN", 0.5, "Sun", rotation_euler=(0.5, 0.3, 0))
    world(0.1, 0.2, 0.4)
    scene.world.lightgroup = "Sky"
    look((60, 40), (0, -9, 4), 1.15)
    for name in GROUPS:
        bpy.context.view_layer.lightgroups.add(name=name)
    return scene


def parts(channels: dict[str, Any]) -> dict[str, Any]:
    """The picture of each group, and Combined, (h, w, 3)."""
    names = {"all": "Combined"} | {name: f"Combined_{name}" for name in GROUPS}
    return {name: colours(channels, own) for name, own in names.items()}


def test_groups_have_the_light_that_they_have_in_cycles(room: Any, tmp_path: Path) -> None:
    atlas.configure(room, 400, 2)
    ours, theirs = map(parts, both(room, tmp_path))
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
