# SPDX-License-Identifier: GPL-3.0-or-later
"""Named structures of the literature, as configurations."""

from __future__ import annotations

from dataclasses import dataclass

from . import specs
from .catalogue import Catalogue, Parameter, Value


@dataclass(frozen=True)
class Preset:
    """A named structure. name: as the source writes it. spec: its configuration. menu: title of its menu."""

    name: str
    spec: str
    menu: str


def offered(catalogue: Catalogue) -> tuple[Preset, ...]:
    """All named structures, in the order of the registry."""
    return tuple(Preset(name, spec, one.menu) for one in catalogue.structures for name, spec in one.literature)


def settings(catalogue: Catalogue, spec: str) -> tuple[str, dict[str, Value]]:
    """The id of a configuration's structure, and the values of all its parameters. Raises specs.SpecError."""
    name = specs.structure_of(spec)
    structure = catalogue.get(name)
    if structure is None:
        known = ", ".join(one.id for one in catalogue.structures)
        raise specs.SpecError(f"unknown structure {spec.partition(':')[0]!r}; there are {known}")
    spec = specs.joined(structure.id, structure.aliases.get(name, ""), specs.parameters(spec))
    values: dict[str, Value] = {parameter.name: parameter.default for parameter in structure.parameters}
    given: set[str] = set()
    for key, text in specs.pairs(spec):
        parameter = structure.parameter(key)
        if parameter is None:
            raise specs.SpecError(f"{structure.id} has no parameter {key!r}")
        if key in given:
            raise specs.SpecError(f"{key} is given twice in {spec!r}")
        given.add(key)
        values[key] = _value(parameter, text)
    return structure.id, values


def _value(parameter: Parameter, text: str) -> Value:
    try:
        value: Value = {"integer": int, "float": float, "choice": str}[parameter.kind](text)
    except ValueError:
        raise specs.SpecError(f"{parameter.name}: expected a number, got {text!r}") from None
    if parameter.clamp(value) != value:
        raise specs.SpecError(f"{parameter.name}: {text} is out of range")
    return value
