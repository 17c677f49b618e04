# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of files that an earlier or later version of this extension has saved.

Blender stores a choice as a number, and shows a number that none of today's options has as an empty name.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ...core.base.notes import Notes
    from ...core.structures.catalogue import Parameter, Structure, Value

REPLACED = "Settings of the file that this version lacks, replaced by"
"""Note on the label and today's value of each such setting."""


def number_of(option: str) -> int:
    """The number that files store for an option of a parameter; it does not depend on the list of options."""
    return zlib.crc32(option.encode()) & 0x7FFF_FFFF


def choice(group: Any, name: str) -> str:
    """The value of an EnumProperty of a group; its default if the file's value is unknown to this version."""
    return getattr(group, name) or group.bl_rna.properties[name].default


def parameters(group: Any, structure: Structure) -> dict[str, Value]:
    """Values in a `scene.halfspace` group of the parameters of a structure; unknown choices read as an empty name."""
    return {one.name: getattr(group, one.name) for one in structure.parameters}


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
