# SPDX-License-Identifier: GPL-3.0-or-later
"""The page of structures, from the registry of the native module: `python -m scripts.dev.structures_page [--check]`.

Writes docs/structures.md. With --check it writes nothing and compares the file with what it would write. Exit status:
0 written, or current; 1 not current; 2 bad usage; 130 stopped.
"""

from __future__ import annotations

import argparse
import fnmatch
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "structures.md"

INTRODUCTION = """\
# Structures

<!-- Generated from the registry of the native module by scripts/dev/structures_page.py. Do not edit. -->

A *configuration* is an id of this page, alone or followed by parameters: `id:key=value,key=value`. Every structure
returns the same answer for every ray; only time and memory differ. [Papers](papers.md) has claims and measurements,
[the manual](manual.md#structure) advice on choosing.

A `*` stands for any letters: `bsp-*-plus` for `bsp-wn-plus` and its relatives. [papers.bib](papers.bib) has the titles
of the sources.
"""

TRAVERSALS = """\
What rays are tested against (*nodes*), and how they go through it (*traversal*); the first of several is the default. A
structure with only one of them lacks the parameter."""

WAYS = "The traversals, each with its name in the panels if that differs, and its nodes:"

NO_GROUPS = "Structures without packets, tiles and streams:"

PARAMETERS = """\
By the parts of the panel *Structure*, each with its name there if that differs, and the structures that have it. The
first of several values is the default; prices have limits of 0 and 1,000,000. A parameter without the settings after
*with* is refused; a setting that a structure lacks is no condition for it. Tooltips add the effect of larger values."""

GROUPS = {"main": "At the top", "builder": "Builder", "costs": "Costs", "numerics": "Numerics", "memory": "Memory"}
"""Headings of the groups of parameters, in the order of the panel."""

PRICES = "0 to 1,000,000"
"""Limits of prices."""

LEFT_OUT = re.compile(r"^(?:(?:More|Less|Fewer|Builds|Saves)\b[^;]*|The answers? (?:is|are) the same)(?:; )?")
"""Starts of sentences that the page leaves out: the effect of larger values, and what is said of all structures."""

TITLE = re.compile(r"((?:19|20)\d\d), [A-Z].*?(?=, wh(?:o|ich) |$)")
"""The title after the year of a source."""

Row = Mapping[str, Any]


def page(rows: Sequence[Row]) -> str:
    """The text of docs/structures.md for these rows of `halfspace_native.structures()`."""
    families: dict[str, list[Row]] = {}
    for row in rows:
        families.setdefault(row["heading"], []).append(row)
    tables = [_family(heading, members) for heading, members in families.items()]
    return "\n".join([INTRODUCTION, *tables, _traversals(rows), _parameters(rows)])


def others(row: Row) -> str:
    """The other names of a structure, with the parameters that they stand for."""
    return ", ".join(f"`{name}`" + (f" for `{given}`" if given else "") for name, given in row["aliases"].items())


def _family(heading: str, rows: Iterable[Row]) -> str:
    """A heading and a list with one line per structure."""
    lines = [f"## {heading}", ""]
    for row in rows:
        aliases = f" (also {others(row)})" if row["aliases"] else ""
        source = "; ".join(TITLE.sub(r"\1", part) for part in row["paper"].split("; "))
        lines.append(f"- `{row['id']}`{aliases}, *{row['label']}*: {row['summary'].removesuffix('.')}. {source}.")
    return "\n".join(lines) + "\n"


def _traversals(rows: Sequence[Row]) -> str:
    """The ways of tracing of each structure, the default first, then what each of them does."""
    sets: dict[tuple[tuple[str, tuple[str, ...]], ...], list[str]] = {}
    known: dict[tuple[str, str], Row] = {}
    for row in rows:
        found: dict[str, list[str]] = {}
        for way in row["ways"]:
            found.setdefault(way["nodes"], []).append(way["traversal"])
            if way["traversal"]:
                known.setdefault((way["nodes"], way["traversal"]), way)
        sets.setdefault(tuple((nodes, tuple(names)) for nodes, names in found.items()), []).append(row["id"])
    every = [row["id"] for row in rows]
    # The same choices of several sets share a row.
    shared: dict[tuple[str, tuple[str, ...]], list[str]] = {}
    for choices, ids in sets.items():
        for choice in choices:
            shared.setdefault(choice, []).extend(ids)
    lines = ["## Nodes and rays", "", TRAVERSALS, ""]
    for (nodes, names), ids in shared.items():
        lines.append(f"- {_whose(ids, every)}, `nodes={nodes}`: {_ids(filter(None, names)) or 'one by one'}")
    lines += ["", NO_GROUPS, ""]
    reasons: dict[str, list[str]] = {}
    for row in rows:
        if row["no_groups"]:
            reasons.setdefault(row["no_groups"], []).append(row["id"])
    lines += [f"- {_whose(ids, every)}: {reason}." for reason, ids in reasons.items()]
    # One row for all nodes through which a traversal does the same.
    alike: dict[tuple[str, str, str], list[str]] = {}
    for (nodes, name), way in known.items():
        alike.setdefault((name, way["label"], way["doc"]), []).append(nodes)
    lines += ["", WAYS, ""]
    for (name, label, doc), nodes_of in alike.items():
        lines.append(f"- {_named(name, label)} ({', '.join(nodes_of)}): {doc}")
    return "\n".join(lines) + "\n"


