# SPDX-License-Identifier: GPL-3.0-or-later
"""The inspector as one self-contained page: maps with one cursor, worst rays, trees and levels of structures."""

from __future__ import annotations

import html
import json
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base import colours
from ..base.arrays import F64
from ..measure import costmap
from ..measure.reference import Reference
from ..overlay import cells
from ..scene.workload import Workload
from ..tree import table as tables
from ..tree.table import KIND_LABELS, Table
from . import csv_files, levels, node_view, ray_costs, reasons
from . import replay as replays

if TYPE_CHECKING:
    from ..base.interface import Native, Structure

TEMPLATE, SCRIPT = "inspector.html", "inspector.js"

STEPS = replace(
    costmap.quantity("STEPS"),
    label="Traversal steps, single rays",
    doc="Nodes that the ray of each pixel visits where it is traced alone, leaves included",
)
"""The steps of the page's maps are those of the worst rays."""

MAPS = (STEPS, *(one for one in costmap.QUANTITIES if one.key not in ("STEPS", "TESTS")))
"""The quantities of the page's maps; tests are those of single rays only."""

MOST_NODES, MOST_RAYS, CHECKED = 4000, 10, 1024
"""Largest numbers of shallow nodes and of rays of each order on a page, and of answers that are compared."""


@dataclass(frozen=True)
class Page:
    """A page. html: its text. worst: a sentence about the camera ray of each structure that visits most nodes."""

    html: str
    worst: tuple[str, ...]


def inspect(
    native: Native,
    workload: Workload,
    structures: Sequence[tuple[str, Structure]],
    size: tuple[int, int],
    report: str = "",
) -> Page:
    """The page of structures over the workload's triangles. structures: label and structure. size: pixels of the view,
    multiples of a tile. report: relative address of a report that the page links.

    Raises table.TreeError.
    """
    costs = [ray_costs.gather(structure, workload, size) for _, structure in structures]
    maps = [
        {one.key: _map(structure, workload, own["primary"], size, one.key) for one in MAPS}
        for (_, structure), own in zip(structures, costs, strict=True)
    ]
    entries = [
        _entry(native, workload, label, structure, own)
        | {"maps": {key: costmap.packed(values) for key, values in drawn.items()}}
        for (label, structure), own, drawn in zip(structures, costs, maps, strict=True)
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
    }
    facts = f"{len(workload.triangles):,} triangles, {size[0]} × {size[1]} camera rays, SIMD level {native.level()}"
    worst = (_sentence(label, own["primary"]) for (label, _), own in zip(structures, costs, strict=True))
    return Page(_filled(workload.name, facts, report, data), tuple(line for line in worst if line))


def _filled(title: str, facts: str, report: str, data: dict[str, Any]) -> str:
    """The template with these texts, the data and the script."""
    files = resources.files(__package__ or "")
    template, script = (files.joinpath(name).read_text(encoding="utf-8") for name in (TEMPLATE, SCRIPT))
    parts = {
        "TITLE": html.escape(title),
        "FACTS": html.escape(facts),
        "COLOURS": ", ".join(f"rgb({r:.0f} {g:.0f} {b:.0f})" for r, g, b in 255 * colours.ANCHORS),
        "REPORT": f'<a href="{html.escape(report)}">Report of speed and errors</a>' if report else "",
        # A script element ends at the first "</", whatever it contains.
        "DATA": json.dumps(data, separators=(",", ":"), allow_nan=False).replace("</", "<\\/"),
        "SCRIPT": script,
    }
    return re.sub(r"%([A-Z]+)%", lambda found: parts[found[1]], template)


def _sentence(label: str, primary: ray_costs.RayCosts) -> str:
    """The camera ray that visits most nodes, in one sentence; empty without rays."""
    for index in ray_costs.worst(primary, "STEPS", 1).tolist():
        (x, y), steps, tests = primary.pixels[index], int(primary.steps[index]), int(primary.tests[index])
        return f"worst camera ray of {label}: pixel {x}, {y} from the top left, {steps:,} steps, {tests:,} tests"
    return ""


def _map(structure: Structure, workload: Workload, primary: ray_costs.RayCosts, size: tuple[int, int], key: str) -> F64:
    """(height, width) float64 of a quantity at each pixel, rows from the bottom."""
    counts = {"STEPS": primary.steps, "SINGLE_TESTS": primary.tests, "WASTED": primary.wasted}
    if key not in counts:
        return costmap.measure(structure, workload, size, key)
    picture = np.zeros((size[1], size[0]))
    picture[size[1] - 1 - primary.pixels[:, 1], primary.pixels[:, 0]] = counts[key]
    return picture


