# SPDX-License-Identifier: GPL-3.0-or-later
"""Reports of a structure on what it leaves out: true, never of what it cannot have, and without contradictions."""

from __future__ import annotations

import re
from typing import Any

import halfspace_native as native
import numpy as np
import pytest

from addon.core.structures import catalogue
from tests.kinds import KINDS
from tests.rooms_of_triangles import soup

SUBJECTS = {
    "oblique planes",
    "turned boxes",
    "directions of small nodes",
    "directions besides the axes",
    "cells",
    "spatial splits",
    "lazy",
    *(f"walls across {axes}" for axes in ("x", "y", "z", "x and y", "x and z", "y and z", "x and y and z")),
}
"""Subjects of such lines."""


def corners(*triangles: Any) -> tuple[Any, Any]:
    """Vertices and triangles."""
    points = np.array(triangles, np.float32).reshape(-1, 3)
    return points, np.arange(len(points), dtype=np.int32).reshape(-1, 3)


def room() -> tuple[Any, Any]:
    """Right triangles, all parallel to two axes."""
    rng = np.random.default_rng(2)
    found = []
    for _ in range(60):
        low, axis = rng.random(3) * 9, int(rng.integers(3))
        a, b = ((axis + 1) % 3, (axis + 2) % 3)
        one, two = low.copy(), low.copy()
        one[a] += 1 + rng.random()
        two[b] += 1 + rng.random()
        found.append((low, one, two))
    return corners(*found)


SCENES = {
    "nothing": corners(),
    "one triangle": corners(((0, 0, 0), (1, 0, 0), (0, 1, 1))),
    "room": room(),
    "soup": soup(400, 3, box=8, size=0.4),
    # In one plane, so that a grid has one layer of cells.
    "strip": corners(*(((i, 0, 0), (i + 1, 0, 0), (i, 1, 0)) for i in range(40))),
}


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("scene", SCENES)
def test_lines_are_true_and_agree(name: str, scene: str) -> None:
    structure = catalogue.load()[name]
    specs = [name]
    if structure.parameter("k") is not None:
        specs.append(f"{name}:k=3")
    if structure.parameter("lazy") is not None:
        specs += [spec + (",lazy=1" if ":" in spec else ":lazy=1") for spec in specs]
    for spec in specs:
        built = native.build(*SCENES[scene], spec)
        numbers = built.statistics
        lines = dict(line.split(": ", 1) for line in numbers["left_out"])
        assert len(lines) == len(numbers["left_out"]), "two lines about one subject"
        assert set(lines) <= SUBJECTS, lines
        nodes = numbers["nodes_axis"] + numbers["nodes_oblique"]
        if scene == "nothing" or not (nodes or name == "grid"):
            assert not lines, "there was nothing to leave out"
        if {"oblique planes", "turned boxes"} & set(lines):
            assert structure.parameter("oblique_cost") or structure.parameter("oblique_step_cost")
            assert numbers["nodes_oblique"] == 0
            assert name == "obb" or not (built.split_polygons()["kind"] == 3).any()
            assert "directions besides the axes" not in lines, "without oblique planes there are no such directions"
        if (found := lines.get("directions besides the axes")) is not None:
            few, of = map(int, re.findall(r"at (\d+) of (\d+) nodes", found)[0])
            assert 0 < few <= of == nodes
        if (found := lines.get("cells")) is not None:
            made, wanted = map(int, re.findall(r"(\d+) of (\d+)", found)[0])
            assert made < wanted


def test_an_octree_and_a_box_hierarchy_leave_no_planes_out() -> None:
    for spec in ("octree-net", "bvh-sah", "bih", "grid", "brute", "kd"):
        assert native.build(*SCENES["soup"], spec).statistics["left_out"] == [], spec
    (line,) = native.build(*SCENES["room"], "bsp-wn-plus-kd").statistics["left_out"]
    assert line == "oblique planes: every triangle is parallel to two axes"
