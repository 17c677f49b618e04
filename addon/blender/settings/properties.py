# SPDX-License-Identifier: GPL-3.0-or-later
"""`scene.halfspace` and `view_layer.halfspace`; the properties of structures are generated from the catalogue."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty

from ...core.base import native
from ...core.measure import costmap
from ...core.scene.instances import TOPS
from ...core.structures import catalogue, relevance, settings
from . import quality, signals, stored
from .inspector_settings import HalfspaceInspectorSettings
from .overlay_settings import HalfspaceOverlaySettings

if TYPE_CHECKING:
    from ...core.base.notes import Notes
    from ...core.structures.catalogue import Catalogue, Parameter, Structure, Value


TWO_LEVELS = (
    "A tree for each mesh and one over the instances. Whitted's integrator always flattens if a material emits light"
)


UNKNOWN = "The file's structure is unknown to this version, replaced by"
"""Note on the structure's label that follows."""


def structure(group: Any) -> Structure:
    """The structure chosen in a `scene.halfspace` group; the default if the file's structure is unknown to this
    version.

    An unknown choice reads as an empty name.
    """
    known = catalogue.load()
    return known.get(group.structure) or known.default


def remark_unknown(group: Any, notes: Notes) -> None:
    """Note if the structure of a `scene.halfspace` group, or a value of its parameters, replaces one of its file."""
    if not group.structure:
        notes.add(UNKNOWN, structure(group).label)
    stored.remark_parameters(group, structure(group), values(group), notes)


def structure_parameters(group: Any) -> tuple[Parameter, ...]:
    """The parameters of the structure chosen in a `scene.halfspace` group."""
    return structure(group).parameters


def values(group: Any) -> dict[str, Value | None]:
    """The values in a `scene.halfspace` group of the parameters of its structure, made valid together; None for those
    without effect.
    """
    chosen = structure(group)
    return relevance.effective(chosen, stored.parameters(group, chosen))


def shown(group: Any) -> dict[str, list[Parameter]]:
    """The parameters that have an effect, by the part of the panel that shows them."""
    return relevance.grouped(structure(group), values(group))


def options(group: Any, name: str) -> tuple[tuple[str, str], ...]:
    """The options of a choice that are valid with the other settings, each with its label."""
    chosen = structure(group)
    parameter = chosen.parameter(name)
    if parameter is None:
        return ()
    valid = relevance.options(chosen, stored.parameters(group, chosen)).get(name, ())
    return tuple((option, parameter.label_of(option)) for option in valid)


def spec(group: Any) -> str:
    """The configuration string of a `scene.halfspace` group. Raises native.NativeError."""
    chosen = structure(group)
    return settings.spec(chosen, stored.parameters(group, chosen))


def _follow_structure(group: Any, context: Any) -> None:
    """Set the chosen structure's defaults, but keep the user's values: those that are no structure's default."""
    known = catalogue.load()
    for parameter in known[group.structure].parameters:
        value = getattr(group, parameter.name)
        namesakes = (structure.parameter(parameter.name) for structure in known.structures)
        if any(other is not None and settings.same(value, other.default) for other in namesakes):
            setattr(group, parameter.name, parameter.default)
    _rebuild(group, context)


def _rebuild(group: Any, _context: Any) -> None:
    """Rebuild a shown structure after a change of its settings."""
    signals.structure_changed.fire(group.id_data)


def _structure_properties(known: Catalogue) -> dict[str, Any]:
    properties: dict[str, Any] = {
        "structure": EnumProperty(
            name="Structure",
            description="The acceleration structure that finds the hits of rays. All of them give the same picture",
            items=_structure_items(known),
            default=known.default.id,
            update=_follow_structure,
        ),
    }
    for parameter in known.parameters().values():
        properties[parameter.name] = _parameter_property(parameter)
        if parameter.is_switch:
            properties[switch(parameter.name)] = _switch_property(parameter)
    return properties | _map_properties(known)


