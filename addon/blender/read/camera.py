# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of Blender's cameras to `core.scene.Camera`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ...core.base.arrays import F64
from ...core.base.notes import Notes
from ...core.scene.scene import Camera

HIGHEST = 1e9
"""Largest height on a cylinder of radius 1 around a camera; beyond, all directions are vertical."""

COEFFICIENTS = (
    "fisheye_polynomial_k0",
    "fisheye_polynomial_k1",
    "fisheye_polynomial_k2",
    "fisheye_polynomial_k3",
    "fisheye_polynomial_k4",
)
"""Coefficients of the lens polynomial, the constant one first."""

FARTHEST = 1e30
"""Replaces infinite settings of a panorama."""


def read_camera(
    item: Any,
    depsgraph: Any,
    matrix_world: Any,
    origin: F64,
    notes: Notes,
    *,
    size: tuple[int, int],
    pixel_aspect: tuple[float, float] = (1.0, 1.0),
) -> Camera:
    """An evaluated camera object, for a frame of `size` pixels.

    matrix_world: the camera's transform without scale; origin: (3,) float64, world position of the scene frame's
    origin. Shift, sensor fit and pixel aspect come from Blender's own projection matrix. Unsupported kinds of camera
    are noted in `notes` and become a perspective one with the same lens.
    """
    if item.type != "CAMERA":
        notes.add("Not a camera, rendered with a default lens", item.name)
    panorama = _panorama(item, size, pixel_aspect, notes)
    projection = np.array(
        item.calc_matrix_camera(depsgraph, x=size[0], y=size[1], scale_x=pixel_aspect[0], scale_y=pixel_aspect[1]),
        np.float64,
    )
    # Remove the scale, which Blender ignores in cameras.
    to_world = np.array(matrix_world, np.float64, order="C")
    to_world[:3, :3] /= np.linalg.norm(to_world[:3, :3], axis=0)
    to_world[:3, 3] -= origin
    data = item.data if item.type == "CAMERA" else None
    if panorama is not None:
        kind, keys = panorama
        # A file may hold any number; such a lens shows little or nothing.
        keys = {key: np.nan_to_num(value, posinf=FARTHEST, neginf=-FARTHEST).tolist() for key, value in keys.items()}
        clip = data.clip_start, data.clip_end
        return Camera(kind, to_world, (0.0, 1.0, 0.0, 1.0), *clip, panorama=keys, **lens(item, parallel=False))
    parallel = bool(projection[3, 3] == 1.0)
    return Camera(
        kind="orthographic" if parallel else "perspective",
        to_world=to_world,
        window=window(projection),
        clip_start=data.clip_start if data else 0.1,
        clip_end=data.clip_end if data else 1000.0,
        **lens(item, parallel=parallel),
    )


def shifted(view: Camera, data: Any, shift_x: float) -> Camera:
    """The camera of one eye. data: the settings of the camera between the eyes; shift_x: in its place for this eye."""
    if view.kind not in ("perspective", "orthographic"):
        return view
    # A shift of 1 is the longer side of the picture, or the one that the sensor fits.
    left, right, bottom, top = view.window
    wide = data.sensor_fit == "HORIZONTAL" or (data.sensor_fit == "AUTO" and right - left >= top - bottom)
    apart = (shift_x - data.shift_x) * (right - left if wide else top - bottom)
    return replace(view, window=(left + apart, right + apart, bottom, top))


def of_view(item: Any, scene: Any, view: str) -> Any:
    """The camera object of a view: with *Multi-View* the one of the same name with that view's suffix."""
    render = scene.render
    if not (render.use_multiview and render.views_format == "MULTIVIEW" and view in render.views):
        return item
    wanted = render.views[view].camera_suffix
    for suffix in (one.camera_suffix for one in render.views):
        if suffix and item.name.endswith(suffix):
            return scene.objects.get(item.name.removesuffix(suffix) + wanted, item)
    return item


def seen_by(item: Any, depsgraph: Any) -> Camera:
    """An evaluated camera object in world space, for a final picture of the scene."""
    render = depsgraph.scene_eval.render
    share = render.resolution_percentage / 100
    size = max(int(render.resolution_x * share), 1), max(int(render.resolution_y * share), 1)
    aspect = render.pixel_aspect_x, render.pixel_aspect_y
    matrix = item.matrix_world.normalized()
    return read_camera(item, depsgraph, matrix, np.zeros(3), Notes(), size=size, pixel_aspect=aspect)


