# SPDX-License-Identifier: GPL-3.0-or-later
"""The native registry of structures as dataclasses; every list of structures or parameters derives from it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache
from typing import Any

from ..base import native

Value = int | float | str


@dataclass(frozen=True)
class Parameter:
    """One key of a configuration string, with the texts and limits that a user interface needs.

    kind: "integer", "float" or "choice". `minimum` and `maximum` bound a number; `options` lists the values of a
    choice, `labels` their names for people. group: part of a panel, one of relevance.GROUPS.
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
    group: str = "builder"

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
    structure without one. rays: single, flight, packet, tile, beam, stream, or auto for the quickest of them per batch.
    """

    nodes: str
    traversal: str
    rays: str
    label: str = ""
    doc: str = ""


@dataclass(frozen=True)
class Structure:
    """One acceleration structure: `id` for configuration strings, `code` for saved files (never reused).

    aliases: further names, used by other authors, with the parameters that each sets. ways: all valid pairs of
    nodes and traversal. heading: of its family in lists. menu: title of the menu of its names in the literature.
    literature: these names, each with its configuration.
    """

    id: str
    code: int
    label: str
    family: str
    summary: str
    paper: str
    parameters: tuple[Parameter, ...]
    aliases: Mapping[str, str] = field(default_factory=dict)
    ways: tuple[Way, ...] = ()
    heading: str = ""
    menu: str = ""
    literature: tuple[tuple[str, str], ...] = ()

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
    own = {item.name: row[item.name] for item in fields(Structure)}
    own |= {"aliases": dict(own["aliases"]), "literature": tuple(map(tuple, own["literature"]))}
    parameters, ways = tuple(map(_parameter, row["parameters"])), tuple(Way(**way) for way in row["ways"])
    return Structure(**{**own, "parameters": parameters, "ways": ways})


def _parameter(row: Mapping[str, Any]) -> Parameter:
    own = {name: row[name] for name in ("name", "label", "doc", "unit", "kind", "default", "group")}
    options, labels = (tuple(row[name] or ()) for name in ("options", "labels"))
    return Parameter(**own, minimum=row["min"], maximum=row["max"], options=options, labels=labels)


def _widen(a: Parameter, b: Parameter) -> Parameter:
    """The union of two parameters' limits and options, with the texts of the first."""
    names = dict(zip(a.options, a.labels, strict=True))
    for option, label in zip(b.options, b.labels, strict=True):
        names.setdefault(option, label)
    return replace(
        a,
        minimum=None if a.minimum is None or b.minimum is None else min(a.minimum, b.minimum),
        maximum=None if a.maximum is None or b.maximum is None else max(a.maximum, b.maximum),
        options=tuple(names),
        labels=tuple(names.values()),
    )
