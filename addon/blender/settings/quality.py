# SPDX-License-Identifier: GPL-3.0-or-later
"""The properties of `scene.halfspace` that determine the picture, and their form for the native renderer.

Names, ranges and defaults are those of Cycles where Cycles has the setting.
"""

from __future__ import annotations

import math
import struct
import zlib
from typing import TYPE_CHECKING, Any

from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

from ...core.structures.settings import BOUNCES, MOST_BOUNCES
from . import stored

if TYPE_CHECKING:
    from ...core.base.notes import Notes

FILTERS = {"BLACKMAN_HARRIS": "blackman_harris", "BOX": "box"}
"""Native names of the pixel filters."""

MOST_SAMPLES = 1 << 20
"""Largest number of samples per pixel."""


def _adaptive(prefix: str, where: str, threshold: float) -> dict[str, Any]:
    """The properties of adaptive sampling. prefix: of their names. where: for which pictures."""
    return {
        f"use_{prefix}adaptive": BoolProperty(
            name="Adaptive Sampling",
            description=f"Stop sampling parts of the pictures of {where} whose noise is below the threshold. A picture "
            "is then no longer unbiased: parts that seem converged too early stay so",
            default=True,
        ),
        f"{prefix}noise_threshold": FloatProperty(
            name="Noise Threshold",
            description="Error of a pixel relative to the square root of its brightness, below which it gets no more "
            "samples",
            default=threshold,
            min=1e-4,
            soft_max=0.2,
            max=1.0,
            precision=4,
        ),
        f"{prefix}min_samples": IntProperty(
            name="Min Samples",
            description="Number of samples that each pixel gets before its noise is compared with the threshold; 0 "
            "depends on the threshold",
            default=0,
            min=0,
            max=4096,
        ),
    }


_SAMPLING: dict[str, Any] = {
    "integrator": EnumProperty(
        name="Integrator",
        description="The algorithm that computes the light",
        items=[
            ("path", "Path Tracing", "All light, exact up to noise", 0),
            ("whitted", "Whitted", "Direct light, mirrors and clear glass; light from other surfaces is left out", 1),
            ("ao", "Ambient Occlusion", "Openness of each point, without materials and lights", 2),
        ],
        default="path",
    ),
    "ambient_distance": FloatProperty(
        name="Distance",
        description="Length of the rays of ambient occlusion; 0 is unlimited",
        default=0.0,
        min=0.0,
        subtype="DISTANCE",
    ),
    "samples": IntProperty(
        name="Samples",
        description="Camera rays per pixel; four times as many halve the noise",
        default=32,
        min=1,
        max=MOST_SAMPLES,
    ),
    "preview_samples": IntProperty(
        name="Viewport Samples", description="Rays per pixel in the viewport", default=16, min=1, max=MOST_SAMPLES
    ),
    **_adaptive("", "final renders", 0.01),
    **_adaptive("preview_", "the viewport", 0.1),
    "time_limit": FloatProperty(
        name="Time Limit",
        description="Seconds after which a final render ends with the samples taken so far, at least one. The picture "
        "then depends on the machine; 0 is no limit",
        default=0.0,
        min=0.0,
        subtype="TIME_ABSOLUTE",
        unit="TIME_ABSOLUTE",
    ),
    "use_denoising": BoolProperty(
        name="Denoise",
        description="Remove the noise of final renders with Open Image Denoise, guided by the albedo and the normal "
        "of the first surfaces. The picture is then no longer unbiased",
        default=True,
    ),
    "use_preview_denoising": BoolProperty(
        name="Viewport Denoise",
        description="Remove the noise of the viewport with Open Image Denoise, guided by the albedo and the normal of "
        "the first surfaces",
        default=False,
    ),
    "preview_denoising_start_sample": IntProperty(
        name="Start Denoising",
        description="Number of samples from which the noise of the viewport is removed; that of the last one always is",
        default=1,
        min=0,
        max=1 << 24,
    ),
    "render_seed": IntProperty(
        name="Seed",
        description="Seed of the random numbers: each value gives the same picture with different noise",
        default=0,
        min=0,
    ),
    "use_animated_seed": BoolProperty(
        name="Animate Seed",
        description="Give each frame random numbers of its own, so that the noise of an animation does not stand still",
        default=False,
    ),
}