def _panorama(
    item: Any, size: tuple[int, int], pixel_aspect: tuple[float, float], notes: Notes
) -> tuple[str, dict[str, Any]] | None:
    """The kind of a panoramic camera and its keys; None for other cameras, and for panoramas that are not supported."""
    if item.type != "CAMERA" or item.data.type in ("PERSP", "ORTHO"):
        return None
    data = item.data
    kind = data.panorama_type if data.type == "PANO" else ""
    width, height = size[0] * pixel_aspect[0], size[1] * pixel_aspect[1]
    # The sensor's other side follows from that of the picture, as in Cycles.
    wide = data.sensor_fit == "HORIZONTAL" or (data.sensor_fit == "AUTO" and width >= height)
    length = data.sensor_height if data.sensor_fit == "VERTICAL" else data.sensor_width
    sensor = (length, length * height / width) if wide else (length * width / height, length)
    match kind:
        case "EQUIRECTANGULAR":
            longitude = (data.longitude_min, data.longitude_max)
            return "equirectangular", {"longitude": longitude, "latitude": (data.latitude_min, data.latitude_max)}
        case "FISHEYE_EQUIDISTANT":
            return "equidistant", {"fov": data.fisheye_fov}
        case "FISHEYE_EQUISOLID":
            return "equisolid", {"fov": data.fisheye_fov, "focal": data.fisheye_lens, "sensor": sensor}
        case "FISHEYE_LENS_POLYNOMIAL":
            terms = tuple(getattr(data, name) for name in COEFFICIENTS)
            return "polynomial", {"fov": data.fisheye_fov, "polynomial": terms, "sensor": sensor}
        case "MIRRORBALL":
            return "mirror_ball", {}
        case "CENTRAL_CYLINDRICAL":
            longitude = (data.central_cylindrical_range_u_min, data.central_cylindrical_range_u_max)
            height = (data.central_cylindrical_range_v_min, data.central_cylindrical_range_v_max)
            radius = data.central_cylindrical_radius
            limited = tuple(min(max(z / radius, -HIGHEST), HIGHEST) for z in height)
            return "central_cylindrical", {"longitude": longitude, "height": limited}
        case "EQUIANGULAR_CUBEMAP_FACE":
            return "cube_face", {}
    name = (kind or data.type).replace("_", " ").lower()
    notes.add(f"Cameras of the kind {name} are not supported yet, rendered as perspective", item.name)
    return None


def lens(item: Any, *, parallel: bool) -> dict[str, Any]:
    """The depth-of-field fields of `core.scene.Camera`; empty without depth of field.

    Lengths as in Blender's own engines: the lens is in millimetres of scene units, whatever the scene's units.
    """
    data = item.data if item.type == "CAMERA" else None
    if data is None or not data.dof.use_dof:
        return {}
    dof = data.dof
    stop = 2.0 * max(dof.aperture_fstop, 1e-5)
    return {
        "aperture_radius": (1.0 if parallel else data.lens * 1e-3) / stop,
        "aperture_blades": dof.aperture_blades,
        "aperture_rotation": dof.aperture_rotation,
        "aperture_ratio": max(dof.aperture_ratio, 1e-5),
        "focus_distance": max(_focus(item), 0.0),
    }


def _focus(item: Any) -> float:
    """Distance of the focal plane along the view: the depth of the focus object, if there is one."""
    dof = item.data.dof
    if dof.focus_object is None:
        return float(dof.focus_distance)
    place = dof.focus_object.matrix_world
    if dof.focus_subtarget and dof.focus_object.pose is not None:
        bone = dof.focus_object.pose.bones.get(dof.focus_subtarget)
        place = place if bone is None else place @ bone.matrix
    towards = item.matrix_world.normalized().inverted() @ place.translation
    return abs(float(towards.z))


def window(projection: F64) -> tuple[float, float, float, float]:
    """Left, right, bottom and top of a projection matrix's window: at distance 1, or in scene units if parallel.

    Solves projection · (x, y, -1, 1) = ±w for the edges of the picture, row by row.
    """
    w = 1.0 if projection[3, 3] == 0.0 else projection[3, 3]
    edges = []
    for row in (0, 1):
        scale = projection[row, row]
        shift = projection[row, 3] - projection[row, 2]
        edges += [(-w - shift) / scale, (w - shift) / scale]
    return (edges[0], edges[1], edges[2], edges[3])
