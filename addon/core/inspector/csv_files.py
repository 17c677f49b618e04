# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of the inspector as CSV: nodes, steps of a ray, worst rays, levels, maps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.arrays import F64
from ..tree.table import KIND_LABELS, Table
from . import ray_costs
from .ray_costs import BLOCK, SETS, RayCosts
from .replay import Replay


def nodes(table: Table) -> Iterator[dict[str, Any]]:
    """Every node, see `node`."""
    for row in range(len(table)):
        yield node(table, row)


def node(table: Table, row: int) -> dict[str, Any]:
    """A node: place, region, share, costs and triangles."""
    sides = zip(("x_min", "y_min", "z_min", "x_max", "y_max", "z_max"), table.bounds[row], strict=True)
    return {
        "node": row,
        "parent": int(table.parent[row]),
        "level": int(table.depth[row]),
        "kind": KIND_LABELS[table.kind[row]],
        "children": len(table.children_of(row)),
        "triangles": int(table.counts[row]),
        "triangles_below": int(table.references[row]),
        "share": f"{table.shares[row]:.9g}",
        "sah": f"{table.costs[row]:.9g}",
        "sah_below": f"{table.costs_below[row]:.9g}",
        **{name: f"{value:.9g}" for name, value in sides},
    }


def steps(table: Table, replay: Replay) -> Iterator[dict[str, Any]]:
    """Every step of a ray. counted: inner nodes that the traversal had counted when it tested the leaf."""
    for number, step in enumerate(replay.steps, 1):
        yield {
            "step": number,
            "node": step.node,
            "level": step.depth,
            "kind": KIND_LABELS[table.kind[step.node]],
            "enter": f"{step.enter:.9g}",
            "leave": f"{step.leave:.9g}",
            "tests": step.tests,
            "counted": step.reached if step.reached >= 0 else "",
        }


@dataclass(frozen=True, eq=False)
class Times:
    """The measured times of the rays of a set. nanoseconds: (b,) per ray of each block, from `ray_costs.block_times`.
    wrong: of the `compared` answers of the same structure.
    """

    nanoseconds: F64
    wrong: int
    compared: int

    @property
    def answers(self) -> str:
        """The number of wrong answers, of those compared, as text."""
        return f"{self.wrong:,} of {self.compared:,} answers wrong"


def rays(costs: RayCosts, key: str, times: Times) -> Iterator[dict[str, Any]]:
    """Every ray of a set from the worst on, see `ray`. key: of `ray_costs.KEYS`, the order."""
    for index, rank in zip(*ray_costs.ranked(costs, key, times.nanoseconds), strict=True):
        yield ray(costs, int(index), int(rank), times)


def ray(costs: RayCosts, index: int, rank: int, times: Times) -> dict[str, Any]:
    """A ray: rank, kind, pixel, counts, time with the errors of its structure, origin and direction."""
    origin, direction = costs.rays.origins[index], costs.rays.directions[index]
    return {
        "rank": rank,
        "kind": SETS[costs.rays.name].lower(),
        "ray": index,
        "column": int(costs.pixels[index, 0]),
        "row": int(costs.pixels[index, 1]),
        "steps": int(costs.steps[index]),
        "tests": int(costs.tests[index]),
        "wasted": int(costs.wasted[index]),
        "nanoseconds": f"{times.nanoseconds[index // BLOCK]:.9g}",
        "wrong_answers": times.wrong,
        "compared_answers": times.compared,
        **{f"origin_{axis}": f"{value:.9g}" for axis, value in zip("xyz", origin, strict=True)},
        **{f"direction_{axis}": f"{value:.9g}" for axis, value in zip("xyz", direction, strict=True)},
        "t_max": f"{costs.rays.t_max[index]:.9g}",
    }


def pixels(values: Mapping[str, F64]) -> Iterator[dict[str, Any]]:
    """Every pixel of maps of one size, rows from the top; one column for each map, with every digit of its numbers."""
    flipped = {name: np.asarray(one)[::-1] for name, one in values.items()}
    height, width = next(iter(flipped.values())).shape
    for row in range(height):
        for column in range(width):
            yield {
                "column": column,
                "row": row,
                **{name: np.format_float_positional(one[row, column], trim="-") for name, one in flipped.items()},
            }