_BAKING: dict[str, Any] = {
    "bake_type": EnumProperty(
        name="Bake Type",
        description="What the pixels of a baked picture show",
        items=[
            ("COMBINED", "Combined", "Light, by its parts", 0),
            ("AO", "Ambient Occlusion", "Openness within the distance of that integrator", 1),
            ("SHADOW", "Shadow", "Share of the light of lamps that reaches the surface", 2),
            ("POSITION", "Position", "Position in the world", 11),
            ("NORMAL", "Normal", "Shading normal", 3),
            ("UV", "UV", "UV coordinates of the active map", 4),
            ("ROUGHNESS", "Roughness", "Roughness of the shaders", 5),
            ("EMIT", "Emission", "Light that the surface emits", 6),
            ("ENVIRONMENT", "Environment", "Light of the world, from its origin in the direction of the surface", 7),
            ("DIFFUSE", "Diffuse", "Light of diffuse shaders", 8),
            ("GLOSSY", "Glossy", "Light of reflecting shaders", 9),
            ("TRANSMISSION", "Transmission", "Light of refracting shaders", 10),
        ],
        default="COMBINED",
    ),
}

_LIGHT_PATHS: dict[str, Any] = {
    **{
        name: IntProperty(name=name.replace("_", " ").title(), description=text, default=most, min=0, max=MOST_BOUNCES)
        for name, most, text in (
            ("max_bounces", 12, "Largest number of bounces after the first surface, of all kinds together"),
            ("diffuse_bounces", 4, "Largest number of diffuse bounces within the total"),
            ("glossy_bounces", 4, "Largest number of glossy reflections within the total"),
            ("transmission_bounces", 12, "Largest number of refractions within the total"),
            ("volume_bounces", 0, "Largest number of times that light scatters in volumes after the first time"),
        )
    },
    "secondary_beams": BoolProperty(
        name="Beams",
        description="Send the rays that flat mirrors and panes reflect and refract as beams from the virtual eye of "
        "each polygon (Heckbert and Hanrahan 1984). Mirrors stay exact, refraction becomes approximate",
        default=False,
    ),
    "clamp_direct": FloatProperty(
        name="Clamp Direct",
        description="Largest contribution of one sample up to its first bounce. Lower values remove fireflies and "
        "lose light; 0 is no limit, and unbiased",
        default=0.0,
        min=0.0,
        soft_max=100.0,
    ),
    "clamp_indirect": FloatProperty(
        name="Clamp Indirect",
        description="Largest contribution of one sample after its first bounce. Lower values remove fireflies and "
        "lose light; 0 is no limit, and unbiased",
        default=10.0,
        min=0.0,
        soft_max=100.0,
    ),
    "filter_glossy": FloatProperty(
        name="Filter Glossy",
        description="Blurs reflections and refractions that paths reach by improbable bounces, to reduce noise; 0 is "
        "off, and unbiased",
        default=1.0,
        min=0.0,
        max=10.0,
    ),
    "caustics_reflective": BoolProperty(
        name="Reflective Caustics",
        description="Keep light that mirrors and gloss throw onto matte surfaces. It is noisy",
        default=True,
    ),
    "caustics_refractive": BoolProperty(
        name="Refractive Caustics",
        description="Keep light that glass throws onto matte surfaces. It is noisy",
        default=True,
    ),
}

_MOTION: dict[str, Any] = {
    "motion_steps": IntProperty(
        name="Steps",
        description="Number of times while the shutter is open at which moving objects are shown, each with a "
        "structure of its own unless instances are kept. The camera moves smoothly",
        default=8,
        min=1,
        max=256,
    ),
}

