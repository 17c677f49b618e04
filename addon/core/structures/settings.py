# SPDX-License-Identifier: GPL-3.0-or-later
"""User settings: a structure with its parameters, and a picture with its size and quality."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from . import relevance, specs

if TYPE_CHECKING:
    from .catalogue import Structure, Value


class SettingsError(ValueError):
    """A setting is out of range. The message names it."""


def spec(structure: Structure, values: Mapping[str, Value]) -> str:
    """The configuration string `id:key=value,...` of a structure.

    Contains only parameters of this structure that have an effect and differ from their defaults; values are clamped.
    """
    taken = relevance.effective(structure, values)
    keys: dict[str, Value] = {
        parameter.name: value
        for parameter in structure.parameters
        if (value := taken[parameter.name]) is not None and not same(value, parameter.default)
    }
    return specs.joined(structure.id, *(f"{key}={_text(value)}" for key, value in keys.items()))


def memory_limit(megabytes: int) -> int | None:
    """Memory limit of a build in bytes, from a setting in which 0 means the native module's limit (None)."""
    return megabytes * 1_000_000 if megabytes else None


def same(a: Value, b: Value) -> bool:
    """Whether two values are equal; numbers in f32, the precision in which Blender stores them."""
    if isinstance(a, float) or isinstance(b, float):
        return bool(np.float32(a) == np.float32(b))
    return a == b


def _text(value: Value) -> str:
    if isinstance(value, float):
        # The shortest decimal that is this f32: what the user typed, not 0.10000000149.
        return np.format_float_positional(np.float32(value), trim="-")
    return str(value)


BOUNCES = ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces", "volume_bounces")
"""Limits of bounces, of all kinds together and of each, by their names in Cycles and here."""

MOST_BOUNCES = 1024
"""Largest limit of a kind of bounces."""


@dataclass(frozen=True)
class Mist:
    """Growth of the mist pass, in scene units; falloff as in Blender: QUADRATIC, LINEAR, INVERSE_QUADRATIC."""

    start: float = 5.0
    depth: float = 25.0
    falloff: str = "QUADRATIC"


@dataclass(frozen=True)
class RenderSettings:
    """Settings of one picture. border: (x0, y0, x1, y1) pixels of the full frame, half open, y from the bottom; None:
    all.

    diffuse_bounces, glossy_bounces, transmission_bounces: largest number of bounces of each kind within max_bounces.
    volume_bounces: largest number of times a path scatters in volumes after the first time. transparent_bounces:
    largest number of transparent surfaces it passes. transparent_glass: roughness up to which a transparent film sees
    through glass, below 0 = not at all.
    integrator: path, whitted (direct light, mirrors and clear glass) or ao (openness within ambient_distance).
    clamp_direct, clamp_indirect: largest contribution of a sample up to and after its first bounce, 0 = no limit.
    filter_glossy: blur of lobes met after improbable bounces, 0 = none. caustics_reflective, caustics_refractive:
    whether lobes that reflect and refract are kept after a diffuse bounce. secondary_beams: whether rays that flat
    polygons mirror and refract go as beams, for whitted. exposure: factor on the colours. filter:
    blackman_harris or box, of filter_width pixels. passes: names of the output arrays. noise_threshold: error below
    which a block of pixels gets no more samples, 0 = none is skipped. min_samples: number of samples before that, 0 =
    derived from the threshold. time_limit: seconds after which no samples
    begin, 0 = no limit. record_rays: largest number of rays of each kind to record, 0 = none. threads: 0 means one per
    core. Raises SettingsError.
    """

    width: int
    height: int
    border: tuple[int, int, int, int] | None = None
    samples: int = 32
    max_bounces: int = 6
    diffuse_bounces: int = MOST_BOUNCES
    glossy_bounces: int = MOST_BOUNCES
    transmission_bounces: int = MOST_BOUNCES
    volume_bounces: int = 0
    transparent_bounces: int = 8
    integrator: str = "path"
    ambient_distance: float = math.inf
    clamp_direct: float = 0.0
    clamp_indirect: float = 0.0
    filter_glossy: float = 0.0
    caustics_reflective: bool = True
    caustics_refractive: bool = True
    secondary_beams: bool = False
    exposure: float = 1.0
    filter: str = "blackman_harris"
    filter_width: float = 1.5
    seed: int = 0
    film_transparent: bool = False
    transparent_glass: float = -1.0
    passes: tuple[str, ...] = field(default=("Combined",))
    noise_threshold: float = 0.0
    min_samples: int = 0
    time_limit: float = 0.0
    mist: Mist = field(default_factory=Mist)
    record_rays: int = 0
    threads: int = 0

    def __post_init__(self) -> None:
        positive = ("width", "height", "samples")
        others = (*BOUNCES, "transparent_bounces", "min_samples", "threads")
        for name, least in (*((name, 1) for name in positive), *((name, 0) for name in others)):
            if getattr(self, name) < least:
                raise SettingsError(f"{name}: expected at least {least}, got {getattr(self, name)}")
        if self.border is not None:
            x0, y0, x1, y1 = self.border
            if not (0 <= x0 < x1 <= self.width and 0 <= y0 < y1 <= self.height):
                raise SettingsError(f"border: {self.border} is not inside {self.width} × {self.height} pixels")

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the rendered part in pixels."""
        if self.border is None:
            return self.width, self.height
        x0, y0, x1, y1 = self.border
        return x1 - x0, y1 - y0

    def as_dict(self) -> dict[str, Any]:
        """The settings as the native `render` takes them."""
        values = {item.name: getattr(self, item.name) for item in fields(self) if item.name != "threads"}
        if not self.record_rays:  # the native module may be older than the setting
            values.pop("record_rays")
        return {**values, "passes": list(self.passes), "mist": asdict(self.mist)}
