# SPDX-License-Identifier: GPL-3.0-or-later
"""Which parameters of a structure have an effect in a configuration, and where a panel shows them.

A parameter that has none is neither shown nor written into a configuration. `tests/core/structures/test_relevance.py`
builds every structure with several values of every parameter and compares the trees.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .catalogue import Parameter, Structure, Value

NODES, TRAVERSAL = "nodes", "traversal"
"""Names of the parameters that choose how rays are traced; all others choose the tree."""

GROUPS = ("main", "builder", "costs", "numerics")
"""Parts of a panel, in order: the first is always open."""

OF_GROUP = {
    "main": ("k", "alpha", "tried", "width", "n", "density", "frames", "slabs", "children", NODES, TRAVERSAL, "shadow"),
    "costs": (
        *("costs", "step_cost", "oblique_cost", "oblique_step_cost", "leaf_cost", "triangle_cost"),
        *("empty_factor", "empty", "area_stop", "enough", "rule"),
    ),
    "numerics": ("robust", "ties", "slab", "clip", "leaves"),
}
"""Parameters of each group in the order of the panel, for registry rows without a group; the builder has the others."""

Values = Mapping[str, "Value"]

_PRICES = ("step_cost", "oblique_cost", "leaf_cost", "triangle_cost", "empty_factor", "area_stop")
_LAZY = ("auto", "dir", "tile", "tile8")


def _is(name: str, *choices: Value) -> Callable[[Structure, Values], bool]:
    """A condition: the structure has the parameter, and its value is one of these."""
    return lambda _structure, values: values.get(name) in choices


def _axes_alone(structure: Structure, values: Values) -> bool:
    """Whether K leaves only the axes, in a tree that tries them anyway."""
    return values.get("k") == 3 and any(structure.parameter(name) for name in ("alpha", "enough", "oblique_step_cost"))


def _in_one_piece(_structure: Structure, values: Values) -> bool:
    """Whether the traversal or the shadow rays need the whole tree at once."""
    return (
        values.get(TRAVERSAL) not in _LAZY
        or values.get(NODES, "planes") != "planes"
        or values.get("shadow", "none") == "beam"
    )


WITHOUT_EFFECT: tuple[tuple[Callable[[Structure, Values], bool], tuple[str, ...]], ...] = (
    # Only trees with a linear cost of oblique nodes price steps through other nodes on their own.
    (lambda one, _: one.parameter("oblique_cost") is not None and one.parameter("alpha") is None, ("step_cost",)),
    (_is("costs", "thesis"), (*_PRICES, "k_small", "enough")),
    # These trees are then the kd-tree.
    (
        lambda one, values: values.get("k") == 3 and one.parameter("alpha") is not None,
        ("alpha", "set", "seed", "k_small", "rule", "slab", "enough", "axes_depth", "oblique_cost"),
    ),
    (_axes_alone, ("seed", "k_small", "enough", "axes_depth", "oblique_step_cost")),
    (lambda one, values: values.get("k") == 3 and one.parameter("set") is not None, ("axes_depth",)),
    (_is("alpha", 0, 0.0), ("rule",)),
    (_is("frames", 1), ("oblique_step_cost",)),
    (_in_one_piece, ("lazy",)),
)
"""Conditions, and the parameters that have no effect where they hold."""


def group(parameter: Parameter) -> str:
    """The part of a panel that shows a parameter: one of GROUPS."""
    if parameter.group in GROUPS:
        return parameter.group
    return next((key for key, names in OF_GROUP.items() if parameter.name in names), "builder")


def grouped(structure: Structure, values: Values) -> dict[str, list[Parameter]]:
    """The parameters that have an effect, by group. values: as `effective` returns them."""
    found: dict[str, list[Parameter]] = {key: [] for key in GROUPS}
    for parameter in relevant(structure, values):
        found[group(parameter)].append(parameter)
    order = {name: place for names in OF_GROUP.values() for place, name in enumerate(names)}
    for parameters in found.values():
        parameters.sort(key=lambda parameter: order.get(parameter.name, len(order)))
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
    # Only boxes of eight have kernels for several rays.
    if values.get("width", "8") != "8":
        options = tuple(option for option in options if option == "ordered")
    return options


def options(structure: Structure, parameter: Parameter, values: Values) -> tuple[str, ...]:
    """The valid options of a choice with the other values."""
    return traversals(structure, values) if parameter.name == TRAVERSAL else parameter.options


def effective(structure: Structure, values: Values) -> dict[str, Value]:
    """A valid value for each parameter: the given one, or the nearest, or the default."""
    found = {one.name: one.clamp(values.get(one.name, one.default)) for one in structure.parameters}
    offered = traversals(structure, found)
    if offered and found[TRAVERSAL] not in offered:
        parameter = structure.parameter(TRAVERSAL)
        assert parameter is not None, "it has options"
        found[TRAVERSAL] = parameter.default if parameter.default in offered else offered[0]
    return found


def relevant(structure: Structure, values: Values) -> tuple[Parameter, ...]:
    """The parameters that have an effect. values: as `effective` returns them."""
    without = {name for holds, names in WITHOUT_EFFECT if holds(structure, values) for name in names}
    return tuple(one for one in structure.parameters if one.name not in without)
