# SPDX-License-Identifier: GPL-3.0-or-later
"""Comparable configurations of a structure: one ray at a time, and as fast as it goes.

A benchmark shows two tables. *single* traces every structure one ray at a time through its own nodes; *fastest* traces
each with the quickest kernels for each kind of its nodes. Other configurations are in *chosen*.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from . import catalogue, specs

if TYPE_CHECKING:
    from ..base.interface import Native
    from .catalogue import Catalogue, Structure, Way

Table = Literal["single", "fastest", "chosen"]

KEYS = ("nodes", "traversal")
"""Parameters that choose a way of tracing; all others choose the tree."""


def is_spelled(spec: str) -> bool:
    """Whether a configuration chooses its nodes or its traversal."""
    return any(key in KEYS for key, _ in specs.pairs(spec))


def tree_of(spec: str) -> str:
    """A configuration without the keys of its nodes and its traversal: what remains is the tree."""
    return specs.without(spec, KEYS)


def own_nodes(structure: Structure) -> str:
    """The kind of nodes that the structure is made of, without a conversion."""
    parameter = structure.parameter("nodes")
    if parameter is not None:
        return str(parameter.default)
    singles = [way.nodes for way in structure.ways if way.rays == "single"]
    return singles[0] if singles else structure.ways[0].nodes if structure.ways else "none"


def nodes_of(spec: str) -> str:
    """The kind of nodes that a configuration's structure is made of; "none" for brute force."""
    return own_nodes(catalogue.load()[specs.structure_of(spec)])


def way_of(structure: Structure, spec: str) -> Way | None:
    """The way that a configuration in the native spelling chooses; None for one that does not exist."""
    given = dict(specs.pairs(spec))
    defaults = {key: parameter.default for key in KEYS if (parameter := structure.parameter(key)) is not None}
    nodes = given.get("nodes", defaults.get("nodes"))
    traversal = given.get("traversal", defaults.get("traversal"))
    able = (way for way in structure.ways if nodes in (None, way.nodes) and traversal in (None, way.traversal))
    return next(able, None)


def single(structure: Structure, tree: str) -> str | None:
    """The configuration that traces a tree one ray at a time through its own nodes; None if there is none.

    tree: a configuration without nodes and traversal.
    """
    own = own_nodes(structure)
    if _is_only_single(structure, own):
        return tree
    return next((spelled(structure, tree, way) for way in structure.ways if _is_single(way, own)), None)


def fastest(structure: Structure, tree: str) -> list[str]:
    """The configurations that trace a tree with the quickest kernels, one for each kind of its nodes.

    tree: a configuration without nodes and traversal.
    """
    return [spelled(structure, tree, way) for way in _fastest(structure)] or [tree]


def tables(structure: Structure, spec: str) -> tuple[Table, ...]:
    """The tables that show a configuration in the native spelling; both where there is only one way to trace it."""
    way, own = way_of(structure, spec), own_nodes(structure)
    if way is None:
        return ("chosen",)
    found: list[Table] = []
    if _is_single(way, own) or (way.nodes == own and _is_only_single(structure, own)):
        found.append("single")
    if way in _fastest(structure):
        found.append("fastest")
    return tuple(found) or ("chosen",)


def is_quickest(structure: Structure, spec: str) -> bool:
    """Whether a configuration in the native spelling is the one of `fastest` that is usually the quickest: that through
    boxes, where planes can be made into them, else that through the structure's own nodes (docs/results.md).
    """
    able = _fastest(structure)
    nodes = "boxes" if any(way.nodes == "boxes" for way in able) else own_nodes(structure)
    way = way_of(structure, spec)
    return way in able and (len(able) == 1 or (way is not None and way.nodes == nodes))


def label(structure: Structure, spec: str) -> str:
    """A configuration as the first column of a table shows it: only the tree, if the columns of nodes and rays name the
    rest.
    """
    tree = tree_of(spec)
    return tree if spec in (single(structure, tree), *fastest(structure, tree)) else spec


def compared(
    native: Native, known: Catalogue, chosen: Iterable[str], left_out: list[str] | None = None
) -> tuple[list[str], int]:
    """The configurations to measure so that like is compared with like, each once, and the number of trees.

    A configuration that names neither nodes nor traversal means its tree traced one ray at a time, and as fast as it
    goes through each kind of its nodes; all others are taken as they are spelled. left_out: gets a line for each
    combination that the native module refuses. Raises specs.SpecError.
    """
    wanted: list[str] = []
    trees: set[str] = set()
    for spec in chosen:
        structure = known.get(specs.structure_of(spec))
        trees.add(tree_of(spec))
        if structure is None or is_spelled(spec):
            wanted.append(spec)
            continue
        first, *others = dict.fromkeys(filter(None, (single(structure, spec), *fastest(structure, spec))))
        wanted.append(first)
        wanted += _accepted(native, others, left_out)
    return specs.prove(native, list(dict.fromkeys(wanted))), len(trees)


def _accepted(native: Native, others: Sequence[str], left_out: list[str] | None) -> list[str]:
    """Those of these configurations that the native module builds."""
    found = []
    for spec in others:
        try:
            specs.canonical(native, spec)
        except specs.SpecError as error:
            if left_out is not None:
                left_out.append(str(error))
        else:
            found.append(spec)
    return found


def _is_single(way: Way, own: str) -> bool:
    return way.rays == "single" and way.nodes == own


def _is_only_single(structure: Structure, own: str) -> bool:
    """Whether rays through the structure's own nodes can only be traced one by one, in one way."""
    others = [way for way in structure.ways if way.nodes == own and way.rays != "auto"]
    return len(others) == 1 and others[0].rays == "single"


def _fastest(structure: Structure) -> Sequence[Way]:
    """The quickest way for each kind of nodes; the default one of a structure that has no such kernels."""
    return [way for way in structure.ways if way.rays == "auto"] or structure.ways[:1]


def spelled(structure: Structure, tree: str, way: Way) -> str:
    """A tree with a way to trace it; values that are defaults are left out."""
    given: Mapping[str, Any] = {"nodes": way.nodes, "traversal": way.traversal}
    parameters = ((key, structure.parameter(key)) for key in KEYS)
    return specs.joined(tree, *(f"{k}={given[k]}" for k, p in parameters if p is not None and p.default != given[k]))
