# SPDX-License-Identifier: GPL-3.0-or-later
"""Baking: pictures whose pixels lie on the triangles of an object, as Blender's operator requests them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...core.base import native
from ...core.base.notes import Notes
from ...core.scene.scene import Camera, Scene
from ...core.session.session import Session, watch
from ...core.structures.settings import RenderSettings, memory_limit
from ..read import camera, extract
from ..settings import properties, quality
from . import running
from .result import to_world

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ...core.base.arrays import F32

POLL_MILLISECONDS = 50
"""Interval of the checks whether the bake is still wanted."""

NO_TRIANGLE = np.uint32(0xFFFFFFFF)
"""The triangle of a pixel without one."""

FILTERS = {"EMIT": 2, "DIFFUSE": 4, "GLOSSY": 8, "TRANSMISSION": 16, "DIRECT": 64, "INDIRECT": 128, "COLOR": 256}
"""The bits of what a bake contains."""

DATA = {
    "NORMAL": "Normal",
    "UV": "UV",
    "POSITION": "Position",
    "ROUGHNESS": "Roughness",
    "EMIT": "Emission",
    "ENVIRONMENT": "Environment",
    "AO": "Combined",
}
"""Bakes that show one pass, with its native name."""

LIT = {"DIFFUSE": "Diffuse", "GLOSSY": "Glossy", "TRANSMISSION": "Transmission"}
"""Bakes of the light of one kind of lobes, with the native name of the kind."""

LAMP_LIGHT = "Diffuse Direct"
"""The pass that the bake of shadows divides by itself without shadows."""


@dataclass(frozen=True)
class Target:
    """The pixels of an image that belong to an object. primitives, places: see the native `render`; the triangles are
    those of the object.
    """

    primitives: np.ndarray[Any, Any]
    places: F32

    @classmethod
    def read(cls, layer: Any) -> Target:
        """The pixels that Blender wants, from the layer of an open result."""
        primitive, change = (_pixels(layer, name) for name in ("BakePrimitive", "BakeDifferential"))
        # Blender passes integers in the bits of the numbers; pixels without a triangle hold anything else.
        numbers = np.ascontiguousarray(primitive[:, 2]).view(np.int32)
        used = numbers >= 0
        primitive, change = (np.where(used[:, None], one, 0) for one in (primitive, change))
        u, v = primitive[:, 0], primitive[:, 1]
        right, up = change[:, (0, 2)], change[:, (1, 3)]
        # Blender's weights are those of the first and second corner.
        weights = [column for a, b in ((u, v), right.T, up.T) for column in (b, -a - b)]
        weights[1] = 1 - u - v
        return cls(np.where(used, numbers, -1), np.stack(weights, axis=1))


class Bake:
    """One call of `bake`, with its open result. It leaves no structure or report behind."""

    def __init__(
        self, engine: Any, depsgraph: Any, item: Any, wanted: str, contents: int, size: tuple[int, int]
    ) -> None:
        """item: the object on whose surface the pixels lie. wanted: COMBINED, or another of Blender's types of bakes.
        contents: the bits of FILTERS.
        """
        self.engine = engine
        self.depsgraph = depsgraph
        self.item = item
        self.wanted = wanted
        self.contents = {name for name, bit in FILTERS.items() if contents & bit}
        self.size = size
        self.notes = Notes()
        self.result: Any = None

    def render(self) -> None:
        """Extract, build, render. Raises Cancelled, and the exceptions of extraction and of the native module."""
        self.result = self.engine.begin_result(0, 0, *self.size, layer=self.depsgraph.view_layer.name)
        layer = self.result.layers[0]
        target = Target.read(layer)
        if (target.primitives >= 0).any():
            self._write(layer, self._colours(target))
        self.engine.end_result(self.result)
        self.result = None
        for line in self.notes.lines():
            self.engine.report({"WARNING"}, line)

    def discard(self) -> None:
        """Close an open result without keeping its pixels."""
        if self.result is not None:
            self.engine.end_result(self.result, cancel=True)
            self.result = None

    def _colours(self, target: Target) -> F32:
        """The baked pixels, (n, 1) or (n, 3)."""
        found = extract.find(self.depsgraph, self.notes, uvs=self.wanted == "UV", keep_going=self._keep_going)
        scene = found.flattened(uvs=self.wanted == "UV")
        first, count, mirrored = self._triangles(found)
        inside = (target.primitives >= 0) & (target.primitives < count)
        # The triangles of mirrored objects have their second and third corner swapped.
        order = [1, 0, 3, 2, 5, 4] if mirrored else slice(None)
        points = {
            "triangle": np.where(inside, first + target.primitives, NO_TRIANGLE).astype(np.uint32),
            "place": np.ascontiguousarray(target.places[:, order]),
            "seen": self._seen(),
            "origin": [float(x) for x in -scene.geometry.origin],
        }
        names = self._passes()
        images = self._images(scene, points, names)
        if self.wanted == "SHADOW":
            # The same light without shadows, on the same structure.
            lights = tuple(replace(light, casts_shadow=False) for light in scene.lights)
            open_light = self._images(replace(scene, lights=lights), points, names)[LAMP_LIGHT]
            shaded = images[LAMP_LIGHT]
            share = np.divide(shaded, open_light, out=np.ones_like(shaded), where=open_light > 0)
            return np.minimum(share, 1)  # both are noisy
        return self._composed(images)

    def _composed(self, images: Mapping[str, F32]) -> F32:
        """The bake from its passes."""
        if self.wanted in DATA:
            return images[DATA[self.wanted]]
        if set(images) == {"Combined"}:
            return images["Combined"]
        kinds = [LIT[self.wanted]] if self.wanted in LIT else [LIT[name] for name in LIT if name in self.contents]
        parts = [part for part in ("Direct", "Indirect") if part.upper() in self.contents]
        total = np.zeros_like(next(iter(images.values())))
        for kind in kinds:
            light = sum((images[f"{kind} {part}"] for part in parts), np.zeros_like(total))
            color = images.get(f"{kind} Color", np.ones_like(total))
            total += light * color if parts else color
        return total + images.get("Emission", np.zeros_like(total))

    def _passes(self) -> tuple[str, ...]:
        """The native passes that the bake is made of."""
        if self.wanted == "SHADOW":
            return (LAMP_LIGHT,)
        if self.wanted in DATA:
            return (DATA[self.wanted],)
        parts = [part for part in ("Direct", "Indirect") if part.upper() in self.contents]
        if self.wanted in LIT:
            kinds, color = [LIT[self.wanted]], "COLOR" in self.contents or not parts
        else:
            if self.contents | {"COLOR"} == set(FILTERS):
                return ("Combined",)
            kinds, color = [LIT[name] for name in LIT if name in self.contents], True
        names = [f"{kind} {part}" for kind in kinds for part in parts]
        names += [f"{kind} Color" for kind in kinds if color and (parts or self.wanted in LIT)]
        if self.wanted == "COMBINED" and "EMIT" in self.contents:
            names.append("Emission")
        return tuple(names) or ("Emission",)

    def _images(self, scene: Scene, points: Mapping[str, Any], names: tuple[str, ...]) -> dict[str, F32]:
        """The passes, (n, channels) each by its native name."""
        group = self.depsgraph.scene_eval.halfspace
        width, height = self.size
        shared = quality.settings(self.depsgraph.scene_eval)
        shared |= {"film_transparent": False, "integrator": "path"}
        if self.wanted == "AO":
            shared |= {"exposure": 1.0, "integrator": "ao"}
        settings = RenderSettings(width, height, samples=group.samples, passes=names, **shared)
        session = Session.start(
            native.load(),
            scene,
            properties.spec(group),
            threads=settings.threads,
            memory_limit=memory_limit(group.memory_limit),
            keep_going=lambda _: self._keep_going(),
        )
        job = session.render(self._camera(scene), settings, points=points)
        watch(job, milliseconds=POLL_MILLISECONDS, keep_going=self._progress, show=lambda: None)
        found = {}
        for name, channels in job.passes.items():
            flat = np.empty(width * height * channels, np.float32)
            job.copy_into(name, flat)
            if name == "Position":
                to_world(flat, scene.geometry.origin)
            found[name] = flat.reshape(-1, channels)[:, :3]
        return found

    def _triangles(self, found: extract.Found) -> tuple[int, int, bool]:
        """The first triangle of the object in the flattened scene, their number, and whether it is mirrored. Raises
        RuntimeError.
        """
        wanted, first = np.array(self.item.matrix_world, np.float64), 0
        places = []
        for placement in found.placements:
            count = len(placement.mesh.triangles)
            for name, matrix in zip(placement.names, placement.matrices, strict=True):
                if name == self.item.name_full:
                    places.append((float(np.abs(matrix - wanted).max()), first, count))
                first += count
        if not places:
            raise RuntimeError(f"Cannot bake {self.item.name}: it has no surface in renders")
        # Instances of the object have its name, too, but lie elsewhere.
        _, first, count = min(places)
        return first, count, bool(np.linalg.det(wanted[:3, :3]) < 0)

    def _camera(self, scene: Scene) -> Camera:
        """The active camera; without one, any."""
        item = self.depsgraph.scene_eval.camera
        if item is not None:
            origin = scene.geometry.origin
            return camera.read_camera(item, self.depsgraph, item.matrix_world, origin, self.notes, size=self.size)
        return Camera("perspective", np.eye(4), (-1.0, 1.0, -1.0, 1.0), 0.1, 1000.0)

    def _seen(self) -> str:
        """From where the surface is seen."""
        if self.wanted == "ENVIRONMENT":
            return "background"
        return "camera" if self.depsgraph.scene_eval.render.bake.view_from == "ACTIVE_CAMERA" else "above"

    def _write(self, layer: Any, colours: F32) -> None:
        """Write the baked pixels to the result. Numbers become grey."""
        combined = layer.passes["Combined"]
        pixels = np.ones((len(colours), combined.channels), np.float32)
        shown = min(combined.channels, 3)
        pixels[:, :shown] = colours if colours.shape[1] == 1 else colours[:, :shown]
        combined.rect.foreach_set(pixels.reshape(-1))

    def _keep_going(self) -> bool:
        return not running.closing() and not self.engine.test_break()

    def _progress(self, progress: float) -> bool:
        self.engine.update_progress(progress)
        return self._keep_going()


def _pixels(layer: Any, name: str) -> F32:
    """The numbers of a pass, (n, channels)."""
    found = layer.passes[name]
    flat = np.empty(len(found.rect) * found.channels, np.float32)
    found.rect.foreach_get(flat)
    return flat.reshape(-1, found.channels)