def _parameters(rows: Sequence[Row]) -> str:
    """A line per key by groups: the structures that have it, what it does, its values and conditions."""
    lines = ["## Parameters", "", PARAMETERS]
    every = [row["id"] for row in rows]
    keys = {row["id"]: {one["name"] for one in row["parameters"]} for row in rows}
    groups: dict[str, set[str]] = {group: set() for group in GROUPS}
    for row in rows:
        for one in row["parameters"]:
            groups.setdefault(one["group"], set()).add(one["name"])
    for group, names in groups.items():
        lines += ["", f"### {GROUPS.get(group, group.capitalize())}", ""] if names else []
        for name in sorted(names - {"traversal"}):
            having = {row["id"]: one for row in rows for one in row["parameters"] if one["name"] == name}
            labels = dict.fromkeys(one["label"] for one in having.values())
            text = f"- {_named(name, *labels)} ({_whose(list(having), every)}): {_texts(having, every)}"
            if name != "nodes":
                found = [_values(having, every), *_conditions(having, keys, every)]
                values = "; ".join(filter(None, found))
                text += f" {values[0].upper()}{values[1:]}." if values else ""
            lines.append(text)
    return "\n".join(lines) + "\n"


def _texts(having: Mapping[str, Row], every: Sequence[str]) -> str:
    """The texts of a parameter: the sentences that all structures share, then those of some."""
    split = {
        structure: [kept for part in one["doc"].removesuffix(".").split(". ") if (kept := LEFT_OUT.sub("", part))]
        for structure, one in having.items()
    }
    holders: dict[str, tuple[str, ...]] = {}
    for part in dict.fromkeys(part for parts in split.values() for part in parts):
        holders[part] = tuple(structure for structure, parts in split.items() if part in parts)
    shared = [part for part, ids in holders.items() if len(ids) == len(having)]
    found: dict[str, Sequence[str]] = {}
    for ids in dict.fromkeys(holders.values()):
        if len(ids) < len(having):
            found[". ".join(part for part, some in holders.items() if some == ids)] = ids
    first = [". ".join(shared) + "."] if shared else []
    rest = [_differing(found, list(having), every)] if found else []
    return " ".join([*first, *rest])


def _named(name: str, *labels: str) -> str:
    """A key with its labels in the panels, but for one that differs in capitals alone."""
    own = [label for label in labels if label.lower() != name.replace("_", " ")]
    return ", ".join([f"`{name}`", *(f"*{label}*" for label in own)])


def _differing(found: Mapping[str, Sequence[str]], having: Sequence[str], every: Sequence[str]) -> str:
    """Texts with the structures that they are about; the others of those that have the parameter last."""
    apart = sorted(name for ids in found.values() for name in ids) == sorted(having)
    most = max(found.values(), key=len) if apart else None
    ordered = sorted(found.items(), key=lambda pair: pair[1] is most)
    return " ".join(f"{'Others' if ids is most else _whose(ids, every)}: {text}." for text, ids in ordered)


def _values(having: Mapping[str, Row], every: Sequence[str]) -> str:
    """The values of a parameter, with the structures where they differ; empty if the texts name all of them in order.

    The limits of prices are given once, by the introduction.
    """
    if all(_told(one) for one in having.values()):
        return ""
    limits = _grouped(having, lambda one: _range(one).partition(", default ")[0])
    defaults = _grouped(having, lambda one: _range(one).partition(", default ")[2])
    if len(limits) == 1 and "" not in defaults:
        limit = next(iter(limits))
        shown = _marked(defaults, every, ", ")
        return f"default {shown}" if limit == PRICES else f"{limit}, default {shown}"
    return _marked(_grouped(having, _range), every, "; ")


def _told(parameter: Row) -> bool:
    """Whether the text of a choice explains each of its values, in their order."""
    places = [parameter["doc"].find(f"{option}: ") for option in parameter["options"] or ()]
    return bool(places) and -1 not in places and places == sorted(places)


def _marked(found: Mapping[str, Sequence[str]], every: Sequence[str], mark: str) -> str:
    """Values with the structures that have them, those of most structures last."""
    if len(found) == 1:
        return next(iter(found))
    most = max(found.values(), key=len)
    ordered = sorted(found.items(), key=lambda pair: pair[1] is most)
    return mark.join(f"{text} ({'others' if ids is most else _whose(ids, every)})" for text, ids in ordered)


