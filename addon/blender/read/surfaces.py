# SPDX-License-Identifier: GPL-3.0-or-later
"""Conversion of surface shader nodes to `core.scene.Closure`: a tree of mixes becomes a list of weighted closures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import bpy

from ...core.scene.scene import Closure
from .nodes import Place, Unsupported
from .strands import shaders
from .value_nodes import is_constant
from .values import Values

if TYPE_CHECKING:
    from ...core.scene.scene import Operand

WALKS = {
    "RANDOM_WALK_SKIN": "random_walk_skin",
    "RANDOM_WALK_LEGACY": "random_walk_legacy",
    "BURLEY": "random_walk_legacy",
}
"""Methods of subsurface scattering other than Random Walk, by Blender's names. Random walks took the radius of Burley's
diffusion profile before Blender 5.2, which has a method for that."""

METHODS_OF_BLENDER = bpy.types.ShaderNodeSubsurfaceScattering.bl_rna.properties["falloff"].enum_items.keys()

DISTRIBUTIONS = {"BECKMANN": "beckmann", "ASHIKHMIN_SHIRLEY": "ashikhmin_shirley"}
"""Distributions of facets other than GGX, by Blender's names."""

MOST_CLOSURES = 8
MOST_PRINCIPLED = 4
"""Limits of the native module on the closures of a material: in total, and of the kind principled."""

OF_GLASS = 5
"""Largest number of closures of a Principled BSDF that is a sheet of glass."""

FOLDED: dict[str, Callable[..., float]] = {
    "SUBTRACT": lambda a, b: a - b,
    "DIVIDE": lambda a, b: a / b if b else 0.0,
    "MULTIPLY_ADD": lambda a, b, c: a * b + c,
}
"""Math of known numbers."""

SHARPEST = 0.03
"""Roughness below which a thin sheet of glass transmits sharply (chosen: its blur is below a thousandth)."""

DEEPEST = 32
"""Largest depth of nested mixes."""

MOST_READ = 4096
"""Largest number of shader inputs that are followed; each mix with one node on both sides doubles them."""


