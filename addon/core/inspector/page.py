# SPDX-License-Identifier: GPL-3.0-or-later
"""The inspector as one self-contained page: maps with one cursor, worst rays, trees and levels of structures."""

from __future__ import annotations

import html
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
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

ALONE = {
    "STEPS": "Nodes that the ray of each pixel visits, leaves included",
    "TESTS": "Triangles that the ray of each pixel is tested against",
    "WASTED": "Triangles tested on visits of leaves that found no nearer hit than the one known",
}
"""The quantities whose maps hold the counts of the worst rays: of each ray traced alone."""

MOST_NODES, MOST_RAYS, CHECKED = 4000, 10, 1024
"""Largest numbers of shallow nodes and of rays of each order on a page, and of answers that are compared."""


@dataclass(frozen=True)
class Page:
    """A page. html: its text. worst: a sentence about the camera ray of each structure that visits most nodes."""

    html: str
    worst: tuple[str, ...]


def inspect(
    native: Native, workload: Workload, structures: Sequence[tuple[str, Structure]], size: tuple[int, int]
) -> Page:
    """The page of structures over the workload's triangles. structures: label and structure. size: pixels of the view,
    multiples of a tile.

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
                "meaning": f"{ALONE[one.key]}; each ray is traced alone, as in the lists below"
                if one.key in ALONE
                else one.doc,
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
    text = text.replace("%DATA%", json.dumps(data, separators=(",", ":")).replace("</", "<\\/"))
    worst = (_sentence(label, own["primary"]) for (label, _), own in zip(structures, costs, strict=True))
    return Page(text, tuple(line for line in worst if line))


def _sentence(label: str, primary: ray_costs.RayCosts) -> str:
    """The camera ray that visits most nodes, in one sentence; empty without rays."""
    for index in ray_costs.worst(primary, "STEPS", 1).tolist():
        (x, y), steps, tests = primary.pixels[index], int(primary.steps[index]), int(primary.tests[index])
        return f"worst camera ray of {label}: pixel {x}, {y} from the top left, {steps:,} steps, {tests:,} tests"
    return ""


def _map(structure: Structure, workload: Workload, primary: ray_costs.RayCosts, size: tuple[int, int], key: str) -> F32:
    """(height, width) float32 of a quantity at each pixel, rows from the bottom."""
    if key not in ALONE:
        return costmap.measure(structure, workload, size, key)
    picture = np.zeros((size[1], size[0]), np.float32)
    counts = {"STEPS": primary.steps, "TESTS": primary.tests, "WASTED": primary.wasted}[key]
    picture[size[1] - 1 - primary.pixels[:, 1], primary.pixels[:, 0]] = counts
    return picture


def _entry(
    native: Native, workload: Workload, label: str, structure: Structure, costs: dict[str, ray_costs.RayCosts]
) -> dict[str, Any]:
    """Nodes, rays and levels of one structure. costs: of its rays, by set."""
    table = tables.read(structure, workload.vertices, workload.triangles)
    reference = Reference(native, workload, [one.rays for one in costs.values() if len(one)], CHECKED, seed=0)
    wrong = reference.wrong(structure)
    found = levels.measure(structure, table, workload, costs["primary"])
    answers = f"{wrong:,} of {len(reference):,} answers wrong"
    rays = {
        f"{name} {key}": _rays(structure, table, one, key, answers)
        for name, one in costs.items()
        for key in ray_costs.KEYS
    }
    nodes = _nodes(table, {step["node"] for one in rays.values() for ray in one for step in ray["steps"]})
    hidden = len(table) - len(nodes)
    return {
        "label": label,
        "spec": structure.spec,
        "nodes": nodes,
        "hidden": f"{hidden:,} deeper nodes that none of these rays meets are left out" if hidden else "",
        "rays": rays,
        "levels": [asdict(level) for level in found.levels],
        "sentences": list(levels.sentences(found, wrong, len(reference))),
    }


def _parameter(value: float) -> str:
    """A ray parameter; a dash where only the error bound led the ray into the node."""
    return f"{value:.4g}" if np.isfinite(value) else "–"


def _nodes(table: Table, met: Iterable[int]) -> list[dict[str, Any]]:
    """The shallowest nodes, and the visited ones with their siblings, parents first. up: place of the parent.

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
            "row": int(node),
            "kind": KIND_LABELS[table.kind[node]],
            "triangles": int(table.references[node]),
            "children": len(table.children_of(node)),
            "sah": node_view.percent(table.costs_below[node] / whole),
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
        rays = costs.rays
        path = cells.follow(structure, origin, direction, float(rays.t_max[index]), any_hit=rays.any_hit)
        made = replays.replay(table, path)
        lines = [*reasons.summary(costs, index), *reasons.reasons(table, path, made, key)]
        if nanoseconds is not None:
            lines.insert(0, f"{nanoseconds[place]:,.0f} ns per ray of 64 neighbours; {answers}")
        steps = [
            {
                "node": step.node,
                "level": step.depth,
                "kind": KIND_LABELS[table.kind[step.node]],
                "enter": _parameter(step.enter),
                "leave": _parameter(step.leave),
                "tests": step.tests,
                "reached": step.reached,
            }
            for step in made.steps
        ]
        note = replays.against(made, int(costs.steps[index]))
        found.append({"lines": lines, "steps": steps, "note": note, "pixel": costs.pixels[index].tolist()})
    return found
