# SPDX-License-Identifier: GPL-3.0-or-later
"""Lists of configurations: from user input to one configuration string per measurement."""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import native
from ..base.notes import meant

if TYPE_CHECKING:
    from ..base.interface import Native, Structure


class SpecError(ValueError):
    """An unknown or wrong structure, family, parameter or range. The message lists the choices in one line."""


def split(text: str) -> list[str]:
    """The configurations in a comma-separated list; a comma inside `id:key=value,key=value` does not separate."""
    specs: list[str] = []
    for part in (part.strip() for part in text.split(",")):
        # Only a further key=value of the preceding configuration has a '=' without a ':' before it.
        if specs and "=" in part and ":" not in part.partition("=")[0]:
            specs[-1] += "," + part
        elif part:
            specs.append(part)
    return specs


def structure_of(spec: str) -> str:
    """The id of a configuration's structure."""
    return spec.partition(":")[0]


def parameters(spec: str) -> str:
    """The part of a configuration after its structure: `key=value,...`, or ""."""
    return spec.partition(":")[2]


def pairs(spec: str) -> list[tuple[str, str]]:
    """The keys and values of a configuration, in its order and spelling."""
    return [(key.strip(), value.strip()) for key, _, value in _parts(spec)]


def _parts(spec: str) -> list[tuple[str, str, str]]:
    """Key, `=` and value of each part of a configuration; the `=` is empty where it is missing."""
    return [part.partition("=") for part in parameters(spec).split(",") if part]


def joined(name: str, *given: str) -> str:
    """A configuration with these `key=value` appended to a structure or to a configuration that has some already."""
    more = ",".join(filter(None, given))
    return f"{name}{',' if parameters(name) else ':' * (':' not in name)}{more}" if more else name


SWEEP = "bsp-sweep"
"""The thesis's name for all trees whose directions are selected per node."""

MOST = 100_000
"""Limit on the configurations of one list, and on the values of one option."""

SHOWN = 20
"""Largest number of list values in a message."""


def is_whole(text: str) -> bool:
    """Whether the text consists of 1 to 18 ASCII digits, so that `int` accepts it."""
    return text.isascii() and text.isdecimal() and len(text) <= 18


def numbers(text: str, option: str = "") -> list[str]:
    """The values in a list with ranges of integers: "2-4,8" or "2..4,8" is 2, 3, 4, 8.

    option: name of the command-line option, for messages. Raises SpecError.
    """
    # Stop as soon as the lists are too long.
    try:
        return _at_most(_values(part.strip()) for part in text.split(","))
    except SpecError as error:
        if not option:
            raise
        raise SpecError(f"{option}: {error}") from error


def _at_most(lists: Iterable[list[str]]) -> list[str]:
    """The concatenation of these lists. Raises SpecError as soon as it exceeds MOST values."""
    found: list[str] = []
    for one in lists:
        found += one
        if len(found) > MOST:
            raise SpecError(f"these are more than {MOST:,} values")
    return found


def _values(part: str) -> list[str]:
    """The values of one number or one range, as text. Raises SpecError."""
    low, dash, high = part.partition(".." if ".." in part else "-")
    if dash and is_whole(low) and is_whole(high):
        if int(low) > int(high):
            raise SpecError(f"the range {part!r} runs backwards")
        if int(high) - int(low) >= MOST:
            raise SpecError(f"the range {part!r} has more than {MOST:,} values")
        return [str(n) for n in range(int(low), int(high) + 1)]
    try:
        float(part)
    except ValueError:
        raise SpecError(f"expected a number or a range such as 2-10, got {part!r}") from None
    return [part]


def _spread_out(spec: str) -> list[str]:
    """Expand a configuration with ranges: `kd:k=2..4` or `kd:k=2|4`. Raises SpecError."""
    if ".." not in parameters(spec) and "|" not in parameters(spec):
        return [spec]
    choices = []
    count = 1
    for key, equals, value in _parts(spec):
        found = _at_most(_values(part.strip()) if ".." in part else [part.strip()] for part in value.split("|"))
        choices.append(list(dict.fromkeys(f"{key}{equals}{one}" for one in found)))
        count *= len(choices[-1])
        if count > MOST:
            raise SpecError(f"{spec!r} stands for more than {MOST:,} configurations")
    return [joined(structure_of(spec), *given) for given in itertools.product(*choices)]