@dataclass
class Surface:
    """The closures found so far, the values they use, and the colour of the material in the viewport."""

    values: Values
    viewport: tuple[float, ...]
    closures: list[Closure] = field(default_factory=list)
    followed: int = 0
    portals: list[tuple[Operand, Operand, Operand]] = field(default_factory=list)

    def remark(self, what: str) -> None:
        """Note an unsupported feature."""
        self.values.remark(what)

    def read(self, place: Place, weight: Operand = 1.0, depth: int = 0) -> None:
        """Read the shaders that feed an input. Raises Unsupported with the node's name."""
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
                self._mix(source, weight, depth)
            case "ShaderNodeAddShader":
                for socket in source.node.inputs[:2]:
                    self.read(source.beside(socket), weight, depth + 1)
            case "ShaderNodeBsdfRayPortal":
                self._portal(source, weight)
            case kind if kind in SHADERS:
                # Check this before reading its inputs, which may be long chains.
                if self.has_room(principled=kind in PRINCIPLED):
                    SHADERS[kind](self, source, weight)
            case kind:
                self._unknown(kind, source, weight)

    def _portal(self, node: Place, weight: Operand) -> None:
        """Read a Ray Portal BSDF: its colour multiplied by the weight, position and direction."""
        if len(self.portals) >= MOST_CLOSURES:
            self.remark(f"More than {MOST_CLOSURES} portals")
            return
        place = node.input("Position")
        elsewhere = place is not None and place.source() != place
        position = self.values.input(node, "Position") if elsewhere else self.values.coordinate("position")
        direction = self.values.input(node, "Direction")
        self.portals.append((self.emitted(self.color(node), weight), position, direction))

    def _unknown(self, kind: str, node: Place, weight: Operand) -> None:
        """Read a surface shader that is not rendered as a diffuse one of its colour. Raises Unsupported without one."""
        color = next((name for name in ("Color", "Base Color") if node.input(name) is not None), None)
        if color is None or kind.startswith("ShaderNodeVolume"):
            raise Unsupported(node.node.bl_label)
        self.remark(f"{node.node.bl_label} (rendered as Diffuse BSDF)")
        if self.has_room(principled=False):
            self.add("diffuse", weight, node, color=self.color(node, color))

    def _mix(self, node: Place, weight: Operand, depth: int) -> None:
        """Read both shaders of a Mix Shader, each with its part of the weight."""
        factor_socket, first, second = (node.beside(socket) for socket in node.node.inputs[:3])
        factor = self.values.value(factor_socket)
        if isinstance(factor, float):
            factor = min(max(factor, 0.0), 1.0)
            rest: Operand = 1.0 - factor
        else:
            factor = self.values.step("clamp", factor, 0.0, 1.0)
            rest = self.values.step("math", 1.0, factor, 0.0, kind="SUBTRACT")
        self.read(first, self.times(weight, rest), depth + 1)
        self.read(second, self.times(weight, factor), depth + 1)

    def times(self, a: Operand, b: Operand) -> Operand:
        """The product of two weights, without a step where it is known."""
        if isinstance(a, float) and isinstance(b, float):
            return a * b
        if is_constant(a, 1.0):
            return b
        if is_constant(b, 1.0):
            return a
        return self.values.step("math", a, b, 0.0, kind="MULTIPLY")

    def number(self, kind: str, *args: Operand) -> Operand:
        """The result of a Math node, without a step where it is known."""
        if all(isinstance(one, float) for one in args):
            return FOLDED[kind](*args)
        return self.values.step("math", *args, *(0.0,) * (3 - len(args)), kind=kind)

    def color(self, node: Place, name: str = "Color") -> Operand:
        """A colour input: the viewport's colour if an unsupported node drives it, 0 if the node has no such input."""
        place = node.input(name)
        return 0.0 if place is None else self.values.value(place, self.viewport)

    def emitted(self, color: Operand, strength: Operand) -> Operand:
        """Colour multiplied by strength."""
        if is_constant(strength, 1.0):
            return color
        if isinstance(color, tuple) and isinstance(strength, float):
            return tuple(c * strength for c in color[:3])
        return self.values.step("mix", 1.0, color, strength, kind="MULTIPLY")

    def total(self) -> Any:
        """The sum of what all shaders emit, as a colour or a step; None without any. Raises Unsupported.

        Background and emission are equivalent here; shaders that scatter have no meaning for worlds and lights.
        """
        total: Any = None
        for closure in self.closures:
            if closure.kind != "emission":
                self.remark(f"A {closure.kind} shader")
                continue
            part = self.emitted(closure.inputs["emission"], closure.inputs["weight"])
            part = (part,) * 3 if isinstance(part, float) else part
            if total is None:
                total = part
            elif isinstance(total, tuple) and isinstance(part, tuple):
                total = tuple(a + b for a, b in zip(total, part, strict=False))
            else:
                total = self.values.step("vector_math", total, part, 0.0, kind="ADD")
        return total

    def add(self, kind: str, weight: Operand, node: Place, *, multiscatter: bool = True, **inputs: Operand) -> None:
        """Append a closure, unless its weight is 0. Needs a preceding `has_room`."""
        if is_constant(weight, 0.0):
            return
        normal = self.vector(node, "Normal")
        self.closures.append(Closure(kind, {"weight": weight, **inputs}, normal, multiscatter))

    def walks(self, node: Place, method: str) -> None:
        """Let light scatter below the last closure by this method of the node."""
        if method == "BURLEY":
            self.remark(f"{node.node.bl_label}: Christensen-Burley (rendered as a random walk)")
        older = "RANDOM_WALK_LEGACY" not in METHODS_OF_BLENDER
        usual = "random_walk_legacy" if older else "random_walk"
        self.closures[-1] = replace(self.closures[-1], method=WALKS.get(method, usual))
        self.values.layers.apart = True

    def add_facets(self, kind: str, weight: Operand, node: Place, **inputs: Operand) -> None:
        """Append a closure with the node's distribution of facets. Needs a preceding `has_room`."""
        multiscatter = node.node.distribution == "MULTI_GGX"
        self.add(kind, weight, node, multiscatter=multiscatter, **inputs)
        distribution = DISTRIBUTIONS.get(node.node.distribution, "ggx")
        self.closures[-1] = replace(self.closures[-1], distribution=distribution)

    def stretched(self, node: Place, anisotropy: str, rotation: str) -> dict[str, Operand]:
        """The inputs of facets that are stretched along a tangent; none if they are not stretched."""
        amount = self.values.input(node, anisotropy)
        if is_constant(amount, 0.0):
            return {}
        tangent = self.vector(node, "Tangent")
        return {
            "anisotropy": amount,
            "rotation": self.values.input(node, rotation),
            "tangent": self.values.coordinate("tangent_z") if tangent is None else tangent,
        }

    def film(self, node: Place) -> dict[str, Operand]:
        """The inputs of a thin film; none without one."""
        thickness = self.values.input(node, "Thin Film Thickness")
        if is_constant(thickness, 0.0):
            return {}
        return {"film_thickness": thickness, "film_ior": self.values.input(node, "Thin Film IOR", 1.33)}

    def has_room(self, count: int = 1, *, principled: bool) -> bool:
        """Whether `count` more closures fit, one of them Principled. Notes the limit otherwise."""
        taken = sum(closure.kind == "principled" for closure in self.closures)
        if len(self.closures) + count <= MOST_CLOSURES and (not principled or taken < MOST_PRINCIPLED):
            return True
        self.remark(f"More than {MOST_CLOSURES} shaders, {MOST_PRINCIPLED} of them Principled,")
        return False

    def vector(self, node: Place, name: str) -> Operand | None:
        """The step that computes a normal or tangent; None for that of the surface."""
        place = node.input(name)
        if place is None:
            return None
        source = place.source()
        if not source.socket.is_output:
            return None
        operand = self.values.value(place)
        return operand if isinstance(operand, int) else None


