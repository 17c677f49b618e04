# SPDX-License-Identifier: GPL-3.0-or-later
"""Halfspace's native core: rendering."""

from collections.abc import Mapping, Sequence
from typing import Any, Literal, TypedDict

import numpy as np
import numpy.typing as npt

class Structure: ...

class RenderStatistics(TypedDict):
    """Numbers of a render so far; final once it has finished.

    seconds: wall clock. rays_primary: camera rays; rays_shadow: rays to lights, those continued
    through transparent surfaces counted again; rays_secondary: rays after a bounce or through a
    transparent surface. mrays_s: all rays per second, in millions. steps, tests: inner nodes
    visited and triangles tested by camera rays; None unless "Traversal Steps" or "Triangle Tests"
    is among the passes, because an uncounted traversal is faster.
    """

    seconds: float
    rays_primary: int
    rays_shadow: int
    rays_secondary: int
    mrays_s: float
    steps: int | None
    tests: int | None

class RenderScene:
    """A structure with materials, lights and world: everything but the camera.

    All lengths and positions are in the structure's frame, all colours linear RGB. Unknown keys
    are refused, so that a misspelt one is not silently ignored.

    structure: what rays ask; shared, not copied.
    material_index: (m,) int32, the material of each of the structure's m triangles, dropped ones
        included; None = all use the first.
    materials: dictionaries, all keys optional, the defaults being Blender's Principled BSDF:
        "name" (for messages), "base_color" (3,), "metallic" 0..1, "roughness" 0..1, "ior" > 0,
        "transmission" 0..1, "specular" (0.5 = as the ior says, 0 = no coat), "emission" (3,)
        radiance on both sides, "alpha" (0 = invisible). An empty list is one default material.
    corner_normals: (m, 3, 3) float32, shading normals of each triangle's corners, any length;
        None = flat.
    lights: dictionaries with "kind" ("point", "sun", "spot", "area"), "to_world" (4, 4), "power"
        (3,), and, as the kind needs, "radius", "angle", "spot_size", "spot_blend", "shape"
        ("SQUARE", "RECTANGLE", "DISK", "ELLIPSE"), "size", "size_y"; "casts_shadow" (True).
        A light shines along its -Z. Angles are full angles in radians. Brightness is that of
        Cycles: power P gives a point or spot light the radiant intensity P / 4π W/sr, an area
        light the radiance P / (π area) on one side, a sun the irradiance P in W/m². A light with a
        size is seen by every scattered ray, never by the camera. Lights without power are left out.
    world: {"color": (3,)}, radiance of the background; None = black.

    Raises ShapeError (array of the wrong shape or type, index out of range), NonFiniteError,
    SpecError (a number out of range, a missing or unknown key); each names the key and its index.
    Releases the GIL while it compiles the scene.
    """

    def __init__(
        self,
        structure: Structure,
        *,
        material_index: npt.NDArray[np.int32] | None = None,
        materials: Sequence[Mapping[str, Any]] | None = None,
        corner_normals: npt.NDArray[np.float32] | None = None,
        lights: Sequence[Mapping[str, Any]] | None = None,
        world: Mapping[str, Any] | None = None,
    ) -> None: ...
    @property
    def left_out(self) -> list[str]:
        """What this scene does not need and its paths therefore do not contain, each with its
        reason, such as "shadow rays: no lights"."""

class RenderJob:
    """A render on threads of its own, or its result.

    Deleting it cancels the render and waits for its threads. All methods may be called from any
    Python thread.
    """

    def wait(self, milliseconds: int) -> bool:
        """Waits until the render has ended or the time is over; True when it has ended, be it
        done, failed or cancelled. Releases the GIL. SpecError for a negative time."""

    def cancel(self) -> None:
        """Asks the render to stop and returns at once; it stops within 0.1 s. What was finished
        stays readable."""

    @property
    def progress(self) -> float:
        """Share of all pixel samples that are done, 0..1."""

    @property
    def finished(self) -> bool:
        """Whether the render has ended: done, failed or cancelled."""

    @property
    def cancelled(self) -> bool:
        """Whether it ended early because it was cancelled. False while it is still stopping."""

    @property
    def samples_done(self) -> int:
        """Samples that every pixel has."""

    @property
    def error(self) -> str | None:
        """What went wrong, None if nothing did."""

    @property
    def passes(self) -> dict[str, int]:
        """The passes that are filled, and their numbers of channels."""

    @property
    def statistics(self) -> RenderStatistics:
        """Numbers so far."""

    def copy_into(self, name: str, out: npt.NDArray[np.float32]) -> None:
        """Writes a pass as it is now: rows from the bottom up, channels innermost.

        out: float32, one-dimensional, C-contiguous, width * height * channels elements, where
            width and height are those of the border. Pixels without a sample yet are zero.
        "Combined" is the mean so far, premultiplied RGBA, scene linear. "Depth" (along the view
        axis, 1e10 = nothing seen) and "Position" are those of the first sample, because a mean
        across an edge is a place where nothing is; "Normal" is a mean, not renormalised.
        "Traversal Steps" and "Triangle Tests" are means per camera ray.

        Raises SpecError (unknown pass, or one that was not asked for), ShapeError (type, size,
        contiguity or a read-only array). Releases the GIL.
        """

def render(
    scene: RenderScene,
    camera: Mapping[str, Any],
    settings: Mapping[str, Any],
    *,
    threads: int = 0,
) -> RenderJob:
    """Starts a render and returns at once.

    camera: "kind" ("perspective", "orthographic"), "to_world" (4, 4) (the camera looks along its
        -Z, +Y is up; scale is ignored), "window" (left, right, bottom, top) of the full frame at
        distance 1 (perspective) or in scene units (orthographic), "clip_start" and "clip_end" as
        depths along -Z.
    settings: "width" and "height" of the full frame in pixels; "border" (x0, y0, x1, y1) in pixels
        from the lower left, half open, or None; "samples" per pixel: cost in proportion;
        "max_bounces" (4): 0 = direct light only, as in Cycles; "seed" (0); "film_transparent"
        (False); "passes" (["Combined"]), names as in RenderJob.passes; "step_samples" (None):
        samples between two updates of a tile, None = 1, 1, 2, 4, then 8 at a time; "filter"
        ("blackman_harris", or "box") and "filter_width" (1.5), as in Cycles.
    threads: 0 = one per core.

    The image depends on scene, camera and settings alone, bit for bit: not on the structure, not
    on the number of threads, not on step_samples; and a border shows the same pixels as the full
    frame.

    Raises SpecError, ShapeError or NonFiniteError naming the key. An error while rendering does
    not raise: see RenderJob.error.
    """
