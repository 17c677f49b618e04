# SPDX-License-Identifier: GPL-3.0-or-later
"""Program that renders a Sky Texture to pixels with Cycles, the only implementation of its models.

Run by `sky.py` in another Blender process without this extension: the argument after `--`, or the only one, is a folder
with `node.json`, the node's settings. Writes `sky.npz`: `sky`, (height, width, 3) float32 radiance of all directions
without the sun's disc, rows from the bottom, as an equirectangular picture; `sun`, (3,) the irradiance of the disc on a
surface that faces it, black without one; `direction`, (3,) towards it; `angle`, its diameter.
"""

from __future__ import annotations

import json
import math
import sys
import time
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Euler, Vector

WIDTH = 1024
"""Pixels around the horizon."""

DISC = 192
"""Pixels across the picture of the disc, which is three times as wide as the disc."""


def main(folder: Path) -> None:
    """Read the settings, render, write."""
    # Render all directions without the disc, as an equirectangular picture.
    settings: dict[str, Any] = json.loads((folder / "node.json").read_text())
    scene, node = _prepare(settings)
    disc = bool(settings.get("sun_disc", False))
    if hasattr(node, "sun_disc"):
        node.sun_disc = False
    camera = scene.camera
    camera.data.type = "PANO"
    # Blender 5.0 moved the setting from Cycles to the camera.
    owner = camera.data if hasattr(camera.data, "panorama_type") else camera.data.cycles
    owner.panorama_type = "EQUIRECTANGULAR"
    camera.rotation_euler = Euler((math.pi / 2, 0, -math.pi / 2))
    sky = _render(scene, folder, WIDTH, WIDTH // 2)

    sun, angle = np.zeros(3), float(settings.get("sun_size", 0.0))
    elevation, turn = float(settings.get("sun_elevation", 0.0)), float(settings.get("sun_rotation", 0.0))
    direction = Vector(
        (math.cos(elevation) * math.sin(turn), math.cos(elevation) * math.cos(turn), math.sin(elevation))
    )
    # Integrate the disc as the difference of two pictures, with and without it.
    if disc and angle > 0:
        camera.data.type, camera.data.sensor_fit = "PERSP", "HORIZONTAL"
        camera.data.angle = 3 * angle
        camera.rotation_euler = direction.to_track_quat("-Z", "Y").to_euler()
        # Sample the whole pixel: with one sample the jagged rim would change the disc's power too much.
        scene.cycles.samples, scene.cycles.filter_width = 16, 1.0
        without = _render(scene, folder, DISC, DISC)
        node.sun_disc = True
        shown = _render(scene, folder, DISC, DISC)
        half = math.tan(camera.data.angle / 2)  # the lens clamps the angle
        at = (np.arange(DISC) + 0.5) / DISC * 2 - 1
        x, y = np.meshgrid(at * half, at * half)
        solid = (2 * half / DISC) ** 2 * (1 + x * x + y * y) ** -1.5
        sun = ((shown - without) * solid[..., None]).sum(axis=(0, 1), dtype=np.float64)
    np.savez(folder / "sky.npz", sky=sky, sun=np.maximum(sun, 0), direction=np.array(direction), angle=angle)


def _prepare(settings: dict[str, Any]) -> tuple[Any, Any]:
    """An empty scene whose world is the sky."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene: Any = bpy.context.scene
    if not hasattr(scene, "cycles"):
        import addon_utils

        addon_utils.enable("cycles")
    # Make the world: the node with its settings, as background.
    world: Any = bpy.data.worlds.new("Sky")
    world.use_nodes = True
    tree = world.node_tree
    node = tree.nodes.new("ShaderNodeTexSky")
    for name, value in settings.items():
        setattr(node, name, value)
    tree.links.new(node.outputs[0], next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBackground").inputs[0])
    scene.world = world
    # Make a camera, and set up Cycles for one noise-free sample per pixel.
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    render, cycles = scene.render, scene.cycles
    render.engine, cycles.device, cycles.samples = "CYCLES", "CPU", 1
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    cycles.pixel_filter_type, render.use_compositing, render.use_sequencer = "BOX", False, False
    cycles.sample_clamp_direct, cycles.filter_width = 0.0, 0.01
    render.resolution_percentage, render.image_settings.file_format = 100, "OPEN_EXR"
    render.image_settings.color_mode, render.image_settings.color_depth = "RGBA", "32"
    return scene, node


def _render(scene: Any, folder: Path, width: int, height: int) -> Any:
    """(height, width, 3) float32, scene linear, rows from the bottom."""
    render = scene.render
    render.resolution_x, render.resolution_y = width, height
    render.filepath = str(folder / "picture.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(render.filepath)
    pixels = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return np.nan_to_num(pixels.reshape(height, width, -1)[..., :3])


if __name__ == "__main__":
    begun = time.perf_counter()
    main(Path(sys.argv[-1]))
    print(f"sky rendered in {time.perf_counter() - begun:.2f} s", flush=True)