def _principled(surface: Surface, node: Place, weight: Operand) -> None:
    values = surface.values
    thin = _is_thin(surface, node)
    # Convert the supported inputs.
    strength = values.input(node, "Emission Strength")
    dark = is_constant(strength, 0.0)
    emission = 0.0 if dark else surface.emitted(values.input(node, "Emission Color"), strength)
    more = {**surface.stretched(node, "Anisotropic", "Anisotropic Rotation"), **surface.film(node)}
    coat_normal = surface.vector(node, "Coat Normal")
    if coat_normal is not None:
        more["coat_normal"] = coat_normal
    sheen = values.input(node, "Sheen Weight")
    if not is_constant(sheen, 0.0):
        more["sheen_weight"] = sheen
        more["sheen_roughness"] = values.input(node, "Sheen Roughness", 0.5)
        more["sheen_tint"] = values.input(node, "Sheen Tint", (1.0, 1.0, 1.0))
    below = values.input(node, "Subsurface Weight")
    if thin and not is_constant(below, 0.0):
        # Light that scatters forward leaves on the other side.
        ahead = surface.number("MULTIPLY_ADD", values.input(node, "Subsurface Anisotropy"), 0.5, 0.5)
        more["translucency"] = surface.times(below, ahead)
    elif not is_constant(below, 0.0):
        more["subsurface_weight"] = below
        for key in ("Radius", "Scale", "IOR", "Anisotropy"):
            more[f"subsurface_{key.lower()}"] = values.input(node, f"Subsurface {key}")
    given: dict[str, Operand] = {}
    if thin and not is_constant(values.input(node, "Transmission Weight"), 0.0):
        weight, given = _with_thin_glass(surface, node, weight, 0.0 if dark else emission)
        emission = 0.0 if given else emission

    def own(key: str, name: str, absent: Operand = 0.0) -> Operand:
        return given[key] if key in given else values.input(node, name, absent)

    surface.add(
        "principled",
        weight,
        node,
        multiscatter=node.node.distribution == "MULTI_GGX",
        color=surface.color(node, "Base Color"),
        metallic=own("metallic", "Metallic"),
        roughness=values.input(node, "Roughness"),
        ior=values.input(node, "IOR"),
        transmission=own("transmission", "Transmission Weight"),
        specular=values.input(node, "Specular IOR Level"),
        specular_tint=values.input(node, "Specular Tint", (1.0, 1.0, 1.0)),
        emission=emission,
        alpha=own("alpha", "Alpha", 1.0),
        coat_weight=values.input(node, "Coat Weight"),
        coat_roughness=values.input(node, "Coat Roughness"),
        coat_ior=values.input(node, "Coat IOR", 1.5),
        coat_tint=values.input(node, "Coat Tint", (1.0, 1.0, 1.0)),
        diffuse_roughness=values.input(node, "Diffuse Roughness"),
        **more,
    )
    if "subsurface_weight" in more:
        surface.walks(node, node.node.subsurface_method)


