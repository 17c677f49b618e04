# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of trees against the statistics of the native module, of every structure."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from addon.core.base import native
from addon.core.tree import location, regions, table
from tests.kinds import KINDS

MODULE = native.load()


def some_triangles() -> tuple[Any, Any]:
    """Corners and triangles, tilted and of different sizes."""
    rng = np.random.default_rng(3)
    corners = rng.random((150, 1, 3)) * 4 + rng.choice([0.1, 0.8], (150, 1, 1)) * rng.standard_normal((150, 3, 3))
    return corners.astype(np.float32).reshape(-1, 3), np.arange(450, dtype=np.int32).reshape(-1, 3)


VERTICES, TRIANGLES = some_triangles()


def made(spec: str) -> tuple[Any, table.Table]:
    structure = MODULE.build(VERTICES, TRIANGLES, spec)
    return structure, table.read(structure, VERTICES, TRIANGLES)


@pytest.mark.parametrize("spec", KINDS)
def test_costs_of_nodes_and_overlap_are_those_of_the_analysis(spec: str) -> None:
    structure, nodes = made(spec)
    found = structure.analysis()
    assert nodes.costs.sum() == pytest.approx(found["sah_nodes"] + found["sah_leaves"], rel=1e-7)
    assert nodes.costs_below[0] == pytest.approx(nodes.costs.sum())
    assert (table.TEST_COST * nodes.shares * nodes.counts).sum() == pytest.approx(found["sah_leaves"], rel=1e-7)
    assert (nodes.shares <= 1 + 1e-9).all()
    # The overlap of a sample is within its error.
    points, owners = location.surface(VERTICES, TRIANGLES)
    each = location.overlap(nodes, points, owners).sum(axis=0)
    wanted, error = found["epo"], each.std() / np.sqrt(len(each))
    assert abs(each.mean() - wanted) <= 5 * error
    assert (wanted > 0) == (each.mean() > 0)


@pytest.mark.parametrize("spec", ["kd", "bsp-wn-plus-kd", "bvh-sah", "bih", "obb", "octree-net", "grid"])
def test_the_leaf_of_a_point_holds_its_triangle(spec: str) -> None:
    _, nodes = made(spec)
    points, owners = location.surface(VERTICES, TRIANGLES, 500)
    depths = location.leaf_depths(nodes, points, owners)
    leaves = np.flatnonzero(nodes.kind == table.LEAF)
    for point, triangle, depth in list(zip(points, owners, depths, strict=True))[::25]:
        # Search all leaves, by their faces.
        holding = [leaf for leaf in leaves if triangle in nodes.triangles_of(leaf) and contains(nodes, leaf, point)]
        assert depth in nodes.depth[holding]
    assert depths.min() >= 0


def contains(nodes: table.Table, leaf: int, point: Any) -> bool:
    """Whether a point is inside all faces of a node, which are seen from their middle."""
    faces = nodes.node_faces(leaf)
    middle = np.mean([face.mean(axis=0) for face in faces], axis=0)
    for face in faces:
        normal = np.cross(face[1] - face[0], face[2] - face[0])
        if normal @ normal > 0:
            side = (normal @ (middle - face[0]), normal @ (point - face[0]))
            if side[0] * side[1] < 0 and abs(side[1]) > 1e-4 * np.linalg.norm(normal):
                return False
    return True


@pytest.mark.parametrize("spec", ["kd", "bvh-sah", "octree-net"])
def test_the_browser_goes_from_node_to_node(spec: str) -> None:
    _, nodes = made(spec)
    children = nodes.children_of(0)
    assert (nodes.parent[children] == 0).all()
    assert nodes.sibling(0, 1) == 0
    around = [nodes.sibling(int(children[0]), step) for step in range(len(children))]
    assert around == children.tolist()
    assert nodes.sibling(int(children[0]), -1) == children[-1]
    leaf = nodes.costliest_leaf()
    assert nodes.costs[leaf] == nodes.costs[nodes.kind == table.LEAF].max()
    chain = nodes.ancestors(leaf)
    assert chain[0] == 0
    assert chain[-1] == leaf
    assert [int(nodes.depth[node]) for node in chain] == list(range(len(chain)))
    assert nodes.costliest_child(leaf) == leaf
    assert nodes.costs_below[nodes.costliest_child(0)] == nodes.costs_below[children].max()
    assert nodes.triangles_of(0).tolist() == np.unique(nodes.triangles).tolist()
    assert nodes.references[0] == len(nodes.triangles)
    assert nodes.sizes[0] == len(nodes)


def test_faces_of_a_cube_cut_by_a_plane() -> None:
    sides = [(*(sign * np.eye(3)[axis]), 1.0) for axis in range(3) for sign in (1, -1)]
    corner = (*(np.ones(3) / np.sqrt(3)), 0.0)  # a plane through the middle, whose section is a regular hexagon
    walls = np.array([*sides, *sides, corner], np.float64)
    bounds = np.tile(np.array([-1.0, -1, -1, 1, 1, 1]), (2, 1))
    found = regions.faces(walls, np.array([0, 6, 13]), bounds)
    areas = np.bincount(found.owner, found.areas())
    assert areas == pytest.approx([24.0, 12.0 + 3 * np.sqrt(3)])


def test_a_tree_that_is_too_large_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table, "MOST_NODES", 10)
    with pytest.raises(table.TreeError, match="reads up to 10"):
        made("kd-sah")


def test_triangles_without_a_finite_vertex_are_an_error_with_its_reason() -> None:
    nowhere = np.full((3, 3), np.nan, np.float32)
    triangle = np.array([[0, 1, 2]], np.int32)
    with pytest.raises(table.TreeError, match="no vertex is finite"):
        table.read(MODULE.build(nowhere, triangle, "kd"), nowhere, triangle)
