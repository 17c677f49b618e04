# SPDX-License-Identifier: GPL-3.0-or-later
"""A page for each structure: what it is, its picture, source, cost, claims and parameters, from the registry.

Costs are counters and sizes, which depend on no machine: every structure over one torus, the same rays.
"""

from __future__ import annotations

import fnmatch
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from addon.core.measure import counting
from addon.core.scene import rays
from addon.lab.claims import growth
from addon.lab.claims.table import CLAIMS
from scripts.dev import structures_page

if TYPE_CHECKING:
    from addon.core.base.interface import Native
    from addon.core.scene.rays import RaySet
    from addon.core.scene.workload import Workload

TRIANGLES, SIZE, SETS = 2000, (64, 64), ("primary", "diffuse")
"""The torus, the pixels of its view, and the ray sets that are counted."""

HEADINGS: Mapping[str, str] = {
    "growth-*": "growth-with-the-number-of-triangles",
    "ta-b-*": "traversal-by-entry-and-exit-points-ta-b",
    "intervals-*": "bounding-interval-hierarchies",
    "moving-*": "moving-scenes",
    "beams-*": "beams-through-octrees",
    "shadow-beams": "beams-through-octrees",
    "shadow-cache": "shadow-cache",
    "any-hits-*": "order-of-children-for-any-hits",
    "shadow-polygons": "beams-through-octrees",
    "*ed-beams": "beams-of-mirrors-and-panes",
    "octrees-beat-boxes": "beams-through-octrees",
    "boxes-beat-octrees": "beams-through-octrees",
    "links-gain": "beams-through-octrees",
    "neighbour-search": "beams-through-octrees",
    "teapot-*": "beams-through-octrees",
    "sweep-trees-*": "bsp-trees-along-normals",
    "other-trees-time": "bsp-trees-along-normals",
    "three-directions-are-kd": "bsp-trees-along-normals",
    "without-axes": "bsp-trees-along-normals",
    "one-normal": "bsp-trees-along-normals",
    "long-builds": "bsp-trees-along-normals",
    "rbsp-*": "planes-of-few-directions",
    "halved-cells-constant": "medians-cells-and-oriented-boxes",
    "medians-*": "medians-cells-and-oriented-boxes",
    "voxel-step": "medians-cells-and-oriented-boxes",
    "mailboxes": "medians-cells-and-oriented-boxes",
    "oriented-boxes-*": "medians-cells-and-oriented-boxes",
    "fixed-directions": "bsp-trees-along-normals",
    "planes-*": "planes-against-boxes",
}
"""Claims, by their beginnings, to the heading of docs/papers.md about them. The registry has the structures."""

STATED: Mapping[str, str] = {
    "bvh-ploc": "Its source measures builds and rays on graphics processors; no claim of it is measured here. The tree "
    "is the same for any number of threads.",
    "bvh-hlbvh": "Its sources measure builds on graphics processors; no claim of them is measured here. The tree is "
    "the same for any number of threads.",
    "brute": "It is the reference: every other structure must return its answers, bit for bit. Its own are compared "
    "with integer and rational arithmetic: see [correctness](../correctness.md#how-it-is-tested).",
}
"""Statements about structures without published claims."""

Row = Mapping[str, Any]


@dataclass(frozen=True)
class Cost:
    """Sizes of a tree over the torus, and mean counters of a ray of each set: steps and triangle tests."""

    statistics: Mapping[str, Any]
    steps: Mapping[str, float]
    tests: Mapping[str, float]


class Scene:
    """The torus and its rays, made once for all structures."""

    def __init__(self, native: Native) -> None:
        self.workload: Workload = growth.torus(TRIANGLES)
        tracer = native.build(self.workload.vertices, self.workload.triangles, "kd", threads=1)
        made = rays.make(self.workload, tracer, size=SIZE, seed=1, names=SETS)
        self.rays: list[RaySet] = [replace(some, order="none") for some in made]

    def cost(self, native: Native, name: str) -> Cost:
        """The cost of a structure with its default parameters, rays one by one."""
        tree = native.build(self.workload.vertices, self.workload.triangles, name, threads=1)
        counted = {some.name: counting.counters(tree, some, 1) for some in self.rays}
        steps, tests = (
            {name: float(found[key].mean()) for name, found in counted.items()} for key in ("steps", "tests")
        )
        return Cost(tree.statistics, steps, tests)


