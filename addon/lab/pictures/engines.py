# SPDX-License-Identifier: GPL-3.0-or-later
"""Equal settings of both engines: exact up to noise, or Cycles' defaults with what they clip and blur."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ...blender.settings import presets
from ...core.structures.settings import BOUNCES

SHARED = {
    "film_exposure": 1.0,
    "pixel_filter_type": "BLACKMAN_HARRIS",
    "filter_width": 1.5,
    "caustics_reflective": True,
    "caustics_refractive": True,
}
"""Settings of the same name in both engines."""


@dataclass(frozen=True)
class Sampling:
    """Settings by their names in Cycles and in Halfspace."""

    cycles: dict[str, Any] = field(default_factory=dict)
    halfspace: dict[str, Any] = field(default_factory=dict)


EXACT = Sampling(
    cycles={
        "use_denoising": False,
        "use_adaptive_sampling": False,
        "use_light_tree": False,
        "light_sampling_threshold": 0.0,
        "sample_clamp_direct": 0.0,
        "sample_clamp_indirect": 0.0,
        "blur_glossy": 0.0,
        "sampling_pattern": "TABULATED_SOBOL",
    },
    halfspace={
        "use_adaptive": False,
        "time_limit": 0.0,
        "use_denoising": False,
        "clamp_direct": 0.0,
        "clamp_indirect": 0.0,
        "filter_glossy": 0.0,
    },
)
"""The picture differs from the exact one only by noise."""

DEFAULT = Sampling(
    cycles={
        **EXACT.cycles,
        "use_light_tree": True,
        "light_sampling_threshold": 0.01,
        "sample_clamp_indirect": 10.0,
        "blur_glossy": 1.0,
        "sampling_pattern": "AUTOMATIC",
    },
    halfspace={**EXACT.halfspace, "clamp_indirect": 10.0, "filter_glossy": 1.0},
)
"""The defaults of Cycles, without adaptive sampling and denoising."""


LIMITED = BOUNCES[:-1]
"""Limits of bounces but for those in volumes, which pictures of both engines share."""


class EngineError(RuntimeError):
    """Raised if Blender lacks an engine."""


def configure_halfspace(scene: Any, structure: str, samples: int, bounces: int, sampling: Sampling = EXACT) -> None:
    """Set Halfspace's structure, samples per pixel and bounces. Raises SpecError."""
    presets.apply(scene.halfspace, structure)
    scene.halfspace.automatic = False
    scene.halfspace.samples = samples
    for name in LIMITED:
        setattr(scene.halfspace, name, bounces)
    for key, value in {**SHARED, **sampling.halfspace}.items():
        setattr(scene.halfspace, key, value)


def configure_cycles(scene: Any, samples: int, bounces: int, sampling: Sampling = EXACT) -> None:
    """Set Cycles' samples per pixel and bounces, on the CPU. Raises EngineError."""
    import addon_utils

    if not hasattr(scene, "cycles"):
        addon_utils.enable("cycles")
    if not hasattr(scene, "cycles"):
        raise EngineError("this Blender has no Cycles")
    cycles = scene.cycles
    cycles.device, cycles.samples = "CPU", samples
    for name in LIMITED:
        setattr(cycles, name, bounces)
    for key, value in {**SHARED, **sampling.cycles}.items():
        setattr(cycles, key, value)
