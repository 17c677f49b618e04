# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of a structure that have an effect in a configuration, and their parts of a panel.

The native module decides. A parameter without effect is neither shown nor written into a configuration.
`tests/core/structures/test_relevance.py` builds every structure with several values of every parameter and compares the
trees.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ..base import native
from . import specs

if TYPE_CHECKING:
    from .catalogue import Parameter, Structure, Value

NODES, TRAVERSAL = "nodes", "traversal"
"""Names of the parameters that choose how rays are traced; all others choose the tree."""

GROUPS = ("main", "builder", "costs", "numerics")
"""Parts of a panel, in order: the first is always open."""

Values = Mapping[str, "Value"]

Effective = Mapping[str, "Value | None"]
"""As `effective` returns it."""


def effective(structure: Structure, values: Values) -> dict[str, Value | None]:
    """A valid value for each parameter, the given one, or the nearest, or the default; None if it has no effect."""
    return native.load().effective(_spelled(structure, values))


def options(structure: Structure, values: Values) -> dict[str, list[str]]:
    """The options of each choice that are valid with the other values."""
    return native.load().options(_spelled(structure, values))


def _spelled(structure: Structure, values: Values) -> str:
    """The configuration of these values, also if they contradict each other. An empty choice has no value."""
    given = {one.name: values[one.name] for one in structure.parameters if values.get(one.name, "") != ""}
    return specs.joined(structure.id, *(f"{name}={value}" for name, value in given.items()))


def relevant(structure: Structure, found: Effective) -> tuple[Parameter, ...]:
    """The parameters that have an effect."""
    return tuple(one for one in structure.parameters if found[one.name] is not None)


def grouped(structure: Structure, found: Effective) -> dict[str, list[Parameter]]:
    """The parameters that have an effect, by group, in the registry's order."""
    parts: dict[str, list[Parameter]] = {key: [] for key in GROUPS}
    for parameter in relevant(structure, found):
        parts[parameter.group].append(parameter)
    return parts
