# SPDX-License-Identifier: GPL-3.0-or-later
"""One structure for each kind of tree, for tests of what does not depend on how a tree was built.

The contract tests of the native crate run over all structures.
"""

from __future__ import annotations

from collections.abc import Collection

import halfspace_native as native

KINDS = (
    "kd",
    "kd-object",
    "rbsp",
    "bsp-ize-kd",
    "bsp-wn-plus-kd",
    "beam-hh",
    "bvh-sah",
    "obb",
    "bih",
    "bih-obl",
    "bbox-gs",
    "octree-param",
    "octree-beam",
    "octree-glassner",
    "grid",
    "brute",
)
"""Memory layouts and traversals that differ: planes across the axes, of few and of any directions, beams, boxes of both
kinds, intervals, octants with and without links, cells, and no tree."""


def _ways(ids: Collection[str]) -> set[tuple[str, str]]:
    """Nodes and traversals of these structures."""
    rows = [row for row in native.structures() if row["id"] in ids]
    return {(way["nodes"], way["traversal"]) for row in rows for way in row["ways"]}


assert _ways(KINDS) == _ways([row["id"] for row in native.structures()]), "a way of no structure here"
