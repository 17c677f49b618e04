# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of volume shader nodes: a tree of mixes becomes a list of weighted coefficients, computed by a program."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ..nodes import Place, Unsupported
from ..object_values import DENSITY_SCALE, GRID
from ..surfaces import DEEPEST, MOST_READ
from ..value_nodes import is_constant

if TYPE_CHECKING:
    from ....core.scene.scene import Operand, Step
    from ..values import Values

MOST_CLOSURES = 16
"""Limit of the native module on the closures of a volume."""

STEFAN_BOLTZMANN = 5.670373e-8
"""Radiant exitance of a black body per kelvin to the fourth, W/m²."""

HENYEY_GREENSTEIN = "HENYEY_GREENSTEIN"


PURE = frozenset(
    [
        *("vector_math", "math", "mix", "clamp", "gamma", "blackbody", "wavelength", "combine", "channel", "alpha"),
        *("luminance", "mean", "invert", "bright_contrast", "hue_saturation", "ramp", "curves", "matrix", "unit"),
    ]
)
"""Operations whose result is constant if their arguments are."""


def varies(steps: Iterable[Step]) -> bool:
    """Whether the result of a program may depend on the point."""
    return any(step["op"] not in PURE for step in steps)


@dataclass
class Volume:
    """The closures found so far, by inputs of the native module, and the values they use."""

    values: Values
    closures: list[dict[str, Operand]] = field(default_factory=list)
    followed: int = 0

    def read(self, place: Place, weight: Operand = 1.0, depth: int = 0) -> None:
        """Read the volume shaders that feed an input. Raises Unsupported with the node's name."""
        self.followed += 1
        if self.followed > MOST_READ:
            raise Unsupported(f"More than {MOST_READ} shaders")
        source = place.source()
        if not source.socket.is_output or is_constant(weight, 0.0):
            return
        if depth > DEEPEST:
            raise Unsupported(f"More than {DEEPEST} mixes within each other")
        match source.node.bl_idname:
            case "ShaderNodeMixShader":
                factor_socket, first, second = (source.beside(socket) for socket in source.node.inputs[:3])
                factor = self.values.step("clamp", self.values.value(factor_socket), 0.0, 1.0)
                rest = self.values.step("math", 1.0, factor, 0.0, kind="SUBTRACT")
                self.read(first, self.product(weight, rest), depth + 1)
                self.read(second, self.product(weight, factor), depth + 1)
            case "ShaderNodeAddShader":
                for socket in source.node.inputs[:2]:
                    self.read(source.beside(socket), weight, depth + 1)
            case kind if kind in SHADERS:
                if len(self.closures) < MOST_CLOSURES:
                    SHADERS[kind](self, source, weight)
                else:
                    self.values.remark(f"More than {MOST_CLOSURES} volume shaders")
            case _:
                self.values.remark(f"{source.node.bl_label} as a volume")

    def as_dict(self) -> Mapping[str, Any] | None:
        """The volume as the native module takes it; None if there is none."""
        if not self.closures:
            return None
        return {"closures": tuple(self.closures), "program": tuple(self.values.steps)}

    def add(self, node: Place, **inputs: Operand) -> None:
        """Append a closure with the node's phase function."""
        phase = getattr(node.node, "phase", HENYEY_GREENSTEIN)
        if phase != HENYEY_GREENSTEIN:
            name = phase.replace("_", "-").title()
            self.values.remark(f"{node.node.bl_label}: the phase function {name} (Henyey-Greenstein is used)")
        scale = self.scale()
        coefficients = {key: value for key, value in inputs.items() if key != "anisotropy"}
        scaled = {key: self.product(value, scale) for key, value in coefficients.items()}
        self.closures.append({**inputs, **scaled})

    def product(self, *factors: Operand) -> Operand:
        """The product of colours and numbers; the native module computes what is constant once."""
        first, *others = factors
        for other in others:
            first = self.values.step("vector_math", first, other, 0.0, kind="MULTIPLY")
        return first

    def difference(self, one: Operand, other: Operand) -> Operand:
        """One colour minus another, at least 0."""
        return self.positive(self.values.step("vector_math", one, other, 0.0, kind="SUBTRACT"))

    def positive(self, value: Operand) -> Operand:
        """A colour or number, at least 0. Notes a constant that is negative."""
        if not isinstance(value, int) and np.min(value) < 0:
            self.values.remark("A negative coefficient of a volume (0 is used)")
        return self.values.step("vector_math", value, 0.0, 0.0, kind="MAXIMUM")

    def density(self, node: Place, weight: Operand) -> Operand:
        """The node's density and its share."""
        return self.product(self.positive(self.values.input(node, "Density", 1.0)), weight)

    def scale(self) -> Operand:
        """The factor of the object on all coefficients; 1 unless there are volume objects."""
        values = self.values
        if values.background or not values.layers.grids:
            return 1.0
        return values.of_object(GRID, DENSITY_SCALE)

    def grid(self, node: Place, name: str, absent: float) -> Operand:
        """The grid whose name a text input holds; `absent` in objects without it."""
        place = node.input(name)
        return absent if place is None else self.values.grid(place.socket.default_value, absent)


