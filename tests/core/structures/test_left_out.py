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
    "split planes",
    "cut triangles",
    "nodes of one child",
    "cells",
    "spatial splits",
    "lazy",
    *(
        f"{what} across {axes}"
        for what in ("walls", "planes")
        for axes in ("x", "y", "z", "x and y", "x and z", "y and z", "x and y and z")
    ),
}
"""Subjects of such lines, without that of the levels of octrees, which names a number."""


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


def boxes(count: int = 300) -> tuple[Any, Any]:
    """Boxes along the axes, most of them far apart."""
    rng = np.random.default_rng(5)
    found = []
    for low, size in zip(rng.random((count, 3)) * 9, 0.1 + rng.random((count, 3)) * 0.4, strict=True):
        at = [low + size * np.array([i & 1, i >> 1 & 1, i >> 2 & 1]) for i in range(8)]
        for axis in range(3):
            a, b = 1 << (axis + 1) % 3, 1 << (axis + 2) % 3
            for side in (0, 1 << axis):
                found += [(at[side], at[side | a], at[side | a | b]), (at[side], at[side | a | b], at[side | b])]
    return corners(*found)


SCENES = {
    "boxes": boxes(),
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
    if structure.parameter("nodes") is not None:
        specs.append(f"{name}:nodes=boxes")
    if structure.parameter("lazy") is not None:
        specs += [f"{spec}{',' if ':' in spec else ':'}lazy=1" for spec in specs if "nodes=" not in spec]
    for spec in specs:
        built = native.build(*SCENES[scene], spec)
        numbers = built.statistics
        lines = dict(line.split(": ", 1) for line in numbers["left_out"])
        assert len(lines) == len(numbers["left_out"]), "two lines about one subject"
        assert {subject for subject in lines if not re.match(r"levels below \d+ of \d+$", subject)} <= SUBJECTS, lines
        nodes = numbers["nodes_axis"] + numbers["nodes_oblique"]
        if scene == "nothing" or not (nodes or name == "grid"):
            assert not lines, "there was nothing to leave out"
        if {"oblique planes", "turned boxes"} & set(lines):
            assert structure.parameter("oblique_cost") or structure.parameter("oblique_step_cost")
            assert numbers["nodes_oblique"] == 0
            assert name == "obb" or not (built.split_polygons()["kind"] == 3).any()
            assert "directions besides the axes" not in lines, "without oblique planes there are no such directions"
        planes = nodes
        if (found := lines.get("split planes")) is not None:
            met, planes = map(int, re.findall(r"the (\d+) nodes of boxes made from (\d+) planes", found)[0])
            assert met == nodes
            assert "nodes=boxes" in spec
        if found := re.findall(r"at (\d+) of (\d+) split planes", lines.get("directions besides the axes", "")):
            few, of = map(int, found[0])
            assert 0 < few <= of == planes
        if (found := lines.get("cells")) is not None:
            made, wanted = map(int, re.findall(r"(\d+) of (\d+)", found)[0])
            assert made < wanted


@pytest.mark.parametrize(
    ("spec", "scene", "expected"),
    [
        *((spec, "soup", []) for spec in ("bvh-sah", "grid", "brute", "kd-sah", "bvh-sah:width=2")),
        ("kd", "boxes", []),
        ("kd", "strip", ["planes across z: the scene has no extent there", "cut triangles: no plane goes through one"]),
        ("kd-sah", "strip", ["planes across z: the scene has no extent there"]),
        ("bih:empty=0", "soup", []),
        ("bih", "strip", ["nodes of one child: nowhere is enough space empty"]),
        ("octree-net:max_depth=4,references=64", "soup", []),
        ("octree-net:max_depth=19", "one triangle", []),
        ("bsp-wn-plus-kd", "boxes", ["oblique planes: every triangle is parallel to two axes"]),
        ("bsp-cn-plus-kd", "boxes", ["oblique planes: every triangle is parallel to two axes"]),
        ("rbsp", "boxes", ["directions besides the axes: every triangle is parallel to two axes"]),
        ("rbsp:costs=thesis", "boxes", []),
        ("rbsp:set=spiral", "boxes", []),
        ("bih-obl", "boxes", ["oblique planes: every triangle is parallel to two axes"]),
        ("obb", "boxes", ["turned boxes: every triangle is parallel to two axes"]),
        (
            "bvh-sah:splits=1",
            "strip",
            ["spatial splits: every triangle is parallel to two axes, and a ray meets the boxes of 1.0 of them"],
        ),
    ],
)
def test_a_scene_has_the_lines_of_what_it_does_not_need(spec: str, scene: str, expected: list[str]) -> None:
    assert native.build(*SCENES[scene], spec).statistics["left_out"] == expected


def test_levels_of_octrees_are_left_out_for_one_of_two_reasons() -> None:
    few = native.build(*SCENES["soup"], "octree-param:max_depth=19,leaf_size=16,references=64").statistics
    (line,) = few["left_out"]
    assert line == f"levels below {few['depth_max']} of 19: no cell holds more than 16 triangles any more"
    many = native.build(*soup(4000, 3, box=20, size=1), "octree-param:max_depth=19,references=1").statistics
    (line,) = many["left_out"]
    assert line == f"levels below {many['depth_max']} of 19: cells would need more than 1 references per triangle"