def _is_thin(surface: Surface, node: Place) -> bool:
    """Whether a Principled BSDF is a sheet without thickness."""
    place = node.input("Thin Wall")
    if place is None:
        return False
    socket = place.source().socket
    if socket.is_output:
        surface.remark("Principled BSDF: a Thin Wall that varies")
        return False
    return bool(socket.default_value)


def _with_thin_glass(
    surface: Surface, node: Place, weight: Operand, emission: Operand
) -> tuple[Operand, dict[str, Operand]]:
    """Add closures for the glass of a thin Principled BSDF, for its emission and its transparency. Returns the weight
    of the rest, and its inputs that differ from the node's; those of the node if there is no room.
    """
    if not surface.has_room(OF_GLASS, principled=True):
        return weight, {}
    values, metallic = surface.values, surface.values.input(node, "Metallic")
    alpha = values.input(node, "Alpha", 1.0)
    whole, weight = weight, surface.times(weight, alpha)
    surface.add("transparent", surface.times(whole, surface.number("SUBTRACT", 1.0, alpha)), node, color=1.0)
    if not is_constant(emission, 0.0):
        surface.add("emission", weight, node, emission=emission)
    share = surface.times(surface.number("SUBTRACT", 1.0, metallic), values.input(node, "Transmission Weight"))
    _thin_glass(surface, node, surface.times(weight, share))
    left = surface.number("SUBTRACT", 1.0, share)
    inputs = {"metallic": surface.number("DIVIDE", metallic, left), "transmission": 0.0, "alpha": 1.0}
    return surface.times(weight, left), inputs


def _thin_glass(surface: Surface, node: Place, weight: Operand) -> None:
    """Add a sheet of glass without thickness, between whose sides light goes back and forth. As in Cycles: the sums of
    the reflections by Fresnel's equations and of the absorption; light that passes goes straight on.
    """
    values = surface.values
    roughness, ior = values.input(node, "Roughness"), values.input(node, "IOR", 1.5)
    if not (isinstance(roughness, float) and roughness < SHARPEST):
        surface.remark("Principled BSDF: rough transmission of a Thin Wall (rendered sharp)")

    def math(kind: str, *args: Operand) -> Operand:
        return values.step("math", *args, *(0.0,) * (3 - len(args)), kind=kind)

    def vector(kind: str, *args: Operand) -> Operand:
        return values.step("vector_math", *args, *(0.0,) * (3 - len(args)), kind=kind)

    # The index is that of the glass on both sides, where Fresnel's node takes the reciprocal behind a surface.
    side = math("MULTIPLY_ADD", values.coordinate("backfacing"), -2.0, 1.0)
    reflected = values.step("fresnel", math("POWER", ior, side))
    # The way through the sheet grows with the reciprocal of the cosine within the glass.
    cosine = math("SUBTRACT", 1.0, values.step("layer_facing", 0.5))
    sine = math("DIVIDE", math("SUBTRACT", 1.0, math("MULTIPLY", cosine, cosine)), math("MULTIPLY", ior, ior))
    longer = math("INVERSE_SQRT", math("SUBTRACT", 1.0, sine))
    tint = values.step("gamma", vector("MINIMUM", surface.color(node, "Base Color"), (1.0,) * 3), longer)
    # Add up what leaves on either side.
    once, entered = vector("MULTIPLY", tint, reflected), math("SUBTRACT", 1.0, reflected)
    through = vector("MULTIPLY", tint, math("MULTIPLY", entered, entered))
    passed = vector("DIVIDE", through, vector("SUBTRACT", (1.0,) * 3, vector("MULTIPLY", once, once)))
    surface.add("transparent", weight, node, color=passed)
    returned = vector("MULTIPLY_ADD", passed, once, reflected)
    surface.add("glossy", weight, node, color=returned, roughness=roughness)


def _subsurface(surface: Surface, node: Place, weight: Operand) -> None:
    values = surface.values
    surface.add(
        "subsurface",
        weight,
        node,
        color=surface.color(node),
        roughness=values.input(node, "Roughness", 1.0),
        subsurface_radius=values.input(node, "Radius"),
        subsurface_scale=values.input(node, "Scale"),
        subsurface_ior=values.input(node, "IOR"),
        subsurface_anisotropy=values.input(node, "Anisotropy"),
    )
    surface.walks(node, node.node.falloff)


