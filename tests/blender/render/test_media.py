# SPDX-License-Identifier: GPL-3.0-or-later
"""Volumes in whole scenes beside Cycles: behind surfaces, around the camera, in the world, and as textures."""

from __future__ import annotations

from typing import Any

import addon_utils
import atlas
import bpy
import numpy as np
import pytest
from atlas import add as node
from shapes import cube, material, with_nodes

from addon.blender.measure import pictures
from addon.blender.session import reports

SIZE, SAMPLES, BOUNCES = 24, 512, 6


@pytest.fixture(name="stage")
def staged(scene: Any, add: Any) -> Any:
    """A floor below a soft lamp in a dim world, seen from the side."""
    addon_utils.enable("cycles")
    if not hasattr(scene, "cycles"):
        pytest.skip("this Blender has no Cycles")
    scene.world = bpy.data.worlds.new("World")
    with_nodes(scene.world)
    camera = bpy.data.cameras.new("Camera")
    scene.camera = add("Camera", camera, location=(0, -6, 1), rotation_euler=(1.4, 0, 0))
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    lamp = bpy.data.lights.new("Lamp", "POINT")
    lamp.energy, lamp.shadow_soft_size = 200, 0.3
    add("Lamp", lamp, location=(1.5, -1.5, 2.5))
    floor = bpy.data.meshes.new("Floor")
    floor.from_pydata([(-4, -4, -1), (4, -4, -1), (4, 4, -1), (-4, 4, -1)], [], [(0, 1, 2, 3)])
    floor.materials.append(material("Floor"))
    add("Floor", floor)
    atlas.configure(scene, SAMPLES, BOUNCES)
    scene.halfspace.volume_bounces = scene.cycles.volume_bounces = BOUNCES
    return scene


def output(tree: Any) -> Any:
    return next(n for n in tree.nodes if n.bl_idname.startswith("ShaderNodeOutput"))


def filled(name: str, kind: str, surface: tuple[str, dict[str, Any]] | None = None, **settings: Any) -> Any:
    """A material with a volume, and with a surface if there is one."""
    block = bpy.data.materials.new(name)
    with_nodes(block)
    tree = block.node_tree
    tree.nodes.remove(next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled"))
    if surface is not None:
        tree.links.new(node(tree, surface[0], **surface[1]).outputs[0], output(tree).inputs["Surface"])
    tree.links.new(node(tree, kind, **settings).outputs[0], output(tree).inputs["Volume"])
    return block


def place(add: Any, block: Any, size: float = 1.6, **properties: Any) -> Any:
    mesh = cube(size=size)
    mesh.materials.append(block)
    return add(block.name, mesh, **({"rotation_euler": (0.2, 0.1, 0.4)} | properties))


def check(scene: Any) -> None:
    """Compare the means of all channels with those of Cycles."""
    found = []
    for engine in ("HALFSPACE", "CYCLES"):
        scene.render.engine = engine
        found.append(pictures.render(scene).astype(float).mean(axis=(0, 1)))
    assert found[0] == pytest.approx(found[1], rel=0.012)
    report = reports.last(scene)
    assert report is not None
    assert not report.warnings


def test_what_fog_scatters_last_comes_from_lights_alone(stage: Any, add: Any) -> None:
    # The bright floor would light the fog, too.
    shader = next(n for n in bpy.data.materials["Floor"].node_tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")
    shader.inputs["Base Color"].default_value = (0.9, 0.9, 0.9, 1)
    place(add, filled("Fog", "VolumeScatter", Density=0.8, Color=(1, 1, 1, 1)), size=3.0)
    stage.halfspace.volume_bounces = stage.cycles.volume_bounces = 0
    check(stage)
    stage.render.engine = "HALFSPACE"
    once = pictures.render(stage)[..., :3].mean()
    stage.halfspace.volume_bounces = 1
    assert pictures.render(stage)[..., :3].mean() > 1.05 * once


GLASS = ("BsdfGlass", {"IOR": 1.3, "Roughness": 0.0})
TRANSLUCENT = ("BsdfTranslucent", {"Color": (0.8, 0.7, 0.6, 1)})


@pytest.mark.parametrize(("surface", "samples"), [(GLASS, 4096), (TRANSLUCENT, SAMPLES)], ids=["glass", "translucent"])
def test_volumes_behind_surfaces(stage: Any, add: Any, surface: tuple[str, dict[str, Any]], samples: int) -> None:
    # Through glass, light finds the lamp by chance only.
    stage.halfspace.samples = stage.cycles.samples = samples
    place(add, filled("Block", "VolumeScatter", surface, Color=(0.5, 0.5, 0.9, 1), Density=1.0))
    check(stage)


def test_a_world_of_fog(stage: Any) -> None:
    tree = stage.world.node_tree
    fog = node(tree, "VolumeScatter", Density=0.08, Color=(0.9, 0.7, 0.5, 1))
    tree.links.new(fog.outputs[0], output(tree).inputs["Volume"])
    check(stage)


@pytest.mark.parametrize("lens", [False, True])
def test_a_camera_in_fog_sees_what_glows_in_it(stage: Any, add: Any, lens: bool) -> None:
    place(add, filled("Fog", "VolumeScatter", Density=0.05), 30.0)
    place(add, filled("Cloud", "VolumePrincipled", Density=2.0, Emission_Strength=1.0), 1.0)
    place(add, material("Glow", Emission_Color=(1, 0.5, 0.2, 1), Emission_Strength=20.0), 0.3, location=(1.2, 0, 0))
    dof = stage.camera.data.dof
    dof.use_dof, dof.aperture_fstop, dof.focus_distance = lens, 0.5, 6.0
    check(stage)


def test_the_alpha_of_a_cloud_on_a_transparent_film(stage: Any, add: Any) -> None:
    place(add, filled("Cloud", "VolumePrincipled", Density=1.0))
    bpy.data.objects.remove(bpy.data.objects["Floor"])
    stage.render.film_transparent = True
    check(stage)


@pytest.mark.parametrize("instancing", ["flatten", "two-level"])
def test_overlapping_instances(stage: Any, add: Any, instancing: str) -> None:
    stage.halfspace.instancing = instancing
    mesh = cube(size=0.8)
    mesh.materials.append(filled("Cloud", "VolumePrincipled", Density=3.0))
    for i in range(4):
        add(f"Cloud {i}", mesh, location=(i * 0.6 - 1, 0, 0.2 * i), rotation_euler=(0.2 * i, 0.1, 0.4))
    check(stage)


def test_a_density_that_a_texture_gives(stage: Any, add: Any) -> None:
    block = filled("Cloud", "VolumeScatter", Density=3.0)
    place(add, block)
    tree = block.node_tree
    noise, scaled = node(tree, "TexNoise", Scale=2.0, Detail=0.0), node(tree, "Math", operation="MULTIPLY")
    scaled.inputs[1].default_value = 5
    tree.links.new(node(tree, "TexCoord").outputs["Object"], noise.inputs["Vector"])
    tree.links.new(noise.outputs[0], scaled.inputs[0])
    scatter = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeVolumeScatter")
    tree.links.new(scaled.outputs[0], scatter.inputs["Density"])
    check(stage)


def test_other_integrators_leave_volumes_out(stage: Any, add: Any) -> None:
    place(add, filled("Cloud", "VolumeAbsorption", Density=9.0))
    stage.render.engine = "HALFSPACE"
    stage.halfspace.integrator = "ao"
    seen = pictures.render(stage)
    bpy.data.objects.remove(bpy.data.objects["Cloud"])
    assert np.abs(seen - pictures.render(stage)).mean() < 0.02
