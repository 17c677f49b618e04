# SPDX-License-Identifier: GPL-3.0-or-later
"""Subsurface scattering beside Cycles: closed balls in the light of a world and of a sun."""

from __future__ import annotations

from typing import Any

import atlas
import bmesh
import bpy
import numpy as np
import pytest
from atlas import add, place
from shapes import node, with_nodes

from addon.blender.session import reports

BOUNCES = 1
NEW = bpy.app.version >= (5, 2)
"""Whether radii are mean free paths, and not those of older profiles."""

LONG = 1.0 if NEW else 12.0
"""Factor on the radii of the method Random Walk."""


def ball() -> Any:
    """A smooth closed sphere of 0.9 units."""
    bm = bmesh.new()
    bmesh.ops.create_uvsphere(bm, u_segments=32, v_segments=16, radius=0.45)
    mesh = bpy.data.meshes.new("Ball")
    bm.to_mesh(mesh)
    bm.free()
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    return mesh


def scattering(**settings: Any) -> atlas.Maker:
    return lambda tree: add(tree, "SubsurfaceScattering", **settings).outputs[0]


def principled(**settings: Any) -> atlas.Maker:
    return lambda tree: add(tree, "BsdfPrincipled", **settings).outputs[0]


def textured(tree: Any) -> Any:
    """Colours and a bump that vary."""
    noise = add(tree, "TexNoise", Scale=1.5, Detail=1.0)
    tree.links.new(place(tree), noise.inputs["Vector"])
    shader, bump = add(tree, "SubsurfaceScattering", Scale=0.05 * LONG), add(tree, "Bump", Distance=0.1)
    tree.links.new(noise.outputs["Color"], shader.inputs["Color"])
    tree.links.new(noise.outputs[0], bump.inputs["Height"])
    tree.links.new(bump.outputs[0], shader.inputs["Normal"])
    return shader.outputs[0]


SKIN = {"Base_Color": (0.8, 0.5, 0.4, 1), "Subsurface_Radius": (1.0, 0.4, 0.2), "Subsurface_Scale": 0.1 * LONG}

BALLS = {
    "random walk": scattering(Color=(0.8, 0.5, 0.2, 1), Scale=0.1 * LONG, Radius=(1, 0.5, 0.25)),
    "forward": scattering(Color=(0.8, 0.6, 0.4, 1), Scale=0.2 * LONG, Radius=(1, 1, 1), Anisotropy=0.6),
    "skin": scattering(falloff="RANDOM_WALK_SKIN", Color=(0.8, 0.5, 0.2, 1), Scale=0.5, Radius=(1, 0.5, 0.25)),
    "thin": scattering(Color=(0.9, 0.9, 0.9, 1), Scale=1.0 * LONG, Radius=(1, 0.3, 0.0)),
    "dense": scattering(Color=(0.5, 0.5, 0.5, 1), Scale=0.002 * LONG, Radius=(1, 1, 1)),
    "principled": principled(Subsurface_Weight=1.0, Roughness=0.4, **SKIN),
    "half": principled(Subsurface_Weight=0.5, Subsurface_Anisotropy=0.4, Roughness=0.7, **SKIN),
    "principled skin": principled(subsurface_method="RANDOM_WALK_SKIN", Subsurface_Weight=1.0, **SKIN),
    "textured": textured,
}
if NEW:
    BALLS["legacy"] = scattering(falloff="RANDOM_WALK_LEGACY", Color=(0.8, 0.5, 0.2, 1), Scale=1.0, Anisotropy=0.3)


@pytest.fixture(name="lit")
def lights(scene: Any, add: Any) -> Any:
    """A scene with a dim world and a sun from the side."""
    scene.world = bpy.data.worlds.new("World")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy, sun.angle = 3.0, 0.5
    add("Sun", sun, rotation_euler=(1.1, 0.3, 0))
    return scene


def test_walks_are_those_of_cycles(lit: Any) -> None:
    atlas.sheet(lit, BALLS, ball())
    ours, theirs = atlas.both(lit, BALLS, samples=256, bounces=BOUNCES)
    # Cycles before Blender 5.2 is up to 3.6 % darker.
    assert not atlas.differences(ours, theirs, mean=0.01 if NEW else 0.04)
    report = reports.last(lit)
    assert report is not None
    assert not report.warnings


def test_a_white_furnace_stays_white(scene: Any) -> None:
    # Flat facets: corner normals send a part of the light back into the ball, in Cycles as well.
    white = {"Color": (1, 1, 1, 1), "Radius": (1, 1, 1)}
    balls = {
        "walk": scattering(Scale=0.3 * LONG, **white),
        "forward": scattering(Scale=0.05 * LONG, Anisotropy=0.8, **white),
        "skin": scattering(falloff="RANDOM_WALK_SKIN", Scale=50.0, **white),
    }
    mesh = ball()
    mesh.polygons.foreach_set("use_smooth", [False] * len(mesh.polygons))
    scene.world = bpy.data.worlds.new("World")
    with_nodes(scene.world)
    node(scene.world.node_tree, "ShaderNodeBackground").inputs["Color"].default_value = (1, 1, 1, 1)
    atlas.sheet(scene, balls, mesh)
    atlas.configure(scene, 2048, 12)
    for name, tile in atlas.rendered(scene, balls, "HALFSPACE").items():
        middle = tile[4:-4, 4:-4].astype(float).mean(axis=(0, 1))
        assert np.abs(middle - 1).max() < 0.002, (name, middle)


@pytest.mark.parametrize("odd", [-7.0, 1e30, 1e-30])
def test_absurd_inputs_give_a_picture(lit: Any, odd: float) -> None:
    def absurd(kind: str, **settings: Any) -> atlas.Maker:
        def make(tree: Any) -> Any:
            shader = add(tree, kind, **settings)
            for socket in shader.inputs:
                # Values beyond the limits of a socket arrive through links.
                if socket.enabled and socket.type in ("VALUE", "VECTOR") and "Normal" not in socket.name:
                    number = add(tree, "Value")
                    number.outputs[0].default_value = odd
                    tree.links.new(number.outputs[0], socket)
            return shader.outputs[0]

        return make

    family = {
        "walk": absurd("SubsurfaceScattering"),
        "skin": absurd("SubsurfaceScattering", falloff="RANDOM_WALK_SKIN"),
        "principled": absurd("BsdfPrincipled"),
        "profile": absurd("SubsurfaceScattering", falloff="BURLEY"),
    }
    atlas.sheet(lit, family, ball())
    atlas.configure(lit, 16, BOUNCES)
    for name, tile in atlas.rendered(lit, family, "HALFSPACE").items():
        assert np.isfinite(tile).all(), name
    report = reports.last(lit)
    assert report is not None
    assert any("Christensen-Burley" in line for line in report.warnings)
