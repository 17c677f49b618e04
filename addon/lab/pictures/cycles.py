# SPDX-License-Identifier: GPL-3.0-or-later
"""Cycles as the other renderer whose pictures a benchmark measures next to those of the structures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import bpy
from mathutils import Matrix

from ...blender.measure import pictures
from ...blender.samples import arrays
from ...core.measure.curve import plain_scene
from ...core.measure.timing import clock
from . import engines
from . import proving_parts as parts

if TYPE_CHECKING:
    from ...core.base.arrays import F32
    from ...core.scene.workload import Workload


@dataclass
class Cycles:
    """Cycles on the open scene, or on a geometry without materials, `plain`, with those of `curve.plain_scene`."""

    plain: Workload | None = None
    name: str = "Cycles"

    def render(
        self,
        size: tuple[int, int],
        samples: int,
        seed: int,
        max_bounces: int,
        limits: Mapping[str, float],
        threads: int,
    ) -> tuple[F32, float]:
        """See `core.scene.workload.Peer`. Raises RuntimeError."""
        if self.plain is not None:
            _build(self.plain)
            self.plain = None
        scene: Any = bpy.context.scene
        engines.configure_cycles(scene, samples, max_bounces)
        scene.cycles.seed = seed
        scene.cycles.sample_clamp_direct, scene.cycles.sample_clamp_indirect = (
            limits["clamp_direct"],
            limits["clamp_indirect"],
        )
        # Set the picture as the structures' pictures are.
        render = scene.render
        render.engine, render.resolution_percentage = "CYCLES", 100
        render.resolution_x, render.resolution_y = size
        render.use_border, render.film_transparent, render.use_compositing = False, False, False
        render.threads_mode, render.threads = "FIXED", threads
        now = clock(threads)
        start = now()
        picture = pictures.render(scene)
        return picture[..., :3], now() - start


def _build(workload: Workload) -> None:
    """Open a new file with a geometry and the surface, sun and sky of `curve.plain_scene`."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene: Any = bpy.context.scene
    plain = plain_scene()
    surface = parts.one_shader("Matt", "BsdfDiffuse", Color=(*plain["materials"][0]["base_color"], 1))
    arrays.add(scene, workload).data.materials[0] = surface
    parts.new_world(scene, plain["world"]["color"])
    sun = plain["lights"][0]
    light = bpy.data.lights.new("Sun", "SUN")
    light.energy, light.angle = sun["power"][0], sun["angle"]
    item = bpy.data.objects.new("Sun", light)
    item.matrix_world = Matrix(sun["to_world"].tolist())
    scene.collection.objects.link(item)