def _conditions(having: Mapping[str, Row], keys: Mapping[str, set[str]], every: Sequence[str]) -> list[str]:
    """The needs of a parameter and of its values, each with the structures to which it does not apply."""
    found: dict[tuple[str, str, str], list[str]] = {}
    for structure, one in having.items():
        for need in one["needs"]:
            found.setdefault(("", need["key"], _need(need)), []).append(structure)
        for option, needs in one["option_needs"].items():
            for need in needs:
                found.setdefault((f"`{option}` ", need["key"], _need(need)), []).append(structure)
    lines: dict[str, list[str]] = {}
    for (option, key, need), ids in found.items():
        taken = [one for one in having if not option or option[1:-2] in having[one]["option_needs"]]
        others = [one for one in taken if one not in ids and key in keys[one]]
        rest = f" ({_whose(ids, every)})" if len(ids) < len(others) or option else f" (not {_whose(others, every)})"
        lines.setdefault(option, []).append(need + (rest if others else ""))
    return [f"{option}with {', '.join(needs)}" for option, needs in lines.items()]


def text_of(parameter: Row) -> str:
    """Label and description."""
    doc = "How rays go through the nodes" if parameter["name"] == "traversal" else parameter["doc"]
    return f"*{parameter['label']}*: {doc.rstrip('.')}."


def _grouped(having: Mapping[str, Row], key: Any) -> dict[Any, list[str]]:
    """Structures by what `key` returns for their parameter, in the order of the registry."""
    found: dict[Any, list[str]] = {}
    for structure, parameter in having.items():
        found.setdefault(key(parameter), []).append(structure)
    return found


def values_of(parameter: Row) -> str:
    """Values of a parameter with the default, and where it has an effect."""
    found = [_range(parameter)]
    for option, needs in parameter["option_needs"].items():
        found.append(f"`{option}` with {', '.join(map(_need, needs))}")
    if parameter["needs"]:
        found.append(f"with {', '.join(map(_need, parameter['needs']))}")
    return "; ".join(found)


def _need(need: Row) -> str:
    """A condition on another parameter."""
    if need["options"] is None:
        return f"`{need['key']}` above {need['above']:g}"
    return f"`{need['key']}={'|'.join(need['options'])}`"


def _range(parameter: Row) -> str:
    """Values and default of a parameter. Raises ValueError where the default of a choice is not its first value."""
    if parameter["kind"] == "choice":
        if parameter["default"] != parameter["options"][0]:
            raise ValueError(f"{parameter['name']}: the default is not the first value")
        return _ids(parameter["options"])
    low, high, default = (_number(parameter[key]) for key in ("min", "max", "default"))
    unit = f" {parameter['unit']}" if parameter["unit"] else ""
    return f"{low} to {high}{unit}, default {default}"


def _number(value: float) -> str:
    """A number with all digits if it is whole."""
    return f"{int(value):,}" if value == int(value) else f"{value:g}"


def _whose(ids: Sequence[str], every: Sequence[str]) -> str:
    """Some of all structures in few words: exceptions where these are fewer, and patterns that fit no other one."""
    others = [name for name in every if name not in ids]
    if not others:
        return "all structures"
    if len(others) < min(len(ids), 5):
        return f"all structures but {_ids(others)}"
    fitting = {one: set(fnmatch.filter(every, one)) for one in _patterns(every)}
    fitting = {one: found for one, found in fitting.items() if len(found) > 1 and found <= set(ids)}
    shown: list[str] = []
    left = [name for name in every if name in ids]
    while left:
        best = max(fitting, key=lambda one: (len(fitting[one].intersection(left)), -len(one)), default="")
        covered = fitting[best].intersection(left) if best else set()
        if len(covered) < 2:
            shown += left
            break
        shown.append(best)
        left = [name for name in left if name not in covered]
    return _ids(shown)


def _patterns(every: Sequence[str]) -> dict[str, None]:
    """Patterns of ids: a stem, the first parts, the last parts, or both, with a `*` for the rest."""
    found: dict[str, None] = {}
    for name in every:
        parts = name.split("-")
        heads = ["", parts[0].rstrip("0123456789"), *("-".join(parts[:n]) + "-" for n in range(1, len(parts)))]
        tails = ["", *("-" + "-".join(parts[n:]) for n in range(1, len(parts)))]
        tails += [f"{tail}*" for tail in tails[1:]]
        found.update(dict.fromkeys(f"{head}*{tail}" for head in heads for tail in tails if head + tail))
    return found


def _ids(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


def cell(text: str) -> str:
    """A text as a cell of a table."""
    return text.replace("|", "\\|").replace("\n", " ")


def main(arguments: Sequence[str]) -> int:
    """Write or check the page. Returns the exit status."""
    parser = argparse.ArgumentParser(prog="structures_page", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="write nothing; exit with 1 where the page is not current")
    asked = parser.parse_args(arguments)
    import halfspace_native

    text = page(halfspace_native.structures())
    if asked.check:
        current = PAGE.is_file() and PAGE.read_text(encoding="utf-8") == text
        if not current:
            print(f"{PAGE}: not current; run python -m scripts.dev.structures_page", file=sys.stderr)
        return 0 if current else 1
    PAGE.write_text(text, encoding="utf-8")
    print(PAGE)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
