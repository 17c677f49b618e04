# SPDX-License-Identifier: GPL-3.0-or-later
"""The native registry of structures as dataclasses; every list of structures or parameters derives from it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

from ..base import native
from .names import name_of

Value = int | float | str


@dataclass(frozen=True)
class Parameter:
    """One key of a configuration string, with the texts and limits that a user interface needs.

    kind: "integer", "float" or "choice". `minimum` and `maximum` bound a number; `options` lists the values of a
    choice, `labels` their names for people. group: part of a panel, one of relevance.GROUPS, or "".
    """

    name: str
    label: str
    doc: str
    unit: str
    kind: str
    default: Value
    minimum: float | None
    maximum: float | None
    options: tuple[str, ...] = ()
    labels: tuple[str, ...] = ()
    group: str = ""

    @property
    def is_switch(self) -> bool:
        """Whether the parameter is off or on: a choice between 0 and 1."""
        return set(self.options) == {"0", "1"}

    def label_of(self, option: str) -> str:
        """The name of an option for people."""
        return dict(zip(self.options, self.labels, strict=True)).get(option, option) if self.labels else option

    def clamp(self, value: Value) -> Value:
        """The nearest valid value; the default for an unknown choice."""
        if self.kind == "choice":
            return value if value in self.options else self.default
        number = float(value)
        if self.minimum is not None:
            number = max(number, self.minimum)
        if self.maximum is not None:
            number = min(number, self.maximum)
        return int(number) if self.kind == "integer" else number


@dataclass(frozen=True)
class Way:
    """One valid pair of nodes and traversal.

    nodes: planes, wide, boxes, intervals, octants, cells or none. traversal: value of that parameter, "" for a
    structure without one. rays: single, flight, packet, tile, stream, or auto for the quickest of them per batch.
    """

    nodes: str
    traversal: str
    rays: str
    label: str = ""
    doc: str = ""


@dataclass(frozen=True)
class Structure:
    """One acceleration structure: `id` for configuration strings, `code` for saved files (never reused).

    aliases: further names for the id, used by other authors. ways: all valid pairs of nodes and traversal.
    """

    id: str
    code: int
    label: str
    family: str
    summary: str
    paper: str
    parameters: tuple[Parameter, ...]
    aliases: tuple[str, ...] = ()
    ways: tuple[Way, ...] = ()

    def parameter(self, name: str) -> Parameter | None:
        """The parameter of this name, or None."""
        return next((p for p in self.parameters if p.name == name), None)


class Catalogue:
    """All structures, in the order of the registry."""

    def __init__(self, structures: Iterable[Structure]) -> None:
        self.structures = tuple(structures)
        self._by_id = {structure.id: structure for structure in self.structures}
        self._by_alias = {alias: structure for structure in self.structures for alias in structure.aliases}

    def __getitem__(self, structure_id: str) -> Structure:
        return self._by_id[structure_id]

    def get(self, structure_id: str) -> Structure | None:
        """The structure of this id or alias, or None."""
        return self._by_id.get(structure_id) or self._by_alias.get(structure_id)

    @property
    def default(self) -> Structure:
        """The structure of a new scene: the kd-tree, which all others are compared with."""
        return self._by_id.get("kd", self.structures[0])

    def parameters(self) -> dict[str, Parameter]:
        """One parameter per name, with limits and options wide enough for every structure that has it."""
        merged: dict[str, Parameter] = {}
        for structure in self.structures:
            for parameter in structure.parameters:
                known = merged.get(parameter.name)
                merged[parameter.name] = parameter if known is None else _widen(known, parameter)
        return merged


@cache
def load() -> Catalogue:
    """The catalogue of the compiled module. Raises native.NativeError if the module is missing."""
    return of(native.load().structures())


def of(structures: Iterable[Mapping[str, Any]]) -> Catalogue:
    """The catalogue of a native registry."""
    return Catalogue(map(_structure, structures))


def _structure(row: Mapping[str, Any]) -> Structure:
    return Structure(
        id=row["id"],
        code=int(row["code"]),
        label=row["label"],
        family=row["family"],
        summary=row["summary"],
        paper=row["paper"],
        parameters=tuple(_parameter(parameter) for parameter in row["parameters"]),
        aliases=tuple(row["aliases"]),
        ways=tuple(_way(way) for way in row["ways"]) if "ways" in row else _derived_ways(row),
    )


def _way(row: Mapping[str, Any]) -> Way:
    return Way(row["nodes"], row["traversal"], row["rays"], row["label"], row["doc"])


OWN_NODES = {
    "bih": "intervals",
    "octree": "octants",
    "grid": "cells",
    "brute": "none",
    "bvh": "boxes",
    "obb": "boxes",
    "bbox": "boxes",
}
"""Kinds of nodes by the beginning of the id; those of all other structures are planes."""

TOGETHER = {"wide": "flight", "tile8": "tile", "tile16": "tile", "p4": "packet", "p8": "packet", "p16": "packet"}
"""How the rays of these traversals go together."""


def _derived_ways(row: Mapping[str, Any]) -> tuple[Way, ...]:
    """The ways of a registry without `ways`, from its parameter `traversal`. For modules before the key."""
    own = next((nodes for begin, nodes in OWN_NODES.items() if row["id"].startswith(begin)), "planes")
    names = next((p["options"] for p in row["parameters"] if p["name"] == "traversal"), [""])
    if names == [""] and any(p["name"] == "beam_least" for p in row["parameters"]):
        return (Way(own, "", "tile"),)
    nodes = {} if own == "boxes" else {"auto": "boxes", "boxes": "boxes", "wide": "wide"}
    rays = {"auto": "auto", **TOGETHER}
    return tuple(Way(nodes.get(name, own), name, rays.get(name, "single")) for name in names)


def _parameter(row: Mapping[str, Any]) -> Parameter:
    return Parameter(
        name=row["name"],
        label=row["label"],
        doc=row["doc"],
        unit=row["unit"],
        kind=row["kind"],
        default=row["default"],
        minimum=row["min"],
        maximum=row["max"],
        options=(options := tuple(row["options"] or ())),
        labels=_labels(row, options),
        group=row.get("group", ""),
    )


def _labels(row: Mapping[str, Any], options: tuple[str, ...]) -> tuple[str, ...]:
    """The names of a choice's options; those of a registry without names are made from the values."""
    given = row.get("labels") or {}
    named = given if isinstance(given, Mapping) else dict(zip(options, given, strict=True))
    return tuple(named.get(option) or name_of(row["name"], option) for option in options)