def _diffuse(surface: Surface, node: Place, weight: Operand) -> None:
    roughness = surface.values.input(node, "Roughness")
    surface.add("diffuse", weight, node, color=surface.color(node), diffuse_roughness=roughness)


def _translucent(surface: Surface, node: Place, weight: Operand) -> None:
    surface.add("translucent", weight, node, color=surface.color(node))


def _glossy(surface: Surface, node: Place, weight: Operand) -> None:
    surface.add_facets(
        "glossy",
        weight,
        node,
        color=surface.color(node),
        roughness=surface.values.input(node, "Roughness"),
        **surface.stretched(node, "Anisotropy", "Rotation"),
    )


def _metallic(surface: Surface, node: Place, weight: Operand) -> None:
    values = surface.values
    more = {**surface.stretched(node, "Anisotropy", "Rotation"), **surface.film(node)}
    roughness = values.input(node, "Roughness")
    if node.node.fresnel_type != "F82":
        index, extinction = values.input(node, "IOR"), values.input(node, "Extinction")
        surface.add_facets("conductor", weight, node, color=index, extinction=extinction, roughness=roughness, **more)
        return
    surface.add_facets(
        "principled",
        weight,
        node,
        metallic=1.0,
        color=surface.color(node, "Base Color"),
        specular_tint=values.input(node, "Edge Tint"),
        roughness=roughness,
        **more,
    )


def _glass(surface: Surface, node: Place, weight: Operand) -> None:
    _boundary(surface, node, weight, "glass")


def _refraction(surface: Surface, node: Place, weight: Operand) -> None:
    _boundary(surface, node, weight, "refraction")


def _boundary(surface: Surface, node: Place, weight: Operand, kind: str) -> None:
    values = surface.values
    surface.add_facets(
        kind,
        weight,
        node,
        color=surface.color(node),
        roughness=values.input(node, "Roughness"),
        ior=values.input(node, "IOR"),
        **surface.film(node),
    )


def _sheen(surface: Surface, node: Place, weight: Operand) -> None:
    kind = "velvet" if node.node.distribution == "ASHIKHMIN" else "sheen"
    surface.add(kind, weight, node, color=surface.color(node), roughness=surface.values.input(node, "Roughness"))


def _toon(surface: Surface, node: Place, weight: Operand) -> None:
    kind = "toon_glossy" if node.node.component == "GLOSSY" else "toon_diffuse"
    size, smooth = surface.values.input(node, "Size"), surface.values.input(node, "Smooth")
    surface.add(kind, weight, node, color=surface.color(node), roughness=size, smooth=smooth)


def _holdout(surface: Surface, node: Place, weight: Operand) -> None:
    surface.add("holdout", weight, node)


def _emission(surface: Surface, node: Place, weight: Operand) -> None:
    values = surface.values
    light = surface.emitted(values.input(node, "Color"), values.input(node, "Strength"))
    surface.add("emission", weight, node, emission=light)


def _transparent(surface: Surface, node: Place, weight: Operand) -> None:
    surface.add("transparent", weight, node, color=surface.color(node))


SHADERS: dict[str, Callable[[Surface, Place, Any], None]] = {
    "ShaderNodeBsdfPrincipled": _principled,
    "ShaderNodeBsdfDiffuse": _diffuse,
    "ShaderNodeBsdfTranslucent": _translucent,
    "ShaderNodeBsdfAnisotropic": _glossy,
    "ShaderNodeBsdfGlossy": _glossy,
    "ShaderNodeBsdfMetallic": _metallic,
    "ShaderNodeBsdfGlass": _glass,
    "ShaderNodeBsdfRefraction": _refraction,
    "ShaderNodeBsdfSheen": _sheen,
    "ShaderNodeBsdfToon": _toon,
    "ShaderNodeBsdfHair": shaders.hair,
    "ShaderNodeBsdfHairPrincipled": shaders.principled_hair,
    "ShaderNodeSubsurfaceScattering": _subsurface,
    "ShaderNodeHoldout": _holdout,
    "ShaderNodeEmission": _emission,
    "ShaderNodeBackground": _emission,
    "ShaderNodeBsdfTransparent": _transparent,
}

PRINCIPLED = frozenset(["ShaderNodeBsdfPrincipled", "ShaderNodeBsdfMetallic"])
"""Nodes that become a closure of the kind principled."""