def expand(
    text: str,
    structures: Sequence[Mapping[str, Any]],
    ranges: Mapping[str, Sequence[str]],
    left_out: list[str] | None = None,
) -> list[str]:
    """The configurations selected by `--structures` and parameter ranges, each once, in order.

    text: configurations, in which `k=2..10` and `k=2|6` mean several, names of families, or "all"; aliases of
    structures are accepted. structures: the native registry. ranges: parameter to values; a structure that lacks the
    parameter, or whose configuration sets it, is taken unchanged, and values out of a structure's range are skipped.
    left_out: gets one line for each structure with skipped values. Raises SpecError.
    """
    rows = {row["id"]: row for row in structures}
    aliases = {name: joined(row["id"], given) for row in structures for name, given in row.get("aliases", {}).items()}
    chosen: list[str] = []
    # Resolve names, aliases and families.
    for written in split(text):
        own = structure_of(written)
        part = joined(aliases.get(own, own), parameters(written))
        name = structure_of(part)
        family = [row["id"] for row in structures if part in _families(row)]
        if name in rows:
            chosen += _spread_out(part)
        elif family:
            chosen += family
        else:
            families = dict.fromkeys(row["family"] for row in structures)
            raise SpecError(
                f"unknown structure {part!r}; there are {', '.join(rows)}; families: {', '.join(families)}, all"
                + meant(own, (*rows, *aliases, *families))
            )
        if len(chosen) > MOST:
            raise SpecError(f"these are more than {MOST:,} configurations")
    if not chosen:
        raise SpecError("no structure is named")
    # Reject ranges of parameters that no chosen structure has.
    unused = set(ranges) - {p["name"] for spec in chosen for p in rows[structure_of(spec)]["parameters"]}
    if unused:
        raise SpecError(f"none of the structures {_shortened(chosen, ', ')} has the parameter {min(unused)!r}")
    lines = left_out if left_out is not None else []
    # Count before expanding: some forty structures with many seeds each are millions.
    inside = _Inside(rows, ranges)
    taken: dict[str, dict[str, list[str]]] = {}
    count = 0
    for spec in dict.fromkeys(chosen):
        taken[spec] = _allowed(spec, inside, lines)
        count += math.prod(map(len, taken[spec].values()))
        if count > MOST:
            raise SpecError(f"these are more than {MOST:,} configurations")
    made = (one for spec, allowed in taken.items() for one in _with_values(spec, allowed))
    return list(dict.fromkeys(_effective(one, rows[structure_of(one)], ranges, lines) for one in made))


def _effective(spec: str, row: Mapping[str, Any], swept: Collection[str], left_out: list[str]) -> str:
    """A configuration without values that have no effect after a sweep; adds a line about them to `left_out`."""
    found = [(key, other) for key, other in idle(spec) if key in swept or other in swept]
    for key, other in found[:1]:
        line = f"{structure_of(spec)}: {key} has no effect with {other}={values(spec, [row])[other]}"
        if line not in left_out:
            left_out.append(line)
    return without(spec, {key for key, _ in found})


def idle(spec: str) -> list[tuple[str, str]]:
    """The values of a configuration that have no effect with its others: the key of each, and the key of the other.

    Empty for a configuration that the native module does not understand, which `prove` reports.
    """
    module = native.load()
    try:
        return module.idle(spec)
    except module.SpecError:
        return []


def without(spec: str, keys: Collection[str]) -> str:
    """A configuration without these keys."""
    return joined(structure_of(spec), *(f"{key}={value}" for key, value in pairs(spec) if key not in keys))


def prove(native: Native, chosen: Sequence[str]) -> list[str]:
    """Validate each configuration by a build of one triangle. Raises SpecError.

    Returns them in the given spelling, without those that equal an earlier one in another spelling, such as
    `kd:traversal=auto` after `kd`.
    """
    found: dict[str, str] = {}
    for spec in chosen:
        found.setdefault(canonical(native, spec), spec)
    return list(found.values())


# The mesh of one triangle with which configurations are validated.
CORNERS, TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32), np.array([[0, 1, 2]], np.int32)


def canonical(native: Native, spec: str) -> str:
    """A configuration in the native spelling, without defaults, from a tiny build. Raises SpecError."""
    return tiny(native, spec).spec


