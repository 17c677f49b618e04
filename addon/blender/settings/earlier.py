# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of files that an earlier or later version of this extension has saved.

Blender stores a choice as a number, and shows a number that none of today's options has as an empty name.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from functools import cache
from typing import TYPE_CHECKING, Any

from ...core.base import native
from ...core.structures import catalogue, presets, relevance, specs

if TYPE_CHECKING:
    from ...core.base.notes import Notes
    from ...core.structures.catalogue import Parameter, Structure, Value

SPELLINGS = ("p16", "p8", "p4", "tile8", "wide", "boxes")
"""Values of `traversal` of earlier versions, for which the native module has today's."""

REPLACED = "Settings of the file that this version lacks, replaced by"
"""Note on the label and today's value of each such setting."""


def number_of(option: str) -> int:
    """The number that files store for an option of a parameter; it does not depend on the list of options."""
    return zlib.crc32(option.encode()) & 0x7FFF_FFFF


def choice(group: Any, name: str) -> str:
    """The value of an EnumProperty of a group; its default if the file's value is unknown to this version."""
    return getattr(group, name) or group.bl_rna.properties[name].default


def parameters(group: Any, structure: Structure) -> dict[str, Value]:
    """The values in a `scene.halfspace` group of the parameters of a structure.

    Former values of the traversal are translated; other unknown choices read as an empty name.
    """
    found: dict[str, Value] = {one.name: getattr(group, one.name) for one in structure.parameters}
    if found.get(relevance.TRAVERSAL) == "":
        found |= _translated(structure.id, _stored(group, relevance.TRAVERSAL))
    return found


def remark_parameters(group: Any, structure: Structure, today: dict[str, Value | None], notes: Notes) -> None:
    """Note each parameter of a structure whose value in the file is not valid.

    today: the values that replace them, None for parameters without effect.
    """
    given = parameters(group, structure)
    for one in structure.parameters:
        value = today[one.name]
        if value is not None and one.clamp(given[one.name]) != given[one.name]:
            notes.add(REPLACED, f"{one.label} {_text(one, value)}")


def remark_choices(group: Any, names: Iterable[str], notes: Notes) -> None:
    """Note each of these EnumProperties of a group whose value in the file is unknown to this version."""
    for name in names:
        if not getattr(group, name):
            rna = group.bl_rna.properties[name]
            notes.add(REPLACED, f"{rna.name} {rna.enum_items[rna.default].name}")


def _text(parameter: Parameter, value: Value) -> str:
    return parameter.label_of(value) if isinstance(value, str) else f"{value:g}"


def _stored(group: Any, name: str) -> int:
    """The number that a scene's file holds for a choice."""
    scene = group.id_data
    held = scene.bl_system_properties_get() if hasattr(scene, "bl_system_properties_get") else scene
    return int(held["halfspace"][name])


@cache
def _translated(structure: str, stored: int) -> dict[str, Value]:
    """Today's nodes and traversal for the stored number of a former traversal; empty for any other number."""
    spelled = next((one for one in SPELLINGS if number_of(one) == stored), None)
    if spelled is None:
        return {}
    try:
        today = specs.canonical(native.load(), specs.joined(structure, f"{relevance.TRAVERSAL}={spelled}"))
    except specs.SpecError:  # this structure never had it
        return {}
    values = presets.settings(catalogue.load(), today)[1]
    return {name: values[name] for name in (relevance.NODES, relevance.TRAVERSAL) if name in values}