def _entry(
    native: Native, workload: Workload, label: str, structure: Structure, costs: dict[str, ray_costs.RayCosts]
) -> dict[str, Any]:
    """Nodes, rays and levels of one structure. costs: of its rays, by set."""
    table = tables.read(structure, workload.vertices, workload.triangles)
    reference = Reference(native, workload, [one.rays for one in costs.values() if len(one)], CHECKED, seed=0)
    wrong = reference.wrong(structure)
    found = levels.measure(structure, table, workload, costs["primary"])
    times = {
        name: csv_files.Times(ray_costs.block_times(structure, one), wrong, len(reference))
        for name, one in costs.items()
    }
    rays = {
        f"{name} {key}": _rays(structure, table, one, key, times[name])
        for name, one in costs.items()
        for key in ray_costs.KEYS
    }
    nodes = _nodes(table, {step["node"] for one in rays.values() for ray in one for step in ray["steps"]})
    hidden = len(table) - len(nodes)
    return {
        "label": label,
        "spec": structure.spec,
        "answers": times["primary"].answers,
        "columns": list(csv_files.node(table, 0)),
        "nodes": nodes,
        "hidden": f"{hidden:,} deeper nodes that none of these rays meets are left out" if hidden else "",
        "rays": rays,
        "levels": list(found.rows(wrong, len(reference))),
        "sentences": list(levels.sentences(found, wrong, len(reference))),
    }


def _parameter(value: float) -> float | None:
    """A ray parameter with nine digits; None where only the error bound led the ray into the node."""
    return float(f"{value:.9g}") if np.isfinite(value) else None


def _nodes(table: Table, met: Iterable[int]) -> list[dict[str, Any]]:
    """The shallowest nodes, and the visited ones with their siblings, parents first. up: place of the parent. row: the
    values of `csv_files.node`.

    met: rows of visited nodes, whose ancestors are visited too.
    """
    wanted = set(np.argsort(table.depth, kind="stable")[:MOST_NODES].tolist())
    for node in met:
        up = int(table.parent[node])
        wanted.update(table.children_of(up).tolist() if up >= 0 else [node])
    chosen = sorted(wanted, key=lambda node: (int(table.depth[node]), node))
    place = {node: number for number, node in enumerate(chosen)}
    whole = float(table.costs_below[0]) or 1.0
    return [
        {
            "up": place.get(int(table.parent[node]), -1),
            "share": node_view.percent(table.costs_below[node] / whole),
            "lines": [f"Node {node:,}", *node_view.words(table, node)],
            "row": list(csv_files.node(table, node).values()),
        }
        for node in chosen
    ]


def _rays(
    structure: Structure, table: Table, costs: ray_costs.RayCosts, key: str, times: csv_files.Times
) -> list[dict[str, Any]]:
    """The worst rays of a set, with their reasons and steps. row: as in files."""
    if key == "TIME":
        indices, nanoseconds = ray_costs.slowest(costs, times.nanoseconds, MOST_RAYS)
    else:
        indices, nanoseconds = ray_costs.worst(costs, key, MOST_RAYS), np.zeros(0)
    found = []
    for place, index in enumerate(indices.tolist()):
        origin, direction = costs.rays.origins[index].tolist(), costs.rays.directions[index].tolist()
        rays = costs.rays
        path = cells.follow(structure, origin, direction, float(rays.t_max[index]), any_hit=rays.any_hit)
        made = replays.replay(table, path)
        lines = [*reasons.summary(costs, index), *reasons.reasons(table, path, made, key)]
        if len(nanoseconds):
            lines.insert(0, f"{nanoseconds[place]:,.0f} ns per ray of 64 neighbours; {times.answers}")
        steps = [
            {
                "step": number,
                "node": step.node,
                "level": step.depth,
                "kind": KIND_LABELS[table.kind[step.node]],
                "enter": _parameter(step.enter),
                "leave": _parameter(step.leave),
                "tests": step.tests,
                "counted": step.reached if step.reached >= 0 else None,
            }
            for number, step in enumerate(made.steps, 1)
        ]
        note = replays.against(made, int(costs.steps[index]))
        row = csv_files.ray(costs, index, place + 1, times)
        found.append({"lines": lines, "steps": steps, "note": note, "row": row})
    return found