def claims_of(row: Row) -> Iterator[tuple[str, str]]:
    """The claims about the structure of a row: statement, and heading of docs/papers.md."""
    for claim in CLAIMS:
        if any(fnmatch.fnmatch(claim.id, one) for one in row["claims"]):
            heading = next(heading for pattern, heading in HEADINGS.items() if fnmatch.fnmatch(claim.id, pattern))
            yield f"{claim.statement} ({claim.paper}; `{claim.id}`)", heading


def page(row: Row, cost: Cost, pictures: Collection[str]) -> str:
    """The page of a row of `halfspace_native.structures()`. pictures: names of the pictures that there are."""
    lines = [f"# {row['label']} {{#{row['id']}}}", "", f"`{row['id']}`. {row['summary']}", ""]
    if row["id"] in pictures:
        what = ": the triangles of the built-in scene alone" if row["family"] == "oracle" else " of the built-in scene"
        lines += [f"![{row['label']}{what}](../pictures/{row['id']}.jpg)", ""]
    if row["aliases"]:
        lines += [f"Also known as {structures_page.others(row)}.", ""]
    lines += [
        "## Source",
        "",
        f"{row['paper']}.",
        "",
        *_claims(row),
        *_costs(cost),
        *_ways(row),
        *_parameters(row),
    ]
    return "\n".join(lines) + "\n"


def _claims(row: Row) -> list[str]:
    """The claims, or the statement. Raises KeyError for a structure with neither."""
    found = list(claims_of(row))
    if not found:
        return ["## Claims", "", STATED[row["id"]], ""]
    lines = ["## Claims", "", "What its authors claim; the links lead to what was measured.", ""]
    return [*lines, *(f"- {text}: [measured](../papers.md#{heading})" for text, heading in found), ""]


def _costs(cost: Cost) -> list[str]:
    """Sizes and counters as a table."""
    size = cost.statistics
    rows = [
        ("bytes per triangle", f"{size['bytes'] / TRIANGLES:.1f}"),
        ("nodes along axes, oblique", f"{size['nodes_axis']:,}, {size['nodes_oblique']:,}"),
        ("leaves, of which empty", f"{size['leaves']:,}, {size['leaves_empty']:,}"),
        ("references per triangle", f"{size['references'] / TRIANGLES:.2f}"),
        ("depth, mean and largest", f"{size['depth_mean']:.1f}, {size['depth_max']}"),
        ("expected cost (SAH)", f"{size['sah_cost']:.0f}"),
    ]
    rows += [
        (f"steps and triangle tests of a {name} ray", f"{cost.steps[name]:.1f}, {cost.tests[name]:.1f}")
        for name in cost.steps
    ]
    text = (
        f"Over a torus of {TRIANGLES:,} triangles, with the default parameters and rays one by one. These numbers "
        "depend on no machine; times are in [results](../results.md)."
    )
    return ["## Cost", "", text, "", "| measure | value |", "| --- | ---: |", *(f"| {a} | {b} |" for a, b in rows), ""]


def _ways(row: Row) -> list[str]:
    lines = [
        "## Nodes and rays",
        "",
        "The default first.",
        "",
        "| nodes | traversal | what it does |",
        "| --- | --- | --- |",
    ]
    for way in row["ways"]:
        traversal = f"`{way['traversal']}`" if way["traversal"] else ""
        lines.append(f"| `{way['nodes']}` | {traversal} | {structures_page.cell(way['doc'])} |")
    return [*lines, ""]


def _parameters(row: Row) -> list[str]:
    if not row["parameters"]:
        return ["It has no parameters."]
    lines = ["## Parameters", "", "| parameter | meaning | values |", "| --- | --- | --- |"]
    for one in row["parameters"]:
        cells = (f"`{one['name']}`", structures_page.text_of(one), structures_page.values_of(one))
        lines.append("| " + " | ".join(map(structures_page.cell, cells)) + " |")
    return lines


def index(rows: Sequence[Row], pictures: Collection[str]) -> str:
    """The page that links all structures by family, with their pictures."""
    families: dict[str, list[Row]] = {}
    for row in rows:
        families.setdefault(row["heading"], []).append(row)
    shown = "its picture, source" if pictures else "its source"
    lines = ["# Gallery", "", f"Every structure with {shown}, cost and claims, or what is stated in their place.", ""]
    for heading, members in families.items():
        lines += [f"## {heading}", ""]
        lines += ['<div class="gallery" markdown>', ""]
        for row in members:
            picture = f"![{row['label']}](../pictures/{row['id']}.jpg)" if row["id"] in pictures else ""
            lines += [f"[{picture} {row['label']}]({row['id']}.md)".replace("[ ", "["), ""]
        lines += ["</div>", ""]
    return "\n".join(lines)
