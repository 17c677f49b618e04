# SPDX-License-Identifier: GPL-3.0-or-later
"""Which parameters of a structure have an effect in a configuration, and where a panel shows them.

A parameter that has none is neither shown nor written into a configuration. `tests/core/structures/test_relevance.py`
builds every structure with several values of every parameter and compares the trees.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .catalogue import Need, Parameter, Structure, Value

NODES, TRAVERSAL = "nodes", "traversal"
"""Names of the parameters that choose how rays are traced; all others choose the tree."""

GROUPS = ("main", "builder", "costs", "numerics")
"""Parts of a panel, in order: the first is always open."""

Values = Mapping[str, "Value"]


def grouped(structure: Structure, values: Values) -> dict[str, list[Parameter]]:
    """The parameters that have an effect, by group, in the registry's order. values: as `effective` returns them."""
    found: dict[str, list[Parameter]] = {key: [] for key in GROUPS}
    for parameter in relevant(structure, values):
        found[parameter.group].append(parameter)
    return found


def traversals(structure: Structure, values: Values) -> tuple[str, ...]:
    """The values of the parameter `traversal` that are valid with the other values; empty without that parameter."""
    parameter = structure.parameter(TRAVERSAL)
    if parameter is None:
        return ()
    options = parameter.options
    nodes = structure.parameter(NODES)
    if nodes is not None and structure.ways:
        chosen = nodes.clamp(values.get(NODES, nodes.default))
        able = {way.traversal for way in structure.ways if way.nodes == chosen}
        options = tuple(option for option in options if option in able)
    # Keep the options that the non-default values of the main group need, such as a width of nodes.
    needs = (
        need
        for one in structure.parameters
        if one.group == "main" and values.get(one.name, one.default) != one.default
        for need in one.needs
        if need.key == TRAVERSAL
    )
    for need in needs:
        options = tuple(filter(need.holds, options))
    return options


def options(structure: Structure, parameter: Parameter, values: Values) -> tuple[str, ...]:
    """The options of a choice that are valid with the other values."""
    offered = traversals(structure, values) if parameter.name == TRAVERSAL else parameter.options
    return tuple(one for one in offered if _hold(parameter.option_needs.get(one, ()), values))


def effective(structure: Structure, values: Values) -> dict[str, Value]:
    """A valid value for each parameter: the given one, or the nearest, or the default."""
    found = {one.name: one.clamp(values.get(one.name, one.default)) for one in structure.parameters}
    for parameter in structure.parameters:
        if parameter.kind == "choice":
            offered = options(structure, parameter, found)
            if found[parameter.name] not in offered:
                found[parameter.name] = parameter.default if parameter.default in offered else offered[0]
    return found


def relevant(structure: Structure, values: Values) -> tuple[Parameter, ...]:
    """The parameters that have an effect. values: as `effective` returns them."""
    return tuple(one for one in structure.parameters if has_effect(one, values))


def has_effect(parameter: Parameter, values: Values) -> bool:
    """Whether these values meet all needs of a parameter; needs on parameters without a value count as met."""
    return _hold(parameter.needs, values)


def _hold(needs: Iterable[Need], values: Values) -> bool:
    return all(need.holds(values[need.key]) for need in needs if need.key in values)