def tiny(native: Native, spec: str) -> Structure:
    """A structure of one triangle. Raises SpecError."""
    try:
        return native.build(CORNERS, TRIANGLE, spec, threads=1)
    except ValueError as error:
        raise SpecError(f"{spec}: {error}{_meant(native, spec)}") from error


def _meant(native: Native, spec: str) -> str:
    """The question for the structure or the parameters that a wrong configuration may mean; "" if none is close."""
    rows = {row["id"]: row for row in native.structures()}
    name = structure_of(spec)
    if name not in rows:
        return meant(name, rows)
    known = [parameter["name"] for parameter in rows[name]["parameters"]]
    return next((meant(key, known) for key, _ in pairs(spec) if key not in known), "")


def _families(row: Mapping[str, Any]) -> list[str]:
    """The names that select a structure together with others."""
    sweep = [SWEEP] if row.get("sweep") else []
    return [row["family"], f"family:{row['family']}", "all", *sweep]


def values(spec: str, structures: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """All parameters of a valid configuration by name, defaults included, numbers as numbers."""
    row = next(row for row in structures if row["id"] == structure_of(spec))
    found = {parameter["name"]: parameter["default"] for parameter in row["parameters"]}
    for key, value in pairs(spec):
        default = found.get(key)
        number = isinstance(default, (int, float)) and not isinstance(default, bool)
        found[key] = (float(value) if isinstance(default, float) else int(value)) if number else value
    return found


class _Inside:
    """For each structure the values of `ranges` within its parameters' limits, computed once for all its
    configurations.
    """

    def __init__(self, rows: Mapping[str, Any], ranges: Mapping[str, Sequence[str]]) -> None:
        self._rows, self._ranges = rows, ranges
        self._known: dict[str, dict[str, tuple[list[str], str]]] = {}

    def of(self, structure: str) -> dict[str, tuple[list[str], str]]:
        """By parameter of the structure, the allowed values, and a text about the others, or ""."""
        if structure not in self._known:
            known = {parameter["name"]: parameter for parameter in self._rows[structure]["parameters"]}
            self._known[structure] = {
                key: self._split(key, wanted, known[key]) for key, wanted in self._ranges.items() if key in known
            }
        return self._known[structure]

    @staticmethod
    def _split(key: str, wanted: Sequence[str], parameter: Mapping[str, Any]) -> tuple[list[str], str]:
        """The values within the parameter's limits, and a text about the others, or ""."""
        low, high = parameter.get("min"), parameter.get("max")
        allowed: list[str] = []
        others: list[str] = []
        for value in wanted:
            (allowed if _inside(value, low, high) else others).append(value)
        words = f"{key}={_shortened(others)}: it goes from {low:g} to {high:g}" if others else ""
        # Drop repeats, which would be the same configuration.
        return list(dict.fromkeys(allowed)), words


def _allowed(spec: str, inside: _Inside, left_out: list[str]) -> dict[str, list[str]]:
    """The values of each swept parameter that the structure has and the configuration does not set."""
    given = {key for key, _ in pairs(spec)}
    allowed: dict[str, list[str]] = {}
    for key, (found, others) in inside.of(structure_of(spec)).items():
        if key in given:
            continue
        allowed[key] = found
        if others:
            if not found:
                raise SpecError(f"{spec}: {others}")
            left_out.append(f"{spec}: {others}")
    return allowed


def _shortened(texts: Sequence[str], comma: str = ",") -> str:
    """A list of values, shortened to one line."""
    more = len(texts) - SHOWN
    return comma.join(texts[:SHOWN]) + (f" and {more} more" if more > 0 else "")


def _with_values(spec: str, allowed: Mapping[str, Sequence[str]]) -> Iterator[str]:
    """The configuration with each combination of these values."""
    for combination in itertools.product(*allowed.values()):
        yield joined(spec, *(f"{key}={value}" for key, value in zip(allowed, combination, strict=True)))


def _inside(value: str, low: Any, high: Any) -> bool:
    """Whether a value is within a parameter's limits; non-numbers are left to the build to reject."""
    try:
        number = float(value)
    except ValueError:
        return True
    return (low is None or number >= low) and (high is None or number <= high)
