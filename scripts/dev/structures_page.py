# SPDX-License-Identifier: GPL-3.0-or-later
"""The page of structures, from the registry of the native module: `python scripts/dev/structures_page.py [--check]`.

Writes docs/structures.md. With --check it writes nothing and compares the file with what it would write. Exit status:
0 written, or current; 1 not current; 2 bad usage; 130 stopped.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "structures.md"

INTRODUCTION = """\
# Structures

<!-- Generated from the registry of the native module by scripts/dev/structures_page.py. Do not edit. -->

A *configuration* is an id of this page, alone or followed by parameters: `id:key=value,key=value`. The same strings
serve the panels of Blender, the command line and the Python module. Every structure returns the same answer for every
ray; only time and memory differ. See [papers](papers.md) for what the sources claim and what was measured, and
[the manual](manual.md#structure) for advice on choosing.
"""

TRAVERSALS = """\
What rays are tested against (*nodes*), and how they are sent through it ([traversal](#traversal)), the default first. A
structure with only one of them lacks the parameter. A `*` stands for all structures whose id begins so.

Former values of `traversal` stay accepted: `p16`, `p8`, `p4` for `packet`, `packet8`, `packet4`; `tile8` for `tile`;
`wide` for `nodes=wide,traversal=flight`; `boxes` for `nodes=boxes,traversal=ordered`."""

NO_GROUPS = "Packets, tiles and streams go through all nodes, but for:"

Row = Mapping[str, Any]


def page(rows: Sequence[Row]) -> str:
    """The text of docs/structures.md for these rows of `halfspace_native.structures()`."""
    families: dict[str, list[Row]] = {}
    for row in rows:
        families.setdefault(row["heading"], []).append(row)
    tables = [_family(heading, members) for heading, members in families.items()]
    return "\n".join([INTRODUCTION, *tables, _traversals(rows), _parameters(rows)])


def _family(heading: str, rows: Iterable[Row]) -> str:
    """A heading and a table with one line per structure."""
    lines = [f"## {heading}", ""]
    lines += ["| id | name | what it is | source |", "| --- | --- | --- | --- |"]
    for row in rows:
        aliases = f" (also {_ids(row['aliases'])})" if row["aliases"] else ""
        cells = (f"`{row['id']}`{aliases}", row["label"], row["summary"], row["paper"])
        lines.append("| " + " | ".join(map(cell, cells)) + " |")
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
    lines = ["## Nodes and rays", "", TRAVERSALS, "", "| structures | nodes | traversals |", "| --- | --- | --- |"]
    for choices, ids in sets.items():
        for nodes, names in choices:
            whose = _whose(ids, every) if (nodes, names) == choices[0] else ""
            lines.append(f"| {whose} | `{nodes}` | {_ids(filter(None, names)) or 'one by one'} |")
    lines += ["", NO_GROUPS, ""]
    reasons: dict[str, list[str]] = {}
    for row in rows:
        if row["no_groups"]:
            reasons.setdefault(row["no_groups"], []).append(row["id"])
    lines += [f"- {_whose(ids, every)}: {reason}." for reason, ids in reasons.items()]
    lines += ["", "| nodes | traversal | name | what it does |", "| --- | --- | --- | --- |"]
    for (nodes, name), way in known.items():
        lines.append(f"| `{nodes}` | `{name}` | {way['label']} | {cell(way['doc'])} |")
    return "\n".join(lines) + "\n"


def _parameters(rows: Sequence[Row]) -> str:
    """One section per key: its texts, then its ranges and defaults with the structures that have them."""
    lines = ["## Parameters", "", "A `*` stands for all structures whose id begins so.", ""]
    every = [row["id"] for row in rows]
    names = dict.fromkeys(parameter["name"] for row in rows for parameter in row["parameters"])
    for name in sorted(names):
        having = {row["id"]: one for row in rows for one in row["parameters"] if one["name"] == name}
        texts = _grouped(having, text_of)
        lines += [f"### {name}", ""]
        if len(texts) == 1:
            lines += [*texts, ""]
        else:
            lines += [f"- {_whose(ids, every)}: {text}" for text, ids in texts.items()]
        lines += [f"- {_whose(ids, every)}: {text}." for text, ids in _grouped(having, values_of).items()]
        lines.append("")
    return "\n".join(lines[:-1]) + "\n"


def text_of(parameter: Row) -> str:
    """Label, description and unit."""
    unit = f" Unit: {parameter['unit']}." if parameter["unit"] else ""
    doc = "How rays traverse the nodes, see above" if parameter["name"] == "traversal" else parameter["doc"]
    return f"*{parameter['label']}*: {doc.rstrip('.')}.{unit}"


def _grouped(having: Mapping[str, Row], key: Any) -> dict[Any, list[str]]:
    """Structures by what `key` returns for their parameter, in the order of the registry."""
    found: dict[Any, list[str]] = {}
    for structure, parameter in having.items():
        found.setdefault(key(parameter), []).append(structure)
    return found


def values_of(parameter: Row) -> str:
    """Default and range of a parameter, and where it has an effect."""
    found = [_range(parameter)]
    for option, needs in parameter["option_needs"].items():
        found.append(f"`{option}` only with {' and '.join(map(_need, needs))}")
    if parameter["needs"]:
        found.append(f"only with {' and '.join(map(_need, parameter['needs']))}")
    return "; ".join(found)


def _need(need: Row) -> str:
    """A condition on another parameter."""
    if need["options"] is None:
        return f"`{need['key']}` above {need['above']:g}"
    return f"`{need['key']}={'|'.join(need['options'])}`"


def _range(parameter: Row) -> str:
    """Default and range of a parameter."""
    if parameter["kind"] == "choice":
        return f"one of {_ids(parameter['options'])}; default `{parameter['default']}`"
    kind = "an integer" if parameter["kind"] == "integer" else "a number"
    low, high, default = (f"{parameter[key]:.7g}" for key in ("min", "max", "default"))
    return f"{kind} from {low} to {high}; default {default}"


def _whose(ids: Sequence[str], every: Sequence[str]) -> str:
    """Some of all structures in few words: exceptions where these are fewer, and one name for all of one stem."""
    others = [name for name in every if name not in ids]
    if not others:
        return "all structures"
    if len(others) < min(len(ids), 5):
        return f"all structures but {_ids(others)}"
    stems: dict[str, list[str]] = {}
    for name in every:
        stems.setdefault(name.partition("-")[0].rstrip("0123456789"), []).append(name)
    shown: list[str] = []
    for stem, names in stems.items():
        having = [name for name in names if name in ids]
        shown += [f"{stem}*"] if len(having) == len(names) > 1 else having
    return _ids(shown)


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
            print(f"{PAGE}: not current; run python scripts/dev/structures_page.py", file=sys.stderr)
        return 0 if current else 1
    PAGE.write_text(text, encoding="utf-8")
    print(PAGE)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
