# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of the inspector as CSV: nodes, steps of a ray, worst rays, levels, maps."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from ..base.arrays import F32
from ..tree.table import KIND_LABELS, Table
from .ray_costs import RayCosts
from .replay import Replay


def text(rows: Iterable[Mapping[str, Any]]) -> str:
    """The rows as CSV with one line of names, those of the first row; "" without rows."""
    written = io.StringIO()
    writer = None
    for row in rows:
        if writer is None:
            writer = csv.DictWriter(written, list(row), lineterminator="\n")
            writer.writeheader()
        writer.writerow(row)
    return written.getvalue()


def nodes(table: Table) -> Iterator[dict[str, Any]]:
    """Every node: place, region, share, costs and triangles."""
    for node in range(len(table)):
        yield {
            "node": node,
            "parent": int(table.parent[node]),
            "level": int(table.depth[node]),
            "kind": KIND_LABELS[table.kind[node]],
            "children": len(table.children_of(node)),
            "triangles": int(table.counts[node]),
            "triangles_below": int(table.references[node]),
            "share": f"{table.shares[node]:.9g}",
            "sah": f"{table.costs[node]:.9g}",
            "sah_below": f"{table.costs_below[node]:.9g}",
            **{
                name: f"{value:.9g}"
                for name, value in zip(
                    ("x_min", "y_min", "z_min", "x_max", "y_max", "z_max"), table.bounds[node], strict=True
                )
            },
        }


def steps(table: Table, replay: Replay) -> Iterator[dict[str, Any]]:
    """Every step of a ray."""
    for number, step in enumerate(replay.steps, 1):
        yield {
            "step": number,
            "node": step.node,
            "level": step.depth,
            "kind": KIND_LABELS[table.kind[step.node]],
            "enter": f"{step.enter:.9g}",
            "leave": f"{step.leave:.9g}",
            "tests": step.tests,
        }


def rays(costs: RayCosts) -> Iterator[dict[str, Any]]:
    """Every ray of a set: pixel, origin, direction and counts."""
    for index in range(len(costs)):
        origin, direction = costs.rays.origins[index], costs.rays.directions[index]
        yield {
            "set": costs.rays.name,
            "ray": index,
            "column": int(costs.pixels[index, 0]),
            "row": int(costs.pixels[index, 1]),
            **{f"origin_{axis}": f"{value:.9g}" for axis, value in zip("xyz", origin, strict=True)},
            **{f"direction_{axis}": f"{value:.9g}" for axis, value in zip("xyz", direction, strict=True)},
            "t_max": f"{costs.rays.t_max[index]:.9g}",
            "steps": int(costs.steps[index]),
            "tests": int(costs.tests[index]),
            "wasted": int(costs.wasted[index]),
        }


def pixels(values: Mapping[str, F32]) -> Iterator[dict[str, Any]]:
    """Every pixel of maps of one size, rows from the top; one column for each map."""
    flipped = {name: np.asarray(one)[::-1] for name, one in values.items()}
    height, width = next(iter(flipped.values())).shape
    for row in range(height):
        for column in range(width):
            yield {
                "column": column,
                "row": row,
                **{name: f"{one[row, column]:.9g}" for name, one in flipped.items()},
            }