_FILM: dict[str, Any] = {
    "film_exposure": FloatProperty(
        name="Exposure",
        description="Factor on the brightness of the picture",
        default=1.0,
        min=0.0,
        soft_max=10.0,
        max=2.0**32,
    ),
    "pixel_filter_type": EnumProperty(
        name="Filter Type",
        description="Weight of the samples around the centre of a pixel",
        items=[
            ("BOX", "Box", "All samples within a pixel count alike", 0),
            ("BLACKMAN_HARRIS", "Blackman-Harris", "A soft window around the pixel", 1),
        ],
        default="BLACKMAN_HARRIS",
    ),
    "filter_width": FloatProperty(
        name="Filter Width",
        description="Width of the pixel filter",
        default=1.5,
        min=0.01,
        max=10.0,
        subtype="PIXEL",
    ),
}

PROPERTIES: dict[str, Any] = {**_SAMPLING, **_LIGHT_PATHS, **_MOTION, **_FILM, **_BAKING}
"""Annotations of the property group."""


CHOICES = ("integrator", "pixel_filter_type", "instancing", "top")
"""Choices of `scene.halfspace` that every final render and viewport reads."""


def integrator(group: Any) -> str:
    """The native name of the integrator; the default for one that is unknown to this version."""
    return stored.choice(group, "integrator")


def instancing(group: Any) -> str:
    """How instances are stored; the default for a way that is unknown to this version."""
    return stored.choice(group, "instancing")


def top(group: Any) -> str:
    """How the tree over instances is built; the default for a way that is unknown to this version."""
    return stored.choice(group, "top")


def remark_unknown(group: Any, notes: Notes) -> None:
    """Note if a choice of a `scene.halfspace` group replaces an unknown one of its file."""
    stored.remark_choices(group, CHOICES, notes)


def seed(scene: Any) -> int:
    """The 32-bit seed of the random numbers of a scene's frame, which may be a fraction."""
    group = scene.halfspace
    if not group.use_animated_seed:
        return int(group.render_seed)
    return zlib.crc32(struct.pack("<d", scene.frame_float), group.render_seed)


def adaptive(group: Any, prefix: str = "") -> dict[str, Any]:
    """The arguments of `RenderSettings` for adaptive sampling. prefix: as of the properties."""
    used = getattr(group, f"use_{prefix}adaptive")
    return {
        "noise_threshold": getattr(group, f"{prefix}noise_threshold") if used else 0.0,
        "min_samples": getattr(group, f"{prefix}min_samples") if used else 0,
    }


def settings(scene: Any) -> dict[str, Any]:
    """The arguments of `RenderSettings` that final renders and the viewport share."""
    group, render = scene.halfspace, scene.render
    cycles = getattr(scene, "cycles", None)  # missing while that extension is disabled
    glass = getattr(cycles, "film_transparent_glass", False)
    pixels = stored.choice(group, "pixel_filter_type")
    return {
        "integrator": integrator(group),
        "ambient_distance": group.ambient_distance or math.inf,
        **{name: getattr(group, name) for name in BOUNCES},
        "transparent_bounces": getattr(cycles, "transparent_max_bounces", 8),
        "clamp_direct": group.clamp_direct,
        "clamp_indirect": group.clamp_indirect,
        "filter_glossy": group.filter_glossy,
        "caustics_reflective": group.caustics_reflective,
        "caustics_refractive": group.caustics_refractive,
        "secondary_beams": group.secondary_beams and integrator(group) == "whitted",
        "exposure": group.film_exposure,
        "filter": FILTERS[pixels],
        # As in Cycles, whose box is always one pixel wide.
        "filter_width": 1.0 if pixels == "BOX" else group.filter_width,
        "seed": seed(scene),
        "film_transparent": render.film_transparent,
        "transparent_glass": cycles.film_transparent_roughness if glass else -1.0,
        "threads": render.threads if render.threads_mode == "FIXED" else 0,
    }
