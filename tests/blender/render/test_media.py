# SPDX-License-Identifier: GPL-3.0-or-later
"""Volumes in whole scenes compared with Cycles: behind surfaces, around the camera, in the world, and as textures."""

from typing import Any

import bpy
import numpy as np
import pytest

from addon.blender.measure import pictures
from tests.blender import atlas
from tests.blender.atlas import add as node
from tests.blender.atlas import made
from tests.blender.shapes import cube, grid, lamp, look, material, place, with_nodes, world
from tests.blender.shapes import node as node_of

SIZE, SAMPLES, BOUNCES = 24, 512, 6


@pytest.fixture(name="stage")
def staged(scene: Any) -> Any:
    """A floor below a soft lamp in a dim world, seen from the side."""
    atlas.with_cycles(scene)
    world()
    look((SIZE, SIZE), (0, -6, 1), 1.4)
    lamp("POINT", 200, shadow_soft_size=0.3, location=(1.5, -1.5, 2.5))
    place("Floor", grid(1, smooth=False), material("Floor"), location=(0, 0, -1), scale=(4, 4, 1))
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
    tree.nodes.remove(node_of(tree, "ShaderNodeBsdfPrincipled"))
    if surface is not None:
        tree.links.new(node(tree, surface[0], **surface[1]).outputs[0], output(tree).inputs["Surface"])
    tree.links.new(node(tree, kind, **settings).outputs[0], output(tree).inputs["Volume"])
    return block


def box(block: Any, size: float = 1.6, **properties: Any) -> Any:
    return place(block.name, cube(size=size), block, **({"rotation_euler": (0.2, 0.1, 0.4)} | properties))


def check(scene: Any) -> None:
    """Compare the means of all channels with those of Cycles."""
    ours, theirs = atlas.pair(scene, 4).mean(axis=(1, 2))
    assert ours == pytest.approx(theirs, rel=0.012)
    assert not atlas.warnings(scene)


def test_light_scattered_last_by_fog_comes_from_lights_alone(stage: Any) -> None:
    # The bright floor would light the fog, too.
    shader = node_of(bpy.data.materials["Floor"].node_tree, "ShaderNodeBsdfPrincipled")
    shader.inputs["Base Color"].default_value = (0.9, 0.9, 0.9, 1)
    box(filled("Fog", "VolumeScatter", Density=0.8, Color=(1, 1, 1, 1)), size=3.0)
    stage.halfspace.volume_bounces = stage.cycles.volume_bounces = 0
    check(stage)
    stage.render.engine = "HALFSPACE"
    once = pictures.render(stage)[..., :3].mean()
    stage.halfspace.volume_bounces = 1
    assert pictures.render(stage)[..., :3].mean() > 1.05 * once


GLASS = ("BsdfGlass", {"IOR": 1.3, "Roughness": 0.0})
TRANSLUCENT = ("BsdfTranslucent", {"Color": (0.8, 0.7, 0.6, 1)})


@pytest.mark.parametrize(("surface", "samples"), [(GLASS, 4096), (TRANSLUCENT, SAMPLES)], ids=["glass", "translucent"])
def test_volumes_behind_surfaces(stage: Any, surface: tuple[str, dict[str, Any]], samples: int) -> None:
    # Through glass, light finds the lamp by chance only.
    stage.halfspace.samples = stage.cycles.samples = samples
    box(filled("Block", "VolumeScatter", surface, Color=(0.5, 0.5, 0.9, 1), Density=1.0))
    check(stage)


def test_a_world_of_fog(stage: Any) -> None:
    tree = stage.world.node_tree
    fog = node(tree, "VolumeScatter", Density=0.08, Color=(0.9, 0.7, 0.5, 1))
    tree.links.new(fog.outputs[0], output(tree).inputs["Volume"])
    check(stage)


@pytest.mark.parametrize("lens", [False, True])
def test_a_camera_in_fog_sees_what_glows_in_it(stage: Any, lens: bool) -> None:
    box(filled("Fog", "VolumeScatter", Density=0.05), 30.0)
    box(filled("Cloud", "VolumePrincipled", Density=2.0, Emission_Strength=1.0), 1.0)
    box(material("Glow", Emission_Color=(1, 0.5, 0.2, 1), Emission_Strength=20.0), 0.3, location=(1.2, 0, 0))
    dof = stage.camera.data.dof
    dof.use_dof, dof.aperture_fstop, dof.focus_distance = lens, 0.5, 6.0
    check(stage)


def test_the_alpha_of_a_cloud_on_a_transparent_film(stage: Any) -> None:
    box(filled("Cloud", "VolumePrincipled", Density=1.0))
    bpy.data.objects.remove(bpy.data.objects["Floor"])
    stage.render.film_transparent = True
    check(stage)


@pytest.mark.parametrize("instancing", ["flatten", "two-level"])
def test_overlapping_instances(stage: Any, instancing: str) -> None:
    stage.halfspace.instancing = instancing
    mesh = cube(size=0.8)
    mesh.materials.append(filled("Cloud", "VolumePrincipled", Density=3.0))
    for i in range(4):
        place(f"Cloud {i}", mesh, location=(i * 0.6 - 1, 0, 0.2 * i), rotation_euler=(0.2 * i, 0.1, 0.4))
    check(stage)


def test_a_density_that_a_texture_gives(stage: Any) -> None:
    noise = made("TexNoise", Vector=made("TexCoord", output="Object"), Scale=2.0, Detail=0.0)
    box(filled("Cloud", "VolumeScatter", Density=made("Math", noise, 5.0, operation="MULTIPLY")))
    check(stage)


def test_other_integrators_leave_volumes_out(stage: Any) -> None:
    box(filled("Cloud", "VolumeAbsorption", Density=9.0))
    stage.render.engine = "HALFSPACE"
    stage.halfspace.integrator = "ao"
    seen = pictures.render(stage)
    bpy.data.objects.remove(bpy.data.objects["Cloud"])
    assert np.abs(seen - pictures.render(stage)).mean() < 0.02