def by_family(structures: Iterable[Structure]) -> dict[str, list[Structure]]:
    """Structures under the headings of a menu."""
    found: dict[str, list[Structure]] = {}
    for one in structures:
        found.setdefault(one.heading.title(), []).append(one)
    return found


def _structure_items(known: Catalogue) -> list[tuple[Any, ...]]:
    """The items of the menu of structures: Blender begins a column at each item without identifier."""
    items: list[tuple[Any, ...]] = []
    for heading, structures in by_family(known.structures).items():
        items.append(("", heading, ""))
        items += [(s.id, s.label, f"{s.summary} {s.paper}", s.code) for s in structures]
    return items


def _map_properties(known: Catalogue) -> dict[str, Any]:
    """The properties of the cost maps."""
    # The number 0 means no second structure, so codes are shifted by one.
    others = [(s.id, s.label, f"{s.summary} {s.paper}", s.code + 1) for s in known.structures]
    return {
        "cost": EnumProperty(
            name="Cost",
            description="The quantity that the colours of the map show",
            items=[(q.key, q.label, q.doc, q.code) for q in costmap.QUANTITIES],
            default="STEPS",
        ),
        "second": EnumProperty(
            name="Beside",
            description="Another structure, with its default parameters, next to the first: its cost map on the same "
            "scale, its worst rays and its levels for the same rays",
            items=[("NONE", "Nothing", "One structure only", 0), *others],
            default="NONE",
        ),
    }


def _parameter_property(parameter: Parameter) -> Any:
    common = {
        "name": parameter.label,
        "description": parameter.doc + (f" ({parameter.unit})" if parameter.unit else ""),
        "default": parameter.default,
        "update": _rebuild,
    }
    if parameter.kind == "choice":
        items = [(o, parameter.label_of(o), "", stored.number_of(o)) for o in parameter.options]
        return EnumProperty(items=items, **common)
    bounds = {
        key: value for key, value in (("min", parameter.minimum), ("max", parameter.maximum)) if value is not None
    }
    if parameter.kind == "integer":
        limit = 2**31 - 1
        return IntProperty(**common, **{key: min(max(int(v), -limit), limit) for key, v in bounds.items()})
    return FloatProperty(**common, **bounds, precision=3)


def switch(name: str) -> str:
    """Name of the property that shows a choice between 0 and 1 as a check box."""
    return f"use_{name}"


def _switch_property(parameter: Parameter) -> Any:
    """A check box over a choice between 0 and 1, which files and presets store."""
    name = parameter.name

    def read(group: Any) -> bool:
        return bool(getattr(group, name) == "1")

    def write(group: Any, on: bool) -> None:
        setattr(group, name, "1" if on else "0")

    return BoolProperty(
        name=parameter.label, description=parameter.doc, default=parameter.default == "1", get=read, set=write
    )


BUILD_PROPERTIES: dict[str, Any] = {
    "automatic": BoolProperty(
        name="Choose for Me",
        description="Let each final render choose structure and parameters for its scene and number of samples. Takes "
        "a moment before the render; the statistics show the choice and its reasons",
        default=False,
    ),
    "memory_limit": IntProperty(
        name="Memory Limit",
        description="Megabytes that the build of the structure may use; a build that needs more ends with an error. "
        "0 is most of the free memory",
        default=0,
        min=0,
    ),
    "instancing": EnumProperty(
        name="Instances",
        description="Whether a mesh with many instances is stored once, with its own tree, or copied for each of them. "
        "The picture is the same",
        items=[
            ("auto", "Automatic", "Keep instances where that saves memory or, in the viewport, time to rebuild", 0),
            ("flatten", "Flatten", "One tree over all copies: more memory, faster rays", 1),
            ("two-level", "Two Levels", TWO_LEVELS, 2),
        ],
        default="auto",
    ),
    "top": EnumProperty(
        name="Top",
        description="How the tree over instances is built, above the structure of each mesh. The picture is the same",
        items=[
            ("sah", "Surface Area", "By the surface area heuristic, as in a bounding volume hierarchy", 0),
            ("grid", "Grid", "By the cells of a regular grid, as in a bounding interval hierarchy", 1),
            ("middle", "Middle", "In the middle of the longest side of a node's box", 2),
            ("median", "Median", "Half of the instances on either side, along the longest side of a node's box", 3),
        ],
        default=TOPS[0],
    ),
    "overlay": PointerProperty(type=HalfspaceOverlaySettings),
    "inspector": PointerProperty(type=HalfspaceInspectorSettings),
}