def _widen(a: Parameter, b: Parameter) -> Parameter:
    """The union of two parameters' limits and options, with the texts of the first."""
    names = dict(zip(a.options, a.labels, strict=True))
    for option, label in zip(b.options, b.labels, strict=True):
        names.setdefault(option, label)
    return Parameter(
        name=a.name,
        label=a.label,
        doc=a.doc,
        unit=a.unit,
        kind=a.kind,
        default=a.default,
        minimum=None if a.minimum is None or b.minimum is None else min(a.minimum, b.minimum),
        maximum=None if a.maximum is None or b.maximum is None else max(a.maximum, b.maximum),
        options=tuple(names),
        labels=tuple(names.values()),
        group=a.group,
    )


def routes(structure: Any) -> Mapping[str, Mapping[str, str]]:
    """The nodes and rays that answer each kind of batch of a native structure: `Structure.routes`."""
    found = getattr(structure, "routes", None)
    return _derived_routes(structure.spec) if found is None else found


def counts_itself(structures: Iterable[Mapping[str, Any]]) -> bool:
    """Whether every kernel of a module counts its own work: those whose registry has `ways` do."""
    return all("ways" in row for row in structures)


def _derived_routes(spec: str) -> dict[str, dict[str, str]]:
    """The routes of a module without `Structure.routes`. For modules before the attribute."""
    from . import specs, ways

    structure = load()[specs.structure_of(spec)]
    way = ways.way_of(structure, spec)
    assert way is not None, "native specs are valid"
    kinds = {"single": "single", "tiles": way.rays, "closest": way.rays, "shadow": way.rays}
    if way.rays == "auto":
        kinds |= {"tiles": "tile", "closest": "stream", "shadow": "tile"}
    elif way.rays == "tile":
        kinds |= {"closest": "single", "shadow": "single" if way.traversal == "" else "tile"}
    elif way.rays == "packet" and way.traversal != "p16":
        kinds["shadow"] = "single"
    shadow = dict(specs.pairs(spec)).get("shadow")
    if shadow is not None:
        kinds["shadow"] = "tile" if shadow == "beam" else "single"
    return {kind: {"nodes": way.nodes, "rays": rays} for kind, rays in kinds.items()}