def _scatter(volume: Volume, node: Place, weight: Operand) -> None:
    values = volume.values
    scattering = volume.product(volume.positive(values.input(node, "Color")), volume.density(node, weight))
    volume.add(node, scattering=scattering, anisotropy=values.input(node, "Anisotropy"))


def _absorption(volume: Volume, node: Place, weight: Operand) -> None:
    color = volume.difference(1.0, volume.values.input(node, "Color"))
    volume.add(node, absorption=volume.product(color, volume.density(node, weight)))


def _coefficients(volume: Volume, node: Place, weight: Operand) -> None:
    values = volume.values
    names = ("Scatter", "Absorption", "Emission")
    scattering, absorption, emission = (values.input(node, f"{name} Coefficients") for name in names)
    volume.add(
        node,
        scattering=volume.product(volume.positive(scattering), weight),
        absorption=volume.product(volume.positive(absorption), weight),
        emission=volume.product(emission, weight),
        anisotropy=values.input(node, "Anisotropy"),
    )


def _emission(volume: Volume, node: Place, weight: Operand) -> None:
    values = volume.values
    light = volume.product(values.input(node, "Color"), values.input(node, "Strength"), weight)
    volume.add(node, emission=light)


def _principled(volume: Volume, node: Place, weight: Operand) -> None:
    values = volume.values
    density = volume.product(volume.density(node, weight), volume.positive(volume.grid(node, "Density Attribute", 1.0)))
    color = volume.product(values.input(node, "Color"), volume.grid(node, "Color Attribute", 1.0))
    color = volume.positive(color)
    # What is not scattered is absorbed, except in the absorption colour, whose square root counts as in Cycles.
    tint = volume.positive(values.input(node, "Absorption Color"))
    root = values.step("gamma", tint, 0.5)
    absorbed = volume.product(volume.difference(1.0, color), volume.difference(1.0, root))
    emission = volume.product(values.input(node, "Emission Color"), values.input(node, "Emission Strength"))
    glow = values.input(node, "Blackbody Intensity")
    if not is_constant(glow, 0.0):
        emission = values.step("vector_math", emission, _blackbody(volume, node, glow), 0.0, kind="ADD")
    volume.add(
        node,
        scattering=volume.product(color, density),
        absorption=volume.product(absorbed, density),
        emission=volume.product(emission, weight),
        anisotropy=values.input(node, "Anisotropy"),
    )


def _blackbody(volume: Volume, node: Place, glow: Operand) -> Operand:
    """The light of a black body: Stefan and Boltzmann's law in the share that the intensity gives, as in Cycles."""
    values = volume.values
    warmth = volume.positive(volume.grid(node, "Temperature Attribute", 1.0))
    kelvin = volume.product(volume.positive(values.input(node, "Temperature")), warmth)
    fourth = values.step("math", kelvin, 4.0, 0.0, kind="POWER")
    share = values.step("mix", glow, 1.0, fourth, kind="MIX")
    strength = volume.product(share, STEFAN_BOLTZMANN * 1e-6 / np.pi)
    return volume.product(values.step("blackbody", kelvin), strength, values.input(node, "Blackbody Tint"))


SHADERS: dict[str, Callable[[Volume, Place, Any], None]] = {
    "ShaderNodeVolumePrincipled": _principled,
    "ShaderNodeVolumeScatter": _scatter,
    "ShaderNodeVolumeAbsorption": _absorption,
    "ShaderNodeVolumeCoefficients": _coefficients,
    "ShaderNodeEmission": _emission,
}
