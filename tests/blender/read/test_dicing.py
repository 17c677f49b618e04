# SPDX-License-Identifier: GPL-3.0-or-later
"""Adaptive subdivision: the modifier's points stay, edges become short where the camera sees them, without cracks."""

from typing import Any

import addon_utils
import bpy
import numpy as np
import pytest
from mathutils.bvhtree import BVHTree

from addon.blender.read import dicing
from addon.blender.read.meshes import MeshArrays, read_mesh
from addon.core.base.steps import completed
from tests.blender.shapes import cube, look, read

LONGEST = 0.1


def surface(add: Any, **settings: Any) -> Any:
    """A smooth cube with a subdivision surface."""
    mesh = cube(size=2.0)
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    item = add("Surface", mesh)
    modifier = item.modifiers.new("Subdivision", "SUBSURF")
    for name, value in settings.items():
        setattr(modifier, name, value)
    return item


def arrays(item: Any, levels: int) -> MeshArrays:
    item.modifiers[-1].levels = levels
    return completed(read_mesh(item.evaluated_get(bpy.context.evaluated_depsgraph_get()).data, uvs=True))


def by_length(mesh: MeshArrays, *, curved: bool = True, levels: int = 8) -> MeshArrays:
    rate = dicing.Rate(LONGEST, in_pixels=False, levels=levels, curved=curved)
    return dicing.diced(mesh, lambda a, b: np.linalg.norm(b - a, axis=1), rate)


def edges(mesh: MeshArrays) -> tuple[Any, Any]:
    """The edges of a mesh and how many triangles have each."""
    sides = np.sort(mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    found = np.unique(sides, axis=0, return_counts=True)
    return found[0], found[1]


def test_edges_are_short_and_each_has_two_triangles(add: Any) -> None:
    before = arrays(surface(add), 2)
    mesh = by_length(before)
    found, count = edges(mesh)
    lengths = np.linalg.norm(np.diff(mesh.positions[found], axis=1), axis=2)
    assert (count == 2).all()
    assert lengths.max() <= LONGEST
    assert np.array_equal(mesh.positions[: len(before.positions)], before.positions)
    assert mesh.uvs is not None
    assert mesh.uvs.shape == (len(mesh.triangles), 3, 2)
    assert len(by_length(before, levels=1).triangles) <= 4 * len(before.triangles) < len(mesh.triangles)


@pytest.mark.parametrize("levels", [1, 2, 3])
def test_points_lie_on_the_limit_surface(add: Any, levels: int) -> None:
    item = surface(add)
    fine = arrays(item, 6)
    tree = BVHTree.FromPolygons(fine.positions.tolist(), fine.triangles.tolist())
    coarse = arrays(item, levels)
    away = {
        curved: max(tree.find_nearest(point)[3] for point in by_length(coarse, curved=curved).positions.tolist())
        for curved in (False, True)
    }
    assert away[True] < (0.02, 0.003, 0.0006)[levels - 1]
    assert away[True] < 0.2 * away[False]


def adaptive(scene: Any, item: Any) -> None:
    """Let an object be diced."""
    addon_utils.enable("cycles")
    if not hasattr(scene, "cycles"):
        pytest.skip("this Blender has no Cycles")
    if hasattr(item.modifiers[-1], "use_adaptive_subdivision"):
        item.modifiers[-1].use_adaptive_subdivision = True
    else:
        scene.cycles.feature_set, item.cycles.use_adaptive_subdivision = "EXPERIMENTAL", True


def test_triangles_are_small_where_the_camera_sees_them(add: Any, scene: Any) -> None:
    item = surface(add)
    adaptive(scene, item)
    cycles = scene.cycles

    def count() -> int:
        scene.update_tag()
        found, notes = read()
        assert not notes
        return found.geometry.count

    look((64, 64), (0, 0, 8))
    cycles.preview_dicing_rate = 4.0
    near = count()
    assert near > 4 * 48
    # Each setting has its effect.
    cycles.preview_dicing_rate = 1.0
    finer = count()
    assert finer > 4 * near
    item.location.x = 7.0
    beyond = count()
    assert beyond < finer / 4
    cycles.offscreen_dicing_scale = 1.0
    assert count() > 2 * beyond
    item.location.x = 0.0
    cycles.max_subdivisions = 2
    assert count() == 4 * 48
    cycles.max_subdivisions = 12
    far = bpy.data.objects.new("Far", bpy.data.cameras.new("Far"))
    far.location.z = 500.0
    scene.collection.objects.link(far)
    cycles.dicing_camera = far
    assert count() == 48
    modifier = item.modifiers[-1]
    if hasattr(modifier, "adaptive_space"):
        modifier.adaptive_space, modifier.adaptive_object_edge_length = "OBJECT", 0.1
        assert count() > near
    modifier.show_viewport = False
    assert count() == 12


def test_without_a_camera_the_levels_of_the_modifier_are_rendered(add: Any, scene: Any) -> None:
    adaptive(scene, surface(add))
    found, notes = read()
    assert found.geometry.count == 48
    assert notes == ["Adaptive subdivision needs a camera, rendered with the modifier's levels: Surface"]
