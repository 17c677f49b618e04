# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of Cycles in a scene as those of Halfspace, and a sentence for each that has no counterpart."""

from __future__ import annotations

from typing import Any

import bpy

from ...core.structures.settings import BOUNCES
from . import quality

TAKEN = {
    "use_denoising": "use_denoising",
    "use_preview_denoising": "use_preview_denoising",
    "preview_denoising_start_sample": "preview_denoising_start_sample",
    "samples": "samples",
    "preview_samples": "preview_samples",
    "use_adaptive_sampling": "use_adaptive",
    "adaptive_threshold": "noise_threshold",
    "adaptive_min_samples": "min_samples",
    "use_preview_adaptive_sampling": "use_preview_adaptive",
    "preview_adaptive_threshold": "preview_noise_threshold",
    "preview_adaptive_min_samples": "preview_min_samples",
    "time_limit": "time_limit",
    "seed": "render_seed",
    "use_animated_seed": "use_animated_seed",
    **{name: name for name in BOUNCES},
    "sample_clamp_direct": "clamp_direct",
    "sample_clamp_indirect": "clamp_indirect",
    "blur_glossy": "filter_glossy",
    "caustics_reflective": "caustics_reflective",
    "caustics_refractive": "caustics_refractive",
    "film_exposure": "film_exposure",
    "pixel_filter_type": "pixel_filter_type",
    "filter_width": "filter_width",
    "bake_type": "bake_type",
}
"""Properties of `scene.halfspace` by those of `scene.cycles` with the same meaning."""

SHARED = (
    "transparent_max_bounces",
    "film_transparent_glass",
    "film_transparent_roughness",
    "rolling_shutter_type",
    "rolling_shutter_duration",
    "dicing_rate",
    "preview_dicing_rate",
    "max_subdivisions",
    "dicing_camera",
    "offscreen_dicing_scale",
    "use_camera_cull",
    "camera_cull_margin",
    "use_distance_cull",
    "distance_cull_margin",
    "texture_limit",
    "texture_limit_render",
)
"""Properties of `scene.cycles` that Halfspace reads where they are."""

WITHOUT: dict[str, tuple[tuple[Any, ...], str]] = {
    "device": (("CPU",), "Halfspace renders on the CPU"),
    "shading_system": ((False,), "scripts of Open Shading Language are not run"),
    "denoiser": (("OPENIMAGEDENOISE",), "Open Image Denoise removes the noise"),
    "denoising_prefilter": (("ACCURATE",), "the noise of albedo and normal is always removed first"),
    "denoising_quality": (("HIGH",), "final renders always have the highest quality"),
    "denoising_input_passes": (("RGB_ALBEDO_NORMAL",), "albedo and normal always guide the denoiser"),
    "preview_denoising_quality": (("BALANCED",), "the viewport always has the balanced quality"),
    "use_sample_subset": ((False,), "all samples are rendered"),
    "sampling_pattern": (("AUTOMATIC",), "there is one pattern of random numbers"),
    "scrambling_distance": ((1.0,), "each pixel has random numbers of its own"),
    "auto_scrambling_distance": ((False,), "each pixel has random numbers of its own"),
    "use_layer_samples": (("USE",), "the samples of a view layer always replace those of the scene"),
    "light_sampling_threshold": ((0.0, 0.01), "no light sample is left out for being dim"),
    "direct_light_sampling_type": (
        ("MULTIPLE_IMPORTANCE_SAMPLING",),
        "light samples and scattered rays are always combined",
    ),
    "use_light_tree": ((True,), "many lights are always sampled through a light tree"),
    "min_light_bounces": ((0,), "Russian roulette begins at the second bounce"),
    "min_transparent_bounces": ((0,), "Russian roulette does not end paths at transparent surfaces"),
    "use_guiding": ((False,), "paths are not guided"),
    "use_fast_gi": ((False,), "all bounces are rendered"),
    "use_pixel_jitter": ((False,), "the samples of a pixel are always spread by its filter"),
    "volume_biased": ((False,), "volumes are never marched through in steps"),
    "texture_resolution_render": ((1.0,), "only the size limit of textures is supported"),
}
"""Properties of `scene.cycles` without a counterpart: the values at which nothing is missing, and what holds here."""

FINEST = 0.001
"""Least noise threshold that Cycles derives from the number of samples."""


def taken(cycles: Any) -> dict[str, Any]:
    """Values of `scene.halfspace`, by name, from a `scene.cycles` group."""
    found = {ours: getattr(cycles, theirs) for theirs, ours in TAKEN.items() if hasattr(cycles, theirs)}
    # Zero means an unlimited number of samples, and a threshold by the number of samples.
    found["preview_samples"] = found["preview_samples"] or quality.MOST_SAMPLES
    for prefix in ("", "preview_"):
        samples = found[f"{prefix}samples"] = min(found[f"{prefix}samples"], quality.MOST_SAMPLES)
        found[f"{prefix}noise_threshold"] = found[f"{prefix}noise_threshold"] or max(FINEST, 1 / samples)
    if found["pixel_filter_type"] not in quality.FILTERS:
        found["pixel_filter_type"] = "BLACKMAN_HARRIS"
    return found


def without(cycles: Any) -> list[str]:
    """A sentence for each setting of a `scene.cycles` group that is in use and has no counterpart."""
    found = []
    for name, (plain, text) in WITHOUT.items():
        value = getattr(cycles, name, plain[0])
        if not any(value == one or (isinstance(one, float) and abs(value - one) < 1e-6) for one in plain):
            found.append(f"{_label(cycles, name)}: {text}.")
    if cycles.pixel_filter_type not in quality.FILTERS:
        found.append(f"{_label(cycles, 'pixel_filter_type')}: Blackman-Harris replaces {cycles.pixel_filter_type}.")
    return found


def _label(cycles: Any, name: str) -> str:
    return str(cycles.bl_rna.properties[name].name)


class HALFSPACE_OT_import_cycles(bpy.types.Operator):
    """Takes over the settings of Cycles."""

    bl_idname = "halfspace.import_cycles"
    bl_label = "Import Settings from Cycles"
    bl_description = (
        "Take over samples, noise threshold, denoising, bounces, clamping, film and random numbers from the settings "
        "of Cycles in this scene, and list those that have no counterpart"
    )
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: Any) -> bool:
        if hasattr(context.scene, "cycles"):
            return True
        cls.poll_message_set("Cycles is disabled in the preferences, and its settings with it")
        return False

    def execute(self, context: Any) -> set[str]:
        scene = context.scene
        found, missing = taken(scene.cycles), without(scene.cycles)
        for name, value in found.items():
            setattr(scene.halfspace, name, value)
        scene.update_tag()
        # List what is missing in the log of reports, and in a window also under the pointer.
        for sentence in missing:
            self.report({"INFO"}, sentence)
        text = f"{len(found)} settings taken over, {len(missing)} without a counterpart"
        self.report({"INFO"}, text)
        if missing and not bpy.app.background:
            context.window_manager.popup_menu(lambda menu, _context: _list(menu.layout, missing), title=text)
        return {"FINISHED"}


def _list(layout: Any, sentences: list[str]) -> None:
    for sentence in sentences:
        layout.label(text=sentence)


CLASSES = (HALFSPACE_OT_import_cycles,)
