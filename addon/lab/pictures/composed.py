# SPDX-License-Identifier: GPL-3.0-or-later
"""Six composed scenes that use many features of the renderer at once, in pictures that an artist would set up."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import bpy
import numpy as np

from . import composed_head as heads
from . import composed_parts as made
from . import composed_plants as plants
from . import proving_parts as parts


def kitchen(scene: Any) -> None:
    """A worktop below a window: bumpy tiles and oranges, a glass of water, a steel bowl, a jar, a warm lamp."""
    parts.new_world(scene, (0.25, 0.32, 0.42))
    wall = parts.polygons(scene, "Tiles", [(-4, 2, 0), (4, 2, 0), (4, 2, 3.4), (-4, 2, 3.4)], [(0, 1, 2, 3)])
    parts.unwrap(wall.data, np.array([(0, 0), (8, 0), (8, 3.4), (0, 3.4)]))
    parts.wear(wall, made.tiles("Tiles", (0.75, 0.78, 0.74), (0.35, 0.33, 0.3)))
    top = parts.box(scene, (0, 0.4, -0.1), (4, 1.7, 0.1))
    parts.wear(top, made.wood("Worktop", (0.32, 0.17, 0.075), (0.5, 0.3, 0.14), scale=1.4))
    board = parts.box(scene, (1.25, -0.1, 0.04), (0.75, 0.5, 0.04))
    board.rotation_euler.z = -0.25
    parts.wear(board, made.wood("Board", (0.62, 0.4, 0.2), (0.75, 0.55, 0.32), scale=3.0))
    # A bowl of oranges, and a cut from it on the board.
    steel = parts.principled("Steel", (0.75, 0.76, 0.78), Metallic=1, Roughness=0.22)
    bowl = made.lathe(
        scene, "Bowl", [(0, 0.03), (0.3, 0.03), (0.72, 0.3), (0.86, 0.55), (0.83, 0.56), (0.66, 0.31), (0, 0.09)]
    )
    bowl.location = (-1.15, 0.55, 0)
    parts.wear(bowl, steel)
    peel = made.bumpy("Peel", (0.9, 0.33, 0.03), scale=40, strength=0.35, Roughness=0.4)
    for x, y, z, radius in (
        (-1.4, 0.5, 0.55, 0.31),
        (-0.9, 0.75, 0.53, 0.3),
        (-1.0, 0.3, 0.6, 0.28),
        (1.15, -0.05, 0.37, 0.29),
    ):
        parts.wear(parts.sphere(scene, (x, y, z), radius, rings=28), peel)
    # A tumbler of water and a jar of green glass.
    glass = parts.one_shader("Glass", "BsdfGlass", Color=(1, 1, 1, 1), Roughness=0, IOR=1.5)
    tumbler = made.lathe(
        scene, "Tumbler", [(0, 0), (0.24, 0), (0.27, 0.04), (0.31, 0.85), (0.285, 0.85), (0.245, 0.08), (0, 0.08)]
    )
    tumbler.location = (0.15, -0.25, 0.003)
    parts.wear(tumbler, glass)
    water = made.lathe(scene, "Water", [(0, 0.085), (0.243, 0.085), (0.268, 0.52), (0, 0.52)])
    water.location = tumbler.location
    parts.wear(water, parts.one_shader("Water", "BsdfGlass", Color=(0.9, 0.97, 1, 1), Roughness=0, IOR=1.33))
    jar = made.lathe(
        scene, "Jar", [(0, 0), (0.34, 0), (0.38, 0.08), (0.38, 0.8), (0.2, 1.05), (0.2, 1.25), (0.25, 1.28), (0, 1.28)]
    )
    jar.location = (2.35, 1.1, 0)
    parts.wear(jar, parts.principled("Glaze", (0.05, 0.2, 0.16), Roughness=0.12, Coat_Weight=0.6, Coat_Roughness=0.03))
    window = parts.lamp(scene, "AREA", (-4.2, -1.6, 3.4), (0, 0.6, 0.4), energy=330, size=1.8)
    window.data.color = (0.85, 0.93, 1)
    pendant = parts.lamp(scene, "POINT", (1.5, 0.2, 2.7), (0, 0, 0), energy=95, shadow_soft_size=0.16)
    pendant.data.color = (1, 0.72, 0.42)
    parts.look(scene, (0.35, -5.2, 1.9), (0.1, 0.55, 0.62), 29)


def portrait(scene: Any) -> None:
    """A head with translucent skin, wet eyes and hair, in the light of a key, a rim and a fill lamp."""
    parts.new_world(scene, (0.03, 0.035, 0.05))
    skin = heads.skin()
    head = heads.head(scene, skin)
    heads.eyes(scene)
    heads.hair(scene, head, int(5200 * parts.detail**3) + 2)
    # Tubes are Cycles' thick curves; its ribbons have another brightness, where hair is dense.
    if hasattr(scene, "cycles_curves"):
        scene.cycles_curves.shape = "THICK"
    neck = made.lathe(scene, "Neck", [(0.62, -2.2), (0.42, -1.5), (0.4, -1.0), (0.4, -0.6), (0.3, -0.35), (0, -0.3)])
    neck.location = (0, 0.2, 0)
    parts.wear(neck, skin)
    shirt = made.lathe(scene, "Shirt", [(1.75, -2.8), (1.4, -1.95), (0.72, -1.5), (0.52, -1.4), (0.47, -1.5)])
    shirt.location = (0, 0.2, 0)
    shirt.scale.y = 0.7
    parts.wear(shirt, parts.principled("Wool", (0.06, 0.1, 0.2), Roughness=0.9, Sheen_Weight=0.6, Sheen_Roughness=0.4))
    back = parts.polygons(scene, "Backdrop", [(-9, 5, -5), (9, 5, -5), (9, 5, 7), (-9, 5, 7)], [(0, 1, 2, 3)])
    parts.wear(back, parts.one_shader("Paper", "BsdfDiffuse", Color=(0.16, 0.17, 0.19, 1)))
    key = parts.lamp(scene, "AREA", (-3.2, -4, 2.6), (0, 0, 0), energy=330, size=1.6)
    key.data.color = (1, 0.9, 0.8)
    rim = parts.lamp(scene, "AREA", (3.4, 2.6, 2.4), (0, 0, 0.2), energy=420, size=0.9)
    rim.data.color = (0.75, 0.87, 1)
    parts.lamp(scene, "AREA", (4, -4, 0.2), (0, 0, 0), energy=45, size=3)
    parts.lamp(scene, "SPOT", (0, 1.5, -1), (0, 5, 0.5), energy=160, spot_size=1.6, spot_blend=1.0)
    parts.look(scene, (-1.7, -6.2, 0.25), (0.0, 0, -0.25), 27)


def fog(scene: Any) -> None:
    """A street at night: lanterns with cones of light in fog, a wet road, a glowing window, the moon."""
    parts.new_world(scene, (0.012, 0.018, 0.035))
    road = parts.plane(scene, 24)
    parts.wear(road, made.bumpy("Asphalt", (0.035, 0.037, 0.042), scale=60, strength=0.25, Roughness=0.28))
    glow = parts.one_shader("Lantern", "Emission", Color=(1, 0.7, 0.38, 1), Strength=30)
    iron = parts.principled("Iron", (0.03, 0.03, 0.035), Metallic=1, Roughness=0.45)
    for row in range(4):
        for side in (-1, 1):
            x, y = 2.1 * side, 1.0 + 3.6 * row
            post = made.lathe(
                scene, "Post", [(0.12, 0), (0.1, 0.25), (0.05, 0.35), (0.04, 2.6), (0.16, 2.62), (0, 2.75)]
            )
            post.location = (x, y, 0)
            parts.wear(post, iron)
            bulb = parts.sphere(scene, (x - 0.12 * side, y, 2.5), 0.09, rings=12)
            parts.wear(bulb, glow)
            light = parts.lamp(
                scene, "SPOT", (x - 0.12 * side, y, 2.36), (x - 0.6 * side, y - 0.4, 0), energy=2400, spot_size=1.5
            )
            light.data.color, light.data.shadow_soft_size, light.data.spot_blend = (1, 0.66, 0.32), 0.06, 0.5
    house = parts.box(scene, (-4.6, 8.5, 2), (1.6, 4, 2))
    parts.wear(house, made.bumpy("Plaster", (0.2, 0.17, 0.15), scale=12, strength=0.5, Roughness=0.9))
    pane = parts.polygons(
        scene, "Window", [(-2.99, 6.3, 1.5), (-2.99, 7.3, 1.5), (-2.99, 7.3, 2.7), (-2.99, 6.3, 2.7)], [(0, 1, 2, 3)]
    )
    parts.wear(pane, parts.one_shader("Glow", "Emission", Color=(1, 0.6, 0.25, 1), Strength=3))
    walker = made.lathe(
        scene,
        "Walker",
        [(0.16, 0), (0.2, 0.6), (0.24, 1.05), (0.12, 1.3), (0.07, 1.34), (0.12, 1.45), (0.1, 1.58), (0, 1.63)],
    )
    walker.location = (0.35, 5.2, 0)
    parts.wear(walker, parts.principled("Coat", (0.02, 0.02, 0.025), Roughness=0.8))
    air = parts.box(scene, (0, 9, 2.9), (9, 14, 3))
    air.name = "Air"
    parts.wear(air, made.medium("Fog", (0.9, 0.93, 1), density=0.045, anisotropy=0.35))
    moon = parts.lamp(scene, "SUN", (0, 0, 9), (-3, -4, 0), energy=0.35, angle=0.02)
    moon.data.color = (0.6, 0.75, 1)
    parts.look(scene, (0.5, -7.4, 1.5), (0, 5, 1.55), 32)


def wheel(scene: Any) -> None:
    """A spoked wheel that rolls past a fence: turning, moving, and blurred where the shutter is open."""
    parts.new_world(scene, (0.45, 0.6, 0.85))
    ground = parts.plane(scene, 14)
    parts.wear(ground, made.bumpy("Gravel", (0.34, 0.29, 0.22), scale=9, strength=0.6, Roughness=0.95))
    rubber = parts.principled("Rubber", (0.02, 0.02, 0.022), Roughness=0.6)
    chrome = parts.principled("Chrome", (0.85, 0.86, 0.88), Metallic=1, Roughness=0.12)
    red = parts.principled("Lacquer", (0.6, 0.03, 0.02), Roughness=0.35, Coat_Weight=1, Coat_Roughness=0.04)
    hub = bpy.data.objects.new("Wheel", None)
    scene.collection.objects.link(hub)
    for part, material in (
        (made.torus(scene, "Tyre", 1.0, 0.11), rubber),
        (made.torus(scene, "Rim", 0.88, 0.045), chrome),
        (made.torus(scene, "Hub", 0.12, 0.09), red),
    ):
        parts.wear(part, material)
        part.parent = hub
    for step in range(12):
        angle = math.tau * step / 12
        spoke = parts.box(scene, (0, 0, 0), (0.36, 0.02, 0.02))
        spoke.location = (0.5 * math.cos(angle), 0, 0.5 * math.sin(angle))
        spoke.rotation_euler.y = -angle
        parts.wear(spoke, red if step % 3 == 0 else chrome)
        spoke.parent = hub
    # It rolls: a turn of one radian per unit.
    scene.frame_set(10)
    for frame, x in ((9, -0.25), (11, 0.25)):
        hub.location, hub.rotation_euler = (x, 0, 1.11), (0, x / 1.11, 0)
        hub.keyframe_insert("location", frame=frame)
        hub.keyframe_insert("rotation_euler", frame=frame)
    made.linear(hub)
    wood = made.wood("Fence", (0.3, 0.2, 0.12), (0.45, 0.33, 0.2), scale=2.0)
    for number in range(9):
        slat = parts.box(scene, (0.72 * number - 2.9, 1.5, 0.7), (0.22, 0.04, 0.7))
        parts.wear(slat, wood)
    rail = parts.box(scene, (0, 1.58, 1.05), (3.4, 0.04, 0.09))
    parts.wear(rail, wood)
    parts.lamp(scene, "SUN", (0, 0, 5), (2, 3, 0), energy=3.2, angle=0.03)
    render = scene.render
    render.use_motion_blur, render.motion_blur_shutter = True, 0.7
    scene.halfspace.motion_steps = 16
    parts.look(scene, (-1.2, -5.6, 1.5), (0, 0, 0.95), 30)


def grove(scene: Any) -> None:
    """A forest against a low sun: translucent leaves, instanced, over ferns, stones and a mossy floor."""
    parts.new_world(scene, (0.75, 0.9, 1.0))
    floor = parts.plane(scene, 40)
    parts.wear(floor, made.bumpy("Moss", (0.06, 0.085, 0.025), scale=6, strength=0.8, Roughness=1.0))
    bark = made.bumpy("Bark", (0.12, 0.08, 0.055), scale=25, strength=0.9, Roughness=0.95)
    rng = np.random.default_rng(4)
    green, yellow = plants.leaf((0.16, 0.32, 0.04)), plants.leaf((0.3, 0.34, 0.05))
    trees = [plants.tree(bark, leaves, rng) for leaves in (green, yellow, green)]
    saplings = [plants.sapling(bark, leaves, rng) for leaves in (green, yellow)]
    ferns = [plants.fern(bark, plants.leaf((0.1, 0.26, 0.04)), rng) for _ in range(2)]
    near = [(-1.75, 1.2, 1.0), (1.95, 2.2, 1.1), (-3.4, 4.2, 1.0), (0.6, 5.6, 1.0), (3.6, 6.0, 1.1), (-1.3, 8.2, 1.1)]
    # Farther trees stand in rows that are shaken.
    far = [
        (3.1 * column + rng.uniform(-0.9, 0.9), 10.5 + 3.5 * row + rng.uniform(-1, 1), rng.uniform(0.9, 1.3))
        for row in range(3)
        for column in range(-4 - row, 5 + row)
    ]
    plants.plant_all(scene, "Tree", trees, near + far, rng)
    young = [(-0.75, 3.2, 0.7), (1.2, 0.9, 0.45), (-2.7, 2.6, 0.8), (2.9, 3.6, 0.75), (-0.2, 7.0, 0.9)]
    plants.plant_all(scene, "Sapling", saplings, young, rng)
    scattered = [(rng.uniform(-4.5, 4.5), -1.6 + 11 * (k / 60) ** 1.3, rng.uniform(0.7, 1.25)) for k in range(60)]
    plants.plant_all(scene, "Fern", ferns, scattered, rng)
    for x, y, radius in ((-0.55, -0.7, 0.28), (0.75, 0.1, 0.4), (2.2, -0.3, 0.22)):
        stone = parts.sphere(scene, (x, y, 0.35 * radius), radius, rings=20)
        stone.scale = (1.2, 0.9, 0.7)
        parts.wear(stone, made.bumpy("Stone", (0.3, 0.29, 0.27), scale=5, strength=0.7, Roughness=0.85))
    sun = parts.lamp(scene, "SUN", (3.5, 12, 5.5), (0, 0, 0.5), energy=24, angle=0.03)
    sun.data.color = (1, 0.8, 0.52)
    parts.look(scene, (0.1, -5.0, 1.25), (0, 2.0, 1.5), 38)


def product(scene: Any) -> None:
    """A studio table: a lacquered bottle with a brushed cap, a bubble-thin lens and a steel ring between softboxes."""
    parts.new_world(scene, (0.05, 0.05, 0.055))
    sweep = made.backdrop(scene)
    parts.wear(sweep, parts.principled("Paper", (0.55, 0.54, 0.52), Roughness=0.7))
    lacquer = parts.principled(
        "Lacquer", (0.32, 0.015, 0.03), Metallic=0.35, Roughness=0.42, Coat_Weight=1, Coat_Roughness=0.02
    )
    bottle = made.lathe(
        scene,
        "Bottle",
        [(0, 0), (0.5, 0), (0.56, 0.05), (0.56, 1.15), (0.46, 1.35), (0.24, 1.45), (0.22, 1.55), (0, 1.56)],
    )
    bottle.location = (-0.35, 0.2, 0)
    parts.wear(bottle, lacquer)
    cap = made.lathe(scene, "Cap", [(0, 0), (0.27, 0), (0.28, 0.02), (0.28, 0.5), (0.26, 0.53), (0, 0.53)])
    cap.location = (-0.35, 0.2, 1.5)
    parts.wear(cap, made.brushed("Brushed", (0.86, 0.72, 0.5), roughness=0.32, anisotropy=0.75))
    film = parts.principled("Film", (1, 1, 1), Roughness=0.04, Thin_Film_Thickness=420, Thin_Film_IOR=1.33)
    shader = parts.principled_node(film)
    shader.inputs["Base Color"].default_value = (0.02, 0.02, 0.025, 1)
    parts.wear(parts.sphere(scene, (0.72, -0.25, 0.36), 0.36), film)
    ring = made.torus(scene, "Ring", 0.36, 0.07)
    ring.location, ring.rotation_euler = (-1.2, -0.55, 0.07), (math.pi / 2, 0, 0)
    parts.wear(ring, made.brushed("Satin", (0.8, 0.82, 0.85), roughness=0.3, anisotropy=0.6))
    pearl = parts.principled("Velvet", (0.1, 0.12, 0.3), Roughness=0.8, Sheen_Weight=0.8, Sheen_Roughness=0.3)
    parts.wear(parts.sphere(scene, (1.45, 0.5, 0.26), 0.26), pearl)
    for place, energy, size in (((-3.4, -1.2, 2.6), 190, 1.6), ((3.2, -0.6, 2.2), 120, 1.3), ((0, 1.0, 4.2), 90, 2.2)):
        lamp = parts.lamp(scene, "AREA", place, (0, 0.1, 0.7), energy=energy, size=size)
        lamp.data.shape, lamp.data.size_y = "RECTANGLE", 0.5 * size
    parts.look(scene, (0.15, -5.6, 1.7), (0.05, 0.1, 0.82), 28)


SCENES: dict[str, Callable[[Any], None]] = {
    "kitchen": kitchen,
    "portrait": portrait,
    "fog": fog,
    "wheel": wheel,
    "grove": grove,
    "product": product,
}