class HalfspaceViewLayerSettings(bpy.types.PropertyGroup):
    """The passes without a switch in Blender."""

    use_pass_volume_direct: BoolProperty(  # type: ignore[valid-type]
        name="Volume Direct", description="Light that a volume scatters first, from a light", default=False
    )
    use_pass_volume_indirect: BoolProperty(  # type: ignore[valid-type]
        name="Volume Indirect",
        description="Light that a volume scatters first, from other volumes and surfaces",
        default=False,
    )
    use_pass_shadow_catcher: BoolProperty(  # type: ignore[valid-type]
        name="Shadow Catcher",
        description="Factor by which other objects change the light of shadow catchers: multiply photographs by it. "
        "Without this pass, Combined holds the shadow",
        default=False,
    )
    use_pass_albedo: BoolProperty(  # type: ignore[valid-type]
        name="Denoising Albedo",
        description="Share of white light that each pixel's first surface scatters: with Normal, an input of the "
        "compositor's Denoise node",
        default=False,
    )
    use_pass_samples: BoolProperty(  # type: ignore[valid-type]
        name="Sample Count", description="Number of samples of each pixel", default=False
    )
    use_pass_depth: BoolProperty(  # type: ignore[valid-type]
        name="Leaf Depth",
        description="Depth of the last leaf that each pixel's camera rays are tested against. Slow; 0 "
        "where instances are kept",
        default=False,
    )
    use_pass_steps: BoolProperty(  # type: ignore[valid-type]
        name="Traversal Steps", description="Number of nodes that each pixel's camera rays visit", default=False
    )
    use_pass_tests: BoolProperty(  # type: ignore[valid-type]
        name="Triangle Tests",
        description="Number of triangles that each pixel's camera rays are tested against",
        default=False,
    )


TICKED = ("bvh-sah", "kd", "octree-net")
"""Structures that are compared by default."""


def tick(structure_id: str) -> str:
    """Name of the property of `scene.halfspace.compared` that includes this structure."""
    return structure_id.replace("-", "_")


def _ticks(known: Catalogue) -> dict[str, Any]:
    return {
        tick(structure.id): BoolProperty(
            name=structure.label, description=f"{structure.summary} {structure.paper}", default=structure.id in TICKED
        )
        for structure in known.structures
    }


_registered: list[type] = []


def register() -> None:
    """Register the property groups; without a native module the scene has only the properties that need
    no catalogue.
    """
    properties = {**BUILD_PROPERTIES, **quality.PROPERTIES}
    if native.problem() is None:  # otherwise the panel and every render report it; stored values stay in the file
        ticks = {"__annotations__": _ticks(catalogue.load())}
        compared = type("HalfspaceCompared", (bpy.types.PropertyGroup,), ticks)
        bpy.utils.register_class(compared)
        _registered.append(compared)
        properties |= _structure_properties(catalogue.load())
        properties["compared"] = PointerProperty(type=compared)
    scene_settings = type("HalfspaceSettings", (bpy.types.PropertyGroup,), {"__annotations__": properties})
    for group, owner in ((scene_settings, bpy.types.Scene), (HalfspaceViewLayerSettings, bpy.types.ViewLayer)):
        bpy.utils.register_class(group)
        _registered.append(group)
        owner.halfspace = PointerProperty(type=group)


def unregister() -> None:
    """Undo `register`."""
    del bpy.types.ViewLayer.halfspace
    del bpy.types.Scene.halfspace
    while _registered:
        bpy.utils.unregister_class(_registered.pop())
