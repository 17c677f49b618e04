# SPDX-License-Identifier: GPL-3.0-or-later
"""Shader nodes beside Cycles: balls in the light of a world and of two suns, one of them behind."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import atlas
import bmesh
import bpy
import pytest
from atlas import add, place

from addon.blender.session import reports

SAMPLES, BOUNCES = 256, 1


def ball() -> Any:
    """A smooth open sphere of 0.9 units: its lower half is missing, so that light enters it."""
    bm = bmesh.new()
    bm.loops.layers.uv.new("UVMap")
    bmesh.ops.create_uvsphere(bm, u_segments=48, v_segments=24, radius=0.45, calc_uvs=True)
    bmesh.ops.delete(bm, geom=[v for v in bm.verts if v.co.z < -0.2], context="VERTS")
    mesh = bpy.data.meshes.new("Ball")
    bm.to_mesh(mesh)
    bm.free()
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    return mesh


def shader(kind: str, **settings: Any) -> atlas.Maker:
    return lambda tree: add(tree, f"Bsdf{kind}", **settings).outputs[0]


def bumped(kind: str, *, height: Callable[[Any], Any], bump: dict[str, Any], **settings: Any) -> atlas.Maker:
    """A shader whose normal is that of a bump."""

    def make(tree: Any) -> Any:
        node, shape = add(tree, f"Bsdf{kind}", **settings), add(tree, "Bump", **bump)
        tree.links.new(height(tree), shape.inputs["Height"])
        tree.links.new(shape.outputs[0], node.inputs["Normal"])
        return node.outputs[0]

    return make


def noise(tree: Any) -> Any:
    texture = add(tree, "TexNoise", Scale=1.5, Detail=1.0)
    tree.links.new(place(tree), texture.inputs["Vector"])
    return texture.outputs[0]


def rings(tree: Any) -> Any:
    texture = add(tree, "TexWave", wave_type="RINGS", Scale=1.5)
    tree.links.new(add(tree, "UVMap").outputs[0], texture.inputs["Vector"])
    return texture.outputs["Color"]


def mixed(tree: Any) -> Any:
    mix = add(tree, "MixShader", Fac=0.4) if bpy.app.version < (5, 0) else add(tree, "MixShader", Factor=0.4)
    tree.links.new(add(tree, "BsdfTranslucent", Color=(0.2, 0.9, 0.3, 1)).outputs[0], mix.inputs[1])
    tree.links.new(add(tree, "BsdfGlossy", Color=(0.8, 0.7, 0.6, 1), Roughness=0.4).outputs[0], mix.inputs[2])
    return mix.outputs[0]


DIFFUSE = {
    "lambert": shader("Diffuse", Color=(0.8, 0.5, 0.3, 1)),
    "rough": shader("Diffuse", Color=(0.8, 0.5, 0.3, 1), Roughness=1.0),
    "half rough": shader("Diffuse", Color=(0.9, 0.9, 0.2, 1), Roughness=0.4),
    "rough base": shader("Principled", Base_Color=(0.7, 0.3, 0.6, 1), Diffuse_Roughness=0.9),
    "rough base below a coat": shader("Principled", Diffuse_Roughness=0.5, Coat_Weight=0.7, Coat_Roughness=0.5),
}

TRANSLUCENT = {
    "translucent": shader("Translucent", Color=(0.8, 0.5, 0.3, 1)),
    "mixed with gloss": mixed,
}

BUMPS = {
    "matte": bumped("Diffuse", height=noise, bump={"Distance": 0.2}),
    "inverted": bumped("Diffuse", height=noise, bump={"Distance": 0.2, "invert": True}),
    "weak": bumped("Diffuse", height=noise, bump={"Distance": 0.3, "Strength": 0.4}),
    "gloss": bumped("Glossy", height=noise, bump={"Distance": 0.1}, Roughness=0.3),
    "rings": bumped("Diffuse", height=rings, bump={"Distance": 0.03}),
    "rough": bumped("Diffuse", height=noise, bump={"Distance": 0.2}, Roughness=0.8),
    "principled": bumped("Principled", height=noise, bump={"Distance": 0.15}, Roughness=0.4),
}


@pytest.fixture(name="lit")
def lights(scene: Any, add: Any) -> Any:
    """A scene with a dim world, a sun from above and one from below."""
    scene.world = bpy.data.worlds.new("World")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    for tilt, energy in ((0.6, 2.0), (2.4, 1.5)):
        sun = bpy.data.lights.new("Sun", "SUN")
        sun.energy, sun.angle = energy, 0.1
        add("Sun", sun, rotation_euler=(tilt, 0.3, 0))
    return scene


@pytest.mark.parametrize("family", [DIFFUSE, TRANSLUCENT, BUMPS], ids=["diffuse", "translucent", "bump"])
def test_shaders_are_those_of_cycles(lit: Any, family: dict[str, atlas.Maker]) -> None:
    atlas.sheet(lit, family, ball())
    ours, theirs = atlas.both(lit, family, samples=SAMPLES, bounces=BOUNCES)
    assert not atlas.differences(ours, theirs)
    report = reports.last(lit)
    assert report is not None
    assert not report.warnings


def test_a_bump_changes_the_picture_and_a_flat_one_does_not(lit: Any) -> None:
    def level(tree: Any) -> Any:
        return add(tree, "Value").outputs[0]

    family = {
        "plain": shader("Diffuse"),
        "flat": bumped("Diffuse", height=level, bump={"Distance": 1.0}),
        "none": bumped("Diffuse", height=noise, bump={"Distance": 0.2, "Strength": 0.0}),
        "bump": BUMPS["matte"],
    }
    atlas.sheet(lit, family, ball())
    atlas.configure(lit, 64, 0)
    found = atlas.rendered(lit, family, "HALFSPACE")
    plain = found.pop("plain")
    changed = {name for name, tile in found.items() if ((tile - plain) ** 2).mean() ** 0.5 > 0.1 * plain.mean()}
    assert changed == {"bump"}
