# SPDX-License-Identifier: GPL-3.0-or-later
"""The inspector as one self-contained page: maps with one cursor, worst rays, trees and levels of structures."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from dataclasses import asdict
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import colours
from ..base.arrays import F32
from ..measure import costmap
from ..measure.reference import Reference
from ..overlay import cells
from ..scene.workload import Workload
from ..tree import table as tables
from ..tree.table import KIND_LABELS, Table
from . import levels, node_view, ray_costs, reasons
from . import replay as replays

if TYPE_CHECKING:
    from ..base.interface import Native, Structure

TEMPLATE = "inspector.html"

MAPS = tuple(quantity for quantity in costmap.QUANTITIES if quantity.key != "TIME")
"""The quantities of the page's maps; times of single tiles are too noisy for a file that is kept."""

MOST_NODES, MOST_RAYS, CHECKED = 4000, 10, 1024
"""Largest numbers of nodes, shallow ones first, and of rays of each order, on a page; answers that are compared."""


def as_html(
    native: Native, workload: Workload, structures: Sequence[tuple[str, Structure]], size: tuple[int, int]
) -> str:
    """The page of structures over the workload's triangles. structures: label and structure. size: pixels of the view,
    multiples of a tile.

    Raises table.TreeError.
    """
    maps = [
        {one.key: costmap.measure(structure, workload, size, one.key) for one in MAPS} for _, structure in structures
    ]
    entries = [
        _entry(native, workload, label, structure, size)
        | {"maps": {key: costmap.packed(values) for key, values in own.items()}}
        for (label, structure), own in zip(structures, maps, strict=True)
    ]
    data = {
        "structures": entries,
        "quantities": [
            {
                "key": one.key,
                "label": one.label,
                "unit": one.unit,
                "meaning": one.doc,
                "end": costmap.scale_end([own[one.key] for own in maps]),
            }
            for one in MAPS
        ],
        "scale": colours.ANCHORS.astype(float).round(4).tolist(),
        "sets": [[name, label] for name, label in ray_costs.SETS.items()],
        "orders": [[key, f"by {key.lower()}"] for key in ray_costs.KEYS],
        "most": MOST_RAYS,
    }
    text = resources.files(__package__ or "").joinpath(TEMPLATE).read_text(encoding="utf-8")
    facts = f"{len(workload.triangles):,} triangles, {size[0]} × {size[1]} camera rays, SIMD level {native.level()}"
    parts = {"TITLE": workload.name, "FACTS": facts}
    for name, value in parts.items():
        text = text.replace(f"%{name}%", html.escape(value))
    # A script element ends at the first "</", whatever it contains.
    return text.replace("%DATA%", json.dumps(data, separators=(",", ":")).replace("</", "<\\/"))


def _entry(
    native: Native, workload: Workload, label: str, structure: Structure, size: tuple[int, int]
) -> dict[str, Any]:
    """Nodes, rays and levels of one structure."""
    table = tables.read(structure, workload.vertices, workload.triangles)
    costs = ray_costs.gather(structure, workload, size)
    reference = Reference(native, workload, [one.rays for one in costs.values() if len(one)], CHECKED, seed=0)
    wrong = reference.wrong(structure)
    found = levels.measure(structure, table, workload, costs["primary"])
    answers = f"{wrong:,} of {len(reference):,} answers wrong"
    nodes = _nodes(table)
    hidden = len(table) - len(nodes)
    return {
        "label": label,
        "spec": structure.spec,
        "nodes": nodes,
        "hidden": f"{hidden:,} deeper nodes are left out" if hidden else "",
        "rays": {
            f"{name} {key}": _rays(structure, table, one, key, answers)
            for name, one in costs.items()
            for key in ray_costs.KEYS
        },
        "levels": [asdict(level) for level in found.levels],
        "sentences": list(levels.sentences(found, wrong, len(reference))),
    }


def _nodes(table: Table) -> list[dict[str, Any]]:
    """The shallowest nodes. up: place of the parent in the list."""
    chosen = np.argsort(table.depth, kind="stable")[:MOST_NODES].tolist()
    place = {node: number for number, node in enumerate(chosen)}
    whole = float(table.costs_below[0]) or 1.0
    return [
        {
            "up": place.get(int(table.parent[node]), -1),
            "kind": KIND_LABELS[table.kind[node]],
            "triangles": int(table.references[node]),
            "children": len(table.children_of(node)),
            "sah": f"{table.costs_below[node] / whole:.1%}",
            "lines": [f"Node {node:,}", *node_view.words(table, node)],
        }
        for node in chosen
    ]


def _rays(
    structure: Structure, table: Table, costs: ray_costs.RayCosts, key: str, answers: str
) -> list[dict[str, Any]]:
    """The worst rays of a set, with their reasons and steps."""
    nanoseconds: F32 | None = None
    if key == "TIME":
        indices, times = ray_costs.slowest(structure, costs, MOST_RAYS)
        nanoseconds = times.astype(np.float32)
    else:
        indices = ray_costs.worst(costs, key, min(MOST_RAYS, len(costs)))
    found = []
    for place, index in enumerate(indices.tolist()):
        origin, direction = costs.rays.origins[index].tolist(), costs.rays.directions[index].tolist()
        path = cells.follow(structure, origin, direction, float(costs.rays.t_max[index]))
        made = replays.replay(table, path)
        lines = [*reasons.summary(costs, index), *reasons.reasons(table, path, made)]
        if nanoseconds is not None:
            lines.insert(0, f"{nanoseconds[place]:,.0f} ns per ray of 64 neighbours; {answers}")
        steps = [
            {
                "node": step.node,
                "level": step.depth,
                "kind": KIND_LABELS[table.kind[step.node]],
                "enter": f"{step.enter:.4g}",
                "leave": f"{step.leave:.4g}",
                "tests": step.tests,
            }
            for step in made.steps
        ]
        found.append({"lines": lines, "steps": steps})
    return found
